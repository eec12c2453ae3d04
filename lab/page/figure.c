/* SPDX-License-Identifier: MIT */
#include "lab/page/figure.h"
#include "lab/page/plot.h"
#include "lab/page/text.h"

#include <assert.h>
#include <math.h>
#include <string.h>

static const double usual_height_px = 170.0;
void figure_start(struct figure *self, const char *x_label, enum axis_scale x_scale)
{
    memset(self, 0, sizeof *self);
    text_copy(x_label, sizeof self->x_label, self->x_label);
    self->x_scale = x_scale;
    self->x_low = NAN;
    self->x_high = NAN;
    self->width = figure_width_full;
}

void figure_set_categories(struct figure *self, size_t count, const char *const *names)
{
    self->categories = count < figure_categories_max ? count : figure_categories_max;
    for (size_t n = 0; n < self->categories; n++) {
        text_shorten(names[n], sizeof self->category[n], self->category[n]);
    }
}

struct figure_panel *figure_add_panel(struct figure *self, const char *label, enum axis_scale scale)
{
    assert(self->count < figure_panels_max);
    struct figure_panel *panel = &self->panel[self->count];
    self->count++;
    text_shorten(label, sizeof panel->label, panel->label);
    panel->scale = scale;
    panel->height = usual_height_px;
    panel->low = NAN;
    panel->high = NAN;
    return panel;
}

/* The slot after the last takes what does not fit, so that callers need not check. */
static struct figure_series *add_series(struct figure_panel *self, enum figure_kind kind, const char *name,
                                        size_t count, const double *x, const double *y)
{
    static const enum figure_colour cycle[] = {figure_blue,   figure_vermilion, figure_green,
                                               figure_purple, figure_orange,    figure_sky};
    size_t coloured = self->count - plot_count_kind(self, figure_limit, figure_limit);
    struct figure_series series = {.kind = kind, .count = y != NULL ? count : 0, .x = x, .y = y};
    text_shorten(name, sizeof series.name, series.name);
    series.colour = cycle[coloured % (sizeof cycle / sizeof cycle[0])];
    series.marker = (enum figure_marker)(plot_count_kind(self, figure_points, figure_points) % (figure_diamond + 1));
    series.dash = (enum figure_dash)(plot_count_kind(self, figure_line, figure_step) % 4);
    struct figure_series *slot = &self->series[self->count];
    *slot = series;
    if (self->count < figure_series_max) {
        self->count++;
    } else {
        self->left_out++;
    }
    return slot;
}

struct figure_series *figure_add_line(struct figure_panel *self, const char *name, size_t count, const double *x,
                                      const double *y)
{
    return add_series(self, figure_line, name, count, x, y);
}

struct figure_series *figure_add_step(struct figure_panel *self, const char *name, size_t count, const double *x,
                                      const double *y)
{
    return add_series(self, figure_step, name, count, x, y);
}

struct figure_series *figure_add_points(struct figure_panel *self, const char *name, size_t count, const double *x,
                                        const double *y)
{
    return add_series(self, figure_points, name, count, x, y);
}

struct figure_series *figure_add_band(struct figure_panel *self, const char *name, size_t count, const double *x,
                                      const double *low, const double *high)
{
    struct figure_series *series = add_series(self, figure_band, name, high != NULL ? count : 0, x, low);
    series->y2 = high;
    return series;
}

struct figure_series *figure_add_spans(struct figure_panel *self, const char *name, size_t count, const double *x,
                                       const double *low, const double *high)
{
    struct figure_series *series = add_series(self, figure_spans, name, high != NULL ? count : 0, x, low);
    series->y2 = high;
    return series;
}

struct figure_series *figure_add_stems(struct figure_panel *self, const char *name, size_t count, const double *x,
                                       const double *y)
{
    self->from_zero = true;
    return add_series(self, figure_stems, name, count, x, y);
}

struct figure_series *figure_add_bars(struct figure_panel *self, const char *name, size_t count, const double *x,
                                      const double *y)
{
    size_t bars = plot_count_kind(self, figure_bars, figure_bars);
    self->from_zero = true;
    struct figure_series *series = add_series(self, figure_bars, name, count, x, y);
    series->dash = (enum figure_dash)(bars % 3);
    return series;
}

struct figure_series *figure_add_limit(struct figure_panel *self, const char *name, double value)
{
    size_t limits = plot_count_kind(self, figure_limit, figure_limit);
    struct figure_series *series = add_series(self, figure_limit, name, 0, NULL, NULL);
    series->value = value;
    series->colour = figure_ink;
    series->dash = limits % 2 == 0 ? figure_dashed : figure_dotted;
    return series;
}
