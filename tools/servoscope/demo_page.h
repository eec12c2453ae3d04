/* SPDX-License-Identifier: MIT */
/// The page that the demo ends with: one story from excitation to cause, made of the sections of the lab's rooms.
#ifndef SERVOSCOPE_TOOLS_DEMO_PAGE_H
#define SERVOSCOPE_TOOLS_DEMO_PAGE_H

#include "lab/design/design.h"
#include "lab/diagnose/diagnosis.h"
#include "lab/record/error.h"
#include "lab/record/frf_file.h"
#include "lab/record/run.h"
#include "msgen/table.h"
#include "tools/servoscope/door.h"
#include "tools/servoscope/hiding.h"

enum { demo_runs = 2 };

/// What the page tells of; everything is borrowed.
struct demo_page {
    long long seed;
    const struct hiding *hiding;
    const struct design_request *request; ///< of the first excitation
    const struct design_result *design;
    const struct msgen_table *table;
    const struct run *runs; ///< demo_runs of them
    const struct door_statistics *bus;
    const struct frf *measured;
    const struct diagnosis *diagnosis;
};

/// Writes the page. The lines of nominal and extended model are their own responses to the same excitation, simulated
/// without noise.
/// Errors: error_refused if a model cannot be simulated, memory is short, or the disk refuses; `path` is as it was then
int demo_page_write(const char *path, const struct demo_page *self, struct error *out_error);

#endif
