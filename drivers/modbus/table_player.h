/* SPDX-License-Identifier: MIT */
/// The player in the drive: plays a table, watches limits, transforms each period and keeps its statistics, all in the
/// sample path of the drive itself; what a register map asks for (drivers/modbus/register_map.h). For parts with an
/// FPU: set-points and samples are floats in SI units (linear axes: N, m/s, m).
///
/// The sample path calls table_player_next(), controls with what it says, measures, and calls table_player_take() with
/// what was measured at the instant from which that set-point holds. The main loop calls table_player_collect() at
/// least once per period; the register map's calls belong to the main loop too.
///
/// Counted periods begin after the settling ones. A period with an invalid sample does not count; a trip, a stop and
/// the fades leave a period unfinished, which counts for nothing.
#ifndef SERVOSCOPE_DRIVERS_MODBUS_TABLE_PLAYER_H
#define SERVOSCOPE_DRIVERS_MODBUS_TABLE_PLAYER_H

#include "drivers/modbus/register_map.h"
#include "frf/statistics.h"
#include "guard/guard_real.h"
#include "msgen/player.h"

enum { table_player_channels = 2 }; ///< of the transform: input, output

enum table_player_control {
    table_player_off,     ///< no torque
    table_player_cascade, ///< position, with velocity and torque feed-forward
    table_player_torque,
    table_player_quick_stop, ///< to standstill along the drive's own ramp
};

struct table_player_setpoint {
    enum table_player_control control;
    double position, velocity, torque; ///< position in the drive's own coordinates
};

struct table_player_sample {
    double torque_ref, torque, position, velocity;
    bool valid;
};

/// Memory for tables of up to samples_max samples and bins_max bins; must outlive the player.
struct table_player_storage {
    uint32_t samples_max, bins_max, periods_kept;
    float *twiddles;           ///< 2 * samples_max
    uint32_t *bins;            ///< bins_max
    union frf_word *transform; ///< FRF_STORAGE_WORDS(bins_max, table_player_channels)
    struct frf_pair *pairs;    ///< bins_max
    struct frf_complex *kept;  ///< 2 * bins_max * periods_kept: input and output of each bin
    uint32_t *kept_reasons;    ///< periods_kept
};

/// Read-only for the application.
struct table_player {
    struct table_player_storage storage;
    const struct msgen_table *table;
    struct modbus_run_setup setup;
    double rate_hz, scale[msgen_channels_max];
    struct msgen_player player;
    struct guard_real guard;
    struct frf_twiddles_f32 twiddles;
    struct frf_dft dft;
    struct frf_statistics statistics;
    bool has_spectra;                 ///< transform and statistics belong to a run
    volatile enum modbus_state state; ///< idle, armed, settling, running, done, stopping, fault
    volatile enum modbus_end end;
    volatile uint32_t faults;
    volatile enum { table_player_no_request, table_player_start, table_player_stop, table_player_abort } request;
    struct msgen_player_state place; ///< of the set-point that is being controlled with
    struct table_player_setpoint setpoint;
    struct table_player_sample last;
    double origin;            ///< position when it was armed
    float trip_value;         ///< what broke a limit last
    bool feeding;             ///< the sample belongs to a counted period
    uint32_t samples_played;  ///< since START
    uint32_t quick_stop_left; ///< samples of a quick stop that are still to come
    uint32_t collected;       ///< periods that were looked at
    volatile uint32_t cycles_max;
};

/// Longest quick stop; the torque goes off after it at the latest.
extern const double table_player_quick_stop_s;

/// Standstill held after the last ramp, before the torque goes off.
extern const double table_player_rest_s;

/// At rest, without a table. Errors: core_err_argument
/// Test: tests/unit/test_modbus_player.c
enum core_status table_player_init(struct table_player *self, const struct table_player_storage *storage);

/// What a register map calls.
struct modbus_device table_player_device(struct table_player *self);

/// The set-point from this sample on. Sample path; never fails.
void table_player_next(struct table_player *self, struct table_player_setpoint *out_setpoint);

/// What was measured at the instant from which that set-point holds. Sample path; never fails.
void table_player_take(struct table_player *self, const struct table_player_sample *sample);

/// The drive's own fault, or modbus_fault_late: quick stop, then without torque; latched until RESET_FAULT.
void table_player_fail(struct table_player *self, uint32_t faults, double value);

/// Moves what the sample path has finished into the statistics. Main loop, at least once per period.
void table_player_collect(struct table_player *self);

#endif
