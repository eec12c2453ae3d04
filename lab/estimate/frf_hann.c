/* SPDX-License-Identifier: MIT */
#include "lab/estimate/frf_hann.h"

#include "lab/estimate/circle.h"
#include "lab/estimate/method.h"
#include "lab/estimate/stretch.h"
#include "lab/numeric/cmplx.h"

#include <math.h>
#include <stdlib.h>

enum { fewest_periods = 4 };

/// Neighbours at distance 1 and 2 share noise: squares of the window's correlations 2/3 and 1/6.
static const double shared_one_apart = 4.0 / 9.0;
static const double shared_two_apart = 1.0 / 36.0;

/// By how much that correlation widens the scatter of a mean of powers over `lines` lines in a row.
static double correlation_loss(double lines)
{
    double two_apart = lines > 2.0 ? lines - 2.0 : 0.0;
    return 1.0 + 2.0 * ((lines - 1.0) * shared_one_apart + two_apart * shared_two_apart) / lines;
}

static double complex windowed(const double complex *x)
{
    return 0.5 * x[0] - 0.25 * (x[-1] + x[1]);
}

/// `input` and `output` point at the excited line itself.
static void estimate_line(const double complex *input, const double complex *output, long width, size_t line,
                          struct frf *io_frf)
{
    double complex centre = windowed(input);
    double complex response = windowed(output) / centre;
    double residual = 0.0;
    double input_scatter = 0.0;
    double count = 0.0;
    for (long m = -width; m <= width; m++) {
        if (m < -1 || m > 1) {
            residual += cmplx_power(windowed(output + m) - response * windowed(input + m));
            input_scatter += cmplx_power(windowed(input + m));
            count += 1.0;
        }
    }
    /* A variance from `count` correlated lines takes the place of the scatter of that many fewer periods. */
    struct circle input_line = {(size_t)(count / correlation_loss(count / 2.0)) + 1, centre, 0.0};
    input_line.variance = input_scatter / count * (double)input_line.count;
    if (circle_chance_of_zero(&input_line) < estimate_chance_of_dead_line) {
        estimate_set_line(io_frf, line, response, sqrt(residual / count / cmplx_power(centre)));
    }
}

int frf_hann_estimate(const struct periodic *recording, const struct estimate_options *options, struct frf *out_frf,
                      struct error *out_error)
{
    (void)options;
    struct stretch stretch = stretch_longest(recording);
    if (stretch.periods < fewest_periods) {
        return error_set(out_error, error_refused,
                         "%s: the longest stretch without a gap has %zu periods: method hann needs %d, use --method "
                         "lpm or mean",
                         recording->run->path, stretch.periods, fewest_periods);
    }
    size_t width = stretch.periods / 2;
    double side = (double)(width - 1);
    double dof = 2.0 * 2.0 * side / correlation_loss(side);
    int status = estimate_begin(recording, "hann", dof, out_frf, out_error);
    if (status) {
        return status;
    }
    double complex *input = malloc(2 * (stretch.rows / 2 + 1) * sizeof *input);
    double complex *output = input ? input + stretch.rows / 2 + 1 : NULL;
    if (!input || !stretch_transform(recording, &stretch, input, output)) {
        free(input);
        frf_free(out_frf);
        return error_set(out_error, error_refused, "%s: not enough memory for method hann", recording->run->path);
    }
    for (size_t line = 0; line < recording->bin_count; line++) {
        size_t centre = recording->bins[line] * stretch.periods;
        /* The window's neighbours reach one line further, which the last bin of an odd period does not have. */
        size_t room = stretch.rows / 2 - centre - 1;
        estimate_line(input + centre, output + centre, (long)(width < room ? width : room), line, out_frf);
    }
    free(input);
    out_frf->periods = stretch.periods;
    return estimate_end(recording, out_frf, out_error);
}
