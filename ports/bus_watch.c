/* SPDX-License-Identifier: MIT */
#include "ports/bus_watch.h"

#include "drivers/can/sync.h"

#include <math.h>

const uint32_t bus_histogram_ends_us[bus_histogram_bins - 1] = {5,   10,   20,   50,   100,   200,
                                                                500, 1000, 2000, 5000, 10000, 50000};

void bus_histogram_add(struct bus_histogram *self, uint32_t value_us)
{
    unsigned bin = 0;
    while (bin < bus_histogram_bins - 1 && value_us > bus_histogram_ends_us[bin]) {
        bin++;
    }
    self->bins[bin]++;
    self->least_us = self->count == 0 || value_us < self->least_us ? value_us : self->least_us;
    self->greatest_us = value_us > self->greatest_us ? value_us : self->greatest_us;
    self->count++;
    self->sum_us += value_us;
    self->sum_squares_us2 += (double)value_us * value_us;
}

double bus_histogram_mean_us(const struct bus_histogram *self)
{
    return self->count == 0 ? 0.0 : self->sum_us / (double)self->count;
}

double bus_histogram_std_us(const struct bus_histogram *self)
{
    if (self->count < 2) {
        return 0.0;
    }
    double mean = bus_histogram_mean_us(self), count = (double)self->count;
    return sqrt(fmax(0.0, (self->sum_squares_us2 - count * mean * mean) / (count - 1.0)));
}

uint32_t bus_histogram_quantile_us(const struct bus_histogram *self, double share)
{
    double seen = 0.0;
    for (unsigned bin = 0; bin < bus_histogram_bins - 1; bin++) {
        seen += self->bins[bin];
        if (seen >= share * (double)self->count) {
            return bus_histogram_ends_us[bin] < self->greatest_us ? bus_histogram_ends_us[bin] : self->greatest_us;
        }
    }
    return self->greatest_us;
}

void bus_watch_start(struct bus_watch *self, uint32_t period_us, uint16_t reply_id)
{
    *self = (struct bus_watch){.period_us = period_us, .reply_id = reply_id};
}

static uint32_t span_us(uint64_t from_us, uint64_t to_us)
{
    uint64_t span = to_us > from_us ? to_us - from_us : 0;
    return span < UINT32_MAX ? (uint32_t)span : UINT32_MAX;
}

static void take_sync(struct bus_watch *self, uint64_t time_us)
{
    if (self->synced) {
        uint32_t spacing = span_us(self->sync_us, time_us);
        bool long_one = spacing > self->period_us;
        uint32_t off = long_one ? spacing - self->period_us : self->period_us - spacing;
        bus_histogram_add(&self->spacing, off);
        self->syncs_late += long_one && off > self->period_us / 2;
    }
    self->synced = true;
    self->replied = false;
    self->sync_us = time_us;
}

void bus_watch_frame(struct bus_watch *self, const struct can_frame *frame, uint64_t time_us)
{
    if (self->period_us == 0) {
        return;
    }
    if (frame->id == sync_cob_id) {
        take_sync(self, time_us);
    } else if (self->reply_id != 0 && frame->id == self->reply_id && self->synced && !self->replied) {
        self->replied = true;
        bus_histogram_add(&self->reply, span_us(self->sync_us, time_us));
    }
}
