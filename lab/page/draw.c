/* SPDX-License-Identifier: MIT */
#include "lab/page/figure.h"
#include "lab/page/layout.h"
#include "lab/page/plot.h"
#include "lab/page/text.h"

#include <math.h>
#include <stdlib.h>

enum { tick_px = 4 };

static void write_text(FILE *out, const char *class_name, double x, double y, struct text_span span)
{
    fprintf(out, "<text class=\"%s\" x=\"%.1f\" y=\"%.1f\">", class_name, x, y);
    text_write_span(out, span);
    fputs("</text>", out);
}

static void write_y_axis(FILE *out, const struct layout *self, size_t p)
{
    const struct axis_ticks *ticks = &self->y_ticks[p];
    double height = self->figure->panel[p].height;
    bool shown[axis_ticks_max];
    layout_choose_labels(&self->y[p], ticks, height, false, shown);
    for (size_t n = 0; n < ticks->count; n++) {
        if (shown[n]) {
            double y = self->top[p] + height * (1.0 - axis_map(&self->y[p], ticks->tick[n].value));
            write_text(out, "ty", self->left - layout_label_gap_px, y + 4.0, layout_span(ticks->tick[n].label));
        }
    }
}

static void write_grid(FILE *out, const struct layout *self, size_t p, bool major)
{
    const struct axis_ticks *x = &self->x_ticks;
    const struct axis_ticks *y = &self->y_ticks[p];
    double height = self->figure->panel[p].height;
    fprintf(out, "<path class=\"%s\" d=\"", major ? "gr" : "gm");
    for (size_t n = 0; n < x->count && self->figure->categories == 0; n++) {
        bool log_minor = self->x.scale == axis_log && x->tick[n].rank != axis_primary;
        if (major ? x->tick[n].rank == axis_primary : log_minor) {
            fprintf(out, "M%.1f %.1fv%.0f", self->left + self->width * axis_map(&self->x, x->tick[n].value),
                    self->top[p], height);
        }
    }
    for (size_t n = 0; n < y->count; n++) {
        bool log_minor = self->y[p].scale == axis_log && y->tick[n].rank != axis_primary;
        if (major ? y->tick[n].rank == axis_primary : log_minor) {
            fprintf(out, "M%.1f %.1fh%.1f", self->left,
                    self->top[p] + height * (1.0 - axis_map(&self->y[p], y->tick[n].value)), self->width);
        }
    }
    fputs("\"/>", out);
}

static void write_frame(FILE *out, const struct layout *self, size_t p)
{
    double height = self->figure->panel[p].height;
    double bottom = self->top[p] + height;
    fprintf(out, "<path class=\"fr\" d=\"M%.1f %.1fh%.1fv%.1fh%.1fz", self->left, self->top[p], self->width, height,
            -self->width);
    for (size_t n = 0; n < self->x_ticks.count && self->figure->categories == 0; n++) {
        double place = self->left + self->width * axis_map(&self->x, self->x_ticks.tick[n].value);
        bool minor = self->x_ticks.tick[n].rank == axis_minor;
        fprintf(out, "M%.1f %.1fv%d", place, bottom, minor ? -tick_px / 2 : -tick_px);
    }
    for (size_t n = 0; n < self->y_ticks[p].count; n++) {
        const struct axis_tick *tick = &self->y_ticks[p].tick[n];
        fprintf(out, "M%.1f %.1fh%d", self->left, bottom - height * axis_map(&self->y[p], tick->value),
                tick->rank == axis_minor ? tick_px / 2 : tick_px);
    }
    fputs("\"/>", out);
}

static void write_exponent(FILE *out, int exponent)
{
    fprintf(out, "\xC3\x97 10<tspan class=\"ex\" dy=\"-4\">%s%d</tspan>", exponent < 0 ? "\xE2\x88\x92" : "",
            abs(exponent));
}

static void write_panel_label(FILE *out, const struct layout *self, size_t p)
{
    struct text_span line[layout_label_lines_max];
    double room = self->figure->width - self->left - layout_edge_px;
    size_t lines = layout_wrap_label(self->figure->panel[p].label, room, line);
    for (size_t n = 0; n < lines; n++) {
        write_text(out, "la", self->left, self->top[p] - 7.0 - (double)((lines - 1 - n) * layout_line_px), line[n]);
    }
    if (self->y_ticks[p].exponent != 0) {
        fprintf(out, "<text class=\"ty\" x=\"%.1f\" y=\"%.1f\">", self->left - layout_label_gap_px, self->top[p] - 7.0);
        write_exponent(out, self->y_ticks[p].exponent);
        fputs("</text>", out);
    }
}

/* Bars and stems that go both ways need the line they start from. */
static void write_zero_line(FILE *out, const struct layout *self, size_t p)
{
    const struct axis *axis = &self->y[p];
    if (self->figure->panel[p].from_zero && axis->scale != axis_log && axis->low < 0.0 && axis->high > 0.0) {
        fprintf(out, "<path class=\"fr\" d=\"M%.1f %.1fh%.1f\"/>", self->left,
                self->top[p] + self->figure->panel[p].height * (1.0 - axis_map(axis, 0.0)), self->width);
    }
}

static void write_axis_data(FILE *out, const char *name, const struct axis *axis)
{
    fprintf(out, " data-%s=\"%.9g %.9g %d\"", name, axis->low, axis->high, axis->scale == axis_log);
}

static void write_panel(FILE *out, const struct layout *self, size_t p)
{
    const struct figure_panel *panel = &self->figure->panel[p];
    struct plot_area area = {&self->x, &self->y[p], self->width, panel->height,
                             plot_count_kind(panel, figure_bars, figure_bars)};
    write_panel_label(out, self, p);
    write_grid(out, self, p, false);
    write_grid(out, self, p, true);
    fprintf(out, "<svg class=\"pl\" x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\"", self->left, self->top[p],
            self->width, panel->height);
    write_axis_data(out, "y", &self->y[p]);
    fputs(">", out);
    size_t bars = 0;
    for (size_t s = 0; s < panel->count; s++) {
        plot_write_series(out, &panel->series[s], &area, bars);
        bars += panel->series[s].kind == figure_bars;
    }
    if (self->empty[p]) {
        write_text(out, "no", 0.5 * self->width, 0.5 * panel->height + 5.0, layout_span("no data"));
    }
    fputs("</svg>", out);
    write_zero_line(out, self, p);
    write_frame(out, self, p);
    write_y_axis(out, self, p);
    fputs("\n", out);
}

static void write_categories(FILE *out, const struct layout *self)
{
    double pitch = self->width / (double)self->figure->categories;
    for (size_t n = 0; n < self->figure->categories; n++) {
        struct text_span line[layout_category_lines_max];
        size_t lines = layout_wrap_category(self, n, line);
        for (size_t l = 0; l < lines; l++) {
            write_text(out, "tx", self->left + pitch * ((double)n + 0.5),
                       self->bottom + layout_label_gap_px + 10.0 + (double)(l * layout_line_px), line[l]);
        }
    }
}

static void write_x_numbers(FILE *out, const struct layout *self)
{
    bool shown[axis_ticks_max];
    layout_choose_labels(&self->x, &self->x_ticks, self->width, true, shown);
    for (size_t n = 0; n < self->x_ticks.count; n++) {
        if (shown[n]) {
            write_text(out, "tx", self->left + self->width * axis_map(&self->x, self->x_ticks.tick[n].value),
                       self->bottom + layout_label_gap_px + 10.0, layout_span(self->x_ticks.tick[n].label));
        }
    }
}

static void write_x_axis(FILE *out, const struct layout *self)
{
    struct text_span line[layout_label_lines_max];
    size_t lines = layout_wrap_label(self->figure->x_label, self->width, line);
    if (self->figure->categories > 0) {
        write_categories(out, self);
    } else {
        write_x_numbers(out, self);
    }
    for (size_t n = 0; n < lines; n++) {
        fprintf(out, "<text class=\"lx\" x=\"%.1f\" y=\"%.1f\">", self->left + 0.5 * self->width,
                self->x_label_y + (double)(n * layout_line_px));
        text_write_span(out, line[n]);
        if (self->x_ticks.exponent != 0 && n + 1 == lines && self->figure->categories == 0) {
            fputs(", ", out);
            write_exponent(out, self->x_ticks.exponent);
        }
        fputs("</text>", out);
    }
}

static void write_legend(FILE *out, const struct layout *self)
{
    for (size_t n = 0; n < self->items; n++) {
        const struct layout_item *item = &self->item[n];
        if (item->series != NULL) {
            plot_write_sample(out, item->series, item->x, item->y);
        }
        double x = item->x + layout_swatch_px + layout_swatch_gap_px;
        for (size_t l = 0; l < item->lines; l++) {
            write_text(out, "le", x, item->y + 4.0 + (double)(l * layout_line_px), item->line[l]);
        }
    }
}

void figure_write(const struct figure *self, FILE *out)
{
    struct layout layout;
    layout_find(self, &layout);
    fprintf(out,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"fig\" role=\"img\" width=\"%.0f\" height=\"%.0f\" "
            "viewBox=\"0 0 %.0f %.0f\" aria-label=\"",
            self->width, ceil(layout.height), self->width, ceil(layout.height));
    for (size_t p = 0; p < self->count; p++) {
        text_write(out, self->panel[p].label);
        fputs(p + 1 < self->count ? ", " : " over ", out);
    }
    text_write(out, self->x_label);
    fputs("\"", out);
    if (self->categories == 0) {
        fputs(" data-link=\"", out);
        text_write(out, self->x_label);
        fputs("\"", out);
        write_axis_data(out, "x", &layout.x);
    }
    fputs(">\n", out);
    for (size_t p = 0; p < self->count; p++) {
        write_panel(out, &layout, p);
    }
    write_x_axis(out, &layout);
    write_legend(out, &layout);
    fputs("</svg>\n", out);
}
