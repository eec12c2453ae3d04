/* SPDX-License-Identifier: MIT */
/// A drive's object dictionary as an electronic data sheet (CiA 306, EDS), written from the tables that its SDO server
/// answers from: the two cannot differ.
#ifndef SERVOSCOPE_SIM_NODE_EDS_H
#define SERVOSCOPE_SIM_NODE_EDS_H

#include "drivers/can/canopen_node.h"

#include <stdbool.h>
#include <stdio.h>

/// Writes the sheet of a node that has just been made. Default values are those it has now, where they are the same in
/// every drive: of what can be written, of constants, and of the communication objects; a COB-ID that contains the
/// node's number is written as $NODEID+base.
/// Errors: false if the file could not be written
/// Test:   tests/cli/canopen_client.sh (a foreign client compares every entry with the answers)
bool eds_write(FILE *file, const struct canopen_node *node);

enum { eds_name_max = 64 };

/// What an object and its entries are called in CiA 301 and 402; others "Object 2345". `out_text` has eds_name_max
/// bytes.
void eds_object_name(uint16_t index, char *out_text);
void eds_entry_name(uint16_t index, uint8_t subindex, char *out_text);

#endif
