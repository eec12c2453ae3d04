/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/scan.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

static size_t longest_block(const struct fit_data *data)
{
    size_t longest = 0;
    for (size_t i = 0; i < data->runs; i++) {
        size_t samples = data->evidence[i].recording->block.samples;
        longest = samples > longest ? samples : longest;
    }
    return longest;
}

bool scan_init(struct scan *self, const struct fit_data *data, const struct sim_coverage *coverage,
               const struct hypothesis *from, const struct fit *fit)
{
    *self = (struct scan){.data = data, .coverage = coverage, .from = from, .fit = fit};
    self->columns = malloc((2 * data->values + longest_block(data)) * sizeof *self->columns);
    if (self->columns && beside_init(&self->beside, data, from, fit) && fit_init(&self->scratch, data))
        return true;
    scan_free(self);
    return false;
}

void scan_free(struct scan *self)
{
    beside_free(&self->beside);
    fit_free(&self->scratch);
    free(self->columns);
    self->columns = NULL;
}

// ---- Long scans

static bool has_phase(const struct sim_effect *e)
{
    return e->parameter_count > 1 && e->parameters[1].kind == sim_parameter_phase;
}

/// The torque that an effect at `values` would have added over the recorded motion, whitened: what the residual would
/// look like, to first order, without running the simulation. `columns` of them: sine and cosine of an effect with a
/// phase.
static size_t quick_columns(const struct scan *self, int effect, const double *values)
{
    const struct fit_data *data = self->data;
    const struct sim_effect *e = sim_effects[effect];
    double p[sim_effect_parameters_max], *signal = self->columns + 2 * data->values;
    memcpy(p, values, sizeof p);
    size_t columns = has_phase(e) ? 2 : 1;
    for (size_t column = 0; column < columns; column++) {
        double *whitened = self->columns + column * data->values;
        p[1] = columns == 2 ? 1.5707963267948966 * (double)column : values[1];
        for (size_t i = 0; i < data->runs; i++) {
            const struct recording *r = data->evidence[i].recording;
            for (size_t n = 0; n < r->block.samples; n++) {
                size_t next = n + 1 < r->block.samples ? n + 1 : n;
                struct sim_motion at = {.position = 0.5 * (r->block.position[n] + r->block.position[next]),
                                        .velocity = 0.5 * (r->block.velocity[n] + r->block.velocity[next]),
                                        .time_s = r->block.start_s + (double)n / r->rate_hz,
                                        .linear = r->linear};
                struct sim_opposing o = {.positive_factor = 1.0, .negative_factor = 1.0};
                e->oppose(p, &at, &o);
                signal[n] = o.smooth + (at.velocity > 0.0 ? o.dry : -o.dry);
            }
            evidence_whiten(&data->evidence[i], signal, NULL, whitened);
            whitened += data->evidence[i].values;
        }
    }
    return columns;
}

/// Cost that would be left if the effect at `io_values` were added, by linear least squares beside the present
/// coordinates. Its size (and phase) in io_values becomes the best one.
static double quick_cost(const struct scan *self, int effect, double *io_values)
{
    double x[2];
    size_t columns = quick_columns(self, effect, io_values);
    double cost = beside_cost(&self->beside, self->columns, columns, x);
    // The columns are torques on the motor; the residual is in torques on the whole inertia of the given model.
    const struct sim_model *e = &self->from->engaged;
    double moved = e->motor_inertia_kgm2 + (e->structure == sim_structure_rigid ? e->load_inertia_kgm2 : 0.0);
    double scale = moved / self->data->evidence[0].scale_inertia;
    if (columns == 2) {
        io_values[1] = atan2(x[1], x[0]);
        io_values[0] *= hypot(x[0], x[1]) * scale;
    } else if (x[0] > 0.0) {
        io_values[0] *= x[0] * scale;
    }
    return cost;
}

enum { scan_short = 16, scan_kept = 6 };

struct scan_point {
    double cost;
    double values[sim_effect_parameters_max];
};

static int by_point_cost(const void *a, const void *b)
{
    double x = ((const struct scan_point *)a)->cost, y = ((const struct scan_point *)b)->cost;
    return (x > y) - (x < y);
}

/// The best few of a long scan by quick cost, each the lowest of its neighbourhood: a ripple's cost has a deep valley
/// for every cycle more or less over the travel, and the right one may be narrow.
static size_t choose_valleys(const struct scan *self, int effect, struct scan_point *points, size_t total,
                             double out_values[][sim_effect_parameters_max])
{
    size_t valleys = 0;
    for (size_t i = 0; i < total; i++)
        points[i].cost = quick_cost(self, effect, points[i].values);
    double before = INFINITY;
    for (size_t i = 0; i < total; i++) {
        double here = points[i].cost, after = i + 1 < total ? points[i + 1].cost : INFINITY;
        if (here <= before && here < after)
            points[valleys++] = points[i];
        before = here;
    }
    qsort(points, valleys, sizeof *points, by_point_cost);
    size_t count = valleys < scan_kept ? valleys : scan_kept;
    for (size_t i = 0; i < count; i++)
        memcpy(out_values[i], points[i].values, sizeof points[i].values);
    return count;
}

/// Gives scan values of an effect in time their size and phase: a frequency far from small is no place to step from.
static void size_in_time(const struct scan *self, const struct sim_model *current, int effect,
                         double values[][sim_effect_parameters_max], size_t count)
{
    for (size_t i = 0; i < count; i++) {
        if (self->data->contrasts > 0)
            contrast_size_effect(&self->data->evidence[0], current, effect, values[i]);
        else if (sim_effects[effect]->oppose)
            quick_cost(self, effect, values[i]);
    }
}

/// Scan values worth a look: all of a short scan, the best valleys of a long one.
static size_t choose_values(const struct scan *self, int effect, double out_values[][sim_effect_parameters_max])
{
    struct sim_model current;
    hypothesis_model(self->from, NULL, &current);
    const struct sim_effect *e = sim_effects[effect];
    double values[sim_effect_parameters_max] = {0};
    size_t total = 0, count = 0;
    if (contrast_is_line(effect) && self->coverage->tone_count == 0)
        return 0;
    while (e->scan(&current, self->coverage, total, values)) {
        if (total < sim_effect_scan_max)
            memcpy(out_values[total], values, sizeof values);
        total++;
    }
    if (total <= scan_short || !e->oppose) {
        count = total < sim_effect_scan_max ? total : sim_effect_scan_max;
        if (e->in_time)
            size_in_time(self, &current, effect, out_values, count);
        return count;
    }
    struct scan_point *points = calloc(total, sizeof *points);
    if (points) {
        for (size_t i = 0; i < total; i++)
            e->scan(&current, self->coverage, i, points[i].values);
        count = choose_valleys(self, effect, points, total, out_values);
    }
    free(points);
    return count;
}

// ---- Places

/// A scan value tried.
struct place {
    double cost;    ///< as it is, or after what was done with it
    double promise; ///< what would be left of the cost if its change of the residual had the best size
    double size;    ///< that size, of what was tried
    bool valley;    ///< no neighbour promises more
    bool lowest;    ///< better as it is than what there was, and than every other place
    const double *values;
    struct hypothesis hypothesis;
};

/// Whether an effect changes what the model is made of, rather than adding to what acts on it.
static bool restructures(const struct scan *self, int effect, const struct hypothesis *trial)
{
    const struct sim_effect *e = sim_effects[effect];
    return trial->engaged.structure != self->from->engaged.structure || e->attach || e->bend || e->build_up;
}

/// What an effect at a hypothesis' values changes of the residual, of which its square is returned; infinite where it
/// leads nowhere.
static double change_at(struct scan *self, const struct hypothesis *hypothesis, double *out_cost, double *out_column)
{
    struct fit *scratch = &self->scratch;
    double change = 0.0;
    *out_cost = fit_cost(scratch, self->data, hypothesis, hypothesis->x);
    if (!isfinite(*out_cost))
        return INFINITY;
    for (size_t i = 0; i < self->data->values; i++) {
        out_column[i] = scratch->residual[i] - self->fit->residual[i];
        change += out_column[i] * out_column[i];
    }
    return change;
}

/// The same place a quarter of a turn on: half of what an effect with a phase may do has no part in what it does at one
/// phase. The place is moved to the best size and phase of the two together, and `promise` said for them.
static void look_across(struct scan *self, int effect, struct place *io_place)
{
    const double quarter = 1.5707963267948966, farthest = 30.0;
    struct hypothesis across = *self->from;
    double values[sim_effect_parameters_max], sizes[2], cost;
    memcpy(values, io_place->values, sizeof values);
    values[1] += quarter;
    hypothesis_name(&across, effect, values);
    if (!isfinite(change_at(self, &across, &cost, self->columns + self->data->values)))
        return;
    double left = self->fit->cost + beside_cost(&self->beside, self->columns, 2, sizes) - self->beside.cost;
    double size = hypot(sizes[0], sizes[1]);
    if (!(size > 0.0))
        return;
    values[0] *= fmin(fmax(size, 1.0 / farthest), farthest);
    values[1] = io_place->values[1] + atan2(sizes[1], sizes[0]);
    io_place->hypothesis = *self->from;
    hypothesis_name(&io_place->hypothesis, effect, values);
    io_place->promise = left;
}

/// Looks at one place: the change of the residual there is a direction, and how far along it is best costs nothing to
/// say. A place that changes next to nothing, such as a number of the model that only leaves its box, says nothing of
/// what it is worth.
static void look(struct scan *self, int effect, struct place *io_place)
{
    const double nothing = 1e-6; // of the cost
    const struct sim_effect *e = sim_effects[effect];
    io_place->size = 1.0;
    double change = change_at(self, &io_place->hypothesis, &io_place->cost, self->columns);
    io_place->promise = io_place->cost;
    if (!isfinite(change))
        return;
    if (e->in_time || change < nothing * self->fit->cost) {
        io_place->promise = -INFINITY;
        return;
    }
    double left = self->fit->cost + beside_cost(&self->beside, self->columns, 1, &io_place->size) - self->beside.cost;
    bool backward = io_place->size < 0.0 && e->parameters[0].kind == sim_parameter_positive;
    io_place->promise = fmin(io_place->cost, backward ? self->fit->cost : left);
    if (e->sense && has_phase(e))
        look_across(self, effect, io_place);
}

/// What is better already before what may become so; then valleys, of two alike the one that promises more.
static int by_promise(const void *a, const void *b)
{
    const struct place *x = a, *y = b;
    if (x->lowest != y->lowest)
        return x->lowest ? -1 : 1;
    if (x->valley != y->valley)
        return x->valley ? -1 : 1;
    return (x->promise > y->promise) - (x->promise < y->promise);
}

static int by_cost(const void *a, const void *b)
{
    double x = ((const struct place *)a)->cost, y = ((const struct place *)b)->cost;
    return (x > y) - (x < y);
}

/// `cost`: of what there was.
static void mark_valleys(struct place *places, size_t count, double cost)
{
    struct place *lowest = NULL;
    for (size_t i = 0; i < count; i++)
        if (places[i].cost < cost) {
            lowest = &places[i];
            cost = lowest->cost;
        }
    if (lowest)
        lowest->lowest = true;
    for (size_t i = 0; i < count; i++) {
        double before = i > 0 ? places[i - 1].promise : INFINITY;
        double after = i + 1 < count ? places[i + 1].promise : INFINITY;
        places[i].valley = places[i].promise <= before && places[i].promise <= after;
    }
}

/// Begins where the look said that it is best, as far as that goes.
static void resize(const struct scan *self, int effect, struct place *io_place)
{
    const double farthest = 30.0;
    const struct sim_effect *e = sim_effects[effect];
    double values[sim_effect_parameters_max];
    if (!e->proportional || !(io_place->size > 0.0))
        return;
    memcpy(values, io_place->values, sizeof values);
    values[e->size] *= fmin(fmax(io_place->size, 1.0 / farthest), farthest);
    io_place->hypothesis = *self->from;
    hypothesis_name(&io_place->hypothesis, effect, values);
}

/// Places that are worth a step, the best first; returns how many.
static size_t choose_places(struct scan *self, int effect, double values[][sim_effect_parameters_max], size_t count,
                            double worth, size_t most, struct place *out)
{
    size_t kept = 0;
    for (size_t i = 0; i < count; i++) {
        out[i].values = values[i];
        out[i].hypothesis = *self->from;
        hypothesis_name(&out[i].hypothesis, effect, values[i]);
        look(self, effect, &out[i]);
    }
    mark_valleys(out, count, self->fit->cost);
    qsort(out, count, sizeof *out, by_promise);
    while (kept < count && kept < most) {
        if (!(out[kept].promise < self->fit->cost - worth))
            break;
        resize(self, effect, &out[kept++]);
    }
    return kept;
}

static void keep_better(const struct place *place, struct scan_candidate *io_best)
{
    if (!(place->cost < io_best->cost))
        return;
    io_best->cost = place->cost;
    io_best->hypothesis = place->hypothesis;
}

/// Where the structure changes, derivatives of the old one are worth little: the best places get a step of their own,
/// the best of them a short fit.
static void fit_places(struct scan *self, struct place *places, size_t count, struct scan_candidate *out)
{
    enum { fitted = 2, iterations = 2 };
    const double too_far = 4.0; // a place so many times worse after its step than the best
    for (size_t i = 0; i < count; i++) {
        bool good = fit_roughly(&self->scratch, self->data, self->from, self->fit, &places[i].hypothesis, 1, INFINITY);
        places[i].cost = good ? self->scratch.cost : INFINITY;
        keep_better(&places[i], out);
    }
    qsort(places, count, sizeof *places, by_cost);
    for (size_t i = 0; i < fitted && i < count && places[i].cost <= too_far * out->cost; i++) {
        if (fit_roughly(&self->scratch, self->data, self->from, self->fit, &places[i].hypothesis, iterations, INFINITY))
            places[i].cost = self->scratch.cost;
        keep_better(&places[i], out);
    }
}

static void step_places(struct scan *self, struct place *places, size_t count, struct scan_candidate *out)
{
    for (size_t i = 0; i < count; i++) {
        bool good = fit_step(&self->scratch, self->data, self->from, self->fit, &places[i].hypothesis);
        places[i].cost = good ? self->scratch.cost : INFINITY;
        keep_better(&places[i], out);
    }
}

bool scan_effect(struct scan *self, int effect, double worth, struct scan_candidate *out)
{
    enum { fitted = 3, stepped = 6 };
    double values[sim_effect_scan_max][sim_effect_parameters_max];
    size_t count = choose_values(self, effect, values);
    struct place *places = calloc(count > 0 ? count : 1, sizeof *places);
    out->effect = effect;
    out->cost = INFINITY;
    if (!places || count == 0) {
        free(places);
        return false;
    }
    struct hypothesis first = *self->from;
    hypothesis_name(&first, effect, values[0]);
    bool whole = restructures(self, effect, &first);
    size_t kept = choose_places(self, effect, values, count, worth, whole ? fitted : stepped, places);
    if (whole)
        fit_places(self, places, kept, out);
    else
        step_places(self, places, kept, out);
    free(places);
    return isfinite(out->cost);
}
