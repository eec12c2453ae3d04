/* SPDX-License-Identifier: MIT */
/// What differs between periods: effects in time are seen there, structure over time is found, and noise is not taken
/// for either.
#include "lab/diagnose/contrast.h"

#include "lab/diagnose/constancy.h"
#include "lab/diagnose/noise.h"
#include "lab/diagnose/structure.h"
#include "lab/numeric/statistics.h"
#include "sim/plant.h"
#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { samples = 512, periods = 8, lead = samples, rows = lead + periods * samples, band = 200 };

static const double two_pi = 6.283185307179586;
static const double rate_hz = 1000.0;
static const double noise_Nm = 0.002;

static struct sim_model model;
static struct recording recording;
static struct evidence evidence;
static struct random generator;
static double torque[rows], position[rows], velocity[rows], block[3][samples];
static size_t starts[periods];
static char message[120];

/// Torque that opposes the motion beside what the model has, at a row.
static double (*hidden)(size_t n);

static double nothing(size_t n)
{
    (void)n;
    return 0.0;
}

static const double line_Nm = 0.002, line_hz = 24.37, line_rad = 0.8;

static double line(size_t n)
{
    return line_Nm * cos(two_pi * line_hz * ((double)n + 0.5) / rate_hz + line_rad);
}

/// A fifth of the noise, 40 times its mean power per line of the whole stretch.
static double faint_line(size_t n)
{
    return 0.2 * line(n);
}

static const double fast_Nm = 0.02, fast_hz = 180.37;

/// The mean over a sample of a line that turns through a sixth of a turn meanwhile.
static double fast_line(size_t n)
{
    double half = 0.5 * two_pi * fast_hz / rate_hz;
    return fast_Nm * sin(half) / half * cos(two_pi * fast_hz * ((double)n + 0.5) / rate_hz + line_rad);
}

static double creep(size_t n)
{
    return 0.004 * (double)n / rows * sin(two_pi * 12.0 * (double)n / samples);
}

static double creeping_gain(size_t n)
{
    return 0.01 * (double)n / rows *
           (0.3 * sin(two_pi * 5.0 * (double)n / samples) + 0.2 * cos(two_pi * 40.0 * (double)n / samples));
}

static double burst(size_t n)
{
    bool on = n >= lead + 3 * samples + 100 && n < lead + 3 * samples + 130;
    return on ? 0.03 * sin(two_pi * 0.15 * (double)n) : 0.0;
}

/// Noise of a few instants of each period, as where friction turns: alike at all frequencies.
static double kicks(size_t n)
{
    static const size_t at[] = {61, 203, 411};
    for (size_t i = 0; i < sizeof at / sizeof at[0]; i++)
        if (n % samples == at[i])
            return 0.1 * random_normal(&generator);
    return 0.0;
}

/// A bias that jumps in the middle of the fifth period.
static double jump(size_t n)
{
    return n >= lead + 4 * samples + samples / 2 ? 0.001 : 0.0;
}

void setUp(void)
{
    sim_model_default(&model);
    model.structure = sim_structure_rigid;
    model.load_inertia_kgm2 = 0.0;
    model.viscous_friction_Nms_per_rad = model.coulomb_friction_Nm = 0.0;
    model.torque_lag_s = model.dead_time_s = 0.0;
    model.sample_rate_hz = rate_hz;
    memset(&recording, 0, sizeof recording);
}

void tearDown(void)
{
    evidence_free(&evidence);
}

static void mean_of_periods(const double *column, double *out)
{
    memset(out, 0, samples * sizeof *out);
    for (size_t p = 0; p < periods; p++)
        for (size_t i = 0; i < samples; i++)
            out[i] += column[starts[p] + i] / periods;
}

/// A rigid body that follows its torque, white noise and what is hidden.
static void record(double (*what)(size_t n), uint64_t seed)
{
    hidden = what;
    random_seed(&generator, seed);
    snprintf(message, sizeof message, "seed %u", (unsigned)seed);
    double per_sample = 1.0 / (model.motor_inertia_kgm2 * rate_hz), speed = 0.0;
    for (size_t n = 0; n < rows; n++) {
        torque[n] = 0.3 * sin(two_pi * 5.0 * (double)n / samples) + 0.2 * cos(two_pi * 40.0 * (double)n / samples);
        velocity[n] = speed;
        position[n] = 0.0;
        double next = n + 1 < rows ? 0.3 * sin(two_pi * 5.0 * (double)(n + 1) / samples) +
                                         0.2 * cos(two_pi * 40.0 * (double)(n + 1) / samples)
                                   : torque[n];
        speed += per_sample * (0.5 * (torque[n] + next) + noise_Nm * random_normal(&generator) - hidden(n));
    }
    for (size_t p = 0; p < periods; p++)
        starts[p] = lead + p * samples;
    mean_of_periods(torque, block[0]);
    mean_of_periods(position, block[1]);
    mean_of_periods(velocity, block[2]);
    recording =
        (struct recording){.periodic = true, .rate_hz = rate_hz, .periods = periods, .lead = lead, .band = band};
    recording.starts = starts;
    recording.block = (struct stretch){.samples = samples,
                                       .torque = block[0],
                                       .position = block[1],
                                       .velocity = block[2],
                                       .substeps = sim_substeps,
                                       .start_s = (lead + 0.5 * periods * samples) / rate_hz};
    recording.all = (struct stretch){
        .samples = rows, .torque = torque, .position = position, .velocity = velocity, .substeps = sim_substeps};
    recording.coverage.velocity_rms = 1.0;
    TEST_ASSERT_TRUE(evidence_init(&evidence, &recording, model.motor_inertia_kgm2));
    TEST_ASSERT_TRUE(evidence_estimate_noise(&evidence, &model));
}

static int disturbance(void)
{
    int effect = sim_effect_find("periodic_disturbance");
    TEST_ASSERT_TRUE(effect >= 0);
    return effect;
}

static double squares(const double *x)
{
    double sum = 0.0;
    for (size_t i = 0; i < evidence.contrast.values; i++)
        sum += x[i] * x[i];
    return sum;
}

static void test_contrast_of_noise_has_the_variance_that_is_expected(void)
{
    record(nothing, 11);
    double free_values = (double)evidence.contrast.values * (periods - 1) / periods;
    // Three and a half standard deviations of chi-square, which its own noise estimate halves at least.
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(3.5 * sqrt(2.0 * free_values), free_values, evidence.contrast.without, message);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, evidence.tone_count, message);
}

static void test_contrast_finds_a_line_that_was_not_excited(void)
{
    record(line, 12);
    TEST_ASSERT_TRUE_MESSAGE(evidence.tone_count > 0, message);
    const double resolution_hz = rate_hz / (periods * samples);
    TEST_ASSERT_DOUBLE_WITHIN(0.2 * resolution_hz, line_hz, evidence.tones_hz[0]);
}

static void test_contrast_sizes_a_line_and_takes_it_out(void)
{
    record(line, 13);
    double values[sim_effect_parameters_max] = {1e-4, 0.0, line_hz};
    TEST_ASSERT_TRUE(contrast_size_effect(&evidence, &model, disturbance(), values));
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(0.1 * line_Nm, line_Nm, values[0], message); // noise: 5 %
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(0.1, line_rad, values[1], message);
    struct sim_model with = model;
    with.effect_on[disturbance()] = true;
    memcpy(with.effect_parameters[disturbance()], values, sizeof values);
    double *left = malloc(evidence.contrast.values * sizeof *left);
    TEST_ASSERT_TRUE(contrast_residual(&evidence, &with, left, NULL));
    TEST_ASSERT_TRUE_MESSAGE(squares(left) < evidence.contrast.without - 100.0, message);
    free(left);
}

static void test_contrast_finds_a_line_from_a_fifth_of_the_noise_on(void)
{
    const double resolution_hz = rate_hz / (periods * samples);
    for (uint64_t seed = 200; seed < 206; seed++) {
        record(faint_line, seed);
        TEST_ASSERT_EQUAL_UINT_MESSAGE(1, evidence.tone_count, message);
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(resolution_hz, line_hz, evidence.tones_hz[0], message);
        evidence_free(&evidence);
    }
}

/// One in 300 runs is expected to have a line by chance.
static void test_contrast_finds_no_lines_in_noise(void)
{
    size_t found = 0;
    for (uint64_t seed = 300; seed < 340; seed++) {
        record(nothing, seed);
        found += evidence.tone_count;
        evidence_free(&evidence);
    }
    TEST_ASSERT_LESS_THAN_UINT(3, found);
}

static void test_contrast_sizes_a_fast_line_by_its_mean_over_a_sample(void)
{
    enum { runs = 8 };
    double mean = 0.0;
    for (uint64_t seed = 400; seed < 400 + runs; seed++) {
        double values[sim_effect_parameters_max] = {1e-4, 0.0, fast_hz};
        record(fast_line, seed);
        TEST_ASSERT_TRUE(contrast_size_effect(&evidence, &model, disturbance(), values));
        mean += values[0] / runs;
        evidence_free(&evidence);
    }
    // Whitened by what it makes of the noise itself, a line's size scatters by 2 %, the mean of eight by 0.8 %. What it
    // is half way through a sample is 5 % more than over the sample.
    TEST_ASSERT_DOUBLE_WITHIN(0.025 * fast_Nm, fast_Nm, mean);
}

/// Under the model that has the line, the contrasts without it come out as those of the model that lacks it.
static void test_contrast_puts_back_what_the_model_of_the_noise_had(void)
{
    record(line, 14);
    struct sim_model with = model;
    double values[sim_effect_parameters_max] = {line_Nm, line_rad, line_hz};
    with.effect_on[disturbance()] = true;
    memcpy(with.effect_parameters[disturbance()], values, sizeof values);
    TEST_ASSERT_TRUE(evidence_estimate_noise(&evidence, &with));
    TEST_ASSERT_TRUE_MESSAGE(evidence.contrast.without > evidence.contrast.reference + 200.0, message);
    double *left = malloc(evidence.contrast.values * sizeof *left);
    TEST_ASSERT_TRUE(contrast_residual(&evidence, &with, left, NULL));
    TEST_ASSERT_DOUBLE_WITHIN(1e-6 * evidence.contrast.reference, evidence.contrast.reference, squares(left));
    free(left);
}

static void test_contrast_finds_the_phase_of_a_run_that_began_at_another_time(void)
{
    record(line, 15);
    evidence.phase_free = true;
    struct sim_model with = model, aligned;
    double values[sim_effect_parameters_max] = {line_Nm, line_rad + 2.0, line_hz};
    with.effect_on[disturbance()] = true;
    memcpy(with.effect_parameters[disturbance()], values, sizeof values);
    TEST_ASSERT_TRUE(contrast_align(&evidence, &with, &aligned));
    double off = aligned.effect_parameters[disturbance()][1] - line_rad;
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(0.1, 0.0, remainder(off, two_pi), message);
}

/// The noise of a run that began at another time is that under the line at its own phase: no line is left of it.
static void test_noise_of_a_run_that_began_at_another_time_has_no_line_in_it(void)
{
    record(nothing, 22);
    double quiet = evidence.covariance[4 * (size_t)(line_hz * samples / rate_hz)];
    evidence_free(&evidence);
    record(line, 22);
    evidence.phase_free = true;
    struct sim_model with = model;
    double values[sim_effect_parameters_max] = {line_Nm, line_rad + 2.0, line_hz};
    with.effect_on[disturbance()] = true;
    memcpy(with.effect_parameters[disturbance()], values, sizeof values);
    TEST_ASSERT_TRUE(evidence_estimate_noise(&evidence, &with));
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, evidence.tone_count, message);
    double noise = evidence.covariance[4 * (size_t)(line_hz * samples / rate_hz)];
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(0.1 * quiet, quiet, noise, message);
}

static struct structure look(void)
{
    struct structure found;
    TEST_ASSERT_TRUE(structure_find(&evidence, evidence.contrast.base, &found));
    return found;
}

static void test_structure_is_not_found_in_noise(void)
{
    for (uint64_t seed = 100; seed < 120; seed++) {
        record(nothing, seed);
        TEST_ASSERT_FALSE_MESSAGE(look().found, message);
        evidence_free(&evidence);
    }
}

static void test_structure_is_no_slow_change_where_noise_is_that_of_a_few_instants(void)
{
    for (uint64_t seed = 200; seed < 260; seed++) {
        record(kicks, seed);
        struct structure found = look();
        TEST_ASSERT_NULL_MESSAGE(strstr(found.where, "slowly"), message);
        evidence_free(&evidence);
    }
}

static void test_structure_finds_a_slow_change_in_its_octave(void)
{
    record(creep, 16);
    struct structure found = look();
    TEST_ASSERT_TRUE_MESSAGE(found.found, message);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(found.where, "slowly"), found.where);
    TEST_ASSERT_TRUE(found.first_bin <= 12 && found.last_bin >= 12);
}

/// What it would be worth to a model that has it grows with its power, the evidence against equal variance hardly.
static void test_structure_says_what_a_slow_change_is_worth(void)
{
    record(creep, 16);
    struct structure found = look();
    double sum = 0.0;
    for (size_t p = 0; p < periods; p++)
        for (size_t i = 2 * 12 - 1; i <= 2 * 12; i++)
            sum += pow(evidence.contrast.base[p * evidence.contrast.width + i], 2.0);
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(0.25 * 0.5 * sum, 0.5 * sum, found.beyond, message);
    TEST_ASSERT_TRUE_MESSAGE(found.beyond > 2.0 * found.nats, message);
}

/// The noise about a line that creeps is what it is beside one that does not, and elsewhere nothing is taken for slow.
static void test_noise_leaves_slow_changes_out_where_they_stand_out(void)
{
    double quiet[band + 1];
    record(nothing, 20);
    for (size_t k = 0; k <= band; k++) {
        quiet[k] = evidence.covariance[4 * k];
        TEST_ASSERT_EQUAL_UINT_MESSAGE(0, evidence.slow[k], message);
    }
    evidence_free(&evidence);
    record(creep, 20);
    TEST_ASSERT_TRUE_MESSAGE(evidence.slow[12] > 0 && evidence.slow[band] == 0, message);
    for (size_t k = 8; k < 16; k++)
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(0.5 * quiet[k], quiet[k], evidence.covariance[4 * k], message);
}

/// Evidence that a torque of one line, in phase with the one that creeps or a quarter of a turn away, does not stay.
static double changes(double phase)
{
    double signal[samples];
    struct hypothesis hypothesis = {.count = 1, .coordinates = {{.effect = sim_effect_find("viscous_friction")}}};
    for (size_t i = 0; i < samples; i++)
        signal[i] = sin(two_pi * 12.0 * (double)i / samples + phase);
    double *column = malloc(evidence.values * sizeof *column);
    evidence_whiten(&evidence, signal, NULL, column);
    struct fit_data data = {
        .runs = 1, .evidence = &evidence, .values = evidence.values, .contrasts = evidence.contrast.values};
    struct fit fit = {.rows = data.values, .jacobian = column};
    double nats = constancy_nats(&data, &hypothesis, &fit, hypothesis.coordinates[0].effect);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, constancy_nats(&data, &hypothesis, &fit, disturbance()));
    free(column);
    return nats;
}

static void test_constancy_is_broken_by_what_creeps_along_the_name_and_by_nothing_else(void)
{
    record(creep, 21);
    TEST_ASSERT_TRUE_MESSAGE(changes(0.0) > 100.0, message);
    TEST_ASSERT_TRUE_MESSAGE(changes(0.25 * two_pi) < 12.0, message);
    evidence_free(&evidence);
    record(nothing, 21);
    TEST_ASSERT_TRUE_MESSAGE(changes(0.0) < 12.0, message);
    TEST_ASSERT_TRUE(constancy_is_broken(13.0, 1000.0));
    TEST_ASSERT_FALSE(constancy_is_broken(11.0, 100.0));  // chance
    TEST_ASSERT_FALSE(constancy_is_broken(13.0, 2000.0)); // it comes and goes by less than a tenth
}

/// What a disturbance is worth that is named at a frequency, beside an inertia that may creep.
static double worth_of_line(double hz)
{
    struct hypothesis hypothesis;
    hypothesis_init(&hypothesis, &model, false, false);
    double values[sim_effect_parameters_max] = {line_Nm, 0.0, hz};
    TEST_ASSERT_TRUE(contrast_size_effect(&evidence, &model, disturbance(), values));
    hypothesis_name(&hypothesis, disturbance(), values);
    struct fit_data data = {
        .runs = 1, .evidence = &evidence, .values = evidence.values, .contrasts = evidence.contrast.values};
    struct fit fit = {.rows = data.values + data.contrasts};
    fit.jacobian = calloc(hypothesis.count * fit.rows, sizeof *fit.jacobian);
    for (size_t i = 0; i < hypothesis.count; i++)
        if (hypothesis.coordinates[i].model_offset == offsetof(struct sim_model, motor_inertia_kgm2))
            evidence_whiten(&evidence, block[0], NULL, fit.jacobian + i * fit.rows);
    double nats = constancy_nats_in_time(&data, &hypothesis, &fit, disturbance());
    free(fit.jacobian);
    return nats;
}

static void test_constancy_tells_a_line_from_a_gain_that_creeps(void)
{
    record(line, 23);
    TEST_ASSERT_TRUE_MESSAGE(worth_of_line(line_hz) > 100.0, message);
    evidence_free(&evidence);
    record(creeping_gain, 23);
    double beside = 5.0 * rate_hz / samples + 0.4 * rate_hz / (periods * samples);
    TEST_ASSERT_TRUE_MESSAGE(worth_of_line(beside) < 0.0, message);
}

static void test_structure_finds_a_burst_and_says_when(void)
{
    record(burst, 17);
    struct structure found = look();
    TEST_ASSERT_TRUE_MESSAGE(found.found, message);
    double at_s = 0.0, to_s = 0.0, real_s = (double)(lead + 3 * samples + 115) / rate_hz;
    TEST_ASSERT_EQUAL_INT_MESSAGE(2, sscanf(found.where, "%lf to %lf s", &at_s, &to_s), found.where);
    TEST_ASSERT_TRUE_MESSAGE(at_s - 0.032 < real_s && to_s + 0.032 > real_s, found.where); // or the stretch beside it
}

static void test_structure_finds_a_bias_that_jumps_and_says_when(void)
{
    record(jump, 18);
    struct structure found = look();
    TEST_ASSERT_TRUE_MESSAGE(found.found, message);
    const char *when = strstr(found.where, "from about");
    TEST_ASSERT_NOT_NULL_MESSAGE(when, found.where);
    double real_s = (double)(lead + 4 * samples + samples / 2) / rate_hz, period_s = samples / rate_hz;
    TEST_ASSERT_DOUBLE_WITHIN(period_s, real_s, strtod(when + strlen("from about"), NULL));
    TEST_ASSERT_TRUE(structure_holds(&found, 0) && !structure_holds(&found, band));
}

static void test_structure_merges_places_and_keeps_the_stronger_words(void)
{
    struct structure weak = {.found = true, .nats = 20.0, .place_count = 1, .place_first = {3}, .place_last = {5}};
    struct structure strong = {.found = true, .nats = 90.0, .place_count = 1, .place_first = {40}, .place_last = {40}};
    struct structure none = {0}, sum = weak;
    structure_merge(&sum, &strong);
    TEST_ASSERT_EQUAL_DOUBLE(strong.nats, sum.nats);
    TEST_ASSERT_TRUE(structure_holds(&sum, 4) && structure_holds(&sum, 40) && !structure_holds(&sum, 6));
    structure_merge(&sum, &none);
    structure_merge(&none, &sum);
    TEST_ASSERT_EQUAL_UINT(2, sum.place_count);
    TEST_ASSERT_EQUAL_MEMORY(&sum, &none, sizeof sum);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_contrast_of_noise_has_the_variance_that_is_expected);
    RUN_TEST(test_contrast_finds_a_line_that_was_not_excited);
    RUN_TEST(test_contrast_finds_a_line_from_a_fifth_of_the_noise_on);
    RUN_TEST(test_contrast_finds_no_lines_in_noise);
    RUN_TEST(test_contrast_sizes_a_line_and_takes_it_out);
    RUN_TEST(test_contrast_sizes_a_fast_line_by_its_mean_over_a_sample);
    RUN_TEST(test_contrast_puts_back_what_the_model_of_the_noise_had);
    RUN_TEST(test_contrast_finds_the_phase_of_a_run_that_began_at_another_time);
    RUN_TEST(test_noise_of_a_run_that_began_at_another_time_has_no_line_in_it);
    RUN_TEST(test_structure_is_not_found_in_noise);
    RUN_TEST(test_structure_is_no_slow_change_where_noise_is_that_of_a_few_instants);
    RUN_TEST(test_structure_finds_a_slow_change_in_its_octave);
    RUN_TEST(test_structure_says_what_a_slow_change_is_worth);
    RUN_TEST(test_noise_leaves_slow_changes_out_where_they_stand_out);
    RUN_TEST(test_constancy_is_broken_by_what_creeps_along_the_name_and_by_nothing_else);
    RUN_TEST(test_constancy_tells_a_line_from_a_gain_that_creeps);
    RUN_TEST(test_structure_finds_a_burst_and_says_when);
    RUN_TEST(test_structure_finds_a_bias_that_jumps_and_says_when);
    RUN_TEST(test_structure_merges_places_and_keeps_the_stronger_words);
    return UNITY_END();
}
