/* SPDX-License-Identifier: MIT */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/truth/truth_case.h"

static int usage(FILE *out)
{
    fprintf(out, "usage: truth_case --seed S --kind KIND[+KIND[+KIND]] --out DIR [--size clear|moderate|faint]\n"
                 "       [--protocol multisine|stroke]\n"
                 "Writes run1.csv, run2.csv, nominal.json and truth.json (the answer) into DIR.\nkinds:");
    for (int kind = 0; kind < truth_kind_count; kind++) {
        fprintf(out, " %s", truth_kind_name((enum truth_kind)kind));
    }
    fprintf(out, "\n");
    return out == stdout ? 0 : 2;
}

struct request {
    struct truth_wish wish;
    int kind_given;
    const char *out;
};

static int set_option(struct request *self, const char *name, const char *value)
{
    if (strcmp(name, "--seed") == 0) {
        self->wish.seed = strtoull(value, NULL, 10);
    } else if (strcmp(name, "--kind") == 0) {
        self->kind_given = 1;
        return truth_wish_read(&self->wish, value);
    } else if (strcmp(name, "--size") == 0) {
        self->wish.size = truth_size_find(value);
        return self->wish.size == truth_size_count ? -1 : 0;
    } else if (strcmp(name, "--out") == 0) {
        self->out = value;
    } else if (strcmp(name, "--protocol") == 0 && strcmp(value, "multisine") == 0) {
        self->wish.protocol = truth_protocol_multisine;
    } else if (strcmp(name, "--protocol") == 0 && strcmp(value, "stroke") == 0) {
        self->wish.protocol = truth_protocol_stroke;
    } else {
        return -1;
    }
    return 0;
}

int main(int argc, char **argv)
{
    static struct truth_case made;
    struct request request = {.wish = {.seed = 1}};
    if (argc == 2 && strcmp(argv[1], "--help") == 0) {
        return usage(stdout);
    }
    for (int i = 1; i < argc; i += 2) {
        if (i + 1 >= argc || set_option(&request, argv[i], argv[i + 1])) {
            return usage(stderr);
        }
    }
    if (!request.out || !request.kind_given) {
        return usage(stderr);
    }
    truth_case_make(&made, &request.wish);
    if (!made.reached) {
        fprintf(stderr, "truth_case: the size could not be reached\n");
    }
    return truth_case_write(&made, request.out) || truth_case_write_answer(&made, request.out) ? 1 : 0;
}
