/* SPDX-License-Identifier: MIT */
/// What the example needs of the machine it runs on: a Cortex-M board under QEMU, or the host.
#ifndef SERVOSCOPE_FIRMWARE_BOARD_H
#define SERVOSCOPE_FIRMWARE_BOARD_H

#include <stdbool.h>
#include <stdint.h>

/// Calls `interrupt` at rate_hz from now on, from an interrupt; on the host once per board_wait().
void board_start_samples(uint32_t rate_hz, void (*interrupt)(void));

/// Waits for the next interrupt.
void board_wait(void);

/// Whether the next sample's interrupt is already waiting: asked at the end of one, it says that this one took longer
/// than a sampling period.
bool board_is_late(void);

/// Starts the counter of instructions.
void board_start_counter(void);

/// Instructions since board_start_counter(), modulo 2^32; 0 where nothing counts. Differences are exact within 2.
uint32_t board_instructions(void);

void board_print(const char *text);

#if defined(__GNUC__)
__attribute__((noreturn))
#endif
void board_exit(int status);

#endif
