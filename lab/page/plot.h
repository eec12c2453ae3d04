/* SPDX-License-Identifier: MIT */
/// Drawing one series inside its frame; figure.c arranges frames, axes and legends around it.
#ifndef SERVOSCOPE_PAGE_PLOT_H
#define SERVOSCOPE_PAGE_PLOT_H

#include "lab/page/axis.h"
#include "lab/page/figure.h"

#include <stdio.h>

/// The frame a series is drawn in, its upper left corner being 0, 0.
struct plot_area {
    const struct axis *x;
    const struct axis *y;
    double width, height; ///< px
    size_t bar_series;    ///< how many series of bars share the panel
};

/// One sample, for range finding and clipping.
struct plot_sample {
    double x, low, high; ///< low and high differ for bands and spans only
    bool shown;          ///< it has a place on both axes
};

/// Whether a kind has two values at each place: a band or spans.
bool plot_is_range(enum figure_kind kind);

/// Fetches sample `n` of a series and tells whether these axis kinds can show it.
struct plot_sample plot_read_sample(const struct figure_series *series, size_t n, enum axis_scale x_scale,
                                    enum axis_scale y_scale);

/// Counts the series of a panel whose kind is between `first` and `last`, both included.
size_t plot_count_kind(const struct figure_panel *panel, enum figure_kind first, enum figure_kind last);

/// Writes the series as SVG elements in px of the frame, clipped to it. `bar_index` is its place among the bar series.
void plot_write_series(FILE *out, const struct figure_series *series, const struct plot_area *area, size_t bar_index);

/// Writes the piece of line or the marker that stands for the series in a legend, 24 px wide, `y` being its middle.
void plot_write_sample(FILE *out, const struct figure_series *series, double x, double y);

/// Counts the samples that have a place on the axes but lie outside the shown range.
size_t plot_count_outside(const struct figure_series *series, const struct plot_area *area);

#endif
