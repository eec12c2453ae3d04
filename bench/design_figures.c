/* SPDX-License-Identifier: MIT */
/// Figures 2 to 5 of the first paper: effective value and crest factor of every method over the corner frequency at
/// which two limits change places, and how often modified clipping clips the lower derivative. Tables on stdout, a page
/// with plots to the file that is named. Exit status 1 if MCA is not where the equations put it, or `fast` falls
/// behind.
#include "bench/design_figures_reference.h"

#include "lab/design/method.h"
#include "lab/page/page.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { line_count = 200, period_samples = 2000, rate_hz = 1000, highest_hz = 100 };

static const double two_pi = 6.283185307179586;

/// What is accepted: MCA off its reference, fast below L-infinity.
static const double mca_tolerance = 0.003;
static const double fast_tolerance = 0.001;

struct point {
    double effective[figure_methods];
    double crest[figure_methods]; ///< of the acceleration
    double cpu_s[figure_methods];
    double share_percent;
    double mca_low, mca_high; ///< effective values of MCA under disturbances of the size of rounding
};

static struct point points[figure_kinds][figure_corners];
static uint32_t bins[line_count];

/// Units are chosen so that the effective torque is the number that the figures show.
static struct design_limits limits_of(int kind, double corner_hz)
{
    const double corner = two_pi * corner_hz;
    switch (kind) {
    case 0:
        return (struct design_limits){.velocity_rad_per_s = 1 / (two_pi * highest_hz),
                                      .position_rad = 1 / (two_pi * highest_hz) / corner};
    case 1:
        return (struct design_limits){.acceleration_rad_per_s2 = 1, .velocity_rad_per_s = 1 / corner};
    default:
        return (struct design_limits){.acceleration_rad_per_s2 = 1, .position_rad = 1 / (corner * corner)};
    }
}

static struct design_request request_of(int kind, double corner_hz)
{
    return (struct design_request){.rate_num_hz = rate_hz,
                                   .rate_den = 1,
                                   .period_samples = period_samples,
                                   .bin_count = line_count,
                                   .bins = bins,
                                   .limits = limits_of(kind, corner_hz),
                                   .inertia_kgm2 = 1,
                                   .grid = design_grid_samples,
                                   .start = design_start_none,
                                   .seed = 1};
}

static int run_method(struct design_request request, enum figure_method method, struct point *point,
                      struct error *error)
{
    static const char *const names[figure_methods] = {"clip", "clip", "mca", "linf", "fast"};
    struct design_result result;
    request.method = names[method];
    request.keep = method == figure_clip_acceleration ? design_keep_acceleration : design_keep_all;
    int status = design_run(&request, &result, error);
    if (!status) {
        point->effective[method] = result.effective_torque_Nm;
        point->crest[method] = result.crest_factor;
        point->cpu_s[method] = result.cpu_s;
        design_result_free(&result);
    }
    return status;
}

/// Where two limits compete, modified clipping is chaotic: what two correct programs find may differ, and this is by
/// how much. The limits are changed by multiples of 1e-13 of themselves.
static int disturb(const struct design_request *request, struct point *point, struct error *error)
{
    enum { disturbances = 12 };
    int status = 0;
    point->mca_low = point->mca_high = point->effective[figure_mca];
    for (int i = 1; !status && i <= disturbances; i++) {
        struct design_request disturbed = *request;
        struct point other;
        disturbed.limits.position_rad *= 1 + 1e-13 * i;
        disturbed.limits.velocity_rad_per_s *= 1 - 1e-13 * i;
        status = run_method(disturbed, figure_mca, &other, error);
        if (!status) {
            point->mca_low = fmin(point->mca_low, other.effective[figure_mca]);
            point->mca_high = fmax(point->mca_high, other.effective[figure_mca]);
        }
    }
    return status;
}

/// Once more, for figure 5: the share of iterations that clip the lower of the two limited derivatives.
static int count_clips(const struct design_request *request, struct point *point, struct error *error)
{
    struct design_spectrum spectrum;
    struct design_search search;
    size_t clipped[design_signal_count] = {0};
    if (!design_spectrum_create(request, &spectrum)) {
        return design_method_out_of_memory(error);
    }
    int status = error_refused;
    if (design_search_create(request, &spectrum, &search)) {
        status = design_method_mca_run(request, &search, clipped, error);
        design_search_free(&search);
    } else {
        design_method_out_of_memory(error);
    }
    design_spectrum_free(&spectrum);
    const enum design_signal lower = request->limits.position_rad > 0 ? design_position : design_velocity;
    const size_t all = clipped[design_position] + clipped[design_velocity] + clipped[design_acceleration];
    point->share_percent = all > 0 ? 100 * (double)clipped[lower] / (double)all : NAN;
    return status;
}

static int measure(struct error *error)
{
    int status = 0;
    for (uint32_t k = 0; k < line_count; k++) {
        bins[k] = k + 1;
    }
    for (int kind = 0; !status && kind < figure_kinds; kind++) {
        for (int corner = 0; !status && corner < figure_corners; corner++) {
            struct design_request request = request_of(kind, figure_corner_hz[corner]);
            fprintf(stderr, "%s, %g Hz (%d of %d)\n", figure_kind_names[kind], figure_corner_hz[corner],
                    kind * figure_corners + corner + 1, figure_kinds * figure_corners);
            for (int method = 0; !status && method < figure_methods; method++) {
                status = run_method(request, (enum figure_method)method, &points[kind][corner], error);
            }
            status = status ? status : disturb(&request, &points[kind][corner], error);
            status = status ? status : count_clips(&request, &points[kind][corner], error);
        }
    }
    return status;
}

// ---- Cells of tables, the same on the page and on stdout

enum { cell_size = 16, columns_max = 13 };

struct row {
    size_t count;
    char text[columns_max][cell_size];
};

static void add_cell(struct row *row, int decimals, double value)
{
    char *text = row->text[row->count++];
    text[0] = '\0';
    if (!isnan(value)) {
        snprintf(text, cell_size, "%.*f", decimals, value);
    }
}

static void add_signed_cell(struct row *row, int decimals, double value)
{
    snprintf(row->text[row->count++], cell_size, "%+.*f", decimals, value);
}

static void add_corner(struct row *row, int corner)
{
    snprintf(row->text[row->count++], cell_size, "%g", figure_corner_hz[corner]);
}

static const char *const effective_heads[] = {"fc [Hz]", "clip all", "ref.", "clip acc.",     "ref.", "MCA",  "ref.",
                                              "L-inf.",  "ref.",     "fast", "fast - L-inf.", "best", "bound"};

static void effective_row(int kind, int corner, struct row *out_row)
{
    const struct point *point = &points[kind][corner];
    const struct figure_reference *reference = &figure_references[kind][corner];
    *out_row = (struct row){0};
    add_corner(out_row, corner);
    for (int method = 0; method < figure_fast; method++) {
        add_cell(out_row, 4, point->effective[method]);
        add_cell(out_row, 4, reference->effective[method]);
    }
    add_cell(out_row, 4, point->effective[figure_fast]);
    add_signed_cell(out_row, 4, point->effective[figure_fast] - point->effective[figure_linf]);
    add_cell(out_row, 4, reference->effective[figure_fast]);
    add_cell(out_row, 3, reference->bound);
}

static const char *const crest_heads[] = {"fc [Hz]", "clip all", "ref.", "clip acc.",         "ref.", "MCA",
                                          "ref.",    "L-inf.",   "fast", "lower clipped [%]", "ref."};

static void crest_row(int kind, int corner, struct row *out_row)
{
    const struct point *point = &points[kind][corner];
    const struct figure_reference *reference = &figure_references[kind][corner];
    const double references[] = {reference->crest_clip_all, reference->crest_clip_acceleration, reference->crest_mca};
    *out_row = (struct row){0};
    add_corner(out_row, corner);
    for (int method = 0; method <= figure_mca; method++) {
        add_cell(out_row, 2, point->crest[method]);
        add_cell(out_row, 2, references[method]);
    }
    add_cell(out_row, 2, point->crest[figure_linf]);
    add_cell(out_row, 2, point->crest[figure_fast]);
    add_cell(out_row, 0, point->share_percent);
    add_cell(out_row, 0, reference->share_percent);
}

struct table {
    const char *caption;
    const char *const *heads;
    void (*fill)(int kind, int corner, struct row *out_row);
};

enum { table_count = 2 };
static const struct table tables[table_count] = {
    {"effective value", effective_heads, effective_row},
    {"crest factor of the acceleration; iterations of MCA that clip the lower derivative", crest_heads, crest_row},
};

static void print_table(int kind, const struct table *table)
{
    struct row row;
    printf("\n%s: %s\n", figure_kind_names[kind], table->caption);
    for (int corner = -1; corner < figure_corners; corner++) {
        table->fill(kind, corner < 0 ? 0 : corner, &row);
        for (size_t c = 0; c < row.count; c++) {
            const int width = strlen(table->heads[c]) > 7 ? (int)strlen(table->heads[c]) : 7;
            printf("%s%*s", c > 0 ? "  " : "", width, corner < 0 ? table->heads[c] : row.text[c]);
        }
        putchar('\n');
    }
}

static void add_table(struct page *page, int kind, const struct table *table)
{
    struct row row;
    char caption[160];
    char align[columns_max + 1] = "";
    table->fill(kind, 0, &row);
    memset(align, 'r', row.count);
    snprintf(caption, sizeof caption, "%s: %s. \"ref.\": reference implementation.", figure_kind_names[kind],
             table->caption);
    page_start_table(page, caption, align, table->heads);
    for (int corner = 0; corner < figure_corners; corner++) {
        const char *cells[columns_max];
        table->fill(kind, corner, &row);
        for (size_t c = 0; c < row.count; c++) {
            cells[c] = row.text[c][0] ? row.text[c] : NULL;
        }
        page_add_row(page, cells);
    }
    page_end_table(page);
}

// ---- Plots

/// One curve over the corner frequencies, ours and the reference's.
struct curve {
    double ours[figure_corners];
    double reference[figure_corners];
};

static struct curve effective_curve(int kind, enum figure_method method)
{
    struct curve curve;
    for (int corner = 0; corner < figure_corners; corner++) {
        curve.ours[corner] = points[kind][corner].effective[method];
        curve.reference[corner] = method == figure_fast ? NAN : figure_references[kind][corner].effective[method];
    }
    return curve;
}

static struct curve crest_curve(int kind, enum figure_method method)
{
    struct curve curve;
    for (int corner = 0; corner < figure_corners; corner++) {
        const struct figure_reference *reference = &figure_references[kind][corner];
        const double references[figure_methods] = {reference->crest_clip_all, reference->crest_clip_acceleration,
                                                   reference->crest_mca, NAN, NAN};
        curve.ours[corner] = points[kind][corner].crest[method];
        curve.reference[corner] = references[method];
    }
    return curve;
}

static struct curve share_curve(int kind)
{
    struct curve curve;
    for (int corner = 0; corner < figure_corners; corner++) {
        curve.ours[corner] = points[kind][corner].share_percent;
        curve.reference[corner] = figure_references[kind][corner].share_percent;
    }
    return curve;
}

/// Lines are ours, crosses the reference's; the legend names the crosses once.
static void add_curve(struct figure_panel *panel, const char *name, const struct curve *curve,
                      enum figure_colour colour, enum figure_dash dash)
{
    struct figure_series *line = figure_add_line(panel, name, figure_corners, figure_corner_hz, curve->ours);
    line->colour = colour;
    line->dash = dash;
}

static void add_reference(struct figure_panel *panel, const char *name, const struct curve *curve)
{
    struct figure_series *crosses = figure_add_points(panel, name, figure_corners, figure_corner_hz, curve->reference);
    crosses->colour = figure_ink;
    crosses->marker = figure_cross;
}

static const enum figure_colour colours[figure_methods] = {figure_grey, figure_orange, figure_blue, figure_vermilion,
                                                           figure_green};
static const enum figure_dash dashes[figure_methods] = {figure_dotted, figure_dashed, figure_solid, figure_dash_dot,
                                                        figure_solid};

static void add_method_figure(struct page *page, int kind)
{
    static struct curve curves[2][figure_methods];
    static struct figure figure;
    struct curve (*const curve_of[2])(int, enum figure_method) = {effective_curve, crest_curve};
    const char *labels[2] = {"effective value, normalised", "crest factor of the acceleration"};
    char x_label[80];
    snprintf(x_label, sizeof x_label, "corner frequency %s in Hz", figure_kind_names[kind]);
    figure_start(&figure, x_label, axis_log);
    for (int p = 0; p < 2; p++) {
        struct figure_panel *panel = figure_add_panel(&figure, labels[p], axis_linear);
        panel->height = 230;
        for (int method = 0; method < figure_methods; method++) {
            curves[p][method] = curve_of[p](kind, (enum figure_method)method);
            add_curve(panel, p == 0 ? figure_method_names[method] : "", &curves[p][method], colours[method],
                      dashes[method]);
        }
        for (int method = 0; method < figure_fast; method++) {
            add_reference(panel, p == 0 && method == 0 ? "reference" : "", &curves[p][method]);
        }
    }
    page_add_figure(page, &figure,
                    "As figure %d of the paper. Lines: this program; crosses: the reference implementation (%s).",
                    kind + 2, figure_kind_names[kind]);
}

static void add_share_figure(struct page *page)
{
    static const enum figure_colour kind_colours[figure_kinds] = {figure_blue, figure_vermilion, figure_green};
    static const enum figure_dash kind_dashes[figure_kinds] = {figure_solid, figure_dashed, figure_dash_dot};
    static struct curve curves[figure_kinds];
    static struct figure figure;
    figure_start(&figure, "corner frequency in Hz", axis_log);
    struct figure_panel *panel =
        figure_add_panel(&figure, "iterations that clip the lower derivative in %", axis_linear);
    panel->height = 230;
    for (int kind = 0; kind < figure_kinds; kind++) {
        curves[kind] = share_curve(kind);
        add_curve(panel, figure_kind_names[kind], &curves[kind], kind_colours[kind], kind_dashes[kind]);
    }
    for (int kind = 0; kind < figure_kinds; kind++) {
        add_reference(panel, kind == 0 ? "reference" : "", &curves[kind]);
    }
    page_add_figure(page, &figure,
                    "As figure 5 of the paper. Lines: this program; crosses: the reference implementation.");
}

// ---- Verdict

struct verdict {
    double mca_off;      ///< largest difference of MCA from its reference where its value stands
    double chaotic_off;  ///< the same, of the nearest value that rounding allows, where it does not
    double chaotic_span; ///< how much it moves there
    int chaotic;         ///< points where it moves by more than what is accepted
    double fast_behind;  ///< most by which fast is below L-infinity; negative: it nowhere is
    int fast_not_below;
    double cpu_s[figure_methods];
};

static void judge_mca(const struct point *point, double reference, struct verdict *verdict)
{
    const double span = point->mca_high - point->mca_low;
    if (span <= mca_tolerance) {
        verdict->mca_off = fmax(verdict->mca_off, fabs(point->effective[figure_mca] - reference));
        return;
    }
    verdict->chaotic++;
    verdict->chaotic_span = fmax(verdict->chaotic_span, span);
    verdict->chaotic_off = fmax(verdict->chaotic_off, fmax(point->mca_low - reference, reference - point->mca_high));
}

static struct verdict judge(void)
{
    struct verdict verdict = {.fast_behind = -INFINITY};
    for (int i = 0; i < figure_kinds * figure_corners; i++) {
        const struct point *point = &points[i / figure_corners][i % figure_corners];
        const struct figure_reference *reference = &figure_references[i / figure_corners][i % figure_corners];
        const double behind = point->effective[figure_linf] - point->effective[figure_fast];
        judge_mca(point, reference->effective[figure_mca], &verdict);
        verdict.fast_behind = fmax(verdict.fast_behind, behind);
        verdict.fast_not_below += behind <= 0;
        for (int method = 0; method < figure_methods; method++) {
            verdict.cpu_s[method] += point->cpu_s[method];
        }
    }
    return verdict;
}

static bool accepted(const struct verdict *verdict)
{
    return verdict->mca_off <= mca_tolerance && verdict->chaotic_off <= mca_tolerance &&
           verdict->fast_behind <= fast_tolerance;
}

static void describe(const struct verdict *verdict, size_t size, char *out_text)
{
    const int all = figure_kinds * figure_corners;
    int used = snprintf(out_text, size, "MCA is at most %.4f from its reference at %d points (accepted: %g)",
                        verdict->mca_off, all - verdict->chaotic, mca_tolerance);
    if (verdict->chaotic > 0) {
        used += snprintf(out_text + used, size - (size_t)used,
                         "; at %d its result moves by up to %.4f with the last digits of the limits, to within %.4f of "
                         "the reference",
                         verdict->chaotic, verdict->chaotic_span, fmax(0, verdict->chaotic_off));
    }
    snprintf(out_text + used, size - (size_t)used,
             "; fast is at or above L-infinity at %d of %d points, at worst %.4f below (accepted: %g)",
             verdict->fast_not_below, all, fmax(0, verdict->fast_behind), fast_tolerance);
}

static void print_verdict(const struct verdict *verdict)
{
    char text[400];
    describe(verdict, sizeof text, text);
    printf("\nprocessor time, all points:");
    for (int method = 0; method < figure_methods; method++) {
        printf("%s %s %.2f s", method > 0 ? "," : "", figure_method_names[method], verdict->cpu_s[method]);
    }
    printf("\n%s: %s\n", accepted(verdict) ? "good" : "NOT ACCEPTED", text);
}

static int write_page(const char *path, const struct verdict *verdict)
{
    struct page page;
    char text[400];
    FILE *stream = fopen(path, "w");
    if (!stream) {
        return -1;
    }
    describe(verdict, sizeof text, text);
    page_start(&page, stream, "Figures 2 to 5 of the first paper",
               "200 lines 0.5 to 100 Hz, 1 kHz, limits at the samples");
    page_add_note(&page, accepted(verdict) ? page_good : page_bad, accepted(verdict) ? "Reproduced" : "Not reproduced",
                  "%s.", text);
    page_add_paragraph(&page,
                       "Effective values are RMS accelerations over the acceleration limit; without one "
                       "(position-velocity) over the velocity limit times 2 pi 100 Hz. Below the corner frequency "
                       "the lower derivative limits a line, above it the higher. \"best\" is the most that any "
                       "method reached with any number of starts, \"bound\" what no phases exceed at any "
                       "instant.");
    for (int kind = 0; kind < figure_kinds; kind++) {
        page_add_section(&page, figure_kind_names[kind]);
        add_method_figure(&page, kind);
        for (int t = 0; t < table_count; t++) {
            add_table(&page, kind, &tables[t]);
        }
    }
    page_add_section(&page, "Which signal MCA clips");
    add_share_figure(&page);
    int failed = page_end(&page, NULL);
    return fclose(stream) != 0 ? -1 : failed;
}

int main(int argc, char **argv)
{
    struct error error = {0};
    if (argc != 2) {
        fprintf(stderr, "usage: design_figures PAGE.html\n");
        return error_usage;
    }
    if (measure(&error)) {
        fprintf(stderr, "%s\n", error.message);
        return error_refused;
    }
    for (int kind = 0; kind < figure_kinds; kind++) {
        for (int t = 0; t < table_count; t++) {
            print_table(kind, &tables[t]);
        }
    }
    struct verdict verdict = judge();
    print_verdict(&verdict);
    if (write_page(argv[1], &verdict)) {
        fprintf(stderr, "%s: cannot be written\n", argv[1]);
        return error_refused;
    }
    printf("page: %s\n", argv[1]);
    return accepted(&verdict) ? 0 : error_refused;
}
