/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/driving_modbus.h"

#include "drivers/modbus/host.h"
#include "lab/record/json_out.h"
#include "ports/modbus_server.h"
#include "ports/place.h"
#include "ports/wall_clock.h"
#include "sim/node/modbus_drive.h"
#include "tools/servoscope/interrupt.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/// A pause of the machine longer than this is not caught up with: the drive's time stands still meanwhile.
static const double longest_catch_up_s = 0.5;
static const double shortest_wait_s = 0.001;

/// The drive's samples up to now; what is left over waits for the next call.
static void step_until(struct modbus_drive *drive, double now, double *io_sampled_s)
{
    if (now - *io_sampled_s > longest_catch_up_s) {
        *io_sampled_s = now - longest_catch_up_s;
    }
    double period_s = 1.0 / modbus_drive_rate_hz(drive);
    while (now - *io_sampled_s >= period_s) {
        modbus_drive_step(drive);
        *io_sampled_s += period_s;
    }
}

static int open_server(const struct driving_request *request, const char *name, struct modbus_drive *drive,
                       struct modbus_server *out_server, struct error *out_error)
{
    char text[200], where[128];
    bool opened;
    long number;
    const bool tcp = strncmp(name, "tcp:", 4) == 0, rtu = strncmp(name, "rtu:", 4) == 0;
    if ((!tcp && !rtu) || !place_split(name + 4, where, sizeof where, &number) || (tcp && number > 65535)) {
        return error_set(out_error, error_usage,
                         "--modbus: '%s': expected tcp:HOST:PORT or rtu:DEVICE:BAUD, port 0..65535", name);
    }
    if (tcp) {
        opened = modbus_server_open_tcp(out_server, &drive->map, name + 4, text, sizeof text);
    } else {
        opened = modbus_server_open_rtu(out_server, &drive->map, name + 4, (uint8_t)request->node, text, sizeof text);
    }
    return opened ? 0 : error_set(out_error, error_refused, "--modbus: %s", text);
}

static void say(const struct modbus_server *server, const char *kind, const struct command_context *context)
{
    if (context->json) {
        printf("{\"modbus\": \"%s:%s\"}\n", kind, server->place);
    } else if (!context->quiet) {
        printf("simulated drive on Modbus %s, Ctrl-C ends it\n", server->place);
    }
    fflush(stdout);
}

static int serve(const struct driving_request *request, struct modbus_drive *drive, struct modbus_server *server,
                 struct error *out_error)
{
    struct interrupt signals;
    double started_s = wall_clock_now_s(), sampled_s = started_s;
    bool there = true;
    interrupt_catch(&signals, false);
    while (there && !*interrupt_flag() && !(request->for_s > 0.0 && wall_clock_now_s() - started_s >= request->for_s)) {
        step_until(drive, wall_clock_now_s(), &sampled_s);
        there = modbus_server_run(server, shortest_wait_s);
    }
    interrupt_release(&signals);
    return there ? 0 : error_set(out_error, error_refused, "--modbus: %s: the line is gone", server->place);
}

int driving_modbus(const struct driving_request *request, const char *name, struct sim_model *model,
                   const struct command_context *context, struct error *out_error)
{
    if (request->faults) {
        return error_set(out_error, error_usage, "--faults: '%s': faults are those of a CAN bus, expected --can",
                         request->faults);
    }
    if (request->latch_us > 0.0 || request->reply_us > 0.0 || request->drift_ppm != 0.0 ||
        request->period_tolerance > 0.0) {
        return error_set(out_error, error_usage,
                         "--modbus: --latch-delay, --reply-delay, --clock-drift and --period-tolerance are those of a "
                         "drive on CAN, expected --can");
    }
    struct modbus_drive *drive = malloc(sizeof *drive);
    if (!drive || modbus_drive_init(drive, model) != core_ok) {
        free(drive);
        return error_set(out_error, error_refused, "memory is short");
    }
    struct modbus_server server;
    int status = open_server(request, name, drive, &server, out_error);
    if (!status) {
        say(&server, strncmp(name, "tcp:", 4) == 0 ? "tcp" : "rtu", context);
        status = serve(request, drive, &server, out_error);
        modbus_server_close(&server);
    }
    free(drive);
    return status;
}
