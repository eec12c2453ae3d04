/* SPDX-License-Identifier: MIT */
#include "lab/estimate/method.h"

#include "lab/estimate/circle.h"
#include "lab/estimate/columns.h"
#include "lab/estimate/frf_h1.h"
#include "lab/estimate/frf_hann.h"
#include "lab/estimate/frf_indirect.h"
#include "lab/estimate/frf_lpm.h"
#include "lab/estimate/frf_lpm_arbitrary.h"
#include "lab/estimate/frf_mean.h"
#include "lab/estimate/parametric_frf.h"
#include "lab/record/number.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const struct estimate_method estimate_methods[] = {
    {"mean", "mean over periods, variance from their scatter", false, frf_mean_estimate, NULL},
    {"hann", "Hann window over all periods: robust to what is left of a transient, 1.8 dB more noise", false,
     frf_hann_estimate, NULL},
    {"lpm", "local polynomials: takes the transient out, so that no period is left out for settling", true,
     frf_lpm_estimate, frf_lpm_estimate_arbitrary},
    {"h1", "cross spectrum over input power, for arbitrary signals; biased in a closed loop", false, frf_h1_estimate,
     frf_h1_estimate_arbitrary},
    {"indirect", "output and input against the reference: for arbitrary signals in a closed loop", false,
     frf_indirect_estimate, frf_indirect_estimate_arbitrary},
    {"parametric", "transfer function by maximum likelihood, orders chosen by description length", false,
     frf_parametric_estimate, NULL},
    {NULL, NULL, false, NULL, NULL},
};

const double estimate_chance_of_dead_line = 1e-3;

/// Lines of two realisations are the same within this share of their frequency, which clocks and rates derived from a
/// column of times differ by, and of the distance to the next line.
static const double same_frequency = 5e-4;
static const double same_line = 0.1;

const struct estimate_method *estimate_method_find(const char *name, struct error *out_error)
{
    char names[128] = "";
    for (const struct estimate_method *method = estimate_methods; method->name; method++) {
        if (strcmp(method->name, name) == 0) {
            return method;
        }
        size_t used = strlen(names);
        snprintf(names + used, sizeof names - used, "%s%s", used ? ", " : "", method->name);
    }
    error_set(out_error, error_usage, "method '%s' is not in this build: expected one of %s", name, names);
    return NULL;
}

/// The unit at the end of a column's name: velocity_rad_per_s -> rad_per_s. Units do not contain a quantity's name, so
/// the known ones are tried, the longest first.
static const char *unit_of(const char *name)
{
    static const char *const units[] = {"rad_per_s2", "m_per_s2", "rad_per_s", "m_per_s", "Nm",
                                        "rad",        "N",        "A",         "V",       "m"};
    size_t length = strlen(name);
    for (size_t i = 0; i < sizeof units / sizeof *units; i++) {
        size_t unit_length = strlen(units[i]);
        if (length > unit_length && name[length - unit_length - 1] == '_' &&
            strcmp(name + length - unit_length, units[i]) == 0) {
            return units[i];
        }
    }
    return name;
}

const char *estimate_key(const struct frf *frf, const char *key)
{
    for (size_t i = 0; i < frf->key_count; i++) {
        if (strcmp(frf->keys[i].key, key) == 0) {
            return frf->keys[i].value;
        }
    }
    return "";
}

bool estimate_set_long_key(struct frf *io_frf, const char *key, const char *text)
{
    for (size_t i = 0; i < io_frf->key_count; i++) {
        if (strcmp(io_frf->keys[i].key, key) == 0) {
            return frf_set_text(&io_frf->keys[i].value, text);
        }
    }
    struct run_key *keys = realloc(io_frf->keys, (io_frf->key_count + 1) * sizeof *keys);
    if (!keys) {
        return false;
    }
    io_frf->keys = keys;
    struct run_key *added = &keys[io_frf->key_count];
    *added = (struct run_key){NULL, NULL};
    if (!frf_set_text(&added->key, key) || !frf_set_text(&added->value, text)) {
        free(added->key);
        return false;
    }
    io_frf->key_count++;
    return true;
}

bool estimate_set_key(struct frf *io_frf, const char *key, const char *format, ...)
{
    char text[800];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    return estimate_set_long_key(io_frf, key, text);
}

int estimate_refuse_memory(struct frf *io_frf, struct error *out_error)
{
    frf_free(io_frf);
    return error_set(out_error, error_refused, "not enough memory for the frequency response");
}

static int begin(const char *input, const char *output, const char *method, double degrees_of_freedom, size_t lines,
                 struct frf *out_frf, struct error *out_error)
{
    int status = frf_alloc(out_frf, lines, out_error);
    if (status) {
        return status;
    }
    char units[128];
    snprintf(units, sizeof units, "%s/%s", unit_of(output), unit_of(input));
    if (!frf_set_text(&out_frf->input, input) || !frf_set_text(&out_frf->output, output) ||
        !frf_set_text(&out_frf->units, units) || !frf_set_text(&out_frf->method, method)) {
        return estimate_refuse_memory(out_frf, out_error);
    }
    out_frf->degrees_of_freedom = degrees_of_freedom;
    return 0;
}

int estimate_begin(const struct periodic *recording, const char *method, double degrees_of_freedom, struct frf *out_frf,
                   struct error *out_error)
{
    int status = begin(recording->input, recording->output, method, degrees_of_freedom, recording->bin_count, out_frf,
                       out_error);
    if (status) {
        return status;
    }
    out_frf->periods = recording->used;
    for (size_t line = 0; line < recording->bin_count; line++) {
        out_frf->frequency_hz[line] =
            (double)recording->bins[line] * recording->run->sample_rate_hz / (double)recording->period_samples;
    }
    return 0;
}

int estimate_begin_arbitrary(const struct arbitrary *recording, const char *method, double degrees_of_freedom,
                             size_t lines, double step_hz, struct frf *out_frf, struct error *out_error)
{
    int status = begin(recording->input, recording->output, method, degrees_of_freedom, lines, out_frf, out_error);
    for (size_t line = 0; line < lines && !status; line++) {
        out_frf->frequency_hz[line] = (double)(line + 1) * step_hz;
    }
    return status;
}

void estimate_set_line(struct frf *io_frf, size_t line, double complex response, double std)
{
    io_frf->real[line] = creal(response);
    io_frf->imag[line] = cimag(response);
    io_frf->std[line] = std;
    io_frf->noise_std[line] = std;
    io_frf->valid[line] = isfinite(creal(response)) && isfinite(cimag(response)) && isfinite(std);
    if (!io_frf->valid[line]) {
        io_frf->real[line] = 0.0;
        io_frf->imag[line] = 0.0;
        io_frf->std[line] = FRF_UNKNOWN;
        io_frf->noise_std[line] = FRF_UNKNOWN;
    }
}

static const char *settle_source_name(enum periodic_settle source)
{
    switch (source) {
    case periodic_settle_given:
        return "option";
    case periodic_settle_key:
        return "settle_periods of the run";
    case periodic_settle_keep:
        return "nothing: the method models the transient";
    case periodic_settle_auto:
    case periodic_settle_default:
        break;
    }
    return "decay of the transient";
}

static size_t valid_lines(const struct frf *frf)
{
    size_t count = 0;
    for (size_t line = 0; line < frf->count; line++) {
        count += frf->valid[line];
    }
    return count;
}

bool estimate_set_confidence(struct frf *io_frf)
{
    /* Real degrees of freedom come in pairs: two for each complex one. */
    double factor = circle_confidence_factor(0.95, io_frf->degrees_of_freedom / 2.0);
    return estimate_set_key(io_frf, "confidence_95_factor", "%.6g", factor);
}

/// Lines without input (periodic_cut) have no response, whatever a method made of rounding.
static void drop_silent_lines(const struct periodic *recording, struct frf *io_frf)
{
    for (size_t line = 0; line < io_frf->count && io_frf->count == recording->bin_count; line++) {
        if (recording->input_spectra[line] == 0.0) {
            estimate_set_line(io_frf, line, 0.0, INFINITY);
        }
    }
}

/// The figures of the line that stands out most.
static int refuse_scatter(const struct periodic *recording, struct error *out_error)
{
    const double to_amplitude = 2.0 / (double)recording->period_samples;
    double best = -1.0;
    size_t strongest = 0;
    struct circle line = {0};
    for (size_t b = 0; b < recording->bin_count; b++) {
        const struct circle one = circle_of_column(recording->input_spectra, recording->used, recording->bin_count, b);
        const double ratio = one.variance > 0.0 ? cabs(one.mean) / sqrt(one.variance) : 0.0;
        if (ratio > best) {
            best = ratio;
            strongest = b;
            line = one;
        }
    }
    return error_set(
        out_error, error_refused,
        "%s: %s has no power above its scatter on any of %zu lines: the clearest, %.6g Hz, has an "
        "amplitude of %.3g, and %zu periods leave it uncertain by %.3g%s: expected an excited input, see "
        "--input, --lines, or more periods",
        recording->run->path, recording->input, recording->bin_count,
        (double)recording->bins[strongest] * recording->run->sample_rate_hz / (double)recording->period_samples,
        to_amplitude * cabs(line.mean), recording->used, to_amplitude * sqrt(line.variance / (double)recording->used),
        recording->used < 4 ? ", which so few periods tell badly" : "");
}

int estimate_end(const struct periodic *recording, struct frf *io_frf, struct error *out_error)
{
    drop_silent_lines(recording, io_frf);
    if (valid_lines(io_frf) == 0) {
        frf_free(io_frf);
        return refuse_scatter(recording, out_error);
    }
    bool set = estimate_set_confidence(io_frf) &&
               estimate_set_key(io_frf, "settle_periods", "%zu", recording->settle) &&
               estimate_set_key(io_frf, "settle_from", "%s", settle_source_name(recording->settle_source)) &&
               estimate_set_key(io_frf, "period_samples", "%zu", recording->period_samples) &&
               estimate_set_key(io_frf, "sample_rate_hz", "%.17g", recording->run->sample_rate_hz);
    if (set && recording->lost > 0) {
        set = estimate_set_key(io_frf, "lost_periods", "%zu", recording->lost);
    }
    if (set && recording->lost_outside > 0) {
        set = estimate_set_key(io_frf, "lost_rows_outside", "%zu", recording->lost_outside);
    }
    return set ? 0 : estimate_refuse_memory(io_frf, out_error);
}

int estimate_end_arbitrary(const struct arbitrary *recording, struct frf *io_frf, struct error *out_error)
{
    if (valid_lines(io_frf) == 0) {
        frf_free(io_frf);
        return error_set(out_error, error_refused,
                         "%s: no line of %s has enough power of its own for a response: expected an excited input, see "
                         "--input, --reference",
                         recording->run->path, recording->input);
    }
    bool set = estimate_set_confidence(io_frf) && estimate_set_key(io_frf, "rows", "%zu", recording->rows) &&
               estimate_set_key(io_frf, "sample_rate_hz", "%.17g", recording->run->sample_rate_hz);
    if (set && recording->lost > 0) {
        set = estimate_set_key(io_frf, "lost_rows", "%zu", recording->lost);
    }
    return set ? 0 : estimate_refuse_memory(io_frf, out_error);
}

bool estimate_warn_of_feedback(const char *reference, struct frf *io_frf)
{
    const struct columns columns = {.reference = reference};
    if (columns_closed_loop(&columns)) {
        return estimate_set_key(io_frf, "warning",
                                "biased: the recording holds %s, so a loop is closed, and dividing by the power of %s "
                                "draws the response towards minus the inverse of the controller; use method indirect",
                                reference, io_frf->input);
    }
    return estimate_set_key(io_frf, "warning",
                            "biased if a loop is closed around %s or if its sensor is noisy: noise counts as input "
                            "power; use method indirect then, or a periodic excitation",
                            io_frf->input);
}

bool estimate_warn_of_reference(const char *reference, struct frf *io_frf)
{
    static const char *const asked_for[] = {"torque_ref_Nm", "force_ref_N", "current_ref_A", "voltage_ref_V"};
    bool from_controller = false;
    for (size_t i = 0; i < sizeof asked_for / sizeof asked_for[0]; i++) {
        from_controller = from_controller || strcmp(reference, asked_for[i]) == 0;
    }
    return !from_controller ||
           estimate_set_key(io_frf, "warning",
                            "%s is what the controller asks for: it excites from outside only if no loop is closed "
                            "around it",
                            reference);
}

static double tolerance_of_line(const struct frf *frf, size_t line)
{
    const double *frequency = frf->frequency_hz;
    double tolerance = same_frequency * frequency[line];
    if (line > 0) {
        tolerance = fmin(tolerance, same_line * (frequency[line] - frequency[line - 1]));
    }
    if (line + 1 < frf->count) {
        tolerance = fmin(tolerance, same_line * (frequency[line + 1] - frequency[line]));
    }
    return tolerance;
}

static int check_same(const struct frf *first, const struct frf *other, size_t number, struct error *out_error)
{
    if (strcmp(first->input, other->input) != 0 || strcmp(first->output, other->output) != 0) {
        return error_set(out_error, error_refused, "run %zu has %s to %s: expected %s to %s as in the first run",
                         number, other->input, other->output, first->input, first->output);
    }
    if (first->count != other->count) {
        return error_set(out_error, error_refused, "run %zu has %zu lines: expected the first run's %zu", number,
                         other->count, first->count);
    }
    for (size_t line = 0; line < first->count; line++) {
        double frequency = first->frequency_hz[line];
        if (!(fabs(other->frequency_hz[line] - frequency) <= tolerance_of_line(first, line))) {
            return error_set(out_error, error_refused,
                             "run %zu: line %zu is at %.9g Hz: expected the first run's %.9g Hz", number, line + 1,
                             other->frequency_hz[line], frequency);
        }
    }
    return 0;
}

/// Root of the mean power of the levels; unknown if one realisation does not know its own.
static double average_level(const struct frf *realisations, size_t count, size_t line, bool odd)
{
    double sum = 0.0;
    for (size_t r = 0; r < count; r++) {
        const double *levels = odd ? realisations[r].odd_distortion : realisations[r].even_distortion;
        if (!frf_known(levels[line])) {
            return FRF_UNKNOWN;
        }
        sum += levels[line] * levels[line] / (double)count;
    }
    return sqrt(sum);
}

static void average_line(const struct frf *realisations, size_t count, size_t line, struct frf *io_frf)
{
    double complex mean = 0.0;
    double noise_power = 0.0;
    bool valid = true;
    for (size_t r = 0; r < count; r++) {
        const struct frf *one = &realisations[r];
        valid = valid && one->valid[line];
        mean += (one->real[line] + one->imag[line] * I) / (double)count;
        noise_power += one->noise_std[line] * one->noise_std[line];
    }
    double scatter = 0.0;
    for (size_t r = 0; r < count; r++) {
        double complex deviation = realisations[r].real[line] + realisations[r].imag[line] * I - mean;
        scatter += creal(deviation) * creal(deviation) + cimag(deviation) * cimag(deviation);
    }
    if (valid) {
        estimate_set_line(io_frf, line, mean, sqrt(scatter / ((double)count * (double)(count - 1))));
        io_frf->noise_std[line] = sqrt(noise_power) / (double)count;
        io_frf->odd_distortion[line] = average_level(realisations, count, line, true);
        io_frf->even_distortion[line] = average_level(realisations, count, line, false);
    }
}

bool estimate_set_common_keys(struct frf *io_frf, const struct frf *responses, size_t count)
{
    size_t lost = 0;
    double rate_hz = 0.0;
    bool set = true;
    for (size_t k = 0; set && k < responses[0].key_count; k++) {
        const struct run_key *key = &responses[0].keys[k];
        bool alike = strcmp(key->key, "lost_periods") != 0;
        for (size_t r = 1; alike && r < count; r++) {
            alike = strcmp(estimate_key(&responses[r], key->key), key->value) == 0;
        }
        set = !alike || estimate_set_long_key(io_frf, key->key, key->value);
    }
    for (size_t r = 0; r < count; r++) {
        double rate;
        const char *text = estimate_key(&responses[r], "sample_rate_hz");
        rate_hz += number_parse(text, strlen(text), &rate) == number_ok ? rate / (double)count : NAN;
        lost += strtoul(estimate_key(&responses[r], "lost_periods"), NULL, 10);
    }
    if (set && isfinite(rate_hz) && !estimate_key(io_frf, "sample_rate_hz")[0]) {
        set = estimate_set_key(io_frf, "sample_rate_hz", "%.17g", rate_hz);
    }
    return set && (lost == 0 || estimate_set_key(io_frf, "lost_periods", "%zu", lost));
}

int estimate_begin_common(const struct frf *responses, size_t count, struct frf *out_frf, struct error *out_error)
{
    const struct frf *first = &responses[0];
    *out_frf = (struct frf){0};
    for (size_t r = 1; r < count; r++) {
        int status = check_same(first, &responses[r], r + 1, out_error);
        if (status) {
            return status;
        }
    }
    int status = frf_alloc(out_frf, first->count, out_error);
    if (status) {
        return status;
    }
    if (!frf_set_text(&out_frf->input, first->input) || !frf_set_text(&out_frf->output, first->output) ||
        !frf_set_text(&out_frf->units, first->units) || !frf_set_text(&out_frf->method, first->method) ||
        !estimate_set_common_keys(out_frf, responses, count)) {
        return estimate_refuse_memory(out_frf, out_error);
    }
    for (size_t r = 0; r < count; r++) {
        out_frf->periods += responses[r].periods;
    }
    memcpy(out_frf->frequency_hz, first->frequency_hz, first->count * sizeof *out_frf->frequency_hz);
    return 0;
}

int estimate_average(const struct frf *realisations, size_t count, struct frf *out_frf, struct error *out_error)
{
    *out_frf = (struct frf){0};
    if (count < 2) {
        return error_set(out_error, error_refused, "%zu realisations: expected at least 2 to average", count);
    }
    int status = estimate_begin_common(realisations, count, out_frf, out_error);
    if (status) {
        return status;
    }
    double noise_degrees = 0.0;
    for (size_t r = 0; r < count; r++) {
        noise_degrees += realisations[r].degrees_of_freedom;
    }
    out_frf->degrees_of_freedom = 2.0 * (double)(count - 1);
    for (size_t line = 0; line < out_frf->count; line++) {
        average_line(realisations, count, line, out_frf);
    }
    if (!estimate_set_confidence(out_frf) || !estimate_set_key(out_frf, "realisations", "%zu", count) ||
        !estimate_set_key(out_frf, "noise_degrees_of_freedom", "%.6g", noise_degrees)) {
        return estimate_refuse_memory(out_frf, out_error);
    }
    return 0;
}
