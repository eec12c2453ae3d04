/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/structure.h"

#include "lab/diagnose/evenness.h"
#include "lab/diagnose/slow.h"
#include "lab/numeric/fft.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { cells = 16, fewest_periods = 4, bands_most = 48 };

/// What chance may reach in one place; the log of the number of places comes on top.
static const double floor_nats = 12.0;
/// Less than this in power nobody would call a structure.
static const double least_excess = 1.5;

static void add_place(struct structure *s, size_t first, size_t last)
{
    if (s->place_count == structure_places_max)
        return;
    s->place_first[s->place_count] = first;
    s->place_last[s->place_count++] = last;
}

void structure_merge(struct structure *self, const struct structure *other)
{
    struct structure sum = !self->found || (other->found && other->nats > self->nats) ? *other : *self;
    const struct structure *rest = sum.nats == self->nats && self->found ? other : self;
    for (size_t i = 0; i < rest->place_count; i++)
        add_place(&sum, rest->place_first[i], rest->place_last[i]);
    sum.beyond = fmax(self->beyond, other->beyond);
    *self = sum;
}

bool structure_holds(const struct structure *self, size_t bin)
{
    for (size_t i = 0; i < self->place_count; i++)
        if (bin >= self->place_first[i] && bin <= self->place_last[i])
            return true;
    return false;
}

/// Returns whether it is beyond chance.
static bool keep(struct structure *s, const struct slow_octave *at, double nats, double excess, double places,
                 const char *where)
{
    if (!(nats > floor_nats + log(places)) || !(excess > least_excess))
        return false;
    add_place(s, at->from, at->to - 1);
    if (s->found && nats <= s->nats)
        return true;
    s->found = true;
    s->nats = nats;
    s->excess = excess;
    s->first_bin = at->from;
    s->last_bin = at->to - 1;
    snprintf(s->where, sizeof s->where, "%.*s", (int)sizeof s->where - 1, where);
    return true;
}

/// Half of what `part`, the sum of m squares of which the others are `rest`, has beyond its share in noise.
static double beyond_noise(double part, double m, double rest, double others)
{
    return 0.5 * fmax(part - m * rest / others, 0.0);
}

/// Values from .. to - 1 of each period: how much of their squares lies in slow courses.
static double slow_part(const struct evidence *e, const double *contrasts, const double *courses, size_t orders,
                        size_t from, size_t to, double *out_sum)
{
    size_t P = e->recording->periods, width = e->contrast.width;
    double slow = 0.0;
    *out_sum = 0.0;
    for (size_t i = from; i < to; i++) {
        for (size_t p = 0; p < P; p++)
            *out_sum += contrasts[p * width + i] * contrasts[p * width + i];
        for (size_t q = 0; q < orders; q++) {
            double along = 0.0;
            for (size_t p = 0; p < P; p++)
                along += courses[q * P + p] * contrasts[p * width + i];
            slow += along * along;
        }
    }
    return slow;
}

/// A gain, a friction or a bias that creeps.
static void find_slow_change(const struct evidence *e, const double *contrasts, double *courses, double *work,
                             struct structure *out)
{
    const struct recording *r = e->recording;
    struct slow_octave octaves[slow_octaves_most];
    size_t P = r->periods, orders = slow_courses(P, courses), count = slow_octaves(r->band, octaves);
    double hz = r->rate_hz / (double)r->block.samples;
    for (size_t i = 0; i < count; i++) {
        const struct slow_octave *o = &octaves[i];
        size_t first = o->from == 0 ? 0 : 2 * o->from - 1, last = 2 * o->to - 1;
        double sum, excess, values = (double)(last - first);
        double slow = slow_part(e, contrasts, courses, orders, first, last, &sum);
        double nats = slow_larger_variance(slow, values * (double)orders, sum, values * (double)(P - 1), &excess);
        nats *= evenness(e, contrasts, o->from, o->to - 1, work);
        char where[160];
        snprintf(where, sizeof where, "it changes slowly over the run, at %.3g..%.3g Hz %.2g times the noise in power",
                 (double)o->from * hz, (double)(o->to - 1) * hz, excess);
        if (keep(out, o, nats, excess, (double)count, where))
            out->beyond += beyond_noise(slow, values * (double)orders, sum - slow, values * (double)(P - 1 - orders));
    }
}

/// Period before which the constant part changes most: where two means leave the least.
static size_t change_point(const struct evidence *e, const double *contrasts)
{
    size_t P = e->recording->periods, best = 1;
    double most = 0.0, before = 0.0;
    for (size_t p = 1; p < P; p++) { // the deviations' sum is zero: what follows is minus what went before
        before += contrasts[(p - 1) * e->contrast.width];
        double explained = before * before * (1.0 / (double)p + 1.0 / (double)(P - p));
        if (explained > most) {
            most = explained;
            best = p;
        }
    }
    return best;
}

/// A bias that jumps or wanders: the constant part differs between periods by more than the lines next to it.
static void find_level(const struct evidence *e, const double *contrasts, struct structure *out)
{
    const struct recording *r = e->recording;
    const size_t near = 4;
    size_t P = r->periods, width = e->contrast.width, last = r->band < near ? r->band : near;
    double level = 0.0, sum = 0.0, excess;
    for (size_t p = 0; p < P; p++)
        for (size_t i = 0; i <= 2 * last; i++) {
            double square = contrasts[p * width + i] * contrasts[p * width + i];
            sum += square;
            level += i == 0 ? square : 0.0;
        }
    double nats = slow_larger_variance(level, (double)(P - 1), sum, (double)((P - 1) * (2 * last + 1)), &excess);
    double at_s = r->all.start_s + (double)r->starts[change_point(e, contrasts)] / r->rate_hz;
    char where[160];
    snprintf(where, sizeof where,
             "the constant part differs between periods by %.2g times the noise, most of all from about %.3g s on",
             sqrt(excess), at_s);
    if (keep(out, &(struct slow_octave){0, 1}, nats, excess, 1.0, where))
        out->beyond += beyond_noise(level, (double)(P - 1), sum - level, (double)((P - 1) * 2 * last));
}

/// One period's whitened contrasts in time: white, if they are noise. Sums of squares over equal stretches.
static void stretch_powers(const struct evidence *e, const double *values, const struct slow_octave *o, double *work,
                           double *out_powers)
{
    size_t n = e->recording->block.samples;
    double *time = work + 2 * n;
    memset(work, 0, 2 * n * sizeof *work);
    if (o->from == 0)
        work[0] = values[0];
    for (size_t k = o->from > 0 ? o->from : 1; k < o->to; k++) {
        work[2 * k] = work[2 * (n - k)] = values[2 * k - 1];
        work[2 * k + 1] = values[2 * k];
        work[2 * (n - k) + 1] = -values[2 * k];
    }
    fft_inverse(e->plan, work, time);
    memset(out_powers, 0, cells * sizeof *out_powers);
    for (size_t i = 0; i < n; i++)
        out_powers[i * cells / n] += time[2 * i] * time[2 * i] / (2.0 * (double)n);
}

/// Stretches that are louder in one period than in the others: compared at the same place of the period, because noise
/// may well depend on the motion. One that is beyond chance by itself counts, and so do several that are nearly so.
static void find_burst_in(const struct evidence *e, const struct slow_octave *o, const double *powers, double octaves,
                          struct structure *out)
{
    const struct recording *r = e->recording;
    size_t P = r->periods, n = r->block.samples, loud = 0, loudest = 0;
    double values = 2.0 * (double)(o->to - o->from) / cells * (1.0 - 1.0 / (double)P);
    double hz = r->rate_hz / (double)n, most_nats = 0.0, most_excess = 0.0, together = 0.0;
    const double common_nats = 3.0, floor_together = 4.0; // of the 3 nats one stretch in 140 has by chance
    for (size_t i = 0; i < P * cells; i++) {
        double sum = 0.0, excess;
        for (size_t p = 0; p < P; p++)
            sum += powers[p * cells + i % cells];
        double nats = slow_larger_variance(powers[i], values, sum, values * (double)P, &excess);
        if (nats > common_nats) {
            together += nats - common_nats;
            loud++;
        }
        if (nats > most_nats) {
            most_nats = nats;
            most_excess = excess;
            loudest = i;
        }
    }
    double start_s = r->all.start_s + (double)(r->starts[loudest / cells] + loudest % cells * n / cells) / r->rate_hz;
    char where[240], others[48] = "";
    if (loud > 1)
        snprintf(others, sizeof others, ", and %zu more stretches", loud - 1);
    snprintf(where, sizeof where,
             "%.4g to %.4g s after the start, %.3g..%.3g Hz are %.2g times as strong as in other periods%s", start_s,
             start_s + (double)n / cells / r->rate_hz, (double)o->from * hz, (double)(o->to - 1) * hz,
             sqrt(most_excess), others);
    keep(out, o, most_nats, most_excess, octaves * (double)(P * cells), where);
    if (together > floor_nats + floor_together + log(octaves))
        keep(out, o, together, most_excess, octaves, where);
}

/// Bands to look for bursts in: octaves, the wide ones in pieces, because what swings for a moment is narrow.
static size_t split_bands(size_t band, struct slow_octave out[bands_most])
{
    struct slow_octave octaves[slow_octaves_most];
    size_t octave_count = slow_octaves(band, octaves), count = 0;
    size_t widest = 2 * cells > band / 16 ? 2 * cells : band / 16;
    for (size_t i = 0; i < octave_count; i++) {
        size_t width = octaves[i].to - octaves[i].from, pieces = (width + widest - 1) / widest;
        for (size_t j = 0; j < pieces && count < bands_most; j++)
            out[count++] =
                (struct slow_octave){octaves[i].from + j * width / pieces, octaves[i].from + (j + 1) * width / pieces};
    }
    return count;
}

static void find_burst(const struct evidence *e, const double *contrasts, double *work, struct structure *out)
{
    const size_t fewest_bins = cells; // two values per stretch
    struct slow_octave bands[bands_most];
    size_t P = e->recording->periods, count = split_bands(e->recording->band, bands);
    double *powers = work + 4 * e->recording->block.samples;
    for (size_t i = 0; i < count; i++) {
        if (bands[i].to - bands[i].from < fewest_bins)
            continue;
        for (size_t p = 0; p < P; p++)
            stretch_powers(e, contrasts + p * e->contrast.width, &bands[i], work, powers + p * cells);
        find_burst_in(e, &bands[i], powers, (double)count, out);
    }
}

static void find_line(const struct evidence *e, struct structure *out)
{
    if (e->tone_count == 0)
        return;
    char where[160];
    snprintf(where, sizeof where, "a line at %.5g Hz stands out that was not excited", e->tones_hz[0]);
    const struct recording *r = e->recording;
    size_t bin = (size_t)(e->tones_hz[0] * (double)r->block.samples / r->rate_hz);
    // What changes slowly or for a moment has lines as well, but says less by them.
    if (out->found && bin + 1 >= out->first_bin && bin <= out->last_bin + 1)
        return;
    keep(out, &(struct slow_octave){bin, bin + 2}, e->tone_nats, INFINITY, (double)(r->band * r->periods), where);
}

bool structure_find(const struct evidence *evidence, const double *contrasts, struct structure *out_structure)
{
    const struct recording *r = evidence->recording;
    size_t n = r->block.samples, P = r->periods;
    memset(out_structure, 0, sizeof *out_structure);
    if (!r->periodic || P < fewest_periods)
        return true;
    double *work = malloc((5 * n + P * (cells + slow_orders_most)) * sizeof *work);
    if (!work)
        return false;
    find_slow_change(evidence, contrasts, work + 5 * n + P * cells, work, out_structure);
    find_level(evidence, contrasts, out_structure);
    find_burst(evidence, contrasts, work, out_structure);
    find_line(evidence, out_structure);
    free(work);
    return true;
}

void structure_find_slow(const struct evidence *evidence, const double *whitened, struct structure *out_structure)
{
    const struct recording *r = evidence->recording;
    const size_t slow = 4, near = 32; // bins of the run
    const double enough = 8.0;        // in power: friction's harmonics lie close
    memset(out_structure, 0, sizeof *out_structure);
    if (r->periodic || r->band < near)
        return;
    double part = 0.0, sum = 0.0, excess;
    size_t values = 0, slow_values = 0;
    for (size_t i = 1; i < evidence->values; i++) {
        size_t channel, bin = evidence_bin(evidence, i, &channel);
        if (channel != 0 || bin > near)
            continue;
        sum += whitened[i] * whitened[i];
        part += bin <= slow ? whitened[i] * whitened[i] : 0.0;
        values++;
        slow_values += bin <= slow;
    }
    double nats = slow_larger_variance(part, (double)slow_values, sum, (double)values, &excess);
    double hz = r->rate_hz / (double)r->block.samples;
    char where[160];
    snprintf(where, sizeof where, "it changes slowly over the run, below %.2g Hz %.2g times the noise in power",
             (double)slow * hz, excess);
    if (excess > enough)
        keep(out_structure, &(struct slow_octave){0, slow + 1}, nats, excess, 1.0, where);
}
