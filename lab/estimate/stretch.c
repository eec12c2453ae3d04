/* SPDX-License-Identifier: MIT */
#include "lab/estimate/stretch.h"

#include "lab/estimate/spectra.h"
#include "lab/numeric/cmplx.h"
#include "lab/numeric/fft.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double two_pi = 6.283185307179586476925;

struct stretch stretch_longest(const struct periodic *recording)
{
    struct stretch best = {0};
    struct stretch now = {0};
    for (size_t i = 0; i < recording->used; i++) {
        if (now.periods > 0 && recording->used_periods[i] == now.first + now.periods) {
            now.periods++;
        } else {
            now = (struct stretch){.first = recording->used_periods[i], .periods = 1};
        }
        best = now.periods > best.periods ? now : best;
    }
    best.rows = best.periods * recording->period_samples;
    return best;
}

/// The output's rows of the stretch; *out_owned is to be freed, and NULL where nothing had to be taken out.
static const double *output_rows(const struct periodic *recording, const struct stretch *self, double **out_owned)
{
    const double *output = run_column(recording->run, recording->output) + self->first * recording->period_samples;
    *out_owned = NULL;
    if (recording->trend_per_sample == 0.0) {
        return output;
    }
    *out_owned = malloc(self->rows * sizeof **out_owned);
    for (size_t n = 0; *out_owned && n < self->rows; n++) {
        (*out_owned)[n] = output[n] - recording->trend_per_sample * (double)n;
    }
    return *out_owned;
}

static const double *input_rows(const struct periodic *recording, const struct stretch *self)
{
    return run_column(recording->run, recording->input) + self->first * recording->period_samples;
}

bool stretch_transform(const struct periodic *recording, const struct stretch *self, double complex *out_input,
                       double complex *out_output)
{
    double *owned;
    const double *output = output_rows(recording, self, &owned);
    bool done = output && spectra_transform_two(input_rows(recording, self), output, self->rows, out_input, out_output);
    free(owned);
    return done;
}

/// Work space of stretch_transform_near: one period long, complex numbers as pairs.
struct near_work {
    size_t samples;
    size_t periods;
    size_t last_line; ///< beyond it nothing is asked for
    double *step;     ///< exp(-j 2 pi n / (N P))
    double *turn;     ///< its r-th power
    double *folded;   ///< z_r
    double *spectrum;
    struct fft_plan *plan;
};

static bool make_work(const struct stretch *stretch, size_t samples, struct near_work *out)
{
    *out = (struct near_work){.samples = samples, .periods = stretch->periods};
    out->step = malloc(8 * samples * sizeof *out->step);
    out->plan = fft_plan_create(samples);
    if (!out->step || !out->plan) {
        free(out->step);
        fft_plan_destroy(out->plan);
        return false;
    }
    out->turn = out->step + 2 * samples;
    out->folded = out->step + 4 * samples;
    out->spectrum = out->step + 6 * samples;
    for (size_t n = 0; n < samples; n++) {
        double angle = two_pi * (double)n / (double)stretch->rows;
        out->step[2 * n] = cos(angle);
        out->step[2 * n + 1] = -sin(angle);
        out->turn[2 * n] = 1.0;
        out->turn[2 * n + 1] = 0.0;
    }
    return true;
}

static void free_work(struct near_work *self)
{
    free(self->step);
    fft_plan_destroy(self->plan);
}

enum { fold_block = 512 };

static inline void add_row(const double *row, double cosine, double sine, size_t count, double *io_real,
                           double *io_imaginary)
{
    for (size_t n = 0; n < count; n++) {
        io_real[n] += cosine * row[n];
        io_imaginary[n] += sine * row[n];
    }
}

/// sum_p x[pN + n] exp(-j 2 pi r p / P), in blocks that stay in the first cache while the periods pass.
static void fold(const double *x, size_t residue, struct near_work *io_work)
{
    double real[fold_block];
    double imaginary[fold_block];
    for (size_t first = 0; first < io_work->samples; first += fold_block) {
        size_t count = io_work->samples - first < fold_block ? io_work->samples - first : fold_block;
        memset(real, 0, sizeof real);
        memset(imaginary, 0, sizeof imaginary);
        for (size_t p = 0; p < io_work->periods; p++) {
            double angle = two_pi * (double)(residue * p % io_work->periods) / (double)io_work->periods;
            const double *row = x + p * io_work->samples + first;
            /* A count known to the compiler is what makes it use vectors. */
            if (count == fold_block) {
                add_row(row, cos(angle), -sin(angle), fold_block, real, imaginary);
            } else {
                add_row(row, cos(angle), -sin(angle), count, real, imaginary);
            }
        }
        for (size_t n = 0; n < count; n++) {
            io_work->folded[2 * (first + n)] = real[n];
            io_work->folded[2 * (first + n) + 1] = imaginary[n];
        }
    }
}

static void turn_by(const double *factor, size_t count, double *io_values)
{
    for (size_t n = 0; n < count; n++) {
        double real = io_values[2 * n] * factor[2 * n] - io_values[2 * n + 1] * factor[2 * n + 1];
        io_values[2 * n + 1] = io_values[2 * n] * factor[2 * n + 1] + io_values[2 * n + 1] * factor[2 * n];
        io_values[2 * n] = real;
    }
}

/// Lines kP + r, and from the upper half of the bins, mirrored, lines kP - r.
static void transform_residue(const double *x, size_t residue, struct near_work *io_work, double complex *out)
{
    size_t rows = io_work->samples * io_work->periods;
    fold(x, residue, io_work);
    turn_by(io_work->turn, io_work->samples, io_work->folded);
    fft_forward(io_work->plan, io_work->folded, io_work->spectrum);
    for (size_t k = 0; k < io_work->samples; k++) {
        size_t line = k * io_work->periods + residue;
        double real = io_work->spectrum[2 * k];
        double imaginary = io_work->spectrum[2 * k + 1];
        if (line <= io_work->last_line) {
            out[line] = CMPLX(real, imaginary);
        } else if (rows - line <= io_work->last_line) {
            out[rows - line] = CMPLX(real, -imaginary);
        }
    }
}

bool stretch_transform_near(const struct periodic *recording, const struct stretch *self, size_t reach,
                            double complex *out_input, double complex *out_output)
{
    struct near_work work;
    double *owned;
    const double *input = input_rows(recording, self);
    const double *output = output_rows(recording, self, &owned);
    bool done = output && make_work(self, recording->period_samples, &work);
    /* At the lower edge a window reaches upwards by what it lacks below. */
    size_t asked = (size_t)recording->bins[recording->bin_count - 1] * self->periods + self->periods + 4 * reach;
    work.last_line = asked < self->rows / 2 ? asked : self->rows / 2;
    size_t residues = reach < self->periods / 2 ? reach : self->periods / 2;
    for (size_t r = 0; r <= residues && done; r++) {
        transform_residue(input, r, &work, out_input);
        transform_residue(output, r, &work, out_output);
        turn_by(work.step, work.samples, work.turn);
    }
    if (done) {
        free_work(&work);
    }
    free(owned);
    return done;
}
