/* SPDX-License-Identifier: MIT */
/// servoscope drive: the simulated drive of a model file, in real time on a bus that others reach.
#include "lab/record/json_out.h"
#include "lab/record/model_file.h"
#include "tools/servoscope/command.h"
#include "tools/servoscope/driving_can.h"
#include "tools/servoscope/driving_modbus.h"
#include "tools/servoscope/interrupt.h"
#include "tools/servoscope/options.h"

#include <stdio.h>
#include <string.h>

struct arguments {
    const char *model;
    struct driving_request driving;
};

/// A bus that the drive can be served on: an option that names it and who serves it.
struct scheme {
    const char *option;
    int (*serve)(const struct driving_request *request, const char *name, struct sim_model *model,
                 const struct command_context *context, struct error *out_error);
};

static const struct scheme schemes[] = {
    {"can", driving_can},
    {"odrive", driving_odrive},
    {"modbus", driving_modbus},
};

enum { scheme_count = sizeof schemes / sizeof schemes[0], own_options = 8 };

static int read_options(int argc, char **argv, struct arguments *out, const char *names[scheme_count],
                        struct error *out_error)
{
    const struct option own[own_options] = {
        {.name = "model", .kind = option_text, .target = &out->model, .required = true},
        {.name = "node", .kind = option_integer, .target = &out->driving.node, .lowest = 1, .highest = 127},
        {.name = "for", .kind = option_positive, .target = &out->driving.for_s},
        {.name = "faults", .kind = option_text, .target = &out->driving.faults},
        {.name = "period-tolerance", .kind = option_positive, .target = &out->driving.period_tolerance},
        {.name = "latch-delay", .kind = option_number, .target = &out->driving.latch_us, .highest = 1e6},
        {.name = "reply-delay", .kind = option_number, .target = &out->driving.reply_us, .highest = 1e6},
        {.name = "clock-drift",
         .kind = option_number,
         .target = &out->driving.drift_ppm,
         .lowest = -900000,
         .highest = 900000},
    };
    struct option options[own_options + scheme_count];
    memcpy(options, own, sizeof own);
    for (size_t i = 0; i < scheme_count; i++) {
        options[own_options + i] = (struct option){.name = schemes[i].option, .kind = option_text, .target = &names[i]};
    }
    return options_parse(argc, argv, options, own_options + scheme_count, NULL, out_error);
}

/// The one scheme that was asked for.
static const struct scheme *choose(const char *const names[scheme_count], const char **out_name,
                                   struct error *out_error)
{
    const struct scheme *chosen = NULL;
    for (size_t i = 0; i < scheme_count; i++) {
        if (names[i] && chosen) {
            error_set(out_error, error_usage, "--%s and --%s: expected one of them", chosen->option, schemes[i].option);
            return NULL;
        }
        if (names[i]) {
            chosen = &schemes[i];
            *out_name = names[i];
        }
    }
    if (!chosen) {
        error_set(out_error, error_usage, "--can, --modbus or --odrive is missing: which bus the drive is on");
    }
    return chosen;
}

static int run(int argc, char **argv, const struct command_context *context, struct error *out_error)
{
    struct arguments arguments = {.driving = {.node = 5}};
    struct sim_model model;
    const char *names[scheme_count] = {NULL}, *name = NULL;
    int status = read_options(argc, argv, &arguments, names, out_error);
    if (status) {
        return status;
    }
    const struct scheme *scheme = choose(names, &name, out_error);
    if (!scheme) {
        return out_error->status;
    }
    status = model_file_read(arguments.model, &model, out_error);
    if (status) {
        return status;
    }
    char text[200];
    const char *wrong = sim_model_check(&model, text, sizeof text);
    if (wrong) {
        return error_set(out_error, error_refused, "%s: %s", arguments.model, wrong);
    }
    return scheme->serve(&arguments.driving, name, &model, context, out_error);
}

const struct command command_cmd_drive = {
    .name = "drive",
    .summary = "serves the simulated drive of a model file in real time on a bus",
    .help =
        "servoscope drive: serves the simulated drive of a model file in real time on a bus\n"
        "\n"
        "usage: servoscope drive --model M.json --can BUS|--modbus PLACE [options]\n"
        "\n"
        "  --model M.json       the drive, extended models too\n"
        "  --can BUS            where it is a CiA 402 node:\n"
        "                       IFACE             a CAN interface of this machine (can0, vcan0)\n"
        "                       slcan:HOST:PORT   slcan over TCP: listens there for one client at a time, on this\n"
        "                                         machine alone unless HOST says otherwise; port 0: a free one\n"
        "                       slcan:/PATH       slcan over a pty; PATH becomes a link to it\n"
        "                       slcan-connect:HOST:PORT, slcan-connect:/PATH   behind somebody else's adapter\n"
        "  --modbus tcp:HOST:PORT      a Modbus drive that plays the table and measures by itself (docs/modbus.md);\n"
        "                       HOST left out: this machine alone; port 0: a free one, said on standard output\n"
        "  --modbus rtu:DEVICE:BAUD    the same on a serial line, as slave number N\n"
        "  --odrive BUS         an ODrive on its own clock (CAN Simple); buses as for --can\n"
        "  --node N             its number, 1..127 (default 5)\n"
        "  --for SECONDS        ends by itself (default: Ctrl-C ends it)\n"
        "  --latch-delay US     from SYNC to the sample (default 0)\n"
        "  --reply-delay US     from the sample to the answer (default 0)\n"
        "  --clock-drift PPM    by how much the drive's own clock is fast (time-outs, heartbeats)\n"
        "  --period-tolerance R  looks whether SYNC comes at the period in 60C2, within this share: 0.25\n"
        "                       (default: does not look, a machine without real-time rights keeps no period)\n"
        "  --faults LIST        makes things go wrong, separated by commas (docs/bus.md): frames, counted for each\n"
        "                       COB-ID: drop:285:100[:COUNT] duplicate:285:100 swap:185:100 shorten:185:100\n"
        "                       delay:285:100:US corrupt:185:100:BYTE:MASK bus-off:80:100:US; the drive, by SYNC:\n"
        "                       encoder-stuck:500[:COUNT] encoder-reversed encoder-dead sync-missed silent\n"
        "                       heartbeat-stops:500 reset:500; the axis: end-stop:POSITION\n"
        "\n"
        "The master's SYNC makes the samples: one SYNC, one sample of the model. A master that falls silent while\n"
        "the drive is under torque makes it ramp to standstill, take its torque off and say so (EMCY).\n"
        "\n"
        "example:\n"
        "  servoscope drive --model drive.json --can vcan0 &\n"
        "  servoscope measure --drive can:vcan0?node=5 --table belt.mst --periods 10 --out run.csv\n",
    .run = run,
};
