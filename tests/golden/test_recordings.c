/* SPDX-License-Identifier: MIT */
/// Real recordings that nobody on this project made, read as a user would. SERVOSCOPE_DATA names their folder.
#include "lab/estimate/clocked.h"
#include "lab/estimate/direction.h"
#include "lab/estimate/frf_mean.h"
#include "lab/numeric/cmplx.h"
#include "lab/record/run.h"
#include "unity.h"

#include <complex.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

static struct run run;
static struct clocked clocked;
static struct frf frf;

void setUp(void) {}

void tearDown(void)
{
    clocked_free(&clocked);
    frf_free(&frf);
    run_free(&run);
}

static void read_recording(const char *name, const char *map, double rate_hz)
{
    static char path[1024];
    struct error error = {0};
    struct stat file;
    const char *folder = getenv("SERVOSCOPE_DATA");
    if (!folder || !*folder)
        TEST_IGNORE_MESSAGE("skipped: no data");
    snprintf(path, sizeof path, "%s/%s", folder, name);
    if (stat(path, &file) != 0)
        TEST_IGNORE_MESSAGE("skipped: no data");
    struct run_options options = {.map = map, .rate_hz = rate_hz};
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, run_read(path, &options, &run, &error), error.message);
}

static void test_recordings_emps_is_a_linear_axis_of_1_khz(void)
{
    read_recording("emps/DATA_EMPS.csv", "force_N=force_gtau_x_vir_N,position_m=qm_motor_position_m,time_s=t_s", 0);
    TEST_ASSERT_EQUAL_UINT(24841, run.rows);
    TEST_ASSERT_EQUAL_DOUBLE(1000, run.sample_rate_hz);
    TEST_ASSERT_TRUE(run.linear);
    TEST_ASSERT_EQUAL_DOUBLE(89.23443221, run_column(&run, "force_N")[0]);
    TEST_ASSERT_EQUAL_DOUBLE(0.00361505, run_column(&run, "position_m")[24840]);
}

static void test_recordings_emps_pulses_has_the_same_length(void)
{
    read_recording("emps/DATA_EMPS_PULSES.csv", "force_N=force_gtau_x_vir_N,position_m=qm_motor_position_m", 0);
    TEST_ASSERT_EQUAL_UINT(24841, run.rows);
    TEST_ASSERT_EQUAL_DOUBLE(1000, run.sample_rate_hz);
    TEST_ASSERT_EQUAL_DOUBLE(5, run_column(&run, "pulses_N_raw")[24840]);
}

static void test_recordings_twomass_is_rotary_at_2500_hz(void)
{
    read_recording("twomass/MultisineTypeA.csv",
                   "time_s=t_s,current_A=iq_meas_A,position_rad=theta_motor_rad,velocity_rad_per_s=omega_motor_rad_s,"
                   "load_position_rad=theta_load_rad_sign_reversed*-1",
                   0);
    TEST_ASSERT_EQUAL_UINT(50000, run.rows);
    TEST_ASSERT_EQUAL_DOUBLE(2500, run.sample_rate_hz);
    TEST_ASSERT_FALSE(run.linear);
    TEST_ASSERT_EQUAL_DOUBLE(-0.6393764, run_column(&run, "load_position_rad")[49998]);
}

static void test_recordings_linear_guide_keeps_the_clock_of_its_time_stamps(void)
{
    // The recording computer's clock ran a little off 1 kHz; the time stamps have 8 digits.
    const double clock_share = 2e-4;
    read_recording(
        "linear_guide/exp1.csv",
        "time_s=t_s,voltage_V=input_V,position_m=enc1_motor_mass_mm*0.001,load_position_m=enc2_load_mass_mm*0.001", 0);
    TEST_ASSERT_EQUAL_UINT(100610, run.rows);
    TEST_ASSERT_DOUBLE_WITHIN(1000 * clock_share, 1000, run.sample_rate_hz);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 100.59805, (double)(run.rows - 1) / run.sample_rate_hz);
    TEST_ASSERT_EQUAL_DOUBLE(8.20625 * 0.001, run_column(&run, "position_m")[0]);
}

/* As `frf` does it without any option but --map. */
static void estimate(const char *output)
{
    struct error error = {0};
    const struct periodic_options options = {.output = output};
    clocked_free(&clocked);
    frf_free(&frf);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, clocked_cut(&run, &options, false, &clocked, &error), error.message);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, frf_mean_estimate(&clocked.recording, NULL, &frf, &error), error.message);
    for (size_t line = 0; line < frf.count; line++)
        TEST_ASSERT_TRUE(frf.valid[line]);
}

/* The response at the line nearest to a frequency, as that of a speed. */
static double complex speed_at(double frequency_hz)
{
    size_t best = 0;
    for (size_t line = 0; line < frf.count; line++)
        if (fabs(frf.frequency_hz[line] - frequency_hz) < fabs(frf.frequency_hz[best] - frequency_hz))
            best = line;
    return CMPLX(frf.real[best], frf.imag[best]) * I * 2 * 3.14159265358979 * frf.frequency_hz[best];
}

/* What the motor of two masses does beside its inertia line. */
static double resonance_factor(double frequency_hz, double anti_hz, double resonance_hz)
{
    return (1 - pow(frequency_hz / anti_hz, 2)) / (1 - pow(frequency_hz / resonance_hz, 2));
}

/* 1/J of the inertia line at a frequency. */
static double inverse_inertia(double frequency_hz, double anti_hz, double resonance_hz)
{
    return cabs(speed_at(frequency_hz)) * 2 * 3.14159265358979 * frequency_hz /
           fabs(resonance_factor(frequency_hz, anti_hz, resonance_hz));
}

static const char *const twomass_map =
    "current_A=iq_meas_A,position_rad=theta_motor_rad,velocity_rad_per_s=omega_motor_"
    "rad_s,load_position_rad=theta_load_rad_sign_reversed";

/* Its own README says: every line 11..250 Hz, 1 Hz apart, periods of 2500 samples; the load counts the other way. The
 * rest is physics: friction has no say above 11 Hz, so the motor's speed lies on the line of all inertia (-20 dB per
 * decade, -90 degrees) below the antiresonance, and on that of the motor alone above the resonance, which is
 * (f_r/f_a)^2 times as high: with the two masses' factor taken off, all lines say one inertia. */
static void test_recordings_twomass_response_is_that_of_two_masses(void)
{
    read_recording("twomass/MultisineTypeA.csv", twomass_map, 0);
    estimate("position_rad");
    TEST_ASSERT_EQUAL_UINT(2500, clocked.recording.period_samples);
    TEST_ASSERT_TRUE(clocked.recording.period_found && clocked.recording.bins_found);
    TEST_ASSERT_EQUAL_UINT(240, frf.count);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 11, frf.frequency_hz[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 250, frf.frequency_hz[239]);
    TEST_ASSERT_EQUAL_INT(clock_steady, clocked.clock.state);
    double anti_hz = 11, resonance_hz = 60;
    for (double f = 11; f < 150; f++) {
        anti_hz = cabs(speed_at(f)) < cabs(speed_at(anti_hz)) && f < 65 ? f : anti_hz;
        resonance_hz = cabs(speed_at(f)) > cabs(speed_at(resonance_hz)) && f > 60 ? f : resonance_hz;
    }
    TEST_ASSERT_DOUBLE_WITHIN(3, 54, anti_hz);
    TEST_ASSERT_DOUBLE_WITHIN(3, 76, resonance_hz);
    const double low = inverse_inertia(11, anti_hz, resonance_hz), high = inverse_inertia(120, anti_hz, resonance_hz);
    TEST_ASSERT_DOUBLE_WITHIN(0.08 * low, low, inverse_inertia(25, anti_hz, resonance_hz));
    TEST_ASSERT_DOUBLE_WITHIN(0.08 * high, high, inverse_inertia(200, anti_hz, resonance_hz));
    TEST_ASSERT_DOUBLE_WITHIN(0.15 * low, low, high); /* 1 Hz of the antiresonance makes 8 % of it */
    for (double f = 11; f <= 40; f++)
        TEST_ASSERT_DOUBLE_WITHIN(15, -90, carg(speed_at(f)) * 180 / 3.14159265358979);
}

static void test_recordings_twomass_load_counts_the_other_way(void)
{
    struct direction direction;
    read_recording("twomass/MultisineTypeA.csv", twomass_map, 0);
    estimate(NULL);
    TEST_ASSERT_EQUAL_STRING("velocity_rad_per_s", frf.output);
    TEST_ASSERT_TRUE(direction_measure(&clocked.recording, &direction));
    TEST_ASSERT_EQUAL_UINT(1, direction.count);
    TEST_ASSERT_EQUAL_STRING("load_position_rad", direction.found[0].name);
    TEST_ASSERT_TRUE(direction.found[0].cosine < -0.7);
}

/* Three realisations on one rail: nominally 5000 samples at 1 kHz, recorded every 4999; both encoders count against the
 * amplifier's voltage (a drive answers it with -180 degrees at high frequencies, these with 0). Rolling friction makes
 * low frequencies depend on the phases of the excitation; above 5 Hz the files agree within a third. */
static void test_recordings_linear_guide_files_agree(void)
{
    static const char *const files[] = {"linear_guide/exp1.csv", "linear_guide/exp2.csv", "linear_guide/exp3.csv"};
    double complex first[100];
    for (int i = 0; i < 3; i++) {
        struct direction direction;
        read_recording(files[i], "voltage_V=input_V,position_m=enc1_motor_mass_mm*0.001", 0);
        estimate(NULL);
        TEST_ASSERT_EQUAL_UINT(4999, clocked.recording.period_samples);
        TEST_ASSERT_EQUAL_INT(clock_steady, clocked.clock.state);
        TEST_ASSERT_EQUAL_UINT(100, frf.count);
        TEST_ASSERT_DOUBLE_WITHIN(0.001, 0.2, frf.frequency_hz[0]);
        TEST_ASSERT_TRUE(direction_measure(&clocked.recording, &direction));
        TEST_ASSERT_EQUAL_UINT(1, direction.count);
        TEST_ASSERT_EQUAL_STRING("voltage_V", direction.found[0].against);
        size_t apart = 0;
        for (size_t line = 0; line < 100; line++) {
            const double complex response = CMPLX(frf.real[line], frf.imag[line]);
            first[line] = i == 0 ? response : first[line];
            apart += frf.frequency_hz[line] > 5 && cabs(response - first[line]) > cabs(first[line]) / 3;
        }
        TEST_ASSERT_LESS_OR_EQUAL_UINT(15, apart); /* of 75; around the resonance at 13 Hz, which moves a little */
        run_free(&run);
    }
}

static void test_recordings_linear_guide_turned_round_is_a_drive_like_any_other(void)
{
    struct direction direction;
    read_recording("linear_guide/exp2.csv",
                   "voltage_V=input_V,position_m=enc1_motor_mass_mm*-0.001,load_position_m=enc2_load_mass_mm*-0.001",
                   0);
    estimate(NULL);
    TEST_ASSERT_TRUE(direction_measure(&clocked.recording, &direction));
    TEST_ASSERT_EQUAL_UINT(0, direction.count);
    for (double f = 5; f < 9; f++)
        TEST_ASSERT_DOUBLE_WITHIN(20, -90, carg(speed_at(f)) * 180 / 3.14159265358979);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_recordings_emps_is_a_linear_axis_of_1_khz);
    RUN_TEST(test_recordings_emps_pulses_has_the_same_length);
    RUN_TEST(test_recordings_twomass_is_rotary_at_2500_hz);
    RUN_TEST(test_recordings_linear_guide_keeps_the_clock_of_its_time_stamps);
    RUN_TEST(test_recordings_twomass_response_is_that_of_two_masses);
    RUN_TEST(test_recordings_twomass_load_counts_the_other_way);
    RUN_TEST(test_recordings_linear_guide_files_agree);
    RUN_TEST(test_recordings_linear_guide_turned_round_is_a_drive_like_any_other);
    return UNITY_END();
}
