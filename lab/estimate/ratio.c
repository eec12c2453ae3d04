/* SPDX-License-Identifier: MIT */
#include "lab/estimate/ratio.h"

#include "lab/estimate/circle.h"
#include "lab/numeric/cmplx.h"

/// Sums over the rows of one line.
struct sums {
    double complex output_instrument;
    double complex input_instrument;
    double output;
    double input;
    double instrument;
    double crossed; ///< |U conj(Z)|^2
};

static struct sums sum_rows(const struct ratio_spectra *spectra, size_t line)
{
    struct sums sums = {0};
    for (size_t m = 0; m < spectra->rows; m++) {
        size_t i = m * spectra->stride + line;
        double complex mirrored = conj(spectra->instrument[i]);
        double complex crossed = spectra->input[i] * mirrored;
        sums.output_instrument += spectra->output[i] * mirrored;
        sums.input_instrument += crossed;
        sums.output += cmplx_power(spectra->output[i]);
        sums.input += cmplx_power(spectra->input[i]);
        sums.instrument += cmplx_power(spectra->instrument[i]);
        sums.crossed += cmplx_power(crossed);
    }
    return sums;
}

static double chance_of_no_power(const struct ratio_spectra *spectra, const struct sums *sums)
{
    double rows = (double)spectra->rows;
    struct circle crossed = {.count = (size_t)spectra->independent, .mean = sums->input_instrument / rows};
    crossed.variance = sums->crossed / rows - cmplx_power(crossed.mean);
    crossed.variance = crossed.variance > 0.0 ? crossed.variance * rows / (rows - 1.0) : 0.0;
    return circle_chance_of_zero(&crossed);
}

struct ratio ratio_of_line(const struct ratio_spectra *spectra, size_t line)
{
    double rows = (double)spectra->rows;
    struct sums sums = sum_rows(spectra, line);
    double denominator = cmplx_power(sums.input_instrument);
    struct ratio self = {.response = sums.output_instrument / sums.input_instrument, .input_power = sums.input / rows};
    double residual = 0.0;
    for (size_t m = 0; m < spectra->rows; m++) {
        size_t i = m * spectra->stride + line;
        residual += cmplx_power(spectra->output[i] - self.response * spectra->input[i]);
    }
    double scatter = residual / (rows * (1.0 - 1.0 / spectra->independent));
    self.variance = rows / spectra->independent * scatter * sums.instrument / denominator;
    self.coherence = sums.output > 0.0 && sums.instrument > 0.0
                         ? cmplx_power(sums.output_instrument) / (sums.output * sums.instrument)
                         : 0.0;
    self.chance_of_no_power = chance_of_no_power(spectra, &sums);
    return self;
}
