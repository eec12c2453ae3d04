/* SPDX-License-Identifier: MIT */
#include "lab/experiment/variant.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double two_pi = 6.283185307179586;

/// Fewer periods than this leave too little scatter to estimate noise from.
enum { fewest_periods = 6 };

const char *variant_kind_str(enum variant_kind kind)
{
    static const char *const names[variant_kinds] = {
        "as_given",    "half_level",      "small_level",  "wide_lines",
        "slow_stroke", "both_directions", "more_periods", "longer",
    };
    return kind < variant_kinds ? names[kind] : "unknown";
}

void variant_free(struct variant *self)
{
    for (size_t i = 0; i < self->table_count; i++)
        design_result_free(&self->tables[i].result);
    self->table_count = 0;
}

static double rate_hz(const struct design_request *request)
{
    return (double)request->rate_num_hz / request->rate_den;
}

/// Periods of a table that is `stretch` multisine periods long, settling ones too.
static void count_periods(const struct variant_basis *basis, size_t stretch, size_t periods, struct variant *self)
{
    double period_s = (double)(basis->request->period_samples * stretch) / rate_hz(basis->request);
    double settle_s = isnan(basis->settle_time_s) ? period_s : basis->settle_time_s;
    self->periods = periods;
    self->settle_periods = (size_t)ceil(settle_s / period_s - 1e-9);
}

/// Designs one table of the request's lines with a travel under it, and appends it.
static int add_design(const struct design_request *request, const struct design_offset *offset, struct variant *self,
                      struct error *out_error)
{
    struct variant_table *table = &self->tables[self->table_count];
    struct design_request reduced = *request;
    struct design_offset travel = *offset;
    travel.played_periods = self->periods + self->settle_periods;
    table->request = *request;
    int status = design_offset_reduce(&travel, request, &reduced.limits, out_error);
    status = status ? status : design_run(&reduced, &table->result, out_error);
    if (status)
        return status;
    self->table_count++;
    status = design_offset_add(&travel, request, &table->result, out_error);
    table->request.bins = table->result.bins;
    table->request.bin_count = table->result.bin_count;
    return status;
}

static void *copied(const void *from, size_t bytes)
{
    void *to = malloc(bytes);
    return to ? memcpy(to, from, bytes) : NULL;
}

static void scale_values(size_t count, double *values, double level)
{
    for (size_t i = 0; i < count; i++)
        values[i] *= level;
}

static void scale_peaks(struct design_peaks *peaks, double level)
{
    peaks->position_rad *= level;
    peaks->velocity_rad_per_s *= level;
    peaks->acceleration_rad_per_s2 *= level;
    peaks->torque_Nm *= level;
}

static void scale_result(struct design_result *r, double level)
{
    double *series[] = {r->torque_Nm, r->position_rad, r->velocity_rad_per_s, r->acceleration_rad_per_s2};
    for (size_t i = 0; i < sizeof series / sizeof series[0]; i++)
        scale_values(r->period_samples, series[i], level);
    scale_values(r->bin_count, r->amplitude_rad, level);
    scale_peaks(&r->peak, level);
    scale_peaks(&r->peak_continuous, level);
    r->travel_per_period_rad *= level;
    r->effective_torque_Nm *= level;
    r->effective_torque_continuous_Nm *= level;
    r->bound_Nm *= level;
}

/// Appends a table of another excitation at a share of its level.
static int add_level(const struct variant_table *from, double level, struct variant *self, struct error *out_error)
{
    struct variant_table *table = &self->tables[self->table_count++];
    *table = *from;
    struct design_result *r = &table->result;
    size_t samples = r->period_samples * sizeof(double);
    r->bins = copied(r->bins, r->bin_count * sizeof *r->bins);
    r->amplitude_rad = copied(r->amplitude_rad, r->bin_count * sizeof(double));
    r->phase_rad = copied(r->phase_rad, r->bin_count * sizeof(double));
    r->torque_Nm = copied(r->torque_Nm, samples);
    r->position_rad = copied(r->position_rad, samples);
    r->velocity_rad_per_s = copied(r->velocity_rad_per_s, samples);
    r->acceleration_rad_per_s2 = copied(r->acceleration_rad_per_s2, samples);
    if (!r->bins || !r->amplitude_rad || !r->phase_rad || !r->torque_Nm || !r->position_rad || !r->velocity_rad_per_s ||
        !r->acceleration_rad_per_s2)
        return error_set(out_error, error_refused, "memory is short");
    table->request.bins = r->bins;
    scale_result(r, level);
    return 0;
}

static int design_levels(const struct variant_basis *basis, const struct variant *given, double level,
                         struct variant *self, struct error *out_error)
{
    count_periods(basis, given->tables[0].result.period_samples / basis->request->period_samples, given->periods, self);
    snprintf(self->says, sizeof self->says, "as given, and again at %.3g of the level", level);
    int status = add_level(&given->tables[0], 1.0, self, out_error);
    return status ? status : add_level(&given->tables[0], level, self, out_error);
}

static void measure_time(struct variant *self)
{
    self->test_time_s = 0.0;
    for (size_t i = 0; i < self->table_count; i++)
        self->test_time_s += (double)(self->tables[i].result.period_samples * (self->periods + self->settle_periods)) /
                             rate_hz(&self->tables[i].request);
}

int variant_prolong(const struct variant *from, size_t times, struct variant *out_variant, struct error *out_error)
{
    *out_variant = (struct variant){
        .kind = variant_longer, .periods = times * from->periods, .settle_periods = from->settle_periods};
    snprintf(out_variant->says, sizeof out_variant->says, "%.120s, %zu times as long", from->says, times);
    for (size_t i = 0; i < from->table_count; i++) {
        const struct variant_table *table = &from->tables[i];
        if (fabs(table->result.travel_per_period_rad) > 0.0 && table->request.limits.position_rad > 0.0) {
            variant_free(out_variant);
            snprintf(out_variant->why_not, sizeof out_variant->why_not,
                     "a constant speed leaves the position limit after longer than the travel allows");
            return 0;
        }
        int status = add_level(table, 1.0, out_variant, out_error);
        if (status) {
            variant_free(out_variant);
            return status;
        }
    }
    measure_time(out_variant);
    return 0;
}

/// Every line at twice its frequency, if they stay well below half the rate: above, the hold between samples rules.
static int design_wide(const struct variant_basis *basis, struct variant *self, struct error *out_error)
{
    const struct design_request *given = basis->request;
    struct design_request request = *given;
    const double highest = 0.4;
    double width = 2.0 * (double)given->bins[given->bin_count - 1];
    if (width > highest * (double)given->period_samples)
        return error_set(out_error, error_refused, "lines up to %.4g Hz, expected at most %.3g of the sample rate",
                         width * rate_hz(given) / (double)given->period_samples, highest);
    uint32_t *bins = copied(given->bins, given->bin_count * sizeof *bins);
    if (!bins)
        return error_set(out_error, error_refused, "memory is short");
    for (size_t i = 0; i < given->bin_count; i++)
        bins[i] *= 2;
    request.bins = bins;
    size_t stretch = basis->offset.stroke_periods > 0 ? basis->offset.stroke_periods : 1;
    count_periods(basis, stretch, basis->periods, self);
    snprintf(self->says, sizeof self->says, "every line at twice its frequency, up to %.4g Hz",
             width * rate_hz(given) / (double)given->period_samples);
    int status = add_design(&request, &basis->offset, self, out_error);
    free(bins);
    return status;
}

/// The speed that travel is measured by: the limit, or what the multisine as given reaches.
static double usual_speed(const struct variant_basis *basis, const struct variant *given)
{
    double limit = basis->request->limits.velocity_rad_per_s;
    return limit > 0.0 ? limit : given->tables[0].result.peak_continuous.velocity_rad_per_s;
}

static int design_stroke(const struct variant_basis *basis, const struct variant *given, struct variant *self,
                         struct error *out_error)
{
    const struct design_request *request = basis->request;
    const double turns = 0.6, room_share = 0.7, speed_share = 0.25, most_periods = 64.0;
    if (basis->offset.stroke_rad > 0.0)
        return error_set(out_error, error_refused, "the excitation as given has a stroke already");
    double limit = request->limits.position_rad;
    double left = limit - given->tables[0].result.peak_continuous.position_rad;
    double amplitude = limit > 0.0 ? fmax(left, room_share * limit) : turns * basis->turn;
    double period_s = (double)request->period_samples / rate_hz(request);
    double speed = speed_share * usual_speed(basis, given);
    double longest = fmin(most_periods, floor((double)design_period_samples_max / (double)request->period_samples));
    // Even: the odd harmonics of friction that turns with the stroke stay off the lines.
    double periods = fmax(2.0 * ceil(0.5 * two_pi * amplitude / (speed * period_s)), 4.0);
    if (periods > longest) {
        periods = 2.0 * floor(0.5 * longest);
        amplitude = speed * periods * period_s / two_pi;
    }
    struct design_offset offset = {.stroke_rad = amplitude, .stroke_periods = (size_t)periods};
    double counted = ceil((double)basis->periods / fmax(periods, 1.0));
    count_periods(basis, offset.stroke_periods, (size_t)fmax(counted, fewest_periods), self);
    snprintf(self->says, sizeof self->says, "with a slow stroke of +-%.3g %s under it, %zu periods long", amplitude,
             request->linear ? "m" : "rad", offset.stroke_periods);
    return add_design(request, &offset, self, out_error);
}

static int design_both(const struct variant_basis *basis, const struct variant *given, struct variant *self,
                       struct error *out_error)
{
    const struct design_request *request = basis->request;
    const double above_peak = 1.2, limit_share = 0.5, room_share = 0.5;
    if (fabs(basis->offset.bias_velocity_rad_per_s) > 0.0)
        return error_set(out_error, error_refused, "the excitation as given has a constant speed already");
    count_periods(basis, 1, basis->periods, self);
    double speed = request->limits.velocity_rad_per_s > 0.0 ? limit_share * request->limits.velocity_rad_per_s
                                                            : above_peak * usual_speed(basis, given);
    double time_s = (double)((self->periods + self->settle_periods + 1) * request->period_samples) / rate_hz(request);
    // Whole turns per period: what is bound to the motor's turn repeats with the period then.
    double period_s = (double)request->period_samples / rate_hz(request);
    double turns = floor(speed * period_s / basis->turn);
    if (turns > 0.0 && !(request->limits.position_rad > 0.0))
        speed = turns * basis->turn / period_s;
    if (request->limits.position_rad > 0.0)
        speed = fmin(speed, room_share * request->limits.position_rad / time_s);
    snprintf(self->says, sizeof self->says, "at a constant speed of %.3g %s, and at the same backward", speed,
             request->linear ? "m/s" : "rad/s");
    int status = 0;
    for (int direction = 1; !status && direction >= -1; direction -= 2) {
        struct design_offset offset = {.bias_velocity_rad_per_s = direction * speed};
        status = add_design(request, &offset, self, out_error);
    }
    return status;
}

static int design_given(const struct variant_basis *basis, size_t periods, struct variant *self,
                        struct error *out_error)
{
    size_t stretch = basis->offset.stroke_periods > 0 ? basis->offset.stroke_periods : 1;
    count_periods(basis, stretch, periods, self);
    return add_design(basis->request, &basis->offset, self, out_error);
}

static int design_kind(const struct variant_basis *basis, const struct variant *given, struct variant *self,
                       struct error *out_error)
{
    const double half = 0.5, small = 0.2;
    const size_t times = 4;
    switch (self->kind) {
    case variant_as_given:
        snprintf(self->says, sizeof self->says, "as given");
        return design_given(basis, basis->periods, self, out_error);
    case variant_half_level:
        return design_levels(basis, given, half, self, out_error);
    case variant_small_level:
        return design_levels(basis, given, small, self, out_error);
    case variant_wide_lines:
        return design_wide(basis, self, out_error);
    case variant_slow_stroke:
        return design_stroke(basis, given, self, out_error);
    case variant_both_directions:
        return design_both(basis, given, self, out_error);
    case variant_more_periods:
        snprintf(self->says, sizeof self->says, "as given, %zu times as many periods", times);
        if (fabs(given->tables[0].result.travel_per_period_rad) > 0.0)
            return design_given(basis, times * basis->periods, self, out_error); // goes further: designed anew
        count_periods(basis, given->tables[0].result.period_samples / basis->request->period_samples,
                      times * basis->periods, self);
        return add_level(&given->tables[0], 1.0, self, out_error);
    case variant_longer:
    case variant_kinds:
        break;
    }
    return error_set(out_error, error_refused, "no such excitation");
}

int variant_design(const struct variant_basis *basis, enum variant_kind kind, const struct variant *given,
                   struct variant *out_variant, struct error *out_error)
{
    struct error why = {0};
    *out_variant = (struct variant){.kind = kind};
    int status = design_kind(basis, given, out_variant, &why);
    if (status) {
        variant_free(out_variant);
        snprintf(out_variant->why_not, sizeof out_variant->why_not, "%.*s", (int)sizeof out_variant->why_not - 1,
                 why.message);
        return kind == variant_as_given ? error_set(out_error, status, "%s", why.message) : 0;
    }
    measure_time(out_variant);
    return 0;
}
