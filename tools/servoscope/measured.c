/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/measured.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

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

static void add_histogram(cJSON *io_object, const char *name, const struct bus_histogram *histogram)
{
    cJSON *added = cJSON_AddObjectToObject(io_object, name);
    cJSON_AddNumberToObject(added, "count", (double)histogram->count);
    cJSON_AddNumberToObject(added, "mean_us", bus_histogram_mean_us(histogram));
    cJSON_AddNumberToObject(added, "std_us", bus_histogram_std_us(histogram));
    cJSON_AddNumberToObject(added, "p99_us", bus_histogram_quantile_us(histogram, 0.99));
    cJSON_AddNumberToObject(added, "max_us", histogram->greatest_us);
    cJSON *ends = cJSON_AddArrayToObject(added, "bin_ends_us"), *counts = cJSON_AddArrayToObject(added, "bins");
    for (int i = 0; i < bus_histogram_bins; i++) {
        if (i < bus_histogram_bins - 1) {
            cJSON_AddItemToArray(ends, cJSON_CreateNumber(bus_histogram_ends_us[i]));
        }
        cJSON_AddItemToArray(counts, cJSON_CreateNumber(histogram->bins[i]));
    }
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
    if (bus.in_real_time) {
        cJSON_AddNumberToObject(added, "cycle_bits", bus.cycle_bits);
        cJSON_AddStringToObject(added, "real_time", bus.rights);
        cJSON_AddNumberToObject(added, "sync_timeout_s", 1e-6 * bus.sync_timeout_us);
        cJSON_AddNumberToObject(added, "syncs_late", bus.syncs_late);
        cJSON_AddNumberToObject(added, "frames_unsent", bus.frames_unsent);
        cJSON_AddNumberToObject(added, "frames_lost", bus.frames_lost);
        cJSON_AddNumberToObject(added, "error_frames", bus.error_frames);
        add_histogram(added, "sync_jitter", &bus.spacing);
        add_histogram(added, "sync_to_answer", &bus.reply);
    }
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

static void print_histogram(const char *what, const struct bus_histogram *histogram)
{
    printf("  %s: mean %.0f us, 99 %% within %lu us, worst %lu us\n   ", what, bus_histogram_mean_us(histogram),
           (unsigned long)bus_histogram_quantile_us(histogram, 0.99), (unsigned long)histogram->greatest_us);
    for (int i = 0; i < bus_histogram_bins - 1; i++) {
        if (histogram->bins[i] > 0) {
            printf(" <=%lu: %lu", (unsigned long)bus_histogram_ends_us[i], (unsigned long)histogram->bins[i]);
        }
    }
    if (histogram->bins[bus_histogram_bins - 1] > 0) {
        printf(" more: %lu", (unsigned long)histogram->bins[bus_histogram_bins - 1]);
    }
    puts("");
}

static void print_real_time(const struct door_statistics *bus)
{
    printf(
        "  bus: %u bits per cycle x %g Hz / %.3g Mbit/s = load %.0f %%; %lu frames, %lu not sent, %lu lost on arrival, "
        "%lu error frames; %lu set-points clipped\n",
        bus->cycle_bits, bus->rate_hz, 1e-6 * bus->bitrate, 100.0 * bus->bus_load, (unsigned long)bus->frames,
        (unsigned long)bus->frames_unsent, (unsigned long)bus->frames_lost, (unsigned long)bus->error_frames,
        (unsigned long)bus->setpoints_clipped);
    printf("  real time: %s; %lu SYNCs late by more than half a period\n", bus->rights, (unsigned long)bus->syncs_late);
    if (bus->spacing.count > 0) { // a protocol without SYNC has none
        print_histogram("SYNC off its spacing", &bus->spacing);
        print_histogram("SYNC to answer", &bus->reply);
    }
}

void measured_print_bus(const struct door *door)
{
    struct door_statistics bus;
    door_read_statistics(door, &bus);
    if (bus.in_real_time) {
        print_real_time(&bus);
        return;
    }
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

#if defined(__GNUC__)
__attribute__((format(printf, 3, 4)))
#endif
static bool
set_text(struct run *run, const char *key, const char *format, ...)
{
    char text[200];
    va_list values;
    va_start(values, format);
    vsnprintf(text, sizeof text, format, values);
    va_end(values);
    return run_set_key(run, key, text);
}

/// mean, std, p99 and max as keys, and the counts of the histogram's bins.
static bool set_histogram(struct run *run, const char *name, const struct bus_histogram *histogram)
{
    char key[64], counts[200] = "[";
    for (int i = 0; i < bus_histogram_bins; i++) {
        size_t used = strlen(counts);
        snprintf(&counts[used], sizeof counts - used, "%lu%s", (unsigned long)histogram->bins[i],
                 i + 1 < bus_histogram_bins ? ", " : "]");
    }
    snprintf(key, sizeof key, "%s_us", name);
    bool set = set_text(run, key, "mean %.1f, std %.1f, p99 %lu, max %lu", bus_histogram_mean_us(histogram),
                        bus_histogram_std_us(histogram), (unsigned long)bus_histogram_quantile_us(histogram, 0.99),
                        (unsigned long)histogram->greatest_us);
    snprintf(key, sizeof key, "%s_histogram", name);
    return set && run_set_key(run, key, counts);
}

static bool set_histograms(struct run *run, const struct door_statistics *bus)
{
    char ends[160] = "[";
    for (int i = 0; i < bus_histogram_bins - 1; i++) {
        size_t used = strlen(ends);
        snprintf(&ends[used], sizeof ends - used, "%lu%s", (unsigned long)bus_histogram_ends_us[i],
                 i + 2 < bus_histogram_bins ? ", " : "]");
    }
    return run_set_key(run, "histogram_ends_us", ends) && set_histogram(run, "sync_jitter", &bus->spacing) &&
           set_histogram(run, "sync_to_answer", &bus->reply);
}

static bool set_real_time(struct run *run, const struct door_statistics *bus)
{
    return set_text(run, "bus_bitrate", "%lu", (unsigned long)bus->bitrate) &&
           run_set_key(run, "real_time", bus->rights) &&
           set_text(run, "syncs_late", "%lu", (unsigned long)bus->syncs_late) &&
           set_text(run, "frames_unsent", "%lu", (unsigned long)bus->frames_unsent) &&
           set_text(run, "frames_lost", "%lu", (unsigned long)bus->frames_lost) &&
           set_text(run, "error_frames", "%lu", (unsigned long)bus->error_frames) &&
           (bus->spacing.count == 0 || set_histograms(run, bus));
}

int measured_keep(const struct measured *self, struct error *out_error)
{
    bool set = run_set_key(self->run, "drive", self->source);
    if (set && self->door) {
        struct door_statistics bus;
        char load[32];
        door_read_statistics(self->door, &bus);
        snprintf(load, sizeof load, "%.4g", bus.bus_load);
        set = run_set_key(self->run, "bus_load", load) && (!bus.in_real_time || set_real_time(self->run, &bus));
    }
    if (!set) {
        return error_set(out_error, error_refused, "%s: not written: memory is short", self->path);
    }
    return run_write(self->path, self->run, out_error);
}
