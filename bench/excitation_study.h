/* SPDX-License-Identifier: MIT */
/// The first paper's experiments (section 5) on the simulated drive, piece by piece: tables of each method at equal
/// limits, played, and what the recordings say. For `./run bench excitation`. Everything but a drive that changes while
/// it is measured goes through the program: design, simulate, frf.
#ifndef SERVOSCOPE_BENCH_EXCITATION_STUDY_H
#define SERVOSCOPE_BENCH_EXCITATION_STUDY_H

#include "lab/record/run.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum excitation_method { excitation_clip, excitation_mca, excitation_linf, excitation_fast, excitation_methods };

extern const char *const excitation_method_names[excitation_methods];

enum {
    excitation_lines = 200,    ///< 0.5 .. 100 Hz
    excitation_samples = 2000, ///< 2 s at 1 kHz
    excitation_periods = 10,   ///< counted, after one that is not
};

/// A drive to be measured.
struct excitation_drive {
    const char *name;
    double rating; ///< limits over those of the paper: 1 Nm and 0.05 m/s
    bool poor_sensors;
    double friction_wander;  ///< standard deviation of slow changes, shares: of all friction
    double stiffness_wander; ///< of the belt's stiffness
};

/// Where files go, and the program.
struct excitation_place {
    const char *program;
    const char *folder;
};

/// Designs the table of a method at limits of `rating` times the paper's, all limits at the samples as there.
/// Errors: false if the program fails
bool excitation_design(const struct excitation_place *place, enum excitation_method method, double rating,
                       double *out_effective_Nm);

/// One recording and the response that the program finds in it.
struct excitation_recording {
    struct run run;
    double magnitude[excitation_lines];
    double std[excitation_lines];
};

/// Plays a designed table on a drive. Errors: false, with a message on standard error
bool excitation_measure(const struct excitation_place *place, const struct excitation_drive *drive,
                        enum excitation_method method, uint64_t seed, struct excitation_recording *out_recording);

/// Signal-to-noise ratio of a column after white noise was added: effective value of the mean period over the standard
/// deviation between periods, taken at each time step and averaged over all. Mean value of the signal left out.
/// Errors: NaN if the column is not there or memory is short
double excitation_snr_db(const struct run *run, const char *column, double noise, uint64_t seed);

/// Mean over the lines of 20 log std.
double excitation_level_db(const double std[excitation_lines]);

#endif
