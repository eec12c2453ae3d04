/* SPDX-License-Identifier: MIT */
/// Time and waiting of the ports that reach out of the program: microseconds of CLOCK_MONOTONIC since a start.
#ifndef SERVOSCOPE_PORTS_WALL_CLOCK_H
#define SERVOSCOPE_PORTS_WALL_CLOCK_H

#include <poll.h>
#include <stddef.h>
#include <stdint.h>

struct wall_clock {
    uint64_t origin_ns;
    uint64_t compared_us; ///< when CLOCK_REALTIME was last compared with this clock
    int64_t ahead_ns;     ///< by which it was ahead then
};

/// Starts at 0.
void wall_clock_start(struct wall_clock *self);

uint64_t wall_clock_us(const struct wall_clock *self);

/// Seconds of CLOCK_MONOTONIC since some origin: for differences.
double wall_clock_now_s(void);

/// Converts a stamp of CLOCK_REALTIME (what the kernel puts on a frame) to this clock.
/// The two clocks are compared each half second, not at every frame: a read costs as much as a frame on some machines.
/// They drift apart by less than 1e-3 of that; a step of the machine's time spoils stamps until the next comparison.
/// `now_us` is this clock's time; the result is never later.
uint64_t wall_clock_of_stamp_us(struct wall_clock *self, uint64_t now_us, int64_t seconds, int64_t nanoseconds);

/// Waits until one of the files has an event that is asked for, or has failed, or until the time is `until_us`,
/// whichever is first; none at all: for the time alone. A signal ends the wait early. Writes `revents`; returns how
/// many files have events.
/// Each call computes what is left from the absolute time: early returns do not add up.
int wall_clock_wait(const struct wall_clock *self, struct pollfd *files, size_t count, uint64_t until_us);

#endif
