/* SPDX-License-Identifier: MIT */
#include "ports/real_time.h"
#include "sim/node/odrive_node.h"
#include "tools/servoscope/driving_can.h"
#include "tools/servoscope/interrupt.h"

#include <stdio.h>
#include <stdlib.h>

struct odriving {
    struct can_bus bus;
    struct odrive_node node;
    struct real_time rights;
};

static int run_node(struct odriving *self, const struct driving_request *request, const char *name,
                    const struct sim_model *model, const struct command_context *context, struct error *out_error)
{
    struct interrupt signals;
    const struct can_port port = can_bus_port(&self->bus);
    struct odrive_node_options options = odrive_node_defaults();
    options.node_id = (uint8_t)request->node;
    options.clock_ratio = 1.0 + 1e-6 * request->drift_ppm;
    if (!odrive_node_init(&self->node, model, &options, &port)) {
        return error_set(out_error, error_refused,
                         "--odrive: expected a rotary model and a clock drift within 100000 ppm");
    }
    const struct can_participant participant = odrive_node_participant(&self->node);
    interrupt_catch(&signals, false);
    real_time_enter(&self->rights);
    driving_say_start(&self->bus, request, name, context);
    enum can_status ended = driving_serve(&port, &participant, request->for_s);
    real_time_leave(&self->rights);
    interrupt_release(&signals);
    const struct can_bus_statistics bus = can_bus_read_statistics(&self->bus);
    if (!context->quiet && !context->json) {
        printf("%lu frames received, %lu sent, %lu not sent, %lu lost for want of room; %lu samples\n",
               (unsigned long)bus.received, (unsigned long)bus.sent, (unsigned long)bus.unsent,
               (unsigned long)bus.overflowed, (unsigned long)self->node.ticks);
    }
    return ended == can_err_gone ? error_set(out_error, error_refused, "--odrive: %s is gone", name) : 0;
}

int driving_odrive(const struct driving_request *request, const char *name, struct sim_model *model,
                   const struct command_context *context, struct error *out_error)
{
    if (request->latch_us > 0.0 || request->reply_us > 0.0 || request->period_tolerance > 0.0) {
        return error_set(out_error, error_usage,
                         "--odrive: it has no SYNC, and so no --latch-delay, --reply-delay and --period-tolerance");
    }
    if (request->node > odrive_node_max || request->faults || context->json) {
        return error_set(out_error, error_usage, "--odrive: expected --node 1..%d, without --faults and --json",
                         odrive_node_max);
    }
    struct odriving *self = calloc(1, sizeof *self);
    if (!self) {
        return error_set(out_error, error_refused, "out of memory");
    }
    const uint32_t bitrate = 1000000; // of somebody else's adapter
    int status = can_bus_open(&self->bus, name, "--odrive", can_bus_drive, 0, bitrate, out_error);
    if (!status) {
        status = run_node(self, request, name, model, context, out_error);
        can_bus_close(&self->bus);
    }
    free(self);
    return status;
}
