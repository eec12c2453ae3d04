/* SPDX-License-Identifier: MIT */
#include "lab/estimate/report_lines.h"

#include "lab/estimate/method.h"
#include "lab/numeric/statistics.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double two_pi = 6.283185307179586;

enum { arrays_of_lines = 10, arrays_of_curve = 4, arrays_of_overlay = arrays_of_lines + 1 };

void report_units(const char *units, char out_text[report_units_size])
{
    const char *over = strchr(units, '/');
    const size_t numerator = over ? (size_t)(over - units) : strlen(units);
    const bool compound = over && memchr(units, '_', numerator);
    size_t used = (size_t)snprintf(out_text, report_units_size, units[0] ? "1 " : "1");
    for (const char *at = units; *at && used + 4 < report_units_size;) {
        if (at == units && compound) {
            out_text[used++] = '(';
        }
        if (at == over && compound) {
            out_text[used++] = ')';
        }
        const bool per = strncmp(at, "_per_", 5) == 0;
        out_text[used++] = per ? '/' : *at;
        at += per ? 5 : 1;
    }
    out_text[used] = '\0';
}

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
        const double turn = 360.0 * round((io_run->phase_deg[i] - whole->phase_deg[k]) / 360.0);
        io_run->phase_deg[i] -= turn;
        io_run->phase_low_deg[i] -= turn;
        io_run->phase_high_deg[i] -= turn;
    }
}

/// The distances of the valid lines, close together.
static bool compare_overlay(const struct frf *first, struct report_overlay *io)
{
    size_t k = 0;
    if (!difference_measure(first, io->frf, io->over_two_std, &io->difference)) {
        return false;
    }
    for (size_t line = 0; line < io->frf->count; line++) {
        if (io->frf->valid[line]) {
            io->over_two_std[k++] = io->over_two_std[line];
        }
    }
    return true;
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

static size_t numbers_needed(const struct frf *frf, const struct frf_report_options *options,
                             const struct report_drawing *drawing)
{
    size_t needed = frf->count * (arrays_of_lines + 2 + options->curve_count);
    for (size_t c = 0; c < options->curve_count; c++) {
        needed += arrays_of_curve * options->curves[c].count;
    }
    for (size_t r = 0; r < drawing->overlay_count; r++) {
        needed += arrays_of_overlay * drawing->overlays[r].frf->count;
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

double frf_report_known_delay_s(const struct frf *frf)
{
    const double rate_hz = atof(estimate_key(frf, "sample_rate_hz"));
    const bool held = strcmp(estimate_key(frf, "hold"), "zoh") == 0;
    const bool removed = estimate_key(frf, "delay_removed_s")[0] != '\0';
    return held && !removed && rate_hz > 0.0 ? 0.5 / rate_hz : 0.0;
}

static double delay_of(const struct frf *frf, const struct frf_report_options *options)
{
    return options->known_delay_s > 0.0 ? options->known_delay_s : frf_report_known_delay_s(frf);
}

static bool is_model(const struct frf *frf)
{
    return frf->method && strcmp(frf->method, "parametric") == 0;
}

/// All runs or none, then as many others as there is room for.
static void take_names(const struct frf_report_options *options, struct report_drawing *out)
{
    const size_t runs =
        options->run_count > 1 && options->run_count <= frf_report_overlays_max ? options->run_count : 0;
    for (size_t r = 0; r < runs; r++) {
        out->overlays[out->overlay_count++] =
            (struct report_overlay){.frf = &options->runs[r], .name = options->run_names[r]};
    }
    out->runs_drawn = runs;
    for (size_t r = 0; r < options->other_count && out->overlay_count < frf_report_overlays_max; r++) {
        out->overlays[out->overlay_count++] =
            (struct report_overlay){.frf = &options->others[r], .name = options->other_names[r]};
    }
    out->first = runs > 0 ? options->run_names[0] : options->name ? options->name : "measured";
}

static bool take_overlay(const struct frf *first, bool of_the_response, const struct frf_report_options *options,
                         double **io_free, const struct report_drawing *drawing, struct report_overlay *io)
{
    take_arrays(io_free, io->frf->count, &io->lines);
    io->over_two_std = take(io_free, io->frf->count);
    io->is_model = is_model(io->frf);
    take_lines(io->frf, drawing->factor, of_the_response ? drawing->known_delay_s : delay_of(io->frf, options),
               &io->lines);
    align_run(&drawing->lines, &io->lines);
    return io->frf == first || compare_overlay(first, io);
}

bool report_drawing_make(const struct frf *frf, const struct frf_report_options *options, struct report_drawing *out)
{
    memset(out, 0, sizeof *out);
    take_names(options, out);
    out->is_model = is_model(frf);
    out->known_delay_s = delay_of(frf, options);
    out->memory = malloc(numbers_needed(frf, options, out) * sizeof *out->memory);
    if (!out->memory) {
        return false;
    }
    double *rest = out->memory;
    take_arrays(&rest, frf->count, &out->lines);
    out->at_lines = take(&rest, frf->count);
    out->over_two_std = take(&rest, frf->count);
    find_factor(frf, out);
    take_lines(frf, out->factor, out->known_delay_s, &out->lines);
    bool done = true;
    for (size_t r = 0; r < out->overlay_count && done; r++) {
        done = take_overlay(out->runs_drawn > 0 ? &options->runs[0] : frf, r < out->runs_drawn, options, &rest, out,
                            &out->overlays[r]);
    }
    for (size_t c = 0; c < options->curve_count; c++) {
        struct report_curve *curve = &out->curves[c];
        curve->magnitude_db = take(&rest, options->curves[c].count);
        curve->low_db = take(&rest, options->curves[c].count);
        curve->high_db = take(&rest, options->curves[c].count);
        curve->phase_deg = take(&rest, options->curves[c].count);
        curve->over_two_std = take(&rest, frf->count);
        take_curve(frf, &options->curves[c], out->known_delay_s, out, curve);
    }
    return done && (options->curve_count > 0 || compare_neighbours(frf, out));
}

void report_drawing_free(struct report_drawing *self)
{
    free(self->memory);
}
