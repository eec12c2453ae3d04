/* SPDX-License-Identifier: MIT */
#include "sim/belt_drive.h"

#include "unity.h"

#include <math.h>
#include <string.h>

static const double two_pi = 6.283185307179586;

static struct sim_model model;
static struct sim_belt_drive drive;
static struct sim_sample sample;

void setUp(void)
{
    sim_model_default(&model);
}

void tearDown(void) {}

static void without_noise(void)
{
    model.sensors = (struct sim_sensors){0};
}

static void two_masses(void)
{
    model.structure = sim_structure_two_mass;
    model.motor_inertia_kgm2 = 0.004;
    model.load_inertia_kgm2 = 0.004;
    model.belt_stiffness_Nm_per_rad = 300.0;
    model.belt_damping_Nms_per_rad = 0.05;
}

static void play(const struct sim_command *command, size_t samples)
{
    for (size_t n = 0; n < samples; n++)
        sim_belt_drive_step(&drive, command, &sample);
}

/// A travel with acceleration, cruise and reversal: a sinusoid with its feed-forwards.
static struct sim_command travel(size_t n, double amplitude, double w)
{
    double t = (double)n / model.sample_rate_hz;
    double inertia = model.motor_inertia_kgm2 + model.load_inertia_kgm2;
    return (struct sim_command){.control = sim_control_cascade,
                                .position = amplitude * (1.0 - cos(w * t)),
                                .velocity = amplitude * w * sin(w * t),
                                .torque = inertia * amplitude * w * w * cos(w * t)};
}

// ---- Same seed, same run

static void record(uint64_t seed, size_t count, struct sim_sample *out)
{
    model.seed = seed;
    sim_belt_drive_init(&drive, &model, 0.1);
    for (size_t n = 0; n < count; n++) {
        struct sim_command command = travel(n, 0.5, 6.0);
        sim_belt_drive_step(&drive, &command, &out[n]);
    }
}

static void test_belt_drive_repeats_bit_for_bit_with_the_same_seed_only(void)
{
    enum { count = 2000 };
    static struct sim_sample first[count], second[count];
    two_masses();
    model.process_noise_Nm = 0.01;
    model.coulomb_friction_Nm = 0.05;
    record(7, count, first);
    record(7, count, second);
    TEST_ASSERT_EQUAL_MEMORY(first, second, sizeof first);
    record(8, count, second);
    size_t equal = 0;
    for (size_t n = 0; n < count; n++)
        equal += first[n].torque == second[n].torque || first[n].velocity == second[n].velocity;
    TEST_ASSERT_EQUAL_UINT(0, equal);
}

static void test_belt_drive_noise_of_one_sensor_does_not_depend_on_the_others(void)
{
    enum { count = 500 };
    static double torque[count];
    const struct sim_command off = {.control = sim_control_off};
    sim_belt_drive_init(&drive, &model, 0.0);
    for (size_t n = 0; n < count; n++) {
        sim_belt_drive_step(&drive, &off, &sample);
        torque[n] = sample.torque;
    }
    model.sensors.position_noise_rad = 0.0;
    model.sensors.velocity_noise_rad_per_s = 1.0;
    model.process_noise_Nm = 0.01;
    sim_belt_drive_init(&drive, &model, 0.0);
    for (size_t n = 0; n < count; n++) {
        sim_belt_drive_step(&drive, &off, &sample);
        TEST_ASSERT_EQUAL_DOUBLE(torque[n], sample.torque);
    }
}

// ---- Sensors

static void test_belt_drive_sensor_noise_has_the_given_deviations(void)
{
    enum { count = 20000 };
    // Five standard deviations of a variance estimated from that many samples: 5 sqrt(2 / count).
    const double chance = 0.05;
    const struct sim_command off = {.control = sim_control_off};
    double sums[4] = {0};
    model.sensors =
        (struct sim_sensors){.position_noise_rad = 2e-5, .velocity_noise_rad_per_s = 3e-3, .torque_noise_Nm = 4e-3};
    sim_belt_drive_init(&drive, &model, 1.5);
    for (size_t n = 0; n < count; n++) {
        sim_belt_drive_step(&drive, &off, &sample);
        sums[0] += pow((sample.position - 1.5) / 2e-5, 2) / count;
        sums[1] += pow(sample.velocity / 3e-3, 2) / count;
        sums[2] += pow(sample.torque / 4e-3, 2) / count;
        sums[3] += (sample.position - 1.5) / 2e-5 * (sample.load_position - 1.5) / 2e-5 / count;
    }
    for (size_t i = 0; i < 3; i++)
        TEST_ASSERT_DOUBLE_WITHIN(chance, 1.0, sums[i]);
    TEST_ASSERT_DOUBLE_WITHIN(chance, 0.0, sums[3]); // two encoders
}

static void test_belt_drive_encoder_gives_the_nearest_count(void)
{
    without_noise();
    const struct sim_command off = {.control = sim_control_off};
    for (int linear = 0; linear <= 1; linear++) {
        model.linear = linear;
        model.sensors.counts_per_rev = 4096.0; // counts per m on a linear axis
        double count = (linear ? 1.0 : two_pi) / 4096.0;
        for (double position = -0.3; position < 0.3; position += 0.0123) {
            sim_belt_drive_init(&drive, &model, position);
            play(&off, 1);
            TEST_ASSERT_DOUBLE_WITHIN(0.5001 * count, position, sample.position);
            double counts = sample.position / count;
            TEST_ASSERT_DOUBLE_WITHIN(1e-9, floor(counts + 0.5), counts);
        }
    }
}

static void test_belt_drive_speed_filter_is_of_first_order(void)
{
    without_noise();
    model.sensors.velocity_filter_s = 0.02;
    const struct sim_command off = {.control = sim_control_off};
    sim_belt_drive_init(&drive, &model, 0.0);
    drive.plant.velocity = 3.0; // no friction: stays
    for (size_t n = 0; n < 100; n++) {
        play(&off, 1);
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, -3.0 * expm1(-(double)(n + 1) / 20.0), sample.velocity);
    }
}

static void test_belt_drive_samples_before_it_moves(void)
{
    without_noise();
    const struct sim_command push = {.control = sim_control_torque, .torque = 0.5};
    sim_belt_drive_init(&drive, &model, 0.25);
    play(&push, 1);
    TEST_ASSERT_EQUAL_DOUBLE(0.25, sample.position);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, sample.velocity);
    TEST_ASSERT_EQUAL_DOUBLE(0.5, sample.torque_ref);
    TEST_ASSERT_EQUAL_DOUBLE(0.5, sample.torque);
    play(&push, 1);
    double dt_s = 1.0 / model.sample_rate_hz, acceleration = 0.5 / model.motor_inertia_kgm2;
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, acceleration * dt_s, sample.velocity);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.25 + 0.5 * acceleration * dt_s * dt_s, sample.position);
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, sample.position, sample.load_position);
}

// ---- Control

static void test_belt_drive_cascade_follows(void)
{
    without_noise();
    model.coulomb_friction_Nm = 0.05;
    model.viscous_friction_Nms_per_rad = 0.002;
    for (int two = 0; two <= 1; two++) {
        if (two)
            two_masses();
        sim_belt_drive_init(&drive, &model, 0.0);
        double worst = 0.0;
        for (size_t n = 0; n < 4000; n++) {
            struct sim_command command = travel(n, 1.0, 6.0);
            sim_belt_drive_step(&drive, &command, &sample);
            if (n >= 1000)
                worst = fmax(worst, fabs(sample.position - command.position));
        }
        TEST_ASSERT_TRUE_MESSAGE(worst < 0.01, "following error over a hundredth of the travel's amplitude");
    }
}

static void test_belt_drive_cascade_is_the_documented_law(void)
{
    without_noise();
    model.controller = (struct sim_controller){.position_gain_per_s = 30.0,
                                               .velocity_gain_Nms_per_rad = 0.5,
                                               .velocity_integral_time_s = 0.1,
                                               .velocity_feedforward = 0.8,
                                               .torque_feedforward = 0.6};
    double integral = 0.0;
    sim_belt_drive_init(&drive, &model, 0.0);
    for (size_t n = 0; n < 300; n++) {
        struct sim_command command = travel(n, 1.0, 9.0);
        sim_belt_drive_step(&drive, &command, &sample);
        double error = 30.0 * (command.position - sample.position) + 0.8 * command.velocity - sample.velocity;
        TEST_ASSERT_DOUBLE_WITHIN(1e-11, 0.5 * error + integral + 0.6 * command.torque, sample.torque_ref);
        integral += 0.5 * error / (0.1 * model.sample_rate_hz);
    }
}

static void test_belt_drive_off_gives_no_torque_and_forgets_the_integral(void)
{
    without_noise();
    model.coulomb_friction_Nm = 0.1;
    sim_belt_drive_init(&drive, &model, 0.0);
    const struct sim_command far = {.control = sim_control_cascade, .position = 1e-3},
                             off = {.control = sim_control_off};
    play(&far, 200);
    TEST_ASSERT_TRUE(drive.velocity_integral != 0.0);
    play(&off, 1);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, sample.torque_ref);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, drive.velocity_integral);
}

/// Cruises, then stops quickly: every step of the torque is one that the ramp's steps make through the speed
/// controller.
static void assert_quick_stop(double speed)
{
    sim_belt_drive_init(&drive, &model, 0.0);
    for (size_t n = 0; n < 3000; n++) {
        struct sim_command cruise = {
            .control = sim_control_cascade, .position = speed * (double)n / model.sample_rate_hz, .velocity = speed};
        sim_belt_drive_step(&drive, &cruise, &sample);
    }
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, speed, sample.velocity);
    const struct sim_command stop = {.control = sim_control_stop};
    double slope = drive.stop_deceleration / model.sample_rate_hz, last = sample.torque_ref;
    double ramp_step = model.controller.velocity_gain_Nms_per_rad * slope;
    double ramp_s = fabs(speed) / drive.stop_deceleration;
    size_t ramp = (size_t)(ramp_s * model.sample_rate_hz);
    for (size_t n = 0; n < ramp + 500; n++) {
        double before = sample.velocity;
        play(&stop, 1);
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(1.001 * ramp_step + 1e-6, last, sample.torque_ref,
                                          "torque step in a quick stop");
        last = sample.torque_ref;
        if (n > 100 && n < ramp)
            TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(0.2 * slope, copysign(slope, speed), before - sample.velocity,
                                              "deceleration");
    }
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(1e-3 * fabs(speed), 0.0, sample.velocity, "speed after the ramp");
    play(&stop, 1500);
    double position = sample.position;
    play(&stop, 1000);
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(1e-6, position, sample.position, "standstill");
}

static void test_belt_drive_quick_stop_ramps_to_standstill_without_a_jerk(void)
{
    without_noise();
    model.controller.torque_feedforward = 0.0;
    assert_quick_stop(20.0);
    assert_quick_stop(-20.0);
    model.coulomb_friction_Nm = 0.05;
    model.viscous_friction_Nms_per_rad = 0.004;
    assert_quick_stop(12.0);
    const struct sim_command off = {.control = sim_control_off};
    play(&off, 10);
    TEST_ASSERT_TRUE_MESSAGE(drive.plant.velocity == 0.0, "friction holds the axis after a quick stop");
}

static void test_belt_drive_quick_stop_from_torque_control_and_with_noise(void)
{
    const struct sim_command push = {.control = sim_control_torque, .torque = 0.4},
                             stop = {.control = sim_control_stop};
    model.coulomb_friction_Nm = 0.05;
    sim_belt_drive_init(&drive, &model, 0.0);
    play(&push, 300);
    TEST_ASSERT_TRUE(drive.plant.velocity > 15.0);
    play(&stop, 2000);
    TEST_ASSERT_DOUBLE_WITHIN(0.02, 0.0, drive.plant.velocity);
}

/// How far the axis passes its target on a step of 0.3 rad under a torque limit.
static double limited_overshoot(void)
{
    const struct sim_command step = {.control = sim_control_cascade, .position = 0.3};
    double overshoot = 0.0;
    size_t clipped = 0;
    sim_belt_drive_init(&drive, &model, 0.0);
    drive.torque_limit = 1.0;
    for (size_t n = 0; n < 2000; n++) {
        double integral = drive.velocity_integral;
        play(&step, 1);
        TEST_ASSERT_TRUE(fabs(sample.torque_ref) <= 1.0);
        if (fabs(sample.torque_ref) == 1.0) {
            clipped++;
            TEST_ASSERT_EQUAL_DOUBLE_MESSAGE(integral, drive.velocity_integral, "the integral moved while clipped");
        }
        overshoot = fmax(overshoot, sample.position - 0.3);
    }
    TEST_ASSERT_TRUE(clipped > 20);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 0.3, sample.position);
    return overshoot;
}

static void test_belt_drive_clips_the_torque_and_does_not_wind_up(void)
{
    without_noise();
    double with_integral = limited_overshoot();
    model.controller.velocity_integral_time_s = 0.0;
    double without_integral = limited_overshoot();
    // Integrated through the clipped part, the error would carry the axis on; standing still, it adds next to nothing.
    TEST_ASSERT_DOUBLE_WITHIN(0.02 * 0.3, without_integral, with_integral);
}

static void test_belt_drive_end_stop_holds_the_axis_and_is_remembered(void)
{
    without_noise();
    model.has_end_stops = true;
    model.end_stops_rad[0] = -0.2;
    model.end_stops_rad[1] = 0.5;
    for (int two = 0; two <= 1; two++) {
        if (two)
            two_masses();
        sim_belt_drive_init(&drive, &model, 0.0);
        struct sim_command push = {.control = sim_control_torque, .torque = 0.4};
        play(&push, 20);
        TEST_ASSERT_FALSE(drive.hit_end_stop);
        for (size_t n = 0; n < 2000; n++) {
            play(&push, 1);
            TEST_ASSERT_TRUE(sample.position <= 0.5);
        }
        TEST_ASSERT_TRUE(drive.hit_end_stop);
        TEST_ASSERT_EQUAL_DOUBLE(0.5, sample.position);
        TEST_ASSERT_EQUAL_DOUBLE(0.0, sample.velocity);
        push.torque = -0.4;
        play(&push, 40);
        TEST_ASSERT_TRUE(sample.position < 0.5 && sample.position > -0.2);
        TEST_ASSERT_TRUE(drive.hit_end_stop);
        for (size_t n = 0; n < 2000; n++) {
            play(&push, 1);
            TEST_ASSERT_TRUE(sample.position >= -0.2);
        }
        TEST_ASSERT_EQUAL_DOUBLE(-0.2, sample.position);
    }
}

static void test_belt_drive_process_noise_moves_the_motor_like_torque(void)
{
    enum { count = 20000 };
    // Five standard deviations of a variance estimated from that many samples.
    const double chance = 0.05;
    const struct sim_command off = {.control = sim_control_off};
    without_noise();
    model.process_noise_Nm = 0.02;
    sim_belt_drive_init(&drive, &model, 0.0);
    double sum = 0.0, last = 0.0;
    for (size_t n = 0; n <= count; n++) {
        play(&off, 1);
        double torque = model.motor_inertia_kgm2 * model.sample_rate_hz * (sample.velocity - last);
        if (n > 0)
            sum += torque * torque / (0.02 * 0.02) / count;
        last = sample.velocity;
        TEST_ASSERT_EQUAL_DOUBLE(0.0, sample.torque);
    }
    TEST_ASSERT_DOUBLE_WITHIN(chance, 1.0, sum);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_belt_drive_repeats_bit_for_bit_with_the_same_seed_only);
    RUN_TEST(test_belt_drive_noise_of_one_sensor_does_not_depend_on_the_others);
    RUN_TEST(test_belt_drive_sensor_noise_has_the_given_deviations);
    RUN_TEST(test_belt_drive_encoder_gives_the_nearest_count);
    RUN_TEST(test_belt_drive_speed_filter_is_of_first_order);
    RUN_TEST(test_belt_drive_samples_before_it_moves);
    RUN_TEST(test_belt_drive_cascade_follows);
    RUN_TEST(test_belt_drive_cascade_is_the_documented_law);
    RUN_TEST(test_belt_drive_off_gives_no_torque_and_forgets_the_integral);
    RUN_TEST(test_belt_drive_quick_stop_ramps_to_standstill_without_a_jerk);
    RUN_TEST(test_belt_drive_quick_stop_from_torque_control_and_with_noise);
    RUN_TEST(test_belt_drive_clips_the_torque_and_does_not_wind_up);
    RUN_TEST(test_belt_drive_end_stop_holds_the_axis_and_is_remembered);
    RUN_TEST(test_belt_drive_process_noise_moves_the_motor_like_torque);
    return UNITY_END();
}
