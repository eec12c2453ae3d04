/* SPDX-License-Identifier: MIT */
#include "lab/tune/resonance.h"

#include "lab/numeric/least_squares.h"

#include <complex.h>
#include <math.h>
#include <stdlib.h>

static const double prominence_least_db = 3.0;
static const double damping_least = 1e-3;

enum { side_lines_least = 3, side_lines_most = 30, unknowns = 4, refinements = 4 };

/// |G| in dB as the lines give it, and what it is at least and at most; for valleys everything upside down.
struct levels {
    double *memory, *middle_db, *low_db, *high_db;
};

static bool levels_init(struct levels *self, const struct tune_plant *plant)
{
    // Beyond four standard deviations a line lies by chance once in e^16.
    const double sure = 4.0;
    self->memory = malloc(3 * plant->count * sizeof *self->memory);
    if (!self->memory) {
        return false;
    }
    self->middle_db = self->memory;
    self->low_db = self->memory + plant->count;
    self->high_db = self->memory + 2 * plant->count;
    for (size_t k = 0; k < plant->count; k++) {
        const double magnitude = cabs(plant->response[k]), reach = sure * plant->std[k];
        self->middle_db[k] = 20.0 * log10(magnitude);
        self->low_db[k] = 20.0 * log10(fmax(magnitude - reach, 0.0)); // minus infinity where it may be nothing
        self->high_db[k] = 20.0 * log10(magnitude + reach);
    }
    return true;
}

static void levels_turn_over(struct levels *self, size_t count)
{
    double *const low_db = self->low_db;
    self->low_db = self->high_db;
    self->high_db = low_db;
    for (size_t k = 0; k < 3 * count; k++) {
        self->memory[k] = -self->memory[k];
    }
}

struct peak {
    size_t line;
    double prominence_db;
};

/// Returns what a line surely stands out above the higher one of the lowest points that lie between it and a higher
/// line, one on each side; to an end of the data counts too.
static double find_prominence(const struct levels *levels, size_t count, size_t line)
{
    const double top_db = levels->middle_db[line];
    double left = INFINITY, right = INFINITY;
    for (size_t k = line; k-- > 0 && levels->middle_db[k] <= top_db;) {
        left = fmin(left, levels->high_db[k]);
    }
    for (size_t k = line + 1; k < count && levels->middle_db[k] <= top_db; k++) {
        right = fmin(right, levels->high_db[k]);
    }
    return levels->low_db[line] - fmax(left, right);
}

/// The most prominent of lines [0, end); prominence 0 if there is none.
static struct peak find_peak(const struct levels *levels, size_t count, size_t end)
{
    struct peak best = {0, 0.0};
    for (size_t k = 1; k + 1 < count && k < end; k++) {
        const double prominence_db = find_prominence(levels, count, k);
        if (isfinite(prominence_db) && prominence_db > best.prominence_db) {
            best = (struct peak){k, prominence_db};
        }
    }
    return best;
}

struct window {
    size_t first, count;
};

/// The lines around a peak down to a fifth of its height or the next valley, but some on each side.
static struct window find_window(const double *level_db, size_t count, size_t line)
{
    const double reach_db = 14.0;
    size_t first = line, last = line;
    while (first > 0 && line - first < side_lines_most &&
           (line - first < side_lines_least ||
            (level_db[first - 1] < level_db[first] && level_db[first] > level_db[line] - reach_db))) {
        first--;
    }
    while (last + 1 < count && last - line < side_lines_most &&
           (last - line < side_lines_least ||
            (level_db[last + 1] < level_db[last] && level_db[last] > level_db[line] - reach_db))) {
        last++;
    }
    return (struct window){first, last - first + 1};
}

/// One complex column of a real least-squares problem: real and imaginary part of its coefficient.
static void set_pair(double *matrix, size_t rows, size_t row, size_t unknown, double complex factor)
{
    double *real_part = matrix + 2 * unknown * rows, *imag_part = real_part + rows;
    real_part[row] = creal(factor);
    real_part[row + 1] = cimag(factor);
    imag_part[row] = -cimag(factor);
    imag_part[row + 1] = creal(factor);
}

/// Fits one pole near line `centre`; `inverse`: one zero instead.
static bool fit_pole(const struct tune_plant *plant, struct window window, size_t centre, bool inverse,
                     double *out_frequency_hz, double *out_damping)
{
    const size_t rows = 2 * window.count;
    double *work = malloc((rows * 2 * unknowns + rows) * sizeof *work);
    if (!work) {
        return false;
    }
    double *matrix = work, *target = work + rows * 2 * unknowns, solution[2 * unknowns];
    const double f0 = plant->frequency_hz[centre];
    double complex pole = -0.05;
    bool solved = true;
    for (int pass = 0; pass < refinements && solved; pass++) {
        for (size_t i = 0; i < window.count; i++) {
            const size_t k = window.first + i;
            const double complex x = I * (plant->frequency_hz[k] - f0) / f0;
            const double complex response = inverse ? 1.0 / plant->response[k] : plant->response[k];
            const double weight = 1.0 / (cabs(x - pole) * cabs(response));
            set_pair(matrix, rows, 2 * i, 0, weight * response);
            set_pair(matrix, rows, 2 * i, 1, weight);
            set_pair(matrix, rows, 2 * i, 2, weight * x);
            set_pair(matrix, rows, 2 * i, 3, weight * x * x);
            target[2 * i] = creal(weight * x * response);
            target[2 * i + 1] = cimag(weight * x * response);
        }
        solved = least_squares_solve(rows, (size_t)2 * unknowns, matrix, target, NULL, NULL, solution, NULL);
        pole = solved ? solution[0] + solution[1] * I : pole;
    }
    free(work);
    const double complex s = I + pole; // over w0
    *out_frequency_hz = f0 * cabs(s);
    *out_damping = fmax(-creal(s) / cabs(s), damping_least);
    return solved;
}

/// Frequency and damping of a peak; where the fit fails or leads away, those of the line itself.
static void measure(const struct tune_plant *plant, const double *level_db, struct peak peak, bool inverse,
                    double *out_frequency_hz, double *out_damping)
{
    const struct window window = find_window(level_db, plant->count, peak.line);
    const double first_hz = plant->frequency_hz[window.first];
    const double last_hz = plant->frequency_hz[window.first + window.count - 1];
    if (!fit_pole(plant, window, peak.line, inverse, out_frequency_hz, out_damping) ||
        !(*out_frequency_hz >= first_hz && *out_frequency_hz <= last_hz && *out_damping < 1.0)) {
        const double usual_damping = 0.05;
        *out_frequency_hz = plant->frequency_hz[peak.line];
        *out_damping = usual_damping;
    }
}

bool resonance_find(const struct tune_plant *plant, struct resonance *out_resonance)
{
    struct levels levels;
    *out_resonance = (struct resonance){.found = false};
    if (!levels_init(&levels, plant)) {
        return false;
    }
    const struct peak top = find_peak(&levels, plant->count, plant->count);
    if (top.prominence_db >= prominence_least_db) {
        out_resonance->found = true;
        out_resonance->prominence_db = top.prominence_db;
        measure(plant, levels.middle_db, top, false, &out_resonance->frequency_hz, &out_resonance->damping);
        levels_turn_over(&levels, plant->count);
        const struct peak valley = find_peak(&levels, plant->count, top.line);
        out_resonance->has_antiresonance = valley.prominence_db >= prominence_least_db;
        if (out_resonance->has_antiresonance) {
            measure(plant, levels.middle_db, valley, true, &out_resonance->antiresonance_hz,
                    &out_resonance->antiresonance_damping);
        }
    }
    free(levels.memory);
    return true;
}
