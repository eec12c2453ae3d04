/* SPDX-License-Identifier: MIT */
#include "frf/block.h"

#include "core/fixed.h"
#include "frf/block_kernel.h"

#include <stddef.h>

/* Made up for in advance, down to half counts: the kernel takes 1/2 out of a product and 1/16 out of a block's sum;
 * with a basis twice, and the basis's own quarter. */
enum { folded_shift = 4, projected_shift = 11 };

static uint32_t row_pairs(const struct frf_block *self)
{
    return FRF_BLOCK_ROWS(self->table.bin_count) / 2u;
}

static enum core_status check(const struct frf_block_config *config)
{
    if (!config || !config->table || !config->storage || config->banks < 1 || config->banks > 2) {
        return core_err_argument;
    }
    if (config->channels < 1 || config->channels > SERVOSCOPE_FRF_CHANNELS_MAX) {
        return core_err_frf_channels;
    }
    bool has_rails = config->rail_low != 0 || config->rail_high != 0;
    return has_rails && config->rail_low >= config->rail_high ? core_err_frf_rails : core_ok;
}

static enum core_status check_storage(const struct frf_block_config *config)
{
    const struct frf_block_layout *layout = &config->table->layout;
    uint32_t block = layout->block_samples, channels = config->channels;
    if (config->storage_words <
        FRF_BLOCK_STORAGE_WORDS(config->table->bin_count, channels, config->banks, block, layout->terms)) {
        return core_err_storage;
    }
    if (layout->repeats > 1u) {
        uint32_t words = FRF_BLOCK_PART_WORDS(channels, config->table->period_samples, layout->repeats, block);
        return !config->part || config->part_words < words ? core_err_storage : core_ok;
    }
    return !config->frames || config->frame_samples < FRF_BLOCK_FRAME_SAMPLES(channels, block) ? core_err_storage
                                                                                               : core_ok;
}

static void clear_part(struct frf_block *self)
{
    uint32_t words = FRF_BLOCK_PART_WORDS(self->channels, self->table.period_samples, self->table.layout.repeats,
                                          self->table.layout.block_samples);
    for (uint32_t w = 0; self->part && w < words; ++w) {
        self->part[w] = 0;
    }
}

enum core_status frf_block_init(struct frf_block *self, const struct frf_block_config *config)
{
    enum core_status status = self ? check(config) : core_err_argument;
    if (status == core_ok) {
        status = check_storage(config);
    }
    if (status != core_ok) {
        return status;
    }
    bool has_rails = config->rail_low != 0 || config->rail_high != 0;
    const struct frf_block_table *table = config->table;
    uint32_t channels = config->channels, bank_words = 2u * FRF_BLOCK_ROWS(table->bin_count) * channels;
    self->table = *table;
    self->banks[0] = config->storage;
    self->banks[1] = config->storage + (config->banks - 1u) * bank_words;
    self->work = self->banks[1] + bank_words;
    self->folded = table->basis ? self->work + table->layout.terms * channels : NULL;
    self->frames = config->frames;
    self->part = table->layout.repeats > 1u ? config->part : NULL;
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
    clear_part(self);
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

static inline void put_pair(int32_t right, int32_t left, int32_t scale, int32_t *out_pair)
{
    out_pair[0] = (right + left) * scale;
    out_pair[1] = (right - left) * scale;
}

/* Sums and differences about the block's centre, outwards. |sum| <= 2^16 Q, times 2^shift below 2^31 by the table's
 * bound on L Q 2^gain_shift, L being 8 or more. */
static void fold(const int16_t *frames, uint32_t channels, uint32_t block, uint32_t shift, int32_t *out_folded)
{
    const int16_t *right = frames + block / 2u * channels, *left = right;
    for (uint32_t i = 0; i < block; i += 2u) {
        left -= channels;
        put_pair(*right, *left, (int32_t)1 << shift, out_folded + i);
        right += channels;
    }
}

static void fold_part(const int32_t *frames, uint32_t channels, uint32_t block, uint32_t shift, int32_t *out_folded)
{
    const int32_t *right = frames + block / 2u * channels, *left = right;
    for (uint32_t i = 0; i < block; i += 2u) {
        left -= channels;
        put_pair(*right, *left, (int32_t)1 << shift, out_folded + i);
        right += channels;
    }
}

/* `frames` are the block's; null: they are in the folded period. */
static void prepare_work(struct frf_block *self, const int16_t *frames)
{
    const struct frf_block_table *table = &self->table;
    uint32_t block = table->layout.block_samples, terms = table->layout.terms, channels = self->channels;
    uint32_t shift = table->gain_shift + (table->basis ? projected_shift : folded_shift);
    for (uint32_t c = 0; c < channels; ++c) {
        int32_t *work = self->work + c * terms, *folded = table->basis ? self->folded : work;
        if (!frames) {
            fold_part(self->part + self->block_start * channels + c, channels, block, shift, folded);
        } else {
            fold(frames + c, channels, block, shift, folded);
        }
        if (table->basis) { /* its rotations are 0: whatever was in `work` is gone */
            FRF_BLOCK_ACCUMULATE(work, table->basis, folded, terms / 4u, block / 4u);
        }
    }
}

static void begin_block(struct frf_block *self, uint32_t start)
{
    uint32_t block = self->table.layout.block_samples, in_part = self->table.part_samples - start;
    self->block_start = start;
    self->block_frames = self->left = block < in_part ? block : in_part;
    self->lost = 0;
}

static void begin_period(struct frf_block *self)
{
    self->reasons = 0;
    self->fresh = true;
    self->repeat = 0;
    begin_block(self, 0);
}

/* A sample is between the rails if low < x < high: one comparison of x - low - 1 without sign. */
static void count_saturated(struct frf_block *self, const int16_t *samples, uint32_t count)
{
    uint32_t first_inside = (uint32_t)(self->rail_low + 1), inside = (uint32_t)(self->rail_high - self->rail_low - 1);
    uint32_t saturated = 0;
    for (const int16_t *end = samples + count; samples != end; ++samples) {
        saturated += (uint32_t)*samples - first_inside >= inside;
    }
    if (saturated > 0) {
        uint32_t room = UINT32_MAX - self->err.saturated;
        self->err.saturated += saturated < room ? saturated : room;
        self->reasons |= frf_reason_saturated;
    }
}

/* Takes the block over into `work`; what follows it is next to be filled. */
static void take_block(struct frf_block *self, const int16_t *frames)
{
    uint32_t next = self->block_start + self->block_frames;
    finish_work(self);
    prepare_work(self, frames);
    self->done = 0;
    self->work_fresh = self->fresh;
    self->fresh = false;
    if (next == self->table.part_samples) {
        self->work_last = true;
        self->work_reasons = self->reasons;
        begin_period(self);
    } else {
        begin_block(self, next);
    }
    if (!self->spread) {
        finish_work(self);
    }
}

/* `frames` are the block's, all that there are: the caller's own or the kept ones. */
static void complete_block(struct frf_block *self, const int16_t *frames)
{
    uint32_t block = self->table.layout.block_samples, channels = self->channels;
    count_saturated(self, frames + self->lost * channels, (self->block_frames - self->lost) * channels);
    if (self->block_frames < block) {
        for (uint32_t i = self->block_frames * channels; i < block * channels; ++i) {
            self->frames[i] = 0;
        }
    }
    take_block(self, frames);
}

static void keep(struct frf_block *self, const int16_t *frames, uint32_t count)
{
    int16_t *kept = self->frames + (self->block_frames - self->left) * self->channels;
    const int16_t *end = frames + count * self->channels;
    while (frames != end) {
        *kept++ = *frames++;
    }
    self->left -= count;
}

/* |sum| <= 2^15 Q, Q <= N <= 2^16 */
static void keep_in_part(struct frf_block *self, const int16_t *frames, uint32_t count)
{
    int32_t *kept = self->part + (self->block_start + self->block_frames - self->left) * self->channels;
    int32_t sign = self->table.alternate && self->repeat % 2u != 0u ? -1 : 1;
    count_saturated(self, frames, count * self->channels);
    for (uint32_t i = 0; i < count * self->channels; ++i) {
        kept[i] = (self->repeat == 0 ? 0 : kept[i]) + sign * frames[i];
    }
    self->left -= count;
}

/* Only the last part's blocks are worked on: then they hold all parts. */
static void complete_block_of_part(struct frf_block *self)
{
    uint32_t next = self->block_start + self->block_frames;
    finish_work(self);
    if (self->repeat + 1u == self->table.layout.repeats) {
        take_block(self, NULL);
    } else if (next == self->table.part_samples) {
        ++self->repeat;
        begin_block(self, 0);
    } else {
        begin_block(self, next);
    }
}

void frf_block_add_i16(struct frf_block *self, const int16_t *frames, uint32_t count)
{
    uint32_t block = self->table.layout.block_samples;
    while (count > 0) {
        uint32_t piece = count < self->left ? count : self->left;
        if (self->part) {
            keep_in_part(self, frames, piece);
        } else if (piece < block) {
            keep(self, frames, piece);
        } else {
            self->left = 0;
        }
        if (self->left > 0) {
            if (self->spread) {
                uint32_t all = row_pairs(self) * self->channels;
                work_until(self, all * (self->block_frames - self->left) / self->block_frames);
            }
        } else if (self->part) {
            complete_block_of_part(self);
        } else {
            complete_block(self, piece < block ? self->frames : frames);
        }
        frames += piece * self->channels;
        count -= piece;
    }
}

/* What is kept of the block or part in which the gap ends is zeros. */
static void begin_after_gap(struct frf_block *self, uint32_t position)
{
    uint32_t block = self->table.layout.block_samples, in_part = position % self->table.part_samples;
    self->repeat = position / self->table.part_samples;
    begin_block(self, in_part / block * block);
    self->lost = in_part - self->block_start;
    self->left -= self->lost;
    clear_part(self);
    for (uint32_t i = 0; !self->part && i < self->lost * self->channels; ++i) {
        self->frames[i] = 0;
    }
}

void frf_block_skip(struct frf_block *self, uint32_t count)
{
    uint32_t period = self->table.period_samples;
    if (count == 0) {
        return;
    }
    finish_work(self);
    self->err.lost = self->err.lost > UINT32_MAX - count ? UINT32_MAX : self->err.lost + count;
    uint32_t position = self->repeat * self->table.part_samples + self->block_start + self->block_frames - self->left;
    self->reasons |= frf_reason_gap;
    while (count >= period - position) {
        count -= period - position;
        position = 0;
        /* Its bank may never have been written to, but what it held is no longer the period's before. */
        self->begun = self->sequence + 1u;
        latch(self, self->reasons);
        begin_period(self);
        self->reasons = count > 0 ? frf_reason_gap : 0;
    }
    begin_after_gap(self, position + count);
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
