/* SPDX-License-Identifier: MIT */
#include "lab/measure/measure.h"

#include "core/fixed.h"
#include "lab/measure/recorder.h"
#include "lab/measure/table_value.h"
#include "msgen/player.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const double measure_dwell_s = 1.0;
static const double shortest_ramp_s = 0.05;
static const double longest_ramp_s = 10.0;
enum { default_lost_in_a_row = 20 };
/// Room for friction and for the controllers above the table's own torque where nobody has set a limit.
static const double default_torque_margin = 3.0;

size_t measure_part_of(size_t row, size_t rows_planned)
{
    return (size_t)((double)row / (double)rows_planned * (double)measure_parts);
}

/// What the position gains in each period, rad or m.
static double travel_of(const struct msgen_table *table)
{
    return table->travel_q30
               ? (double)table->travel_q30 / CORE_Q30_ONE * table_value_scale(table, msgen_channel_position)
               : 0.0;
}

/// Shortest ramp to the table's mean speed that its own top acceleration would do.
static double travel_ramp_s(const struct msgen_table *table)
{
    double step = 0.0;
    for (uint32_t n = 0; n < table->period_samples; n++) {
        uint32_t next = n + 1 < table->period_samples ? n + 1 : 0;
        step = fmax(step, fabs(table_value_at(table, next, msgen_channel_velocity) -
                               table_value_at(table, n, msgen_channel_velocity)));
    }
    double acceleration = step * table_value_rate_hz(table);
    double speed = fabs(travel_of(table)) * table_value_rate_hz(table) / (double)table->period_samples;
    return acceleration > 0.0 ? 1.5 * speed / acceleration : 0.0;
}

uint32_t measure_ramp_samples(const struct msgen_table *table, enum drive_mode mode)
{
    double ramp_s = shortest_ramp_s;
    if (mode == drive_mode_cascade && table->channels == msgen_channels_max) {
        double velocity = table_value_peak(table, msgen_channel_velocity);
        double position = table_value_peak(table, msgen_channel_position);
        ramp_s = velocity > 0.0 ? fmax(ramp_s, 1.5 * position / velocity) : ramp_s;
        ramp_s = table->travel_q30 ? fmax(ramp_s, travel_ramp_s(table)) : ramp_s;
    }
    return (uint32_t)ceil(fmin(ramp_s, longest_ramp_s) * table_value_rate_hz(table));
}

/// What the player's ramps may be at most, and at least one sample.
static uint32_t ramp_or_default(const struct measure_plan *plan, uint32_t wanted)
{
    uint32_t samples = wanted ? wanted : measure_ramp_samples(plan->table, plan->mode);
    return samples < msgen_ramp_samples_max ? samples : msgen_ramp_samples_max;
}

static uint32_t dwell_samples(const struct msgen_table *table)
{
    return (uint32_t)fmin(ceil(measure_dwell_s * table_value_rate_hz(table)), msgen_ramp_samples_max);
}

static struct msgen_player_config player_config(const struct measure_plan *plan)
{
    const uint32_t fade = ramp_or_default(plan, plan->fade_samples);
    const bool approach = plan->without_fade_in && plan->mode == drive_mode_cascade;
    return (struct msgen_player_config){
        .periods = plan->settle_periods + plan->periods,
        .fade_in_samples = plan->without_fade_in ? 0 : fade,
        .approach_samples = approach ? fade : 0,
        .dwell_samples = approach ? dwell_samples(plan->table) : 0,
        .fade_out_samples = fade,
        .abort_samples = ramp_or_default(plan, plan->abort_samples),
    };
}

/// What is played beside the periods of a complete run.
static size_t lead_and_fade_out(const struct msgen_player_config *config)
{
    return (size_t)config->fade_in_samples + config->approach_samples + config->dwell_samples +
           config->fade_out_samples;
}

struct range {
    double low, high;
};

static struct range position_range(const struct msgen_table *table)
{
    struct range range = {0.0, 0.0}; // where the axis stands before and after
    for (uint32_t n = 0; n < table->period_samples; n++) {
        double position = table_value_at(table, n, msgen_channel_position);
        range.low = fmin(range.low, position);
        range.high = fmax(range.high, position);
    }
    return range;
}

/// Where a travelling position gets to: the table's own range, moved by the travel of all periods, of a dwell and of
/// both ramps, which count half each.
static int check_travel_range(const struct measure_plan *plan, struct error *out_error)
{
    const struct msgen_table *table = plan->table;
    const struct guard_real_limits *limits = &plan->limits;
    const char *unit = table->linear ? "m" : "rad";
    double travel = travel_of(table);
    const struct msgen_player_config config = player_config(plan);
    double ramps = 0.5 * (double)(lead_and_fade_out(&config) + config.dwell_samples) / (double)table->period_samples;
    double periods = (double)plan->settle_periods + (double)plan->periods;
    struct range range = position_range(table);
    double room = travel > 0.0 ? limits->position_max_rad - range.high : range.low - limits->position_min_rad;
    double accepted = fmax(0.0, floor(room / fabs(travel) - ramps));
    double counts = (periods + ramps) * fabs(travel) + fmax(range.high, -range.low);
    double counts_max = (double)INT32_MAX * table_value_scale(table, msgen_channel_position);
    range.low += fmin(0.0, travel * (periods + ramps));
    range.high += fmax(0.0, travel * (periods + ramps));
    if (!(range.low >= limits->position_min_rad && range.high <= limits->position_max_rad)) {
        return error_set(out_error, error_refused,
                         "the table travels %.6g %s in each period, and %.0f periods with their ramps need positions "
                         "from %.6g to %.6g %s: expected within %.6g..%.6g, which has room for %.0f periods, settling "
                         "ones included",
                         travel, unit, periods, range.low, range.high, unit, (double)limits->position_min_rad,
                         (double)limits->position_max_rad, accepted);
    }
    if (table->format != msgen_format_f32 && !(counts <= counts_max)) {
        return error_set(out_error, error_refused,
                         "%.0f periods travel %.6g %s: expected at most %.6g %s, which the table's counts hold",
                         periods, counts, unit, counts_max, unit);
    }
    return 0;
}

static int check_travel(const struct measure_plan *plan, struct error *out_error)
{
    const struct msgen_table *table = plan->table;
    if (table->travel_q30 == 0) {
        return 0;
    }
    if (plan->mode == drive_mode_torque) {
        return error_set(out_error, error_refused,
                         "the table moves at a constant speed of %.6g %s under its multisine, which torque mode cannot "
                         "hold: expected --mode cascade, or a table without bias velocity",
                         travel_of(table) * table_value_rate_hz(table) / (double)table->period_samples,
                         table->linear ? "m/s" : "rad/s");
    }
    return check_travel_range(plan, out_error);
}

int measure_check(const struct measure_plan *plan, struct error *out_error)
{
    const struct msgen_table *table = plan->table;
    if (plan->periods == 0) {
        return error_set(out_error, error_usage, "0 periods to measure: expected at least 1");
    }
    if (plan->mode == drive_mode_cascade && table->channels < msgen_channels_max) {
        return error_set(
            out_error, error_refused,
            "the table has %u of 3 channels: the cascade needs torque, velocity and position (measure with --mode "
            "torque, or design the table for the cascade)",
            (unsigned)table->channels);
    }
    uint64_t rows = ((uint64_t)plan->settle_periods + plan->periods) * table->period_samples;
    if ((uint64_t)plan->settle_periods + plan->periods > UINT32_MAX || rows > SIZE_MAX / sizeof(double)) {
        return error_set(out_error, error_usage, "%llu periods of %u samples are more than memory holds",
                         (unsigned long long)plan->settle_periods + plan->periods, (unsigned)table->period_samples);
    }
    struct guard_real guard;
    enum core_status status = guard_real_init(&guard, &plan->limits);
    if (status != core_ok) {
        return error_set(out_error, error_usage, "limits: %s", core_status_str(status));
    }
    double torque = table_value_peak(table, msgen_channel_torque);
    if (torque > plan->limits.torque_max_Nm) {
        return error_set(
            out_error, error_refused,
            "the table's torque goes to %.6g %s: expected at most the limit of %.6g %s, or clipping would falsify "
            "the excitation",
            torque, table->linear ? "N" : "Nm", plan->limits.torque_max_Nm, table->linear ? "N" : "Nm");
    }
    return check_travel(plan, out_error);
}

struct loop {
    const struct drive *drive;
    const struct measure_plan *plan;
    struct msgen_player player;
    struct guard_real guard;
    struct recorder recorder;
    struct drive_sample sample; ///< the last one
    bool stopping;              ///< the ramp down has begun: nothing more is kept
    uint32_t late_before;       ///< samples_late up to the row before
    struct measure_report *report;
};

static void note_end(struct loop *self, enum measure_end end, const char *why)
{
    if (self->report->end == measure_complete) {
        self->report->end = end;
        snprintf(self->report->stopped_by, sizeof self->report->stopped_by, "%s", why);
    }
    self->stopping = true;
}

static int note_drive_failure(struct loop *self, const char *doing, enum drive_status status, struct error *out_error)
{
    char why[sizeof self->report->stopped_by];
    const struct drive_operations *operations = self->drive->operations;
    snprintf(why, sizeof why, "drive: %s: %s (%s)", doing, drive_status_str(status),
             operations->detail(self->drive->self));
    note_end(self, measure_failed, why);
    return error_set(out_error, error_refused, "%s", why);
}

static void describe_trip(const struct guard_real *guard, bool linear, char *out_text, size_t size)
{
    const struct guard_real_limits *limits = &guard->limits;
    double value = guard->trip_value;
    switch (guard->state.cause) {
    case guard_cause_travel:
        snprintf(out_text, size, "travel limit: position %.6g %s, allowed %.6g..%.6g", value, linear ? "m" : "rad",
                 (double)limits->position_min_rad, (double)limits->position_max_rad);
        return;
    case guard_cause_speed:
        snprintf(out_text, size, "speed limit: velocity %.6g %s, allowed %.6g", value, linear ? "m/s" : "rad/s",
                 (double)limits->velocity_max_rad_per_s);
        return;
    case guard_cause_watchdog:
        snprintf(out_text, size, "lost samples: %.0f in a row, allowed %u", value, (unsigned)limits->watchdog_samples);
        return;
    case guard_cause_stuck:
        snprintf(out_text, size, "stuck: the axis does not move under %.6g %s", value, linear ? "N" : "Nm");
        return;
    case guard_cause_sensor:
    case guard_cause_none:
        break;
    }
    snprintf(out_text, size, "sensor: a measured value is not a number (%g)", value);
}

/// A lost sample holds the last known values: it is not judged again, but it is no sign of life either.
static void watch(struct loop *self)
{
    if (self->sample.valid) {
        guard_alive(&self->guard.state);
    }
    struct guard_real_sample seen = {self->sample.position_rad, self->sample.velocity_rad_per_s, self->sample.torque_Nm,
                                     isfinite(self->sample.torque_ref_Nm)};
    if (guard_real_step(&self->guard, &seen) == guard_ramp_down && !self->stopping) {
        char why[sizeof self->report->stopped_by];
        describe_trip(&self->guard, self->plan->table->linear, why, sizeof why);
        note_end(self, measure_tripped, why);
    }
    if (self->plan->stop_requested && *self->plan->stop_requested && !self->stopping) {
        note_end(self, measure_interrupted, "interrupted by the user");
    }
    if (self->stopping) {
        msgen_player_abort(&self->player);
    }
}

static struct msgen_player_state next_setpoint(struct loop *self, struct drive_setpoint *out_setpoint)
{
    const struct msgen_table *table = self->plan->table;
    double values[msgen_channels_max] = {0.0, 0.0, 0.0};
    struct msgen_player_state state;
    if (table->format == msgen_format_f32) {
        float samples[msgen_channels_max] = {0.0f, 0.0f, 0.0f};
        state = msgen_player_step_f32(&self->player, samples);
        for (uint32_t c = 0; c < table->channels; c++) {
            values[c] = (double)samples[c] * table_value_scale(table, c);
        }
    } else {
        int32_t samples[msgen_channels_max] = {0, 0, 0};
        state = msgen_player_step(&self->player, samples);
        for (uint32_t c = 0; c < table->channels; c++) {
            values[c] = (double)samples[c] * table_value_scale(table, c);
        }
    }
    out_setpoint->torque_Nm = guard_real_clip_torque(&self->guard, values[msgen_channel_torque]);
    out_setpoint->velocity_rad_per_s = values[msgen_channel_velocity];
    out_setpoint->position_rad = values[msgen_channel_position];
    return state;
}

/// Sends one set-point and takes one sample; non-zero if the drive has failed.
static int exchange(struct loop *self, const struct drive_setpoint *setpoint, struct error *out_error)
{
    enum drive_status status = self->drive->operations->exchange(self->drive->self, setpoint, &self->sample);
    return status == drive_ok ? 0 : note_drive_failure(self, "exchange", status, out_error);
}

static uint32_t count_late(const struct loop *self)
{
    const struct drive_counters *counters = self->drive->operations->counters(self->drive->self);
    return counters ? counters->samples_late : 0;
}

/// Counts what was late since the sample before, in the part of the run that its row belongs to.
static void note_late(struct loop *self, bool kept, uint32_t late)
{
    if (kept && late != self->late_before) {
        self->report->late_in_part[measure_part_of(self->recorder.rows, self->report->rows_planned)] +=
            late - self->late_before;
    }
    self->late_before = late;
}

/// Until the player is done; the last set-point, sent when it is, is rest at the position reached.
static int play(struct loop *self, struct error *out_error)
{
    if (self->plan->live) {
        atomic_store(&self->plan->live->total, self->report->rows_planned + lead_and_fade_out(&self->player.config));
    }
    for (;;) {
        struct drive_setpoint setpoint;
        struct msgen_player_state state = next_setpoint(self, &setpoint);
        int status = exchange(self, &setpoint, out_error);
        if (status || state.phase == msgen_phase_done) {
            return status;
        }
        watch(self);
        const bool kept = state.phase == msgen_phase_playing && !self->stopping;
        const uint32_t late = count_late(self);
        note_late(self, kept, late);
        if (kept) {
            recorder_add(&self->recorder, &setpoint, &self->sample);
        }
        if (self->plan->live) {
            measure_live_add(self->plan->live, &self->sample, kept, late);
        }
    }
}

/// One exchange at standstill: the guard is armed on a measured position, not on an assumed one.
static int arm(struct loop *self, struct error *out_error)
{
    const struct drive_setpoint standstill = {0.0, 0.0, 0.0};
    enum drive_status status = self->drive->operations->arm(self->drive->self);
    if (status != drive_ok) {
        return note_drive_failure(self, "arm", status, out_error);
    }
    int failed = exchange(self, &standstill, out_error);
    for (uint32_t n = 0; !failed && !self->sample.valid && n < self->guard.limits.watchdog_samples; n++) {
        failed = exchange(self, &standstill, out_error);
    }
    if (failed) {
        return failed;
    }
    struct guard_real_sample now = {self->sample.position_rad, self->sample.velocity_rad_per_s, self->sample.torque_Nm,
                                    self->sample.valid};
    if (guard_real_arm(&self->guard, &now) == core_ok) {
        return 0;
    }
    note_end(self, measure_tripped, "the axis is outside its limits, or sends no sample, before anything was played");
    return error_set(out_error, error_refused, "%s", self->report->stopped_by);
}

static int open_drive(struct loop *self, struct error *out_error)
{
    const struct measure_plan *plan = self->plan;
    bool limited = plan->limits.torque_max_Nm < CORE_REAL_MAX;
    double peak = table_value_peak(plan->table, msgen_channel_torque);
    struct drive_configuration configuration = {
        .mode = plan->mode,
        .sample_rate_hz = table_value_rate_hz(plan->table),
        .torque_limit_Nm = limited ? plan->limits.torque_max_Nm : default_torque_margin * peak,
        .velocity_limit_rad_per_s =
            plan->limits.velocity_max_rad_per_s < CORE_REAL_MAX ? plan->limits.velocity_max_rad_per_s : 0.0,
        .following_error_rad = plan->following_error_rad,
    };
    enum drive_status status = self->drive->operations->open(self->drive->self, &configuration);
    if (status != drive_ok) {
        return note_drive_failure(self, "open", status, out_error);
    }
    // To open takes seconds on a real drive. Who wanted no more meanwhile does not want it under torque.
    if (plan->stop_requested && *plan->stop_requested) {
        note_end(self, measure_interrupted, "interrupted by the user before the axis was armed");
        return error_set(out_error, error_refused, "stopped early: %s", self->report->stopped_by);
    }
    return 0;
}

static int prepare(struct loop *self, struct error *out_error)
{
    const struct measure_plan *plan = self->plan;
    struct guard_real_limits limits = plan->limits;
    limits.watchdog_samples = plan->lost_in_a_row_max ? plan->lost_in_a_row_max : default_lost_in_a_row;
    limits.watchdog_samples = (uint32_t)fmax(
        limits.watchdog_samples, fmin(ceil(plan->lost_for_s * table_value_rate_hz(plan->table)), UINT32_MAX));
    const struct msgen_player_config config = player_config(plan);
    enum core_status status = guard_real_init(&self->guard, &limits);
    if (status == core_ok) {
        bool floats = plan->table->format == msgen_format_f32;
        status = floats ? msgen_player_init_f32(&self->player, plan->table, &config)
                        : msgen_player_init(&self->player, plan->table, &config);
    }
    if (status != core_ok) {
        return error_set(out_error, error_refused, "measurement: %s", core_status_str(status));
    }
    size_t rows = (size_t)config.periods * plan->table->period_samples;
    self->report->rows_planned = rows;
    if (!recorder_init(&self->recorder, rows, plan->table->linear, plan->mode == drive_mode_cascade)) {
        return error_set(out_error, error_refused, "not enough memory for %zu samples", rows);
    }
    return 0;
}

static int finish_run(struct loop *self, struct run *out_run, struct error *out_error)
{
    const struct measure_plan *plan = self->plan;
    struct measure_report *report = self->report;
    const struct drive_counters *counters = self->drive->operations->counters(self->drive->self);
    report->counters = counters ? *counters : (struct drive_counters){0};
    report->rows = self->recorder.rows;
    report->rows_lost = self->recorder.lost;
    report->torque_clipped = self->guard.state.count.torque_clipped;
    report->end_position_rad = self->sample.position_rad;
    struct recorder_facts facts = {
        .table = plan->table,
        .sample_rate_hz = table_value_rate_hz(plan->table),
        .settle_periods = plan->settle_periods,
        .mode = plan->mode == drive_mode_cascade ? "cascade" : "torque",
        .samples_late = report->counters.samples_late,
        .torque_clipped = report->torque_clipped,
        .interrupted = report->end == measure_interrupted,
        .stopped_by = report->end == measure_complete ? NULL : report->stopped_by,
    };
    if (!recorder_finish(&self->recorder, &facts, out_run)) {
        return error_set(out_error, error_refused, "not enough memory to keep %zu samples", report->rows);
    }
    if (report->rows == 0) {
        run_free(out_run);
    }
    return 0;
}

int measure_run(const struct drive *drive, const struct measure_plan *plan, struct run *out_run,
                struct measure_report *out_report, struct error *out_error)
{
    *out_run = (struct run){0};
    *out_report = (struct measure_report){.end = measure_complete};
    int status = measure_check(plan, out_error);
    if (status) {
        return status;
    }
    struct loop loop = {.drive = drive, .plan = plan, .report = out_report};
    status = prepare(&loop, out_error);
    if (status) {
        return status;
    }
    status = open_drive(&loop, out_error);
    status = status ? status : arm(&loop, out_error);
    loop.late_before = count_late(&loop);
    status = status ? status : play(&loop, out_error);
    enum drive_status stopped = drive->operations->stop(drive->self);
    if (!status && stopped != drive_ok) {
        status = note_drive_failure(&loop, "stop", stopped, out_error);
    }
    if (!status && out_report->end != measure_complete) {
        status = error_set(out_error, error_refused, "stopped early: %s", out_report->stopped_by);
    }
    int kept = finish_run(&loop, out_run, status ? NULL : out_error);
    return status ? status : kept;
}
