/* SPDX-License-Identifier: MIT */
#include "lab/estimate/parametric_orders.h"

#include "lab/estimate/parametric_problem.h"
#include "lab/numeric/statistics.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { folds = 4, default_max = 6 };

static const double as_good = 1.0; ///< standard errors

/// A larger model is believed if noise alone gains as much with less than this chance. Some ten larger models are
/// tried, alike enough that together they deceive in about one choice of two hundred.
static const double chance_of_belief = 1e-3;

/// Rows whose description is so many nats longer than the shortest cannot be chosen.
static const double hopeless = 40.0;

/// A pole above the lines is determined if its frequency is as many standard deviations.
static const double surely_there = 2.0;

/// A residual below this share of the outputs is rounding.
static const double rounding_share = 1e-12;

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
    struct parametric_model *models; ///< of each row
    double *power;                   ///< rows x judged lines: |residual|^2 of held-out lines
    double complex *residual;        ///< judged lines
    size_t judged;                   ///< held-out lines
    double rounding;                 ///< a cost that is none
    double highest_hz;               ///< line
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

/// Fits a part of the lines. The whole model knows of lines that the part does not have, and a resonance that one line
/// suggested stays where nothing speaks against it: a start of the part's own competes with it.
static bool fit_part(const struct parametric_data *data, const struct parametric_model *whole,
                     struct parametric_model *out_part)
{
    struct parametric_model own;
    bool found = parametric_fit(data, &whole->structure, whole, out_part, NULL) == 0;
    if (parametric_fit_quickly(data, &whole->structure, &own, NULL) == 0 && (!found || own.cost < out_part->cost)) {
        *out_part = own;
        found = true;
    }
    return found;
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
        if (!fit_part(&study->fitted[fold].data, model, &part)) {
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

double parametric_description_length(size_t lines, size_t parameters, double cost)
{
    double count = (double)lines;
    double spare = 2.0 * count - (double)parameters - 2.0;
    double length = count * log(cost / count) + count * (double)parameters * log(2.0 * count) / spare;
    return spare > 0.0 ? length : INFINITY;
}

/// Whether a model has poles that its residual does not speak for.
static bool is_doubtful(const struct parametric_model *model, double highest_hz)
{
    struct parametric_model copy = *model;
    parametric_inflate(&copy, parametric_misfit(model));
    bool doubtful = parametric_mark_cancelling(&copy);
    for (size_t i = 0; i < copy.pole_count; i++) {
        const struct parametric_root *pole = &copy.poles[i];
        bool vague = !(pole->frequency_hz > surely_there * pole->frequency_std_hz);
        doubtful = doubtful || (vague && pole->frequency_hz > highest_hz);
    }
    return doubtful;
}

static int fit_row(const struct study *study, bool quick, struct parametric_order_row *io_row,
                   struct parametric_model *out_model, struct error *out_error)
{
    struct parametric_structure structure = study->options->structure;
    structure.numerator_order = io_row->numerator_order;
    structure.denominator_order = io_row->denominator_order;
    int status = quick ? parametric_fit_quickly(study->data, &structure, out_model, out_error)
                       : parametric_fit(study->data, &structure, NULL, out_model, out_error);
    if (status) {
        return status;
    }
    io_row->fitted = true;
    io_row->parameters = out_model->parameters;
    io_row->stable = out_model->stable;
    io_row->doubtful = is_doubtful(out_model, study->highest_hz);
    io_row->cost = out_model->cost;
    io_row->cost_expected = out_model->cost_expected;
    io_row->mdl = parametric_description_length(out_model->lines, out_model->parameters, out_model->cost);
    return 0;
}

/// Row of least held-out error, `count` if none is fitted.
static size_t best_held_out(const struct parametric_orders *orders)
{
    size_t best = orders->count;
    for (size_t i = 0; i < orders->count; i++) {
        const struct parametric_order_row *row = &orders->rows[i];
        if (row->judged && (best == orders->count || row->held_out < orders->rows[best].held_out)) {
            best = i;
        }
    }
    return best;
}

/// Chance that noise alone lowers the cost as much as it falls from row `small` to row `large`.
/// Equation: F = (V_s - V_l) / dp / (V_l / (2 lines - p_l)) ~ F(dp, 2 lines - p_l), the noise's size taken from the
///           residual, so that variances that are too small for what no order explains do no harm. A pole that is not
///           there can be anywhere with its zero: each resonance is looked for in as many places as there are lines, so
///           that the chance is lines^(poles / 2) times that of one place.
static double chance_of_gain(const struct study *study, const struct parametric_order_row *small,
                             const struct parametric_order_row *large)
{
    double added = (double)(large->parameters - small->parameters);
    double poles = (double)(large->denominator_order - small->denominator_order);
    double lines = (double)study->data->count;
    double left = 2.0 * lines - (double)large->parameters;
    double ratio = (small->cost - large->cost) / added / (large->cost / left);
    return left > 0.0 && ratio > 0.0 ? fmin(1.0, statistics_f_tail(ratio, added, left) * pow(lines, 0.5 * poles)) : 1.0;
}

static bool contains(const struct parametric_order_row *large, const struct parametric_order_row *small)
{
    return large->parameters > small->parameters && large->denominator_order >= small->denominator_order &&
           large->numerator_order >= small->numerator_order;
}

/// Whether no larger row explains surely more, by its own lines and by those held out.
static bool adequate(const struct study *study, const struct parametric_orders *orders, size_t row)
{
    const struct parametric_order_row *small = &orders->rows[row];
    if (!small->judged) {
        return false;
    }
    for (size_t i = 0; i < orders->count && small->cost > study->rounding; i++) {
        const struct parametric_order_row *large = &orders->rows[i];
        if (large->judged && !large->doubtful && contains(large, small) &&
            chance_of_gain(study, small, large) < chance_of_belief && excess(study, row, i) > as_good) {
            return false;
        }
    }
    return true;
}

/// Fewer poles, then fewer parameters, then the smaller cost. Poles first: many of them can stand for zeros.
static bool simpler(const struct parametric_order_row *row, const struct parametric_order_row *other)
{
    if (row->denominator_order != other->denominator_order) {
        return row->denominator_order < other->denominator_order;
    }
    return row->parameters < other->parameters || (row->parameters == other->parameters && row->cost < other->cost);
}

/// The simplest adequate row that is stable and not doubtful, of any kind if `any`; `count` if there is
/// none.
static size_t simplest(const struct study *study, const struct parametric_orders *orders, bool any)
{
    size_t found = orders->count;
    for (size_t i = 0; i < orders->count; i++) {
        const struct parametric_order_row *row = &orders->rows[i];
        if ((any || (row->stable && !row->doubtful)) && adequate(study, orders, i) &&
            (found == orders->count || simpler(row, &orders->rows[found]))) {
            found = i;
        }
    }
    return found;
}

/// Of rows with as many poles, as stable and as little doubtful, the one with the numerator to keep. A coefficient that
/// is left out although it is there moves the response by more than the model's deviations say, and so does one that
/// was taken because it looked large; one that was asked for anyway does not. Held input needs as many as there are
/// poles, and one for a part of a sample. In s, where most of them would be zeros far away, Akaike's criterion chooses.
static size_t best_numerator(const struct study *study, const struct parametric_orders *orders, size_t row)
{
    const double nats = 2.0; // for a parameter, instead of the logarithm of the number of lines
    const struct parametric_order_row *chosen = &orders->rows[row];
    bool discrete = study->options->structure.domain == parametric_discrete;
    double lines = (double)study->data->count;
    double least = INFINITY;
    size_t best = row;
    for (size_t i = 0; i < orders->count && chosen->cost > study->rounding; i++) {
        const struct parametric_order_row *other = &orders->rows[i];
        double spare = 2.0 * lines - (double)other->parameters - 2.0;
        bool able = other->judged && other->denominator_order == chosen->denominator_order && spare > 0.0 &&
                    other->stable >= chosen->stable && other->doubtful <= chosen->doubtful;
        double length = lines * log(other->cost / lines) + lines * nats * (double)other->parameters / spare;
        length = discrete ? -(double)other->numerator_order : length;
        if (able && length < least) {
            least = length;
            best = i;
        }
    }
    return best;
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
        const struct parametric_order_row *row = &io_orders->rows[i];
        if (row->judged && row->mdl < io_orders->rows[io_orders->by_mdl].mdl) {
            io_orders->by_mdl = i;
        }
        if (row->judged && row->parameters < io_orders->rows[io_orders->by_held_out].parameters &&
            excess(study, i, best) <= as_good) {
            io_orders->by_held_out = i;
        }
    }
    const char *reason = "fewest poles of the stable ones that no larger model surely betters";
    io_orders->chosen = simplest(study, io_orders, false);
    if (io_orders->chosen == io_orders->count) {
        reason = "fewest poles of those that no larger model surely betters, none of them stable or without a pole on "
                 "a zero";
        io_orders->chosen = simplest(study, io_orders, true);
    }
    io_orders->chosen = best_numerator(study, io_orders, io_orders->chosen);
    explain(study, best, reason, io_orders);
}

/// What rounding alone adds to the cost; nothing is known without variances, which the fit refuses.
static double rounding_of(const struct parametric_data *data, size_t k)
{
    double share = rounding_share * cabs(data->output[k]);
    bool known = data->unit_weights || data->output_variance;
    return known ? share * share / parametric_error_variance(data, k, 0.0) : 0.0;
}

static bool study_init(struct study *self, size_t rows)
{
    const struct parametric_data *held_out = self->options->held_out;
    bool good = true;
    self->judged = held_out ? held_out->count : self->data->count;
    self->power = malloc(rows * self->judged * sizeof *self->power);
    self->residual = malloc(self->judged * sizeof *self->residual);
    self->models = malloc(rows * sizeof *self->models);
    for (size_t fold = 0; fold < folds && !held_out; fold++) {
        good = subset_init(self->data, fold, false, &self->fitted[fold]) && good;
        good = subset_init(self->data, fold, true, &self->left[fold]) && good;
    }
    for (size_t k = 0; k < self->data->count; k++) {
        self->highest_hz = fmax(self->highest_hz, self->data->frequency_hz[k]);
        self->rounding += rounding_of(self->data, k);
    }
    return good && self->power && self->residual && self->models;
}

static void study_free(struct study *self)
{
    for (size_t fold = 0; fold < folds; fold++) {
        subset_free(&self->fitted[fold]);
        subset_free(&self->left[fold]);
    }
    free(self->power);
    free(self->residual);
    free(self->models);
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

/// Description length of the best row that may be chosen; of any if none may.
static double shortest(const struct parametric_orders *orders)
{
    double able = INFINITY;
    double any = INFINITY;
    for (size_t i = 0; i < orders->count; i++) {
        const struct parametric_order_row *row = &orders->rows[i];
        any = row->fitted ? fmin(any, row->mdl) : any;
        able = row->fitted && row->stable && !row->doubtful ? fmin(able, row->mdl) : able;
    }
    return isfinite(able) ? able : any;
}

/// Whether a row fits worse than one that it contains: it stopped in the wrong place.
static bool astray(const struct parametric_orders *orders, size_t row)
{
    for (size_t i = 0; i < orders->count; i++) {
        const struct parametric_order_row *small = &orders->rows[i];
        if (small->fitted && contains(&orders->rows[row], small) && small->cost < orders->rows[row].cost) {
            return true;
        }
    }
    return false;
}

/// Fits all rows quickly, then those that may be chosen, or have lost their way, with all means. The first refusal is
/// told if none works.
static int fit_rows(struct study *study, struct parametric_orders *io_orders, struct error *out_error)
{
    bool any = false;
    struct error first = {0};
    for (size_t i = 0; i < io_orders->count; i++) {
        struct error refusal;
        if (fit_row(study, true, &io_orders->rows[i], &study->models[i], &refusal) != 0 && !first.status) {
            first = refusal;
        }
        any = any || io_orders->rows[i].fitted;
    }
    double limit = shortest(io_orders) + hopeless;
    for (size_t i = 0; i < io_orders->count; i++) {
        struct parametric_order_row *row = &io_orders->rows[i];
        if (row->fitted && (!(row->mdl > limit) || astray(io_orders, i))) {
            row->fitted = fit_row(study, false, row, &study->models[i], NULL) == 0;
        }
    }
    return any ? 0 : error_set(out_error, error_refused, "%s", first.message);
}

/// Judges the rows that could be chosen by data that were not fitted. Returns false if there is none.
static bool judge_rows(struct study *study, struct parametric_orders *io_orders)
{
    double limit = shortest(io_orders) + hopeless;
    bool any = false;
    for (size_t i = 0; i < io_orders->count; i++) {
        struct parametric_order_row *row = &io_orders->rows[i];
        double *power = study->power + i * study->judged;
        if (row->fitted && !(row->mdl > limit)) {
            row->judged = judge(study, &study->models[i], power);
            row->held_out = row->judged ? mean(power, study->judged) : 0.0;
            any = any || row->judged;
        }
    }
    return any;
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
    if (!status && !judge_rows(&study, &orders)) {
        status = error_set(out_error, error_refused,
                           "%s: no pair of orders could be fitted to three quarters of %zu lines: expected more lines",
                           data->name, data->count);
    }
    if (!status) {
        choose(&study, &orders);
        *out_model = study.models[orders.chosen];
        *out_orders = orders;
    }
    study_free(&study);
    return status;
}
