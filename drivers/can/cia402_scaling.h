/* SPDX-License-Identifier: MIT */
/// From a drive's own units to SI and back, by what its objects declare. Both halves use the same few lines, so that a
/// value means the same on both sides to the last bit.
#ifndef SERVOSCOPE_DRIVERS_CAN_CIA402_SCALING_H
#define SERVOSCOPE_DRIVERS_CAN_CIA402_SCALING_H

#include <stdbool.h>
#include <stdint.h>

/// Unit codes in objects 60A8 and 60A9: prefix (power of ten) << 24 | numerator << 16 | denominator << 8.
enum cia402_unit {
    cia402_unit_metre = 0x01,
    cia402_unit_second = 0x03,
    cia402_unit_radian = 0x10,
    cia402_unit_minute = 0x47,
    cia402_unit_revolution = 0xB4,
    cia402_unit_increment = 0xB5,
};

#define CIA402_UNIT(prefix, numerator, denominator)                                                                    \
    ((uint32_t)(uint8_t)(int8_t)(prefix) << 24 | (uint32_t)(numerator) << 16 | (uint32_t)(denominator) << 8)

/// What the drive says.
struct cia402_scaling_objects {
    uint32_t increments, revolutions;      ///< 608F:1, :2; used if the position unit is the increment
    uint32_t position_unit, velocity_unit; ///< 60A8, 60A9
    uint32_t rated_torque;                 ///< 6076, mNm, or mN of a drive whose position unit is the metre
    uint32_t torque_units;                 ///< that torque objects have in one rated torque; 0: 1000 (permille)
};

/// One unit of each kind of object in SI: rad, rad/s and Nm, or m, m/s and N.
struct cia402_scaling {
    double position, velocity, torque;
    bool linear;
};

/// Reads the units; NULL, or what is missing or inconsistent as one clause.
/// Equation: position 2 pi revolutions / increments or the SI unit; velocity the SI unit; torque 6076 / 1000 / torque
///           units
const char *cia402_scaling_read(const struct cia402_scaling_objects *objects, struct cia402_scaling *out_scaling);

/// value / unit, rounded to the nearest whole number (halves away from zero), clipped to minimum..maximum.
/// A clip is counted in *io_saturated; NaN counts as one and becomes 0.
int32_t cia402_to_units(double value, double unit, int32_t minimum, int32_t maximum, uint32_t *io_saturated);

#endif
