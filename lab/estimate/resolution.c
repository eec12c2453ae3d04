/* SPDX-License-Identifier: MIT */
#include "lab/estimate/resolution.h"

#include "lab/estimate/frf_lpm_arbitrary.h"
#include "lab/estimate/method.h"
#include "lab/numeric/cmplx.h"

#include <complex.h>
#include <math.h>
#include <stdlib.h>

enum { polynomial_dof = 9 }; ///< complex, of one line of the local polynomials

/// -log of the chance that noise moves a line and one beside it as far from the local polynomials: by itself, and where
/// the response curves by half of its noise from line to line.
static const double clear_evidence = 9.0;
static const double evidence_on_curve = 4.0;
static const double clear_curvature = 0.5;
static const double told_ratio = 3.0;

/// Output and input over the instrument, line by line.
struct transfers {
    double complex *output;
    double complex *input;
};

static bool measure_transfers(const struct ratio_spectra *spectra, size_t lines, struct transfers *out)
{
    out->output = calloc(2 * lines, sizeof *out->output);
    out->input = out->output ? out->output + lines : NULL;
    for (size_t k = 0; k < lines && out->output; k++) {
        double size = 0.0;
        for (size_t m = 0; m < spectra->rows; m++) {
            const size_t i = m * spectra->stride + k;
            const double complex mirrored = conj(spectra->instrument[i]);
            size += creal(spectra->instrument[i] * mirrored);
            out->output[k] += spectra->output[i] * mirrored;
            out->input[k] += spectra->input[i] * mirrored;
        }
        out->output[k] /= size > 0.0 ? size : 1.0;
        out->input[k] /= size > 0.0 ? size : 1.0;
    }
    return out->output != NULL;
}

/// What the window moves line k by, as long as the lines resolve the curve; nothing at the ends.
static double curvature_at(const struct transfers *transfers, const struct frf *frf, size_t k)
{
    const double complex response = CMPLX(frf->real[k], frf->imag[k]);
    double complex second = 0.0;
    for (size_t j = k - 1; k > 0 && k + 1 < frf->count && j <= k + 1; j++) {
        second += (j == k ? -2.0 : 1.0) * (transfers->output[j] - response * transfers->input[j]);
    }
    return cabs(second / (6.0 * transfers->input[k]));
}

/// Each line's |D|^2 over the noise of both; 0 where there is nothing to compare.
static void compare(const struct frf *frf, const double complex *responses, const double *stds, double *out_ratios)
{
    for (size_t k = 0; k < frf->count; k++) {
        const double noise = hypot(frf->std[k], stds[k]);
        const double difference = cabs(CMPLX(frf->real[k], frf->imag[k]) - responses[k]);
        const bool both = frf->valid[k] && isfinite(noise) && noise > 0.0;
        out_ratios[k] = both ? difference * difference / (noise * noise) : 0.0;
    }
}

static double evidence_of(double ratio)
{
    return polynomial_dof * log1p(ratio / polynomial_dof);
}

static bool is_moved(const struct transfers *transfers, const struct frf *frf, const double *ratios, size_t k)
{
    const double before = k > 0 ? evidence_of(ratios[k - 1]) : 0.0;
    const double behind = k + 1 < frf->count ? evidence_of(ratios[k + 1]) : 0.0;
    const double evidence = evidence_of(ratios[k]) + fmax(before, behind);
    return ratios[k] > 1.0 &&
           (evidence > clear_evidence ||
            (evidence > evidence_on_curve && curvature_at(transfers, frf, k) > clear_curvature * frf->std[k]));
}

static bool warn(size_t moved, size_t worst, double largest, struct frf *io_frf)
{
    return moved == 0 ||
           estimate_set_key(io_frf, "warning_resolution",
                            "segments are too short for a resonance: they move %zu of %zu lines, the one at %.6g Hz by "
                            "about %.2g times its noise, and std holds an estimate of that; method lpm, or a longer "
                            "--segment, resolves it",
                            moved, io_frf->count, io_frf->frequency_hz[worst], largest);
}

/// `ratios` and `moved_by` are work space of one number for each line.
static bool enlarge(const struct transfers *transfers, const double *stds, const double *ratios, double *moved_by,
                    struct frf *io_frf)
{
    size_t moved = 0;
    size_t worst = 0;
    double largest = 0.0;
    for (size_t k = 0; k < io_frf->count; k++) {
        const double noise = hypot(io_frf->std[k], stds[k]);
        moved_by[k] = is_moved(transfers, io_frf, ratios, k) ? noise * sqrt(ratios[k] - 1.0) : 0.0;
    }
    for (size_t k = 0; k < io_frf->count; k++) {
        const double times = moved_by[k] > 0.0 ? moved_by[k] / io_frf->std[k] : 0.0;
        moved += times > told_ratio;
        worst = times > largest ? k : worst;
        largest = fmax(largest, times);
        if (moved_by[k] > 0.0) {
            io_frf->std[k] = hypot(io_frf->std[k], moved_by[k]);
        }
    }
    return warn(moved, worst, largest, io_frf);
}

int resolution_enlarge(const struct arbitrary *recording, const struct ratio_spectra *spectra, struct frf *io_frf,
                       struct error *out_error)
{
    const size_t lines = io_frf->count;
    struct transfers transfers;
    double complex *responses = malloc(lines * sizeof *responses);
    double *stds = malloc(3 * lines * sizeof *stds);
    bool done = measure_transfers(spectra, lines, &transfers) && responses && stds &&
                frf_lpm_arbitrary_at(recording, io_frf->frequency_hz, lines, responses, stds);
    if (done) {
        compare(io_frf, responses, stds, stds + lines);
        done = enlarge(&transfers, stds, stds + lines, stds + 2 * lines, io_frf);
    }
    free(transfers.output);
    free(responses);
    free(stds);
    return done ? 0 : estimate_refuse_memory(io_frf, out_error);
}
