/* SPDX-License-Identifier: MIT */
#include "lab/tune/plant.h"

#include "lab/estimate/circle.h"
#include "lab/record/number.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double two_pi = 6.283185307179586;

enum { lines_least = 8 };

static bool ends_in(const char *name, const char *unit)
{
    const size_t length = strlen(name), unit_length = strlen(unit);
    return length > unit_length + 1 && name[length - unit_length - 1] == '_' &&
           strcmp(name + length - unit_length, unit) == 0;
}

static int find_units(const char *path, const struct frf *frf, struct tune_plant *io_plant, struct error *out_error)
{
    static const char *const efforts[] = {"Nm", "N", "A", "V"};
    static const struct {
        const char *unit, *length;
        enum tune_output output;
    } outputs[] = {{"rad_per_s", "rad", tune_output_velocity},
                   {"m_per_s", "m", tune_output_velocity},
                   {"rad", "rad", tune_output_position},
                   {"m", "m", tune_output_position}};
    const char *input = frf->input ? frf->input : "", *output = frf->output ? frf->output : "";
    for (size_t i = 0; i < sizeof efforts / sizeof *efforts && !io_plant->effort_unit; i++) {
        io_plant->effort_unit = ends_in(input, efforts[i]) ? efforts[i] : NULL;
    }
    for (size_t i = 0; i < sizeof outputs / sizeof *outputs && !io_plant->length_unit; i++) {
        if (ends_in(output, outputs[i].unit)) {
            io_plant->length_unit = outputs[i].length;
            io_plant->output = outputs[i].output;
        }
    }
    if (io_plant->effort_unit && io_plant->length_unit) {
        return 0;
    }
    return error_set(out_error, error_refused,
                     "%s: from '%s' to '%s': expected a response from torque, force, current or voltage (_Nm, _N, _A, "
                     "_V) to velocity or position (_rad_per_s, _m_per_s, _rad, _m), named by the keys input and output",
                     path, input, output);
}

/// The number behind a key; untouched where the file does not have it.
static int find_number(const char *path, const struct frf *frf, const char *key, const char *expected, bool positive,
                       double *io_value, struct error *out_error)
{
    for (size_t i = 0; i < frf->key_count; i++) {
        const char *value = frf->keys[i].value;
        if (strcmp(frf->keys[i].key, key) == 0 &&
            (number_parse(value, strlen(value), io_value) != number_ok || (positive && !(*io_value > 0.0)))) {
            return error_set(out_error, error_refused, "%s: %s: '%.60s', expected %s", path, key, value, expected);
        }
    }
    return 0;
}

/// The rate the controller is to run at.
static int find_rate(const char *path, const struct frf *frf, double rate_hz, double *out_rate_hz,
                     struct error *out_error)
{
    *out_rate_hz = rate_hz;
    if (!(rate_hz > 0.0) &&
        find_number(path, frf, "sample_rate_hz", "a number above 0", true, out_rate_hz, out_error)) {
        return error_refused;
    }
    if (*out_rate_hz > 0.0) {
        return 0;
    }
    return error_set(out_error, error_usage, "%s has no key sample_rate_hz: expected --rate HZ, the controller's rate",
                     path);
}

static bool allocate(struct tune_plant *io_plant, size_t count)
{
    io_plant->frequency_hz = calloc(count + 1, sizeof *io_plant->frequency_hz);
    io_plant->response = calloc(count + 1, sizeof *io_plant->response);
    io_plant->std = calloc(count + 1, sizeof *io_plant->std);
    io_plant->delay = calloc(count + 1, sizeof *io_plant->delay);
    return io_plant->frequency_hz && io_plant->response && io_plant->std && io_plant->delay;
}

static void take_lines(const struct frf *frf, struct tune_plant *io_plant)
{
    for (size_t line = 0; line < frf->count; line++) {
        const double frequency_hz = frf->frequency_hz[line];
        const double complex response = frf->real[line] + frf->imag[line] * I;
        if (!frf->valid[line] || !(frequency_hz > 0.0) || !(frequency_hz < 0.5 * io_plant->rate_hz) ||
            !(cabs(response) > 0.0)) {
            io_plant->skipped++;
            continue;
        }
        const size_t k = io_plant->count++;
        const bool known = frf->std && frf_known(frf->std[line]);
        io_plant->frequency_hz[k] = frequency_hz;
        io_plant->delay[k] = cexp(-I * two_pi * frequency_hz / io_plant->rate_hz);
        io_plant->response[k] = response * cexp(-I * two_pi * frequency_hz * io_plant->loop_delay_s);
        io_plant->std[k] = known ? frf->std[line] : 0.0;
        io_plant->std_known = io_plant->std_known || known;
    }
}

int tune_plant_take(const char *path, const struct frf *frf, double rate_hz, double loop_delay_s,
                    struct tune_plant *out_plant, struct error *out_error)
{
    double removed_s = 0.0;
    *out_plant = (struct tune_plant){0};
    int status = find_number(path, frf, "delay_removed_s", "a number of seconds", false, &removed_s, out_error);
    out_plant->loop_delay_s = loop_delay_s + removed_s;
    status = status ? status : find_units(path, frf, out_plant, out_error);
    status = status ? status : find_rate(path, frf, rate_hz, &out_plant->rate_hz, out_error);
    if (!status && !allocate(out_plant, frf->count)) {
        status = error_set(out_error, error_refused, "%s: memory is short", path);
    }
    if (!status) {
        // Real degrees of freedom come in pairs; without the key the standard deviations are taken as exact.
        const double exact = 1e6;
        const double dof = frf->degrees_of_freedom > 0.0 ? frf->degrees_of_freedom / 2.0 : exact;
        out_plant->confidence_factor = circle_confidence_factor(0.95, dof);
        take_lines(frf, out_plant);
        if (out_plant->count < lines_least) {
            status = error_set(out_error, error_refused,
                               "%s: %zu of %zu lines are valid, above 0 Hz and below %.6g Hz (half the rate): expected "
                               "at least %d",
                               path, out_plant->count, frf->count, 0.5 * out_plant->rate_hz, (int)lines_least);
        }
    }
    if (status) {
        tune_plant_free(out_plant);
    }
    return status;
}

void tune_plant_free(struct tune_plant *self)
{
    free(self->frequency_hz);
    free(self->response);
    free(self->std);
    free(self->delay);
    *self = (struct tune_plant){0};
}

void tune_plant_gain_unit(const struct tune_plant *self, int power, char out_suffix[tune_unit_size],
                          char out_readable[tune_unit_size])
{
    static const char *const suffixes[] = {"", "s", "s2"}, *const readables[] = {"", " s", " s^2"};
    // Effort over velocity is effort times seconds over length.
    const int seconds = power + (self->output == tune_output_velocity);
    const bool below = seconds < 0;
    const size_t above = below ? 0 : (size_t)seconds;
    snprintf(out_suffix, tune_unit_size, "%s%s_per_%s%s", self->effort_unit, suffixes[above], self->length_unit,
             below ? "_s" : "");
    snprintf(out_readable, tune_unit_size, "%s%s/%s%s%s", self->effort_unit, readables[above], below ? "(" : "",
             self->length_unit, below ? " s)" : "");
}
