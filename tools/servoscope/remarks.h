/* SPDX-License-Identifier: MIT */
/// What a subcommand found, said once: the same list of sentences for the screen, for --json and for a page, so that
/// none of the three knows less than the others.
#ifndef SERVOSCOPE_TOOLS_REMARKS_H
#define SERVOSCOPE_TOOLS_REMARKS_H

#include "lab/page/page.h"

#include <cjson/cJSON.h>
#include <stdbool.h>
#include <stddef.h>

enum remark_level {
    remark_fact,    ///< what was done and found
    remark_advice,  ///< what suits the recording better, or would give more
    remark_warning, ///< the result does not mean what it seems to
};

struct remark {
    enum remark_level level;
    const char *id; ///< a word of its kind: "settling"; not owned, lives for ever
    char *about;    ///< the file it is of
    char *text;     ///< one sentence without its full stop
};

/// Zero-initialise; remarks_free() in every case.
struct remarks {
    size_t count;
    struct remark *items;
    const char *about;    ///< of what is added next; borrowed
    bool short_of_memory; ///< a sentence was lost
};

/// Sets what the following sentences are about.
void remarks_about(struct remarks *self, const char *path);

/// Adds a sentence; nothing is added if memory is short, which remarks_print and the others then say.
void remarks_add(struct remarks *self, enum remark_level level, const char *id, const char *format, ...)
#if defined(__GNUC__)
    __attribute__((format(printf, 4, 5)))
#endif
    ;

/// "run.csv: SENTENCE" for the first one about a file, "  SENTENCE" for those that follow, on standard output.
void remarks_print(const struct remarks *self);

/// Adds the array `findings`: objects with id, level ("fact", "advice", "warning"), file, says.
void remarks_add_json(const struct remarks *self, cJSON *io_object);

/// Adds the warnings as notes with a sign, for the top of a page; a note that there are none.
void remarks_add_warnings(const struct remarks *self, struct page *page);

/// Adds everything else, a list for each file.
void remarks_add_lists(const struct remarks *self, struct page *page);

void remarks_free(struct remarks *self);

#endif
