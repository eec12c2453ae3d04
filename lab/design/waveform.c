/* SPDX-License-Identifier: MIT */
#include "lab/design/waveform.h"

#include "lab/numeric/fft.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { transform_length_max = 16384 };

static const double two_pi = 6.283185307179586;

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
    return design_waveform_create_folded(spectrum, kind, grid, 1, out_waveform);
}

static size_t series_count(const struct design_waveform *self)
{
    return self->signal_count * self->fold;
}

static bool add_signal(struct design_waveform *self, const struct design_spectrum *spectrum,
                       enum design_waveform_kind kind, enum design_signal signal)
{
    const double unit = unit_of(spectrum, kind, signal);
    double *gain = calloc(spectrum->line_count, sizeof *gain);
    for (size_t k = 0; gain && k < spectrum->line_count; k++) {
        gain[k] = design_spectrum_amplitude(spectrum, signal, k) / unit;
    }
    self->signals[self->signal_count] = signal;
    self->gain[self->signal_count++] = gain;
    return gain != NULL;
}

static bool allocate(struct design_waveform *self)
{
    self->pair_count = (series_count(self) + 1) / 2;
    self->packed_length = self->pair_count * 2 * self->length;
    self->plan = fft_plan_create(self->length);
    self->spectrum = calloc(2 * self->length, sizeof(double));
    // Of an even number of series, so that the last pair is complete: factors of a series that is not there are 0.
    self->factor = calloc(4 * self->pair_count * self->line_count, sizeof(double));
    self->up = calloc(2 * self->line_count, sizeof *self->up);
    self->down = self->up ? self->up + self->line_count : NULL;
    return self->plan && self->spectrum && self->factor && self->up;
}

/// Each differentiation of the phase turns by a quarter; point r of the grid comes 2 pi b r / grid after point 0.
static void fill_factors(struct design_waveform *self)
{
    for (size_t k = 0; k < self->line_count; k++) {
        size_t index = self->bins[k] % self->length;
        self->up[k] = (uint32_t)(2 * index);
        self->down[k] = (uint32_t)(2 * ((self->length - index) % self->length));
        for (size_t i = 0; i < series_count(self); i++) {
            size_t signal = i % self->signal_count;
            size_t first = i / self->signal_count;
            double turns = (double)((uint64_t)self->bins[k] * first % self->grid) / (double)self->grid;
            double re = self->gain[signal][k] / 2 * cos(two_pi * turns);
            double im = self->gain[signal][k] / 2 * sin(two_pi * turns);
            for (int order = 0; order < (int)self->signals[signal]; order++) {
                double was = re;
                re = -im;
                im = was;
            }
            self->factor[2 * (i * self->line_count + k)] = re;
            self->factor[2 * (i * self->line_count + k) + 1] = im;
        }
    }
}

/// An odd number of signals wants two series of each, so that no imaginary part is empty; and transforms that do not
/// fit into the caches are better cut up.
static size_t choose_fold(const struct design_waveform *self)
{
    size_t fold = self->signal_count % 2 == 1 && self->grid % 2 == 0 ? 2 : 1;
    while (self->grid / fold > transform_length_max && self->grid % (2 * fold) == 0) {
        fold *= 2;
    }
    return fold;
}

bool design_waveform_create_folded(const struct design_spectrum *spectrum, enum design_waveform_kind kind, size_t grid,
                                   size_t fold, struct design_waveform *out_waveform)
{
    struct design_waveform self = {.line_count = spectrum->line_count, .bins = spectrum->bins, .grid = grid};
    bool complete = true;
    for (int signal = 0; signal < design_signal_count; signal++) {
        if (carries(spectrum, kind, (enum design_signal)signal)) {
            complete = add_signal(&self, spectrum, kind, (enum design_signal)signal) && complete;
        }
    }
    self.fold = fold > 0 ? fold : choose_fold(&self);
    self.length = grid / self.fold;
    if (!complete || !allocate(&self)) {
        design_waveform_free(&self);
        return false;
    }
    fill_factors(&self);
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
    free(self->factor);
    free(self->up);
    self->plan = NULL;
    self->spectrum = NULL;
    self->factor = NULL;
    self->up = NULL;
    self->down = NULL;
}

/// Adds both series of a pair: with half amplitudes A and B, bin b gets A + j B, bin -b conj(A) + j conj(B).
static void add_lines(const struct design_waveform *self, size_t pair, const double *c)
{
    const double *even = &self->factor[4 * pair * self->line_count];
    const double *odd = even + 2 * self->line_count;
    for (size_t k = 0; k < self->line_count; k++) {
        double *up = &self->spectrum[self->up[k]];
        double *down = &self->spectrum[self->down[k]];
        double re = c[2 * k];
        double im = c[2 * k + 1];
        double even_re = even[2 * k] * re - even[2 * k + 1] * im;
        double even_im = even[2 * k] * im + even[2 * k + 1] * re;
        double odd_re = odd[2 * k] * re - odd[2 * k + 1] * im;
        double odd_im = odd[2 * k] * im + odd[2 * k + 1] * re;
        up[0] += even_re - odd_im;
        up[1] += even_im + odd_re;
        down[0] += even_re + odd_im;
        down[1] += odd_re - even_im;
    }
}

void design_waveform_synthesise(const struct design_waveform *self, const double *c, double *out_packed)
{
    for (size_t pair = 0; pair < self->pair_count; pair++) {
        memset(self->spectrum, 0, 2 * self->length * sizeof(double));
        add_lines(self, pair, c);
        fft_inverse(self->plan, self->spectrum, &out_packed[2 * self->length * pair]);
    }
}

/// Adds conj(factor) 2 X of both series of a pair: 2 X = Z_b + conj Z_-b of the even one, (Z_b - conj Z_-b) / j of the
/// odd one.
static void gather_lines(const struct design_waveform *self, size_t pair, double *out_y)
{
    const double *even = &self->factor[4 * pair * self->line_count];
    const double *odd = even + 2 * self->line_count;
    for (size_t k = 0; k < self->line_count; k++) {
        const double *up = &self->spectrum[self->up[k]];
        const double *down = &self->spectrum[self->down[k]];
        double even_re = up[0] + down[0];
        double even_im = up[1] - down[1];
        double odd_re = up[1] + down[1];
        double odd_im = down[0] - up[0];
        out_y[2 * k] +=
            even[2 * k] * even_re + even[2 * k + 1] * even_im + odd[2 * k] * odd_re + odd[2 * k + 1] * odd_im;
        out_y[2 * k + 1] +=
            even[2 * k] * even_im - even[2 * k + 1] * even_re + odd[2 * k] * odd_im - odd[2 * k + 1] * odd_re;
    }
}

void design_waveform_gather(const struct design_waveform *self, const double *packed, double *out_y)
{
    memset(out_y, 0, 2 * self->line_count * sizeof(double));
    for (size_t pair = 0; pair < self->pair_count; pair++) {
        fft_forward(self->plan, &packed[2 * self->length * pair], self->spectrum);
        gather_lines(self, pair, out_y);
    }
}

/// Adds the share of one series, turned back to point 0 of the grid.
static void add_transform(const struct design_waveform *self, size_t first, bool odd, size_t bin_count, double *out)
{
    for (size_t b = 0; b < bin_count; b++) {
        size_t index = b % self->length;
        const double *up = &self->spectrum[2 * index];
        const double *down = &self->spectrum[2 * ((self->length - index) % self->length)];
        double re = (odd ? up[1] + down[1] : up[0] + down[0]) / 2;
        double im = (odd ? down[0] - up[0] : up[1] - down[1]) / 2;
        double turns = (double)((uint64_t)b * first % self->grid) / (double)self->grid;
        double cosine = first > 0 ? cos(two_pi * turns) : 1;
        double sine = first > 0 ? sin(two_pi * turns) : 0;
        out[2 * b] += re * cosine + im * sine;
        out[2 * b + 1] += im * cosine - re * sine;
    }
}

void design_waveform_transform(const struct design_waveform *self, const double *packed, size_t bin_count,
                               double *out_transform)
{
    memset(out_transform, 0, 2 * self->signal_count * bin_count * sizeof(double));
    for (size_t i = 0; i < series_count(self); i++) {
        if (i % 2 == 0) {
            fft_forward(self->plan, &packed[self->length * i], self->spectrum);
        }
        add_transform(self, i / self->signal_count, i % 2 == 1, bin_count,
                      &out_transform[2 * bin_count * (i % self->signal_count)]);
    }
}

double design_waveform_peak(const struct design_waveform *self, const double *packed, size_t signal)
{
    double peak = 0;
    for (size_t i = signal; i < series_count(self); i += self->signal_count) {
        const double *values = &packed[2 * self->length * (i / 2) + i % 2];
        for (size_t n = 0; n < self->length; n++) {
            peak = fmax(peak, fabs(values[2 * n]));
        }
    }
    return peak;
}

double design_waveform_peak_all(const struct design_waveform *self, const double *packed)
{
    // Independent maxima, so that one comparison need not wait for the last.
    enum { lanes = 8 };
    double peaks[lanes] = {0};
    size_t i = 0;
    for (; i + lanes <= self->packed_length; i += lanes) {
        for (size_t lane = 0; lane < lanes; lane++) {
            double value = fabs(packed[i + lane]);
            peaks[lane] = value > peaks[lane] ? value : peaks[lane];
        }
    }
    for (; i < self->packed_length; i++) {
        peaks[0] = fmax(peaks[0], fabs(packed[i]));
    }
    double peak = 0;
    for (size_t lane = 0; lane < lanes; lane++) {
        peak = fmax(peak, peaks[lane]);
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
