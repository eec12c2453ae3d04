/* SPDX-License-Identifier: MIT */
/// What a counted program needs of the machine it runs on: QEMU's mps2-an386, or the host.
#ifndef SERVOSCOPE_BENCH_FIRMWARE_PORT_H
#define SERVOSCOPE_BENCH_FIRMWARE_PORT_H

#include <stdint.h>

/// Instructions since the start, modulo 2^32; 0 on the host. Differences are exact within 2.
uint32_t port_instructions(void);

void port_print(const char *text);
void port_print_number(uint32_t value);

#if defined(__GNUC__)
__attribute__((noreturn))
#endif
void port_exit(int status);

#endif
