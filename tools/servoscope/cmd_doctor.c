/* SPDX-License-Identifier: MIT */
/// servoscope doctor: what this machine has, and how to get what is missing.
#include "lab/record/json_out.h"
#include "tools/servoscope/command.h"
#include "tools/servoscope/machine.h"
#include "tools/servoscope/options.h"

#include <stdio.h>

static cJSON *as_json(const struct machine_check *checks, size_t count)
{
    cJSON *object = cJSON_CreateObject();
    cJSON *list = cJSON_AddArrayToObject(object, "checks");
    for (size_t i = 0; i < count; i++) {
        cJSON *item = cJSON_CreateObject();
        cJSON_AddStringToObject(item, "id", checks[i].id);
        cJSON_AddStringToObject(item, "state", machine_state_str(checks[i].state));
        cJSON_AddStringToObject(item, "says", checks[i].says);
        if (checks[i].remedy[0]) {
            cJSON_AddStringToObject(item, "remedy", checks[i].remedy);
        }
        cJSON_AddItemToArray(list, item);
    }
    return object;
}

static void print(const struct machine_check *checks, size_t count)
{
    static const char *const marks[] = {"ok", "limited", "missing"};
    for (size_t i = 0; i < count; i++) {
        printf("%-8s %-20s %s\n", marks[checks[i].state], checks[i].what, checks[i].says);
        if (checks[i].remedy[0]) {
            printf("%29s-> %s\n", "", checks[i].remedy);
        }
    }
}

static int run(int argc, char **argv, const struct command_context *context, struct error *out_error)
{
    struct machine_check checks[machine_checks_max];
    int status = options_parse(argc, argv, NULL, 0, NULL, out_error);
    if (status) {
        return status;
    }
    const size_t count = machine_check_all(checks);
    if (context->json) {
        cJSON *object = as_json(checks, count);
        status = json_print_stdout(object, out_error);
        cJSON_Delete(object);
        return status;
    }
    if (!context->quiet) {
        print(checks, count);
    }
    return 0;
}

const struct command command_cmd_doctor = {
    .name = "doctor",
    .summary = "what this machine has (CAN, real-time rights, libraries), and how to get the rest",
    .help =
        "servoscope doctor: what this machine has for a measurement, and how to get what is missing\n"
        "\n"
        "usage: servoscope doctor\n"
        "\n"
        "Looks for CAN in the kernel and its interfaces, serial ports, real-time rights and the libraries that are\n"
        "optional, and watches for 0.4 s how late a cycle of 1 ms begins. Changes nothing and sends nothing. What is\n"
        "missing is needed only for what its line names: design, simulate, frf and diagnose need none of it. The\n"
        "exit status is 0 whatever is found.\n"
        "\n"
        "example:\n"
        "  servoscope doctor --json\n",
    .run = run,
};
