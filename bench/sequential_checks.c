/* SPDX-License-Identifier: MIT */
#include "bench/sequential_checks.h"

#include "lab/design/intermodulation.h"
#include "lab/design/sequence.h"
#include "lab/estimate/spectra.h"
#include "lab/numeric/statistics.h"
#include "tests/support/known_drive.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double band_hz[sequential_bands + 1] = {0.0, 1.5, 6.1, 30.0};

enum { octaves = 8 };

/// Puts in the steady state of the linearised plant, without noise.
static void play_linear(const struct sequential_segment *segment, struct sequential_recording *io_recording)
{
    const double line_N = 1.0 / sqrt((double)segment->line_count);
    memset(io_recording->position_m, 0, sequential_samples * sizeof(double));
    for (size_t k = 0; k < segment->line_count; k++) {
        const double turns_per_sample = (double)segment->bins[k] / sequential_samples;
        const double complex line = line_N * cexp(I * segment->phase_rad[k]) *
                                    cubic_plant_response(&cubic_plant_paper, turns_per_sample * sequential_rate_hz);
        for (size_t n = 0; n < sequential_samples; n++) {
            const double angle =
                known_two_pi * (double)(segment->bins[k] * n % sequential_samples) / sequential_samples;
            io_recording->position_m[n] += creal(line) * cos(angle) - cimag(line) * sin(angle);
        }
    }
}

/// Mean over the counted periods of uniform noise of the given standard deviation, added to the clean period.
static void add_noise(const double *clean_m, size_t periods, double noise_m, struct random *random, double *out_mean_m)
{
    const double width_m = noise_m * sqrt(12.0) / (double)periods;
    memcpy(out_mean_m, clean_m, sequential_samples * sizeof *clean_m);
    for (size_t p = 0; p < periods; p++) {
        for (size_t n = 0; n < sequential_samples; n++) {
            out_mean_m[n] += width_m * (random_uniform(random) - 0.5);
        }
    }
}

/// Adds up |Ghat - G|^2 over the runs, at those bins that the segment excites.
static bool scatter_of_segment(const struct sequential_segment *segment, size_t bin_count, const uint32_t *bins,
                               double noise_m, size_t runs, struct random *random, double *io_power)
{
    struct sequential_recording noisy = {.periods = 1, .position_m = malloc(sequential_samples * sizeof(double))};
    double *clean_m = malloc(sequential_samples * sizeof *clean_m);
    double complex response = 0.0;
    bool done = noisy.position_m && clean_m && sequential_force(segment, 1.0, sequential_samples, noisy.force_N);
    if (done) {
        play_linear(segment, &noisy);
        memcpy(clean_m, noisy.position_m, sequential_samples * sizeof *clean_m);
    }
    for (size_t r = 0; done && r < runs; r++) {
        // The transform of the mean is the mean of the transforms.
        add_noise(clean_m, segment->periods, noise_m, random, noisy.position_m);
        for (size_t b = 0; done && b < bin_count; b++) {
            const double hz = (double)bins[b] * sequential_rate_hz / sequential_samples;
            if (bins[b] >= segment->bins[0] && bins[b] <= segment->bins[segment->line_count - 1]) {
                done = sequential_estimate(segment, &noisy, 1, &bins[b], &response);
                response -= cubic_plant_response(&cubic_plant_paper, hz);
                io_power[b] += creal(response * conj(response));
            }
        }
    }
    free(noisy.position_m);
    free(clean_m);
    return done;
}

static bool excites_any(const struct sequential_segment *segment, size_t bin_count, const uint32_t *bins)
{
    for (size_t b = 0; b < bin_count; b++) {
        if (bins[b] >= segment->bins[0] && bins[b] <= segment->bins[segment->line_count - 1]) {
            return true;
        }
    }
    return false;
}

bool sequential_scatter(const struct sequential_excitation *excitation, size_t bin_count, const uint32_t *bins,
                        double noise_m, size_t runs, uint64_t seed, double *out_std)
{
    struct random random;
    bool done = true;
    random_seed(&random, seed);
    memset(out_std, 0, bin_count * sizeof *out_std);
    for (size_t i = 0; done && i < excitation->count; i++) {
        if (excites_any(&excitation->segments[i], bin_count, bins)) {
            done = scatter_of_segment(&excitation->segments[i], bin_count, bins, noise_m, runs, &random, out_std);
        }
    }
    for (size_t b = 0; b < bin_count; b++) {
        out_std[b] = sqrt(out_std[b] / (double)runs);
    }
    return done;
}

// ---- Two inputs

/// The linearised plant with a force on one mass, sampled behind a hold.
static struct known_drive force_on(size_t mass)
{
    struct known_drive drive = {.order = 4, .rate_hz = sequential_rate_hz};
    double A[4][4], B[4][2];
    cubic_plant_linearise(&cubic_plant_paper, A, B);
    for (size_t i = 0; i < 4; i++) {
        memcpy(drive.A[i], A[i], sizeof A[i]);
        drive.B[i] = B[i][mass];
    }
    known_drive_sample(&drive);
    return drive;
}

struct two_masses {
    struct known_drive by[2];
    double state[4];
};

static void step(struct two_masses *self, const double force_N[2])
{
    double next[4];
    for (size_t i = 0; i < 4; i++) {
        next[i] = self->by[0].Bd[i] * force_N[0] + self->by[1].Bd[i] * force_N[1];
        for (size_t j = 0; j < 4; j++) {
            next[i] += self->by[0].Ad[i][j] * self->state[j];
        }
    }
    memcpy(self->state, next, sizeof next);
}

/// What a segment is played on: one period of each force, and of each position the mean over the counted periods.
struct two_signals {
    size_t samples;
    double *force_N[2];
    double *position_m[2];
};

static bool open_signals(size_t samples, struct two_signals *out_self)
{
    out_self->samples = samples;
    bool done = true;
    for (size_t i = 0; i < 2; i++) {
        out_self->force_N[i] = calloc(samples, sizeof(double));
        out_self->position_m[i] = calloc(samples, sizeof(double));
        done = done && out_self->force_N[i] && out_self->position_m[i];
    }
    return done;
}

static void close_signals(struct two_signals *self)
{
    for (size_t i = 0; i < 2; i++) {
        free(self->force_N[i]);
        free(self->position_m[i]);
    }
}

static void fill_force(const struct design_lines *lines, size_t samples, double *out_force_N)
{
    const double line_N = 1.0 / sqrt((double)lines->count);
    for (size_t n = 0; n < samples; n++) {
        out_force_N[n] = 0.0;
        for (size_t k = 0; k < lines->count; k++) {
            const double turns = (double)(lines->bins[k] * n % samples) / (double)samples;
            out_force_N[n] += line_N * cos(known_two_pi * (turns - (double)(k * (k + 1)) / 2 / (double)lines->count));
        }
    }
}

static void play(struct two_masses *plant, size_t settle_samples, size_t periods, struct two_signals *io_signals)
{
    const size_t samples = io_signals->samples;
    memset(io_signals->position_m[0], 0, samples * sizeof(double));
    memset(io_signals->position_m[1], 0, samples * sizeof(double));
    for (size_t n = 0; n < settle_samples + periods * samples; n++) {
        const double force_N[2] = {io_signals->force_N[0][n % samples], io_signals->force_N[1][n % samples]};
        for (size_t i = 0; n >= settle_samples && i < 2; i++) {
            io_signals->position_m[i][n % samples] += plant->state[i] / (double)periods;
        }
        step(plant, force_N);
    }
}

/// Largest error in dB from one force to both positions.
static bool judge(const struct two_masses *plant, size_t input, const struct design_lines *lines,
                  const struct two_signals *signals, double *io_error_db)
{
    double complex *u = malloc(3 * lines->count * sizeof *u);
    bool done =
        u && spectra_transform_periods(signals->force_N[input], signals->samples, 1, lines->bins, lines->count, u);
    for (size_t i = 0; done && i < 2; i++) {
        double complex *y = u + lines->count;
        struct known_drive way = plant->by[input];
        way.C[i] = 1.0;
        done = spectra_transform_periods(signals->position_m[i], signals->samples, 1, lines->bins, lines->count, y);
        for (size_t k = 0; done && k < lines->count; k++) {
            const double angle = known_two_pi * (double)lines->bins[k] / (double)signals->samples;
            const double error_db = 20.0 * log10(cabs(y[k] / u[k] / known_response(&way, cexp(-I * angle))));
            *io_error_db = fmax(*io_error_db, fabs(error_db));
        }
    }
    free(u);
    return done;
}

/// Plays a sequence of `inputs` inputs, the first of them being force `first`.
static bool play_sequence(size_t inputs, size_t first, double settle_s, struct sequential_inputs *io_inputs)
{
    const struct design_line_grid grid = {.rate_hz = sequential_rate_hz, .period_samples = inputs * sequential_samples};
    struct design_sequence sequence;
    struct two_signals signals = {0};
    struct two_masses plant = {.by = {force_on(0), force_on(1)}};
    struct error error = {0};
    if (design_sequence_parse("octaves:0.1:25:0.1", &grid, inputs, 1, &sequence, &error) != 0) {
        return false;
    }
    bool done = open_signals(grid.period_samples, &signals);
    for (size_t i = 0; done && i < sequence.segment_count; i++) {
        const struct design_lines *lines = sequence.segments[i].lines;
        for (size_t p = 0; p < inputs; p++) {
            fill_force(&lines[p], grid.period_samples, signals.force_N[first + p]);
        }
        play(&plant, (size_t)(settle_s * sequential_rate_hz), (size_t)design_sequence_periods(&sequence, i, 1),
             &signals);
        for (size_t p = 0; done && p < inputs; p++) {
            done = judge(&plant, first + p, &lines[p], &signals, &io_inputs->error_db[first + p]);
        }
    }
    io_inputs->test_time_s += design_sequence_test_time_s(&sequence, 1, settle_s);
    close_signals(&signals);
    design_sequence_free(&sequence);
    return done;
}

bool sequential_two_inputs(bool together, double settle_s, struct sequential_inputs *out_inputs)
{
    *out_inputs = (struct sequential_inputs){0};
    if (together) {
        return play_sequence(2, 0, settle_s, out_inputs);
    }
    return play_sequence(1, 0, settle_s, out_inputs) && play_sequence(1, 1, settle_s, out_inputs);
}

// ---- Distortion over random phases

/// Sums over draws, line by line, of the relative error of excited lines and the relative response of lines left out.
struct tally {
    size_t draws;
    bool excited[sequential_lines];
    double complex sum[sequential_lines];
    double power[sequential_lines];
};

/// Odd lines of each octave on their own, one of four left out: no specification says that.
static bool design_octaves_random_odd(uint64_t seed, struct sequential_excitation *out_self)
{
    *out_self = (struct sequential_excitation){.segments = calloc(octaves, sizeof(struct sequential_segment))};
    bool done = out_self->segments != NULL;
    for (size_t i = 0; done && i < octaves; i++) {
        struct sequential_excitation one;
        char lines[64];
        const double low_hz = 0.1 * (double)(1U << i);
        snprintf(lines, sizeof lines, "random-odd:%g:%g:0.1", low_hz, fmin(2.0 * low_hz - 0.1, 25.0));
        done = sequential_design(lines, sequential_random, seed * octaves + i, &one);
        if (done) {
            out_self->segments[out_self->count++] = one.segments[0];
            free(one.segments); // its only segment has moved
        }
    }
    if (!done) {
        sequential_free(out_self);
    }
    return done;
}

static bool design_draw(const char *lines, uint64_t seed, struct sequential_excitation *out_self)
{
    if (strcmp(lines, "octaves-random-odd") == 0) {
        return design_octaves_random_odd(seed, out_self);
    }
    return sequential_design(lines, sequential_random, seed, out_self);
}

static bool is_excited(const struct sequential_segment *segment, uint32_t bin)
{
    for (size_t k = 0; k < segment->line_count; k++) {
        if (segment->bins[k] == bin) {
            return true;
        }
    }
    return false;
}

/// Every bin between a segment's outer lines, over the true response (NULL: 1).
static bool add_segment(const struct sequential_segment *segment, const struct sequential_recording *recording,
                        const struct cubic_plant *plant, struct tally *io_tally)
{
    uint32_t bins[sequential_lines] = {0};
    double complex response[sequential_lines];
    size_t count = 0;
    for (uint32_t b = segment->bins[0]; b <= segment->bins[segment->line_count - 1]; b++) {
        bins[count++] = b;
    }
    if (!sequential_estimate(segment, recording, count, bins, response)) {
        return false;
    }
    for (size_t i = 0; i < count; i++) {
        const double hz = (double)bins[i] * sequential_rate_hz / sequential_samples;
        const bool excited = is_excited(segment, bins[i]);
        const double complex off =
            response[i] / (plant ? cubic_plant_response(plant, hz) : 1.0) - (excited ? 1.0 : 0.0);
        io_tally->excited[bins[i] - 1] = excited;
        io_tally->sum[bins[i] - 1] += off;
        io_tally->power[bins[i] - 1] += creal(off * conj(off));
    }
    return true;
}

/// A sum of powers over lines, and how many.
struct mean {
    double sum;
    double count;
};

static void add(struct mean *self, double power)
{
    self->sum += power;
    self->count += 1.0;
}

static double mean_db(const struct mean *self)
{
    return self->sum > 0.0 ? 10.0 * log10(self->sum / self->count) : -INFINITY;
}

static struct sequential_levels levels_of(const struct tally *tally, double low_hz, double high_hz)
{
    struct mean coherent = {0}, stochastic = {0}, odd = {0}, even = {0};
    const double draws = (double)tally->draws;
    const double quarter_hz = 0.25 * sequential_rate_hz / sequential_samples;
    for (size_t k = 0; k < sequential_lines; k++) {
        const double hz = (double)(k + 1) * sequential_rate_hz / sequential_samples;
        const double complex average = tally->sum[k] / draws;
        if (hz < low_hz - quarter_hz || hz >= high_hz - quarter_hz || !(tally->power[k] > 0.0)) {
            continue;
        }
        if (tally->excited[k]) {
            const double variance = (tally->power[k] - draws * creal(average * conj(average))) / (draws - 1.0);
            add(&coherent, creal(average * conj(average)));
            add(&stochastic, fmax(variance, 0.0));
        } else {
            add(k % 2 == 0 ? &odd : &even, tally->power[k] / draws);
        }
    }
    return (struct sequential_levels){mean_db(&coherent), mean_db(&stochastic), mean_db(&odd), mean_db(&even)};
}

/// Puts in y = u + a2 u^2 + a3 u^3.
static bool play_static(const struct sequential_segment *segment, double a2, double a3,
                        struct sequential_recording *io_recording)
{
    if (!sequential_force(segment, 1.0, sequential_samples, io_recording->force_N)) {
        return false;
    }
    for (size_t n = 0; n < sequential_samples; n++) {
        const double u = io_recording->force_N[n];
        io_recording->position_m[n] = u * (1.0 + u * (a2 + u * a3));
    }
    return true;
}

bool sequential_static(const char *lines, double a2, double a3, size_t draws, uint64_t seed,
                       struct sequential_levels *out_levels)
{
    struct tally tally = {.draws = draws};
    struct sequential_recording recording = {.periods = 1, .position_m = malloc(sequential_samples * sizeof(double))};
    bool done = recording.position_m != NULL;
    for (size_t d = 0; done && d < draws; d++) {
        struct sequential_excitation excitation;
        done = design_draw(lines, seed + d, &excitation);
        for (size_t i = 0; done && i < excitation.count; i++) {
            done = play_static(&excitation.segments[i], a2, a3, &recording) &&
                   add_segment(&excitation.segments[i], &recording, NULL, &tally);
        }
        if (done) {
            sequential_free(&excitation);
        }
    }
    *out_levels = levels_of(&tally, band_hz[0], band_hz[sequential_bands]);
    free(recording.position_m);
    return done;
}

static bool play_draw(const struct sequential_excitation *excitation, const struct sequential_play *play,
                      struct tally *io_tally)
{
    bool done = true;
    for (size_t i = 0; done && i < excitation->count; i++) {
        struct cubic_state state = {0};
        struct sequential_recording recording;
        done = sequential_record(&excitation->segments[i], play, &state, &recording);
        if (done) {
            done = add_segment(&excitation->segments[i], &recording, play->plant, io_tally);
            free(recording.position_m);
        }
    }
    return done;
}

bool sequential_distortion(const char *lines, const struct cubic_plant *plant, double amplitude_N, size_t draws,
                           uint64_t seed, struct sequential_levels out_levels[sequential_bands])
{
    // At A = 1 some draws settle to twice the period. An even number of periods averages that out; one alone would
    // count its leakage as distortion, 16 dB more above 6 Hz.
    const struct sequential_play play = {
        .plant = plant, .amplitude_N = amplitude_N, .settle_periods = 20, .periods = 4};
    struct tally tally = {.draws = draws};
    bool done = true;
    for (size_t d = 0; done && d < draws; d++) {
        struct sequential_excitation excitation;
        done = design_draw(lines, seed + d, &excitation);
        if (done) {
            done = play_draw(&excitation, &play, &tally);
            sequential_free(&excitation);
        }
    }
    for (size_t band = 0; band < sequential_bands; band++) {
        out_levels[band] = levels_of(&tally, band_hz[band], band_hz[band + 1]);
    }
    return done;
}

// ---- Products

static bool count_second_order(size_t lowest, size_t count, struct design_intermodulation *out_counts)
{
    uint32_t *bins = malloc(count * sizeof *bins);
    for (size_t k = 0; bins && k < count; k++) {
        bins[k] = (uint32_t)(lowest + k);
    }
    const bool done = bins && design_intermodulation_count(count, bins, out_counts);
    free(bins);
    return done;
}

bool sequential_count_products(size_t lowest, struct sequential_products *out_products)
{
    struct design_intermodulation open, closed;
    *out_products = (struct sequential_products){0};
    if (!count_second_order(lowest, lowest, &open) || !count_second_order(lowest, lowest + 1, &closed)) {
        return false;
    }
    out_products->second_order = open.second_order_lines;
    out_products->third_harmonics = open.hits[design_product_third_harmonic].lines;
    out_products->second_inclusive = closed.second_order_lines;
    design_intermodulation_free(&open);
    design_intermodulation_free(&closed);
    for (size_t f1 = lowest; f1 < 2 * lowest; f1++) {
        for (size_t f2 = lowest; f2 < 2 * lowest; f2++) {
            for (size_t f3 = lowest; f3 < 2 * lowest; f3++) {
                const bool in_band = f1 + f2 >= f3 + lowest && f1 + f2 < f3 + 2 * lowest;
                out_products->triples += in_band;
                out_products->trivial += in_band && (f3 == f1 || f3 == f2);
            }
        }
    }
    return true;
}
