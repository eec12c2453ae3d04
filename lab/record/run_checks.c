/* SPDX-License-Identifier: MIT */
#include "lab/record/run_checks.h"

#include "lab/record/number.h"
#include "lab/record/run_names.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

static const char *const field_keys[] = {"sample_rate_hz", "period_samples", "periods",
                                         "settle_periods", "excited_bins",   "table_crc32"};

/* Numbers in a run must describe a recording that can be; anything beyond is a typing error. */
static const double count_max = SIZE_MAX > UINT32_MAX ? 9007199254740992.0 : UINT32_MAX; /* 2^53: exact in a double */
static const double rate_min_hz = 1e-3, rate_max_hz = 1e9;

/* No axis has such a value in any unit, and sums of squares of greater ones overflow far from here. */
static const double value_max = 1e30;

/* A single time stamp may be off by a tenth of a step, so that a step between two may be off by two of them. */
static const double step_tolerance = 0.2;
/* From here on a sample is missing rather than late. */
static const double gap_steps = 1.5;
/* How far the key's rate and the mean rate of the time stamps may differ: clocks do by less, typing errors by more. */
static const double rate_tolerance = 1e-3;
/* A mean rate this close to a whole number differs from it by rounding alone. */
static const double rate_rounding = 1e-9;

enum { median_steps_max = 65536 };

bool run_is_field_key(const char *key)
{
    for (size_t i = 0; i < sizeof field_keys / sizeof field_keys[0]; i++)
        if (strcmp(field_keys[i], key) == 0)
            return true;
    return false;
}

int run_check_options(const struct run_options *options, struct error *out_error)
{
    if (!(options->rate_hz == 0 || (options->rate_hz >= rate_min_hz && options->rate_hz <= rate_max_hz)))
        return error_set(out_error, error_usage, "--rate: %g: a rate from 0.001 to 1e9 Hz was expected",
                         options->rate_hz);
    return error_none;
}

static int key_error(const struct text_table *table, size_t line, const char *key, const char *value,
                     const char *expectation, struct error *out_error)
{
    return error_set(out_error, error_refused, "%s:%zu: %s: '%.60s': %s", table->path, line, key, value, expectation);
}

/* A key that may be left out and holds a number in low .. high; *out_said tells whether it was there. */
static int read_number_key(const struct text_table *table, const char *key, double low, double high,
                           const char *expectation, double *out_value, bool *out_said, struct error *out_error)
{
    const char *text;
    size_t line;
    int status = text_table_key(table, key, &text, &line, out_error);
    *out_said = !status && text;
    if (status || !text)
        return status;
    double value = NAN;
    if (number_parse(text, strlen(text), &value) != number_ok || !(value >= low && value <= high))
        return key_error(table, line, key, text, expectation, out_error);
    *out_value = value;
    return error_none;
}

static int read_count_key(const struct text_table *table, const char *key, double low, size_t *out_count,
                          bool *out_said, struct error *out_error)
{
    double value = 0;
    const char *expectation =
        low > 0 ? "a whole number from 1 on was expected" : "a whole number from 0 on was expected";
    int status = read_number_key(table, key, low, count_max, expectation, &value, out_said, out_error);
    if (status || !*out_said)
        return status;
    if (value != floor(value))
        return error_set(out_error, error_refused, "%s: %s: %g: %s", table->path, key, value, expectation);
    *out_count = (size_t)value;
    return error_none;
}

static int read_crc_key(const struct text_table *table, struct run *run, struct error *out_error)
{
    const char *text;
    size_t line;
    int status = text_table_key(table, "table_crc32", &text, &line, out_error);
    if (status || !text)
        return status;
    bool hexadecimal = strncmp(text, "0x", 2) == 0 || strncmp(text, "0X", 2) == 0;
    const char *digits = hexadecimal ? text + 2 : text;
    size_t count = strlen(digits);
    unsigned long long value = strtoull(digits, NULL, hexadecimal ? 16 : 10);
    if (count == 0 || count > 10 || strspn(digits, hexadecimal ? "0123456789abcdefABCDEF" : "0123456789") != count ||
        value > UINT32_MAX)
        return key_error(table, line, "table_crc32", text, "a CRC-32 like 0x1a2b3c4d was expected", out_error);
    run->has_table_crc32 = true;
    run->table_crc32 = (uint32_t)value;
    return error_none;
}

static int bins_error(const struct text_table *table, size_t line, const char *at, const char *what,
                      struct error *out_error)
{
    return error_set(out_error, error_refused, "%s:%zu: excited_bins: at '%.20s': %s", table->path, line,
                     *at ? at : "end of line", what);
}

/* One bin at `at`; NULL, with the error set, if it is none. */
static const char *read_bin(const struct text_table *table, size_t line, const char *at, struct run *run,
                            struct error *out_error)
{
    const char *wrong = NULL;
    size_t digits = strspn(at, "0123456789");
    uint32_t bin = digits > 0 && digits <= 9 ? (uint32_t)strtoul(at, NULL, 10) : 0;
    if (digits == 0 || digits > 9 || !strchr(", \t]", at[digits]))
        wrong = "a whole number was expected";
    else if (run->bin_count > 0 && bin <= run->bins[run->bin_count - 1])
        wrong = "bins have to ascend";
    else if (bin == 0 || 2 * (uint64_t)bin >= run->period_samples)
        wrong = "a bin from 1 to below half of period_samples was expected";
    if (wrong) {
        bins_error(table, line, at, wrong, out_error);
        return NULL;
    }
    run->bins[run->bin_count++] = bin;
    return at + digits;
}

/* Whole numbers, separated by commas or blanks, with or without brackets around them. */
static int read_bins(const struct text_table *table, size_t line, const char *text, struct run *run,
                     struct error *out_error)
{
    size_t length = strlen(text);
    run->bins = malloc((length / 2 + 1) * sizeof *run->bins);
    if (!run->bins)
        return error_set(out_error, error_refused, "%s:%zu: memory is short", table->path, line);
    const char *at = text, *end = text + length;
    if (*text == '[') {
        if (length < 2 || end[-1] != ']')
            return bins_error(table, line, end, "']' was expected: the line is cut off", out_error);
        at++;
        end--;
    }
    for (;;) {
        at += strspn(at, ", \t");
        if (at >= end)
            break;
        at = read_bin(table, line, at, run, out_error);
        if (!at)
            return error_refused;
    }
    if (run->bin_count == 0)
        return bins_error(table, line, text, "a list of bins like [1, 3, 5] was expected", out_error);
    return error_none;
}

int run_read_keys(const struct text_table *table, struct run *io_run, struct error *out_error)
{
    bool said;
    io_run->sample_rate_hz = 0;
    io_run->period_samples = io_run->periods = io_run->settle_periods = io_run->bin_count = 0;
    io_run->has_settle_periods = io_run->has_table_crc32 = false;
    free(io_run->bins);
    io_run->bins = NULL;
    int status = read_number_key(table, "sample_rate_hz", rate_min_hz, rate_max_hz,
                                 "a rate from 0.001 to 1e9 Hz was expected", &io_run->sample_rate_hz, &said, out_error);
    if (!status)
        status = read_count_key(table, "period_samples", 1, &io_run->period_samples, &said, out_error);
    if (!status)
        status = read_count_key(table, "periods", 1, &io_run->periods, &said, out_error);
    if (!status)
        status =
            read_count_key(table, "settle_periods", 0, &io_run->settle_periods, &io_run->has_settle_periods, out_error);
    if (!status)
        status = read_crc_key(table, io_run, out_error);
    const char *bins = NULL;
    size_t line = 0;
    if (!status)
        status = text_table_key(table, "excited_bins", &bins, &line, out_error);
    if (!status && bins)
        status = io_run->period_samples
                     ? read_bins(table, line, bins, io_run, out_error)
                     : error_set(out_error, error_refused,
                                 "%s:%zu: excited_bins: bins mean nothing without the key period_samples", table->path,
                                 line);
    return status;
}

int run_check_names(const struct text_table *table, struct run *io_run, struct error *out_error)
{
    const char *rotary = NULL, *linear = NULL;
    for (size_t c = 0; c < table->column_count; c++) {
        const char *name = table->columns[c].name;
        enum run_axis axis = run_name_axis(name);
        if (axis == run_axis_unknown)
            continue;
        for (size_t other = 0; other < c; other++)
            if (strcmp(table->columns[other].name, name) == 0)
                return error_set(out_error, error_refused, "%s:%zu: there are two columns %s", table->path,
                                 table->names_line, name);
        rotary = axis == run_axis_rotary ? name : rotary;
        linear = axis == run_axis_linear ? name : linear;
    }
    if (rotary && linear)
        return error_set(out_error, error_refused,
                         "%s:%zu: %s is of a rotary axis, %s of a linear one: one kind was expected", table->path,
                         table->names_line, rotary, linear);
    io_run->linear = linear != NULL;
    return error_none;
}

static bool find_column(const struct run *run, const char *name, size_t *out_column)
{
    for (*out_column = 0; *out_column < run->column_count; ++*out_column)
        if (strcmp(run->columns[*out_column].name, name) == 0)
            return true;
    return false;
}

/* A foreign `t_s` says its unit and serves where nothing else does. */
void run_checks_begin(struct run_checks *self, const struct run *run, const struct run_options *options)
{
    *self = (struct run_checks){.judges_time = false};
    if (!(options->rate_hz > 0))
        self->judges_time = find_column(run, "time_s", &self->time_column) ||
                            (!(run->sample_rate_hz > 0) && find_column(run, "t_s", &self->time_column));
}

static int check_sizes(const struct text_table *table, size_t column, size_t first_row, struct error *out_error)
{
    const double *data = table->columns[column].data;
    for (size_t n = first_row; n < table->rows; n++)
        if (!(data[n] >= -value_max && data[n] <= value_max))
            return isnan(data[n])
                       ? error_set(out_error, error_refused,
                                   "%s:%zu: %s: there is no value: a number was expected in each row", table->path,
                                   table->row_line[n], table->columns[column].name)
                       : error_set(out_error, error_refused,
                                   "%s:%zu: %s: %g is no measured value: at most %g was expected", table->path,
                                   table->row_line[n], table->columns[column].name, data[n], value_max);
    return error_none;
}

static int check_valid(const struct text_table *table, size_t column, size_t first_row, struct error *out_error)
{
    const double *valid = table->columns[column].data;
    for (size_t n = first_row; n < table->rows; n++)
        if (valid[n] != 0 && valid[n] != 1)
            return error_set(out_error, error_refused, "%s:%zu: valid: %g: 0 or 1 was expected", table->path,
                             table->row_line[n], valid[n]);
    return error_none;
}

static int compare_doubles(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Median of the steps between the rows from first_row on, and from the row before them; 0 if memory is short. */
static double median_step(const struct run_checks *self, const double *time_s, size_t first_row, size_t rows)
{
    size_t count = 0;
    double *steps = malloc(median_steps_max * sizeof *steps);
    for (size_t n = first_row; steps && n < rows && count < median_steps_max; n++)
        if (n > first_row || self->rows > 0)
            steps[count++] = time_s[n] - (n > first_row ? time_s[n - 1] : self->last_s);
    if (count == 0) {
        free(steps);
        return 0;
    }
    qsort(steps, count, sizeof *steps, compare_doubles);
    double median = count % 2 ? steps[count / 2] : (steps[count / 2 - 1] + steps[count / 2]) / 2;
    free(steps);
    return median;
}

static int check_order(const struct run_checks *self, const struct text_table *table, size_t first_row,
                       struct error *out_error)
{
    const char *name = table->columns[self->time_column].name;
    const double *time_s = table->columns[self->time_column].data;
    double before = self->rows > 0 ? self->last_s : NAN;
    for (size_t n = first_row; n < table->rows; n++) {
        if (!isfinite(time_s[n]))
            return error_set(out_error, error_refused,
                             "%s:%zu: %s: there is no time: a number was expected in each row", table->path,
                             table->row_line[n], name);
        if (self->rows + n > first_row && !(time_s[n] > before))
            return error_set(
                out_error, error_refused,
                "%s:%zu: %s: %.9g follows %.9g: time has to increase (--rate HZ trusts the rate and leaves the "
                "time stamps unjudged)",
                table->path, table->row_line[n], name, time_s[n], before);
        before = time_s[n];
    }
    return error_none;
}

static int check_steps(const struct run_checks *self, const struct text_table *table, size_t first_row,
                       struct error *out_error)
{
    const char *name = table->columns[self->time_column].name;
    const double *time_s = table->columns[self->time_column].data;
    for (size_t n = self->rows > 0 ? first_row : first_row + 1; n < table->rows; n++) {
        double before = n > first_row ? time_s[n - 1] : self->last_s;
        double steps = (time_s[n] - before) / self->step_s;
        if (!(steps <= gap_steps))
            return error_set(out_error, error_refused,
                             "%s:%zu: %s: %.9g follows %.9g: %.0f sample%s missing, a step of %.6g s was expected",
                             table->path, table->row_line[n], name, time_s[n], before, fmax(1.0, round(steps) - 1.0),
                             steps < 2.5 ? " is" : "s are", self->step_s);
        if (!(fabs(steps - 1.0) <= step_tolerance))
            return error_set(
                out_error, error_refused,
                "%s:%zu: %s: %.9g follows %.9g: a step of %.6g s, within 20 %%, was expected; samples have to "
                "be equidistant (--rate HZ trusts the rate and leaves the time stamps unjudged)",
                table->path, table->row_line[n], name, time_s[n], before, self->step_s);
    }
    return error_none;
}

/* Puts the times of rows from .. end-1 between the valid ones around them; `before` is the time of the row ahead, NaN
   if there is none, io_step_s the usual step. A time that may be right stays to the last digit. */
static void place_times(double *time_s, const double *valid, size_t rows, size_t from, size_t end, double before,
                        double *io_step_s)
{
    const double count = (double)(end - from);
    if (isfinite(before) && end < rows) {
        *io_step_s = (time_s[end] - before) / (count + 1.0);
    } else if (!isfinite(before) && end < rows) {
        if (end + 1 < rows && valid[end + 1] != 0)
            *io_step_s = time_s[end + 1] - time_s[end];
        before = time_s[end] - (count + 1.0) * *io_step_s;
    }
    if (!(*io_step_s > 0 && isfinite(before)))
        return;
    for (size_t row = from; row < end; row++) {
        const double expected_s = before + (double)(row - from + 1) * *io_step_s;
        if (!(fabs(time_s[row] - expected_s) < 0.5 * *io_step_s))
            time_s[row] = expected_s;
    }
}

/* A lost row's time may be anything: it is put between its neighbours' before the steps are judged. */
static void mend_time(const struct run_checks *self, const struct text_table *table, const double *valid,
                      size_t first_row)
{
    double *time_s = table->columns[self->time_column].data;
    double before = self->rows > 0 ? self->last_s : NAN;
    double step_s = self->step_s;
    for (size_t n = first_row; n < table->rows; n++) {
        size_t end = n;
        while (end < table->rows && valid[end] == 0)
            end++;
        if (end > n) {
            place_times(time_s, valid, table->rows, n, end, before, &step_s);
            n = end - 1;
        } else if (isfinite(before)) {
            step_s = time_s[n] - before;
        }
        before = time_s[n];
    }
}

static int check_time(struct run_checks *self, const struct text_table *table, const struct run *run, size_t first_row,
                      struct error *out_error)
{
    const double *time_s = table->columns[self->time_column].data;
    size_t valid;
    if (find_column(run, "valid", &valid))
        mend_time(self, table, table->columns[valid].data, first_row);
    int status = check_order(self, table, first_row, out_error);
    if (!status && self->step_s == 0 && self->rows + table->rows - first_row > 1) {
        double median = median_step(self, time_s, first_row, table->rows);
        if (!(median > 0))
            return error_set(out_error, error_refused, "%s: memory is short", table->path);
        self->step_s = run->sample_rate_hz > 0 ? 1.0 / run->sample_rate_hz : median;
        self->judges_steps = fabs(median / self->step_s - 1.0) <= step_tolerance;
    }
    if (!status && self->judges_steps)
        status = check_steps(self, table, first_row, out_error);
    if (self->rows == 0)
        self->first_s = time_s[first_row];
    self->last_s = time_s[table->rows - 1];
    return status;
}

int run_checks_rows(struct run_checks *self, const struct text_table *table, const struct run *run, size_t first_row,
                    struct error *out_error)
{
    int status = error_none;
    if (first_row == table->rows)
        return status;
    for (size_t c = 0; c < table->column_count && !status; c++) {
        if (run_name_axis(table->columns[c].name) == run_axis_unknown)
            continue;
        if (strcmp(table->columns[c].name, "valid") == 0)
            status = check_valid(table, c, first_row, out_error);
        else
            status = check_sizes(table, c, first_row, out_error);
    }
    if (!status && self->judges_time)
        status = check_time(self, table, run, first_row, out_error);
    self->rows += table->rows - first_row;
    return status;
}

/* From the mean step, which, unlike the median, does not suffer from time stamps with few digits. */
static double mean_rate_hz(const struct run_checks *self)
{
    double rate_hz = (double)(self->rows - 1) / (self->last_s - self->first_s);
    double whole = round(rate_hz);
    return fabs(rate_hz - whole) <= rate_rounding * whole ? whole : rate_hz;
}

double run_checks_rate(const struct run_checks *self, const struct run *run, const struct run_options *options)
{
    if (options->rate_hz > 0)
        return options->rate_hz;
    if (run->sample_rate_hz > 0)
        return run->sample_rate_hz;
    return self->judges_time && self->rows > 1 ? mean_rate_hz(self) : 0;
}

/* period_samples, periods, settle_periods: do they fit each other and the rows? */
static int check_periods(const struct run_checks *self, const struct text_table *table, const struct run *run,
                         struct error *out_error)
{
    if (run->period_samples == 0) {
        if (run->periods > 0 || run->settle_periods > 0)
            return error_set(out_error, error_refused, "%s: periods or settle_periods without period_samples",
                             table->path);
        return error_none;
    }
    size_t whole = self->rows / run->period_samples;
    if (run->periods > whole || run->settle_periods > whole - run->periods)
        return error_set(out_error, error_refused,
                         "%s: %zu settling and %zu counted periods of %zu samples do not fit the %zu rows of the file",
                         table->path, run->settle_periods, run->periods, run->period_samples, self->rows);
    return error_none;
}

/* The rate: --rate, else the key checked against the time stamps, else these. */
int run_checks_end(const struct run_checks *self, const struct text_table *table, struct run *io_run,
                   const struct run_options *options, struct error *out_error)
{
    int status = check_periods(self, table, io_run, out_error);
    double key_hz = options->rate_hz > 0 ? 0 : io_run->sample_rate_hz;
    io_run->sample_rate_hz = run_checks_rate(self, io_run, options);
    if (status)
        return status;
    if (!(io_run->sample_rate_hz > 0))
        return error_set(out_error, error_refused,
                         "%s: no sample rate: a key '# sample_rate_hz: HZ', a column time_s or --rate HZ was expected",
                         table->path);
    if (!self->judges_time || self->rows < 2)
        return error_none;
    const char *name = table->columns[self->time_column].name;
    double mean_hz = mean_rate_hz(self);
    if (key_hz > 0 && !(fabs(mean_hz / key_hz - 1.0) <= rate_tolerance + step_tolerance / (double)(self->rows - 1)))
        return error_set(out_error, error_refused, "%s: sample_rate_hz is %.9g, but %s steps at %.9g Hz", table->path,
                         key_hz, name, mean_hz);
    if (!(key_hz > 0) && !(mean_hz >= rate_min_hz && mean_hz <= rate_max_hz))
        return error_set(out_error, error_refused, "%s: %s steps at %.9g Hz, a rate from 0.001 to 1e9 Hz was expected",
                         table->path, name, mean_hz);
    return error_none;
}
