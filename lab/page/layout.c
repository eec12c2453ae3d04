/* SPDX-License-Identifier: MIT */
#include "lab/page/layout.h"
#include "lab/page/plot.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum {
    panel_gap_px = 12,
    legend_gap_px = 18,
    legend_text_px = 150,
    legend_column_px = legend_gap_px + layout_swatch_px + layout_swatch_gap_px + legend_text_px + layout_edge_px,
    legend_min_figure_px = 600,
};

/* Limits this many ranges away from the data are named, not drawn. */
static const double limit_reach = 3.0;
static const double band_reach = 0.25;

struct text_span layout_span(const char *text)
{
    return (struct text_span){text, strlen(text)};
}

/// Estimates the width of a text in px, never too small.
static double measure_px(const char *text)
{
    return layout_font_px * text_measure_em(layout_span(text));
}

size_t layout_wrap_label(const char *text, double width, struct text_span *out_lines)
{
    return text_wrap(text, width / layout_font_px, layout_label_lines_max, out_lines, NULL);
}

size_t layout_wrap_category(const struct layout *self, size_t n, struct text_span *out_lines)
{
    double pitch = self->width / (double)self->figure->categories;
    return text_wrap(self->figure->category[n], (pitch - 6.0) / layout_font_px, layout_category_lines_max, out_lines,
                     NULL);
}

struct range {
    double low, high; ///< low > high: nothing yet
};

static const struct range no_range = {INFINITY, -INFINITY};

static void extend(struct range *range, double value)
{
    range->low = fmin(range->low, value);
    range->high = fmax(range->high, value);
}

static bool is_empty(struct range range)
{
    return !(range.low <= range.high);
}

static struct range find_x_range(const struct figure *figure, bool *out_markers)
{
    struct range range = no_range;
    for (size_t p = 0; p < figure->count; p++) {
        const struct figure_panel *panel = &figure->panel[p];
        for (size_t s = 0; s < panel->count; s++) {
            const struct figure_series *series = &panel->series[s];
            for (size_t n = 0; n < series->count; n++) {
                struct plot_sample sample = plot_read_sample(series, n, figure->x_scale, panel->scale);
                if (sample.shown) {
                    extend(&range, sample.x);
                    *out_markers = *out_markers || (series->kind >= figure_points && series->kind != figure_band);
                }
            }
        }
    }
    return range;
}

static void fit_given(double low, double high, struct axis *axis)
{
    if (axis_can_show(axis->scale, low) && low < axis->high) {
        axis->low = low;
    }
    if (axis_can_show(axis->scale, high) && high > axis->low) {
        axis->high = high;
    }
}

/* A record of 2 s at 1 kHz ends at 1.999 s: the axis runs on to a tick that lies less than a hundredth away. */
static void snap_to_ticks(struct axis *axis)
{
    struct axis_ticks ticks;
    double marks[2] = {0.0, 0.0};
    size_t found = 0;
    axis_find_ticks(axis, 8, &ticks);
    for (size_t n = 0; n < ticks.count && found < 2; n++) {
        if (ticks.tick[n].rank == axis_primary) {
            marks[found++] = ticks.tick[n].value;
        }
    }
    if (axis->scale == axis_log || found < 2) {
        return;
    }
    double step = marks[1] - marks[0];
    double near = 0.01 * (axis->high - axis->low);
    double low = step * floor(axis->low / step);
    double high = step * ceil(axis->high / step);
    axis->low = axis->low - low < near ? low : axis->low;
    axis->high = high - axis->high < near ? high : axis->high;
}

static void fit_x(struct layout *self)
{
    const struct figure *figure = self->figure;
    bool markers = false;
    struct range range = find_x_range(figure, &markers);
    if (figure->categories > 0) {
        self->x = (struct axis){axis_linear, -0.5, (double)figure->categories - 0.5};
        return;
    }
    if (axis_can_show(figure->x_scale, figure->x_low)) {
        range.low = figure->x_low;
        range.high = fmax(range.high, range.low);
    }
    if (axis_can_show(figure->x_scale, figure->x_high)) {
        range.high = figure->x_high;
        range.low = fmin(range.low, range.high);
    }
    self->x_blank = is_empty(range);
    axis_fit(figure->x_scale, range.low, range.high, markers ? 0.02 : 0.0, &self->x);
    snap_to_ticks(&self->x);
    fit_given(figure->x_low, figure->x_high, &self->x);
}

/* Ranges are compared in the coordinate that is drawn: the value, or its logarithm. */
static double to_drawn(enum axis_scale scale, double value)
{
    return scale == axis_log ? log10(value) : value;
}

static double from_drawn(enum axis_scale scale, double value)
{
    return scale == axis_log ? pow(10.0, value) : value;
}

static void find_series_range(const struct layout *self, const struct figure_panel *panel,
                              const struct figure_series *series, struct range *range)
{
    for (size_t n = 0; n < series->count; n++) {
        struct plot_sample sample = plot_read_sample(series, n, self->x.scale, panel->scale);
        if (!sample.shown || sample.x < self->x.low || sample.x > self->x.high) {
            continue;
        }
        if (axis_can_show(panel->scale, sample.low)) {
            extend(range, to_drawn(panel->scale, sample.low));
        }
        if (axis_can_show(panel->scale, sample.high)) {
            extend(range, to_drawn(panel->scale, sample.high));
        }
    }
}

static struct range join_limits(const struct figure_panel *panel, struct range data)
{
    struct range joined = data;
    double reach = is_empty(data) ? INFINITY : limit_reach * (data.high - data.low);
    if (!is_empty(data) && panel->scale != axis_log) {
        reach = fmax(reach, limit_reach * fmax(fabs(data.low), fabs(data.high)));
    }
    if (data.low == 0.0 && data.high == 0.0) {
        reach = INFINITY;
    }
    for (size_t s = 0; s < panel->count; s++) {
        const struct figure_series *series = &panel->series[s];
        if (series->kind == figure_limit && axis_can_show(panel->scale, series->value)) {
            double value = to_drawn(panel->scale, series->value);
            if (is_empty(data) || (value >= data.low - reach && value <= data.high + reach)) {
                extend(&joined, value);
            }
        }
    }
    return joined;
}

static struct range join_bands(struct range data, struct range bands)
{
    if (is_empty(data) || is_empty(bands)) {
        return is_empty(data) ? bands : data;
    }
    double room = band_reach * (data.high - data.low);
    if (!(room > 0.0)) {
        room = INFINITY;
    }
    struct range joined = data;
    extend(&joined, fmax(bands.low, data.low - room));
    extend(&joined, fmin(bands.high, data.high + room));
    return joined;
}

static void fit_y(struct layout *self, size_t p)
{
    const struct figure_panel *panel = &self->figure->panel[p];
    struct range data = no_range;
    struct range bands = no_range;
    for (size_t s = 0; s < panel->count; s++) {
        const struct figure_series *series = &panel->series[s];
        find_series_range(self, panel, series, plot_is_range(series->kind) ? &bands : &data);
    }
    struct range range = join_bands(data, bands);
    self->empty[p] = is_empty(range);
    if (panel->from_zero && panel->scale != axis_log && !is_empty(range)) {
        extend(&range, 0.0);
    }
    range = join_limits(panel, range);
    self->y_blank[p] = is_empty(range) && !(panel->low < panel->high);
    bool bars = plot_count_kind(panel, figure_bars, figure_bars) > 0;
    axis_fit(panel->scale, from_drawn(panel->scale, range.low), from_drawn(panel->scale, range.high),
             bars ? 0.14 : 0.06, &self->y[p]);
    if (panel->from_zero && range.low == 0.0 && panel->scale != axis_log) {
        self->y[p].low = 0.0;
    }
    fit_given(panel->low, panel->high, &self->y[p]);
}

static double find_left(const struct layout *self)
{
    double widest = 0.0;
    for (size_t p = 0; p < self->figure->count; p++) {
        const struct axis_ticks *ticks = &self->y_ticks[p];
        for (size_t n = 0; n < ticks->count; n++) {
            widest = fmax(widest, measure_px(ticks->tick[n].label));
        }
        if (ticks->exponent != 0) {
            widest = fmax(widest, measure_px("x 10-000"));
        }
    }
    return fmax(layout_left_px, layout_edge_px + widest + layout_label_gap_px);
}

/* What the legend adds to the name, so that the reader knows what the picture does not show. */
static bool write_remark(const struct layout *self, size_t p, const struct figure_series *series,
                         char out_text[2 * figure_text_max])
{
    const struct figure_panel *panel = &self->figure->panel[p];
    struct plot_area area = {&self->x, &self->y[p], 1000.0, 1000.0, 0};
    const char *name = series->name;
    if (series->kind == figure_limit) {
        bool shown = axis_can_show(panel->scale, series->value) && series->value >= self->y[p].low &&
                     series->value <= self->y[p].high;
        if (!shown) {
            snprintf(out_text, (size_t)(2 * figure_text_max), "%s (%.4g, off the scale)", name, series->value);
        }
        return !shown;
    }
    bool drawn = false;
    for (size_t n = 0; n < series->count && !drawn; n++) {
        drawn = plot_read_sample(series, n, self->x.scale, panel->scale).shown;
    }
    size_t outside = plot_count_outside(series, &area);
    if (!drawn) {
        snprintf(out_text, (size_t)(2 * figure_text_max), "%s (no data)", name);
    } else if (outside > 0) {
        snprintf(out_text, (size_t)(2 * figure_text_max), "%s (%zu off the scale)", name, outside);
    }
    return !drawn || outside > 0;
}

static bool is_repeated(const struct layout *self, size_t p, const struct figure_series *series)
{
    const struct figure *figure = self->figure;
    char remark[2 * figure_text_max];
    for (size_t before = 0; before < p; before++) {
        for (size_t s = 0; s < figure->panel[before].count; s++) {
            const struct figure_series *other = &figure->panel[before].series[s];
            if (other->kind == series->kind && other->colour == series->colour && other->marker == series->marker &&
                other->dash == series->dash && strcmp(other->name, series->name) == 0 &&
                !write_remark(self, before, other, remark)) {
                return true;
            }
        }
    }
    return false;
}

static void collect_items(struct layout *self, size_t p)
{
    const struct figure_panel *panel = &self->figure->panel[p];
    for (size_t s = 0; s < panel->count; s++) {
        const struct figure_series *series = &panel->series[s];
        struct layout_item *item = &self->item[self->items];
        bool remark = series->name[0] != '\0' && write_remark(self, p, series, item->text);
        if (series->name[0] == '\0' || (!remark && is_repeated(self, p, series))) {
            continue;
        }
        if (!remark) {
            text_copy(series->name, sizeof item->text, item->text);
        }
        item->series = series;
        self->items++;
    }
    if (panel->left_out > 0) {
        struct layout_item *item = &self->item[self->items++];
        item->series = NULL;
        snprintf(item->text, sizeof item->text, "... and %zu more, not drawn", panel->left_out);
    }
}

static void wrap_item(struct layout_item *item, double width)
{
    int cut = 0;
    item->lines = text_wrap(item->text, width / layout_font_px, layout_legend_lines_max, item->line, &cut);
    for (size_t size = strlen(item->text); cut && size > 16; size -= 4) {
        char whole[sizeof item->text];
        text_copy(item->text, sizeof whole, whole);
        text_shorten(whole, size, item->text);
        item->lines = text_wrap(item->text, width / layout_font_px, layout_legend_lines_max, item->line, &cut);
    }
}

/* Places a panel's items beside its frame; false if they are taller than the frame. */
static bool place_right(struct layout *self, size_t p, size_t first)
{
    double y = self->top[p] + 8.0;
    for (size_t n = first; n < self->items; n++) {
        struct layout_item *item = &self->item[n];
        wrap_item(item, legend_text_px);
        item->x = self->left + self->width + legend_gap_px;
        item->y = y;
        y += (double)item->lines * layout_line_px + 4.0;
    }
    return y <= self->top[p] + self->figure->panel[p].height + layout_label_gap_px + layout_line_px;
}

static void place_below(struct layout *self)
{
    double x = self->left;
    double y = self->height + 12.0;
    double end = self->figure->width - layout_edge_px;
    double tallest = 0.0;
    for (size_t n = 0; n < self->items; n++) {
        struct layout_item *item = &self->item[n];
        wrap_item(item, end - self->left - layout_swatch_px - layout_swatch_gap_px);
        double widest = 0.0;
        for (size_t l = 0; l < item->lines; l++) {
            widest = fmax(widest, layout_font_px * text_measure_em(item->line[l]));
        }
        double needed = layout_swatch_px + layout_swatch_gap_px + widest;
        if (x > self->left && x + needed > end) {
            x = self->left;
            y += tallest + 4.0;
            tallest = 0.0;
        }
        item->x = x;
        item->y = y;
        x += needed + legend_gap_px;
        tallest = fmax(tallest, (double)item->lines * layout_line_px);
    }
    self->height = self->items > 0 ? y + tallest - 3.0 : self->height;
}

/* Frames from top to bottom; sets the height up to and with the x axis. */
static void place_frames(struct layout *self)
{
    const struct figure *figure = self->figure;
    double y = 2.0;
    double room = figure->width - self->left - layout_edge_px;
    struct text_span line[layout_label_lines_max];
    for (size_t p = 0; p < figure->count; p++) {
        double labels = (double)layout_wrap_label(figure->panel[p].label, room, line);
        self->top[p] = y + labels * layout_line_px + 5.0;
        y = self->top[p] + figure->panel[p].height + panel_gap_px;
    }
    self->bottom = y - panel_gap_px;
    double lines = 1.0;
    struct text_span part[layout_category_lines_max];
    for (size_t n = 0; n < figure->categories; n++) {
        lines = fmax(lines, (double)layout_wrap_category(self, n, part));
    }
    self->x_label_y = self->bottom + layout_label_gap_px + lines * layout_line_px + 13.0;
    self->height = self->bottom + layout_label_gap_px + lines * layout_line_px + 3.0;
    self->height += layout_line_px * (double)layout_wrap_label(figure->x_label, self->width, line);
}

static void place_legend(struct layout *self)
{
    const struct figure *figure = self->figure;
    bool fits = true;
    self->items = 0;
    for (size_t p = 0; p < figure->count; p++) {
        size_t first = self->items;
        collect_items(self, p);
        fits = place_right(self, p, first) && fits;
    }
    if (figure->legend == figure_legend_auto) {
        self->legend_right = fits && figure->width >= legend_min_figure_px;
    } else {
        self->legend_right = figure->legend == figure_legend_right;
    }
}

void layout_find(const struct figure *figure, struct layout *self)
{
    memset(self, 0, sizeof *self);
    self->figure = figure;
    fit_x(self);
    for (size_t p = 0; p < figure->count; p++) {
        fit_y(self, p);
        if (!self->y_blank[p]) {
            axis_find_ticks(&self->y[p], (size_t)fmax(2.0, figure->panel[p].height / 32.0), &self->y_ticks[p]);
        }
    }
    self->left = find_left(self);
    self->width = figure->width - self->left - legend_gap_px;
    place_frames(self);
    place_legend(self);
    if (self->legend_right && self->items > 0) {
        self->width = figure->width - self->left - legend_column_px;
        place_frames(self);
        place_legend(self);
    }
    if (self->legend_right) {
        const struct layout_item *last = &self->item[self->items > 0 ? self->items - 1 : 0];
        self->height = fmax(self->height, last->y + (double)last->lines * layout_line_px);
    } else {
        place_below(self);
    }
    if (!self->x_blank) {
        axis_find_ticks(&self->x, (size_t)fmax(2.0, self->width / 75.0), &self->x_ticks);
    }
}

void layout_choose_labels(const struct axis *axis, const struct axis_ticks *ticks, double length, bool along,
                          bool *out_shown)
{
    const double air_px = along ? 10.0 : 3.0;
    for (size_t n = 0; n < ticks->count; n++) {
        out_shown[n] = false;
    }
    for (int rank = axis_primary; rank >= axis_secondary; rank--) {
        for (size_t n = 0; n < ticks->count; n++) {
            if ((int)ticks->tick[n].rank != rank) {
                continue;
            }
            double size = along ? measure_px(ticks->tick[n].label) : layout_font_px;
            double place = length * axis_map(axis, ticks->tick[n].value);
            bool free_place = true;
            for (size_t m = 0; m < ticks->count; m++) {
                double other = along ? measure_px(ticks->tick[m].label) : layout_font_px;
                double apart = fabs(length * axis_map(axis, ticks->tick[m].value) - place);
                free_place = free_place && (!out_shown[m] || apart >= 0.5 * (size + other) + air_px);
            }
            out_shown[n] = free_place;
        }
    }
}
