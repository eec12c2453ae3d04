/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/validate.h"

#include "lab/numeric/fft.h"
#include "sim/plant.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/// From torque on the given model's whole inertia, which residuals are in, to torque on this model's motor.
static double motor_share(const struct evidence *e, const struct sim_model *model)
{
    double moved = model->motor_inertia_kgm2;
    if (model->structure == sim_structure_rigid)
        moved += model->load_inertia_kgm2;
    return moved / e->scale_inertia;
}

/// Spectra of one model's residuals and of the measured torque; each 2 (band + 1) values.
struct spectra {
    double *mechanics, *actuator, *torque;
    double *signals; ///< mechanics and actuator residuals in time, block length each
};

static bool spectra_of(const struct evidence *e, const struct sim_model *model, struct spectra *out)
{
    const struct recording *r = e->recording;
    size_t n = r->block.samples, bins = r->band + 1;
    out->signals = malloc((2 * n + 6 * bins) * sizeof(double));
    if (!out->signals)
        return false;
    out->mechanics = out->signals + 2 * n;
    out->actuator = out->mechanics + 2 * bins;
    out->torque = out->actuator + 2 * bins;
    if (!evidence_signals(e, model, out->signals, out->signals + n)) {
        free(out->signals);
        return false;
    }
    double share = motor_share(e, model);
    for (size_t i = 0; i < n; i++)
        out->signals[i] *= share;
    evidence_transform(e, out->signals, out->mechanics);
    evidence_transform(e, out->signals + n, out->actuator);
    evidence_transform(e, r->block.torque, out->torque);
    return true;
}

static double square(double re, double im)
{
    return re * re + im * im;
}

/// Squared error of a model at one bin.
static double error_at(const struct evidence *e, const struct spectra *s, size_t k)
{
    const double *m = s->mechanics + 2 * k, *a = s->actuator + 2 * k;
    if (e->channels == 1)
        return square(m[0], m[1]);
    return square(a[0] - m[0], a[1] - m[1]) + square(a[0], a[1]);
}

static double sum_of_squares(size_t n, const double *values)
{
    double sum = 0.0;
    for (size_t i = 0; i < n; i++)
        sum += values[i] * values[i];
    return sum;
}

/// Whitened mean squares: of the mean of the periods, and of all periods.
static bool whitened_mean_squares(const struct fit_data *data, const struct sim_model *model, double *out_of_mean,
                                  double *out_of_all)
{
    double *residual = malloc((data->values + data->contrasts) * sizeof *residual), count = 0.0;
    if (!residual)
        return false;
    size_t rows = fit_residual(data, model, residual);
    double of_mean = sum_of_squares(data->values, residual), differing = 0.0;
    for (size_t i = 0; i < data->runs; i++) {
        const struct evidence *e = &data->evidence[i];
        count += (double)e->recording->periods * (double)e->values;
        differing += e->scatter;
        if (data->contrasts > 0)
            differing += (rows > data->values ? 0.0 : e->contrast.without) - e->contrast.reference;
    }
    if (rows > data->values)
        differing += sum_of_squares(rows - data->values, residual + data->values);
    free(residual);
    *out_of_mean = of_mean / (double)data->values;
    *out_of_all = (of_mean + differing) / count;
    return true;
}

double validate_mean_rms_chance(const struct fit_data *data)
{
    const double once_in_twenty = 1.645;
    double variance = 0.0;
    for (size_t i = 0; i < data->runs; i++) {
        const struct evidence *e = &data->evidence[i];
        double periods = (double)e->recording->periods, estimated = periods > 1.0 ? periods / (periods - 1.0) : 1.0;
        variance += 2.0 * estimated * (double)e->values;
    }
    return sqrt(1.0 + once_in_twenty * sqrt(variance) / (double)data->values);
}

struct diagnosis_figures validate_figures(const struct fit_data *data, const struct sim_model *model)
{
    struct diagnosis_figures figures = {NAN, NAN, NAN};
    double error = 0.0, torque = 0.0, of_mean, of_all;
    if (!whitened_mean_squares(data, model, &of_mean, &of_all))
        return figures;
    for (size_t i = 0; i < data->runs; i++) {
        const struct evidence *e = &data->evidence[i];
        struct spectra s;
        if (!spectra_of(e, model, &s))
            return figures;
        error += 0.5 * error_at(e, &s, 0); // the constant part is real: half of what a line of its size is
        for (size_t j = 0; j < e->recording->bin_count; j++) {
            size_t k = e->recording->bins[j];
            error += error_at(e, &s, k);
            torque += square(s.torque[2 * k], s.torque[2 * k + 1]);
        }
        free(s.signals);
    }
    figures.validation_nrmse = sqrt(error / torque);
    figures.whitened_rms = sqrt(of_all);
    figures.mean_rms = sqrt(of_mean);
    return figures;
}

static double floor_at(const struct evidence *e, double share, size_t k)
{
    const double *c = e->covariance + 4 * k;
    double mechanics = share * share * c[0];
    if (e->channels == 1)
        return mechanics;
    return 2.0 * c[1] + mechanics - 2.0 * share * c[2];
}

double validate_noise_floor(const struct fit_data *data, const struct sim_model *model)
{
    double floor = 0.0, torque = 0.0;
    for (size_t i = 0; i < data->runs; i++) {
        const struct evidence *e = &data->evidence[i];
        const struct recording *r = e->recording;
        struct spectra s;
        if (!spectra_of(e, model, &s))
            return NAN;
        double share = motor_share(e, model), above = 0.0;
        size_t highest = r->bins[r->bin_count - 1], count = 0;
        for (size_t k = highest + 1; k <= r->band; k++, count++)
            above += floor_at(e, share, k);
        floor += 0.5 * floor_at(e, share, 0);
        for (size_t j = 0; j < r->bin_count; j++) {
            size_t k = r->bins[j];
            floor += r->periodic || count == 0 ? floor_at(e, share, k) : above / (double)count;
            torque += square(s.torque[2 * k], s.torque[2 * k + 1]);
        }
        free(s.signals);
    }
    return sqrt(floor / torque);
}

/// The part of a signal of the block within the band, back in time.
static bool band_limited(const struct evidence *e, const double *spectrum, double *out_signal)
{
    const struct recording *r = e->recording;
    size_t n = r->block.samples;
    double *work = calloc(4 * n, sizeof *work);
    if (!work)
        return false;
    for (size_t k = 0; k <= r->band; k++) {
        work[2 * k] = spectrum[2 * k];
        work[2 * k + 1] = spectrum[2 * k + 1];
        if (k > 0) {
            work[2 * (n - k)] = spectrum[2 * k];
            work[2 * (n - k) + 1] = -spectrum[2 * k + 1];
        }
    }
    fft_inverse(e->plan, work, work + 2 * n);
    for (size_t i = 0; i < n; i++)
        out_signal[i] = work[2 * n + 2 * i];
    free(work);
    return true;
}

static double friction(const struct sim_model *model, double position, double velocity)
{
    struct sim_motion at = {.position = position, .velocity = velocity, .linear = model->linear};
    struct sim_opposing o;
    sim_plant_opposing(model, &at, &o);
    double sign = velocity > 0.0 ? 1.0 : velocity < 0.0 ? -1.0 : 0.0;
    double factor = velocity >= 0.0 ? o.positive_factor : o.negative_factor;
    return factor * (o.viscous + sign * o.dry);
}

static bool curves_allocate(struct diagnosis_curves *c, size_t bins, size_t samples)
{
    const size_t points = 161;
    c->bins = bins;
    c->samples = samples;
    c->curve_points = points;
    double **per_bin[] = {&c->frequency_hz, &c->torque_Nm,   &c->nominal_Nm,
                          &c->refitted_Nm,  &c->extended_Nm, &c->two_sigma_Nm};
    double **per_sample[] = {&c->time_s,           &c->position,         &c->velocity, &c->friction_measured,
                             &c->residual_nominal, &c->residual_extended};
    double **per_point[] = {&c->curve_velocity, &c->curve_nominal, &c->curve_extended};
    bool good = true;
    for (size_t i = 0; i < sizeof per_bin / sizeof per_bin[0]; i++)
        good = (*per_bin[i] = calloc(bins, sizeof(double))) && good;
    for (size_t i = 0; i < sizeof per_sample / sizeof per_sample[0]; i++)
        good = (*per_sample[i] = calloc(samples, sizeof(double))) && good;
    for (size_t i = 0; i < sizeof per_point / sizeof per_point[0]; i++)
        good = (*per_point[i] = calloc(points, sizeof(double))) && good;
    return good;
}

void validate_curves_free(struct diagnosis_curves *self)
{
    double *all[] = {self->frequency_hz,   self->torque_Nm,         self->nominal_Nm,       self->refitted_Nm,
                     self->extended_Nm,    self->two_sigma_Nm,      self->time_s,           self->position,
                     self->velocity,       self->friction_measured, self->residual_nominal, self->residual_extended,
                     self->curve_velocity, self->curve_nominal,     self->curve_extended};
    for (size_t i = 0; i < sizeof all / sizeof all[0]; i++)
        free(all[i]);
    memset(self, 0, sizeof *self);
}

/// One model's error per bin, and in time the torque it lacks: band-limited, mechanics only.
static bool model_error(const struct evidence *e, const struct sim_model *model, double *out_per_bin,
                        double *out_in_time)
{
    struct spectra s;
    if (!spectra_of(e, model, &s))
        return false;
    for (size_t k = 1; k <= e->recording->band; k++)
        out_per_bin[k - 1] = 2.0 * sqrt(error_at(e, &s, k)); // one-sided amplitude
    bool good = !out_in_time || band_limited(e, s.mechanics, out_in_time);
    free(s.signals);
    return good;
}

static void friction_curves(const struct recording *r, const struct diagnosis *models, struct diagnosis_curves *c)
{
    for (size_t i = 0; i < c->samples; i++) {
        c->time_s[i] = (double)i / r->rate_hz;
        c->position[i] = r->block.position[i];
        c->velocity[i] = r->block.velocity[i];
        c->friction_measured[i] =
            friction(&models->extended_model, c->position[i], c->velocity[i]) - c->residual_extended[i];
    }
    for (size_t i = 0; i < c->curve_points; i++) {
        double v = r->coverage.velocity_peak * (2.0 * (double)i / (double)(c->curve_points - 1) - 1.0);
        c->curve_velocity[i] = v;
        c->curve_nominal[i] = friction(&models->given, 0.0, v);
        c->curve_extended[i] = friction(&models->extended_model, 0.0, v);
    }
}

bool validate_curves(const struct fit_data *data, const struct diagnosis *models, struct diagnosis_curves *out_curves)
{
    const struct evidence *e = &data->evidence[0];
    const struct recording *r = e->recording;
    struct diagnosis_curves *c = out_curves;
    if (!curves_allocate(c, r->band, r->block.samples))
        return false;
    c->rate_hz = r->rate_hz;
    struct spectra s;
    if (!spectra_of(e, &models->extended_model, &s))
        return false;
    double share = motor_share(e, &models->extended_model);
    for (size_t k = 1; k <= r->band; k++) {
        c->frequency_hz[k - 1] = (double)k * r->rate_hz / (double)r->block.samples;
        c->torque_Nm[k - 1] = 2.0 * sqrt(square(s.torque[2 * k], s.torque[2 * k + 1]));
        c->two_sigma_Nm[k - 1] = 2.0 * 2.0 * sqrt(floor_at(e, share, k));
    }
    free(s.signals);
    bool good = model_error(e, &models->given, c->nominal_Nm, c->residual_nominal) &&
                model_error(e, &models->refitted_model, c->refitted_Nm, NULL) &&
                model_error(e, &models->extended_model, c->extended_Nm, c->residual_extended);
    if (good)
        friction_curves(r, models, c);
    return good;
}

double validate_share_left(double given, double left, double floor)
{
    double before = given * given - floor * floor, after = left * left - floor * floor;
    return fmin(fmax(after / fmax(before, 1e-12), 0.0), 1.0);
}
