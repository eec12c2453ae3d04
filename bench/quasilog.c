/* SPDX-License-Identifier: MIT */
/// The fourth paper's study: what it says, what comes out here, what is required.
/// usage: quasilog [RUNS [SEED]]      the study with RUNS draws a system (1000)
///        quasilog --data FILE ORDER  one recording for the comparison of speed, and how long its fit takes
#include "bench/quasilog_study.h"

#include "lab/numeric/statistics.h"

#include <float.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static const double noise_light = 0.1123; // damping 0.05
static const double noise_heavy = 0.0678; // damping 0.2
static size_t outside;                    // figures outside what is required

#if defined(__GNUC__)
__attribute__((format(printf, 5, 6)))
#endif
static void
row(const char *what, const char *paper, const char *required, bool good, const char *format, ...)
{
    char ours[64];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(ours, sizeof ours, format, arguments);
    va_end(arguments);
    printf("%-52s %-18s %-20s %-18s %s\n", what, paper, ours, required, good ? "" : "OUTSIDE");
    outside += !good;
}

struct spread {
    double low, high;
};

static struct spread spread_of(const double *values)
{
    struct spread spread = {values[0], values[0]};
    for (size_t i = 1; i < quasilog_systems; i++) {
        spread.low = fmin(spread.low, values[i]);
        spread.high = fmax(spread.high, values[i]);
    }
    return spread;
}

static double middle(struct spread spread)
{
    return 0.5 * (spread.low + spread.high);
}

static double half(struct spread spread)
{
    return 0.5 * (spread.high - spread.low);
}

static void print_systems(const char *label, const double *values)
{
    printf("  %-28s", label);
    for (size_t i = 0; i < quasilog_systems; i++) {
        printf(" %7.2f", values[i]);
    }
    printf("\n");
}

/// Bounds and runs of one damping; `level` is what an efficient estimator reaches by reference.
static void single_systems(double damping, double noise, double level, const char *paper, const char *linear_paper,
                           double linear_level, size_t runs, uint64_t seed)
{
    struct quasilog_experiment log_grid;
    struct quasilog_experiment linear_grid;
    double bound[quasilog_systems], linear[quasilog_systems], drawn[quasilog_systems], bias[quasilog_systems];
    if (!quasilog_open(false, noise, &log_grid) || !quasilog_open(true, noise, &linear_grid)) {
        exit(1);
    }
    for (size_t i = 0; i < quasilog_systems; i++) {
        struct parametric_model truth;
        struct quasilog_scatter scatter;
        quasilog_system(damping, quasilog_resonance_hz[i], &truth);
        bound[i] = quasilog_bound_db(&log_grid, &truth, quasilog_resonance_hz[i]);
        linear[i] = quasilog_bound_db(&linear_grid, &truth, quasilog_resonance_hz[i]);
        if (!quasilog_monte_carlo(&log_grid, &truth, runs, seed + i, 1, &quasilog_resonance_hz[i], &scatter)) {
            exit(1);
        }
        drawn[i] = scatter.std_db;
        bias[i] = scatter.bias_db;
        outside += scatter.failed;
    }
    quasilog_close(&log_grid);
    quasilog_close(&linear_grid);
    double far = 0.0;
    for (size_t i = 0; i < quasilog_systems; i++) {
        far = fmax(far, fabs(drawn[i] - level));
    }
    double drawn_tolerance = runs >= 1000 ? 0.5 : 1.2;
    char required[32], label[80];
    printf("\ndamping %g, std of G at the resonance (dB) for 40, 80, 200, 400, 800, 2000, 4000 Hz\n", damping);
    print_systems("bound, ratio 1.05", bound);
    print_systems("runs, ratio 1.05", drawn);
    print_systems("bias of the runs", bias);
    print_systems("bound, every Hz", linear);
    snprintf(required, sizeof required, "%.1f +-.1", level);
    row("  bound, middle +- half spread", paper, required, fabs(middle(spread_of(bound)) - level) <= 0.1,
        "%.2f +-%.2f dB", middle(spread_of(bound)), half(spread_of(bound)));
    row("  bound, constancy", "", "<= .3", half(spread_of(bound)) <= 0.3, "+-%.2f dB", half(spread_of(bound)));
    snprintf(label, sizeof label, "  %zu runs, middle +- half spread", runs);
    row(label, paper, "+-.8", half(spread_of(drawn)) <= 0.8, "%.2f +-%.2f dB", middle(spread_of(drawn)),
        half(spread_of(drawn)));
    snprintf(required, sizeof required, "<= %.1f", drawn_tolerance);
    row("  farthest run from that level", "", required, far <= drawn_tolerance, "%.2f dB", far);
    double width = 2.0 * half(spread_of(linear));
    snprintf(required, sizeof required, "%.1f +-.3", linear_level);
    row("  every Hz instead: spread", linear_paper, required, fabs(width - linear_level) <= 0.3, "%.1f dB", width);
}

static double db(double value)
{
    return 20.0 * log10(value);
}

static double peak_db(const struct parametric_model *truth, double low_hz, double high_hz, double *out_hz)
{
    double best = DBL_MIN;
    for (double f = low_hz; f <= high_hz; f += 1.0) {
        double size = cabs(parametric_response(truth, f, NULL));
        if (size > best) {
            best = size;
            *out_hz = f;
        }
    }
    return db(best);
}

static void sum_of_systems(size_t runs, uint64_t seed)
{
    static const double at_hz[2] = {400.0, 4000.0};
    static const double peak_required[2] = {9.78, 8.13};
    static const double std_required[2] = {-63.7, -62.6};
    static const char *const peak_paper[2] = {"9.8 dB", "8.1 dB"};
    static const char *const std_paper[2] = {"-59.7 dB", "-59.6 dB"};
    struct parametric_model truth;
    struct quasilog_experiment experiment;
    struct quasilog_scatter scatter[2];
    quasilog_sum(0.2, &truth);
    if (!quasilog_open(false, noise_heavy, &experiment) ||
        !quasilog_monte_carlo(&experiment, &truth, runs, seed, 2, at_hz, scatter)) {
        exit(1);
    }
    printf("\nsum of 400 Hz and 4 kHz, damping 0.2\n");
    for (size_t i = 0; i < 2; i++) {
        char label[80], required[32];
        double peak_hz = 0.0;
        double peak = peak_db(&truth, 0.5 * at_hz[i], 1.5 * at_hz[i], &peak_hz);
        snprintf(label, sizeof label, "  |G| at its peak, %.0f Hz", peak_hz);
        snprintf(required, sizeof required, "%.2f +-.02", peak_required[i]);
        row(label, peak_paper[i], required, fabs(peak - peak_required[i]) <= 0.02, "%.3f dB", peak);
        double size = db(cabs(parametric_response(&truth, at_hz[i], NULL)));
        double bound = quasilog_bound_db(&experiment, &truth, at_hz[i]) - size;
        snprintf(label, sizeof label, "  std over |G| at %.0f Hz, bound", at_hz[i]);
        row(label, std_paper[i], "", true, "%.2f dB", bound);
        snprintf(label, sizeof label, "  std over |G| at %.0f Hz, %zu runs", at_hz[i], runs);
        snprintf(required, sizeof required, "%.1f +-1.2", std_required[i]);
        double drawn = scatter[i].std_db - size;
        row(label, std_paper[i], required, fabs(drawn - std_required[i]) <= 1.2, "%.2f dB", drawn);
        outside += scatter[i].failed;
    }
    quasilog_close(&experiment);
}

static void formulas(void)
{
    static const double damping[5] = {0.01, 0.05, 0.2, 0.4, 0.6};
    static const double band[2] = {0.05, 0.2};
    static const double ratio_damping[4] = {0.01, 0.03, 0.1, 0.3};
    static const double ratio_required[4] = {2.0001, 2.0009, 2.0118, 2.1406};
    static const double separation[3] = {4.0, 16.0, 64.0};
    static const double coupling_required[3][3] = {
        {0.0121, 0.0004, 0.0}, {0.0185, 0.0016, 0.0002}, {0.0482, 0.0119, 0.0025}};
    char label[80], text[32];
    printf("\nformulas\n");
    for (size_t i = 0; i < 5; i++) {
        double formula = quasilog_optimum_formula(damping[i]);
        double searched = quasilog_optimum_searched(damping[i]);
        snprintf(label, sizeof label, "  (4) best single sine, damping %g", damping[i]);
        snprintf(text, sizeof text, "%.5f", formula);
        row(label, text, "equal to 1e-4", fabs(formula - searched) <= 1e-4, "%.5f", searched);
    }
    for (size_t i = 0; i < 2; i++) {
        size_t low = SIZE_MAX, high = 0;
        for (size_t s = 0; s < quasilog_systems; s++) {
            size_t count = quasilog_band_counted(band[i], quasilog_resonance_hz[s]);
            low = count < low ? count : low;
            high = count > high ? count : high;
        }
        size_t formula = quasilog_band_formula(band[i]);
        snprintf(label, sizeof label, "  (5) lines in the 3 dB band, damping %g", band[i]);
        snprintf(text, sizeof text, "%zu", formula);
        row(label, text, i ? "8 .. 9" : "2 .. 3", low == (i ? 8 : 2) && high == (i ? 9 : 3), "%.0f .. %.0f",
            (double)low, (double)high);
    }
    for (size_t i = 0; i < 4; i++) {
        double ratio = quasilog_integral_ratio(ratio_damping[i]);
        snprintf(label, sizeof label, "  (8) over pi / (16 w^2 zeta^3), damping %g", ratio_damping[i]);
        snprintf(text, sizeof text, "%.4f", ratio_required[i]);
        row(label, "1 (wrong by 2)", text, fabs(ratio - ratio_required[i]) <= 2e-4, "%.4f", ratio);
    }
    for (size_t i = 0; i < 3; i++) {
        for (size_t s = 0; s < 3; s++) {
            double coupling = quasilog_coupling(damping[i], separation[s]);
            double required = coupling_required[i][s];
            snprintf(label, sizeof label, "  off-diagonal, damping %g, %g bandwidths apart", damping[i], separation[s]);
            snprintf(text, sizeof text, "%.4f +-5 %%", required);
            row(label, s ? "" : "figure", text, fabs(coupling - required) <= 0.05 * required + 5e-5, "%.4f", coupling);
        }
    }
}

static double seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/// Writes one draw on all lines (order 4) or on those of ratio 1.05 (order 2), and times its fit; best of several.
static int speed(const char *path, size_t order)
{
    enum { repeats = 20 };
    struct quasilog_experiment experiment;
    struct parametric_model truth;
    struct parametric_model model = {.cost = NAN};
    struct random random;
    FILE *file = fopen(path, "w");
    if (!file || !quasilog_open(order == 4, noise_heavy, &experiment)) {
        return 1;
    }
    if (order == 4) {
        quasilog_sum(0.2, &truth);
    } else {
        quasilog_system(0.2, 400.0, &truth);
    }
    random_seed(&random, 1);
    quasilog_draw(&experiment, &truth, &random);
    for (size_t k = 0; k < experiment.count; k++) {
        fprintf(file, "%.17g %.17g %.17g %.17g %.17g %.17g\n", experiment.frequency_hz[k], creal(experiment.input[k]),
                cimag(experiment.input[k]), creal(experiment.output[k]), cimag(experiment.output[k]),
                experiment.variance[k]);
    }
    fclose(file);
    double best_s = INFINITY;
    for (int i = 0; i < repeats; i++) {
        double start_s = seconds();
        if (parametric_fit(&experiment.data, &truth.structure, NULL, &model, NULL) != 0) {
            return 1;
        }
        best_s = fmin(best_s, seconds() - start_s);
    }
    printf("%zu %.9g %.17g\n", experiment.count, best_s, model.cost);
    quasilog_close(&experiment);
    return 0;
}

int main(int argc, char **argv)
{
    if (argc == 4 && strcmp(argv[1], "--data") == 0) {
        return speed(argv[2], (size_t)strtoul(argv[3], NULL, 10));
    }
    size_t runs = argc > 1 ? strtoul(argv[1], NULL, 10) : 1000;
    uint64_t seed = argc > 2 ? strtoull(argv[2], NULL, 10) : 1;
    if (runs < 2) {
        fprintf(stderr, "quasilog: runs '%s': expected a whole number from 2\n", argv[1]);
        return 2;
    }
    printf("%zu runs a system, seed %llu; dB of standard deviations\n", runs, (unsigned long long)seed);
    printf("%-52s %-18s %-20s %-18s\n", "", "paper", "here", "required");
    single_systems(0.05, noise_light, -44.2, "-39.3 +-1.8 dB", "35 dB", 20.2, runs, seed);
    single_systems(0.2, noise_heavy, -54.6, "-49.3 +-2.2 dB", "25 dB", 19.8, runs, seed + 100);
    sum_of_systems(runs, seed + 200);
    formulas();
    printf("\n%zu figures outside what is required\n", outside);
    return outside > 0;
}
