/* SPDX-License-Identifier: MIT */
#include "lab/estimate/report.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double two_pi = 6.283185307179586;

enum { units_size = 40 };

static double decibel(double magnitude)
{
    return 20.0 * log10(magnitude); // minus infinity for 0: a gap in the figure
}

/// "rad_per_s/Nm" as a person writes it: "(rad/s)/Nm".
static void readable_units(const char *units, char out_text[units_size])
{
    const char *over = strchr(units, '/');
    const size_t numerator = over ? (size_t)(over - units) : strlen(units);
    const bool compound = over && memchr(units, '_', numerator);
    size_t used = 0;
    for (const char *at = units; *at && used + 4 < units_size;) {
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

/// The measured lines that are valid, as the figure wants them.
struct lines {
    size_t count;
    double *frequency_hz, *magnitude_db, *low_db, *high_db;
    double *phase_deg, *phase_low_deg, *phase_high_deg;
    double *std_db, *noise_db;
    bool noise_differs; ///< from the total standard deviation, somewhere
};

/// A model's curve as the figure wants it, and its error at the measured lines.
struct curve {
    double *magnitude_db, *phase_deg;
    double *over_two_sigma; ///< per valid line; NaN where the model has no value
    size_t compared, beyond;
};

struct drawing {
    double *memory;
    struct lines lines;
    struct curve curves[frf_report_curves_max];
};

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

static void take_lines(const struct frf *frf, double delay_s, struct lines *out)
{
    for (size_t line = 0; line < frf->count; line++) {
        if (!frf->valid[line]) {
            continue;
        }
        const size_t k = out->count++;
        const double magnitude = hypot(frf->real[line], frf->imag[line]);
        const double std = frf_known(frf->std[line]) ? frf->std[line] : NAN;
        const double noise = frf_known(frf->noise_std[line]) ? frf->noise_std[line] : NAN;
        out->frequency_hz[k] = frf->frequency_hz[line];
        out->magnitude_db[k] = decibel(magnitude);
        out->low_db[k] = decibel(fmax(magnitude - 2.0 * std, 0.0));
        out->high_db[k] = decibel(magnitude + 2.0 * std);
        out->phase_deg[k] = phase_without_delay(frf->real[line], frf->imag[line], frf->frequency_hz[line], delay_s);
        out->std_db[k] = decibel(std);
        out->noise_db[k] = decibel(noise);
        out->noise_differs = out->noise_differs || fabs(noise - std) > 1e-9 * std;
        // Half the angle that the circle of 2 std covers, seen from 0.
        const double width = 2.0 * std < magnitude ? asin(2.0 * std / magnitude) : two_pi / 2.0;
        out->phase_low_deg[k] = out->phase_high_deg[k] = isnan(std) ? NAN : width * 360.0 / two_pi;
    }
    unwrap(out->count, out->phase_deg);
    for (size_t k = 0; k < out->count; k++) {
        out->phase_low_deg[k] = out->phase_deg[k] - out->phase_low_deg[k];
        out->phase_high_deg[k] = out->phase_deg[k] + out->phase_high_deg[k];
    }
}

/// Both lists ascend, so one pass finds the equal frequencies.
static void compare(const struct frf *frf, const struct frf_model_curve *model, struct curve *out)
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
        out->over_two_sigma[k] = NAN;
        if (m < model->count && model->frequency_hz[m] <= frequency * (1.0 + same) && frf->std[line] > 0.0) {
            const double error = hypot(frf->real[line] - model->real[m], frf->imag[line] - model->imag[m]);
            out->over_two_sigma[k] = error / (2.0 * frf->std[line]);
            out->compared++;
            out->beyond += out->over_two_sigma[k] > 1.0;
        }
        k++;
    }
}

static void take_curve(const struct frf *frf, const struct frf_model_curve *model, double delay_s, struct curve *out)
{
    for (size_t m = 0; m < model->count; m++) {
        out->magnitude_db[m] = decibel(hypot(model->real[m], model->imag[m]));
        out->phase_deg[m] = phase_without_delay(model->real[m], model->imag[m], model->frequency_hz[m], delay_s);
    }
    unwrap(model->count, out->phase_deg);
    compare(frf, model, out);
}

/// Hands out pieces of one allocation.
static double *take(double **io_free, size_t count)
{
    double *piece = *io_free;
    *io_free += count;
    return piece;
}

static bool make_drawing(const struct frf *frf, const struct frf_report_options *options, struct drawing *out)
{
    enum { arrays_of_lines = 9, arrays_of_curve = 2 };
    size_t needed = frf->count * (arrays_of_lines + options->curve_count);
    for (size_t c = 0; c < options->curve_count; c++) {
        needed += arrays_of_curve * options->curves[c].count;
    }
    memset(out, 0, sizeof *out);
    out->memory = malloc((needed + 1) * sizeof *out->memory);
    if (!out->memory) {
        return false;
    }
    double *rest = out->memory;
    double **const arrays[arrays_of_lines] = {
        &out->lines.frequency_hz,   &out->lines.magnitude_db, &out->lines.low_db,
        &out->lines.high_db,        &out->lines.phase_deg,    &out->lines.phase_low_deg,
        &out->lines.phase_high_deg, &out->lines.std_db,       &out->lines.noise_db,
    };
    for (size_t i = 0; i < arrays_of_lines; i++) {
        *arrays[i] = take(&rest, frf->count);
    }
    take_lines(frf, options->known_delay_s, &out->lines);
    for (size_t c = 0; c < options->curve_count; c++) {
        struct curve *curve = &out->curves[c];
        curve->magnitude_db = take(&rest, options->curves[c].count);
        curve->phase_deg = take(&rest, options->curves[c].count);
        curve->over_two_sigma = take(&rest, frf->count);
        take_curve(frf, &options->curves[c], options->known_delay_s, curve);
    }
    return true;
}

static const enum figure_colour curve_colours[frf_report_curves_max] = {figure_vermilion, figure_green, figure_purple,
                                                                        figure_orange};
static const enum figure_dash curve_dashes[frf_report_curves_max] = {figure_dashed, figure_solid, figure_dotted,
                                                                     figure_dash_dot};
static const enum figure_marker curve_markers[frf_report_curves_max] = {figure_cross, figure_triangle, figure_square,
                                                                        figure_diamond};

static void add_bode(const struct drawing *drawing, const struct frf_report_options *options, const char *units,
                     struct figure *figure)
{
    const struct lines *lines = &drawing->lines;
    char label[figure_text_max];
    snprintf(label, sizeof label, "magnitude in dB of 1 %s", units);
    struct figure_panel *magnitude = figure_add_panel(figure, label, axis_linear);
    struct figure_panel *phase = figure_add_panel(figure, "phase in degrees", axis_degrees);
    phase->height = 130;
    figure_add_band(magnitude, "±2 std", lines->count, lines->frequency_hz, lines->low_db, lines->high_db);
    figure_add_band(phase, "", lines->count, lines->frequency_hz, lines->phase_low_deg, lines->phase_high_deg);
    struct figure_series *points[2] = {
        figure_add_points(magnitude, "measured", lines->count, lines->frequency_hz, lines->magnitude_db),
        figure_add_points(phase, "", lines->count, lines->frequency_hz, lines->phase_deg)};
    for (size_t i = 0; i < 2; i++) {
        points[i]->size = 4;
        points[i]->colour = figure_blue;
    }
    for (size_t c = 0; c < options->curve_count; c++) {
        const struct frf_model_curve *model = &options->curves[c];
        const struct curve *curve = &drawing->curves[c];
        struct figure_series *series[2] = {
            figure_add_line(magnitude, model->name, model->count, model->frequency_hz, curve->magnitude_db),
            figure_add_line(phase, "", model->count, model->frequency_hz, curve->phase_deg)};
        for (size_t i = 0; i < 2; i++) {
            series[i]->colour = curve_colours[c];
            series[i]->dash = curve_dashes[c];
        }
    }
}

static void add_deviations(const struct drawing *drawing, const char *units, struct figure *figure)
{
    const struct lines *lines = &drawing->lines;
    char label[figure_text_max];
    snprintf(label, sizeof label, "standard deviation in dB of 1 %s", units);
    struct figure_panel *panel = figure_add_panel(figure, label, axis_linear);
    panel->height = 110;
    figure_add_line(panel, lines->noise_differs ? "total" : "std", lines->count, lines->frequency_hz, lines->std_db);
    if (lines->noise_differs) {
        figure_add_line(panel, "noise alone", lines->count, lines->frequency_hz, lines->noise_db);
    }
}

static void add_errors(const struct drawing *drawing, const struct frf_report_options *options, struct figure *figure)
{
    const struct lines *lines = &drawing->lines;
    struct figure_panel *panel = figure_add_panel(figure, "error of the model over 2 std", axis_log);
    for (size_t c = 0; c < options->curve_count; c++) {
        struct figure_series *points = figure_add_points(panel, options->curves[c].name, lines->count,
                                                         lines->frequency_hz, drawing->curves[c].over_two_sigma);
        points->colour = curve_colours[c];
        points->marker = curve_markers[c];
        points->size = 4;
    }
    figure_add_limit(panel, "1: within 2 std", 1.0);
}

static void add_sentences(struct page *page, const struct frf *frf, const struct drawing *drawing,
                          const struct frf_report_options *options)
{
    const struct lines *lines = &drawing->lines;
    page_add_paragraph(page, "From %s to %s by method %s, %zu of %zu lines valid.", frf->input, frf->output,
                       frf->method, lines->count, frf->count);
    if (options->curve_count == 0) {
        return;
    }
    page_start_list(page);
    for (size_t c = 0; c < options->curve_count; c++) {
        const struct curve *curve = &drawing->curves[c];
        page_add_item(page, options->curves[c].name, "is off by more than 2 std at %zu of %zu lines.", curve->beyond,
                      curve->compared);
    }
    page_end_list(page);
}

void frf_report_section(struct page *page, const struct frf *frf, const struct frf_report_options *options)
{
    static const struct frf_report_options none = {0};
    struct drawing drawing;
    struct figure figure;
    char units[units_size];
    options = options ? options : &none;
    page_add_section(page, "Frequency response");
    if (!make_drawing(frf, options, &drawing)) {
        page_add_paragraph(page, "Memory was short for this section.");
        return;
    }
    add_sentences(page, frf, &drawing, options);
    readable_units(frf->units, units);
    figure_start(&figure, "frequency in Hz", axis_log);
    add_bode(&drawing, options, units, &figure);
    add_deviations(&drawing, units, &figure);
    if (options->curve_count > 0) {
        add_errors(&drawing, options, &figure);
    }
    char delay[96] = "";
    if (options->known_delay_s > 0) {
        snprintf(delay, sizeof delay, " The known delay of %.4g ms is taken out of the phase.",
                 1e3 * options->known_delay_s);
    }
    page_add_figure(page, &figure,
                    "%s to %s, %zu periods; std is that of the complex value, with %.3g degrees of freedom.%s",
                    frf->input, frf->output, frf->periods, frf->degrees_of_freedom, delay);
    free(drawing.memory);
}
