/* SPDX-License-Identifier: MIT */
/* MC/DC of lib/guard by table: for each condition of each decision two vectors of which only that condition decides, so
 * that the outcome differs. The table is held against the sources: a condition that is added there without a row here
 * fails. */
#include "guard/guard.h"
#include "guard/guard_real.h"
#include "guard/latch.h"

#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* One call of the guard: what was set up, what was before, what is asked, what comes out as a number. */
struct vector {
    double position_min, position_max, velocity_max, torque_max;
    uint32_t watchdog, stuck;
    double stuck_torque;
    enum guard_mode mode;
    uint32_t silent, still;
    double position, velocity, torque; /* the position before is 0 */
    bool blind, alive;
};

/* A good one, armed, inside, moving, with every limit set; what a row changes of it comes behind. */
#pragma GCC diagnostic ignored "-Woverride-init"
#define GOOD                                                                                                           \
    .position_min = -100, .position_max = 100, .velocity_max = 50, .torque_max = 30, .watchdog = 9, .stuck = 9,        \
    .stuck_torque = 10, .mode = guard_armed, .position = 5

static struct guard integer_guard(const struct vector *v)
{
    struct guard guard;
    memset(&guard, 0, sizeof guard);
    guard.limits = (struct guard_limits){(int32_t)v->position_min,
                                         (int32_t)v->position_max,
                                         (int32_t)v->velocity_max,
                                         (int32_t)v->torque_max,
                                         v->watchdog,
                                         v->stuck,
                                         (int32_t)v->stuck_torque};
    guard_state_init(&guard.state, v->watchdog, v->stuck);
    guard.state.mode = v->mode;
    guard.state.silent_samples = v->silent;
    guard.state.still_samples = v->still;
    if (v->alive)
        guard_alive(&guard.state);
    return guard;
}

static struct guard_real real_guard(const struct vector *v)
{
    struct guard_real guard;
    memset(&guard, 0, sizeof guard);
    guard.limits = (struct guard_real_limits){(core_real)v->position_min,
                                              (core_real)v->position_max,
                                              (core_real)v->velocity_max,
                                              (core_real)v->torque_max,
                                              v->watchdog,
                                              v->stuck,
                                              (core_real)v->stuck_torque};
    guard_state_init(&guard.state, v->watchdog, v->stuck);
    guard.state.mode = v->mode;
    guard.state.silent_samples = v->silent;
    guard.state.still_samples = v->still;
    if (v->alive)
        guard_alive(&guard.state);
    return guard;
}

static struct guard_sample integer_sample(const struct vector *v)
{
    return (struct guard_sample){(int32_t)v->position, (int32_t)v->velocity, (int32_t)v->torque, !v->blind};
}

static struct guard_real_sample real_sample(const struct vector *v)
{
    return (struct guard_real_sample){(core_real)v->position, (core_real)v->velocity, (core_real)v->torque, !v->blind};
}

static long init(const struct vector *v)
{
    struct guard guard = integer_guard(v), other;
    return guard_init(&other, &guard.limits);
}

static long init_real(const struct vector *v)
{
    struct guard_real guard = real_guard(v), other;
    return guard_real_init(&other, &guard.limits);
}

/* `blind` stands for a missing self, `alive` for a missing argument. */
static long init_null(const struct vector *v)
{
    struct guard guard = integer_guard(v);
    struct guard other;
    return guard_init(v->blind ? NULL : &other, v->alive ? NULL : &guard.limits);
}

static long init_real_null(const struct vector *v)
{
    struct guard_real guard = real_guard(v);
    struct guard_real other;
    return guard_real_init(v->blind ? NULL : &other, v->alive ? NULL : &guard.limits);
}

static long arm_null(const struct vector *v)
{
    struct guard guard = integer_guard(v);
    struct guard_sample sample = {0, 0, 0, true};
    return guard_arm(v->blind ? NULL : &guard, v->alive ? NULL : &sample);
}

static long arm_real_null(const struct vector *v)
{
    struct guard_real guard = real_guard(v);
    struct guard_real_sample sample = {0, 0, 0, true};
    return guard_real_arm(v->blind ? NULL : &guard, v->alive ? NULL : &sample);
}

static long arm_mode(const struct vector *v)
{
    struct guard guard = integer_guard(v);
    struct guard_sample sample = integer_sample(v);
    guard_arm(&guard, &sample);
    return guard.state.mode;
}

/* Whether the position before was taken over, which an arm that is refused must not do. */
static long arm_position(const struct vector *v)
{
    struct guard guard = integer_guard(v);
    struct guard_sample sample = integer_sample(v);
    guard_arm(&guard, &sample);
    return guard.last_position;
}

static long arm_real_position(const struct vector *v)
{
    struct guard_real guard = real_guard(v);
    struct guard_real_sample sample = real_sample(v);
    guard_real_arm(&guard, &sample);
    return (long)guard.last_position_rad;
}

static long step_cause(const struct vector *v)
{
    struct guard guard = integer_guard(v);
    struct guard_sample sample = integer_sample(v);
    guard_step(&guard, &sample);
    return guard.state.cause;
}

static long step_action(const struct vector *v)
{
    struct guard guard = integer_guard(v);
    struct guard_sample sample = integer_sample(v);
    return guard_step(&guard, &sample);
}

static long step_value(const struct vector *v)
{
    struct guard guard = integer_guard(v);
    struct guard_sample sample = integer_sample(v);
    guard.trip_value = -77;
    guard_step(&guard, &sample);
    return guard.trip_value;
}

static long step_silent(const struct vector *v)
{
    struct guard guard = integer_guard(v);
    struct guard_sample sample = integer_sample(v);
    guard_step(&guard, &sample);
    return (long)guard.state.silent_samples;
}

static long step_still(const struct vector *v)
{
    struct guard guard = integer_guard(v);
    struct guard_sample sample = integer_sample(v);
    guard_step(&guard, &sample);
    return (long)guard.state.still_samples;
}

static long step_real_cause(const struct vector *v)
{
    struct guard_real guard = real_guard(v);
    struct guard_real_sample sample = real_sample(v);
    guard_real_step(&guard, &sample);
    return guard.state.cause;
}

static long step_real_still(const struct vector *v)
{
    struct guard_real guard = real_guard(v);
    struct guard_real_sample sample = real_sample(v);
    guard_real_step(&guard, &sample);
    return (long)guard.state.still_samples;
}

static long step_real_value(const struct vector *v)
{
    struct guard_real guard = real_guard(v);
    struct guard_real_sample sample = real_sample(v);
    guard.trip_value = -77;
    guard_real_step(&guard, &sample);
    return isfinite(guard.trip_value) ? (long)guard.trip_value : guard.trip_value > 0 ? 1000000 : -1000000;
}

static long clip(const struct vector *v)
{
    struct guard guard = integer_guard(v);
    guard_clip_torque(&guard, (int32_t)v->torque);
    return (long)guard.state.count.torque_clipped;
}

static long clip_real(const struct vector *v)
{
    struct guard_real guard = real_guard(v);
    return (long)guard_real_clip_torque(&guard, (core_real)v->torque) + 100 * (long)guard.state.count.torque_clipped;
}

/* Decisions in the order of the sources; `conditions` of each, the first row says how many. */
struct row {
    const char *file, *decision;
    unsigned conditions; /* of the decision, 0 in its further rows */
    const char *condition;
    long (*outcome)(const struct vector *);
    struct vector first, second;
    long first_is, second_is;
};

static const struct row rows[] = {
    {"guard.c", "init: self, limits", 2, "!self", init_null, {GOOD, .blind = true}, {GOOD}, core_err_argument, core_ok},
    {"guard.c", "", 0, "!limits", init_null, {GOOD, .alive = true}, {GOOD}, core_err_argument, core_ok},
    {"guard.c", "init: travel", 1, "min < max", init, {GOOD, .position_max = -100}, {GOOD}, core_err_guard_travel, 0},
    {"guard.c",
     "init: speed",
     1,
     "velocity_max > 0",
     init,
     {GOOD, .velocity_max = 0},
     {GOOD},
     core_err_guard_velocity,
     0},
    {"guard.c", "init: torque", 1, "torque_max > 0", init, {GOOD, .torque_max = 0}, {GOOD}, core_err_guard_torque, 0},
    {"guard.c",
     "init: stuck",
     3,
     "stuck_torque < 0",
     init,
     {GOOD, .stuck_torque = -1},
     {GOOD},
     core_err_guard_stuck,
     0},
    {"guard.c",
     "",
     0,
     "stuck_samples != 0",
     init,
     {GOOD, .stuck_torque = 0},
     {GOOD, .stuck_torque = 0, .stuck = 0},
     core_err_guard_stuck,
     0},
    {"guard.c", "", 0, "stuck_torque == 0", init, {GOOD, .stuck_torque = 0}, {GOOD}, core_err_guard_stuck, 0},
    {"guard.c", "sensor", 1, "!valid", step_cause, {GOOD, .blind = true}, {GOOD}, guard_cause_sensor, 0},
    {"guard.c", "travel", 2, "position >= min", step_cause, {GOOD, .position = -101}, {GOOD}, guard_cause_travel, 0},
    {"guard.c", "", 0, "position <= max", step_cause, {GOOD, .position = 101}, {GOOD}, guard_cause_travel, 0},
    {"guard.c",
     "speed",
     3,
     "!unlimited",
     step_cause,
     {GOOD, .velocity_max = 2147483646, .velocity = -2147483648.0},
     {GOOD, .velocity_max = 2147483647, .velocity = -2147483648.0},
     guard_cause_speed,
     0},
    {"guard.c", "", 0, "velocity >= -max", step_cause, {GOOD, .velocity = -51}, {GOOD}, guard_cause_speed, 0},
    {"guard.c", "", 0, "velocity <= max", step_cause, {GOOD, .velocity = 51}, {GOOD}, guard_cause_speed, 0},
    {"guard.c", "arm: self, now", 2, "!self", arm_null, {GOOD, .blind = true}, {GOOD}, core_err_argument, core_ok},
    {"guard.c", "", 0, "!now", arm_null, {GOOD, .alive = true}, {GOOD}, core_err_argument, core_ok},
    {"guard.c", "armed", 1, "status == ok", arm_position, {GOOD}, {GOOD, .velocity = 51}, 5, 0},
    {"guard.c",
     "silent samples fit",
     1,
     "silent > INT32_MAX",
     step_value,
     {GOOD, .silent = 2147483647u},
     {GOOD, .silent = 2147483645u},
     2147483647,
     2147483646},
    {"guard.c",
     "still",
     3,
     "position == last",
     step_still,
     {GOOD, .position = 0, .torque = 10},
     {GOOD, .torque = 10},
     1,
     0},
    {"guard.c",
     "",
     0,
     "torque >= threshold",
     step_still,
     {GOOD, .position = 0, .torque = 10},
     {GOOD, .position = 0, .torque = 9},
     1,
     0},
    {"guard.c",
     "",
     0,
     "torque <= -threshold",
     step_still,
     {GOOD, .position = 0, .torque = -10},
     {GOOD, .position = 0, .torque = -9},
     1,
     0},
    {"guard.c", "cause", 1, "cause != none", step_value, {GOOD, .velocity = 51}, {GOOD}, 51, -77},
    {"guard.c", "clipped", 1, "clipped", clip, {GOOD, .torque = 31}, {GOOD, .torque = 30}, 1, 0},
    {"guard_real.c",
     "within",
     2,
     "value >= low",
     step_real_cause,
     {GOOD, .position = -101},
     {GOOD},
     guard_cause_travel,
     0},
    {"guard_real.c", "", 0, "value <= high", step_real_cause, {GOOD, .position = 101}, {GOOD}, guard_cause_travel, 0},
    {"guard_real.c",
     "init: self, limits",
     2,
     "!self",
     init_real_null,
     {GOOD, .blind = true},
     {GOOD},
     core_err_argument,
     0},
    {"guard_real.c", "", 0, "!limits", init_real_null, {GOOD, .alive = true}, {GOOD}, core_err_argument, 0},
    {"guard_real.c",
     "init: travel",
     1,
     "min < max",
     init_real,
     {GOOD, .position_max = -100},
     {GOOD},
     core_err_guard_travel,
     0},
    {"guard_real.c",
     "init: speed",
     1,
     "velocity_max > 0",
     init_real,
     {GOOD, .velocity_max = 0},
     {GOOD},
     core_err_guard_velocity,
     0},
    {"guard_real.c",
     "init: torque",
     1,
     "torque_max > 0",
     init_real,
     {GOOD, .torque_max = 0},
     {GOOD},
     core_err_guard_torque,
     0},
    {"guard_real.c",
     "init: stuck",
     2,
     "stuck_samples != 0",
     init_real,
     {GOOD, .stuck_torque = 0},
     {GOOD, .stuck_torque = 0, .stuck = 0},
     core_err_guard_stuck,
     0},
    {"guard_real.c", "", 0, "stuck_torque > 0", init_real, {GOOD, .stuck_torque = 0}, {GOOD}, core_err_guard_stuck, 0},
    {"guard_real.c", "sensor", 4, "!valid", step_real_cause, {GOOD, .blind = true}, {GOOD}, guard_cause_sensor, 0},
    {"guard_real.c",
     "",
     0,
     "position finite",
     step_real_cause,
     {GOOD, .position = INFINITY},
     {GOOD},
     guard_cause_sensor,
     0},
    {"guard_real.c",
     "",
     0,
     "velocity finite",
     step_real_cause,
     {GOOD, .velocity = -INFINITY},
     {GOOD},
     guard_cause_sensor,
     0},
    {"guard_real.c", "", 0, "torque finite", step_real_cause, {GOOD, .torque = NAN}, {GOOD}, guard_cause_sensor, 0},
    {"guard_real.c",
     "travel",
     1,
     "position within",
     step_real_cause,
     {GOOD, .position = 101},
     {GOOD},
     guard_cause_travel,
     0},
    {"guard_real.c",
     "speed",
     1,
     "velocity within",
     step_real_cause,
     {GOOD, .velocity = 51},
     {GOOD},
     guard_cause_speed,
     0},
    {"guard_real.c", "arm: self, now", 2, "!self", arm_real_null, {GOOD, .blind = true}, {GOOD}, core_err_argument, 0},
    {"guard_real.c", "", 0, "!now", arm_real_null, {GOOD, .alive = true}, {GOOD}, core_err_argument, 0},
    {"guard_real.c", "armed", 1, "status == ok", arm_real_position, {GOOD}, {GOOD, .velocity = 51}, 5, 0},
    {"guard_real.c",
     "value: position",
     1,
     "!finite",
     step_real_value,
     {GOOD, .position = INFINITY, .torque = 3},
     {GOOD, .blind = true, .torque = 3},
     1000000,
     3},
    {"guard_real.c",
     "value: velocity",
     1,
     "!finite",
     step_real_value,
     {GOOD, .velocity = INFINITY, .torque = 3},
     {GOOD, .blind = true, .torque = 3},
     1000000,
     3},
    {"guard_real.c",
     "loaded",
     2,
     "torque >= threshold",
     step_real_still,
     {GOOD, .position = 0, .torque = 10},
     {GOOD, .position = 0, .torque = 9},
     1,
     0},
    {"guard_real.c",
     "",
     0,
     "torque <= -threshold",
     step_real_still,
     {GOOD, .position = 0, .torque = -10},
     {GOOD, .position = 0, .torque = -9},
     1,
     0},
    {"guard_real.c",
     "still",
     2,
     "unmoved",
     step_real_still,
     {GOOD, .position = 0, .torque = 10},
     {GOOD, .torque = 10},
     1,
     0},
    {"guard_real.c",
     "",
     0,
     "loaded",
     step_real_still,
     {GOOD, .position = 0, .torque = 10},
     {GOOD, .position = 0},
     1,
     0},
    {"guard_real.c", "cause", 1, "cause != none", step_real_value, {GOOD, .velocity = 51}, {GOOD}, 51, -77},
    {"guard_real.c",
     "clip: within",
     1,
     "torque within",
     clip_real,
     {GOOD, .torque = 31},
     {GOOD, .torque = 30},
     130,
     30},
    {"guard_real.c",
     "clip: above",
     1,
     "torque > limit",
     clip_real,
     {GOOD, .torque = 31},
     {GOOD, .torque = -31},
     130,
     70},
    {"guard_real.c",
     "clip: below",
     1,
     "torque < -limit",
     clip_real,
     {GOOD, .torque = -31},
     {GOOD, .torque = NAN},
     70,
     100},
    {"latch.c", "arm: inside", 1, "!inside", arm_mode, {GOOD, .velocity = 51}, {GOOD}, guard_idle, guard_armed},
    {"latch.c",
     "arm: tripped stays",
     1,
     "mode == tripped",
     arm_mode,
     {GOOD, .velocity = 51, .mode = guard_tripped},
     {GOOD, .velocity = 51},
     guard_tripped,
     guard_idle},
    {"latch.c",
     "watch: armed",
     1,
     "mode != armed",
     step_cause,
     {GOOD, .velocity = 51, .mode = guard_idle},
     {GOOD, .velocity = 51},
     guard_cause_none,
     guard_cause_speed},
    {"latch.c",
     "sign of life",
     1,
     "signs == seen",
     step_silent,
     {GOOD, .silent = 3},
     {GOOD, .silent = 3, .alive = true},
     4,
     0},
    {"latch.c",
     "still",
     1,
     "still",
     step_still,
     {GOOD, .still = 3, .position = 0, .torque = 10},
     {GOOD, .still = 3},
     4,
     0},
    {"latch.c",
     "measured first",
     1,
     "measured != none",
     step_cause,
     {GOOD, .velocity = 51, .silent = 9},
     {GOOD, .silent = 9},
     guard_cause_speed,
     guard_cause_watchdog},
    {"latch.c",
     "watchdog",
     2,
     "watchdog != 0",
     step_cause,
     {GOOD, .silent = 9},
     {GOOD, .silent = 9, .watchdog = 0},
     guard_cause_watchdog,
     0},
    {"latch.c",
     "",
     0,
     "silent > watchdog",
     step_cause,
     {GOOD, .silent = 9},
     {GOOD, .silent = 8},
     guard_cause_watchdog,
     0},
    {"latch.c",
     "stuck",
     2,
     "stuck != 0",
     step_cause,
     {GOOD, .still = 8, .position = 0, .torque = 10},
     {GOOD, .still = 8, .position = 0, .torque = 10, .stuck = 0},
     guard_cause_stuck,
     0},
    {"latch.c",
     "",
     0,
     "still >= stuck",
     step_cause,
     {GOOD, .still = 8, .position = 0, .torque = 10},
     {GOOD, .still = 7, .position = 0, .torque = 10},
     guard_cause_stuck,
     0},
    {"latch.c", "latch", 1, "cause != none", step_cause, {GOOD, .position = 101}, {GOOD}, guard_cause_travel, 0},
    {"latch.c",
     "action",
     1,
     "mode == armed",
     step_action,
     {GOOD},
     {GOOD, .mode = guard_idle},
     guard_run,
     guard_ramp_down},
};

enum { row_count = sizeof rows / sizeof rows[0] };

void setUp(void) {}

void tearDown(void) {}

static void test_conditions_decide_alone(void)
{
    for (unsigned r = 0; r < row_count; r++) {
        char message[96];
        snprintf(message, sizeof message, "%s, row %u: %s %s", rows[r].file, r, rows[r].decision, rows[r].condition);
        TEST_ASSERT_NOT_EQUAL_MESSAGE(rows[r].first_is, rows[r].second_is, message);
        TEST_ASSERT_EQUAL_INT64_MESSAGE(rows[r].first_is, rows[r].outcome(&rows[r].first), message);
        TEST_ASSERT_EQUAL_INT64_MESSAGE(rows[r].second_is, rows[r].outcome(&rows[r].second), message);
    }
    printf("MC/DC of lib/guard: %u conditions, two vectors each\n", (unsigned)row_count);
}

static unsigned count_of(const char *text, const char *what)
{
    unsigned count = 0;
    for (const char *at = strstr(text, what); at; at = strstr(at + 1, what))
        count++;
    return count;
}

/* Between two conditions stands one operator: as many rows as operators and decisions, file by file. */
static void test_conditions_are_those_of_the_sources(void)
{
    static char text[32768];
    static const char *const files[] = {"guard.c", "guard_real.c", "latch.c"};
    const char *root = getenv("SERVOSCOPE_SOURCE");
    for (unsigned f = 0; f < 3; f++) {
        char path[1024];
        snprintf(path, sizeof path, "%s/lib/guard/%s", root ? root : ".", files[f]);
        FILE *file = fopen(path, "r");
        TEST_ASSERT_NOT_NULL_MESSAGE(file, path);
        text[fread(text, 1, sizeof text - 1, file)] = '\0';
        fclose(file);
        unsigned decisions = 0, conditions = 0, listed = 0;
        for (unsigned r = 0; r < row_count; r++) {
            if (strcmp(rows[r].file, files[f]) != 0)
                continue;
            listed++;
            decisions += rows[r].conditions > 0;
            conditions += rows[r].conditions;
        }
        TEST_ASSERT_EQUAL_UINT_MESSAGE(conditions, listed, files[f]);
        TEST_ASSERT_EQUAL_UINT_MESSAGE(count_of(text, " &&") + count_of(text, " ||"), conditions - decisions, files[f]);
        /* Decisions that are no branch: still (guard.c); within, loaded, still (guard_real.c). */
        unsigned plain = f == 0 ? 1 : f == 1 ? 3 : 0;
        TEST_ASSERT_EQUAL_UINT_MESSAGE(count_of(text, "if (") + count_of(text, " ? "), decisions - plain, files[f]);
    }
}

/* What is decided by a switch: each cause, and a number that is none. */
static void test_causes_have_names_and_values(void)
{
    static const char *const names[] = {"none", "sensor", "travel", "speed", "watchdog", "stuck"};
    for (unsigned c = 0; c < 6; c++)
        TEST_ASSERT_EQUAL_STRING(names[c], guard_cause_str((enum guard_cause)c));
    TEST_ASSERT_EQUAL_STRING("unknown cause", guard_cause_str((enum guard_cause)99));
    static const struct {
        struct vector vector;
        long value;
    } cases[] = {{{GOOD, .position = 101}, 101},
                 {{GOOD, .velocity = -51}, -51},
                 {{GOOD, .still = 8, .position = 0, .torque = 12}, 12},
                 {{GOOD, .silent = 9}, 10}};
    for (unsigned c = 0; c < 4; c++) {
        TEST_ASSERT_EQUAL_INT64(cases[c].value, step_value(&cases[c].vector));
        TEST_ASSERT_EQUAL_INT64(cases[c].value, step_real_value(&cases[c].vector));
    }
    const struct vector blind = {GOOD, .blind = true, .torque = 12};
    TEST_ASSERT_EQUAL_INT64(0, step_value(&blind));
    TEST_ASSERT_EQUAL_INT64(12, step_real_value(&blind));
}

/* Storage is not initialised before, and a guard is set up and armed again and again. */
static void test_init_and_arm_leave_nothing_of_before(void)
{
    const struct vector good = {GOOD};
    struct guard guard;
    struct guard_real real;
    struct guard_limits limits = integer_guard(&good).limits;
    struct guard_real_limits real_limits = real_guard(&good).limits;
    memset(&guard, 0x5A, sizeof guard);
    memset(&real, 0x5A, sizeof real);
    TEST_ASSERT_EQUAL_INT(core_ok, guard_init(&guard, &limits));
    TEST_ASSERT_EQUAL_INT(core_ok, guard_real_init(&real, &real_limits));
    TEST_ASSERT_EQUAL_INT32(0, guard.trip_value);
    TEST_ASSERT_EQUAL_INT32(0, guard.last_position);
    TEST_ASSERT_TRUE(real.trip_value == 0 && real.last_position_rad == 0);
    const struct guard_state *const states[2] = {&guard.state, &real.state};
    for (unsigned i = 0; i < 2; i++) {
        TEST_ASSERT_EQUAL_INT(guard_idle, states[i]->mode);
        TEST_ASSERT_EQUAL_INT(guard_cause_none, states[i]->cause);
        TEST_ASSERT_EQUAL_UINT32(9, states[i]->watchdog_samples);
        TEST_ASSERT_EQUAL_UINT32(9, states[i]->stuck_samples);
        TEST_ASSERT_EQUAL_UINT32(0, states[i]->silent_samples);
        TEST_ASSERT_EQUAL_UINT32(0, states[i]->still_samples);
        TEST_ASSERT_EQUAL_UINT32(0, states[i]->signs_of_life);
        TEST_ASSERT_EQUAL_UINT32(0, states[i]->signs_seen);
        TEST_ASSERT_EQUAL_UINT32(0, states[i]->count.trips);
        TEST_ASSERT_EQUAL_UINT32(0, states[i]->count.torque_clipped);
    }
    guard.trip_value = 5;
    real.trip_value = 5;
    struct guard_sample now = integer_sample(&good);
    struct guard_real_sample real_now = real_sample(&good);
    guard_alive(&guard.state); /* of the time before it was armed: no sign of life of the one after */
    TEST_ASSERT_EQUAL_INT(core_ok, guard_arm(&guard, &now));
    TEST_ASSERT_EQUAL_INT(core_ok, guard_real_arm(&real, &real_now));
    TEST_ASSERT_EQUAL_INT32(0, guard.trip_value);
    TEST_ASSERT_TRUE(real.trip_value == 0);
    TEST_ASSERT_EQUAL_INT(guard_run, guard_step(&guard, &now));
    TEST_ASSERT_EQUAL_UINT32(1, guard.state.silent_samples);
}

/* Still is: unmoved since the sample before, wherever that was; moved by however little, either way, is not. */
static void test_real_still_is_judged_from_sample_to_sample(void)
{
    static const core_real positions[] = {7, 7, (core_real)7.5, (core_real)7.5, 7, 7, 7};
    static const uint32_t still[] = {0, 1, 0, 1, 0, 1, 2};
    const struct vector good = {GOOD};
    struct guard_real guard = real_guard(&good);
    for (unsigned s = 0; s < 7; s++) {
        struct guard_real_sample sample = {positions[s], 0, 20, true};
        guard_real_step(&guard, &sample);
        TEST_ASSERT_EQUAL_UINT32(still[s], guard.state.still_samples);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_conditions_decide_alone);
    RUN_TEST(test_conditions_are_those_of_the_sources);
    RUN_TEST(test_causes_have_names_and_values);
    RUN_TEST(test_init_and_arm_leave_nothing_of_before);
    RUN_TEST(test_real_still_is_judged_from_sample_to_sample);
    return UNITY_END();
}
