/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/contrast.h"

#include "lab/diagnose/noise.h"
#include "lab/numeric/fft.h"
#include "sim/plant.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double turn = 6.283185307179586;

bool contrast_concerns(const struct sim_model *model)
{
    for (size_t e = 0; sim_effects[e]; e++)
        if (model->effect_on[e] && sim_effects[e]->in_time)
            return true;
    return false;
}

bool contrast_init(struct contrast *self, const struct recording *recording)
{
    memset(self, 0, sizeof *self);
    if (!recording->periodic)
        return true;
    self->width = 1 + 2 * recording->band;
    self->values = recording->periods * self->width;
    self->base = calloc(self->values, sizeof *self->base);
    return self->base != NULL;
}

void contrast_free(struct contrast *self)
{
    free(self->base);
    memset(self, 0, sizeof *self);
}

/// The model without what adds a torque of its own that does not depend on time: it is the same in every period.
static struct sim_model only_in_time(const struct sim_model *model)
{
    struct sim_model m = *model;
    for (size_t e = 0; sim_effects[e]; e++)
        if (sim_effects[e]->place == sim_place_motor && !sim_effects[e]->in_time)
            m.effect_on[e] = false;
    return m;
}

/// sim_plant_opposing for many instants of one model.
static double opposing_now(const struct sim_stepper *stepper, const struct sim_motion *at, double slow)
{
    const struct sim_model *model = &stepper->model;
    struct sim_opposing o = stepper->steady;
    o.viscous += model->viscous_friction_Nms_per_rad * at->velocity;
    for (size_t i = 0; i < stepper->oppose.count; i++) {
        size_t e = stepper->oppose.effects[i];
        sim_effects[e]->oppose(model->effect_parameters[e], at, &o);
    }
    double factor = at->velocity >= 0.0 ? o.positive_factor : o.negative_factor;
    // Near standstill friction is what the other torques leave it to be, and the sign of a measured speed is noise.
    double sign = at->velocity / sqrt(at->velocity * at->velocity + slow * slow);
    return o.smooth + factor * (o.viscous + sign * o.dry);
}

/// Opposing torque over the block's motion, as mechanics, with the run's clock at start_s on its first sample;
/// `still`: all the time.
static void opposing(const struct evidence *e, const struct sim_model *model, double start_s, bool still, double *out)
{
    const struct recording *r = e->recording;
    const struct stretch *b = &r->block;
    const double apart = 0.28867513459481288; // half of 1 / sqrt(3): two points of Gauss make the mean over a sample
    double slow = 0.02 * r->coverage.velocity_rms, half_s = 0.5 / r->rate_hz, apart_s = apart / r->rate_hz;
    double moved = model->motor_inertia_kgm2 + (model->structure == sim_structure_rigid ? model->load_inertia_kgm2 : 0);
    double share = e->scale_inertia / moved;
    struct sim_stepper stepper;
    sim_stepper_init_once(&stepper, model, 1.0 / r->rate_hz);
    for (size_t n = 0; n < b->samples; n++) {
        size_t next = n + 1 < b->samples ? n + 1 : 0;
        double middle_s = start_s + half_s + (still ? 0.0 : (double)n / r->rate_hz);
        struct sim_motion at = {.position = b->position[n],
                                .velocity = 0.5 * (b->velocity[n] + b->velocity[next]),
                                .time_s = middle_s - (still ? 0.0 : apart_s),
                                .linear = r->linear};
        out[n] = share * opposing_now(&stepper, &at, slow);
        if (still)
            continue;
        at.time_s = middle_s + apart_s;
        out[n] = 0.5 * (out[n] + share * opposing_now(&stepper, &at, slow));
    }
}

static double period_start_s(const struct recording *r, size_t p)
{
    return r->all.start_s + (double)r->starts[p] / r->rate_hz;
}

/// Whitens one period's deviation; the factor is that of the mean of the periods, in which noise is smaller.
static void whiten_period(const struct evidence *e, const double *spectrum, double sign, double *io_values)
{
    double root = 1.0 / sqrt((double)e->recording->periods);
    io_values[0] += sign * root * e->factor[0] * spectrum[0];
    for (size_t k = 1; k <= e->recording->band; k++)
        for (size_t j = 0; j < 2; j++)
            io_values[2 * k - 1 + j] += sign * root * e->factor[4 * k] * spectrum[2 * k + j];
}

/// Adds sign times what the effects in time make of the contrasts; out_mean as in contrast_residual.
static bool add_effects(const struct evidence *e, const struct sim_model *model, double sign, double *io_values,
                        double *out_mean)
{
    const struct recording *r = e->recording;
    size_t n = r->block.samples, bins = r->band + 1, P = r->periods;
    struct sim_model m = only_in_time(model);
    double *torque = malloc((n + (P + 1) * 2 * bins) * sizeof *torque);
    if (!torque)
        return false;
    double *spectra = torque + n, *mean = spectra + P * 2 * bins;
    memset(mean, 0, 2 * bins * sizeof *mean);
    if (out_mean) {
        opposing(e, &m, r->block.start_s, true, torque);
        for (size_t i = 0; i < n; i++)
            out_mean[i] = -torque[i];
    }
    for (size_t p = 0; p < P; p++) {
        opposing(e, &m, period_start_s(r, p), false, torque);
        for (size_t i = 0; out_mean && i < n; i++)
            out_mean[i] += torque[i] / (double)P;
        if (!io_values)
            continue;
        double *own = spectra + p * 2 * bins;
        evidence_transform(e, torque, own);
        for (size_t i = 0; i < 2 * bins; i++)
            mean[i] += own[i] / (double)P;
    }
    for (size_t p = 0; io_values && p < P; p++) {
        double *own = spectra + p * 2 * bins;
        for (size_t i = 0; i < 2 * bins; i++)
            own[i] -= mean[i];
        whiten_period(e, own, sign, io_values + p * e->contrast.width);
    }
    free(torque);
    return true;
}

static double dot(size_t n, const double *a, const double *b)
{
    double sum = 0.0;
    for (size_t i = 0; i < n; i++)
        sum += a[i] * b[i];
    return sum;
}

bool contrast_take(struct evidence *evidence, const struct sim_model *model, const double *deviations, size_t stride)
{
    struct contrast *c = &evidence->contrast;
    memset(c->base, 0, c->values * sizeof *c->base);
    for (size_t p = 0; p < evidence->recording->periods; p++)
        whiten_period(evidence, deviations + p * stride, 1.0, c->base + p * c->width);
    c->reference = c->without = dot(c->values, c->base, c->base);
    if (!contrast_concerns(model))
        return true;
    if (!add_effects(evidence, model, -1.0, c->base, NULL))
        return false;
    c->without = dot(c->values, c->base, c->base);
    return true;
}

bool contrast_residual(const struct evidence *evidence, const struct sim_model *model, double *out_residual,
                       double *out_mean)
{
    if (out_residual)
        memcpy(out_residual, evidence->contrast.base, evidence->contrast.values * sizeof *out_residual);
    return add_effects(evidence, model, 1.0, out_residual, out_mean);
}

/// Index of the parameter that is the phase of an effect in time, 0 if it has none.
static size_t phase_of(size_t effect)
{
    const struct sim_effect *e = sim_effects[effect];
    for (size_t i = 1; e->in_time && i < e->parameter_count; i++)
        if (e->parameters[i].kind == sim_parameter_phase)
            return i;
    return 0;
}

bool contrast_is_line(int effect)
{
    return phase_of((size_t)effect) > 0;
}

/// The contrasts' answer to an effect at its present phase and a quarter turn on: cosine and sine columns, and how much
/// of each there is in what is left beside `model` (which has the effect off).
static bool find_parts(const struct evidence *evidence, const struct sim_model *model, size_t effect,
                       const double *values, size_t phase, double out_parts[2])
{
    size_t n = evidence->contrast.values;
    double *rest = malloc(3 * n * sizeof *rest);
    if (!rest)
        return false;
    double *columns[2] = {rest + n, rest + 2 * n};
    bool good = contrast_residual(evidence, model, rest, NULL);
    for (size_t j = 0; j < 2 && good; j++) {
        struct sim_model with = *model;
        with.effect_on[effect] = true;
        memcpy(with.effect_parameters[effect], values, sizeof with.effect_parameters[effect]);
        with.effect_parameters[effect][phase] += 0.25 * turn * (double)j;
        good = contrast_residual(evidence, &with, columns[j], NULL);
        for (size_t i = 0; i < n; i++)
            columns[j][i] -= rest[i];
    }
    double cc = dot(n, columns[0], columns[0]), ss = dot(n, columns[1], columns[1]),
           cs = dot(n, columns[0], columns[1]);
    double c = -dot(n, columns[0], rest), s = -dot(n, columns[1], rest), determinant = cc * ss - cs * cs;
    bool apart = determinant > 1e-9 * cc * ss;
    out_parts[0] = apart ? (ss * c - cs * s) / determinant : cc > 0.0 ? c / cc : 0.0;
    out_parts[1] = apart ? (cc * s - cs * c) / determinant : 0.0;
    free(rest);
    return good;
}

bool contrast_align(const struct evidence *evidence, const struct sim_model *model, struct sim_model *out_model)
{
    *out_model = *model;
    if (!evidence->phase_free || evidence->contrast.values == 0)
        return true;
    for (size_t e = 0; sim_effects[e]; e++) {
        size_t phase = model->effect_on[e] ? phase_of(e) : 0;
        if (phase == 0 || !(model->effect_parameters[e][phase - 1] > 0.0))
            continue;
        struct sim_model without = *out_model;
        double parts[2];
        without.effect_on[e] = false;
        if (!find_parts(evidence, &without, e, model->effect_parameters[e], phase, parts))
            return false;
        out_model->effect_parameters[e][phase] += atan2(parts[1], parts[0]);
    }
    return true;
}

bool contrast_size_effect(const struct evidence *evidence, const struct sim_model *model, int effect, double *io_values)
{
    size_t phase = phase_of((size_t)effect);
    double parts[2];
    if (phase == 0 || evidence->contrast.values == 0)
        return true;
    if (!find_parts(evidence, model, (size_t)effect, io_values, phase, parts))
        return false;
    double size = hypot(parts[0], parts[1]);
    if (!(size > 0.0))
        return true;
    io_values[phase] += atan2(parts[1], parts[0]);
    io_values[phase - 1] *= size;
    return true;
}

// ---- Tones

enum { padding = 2 }; // points of the spectrum per 1 / duration

/// The residual over the counted periods with their mean taken out, zeros between those that do not count.
static void fill_counted(const struct evidence *e, const double *mechanics, double *out_complex)
{
    const struct recording *r = e->recording;
    size_t n = r->block.samples, first = r->periodic ? r->starts[0] : 0;
    for (size_t i = 0; i < n; i++) {
        double mean = 0.0;
        for (size_t p = 0; r->periodic && p < r->periods; p++)
            mean += mechanics[r->starts[p] + i] / (double)r->periods;
        for (size_t p = 0; p < r->periods; p++) {
            size_t from = r->periodic ? r->starts[p] + i : i;
            out_complex[2 * (from - first)] = mechanics[from] - mean;
        }
    }
}

/// Whitened power at point j of the padded spectrum, relative to the noise of its bin.
static double whitened_power(const struct evidence *e, const double *spectrum, size_t j, double points_per_bin)
{
    size_t k = (size_t)((double)j / points_per_bin + 0.5);
    double f = e->factor[4 * (k > 0 ? k : 1)];
    return f * f * (spectrum[2 * j] * spectrum[2 * j] + spectrum[2 * j + 1] * spectrum[2 * j + 1]);
}

/// Puts a peak among the strongest, which are kept in falling order.
static void keep_tone(struct evidence *c, double *powers, double power, double frequency_hz)
{
    size_t at = c->tone_count;
    while (at > 0 && powers[at - 1] < power)
        at--;
    if (at >= sim_tones_max)
        return;
    if (c->tone_count < sim_tones_max)
        c->tone_count++;
    for (size_t i = c->tone_count - 1; i > at; i--) {
        powers[i] = powers[i - 1];
        c->tones_hz[i] = c->tones_hz[i - 1];
    }
    powers[at] = power;
    c->tones_hz[at] = frequency_hz;
}

/// Evidence in nats for a line at point j against the mean power about it as far as `reach` lines to either side, the
/// line itself and its skirt left out.
/// Equation:  m ln(1 + P / (m mean)), the log of how seldom noise does that; a mean of m powers is itself uncertain.
///            m mean = sum / padding: the harmonics of the period were taken out and are no more in the sum than in m
static double nats_within(const struct recording *r, const double *power, size_t points, size_t j, size_t reach)
{
    size_t skirt = 2 * padding, count = 0, far = padding * reach;
    double sum = 0.0;
    for (size_t i = j > far ? j - far : 1; i < points && i <= j + far; i++) {
        if (i + skirt < j || i > j + skirt) {
            sum += power[i];
            count++;
        }
    }
    // Padding adds points, but no information.
    double kept = r->periodic ? 1.0 - 1.0 / (double)r->periods : 1.0, m = kept * (double)count / padding;
    return sum > 0.0 && m > 0.0 ? m * log1p(power[j] * padding / sum) : 0.0;
}

/// The same against those next to it as well: noise may have peaks of its own, narrower than the whitening knows, where
/// a load swings under it. Few lines are an uncertain mean, many miss the peak: the lesser evidence counts.
static double line_nats(const struct recording *r, const double *power, size_t points, size_t j)
{
    const size_t near = 8, far = 5 * r->periods > 30 ? 5 * r->periods : 30;
    return fmin(nats_within(r, power, points, j, near), nats_within(r, power, points, j, far));
}

static void pick_tones(const struct evidence *e, const double *power, size_t points, double points_per_bin,
                       struct evidence *out)
{
    const struct recording *r = e->recording;
    double powers[sim_tones_max], hz_per_point = r->rate_hz / ((double)r->block.samples * points_per_bin);
    // As many lines as there are bins were looked at; what it takes for a name or a verdict comes later.
    double chance = 6.0 + log((double)points / padding);
    out->tone_count = 0;
    out->tone_nats = 0.0;
    for (size_t j = 2 * padding; j + 1 < points; j++) {
        if (!(power[j] >= power[j - 1] && power[j] > power[j + 1]))
            continue;
        double nats = line_nats(r, power, points, j);
        if (!(nats > chance))
            continue;
        double curve = power[j - 1] - 2.0 * power[j] + power[j + 1];
        double shift = curve < 0.0 ? 0.5 * (power[j - 1] - power[j + 1]) / curve : 0.0;
        keep_tone(out, powers, power[j], ((double)j + shift) * hz_per_point);
        out->tone_nats = fmax(out->tone_nats, nats);
    }
}

bool contrast_find_tones(struct evidence *evidence, const double *mechanics)
{
    const struct recording *r = evidence->recording;
    size_t n = r->block.samples, span = r->periodic ? r->starts[r->periods - 1] + n - r->starts[0] : n;
    size_t length = padding * span;
    double points_per_bin = (double)length / (double)n;
    size_t points = (size_t)((double)r->band * points_per_bin);
    double *in = calloc(4 * length + points, sizeof *in);
    struct fft_plan *plan = fft_plan_create(length);
    bool good = in && plan;
    if (good) {
        double *out = in + 2 * length, *power = out + 2 * length;
        fill_counted(evidence, mechanics, in);
        fft_forward(plan, in, out);
        for (size_t j = 0; j < points; j++)
            power[j] = whitened_power(evidence, out, j, points_per_bin);
        pick_tones(evidence, power, points, points_per_bin, evidence);
    }
    free(in);
    if (plan)
        fft_plan_destroy(plan);
    return good;
}
