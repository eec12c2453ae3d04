/* SPDX-License-Identifier: MIT */
/// The watch on a bus's punctuality: spacing of SYNCs, time to the answer, and their histograms.
#include "ports/bus_watch.h"

#include <math.h>
#include <unity.h>

enum { period_us = 1000, reply_id = 0x285 };

static struct bus_watch watch;

void setUp(void)
{
    bus_watch_start(&watch, period_us, reply_id);
}

void tearDown(void) {}

static void see(uint16_t id, uint64_t time_us)
{
    const struct can_frame frame = can_frame_make(id, id == 0x080 ? 1 : 8);
    bus_watch_frame(&watch, &frame, time_us);
}

static void test_bus_watch_counts_each_value_in_its_bin(void)
{
    for (int bin = 0; bin < bus_histogram_bins; bin++) {
        struct bus_histogram histogram = {.count = 0};
        const bool last = bin == bus_histogram_bins - 1;
        uint32_t below = bin == 0 ? 0 : bus_histogram_ends_us[bin - 1] + 1;
        bus_histogram_add(&histogram, below);
        bus_histogram_add(&histogram, last ? UINT32_MAX : bus_histogram_ends_us[bin]);
        TEST_ASSERT_EQUAL_UINT32(2, histogram.bins[bin]);
        TEST_ASSERT_EQUAL_UINT64(2, histogram.count);
        TEST_ASSERT_EQUAL_UINT32(below, histogram.least_us);
    }
}

static void test_bus_watch_knows_mean_deviation_and_quantiles(void)
{
    struct bus_histogram histogram = {.count = 0};
    TEST_ASSERT_EQUAL_DOUBLE(0.0, bus_histogram_mean_us(&histogram));
    for (uint32_t value = 1; value <= 100; value++) {
        bus_histogram_add(&histogram, value);
    }
    const double tolerance = 1e-9; // sums of small whole numbers: rounding only
    TEST_ASSERT_DOUBLE_WITHIN(tolerance, 50.5, bus_histogram_mean_us(&histogram));
    TEST_ASSERT_DOUBLE_WITHIN(tolerance, sqrt(100.0 * 101.0 / 12.0), bus_histogram_std_us(&histogram));
    TEST_ASSERT_EQUAL_UINT32(50, bus_histogram_quantile_us(&histogram, 0.5));
    TEST_ASSERT_EQUAL_UINT32(100, bus_histogram_quantile_us(&histogram, 0.99));
    bus_histogram_add(&histogram, 60000); // beyond the last end: the value itself
    TEST_ASSERT_EQUAL_UINT32(60000, bus_histogram_quantile_us(&histogram, 1.0));
}

static void test_bus_watch_judges_the_spacing_of_syncs(void)
{
    see(0x080, 5000); // the first has no spacing
    see(0x080, 6000);
    see(0x080, 7030); // 30 late
    see(0x080, 8000); // 30 early
    see(0x080, 9500); // half a period late: not yet counted as late
    see(0x080, 11001);
    TEST_ASSERT_EQUAL_UINT64(5, watch.spacing.count);
    TEST_ASSERT_EQUAL_UINT32(0, watch.spacing.least_us);
    TEST_ASSERT_EQUAL_UINT32(501, watch.spacing.greatest_us);
    TEST_ASSERT_EQUAL_UINT32(1, watch.syncs_late);
}

static void test_bus_watch_times_the_first_answer_to_each_sync(void)
{
    see(reply_id, 4000); // nobody has asked
    see(0x080, 5000);
    see(0x185, 5100); // not the last one of the cycle
    see(reply_id, 5200);
    see(reply_id, 5300); // once more
    see(0x080, 6000);    // stays without an answer
    see(0x080, 7000);
    see(reply_id, 7400);
    TEST_ASSERT_EQUAL_UINT64(2, watch.reply.count);
    TEST_ASSERT_EQUAL_UINT32(200, watch.reply.least_us);
    TEST_ASSERT_EQUAL_UINT32(400, watch.reply.greatest_us);
}

static void test_bus_watch_sees_nothing_before_it_is_started(void)
{
    watch = (struct bus_watch){.period_us = 0};
    see(0x080, 5000);
    see(0x080, 9000);
    TEST_ASSERT_EQUAL_UINT64(0, watch.spacing.count);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_bus_watch_counts_each_value_in_its_bin);
    RUN_TEST(test_bus_watch_knows_mean_deviation_and_quantiles);
    RUN_TEST(test_bus_watch_judges_the_spacing_of_syncs);
    RUN_TEST(test_bus_watch_times_the_first_answer_to_each_sync);
    RUN_TEST(test_bus_watch_sees_nothing_before_it_is_started);
    return UNITY_END();
}
