/* SPDX-License-Identifier: MIT */
/// servoscope completion: what a shell needs to complete subcommands, options and files.
#include "tools/servoscope/command.h"
#include "tools/servoscope/help_text.h"
#include "tools/servoscope/options.h"

#include <stdio.h>
#include <string.h>

static void print_names(void)
{
    for (size_t i = 0; commands[i]; i++) {
        printf("%s%s", i ? " " : "", commands[i]->name);
    }
}

static void print_options(const struct command *command)
{
    struct help_option options[help_options_max];
    const size_t count = help_text_all_options(command, options);
    for (size_t i = 0; i < count; i++) {
        printf("%s--%s", i ? " " : "", options[i].name);
    }
}

/// A word that is no option is a file: bash and zsh complete those by themselves where this offers nothing.
static void print_bash(void)
{
    fputs("_servoscope() {\n"
          "    local word=${COMP_WORDS[COMP_CWORD]}\n"
          "    COMPREPLY=()\n"
          "    if [ \"$COMP_CWORD\" -eq 1 ]; then\n"
          "        mapfile -t COMPREPLY < <(compgen -W '",
          stdout);
    print_names();
    fputs(" help --help --version' -- \"$word\")\n"
          "        return\n"
          "    fi\n"
          "    case ${COMP_WORDS[1]} in\n"
          "    manual | help) [[ $word == -* ]] || mapfile -t COMPREPLY < <(compgen -W '",
          stdout);
    print_names();
    fputs("' -- \"$word\") ;;\n"
          "    completion) [[ $word == -* ]] || mapfile -t COMPREPLY < <(compgen -W 'bash zsh fish' -- \"$word\") ;;\n"
          "    esac\n"
          "    [[ $word == -* ]] || return\n"
          "    case ${COMP_WORDS[1]} in\n",
          stdout);
    for (size_t i = 0; commands[i]; i++) {
        printf("    %s) mapfile -t COMPREPLY < <(compgen -W '", commands[i]->name);
        print_options(commands[i]);
        fputs("' -- \"$word\") ;;\n", stdout);
    }
    fputs("    esac\n"
          "}\n"
          "complete -o default -F _servoscope servoscope\n",
          stdout);
}

/// Between single quotes of a shell; `also` is escaped for _arguments and _describe.
static void print_quoted(const char *text, const char *also)
{
    for (const char *at = text; *at; at++) {
        if (*at == '\'') {
            fputs("'\\''", stdout);
        } else if (strchr(also, *at)) {
            printf("\\%c", *at);
        } else {
            putchar(*at);
        }
    }
}

static void print_zsh(void)
{
    fputs("#compdef servoscope\n"
          "_servoscope() {\n"
          "    local -a subcommands\n"
          "    subcommands=(\n",
          stdout);
    for (size_t i = 0; commands[i]; i++) {
        printf("        '%s:", commands[i]->name);
        print_quoted(commands[i]->summary, ":");
        fputs("'\n", stdout);
    }
    fputs("    )\n"
          "    if ((CURRENT == 2)); then\n"
          "        _describe subcommand subcommands\n"
          "        return\n"
          "    fi\n"
          "    if [[ ${words[CURRENT]} != -* ]]; then\n"
          "        case ${words[2]} in\n"
          "        manual | help) _describe subcommand subcommands ;;\n"
          "        completion) compadd -- bash zsh fish ;;\n"
          "        *) _files ;;\n"
          "        esac\n"
          "        return\n"
          "    fi\n"
          "    case ${words[2]} in\n",
          stdout);
    for (size_t i = 0; commands[i]; i++) {
        printf("    %s) compadd -- ", commands[i]->name);
        print_options(commands[i]);
        fputs(" ;;\n", stdout);
    }
    fputs("    esac\n"
          "}\n"
          "_servoscope \"$@\"\n",
          stdout);
}

static void print_fish(void)
{
    fputs("complete -c servoscope -n '__fish_seen_subcommand_from completion' -f -a 'bash zsh fish'\n"
          "complete -c servoscope -n '__fish_seen_subcommand_from manual help' -f -a '",
          stdout);
    print_names();
    fputs("'\n", stdout);
    for (size_t i = 0; commands[i]; i++) {
        struct help_option options[help_options_max];
        const size_t count = help_text_all_options(commands[i], options);
        printf("complete -c servoscope -n __fish_use_subcommand -f -a %s -d '", commands[i]->name);
        print_quoted(commands[i]->summary, "");
        fputs("'\n", stdout);
        for (size_t k = 0; k < count; k++) {
            printf("complete -c servoscope -n '__fish_seen_subcommand_from %s' -l %s%s\n", commands[i]->name,
                   options[k].name, options[k].value[0] ? " -r" : "");
        }
    }
}

static int run(int argc, char **argv, const struct command_context *context, struct error *out_error)
{
    static const struct {
        const char *name;
        void (*print)(void);
    } shells[] = {{"bash", print_bash}, {"zsh", print_zsh}, {"fish", print_fish}};
    struct option_values shell = {.count = 0};
    const struct option_operands operands = {"bash, zsh or fish", 1, 1, &shell};
    int status = options_parse(argc, argv, NULL, 0, &operands, out_error);
    if (status) {
        return status;
    }
    if (context->json) {
        return error_set(out_error, error_usage,
                         "--json: a completion is a script; there is nothing to put in an object");
    }
    for (size_t i = 0; i < sizeof shells / sizeof shells[0]; i++) {
        if (strcmp(shell.items[0], shells[i].name) == 0) {
            shells[i].print();
            return 0;
        }
    }
    return error_set(out_error, error_usage, "'%s', expected bash, zsh or fish", shell.items[0]);
}

const struct command command_cmd_completion = {
    .name = "completion",
    .summary = "a script that completes subcommands and options in bash, zsh or fish",
    .help = "servoscope completion: a script that completes subcommands and options in a shell\n"
            "\n"
            "usage: servoscope completion bash|zsh|fish\n"
            "\n"
            "Made from the texts of --help, so that it knows what this version knows. File names are completed where\n"
            "no option begins. An installed servoscope has these scripts in place.\n"
            "\n"
            "example, for this terminal:\n"
            "  source <(servoscope completion bash)\n"
            "for good:\n"
            "  servoscope completion bash >~/.local/share/bash-completion/completions/servoscope\n",
    .run = run,
};
