/* SPDX-License-Identifier: MIT */
/// The program: finds the subcommand, takes out what all of them share, prints what went wrong, once.
#include "tools/servoscope/command.h"
#include "tools/servoscope/suggest.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#ifndef SERVOSCOPE_VERSION
#define SERVOSCOPE_VERSION "0.1.0"
#endif

static void print_list(FILE *stream)
{
    fputs("servoscope measures how a servo drive really behaves, and says what the simulation of it gets wrong.\n\n"
          "usage: servoscope SUBCOMMAND [options]\n\n",
          stream);
    for (size_t i = 0; commands[i]; i++) {
        fprintf(stream, "  %-10s %s\n", commands[i]->name, commands[i]->summary);
    }
    fputs("\nAll of them take --help (with an example), --json (one object on standard output) and --quiet.\n"
          "Exit status: 0 done, 1 not done (data refused, limit violated, drive fault), 2 wrong usage.\n",
          stream);
}

static const struct command *find_command(const char *name)
{
    for (size_t i = 0; commands[i]; i++) {
        if (strcmp(commands[i]->name, name) == 0) {
            return commands[i];
        }
    }
    return NULL;
}

/// Takes --help, --json and --quiet out of argv (up to `--`); returns the new argc, argv[argc] stays NULL.
static int take_shared_options(int argc, char **argv, struct command_context *out_context, bool *out_help)
{
    int kept = 1;
    bool ended = false;
    for (int i = 1; i < argc; i++) {
        ended = ended || strcmp(argv[i], "--") == 0;
        if (!ended && (strcmp(argv[i], "--help") == 0 || strcmp(argv[i], "-h") == 0)) {
            *out_help = true;
        } else if (!ended && strcmp(argv[i], "--json") == 0) {
            out_context->json = true;
        } else if (!ended && strcmp(argv[i], "--quiet") == 0) {
            out_context->quiet = true;
        } else {
            argv[kept++] = argv[i];
        }
    }
    argv[kept] = NULL;
    return kept;
}

/// A result that did not reach the disk or the pipe is not done, whatever the subcommand thought.
static int finish_output(const char *name, int status)
{
    if (fflush(stdout) != 0 || ferror(stdout)) {
        fprintf(stderr, "servoscope %s: standard output could not be written\n", name);
        return status ? status : error_refused;
    }
    return status;
}

static int run_command(const struct command *command, int argc, char **argv)
{
    struct command_context context = {.json = false, .quiet = false, .terminal = isatty(STDERR_FILENO) == 1};
    struct error error = {.status = 0, .message = ""};
    bool help = false;
    argc = take_shared_options(argc, argv, &context, &help);
    if (help) {
        fputs(command->help, stdout);
        fputs(command->more_help ? command->more_help : "", stdout);
        return finish_output(command->name, 0);
    }
    int status = command->run(argc, argv, &context, &error);
    if (status && error.message[0] != '\0') {
        fprintf(stderr, "servoscope %s: %s\n", command->name, error.message);
    }
    return finish_output(command->name, status);
}

static int refuse_unknown(const char *word)
{
    struct suggestion suggestion;
    suggest_begin(&suggestion, word + strspn(word, "-"), strlen(word + strspn(word, "-")));
    for (size_t i = 0; commands[i]; i++) {
        suggest_consider(&suggestion, commands[i]->name);
    }
    const char *meant = suggest_found(&suggestion);
    fprintf(stderr, "servoscope: '%s' is not a subcommand%s%s%s 'servoscope --help' lists them\n", word,
            meant ? ": did you mean " : ";", meant ? meant : "", meant ? "?" : "");
    return error_usage;
}

/// `servoscope help [SUBCOMMAND]`, as many programs have it, is turned into `servoscope [SUBCOMMAND] --help`.
static void turn_help_round(int argc, char **argv)
{
    static char help[] = "--help";
    if (argc == 2) {
        argv[1] = help;
    } else if (argc == 3) {
        argv[1] = argv[2];
        argv[2] = help;
    }
}

int main(int argc, char **argv)
{
    if (argc < 2) {
        print_list(stderr);
        return error_usage;
    }
    if (strcmp(argv[1], "help") == 0) {
        turn_help_round(argc, argv);
    }
    if (strcmp(argv[1], "--help") == 0 || strcmp(argv[1], "-h") == 0) {
        print_list(stdout);
        return finish_output("--help", 0);
    }
    if (strcmp(argv[1], "--version") == 0) {
        puts("servoscope " SERVOSCOPE_VERSION);
        return finish_output("--version", 0);
    }
    const struct command *command = find_command(argv[1]);
    if (!command) {
        return refuse_unknown(argv[1]);
    }
    return run_command(command, argc - 1, argv + 1);
}
