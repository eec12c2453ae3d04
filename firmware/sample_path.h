/* SPDX-License-Identifier: MIT */
/// What the drive's sampling interrupt does with the library: guard, player, DFT, in this order, once per sample.
/// Integer only.
#ifndef SERVOSCOPE_FIRMWARE_SAMPLE_PATH_H
#define SERVOSCOPE_FIRMWARE_SAMPLE_PATH_H

#include "frf/block.h"
#include "guard/guard.h"
#include "msgen/player.h"

enum sample_path_channel { sample_path_torque = 0, sample_path_velocity = 1, sample_path_channels = 2 };

/// What the drive has measured at this instant.
struct sample_path_input {
    struct guard_sample guard;              ///< in the guard's counts
    int16_t channels[sample_path_channels]; ///< of the converters
};

/// What the drive is to do until the next one.
struct sample_path_output {
    int32_t reference[msgen_channels_max]; ///< torque, velocity, position, counts of the table
    bool done;                             ///< nothing will be played any more
};

/// One object per axis, in the interrupt's hands; the main loop reads `dft` by frf_block_latest().
struct sample_path {
    struct guard guard;
    struct msgen_player player;
    struct frf_block dft;
    bool measuring;            ///< the last sample went into a period that counts
    uint32_t tail_samples;     ///< that are still to be fed after the last period
    volatile bool done;        ///< for the main loop
    volatile uint32_t samples; ///< since the start, for the main loop's clock
    volatile uint32_t late;    ///< samples that took longer than a sampling period
    uint32_t settle_periods;   ///< first whole periods that do not count
};

/// Sets up all three; `settle_periods` of the player's periods pass before the first that counts.
enum core_status sample_path_init(struct sample_path *self, const struct guard_limits *limits,
                                  const struct msgen_table *table, const struct msgen_player_config *player,
                                  const struct frf_block_config *dft, uint32_t settle_periods);

/// One sample.
void sample_path_step(struct sample_path *self, const struct sample_path_input *input,
                      struct sample_path_output *out_output);

/// This sample took too long: its period does not count. Call it at the interrupt's end.
void sample_path_mark_late(struct sample_path *self);

#endif
