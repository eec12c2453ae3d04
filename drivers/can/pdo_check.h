/* SPDX-License-Identifier: MIT */
/// End-to-end check of one SYNC cycle's process data. CAN's own CRC covers one frame on the wire, not that two frames
/// belong to the same SYNC, nor what a gateway or a driver does to them. A node that has objects 2001 and 2002 offers
/// this:
///   2001:1 the SYNC counter that a sample belongs to,          2001:2 check byte over all TPDO bytes of the cycle;
///   2002:1 the SYNC counter for which set-points are meant,    2002:2 check byte over all RPDO bytes of the cycle;
/// counter and check byte are mapped as the last two of the last PDO of their direction; the check covers all before
/// it, PDOs in the order of their number. The check byte lets one in 256 mixtures of old and new frames pass; so
/// whoever uses it also refuses a cycle in which one PDO came twice with different content. Standard drives have
/// neither object; their master then relies on arrival times alone.
#ifndef SERVOSCOPE_DRIVERS_CAN_PDO_CHECK_H
#define SERVOSCOPE_DRIVERS_CAN_PDO_CHECK_H

#include <stddef.h>
#include <stdint.h>

enum { pdo_check_sample_index = 0x2001, pdo_check_target_index = 0x2002, pdo_check_start = 0xFF };

/// Continues a check byte over `count` bytes; start with pdo_check_start.
/// Equation: CRC-8 with x^8 + x^4 + x^3 + x^2 + 1, most significant bit first. The polynomial is primitive: its period
///           of 255
///           bits covers a cycle's 128, which a polynomial with the factor x + 1 (period 127) does not.
/// Range:    finds every one- and two-bit error within 16 bytes, every burst of up to 8 bits, 255/256 of all others
/// Test:     tests/unit/test_pdo.c (all one- and two-bit errors)
uint8_t pdo_check(uint8_t check, const uint8_t *data, size_t count);

#endif
