/* SPDX-License-Identifier: MIT */
#include "lab/design/start_phase.h"

#include <math.h>

size_t design_start_phase_paper(size_t samples, const double *velocity_rad_per_s, const double *acceleration_rad_per_s2)
{
    size_t best = 0;
    double least = INFINITY;
    for (size_t n = 0; n < samples; n++) {
        size_t next = n + 1 < samples ? n + 1 : 0;
        double here = velocity_rad_per_s[n];
        double there = velocity_rad_per_s[next];
        if ((here > 0) == (there > 0)) {
            continue;
        }
        size_t nearer = fabs(here) <= fabs(there) ? n : next;
        if (fabs(acceleration_rad_per_s2[nearer]) < least) {
            least = fabs(acceleration_rad_per_s2[nearer]);
            best = nearer;
        }
    }
    return best;
}
