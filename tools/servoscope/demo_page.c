/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/demo_page.h"

#include "lab/design/report.h"
#include "lab/diagnose/report.h"
#include "lab/diagnose/wording.h"
#include "lab/estimate/report.h"
#include "lab/page/page.h"
#include "lab/record/atomic_file.h"
#include "tools/servoscope/quiet_run.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>

#ifndef SERVOSCOPE_VERSION
#define SERVOSCOPE_VERSION "0.1.0"
#endif

/// Whether the one cause found is the one that was hidden.
static bool is_found(const struct demo_page *self)
{
    return self->diagnosis->cause_count == 1 && self->diagnosis->causes[0].effect == self->hiding->effect;
}

/// What was found, in the words in which hiding_describe tells what was hidden.
static void describe_found(const struct diagnosis *d, char out_text[wording_size])
{
    size_t used = 0;
    out_text[0] = '\0';
    for (size_t c = 0; c < d->cause_count && used < wording_size; c++) {
        const struct sim_effect *effect = sim_effects[d->causes[c].effect];
        used += (size_t)snprintf(out_text + used, wording_size - used, "%s%s:", c > 0 ? "; " : "", effect->id);
        for (size_t i = 0; i < effect->parameter_count && used < wording_size; i++) {
            char estimate[2 * wording_short];
            wording_estimate(d->causes[c].values[i], d->causes[c].deviations[i], estimate);
            used += (size_t)snprintf(out_text + used, wording_size - used, "%s %s %s", i > 0 ? "," : "",
                                     effect->parameters[i].name, estimate);
        }
    }
    if (d->cause_count == 0) {
        wording_headline(d, out_text);
    }
}

static void add_story(struct page *page, const struct demo_page *self)
{
    char hidden[wording_size], found[wording_size];
    hiding_describe(self->hiding, sizeof hidden, hidden);
    describe_found(self->diagnosis, found);
    page_add_paragraph(page,
                       "A simulated belt drive was measured over a CAN bus inside the program. One thing in it differs "
                       "from the model that is believed (nominal.json); the diagnosis below was not told which.");
    page_add_note(page, is_found(self) ? page_good : page_warning,
                  is_found(self) ? "What was hidden was found" : "What was hidden and what was found differ",
                  "Hidden: %s. Found: %s.", hidden, found);
}

static double peak_of(const struct run *run, const char *column)
{
    const double *values = run_column(run, column);
    double peak = 0.0;
    for (size_t n = 0; values && n < run->rows; n++) {
        peak = fmax(peak, fabs(values[n]));
    }
    return peak;
}

static void add_measurement(struct page *page, const struct demo_page *self)
{
    const struct run *run = &self->runs[0];
    page_add_section(page, "Measurement");
    page_add_paragraph(page,
                       "Cyclic synchronous position with velocity and torque feed-forward (CiA 402), the table as "
                       "position reference. The second run has other phases, another level and other noise.");
    page_start_pairs(page);
    page_add_pair(page, "periods", "%zu to settle, %zu counted, of %zu samples at %g Hz", run->settle_periods,
                  run->periods, run->period_samples, run->sample_rate_hz);
    page_add_pair(page, "bus", "%g Mbit/s, load %.0f %%, %lu frames a run", 1e-6 * self->bus->bitrate,
                  100.0 * self->bus->bus_load, (unsigned long)self->bus->frames);
    for (size_t r = 0; r < demo_runs; r++) {
        const char *lost = run_key(&self->runs[r], "samples_lost");
        page_add_pair(page, r == 0 ? "first run" : "second run", "peaks %.3f Nm and %.3f rad/s, %s samples lost",
                      peak_of(&self->runs[r], "torque_ref_Nm"), peak_of(&self->runs[r], "velocity_rad_per_s"),
                      lost ? lost : "no");
    }
    page_add_pair(page, "designed for",
                  "%.3f Nm and %.3f rad/s on a rigid axis without friction; friction, belt and control come on top",
                  self->design->peak.torque_Nm, self->design->peak.velocity_rad_per_s);
    page_end_pairs(page);
}

static void write_sections(FILE *stream, const struct demo_page *self, const struct frf *nominal,
                           const struct frf *extended)
{
    const struct frf_model_curve curves[] = {
        {"nominal model", nominal->count, nominal->frequency_hz, nominal->real, nominal->imag, NULL, true},
        {"extended model", extended->count, extended->frequency_hz, extended->real, extended->imag, NULL, true},
    };
    const struct frf_report_options options = {
        .known_delay_s = 0.5 / self->runs[0].sample_rate_hz,
        .delay_reason = "half a sample: torque is held between samples",
        .curve_count = self->diagnosis->cause_count > 0 ? 2 : 1,
        .curves = curves,
    };
    char subtitle[96];
    struct page page;
    snprintf(subtitle, sizeof subtitle, "servoscope demo --seed %lld: belt drive on a simulated CAN bus", self->seed);
    page_start(&page, stream, "From limits to a named cause", subtitle);
    add_story(&page, self);
    design_report_section(&page, "Excitation", self->request, self->design);
    add_measurement(&page, self);
    frf_report_section(&page, self->measured, &options);
    diagnosis_report_sections(&page, self->diagnosis);
    page_end(&page, "servoscope " SERVOSCOPE_VERSION);
}

int demo_page_write(const char *path, const struct demo_page *self, struct error *out_error)
{
    struct frf nominal = {0};
    struct frf extended = {0};
    struct atomic_file file;
    FILE *stream = NULL;
    int status = quiet_run_response(&self->hiding->nominal_model, self->table, &nominal, out_error);
    status = status ? status : quiet_run_response(&self->diagnosis->extended_model, self->table, &extended, out_error);
    if (!status) {
        stream = atomic_file_open(&file, path, out_error);
        status = stream ? 0 : error_refused;
    }
    if (stream) {
        write_sections(stream, self, &nominal, &extended);
        status = atomic_file_commit(&file, out_error);
    }
    frf_free(&nominal);
    frf_free(&extended);
    return status;
}
