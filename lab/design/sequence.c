/* SPDX-License-Identifier: MIT */
#include "lab/design/sequence.h"

#include "lab/design/design.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const char *design_sequence_kind_str(enum design_sequence_kind kind)
{
    switch (kind) {
    case design_sequence_octaves:
        return "octaves";
    case design_sequence_dwell:
        return "dwell";
    case design_sequence_multisine:
        break;
    }
    return "multisine";
}

static bool begins_with(const char *text, const char *kind)
{
    const size_t length = strlen(kind);
    return strncmp(text, kind, length) == 0 && text[length] == ':';
}

static enum design_sequence_kind kind_of(const char *specification)
{
    if (begins_with(specification, "octaves")) {
        return design_sequence_octaves;
    }
    return begins_with(specification, "dwell") ? design_sequence_dwell : design_sequence_multisine;
}

bool design_sequence_is(const char *specification)
{
    return kind_of(specification) != design_sequence_multisine;
}

static int refuse_memory(struct error *out_error)
{
    return error_set(out_error, error_refused, "memory is short for the sequence");
}

/// How the lines of input p lie to those of input 1: (p-1) * numerator * STEP / denominator.
struct interleaving {
    bool has_step; ///< STEP is said; else the whole grid is taken `denominator` times as coarse
    uint32_t numerator;
    uint32_t denominator;
};

static struct interleaving interleaving_of(const char *specification, size_t inputs)
{
    const uint32_t count = (uint32_t)inputs;
    if (begins_with(specification, "odd") || begins_with(specification, "random-odd")) {
        // Odd multiples of STEP stay odd multiples of STEP/d only for an odd d.
        return (struct interleaving){true, 2, count % 2 == 1 ? count : count + 1};
    }
    bool has_step = !begins_with(specification, "quasilog") && !begins_with(specification, "list");
    return (struct interleaving){has_step, 1, count};
}

static size_t greatest_common_divisor(size_t a, size_t b)
{
    while (b > 0) {
        size_t rest = a % b;
        a = b;
        b = rest;
    }
    return a;
}

/// Reads the lines of input 1 on a grid that has room for the other inputs between them.
/// Sets *out_shift to the bins between the inputs.
static int parse_first_input(const char *specification, const struct design_line_grid *grid, size_t inputs,
                             uint64_t seed, struct design_lines *out_lines, uint32_t *out_shift,
                             struct error *out_error)
{
    const struct interleaving way = interleaving_of(specification, inputs);
    const size_t period = grid->period_samples;
    *out_shift = 0;
    int status = design_lines_parse(specification, grid, seed, out_lines, out_error);
    if (status || inputs == 1) {
        return status;
    }
    const uint32_t step = out_lines->step_bins;
    if (step % way.denominator == 0) {
        *out_shift = step / way.denominator * way.numerator;
        return 0;
    }
    const size_t needed = period / greatest_common_divisor(step, way.denominator) * way.denominator;
    status = error_set(out_error, error_usage,
                       "lines '%s': --inputs %zu needs lines every %.9g Hz, which a period of %zu samples does not "
                       "resolve: expected a period of %zu samples%s",
                       specification, inputs, step * grid->rate_hz / (double)period / way.denominator, period, needed,
                       needed > design_period_samples_max ? ", which is too long for a table: give a larger STEP" : "");
    design_lines_free(out_lines);
    return status;
}

/// The same for kinds without a STEP: the lines of one input on every P-th bin.
static int parse_on_coarse_grid(const char *specification, const struct design_line_grid *grid, size_t inputs,
                                uint64_t seed, struct design_lines *out_lines, struct error *out_error)
{
    const struct design_line_grid coarse = {.rate_hz = grid->rate_hz, .period_samples = grid->period_samples / inputs};
    if (grid->period_samples % inputs != 0) {
        return error_set(out_error, error_usage,
                         "lines '%s': --inputs %zu needs a period of a multiple of %zu samples, not %zu: expected %zu "
                         "for the lines of one input",
                         specification, inputs, inputs, grid->period_samples, grid->period_samples * inputs);
    }
    struct error reason = {0, ""};
    int status = design_lines_parse(specification, &coarse, seed, out_lines, &reason);
    if (status) {
        return error_set(
            out_error, status,
            "%.600s (--inputs %zu: each has one of %zu lines of the period's grid; a period of %zu samples "
            "gives each as many as one input has now)",
            reason.message, inputs, inputs, grid->period_samples * inputs);
    }
    for (size_t k = 0; k < out_lines->count; k++) {
        out_lines->bins[k] *= (uint32_t)inputs;
    }
    return 0;
}

/// How many lines from `begin` on belong to one segment.
static size_t segment_length(enum design_sequence_kind kind, const struct design_lines *lines, size_t begin)
{
    if (kind == design_sequence_dwell) {
        return 1;
    }
    if (kind == design_sequence_multisine) {
        return lines->count - begin;
    }
    uint64_t edge = lines->bins[0];
    while (edge <= lines->bins[begin]) {
        edge *= 2;
    }
    size_t end = begin;
    while (end < lines->count && lines->bins[end] < edge) {
        end++;
    }
    return end - begin;
}

/// Copies `count` lines of input 1 for every input, each shifted to its own place.
static bool fill_segment(struct design_segment *segment, const uint32_t *bins, size_t count, size_t inputs,
                         uint32_t shift)
{
    segment->lines = calloc(inputs, sizeof *segment->lines);
    if (!segment->lines) {
        return false;
    }
    for (size_t p = 0; p < inputs; p++) {
        struct design_lines *lines = &segment->lines[p];
        *lines = (struct design_lines){.count = count, .bins = calloc(count, sizeof *lines->bins), .step_bins = 1};
        for (size_t k = 0; lines->bins && k < count; k++) {
            lines->bins[k] = bins[k] + (uint32_t)p * shift;
        }
        if (!lines->bins) {
            return false;
        }
    }
    return true;
}

static size_t count_segments(enum design_sequence_kind kind, const struct design_lines *lines)
{
    size_t count = 0;
    for (size_t begin = 0; begin < lines->count; begin += segment_length(kind, lines, begin)) {
        count++;
    }
    return count;
}

static int cut(struct design_sequence *self, const struct design_lines *lines, uint32_t shift, struct error *out_error)
{
    const size_t count = count_segments(self->kind, lines);
    if (count > design_segments_max) {
        return error_set(out_error, error_usage, "%s of %zu lines makes %zu tables, expected at most %d",
                         design_sequence_kind_str(self->kind), lines->count, count, (int)design_segments_max);
    }
    self->segments = calloc(count, sizeof *self->segments);
    if (!self->segments) {
        return refuse_memory(out_error);
    }
    for (size_t begin = 0; begin < lines->count;) {
        const size_t length = segment_length(self->kind, lines, begin);
        struct design_segment *segment = &self->segments[self->segment_count++];
        segment->periods = self->kind == design_sequence_octaves ? (uint32_t)length : 1;
        if (!fill_segment(segment, lines->bins + begin, length, self->inputs, shift)) {
            return refuse_memory(out_error);
        }
        begin += length;
    }
    return 0;
}

static int check_highest(const char *specification, const struct design_line_grid *grid, size_t inputs,
                         const struct design_lines *lines, uint32_t shift, struct error *out_error)
{
    const double line_hz = grid->rate_hz / (double)grid->period_samples;
    const uint64_t highest = lines->bins[lines->count - 1] + (uint64_t)(inputs - 1) * shift;
    if (highest <= (grid->period_samples - 1) / 2) {
        return 0;
    }
    return error_set(out_error, error_usage,
                     "lines '%s': the last line of input %zu would be at %.9g Hz, which is too high: half the rate is "
                     "%.9g Hz",
                     specification, inputs, (double)highest * line_hz, grid->rate_hz / 2);
}

int design_sequence_parse(const char *specification, const struct design_line_grid *grid, size_t inputs, uint64_t seed,
                          struct design_sequence *out_sequence, struct error *out_error)
{
    *out_sequence = (struct design_sequence){.kind = kind_of(specification),
                                             .rate_hz = grid->rate_hz,
                                             .period_samples = grid->period_samples,
                                             .inputs = inputs};
    struct design_lines lines = {0};
    uint32_t shift = 1;
    int status = 0;
    if (inputs < 1 || inputs > design_inputs_max) {
        status = error_set(out_error, error_usage, "--inputs: %zu, expected 1 to %d", inputs, (int)design_inputs_max);
    } else if (inputs > 1 && !interleaving_of(specification, inputs).has_step) {
        status = parse_on_coarse_grid(specification, grid, inputs, seed, &lines, out_error);
    } else {
        status = parse_first_input(specification, grid, inputs, seed, &lines, &shift, out_error);
    }
    status = status ? status : check_highest(specification, grid, inputs, &lines, shift, out_error);
    status = status ? status : cut(out_sequence, &lines, shift, out_error);
    design_lines_free(&lines);
    if (status) {
        design_sequence_free(out_sequence);
    }
    return status;
}

void design_sequence_free(struct design_sequence *self)
{
    for (size_t i = 0; i < self->segment_count; i++) {
        struct design_segment *segment = &self->segments[i];
        for (size_t p = 0; segment->lines && p < self->inputs; p++) {
            design_lines_free(&segment->lines[p]);
        }
        free(segment->lines);
    }
    free(self->segments);
    *self = (struct design_sequence){0};
}

uint64_t design_sequence_periods(const struct design_sequence *self, size_t segment, uint64_t periods)
{
    const uint64_t wanted = periods * self->segments[segment].periods;
    return (wanted + self->inputs - 1) / self->inputs;
}

double design_sequence_test_time_s(const struct design_sequence *self, uint64_t periods, double settle_s)
{
    uint64_t counted = 0;
    for (size_t i = 0; i < self->segment_count; i++) {
        counted += design_sequence_periods(self, i, periods);
    }
    // One division at the end: 258 periods of 5000 samples at 500 Hz are 2580 s to the last bit.
    return (double)counted * (double)self->period_samples / self->rate_hz + (double)self->segment_count * settle_s;
}
