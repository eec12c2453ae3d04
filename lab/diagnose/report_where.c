/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/report_where.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/// What a sample is sorted by, scaled to 0..1 over the recording.
struct scale {
    double low, high;
};

static struct scale scale_of(const double *x, size_t count)
{
    struct scale s = {INFINITY, -INFINITY};
    for (size_t i = 0; i < count; i++) {
        s.low = fmin(s.low, x[i]);
        s.high = fmax(s.high, x[i]);
    }
    return s;
}

/// The part of 0..parts-1 that a value lies in.
static size_t part_of(const struct scale *scale, double value, size_t parts)
{
    double u = (value - scale->low) / (scale->high - scale->low) * (double)parts;
    return u > 0.0 ? (size_t)fmin(u, (double)parts - 1.0) : 0;
}

static double square_at(const double *error, size_t i)
{
    return isfinite(error[i]) ? error[i] * error[i] : 0.0;
}

/// How the samples are sorted: by direction, by the size of the speed, by place, by time.
enum sorting { by_direction, by_speed, by_place, by_time, sortings };

static const size_t parts_of[sortings] = {2, 2, 3, 3};

struct sorter {
    const struct diagnosis_curves *curves;
    struct scale place;
    double fast; ///< half the highest speed
};

static size_t sort_sample(const struct sorter *s, enum sorting sorting, size_t i)
{
    const struct diagnosis_curves *c = s->curves;
    switch (sorting) {
    case by_direction:
        return c->velocity[i] < 0.0;
    case by_speed:
        return fabs(c->velocity[i]) >= s->fast;
    case by_place:
        return part_of(&s->place, c->position[i], parts_of[by_place]);
    case by_time:
    case sortings:
        break;
    }
    return i * parts_of[by_time] / c->samples;
}

static void name_part(const struct sorter *s, enum sorting sorting, size_t part, bool linear, char out_text[80])
{
    const struct diagnosis_curves *c = s->curves;
    double step = (s->place.high - s->place.low) / (double)parts_of[by_place], end = c->time_s[c->samples - 1];
    double low = s->place.low + step * (double)part, third = (end - c->time_s[0]) / (double)parts_of[by_time];
    switch (sorting) {
    case by_direction:
        snprintf(out_text, 80, "moving %s", part ? "backward" : "forward");
        return;
    case by_speed:
        snprintf(out_text, 80, "%s %.3g %s", part ? "from" : "below", s->fast, linear ? "m/s" : "rad/s");
        return;
    case by_place:
        snprintf(out_text, 80, "at %.4g to %.4g %s", low, low + step, linear ? "m" : "rad");
        return;
    case by_time:
    case sortings:
        break;
    }
    snprintf(out_text, 80, "from %.4g to %.4g s", c->time_s[0] + third * (double)part,
             c->time_s[0] + third * (double)(part + 1));
}

size_t report_shares_find(const struct diagnosis_curves *curves, bool linear,
                          struct report_share out_shares[report_shares_max])
{
    struct sorter s = {.curves = curves};
    double nominal = 0.0, extended = 0.0, peak = 0.0;
    size_t count = 0;
    const double nearly_all = 0.99; // of the samples: a sorting that has them in one part tells nothing apart
    if (curves->samples < 2)
        return 0;
    s.place = scale_of(curves->position, curves->samples);
    for (size_t i = 0; i < curves->samples; i++) {
        nominal += square_at(curves->residual_nominal, i);
        extended += square_at(curves->residual_extended, i);
        peak = fmax(peak, fabs(curves->velocity[i]));
    }
    s.fast = 0.5 * peak;
    for (int sorting = 0; sorting < sortings; sorting++) {
        size_t before = count;
        double largest = 0.0;
        for (size_t part = 0; part < parts_of[sorting]; part++) {
            struct report_share *share = &out_shares[count];
            memset(share, 0, sizeof *share);
            for (size_t i = 0; i < curves->samples; i++)
                if (sort_sample(&s, (enum sorting)sorting, i) == part) {
                    share->samples += 1.0 / (double)curves->samples;
                    share->nominal += square_at(curves->residual_nominal, i) / nominal;
                    share->extended += square_at(curves->residual_extended, i) / extended;
                }
            name_part(&s, (enum sorting)sorting, part, linear, share->what);
            count += share->samples > 0.0;
            largest = fmax(largest, share->samples);
        }
        count = largest > nearly_all ? before : count;
    }
    return count;
}

bool report_places_find(const struct diagnosis_curves *curves, struct report_places *out_places)
{
    struct scale place = scale_of(curves->position, curves->samples);
    size_t counts[report_places] = {0};
    memset(out_places, 0, sizeof *out_places);
    if (!(place.high > place.low))
        return false;
    for (size_t i = 0; i < curves->samples; i++) {
        size_t part = part_of(&place, curves->position[i], report_places);
        out_places->nominal[part] += square_at(curves->residual_nominal, i);
        out_places->extended[part] += square_at(curves->residual_extended, i);
        counts[part]++;
    }
    for (size_t part = 0; part < report_places; part++) {
        double n = (double)counts[part], step = (place.high - place.low) / report_places;
        out_places->position[part] = place.low + step * ((double)part + 0.5);
        out_places->nominal[part] = counts[part] ? sqrt(out_places->nominal[part] / n) : NAN;
        out_places->extended[part] = counts[part] ? sqrt(out_places->extended[part] / n) : NAN;
    }
    return true;
}
