/* SPDX-License-Identifier: MIT */
#include "guard/guard.h"
#include "guard/guard_real.h"

#include "unity.h"

#include <math.h>
#include <string.h>

static const struct guard_limits limits = {-1000, 2000, 50, 300, 10, 4, 100};
static const struct guard_real_limits real_limits = {-1.0, 2.0, 0.05, 0.3, 10, 4, 0.1};
static struct guard guard;
static struct guard_real guard_real;

/* Moves a little each time, so that nothing is stuck unless a test wants it. */
static struct guard_sample inside(void)
{
    static int32_t position;
    position = (position + 1) % 100;
    return (struct guard_sample){position, 0, 0, true};
}

static struct guard_real_sample real_inside(void)
{
    static core_real position;
    position = position > 1 ? 0 : position + (core_real)1e-3;
    return (struct guard_real_sample){position, 0, 0, true};
}

void setUp(void)
{
    struct guard_sample now = inside();
    struct guard_real_sample real_now = real_inside();
    TEST_ASSERT_EQUAL_INT(core_ok, guard_init(&guard, &limits));
    TEST_ASSERT_EQUAL_INT(core_ok, guard_arm(&guard, &now));
    TEST_ASSERT_EQUAL_INT(core_ok, guard_real_init(&guard_real, &real_limits));
    TEST_ASSERT_EQUAL_INT(core_ok, guard_real_arm(&guard_real, &real_now));
}

void tearDown(void) {}

static void expect_step(struct guard_sample sample, enum guard_cause cause, int32_t value)
{
    guard_alive(&guard.state);
    enum guard_action action = guard_step(&guard, &sample);
    TEST_ASSERT_EQUAL_INT(cause == guard_cause_none ? guard_run : guard_ramp_down, action);
    TEST_ASSERT_EQUAL_STRING(guard_cause_str(cause), guard_cause_str(guard.state.cause));
    TEST_ASSERT_EQUAL_INT32(value, guard.trip_value);
    setUp();
}

static void test_guard_limits_hold_to_one_count(void)
{
    expect_step((struct guard_sample){-1000, 0, 0, true}, guard_cause_none, 0);
    expect_step((struct guard_sample){-1001, 0, 0, true}, guard_cause_travel, -1001);
    expect_step((struct guard_sample){2000, 0, 0, true}, guard_cause_none, 0);
    expect_step((struct guard_sample){2001, 0, 0, true}, guard_cause_travel, 2001);
    expect_step((struct guard_sample){0, 50, 0, true}, guard_cause_none, 0);
    expect_step((struct guard_sample){0, 51, 0, true}, guard_cause_speed, 51);
    expect_step((struct guard_sample){0, -50, 0, true}, guard_cause_none, 0);
    expect_step((struct guard_sample){0, -51, 0, true}, guard_cause_speed, -51);
    expect_step((struct guard_sample){INT32_MIN, 0, 0, true}, guard_cause_travel, INT32_MIN);
    expect_step((struct guard_sample){INT32_MAX, 0, 0, true}, guard_cause_travel, INT32_MAX);
    expect_step((struct guard_sample){0, INT32_MIN, 0, true}, guard_cause_speed, INT32_MIN);
    expect_step((struct guard_sample){0, INT32_MAX, 0, true}, guard_cause_speed, INT32_MAX);
    expect_step((struct guard_sample){0, 0, INT32_MIN, true}, guard_cause_none, 0);
    expect_step((struct guard_sample){0, 0, 0, false}, guard_cause_sensor, 0);
    /* first in order wins: an invalid sensor's values are not judged, travel before speed */
    expect_step((struct guard_sample){-5000, 99, 0, false}, guard_cause_sensor, 0);
    expect_step((struct guard_sample){-5000, 99, 0, true}, guard_cause_travel, -5000);
}

static void expect_real_step(core_real position, core_real velocity, core_real torque, enum guard_cause cause)
{
    struct guard_real_sample sample = {position, velocity, torque, true};
    guard_alive(&guard_real.state);
    enum guard_action action = guard_real_step(&guard_real, &sample);
    TEST_ASSERT_EQUAL_INT(cause == guard_cause_none ? guard_run : guard_ramp_down, action);
    TEST_ASSERT_EQUAL_STRING(guard_cause_str(cause), guard_cause_str(guard_real.state.cause));
    setUp();
}

static void test_guard_real_limits_hold_to_the_last_bit_and_nan_fails(void)
{
    static const core_real none = 0;
    const core_real bad[3] = {(core_real)NAN, (core_real)INFINITY, (core_real)-INFINITY};
    expect_real_step(real_limits.position_max_rad, none, none, guard_cause_none);
    expect_real_step((core_real)nextafter(real_limits.position_max_rad, 9), none, none, guard_cause_travel);
    expect_real_step(real_limits.position_min_rad, none, none, guard_cause_none);
    expect_real_step((core_real)nextafter(real_limits.position_min_rad, -9), none, none, guard_cause_travel);
    expect_real_step(none, real_limits.velocity_max_rad_per_s, none, guard_cause_none);
    expect_real_step(none, -real_limits.velocity_max_rad_per_s, none, guard_cause_none);
    expect_real_step(none, (core_real)nextafter(real_limits.velocity_max_rad_per_s, 9), none, guard_cause_speed);
    expect_real_step(none, (core_real)nextafter(-real_limits.velocity_max_rad_per_s, -9), none, guard_cause_speed);
    for (unsigned i = 0; i < 3; i++) {
        expect_real_step(bad[i], none, none, guard_cause_sensor);
        expect_real_step(none, bad[i], none, guard_cause_sensor);
        expect_real_step(none, none, bad[i], guard_cause_sensor);
    }
    struct guard_real_sample invalid = {0, 0, 0, false};
    TEST_ASSERT_EQUAL_INT(guard_ramp_down, guard_real_step(&guard_real, &invalid));
    TEST_ASSERT_EQUAL_INT(guard_cause_sensor, guard_real.state.cause);
}

static void test_guard_real_keeps_the_value_that_tripped(void)
{
    struct guard_real_sample sample = {0, (core_real)0.06, 0, true};
    guard_real_step(&guard_real, &sample);
    TEST_ASSERT_TRUE(guard_real.trip_value == sample.velocity_rad_per_s);
    setUp();
    sample.velocity_rad_per_s = (core_real)NAN;
    guard_real_step(&guard_real, &sample);
    TEST_ASSERT_TRUE(isnan(guard_real.trip_value));
}

/* Without limits only what is not a number trips. */
static void test_guard_real_without_limits_still_refuses_nan(void)
{
    static const struct guard_real_limits none = GUARD_REAL_LIMITS_NONE;
    struct guard_real_sample sample = {(core_real)1e30, (core_real)-1e30, (core_real)1e30, true};
    TEST_ASSERT_EQUAL_INT(core_ok, guard_real_init(&guard_real, &none));
    TEST_ASSERT_EQUAL_INT(core_ok, guard_real_arm(&guard_real, &sample));
    for (unsigned s = 0; s < 1000; s++)
        TEST_ASSERT_EQUAL_INT(guard_run, guard_real_step(&guard_real, &sample));
    sample.position_rad = (core_real)NAN;
    TEST_ASSERT_EQUAL_INT(guard_ramp_down, guard_real_step(&guard_real, &sample));
}

static void test_guard_without_limits_never_trips(void)
{
    static const struct guard_limits none = GUARD_LIMITS_NONE;
    static const int32_t extremes[] = {INT32_MIN, -1, 0, 1, INT32_MAX};
    struct guard_sample sample = {0, 0, 0, true};
    TEST_ASSERT_EQUAL_INT(core_ok, guard_init(&guard, &none));
    TEST_ASSERT_EQUAL_INT(core_ok, guard_arm(&guard, &sample));
    for (unsigned i = 0; i < 125; i++) {
        sample = (struct guard_sample){extremes[i % 5], extremes[i / 5 % 5], extremes[i / 25], true};
        TEST_ASSERT_EQUAL_INT(guard_run, guard_step(&guard, &sample));
    }
}

static void test_guard_watchdog_counts_samples_since_the_last_sign(void)
{
    for (unsigned round = 0; round < 3; round++) {
        for (unsigned s = 0; s < limits.watchdog_samples; s++) {
            struct guard_sample sample = inside();
            TEST_ASSERT_EQUAL_INT(guard_run, guard_step(&guard, &sample));
        }
        guard_alive(&guard.state);
        struct guard_sample sample = inside();
        TEST_ASSERT_EQUAL_INT(guard_run, guard_step(&guard, &sample));
    }
    for (unsigned s = 0; s < limits.watchdog_samples; s++) {
        struct guard_sample sample = inside();
        TEST_ASSERT_EQUAL_INT(guard_run, guard_step(&guard, &sample));
    }
    struct guard_sample sample = inside();
    TEST_ASSERT_EQUAL_INT(guard_ramp_down, guard_step(&guard, &sample));
    TEST_ASSERT_EQUAL_INT(guard_cause_watchdog, guard.state.cause);
    TEST_ASSERT_EQUAL_INT32((int32_t)limits.watchdog_samples + 1, guard.trip_value);
    /* too late: it stays latched */
    guard_alive(&guard.state);
    TEST_ASSERT_EQUAL_INT(guard_ramp_down, guard_step(&guard, &sample));
}

static bool trips_when_still(int32_t torque, unsigned samples, bool moves_once)
{
    bool tripped = false;
    for (unsigned s = 0; s < samples; s++) {
        struct guard_sample sample = {guard.last_position + (moves_once && s == 2 ? 1 : 0), 0, torque, true};
        guard_alive(&guard.state);
        tripped = guard_step(&guard, &sample) == guard_ramp_down;
    }
    return tripped;
}

static void test_guard_stuck_needs_torque_and_time(void)
{
    TEST_ASSERT_FALSE(trips_when_still(99, 100, false));
    TEST_ASSERT_FALSE(trips_when_still(-99, 100, false));
    TEST_ASSERT_FALSE(trips_when_still(100, 3, false));
    setUp();
    TEST_ASSERT_FALSE(trips_when_still(100, 6, true));
    setUp();
    TEST_ASSERT_TRUE(trips_when_still(100, 4, false));
    TEST_ASSERT_EQUAL_INT(guard_cause_stuck, guard.state.cause);
    TEST_ASSERT_EQUAL_INT32(100, guard.trip_value);
    setUp();
    TEST_ASSERT_TRUE(trips_when_still(-100, 4, false));
    setUp();
    TEST_ASSERT_TRUE(trips_when_still(INT32_MIN, 4, false));
}

/* Stuck is stuck wherever it happens, not only where the axis was armed. */
static void test_guard_stuck_is_seen_after_a_move(void)
{
    struct guard_sample sample = {777, 0, 100, true};
    for (unsigned s = 0; s < 4; s++) {
        guard_alive(&guard.state);
        TEST_ASSERT_EQUAL_INT(guard_run, guard_step(&guard, &sample));
    }
    TEST_ASSERT_EQUAL_INT(guard_ramp_down, guard_step(&guard, &sample));
    TEST_ASSERT_EQUAL_INT(guard_cause_stuck, guard.state.cause);
}

static void test_guard_armed_again_starts_both_clocks_anew(void)
{
    struct guard_sample sample = inside();
    for (unsigned s = 0; s <= limits.watchdog_samples; s++)
        guard_step(&guard, &sample);
    TEST_ASSERT_EQUAL_INT(guard_cause_watchdog, guard.state.cause);
    TEST_ASSERT_EQUAL_INT(core_ok, guard_arm(&guard, &sample));
    for (unsigned s = 0; s < limits.watchdog_samples; s++)
        TEST_ASSERT_EQUAL_INT(guard_run, guard_step(&guard, &sample));
    setUp();
    sample.position = guard.last_position;
    sample.torque = 100;
    for (unsigned round = 0; round < 3; round++) {
        for (unsigned s = 0; s < limits.stuck_samples - 1; s++)
            TEST_ASSERT_EQUAL_INT(guard_run, guard_step(&guard, &sample));
        TEST_ASSERT_EQUAL_INT(core_ok, guard_arm(&guard, &sample));
    }
}

static void test_guard_real_stuck_and_watchdog(void)
{
    struct guard_real_sample sample = {0, 0, (core_real)-0.1, true};
    TEST_ASSERT_EQUAL_INT(core_ok, guard_real_arm(&guard_real, &sample));
    for (unsigned s = 0; s < 3; s++)
        TEST_ASSERT_EQUAL_INT(guard_run, guard_real_step(&guard_real, &sample));
    TEST_ASSERT_EQUAL_INT(guard_ramp_down, guard_real_step(&guard_real, &sample));
    TEST_ASSERT_EQUAL_INT(guard_cause_stuck, guard_real.state.cause);
    TEST_ASSERT_TRUE(guard_real.trip_value == sample.torque_Nm);
    setUp();
    for (unsigned s = 0; s < 10; s++) {
        sample = real_inside();
        TEST_ASSERT_EQUAL_INT(guard_run, guard_real_step(&guard_real, &sample));
    }
    sample = real_inside();
    TEST_ASSERT_EQUAL_INT(guard_ramp_down, guard_real_step(&guard_real, &sample));
    TEST_ASSERT_EQUAL_INT(guard_cause_watchdog, guard_real.state.cause);
    TEST_ASSERT_TRUE(guard_real.trip_value == 11);
}

static void test_guard_torque_clip_is_a_limit_and_no_trip(void)
{
    TEST_ASSERT_EQUAL_INT32(300, guard_clip_torque(&guard, 300));
    TEST_ASSERT_EQUAL_INT32(-300, guard_clip_torque(&guard, -300));
    TEST_ASSERT_EQUAL_UINT32(0, guard.state.count.torque_clipped);
    TEST_ASSERT_EQUAL_INT32(300, guard_clip_torque(&guard, 301));
    TEST_ASSERT_EQUAL_INT32(-300, guard_clip_torque(&guard, -301));
    TEST_ASSERT_EQUAL_INT32(-300, guard_clip_torque(&guard, INT32_MIN));
    TEST_ASSERT_EQUAL_UINT32(3, guard.state.count.torque_clipped);
    TEST_ASSERT_EQUAL_INT(guard_armed, guard.state.mode);
    core_real limit = real_limits.torque_max_Nm;
    TEST_ASSERT_TRUE(guard_real_clip_torque(&guard_real, limit) == limit);
    TEST_ASSERT_EQUAL_UINT32(0, guard_real.state.count.torque_clipped);
    TEST_ASSERT_TRUE(guard_real_clip_torque(&guard_real, (core_real)INFINITY) == limit);
    TEST_ASSERT_TRUE(guard_real_clip_torque(&guard_real, -1) == -limit);
    TEST_ASSERT_TRUE(guard_real_clip_torque(&guard_real, (core_real)NAN) == 0);
    TEST_ASSERT_EQUAL_UINT32(3, guard_real.state.count.torque_clipped);
}

/* Every pair of state and event of the table in guard/guard.h. */
enum event { event_step_inside, event_step_outside, event_arm_inside, event_arm_outside };

static const struct {
    enum guard_mode before;
    enum event event;
    enum guard_mode after;
    bool ramps_or_refuses;
} transitions[] = {
    {guard_idle, event_step_inside, guard_idle, true},       {guard_idle, event_step_outside, guard_idle, true},
    {guard_idle, event_arm_inside, guard_armed, false},      {guard_idle, event_arm_outside, guard_idle, true},
    {guard_armed, event_step_inside, guard_armed, false},    {guard_armed, event_step_outside, guard_tripped, true},
    {guard_armed, event_arm_inside, guard_armed, false},     {guard_armed, event_arm_outside, guard_idle, true},
    {guard_tripped, event_step_inside, guard_tripped, true}, {guard_tripped, event_step_outside, guard_tripped, true},
    {guard_tripped, event_arm_inside, guard_armed, false},   {guard_tripped, event_arm_outside, guard_tripped, true},
};

static void bring_to(enum guard_mode mode)
{
    struct guard_sample good = inside(), bad = {5000, 0, 0, true};
    TEST_ASSERT_EQUAL_INT(core_ok, guard_init(&guard, &limits));
    if (mode != guard_idle)
        TEST_ASSERT_EQUAL_INT(core_ok, guard_arm(&guard, &good));
    if (mode == guard_tripped)
        guard_step(&guard, &bad);
    TEST_ASSERT_EQUAL_INT(mode, guard.state.mode);
}

static void test_guard_every_state_and_event(void)
{
    for (unsigned t = 0; t < sizeof transitions / sizeof transitions[0]; t++) {
        bring_to(transitions[t].before);
        bool is_inside = transitions[t].event == event_step_inside || transitions[t].event == event_arm_inside;
        struct guard_sample sample = inside();
        sample.velocity = is_inside ? 50 : 51;
        bool held;
        if (transitions[t].event <= event_step_outside)
            held = guard_step(&guard, &sample) == guard_ramp_down;
        else
            held = guard_arm(&guard, &sample) == core_err_guard_outside;
        TEST_ASSERT_EQUAL_INT(transitions[t].after, guard.state.mode);
        TEST_ASSERT_EQUAL_INT(transitions[t].ramps_or_refuses, held);
        if (transitions[t].before == guard_tripped && transitions[t].after == guard_tripped) {
            TEST_ASSERT_EQUAL_INT(guard_cause_travel, guard.state.cause);
            TEST_ASSERT_EQUAL_INT32(5000, guard.trip_value);
            TEST_ASSERT_EQUAL_UINT32(1, guard.state.count.trips);
        }
        if (transitions[t].after == guard_armed)
            TEST_ASSERT_EQUAL_INT(guard_cause_none, guard.state.cause);
    }
}

static void test_guard_refuses_to_arm_outside_or_blind(void)
{
    struct guard_sample blind = {0, 0, 0, false}, far = {2001, 0, 0, true};
    bring_to(guard_idle);
    TEST_ASSERT_EQUAL_INT(core_err_guard_outside, guard_arm(&guard, &blind));
    TEST_ASSERT_EQUAL_INT(core_err_guard_outside, guard_arm(&guard, &far));
    TEST_ASSERT_EQUAL_INT(core_err_argument, guard_arm(&guard, NULL));
    TEST_ASSERT_EQUAL_INT(core_err_argument, guard_arm(NULL, &far));
    struct guard_real_sample nowhere = {(core_real)NAN, 0, 0, true};
    TEST_ASSERT_EQUAL_INT(core_ok, guard_real_init(&guard_real, &real_limits));
    TEST_ASSERT_EQUAL_INT(core_err_guard_outside, guard_real_arm(&guard_real, &nowhere));
    TEST_ASSERT_EQUAL_INT(core_err_argument, guard_real_arm(&guard_real, NULL));
}

static void expect_init(struct guard_limits wrong, enum core_status expected)
{
    struct guard untouched;
    memset(&untouched, 0x5A, sizeof untouched);
    struct guard before = untouched;
    TEST_ASSERT_EQUAL_INT(expected, guard_init(&untouched, &wrong));
    TEST_ASSERT_EQUAL_MEMORY(&before, &untouched, sizeof before);
}

static void test_guard_init_refuses_impossible_limits(void)
{
    expect_init((struct guard_limits){5, 5, 50, 300, 0, 0, 0}, core_err_guard_travel);
    expect_init((struct guard_limits){6, 5, 50, 300, 0, 0, 0}, core_err_guard_travel);
    expect_init((struct guard_limits){0, 5, 0, 300, 0, 0, 0}, core_err_guard_velocity);
    expect_init((struct guard_limits){0, 5, INT32_MIN, 300, 0, 0, 0}, core_err_guard_velocity);
    expect_init((struct guard_limits){0, 5, 1, 0, 0, 0, 0}, core_err_guard_torque);
    expect_init((struct guard_limits){0, 5, 1, -1, 0, 0, 0}, core_err_guard_torque);
    expect_init((struct guard_limits){0, 5, 1, 1, 0, 1, 0}, core_err_guard_stuck);
    expect_init((struct guard_limits){0, 5, 1, 1, 0, 0, INT32_MIN}, core_err_guard_stuck);
    TEST_ASSERT_EQUAL_INT(core_err_argument, guard_init(NULL, &limits));
    TEST_ASSERT_EQUAL_INT(core_err_argument, guard_init(&guard, NULL));
}

static void test_guard_real_init_refuses_impossible_limits(void)
{
    for (unsigned field = 0; field < 5; field++) {
        struct guard_real_limits wrong = real_limits;
        core_real *const fields[5] = {&wrong.position_min_rad, &wrong.position_max_rad, &wrong.velocity_max_rad_per_s,
                                      &wrong.torque_max_Nm, &wrong.stuck_torque_Nm};
        static const enum core_status expected[5] = {core_err_guard_travel, core_err_guard_travel,
                                                     core_err_guard_velocity, core_err_guard_torque,
                                                     core_err_guard_stuck};
        *fields[field] = (core_real)NAN;
        TEST_ASSERT_EQUAL_INT(expected[field], guard_real_init(&guard_real, &wrong));
        *fields[field] = field == 0 ? 2 : field == 1 ? -1 : 0;
        TEST_ASSERT_EQUAL_INT(expected[field], guard_real_init(&guard_real, &wrong));
    }
    TEST_ASSERT_EQUAL_INT(core_err_argument, guard_real_init(NULL, &real_limits));
    TEST_ASSERT_EQUAL_INT(core_err_argument, guard_real_init(&guard_real, NULL));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_guard_limits_hold_to_one_count);
    RUN_TEST(test_guard_real_limits_hold_to_the_last_bit_and_nan_fails);
    RUN_TEST(test_guard_real_keeps_the_value_that_tripped);
    RUN_TEST(test_guard_real_without_limits_still_refuses_nan);
    RUN_TEST(test_guard_without_limits_never_trips);
    RUN_TEST(test_guard_watchdog_counts_samples_since_the_last_sign);
    RUN_TEST(test_guard_stuck_needs_torque_and_time);
    RUN_TEST(test_guard_stuck_is_seen_after_a_move);
    RUN_TEST(test_guard_armed_again_starts_both_clocks_anew);
    RUN_TEST(test_guard_real_stuck_and_watchdog);
    RUN_TEST(test_guard_torque_clip_is_a_limit_and_no_trip);
    RUN_TEST(test_guard_every_state_and_event);
    RUN_TEST(test_guard_refuses_to_arm_outside_or_blind);
    RUN_TEST(test_guard_init_refuses_impossible_limits);
    RUN_TEST(test_guard_real_init_refuses_impossible_limits);
    return UNITY_END();
}
