/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/inertia_guess.h"

#include <math.h>

struct inertia_guess inertia_guess_make(const struct recording *r)
{
    const struct stretch *b = &r->block;
    const double little = 0.01;
    size_t reach = b->samples / (8 * r->bins[r->bin_count / 2]);
    reach = reach < 1 ? 1 : reach;
    double ta = 0.0, aa = 0.0, tt = 0.0, mean = 0.0, sum = 0.0;
    for (size_t n = 0; n < b->samples; n++)
        mean += b->torque[n] / (double)b->samples;
    for (size_t n = 0; n < b->samples; n++) {
        sum += b->torque[n] - mean;
        if (n < 2 * reach)
            continue;
        double change = b->velocity[n] - b->velocity[n - 2 * reach], a = change * r->rate_hz / (2.0 * (double)reach);
        double t = (sum - 0.5 * (b->torque[n] + b->torque[n - 2 * reach]) + mean) / (2.0 * (double)reach);
        ta += a * t;
        aa += a * a;
        tt += t * t;
        sum -= b->torque[n - 2 * reach] - mean;
    }
    // Where nothing accelerates at all, as in a table of places, a speed that were lost in a sample stands in for it.
    double still = 1e-6 * r->coverage.velocity_rms * r->rate_hz, any = sqrt(aa * tt);
    double acceleration = fmax(sqrt(aa / (double)b->samples), fmax(still, 1e-12));
    const double constant = 0.95, of_turn = 0.1, of_stroke = 0.02; // friction may take nearly all of a stroke's torque
    return (struct inertia_guess){.inertia = aa > 0.0 ? ta / aa : 0.0,
                                  .least = r->coverage.steadiness > constant ? of_turn : of_stroke,
                                  .correlation = any > 0.0 ? ta / any : 0.0,
                                  .negligible = little * r->coverage.torque_rms / acceleration};
}

bool inertia_guess_accelerates(const struct inertia_guess *self)
{
    return fabs(self->correlation) > self->least;
}
