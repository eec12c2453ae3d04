/* SPDX-License-Identifier: MIT */
/// Frames per second of processor time that the CAN half of the house can handle on the in-process bus: master, node
/// and bus together in a measurement's cycle, then the node alone (frames handed to it, answers thrown away).
/// usage: can_throughput [SECONDS]     virtual seconds of each, 20 if not said
#include "drivers/can/cia402_master.h"
#include "drivers/can/odrive_master.h"
#include "ports/inproc.h"
#include "sim/node/odrive_node.h"
#include "sim/node/simulated_drive.h"

#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static const double rate_hz = 1000.0;

static double cpu_s(void)
{
    return (double)clock() / CLOCKS_PER_SEC;
}

static void say(const char *what, double frames, double cpu)
{
    printf("%-44s %9.0f frames, %6.3f s of processor, %9.0f frames/s, %6.3f us a frame\n", what, frames, cpu,
           frames / cpu, cpu / frames * 1e6);
}

static bool run_door(const struct drive *drive, enum drive_mode mode, unsigned cycles, const struct inproc_bus *bus,
                     const char *what)
{
    const struct drive_configuration configuration = {.mode = mode, .sample_rate_hz = rate_hz, .torque_limit_Nm = 2.0};
    enum drive_status status = drive->operations->open(drive->self, &configuration);
    status = status == drive_ok ? drive->operations->arm(drive->self) : status;
    uint32_t frames = bus->counters.frames;
    double start_s = cpu_s();
    for (unsigned n = 0; n < cycles && status == drive_ok; n++) {
        struct drive_setpoint setpoint = {.torque_Nm = n % 2 ? 0.05 : -0.05};
        struct drive_sample sample;
        status = drive->operations->exchange(drive->self, &setpoint, &sample);
    }
    double spent_s = cpu_s() - start_s;
    if (status != drive_ok) {
        fprintf(stderr, "can_throughput: %s: %s\n", what, drive->operations->detail(drive->self));
        return false;
    }
    say(what, bus->counters.frames - frames, spent_s);
    drive->operations->stop(drive->self);
    drive->operations->close(drive->self);
    return true;
}

static struct inproc_bus bus;

static bool run_cia402(const struct sim_model *model, enum drive_mode mode, unsigned cycles, const char *what)
{
    static struct simulated_drive node;
    static struct cia402_master master;
    struct can_port master_port, node_port;
    const struct cia402_master_options options = cia402_master_defaults();
    inproc_bus_init(&bus, 1000000, inproc_stuffing_worst);
    inproc_bus_add_port(&bus, &master_port);
    int endpoint = inproc_bus_add_participant(&bus, &node_port);
    simulated_drive_init(&node, model, options.node_id, &node_port);
    const struct can_participant participant = simulated_drive_participant(&node);
    inproc_bus_bind(&bus, endpoint, &participant);
    cia402_master_init(&master, &master_port, &options);
    struct drive drive = cia402_master_drive(&master);
    return run_door(&drive, mode, cycles, &bus, what);
}

static bool run_odrive(const struct sim_model *model, unsigned cycles)
{
    static struct odrive_node node;
    static struct odrive_master master;
    struct can_port master_port, node_port;
    const struct odrive_master_options options = odrive_master_defaults();
    const struct odrive_node_options node_options = odrive_node_defaults();
    inproc_bus_init(&bus, 1000000, inproc_stuffing_worst);
    inproc_bus_add_port(&bus, &master_port);
    int endpoint = inproc_bus_add_participant(&bus, &node_port);
    odrive_node_init(&node, model, &node_options, &node_port);
    const struct can_participant participant = odrive_node_participant(&node);
    inproc_bus_bind(&bus, endpoint, &participant);
    odrive_master_init(&master, &master_port, &options);
    struct drive drive = odrive_master_drive(&master);
    return run_door(&drive, drive_mode_torque, cycles, &bus, "ODrive CAN Simple, torque mode");
}

static uint32_t answers;

static enum can_status count_answer(void *self, const struct can_frame *frame)
{
    (void)self, (void)frame;
    answers++;
    return can_ok;
}

/// SDO uploads of one object, one after the other: the dictionary's search is in it.
static void run_uploads(const struct sim_model *model, unsigned count)
{
    static const struct can_port_operations operations = {count_answer, NULL, NULL, NULL};
    static const struct can_port port = {&operations, NULL};
    static struct simulated_drive node;
    simulated_drive_init(&node, model, 5, &port);
    const struct can_participant participant = simulated_drive_participant(&node);
    struct can_frame request = can_frame_make(0x605, 8);
    request.data[0] = 0x40;
    can_put(&request.data[1], 2, cia402_position_actual);
    participant.advance(participant.self, 0);
    answers = 0;
    double start_s = cpu_s();
    for (unsigned n = 0; n < count; n++)
        participant.receive(participant.self, &request, n);
    say("node alone, SDO uploads and their answers", (double)count + answers, cpu_s() - start_s);
}

int main(int argc, char **argv)
{
    double seconds = argc > 1 ? strtod(argv[1], NULL) : 20.0;
    if (!(seconds > 0.0 && seconds <= 1e5)) {
        fprintf(stderr, "usage: can_throughput [SECONDS]\n");
        return 2;
    }
    unsigned cycles = (unsigned)(seconds * rate_hz);
    struct sim_model model;
    sim_model_default(&model);
    bool ok = run_cia402(&model, drive_mode_torque, cycles, "CiA 402, torque mode: master, node, bus, plant") &&
              run_cia402(&model, drive_mode_cascade, cycles, "CiA 402, cascade: master, node, bus, plant") &&
              run_odrive(&model, cycles);
    run_uploads(&model, 20 * cycles);
    return ok ? EXIT_SUCCESS : EXIT_FAILURE;
}
