/* SPDX-License-Identifier: MIT */
// Rows of the recording repeat the torque, position and velocity of the row before: the bus or the recorder was late.
// Found exactly: measured numbers that all repeat to the last digit while the axis moves.
#include "sim/effect.h"
#include "sim/model.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>

static bool lost_lose(const double *p, double uniform)
{
    return uniform < p[0];
}

/// Whether a column says in row n what it said in the row before; a column that is not there says nothing against it.
static bool repeats(const double *column, size_t n)
{
    return !column || column[n] == column[n - 1];
}

static bool repeats_wholly(const struct sim_columns *c, size_t n)
{
    return repeats(c->torque, n) && repeats(c->position, n) && repeats(c->velocity, n);
}

static const double *motion_of(const struct sim_columns *c)
{
    return c->position ? c->position : c->velocity;
}

/// Smallest change that the motion's column shows: what one count is, or less.
static double resolution(const struct sim_columns *c)
{
    const double *motion = motion_of(c);
    double least = INFINITY;
    for (size_t n = 1; n < c->rows; n++)
        if (motion[n] != motion[n - 1])
            least = fmin(least, fabs(motion[n] - motion[n - 1]));
    return least;
}

/// Whether the axis moved by several counts before, after or across rows first .. last. Where it stood still or crept,
/// repeating is right.
static bool moved_across(const struct sim_columns *c, double count, size_t first, size_t last)
{
    const double several = 4.0;
    const double *motion = motion_of(c);
    if (last + 1 >= c->rows)
        return false;
    double across = fabs(motion[last + 1] - motion[first - 1]), after = fabs(motion[last + 1] - motion[last]);
    double before = first >= 2 ? fabs(motion[first - 1] - motion[first - 2]) : 0.0;
    return fmax(across, fmax(before, after)) >= several * count;
}

enum { columns_most = 3 };

/// How often columns repeat in rows that do not repeat wholly.
struct chances {
    size_t columns;
    double alone[columns_most]; ///< column i, whatever the others do
    double both[columns_most];  ///< all but column i; of two columns the other one
    double rows;
};

/// Half a count more each: none seen is not none possible.
static struct chances count_chances(const struct sim_columns *c)
{
    const double *all[columns_most] = {c->torque, c->position, c->velocity}, *column[columns_most] = {NULL};
    struct chances out = {.alone = {0.5, 0.5, 0.5}, .both = {0.5, 0.5, 0.5}, .rows = 1.0};
    for (size_t i = 0; i < columns_most; i++)
        if (all[i])
            column[out.columns++] = all[i];
    for (size_t n = 1; n < c->rows; n++) {
        size_t same = 0, last = 0, other = 0;
        for (size_t i = 0; i < out.columns; i++) {
            bool repeated = column[i][n] == column[i][n - 1];
            same += repeated;
            last = repeated ? i : last;
            other = repeated ? other : i;
        }
        if (same == out.columns)
            continue;
        out.rows += 1.0;
        if (same == 1)
            out.alone[last] += 1.0;
        if (same + 1 == out.columns)
            out.both[other] += 1.0;
        for (size_t i = 0; same == 2 && i < out.columns; i++)
            out.alone[i] += i != other;
    }
    return out;
}

/// Rows that are to be expected to repeat wholly by chance, if one column repeats independently of the others. These
/// may depend on each other, as a speed does that is made from the position: what the rows show of that counts, and
/// where they show next to nothing their own chances do. Of the columns that may be the independent one that is taken
/// which makes the largest number.
static double expected_by_chance(const struct sim_columns *c)
{
    const double seen = 1.0; // and the half
    struct chances chances = count_chances(c);
    double apart = chances.rows, most = 0.0;
    for (size_t i = 0; i < chances.columns; i++)
        apart *= chances.alone[i] / fmax(chances.rows - chances.alone[i], 1.0);
    for (size_t i = 0; i < chances.columns; i++) {
        double one = chances.alone[i], others = chances.both[i];
        bool together = chances.columns == 2 || others > seen;
        most = fmax(most, together ? one * others / fmax(chances.rows - one - others, 1.0) : apart);
    }
    return most;
}

/// One column alone may repeat for any reason.
static bool enough_columns(const struct sim_columns *c)
{
    return (c->torque != NULL) + (c->position != NULL) + (c->velocity != NULL) >= 2;
}

/// Marks the rows; returns how many, out of how many in which it would have shown.
static size_t mark(const struct sim_columns *c, bool *out_rows, size_t *out_shown)
{
    const size_t longest = 20; // more in a row than any bus loses: the recorder stopped
    double count = resolution(c);
    size_t lost = 0;
    *out_shown = 0;
    for (size_t n = 1; n < c->rows; n++) {
        size_t first = n;
        while (n < c->rows && repeats_wholly(c, n))
            n++;
        bool lasting = n - first > longest;
        if (n > first && !lasting && moved_across(c, count, first, n - 1)) {
            for (size_t i = first; i < n; i++)
                out_rows[i] = true;
            lost += n - first;
            *out_shown += n - first;
        }
        *out_shown += n < c->rows && moved_across(c, count, n, n);
    }
    return lost;
}

static bool lost_notice(const struct sim_columns *c, double *out_parameters, double *out_deviations,
                        double *out_evidence, bool *out_rows)
{
    const double clearly = 3.0; // times more than by chance: coarse columns are not quite independent
    size_t shown = 0, lost = 0;
    double expected = 0.0;
    for (size_t n = 0; n < c->rows; n++)
        out_rows[n] = false;
    if (enough_columns(c)) {
        expected = expected_by_chance(c);
        lost = mark(c, out_rows, &shown);
    }
    double rows = fmax((double)shown, 1.0), count = (double)lost;
    *out_evidence = count > expected ? count * log(count / expected) - (count - expected) : 0.0;
    out_parameters[0] = count / rows;
    out_deviations[0] = sqrt(fmax(count, 1.0) * fmax(rows - count, 1.0) / rows) / rows;
    return lost > 0 && count > clearly * expected;
}

static bool lost_scan(const struct sim_model *model, const struct sim_coverage *coverage, size_t index, double *out)
{
    (void)model;
    (void)coverage;
    out[0] = 0.01;
    return index == 0;
}

static void lost_say(const struct sim_finding *f, char *out_text, size_t size)
{
    snprintf(out_text, size, "Samples were lost on the way: %.3g +- %.2g %% of the rows repeat the one before.",
             100.0 * f->parameters[0], 100.0 * f->deviations[0]);
}

const struct sim_effect sim_effect_lost_samples = {
    .id = "lost_samples",
    .place = sim_place_record,
    .parameter_count = 1,
    .parameters = {{.name = "share",
                    .linear_name = "share",
                    .kind = sim_parameter_linear,
                    .minimum = 0.0,
                    .maximum = 0.9,
                    .linear_minimum = 0.0,
                    .linear_maximum = 0.9,
                    .model_offset = SIZE_MAX}},
    .lose = lost_lose,
    .notice = lost_notice,
    .scan = lost_scan,
    .measure = "again on an idle bus, with a column that counts the samples",
    .say = lost_say,
};
