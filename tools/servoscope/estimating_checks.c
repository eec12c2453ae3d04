/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/estimating_checks.h"

#include "lab/estimate/method.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static void describe_direction(const struct direction *direction, char *out, size_t size)
{
    size_t used = 0;
    out[0] = '\0';
    for (size_t i = 0; i < direction->count && used + 1 < size; i++) {
        const struct direction_finding *found = &direction->found[i];
        const int length = snprintf(out + used, size - used, "%s%s counts the other way round than %s",
                                    used > 0 ? ", " : "", found->name, found->against);
        used += length > 0 ? (size_t)length : 0;
    }
}

bool estimating_checks_measure(const struct clocked *recording, struct frf *io_frf, struct estimating_checks *out)
{
    struct direction direction;
    *out = (struct estimating_checks){.clock = recording->clock,
                                      .resampled = recording->is_resampled,
                                      .period_samples = recording->recording.period_samples};
    if (strcmp(io_frf->method, "mean") == 0 && !succession_test(&recording->recording, io_frf, &out->succession)) {
        return false;
    }
    if (!direction_measure(&recording->recording, &direction)) {
        return false;
    }
    describe_direction(&direction, out->direction, sizeof out->direction);
    return estimating_checks_apply(out, io_frf);
}

static bool set_clock_keys(const struct estimating_checks *self, struct frf *io_frf)
{
    return clock_set_keys(&self->clock, self->period_samples, self->resampled, io_frf);
}

bool estimating_checks_carry(const struct estimating_checks *self, struct frf *io_frf)
{
    bool set = estimate_key(io_frf, "clock")[0] || set_clock_keys(self, io_frf);
    if (self->direction[0] && !estimate_key(io_frf, "warning_direction")[0]) {
        set = set && estimate_set_key(io_frf, "warning_direction", "%s", self->direction);
    }
    if (self->succession.certain && !estimate_key(io_frf, "period_correlation")[0]) {
        set = set && estimate_set_key(io_frf, "period_correlation", "%.3g", self->succession.correlation);
    }
    return set;
}

bool estimating_checks_apply(const struct estimating_checks *self, struct frf *io_frf)
{
    succession_enlarge(&self->succession, io_frf);
    return estimating_checks_carry(self, io_frf);
}

static double parts_per_million(const struct estimating_checks *self, double samples)
{
    return 1e6 * samples / (double)self->period_samples;
}

static void say_clock(const struct estimating_checks *self, struct remarks *io_remarks)
{
    const struct clock *clock = &self->clock;
    const double length = (double)self->period_samples;
    char drift[160] = "";
    char wander[64] = "";
    if (clock->state == clock_apart) {
        remarks_add(io_remarks, remark_warning, "clock",
                    "the input repeats every %.9g samples, the output every %.9g: two clocks, or a drive that changes",
                    length + clock->input.offset_samples, length + clock->output.offset_samples);
    }
    if (clock->state != clock_off) {
        return;
    }
    if (clock->both.drift_samples != 0.0) {
        snprintf(drift, sizeof drift, ", and drifts by %.3g ppm per period",
                 parts_per_million(self, clock->both.drift_samples));
    }
    if (clock->both.wander > 0.0) {
        snprintf(wander, sizeof wander, ", and wanders by %.2g samples", clock->both.wander);
    }
    remarks_add(io_remarks, remark_fact, "clock", "a period is %.9g samples (std %.2g), not %zu: %+.3g ppm%s%s; %s",
                length + clock->both.offset_samples, clock->both.offset_std, self->period_samples,
                parts_per_million(self, clock->both.offset_samples), drift, wander,
                self->resampled ? "resampled to it" : "too little to matter");
}

static void say_succession(const struct succession *self, struct remarks *io_remarks)
{
    if (!self->certain) {
        return;
    }
    double largest = 1.0;
    for (size_t block = 0; block < self->block_count; block++) {
        largest = fmax(largest, self->factor[block]);
    }
    if (largest > 1.0) {
        remarks_add(io_remarks, remark_fact, "period_correlation",
                    "scatter of successive periods is alike (correlation %.2g over all lines): std is up to %.3g times "
                    "what independent periods would give",
                    self->correlation, largest);
    } else {
        remarks_add(io_remarks, remark_fact, "period_correlation",
                    "scatter of successive periods alternates (correlation %.2g over all lines): std is rather too "
                    "large",
                    self->correlation);
    }
}

void estimating_checks_say(const struct estimating_checks *self, struct remarks *io_remarks)
{
    say_clock(self, io_remarks);
    say_succession(&self->succession, io_remarks);
    if (self->direction[0]) {
        remarks_add(io_remarks, remark_warning, "direction", "%s", self->direction);
    }
}

void estimating_checks_add_json(const struct estimating_checks *self, cJSON *io_object)
{
    static const char *const states[] = {"untested", "steady", "off", "apart"};
    const struct clock *clock = &self->clock;
    const double length = (double)self->period_samples;
    if (self->period_samples == 0) {
        return;
    }
    cJSON *object = cJSON_AddObjectToObject(io_object, "clock");
    cJSON_AddStringToObject(object, "state", states[clock->state]);
    if (clock->state != clock_untested) {
        cJSON_AddNumberToObject(object, "true_period_samples", length + clock->both.offset_samples);
        cJSON_AddNumberToObject(object, "true_period_std", clock->both.offset_std);
        cJSON_AddNumberToObject(object, "drift_samples_per_period", clock->both.drift_samples);
        cJSON_AddNumberToObject(object, "wander_samples", clock->both.wander);
        cJSON_AddBoolToObject(object, "resampled", self->resampled);
    }
    if (self->succession.periods > 0) {
        cJSON_AddNumberToObject(io_object, "period_correlation", self->succession.correlation);
        cJSON_AddNumberToObject(io_object, "period_correlation_chance", self->succession.chance);
    }
    if (self->direction[0]) {
        cJSON_AddStringToObject(io_object, "warning_direction", self->direction);
    }
}
