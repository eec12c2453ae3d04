/* SPDX-License-Identifier: MIT */
/// A CAN bus inside the program: virtual time, bit timing, arbitration by identifier, and faults injected on purpose.
/// Nothing here is random or reads a clock: the same calls give the same frames at the same nanoseconds.
/// Time moves only while a port waits (or inproc_bus_run is called). Participants are called from there; they may send,
/// but must not wait.
#ifndef SERVOSCOPE_PORTS_INPROC_H
#define SERVOSCOPE_PORTS_INPROC_H

#include "drivers/can/can_port.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum {
    inproc_endpoints_max = 8,
    inproc_send_max = 32,     ///< frames waiting to be sent, per endpoint
    inproc_receive_max = 256, ///< frames waiting to be taken, per endpoint; more are lost and counted
    inproc_late_max = 64,     ///< frames on their way late at the same time
};

enum inproc_stuffing {
    inproc_stuffing_worst, ///< every frame as long as its length allows: load figures are upper bounds
    inproc_stuffing_exact, ///< stuff bits counted in each frame
};

enum inproc_fault_kind {
    inproc_drop,      ///< on the wire, but nobody gets it
    inproc_duplicate, ///< sent once more right after, as after a disturbed end of frame
    inproc_delay,     ///< reaches the receivers delay_us later
    inproc_swap,      ///< reaches the receivers after the frame that follows it on the wire
    inproc_corrupt,   ///< data[byte] ^= mask, past CAN's own check
    inproc_shorten,   ///< data length one less
    inproc_bus_error, ///< CAN's check fails: error frame, automatic retransmission
    inproc_bus_off,   ///< with this frame's end `endpoint` leaves the bus, for delay_us (0: for good)
    inproc_fault_kinds,
};

/// Any COB-ID: `nth` counts all frames.
enum { inproc_any = 0xFFFF };

struct inproc_fault {
    enum inproc_fault_kind kind;
    uint16_t cob_id; ///< which frames are counted, or inproc_any
    uint32_t nth;    ///< the n-th of them is hit, 1 is the first
    uint32_t delay_us;
    uint8_t byte, mask; ///< a byte beyond the frame's length hits nothing and is not counted
    uint8_t endpoint;
};

/// Whether `frame` is the one a fault is meant for; it is number `of_all` of all frames and `of_id` of its identifier,
/// counted from 1.
bool inproc_fault_meets(const struct inproc_fault *fault, const struct can_frame *frame, uint32_t of_all,
                        uint32_t of_id);

/// Corrupts or shortens a frame; false if nothing changes.
bool inproc_fault_alter(const struct inproc_fault *fault, struct can_frame *io_frame);

/// What happened since the bus was made.
struct inproc_counters {
    uint32_t frames;                       ///< on the wire, retransmissions included
    uint32_t injected[inproc_fault_kinds]; ///< faults that took effect, by kind
    uint32_t recovered;                    ///< endpoints that came back after bus-off
    uint32_t overruns;                     ///< frames lost because nobody took them
    uint32_t discarded;                    ///< frames lost in the queue of an endpoint that left the bus
    uint32_t arbitrations;                 ///< times that more than one endpoint wanted the bus
    uint32_t collisions;                   ///< times that two endpoints sent the same identifier at once
    uint64_t busy_ns;                      ///< time that the bus was not idle
};

struct inproc_bus;

struct inproc_endpoint {
    struct inproc_bus *bus;
    struct can_participant participant; ///< receive is NULL for a port
    bool off;
    uint64_t back_ns; ///< when it comes back
    size_t send_count;
    struct can_frame send[inproc_send_max]; ///< oldest first
    size_t receive_first, receive_count;
    struct can_frame receive[inproc_receive_max];
};

/// A frame that will reach its receivers later: delayed (at due_ns) or swapped (after one more frame).
struct inproc_late {
    struct can_frame frame;
    uint8_t from;
    bool swapped;
    uint64_t due_ns;
};

struct inproc_bus {
    uint32_t bitrate;
    enum inproc_stuffing stuffing;
    uint64_t now_ns;
    uint64_t idle_ns; ///< when the bus is free again
    bool sending;     ///< `wire` is under way and ends at end_ns
    uint8_t from;
    uint64_t end_ns;
    struct can_frame wire;
    size_t endpoint_count;
    struct inproc_endpoint endpoints[inproc_endpoints_max];
    const struct inproc_fault *faults;
    size_t fault_count;
    size_t late_count;
    struct inproc_late late[inproc_late_max];
    uint32_t seen[can_id_max + 1]; ///< frames by identifier
    struct inproc_counters counters;
};

/// Makes an empty bus at time 0.
/// Range: bitrate 10e3 .. 8e6 bit/s (above 1e6 it is faster than any real one)
void inproc_bus_init(struct inproc_bus *self, uint32_t bitrate, enum inproc_stuffing stuffing);

/// Sets the plan of faults; it must outlive the bus. Positions count from the start of the bus.
void inproc_bus_set_faults(struct inproc_bus *self, const struct inproc_fault *faults, size_t count);

/// Adds an endpoint whose owner waits through a port; its number, or -1 if there is no room.
int inproc_bus_add_port(struct inproc_bus *self, struct can_port *out_port);

/// Adds an endpoint whose owner is called; the port that it sends through is made first. Its number, or -1.
int inproc_bus_add_participant(struct inproc_bus *self, struct can_port *out_port);

/// Says who that owner is.
void inproc_bus_bind(struct inproc_bus *self, int endpoint, const struct can_participant *participant);

/// Lets virtual time pass until `until_us`.
void inproc_bus_run(struct inproc_bus *self, uint64_t until_us);

/// Share of the time since `since_us` with `busy_ns` busy then that the bus was busy, 0..1.
double inproc_bus_load(const struct inproc_bus *self, uint64_t since_us, uint64_t busy_ns);

#endif
