/* SPDX-License-Identifier: MIT */
/// The p-norm baseline: that it ends in a minimum of the last norm, and when it is not to run at all.
/// lab/design/method_linf.c.
#include "lab/design/design.h"

#include "unity.h"

#include <math.h>
#include <string.h>

static const double two_pi = 6.283185307179586;

enum { line_count = 24, period = 256, norm = 512 };
static uint32_t bins[1 << 17];
static struct design_request request;
static struct design_result result;
static struct error error;
static volatile sig_atomic_t stop;

/// 1 .. 24 Hz, velocity and torque competing from 6 Hz on.
void setUp(void)
{
    for (uint32_t k = 0; k < sizeof bins / sizeof bins[0]; k++) {
        bins[k] = k + 1;
    }
    stop = 0;
    request = (struct design_request){.rate_num_hz = period,
                                      .rate_den = 1,
                                      .period_samples = period,
                                      .bin_count = line_count,
                                      .bins = bins,
                                      .inertia_kgm2 = 0.01,
                                      .limits = {.velocity_rad_per_s = 1 / (0.01 * two_pi * 6), .torque_Nm = 1},
                                      .method = "linf",
                                      .grid = design_grid_samples,
                                      .stop_requested = &stop};
    result = (struct design_result){0};
    error = (struct error){0};
}

void tearDown(void)
{
    design_result_free(&result);
}

static void run(void)
{
    design_result_free(&result);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, design_run(&request, &result, &error), error.message);
}

/// log of the p-norm of both limited signals, stacked, with the result's phases turned by `step` times `direction`.
static double log_norm(const double *direction, double step)
{
    double sum = 0;
    for (size_t n = 0; n < period; n++) {
        double v = 0;
        double a = 0;
        for (size_t k = 0; k < line_count; k++) {
            double w = two_pi * bins[k];
            double angle = w * (double)n / period + result.phase_rad[k] + step * direction[k];
            v -= result.amplitude_rad[k] * w * sin(angle);
            a -= result.amplitude_rad[k] * w * w * cos(angle);
        }
        sum += pow(fabs(v) / request.limits.velocity_rad_per_s, norm) + pow(fabs(a) * 0.01, norm);
    }
    return log(sum) / norm;
}

/// The slope of the last norm along each single phase, where it is smallest and where the method ended: the tolerances
/// of the optimiser (1e-6) leave a thousandth of what it is at Newman's phases.
static void test_linf_ends_in_a_minimum_of_the_last_norm(void)
{
    const double step = 1e-6;
    double steepest[2] = {0, 0};
    const char *methods[2] = {"linf", "newman"};
    for (size_t m = 0; m < 2; m++) {
        request.method = methods[m];
        run();
        for (size_t k = 0; k < line_count; k++) {
            double direction[line_count] = {0};
            direction[k] = 1;
            double slope = (log_norm(direction, step) - log_norm(direction, -step)) / (2 * step);
            steepest[m] = fmax(steepest[m], fabs(slope));
        }
    }
    TEST_ASSERT_TRUE(steepest[0] < 0.01 * steepest[1]);
}

/// By 3.6 percent on this problem.
static void test_linf_is_better_than_clipping(void)
{
    run();
    double linf_Nm = result.effective_torque_Nm;
    request.method = "mca";
    run();
    TEST_ASSERT_TRUE(linf_Nm > 1.01 * result.effective_torque_Nm);
}

static void test_linf_refuses_matrices_that_are_too_large(void)
{
    request.period_samples = 1 << 18;
    request.bin_count = 1 << 16;
    TEST_ASSERT_EQUAL_INT(error_refused, design_run(&request, &result, &error));
    TEST_ASSERT_EQUAL_STRING(
        "method linf: 262144 points x 65536 lines need matrices of 274.9 GB, expected at most 2 GB; "
        "method fast has no such matrices",
        error.message);
    TEST_ASSERT_NULL(result.torque_Nm);
}

struct watch {
    size_t calls;
    double share, torque_Nm;
    bool in_order;
};

static void look(void *context, double share_done, double effective_torque_Nm)
{
    struct watch *watch = context;
    watch->in_order =
        watch->in_order && share_done >= watch->share && share_done <= 1 && effective_torque_Nm >= watch->torque_Nm;
    watch->calls++;
    watch->share = share_done;
    watch->torque_Nm = effective_torque_Nm;
    stop = watch->calls == 1; // whoever looks has seen enough
}

static void test_linf_tells_its_progress_and_stops_with_the_best_so_far(void)
{
    struct watch watch = {.in_order = true};
    run();
    double whole_Nm = result.effective_torque_Nm;
    request.method = "newman";
    run();
    double newman_Nm = result.effective_torque_Nm;
    request.method = "linf";
    stop = 1;
    run();
    TEST_ASSERT_TRUE(result.interrupted);
    TEST_ASSERT_TRUE(result.effective_torque_Nm >= newman_Nm * (1 - 1e-9));
    TEST_ASSERT_TRUE(result.effective_torque_Nm < whole_Nm);
    stop = 0;
    request.progress = look;
    request.progress_context = &watch;
    run();
    TEST_ASSERT_TRUE(watch.in_order);
    TEST_ASSERT_TRUE(watch.calls == 0 || result.interrupted); // a fast machine may be through before anyone looks
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_linf_ends_in_a_minimum_of_the_last_norm);
    RUN_TEST(test_linf_is_better_than_clipping);
    RUN_TEST(test_linf_refuses_matrices_that_are_too_large);
    RUN_TEST(test_linf_tells_its_progress_and_stops_with_the_best_so_far);
    return UNITY_END();
}
