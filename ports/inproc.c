/* SPDX-License-Identifier: MIT */
#include "ports/inproc.h"

#include <string.h>

enum { intermission_bits = 3, error_frame_bits = 20, us_ns = 1000 };

void inproc_bus_init(struct inproc_bus *self, uint32_t bitrate, enum inproc_stuffing stuffing)
{
    memset(self, 0, sizeof *self);
    self->bitrate = bitrate;
    self->stuffing = stuffing;
}

void inproc_bus_set_faults(struct inproc_bus *self, const struct inproc_fault *faults, size_t count)
{
    self->faults = faults;
    self->fault_count = count;
}

static uint64_t bits_ns(const struct inproc_bus *self, unsigned bits)
{
    return (uint64_t)bits * 1000000000u / self->bitrate;
}

static unsigned frame_bits(const struct inproc_bus *self, const struct can_frame *frame)
{
    if (self->stuffing == inproc_stuffing_exact)
        return can_frame_bits_exact(frame);
    return can_frame_bits_worst(frame->remote ? 0 : frame->length);
}

// ---- Ports

static enum can_status port_send(void *object, const struct can_frame *frame)
{
    struct inproc_endpoint *self = object;
    if (self->off)
        return can_err_bus_off;
    if (self->send_count == inproc_send_max || !can_frame_is_valid(frame))
        return can_err_full;
    self->send[self->send_count++] = *frame;
    return can_ok;
}

static bool port_receive(void *object, struct can_frame *out_frame)
{
    struct inproc_endpoint *self = object;
    if (self->receive_count == 0)
        return false;
    *out_frame = self->receive[self->receive_first];
    self->receive_first = (self->receive_first + 1) % inproc_receive_max;
    self->receive_count--;
    return true;
}

static uint64_t port_time_us(const void *object)
{
    const struct inproc_endpoint *self = object;
    return self->bus->now_ns / us_ns;
}

static void bus_run(struct inproc_bus *self, uint64_t until_ns, const struct inproc_endpoint *waiting);

static enum can_status port_wait(void *object, uint64_t until_us)
{
    struct inproc_endpoint *self = object;
    bus_run(self->bus, until_us > UINT64_MAX / us_ns ? UINT64_MAX : until_us * us_ns, self);
    return self->off ? can_err_bus_off : can_ok;
}

static const struct can_port_operations port_operations = {port_send, port_receive, port_wait, port_time_us};

int inproc_bus_add_port(struct inproc_bus *self, struct can_port *out_port)
{
    if (self->endpoint_count == inproc_endpoints_max)
        return -1;
    struct inproc_endpoint *endpoint = &self->endpoints[self->endpoint_count];
    endpoint->bus = self;
    *out_port = (struct can_port){.operations = &port_operations, .self = endpoint};
    return (int)self->endpoint_count++;
}

int inproc_bus_add_participant(struct inproc_bus *self, struct can_port *out_port)
{
    return inproc_bus_add_port(self, out_port);
}

void inproc_bus_bind(struct inproc_bus *self, int endpoint, const struct can_participant *participant)
{
    self->endpoints[endpoint].participant = *participant;
}

// ---- Arbitration

/// Oldest frame of the lowest identifier that an endpoint wants to send; its place in the queue, or -1.
static int first_choice(const struct inproc_endpoint *endpoint)
{
    int best = -1;
    for (size_t i = 0; i < endpoint->send_count; i++)
        if (best < 0 || endpoint->send[i].id < endpoint->send[best].id)
            best = (int)i;
    return best;
}

static void start_frame(struct inproc_bus *self, const struct can_frame *frame, uint8_t from)
{
    self->wire = *frame;
    self->from = from;
    self->sending = true;
    uint64_t whole_ns = bits_ns(self, frame_bits(self, frame));
    self->end_ns = self->now_ns + whole_ns - bits_ns(self, intermission_bits);
    self->idle_ns = self->now_ns + whole_ns;
    self->counters.busy_ns += whole_ns;
}

/// Starts the frame that wins the bus at this instant; false if nobody wants it.
static bool arbitrate(struct inproc_bus *self)
{
    int winner = -1, place = -1;
    unsigned wanting = 0;
    bool same = false;
    for (size_t e = 0; e < self->endpoint_count; e++) {
        struct inproc_endpoint *endpoint = &self->endpoints[e];
        int choice = first_choice(endpoint);
        if (choice < 0)
            continue;
        wanting++;
        uint16_t id = endpoint->send[choice].id;
        uint16_t best = winner < 0 ? UINT16_MAX : self->endpoints[winner].send[place].id;
        same = id < best ? false : same || id == best;
        if (id < best) {
            winner = (int)e;
            place = choice;
        }
    }
    if (winner < 0)
        return false;
    self->counters.arbitrations += wanting > 1;
    self->counters.collisions += same;
    struct inproc_endpoint *endpoint = &self->endpoints[winner];
    struct can_frame frame = endpoint->send[place];
    endpoint->send_count--;
    memmove(&endpoint->send[place], &endpoint->send[place + 1],
            (endpoint->send_count - (size_t)place) * sizeof endpoint->send[0]);
    start_frame(self, &frame, (uint8_t)winner);
    return true;
}

// ---- Delivery and faults

static void deliver_to(struct inproc_bus *self, struct inproc_endpoint *endpoint, const struct can_frame *frame)
{
    if (endpoint->participant.receive) {
        endpoint->participant.receive(endpoint->participant.self, frame, self->now_ns / us_ns);
        return;
    }
    if (endpoint->receive_count == inproc_receive_max) {
        self->counters.overruns++;
        return;
    }
    endpoint->receive[(endpoint->receive_first + endpoint->receive_count) % inproc_receive_max] = *frame;
    endpoint->receive_count++;
}

static void deliver(struct inproc_bus *self, const struct can_frame *frame, uint8_t from)
{
    for (size_t e = 0; e < self->endpoint_count; e++)
        if (e != from && !self->endpoints[e].off)
            deliver_to(self, &self->endpoints[e], frame);
}

static void deliver_late(struct inproc_bus *self, size_t index)
{
    struct inproc_late late = self->late[index];
    self->late_count--;
    memmove(&self->late[index], &self->late[index + 1], (self->late_count - index) * sizeof self->late[0]);
    deliver(self, &late.frame, late.from);
}

static void leave_bus(struct inproc_bus *self, const struct inproc_fault *fault)
{
    if (fault->endpoint >= self->endpoint_count)
        return;
    struct inproc_endpoint *endpoint = &self->endpoints[fault->endpoint];
    endpoint->off = true;
    endpoint->back_ns = fault->delay_us == 0 ? UINT64_MAX : self->now_ns + (uint64_t)fault->delay_us * us_ns;
    self->counters.discarded += (uint32_t)endpoint->send_count;
    endpoint->send_count = 0;
    self->counters.injected[inproc_bus_off]++;
}

static bool hold_back(struct inproc_bus *self, const struct can_frame *frame, const struct inproc_fault *fault)
{
    if (self->late_count == inproc_late_max)
        return false;
    self->late[self->late_count++] = (struct inproc_late){
        .frame = *frame,
        .from = self->from,
        .swapped = fault->kind == inproc_swap,
        .due_ns = fault->kind == inproc_swap ? UINT64_MAX : self->now_ns + (uint64_t)fault->delay_us * us_ns,
    };
    return true;
}

bool inproc_fault_meets(const struct inproc_fault *fault, const struct can_frame *frame, uint32_t of_all,
                        uint32_t of_id)
{
    return fault->cob_id == inproc_any ? fault->nth == of_all : fault->cob_id == frame->id && fault->nth == of_id;
}

bool inproc_fault_alter(const struct inproc_fault *fault, struct can_frame *io_frame)
{
    if (fault->kind == inproc_shorten && io_frame->length > 0) {
        io_frame->data[--io_frame->length] = 0;
        return true;
    }
    if (fault->kind == inproc_corrupt && fault->byte < io_frame->length && fault->mask != 0) {
        io_frame->data[fault->byte] ^= fault->mask;
        return true;
    }
    return false;
}

/// Lets one fault act on the frame that has just ended; true if the frame does not reach its receivers now.
static bool inject(struct inproc_bus *self, const struct inproc_fault *fault, struct can_frame *frame)
{
    bool acts = true, withheld = false;
    switch (fault->kind) {
    case inproc_drop:
        withheld = true;
        break;
    case inproc_duplicate:
        break; // sent again once this one is delivered
    case inproc_delay:
    case inproc_swap:
        withheld = acts = hold_back(self, frame, fault);
        break;
    case inproc_corrupt:
    case inproc_shorten:
        acts = inproc_fault_alter(fault, frame);
        break;
    case inproc_bus_error:
        withheld = true;
        self->idle_ns += bits_ns(self, error_frame_bits);
        self->counters.busy_ns += bits_ns(self, error_frame_bits);
        break;
    case inproc_bus_off:
        leave_bus(self, fault);
        return false;
    case inproc_fault_kinds:
        return false;
    }
    self->counters.injected[fault->kind] += acts;
    return withheld;
}

/// The frame on the wire has ended: faults, delivery, frames that waited for this one.
static void end_frame(struct inproc_bus *self)
{
    struct can_frame frame = self->wire;
    struct can_frame original = self->wire;
    uint8_t from = self->from;
    self->sending = false;
    uint32_t of_all = ++self->counters.frames;
    uint32_t of_id = ++self->seen[frame.id];
    size_t waiting_before = self->late_count;
    bool withheld = false, again = false;
    for (size_t i = 0; i < self->fault_count; i++) {
        const struct inproc_fault *fault = &self->faults[i];
        if (!inproc_fault_meets(fault, &original, of_all, of_id))
            continue;
        withheld = inject(self, fault, &frame) || withheld;
        again = again || fault->kind == inproc_duplicate || fault->kind == inproc_bus_error;
    }
    struct inproc_endpoint *sender = &self->endpoints[from];
    if (again && !sender->off && sender->send_count < inproc_send_max) {
        memmove(&sender->send[1], &sender->send[0], sender->send_count * sizeof sender->send[0]);
        sender->send[0] = original;
        sender->send_count++;
    }
    if (!withheld)
        deliver(self, &frame, from);
    for (size_t i = 0; i < waiting_before;) { // those before this frame that were to follow it
        if (self->late[i].swapped) {
            deliver_late(self, i);
            waiting_before--;
        } else {
            i++;
        }
    }
}

// ---- Time

static uint64_t earlier(uint64_t a, uint64_t b)
{
    return a < b ? a : b;
}

static uint64_t participant_ns(const struct inproc_endpoint *endpoint)
{
    if (!endpoint->participant.deadline_us)
        return UINT64_MAX;
    uint64_t deadline_us = endpoint->participant.deadline_us(endpoint->participant.self);
    return deadline_us > UINT64_MAX / us_ns ? UINT64_MAX : deadline_us * us_ns;
}

static bool anybody_wants_bus(const struct inproc_bus *self)
{
    for (size_t e = 0; e < self->endpoint_count; e++)
        if (self->endpoints[e].send_count > 0)
            return true;
    return false;
}

static uint64_t next_event_ns(const struct inproc_bus *self)
{
    uint64_t next_ns = UINT64_MAX;
    if (self->sending)
        next_ns = self->end_ns;
    else if (anybody_wants_bus(self))
        next_ns = self->idle_ns > self->now_ns ? self->idle_ns : self->now_ns;
    for (size_t i = 0; i < self->late_count; i++)
        next_ns = earlier(next_ns, self->late[i].due_ns);
    for (size_t e = 0; e < self->endpoint_count; e++) {
        next_ns = earlier(next_ns, participant_ns(&self->endpoints[e]));
        if (self->endpoints[e].off)
            next_ns = earlier(next_ns, self->endpoints[e].back_ns);
    }
    return next_ns > self->now_ns ? next_ns : self->now_ns;
}

/// Does everything that is due at this instant.
static void serve_now(struct inproc_bus *self)
{
    for (size_t e = 0; e < self->endpoint_count; e++) {
        struct inproc_endpoint *endpoint = &self->endpoints[e];
        if (endpoint->off && endpoint->back_ns <= self->now_ns) {
            endpoint->off = false;
            self->counters.recovered++;
        }
    }
    if (self->sending && self->end_ns <= self->now_ns)
        end_frame(self);
    for (size_t i = 0; i < self->late_count;) {
        if (self->late[i].due_ns <= self->now_ns)
            deliver_late(self, i);
        else
            i++;
    }
    for (size_t e = 0; e < self->endpoint_count; e++)
        if (participant_ns(&self->endpoints[e]) <= self->now_ns)
            self->endpoints[e].participant.advance(self->endpoints[e].participant.self, self->now_ns / us_ns);
    if (!self->sending && self->idle_ns <= self->now_ns)
        arbitrate(self);
}

/// Runs until `until_ns`, or until `waiting` (if any) has a frame to take.
static void bus_run(struct inproc_bus *self, uint64_t until_ns, const struct inproc_endpoint *waiting)
{
    while (!waiting || waiting->receive_count == 0) {
        uint64_t next_ns = next_event_ns(self);
        if (next_ns > until_ns || next_ns == UINT64_MAX) {
            if (until_ns > self->now_ns && until_ns != UINT64_MAX)
                self->now_ns = until_ns;
            return;
        }
        self->now_ns = next_ns;
        serve_now(self);
    }
}

void inproc_bus_run(struct inproc_bus *self, uint64_t until_us)
{
    bus_run(self, until_us * us_ns, NULL);
}

double inproc_bus_load(const struct inproc_bus *self, uint64_t since_us, uint64_t busy_ns)
{
    uint64_t span_ns = self->now_ns - since_us * us_ns;
    return span_ns == 0 ? 0.0 : (double)(self->counters.busy_ns - busy_ns) / (double)span_ns;
}
