/* SPDX-License-Identifier: MIT */
/// Excitations that might show what the one at hand does not: the same lines at other levels, over more of the travel,
/// at a speed that does not reverse, at higher frequencies, for longer; each within the limits of the axis.
///
/// Another place to begin from is not among them: a run counts its position from where the axis stood, so that two runs
/// from two places cannot be compared by position. The slow stroke sees both places in one run.
#ifndef SERVOSCOPE_EXPERIMENT_VARIANT_H
#define SERVOSCOPE_EXPERIMENT_VARIANT_H

#include "lab/design/design.h"
#include "lab/design/offset.h"

enum { variant_tables_max = 2 };

enum variant_kind {
    variant_as_given,
    variant_half_level,      ///< as given, and again at half the level
    variant_small_level,     ///< as given, and again at a fifth of the level
    variant_wide_lines,      ///< every line at twice its frequency
    variant_slow_stroke,     ///< a slow travel under the multisine
    variant_both_directions, ///< at a constant speed, and at the same one backward
    variant_more_periods,    ///< four times as many
    variant_longer,          ///< one of the others, for longer: variant_prolong()
    variant_kinds,
};

/// What all of them start from.
struct variant_basis {
    const struct design_request *request; ///< lines, amplitudes and the limits in full
    struct design_offset offset;          ///< of the excitation as given
    size_t periods;                       ///< counted ones of the excitation as given
    double settle_time_s;                 ///< NAN: one period
    double turn;                          ///< position per turn of the motor: 2 pi rad, or the belt's metres
};

struct variant_table {
    struct design_request request; ///< as played: the limits in full, the bins are the result's
    struct design_result result;
};

/// One excitation: tables that are played one after the other, and diagnosed together.
struct variant {
    enum variant_kind kind;
    size_t table_count; ///< 0: the limits leave no room for it
    struct variant_table tables[variant_tables_max];
    size_t periods, settle_periods; ///< of each table
    double test_time_s;             ///< of all
    char says[160];                 ///< what is played
    char why_not[400];              ///< without tables: what is in the way
};

/// Name in the JSON and in messages: "slow_stroke".
const char *variant_kind_str(enum variant_kind kind);

/// Designs one excitation, any but variant_longer. `given` is the one as given, of which levels and speeds are taken;
/// NULL for itself.
/// Equation:  stroke: amplitude 0.6 turns or what the position limit leaves (at least 0.7 of it), periods P so that
///            2 pi A / (P T) is at most a quarter of the velocity limit (of the multisine's peak without one)
///            speed: V = half the velocity limit, or 1.2 times the multisine's peak without one: it never reverses; a
///            position limit gives half its room to the travel
/// Errors:    of an excitation as given: what design_run() says, memory. Any other that cannot be designed is no error:
///            table_count is 0 then and why_not says what is in the way
/// Test:      tests/unit/test_separation.c
int variant_design(const struct variant_basis *basis, enum variant_kind kind, const struct variant *given,
                   struct variant *out_variant, struct error *out_error);

/// Another variant with `times` as many counted periods.
/// Errors: error_refused if memory is short. Where a constant speed would leave the position limit, table_count is 0
///         and why_not says so
int variant_prolong(const struct variant *from, size_t times, struct variant *out_variant, struct error *out_error);

void variant_free(struct variant *self);

#endif
