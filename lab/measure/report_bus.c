/* SPDX-License-Identifier: MIT */
/* Bus timing, as the run's keys have it. */
#include "lab/measure/report_parts.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { bins_max = 20 };
/// Beyond this share of the period the samples are uneven enough to be seen in a response (docs/bus.md).
static const double spacing_share_max = 0.1;

/// Key `NAME_us`: "mean 19.1, std 75.5, p99 100, max 3077".
struct timing {
    double mean_us, std_us, p99_us, max_us;
};

struct histogram {
    size_t count;
    double bins[bins_max];
};

/// A run's key as a number; NaN if it is not there.
static double key_number(const struct run *run, const char *key)
{
    const char *text = run_key(run, key);
    return text ? strtod(text, NULL) : NAN;
}

static bool read_timing(const struct run *run, const char *key, struct timing *out)
{
    const char *text = run_key(run, key);
    return text && sscanf(text, "mean %lf, std %lf, p99 %lf, max %lf", &out->mean_us, &out->std_us, &out->p99_us,
                          &out->max_us) == 4;
}

/// "[1, 2, 3]"
static bool read_numbers(const struct run *run, const char *key, struct histogram *out)
{
    const char *text = run_key(run, key);
    out->count = 0;
    if (!text || *text != '[') {
        return false;
    }
    do {
        char *end;
        out->bins[out->count] = strtod(text + 1, &end);
        if (end == text + 1) {
            return false;
        }
        out->count++;
        text = end;
    } while (*text == ',' && out->count < bins_max);
    return *text == ']';
}

void report_add_bus_note(struct page *page, const struct run *run)
{
    struct timing spacing;
    const double limit_us = 1e6 * spacing_share_max / run->sample_rate_hz;
    if (!read_timing(run, "sync_jitter_us", &spacing)) {
        return;
    }
    if (spacing.max_us <= limit_us) {
        page_add_note(page, page_good, "SYNC is even",
                      "its spacing is off by %.0f µs at worst, less than a tenth of the period, %.0f µs.",
                      spacing.max_us, limit_us);
    } else {
        page_add_note(page, page_warning, "SYNC is uneven",
                      "its spacing is off by %.0f µs at worst, by up to %.0f µs in 99 %% of the cycles; a tenth of the "
                      "period is %.0f µs. %s",
                      spacing.max_us, spacing.p99_us, limit_us,
                      spacing.p99_us <= limit_us ? "Few cycles do that; look at how many below."
                                                 : "A real drive is sampled unevenly then, and its response with it.");
    }
}

static void write_names(const struct histogram *ends, char (*out_text)[24], const char **out_names)
{
    for (size_t i = 0; i <= ends->count; i++) {
        if (i < ends->count) {
            snprintf(out_text[i], sizeof out_text[i], "%.0f", ends->bins[i]);
        } else {
            snprintf(out_text[i], sizeof out_text[i], "more");
        }
        out_names[i] = out_text[i];
    }
}

/// Counts go over decades, and the rare late cycle is the one that matters: a single one has to be seen.
static void add_bars(struct figure *figure, const char *label, const struct histogram *histogram,
                     enum figure_colour colour)
{
    struct figure_panel *panel = figure_add_panel(figure, label, axis_log);
    panel->height = 120;
    panel->low = 0.5;
    figure_add_bars(panel, "", histogram->count, NULL, histogram->bins)->colour = colour;
}

static void add_histograms(struct page *page, const struct run *run)
{
    struct histogram ends, spacing, reply;
    struct timing spacing_us, reply_us;
    char texts[bins_max + 1][24];
    const char *names[bins_max + 1];
    struct figure figure;
    if (!read_numbers(run, "histogram_ends_us", &ends) || !read_numbers(run, "sync_jitter_histogram", &spacing) ||
        !read_numbers(run, "sync_to_answer_histogram", &reply) || !read_timing(run, "sync_jitter_us", &spacing_us) ||
        !read_timing(run, "sync_to_answer_us", &reply_us) || spacing.count != ends.count + 1 ||
        reply.count != ends.count + 1) {
        page_add_paragraph(page, "The protocol has no SYNC: there is no spacing and no answering time to show.");
        return;
    }
    write_names(&ends, texts, names);
    figure_start(&figure, "time in µs, up to", axis_linear);
    figure_set_categories(&figure, spacing.count, names);
    add_bars(&figure, "cycles: SYNC off its spacing", &spacing, figure_blue);
    add_bars(&figure, "cycles: SYNC to last answer", &reply, figure_vermilion);
    page_add_figure(page, &figure,
                    "How many cycles took how long. SYNC off its spacing: mean %.0f µs, standard deviation %.0f µs, "
                    "99 %% within %.0f µs, worst %.0f µs. SYNC to answer: mean %.0f µs, standard deviation %.0f µs, "
                    "99 %% within %.0f µs, worst %.0f µs; the drive's own delay and the wire are in it. One period is "
                    "%.0f µs.",
                    spacing_us.mean_us, spacing_us.std_us, spacing_us.p99_us, spacing_us.max_us, reply_us.mean_us,
                    reply_us.std_us, reply_us.p99_us, reply_us.max_us, 1e6 / run->sample_rate_hz);
}

void report_add_bus(struct page *page, const struct run *run)
{
    const char *rights = run_key(run, "real_time");
    const double load = key_number(run, "bus_load");
    const char *drive = run_key(run, "drive");
    page_add_section(page, "Bus timing");
    if (!rights) {
        page_add_paragraph(page,
                           "%s is not measured in real time: there is no jitter, and no sample can be late on a bus "
                           "outside of the program.%s",
                           drive ? drive : "This drive", isfinite(load) ? "" : " There is no bus either.");
        if (isfinite(load)) {
            page_add_paragraph(page, "The bus inside the program was busy for %.0f %% of the time.", 100.0 * load);
        }
        return;
    }
    page_start_pairs(page);
    page_add_pair(page, "bus", "%.4g Mbit/s, planned load %.0f %% of it", 1e-6 * key_number(run, "bus_bitrate"),
                  100.0 * load);
    page_add_pair(page, "real-time rights", "%s", rights);
    page_add_pair(page, "SYNCs late by more than half a period", "%.0f", key_number(run, "syncs_late"));
    page_add_pair(page, "frames not sent", "%.0f", key_number(run, "frames_unsent"));
    page_add_pair(page, "frames lost on arrival", "%.0f", key_number(run, "frames_lost"));
    page_add_pair(page, "error frames", "%.0f", key_number(run, "error_frames"));
    page_end_pairs(page);
    add_histograms(page, run);
}
