/* SPDX-License-Identifier: MIT */
/// What makes of CiA 402 drives do differently, one file per make in drivers/can/profiles. A profile is chosen by name
/// or by the drive's own identity (object 1018); without either it is `generic`, which is CiA 402 as written.
/// To teach a make: add drivers/can/profiles/NAME.c that defines `const struct cia402_profile cia402_profile_NAME`.
#ifndef SERVOSCOPE_DRIVERS_CAN_CIA402_PROFILE_H
#define SERVOSCOPE_DRIVERS_CAN_CIA402_PROFILE_H

#include "drivers/can/cia402_scaling.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct cia402_profile {
    const char *name;   ///< as in ?profile=NAME; that of its file
    const char *make;   ///< for a person
    const char *source; ///< where the numbers are from
    uint32_t vendor;    ///< 1018:1 that chooses this profile
    uint32_t product;   ///< 1018:2, 0: any; both 0: chosen by name only
    /// 60C2 takes units_min .. units_max times 10^exponent s with an exponent from exponent_min to exponent_max.
    int8_t exponent_min, exponent_max;
    uint8_t units_min, units_max;
    /// Shortest and longest period between two SYNCs, and what all of them are a multiple of; 0: no limit of this kind.
    uint32_t period_min_us, period_max_us, period_step_us;
    /// Torque objects (6071, 6072, 6074, 6077, 60B2) count this much of the rated torque 6076: 1000 is permille.
    uint32_t torque_units_per_rated;
    /// Units of a drive that has no objects of its own for them; 0 where it has to have them.
    struct cia402_scaling_objects units;
    bool has_sync_timeout; ///< object 2003:1 is a SYNC time-out in us apart from the period; never written otherwise
    bool no_feedforward;   ///< CSP takes no 60B1 and 60B2: no cascade
};

/// All of them, NULL at the end.
extern const struct cia402_profile *const cia402_profiles[];

extern const struct cia402_profile cia402_profile_generic;

/// NULL if there is none of this name.
const struct cia402_profile *cia402_profile_find(const char *name);

/// By 1018: vendor and product, else vendor, else generic. Never NULL.
const struct cia402_profile *cia402_profile_identify(uint32_t vendor, uint32_t product);

/// How object 60C2 says a rate to this make; false, with the arithmetic as one line, if it cannot.
/// Range: the rate 0 < rate_hz <= 20000
bool cia402_profile_period(const struct cia402_profile *self, double rate_hz, uint8_t *out_units, int8_t *out_exponent,
                           char *out_text, size_t text_size);

#endif
