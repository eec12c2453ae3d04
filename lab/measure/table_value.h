/* SPDX-License-Identifier: MIT */
/// A table's samples in SI units, whatever its number format.
#ifndef SERVOSCOPE_MEASURE_TABLE_VALUE_H
#define SERVOSCOPE_MEASURE_TABLE_VALUE_H

#include "msgen/table.h"

#include <stdint.h>

/// SI units per count of a channel.
double table_value_scale(const struct msgen_table *table, uint32_t channel);

/// One sample; n < period_samples, channel < channels.
double table_value_at(const struct msgen_table *table, uint32_t n, uint32_t channel);

double table_value_rate_hz(const struct msgen_table *table);

/// Largest absolute value of a channel.
double table_value_peak(const struct msgen_table *table, uint32_t channel);

#endif
