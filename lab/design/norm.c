/* SPDX-License-Identifier: MIT */
#include "lab/design/norm.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double negligible_power = 1e-30; ///< r^(p-2) below this adds nothing to a sum of at least 1 in double
static const double edge = 0.95;              ///< of the tolerance: nearer to it the angle has no slope

/// Of the highest bin: the weights' transforms are needed at all sums of two bins.
static size_t correlation_bins(const struct design_search *search)
{
    return 2 * (size_t)search->spectrum->bins[search->spectrum->line_count - 1] + 1;
}

bool design_norm_create(struct design_search *search, bool curvature, struct design_norm *out_norm)
{
    const size_t lines = search->spectrum->line_count;
    const size_t packed = search->waveform.packed_length;
    const size_t correlation = 2 * search->waveform.signal_count * correlation_bins(search);
    struct design_norm self = {
        .search = search, .lines = lines, .variables = search->tolerance > 0 ? 2 * lines : lines, .exponent = 1};
    self.c = calloc(5 * lines + (curvature ? packed + correlation + 4 * lines : 0), sizeof(double));
    if (!self.c) {
        return false;
    }
    self.y = self.c + 2 * lines;
    self.share = self.y + 2 * lines;
    self.weight = curvature ? self.share + lines : NULL;
    self.correlation = curvature ? self.weight + packed : NULL;
    self.z = curvature ? self.correlation + correlation : NULL;
    self.raw = curvature ? self.z + 2 * lines : NULL;
    *out_norm = self;
    return true;
}

void design_norm_free(struct design_norm *self)
{
    free(self->c);
    self->c = NULL;
}

void design_norm_get_variables(const struct design_norm *self, const double *c, double *out_x)
{
    for (size_t k = 0; k < self->lines; k++) {
        out_x[k] = atan2(c[2 * k + 1], c[2 * k]);
        if (self->variables > self->lines) {
            double part = log(hypot(c[2 * k], c[2 * k + 1])) / self->search->tolerance;
            out_x[self->lines + k] = asin(fmax(-edge, fmin(part, edge)));
        }
    }
}

void design_norm_get_directions(const struct design_norm *self, const double *x, double *out_c)
{
    for (size_t k = 0; k < self->lines; k++) {
        double length = 1;
        if (self->variables > self->lines) {
            length = exp(self->search->tolerance * sin(x[self->lines + k]));
        }
        out_c[2 * k] = length * cos(x[k]);
        out_c[2 * k + 1] = length * sin(x[k]);
    }
}

/// Replaces u by r^(p-1), sign kept, keeps r^(p-2) if wanted, and returns the sum of r^p.
/// r^(p-2) = r^2 r^4 ... r^(p/2), as p is a power of two.
static double raise_signals(struct design_norm *self)
{
    double *values = self->search->packed;
    const double scale = 1 / self->peak;
    const double least = pow(negligible_power, 1 / (ldexp(1, (int)self->exponent) - 2 + 1e-3));
    double sum = 0;
    for (size_t i = 0; i < self->search->waveform.packed_length; i++) {
        double r = values[i] * scale;
        double power = 0;
        if (fabs(r) > least) { // also keeps denormals out, which are slow
            double square = r;
            power = 1;
            for (unsigned e = 1; e < self->exponent; e++) {
                square *= square;
                power *= square;
            }
        }
        values[i] = power * r;
        sum += values[i] * r;
        if (self->weight) {
            self->weight[i] = power;
        }
    }
    return sum;
}

/// Gradient from y = G' r^(p-1) and the shares of the power.
static void find_gradient(const struct design_norm *self, const double *x, double *out_gradient)
{
    const double scale = 1 / (self->sum * self->peak);
    for (size_t k = 0; k < self->lines; k++) {
        const double *c = &self->c[2 * k];
        const double *y = &self->y[2 * k];
        out_gradient[k] = -scale * (c[1] * y[0] - c[0] * y[1]);
        if (self->variables > self->lines) {
            double along = scale * (c[0] * y[0] + c[1] * y[1]) - self->share[k];
            out_gradient[self->lines + k] = along * self->search->tolerance * cos(x[self->lines + k]);
        }
    }
}

double design_norm_evaluate(struct design_norm *self, const double *x, double *out_gradient)
{
    struct design_search *search = self->search;
    design_norm_get_directions(self, x, self->c);
    self->peak = design_search_peak(search, self->c);
    const double power_root = design_search_power_root(search, self->c);
    design_search_offer(search, self->c, self->peak / power_root);
    self->sum = raise_signals(self);
    design_waveform_gather(&search->waveform, search->packed, self->y);
    for (size_t k = 0; search->share && k < self->lines; k++) {
        double square = self->c[2 * k] * self->c[2 * k] + self->c[2 * k + 1] * self->c[2 * k + 1];
        self->share[k] = search->share[k] * square / (power_root * power_root);
    }
    find_gradient(self, x, out_gradient);
    return log(self->peak / power_root) + log(self->sum) * ldexp(1, -(int)self->exponent);
}

/// z = c factor: amplitude and phase of every line in one signal.
static void find_line_values(const struct design_norm *self, size_t signal)
{
    const struct design_waveform *waveform = &self->search->waveform;
    const double *factor = waveform->factor + 2 * signal * self->lines;
    for (size_t k = 0; k < self->lines; k++) {
        const double *c = &self->c[2 * k];
        self->z[2 * k] = 2 * (factor[2 * k] * c[0] - factor[2 * k + 1] * c[1]);
        self->z[2 * k + 1] = 2 * (factor[2 * k] * c[1] + factor[2 * k + 1] * c[0]);
    }
}

/// Adds sum_n w u_k u_l of one signal, w its transform, by phase and phase: with D = z_k conj(z_l) conj(W[k-l]) and
/// H = z_k z_l conj(W[k+l]) that is Re(D - H) / 2.
static void add_phase_products(const struct design_norm *self, const double *w, double scale, double *matrix)
{
    const uint32_t *bins = self->search->waveform.bins;
    const double *z = self->z;
    for (size_t l = 0; l < self->lines; l++) {
        const double re = scale / 2 * z[2 * l];
        const double im = scale / 2 * z[2 * l + 1];
        double *column = &matrix[l * self->variables];
        for (size_t k = l; k < self->lines; k++) {
            const double *difference = &w[2 * (size_t)(bins[k] - bins[l])];
            const double *sum = &w[2 * ((size_t)bins[k] + bins[l])];
            // conj(z_l) conj(D's W) - z_l conj(H's W), to be multiplied by z_k.
            double factor_re = re * (difference[0] - sum[0]) - im * (difference[1] + sum[1]);
            double factor_im = im * (difference[0] + sum[0]) + re * (difference[1] - sum[1]);
            column[k] += z[2 * k] * factor_re + z[2 * k + 1] * factor_im;
        }
    }
}

/// The blocks with lengths: Re(D + H) / 2 by length and length, Im(D - H) / 2 by length k and phase l, -Im(D + H) / 2
/// by phase k and length l.
static void add_length_products(const struct design_norm *self, const double *w, double scale, double *matrix)
{
    const uint32_t *bins = self->search->waveform.bins;
    const size_t lines = self->lines;
    const size_t variables = self->variables;
    const double *z = self->z;
    for (size_t l = 0; l < lines; l++) {
        const double re_l = scale / 2 * z[2 * l];
        const double im_l = scale / 2 * z[2 * l + 1];
        double *phases = &matrix[l * variables];
        double *lengths = &matrix[(lines + l) * variables];
        for (size_t k = l; k < lines; k++) {
            const double *difference = &w[2 * (size_t)(bins[k] - bins[l])];
            const double *sum = &w[2 * ((size_t)bins[k] + bins[l])];
            double d_re = z[2 * k] * difference[0] + z[2 * k + 1] * difference[1]; // z_k conj(W)
            double d_im = z[2 * k + 1] * difference[0] - z[2 * k] * difference[1];
            double h_re = z[2 * k] * sum[0] + z[2 * k + 1] * sum[1];
            double h_im = z[2 * k + 1] * sum[0] - z[2 * k] * sum[1];
            double toeplitz_im = d_im * re_l - d_re * im_l;
            double hankel_im = h_re * im_l + h_im * re_l;
            lengths[lines + k] += d_re * re_l + d_im * im_l + h_re * re_l - h_im * im_l;
            phases[lines + k] += toeplitz_im - hankel_im;
            if (k > l) { // the block below the diagonal one is full: length l by phase k
                matrix[k * variables + lines + l] -= toeplitz_im + hankel_im;
            }
        }
    }
}

/// Lengths are exp(tolerance sin(angle)): the chain rule, applied to the raw derivatives by phase and log of length.
static void turn_to_angles(const struct design_norm *self, const double *x, double *matrix)
{
    const size_t lines = self->lines;
    const size_t variables = self->variables;
    for (size_t l = 0; l < variables; l++) {
        double column = l < lines ? 1 : self->search->tolerance * cos(x[l]);
        for (size_t k = l < lines ? lines : l; k < variables; k++) {
            matrix[l * variables + k] *= column * self->search->tolerance * cos(x[k]);
        }
        if (l >= lines) {
            double slope = self->raw[l] - self->share[l - lines];
            matrix[l * variables + l] -= slope * self->search->tolerance * sin(x[l]);
        }
    }
}

/// What is left of the second derivatives: those of u itself, on the diagonal, and of the norm's and the power's
/// logarithms.
static void add_remainder(const struct design_norm *self, double *matrix)
{
    const size_t lines = self->lines;
    const size_t variables = self->variables;
    const double p = ldexp(1, (int)self->exponent);
    const double scale = 1 / (self->sum * self->peak);
    for (size_t k = 0; k < lines; k++) {
        double along = scale * (self->c[2 * k] * self->y[2 * k] + self->c[2 * k + 1] * self->y[2 * k + 1]);
        matrix[k * variables + k] -= along;
        if (variables > lines) {
            matrix[(lines + k) * variables + lines + k] += along - 2 * self->share[k];
            matrix[k * variables + lines + k] += self->raw[k];
        }
    }
    for (size_t l = 0; l < variables; l++) {
        for (size_t k = l; k < variables; k++) {
            double of_power = l >= lines ? 2 * self->share[l - lines] * self->share[k - lines] : 0;
            matrix[l * variables + k] += of_power - p * self->raw[l] * self->raw[k];
        }
    }
}

void design_norm_find_curvature(struct design_norm *self, const double *x, const double *gradient, double *out_matrix)
{
    const struct design_waveform *waveform = &self->search->waveform;
    const size_t bins = correlation_bins(self->search);
    const double p = ldexp(1, (int)self->exponent);
    const double scale = (p - 1) / (self->sum * self->peak * self->peak);
    memset(out_matrix, 0, self->variables * self->variables * sizeof(double));
    design_waveform_transform(waveform, self->weight, bins, self->correlation);
    for (size_t s = 0; s < waveform->signal_count; s++) {
        find_line_values(self, s);
        add_phase_products(self, &self->correlation[2 * bins * s], scale, out_matrix);
        if (self->variables > self->lines) {
            add_length_products(self, &self->correlation[2 * bins * s], scale, out_matrix);
        }
    }
    for (size_t k = 0; k < self->lines; k++) {
        const double *c = &self->c[2 * k];
        const double *y = &self->y[2 * k];
        self->raw[k] = gradient[k];
        if (self->variables > self->lines) {
            // Of the norm alone: the power's part has a curvature of its own.
            self->raw[self->lines + k] = (c[0] * y[0] + c[1] * y[1]) / (self->sum * self->peak);
        }
    }
    add_remainder(self, out_matrix);
    if (self->variables > self->lines) {
        turn_to_angles(self, x, out_matrix);
    }
}
