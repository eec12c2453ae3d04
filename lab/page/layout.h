/* SPDX-License-Identifier: MIT */
/// Where everything in a figure stands: ranges, ticks, frames and the legend, so that no text meets another.
#ifndef SERVOSCOPE_PAGE_LAYOUT_H
#define SERVOSCOPE_PAGE_LAYOUT_H

#include "lab/page/axis.h"
#include "lab/page/figure.h"
#include "lab/page/text.h"

#include <stdbool.h>
#include <stddef.h>

/// Distances in px. The style sheet sets the same font size; text_measure_em() is an upper bound for common fonts.
enum {
    layout_font_px = 12,
    layout_line_px = 15,
    layout_edge_px = 4,
    layout_left_px = 60,     ///< left margin where the labels are no wider, so that the frames of a page are aligned
    layout_label_gap_px = 7, ///< between the frame and the tick labels
    layout_swatch_px = 24,   ///< the piece of line in a legend
    layout_swatch_gap_px = 7,
    layout_legend_lines_max = 3,
    layout_category_lines_max = 3,
    layout_label_lines_max = 2,
    layout_items_max = figure_panels_max * (figure_series_max + 1),
};

/// One entry of the legend.
struct layout_item {
    const struct figure_series *series; ///< NULL: the note on what was left out
    double x, y;                        ///< of the swatch
    size_t lines;
    struct text_span line[layout_legend_lines_max];
    char text[2 * figure_text_max];
};

struct layout {
    const struct figure *figure;
    struct axis x;
    struct axis_ticks x_ticks;
    struct axis y[figure_panels_max];
    struct axis_ticks y_ticks[figure_panels_max];
    bool empty[figure_panels_max];            ///< no series has anything to show
    bool x_blank, y_blank[figure_panels_max]; ///< no range either, and so no numbers along the axis
    double top[figure_panels_max];            ///< of the frame
    double left, width;                       ///< of all frames
    double bottom;                            ///< of the last frame
    double x_label_y;                         ///< baseline of the x label's first line
    double height;                            ///< of the figure
    bool legend_right;
    size_t items;
    struct layout_item item[layout_items_max];
};

/// Finds the layout of a figure; `out_layout` points into itself and must not be copied.
void layout_find(const struct figure *figure, struct layout *out_layout);

/// Breaks an axis label into at most layout_label_lines_max lines of `width` px; returns how many.
size_t layout_wrap_label(const char *text, double width, struct text_span *out_lines);

/// Breaks the name of a category into at most layout_category_lines_max lines that fit its place.
size_t layout_wrap_category(const struct layout *self, size_t n, struct text_span *out_lines);

/// The whole of a string.
struct text_span layout_span(const char *text);

/// Chooses the tick labels that stand without touching: decades first, then 2 and 5 where there is room.
/// Shapes:    out_shown: ticks->count
/// Units:     length of the axis in px; `along`: the text runs along the axis (x), else across it (y)
void layout_choose_labels(const struct axis *axis, const struct axis_ticks *ticks, double length, bool along,
                          bool *out_shown);

#endif
