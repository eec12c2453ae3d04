/* SPDX-License-Identifier: MIT */
#define _GNU_SOURCE
#include "ports/socketcan.h"

#include "drivers/can/sync.h"

#include <errno.h>
#include <net/if.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/uio.h>
#include <time.h>
#include <unistd.h>

/* The kernel's frame has the name of ours. */
#define can_frame kernel_can_frame
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#undef can_frame

/// Room for the frames of a tenth of a second at 1 Mbit/s and more.
enum { receive_buffer_bytes = 1 << 20 };

static void close_socket(struct socketcan *self)
{
    if (self->socket >= 0) {
        close(self->socket);
    }
    self->socket = -1;
}

// ---- Frames

static void take_error(struct socketcan *self, const struct kernel_can_frame *frame)
{
    self->counters.error_frames++;
    if (frame->can_id & CAN_ERR_BUSOFF) {
        self->counters.bus_offs++;
        self->status = can_err_bus_off;
    }
    if (frame->can_id & CAN_ERR_RESTARTED) {
        self->counters.restarts++;
        self->status = can_ok;
    }
}

/// What came beside the frame: its time and how many were dropped before it.
static uint64_t read_control(struct socketcan *self, struct msghdr *message)
{
    uint64_t time_us = 0;
    bool stamped = false;
    for (struct cmsghdr *c = CMSG_FIRSTHDR(message); c; c = CMSG_NXTHDR(message, c)) {
        if (c->cmsg_level != SOL_SOCKET) {
            continue;
        }
        if (c->cmsg_type == SO_RXQ_OVFL) {
            memcpy(&self->counters.overflowed, CMSG_DATA(c), sizeof self->counters.overflowed);
        } else if (c->cmsg_type == SCM_TIMESTAMPNS) {
            struct timespec stamp;
            memcpy(&stamp, CMSG_DATA(c), sizeof stamp);
            time_us = wall_clock_of_stamp_us(&self->clock, self->woken_us, stamp.tv_sec, stamp.tv_nsec);
            stamped = true;
        }
    }
    return stamped ? time_us : self->woken_us;
}

static bool translate(const struct kernel_can_frame *raw, struct can_frame *out_frame)
{
    if ((raw->can_id & (CAN_EFF_FLAG | CAN_ERR_FLAG)) || raw->can_dlc > can_data_max) {
        return false;
    }
    *out_frame = can_frame_make((uint16_t)(raw->can_id & CAN_SFF_MASK), raw->can_dlc);
    out_frame->remote = (raw->can_id & CAN_RTR_FLAG) != 0;
    if (!out_frame->remote) {
        memcpy(out_frame->data, raw->data, raw->can_dlc);
    }
    return true;
}

/// Room for one call to the kernel: frames, and what comes beside each.
struct batch {
    struct kernel_can_frame frames[socketcan_batch_max];
    _Alignas(struct cmsghdr) char controls[socketcan_batch_max]
                                          [CMSG_SPACE(sizeof(struct timespec)) + CMSG_SPACE(sizeof(uint32_t))];
    struct iovec parts[socketcan_batch_max];
    struct mmsghdr messages[socketcan_batch_max];
};

/// Sorts one message of a batch: into the frames that wait, or away.
static void take_message(struct socketcan *self, struct batch *batch, int i)
{
    struct msghdr *message = &batch->messages[i].msg_hdr;
    const struct kernel_can_frame *raw = &batch->frames[i];
    struct can_frame frame;
    if (batch->messages[i].msg_len != sizeof *raw) {
        return;
    }
    uint64_t time_us = read_control(self, message);
    if (raw->can_id & CAN_ERR_FLAG) {
        take_error(self, raw);
        return;
    }
    if (!translate(raw, &frame)) {
        return;
    }
    bus_watch_frame(&self->watch, &frame, time_us);
    if (!(message->msg_flags & MSG_CONFIRM)) { // else it is our own
        self->counters.received++;
        self->waiting[self->waiting_count++] = frame;
    }
}

/// Fetches what there is, a batch at most; false if there was nothing.
static bool fetch(struct socketcan *self)
{
    struct batch batch;
    for (int i = 0; i < socketcan_batch_max; i++) {
        batch.parts[i] = (struct iovec){&batch.frames[i], sizeof batch.frames[i]};
        batch.messages[i].msg_hdr = (struct msghdr){.msg_iov = &batch.parts[i],
                                                    .msg_iovlen = 1,
                                                    .msg_control = batch.controls[i],
                                                    .msg_controllen = sizeof batch.controls[i]};
    }
    int count = recvmmsg(self->socket, batch.messages, socketcan_batch_max, MSG_DONTWAIT, NULL);
    if (count < 0) {
        if (errno == ENETDOWN || errno == ENODEV || errno == ENXIO || errno == EBADF) {
            self->status = can_err_gone;
        }
        return false;
    }
    self->waiting_first = self->waiting_count = 0;
    for (int i = 0; i < count; i++) {
        take_message(self, &batch, i);
    }
    self->drained = count < socketcan_batch_max;
    return count > 0;
}

static bool port_receive(void *object, struct can_frame *out_frame)
{
    struct socketcan *self = object;
    // What comes after a short batch wakes the next wait: asking again now costs as much as a frame.
    while (self->waiting_first == self->waiting_count) {
        if (self->drained || !fetch(self)) {
            self->drained = false;
            return false;
        }
    }
    *out_frame = self->waiting[self->waiting_first++];
    return true;
}

static enum can_status port_send(void *object, const struct can_frame *frame)
{
    struct socketcan *self = object;
    struct kernel_can_frame raw;
    memset(&raw, 0, sizeof raw);
    if (!can_frame_is_valid(frame)) {
        return can_err_full;
    }
    raw.can_id = frame->id | (frame->remote ? CAN_RTR_FLAG : 0u);
    raw.can_dlc = frame->length;
    memcpy(raw.data, frame->data, frame->length);
    if (self->status == can_ok && send(self->socket, &raw, sizeof raw, MSG_DONTWAIT) == (ssize_t)sizeof raw) {
        self->counters.sent++;
        return can_ok;
    }
    self->counters.unsent++;
    if (self->status == can_ok && errno != ENOBUFS && errno != EAGAIN && errno != EINTR) {
        self->status = can_err_gone;
    }
    return self->status == can_ok ? can_err_full : self->status;
}

static enum can_status port_wait(void *object, uint64_t until_us)
{
    struct socketcan *self = object;
    self->drained = false;
    if (self->waiting_first < self->waiting_count) {
        return self->status;
    }
    struct pollfd file = {.fd = self->socket, .events = POLLIN};
    // An interface that is gone is always "readable": then only time passes.
    wall_clock_wait(&self->clock, &file, self->status == can_err_gone ? 0 : 1, until_us);
    self->woken_us = wall_clock_us(&self->clock);
    if ((file.revents & (POLLERR | POLLHUP | POLLNVAL)) && !(file.revents & POLLIN)) {
        self->status = can_err_gone;
    }
    return self->status;
}

static uint64_t port_time_us(const void *object)
{
    const struct socketcan *self = object;
    return wall_clock_us(&self->clock);
}

static const struct can_port_operations operations = {port_send, port_receive, port_wait, port_time_us};

struct can_port socketcan_port(struct socketcan *self)
{
    return (struct can_port){.operations = &operations, .self = self};
}

// ---- Open

static bool set_filters(struct socketcan *self, uint8_t node_id)
{
    // 11-bit identifiers only; of one node what it sends: EMCY, TPDOs and SDO answers have bit 7 set in CANopen, what
    // it is sent has not.
    const struct can_filter of_all[] = {{.can_id = 0, .can_mask = CAN_EFF_FLAG}};
    const struct can_filter of_node[] = {
        {.can_id = 0x080u | node_id, .can_mask = 0x080 | 0x07F | CAN_EFF_FLAG},
        {.can_id = 0x700u | node_id, .can_mask = CAN_SFF_MASK | CAN_EFF_FLAG},
        {.can_id = sync_cob_id, .can_mask = CAN_SFF_MASK | CAN_EFF_FLAG},
    };
    const can_err_mask_t errors = CAN_ERR_MASK;
    int result = node_id == 0 ? setsockopt(self->socket, SOL_CAN_RAW, CAN_RAW_FILTER, of_all, sizeof of_all)
                              : setsockopt(self->socket, SOL_CAN_RAW, CAN_RAW_FILTER, of_node, sizeof of_node);
    return result == 0 && setsockopt(self->socket, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof errors) == 0;
}

static bool set_options(struct socketcan *self, uint8_t node_id)
{
    const int on = 1, bytes = receive_buffer_bytes;
    // What the system does not allow it cuts to what it does: a smaller buffer overflows earlier, and that is counted.
    setsockopt(self->socket, SOL_SOCKET, SO_RCVBUF, &bytes, sizeof bytes);
    return set_filters(self, node_id) &&
           (node_id == 0 || setsockopt(self->socket, SOL_CAN_RAW, CAN_RAW_RECV_OWN_MSGS, &on, sizeof on) == 0) &&
           setsockopt(self->socket, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on) == 0 &&
           setsockopt(self->socket, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on) == 0;
}

static bool bind_interface(struct socketcan *self, const char *interface, char *out_reason, size_t size)
{
    struct ifreq request;
    struct sockaddr_can address;
    memset(&request, 0, sizeof request);
    memset(&address, 0, sizeof address);
    snprintf(request.ifr_name, sizeof request.ifr_name, "%s", interface);
    if (strlen(interface) >= sizeof request.ifr_name || ioctl(self->socket, SIOCGIFINDEX, &request) != 0) {
        snprintf(out_reason, size, "%s: no such network interface; 'ip link' lists them", interface);
        return false;
    }
    address.can_family = AF_CAN;
    address.can_ifindex = request.ifr_ifindex;
    if (bind(self->socket, (struct sockaddr *)&address, sizeof address) != 0) {
        snprintf(out_reason, size, "%s: %s", interface, errno == ENODEV ? "is no CAN interface" : strerror(errno));
        return false;
    }
    if (ioctl(self->socket, SIOCGIFFLAGS, &request) != 0 || !(request.ifr_flags & IFF_UP)) {
        snprintf(out_reason, size, "%s: is down; expected 'ip link set %s up type can bitrate 1000000' before",
                 interface, interface);
        return false;
    }
    return true;
}

bool socketcan_open(struct socketcan *self, const char *interface, uint8_t node_id, char *out_reason, size_t size)
{
    memset(self, 0, sizeof *self);
    wall_clock_start(&self->clock);
    self->socket = socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW);
    if (self->socket < 0) {
        snprintf(out_reason, size, "%s: this kernel has no CAN sockets (%s); 'modprobe can_raw' may bring them",
                 interface, strerror(errno));
        return false;
    }
    bool done = bind_interface(self, interface, out_reason, size);
    if (done && !set_options(self, node_id)) {
        snprintf(out_reason, size, "%s: socket options: %s", interface, strerror(errno));
        done = false;
    }
    if (!done) {
        close_socket(self);
    }
    return done;
}

void socketcan_close(struct socketcan *self)
{
    close_socket(self);
}
