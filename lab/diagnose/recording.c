/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/recording.h"

#include "lab/diagnose/gain.h"
#include "lab/diagnose/motion.h"
#include "lab/estimate/period_search.h"
#include "lab/numeric/fft.h"
#include "sim/plant.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void stretch_free(struct stretch *s)
{
    free(s->torque_ref);
    free(s->torque);
    free(s->position);
    free(s->velocity);
    free(s->kinematics);
    free(s->lost);
}

void recording_free(struct recording *self)
{
    stretch_free(&self->block);
    stretch_free(&self->all);
    free(self->bins);
    free(self->starts);
    memset(self, 0, sizeof *self);
}

/// NULL for a column that is not there, or if memory is short.
static double *copied(const double *data, size_t count)
{
    double *copy = data ? malloc(count * sizeof *copy) : NULL;
    if (copy)
        memcpy(copy, data, count * sizeof *copy);
    return copy;
}

static const double *either(const struct run *run, const char *rotary, const char *linear)
{
    return run_column(run, run->linear ? linear : rotary);
}

static int refuse_column(const struct run *run, const char *what, const char *rotary, const char *linear,
                         const char *map, struct error *out_error)
{
    char columns[200] = "none";
    size_t used = 0;
    for (size_t i = 0; i < run->column_count && used < sizeof columns; i++)
        used +=
            (size_t)snprintf(columns + used, sizeof columns - used, "%s%s", i > 0 ? ", " : "", run->columns[i].name);
    return error_set(
        out_error, error_refused,
        "%s: no %s: a column %s (or %s on a linear axis) is needed, the file has %s: --map %s says which it is",
        run->path ? run->path : "run", what, rotary, linear, columns, map);
}

static int refuse_memory(const struct run *run, struct error *out_error)
{
    return error_set(out_error, error_refused, "%s: not enough memory for %zu rows", run->path, run->rows);
}

/// Rows that were not measured, by the file's word or by what they look like.
static int find_lost(const struct run *run, struct recording *r, struct error *out_error)
{
    const size_t most_share = 3; // of the rows: with more gone nobody knows what moved
    r->all.lost = calloc(run->rows, sizeof *r->all.lost);
    if (!r->all.lost)
        return refuse_memory(run, out_error);
    r->filled = repair_find(run, r->all.lost, &r->finding);
    if (r->filled <= run->rows / most_share)
        return 0;
    return error_set(out_error, error_refused,
                     "%s: %zu of %zu rows were lost or repeat the row before; diagnosis needs two thirds of them",
                     run->path, r->filled, run->rows);
}

static bool fill_columns(struct recording *r, double *position, double *velocity)
{
    double *columns[] = {r->all.torque, position, velocity};
    size_t period = r->periodic ? r->block.samples : 0;
    for (size_t i = 0; r->filled > 0 && i < sizeof columns / sizeof columns[0]; i++)
        if (columns[i] && !repair_fill(r->all.samples, r->all.lost, period, columns[i]))
            return false;
    return true;
}

/// After the columns were filled: a period knows its lost rows from the other periods, a run without periods has
/// nothing but a guess there, and predictions have to keep off it.
static bool settle_lost(struct recording *r)
{
    if (r->periodic || r->filled == 0) {
        free(r->all.lost);
        r->all.lost = NULL;
        return true;
    }
    r->block.lost = malloc(r->block.samples * sizeof *r->block.lost);
    if (r->block.lost)
        memcpy(r->block.lost, r->all.lost, r->block.samples * sizeof *r->block.lost);
    return r->block.lost != NULL;
}

static bool take_motion(struct recording *r, const double *position, const double *velocity)
{
    size_t rows = r->all.samples, period = r->periodic ? r->block.samples : 0;
    r->all.position = malloc(rows * sizeof(double));
    r->all.velocity = malloc(rows * sizeof(double));
    bool good =
        r->all.position && r->all.velocity &&
        motion_estimate(rows, r->rate_hz, position, velocity, period, &r->all, r->motion_from, sizeof r->motion_from);
    r->derived = position && !r->all.kinematics;
    return good;
}

static size_t unwrap(const struct run *run, double *io_position)
{
    return io_position && !run->linear ? repair_unwrap(run->rows, io_position) : 0;
}

static int take_columns(const struct run *run, struct recording *r, struct error *out_error)
{
    struct gain_input input = gain_find_input(run);
    const double *position = either(run, "position_rad", "position_m");
    const double *velocity = either(run, "velocity_rad_per_s", "velocity_m_per_s");
    if (!input.measured)
        return refuse_column(run, "torque", "torque_Nm, current_A, voltage_V", "force_N", "current_A=COLUMN",
                             out_error);
    if (!position && !velocity)
        return refuse_column(run, "motion", "position_rad", "position_m", "position_rad=COLUMN*RAD_PER_UNIT",
                             out_error);
    r->all.samples = run->rows;
    r->input_unit = input.unit;
    r->all.torque = copied(input.measured, run->rows);
    r->all.torque_ref = copied(input.reference, run->rows);
    double *raw_position = copied(position, run->rows), *raw_velocity = copied(velocity, run->rows);
    bool copies = r->all.torque && (!input.reference || r->all.torque_ref) && (!position || raw_position) &&
                  (!velocity || raw_velocity);
    r->turns = copies ? unwrap(run, raw_position) : 0;
    bool good = copies && fill_columns(r, raw_position, raw_velocity) && take_motion(r, raw_position, raw_velocity);
    free(raw_position);
    free(raw_velocity);
    return good ? 0 : refuse_memory(run, out_error);
}

/// The run's own word, else what its torque repeats after; only repetitions as good and as many as a multisine's are
/// believed.
static size_t find_period(const struct run *run, struct oddities *io_oddities)
{
    const double nearly_exact = 0.99;
    const size_t fewest = 5; // fewer leave nothing to average, and a start to throw away
    struct gain_input input = gain_find_input(run);
    const double *torque = input.measured, *reference = input.reference;
    struct period_search search;
    if (run->period_samples > 0)
        return oddities_period(run, reference ? reference : torque, io_oddities);
    if (!torque || period_search_run(reference ? reference : torque, run->rows, &search) != period_search_ok)
        return 0;
    bool often = run->rows >= fewest * search.period_samples;
    return often && search.correlation >= nearly_exact ? search.period_samples : 0;
}

/// Periods that count: after the settling ones and, unless the file says how many settled, after the first.
static void choose_periods(const struct run *run, struct recording *r)
{
    size_t n = find_period(run, &r->oddities);
    const size_t shortest = 16, fewest = 3;
    r->periodic = n >= shortest && run->rows >= fewest * n;
    if (!r->periodic)
        return;
    r->block.samples = n;
    size_t available = run->rows / n;
    size_t settle = run->has_settle_periods ? run->settle_periods : 0;
    if (settle == 0 && available >= 3)
        settle = 1; // the first period holds the start transient
    if (settle + 2 > available)
        settle = available - 2;
    r->lead = settle * n;
    r->periods = available - settle;
    if (run->periods > 1 && run->periods < r->periods && run->has_settle_periods)
        r->periods = run->periods;
}

/// Mean over the counted periods; the whole run, cut to a length that transforms fast, if there are none.
static bool average(const struct recording *r, const double *all, size_t n, double **out_mean)
{
    *out_mean = NULL;
    if (!all)
        return true;
    double *mean = calloc(n, sizeof *mean);
    if (!mean)
        return false;
    for (size_t p = 0; p < r->periods; p++)
        for (size_t i = 0; i < n; i++)
            mean[i] += all[r->starts[p] + i] / (double)r->periods;
    *out_mean = mean;
    return true;
}

static bool make_block(struct recording *r, size_t n)
{
    r->block.samples = n;
    r->block.position_gain = r->all.position_gain;
    return average(r, r->all.torque_ref, n, &r->block.torque_ref) && average(r, r->all.torque, n, &r->block.torque) &&
           average(r, r->all.position, n, &r->block.position) && average(r, r->all.velocity, n, &r->block.velocity) &&
           average(r, r->all.kinematics, n, &r->block.kinematics);
}

/// Counted periods; those in which the file marks samples as lost are left out while half of them stay, else the
/// marked rows are filled like any others that were not measured.
static int choose_starts(const struct run *run, struct recording *r, struct error *out_error)
{
    const double *valid = run_column(run, "valid");
    size_t n = r->periodic ? r->block.samples : run->rows, kept = 0;
    r->starts = calloc(r->periods, sizeof *r->starts);
    if (!r->starts)
        return refuse_memory(run, out_error);
    for (size_t p = 0; p < r->periods; p++) {
        size_t start = r->lead + p * n, gaps = 0;
        for (size_t i = start; valid && i < start + n; i++)
            gaps += valid[i] == 0.0;
        if (gaps == 0)
            r->starts[kept++] = start;
    }
    if (kept < 2 || 2 * kept < r->periods) {
        for (size_t p = 0; p < r->periods; p++)
            r->starts[p] = r->lead + p * n;
        kept = r->periods;
    }
    r->periods = kept;
    return 0;
}

static size_t smooth_length(size_t most)
{
    for (size_t n = most;; n--) {
        size_t rest = n;
        static const size_t primes[] = {2, 3, 5};
        for (size_t i = 0; i < 3; i++)
            while (rest % primes[i] == 0)
                rest /= primes[i];
        if (rest == 1)
            return n;
    }
}

/// Power of the torque per bin of the block, tapered where the block is not a period.
static bool torque_power(const struct recording *r, double *out_power)
{
    size_t n = r->block.samples;
    double *time = malloc(4 * n * sizeof *time);
    struct fft_plan *plan = fft_plan_create(n);
    if (time && plan) {
        for (size_t i = 0; i < n; i++) {
            double s = sin(3.14159265358979324 * ((double)i + 0.5) / (double)n);
            time[2 * i] = r->block.torque[i] * (r->periodic ? 1.0 : s * s);
            time[2 * i + 1] = 0.0;
        }
        fft_forward(plan, time, time + 2 * n);
        for (size_t k = 0; k < n / 2; k++)
            out_power[k] =
                time[2 * n + 2 * k] * time[2 * n + 2 * k] + time[2 * n + 2 * k + 1] * time[2 * n + 2 * k + 1];
    }
    bool good = time && plan;
    free(time);
    if (plan)
        fft_plan_destroy(plan);
    return good;
}

/// Bins with torque: of a period those above 1e-4 of the strongest in power, of another run every bin up to the one
/// below which 99.9 % of the power lies.
static void find_bins(struct recording *r, const double *power, size_t half)
{
    double total = 0.0, sum = 0.0, strongest = 0.0;
    for (size_t k = 1; k < half; k++) {
        total += power[k];
        strongest = fmax(strongest, power[k]);
    }
    for (size_t k = 1; k < half && sum < 0.999 * total; k++) {
        sum += power[k];
        if (!r->periodic || power[k] > 1e-4 * strongest)
            r->bins[r->bin_count++] = k;
    }
}

/// Excited bins: the file's, else those that have torque.
static bool choose_bins(const struct run *run, struct recording *r)
{
    size_t half = r->block.samples / 2;
    bool said = r->periodic && run->bin_count > 0 && run->period_samples == r->block.samples;
    r->bins = malloc(half * sizeof *r->bins);
    double *power = malloc(half * sizeof *power);
    bool good = r->bins && power && (said || torque_power(r, power));
    for (size_t i = 0; good && said && i < run->bin_count && run->bins[i] < half; i++)
        r->bins[r->bin_count++] = run->bins[i];
    if (good && !said)
        find_bins(r, power, half);
    free(power);
    return good && r->bin_count > 0;
}

/// Half as far again as the excitation goes: friction puts harmonics there, and nothing drives the model there.
static void choose_band(struct recording *r)
{
    double most = 0.4 * (double)r->block.samples; // beyond, a derivative of samples is no speed
    while (r->bin_count > 1 && (double)r->bins[r->bin_count - 1] > most)
        r->bin_count--;
    size_t highest = r->bins[r->bin_count - 1];
    r->band = (size_t)fmin(1.5 * (double)highest, most);
}

/// Held references change within a sample; measured torque that is slow against the sample rate does not.
static void choose_substeps(struct recording *r)
{
    bool slow = !r->block.torque_ref && 20 * r->band < r->block.samples;
    r->block.substeps = r->all.substeps = slow ? 1 : sim_substeps;
}

static double peak_of(size_t count, const double *values)
{
    double peak = 0.0;
    for (size_t i = 0; i < count; i++)
        peak = fmax(peak, fabs(values[i]));
    return peak;
}

/// Correlation of position with time: 1 where the axis moves at constant speed.
static double steadiness(const struct stretch *b, double mean)
{
    double xx = 0.0, tt = 0.0, xt = 0.0, middle = 0.5 * (double)(b->samples - 1);
    for (size_t i = 0; i < b->samples; i++) {
        double x = b->position[i] - mean, t = (double)i - middle;
        xx += x * x;
        tt += t * t;
        xt += x * t;
    }
    return xx > 0.0 ? fabs(xt) / sqrt(xx * tt) : 0.0;
}

static int by_size(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/// Speed that a few samples of a stretch stay below: how slow they are matters, not which share of all they make, or a
/// long stroke under the excitation would hide what its turns show. 0 if memory is short.
static double slow_speed(const struct stretch *b)
{
    const size_t few = 8, part = 250;
    size_t rank = b->samples / part > few ? b->samples / part : few;
    double *speeds = malloc(b->samples * sizeof *speeds), slow = 0.0;
    if (!speeds)
        return 0.0;
    for (size_t i = 0; i < b->samples; i++)
        speeds[i] = fabs(b->velocity[i]);
    qsort(speeds, b->samples, sizeof *speeds, by_size);
    slow = speeds[rank < b->samples ? rank : b->samples - 1];
    free(speeds);
    return slow;
}

static void measure_coverage(struct recording *r)
{
    const struct stretch *b = &r->block;
    double low = b->position[0], high = low, position = 0.0, torque = 0.0, velocity = 0.0, peak = 0.0, mean = 0.0;
    for (size_t i = 0; i < b->samples; i++) {
        low = fmin(low, b->position[i]);
        high = fmax(high, b->position[i]);
        mean += b->torque[i] / (double)b->samples;
        position += b->position[i];
        velocity += b->velocity[i] * b->velocity[i];
        peak = fmax(peak, fabs(b->velocity[i]));
    }
    for (size_t i = 0; i < b->samples; i++) // about the mean: a constant torque's rounding must not pass for one
        torque += (b->torque[i] - mean) * (b->torque[i] - mean);
    double n = (double)b->samples;
    r->coverage = (struct sim_coverage){
        .position_span = high - low,
        .position_mean = position / n,
        .steadiness = steadiness(b, position / n),
        .velocity_rms = sqrt(velocity / n),
        .velocity_peak = peak,
        .velocity_slow = slow_speed(b),
        .torque_rms = sqrt(torque / n),
        .torque_peak = peak_of(r->all.samples, r->all.torque),
        .reference_peak = r->all.torque_ref ? peak_of(r->all.samples, r->all.torque_ref) : 0.0,
        .start_s = (double)r->starts[0] / r->rate_hz,
        .duration_s = ((double)r->starts[r->periods - 1] + n) / r->rate_hz,
        .frequency_max_hz = (double)r->bins[r->bin_count - 1] * r->rate_hz / n,
        .linear = r->linear,
    };
}

void recording_begin(struct recording *self, double start_s)
{
    double before = self->all.start_s;
    self->all.start_s = start_s;
    self->block.start_s += start_s - before;
    self->coverage.start_s += start_s - before;
    self->coverage.duration_s += start_s - before;
}

/// The clock of a mean of periods stands where it is nearest to all of them.
static void set_clock(struct recording *r)
{
    double sum = 0.0;
    for (size_t p = 0; p < r->periods; p++)
        sum += (double)r->starts[p] / (double)r->periods;
    if (r->periodic)
        sum += 0.5 * (double)r->block.samples;
    r->block.start_s = sum / r->rate_hz;
}

/// Adds to the sentence on the motion that the period is a finding of ours.
static void say_period(struct recording *r)
{
    size_t used = strlen(r->motion_from);
    snprintf(r->motion_from + used, sizeof r->motion_from - used,
             " The run repeats every %zu samples: noise is averaged over %zu repetitions instead of being filtered.",
             r->block.samples, r->periods);
}

/// Whether something moves under a torque that something can be learnt from, in numbers that a drive can have.
static int check_scales(const struct run *run, const struct recording *r, struct error *out_error)
{
    const double rounding = 1e-9; // of the largest torque: less is the sum's, not the motor's
    const double least = 1e-12, most = 1e12;
    const struct sim_coverage *c = &r->coverage;
    if (!(c->torque_rms > rounding * peak_of(r->block.samples, r->block.torque)))
        return error_set(out_error, error_refused, "%s: the torque is constant: nothing was excited", run->path);
    if (!(c->velocity_rms > 0.0 && c->position_span > 0.0))
        return error_set(out_error, error_refused, "%s: the axis does not move", run->path);
    double values[] = {c->torque_rms, c->velocity_rms, c->position_span};
    static const char *const names[] = {"torque RMS", "speed RMS", "travelled range"};
    for (size_t i = 0; i < sizeof values / sizeof values[0]; i++)
        if (!(values[i] >= least && values[i] <= most))
            return error_set(out_error, error_refused, "%s: %s of %.3g in SI units; a drive has %.0e to %.0e",
                             run->path, names[i], values[i], least, most);
    return 0;
}

/// What the block is about: band, clock, coverage, and what is odd about the run.
static int describe(const struct run *run, struct recording *r, struct error *out_error)
{
    int status = oddities_of_run(run, r, &r->oddities, out_error);
    if (status != 0)
        return status;
    if (strncmp(r->motion_from, "The speed column", 16) == 0)
        oddities_add(&r->oddities, "%s: %s", run->path ? run->path : "run", r->motion_from);
    choose_band(r);
    choose_substeps(r);
    set_clock(r);
    measure_coverage(r);
    return check_scales(run, r, out_error);
}

int recording_prepare(const struct run *run, struct recording *out_recording, struct error *out_error)
{
    struct recording *r = out_recording;
    memset(r, 0, sizeof *r);
    r->linear = run->linear;
    r->rate_hz = run->sample_rate_hz;
    r->periods = 1;
    const size_t fewest = 64;
    if (run->rows < fewest)
        return error_set(out_error, error_refused, "%s: %zu rows; diagnosis needs at least %zu", run->path, run->rows,
                         fewest);
    choose_periods(run, r);
    int status = find_lost(run, r, out_error);
    if (status == 0)
        status = take_columns(run, r, out_error);
    if (r->periodic && run->period_samples == 0)
        say_period(r);
    if (status == 0)
        status = choose_starts(run, r, out_error);
    if (status == 0 && !(make_block(r, r->periodic ? r->block.samples : smooth_length(run->rows)) && settle_lost(r)))
        status = error_set(out_error, error_refused, "%s: not enough memory", run->path);
    if (status == 0 && !choose_bins(run, r))
        status = error_set(out_error, error_refused, "%s: the torque is constant: nothing was excited", run->path);
    if (status == 0)
        status = describe(run, r, out_error);
    if (status != 0)
        recording_free(r);
    return status;
}
