/* SPDX-License-Identifier: MIT */
#include "lab/estimate/report_distortion.h"

#include "lab/estimate/report_lines.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>

enum { curve_response, curve_noise, curve_total, curve_odd, curve_even, curve_thd, curve_count };

struct levels {
    double *memory;
    size_t count;
    double *frequency_hz;
    double *decibel[curve_count];
    size_t known[curve_count];
    bool total_differs; ///< from the noise: there are realisations
};

/// A gap in the figure for what is not known or 0.
static double decibel(double magnitude)
{
    return magnitude > 0.0 ? 20.0 * log10(magnitude) : NAN;
}

static void take_line(const struct frf *frf, size_t line, const double *thd_db, struct levels *io)
{
    const double values[curve_count] = {
        [curve_response] = decibel(hypot(frf->real[line], frf->imag[line])),
        [curve_noise] = decibel(frf->noise_std[line]),
        [curve_total] = decibel(frf->std[line]),
        [curve_odd] = decibel(frf->odd_distortion[line]),
        [curve_even] = decibel(frf->even_distortion[line]),
        [curve_thd] = thd_db ? thd_db[line] : NAN,
    };
    io->frequency_hz[io->count] = frf->frequency_hz[line];
    for (int curve = 0; curve < curve_count; curve++) {
        io->decibel[curve][io->count] = values[curve];
        io->known[curve] += !isnan(values[curve]);
    }
    io->total_differs = io->total_differs || fabs(values[curve_total] - values[curve_noise]) > 1e-9;
    io->count++;
}

static bool take_levels(const struct frf *frf, const double *thd_db, struct levels *out)
{
    *out = (struct levels){.memory = malloc((curve_count + 1) * frf->count * sizeof *out->memory)};
    if (!out->memory) {
        return false;
    }
    out->frequency_hz = out->memory;
    for (int curve = 0; curve < curve_count; curve++) {
        out->decibel[curve] = out->memory + (size_t)(curve + 1) * frf->count;
    }
    for (size_t line = 0; line < frf->count; line++) {
        if (frf->valid[line]) {
            take_line(frf, line, thd_db, out);
        }
    }
    return true;
}

static bool any_known(const struct frf *frf, const double *thd_db)
{
    for (size_t line = 0; line < frf->count; line++) {
        if (thd_db || frf_known(frf->odd_distortion[line]) || frf_known(frf->even_distortion[line])) {
            return true;
        }
    }
    return false;
}

/// A curve without a point, odd distortion where only odd lines are excited, has no place in the legend either.
static void add_points(struct figure_panel *panel, const char *name, const struct levels *levels, int curve,
                       enum figure_colour colour, enum figure_marker marker)
{
    if (levels->known[curve] == 0) {
        return;
    }
    struct figure_series *points =
        figure_add_points(panel, name, levels->count, levels->frequency_hz, levels->decibel[curve]);
    points->colour = colour;
    points->marker = marker;
}

static void add_levels(struct page *page, const struct frf *frf, const struct levels *levels)
{
    struct figure figure;
    char units[report_units_size];
    char label[figure_text_max];
    report_units(frf->units, units);
    snprintf(label, sizeof label, "level in dB, 0 dB is %s", units);
    figure_start(&figure, "frequency in Hz", axis_log);
    struct figure_panel *panel = figure_add_panel(&figure, label, axis_linear);
    add_points(panel, "response", levels, curve_response, figure_blue, figure_circle);
    add_points(panel, levels->total_differs ? "std of the noise" : "std", levels, curve_noise, figure_grey,
               figure_cross);
    if (levels->total_differs) {
        add_points(panel, "std, total", levels, curve_total, figure_ink, figure_diamond);
    }
    add_points(panel, "odd", levels, curve_odd, figure_vermilion, figure_triangle);
    add_points(panel, "even", levels, curve_even, figure_green, figure_square);
    page_add_figure(
        page, &figure,
        "Distortion of odd and of even order, from the bins between the lines that nothing excites, as output "
        "over input. A line without a point has none above the noise (5 %% of a linear drive's lines have "
        "one), or too few free bins near it.");
}

static void add_harmonics(struct page *page, const struct levels *levels)
{
    if (levels->known[curve_thd] == 0) {
        page_add_paragraph(page, "None of the %zu sines has harmonics above the noise.", levels->count);
        return;
    }
    struct figure figure;
    figure_start(&figure, "frequency in Hz", axis_log);
    struct figure_panel *panel = figure_add_panel(&figure, "total harmonic distortion in dB", axis_linear);
    figure_add_points(panel, "", levels->count, levels->frequency_hz, levels->decibel[curve_thd]);
    page_add_figure(
        page, &figure,
        "Power at all harmonics over that of the sine, of the output. %zu of %zu sines have harmonics above "
        "the noise.",
        levels->known[curve_thd], levels->count);
}

void frf_report_distortion_section(struct page *page, const struct frf *frf, const double *thd_db)
{
    struct levels levels;
    if (!any_known(frf, thd_db)) {
        return;
    }
    page_add_section(page, "Nonlinear distortion");
    if (!take_levels(frf, thd_db, &levels)) {
        page_add_paragraph(page, "Memory was short for this section.");
        return;
    }
    if (any_known(frf, NULL)) {
        add_levels(page, frf, &levels);
    }
    if (thd_db) {
        add_harmonics(page, &levels);
    }
    free(levels.memory);
}
