/* SPDX-License-Identifier: MIT */
/// Hides an effect in a drive, for demonstrations and exercises: a nominal model, and a copy of it in which one thing
/// is different. Takes any effect of the catalogue; knows none of them by name.
#ifndef SERVOSCOPE_TOOLS_HIDING_H
#define SERVOSCOPE_TOOLS_HIDING_H

#include "lab/record/error.h"
#include "msgen/table.h"
#include "sim/model.h"

#include <cjson/cJSON.h>
#include <stdint.h>

struct hiding {
    int effect;                                  ///< index in sim_effects
    double values[sim_effect_parameters_max];    ///< of its parameters, in the drive
    double nominal[sim_effect_parameters_max];   ///< the same in the nominal model, 0 where it has none
    double torque_share;                         ///< RMS of the torque that the nominal model misses, over all torque
    struct sim_model nominal_model, drive_model; ///< what is believed, and what is measured
};

/// Chooses effect and size by a seed. Seeds that follow each other hide different effects: every effect once in each
/// row of as many seeds as there are effects. What the model has is changed by a factor of 1.4 to 2.2; what it has
/// nothing of is added at one of the effect's own scan values, so that the model misses at least 1 % of the torque
/// (an added torque or ratio: 1.5 to 5 %): it can be seen, and the drive still runs.
/// Errors: error_refused if nothing in the catalogue can show with this table (too short a travel, no lines)
int hiding_choose(uint64_t seed, const struct msgen_table *table, struct hiding *out_hiding, struct error *out_error);

/// The answer as JSON: {"id", "parameters": {NAME: {"value", "nominal"}}, "torque_share"}; NULL if memory is short.
cJSON *hiding_json(const struct hiding *self);

/// The answer in one line: "cogging: amplitude_Nm 0.04, periods_per_rev 72".
void hiding_describe(const struct hiding *self, size_t size, char *out_text);

#endif
