/* SPDX-License-Identifier: MIT */
#include "firmware/results.h"

#include "firmware/checksum.h"

/* Sums are kept times 2^-40, which keeps single precision far from its limits. */
#define SUM_SCALE ((core_real)(1.0 / 1099511627776.0))

enum core_status results_init(struct results *self, const struct frf_block_table *table, core_real input_per_count,
                              core_real output_per_count)
{
    /* frf_block_sums() gives 2^(30 + gain_shift) times the sum; a line's amplitude is 2/N of that. */
    core_real amplitude = (core_real)2048 / (core_real)((uint32_t)1 << table->gain_shift);
    amplitude /= (core_real)table->period_samples;
    self->input_unit = amplitude * input_per_count;
    self->output_unit = amplitude * output_per_count;
    self->sequence = self->overwritten = self->invalid = 0;
    self->checksum[0] = 1u;
    self->checksum[1] = 0;
    return table->bin_count > results_bins_max ? core_err_storage
                                               : frf_statistics_init(&self->statistics, self->pairs, table->bin_count);
}

static struct frf_complex take_sum(const struct frf_block *dft, const struct frf_block_period *period, uint32_t bin,
                                   uint32_t channel, uint32_t *io_checksum)
{
    int64_t real, imaginary;
    frf_block_sums(dft, period, bin, channel, &real, &imaginary);
    checksum_add(io_checksum, real);
    checksum_add(io_checksum, imaginary);
    struct frf_complex value = {(core_real)real * SUM_SCALE, (core_real)imaginary * SUM_SCALE};
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
    core_real unit = self->output_unit / self->input_unit;
    out_estimate->real *= unit;
    out_estimate->imaginary *= unit;
    out_estimate->std *= unit;
}
