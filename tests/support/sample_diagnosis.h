/* SPDX-License-Identifier: MIT */
/// A diagnosis filled by hand, with numbers as a real one has them: cogging and a Stribeck effect on a belt drive.
#ifndef SERVOSCOPE_TESTS_SUPPORT_SAMPLE_DIAGNOSIS_H
#define SERVOSCOPE_TESTS_SUPPORT_SAMPLE_DIAGNOSIS_H

#include "lab/diagnose/diagnosis.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { sample_samples = 4000, sample_bins = 400, sample_curve_points = 401 };

static const double sample_pi = 3.14159265358979324;

static inline double *sample_array(size_t count)
{
    double *values = calloc(count, sizeof *values);
    if (!values) {
        abort();
    }
    return values;
}

/// About normal, the same on every machine: twelve uniform numbers of a 64-bit congruential generator.
static inline double sample_normal(uint64_t *io_state)
{
    double sum = -6.0;
    for (int i = 0; i < 12; i++) {
        *io_state = *io_state * 6364136223846793005u + 1442695040888963407u;
        sum += (double)(*io_state >> 11) / 9007199254740992.0;
    }
    return sum;
}

static inline double sample_friction(double velocity, double stribeck)
{
    double sign = velocity > 0.0 ? 1.0 : velocity < 0.0 ? -1.0 : 0.0;
    return 0.003 * velocity + sign * (0.05 + stribeck * exp(-velocity * velocity));
}

static inline void sample_spectra(struct diagnosis_curves *c)
{
    uint64_t state = 1;
    c->bins = sample_bins;
    double **arrays[] = {&c->frequency_hz, &c->torque_Nm,   &c->nominal_Nm,
                         &c->refitted_Nm,  &c->extended_Nm, &c->two_sigma_Nm};
    for (size_t i = 0; i < sizeof arrays / sizeof arrays[0]; i++) {
        *arrays[i] = sample_array(c->bins);
    }
    for (size_t k = 0; k < c->bins; k++) {
        double f = 0.25 * (double)(k + 1), sigma = 0.0004;
        double noise = sigma * hypot(sample_normal(&state), sample_normal(&state)) / sqrt(2.0);
        c->frequency_hz[k] = f;
        c->two_sigma_Nm[k] = 2.0 * sigma;
        c->torque_Nm[k] = 0.02;
        c->extended_Nm[k] = noise;
        c->refitted_Nm[k] = noise + 0.012 / (1.0 + pow(f / 8.0, 2.0)) * (1.0 + 0.4 * sin((double)k));
        c->nominal_Nm[k] = c->refitted_Nm[k] + 0.002 * (1.0 + 0.3 * cos(3.0 * (double)k));
    }
}

static inline void sample_motion(struct diagnosis_curves *c)
{
    uint64_t state = 2;
    c->samples = sample_samples;
    c->rate_hz = 1000.0;
    double **arrays[] = {&c->time_s,           &c->position,         &c->velocity, &c->friction_measured,
                         &c->residual_nominal, &c->residual_extended};
    for (size_t i = 0; i < sizeof arrays / sizeof arrays[0]; i++) {
        *arrays[i] = sample_array(c->samples);
    }
    for (size_t n = 0; n < c->samples; n++) {
        double t = (double)n / c->rate_hz, noise = 0.004 * sample_normal(&state);
        double velocity = 6.0 * sin(2.0 * sample_pi * 0.5 * t) + 2.0 * sin(2.0 * sample_pi * 7.3 * t + 1.0);
        c->time_s[n] = t;
        c->velocity[n] = velocity;
        c->position[n] = -6.0 / sample_pi * cos(2.0 * sample_pi * 0.5 * t);
        c->friction_measured[n] = sample_friction(velocity, 0.03) + noise;
        c->residual_extended[n] = noise;
        c->residual_nominal[n] = noise + 0.03 * cos(12.0 * c->position[n]) + sample_friction(velocity, 0.03) -
                                 sample_friction(velocity, 0.0);
    }
    c->curve_points = sample_curve_points;
    c->curve_velocity = sample_array(c->curve_points);
    c->curve_nominal = sample_array(c->curve_points);
    c->curve_extended = sample_array(c->curve_points);
    for (size_t i = 0; i < c->curve_points; i++) {
        c->curve_velocity[i] = 8.0 * (2.0 * (double)i / (double)(c->curve_points - 1) - 1.0);
        c->curve_nominal[i] = sample_friction(c->curve_velocity[i], 0.0);
        c->curve_extended[i] = sample_friction(c->curve_velocity[i], 0.03);
    }
}

static inline void sample_cause(const char *id, double evidence, const double *values, const double *deviations,
                                bool linear, struct diagnosis_cause *out)
{
    memset(out, 0, sizeof *out);
    out->effect = sim_effect_find(id);
    out->evidence = evidence;
    memcpy(out->values, values, sizeof out->values);
    memcpy(out->deviations, deviations, sizeof out->deviations);
    const struct sim_finding finding = {out->values, out->deviations, out->nominal, linear};
    sim_effects[out->effect]->say(&finding, out->says, sizeof out->says);
}

/// Explained by two causes, with a tie and an effect that was not testable; diagnosis_free() it.
static inline void sample_diagnosis(bool linear, struct diagnosis *out)
{
    static const double cogging[sim_effect_parameters_max] = {0.0312, 0.41, 12.0};
    static const double cogging_std[sim_effect_parameters_max] = {0.00042, 0.013, 0.0};
    static const double stribeck[sim_effect_parameters_max] = {0.0297, 0.98};
    static const double stribeck_std[sim_effect_parameters_max] = {0.0011, 0.046};
    memset(out, 0, sizeof *out);
    out->verdict = diagnosis_explained;
    out->linear = linear;
    out->model_given = true;
    snprintf(out->runs, sizeof out->runs, "run1.csv");
    snprintf(out->motion_from, sizeof out->motion_from,
             "The speed column below 12.3 Hz and the position's derivative above it, without phase shift.");
    sim_model_default(&out->given);
    out->given.linear = linear;
    out->given.viscous_friction_Nms_per_rad = 0.003;
    out->given.coulomb_friction_Nm = 0.05;
    out->refitted_model = out->given;
    out->extended_model = out->given;
    out->cause_count = 2;
    sample_cause("cogging", 1234.5, cogging, cogging_std, linear, &out->causes[0]);
    sample_cause("stribeck_friction", 345.25, stribeck, stribeck_std, linear, &out->causes[1]);
    out->tie_count = 1;
    out->ties[0].effects[0] = sim_effect_find("load_bias");
    out->ties[0].effects[1] = sim_effect_find("asymmetric_friction");
    snprintf(out->ties[0].next, sizeof out->ties[0].next, "measure a run at half the level");
    out->untestable_count = 1;
    out->untestable[0].effect = sim_effect_find("belt_elasticity");
    snprintf(out->untestable[0].why, sizeof out->untestable[0].why,
             "resonances above 400 Hz do not show: the highest line is 100 Hz");
    out->nominal = (struct diagnosis_figures){0.2134, 4.1, 12.3};
    out->refitted = (struct diagnosis_figures){0.1822, 3.4, 10.2};
    out->extended = (struct diagnosis_figures){0.0502, 1.012, 1.031};
    out->noise_floor_nrmse = 0.0481;
    out->fit_misfit = 1.03;
    sample_spectra(&out->curves);
    sample_motion(&out->curves);
}

/// The same recordings with a rest that has no name.
static inline void sample_unexplained(struct diagnosis *out)
{
    sample_diagnosis(false, out);
    out->verdict = diagnosis_unexplained;
    out->candidates[0] = out->causes[1];
    out->candidate_count = 1;
    out->cause_count = 1;
    out->tie_count = 0;
    out->extended = (struct diagnosis_figures){0.112, 2.13, 5.72};
    out->unexplained_share = 0.31;
    out->rest_shape = -1;
    snprintf(out->where, sizeof out->where, "0.8..3 Hz, moving left, after 9 s");
}

/// Nothing wrong and, as from a caller who asked for no curves, nothing to draw.
static inline void sample_no_discrepancy(struct diagnosis *out)
{
    memset(out, 0, sizeof *out);
    out->verdict = diagnosis_no_discrepancy;
    out->model_given = true;
    out->held_back = true;
    snprintf(out->runs, sizeof out->runs, "run1.csv");
    sim_model_default(&out->given);
    out->nominal = (struct diagnosis_figures){0.0493, 1.02, 1.06};
    out->refitted = (struct diagnosis_figures){0.0484, 1.0, 1.003};
    out->extended = out->refitted;
    out->noise_floor_nrmse = 0.0481;
    out->fit_misfit = 1.0;
}

#endif
