/* SPDX-License-Identifier: MIT */
#include "tests/truth/hidden.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const struct {
    const char *name, *says;
    double bound;
    int at_least;
} rates[hidden_rate_count] = {
    [hidden_rate_clear] = {"clear", "right set named, clear", 0.95, 1},
    [hidden_rate_moderate] = {"moderate", "right set named, moderate", 0.90, 1},
    [hidden_rate_faint] = {"faint", "right set named or stated tie, faint", 0.80, 1},
    [hidden_rate_combinations] = {"combinations", "right set named, two or three causes", 0.85, 1},
    [hidden_rate_precision] = {"precision", "names that are there, of all names", 0.95, 1},
    [hidden_rate_false_alarms] = {"false-alarms", "clean case with a cause named", 0.02, 0},
    [hidden_rate_unknown_clear] = {"unknown-clear", "clear unknown effect called unexplained", 1.0, 1},
    [hidden_rate_unknown_moderate] = {"unknown-moderate", "moderate unknown effect called unexplained", 0.80, 1},
    [hidden_rate_unknown_named] = {"unknown-named", "unknown effect given a wrong name", 0.05, 0},
    [hidden_rate_parameters] = {"parameters", "parameters within 3 standard deviations", 0.95, 1},
    [hidden_rate_white] = {"white", "explained, whitened rms up to 1.02", 0.95, 1},
    [hidden_rate_white_mean] = {"white-mean", "explained, whitened mean within its 95 %", 0.90, 1},
    [hidden_rate_failed] = {"failed", "no diagnosis", 0.0, 0},
};

const char *hidden_rate_name(enum hidden_rate rate)
{
    return rates[rate].name;
}

double hidden_rate_bound(enum hidden_rate rate)
{
    return rates[rate].bound;
}

struct share {
    int part, whole;
};

static void add(struct share *self, int yes)
{
    self->part += yes != 0;
    self->whole++;
}

static void count_known(const struct hidden_record *record, int right, struct share *out)
{
    const struct score *score = &record->score;
    if (record->class == hidden_combination) {
        add(&out[hidden_rate_combinations], right);
    } else if (record->class == hidden_single) {
        enum truth_size size = record->wish.size;
        add(&out[size == truth_size_clear      ? hidden_rate_clear
                 : size == truth_size_moderate ? hidden_rate_moderate
                                               : hidden_rate_faint],
            right || (size == truth_size_faint && score->outcome == score_tied));
    }
    out[hidden_rate_parameters].part += score->parameters_within_3_std;
    out[hidden_rate_parameters].whole += score->parameters;
    if (strcmp(score->verdict, "explained") == 0) {
        add(&out[hidden_rate_white], score->whitened_rms <= 1.02);
        add(&out[hidden_rate_white_mean], score->mean_rms <= score->mean_rms_chance);
    }
}

static void count(const struct hidden_record *records, int cases, struct share *out)
{
    memset(out, 0, hidden_rate_count * sizeof *out);
    for (int i = 0; i < cases; i++) {
        const struct hidden_record *record = &records[i];
        const struct score *score = &record->score;
        if (!record->done) {
            continue;
        }
        int equal = score->outcome == score_equal, right = score->outcome == score_right || equal;
        int unexplained = strcmp(score->verdict, "unexplained") == 0;
        add(&out[hidden_rate_failed], score->outcome == score_failed);
        out[hidden_rate_precision].part += equal ? score->causes : score->causes_there;
        out[hidden_rate_precision].whole += score->causes;
        if (record->class == hidden_clean) {
            add(&out[hidden_rate_false_alarms], score->causes > 0);
        } else if (record->class == hidden_unknown) {
            add(&out[record->wish.size == truth_size_clear ? hidden_rate_unknown_clear : hidden_rate_unknown_moderate],
                unexplained);
            add(&out[hidden_rate_unknown_named], score->causes > 0);
        } else {
            count_known(record, right, out);
        }
    }
}

// Wilson's 95 % interval of a share.
static void wilson(struct share share, double *out_low, double *out_high)
{
    const double z = 1.96;
    double n = share.whole, p = n > 0.0 ? share.part / n : 0.0;
    double middle = (p + z * z / (2.0 * n)) / (1.0 + z * z / n);
    double reach = z * sqrt(p * (1.0 - p) / n + z * z / (4.0 * n * n)) / (1.0 + z * z / n);
    *out_low = n > 0.0 ? fmax(0.0, middle - reach) : 0.0;
    *out_high = n > 0.0 ? fmin(1.0, middle + reach) : 1.0;
}

// Chance that of `whole` cases, each with the chance `p`, `low` to `high` come out so.
static double binomial(int low, int high, int whole, double p)
{
    double sum = 0.0;
    for (int k = low; k <= high; k++) {
        double ways = lgamma(whole + 1.0) - lgamma(k + 1.0) - lgamma(whole - k + 1.0);
        double yes = k > 0 ? k * log(p) : 0.0, no = k < whole ? (whole - k) * log1p(-p) : 0.0;
        sum += exp(ways + yes + no);
    }
    return sum;
}

static int is_broken(const struct hidden_options *options, enum hidden_rate rate, struct share share)
{
    const double once_in = 1e-3;
    double bound = options->bound[rate], reached = share.whole ? (double)share.part / share.whole : 0.0;
    if (!share.whole || (rates[rate].at_least ? reached >= bound : reached <= bound)) {
        return 0;
    }
    if (!options->beyond_chance) {
        return 1;
    }
    return (rates[rate].at_least ? binomial(0, share.part, share.whole, bound)
                                 : binomial(share.part, share.whole, share.whole, bound)) < once_in;
}

// Prints the rates beside their bounds; how many are broken. A class without cases breaks nothing.
static int print_rates(const struct hidden_options *options, const struct share *shares)
{
    int broken = 0;
    printf("\n%-44s %13s %8s  %-15s %s\n", "rate", "cases", "share", "Wilson 95 %", "bound");
    for (int i = 0; i < hidden_rate_count; i++) {
        double low, high, share = shares[i].whole ? (double)shares[i].part / shares[i].whole : 0.0;
        double bound = options->bound[i];
        int bad = is_broken(options, (enum hidden_rate)i, shares[i]);
        wilson(shares[i], &low, &high);
        printf("%-44s %5d of %4d %6.1f %%  %5.1f .. %5.1f %%  %s %.0f %%%s\n", rates[i].says, shares[i].part,
               shares[i].whole, 100.0 * share, 100.0 * low, 100.0 * high,
               rates[i].at_least ? ">=" : "<=", 100.0 * bound, bad ? "  BROKEN" : "");
        broken += bad;
    }
    return broken;
}

static void row_name(const struct hidden_record *record, char *out, int length)
{
    if (record->class == hidden_combination) {
        snprintf(out, (size_t)length, "combination");
    } else {
        truth_wish_name(&record->wish, out, length);
    }
}

// One line for each kind: what it was called, and how often.
static void print_confusion(const struct hidden_record *records, int cases)
{
    printf("\nhidden: named (times)\n");
    for (int i = 0; i < cases; i++) {
        char name[SCORE_TEXT_LENGTH], other[SCORE_TEXT_LENGTH];
        int seen = records[i].class == hidden_combination || !records[i].done;
        row_name(&records[i], name, sizeof name);
        for (int k = 0; k < i && !seen; k++) {
            row_name(&records[k], other, sizeof other);
            seen = records[k].done && strcmp(name, other) == 0;
        }
        if (seen) {
            continue;
        }
        printf("  %-27s", name);
        for (int k = i; k < cases; k++) {
            int same = 0, earlier = 0;
            row_name(&records[k], other, sizeof other);
            if (!records[k].done || strcmp(name, other) != 0) {
                continue;
            }
            for (int m = i; m < cases; m++) {
                row_name(&records[m], other, sizeof other);
                int match = records[m].done && strcmp(name, other) == 0 &&
                            strcmp(records[m].score.named, records[k].score.named) == 0;
                same += match;
                earlier |= match && m < k;
            }
            if (!earlier) {
                printf("  %s (%d)", records[k].score.named, same);
            }
        }
        printf("\n");
    }
}

// A likelihood ratio of expectation E and variance 2 E against the threshold that noise alone passes once in a
// thousand: with d^2 = 2 E the chance of detection is Phi(d - 3.09).
static double limit_of_detection(double nats)
{
    return 0.5 * erfc(-(sqrt(2.0 * fmax(0.0, nats)) - 3.09) / sqrt(2.0));
}

static void print_detection(const struct hidden_record *records, int cases)
{
    printf("\nright set named, of cases (mean chance of detection at Neyman and Pearson's limit, 1 false alarm in "
           "1000)\n");
    printf("  %-27s %20s %20s %20s\n", "", "clear", "moderate", "faint");
    for (int kind = 1; kind < truth_kind_count; kind++) {
        struct share share[truth_size_count] = {{0}};
        double limit[truth_size_count] = {0};
        int any = 0;
        for (int i = 0; i < cases; i++) {
            const struct hidden_record *record = &records[i];
            if (!record->done || record->wish.causes != 1 || (int)record->wish.kind[0] != kind) {
                continue;
            }
            enum score_outcome outcome = record->score.outcome;
            add(&share[record->wish.size], outcome == score_right || outcome == score_equal ||
                                               (outcome == score_tied && record->wish.size == truth_size_faint));
            limit[record->wish.size] += limit_of_detection(record->evidence_nats);
            any = 1;
        }
        if (!any) {
            continue;
        }
        printf("  %-27s", truth_kind_name((enum truth_kind)kind));
        for (int size = 0; size < truth_size_count; size++) {
            if (share[size].whole) {
                printf("   %3d of %3d (%5.1f %%)", share[size].part, share[size].whole,
                       100.0 * limit[size] / share[size].whole);
            } else {
                printf(" %20s", "");
            }
        }
        printf("\n");
    }
}

static double percent(int part, int whole)
{
    return whole ? 100.0 * part / whole : 0.0;
}

static void print_parameters_of(const char *name, const struct score *sum)
{
    if (sum->parameters) {
        printf("  %-27s %10d %9.0f %% %9.0f %% %9.0f %% %12.1f\n", name, sum->parameters,
               percent(sum->parameters_within_1_std, sum->parameters),
               percent(sum->parameters_within_2_std, sum->parameters),
               percent(sum->parameters_within_3_std, sum->parameters), sum->worst_z);
    }
}

static void add_parameters(struct score *self, const struct score *more)
{
    self->parameters += more->parameters;
    self->parameters_within_1_std += more->parameters_within_1_std;
    self->parameters_within_2_std += more->parameters_within_2_std;
    self->parameters_within_3_std += more->parameters_within_3_std;
    self->worst_z = fmax(self->worst_z, more->parameters ? more->worst_z : 0.0);
}

static void print_parameters(const struct hidden_record *records, int cases)
{
    struct score all = {0}, combinations = {0};
    printf("\nerrors of parameters over their stated standard deviations (of a normal error 68, 95 and 99.7 %%)\n");
    printf("  %-27s %10s %11s %11s %11s %12s\n", "", "parameters", "within 1", "within 2", "within 3", "largest");
    for (int kind = 1; kind < truth_kind_count; kind++) {
        struct score sum = {0};
        for (int i = 0; i < cases; i++) {
            if (records[i].done && records[i].wish.causes == 1 && (int)records[i].wish.kind[0] == kind) {
                add_parameters(&sum, &records[i].score);
            }
        }
        print_parameters_of(truth_kind_name((enum truth_kind)kind), &sum);
        add_parameters(&all, &sum);
    }
    for (int i = 0; i < cases; i++) {
        if (records[i].done && records[i].class == hidden_combination) {
            add_parameters(&combinations, &records[i].score);
        }
    }
    print_parameters_of("combinations", &combinations);
    add_parameters(&all, &combinations);
    print_parameters_of("all", &all);
}

static int ascending(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static void print_times(const struct hidden_record *records, int cases)
{
    double *seconds = malloc((size_t)cases * sizeof *seconds);
    int count = 0;
    for (int i = 0; seconds && i < cases; i++) {
        if (records[i].done) {
            seconds[count++] = records[i].score.seconds;
        }
    }
    if (count) {
        qsort(seconds, (size_t)count, sizeof *seconds, ascending);
        printf("processor seconds a case: median %.2f, 90 %% %.2f, slowest %.2f\n", seconds[count / 2],
               seconds[count * 9 / 10], seconds[count - 1]);
    }
    free(seconds);
}

static void print_failures(const struct hidden_options *options, const struct hidden_record *records)
{
    int any = 0;
    for (int i = 0; i < options->cases; i++) {
        const struct hidden_record *record = &records[i];
        char name[SCORE_TEXT_LENGTH];
        if (!record->done || record->score.outcome == score_right) {
            continue;
        }
        truth_wish_name(&record->wish, name, sizeof name);
        printf("%s  %s %s seed %llu %s %s", any++ ? "" : "\nnot right, files kept, replay with:\n", name,
               truth_size_name(record->wish.size), (unsigned long long)record->wish.seed,
               score_outcome_name(record->score.outcome), record->score.named);
        if (!isnan(record->score.left_nats)) {
            printf(" (%.3g nats short of the truth)", record->score.left_nats);
        }
        printf(":\n    hidden_cases --program %s --cases 1 --kind %s --size %s --seed %llu%s --keep --work %s\n",
               options->program, name, truth_size_name(record->wish.size), (unsigned long long)record->wish.seed,
               record->wish.protocol == truth_protocol_any      ? ""
               : record->wish.protocol == truth_protocol_stroke ? " --protocol stroke"
                                                                : " --protocol multisine",
               options->work);
    }
}

int hidden_report(const struct hidden_options *options, const struct hidden_record *records)
{
    struct share shares[hidden_rate_count];
    int done = 0, tied = 0, equal = 0, unreached = 0;
    for (int i = 0; i < options->cases; i++) {
        done += records[i].done;
        tied += records[i].done && records[i].score.outcome == score_tied;
        equal += records[i].done && records[i].score.outcome == score_equal;
        unreached += records[i].done && !records[i].reached;
    }
    count(records, options->cases, shares);
    print_confusion(records, options->cases);
    print_detection(records, options->cases);
    print_parameters(records, options->cases);
    print_failures(options, records);
    int broken = print_rates(options, shares);
    printf("another cause of a stated tie: %d; other causes that make the same motion: %d; sizes not reached: %d\n",
           tied, equal, unreached);
    print_times(records, options->cases);
    printf("seed %llu, %d of %d cases: %s\n", (unsigned long long)options->seed, done, options->cases,
           broken ? "bounds broken" : "within bounds");
    return broken ? 1 : 0;
}
