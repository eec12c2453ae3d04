/* SPDX-License-Identifier: MIT */
#include "lab/estimate/frf_h1.h"

#include "lab/estimate/circle.h"
#include "lab/estimate/method.h"
#include "lab/estimate/ratio.h"
#include "lab/estimate/resolution.h"
#include "lab/estimate/segments.h"

#include <math.h>

/// Less than this share of the strongest line's power is rounding.
static const double rounding_power = 1e-24;

int frf_h1_estimate(const struct periodic *recording, const struct estimate_options *options, struct frf *out_frf,
                    struct error *out_error)
{
    (void)options;
    size_t rows = recording->used;
    const struct ratio_spectra spectra = {.input = recording->input_spectra,
                                          .output = recording->output_spectra,
                                          .instrument = recording->input_spectra,
                                          .rows = rows,
                                          .stride = recording->bin_count,
                                          .independent = (double)rows};
    int status = estimate_begin(recording, "h1", 2.0 * (double)(rows - 1), out_frf, out_error);
    for (size_t line = 0; line < recording->bin_count && !status; line++) {
        struct circle input = circle_of_column(spectra.input, rows, spectra.stride, line);
        struct ratio ratio = ratio_of_line(&spectra, line);
        if (circle_chance_of_zero(&input) < estimate_chance_of_dead_line) {
            estimate_set_line(out_frf, line, ratio.response, sqrt(ratio.variance));
            out_frf->coherence[line] = ratio.coherence;
        }
    }
    status = status ? status : estimate_end(recording, out_frf, out_error);
    if (!status && !estimate_warn_of_feedback(recording->reference, out_frf)) {
        status = estimate_refuse_memory(out_frf, out_error);
    }
    return status;
}

static void estimate_lines(const struct ratio_spectra *spectra, struct frf *io_frf)
{
    double strongest = 0.0;
    for (size_t line = 0; line < io_frf->count; line++) {
        strongest = fmax(strongest, ratio_of_line(spectra, line).input_power);
    }
    for (size_t line = 0; line < io_frf->count; line++) {
        struct ratio ratio = ratio_of_line(spectra, line);
        if (ratio.input_power > rounding_power * strongest) {
            estimate_set_line(io_frf, line, ratio.response, sqrt(ratio.variance));
            io_frf->coherence[line] = ratio.coherence;
        }
    }
}

int frf_h1_estimate_arbitrary(const struct arbitrary *recording, const struct estimate_options *options,
                              struct frf *out_frf, struct error *out_error)
{
    struct segments segments;
    int status = segments_transform(recording, options ? options->segment_samples : 0, &segments, out_error);
    if (status) {
        return status;
    }
    const struct ratio_spectra spectra = {.input = segments.input,
                                          .output = segments.output,
                                          .instrument = segments.input,
                                          .rows = segments.count,
                                          .stride = segments.lines,
                                          .independent = segments.independent};
    status = estimate_begin_arbitrary(recording, "h1", 2.0 * (segments.independent - 1.0), segments.lines,
                                      recording->run->sample_rate_hz / (double)segments.samples, out_frf, out_error);
    if (!status) {
        estimate_lines(&spectra, out_frf);
        status = estimate_end_arbitrary(recording, out_frf, out_error);
    }
    if (!status) {
        /* Against the input itself, as this method has it. */
        struct arbitrary open = *recording;
        open.reference = NULL;
        status = resolution_enlarge(&open, &spectra, out_frf, out_error);
    }
    if (!status && !(estimate_set_key(out_frf, "segment_samples", "%zu", segments.samples) &&
                     estimate_set_key(out_frf, "segments", "%zu", segments.count) &&
                     estimate_warn_of_feedback(recording->reference, out_frf))) {
        status = estimate_refuse_memory(out_frf, out_error);
    }
    segments_free(&segments);
    return status;
}
