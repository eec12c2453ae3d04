/* SPDX-License-Identifier: MIT */
#include "lab/design/lines.h"

#include "lab/record/number.h"
#include "sim/random.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    detection_group = 4, ///< neighbouring odd lines of which random-odd leaves one out
};

enum { place_size = 512 };

/// A specification while it is read.
struct parse {
    const char *specification;
    char place[place_size]; ///< what messages begin with: the specification, or file and line
    const struct design_line_grid *grid;
    uint64_t seed;
    double first_hz;
    double last_hz;
    double third; ///< STEP in Hz, or RATIO
    struct design_lines *lines;
    struct error *out_error;
};

static double line_hz(const struct parse *self)
{
    return self->grid->rate_hz / (double)self->grid->period_samples;
}

static uint32_t highest_bin(const struct parse *self)
{
    return (uint32_t)((self->grid->period_samples - 1) / 2);
}

double design_lines_tolerance(double bins)
{
    return fmin(0.01, 1e-6 * bins);
}

static int refuse_off_grid(const struct parse *self, const char *what, double frequency_hz)
{
    double nearest = fmax(1, round(frequency_hz / line_hz(self)));
    return error_set(self->out_error, error_usage,
                     "%s: %s %.9g Hz is not on the period's grid of %.9g Hz; the nearest is %.9g Hz", self->place, what,
                     frequency_hz, line_hz(self), nearest * line_hz(self));
}

static int to_bin(const struct parse *self, const char *what, double frequency_hz, uint32_t *out_bin)
{
    double bins = frequency_hz / line_hz(self);
    if (!(bins <= highest_bin(self) + 0.5)) {
        return error_set(self->out_error, error_usage,
                         "%s: %s %.9g Hz is too high, half the rate is %.9g Hz and the highest line %.9g Hz",
                         self->place, what, frequency_hz, self->grid->rate_hz / 2, highest_bin(self) * line_hz(self));
    }
    if (!(bins > 0.5) || fabs(bins - round(bins)) > design_lines_tolerance(bins)) {
        return refuse_off_grid(self, what, frequency_hz);
    }
    *out_bin = (uint32_t)round(bins);
    return 0;
}

/// Highest bin not above FMAX, which need not lie on the grid itself.
static int last_bin(const struct parse *self, uint32_t *out_bin)
{
    double bins = self->last_hz / line_hz(self);
    double last = floor(bins + design_lines_tolerance(bins));
    if (!(last <= highest_bin(self))) {
        return to_bin(self, "FMAX", self->last_hz, out_bin);
    }
    *out_bin = (uint32_t)fmax(0, last);
    return 0;
}

static int allocate(const struct parse *self)
{
    self->lines->step_bins = 1;
    self->lines->bins = calloc(self->grid->period_samples / 2 + 1, sizeof *self->lines->bins);
    return self->lines->bins ? 0 : error_set(self->out_error, error_refused, "memory is short for the lines");
}

static void append(const struct parse *self, uint32_t bin)
{
    self->lines->bins[self->lines->count++] = bin;
}

static int parse_linear(const struct parse *self)
{
    uint32_t first = 0;
    uint32_t last = 0;
    uint32_t step = 0;
    int status = to_bin(self, "FMIN", self->first_hz, &first);
    status = status ? status : last_bin(self, &last);
    status = status ? status : to_bin(self, "STEP", self->third, &step);
    for (uint32_t bin = first; !status && bin <= last; bin += step) {
        append(self, bin);
    }
    self->lines->step_bins = step;
    return status;
}

static int parse_odd(const struct parse *self)
{
    uint32_t last = 0;
    uint32_t step = 0;
    int status = last_bin(self, &last);
    status = status ? status : to_bin(self, "STEP", self->third, &step);
    double first = self->first_hz / line_hz(self);
    for (uint32_t bin = step; !status && bin <= last; bin += 2 * step) {
        if (bin >= first - design_lines_tolerance(first)) {
            append(self, bin);
        }
    }
    self->lines->step_bins = step;
    return status;
}

static int parse_random_odd(const struct parse *self)
{
    int status = parse_odd(self);
    if (status) {
        return status;
    }
    struct design_lines *lines = self->lines;
    const size_t odd_count = lines->count;
    uint64_t state[4];
    sim_random_seed(state, self->seed);
    lines->count = 0;
    for (size_t group = 0; group < odd_count; group += detection_group) {
        size_t left_out = group + (size_t)(sim_random_bits(state) % detection_group);
        for (size_t k = group; k < group + detection_group && k < odd_count; k++) {
            if (k != left_out) {
                append(self, lines->bins[k]);
            }
        }
    }
    return 0;
}

static int parse_quasilog(const struct parse *self)
{
    uint32_t first = 0;
    uint32_t last = 0;
    if (!(self->third > 1)) {
        return error_set(self->out_error, error_usage, "%s: RATIO %.9g, expected a number above 1", self->place,
                         self->third);
    }
    int status = to_bin(self, "FMIN", self->first_hz, &first);
    status = status ? status : last_bin(self, &last);
    for (double bin = first; !status && bin <= last; bin = fmax(bin + 1, round(self->third * bin))) {
        append(self, (uint32_t)bin);
    }
    return status;
}

static int compare_bins(const void *a, const void *b)
{
    const uint32_t left = *(const uint32_t *)a;
    const uint32_t right = *(const uint32_t *)b;
    return (left > right) - (left < right);
}

/// Reads one line of a list file; `used` marks the bins that are taken.
static int take_list_line(const struct parse *self, const char *path, size_t line_number, char *line, bool *used)
{
    double frequency_hz = 0;
    uint32_t bin = 0;
    line[strcspn(line, "#\r\n")] = '\0';
    enum number_status number = number_parse(line, strlen(line), &frequency_hz);
    if (number == number_empty) {
        return 0;
    }
    if (number != number_ok) {
        return error_set(self->out_error, error_refused, "%s:%zu: '%s' %s, expected a frequency in Hz", path,
                         line_number, line, number_status_str(number));
    }
    struct parse at_line = *self;
    snprintf(at_line.place, sizeof at_line.place, "%s:%zu", path, line_number);
    struct error why;
    at_line.out_error = &why;
    if (to_bin(&at_line, "frequency", frequency_hz, &bin)) {
        return error_set(self->out_error, error_refused, "%s", why.message);
    }
    if (used[bin]) {
        return error_set(self->out_error, error_refused, "%s:%zu: %.9g Hz is there twice", path, line_number,
                         frequency_hz);
    }
    used[bin] = true;
    append(self, bin);
    return 0;
}

static int read_list(const struct parse *self, const char *path, FILE *stream)
{
    bool *used = calloc(self->grid->period_samples, sizeof *used);
    char *line = NULL;
    size_t capacity = 0;
    int status = used ? 0 : error_set(self->out_error, error_refused, "memory is short for the lines");
    for (size_t number = 1; !status && getline(&line, &capacity, stream) >= 0; number++) {
        status = take_list_line(self, path, number, line, used);
    }
    if (!status && ferror(stream)) {
        status = error_set(self->out_error, error_refused, "%s: cannot be read: %s", path, strerror(errno));
    }
    free(line);
    free(used);
    if (!status) {
        qsort(self->lines->bins, self->lines->count, sizeof *self->lines->bins, compare_bins);
    }
    return status;
}

static int parse_list(const struct parse *self, const char *path)
{
    FILE *stream = fopen(path, "r");
    if (!stream) {
        return error_set(self->out_error, error_refused, "%s: cannot be opened: %s", path, strerror(errno));
    }
    int status = read_list(self, path, stream);
    fclose(stream);
    return status;
}

/// The kinds that take three numbers.
static const struct {
    const char *name;
    const char *form;
    int (*parse)(const struct parse *self);
} kinds[] = {
    {"linear", "linear:FMIN:FMAX:STEP", parse_linear},
    {"odd", "odd:FMIN:FMAX:STEP", parse_odd},
    {"random-odd", "random-odd:FMIN:FMAX:STEP", parse_random_odd},
    {"quasilog", "quasilog:FMIN:FMAX:RATIO", parse_quasilog},
    {"octaves", "octaves:FMIN:FMAX:STEP", parse_linear},
    {"dwell", "dwell:FMIN:FMAX:STEP", parse_linear},
};

static int parse_numbers(struct parse *self, const char *text, const char *form)
{
    double *fields[] = {&self->first_hz, &self->last_hz, &self->third};
    for (size_t i = 0; i < 3; i++) {
        size_t length = strcspn(text, ":");
        bool ends = text[length] == '\0';
        if (ends != (i == 2)) {
            return error_set(self->out_error, error_usage, "%s: expected three numbers, %s", self->place, form);
        }
        enum number_status number = number_parse(text, length, fields[i]);
        if (number != number_ok || !(*fields[i] > 0)) {
            return error_set(self->out_error, error_usage, "%s: '%.*s' %s, expected %s", self->place, (int)length, text,
                             number == number_ok ? "is not positive" : number_status_str(number), form);
        }
        text += length + 1;
    }
    if (!(self->last_hz >= self->first_hz)) {
        return error_set(self->out_error, error_usage, "%s: FMAX %.9g Hz is below FMIN %.9g Hz", self->place,
                         self->last_hz, self->first_hz);
    }
    return 0;
}

static int parse_kind(struct parse *self)
{
    const char *colon = strchr(self->specification, ':');
    size_t length = colon ? (size_t)(colon - self->specification) : strlen(self->specification);
    const char *rest = colon ? colon + 1 : "";
    if (length == 4 && strncmp(self->specification, "list", length) == 0 && *rest != '\0') {
        return parse_list(self, rest);
    }
    for (size_t i = 0; i < sizeof kinds / sizeof kinds[0]; i++) {
        if (strlen(kinds[i].name) == length && strncmp(self->specification, kinds[i].name, length) == 0) {
            int status = parse_numbers(self, rest, kinds[i].form);
            return status ? status : kinds[i].parse(self);
        }
    }
    return error_set(self->out_error, error_usage,
                     "%s: expected linear:, odd:, random-odd:, octaves: or dwell:FMIN:FMAX:STEP, "
                     "quasilog:FMIN:FMAX:RATIO or list:FILE",
                     self->place);
}

int design_lines_parse(const char *specification, const struct design_line_grid *grid, uint64_t seed,
                       struct design_lines *out_lines, struct error *out_error)
{
    *out_lines = (struct design_lines){0};
    struct parse self = {
        .specification = specification, .grid = grid, .seed = seed, .lines = out_lines, .out_error = out_error};
    snprintf(self.place, sizeof self.place, "lines '%s'", specification);
    if (!(grid->rate_hz > 0 && isfinite(grid->rate_hz)) || grid->period_samples < 3) {
        return error_set(out_error, error_usage, "%s: rate %g Hz and period %zu samples leave no line", self.place,
                         grid->rate_hz, grid->period_samples);
    }
    int status = allocate(&self);
    status = status ? status : parse_kind(&self);
    if (!status && out_lines->count == 0) {
        status = error_set(out_error, error_usage, "%s: no line is left, expected at least one", self.place);
    }
    if (status) {
        design_lines_free(out_lines);
    }
    return status;
}

void design_lines_free(struct design_lines *lines)
{
    free(lines->bins);
    *lines = (struct design_lines){0};
}
