/* SPDX-License-Identifier: MIT */
#include "frf/statistics.h"

#include "core/fixed.h"
#include "frf/kernel.h"

#include <math.h>
#include <stddef.h>

static const struct frf_complex complex_zero = {0, 0};

static bool is_finite(struct frf_complex value)
{
    return value.real >= -CORE_REAL_MAX && value.real <= CORE_REAL_MAX && value.imaginary >= -CORE_REAL_MAX &&
           value.imaginary <= CORE_REAL_MAX;
}

static core_real norm(struct frf_complex value)
{
    return value.real * value.real + value.imaginary * value.imaginary;
}

/* a conj(b) */
static struct frf_complex times_conjugate(struct frf_complex a, struct frf_complex b)
{
    struct frf_complex product = {a.real * b.real + a.imaginary * b.imaginary,
                                  a.imaginary * b.real - a.real * b.imaginary};
    return product;
}

static struct frf_complex minus(struct frf_complex a, struct frf_complex b)
{
    struct frf_complex difference = {a.real - b.real, a.imaginary - b.imaginary};
    return difference;
}

enum core_status frf_statistics_init(struct frf_statistics *self, struct frf_pair *storage, uint32_t bin_count)
{
    if (!self || !storage || bin_count == 0) {
        return core_err_argument;
    }
    self->pairs = storage;
    self->bin_count = bin_count;
    self->periods = 0;
    self->last_sequence = 0;
    self->real_bits = SERVOSCOPE_REAL_BITS;
    for (unsigned r = 0; r < frf_reason_count; ++r) {
        self->excluded.by_reason[r] = 0;
    }
    self->excluded.invalid = self->excluded.overrun = self->excluded.missed = self->excluded.not_finite = 0;
    for (uint32_t b = 0; b < bin_count; ++b) {
        struct frf_pair *pair = &storage[b];
        pair->input_mean = pair->output_mean = pair->cross = pair->input = pair->output = complex_zero;
        pair->input_squares = pair->output_squares = 0;
    }
    return core_ok;
}

/* Welford for two complex variables: with M periods before this one, the sums grow by M/(M+1) times the products of the
 * deviations from the old means. */
static void update_pair(struct frf_pair *pair, uint32_t periods_before)
{
    core_real share = (core_real)1 / (core_real)(periods_before + 1u);
    core_real weight = (core_real)periods_before * share;
    struct frf_complex du = minus(pair->input, pair->input_mean);
    struct frf_complex dy = minus(pair->output, pair->output_mean);
    struct frf_complex cross = times_conjugate(dy, du);
    pair->input_mean.real += du.real * share;
    pair->input_mean.imaginary += du.imaginary * share;
    pair->output_mean.real += dy.real * share;
    pair->output_mean.imaginary += dy.imaginary * share;
    pair->input_squares += weight * norm(du);
    pair->output_squares += weight * norm(dy);
    pair->cross.real += weight * cross.real;
    pair->cross.imaginary += weight * cross.imaginary;
}

static bool commit(struct frf_statistics *self)
{
    for (uint32_t b = 0; b < self->bin_count; ++b) {
        if (!is_finite(self->pairs[b].input) || !is_finite(self->pairs[b].output)) {
            self->excluded.not_finite = core_count_up(self->excluded.not_finite);
            return false;
        }
    }
    for (uint32_t b = 0; b < self->bin_count; ++b) {
        update_pair(&self->pairs[b], self->periods);
    }
    self->periods++;
    return true;
}

bool frf_statistics_add(struct frf_statistics *self, const struct frf_complex *input, const struct frf_complex *output)
{
    for (uint32_t b = 0; b < self->bin_count; ++b) {
        self->pairs[b].input = input[b];
        self->pairs[b].output = output[b];
    }
    return commit(self);
}

struct frf_complex frf_period_value(const struct frf_dft *dft, const struct frf_period *period, uint32_t bin,
                                    uint32_t channel)
{
    struct frf_complex value;
    if (dft->number == frf_number_f32) {
        const union frf_word *word = &period->sums[bin * dft->channels + channel];
        value.real = (core_real)word->pair[0];
        value.imaginary = (core_real)word->pair[1];
        return value;
    }
    core_real one = dft->number == frf_number_q15   ? (core_real)FRF_Q15_ONE
                    : dft->number == frf_number_q23 ? (core_real)FRF_Q23_ONE
                                                    : (core_real)FRF_Q31_ONE;
    value.real = (core_real)frf_period_real(dft, period, bin, channel) / one;
    value.imaginary = (core_real)frf_period_imaginary(dft, period, bin, channel) / one;
    return value;
}

static void count_reasons(struct frf_statistics *self, uint32_t reasons)
{
    self->excluded.invalid = core_count_up(self->excluded.invalid);
    for (unsigned r = 0; r < frf_reason_count; ++r) {
        if (reasons & (1u << r)) {
            self->excluded.by_reason[r] = core_count_up(self->excluded.by_reason[r]);
        }
    }
}

bool frf_statistics_add_period(struct frf_statistics *self, const struct frf_dft *dft, uint32_t input_channel,
                               uint32_t output_channel)
{
    struct frf_period period;
    if (dft->bin_count != self->bin_count || input_channel >= dft->channels || output_channel >= dft->channels ||
        !frf_dft_latest(dft, &period) || period.sequence == self->last_sequence) {
        return false;
    }
    self->excluded.missed += period.sequence - self->last_sequence - 1u;
    self->last_sequence = period.sequence;
    if (period.reasons != 0) {
        count_reasons(self, period.reasons);
        return false;
    }
    for (uint32_t b = 0; b < self->bin_count; ++b) {
        self->pairs[b].input = frf_period_value(dft, &period, b, input_channel);
        self->pairs[b].output = frf_period_value(dft, &period, b, output_channel);
    }
    if (!frf_dft_is_intact(dft, &period)) {
        self->excluded.overrun = core_count_up(self->excluded.overrun);
        return false;
    }
    return commit(self);
}

/* Residual variance of Y - G U: not negative but for rounding, which is cut off. */
static core_real response_variance(const struct frf_estimate *estimate, core_real input_norm, uint32_t periods)
{
    core_real norm_g = estimate->real * estimate->real + estimate->imaginary * estimate->imaginary;
    core_real cross = estimate->real * estimate->covariance.real + estimate->imaginary * estimate->covariance.imaginary;
    core_real residual = estimate->output_variance + norm_g * estimate->input_variance - 2 * cross;
    return residual < 0 ? 0 : residual / ((core_real)periods * input_norm);
}

void frf_statistics_estimate(const struct frf_statistics *self, uint32_t bin, core_real input_floor,
                             struct frf_estimate *out_estimate)
{
    static const struct frf_estimate nothing = {0, 0, 0, 0, 0, {0, 0}, frf_valid};
    const struct frf_pair *pair = &self->pairs[bin];
    core_real input_norm = norm(pair->input_mean);
    *out_estimate = nothing;
    if (self->periods < 2u) {
        out_estimate->validity = frf_invalid_periods;
    }
    if (!(input_norm > 0 && input_floor >= 0 && (core_real)sqrt((double)input_norm) > input_floor)) {
        out_estimate->validity = frf_invalid_input;
        return;
    }
    struct frf_complex quotient = times_conjugate(pair->output_mean, pair->input_mean);
    out_estimate->real = quotient.real / input_norm;
    out_estimate->imaginary = quotient.imaginary / input_norm;
    if (self->periods >= 2u) {
        core_real scale = (core_real)1 / (core_real)(self->periods - 1u);
        out_estimate->input_variance = pair->input_squares * scale;
        out_estimate->output_variance = pair->output_squares * scale;
        out_estimate->covariance.real = pair->cross.real * scale;
        out_estimate->covariance.imaginary = pair->cross.imaginary * scale;
        out_estimate->std = (core_real)sqrt((double)response_variance(out_estimate, input_norm, self->periods));
    }
    struct frf_complex response = {out_estimate->real, out_estimate->imaginary};
    struct frf_complex spread = {out_estimate->std, out_estimate->input_variance + out_estimate->output_variance};
    if (!is_finite(response) || !is_finite(spread)) { /* |s_yu| <= (s_uu + s_yy) / 2 */
        *out_estimate = nothing;
        out_estimate->validity = frf_invalid_not_finite;
    }
}
