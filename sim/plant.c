/* SPDX-License-Identifier: MIT */
#include "sim/plant.h"

#include "sim/effect.h"

#include <math.h>

/// The plant as the chain of its masses.
struct state {
    double position[sim_masses_max], velocity[sim_masses_max];
    double bristle, time_s;
};

void sim_plant_init(struct sim_plant *self, double position)
{
    *self = (struct sim_plant){.position = position, .load_position = position, .attached_position = position};
}

static bool has_load(const struct sim_stepper *stepper)
{
    return stepper->model.structure == sim_structure_two_mass;
}

static void take(const struct sim_plant *plant, const struct sim_stepper *stepper, struct state *out)
{
    size_t attached = has_load(stepper) ? 2 : 1;
    out->position[0] = plant->position;
    out->velocity[0] = plant->velocity;
    out->position[1] = plant->load_position;
    out->velocity[1] = plant->load_velocity;
    if (attached < stepper->chain.masses) {
        out->position[attached] = plant->attached_position;
        out->velocity[attached] = plant->attached_velocity;
    }
    out->bristle = plant->bristle;
    out->time_s = plant->time_s;
}

static void give(const struct state *s, const struct sim_stepper *stepper, struct sim_plant *out)
{
    size_t masses = stepper->chain.masses, load = has_load(stepper) ? 1 : 0;
    *out = (struct sim_plant){.position = s->position[0],
                              .velocity = s->velocity[0],
                              .load_position = s->position[load],
                              .load_velocity = s->velocity[load],
                              .attached_position = s->position[masses - 1],
                              .attached_velocity = s->velocity[masses - 1],
                              .bristle = s->bristle,
                              .time_s = s->time_s};
}

// ---- Torques at an instant

static void opposing(const struct sim_stepper *stepper, const struct sim_motion *motion, struct sim_opposing *out)
{
    *out = stepper->steady;
    out->viscous += stepper->model.viscous_friction_Nms_per_rad * motion->velocity;
    for (size_t i = 0; i < stepper->oppose.count; i++) {
        size_t e = stepper->oppose.effects[i];
        sim_effects[e]->oppose(stepper->model.effect_parameters[e], motion, out);
    }
}

void sim_plant_opposing(const struct sim_model *model, const struct sim_motion *motion,
                        struct sim_opposing *out_opposing)
{
    struct sim_stepper stepper;
    sim_stepper_init_once(&stepper, model, 1.0);
    opposing(&stepper, motion, out_opposing);
}

static struct sim_motion motion_of(const struct state *s, const struct sim_stepper *stepper)
{
    return (struct sim_motion){
        .position = s->position[0], .velocity = s->velocity[0], .time_s = s->time_s, .linear = stepper->model.linear};
}

/// The belt as it is now, after what effects make of it.
static struct sim_belt belt_of(const struct state *s, const struct sim_stepper *stepper)
{
    struct sim_motion motion = motion_of(s, stepper);
    struct sim_belt belt = {.twist = s->position[0] - s->position[1],
                            .twist_rate = s->velocity[0] - s->velocity[1],
                            .stiffness = stepper->chain.stiffness[0],
                            .damping = stepper->chain.damping[0]};
    for (size_t i = 0; i < stepper->bend.count; i++) {
        size_t e = stepper->bend.effects[i];
        sim_effects[e]->bend(stepper->model.effect_parameters[e], &motion, &belt);
    }
    return belt;
}

/// Torque of each link on the mass behind it.
static void link_torques(const struct state *s, const struct sim_stepper *stepper, double *out)
{
    const struct sim_chain *c = &stepper->chain;
    for (size_t i = 0; i + 1 < c->masses; i++)
        out[i] = c->stiffness[i] * (s->position[i] - s->position[i + 1]) +
                 c->damping[i] * (s->velocity[i] - s->velocity[i + 1]);
    if (stepper->bend.count == 0)
        return;
    struct sim_belt belt = belt_of(s, stepper);
    out[0] = belt.stiffness * belt.twist + belt.damping * belt.twist_rate;
}

/// Torque left for acceleration and dry friction, and that friction's level for motion in `direction`.
static double driving_torque(const struct state *s, const struct sim_stepper *stepper, double torque, double link,
                             int direction, double *out_dry)
{
    struct sim_motion motion = motion_of(s, stepper);
    struct sim_opposing o;
    opposing(stepper, &motion, &o);
    double factor = direction >= 0 ? o.positive_factor : o.negative_factor;
    *out_dry = factor * o.dry;
    return torque - o.smooth - factor * o.viscous - link;
}

/// Where a Runge-Kutta step starts, and under what.
struct course {
    const struct sim_stepper *stepper;
    double torque;
    int direction; ///< of the motor's motion, +1 or -1; 0: it is held
    double from;   ///< motor position at which the friction was `bristle` and its level `level`
    double bristle, level;
    double missing, power; ///< share of that level that was missing, and its power 1 - n: at a level that stays
};

/// Whether friction builds up as an exponential does.
static bool is_exponential(const struct sim_stepper *stepper)
{
    const double same = 1e-6;
    return fabs(stepper->build_up_exponent - 1.0) < same;
}

/// Share that is left, after a way in distances, of what was missing: dr/dx = -r^n of r times the level. With n below 1
/// it comes to an end.
static double left_missing(const struct course *course, double missing, double way)
{
    if (is_exponential(course->stepper))
        return exp(-way);
    if (!(missing > 0.0 && isfinite(missing)))
        return 0.0;
    double exponent = 1.0 - course->stepper->build_up_exponent;
    double left = (missing == course->missing ? course->power : pow(missing, exponent)) - exponent * way;
    return left > 0.0 ? pow(left, 1.0 / exponent) / missing : 0.0;
}

/// Friction that builds up, its level straight from where the step began to here: what was missing fades with the way,
/// whatever the speed.
static double built_up(const struct course *course, double position, double dry)
{
    double way = fabs(position - course->from) / course->stepper->build_up, level = course->direction * dry;
    if (!(way > 0.0))
        return course->bristle;
    double faded = -expm1(-way), missing = course->bristle - course->level;
    double left = left_missing(course, fabs(missing) / dry, way);
    return level - (level - course->level) * faded / way + missing * left;
}

/// What the bristles' own damper adds while friction that builds up changes: none where it is built up.
static double bristle_damping(const struct course *course, const struct state *s, double friction, double dry)
{
    const struct sim_stepper *stepper = course->stepper;
    double missing = course->direction * dry - friction;
    if (!(stepper->build_up_damping_s > 0.0 && dry > 0.0))
        return 0.0;
    double share = fmin(fabs(missing) / dry, 2.0), exponent = stepper->build_up_exponent;
    double rate = dry * (exponent == 1.0 ? share : pow(share, exponent)) * fabs(s->velocity[0]) / stepper->build_up;
    return stepper->build_up_damping_s * copysign(rate, missing);
}

static double motor_acceleration(const struct state *s, const struct course *course, double link)
{
    const struct sim_stepper *stepper = course->stepper;
    double dry, driving = driving_torque(s, stepper, course->torque, link, course->direction, &dry);
    double friction = stepper->build_up > 0.0 ? built_up(course, s->position[0], dry) : (double)course->direction * dry;
    if (stepper->build_up > 0.0)
        friction += bristle_damping(course, s, friction, dry);
    return (driving - friction) / stepper->chain.inertia[0];
}

/// Dry friction that motion in a direction would have in the end.
static double dry_level(const struct state *s, const struct sim_stepper *stepper, int direction)
{
    double dry;
    driving_torque(s, stepper, 0.0, 0.0, direction, &dry);
    return dry;
}

/// The level of friction that builds up where the step starts, and what is missing of it.
static void take_level(struct course *io, double dry)
{
    io->level = io->direction * dry;
    io->missing = fabs(io->bristle - io->level) / dry;
    if (!is_exponential(io->stepper))
        io->power = pow(io->missing, 1.0 - io->stepper->build_up_exponent);
}

// ---- Runge-Kutta steps

struct rates {
    double velocity[sim_masses_max], acceleration[sim_masses_max];
};

static void rates_at(const struct state *s, const struct course *course, struct rates *out)
{
    const struct sim_chain *c = &course->stepper->chain;
    double link[sim_masses_max] = {0.0};
    if (c->masses > 1)
        link_torques(s, course->stepper, link);
    out->velocity[0] = s->velocity[0];
    out->acceleration[0] = course->direction != 0 ? motor_acceleration(s, course, link[0]) : 0.0;
    for (size_t i = 1; i < c->masses; i++) {
        out->velocity[i] = s->velocity[i];
        out->acceleration[i] = (link[i - 1] - link[i]) / c->inertia[i];
    }
}

static void advance(const struct state *from, const struct rates *r, size_t masses, double dt_s, struct state *out)
{
    for (size_t i = 0; i < masses; i++) {
        out->position[i] = from->position[i] + dt_s * r->velocity[i];
        out->velocity[i] = from->velocity[i] + dt_s * r->acceleration[i];
    }
    out->time_s = from->time_s + dt_s;
}

static void add(struct rates *io_sum, const struct rates *r, size_t masses, double weight)
{
    for (size_t i = 0; i < masses; i++) {
        io_sum->velocity[i] += weight * r->velocity[i];
        io_sum->acceleration[i] += weight * r->acceleration[i];
    }
}

/// One classical Runge-Kutta step with the direction of friction held.
static void runge_kutta(const struct state *from, const struct sim_stepper *stepper, double torque, int direction,
                        double dt_s, struct state *out)
{
    struct course course = {stepper, torque, direction, from->position[0], from->bristle, 0.0, 0.0, 0.0};
    bool builds_up = stepper->build_up > 0.0 && direction != 0;
    if (builds_up)
        take_level(&course, dry_level(from, stepper, direction));
    size_t masses = stepper->chain.masses;
    struct rates sum, r; // of the masses that there are
    struct state at;
    rates_at(from, &course, &sum);
    advance(from, &sum, masses, dt_s / 2, &at);
    rates_at(&at, &course, &r);
    add(&sum, &r, masses, 2.0);
    advance(from, &r, masses, dt_s / 2, &at);
    rates_at(&at, &course, &r);
    add(&sum, &r, masses, 2.0);
    advance(from, &r, masses, dt_s, &at);
    rates_at(&at, &course, &r);
    add(&sum, &r, masses, 1.0);
    out->bristle = from->bristle;
    advance(from, &sum, masses, dt_s / 6, out);
    out->time_s = from->time_s + dt_s;
    if (builds_up)
        out->bristle = built_up(&course, out->position[0], dry_level(out, stepper, direction));
}

/// By how much the torque on a motor at rest exceeds what holds it, in the direction in which it exceeds it more.
static double excess(const struct state *s, const struct sim_stepper *stepper, double torque, int *out_direction)
{
    double link[sim_masses_max] = {0.0}, most = -INFINITY;
    if (stepper->chain.masses > 1)
        link_torques(s, stepper, link);
    for (int direction = -1; direction <= 1; direction += 2) {
        double dry;
        double driving = driving_torque(s, stepper, torque, link[0], direction, &dry);
        if (stepper->build_up > 0.0) { // it does not switch: what it is now counts
            driving -= s->bristle;
            dry = 0.0;
        }
        if (direction * driving - dry > most) {
            most = direction * driving - dry;
            *out_direction = direction;
        }
    }
    return most;
}

/// Direction in which a motor at rest sets off, 0 if friction holds it.
static int breakaway(const struct state *s, const struct sim_stepper *stepper, double torque)
{
    int direction;
    return excess(s, stepper, torque, &direction) > 0.0 ? direction : 0;
}

static int sign_of(double value)
{
    return value > 0.0 ? 1 : value < 0.0 ? -1 : 0;
}

/// Time after which the motor comes to rest in a step that ends with it running backward at end_speed. False position:
/// the straight line alone would drop a speed of the second order of the step, which a belt's changing pull makes felt.
static double time_to_rest(const struct state *s, const struct sim_stepper *stepper, double torque, double dt_s,
                           double end_speed)
{
    enum { refinements = 2 };
    int direction = sign_of(s->velocity[0]);
    double low_s = 0.0, low = fabs(s->velocity[0]), high_s = dt_s, high = end_speed, at_s = 0.0;
    for (int i = 0; i <= refinements; i++) {
        at_s = low_s + (high_s - low_s) * low / (low + high);
        if (i == refinements)
            break;
        struct state at = *s;
        runge_kutta(s, stepper, torque, direction, at_s, &at);
        double speed = direction * at.velocity[0];
        if (speed > 0.0) {
            low_s = at_s;
            low = speed;
        } else if (speed < 0.0) {
            high_s = at_s;
            high = -speed;
        } else {
            break;
        }
    }
    return at_s;
}

/// Holds the motor until the belt's pull exceeds what holds it, at most dt_s. Returns how long; out_direction is where
/// it sets off then, 0 if it does not.
static double hold(struct state *io, const struct sim_stepper *stepper, double torque, double dt_s, int *out_direction)
{
    enum { refinements = 3 };
    int unused;
    struct state next = *io;
    runge_kutta(io, stepper, torque, 0, dt_s, &next);
    *out_direction = stepper->chain.masses > 1 ? breakaway(&next, stepper, torque) : 0;
    double low_s = 0.0, high_s = dt_s, at_s = dt_s;
    if (*out_direction != 0) {
        double low = excess(io, stepper, torque, &unused), high = excess(&next, stepper, torque, &unused);
        for (int i = 0; i < refinements && low < 0.0; i++) {
            at_s = low_s + (high_s - low_s) * low / (low - high);
            runge_kutta(io, stepper, torque, 0, at_s, &next);
            double here = excess(&next, stepper, torque, &unused);
            *(here > 0.0 ? &high_s : &low_s) = at_s;
            *(here > 0.0 ? &high : &low) = here;
        }
    }
    *io = next;
    return at_s;
}

/// A step in which the motor may come to rest or set off: split there, so that its speed is exactly zero while it
/// sticks.
static void step_with_reversal(struct state *io, const struct sim_stepper *stepper, double torque, double dt_s)
{
    enum { events_max = 4 }; // in one step: after as many it is held to the end
    double left_s = dt_s;
    int set_off = 0;
    for (int event = 0; left_s > 0.0; event++) {
        bool rests = io->velocity[0] == 0.0;
        int direction = rests ? set_off : sign_of(io->velocity[0]);
        if (rests && direction == 0 && event < events_max)
            direction = breakaway(io, stepper, torque);
        if (direction == 0 && event < events_max) {
            left_s -= hold(io, stepper, torque, left_s, &set_off);
            if (set_off == 0)
                return;
            continue;
        }
        struct state next = *io;
        runge_kutta(io, stepper, torque, direction, left_s, &next);
        if (direction * next.velocity[0] >= 0.0) {
            *io = next;
            return;
        }
        double part_s = left_s;
        if (rests) // set off and came back within the step: it did not get away
            direction = 0;
        else
            part_s = time_to_rest(io, stepper, torque, left_s, fabs(next.velocity[0]));
        runge_kutta(io, stepper, torque, direction, part_s, &next);
        *io = next;
        io->velocity[0] = 0.0;
        left_s -= part_s;
        set_off = 0;
    }
}

// ---- Steps as fine as needed

/// Fastest mode with the belt as it is at this twist: a torque that grows with its cube is three times as stiff as it
/// is strong.
static double bent_rate(const struct state *s, const struct sim_stepper *stepper)
{
    struct sim_belt belt = belt_of(s, stepper);
    double stiffer = 3.0 * belt.stiffness / stepper->chain.stiffness[0] - 2.0;
    return stepper->chain_rate * sqrt(fmax(stiffer, 1.0));
}

static bool hangs_loose(const struct state *s, const struct sim_stepper *stepper)
{
    struct sim_belt belt = belt_of(s, stepper);
    return belt.twist == 0.0 && belt.twist_rate == 0.0;
}

/// What a gap takes of the twist: half of it, to the side on which the belt pulls; all of it where it hangs loose.
static double taken_twist(const struct state *s, const struct sim_stepper *stepper)
{
    return s->position[0] - s->position[1] - belt_of(s, stepper).twist;
}

/// Side of a gap in the belt on which it pulls; 0 where it hangs loose, and where it has no gap.
static int pulled_side(const struct state *s, const struct sim_stepper *stepper)
{
    return hangs_loose(s, stepper) ? 0 : sign_of(taken_twist(s, stepper));
}

/// Moves to just behind the edge of the gap that is met first in a step of dt_s, which would end as `*next` says; false
/// position, its end that stays halved (Illinois). Returns how long it took.
static double step_to_edge(struct state *io, const struct sim_stepper *stepper, double torque, double dt_s,
                           const struct state *next)
{
    enum { refinements = 8 };
    const double close = 1e-9;
    double edge = taken_twist(hangs_loose(io, stepper) ? next : io, stepper), low_s = 0.0, high_s = dt_s;
    double low = io->position[0] - io->position[1] - edge, high = next->position[0] - next->position[1] - edge;
    struct state end = *next;
    for (int i = 0; i < refinements && low * high < 0.0 && high_s - low_s > close * dt_s; i++) {
        struct state at = *io;
        double at_s = low_s + (high_s - low_s) * low / (low - high);
        step_with_reversal(&at, stepper, torque, at_s);
        double here = at.position[0] - at.position[1] - edge;
        if (here * low > 0.0) {
            low_s = at_s;
            low = here;
            high *= 0.5;
        } else {
            high_s = at_s;
            high = here;
            low *= 0.5;
            end = at;
        }
    }
    *io = end;
    return high_s;
}

/// A step during which a belt may go slack, tight, or through its gap, split there.
static void step_through_edges(struct state *io, const struct sim_stepper *stepper, double torque, double dt_s)
{
    enum { events_max = 4 };
    double left_s = dt_s;
    for (int event = 0; left_s > 0.0; event++) {
        struct state next = *io;
        step_with_reversal(&next, stepper, torque, left_s);
        if (event == events_max || pulled_side(io, stepper) == pulled_side(&next, stepper)) {
            *io = next;
            return;
        }
        left_s -= step_to_edge(io, stepper, torque, left_s, &next);
    }
}

/// The belt's torque jumps at the edge of a gap by what its damper makes, which a step that ends there feels ahead:
/// near that instant steps are shorter. The instant itself has to be exact, or what is predicted would jump with
/// whatever moves it.
static void step_belt(struct state *io, const struct sim_stepper *stepper, double torque, double dt_s)
{
    enum { parts = 16 };
    struct state next = *io;
    int side = pulled_side(io, stepper);
    step_with_reversal(&next, stepper, torque, dt_s);
    if (side == pulled_side(&next, stepper)) {
        *io = next;
        return;
    }
    for (int i = 0; i < parts; i++)
        step_through_edges(io, stepper, torque, dt_s / parts);
}

/// Of the rate: a look ahead is as good with longer steps.
static const double quick_share = 0.7;

/// Rate that friction which builds up asks for: of the motor swinging on it, and of the way in which it does so.
static double bristle_rate(const struct state *s, const struct sim_stepper *stepper, double dry)
{
    double swing = sqrt(dry / (stepper->build_up * stepper->chain.inertia[0]));
    return fmax(swing, 0.5 * fabs(s->velocity[0]) / stepper->build_up);
}

/// The same, of a look ahead, where what counts is the torque: friction that is nearly built up is a soft spring, and
/// little changes. Where the motor may turn back, the harder of both directions counts.
static double quick_bristle_rate(const struct state *s, const struct sim_stepper *stepper, double dry, double dt_s)
{
    double speed = fabs(s->velocity[0]) / stepper->build_up, missing = 1.0 - sign_of(s->velocity[0]) * s->bristle / dry;
    bool runs_on = speed * dt_s > 1.0;
    missing = runs_on ? fmax(missing, 0.0) : fmax(missing, 2.0 - missing);
    double slope = is_exponential(stepper) ? missing : pow(missing, stepper->build_up_exponent);
    double swing = sqrt(slope * dry / (stepper->build_up * stepper->chain.inertia[0]));
    return quick_share * fmax(swing, 0.5 * slope * speed);
}

/// Where friction is built up and the motor runs on, one step will do. Returns whether it did.
static bool slide(struct state *io, const struct sim_stepper *stepper, double torque, double dry, double dt_s)
{
    const double whole = 1e-6;
    int direction = sign_of(io->velocity[0]);
    struct state next = *io;
    if (direction == 0 || !(fabs(io->bristle - direction * dry) <= whole * dry))
        return false;
    runge_kutta(io, stepper, torque, direction, dt_s, &next);
    if (!(direction * next.velocity[0] > 0.0))
        return false;
    *io = next;
    return true;
}

static void step_finely(struct state *io, const struct sim_stepper *stepper, double torque, double whole_s)
{
    bool bent = stepper->bend.count > 0;
    double dry = 0.0;
    // `inner_steps` are for a whole step; a look ahead takes no more of them in a part than that asks for.
    size_t steps = bent             ? sim_stepper_inner_steps(bent_rate(io, stepper), whole_s)
                   : stepper->quick ? sim_stepper_inner_steps(stepper->chain_rate, whole_s)
                                    : stepper->inner_steps;
    if (stepper->build_up > 0.0) {
        dry = dry_level(io, stepper, sign_of(io->velocity[0]));
        if (!bent && steps == 1 && slide(io, stepper, torque, dry, whole_s))
            return;
        // Looking ahead, friction that builds up within a fraction of a step is as good as friction that switches.
        const size_t quick_most = 8;
        double rate = stepper->quick ? quick_bristle_rate(io, stepper, dry, whole_s) : bristle_rate(io, stepper, dry);
        size_t swings = sim_stepper_inner_steps(rate, whole_s);
        swings = stepper->quick && swings > quick_most ? quick_most : swings;
        steps = swings > steps ? swings : steps;
    }
    double dt_s = whole_s / (double)steps;
    for (size_t i = 0; i < steps; i++) {
        if (bent)
            step_belt(io, stepper, torque, dt_s);
        else if (!(stepper->build_up > 0.0) || !slide(io, stepper, torque, dry, dt_s))
            step_with_reversal(io, stepper, torque, dt_s);
    }
}

// ---- Exact steps

/// Moves the state by the transition of `direction`; the motor's first.
static void transit(const struct state *from, const struct sim_stepper *stepper, int direction, double net,
                    struct state *out)
{
    const struct sim_transition *t = &stepper->transitions[direction + 1];
    size_t masses = stepper->chain.masses, columns = 2 * masses - 1;
    double y[2 * sim_masses_max - 1];
    y[0] = from->velocity[0];
    for (size_t i = 1; i < masses; i++) {
        y[2 * i - 1] = from->position[i] - from->position[0];
        y[2 * i] = from->velocity[i];
    }
    for (size_t i = 0; i < masses; i++) {
        double position = t->input[2 * i] * net, velocity = t->input[2 * i + 1] * net;
        for (size_t j = 0; j < columns; j++) {
            position += t->state[2 * i][j] * y[j];
            velocity += t->state[2 * i + 1][j] * y[j];
        }
        out->position[i] = from->position[0] + position;
        out->velocity[i] = velocity;
    }
    out->bristle = from->bristle;
    out->time_s = from->time_s + stepper->dt_s;
}

static double steady_factor(const struct sim_stepper *stepper, int direction)
{
    return direction > 0 ? stepper->steady.positive_factor : stepper->steady.negative_factor;
}

/// The motor's motion half a step on, to second order.
static struct sim_motion half_way(const struct state *s, const struct sim_stepper *stepper, double torque,
                                  int direction)
{
    const struct sim_opposing *o = &stepper->steady;
    double half_s = 0.5 * stepper->dt_s, link[sim_masses_max] = {0.0};
    if (stepper->chain.masses > 1)
        link_torques(s, stepper, link);
    double viscous = stepper->model.viscous_friction_Nms_per_rad * s->velocity[0];
    double net = torque - link[0] - o->smooth - steady_factor(stepper, direction) * (viscous + direction * o->dry);
    double gained = half_s * net / stepper->chain.inertia[0];
    struct sim_motion motion = motion_of(s, stepper);
    motion.position += half_s * (motion.velocity + 0.5 * gained);
    motion.velocity += gained;
    motion.time_s += half_s;
    return motion;
}

/// Torque that opposes the motor beside what its transition holds. What is not linear counts as it is half way: the
/// exponential midpoint rule (Hochbruck and Ostermann 2010, 2.3), its error the third power of the step.
static double opposing_torque(const struct state *s, const struct sim_stepper *stepper, double torque, int direction)
{
    double linear = steady_factor(stepper, direction) * stepper->model.viscous_friction_Nms_per_rad;
    if (stepper->exact)
        return stepper->steady.smooth + direction * steady_factor(stepper, direction) * stepper->steady.dry;
    struct sim_motion motion = half_way(s, stepper, torque, direction);
    struct sim_opposing o;
    opposing(stepper, &motion, &o);
    double factor = direction > 0 ? o.positive_factor : o.negative_factor;
    return o.smooth + factor * (o.viscous + direction * o.dry) - linear * motion.velocity;
}

/// Whether friction that builds up changes so little over a step that it counts as it is half way, and is no spring on
/// which the motor would swing meanwhile.
static bool builds_up_slowly(const struct course *course, const struct state *from)
{
    const double small = 0.01, built_up = 3.0;
    const struct sim_stepper *stepper = course->stepper;
    if (!(course->missing > 0.0))
        return true;
    double slope = is_exponential(stepper) ? course->missing : course->missing / course->power;
    double distances = stepper->dt_s / stepper->build_up, way = distances * fabs(from->velocity[0]);
    double swing = slope * distances * stepper->dt_s * fabs(course->level) / stepper->chain.inertia[0];
    return fmin(slope * way, built_up * course->missing) < small && swing < small;
}

/// The whole step at once where friction builds up and the motor runs on: friction counts as it is half way. Returns
/// false, with nothing moved, if that is not good enough.
static bool slide_at_once(struct state *io, const struct sim_stepper *stepper, double torque)
{
    const double still = 1e-3;
    int direction = sign_of(io->velocity[0]);
    struct course course = {stepper, torque, direction, io->position[0], io->bristle, 0.0, 0.0, 0.0};
    double half_s = 0.5 * stepper->dt_s, link[sim_masses_max] = {0.0}, dry;
    if (stepper->chain.masses > 1)
        link_torques(io, stepper, link);
    double net = driving_torque(io, stepper, torque, link[0], direction, &dry) - io->bristle;
    take_level(&course, dry);
    if (direction == 0 || !builds_up_slowly(&course, io))
        return false;
    net -= bristle_damping(&course, io, io->bristle, dry);
    struct state half = *io, next = *io;
    double gained = half_s * net / stepper->chain.inertia[0];
    half.position[0] += half_s * (half.velocity[0] + 0.5 * gained);
    half.velocity[0] += gained;
    half.time_s += half_s;
    double linear = steady_factor(stepper, direction) * stepper->model.viscous_friction_Nms_per_rad, half_dry;
    double driving = driving_torque(&half, stepper, torque, 0.0, direction, &half_dry);
    // A law that is no exponential does not follow a level that moves in one step.
    if (!is_exponential(stepper) && fabs(half_dry - dry) > still * dry)
        return false;
    double friction = built_up(&course, half.position[0], half_dry);
    friction += bristle_damping(&course, &half, friction, half_dry);
    transit(io, stepper, direction, driving + linear * half.velocity[0] - friction, &next);
    if (!(direction * next.velocity[0] > 0.0))
        return false;
    next.bristle = built_up(&course, next.position[0], fmax(2.0 * half_dry - dry, 0.0)); // its level straight on
    *io = next;
    return true;
}

/// The whole step at once. Returns false, with nothing moved, if the motor reverses or breaks away meanwhile.
static bool step_at_once(struct state *io, const struct sim_stepper *stepper, double torque)
{
    if (stepper->build_up > 0.0)
        return slide_at_once(io, stepper, torque);
    int direction = stepper->one_way ? 1 : sign_of(io->velocity[0]);
    if (direction == 0)
        direction = breakaway(io, stepper, torque);
    struct state next = *io;
    if (direction == 0) {
        transit(io, stepper, 0, 0.0, &next);
        next.position[0] = io->position[0];
        next.velocity[0] = 0.0;
        next.time_s = io->time_s + stepper->dt_s;
        if (breakaway(&next, stepper, torque) != 0)
            return false;
    } else {
        transit(io, stepper, direction, torque - opposing_torque(io, stepper, torque, direction), &next);
        if (direction * next.velocity[0] < 0.0 && !stepper->one_way)
            return false;
    }
    *io = next;
    return true;
}

static void move(struct state *io, const struct sim_stepper *stepper, double torque)
{
    if (!stepper->split || !step_at_once(io, stepper, torque))
        step_finely(io, stepper, torque, stepper->dt_s);
}

void sim_plant_move(struct sim_plant *self, const struct sim_stepper *stepper, double torque)
{
    struct state s = {.time_s = self->time_s};
    take(self, stepper, &s);
    move(&s, stepper, torque);
    give(&s, stepper, self);
}

/// Moves the motor by what `torque` over a whole step would be off by; dampers hand on an impulse meanwhile.
static void shift(struct state *io, const struct sim_stepper *stepper, double torque)
{
    const struct sim_chain *c = &stepper->chain;
    if (io->velocity[0] == 0.0)
        return; // what friction holds stays
    double way = torque * stepper->dt_s * stepper->dt_s / c->inertia[0];
    if (c->masses > 1 && (stepper->bend.count == 0 || !hangs_loose(io, stepper))) {
        io->velocity[0] -= c->damping[0] * way / c->inertia[0];
        io->velocity[1] += c->damping[0] * way / c->inertia[1];
    }
    io->position[0] += way;
}

/// A step in which the motor comes to rest or sets off: when it does depends on the torque's course, which is taken for
/// a straight line with the mean and the first moment that it has.
static void move_in_parts(struct state *io, const struct sim_stepper *stepper, const struct sim_torque *torque)
{
    enum { parts = 4 };
    double rise = -12.0 * (torque->before + torque->after);
    for (int i = 0; i < parts; i++) {
        double part = ((double)i + 0.5) / parts - 0.5;
        step_finely(io, stepper, torque->mean + part * rise, stepper->dt_s / parts);
    }
}

void sim_plant_move_under(struct sim_plant *self, const struct sim_stepper *stepper, const struct sim_torque *torque)
{
    struct state from = {.time_s = self->time_s}, s;
    take(self, stepper, &from);
    s = from;
    shift(&s, stepper, torque->before);
    move(&s, stepper, torque->mean);
    shift(&s, stepper, torque->after);
    if (sign_of(s.velocity[0]) != sign_of(from.velocity[0]) && (torque->before != 0.0 || torque->after != 0.0)) {
        s = from;
        move_in_parts(&s, stepper, torque);
    }
    give(&s, stepper, self);
}

void sim_plant_drive(struct sim_plant *self, const struct sim_stepper *stepper, struct sim_actuator *actuator,
                     size_t index, double torque)
{
    sim_actuator_substep(actuator, stepper, index);
    struct sim_torque all = actuator->last;
    all.mean += torque;
    sim_plant_move_under(self, stepper, &all);
}

void sim_plant_step(struct sim_plant *self, const struct sim_model *model, double torque, double dt_s)
{
    struct sim_stepper stepper;
    sim_stepper_init_once(&stepper, model, dt_s);
    sim_plant_move(self, &stepper, torque);
}
