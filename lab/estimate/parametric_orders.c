/* SPDX-License-Identifier: MIT */
#include "lab/estimate/parametric_orders.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { folds = 4, default_max = 6 };

static const double as_good = 1.0; ///< standard errors
static const double surely_worse = 2.0;

/// Lines of the data whose number modulo `folds` is `fold`, or all others.
struct subset {
    struct parametric_data data;
    double *frequency_hz, *output_variance, *input_variance;
    double complex *input, *output, *output_covariance;
};

struct study {
    const struct parametric_data *data;
    const struct parametric_orders_options *options;
    struct subset fitted[folds], left[folds];
    double *power;            ///< rows x judged lines: |residual|^2 of held-out lines
    double complex *residual; ///< judged lines
    size_t judged;            ///< held-out lines
};

static void subset_free(struct subset *self)
{
    free(self->frequency_hz);
    free(self->output_variance);
    free(self->input_variance);
    free(self->input);
    free(self->output);
    free(self->output_covariance);
    *self = (struct subset){0};
}

static double *pick(const double *values, size_t count, size_t fold, bool inside, bool *io_good)
{
    double *picked = values ? malloc(count * sizeof *picked) : NULL;
    size_t n = 0;
    for (size_t k = 0; k < count && picked; k++) {
        if ((k % folds == fold) == inside) {
            picked[n++] = values[k];
        }
    }
    *io_good = *io_good && (picked || !values);
    return picked;
}

static double complex *pick_complex(const double complex *values, size_t count, size_t fold, bool inside, bool *io_good)
{
    double complex *picked = values ? malloc(count * sizeof *picked) : NULL;
    size_t n = 0;
    for (size_t k = 0; k < count && picked; k++) {
        if ((k % folds == fold) == inside) {
            picked[n++] = values[k];
        }
    }
    *io_good = *io_good && (picked || !values);
    return picked;
}

static bool subset_init(const struct parametric_data *data, size_t fold, bool inside, struct subset *out_self)
{
    size_t count = data->count;
    bool good = true;
    *out_self = (struct subset){.data = *data};
    out_self->frequency_hz = pick(data->frequency_hz, count, fold, inside, &good);
    out_self->output_variance = pick(data->output_variance, count, fold, inside, &good);
    out_self->input_variance = pick(data->input_variance, count, fold, inside, &good);
    out_self->input = pick_complex(data->input, count, fold, inside, &good);
    out_self->output = pick_complex(data->output, count, fold, inside, &good);
    out_self->output_covariance = pick_complex(data->output_covariance, count, fold, inside, &good);
    out_self->data.count = inside ? (count + folds - 1 - fold) / folds : count - (count + folds - 1 - fold) / folds;
    out_self->data.frequency_hz = out_self->frequency_hz;
    out_self->data.output_variance = out_self->output_variance;
    out_self->data.input_variance = out_self->input_variance;
    out_self->data.input = out_self->input;
    out_self->data.output = out_self->output;
    out_self->data.output_covariance = out_self->output_covariance;
    return good;
}

static void store_power(const struct parametric_data *data, bool transient, const struct parametric_model *model,
                        double complex *scratch, double *out_power)
{
    struct parametric_model plain = *model;
    plain.noise_std = 0.0; // unit weights: all orders in the same unit
    for (size_t i = 0; i < parametric_terms_max && !transient; i++) {
        plain.transient[i] = 0.0;
    }
    parametric_residual(&plain, data, scratch);
    for (size_t k = 0; k < data->count; k++) {
        out_power[k] = creal(scratch[k] * conj(scratch[k]));
    }
}

/// Residual powers of data that the fit has not seen. Returns false if a part of the lines does not determine the
/// model.
static bool judge(struct study *study, const struct parametric_model *model, double *out_power)
{
    if (study->options->held_out) {
        store_power(study->options->held_out, false, model, study->residual, out_power);
        return true;
    }
    for (size_t fold = 0; fold < folds; fold++) {
        struct parametric_model part;
        if (parametric_fit(&study->fitted[fold].data, &model->structure, model, &part, NULL) != 0) {
            return false;
        }
        store_power(&study->left[fold].data, true, &part, study->residual, out_power);
        out_power += study->left[fold].data.count;
    }
    return true;
}

static double mean(const double *values, size_t count)
{
    double sum = 0.0;
    for (size_t k = 0; k < count; k++) {
        sum += values[k] / (double)count;
    }
    return sum;
}

/// By how many standard errors the lines of row `a` are worse than those of row `b`.
static double excess(const struct study *study, size_t a, size_t b)
{
    const double *left = study->power + a * study->judged;
    const double *right = study->power + b * study->judged;
    double count = (double)study->judged;
    double difference = mean(left, study->judged) - mean(right, study->judged);
    double scatter = 0.0;
    for (size_t k = 0; k < study->judged; k++) {
        double deviation = left[k] - right[k] - difference;
        scatter += deviation * deviation / (count * (count - 1.0));
    }
    return scatter > 0.0 ? difference / sqrt(scatter) : difference > 0.0 ? INFINITY : 0.0;
}

static double description_length(size_t lines, size_t parameters, double cost)
{
    double count = (double)lines;
    double spare = 2.0 * count - (double)parameters - 2.0;
    double length = count * log(cost / count) + count * (double)parameters * log(2.0 * count) / spare;
    return spare > 0.0 ? length : INFINITY;
}

static int fit_row(struct study *study, struct parametric_order_row *io_row, double *out_power, struct error *out_error)
{
    struct parametric_structure structure = study->options->structure;
    struct parametric_model model;
    structure.numerator_order = io_row->numerator_order;
    structure.denominator_order = io_row->denominator_order;
    int status = parametric_fit(study->data, &structure, NULL, &model, out_error);
    if (status) {
        return status;
    }
    io_row->fitted = judge(study, &model, out_power);
    io_row->parameters = model.parameters;
    io_row->stable = model.stable;
    io_row->cost = model.cost;
    io_row->cost_expected = model.cost_expected;
    io_row->mdl = description_length(model.lines, model.parameters, model.cost);
    io_row->held_out = io_row->fitted ? mean(out_power, study->judged) : 0.0;
    return 0;
}

/// Row of least held-out error, `count` if none is fitted.
static size_t best_held_out(const struct parametric_orders *orders)
{
    size_t best = orders->count;
    for (size_t i = 0; i < orders->count; i++) {
        const struct parametric_order_row *row = &orders->rows[i];
        if (row->fitted && (best == orders->count || row->held_out < orders->rows[best].held_out)) {
            best = i;
        }
    }
    return best;
}

/// Whether a row could take the place of another as the choice by description length.
static bool shorter(const struct parametric_orders *orders, size_t row, size_t other)
{
    return orders->rows[row].fitted && orders->rows[row].mdl < orders->rows[other].mdl;
}

/// A stable row that predicts as well as any, `chosen` if there is none: noise makes unstable poles where a model has
/// more of them than the plant.
static size_t stable_instead(const struct study *study, const struct parametric_orders *orders, size_t best,
                             size_t chosen)
{
    size_t found = orders->count;
    for (size_t i = 0; i < orders->count; i++) {
        bool able = orders->rows[i].fitted && orders->rows[i].stable && excess(study, i, best) <= surely_worse;
        if (able && (found == orders->count || shorter(orders, i, found))) {
            found = i;
        }
    }
    return found < orders->count ? found : chosen;
}

static void explain(const struct study *study, size_t best, const char *reason, struct parametric_orders *io_orders)
{
    const struct parametric_order_row *rows = io_orders->rows;
    const struct parametric_order_row *chosen = &rows[io_orders->chosen];
    const struct parametric_order_row *shortest = &rows[io_orders->by_mdl];
    snprintf(io_orders->why, sizeof io_orders->why,
             "order %zu over %zu: %s (MDL %.5g, least %.5g at %zu over %zu); squared error of held-out %s %.4g, least "
             "%.4g at %zu over %zu, %.1f standard errors apart",
             chosen->numerator_order, chosen->denominator_order, reason, chosen->mdl, shortest->mdl,
             shortest->numerator_order, shortest->denominator_order, study->options->held_out ? "periods" : "lines",
             chosen->held_out, rows[best].held_out, rows[best].numerator_order, rows[best].denominator_order,
             excess(study, io_orders->chosen, best));
}

static void choose(const struct study *study, struct parametric_orders *io_orders)
{
    size_t best = best_held_out(io_orders);
    io_orders->by_mdl = best;
    io_orders->by_held_out = best;
    for (size_t i = 0; i < io_orders->count; i++) {
        if (shorter(io_orders, i, io_orders->by_mdl)) {
            io_orders->by_mdl = i;
        }
        if (io_orders->rows[i].fitted &&
            io_orders->rows[i].parameters < io_orders->rows[io_orders->by_held_out].parameters &&
            excess(study, i, best) <= as_good) {
            io_orders->by_held_out = i;
        }
    }
    const char *reason = "least description length";
    io_orders->chosen = io_orders->by_mdl;
    if (excess(study, io_orders->by_mdl, best) > surely_worse) {
        reason = "fewest parameters that predict held-out data as well as any";
        io_orders->chosen = io_orders->by_held_out;
    }
    if (!io_orders->rows[io_orders->chosen].stable) {
        size_t stable = stable_instead(study, io_orders, best, io_orders->chosen);
        reason = stable != io_orders->chosen ? "stable, and predicts held-out data as well as any" : reason;
        io_orders->chosen = stable;
    }
    explain(study, best, reason, io_orders);
}

static bool study_init(struct study *self, size_t rows)
{
    const struct parametric_data *held_out = self->options->held_out;
    bool good = true;
    self->judged = held_out ? held_out->count : self->data->count;
    self->power = malloc(rows * self->judged * sizeof *self->power);
    self->residual = malloc(self->judged * sizeof *self->residual);
    for (size_t fold = 0; fold < folds && !held_out; fold++) {
        good = subset_init(self->data, fold, false, &self->fitted[fold]) && good;
        good = subset_init(self->data, fold, true, &self->left[fold]) && good;
    }
    return good && self->power && self->residual;
}

static void study_free(struct study *self)
{
    for (size_t fold = 0; fold < folds; fold++) {
        subset_free(&self->fitted[fold]);
        subset_free(&self->left[fold]);
    }
    free(self->power);
    free(self->residual);
}

static void list_rows(const struct parametric_orders_options *options, struct parametric_orders *out_orders)
{
    size_t low = options->denominator_min > 0 ? options->denominator_min : 1;
    size_t high = options->denominator_max > 0 ? options->denominator_max : default_max;
    low = low > options->structure.denominator_lowest ? low : options->structure.denominator_lowest;
    for (size_t n = low; n <= high && n <= parametric_order_max; n++) {
        for (size_t m = options->structure.numerator_lowest; m <= n; m++) {
            out_orders->rows[out_orders->count++] =
                (struct parametric_order_row){.numerator_order = m, .denominator_order = n};
        }
    }
}

/// Fits all rows; the first refusal is told if none works.
static int fit_rows(struct study *study, struct parametric_orders *io_orders, struct error *out_error)
{
    int status = 0;
    bool any = false;
    struct error first = {0};
    for (size_t i = 0; i < io_orders->count; i++) {
        struct error refusal;
        if (fit_row(study, &io_orders->rows[i], study->power + i * study->judged, &refusal) != 0 && !first.status) {
            first = refusal;
        }
        any = any || io_orders->rows[i].fitted;
    }
    if (!any) {
        status = error_set(out_error, error_refused, "%s",
                           first.status ? first.message
                                        : "no pair of orders could be fitted to three quarters of the lines");
    }
    return status;
}

int parametric_orders_choose(const struct parametric_data *data, const struct parametric_orders_options *options,
                             struct parametric_orders *out_orders, struct parametric_model *out_model,
                             struct error *out_error)
{
    struct study study = {.data = data, .options = options};
    struct parametric_orders orders = {0};
    *out_orders = orders;
    *out_model = (struct parametric_model){0};
    list_rows(options, &orders);
    if (orders.count == 0 || options->denominator_max > parametric_order_max) {
        return error_set(out_error, error_refused, "%s: denominator orders %zu to %zu: expected some of 1 to %d",
                         data->name, options->denominator_min, options->denominator_max, parametric_order_max);
    }
    int status = study_init(&study, orders.count)
                     ? fit_rows(&study, &orders, out_error)
                     : error_set(out_error, error_refused, "%s: not enough memory for %zu orders of %zu lines",
                                 data->name, orders.count, data->count);
    if (!status) {
        choose(&study, &orders);
        struct parametric_structure structure = options->structure;
        structure.numerator_order = orders.rows[orders.chosen].numerator_order;
        structure.denominator_order = orders.rows[orders.chosen].denominator_order;
        status = parametric_fit(data, &structure, NULL, out_model, out_error);
    }
    if (!status) {
        *out_orders = orders;
    }
    study_free(&study);
    return status;
}
