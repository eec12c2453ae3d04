/* SPDX-License-Identifier: MIT */
/// servoscope manual: the texts of --help as manual pages.
#include "tools/servoscope/command.h"
#include "tools/servoscope/help_text.h"
#include "tools/servoscope/options.h"
#include "tools/servoscope/suggest.h"

#include <ctype.h>
#include <stdio.h>
#include <string.h>

#ifndef SERVOSCOPE_VERSION
#define SERVOSCOPE_VERSION "0.1.0"
#endif

/// Text of a line as roff takes it: no request by accident, minus signs that can be copied.
static void print_text(const char *text, size_t length)
{
    if (length > 0 && (text[0] == '.' || text[0] == '\'')) {
        fputs("\\&", stdout);
    }
    for (size_t i = 0; i < length; i++) {
        switch (text[i]) {
        case '\\':
            fputs("\\e", stdout);
            break;
        case '-':
            fputs("\\-", stdout);
            break;
        case '\'':
            fputs("\\(aq", stdout);
            break;
        case '^':
            fputs("\\(ha", stdout);
            break;
        case '~':
            fputs("\\(ti", stdout);
            break;
        default:
            putchar(text[i]);
        }
    }
    putchar('\n');
}

static void print_upper(const char *text)
{
    for (const char *at = text; *at; at++) {
        putchar(toupper((unsigned char)*at));
    }
}

static void print_head(const char *name, const char *summary)
{
    const bool whole = strcmp(name, "servoscope") == 0;
    fputs(".TH ", stdout);
    fputs(whole ? "" : "SERVOSCOPE\\-", stdout);
    print_upper(name);
    printf(" 1 \"\" \"servoscope %s\" \"servoscope\"\n.SH NAME\n%s%s \\- ", SERVOSCOPE_VERSION,
           whole ? "" : "servoscope\\-", name);
    print_text(summary, strlen(summary));
}

static bool begins_with(const struct help_line *line, const char *start)
{
    return line->length >= strlen(start) && memcmp(line->text, start, strlen(start)) == 0;
}

static const char synopsis[] = "SYNOPSIS", description[] = "DESCRIPTION", examples[] = "EXAMPLES";

/// The section that a line belongs to, behind one of `section`: the synopsis ends with a blank line.
static const char *section_of(const struct help_line *line, const char *section, bool after_blank)
{
    if (begins_with(line, "usage: ")) {
        return synopsis;
    }
    if (begins_with(line, "example")) {
        return examples;
    }
    return section == synopsis && after_blank && line->length > 0 ? description : section;
}

/// The page keeps the layout of the help: it is written for lines of a terminal, and its columns carry meaning.
static void print_body(const struct command *command)
{
    static const char usage[] = "usage: ", usage_again[] = "       ";
    struct help_line line;
    const char *at = NULL;
    const char *section = NULL;
    bool after_blank = false;
    help_text_next(command, &at, &line); /* "servoscope NAME: summary" */
    while (help_text_next(command, &at, &line)) {
        const char *wanted = section_of(&line, section, after_blank);
        after_blank = line.length == 0;
        if (wanted != section) {
            printf("%s.SH %s\n.nf\n", section ? ".fi\n" : "", wanted);
            section = wanted;
        }
        if (!section) {
            continue;
        }
        const bool used = begins_with(&line, usage) || (section == synopsis && begins_with(&line, usage_again));
        const size_t skip = used ? strlen(usage) : 0;
        print_text(line.text + skip, line.length - skip);
    }
    fputs(section ? ".fi\n" : "", stdout);
}

static void print_shared_sections(void)
{
    fputs(".SH OPTIONS OF ALL SUBCOMMANDS\n"
          ".TP\n.B \\-\\-json\nOne object on standard output, nothing else there.\n"
          ".TP\n.B \\-\\-quiet\nNo progress, no summary.\n"
          ".TP\n.B \\-\\-help\nThis text.\n"
          ".SH EXIT STATUS\n"
          "0: done. 1: not done (data refused, limit violated, drive fault). 2: wrong usage.\n",
          stdout);
}

static void print_command(const struct command *command)
{
    print_head(command->name, command->summary);
    print_body(command);
    print_shared_sections();
    fputs(".SH SEE ALSO\n.BR servoscope (1)\n", stdout);
}

static void print_program(void)
{
    print_head("servoscope", "how a servo drive really behaves, and what the simulation of it gets wrong");
    fputs(".SH SYNOPSIS\n.B servoscope\n.I SUBCOMMAND\n[options]\n.SH SUBCOMMANDS\n", stdout);
    for (size_t i = 0; commands[i]; i++) {
        printf(".TP\n.BR servoscope\\-%s (1)\n", commands[i]->name);
        print_text(commands[i]->summary, strlen(commands[i]->summary));
    }
    print_shared_sections();
}

static int run(int argc, char **argv, const struct command_context *context, struct error *out_error)
{
    struct option_values name = {.count = 0};
    const struct option_operands operands = {"SUBCOMMAND", 0, 1, &name};
    int status = options_parse(argc, argv, NULL, 0, &operands, out_error);
    if (status) {
        return status;
    }
    if (context->json) {
        return error_set(out_error, error_usage, "--json: a manual page is text; there is nothing to put in an object");
    }
    if (name.count == 0) {
        print_program();
        return 0;
    }
    struct suggestion suggestion;
    suggest_begin(&suggestion, name.items[0], strlen(name.items[0]));
    for (size_t i = 0; commands[i]; i++) {
        if (strcmp(commands[i]->name, name.items[0]) == 0) {
            print_command(commands[i]);
            return 0;
        }
        suggest_consider(&suggestion, commands[i]->name);
    }
    const char *meant = suggest_found(&suggestion);
    return error_set(out_error, error_usage, "'%s' is not a subcommand%s%s%s 'servoscope --help' lists them",
                     name.items[0], meant ? ": did you mean " : ";", meant ? meant : "", meant ? "?" : "");
}

const struct command command_cmd_manual = {
    .name = "manual",
    .summary = "the manual page of a subcommand, or of the program",
    .help = "servoscope manual: the manual page of a subcommand, or of the program\n"
            "\n"
            "usage: servoscope manual [SUBCOMMAND]\n"
            "\n"
            "In the form that man reads, made from the texts of --help. An installed servoscope has them in place:\n"
            "man servoscope-frf.\n"
            "\n"
            "example:\n"
            "  servoscope manual frf | man -l -\n",
    .run = run,
};
