/* SPDX-License-Identifier: MIT */
#include "frf/block.h"

#include "core/fixed.h"
#include "frf/block_kernel.h"

#include <stddef.h>

/* Made up for in advance, down to half counts: the kernel takes 1/2 out of a product and 1/16 out of a block's sum;
 * with a basis twice, and the basis's own quarter. */
enum { folded_shift = 4, projected_shift = 11 };

/* Two rows of the basis are gone through in pieces of so many groups, of so many instructions on a Cortex-M4. */
static const uint32_t segment_groups = 4u, segment_cost = 76u;

/* Of no work: more than is ever owed. */
static const uint32_t no_cost = UINT32_MAX;

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
    const struct frf_block_table *table = config->table;
    uint32_t block = table->layout.block_samples, channels = config->channels;
    uint32_t words = FRF_BLOCK_STORAGE_WORDS(table->bin_count, channels, config->banks, block, table->layout.terms) +
                     (config->spread ? FRF_BLOCK_SPREAD_WORDS(channels, block) : 0u);
    if (config->storage_words < words) {
        return core_err_storage;
    }
    if (table->layout.repeats <= 1u) {
        return core_ok;
    }
    return !config->part ||
                   config->part_words < FRF_BLOCK_PART_WORDS(channels, table->period_samples, table->layout.repeats)
               ? core_err_storage
               : core_ok;
}

static void clear(int32_t *words, uint32_t count)
{
    for (uint32_t w = 0; w < count; ++w) {
        words[w] = 0;
    }
}

static void clear_part(struct frf_block *self)
{
    if (self->part) {
        clear(self->part, self->channels * self->table.part_samples);
    }
}

static void rest(struct frf_block *self)
{
    self->run.pairs = self->run.rate = self->run.owed = 0;
    self->run.cost = no_cost;
}

/* Instructions of the Cortex-M4 kernel for two rows: what counts is the proportion. */
static uint32_t cost_of_rows(uint32_t groups)
{
    return 11u * groups + 28u;
}

/* Of all there is to do with a block in one channel. */
static uint32_t cost_of_block(const struct frf_block_table *table)
{
    uint32_t terms = table->layout.terms, groups = table->layout.block_samples / 4u;
    uint32_t cost = FRF_BLOCK_ROWS(table->bin_count) / 2u * cost_of_rows(terms / 4u);
    uint32_t segments = (groups + segment_groups - 1u) / segment_groups;
    return table->basis ? cost + terms / 4u * segments * segment_cost : cost;
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
    int32_t rail_low = has_rails ? config->rail_low : INT16_MIN, rail_high = has_rails ? config->rail_high : INT16_MAX;
    const struct frf_block_table *table = config->table;
    uint32_t channels = config->channels, bank_words = 2u * FRF_BLOCK_ROWS(table->bin_count) * channels;
    self->table = *table;
    self->banks[0] = config->storage;
    self->banks[1] = config->storage + (config->banks - 1u) * bank_words;
    self->filling = self->banks[1] + bank_words;
    self->taken = self->filling + (config->spread ? FRF_BLOCK_SPREAD_WORDS(channels, table->layout.block_samples) : 0u);
    self->projected = self->taken + channels * table->layout.block_samples;
    self->part = table->layout.repeats > 1u ? config->part : NULL;
    self->bank_count = config->banks;
    self->channels = channels;
    self->spread = config->spread;
    self->scale = (int32_t)1 << (table->gain_shift + (table->basis ? projected_shift : folded_shift));
    self->inside_first = (uint32_t)(rail_low + 1);
    self->inside_count = (uint32_t)(rail_high - rail_low - 1);
    self->block_cost = cost_of_block(table) * channels;
    self->sequence = self->begun = 0;
    self->latched_reasons[0] = self->latched_reasons[1] = 0;
    self->err.lost = self->err.saturated = self->err.late = 0;
    self->run.last = false;
    rest(self);
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

/* A channel's block is multiplied with the basis, if there is one, and what comes of that with the bins. */
static void begin_basis(struct frf_block *self)
{
    const struct frf_block_table *table = &self->table;
    struct frf_block_run *run = &self->run;
    run->on_bins = false;
    run->accumulators = self->projected;
    run->rows = table->basis;
    run->data = self->taken + run->channel * table->layout.block_samples;
    run->pairs = table->layout.terms / 4u;
    run->groups = 0;
    run->cost = segment_cost;
}

static void begin_bins(struct frf_block *self)
{
    const struct frf_block_table *table = &self->table;
    struct frf_block_run *run = &self->run;
    run->on_bins = true;
    run->pairs = FRF_BLOCK_ROWS(table->bin_count) / 2u;
    run->accumulators = self->banks[self->sequence & 1u] + 4u * run->channel * run->pairs;
    run->rows = table->rows;
    run->data = table->basis ? self->projected : self->taken + run->channel * table->layout.block_samples;
    run->groups = table->layout.terms / 4u;
    run->cost = cost_of_rows(run->groups);
}

static void begin_channel(struct frf_block *self)
{
    if (self->table.basis) {
        begin_basis(self);
    } else {
        begin_bins(self);
    }
}

static void end_bins(struct frf_block *self)
{
    ++self->run.channel;
    if (self->run.channel < self->channels) {
        begin_channel(self);
        return;
    }
    rest(self);
    if (self->run.last) {
        latch(self, self->run.reasons);
    }
}

/* In a period's first block nothing is rotated: the accumulators begin at 0, and are no longer the period's before. */
static void begin_accumulators(struct frf_block *self, uint32_t row_pairs)
{
    int32_t *accumulators = self->run.accumulators;
    self->begun = self->sequence + 1u;
    SERVOSCOPE_MEMORY_BARRIER();
    for (const int32_t *end = accumulators + 4u * row_pairs; accumulators != end; accumulators += 4) {
        accumulators[0] = accumulators[1] = accumulators[2] = accumulators[3] = 0;
    }
}

static uint32_t work_on_bins(struct frf_block *self, uint32_t owed)
{
    struct frf_block_run *run = &self->run;
    uint32_t due = owed / run->cost, pairs = due < run->pairs ? due : run->pairs;
    if (run->fresh) {
        begin_accumulators(self, pairs);
    }
    FRF_BLOCK_ACCUMULATE(run->accumulators, run->rows, run->data, pairs, run->groups);
    run->accumulators += 4u * pairs;
    run->rows += pairs * (8u * run->groups + 4u);
    run->pairs -= pairs;
    owed -= pairs * run->cost;
    if (run->pairs == 0) {
        end_bins(self);
    }
    return owed;
}

/* Two rows of the basis take long, and there are few: they are gone through in segments. Where the kernel takes them
 * whole their rotation is 0, so that whatever was in `projected` is gone. */
static uint32_t work_on_basis(struct frf_block *self, uint32_t owed)
{
    struct frf_block_run *run = &self->run;
    uint32_t all = self->table.layout.block_samples / 4u, left = all - run->groups;
    uint32_t groups = left < segment_groups ? left : segment_groups;
    FRF_BLOCK_SUM(run->accumulators, run->rows, run->data + 4u * run->groups, groups, run->groups == 0);
    run->rows += 8u * groups;
    run->groups += groups;
    if (run->groups == all) {
        frf_block_end_sum(run->accumulators);
        run->accumulators += 4;
        run->rows += 4;
        run->groups = 0;
        --run->pairs;
    }
    if (run->pairs == 0) {
        begin_bins(self);
    }
    return owed - segment_cost;
}

/* Works on the block in `taken` for at most what is owed. */
static void work_on(struct frf_block *self, uint32_t owed)
{
    while (owed >= self->run.cost) {
        owed = self->run.on_bins ? work_on_bins(self, owed) : work_on_basis(self, owed);
    }
    self->run.owed = owed;
}

/* All that is left of it, and the basis in one piece where it has not been begun. */
static void finish_work(struct frf_block *self)
{
    struct frf_block_run *run = &self->run;
    while (run->pairs > 0) {
        if (run->on_bins) {
            (void)work_on_bins(self, no_cost - 1u);
        } else if (run->groups > 0) {
            (void)work_on_basis(self, segment_cost);
        } else {
            uint32_t groups = self->table.layout.block_samples / 4u;
            FRF_BLOCK_ACCUMULATE(run->accumulators, run->rows, run->data, run->pairs, groups);
            begin_bins(self);
        }
    }
}

/* Only what completes a period is of use where the one being filled is dropped or spoilt. A bank that has not been
 * begun still is to be. */
static void leave_work(struct frf_block *self)
{
    if (self->run.last) {
        finish_work(self);
    } else if (self->run.pairs > 0) {
        self->fresh = self->run.fresh;
        rest(self);
    }
}

/* Whether a sample is at a rail or beyond, by one comparison. */
static inline uint32_t is_saturated(int32_t sample, uint32_t first, uint32_t inside)
{
    return (uint32_t)sample - first >= inside;
}

static void count_saturated(struct frf_block *self, uint32_t saturated)
{
    uint32_t room = UINT32_MAX - self->err.saturated;
    self->err.saturated += saturated < room ? saturated : room;
    self->reasons |= frf_reason_saturated;
}

/* Sums and differences about the block's centre, outwards, of the sample left and right of it. |sum| <= 2^16 Q, times
 * 2^shift below 2^31 by the table's bound on L Q 2^gain_shift, L being 8 or more. */
static inline void put_both(int32_t *out_pair, int32_t right, int32_t left, int32_t scale)
{
    out_pair[0] = (right + left) * scale;
    out_pair[1] = (right - left) * scale;
}

enum side { side_left, side_right, side_right_alone };

/* The same as one sample comes after the other. */
static inline void put_one(int32_t *io_pair, int32_t value, enum side side)
{
    if (side == side_right) {
        int32_t sum = io_pair[0], difference = io_pair[1];
        io_pair[0] = sum + value;
        io_pair[1] = difference + value;
    } else {
        io_pair[0] = value;
        io_pair[1] = side == side_left ? -value : value;
    }
}

static inline uint32_t put_frame_at(const struct frf_block *self, const int16_t *frame, int32_t *pair, enum side side)
{
    uint32_t block = self->table.layout.block_samples, first = self->inside_first, inside = self->inside_count;
    uint32_t saturated = 0;
    int32_t scale = self->scale;
    const int16_t *end = frame + self->channels;
    do {
        int32_t sample = *frame;
        saturated += is_saturated(sample, first, inside);
        put_one(pair, sample * scale, side);
        pair += block;
        ++frame;
    } while (frame != end);
    return saturated;
}

static void put_frame(struct frf_block *self, const int16_t *frame)
{
    uint32_t at = self->at, half = self->table.layout.block_samples / 2u, saturated;
    if (at < half) {
        saturated = put_frame_at(self, frame, self->filling + 2u * (half - 1u - at), side_left);
    } else if (at < self->alone) {
        saturated = put_frame_at(self, frame, self->filling + 2u * (at - half), side_right);
    } else {
        saturated = put_frame_at(self, frame, self->filling + 2u * (at - half), side_right_alone);
    }
    self->at = at + 1u;
    if (saturated > 0) {
        count_saturated(self, saturated);
    }
}

static void put_block(struct frf_block *self, const int16_t *frames)
{
    uint32_t channels = self->channels, block = self->table.layout.block_samples, saturated = 0;
    uint32_t first = self->inside_first, inside = self->inside_count;
    int32_t *pair = self->filling, scale = self->scale;
    for (uint32_t c = 0; c < channels; ++c) {
        const int16_t *right = frames + block / 2u * channels + c, *left = right;
        for (const int32_t *end = pair + block; pair != end; pair += 2) {
            left -= channels;
            int32_t left_sample = *left, right_sample = *right;
            saturated += is_saturated(left_sample, first, inside);
            saturated += is_saturated(right_sample, first, inside);
            put_both(pair, right_sample, left_sample, scale);
            right += channels;
        }
    }
    if (saturated > 0) {
        count_saturated(self, saturated);
    }
}

/* Folds frames into the period's part; |sum| <= 2^15 Q, Q <= N <= 2^16. */
static void put_in_part(struct frf_block *self, const int16_t *frames, uint32_t count, int32_t *io_kept)
{
    int32_t sign = self->table.alternate && self->repeat % 2u != 0u ? -1 : 1;
    int32_t keep = self->repeat == 0 ? 0 : 1;
    uint32_t saturated = 0, first = self->inside_first, inside = self->inside_count;
    for (const int16_t *end = frames + count * self->channels; frames != end; ++frames) {
        int32_t sample = *frames;
        saturated += is_saturated(sample, first, inside);
        *io_kept = keep * *io_kept + sign * sample;
        ++io_kept;
    }
    if (saturated > 0) {
        count_saturated(self, saturated);
    }
}

static void put_kept_frame(struct frf_block *self, const int32_t *kept)
{
    uint32_t at = self->at, half = self->table.layout.block_samples / 2u;
    enum side side = at < half ? side_left : at < self->alone ? side_right : side_right_alone;
    int32_t *pair = self->filling + 2u * (at < half ? half - 1u - at : at - half);
    for (const int32_t *end = kept + self->channels; kept != end; ++kept) {
        put_one(pair, *kept * self->scale, side);
        pair += self->table.layout.block_samples;
    }
    self->at = at + 1u;
}

static void put_kept_block(struct frf_block *self, const int32_t *kept)
{
    uint32_t channels = self->channels, block = self->table.layout.block_samples;
    int32_t *pair = self->filling;
    for (uint32_t c = 0; c < channels; ++c) {
        const int32_t *right = kept + block / 2u * channels + c, *left = right;
        for (const int32_t *end = pair + block; pair != end; pair += 2) {
            left -= channels;
            put_both(pair, *right, *left, self->scale);
            right += channels;
        }
    }
}

/* Blocks are worked on in the period's last part only: then it holds all of them. */
static bool is_in_last_part(const struct frf_block *self)
{
    return !self->part || self->repeat + 1u == self->table.layout.repeats;
}

/* `count` frames of one block. */
static void put_frames(struct frf_block *self, const int16_t *frames, uint32_t count)
{
    if (count == self->table.layout.block_samples) {
        put_block(self, frames);
        self->at = count;
        return;
    }
    for (const int16_t *end = frames + count * self->channels; frames != end; frames += self->channels) {
        put_frame(self, frames);
    }
}

static void put_frames_in_part(struct frf_block *self, const int16_t *frames, uint32_t count)
{
    uint32_t position = self->block_start + self->at - self->table.lead_samples;
    int32_t *kept = self->part + position * self->channels;
    put_in_part(self, frames, count, kept);
    if (!is_in_last_part(self)) {
        self->at += count;
    } else if (count == self->table.layout.block_samples) {
        put_kept_block(self, kept);
        self->at = count;
    } else {
        for (const int32_t *end = kept + count * self->channels; kept != end; kept += self->channels) {
            put_kept_frame(self, kept);
        }
    }
}

/* What the period's ends cut off a block is nothing: ahead of the first, behind the last. */
static void begin_block(struct frf_block *self, uint32_t start)
{
    uint32_t block = self->table.layout.block_samples, lead = self->table.lead_samples;
    uint32_t left = self->table.part_samples + lead - start;
    self->block_start = start;
    self->at = start == 0 ? lead : 0;
    self->end = block < left ? block : left;
    self->alone = start == 0 ? block - lead : block;
}

static void begin_period(struct frf_block *self)
{
    self->reasons = 0;
    self->fresh = true;
    self->repeat = 0;
    begin_block(self, 0);
}

/* The block filled is next to be worked on. The work is done a frame before the next one is full, so that taking that
 * over does not come on top. */
static void take_block(struct frf_block *self)
{
    int32_t *filled = self->filling;
    struct frf_block_run *run = &self->run;
    self->filling = self->taken;
    self->taken = filled;
    run->fresh = self->fresh;
    self->fresh = false;
    run->last = self->block_start + self->end == self->table.part_samples + self->table.lead_samples;
    run->reasons = self->reasons;
    run->channel = run->owed = 0;
    begin_channel(self);
}

static void complete_block(struct frf_block *self)
{
    uint32_t next = self->block_start + self->end;
    bool is_last = next == self->table.part_samples + self->table.lead_samples;
    finish_work(self);
    bool worked_on = is_in_last_part(self);
    if (worked_on) {
        take_block(self);
    }
    if (!is_last) {
        begin_block(self, next);
    } else if (worked_on) {
        begin_period(self);
    } else {
        ++self->repeat;
        begin_block(self, 0);
    }
    if (worked_on && self->spread) {
        uint32_t frames = self->end - self->at - 1u;
        self->run.rate = (self->block_cost + frames - 1u) / frames;
    } else {
        finish_work(self);
    }
}

/* Frames have been filled in: the block may be full; if not, part of the work on the one before is due. */
static inline void go_on(struct frf_block *self, uint32_t frames)
{
    if (self->at == self->end) {
        complete_block(self);
    } else if (self->spread) {
        self->run.owed += self->run.rate * frames;
        if (self->run.owed >= self->run.cost) {
            work_on(self, self->run.owed);
        }
    }
}

static void add_frames(struct frf_block *self, const int16_t *frames, uint32_t count)
{
    while (count > 0) {
        uint32_t left = self->end - self->at, piece = count < left ? count : left;
        if (self->part) {
            put_frames_in_part(self, frames, piece);
        } else {
            put_frames(self, frames, piece);
        }
        go_on(self, piece);
        frames += piece * self->channels;
        count -= piece;
    }
}

/* A call for each frame is what an interrupt does: it has a way of its own. */
void frf_block_add_i16(struct frf_block *self, const int16_t *frames, uint32_t count)
{
    if (count == 1u && !self->part) {
        put_frame(self, frames);
        go_on(self, 1u);
    } else {
        add_frames(self, frames, count);
    }
}

/* What came before the gap's end in its block or part is nothing. */
static void begin_after_gap(struct frf_block *self, uint32_t position)
{
    uint32_t block = self->table.layout.block_samples;
    uint32_t in_part = position % self->table.part_samples + self->table.lead_samples;
    self->repeat = position / self->table.part_samples;
    begin_block(self, in_part / block * block);
    self->at = in_part - self->block_start;
    clear_part(self);
    clear(self->filling, block * self->channels);
}

void frf_block_skip(struct frf_block *self, uint32_t count)
{
    uint32_t period = self->table.period_samples;
    if (count == 0) {
        return;
    }
    leave_work(self);
    self->err.lost = self->err.lost > UINT32_MAX - count ? UINT32_MAX : self->err.lost + count;
    uint32_t in_part = self->block_start + self->at - self->table.lead_samples;
    uint32_t position = self->repeat * self->table.part_samples + in_part;
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
    leave_work(self);
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
