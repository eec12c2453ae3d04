/* SPDX-License-Identifier: MIT */
/// Which columns of a foreign recording stand for what, judged by the units and the words in their names. Internal to
/// lab/record: run_options.guess asks for it.
#ifndef SERVOSCOPE_RECORD_RUN_GUESS_H
#define SERVOSCOPE_RECORD_RUN_GUESS_H

#include "lab/record/error.h"
#include "lab/record/run.h"
#include "lab/record/run_names.h"
#include "lab/record/text_table.h"

#include <stdbool.h>

/// Finds names for columns that a run does not know.
///
/// Unit:      the last word of a name that is one (`iq_meas_A`, `speed [rpm]`, `enc1_mm`), units of a single letter
///            only as the last word; it says the quantity and the factor to SI
/// Set-point: a name with ref, cmd, set, target, des, demand and the like becomes `..._ref_...`
/// Load:      one with load becomes `load_...`
/// Left out:  names with dc, bus, supply, err, lim, temp, raw and the like; quantities that a known column has already;
///            quantities of the other kind of axis (N and m beside rad); quantities that several columns claim equally,
///            where no word like meas or act singles one out: nothing is taken by chance
/// `keep` (names that somebody asked for by themselves, entries may be NULL) stay as they are.
/// Errors: error_refused if memory is short; *out_map is empty if there is nothing to name
/// Test:   tests/unit/test_run_guess.c
int run_guess_map(const struct text_table *table, const char *const *keep, size_t keep_count, struct run_map *out_map,
                  struct error *out_error);

/// The factor that brings a column's values to SI by the unit at the end of its name ("pos [mm]": 0.001); false, and
/// *out_scale as it was, if it names none that is known. What stands in brackets is the unit as a whole: "[N/m]" and
/// "[A rms]" are none that is known.
bool run_guess_scale(const char *name, double *out_scale);

/// The same for a column of times, "Zeit [ms]", "time_us".
bool run_guess_time_scale(const char *name, double *out_scale);

/// Adds the key `columns_named` with the map as text, if it names anything.
/// Errors: error_refused if memory is short
int run_guess_note(const struct run_map *map, struct text_table *io_table, struct error *out_error);

#endif
