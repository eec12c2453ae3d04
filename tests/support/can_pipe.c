/* SPDX-License-Identifier: MIT */
/// One end of a CAN bus whose wire is a pair of pipes, a frame a line (`185#0102`, a remote frame `185#R`), for clients
/// in other languages. Runs on wall-clock time; ends when its input ends.
///   can_pipe node           the simulated drive, node 5, with a domain 2100 of 16 KiB and a string 2101 besides
///   can_pipe master N       reads and writes objects of node N as its further input lines say, and answers with lines
///                           that start with a blank:  `? 2100 0`  ->  ` 0102..` or ` abort 06020000`,
///                           `! 2100 0 0102..`  ->  ` ok`
///   can_pipe eds            writes the simulated drive's sheet and ends
#include "drivers/can/canopen_master.h"
#include "sim/node/eds.h"
#include "sim/node/simulated_drive.h"

#include <inttypes.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum { line_max = 80000, queue_max = 1024, domain_bytes = 16384, text_bytes = 64 };

struct pipe_port {
    char line[line_max]; ///< what has come of the line under way
    size_t used;
    struct can_frame queue[queue_max];
    size_t first, count;
    bool ended;
    char request[line_max]; ///< a line that is no frame; empty: none
    struct timespec start;
};

static struct pipe_port pipe_port;

static uint64_t now_us(const void *self)
{
    const struct pipe_port *port = self;
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)((now.tv_sec - port->start.tv_sec) * 1000000 + (now.tv_nsec - port->start.tv_nsec) / 1000);
}

static enum can_status port_send(void *self, const struct can_frame *frame)
{
    (void)self;
    char text[40];
    int used = snprintf(text, sizeof text, "%03X#%s", frame->id, frame->remote ? "R" : "");
    for (unsigned i = 0; i < frame->length && !frame->remote; i++)
        used += snprintf(text + used, sizeof text - (size_t)used, "%02X", frame->data[i]);
    text[used++] = '\n';
    return write(STDOUT_FILENO, text, (size_t)used) == used ? can_ok : can_err_gone;
}

static unsigned parse_bytes(const char *text, uint8_t *out_bytes, unsigned max)
{
    unsigned count = 0, value;
    for (; count < max && sscanf(text, "%2x", &value) == 1 && text[1] != '\0'; text += 2)
        out_bytes[count++] = (uint8_t)value;
    return count;
}

static void take_line(struct pipe_port *port)
{
    unsigned id;
    if (sscanf(port->line, "%3x#", &id) == 1 && port->line[3] == '#' && port->count < queue_max) {
        struct can_frame frame = can_frame_make((uint16_t)id, 0);
        frame.remote = port->line[4] == 'R';
        frame.length = (uint8_t)parse_bytes(port->line + 4, frame.data, can_data_max);
        port->queue[(port->first + port->count++) % queue_max] = frame;
        return;
    }
    memcpy(port->request, port->line, sizeof port->request);
}

static enum can_status port_wait(void *self, uint64_t until_us)
{
    struct pipe_port *port = self;
    char bytes[4096];
    uint64_t now = now_us(port);
    if (port->count > 0 || port->request[0])
        return can_ok;
    uint64_t wait_ms = until_us > now ? (until_us - now + 999) / 1000 : 0;
    struct pollfd input = {.fd = STDIN_FILENO, .events = POLLIN};
    if (poll(&input, 1, wait_ms > 1000 ? 1000 : (int)wait_ms) <= 0)
        return can_ok;
    ssize_t got = read(STDIN_FILENO, bytes, sizeof bytes);
    port->ended = got <= 0;
    for (ssize_t i = 0; i < got; i++) {
        if (bytes[i] != '\n') {
            port->line[port->used] = bytes[i];
            port->used += port->used + 1 < line_max;
            continue;
        }
        port->line[port->used] = '\0';
        port->used = 0;
        take_line(port);
    }
    return port->ended ? can_err_gone : can_ok;
}

static bool port_receive(void *self, struct can_frame *out_frame)
{
    struct pipe_port *port = self;
    if (port->count == 0)
        return false;
    *out_frame = port->queue[port->first];
    port->first = (port->first + 1) % queue_max;
    port->count--;
    return true;
}

static const struct can_port_operations operations = {port_send, port_receive, port_wait, now_us};
static const struct can_port port = {&operations, &pipe_port};

// ---- Node

static struct simulated_drive drive;

struct extra {
    struct od_data domain, text;
    uint8_t domain_room[domain_bytes], text_room[text_bytes];
};

static struct extra extra;

#define AT(member) offsetof(struct extra, member)

static const struct od_entry extra_entries[] = {
    {0x2100, 0, od_domain, od_readable | od_writable, AT(domain), 0, NULL},
    {0x2101, 0, od_string, od_readable | od_writable, AT(text), 0, NULL},
};

static void make_drive(const struct sim_model *model)
{
    simulated_drive_init(&drive, model, 5, &port);
}

static int run_node(const struct sim_model *model)
{
    struct can_frame frame;
    make_drive(model);
    extra.domain = (struct od_data){extra.domain_room, 0, extra.domain_room, domain_bytes};
    extra.text = (struct od_data){extra.text_room, 0, extra.text_room, text_bytes};
    struct object_dictionary *dictionary = &drive.node.dictionary;
    dictionary->sections[dictionary->section_count++] =
        (struct od_section){extra_entries, sizeof extra_entries / sizeof extra_entries[0], &extra};
    struct can_participant participant = simulated_drive_participant(&drive);
    while (!pipe_port.ended) {
        port_wait(&pipe_port, participant.deadline_us(participant.self));
        while (port_receive(&pipe_port, &frame))
            participant.receive(participant.self, &frame, now_us(&pipe_port));
        if (now_us(&pipe_port) >= participant.deadline_us(participant.self))
            participant.advance(participant.self, now_us(&pipe_port));
    }
    return EXIT_SUCCESS;
}

// ---- Master

static uint8_t bytes[domain_bytes];

static void answer(uint32_t abort_code, uint32_t size, bool upload)
{
    static char text[2 * domain_bytes + 16];
    int used = snprintf(text, sizeof text, " ");
    if (abort_code != od_abort_none)
        used += snprintf(text + used, sizeof text - (size_t)used, "abort %08" PRIX32, abort_code);
    else if (!upload)
        used += snprintf(text + used, sizeof text - (size_t)used, "ok");
    for (uint32_t i = 0; i < size && upload && abort_code == od_abort_none; i++)
        used += snprintf(text + used, sizeof text - (size_t)used, "%02X", bytes[i]);
    text[used++] = '\n';
    if (write(STDOUT_FILENO, text, (size_t)used) != used)
        pipe_port.ended = true;
}

static void serve_request(struct canopen_master *master, const char *request)
{
    unsigned index, subindex;
    int data_at = 0;
    uint32_t size = 0;
    char what;
    if (sscanf(request, "%c %4x %x %n", &what, &index, &subindex, &data_at) < 3)
        return;
    if (what == '?') {
        uint32_t code =
            canopen_master_read_data(master, (uint16_t)index, (uint8_t)subindex, bytes, sizeof bytes, &size);
        answer(code, size, true);
    } else {
        size = parse_bytes(request + data_at, bytes, sizeof bytes);
        answer(canopen_master_write_data(master, (uint16_t)index, (uint8_t)subindex, bytes, size), 0, false);
    }
}

static int run_master(uint8_t node_id)
{
    static char request[line_max];
    static struct canopen_master master;
    const uint32_t sdo_timeout_us = 500000;
    canopen_master_init(&master, &port, node_id, 127, sdo_timeout_us);
    while (!pipe_port.ended) {
        canopen_master_step(&master, now_us(&pipe_port) + 100000);
        if (!pipe_port.request[0])
            continue;
        memcpy(request, pipe_port.request, sizeof request);
        pipe_port.request[0] = '\0';
        serve_request(&master, request);
    }
    return EXIT_SUCCESS;
}

int main(int argc, char **argv)
{
    struct sim_model model;
    clock_gettime(CLOCK_MONOTONIC, &pipe_port.start);
    sim_model_default(&model);
    if (argc == 2 && strcmp(argv[1], "node") == 0)
        return run_node(&model);
    if (argc == 3 && strcmp(argv[1], "master") == 0)
        return run_master((uint8_t)strtoul(argv[2], NULL, 10));
    if (argc == 2 && strcmp(argv[1], "eds") == 0) {
        make_drive(&model);
        return eds_write(stdout, &drive.node) ? EXIT_SUCCESS : EXIT_FAILURE;
    }
    fprintf(stderr, "usage: can_pipe node | master N | eds\n");
    return 2;
}
