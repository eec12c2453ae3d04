/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/interrupt.h"

#include "ports/wall_clock.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

static const double first_shown_s = 1.0;
static const double renewed_s = 0.2;

/* The only way from a signal handler to the loop. */
static volatile sig_atomic_t stop_requested;

static void request_stop(int signal_number)
{
    (void)signal_number;
    stop_requested = 1;
}

void interrupt_catch(struct interrupt *out_self, bool second_ends)
{
    struct sigaction action;
    memset(&action, 0, sizeof action);
    action.sa_handler = request_stop;
    action.sa_flags = second_ends ? (int)SA_RESETHAND : 0;
    sigemptyset(&action.sa_mask);
    stop_requested = 0;
    sigaction(SIGINT, &action, &out_self->interrupt_before);
    sigaction(SIGTERM, &action, &out_self->terminate_before);
    // A terminal that is closed under a moving axis. Who asked for that to be ignored (nohup) is not disturbed.
    sigaction(SIGHUP, NULL, &out_self->hang_up_before);
    if (out_self->hang_up_before.sa_handler != SIG_IGN) {
        sigaction(SIGHUP, &action, NULL);
    }
}

void interrupt_release(const struct interrupt *self)
{
    sigaction(SIGINT, &self->interrupt_before, NULL);
    sigaction(SIGTERM, &self->terminate_before, NULL);
    sigaction(SIGHUP, &self->hang_up_before, NULL);
}

const volatile sig_atomic_t *interrupt_flag(void)
{
    return &stop_requested;
}

void terminal_line_start(struct terminal_line *self, const struct command_context *context)
{
    *self = (struct terminal_line){
        .wanted = context->terminal && !context->quiet && !context->json,
        .started_s = wall_clock_now_s(),
    };
}

double terminal_line_elapsed_s(const struct terminal_line *self)
{
    return wall_clock_now_s() - self->started_s;
}

bool terminal_line_due(struct terminal_line *self)
{
    double now = wall_clock_now_s();
    if (!self->wanted || now - self->started_s < first_shown_s || now - self->shown_s < renewed_s) {
        return false;
    }
    self->shown_s = now;
    return true;
}

void terminal_line_show(struct terminal_line *self, double share, const char *format, ...)
{
    va_list arguments;
    if (!terminal_line_due(self)) {
        return;
    }
    fputs("\r\033[K", stderr);
    if (share > 0.0) {
        fprintf(stderr, "%5.1f %%  ", 100.0 * fmin(share, 1.0));
    }
    va_start(arguments, format);
    vfprintf(stderr, format, arguments);
    va_end(arguments);
    if (share > 0.0) {
        fprintf(stderr, ", %.0f s left", fmax(0.0, terminal_line_elapsed_s(self) * (1.0 - share) / share));
    }
}

void terminal_line_clear(const struct terminal_line *self)
{
    if (self->shown_s > 0.0) {
        fputs("\r\033[K", stderr);
    }
}
