/* SPDX-License-Identifier: MIT */
#include "core/fixed.h"
#include "frf/kernel.h"

#include <stddef.h>

/* Indices are 16 bit wide, and a step is below half the period, so index + step stays below 1.5 * 2^16. */
CORE_STATIC_ASSERT(SERVOSCOPE_FRF_PERIOD_MAX <= 65536, index_fits_16_bits);
/* k * n < 2^15 * 2^16 in frf_dft_skip() */
CORE_STATIC_ASSERT(SERVOSCOPE_FRF_PERIOD_MAX / 2 <= 0xFFFFFFFFu / SERVOSCOPE_FRF_PERIOD_MAX, product_fits_32_bits);

enum core_status frf_check_bins(const uint32_t *bins, uint32_t bin_count, uint32_t period)
{
    if (bin_count < 1 || bin_count > SERVOSCOPE_FRF_BINS_MAX) {
        return core_err_frf_bins;
    }
    uint32_t previous = 0;
    for (uint32_t b = 0; b < bin_count; ++b) {
        if (bins[b] <= previous || bins[b] > (period - 1u) / 2u) {
            return core_err_frf_bins;
        }
        previous = bins[b];
    }
    return core_ok;
}

/* The largest sample; the smallest is one further from 0. */
static int32_t largest_sample(enum frf_number number)
{
    return number == frf_number_q23 ? FRF_I24_MAX : INT16_MAX;
}

static bool has_rails(const struct frf_dft_config *config)
{
    return config->rail_low != 0 || config->rail_high != 0;
}

static enum core_status check_rails(const struct frf_dft_config *config, int32_t largest)
{
    bool in_order = config->rail_low < config->rail_high;
    bool fit = config->rail_low >= -largest - 1 && config->rail_high <= largest;
    return has_rails(config) && !(in_order && fit) ? core_err_frf_rails : core_ok;
}

static enum core_status check_config(const struct frf_dft_config *config, uint32_t period, enum frf_number number)
{
    if (!config || !config->bins || !config->storage) {
        return core_err_argument;
    }
    if (period < 4u || period > SERVOSCOPE_FRF_PERIOD_MAX) {
        return core_err_frf_period;
    }
    if (config->channels < 1 || config->channels > SERVOSCOPE_FRF_CHANNELS_MAX) {
        return core_err_frf_channels;
    }
    enum core_status status = frf_check_bins(config->bins, config->bin_count, period);
    if (status != core_ok) {
        return status;
    }
    if (config->storage_words < FRF_STORAGE_WORDS(config->bin_count, config->channels)) {
        return core_err_storage;
    }
    return check_rails(config, largest_sample(number));
}

enum core_status frf_dft_set_up(struct frf_dft *self, const struct frf_dft_config *config, uint32_t period_samples,
                                enum frf_number number, frf_kernel *kernel)
{
    if (!self) {
        return core_err_argument;
    }
    enum core_status status = check_config(config, period_samples, number);
    if (status != core_ok) {
        return status;
    }
    uint32_t bin_words = (config->bin_count + 1u) / 2u;
    uint32_t pairs = config->bin_count * config->channels;
    uint32_t bank_words = number == frf_number_f32 ? pairs : 2u * pairs;
    self->bins = config->storage;
    self->banks[0] = config->storage + bin_words;
    self->banks[1] = self->banks[0] + bank_words;
    self->partial = number == frf_number_f32 ? self->banks[1] + bank_words : NULL;
    self->kernel = kernel;
    self->number = number;
    self->period_samples = period_samples;
    self->bin_count = config->bin_count;
    self->channels = config->channels;
    self->rail_low = has_rails(config) ? config->rail_low : -largest_sample(number) - 1;
    self->rail_high = has_rails(config) ? config->rail_high : largest_sample(number);
    self->sequence = 0;
    self->latched_reasons[0] = self->latched_reasons[1] = 0;
    self->err.lost = self->err.saturated = self->err.late = self->err.not_finite = self->err.wrong_type = 0;
    for (uint32_t b = 0; b < config->bin_count; ++b) {
        self->bins[b / 2u].bins[b % 2u].step = (uint16_t)config->bins[b];
    }
    frf_dft_restart(self);
    return core_ok;
}

void frf_dft_restart(struct frf_dft *self)
{
    self->position = 0;
    self->reasons = 0;
    for (uint32_t b = 0; b < self->bin_count; ++b) {
        self->bins[b / 2u].bins[b % 2u].index = 0;
    }
}

/* The bank is complete before the sequence says so, and says so before anything goes into the other bank. */
static void latch(struct frf_dft *self)
{
    self->latched_reasons[self->sequence & 1u] = self->reasons;
    SERVOSCOPE_MEMORY_BARRIER();
    self->sequence = self->sequence + 1u;
    SERVOSCOPE_MEMORY_BARRIER();
    self->position = 0;
    self->reasons = 0;
}

void frf_dft_feed(struct frf_dft *self, const void *frames, uint32_t frame_bytes, uint32_t count)
{
    const unsigned char *next = (const unsigned char *)frames;
    while (count > 0) {
        uint32_t room = self->period_samples - self->position;
        uint32_t piece = count < room ? count : room;
        self->kernel(self, next, piece, self->position == 0);
        self->position += piece;
        if (self->position == self->period_samples) {
            latch(self);
        }
        next += (size_t)piece * frame_bytes;
        count -= piece;
    }
}

/* A fresh period that begins with a gap would leave its bank with the sums of the period before last. */
static void clear_bank(struct frf_dft *self)
{
    union frf_word *bank = frf_active_bank(self);
    uint32_t words = (uint32_t)(self->banks[1] - self->banks[0]);
    for (uint32_t w = 0; w < words; ++w) {
        bank[w].sum = 0; /* all bits zero is 0 in a pair of floats too */
        if (self->partial) {
            self->partial[w].sum = 0;
        }
    }
}

void frf_dft_skip(struct frf_dft *self, uint32_t count)
{
    while (count > 0) {
        uint32_t room = self->period_samples - self->position;
        uint32_t piece = count < room ? count : room;
        if (self->position == 0) {
            clear_bank(self);
        }
        frf_dft_mark(self, frf_reason_gap);
        self->err.lost = self->err.lost > UINT32_MAX - piece ? UINT32_MAX : self->err.lost + piece;
        self->position += piece;
        if (self->position == self->period_samples) {
            latch(self);
        }
        count -= piece;
    }
    for (uint32_t b = 0; b < self->bin_count; ++b) {
        uint32_t step = self->bins[b / 2u].bins[b % 2u].step;
        self->bins[b / 2u].bins[b % 2u].index = (uint16_t)(step * self->position % self->period_samples);
    }
}

void frf_dft_mark(struct frf_dft *self, uint32_t reasons)
{
    self->reasons |= reasons;
    if (reasons & frf_reason_late) {
        self->err.late = core_count_up(self->err.late);
    }
}

bool frf_dft_latest(const struct frf_dft *self, struct frf_period *out_period)
{
    uint32_t sequence = self->sequence;
    SERVOSCOPE_MEMORY_BARRIER();
    if (sequence == 0) {
        return false;
    }
    uint32_t bank = (sequence - 1u) & 1u;
    out_period->sums = self->banks[bank];
    out_period->reasons = self->latched_reasons[bank];
    out_period->sequence = sequence;
    return frf_dft_is_intact(self, out_period);
}

bool frf_dft_is_intact(const struct frf_dft *self, const struct frf_period *period)
{
    SERVOSCOPE_MEMORY_BARRIER();
    return self->sequence == period->sequence;
}

int64_t frf_period_real(const struct frf_dft *self, const struct frf_period *period, uint32_t bin, uint32_t channel)
{
    return period->sums[frf_sum_offset(self, bin, channel)].sum;
}

int64_t frf_period_imaginary(const struct frf_dft *self, const struct frf_period *period, uint32_t bin,
                             uint32_t channel)
{
    return period->sums[frf_sum_offset(self, bin, channel) + 1u].sum;
}
