/* SPDX-License-Identifier: MIT */
/// From spectra that a drive has computed to a response file.
#ifndef SERVOSCOPE_TOOLS_MODBUS_RESPONSE_H
#define SERVOSCOPE_TOOLS_MODBUS_RESPONSE_H

#include "drivers/modbus/register_map.h"
#include "lab/measure/measure.h"
#include "lab/record/error.h"
#include "tools/servoscope/command.h"

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

struct modbus_response {
    const struct measure_plan *plan;
    uint32_t *bins;
    size_t bin_count;
    double complex *input, *output; ///< periods x bin_count, as sums over a period
    size_t periods;                 ///< read
    size_t unread;                  ///< the drive has gone over them before they were read
    size_t left_out;                ///< the drive says that they do not count
    struct modbus_record *means;    ///< over all periods that count; NULL: not read
    size_t mean_periods;
};

struct modbus_response_facts {
    const char *out, *drive;
    const char *stopped_by; ///< NULL: complete
    uint32_t torque_clipped;
    uint32_t requests, repeated, stale;
};

/// Makes room for all periods of the plan. Errors: false if memory is short; free it all the same.
bool modbus_response_begin(struct modbus_response *self, const struct measure_plan *plan);

/// Keeps one period.
void modbus_response_add(struct modbus_response *self, const struct modbus_record *records);

/// Keeps the means that the drive has formed.
void modbus_response_set_means(struct modbus_response *self, const struct modbus_record *records, size_t periods);

/// Writes the response and says what was written: from the single periods if all that count were read (as `frf` from a
/// run), else from the drive's means and variances.
/// Errors: error_refused with the reason
int modbus_response_write(const struct modbus_response *self, const struct modbus_response_facts *facts,
                          const struct command_context *context, struct error *out_error);

void modbus_response_free(struct modbus_response *self);

#endif
