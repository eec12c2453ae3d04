/* SPDX-License-Identifier: MIT */
/// The first paper's experiments on the simulated drive: its figures 7, 8 and 9, and what a higher effective value
/// buys. usage: excitation PROGRAM FOLDER PAGE.html [RECORDINGS [SEED]]
#include "bench/excitation_study.h"

#include "lab/page/page.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum drive { good, poor, wandering, good_strong, wandering_strong, drives };

static const struct excitation_drive drive_list[drives] = {
    [good] = {.name = "good sensors", .rating = 1.0},
    [poor] = {.name = "poor sensors", .rating = 1.0, .poor_sensors = true},
    [wandering] = {.name = "good sensors, drive changes",
                   .rating = 1.0,
                   .friction_wander = 0.02,
                   .stiffness_wander = 0.01},
    [good_strong] = {.name = "good sensors, 10 Nm", .rating = 10.0},
    [wandering_strong] = {.name = "drive changes, 10 Nm",
                          .rating = 10.0,
                          .friction_wander = 0.02,
                          .stiffness_wander = 0.01},
};

enum { signals = 2, levels = 11, judged_level = 9, recordings_max = 100 };
static const char *const signal_columns[signals] = {"velocity_rad_per_s", "torque_Nm"};
static const char *const signal_names[signals] = {"velocity", "torque"};
static const double signal_limits[signals] = {0.05 / 0.0159, 1.0}; // at rating 1

/// Added noise over the limit of the signal: none, then half decades from 1e-5; the judged one is 0.1.
static double level_share(size_t level)
{
    return level == 0 ? 0.0 : pow(10.0, -5.0 + 0.5 * (double)(level - 1));
}

/// Means over the recordings of one drive and method.
struct result {
    double level_db;                    ///< of the std, mean over the lines
    double gain_db;                     ///< level of clip less that
    double gain_error_db;               ///< its standard deviation
    double std[excitation_lines];       ///< RMS over recordings
    double magnitude[excitation_lines]; ///< of the last one
    double snr_db[signals][levels];
};

struct study {
    size_t recordings;
    uint64_t seed;
    double effective_Nm[2][excitation_methods]; ///< rating 1, rating 10
    struct result results[drives][excitation_methods];
};

static double predicted_db(const struct study *study, size_t method)
{
    return 20.0 * log10(study->effective_Nm[0][method] / study->effective_Nm[0][excitation_clip]);
}

static void add_recording(const struct study *study, size_t drive, const struct excitation_recording *recording,
                          uint64_t seed, struct result *io_result)
{
    const double share = 1.0 / (double)study->recordings;
    for (size_t k = 0; k < excitation_lines; k++) {
        io_result->std[k] += share * recording->std[k] * recording->std[k];
        io_result->magnitude[k] = recording->magnitude[k];
    }
    for (size_t s = 0; s < signals; s++) {
        for (size_t l = 0; l < levels; l++) {
            const double noise = level_share(l) * signal_limits[s] * drive_list[drive].rating;
            io_result->snr_db[s][l] +=
                share * excitation_snr_db(&recording->run, signal_columns[s], noise, seed * levels + l);
        }
    }
}

/// Every method meets the same noise, so that gains are differences of pairs.
static bool measure_drive(const struct excitation_place *place, size_t drive, struct study *io_study)
{
    double clip_db[recordings_max] = {0};
    const double count = (double)io_study->recordings;
    for (size_t method = 0; method < excitation_methods; method++) {
        struct result *result = &io_study->results[drive][method];
        double square = 0.0;
        for (size_t r = 0; r < io_study->recordings; r++) {
            struct excitation_recording recording;
            const uint64_t seed = io_study->seed + r;
            if (!excitation_measure(place, &drive_list[drive], (enum excitation_method)method, seed, &recording)) {
                return false;
            }
            const double level_db = excitation_level_db(recording.std);
            clip_db[r] = method == excitation_clip ? level_db : clip_db[r];
            result->level_db += level_db / count;
            result->gain_db += (clip_db[r] - level_db) / count;
            square += (clip_db[r] - level_db) * (clip_db[r] - level_db) / count;
            add_recording(io_study, drive, &recording, seed, result);
            run_free(&recording.run);
        }
        result->gain_error_db = sqrt(fmax(square - result->gain_db * result->gain_db, 0.0) / (count - 1.0));
        for (size_t k = 0; k < excitation_lines; k++) {
            result->std[k] = sqrt(result->std[k]);
        }
    }
    return true;
}

static bool measure(const struct excitation_place *place, struct study *io_study)
{
    bool done = true;
    for (size_t method = 0; done && method < excitation_methods; method++) {
        for (size_t strong = 0; done && strong < 2; strong++) {
            fprintf(stderr, "designing %s\n", excitation_method_names[method]);
            done = excitation_design(place, (enum excitation_method)method, strong ? 10.0 : 1.0,
                                     &io_study->effective_Nm[strong][method]);
        }
    }
    for (size_t drive = 0; done && drive < drives; drive++) {
        fprintf(stderr, "measuring: %s\n", drive_list[drive].name);
        done = measure_drive(place, drive, io_study);
    }
    return done;
}

// ---- Tables

static void print_effective(const struct study *study)
{
    static const char *const paper[excitation_methods] = {"0.632", "0.692", "0.723", "-"};
    printf("effective torque at 1 Nm, 0.05 m/s, limits at the samples\n%-10s %10s %10s %24s\n", "method", "paper [Nm]",
           "here [Nm]", "predicted gain [dB]");
    for (size_t m = 0; m < excitation_methods; m++) {
        printf("%-10s %10s %10.4f %24.2f\n", excitation_method_names[m], paper[m], study->effective_Nm[0][m],
               predicted_db(study, m));
    }
}

static void print_gains(const struct study *study)
{
    printf(
        "\nfigure 7: std of the response, mean over 200 lines [dB], and gain over clip +- its standard deviation [dB]\n"
        "%-30s %10s",
        "", "clip, std");
    for (size_t m = 1; m < excitation_methods; m++) {
        printf(" %16s", excitation_method_names[m]);
    }
    printf("\n%-30s %10s", "predicted by effective values", "");
    for (size_t m = 1; m < excitation_methods; m++) {
        printf(" %16.2f", predicted_db(study, m));
    }
    for (size_t d = 0; d < drives; d++) {
        printf("\n%-30s %10.2f", drive_list[d].name, study->results[d][excitation_clip].level_db);
        for (size_t m = 1; m < excitation_methods; m++) {
            printf(" %9.2f +-%4.2f", study->results[d][m].gain_db, study->results[d][m].gain_error_db);
        }
    }
    printf("\n");
}

static void print_snr(const struct study *study, size_t drive, size_t signal)
{
    printf("\nfigure %zu: SNR of the %s, %s [dB]; gain over clip, predicted %.2f %.2f %.2f\n%-22s %8s %8s %8s %8s   "
           "%8s %8s "
           "%8s\n",
           8 + signal, signal_names[signal], drive_list[drive].name, predicted_db(study, 1), predicted_db(study, 2),
           predicted_db(study, 3), "noise over limit", "clip", "mca", "linf", "fast", "mca", "linf", "fast");
    for (size_t l = 0; l < levels; l++) {
        if (l == 0) {
            printf("%-22s", "none added");
        } else {
            printf("%-22.2g", level_share(l));
        }
        for (size_t m = 0; m < excitation_methods; m++) {
            printf(" %8.2f", study->results[drive][m].snr_db[signal][l]);
        }
        printf("  ");
        for (size_t m = 1; m < excitation_methods; m++) {
            printf(" %8.2f", study->results[drive][m].snr_db[signal][l] -
                                 study->results[drive][excitation_clip].snr_db[signal][l]);
        }
        printf("\n");
    }
}

// ---- What is claimed

static bool claim(const char *what, double ours, double lowest, double highest)
{
    const bool good_enough = ours >= lowest && ours <= highest;
    printf("%-78s %8.2f   %.2f .. %.2f%s\n", what, ours, lowest, highest, good_enough ? "" : "   OUTSIDE");
    return good_enough;
}

static double snr_gain_db(const struct study *study, size_t drive, size_t method, size_t signal, size_t level)
{
    return study->results[drive][method].snr_db[signal][level] -
           study->results[drive][excitation_clip].snr_db[signal][level];
}

static bool judge(const struct study *study)
{
    const double fast_db = predicted_db(study, excitation_fast);
    // Friction bends the response a little otherwise under each excitation, and with it the level of its std.
    const double friction_db = 0.35;
    const double noise_db = 0.1;
    char what[100];
    bool all = true;
    printf("\n%-78s %8s   %s\n", "what a higher effective value buys [dB]", "here", "required");
    all &= claim("fast over clip, predicted by the effective values", fast_db, 0.9, INFINITY);
    all &= claim("poor sensors: gain of fast in the response's std", study->results[poor][excitation_fast].gain_db,
                 fast_db - friction_db, fast_db + friction_db);
    all &= claim("good sensors, nothing else changes: the same", study->results[good][excitation_fast].gain_db,
                 fast_db - friction_db, fast_db + friction_db);
    all &= claim("good sensors, friction changes by 2, belt by 1 %: less than half of that",
                 study->results[wandering][excitation_fast].gain_db, -INFINITY, 0.5 * fast_db);
    all &= claim("10 Nm instead of 1: gain in std where nothing else changes (20 by torque)",
                 study->results[good][excitation_clip].level_db - study->results[good_strong][excitation_clip].level_db,
                 17.0, 23.0);
    all &= claim("10 Nm instead of 1: gain in std where the drive changes",
                 study->results[wandering][excitation_clip].level_db -
                     study->results[wandering_strong][excitation_clip].level_db,
                 -INFINITY, 5.0);
    for (size_t s = 0; s < signals; s++) {
        for (size_t m = 1; m < excitation_methods; m++) {
            snprintf(what, sizeof what, "drive changes, noise of 0.1 of the limit added: SNR of the %s, %s over clip",
                     signal_names[s], excitation_method_names[m]);
            all &= claim(what, snr_gain_db(study, wandering, m, s, judged_level), predicted_db(study, m) - noise_db,
                         predicted_db(study, m) + noise_db);
        }
    }
    printf("\n%.2f dB is the same accuracy in 1/%.2f of the time. It is there where noise is what limits: with poor "
           "sensors, "
           "and with\ngood ones on a drive that repeats itself. What a drive changes meanwhile scatters in proportion "
           "to its "
           "motion:\nagainst that neither the phases nor ten times the torque help.\n",
           fast_db, pow(10.0, fast_db / 10.0));
    return all;
}

// ---- Page

static const enum figure_colour colours[excitation_methods] = {figure_orange, figure_blue, figure_vermilion,
                                                               figure_green};
static const enum figure_dash dashes[excitation_methods] = {figure_dashed, figure_solid, figure_dash_dot,
                                                            figure_dotted};
static const enum figure_marker markers[excitation_methods] = {figure_circle, figure_square, figure_triangle,
                                                               figure_diamond};

static void add_std_figure(struct page *page, const struct study *study, size_t drive)
{
    static struct figure figure;
    static double hz[excitation_lines];
    for (size_t k = 0; k < excitation_lines; k++) {
        hz[k] = 0.5 * (double)(k + 1);
    }
    figure_start(&figure, "frequency in Hz", axis_log);
    struct figure_panel *panel =
        figure_add_panel(&figure, "magnitude and standard deviation in rad/s per Nm", axis_log);
    panel->height = 300;
    figure_add_line(panel, "|G|", excitation_lines, hz, study->results[drive][excitation_clip].magnitude)->colour =
        figure_ink;
    for (size_t m = 0; m < excitation_methods; m++) {
        char name[40];
        snprintf(name, sizeof name, "std, %s", excitation_method_names[m]);
        struct figure_series *line = figure_add_line(panel, name, excitation_lines, hz, study->results[drive][m].std);
        line->colour = colours[m];
        line->dash = dashes[m];
    }
    page_add_figure(page, &figure,
                    "As figure 7 of the paper: %s. Standard deviation of the mean of 10 periods, RMS over %zu "
                    "recordings.",
                    drive_list[drive].name, study->recordings);
}

static void add_snr_figure(struct page *page, const struct study *study, size_t drive, size_t signal)
{
    static struct figure figure;
    static double share[levels - 1];
    static double gain_db[excitation_methods][levels - 1];
    char label[80];
    for (size_t l = 1; l < levels; l++) {
        share[l - 1] = level_share(l);
        for (size_t m = 0; m < excitation_methods; m++) {
            gain_db[m][l - 1] = snr_gain_db(study, drive, m, signal, l);
        }
    }
    figure_start(&figure, "standard deviation of the added noise over the signal's limit", axis_log);
    snprintf(label, sizeof label, "SNR of the %s in dB", signal_names[signal]);
    struct figure_panel *absolute = figure_add_panel(&figure, label, axis_linear);
    absolute->height = 220;
    struct figure_panel *relative = figure_add_panel(&figure, "the same over that of clip in dB", axis_linear);
    for (size_t m = 0; m < excitation_methods; m++) {
        struct figure_series *line = figure_add_line(absolute, excitation_method_names[m], levels - 1, share,
                                                     study->results[drive][m].snr_db[signal] + 1);
        line->colour = colours[m];
        line->dash = dashes[m];
        if (m != excitation_clip) {
            line = figure_add_points(relative, "", levels - 1, share, gain_db[m]);
            line->colour = colours[m];
            line->marker = markers[m];
            snprintf(label, sizeof label, "%s, predicted", excitation_method_names[m]);
            line = figure_add_limit(relative, label, predicted_db(study, m));
            line->colour = colours[m];
            line->dash = dashes[m];
        }
    }
    page_add_figure(page, &figure, "As figure %zu of the paper: %s.", 8 + signal, drive_list[drive].name);
}

static void add_gain_table(struct page *page, const struct study *study)
{
    static const char *const heads[] = {"drive", "std with clip [dB]", "mca", "linf", "fast"};
    page_start_table(page, "Gain over clip in dB, mean over the lines, with its standard deviation.", "lrrrr", heads);
    for (int d = -1; d < drives; d++) {
        char text[excitation_methods][32];
        const char *cells[excitation_methods + 1] = {d < 0 ? "predicted by effective values" : drive_list[d].name,
                                                     NULL};
        for (size_t m = 0; m < excitation_methods; m++) {
            const struct result *result = &study->results[d < 0 ? 0 : d][m];
            if (d < 0) {
                snprintf(text[m], sizeof text[m], "%.2f", predicted_db(study, m));
            } else if (m == excitation_clip) {
                snprintf(text[m], sizeof text[m], "%.2f", result->level_db);
            } else {
                snprintf(text[m], sizeof text[m], "%.2f ± %.2f", result->gain_db, result->gain_error_db);
            }
            cells[m + 1] = d < 0 && m == excitation_clip ? NULL : text[m];
        }
        page_add_row(page, cells);
    }
    page_end_table(page);
}

static int write_page(const char *path, const struct study *study)
{
    struct page page;
    FILE *stream = fopen(path, "w");
    if (!stream) {
        return -1;
    }
    page_start(
        &page, stream, "What a higher effective value buys",
        "First paper, section 5, on the simulated belt drive: 200 lines 0.5 to 100 Hz, 1 Nm, 0.05 m/s, 10 periods");
    page_add_note(
        &page, page_plain, "It buys accuracy where noise is what limits",
        "Fast has %.2f dB more torque than clip. The response gains %.2f dB with poor sensors and %.2f dB with "
        "good ones, but %.2f dB on a drive whose friction and belt change by 2 and 1 percent meanwhile.",
        predicted_db(study, excitation_fast), study->results[poor][excitation_fast].gain_db,
        study->results[good][excitation_fast].gain_db, study->results[wandering][excitation_fast].gain_db);
    page_add_section(&page, "Standard deviation of the response");
    add_gain_table(&page, study);
    add_std_figure(&page, study, good);
    add_std_figure(&page, study, wandering);
    page_add_section(&page, "Signal-to-noise ratio and added sensor noise");
    for (size_t s = 0; s < signals; s++) {
        add_snr_figure(&page, study, wandering, s);
        add_snr_figure(&page, study, good, s);
    }
    const int failed = page_end(&page, NULL);
    return fclose(stream) != 0 ? -1 : failed;
}

int main(int argc, char **argv)
{
    static struct study study;
    if (argc < 4) {
        fprintf(stderr, "usage: excitation PROGRAM FOLDER PAGE.html [RECORDINGS [SEED]]\n");
        return 2;
    }
    const struct excitation_place place = {.program = argv[1], .folder = argv[2]};
    study.recordings = argc > 4 ? strtoul(argv[4], NULL, 10) : 6;
    study.seed = argc > 5 ? strtoull(argv[5], NULL, 10) : 1;
    if (study.recordings < 2 || study.recordings > recordings_max) {
        fprintf(stderr, "excitation: recordings '%s': expected 2 to %d\n", argv[4], recordings_max);
        return 2;
    }
    if (!measure(&place, &study)) {
        return 1;
    }
    printf("%zu recordings of each drive and method, seed %llu\n", study.recordings, (unsigned long long)study.seed);
    print_effective(&study);
    print_gains(&study);
    for (size_t s = 0; s < signals; s++) {
        print_snr(&study, wandering, s);
        print_snr(&study, good, s);
    }
    const bool all = judge(&study);
    if (write_page(argv[3], &study)) {
        fprintf(stderr, "%s: cannot be written\n", argv[3]);
        return 1;
    }
    printf("\npage: %s\n", argv[3]);
    return all ? 0 : 1;
}
