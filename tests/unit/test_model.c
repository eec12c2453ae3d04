/* SPDX-License-Identifier: MIT */
#include "sim/model.h"

#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static struct sim_model model;
static char buffer[200];

void setUp(void)
{
    sim_model_default(&model);
}

void tearDown(void) {}

static void make_two_masses(void)
{
    model.structure = sim_structure_two_mass;
    model.load_inertia_kgm2 = 0.004;
    model.belt_stiffness_Nm_per_rad = 100.0;
}

static const char *check(void)
{
    memset(buffer, 0, sizeof buffer);
    return sim_model_check(&model, buffer, sizeof buffer);
}

static double *field_at(size_t offset)
{
    return (double *)(void *)((char *)&model + offset);
}

static void assert_refused(size_t offset, double value, const char *name)
{
    char message[160];
    double kept = *field_at(offset);
    snprintf(message, sizeof message, "%s (offset %zu) = %g", name, offset, value);
    *field_at(offset) = value;
    const char *wrong = check();
    TEST_ASSERT_NOT_NULL_MESSAGE(wrong, message);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(wrong, name), message);
    *field_at(offset) = kept;
    TEST_ASSERT_NULL_MESSAGE(check(), message);
}

static void test_model_default_is_valid_rotary_and_linear(void)
{
    TEST_ASSERT_NULL(check());
    model.linear = true;
    TEST_ASSERT_NULL(check());
    make_two_masses();
    TEST_ASSERT_NULL(check());
}

/// Every number there is in a model, whatever its name: a field that nobody checks would pass as NaN.
static void test_model_check_refuses_nan_in_every_number(void)
{
    static const struct {
        size_t from, to;
    } numbers[] = {
        {offsetof(struct sim_model, motor_inertia_kgm2), offsetof(struct sim_model, has_end_stops)},
        {offsetof(struct sim_model, end_stops_rad), offsetof(struct sim_model, seed)},
        {offsetof(struct sim_model, controller), offsetof(struct sim_model, effect_on)},
    };
    make_two_masses();
    model.has_end_stops = true;
    model.end_stops_rad[0] = -1.0;
    model.end_stops_rad[1] = 1.0;
    TEST_ASSERT_NULL(check());
    size_t count = 0;
    for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++)
        for (size_t offset = numbers[i].from; offset + sizeof(double) <= numbers[i].to; offset += sizeof(double)) {
            assert_refused(offset, NAN, "");
            count++;
        }
    TEST_ASSERT_TRUE(count >= 23);
}

static void test_model_check_refuses_each_field_out_of_range_and_names_it(void)
{
    make_two_masses();
#define FIELD(member) offsetof(struct sim_model, member), #member
    static const struct {
        size_t offset;
        const char *name;
        double low, high; ///< just outside
    } fields[] = {
        {FIELD(motor_inertia_kgm2), 0.0, 2e9},
        {FIELD(load_inertia_kgm2), 0.0, 2e9},
        {FIELD(belt_stiffness_Nm_per_rad), 0.0, 2e12},
        {FIELD(belt_damping_Nms_per_rad), -1e-9, 2e9},
        {FIELD(viscous_friction_Nms_per_rad), -1e-9, 2e9},
        {FIELD(coulomb_friction_Nm), -1e-9, 2e9},
        {FIELD(torque_lag_s), -1e-9, 10.1},
        {FIELD(dead_time_s), -1e-9, 0.0601},
        {FIELD(pulley_radius_m), -1e-9, 2e9},
        {FIELD(sample_rate_hz), 0.99, 1.1e6},
        {FIELD(process_noise_Nm), -1e-9, 2e9},
        {FIELD(controller.position_gain_per_s), -1e-9, 2e9},
        {FIELD(controller.velocity_gain_Nms_per_rad), -1e-9, 2e9},
        {FIELD(controller.velocity_integral_time_s), -2e9, 2e9},
        {FIELD(controller.velocity_feedforward), -1e-9, 1.001},
        {FIELD(controller.torque_feedforward), -1e-9, 1.001},
        {FIELD(sensors.counts_per_rev), -1e-9, 2e15},
        {FIELD(sensors.position_noise_rad), -1e-9, 2e9},
        {FIELD(sensors.velocity_noise_rad_per_s), -1e-9, 2e9},
        {FIELD(sensors.torque_noise_Nm), -1e-9, 2e9},
        {FIELD(sensors.velocity_filter_s), -1e-9, 10.1},
    };
#undef FIELD
    for (size_t i = 0; i < sizeof fields / sizeof fields[0]; i++) {
        assert_refused(fields[i].offset, fields[i].low, fields[i].name);
        assert_refused(fields[i].offset, fields[i].high, fields[i].name);
        assert_refused(fields[i].offset, INFINITY, fields[i].name);
        assert_refused(fields[i].offset, -INFINITY, fields[i].name);
    }
}

static void test_model_check_wants_some_inertia_of_a_rigid_drive(void)
{
    model.motor_inertia_kgm2 = 0.0;
    model.load_inertia_kgm2 = 0.0;
    TEST_ASSERT_NOT_NULL(check());
    model.load_inertia_kgm2 = 1e-3;
    TEST_ASSERT_NULL(check());
}

static void test_model_check_refuses_end_stops_in_the_wrong_order_only_if_there_are_any(void)
{
    model.end_stops_rad[0] = 1.0;
    model.end_stops_rad[1] = 1.0;
    TEST_ASSERT_NULL(check());
    model.has_end_stops = true;
    TEST_ASSERT_NOT_NULL(check());
    TEST_ASSERT_NOT_NULL(strstr(buffer, "end_stops_rad"));
    model.end_stops_rad[0] = -1.0;
    TEST_ASSERT_NULL(check());
}

static void test_model_check_refuses_parameters_of_effects_out_of_their_bounds(void)
{
    for (int linear = 0; linear <= 1; linear++)
        for (size_t e = 0; sim_effects[e]; e++) {
            const struct sim_effect *effect = sim_effects[e];
            sim_model_default(&model);
            model.linear = linear;
            for (size_t i = 0; i < effect->parameter_count; i++)
                model.effect_parameters[e][i] = NAN; // no matter while it is off
            TEST_ASSERT_NULL(check());
            model.effect_on[e] = true;
            if (effect->place == sim_place_belt) {
                TEST_ASSERT_NOT_NULL_MESSAGE(check(), effect->id); // of a rigid drive
                make_two_masses();
            }
            for (size_t i = 0; i < effect->parameter_count; i++)
                model.effect_parameters[e][i] =
                    linear ? effect->parameters[i].linear_minimum : effect->parameters[i].minimum;
            TEST_ASSERT_NULL_MESSAGE(check(), effect->id);
            for (size_t i = 0; i < effect->parameter_count; i++) {
                const struct sim_parameter *p = &effect->parameters[i];
                const char *name = linear ? p->linear_name : p->name;
                double low = linear ? p->linear_minimum : p->minimum, high = linear ? p->linear_maximum : p->maximum;
                double wrong[] = {NAN, INFINITY, low - fabs(low) * 1e-3 - 1e-9, high + fabs(high) * 1e-3};
                for (size_t w = 0; w < sizeof wrong / sizeof wrong[0]; w++) {
                    model.effect_parameters[e][i] = wrong[w];
                    TEST_ASSERT_NOT_NULL_MESSAGE(check(), name);
                    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(buffer, effect->id), buffer);
                    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(buffer, name), buffer);
                }
                model.effect_parameters[e][i] = high;
                TEST_ASSERT_NULL_MESSAGE(check(), name);
            }
        }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_model_default_is_valid_rotary_and_linear);
    RUN_TEST(test_model_check_refuses_nan_in_every_number);
    RUN_TEST(test_model_check_refuses_each_field_out_of_range_and_names_it);
    RUN_TEST(test_model_check_wants_some_inertia_of_a_rigid_drive);
    RUN_TEST(test_model_check_refuses_end_stops_in_the_wrong_order_only_if_there_are_any);
    RUN_TEST(test_model_check_refuses_parameters_of_effects_out_of_their_bounds);
    return UNITY_END();
}
