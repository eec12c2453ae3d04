/* SPDX-License-Identifier: MIT */
#include "lab/estimate/difference.h"

#include "lab/numeric/statistics.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static const double same_frequency = 1e-4;

double difference_chance(double degrees_of_freedom)
{
    return degrees_of_freedom > 0.0 ? statistics_f_tail(4.0, 2.0, degrees_of_freedom) : exp(-4.0);
}

/// One line that both have; `ratios_db` gains a number where neither is 0. Returns the distance over 2 std, or NaN.
static double compare(const struct frf *first, size_t i, const struct frf *other, size_t k, double *ratios_db,
                      size_t *io_ratios)
{
    const double ratio_db = 20.0 * log10(hypot(other->real[k], other->imag[k]) / hypot(first->real[i], first->imag[i]));
    const bool known = frf_known(first->std[i]) && frf_known(other->std[k]);
    const double std = known ? hypot(first->std[i], other->std[k]) : 0.0;
    if (isfinite(ratio_db)) {
        ratios_db[(*io_ratios)++] = ratio_db;
    }
    return std > 0.0 ? hypot(other->real[k] - first->real[i], other->imag[k] - first->imag[i]) / (2.0 * std) : NAN;
}

static void note(double over_two_std, double frequency_hz, struct difference *io)
{
    io->common++;
    if (isnan(over_two_std)) {
        return;
    }
    io->compared++;
    io->beyond += over_two_std > 1.0;
    if (over_two_std > io->worst || io->compared == 1) {
        io->worst = over_two_std;
        io->worst_hz = frequency_hz;
    }
}

bool difference_measure(const struct frf *first, const struct frf *other, double *out_over_two_std,
                        struct difference *out)
{
    double *ratios_db = malloc((other->count + 1) * sizeof *ratios_db);
    size_t ratios = 0;
    size_t i = 0;
    *out = (struct difference){.middle_db = NAN};
    if (!ratios_db) {
        return false;
    }
    for (size_t k = 0; k < other->count; k++) { // both ascend
        const double frequency_hz = other->frequency_hz[k];
        double over_two_std = NAN;
        while (i < first->count && first->frequency_hz[i] < frequency_hz * (1.0 - same_frequency)) {
            i++;
        }
        const bool found = i < first->count && first->frequency_hz[i] <= frequency_hz * (1.0 + same_frequency);
        if (found && first->valid[i] && other->valid[k]) {
            over_two_std = compare(first, i, other, k, ratios_db, &ratios);
            note(over_two_std, frequency_hz, out);
        }
        if (out_over_two_std) {
            out_over_two_std[k] = over_two_std;
        }
    }
    out->middle_db = ratios > 0 ? statistics_median(ratios_db, ratios) : NAN;
    const double dof[2] = {first->degrees_of_freedom, other->degrees_of_freedom};
    out->chance = difference_chance(dof[0] > 0.0 && dof[1] > 0.0 ? dof[0] + dof[1] : 0.0);
    free(ratios_db);
    return true;
}

/// "lies 0.12 dB higher than a.csv (median of 250 lines in common)".
static void say_level(const struct difference *self, const char *first_name, char *out_text, size_t size)
{
    char of[64] = "the one line in common";
    if (self->common != 1) {
        snprintf(of, sizeof of, "median of %zu lines in common", self->common);
    }
    if (isfinite(self->middle_db)) {
        snprintf(out_text, size, "lies %.2g dB %s than %s (%s)", fabs(self->middle_db),
                 self->middle_db < 0.0 ? "lower" : "higher", first_name, of);
    } else {
        snprintf(out_text, size, "has %zu line%s in common with %s", self->common, self->common == 1 ? "" : "s",
                 first_name);
    }
}

void difference_say(const struct difference *self, const char *first_name, char *out_text, size_t size)
{
    char level[320];
    say_level(self, first_name, level, sizeof level);
    if (self->common == 0) {
        snprintf(out_text, size, "has no line in common with %s.", first_name);
    } else if (self->compared == 0) {
        snprintf(out_text, size, "%s; without standard deviations nothing says whether that is noise.", level);
    } else {
        snprintf(
            out_text, size,
            "%s. They are more than 2 std of the difference apart at %zu of %zu lines, where noise alone would put "
            "about %.2g %%; furthest at %.4g Hz, %.3g times 2 std.",
            level, self->beyond, self->compared, 100.0 * self->chance, self->worst_hz, self->worst);
    }
}
