/* SPDX-License-Identifier: MIT */
/// Limits around an excitation, in the sample path: travel, speed, torque, the host's sign of life, the sensor.
///
/// A trip asks the player for a ramp to zero (never a step), is latched with its cause and the value that caused it,
/// and holds until guard_arm(). The torque clip is a limit, not a trip: it clips and counts.
///
///     state     event                                      next      guard_step() says
///     idle      step, whatever is measured                 idle      ramp_down
///     idle      arm inside the limits                      armed
///     idle      arm outside, or with an invalid sensor     idle      (core_err_guard_outside)
///     armed     step inside the limits                     armed     run
///     armed     step that breaks a limit                   tripped   ramp_down
///     armed     arm inside / outside                       armed / idle
///     tripped   step, whatever is measured                 tripped   ramp_down
///     tripped   arm inside / outside                       armed / tripped, cause kept
///
/// Quantities are counts of the drive, so that the path stays integer; guard/guard_real.h is the same in SI units,
/// where NaN fails every check. All limits are inclusive: a value equal to its limit is inside. One writer: step and
/// arm from the sample path, or arm while the sample path does not run. guard_alive() may be called from anywhere
/// else.
#ifndef SERVOSCOPE_GUARD_GUARD_H
#define SERVOSCOPE_GUARD_GUARD_H

#include "core/config.h"
#include "core/status.h"

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum guard_cause {
    guard_cause_none = 0,
    guard_cause_sensor = 1, ///< the sample said it is invalid, or (SI variant) a value is not a number
    guard_cause_travel = 2,
    guard_cause_speed = 3,
    guard_cause_watchdog = 4, ///< no sign of life for more than watchdog_samples
    guard_cause_stuck = 5,    ///< position unchanged under torque for stuck_samples
};

enum guard_action {
    guard_run = 0,
    guard_ramp_down = 1, ///< call msgen_player_abort(); harmless if called again
};

enum guard_mode { guard_idle = 0, guard_armed = 1, guard_tripped = 2 };

/// Limits in counts. A limit that is not wanted: INT32_MIN and INT32_MAX for travel, INT32_MAX for speed and torque, 0
/// for the two durations; GUARD_LIMITS_NONE has them all.
struct guard_limits {
    int32_t position_min, position_max; ///< position_min < position_max
    int32_t velocity_max;               ///< |velocity| <= velocity_max, > 0
    int32_t torque_max;                 ///< what guard_clip_torque() clips to, > 0
    uint32_t watchdog_samples;          ///< trips at this many samples + 1 without a sign of life; 0: never
    uint32_t stuck_samples;             ///< trips at this many samples in a row; 0: never
    int32_t stuck_torque; ///< |torque| at or above which the axis has to move; >= 0, > 0 if stuck_samples is
};

#define GUARD_LIMITS_NONE                                                                                              \
    {                                                                                                                  \
        INT32_MIN, INT32_MAX, INT32_MAX, INT32_MAX, 0, 0, 0                                                            \
    }

struct guard_sample {
    int32_t position, velocity, torque;
    bool valid; ///< false: sensor or transmission says that the values are not to be trusted
};

/// What both variants share; read-only for the application.
struct guard_state {
    enum guard_mode mode;
    enum guard_cause cause; ///< why it tripped last; kept until armed again
    uint32_t watchdog_samples, stuck_samples;
    uint32_t silent_samples;         ///< since the last sign of life was seen
    uint32_t still_samples;          ///< in a row, unmoved under torque
    volatile uint32_t signs_of_life; ///< written by guard_alive() only
    uint32_t signs_seen;
    struct {
        uint32_t trips;
        uint32_t torque_clipped; ///< samples, a limit and not a fault
    } count;
};

/// Read-only for the application.
struct guard {
    struct guard_state state;
    struct guard_limits limits;
    int32_t trip_value;    ///< what broke the limit: position, velocity, torque, silent samples; 0 for the sensor
    int32_t last_position; ///< for the stuck check
};

/// Sets up an idle guard; it has to be armed before anything may move.
/// Errors: core_err_argument, core_err_guard_travel, _velocity, _torque, _stuck; self untouched then
/// Test:   tests/unit/test_guard.c
enum core_status guard_init(struct guard *self, const struct guard_limits *limits);

/// Arms, or arms again after a trip, if the axis is inside its limits now; clears the cause and the watchdog.
/// Errors: core_err_guard_outside: not armed (see the table of states)
enum core_status guard_arm(struct guard *self, const struct guard_sample *now);

/// Checks one sample, in the order sensor, travel, speed, watchdog, stuck; the first that fails is the cause.
/// Cost: a few compares, integer only; interrupt-safe
enum guard_action guard_step(struct guard *self, const struct guard_sample *sample);

/// Clips a torque command to +-torque_max and counts the samples clipped. In every state.
int32_t guard_clip_torque(struct guard *self, int32_t torque);

/// The host's sign of life; may interrupt or be interrupted by the sample path. One caller.
void guard_alive(struct guard_state *state);

/// One word for a person; never NULL.
const char *guard_cause_str(enum guard_cause cause);

#ifdef __cplusplus
}
#endif

#endif
