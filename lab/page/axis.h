/* SPDX-License-Identifier: MIT */
/// Axes: from values to a place on the paper, and the ticks a person would have drawn.
#ifndef SERVOSCOPE_PAGE_AXIS_H
#define SERVOSCOPE_PAGE_AXIS_H

#include <stdbool.h>
#include <stddef.h>

enum axis_scale {
    axis_linear,
    axis_log,
    axis_degrees, ///< linear, ticks at parts of a full turn: ..., 15, 30, 45, 90, 180
};

/// The shown range. `low < high`; for axis_log both > 0. axis_fit() makes one of any data.
struct axis {
    enum axis_scale scale;
    double low;
    double high;
};

enum { axis_ticks_max = 96, axis_label_max = 24 };

enum axis_rank {
    axis_minor,     ///< a short mark, no label
    axis_secondary, ///< labelled where there is room (2 and 5 in a decade)
    axis_primary,
};

struct axis_tick {
    double value;
    enum axis_rank rank;
    char label[axis_label_max]; ///< UTF-8, with a real minus sign; "" if minor
};

struct axis_ticks {
    size_t count;
    int exponent; ///< labels are the values over 10^exponent; 0: as they are; a multiple of 3
    struct axis_tick tick[axis_ticks_max];
};

/// Tells whether a value has a place on this kind of axis: finite, below 1e100 in size, positive for axis_log.
bool axis_can_show(enum axis_scale scale, double value);

/// Makes the shown range from the smallest and largest value and a margin.
/// Units:     margin as a share of the range, on each side (of the decades, for axis_log)
/// A range of no or hardly any width is widened around its value, and `low > high` (no data) gives 0..1 or 0.1..10.
void axis_fit(enum axis_scale scale, double low, double high, double margin, struct axis *out_axis);

/// Maps a value to 0 (low end) .. 1 (high end); beyond that for values outside, NaN for values that cannot be shown.
double axis_map(const struct axis *self, double value);

/// Finds ticks: steps of 1, 2 or 5 times a power of ten (or parts of a turn), decades with 2..9 as minor ticks.
/// Range:     target: about how many labels there is room for, >= 2
/// Ticks come in ascending order, three labels at least where a step of this kind allows. A log axis shorter than .7
/// decades gets the ticks of a linear one. Test:      tests/unit/test_axis.c
void axis_find_ticks(const struct axis *self, size_t target, struct axis_ticks *out_ticks);

#endif
