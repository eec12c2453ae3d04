/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/driving_can.h"

#include "lab/record/json_out.h"
#include "ports/fault_port.h"
#include "ports/real_time.h"
#include "sim/node/simulated_drive.h"
#include "tools/servoscope/can_bus.h"
#include "tools/servoscope/fault_list.h"
#include "tools/servoscope/interrupt.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/// Longest sleep: a signal that comes between looking and sleeping waits no longer than this.
static const uint64_t longest_wait_us = 50000;

struct driving {
    struct can_bus bus;
    struct simulated_drive drive;
    struct real_time rights;
    struct fault_list faults;
    struct fault_port harm;
};

static uint64_t earlier(uint64_t a, uint64_t b)
{
    return a < b ? a : b;
}

enum can_status driving_serve(const struct can_port *port, const struct can_participant *drive, double for_s)
{
    const struct can_port_operations *bus = port->operations;
    enum can_status status = can_ok;
    uint64_t now_us = bus->time_us(port->self);
    const double endless_s = 1e12; // in microseconds it still is a number of the bus's clock
    const uint64_t end_us = for_s > 0.0 && for_s < endless_s ? now_us + (uint64_t)(for_s * 1e6) : CAN_NEVER_US;
    while (status != can_err_gone && now_us < end_us && !*interrupt_flag()) {
        uint64_t due_us = earlier(drive->deadline_us(drive->self), earlier(end_us, now_us + longest_wait_us));
        if (due_us > now_us) {
            status = bus->wait(port->self, due_us);
        }
        struct can_frame frame;
        while (bus->receive(port->self, &frame)) {
            drive->receive(drive->self, &frame, bus->time_us(port->self));
        }
        now_us = bus->time_us(port->self);
        if (drive->deadline_us(drive->self) <= now_us) {
            drive->advance(drive->self, now_us);
        }
    }
    return status;
}

void driving_say_start(const struct can_bus *bus, const struct driving_request *request, const char *name,
                       const struct command_context *context)
{
    char where[300];
    if (context->json || context->quiet) {
        return;
    }
    can_bus_describe(bus, name, where, sizeof where);
    printf("node %lld on %s; Ctrl-C ends it\n", request->node, where);
    fflush(stdout);
}

static void say_injected(const char *name, uint32_t count)
{
    if (count > 0) {
        printf("injected %s: %lu\n", name, (unsigned long)count);
    }
}

static void add_injected(const struct driving *self, cJSON *io_object)
{
    cJSON *added = cJSON_AddObjectToObject(io_object, "injected");
    for (int kind = 0; kind < inproc_fault_kinds; kind++) {
        if (self->harm.injected[kind] > 0) {
            cJSON_AddNumberToObject(added, fault_list_frame_name((enum inproc_fault_kind)kind),
                                    self->harm.injected[kind]);
        }
    }
    for (int kind = 0; kind < simulated_fault_kinds; kind++) {
        if (self->drive.injected[kind] > 0) {
            cJSON_AddNumberToObject(added, fault_list_drive_name((enum simulated_fault_kind)kind),
                                    self->drive.injected[kind]);
        }
    }
}

static int say_end(const struct driving *self, const struct command_context *context, struct error *out_error)
{
    const struct can_bus_statistics bus = can_bus_read_statistics(&self->bus);
    const struct canopen_node *node = &self->drive.node;
    if (context->json) {
        cJSON *object = cJSON_CreateObject();
        cJSON_AddNumberToObject(object, "frames_received", bus.received);
        cJSON_AddNumberToObject(object, "frames_sent", bus.sent);
        cJSON_AddNumberToObject(object, "frames_unsent", bus.unsent);
        cJSON_AddNumberToObject(object, "frames_lost", bus.overflowed);
        cJSON_AddNumberToObject(object, "error_frames", bus.error_frames);
        cJSON_AddNumberToObject(object, "samples", self->drive.samples);
        cJSON_AddNumberToObject(object, "syncs_missed", node->sync.missed);
        cJSON_AddNumberToObject(object, "targets_lost", node->errors.targets_lost + node->errors.targets_rejected);
        cJSON_AddStringToObject(object, "state", cia402_state_str(self->drive.machine.state));
        cJSON_AddNumberToObject(object, "error_code", self->drive.objects.error_code);
        add_injected(self, object);
        int status = json_print_stdout(object, out_error);
        cJSON_Delete(object);
        return status;
    }
    if (context->quiet) {
        return 0;
    }
    printf("%lu frames received, %lu sent, %lu not sent, %lu lost for want of room; %lu samples, %lu SYNCs missed, "
           "%lu without a usable set-point\n",
           (unsigned long)bus.received, (unsigned long)bus.sent, (unsigned long)bus.unsent,
           (unsigned long)bus.overflowed, (unsigned long)self->drive.samples, (unsigned long)node->sync.missed,
           (unsigned long)(node->errors.targets_lost + node->errors.targets_rejected));
    for (int kind = 0; kind < inproc_fault_kinds; kind++) {
        say_injected(fault_list_frame_name((enum inproc_fault_kind)kind), self->harm.injected[kind]);
    }
    for (int kind = 0; kind < simulated_fault_kinds; kind++) {
        say_injected(fault_list_drive_name((enum simulated_fault_kind)kind), self->drive.injected[kind]);
    }
    if (bus.turned_away > 0) {
        printf("%lu clients turned away: one at a time\n", (unsigned long)bus.turned_away);
    }
    printf("ended in state %s, error code %04X (%s)\n", cia402_state_str(self->drive.machine.state),
           self->drive.objects.error_code, emcy_code_str(self->drive.objects.error_code));
    return 0;
}

static int run_drive(struct driving *self, const struct driving_request *request, const char *name,
                     const struct sim_model *model, const struct command_context *context, struct error *out_error)
{
    struct interrupt signals;
    const struct can_port bus = can_bus_port(&self->bus);
    fault_port_init(&self->harm, &bus, self->faults.frames, self->faults.frame_count);
    const struct can_port port = self->faults.frame_count > 0 ? fault_port_port(&self->harm) : bus;
    simulated_drive_init(&self->drive, model, (uint8_t)request->node, &port);
    self->drive.period_tolerance = request->period_tolerance > 0.0 ? request->period_tolerance : INFINITY;
    simulated_drive_set_delays(&self->drive, (uint32_t)request->latch_us, (uint32_t)request->reply_us);
    simulated_drive_set_faults(&self->drive, self->faults.drive, self->faults.drive_count);
    simulated_drive_set_drift(&self->drive, request->drift_ppm);
    const struct can_participant participant = simulated_drive_participant(&self->drive);
    interrupt_catch(&signals, false);
    real_time_enter(&self->rights);
    driving_say_start(&self->bus, request, name, context);
    enum can_status ended = driving_serve(&port, &participant, request->for_s);
    real_time_leave(&self->rights);
    can_bus_close(&self->bus); // also where nobody reads what is said now
    interrupt_release(&signals);
    int status = say_end(self, context, out_error);
    if (!status && ended == can_err_gone) {
        status = error_set(out_error, error_refused, "--can: %s is gone", name);
    }
    return status;
}

int driving_can(const struct driving_request *request, const char *name, struct sim_model *model,
                const struct command_context *context, struct error *out_error)
{
    struct driving *self = calloc(1, sizeof *self);
    if (!self) {
        return error_set(out_error, error_refused, "out of memory");
    }
    const uint32_t bitrate = 1000000; // of somebody else's adapter
    int status = fault_list_read(request->faults, &self->faults, model, out_error);
    status = status
                 ? status
                 : can_bus_open(&self->bus, name, "--can", can_bus_drive, (uint8_t)request->node, bitrate, out_error);
    if (!status) {
        status = run_drive(self, request, name, model, context, out_error);
        can_bus_close(&self->bus);
    }
    free(self);
    return status;
}
