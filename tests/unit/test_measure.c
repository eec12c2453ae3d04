/* SPDX-License-Identifier: MIT */
#include "lab/measure/measure.h"

#include "core/bytes.h"
#include "core/crc32.h"
#include "tests/support/scratch.h"
#include "unity.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

static const double two_pi = 6.283185307179586476925;

enum { samples = 48, settle = 1, periods = 2, fade = 20, ramp = 12, start = 5, rows = (settle + periods) * samples };
enum { trace_max = 1400 };
/// Tables are float32: 24 bits of a value of at most 2.
static const double float_rounding = 5e-7;

/// A drive that follows at once, and fails on request.
struct fake_drive {
    struct drive_setpoint trace[trace_max];
    size_t exchanges;
    size_t fault_at;  ///< exchange that answers with a fault; 0: none
    size_t lost_from; ///< first and number of exchanges that are lost
    size_t lost_count;
    size_t interrupt_at; ///< exchange during which the user presses Ctrl-C
    size_t late_at;      ///< this exchange is late, and every tenth after it; 0: none
    size_t nan_at;
    size_t nan_reference_at;
    enum drive_status open_status, arm_status, stop_status;
    bool stopped;
    bool interrupt_while_opening; ///< the user presses Ctrl-C then
    bool armed;
    size_t setpoints_after_failure;
    bool failed;
    struct drive_counters counters;
};

static struct fake_drive fake;
static uint8_t table_storage[msgen_header_travel_bytes + 4 * 3 + 12 * samples];
static struct msgen_table table;
static volatile sig_atomic_t stop_flag;
static struct run run;
static struct measure_report report;
static struct error error;

static enum drive_status fake_open(void *self, const struct drive_configuration *configuration)
{
    (void)self;
    TEST_ASSERT_EQUAL_DOUBLE(1000.0, configuration->sample_rate_hz);
    if (fake.interrupt_while_opening) {
        stop_flag = 1;
    }
    return fake.open_status;
}

static enum drive_status fake_arm(void *self)
{
    (void)self;
    fake.armed = true;
    return fake.arm_status;
}

static enum drive_status fake_exchange(void *self, const struct drive_setpoint *setpoint,
                                       struct drive_sample *out_sample)
{
    (void)self;
    TEST_ASSERT_TRUE(fake.exchanges < trace_max);
    fake.trace[fake.exchanges++] = *setpoint;
    fake.setpoints_after_failure += fake.failed;
    size_t number = fake.exchanges;
    if (number == fake.fault_at) {
        fake.failed = true;
        return drive_err_fault;
    }
    fake.counters.samples_late += fake.late_at > 0 && number >= fake.late_at && (number - fake.late_at) % 10 == 0;
    if (number == fake.interrupt_at) {
        stop_flag = 1;
    }
    if (fake.lost_count > 0 && number >= fake.lost_from && number < fake.lost_from + fake.lost_count) {
        out_sample->valid = false;
        fake.counters.samples_lost++;
        return drive_ok;
    }
    *out_sample = (struct drive_sample){setpoint->torque_Nm, setpoint->torque_Nm, setpoint->position_rad,
                                        setpoint->velocity_rad_per_s, true};
    if (number == fake.nan_at) {
        out_sample->velocity_rad_per_s = NAN;
    }
    if (number == fake.nan_reference_at) {
        out_sample->torque_ref_Nm = NAN;
    }
    return drive_ok;
}

static enum drive_status fake_stop(void *self)
{
    (void)self;
    fake.stopped = true;
    return fake.stop_status;
}

static void fake_close(void *self)
{
    (void)self;
}

static const struct drive_counters *fake_counters(const void *self)
{
    (void)self;
    return &fake.counters;
}

static const char *fake_detail(const void *self)
{
    (void)self;
    return "code 0x7500";
}

static const struct drive_operations fake_operations = {fake_open,  fake_arm,      fake_exchange, fake_stop,
                                                        fake_close, fake_counters, fake_detail};
static const struct drive drive = {&fake_operations, &fake};

static double table_torque(size_t n)
{
    double t = two_pi * (double)n / samples;
    return cos(t) + 0.5 * cos(3.0 * t + 1.0) + 0.5 * cos(7.0 * t + 2.0);
}

static void make_table_that_travels(uint32_t channels, double travel_rad)
{
    struct msgen_table header = {.rate_num_hz = 1000,
                                 .rate_den = 1,
                                 .period_samples = samples,
                                 .bin_count = 3,
                                 .start_index = start,
                                 .channels = channels,
                                 .format = msgen_format_f32,
                                 .travel_q30 = (int64_t)(travel_rad * 1073741824.0)};
    union core_float_bits number = {.value = 1.0f};
    for (uint32_t c = 0; c < channels; c++) {
        header.scale_bits[c] = number.bits;
    }
    uint8_t *data = table_storage + msgen_table_header_bytes(&header);
    const uint32_t bins[3] = {1, 3, 7};
    for (size_t b = 0; b < 3; b++) {
        core_put_u32(data + 4 * b, bins[b]);
    }
    for (size_t n = 0; n < samples; n++) {
        for (size_t c = 0; c < channels; c++) {
            number.value = (float)(table_torque(n) * (c == 0 ? 1.0 : c == 1 ? 0.5 : 0.25));
            core_put_u32(data + 12 + 4 * (n * channels + c), number.bits);
        }
    }
    size_t size = 12 + 4 * samples * channels;
    header.data_crc32 = core_crc32(0, data, size);
    TEST_ASSERT_EQUAL_INT(core_ok, msgen_table_encode_header(&header, table_storage));
    size += msgen_table_header_bytes(&header);
    TEST_ASSERT_EQUAL_INT(core_ok, msgen_table_open(table_storage, size, &table));
}

static void make_table(uint32_t channels)
{
    make_table_that_travels(channels, 0.0);
}

static struct measure_plan make_plan(void)
{
    return (struct measure_plan){
        .table = &table,
        .mode = drive_mode_cascade,
        .settle_periods = settle,
        .periods = periods,
        .fade_samples = fade,
        .abort_samples = ramp,
        .limits = GUARD_REAL_LIMITS_NONE,
        .stop_requested = &stop_flag,
    };
}

static int measure(const struct measure_plan *plan)
{
    run_free(&run);
    return measure_run(&drive, plan, &run, &report, &error);
}

void setUp(void)
{
    memset(&fake, 0, sizeof fake);
    stop_flag = 0;
    scratch_empty();
    make_table(3);
}

void tearDown(void)
{
    run_free(&run);
}

/// The bound that measure.h states, from the table itself.
static void check_steps(size_t shortest_ramp)
{
    double step = 0.0;
    double peak = 0.0;
    for (size_t n = 0; n < samples; n++) {
        step = fmax(step, fabs(table_torque(n + 1) - table_torque(n)));
        peak = fmax(peak, fabs(table_torque(n)));
    }
    double bound = step + 1.5 * peak / (double)shortest_ramp + float_rounding;
    for (size_t i = 1; i < fake.exchanges; i++) {
        TEST_ASSERT_TRUE(fabs(fake.trace[i].torque_Nm - fake.trace[i - 1].torque_Nm) <= bound);
        TEST_ASSERT_TRUE(fabs(fake.trace[i].position_rad - fake.trace[i - 1].position_rad) <= 0.25 * bound);
    }
}

static void check_ends_at_zero(void)
{
    const struct drive_setpoint *last = &fake.trace[fake.exchanges - 1];
    TEST_ASSERT_EQUAL_DOUBLE(0.0, last->torque_Nm);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, last->velocity_rad_per_s);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, last->position_rad);
    TEST_ASSERT_TRUE(fake.stopped);
}

/// What is kept is the table from its start index, from the first row on.
static void check_rows_are_the_table(void)
{
    const double *torque = run_column(&run, "torque_Nm");
    const double *position_ref = run_column(&run, "position_ref_rad");
    const double *time_s = run_column(&run, "time_s");
    for (size_t n = 0; n < run.rows; n++) {
        TEST_ASSERT_DOUBLE_WITHIN(float_rounding, table_torque(start + n), torque[n]);
        TEST_ASSERT_DOUBLE_WITHIN(float_rounding, 0.25 * table_torque(start + n), position_ref[n]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.001 * (double)n, time_s[n]);
    }
}

static void check_file_is_whole(size_t expected_rows)
{
    struct run again;
    const char *path = scratch_path("run.csv");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, run_write(path, &run, &error), error.message);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, run_read(path, NULL, &again, &error), error.message);
    TEST_ASSERT_EQUAL_size_t(expected_rows, again.rows);
    TEST_ASSERT_EQUAL_size_t(run.periods, again.periods);
    run_free(&again);
}

static void test_measure_keeps_exactly_the_periods_of_a_complete_run(void)
{
    struct measure_plan plan = make_plan();
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, measure(&plan), error.message);
    TEST_ASSERT_EQUAL_INT(measure_complete, report.end);
    TEST_ASSERT_EQUAL_size_t(rows, run.rows);
    TEST_ASSERT_EQUAL_size_t(periods, run.periods);
    TEST_ASSERT_EQUAL_size_t(settle, run.settle_periods);
    TEST_ASSERT_EQUAL_size_t(samples, run.period_samples);
    TEST_ASSERT_EQUAL_size_t(3, run.bin_count);
    TEST_ASSERT_EQUAL_UINT32(7, run.bins[2]);
    TEST_ASSERT_EQUAL_HEX32(table.header_crc32, run.table_crc32);
    TEST_ASSERT_NULL(run_column(&run, "valid"));
    TEST_ASSERT_NULL(run_key(&run, "interrupted"));
    TEST_ASSERT_EQUAL_STRING("cascade", run_key(&run, "mode"));
    check_rows_are_the_table();
    check_steps(fade);
    check_ends_at_zero();
    check_file_is_whole(rows);
}

static void test_measure_marks_lost_samples(void)
{
    struct measure_plan plan = make_plan();
    fake.lost_from = 1 + 1 + fade + 30; /* arming takes one exchange: this is row 30 */
    fake.lost_count = 3;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, measure(&plan), error.message);
    const double *valid = run_column(&run, "valid");
    TEST_ASSERT_NOT_NULL(valid);
    for (size_t n = 0; n < rows; n++) {
        TEST_ASSERT_EQUAL_DOUBLE(n >= 30 && n < 33 ? 0.0 : 1.0, valid[n]);
    }
    TEST_ASSERT_EQUAL_size_t(3, report.rows_lost);
    TEST_ASSERT_EQUAL_STRING("3", run_key(&run, "samples_lost"));
    check_file_is_whole(rows);
}

static void test_measure_stops_when_too_many_samples_are_lost_in_a_row(void)
{
    struct measure_plan plan = make_plan();
    plan.lost_in_a_row_max = 5;
    fake.lost_from = 60;
    fake.lost_count = 1000;
    TEST_ASSERT_EQUAL_INT(error_refused, measure(&plan));
    TEST_ASSERT_EQUAL_INT(measure_tripped, report.end);
    TEST_ASSERT_NOT_NULL(strstr(run_key(&run, "stopped_by"), "6 in a row, allowed 5"));
    TEST_ASSERT_TRUE(report.rows_lost >= 5);
    check_steps(ramp);
    check_ends_at_zero();
    check_file_is_whole(run.rows);
}

static void test_measure_keeps_what_it_has_when_the_drive_faults_at_any_exchange(void)
{
    struct measure_plan plan = make_plan();
    for (size_t at = 1; at <= 1 + fade + rows + fade + 1; at++) {
        setUp();
        fake.fault_at = at;
        TEST_ASSERT_EQUAL_INT(error_refused, measure(&plan));
        TEST_ASSERT_EQUAL_INT(measure_failed, report.end);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "code 0x7500"), error.message);
        TEST_ASSERT_TRUE(fake.stopped);
        TEST_ASSERT_EQUAL_size_t(0, fake.setpoints_after_failure);
        size_t before = at > 2 + fade ? at - 2 - fade : 0;
        TEST_ASSERT_EQUAL_size_t(before < rows ? before : rows, run.rows);
        if (run.rows > 0) {
            TEST_ASSERT_EQUAL_STRING(error.message, run_key(&run, "stopped_by"));
            check_rows_are_the_table();
            check_file_is_whole(run.rows);
        }
    }
}

static void test_measure_ramps_to_zero_when_interrupted_at_any_exchange(void)
{
    struct measure_plan plan = make_plan();
    for (size_t at = 2; at <= 1 + fade + rows + fade; at++) {
        setUp();
        fake.interrupt_at = at;
        TEST_ASSERT_EQUAL_INT(error_refused, measure(&plan));
        TEST_ASSERT_EQUAL_INT(measure_interrupted, report.end);
        check_steps(ramp);
        check_ends_at_zero();
        /* The ramp itself and the last zero; a fade out already under way may be shorter. */
        TEST_ASSERT_TRUE(fake.exchanges <= at + ramp + 1);
        TEST_ASSERT_EQUAL_size_t(run.rows / samples, run.settle_periods + run.periods);
        if (run.rows > 0) {
            TEST_ASSERT_EQUAL_STRING("true", run_key(&run, "interrupted"));
            check_rows_are_the_table();
            check_file_is_whole(run.rows);
        }
    }
    TEST_ASSERT_EQUAL_size_t(rows, run.rows);
}

static void test_measure_ramps_to_zero_when_a_limit_trips(void)
{
    struct measure_plan plan = make_plan();
    plan.limits.position_max_rad = 0.3;
    TEST_ASSERT_EQUAL_INT(error_refused, measure(&plan));
    TEST_ASSERT_EQUAL_INT(measure_tripped, report.end);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(report.stopped_by, "travel limit: position 0.3"), report.stopped_by);
    check_steps(ramp);
    check_ends_at_zero();
    plan = make_plan();
    setUp();
    plan.limits.velocity_max_rad_per_s = 0.5;
    TEST_ASSERT_EQUAL_INT(error_refused, measure(&plan));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(report.stopped_by, "speed limit: velocity"), report.stopped_by);
    check_ends_at_zero();
}

static void test_measure_does_not_arm_when_interrupted_while_the_drive_is_opened(void)
{
    const struct measure_plan plan = make_plan();
    fake.interrupt_while_opening = true;
    TEST_ASSERT_EQUAL_INT(error_refused, measure(&plan));
    TEST_ASSERT_FALSE(fake.armed);
    TEST_ASSERT_EQUAL_size_t(0, fake.exchanges);
    TEST_ASSERT_EQUAL_size_t(0, run.rows);
    TEST_ASSERT_EQUAL_INT(measure_interrupted, report.end);
    TEST_ASSERT_NOT_NULL(strstr(error.message, "before the axis was armed"));
}

static void test_measure_stops_on_a_number_that_is_none_and_keeps_the_rest(void)
{
    struct measure_plan plan = make_plan();
    fake.nan_at = 100;
    TEST_ASSERT_EQUAL_INT(error_refused, measure(&plan));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(report.stopped_by, "not a number"), report.stopped_by);
    TEST_ASSERT_EQUAL_size_t(100 - 2 - fade, run.rows);
    check_ends_at_zero();
    check_file_is_whole(run.rows);
    setUp();
    fake.nan_reference_at = 70;
    TEST_ASSERT_EQUAL_INT(error_refused, measure(&plan));
    TEST_ASSERT_EQUAL_size_t(70 - 2 - fade, run.rows);
    check_file_is_whole(run.rows);
}

static void test_measure_says_why_the_drive_did_not_start(void)
{
    struct measure_plan plan = make_plan();
    fake.open_status = drive_err_identity;
    TEST_ASSERT_EQUAL_INT(error_refused, measure(&plan));
    TEST_ASSERT_NOT_NULL(strstr(error.message, "drive: open: what answers is not what the profile expects"));
    TEST_ASSERT_EQUAL_size_t(0, run.rows);
    TEST_ASSERT_EQUAL_size_t(0, fake.exchanges);
    setUp();
    fake.arm_status = drive_err_timeout;
    TEST_ASSERT_EQUAL_INT(error_refused, measure(&plan));
    TEST_ASSERT_NOT_NULL(strstr(error.message, "drive: arm: no answer in time"));
    TEST_ASSERT_TRUE(fake.stopped);
    setUp();
    fake.stop_status = drive_err_timeout;
    TEST_ASSERT_EQUAL_INT(error_refused, measure(&plan));
    TEST_ASSERT_NOT_NULL(strstr(error.message, "drive: stop"));
    TEST_ASSERT_EQUAL_size_t(rows, run.rows);
}

static void test_measure_refuses_plans_that_cannot_work(void)
{
    struct measure_plan plan = make_plan();
    plan.periods = 0;
    TEST_ASSERT_EQUAL_INT(error_usage, measure(&plan));
    plan = make_plan();
    plan.limits.torque_max_Nm = 1.0;
    TEST_ASSERT_EQUAL_INT(error_refused, measure(&plan));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "expected at most the limit of 1 Nm"), error.message);
    plan = make_plan();
    plan.limits.velocity_max_rad_per_s = NAN;
    TEST_ASSERT_EQUAL_INT(error_usage, measure(&plan));
    make_table(1);
    plan = make_plan();
    TEST_ASSERT_EQUAL_INT(error_refused, measure(&plan));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "1 of 3 channels"), error.message);
    TEST_ASSERT_EQUAL_size_t(0, fake.exchanges);
    plan.mode = drive_mode_torque;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, measure(&plan), error.message);
    TEST_ASSERT_NULL(run_column(&run, "position_ref_rad"));
}

static void test_measure_default_ramp_adds_at_most_the_tables_own_speed(void)
{
    uint32_t length = measure_ramp_samples(&table, drive_mode_cascade);
    TEST_ASSERT_EQUAL_UINT32(750, length); /* 1.5 * (1/4) / (1/2) s at 1 kHz */
    TEST_ASSERT_EQUAL_UINT32(50, measure_ramp_samples(&table, drive_mode_torque));
}

static const double travel = -3.0;

/// Set-points: at most the table's step, the ramp's and the speed's; at the end at rest.
static void check_travels(size_t shortest_ramp)
{
    double step = 0.0;
    double peak = 0.0;
    for (size_t n = 0; n < samples; n++) {
        step = fmax(step, 0.25 * fabs(table_torque(n + 1) - table_torque(n)));
        peak = fmax(peak, 0.25 * fabs(table_torque(n)));
    }
    double bound = step + 1.5 * peak / (double)shortest_ramp + fabs(travel) / samples + 10.0 * float_rounding;
    for (size_t i = 1; i < fake.exchanges; i++) {
        TEST_ASSERT_TRUE(fabs(fake.trace[i].position_rad - fake.trace[i - 1].position_rad) <= bound);
    }
    const struct drive_setpoint *last = &fake.trace[fake.exchanges - 1];
    TEST_ASSERT_EQUAL_DOUBLE(0.0, last->torque_Nm);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, last->velocity_rad_per_s);
    TEST_ASSERT_TRUE(fake.stopped);
}

static void test_measure_travels_and_rests_where_it_has_got_to(void)
{
    make_table_that_travels(3, travel);
    struct measure_plan plan = make_plan();
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, measure(&plan), error.message);
    const double *position_ref = run_column(&run, "position_ref_rad");
    const double *position = run_column(&run, "position_rad");
    const double fade_travel = travel * 0.5 * (fade - 1) / samples; /* the sum of s(t): its first sample is 0 */
    for (size_t n = 0; n < run.rows; n++) {
        double expected = 0.25 * table_torque(start + n) + fade_travel + travel * (double)n / samples;
        TEST_ASSERT_DOUBLE_WITHIN(1e-5, expected, position_ref[n]);
        TEST_ASSERT_EQUAL_DOUBLE(position_ref[n], position[n]);
        if (n >= samples) {
            TEST_ASSERT_DOUBLE_WITHIN(1e-5, travel, position_ref[n] - position_ref[n - samples]);
        }
    }
    check_travels(fade);
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, travel * (settle + periods + (double)(fade - 1) / samples),
                              fake.trace[fake.exchanges - 1].position_rad);
    check_file_is_whole(rows);
}

static void test_measure_that_travels_stops_at_rest_when_interrupted_at_any_exchange(void)
{
    struct measure_plan plan = make_plan();
    for (size_t at = 2; at <= 1 + fade + rows + fade; at++) {
        setUp();
        make_table_that_travels(3, travel);
        fake.interrupt_at = at;
        TEST_ASSERT_EQUAL_INT(error_refused, measure(&plan));
        TEST_ASSERT_EQUAL_INT(measure_interrupted, report.end);
        check_travels(ramp);
        /* Not further than where it was told to stop, half a ramp and what the table itself is away; and not back. */
        double told = fake.trace[at - 1].position_rad;
        double last = fake.trace[fake.exchanges - 1].position_rad;
        TEST_ASSERT_TRUE(fabs(last - told) <= 0.5 + fabs(travel) * (0.5 * ramp + 1.0) / samples);
        TEST_ASSERT_TRUE(fake.exchanges <= at + ramp + 1);
    }
}

static void test_measure_refuses_travel_that_cannot_work(void)
{
    make_table_that_travels(3, travel);
    struct measure_plan plan = make_plan();
    plan.mode = drive_mode_torque;
    TEST_ASSERT_EQUAL_INT(error_refused, measure(&plan));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "constant speed of -62.5 rad/s"), error.message);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "expected --mode cascade"), error.message);
    plan = make_plan();
    plan.limits.position_min_rad = -9.0; /* two periods, 20/48 of one for the ramps, and the table's own 0.4 rad fit */
    TEST_ASSERT_EQUAL_INT(error_refused, measure(&plan));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "which has room for 2 periods, settling ones included"),
                                 error.message);
    TEST_ASSERT_EQUAL_size_t(0, fake.exchanges);
    plan.periods = 1;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, measure(&plan), error.message);
    plan.limits.position_min_rad = -100.0;
    plan.limits.position_max_rad = 0.1; /* the table's own positive peak */
    TEST_ASSERT_EQUAL_INT(error_refused, measure(&plan));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "-100..0.1"), error.message);
}

static void test_measure_ramp_to_a_speed_takes_no_more_than_the_tables_acceleration(void)
{
    make_table_that_travels(3, 20.0); /* in 48 ms: far above the table's own speed */
    double step = 0.0;
    for (size_t n = 0; n < samples; n++) {
        step = fmax(step, 0.5 * fabs(table_torque(n + 1) - table_torque(n)));
    }
    double speed_rad_per_s = 20.0 / 0.048;
    double expected = ceil(1.5 * speed_rad_per_s / step);
    TEST_ASSERT_UINT32_WITHIN(1, (uint32_t)expected, measure_ramp_samples(&table, drive_mode_cascade));
    TEST_ASSERT_TRUE(expected > 750);
}

/// At 1 kHz; what is played before row 0 without a fade in, after the exchange that arms.
enum { dwell = 1000, lead = fade + dwell };

static struct measure_plan make_plan_without_fade_in(void)
{
    struct measure_plan plan = make_plan();
    plan.without_fade_in = true;
    return plan;
}

static double smooth(double t)
{
    return t * t * (3.0 - 2.0 * t);
}

static void test_measure_without_fade_in_stands_at_the_start_before_row_0(void)
{
    const double target = 0.25 * table_torque(start);
    struct measure_plan plan = make_plan_without_fade_in();
    TEST_ASSERT_EQUAL_DOUBLE(dwell / 1000.0, measure_dwell_s);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, measure(&plan), error.message);
    TEST_ASSERT_EQUAL_size_t(1 + lead + rows + fade + 1, fake.exchanges);
    for (size_t i = 0; i < lead; i++) {
        const struct drive_setpoint *sent = &fake.trace[1 + i];
        double factor = i < fade ? smooth((double)i / fade) : 1.0;
        TEST_ASSERT_EQUAL_DOUBLE(0.0, sent->torque_Nm);
        TEST_ASSERT_EQUAL_DOUBLE(0.0, sent->velocity_rad_per_s);
        TEST_ASSERT_DOUBLE_WITHIN(float_rounding, factor * target, sent->position_rad);
    }
    TEST_ASSERT_EQUAL_size_t(rows, run.rows);
    check_rows_are_the_table();
    check_ends_at_zero();
    check_file_is_whole(rows);
}

static void test_measure_approach_runs_back_when_interrupted_at_any_exchange(void)
{
    struct measure_plan plan = make_plan_without_fade_in();
    for (size_t at = 2; at <= 1 + lead; at++) {
        setUp();
        fake.interrupt_at = at;
        TEST_ASSERT_EQUAL_INT(error_refused, measure(&plan));
        TEST_ASSERT_EQUAL_INT(measure_interrupted, report.end);
        TEST_ASSERT_EQUAL_size_t(0, run.rows);
        check_steps(ramp);
        check_ends_at_zero();
        TEST_ASSERT_TRUE(fake.exchanges <= at + ramp + 1);
    }
}

static void test_measure_approach_is_guarded(void)
{
    struct measure_plan plan = make_plan_without_fade_in();
    const double target = 0.25 * table_torque(start);
    plan.limits.position_max_rad = fmax(0.5 * target, 1e-3);
    plan.limits.position_min_rad = fmin(0.5 * target, -1e-3);
    TEST_ASSERT_EQUAL_INT(error_refused, measure(&plan));
    TEST_ASSERT_EQUAL_INT(measure_tripped, report.end);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(report.stopped_by, "travel limit"), report.stopped_by);
    TEST_ASSERT_EQUAL_size_t(0, run.rows);
    TEST_ASSERT_TRUE(fake.exchanges <= 1 + fade + ramp + 1);
    check_steps(ramp);
    check_ends_at_zero();
}

static void test_measure_without_fade_in_has_nothing_to_approach_in_torque_mode(void)
{
    struct measure_plan plan = make_plan_without_fade_in();
    plan.mode = drive_mode_torque;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, measure(&plan), error.message);
    TEST_ASSERT_EQUAL_size_t(1 + rows + fade + 1, fake.exchanges);
    TEST_ASSERT_DOUBLE_WITHIN(float_rounding, table_torque(start), fake.trace[1].torque_Nm);
    TEST_ASSERT_DOUBLE_WITHIN(float_rounding, table_torque(start), run_column(&run, "torque_Nm")[0]);
    check_ends_at_zero();
}

static void test_measure_approach_of_a_table_that_travels_sets_off_with_it(void)
{
    make_table_that_travels(3, travel);
    struct measure_plan plan = make_plan_without_fade_in();
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, measure(&plan), error.message);
    check_travels(fade);
    for (size_t i = 1 + fade; i < 1 + lead; i++) {
        const double step = fake.trace[i + 1].position_rad - fake.trace[i].position_rad;
        TEST_ASSERT_DOUBLE_WITHIN(1e-4, travel * 1000.0 / samples, fake.trace[i].velocity_rad_per_s);
        TEST_ASSERT_DOUBLE_WITHIN(1e-5, travel / samples, step); /* up to row 0, which goes on from there */
    }
    /* The periods, the dwell, half of each ramp; the table's own range. */
    const double needed = fabs(travel) * (settle + periods + (double)(dwell + fade) / samples);
    plan.limits.position_max_rad = 1.0;
    plan.limits.position_min_rad = -(needed + 1.0);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, measure_check(&plan, &error), error.message);
    plan.limits.position_min_rad = -needed;
    TEST_ASSERT_EQUAL_INT(error_refused, measure_check(&plan, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "which has room for 2 periods"), error.message);
}

static void test_measure_notes_when_samples_came_late_but_not_those_of_the_fades(void)
{
    enum { arm = 1, first_late_row = -10 };
    const struct measure_plan plan = make_plan();
    fake.late_at = arm + fade + 1 + first_late_row;
    TEST_ASSERT_EQUAL_INT(0, measure(&plan));
    uint32_t late = 0;
    for (size_t i = 0; i < measure_parts; i++) {
        late += report.late_in_part[i];
    }
    TEST_ASSERT_EQUAL_UINT32((rows + 9) / 10, late);
    for (size_t row = 0; row < rows; row += 10) {
        TEST_ASSERT_EQUAL_UINT32(1, report.late_in_part[measure_part_of(row, rows)]);
    }
    TEST_ASSERT_TRUE(report.counters.samples_late > late);
}

int main(void)
{
    scratch_open();
    UNITY_BEGIN();
    RUN_TEST(test_measure_keeps_exactly_the_periods_of_a_complete_run);
    RUN_TEST(test_measure_marks_lost_samples);
    RUN_TEST(test_measure_stops_when_too_many_samples_are_lost_in_a_row);
    RUN_TEST(test_measure_keeps_what_it_has_when_the_drive_faults_at_any_exchange);
    RUN_TEST(test_measure_ramps_to_zero_when_interrupted_at_any_exchange);
    RUN_TEST(test_measure_does_not_arm_when_interrupted_while_the_drive_is_opened);
    RUN_TEST(test_measure_ramps_to_zero_when_a_limit_trips);
    RUN_TEST(test_measure_stops_on_a_number_that_is_none_and_keeps_the_rest);
    RUN_TEST(test_measure_says_why_the_drive_did_not_start);
    RUN_TEST(test_measure_refuses_plans_that_cannot_work);
    RUN_TEST(test_measure_default_ramp_adds_at_most_the_tables_own_speed);
    RUN_TEST(test_measure_travels_and_rests_where_it_has_got_to);
    RUN_TEST(test_measure_that_travels_stops_at_rest_when_interrupted_at_any_exchange);
    RUN_TEST(test_measure_refuses_travel_that_cannot_work);
    RUN_TEST(test_measure_ramp_to_a_speed_takes_no_more_than_the_tables_acceleration);
    RUN_TEST(test_measure_without_fade_in_stands_at_the_start_before_row_0);
    RUN_TEST(test_measure_approach_runs_back_when_interrupted_at_any_exchange);
    RUN_TEST(test_measure_approach_is_guarded);
    RUN_TEST(test_measure_without_fade_in_has_nothing_to_approach_in_torque_mode);
    RUN_TEST(test_measure_approach_of_a_table_that_travels_sets_off_with_it);
    RUN_TEST(test_measure_notes_when_samples_came_late_but_not_those_of_the_fades);
    int failures = UNITY_END();
    scratch_close();
    return failures;
}
