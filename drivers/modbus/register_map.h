/* SPDX-License-Identifier: MIT */
/// The registers behind a Modbus slave, whatever carries them: reads, writes, the command state machine, the upload of
/// a table, snapshots of spectra. No I/O, no clock, no heap; firmware and the simulated drive use it alike.
///
/// Reads have no side effect. A write is taken whole or not at all. Every request may be repeated: a table chunk brings
/// its own offset, a command its sequence number, a snapshot too.
///
///     command      in state                                   goes to
///     OPEN_UPLOAD  idle, uploading, verified, done            uploading
///     VERIFY       idle, uploading, verified, done            verified (or stays, RESULT says why; from done:
///     uploading)
///     ARM          verified                                   armed: under torque at standstill
///     START        armed                                      settling, running, stopping, done
///     STOP         armed / settling, running, stopping        verified / stopping, done
///     ABORT        armed, settling, running, stopping         stopping, done
///     RESET_FAULT  fault                                      uploading
///     (a write of setup)  idle, uploading, verified, done     idle stays, the others uploading
///
/// Anything else is exception 03 and changes nothing but RESULT. One caller, the main loop; the sample path is the
/// device's.
#ifndef SERVOSCOPE_DRIVERS_MODBUS_REGISTER_MAP_H
#define SERVOSCOPE_DRIVERS_MODBUS_REGISTER_MAP_H

#include "core/status.h"
#include "drivers/modbus/registers.h"
#include "msgen/table.h"

#include <stdbool.h>
#include <stdint.h>

/// One bin of a snapshot. Complex amplitudes in SI units, 2/N times the sum over a period's N samples.
struct modbus_record {
    float input[2], output[2];
    float input_variance, output_variance; ///< of one period: mean of |deviation|^2 with M - 1
    float covariance[2];                   ///< of output and conjugate input
};

/// The fields of the setup as numbers.
struct modbus_run_setup {
    uint32_t mode, input, output, approach;
    uint32_t settle_periods, measure_periods, fade_samples, abort_samples, dwell_samples, host_timeout_ms;
    float torque_limit, velocity_limit, position_min, position_max, following_error;
};

/// What the device is at. `state` idle: at rest, without a run; else armed, settling, running, done, stopping or fault.
struct modbus_report {
    enum modbus_state state;
    enum modbus_end end;
    uint32_t faults, periods_done, periods_valid, samples_played, torque_clipped, cycles_max;
    float torque, position, velocity, trip_value;
};

/// What plays the table and measures. Called from the caller of the map.
struct modbus_device {
    void *self;
    /// Takes a checked table and its setup; at rest. Errors: any; the table is not verified then
    enum core_status (*prepare)(void *self, const struct msgen_table *table, const struct modbus_run_setup *setup);
    /// Brings the drive under torque at standstill. Errors: any, without torque then
    enum core_status (*arm)(void *self);
    void (*start)(void *self);
    void (*stop)(void *self);  ///< ramps down; from armed: without torque at once
    void (*abort)(void *self); ///< quick stop
    void (*clear)(void *self); ///< from done or fault to rest; spectra stay
    void (*alive)(void *self); ///< the host has written something
    void (*report)(const void *self, struct modbus_report *out_report);
    /// Copies `bin_count` records of one counted period (from 0) or MODBUS_MEAN; *out_count is the number of periods
    /// in it. Returns enum modbus_validity.
    uint32_t (*spectrum)(const void *self, uint32_t period, struct modbus_record *out_records, uint32_t *out_count);
};

struct modbus_map_config {
    struct modbus_device device;
    uint8_t *table; ///< room for the bytes of a table
    uint32_t table_bytes;
    struct modbus_record *snapshot; ///< bins_max records
    uint32_t bins_max;              ///< 1 .. 65535
    uint32_t samples_max;           ///< longest period that the device plays, for the reader only
    uint32_t periods_kept;          ///< single periods that can still be read, for the reader only
    bool linear;                    ///< N, m/s, m instead of Nm, rad/s, rad
};

/// Read-only for the application.
struct modbus_map {
    struct modbus_map_config config;
    uint32_t values[modbus_field_count]; ///< as bits; of windows unused
    enum modbus_state resting;           ///< idle, uploading or verified
    struct msgen_table view;             ///< of the table; valid once verified
    bool view_valid;
    struct {
        uint32_t validity, period, count, bins;
        uint16_t sequence;
        bool is_mean;
    } latched;
};

/// Errors: core_err_argument (null, no room); self is then unusable
/// Lifetime: what config points to must outlive self
/// Test:   tests/unit/test_modbus_map.c
enum core_status modbus_map_init(struct modbus_map *self, const struct modbus_map_config *config);

/// Reads `count` registers. Errors: modbus_exception_address if any of them is not mapped; out_words is then unchanged
/// or partly filled.
enum modbus_exception modbus_map_read(struct modbus_map *self, uint32_t address, uint32_t count, uint16_t *out_words);

/// Writes `count` registers, all or none, then does what they ask for.
/// Errors: modbus_exception_address, _value (also: not in this state), _device
enum modbus_exception modbus_map_write(struct modbus_map *self, uint32_t address, uint32_t count,
                                       const uint16_t *words);

#endif
