/* SPDX-License-Identifier: MIT */
/// Figures as inline SVG: panels stacked over one x axis, drawn from plain arrays, readable in colour and without.
///
///     struct figure figure;
///     figure_start(&figure, "frequency in Hz", axis_log);
///     struct figure_panel *panel = figure_add_panel(&figure, "magnitude in dB", axis_linear);
///     figure_add_band(panel, "2 sigma", n, f, low, high);
///     figure_add_points(panel, "measured", n, f, magnitude);
///     figure_add_line(panel, "model", fine_n, fine_f, model)->colour = figure_vermilion;
///     page_add_figure(&page, &figure, "Motor torque to motor speed, %zu periods.", periods);
///
/// Conventions for the whole interface:
/// - Labels are copied, arrays are borrowed until figure_write(). An `x` of NULL means 0, 1, 2, ...
/// - Values that have no place (NaN, infinite, not positive on a log axis) are gaps: a line is broken there, a point is
///   left out. An infinite edge of a band or span reaches to the edge of the frame.
/// - Nothing to draw is said: "no data" in the panel or beside the name. What lies outside a given range is clipped,
///   and the legend says how much.
/// - Colour never stands alone: every automatic colour comes with its own marker shape or dash.
#ifndef SERVOSCOPE_PAGE_FIGURE_H
#define SERVOSCOPE_PAGE_FIGURE_H

#include "lab/page/axis.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

enum {
    figure_panels_max = 6,
    figure_series_max = 16,
    figure_categories_max = 24,
    figure_text_max = 96,
    figure_width_full = 820, ///< px; the page's column
    figure_width_half = 398, ///< px; two of these stand side by side in a page row
};

enum figure_colour {
    figure_ink,
    figure_blue,
    figure_vermilion,
    figure_green,
    figure_purple,
    figure_orange,
    figure_sky,
    figure_grey,
};

/// The first five are given by themselves, in turn; eight shapes can be told apart without colour.
enum figure_marker {
    figure_circle,
    figure_triangle,
    figure_square,
    figure_cross,
    figure_diamond,
    figure_plus,
    figure_ring,
    figure_triangle_down,
};

enum figure_dash { figure_solid, figure_dashed, figure_dotted, figure_dash_dot };

enum figure_legend {
    figure_legend_auto, ///< right of the frame where names are short and the figure wide, else below
    figure_legend_right,
    figure_legend_below,
};

enum figure_kind {
    figure_line,
    figure_step,
    figure_points,
    figure_band,
    figure_stems,
    figure_bars,
    figure_limit,
    figure_spans,
};

/// One series. The add functions set everything; the fields after `y2` may then be changed.
struct figure_series {
    enum figure_kind kind;
    char name[figure_text_max]; ///< "" keeps it out of the legend
    size_t count;
    const double *x;  ///< NULL: 0, 1, 2, ...
    const double *y;  ///< the lower edge of a band or span; NULL for a limit
    const double *y2; ///< the upper edge of a band or span
    double value;     ///< where a limit lies
    enum figure_colour colour;
    enum figure_marker marker;
    enum figure_dash dash; ///< of bars: the filling
    double size;           ///< line width, marker size or bar width in px; 0: the usual one for the kind
};

struct figure_panel {
    char label[figure_text_max]; ///< "torque in Nm"
    enum axis_scale scale;
    double height;    ///< px of the frame
    double low, high; ///< shown range; NaN: from the data
    bool from_zero;   ///< the range includes 0
    size_t count;
    size_t left_out; ///< series beyond figure_series_max; the figure says how many
    struct figure_series series[figure_series_max + 1];
};

struct figure {
    char x_label[figure_text_max];
    enum axis_scale x_scale;
    double x_low, x_high; ///< shown range; NaN: from the data
    double width;         ///< px
    enum figure_legend legend;
    size_t categories; ///< > 0: x = 0, 1, ... are these names
    char category[figure_categories_max][figure_text_max];
    size_t count;
    struct figure_panel panel[figure_panels_max];
};

/// Begins an empty figure, full width, legend by itself. The x label names quantity and unit: "frequency in Hz".
void figure_start(struct figure *self, const char *x_label, enum axis_scale x_scale);

/// Names the places x = 0, 1, ... of a bar figure; the x axis then shows these names instead of numbers.
/// Range:     count <= figure_categories_max, further names are ignored
void figure_set_categories(struct figure *self, size_t count, const char *const *names);

/// Adds a panel below the others, 170 px high; its label, quantity and unit, stands above the frame.
/// Range:     at most figure_panels_max (asserted)
struct figure_panel *figure_add_panel(struct figure *self, const char *label, enum axis_scale scale);

/// Adds a series and returns it, never NULL, so that the style can be changed: `...->colour = figure_green`.
/// A panel shows figure_series_max series; further ones are counted and the figure says "... and 3 more".
/// Long lines keep the first, lowest, highest and last sample of every pixel column; points that would cover the same
/// half pixel (of more than 2000: the same pixel, or two where their shape is not a dot) are drawn once.
struct figure_series *figure_add_line(struct figure_panel *self, const char *name, size_t count, const double *x,
                                      const double *y);

/// Adds a line that holds each value until the next sample.
struct figure_series *figure_add_step(struct figure_panel *self, const char *name, size_t count, const double *x,
                                      const double *y);

/// Adds markers without a joining line, for what was measured.
struct figure_series *figure_add_points(struct figure_panel *self, const char *name, size_t count, const double *x,
                                        const double *y);

/// Adds the area between two curves. It widens an automatic range by at most half of what the other series need, so
/// that one uncertain point does not flatten the picture.
struct figure_series *figure_add_band(struct figure_panel *self, const char *name, size_t count, const double *x,
                                      const double *low, const double *high);

/// Adds a vertical line from low to high at each place, for the uncertainty of points that nothing joins. The range as
/// with a band.
struct figure_series *figure_add_spans(struct figure_panel *self, const char *name, size_t count, const double *x,
                                       const double *low, const double *high);

/// Adds a line from zero (the lower edge, on a log axis) to each value, for spectra.
struct figure_series *figure_add_stems(struct figure_panel *self, const char *name, size_t count, const double *x,
                                       const double *y);

/// Adds bars from zero with their values written above; several series stand side by side.
struct figure_series *figure_add_bars(struct figure_panel *self, const char *name, size_t count, const double *x,
                                      const double *y);

/// Adds a horizontal line. One far beyond the data (more than three times its range away) does not stretch an
/// automatic range; the legend then says that it is off the scale, and its value.
struct figure_series *figure_add_limit(struct figure_panel *self, const char *name, double value);

/// Writes the figure as one <svg> element. Colours come from the style sheet that figure_write_style() writes.
/// Test:      tests/unit/test_page.c
void figure_write(const struct figure *self, FILE *out);

/// Writes the CSS rules of all figures, for light and dark screens and for print; once per page, inside <style>.
void figure_write_style(FILE *out);

/// Writes the script that shows the values under the cursor, in all figures with the same x label at once. A page reads
/// the same without it.
void figure_write_script(FILE *out);

#endif
