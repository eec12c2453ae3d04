/* SPDX-License-Identifier: MIT */
/// The DFT at the excited bins in blocks of samples: six to thirty times fewer instructions than the exact table
/// (frf/dft.h), and 8 bytes a bin and channel, at 100 dB and more.
///
///     Y_k = restore_k acc_k,    acc_k <- acc_k exp(+j w_k L) + block,    w_k = 2 pi k / N
///
/// The accumulator is rotated, not the samples' phasor (Horner), so nothing drifts and nothing is reset; one constant
/// per bin turns the last block's phase back (frf/block_table.h). All arithmetic is integer and the same to the last
/// bit on every machine; it differs from the exact sum by rounding: worst bin >= 100 dB below 16-bit data of 0.95 full
/// scale in up to 200 lines, N = 2000 .. 65536 (tests/unit/test_frf_block.c prints and checks it).
///
/// Instructions per sample, bin and channel on Cortex-M4 at 200 bins (./run bench firmware-dft): any lines 1.9 with
/// L = 32 (1.7: 64), below 0.1 of the sample rate 0.7 to 0.9, below 0.02 of it 0.35, odd lines 1.0, if fed in blocks;
/// a call per frame costs some 55 instructions more, whatever the bins and channels: 0.27 at one channel, 0.09 at three
/// (odd lines twice that). Samples are folded as they arrive; the rest comes in a burst every L samples, or evenly over
/// the following ones (`spread`): then the longest call is 1.2 to 2.3 times the mean one, and a period's result is
/// there L - 1 samples later. Where L does not divide the period, two blocks of it are worked on in between half of L
/// and L. Where it is folded (Q), all work falls into its last Qth. The results are the same bits either way.
///
/// Periods, banks, reasons and the reader's side are those of frf/dft.h. With one bank the last period stays readable
/// until the first block of the next one is worked on, with two for a whole period.
#ifndef SERVOSCOPE_FRF_BLOCK_H
#define SERVOSCOPE_FRF_BLOCK_H

#include "frf/block_table.h"
#include "frf/dft.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Words of int32_t: accumulators, 2 a bin, channel and bank (bins rounded up to even), per channel the block being
/// filled, and what projecting takes. Arguments are evaluated more than once.
#define FRF_BLOCK_STORAGE_WORDS(bins, channels, banks, L, terms)                                                       \
    (2u * FRF_BLOCK_ROWS(bins) * (channels) * (banks) + (L) * (channels) + ((terms) == (L) ? 0u : (terms)))
CORE_STATIC_ASSERT(FRF_BLOCK_STORAGE_WORDS(200u, 3u, 1u, 32u, 32u) * 4u == 200u * 3u * 8u + 3u * 128u,
                   eight_bytes_a_bin_and_channel);
/// Words of storage that come on top if the work is spread: the block that is worked on while the next one is filled.
#define FRF_BLOCK_SPREAD_WORDS(channels, L)  ((L) * (channels))
/// Words of int32_t for a period of N samples folded into N/Q; none if it is not folded.
#define FRF_BLOCK_PART_WORDS(channels, N, Q) ((channels) * ((N) / (Q)))

/// What the two ends need to agree on. storage, part and what the table points to must outlive the object.
struct frf_block_config {
    const struct frf_block_table *table;
    uint32_t channels; ///< 1 .. SERVOSCOPE_FRF_CHANNELS_MAX
    uint32_t banks;    ///< 1 or 2
    bool spread;       ///< work on a block while the next one arrives, evenly
    int32_t *storage;  ///< FRF_BLOCK_STORAGE_WORDS(bins, channels, banks, L, terms) words, not initialised; if spread
                       ///< FRF_BLOCK_SPREAD_WORDS(channels, L) more
    uint32_t storage_words;
    int32_t *part; ///< FRF_BLOCK_PART_WORDS(channels, N, Q) words, not initialised; unused if repeats <= 1
    uint32_t part_words;
    int16_t rail_low, rail_high; ///< samples at or beyond count as saturated; both 0: INT16_MIN and INT16_MAX
};

/// How far the work on a block is.
struct frf_block_run {
    int32_t *accumulators; ///< of the next two rows, and
    const int32_t *rows;   ///< their coefficients
    const int32_t *data;   ///< what these are multiplied with
    uint32_t pairs;        ///< of rows left; 0: nothing is left to do
    uint32_t groups;       ///< of four terms: of a bin's row; of the basis's rows those that are done
    uint32_t cost;         ///< of the next step
    uint32_t channel;
    bool on_bins;     ///< else on the basis
    bool fresh, last; ///< the block is the first of its period to be worked on, its last
    uint32_t reasons; ///< of the period, if it is the last
    uint32_t rate;    ///< that becomes due with each frame
    uint32_t owed;    ///< due, not done
};

/// Read-only for the application.
struct frf_block {
    struct frf_block_table table;
    int32_t *banks[2]; ///< accumulators: channel by channel, real and imaginary of each row; the same one twice, or two
    int32_t *filling,
        *taken;         ///< folded blocks, channel by channel: that samples go into, that is worked on; may be one
    int32_t *projected; ///< of one channel; unused without a basis
    int32_t *part;      ///< the folded period; null without
    uint32_t bank_count, channels;
    bool spread;
    int32_t scale;                       ///< of samples in a folded block
    uint32_t inside_first, inside_count; ///< samples between the rails
    uint32_t block_cost;                 ///< of all channels
    uint32_t repeat;                     ///< part of the period that is being folded in
    uint32_t block_start;                ///< of the block being filled, within the part, after the first block's
    uint32_t at, end;                    ///< its next frame, and past its last; of L
    uint32_t alone;                      ///< its first frame whose counterpart lies before the period
    bool fresh;                          ///< no block of this period has been worked on yet
    struct frf_block_run run;
    uint32_t reasons;            ///< of the period being filled
    uint32_t latched_reasons[2]; ///< of the last two periods, by the last bit of (sequence - 1)
    volatile uint32_t sequence;  ///< periods completed
    volatile uint32_t begun;     ///< periods whose accumulators have been written to
    struct {
        uint32_t lost;      ///< samples skipped over
        uint32_t saturated; ///< samples at a rail, each channel counted
        uint32_t late;      ///< calls of frf_block_mark() with frf_reason_late
    } err;
};

/// A latched period.
struct frf_block_period {
    const int32_t *accumulators;
    uint32_t sequence; ///< 1 for the first period
    uint32_t reasons;  ///< 0: valid
};

/// Sets up a block DFT at n = 0 of its first period.
/// Range:    accumulators cannot overflow, for any samples (gain_shift of the table)
/// Errors:   core_err_argument (null, banks), core_err_frf_channels, _rails, core_err_storage; self untouched then
enum core_status frf_block_init(struct frf_block *self, const struct frf_block_config *config);

/// Adds `count` frames of `channels` samples each; any count, any cut. Latches when a period's last block, which is
/// filled up with zeros where L does not divide N, has been worked on.
/// Exactness: the same bits for any cut, spread or not, on any machine
/// Cost:      see above; interrupt-safe, one caller per object
void frf_block_add_i16(struct frf_block *self, const int16_t *frames, uint32_t count);

/// Passes over `count` lost frames: phase stays true, the periods touched are marked with frf_reason_gap. Blocks that a
/// gap ends are left out, so the sums of these periods mean nothing.
/// Cost: at most one block's work, where that completes a period; else its words are cleared, and the folded period's.
void frf_block_skip(struct frf_block *self, uint32_t count);

/// Marks the period being filled with the bits of enum frf_reason. Call it where samples are added.
void frf_block_mark(struct frf_block *self, uint32_t reasons);

/// Starts over at n = 0, dropping the period being filled; periods latched and counters stay.
void frf_block_restart(struct frf_block *self);

/// The last completed period; false if there is none yet, or none that can still be read. For the reader's side.
bool frf_block_latest(const struct frf_block *self, struct frf_block_period *out_period);

/// Whether what was read from the period since frf_block_latest() can be trusted: its bank is not being written to.
bool frf_block_is_intact(const struct frf_block *self, const struct frf_block_period *period);

/// Sum over the period of y[n] cos and of -y[n] sin at a bin, times 2^(30 + gain_shift of the table).
void frf_block_sums(const struct frf_block *self, const struct frf_block_period *period, uint32_t bin, uint32_t channel,
                    int64_t *out_real, int64_t *out_imaginary);

#ifdef __cplusplus
}
#endif

#endif
