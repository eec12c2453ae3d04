/* SPDX-License-Identifier: MIT */
/// Where models are wrong: residual over its expected standard deviation against frequency, speed, position, direction,
/// time and level, and what share of the misfit lies where.
#ifndef SERVOSCOPE_DIAGNOSE_MISFIT_H
#define SERVOSCOPE_DIAGNOSE_MISFIT_H

#include <stdbool.h>
#include <stddef.h>

struct fit_data;
struct sim_model;

enum misfit_axis_kind {
    misfit_frequency, ///< Hz; torque, actuator and sensors
    misfit_speed,     ///< rad/s or m/s, with its sign
    misfit_position,  ///< rad or m
    misfit_direction, ///< -1..0 backward, 0..1 forward
    misfit_time,      ///< s since the run began
    misfit_level,     ///< size of the torque asked for, Nm or N
    misfit_axes,
};

enum misfit_model { misfit_given, misfit_extended, misfit_models };

enum { misfit_parts_max = 40 };

/// One part of an axis. `values` is the sum of squares that noise alone is expected to make there.
struct misfit_part {
    double low, high, values, squares[misfit_models];
};

/// The part of an axis where a misfit sits, from .. to: parts first .. last, of speed also those of the opposite sign.
struct misfit_range {
    bool found; ///< it lies there beyond chance, and much more densely than elsewhere
    size_t first, last;
    double low, high;         ///< of speed both positive
    double step;              ///< width of its first part: how finely it is known
    bool open_low, open_high; ///< it begins, or ends, where the axis does
    double share, values;     ///< of the misfit beyond noise, of the values: 0..1
    double density; ///< s ln(s / v) + (1 - s) ln((1 - s) / (1 - v)) of these two: 0 if it lies everywhere alike
};

struct misfit_axis {
    size_t parts; ///< 0: nothing to sort by
    struct misfit_part part[misfit_parts_max];
    struct misfit_range range[misfit_models];
};

struct misfit {
    double values;                 ///< whitened residuals of the blocks: what noise alone makes of squares
    double squares[misfit_models]; ///< their sum
    struct misfit_axis axes[misfit_axes];
};

/// Sorts what models leave of runs whose noise must have been estimated. Frequency is that of the whitened residual
/// itself; for the other axes it is brought back to time, where each sample has the same expected square, with the
/// instant's motion; time is that of every period, the others of their mean.
/// Equation:  x[n] = N^(-1/2) W_0 + (2 / N)^(1/2) sum_k (Re W_k cos(2 pi k n / N) - Im W_k sin(2 pi k n / N)),
///            sum_n x[n]^2 = sum |W|^2;  share = (squares - values there) / (squares - values of all)
/// Errors:    false if memory is short
bool misfit_find(const struct fit_data *data, const struct sim_model *given, const struct sim_model *extended,
                 struct misfit *out_misfit);

/// An axis' name with its unit: "speed_rad_per_s".
const char *misfit_axis_name(enum misfit_axis_kind kind, bool linear);

/// Share of a model's squared error that is noise: 1 where it leaves no more than noise makes.
double misfit_noise_share(const struct misfit *self, enum misfit_model model);

/// Whether a model leaves more of the blocks than chance allows.
bool misfit_is_left(const struct misfit *self, enum misfit_model model);

/// RMS of the residual over its expected standard deviation in one part; NaN where nothing was.
double misfit_rms(const struct misfit_part *part, enum misfit_model model);

/// Axes in which a model's misfit sits somewhere, the most telling first; returns how many.
size_t misfit_order(const struct misfit *self, enum misfit_model model, enum misfit_axis_kind out_axes[misfit_axes]);

#endif
