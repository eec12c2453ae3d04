/* SPDX-License-Identifier: MIT */
/// servoscope measure: plays a table through a drive and records what it does.
#include "lab/record/model_file.h"
#include "tools/servoscope/command.h"
#include "tools/servoscope/door.h"
#include "tools/servoscope/measuring.h"
#include "tools/servoscope/modbus_measuring.h"
#include "tools/servoscope/options.h"

#include <string.h>

struct arguments {
    const char *drive;
    struct measuring_request measuring;
};

static int read_options(int argc, char **argv, struct arguments *out, struct error *out_error)
{
    struct option options[measuring_options_max] = {
        {.name = "drive", .kind = option_text, .target = &out->drive, .required = true},
    };
    size_t count = 1 + measuring_options(&out->measuring, options + 1);
    int status = options_parse(argc, argv, options, count, NULL, out_error);
    if (status) {
        return status;
    }
    if (strcmp(out->measuring.mode, "torque") == 0 && !(out->measuring.limit_position_rad > 0.0)) {
        return error_set(out_error, error_usage,
                         "--limit-position is missing: in torque mode nothing else keeps the axis from running away");
    }
    return 0;
}

/// The file behind sim:FILE, or NULL.
static const char *model_path(const char *url)
{
    static const char simulator[] = "sim:";
    const char *path = url + sizeof simulator - 1;
    return strncmp(url, simulator, sizeof simulator - 1) == 0 && *path != '\0' ? path : NULL;
}

/// A simulated drive is of one kind of axis; the table has to be of the same.
static int check_axis(const struct arguments *arguments, const struct measuring *measuring, struct error *out_error)
{
    struct sim_model model;
    const char *path = model_path(arguments->drive);
    if (!path) {
        return 0;
    }
    int status = model_file_read(path, &model, out_error);
    bool linear = measuring->linear;
    if (!status && linear != model.linear) {
        status = error_set(out_error, error_refused, "%s is of a %s axis, %s of a %s one: expected one kind",
                           arguments->measuring.table, linear ? "linear" : "rotary", path,
                           model.linear ? "linear" : "rotary");
    }
    return status;
}

static int run(int argc, char **argv, const struct command_context *context, struct error *out_error)
{
    struct arguments arguments = {0};
    struct measuring measuring;
    struct door door;
    measuring_defaults(&arguments.measuring);
    int status = read_options(argc, argv, &arguments, out_error);
    if (!status && modbus_measuring_is(arguments.drive)) {
        if (arguments.measuring.report) {
            return error_set(out_error, error_usage,
                             "--report: a drive on Modbus sends its response, not the samples that the page is made "
                             "of: expected a drive on another bus");
        }
        return modbus_measuring_run(&arguments.measuring, arguments.drive, context, out_error);
    }
    arguments.measuring.drive_file = status ? NULL : model_path(arguments.drive);
    status = status ? status : measuring_prepare(&arguments.measuring, &measuring, out_error);
    if (status) {
        return status;
    }
    status = check_axis(&arguments, &measuring, out_error);
    status = status ? status : door_open(arguments.drive, NULL, &door, out_error);
    if (!status) {
        measuring.door = door_has_statistics(&door) ? &door : NULL;
        measuring.plan.lost_for_s = door.patience_s;
        status = measuring_run(&measuring, &door.drive, arguments.drive, context, out_error);
        door_close(&door);
    }
    measuring_free(&measuring);
    return status;
}

const struct command command_cmd_measure = {
    .name = "measure",
    .summary = "plays a table through a drive and records what it does",
    .help = "servoscope measure: plays a table through a drive and records what it does\n"
            "\n"
            "usage: servoscope measure --drive URL --table T.mst --periods P [options] --out RUN.csv\n"
            "\n"
            "  --drive URL          " DOOR_HELP "\n" MODBUS_MEASURING_HELP "\n" MEASURING_HELP "\n"
            "Ctrl-C, a limit, a lost bus or a fault of the drive stop it: the excitation is ramped to zero where the "
            "drive\n"
            "still listens, the drive is brought to rest, and what was measured is kept and marked (keys interrupted,\n"
            "stopped_by); the exit status is 1 then. A lost sample is marked in the column valid.\n"
            "\n"
            "example:\n"
            "  servoscope measure --drive sim:drive.json --table belt.mst --periods 10 --out run.csv\n",
    .run = run,
};
