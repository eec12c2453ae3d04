/* SPDX-License-Identifier: MIT */
/// The guard of guard/guard.h in SI units, for hosts and for parts with an FPU: the same states, causes and order. NaN
/// and infinity fail every check; a torque command that is not a number is clipped to 0.
#ifndef SERVOSCOPE_GUARD_GUARD_REAL_H
#define SERVOSCOPE_GUARD_GUARD_REAL_H

#include "core/real.h"
#include "guard/guard.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Limits in SI units (linear axes: m, m/s, N). What is not wanted: -CORE_REAL_MAX and CORE_REAL_MAX, durations 0;
/// GUARD_REAL_LIMITS_NONE has them all. Even then a value has to be finite.
struct guard_real_limits {
    core_real position_min_rad, position_max_rad; ///< position_min_rad < position_max_rad
    core_real velocity_max_rad_per_s;             ///< > 0
    core_real torque_max_Nm;                      ///< > 0
    uint32_t watchdog_samples;                    ///< as in struct guard_limits
    uint32_t stuck_samples;
    core_real stuck_torque_Nm; ///< > 0 if stuck_samples is
};

#define GUARD_REAL_LIMITS_NONE                                                                                         \
    {                                                                                                                  \
        -CORE_REAL_MAX, CORE_REAL_MAX, CORE_REAL_MAX, CORE_REAL_MAX, 0, 0, 0                                           \
    }

struct guard_real_sample {
    core_real position_rad, velocity_rad_per_s, torque_Nm;
    bool valid; ///< false: sensor or transmission says that the values are not to be trusted
};

/// Read-only for the application.
struct guard_real {
    struct guard_state state;
    struct guard_real_limits limits;
    core_real trip_value; ///< what broke the limit; may be infinite or NaN where that was the reason
    core_real last_position_rad;
};

/// As the functions of the same name in guard/guard.h; guard_alive(&self->state) is the sign of life.
enum core_status guard_real_init(struct guard_real *self, const struct guard_real_limits *limits);
enum core_status guard_real_arm(struct guard_real *self, const struct guard_real_sample *now);
enum guard_action guard_real_step(struct guard_real *self, const struct guard_real_sample *sample);
core_real guard_real_clip_torque(struct guard_real *self, core_real torque_Nm);

#ifdef __cplusplus
}
#endif

#endif
