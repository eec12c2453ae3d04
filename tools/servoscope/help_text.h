/* SPDX-License-Identifier: MIT */
/// The text of --help as data: manual pages and completions come from it, so that there is one source of what a
/// subcommand takes. Its form: "servoscope NAME: summary", "usage: ...", paragraphs, and options as lines of two blanks
/// and two minus signs, their values in capitals, two blanks or more before what they do.
#ifndef SERVOSCOPE_TOOLS_HELP_TEXT_H
#define SERVOSCOPE_TOOLS_HELP_TEXT_H

#include "tools/servoscope/command.h"

#include <stddef.h>

enum { help_options_max = 96, help_name_max = 40, help_value_max = 64 };

struct help_option {
    char name[help_name_max];   ///< without the two minus signs
    char value[help_value_max]; ///< what follows it, "HZ" or "FILE.html"; a fixed choice as it is typed; empty: a flag
};

struct help_line {
    const char *text; ///< not terminated
    size_t length;
};

/// Takes the next line of a help text, `more_help` behind `help`; false at the end. *io_at begins with NULL.
bool help_text_next(const struct command *command, const char **io_at, struct help_line *out_line);

/// All options of a subcommand, those that main takes for each of them last. Returns how many.
size_t help_text_all_options(const struct command *command, struct help_option out_options[help_options_max]);

#endif
