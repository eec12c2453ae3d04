/* SPDX-License-Identifier: MIT */
#include "lab/measure/summary.h"

#include "lab/measure/amplitudes.h"
#include "lab/measure/table_value.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const char *const rotary_names[measure_quantities] = {"torque_Nm", "velocity_rad_per_s", "position_rad"};
static const char *const linear_names[measure_quantities] = {"force_N", "velocity_m_per_s", "position_m"};
enum { compared = measure_velocity + 1 }; ///< torque and velocity: a position may drift

static bool row_counts(const struct measure_summary *self, size_t row)
{
    return !self->valid || self->valid[row] > 0.0;
}

static bool period_is_whole(const struct measure_summary *self, size_t period)
{
    const size_t length = self->run->period_samples;
    for (size_t n = period * length; n < (period + 1) * length; n++) {
        if (!row_counts(self, n)) {
            return false;
        }
    }
    return true;
}

static bool allocate(struct measure_summary *self)
{
    const size_t lines = self->line_count;
    double *distances = calloc(compared * self->whole + 1, sizeof *distances);
    double *amplitudes = calloc((2 * compared + 1) * lines + 1, sizeof *amplitudes);
    if (!distances || !amplitudes) {
        free(distances);
        free(amplitudes);
        return false;
    }
    self->frequency_hz = amplitudes;
    for (size_t q = 0; q < compared; q++) {
        self->distance[q] = distances + q * self->whole;
        self->amplitude[q] = amplitudes + (1 + q) * lines;
        self->table_amplitude[q] = amplitudes + (1 + compared + q) * lines;
    }
    return true;
}

void measure_summary_free(struct measure_summary *self)
{
    free(self->distance[0]);
    free(self->frequency_hz);
    *self = (struct measure_summary){0};
}

static void count_lost(struct measure_summary *self, size_t rows_planned)
{
    const struct run *run = self->run;
    for (size_t n = 0; n < run->rows; n++) {
        if (!row_counts(self, n)) {
            self->lost++;
            self->lost_in_part[measure_part_of(n, rows_planned > run->rows ? rows_planned : run->rows)]++;
        }
    }
    for (size_t p = run->settle_periods; p < self->whole; p++) {
        self->periods_with_lost += !period_is_whole(self, p);
    }
}

static double table_rms(const struct msgen_table *table, uint32_t channel)
{
    double sum = 0.0;
    for (uint32_t n = 0; n < table->period_samples; n++) {
        const double value = table_value_at(table, n, channel);
        sum += value * value;
    }
    return sqrt(sum / (double)table->period_samples);
}

static void find_table_level(const struct measure_summary *self, size_t quantity, struct measure_level *io_level)
{
    const char *mode = run_key(self->run, "mode");
    const bool drifts =
        quantity == measure_position && (self->table->travel_q30 != 0 || !mode || strcmp(mode, "cascade") != 0);
    const bool known = quantity < self->table->channels && !drifts;
    io_level->table_peak = known ? table_value_peak(self->table, (uint32_t)quantity) : NAN;
    io_level->table_rms = known ? table_rms(self->table, (uint32_t)quantity) : NAN;
}

static void find_level(const struct measure_summary *self, size_t quantity, struct measure_level *io_level)
{
    const double *values = self->column[quantity];
    const bool counted = self->run->periods > 0;
    const size_t first = counted ? self->run->settle_periods * self->run->period_samples : 0;
    const size_t end = counted ? first + self->run->periods * self->run->period_samples : self->run->rows;
    double sum = 0.0;
    size_t count = 0;
    for (size_t n = 0; n < self->run->rows; n++) {
        if (row_counts(self, n)) {
            io_level->peak = fmax(io_level->peak, fabs(values[n]));
            sum += n >= first && n < end ? values[n] * values[n] : 0.0;
            count += n >= first && n < end;
        }
    }
    io_level->rms = count > 0 ? sqrt(sum / (double)count) : NAN;
}

static void set_limit(double limit, struct measure_level *io_level)
{
    if (limit < CORE_REAL_MAX) {
        io_level->limit = limit;
        io_level->used = io_level->peak / limit;
    }
}

/// The limits of a later segment count from where the axis stands then, and are not the same both ways.
static void set_position_limit(const struct measure_summary *self, const struct guard_real_limits *limits,
                               struct measure_level *io_level)
{
    if (!(limits->position_max_rad < CORE_REAL_MAX)) {
        return;
    }
    io_level->limit = 0.5 * (limits->position_max_rad - limits->position_min_rad);
    for (size_t n = 0; n < self->run->rows; n++) {
        const double value = self->column[measure_position][n];
        if (row_counts(self, n)) {
            io_level->used =
                fmax(io_level->used, fmax(value / limits->position_max_rad, value / limits->position_min_rad));
        }
    }
}

static double mean_difference(const double *a, const double *b, size_t count)
{
    double sum = 0.0;
    for (size_t n = 0; n < count; n++) {
        sum += a[n] - (b ? b[n] : 0.0);
    }
    return sum / (double)count;
}

/// RMS of a - b around its mean; b NULL: of a.
static double rms_difference(const double *a, const double *b, size_t count)
{
    const double mean = mean_difference(a, b, count);
    double sum = 0.0;
    for (size_t n = 0; n < count; n++) {
        const double value = a[n] - (b ? b[n] : 0.0) - mean;
        sum += value * value;
    }
    return sqrt(sum / (double)count);
}

static void find_distances(struct measure_summary *self)
{
    const size_t length = self->run->period_samples;
    self->reference = self->whole;
    for (size_t p = 0; p < self->whole; p++) {
        self->reference = period_is_whole(self, p) ? p : self->reference;
    }
    for (size_t q = 0; q < compared; q++) {
        for (size_t p = 0; p < self->whole; p++) {
            const double *last = self->column[q] + self->reference * length;
            const bool comparable = self->reference < self->whole && p != self->reference && period_is_whole(self, p);
            self->distance[q][p] = comparable ? rms_difference(self->column[q] + p * length, last, length) /
                                                    rms_difference(last, NULL, length)
                                              : NAN;
        }
    }
}

/// Mean of the counted periods that are whole, else of the settling ones: `out_period` holds torque, then velocity.
static size_t average(const struct measure_summary *self, double *out_period)
{
    const size_t length = self->run->period_samples;
    const size_t first = self->run->periods > 0 ? self->run->settle_periods : 0;
    size_t count = 0;
    memset(out_period, 0, compared * length * sizeof *out_period);
    for (size_t p = first; p < self->whole; p++) {
        if (period_is_whole(self, p)) {
            for (size_t n = 0; n < compared * length; n++) {
                out_period[n] += self->column[n / length][p * length + n % length];
            }
            count++;
        }
    }
    for (size_t n = 0; count > 0 && n < compared * length; n++) {
        out_period[n] /= (double)count;
    }
    return count;
}

static void take_table(const struct measure_summary *self, double *out_period)
{
    const uint32_t length = self->table->period_samples;
    for (uint32_t c = 0; c < compared; c++) {
        for (uint32_t n = 0; n < length; n++) {
            out_period[c * length + n] = c < self->table->channels ? table_value_at(self->table, n, c) : 0.0;
        }
    }
}

static void forget_line_values(double *values, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        values[i] = NAN;
    }
}

static bool find_lines(struct measure_summary *self)
{
    const size_t length = self->table->period_samples;
    double *numbers = malloc(4 * length * sizeof *numbers);
    struct fft_plan *plan = fft_plan_create(length);
    const bool done = numbers && plan;
    for (size_t i = 0; done && i < self->line_count; i++) {
        self->frequency_hz[i] =
            table_value_rate_hz(self->table) / (double)length * (double)msgen_table_bin(self->table, (uint32_t)i);
    }
    if (done) {
        self->averaged = average(self, numbers);
        measure_find_amplitudes(plan, self->table, numbers, numbers + 2 * length, self->amplitude);
        take_table(self, numbers);
        measure_find_amplitudes(plan, self->table, numbers, numbers + 2 * length, self->table_amplitude);
        for (size_t q = 0; q < compared; q++) {
            forget_line_values(self->amplitude[q], self->averaged > 0 ? 0 : self->line_count);
            forget_line_values(self->table_amplitude[q], q < self->table->channels ? 0 : self->line_count);
        }
    }
    fft_plan_destroy(plan);
    free(numbers);
    return done;
}

bool measure_summary_make(const struct run *run, const struct msgen_table *table,
                          const struct guard_real_limits *limits, size_t rows_planned, struct measure_summary *out_self)
{
    *out_self = (struct measure_summary){.run = run, .table = table, .line_count = table->bin_count};
    struct measure_level *level = out_self->level;
    out_self->whole = run->rows / run->period_samples;
    out_self->valid = run_column(run, "valid");
    for (size_t q = 0; q < measure_quantities; q++) {
        out_self->column[q] = run_column(run, (run->linear ? linear_names : rotary_names)[q]);
    }
    if (!allocate(out_self)) {
        return false;
    }
    count_lost(out_self, rows_planned);
    for (size_t q = 0; q < measure_quantities; q++) {
        find_table_level(out_self, q, &level[q]);
        find_level(out_self, q, &level[q]);
    }
    set_limit(limits->torque_max_Nm, &level[measure_torque]);
    set_limit(limits->velocity_max_rad_per_s, &level[measure_velocity]);
    set_position_limit(out_self, limits, &level[measure_position]);
    find_distances(out_self);
    if (!find_lines(out_self)) {
        measure_summary_free(out_self);
        return false;
    }
    return true;
}

double measure_summary_first(const struct measure_summary *self, enum measure_quantity quantity)
{
    const size_t first = self->run->settle_periods;
    return first < self->whole ? self->distance[quantity][first] : NAN;
}

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a;
    const double y = *(const double *)b;
    return (x > y) - (x < y);
}

double measure_summary_usual(const struct measure_summary *self, enum measure_quantity quantity)
{
    double *values = malloc((self->whole + 1) * sizeof *values);
    size_t count = 0;
    for (size_t p = self->run->settle_periods + 1; values && p < self->whole; p++) {
        if (isfinite(self->distance[quantity][p])) {
            values[count++] = self->distance[quantity][p];
        }
    }
    double usual = NAN;
    if (count > 0) {
        qsort(values, count, sizeof *values, ascending);
        usual = 0.5 * (values[(count - 1) / 2] + values[count / 2]);
    }
    free(values);
    return usual;
}
