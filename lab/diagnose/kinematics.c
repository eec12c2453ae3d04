/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/kinematics.h"

#include "lab/diagnose/noise.h"
#include "lab/diagnose/predict.h"
#include "sim/plant.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

void kinematics_free(struct kinematics *self)
{
    free(self->weight);
    free(self->target);
    free(self->basis);
    memset(self, 0, sizeof *self);
}

/// Whether a model has an effect on that acts on the sensors.
static bool acts_on_sensors(const struct sim_model *model)
{
    for (size_t e = 0; sim_effects[e]; e++)
        if (model->effect_on[e] && sim_effects[e]->sense)
            return true;
    return false;
}

static double power_of(const double *spectrum, size_t k)
{
    return spectrum[2 * k] * spectrum[2 * k] + spectrum[2 * k + 1] * spectrum[2 * k + 1];
}

/// Power per bin of what differs between the periods, that of their mean.
static bool scatter_of_periods(const struct evidence *e, double *out_power)
{
    const struct recording *r = e->recording;
    size_t stride = 2 * (r->band + 1), P = r->periods;
    double *spectra = malloc((P + 1) * stride * sizeof *spectra);
    if (!spectra)
        return false;
    double *mean = spectra + P * stride;
    memset(mean, 0, stride * sizeof *mean);
    for (size_t p = 0; p < P; p++) {
        evidence_transform(e, r->all.kinematics + r->starts[p], spectra + p * stride);
        for (size_t i = 0; i < stride; i++)
            mean[i] += spectra[p * stride + i] / (double)P;
    }
    for (size_t k = 0; k <= e->kinematics.bins; k++)
        out_power[k] = 0.0;
    for (size_t p = 0; p < P; p++)
        for (size_t k = 0; k <= e->kinematics.bins; k++) {
            const double *own = spectra + p * stride + 2 * k, *m = mean + 2 * k;
            out_power[k] +=
                ((own[0] - m[0]) * (own[0] - m[0]) + (own[1] - m[1]) * (own[1] - m[1])) / ((double)P * (double)(P - 1));
        }
    free(spectra);
    return true;
}

static int ascending(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/// Smooth noise power about bin k: the mean of a scatter, the median of a spectrum that may have lines. The mean of the
/// scatters of `periods` counts for a little more, by what its expected inverse is too large.
static double smooth_power(const double *power, size_t bins, size_t k, size_t periods, double *work)
{
    bool lines = periods < 2;
    size_t near = k / 2 > 3 ? k / 2 : 3, reach = lines ? 15 + k / 5 : near < 10 ? near : 10;
    size_t from = k > reach ? k - reach : 1, to = k + reach < bins ? k + reach : bins, count = to - from + 1;
    if (lines) {
        const double median_of_mean = 0.6931471805599453; // of the square of a complex normal number
        memcpy(work, power + from, count * sizeof *work);
        qsort(work, count, sizeof *work, ascending);
        return work[count / 2] / median_of_mean;
    }
    double sum = 0.0;
    for (size_t i = from; i <= to; i++)
        sum += power[i];
    return sum / ((double)count - 1.0 / (double)(periods - 1));
}

static double dot(size_t n, const double *a, const double *b)
{
    double sum = 0.0;
    for (size_t i = 0; i < n; i++)
        sum += a[i] * b[i];
    return sum;
}

/// Whitened powers of jw times the speed, each made orthogonal to those before; those that add nothing are left out.
static void build_basis(struct evidence *e, const double *speed)
{
    struct kinematics *self = &e->kinematics;
    self->nuisances = 0;
    for (size_t q = 0; q < kinematics_nuisances && 2 * (self->nuisances + 1) < self->bins; q++) {
        double *column = self->basis + self->nuisances * self->values;
        for (size_t k = 1; k <= self->bins; k++) {
            double u = pow((double)k / (double)self->bins, (double)q) * self->weight[k];
            double re = u * speed[2 * k], im = u * speed[2 * k + 1];
            // jw turns the one part into the other; signs do not matter to a span but between the two parts.
            column[2 * k - 2] = q % 2 == 0 ? re : -im;
            column[2 * k - 1] = q % 2 == 0 ? im : re;
        }
        double before = dot(self->values, column, column);
        for (int pass = 0; pass < 2; pass++)
            for (size_t b = 0; b < self->nuisances; b++) {
                const double *other = self->basis + b * self->values;
                double along = dot(self->values, column, other);
                for (size_t i = 0; i < self->values; i++)
                    column[i] -= along * other[i];
            }
        double after = dot(self->values, column, column);
        if (!(after > 1e-12 * before))
            continue;
        for (size_t i = 0; i < self->values; i++)
            column[i] /= sqrt(after);
        self->nuisances++;
    }
}

/// Whitens the spectrum of a difference and takes the nuisances out.
static void whiten(const struct kinematics *self, const double *spectrum, double *out)
{
    for (size_t k = 1; k <= self->bins; k++) {
        out[2 * k - 2] = self->weight[k] * spectrum[2 * k];
        out[2 * k - 1] = self->weight[k] * spectrum[2 * k + 1];
    }
    for (size_t q = 0; q < self->nuisances; q++) {
        const double *column = self->basis + q * self->values;
        double along = dot(self->values, out, column);
        for (size_t i = 0; i < self->values; i++)
            out[i] -= along * column[i];
    }
}

/// Variance per bin of what is no noise, reversals above all: friction turns between two samples, acceleration jumps by
/// `jump`, and a sum of speeds misses the way by jump h^2 (1/12 - u (1 - u) / 2), u the place within the sample: 0.0373
/// of it RMS.
static double systematic_power(const struct evidence *e, const struct sim_model *model)
{
    const struct recording *r = e->recording;
    const double *v = r->block.velocity;
    size_t n = r->block.samples, reversals = 0;
    for (size_t i = 1; i < n; i++)
        reversals += (v[i] > 0.0) != (v[i - 1] > 0.0);
    struct sim_motion at = {
        .position = r->coverage.position_mean, .velocity = 1e-3 * r->coverage.velocity_rms, .linear = r->linear};
    struct sim_opposing o;
    sim_plant_opposing(model, &at, &o);
    double moved = model->motor_inertia_kgm2;
    if (model->structure == sim_structure_rigid)
        moved += model->load_inertia_kgm2;
    double each = 0.0373 * 2.0 * o.dry / moved / r->rate_hz / (double)n;
    // Beyond this no two columns are known to agree: digits, clocks.
    double digits = 5e-7 * r->coverage.velocity_rms;
    return (double)reversals * each * each + digits * digits;
}

static bool estimate(struct evidence *e, const struct sim_model *model, double *work)
{
    struct kinematics *self = &e->kinematics;
    const struct recording *r = e->recording;
    double *power = work, *sorted = power + r->band + 1, *speed = sorted + r->band + 1;
    double *difference = speed + 2 * (r->band + 1);
    evidence_transform(e, r->block.velocity, speed);
    evidence_transform(e, r->block.kinematics, difference);
    if (r->periodic && !scatter_of_periods(e, power))
        return false;
    for (size_t k = 0; !r->periodic && k <= self->bins; k++)
        power[k] = power_of(difference, k);
    double added = systematic_power(e, model);
    for (size_t k = 1; k <= self->bins; k++) {
        double smooth = smooth_power(power, self->bins, k, r->periodic ? r->periods : 1, sorted);
        self->weight[k] = 1.0 / sqrt(fmax(0.5 * (smooth + (r->periodic ? added : 0.0)), 1e-300));
    }
    build_basis(e, speed);
    whiten(self, difference, self->target);
    return true;
}

bool kinematics_init(struct evidence *evidence)
{
    struct kinematics *self = &evidence->kinematics;
    const struct recording *r = evidence->recording;
    const size_t fewest = 8;
    const double highest = 0.02; // of the sample rate
    memset(self, 0, sizeof *self);
    size_t bins = (size_t)fmin((double)r->band, highest * (double)r->block.samples);
    if (!r->block.kinematics || bins < fewest || (r->periodic && r->periods < 2))
        return true;
    self->bins = bins;
    self->values = 2 * bins;
    self->weight = calloc(bins + 1, sizeof *self->weight);
    self->target = calloc(self->values, sizeof *self->target);
    self->basis = calloc(self->values * kinematics_nuisances, sizeof *self->basis);
    return self->weight && self->target && self->basis;
}

bool kinematics_estimate_noise(struct evidence *evidence, const struct sim_model *model)
{
    if (evidence->kinematics.values == 0)
        return true;
    double *work = malloc(6 * (evidence->recording->band + 1) * sizeof *work);
    bool good = work && estimate(evidence, model, work);
    free(work);
    return good;
}

bool kinematics_residual(const struct evidence *evidence, const struct sim_model *model, double *out)
{
    const struct kinematics *self = &evidence->kinematics;
    const struct recording *r = evidence->recording;
    if (self->values == 0)
        return true;
    if (!acts_on_sensors(model)) {
        memcpy(out, self->target, self->values * sizeof *out);
        return true;
    }
    double *left = malloc((r->block.samples + 2 * (r->band + 1)) * sizeof *left);
    if (!left)
        return false;
    double *spectrum = left + r->block.samples;
    predict_kinematics(model, &r->block, left);
    evidence_transform(evidence, left, spectrum);
    whiten(self, spectrum, out);
    free(left);
    return true;
}
