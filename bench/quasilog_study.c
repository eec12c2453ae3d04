/* SPDX-License-Identifier: MIT */
#include "bench/quasilog_study.h"

#include "lab/numeric/statistics.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double pi = 3.14159265358979323846;
static const double sample_rate_hz = 65536.0;
static const double samples = 65536.0;
static const double line_ratio = 1.05;

const double quasilog_resonance_hz[quasilog_systems] = {40.0, 80.0, 200.0, 400.0, 800.0, 2000.0, 4000.0};

/// Lines from 1 Hz to 16384 Hz: each the next whole Hz or 1.05 times the last, rounded, whichever is higher; or all.
static size_t lines_of(bool linear, double out_frequency_hz[quasilog_lines_max])
{
    size_t count = 0;
    for (double f = 1.0; f <= (double)quasilog_lines_max; count++) {
        out_frequency_hz[count] = f;
        f = linear ? f + 1.0 : fmax(f + 1.0, round(line_ratio * f));
    }
    return count;
}

/// Bilinear transform of 1 / (1 + 2 zeta s / w + (s / w)^2), powers of 1/z, denominator's constant 1.
static void bilinear(double damping, double warped_rad_per_s, double out_b[3], double out_a[3])
{
    double c = 2.0 * sample_rate_hz / warped_rad_per_s;
    double a0 = 1.0 + 2.0 * damping * c + c * c;
    const double b[3] = {1.0, 2.0, 1.0};
    const double a[3] = {a0, 2.0 - 2.0 * c * c, 1.0 - 2.0 * damping * c + c * c};
    for (size_t i = 0; i < 3; i++) {
        out_b[i] = b[i] / a0;
        out_a[i] = a[i] / a0;
    }
}

static void chebyshev(double damping, double resonance_hz, double out_b[3], double out_a[3])
{
    double natural_hz = resonance_hz / sqrt(1.0 - damping * damping);
    double ripple_db = -20.0 * log10(2.0 * damping * sqrt(1.0 - damping * damping));
    double edge_hz = sqrt(2.0) * natural_hz * sqrt(1.0 - 2.0 * damping * damping);
    double warped = 2.0 * sample_rate_hz * tan(pi * edge_hz / sample_rate_hz);
    double v = 0.5 * asinh(1.0 / sqrt(pow(10.0, ripple_db / 10.0) - 1.0));
    // Poles (-sinh v +- j cosh v) / sqrt 2, times the edge.
    double size = sqrt(0.5 * (sinh(v) * sinh(v) + cosh(v) * cosh(v)));
    bilinear(sinh(v) / sqrt(2.0) / size, warped * size, out_b, out_a);
}

static void begin(size_t order, struct parametric_model *out_model)
{
    *out_model = (struct parametric_model){
        .structure = {.domain = parametric_discrete, .numerator_order = order, .denominator_order = order},
        .sample_rate_hz = sample_rate_hz};
}

void quasilog_system(double damping, double resonance_hz, struct parametric_model *out_model)
{
    begin(2, out_model);
    chebyshev(damping, resonance_hz, out_model->numerator, out_model->denominator);
}

void quasilog_sum(double damping, struct parametric_model *out_model)
{
    double b[2][3];
    double a[2][3];
    chebyshev(damping, 400.0, b[0], a[0]);
    chebyshev(damping, 4000.0, b[1], a[1]);
    begin(4, out_model);
    for (size_t i = 0; i < 3; i++) {
        for (size_t j = 0; j < 3; j++) {
            out_model->numerator[i + j] += b[0][i] * a[1][j] + b[1][i] * a[0][j];
            out_model->denominator[i + j] += a[0][i] * a[1][j];
        }
    }
}

bool quasilog_open(bool linear, double noise, struct quasilog_experiment *out_self)
{
    double *frequency_hz = malloc(quasilog_lines_max * sizeof *frequency_hz);
    size_t count = frequency_hz ? lines_of(linear, frequency_hz) : 0;
    *out_self = (struct quasilog_experiment){.count = count, .frequency_hz = frequency_hz};
    out_self->variance = malloc(count * sizeof *out_self->variance);
    out_self->input = malloc(count * sizeof *out_self->input);
    out_self->output = malloc(count * sizeof *out_self->output);
    if (!frequency_hz || !out_self->variance || !out_self->input || !out_self->output) {
        quasilog_close(out_self);
        return false;
    }
    for (size_t k = 0; k < count; k++) {
        out_self->variance[k] = samples * noise * noise;
        out_self->input[k] = 0.5 * samples * sqrt(2.0 / (double)count);
        out_self->output[k] = 0.0;
    }
    out_self->data = (struct parametric_data){.name = "quasilog",
                                              .count = count,
                                              .frequency_hz = frequency_hz,
                                              .input = out_self->input,
                                              .output = out_self->output,
                                              .output_variance = out_self->variance,
                                              .sample_rate_hz = sample_rate_hz};
    return true;
}

void quasilog_close(struct quasilog_experiment *self)
{
    free(self->frequency_hz);
    free(self->variance);
    free(self->input);
    free(self->output);
    *self = (struct quasilog_experiment){0};
}

void quasilog_draw(struct quasilog_experiment *self, const struct parametric_model *truth, struct random *random)
{
    for (size_t k = 0; k < self->count; k++) {
        double amplitude = cabs(self->input[k]);
        double noise = sqrt(0.5 * self->variance[k]);
        double real = noise * random_normal(random);
        double imag = noise * random_normal(random);
        self->input[k] = amplitude * cexp(I * 2.0 * pi * random_uniform(random));
        self->output[k] = parametric_response(truth, self->frequency_hz[k], NULL) * self->input[k] + (real + I * imag);
    }
}

static double db(double value)
{
    return 20.0 * log10(value);
}

double quasilog_bound_db(const struct quasilog_experiment *experiment, struct parametric_model *truth,
                         double frequency_hz)
{
    struct parametric_model bound = *truth;
    double std = NAN;
    if (parametric_bound(&experiment->data, &bound, NULL) == 0) {
        parametric_response(&bound, frequency_hz, &std);
    }
    return db(std);
}

bool quasilog_monte_carlo(struct quasilog_experiment *experiment, const struct parametric_model *truth, size_t runs,
                          uint64_t seed, size_t count, const double *frequency_hz, struct quasilog_scatter *out_scatter)
{
    double complex *sum = calloc(count, sizeof *sum);
    double *squares = calloc(count, sizeof *squares);
    struct random random;
    random_seed(&random, seed);
    size_t failed = 0;
    double cost = 0.0;
    for (size_t run = 0; run < runs && sum && squares; run++) {
        struct parametric_model model;
        quasilog_draw(experiment, truth, &random);
        if (parametric_fit(&experiment->data, &truth->structure, NULL, &model, NULL) != 0) {
            failed++;
            continue;
        }
        cost += model.cost / model.cost_expected;
        for (size_t i = 0; i < count; i++) {
            double complex error =
                parametric_response(&model, frequency_hz[i], NULL) - parametric_response(truth, frequency_hz[i], NULL);
            sum[i] += error;
            squares[i] += creal(error * conj(error));
        }
    }
    double done = (double)(runs - failed);
    bool made = sum && squares && done > 1.0;
    for (size_t i = 0; i < count && made; i++) {
        double complex bias = sum[i] / done;
        double variance = (squares[i] - done * creal(bias * conj(bias))) / (done - 1.0);
        out_scatter[i] = (struct quasilog_scatter){
            .std_db = db(sqrt(variance)), .bias_db = db(cabs(bias)), .cost_ratio = cost / done, .failed = failed};
    }
    free(sum);
    free(squares);
    return made;
}

double quasilog_optimum_formula(double damping)
{
    double c = 1.0 - 2.0 * damping * damping;
    return sqrt(c + sqrt(c * c + 15.0)) / sqrt(5.0);
}

/// Derivatives of 1 / (1 + 2 zeta s / w0 + (s / w0)^2) to w0 and zeta.
static void derivatives(double omega, double natural, double damping, double complex out[2])
{
    double complex s = I * omega / natural;
    double complex over = 1.0 / (1.0 + 2.0 * damping * s + s * s);
    out[0] = (2.0 * s * s + 2.0 * damping * s) * over * over / natural;
    out[1] = -2.0 * s * over * over;
}

/// Determinant of the information of one sine: Re(g g^H) has Im(g_1 conj(g_2))^2.
static double single_sine(double omega, double damping)
{
    double complex g[2];
    derivatives(omega, 1.0, damping, g);
    double part = cimag(g[0] * conj(g[1]));
    return part * part;
}

double quasilog_optimum_searched(double damping)
{
    const double golden = 0.6180339887498949;
    const double flat = 1e-9; // the maximum is flat: closer than the root of the rounding nothing is seen
    double low = 0.5;
    double high = 1.5;
    while (high - low > flat) {
        double left = high - golden * (high - low);
        double right = low + golden * (high - low);
        if (single_sine(left, damping) < single_sine(right, damping)) {
            low = left;
        } else {
            high = right;
        }
    }
    return 0.5 * (low + high);
}

size_t quasilog_band_formula(double damping)
{
    return (size_t)floor(log((1.0 + damping) / (1.0 - damping)) / log(line_ratio));
}

size_t quasilog_band_counted(double damping, double resonance_hz)
{
    static double frequency_hz[quasilog_lines_max];
    size_t lines = lines_of(false, frequency_hz);
    size_t count = 0;
    for (size_t k = 0; k < lines; k++) {
        count += fabs(frequency_hz[k] - resonance_hz) <= damping * resonance_hz;
    }
    return count;
}

/// Sum over log w of Re(g g^H), g of two systems at `natural`: trapezoids, exact to rounding for steps well below the
/// damping.
static void integrate(double damping, const double natural[2], double out_information[4][4])
{
    const double reach = log(1e4);
    const double step = damping / 20.0;
    memset(out_information, 0, 16 * sizeof(double));
    double end = log(natural[1]) + reach;
    for (double at = -reach; at <= end; at += step) {
        double complex g[4];
        derivatives(exp(at), natural[0], damping, g);
        derivatives(exp(at), natural[1], damping, g + 2);
        for (size_t i = 0; i < 4; i++) {
            for (size_t j = 0; j < 4; j++) {
                out_information[i][j] += step * creal(g[i] * conj(g[j]));
            }
        }
    }
}

double quasilog_integral_ratio(double damping)
{
    const double natural[2] = {1.0, 1.0};
    double information[4][4];
    integrate(damping, natural, information);
    return information[0][0] * 16.0 * damping * damping * damping / pi;
}

double quasilog_coupling(double damping, double separation)
{
    const double natural[2] = {1.0, 1.0 + separation * 2.0 * damping * sqrt(1.0 - damping * damping)};
    double information[4][4];
    double largest = 0.0;
    double off = 0.0;
    integrate(damping, natural, information);
    for (size_t i = 0; i < 4; i++) {
        for (size_t j = 0; j < 4; j++) {
            double size = fabs(information[i][j]);
            largest = fmax(largest, size);
            off = i / 2 == j / 2 ? off : fmax(off, size);
        }
    }
    return off / largest;
}
