/* SPDX-License-Identifier: MIT */
/// Plays a table: fade in, whole periods from the start index, fade out; ramps to zero when aborted.
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
/// Trap: while w changes, a cascade's references do not belong together exactly: the derivative of w x is w x' + w' x,
/// but the velocity and torque feed-forward played are w x' and w x''. The error is w' x, at most 1.5 max |x| / (ramp
/// length in seconds), it is there during the ramps only, and the drive's position loop absorbs it. During whole
/// periods w = 1 and the references are exactly the table's.
#ifndef SERVOSCOPE_MSGEN_PLAYER_H
#define SERVOSCOPE_MSGEN_PLAYER_H

#include "msgen/table.h"

enum { msgen_ramp_samples_max = 1 << 24, msgen_gain_one = 1 << 16 };

enum msgen_phase {
    msgen_phase_fade_in = 0,
    msgen_phase_playing = 1,
    msgen_phase_fade_out = 2,
    msgen_phase_aborting = 3, ///< ramping to zero because msgen_player_abort() was called
    msgen_phase_done = 4,     ///< output is zero from here on
};

/// What is to be played and how; zero-initialised fields mean what is said at each.
struct msgen_player_config {
    uint32_t periods;          ///< whole periods at full amplitude, settling ones included; at least 1
    uint32_t fade_in_samples;  ///< 0: starts at the start index with full amplitude
    uint32_t fade_out_samples; ///< 0: stops after the last sample of the last period
    uint32_t abort_samples;    ///< at least 1
    int32_t gain_q16
        [msgen_channels_max]; ///< output units per count in Q16, negative turns the direction; 0: msgen_gain_one
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
    uint32_t ramp_left;          ///< samples of a fade or abort that are still to come
    uint64_t ramp_q62, step_q62; ///< t along the ramp and its increment
    int32_t factor_q30;          ///< w of the last sample
    int32_t abort_from_q30;      ///< w when the abort began
    struct {
        uint32_t saturated; ///< outputs that were clipped to their limit, per channel and sample
    } err;
};

/// Sets up a player of an integer table (i16, i32); nothing is played yet.
/// Errors:   core_err_argument, core_err_player_format, _fade, _periods, _limit; self untouched then
/// Lifetime: table and its bytes must outlive self
/// Test:     tests/unit/test_msgen_player.c
enum core_status msgen_player_init(struct msgen_player *self, const struct msgen_table *table,
                                   const struct msgen_player_config *config);

/// The same for an f32 table, to be played with msgen_player_step_f32().
enum core_status msgen_player_init_f32(struct msgen_player *self, const struct msgen_table *table,
                                       const struct msgen_player_config *config);

/// Puts out the next sample of an integer table (i16, i32) and says which it is.
/// Shapes:   out_samples: table->channels int32, in counts times gain
/// Overflow: |w x gain| is formed in 64 bits, clipped to `limit`, counted in err.saturated
/// Errors:   none; a float table puts out zeros and is done at once
/// Cost:     integer only, one 64-bit multiply for the ramp and two per channel; interrupt-safe, one caller per player
struct msgen_player_state msgen_player_step(struct msgen_player *self, int32_t *out_samples);

/// The same for f32 tables, in the table's numbers; gain and limit do not apply. An integer table puts out zeros.
struct msgen_player_state msgen_player_step_f32(struct msgen_player *self, float *out_samples);

/// Ramps to zero from the present amplitude within config.abort_samples while the table plays on, then is done.
/// A fade out that ends sooner goes on. Harmless twice, and when done. Call it where step is called from.
void msgen_player_abort(struct msgen_player *self);

/// What both kinds of init share: everything but the table's format.
enum core_status msgen_player_set_up(struct msgen_player *self, const struct msgen_table *table,
                                     const struct msgen_player_config *config);

/// Moves on by one sample and returns its place and, in self->factor_q30, its fade factor: what both steps share.
struct msgen_player_state msgen_player_advance(struct msgen_player *self);

#endif
