/* SPDX-License-Identifier: MIT */
#include "lab/estimate/method.h"

#include "lab/estimate/circle.h"
#include "lab/estimate/frf_hann.h"
#include "lab/estimate/frf_mean.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const struct estimate_method estimate_methods[] = {
    {"mean", "mean over periods, variance from their scatter", frf_mean_estimate},
    {"hann", "Hann window over all periods: robust to what is left of a transient, 1.8 dB more noise",
     frf_hann_estimate},
    {NULL, NULL, NULL},
};

const double estimate_chance_of_dead_line = 1e-3;

/// Frequencies of two realisations are the same line within this share.
static const double same_frequency = 1e-9;

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

bool estimate_set_key(struct frf *io_frf, const char *key, const char *format, ...)
{
    char text[512];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
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

static int refuse_memory(struct frf *io_frf, struct error *out_error)
{
    frf_free(io_frf);
    return error_set(out_error, error_refused, "not enough memory for the frequency response");
}

int estimate_begin(const struct periodic *recording, const char *method, double degrees_of_freedom, struct frf *out_frf,
                   struct error *out_error)
{
    int status = frf_alloc(out_frf, recording->bin_count, out_error);
    if (status) {
        return status;
    }
    char units[128];
    snprintf(units, sizeof units, "%s/%s", unit_of(recording->output), unit_of(recording->input));
    if (!frf_set_text(&out_frf->input, recording->input) || !frf_set_text(&out_frf->output, recording->output) ||
        !frf_set_text(&out_frf->units, units) || !frf_set_text(&out_frf->method, method)) {
        return refuse_memory(out_frf, out_error);
    }
    out_frf->periods = recording->used;
    out_frf->degrees_of_freedom = degrees_of_freedom;
    for (size_t line = 0; line < recording->bin_count; line++) {
        out_frf->frequency_hz[line] =
            (double)recording->bins[line] * recording->run->sample_rate_hz / (double)recording->period_samples;
    }
    return 0;
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

static bool set_confidence(struct frf *io_frf)
{
    /* Real degrees of freedom come in pairs: two for each complex one. */
    double factor = circle_confidence_factor(0.95, io_frf->degrees_of_freedom / 2.0);
    return estimate_set_key(io_frf, "confidence_95_factor", "%.6g", factor);
}

int estimate_end(const struct periodic *recording, struct frf *io_frf, struct error *out_error)
{
    if (valid_lines(io_frf) == 0) {
        frf_free(io_frf);
        return error_set(
            out_error, error_refused,
            "%s: %s has no power above its scatter on any of %zu lines: expected an excited input, see --input, "
            "--lines",
            recording->run->path, recording->input, recording->bin_count);
    }
    bool set = set_confidence(io_frf) && estimate_set_key(io_frf, "settle_periods", "%zu", recording->settle) &&
               estimate_set_key(io_frf, "settle_from", "%s", settle_source_name(recording->settle_source)) &&
               estimate_set_key(io_frf, "period_samples", "%zu", recording->period_samples) &&
               estimate_set_key(io_frf, "sample_rate_hz", "%.17g", recording->run->sample_rate_hz);
    if (set && recording->lost > 0) {
        set = estimate_set_key(io_frf, "lost_periods", "%zu", recording->lost);
    }
    return set ? 0 : refuse_memory(io_frf, out_error);
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
        if (!(fabs(other->frequency_hz[line] - frequency) <= same_frequency * frequency)) {
            return error_set(out_error, error_refused,
                             "run %zu: line %zu is at %.9g Hz: expected the first run's %.9g Hz", number, line + 1,
                             other->frequency_hz[line], frequency);
        }
    }
    return 0;
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
    }
}

int estimate_average(const struct frf *realisations, size_t count, struct frf *out_frf, struct error *out_error)
{
    const struct frf *first = &realisations[0];
    *out_frf = (struct frf){0};
    if (count < 2) {
        return error_set(out_error, error_refused, "%zu realisations: expected at least 2 to average", count);
    }
    for (size_t r = 1; r < count; r++) {
        int status = check_same(first, &realisations[r], r + 1, out_error);
        if (status) {
            return status;
        }
    }
    int status = frf_alloc(out_frf, first->count, out_error);
    if (status) {
        return status;
    }
    if (!frf_set_text(&out_frf->input, first->input) || !frf_set_text(&out_frf->output, first->output) ||
        !frf_set_text(&out_frf->units, first->units) || !frf_set_text(&out_frf->method, first->method)) {
        return refuse_memory(out_frf, out_error);
    }
    for (size_t r = 0; r < count; r++) {
        out_frf->periods += realisations[r].periods;
    }
    out_frf->degrees_of_freedom = 2.0 * (double)(count - 1);
    memcpy(out_frf->frequency_hz, first->frequency_hz, first->count * sizeof *out_frf->frequency_hz);
    for (size_t line = 0; line < first->count; line++) {
        average_line(realisations, count, line, out_frf);
    }
    if (!set_confidence(out_frf) || !estimate_set_key(out_frf, "realisations", "%zu", count)) {
        return refuse_memory(out_frf, out_error);
    }
    return 0;
}
