/* SPDX-License-Identifier: MIT */
#include "lab/tune/margins.h"

#include "lab/tune/gap.h"

#include <math.h>
#include <stdbool.h>

static const double degrees_per_rad = 57.29577951308232;

static double decibel(double magnitude)
{
    return 20.0 * log10(magnitude);
}

/// The frequency at a share of the way between two lines, on a logarithmic axis.
static double between(const double *frequency_hz, size_t k, double share)
{
    return frequency_hz[k] * pow(frequency_hz[k + 1] / frequency_hz[k], share);
}

/// Whether nothing is known between two lines: a curve drawn across would be made up.
static bool is_gap(const double *frequency_hz, size_t k)
{
    return frequency_hz[k + 1] > GAP_RATIO_MOST * frequency_hz[k];
}

/// |L| falls or rises through 1 between lines k and k + 1.
static void take_crossover(const double *frequency_hz, const double complex *loop, size_t k, struct margins *io)
{
    const double before = log(cabs(loop[k])), after = log(cabs(loop[k + 1]));
    if ((before > 0.0) == (after > 0.0)) {
        return;
    }
    const double share = before / (before - after);
    const double hz = between(frequency_hz, k, share);
    const double phase_deg = degrees_per_rad * (carg(loop[k]) + share * carg(loop[k + 1] / loop[k]));
    const double above_deg = phase_deg + 180.0 - 360.0 * floor((phase_deg + 180.0) / 360.0); // 0 .. 360
    const double margin_deg = fmin(above_deg, 360.0 - above_deg);
    if (!(margin_deg >= io->phase_deg)) {
        io->phase_deg = margin_deg;
        io->phase_hz = hz;
    }
    const double delay_s = above_deg / 360.0 / hz;
    if (!(delay_s >= io->delay_s)) {
        io->delay_s = delay_s;
    }
    if (before > 0.0) {
        io->crossover_hz = hz;
    }
}

/// L crosses the negative real axis between lines k and k + 1.
static void take_axis(const double *frequency_hz, const double complex *loop, size_t k, struct margins *io)
{
    const double before = carg(-loop[k]), step = carg(loop[k + 1] / loop[k]), after = before + step;
    if ((before > 0.0) == (after > 0.0) || before == after) {
        return;
    }
    const double share = before / (before - after);
    const double gain_db = (1.0 - share) * decibel(cabs(loop[k])) + share * decibel(cabs(loop[k + 1]));
    const double hz = between(frequency_hz, k, share);
    if (gain_db < 0.0 && !(-gain_db >= io->gain_db)) {
        io->gain_db = -gain_db;
        io->gain_hz = hz;
    }
    if (gain_db >= 0.0 && !(-gain_db <= io->gain_reduction_db)) {
        io->gain_reduction_db = -gain_db;
        io->gain_reduction_hz = hz;
    }
}

/// Crossings of -3 dB that follow each other closely: of a noisy curve, one and the same.
struct crossings {
    size_t count;
    double first_hz, last_hz, log_sum;
};

/// Noise crosses an odd number of times, so that the curve is on the other side in the end: their middle counts. After
/// an even number it is not: a narrow dip, whose beginning counts.
static void close_crossings(struct crossings *io_crossings, struct margins *io)
{
    if (io_crossings->count > 0) {
        const bool fell = io_crossings->count % 2 == 1;
        io->last_cutoff_hz = fell ? exp(io_crossings->log_sum / (double)io_crossings->count) : io_crossings->first_hz;
        io->cutoff_hz = isnan(io->cutoff_hz) ? io->last_cutoff_hz : io->cutoff_hz;
    }
    io_crossings->count = 0;
}

static void add_crossing(double hz, bool falling, struct crossings *io_crossings, struct margins *io)
{
    const double close = 1.1;
    if (io_crossings->count > 0 && hz > close * io_crossings->last_hz) {
        close_crossings(io_crossings, io);
    }
    if (io_crossings->count == 0) {
        if (!falling) {
            return;
        }
        *io_crossings = (struct crossings){.first_hz = hz};
    }
    io_crossings->count++;
    io_crossings->last_hz = hz;
    io_crossings->log_sum += log(hz);
}

static void find_cutoffs(size_t count, const double *frequency_hz, const double complex *loop, struct margins *io)
{
    const double half_power_db = -10.0 * log10(2.0);
    struct crossings crossings = {.count = 0};
    double before = NAN;
    for (size_t k = 0; k < count; k++) {
        const double after = decibel(cabs(loop[k] / (1.0 + loop[k]))) - half_power_db;
        if (k > 0 && !is_gap(frequency_hz, k - 1) && (before >= 0.0) != (after >= 0.0)) {
            add_crossing(between(frequency_hz, k - 1, before / (before - after)), after < 0.0, &crossings, io);
        }
        before = after;
    }
    close_crossings(&crossings, io);
}

void margins_find(size_t count, const double *frequency_hz, const double complex *loop, struct margins *out_margins)
{
    *out_margins = (struct margins){NAN, NAN, NAN, NAN, NAN, NAN, NAN, 0.0, NAN, NAN, NAN, NAN};
    for (size_t k = 0; k < count; k++) {
        const double sensitivity = 1.0 / cabs(1.0 + loop[k]);
        if (sensitivity > out_margins->modulus) {
            out_margins->modulus = sensitivity;
            out_margins->modulus_hz = frequency_hz[k];
        }
        if (k + 1 < count && !is_gap(frequency_hz, k)) {
            take_crossover(frequency_hz, loop, k, out_margins);
            take_axis(frequency_hz, loop, k, out_margins);
        }
    }
    find_cutoffs(count, frequency_hz, loop, out_margins);
}
