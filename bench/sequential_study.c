/* SPDX-License-Identifier: MIT */
#include "bench/sequential_study.h"

#include "lab/design/phases.h"
#include "lab/design/sequence.h"
#include "lab/estimate/spectra.h"
#include "lab/numeric/fft.h"

#include <math.h>
#include <stdlib.h>

static const double two_pi = 6.283185307179586476925;

static const struct design_line_grid study_grid = {.rate_hz = sequential_rate_hz, .period_samples = sequential_samples};

/// Lines of random-odd: the phases are what a draw varies.
static const uint64_t line_seed = 1;

static bool choose_schroeder(const struct sequential_segment *segment, double *out_c)
{
    struct design_spectrum spectrum;
    double *flat = malloc(segment->line_count * sizeof *flat);
    for (size_t k = 0; flat && k < segment->line_count; k++) {
        flat[k] = 1.0;
    }
    const struct design_request request = {.rate_num_hz = sequential_rate_hz,
                                           .rate_den = 1,
                                           .period_samples = sequential_samples,
                                           .bin_count = segment->line_count,
                                           .bins = segment->bins,
                                           .limits = {.torque_Nm = 1.0},
                                           .inertia_kgm2 = 1.0,
                                           .torque_shape = flat};
    const bool made = flat && design_spectrum_create(&request, &spectrum);
    if (made) {
        design_phases_schroeder(&spectrum, out_c);
        design_spectrum_free(&spectrum);
    }
    free(flat);
    return made;
}

static bool choose_phases(struct sequential_segment *segment, enum sequential_phases phases, uint64_t seed)
{
    double *c = calloc(2 * segment->line_count, sizeof *c);
    bool chosen = c && segment->phase_rad;
    if (chosen && phases == sequential_schroeder) {
        chosen = choose_schroeder(segment, c);
    } else if (chosen && phases == sequential_random) {
        design_phases_random(segment->line_count, seed, c);
    }
    for (size_t k = 0; chosen && k < segment->line_count; k++) {
        segment->phase_rad[k] = phases == sequential_sine ? -two_pi / 4.0 : atan2(c[2 * k + 1], c[2 * k]);
    }
    free(c);
    return chosen;
}

static bool fill_segment(const struct design_sequence *sequence, size_t index, enum sequential_phases phases,
                         uint64_t seed, struct sequential_segment *out_segment)
{
    const struct design_lines *lines = &sequence->segments[index].lines[0];
    *out_segment = (struct sequential_segment){
        .line_count = lines->count,
        .bins = malloc(lines->count * sizeof(uint32_t)),
        .phase_rad = malloc(lines->count * sizeof(double)),
        .periods = sequence->kind == design_sequence_multisine ? lines->count : sequence->segments[index].periods};
    for (size_t k = 0; out_segment->bins && k < lines->count; k++) {
        out_segment->bins[k] = lines->bins[k];
    }
    return out_segment->bins && choose_phases(out_segment, phases, seed * sequence->segment_count + index);
}

bool sequential_design(const char *lines, enum sequential_phases phases, uint64_t seed,
                       struct sequential_excitation *out_self)
{
    struct design_sequence sequence;
    struct error error = {0};
    *out_self = (struct sequential_excitation){0};
    if (design_sequence_parse(lines, &study_grid, 1, line_seed, &sequence, &error) != 0) {
        return false;
    }
    out_self->segments = calloc(sequence.segment_count, sizeof *out_self->segments);
    bool done = out_self->segments != NULL;
    for (size_t i = 0; done && i < sequence.segment_count; i++) {
        done = fill_segment(&sequence, i, phases, seed, &out_self->segments[i]);
        out_self->count++;
    }
    design_sequence_free(&sequence);
    if (!done) {
        sequential_free(out_self);
    }
    return done;
}

void sequential_free(struct sequential_excitation *self)
{
    for (size_t i = 0; i < self->count; i++) {
        free(self->segments[i].bins);
        free(self->segments[i].phase_rad);
    }
    free(self->segments);
    *self = (struct sequential_excitation){0};
}

bool sequential_force(const struct sequential_segment *segment, double amplitude_N, size_t points, double *out_force_N)
{
    const double line_N = amplitude_N / sqrt((double)segment->line_count);
    struct fft_plan *plan = fft_plan_create(points);
    double *spectrum = calloc(2 * points, sizeof *spectrum);
    double *wave = calloc(2 * points, sizeof *wave);
    const bool made = plan && spectrum && wave;
    if (made) {
        for (size_t k = 0; k < segment->line_count; k++) {
            spectrum[2 * segment->bins[k]] = line_N * cos(segment->phase_rad[k]);
            spectrum[2 * segment->bins[k] + 1] = line_N * sin(segment->phase_rad[k]);
        }
        fft_inverse(plan, spectrum, wave);
        for (size_t i = 0; i < points; i++) {
            out_force_N[i] = wave[2 * i];
        }
    }
    fft_plan_destroy(plan);
    free(spectrum);
    free(wave);
    return made;
}

bool sequential_record(const struct sequential_segment *segment, const struct sequential_play *play,
                       struct cubic_state *io_state, struct sequential_recording *out_recording)
{
    out_recording->periods = play->periods > 0 ? play->periods : segment->periods;
    out_recording->position_m = calloc(out_recording->periods * sequential_samples, sizeof(double));
    const size_t points = (size_t)sequential_samples * cubic_points_per_sample;
    double *force_N = malloc(points * sizeof *force_N);
    const bool done =
        out_recording->position_m && force_N && sequential_force(segment, play->amplitude_N, points, force_N);
    if (done) {
        const struct cubic_input input = {.samples = sequential_samples, .force_N = force_N, .held = play->held};
        const double sample_s = 1.0 / sequential_rate_hz;
        cubic_plant_play(play->plant, &input, sample_s, play->settle_periods, io_state, NULL);
        cubic_plant_play(play->plant, &input, sample_s, out_recording->periods, io_state, out_recording->position_m);
        for (size_t n = 0; n < sequential_samples; n++) {
            out_recording->force_N[n] = force_N[n * cubic_points_per_sample];
        }
    } else {
        free(out_recording->position_m);
        out_recording->position_m = NULL;
    }
    free(force_N);
    return done;
}

bool sequential_estimate(const struct sequential_segment *segment, const struct sequential_recording *recording,
                         size_t bin_count, const uint32_t *bins, double complex *out_response)
{
    double complex *output = malloc(recording->periods * bin_count * sizeof *output);
    double complex *input = malloc((bin_count + segment->line_count) * sizeof *input);
    double complex *lines = input + bin_count;
    const bool done =
        output && input &&
        spectra_transform_periods(recording->position_m, sequential_samples, recording->periods, bins, bin_count,
                                  output) &&
        spectra_transform_periods(recording->force_N, sequential_samples, 1, bins, bin_count, input) &&
        spectra_transform_periods(recording->force_N, sequential_samples, 1, segment->bins, segment->line_count, lines);
    // All lines of a segment have one amplitude; what is far below it is rounding.
    const double level = done ? cabs(lines[0]) : 0.0;
    for (size_t b = 0; done && b < bin_count; b++) {
        double complex mean = 0.0;
        for (size_t p = 0; p < recording->periods; p++) {
            mean += output[p * bin_count + b] / (double)recording->periods;
        }
        out_response[b] = mean / (cabs(input[b]) > 0.5 * level ? input[b] : level);
    }
    free(output);
    free(input);
    return done;
}

bool sequential_respond(const struct sequential_excitation *self, const struct sequential_play *play,
                        double complex out_response[sequential_lines])
{
    struct cubic_state state = {0};
    bool done = true;
    for (size_t k = 0; k < sequential_lines; k++) {
        out_response[k] = 0.0;
    }
    for (size_t i = 0; done && i < self->count; i++) {
        const struct sequential_segment *segment = &self->segments[play->downwards ? self->count - 1 - i : i];
        struct sequential_recording recording;
        double complex response[sequential_lines];
        if (play->from_rest) {
            state = (struct cubic_state){0};
        }
        done = sequential_record(segment, play, &state, &recording);
        if (done) {
            done = sequential_estimate(segment, &recording, segment->line_count, segment->bins, response);
            free(recording.position_m);
        }
        for (size_t k = 0; done && k < segment->line_count; k++) {
            out_response[segment->bins[k] - 1] = response[k];
        }
    }
    return done;
}

static double line_hz(size_t line)
{
    return (double)(line + 1) * sequential_rate_hz / sequential_samples;
}

static double error_db(const double complex *response, size_t line)
{
    return 20.0 * log10(cabs(response[line]) / cabs(cubic_plant_response(&cubic_plant_paper, line_hz(line))));
}

/// Whether a line was excited and lies in a band. Edges are whole lines; a quarter of a line is room for rounding.
static bool within(const double complex *response, size_t line, double low_hz, double high_hz)
{
    const double quarter_hz = 0.25 * sequential_rate_hz / sequential_samples;
    return cabs(response[line]) > 0.0 && line_hz(line) >= low_hz - quarter_hz && line_hz(line) < high_hz - quarter_hz;
}

double sequential_error_rms_db(const double complex response[sequential_lines], double low_hz, double high_hz)
{
    double sum = 0.0;
    size_t count = 0;
    for (size_t k = 0; k < sequential_lines; k++) {
        if (within(response, k, low_hz, high_hz)) {
            sum += error_db(response, k) * error_db(response, k);
            count++;
        }
    }
    return sqrt(sum / (double)count);
}

double sequential_error_max_db(const double complex response[sequential_lines], double low_hz, double high_hz)
{
    double largest = 0.0;
    for (size_t k = 0; k < sequential_lines; k++) {
        if (within(response, k, low_hz, high_hz)) {
            largest = fmax(largest, fabs(error_db(response, k)));
        }
    }
    return largest;
}

double sequential_peak(const struct sequential_segment *segment)
{
    const size_t points = (size_t)sequential_samples * cubic_points_per_sample;
    double *force_N = malloc(points * sizeof *force_N);
    double peak = NAN;
    if (force_N && sequential_force(segment, 1.0, points, force_N)) {
        peak = 0.0;
        for (size_t i = 0; i < points; i++) {
            peak = fmax(peak, fabs(force_N[i]));
        }
    }
    free(force_N);
    return peak;
}

/// RMS of the last period minus that `back` periods before it, over the RMS of both.
static double difference(const struct sequential_recording *recording, size_t back)
{
    const double *last = recording->position_m + (recording->periods - 1) * sequential_samples;
    const double *other = last - back * sequential_samples;
    double apart = 0.0;
    double power = 0.0;
    for (size_t n = 0; n < sequential_samples; n++) {
        apart += (last[n] - other[n]) * (last[n] - other[n]);
        power += 0.5 * (last[n] * last[n] + other[n] * other[n]);
    }
    return sqrt(apart / power);
}

bool sequential_period_difference(const struct sequential_segment *segment, const struct sequential_play *play,
                                  double *out_next, double *out_next_but_one)
{
    struct cubic_state state = {0};
    struct sequential_recording recording;
    if (!sequential_record(segment, play, &state, &recording)) {
        return false;
    }
    *out_next = difference(&recording, 1);
    *out_next_but_one = difference(&recording, 2);
    free(recording.position_m);
    return true;
}

double sequential_harmonic_distortion_db(const struct sequential_segment *segment, const struct sequential_play *play,
                                         struct cubic_state *io_state)
{
    enum { bins = sequential_samples / 2 };
    double complex *spectrum = malloc((bins + 1) * sizeof *spectrum);
    struct sequential_recording recording;
    double distortion_db = NAN;
    if (spectrum && sequential_record(segment, play, io_state, &recording)) {
        if (spectra_transform_all(recording.position_m, sequential_samples, 1, spectrum)) {
            const size_t line = segment->bins[0];
            double harmonics = 0.0;
            for (size_t b = 2 * line; b < bins; b += line) {
                harmonics += cabs(spectrum[b]) * cabs(spectrum[b]);
            }
            const double tone = cabs(spectrum[line]) * cabs(spectrum[line]);
            distortion_db = harmonics > 0.0 ? 10.0 * log10(harmonics / tone) : -INFINITY;
        }
        free(recording.position_m);
    }
    free(spectrum);
    return distortion_db;
}
