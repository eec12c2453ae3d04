/* SPDX-License-Identifier: MIT */
/// servoscope simulate: the same measurement as `measure`, on a model file, without a bus.
#include "lab/record/model_file.h"
#include "sim/node/direct_drive.h"
#include "tools/servoscope/command.h"
#include "tools/servoscope/measuring.h"
#include "tools/servoscope/options.h"

#include <stdio.h>

struct arguments {
    const char *model;
    long long seed;
    bool seed_given;
    struct measuring_request measuring;
};

static int read_options(int argc, char **argv, struct arguments *out, struct error *out_error)
{
    struct option options[measuring_options_max] = {
        {.name = "model", .kind = option_text, .target = &out->model, .required = true},
        {.name = "seed",
         .kind = option_integer,
         .target = &out->seed,
         .lowest = 0,
         .highest = 9.2e18,
         .out_given = &out->seed_given},
    };
    size_t count = 2 + measuring_options(&out->measuring, options + 2);
    return options_parse(argc, argv, options, count, NULL, out_error);
}

static int simulate(const struct arguments *arguments, struct sim_model *model, const struct command_context *context,
                    struct error *out_error)
{
    struct measuring measuring;
    int status = measuring_prepare(&arguments->measuring, &measuring, out_error);
    if (status) {
        return status;
    }
    if (measuring.linear != model->linear) {
        status = error_set(out_error, error_refused, "%s is of a %s axis, %s of a %s one: expected one kind",
                           arguments->measuring.table, measuring.linear ? "linear" : "rotary", arguments->model,
                           model->linear ? "linear" : "rotary");
    } else {
        struct direct_drive simulated;
        struct drive drive = direct_drive_init(&simulated, model);
        status = measuring_run(&measuring, &drive, "simulation", context, out_error);
        drive.operations->close(drive.self);
    }
    measuring_free(&measuring);
    return status;
}

static int run(int argc, char **argv, const struct command_context *context, struct error *out_error)
{
    struct arguments arguments = {0};
    struct sim_model model;
    measuring_defaults(&arguments.measuring);
    int status = read_options(argc, argv, &arguments, out_error);
    status = status ? status : model_file_read(arguments.model, &model, out_error);
    arguments.measuring.drive_file = arguments.model;
    if (status) {
        return status;
    }
    if (arguments.seed_given) {
        model.seed = (uint64_t)arguments.seed;
    }
    return simulate(&arguments, &model, context, out_error);
}

const struct command command_cmd_simulate = {
    .name = "simulate",
    .summary = "plays a table through a model file, without a bus, into a run file",
    .help =
        "servoscope simulate: plays a table through a model file, without a bus, into a run file\n"
        "\n"
        "usage: servoscope simulate --model M.json --table T.mst --periods P [options] --out RUN.csv\n"
        "\n"
        "  --model M.json       the drive, with its effects, controllers and sensors\n"
        "  --seed N             of its noise, instead of the model's\n" MEASURING_HELP "\n"
        "The rows are those that `servoscope measure` would write; the same model, table and seed give the same file.\n"
        "\n"
        "example:\n"
        "  servoscope simulate --model drive.json --table belt.mst --periods 10 --out run.csv\n",
    .run = run,
};
