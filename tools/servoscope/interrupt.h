/* SPDX-License-Identifier: MIT */
/// Ctrl-C, a polite kill and a closed terminal as a request that a loop can ask for, and a line on the terminal while
/// it works.
#ifndef SERVOSCOPE_TOOLS_INTERRUPT_H
#define SERVOSCOPE_TOOLS_INTERRUPT_H

#include "tools/servoscope/command.h"

#include <signal.h>
#include <stdbool.h>

/// What the signals did before.
struct interrupt {
    struct sigaction interrupt_before;
    struct sigaction terminate_before;
    struct sigaction hang_up_before;
};

/// From here on SIGINT, SIGTERM and SIGHUP set the flag that interrupt_flag() names, instead of ending the program.
/// `second_ends`: the second signal ends it after all, for work that moves nothing.
void interrupt_catch(struct interrupt *out_self, bool second_ends);

/// The signals do again what they did before. The flag keeps its value until the next interrupt_catch().
void interrupt_release(const struct interrupt *self);

/// Non-zero once a signal came.
const volatile sig_atomic_t *interrupt_flag(void);

/// A line on the terminal that is renewed five times a second, from the second second on.
struct terminal_line {
    bool wanted; ///< on a terminal, and neither --quiet nor --json
    double started_s;
    double shown_s;
};

void terminal_line_start(struct terminal_line *self, const struct command_context *context);

/// Whether it is time to write again.
bool terminal_line_due(struct terminal_line *self);

/// Seconds since the start.
double terminal_line_elapsed_s(const struct terminal_line *self);

/// Writes "41.3 %  TEXT, 12 s left" if it is time to: `share` of the work is done, 0 or less where nobody knows.
#if defined(__GNUC__)
__attribute__((format(printf, 3, 4)))
#endif
void terminal_line_show(struct terminal_line *self, double share, const char *format, ...);

/// Takes the line away.
void terminal_line_clear(const struct terminal_line *self);

#endif
