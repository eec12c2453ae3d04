/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/estimating_page.h"

#include "lab/estimate/method.h"
#include "lab/estimate/report.h"
#include "lab/page/page.h"
#include "tools/servoscope/estimating_model.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifndef SERVOSCOPE_VERSION
#define SERVOSCOPE_VERSION "0.1.0"
#endif

enum { name_size = 400, grid_points = 800, settling_runs_max = 5 };

static const char *file_name(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash && slash[1] ? slash + 1 : path;
}

/// "run1.csv", "run1.csv and run2.csv", "run1.csv and 4 more".
static void write_names(const struct option_values *sources, char out_text[name_size])
{
    const char *first = file_name(sources->items[0]);
    if (sources->count == 1) {
        snprintf(out_text, name_size, "%s", first);
    } else if (sources->count == 2) {
        snprintf(out_text, name_size, "%s and %s", first, file_name(sources->items[1]));
    } else {
        snprintf(out_text, name_size, "%s and %zu more", first, sources->count - 1);
    }
}

/// A model's response on a grid that ends where the lines do and holds all of them, so that they can be compared.
struct grid {
    size_t count;
    double *frequency_hz, *real, *imag, *std;
};

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a;
    const double y = *(const double *)b;
    return (x > y) - (x < y);
}

static bool make_grid(const struct parametric_model *model, const struct frf *lines, double delay_s, struct grid *out)
{
    const double two_pi = 6.283185307179586476925;
    const size_t most = lines->count + grid_points;
    const double first = lines->frequency_hz[0] > 0.0 ? lines->frequency_hz[0] : lines->frequency_hz[lines->count > 1];
    const double last = lines->frequency_hz[lines->count - 1];
    *out = (struct grid){.frequency_hz = malloc(4 * most * sizeof *out->frequency_hz)};
    if (!out->frequency_hz) {
        return false;
    }
    out->real = out->frequency_hz + most;
    out->imag = out->real + most;
    out->std = out->imag + most;
    memcpy(out->frequency_hz, lines->frequency_hz, lines->count * sizeof *out->frequency_hz);
    for (size_t i = 0; i < grid_points; i++) {
        const double share = (double)(i + 1) / (double)(grid_points + 1);
        out->frequency_hz[lines->count + i] = first > 0.0 ? first * pow(last / first, share) : share * last;
    }
    qsort(out->frequency_hz, most, sizeof *out->frequency_hz, ascending);
    for (size_t i = 0; i < most; i++) {
        const double complex turn = cexp(I * two_pi * out->frequency_hz[i] * delay_s);
        const double complex response = parametric_response(model, out->frequency_hz[i], &out->std[i]) * turn;
        out->real[i] = creal(response);
        out->imag[i] = cimag(response);
    }
    out->count = most;
    return true;
}

/// Everything that the response's section is made of.
struct section {
    const char *names[option_values_max];
    char curve_name[name_size];
    struct grid grid;
    struct frf_model_curve curve;
    struct frf_report_options options;
};

static void take_runs(const struct estimating_page_item *item, struct section *io)
{
    const size_t count = item->outcome->run_count;
    if (count < 2 || !item->outcome->responses) {
        return;
    }
    io->options.run_count = count;
    io->options.runs = item->outcome->responses;
    io->options.run_names = io->names;
    comparing_short_names(item->sources, io->names);
}

/// The model, which is kept with the first run.
static bool take_model(const struct estimating_page_item *item, struct section *io)
{
    const struct estimating_outcome *outcome = item->outcome;
    const double delay_s = atof(estimate_key(&outcome->frf, "delay_removed_s"));
    const struct parametric_outcome *found = outcome->runs[0].parametric;
    if (!found || !found->made) {
        return true;
    }
    if (!make_grid(&found->model, &outcome->frf, delay_s, &io->grid)) {
        return false;
    }
    snprintf(io->curve_name, name_size, "model, order %zu over %zu", found->model.structure.numerator_order,
             found->model.structure.denominator_order);
    io->curve = (struct frf_model_curve){
        io->curve_name, io->grid.count, io->grid.frequency_hz, io->grid.real, io->grid.imag, io->grid.std, false};
    io->options.curves = &io->curve;
    io->options.curve_count = 1;
    return true;
}

static void add_response(const struct estimating_page_item *item, struct page *page)
{
    const struct estimating_outcome *outcome = item->outcome;
    struct section section = {.options = {.name = file_name(item->out)}};
    const struct frf *shown = &outcome->frf;
    bool done = take_model(item, &section);
    if (done && section.options.curve_count > 0) {
        shown = &outcome->runs[0].measured;
    }
    take_runs(item, &section);
    if (item->compared) {
        section.options.other_count = item->compared->count;
        section.options.others = item->compared->responses;
        section.options.other_names = item->compared->names;
    }
    if (done) {
        frf_report_section(page, shown, &section.options);
    } else {
        page_add_paragraph(page, "Memory was short for the response.");
    }
    free(section.grid.frequency_hz);
}

/// Poles and zeros of the model.
static void add_models(const struct estimating_page_item *item, struct page *page)
{
    char names[name_size];
    write_names(item->sources, names);
    estimating_model_add_page(item->outcome, names, page);
}

/// Below 4 periods nothing is compared.
static bool has_levels(const struct estimating_summary *run)
{
    return run->levels && run->total >= 4;
}

/// How the output of each recording became periodic.
static void add_settling(const struct estimating_page_item *item, struct page *page)
{
    const struct estimating_outcome *outcome = item->outcome;
    struct figure figure;
    size_t shown = 0;
    size_t longest = 0;
    figure_start(&figure, "period", axis_linear);
    struct figure_panel *panel = figure_add_panel(&figure, "distance from the later half over its size", axis_log);
    for (size_t r = 0; r < outcome->run_count && shown < settling_runs_max; r++) {
        if (has_levels(&outcome->runs[r])) {
            longest = outcome->runs[r].total > longest ? outcome->runs[r].total : longest;
            shown++;
        }
    }
    double *numbers = longest > 0 ? malloc(longest * sizeof *numbers) : NULL;
    if (!numbers) {
        return;
    }
    for (size_t p = 0; p < longest; p++) {
        numbers[p] = (double)(p + 1);
    }
    for (size_t r = 0, s = 0; r < outcome->run_count && s < shown; r++) {
        if (has_levels(&outcome->runs[r])) {
            figure_add_points(panel, file_name(item->sources->items[r]), outcome->runs[r].total, numbers,
                              outcome->runs[r].levels);
            s++;
        }
    }
    page_add_section(page, "Settling");
    page_add_figure(page, &figure,
                    "RMS of what each period's output differs by from the mean of the later half, over all lines. "
                    "A start transient falls from the left; what stays level is noise. %s: the first %zu of %zu "
                    "periods %s not count.",
                    file_name(item->sources->items[0]), outcome->runs[0].settle, outcome->runs[0].total,
                    outcome->runs[0].settle == 1 ? "does" : "do");
    free(numbers);
}

static const struct remark *find_fact(const struct remarks *remarks, const char *id)
{
    for (size_t r = 0; r < remarks->count; r++) {
        if (remarks->items[r].level != remark_warning && strcmp(remarks->items[r].id, id) == 0) {
            return &remarks->items[r];
        }
    }
    return NULL;
}

/// What the page is about in a box: which lines, how certain, whether the runs agree.
static void add_result(const struct remarks *remarks, struct page *page)
{
    const struct remark *response = find_fact(remarks, "response");
    const struct remark *uncertainty = find_fact(remarks, "uncertainty");
    const struct remark *realisations = find_fact(remarks, "realisations");
    if (response) {
        page_add_note(page, page_plain, response->text, "%s%s%s%s%s%s", uncertainty ? "Uncertainty: " : "",
                      uncertainty ? uncertainty->text : "", uncertainty ? ". " : "",
                      realisations ? "Realisations: " : "", realisations ? realisations->text : "",
                      realisations ? "." : "");
    }
}

static void add_item(const struct estimating_page_item *item, struct page *page)
{
    struct remarks remarks = {.count = 0};
    estimating_outcome_say(item->outcome, item->sources, item->out, &remarks);
    add_result(&remarks, page);
    remarks_add_warnings(&remarks, page);
    add_response(item, page);
    add_models(item, page);
    estimating_findings_add_page(&item->outcome->findings, &item->outcome->frf, page);
    add_settling(item, page);
    page_add_section(page, "Findings");
    remarks_add_lists(&remarks, page);
    remarks_free(&remarks);
}

int estimating_page_write(const char *path, const struct estimating_page_item *items, size_t count,
                          struct atomic_file *out_file, struct error *out_error)
{
    struct page page;
    char names[name_size];
    char title[name_size + 32];
    char subtitle[name_size];
    const struct frf *first = &items[0].outcome->frf;
    FILE *stream = atomic_file_open(out_file, path, out_error);
    if (!stream) {
        return error_refused;
    }
    write_names(items[0].sources, names);
    snprintf(title, sizeof title, "Frequency response of %s", names);
    if (count > 1) {
        snprintf(subtitle, sizeof subtitle, "%zu responses by method %s", count, first->method);
    } else {
        snprintf(subtitle, sizeof subtitle, "%s to %s by method %s, in %s", first->input, first->output, first->method,
                 file_name(items[0].out));
    }
    page_start(&page, stream, title, subtitle);
    for (size_t i = 0; i < count; i++) {
        add_item(&items[i], &page);
    }
    if (page_end(&page, "servoscope " SERVOSCOPE_VERSION) == 0) {
        return 0;
    }
    const int reason = errno;
    atomic_file_discard(out_file);
    return error_set(out_error, error_refused, "%s: writing failed: %s", path, strerror(reason));
}
