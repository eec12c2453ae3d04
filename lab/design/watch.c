/* SPDX-License-Identifier: MIT */
#include "lab/design/watch.h"

#include <math.h>
#include <time.h>

static const double told_every_s = 0.05;

static double now_s(void)
{
    struct timespec now = {0};
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

void design_watch_begin(const struct design_request *request, double torque_rms_Nm, struct design_watch *out_watch)
{
    *out_watch = (struct design_watch){.request = request, .torque_rms_Nm = torque_rms_Nm, .owner = pthread_self()};
    out_watch->begun_s = now_s();
    out_watch->told_s = out_watch->begun_s;
    atomic_init(&out_watch->best_score, INFINITY);
    atomic_init(&out_watch->deadline_s, INFINITY);
}

void design_watch_plan(struct design_watch *self, size_t evaluations)
{
    atomic_store(&self->done, 0);
    atomic_store(&self->planned, evaluations);
}

double design_watch_elapsed_s(const struct design_watch *self)
{
    return now_s() - self->begun_s;
}

void design_watch_limit_time(struct design_watch *self, double elapsed_s)
{
    atomic_store(&self->deadline_s, elapsed_s);
}

void design_watch_offer(struct design_watch *self, double score)
{
    double best = atomic_load_explicit(&self->best_score, memory_order_relaxed);
    while (score < best && !atomic_compare_exchange_weak(&self->best_score, &best, score)) {
    }
}

static double share_done(const struct design_watch *self, double elapsed_s)
{
    size_t planned = atomic_load_explicit(&self->planned, memory_order_relaxed);
    size_t done = atomic_load_explicit(&self->done, memory_order_relaxed);
    double by_count = planned > 0 ? (double)done / (double)planned : 0;
    double by_time = self->request->time_budget_s > 0 ? elapsed_s / self->request->time_budget_s : 0;
    return fmin(1, fmax(by_count, by_time));
}

static void tell(struct design_watch *self, double now)
{
    const struct design_request *request = self->request;
    if (request->progress && pthread_equal(self->owner, pthread_self()) && now - self->told_s >= told_every_s) {
        self->told_s = now;
        request->progress(request->progress_context, share_done(self, now - self->begun_s),
                          self->torque_rms_Nm / atomic_load(&self->best_score));
    }
}

bool design_watch_goes_on(struct design_watch *self)
{
    const struct design_request *request = self->request;
    atomic_fetch_add_explicit(&self->done, 1, memory_order_relaxed);
    if (request->stop_requested && *request->stop_requested) {
        atomic_store(&self->interrupted, true);
        return false;
    }
    const double now = now_s();
    tell(self, now);
    return now - self->begun_s < atomic_load_explicit(&self->deadline_s, memory_order_relaxed);
}
