/* SPDX-License-Identifier: MIT */
/// Master, simulated drive and bus, put together for tests.
#ifndef SERVOSCOPE_TESTS_SUPPORT_CAN_BENCH_H
#define SERVOSCOPE_TESTS_SUPPORT_CAN_BENCH_H

#include "drivers/can/cia402_master.h"
#include "ports/inproc.h"
#include "sim/node/simulated_drive.h"

#include <stddef.h>

enum { bench_master_endpoint, bench_node_endpoint };

struct can_bench {
    struct inproc_bus bus;
    struct simulated_drive node;
    struct cia402_master master;
    struct drive drive;
};

static inline void can_bench_init(struct can_bench *self, const struct sim_model *model, uint32_t bitrate)
{
    struct can_port master_port, node_port;
    struct cia402_master_options options = cia402_master_defaults();
    options.bitrate = bitrate;
    inproc_bus_init(&self->bus, bitrate, inproc_stuffing_worst);
    inproc_bus_add_port(&self->bus, &master_port);
    int node = inproc_bus_add_participant(&self->bus, &node_port);
    simulated_drive_init(&self->node, model, options.node_id, &node_port);
    struct can_participant participant = simulated_drive_participant(&self->node);
    inproc_bus_bind(&self->bus, node, &participant);
    cia402_master_init(&self->master, &master_port, &options);
    self->drive = cia402_master_drive(&self->master);
}

static inline struct drive_configuration can_bench_configuration(enum drive_mode mode)
{
    return (struct drive_configuration){.mode = mode, .sample_rate_hz = 1000.0, .torque_limit_Nm = 2.0};
}

#endif
