/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/measured.h"

#include <stdio.h>

const char *measured_end_str(enum measure_end end)
{
    switch (end) {
    case measure_complete:
        return "complete";
    case measure_interrupted:
        return "interrupted";
    case measure_tripped:
        return "limit";
    case measure_failed:
        break;
    }
    return "drive";
}

void measured_add_bus(const struct door *door, cJSON *io_object)
{
    struct door_statistics bus;
    door_read_statistics(door, &bus);
    cJSON *added = cJSON_AddObjectToObject(io_object, "bus");
    cJSON_AddNumberToObject(added, "bitrate", bus.bitrate);
    cJSON_AddNumberToObject(added, "load", bus.bus_load);
    cJSON_AddNumberToObject(added, "frames", bus.frames);
    cJSON_AddNumberToObject(added, "targets_lost", bus.targets_lost);
    cJSON_AddNumberToObject(added, "setpoints_clipped", bus.setpoints_clipped);
    cJSON_AddNumberToObject(added, "samples_clipped", bus.samples_clipped);
}

cJSON *measured_json(const struct measured *self)
{
    const struct run *run = self->run;
    const struct measure_report *report = self->report;
    cJSON *object = cJSON_CreateObject();
    cJSON_AddStringToObject(object, "out", self->path);
    cJSON_AddStringToObject(object, "ended", measured_end_str(report->end));
    cJSON_AddStringToObject(object, "stopped_by", report->stopped_by);
    cJSON_AddNumberToObject(object, "rows", (double)run->rows);
    cJSON_AddNumberToObject(object, "rows_planned", (double)report->rows_planned);
    cJSON_AddNumberToObject(object, "period_samples", (double)run->period_samples);
    cJSON_AddNumberToObject(object, "periods", (double)run->periods);
    cJSON_AddNumberToObject(object, "settle_periods", (double)run->settle_periods);
    cJSON_AddNumberToObject(object, "sample_rate_hz", run->sample_rate_hz);
    cJSON_AddNumberToObject(object, "samples_lost", (double)report->rows_lost);
    cJSON_AddNumberToObject(object, "samples_late", report->counters.samples_late);
    cJSON_AddNumberToObject(object, "torque_clipped", report->torque_clipped);
    cJSON_AddNumberToObject(object, "samples_per_s", self->rate_per_s);
    if (self->door) {
        measured_add_bus(self->door, object);
    }
    return object;
}

void measured_print_bus(const struct door *door)
{
    struct door_statistics bus;
    door_read_statistics(door, &bus);
    printf(
        "  bus at %.3g Mbit/s, load %.0f %%, %u frames; %u set-points lost, %u clipped, %u measured values clipped\n",
        1e-6 * bus.bitrate, 100.0 * bus.bus_load, (unsigned)bus.frames, (unsigned)bus.targets_lost,
        (unsigned)bus.setpoints_clipped, (unsigned)bus.samples_clipped);
}

void measured_print(const struct measured *self)
{
    const struct run *run = self->run;
    const struct measure_report *report = self->report;
    printf("%s: %zu settling and %zu counted periods of %zu samples at %.6g Hz, %zu of %zu rows, %zu lost, %u late "
           "(%.3g samples/s)\n",
           self->path, run->settle_periods, run->periods, run->period_samples, run->sample_rate_hz, run->rows,
           report->rows_planned, report->rows_lost, (unsigned)report->counters.samples_late, self->rate_per_s);
    if (self->door) {
        measured_print_bus(self->door);
    }
}

int measured_keep(const struct measured *self, struct error *out_error)
{
    bool set = run_set_key(self->run, "drive", self->source);
    if (set && self->door) {
        struct door_statistics bus;
        char load[32];
        door_read_statistics(self->door, &bus);
        snprintf(load, sizeof load, "%.4g", bus.bus_load);
        set = run_set_key(self->run, "bus_load", load);
    }
    if (!set) {
        return error_set(out_error, error_refused, "%s: not written: memory is short", self->path);
    }
    return run_write(self->path, self->run, out_error);
}
