/* SPDX-License-Identifier: MIT */
/// The options of a subcommand: one table that says what there is, one call that reads the command line by it.
/// Accepts `--name value` and `--name=value`, in any order with operands; `--` ends the options. A value may begin with
/// one minus (`--bias -0.3`), not with two. Every refusal is wrong usage (exit status 2) and names option and value.
#ifndef SERVOSCOPE_TOOLS_OPTIONS_H
#define SERVOSCOPE_TOOLS_OPTIONS_H

#include "lab/record/error.h"

#include <stdbool.h>
#include <stddef.h>

enum {
    option_values_max = 256, ///< values of one list option, or operands
};

/// Words of the command line, in order; they point into argv.
struct option_values {
    size_t count;
    const char *items[option_values_max];
};

enum option_kind {
    option_flag,     ///< target: bool; set to true, takes no value
    option_number,   ///< target: double; finite, no trailing characters
    option_positive, ///< target: double; the same and above 0
    option_integer,  ///< target: long long; decimal, no trailing characters
    option_text,     ///< target: const char *; not empty
    option_list,     ///< target: struct option_values; takes all words up to the next option, may be repeated
};

struct option {
    const char *name; ///< without the two minus
    enum option_kind kind;
    void *target; ///< left alone if the option is not given, so put the default there before
    bool required;
    double lowest;   ///< number and integer: least value; no range if lowest and highest are both 0
    double highest;  ///< number and integer: greatest value
    bool *out_given; ///< set to true if given; NULL if nobody asks
};

/// What may stand beside the options.
struct option_operands {
    const char *name; ///< for messages: "RUN.csv"
    size_t at_least;
    size_t at_most;               ///< at most option_values_max
    struct option_values *values; ///< filled in
};

/// Reads argv[1..argc-1] into the targets; argv[0] is the subcommand's name. `operands` NULL: none are taken.
/// Errors: error_usage for an unknown option, one given twice, a missing or malformed value, a value out of range, a
/// required option that is missing, too few or too many operands. Targets may be partly filled in then.
int options_parse(int argc, char **argv, const struct option *options, size_t option_count,
                  const struct option_operands *operands, struct error *out_error);

/// Reads one finite number with nothing after it, as the options do; `what` begins the message ("--lines: step").
int options_parse_number(const char *what, const char *text, double *out_value, struct error *out_error);

#endif
