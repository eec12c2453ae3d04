/* SPDX-License-Identifier: MIT */
/// The published least-squares figures of EMPS (Janot, Gautier, Brunot, "Data Set and Reference Models of EMPS", 2019)
/// from the published recordings, through this project's reader, filters and least squares. SERVOSCOPE_DATA names the
/// recordings' folder.
#include "lab/numeric/filter.h"
#include "lab/numeric/least_squares.h"
#include "lab/record/run.h"
#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>

/// What the figures have to hold.
static const double required_share = 0.005;
/// What they hold: they were printed with four decimals, and every one of them comes out.
static const double printed_digit = 5e-5;

enum { decimation = 10, leading_dropped = 49, columns_max = 5 };

static struct run run;
static double *work;

void setUp(void) {}

void tearDown(void)
{
    run_free(&run);
    free(work);
    work = NULL;
}

/// Force and regressors of one recording after the authors' filtering, column after column, force first.
struct regression {
    size_t rows, columns;
    double *force, *regressors;
};

static void read_emps(const char *name)
{
    static char path[1024];
    struct error error = {0};
    struct stat file;
    const char *folder = getenv("SERVOSCOPE_DATA");
    if (!folder || !*folder)
        TEST_IGNORE_MESSAGE("skipped: no data");
    snprintf(path, sizeof path, "%s/emps/%s", folder, name);
    if (stat(path, &file) != 0)
        TEST_IGNORE_MESSAGE("skipped: no data");
    struct run_options options = {.map = "force_N=force_gtau_x_vir_N,position_m=qm_motor_position_m,time_s=t_s"};
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, run_read(path, &options, &run, &error), error.message);
}

/// Central differences, one-sided ones at the ends.
static void differentiate(size_t n, double rate_hz, const double *x, double *out)
{
    for (size_t i = 1; i + 1 < n; i++)
        out[i] = 0.5 * rate_hz * (x[i + 1] - x[i - 1]);
    out[0] = rate_hz * (x[1] - x[0]);
    out[n - 1] = rate_hz * (x[n - 1] - x[n - 2]);
}

static double sign(double x)
{
    return (x > 0.0) - (x < 0.0);
}

static double regressor(size_t column, bool asymmetric, double velocity, double acceleration)
{
    if (column == 0)
        return acceleration;
    if (!asymmetric)
        return column == 1 ? velocity : column == 2 ? sign(velocity) : 1.0;
    double one_way = column <= 2 ? velocity > 0.0 : velocity < 0.0;
    return one_way * (column % 2 == 1 ? velocity : sign(velocity));
}

/// Low-pass forward and backward, then every tenth sample, the last one among them.
static void decimate(size_t n, double *x, size_t rows, double *out)
{
    struct filter low = filter_chebyshev(8, 0.05, 0.8 / decimation);
    TEST_ASSERT_TRUE(filter_zero_phase(&low, n, x));
    for (size_t i = 0; i < rows; i++)
        out[i] = x[n - 1 - (rows - 1 - i) * decimation];
}

static struct regression prepare(const char *name, bool asymmetric)
{
    read_emps(name);
    size_t n = run.rows, kept = n - leading_dropped;
    struct regression r = {.rows = (kept + decimation - 1) / decimation, .columns = asymmetric ? 5 : 4};
    work = malloc((4 * n + (1 + columns_max) * r.rows) * sizeof *work);
    TEST_ASSERT_NOT_NULL(work);
    double *position = work, *velocity = position + n, *acceleration = velocity + n, *signal = acceleration + n;
    r.force = signal + n;
    r.regressors = r.force + r.rows;

    struct filter low = filter_butterworth(4, 100.0 / (0.5 * run.sample_rate_hz));
    for (size_t i = 0; i < n; i++)
        position[i] = run_column(&run, "position_m")[i];
    TEST_ASSERT_TRUE(filter_zero_phase(&low, n, position));
    differentiate(n, run.sample_rate_hz, position, velocity);
    differentiate(n, run.sample_rate_hz, velocity, acceleration);

    for (size_t c = 0; c <= r.columns; c++) {
        for (size_t i = 0; i < kept; i++) {
            size_t j = i + leading_dropped;
            signal[i] =
                c == 0 ? run_column(&run, "force_N")[j] : regressor(c - 1, asymmetric, velocity[j], acceleration[j]);
        }
        decimate(kept, signal, r.rows, r.force + c * r.rows);
    }
    return r;
}

static double relative_error_percent(const struct regression *r, const double *beta)
{
    double error = 0.0, size = 0.0;
    for (size_t i = 0; i < r->rows; i++) {
        double rest = r->force[i];
        for (size_t c = 0; c < r->columns; c++)
            rest -= beta[c] * r->regressors[c * r->rows + i];
        error += rest * rest;
        size += r->force[i] * r->force[i];
    }
    return 100.0 * sqrt(error / size);
}

struct figure {
    const char *name;
    double paper, ours;
};

static void compare(size_t count, const struct figure *figures)
{
    printf("%-28s %12s %12s %12s\n", "EMPS", "paper", "ours", "required");
    for (size_t i = 0; i < count; i++)
        printf("%-28s %12.4f %12.4f +- %9.4f\n", figures[i].name, figures[i].paper, figures[i].ours,
               required_share * fabs(figures[i].paper));
    for (size_t i = 0; i < count; i++)
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(printed_digit, figures[i].paper, figures[i].ours, figures[i].name);
}

static void fit(const struct regression *r, double *out_beta)
{
    TEST_ASSERT_TRUE(least_squares_solve(r->rows, r->columns, r->regressors, r->force, NULL, NULL, out_beta, NULL));
}

static void test_emps_symmetric_friction_gives_the_published_figures_also_on_pulses(void)
{
    double beta[columns_max];
    struct regression r = prepare("DATA_EMPS.csv", false);
    fit(&r, beta);
    double fitted = relative_error_percent(&r, beta);
    tearDown();
    r = prepare("DATA_EMPS_PULSES.csv", false);
    const struct figure figures[] = {
        {"M, kg", 95.1089, beta[0]},
        {"Fv, N s/m", 203.5034, beta[1]},
        {"Fc, N", 20.3935, beta[2]},
        {"offset, N", -3.1648, beta[3]},
        {"relative error, %", 4.0834, fitted},
        {"relative error on pulses, %", 5.9824, relative_error_percent(&r, beta)},
    };
    compare(sizeof figures / sizeof figures[0], figures);
}

static void test_emps_asymmetric_friction_gives_the_published_figures(void)
{
    double beta[columns_max];
    struct regression r = prepare("DATA_EMPS.csv", true);
    fit(&r, beta);
    const struct figure figures[] = {
        {"M, kg", 95.1540, beta[0]},  {"Fv+, N s/m", 166.7061, beta[1]},
        {"Fc+, N", 20.1440, beta[2]}, {"Fv-, N s/m", 240.4236, beta[3]},
        {"Fc-, N", 20.6277, beta[4]}, {"relative error, %", 3.1117, relative_error_percent(&r, beta)},
    };
    compare(sizeof figures / sizeof figures[0], figures);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_emps_symmetric_friction_gives_the_published_figures_also_on_pulses);
    RUN_TEST(test_emps_asymmetric_friction_gives_the_published_figures);
    return UNITY_END();
}
