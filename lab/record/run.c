/* SPDX-License-Identifier: MIT */
#include "lab/record/run.h"

#include "lab/record/atomic_file.h"
#include "lab/record/number.h"
#include "lab/record/run_names.h"
#include "lab/record/text_table.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Keys that have a field of their own in struct run. */
static const char *const field_keys[] = {"sample_rate_hz", "period_samples", "periods",
                                         "settle_periods", "excited_bins",   "table_crc32"};

/* Numbers in a run must describe a recording that fits in memory; anything beyond is a typing error. */
static const double count_max = 9007199254740992.0; /* 2^53: exact in a double */
static const double rate_min_hz = 1e-3, rate_max_hz = 1e9;

/* A single time stamp may be off by a tenth of a step, so that a step between two may be off by two of them. */
static const double step_tolerance = 0.2;
/* From here on a sample is missing rather than late. */
static const double gap_steps = 1.5;
/* How far the key's rate and the mean rate of the time stamps may differ: clocks do by less, typing errors by more. */
static const double rate_tolerance = 1e-3;
/* A mean rate this close to a whole number differs from it by rounding alone. */
static const double rate_rounding = 1e-9;

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

/* period_samples, periods, settle_periods: do they fit each other and the rows? */
static int check_periods(const struct text_table *table, const struct run *run, struct error *out_error)
{
    if (run->period_samples == 0) {
        if (run->periods > 0 || run->settle_periods > 0)
            return error_set(out_error, error_refused, "%s: periods or settle_periods without period_samples",
                             table->path);
        return error_none;
    }
    size_t whole = table->rows / run->period_samples;
    if (run->periods > whole || run->settle_periods > whole - run->periods)
        return error_set(out_error, error_refused,
                         "%s: %zu settling and %zu counted periods of %zu samples do not fit the %zu rows of the file",
                         table->path, run->settle_periods, run->periods, run->period_samples, table->rows);
    return error_none;
}

static int read_keys(const struct text_table *table, struct run *run, struct error *out_error)
{
    bool said;
    int status = read_number_key(table, "sample_rate_hz", rate_min_hz, rate_max_hz,
                                 "a rate from 0.001 to 1e9 Hz was expected", &run->sample_rate_hz, &said, out_error);
    if (!status)
        status = read_count_key(table, "period_samples", 1, &run->period_samples, &said, out_error);
    if (!status)
        status = read_count_key(table, "periods", 1, &run->periods, &said, out_error);
    if (!status)
        status = read_count_key(table, "settle_periods", 0, &run->settle_periods, &run->has_settle_periods, out_error);
    if (!status)
        status = check_periods(table, run, out_error);
    if (!status)
        status = read_crc_key(table, run, out_error);
    const char *bins = NULL;
    size_t line = 0;
    if (!status)
        status = text_table_key(table, "excited_bins", &bins, &line, out_error);
    if (!status && bins)
        status = run->period_samples
                     ? read_bins(table, line, bins, run, out_error)
                     : error_set(out_error, error_refused,
                                 "%s:%zu: excited_bins: bins mean nothing without the key period_samples", table->path,
                                 line);
    return status;
}

static int compare_doubles(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Median of `count` steps, one less than there are time stamps; 0 if memory is short. */
static double median_step(const double *time_s, size_t count)
{
    double *steps = count > 0 && count < SIZE_MAX / sizeof *steps ? malloc(count * sizeof *steps) : NULL;
    if (!steps)
        return 0;
    for (size_t n = 0; n < count; n++)
        steps[n] = time_s[n + 1] - time_s[n];
    qsort(steps, count, sizeof *steps, compare_doubles);
    double median = count % 2 ? steps[count / 2] : (steps[count / 2 - 1] + steps[count / 2]) / 2;
    free(steps);
    return median;
}

static int check_steps(const struct text_table *table, const char *name, const double *time_s, double step,
                       struct error *out_error)
{
    for (size_t n = 1; n < table->rows; n++) {
        double steps = (time_s[n] - time_s[n - 1]) / step;
        if (!(steps <= gap_steps))
            return error_set(out_error, error_refused,
                             "%s:%zu: %s: %.9g follows %.9g: %.0f samples are missing, a step of %.6g s was expected",
                             table->path, table->row_line[n], name, time_s[n], time_s[n - 1],
                             fmax(1.0, round(steps) - 1.0), step);
        if (!(fabs(steps - 1.0) <= step_tolerance))
            return error_set(
                out_error, error_refused,
                "%s:%zu: %s: %.9g follows %.9g: a step of %.6g s, within 20 %%, was expected; samples have to "
                "be equidistant (--rate HZ trusts the rate and leaves the time stamps unjudged)",
                table->path, table->row_line[n], name, time_s[n], time_s[n - 1], step);
    }
    return error_none;
}

/* Judges the time stamps and takes the rate from them if no key has given it: from the mean step, which, unlike the
 * median, does not suffer from time stamps with few digits, and only once no sample is missing. */
static int read_time(const struct text_table *table, const char *name, const double *time_s, struct run *run,
                     struct error *out_error)
{
    for (size_t n = 0; n < table->rows; n++)
        if (!isfinite(time_s[n]) || (n > 0 && !(time_s[n] > time_s[n - 1])))
            return error_set(out_error, error_refused, "%s:%zu: %s: %.9g follows %.9g: time has to increase",
                             table->path, table->row_line[n], name, time_s[n], n > 0 ? time_s[n - 1] : NAN);
    double median = median_step(time_s, table->rows - 1);
    if (!(median > 0))
        return error_set(out_error, error_refused, "%s: memory is short", table->path);
    double step = run->sample_rate_hz > 0 ? 1.0 / run->sample_rate_hz : median;
    double count = (double)(table->rows - 1);
    double mean_rate_hz = count / (time_s[table->rows - 1] - time_s[0]);
    int status = error_none;
    if (fabs(median / step - 1.0) <= step_tolerance)
        status = check_steps(table, name, time_s, step, out_error);
    if (status)
        return status;
    if (run->sample_rate_hz > 0) {
        if (!(fabs(mean_rate_hz * step - 1.0) <= rate_tolerance + step_tolerance / count))
            return error_set(out_error, error_refused, "%s: sample_rate_hz is %.9g, but %s steps at %.9g Hz",
                             table->path, run->sample_rate_hz, name, mean_rate_hz);
        return error_none;
    }
    if (!(mean_rate_hz >= rate_min_hz && mean_rate_hz <= rate_max_hz))
        return error_set(out_error, error_refused, "%s: %s steps at %.9g Hz, a rate from 0.001 to 1e9 Hz was expected",
                         table->path, name, mean_rate_hz);
    double whole = round(mean_rate_hz);
    run->sample_rate_hz = fabs(mean_rate_hz - whole) <= rate_rounding * whole ? whole : mean_rate_hz;
    return error_none;
}

/* The rate: --rate, else the key checked against time_s, else time_s. A foreign `t_s` says its unit and serves where
 * nothing else does. */
static int read_rate(const struct text_table *table, double rate_hz, struct run *run, struct error *out_error)
{
    if (rate_hz > 0) {
        run->sample_rate_hz = rate_hz;
        return error_none;
    }
    const char *name = "time_s";
    const double *time_s = run_column(run, name);
    if (!time_s && !(run->sample_rate_hz > 0)) {
        name = "t_s";
        time_s = run_column(run, name);
    }
    if (time_s && run->rows > 1)
        return read_time(table, name, time_s, run, out_error);
    if (!(run->sample_rate_hz > 0))
        return error_set(out_error, error_refused,
                         "%s: no sample rate: a key '# sample_rate_hz: HZ', a column time_s or --rate HZ was expected",
                         table->path);
    return error_none;
}

/* No axis has such a value in any unit, and sums of squares of greater ones overflow far from here. */
static int check_sizes(const struct text_table *table, const struct run *run, struct error *out_error)
{
    const double most = 1e30;
    for (size_t c = 0; c < run->column_count; c++) {
        const double *data = run->columns[c].data;
        for (size_t n = 0; run_name_axis(run->columns[c].name) != run_axis_unknown && n < run->rows; n++)
            if (!(data[n] >= -most && data[n] <= most))
                return error_set(out_error, error_refused,
                                 "%s:%zu: %s: %g is no measured value: at most %g was expected", table->path,
                                 table->row_line[n], run->columns[c].name, data[n], most);
    }
    return error_none;
}

/* One column per known name, one kind of axis, 0 or 1 in `valid`. */
static int check_columns(const struct text_table *table, struct run *run, struct error *out_error)
{
    const char *rotary = NULL, *linear = NULL;
    for (size_t c = 0; c < run->column_count; c++) {
        const char *name = run->columns[c].name;
        enum run_axis axis = run_name_axis(name);
        if (axis == run_axis_unknown)
            continue;
        for (size_t other = 0; other < c; other++)
            if (strcmp(run->columns[other].name, name) == 0)
                return error_set(out_error, error_refused, "%s:%zu: there are two columns %s", table->path,
                                 table->names_line, name);
        rotary = axis == run_axis_rotary ? name : rotary;
        linear = axis == run_axis_linear ? name : linear;
    }
    if (rotary && linear)
        return error_set(out_error, error_refused,
                         "%s:%zu: %s is of a rotary axis, %s of a linear one: one kind was expected", table->path,
                         table->names_line, rotary, linear);
    run->linear = linear != NULL;
    const double *valid = run_column(run, "valid");
    for (size_t n = 0; valid && n < run->rows; n++)
        if (valid[n] != 0 && valid[n] != 1)
            return error_set(out_error, error_refused, "%s:%zu: valid: %g: 0 or 1 was expected", table->path,
                             table->row_line[n], valid[n]);
    return error_none;
}

int run_read(const char *path, const struct run_options *options, struct run *out_run, struct error *out_error)
{
    static const struct run_options no_options = {0};
    *out_run = (struct run){0};
    if (!options)
        options = &no_options;
    if (!(options->rate_hz == 0 || (options->rate_hz >= rate_min_hz && options->rate_hz <= rate_max_hz)))
        return error_set(out_error, error_usage, "--rate: %g: a rate from 0.001 to 1e9 Hz was expected",
                         options->rate_hz);
    struct run_map map;
    int status = run_map_parse(&map, options->map, out_error);
    if (status)
        return status;
    struct text_table table;
    status = text_table_read(path, run_map_judge, &map, &table, out_error);
    if (!status)
        status = run_map_apply(&map, &table, out_error);
    run_map_free(&map);
    if (status)
        return status;
    out_run->rows = table.rows;
    out_run->column_count = table.column_count;
    out_run->columns = table.columns;
    out_run->key_count = table.key_count;
    out_run->keys = table.keys;
    status = check_columns(&table, out_run, out_error);
    if (!status)
        status = check_sizes(&table, out_run, out_error);
    if (!status)
        status = read_keys(&table, out_run, out_error);
    if (!status)
        status = read_rate(&table, options->rate_hz, out_run, out_error);
    out_run->path = table.path;
    table.path = NULL;
    table.columns = NULL;
    table.keys = NULL;
    table.column_count = table.key_count = 0;
    text_table_free(&table);
    if (status)
        run_free(out_run);
    return status;
}

static bool is_field_key(const char *key)
{
    for (size_t i = 0; i < sizeof field_keys / sizeof field_keys[0]; i++)
        if (strcmp(field_keys[i], key) == 0)
            return true;
    return false;
}

static void write_keys(FILE *stream, const struct run *run)
{
    fputs("# sample_rate_hz: ", stream);
    text_write_number(stream, run->sample_rate_hz);
    fputc('\n', stream);
    if (run->period_samples > 0)
        fprintf(stream, "# period_samples: %zu\n", run->period_samples);
    if (run->periods > 0)
        fprintf(stream, "# periods: %zu\n", run->periods);
    if (run->has_settle_periods)
        fprintf(stream, "# settle_periods: %zu\n", run->settle_periods);
    if (run->bin_count > 0) {
        for (size_t k = 0; k < run->bin_count; k++)
            fprintf(stream, "%s%" PRIu32, k ? ", " : "# excited_bins: [", run->bins[k]);
        fputs("]\n", stream);
    }
    if (run->has_table_crc32)
        fprintf(stream, "# table_crc32: 0x%08" PRIx32 "\n", run->table_crc32);
    for (size_t k = 0; k < run->key_count; k++)
        if (!is_field_key(run->keys[k].key))
            text_write_key(stream, &run->keys[k]);
}

static int check_finite(const char *path, const struct run *run, struct error *out_error)
{
    if (!(run->sample_rate_hz >= rate_min_hz && run->sample_rate_hz <= rate_max_hz))
        return error_set(out_error, error_refused, "%s: not written: sample_rate_hz is %g", path, run->sample_rate_hz);
    for (size_t c = 0; c < run->column_count; c++) {
        bool known = run_name_axis(run->columns[c].name) != run_axis_unknown;
        for (size_t n = 0; n < run->rows; n++) {
            double value = run->columns[c].data[n];
            if (isinf(value) || (known && isnan(value)))
                return error_set(out_error, error_refused, "%s: not written: %s of sample %zu is not finite", path,
                                 run->columns[c].name, n);
        }
    }
    return error_none;
}

int run_write(const char *path, const struct run *run, struct error *out_error)
{
    if (run->column_count == 0 || run->rows == 0)
        return error_set(out_error, error_refused, "%s: not written: the run has no samples", path);
    int status = check_finite(path, run, out_error);
    if (status)
        return status;
    struct atomic_file file;
    FILE *stream = atomic_file_open(&file, path, out_error);
    if (!stream)
        return error_refused;
    write_keys(stream, run);
    text_write_columns(stream, run->columns, run->column_count, run->rows);
    return atomic_file_commit(&file, out_error);
}

const double *run_column(const struct run *run, const char *name)
{
    for (size_t c = 0; c < run->column_count; c++)
        if (strcmp(run->columns[c].name, name) == 0)
            return run->columns[c].data;
    return NULL;
}

double *run_add_column(struct run *run, const char *name)
{
    struct run_column *columns = realloc(run->columns, (run->column_count + 1) * sizeof *columns);
    if (!columns)
        return NULL;
    run->columns = columns;
    struct run_column column = {.name = strdup(name), .data = calloc(run->rows ? run->rows : 1, sizeof(double))};
    if (!column.name || !column.data) {
        free(column.name);
        free(column.data);
        return NULL;
    }
    columns[run->column_count++] = column;
    return column.data;
}

bool run_set_key(struct run *run, const char *key, const char *value)
{
    char *value_copy = strdup(value);
    if (!value_copy)
        return false;
    for (size_t k = 0; k < run->key_count; k++) {
        if (strcmp(run->keys[k].key, key) == 0) {
            free(run->keys[k].value);
            run->keys[k].value = value_copy;
            return true;
        }
    }
    char *key_copy = strdup(key);
    struct run_key *keys = realloc(run->keys, (run->key_count + 1) * sizeof *keys);
    if (keys)
        run->keys = keys;
    if (!keys || !key_copy) {
        free(value_copy);
        free(key_copy);
        return false;
    }
    keys[run->key_count++] = (struct run_key){key_copy, value_copy};
    return true;
}

const char *run_key(const struct run *run, const char *key)
{
    for (size_t k = 0; k < run->key_count; k++)
        if (strcmp(run->keys[k].key, key) == 0)
            return run->keys[k].value;
    return NULL;
}

void run_free(struct run *run)
{
    for (size_t c = 0; c < run->column_count; c++) {
        free(run->columns[c].name);
        free(run->columns[c].data);
    }
    for (size_t k = 0; k < run->key_count; k++) {
        free(run->keys[k].key);
        free(run->keys[k].value);
    }
    free(run->columns);
    free(run->keys);
    free(run->bins);
    free(run->path);
    *run = (struct run){0};
}
