/* SPDX-License-Identifier: MIT */
/// Results in words and in the terms of other files, for the terminal, the page and the JSON alike.
#ifndef SERVOSCOPE_TUNE_SAY_H
#define SERVOSCOPE_TUNE_SAY_H

#include "lab/tune/tune.h"

#include <stdbool.h>
#include <stddef.h>

enum { say_size = 320 };

/// "Kp 1.427 Nm s/rad, Ki 110.9 Nm/rad".
void say_gains(const struct tune_plant *plant, const struct tune_controller *controller, char out_text[say_size]);

/// One gain with its standard deviation if it is known: "1.427 +- 0.004 Nm s/rad".
void say_gain(const struct tune_result *result, size_t i, const char *plus_minus, char out_text[say_size]);

/// The fixed filter: "zeros at 35 Hz, damping 0.018; poles at 35 Hz, damping 0.7"; "none".
void say_filter(const struct tune_filter *filter, char out_text[say_size]);

/// What the closed loop does, in a sentence.
void say_performance(const struct tune_result *result, char out_text[say_size]);

/// A margin: what it is called, its value and standard deviation (NaN: none), where it is (NaN: nowhere), and what it
/// means that it has no value (NULL: nothing).
struct say_margin {
    const char *name, *unit;
    double value, std, at_hz;
    const char *none;
};

enum { say_margins_max = 8 };

/// Lists all margins, those that these lines do not have with a value of NaN; returns how many.
size_t say_margins(const struct tune_result *result, struct say_margin out_margins[say_margins_max]);

/// The same controller as the block `controller` of a model file, whose integral begins one sample later.
struct say_model_controller {
    bool exists; ///< only p and pi on velocity with torque or force
    const char *gain_name;
    double gain;            ///< Kp + Ki Ts
    double integral_time_s; ///< gain over Ki; 0: no integral
};
struct say_model_controller say_model_controller(const struct tune_result *result);

#endif
