/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/misfit.h"

#include "lab/diagnose/fit.h"
#include "lab/numeric/fft.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/// What chance may reach in the best of all ranges; the log of their number comes on top.
static const double floor_nats = 12.0;
/// Less than this nobody would call a place: two thirds of it in half of the values have 0.06.
static const double least_density = 0.1, least_denser = 1.35;

/// Ranges of the axes over all runs.
struct limits {
    double frequency_low_hz, frequency_high_hz, speed, position_low, position_high, time_low_s, time_high_s, level;
};

static const double *level_of(const struct recording *r)
{
    return r->block.torque_ref ? r->block.torque_ref : r->block.torque;
}

static double bin_hz(const struct recording *r)
{
    return r->rate_hz / (double)r->block.samples;
}

static double run_end_s(const struct recording *r)
{
    double rows = r->periodic ? (double)(r->starts[r->periods - 1] + r->block.samples) : (double)r->block.samples;
    return r->all.start_s + rows / r->rate_hz;
}

static struct limits limits_of(const struct fit_data *data)
{
    struct limits l = {INFINITY, 0.0, 0.0, INFINITY, -INFINITY, INFINITY, 0.0, 0.0};
    for (size_t i = 0; i < data->runs; i++) {
        const struct recording *r = data->evidence[i].recording;
        l.frequency_low_hz = fmin(l.frequency_low_hz, bin_hz(r));
        l.frequency_high_hz = fmax(l.frequency_high_hz, bin_hz(r) * (double)r->band);
        l.time_low_s = fmin(l.time_low_s, r->all.start_s + (r->periodic ? (double)r->starts[0] / r->rate_hz : 0.0));
        l.time_high_s = fmax(l.time_high_s, run_end_s(r));
        for (size_t n = 0; n < r->block.samples; n++) {
            l.speed = fmax(l.speed, fabs(r->block.velocity[n]));
            l.position_low = fmin(l.position_low, r->block.position[n]);
            l.position_high = fmax(l.position_high, r->block.position[n]);
            l.level = fmax(l.level, fabs(level_of(r)[n]));
        }
    }
    return l;
}

// ---- Parts

/// Equal parts from low to high, or of equal ratio.
static void split(struct misfit_axis *axis, double low, double high, size_t parts, bool logarithmic)
{
    if (!(high > low))
        return;
    axis->parts = parts;
    for (size_t i = 0; i < parts; i++) {
        double from = (double)i / (double)parts, to = (double)(i + 1) / (double)parts;
        axis->part[i].low = logarithmic ? low * pow(high / low, from) : low + from * (high - low);
        axis->part[i].high = logarithmic ? low * pow(high / low, to) : low + to * (high - low);
    }
}

static void split_axes(const struct limits *l, struct misfit *out)
{
    const size_t speeds = 24, places = 32, directions = 2, levels = 12;
    const double wide = 30.0; // a decade and a half: below, equal steps show the low end well enough
    const bool logarithmic = l->frequency_high_hz > wide * l->frequency_low_hz;
    split(&out->axes[misfit_frequency], l->frequency_low_hz, l->frequency_high_hz, misfit_parts_max, logarithmic);
    split(&out->axes[misfit_speed], -l->speed, l->speed, speeds, false);
    split(&out->axes[misfit_position], l->position_low, l->position_high, places, false);
    split(&out->axes[misfit_direction], -1.0, 1.0, directions, false);
    split(&out->axes[misfit_time], l->time_low_s, l->time_high_s, misfit_parts_max, false);
    split(&out->axes[misfit_level], 0.0, l->level, levels, false);
}

static void add(struct misfit_axis *axis, double place, double values, const double squares[misfit_models])
{
    if (axis->parts == 0)
        return;
    size_t i = 0;
    while (i + 1 < axis->parts && place >= axis->part[i].high)
        i++;
    axis->part[i].values += values;
    for (int m = 0; m < misfit_models; m++)
        axis->part[i].squares[m] += squares[m];
}

/// Takes out parts that nothing fell into, which lines may leave between them.
static void close_gaps(struct misfit_axis *axis)
{
    size_t kept = 0;
    for (size_t i = 0; i < axis->parts; i++)
        if (axis->part[i].values > 0.0)
            axis->part[kept++] = axis->part[i];
    axis->parts = kept;
}

// ---- What models leave, in time

/// Whitened residuals of one run under one model.
struct left {
    double *whitened, *contrasts; ///< of the evidence's values, contrasts
    double *squares;              ///< per sample of the block: of all channels together
    double *in_time;              ///< per sample of the periods
};

static bool left_allocate(const struct evidence *e, struct left *out)
{
    size_t n = e->recording->block.samples, P = e->recording->periods;
    out->whitened = calloc(e->values + e->contrast.values + (1 + P) * n + 1, sizeof *out->whitened);
    if (!out->whitened)
        return false;
    out->contrasts = out->whitened + e->values;
    out->squares = out->contrasts + e->contrast.values;
    out->in_time = out->squares + n;
    return true;
}

/// Adds the squares of white values, constant part first, brought to time. work: 4 samples' doubles.
static void to_time(const struct evidence *e, size_t band, const double *values, double *work, double *io_squares)
{
    size_t n = e->recording->block.samples;
    double *out = work + 2 * n, half = 0.5 * sqrt(2.0 / (double)n);
    memset(work, 0, 2 * n * sizeof *work);
    work[0] = values[0] / sqrt((double)n);
    for (size_t k = 1; k <= band; k++) {
        work[2 * k] = work[2 * (n - k)] = half * values[2 * k - 1];
        work[2 * k + 1] = half * values[2 * k];
        work[2 * (n - k) + 1] = -half * values[2 * k];
    }
    fft_inverse(e->plan, work, out);
    for (size_t i = 0; i < n; i++)
        io_squares[i] += out[2 * i] * out[2 * i];
}

/// One channel of a whitened residual in the order of to_time(). out: 1 + 2 band values.
static void channel_of(const struct evidence *e, const double *whitened, size_t channel, double *out)
{
    size_t band = e->recording->band, width = 2 * e->channels;
    out[0] = channel == 0 ? whitened[0] : 0.0;
    for (size_t k = 1; k <= band; k++)
        memcpy(out + 2 * k - 1, whitened + 1 + (k - 1) * width + 2 * channel, 2 * sizeof *out);
}

static bool find_left(const struct evidence *e, const struct sim_model *model, struct left *out)
{
    const struct recording *r = e->recording;
    size_t n = r->block.samples, width = 1 + 2 * r->band, P = r->periods;
    double *work = malloc((4 * n + 2 * width) * sizeof *work);
    if (!work)
        return false;
    double *values = work + 4 * n, *period = values + width;
    if (e->contrast.values > 0)
        memcpy(out->contrasts, e->contrast.base, e->contrast.values * sizeof *out->contrasts);
    evidence_residual(e, model, out->whitened, out->contrasts);
    for (size_t channel = e->channels; channel-- > 0;) {
        channel_of(e, out->whitened, channel, values);
        to_time(e, r->band, values, work, out->squares);
    }
    // The mean of the periods in units of the noise of one, and what the period has besides.
    for (size_t p = 0; p < P; p++) {
        for (size_t i = 0; i < width; i++)
            period[i] =
                values[i] / sqrt((double)P) + (e->contrast.values > 0 ? out->contrasts[p * e->contrast.width + i] : 0);
        to_time(e, r->band, period, work, out->in_time + p * n);
    }
    free(work);
    return true;
}

// ---- Sorting

static void sort_lines(const struct evidence *e, const struct left *left, struct misfit *io)
{
    for (size_t i = 0; i < e->values; i++) {
        size_t channel, bin = evidence_bin(e, i, &channel);
        double squares[misfit_models];
        for (int m = 0; m < misfit_models; m++) {
            squares[m] = left[m].whitened[i] * left[m].whitened[i];
            io->squares[m] += squares[m];
        }
        add(&io->axes[misfit_frequency], (double)bin * bin_hz(e->recording), 1.0, squares);
        io->values += 1.0;
    }
}

static void sort_samples(const struct evidence *e, const struct left *left, struct misfit *io)
{
    const struct recording *r = e->recording;
    size_t n = r->block.samples, last = n - 1;
    // The actuator has no constant part.
    double all = (double)(2 * r->band * e->channels + 1) / (double)n, one = (double)(2 * r->band + 1) / (double)n;
    for (size_t i = 0; i < n; i++) {
        size_t next = i < last ? i + 1 : r->periodic ? 0 : last;
        double v = 0.5 * (r->block.velocity[i] + r->block.velocity[next]), squares[misfit_models];
        double share = evidence_weight(e, i);
        for (int m = 0; m < misfit_models; m++)
            squares[m] = left[m].squares[i];
        add(&io->axes[misfit_speed], v, share * all, squares);
        add(&io->axes[misfit_position], r->block.position[i], share * all, squares);
        add(&io->axes[misfit_direction], v < 0.0 ? -0.5 : 0.5, share * all, squares);
        add(&io->axes[misfit_level], fabs(level_of(r)[i]), share * all, squares);
        for (size_t p = 0; p < r->periods; p++) {
            size_t row = i + (r->periodic ? r->starts[p] : 0);
            for (int m = 0; m < misfit_models; m++)
                squares[m] = left[m].in_time[p * n + i];
            add(&io->axes[misfit_time], r->all.start_s + (double)row / r->rate_hz, share * one, squares);
        }
    }
}

static bool sort_run(const struct evidence *e, const struct sim_model *const models[misfit_models], struct misfit *io)
{
    struct left left[misfit_models] = {{0}};
    bool good = true;
    for (int m = 0; m < misfit_models && good; m++)
        good = left_allocate(e, &left[m]) && find_left(e, models[m], &left[m]);
    if (good) {
        sort_lines(e, left, io);
        sort_samples(e, left, io);
    }
    for (int m = 0; m < misfit_models; m++)
        free(left[m].whitened);
    return good;
}

// ---- Where it sits

struct amount {
    double values, squares;
};

static struct amount amount_of(const struct misfit_axis *axis, enum misfit_model model, size_t first, size_t last)
{
    struct amount sum = {0.0, 0.0};
    for (size_t i = first; i <= last; i++) {
        sum.values += axis->part[i].values;
        sum.squares += axis->part[i].squares[model];
    }
    return sum;
}

/// Evidence that a part of all has a larger variance than the rest.
static double nats_of(const struct amount *part, const struct amount *all)
{
    double rest = all->squares - part->squares, others = all->values - part->values;
    if (!(part->values > 0.0 && others > 0.0 && rest > 0.0 && part->squares / part->values > rest / others))
        return 0.0;
    return 0.5 * (all->values * log(all->squares / all->values) - part->values * log(part->squares / part->values) -
                  others * log(rest / others));
}

static double relative_entropy(double s, double v)
{
    double sum = s > 0.0 ? s * log(s / v) : 0.0;
    return sum + (s < 1.0 ? (1.0 - s) * log((1.0 - s) / (1.0 - v)) : 0.0);
}

/// Both signs of the speed as one axis from standstill to the highest.
static struct misfit_axis fold(const struct misfit_axis *axis)
{
    struct misfit_axis folded = {.parts = 0};
    for (size_t i = 0; i < axis->parts; i++) {
        const struct misfit_part *p = &axis->part[i];
        double low = fmin(fabs(p->low), fabs(p->high)), high = fmax(fabs(p->low), fabs(p->high));
        size_t j = 0;
        while (j < folded.parts && fabs(folded.part[j].low - low) > 0.5 * (high - low))
            j++;
        if (j == folded.parts)
            folded.part[folded.parts++] = (struct misfit_part){.low = low, .high = high};
        folded.part[j].values += p->values;
        for (int m = 0; m < misfit_models; m++)
            folded.part[j].squares[m] += p->squares[m];
    }
    // The parts came from the lowest speed to the highest: the fastest backward first.
    for (size_t i = 1; i < folded.parts; i++)
        for (size_t j = i; j > 0 && folded.part[j].low < folded.part[j - 1].low; j--) {
            struct misfit_part held = folded.part[j];
            folded.part[j] = folded.part[j - 1];
            folded.part[j - 1] = held;
        }
    return folded;
}

static struct misfit_range find_range(const struct misfit_axis *axis, enum misfit_model model)
{
    struct misfit_range best = {0};
    if (axis->parts < 2)
        return best;
    struct amount all = amount_of(axis, model, 0, axis->parts - 1);
    double most = floor_nats + log(0.5 * (double)(axis->parts * (axis->parts + 1))), excess = all.squares - all.values;
    for (size_t first = 0; first < axis->parts && excess > 0.0; first++)
        for (size_t last = first; last < axis->parts; last++) {
            struct amount part = amount_of(axis, model, first, last);
            double nats = nats_of(&part, &all);
            if (!(nats > most))
                continue;
            most = nats;
            best.found = true;
            best.first = first;
            best.last = last;
            best.share = fmin(fmax((part.squares - part.values) / excess, 0.0), 1.0);
            best.values = part.values / all.values;
        }
    if (!best.found)
        return best;
    best.low = axis->part[best.first].low;
    best.high = axis->part[best.last].high;
    best.open_low = best.first == 0;
    best.open_high = best.last + 1 == axis->parts;
    best.density = relative_entropy(best.share, best.values);
    best.found = best.density > least_density && best.share > least_denser * best.values;
    best.step = axis->part[best.first].high - axis->part[best.first].low;
    return best;
}

bool misfit_find(const struct fit_data *data, const struct sim_model *given, const struct sim_model *extended,
                 struct misfit *out_misfit)
{
    const struct sim_model *models[misfit_models] = {given, extended};
    struct limits limits = limits_of(data);
    memset(out_misfit, 0, sizeof *out_misfit);
    split_axes(&limits, out_misfit);
    for (size_t i = 0; i < data->runs; i++)
        if (!sort_run(&data->evidence[i], models, out_misfit))
            return false;
    for (int a = 0; a < misfit_axes; a++) {
        struct misfit_axis *axis = &out_misfit->axes[a];
        close_gaps(axis);
        struct misfit_axis folded = a == misfit_speed ? fold(axis) : *axis;
        for (int m = 0; m < misfit_models; m++)
            axis->range[m] = find_range(&folded, (enum misfit_model)m);
    }
    return true;
}

const char *misfit_axis_name(enum misfit_axis_kind kind, bool linear)
{
    static const char *const names[misfit_axes][2] = {
        [misfit_frequency] = {"frequency_hz", "frequency_hz"},
        [misfit_speed] = {"velocity_rad_per_s", "velocity_m_per_s"},
        [misfit_position] = {"position_rad", "position_m"},
        [misfit_direction] = {"direction", "direction"},
        [misfit_time] = {"time_s", "time_s"},
        [misfit_level] = {"level_Nm", "level_N"},
    };
    return names[kind][linear];
}

double misfit_noise_share(const struct misfit *self, enum misfit_model model)
{
    return self->squares[model] > 0.0 ? fmin(self->values / self->squares[model], 1.0) : NAN;
}

bool misfit_is_left(const struct misfit *self, enum misfit_model model)
{
    const double clearly = 4.0; // standard deviations of a sum of squares
    return self->squares[model] - self->values > clearly * sqrt(2.0 * self->values);
}

double misfit_rms(const struct misfit_part *part, enum misfit_model model)
{
    return part->values > 0.0 ? sqrt(part->squares[model] / part->values) : NAN;
}

size_t misfit_order(const struct misfit *self, enum misfit_model model, enum misfit_axis_kind out_axes[misfit_axes])
{
    size_t count = 0;
    for (int a = 0; a < misfit_axes; a++) {
        if (!self->axes[a].range[model].found)
            continue;
        size_t i = count++;
        for (; i > 0 && self->axes[out_axes[i - 1]].range[model].density < self->axes[a].range[model].density; i--)
            out_axes[i] = out_axes[i - 1];
        out_axes[i] = (enum misfit_axis_kind)a;
    }
    return count;
}
