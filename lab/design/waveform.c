/* SPDX-License-Identifier: MIT */
#include "lab/design/waveform.h"

#include "lab/numeric/fft.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static size_t pair_count(const struct design_waveform *self)
{
    return (self->signal_count + 1) / 2;
}

/// Whether some other limited signal's rms alone exceeds all that `signal` can add up to.
static bool cannot_bind(const struct design_spectrum *spectrum, enum design_signal signal)
{
    double sum = 0;
    for (size_t k = 0; k < spectrum->line_count; k++) {
        sum += design_spectrum_amplitude(spectrum, signal, k) / spectrum->limit[signal];
    }
    for (int other = 0; other < design_signal_count; other++) {
        if (other != (int)signal && isfinite(spectrum->limit[other]) &&
            sum < design_spectrum_rms(spectrum, (enum design_signal)other) / spectrum->limit[other]) {
            return true;
        }
    }
    return false;
}

static double unit_of(const struct design_spectrum *spectrum, enum design_waveform_kind kind, enum design_signal signal)
{
    switch (kind) {
    case design_waveform_limited:
        return spectrum->limit[signal];
    case design_waveform_acceleration:
        return design_spectrum_rms(spectrum, signal);
    case design_waveform_physical:
        break;
    }
    return 1;
}

static bool carries(const struct design_spectrum *spectrum, enum design_waveform_kind kind, enum design_signal signal)
{
    switch (kind) {
    case design_waveform_limited:
        return isfinite(spectrum->limit[signal]) && !cannot_bind(spectrum, signal);
    case design_waveform_acceleration:
        return signal == design_acceleration;
    case design_waveform_physical:
        break;
    }
    return true;
}

bool design_waveform_create(const struct design_spectrum *spectrum, enum design_waveform_kind kind, size_t grid,
                            struct design_waveform *out_waveform)
{
    struct design_waveform self = {.line_count = spectrum->line_count, .bins = spectrum->bins, .grid = grid};
    bool complete = true;
    for (int signal = 0; signal < design_signal_count; signal++) {
        if (!carries(spectrum, kind, (enum design_signal)signal)) {
            continue;
        }
        double unit = unit_of(spectrum, kind, (enum design_signal)signal);
        double *gain = calloc(spectrum->line_count, sizeof *gain);
        for (size_t k = 0; gain && k < spectrum->line_count; k++) {
            gain[k] = design_spectrum_amplitude(spectrum, (enum design_signal)signal, k) / unit;
        }
        complete = complete && gain;
        self.signals[self.signal_count] = (enum design_signal)signal;
        self.gain[self.signal_count++] = gain;
    }
    self.packed_length = pair_count(&self) * 2 * grid;
    self.plan = fft_plan_create(grid);
    self.spectrum = calloc(2 * grid, sizeof(double));
    if (!complete || !self.plan || !self.spectrum) {
        design_waveform_free(&self);
        return false;
    }
    *out_waveform = self;
    return true;
}

void design_waveform_free(struct design_waveform *self)
{
    for (size_t s = 0; s < design_signal_count; s++) {
        free(self->gain[s]);
        self->gain[s] = NULL;
    }
    if (self->plan) {
        fft_plan_destroy(self->plan);
    }
    free(self->spectrum);
    self->plan = NULL;
    self->spectrum = NULL;
}

/// Turns re + j im by `order` quarter turns: a differentiation of the phase.
static void turn(int order, double *re, double *im)
{
    for (int i = 0; i < order; i++) {
        double was = *re;
        *re = -*im;
        *im = was;
    }
}

/// Adds u = Re(U exp(j theta)) of one signal to the spectrum of its pair. `odd`: the signal sits in the imaginary part.
static void add_lines(const struct design_waveform *self, size_t signal, const double *c, bool odd)
{
    for (size_t k = 0; k < self->line_count; k++) {
        double re = self->gain[signal][k] * c[2 * k] / 2;
        double im = self->gain[signal][k] * c[2 * k + 1] / 2;
        double *up = &self->spectrum[2 * (size_t)self->bins[k]];
        double *down = &self->spectrum[2 * (self->grid - self->bins[k])];
        turn((int)self->signals[signal], &re, &im);
        if (odd) {
            up[0] -= im;
            up[1] += re;
            down[0] += im;
            down[1] += re;
        } else {
            up[0] += re;
            up[1] += im;
            down[0] += re;
            down[1] -= im;
        }
    }
}

void design_waveform_synthesise(const struct design_waveform *self, const double *c, double *out_packed)
{
    for (size_t pair = 0; pair < pair_count(self); pair++) {
        memset(self->spectrum, 0, 2 * self->grid * sizeof(double));
        add_lines(self, 2 * pair, c, false);
        if (2 * pair + 1 < self->signal_count) {
            add_lines(self, 2 * pair + 1, c, true);
        }
        fft_inverse(self->plan, self->spectrum, &out_packed[2 * self->grid * pair]);
    }
}

/// Adds conj(G) X of one signal: X = (Z_b + conj Z_-b) / 2, of the odd one (Z_b - conj Z_-b) / 2j.
static void gather_lines(const struct design_waveform *self, size_t signal, bool odd, double *out_y)
{
    for (size_t k = 0; k < self->line_count; k++) {
        const double *up = &self->spectrum[2 * (size_t)self->bins[k]];
        const double *down = &self->spectrum[2 * (self->grid - self->bins[k])];
        double re = odd ? up[1] + down[1] : up[0] + down[0];
        double im = odd ? down[0] - up[0] : up[1] - down[1];
        turn((4 - (int)self->signals[signal]) % 4, &re, &im);
        out_y[2 * k] += self->gain[signal][k] * re / 2;
        out_y[2 * k + 1] += self->gain[signal][k] * im / 2;
    }
}

void design_waveform_gather(const struct design_waveform *self, const double *packed, double *out_y)
{
    memset(out_y, 0, 2 * self->line_count * sizeof(double));
    for (size_t pair = 0; pair < pair_count(self); pair++) {
        fft_forward(self->plan, &packed[2 * self->grid * pair], self->spectrum);
        gather_lines(self, 2 * pair, false, out_y);
        if (2 * pair + 1 < self->signal_count) {
            gather_lines(self, 2 * pair + 1, true, out_y);
        }
    }
}

double design_waveform_peak(const struct design_waveform *self, const double *packed, size_t signal)
{
    const double *values = &packed[2 * self->grid * (signal / 2) + signal % 2];
    double peak = 0;
    for (size_t n = 0; n < self->grid; n++) {
        peak = fmax(peak, fabs(values[2 * n]));
    }
    return peak;
}

double design_waveform_peak_all(const struct design_waveform *self, const double *packed)
{
    double peak = 0;
    for (size_t i = 0; i < self->packed_length; i++) {
        double value = fabs(packed[i]);
        peak = value > peak ? value : peak;
    }
    return peak;
}

size_t design_waveform_smooth_length(size_t least)
{
    size_t best = SIZE_MAX;
    for (size_t five = 1; five < best; five *= 5) {
        for (size_t three = five; three < best; three *= 3) {
            size_t length = three;
            while (length < least) {
                length *= 2;
            }
            best = length < best ? length : best;
            if (three >= least) {
                break;
            }
        }
        if (five >= least) {
            break;
        }
    }
    return best;
}
