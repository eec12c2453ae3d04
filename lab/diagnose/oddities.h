/* SPDX-License-Identifier: MIT */
/// What is odd about a recording before any model is fitted: said in words, so that a wrong unit, a clipped signal or a
/// period that is off by one row is not taken for a cause.
#ifndef SERVOSCOPE_DIAGNOSE_ODDITIES_H
#define SERVOSCOPE_DIAGNOSE_ODDITIES_H

#include "lab/record/error.h"
#include "lab/record/run.h"

#include <stdbool.h>
#include <stddef.h>

enum { oddities_max = 16 };

struct recording;

/// Sentences for the report, each about one file.
struct oddities {
    size_t count;
    char texts[oddities_max][280];
};

/// Adds a sentence; more than oddities_max are dropped.
void oddities_add(struct oddities *self, const char *format, ...) __attribute__((format(printf, 2, 3)));

/// Clipped columns, time stamps that wander, rows that were filled.
/// Errors: error_refused for a position in counts, a reference in another unit or of another sign than the torque, and
/// time stamps in ms, each with the --map that mends it
int oddities_of_run(const struct run *run, const struct recording *recording, struct oddities *io_oddities,
                    struct error *out_error);

/// The period that the torque has: that of the file, one row more or less where that repeats clearly better, or another
/// one where that of the file does not repeat at all.
size_t oddities_period(const struct run *run, const double *torque, struct oddities *io_oddities);

/// The unit that a factor betrays ("degrees instead of rad"), with the scale that --map needs; NULL if it is none.
/// `motion`: of an angle or a position, else of a speed.
const char *oddities_unit(double factor, bool linear, bool motion, double *out_scale);

/// How columns got their names where nobody said it; not again where it is as in `like` (NULL: no such run).
void oddities_of_names(const struct run *runs, size_t count, const struct run *like, struct oddities *io_oddities);

/// Whether motion and torque go together as a model's inertia says: least squares of torque on acceleration.
/// Errors: error_refused if the factor between the two is that of a unit, or above 100; a sentence if it is
/// merely large; how large may be more for a model that is not rigid
int oddities_of_inertia(const struct run *run, const struct recording *recording, double inertia, bool rigid,
                        struct oddities *io_oddities, struct error *out_error);

#endif
