/* SPDX-License-Identifier: MIT */
#include "lab/measure/table_value.h"

#include "core/bytes.h"

#include <math.h>

double table_value_rate_hz(const struct msgen_table *table)
{
    return (double)table->rate_num_hz / (double)table->rate_den;
}

double table_value_scale(const struct msgen_table *table, uint32_t channel)
{
    union core_float_bits scale = {.bits = table->scale_bits[channel]};
    return (double)scale.value;
}

double table_value_at(const struct msgen_table *table, uint32_t n, uint32_t channel)
{
    if (table->format == msgen_format_f32) {
        union core_float_bits sample = {.bits = msgen_table_float_bits(table, n, channel)};
        return (double)sample.value * table_value_scale(table, channel);
    }
    return (double)msgen_table_count(table, n, channel) * table_value_scale(table, channel);
}

double table_value_peak(const struct msgen_table *table, uint32_t channel)
{
    double peak = 0.0;
    for (uint32_t n = 0; n < table->period_samples; n++) {
        peak = fmax(peak, fabs(table_value_at(table, n, channel)));
    }
    return peak;
}
