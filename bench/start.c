/* SPDX-License-Identifier: MIT */
/// What the rule for the start of a table leaves of the transient, as a table beside the reference's figures.
/// usage: start_study [--draws N] [--seed S]     (bench/start.sh hands its arguments on)
#include "bench/start_study.h"

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

/// The reference implementation's mean, median and 95 % in percent of the steady state's energy; 8000 candidate starts,
/// drives drawn by other rules, so that orders of magnitude and ratios compare.
static const double reference[start_mode_count][start_rule_count][3] = {
    {{14.4, 5.7, 53}, {11.3, 6.1, 44}, {0.905, 0.472, 3.16}, {0.602, 0.233, 2.16}, {0.011, 0.005, 0.041}},
    {{0.415, 0.369, 0.866}, {0.336, 0.328, 0.390}, {0.088, 0.055, 0.243}, {0.049, 0.022, 0.159}, {0.002, 0.001, 0.006}},
};

/// Largest mean allowed over the paper's mean; 0: nothing is asked.
static const double allowed[start_mode_count][start_rule_count] = {{0, 0, 0, 0.75, 0.05}, {0, 0, 0, 0.65, 0.05}};

static void print_table(const struct start_study *study)
{
    printf("%-12s %-8s %9s %9s %9s %9s   %s\n", "", "start", "mean [%]", "median", "95 %", "/ paper",
           "reference: mean, median, 95 % [%], / paper");
    for (int mode = 0; mode < start_mode_count; mode++) {
        const double paper = start_study_mean(study, (enum start_mode)mode, start_rule_paper);
        for (int rule = 0; rule < start_rule_count; rule++) {
            double mean = start_study_mean(study, (enum start_mode)mode, (enum start_rule)rule);
            double median = start_study_quantile(study, (enum start_mode)mode, (enum start_rule)rule, 0.5);
            double high = start_study_quantile(study, (enum start_mode)mode, (enum start_rule)rule, 0.95);
            const double *known = reference[mode][rule];
            printf("%-12s %-8s %9.4f %9.4f %9.4f %9.3f   %7.3f %7.3f %7.3f %7.3f\n",
                   rule == 0 ? start_mode_names[mode] : "", start_rule_names[rule], 100 * mean, 100 * median,
                   100 * high, mean / paper, known[0], known[1], known[2],
                   known[0] / reference[mode][start_rule_paper][0]);
        }
    }
}

/// One line of ratios to the paper's rule; returns how many are not within what is allowed.
static int print_ratios(const char *name, const struct start_study *study)
{
    int beyond = 0;
    printf("%-12s", name);
    for (int mode = 0; mode < start_mode_count; mode++) {
        const double paper = start_study_mean(study, (enum start_mode)mode, start_rule_paper);
        printf("  %s:", start_mode_names[mode]);
        for (int rule = start_rule_bank; rule < start_rule_count; rule++) {
            double ratio = start_study_mean(study, (enum start_mode)mode, (enum start_rule)rule) / paper;
            bool held = ratio <= allowed[mode][rule];
            printf(" %s %.3f%s", start_rule_names[rule], ratio, held ? "" : " (!)");
            beyond += !held;
        }
    }
    printf("\n");
    return beyond;
}

/// What was added to a study after its first `begin` cases. Owns nothing.
static struct start_study tail_of(const struct start_study *study, size_t begin)
{
    struct start_study tail = *study;
    tail.count -= begin;
    for (int i = 0; i < start_mode_count * start_rule_count; i++) {
        tail.share[i / start_rule_count][i % start_rule_count] += begin;
    }
    return tail;
}

/// Returns non-zero after a failure, or if a mean over all draws is beyond what is allowed.
static int run(uint64_t seed, uint64_t draws, bool fresh_designs)
{
    struct start_study all = {0};
    int status = 0;
    printf("\n%s, %d drives each; means over the paper's rule\n",
           fresh_designs ? "six designs drawn for each seed" : "the six designs of the test", (int)start_plants);
    for (uint64_t draw = seed; !status && draw < seed + draws; draw++) {
        const struct start_draw which = {.plant_seed = draw, .design_seed = fresh_designs ? draw : 0};
        const size_t before = all.count;
        struct error error;
        status = start_study_add(&all, &which, &error);
        if (status) {
            fprintf(stderr, "start_study: %s\n", error.message);
            break;
        }
        char name[40];
        const struct start_study one = tail_of(&all, before);
        snprintf(name, sizeof name, "seed %llu", (unsigned long long)draw);
        print_ratios(name, &one);
    }
    if (!status) {
        status = print_ratios("all", &all) > 0;
        print_table(&all);
    }
    start_study_free(&all);
    return status;
}

int main(int count, char **arguments)
{
    uint64_t seed = (uint64_t)time(NULL) % 1000000 + 1;
    uint64_t draws = 5;
    for (int i = 1; i < count; i++) {
        char *end = NULL;
        uint64_t *number = strcmp(arguments[i], "--seed") == 0    ? &seed
                           : strcmp(arguments[i], "--draws") == 0 ? &draws
                                                                  : NULL;
        unsigned long long value = number && i + 1 < count ? strtoull(arguments[++i], &end, 10) : 0;
        if (!number || !end || *end != '\0' || value < 1) {
            fprintf(stderr, "usage: start_study [--draws N] [--seed S], N and S from 1 on\n");
            return 2;
        }
        *number = value;
    }
    int status = run(seed, draws, false);
    status |= run(seed, draws, true);
    printf("\nto see the same again: ./run bench start --draws %llu --seed %llu\n", (unsigned long long)draws,
           (unsigned long long)seed);
    return status;
}
