/* SPDX-License-Identifier: MIT */
#include "lab/estimate/direction.h"

#include "lab/estimate/columns.h"
#include "lab/numeric/cmplx.h"

#include <complex.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double two_pi = 6.283185307179586476925;

/// Two columns are opposite where some delay turns one against the other by at least so much ...
static const double opposite = 0.6;
/// ... and no delay turns it to the other side by more than this: sign and delay can be told apart.
static const double not_opposite = 0.4;
/// Sensors, filters and busses lag by less; beyond an eighth of a period delays alias on a sparse grid of lines.
static const double longest_delay_s = 0.1;
/// Two sensors of one recording are sampled together: filters and busses part them by less.
static const double longest_between_s = 0.01;
static const double longest_delay_periods = 0.125;
/// Over fewer than these the phase of a structure's own antiresonance and resonance passes for a sign.
static const double least_span = 5.0;
/// A spring's velocity leads by 90 degrees, as a reversed inertia's does, but rises with frequency (slope 1).
static const double spring_slope = 0.3;

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

/// How well some delay makes two columns alike, and how well opposite: max and -min of the cosine over the delay.
struct match {
    double alike;
    double opposite;
};

/// Cosines over a range of delays, in steps of 1/16 turn of the highest line; either way between two sensors, one way
/// from an input. Errors: false if memory is short
static bool match_columns(const struct periodic *recording, const double complex *a, const double complex *b,
                          size_t lines, bool either_way, double complex turn, struct match *out)
{
    *out = (struct match){-1.0, -1.0};
    if (lines == 0) {
        return true;
    }
    const double length = (double)recording->period_samples;
    const double longest_s = either_way ? longest_between_s : longest_delay_s;
    const double longest = fmin(longest_s * recording->run->sample_rate_hz, longest_delay_periods * length) / length;
    const double step = 1.0 / (16.0 * (double)recording->bins[lines - 1]);
    const size_t steps = (size_t)(longest / step) + 1;
    const size_t before = either_way ? steps : 0;
    double complex *products = malloc(2 * lines * sizeof *products);
    double size = 0.0;
    for (size_t line = 0; line < lines && products; line++) {
        const double angle = two_pi * (double)recording->bins[line] * step;
        /* The root of the product's size weighs lines: a resonance shall not speak for all of them. */
        const double weight = sqrt(cabs(a[line]) * cabs(b[line]));
        products[line] =
            weight > 0.0 ? a[line] * conj(b[line]) / weight * turn * cexp(-I * angle * (double)before) : 0.0;
        products[lines + line] = cexp(I * angle);
        size += weight;
    }
    for (size_t t = 0; t <= before + steps && products && size > 0.0; t++) {
        double sum = 0.0;
        for (size_t line = 0; line < lines; line++) {
            sum += creal(products[line]);
            products[line] *= products[lines + line];
        }
        out->alike = fmax(out->alike, sum / size);
        out->opposite = fmax(out->opposite, -sum / size);
    }
    free(products);
    return products != NULL;
}

static bool is_opposite(const struct match *match)
{
    return match->opposite > opposite && match->alike < not_opposite;
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

static void note(struct direction *io_self, const char *name, const char *against, const struct match *match)
{
    if (io_self->count < direction_found_max) {
        io_self->found[io_self->count++] = (struct direction_finding){name, against, -match->opposite};
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

/// Slope of log |a/b| over log f, least squares over the lines where both are.
static double slope_of_ratio(const struct periodic *recording, const double complex *a, const double complex *b)
{
    double n = 0.0;
    double x = 0.0;
    double y = 0.0;
    double xx = 0.0;
    double xy = 0.0;
    for (size_t line = 0; line < recording->bin_count; line++) {
        const double ratio = cabs(b[line]) > 0.0 ? cabs(a[line]) / cabs(b[line]) : 0.0;
        if (ratio > 0.0) {
            const double u = log((double)recording->bins[line]);
            const double v = log(ratio);
            n += 1.0;
            x += u;
            y += v;
            xx += u * u;
            xy += u * v;
        }
    }
    const double determinant = n * xx - x * x;
    return determinant > 0.0 ? (n * xy - x * y) / determinant : 0.0;
}

static bool tells_sign(const struct periodic *recording)
{
    const double span = (double)recording->bins[recording->bin_count - 1] / (double)recording->bins[0];
    return recording->bin_count >= fewest_lines && span >= least_span && is_effort(recording->input);
}

/// Against the input: the column that is surest speaks for the other too, which a slow sensor may hide.
static bool compare_to_input(const struct periodic *recording, const double complex *input, const struct motion *motor,
                             size_t count, bool reversed_between, struct direction *io_self)
{
    const double complex turn = CMPLX(sqrt(0.5), sqrt(0.5));
    struct match matches[names] = {{0.0, 0.0}};
    size_t surest = 0;
    if (count == 0 || !tells_sign(recording)) {
        return true;
    }
    for (size_t i = 0; i < count; i++) {
        if (!match_columns(recording, motor[i].velocity, input, recording->bin_count, false, turn, &matches[i])) {
            return false;
        }
        surest = matches[i].alike < matches[surest].alike ? i : surest;
    }
    const bool found =
        is_opposite(&matches[surest]) && slope_of_ratio(recording, motor[surest].velocity, input) < spring_slope;
    for (size_t i = 0; i < count && found; i++) {
        if (i == surest || !reversed_between) {
            note(io_self, motor[i].name, recording->input, &matches[i]);
        }
    }
    return true;
}

static bool compare(const struct periodic *recording, const double complex *input, const struct motion *motor,
                    size_t motor_count, const struct motion *load, size_t load_count, struct direction *out)
{
    bool reversed = false;
    struct match match;
    if (motor_count > 1) {
        if (!match_columns(recording, motor[1].velocity, motor[0].velocity, recording->bin_count, true, 1.0, &match)) {
            return false;
        }
        reversed = is_opposite(&match);
        if (reversed) {
            note(out, motor[1].name, motor[0].name, &match);
        }
    }
    if (!compare_to_input(recording, input, motor, motor_count, reversed, out)) {
        return false;
    }
    for (size_t i = 0; i < load_count && motor_count > 0; i++) {
        const size_t together = lines_together(recording, load[i].velocity, motor[0].velocity);
        if (!match_columns(recording, load[i].velocity, motor[0].velocity, together, true, 1.0, &match)) {
            return false;
        }
        if (is_opposite(&match)) {
            note(out, load[i].name, motor[0].name, &match);
        }
    }
    return true;
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
                      find_motions(recording, load_columns, load, &load_count) &&
                      compare(recording, input, motor, motor_count, load, load_count, out);
    for (size_t i = 0; i < names; i++) {
        free(motor[i].velocity);
        free(load[i].velocity);
    }
    free(input);
    return done;
}
