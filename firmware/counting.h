/* SPDX-License-Identifier: MIT */
/// What the counting program's files share.
#ifndef SERVOSCOPE_FIRMWARE_COUNTING_H
#define SERVOSCOPE_FIRMWARE_COUNTING_H

#include "core/status.h"
#include "firmware/board.h"

#include <stdint.h>

extern uint32_t counting_overhead; ///< of reading the counter twice

/// Measures it; before all else.
void counting_calibrate(void);

/// Instructions since board_instructions() gave `begin`, without the overhead. Part of its caller, or its own call
/// would be counted.
static inline uint32_t counting_since(uint32_t begin)
{
    uint32_t all = board_instructions() - begin;
    return all > counting_overhead ? all - counting_overhead : 0;
}

void counting_keep_most(uint32_t *io_most, uint32_t value);

/// A line of output: name, space, value.
void counting_print(const char *name, uint32_t value);

/// Ends the program with the status as text unless it is core_ok.
void counting_require(enum core_status status);

/// The DFTs of frf/dft.h, each number over each table: fed frame by frame, and in blocks.
void counting_exact(void);

#endif
