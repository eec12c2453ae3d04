/* SPDX-License-Identifier: MIT */
#include "lab/estimate/parametric_text.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#if defined(__GNUC__)
__attribute__((format(printf, 2, 3)))
#endif
static void
append(char text[parametric_text_size], const char *format, ...)
{
    size_t used = strlen(text);
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text + used, parametric_text_size - used, format, arguments);
    va_end(arguments);
}

static bool is_discrete(const struct parametric_model *model)
{
    return model->structure.domain == parametric_discrete;
}

void parametric_text_order(const struct parametric_model *model, char out_text[parametric_text_size])
{
    out_text[0] = '\0';
    append(out_text, "%zu over %zu in %s", model->structure.numerator_order, model->structure.denominator_order,
           is_discrete(model) ? "1/z" : "s");
    double samples = round(model->delay_s * model->sample_rate_hz);
    if (is_discrete(model) && !model->structure.delay_free && samples > 0.0) {
        append(out_text, ", %.0f sample%s late", samples, samples > 1.0 ? "s" : "");
    }
}

/// A negative real z, which the logarithm puts off the real axis without a partner.
static bool has_no_s(const struct parametric_root *root)
{
    return !root->pair && cimag(root->s_rad_per_s) != 0.0;
}

static void append_root(const struct parametric_model *model, const struct parametric_root *root, bool pole,
                        char text[parametric_text_size])
{
    if (has_no_s(root)) {
        append(text, "z = %.3g", -exp(creal(root->s_rad_per_s) / model->sample_rate_hz));
    } else if (root->pair) {
        append(text, "%.6g +- %.2g Hz, damping %.4g +- %.2g", root->frequency_hz, root->frequency_std_hz, root->damping,
               root->damping_std);
    } else {
        append(text, "%.6g +- %.2g Hz, real", root->frequency_hz, root->frequency_std_hz);
    }
    if (root->damping < 0.0 && !has_no_s(root)) {
        append(text, pole ? ", unstable" : ", non-minimum-phase");
    }
    if (root->cancels) {
        append(text, pole ? " (cancelled by a zero)" : " (cancelled by a pole)");
    }
}

void parametric_text_roots(const struct parametric_model *model, bool poles, double limit_hz,
                           char out_text[parametric_text_size])
{
    const struct parametric_root *roots = poles ? model->poles : model->zeros;
    size_t count = poles ? model->pole_count : model->zero_count;
    size_t shown = 0;
    out_text[0] = '\0';
    for (size_t i = 0; i < count; i++) {
        if (limit_hz > 0.0 && roots[i].frequency_hz > limit_hz && !has_no_s(&roots[i])) {
            continue;
        }
        append(out_text, "%s", shown++ ? "; " : "");
        append_root(model, &roots[i], poles, out_text);
    }
    if (shown == 0 && count == 0) {
        append(out_text, "none");
    }
    if (shown < count) {
        append(out_text, "%s%zu above %.4g Hz", shown ? "; " : "", count - shown, limit_hz);
    }
}

double parametric_delay_without_hold_s(const struct parametric_model *model)
{
    return model->delay_s - (is_discrete(model) && model->sample_rate_hz > 0.0 ? 1.0 / model->sample_rate_hz : 0.0);
}

void parametric_text_delay_and_gain(const struct parametric_model *model, char out_text[parametric_text_size])
{
    out_text[0] = '\0';
    if (model->structure.delay_free) {
        append(out_text, "delay %.4g +- %.2g ms", 1e3 * parametric_delay_without_hold_s(model),
               1e3 * model->delay_std_s);
    } else if (model->delay_s != 0.0) {
        append(out_text, "delay %.4g ms", 1e3 * model->delay_s);
    }
    if (model->dc_gain_known) {
        append(out_text, "%sgain at 0 Hz %.4g +- %.2g", out_text[0] ? ", " : "", model->dc_gain, model->dc_gain_std);
    }
}

void parametric_text_cost(const struct parametric_outcome *outcome, char out_text[parametric_text_size])
{
    out_text[0] = '\0';
    if (!(outcome->noise_cost_expected > 0.0)) {
        append(out_text,
               "equal weights, as nothing scatters from period to period; noise of %.3g in the output "
               "explains the residual",
               outcome->model.noise_std);
        return;
    }
    append(out_text, "cost %.5g, by noise alone %.5g +- %.2g is expected", outcome->noise_cost,
           outcome->noise_cost_expected, outcome->noise_cost_std);
    if (outcome->misfit > 1.0) {
        append(out_text, ": the residual has %.3g times the noise's variance, and the standard deviations allow for it",
               outcome->misfit);
    }
    if (outcome->pooled_lines > 1) {
        append(out_text, "; the scatter of %zu lines each was taken together", outcome->pooled_lines);
    }
}

const struct parametric_model *parametric_shown(const struct parametric_outcome *outcome)
{
    return outcome->has_plant ? &outcome->plant : &outcome->model;
}

static void add_root_row(const struct parametric_model *model, const struct parametric_root *root, bool pole,
                         struct page *page)
{
    char frequency[64];
    char damping[64];
    char kind[64];
    snprintf(kind, sizeof kind, "%s%s%s", pole ? "pole" : "zero", root->pair ? " pair" : "",
             root->cancels ? ", cancelled" : "");
    if (has_no_s(root)) {
        snprintf(frequency, sizeof frequency, "z = %.3g", -exp(creal(root->s_rad_per_s) / model->sample_rate_hz));
    } else {
        snprintf(frequency, sizeof frequency, "%.6g \xC2\xB1 %.2g", root->frequency_hz, root->frequency_std_hz);
    }
    snprintf(damping, sizeof damping, "%.4g \xC2\xB1 %.2g", root->damping, root->damping_std);
    const char *const cells[] = {kind, frequency,
                                 root->pair            ? damping
                                 : root->damping < 0.0 ? "right half plane"
                                                       : NULL};
    page_add_row(page, cells);
}

static void add_roots(const struct parametric_outcome *outcome, const char *name, struct page *page)
{
    static const char *const heads[] = {"root", "frequency in Hz", "damping ratio"};
    const struct parametric_model *poles = &outcome->model;
    const struct parametric_model *zeros = parametric_shown(outcome);
    char caption[200];
    snprintf(caption, sizeof caption, "Poles and zeros of %s, each with one standard deviation", name);
    page_start_table(page, caption, "lrr", heads);
    for (size_t i = 0; i < poles->pole_count; i++) {
        add_root_row(poles, &poles->poles[i], true, page);
    }
    for (size_t i = 0; i < zeros->zero_count; i++) {
        add_root_row(zeros, &zeros->zeros[i], false, page);
    }
    page_end_table(page);
}

void parametric_add_page(const struct parametric_outcome *outcome, const char *name, struct page *page)
{
    char text[parametric_text_size];
    page_add_subsection(page, name);
    page_start_pairs(page);
    parametric_text_order(&outcome->model, text);
    page_add_pair(page, "model", "order %s, %s", text, outcome->model.stable ? "stable" : "unstable");
    if (outcome->has_plant) {
        parametric_text_order(&outcome->plant, text);
        page_add_pair(page, "without the hold", "order %s", text);
    }
    parametric_text_delay_and_gain(parametric_shown(outcome), text);
    if (text[0]) {
        page_add_pair(page, "delay and gain", "%s", text);
    }
    parametric_text_cost(outcome, text);
    page_add_pair(page, "fit", "%s", text);
    page_add_pair(page, "choice of orders", "%s", outcome->orders.why);
    page_end_pairs(page);
    if (outcome->hint[0]) {
        page_add_note(page, page_warning, "Held or band-limited?", "%s.", outcome->hint);
    }
    add_roots(outcome, name, page);
}
