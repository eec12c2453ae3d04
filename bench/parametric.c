/* SPDX-License-Identifier: MIT */
/// Drawn drives, identified without being told orders or delay.
/// usage: parametric [PLANTS [SEED [FILE]]]   300 plants, seed 1; FILE: what became of each
#include "bench/parametric_study.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

enum { groups = 2 * study_kinds };

static const char *const names[groups] = {"rigid",        "two masses",        "three masses",
                                          "rigid, delay", "two masses, delay", "three masses, delay"};

static double percent(size_t part, size_t whole)
{
    return whole > 0 ? 100.0 * (double)part / (double)whole : NAN;
}

static void print_tally(const char *name, const struct study_tally *tally)
{
    size_t fits = tally->drawn - tally->refused;
    double error;
    double coverage = study_coverage(tally, &error);
    printf("%-22s %6zu %8zu %8.1f %8.1f %8.1f %9.1f +-%4.1f %10.1f %10.1f\n", name, tally->drawn, tally->refused,
           percent(tally->right, fits), percent(tally->lower, fits), percent(tally->higher, fits), 100.0 * coverage,
           100.0 * error, percent(tally->frequencies_covered, tally->frequencies),
           percent(tally->dampings_covered, tally->dampings));
}

/// Prints one requirement. Two standard errors of what was drawn are left to chance. Returns whether it holds.
static bool require(const char *what, double value, double low, double high, double error)
{
    bool good = value >= low - 2.0 * error && value <= high + 2.0 * error;
    printf("%-44s %6.1f %%   required %g..%g %%, two standard errors of %.1f %% aside   %s\n", what, value, low, high,
           error, good ? "" : "OUTSIDE");
    return good;
}

/// Standard error of a share, in percent.
static double share_error(double share_percent, size_t count)
{
    double share = 0.01 * share_percent;
    return 100.0 * sqrt(fmax(share * (1.0 - share), 0.0025) / (double)count);
}

static bool judge(const struct study_tally *all)
{
    size_t fits = all->drawn - all->refused;
    double error;
    double coverage = 100.0 * study_coverage(all, &error);
    double right = percent(all->right, fits);
    double higher = percent(all->higher, fits);
    double frequency = percent(all->frequencies_covered, all->frequencies);
    double damping = percent(all->dampings_covered, all->dampings);
    bool good = require("right number of poles", right, 97.0, 100.0, share_error(right, fits));
    good = require("poles that the drive does not have", higher, 0.0, 2.0, share_error(higher, fits)) && good;
    good = require("lines within the 95 % circle", coverage, 94.0, 96.0, 100.0 * error) && good;
    good =
        require("frequencies within 1.96 std", frequency, 94.0, 96.0, share_error(frequency, all->frequencies)) && good;
    return require("damping ratios within 1.96 std", damping, 94.0, 96.0, share_error(damping, all->dampings)) && good;
}

int main(int argc, char **argv)
{
    static struct study_recording recording;
    static struct study_tally tallies[groups];
    struct study_tally all = {0};
    size_t plants = argc > 1 ? strtoul(argv[1], NULL, 10) : 300;
    uint64_t seed = argc > 2 ? strtoul(argv[2], NULL, 10) : 1;
    FILE *list = argc > 3 ? fopen(argv[3], "w") : NULL;
    clock_t begin = clock();
    if (plants < groups || (argc > 3 && !list)) {
        fprintf(stderr, "parametric: expected at least %d plants, and a file that can be written\n", groups);
        return 2;
    }
    for (size_t i = 0; i < plants; i++) {
        size_t group = i % groups;
        if (list) {
            fprintf(list, "%zu: %s: ", i, names[group]);
        }
        study_draw(group % study_kinds, group >= study_kinds, seed * 1000003 + i, &recording);
        study_count(&recording, &tallies[group], list);
    }
    double each_ms = 1e3 * (double)(clock() - begin) / CLOCKS_PER_SEC / (double)plants;
    printf("%zu drawn drives, seed %llu: 60 to 256 lines, 2 to 10 periods, 20 to 60 dB; shares in %%\n", plants,
           (unsigned long long)seed);
    printf("%-22s %6s %8s %8s %8s %8s %16s %10s %10s\n", "drive", "drawn", "refused", "right", "fewer", "more",
           "circle 95 %", "frequency", "damping");
    for (size_t g = 0; g < groups; g++) {
        print_tally(names[g], &tallies[g]);
        study_add(&tallies[g], &all);
    }
    print_tally("all", &all);
    printf("%.0f ms each, orders and delay included\n\n", each_ms);
    if (list) {
        fclose(list);
    }
    return judge(&all) ? 0 : 1;
}
