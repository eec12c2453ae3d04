/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/slow.h"

#include "lab/diagnose/noise.h"

#include <math.h>
#include <stdlib.h>

double slow_larger_variance(double part, double m, double sum, double n, double *out_excess)
{
    double rest = sum - part, others = n - m;
    *out_excess = rest > 0.0 ? part / m / (rest / others) : INFINITY;
    if (!(part > 0.0 && rest > 0.0) || *out_excess <= 1.0)
        return 0.0;
    return 0.5 * (n * log(sum / n) - m * log(part / m) - others * log(rest / others));
}

size_t slow_octaves(size_t band, struct slow_octave out[slow_octaves_most])
{
    size_t count = 0, from = 0;
    for (size_t to = 4; from <= band && count < slow_octaves_most; to *= 2) {
        bool last = to > band || count + 1 == slow_octaves_most;
        out[count] = (struct slow_octave){from, last ? band + 1 : to};
        from = out[count++].to;
    }
    return count;
}

size_t slow_courses(size_t periods, double *out)
{
    size_t orders = periods >= 6 ? 2 : 1;
    for (size_t q = 0; q < orders; q++) {
        double *course = out + q * periods, norm = 0.0, mean = 0.0;
        for (size_t p = 0; p < periods; p++) {
            double u = (2.0 * (double)p - (double)(periods - 1)) / (double)periods;
            course[p] = q == 0 ? u : u * u;
            mean += course[p] / (double)periods;
        }
        for (size_t p = 0; p < periods; p++) {
            course[p] -= mean; // even and odd courses are orthogonal by themselves
            norm += course[p] * course[p];
        }
        for (size_t p = 0; p < periods; p++)
            course[p] /= sqrt(norm);
    }
    return orders;
}

void slow_along(const double *values, size_t stride, size_t periods, const double *course, double out_along[2])
{
    out_along[0] = out_along[1] = 0.0;
    for (size_t p = 0; p < periods; p++) {
        out_along[0] += course[p] * values[p * stride];
        out_along[1] += course[p] * values[p * stride + 1];
    }
}

/// Squares of an octave's whitened mechanics over all periods, and the part of them that lies in slow courses. The
/// constant part is real. Returns how many values a period has there.
static size_t slow_squares(const struct evidence *e, const double *deviations, size_t stride,
                           const struct slow_octave *o, const double *courses, size_t orders, double *out_slow,
                           double *out_sum)
{
    size_t P = e->recording->periods, parts = o->from == 0 ? 2 * o->to - 1 : 2 * (o->to - o->from);
    *out_slow = *out_sum = 0.0;
    for (size_t k = o->from; k < o->to; k++) {
        double square = e->factor[4 * k] * e->factor[4 * k];
        for (size_t p = 0; p < P; p++) {
            const double *d = deviations + p * stride + 2 * k;
            *out_sum += square * (d[0] * d[0] + (k > 0 ? d[1] * d[1] : 0.0));
        }
        for (size_t q = 0; q < orders; q++) {
            double along[2];
            slow_along(deviations + 2 * k, stride, P, courses + q * P, along);
            *out_slow += square * (along[0] * along[0] + (k > 0 ? along[1] * along[1] : 0.0));
        }
    }
    return parts;
}

bool slow_find(const struct evidence *evidence, const double *deviations, size_t stride, size_t *out_orders)
{
    // Noise that is slow by chance costs the estimate a few of its scatters, and nothing else: half of what a verdict
    // asks for will do.
    const double enough_nats = 6.0;
    const struct recording *r = evidence->recording;
    struct slow_octave octaves[slow_octaves_most];
    size_t P = r->periods, count = slow_octaves(r->band, octaves);
    double *courses = P >= slow_fewest_periods ? malloc(slow_orders_most * P * sizeof *courses) : NULL;
    bool found = false;
    if (!courses)
        return false;
    size_t orders = slow_courses(P, courses);
    for (size_t i = 0; i < count; i++) {
        double slow, sum, excess;
        double values = (double)slow_squares(evidence, deviations, stride, &octaves[i], courses, orders, &slow, &sum);
        double nats = slow_larger_variance(slow, values * (double)orders, sum, values * (double)(P - 1), &excess);
        bool changes = nats > enough_nats + log((double)count);
        for (size_t k = octaves[i].from; changes && k < octaves[i].to; k++)
            out_orders[k] = orders;
        found = found || changes;
    }
    free(courses);
    return found;
}
