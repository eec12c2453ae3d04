/* SPDX-License-Identifier: MIT */
#include "lab/tune/plant.h"

#include "lab/estimate/circle.h"
#include "lab/estimate/setup.h"
#include "lab/record/number.h"
#include "lab/tune/hold.h"

#include <math.h>
#include <stdarg.h>
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

static const char *find_key(const struct frf *frf, const char *key)
{
    for (size_t i = 0; i < frf->key_count; i++) {
        if (strcmp(frf->keys[i].key, key) == 0) {
            return frf->keys[i].value;
        }
    }
    return NULL;
}

/// The number behind a key; untouched where the file does not have it.
static int find_number(const char *path, const struct frf *frf, const char *key, const char *expected, bool positive,
                       double *io_value, struct error *out_error)
{
    const char *value = find_key(frf, key);
    if (value && (number_parse(value, strlen(value), io_value) != number_ok || (positive && !(*io_value > 0.0)))) {
        return error_set(out_error, error_refused, "%s: %s: '%.60s', expected %s", path, key, value, expected);
    }
    return 0;
}

/// The rate the controller is to run at, and the one that the response was measured at.
static int find_rates(const char *path, const struct frf *frf, double rate_hz, struct tune_plant *io_plant,
                      struct error *out_error)
{
    int status =
        find_number(path, frf, "sample_rate_hz", "a number above 0", true, &io_plant->response_rate_hz, out_error);
    io_plant->rate_hz = rate_hz > 0.0 ? rate_hz : io_plant->response_rate_hz;
    if (!status && !(io_plant->rate_hz > 0.0)) {
        status = error_set(out_error, error_usage,
                           "%s has no key sample_rate_hz: expected --rate HZ, the controller's rate", path);
    }
    return status;
}

static int find_hold(const char *path, const struct frf *frf, struct tune_plant *io_plant, struct error *out_error)
{
    const char *hold = find_key(frf, "hold");
    io_plant->band_limited = hold && strcmp(hold, setup_hold_str(setup_band_limited)) == 0;
    if (hold && !io_plant->band_limited && strcmp(hold, setup_hold_str(setup_zoh)) != 0) {
        return error_set(out_error, error_refused, "%s: hold: '%.60s', expected zoh or band-limited", path, hold);
    }
    return 0;
}

static bool allocate(struct tune_plant *io_plant, size_t count)
{
    io_plant->frequency_hz = calloc(count + 1, sizeof *io_plant->frequency_hz);
    io_plant->response = calloc(count + 1, sizeof *io_plant->response);
    io_plant->std = calloc(count + 1, sizeof *io_plant->std);
    io_plant->doubt = calloc(count + 1, sizeof *io_plant->doubt);
    io_plant->delay = calloc(count + 1, sizeof *io_plant->delay);
    io_plant->left_out_hz = calloc(count + 1, sizeof *io_plant->left_out_hz);
    return io_plant->frequency_hz && io_plant->response && io_plant->std && io_plant->doubt && io_plant->delay &&
           io_plant->left_out_hz;
}

/// Takes the valid lines as they are, those from half the controller's rate on too.
static void take_lines(const struct frf *frf, double removed_s, struct tune_plant *io_plant)
{
    for (size_t line = 0; line < frf->count; line++) {
        const double frequency_hz = frf->frequency_hz[line];
        const double complex response = frf->real[line] + frf->imag[line] * I;
        if (!(frequency_hz > 0.0)) {
            io_plant->skipped++;
        } else if (!frf->valid[line] || !(cabs(response) > 0.0)) {
            io_plant->skipped++;
            if (frequency_hz < 0.5 * io_plant->rate_hz) {
                io_plant->left_out_hz[io_plant->left_out++] = frequency_hz;
            }
        } else {
            const size_t k = io_plant->count++;
            const bool known = frf->std && frf_known(frf->std[line]);
            io_plant->frequency_hz[k] = frequency_hz;
            io_plant->response[k] = response * cexp(-I * two_pi * frequency_hz * removed_s);
            io_plant->std[k] = known ? frf->std[line] : 0.0;
            io_plant->std_known = io_plant->std_known || known;
        }
    }
}

/// Nothing is measured above half the rate it is sampled at: such frequencies are in other units, or the rate is.
static int check_frequencies(const char *path, const struct tune_plant *plant, struct error *out_error)
{
    const double most_hz = 0.5 * plant->response_rate_hz * (1.0 + HOLD_SAME_RATE);
    const double last_hz = plant->count > 0 ? plant->frequency_hz[plant->count - 1] : 0.0;
    if (!(plant->response_rate_hz > 0.0) || last_hz <= most_hz) {
        return 0;
    }
    return error_set(out_error, error_refused,
                     "%s: a line at %.6g Hz, expected at most %.6g Hz, half of the file's sample_rate_hz (is "
                     "frequency_hz in rad/s?)",
                     path, last_hz, 0.5 * plant->response_rate_hz);
}

/// Lines from half the rate on have served.
static void keep_lines(const struct frf *frf, double loop_delay_s, struct tune_plant *io_plant)
{
    while (io_plant->count > 0 && !(io_plant->frequency_hz[io_plant->count - 1] < 0.5 * io_plant->rate_hz)) {
        io_plant->count--;
        io_plant->skipped++;
    }
    for (size_t k = 0; k < io_plant->count; k++) {
        const double frequency_hz = io_plant->frequency_hz[k];
        io_plant->delay[k] = cexp(-I * two_pi * frequency_hz / io_plant->rate_hz);
        io_plant->response[k] *= cexp(-I * two_pi * frequency_hz * loop_delay_s);
        io_plant->std_unknown += !(io_plant->std[k] > 0.0);
    }
    // Real degrees of freedom come in pairs; without the key the standard deviations are taken as exact.
    const double exact = 1e6;
    const double dof = frf->degrees_of_freedom > 0.0 ? frf->degrees_of_freedom / 2.0 : exact;
    io_plant->confidence_factor = circle_confidence_factor(0.95, dof);
}

#if defined(__GNUC__)
__attribute__((format(printf, 2, 3)))
#endif
static void
add_reason(struct tune_plant *io_plant, const char *format, ...)
{
    const size_t used = strlen(io_plant->doubt_from);
    va_list arguments;
    va_start(arguments, format);
    snprintf(io_plant->doubt_from + used, tune_doubt_size - used, "%s", used ? ", " : "");
    vsnprintf(io_plant->doubt_from + strlen(io_plant->doubt_from), tune_doubt_size - strlen(io_plant->doubt_from),
              format, arguments);
    va_end(arguments);
}

/// What the file says of its response beyond standard deviations, where it has a figure.
static int add_doubts(const char *path, const struct frf *frf, struct tune_plant *io_plant, struct error *out_error)
{
    double other_db = -INFINITY, repetition = 0.0;
    const bool others = find_key(frf, "warning_inputs"), repeats = find_key(frf, "warning_repetition");
    int status =
        others ? find_number(path, frf, "other_inputs_db", "a number of decibel", false, &other_db, out_error) : 0;
    if (!status && repeats) {
        status = find_number(path, frf, "repetition_level", "a number above 0", true, &repetition, out_error);
    }
    const double other = pow(10.0, other_db / 20.0);
    if (other > 0.0) {
        add_reason(io_plant, "another input is up to %.2g times as strong on a line (warning_inputs)", other);
    }
    if (repetition > 0.0) {
        add_reason(io_plant, "%.2g of the response does not repeat from period to period (warning_repetition)",
                   repetition);
    }
    for (size_t k = 0; k < io_plant->count && !status; k++) {
        io_plant->doubt[k] += (other + repetition) * cabs(io_plant->response[k]);
    }
    return status;
}

static bool carry_over(struct tune_plant *io_plant)
{
    const bool band_limited = io_plant->band_limited;
    const double file_rate_hz = io_plant->response_rate_hz;
    const bool same = !(file_rate_hz > 0.0) || fabs(file_rate_hz / io_plant->rate_hz - 1.0) < HOLD_SAME_RATE;
    if (same && !band_limited) {
        return true;
    }
    add_reason(io_plant,
               "the response was measured %s, and what the controller's samples at %.6g Hz fold onto its "
               "lines is known in part",
               band_limited ? "without a hold" : "with another hold", io_plant->rate_hz);
    return hold_carry(io_plant);
}

static int fill_in(const char *path, const struct frf *frf, double removed_s, double loop_delay_s,
                   struct tune_plant *io_plant, struct error *out_error)
{
    int status = find_hold(path, frf, io_plant, out_error);
    if (status) {
        return status;
    }
    if (!allocate(io_plant, frf->count)) {
        return error_set(out_error, error_refused, "%s: memory is short", path);
    }
    take_lines(frf, removed_s, io_plant);
    status = check_frequencies(path, io_plant, out_error);
    status = status ? status : add_doubts(path, frf, io_plant, out_error);
    if (!status && !carry_over(io_plant)) {
        status = error_set(out_error, error_refused, "%s: memory is short", path);
    }
    if (status) {
        return status;
    }
    keep_lines(frf, loop_delay_s, io_plant);
    if (io_plant->count < lines_least) {
        return error_set(out_error, error_refused,
                         "%s: %zu of %zu lines are valid, above 0 Hz and below %.6g Hz (half the rate): expected at "
                         "least %d",
                         path, io_plant->count, frf->count, 0.5 * io_plant->rate_hz, (int)lines_least);
    }
    return 0;
}

int tune_plant_take(const char *path, const struct frf *frf, double rate_hz, double loop_delay_s,
                    struct tune_plant *out_plant, struct error *out_error)
{
    double removed_s = 0.0;
    *out_plant = (struct tune_plant){0};
    int status = find_number(path, frf, "delay_removed_s", "a number of seconds", false, &removed_s, out_error);
    out_plant->loop_delay_s = loop_delay_s + removed_s;
    out_plant->delay_removed_s = removed_s;
    status = status ? status : find_units(path, frf, out_plant, out_error);
    status = status ? status : find_rates(path, frf, rate_hz, out_plant, out_error);
    status = status ? status : fill_in(path, frf, removed_s, loop_delay_s, out_plant, out_error);
    if (status) {
        tune_plant_free(out_plant);
    }
    return status;
}

double tune_plant_known_turn(const struct tune_plant *self, double from_hz, double to_hz)
{
    return -two_pi * (to_hz - from_hz) * self->loop_delay_s;
}

void tune_plant_free(struct tune_plant *self)
{
    free(self->frequency_hz);
    free(self->response);
    free(self->std);
    free(self->doubt);
    free(self->delay);
    free(self->left_out_hz);
    *self = (struct tune_plant){0};
}

/// The first valid line above a frequency; infinity if there is none.
static double next_line_hz(const struct tune_plant *plant, double above_hz)
{
    for (size_t k = 0; k < plant->count; k++) {
        if (plant->frequency_hz[k] > above_hz) {
            return plant->frequency_hz[k];
        }
    }
    return INFINITY;
}

/// The last of the lines left out from `first` on that have no valid line between them.
static size_t stretch_end(const struct tune_plant *plant, size_t first, size_t end)
{
    const double next_hz = next_line_hz(plant, plant->left_out_hz[first]);
    size_t last = first;
    while (last + 1 < end && plant->left_out_hz[last + 1] < next_hz) {
        last++;
    }
    return last;
}

void tune_plant_name_left_out(const struct tune_plant *self, double above_hz, double below_hz, size_t size,
                              char *out_text)
{
    enum { stretches_most = 4 };
    size_t first = 0, end = self->left_out;
    while (first < end && !(self->left_out_hz[first] > above_hz)) {
        first++;
    }
    while (end > first && !(self->left_out_hz[end - 1] < below_hz)) {
        end--;
    }
    out_text[0] = '\0';
    if (first == end) {
        return;
    }
    size_t used = (size_t)snprintf(out_text, size, "%zu line%s at", end - first, end - first > 1 ? "s" : "");
    for (size_t stretch = 0; first < end && stretch < stretches_most && used < size; stretch++) {
        const size_t last = stretch_end(self, first, end);
        used += (size_t)snprintf(out_text + used, size - used, last > first ? "%s %.4g..%.4g" : "%s %.4g",
                                 stretch > 0 ? "," : "", self->left_out_hz[first], self->left_out_hz[last]);
        first = last + 1;
    }
    if (used < size) {
        snprintf(out_text + used, size - used, first < end ? " Hz and elsewhere" : " Hz");
    }
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
