/* SPDX-License-Identifier: MIT */
#define _GNU_SOURCE
#include "ports/real_time.h"

#include <errno.h>
#include <sched.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>

void real_time_enter(struct real_time *out_self)
{
    const struct sched_param priority = {.sched_priority = real_time_priority};
    char fifo[64] = "", locked[64] = "";
    *out_self = (struct real_time){.fifo = sched_setscheduler(0, SCHED_FIFO, &priority) == 0};
    snprintf(fifo, sizeof fifo, "%s", out_self->fifo ? "" : strerror(errno));
    // Not MCL_FUTURE: under a limit it would make later allocations fail.
    out_self->locked = mlockall(MCL_CURRENT) == 0;
    snprintf(locked, sizeof locked, "%s", out_self->locked ? "" : strerror(errno));
    prctl(PR_SET_TIMERSLACK, 1ul, 0ul, 0ul, 0ul); // ns; threads without real-time priority get 50 us else
    snprintf(out_self->text, sizeof out_self->text, "%s%s%s, %s%s%s", out_self->fifo ? "SCHED_FIFO" : "no SCHED_FIFO (",
             fifo, out_self->fifo ? "" : ")", out_self->locked ? "memory locked" : "memory not locked (", locked,
             out_self->locked ? "" : ")");
}

void real_time_leave(struct real_time *self)
{
    const struct sched_param priority = {.sched_priority = 0};
    if (self->fifo) {
        sched_setscheduler(0, SCHED_OTHER, &priority);
    }
    if (self->locked) {
        munlockall();
    }
    self->fifo = self->locked = false;
}
