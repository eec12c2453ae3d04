/* SPDX-License-Identifier: MIT */
/// Where a port is: "NAME:NUMBER".
#ifndef SERVOSCOPE_PORTS_PLACE_H
#define SERVOSCOPE_PORTS_PLACE_H

#include <stdbool.h>
#include <stddef.h>

/// Splits at the last colon; the number is decimal digits alone, below 10^9. An empty name is one.
bool place_split(const char *place, char *out_name, size_t name_size, long *out_number);

#endif
