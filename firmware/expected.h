/* SPDX-License-Identifier: MIT */
/// What the host has come to on the same input. Two files give the two ends: expected_write.c, on the host, writes the
/// header that expected_check.c compares with, on the target.
#ifndef SERVOSCOPE_FIRMWARE_EXPECTED_H
#define SERVOSCOPE_FIRMWARE_EXPECTED_H

#include <stdbool.h>
#include <stdint.h>

/// The next result.
void expected_take(int64_t value);

/// After the last one: whether all were the same, and as many; says it.
bool expected_finish(void);

#endif
