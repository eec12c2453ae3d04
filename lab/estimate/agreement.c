/* SPDX-License-Identifier: MIT */
#include "lab/estimate/agreement.h"

#include "lab/numeric/cmplx.h"
#include "lab/numeric/statistics.h"

#include <complex.h>
#include <math.h>
#include <stdlib.h>

static const double chance_of_line = 0.05;
static const double chance_of_false_alarm = 1e-3;
/// Logarithms of smaller chances are not told apart.
static const double smallest_chance = 1e-300;
/// Rounding of a response: noise cannot be less than this share of it.
static const double rounding = 1e-14;

struct line {
    double magnitude;
    double between; ///< s^2
    double noise;   ///< s_n^2
};

/// False if the line is not valid everywhere.
static bool take_line(const struct frf *realisations, size_t count, size_t line, struct line *out)
{
    double complex mean = 0.0;
    *out = (struct line){0};
    for (size_t r = 0; r < count; r++) {
        const struct frf *one = &realisations[r];
        if (!one->valid[line] || !frf_known(one->noise_std[line])) {
            return false;
        }
        mean += CMPLX(one->real[line], one->imag[line]) / (double)count;
        out->noise += one->noise_std[line] * one->noise_std[line] / (double)count;
    }
    for (size_t r = 0; r < count; r++) {
        const double complex deviation = CMPLX(realisations[r].real[line], realisations[r].imag[line]) - mean;
        out->between += creal(deviation) * creal(deviation) + cimag(deviation) * cimag(deviation);
    }
    out->between /= (double)(count - 1);
    out->magnitude = cabs(mean);
    out->noise += rounding * rounding * out->magnitude * out->magnitude;
    return out->noise > 0.0;
}

static double degrees_of_noise(const struct frf *realisations, size_t count)
{
    double sum = 0.0;
    for (size_t r = 0; r < count; r++) {
        sum += realisations[r].degrees_of_freedom;
    }
    return sum;
}

bool agreement_measure(const struct frf *realisations, size_t count, struct agreement *out)
{
    *out = (struct agreement){.realisations = count, .chance = 1.0, .ratio = NAN, .level = NAN};
    const double noise_dof = count > 1 ? degrees_of_noise(realisations, count) : 0.0;
    if (!(noise_dof > 0.0)) {
        return true;
    }
    double *ratios = malloc(2 * realisations[0].count * sizeof *ratios);
    double *levels = ratios ? ratios + realisations[0].count : NULL;
    double fisher = 0.0;
    for (size_t k = 0; ratios && k < realisations[0].count; k++) {
        struct line line;
        if (!take_line(realisations, count, k, &line)) {
            continue;
        }
        const double chance = statistics_f_tail(line.between / line.noise, 2.0 * (double)(count - 1), noise_dof);
        fisher -= 2.0 * log(fmax(chance, smallest_chance));
        out->lines_beyond += chance < chance_of_line;
        ratios[out->lines] = sqrt(line.between / line.noise);
        levels[out->lines++] = line.magnitude > 0.0 ? sqrt(fmax(line.between - line.noise, 0.0)) / line.magnitude : 0.0;
    }
    if (ratios && out->lines > 0) {
        out->chance = statistics_chi2_tail(fisher, 2.0 * (double)out->lines);
        out->ratio = statistics_median(ratios, out->lines);
        out->level = statistics_median(levels, out->lines);
    }
    free(ratios);
    return ratios != NULL;
}

bool agreement_differs(const struct agreement *self)
{
    return self->chance < chance_of_false_alarm;
}
