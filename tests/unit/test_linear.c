/* SPDX-License-Identifier: MIT */
/// The linear response of a model against closed forms, against the plant in the time domain, and against differences.
/// sim/linear.h.
#include "sim/linear.h"
#include "sim/plant.h"

#include "unity.h"

#include <math.h>

static const double two_pi = 6.283185307179586;
static const double rounding = 1e-12;

static struct sim_model model;

/// Antiresonance at 20 Hz, resonance near 24 Hz, little damping.
void setUp(void)
{
    sim_model_default(&model);
    model.structure = sim_structure_two_mass;
    model.motor_inertia_kgm2 = 0.0035;
    model.load_inertia_kgm2 = 0.0015;
    model.belt_stiffness_Nm_per_rad = 0.0015 * (two_pi * 20) * (two_pi * 20);
    model.belt_damping_Nms_per_rad = 0.01;
    model.viscous_friction_Nms_per_rad = 0.02;
}

void tearDown(void) {}

static void assert_near(double complex expected, double complex actual, double tolerance)
{
    TEST_ASSERT_DOUBLE_WITHIN(tolerance * cabs(expected), creal(expected), creal(actual));
    TEST_ASSERT_DOUBLE_WITHIN(tolerance * cabs(expected), cimag(expected), cimag(actual));
}

static struct sim_linear_response at(double omega)
{
    struct sim_linear_response response;
    sim_linear_response(&model, omega, &response);
    return response;
}

static void test_linear_response_of_a_rigid_model_is_one_mass_with_friction(void)
{
    model.structure = sim_structure_rigid;
    double complex expected = 1 / (I * 30.0 * 0.005 + 0.02);
    assert_near(expected, at(30).motor_velocity, rounding);
    assert_near(expected, at(30).load_velocity, rounding);
}

static void test_linear_response_of_a_stiff_belt_is_that_of_a_rigid_model(void)
{
    model.belt_stiffness_Nm_per_rad = 1e9;
    assert_near(1 / (I * 30.0 * 0.005 + 0.02), at(30).motor_velocity, 1e-8);
}

/// Without damping the motor stands still where the load swings against its belt alone: torque and belt cancel.
static void test_linear_response_has_its_antiresonance_where_load_and_belt_swing_alone(void)
{
    const double omega = two_pi * 20;
    model.belt_damping_Nms_per_rad = 0;
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0, cabs(at(omega).motor_velocity));
    assert_near(1 / (I * model.belt_stiffness_Nm_per_rad / omega), at(omega).load_velocity, 1e-9);
}

static void test_linear_response_has_its_resonance_where_both_masses_swing(void)
{
    const double omega = sqrt(model.belt_stiffness_Nm_per_rad * (1 / 0.0035 + 1 / 0.0015));
    const double peak = cabs(at(omega).motor_velocity);
    TEST_ASSERT_TRUE(peak > cabs(at(0.95 * omega).motor_velocity));
    TEST_ASSERT_TRUE(peak > cabs(at(1.05 * omega).motor_velocity));
}

/// The plant under a sine torque, after its transient; Fourier sums over whole periods.
static void test_linear_response_is_that_of_the_plant_in_the_time_domain(void)
{
    enum { steps_per_period = 20000, settle = 40, periods = 4 };
    const double hz = 22; // between antiresonance and resonance
    const double dt_s = 1 / (hz * steps_per_period);
    const double discretised = 1e-4; // torque constant over a step, and exp(-40 periods) of the transient
    struct sim_plant plant;
    double complex motor = 0;
    double complex load = 0;
    sim_plant_init(&plant, 0);
    for (long n = 0; n < (long)(settle + periods) * steps_per_period; n++) {
        double angle = two_pi * ((double)(n % steps_per_period) + 0.5) / steps_per_period;
        if (n >= (long)settle * steps_per_period) {
            double complex turn = cexp(-I * (angle - two_pi * 0.5 / steps_per_period));
            motor += 2.0 / (periods * (double)steps_per_period) * plant.velocity * turn;
            load += 2.0 / (periods * (double)steps_per_period) * plant.load_velocity * turn;
        }
        sim_plant_step(&plant, &model, cos(angle), dt_s);
    }
    assert_near(at(two_pi * hz).motor_velocity, motor, discretised);
    assert_near(at(two_pi * hz).load_velocity, load, discretised);
}

static void test_linear_actuator_delays_and_lags(void)
{
    model.torque_lag_s = 0.002;
    model.dead_time_s = 0.003;
    const double omega = 100;
    double complex actuator = sim_linear_actuator(&model, omega);
    TEST_ASSERT_DOUBLE_WITHIN(rounding, 1 / sqrt(1 + 0.04), cabs(actuator));
    TEST_ASSERT_DOUBLE_WITHIN(rounding, -0.3 - atan(0.2), carg(actuator));
}

/// Central differences of the response itself, relative step 1e-4: error of the order 1e-8 times the curvature.
static void check_sensitivities(size_t expected_count)
{
    double *parameters[sim_linear_parameters_max] = {
        [sim_linear_inertia] = &model.motor_inertia_kgm2,
        [sim_linear_viscous_friction] = &model.viscous_friction_Nms_per_rad,
        [sim_linear_load_inertia] = &model.load_inertia_kgm2,
        [sim_linear_belt_stiffness] = &model.belt_stiffness_Nm_per_rad,
        [sim_linear_belt_damping] = &model.belt_damping_Nms_per_rad,
    };
    const double hz[] = {0.5, 5, 19, 22, 30, 200};
    for (size_t f = 0; f < sizeof hz / sizeof hz[0]; f++) {
        double complex sensitivities[sim_linear_parameters_max];
        const double omega = two_pi * hz[f];
        TEST_ASSERT_EQUAL_size_t(expected_count, sim_linear_sensitivities(&model, omega, sensitivities));
        for (size_t i = 0; i < expected_count; i++) {
            const double value = *parameters[i];
            const double step = 1e-4 * value;
            *parameters[i] = value + step;
            double complex above = at(omega).motor_velocity;
            *parameters[i] = value - step;
            double complex below = at(omega).motor_velocity;
            *parameters[i] = value;
            // What the difference of two responses has lost of their digits.
            const double lost = 1e-14 * cabs(above) / (step * cabs(sensitivities[i]));
            assert_near(sensitivities[i], (above - below) / (2 * step), 1e-5 + lost);
        }
    }
}

static void test_linear_sensitivities_are_derivatives_of_the_response(void)
{
    check_sensitivities(sim_linear_parameters_max);
}

static void test_linear_sensitivities_of_a_rigid_model_are_of_inertia_and_friction(void)
{
    model.structure = sim_structure_rigid;
    check_sensitivities(2);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_linear_response_of_a_rigid_model_is_one_mass_with_friction);
    RUN_TEST(test_linear_response_of_a_stiff_belt_is_that_of_a_rigid_model);
    RUN_TEST(test_linear_response_has_its_antiresonance_where_load_and_belt_swing_alone);
    RUN_TEST(test_linear_response_has_its_resonance_where_both_masses_swing);
    RUN_TEST(test_linear_response_is_that_of_the_plant_in_the_time_domain);
    RUN_TEST(test_linear_actuator_delays_and_lags);
    RUN_TEST(test_linear_sensitivities_are_derivatives_of_the_response);
    RUN_TEST(test_linear_sensitivities_of_a_rigid_model_are_of_inertia_and_friction);
    return UNITY_END();
}
