/* SPDX-License-Identifier: MIT */
/// The host's side of the register map: the layer that makes an answer trustworthy, and what a measurement asks for.
///
/// A Modbus RTU reply does not say which request it answers, and libraries take a late one for the next
/// (docs/modbus.md, "Late replies"). So nothing is believed that does not prove itself:
///   state and setup   read together with a number that the same request has just written (NONCE)
///   a write of setup  read back with it
///   a command         its sequence number comes back in COMMAND_ACK, with its result
///   a spectrum        begins with the sequence number, period and first bin of the request
///   the table         its name, a CRC-32 over all of it, judged by the drive (VERIFY)
/// After any failure the link settles before the next attempt, and every request may be repeated. Each call makes at
/// most modbus_host_attempts attempts at each request.
#ifndef SERVOSCOPE_DRIVERS_MODBUS_HOST_H
#define SERVOSCOPE_DRIVERS_MODBUS_HOST_H

#include "drivers/modbus/link.h"
#include "drivers/modbus/register_map.h"

#include <stdbool.h>
#include <stddef.h>

enum { modbus_host_attempts = 3 };

enum modbus_host_status {
    modbus_host_ok = 0,
    modbus_host_no_reply = -1, ///< nothing usable came in all attempts
    modbus_host_lost = -2,     ///< the port or the connection is gone
    modbus_host_refused = -3,  ///< the drive answers with an exception or a result; `detail` says which
    modbus_host_identity = -4, ///< what answers is not a drive with this map
    modbus_host_argument = -5, ///< a table or setup that the drive says it cannot hold
    modbus_host_ended = -6,    ///< the caller wanted no more
};

struct modbus_host_identity {
    uint32_t chunk_words, bins_max, table_bytes_max, samples_max, periods_kept;
    bool linear;
};

/// Everything between NONCE and the end of the setup, read in one request.
struct modbus_host_state {
    enum modbus_state state;
    uint32_t acknowledged, result;
    enum modbus_end end;
    uint32_t faults, periods_done, periods_valid, samples_played, torque_clipped, cycles_max;
    float torque, position, velocity, trip_value;
    uint32_t table_name;
    float rate_hz;
    uint16_t setup[30]; ///< as on the wire
};

/// Read-only for the application.
struct modbus_host {
    const struct modbus_link *link;
    struct modbus_host_identity identity;
    uint16_t nonce, read_sequence;
    struct {
        uint32_t requests, repeated, stale, timeouts, damaged;
    } count;
    char detail[200]; ///< what went wrong last
};

/// What travels to the drive beside the table.
struct modbus_host_setup {
    uint32_t table_bytes, table_name;
    struct modbus_run_setup run;
};

/// Finds a drive with this map behind the link and reads its identity.
/// first_nonce: any number that differs from one program to the next
/// Errors: modbus_host_identity and all others
/// Test:   tests/fault/test_modbus_host.c
enum modbus_host_status modbus_host_open(struct modbus_host *self, const struct modbus_link *link,
                                         uint16_t first_nonce);

enum modbus_host_status modbus_host_read_state(struct modbus_host *self, struct modbus_host_state *out_state);

/// Gives a command and waits for its result. `command`: ARM and START get their key here.
enum modbus_host_status modbus_host_command(struct modbus_host *self, enum modbus_command command);

/// Writes the setup and reads it back.
enum modbus_host_status modbus_host_write_setup(struct modbus_host *self, const struct modbus_host_setup *setup);

/// Opens an upload, sends all bytes of a table (an even number), with its setup, and has the drive verify it.
/// progress: called after each chunk, false ends the upload (modbus_host_ended); NULL: nobody looks
enum modbus_host_status modbus_host_upload(struct modbus_host *self, const uint8_t *table,
                                           const struct modbus_host_setup *setup,
                                           bool (*progress)(void *context, size_t done, size_t total), void *context);

/// A snapshot of one period (from 0) or of MODBUS_MEAN.
struct modbus_host_spectrum {
    uint32_t validity; ///< enum modbus_validity; records hold nothing unless modbus_spectrum_valid
    uint32_t period, count, bins;
};

/// Reads all bins of a snapshot; out_records: bins_max of the identity.
enum modbus_host_status modbus_host_read_spectrum(struct modbus_host *self, uint32_t period, uint32_t bins,
                                                  struct modbus_record *out_records,
                                                  struct modbus_host_spectrum *out_spectrum);

const char *modbus_host_status_str(enum modbus_host_status status);

/// One line for a person: RESULT, END, FAULTS as text; never NULL.
const char *modbus_result_str(uint32_t result);
const char *modbus_state_str(uint32_t state);
const char *modbus_fault_str(uint32_t faults);

#endif
