/* SPDX-License-Identifier: MIT */
#include "drivers/can/cia402_profile.h"

#include "drivers/can/cia402.h"

#include <stdio.h>
#include <string.h>

const struct cia402_profile *cia402_profile_find(const char *name)
{
    for (size_t i = 0; cia402_profiles[i]; i++)
        if (strcmp(cia402_profiles[i]->name, name) == 0)
            return cia402_profiles[i];
    return NULL;
}

const struct cia402_profile *cia402_profile_identify(uint32_t vendor, uint32_t product)
{
    const struct cia402_profile *best = &cia402_profile_generic;
    for (size_t i = 0; cia402_profiles[i]; i++) {
        const struct cia402_profile *p = cia402_profiles[i];
        bool told = p->vendor != 0 || p->product != 0;
        if (!told || p->vendor != vendor || (p->product != 0 && p->product != product))
            continue;
        if (best == &cia402_profile_generic || p->product != 0)
            best = p;
    }
    return best;
}

/// What a make takes, for a person.
static void describe(const struct cia402_profile *self, char *out_text, size_t size)
{
    int used = snprintf(out_text, size, "%u..%u x 10^%d", self->units_min, self->units_max, self->exponent_min);
    if (self->exponent_max > self->exponent_min && used > 0 && (size_t)used < size)
        used += snprintf(out_text + used, size - (size_t)used, "..10^%d", self->exponent_max);
    if (used > 0 && (size_t)used < size)
        used += snprintf(out_text + used, size - (size_t)used, " s");
    if (self->period_step_us != 0 && used > 0 && (size_t)used < size)
        used += snprintf(out_text + used, size - (size_t)used, ", multiples of %lu us",
                         (unsigned long)self->period_step_us);
    if (self->period_min_us != 0 && used > 0 && (size_t)used < size)
        used += snprintf(out_text + used, size - (size_t)used, ", at least %lu us", (unsigned long)self->period_min_us);
    if (self->period_max_us != 0 && used > 0 && (size_t)used < size)
        snprintf(out_text + used, size - (size_t)used, ", at most %lu us", (unsigned long)self->period_max_us);
}

/// The same period with another exponent, as long as the make's are not met; false if there is none.
static bool fit(const struct cia402_profile *self, uint32_t period_us, uint8_t *out_units, int8_t *out_exponent)
{
    for (int8_t exponent = self->exponent_max; exponent >= self->exponent_min; exponent--) {
        uint32_t unit_us = cia402_period_us(1, exponent);
        uint32_t units = unit_us == 0 ? 0 : period_us / unit_us;
        if (units == 0 || units * unit_us != period_us || units < self->units_min || units > self->units_max)
            continue;
        *out_units = (uint8_t)units;
        *out_exponent = exponent;
        return true;
    }
    return false;
}

bool cia402_profile_period(const struct cia402_profile *self, double rate_hz, uint8_t *out_units, int8_t *out_exponent,
                           char *out_text, size_t text_size)
{
    char takes[120];
    describe(self, takes, sizeof takes);
    uint8_t units;
    int8_t exponent;
    bool whole = rate_hz > 0.0 && rate_hz <= 20000.0 && cia402_period_encode(1.0 / rate_hz, &units, &exponent);
    uint32_t period_us = whole ? cia402_period_us(units, exponent) : 0;
    bool within = period_us >= self->period_min_us && (self->period_max_us == 0 || period_us <= self->period_max_us) &&
                  (self->period_step_us == 0 || period_us % self->period_step_us == 0);
    if (whole && within && fit(self, period_us, out_units, out_exponent))
        return true;
    snprintf(out_text, text_size, "sample rate %g Hz: 1 / %g Hz = %.6g us; object 60C2 of %s takes %s", rate_hz,
             rate_hz, 1e6 / rate_hz, self->make, takes);
    return false;
}
