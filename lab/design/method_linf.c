/* SPDX-License-Identifier: MIT */
/// L-infinity by rising p-norms (first paper, 3.2; Guillaume 1991): the baseline that others are measured against.
/// Least squares of e_n = u_n^(p/2) over all limited signals stacked (equation 11), p = 2, 4, ..., 512, by trust-region
/// steps with the analytic Jacobian (4), built from the matrices COS and SIN (7), (8) as in (10). It is the one method
/// that holds matrices of points x lines.
#include "lab/design/method.h"
#include "lab/design/phases.h"
#include "lab/numeric/blas.h"
#include "lab/numeric/trust_region.h"

#include <cblas.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    steps_per_norm = 400,
    norm_count = 9,   ///< p = 2^1 .. 2^9
    block_rows = 256, ///< of the Jacobian at a time: as fast as all of them, and they need not be kept
};

static const double two_pi = 6.283185307179586;
static const double tolerance = 1e-6;
static const double matrices_max_bytes = 2e9;

/// A row of J smaller than this in units of the largest adds less than rounding to J'J.
static const double negligible = 1e-10;

struct linf {
    const struct design_request *request;
    struct design_search *search;
    size_t lines, points;
    double *cosine, *sine; ///< points x lines, row after row
    double *rows;          ///< block_rows x lines of J
    double *residuals;     ///< block_rows of e
    double *weight;        ///< 2 lines: factors of COS and SIN in du / dphi_k of one signal
    double *c;             ///< 2 lines: exp(j phi_k)
    double scale;          ///< c_A: 1 / max |u| at the start of a norm
    int norm;              ///< p = 2^norm
};

static void set_directions(struct linf *self, const double *x)
{
    for (size_t k = 0; k < self->lines; k++) {
        self->c[2 * k] = cos(x[k]);
        self->c[2 * k + 1] = sin(x[k]);
    }
}

/// Signals at phases x into search->packed; returns the largest in units of its limit.
static double synthesise(struct linf *self, const double *x)
{
    set_directions(self, x);
    return design_search_peak(self->search, self->c);
}

static double cost(void *context, const double *x)
{
    struct linf *self = context;
    design_search_offer(self->search, self->c, synthesise(self, x));
    double sum = 0;
    for (size_t i = 0; i < self->search->waveform.packed_length; i++) {
        double power = self->scale * self->search->packed[i];
        for (int square = 0; square < self->norm; square++) {
            power *= power;
        }
        sum += power;
    }
    return sum;
}

/// du_n / dphi_k = weight[2k] cos(2 pi b_k n / N) + weight[2k + 1] sin(...) for one signal, c_A included.
static void set_weights(struct linf *self, size_t signal)
{
    const struct design_waveform *waveform = &self->search->waveform;
    for (size_t k = 0; k < self->lines; k++) {
        double re = self->c[2 * k];
        double im = self->c[2 * k + 1];
        for (int turn = 0; turn <= (int)waveform->signals[signal]; turn++) {
            double was = re;
            re = -im;
            im = was;
        }
        self->weight[2 * k] = self->scale * waveform->gain[signal][k] * re;
        self->weight[2 * k + 1] = -self->scale * waveform->gain[signal][k] * im;
    }
}

static void fill_row(const struct linf *self, size_t point, double slope, double *out_row)
{
    const double *cosine = &self->cosine[point * self->lines];
    const double *sine = &self->sine[point * self->lines];
    for (size_t k = 0; k < self->lines; k++) {
        out_row[k] = slope * (self->weight[2 * k] * cosine[k] + self->weight[2 * k + 1] * sine[k]);
    }
}

/// Adds the first `count` rows of the block to J'J and J'e.
static void add_block(const struct linf *self, int count, double *H, double *g)
{
    const int lines = (int)self->lines;
    cblas_dsyrk(CblasColMajor, CblasLower, CblasNoTrans, lines, count, 1, self->rows, lines, 1, H, lines);
    cblas_dgemv(CblasColMajor, CblasNoTrans, lines, count, 1, self->rows, lines, self->residuals, 1, 1, g, 1);
}

/// Adds all points of one signal; packed holds the signals at the phases of c.
static void add_signal(struct linf *self, size_t signal, double *H, double *g)
{
    const double *values = &self->search->packed[2 * self->points * (signal / 2) + signal % 2];
    const double exponent = ldexp(1, self->norm - 1);
    int count = 0;
    set_weights(self, signal);
    for (size_t n = 0; n < self->points; n++) {
        double value = self->scale * values[2 * n];
        double power = pow(value, exponent - 1);
        if (fabs(power) > negligible) {
            self->residuals[count] = power * value;
            fill_row(self, n, exponent * power, &self->rows[(size_t)count * self->lines]);
            count++;
        }
        if (count == block_rows || (count > 0 && n + 1 == self->points)) {
            add_block(self, count, H, g);
            count = 0;
        }
    }
}

static void normal_equations(void *context, const double *x, double *out_H, double *out_g)
{
    struct linf *self = context;
    synthesise(self, x);
    memset(out_g, 0, self->lines * sizeof(double));
    for (size_t s = 0; s < self->search->waveform.signal_count; s++) {
        add_signal(self, s, out_H, out_g);
    }
}

static bool stop(void *context, size_t step)
{
    const struct linf *self = context;
    (void)step;
    return !design_search_goes_on(self->search);
}

static int optimise(struct linf *self, double *x, struct error *out_error)
{
    const struct trust_region_problem problem = {
        .unknowns = self->lines,
        .context = self,
        .cost = cost,
        .normal_equations = normal_equations,
        .stop = stop,
    };
    const struct trust_region_limits limits = {
        .steps = design_method_iterations(self->request, &design_method_linf),
        .cost_tolerance = tolerance,
        .step_tolerance = tolerance,
        .gradient_tolerance = tolerance,
    };
    struct trust_region_outcome outcome = {0};
    struct design_watch *watch = self->search->watch;
    if (watch) {
        design_watch_plan(watch, norm_count * limits.steps);
    }
    for (self->norm = 1; self->norm <= norm_count && !outcome.stopped; self->norm++) {
        self->scale = 1 / synthesise(self, x);
        if (!trust_region_minimise(&problem, &limits, x, &outcome)) {
            return design_method_out_of_memory(out_error);
        }
        if (watch) { // most norms need few of the steps they may take
            atomic_store(&watch->done, (size_t)self->norm * limits.steps);
        }
    }
    return 0;
}

static void fill_tables(struct linf *self)
{
    const uint32_t *bins = self->search->waveform.bins;
    for (size_t n = 0; n < self->points; n++) {
        for (size_t k = 0; k < self->lines; k++) {
            double turns = (double)((uint64_t)bins[k] * n % self->points) / (double)self->points;
            self->cosine[n * self->lines + k] = cos(two_pi * turns);
            self->sine[n * self->lines + k] = sin(two_pi * turns);
        }
    }
}

static int check_size(const struct linf *self, struct error *out_error)
{
    const double bytes = 2.0 * sizeof(double) * (double)self->points * (double)self->lines;
    if (bytes > matrices_max_bytes) {
        return error_set(out_error, error_refused,
                         "method linf: %zu points x %zu lines need matrices of %.1f GB, expected at most %.0f GB; "
                         "method fast has no such matrices",
                         self->points, self->lines, 1e-9 * bytes, 1e-9 * matrices_max_bytes);
    }
    return 0;
}

static int run(const struct design_request *request, struct design_search *search, struct error *out_error)
{
    struct linf self = {
        .request = request, .search = search, .lines = search->spectrum->line_count, .points = search->waveform.grid};
    int status = check_size(&self, out_error);
    if (status) {
        return status;
    }
    blas_use_one_thread();
    const size_t matrix = self.points * self.lines;
    double *work = calloc(2 * matrix + block_rows * (self.lines + 1) + 5 * self.lines, sizeof *work);
    if (!work) {
        return design_method_out_of_memory(out_error);
    }
    self.cosine = work;
    self.sine = self.cosine + matrix;
    self.rows = self.sine + matrix;
    self.residuals = self.rows + block_rows * self.lines;
    self.weight = self.residuals + block_rows;
    self.c = self.weight + 2 * self.lines;
    double *x = self.c + 2 * self.lines;
    fill_tables(&self);
    design_phases_newman(self.lines, self.c);
    for (size_t k = 0; k < self.lines; k++) {
        x[k] = atan2(self.c[2 * k + 1], self.c[2 * k]);
    }
    status = optimise(&self, x, out_error);
    free(work);
    return status;
}

const struct design_method design_method_linf = {
    .name = "linf",
    .summary = "L-infinity of the first paper: p-norms up to 512 by trust-region least squares; slow, for comparison",
    .iterations = steps_per_norm,
    .run = run,
};
