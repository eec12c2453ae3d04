/* SPDX-License-Identifier: MIT */
#include "drivers/can/cia402_scaling.h"

#include <math.h>
#include <stddef.h>

static double power_of_ten(int8_t exponent)
{
    double power = 1.0; // exact up to 10^22
    for (int i = 0; i < (exponent < 0 ? -exponent : exponent); i++)
        power *= 10.0;
    return exponent < 0 ? 1.0 / power : power;
}

/// One unit of a numerator in SI; 0 for one that means nothing here.
static double numerator_si(uint8_t code)
{
    const double turn = 6.283185307179586;
    switch (code) {
    case cia402_unit_metre:
    case cia402_unit_radian:
        return 1.0;
    case cia402_unit_revolution:
        return turn;
    default:
        return 0.0;
    }
}

const char *cia402_scaling_read(const struct cia402_scaling_objects *objects, struct cia402_scaling *out_scaling)
{
    const double turn = 6.283185307179586;
    uint8_t position_code = (uint8_t)(objects->position_unit >> 16);
    double position_prefix = power_of_ten((int8_t)(uint8_t)(objects->position_unit >> 24));
    if (position_code == cia402_unit_increment) {
        if (objects->increments == 0 || objects->revolutions == 0)
            return "encoder resolution (608F) is zero";
        out_scaling->position = position_prefix * turn * (double)objects->revolutions / (double)objects->increments;
    } else {
        out_scaling->position = position_prefix * numerator_si(position_code);
    }
    if (!(out_scaling->position > 0.0))
        return "position unit (60A8) is none of increment, radian, revolution, metre";
    out_scaling->linear = position_code == cia402_unit_metre;

    uint8_t velocity_code = (uint8_t)(objects->velocity_unit >> 16);
    uint8_t per = (uint8_t)(objects->velocity_unit >> 8);
    double seconds = per == cia402_unit_second ? 1.0 : per == cia402_unit_minute ? 60.0 : 0.0;
    out_scaling->velocity = power_of_ten((int8_t)(uint8_t)(objects->velocity_unit >> 24)) * numerator_si(velocity_code);
    if (!(out_scaling->velocity > 0.0) || seconds == 0.0)
        return "velocity unit (60A9) is none of radian, revolution, metre per second or minute";
    if (out_scaling->linear != (velocity_code == cia402_unit_metre))
        return "position unit (60A8) and velocity unit (60A9) are one linear, one rotary";
    out_scaling->velocity /= seconds;

    if (objects->rated_torque == 0)
        return "rated torque (6076) is zero";
    double units = objects->torque_units == 0 ? 1000.0 : objects->torque_units;
    out_scaling->torque = (double)objects->rated_torque / (1e3 * units);
    return NULL;
}

int32_t cia402_to_units(double value, double unit, int32_t minimum, int32_t maximum, uint32_t *io_saturated)
{
    double units = round(value / unit);
    if (units >= (double)minimum && units <= (double)maximum)
        return (int32_t)units;
    (*io_saturated)++;
    return units > (double)maximum ? maximum : units < (double)minimum ? minimum : 0;
}
