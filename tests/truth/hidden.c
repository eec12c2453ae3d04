/* SPDX-License-Identifier: MIT */
// wait4, for the processor time of one child among several.
#define _DEFAULT_SOURCE
#include "tests/truth/hidden.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

struct campaign {
    const struct hidden_options *options;
    struct hidden_record *records;
    int next;
    double begin_s;
    pthread_mutex_t lock;
};

static double now_s(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static enum hidden_class class_of(const struct truth_wish *wish)
{
    return wish->causes == 0                         ? hidden_clean
           : wish->causes > 1                        ? hidden_combination
           : truth_kind_is_catalogued(wish->kind[0]) ? hidden_single
                                                     : hidden_unknown;
}

// The mixture, 15 clean cases, 14 of one cause, 6 of several and 5 unknown in 40, so that any part is a fair sample.
static enum hidden_class class_at(int index, int *out_number)
{
    static const char mixture[] = "CSUCSMCSCSCUSCMSCSCSUCMSCSMCSCSUCMSCUSCM";
    static const char letters[hidden_class_count] = {'C', 'S', 'M', 'U'};
    const int length = (int)sizeof mixture - 1;
    int whole = 0, before = 0;
    char letter = mixture[index % length];
    for (int i = 0; i < length; i++) {
        whole += mixture[i] == letter;
        before += mixture[i] == letter && i < index % length;
    }
    *out_number = index / length * whole + before;
    int class = 0;
    while (letters[class] != letter) {
        class ++;
    }
    return (enum hidden_class) class;
}

static void draw_combination(struct truth_wish *self, int number, struct truth_random *random)
{
    int wanted = 2 + number % 3 / 2;
    while (self->causes < wanted) {
        enum truth_kind kind =
            (enum truth_kind)truth_random_integer(random, truth_kind_viscous_friction, truth_kind_lost_samples);
        int fits = 1;
        for (int i = 0; i < self->causes; i++) {
            fits &= truth_kind_goes_with(self->kind[i], kind);
        }
        if (fits) {
            self->kind[self->causes++] = kind;
        }
    }
}

// Kinds and sizes in turn: every pair comes up once before one comes twice.
static void mix(struct truth_wish *self, enum hidden_class class, int number)
{
    const int known = truth_kind_lost_samples, unknown = truth_kind_count - truth_kind_quadratic_drag;
    struct truth_random random;
    switch (class) {
    case hidden_single:
        self->causes = 1;
        self->kind[0] = (enum truth_kind)(truth_kind_viscous_friction + 7 * number % known);
        self->size = (enum truth_size)(number % truth_size_count);
        break;
    case hidden_unknown:
        self->causes = 1;
        self->kind[0] = (enum truth_kind)(truth_kind_quadratic_drag + 5 * number % unknown);
        self->size = (enum truth_size)((number + number / unknown) % truth_size_faint);
        break;
    case hidden_combination:
        truth_random_init(&random, self->seed, 9u);
        draw_combination(self, number, &random);
        self->size = (enum truth_size)(number % truth_size_faint);
        break;
    default:
        break;
    }
}

/// What case number `index` of a campaign hides.
static struct truth_wish wish_of(const struct hidden_options *options, int index)
{
    struct truth_wish wish = {.protocol = options->protocol};
    if (options->kinds) {
        wish = options->kind[index % options->kinds];
        wish.protocol = options->protocol;
        wish.size = options->size != truth_size_count ? options->size
                                                      : (enum truth_size)(index / options->kinds % truth_size_count);
        wish.seed = options->seed + (uint64_t)index;
        return wish;
    }
    int number = index;
    enum hidden_class class =
        options->only == hidden_class_count ? class_at(index, &number) : (enum hidden_class)options->only;
    wish.seed = options->seed + (uint64_t)index;
    mix(&wish, class, number);
    wish.size = options->size != truth_size_count ? options->size : wish.size;
    return wish;
}

static void case_path(char *out, const struct hidden_options *options, const struct truth_wish *wish, const char *name)
{
    char kinds[SCORE_TEXT_LENGTH];
    truth_wish_name(wish, kinds, sizeof kinds);
    snprintf(out, HIDDEN_PATH_LENGTH, "%s/%s-%s-%llu%s%s", options->work, kinds, truth_size_name(wish->size),
             (unsigned long long)wish->seed, *name ? "/" : "", name);
}

static double seconds_of(const struct timeval *time)
{
    return (double)time->tv_sec + 1e-6 * (double)time->tv_usec;
}

// Run the diagnosis as a user would. truth.json is written after it, so that it cannot be read. Time is the
// processor's: what else the machine does must not change what is found.
static int run_diagnosis(const struct hidden_options *options, const struct truth_wish *wish, double *out_seconds)
{
    char fit[HIDDEN_PATH_LENGTH], validation[HIDDEN_PATH_LENGTH], model[HIDDEN_PATH_LENGTH];
    char answer[HIDDEN_PATH_LENGTH], log[HIDDEN_PATH_LENGTH];
    case_path(fit, options, wish, "run1.csv");
    case_path(validation, options, wish, "run2.csv");
    case_path(model, options, wish, "nominal.json");
    case_path(answer, options, wish, "d.json");
    case_path(log, options, wish, "log.txt");
    pid_t child = fork();
    if (child == 0) {
        int out = open(log, O_WRONLY | O_CREAT | O_TRUNC, 0666);
        if (out < 0 || dup2(out, 1) < 0 || dup2(out, 2) < 0) {
            _exit(126);
        }
        const struct rlimit limit = {(rlim_t)options->time_limit_s, (rlim_t)options->time_limit_s + 1};
        setrlimit(RLIMIT_CPU, &limit);
        alarm(20u * (unsigned)options->time_limit_s);
        execl(options->program, options->program, "diagnose", fit, "--validate", validation, "--model", model,
              "--json-out", answer, "--quiet", (char *)NULL);
        _exit(127);
    }
    int status = -1;
    struct rusage usage = {0};
    while (child > 0 && wait4(child, &status, 0, &usage) < 0 && errno == EINTR) {
    }
    *out_seconds = seconds_of(&usage.ru_utime) + seconds_of(&usage.ru_stime);
    return status;
}

static void remove_case(const struct hidden_options *options, const struct truth_wish *wish)
{
    static const char *const names[] = {"run1.csv", "run2.csv", "nominal.json", "truth.json", "d.json", "log.txt"};
    char path[HIDDEN_PATH_LENGTH];
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        case_path(path, options, wish, names[i]);
        unlink(path);
    }
    case_path(path, options, wish, "");
    rmdir(path);
}

static void run_case(const struct hidden_options *options, struct hidden_record *record, struct truth_case *truth)
{
    char directory[HIDDEN_PATH_LENGTH], answer[HIDDEN_PATH_LENGTH], why[64];
    truth_case_make(truth, &record->wish);
    record->reached = truth->reached;
    record->protocol = truth->protocol == truth_protocol_stroke ? 's' : 'm';
    record->evidence_nats = record->wish.causes ? truth->evidence_nats[0] : 0.0;
    for (int i = 1; i < record->wish.causes; i++) {
        record->evidence_nats = fmin(record->evidence_nats, truth->evidence_nats[i]);
    }
    case_path(directory, options, &record->wish, "");
    case_path(answer, options, &record->wish, "d.json");
    unlink(answer);
    if (truth_case_write(truth, directory)) {
        score_fail(&record->score, "case not written");
        return;
    }
    int status = run_diagnosis(options, &record->wish, &record->score.seconds);
    if (WIFEXITED(status) && WEXITSTATUS(status) == 0) {
        score_read(&record->score, truth, answer);
    } else {
        int signal = WIFSIGNALED(status) ? WTERMSIG(status) : 0;
        if (signal == SIGXCPU || signal == SIGALRM) {
            snprintf(why, sizeof why, "time limit");
        } else {
            snprintf(why, sizeof why, "%s %d", signal ? "signal" : "exit status",
                     signal ? signal : WEXITSTATUS(status));
        }
        score_fail(&record->score, why);
    }
    if (record->score.outcome == score_right && !options->keep) {
        remove_case(options, &record->wish);
    } else {
        truth_case_write_answer(truth, directory);
    }
}

static void print_case(const struct hidden_record *record, int index)
{
    const struct score *score = &record->score;
    char name[SCORE_TEXT_LENGTH];
    truth_wish_name(&record->wish, name, sizeof name);
    printf("%3d %-28s %-8s seed %-10llu %c E %8.2g%s  %-6s %-34s", index + 1, name, truth_size_name(record->wish.size),
           (unsigned long long)record->wish.seed, record->protocol, record->evidence_nats, record->reached ? " " : "!",
           score_outcome_name(score->outcome), score->named);
    if (score->causes && strcmp(score->verdict, "explained") != 0) {
        printf(" (%s)", score->verdict);
    }
    if (score->outcome != score_failed) {
        printf("  nrmse %.4f > %.4f > %.4f floor %.4f  whitened %.3f mean %.3f of %.3f", score->nominal_nrmse,
               score->refitted_nrmse, score->extended_nrmse, score->floor_nrmse, score->whitened_rms, score->mean_rms,
               score->mean_rms_chance);
    }
    if (score->parameters) {
        printf("  %.1f std", score->worst_z);
    }
    if (score->parameters > score->parameters_within_3_std) {
        printf(" (%s)", score->worst_parameter);
    }
    printf("  %.1f s\n", score->seconds);
    fflush(stdout);
}

static int next_case(struct campaign *campaign)
{
    const struct hidden_options *options = campaign->options;
    pthread_mutex_lock(&campaign->lock);
    int late = options->minutes > 0.0 && now_s() - campaign->begin_s > 60.0 * options->minutes;
    int index = late ? options->cases : campaign->next++;
    pthread_mutex_unlock(&campaign->lock);
    return index < options->cases ? index : -1;
}

static void *work(void *argument)
{
    struct campaign *campaign = argument;
    struct truth_case *truth = malloc(sizeof *truth);
    for (int index = truth ? next_case(campaign) : -1; index >= 0; index = next_case(campaign)) {
        struct hidden_record *record = &campaign->records[index];
        run_case(campaign->options, record, truth);
        pthread_mutex_lock(&campaign->lock);
        record->done = 1;
        print_case(record, index);
        pthread_mutex_unlock(&campaign->lock);
    }
    free(truth);
    return NULL;
}

static int run_campaign(const struct hidden_options *options, struct hidden_record *records)
{
    struct campaign campaign = {
        .options = options, .records = records, .begin_s = now_s(), .lock = PTHREAD_MUTEX_INITIALIZER};
    pthread_t thread[64];
    int started = 0;
    for (int i = 0; i < options->cases; i++) {
        records[i] = (struct hidden_record){.wish = wish_of(options, i)};
        records[i].class = class_of(&records[i].wish);
    }
    printf("seed %llu, %d cases\n", (unsigned long long)options->seed, options->cases);
    while (started < options->jobs && pthread_create(&thread[started], NULL, work, &campaign) == 0) {
        started++;
    }
    for (int i = 0; i < started; i++) {
        pthread_join(thread[i], NULL);
    }
    return started ? 0 : -1;
}

static int usage(FILE *out)
{
    fprintf(out,
            "usage: hidden_cases --program PATH [--cases N] [--minutes M] [--seed S | --fresh] [--jobs 2]\n"
            "       [--kind KIND[+KIND...][,KIND...]] [--size clear|moderate|faint] [--protocol multisine|stroke]\n"
            "       [--only clean|single|combination|unknown] [--work DIR] [--keep] [--time-limit SECONDS]\n"
            "       [--bound RATE=VALUE] [--beyond-chance]\n"
            "Hides effects in data of a drive that shares no code with the program, has PATH diagnose them, and\n"
            "exits with 1 when a rate is beyond its bound; with --beyond-chance only where so few cases, each as good\n"
            "as required, would break it less than once in a thousand times.\nRates, and what is required of 400 fresh "
            "cases:");
    for (int rate = 0; rate < hidden_rate_count; rate++) {
        fprintf(out, " %s=%g", hidden_rate_name((enum hidden_rate)rate), hidden_rate_bound((enum hidden_rate)rate));
    }
    fprintf(out, "\nKinds:");
    for (int kind = 0; kind < truth_kind_count; kind++) {
        fprintf(out, " %s", truth_kind_name((enum truth_kind)kind));
    }
    fprintf(out, "\n");
    return 2;
}

static int set_kinds(struct hidden_options *self, const char *list)
{
    char text[1024];
    if (strlen(list) >= sizeof text) {
        return -1;
    }
    memcpy(text, list, strlen(list) + 1);
    char *rest = NULL;
    for (char *word = strtok_r(text, ",", &rest); word; word = strtok_r(NULL, ",", &rest)) {
        if (self->kinds == HIDDEN_KINDS_MAX || truth_wish_read(&self->kind[self->kinds], word)) {
            return -1;
        }
        self->kinds++;
    }
    return self->kinds ? 0 : -1;
}

static int set_bound(struct hidden_options *self, const char *text)
{
    for (int rate = 0; rate < hidden_rate_count; rate++) {
        size_t length = strlen(hidden_rate_name((enum hidden_rate)rate));
        if (strncmp(text, hidden_rate_name((enum hidden_rate)rate), length) == 0 && text[length] == '=') {
            char *end = NULL;
            self->bound[rate] = strtod(text + length + 1, &end);
            return *end || end == text + length + 1 ? -1 : 0;
        }
    }
    return -1;
}

static int set_class(struct hidden_options *self, const char *name)
{
    static const char *const names[hidden_class_count] = {"clean", "single", "combination", "unknown"};
    self->only = 0;
    while (self->only < hidden_class_count && strcmp(names[self->only], name) != 0) {
        self->only++;
    }
    return self->only < hidden_class_count ? 0 : -1;
}

static uint64_t clock_seed(void)
{
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    return ((uint64_t)now.tv_sec * 1000u + (uint64_t)now.tv_nsec / 1000000u) % 1000000000u;
}

static int set_number(struct hidden_options *self, const char *name, const char *value)
{
    char *end = NULL;
    double number = strtod(value, &end);
    if (end == value || *end || !(number > 0.0 && number <= HIDDEN_CASES_MAX)) {
        return -1;
    }
    if (strcmp(name, "--cases") == 0) {
        self->cases = (int)number;
    } else if (strcmp(name, "--jobs") == 0) {
        self->jobs = (int)number;
    } else if (strcmp(name, "--time-limit") == 0) {
        self->time_limit_s = (int)number;
    } else if (strcmp(name, "--minutes") == 0) {
        self->minutes = number;
    } else {
        return -1;
    }
    return 0;
}

static int set_option(struct hidden_options *self, const char *name, const char *value)
{
    if (strcmp(name, "--program") == 0) {
        self->program = value;
    } else if (strcmp(name, "--work") == 0) {
        self->work = value;
    } else if (strcmp(name, "--seed") == 0) {
        self->seed = strtoull(value, NULL, 10);
    } else if (strcmp(name, "--kind") == 0) {
        return set_kinds(self, value);
    } else if (strcmp(name, "--only") == 0) {
        return set_class(self, value);
    } else if (strcmp(name, "--bound") == 0) {
        return set_bound(self, value);
    } else if (strcmp(name, "--size") == 0) {
        self->size = truth_size_find(value);
        return self->size == truth_size_count ? -1 : 0;
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

static int parse(struct hidden_options *self, int argc, char **argv)
{
    for (int i = 1; i < argc; i++) {
        if (strcmp(argv[i], "--fresh") == 0) {
            self->seed = clock_seed();
        } else if (strcmp(argv[i], "--keep") == 0) {
            self->keep = 1;
        } else if (strcmp(argv[i], "--beyond-chance") == 0) {
            self->beyond_chance = 1;
        } else if (i + 1 >= argc || set_option(self, argv[i], argv[i + 1])) {
            fprintf(stderr, "hidden_cases: %s: not understood\n", argv[i]);
            return -1;
        } else {
            i++;
        }
    }
    return self->program && self->cases > 0 && self->jobs > 0 && self->jobs <= 64 && self->time_limit_s > 0 ? 0 : -1;
}

int main(int argc, char **argv)
{
    static struct hidden_options options = {
        .cases = 60, .jobs = 2, .time_limit_s = 120, .seed = 1, .size = truth_size_count, .only = hidden_class_count};
    char made[] = "/tmp/servoscope-hidden-XXXXXX";
    for (int rate = 0; rate < hidden_rate_count; rate++) {
        options.bound[rate] = hidden_rate_bound((enum hidden_rate)rate);
    }
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
    struct hidden_record *records = malloc((size_t)options.cases * sizeof *records);
    if (!options.work || !records || run_campaign(&options, records)) {
        fprintf(stderr, "hidden_cases: cannot start: %s\n", strerror(errno));
        free(records);
        return 1;
    }
    int status = hidden_report(&options, records);
    if (own_work) {
        rmdir(options.work);
    }
    free(records);
    return status;
}
