/* SPDX-License-Identifier: MIT */
/// CRC-32 of IEEE 802.3 (zlib's, PNG's): reflected polynomial 0xEDB88320, start and final value inverted.
/// Detects every burst of up to 32 bits, so every damaged byte.
#ifndef SERVOSCOPE_CORE_CRC32_H
#define SERVOSCOPE_CORE_CRC32_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/// CRC-32 of the bytes before and these: pass 0 for the first piece, the last result for each next one.
/// crc32(a b) = core_crc32(core_crc32(0, a), b); check value of "123456789" is 0xCBF43926.
/// Cost: two table steps a byte, 64 bytes of table; interrupt-safe, re-entrant.
/// Test: tests/unit/test_crc.c
uint32_t core_crc32(uint32_t crc, const void *data, size_t size);

#ifdef __cplusplus
}
#endif

#endif
