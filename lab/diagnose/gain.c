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

/// Derivative of the whitened residual over the gain, by the logarithm of the gain.
static void differentiate(const struct fit_data *data, const struct sim_model *model, struct recording *recordings,
                          double *work, double *out_column)
{
    const double step = 1e-3;
    fit_residual(data, model, out_column);
    for (size_t i = 0; i < data->runs; i++)
        gain_scale(&recordings[i], 1.0 + step);
    fit_residual(data, model, work);
    for (size_t i = 0; i < data->runs; i++)
        gain_scale(&recordings[i], 1.0 / (1.0 + step));
    for (size_t j = 0; j < data->values; j++)
        out_column[j] = (work[j] / (1.0 + step) - out_column[j]) / step;
}

bool gain_step(const struct fit_data *data, const struct fit *fit, const struct hypothesis *hypothesis,
               struct recording *recordings, double *out_step, double *out_deviation)
{
    size_t rows = data->values, m = hypothesis->count, all = rows + data->contrasts;
    double weight[hypothesis_coordinates_max + 1] = {0}, centre[hypothesis_coordinates_max + 1] = {0};
    double x[hypothesis_coordinates_max + 1];
    double *A = malloc((rows * m + all + rows + all) * sizeof *A), *covariance = malloc((m + 1) * (m + 1) * sizeof *A);
    bool good = A && covariance;
    if (good) {
        double *column = A + rows * m, *b = column + all, *work = b + rows;
        struct sim_model model;
        hypothesis_model(hypothesis, NULL, &model);
        fit_linear(fit, data, hypothesis, A, weight, centre);
        differentiate(data, &model, recordings, work, column);
        for (size_t j = 0; j < rows; j++)
            b[j] = -fit->residual[j];
        good = least_squares_solve(rows, m + 1, A, b, weight, centre, x, covariance);
        *out_step = good ? x[m] : 0.0;
        *out_deviation = good ? sqrt(covariance[(m + 1) * (m + 1) - 1]) : 0.0;
    }
    free(A);
    free(covariance);
    return good;
}
