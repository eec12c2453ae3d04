/* SPDX-License-Identifier: MIT */
/// What a thread that keeps a bus's pace asks of the system: to go first, memory that stays, timers that are on time.
#ifndef SERVOSCOPE_PORTS_REAL_TIME_H
#define SERVOSCOPE_PORTS_REAL_TIME_H

#include <stdbool.h>

enum { real_time_priority = 80 }; ///< of SCHED_FIFO: above the kernel's own interrupt threads' 50

struct real_time {
    bool fifo;      ///< this thread runs before all that have no real-time priority
    bool locked;    ///< the memory that there was at real_time_enter stays where it is
    char text[192]; ///< one line: what was granted, and why not what was not
};

/// Asks for real time for the calling thread; what is refused is left out and said in `text`. Memory must have been
/// allocated before: what is touched later may have to be found first.
void real_time_enter(struct real_time *out_self);

/// Gives back what was granted. Harmless twice.
void real_time_leave(struct real_time *self);

#endif
