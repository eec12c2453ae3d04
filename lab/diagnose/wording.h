/* SPDX-License-Identifier: MIT */
/// What a diagnosis says in words, once for the report and for the terminal. Every number in a sentence is computed.
#ifndef SERVOSCOPE_DIAGNOSE_WORDING_H
#define SERVOSCOPE_DIAGNOSE_WORDING_H

#include "lab/diagnose/diagnosis.h"

enum { wording_short = 32, wording_size = 1024, wording_where_size = 640 };

/// Names of quantities and units on a rotary or a linear axis; where the recordings have a current or a voltage and no
/// model says what torque that makes, it stands for the torque.
struct wording_units {
    const char *torque;      ///< "torque", "force", "current", "voltage"
    const char *torque_unit; ///< "Nm", "N", "A", "V"
    const char *speed_unit;  ///< "rad/s", "m/s"
};

/// What was recorded beside the motion: "torque", "force", "voltage" or "current".
const char *wording_input(const struct diagnosis *self);

struct wording_units wording_units(const struct diagnosis *self);

/// Puts the unit of the input for that of the torque into a sentence about an effect, where wording_units() does, and
/// takes out deviations of 0: a number at the edge of what a fit allows has none.
void wording_in_units(const struct diagnosis *self, size_t size, char *io_text);

/// An effect's id as words: "load bias".
void wording_effect(int effect, char out_text[wording_short]);

/// A share as a percentage of three digits: "4.81 %"; "unknown" if it is not finite.
void wording_percent(double share, char out_text[wording_short]);

/// Evidence: "123.4 nats"; "none beside the others" where a fit does no worse without.
void wording_evidence(double nats, char out_text[wording_short]);

/// An estimate with the digits that its standard deviation allows: "0.03120 ± 0.00042".
void wording_estimate(double value, double deviation, char out_text[2 * wording_short]);

/// The verdict in a few words.
void wording_headline(const struct diagnosis *self, char out_text[wording_size]);

/// What the verdict is worth: how far each model is off on data the fit has not seen, and what the noise allows.
void wording_gain(const struct diagnosis *self, char out_text[wording_size]);

/// What is strange about the errors on unseen data, as a sentence: refitting made them larger, or no model at all would
/// be closer; NULL where nothing is.
const char *wording_refit(const struct diagnosis *self);

/// A part of an axis as words: "moving backward", "at speeds below 0.3 rad/s".
void wording_range(const struct diagnosis *self, enum misfit_axis_kind axis, const struct misfit_range *range,
                   char out_text[wording_size]);

/// Where a model's misfit sits, by the axes that say most: "at 0.8..3 Hz (72 % of it), moving backward (81 %)"; ""
/// where nothing is left, or where it is left everywhere alike.
void wording_where(const struct diagnosis *self, const struct misfit *misfit, enum misfit_model model,
                   char out_text[wording_size]);

/// Where and how what stays unexplained lies; `reason`: why it counts as that, which may be empty.
void wording_rest(const struct diagnosis *self, const char *reason, char out_text[wording_where_size]);

/// How much stays unexplained, and where, as a sentence without its full stop.
void wording_left(const struct diagnosis *self, char out_text[wording_size]);

/// What a cause is worth on unseen data, as a sentence; "" where that is not known.
void wording_unseen(const struct diagnosis *self, const struct diagnosis_cause *cause, char out_text[wording_size]);

/// What to measure to see what has no name, as one sentence.
void wording_closer(const struct diagnosis *self, char out_text[wording_size]);

/// What to measure to test for an effect that was not tested for: a clause after "measure".
const char *wording_measure(const struct diagnosis_untestable *untestable);

/// Says of an effect that is only a detail of how the drive is made that the extended model has it.
void wording_detail(const struct diagnosis_cause *detail, struct oddities *io_oddities);

enum { wording_runs_size = 512 };

/// Runs by their files, with commas.
void wording_runs(const struct run *runs, size_t count, char out_text[wording_runs_size]);

/// What is judged on: the validation runs, or the part of the only run that is held back from row `held_from` on.
void wording_judged(const struct diagnosis_request *request, size_t held_from, char out_text[wording_runs_size]);

/// Whether the extended model is more than the refitted one: anything was found, claimed or not.
bool wording_is_extended(const struct diagnosis *self);

/// Share of the given model's squared error above the noise floor that the extended model takes away; NaN where the
/// given model is no worse than the noise floor.
double wording_removed_share(const struct diagnosis *self);

/// What to do next, each as one sentence; at most `max` of them, returns how many.
size_t wording_next(const struct diagnosis *self, size_t max, char (*out_texts)[wording_size]);

#endif
