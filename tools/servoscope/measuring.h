/* SPDX-License-Identifier: MIT */
/// What `measure`, `simulate` and everything else that plays a table through a drive have in common: options, Ctrl-C,
/// progress, the run file, the summary.
#ifndef SERVOSCOPE_TOOLS_MEASURING_H
#define SERVOSCOPE_TOOLS_MEASURING_H

#include "drivers/drive.h"
#include "lab/measure/measure.h"
#include "lab/measure/table_bytes.h"
#include "lab/record/error.h"
#include "lab/record/sequence_file.h"
#include "tools/servoscope/command.h"
#include "tools/servoscope/door.h"
#include "tools/servoscope/options.h"

enum { measuring_options_max = 16 };

/// What the options say. Set up with measuring_defaults; limits of 0 do not limit.
struct measuring_request {
    const char *table; ///< a table, or the manifest of a sequence of them
    const char *out;
    const char *report;     ///< a page beside the run; NULL: none
    const char *drive_file; ///< the model file that is the drive, not to be overwritten; NULL: there is none
    const char *mode;
    long long periods;
    long long settle;
    bool settle_given; ///< else a sequence settles for as long as its manifest says
    long long fade_samples;
    bool fade_given;
    double limit_position_rad;
    double limit_velocity_rad_per_s;
    double limit_torque_Nm;
};

/// A request that has been read and checked.
struct measuring {
    const struct measuring_request *request;
    bool linear;                   ///< what the table or the sequence is for
    struct table_bytes table;      ///< empty for a sequence, whose tables are read one after the other
    struct sequence_file sequence; ///< without segments for a single table
    struct measure_plan plan;      ///< of a sequence: what all segments have in common
    const struct door *door;       ///< whose bus is to be reported; NULL: there is none
};

void measuring_defaults(struct measuring_request *out_request);

/// Writes the common options to out_options[0 ..] (room for measuring_options_max) and returns how many.
size_t measuring_options(struct measuring_request *request, struct option *out_options);

/// Reads the table, or all tables of a sequence, and makes the plan; checks that the output can be written before
/// anything moves.
/// Errors: error_usage, error_refused; nothing to free then
int measuring_prepare(const struct measuring_request *request, struct measuring *out_self, struct error *out_error);

/// Measures through an unopened drive, writes the run file (also what was kept of a measurement that ended early), or
/// the runs of a sequence and their manifest, and the page; shows progress, prints a summary. `source` names the drive
/// in the run (key `drive`). Ctrl-C ramps down while this runs.
/// Errors: error_refused if the measurement is not complete or not written
int measuring_run(struct measuring *self, const struct drive *drive, const char *source,
                  const struct command_context *context, struct error *out_error);

void measuring_free(struct measuring *self);

/// The lines of --help that describe the common options.
#define MEASURING_HELP                                                                                                 \
    "  --table T.mst        what to play, from servoscope design; the manifest of a sequence (octaves, dwell) plays\n" \
    "                       all of its tables\n"                                                                       \
    "  --periods P          counted periods; a sequence plays P times as many as each segment needs\n"                 \
    "  --settle S           periods before them in which the start transient dies; written too (default 1; a "         \
    "sequence: its\n"                                                                                                  \
    "                       settling time)\n"                                                                          \
    "  --mode cascade       table as position reference with velocity and torque feed-forward (default)\n"             \
    "  --mode torque        table as torque, open loop: the axis is free to drift\n"                                   \
    "  --fade SAMPLES       length of the fades before and after (default: so that they add at most the table's top "  \
    "speed)\n"                                                                                                         \
    "                       0: no fade before (after: the default), full amplitude from the start that design has "    \
    "chosen;\n"                                                                                                        \
    "                       in cascade mode the axis first travels to the position there and stands for a second\n"    \
    "  --limit-position RAD --limit-velocity RAD_PER_S --limit-torque NM\n"                                            \
    "                       ramp down and stop beyond these, position from where the axis stood; a table that asks "   \
    "for more\n"                                                                                                       \
    "                       torque is refused (a linear table: m, m/s, N); the torque limit is set in the drive too\n" \
    "                       (default there: 3 times the table's largest torque)\n"                                     \
    "  --out RUN.csv        the recording; of a sequence RUN-1.csv, RUN-2.csv ... and RUN.csv, which names them for "  \
    "frf\n"                                                                                                            \
    "  --report FILE.html   a page: bus timing, lost and late samples, level against table and limits, settling, "     \
    "lines\n"

#endif
