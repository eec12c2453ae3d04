/* SPDX-License-Identifier: MIT */
/* ppoll: poll has whole milliseconds only. */
#define _GNU_SOURCE
#include "ports/wall_clock.h"

#include <time.h>

enum { us_ns = 1000 };
static const uint64_t s_ns = 1000000000u;

static uint64_t read_ns(clockid_t clock)
{
    struct timespec now;
    clock_gettime(clock, &now);
    return (uint64_t)now.tv_sec * s_ns + (uint64_t)now.tv_nsec;
}

void wall_clock_start(struct wall_clock *self)
{
    self->origin_ns = read_ns(CLOCK_MONOTONIC);
}

uint64_t wall_clock_us(const struct wall_clock *self)
{
    return (read_ns(CLOCK_MONOTONIC) - self->origin_ns) / us_ns;
}

double wall_clock_now_s(void)
{
    return 1e-9 * (double)read_ns(CLOCK_MONOTONIC);
}

uint64_t wall_clock_of_stamp_us(struct wall_clock *self, uint64_t now_us, int64_t seconds, int64_t nanoseconds)
{
    const uint64_t compare_each_us = 500000;
    if (self->compared_us == 0 || now_us - self->compared_us > compare_each_us) {
        uint64_t here_ns = read_ns(CLOCK_MONOTONIC) - self->origin_ns;
        self->ahead_ns = (int64_t)(read_ns(CLOCK_REALTIME) - here_ns);
        self->compared_us = now_us;
    }
    int64_t stamp_ns = seconds * (int64_t)s_ns + nanoseconds - self->ahead_ns;
    uint64_t stamp_us = stamp_ns > 0 ? (uint64_t)stamp_ns / us_ns : 0;
    return stamp_us < now_us ? stamp_us : now_us;
}

int wall_clock_wait(const struct wall_clock *self, struct pollfd *files, size_t count, uint64_t until_us)
{
    const uint64_t longest_us = 3600u * 1000000u; // of one call; the caller looks at the time anyway
    uint64_t now_ns = read_ns(CLOCK_MONOTONIC) - self->origin_ns;
    uint64_t left_ns = 0;
    if (until_us > now_ns / us_ns + longest_us) {
        left_ns = longest_us * us_ns;
    } else if (until_us * us_ns > now_ns) {
        left_ns = until_us * us_ns - now_ns;
    }
    const struct timespec left = {.tv_sec = (time_t)(left_ns / s_ns), .tv_nsec = (long)(left_ns % s_ns)};
    for (size_t i = 0; i < count; i++) {
        files[i].revents = 0;
    }
    int ready = ppoll(files, (nfds_t)count, &left, NULL);
    return ready > 0 ? ready : 0;
}
