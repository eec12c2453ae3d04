/* SPDX-License-Identifier: MIT */
#include "drivers/can/cia402.h"
#include "drivers/can/cia402_scaling.h"

#include "unity.h"

#include <math.h>
#include <stdio.h>

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

static void test_cia402_enable_from_ready_passes_switched_on(void)
{
    struct cia402_machine machine = {.state = cia402_ready};
    cia402_machine_command(&machine, cia402_control_enable_operation);
    TEST_ASSERT_EQUAL(cia402_operation_enabled, machine.state);
}

static void test_cia402_quick_stop_runs_to_its_end_unless_it_may_stay(void)
{
    struct cia402_machine machine = {.state = cia402_quick_stop_active};
    cia402_machine_command(&machine, cia402_control_enable_operation);
    TEST_ASSERT_EQUAL(cia402_quick_stop_active, machine.state);
    machine.stays_in_quick_stop = true;
    cia402_machine_command(&machine, cia402_control_enable_operation);
    TEST_ASSERT_EQUAL(cia402_operation_enabled, machine.state);
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
    struct cia402_scaling_objects o = {4096, 1, CIA402_UNIT(0, cia402_unit_increment, 0), 0xFDB44700u, 500};
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
    RUN_TEST(test_cia402_enable_from_ready_passes_switched_on);
    RUN_TEST(test_cia402_quick_stop_runs_to_its_end_unless_it_may_stay);
    RUN_TEST(test_cia402_period_is_exact_or_refused);
    RUN_TEST(test_cia402_scaling_reads_units_or_says_what_is_wrong);
    RUN_TEST(test_cia402_units_round_saturate_and_count);
    return UNITY_END();
}
