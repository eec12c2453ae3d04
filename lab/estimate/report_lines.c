/* SPDX-License-Identifier: MIT */
#include "lab/estimate/report_lines.h"

#include "lab/estimate/method.h"
#include "lab/numeric/statistics.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double two_pi = 6.283185307179586;

enum { arrays_of_lines = 10, arrays_of_curve = 4 };

static double decibel(double magnitude)
{
    return 20.0 * log10(magnitude); // minus infinity for 0: a gap in the figure
}

/// Unwraps along frequency. The first value lies in -270 .. 90 degrees, so that a double integrator's -180 degrees stay
/// one branch under noise.
static void unwrap(size_t count, double *phase_deg)
{
    double centre = -90.0;
    for (size_t k = 0; k < count; k++) {
        phase_deg[k] -= 360.0 * round((phase_deg[k] - centre) / 360.0);
        centre = phase_deg[k];
    }
}

static double phase_without_delay(double real, double imag, double frequency_hz, double delay_s)
{
    return (atan2(imag, real) + two_pi * frequency_hz * delay_s) * 360.0 / two_pi;
}

static void take_line(const struct frf *frf, size_t line, double factor, double delay_s, struct report_lines *io)
{
    const size_t k = io->count++;
    const double magnitude = hypot(frf->real[line], frf->imag[line]);
    const double std = frf_known(frf->std[line]) ? frf->std[line] : NAN;
    const double noise = frf_known(frf->noise_std[line]) ? frf->noise_std[line] : NAN;
    const double reach = factor * std;
    io->frequency_hz[k] = frf->frequency_hz[line];
    io->magnitude_db[k] = decibel(magnitude);
    io->low_db[k] = isnan(std) ? NAN : decibel(fmax(magnitude - reach, 0.0));
    io->high_db[k] = decibel(magnitude + reach);
    io->phase_deg[k] = phase_without_delay(frf->real[line], frf->imag[line], frf->frequency_hz[line], delay_s);
    io->std_db[k] = decibel(std);
    io->noise_db[k] = decibel(noise);
    io->coherence[k] = frf->coherence && frf_known(frf->coherence[line]) ? frf->coherence[line] : NAN;
    io->has_std = io->has_std || std > 0.0;
    io->has_coherence = io->has_coherence || !isnan(io->coherence[k]);
    io->noise_differs = io->noise_differs || fabs(noise - std) > 1e-9 * std;
    // Half the angle that the circle of the region covers, seen from 0.
    const double width = reach < magnitude ? asin(reach / magnitude) : two_pi / 2.0;
    io->phase_low_deg[k] = io->phase_high_deg[k] = isnan(std) ? NAN : width * 360.0 / two_pi;
}

static void take_lines(const struct frf *frf, double factor, double delay_s, struct report_lines *io)
{
    for (size_t line = 0; line < frf->count; line++) {
        if (frf->valid[line]) {
            take_line(frf, line, factor, delay_s, io);
        }
    }
    unwrap(io->count, io->phase_deg);
    for (size_t k = 0; k < io->count; k++) {
        io->phase_low_deg[k] = io->phase_deg[k] - io->phase_low_deg[k];
        io->phase_high_deg[k] = io->phase_deg[k] + io->phase_high_deg[k];
    }
}

/// A run's phases on the branch of the response that it is a realisation of.
static void align_run(const struct report_lines *whole, struct report_lines *io_run)
{
    size_t k = 0;
    for (size_t i = 0; i < io_run->count && whole->count > 0; i++) {
        while (k + 1 < whole->count && whole->frequency_hz[k] < io_run->frequency_hz[i] * (1.0 - 1e-3)) {
            k++;
        }
        io_run->phase_deg[i] -= 360.0 * round((io_run->phase_deg[i] - whole->phase_deg[k]) / 360.0);
    }
}

/// Both lists ascend, so one pass finds the equal frequencies.
static void compare(const struct frf *frf, const struct frf_model_curve *model, struct report_curve *out)
{
    const double same = 1e-9;
    size_t m = 0;
    size_t k = 0;
    for (size_t line = 0; line < frf->count; line++) {
        const double frequency = frf->frequency_hz[line];
        while (m < model->count && model->frequency_hz[m] < frequency * (1.0 - same)) {
            m++;
        }
        if (!frf->valid[line]) {
            continue;
        }
        out->over_two_std[k] = NAN;
        if (m < model->count && model->frequency_hz[m] <= frequency * (1.0 + same) && frf->std[line] > 0.0) {
            const double error = hypot(frf->real[line] - model->real[m], frf->imag[line] - model->imag[m]);
            out->over_two_std[k] = error / (2.0 * frf->std[line]);
            out->compared++;
            out->beyond += out->over_two_std[k] > 1.0;
        }
        k++;
    }
}

/// Whole turns between a model's phases and the measured ones: the median over the lines. `scratch`: one number a line.
static double turns_apart(const struct report_lines *lines, const struct frf_model_curve *model,
                          const double *phase_deg, double *scratch)
{
    size_t m = 0;
    size_t count = 0;
    for (size_t k = 0; k < lines->count && model->count > 0; k++) {
        while (m + 1 < model->count && model->frequency_hz[m + 1] <= lines->frequency_hz[k]) {
            m++;
        }
        scratch[count++] = round((phase_deg[m] - lines->phase_deg[k]) / 360.0);
    }
    return count > 0 ? round(statistics_median(scratch, count)) : 0.0;
}

static void take_curve(const struct frf *frf, const struct frf_model_curve *model, double delay_s,
                       struct report_drawing *io, struct report_curve *out)
{
    for (size_t m = 0; m < model->count; m++) {
        const double magnitude = hypot(model->real[m], model->imag[m]);
        const double reach = model->std ? io->factor * model->std[m] : NAN;
        out->magnitude_db[m] = decibel(magnitude);
        out->low_db[m] = isnan(reach) ? NAN : decibel(fmax(magnitude - reach, 0.0));
        out->high_db[m] = decibel(magnitude + reach);
        out->phase_deg[m] = phase_without_delay(model->real[m], model->imag[m], model->frequency_hz[m], delay_s);
    }
    unwrap(model->count, out->phase_deg);
    const double turns = turns_apart(&io->lines, model, out->phase_deg, io->at_lines);
    for (size_t m = 0; m < model->count; m++) {
        out->phase_deg[m] -= 360.0 * turns;
    }
    compare(frf, model, out);
}

/// Hands out pieces of one allocation.
static double *take(double **io_free, size_t count)
{
    double *piece = *io_free;
    *io_free += count;
    return piece;
}

static void take_arrays(double **io_free, size_t count, struct report_lines *out)
{
    double **const arrays[arrays_of_lines] = {
        &out->frequency_hz,  &out->magnitude_db,   &out->low_db, &out->high_db,  &out->phase_deg,
        &out->phase_low_deg, &out->phase_high_deg, &out->std_db, &out->noise_db, &out->coherence,
    };
    for (size_t i = 0; i < arrays_of_lines; i++) {
        *arrays[i] = take(io_free, count);
    }
}

static size_t numbers_needed(const struct frf *frf, const struct frf_report_options *options, size_t run_count)
{
    size_t needed = frf->count * (arrays_of_lines + 2 + options->curve_count);
    for (size_t c = 0; c < options->curve_count; c++) {
        needed += arrays_of_curve * options->curves[c].count;
    }
    for (size_t r = 0; r < run_count; r++) {
        needed += arrays_of_lines * options->runs[r].count;
    }
    return needed + 1;
}

static void find_factor(const struct frf *frf, struct report_drawing *out)
{
    const double factor = atof(estimate_key(frf, "confidence_95_factor"));
    out->factor_is_95 = factor > 0.0 && isfinite(factor);
    out->factor = out->factor_is_95 ? factor : 2.0;
}

/// The distances of the valid lines from their neighbours, close together.
static bool compare_neighbours(const struct frf *frf, struct report_drawing *io)
{
    if (!smoothness_measure(frf, io->over_two_std, &io->smoothness)) {
        return false;
    }
    size_t k = 0;
    for (size_t line = 0; line < frf->count; line++) {
        if (frf->valid[line]) {
            io->over_two_std[k++] = io->over_two_std[line];
        }
    }
    return true;
}

bool report_drawing_make(const struct frf *frf, const struct frf_report_options *options, struct report_drawing *out)
{
    memset(out, 0, sizeof *out);
    out->run_count = options->run_count <= frf_report_runs_max ? options->run_count : 0;
    out->is_model = frf->method && strcmp(frf->method, "parametric") == 0;
    out->memory = malloc(numbers_needed(frf, options, out->run_count) * sizeof *out->memory);
    if (!out->memory) {
        return false;
    }
    double *rest = out->memory;
    take_arrays(&rest, frf->count, &out->lines);
    out->at_lines = take(&rest, frf->count);
    out->over_two_std = take(&rest, frf->count);
    find_factor(frf, out);
    take_lines(frf, out->factor, options->known_delay_s, &out->lines);
    for (size_t r = 0; r < out->run_count; r++) {
        take_arrays(&rest, options->runs[r].count, &out->runs[r]);
        take_lines(&options->runs[r], out->factor, options->known_delay_s, &out->runs[r]);
        align_run(&out->lines, &out->runs[r]);
    }
    for (size_t c = 0; c < options->curve_count; c++) {
        struct report_curve *curve = &out->curves[c];
        curve->magnitude_db = take(&rest, options->curves[c].count);
        curve->low_db = take(&rest, options->curves[c].count);
        curve->high_db = take(&rest, options->curves[c].count);
        curve->phase_deg = take(&rest, options->curves[c].count);
        curve->over_two_std = take(&rest, frf->count);
        take_curve(frf, &options->curves[c], options->known_delay_s, out, curve);
    }
    return options->curve_count > 0 || compare_neighbours(frf, out);
}

void report_drawing_free(struct report_drawing *self)
{
    free(self->memory);
}
