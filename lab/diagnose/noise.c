/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/noise.h"

#include "lab/diagnose/predict.h"
#include "lab/diagnose/slow.h"
#include "lab/numeric/fft.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double pi = 3.14159265358979324;

bool evidence_init(struct evidence *self, const struct recording *recording, double scale_inertia)
{
    memset(self, 0, sizeof *self);
    self->recording = recording;
    self->scale_inertia = scale_inertia;
    self->channels = recording->block.torque_ref ? 2 : 1;
    size_t n = recording->block.samples, bins = recording->band + 1;
    self->values = self->channels * (2 * recording->band) + 1; // the constant part: mechanics only
    self->plan = fft_plan_create(n);
    self->covariance = calloc(4 * bins, sizeof(double));
    self->factor = calloc(4 * bins, sizeof(double));
    self->between = calloc(4 * bins, sizeof(double));
    self->slow = calloc(bins, sizeof *self->slow);
    self->work = malloc((4 * n + 2 * n + 4 * bins) * sizeof(double));
    if (self->plan && self->covariance && self->factor && self->between && self->slow && self->work &&
        contrast_init(&self->contrast, recording) && kinematics_init(self)) {
        self->values += self->kinematics.values;
        self->allowances = calloc(evidence_allowances * self->values, sizeof *self->allowances);
        if (self->allowances)
            return true;
    }
    evidence_free(self);
    return false;
}

void evidence_free(struct evidence *self)
{
    if (self->plan)
        fft_plan_destroy(self->plan);
    free(self->covariance);
    free(self->factor);
    free(self->between);
    free(self->slow);
    free(self->allowances);
    free(self->work);
    contrast_free(&self->contrast);
    kinematics_free(&self->kinematics);
    memset(self, 0, sizeof *self);
}

/// Cosine taper over a twentieth at each end: keeps the ends of a run without periods from leaking into every bin.
static double taper(const struct recording *r, size_t i)
{
    size_t n = r->block.samples, edge = n / 20;
    size_t from_end = i < n - 1 - i ? i : n - 1 - i;
    if (r->periodic || from_end >= edge)
        return 1.0;
    return 0.5 - 0.5 * cos(pi * ((double)from_end + 0.5) / (double)edge);
}

double evidence_weight(const struct evidence *self, size_t i)
{
    const struct recording *r = self->recording;
    double n = (double)r->block.samples, edges = r->periodic ? 0.0 : 2.0 * floor(n / 20.0);
    double square = taper(r, i) * taper(r, i);
    return square / (1.0 - 0.625 * edges / n); // the mean square of half a cosine's rise is 3/8
}

void evidence_transform(const struct evidence *self, const double *signal, double *out_spectrum)
{
    const struct recording *r = self->recording;
    size_t n = r->block.samples;
    double *in = self->work, *out = in + 2 * n;
    for (size_t i = 0; i < n; i++) {
        in[2 * i] = signal[i] * taper(r, i);
        in[2 * i + 1] = 0.0;
    }
    fft_forward(self->plan, in, out);
    for (size_t i = 0; i < 2 * (r->band + 1); i++)
        out_spectrum[i] = out[i] / (double)n;
}

/// Adds weight * (m, a) (m, a)^H to the raw covariance of one bin.
static void accumulate(double *c, const double *m, const double *a, double weight)
{
    c[0] += weight * (m[0] * m[0] + m[1] * m[1]);
    if (!a)
        return;
    c[1] += weight * (a[0] * a[0] + a[1] * a[1]);
    c[2] += weight * (a[0] * m[0] + a[1] * m[1]);
    c[3] += weight * (a[1] * m[0] - a[0] * m[1]);
}

/// The bins over which the noise of bin k is averaged; more with frequency in a run without periods, where lines are
/// dense.
static void neighbours(const struct recording *r, size_t k, size_t *out_from, size_t *out_to)
{
    // The noise of a measured speed grows with the square of frequency here: few neighbours at the low end.
    size_t near = k / 2 > 2 ? k / 2 : 2;
    size_t reach = !r->periodic ? 15 + k / 5 : near < 10 ? near : 10;
    // Bin 0 is real: its variance is that of a complex neighbour, so it is left out of the others' means.
    *out_from = k > reach ? k - reach : 1;
    *out_to = k + reach < r->band ? k + reach : r->band;
}

static void smooth(const struct evidence *self, const double *raw)
{
    for (size_t k = 0; k <= self->recording->band; k++) {
        size_t from, to;
        neighbours(self->recording, k, &from, &to);
        for (size_t j = 0; j < 4; j++) {
            double sum = 0.0;
            for (size_t i = from; i <= to; i++)
                sum += raw[4 * i + j];
            self->covariance[4 * k + j] = sum / (double)(to - from + 1);
        }
    }
}

/// The expected inverse of a covariance estimated from `scatters` complex deviations is n / (n - channels) times that
/// of the covariance (complex Wishart): without taking this back a perfect model's residual would seem larger than
/// noise.
/// Equation:  E |w_1|^2 = n / (n - 1),  E |w_2|^2 = n^2 / ((n - 1) (n - 2)),  w = L^-1 R, R independent of the estimate
static void take_bias_back(const struct evidence *self, double scatters, double *io_factor)
{
    const double few = 0.5; // a variance of that few says nothing anyway
    double first = fmax(scatters - 1.0, few) / scatters;
    io_factor[0] *= sqrt(first);
    for (size_t j = 1; self->channels == 2 && j < 4; j++)
        io_factor[j] *= sqrt(first * fmax(scatters - 2.0, few) / scatters);
}

/// Inverse Cholesky factor per bin, for real and imaginary parts of unit variance (hence half the complex variance
/// each).
static void factorise(const struct evidence *self)
{
    const struct recording *r = self->recording;
    for (size_t k = 0; k <= r->band; k++) {
        const double *c = self->covariance + 4 * k;
        double *f = self->factor + 4 * k;
        double part = k == 0 ? 1.0 : 0.5;
        double mm = fmax(part * c[0], 1e-300);
        f[0] = 1.0 / sqrt(mm);
        size_t from, to;
        neighbours(r, k, &from, &to);
        if (self->channels == 2) {
            double re = c[2] / fmax(c[0], 1e-300), im = c[3] / fmax(c[0], 1e-300);
            double rest = fmax(part * c[1] - part * c[0] * (re * re + im * im), 1e-9 * part * c[1] + 1e-300);
            f[1] = 1.0 / sqrt(rest);
            f[2] = -re * f[1];
            f[3] = -im * f[1];
        }
        // In a run without periods the residual is part of its own estimate, and one on the average as it is.
        double scatters = 0.0;
        for (size_t i = from; i <= to; i++)
            scatters += (double)(r->periods - 1 - self->slow[i]);
        if (r->periodic)
            take_bias_back(self, scatters, f);
    }
}

static double dot(size_t n, const double *a, const double *b)
{
    double sum = 0.0;
    for (size_t i = 0; i < n; i++)
        sum += a[i] * b[i];
    return sum;
}

static void scale_along(size_t n, const double *unit, double factor, double *io_whitened)
{
    double along = (factor - 1.0) * dot(n, unit, io_whitened);
    for (size_t i = 0; i < n; i++)
        io_whitened[i] += along * unit[i];
}

static void apply_allowances(const struct evidence *self, double *io_whitened)
{
    for (size_t q = 0; q < self->allowance_count; q++)
        scale_along(self->values, self->allowances + q * self->values, self->allowance_kept[q], io_whitened);
}

static void undo_allowances(const struct evidence *self, double *io_whitened)
{
    for (size_t q = self->allowance_count; q-- > 0;)
        scale_along(self->values, self->allowances + q * self->values, 1.0 / self->allowance_kept[q], io_whitened);
}

static void whiten_spectra(const struct evidence *self, const double *m, const double *a, double *out_whitened)
{
    double *w = out_whitened;
    *w++ = self->factor[0] * m[0];
    for (size_t k = 1; k <= self->recording->band; k++) {
        const double *f = self->factor + 4 * k, *mk = m + 2 * k, *ak = a + 2 * k;
        *w++ = f[0] * mk[0];
        *w++ = f[0] * mk[1];
        if (self->channels == 1)
            continue;
        *w++ = f[1] * ak[0] + f[2] * mk[0] - f[3] * mk[1];
        *w++ = f[1] * ak[1] + f[2] * mk[1] + f[3] * mk[0];
    }
    memset(w, 0, self->kinematics.values * sizeof *w);
}

/// Adds the covariance of an error of known shape and unknown size, standard deviation one: of a whitened residual,
/// 1 / sqrt(1 + |c|^2) is kept along its whitened shape c.
static void allow(struct evidence *self, const double *mechanics, const double *actuator)
{
    double *c = self->allowances + self->allowance_count * self->values;
    whiten_spectra(self, mechanics, actuator, c);
    apply_allowances(self, c);
    double square = dot(self->values, c, c);
    if (!(square > 0.0 && isfinite(square)))
        return;
    for (size_t i = 0; i < self->values; i++)
        c[i] /= sqrt(square);
    self->allowance_kept[self->allowance_count++] = 1.0 / sqrt(1.0 + square);
}

/// Times factor (j w h)^order, w h the angle per sample.
static void differentiate(size_t bins, size_t samples, double factor, size_t order, double *io_spectrum)
{
    for (size_t k = 0; k < bins; k++) {
        double w = 2.0 * pi * (double)k / (double)samples, size = factor * pow(w, (double)order);
        double re = io_spectrum[2 * k], im = io_spectrum[2 * k + 1];
        for (size_t i = 0; i < order; i++) {
            double held = re;
            re = -im;
            im = held;
        }
        io_spectrum[2 * k] = size * re;
        io_spectrum[2 * k + 1] = size * im;
    }
}

/// Nobody's torque and speed columns are of the same instant to the last digit: a skew s makes s jw T. What one
/// interrupt latches is a conversion apart, a thousandth of a sample; more would take whatever torque and motion say
/// differently about a delay for a skew. And a speed
/// that is the derivative of samples is wrong by some (w h)^2 / 12 of it, (w h)^4 / 120 and smaller terms, too large or
/// late, by how the torque changed between them.
static void make_allowances(struct evidence *self)
{
    const double together = 0.001, apart = 1.0; // of a sample; without a reference the torque may be a held command
    const struct recording *r = self->recording;
    size_t bins = r->band + 1, n = r->block.samples;
    double *shape = self->work + 6 * n, *nothing = shape + 2 * bins;
    bool reference = self->channels == 2;
    self->allowance_count = 0;
    allow(self, self->between, self->between + 2 * bins);
    memset(nothing, 0, 2 * bins * sizeof *nothing);
    evidence_transform(self, r->block.torque, shape);
    differentiate(bins, n, reference ? together : apart, 1, shape);
    allow(self, reference ? nothing : shape, reference ? shape : nothing);
    for (size_t order = 3; r->derived && order <= 8; order++) {
        evidence_transform(self, r->block.velocity, shape);
        differentiate(bins, n, self->scale_inertia * r->rate_hz / (order <= 4 ? 12.0 : 120.0), order, shape);
        allow(self, shape, nothing);
    }
}

/// Residual signals of every row of a periodic run: the periods and what leads into them.
static double *residuals_of_all(const struct evidence *self, const struct sim_model *model)
{
    size_t rows = self->recording->all.samples;
    double *both = malloc(2 * rows * sizeof *both);
    if (both)
        predict(model, &self->recording->all, false, self->scale_inertia, both, both + rows);
    return both;
}

/// Spectra of the periods' residuals less their mean, which comes after them.
static void deviations_of_periods(const struct evidence *self, const double *both, double *spectra)
{
    const struct recording *r = self->recording;
    size_t bins = r->band + 1, rows = r->all.samples, P = r->periods;
    double *mean = spectra + P * 4 * bins;
    memset(mean, 0, 4 * bins * sizeof *mean);
    for (size_t p = 0; p < P; p++) {
        double *m = spectra + p * 4 * bins;
        evidence_transform(self, both + r->starts[p], m);
        evidence_transform(self, both + rows + r->starts[p], m + 2 * bins);
        for (size_t i = 0; i < 4 * bins; i++)
            mean[i] += m[i] / (double)P;
    }
    for (size_t p = 0; p < P; p++)
        for (size_t i = 0; i < 4 * bins; i++)
            spectra[p * 4 * bins + i] -= mean[i];
}

/// Covariance of the mean of the periods, bin by bin, from their deviations.
static void scatter_of_periods(const struct evidence *self, const double *spectra, double *raw)
{
    size_t bins = self->recording->band + 1, P = self->recording->periods;
    memset(raw, 0, 4 * bins * sizeof *raw);
    for (size_t p = 0; p < P; p++) {
        const double *m = spectra + p * 4 * bins;
        for (size_t k = 0; k < bins; k++)
            accumulate(raw + 4 * k, m + 2 * k, self->channels == 2 ? m + 2 * bins + 2 * k : NULL,
                       1.0 / ((double)P * (double)(P - 1)));
    }
}

/// Whitening by that scatter. What changes slowly over the run, where self->slow says that something does, is no
/// noise: its courses are taken out of the scatter first, which becomes that of fewer periods.
static bool whitening_of_periods(struct evidence *self, const double *spectra, const double *raw)
{
    size_t bins = self->recording->band + 1, P = self->recording->periods;
    double *quiet = malloc((4 * bins + slow_orders_most * P) * sizeof *quiet);
    if (!quiet)
        return false;
    double *courses = quiet + 4 * bins;
    slow_courses(P, courses);
    memcpy(quiet, raw, 4 * bins * sizeof *quiet);
    for (size_t k = 0; k < bins; k++) {
        for (size_t q = 0; q < self->slow[k]; q++) {
            double m[2], a[2];
            slow_along(spectra + 2 * k, 4 * bins, P, courses + q * P, m);
            slow_along(spectra + 2 * bins + 2 * k, 4 * bins, P, courses + q * P, a);
            accumulate(quiet + 4 * k, m, self->channels == 2 ? a : NULL, -1.0 / ((double)P * (double)(P - 1)));
        }
        for (size_t j = 0; j < 4; j++)
            quiet[4 * k + j] *= (double)(P - 1) / (double)(P - 1 - self->slow[k]);
    }
    smooth(self, quiet);
    factorise(self);
    free(quiet);
    return true;
}

/// Finds the bins in which something changes slowly, against a whitening that knows nothing of it, and whitens again.
static bool noise_beside_slow_changes(struct evidence *self, const double *spectra, const double *raw)
{
    size_t bins = self->recording->band + 1;
    memset(self->slow, 0, bins * sizeof *self->slow);
    if (!whitening_of_periods(self, spectra, raw))
        return false;
    return !slow_find(self, spectra, 4 * bins, self->slow) || whitening_of_periods(self, spectra, raw);
}

/// Sum over all periods of the squares of what differs between them, whitened by the noise of one period.
/// Equation:  sum_k 2 (P - 1) tr(C_k^-1 raw_k),  raw_k the bin's own covariance before the mean over neighbours
static double whitened_scatter(const struct evidence *self, const double *raw)
{
    double sum = 0.0, free_periods = (double)self->recording->periods - 1.0;
    sum += raw[0] / fmax(self->covariance[0], 1e-300);
    for (size_t k = 1; k <= self->recording->band; k++) {
        const double *c = self->covariance + 4 * k, *q = raw + 4 * k;
        double determinant = c[0] * c[1] - c[2] * c[2] - c[3] * c[3];
        if (self->channels == 1)
            sum += 2.0 * q[0] / fmax(c[0], 1e-300);
        else
            sum += 2.0 * (c[1] * q[0] + c[0] * q[1] - 2.0 * (c[2] * q[2] + c[3] * q[3])) / fmax(determinant, 1e-300);
    }
    return free_periods * (sum + (double)self->kinematics.values);
}

bool evidence_renew_noise(struct evidence *self, const struct sim_model *model)
{
    const struct recording *r = self->recording;
    size_t bins = r->band + 1;
    double *both = r->periodic ? residuals_of_all(self, model) : NULL;
    double *spectra = malloc((r->periods + 1) * 4 * bins * sizeof *spectra), *raw = calloc(4 * bins, sizeof *raw);
    bool good = both && spectra && raw;
    if (good) {
        deviations_of_periods(self, both, spectra);
        scatter_of_periods(self, spectra, raw);
        good = whitening_of_periods(self, spectra, raw);
    }
    if (good) {
        self->scatter = whitened_scatter(self, raw);
        make_allowances(self);
    }
    free(both);
    free(spectra);
    free(raw);
    return good;
}

/// Where motion is not the same in every period and forces are no straight line of it (a reversal, a gap), the mean of
/// the periods' forces is not the force of their mean motion. It is theirs as far as the motion differed, and the
/// mean's as far as it was only measured to: half of the difference is taken, and the other half is allowed for.
static bool compare_means(struct evidence *self, const struct sim_model *model, const double *mean)
{
    size_t n = self->recording->block.samples, bins = self->recording->band + 1;
    double *both = malloc(2 * n * sizeof *both);
    bool good = both && evidence_signals(self, model, both, both + n);
    if (good) {
        evidence_transform(self, both, self->between);
        evidence_transform(self, both + n, self->between + 2 * bins);
        for (size_t i = 0; i < 4 * bins; i++)
            self->between[i] = 0.5 * (mean[i] - self->between[i]);
    }
    free(both);
    return good;
}

/// What the periods of a run have in common is its block, what they do not is noise or an effect that depends on time.
static bool noise_from_periods(struct evidence *self, const struct sim_model *model, double *raw)
{
    const struct recording *r = self->recording;
    size_t stride = 4 * (r->band + 1);
    double *both = residuals_of_all(self, model);
    double *spectra = malloc((r->periods + 1) * stride * sizeof *spectra);
    bool good = both && spectra;
    if (good) {
        deviations_of_periods(self, both, spectra);
        scatter_of_periods(self, spectra, raw);
        good = noise_beside_slow_changes(self, spectra, raw);
    }
    if (good) {
        self->scatter = whitened_scatter(self, raw);
        good = contrast_take(self, model, spectra, stride) && contrast_find_tones(self, both) &&
               compare_means(self, model, spectra + r->periods * stride);
    }
    free(both);
    free(spectra);
    return good;
}

static bool noise_from_residual(struct evidence *self, const struct sim_model *model, double *raw)
{
    const struct recording *r = self->recording;
    size_t n = r->block.samples, bins = r->band + 1;
    double *both = malloc((2 * n + 4 * bins) * sizeof *both);
    if (!both)
        return false;
    predict(model, &r->block, false, self->scale_inertia, both, both + n);
    double *m = both + 2 * n;
    evidence_transform(self, both, m);
    evidence_transform(self, both + n, m + 2 * bins);
    for (size_t k = 0; k < bins; k++)
        accumulate(raw + 4 * k, m + 2 * k, self->channels == 2 ? m + 2 * bins + 2 * k : NULL, 1.0);
    smooth(self, raw);
    factorise(self);
    bool good = contrast_find_tones(self, both);
    free(both);
    return good;
}

static bool estimate(struct evidence *self, const struct sim_model *model)
{
    double *raw = calloc(4 * (self->recording->band + 1), sizeof *raw);
    bool good = raw && (self->recording->periodic ? noise_from_periods(self, model, raw)
                                                  : noise_from_residual(self, model, raw));
    free(raw);
    if (!good || !kinematics_estimate_noise(self, model))
        return false;
    make_allowances(self);
    return true;
}

/// Whether two models have the same effects in time at the same phases, or nearly.
static bool same_phases(const struct sim_model *a, const struct sim_model *b)
{
    const double near = 0.01;
    for (size_t e = 0; sim_effects[e]; e++)
        for (size_t i = 0; a->effect_on[e] && sim_effects[e]->in_time && i < sim_effects[e]->parameter_count; i++)
            if (sim_effects[e]->parameters[i].kind == sim_parameter_phase &&
                fabs(remainder(a->effect_parameters[e][i] - b->effect_parameters[e][i], 2.0 * pi)) > near)
                return false;
    return true;
}

bool evidence_estimate_noise(struct evidence *self, const struct sim_model *model)
{
    if (!self->phase_free || !contrast_concerns(model))
        return estimate(self, model);
    struct sim_model aligned = *model, before;
    // The phase is found in contrasts, and those under a model that knows nothing of it.
    for (size_t e = 0; sim_effects[e]; e++)
        aligned.effect_on[e] = aligned.effect_on[e] && !sim_effects[e]->in_time;
    if (!estimate(self, &aligned) || !contrast_align(self, model, &aligned))
        return false;
    // A belt answers to what the model misses, which contrasts do not know: once more under the one that misses less.
    for (int pass = 0; pass < 4; pass++) {
        before = aligned;
        if (!estimate(self, &before) || !contrast_align(self, model, &aligned))
            return false;
        if (same_phases(&before, &aligned))
            return true;
    }
    return estimate(self, &aligned);
}

bool evidence_sharpen_noise(struct evidence *self, const double *whitened)
{
    if (self->recording->periodic)
        return true;
    size_t bins = self->recording->band + 1;
    double *raw = calloc(4 * bins, sizeof *raw);
    if (!raw)
        return false;
    double *all = malloc(self->values * sizeof *all);
    if (!all) {
        free(raw);
        return false;
    }
    memcpy(all, whitened, self->values * sizeof *all);
    undo_allowances(self, all);
    const double *w = all + 1; // bin 0 borrows from its neighbours
    for (size_t k = 1; k < bins; k++) {
        const double *f = self->factor + 4 * k;
        double m[2] = {w[0] / f[0], w[1] / f[0]}, a[2] = {0.0, 0.0};
        if (self->channels == 2) {
            a[0] = (w[2] - f[2] * m[0] + f[3] * m[1]) / f[1];
            a[1] = (w[3] - f[2] * m[1] - f[3] * m[0]) / f[1];
        }
        accumulate(raw + 4 * k, m, self->channels == 2 ? a : NULL, 1.0);
        w += 2 * self->channels;
    }
    free(all);
    smooth(self, raw);
    factorise(self);
    make_allowances(self);
    free(raw);
    return true;
}

static void whiten_with(const struct evidence *self, const double *mechanics, const double *actuator,
                        const double *added, double *out_whitened)
{
    const struct recording *r = self->recording;
    size_t bins = r->band + 1, n = r->block.samples;
    double *m = self->work + 6 * n, *a = m + 2 * bins;
    evidence_transform(self, mechanics, m);
    if (actuator && self->channels == 2)
        evidence_transform(self, actuator, a);
    else
        memset(a, 0, 2 * bins * sizeof *a);
    for (size_t i = 0; added && i < 2 * bins; i++) {
        m[i] += added[i];
        a[i] += added[2 * bins + i];
    }
    whiten_spectra(self, m, a, out_whitened);
    apply_allowances(self, out_whitened);
}

void evidence_whiten(const struct evidence *self, const double *mechanics, const double *actuator, double *out_whitened)
{
    whiten_with(self, mechanics, actuator, NULL, out_whitened);
}

/// Not a number everywhere: whoever sums squares finds out.
static void fail(size_t count, double *out)
{
    for (size_t i = 0; i < count; i++)
        out[i] = NAN;
}

/// The mean of periods that were clipped one by one is not the clipped mean of the periods, from which noise is gone:
/// adds what is between them.
static bool add_clipped(const struct evidence *self, const struct sim_model *model, double *io_mechanics,
                        double *io_actuator)
{
    const struct recording *r = self->recording;
    size_t n = r->block.samples, rows = r->all.samples;
    if (!r->periodic || !io_actuator || !predict_limits(model))
        return true;
    double *each = malloc(2 * (rows + n) * sizeof *each);
    if (!each)
        return false;
    double *mean = each + 2 * rows;
    predict_limited(model, &r->all, false, self->scale_inertia, each, each + rows);
    predict_limited(model, &r->block, true, self->scale_inertia, mean, mean + n);
    for (size_t i = 0; i < n; i++) {
        io_mechanics[i] -= mean[i];
        io_actuator[i] -= mean[n + i];
        for (size_t p = 0; p < r->periods; p++) {
            io_mechanics[i] += each[r->starts[p] + i] / (double)r->periods;
            io_actuator[i] += each[rows + r->starts[p] + i] / (double)r->periods;
        }
    }
    free(each);
    return true;
}

/// The same and the contrasts.
static bool signals(const struct evidence *self, const struct sim_model *model, double *out_mechanics,
                    double *out_actuator, double *out_contrasts)
{
    const struct recording *r = self->recording;
    bool in_time = self->contrast.values > 0 && contrast_concerns(model);
    if (!in_time) {
        predict(model, &r->block, r->periodic, self->scale_inertia, out_mechanics, out_actuator);
        return add_clipped(self, model, out_mechanics, out_actuator);
    }
    struct sim_model aligned;
    double *mean = malloc(r->block.samples * sizeof *mean);
    bool good = mean && contrast_align(self, model, &aligned) && contrast_residual(self, &aligned, out_contrasts, mean);
    if (good) {
        predict(&aligned, &r->block, r->periodic, self->scale_inertia, out_mechanics, out_actuator);
        for (size_t i = 0; i < r->block.samples; i++)
            out_mechanics[i] += mean[i];
        good = add_clipped(self, &aligned, out_mechanics, out_actuator);
    }
    free(mean);
    return good;
}

bool evidence_signals(const struct evidence *self, const struct sim_model *model, double *out_mechanics,
                      double *out_actuator)
{
    return signals(self, model, out_mechanics, out_actuator, NULL);
}

void evidence_residual(const struct evidence *self, const struct sim_model *model, double *out_whitened,
                       double *out_contrasts)
{
    size_t n = self->recording->block.samples;
    double *mechanics = self->work + 4 * n;
    double *actuator = self->channels == 2 ? mechanics + n : NULL;
    bool good = signals(self, model, mechanics, actuator, out_contrasts);
    if (good)
        whiten_with(self, mechanics, actuator, self->between, out_whitened);
    if (!good || !kinematics_residual(self, model, out_whitened + self->values - self->kinematics.values))
        fail(self->values, out_whitened);
}

size_t evidence_bin(const struct evidence *self, size_t i, size_t *out_channel)
{
    size_t width = 2 * self->channels, torques = self->values - self->kinematics.values;
    if (i >= torques) {
        *out_channel = 2;
        return 1 + (i - torques) / 2;
    }
    *out_channel = i == 0 ? 0 : (i - 1) % width / 2;
    return i == 0 ? 0 : 1 + (i - 1) / width;
}
