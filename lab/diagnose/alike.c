/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/alike.h"

#include <math.h>
#include <string.h>

int alike_check(const struct run *run, const struct recording *r, const struct run *first_run,
                const struct recording *first, struct error *out_error)
{
    bool reference = r->block.torque_ref != NULL, first_reference = first->block.torque_ref != NULL;
    if ((r->input_unit == NULL) != (first->input_unit == NULL) ||
        (r->input_unit && strcmp(r->input_unit, first->input_unit) != 0))
        return error_set(out_error, error_refused, "%s: the input is in %s; %s: in %s: all runs have to be alike",
                         run->path, r->input_unit ? r->input_unit : "Nm or N", first_run->path,
                         first->input_unit ? first->input_unit : "Nm or N");
    if (r->rate_hz == first->rate_hz && r->linear == first->linear && reference == first_reference)
        return 0;
    return error_set(out_error, error_refused,
                     "%s: %g Hz, %s, %s torque reference; %s: %g Hz, %s, %s: all runs have to be alike", run->path,
                     r->rate_hz, r->linear ? "linear" : "rotary", reference ? "with" : "without", first_run->path,
                     first->rate_hz, first->linear ? "linear" : "rotary", first_reference ? "with" : "without");
}

bool alike_share_rate(const struct run *first, struct run *io_run)
{
    const double near = 1e-3, rounding = 1e-6;
    double off = fabs(io_run->sample_rate_hz / first->sample_rate_hz - 1.0);
    if (!(off <= near))
        return false;
    io_run->sample_rate_hz = first->sample_rate_hz;
    return off > rounding;
}
