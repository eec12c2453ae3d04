/* SPDX-License-Identifier: MIT */
/// Frequency response files: one line per frequency, values in SI units of output over input.
/// Columns: frequency_hz,real,imag,std,noise_std,odd_distortion,even_distortion,valid, and coherence where a method
/// gives it. The first three are required; without `valid` every line is. Keys: input, output, units, method, periods,
/// degrees_of_freedom; others are kept.
///
/// A number that was not estimated is an empty cell in the file and FRF_UNKNOWN in memory, never NaN and never 0: all
/// of these columns are magnitudes, so that a negative number cannot be mistaken for one. A line that is not valid
/// keeps its frequency; its other cells are finite but mean nothing.
#ifndef SERVOSCOPE_RECORD_FRF_FILE_H
#define SERVOSCOPE_RECORD_FRF_FILE_H

#include "lab/record/error.h"
#include "lab/record/run.h"

#include <stdbool.h>
#include <stddef.h>

/// Value of std, noise_std, odd_distortion or even_distortion that is not known; test with frf_known().
#define FRF_UNKNOWN (-1.0)

/// One response. Arrays have `count` elements, frequencies ascend strictly.
struct frf {
    size_t count;
    double *frequency_hz;
    double *real;
    double *imag;
    double *std;            ///< of the complex value, |G|-units: noise and stochastic nonlinear distortion
    double *noise_std;      ///< the noise alone
    double *odd_distortion; ///< magnitudes in the units of the response
    double *even_distortion;
    double *coherence; ///< of the output and what it was correlated with, 0..1; NULL is as good as all unknown
    bool *valid;
    char *input;               ///< column names: torque_Nm
    char *output;              ///< velocity_rad_per_s
    char *units;               ///< rad_per_s/Nm
    char *method;              ///< mean, hann, lpm, ...
    size_t periods;            ///< 0: does not apply
    double degrees_of_freedom; ///< of the standard deviations; 0: not known
    size_t key_count;          ///< keys beyond these, in order
    struct run_key *keys;
};

/// Whether a standard deviation or distortion is known.
static inline bool frf_known(double value)
{
    return value >= 0;
}

/// Allocates `count` lines: zero response, everything else unknown, not valid, texts empty.
/// Errors: error_refused if memory is short; *out_frf is empty then.
int frf_alloc(struct frf *out_frf, size_t count, struct error *out_error);

/// Frees what frf_alloc or frf_read gave; harmless on a zeroed struct.
void frf_free(struct frf *self);

/// Replaces one of the four texts, e.g. frf_set_text(&frf.method, "mean"). Returns false if memory is short.
bool frf_set_text(char **text, const char *value);

/// Tells whether a file is a response rather than a run, by the beginning of its row of names; false if it cannot be
/// read.
bool frf_file_is(const char *path);

/// Reads a response, plain or gzipped.
/// Errors: error_refused with file, line, column, value and expectation; *out_frf is empty then.
/// Test:   tests/unit/test_frf_file.c
int frf_read(const char *path, struct frf *out_frf, struct error *out_error);

/// Writes a response; what is read back is identical bit for bit.
/// Errors: error_refused if a number is not finite, frequencies do not ascend, or the disk refuses; `path` is as it was
///         then.
/// Test:   tests/unit/test_frf_file.c
int frf_write(const char *path, const struct frf *frf, struct error *out_error);

#endif
