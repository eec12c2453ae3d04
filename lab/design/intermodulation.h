/* SPDX-License-Identifier: MIT */
/// Where a nonlinearity of the drive puts what it makes of the lines: which harmonics and products of second and third
/// order fall on excited lines again, where they pass for the drive's response, and which bins stay free to show them.
/// Products are counted as frequencies: |f1 - f2|, |2 f1 - f2| and |f1 + f2 - f3| are folded at zero, what falls on
/// zero is not counted. Folding at half the sample rate is left out, as if all that lies above it were filtered away.
#ifndef SERVOSCOPE_DESIGN_INTERMODULATION_H
#define SERVOSCOPE_DESIGN_INTERMODULATION_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/// f1, f2, f3 are different lines here. f1 + f2 - f2 is not among them: it falls on every line f1, in phase with it,
/// and changes the gain, whatever the lines are.
enum design_product {
    design_product_second_harmonic, ///< 2 f
    design_product_sum,             ///< f1 + f2
    design_product_difference,      ///< |f1 - f2|
    design_product_third_harmonic,  ///< 3 f
    design_product_double_plus,     ///< 2 f1 + f2
    design_product_double_minus,    ///< |2 f1 - f2|
    design_product_triple_sum,      ///< f1 + f2 + f3
    design_product_triple_minus,    ///< |f1 + f2 - f3|
    design_product_count,
};

struct design_product_hits {
    size_t lines;      ///< excited lines that at least one product of this kind falls on
    uint64_t products; ///< how many do, over all lines; those that differ by the order of equal terms only count once
};

struct design_intermodulation {
    size_t line_count;
    struct design_product_hits hits[design_product_count];
    size_t second_order_lines; ///< hit by a second harmonic, sum or difference
    size_t third_order_lines;  ///< hit by any of the other kinds
    /// Greatest common divisor of the bins: no product falls between its multiples, and "odd" and "even" count in it.
    uint32_t spacing_bins;
    /// Every line is odd: what is even (free, every one) shows even-order distortion, what is odd odd-order distortion.
    /// Else a free bin shows both.
    bool odd_only;
    /// Multiples of the spacing from the lowest to the highest line that are not excited; ascending, owned.
    size_t free_odd_count, free_even_count;
    uint32_t *free_odd_bins, *free_even_bins;
};

/// Counts, by convolution of the lines' indicator with itself (exact: rounded sums of FFT, off by less than 1e-3 up to
/// all lines of N = 2^20).
/// Shapes: bins: line_count >= 1 bins, ascending, from 1 on
/// Errors: false if memory is short; *out_counts is empty then
/// Cost:   four FFT of three times the highest bin: 0.1 s and 10 MB for 10 000 lines of N = 2^17
/// Test:   tests/unit/test_design_intermodulation.c
bool design_intermodulation_count(size_t line_count, const uint32_t *bins, struct design_intermodulation *out_counts);
void design_intermodulation_free(struct design_intermodulation *counts);

/// How many products fall on each multiple of the spacing from the lowest to the highest line, excited or not.
struct design_product_map {
    size_t count;
    uint32_t *bins; ///< owned, as the others
    bool *excited;
    double *second_order, *third_order;
};

/// Counts as design_intermodulation_count() does. Shapes, errors and cost are the same.
bool design_intermodulation_map(size_t line_count, const uint32_t *bins, struct design_product_map *out_map);
void design_product_map_free(struct design_product_map *self);

/// Two or three sentences for a person, in numbers, no newline. Returns what snprintf would.
int design_intermodulation_describe(const struct design_intermodulation *self, char *out_text, size_t size);

#endif
