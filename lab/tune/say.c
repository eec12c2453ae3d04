/* SPDX-License-Identifier: MIT */
#include "lab/tune/say.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

void say_gains(const struct tune_plant *plant, const struct tune_controller *controller, char out_text[say_size])
{
    int used = 0;
    out_text[0] = '\0';
    for (size_t i = 0; i < controller->structure->gains; i++) {
        char suffix[tune_unit_size], unit[tune_unit_size];
        const enum tune_term term = controller->structure->terms[i];
        tune_plant_gain_unit(plant, tune_term_power(term), suffix, unit);
        used += snprintf(out_text + used, say_size - (size_t)used, "%s%s %.5g %s", used ? ", " : "",
                         tune_term_symbol(term), controller->gain[i], unit);
    }
}

void say_gain(const struct tune_result *result, size_t i, const char *plus_minus, char out_text[say_size])
{
    char suffix[tune_unit_size], unit[tune_unit_size], std[40] = "";
    const struct tune_controller *controller = &result->solution.controller;
    tune_plant_gain_unit(&result->plant, tune_term_power(controller->structure->terms[i]), suffix, unit);
    if (result->deviation.known) {
        snprintf(std, sizeof std, " %.8s %.2g", plus_minus, result->deviation.gain[i]);
    }
    snprintf(out_text, say_size, "%.5g%s %s", controller->gain[i], std, unit);
}

void say_filter(const struct tune_filter *filter, char out_text[say_size])
{
    if (!filter->on) {
        snprintf(out_text, say_size, "none");
        return;
    }
    snprintf(out_text, say_size, "zeros at %.4g Hz, damping %.3g; poles at %.4g Hz, damping %.3g", filter->zero_hz,
             filter->zero_damping, filter->pole_hz, filter->pole_damping);
}

void say_performance(const struct tune_result *result, char out_text[say_size])
{
    const struct margins *m = &result->margins;
    const double reference_hz = tune_reference_cutoff_hz(&result->solution.reference);
    int used = 0;
    if (isfinite(m->cutoff_hz)) {
        used = snprintf(out_text, say_size, "The closed loop follows up to %.4g Hz (-3 dB", m->cutoff_hz);
        if (isfinite(reference_hz)) {
            used += snprintf(out_text + used, say_size - (size_t)used, "; the reference up to %.4g Hz", reference_hz);
        }
        used += snprintf(out_text + used, say_size - (size_t)used, ")");
    } else {
        used = snprintf(out_text, say_size, "The closed loop does not fall below -3 dB on these lines");
    }
    snprintf(out_text + used, say_size - (size_t)used,
             ", crosses 0 dB at %.4g Hz and amplifies disturbances at most %.3g times (%.4g Hz).", m->crossover_hz,
             m->modulus, m->modulus_hz);
}

size_t say_margins(const struct tune_result *result, struct say_margin out_margins[say_margins_max])
{
    const struct margins *m = &result->margins, *s = &result->deviation.margins;
    const bool known = result->deviation.known;
    const struct say_margin all[] = {
        {"gain margin", "dB", m->gain_db, s->gain_db, m->gain_hz,
         "no limit on these lines (never at -180 degrees below 0 dB)"},
        {"gain reduction margin", "dB", m->gain_reduction_db, s->gain_reduction_db, m->gain_reduction_hz, NULL},
        {"phase margin", "degrees", m->phase_deg, s->phase_deg, m->phase_hz, NULL},
        {"delay margin", "ms", 1e3 * m->delay_s, 1e3 * s->delay_s, NAN, NULL},
        {"max |S|", "", m->modulus, s->modulus, m->modulus_hz, NULL},
        {"crossover, |L| = 1", "Hz", m->crossover_hz, s->crossover_hz, NAN, NULL},
        {"closed loop, first -3 dB", "Hz", m->cutoff_hz, s->cutoff_hz, NAN, "not on these lines"},
        {"closed loop, last -3 dB", "Hz", m->last_cutoff_hz, s->last_cutoff_hz, NAN, NULL},
    };
    const size_t count = sizeof all / sizeof *all;
    for (size_t i = 0; i < count; i++) {
        out_margins[i] = all[i];
        out_margins[i].std = known ? all[i].std : NAN;
    }
    return count;
}

struct say_model_controller say_model_controller(const struct tune_result *result)
{
    const struct tune_controller *controller = &result->solution.controller;
    const struct tune_structure *structure = controller->structure;
    const bool torque = strcmp(result->plant.effort_unit, "Nm") == 0,
               force = strcmp(result->plant.effort_unit, "N") == 0;
    struct say_model_controller out = {.exists = false};
    if ((torque || force) && result->plant.output == tune_output_velocity && structure->filter == tune_filter_none &&
        !structure->leads) {
        const double integral = structure->gains > 1 ? controller->gain[1] : 0.0;
        out.exists = true;
        out.gain_name = torque ? "velocity_gain_Nms_per_rad" : "velocity_gain_Ns_per_m";
        out.gain = controller->gain[0] + integral / controller->rate_hz;
        out.integral_time_s = integral > 0.0 ? out.gain / integral : 0.0;
    }
    return out;
}
