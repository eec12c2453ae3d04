/* SPDX-License-Identifier: MIT */
#include "lab/estimate/clocked.h"

#include "lab/estimate/columns.h"
#include "lab/estimate/method.h"
#include "lab/estimate/period_search.h"
#include "lab/estimate/resample.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/// Times that the period is measured anew on what was resampled: the first measurement suffers from leakage.
enum { refinements = 3 };

/// A rest of the offset that is this small against its standard deviation is noise.
static const double arrived_std = 0.5;
/// Signals that turn by more against each other have no response.
static const double apart_rad = 0.5;
/// A period found this near a whole number is taken for one.
static const double whole_number = 0.05;
static const double most_of_a_clock = 1e-3;

/// What is known of the true period: samples + offset + drift x after x periods.
struct true_period {
    size_t samples; ///< nearest whole number, or what the run says
    double offset;
    double drift;
};

/// x = m/N periods end at (N + offset) x + drift x^2 / 2.
static struct resample_warp warp_of(const struct true_period *period)
{
    const double length = (double)period->samples;
    return (struct resample_warp){.stretch = period->offset / length, .bend = 0.5 * period->drift / (length * length)};
}

static int check_band(const struct periodic *recording, const struct true_period *period, struct error *out_error)
{
    const double highest = (double)recording->bins[recording->bin_count - 1] / (double)recording->period_samples;
    if (highest <= RESAMPLE_BAND) {
        return 0;
    }
    return error_set(
        out_error, error_refused,
        "%s: its period is %.9g samples, not %zu, and a line at %.3g of the sample rate cannot be resampled: "
        "expected lines up to %.2g of it, or --lines without the highest",
        recording->run->path, (double)period->samples + period->offset, period->samples, highest, RESAMPLE_BAND);
}

/// A start that differs may be a transient or a clock. The first period apart, all of them tell the clock.
static int measure_all(const struct run *run, const struct periodic_options *options, struct clock *out,
                       struct error *out_error)
{
    struct periodic_options all = *options;
    struct periodic recording;
    all.settle = periodic_settle_given;
    all.settle_periods = 1;
    int status = periodic_cut(run, &all, &recording, out_error);
    if (status) {
        return status;
    }
    status = clock_measure(&recording, out) ? 0 : error_set(out_error, error_refused, "%s: memory is short", run->path);
    periodic_free(&recording);
    return status;
}

static int measure(const struct run *run, const struct periodic_options *options, struct clocked *io_self,
                   struct error *out_error)
{
    const struct periodic *recording = &io_self->recording;
    if (recording->settle_source == periodic_settle_auto && recording->settle > 1) {
        return measure_all(run, options, &io_self->clock, out_error);
    }
    return clock_measure(recording, &io_self->clock)
               ? 0
               : error_set(out_error, error_refused, "%s: memory is short", run->path);
}

/// Cuts the run resampled to a period; replaces what *io_self holds.
static int cut_resampled(const struct run *run, const struct periodic_options *options,
                         const struct true_period *period, struct clocked *io_self, struct error *out_error)
{
    const struct resample_warp warp = warp_of(period);
    struct periodic_options own = *options;
    clocked_free(io_self);
    int status = resample_run(run, &warp, period->samples, &io_self->resampled, out_error);
    if (status) {
        return status;
    }
    io_self->is_resampled = true;
    own.period_samples = period->samples;
    status = periodic_cut(&io_self->resampled, &own, &io_self->recording, out_error);
    status = status ? status : check_band(&io_self->recording, period, out_error);
    status = status ? status : measure(&io_self->resampled, &own, io_self, out_error);
    if (status) {
        clocked_free(io_self);
    }
    return status;
}

static bool has_arrived(const struct clock *clock)
{
    const struct clock_signal *both = &clock->both;
    return clock->state == clock_untested || !clock->coherent ||
           (fabs(both->offset_samples) <= arrived_std * both->offset_std && both->drift_samples == 0.0);
}

/// What a measurement leaves is added to what was resampled by; its offset is that of the recording's middle.
static void add_offset(const struct clock *clock, struct true_period *io_period)
{
    io_period->offset += clock->both.offset_samples - clock->both.drift_samples * clock->middle_period;
    io_period->drift += clock->both.drift_samples;
}

static void report(const struct clock *first, const struct true_period *period, struct clock *io_clock)
{
    io_clock->both.offset_samples = period->offset + period->drift * io_clock->middle_period;
    io_clock->both.drift_samples = period->drift;
    io_clock->leakage = first->leakage;
    io_clock->both.slip_rad = first->both.slip_rad;
    io_clock->state = clock_off;
    io_clock->matters = true;
}

static int refuse_apart(const struct clocked *self, double offset, struct error *out_error)
{
    const struct periodic *recording = &self->recording;
    const double length = (double)recording->period_samples + offset;
    return error_set(out_error, error_refused,
                     "%s: %s repeats every %.9g samples and %s every %.9g: expected signals sampled by one clock, or "
                     "another --input or --output",
                     recording->run->path, recording->input, length + self->clock.input.offset_samples,
                     recording->output, length + self->clock.output.offset_samples);
}

/// Whether the two turn against each other over the recording by so much that they have no response.
static bool is_apart(const struct clock *clock)
{
    const double input = clock->input.slip_rad;
    const double output = clock->output.slip_rad;
    const bool same_way = clock->input.offset_samples * clock->output.offset_samples > 0.0;
    return clock->state == clock_apart && (same_way ? fabs(input - output) : input + output) > apart_rad;
}

static int resample_until_steady(const struct run *run, const struct periodic_options *options,
                                 struct true_period period, struct clocked *io_self, struct error *out_error)
{
    const struct clock first = io_self->clock;
    int status = 0;
    for (int pass = 0; pass < refinements && !status; pass++) {
        status = cut_resampled(run, options, &period, io_self, out_error);
        if (status || has_arrived(&io_self->clock)) {
            break;
        }
        if (pass + 1 < refinements) {
            add_offset(&io_self->clock, &period);
        }
    }
    if (!status && is_apart(&io_self->clock)) {
        status = refuse_apart(io_self, period.offset, out_error);
        clocked_free(io_self);
    }
    if (!status) {
        report(&first, &period, &io_self->clock);
        io_self->recording.true_period_samples = (double)period.samples + io_self->clock.both.offset_samples;
    }
    return status;
}

/// A period that nobody said, or that is not the one said, fractions of a sample included.
static bool search_period(const struct run *run, const struct periodic_options *options, size_t said,
                          struct true_period *out)
{
    struct columns columns;
    struct error ignored;
    const struct columns wanted = {options->input, options->output, options->reference};
    if (columns_choose(run, &wanted, &columns, &ignored)) {
        return false;
    }
    struct period_search found;
    double *owned;
    const double *filled = columns_filled(run, columns.input, &owned);
    const enum period_search_status status =
        filled ? period_search_run(filled, run->rows, &found) : period_search_err_memory;
    free(owned);
    if (status != period_search_ok && status != period_search_err_fraction) {
        return false;
    }
    *out = (struct true_period){.samples = said > 0 ? said : found.period_samples};
    out->offset = found.exact_samples - (double)out->samples;
    return fabs(out->offset) <= CLOCKED_RANGE * (double)out->samples;
}

/// Compares a period that somebody said with what the input repeats after. A file's own period may be off by a clock,
/// which is then corrected; a number on the command line where the input repeats after another whole one is a mistake.
static int check_period(const struct run *run, const char *input, size_t said, bool from_option,
                        struct error *out_error)
{
    struct period_check check;
    double *owned;
    const double *filled = columns_filled(run, input, &owned);
    const enum period_search_status status =
        filled ? period_search_check(filled, run->rows, said, &check) : period_search_err_memory;
    free(owned);
    if (status == period_search_err_memory) {
        return error_set(out_error, error_refused, "%s: memory is short", run->path);
    }
    if (status == period_search_err_none || !check.refuted) {
        return 0;
    }
    const double exact = check.found.exact_samples;
    const bool is_whole = fabs(exact - round(exact)) <= whole_number;
    if (run->rows / said >= clock_fewest_periods && fabs(exact - (double)said) <= CLOCKED_RANGE * (double)said &&
        !(from_option && is_whole)) {
        return 0;
    }
    return error_set(out_error, error_refused,
                     "%s: %s %zu: %s repeats every %.9g samples (correlation %.6g), not every %zu (%.6g): expected "
                     "--period %zu",
                     run->path, from_option ? "--period" : "period_samples is", said, input,
                     is_whole ? round(exact) : exact, check.found.correlation, said, check.correlation,
                     check.found.period_samples);
}

/// A clock is off by hundreds of parts per million at most: a period of another whole number is a miscount.
static bool is_miscounted(const struct true_period *period)
{
    const double whole = round(period->offset);
    return whole != 0.0 && fabs(period->offset) > most_of_a_clock * (double)period->samples &&
           fabs(period->offset - whole) <= whole_number && period->drift == 0.0;
}

/// Before anything is cut by it.
static int check_option(const struct run *run, const struct periodic_options *options, struct error *out_error)
{
    struct columns columns;
    const struct columns wanted = {options->input, options->output, options->reference};
    if (options->period_samples == 0 || options->period_samples == run->period_samples) {
        return 0;
    }
    int status = columns_choose(run, &wanted, &columns, out_error);
    return status ? status : check_period(run, columns.input, options->period_samples, true, out_error);
}

/// The file's own period, where clock_measure cannot tell.
static int check_key(const struct run *run, const struct clocked *self, struct error *out_error)
{
    const struct periodic *recording = &self->recording;
    const bool tested = self->clock.state != clock_untested && self->clock.coherent;
    if (tested || recording->period_found || recording->period_samples != run->period_samples) {
        return 0;
    }
    return check_period(run, recording->input, recording->period_samples, false, out_error);
}

static int judge(const struct run *run, const struct periodic_options *options, bool strict, struct clocked *io_self,
                 struct error *out_error)
{
    const struct periodic *recording = &io_self->recording;
    const struct clock *clock = &io_self->clock;
    struct true_period period = {.samples = recording->period_samples};
    if (!clock->coherent) {
        const bool found = search_period(run, options, period.samples, &period) && fabs(period.offset) > 0.5;
        return found ? resample_until_steady(run, options, period, io_self, out_error) : 0;
    }
    if (is_apart(clock)) {
        return refuse_apart(io_self, 0.0, out_error);
    }
    if (clock->state != clock_off || !(clock->matters || strict)) {
        return 0;
    }
    add_offset(clock, &period);
    if (is_miscounted(&period) && period.samples == run->period_samples) {
        return error_set(out_error, error_refused,
                         "%s: period_samples is %zu: %s and %s repeat every %.0f samples: expected --period %.0f",
                         run->path, period.samples, recording->input, recording->output,
                         (double)period.samples + round(period.offset), (double)period.samples + round(period.offset));
    }
    int status = check_band(recording, &period, out_error);
    return status ? status : resample_until_steady(run, options, period, io_self, out_error);
}

int clocked_cut(const struct run *run, const struct periodic_options *options, bool strict, struct clocked *out_self,
                struct error *out_error)
{
    struct true_period period;
    *out_self = (struct clocked){.is_resampled = false};
    int status = check_option(run, options, out_error);
    status = status ? status : periodic_cut(run, options, &out_self->recording, out_error);
    if (status && out_self->recording.aperiodic) {
        if (!search_period(run, options, 0, &period)) {
            return status;
        }
        status = resample_until_steady(run, options, period, out_self, out_error);
        out_self->recording.period_found = status == 0;
        return status;
    }
    if (status) {
        return status;
    }
    status = measure(run, options, out_self, out_error);
    status = status ? status : check_key(run, out_self, out_error);
    status = status ? status : judge(run, options, strict, out_self, out_error);
    if (status) {
        clocked_free(out_self);
    }
    return status;
}

bool clock_set_keys(const struct clock *clock, size_t period_samples, bool resampled, struct frf *io_frf)
{
    const double length = (double)period_samples;
    if (clock->state == clock_untested || clock->state == clock_steady) {
        return true;
    }
    if (clock->state == clock_apart) {
        return estimate_set_key(io_frf, "clock", "apart") &&
               estimate_set_key(io_frf, "input_period_samples", "%.9g", length + clock->input.offset_samples) &&
               estimate_set_key(io_frf, "output_period_samples", "%.9g", length + clock->output.offset_samples);
    }
    bool set = estimate_set_key(io_frf, "clock", resampled ? "resampled" : "negligible") &&
               estimate_set_key(io_frf, "true_period_samples", "%.12g", length + clock->both.offset_samples) &&
               estimate_set_key(io_frf, "true_period_std", "%.3g", clock->both.offset_std);
    if (clock->both.drift_samples != 0.0) {
        set = set && estimate_set_key(io_frf, "period_drift_samples", "%.6g", clock->both.drift_samples);
    }
    return set;
}

void clocked_free(struct clocked *self)
{
    periodic_free(&self->recording);
    run_free(&self->resampled);
    *self = (struct clocked){.is_resampled = false};
}
