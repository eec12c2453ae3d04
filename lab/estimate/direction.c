/* SPDX-License-Identifier: MIT */
#include "lab/estimate/direction.h"

#include "lab/estimate/columns.h"

#include <complex.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double two_pi = 6.283185307179586476925;

/// Below this cosine two motions are opposite, whatever their sensors lag by.
static const double opposite = -0.7;
/// The same against the input, where a quarter turn is nothing unusual.
static const double opposite_to_input = -0.4;

enum { fewest_lines = 3 };

static const char *const motor_columns[] = {"velocity_rad_per_s", "velocity_m_per_s", "position_rad", "position_m"};
static const char *const load_columns[] = {"load_velocity_rad_per_s", "load_velocity_m_per_s", "load_position_rad",
                                           "load_position_m"};

enum { names = sizeof motor_columns / sizeof motor_columns[0] };

static double mean_of_period(const struct periodic *recording, const double *signal, size_t period)
{
    const size_t length = recording->period_samples;
    double mean = 0.0;
    for (size_t n = 0; n < length; n++) {
        mean += signal[period * length + n] / (double)length;
    }
    return mean;
}

/// Drift of a position per sample, from the first period that counts to the last.
static double slope_of(const struct periodic *recording, const char *column)
{
    const double *signal = run_column(recording->run, column);
    const size_t first = recording->used_periods[0];
    const size_t last = recording->used_periods[recording->used - 1];
    const double rows = (double)((last - first) * recording->period_samples);
    return (mean_of_period(recording, signal, last) - mean_of_period(recording, signal, first)) / rows;
}

/// Mean spectra of a column at the excited lines, as of a velocity.
static double complex *velocity_of(const struct periodic *recording, const char *column)
{
    const size_t lines = recording->bin_count;
    const double length = (double)recording->period_samples;
    double complex *spectra = malloc((recording->used + 1) * lines * sizeof *spectra);
    if (!spectra || !periodic_transform_used(recording, column, spectra + lines)) {
        free(spectra);
        return NULL;
    }
    const bool is_position = columns_is_position(column);
    const double slope = is_position ? slope_of(recording, column) : 0.0;
    for (size_t b = 0; b < lines; b++) {
        const double complex turn = I * two_pi * (double)recording->bins[b] / length;
        spectra[b] = 0.0;
        for (size_t m = 1; m <= recording->used; m++) {
            spectra[b] += spectra[m * lines + b] / (double)recording->used;
        }
        if (is_position) {
            spectra[b] -= slope * length / (cexp(-turn) - 1.0);
            spectra[b] *= turn * recording->run->sample_rate_hz;
        }
    }
    return spectra;
}

static double cosine_of(const double complex *a, const double complex *b, size_t lines, double complex turn)
{
    double product = 0.0;
    double size = 0.0;
    for (size_t line = 0; line < lines; line++) {
        product += creal(a[line] * conj(b[line]) * turn);
        size += cabs(a[line]) * cabs(b[line]);
    }
    return size > 0.0 ? product / size : 0.0;
}

/// Lines on which load and motor move as one, from the lowest.
static size_t lines_together(const struct periodic *recording, const double complex *load, const double complex *motor)
{
    size_t peak = 0;
    double largest = 0.0;
    for (size_t b = 0; b < recording->bin_count; b++) {
        const double ratio = cabs(motor[b]) > 0.0 ? cabs(load[b]) / cabs(motor[b]) : 0.0;
        peak = ratio > largest ? b : peak;
        largest = fmax(ratio, largest);
    }
    size_t count = 0;
    while (count < peak && 2 * (size_t)recording->bins[count] <= recording->bins[peak]) {
        count++;
    }
    return count >= fewest_lines ? count : 0;
}

static void note(struct direction *io_self, const char *name, const char *against, double cosine, double limit)
{
    if (cosine < limit && io_self->count < direction_found_max) {
        io_self->found[io_self->count++] = (struct direction_finding){name, against, cosine};
    }
}

/// One column with its motion.
struct motion {
    const char *name;
    double complex *velocity;
};

static bool find_motions(const struct periodic *recording, const char *const *wanted, struct motion *out,
                         size_t *out_count)
{
    *out_count = 0;
    for (size_t i = 0; i < names; i++) {
        if (!run_column(recording->run, wanted[i])) {
            continue;
        }
        out[*out_count].name = wanted[i];
        out[*out_count].velocity = velocity_of(recording, wanted[i]);
        if (!out[*out_count].velocity) {
            return false;
        }
        ++*out_count;
    }
    return true;
}

static double complex *mean_input(const struct periodic *recording)
{
    double complex *mean = calloc(recording->bin_count, sizeof *mean);
    for (size_t m = 0; m < recording->used && mean; m++) {
        for (size_t b = 0; b < recording->bin_count; b++) {
            mean[b] += recording->input_spectra[m * recording->bin_count + b] / (double)recording->used;
        }
    }
    return mean;
}

static bool is_effort(const char *name)
{
    static const char *const efforts[] = {"torque", "force", "current", "voltage"};
    for (size_t i = 0; i < sizeof efforts / sizeof efforts[0]; i++) {
        if (strncmp(name, efforts[i], strlen(efforts[i])) == 0) {
            return true;
        }
    }
    return false;
}

/// Against the input: the column that is surest speaks for the other too, which a slow sensor may hide.
static void compare_to_input(const struct periodic *recording, const double complex *input, const struct motion *motor,
                             size_t count, double between, struct direction *io_self)
{
    const double complex turn = CMPLX(sqrt(0.5), sqrt(0.5));
    double cosines[names] = {0.0};
    size_t surest = 0;
    for (size_t i = 0; i < count; i++) {
        cosines[i] = cosine_of(motor[i].velocity, input, recording->bin_count, turn);
        surest = cosines[i] < cosines[surest] ? i : surest;
    }
    for (size_t i = 0; i < count && is_effort(recording->input) && cosines[surest] < opposite_to_input; i++) {
        if (i == surest || between > -opposite) {
            note(io_self, motor[i].name, recording->input, cosines[i], INFINITY);
        }
    }
}

static void compare(const struct periodic *recording, const double complex *input, const struct motion *motor,
                    size_t motor_count, const struct motion *load, size_t load_count, struct direction *out)
{
    const size_t lines = recording->bin_count;
    double between = 0.0;
    if (motor_count > 1) {
        between = cosine_of(motor[1].velocity, motor[0].velocity, lines, 1.0);
        note(out, motor[1].name, motor[0].name, between, opposite);
    }
    compare_to_input(recording, input, motor, motor_count, between, out);
    for (size_t i = 0; i < load_count && motor_count > 0; i++) {
        const size_t together = lines_together(recording, load[i].velocity, motor[0].velocity);
        note(out, load[i].name, motor[0].name, cosine_of(load[i].velocity, motor[0].velocity, together, 1.0), opposite);
    }
}

bool direction_measure(const struct periodic *recording, struct direction *out)
{
    struct motion motor[names] = {{NULL, NULL}};
    struct motion load[names] = {{NULL, NULL}};
    size_t motor_count = 0;
    size_t load_count = 0;
    *out = (struct direction){.count = 0};
    double complex *input = mean_input(recording);
    const bool done = input && find_motions(recording, motor_columns, motor, &motor_count) &&
                      find_motions(recording, load_columns, load, &load_count);
    if (done) {
        compare(recording, input, motor, motor_count, load, load_count, out);
    }
    for (size_t i = 0; i < names; i++) {
        free(motor[i].velocity);
        free(load[i].velocity);
    }
    free(input);
    return done;
}
