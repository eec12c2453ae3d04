/* SPDX-License-Identifier: MIT */
#include "frf/block.h"

#include "core/fixed.h"
#include "frf/block_kernel.h"

#include <stddef.h>

/* Two factors of 1/2 in every product of upper words are made up for before it: one without a basis, two and the
 * basis's own quarter with one. */
enum { folded_shift = 1, projected_shift = 4 };

static uint32_t row_pairs(const struct frf_block *self)
{
    return FRF_BLOCK_ROWS(self->table.bin_count) / 2u;
}

enum core_status frf_block_init(struct frf_block *self, const struct frf_block_config *config)
{
    if (!self || !config || !config->table || !config->storage || !config->frames || config->banks < 1 ||
        config->banks > 2) {
        return core_err_argument;
    }
    if (config->channels < 1 || config->channels > SERVOSCOPE_FRF_CHANNELS_MAX) {
        return core_err_frf_channels;
    }
    const struct frf_block_table *table = config->table;
    uint32_t block = table->layout.block_samples, terms = table->layout.terms, channels = config->channels;
    if (config->storage_words < FRF_BLOCK_STORAGE_WORDS(table->bin_count, channels, config->banks, block, terms) ||
        config->frame_samples < FRF_BLOCK_FRAME_SAMPLES(channels, block)) {
        return core_err_storage;
    }
    bool has_rails = config->rail_low != 0 || config->rail_high != 0;
    if (has_rails && config->rail_low >= config->rail_high) {
        return core_err_frf_rails;
    }
    uint32_t bank_words = 2u * FRF_BLOCK_ROWS(table->bin_count) * channels;
    self->table = *table;
    self->banks[0] = config->storage;
    self->banks[1] = config->storage + (config->banks - 1u) * bank_words;
    self->work = self->banks[1] + bank_words;
    self->frames = config->frames;
    self->folded = table->basis ? self->work + terms * channels : NULL;
    self->bank_count = config->banks;
    self->channels = channels;
    self->spread = config->spread;
    self->rail_low = has_rails ? config->rail_low : INT16_MIN;
    self->rail_high = has_rails ? config->rail_high : INT16_MAX;
    self->sequence = self->begun = 0;
    self->latched_reasons[0] = self->latched_reasons[1] = 0;
    self->err.lost = self->err.saturated = self->err.late = 0;
    self->work_last = self->work_fresh = false;
    self->done = row_pairs(self) * channels;
    frf_block_restart(self);
    return core_ok;
}

/* The bank is complete before the sequence says so, and says so before anything goes into the next one. */
static void latch(struct frf_block *self, uint32_t reasons)
{
    self->latched_reasons[self->sequence & 1u] = reasons;
    SERVOSCOPE_MEMORY_BARRIER();
    self->sequence = self->sequence + 1u;
    SERVOSCOPE_MEMORY_BARRIER();
}

/* Works on the block in `work` until `target` pairs of rows, counted over all channels, have it. */
static void work_until(struct frf_block *self, uint32_t target)
{
    const struct frf_block_table *table = &self->table;
    uint32_t pairs = row_pairs(self), terms = table->layout.terms;
    if (self->work_fresh && self->done < target) {
        self->begun = self->sequence + 1u;
        SERVOSCOPE_MEMORY_BARRIER();
    }
    while (self->done < target) {
        uint32_t channel = self->done / pairs, pair = self->done % pairs;
        uint32_t count = target - self->done < pairs - pair ? target - self->done : pairs - pair;
        int32_t *accumulators = self->banks[self->sequence & 1u] + 4u * self->done;
        for (uint32_t i = 0; self->work_fresh && i < 4u * count; ++i) {
            accumulators[i] = 0;
        }
        FRF_BLOCK_ACCUMULATE(accumulators, table->rows + pair * (4u + 2u * terms), self->work + channel * terms, count,
                             terms / 4u);
        self->done += count;
        if (self->done == pairs * self->channels) {
            self->work_fresh = false;
            if (self->work_last) {
                self->work_last = false;
                latch(self, self->work_reasons);
            }
        }
    }
}

static void finish_work(struct frf_block *self)
{
    work_until(self, row_pairs(self) * self->channels);
}

/* Sums and differences about the block's centre, outwards. |sum| <= 2^16, shift <= 14: 30 bits and the sign. */
static void fold(const int16_t *frames, uint32_t channels, uint32_t block, uint32_t shift, int32_t *out_folded)
{
    const int16_t *left = frames + (block / 2u - 1u) * channels, *right = left + channels;
    int32_t scale = (int32_t)1 << shift;
    for (uint32_t i = 0; i < block; i += 2u) {
        out_folded[i] = (*right + *left) * scale;
        out_folded[i + 1u] = (*right - *left) * scale;
        right += channels;
        left -= i + 2u < block ? channels : 0u;
    }
}

static void prepare_work(struct frf_block *self)
{
    const struct frf_block_table *table = &self->table;
    uint32_t block = table->layout.block_samples, terms = table->layout.terms;
    for (uint32_t c = 0; c < self->channels; ++c) {
        int32_t *work = self->work + c * terms;
        if (!table->basis) {
            fold(self->frames + c, self->channels, block, table->gain_shift + folded_shift, work);
            continue;
        }
        fold(self->frames + c, self->channels, block, table->gain_shift + projected_shift, self->folded);
        /* The basis's rotations are 0: whatever was there is gone. */
        FRF_BLOCK_ACCUMULATE(work, table->basis, self->folded, terms / 4u, block / 4u);
    }
}

/* Whether the frame before `position` ended a block. */
static bool ends_block(const struct frf_block *self)
{
    return self->position % self->table.layout.block_samples == 0 || self->position == self->table.period_samples;
}

static void begin_period(struct frf_block *self)
{
    self->position = 0;
    self->reasons = 0;
    self->fresh = true;
}

static void complete_block(struct frf_block *self)
{
    uint32_t block = self->table.layout.block_samples, filled = (self->position - 1u) % block + 1u;
    finish_work(self);
    for (uint32_t i = filled * self->channels; i < block * self->channels; ++i) {
        self->frames[i] = 0;
    }
    prepare_work(self);
    self->done = 0;
    self->work_fresh = self->fresh;
    self->fresh = false;
    if (self->position == self->table.period_samples) {
        self->work_last = true;
        self->work_reasons = self->reasons;
        begin_period(self);
    }
    if (!self->spread) {
        finish_work(self);
    }
}

/* How many frames still belong to the block being filled. */
static uint32_t room(const struct frf_block *self)
{
    uint32_t in_block = self->table.layout.block_samples - self->position % self->table.layout.block_samples;
    uint32_t in_period = self->table.period_samples - self->position;
    return in_block < in_period ? in_block : in_period;
}

static void keep(struct frf_block *self, const int16_t *frames, uint32_t count)
{
    uint32_t channels = self->channels;
    int16_t *kept = self->frames + self->position % self->table.layout.block_samples * channels;
    for (uint32_t i = 0; i < count * channels; ++i) {
        kept[i] = frames[i];
        if (frames[i] <= self->rail_low || frames[i] >= self->rail_high) {
            self->err.saturated = core_count_up(self->err.saturated);
            self->reasons |= frf_reason_saturated;
        }
    }
    self->position += count;
}

void frf_block_add_i16(struct frf_block *self, const int16_t *frames, uint32_t count)
{
    uint32_t block = self->table.layout.block_samples, all = row_pairs(self) * self->channels;
    while (count > 0) {
        uint32_t left = room(self), piece = count < left ? count : left;
        keep(self, frames, piece);
        if (ends_block(self)) {
            complete_block(self);
        } else if (self->spread) {
            work_until(self, all * (self->position % block) / block);
        }
        frames += piece * self->channels;
        count -= piece;
    }
}

void frf_block_skip(struct frf_block *self, uint32_t count)
{
    uint32_t block = self->table.layout.block_samples;
    if (count > 0) {
        finish_work(self);
        self->err.lost = self->err.lost > UINT32_MAX - count ? UINT32_MAX : self->err.lost + count;
    }
    while (count > 0) {
        uint32_t left = self->table.period_samples - self->position, piece = count < left ? count : left;
        self->reasons |= frf_reason_gap;
        self->position += piece;
        if (self->position == self->table.period_samples) {
            /* Its bank may never have been written to, but whatever it held is no longer this period's. */
            self->begun = self->sequence + 1u;
            latch(self, self->reasons);
            begin_period(self);
        }
        count -= piece;
    }
    for (uint32_t i = 0; i < self->position % block * self->channels; ++i) {
        self->frames[i] = 0;
    }
}

void frf_block_mark(struct frf_block *self, uint32_t reasons)
{
    self->reasons |= reasons;
    if (reasons & frf_reason_late) {
        self->err.late = core_count_up(self->err.late);
    }
}

void frf_block_restart(struct frf_block *self)
{
    finish_work(self);
    begin_period(self);
}

bool frf_block_latest(const struct frf_block *self, struct frf_block_period *out_period)
{
    uint32_t sequence = self->sequence;
    SERVOSCOPE_MEMORY_BARRIER();
    if (sequence == 0) {
        return false;
    }
    out_period->accumulators = self->banks[(sequence - 1u) & 1u];
    out_period->reasons = self->latched_reasons[(sequence - 1u) & 1u];
    out_period->sequence = sequence;
    return frf_block_is_intact(self, out_period);
}

bool frf_block_is_intact(const struct frf_block *self, const struct frf_block_period *period)
{
    SERVOSCOPE_MEMORY_BARRIER();
    return self->begun - period->sequence < self->bank_count;
}

void frf_block_sums(const struct frf_block *self, const struct frf_block_period *period, uint32_t bin, uint32_t channel,
                    int64_t *out_real, int64_t *out_imaginary)
{
    const int32_t *sum = period->accumulators + 2u * (channel * FRF_BLOCK_ROWS(self->table.bin_count) + bin);
    int64_t cosine = self->table.restore[2u * bin], sine = self->table.restore[2u * bin + 1u];
    *out_real = sum[0] * cosine + sum[1] * sine;
    *out_imaginary = sum[1] * cosine - sum[0] * sine;
}
