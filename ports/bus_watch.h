/* SPDX-License-Identifier: MIT */
/// How punctual a bus is: spread of the SYNC's spacing and time from SYNC to the answers, as histograms. A port shows
/// it every frame with the best time that it has for it (the kernel's stamp where there is one).
#ifndef SERVOSCOPE_PORTS_BUS_WATCH_H
#define SERVOSCOPE_PORTS_BUS_WATCH_H

#include "drivers/can/can_frame.h"

#include <stdbool.h>
#include <stdint.h>

enum { bus_histogram_bins = 13 };

/// Upper ends of the bins, us; the last bin has none.
extern const uint32_t bus_histogram_ends_us[bus_histogram_bins - 1];

struct bus_histogram {
    uint64_t count;
    uint32_t bins[bus_histogram_bins];
    double sum_us, sum_squares_us2;
    uint32_t least_us, greatest_us; ///< of all; 0 if there are none
};

void bus_histogram_add(struct bus_histogram *self, uint32_t value_us);

double bus_histogram_mean_us(const struct bus_histogram *self);

/// Standard deviation of one value; 0 for fewer than two.
double bus_histogram_std_us(const struct bus_histogram *self);

/// Upper end of the bin that the given share (0..1) of all values has been reached in, at most the greatest value.
uint32_t bus_histogram_quantile_us(const struct bus_histogram *self, double share);

struct bus_watch {
    uint32_t period_us; ///< of the SYNC as planned; 0: not known, then nothing is watched
    uint16_t reply_id;  ///< COB-ID of the last TPDO of a cycle; 0: no replies are watched
    bool synced;        ///< a SYNC has come, at sync_us
    bool replied;       ///< and has been answered
    uint64_t sync_us;
    uint32_t syncs_late;          ///< SYNCs more than half a period behind their place after the one before
    struct bus_histogram spacing; ///< |time since the SYNC before - period|
    struct bus_histogram reply;   ///< time from SYNC to the answer
};

/// Forgets what was seen; from here on SYNCs are expected each `period_us`, answered by `reply_id`.
void bus_watch_start(struct bus_watch *self, uint32_t period_us, uint16_t reply_id);

/// Takes one frame of the bus, sent or received, at the time it was on the wire as far as is known.
void bus_watch_frame(struct bus_watch *self, const struct can_frame *frame, uint64_t time_us);

#endif
