/* SPDX-License-Identifier: MIT */
#include "firmware/results.h"

#include "firmware/checksum.h"

enum core_status results_init(struct results *self, uint32_t bin_count, core_real output_units_per_input)
{
    self->output_units_per_input = output_units_per_input;
    self->sequence = self->overwritten = self->invalid = 0;
    self->checksum[0] = 1u;
    self->checksum[1] = 0;
    return bin_count > results_bins_max ? core_err_storage
                                        : frf_statistics_init(&self->statistics, self->pairs, bin_count);
}

static struct frf_complex take_sum(const struct frf_block *dft, const struct frf_block_period *period, uint32_t bin,
                                   uint32_t channel, uint32_t *io_checksum)
{
    int64_t real, imaginary;
    frf_block_sums(dft, period, bin, channel, &real, &imaginary);
    checksum_add(io_checksum, real);
    checksum_add(io_checksum, imaginary);
    /* The table's gain is the same for both channels; the 2^-40 keeps single precision far from its limits. */
    const core_real scale = (core_real)(1.0 / 1099511627776.0);
    struct frf_complex value = {(core_real)real * scale, (core_real)imaginary * scale};
    return value;
}

bool results_take(struct results *self, const struct frf_block *dft, uint32_t input, uint32_t output)
{
    struct frf_block_period period;
    uint32_t checksum[2] = {self->checksum[0], self->checksum[1]};
    if (!frf_block_latest(dft, &period) || period.sequence == self->sequence) {
        return false;
    }
    self->sequence = period.sequence;
    if (period.reasons != 0) {
        ++self->invalid;
        return false;
    }
    for (uint32_t bin = 0; bin < self->statistics.bin_count; ++bin) {
        self->input[bin] = take_sum(dft, &period, bin, input, checksum);
        self->output[bin] = take_sum(dft, &period, bin, output, checksum);
    }
    if (!frf_block_is_intact(dft, &period)) {
        ++self->overwritten;
        return false;
    }
    self->checksum[0] = checksum[0];
    self->checksum[1] = checksum[1];
    return frf_statistics_add(&self->statistics, self->input, self->output);
}

void results_estimate(const struct results *self, uint32_t bin, struct frf_estimate *out_estimate)
{
    frf_statistics_estimate(&self->statistics, bin, (core_real)0, out_estimate);
    out_estimate->real *= self->output_units_per_input;
    out_estimate->imaginary *= self->output_units_per_input;
    out_estimate->std *= self->output_units_per_input;
}
