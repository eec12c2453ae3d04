/* SPDX-License-Identifier: MIT */
#include "lab/estimate/advise.h"

#include "lab/estimate/columns.h"
#include "lab/estimate/stretch.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

/// Fewer periods than this scatter too much for a variance; a transient that costs more than one in eight is worth a
/// method of its own, whose noise is a little higher.
enum { few_periods = 5, dear_share = 8 };

/// Periods that differ from each other by more of the output than this hide a transient.
static const double restless = 0.2;

#if defined(__GNUC__)
__attribute__((format(printf, 2, 3)))
#endif
static void
add(struct estimate_advice *io_advice, const char *format, ...)
{
    size_t used = strlen(io_advice->sentence);
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(io_advice->sentence + used, sizeof io_advice->sentence - used, format, arguments);
    va_end(arguments);
}

/// Leading periods that the recording itself gives up.
static size_t given_up(const struct periodic *recording)
{
    return recording->run->has_settle_periods ? recording->run->settle_periods : 0;
}

static bool is_unsettled(const struct periodic *recording)
{
    return recording->total >= 4 &&
           (!recording->transient.settled || recording->transient.periods > given_up(recording));
}

/// RMS distance of the later half's periods from their mean, over the output's size.
static double restless_level(const struct periodic *recording)
{
    double sum = 0.0;
    double count = 0.0;
    for (size_t p = recording->total / 2; p < recording->total; p++) {
        const double level = recording->output_level[p];
        sum += isnan(level) ? 0.0 : level * level;
        count += isnan(level) ? 0.0 : 1.0;
    }
    return count > 0.0 ? sqrt(sum / count) : 0.0;
}

static void add_settling(const struct periodic *recording, struct estimate_advice *io_advice)
{
    if (recording->total < 4) {
        add(io_advice, "%zu periods are too few to see whether it has settled", recording->total);
    } else if (!recording->transient.settled) {
        add(io_advice, "it has not settled in its first half (%.2g of the output in the first period)",
            periodic_first_level(recording));
    } else if (is_unsettled(recording)) {
        add(io_advice, "a transient (%.2g of the output in the first period) takes %zu of %zu periods to settle",
            periodic_first_level(recording), recording->transient.periods, recording->total);
    } else if (restless_level(recording) > restless) {
        add(io_advice,
            "no transient stands out of what differs from period to period anyway (%.2g of the output): whether it has "
            "settled cannot be seen",
            restless_level(recording));
    } else if (given_up(recording) > 0) {
        add(io_advice, "it is settled after the %zu of %zu periods that its settle_periods gives up",
            given_up(recording), recording->total);
    } else {
        add(io_advice, "it is settled from the first of %zu periods", recording->total);
    }
}

void estimate_advise(const struct periodic *recording, struct estimate_advice *out_advice)
{
    const struct columns columns = {.reference = recording->reference};
    size_t in_a_row = stretch_longest(recording).periods;
    bool unsettled = is_unsettled(recording);
    bool few = recording->used < few_periods;
    bool dear =
        unsettled && (!recording->transient.settled || recording->transient.periods * dear_share > recording->total);
    bool local = (dear || few) && in_a_row >= 2;
    *out_advice = (struct estimate_advice){.method = local ? "lpm" : "mean"};
    add(out_advice, "method %s suits this recording: it repeats every %.9g samples, ", out_advice->method,
        recording->true_period_samples > 0.0 ? recording->true_period_samples : (double)recording->period_samples);
    add_settling(recording, out_advice);
    if (unsettled && !local) {
        add(out_advice, ", which --settle auto leaves out");
    } else if (local && dear) {
        add(out_advice, ", and lpm takes the transient out instead of periods");
    } else if (local) {
        add(out_advice,
            ", and lpm takes the standard deviation from the lines between the excited ones, not from %zu "
            "periods",
            recording->used);
    }
    if (recording->lost > 0) {
        add(out_advice, "; lost samples cost %zu periods and leave %zu in a row", recording->lost, in_a_row);
    }
    if (columns_closed_loop(&columns)) {
        add(out_advice, "; the loop is closed (%s), which does not bias methods for periods", recording->reference);
    }
}

void estimate_advise_arbitrary(const struct arbitrary *recording, struct estimate_advice *out_advice)
{
    const struct columns columns = {.reference = recording->reference};
    bool closed = columns_closed_loop(&columns);
    *out_advice = (struct estimate_advice){.method = closed ? "indirect" : "lpm"};
    add(out_advice, "method %s suits this recording: it has no period, ", out_advice->method);
    if (closed) {
        add(out_advice,
            "and %s shows that a loop is closed, so that %s holds noise of the output: h1 would be biased; lpm, which "
            "goes through %s too, resolves narrow resonances better, with more noise",
            recording->reference, recording->input, recording->reference);
    } else {
        add(out_advice,
            "and no set-point shows a closed loop: lpm takes out what h1 loses at the ends of its segments");
    }
    if (recording->lost > 0) {
        add(out_advice, "; %zu lost rows leave %zu rows in one piece", recording->lost, recording->rows);
    }
    add(out_advice, "; a periodic excitation would give more");
}
