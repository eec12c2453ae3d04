/* SPDX-License-Identifier: MIT */
/// Controllers that are linear in their gains, as named structures; this table is the only place that knows them all.
#ifndef SERVOSCOPE_TUNE_CONTROLLER_H
#define SERVOSCOPE_TUNE_CONTROLLER_H

#include "lab/record/error.h"
#include "lab/tune/filter.h"

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

enum { tune_gains_max = 3 };

/// Parts of a controller, with q = z^-1: 1, Ts/(1 - q) (the integral includes the present sample), and
/// (1 - q)/Ts (1 - a)/(1 - a q) with a = exp(-2 pi Ts times the corner frequency).
enum tune_term { tune_proportional, tune_integral, tune_derivative };

enum tune_filter_kind { tune_filter_none, tune_filter_notch, tune_filter_biquad };

struct tune_structure {
    const char *name;    ///< as given to --controller
    const char *summary; ///< one line
    const char *form;    ///< equation, for people
    size_t gains;
    enum tune_term terms[tune_gains_max];
    enum tune_filter_kind filter;
    double corner_ratio; ///< default corner of the derivative over the bandwidth; 0: has none
    bool leads;          ///< has phase lead: can hold a position
};

/// All structures; the last one has no name.
extern const struct tune_structure tune_structures[];

/// Finds a structure by name.
/// Errors: NULL for one that is not there; *out_error (error_usage) lists those that are.
const struct tune_structure *tune_structure_find(const char *name, struct error *out_error);

/// A controller: K(z) = C(z) sum_i gain_i term_i(z).
struct tune_controller {
    const struct tune_structure *structure;
    double rate_hz;
    double corner_hz; ///< of the derivative, 0 if there is none
    struct tune_filter filter;
    double gain[tune_gains_max];
};

/// Evaluates term i with the filter, without its gain, at delay = exp(-j w Ts).
/// Range: delay != 1 for the integral
double complex tune_controller_term(const struct tune_controller *self, size_t i, double complex delay);

/// Evaluates K at delay = exp(-j w Ts).
double complex tune_controller_at(const struct tune_controller *self, double complex delay);

/// What a term and its gain are called: "proportional" and "Kp", and its power of s (-1 for the integral).
const char *tune_term_name(enum tune_term term);
const char *tune_term_symbol(enum tune_term term);
int tune_term_power(enum tune_term term);

#endif
