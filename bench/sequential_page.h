/* SPDX-License-Identifier: MIT */
/// What ./run bench sequential has measured, and the page with its figures.
#ifndef SERVOSCOPE_BENCH_SEQUENTIAL_PAGE_H
#define SERVOSCOPE_BENCH_SEQUENTIAL_PAGE_H

#include "bench/sequential_study.h"

enum sequential_kind { sequential_single, sequential_octaves, sequential_dwell, sequential_kinds };

extern const char *const sequential_kind_names[sequential_kinds];

enum { sequential_amplitudes = 5, sequential_octave_count = 5 };

struct sequential_results {
    double complex response[sequential_kinds][sequential_lines]; ///< A = 1, 10 s to settle
    double above_db[sequential_kinds];                           ///< error, RMS: above 6 Hz
    double middle_db[sequential_kinds];                          ///< 1.5 to 6 Hz
    double octave_db[sequential_kinds][sequential_octave_count];
    double test_time_s[sequential_kinds];
    double amplitude_N[sequential_amplitudes];                     ///< of the scan
    double scan_db[sequential_kinds][sequential_amplitudes];       ///< all lines
    double scan_above_db[sequential_kinds][sequential_amplitudes]; ///< above 6 Hz
    double carried_distortion_db[sequential_lines];                ///< of the dwell: 10 s to settle, upwards
    double settled_distortion_db[sequential_lines];                ///< 50 s, each tone from rest
};

/// Writes the page. Returns 0, or -1 if the file cannot be written.
int sequential_page_write(const char *path, const struct sequential_results *results);

#endif
