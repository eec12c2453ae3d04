/* SPDX-License-Identifier: MIT */
/// The drive of the example: the sampling interrupt around the library's sample path, a simulated belt drive in place
/// of power stage and motor, and what the main loop may ask of it. One per program: interrupts have no argument.
#ifndef SERVOSCOPE_FIRMWARE_AXIS_H
#define SERVOSCOPE_FIRMWARE_AXIS_H

#include "firmware/belt.h"
#include "firmware/results.h"
#include "firmware/sample_path.h"

enum { axis_rate_hz = 8000, axis_sample_us = 125 };

enum axis_state { axis_resting, axis_armed, axis_playing, axis_done };

/// How a table is to be played; SI units.
struct axis_setup {
    uint32_t settle_periods, measure_periods, fade_samples, abort_samples, watchdog_samples;
    float torque_limit_Nm, velocity_limit_rad_per_s, position_min_rad, position_max_rad;
};

/// Read-only but for axis.c.
struct axis {
    struct sample_path path;
    struct belt belt;
    struct results results; ///< the main loop's
    float reference_scale[msgen_channels_max];
    volatile enum axis_state state;
    volatile bool start_wanted, stop_wanted; ///< by the main loop, taken by the interrupt
    volatile uint32_t samples;               ///< since power-on: the main loop's clock
    uint32_t longest_instructions, all_instructions;
};

extern struct axis axis;

/// At rest; the interrupt runs from here on.
void axis_power_on(void);

/// Takes a table for the lines and the period that the DFT's tables were made for, at rest.
/// Errors: core_err_frf_period, core_err_frf_bins: made for others; those of guard, player and DFT
enum core_status axis_prepare(const struct msgen_table *table, const struct axis_setup *setup);

/// Errors: core_err_guard_outside
enum core_status axis_arm(void);
void axis_start(void);
void axis_stop(void);
void axis_rest(void);

/// Moves what the interrupt has finished into the results; at least once per period.
void axis_collect(void);

/// Time since power-on.
uint64_t axis_time_us(void);

#endif
