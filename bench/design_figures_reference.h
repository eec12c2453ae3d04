/* SPDX-License-Identifier: MIT */
/// What the figures 2 to 5 of the first paper hold, as numbers: from an implementation of the paper's equations that
/// shares nothing with ours (Python; limits at the 1 kHz samples; L-infinity by scipy's least_squares). The published
/// plots exist as pictures only.
#ifndef SERVOSCOPE_BENCH_DESIGN_FIGURES_REFERENCE_H
#define SERVOSCOPE_BENCH_DESIGN_FIGURES_REFERENCE_H

enum { figure_kinds = 3, figure_corners = 8, figure_methods = 5 };

/// The order of everything with a method in it.
enum figure_method { figure_clip_all, figure_clip_acceleration, figure_mca, figure_linf, figure_fast };

/// One corner frequency; effective values over the acceleration limit (position-velocity: over the velocity limit times
/// 2 pi 100 Hz). NaN: not calculated there.
struct figure_reference {
    double effective[figure_methods]; ///< of fast: the best that any method found with any number of starts
    double crest_clip_all, crest_clip_acceleration, crest_mca;
    double share_percent; ///< iterations of MCA that clip the lower derivative
    double bound;         ///< no phases give more, for every instant
};

extern const double figure_corner_hz[figure_corners];
extern const char *const figure_kind_names[figure_kinds];
extern const char *const figure_method_names[figure_methods];
extern const struct figure_reference figure_references[figure_kinds][figure_corners];

#endif
