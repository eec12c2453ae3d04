/* SPDX-License-Identifier: MIT */
#include "lab/tune/hold.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double pi = 3.141592653589793;

/// The hold of one sample, over its length: 1 at 0 Hz.
static double complex hold_at(double frequency_hz, double rate_hz)
{
    const double x = pi * frequency_hz / rate_hz;
    return sin(x) / x * cexp(-I * x);
}

/// The response between lines.
struct sight {
    bool known;
    double complex value; ///< where it is not known: no more than this in magnitude
    double std;
};

/// Between neighbouring lines log |G| and phase are straight; into a gap and beyond the last line no more is said than
/// how large it may be.
static struct sight look(const struct tune_plant *plant, const double complex *response, double frequency_hz)
{
    const double ratio_most = 1.3;
    const double *f = plant->frequency_hz;
    size_t low = 0, high = plant->count - 1;
    if (!(frequency_hz >= f[0] && frequency_hz <= f[high])) {
        const size_t end = frequency_hz < f[0] ? 0 : high;
        const double farther = fmax(f[end] / frequency_hz, 1.0); // below the lowest line it rises
        return (struct sight){false, cabs(response[end]) * farther, plant->std[end]};
    }
    while (high - low > 1) {
        const size_t middle = (low + high) / 2;
        *(f[middle] <= frequency_hz ? &low : &high) = middle;
    }
    if (f[high] > ratio_most * f[low]) {
        return (struct sight){false, fmax(cabs(response[low]), cabs(response[high])), plant->std[low]};
    }
    const double share = (frequency_hz - f[low]) / (f[high] - f[low]);
    // What was put back turns by a known angle, of which the lines show no full turns.
    const double turn = -2.0 * pi * (f[high] - f[low]) * plant->delay_removed_s;
    const double complex step = clog(response[high] / response[low] * cexp(-I * turn)) + I * turn;
    return (struct sight){true, response[low] * cexp(share * step), fmax(plant->std[low], plant->std[high])};
}

/// One line of a controller that is `slower` times slower than the recording.
static void fold(struct tune_plant *io_plant, const double complex *response, const double *std, size_t line,
                 int slower)
{
    const double f0 = io_plant->response_rate_hz, rate_hz = f0 / slower;
    double complex sum = 0.0;
    double square = 0.0;
    for (int k = 0; k < slower; k++) {
        const double v = io_plant->frequency_hz[line] + k * rate_hz;
        const double complex held =
            (1.0 - cexp(-2.0 * pi * I * v / rate_hz)) / (slower * (1.0 - cexp(-2.0 * pi * I * v / f0)));
        struct sight seen = {true, response[line], std[line]};
        if (k > 0) {
            seen = look(io_plant, response, v <= 0.5 * f0 ? v : f0 - v);
            seen.value = v <= 0.5 * f0 ? seen.value : conj(seen.value);
        }
        if (seen.known) {
            sum += held * seen.value;
            square += cabs(held) * cabs(held) * seen.std * seen.std;
        } else {
            io_plant->doubt[line] += cabs(held) * cabs(seen.value);
        }
    }
    io_plant->response[line] = sum;
    io_plant->std[line] = sqrt(square);
}

/// The largest f |P| from a frequency on, P the response without its hold; at least that of the last line.
static double find_envelope(const struct tune_plant *plant, const double complex *response, double from_hz,
                            double hold_rate_hz)
{
    double envelope = 0.0;
    for (size_t k = plant->count; k-- > 0 && (plant->frequency_hz[k] >= from_hz || k + 1 == plant->count);) {
        const double f = plant->frequency_hz[k];
        const double hold = hold_rate_hz > 0.0 ? cabs(hold_at(f, hold_rate_hz)) : 1.0;
        envelope = fmax(envelope, f * cabs(response[k]) / hold);
    }
    return envelope;
}

/// What sampling folds onto a line, behind the hold of the same rate, where |P| <= envelope/f: the sum over all k but
/// 0 of envelope f/(f + k rate)^2 |H(f)|/f, of which the sum over 1/(f + k rate)^2 is pi^2/(rate sin)^2 less 1/f^2.
static double folded(double frequency_hz, double rate_hz, double envelope)
{
    const double x = pi * frequency_hz / rate_hz, rest = x / sin(x);
    return envelope / frequency_hz * cabs(hold_at(frequency_hz, rate_hz)) * (rest * rest - 1.0);
}

static void replace(struct tune_plant *io_plant, const double complex *response, const double *std, size_t line,
                    double old_rate_hz, const double envelope[2])
{
    const double f = io_plant->frequency_hz[line];
    const double complex hold = hold_at(f, io_plant->rate_hz);
    const double complex quotient = old_rate_hz > 0.0 ? hold / hold_at(f, old_rate_hz) : hold;
    io_plant->response[line] = response[line] * quotient;
    io_plant->std[line] = std[line] * cabs(quotient);
    io_plant->doubt[line] += folded(f, io_plant->rate_hz, envelope[1]);
    if (old_rate_hz > 0.0) {
        io_plant->doubt[line] += folded(f, old_rate_hz, envelope[0]) * cabs(quotient);
    }
}

bool hold_carry(struct tune_plant *io_plant)
{
    const bool band_limited = io_plant->band_limited;
    const size_t count = io_plant->count;
    const double quotient = io_plant->response_rate_hz / io_plant->rate_hz, slower = round(quotient);
    const double old_rate_hz = band_limited ? 0.0 : io_plant->response_rate_hz;
    const bool whole = !band_limited && slower >= 2.0 && fabs(quotient / slower - 1.0) < HOLD_SAME_RATE;
    double complex *response = malloc((count + 1) * sizeof *response);
    double *std = malloc((count + 1) * sizeof *std);
    if (response && std && count > 0) {
        memcpy(response, io_plant->response, count * sizeof *response);
        memcpy(std, io_plant->std, count * sizeof *std);
        const double envelope[2] = {find_envelope(io_plant, response, 0.5 * io_plant->response_rate_hz, old_rate_hz),
                                    find_envelope(io_plant, response, 0.5 * io_plant->rate_hz, old_rate_hz)};
        for (size_t line = 0; line < count && io_plant->frequency_hz[line] < 0.5 * io_plant->rate_hz; line++) {
            if (whole) {
                fold(io_plant, response, std, line, (int)slower);
            } else {
                replace(io_plant, response, std, line, old_rate_hz, envelope);
            }
        }
        io_plant->carried = true;
    }
    const bool done = response && std;
    free(response);
    free(std);
    return done;
}
