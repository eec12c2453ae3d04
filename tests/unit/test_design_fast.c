/* SPDX-License-Identifier: MIT */
/// What "fast" promises whatever the problem: threads, stop, tolerance, budget, seeds. lab/design/{starts,watch}.h.
#include "lab/design/design.h"

#include "unity.h"

#include <math.h>
#include <pthread.h>
#include <string.h>

/// Rounding of sums over some hundred lines.
static const double rounding = 1e-9;

enum { line_count = 30, period = 300 };
static uint32_t bins[line_count];
static struct design_request request;
static struct design_result result;
static struct error error;

void setUp(void)
{
    for (uint32_t k = 0; k < line_count; k++) {
        bins[k] = k + 1;
    }
    request = (struct design_request){.rate_num_hz = 300,
                                      .rate_den = 1,
                                      .period_samples = period,
                                      .bin_count = line_count,
                                      .bins = bins,
                                      .inertia_kgm2 = 0.002,
                                      .limits = {.velocity_rad_per_s = 9, .torque_Nm = 1.5},
                                      .grid = design_grid_samples,
                                      .seed = 3};
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

static void assert_limits_reached(void)
{
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 1, fmax(result.peak.velocity_rad_per_s / 9, result.peak.torque_Nm / 1.5));
}

static void test_fast_result_does_not_depend_on_the_number_of_threads(void)
{
    static double first[line_count];
    request.starts = 7;
    for (size_t threads = 0; threads <= 5; threads++) {
        request.threads = threads;
        run();
        TEST_ASSERT_EQUAL_size_t(7, result.starts);
        if (threads == 0) {
            memcpy(first, result.phase_rad, sizeof first);
        }
        TEST_ASSERT_EQUAL_INT(0, memcmp(first, result.phase_rad, sizeof first));
    }
}

static void test_fast_single_start_ignores_the_seed(void)
{
    static double first[line_count];
    request.starts = 1;
    run();
    memcpy(first, result.phase_rad, sizeof first);
    request.seed = 4;
    run();
    TEST_ASSERT_EQUAL_INT(0, memcmp(first, result.phase_rad, sizeof first));
    TEST_ASSERT_EQUAL_size_t(1, result.starts);
    TEST_ASSERT_FALSE(result.interrupted);
    TEST_ASSERT_TRUE(result.cpu_s > 0);
}

/// 12 starts each: that two seeds end in the same of many optima is possible, that four do is not.
static void test_fast_seeds_lead_to_different_designs(void)
{
    static double first[line_count];
    bool different = false;
    request.starts = 12;
    for (uint64_t seed = 1; seed <= 4; seed++) {
        request.seed = seed;
        run();
        if (seed == 1) {
            memcpy(first, result.phase_rad, sizeof first);
        }
        different = different || memcmp(first, result.phase_rad, sizeof first) != 0;
    }
    TEST_ASSERT_TRUE(different);
}

/// On the samples' grid all starts are judged as the result is.
static void test_fast_more_starts_never_give_less_on_the_samples(void)
{
    request.starts = 1;
    run();
    double one_Nm = result.effective_torque_Nm;
    request.starts = 9;
    run();
    TEST_ASSERT_TRUE(result.effective_torque_Nm >= (1 - rounding) * one_Nm);
}

static void test_fast_stopped_before_it_begins_still_gives_a_design_within_the_limits(void)
{
    static volatile sig_atomic_t stop = 1;
    request.stop_requested = &stop;
    const char *methods[] = {"fast", "mca", "clip"};
    for (size_t i = 0; i < sizeof methods / sizeof methods[0]; i++) {
        request.method = methods[i];
        run();
        TEST_ASSERT_TRUE_MESSAGE(result.interrupted, methods[i]);
        TEST_ASSERT_EQUAL_size_t_MESSAGE(0, result.starts, methods[i]);
        assert_limits_reached();
    }
}

static volatile sig_atomic_t stopped_midway;
static pthread_t caller;
static size_t calls;
static double last_share;
static double last_effective_Nm;

static void stop_when_something_is_there(void *context, double share_done, double effective_torque_Nm)
{
    TEST_ASSERT_EQUAL_PTR(&request, context);
    TEST_ASSERT_TRUE(pthread_equal(caller, pthread_self()));
    TEST_ASSERT_TRUE(share_done >= last_share && share_done <= 1);
    TEST_ASSERT_TRUE(effective_torque_Nm >= last_effective_Nm);
    last_share = share_done;
    last_effective_Nm = effective_torque_Nm;
    calls++;
    stopped_midway = effective_torque_Nm > 0;
}

/// Starts without end: only the stop can end them.
static void test_fast_stopped_midway_returns_the_best_so_far(void)
{
    request.progress = stop_when_something_is_there;
    request.progress_context = &request;
    request.stop_requested = &stopped_midway;
    request.starts = 1000000;
    caller = pthread_self();
    run();
    TEST_ASSERT_TRUE(calls > 0);
    TEST_ASSERT_TRUE(result.interrupted);
    TEST_ASSERT_TRUE(result.starts < request.starts);
    TEST_ASSERT_TRUE(result.effective_torque_Nm >= (1 - rounding) * last_effective_Nm);
    assert_limits_reached();
}

static void test_fast_time_budget_ends_starts_without_end(void)
{
    request.time_budget_s = 0.3;
    run();
    TEST_ASSERT_TRUE(result.starts >= 1);
    TEST_ASSERT_FALSE(result.interrupted);
    assert_limits_reached();
}

/// The deterministic start is always done, however short the time.
static void test_fast_time_budget_never_costs_the_first_start(void)
{
    request.starts = 1;
    run();
    double one_Nm = result.effective_torque_Nm;
    request.starts = 0;
    request.time_budget_s = 1e-9;
    run();
    // What is cut short is its last polish: p from 256 on, log(30) / 256 = 1.3 percent at most.
    TEST_ASSERT_TRUE(result.effective_torque_Nm > 0.985 * one_Nm);
}

static void test_fast_starts_are_an_upper_limit_for_the_time_budget(void)
{
    request.starts = 3;
    request.time_budget_s = 1000;
    run();
    TEST_ASSERT_EQUAL_size_t(3, result.starts);
}

static double prescribed(size_t k)
{
    double w = 6.283185307179586 * bins[k];
    return fmin(9 / w, 1.5 / 0.002 / (w * w));
}

static void test_fast_amplitudes_stay_within_their_tolerance(void)
{
    const double tolerances_db[] = {0.1, 1, 3};
    request.starts = 2;
    run();
    double last_Nm = result.effective_torque_Nm;
    double bound_Nm = result.bound_Nm;
    for (size_t i = 0; i < 3; i++) {
        request.amplitude_tolerance_db = tolerances_db[i];
        run();
        double least = INFINITY;
        double most = 0;
        for (size_t k = 0; k < line_count; k++) {
            least = fmin(least, result.amplitude_rad[k] / prescribed(k));
            most = fmax(most, result.amplitude_rad[k] / prescribed(k));
        }
        TEST_ASSERT_TRUE(20 * log10(most / least) <= 2 * tolerances_db[i] + rounding);
        TEST_ASSERT_TRUE(20 * log10(most / least) > tolerances_db[i]); // and they are made use of
        TEST_ASSERT_TRUE(result.effective_torque_Nm > last_Nm);
        TEST_ASSERT_TRUE(result.effective_torque_Nm < result.bound_Nm);
        TEST_ASSERT_TRUE(fabs(result.bound_Nm - bound_Nm) > 0); // of these amplitudes, not of the prescribed ones
        assert_limits_reached();
        last_Nm = result.effective_torque_Nm;
    }
}

static void assert_refused(const char *part)
{
    TEST_ASSERT_EQUAL_INT_MESSAGE(error_usage, design_run(&request, &result, &error), part);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, part), error.message);
}

static void test_fast_refuses_tolerance_and_budget_that_make_no_sense(void)
{
    const double wrong[] = {-1, NAN, INFINITY};
    for (size_t i = 0; i < 3; i++) {
        setUp();
        request.amplitude_tolerance_db = wrong[i];
        assert_refused("amplitude tolerance");
        setUp();
        request.time_budget_s = wrong[i];
        assert_refused("time budget");
    }
}

/// More lines than Newton's method is used for, so that the other descent is what is seen here; one signal alone.
static void test_fast_with_many_lines(void)
{
    enum { many = 500 };
    static uint32_t all[many];
    for (uint32_t k = 0; k < many; k++) {
        all[k] = k + 1;
    }
    request.bins = all;
    request.bin_count = many;
    request.period_samples = 2048;
    request.limits = (struct design_limits){.torque_Nm = 1};
    request.starts = 1;
    request.iterations = 100;
    run();
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 1, result.peak.torque_Nm);
    TEST_ASSERT_TRUE(result.crest_factor < 1.40); // Newman's phases alone: 1.7
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_fast_result_does_not_depend_on_the_number_of_threads);
    RUN_TEST(test_fast_single_start_ignores_the_seed);
    RUN_TEST(test_fast_seeds_lead_to_different_designs);
    RUN_TEST(test_fast_more_starts_never_give_less_on_the_samples);
    RUN_TEST(test_fast_stopped_before_it_begins_still_gives_a_design_within_the_limits);
    RUN_TEST(test_fast_stopped_midway_returns_the_best_so_far);
    RUN_TEST(test_fast_time_budget_ends_starts_without_end);
    RUN_TEST(test_fast_time_budget_never_costs_the_first_start);
    RUN_TEST(test_fast_starts_are_an_upper_limit_for_the_time_budget);
    RUN_TEST(test_fast_amplitudes_stay_within_their_tolerance);
    RUN_TEST(test_fast_refuses_tolerance_and_budget_that_make_no_sense);
    RUN_TEST(test_fast_with_many_lines);
    return UNITY_END();
}
