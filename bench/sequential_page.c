/* SPDX-License-Identifier: MIT */
#include "bench/sequential_page.h"

#include "lab/page/page.h"

#include <math.h>
#include <stdio.h>

const char *const sequential_kind_names[sequential_kinds] = {"one multisine", "octaves", "sine dwell"};

static const enum figure_colour colours[sequential_kinds] = {figure_vermilion, figure_blue, figure_green};
static const enum figure_dash dashes[sequential_kinds] = {figure_dashed, figure_solid, figure_dash_dot};
static const enum figure_marker markers[sequential_kinds] = {figure_triangle, figure_circle, figure_square};

/// What figures borrow until they are written.
struct curves {
    double hz[sequential_lines];
    double linear_db[sequential_lines];
    double linear_deg[sequential_lines];
    double measured_db[sequential_kinds][sequential_lines];
    double measured_deg[sequential_kinds][sequential_lines];
    double error_db[sequential_kinds][sequential_lines];
};

static double degrees(double complex response)
{
    const double angle = carg(response) * 57.29577951308232;
    return angle > 5.0 ? angle - 360.0 : angle; // the plant only lags
}

static void fill(const struct sequential_results *results, struct curves *out_curves)
{
    for (size_t k = 0; k < sequential_lines; k++) {
        const double hz = (double)(k + 1) * sequential_rate_hz / sequential_samples;
        const double complex linear = cubic_plant_response(&cubic_plant_paper, hz);
        out_curves->hz[k] = hz;
        out_curves->linear_db[k] = 20.0 * log10(cabs(linear));
        out_curves->linear_deg[k] = degrees(linear);
        for (size_t kind = 0; kind < sequential_kinds; kind++) {
            const double complex measured = results->response[kind][k];
            out_curves->measured_db[kind][k] = 20.0 * log10(cabs(measured));
            out_curves->measured_deg[kind][k] = degrees(measured);
            out_curves->error_db[kind][k] = fabs(out_curves->measured_db[kind][k] - out_curves->linear_db[k]);
        }
    }
}

static void add_response(struct page *page, const struct curves *curves, enum sequential_kind kind, int paper_figure)
{
    static struct figure figure;
    figure_start(&figure, "frequency in Hz", axis_log);
    struct figure_panel *magnitude = figure_add_panel(&figure, "magnitude in dB re 1 m/N", axis_linear);
    magnitude->height = 220;
    figure_add_line(magnitude, "linearised", sequential_lines, curves->hz, curves->linear_db)->colour = figure_ink;
    struct figure_series *measured = figure_add_line(magnitude, sequential_kind_names[kind], sequential_lines,
                                                     curves->hz, curves->measured_db[kind]);
    measured->colour = colours[kind];
    measured->dash = figure_dashed;
    struct figure_panel *phase = figure_add_panel(&figure, "phase in degrees", axis_degrees);
    figure_add_line(phase, "", sequential_lines, curves->hz, curves->linear_deg)->colour = figure_ink;
    measured = figure_add_line(phase, "", sequential_lines, curves->hz, curves->measured_deg[kind]);
    measured->colour = colours[kind];
    measured->dash = figure_dashed;
    page_add_figure(page, &figure, "As figure %d of the paper: %s, A = 1 N, 10 s to settle.", paper_figure,
                    sequential_kind_names[kind]);
}

static void add_errors(struct page *page, const struct curves *curves)
{
    static struct figure figure;
    figure_start(&figure, "frequency in Hz", axis_log);
    struct figure_panel *panel = figure_add_panel(&figure, "error of the magnitude in dB", axis_log);
    panel->height = 300;
    for (size_t kind = 0; kind < sequential_kinds; kind++) {
        struct figure_series *line =
            figure_add_line(panel, sequential_kind_names[kind], sequential_lines, curves->hz, curves->error_db[kind]);
        line->colour = colours[kind];
        line->dash = dashes[kind];
    }
    page_add_figure(page, &figure,
                    "Error against the linearised plant, A = 1 N. Above 6 Hz the sequences are better by a factor of "
                    "hundreds; from 1.6 to 3.1 Hz they are worse.");
}

static void add_scan(struct page *page, const struct sequential_results *results)
{
    static struct figure figure;
    figure_start(&figure, "amplitude A in N", axis_log);
    const char *labels[2] = {"RMS error in dB, all lines", "RMS error in dB, above 6 Hz"};
    for (int p = 0; p < 2; p++) {
        struct figure_panel *panel = figure_add_panel(&figure, labels[p], axis_log);
        panel->height = 190;
        for (size_t kind = 0; kind < sequential_kinds; kind++) {
            const double *values = p == 0 ? results->scan_db[kind] : results->scan_above_db[kind];
            struct figure_series *line =
                figure_add_line(panel, "", sequential_amplitudes, results->amplitude_N, values);
            line->colour = colours[kind];
            line->dash = dashes[kind];
            struct figure_series *points = figure_add_points(panel, p == 0 ? sequential_kind_names[kind] : "",
                                                             sequential_amplitudes, results->amplitude_N, values);
            points->colour = colours[kind];
            points->marker = markers[kind];
        }
    }
    page_add_figure(
        page, &figure,
        "Settled (200 s; dwell 100 s): over all lines one multisine is the best at low amplitude, above 6 Hz "
        "the sequences are at every amplitude.");
}

static void add_distortion(struct page *page, const struct sequential_results *results, const struct curves *curves)
{
    static struct figure figure;
    figure_start(&figure, "frequency of the tone in Hz", axis_log);
    struct figure_panel *panel = figure_add_panel(&figure, "harmonics over the tone in dB", axis_linear);
    panel->height = 260;
    struct figure_series *settled = figure_add_line(panel, "50 s to settle, from rest", sequential_lines, curves->hz,
                                                    results->settled_distortion_db);
    settled->colour = figure_blue;
    struct figure_series *carried =
        figure_add_line(panel, "10 s to settle, upwards", sequential_lines, curves->hz, results->carried_distortion_db);
    carried->colour = figure_orange;
    carried->dash = figure_dashed;
    page_add_figure(
        page, &figure,
        "Total harmonic distortion from sine dwell, as figure 5 of the paper shows it of its telescope. Near "
        "3 Hz two states are stable, and which one is seen depends on where the tone starts; the rest of the "
        "difference is transient that 10 s leave.");
}

static void add_table(struct page *page, const struct sequential_results *results)
{
    static const char *const heads[] = {"excitation", "test time [s]", "0.1-1.6 Hz", "1.6-3.2 Hz",
                                        "3.2-6.4 Hz", "6.4-12.8 Hz",   "12.8-25 Hz"};
    page_start_table(page, "RMS error in dB in each octave, A = 1 N, 10 s to settle.", "lrrrrrr", heads);
    for (size_t kind = 0; kind < sequential_kinds; kind++) {
        char text[sequential_octave_count + 1][24];
        const char *cells[sequential_octave_count + 2] = {sequential_kind_names[kind], text[0]};
        snprintf(text[0], sizeof text[0], "%.0f", results->test_time_s[kind]);
        for (size_t o = 0; o < sequential_octave_count; o++) {
            snprintf(text[o + 1], sizeof text[o + 1], "%.3g", results->octave_db[kind][o]);
            cells[o + 2] = text[o + 1];
        }
        page_add_row(page, cells);
    }
    page_end_table(page);
}

int sequential_page_write(const char *path, const struct sequential_results *results)
{
    static struct curves curves;
    struct page page;
    FILE *stream = fopen(path, "w");
    if (!stream) {
        return -1;
    }
    fill(results, &curves);
    page_start(&page, stream, "Sequential multisines on two masses with cubic springs",
               "Second paper, section 9: 250 lines 0.1 to 25 Hz, 500 Hz, no noise");
    page_add_note(
        &page, page_warning, "Better above 6 Hz, worse around the mode",
        "Above 6 Hz octaves are off by %.4f dB (RMS) where one multisine is off by %.2f dB. From 1.5 to 6 Hz it is "
        "%.2f dB against %.2f dB: the octave around the mode gets all the power, and answers with twice the period.",
        results->above_db[sequential_octaves], results->above_db[sequential_single],
        results->middle_db[sequential_octaves], results->middle_db[sequential_single]);
    page_add_section(&page, "Responses");
    add_response(&page, &curves, sequential_single, 2);
    add_response(&page, &curves, sequential_dwell, 3);
    add_response(&page, &curves, sequential_octaves, 4);
    page_add_section(&page, "Errors");
    add_errors(&page, &curves);
    add_table(&page, results);
    page_add_section(&page, "Smaller amplitudes");
    add_scan(&page, results);
    page_add_section(&page, "Harmonic distortion");
    add_distortion(&page, results, &curves);
    const int failed = page_end(&page, NULL);
    return fclose(stream) != 0 ? -1 : failed;
}
