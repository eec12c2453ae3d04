/* SPDX-License-Identifier: MIT */
#include "lab/design/starts.h"

#include "lab/design/newton.h"
#include "lab/design/phases.h"
#include "lab/design/polish.h"
#include "lab/design/projection.h"
#include "lab/numeric/blas.h"

#include "sim/random.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum {
    threads_max = 256,
    kept = design_starts_finalists_max, ///< the best starts
};

/// Enough to end in another valley, and still near enough to Newman's chirp, which where two limits compete is half a
/// percent better to start from than random phases.
static const double disturbance_rad = 0.3;

static const double relaxation_rad = 0.05; ///< the same picture

/// Of the time budget: what is kept free for the finish, some times what the first start took but not more than a part.
static const double finish_in_starts = 16;
static const double finish_share_max = 0.1;

/// p = 16 .. 256 for every start. The projections leave the largest values where they want them; a p this small moves
/// them once more to where there is more room, worth as much as twice the projections. The peak at p = 256 ranks starts
/// as the finished ones will be ranked (correlation 0.98), so only the best go on.
static const struct design_newton_plan descend_by_newton = {.first_exponent = 4, .last_exponent = 8, .steps = 4};
static const struct design_polish_plan descend_by_gradient = {.first_exponent = 4, .last_exponent = 11};

static const struct design_newton_plan relax_by_newton = {.first_exponent = 3, .last_exponent = 12, .steps = 4};

/// Up to p = 2^16, where log(points) / p is nothing: 0.0002 above p = 4096.
static const struct design_newton_plan finish_by_newton = {.first_exponent = 9, .last_exponent = 16, .steps = 4};
static const struct design_newton_plan finish_again_by_newton = {.first_exponent = 12, .last_exponent = 16, .steps = 4};
static const struct design_polish_plan finish_by_gradient = {.first_exponent = 10, .last_exponent = 12};

struct candidate {
    double score; ///< INFINITY: none
    size_t number;
    double *c;
};

/// What the threads share.
struct starts {
    const struct design_request *request;
    const struct design_starts_plan *plan;
    const struct design_spectrum *spectrum;
    struct design_watch *watch;
    pthread_mutex_t mutex; ///< of all below
    size_t next;           ///< number of the next start, or of the next candidate to finish
    size_t finished;
    bool finishing;
    bool complete; ///< false: memory was short
    double cpu_s;  ///< of the threads other than the calling one
    struct candidate best[kept];
    struct candidate final;
};

/// What each thread has of its own.
struct worker {
    struct starts *starts;
    struct design_search coarse;
    struct design_search search;
    double *c;
};

static bool precedes(double score, size_t number, const struct candidate *other)
{
    return score < other->score || (score <= other->score && number < other->number);
}

static void keep(struct candidate *candidate, double score, size_t number, const double *c, size_t lines)
{
    candidate->score = score;
    candidate->number = number;
    memcpy(candidate->c, c, 2 * lines * sizeof(double));
}

/// Enters a start into the list of the best.
static void enter(struct starts *self, double score, size_t number, const double *c)
{
    size_t place = kept;
    pthread_mutex_lock(&self->mutex);
    while (place > 0 && precedes(score, number, &self->best[place - 1])) {
        place--;
    }
    if (place < kept) {
        struct candidate last = self->best[kept - 1];
        memmove(&self->best[place + 1], &self->best[place], (kept - 1 - place) * sizeof last);
        self->best[place] = last;
        keep(&self->best[place], score, number, c, self->spectrum->line_count);
    }
    pthread_mutex_unlock(&self->mutex);
}

/// The seed's own sequence of seeds: neighbouring seeds and numbers have nothing in common.
static uint64_t seed_of(uint64_t seed, size_t number)
{
    uint64_t state[4];
    sim_random_seed(state, seed);
    uint64_t mixed = sim_random_bits(state);
    sim_random_seed(state, mixed ^ ((uint64_t)number * 0x9e3779b97f4a7c15u));
    return sim_random_bits(state);
}

static bool descend(struct design_search *search, const struct design_starts_plan *plan, double *inout_c)
{
    struct design_polish_plan gradient = descend_by_gradient;
    gradient.iterations = plan->descent_iterations;
    return plan->descent_iterations == 0 ? design_newton_run(search, &descend_by_newton, inout_c)
                                         : design_polish_run(search, &gradient, inout_c);
}

static void disturb(size_t lines, double size_rad, uint64_t seed, double *inout_c)
{
    uint64_t state[4];
    sim_random_seed(state, seed);
    for (size_t k = 0; k < lines; k++) {
        double angle = size_rad * sim_random_normal(state);
        double re = inout_c[2 * k];
        double im = inout_c[2 * k + 1];
        inout_c[2 * k] = re * cos(angle) - im * sin(angle);
        inout_c[2 * k + 1] = re * sin(angle) + im * cos(angle);
    }
}

/// From near the best so far, down to a small p again and up: every few times the valley found is a deeper one.
static bool finish(struct design_search *search, const struct design_starts_plan *plan, uint64_t seed, double *inout_c)
{
    const size_t lines = search->spectrum->line_count;
    const size_t bytes = 2 * lines * sizeof(double);
    struct design_polish_plan gradient = finish_by_gradient;
    gradient.iterations = plan->descent_iterations;
    if (plan->descent_iterations > 0) {
        return design_polish_run(search, &gradient, inout_c);
    }
    bool memory = design_newton_run(search, &finish_by_newton, inout_c);
    for (size_t round = 0; memory && round < plan->relaxations; round++) {
        memcpy(inout_c, search->best, bytes);
        disturb(lines, relaxation_rad, seed + round, inout_c);
        memory = design_newton_run(search, &relax_by_newton, inout_c);
    }
    memcpy(inout_c, search->best, bytes);
    return memory && (plan->relaxations == 0 || design_newton_run(search, &finish_again_by_newton, inout_c));
}

/// One start from beginning to end; false if memory is short.
static bool run_start(struct worker *self, size_t number)
{
    const struct design_starts_plan *plan = self->starts->plan;
    const size_t lines = self->starts->spectrum->line_count;
    design_phases_newman(lines, self->c);
    if (number == 0) {
        design_search_try(&self->search, self->c);
    } else {
        disturb(lines, disturbance_rad, seed_of(self->starts->request->seed, number), self->c);
    }
    self->search.best_score = INFINITY;
    self->coarse.best_score = INFINITY;
    size_t iterations = number == 0 ? plan->iterations : plan->further_iterations;
    if (!design_projection_run(&self->coarse, iterations, self->c)) {
        return false;
    }
    design_search_try(&self->search, self->c);
    if (design_search_goes_on(&self->search) && !descend(&self->search, plan, self->c)) {
        return false;
    }
    enter(self->starts, self->search.best_score, number, self->search.best);
    return true;
}

static bool take_number(struct starts *self, size_t count, size_t *out_number)
{
    pthread_mutex_lock(&self->mutex);
    *out_number = self->next;
    bool taken = self->complete && self->next < count;
    self->next += taken ? 1 : 0;
    pthread_mutex_unlock(&self->mutex);
    return taken;
}

static void note(struct starts *self, bool complete, bool finished)
{
    pthread_mutex_lock(&self->mutex);
    self->complete = self->complete && complete;
    self->finished += finished ? 1 : 0;
    pthread_mutex_unlock(&self->mutex);
}

/// From the end of start 0 on there is a result, and the time budget counts.
static void limit_time(struct starts *self)
{
    const double budget_s = self->request->time_budget_s;
    if (budget_s > 0) {
        double finish_s = finish_in_starts * design_watch_elapsed_s(self->watch);
        design_watch_limit_time(self->watch, budget_s - fmin(finish_s, finish_share_max * budget_s));
    }
}

static void run_starts(struct worker *self)
{
    struct starts *starts = self->starts;
    size_t number;
    while (take_number(starts, starts->plan->starts, &number)) {
        bool memory = run_start(self, number);
        if (number == 0) {
            limit_time(starts);
        }
        bool goes_on = design_search_goes_on(&self->search);
        note(starts, memory, memory && goes_on);
        if (!memory || !goes_on) {
            return;
        }
    }
}

/// Finishes candidates on the fine grid, where they are compared once more.
static void run_finish(struct worker *self)
{
    struct starts *starts = self->starts;
    const size_t lines = starts->spectrum->line_count;
    size_t place;
    while (take_number(starts, starts->plan->finalists, &place) && isfinite(starts->best[place].score)) {
        const struct candidate *candidate = &starts->best[place];
        memcpy(self->c, candidate->c, 2 * lines * sizeof(double));
        self->search.best_score = INFINITY;
        design_search_try(&self->search, self->c);
        bool memory = !design_search_goes_on(&self->search) ||
                      finish(&self->search, starts->plan, seed_of(starts->request->seed, ~candidate->number), self->c);
        note(starts, memory, false);
        pthread_mutex_lock(&starts->mutex);
        if (precedes(self->search.best_score, candidate->number, &starts->final)) {
            keep(&starts->final, self->search.best_score, candidate->number, self->search.best, lines);
        }
        pthread_mutex_unlock(&starts->mutex);
    }
}

static void worker_free(struct worker *self)
{
    design_search_free(&self->coarse);
    design_search_free(&self->search);
    free(self->c);
}

static bool worker_create(struct starts *starts, struct worker *out_worker)
{
    const struct design_starts_plan *plan = starts->plan;
    struct worker self = {.starts = starts, .c = calloc(2 * starts->spectrum->line_count, sizeof(double))};
    size_t grid = starts->finishing ? plan->fine_grid : plan->grid;
    bool coarse = starts->finishing ||
                  design_search_create_on(starts->request, starts->spectrum, plan->coarse_grid, 0, &self.coarse);
    bool complete =
        self.c && coarse && design_search_create_on(starts->request, starts->spectrum, grid, 0, &self.search);
    if (!complete) {
        worker_free(&self);
        return false;
    }
    self.coarse.watch = starts->watch;
    self.coarse.silent = true;
    self.search.watch = starts->watch;
    self.search.silent = starts->finishing;
    *out_worker = self;
    return true;
}

static void work(struct starts *self)
{
    struct worker worker;
    if (!worker_create(self, &worker)) {
        note(self, false, false);
        return;
    }
    if (self->finishing) {
        run_finish(&worker);
    } else {
        run_starts(&worker);
    }
    worker_free(&worker);
}

static void *thread_main(void *context)
{
    struct starts *self = context;
    struct timespec used = {0};
    work(self);
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &used);
    pthread_mutex_lock(&self->mutex);
    self->cpu_s += (double)used.tv_sec + 1e-9 * (double)used.tv_nsec;
    pthread_mutex_unlock(&self->mutex);
    return NULL;
}

static size_t thread_count(const struct design_request *request, size_t jobs)
{
    long processors = request->threads > 0 ? 0 : sysconf(_SC_NPROCESSORS_ONLN);
    size_t count = request->threads > 0 ? request->threads : processors > 0 ? (size_t)processors : 1;
    count = count < jobs ? count : jobs;
    return count < threads_max ? count : threads_max;
}

/// Works on this thread and on others; a thread that cannot be had only means more work for the rest.
static void work_together(struct starts *self, size_t jobs)
{
    pthread_t threads[threads_max];
    const size_t wanted = thread_count(self->request, jobs);
    size_t begun = 0;
    self->next = 0;
    while (begun + 1 < wanted && pthread_create(&threads[begun], NULL, thread_main, self) == 0) {
        begun++;
    }
    work(self);
    for (size_t i = 0; i < begun; i++) {
        pthread_join(threads[i], NULL);
    }
}

static bool allocate(struct starts *self)
{
    const size_t lines = self->spectrum->line_count;
    double *memory = calloc((kept + 1) * 2 * lines, sizeof *memory);
    for (size_t i = 0; memory && i < kept; i++) {
        self->best[i] = (struct candidate){.score = INFINITY, .number = SIZE_MAX, .c = &memory[2 * lines * (i + 1)]};
    }
    self->final = (struct candidate){.score = INFINITY, .number = SIZE_MAX, .c = memory};
    return memory != NULL;
}

bool design_starts_run(const struct design_request *request, const struct design_starts_plan *plan,
                       struct design_search *search)
{
    struct starts self = {
        .request = request, .plan = plan, .spectrum = search->spectrum, .watch = search->watch, .complete = true};
    if (!allocate(&self)) {
        return false;
    }
    double *const memory = self.final.c;
    pthread_mutex_init(&self.mutex, NULL);
    blas_use_one_thread();
    size_t planned = plan->starts < SIZE_MAX ? plan->starts : 0;
    design_watch_plan(self.watch, planned * plan->evaluations_per_start);
    work_together(&self, plan->starts);
    if (self.complete && plan->fine_grid > 0) {
        if (request->time_budget_s > 0) {
            design_watch_limit_time(self.watch, request->time_budget_s);
        }
        self.finishing = true;
        work_together(&self, plan->finalists < plan->starts ? plan->finalists : plan->starts);
    }
    const struct candidate *found = plan->fine_grid > 0 ? &self.final : &self.best[0];
    if (self.complete && isfinite(found->score)) {
        memcpy(search->best, found->c, 2 * search->spectrum->line_count * sizeof(double));
        search->best_score = found->score;
    }
    self.watch->starts = self.finished;
    self.watch->cpu_s += self.cpu_s;
    pthread_mutex_destroy(&self.mutex);
    free(memory);
    return self.complete;
}
