/* SPDX-License-Identifier: MIT */
/// The simulated drive behind Modbus registers: sim/belt_drive.h with the player in the drive. It has no clock: whoever
/// serves it says how many samples have passed. Its sample rate is that of the table it was given, at first the
/// model's.
#ifndef SERVOSCOPE_SIM_NODE_MODBUS_DRIVE_H
#define SERVOSCOPE_SIM_NODE_MODBUS_DRIVE_H

#include "drivers/modbus/register_map.h"
#include "drivers/modbus/table_player.h"
#include "sim/belt_drive.h"

enum {
    modbus_drive_samples_max = 65536,
    modbus_drive_bins_max = 2048,
    modbus_drive_periods_kept = 32,
    modbus_drive_table_bytes =
        msgen_header_travel_bytes + 4 * modbus_drive_bins_max + 4 * msgen_channels_max * modbus_drive_samples_max,
};

/// About 5 MB; read-only for the application.
struct modbus_drive {
    struct sim_model model; ///< own copy: the sample rate is the table's
    struct sim_belt_drive drive;
    struct table_player player;
    struct modbus_map map;
    struct modbus_device device; ///< the player's, with what the drive has to say to it
    uint8_t table[modbus_drive_table_bytes];
    struct modbus_record snapshot[modbus_drive_bins_max];
    float twiddles[2 * modbus_drive_samples_max];
    uint32_t bins[modbus_drive_bins_max];
    union frf_word transform[FRF_STORAGE_WORDS(modbus_drive_bins_max, table_player_channels)];
    struct frf_pair pairs[modbus_drive_bins_max];
    struct frf_complex kept[2 * modbus_drive_bins_max * modbus_drive_periods_kept];
    uint32_t kept_reasons[modbus_drive_periods_kept];
};

/// Puts the drive at rest at position 0. self must not move. Errors: core_err_argument
/// Test: tests/api/test_modbus_drive.c
enum core_status modbus_drive_init(struct modbus_drive *self, const struct sim_model *model);

/// One sample: the player's set-point, the drive, what it measured back into the player.
void modbus_drive_step(struct modbus_drive *self);

/// Samples per second at present.
double modbus_drive_rate_hz(const struct modbus_drive *self);

#endif
