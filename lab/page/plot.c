/* SPDX-License-Identifier: MIT */
#include "lab/page/plot.h"
#include "lab/page/text.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/* Coordinates are written in tenths of a pixel: finer than print resolves, and about six bytes a vertex. */
static const double tenths_per_px = 10.0;
/* Nothing is drawn further out than this, so that no value overflows; the frame clips it anyway. */
static const double far_px = 1e5;

enum { sample_width_px = 24 };

bool plot_is_range(enum figure_kind kind)
{
    return kind == figure_band || kind == figure_spans;
}

struct plot_sample plot_read_sample(const struct figure_series *series, size_t n, enum axis_scale x_scale,
                                    enum axis_scale y_scale)
{
    struct plot_sample sample;
    sample.x = series->x != NULL ? series->x[n] : (double)n;
    sample.low = series->y[n];
    sample.high = plot_is_range(series->kind) ? series->y2[n] : sample.low;
    sample.shown = axis_can_show(x_scale, sample.x);
    if (plot_is_range(series->kind)) {
        sample.shown = sample.shown && sample.high >= sample.low;
    } else {
        sample.shown = sample.shown && axis_can_show(y_scale, sample.low);
    }
    return sample;
}

size_t plot_count_kind(const struct figure_panel *panel, enum figure_kind first, enum figure_kind last)
{
    size_t found = 0;
    for (size_t n = 0; n < panel->count; n++) {
        found += panel->series[n].kind >= first && panel->series[n].kind <= last;
    }
    return found;
}

static struct plot_sample read_sample(const struct figure_series *series, const struct plot_area *area, size_t n)
{
    return plot_read_sample(series, n, area->x->scale, area->y->scale);
}

static double bound(double value, double low, double high)
{
    return value < low ? low : value > high ? high : value;
}

static double place_x(const struct plot_area *area, double x)
{
    return bound(area->width * axis_map(area->x, x), -far_px, far_px);
}

/* Values without a place (infinite, or not positive on a log axis) go far beyond the edge they point to. */
static double place_y(const struct plot_area *area, double y)
{
    if (!axis_can_show(area->y->scale, y)) {
        return y > 1.0 ? -far_px : far_px;
    }
    return bound(area->height * (1.0 - axis_map(area->y, y)), -far_px, far_px);
}

static void write_tenths(FILE *out, long tenths)
{
    long size = labs(tenths);
    if (tenths < 0) {
        fputc('-', out);
    }
    if (size >= 10 || size == 0) {
        fprintf(out, "%ld", size / 10);
    }
    if (size % 10 != 0) {
        fprintf(out, ".%ld", size % 10);
    }
}

static void write_pair(FILE *out, long x, long y)
{
    write_tenths(out, x);
    if (y >= 0) {
        fputc(' ', out);
    }
    write_tenths(out, y);
}

static void write_move(FILE *out, double x, double y)
{
    fputc('M', out);
    write_pair(out, lround(x * tenths_per_px), lround(y * tenths_per_px));
}

/* Opens a path that carries its name, from which the cursor script takes what it shows. */
static void open_path(FILE *out, const struct figure_series *series, const char *class_name)
{
    fprintf(out, "<path class=\"%s c%d\" data-n=\"", class_name, (int)series->colour);
    text_write(out, series->name);
    fputs("\"", out);
}

struct vertex {
    double x, y;
    size_t order;
};

/* A pen takes the vertices of a line in px, thins them per pixel column, clips them to the frame and writes a path. */
struct pen {
    FILE *out;
    double width, height;
    size_t taken; ///< vertices in the current column
    double column;
    struct vertex first, lowest, highest, last;
    bool started;           ///< a vertex of the current run has passed the thinning
    struct vertex previous; ///< the last that did
    size_t run;             ///< how many did
    bool drawing;           ///< the path's end is at x_tenths, y_tenths
    bool relative;          ///< an "l" is in force
    long x_tenths, y_tenths;
};

/* One side of Liang and Barsky's line clipping: keeps the part of the parameter range [t0, t1] where p t <= q. */
static bool clip_side(double p, double q, double *t0, double *t1)
{
    if (p == 0.0) {
        return q >= 0.0;
    }
    double t = q / p;
    if (p < 0.0) {
        *t0 = fmax(*t0, t);
    } else {
        *t1 = fmin(*t1, t);
    }
    return *t0 <= *t1;
}

static bool clip_segment(const struct pen *pen, struct vertex *a, struct vertex *b)
{
    double dx = b->x - a->x;
    double dy = b->y - a->y;
    double t0 = 0.0;
    double t1 = 1.0;
    if (!clip_side(-dx, a->x, &t0, &t1) || !clip_side(dx, pen->width - a->x, &t0, &t1) ||
        !clip_side(-dy, a->y, &t0, &t1) || !clip_side(dy, pen->height - a->y, &t0, &t1)) {
        return false;
    }
    struct vertex from = *a;
    *a = (struct vertex){from.x + t0 * dx, from.y + t0 * dy, from.order};
    *b = (struct vertex){from.x + t1 * dx, from.y + t1 * dy, b->order};
    return true;
}

static void draw_segment(struct pen *pen, struct vertex a, struct vertex b)
{
    if (!clip_segment(pen, &a, &b)) {
        return;
    }
    long ax = lround(a.x * tenths_per_px);
    long ay = lround(a.y * tenths_per_px);
    long bx = lround(b.x * tenths_per_px);
    long by = lround(b.y * tenths_per_px);
    bool joined = pen->drawing && ax == pen->x_tenths && ay == pen->y_tenths;
    if (joined && bx == ax && by == ay) {
        return;
    }
    if (!joined) {
        fputc('M', pen->out);
        write_pair(pen->out, ax, ay);
        pen->relative = false;
    }
    if (!pen->relative) {
        fputc('l', pen->out);
    } else if (bx >= ax) {
        fputc(' ', pen->out);
    }
    write_pair(pen->out, bx - ax, by - ay);
    pen->relative = true;
    pen->drawing = true;
    pen->x_tenths = bx;
    pen->y_tenths = by;
}

static void pass_vertex(struct pen *pen, struct vertex v)
{
    if (pen->started) {
        if (v.order == pen->previous.order) {
            return;
        }
        draw_segment(pen, pen->previous, v);
    }
    pen->started = true;
    pen->previous = v;
    pen->run++;
}

static void end_column(struct pen *pen)
{
    if (pen->taken == 0) {
        return;
    }
    bool low_first = pen->lowest.order < pen->highest.order;
    pass_vertex(pen, pen->first);
    pass_vertex(pen, low_first ? pen->lowest : pen->highest);
    pass_vertex(pen, low_first ? pen->highest : pen->lowest);
    pass_vertex(pen, pen->last);
    pen->taken = 0;
}

static void pen_add(struct pen *pen, struct vertex v)
{
    if (pen->taken > 0 && floor(v.x) != pen->column) {
        end_column(pen);
    }
    if (pen->taken == 0) {
        pen->column = floor(v.x);
        pen->first = pen->lowest = pen->highest = v;
    }
    pen->lowest = v.y < pen->lowest.y ? v : pen->lowest;
    pen->highest = v.y > pen->highest.y ? v : pen->highest;
    pen->last = v;
    pen->taken++;
}

/* Ends a run of samples at a gap. A sample alone between two gaps is a line of no length, drawn as a dot. */
static void pen_lift(struct pen *pen)
{
    end_column(pen);
    if (pen->run == 1) {
        draw_segment(pen, pen->previous, pen->previous);
    }
    pen->started = false;
    pen->drawing = false;
    pen->run = 0;
}

static void write_line(FILE *out, const struct figure_series *series, const struct plot_area *area)
{
    struct pen pen = {.out = out, .width = area->width, .height = area->height};
    size_t order = 0;
    double held = 0.0;
    bool holding = false;
    open_path(out, series, "ln");
    fprintf(out, " stroke-width=\"%g\" data-d=\"%d\" d=\"", series->size > 0.0 ? series->size : 1.5, (int)series->dash);
    for (size_t n = 0; n < series->count; n++) {
        struct plot_sample sample = read_sample(series, area, n);
        if (!sample.shown) {
            pen_lift(&pen);
            holding = false;
            continue;
        }
        double x = place_x(area, sample.x);
        double y = place_y(area, sample.low);
        if (series->kind == figure_step && holding) {
            pen_add(&pen, (struct vertex){x, held, order++});
        }
        pen_add(&pen, (struct vertex){x, y, order++});
        held = y;
        holding = true;
    }
    pen_lift(&pen);
    fputs("\"/>", out);
}

/* Consecutive samples in one pixel column, drawn as one. */
struct group {
    double x;         ///< px, middle of the first and the last
    double low, high; ///< px; low <= high, so low is the upper one on the paper
};

/* Collects the group that begins at *n, walking by `direction`; both directions cut a series into the same groups.
   Returns false, *n moved on, where the sample cannot be shown. */
static bool next_group(const struct figure_series *series, const struct plot_area *area, size_t *n, int direction,
                       struct group *out_group)
{
    double first = 0.0;
    for (size_t taken = 0; *n < series->count; taken++) {
        struct plot_sample sample = read_sample(series, area, *n);
        double x = sample.shown ? place_x(area, sample.x) : 0.0;
        if (taken > 0 && (!sample.shown || floor(x) != floor(first))) {
            return true;
        }
        *n += (size_t)direction; /* below 0 it wraps to a value past the end, which ends the loop */
        if (!sample.shown) {
            return false;
        }
        double low = place_y(area, sample.high);
        double high = place_y(area, sample.low);
        first = taken == 0 ? x : first;
        out_group->x = 0.5 * (first + x);
        out_group->low = taken == 0 ? low : fmin(out_group->low, low);
        out_group->high = taken == 0 ? high : fmax(out_group->high, high);
    }
    return true;
}

static void write_band_run(FILE *out, const struct figure_series *series, const struct plot_area *area, size_t begin,
                           size_t end)
{
    const double beyond_px = 40.0; /* the polygon's edge stays out of sight where the band leaves the frame */
    struct figure_series part = *series;
    part.count = end;
    char command = 'M';
    for (int pass = 0; pass < 2; pass++) {
        size_t n = pass == 0 ? begin : end - 1;
        while (n >= begin && n < end) {
            struct group group;
            if (!next_group(&part, area, &n, pass == 0 ? 1 : -1, &group)) {
                continue;
            }
            double y = bound(pass == 0 ? group.low : group.high, -beyond_px, area->height + beyond_px);
            fputc(command, out);
            write_pair(out, lround(group.x * tenths_per_px), lround(y * tenths_per_px));
            command = 'L';
        }
    }
    fputc('z', out);
}

static void write_band(FILE *out, const struct figure_series *series, const struct plot_area *area)
{
    open_path(out, series, "bd");
    fputs(" d=\"", out);
    size_t begin = 0;
    for (size_t n = 0; n <= series->count; n++) {
        if (n == series->count || !read_sample(series, area, n).shown) {
            if (n > begin) {
                write_band_run(out, series, area, begin, n);
            }
            begin = n + 1;
        }
    }
    fputs("\"/>", out);
}

static double usual_marker_radius(size_t count)
{
    return count <= 150 ? 2.4 : count <= 600 ? 1.8 : 1.3;
}

static void write_marker(FILE *out, const struct figure_series *series, double x, double y, double r)
{
    write_move(out, x, y);
    switch (series->marker) {
    case figure_circle:
        fputs("l0 0", out); /* round line caps draw it; square ones do not survive being printed */
        break;
    case figure_square:
        fprintf(out, "m%.1f %.1fh%.1fv%.1fh%.1fz", -0.9 * r, -0.9 * r, 1.8 * r, 1.8 * r, -1.8 * r);
        break;
    case figure_triangle:
        fprintf(out, "m%.1f %.1fh%.1fl%.1f %.1fz", -1.3 * r, 0.9 * r, 2.6 * r, -1.3 * r, -2.2 * r);
        break;
    case figure_cross:
        fprintf(out, "m%.1f %.1fl%.1f %.1fm0 %.1fl%.1f %.1f", -r, -r, 2 * r, 2 * r, -2 * r, -2 * r, 2 * r);
        break;
    case figure_diamond:
        fprintf(out, "m0 %.1fl%.1f %.1fl%.1f %.1fl%.1f %.1fz", -1.4 * r, 1.4 * r, 1.4 * r, -1.4 * r, 1.4 * r, -1.4 * r,
                -1.4 * r);
        break;
    case figure_plus:
        fprintf(out, "m0 %.1fv%.1fm%.1f %.1fh%.1f", -1.3 * r, 2.6 * r, -1.3 * r, -1.3 * r, 2.6 * r);
        break;
    case figure_ring:
        fprintf(out, "m%.1f 0a%.1f %.1f 0 1 0 %.1f 0a%.1f %.1f 0 1 0 %.1f 0", -1.1 * r, 1.1 * r, 1.1 * r, 2.2 * r,
                1.1 * r, 1.1 * r, -2.2 * r);
        break;
    case figure_triangle_down:
        fprintf(out, "m%.1f %.1fh%.1fl%.1f %.1fz", -1.3 * r, -0.9 * r, 2.6 * r, -1.3 * r, 2.2 * r);
        break;
    }
}

static void open_markers(FILE *out, const struct figure_series *series, double r)
{
    static const char *const class_names[] = {
        [figure_circle] = "pt mc", [figure_triangle] = "pt mf",      [figure_square] = "pt mf",
        [figure_cross] = "pt mx",  [figure_diamond] = "pt mf",       [figure_plus] = "pt mx",
        [figure_ring] = "pt mx",   [figure_triangle_down] = "pt mf",
    };
    const bool stroked = strcmp(class_names[series->marker], "pt mx") == 0;
    double width = series->marker == figure_circle ? 2.0 * r : stroked ? fmax(1.0, 0.55 * r) : 0.0;
    open_path(out, series, class_names[series->marker]);
    fprintf(out, " stroke-width=\"%.1f\" d=\"", width);
}

static bool is_inside(const struct plot_area *area, double x, double y)
{
    const double slack_px = 0.05;
    return x >= -slack_px && x <= area->width + slack_px && y >= -slack_px && y <= area->height + slack_px;
}

/* Remembers which cells carry a marker already. Without memory for it every marker is drawn. */
struct stipple {
    double cells_per_px;
    size_t columns, rows;
    uint8_t *bits;
};

/* Half a pixel, and where there are too many markers to be told apart, one pixel for dots and two for shapes, which
   take more to write: a page of 10 000 lines stays below 500 kB. */
static void stipple_begin(struct stipple *self, const struct figure_series *series, const struct plot_area *area)
{
    const size_t many = 2000;
    const bool dots = series->marker == figure_circle;
    self->cells_per_px = series->count <= many ? 2.0 : dots ? 1.0 : 0.5;
    self->columns = (size_t)ceil(self->cells_per_px * area->width) + 1;
    self->rows = (size_t)ceil(self->cells_per_px * area->height) + 1;
    self->bits = calloc(self->columns * self->rows / 8 + 1, 1);
}

static bool stipple_take(struct stipple *self, double x, double y)
{
    if (self->bits == NULL) {
        return true;
    }
    size_t column = (size_t)bound(floor(self->cells_per_px * x), 0.0, (double)(self->columns - 1));
    size_t row = (size_t)bound(floor(self->cells_per_px * y), 0.0, (double)(self->rows - 1));
    size_t bit = row * self->columns + column;
    uint8_t mask = (uint8_t)(1u << (bit % 8));
    bool is_new = (self->bits[bit / 8] & mask) == 0;
    self->bits[bit / 8] |= mask;
    return is_new;
}

static void write_points(FILE *out, const struct figure_series *series, const struct plot_area *area)
{
    double r = series->size > 0.0 ? 0.5 * series->size : usual_marker_radius(series->count);
    struct stipple stipple;
    stipple_begin(&stipple, series, area);
    open_markers(out, series, r);
    for (size_t n = 0; n < series->count; n++) {
        struct plot_sample sample = read_sample(series, area, n);
        if (!sample.shown) {
            continue;
        }
        double x = place_x(area, sample.x);
        double y = place_y(area, sample.low);
        if (is_inside(area, x, y) && stipple_take(&stipple, x, y)) {
            write_marker(out, series, x, y, r);
        }
    }
    fputs("\"/>", out);
    free(stipple.bits);
}

static double place_zero(const struct plot_area *area)
{
    return area->y->scale == axis_log ? area->height : bound(place_y(area, 0.0), 0.0, area->height);
}

static void write_stems(FILE *out, const struct figure_series *series, const struct plot_area *area)
{
    double base = place_zero(area);
    open_path(out, series, "sm");
    fprintf(out, " stroke-width=\"%g\" d=\"", series->size > 0.0 ? series->size : series->count <= 60 ? 1.6 : 1.0);
    for (size_t n = 0; n < series->count;) {
        struct group group;
        if (!next_group(series, area, &n, 1, &group) || group.x < 0.0 || group.x > area->width) {
            continue;
        }
        double top = bound(group.low < base ? group.low : group.high, 0.0, area->height);
        double bottom = bound(fmax(group.high, base), 0.0, area->height);
        write_move(out, group.x, top);
        fputc('l', out);
        write_pair(out, 0, lround((bottom - top) * tenths_per_px));
    }
    fputs("\"/>", out);
}

static void write_spans(FILE *out, const struct figure_series *series, const struct plot_area *area)
{
    open_path(out, series, "sp");
    fprintf(out, " stroke-width=\"%g\" d=\"", series->size > 0.0 ? series->size : series->count <= 150 ? 1.4 : 1.0);
    for (size_t n = 0; n < series->count;) {
        struct group group;
        if (!next_group(series, area, &n, 1, &group) || group.x < 0.0 || group.x > area->width) {
            continue;
        }
        double top = bound(group.low, 0.0, area->height);
        double bottom = bound(group.high, 0.0, area->height);
        if (bottom > top) {
            write_move(out, group.x, top);
            fputc('l', out);
            write_pair(out, 0, lround((bottom - top) * tenths_per_px));
        }
    }
    fputs("\"/>", out);
}

static void write_bar(FILE *out, const struct plot_area *area, double middle, double width, double y)
{
    double base = place_zero(area);
    double tip = bound(y, 0.0, area->height);
    fprintf(out, "<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\"/>", middle - 0.5 * width, fmin(tip, base),
            width, fabs(base - tip));
}

static void format_bar_value(double value, size_t size, char *out_text)
{
    snprintf(out_text, size, "%s%.3g", value < 0.0 ? "\xE2\x88\x92" : "", fabs(value));
}

static void write_bar_value(FILE *out, const struct plot_area *area, double middle, double y, double value)
{
    bool upward = bound(y, 0.0, area->height) <= place_zero(area);
    double place = upward ? fmax(y - 5.0, 11.0) : fmin(y + 14.0, area->height - 3.0);
    char text[32];
    format_bar_value(value, sizeof text, text);
    fprintf(out, "<text class=\"bv\" x=\"%.1f\" y=\"%.1f\">%s</text>", middle, place, text);
}

/* Values are written above the bars only if all of a series fit beside their neighbours. */
static bool values_fit(const struct figure_series *series, const struct plot_area *area, double room_px)
{
    const double font_px = 12.0;
    for (size_t n = 0; n < series->count; n++) {
        struct plot_sample sample = read_sample(series, area, n);
        char text[32];
        if (sample.shown) {
            format_bar_value(sample.low, sizeof text, text);
            if (font_px * text_measure_em((struct text_span){text, strlen(text)}) > room_px - 2.0) {
                return false;
            }
        }
    }
    return true;
}

static void write_bars(FILE *out, const struct figure_series *series, const struct plot_area *area, size_t bar_index)
{
    const double widest_px = 64.0;
    double pitch = area->width / (area->x->high - area->x->low);
    double share = 0.72 * pitch / (double)(area->bar_series > 0 ? area->bar_series : 1);
    double width = series->size > 0.0 ? series->size : fmin(share, widest_px);
    double offset = ((double)bar_index - 0.5 * ((double)area->bar_series - 1.0)) * fmin(share, 1.1 * width);
    bool with_values = values_fit(series, area, area->bar_series > 1 ? share : pitch);
    fprintf(out, "<g class=\"br c%d b%d\">", (int)series->colour, (int)series->dash);
    for (size_t n = 0; n < series->count; n++) {
        struct plot_sample sample = read_sample(series, area, n);
        double middle = sample.shown ? place_x(area, sample.x) + offset : -1.0;
        if (!(middle >= 0.0 && middle <= area->width)) {
            continue;
        }
        double y = place_y(area, sample.low);
        write_bar(out, area, middle, width, y);
        if (with_values) {
            write_bar_value(out, area, middle, y, sample.low);
        }
    }
    fputs("</g>", out);
}

static void write_limit(FILE *out, const struct figure_series *series, const struct plot_area *area)
{
    double y = axis_can_show(area->y->scale, series->value) ? place_y(area, series->value) : -1.0;
    if (y >= 0.0 && y <= area->height) {
        open_path(out, series, "lm");
        fprintf(out, " data-d=\"%d\" d=\"M0 %.1fH%.1f\"/>", (int)series->dash, y, area->width);
    }
}

void plot_write_series(FILE *out, const struct figure_series *series, const struct plot_area *area, size_t bar_index)
{
    switch (series->kind) {
    case figure_line:
    case figure_step:
        write_line(out, series, area);
        break;
    case figure_points:
        write_points(out, series, area);
        break;
    case figure_band:
        write_band(out, series, area);
        break;
    case figure_stems:
        write_stems(out, series, area);
        break;
    case figure_bars:
        write_bars(out, series, area, bar_index);
        break;
    case figure_limit:
        write_limit(out, series, area);
        break;
    case figure_spans:
        write_spans(out, series, area);
        break;
    }
}

void plot_write_sample(FILE *out, const struct figure_series *series, double x, double y)
{
    double middle = x + 0.5 * sample_width_px;
    int colour = (int)series->colour;
    switch (series->kind) {
    case figure_line:
    case figure_step:
    case figure_limit:
        fprintf(out, "<path class=\"%s c%d\" data-d=\"%d\" d=\"M%.1f %.1fh%d\"/>",
                series->kind == figure_limit ? "lm" : "ln", colour, (int)series->dash, x, y, sample_width_px);
        break;
    case figure_points:
        open_markers(out, series, 2.4);
        write_marker(out, series, middle, y, 2.4);
        fputs("\"/>", out);
        break;
    case figure_band:
        fprintf(out, "<path class=\"bd c%d\" d=\"M%.1f %.1fh%dv10h-%dz\"/>", colour, x, y - 5.0, sample_width_px,
                sample_width_px);
        break;
    case figure_stems:
        fprintf(out, "<path class=\"sm c%d\" stroke-width=\"1.4\" d=\"M%.1f %.1fv6m4-10v10m4-8v8\"/>", colour,
                middle - 4.0, y - 1.0);
        break;
    case figure_spans:
        fprintf(out, "<path class=\"sp c%d\" stroke-width=\"1.4\" d=\"M%.1f %.1fv10\"/>", colour, middle, y - 5.0);
        break;
    case figure_bars:
        fprintf(out, "<g class=\"br c%d b%d\"><rect x=\"%.1f\" y=\"%.1f\" width=\"10\" height=\"10\"/></g>", colour,
                (int)series->dash, middle - 5.0, y - 5.0);
        break;
    }
}

size_t plot_count_outside(const struct figure_series *series, const struct plot_area *area)
{
    size_t outside = 0;
    for (size_t n = 0; series->kind != figure_limit && n < series->count; n++) {
        struct plot_sample sample = read_sample(series, area, n);
        if (sample.shown && !plot_is_range(series->kind)) {
            outside += !is_inside(area, place_x(area, sample.x), place_y(area, sample.low));
        }
    }
    return outside;
}
