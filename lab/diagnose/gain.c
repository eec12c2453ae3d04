/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/gain.h"

#include "lab/numeric/least_squares.h"

#include <math.h>
#include <stdlib.h>

struct gain_input gain_find_input(const struct run *run)
{
    static const struct {
        const char *measured, *reference, *unit;
    } inputs[] = {{"torque_Nm", "torque_ref_Nm", NULL},
                  {"force_N", "force_ref_N", NULL},
                  {"current_A", "current_ref_A", "A"},
                  {"voltage_V", "voltage_ref_V", "V"}};
    for (size_t i = 0; i < sizeof inputs / sizeof inputs[0]; i++) {
        if (i == (run->linear ? 0 : 1))
            continue;
        const double *measured = run_column(run, inputs[i].measured);
        if (measured)
            return (struct gain_input){measured, run_column(run, inputs[i].reference), inputs[i].unit};
    }
    return (struct gain_input){NULL, NULL, NULL};
}

static void scale(size_t count, double factor, double *io_values)
{
    for (size_t i = 0; io_values && i < count; i++)
        io_values[i] *= factor;
}

void gain_scale(struct recording *io_recording, double factor)
{
    struct stretch *stretches[] = {&io_recording->all, &io_recording->block};
    for (size_t i = 0; i < 2; i++) {
        scale(stretches[i]->samples, factor, stretches[i]->torque);
        scale(stretches[i]->samples, factor, stretches[i]->torque_ref);
    }
    struct sim_coverage *c = &io_recording->coverage;
    c->torque_rms *= fabs(factor);
    c->torque_peak *= fabs(factor);
    c->reference_peak *= fabs(factor);
}

/// Derivative of the whitened residual by the logarithm of the gain. What the actuator is off by is in units of the
/// input, and so is its noise: only the mechanics tell the gain.
static bool differentiate(const struct fit_data *data, const struct sim_model *model, struct recording *recordings,
                          double *out_column)
{
    const double step = 1e-3;
    for (size_t i = 0; i < data->runs; i++) {
        const struct evidence *e = &data->evidence[i];
        size_t n = recordings[i].block.samples;
        double *before = malloc(3 * n * sizeof *before);
        if (!before)
            return false;
        double *after = before + n, *unused = after + n;
        bool good = evidence_signals(e, model, before, unused);
        gain_scale(&recordings[i], 1.0 + step);
        good = good && evidence_signals(e, model, after, unused);
        gain_scale(&recordings[i], 1.0 / (1.0 + step));
        for (size_t j = 0; j < n; j++)
            after[j] = (after[j] - before[j]) / step;
        if (good)
            evidence_whiten(e, after, NULL, out_column);
        free(before);
        if (!good)
            return false;
        out_column += e->values;
    }
    return true;
}

bool gain_step(const struct fit_data *data, const struct fit *fit, const struct hypothesis *hypothesis,
               struct recording *recordings, double *out_step, double *out_deviation)
{
    size_t rows = data->values, m = hypothesis->count;
    double weight[hypothesis_coordinates_max + 1] = {0}, centre[hypothesis_coordinates_max + 1] = {0};
    double x[hypothesis_coordinates_max + 1];
    double *A = malloc((rows * (m + 2)) * sizeof *A), *covariance = malloc((m + 1) * (m + 1) * sizeof *A);
    bool good = A && covariance;
    if (good) {
        double *column = A + rows * m, *b = column + rows;
        struct sim_model model;
        hypothesis_model(hypothesis, NULL, &model);
        fit_linear(fit, data, hypothesis, A, weight, centre);
        for (size_t j = 0; j < rows; j++)
            b[j] = -fit->residual[j];
        good = differentiate(data, &model, recordings, column) &&
               least_squares_solve(rows, m + 1, A, b, weight, centre, x, covariance);
        *out_step = good ? x[m] : 0.0;
        *out_deviation = good ? sqrt(covariance[(m + 1) * (m + 1) - 1]) : 0.0;
    }
    free(A);
    free(covariance);
    return good;
}
