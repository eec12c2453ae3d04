/* SPDX-License-Identifier: MIT */
#include "drivers/can/cia402.h"
#include "drivers/can/cia402_scaling.h"

#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

void setUp(void) {}

void tearDown(void) {}

/// The numbered transitions of the profile; every pair that is not here keeps its state.
struct transition {
    int number;
    enum cia402_state from;
    enum cia402_event event;
    enum cia402_state to;
};

static const struct transition transitions[] = {
    {1, cia402_not_ready, cia402_initialised, cia402_switch_on_disabled},
    {2, cia402_switch_on_disabled, cia402_shutdown, cia402_ready},
    {3, cia402_ready, cia402_switch_on, cia402_switched_on},
    {3, cia402_ready, cia402_enable_operation, cia402_switched_on},
    {4, cia402_switched_on, cia402_enable_operation, cia402_operation_enabled},
    {5, cia402_operation_enabled, cia402_switch_on, cia402_switched_on},
    {6, cia402_switched_on, cia402_shutdown, cia402_ready},
    {7, cia402_ready, cia402_disable_voltage, cia402_switch_on_disabled},
    {7, cia402_ready, cia402_quick_stop, cia402_switch_on_disabled},
    {8, cia402_operation_enabled, cia402_shutdown, cia402_ready},
    {9, cia402_operation_enabled, cia402_disable_voltage, cia402_switch_on_disabled},
    {10, cia402_switched_on, cia402_disable_voltage, cia402_switch_on_disabled},
    {10, cia402_switched_on, cia402_quick_stop, cia402_switch_on_disabled},
    {11, cia402_operation_enabled, cia402_quick_stop, cia402_quick_stop_active},
    {12, cia402_quick_stop_active, cia402_disable_voltage, cia402_switch_on_disabled},
    {12, cia402_quick_stop_active, cia402_quick_stop_done, cia402_switch_on_disabled},
    {13, cia402_not_ready, cia402_fault_detected, cia402_fault_reaction_active},
    {13, cia402_switch_on_disabled, cia402_fault_detected, cia402_fault_reaction_active},
    {13, cia402_ready, cia402_fault_detected, cia402_fault_reaction_active},
    {13, cia402_switched_on, cia402_fault_detected, cia402_fault_reaction_active},
    {13, cia402_operation_enabled, cia402_fault_detected, cia402_fault_reaction_active},
    {13, cia402_quick_stop_active, cia402_fault_detected, cia402_fault_reaction_active},
    {14, cia402_fault_reaction_active, cia402_fault_reaction_done, cia402_fault},
    {15, cia402_fault, cia402_fault_reset, cia402_switch_on_disabled},
    {16, cia402_quick_stop_active, cia402_enable_operation, cia402_operation_enabled},
};

static void test_cia402_every_pair_is_a_numbered_transition_or_nothing(void)
{
    for (int state = 0; state < cia402_state_count; state++)
        for (int event = 0; event < cia402_event_count; event++) {
            int expected = state, number = 0;
            for (size_t i = 0; i < sizeof transitions / sizeof transitions[0]; i++)
                if ((int)transitions[i].from == state && (int)transitions[i].event == event) {
                    expected = (int)transitions[i].to;
                    number = transitions[i].number;
                }
            char text[64];
            snprintf(text, sizeof text, "state %d, event %d, transition %d", state, event, number);
            TEST_ASSERT_EQUAL_MESSAGE(expected, cia402_state_after((enum cia402_state)state, (enum cia402_event)event),
                                      text);
        }
}

static void test_cia402_torque_needs_three_commands(void)
{
    // No single command may lead from an unpowered state to torque, but 1111 from "switched on".
    for (int state = 0; state < cia402_state_count; state++)
        for (int event = 0; event < cia402_event_count; event++) {
            bool was = state == cia402_operation_enabled || state == cia402_quick_stop_active;
            enum cia402_state after = cia402_state_after((enum cia402_state)state, (enum cia402_event)event);
            if (after == cia402_operation_enabled && !was)
                TEST_ASSERT_TRUE(state == cia402_switched_on && event == cia402_enable_operation);
        }
}

static void test_cia402_control_word_decodes_by_its_low_bits_only(void)
{
    for (uint32_t word = 0; word <= UINT16_MAX; word++) {
        enum cia402_event expected;
        if ((word & 0x02) == 0)
            expected = cia402_disable_voltage;
        else if ((word & 0x06) == 0x02)
            expected = cia402_quick_stop;
        else if ((word & 0x07) == 0x06)
            expected = cia402_shutdown;
        else
            expected = (word & 0x0F) == 0x0F ? cia402_enable_operation : cia402_switch_on;
        TEST_ASSERT_EQUAL(expected, cia402_control_decode((uint16_t)word));
    }
}

static void test_cia402_status_word_tells_each_state_and_nothing_else(void)
{
    // Masks and values as drive manuals print them.
    static const struct {
        uint16_t mask, value;
        enum cia402_state state;
    } rows[] = {
        {0x4F, 0x00, cia402_not_ready},
        {0x4F, 0x40, cia402_switch_on_disabled},
        {0x6F, 0x21, cia402_ready},
        {0x6F, 0x23, cia402_switched_on},
        {0x6F, 0x27, cia402_operation_enabled},
        {0x6F, 0x07, cia402_quick_stop_active},
        {0x4F, 0x0F, cia402_fault_reaction_active},
        {0x4F, 0x08, cia402_fault},
    };
    for (uint32_t word = 0; word <= UINT16_MAX; word++) {
        int expected = -1;
        for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++)
            if ((word & rows[i].mask) == rows[i].value)
                expected = (int)rows[i].state;
        enum cia402_state state;
        bool told = cia402_status_decode((uint16_t)word, &state);
        TEST_ASSERT_EQUAL(expected >= 0, told);
        if (told)
            TEST_ASSERT_EQUAL(expected, state);
    }
    for (int state = 0; state < cia402_state_count; state++) {
        enum cia402_state read;
        TEST_ASSERT_TRUE(cia402_status_decode(cia402_status_encode((enum cia402_state)state), &read));
        TEST_ASSERT_EQUAL(state, read);
    }
}

/// The command table as drive manuals print it: bits 3..0 of the control word that matter, and which numbered
/// transitions the command makes. Bit 7 is the fault reset's and seen as an edge only.
static const struct {
    uint16_t mask, value;
    int numbers[5];
} commands[] = {
    {0x07, 0x06, {2, 6, 8}},      // shutdown
    {0x0F, 0x07, {3, 5}},         // switch on, disable operation
    {0x0F, 0x0F, {3, 4, 16}},     // switch on and enable operation
    {0x02, 0x00, {7, 9, 10, 12}}, // disable voltage
    {0x06, 0x02, {7, 10, 11}},    // quick stop
};

/// The state after one command by the numbered transitions alone, no options; -1: none leaves `from`.
static int diagram_after(int from, uint16_t control_word)
{
    for (size_t c = 0; c < sizeof commands / sizeof commands[0]; c++) {
        if ((control_word & commands[c].mask) != commands[c].value)
            continue;
        for (size_t n = 0; n < 5 && commands[c].numbers[n] != 0; n++)
            for (size_t t = 0; t < sizeof transitions / sizeof transitions[0]; t++)
                if (transitions[t].number == commands[c].numbers[n] && (int)transitions[t].from == from)
                    return (int)transitions[t].to;
    }
    return -1;
}

struct expectation {
    enum cia402_state state;
    bool leaving; ///< by a ramp
    bool reset;
};

/// 605B and 605C: whether operation enabled is left for this state by a ramp.
static bool ramps_to(int state, const struct cia402_options *options)
{
    return (state == cia402_ready && options->shutdown == 1) ||
           (state == cia402_switched_on && options->disable_operation == 1);
}

/// What a word does to a machine whose options are given and whose last word was `before`.
static struct expectation expected_after(enum cia402_state from, uint16_t before, uint16_t word,
                                         const struct cia402_options *options)
{
    struct expectation e = {from, false, false};
    if (from == cia402_fault && (word & 0x80) && !(before & 0x80))
        return (struct expectation){cia402_switch_on_disabled, false, true};
    int to = diagram_after(from, word);
    bool stays = options->quick_stop >= 5;
    if (to < 0 || (from == cia402_quick_stop_active && to == cia402_operation_enabled && !stays))
        return e;
    if (from == cia402_operation_enabled && ramps_to(to, options)) {
        e.leaving = true;
        return e;
    }
    e.state = (enum cia402_state)to;
    if (from == cia402_ready && (word & 0x0F) == 0x0F)
        e.state = cia402_operation_enabled; // transitions 3 and 4 with one command
    if (to == cia402_quick_stop_active && options->quick_stop == 0)
        e.state = cia402_switch_on_disabled; // torque off: nothing to wait for
    return e;
}

static void every_word_in(enum cia402_state state, const struct cia402_options *options)
{
    for (uint32_t before = 0; before <= 0x80; before += 0x80)
        for (uint32_t word = 0; word <= UINT16_MAX; word++) {
            struct cia402_machine machine = {.state = state, .control_word = (uint16_t)before, .options = *options};
            struct expectation e = expected_after(state, (uint16_t)before, (uint16_t)word, options);
            bool reset = cia402_machine_command(&machine, (uint16_t)word);
            bool leaving =
                state == cia402_operation_enabled && machine.state == state && cia402_machine_is_leaving(&machine);
            if (reset == e.reset && machine.state == e.state && leaving == e.leaving)
                continue;
            char text[96];
            snprintf(text, sizeof text, "state %d, 605A %d, 605B %d, 605C %d, word %04X after %02X", (int)state,
                     options->quick_stop, options->shutdown, options->disable_operation, (unsigned)word,
                     (unsigned)before);
            TEST_ASSERT_EQUAL_MESSAGE(e.state, machine.state, text);
            TEST_FAIL_MESSAGE(text);
        }
}

static void test_cia402_every_state_takes_every_control_word_as_the_diagram_says(void)
{
    static const int16_t quick_stops[] = {0, 1, 2, 5, 6};
    for (int state = 0; state < cia402_state_count; state++)
        for (size_t q = 0; q < 5; q++)
            for (int16_t ramps = 0; ramps < 4; ramps++) {
                struct cia402_options options = cia402_options_default();
                options.quick_stop = quick_stops[q];
                options.shutdown = ramps & 1;
                options.disable_operation = ramps >> 1;
                if ((q > 0 || ramps > 0) && state != cia402_operation_enabled && state != cia402_quick_stop_active)
                    continue; // no option has a say there
                every_word_in((enum cia402_state)state, &options);
            }
}

/// The drive's own events in every state: fault, standstill, self-test.
static void test_cia402_every_state_takes_every_own_event(void)
{
    for (int16_t reaction = 0; reaction <= 2; reaction++)
        for (int state = 0; state < cia402_state_count; state++) {
            struct cia402_machine machine = {.state = (enum cia402_state)state, .options = cia402_options_default()};
            machine.options.fault_reaction = reaction;
            bool torque = state == cia402_operation_enabled || state == cia402_quick_stop_active;
            cia402_machine_event(&machine, cia402_fault_detected);
            bool reacts = reaction != 0 && (torque || state == cia402_fault_reaction_active);
            TEST_ASSERT_EQUAL(reacts ? cia402_fault_reaction_active : cia402_fault, machine.state);
            static const enum cia402_action actions[] = {cia402_coast, cia402_slow_down_ramp, cia402_quick_stop_ramp};
            bool reacting = machine.state == cia402_fault_reaction_active;
            TEST_ASSERT_EQUAL(reacting ? actions[reaction] : cia402_coast, cia402_machine_action(&machine));
            cia402_machine_stood_still(&machine);
            TEST_ASSERT_EQUAL(cia402_fault, machine.state);
            TEST_ASSERT_EQUAL(cia402_coast, cia402_machine_action(&machine));
        }
}

static void test_cia402_standstill_ends_ramps_only(void)
{
    for (int state = 0; state < cia402_state_count; state++) {
        struct cia402_machine machine = {.state = (enum cia402_state)state, .options = cia402_options_default()};
        cia402_machine_stood_still(&machine);
        enum cia402_state expected = state == cia402_quick_stop_active       ? cia402_switch_on_disabled
                                     : state == cia402_fault_reaction_active ? cia402_fault
                                                                             : (enum cia402_state)state;
        TEST_ASSERT_EQUAL(expected, machine.state);
    }
    struct cia402_machine machine = {.state = cia402_quick_stop_active, .options = cia402_options_default()};
    machine.options.quick_stop = 6;
    cia402_machine_stood_still(&machine);
    TEST_ASSERT_EQUAL(cia402_quick_stop_active, machine.state);
}

static void test_cia402_disable_operation_ramps_and_can_be_taken_back(void)
{
    struct cia402_machine machine = {.state = cia402_operation_enabled, .options = cia402_options_default()};
    cia402_machine_command(&machine, cia402_control_switch_on);
    TEST_ASSERT_EQUAL(cia402_operation_enabled, machine.state);
    TEST_ASSERT_EQUAL(cia402_slow_down_ramp, cia402_machine_action(&machine));
    cia402_machine_command(&machine, cia402_control_enable_operation);
    TEST_ASSERT_EQUAL(cia402_follow_setpoints, cia402_machine_action(&machine));
    cia402_machine_stood_still(&machine);
    TEST_ASSERT_EQUAL(cia402_operation_enabled, machine.state);
    cia402_machine_command(&machine, cia402_control_switch_on);
    cia402_machine_stood_still(&machine);
    TEST_ASSERT_EQUAL(cia402_switched_on, machine.state);
    // Standstill is for this ramp, not for the next operation.
    cia402_machine_command(&machine, cia402_control_enable_operation);
    cia402_machine_stood_still(&machine);
    TEST_ASSERT_EQUAL(cia402_operation_enabled, machine.state);
}

static void test_cia402_halt_ramps_and_stays_enabled(void)
{
    for (int16_t option = 1; option <= 2; option++) {
        struct cia402_machine machine = {.state = cia402_operation_enabled, .options = cia402_options_default()};
        machine.options.halt = option;
        cia402_machine_command(&machine, cia402_control_enable_operation | cia402_control_halt);
        TEST_ASSERT_EQUAL(option == 1 ? cia402_slow_down_ramp : cia402_quick_stop_ramp,
                          cia402_machine_action(&machine));
        cia402_machine_stood_still(&machine);
        TEST_ASSERT_EQUAL(cia402_operation_enabled, machine.state);
        cia402_machine_command(&machine, cia402_control_enable_operation);
        TEST_ASSERT_EQUAL(cia402_follow_setpoints, cia402_machine_action(&machine));
    }
}

static void test_cia402_option_codes_hold_what_is_implemented(void)
{
    static const struct {
        uint16_t index;
        const char *values;
    } rows[] = {
        {0x6007, "0123"}, {0x605A, "01256"}, {0x605B, "01"}, {0x605C, "01"},
        {0x605D, "12"},   {0x605E, "012"},   {0x605F, ""},
    };
    for (size_t r = 0; r < sizeof rows / sizeof rows[0]; r++)
        for (int value = -128; value <= 127; value++) {
            bool listed = value >= 0 && value <= 9 && strchr(rows[r].values, '0' + value) != NULL;
            TEST_ASSERT_EQUAL(listed, cia402_option_is_valid(rows[r].index, value));
        }
}

static void test_cia402_fault_reset_is_an_edge(void)
{
    struct cia402_machine machine;
    cia402_machine_init(&machine);
    machine.state = cia402_fault;
    machine.control_word = cia402_control_fault_reset;
    TEST_ASSERT_FALSE(cia402_machine_command(&machine, cia402_control_fault_reset));
    TEST_ASSERT_EQUAL(cia402_fault, machine.state);
    TEST_ASSERT_FALSE(cia402_machine_command(&machine, 0));
    TEST_ASSERT_TRUE(cia402_machine_command(&machine, cia402_control_fault_reset));
    TEST_ASSERT_EQUAL(cia402_switch_on_disabled, machine.state);
}

static void test_cia402_period_is_exact_or_refused(void)
{
    uint8_t units;
    int8_t exponent;
    TEST_ASSERT_TRUE(cia402_period_encode(1.0 / 1000.0, &units, &exponent));
    TEST_ASSERT_EQUAL_UINT8(1, units);
    TEST_ASSERT_EQUAL_INT8(-3, exponent);
    TEST_ASSERT_TRUE(cia402_period_encode(1.0 / 8000.0, &units, &exponent));
    TEST_ASSERT_EQUAL_UINT8(125, units);
    TEST_ASSERT_EQUAL_INT8(-6, exponent);
    TEST_ASSERT_FALSE(cia402_period_encode(1.0 / 1024.0, &units, &exponent));
    TEST_ASSERT_FALSE(cia402_period_encode(1.0 / 3000.0, &units, &exponent));
    TEST_ASSERT_FALSE(cia402_period_encode(0.0, &units, &exponent));
    TEST_ASSERT_FALSE(cia402_period_encode(-1.0, &units, &exponent));
    TEST_ASSERT_FALSE(cia402_period_encode(NAN, &units, &exponent));
    TEST_ASSERT_FALSE(cia402_period_encode(INFINITY, &units, &exponent));
    for (int u = 1; u <= 255; u++)
        for (int e = -6; e <= 0; e++) {
            uint32_t period_us = cia402_period_us((uint8_t)u, (int8_t)e);
            TEST_ASSERT_TRUE(cia402_period_encode(period_us * 1e-6, &units, &exponent));
            TEST_ASSERT_EQUAL_UINT32(period_us, cia402_period_us(units, exponent));
        }
    TEST_ASSERT_EQUAL_UINT32(0, cia402_period_us(1, -7));
    TEST_ASSERT_EQUAL_UINT32(0, cia402_period_us(1, 1));
}

static void test_cia402_scaling_reads_units_or_says_what_is_wrong(void)
{
    struct cia402_scaling s;
    struct cia402_scaling_objects o = {4096, 1, CIA402_UNIT(0, cia402_unit_increment, 0), 0xFDB44700u, 500, 1000};
    const double exact = 1e-18; // below the last bit of either number
    TEST_ASSERT_NULL(cia402_scaling_read(&o, &s));
    TEST_ASSERT_DOUBLE_WITHIN(exact, 6.283185307179586 / 4096.0, s.position);
    TEST_ASSERT_DOUBLE_WITHIN(exact, 6.283185307179586 / 60.0 / 1000.0, s.velocity); // 0.001 rpm
    TEST_ASSERT_DOUBLE_WITHIN(exact, 0.0005, s.torque);
    o.revolutions = 0;
    TEST_ASSERT_NOT_NULL(cia402_scaling_read(&o, &s));
    o.revolutions = 1;
    o.rated_torque = 0;
    TEST_ASSERT_NOT_NULL(cia402_scaling_read(&o, &s));
    o.rated_torque = 500;
    o.velocity_unit = 0;
    TEST_ASSERT_NOT_NULL(cia402_scaling_read(&o, &s));
    o.velocity_unit = CIA402_UNIT(-3, cia402_unit_metre, cia402_unit_second);
    TEST_ASSERT_NOT_NULL(cia402_scaling_read(&o, &s)); // rotary position, linear velocity
    o.position_unit = CIA402_UNIT(-6, cia402_unit_metre, 0);
    TEST_ASSERT_NULL(cia402_scaling_read(&o, &s));
    TEST_ASSERT_TRUE(s.linear);
    o.position_unit = CIA402_UNIT(0, 0x41, 0); // degrees
    TEST_ASSERT_NOT_NULL(cia402_scaling_read(&o, &s));
}

static void test_cia402_units_round_saturate_and_count(void)
{
    uint32_t clipped = 0;
    TEST_ASSERT_EQUAL_INT32(3, cia402_to_units(1.25, 0.5, -10, 10, &clipped)); // halves away from zero
    TEST_ASSERT_EQUAL_INT32(-3, cia402_to_units(-1.25, 0.5, -10, 10, &clipped));
    TEST_ASSERT_EQUAL_INT32(10, cia402_to_units(5.2, 0.5, -10, 10, &clipped));
    TEST_ASSERT_EQUAL_UINT32(0, clipped);
    TEST_ASSERT_EQUAL_INT32(10, cia402_to_units(5.3, 0.5, -10, 10, &clipped));
    TEST_ASSERT_EQUAL_INT32(-10, cia402_to_units(-INFINITY, 0.5, -10, 10, &clipped));
    TEST_ASSERT_EQUAL_INT32(0, cia402_to_units(NAN, 0.5, -10, 10, &clipped));
    TEST_ASSERT_EQUAL_UINT32(3, clipped);
    TEST_ASSERT_EQUAL_INT32(INT32_MAX, cia402_to_units(1e300, 1e-6, INT32_MIN, INT32_MAX, &clipped));
    TEST_ASSERT_EQUAL_INT32(INT32_MIN, cia402_to_units(-2147483648.0, 1.0, INT32_MIN, INT32_MAX, &clipped));
    TEST_ASSERT_EQUAL_UINT32(4, clipped);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_cia402_every_pair_is_a_numbered_transition_or_nothing);
    RUN_TEST(test_cia402_torque_needs_three_commands);
    RUN_TEST(test_cia402_control_word_decodes_by_its_low_bits_only);
    RUN_TEST(test_cia402_status_word_tells_each_state_and_nothing_else);
    RUN_TEST(test_cia402_fault_reset_is_an_edge);
    RUN_TEST(test_cia402_every_state_takes_every_control_word_as_the_diagram_says);
    RUN_TEST(test_cia402_every_state_takes_every_own_event);
    RUN_TEST(test_cia402_standstill_ends_ramps_only);
    RUN_TEST(test_cia402_disable_operation_ramps_and_can_be_taken_back);
    RUN_TEST(test_cia402_halt_ramps_and_stays_enabled);
    RUN_TEST(test_cia402_option_codes_hold_what_is_implemented);
    RUN_TEST(test_cia402_period_is_exact_or_refused);
    RUN_TEST(test_cia402_scaling_reads_units_or_says_what_is_wrong);
    RUN_TEST(test_cia402_units_round_saturate_and_count);
    return UNITY_END();
}
