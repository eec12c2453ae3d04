/* SPDX-License-Identifier: MIT */
/// The page of a sequence of excitations: what all tables reach, then the first of them one by one.
#ifndef SERVOSCOPE_DESIGN_REPORT_SEQUENCE_H
#define SERVOSCOPE_DESIGN_REPORT_SEQUENCE_H

#include "lab/design/design.h"
#include "lab/page/page.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

/// So many tables are shown one by one: a page of more is heavier than 500 kB.
enum { design_report_tables_shown = 6 };

struct design_report_table;

/// What is kept of the tables while they are designed one after the other; their periods are not.
struct design_report_sequence {
    FILE *stream; ///< the sections of single tables, written into memory
    char *text;
    size_t size;
    struct page page;
    size_t count;
    struct design_report_table *tables;
    size_t line_count; ///< of all tables
    double *lines;     ///< frequency, torque and velocity amplitude of each
    bool linear;
};

/// Errors: false if memory is short; design_report_sequence_free() in every case
bool design_report_sequence_begin(struct design_report_sequence *out_self);

/// Takes the next table; `name` heads its section. Errors: false if memory is short
bool design_report_sequence_add(struct design_report_sequence *self, const char *name,
                                const struct design_request *request, const struct design_result *result);

/// Adds everything to a page that has nothing but its head: effective values and used limits over the tables, the
/// amplitudes of all lines, a table, then the sections of the first design_report_tables_shown.
/// Errors: false if memory is short
/// Test:   tests/unit/test_design_report.c
bool design_report_sequence_write(struct design_report_sequence *self, struct page *page);

void design_report_sequence_free(struct design_report_sequence *self);

#endif
