/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "tests/truth/hidden_score.h"

enum { SLOTS_MAX = 64, PATH_LENGTH = 1024, UNKNOWN_SLOT = truth_kind_count, CASES_MAX = 100000 };

struct options {
    const char *program;
    const char *work;
    int cases, jobs, time_limit_s, keep;
    uint64_t seed;
    double size;
    enum truth_protocol protocol;
    double min_right, max_false, max_named, min_unknown;
    int slots;
    int slot[SLOTS_MAX]; ///< kinds in turn; UNKNOWN_SLOT takes the uncatalogued ones in turn
};

struct record {
    enum truth_kind kind;
    uint64_t seed;
    double expected_evidence_nats;
    char protocol;
    struct score score;
};

struct campaign {
    const struct options *options;
    struct record *records;
    int next;
    pthread_mutex_t lock;
};

static enum truth_kind kind_of(const struct options *options, int index)
{
    int slot = options->slot[index % options->slots];
    int turn = index / options->slots;
    return slot != UNKNOWN_SLOT ? (enum truth_kind)slot : (enum truth_kind)(truth_kind_quadratic_drag + turn % 3);
}

static double now_s(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static void case_path(char *out, const struct options *options, const struct record *record, const char *name)
{
    snprintf(out, PATH_LENGTH, "%s/%s-%llu%s%s", options->work, truth_kind_name(record->kind),
             (unsigned long long)record->seed, *name ? "/" : "", name);
}

// Run the diagnosis as a user would. truth.json is written after it, so that it cannot be read.
static int run_diagnosis(const struct options *options, const struct record *record)
{
    char fit[PATH_LENGTH], validation[PATH_LENGTH], model[PATH_LENGTH], answer[PATH_LENGTH], log[PATH_LENGTH];
    case_path(fit, options, record, "run1.csv");
    case_path(validation, options, record, "run2.csv");
    case_path(model, options, record, "nominal.json");
    case_path(answer, options, record, "d.json");
    case_path(log, options, record, "log.txt");
    pid_t child = fork();
    if (child == 0) {
        int out = open(log, O_WRONLY | O_CREAT | O_TRUNC, 0666);
        if (out < 0 || dup2(out, 1) < 0 || dup2(out, 2) < 0) {
            _exit(126);
        }
        alarm((unsigned)options->time_limit_s);
        execl(options->program, options->program, "diagnose", fit, "--validate", validation, "--model", model,
              "--json-out", answer, "--quiet", (char *)NULL);
        _exit(127);
    }
    int status = -1;
    while (child > 0 && waitpid(child, &status, 0) < 0 && errno == EINTR) {
    }
    return status;
}

static void remove_case(const struct options *options, const struct record *record)
{
    static const char *const names[] = {"run1.csv", "run2.csv", "nominal.json", "truth.json", "d.json", "log.txt"};
    char path[PATH_LENGTH];
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        case_path(path, options, record, names[i]);
        unlink(path);
    }
    case_path(path, options, record, "");
    rmdir(path);
}

static void run_case(const struct options *options, struct record *record, struct truth_case *truth)
{
    char directory[PATH_LENGTH], answer[PATH_LENGTH], why[64];
    truth_case_make(truth, record->seed, record->kind, options->size, options->protocol);
    record->expected_evidence_nats = truth->expected_evidence_nats;
    record->protocol = truth->protocol == truth_protocol_stroke ? 's' : 'm';
    case_path(directory, options, record, "");
    case_path(answer, options, record, "d.json");
    record->score = (struct score){.worst_z = NAN, .worst_relative = NAN, .evidence_nats = NAN};
    unlink(answer);
    if (truth_case_write(truth, directory)) {
        score_fail(&record->score, "case not written");
        return;
    }
    double begin = now_s();
    int status = run_diagnosis(options, record);
    record->score.seconds = now_s() - begin;
    if (WIFEXITED(status) && WEXITSTATUS(status) == 0) {
        score_read(&record->score, truth, answer);
    } else {
        snprintf(why, sizeof why, WIFSIGNALED(status) ? "signal %d" : "exit status %d",
                 WIFSIGNALED(status) ? WTERMSIG(status) : WEXITSTATUS(status));
        score_fail(&record->score, why);
    }
    if (record->score.outcome == score_right && !options->keep) {
        remove_case(options, record);
    } else {
        truth_case_write_answer(truth, directory);
    }
}

static void print_case(const struct record *record, int index)
{
    const struct score *score = &record->score;
    printf("%3d %-18s seed %-10llu %c E %8.2g  %-6s %-34s", index + 1, truth_kind_name(record->kind),
           (unsigned long long)record->seed, record->protocol, record->expected_evidence_nats,
           score_outcome_name(score->outcome), score->named);
    if (!isnan(score->worst_z)) {
        printf("  %5.1f std %6.2f %%", score->worst_z, 100.0 * score->worst_relative);
    } else {
        printf("  %18s", "");
    }
    if (score->outcome != score_failed) {
        printf("  nrmse %.4f > %.4f > %.4f floor %.4f  whitened %.2f", score->nominal_nrmse, score->refitted_nrmse,
               score->extended_nrmse, score->floor_nrmse, score->whitened_rms);
    }
    printf("  %.1f s\n", score->seconds);
    fflush(stdout);
}

static void *work(void *argument)
{
    struct campaign *campaign = argument;
    struct truth_case *truth = malloc(sizeof *truth);
    for (;;) {
        pthread_mutex_lock(&campaign->lock);
        int index = campaign->next++;
        pthread_mutex_unlock(&campaign->lock);
        if (!truth || index >= campaign->options->cases) {
            break;
        }
        run_case(campaign->options, &campaign->records[index], truth);
        pthread_mutex_lock(&campaign->lock);
        print_case(&campaign->records[index], index);
        pthread_mutex_unlock(&campaign->lock);
    }
    free(truth);
    return NULL;
}

static int run_campaign(const struct options *options, struct record *records)
{
    struct campaign campaign = {.options = options, .records = records, .lock = PTHREAD_MUTEX_INITIALIZER};
    pthread_t thread[64];
    int started = 0;
    for (int i = 0; i < options->cases; i++) {
        records[i] = (struct record){.kind = kind_of(options, i), .seed = options->seed + (uint64_t)i};
        score_fail(&records[i].score, "not run");
    }
    while (started < options->jobs && pthread_create(&thread[started], NULL, work, &campaign) == 0) {
        started++;
    }
    for (int i = 0; i < started; i++) {
        pthread_join(thread[i], NULL);
    }
    return started ? 0 : -1;
}

// One line for each kind: what it was called, and how often.
static void print_confusion(const struct record *records, int cases)
{
    printf("\nhidden: named (times)\n");
    for (int kind = 0; kind < truth_kind_count; kind++) {
        int total = 0;
        for (int i = 0; i < cases; i++) {
            total += (int)records[i].kind == kind;
        }
        if (!total) {
            continue;
        }
        printf("  %-18s", truth_kind_name((enum truth_kind)kind));
        for (int i = 0; i < cases; i++) {
            int same = 0, earlier = 0;
            for (int j = 0; j < cases; j++) {
                int match = (int)records[j].kind == kind && strcmp(records[j].score.named, records[i].score.named) == 0;
                same += match;
                earlier |= match && j < i;
            }
            if ((int)records[i].kind == kind && !earlier) {
                printf("  %s (%d)", records[i].score.named, same);
            }
        }
        printf("\n");
    }
}

struct tally {
    int effects, effects_right, effects_tied;
    int clean, clean_right, clean_named;
    int unknown, unknown_right, unknown_named;
    int failed, parameters, within_3_std, explained_white;
    double seconds, slowest_s;
};

static struct tally count(const struct record *records, int cases)
{
    struct tally tally = {0};
    for (int i = 0; i < cases; i++) {
        const struct score *score = &records[i].score;
        int right = score->outcome == score_right;
        tally.failed += score->outcome == score_failed;
        tally.seconds += score->seconds;
        tally.slowest_s = fmax(tally.slowest_s, score->seconds);
        if (records[i].kind == truth_kind_clean) {
            tally.clean++;
            tally.clean_right += right;
            tally.clean_named += score->names_cause;
        } else if (!truth_kind_is_catalogued(records[i].kind)) {
            tally.unknown++;
            tally.unknown_right += right;
            tally.unknown_named += score->names_cause;
        } else {
            tally.effects++;
            tally.effects_right += right;
            tally.effects_tied += score->outcome == score_tied;
            tally.parameters += right;
            tally.within_3_std += right && score->worst_z <= 3.0;
            tally.explained_white += right && score->whitened_rms <= 1.02;
        }
    }
    return tally;
}

static double ratio(int part, int whole)
{
    return whole ? (double)part / (double)whole : 0.0;
}

// Prints one rate beside its bound; true when it is broken. A class without cases breaks nothing.
static int report(const char *what, int part, int whole, double bound, int at_least)
{
    double rate = ratio(part, whole);
    int broken = whole > 0 && !(at_least ? rate >= bound : rate <= bound);
    printf("  %-42s %4d of %4d  %6.1f %%  (%s %.1f %%)%s\n", what, part, whole, 100.0 * rate,
           at_least ? "at least" : "at most", 100.0 * bound, broken ? "  BROKEN" : "");
    return broken;
}

static void print_replays(const struct options *options, const struct record *records)
{
    int any = 0;
    for (int i = 0; i < options->cases; i++) {
        const struct record *record = &records[i];
        if (record->score.outcome == score_right) {
            continue;
        }
        char directory[PATH_LENGTH];
        case_path(directory, options, record, "");
        printf("%s  %s seed %llu %s %s: ", any++ ? "" : "\nnot right, files kept, replay with:\n",
               truth_kind_name(record->kind), (unsigned long long)record->seed,
               score_outcome_name(record->score.outcome), record->score.named);
        printf("hidden_cases --program %s --cases 1 --kinds %s --seed %llu --size %g%s --keep --work %s\n",
               options->program, truth_kind_name(record->kind), (unsigned long long)record->seed, options->size,
               options->protocol == truth_protocol_any      ? ""
               : options->protocol == truth_protocol_stroke ? " --protocol stroke"
                                                            : " --protocol multisine",
               options->work);
    }
}

static int summarise(const struct options *options, const struct record *records)
{
    struct tally tally = count(records, options->cases);
    print_confusion(records, options->cases);
    print_replays(options, records);
    printf("\n");
    int broken = report("effect named, and nothing else", tally.effects_right, tally.effects, options->min_right, 1);
    printf("  %-42s %4d of %4d\n", "another cause of a stated tie", tally.effects_tied, tally.effects);
    broken |= report("cause named on a clean case", tally.clean_named, tally.clean, options->max_false, 0);
    printf("  %-42s %4d of %4d\n", "clean case called no_discrepancy", tally.clean_right, tally.clean);
    broken |= report("catalogue name for an unknown effect", tally.unknown_named, tally.unknown, options->max_named, 0);
    broken |= report("unknown effect called unexplained", tally.unknown_right, tally.unknown, options->min_unknown, 1);
    broken |= report("diagnosis failed", tally.failed, options->cases, 0.0, 0);
    printf("  %-42s %4d of %4d\n", "right, all parameters within 3 std", tally.within_3_std, tally.parameters);
    printf("  %-42s %4d of %4d\n", "right, whitened rms up to 1.02", tally.explained_white, tally.parameters);
    printf("  seconds a case: mean %.2f, slowest %.2f\n", tally.seconds / options->cases, tally.slowest_s);
    printf("seed %llu, %d cases: %s\n", (unsigned long long)options->seed, options->cases,
           broken ? "bounds broken" : "within bounds");
    return broken ? 1 : 0;
}

static int usage(FILE *out)
{
    fprintf(
        out,
        "usage: hidden_cases --program PATH [--cases N] [--seed S | --fresh] [--kinds a,b] [--work DIR] [--jobs 2]\n"
        "       [--size X] [--protocol multisine|stroke] [--time-limit SECONDS] [--keep]\n"
        "       [--min-right 0.85] [--max-false-clean 0] [--max-named-unknown 0] [--min-unknown 0]\n"
        "Hides effects in data of a drive that shares no code with the program, has PATH diagnose them, and\n"
        "exits with 1 when a rate is beyond its bound. Kinds: unknown (the last three in turn)");
    for (int kind = 0; kind < truth_kind_count; kind++) {
        fprintf(out, " %s", truth_kind_name((enum truth_kind)kind));
    }
    fprintf(out, "\n");
    return 2;
}

static int set_kinds(struct options *self, const char *list)
{
    char text[512];
    if (strlen(list) >= sizeof text) {
        return -1;
    }
    memcpy(text, list, strlen(list) + 1);
    self->slots = 0;
    char *rest = NULL;
    for (char *word = strtok_r(text, ",", &rest); word; word = strtok_r(NULL, ",", &rest)) {
        int kind = strcmp(word, "unknown") == 0 ? UNKNOWN_SLOT : (int)truth_kind_find(word);
        if ((kind == truth_kind_count && strcmp(word, "unknown") != 0) || self->slots == SLOTS_MAX) {
            return -1;
        }
        self->slot[self->slots++] = kind;
    }
    return self->slots ? 0 : -1;
}

static void set_default_kinds(struct options *self)
{
    for (int kind = 0; kind <= truth_kind_dead_time; kind++) {
        self->slot[self->slots++] = kind;
    }
    self->slot[self->slots++] = UNKNOWN_SLOT;
}

static uint64_t clock_seed(void)
{
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    return ((uint64_t)now.tv_sec * 1000u + (uint64_t)now.tv_nsec / 1000000u) % 1000000000u;
}

static int set_number(struct options *self, const char *name, const char *value)
{
    char *end = NULL;
    double number = strtod(value, &end);
    if (end == value || *end) {
        return -1;
    }
    struct {
        const char *name;
        double *real;
        int *whole;
    } const known[] = {
        {"--cases", NULL, &self->cases},
        {"--jobs", NULL, &self->jobs},
        {"--time-limit", NULL, &self->time_limit_s},
        {"--size", &self->size, NULL},
        {"--min-right", &self->min_right, NULL},
        {"--max-false-clean", &self->max_false, NULL},
        {"--max-named-unknown", &self->max_named, NULL},
        {"--min-unknown", &self->min_unknown, NULL},
    };
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++) {
        if (strcmp(name, known[i].name) == 0) {
            if (known[i].real) {
                *known[i].real = number;
            } else {
                *known[i].whole = number >= 1.0 && number <= CASES_MAX ? (int)number : 0;
            }
            return 0;
        }
    }
    return -1;
}

static int set_option(struct options *self, const char *name, const char *value)
{
    if (strcmp(name, "--program") == 0) {
        self->program = value;
    } else if (strcmp(name, "--work") == 0) {
        self->work = value;
    } else if (strcmp(name, "--seed") == 0) {
        self->seed = strtoull(value, NULL, 10);
    } else if (strcmp(name, "--kinds") == 0) {
        return set_kinds(self, value);
    } else if (strcmp(name, "--protocol") == 0) {
        self->protocol = strcmp(value, "stroke") == 0      ? truth_protocol_stroke
                         : strcmp(value, "multisine") == 0 ? truth_protocol_multisine
                                                           : truth_protocol_any;
        return self->protocol == truth_protocol_any ? -1 : 0;
    } else {
        return set_number(self, name, value);
    }
    return 0;
}

static int parse(struct options *self, int argc, char **argv)
{
    for (int i = 1; i < argc; i++) {
        if (strcmp(argv[i], "--fresh") == 0) {
            self->seed = clock_seed();
        } else if (strcmp(argv[i], "--keep") == 0) {
            self->keep = 1;
        } else if (i + 1 >= argc || set_option(self, argv[i], argv[i + 1])) {
            fprintf(stderr, "hidden_cases: %s: not understood\n", argv[i]);
            return -1;
        } else {
            i++;
        }
    }
    if (!self->slots) {
        set_default_kinds(self);
    }
    int fits = self->program && self->cases > 0 && self->jobs > 0 && self->jobs <= 64 && self->time_limit_s > 0;
    return fits && self->size > 0.0 && self->size <= 100.0 ? 0 : -1;
}

int main(int argc, char **argv)
{
    struct options options = {.cases = 36, .jobs = 2, .time_limit_s = 120, .seed = 1, .size = 1.0, .min_right = 0.85};
    char made[] = "/tmp/servoscope-hidden-XXXXXX";
    if (argc == 2 && strcmp(argv[1], "--help") == 0) {
        usage(stdout);
        return 0;
    }
    if (parse(&options, argc, argv)) {
        return usage(stderr);
    }
    if (access(options.program, X_OK) != 0) {
        fprintf(stderr, "hidden_cases: %s: %s\n", options.program, strerror(errno));
        return 2;
    }
    int own_work = !options.work;
    if (own_work) {
        options.work = mkdtemp(made);
    }
    struct record *records = malloc((size_t)options.cases * sizeof *records);
    if (!options.work || !records || run_campaign(&options, records)) {
        fprintf(stderr, "hidden_cases: cannot start: %s\n", strerror(errno));
        free(records);
        return 1;
    }
    int status = summarise(&options, records);
    if (own_work) {
        rmdir(options.work);
    }
    free(records);
    return status;
}
