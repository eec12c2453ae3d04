/* SPDX-License-Identifier: MIT */
/// A subcommand of the program: one file cmd_NAME.c, one object `command_cmd_NAME`. The build collects them.
#ifndef SERVOSCOPE_TOOLS_COMMAND_H
#define SERVOSCOPE_TOOLS_COMMAND_H

#include "lab/record/error.h"

#include <stdbool.h>

/// What main has already taken from the command line.
struct command_context {
    bool json;     ///< one JSON object on stdout, nothing else there
    bool quiet;    ///< no progress, no summary
    bool terminal; ///< standard error is a terminal: progress lines are welcome
};

struct command {
    const char *name;      ///< as typed
    const char *summary;   ///< one line for the list
    const char *help;      ///< whole text of --help, with an example
    const char *more_help; ///< printed after it where one literal (4095 characters in C99) is too short; NULL: none
    /// Does the work. argv[0] is the subcommand's name; --help, --json and --quiet are taken out before.
    /// Returns the exit status; on a non-zero one *out_error says why (printed by main).
    int (*run)(int argc, char **argv, const struct command_context *context, struct error *out_error);
};

/// NULL-terminated, sorted by file name, made by the build.
extern const struct command *const commands[];

#endif
