/* SPDX-License-Identifier: MIT */
/// Design of a sequence: one table for each segment and input, PREFIX-1.mst, PREFIX-2.mst ... with their .csv and .h
/// (PREFIX-1-1 and PREFIX-1-2 for two inputs), and then the manifest PREFIX.json that makes one thing of them.
#ifndef SERVOSCOPE_TOOLS_SEQUENCES_H
#define SERVOSCOPE_TOOLS_SEQUENCES_H

#include "lab/design/design.h"
#include "lab/design/sequence.h"
#include "lab/record/error.h"

#include <cjson/cJSON.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct sequences_request {
    const char *specification; ///< of the lines, any kind
    size_t inputs;
    uint64_t periods;      ///< l: averaging factor that the test time is stated for
    double settle_time_s;  ///< NAN: one period
    const char *amplitude; ///< as for one multisine (lab/design/amplitude.h); NULL: "constraint"
    const char *prefix;
    const char *report; ///< page with a section for each table; NULL: none
    /// Everything but lines and their amplitudes. Without a method octaves and dwell get "schroeder", as published.
    const struct design_request *design;
    /// Called with each design before its files are written; not 0 stops with that status. NULL: nobody judges.
    int (*judge)(void *context, const struct design_request *request, const struct design_result *result,
                 struct error *out_error);
    /// What --json says of the design of one table, whose files begin with `prefix`; test_time_s is its segment's, with
    /// settling. NULL: only its file, input, periods and CRC are said.
    cJSON *(*describe)(void *context, const char *prefix, const struct design_request *request,
                       const struct design_result *result, double test_time_s);
    void *context;
};

/// Zero-initialise; sequences_summary_free() in every case.
struct sequences_summary {
    struct design_sequence sequence;
    const char *method;
    size_t table_count;
    size_t line_count; ///< of one input
    uint64_t periods;
    double settle_s;
    double test_time_s;
    double effective_lowest_Nm; ///< of all tables
    double effective_highest_Nm;
    double cpu_s;
    bool interrupted;
    cJSON *segments; ///< array: what describe() gave, with "file", "input", "periods" and "table_crc32"
};

/// Designs and writes everything, the manifest last; an old manifest of that name goes before the first table.
/// Errors: error_usage, error_refused: what design_sequence_parse(), design_run(), judge() and the files say, with the
///         segment; tables written until then are removed again
int sequences_design_and_write(const struct sequences_request *request, struct sequences_summary *out_summary,
                               struct error *out_error);

/// One object for --json: kind, method, inputs, lines, periods, settle_time_s, test_time_s, cpu_s and the segments,
/// which move from the summary to it.
cJSON *sequences_json(struct sequences_summary *summary);

/// The same in a few lines for a person.
void sequences_print(const struct sequences_request *request, const struct sequences_summary *summary);

void sequences_summary_free(struct sequences_summary *summary);

#endif
