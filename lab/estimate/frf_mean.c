/* SPDX-License-Identifier: MIT */
#include "lab/estimate/frf_mean.h"

#include "lab/estimate/circle.h"
#include "lab/estimate/method.h"

#include <math.h>

static double power(double complex z)
{
    return creal(z) * creal(z) + cimag(z) * cimag(z);
}

static void estimate_line(const struct periodic *recording, size_t line, struct frf *io_frf)
{
    size_t stride = recording->bin_count;
    size_t periods = recording->used;
    struct circle input = circle_of_column(recording->input_spectra, periods, stride, line);
    struct circle output = circle_of_column(recording->output_spectra, periods, stride, line);
    if (!(circle_chance_of_zero(&input) < estimate_chance_of_dead_line)) {
        return;
    }
    double complex response = output.mean / input.mean;
    double sum = 0.0;
    for (size_t m = 0; m < periods; m++) {
        double complex output_scatter = recording->output_spectra[m * stride + line] - output.mean;
        double complex input_scatter = recording->input_spectra[m * stride + line] - input.mean;
        sum += power(output_scatter - response * input_scatter);
    }
    double variance = sum / ((double)periods * (double)(periods - 1) * power(input.mean));
    estimate_set_line(io_frf, line, response, sqrt(variance));
}

int frf_mean_estimate(const struct periodic *recording, struct frf *out_frf, struct error *out_error)
{
    int status = estimate_begin(recording, "mean", 2.0 * (double)(recording->used - 1), out_frf, out_error);
    for (size_t line = 0; line < recording->bin_count && !status; line++) {
        estimate_line(recording, line, out_frf);
    }
    return status ? status : estimate_end(recording, out_frf, out_error);
}
