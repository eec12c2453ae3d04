/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/estimating_model.h"

#include "lab/estimate/method.h"
#include "lab/estimate/parametric_text.h"

/// Several runs have one model, kept with the first of them.
static const struct parametric_outcome *model_of(const struct estimating_outcome *outcome)
{
    const struct parametric_outcome *found = outcome->run_count > 0 ? outcome->runs[0].parametric : NULL;
    return found && found->made ? found : NULL;
}

static void say_cancelling(const struct parametric_outcome *found, struct remarks *io_remarks)
{
    for (size_t i = 0; i < found->model.pole_count; i++) {
        const struct parametric_root *pole = &found->model.poles[i];
        if (pole->cancels) {
            remarks_add(io_remarks, remark_warning, "model_cancelling",
                        "the pole%s at %.5g Hz lies on a zero within its uncertainty: it may be no property of the "
                        "drive",
                        pole->pair ? " pair" : "", pole->frequency_hz);
        }
    }
}

void estimating_model_say(const struct estimating_outcome *outcome, struct remarks *io_remarks)
{
    const struct parametric_outcome *found = model_of(outcome);
    char text[parametric_text_size];
    if (!found) {
        return;
    }
    const struct parametric_model *shown = parametric_shown(found);
    parametric_text_order(&found->model, text);
    remarks_add(io_remarks, remark_fact, "model_order", "transfer function of order %s, %s", text,
                found->model.stable ? "stable" : "unstable");
    parametric_text_roots(&found->model, true, 0.0, text);
    remarks_add(io_remarks, remark_fact, "model_poles", "poles: %s", text);
    parametric_text_roots(shown, false, 0.5 * found->model.sample_rate_hz, text);
    remarks_add(io_remarks, remark_fact, "model_zeros", "zeros%s: %s", found->has_plant ? " without the hold" : "",
                text);
    parametric_text_delay_and_gain(shown, text);
    if (text[0]) {
        remarks_add(io_remarks, remark_fact, "model_delay", "%s%s", text, found->has_plant ? ", without the hold" : "");
    }
    parametric_text_cost(found, text);
    remarks_add(io_remarks, remark_fact, "model_cost", "%s", text);
    remarks_add(io_remarks, remark_fact, "model_choice", "%s", found->orders.why);
    if (estimate_key(&outcome->frf, "parametric_warning")[0]) {
        remarks_add(io_remarks, remark_warning, "model", "%s", estimate_key(&outcome->frf, "parametric_warning"));
    }
    if (found->hint[0]) {
        remarks_add(io_remarks, remark_warning, "model_setup", "%s", found->hint);
    }
    say_cancelling(found, io_remarks);
}

void estimating_model_add_json(const struct estimating_outcome *outcome, cJSON *io_object)
{
    const struct parametric_outcome *found = model_of(outcome);
    cJSON *model = found ? parametric_outcome_json(found, false) : NULL;
    if (model && !cJSON_AddItemToObject(io_object, "model", model)) {
        cJSON_Delete(model);
    }
}

void estimating_model_add_page(const struct estimating_outcome *outcome, const char *name, struct page *page)
{
    const struct parametric_outcome *found = model_of(outcome);
    if (found) {
        page_add_section(page, "Transfer function");
        parametric_add_page(found, name, page);
    }
}
