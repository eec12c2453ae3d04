/* SPDX-License-Identifier: MIT */
#include "lab/estimate/parametric_plant.h"

#include "lab/estimate/parametric_problem.h"
#include "lab/numeric/polynomial.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { brackets = 64, halvings = 50 };

/// Part of a sample beyond which a delay that noise moves over a sample's edge is none any more.
static const double part_margin = 0.25;

/// How the unknowns of a discrete model become those of a continuous one.
struct conversion {
    const struct parametric_model *discrete;
    size_t poles;
    size_t taps;     ///< coefficients of the numerator
    size_t samples;  ///< whole samples before the first of them
    bool fractional; ///< there is one tap more than poles, for part of a sample of delay
    bool direct;     ///< the first tap acts at once
    double scale_rad_per_s;
};

/// Sum of c_i / (s - s_i), its delay and feedthrough.
struct modes {
    double complex s[parametric_order_max], z[parametric_order_max];
    double complex residue[parametric_order_max]; ///< r_i, then c_i
    double feedthrough, part;
};

/// (exp(x) - 1) / x
static double complex growth(double complex x)
{
    const double small = 1e-4;
    return cabs(x) < small ? 1.0 + x * (0.5 + x / 6.0) : (cexp(x) - 1.0) / x;
}

static bool find_poles(const struct conversion *self, const double *theta, struct modes *out_modes)
{
    double complex x[parametric_order_max];
    size_t found = 0;
    if (!polynomial_roots(theta, self->poles, x, &found) || found != self->poles) {
        return false;
    }
    for (size_t i = 0; i < found; i++) {
        double complex z = 1.0 / x[i];
        if (!(cabs(z) > 0.0) || !isfinite(cabs(z)) || (cimag(z) == 0.0 && creal(z) <= 0.0)) {
            return false;
        }
        out_modes->z[i] = z;
        out_modes->s[i] = self->discrete->sample_rate_hz * clog(z);
    }
    return true;
}

/// Residues in z of the numerator (one sample late unless it acts at once) over the denominator.
static bool find_residues(const struct conversion *self, const double *theta, struct modes *io_modes)
{
    const double *taps = theta + self->poles + 1;
    for (size_t i = 0; i < self->poles; i++) {
        double complex z = io_modes->z[i];
        double complex below = theta[0];
        for (size_t j = 0; j < self->poles; j++) {
            below *= j == i ? 1.0 : 1.0 - io_modes->z[j] / z;
        }
        double complex above = polynomial_value(taps, self->taps - 1, 1.0 / z);
        io_modes->residue[i] = (self->direct ? z : 1.0) * above / below;
        if (!isfinite(cabs(io_modes->residue[i]))) {
            return false;
        }
    }
    io_modes->feedthrough = self->direct ? taps[0] / theta[0] : 0.0;
    return true;
}

/// First sample of the response to a step that comes `part` of a sample late, less the first tap.
static double first_sample(const struct conversion *self, const double *theta, const struct modes *modes, double part)
{
    double step = 1.0 / self->discrete->sample_rate_hz;
    double complex sum = 0.0;
    for (size_t i = 0; i < self->poles; i++) {
        double complex s = modes->s[i];
        double rest = 1.0 - part;
        // c_i / s_i (exp(s_i rest T) - 1), c_i as below
        double complex gained = rest * growth(s * rest * step);
        sum += modes->residue[i] * gained / (cexp(s * rest * step) * growth(-s * step));
    }
    return creal(sum) - theta[self->poles + 1] / theta[0];
}

static bool find_part(const struct conversion *self, const double *theta, struct modes *io_modes)
{
    double low = -part_margin;
    double width = (1.0 + 2.0 * part_margin) / brackets;
    double value = first_sample(self, theta, io_modes, low);
    for (int i = 0; i < brackets; i++, low += width) {
        double next = first_sample(self, theta, io_modes, low + width);
        if ((value <= 0.0) != (next <= 0.0)) {
            double high = low + width;
            for (int h = 0; h < halvings; h++) {
                double middle = 0.5 * (low + high);
                bool same = (first_sample(self, theta, io_modes, middle) <= 0.0) == (value <= 0.0);
                low = same ? middle : low;
                high = same ? high : middle;
            }
            io_modes->part = 0.5 * (low + high);
            return true;
        }
        value = next;
    }
    return false;
}

/// r_i s_i / (exp(s_i (1 - e) T) (1 - exp(-s_i T)))
static void to_continuous(const struct conversion *self, struct modes *io_modes)
{
    double step = 1.0 / self->discrete->sample_rate_hz;
    for (size_t i = 0; i < self->poles; i++) {
        double complex s = io_modes->s[i];
        io_modes->residue[i] /= cexp(s * (1.0 - io_modes->part) * step) * growth(-s * step) * step;
    }
}

/// Multiplies a polynomial of order *io_order by (x - root).
static void multiply(double complex *io_coefficients, size_t *io_order, double complex root)
{
    size_t order = ++*io_order;
    io_coefficients[order] = io_coefficients[order - 1];
    for (size_t i = order - 1; i > 0; i--) {
        io_coefficients[i] = io_coefficients[i - 1] - root * io_coefficients[i];
    }
    io_coefficients[0] *= -root;
}

/// Coefficients of the continuous model from the modes: denominator, numerator, delay.
static void assemble(const struct conversion *self, const struct modes *modes, double *out_theta)
{
    double complex sum[parametric_terms_max] = {0.0};
    size_t numerators = self->direct ? self->poles + 1 : self->poles;
    for (size_t skip = 0; skip <= self->poles; skip++) { // the last one skips none: the denominator
        double complex product[parametric_terms_max] = {1.0};
        size_t order = 0;
        for (size_t j = 0; j < self->poles; j++) {
            if (j != skip) {
                multiply(product, &order, modes->s[j] / self->scale_rad_per_s);
            }
        }
        double complex factor = skip < self->poles ? modes->residue[skip] / self->scale_rad_per_s : modes->feedthrough;
        for (size_t i = 0; i <= order; i++) {
            sum[i] += factor * product[i];
            if (skip == self->poles) {
                out_theta[i] = creal(product[i]);
            }
        }
    }
    for (size_t i = 0; i < numerators; i++) {
        out_theta[self->poles + 1 + i] = creal(sum[i]);
    }
    if (self->fractional) {
        out_theta[self->poles + 1 + numerators] =
            ((double)self->samples + modes->part) / self->discrete->sample_rate_hz;
    }
}

static bool convert(const struct conversion *self, const double *theta, double *out_theta)
{
    struct modes modes = {.part = 0.0};
    if (!find_poles(self, theta, &modes) || !find_residues(self, theta, &modes) ||
        (self->fractional && !find_part(self, theta, &modes))) {
        return false;
    }
    to_continuous(self, &modes);
    assemble(self, &modes, out_theta);
    return true;
}

/// J C J', J by differences a small part of each unknown's standard deviation apart.
static bool convert_covariance(const struct conversion *self, const double *theta, size_t unknowns, double *out)
{
    const double part_of_std = 1e-3;
    const struct parametric_model *from = self->discrete;
    double jacobian[parametric_unknowns_max][parametric_unknowns_max] = {{0.0}};
    for (size_t j = 0; j < from->unknowns; j++) {
        double low[parametric_unknowns_max];
        double high[parametric_unknowns_max];
        double moved[parametric_unknowns_max];
        double step = part_of_std * sqrt(fmax(from->covariance[j * (from->unknowns + 1)], 0.0));
        memcpy(moved, theta, from->unknowns * sizeof *moved);
        moved[j] = theta[j] - step;
        if (step > 0.0 && convert(self, moved, low)) {
            moved[j] = theta[j] + step;
            if (!convert(self, moved, high)) {
                return false;
            }
            for (size_t i = 0; i < unknowns; i++) {
                jacobian[i][j] = (high[i] - low[i]) / (2.0 * step);
            }
        } else if (step > 0.0) {
            return false;
        }
    }
    for (size_t i = 0; i < unknowns; i++) {
        double product[parametric_unknowns_max] = {0.0};
        for (size_t j = 0; j < from->unknowns; j++) {
            for (size_t k = 0; k < from->unknowns; k++) {
                product[j] += jacobian[i][k] * from->covariance[k * from->unknowns + j];
            }
        }
        for (size_t l = 0; l < unknowns; l++) {
            double sum = 0.0;
            for (size_t j = 0; j < from->unknowns; j++) {
                sum += product[j] * jacobian[l][j];
            }
            out[i * unknowns + l] = sum;
        }
    }
    return true;
}

/// Middle of the poles' sizes on a logarithmic scale, so that powers of s stay near 1.
static double middle_rad_per_s(const struct modes *modes, size_t count, double sample_rate_hz)
{
    double sum = 0.0;
    for (size_t i = 0; i < count; i++) {
        sum += log(fmax(cabs(modes->s[i]), 1e-6 * sample_rate_hz)) / (double)count;
    }
    return exp(sum);
}

static struct parametric_model begin_plant(const struct conversion *self)
{
    const struct parametric_model *from = self->discrete;
    struct parametric_model plant = *from;
    plant.structure = (struct parametric_structure){.domain = parametric_continuous,
                                                    .numerator_order = self->poles - (self->direct ? 0 : 1),
                                                    .denominator_order = self->poles,
                                                    .delay_free = self->fractional,
                                                    .delay_s = (double)self->samples / from->sample_rate_hz};
    plant.scale_rad_per_s = self->scale_rad_per_s;
    plant.unknowns = parametric_layout_of(&plant.structure).unknowns;
    memset(plant.numerator, 0, sizeof plant.numerator);
    memset(plant.denominator, 0, sizeof plant.denominator);
    memset(plant.numerator_std, 0, sizeof plant.numerator_std);
    memset(plant.denominator_std, 0, sizeof plant.denominator_std);
    memset(plant.transient, 0, sizeof plant.transient);
    plant.delay_std_s = 0.0;
    return plant;
}

bool parametric_plant_of(const struct parametric_model *discrete, struct parametric_model *out_model)
{
    const struct parametric_structure *structure = &discrete->structure;
    double whole = round(structure->delay_s * discrete->sample_rate_hz);
    size_t late = structure->numerator_lowest + (size_t)fmax(whole, 0.0);
    struct conversion conversion = {.discrete = discrete,
                                    .poles = structure->denominator_order,
                                    .taps = structure->numerator_order - structure->numerator_lowest + 1,
                                    .direct = late == 0,
                                    .samples = late > 0 ? late - 1 : 0,
                                    .scale_rad_per_s = 1.0};
    double theta[parametric_unknowns_max];
    double continuous[parametric_unknowns_max];
    struct modes modes = {.part = 0.0};
    *out_model = (struct parametric_model){0};
    conversion.fractional = !conversion.direct && conversion.taps > conversion.poles;
    if (structure->domain != parametric_discrete || structure->transient || structure->delay_free || whole < 0.0 ||
        conversion.taps > conversion.poles + 1 || conversion.poles == 0) {
        return false;
    }
    parametric_pack(discrete, theta);
    if (!find_poles(&conversion, theta, &modes)) {
        return false;
    }
    conversion.scale_rad_per_s = middle_rad_per_s(&modes, conversion.poles, discrete->sample_rate_hz);
    struct parametric_model plant = begin_plant(&conversion);
    if (!convert(&conversion, theta, continuous) ||
        !convert_covariance(&conversion, theta, plant.unknowns, plant.covariance)) {
        return false;
    }
    parametric_unpack(continuous, &plant);
    if (parametric_derive(&plant, NULL) != 0) {
        return false;
    }
    *out_model = plant;
    return true;
}
