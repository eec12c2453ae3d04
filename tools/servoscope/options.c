/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/options.h"

#include "lab/record/number.h"
#include "tools/servoscope/suggest.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

enum { options_max = 64 };

int options_parse_number(const char *what, const char *text, double *out_value, struct error *out_error)
{
    enum number_status status = number_parse(text, strlen(text), out_value);
    if (status != number_ok) {
        return error_set(out_error, error_usage, "%s: '%s' %s", what, text, number_status_str(status));
    }
    return 0;
}

static int parse_integer(const char *what, const char *text, long long *out_value, struct error *out_error)
{
    char *end = NULL;
    errno = 0;
    long long value = strtoll(text, &end, 10);
    if (end == text || *end != '\0' || errno == ERANGE) {
        return error_set(out_error, error_usage, "%s: '%s' is not a whole number", what, text);
    }
    *out_value = value;
    return 0;
}

static int check_range(const struct option *option, const char *text, double value, struct error *out_error)
{
    if (option->kind == option_positive && !(value > 0)) {
        return error_set(out_error, error_usage, "--%s: '%s', expected a positive number", option->name, text);
    }
    bool ranged = option->lowest < 0 || option->lowest > 0 || option->highest < 0 || option->highest > 0;
    if (ranged && !(value >= option->lowest && value <= option->highest)) {
        return error_set(out_error, error_usage, "--%s: '%s' is out of range, expected %.9g to %.9g", option->name,
                         text, option->lowest, option->highest);
    }
    return 0;
}

static int append_value(struct option_values *values, const char *what, const char *text, struct error *out_error)
{
    if (*text == '\0') {
        return error_set(out_error, error_usage, "%s: the value is empty", what);
    }
    if (values->count >= option_values_max) {
        return error_set(out_error, error_usage, "%s: more than %d values, the first too many is '%s'", what,
                         (int)option_values_max, text);
    }
    values->items[values->count++] = text;
    return 0;
}

static int store_value(const struct option *option, const char *text, struct error *out_error)
{
    char what[80] = "--";
    strncat(what, option->name, sizeof what - 3);
    double number = 0;
    long long whole = 0;
    int status = 0;
    switch (option->kind) {
    case option_number:
    case option_positive:
        status = options_parse_number(what, text, &number, out_error);
        status = status ? status : check_range(option, text, number, out_error);
        if (!status) {
            *(double *)option->target = number;
        }
        return status;
    case option_integer:
        status = parse_integer(what, text, &whole, out_error);
        status = status ? status : check_range(option, text, (double)whole, out_error);
        if (!status) {
            *(long long *)option->target = whole;
        }
        return status;
    case option_text:
        if (*text == '\0') {
            return error_set(out_error, error_usage, "%s: the value is empty", what);
        }
        *(const char **)option->target = text;
        return 0;
    case option_list:
        return append_value(option->target, what, text, out_error);
    case option_flag:
        break;
    }
    return error_set(out_error, error_usage, "%s takes no value, got '%s'", what, text);
}

static const struct option *find_option(const struct option *options, size_t option_count, const char *name,
                                        size_t name_length)
{
    for (size_t i = 0; i < option_count; i++) {
        if (strlen(options[i].name) == name_length && memcmp(options[i].name, name, name_length) == 0) {
            return &options[i];
        }
    }
    return NULL;
}

/// Refuses a word that is no option, with the one that may have been meant.
static int refuse_unknown(const char *word, const struct option *options, size_t option_count, const char *command,
                          struct error *out_error)
{
    const char *name = word + strspn(word, "-");
    struct suggestion suggestion;
    suggest_begin(&suggestion, name, strcspn(name, "="));
    for (size_t i = 0; i < option_count; i++) {
        suggest_consider(&suggestion, options[i].name);
    }
    static const char *const shared[] = {"json", "quiet", "help"};
    for (size_t i = 0; i < sizeof shared / sizeof shared[0]; i++) {
        suggest_consider(&suggestion, shared[i]);
    }
    const char *meant = suggest_found(&suggestion);
    if (meant) {
        return error_set(out_error, error_usage, "unknown option '%s': did you mean --%s? See 'servoscope %s --help'",
                         word, meant, command);
    }
    return error_set(out_error, error_usage, "unknown option '%s'; see 'servoscope %s --help'", word, command);
}

static bool is_option_word(const char *word)
{
    return word[0] == '-' && word[1] == '-';
}

/// Reads the option at argv[at] with its values; *out_next is the first word behind them.
static int read_option(const struct option *option, int argc, char **argv, int at, int *out_next,
                       struct error *out_error)
{
    const char *equals = strchr(argv[at], '=');
    *out_next = at + 1;
    if (equals) {
        return store_value(option, equals + 1, out_error);
    }
    if (option->kind == option_flag) {
        *(bool *)option->target = true;
        return 0;
    }
    if (at + 1 >= argc || is_option_word(argv[at + 1])) {
        return error_set(out_error, error_usage, "--%s: needs a value", option->name);
    }
    do {
        int status = store_value(option, argv[*out_next], out_error);
        if (status) {
            return status;
        }
        ++*out_next;
    } while (option->kind == option_list && *out_next < argc && !is_option_word(argv[*out_next]));
    return 0;
}

static int take_operand(const char *word, const struct option_operands *operands, const char *command,
                        struct error *out_error)
{
    if (!operands || operands->values->count >= operands->at_most) {
        return error_set(out_error, error_usage, "unexpected '%s'; see 'servoscope %s --help'", word, command);
    }
    return append_value(operands->values, operands->name, word, out_error);
}

static int check_complete(const struct option *options, size_t option_count, const bool *given,
                          const struct option_operands *operands, const char *command, struct error *out_error)
{
    for (size_t i = 0; i < option_count; i++) {
        if (options[i].required && !given[i]) {
            return error_set(out_error, error_usage, "--%s is missing; see 'servoscope %s --help'", options[i].name,
                             command);
        }
    }
    if (operands && operands->values->count < operands->at_least) {
        return error_set(out_error, error_usage, "%s is missing; see 'servoscope %s --help'", operands->name, command);
    }
    return 0;
}

/// Reads one word that begins with two minus, and its values.
static int read_option_word(int argc, char **argv, int at, const struct option *options, size_t option_count,
                            bool *given, int *out_next, struct error *out_error)
{
    const char *name = argv[at] + 2;
    const struct option *option = find_option(options, option_count, name, strcspn(name, "="));
    if (!option) {
        return refuse_unknown(argv[at], options, option_count, argv[0], out_error);
    }
    bool *seen = &given[option - options];
    if (*seen && option->kind != option_list) {
        return error_set(out_error, error_usage, "--%s is given twice", option->name);
    }
    *seen = true;
    if (option->out_given) {
        *option->out_given = true;
    }
    return read_option(option, argc, argv, at, out_next, out_error);
}

int options_parse(int argc, char **argv, const struct option *options, size_t option_count,
                  const struct option_operands *operands, struct error *out_error)
{
    bool given[options_max] = {false};
    bool options_ended = false;
    if (option_count > options_max) {
        return error_set(out_error, error_usage, "more than %d options in one table", (int)options_max);
    }
    if (operands) {
        operands->values->count = 0;
    }
    for (int at = 1; at < argc;) {
        int status = 0;
        int next = at + 1;
        if (options_ended && operands && operands->values->count < operands->at_most) {
            status = append_value(operands->values, operands->name, argv[at], out_error);
        } else if (!options_ended && argv[at][0] == '-' && argv[at][1] != '\0' && !is_option_word(argv[at])) {
            status = refuse_unknown(argv[at], options, option_count, argv[0], out_error);
        } else if (options_ended || !is_option_word(argv[at])) {
            status = take_operand(argv[at], operands, argv[0], out_error);
        } else if (argv[at][2] == '\0') {
            options_ended = true;
        } else {
            status = read_option_word(argc, argv, at, options, option_count, given, &next, out_error);
        }
        if (status) {
            return status;
        }
        at = next;
    }
    return check_complete(options, option_count, given, operands, argv[0], out_error);
}
