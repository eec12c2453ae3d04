/* SPDX-License-Identifier: MIT */
#include "lab/estimate/setup.h"

#include "lab/estimate/method.h"
#include "lab/numeric/cmplx.h"

#include <complex.h>
#include <string.h>

static const double two_pi = 6.283185307179586476925;

static const char *const hold_names[] = {[setup_zoh] = "zoh", [setup_band_limited] = "band-limited"};

const char *setup_hold_str(enum setup_hold hold)
{
    return hold_names[hold];
}

int setup_hold_parse(const char *text, enum setup_hold *out_hold, struct error *out_error)
{
    for (int hold = setup_zoh; hold <= setup_band_limited; hold++) {
        if (strcmp(text, hold_names[hold]) == 0) {
            *out_hold = (enum setup_hold)hold;
            return 0;
        }
    }
    return error_set(out_error, error_usage,
                     "--hold: '%s', expected zoh (the input stays between samples) or band-limited (it is measured "
                     "behind an anti-alias filter)",
                     text);
}

static bool begins(const char *name, const char *start)
{
    return strncmp(name, start, strlen(start)) == 0;
}

const char *setup_actuator(const char *input)
{
    static const char *const measured[] = {"torque_", "force_", "current_"};
    if (strstr(input, "_ref_") || begins(input, "voltage_")) {
        return "included";
    }
    for (size_t i = 0; i < sizeof measured / sizeof measured[0]; i++) {
        if (begins(input, measured[i])) {
            return "not included";
        }
    }
    return "unknown";
}

void setup_remove_delay(struct frf *io_frf, double delay_s)
{
    for (size_t line = 0; line < io_frf->count; line++) {
        const double complex response = CMPLX(io_frf->real[line], io_frf->imag[line]);
        const double complex turned = response * cexp(I * two_pi * io_frf->frequency_hz[line] * delay_s);
        io_frf->real[line] = creal(turned);
        io_frf->imag[line] = cimag(turned);
    }
}

bool setup_set_keys(struct frf *io_frf, enum setup_hold hold, double delay_s)
{
    return estimate_set_key(io_frf, "hold", "%s", setup_hold_str(hold)) &&
           estimate_set_key(io_frf, "actuator", "%s", setup_actuator(io_frf->input ? io_frf->input : "")) &&
           (delay_s == 0.0 || estimate_set_key(io_frf, "delay_removed_s", "%.9g", delay_s));
}
