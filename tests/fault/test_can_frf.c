/* SPDX-License-Identifier: MIT */
/// What a measurement over CAN is worth when something goes wrong at one place, at every place: the frequency response
/// is the undisturbed one within its own uncertainty, or the measurement says that it is none. Lost samples are
/// counted, as many as were injected, and cost exactly the period they are in. All in memory, on a virtual clock.
/// A failing case is printed as kind, frame or SYNC, and byte; the same arguments to case_on_bus() or case_in_drive()
/// run it alone.
#include "lab/estimate/circle.h"
#include "lab/estimate/method.h"
#include "lab/estimate/periodic.h"
#include "lab/measure/measure.h"
#include "lab/measure/table_bytes.h"
#include "tests/support/can_bench.h"
#include "tests/support/rigid_table.h"
#include "tests/support/scratch.h"
#include "unity.h"

#include <complex.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

enum { length = 16, lines = 3, settle = 1, periods = 4, ramp = 12, rows = (settle + periods) * length };

/// Share of |G| by which a good response may be off, beside its own 95 % circle: three periods of 16 ms after a lost
/// set-point hold its transient, which the scatter of three periods shows only roughly.
static const double transient_share = 0.05;

static const double two_pi = 6.283185307179586;
static const double inertia_kgm2 = 0.00516;

static struct can_bench bench;
static struct sim_model model;
static struct table_bytes table;
static double complex clean[lines];
static uint32_t clean_frames, clean_first;
static char where[120];
static struct error error;

static void make_table(void)
{
    const struct rigid_table plan = {1000.0, length, lines, 0.1, inertia_kgm2, 0};
    rigid_table_make(&plan, &table);
}

void setUp(void)
{
    scratch_empty();
    sim_model_default(&model);
    memset(model.effect_on, 0, sizeof model.effect_on);
    memset(&model.sensors, 0, sizeof model.sensors);
    model.structure = sim_structure_rigid;
    model.motor_inertia_kgm2 = inertia_kgm2;
    model.load_inertia_kgm2 = model.coulomb_friction_Nm = 0.0;
    model.viscous_friction_Nms_per_rad = model.process_noise_Nm = 0.0;
    make_table();
}

void tearDown(void)
{
    table_bytes_free(&table);
}

struct outcome {
    int status;
    struct measure_report report;
    bool estimated;      ///< there is a response
    size_t lost_periods; ///< that it left out
    size_t invalid_lines;
    double worst;        ///< largest error over what is allowed, valid lines
    size_t rows_lost_in; ///< counted periods with a lost row
};

static size_t periods_with_loss(const struct run *run)
{
    const double *valid = run_column(run, "valid");
    size_t count = 0;
    for (size_t p = settle; valid && p < run->rows / length; p++) {
        bool lost = false;
        for (size_t n = 0; n < length; n++)
            lost = lost || !(valid[p * length + n] > 0.0);
        count += lost;
    }
    return count;
}

static void estimate(const struct run *run, struct outcome *io_outcome, double complex *out_response)
{
    struct periodic recording;
    struct frf frf;
    if (periodic_cut(run, &(struct periodic_options){0}, &recording, &error))
        return;
    io_outcome->lost_periods = recording.lost;
    if (estimate_method_find("mean", &error)->estimate(&recording, NULL, &frf, &error)) {
        periodic_free(&recording);
        return;
    }
    io_outcome->estimated = true;
    double factor = circle_confidence_factor(0.95, frf.degrees_of_freedom / 2.0);
    for (size_t line = 0; line < frf.count; line++) {
        double complex value = frf.real[line] + frf.imag[line] * I;
        if (out_response)
            out_response[line] = value;
        io_outcome->invalid_lines += !frf.valid[line];
        double allowed = factor * frf.std[line] + transient_share * cabs(clean[line]);
        if (frf.valid[line] && !out_response)
            io_outcome->worst = fmax(io_outcome->worst, cabs(value - clean[line]) / allowed);
    }
    frf_free(&frf);
    periodic_free(&recording);
}

static struct measure_plan plan_of(void)
{
    struct measure_plan plan = {
        .table = &table.view,
        .mode = drive_mode_cascade,
        .settle_periods = settle,
        .periods = periods,
        .fade_samples = ramp,
        .abort_samples = ramp,
        .limits = GUARD_REAL_LIMITS_NONE,
        .following_error_rad = 0.01,
    };
    plan.limits.torque_max_Nm = (core_real)2.0;
    plan.limits.velocity_max_rad_per_s = (core_real)3.0;
    plan.limits.position_min_rad = (core_real)-0.1;
    plan.limits.position_max_rad = (core_real)0.1;
    plan.limits.stuck_torque_Nm = (core_real)0.02; // of 0.1 Nm per line: three samples without a count are no turn
    plan.limits.stuck_samples = 3;
    return plan;
}

static void open_bench(void)
{
    can_bench_init(&bench, &model, 1000000);
}

static struct outcome measure(double complex *out_response)
{
    struct outcome out = {0};
    struct run run;
    const struct measure_plan plan = plan_of();
    out.status = measure_run(&bench.drive, &plan, &run, &out.report, &error);
    bench.drive.operations->close(bench.drive.self);
    if (run.rows > 0) {
        out.rows_lost_in = periods_with_loss(&run);
        estimate(&run, &out, out_response);
        run_free(&run);
    }
    return out;
}

/// What holds whatever was injected.
static void check(const struct outcome *out)
{
    bool flagged = out->status != 0 || !out->estimated || out->invalid_lines > 0;
    if (!flagged && !(out->worst <= 1.0)) {
        char text[200];
        snprintf(text, sizeof text, "%s: an unflagged response is off by %.2f of what it allows", where, out->worst);
        TEST_FAIL_MESSAGE(text);
    }
    if (out->status != 0)
        TEST_ASSERT_NOT_EQUAL_MESSAGE('\0', out->report.stopped_by[0], where);
    else
        TEST_ASSERT_EQUAL_size_t_MESSAGE(rows, out->report.rows, where);
    if (out->estimated)
        TEST_ASSERT_EQUAL_size_t_MESSAGE(out->rows_lost_in, out->lost_periods, where);
    TEST_ASSERT_TRUE_MESSAGE(out->report.rows_lost <= out->report.counters.samples_lost, where);
    inproc_bus_run(&bench.bus, bench.bus.now_ns / 1000 + 600000);
    TEST_ASSERT_FALSE_MESSAGE(cia402_machine_is_powered(&bench.node.machine), where);
    TEST_ASSERT_TRUE_MESSAGE(bench.node.sample.torque_ref == 0.0, where);
}

static void measure_clean(void)
{
    snprintf(where, sizeof where, "clean");
    open_bench();
    struct outcome out = measure(clean);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, out.status, error.message);
    TEST_ASSERT_TRUE(out.estimated);
    TEST_ASSERT_EQUAL_size_t(0, out.invalid_lines);
    TEST_ASSERT_EQUAL_UINT32(0, out.report.counters.samples_lost);
    TEST_ASSERT_EQUAL_UINT32(0, out.report.counters.samples_late);
    TEST_ASSERT_EQUAL_UINT32(0, out.report.counters.emergencies);
    for (size_t line = 0; line < lines; line++) {
        double complex truth = 0.001 / inertia_kgm2 / (cexp(I * two_pi * (double)(line + 1) / length) - 1.0);
        const double close = 0.03; // transient of one settling period of 16 ms, and half permille of rated torque
        TEST_ASSERT_TRUE(cabs(clean[line] - truth) <= close * cabs(truth));
    }
    clean_frames = bench.bus.counters.frames;
    // Setting up is the business of test_can_faults.c: here from its last tenth on.
    clean_first = clean_frames - (uint32_t)(5 * (rows + 2 * ramp) + 40);
}

static struct outcome case_on_bus(enum inproc_fault_kind kind, uint32_t nth, uint32_t delay_us, uint8_t byte,
                                  uint8_t endpoint)
{
    static struct inproc_fault fault;
    fault = (struct inproc_fault){kind, inproc_any, nth, delay_us, byte, 0x10, endpoint};
    snprintf(where, sizeof where, "case_on_bus(%d, %lu, %lu, %u, %u)", (int)kind, (unsigned long)nth,
             (unsigned long)delay_us, byte, endpoint);
    open_bench();
    inproc_bus_set_faults(&bench.bus, &fault, 1);
    struct outcome out = measure(NULL);
    check(&out);
    return out;
}

static void test_can_frf_one_bus_fault_anywhere_never_gives_a_wrong_response(void)
{
    measure_clean();
    static const struct {
        enum inproc_fault_kind kind;
        uint32_t delay_us;
        uint8_t byte, endpoint;
    } plans[] = {
        {inproc_drop, 0, 0, 0},
        {inproc_duplicate, 0, 0, 0},
        {inproc_delay, 700, 0, 0},
        {inproc_delay, 2500, 0, 0},
        {inproc_swap, 0, 0, 0},
        {inproc_corrupt, 0, 0, 0},
        {inproc_corrupt, 0, 2, 0},
        {inproc_corrupt, 0, 5, 0},
        {inproc_shorten, 0, 0, 0},
        {inproc_bus_error, 0, 0, 0},
        {inproc_bus_off, 0, 0, bench_node_endpoint},
        {inproc_bus_off, 3000, 0, bench_node_endpoint},
        {inproc_bus_off, 0, 0, bench_master_endpoint},
    };
    unsigned runs = 0, complete = 0, losing = 0;
    double worst = 0.0;
    for (size_t p = 0; p < sizeof plans / sizeof plans[0]; p++)
        for (uint32_t nth = clean_first; nth <= clean_frames; nth++) {
            struct outcome out = case_on_bus(plans[p].kind, nth, plans[p].delay_us, plans[p].byte, plans[p].endpoint);
            runs++;
            complete += out.status == 0;
            losing += out.lost_periods > 0;
            worst = out.status == 0 ? fmax(worst, out.worst) : worst;
        }
    printf("%u runs with one fault on the bus: %u complete, %u of them without a period that lost a sample; worst "
           "response at %.2f of what it allows\n",
           runs, complete, losing, worst);
    TEST_ASSERT_TRUE(losing > 0);
}

/// Where the clean run has SYNC-borne sample n of the table: drops of exactly one TPDO are one lost sample in one known
/// period.
static void test_can_frf_every_lost_sample_is_counted_where_it_was(void)
{
    measure_clean();
    for (uint32_t nth = 1; nth <= settle * length + periods * length; nth++) {
        static struct inproc_fault fault;
        open_bench();
        // TPDO1 of exchange nth + ramp; switching on takes the first few.
        fault = (struct inproc_fault){inproc_drop, 0x185, nth + ramp + 8, 0, 0, 0, 0};
        inproc_bus_set_faults(&bench.bus, &fault, 1);
        snprintf(where, sizeof where, "TPDO1 number %u dropped", (unsigned)fault.nth);
        struct outcome out = measure(NULL);
        check(&out);
        TEST_ASSERT_EQUAL_INT_MESSAGE(0, out.status, where);
        TEST_ASSERT_EQUAL_UINT32_MESSAGE(1, bench.bus.counters.injected[inproc_drop], where);
        TEST_ASSERT_EQUAL_UINT32_MESSAGE(1, out.report.counters.samples_lost, where);
        TEST_ASSERT_TRUE_MESSAGE(out.rows_lost_in <= 1, where);
    }
}

static struct outcome case_in_drive(enum simulated_fault_kind kind, uint32_t sync, uint32_t count)
{
    static struct simulated_fault fault;
    fault = (struct simulated_fault){kind, sync, count};
    snprintf(where, sizeof where, "case_in_drive(%d, %lu, %lu)", (int)kind, (unsigned long)sync, (unsigned long)count);
    open_bench();
    simulated_drive_set_faults(&bench.node, &fault, 1);
    struct outcome out = measure(NULL);
    check(&out);
    TEST_ASSERT_EQUAL_UINT32_MESSAGE(1, bench.node.injected[kind], where);
    return out;
}

static void test_can_frf_one_fault_in_the_drive_at_every_sample_never_gives_a_wrong_response(void)
{
    measure_clean();
    static const uint32_t durations[] = {1, 4, 0};
    unsigned runs = 0, complete = 0;
    for (int kind = 0; kind < simulated_fault_kinds; kind++)
        for (size_t d = 0; d < 3; d++)
            for (uint32_t sync = 1; sync <= rows + 2 * ramp; sync++) {
                struct outcome out = case_in_drive((enum simulated_fault_kind)kind, sync, durations[d]);
                runs++;
                complete += out.status == 0;
                bool for_ever = durations[d] == 0 && sync + 2 * length < rows + ramp;
                // A reversed encoder takes its time to run away; the uncertainty of the response grows with it.
                bool in_time = kind == simulated_fault_encoder_stuck || kind == simulated_fault_silent;
                bool ends_it = kind == simulated_fault_reset || kind == simulated_fault_encoder_dead ||
                               kind == simulated_fault_sync_missed || (for_ever && in_time);
                if (ends_it && sync + 8 < rows + 2 * ramp)
                    TEST_ASSERT_NOT_EQUAL_MESSAGE(0, out.status, where);
            }
    printf("%u runs with one fault in the drive: %u complete\n", runs, complete);
}

/// A heartbeat that stops is seen within its time-out of 300 ms, however good the samples look.
static void test_can_frf_stopped_heartbeat_ends_the_measurement(void)
{
    struct measure_plan plan = plan_of();
    static struct simulated_fault fault = {simulated_fault_heartbeat_stops, 30, 0};
    struct run run;
    struct measure_report report;
    plan.periods = 40; // 640 ms
    open_bench();
    simulated_drive_set_faults(&bench.node, &fault, 1);
    TEST_ASSERT_NOT_EQUAL(0, measure_run(&bench.drive, &plan, &run, &report, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(report.stopped_by, "heartbeat"), report.stopped_by);
    TEST_ASSERT_TRUE(report.rows >= 280 && report.rows <= 420);
    run_free(&run);
}

static void test_can_frf_end_stop_and_drift_end_the_measurement(void)
{
    measure_clean();
    model.has_end_stops = true;
    model.end_stops_rad[0] = -0.1;
    model.end_stops_rad[1] = 1e-4;
    snprintf(where, sizeof where, "end stop");
    open_bench();
    struct outcome out = measure(NULL);
    check(&out);
    TEST_ASSERT_NOT_EQUAL(0, out.status);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(out.report.stopped_by, "8612"), out.report.stopped_by);
    model.has_end_stops = false;
    static const double drifts_ppm[] = {-300000.0, -100000.0, -100.0, 100.0, 100000.0, 300000.0};
    for (size_t i = 0; i < 6; i++) {
        snprintf(where, sizeof where, "clock off by %g ppm", drifts_ppm[i]);
        open_bench();
        simulated_drive_set_drift(&bench.node, drifts_ppm[i]);
        out = measure(NULL);
        check(&out);
        TEST_ASSERT_EQUAL_MESSAGE(fabs(drifts_ppm[i]) < 250000.0, out.status == 0, where);
    }
}

/// Sampling later than SYNC and answering later still changes nothing that is measured, as long as it fits the period.
static void test_can_frf_constant_delays_in_the_drive_change_nothing(void)
{
    measure_clean();
    snprintf(where, sizeof where, "delays");
    open_bench();
    simulated_drive_set_delays(&bench.node, 100, 150);
    double complex delayed[lines];
    struct outcome out = measure(delayed);
    TEST_ASSERT_EQUAL_INT(0, out.status);
    for (size_t line = 0; line < lines; line++)
        TEST_ASSERT_TRUE(cabs(delayed[line] - clean[line]) <= 0.0);
    open_bench();
    simulated_drive_set_delays(&bench.node, 500, 600); // the next SYNC comes first
    out = measure(NULL);
    check(&out);
    TEST_ASSERT_NOT_EQUAL(0, out.status);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_can_frf_one_bus_fault_anywhere_never_gives_a_wrong_response);
    RUN_TEST(test_can_frf_every_lost_sample_is_counted_where_it_was);
    RUN_TEST(test_can_frf_one_fault_in_the_drive_at_every_sample_never_gives_a_wrong_response);
    RUN_TEST(test_can_frf_stopped_heartbeat_ends_the_measurement);
    RUN_TEST(test_can_frf_end_stop_and_drift_end_the_measurement);
    RUN_TEST(test_can_frf_constant_delays_in_the_drive_change_nothing);
    return UNITY_END();
}
