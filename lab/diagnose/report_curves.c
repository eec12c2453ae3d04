/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/report_curves.h"

#include <math.h>
#include <string.h>

/// Squares of the three ratios of the bins of one band.
struct band_sum {
    size_t bins;
    double frequency_hz, nominal, refitted, extended;
};

static void close_band(struct band_sum *io_sum, struct report_bands *io_bands)
{
    if (io_sum->bins > 0 && io_bands->count < report_bands_max) {
        double n = (double)io_sum->bins;
        size_t i = io_bands->count++;
        io_bands->frequency_hz[i] = io_sum->frequency_hz / n;
        io_bands->nominal[i] = sqrt(io_sum->nominal / n);
        io_bands->refitted[i] = sqrt(io_sum->refitted / n);
        io_bands->extended[i] = sqrt(io_sum->extended / n);
        io_bands->widest = io_sum->bins > io_bands->widest ? io_sum->bins : io_bands->widest;
    }
    *io_sum = (struct band_sum){0};
}

static void add_bin(const struct diagnosis_curves *c, size_t k, struct band_sum *io_sum)
{
    double sigma = c->two_sigma_Nm[k];
    if (sigma > 0.0 && isfinite(c->nominal_Nm[k] + c->refitted_Nm[k] + c->extended_Nm[k])) {
        io_sum->bins++;
        io_sum->frequency_hz += c->frequency_hz[k];
        io_sum->nominal += pow(c->nominal_Nm[k] / sigma, 2.0);
        io_sum->refitted += pow(c->refitted_Nm[k] / sigma, 2.0);
        io_sum->extended += pow(c->extended_Nm[k] / sigma, 2.0);
    }
}

void report_bands_find(const struct diagnosis_curves *curves, struct report_bands *out_bands)
{
    const double logarithmic_from = 30.0; // a decade and a half: below, a linear axis shows the low end well enough
    const size_t places = report_bands_max - 40; // bands are at least a bin wide, so that steps are not evenly filled
    memset(out_bands, 0, sizeof *out_bands);
    if (curves->bins == 0) {
        return;
    }
    double first = curves->frequency_hz[0], last = curves->frequency_hz[curves->bins - 1];
    out_bands->logarithmic = first > 0.0 && last > logarithmic_from * first;
    double ratio = out_bands->logarithmic ? pow(last / first, 1.0 / (double)places) : 1.0;
    double step = out_bands->logarithmic ? 0.0 : (last - first) / (double)places;
    struct band_sum sum = {0};
    double end = first * ratio + step;
    for (size_t k = 0; k < curves->bins; k++) {
        if (curves->frequency_hz[k] >= end) {
            close_band(&sum, out_bands);
            end = curves->frequency_hz[k] * ratio + step;
        }
        add_bin(curves, k, &sum);
    }
    close_band(&sum, out_bands);
}

struct report_excess report_excess_find(const struct diagnosis_curves *curves, const double *error_Nm)
{
    struct report_excess found = {0};
    for (size_t k = 0; k < curves->bins; k++) {
        double ratio = error_Nm[k] / curves->two_sigma_Nm[k];
        if (curves->two_sigma_Nm[k] > 0.0 && isfinite(ratio)) {
            found.bins++;
            found.above += ratio > 1.0;
            if (ratio > found.worst) {
                found.worst = ratio;
                found.worst_hz = curves->frequency_hz[k];
            }
        }
    }
    return found;
}

double report_rms(const double *values, size_t count)
{
    double sum = 0.0;
    size_t used = 0;
    for (size_t i = 0; i < count; i++) {
        if (isfinite(values[i])) {
            sum += values[i] * values[i];
            used++;
        }
    }
    return used > 0 ? sqrt(sum / (double)used) : NAN;
}

size_t report_worst_stretch(const struct diagnosis_curves *curves, size_t width)
{
    const double *r = curves->residual_nominal;
    double energy = 0.0, most = -1.0;
    size_t best = 0;
    for (size_t i = 0; i < curves->samples; i++) {
        energy += isfinite(r[i]) ? r[i] * r[i] : 0.0;
        if (i >= width) {
            energy -= isfinite(r[i - width]) ? r[i - width] * r[i - width] : 0.0;
        }
        if (i + 1 >= width && energy > most) {
            most = energy;
            best = i + 1 - width;
        }
    }
    return best;
}

/// Value of the extended model's friction curve at a speed, NaN outside it and in the jump at standstill.
static double curve_at(const struct diagnosis_curves *c, double velocity)
{
    for (size_t i = 1; i < c->curve_points; i++) {
        double from = c->curve_velocity[i - 1], to = c->curve_velocity[i];
        bool jump = from <= 0.0 && to >= 0.0;
        if (velocity >= from && velocity <= to && to > from && !jump) {
            double share = (velocity - from) / (to - from);
            return c->curve_extended[i - 1] + share * (c->curve_extended[i] - c->curve_extended[i - 1]);
        }
    }
    return NAN;
}

void report_friction_find(const struct diagnosis_curves *curves, struct report_friction *out_friction)
{
    size_t stride = curves->samples / report_points_max + 1;
    double sum = 0.0;
    size_t used = 0;
    out_friction->count = 0;
    for (size_t i = 0; i < curves->samples && out_friction->count < report_points_max; i += stride) {
        double velocity = curves->velocity[i], torque = curves->friction_measured[i];
        if (!isfinite(velocity) || !isfinite(torque)) {
            continue;
        }
        out_friction->velocity[out_friction->count] = velocity;
        out_friction->torque[out_friction->count++] = torque;
        double off = torque - curve_at(curves, velocity);
        if (isfinite(off)) {
            sum += off * off;
            used++;
        }
    }
    out_friction->spread = used > 0 ? sqrt(sum / (double)used) : NAN;
}
