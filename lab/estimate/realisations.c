/* SPDX-License-Identifier: MIT */
#include "lab/estimate/realisations.h"

#include "lab/estimate/method.h"
#include "lab/numeric/cmplx.h"
#include "lab/numeric/statistics.h"

#include <complex.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { fewest_lines = 3 };

/// Noise of two recordings does not make them differ by so little of it on half of all lines.
static const double same_recording = 0.01;
/// Below this share of the response it is rounding that differs, not noise.
static const double rounding = 1e-9;

static double root_mean_power(const struct frf *runs, size_t count, size_t line, bool odd)
{
    double sum = 0.0;
    for (size_t r = 0; r < count; r++) {
        const double level = (odd ? runs[r].odd_distortion : runs[r].even_distortion)[line];
        if (!frf_known(level)) {
            return FRF_UNKNOWN;
        }
        sum += level * level / (double)count;
    }
    return sqrt(sum);
}

static double root_sum_square(double before, double value, double weight)
{
    return frf_known(before) && frf_known(value) ? hypot(before, weight * value) : FRF_UNKNOWN;
}

static double mean_coherence(const struct frf *runs, const double *weights, size_t count, size_t line)
{
    double sum = 0.0;
    for (size_t r = 0; r < count; r++) {
        if (!runs[r].coherence || !frf_known(runs[r].coherence[line])) {
            return FRF_UNKNOWN;
        }
        sum += weights[r] * runs[r].coherence[line];
    }
    return sum;
}

static void pool_line(const struct frf *runs, const double *weights, size_t count, size_t line, struct frf *io_frf)
{
    double complex mean = 0.0;
    double std = 0.0;
    double noise_std = 0.0;
    bool valid = true;
    for (size_t r = 0; r < count; r++) {
        mean += weights[r] * CMPLX(runs[r].real[line], runs[r].imag[line]);
        std = root_sum_square(std, runs[r].std[line], weights[r]);
        noise_std = root_sum_square(noise_std, runs[r].noise_std[line], weights[r]);
        valid = valid && runs[r].valid[line];
    }
    if (valid) {
        estimate_set_line(io_frf, line, mean, std);
        io_frf->noise_std[line] = noise_std;
        io_frf->coherence[line] = mean_coherence(runs, weights, count, line);
        io_frf->odd_distortion[line] = root_mean_power(runs, count, line, true);
        io_frf->even_distortion[line] = root_mean_power(runs, count, line, false);
    }
}

/// Pools runs of one excitation, weighed by their periods (alike where there are none).
/// Equation:  G = sum q_r G_r,  std^2 = sum q_r^2 std_r^2, noise_std alike;  q_r = periods_r / sum periods
///            distortion levels: root of their mean power
/// Validity:  a line is valid if it is in every run; degrees of freedom: the sum of all runs'
/// Keys:      what all runs say alike, sample_rate_hz as their mean, `runs`
/// Errors:    as estimate_average()
static int pool_runs(const struct frf *runs, size_t count, struct frf *out_frf, struct error *out_error)
{
    *out_frf = (struct frf){.count = 0};
    double *weights = malloc(count * sizeof *weights);
    int status = weights ? 0 : estimate_refuse_memory(out_frf, out_error);
    status = status ? status : estimate_begin_common(runs, count, out_frf, out_error);
    double total = 0.0;
    for (size_t r = 0; r < count && !status; r++) {
        out_frf->degrees_of_freedom += runs[r].degrees_of_freedom;
        weights[r] = runs[r].periods > 0 ? (double)runs[r].periods : 1.0;
        total += weights[r];
    }
    for (size_t r = 0; r < count && !status; r++) {
        weights[r] /= total;
    }
    for (size_t line = 0; !status && line < out_frf->count; line++) {
        pool_line(runs, weights, count, line, out_frf);
    }
    if (!status && !(estimate_set_confidence(out_frf) && estimate_set_key(out_frf, "runs", "%zu", count))) {
        status = estimate_refuse_memory(out_frf, out_error);
    }
    free(weights);
    return status;
}

/// Median over the lines of |G_a - G_b| over its standard deviation; NaN with too few lines that have one.
static double difference_of(const struct frf *a, const struct frf *b, double *scratch)
{
    size_t count = 0;
    for (size_t line = 0; line < a->count && a->count == b->count; line++) {
        const double noise = hypot(a->noise_std[line], b->noise_std[line]);
        const double magnitude = hypot(a->real[line], a->imag[line]);
        if (a->valid[line] && b->valid[line] && frf_known(a->noise_std[line]) && noise > rounding * magnitude) {
            scratch[count++] = hypot(a->real[line] - b->real[line], a->imag[line] - b->imag[line]) / noise;
        }
    }
    return count >= fewest_lines ? statistics_median(scratch, count) : NAN;
}

static int check_copies(const struct frf *runs, size_t count, struct error *out_error)
{
    double *scratch = malloc((runs[0].count + 1) * sizeof *scratch);
    int status = scratch ? 0 : error_set(out_error, error_refused, "memory is short");
    for (size_t r = 1; r < count && !status; r++) {
        for (size_t earlier = 0; earlier < r && !status; earlier++) {
            const double difference = runs[r].count == runs[0].count && runs[earlier].count == runs[0].count
                                          ? difference_of(&runs[earlier], &runs[r], scratch)
                                          : NAN;
            if (difference < same_recording) {
                status = error_set(out_error, error_refused,
                                   "run %zu is run %zu again: their responses differ by %.2g of their noise (median "
                                   "over lines), which recordings of their own would by about 1: expected each "
                                   "recording once",
                                   r + 1, earlier + 1, difference);
            }
        }
    }
    free(scratch);
    return status;
}

/// Which runs are of one excitation.
struct groups {
    size_t count;
    size_t *of_run;    ///< group of each run
    size_t first_same; ///< a run that is like an earlier one; 0: none
    size_t like;       ///< that one
    size_t first_other_level, other_level_like;
    double level;
};

static int compare_runs(const struct excitations *excitations, size_t r, struct groups *io, struct error *out_error)
{
    io->of_run[r] = io->count;
    for (size_t earlier = 0; earlier < r; earlier++) {
        enum excitation_match match;
        double level;
        if (!excitations_compare(&excitations[earlier], &excitations[r], &match, &level)) {
            return error_set(out_error, error_refused, "memory is short");
        }
        if (match == excitation_other_level && io->first_other_level == 0) {
            io->first_other_level = r;
            io->other_level_like = earlier;
            io->level = level;
        }
        if (match == excitation_same) {
            io->first_same = io->first_same > 0 ? io->first_same : r;
            io->like = io->first_same == r ? earlier : io->like;
            io->of_run[r] = io->of_run[earlier];
            return 0;
        }
    }
    io->count++;
    return 0;
}

/// One response for each group.
static int pool_groups(const struct frf *runs, size_t count, const struct groups *groups, struct frf *out_responses,
                       struct agreement *out_within, struct error *out_error)
{
    struct frf *members = malloc(count * sizeof *members);
    int status = members ? 0 : error_set(out_error, error_refused, "memory is short");
    for (size_t g = 0; g < groups->count && !status; g++) {
        struct agreement within;
        size_t size = 0;
        for (size_t r = 0; r < count; r++) {
            if (groups->of_run[r] == g) {
                members[size++] = runs[r];
            }
        }
        status = pool_runs(members, size, &out_responses[g], out_error);
        if (!status && size > 1 && !agreement_measure(members, size, &within)) {
            status = error_set(out_error, error_refused, "memory is short");
        } else if (!status && size > 1 && (out_within->lines == 0 || within.chance < out_within->chance)) {
            *out_within = within;
        }
    }
    free(members);
    return status;
}

static bool say_pooled(const struct groups *groups, size_t count, const struct agreement *within, struct frf *io_frf)
{
    char rest[240] = "";
    if (groups->count == 1) {
        snprintf(rest, sizeof rest,
                 "; std holds no nonlinear distortion, which only runs with other phases (design --seed) show");
    }
    if (agreement_differs(within)) {
        const size_t used = strlen(rest);
        snprintf(rest + used, sizeof rest - used,
                 "; they differ by %.3g times their noise (median), so that the drive has changed between them and std "
                 "is too small",
                 within->ratio);
    }
    return estimate_set_key(io_frf, "warning_realisations",
                            "runs %zu and %zu have the same excitation, and runs of the same excitation count as more "
                            "periods of one realisation: %zu runs are %zu realisation%s%s",
                            groups->like + 1, groups->first_same + 1, count, groups->count,
                            groups->count > 1 ? "s" : "", rest);
}

static bool say_other_level(const struct groups *groups, struct frf *io_frf)
{
    return estimate_set_key(io_frf, "warning_realisations",
                            "runs %zu and %zu have the same phases, at %.3g times the level: their difference shows "
                            "what depends on the level; for the distortion of other phases std does not hold",
                            groups->other_level_like + 1, groups->first_other_level + 1, groups->level);
}

static int average_groups(const struct groups *groups, const struct frf *responses, size_t count,
                          const struct agreement *within, struct frf *out_frf, struct agreement *out_agreement,
                          struct error *out_error)
{
    int status = groups->count > 1 ? estimate_average(responses, groups->count, out_frf, out_error)
                                   : pool_runs(responses, 1, out_frf, out_error);
    if (status) {
        return status;
    }
    bool done = groups->count == 1 || agreement_measure(responses, groups->count, out_agreement);
    done = done && estimate_set_key(out_frf, "realisations", "%zu", groups->count) &&
           estimate_set_key(out_frf, "runs", "%zu", count);
    if (done && groups->first_same > 0) {
        done = say_pooled(groups, count, within, out_frf);
    } else if (done && groups->first_other_level > 0) {
        done = say_other_level(groups, out_frf);
    }
    return done ? 0 : estimate_refuse_memory(out_frf, out_error);
}

int realisations_combine(const struct frf *runs, const struct excitations *excitations, size_t count,
                         struct frf *out_frf, struct agreement *out_agreement, struct error *out_error)
{
    struct groups groups = {.of_run = malloc(count * sizeof *groups.of_run)};
    struct frf *responses = calloc(count, sizeof *responses);
    struct agreement within = {.chance = 1.0};
    *out_frf = (struct frf){.count = 0};
    *out_agreement = (struct agreement){.realisations = 1, .chance = 1.0, .ratio = NAN, .level = NAN};
    int status = groups.of_run && responses ? 0 : error_set(out_error, error_refused, "memory is short");
    status = status ? status : check_copies(runs, count, out_error);
    for (size_t r = 0; r < count && !status; r++) {
        status = compare_runs(excitations, r, &groups, out_error);
    }
    status = status ? status : pool_groups(runs, count, &groups, responses, &within, out_error);
    if (!status) {
        status = average_groups(&groups, responses, count, &within, out_frf, out_agreement, out_error);
    }
    for (size_t g = 0; g < count && responses; g++) {
        frf_free(&responses[g]);
    }
    free(responses);
    free(groups.of_run);
    return status;
}
