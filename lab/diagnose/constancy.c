/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/constancy.h"

#include "lab/diagnose/slow.h"

#include <math.h>
#include <stdlib.h>

/// Sum over the slow courses of the squares of one run's contrasts along a column, which noise makes one each.
static double slow_along_column(const struct evidence *e, const double *column, const double *contrasts,
                                double *courses)
{
    size_t P = e->recording->periods, orders = slow_courses(P, courses), width = e->contrast.width;
    double along[slow_orders_most] = {0.0}, square = 0.0, sum = 0.0;
    for (size_t i = 0; i < width; i++) {
        // A period's values are bin 0, then real and imaginary parts; the block's have the actuator between them.
        size_t bin = (i + 1) / 2;
        double c = column[bin == 0 ? 0 : 1 + 2 * e->channels * (bin - 1) + (i + 1) % 2];
        square += c * c;
        for (size_t q = 0; q < orders; q++)
            for (size_t p = 0; p < P; p++)
                along[q] += courses[q * P + p] * c * contrasts[p * width + i];
    }
    for (size_t q = 0; q < orders; q++)
        sum += square > 0.0 ? along[q] * along[q] / square : 0.0;
    return sum;
}

/// One coordinate over all runs: the largest.
static double coordinate_nats(const struct fit_data *data, const struct fit *fit, size_t coordinate)
{
    const double *contrasts = fit->rows > data->values ? fit->residual + data->values : NULL;
    const double *column = fit->jacobian + coordinate * fit->rows;
    double most = 0.0;
    for (size_t i = 0; i < data->runs; i++) {
        const struct evidence *e = &data->evidence[i];
        size_t P = e->recording->periods;
        double *courses =
            e->contrast.values > 0 && P >= slow_fewest_periods ? malloc(slow_orders_most * P * sizeof *courses) : NULL;
        if (courses)
            most = fmax(most, 0.5 * slow_along_column(e, column, contrasts ? contrasts : e->contrast.base, courses));
        free(courses);
        column += e->values;
        contrasts = contrasts ? contrasts + e->contrast.values : NULL;
    }
    return most;
}

double constancy_nats(const struct fit_data *data, const struct hypothesis *hypothesis, const struct fit *fit,
                      int effect)
{
    double most = 0.0;
    for (size_t i = 0; i < hypothesis->count && !sim_effects[effect]->in_time; i++)
        if (hypothesis->coordinates[i].effect == effect)
            most = fmax(most, coordinate_nats(data, fit, i));
    return most;
}

bool constancy_is_broken(double nats, double evidence)
{
    const double beyond_chance = 12.0, share = 0.01; // of the squares: a tenth of the size
    return nats > beyond_chance && nats > share * evidence;
}
