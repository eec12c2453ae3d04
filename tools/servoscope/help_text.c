/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/help_text.h"

#include <ctype.h>
#include <stdio.h>
#include <string.h>

bool help_text_next(const struct command *command, const char **io_at, struct help_line *out_line)
{
    const char *at = *io_at ? *io_at : command->help;
    const char *end_of_help = command->help + strlen(command->help);
    if (at == end_of_help && command->more_help) {
        at = command->more_help;
    }
    if (*at == '\0') {
        return false;
    }
    out_line->text = at;
    out_line->length = strcspn(at, "\n");
    *io_at = at + out_line->length + (at[out_line->length] == '\n');
    return true;
}

static bool begins_option(const struct help_line *line, size_t at)
{
    return at + 2 < line->length && line->text[at] == '-' && line->text[at + 1] == '-' &&
           islower((unsigned char)line->text[at + 2]);
}

static size_t word_length(const struct help_line *line, size_t at)
{
    size_t length = 0;
    while (at + length < line->length && line->text[at + length] != ' ') {
        length++;
    }
    return length;
}

/// Words with one blank between them; behind more blanks comes what the option does, or another option.
static size_t option_part(const struct help_line *line)
{
    size_t at = 2;
    if (line->length < 5 || line->text[0] != ' ' || line->text[1] != ' ' || !begins_option(line, 2)) {
        return 0;
    }
    while (at < line->length) {
        const size_t end = at + word_length(line, at);
        size_t next = end;
        while (next < line->length && line->text[next] == ' ') {
            next++;
        }
        if (next == line->length || (next > end + 1 && !begins_option(line, next))) {
            return end;
        }
        at = next;
    }
    return line->length;
}

static bool is_known(const struct help_option *options, size_t count, const char *name)
{
    for (size_t i = 0; i < count; i++) {
        if (strcmp(options[i].name, name) == 0) {
            return true;
        }
    }
    return false;
}

static void copy_word(const char *text, size_t length, char *out, size_t size)
{
    snprintf(out, size, "%.*s", (int)length, text);
}

/// Adds the option whose name begins at `at`, with the value behind it if that lies before `end`.
static size_t add_option(const struct help_line *line, size_t at, size_t end, struct help_option *io_options,
                         size_t count)
{
    struct help_option option = {"", ""};
    size_t name_end = at + 2;
    while (name_end < end && (isalnum((unsigned char)line->text[name_end]) || line->text[name_end] == '-')) {
        name_end++;
    }
    const struct help_line rest = {line->text, end};
    const size_t value = name_end + 1;
    copy_word(line->text + at + 2, name_end - at - 2, option.name, sizeof option.name);
    if (value < end && line->text[name_end] == ' ' && line->text[value] != ' ' && !begins_option(&rest, value)) {
        copy_word(line->text + value, word_length(&rest, value), option.value, sizeof option.value);
    }
    if (count < help_options_max && !is_known(io_options, count, option.name)) {
        io_options[count++] = option;
    }
    return count;
}

/// The options that a line is about (those it begins with, of a usage line all, and any in parentheses), added to
/// io_options as far as there is room (help_options_max). Returns the new count. A name has one place.
static size_t options_in(const struct help_line *line, struct help_option *io_options, size_t count)
{
    const bool usage = line->length > 7 && memcmp(line->text, "usage: ", 7) == 0;
    const size_t part = usage ? line->length : option_part(line);
    for (size_t at = 1; at < line->length; at++) {
        /* "(--keep all)": an option told of where the one it belongs to is. */
        const bool named =
            at < part ? line->text[at - 1] == ' ' || line->text[at - 1] == '[' : line->text[at - 1] == '(';
        if (named && begins_option(line, at)) {
            count = add_option(line, at, line->length, io_options, count);
        }
    }
    return count;
}

size_t help_text_all_options(const struct command *command, struct help_option out_options[help_options_max])
{
    static const char *const shared[] = {"json", "quiet", "help"};
    const size_t shared_count = sizeof shared / sizeof shared[0];
    struct help_line line;
    const char *at = NULL;
    size_t count = 0;
    while (help_text_next(command, &at, &line)) {
        count = options_in(&line, out_options, count);
    }
    for (size_t i = 0; i < shared_count; i++) {
        if (count < help_options_max && !is_known(out_options, count, shared[i])) {
            struct help_option option = {"", ""};
            snprintf(option.name, sizeof option.name, "%s", shared[i]);
            out_options[count++] = option;
        }
    }
    return count;
}
