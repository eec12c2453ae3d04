/* SPDX-License-Identifier: MIT */
#include "ports/fault_port.h"

#include <string.h>

static uint64_t now_us(const struct fault_port *self)
{
    return self->base.operations->time_us(self->base.self);
}

static enum can_status pass(struct fault_port *self, const struct can_frame *frame, bool outgoing)
{
    if (outgoing) {
        return self->base.operations->send(self->base.self, frame);
    }
    if (self->ready_count == fault_port_ready_max) {
        self->undone++;
        return can_err_full;
    }
    self->ready[(self->ready_first + self->ready_count) % fault_port_ready_max] = *frame;
    self->ready_count++;
    return can_ok;
}

static void pass_late(struct fault_port *self, size_t index)
{
    const struct fault_port_late late = self->late[index];
    self->late_count--;
    memmove(&self->late[index], &self->late[index + 1], (self->late_count - index) * sizeof self->late[0]);
    pass(self, &late.frame, late.outgoing);
}

/// Ends what is over: a time off the bus, delays.
static void serve_time(struct fault_port *self)
{
    uint64_t now = now_us(self);
    self->off = self->off && now < self->back_us;
    for (size_t i = 0; i < self->late_count;) {
        if (!self->late[i].swapped && self->late[i].due_us <= now) {
            pass_late(self, i);
        } else {
            i++;
        }
    }
}

static bool hold_back(struct fault_port *self, const struct can_frame *frame, const struct inproc_fault *fault,
                      bool outgoing)
{
    if (self->late_count == fault_port_late_max) {
        self->undone++;
        return false;
    }
    self->late[self->late_count++] = (struct fault_port_late){
        .frame = *frame,
        .outgoing = outgoing,
        .swapped = fault->kind == inproc_swap,
        .due_us = now_us(self) + fault->delay_us,
    };
    return true;
}

/// Lets one fault act; true if the frame does not go on now.
static bool inject(struct fault_port *self, const struct inproc_fault *fault, struct can_frame *frame, bool outgoing,
                   bool *io_twice)
{
    bool acts = true, withheld = false;
    switch (fault->kind) {
    case inproc_drop:
        withheld = true;
        break;
    case inproc_duplicate:
        *io_twice = true;
        break;
    case inproc_delay:
    case inproc_swap:
        withheld = acts = hold_back(self, frame, fault, outgoing);
        break;
    case inproc_corrupt:
    case inproc_shorten:
        acts = inproc_fault_alter(fault, frame);
        break;
    case inproc_bus_off: // with this frame's end
        self->off = true;
        self->back_us = fault->delay_us == 0 ? CAN_NEVER_US : now_us(self) + fault->delay_us;
        break;
    case inproc_bus_error:
    case inproc_fault_kinds:
        acts = false;
    }
    self->injected[fault->kind] += acts;
    return withheld;
}

/// One frame on its way, through the plan.
static enum can_status process(struct fault_port *self, const struct can_frame *original, bool outgoing)
{
    struct can_frame frame = *original;
    enum can_status status = can_ok;
    bool withheld = false, twice = false;
    const uint32_t of_all = ++self->frames, of_id = ++self->seen[frame.id];
    size_t waiting_before = self->late_count;
    for (size_t i = 0; i < self->fault_count; i++) {
        const struct inproc_fault *fault = &self->faults[i];
        if (inproc_fault_meets(fault, original, of_all, of_id)) {
            withheld = inject(self, fault, &frame, outgoing, &twice) || withheld;
        }
    }
    for (int i = 0; i < (withheld ? 0 : twice ? 2 : 1); i++) {
        status = pass(self, &frame, outgoing);
    }
    for (size_t i = 0; i < waiting_before;) {
        if (self->late[i].swapped && self->late[i].outgoing == outgoing) {
            pass_late(self, i);
            waiting_before--;
        } else {
            i++;
        }
    }
    return status;
}

// ---- Port

static enum can_status port_send(void *object, const struct can_frame *frame)
{
    struct fault_port *self = object;
    serve_time(self);
    if (!can_frame_is_valid(frame)) {
        return can_err_full;
    }
    return self->off ? can_err_bus_off : process(self, frame, true);
}

static bool port_receive(void *object, struct can_frame *out_frame)
{
    struct fault_port *self = object;
    struct can_frame frame;
    serve_time(self);
    while (self->ready_count == 0 && self->base.operations->receive(self->base.self, &frame)) {
        if (!self->off) {
            process(self, &frame, false);
        }
    }
    if (self->ready_count == 0) {
        return false;
    }
    *out_frame = self->ready[self->ready_first];
    self->ready_first = (self->ready_first + 1) % fault_port_ready_max;
    self->ready_count--;
    return true;
}

/// Earliest time at which something here is over.
static uint64_t next_us(const struct fault_port *self)
{
    uint64_t next = self->off ? self->back_us : CAN_NEVER_US;
    for (size_t i = 0; i < self->late_count; i++) {
        if (!self->late[i].swapped && self->late[i].due_us < next) {
            next = self->late[i].due_us;
        }
    }
    return next;
}

static enum can_status port_wait(void *object, uint64_t until_us)
{
    struct fault_port *self = object;
    uint64_t next = next_us(self);
    serve_time(self);
    if (self->ready_count > 0) {
        return can_ok;
    }
    enum can_status status = self->base.operations->wait(self->base.self, next < until_us ? next : until_us);
    serve_time(self);
    return status == can_ok && self->off ? can_err_bus_off : status;
}

static uint64_t port_time_us(const void *object)
{
    return now_us(object);
}

static const struct can_port_operations operations = {port_send, port_receive, port_wait, port_time_us};

bool fault_port_init(struct fault_port *self, const struct can_port *base, const struct inproc_fault *faults,
                     size_t count)
{
    memset(self, 0, sizeof *self);
    self->base = *base;
    self->faults = faults;
    self->fault_count = count;
    for (size_t i = 0; i < count; i++) {
        if (faults[i].kind == inproc_bus_error || faults[i].kind >= inproc_fault_kinds) {
            return false;
        }
    }
    return true;
}

struct can_port fault_port_port(struct fault_port *self)
{
    return (struct can_port){.operations = &operations, .self = self};
}
