/* SPDX-License-Identifier: MIT */
/// The second paper's study in full: every table beside the reference's figures, and a page with the paper's figures.
/// usage: sequential PAGE.html [SEED]
#include "bench/sequential_checks.h"
#include "bench/sequential_page.h"

#include "lab/numeric/statistics.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double above_6_hz = 6.1; // first line of the band in which the paper sees distortion
static const double no_end_hz = 30.0;

static const char *const kind_lines[sequential_kinds] = {"linear:0.1:25:0.1", "octaves:0.1:25:0.1", "dwell:0.1:25:0.1"};
static const enum sequential_phases kind_phases[sequential_kinds] = {sequential_schroeder, sequential_schroeder,
                                                                     sequential_sine};

static void fail(void)
{
    fprintf(stderr, "sequential: memory is short\n");
    exit(1);
}

static struct sequential_excitation design(enum sequential_kind kind)
{
    struct sequential_excitation excitation;
    if (!sequential_design(kind_lines[kind], kind_phases[kind], 0, &excitation)) {
        fail();
    }
    return excitation;
}

static void respond(const struct sequential_excitation *excitation, const struct sequential_play *play,
                    double complex out_response[sequential_lines])
{
    if (!sequential_respond(excitation, play, out_response)) {
        fail();
    }
}

static double test_time_s(const struct sequential_excitation *excitation, double settle_s)
{
    double time_s = 0.0;
    for (size_t i = 0; i < excitation->count; i++) {
        time_s += settle_s + (double)excitation->segments[i].periods * sequential_samples / sequential_rate_hz;
    }
    return time_s;
}

/// One row of the first table; the reference's figures are errors above 6 Hz, over all lines, and from 1.5 to 6 Hz.
struct variant {
    const char *name;
    enum sequential_kind kind;
    struct sequential_play play;
    const char *reference;
};

static void print_errors(const struct variant *variant, const double complex *response)
{
    printf("%-38s %9.4f %9.4f %9.4f %9.4f %9.4f   %s\n", variant->name,
           sequential_error_rms_db(response, above_6_hz, no_end_hz),
           sequential_error_max_db(response, above_6_hz, no_end_hz), sequential_error_rms_db(response, 0.0, no_end_hz),
           sequential_error_rms_db(response, 0.0, 1.5), sequential_error_rms_db(response, 1.5, above_6_hz),
           variant->reference);
}

static void compare_excitations(struct sequential_results *results)
{
#define PLAY .plant = &cubic_plant_paper, .amplitude_N = 1.0
    static const struct variant variants[] = {
        {"one multisine, 250 periods", sequential_single, {PLAY, .settle_periods = 1}, "4.5855 4.6153 5.377"},
        {"octaves, state carried over", sequential_octaves, {PLAY, .settle_periods = 1}, "0.0056 3.9585 9.228"},
        {"sine dwell upwards, state carried over",
         sequential_dwell,
         {PLAY, .settle_periods = 1},
         "0.0019 3.7374 8.713"},
        {"octaves, each from rest",
         sequential_octaves,
         {PLAY, .settle_periods = 1, .from_rest = true},
         "0.0067 3.9586 9.228"},
        {"octaves, 200 s to settle", sequential_octaves, {PLAY, .settle_periods = 20}, "0.0063 3.9503 9.209"},
        {"sine dwell, each tone from rest",
         sequential_dwell,
         {PLAY, .settle_periods = 1, .from_rest = true},
         "0.0429 1.8011 4.197"},
        {"sine dwell downwards",
         sequential_dwell,
         {PLAY, .settle_periods = 1, .downwards = true},
         "0.0067 1.5363 3.581"},
        {"one multisine, force held", sequential_single, {PLAY, .settle_periods = 1, .held = true}, "4.5836 4.6136 -"},
        {"octaves, force held", sequential_octaves, {PLAY, .settle_periods = 1, .held = true}, "0.0191 3.9586 -"},
    };
#undef PLAY
    printf("A = 1 N, error in dB\n%-38s %9s %9s %9s %9s %9s   %s\n", "", "> 6 Hz", "its max", "all", "< 1.5 Hz",
           "1.5-6 Hz", "reference: > 6 Hz, all, 1.5-6 Hz");
    for (size_t i = 0; i < sizeof variants / sizeof *variants; i++) {
        const enum sequential_kind kind = variants[i].kind;
        struct sequential_excitation excitation = design(kind);
        double complex response[sequential_lines];
        respond(&excitation, &variants[i].play, response);
        print_errors(&variants[i], response);
        if (i < sequential_kinds) {
            memcpy(results->response[kind], response, sizeof response);
            results->above_db[kind] = sequential_error_rms_db(response, above_6_hz, no_end_hz);
            results->middle_db[kind] = sequential_error_rms_db(response, 1.5, above_6_hz);
            results->test_time_s[kind] = test_time_s(&excitation, 10.0);
        }
        sequential_free(&excitation);
    }
    printf("\nabove 6 Hz octaves are better than one multisine by a factor of %.0f in dB;\n"
           "from 1.5 to 6 Hz they are WORSE: %.2f against %.2f dB, because one octave around the mode gets all the "
           "power\n",
           results->above_db[sequential_single] / results->above_db[sequential_octaves],
           results->middle_db[sequential_octaves], results->middle_db[sequential_single]);
}

static void compare_octaves(struct sequential_results *results)
{
    static const double edges_hz[sequential_octave_count + 1] = {0.1, 1.6, 3.2, 6.4, 12.8, 30.0};
    static const char *const references[sequential_kinds] = {".121 6.96 4.44 7.26 2.10", ".157 15.65 .074 .0033 .0010",
                                                             ".159 13.11 4.81 .0031 .0003"};
    printf("\nRMS error in dB by octaves, A = 1 N\n%-20s %9s %9s %9s %9s %9s   %s\n", "", "0.1-1.6", "1.6-3.2",
           "3.2-6.4", "6.4-12.8", "12.8-25", "reference");
    for (size_t kind = 0; kind < sequential_kinds; kind++) {
        printf("%-20s", sequential_kind_names[kind]);
        for (size_t o = 0; o < sequential_octave_count; o++) {
            results->octave_db[kind][o] =
                sequential_error_rms_db(results->response[kind], edges_hz[o], edges_hz[o + 1]);
            printf(" %9.4f", results->octave_db[kind][o]);
        }
        printf("   %s\n", references[kind]);
    }
}

static void scan_amplitudes(struct sequential_results *results)
{
    static const double amplitudes_N[sequential_amplitudes] = {1.0, 0.3, 0.1, 0.03, 0.01};
    static const char *const references[sequential_kinds] = {
        "-, 1.510 (1.668), .101 (.1061), .0087 (.0091), .0010 (.0010)",
        "-, 2.298 (.0006), .542 (.0001), .0395 (0), .0043 (0)",
        "-, 2.995 (.0002), .725 (0), .112 (0), .0125 (0)",
    };
    printf("\nRMS error in dB over all lines (above 6 Hz), settled: 200 s, dwell 100 s\n%-20s", "A [N]");
    for (size_t a = 0; a < sequential_amplitudes; a++) {
        results->amplitude_N[a] = amplitudes_N[a];
        printf(" %17g", amplitudes_N[a]);
    }
    printf("   reference (200 s)\n");
    for (size_t kind = 0; kind < sequential_kinds; kind++) {
        struct sequential_excitation excitation = design((enum sequential_kind)kind);
        printf("%-20s", sequential_kind_names[kind]);
        for (size_t a = 0; a < sequential_amplitudes; a++) {
            const struct sequential_play play = {.plant = &cubic_plant_paper,
                                                 .amplitude_N = amplitudes_N[a],
                                                 .settle_periods = kind == sequential_dwell ? 10 : 20};
            double complex response[sequential_lines];
            respond(&excitation, &play, response);
            results->scan_db[kind][a] = sequential_error_rms_db(response, 0.0, no_end_hz);
            results->scan_above_db[kind][a] = sequential_error_rms_db(response, above_6_hz, no_end_hz);
            printf(" %8.4f (%6.4f)", results->scan_db[kind][a], results->scan_above_db[kind][a]);
            fflush(stdout);
        }
        printf("   %s\n", references[kind]);
        sequential_free(&excitation);
    }
}

enum { phase_draws = 20, distortion_draws = 10, static_draws = 100 };

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static void print_spread(double *values)
{
    qsort(values, phase_draws, sizeof *values, ascending);
    printf(" %8.4f %8.4f %8.4f", values[0], 0.5 * (values[phase_draws / 2 - 1] + values[phase_draws / 2]),
           values[phase_draws - 1]);
}

static void draw_phases(uint64_t seed)
{
    static const char *const references[2] = {"2.67 3.85 6.37 | 2.63 - 6.29", ".0061 .0099 .0139 | 2.55 - 3.73"};
    const struct sequential_play play = {.plant = &cubic_plant_paper, .amplitude_N = 1.0, .settle_periods = 1};
    printf("\nRMS error in dB with %d draws of random phases, A = 1 N: lowest, median, highest\n%-20s %26s %26s   %s\n",
           phase_draws, "", "above 6 Hz", "all lines", "reference (other draws)");
    for (size_t kind = 0; kind < sequential_dwell; kind++) {
        double above_db[phase_draws], all_db[phase_draws];
        for (size_t d = 0; d < phase_draws; d++) {
            struct sequential_excitation excitation;
            double complex response[sequential_lines];
            if (!sequential_design(kind_lines[kind], sequential_random, seed + d, &excitation)) {
                fail();
            }
            respond(&excitation, &play, response);
            above_db[d] = sequential_error_rms_db(response, above_6_hz, no_end_hz);
            all_db[d] = sequential_error_rms_db(response, 0.0, no_end_hz);
            sequential_free(&excitation);
        }
        printf("%-20s", sequential_kind_names[kind]);
        print_spread(above_db);
        print_spread(all_db);
        printf("   %s\n", references[kind]);
    }
}

/// How many draws of one multisine have not settled to the excitation's period after 200 s.
static void count_long_periods(uint64_t seed)
{
    const struct sequential_play play = {
        .plant = &cubic_plant_paper, .amplitude_N = 1.0, .settle_periods = 20, .periods = 3};
    const double settled = 1e-3;
    size_t unsettled = 0;
    for (size_t d = 0; d < phase_draws; d++) {
        struct sequential_excitation excitation;
        double next = 0.0, next_but_one = 0.0;
        if (!sequential_design(kind_lines[sequential_single], sequential_random, seed + d, &excitation) ||
            !sequential_period_difference(&excitation.segments[0], &play, &next, &next_but_one)) {
            fail();
        }
        unsettled += !(next <= settled);
        sequential_free(&excitation);
    }
    printf("of these draws of one multisine %zu differ from period to period after 200 s\n", unsettled);
}

/// Of the tones one after the other: carried over with 10 s to settle, and from rest with 50 s.
static void measure_distortion(struct sequential_results *results)
{
    struct sequential_excitation tones = design(sequential_dwell);
    const struct sequential_play quick = {
        .plant = &cubic_plant_paper, .amplitude_N = 1.0, .settle_periods = 1, .periods = 1};
    const struct sequential_play settled = {
        .plant = &cubic_plant_paper, .amplitude_N = 1.0, .settle_periods = 5, .periods = 1};
    struct cubic_state carried = {0};
    double highest_db = -INFINITY, rest_db = -INFINITY;
    size_t highest = 0, rest = 0;
    for (size_t k = 0; k < sequential_lines; k++) {
        struct cubic_state state = {0};
        const double quick_db = sequential_harmonic_distortion_db(&tones.segments[k], &quick, &state);
        state = (struct cubic_state){0};
        results->carried_distortion_db[k] = sequential_harmonic_distortion_db(&tones.segments[k], &quick, &carried);
        results->settled_distortion_db[k] = sequential_harmonic_distortion_db(&tones.segments[k], &settled, &state);
        highest = results->carried_distortion_db[k] > highest_db ? k : highest;
        highest_db = results->carried_distortion_db[highest];
        rest = quick_db > rest_db ? k : rest;
        rest_db = fmax(rest_db, quick_db);
    }
    sequential_free(&tones);
    printf(
        "\nharmonic distortion from dwell, highest: %+.2f dB at %.1f Hz upwards (reference +1.49 at 3.2), %.2f dB at "
        "%.1f Hz from rest (reference -6.95 at 2.7), 10 s to settle\n",
        highest_db, 0.1 * (double)(highest + 1), rest_db, 0.1 * (double)(rest + 1));
    printf("0.1 Hz after 10 s: %.2f dB, which is transient (reference -51.37); after 50 s %.2f dB\n",
           results->carried_distortion_db[0], results->settled_distortion_db[0]);
}

static const char *const grids[] = {"linear:0.1:25:0.1", "octaves:0.1:25:0.1", "odd:0.1:25:0.1",
                                    "random-odd:0.1:25:0.1", "octaves-random-odd"};
static const char *const grid_names[] = {"one multisine", "octaves", "odd lines", "random odd lines",
                                         "octaves, random odd"};
enum { grid_count = sizeof grids / sizeof *grids };

/// Rounding leaves about this much.
static const double rounding_db = -180.0;

static void print_levels(const struct sequential_levels *levels)
{
    const double values[] = {levels->coherent_db, levels->stochastic_db, levels->odd_db, levels->even_db};
    for (size_t i = 0; i < sizeof values / sizeof *values; i++) {
        if (values[i] < rounding_db) {
            printf(" %6s", "none");
        } else {
            printf(" %6.1f", values[i]);
        }
    }
    printf(" |");
}

static void measure_levels(uint64_t seed)
{
    static const struct {
        const char *name;
        double amplitude_N;
        double quadratic_N_per_m2;
    } cases[] = {
        {"A = 1 N", 1.0, 0.0}, {"A = 0.1 N", 0.1, 0.0}, {"A = 0.1 N, 50 x^2 added to the second spring", 0.1, 50.0}};
    printf("\nrelative error with %d draws of random phases, settled, in dB: bias, stochastic, level of detection "
           "lines (odd, "
           "even)\n%-22s %29s %30s %30s\n",
           distortion_draws, "", "below 1.5 Hz", "1.5 to 6 Hz", "above 6 Hz");
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        printf("%s\n", cases[c].name);
        for (size_t g = 0; g < grid_count; g++) {
            struct cubic_plant plant = cubic_plant_paper;
            struct sequential_levels levels[sequential_bands];
            plant.quadratic_N_per_m2[1] = cases[c].quadratic_N_per_m2;
            if (!sequential_distortion(grids[g], &plant, cases[c].amplitude_N, distortion_draws, seed, levels)) {
                fail();
            }
            printf("  %-20s", grid_names[g]);
            for (size_t band = 0; band < sequential_bands; band++) {
                print_levels(&levels[band]);
            }
            printf("\n");
            fflush(stdout);
        }
    }
}

static void measure_static(uint64_t seed)
{
    static const struct {
        double a2, a3;
        const char *references[4];
    } cases[] = {
        {0.1, 0.0, {"-41.1/-21.3", "none", "none", "none"}},
        {0.0, 0.1, {"-16.4/-19.9", "-16.6/-21.8", "-16.4/-19.9", "-22.5/none"}},
        {0.1, 0.1, {"-16.5/-17.7", "-16.6/-21.6", "-16.6/-20.2", "-22.5/none"}},
    };
    static const char *const lines[] = {"linear:0.1:25:0.1", "octaves:0.1:25:0.1", "odd:0.1:25:0.1",
                                        "dwell:0.3:24.3:8"};
    static const char *const names[] = {"one multisine", "octaves", "odd lines", "sine dwell"};
    printf("\nstatic u + a2 u^2 + a3 u^3, %d draws, relative error in dB: coherent, stochastic, detection odd, even\n",
           static_draws);
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        for (size_t g = 0; g < sizeof lines / sizeof *lines; g++) {
            struct sequential_levels levels;
            if (!sequential_static(lines[g], cases[c].a2, cases[c].a3, static_draws, seed, &levels)) {
                fail();
            }
            printf("  a2 = %-4g a3 = %-4g %-16s", cases[c].a2, cases[c].a3, names[g]);
            print_levels(&levels);
            printf("   reference %s\n", cases[c].references[g]);
        }
    }
}

int main(int argc, char **argv)
{
    static struct sequential_results results;
    const uint64_t seed = argc > 2 ? strtoull(argv[2], NULL, 10) : 1;
    if (argc < 2) {
        fprintf(stderr, "usage: sequential PAGE.html [SEED]\n");
        return 2;
    }
    compare_excitations(&results);
    compare_octaves(&results);
    scan_amplitudes(&results);
    draw_phases(seed);
    count_long_periods(seed);
    measure_distortion(&results);
    measure_static(seed);
    measure_levels(seed);
    if (sequential_page_write(argv[1], &results)) {
        fprintf(stderr, "%s: cannot be written\n", argv[1]);
        return 1;
    }
    printf("\nseed %llu\npage: %s\n", (unsigned long long)seed, argv[1]);
    return 0;
}
