/* SPDX-License-Identifier: MIT */
/// Plays a table: fade in or approach, whole periods from the start index, fade out; ramps to zero when aborted.
///
/// Every sample is w x[n]: w the fade factor, the same for all channels, x the table. w runs along s(t) = 3 t^2 - 2
/// t^3 (within 1 % of a raised cosine, slope zero at both ends, integer arithmetic only), so that at any time, abort
/// included,
///
///     |out[n] - out[n-1]| <= max |x[n] - x[n-1]| + 1.5 max |x| / (length of the ramp) + 1 count
///
/// A ramp of no length is allowed for the two fades (the table's start index is chosen so that little moves there),
/// never for the abort.
///
/// Approach: a drive that is to start from rest is disturbed least if it stands where the table begins. In place of a
/// fade in, the position then runs to w x[start] with the table standing still, stays there for the dwell, and the
/// first period begins at full amplitude. Torque stays zero, velocity zero or the speed of travel: w' x would need the
/// scales of the channels, and the position loop comes to rest in the dwell. The bound above holds until the first
/// sample of the period; there the position goes on, but torque and velocity step by what the table has at its start
/// index. An abort on the way runs back to zero, the table standing still.
///
/// Trap: while w changes, a cascade's references do not belong together exactly: the derivative of w x is w x' + w' x,
/// but the velocity and torque feed-forward played are w x' and w x''. The error is w' x, at most 1.5 max |x| / (ramp
/// length in seconds), it is there during the ramps only, and the drive's position loop absorbs it. During whole
/// periods w = 1 and the references are exactly the table's.
///
/// Travel: a table of version 2 plays around a constant speed. Each sample sent with factor w moves the position by
/// w S / N to the next, S the travel per period: it is the sum of the faded speed as it is held between samples, so
/// that the axis sets off and comes to rest with the ramps, without a step in position or speed:
///
///     p[n] = w[n] x[n] + c[n],   c[0] = 0,   c[n+1] = c[n] + w[n] S / N,   w[-1] = 0
///     |p[n] - p[n-1]| <= max |x[n] - x[n-1]| + 1.5 max |x| / (length of the ramp) + |S| / N + 1 count
///
/// c is kept in 2^-30 counts: a whole period adds exactly S, each sample of a ramp less than 2^-29 counts from w S / N.
/// When done, torque and velocity are zero and the position stays at c: the axis rests where it has got to, an abort
/// included, and does not go back.
#ifndef SERVOSCOPE_MSGEN_PLAYER_H
#define SERVOSCOPE_MSGEN_PLAYER_H

#include "msgen/table.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { msgen_ramp_samples_max = 1 << 24, msgen_gain_one = 1 << 16 };

enum msgen_phase {
    msgen_phase_fade_in = 0,
    msgen_phase_playing = 1,
    msgen_phase_fade_out = 2,
    msgen_phase_aborting = 3, ///< ramping to zero because msgen_player_abort() was called
    msgen_phase_done = 4,     ///< output is zero from here on, the position where it has travelled to
    msgen_phase_approach = 5, ///< to the position at the start index, dwell included
};

/// What is to be played and how; zero-initialised fields mean what is said at each.
struct msgen_player_config {
    uint32_t periods;          ///< whole periods at full amplitude, settling ones included; at least 1
    uint32_t fade_in_samples;  ///< 0: starts at the start index with full amplitude, after the approach if there is one
    uint32_t approach_samples; ///< length of the way to the start index's position, without a fade in; 0: no approach
    uint32_t dwell_samples;    ///< after an approach: samples to stand there
    uint32_t fade_out_samples; ///< 0: stops after the last sample of the last period
    uint32_t abort_samples;    ///< at least 1
    /// Output units per count in Q16, negative turns the direction; 0: msgen_gain_one.
    int32_t gain_q16[msgen_channels_max];
    int32_t limit[msgen_channels_max]; ///< largest |output|; 0: INT32_MAX
};

/// Which sample a call has put out.
struct msgen_player_state {
    enum msgen_phase phase;
    uint32_t period; ///< playing: 0 .. periods-1; else of the nearest such period
    uint32_t index;  ///< sample of the table, 0 .. N-1
};

/// Read-only for the application.
struct msgen_player {
    const struct msgen_table *table;
    struct msgen_player_config config;
    enum msgen_phase phase;
    uint32_t period, index;      ///< of the next sample
    uint32_t period_position;    ///< samples since the period began
    uint32_t ramp_left;          ///< samples of a fade, approach with dwell, or abort that are still to come
    uint64_t ramp_q62, step_q62; ///< t along the ramp and its increment
    int32_t factor_q30;          ///< w of the last sample
    int32_t abort_from_q30;      ///< w when the abort began
    bool standing;               ///< last sample: the table stood still at the start index (approach, abort of it)
    int32_t standing_velocity;   ///< velocity meanwhile, counts: mean of the table's if it travels, else 0; f32: unused
    struct {
        int64_t step_q30, remainder; ///< travel per period in 2^-30 counts = N step + remainder
        int64_t remainder_sum;       ///< of whole steps, |remainder_sum| < N
        int64_t position_q30;        ///< c of the last sample
    } travel;
    struct {
        uint32_t saturated; ///< outputs that were clipped to their limit, per channel and sample
    } err;
};

/// Sets up a player of an integer table (i16, i32); nothing is played yet.
/// Errors:   core_err_argument, core_err_player_format, _fade (a ramp too long, an abort of no length, both fade in and
///           approach), _periods, _limit, _travel (all periods, ramps and dwell together travel more than 2^31 counts,
///           or times the gain more than the limit); self untouched then
/// Cost:     of a table that travels, with an approach: one pass over its velocity; else nothing that grows with N
/// Lifetime: table and its bytes must outlive self
/// Test:     tests/unit/test_msgen_player.c
enum core_status msgen_player_init(struct msgen_player *self, const struct msgen_table *table,
                                   const struct msgen_player_config *config);

/// The same for an f32 table, to be played with msgen_player_step_f32().
enum core_status msgen_player_init_f32(struct msgen_player *self, const struct msgen_table *table,
                                       const struct msgen_player_config *config);

/// Puts out the next sample of an integer table (i16, i32) and says which it is.
/// Shapes:   out_samples: table->channels int32, in counts times gain
/// Overflow: |w x gain| is formed in 64 bits, clipped to `limit`, counted in err.saturated; with travel w x + c before
///           that to 32 bits
/// Errors:   none; a float table puts out zeros and is done at once
/// Cost:     integer only, one 64-bit multiply for the ramp and two per channel; interrupt-safe, one caller per player
struct msgen_player_state msgen_player_step(struct msgen_player *self, int32_t *out_samples);

/// The same for f32 tables, in the table's numbers; gain and limit do not apply. An integer table puts out zeros.
/// Travel is added up as exactly; the sum with the sample is rounded to 24 bits.
struct msgen_player_state msgen_player_step_f32(struct msgen_player *self, float *out_samples);

/// Ramps to zero from the present amplitude within config.abort_samples while the table plays on, then is done.
/// A fade out that ends sooner goes on. Harmless twice, and when done. Call it where step is called from.
void msgen_player_abort(struct msgen_player *self);

/// What both kinds of init share: everything but the table's format.
enum core_status msgen_player_set_up(struct msgen_player *self, const struct msgen_table *table,
                                     const struct msgen_player_config *config);

/// Moves on by one sample and returns its place and, in self->factor_q30, its fade factor: what both steps share.
struct msgen_player_state msgen_player_advance(struct msgen_player *self);

#ifdef __cplusplus
}
#endif

#endif
