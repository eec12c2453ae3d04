/* SPDX-License-Identifier: MIT */
#include "lab/design/intermodulation.h"

#include "lab/design/waveform.h"
#include "lab/numeric/fft.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/// e: the lines' indicator, e(b) = 1 on a line; h(2 b) = e(b). Ordered sums over lines, equal ones included, of length
/// `length`, negative frequencies from its end.
struct sums {
    size_t length;
    struct fft_plan *plan;
    double *indicator; ///< E, spectrum of e; that of h is E(2 k)
    double *work;
    double *pair_sum_difference;   ///< f1 + f2 in the real parts, f1 - f2 in the imaginary ones
    double *double_plus_minus;     ///< 2 f1 + f2, 2 f1 - f2
    double *triple_sum_difference; ///< f1 + f2 + f3, f1 + f2 - f3
};

static void sums_free(struct sums *self)
{
    if (self->plan) {
        fft_plan_destroy(self->plan);
    }
    free(self->indicator);
    free(self->work);
    free(self->pair_sum_difference);
    free(self->double_plus_minus);
    free(self->triple_sum_difference);
}

struct complex_number {
    double re, im;
};

static struct complex_number times(struct complex_number a, struct complex_number b)
{
    return (struct complex_number){a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re};
}

static struct complex_number at(const struct sums *self, size_t k)
{
    return (struct complex_number){self->indicator[2 * k], self->indicator[2 * k + 1]};
}

/// The sum over `first` lines (their spectrum at k) with one further line, added and subtracted, as one transform of
/// two real sequences.
static void add_and_subtract(const struct sums *self, size_t k, struct complex_number first)
{
    const struct complex_number last = at(self, k);
    const struct complex_number plus = times(first, last);
    const struct complex_number minus = times(first, (struct complex_number){last.re, -last.im});
    self->work[2 * k] = plus.re - minus.im;
    self->work[2 * k + 1] = plus.im + minus.re;
}

static void transform_sums(struct sums *self)
{
    for (size_t k = 0; k < self->length; k++) {
        add_and_subtract(self, k, at(self, k));
    }
    fft_inverse(self->plan, self->work, self->pair_sum_difference);
    for (size_t k = 0; k < self->length; k++) {
        add_and_subtract(self, k, at(self, 2 * k % self->length));
    }
    fft_inverse(self->plan, self->work, self->double_plus_minus);
    for (size_t k = 0; k < self->length; k++) {
        add_and_subtract(self, k, times(at(self, k), at(self, k)));
    }
    fft_inverse(self->plan, self->work, self->triple_sum_difference);
}

static bool sums_create(size_t line_count, const uint32_t *bins, struct sums *out_sums)
{
    // Sums reach from -highest to 3 highest; only -highest .. highest has to stay free of what is folded.
    struct sums self = {.length = design_waveform_smooth_length(3 * (size_t)bins[line_count - 1] + 1)};
    const size_t size = 2 * self.length * sizeof(double);
    self.plan = fft_plan_create(self.length);
    self.indicator = malloc(size);
    self.work = malloc(size);
    self.pair_sum_difference = malloc(size);
    self.double_plus_minus = malloc(size);
    self.triple_sum_difference = malloc(size);
    if (!self.plan || !self.indicator || !self.work || !self.pair_sum_difference || !self.double_plus_minus ||
        !self.triple_sum_difference) {
        sums_free(&self);
        return false;
    }
    memset(self.work, 0, size);
    for (size_t k = 0; k < line_count; k++) {
        self.work[2 * (size_t)bins[k]] = 1;
    }
    fft_forward(self.plan, self.work, self.indicator);
    transform_sums(&self);
    *out_sums = self;
    return true;
}

/// How many ordered choices of lines add up to `bin`.
static int64_t plus(const struct sums *self, const double *packed, size_t bin)
{
    return llround(packed[2 * bin] / (double)self->length);
}

/// The same with the last line subtracted, for `bin` and for -bin.
static int64_t minus(const struct sums *self, const double *packed, size_t bin)
{
    return llround(packed[2 * bin + 1] / (double)self->length);
}

static int64_t minus_folded(const struct sums *self, const double *packed, size_t bin)
{
    return minus(self, packed, self->length - bin);
}

static bool is_line(const bool *excited, uint32_t bin, uint32_t divisor)
{
    return bin % divisor == 0 && excited[bin / divisor];
}

/// Products that fall on one bin: ordered sums less those with equal lines, over the orders that count as one.
static void count_on_bin(const struct sums *sums, const bool *excited, size_t line_count, uint32_t bin,
                         int64_t out_products[design_product_count])
{
    const int64_t half = is_line(excited, bin, 2);
    const int64_t third = is_line(excited, bin, 3);
    const int64_t double_plus = plus(sums, sums->double_plus_minus, bin) - third;
    const int64_t line = excited[bin];
    const int64_t double_minus = minus(sums, sums->double_plus_minus, bin) - line; // 2 f - f
    const int64_t double_folded = minus_folded(sums, sums->double_plus_minus, bin);
    // f + f3 - f3 and f3 + f - f3 for each line f3, the case f3 = f in both.
    const int64_t trivial = line * (2 * (int64_t)line_count - 1);
    const int64_t triple_minus = minus(sums, sums->triple_sum_difference, bin) - trivial - double_minus;
    const int64_t triple_folded = minus_folded(sums, sums->triple_sum_difference, bin) - double_folded;
    out_products[design_product_second_harmonic] = half;
    out_products[design_product_sum] = (plus(sums, sums->pair_sum_difference, bin) - half) / 2;
    out_products[design_product_difference] = minus(sums, sums->pair_sum_difference, bin);
    out_products[design_product_third_harmonic] = third;
    out_products[design_product_double_plus] = double_plus;
    out_products[design_product_double_minus] = double_minus + double_folded;
    out_products[design_product_triple_sum] =
        (plus(sums, sums->triple_sum_difference, bin) - 3 * double_plus - third) / 6;
    out_products[design_product_triple_minus] = (triple_minus + triple_folded) / 2;
}

static void add_line(const int64_t products[design_product_count], struct design_intermodulation *self)
{
    bool second = false;
    bool third = false;
    for (int kind = 0; kind < design_product_count; kind++) {
        bool hit = products[kind] > 0;
        self->hits[kind].products += (uint64_t)products[kind];
        self->hits[kind].lines += hit;
        second = second || (hit && kind <= (int)design_product_difference);
        third = third || (hit && kind > (int)design_product_difference);
    }
    self->second_order_lines += second;
    self->third_order_lines += third;
}

static uint32_t common_divisor(size_t count, const uint32_t *bins)
{
    uint32_t divisor = 0;
    for (size_t k = 0; k < count; k++) {
        uint32_t other = bins[k];
        while (other > 0) {
            uint32_t rest = divisor % other;
            divisor = other;
            other = rest;
        }
    }
    return divisor;
}

static bool find_free_bins(const bool *excited, const uint32_t *bins, struct design_intermodulation *self)
{
    const uint32_t highest = bins[self->line_count - 1];
    self->spacing_bins = common_divisor(self->line_count, bins);
    const size_t most = (highest - bins[0]) / self->spacing_bins / 2 + 1;
    self->free_odd_bins = malloc(most * sizeof(uint32_t));
    self->free_even_bins = malloc(most * sizeof(uint32_t));
    if (!self->free_odd_bins || !self->free_even_bins) {
        return false;
    }
    self->odd_only = true;
    for (uint32_t bin = bins[0]; bin <= highest; bin += self->spacing_bins) {
        bool odd = bin / self->spacing_bins % 2 == 1;
        if (excited[bin]) {
            self->odd_only = self->odd_only && odd;
        } else if (odd) {
            self->free_odd_bins[self->free_odd_count++] = bin;
        } else {
            self->free_even_bins[self->free_even_count++] = bin;
        }
    }
    return true;
}

bool design_intermodulation_count(size_t line_count, const uint32_t *bins, struct design_intermodulation *out_counts)
{
    *out_counts = (struct design_intermodulation){0};
    struct sums sums;
    bool *excited = calloc((size_t)bins[line_count - 1] + 1, sizeof *excited);
    if (!excited || !sums_create(line_count, bins, &sums)) {
        free(excited);
        return false;
    }
    out_counts->line_count = line_count;
    for (size_t k = 0; k < line_count; k++) {
        excited[bins[k]] = true;
    }
    for (size_t k = 0; k < line_count; k++) {
        int64_t products[design_product_count];
        count_on_bin(&sums, excited, line_count, bins[k], products);
        add_line(products, out_counts);
    }
    sums_free(&sums);
    bool complete = find_free_bins(excited, bins, out_counts);
    free(excited);
    if (!complete) {
        design_intermodulation_free(out_counts);
    }
    return complete;
}

static void map_bin(const struct sums *sums, const bool *excited, size_t line_count, uint32_t bin,
                    struct design_product_map *io)
{
    int64_t products[design_product_count];
    int64_t orders[2] = {0, 0};
    count_on_bin(sums, excited, line_count, bin, products);
    for (int kind = 0; kind < design_product_count; kind++) {
        orders[kind > (int)design_product_difference] += products[kind];
    }
    io->bins[io->count] = bin;
    io->excited[io->count] = excited[bin];
    io->second_order[io->count] = (double)orders[0];
    io->third_order[io->count] = (double)orders[1];
    io->count++;
}

bool design_intermodulation_map(size_t line_count, const uint32_t *bins, struct design_product_map *out_map)
{
    const uint32_t highest = bins[line_count - 1];
    const uint32_t spacing = common_divisor(line_count, bins);
    const size_t most = (highest - bins[0]) / spacing + 1;
    struct sums sums;
    bool *excited = calloc((size_t)highest + 1, sizeof *excited);
    *out_map = (struct design_product_map){
        .bins = malloc(most * sizeof(uint32_t)),
        .excited = malloc(most * sizeof(bool)),
        .second_order = malloc(most * sizeof(double)),
        .third_order = malloc(most * sizeof(double)),
    };
    if (!excited || !out_map->bins || !out_map->excited || !out_map->second_order || !out_map->third_order ||
        !sums_create(line_count, bins, &sums)) {
        free(excited);
        design_product_map_free(out_map);
        return false;
    }
    for (size_t k = 0; k < line_count; k++) {
        excited[bins[k]] = true;
    }
    for (size_t i = 0; i < most; i++) {
        map_bin(&sums, excited, line_count, bins[0] + (uint32_t)i * spacing, out_map);
    }
    sums_free(&sums);
    free(excited);
    return true;
}

void design_product_map_free(struct design_product_map *self)
{
    free(self->bins);
    free(self->excited);
    free(self->second_order);
    free(self->third_order);
    *self = (struct design_product_map){0};
}

void design_intermodulation_free(struct design_intermodulation *counts)
{
    free(counts->free_odd_bins);
    free(counts->free_even_bins);
    *counts = (struct design_intermodulation){0};
}

/// "products of second order fall on 3 of 4 lines (1 harmonic, 2 other products)", or that none does.
static void describe_order(const struct design_intermodulation *self, bool second, char *out_text, size_t size)
{
    const char *name = second ? "second" : "third";
    const int harmonic = second ? design_product_second_harmonic : design_product_third_harmonic;
    const int end = second ? design_product_third_harmonic : design_product_count;
    const size_t hit = second ? self->second_order_lines : self->third_order_lines;
    const uint64_t harmonics = self->hits[harmonic].products;
    uint64_t others = 0;
    for (int kind = harmonic + 1; kind < end; kind++) {
        others += self->hits[kind].products;
    }
    if (hit == 0) {
        snprintf(out_text, size, "no %s harmonic and no other product of %s order falls on a line", name, name);
    } else {
        snprintf(
            out_text, size,
            "products of %s order fall on %zu of %zu lines (%" PRIu64 " %s harmonic%s, %" PRIu64 " other product%s)",
            name, hit, self->line_count, harmonics, name, harmonics == 1 ? "" : "s", others, others == 1 ? "" : "s");
    }
}

static void describe_free_bins(const struct design_intermodulation *self, char *out_text, size_t size)
{
    const size_t all = self->free_odd_count + self->free_even_count;
    if (all == 0) {
        snprintf(out_text, size, "No bin of the band is left free to show distortion.");
    } else if (self->odd_only && self->free_odd_count > 0) {
        snprintf(out_text, size, "%zu even and %zu odd bins of the band are free and show even and odd distortion.",
                 self->free_even_count, self->free_odd_count);
    } else if (self->odd_only) {
        snprintf(out_text, size,
                 "%zu even bins of the band are free and show even distortion, none shows odd distortion.",
                 self->free_even_count);
    } else {
        snprintf(out_text, size, "%zu bins of the band are free and show even and odd distortion together.", all);
    }
}

int design_intermodulation_describe(const struct design_intermodulation *self, char *out_text, size_t size)
{
    char second[160];
    char third[160];
    char free_bins[160];
    describe_order(self, true, second, sizeof second);
    describe_order(self, false, third, sizeof third);
    describe_free_bins(self, free_bins, sizeof free_bins);
    const char *join = (self->second_order_lines == 0) == (self->third_order_lines == 0) ? "and" : "but";
    return snprintf(out_text, size, "%c%s, %s %s. %s", second[0] == 'n' ? 'N' : 'P', second + 1, join, third,
                    free_bins);
}
