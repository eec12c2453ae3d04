/* SPDX-License-Identifier: MIT */
#include "lab/tune/report.h"

#include "lab/estimate/report.h"
#include "lab/page/layout.h"
#include "lab/tune/say.h"

#include <complex.h>
#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double two_pi = 6.283185307179586;
static const double degrees_per_rad = 57.29577951308232;

static double decibel(double magnitude)
{
    return 20.0 * log10(magnitude); // minus infinity for 0: a gap in the figure
}

enum { grid_points = 400, curve_arrays = 13, grid_arrays = 3 };

/// Every figure's numbers: of the measured lines, which nothing joins, and of the reference on a grid of its own.
struct curves {
    size_t count;
    double *memory;
    double *frequency_hz;
    double *open_db, *open_low_db, *open_high_db, *open_deg, *open_deg_low, *open_deg_high;
    double *sensitivity_db, *closed_db, *closed_deg, *over_two_std;
    double *real, *imag;
    double *grid_hz, *reference_db, *reference_deg; ///< grid_points values each
};

/// Follows the phase along frequency; the first value lies in -270 .. 90 degrees.
static void unwrap(size_t count, double *phase_deg)
{
    double centre = -90.0;
    for (size_t k = 0; k < count; k++) {
        phase_deg[k] -= 360.0 * round((phase_deg[k] - centre) / 360.0);
        centre = phase_deg[k];
    }
}

/// T = L/(1+L) of a loop L whose relative standard deviation is s has |T| s / |1+L|.
static void set_point(const struct tune_result *result, size_t k, struct curves *out)
{
    const double complex loop = result->loop[k], closed = loop / (1.0 + loop);
    const double relative = result->plant.std[k] / cabs(result->plant.response[k]);
    const double closed_std = cabs(closed) * relative / cabs(1.0 + loop);
    const bool known = result->plant.std_known && closed_std > 0.0;
    const double share = 2.0 * relative;
    out->frequency_hz[k] = result->plant.frequency_hz[k];
    out->open_db[k] = decibel(cabs(loop));
    out->open_low_db[k] = decibel(cabs(loop) * fmax(1.0 - share, 0.0));
    out->open_high_db[k] = decibel(cabs(loop) * (1.0 + share));
    out->open_deg[k] = degrees_per_rad * carg(loop);
    out->open_deg_high[k] = degrees_per_rad * (share < 1.0 ? asin(share) : 0.5 * two_pi);
    out->sensitivity_db[k] = decibel(1.0 / cabs(1.0 + loop));
    out->closed_db[k] = decibel(cabs(closed));
    out->closed_deg[k] = degrees_per_rad * carg(closed);
    out->over_two_std[k] = known ? cabs(closed - result->reference[k]) / (2.0 * closed_std) : NAN;
    out->real[k] = creal(loop);
    out->imag[k] = cimag(loop);
}

static void set_reference(const struct tune_result *result, struct curves *out)
{
    const double first = out->frequency_hz[0], last = out->frequency_hz[out->count - 1];
    for (size_t i = 0; i < grid_points; i++) {
        out->grid_hz[i] = first * pow(last / first, (double)i / (grid_points - 1));
        const double complex reference = tune_reference_at(&result->solution.reference, out->grid_hz[i]);
        out->reference_db[i] = decibel(cabs(reference));
        out->reference_deg[i] = degrees_per_rad * carg(reference);
    }
    unwrap(grid_points, out->reference_deg);
}

static bool make_curves(const struct tune_result *result, struct curves *out)
{
    out->count = result->plant.count;
    out->memory = malloc((curve_arrays * out->count + (size_t)grid_arrays * grid_points) * sizeof *out->memory);
    if (!out->memory) {
        return false;
    }
    double **const of_lines[] = {
        &out->open_db,       &out->open_low_db,    &out->open_high_db, &out->open_deg,   &out->open_deg_low,
        &out->open_deg_high, &out->sensitivity_db, &out->closed_db,    &out->closed_deg, &out->over_two_std,
        &out->real,          &out->imag,           &out->frequency_hz,
    };
    double **const of_grid[grid_arrays] = {&out->grid_hz, &out->reference_db, &out->reference_deg};
    double *rest = out->memory;
    for (size_t i = 0; i < sizeof of_lines / sizeof of_lines[0]; i++, rest += out->count) {
        *of_lines[i] = rest;
    }
    for (size_t i = 0; i < grid_arrays; i++, rest += grid_points) {
        *of_grid[i] = rest;
    }
    for (size_t k = 0; k < out->count; k++) {
        set_point(result, k, out);
    }
    unwrap(out->count, out->open_deg);
    unwrap(out->count, out->closed_deg);
    for (size_t k = 0; k < out->count; k++) {
        out->open_deg_low[k] = out->open_deg[k] - out->open_deg_high[k];
        out->open_deg_high[k] = out->open_deg[k] + out->open_deg_high[k];
    }
    set_reference(result, out);
    return true;
}

// ---- Words and tables

static void add_gains(struct page *page, const struct tune_result *result)
{
    char text[say_size];
    const struct tune_controller *controller = &result->solution.controller;
    for (size_t i = 0; i < controller->structure->gains; i++) {
        say_gain(result, i, "±", text);
        page_add_pair(page, tune_term_symbol(controller->structure->terms[i]), "%s", text);
    }
    if (controller->corner_hz > 0.0) {
        page_add_pair(page, "Derivative", "filtered, a = exp(-2 pi f Ts) with f = %.5g Hz", controller->corner_hz);
    }
    if (controller->filter.on) {
        const struct tune_filter *f = &controller->filter;
        say_filter(f, text);
        page_add_pair(page, "Filter C(z)", "%s: b = %.9g, %.9g, %.9g; a = 1, %.9g, %.9g", text, f->b[0], f->b[1],
                      f->b[2], f->a[1], f->a[2]);
    }
}

static void add_setup(struct page *page, const struct tune_result *result)
{
    const struct tune_solution *solution = &result->solution;
    const struct tune_reference *reference = &solution->reference;
    const struct say_model_controller model = say_model_controller(result);
    page_start_pairs(page);
    page_add_pair(page, "Controller", "K(z) = %s, at %.6g Hz, from the %s error to %s",
                  solution->controller.structure->form, solution->controller.rate_hz,
                  result->plant.output == tune_output_velocity ? "velocity" : "position", result->plant.effort_unit);
    add_gains(page, result);
    if (model.exists) {
        page_add_pair(page, "In a model file",
                      "%s %.6g, velocity_integral_time_s %.6g (its integral begins a sample "
                      "later)",
                      model.gain_name, model.gain, model.integral_time_s);
    }
    page_add_pair(page, "Reference", "second order of %.5g Hz, damping %.3g, %.3g sample(s) of delay",
                  reference->bandwidth_hz, reference->damping, reference->delay_samples);
    page_add_pair(page, "Fit", "%s least squares, %s weighting; error against the reference %.2f dB (weighted RMS)",
                  solution->reweighted ? "reweighted" : "linear",
                  result->weighting == tune_weighting_log ? "log-frequency" : "flat", 10.0 * log10(solution->cost));
    if (result->resonance.found) {
        page_add_pair(page, "Resonance found", "%.4g Hz, damping %.3g, %.3g dB high", result->resonance.frequency_hz,
                      result->resonance.damping, result->resonance.prominence_db);
    }
    page_end_pairs(page);
}

static void add_margins(struct page *page, const struct tune_result *result)
{
    static const char *const heads[] = {"margin", "value", "std", "unit", "at Hz"};
    struct say_margin margins[say_margins_max];
    const size_t count = say_margins(result, margins);
    page_start_table(page, "Margins", "lrrlr", heads);
    for (size_t i = 0; i < count; i++) {
        char value[32], std[32], at[32];
        if (!isfinite(margins[i].value)) {
            if (margins[i].none) {
                const char *cells[] = {margins[i].name, NULL, NULL, margins[i].none, NULL};
                page_add_row(page, cells);
            }
            continue;
        }
        snprintf(value, sizeof value, "%.4g", margins[i].value);
        snprintf(std, sizeof std, "%.2g", margins[i].std);
        snprintf(at, sizeof at, "%.4g", margins[i].at_hz);
        const char *cells[] = {margins[i].name, value, isfinite(margins[i].std) ? std : NULL, margins[i].unit,
                               isfinite(margins[i].at_hz) ? at : NULL};
        page_add_row(page, cells);
    }
    page_end_table(page);
    if (result->deviation.known) {
        page_add_paragraph(page,
                           "Standard deviations follow from those of the response, by %d responses drawn from it: of "
                           "gains, how they would scatter if the measurement were repeated; of margins, how well those "
                           "of the gains above are known. %zu of the %d drawn loops are stable.",
                           (int)tune_draws, result->deviation.stable, (int)tune_draws);
    }
}

static void add_warnings(struct page *page, const struct tune_result *result)
{
    for (size_t i = 0; i < result->warning_count; i++) {
        const char *text = result->warnings[i];
        page_add_note(page, page_warning, "Mind", "%c%s.", toupper((unsigned char)text[0]), text + 1);
    }
}

static void add_verdict(struct page *page, const struct tune_result *result)
{
    char gains[say_size], performance[say_size];
    say_gains(&result->plant, &result->solution.controller, gains);
    say_performance(result, performance);
    page_add_note(page, page_good, gains, "%s", performance);
    add_warnings(page, result);
}

static void add_stability(struct page *page, const struct tune_result *result)
{
    const struct nyquist *nyquist = &result->solution.nyquist;
    page_add_paragraph(page,
                       "Stable by Nyquist's criterion: from 0 Hz to half the rate the open loop does not turn round "
                       "-1, which it passes at a distance of %.3g at %.4g Hz. This takes for granted that",
                       nyquist->worst_distance, nyquist->worst_hz);
    page_start_list(page);
    for (size_t i = 0; i < nyquist_assumptions; i++) {
        page_add_item(page, "", "%s.", nyquist->assumptions[i]);
    }
    page_end_list(page);
}

// ---- Figures

/// Measured lines in a figure of several panels.
static void add_lines(struct figure_panel *panel, const char *name, const struct curves *curves, const double *values,
                      enum figure_colour colour)
{
    struct figure_series *points = figure_add_points(panel, name, curves->count, curves->frequency_hz, values);
    points->colour = colour;
    points->marker = colour == figure_blue ? figure_circle : figure_triangle;
}

static void add_open_loop(struct page *page, const struct tune_result *result, const struct curves *curves)
{
    struct figure figure;
    const size_t count = curves->count;
    const double *f = curves->frequency_hz;
    figure_start(&figure, "frequency in Hz", axis_log);
    struct figure_panel *magnitude = figure_add_panel(&figure, "open loop K G in dB", axis_linear);
    struct figure_panel *phase = figure_add_panel(&figure, "phase of K G in degrees", axis_degrees);
    phase->height = 130;
    if (result->plant.std_known) {
        figure_add_spans(magnitude, "±2 std", count, f, curves->open_low_db, curves->open_high_db)->colour =
            figure_blue;
        figure_add_spans(phase, "", count, f, curves->open_deg_low, curves->open_deg_high)->colour = figure_blue;
    }
    add_lines(magnitude, "K G, measured lines", curves, curves->open_db, figure_blue);
    add_lines(phase, "", curves, curves->open_deg, figure_blue);
    figure_add_limit(magnitude, "0 dB", 0.0);
    figure_add_limit(phase, "-180 degrees", -180.0);
    page_add_figure(page, &figure,
                    "Open loop: controller times measured response. Its phase has every delay in it, that of the hold "
                    "too: they all count for stability.");
}

static void add_closed_loop(struct page *page, const struct tune_result *result, const struct curves *curves)
{
    struct figure figure;
    figure_start(&figure, "frequency in Hz", axis_log);
    struct figure_panel *closed = figure_add_panel(&figure, "T = KG/(1+KG) in dB", axis_linear);
    struct figure_panel *phase = figure_add_panel(&figure, "phase of T in degrees", axis_degrees);
    struct figure_panel *residual = figure_add_panel(&figure, "residual over 2 std: T less reference", axis_log);
    struct figure_panel *sensitivity = figure_add_panel(&figure, "S = 1/(1+KG) in dB", axis_linear);
    struct figure_series *reference[2];
    closed->low = -40.0;
    phase->height = 110;
    residual->height = 110;
    sensitivity->low = -40.0;
    reference[0] = figure_add_line(closed, "reference M", grid_points, curves->grid_hz, curves->reference_db);
    reference[1] = figure_add_line(phase, "", grid_points, curves->grid_hz, curves->reference_deg);
    for (size_t i = 0; i < 2; i++) {
        reference[i]->colour = figure_vermilion;
        reference[i]->dash = figure_dashed;
    }
    add_lines(closed, "T, measured lines", curves, curves->closed_db, figure_blue);
    add_lines(phase, "", curves, curves->closed_deg, figure_blue);
    figure_add_limit(closed, "-3 dB", -10.0 * log10(2.0));
    add_lines(residual, result->plant.std_known ? "T" : "T: the file has no std", curves, curves->over_two_std,
              figure_blue);
    figure_add_limit(residual, "1: within 2 std", 1.0);
    add_lines(sensitivity, "S, measured lines", curves, curves->sensitivity_db, figure_green);
    figure_add_limit(sensitivity, "6 dB", decibel(2.0));
    page_add_figure(page, &figure,
                    "Complementary sensitivity T (command to response) beside the reference M, and sensitivity S "
                    "(what is left of a disturbance). A residual above 1 is no noise: the controller has too few gains "
                    "to give the reference there.");
}

enum { circle_points = 181 };

static void fill_circle(double centre, double radius, double *out_x, double *out_y)
{
    for (size_t i = 0; i < circle_points; i++) {
        const double angle = two_pi * (double)i / (circle_points - 1);
        out_x[i] = centre + radius * cos(angle);
        out_y[i] = radius * sin(angle);
    }
}

static void add_nyquist(struct page *page, const struct tune_result *result, const struct curves *curves)
{
    const double shown = 2.0, minus_one = -1.0, zero = 0.0;
    double unit[2][circle_points], modulus[2][circle_points];
    struct figure figure;
    struct layout *layout = malloc(sizeof *layout);
    if (!layout) {
        page_add_paragraph(page, "Memory was short for this figure.");
        return;
    }
    fill_circle(0.0, 1.0, unit[0], unit[1]);
    fill_circle(-1.0, 1.0 / result->margins.modulus, modulus[0], modulus[1]);
    figure_start(&figure, "real part of K G", axis_linear);
    figure.width = 0.7 * figure_width_full;
    figure.legend = figure_legend_below;
    figure.x_low = -shown - 0.5;
    figure.x_high = shown - 0.5;
    struct figure_panel *panel = figure_add_panel(&figure, "imaginary part of K G", axis_linear);
    panel->low = -shown;
    panel->high = shown;
    struct figure_series *circle = figure_add_line(panel, "unit circle", circle_points, unit[0], unit[1]);
    circle->colour = figure_grey;
    circle->dash = figure_dotted;
    circle = figure_add_line(panel, "modulus margin: no nearer to -1", circle_points, modulus[0], modulus[1]);
    circle->colour = figure_vermilion;
    circle->dash = figure_dashed;
    struct figure_series *lines =
        figure_add_points(panel, "K G, measured lines", curves->count, curves->real, curves->imag);
    lines->colour = figure_blue;
    lines->size = 4;
    struct figure_series *point = figure_add_points(panel, "-1", 1, &minus_one, &zero);
    point->colour = figure_vermilion;
    point->marker = figure_cross;
    point->size = 9;
    // The frame's width is known after laying out; a circle has to look like one.
    layout_find(&figure, layout);
    panel->height = layout->width;
    page_add_figure(page, &figure,
                    "Nyquist plot of the measured lines; the dashed circle has the radius 1/max|S| = "
                    "%.3g.",
                    1.0 / result->margins.modulus);
    free(layout);
}

void tune_report_sections(struct page *page, const struct frf *frf, const struct tune_result *result)
{
    struct curves curves;
    const bool drawn = make_curves(result, &curves);
    add_verdict(page, result);
    page_add_section(page, "Closed loop");
    if (drawn) {
        add_closed_loop(page, result, &curves);
    } else {
        page_add_paragraph(page, "Memory was short for the figures.");
    }
    page_add_section(page, "Margins");
    add_margins(page, result);
    page_add_section(page, "Controller");
    add_setup(page, result);
    page_add_section(page, "Why it is stable");
    add_stability(page, result);
    if (drawn) {
        add_open_loop(page, result, &curves);
        add_nyquist(page, result, &curves);
        free(curves.memory);
    }
    frf_report_section(page, frf, NULL);
}
