/* SPDX-License-Identifier: MIT */
#include "lab/estimate/frf_indirect.h"

#include "lab/estimate/method.h"
#include "lab/estimate/ratio.h"
#include "lab/estimate/resolution.h"
#include "lab/estimate/segments.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static int check_reference(const struct run *run, const char *reference, const char *input, struct error *out_error)
{
    if (!reference) {
        return error_set(out_error, error_refused,
                         "%s: method indirect divides by the signal that excites the loop: no column "
                         "velocity_ref_rad_per_s, position_ref_rad, torque_ref_Nm, current_ref_A or the like that "
                         "changes, say --reference COLUMN",
                         run->path);
    }
    if (strcmp(reference, input) == 0) {
        return error_set(out_error, error_refused,
                         "%s: reference and input are both %s: expected the signal that excites the loop from outside, "
                         "see --reference",
                         run->path, input);
    }
    return 0;
}

static void estimate_lines(const struct ratio_spectra *spectra, struct frf *io_frf)
{
    for (size_t line = 0; line < io_frf->count; line++) {
        struct ratio ratio = ratio_of_line(spectra, line);
        if (ratio.chance_of_no_power < estimate_chance_of_dead_line) {
            estimate_set_line(io_frf, line, ratio.response, sqrt(ratio.variance));
            io_frf->coherence[line] = ratio.coherence;
        }
    }
}

static int set_reference(const char *reference, struct frf *io_frf, struct error *out_error)
{
    bool set = estimate_set_key(io_frf, "reference", "%s", reference) && estimate_warn_of_reference(reference, io_frf);
    return set ? 0 : estimate_refuse_memory(io_frf, out_error);
}

int frf_indirect_estimate(const struct periodic *recording, const struct estimate_options *options, struct frf *out_frf,
                          struct error *out_error)
{
    (void)options;
    size_t rows = recording->used;
    int status = check_reference(recording->run, recording->reference, recording->input, out_error);
    status = status ? status : estimate_begin(recording, "indirect", 2.0 * (double)(rows - 1), out_frf, out_error);
    if (status) {
        return status;
    }
    double complex *reference = malloc(rows * recording->bin_count * sizeof *reference);
    if (!reference || !periodic_transform_used(recording, recording->reference, reference)) {
        free(reference);
        return estimate_refuse_memory(out_frf, out_error);
    }
    const struct ratio_spectra spectra = {.input = recording->input_spectra,
                                          .output = recording->output_spectra,
                                          .instrument = reference,
                                          .rows = rows,
                                          .stride = recording->bin_count,
                                          .independent = (double)rows};
    estimate_lines(&spectra, out_frf);
    free(reference);
    status = estimate_end(recording, out_frf, out_error);
    return status ? status : set_reference(recording->reference, out_frf, out_error);
}

int frf_indirect_estimate_arbitrary(const struct arbitrary *recording, const struct estimate_options *options,
                                    struct frf *out_frf, struct error *out_error)
{
    struct segments segments;
    int status = check_reference(recording->run, recording->reference, recording->input, out_error);
    status =
        status ? status : segments_transform(recording, options ? options->segment_samples : 0, &segments, out_error);
    if (status) {
        return status;
    }
    const struct ratio_spectra spectra = {.input = segments.input,
                                          .output = segments.output,
                                          .instrument = segments.reference,
                                          .rows = segments.count,
                                          .stride = segments.lines,
                                          .independent = segments.independent};
    status = estimate_begin_arbitrary(recording, "indirect", 2.0 * (segments.independent - 1.0), segments.lines,
                                      recording->run->sample_rate_hz / (double)segments.samples, out_frf, out_error);
    if (!status) {
        estimate_lines(&spectra, out_frf);
        status = estimate_end_arbitrary(recording, out_frf, out_error);
    }
    status = status ? status : resolution_enlarge(recording, &spectra, out_frf, out_error);
    if (!status && !(estimate_set_key(out_frf, "segment_samples", "%zu", segments.samples) &&
                     estimate_set_key(out_frf, "segments", "%zu", segments.count))) {
        status = estimate_refuse_memory(out_frf, out_error);
    }
    segments_free(&segments);
    return status ? status : set_reference(recording->reference, out_frf, out_error);
}
