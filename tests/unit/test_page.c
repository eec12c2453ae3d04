/* SPDX-License-Identifier: MIT */
/// Figures and pages: what is drawn where, that nothing outside gets in, and that the result is well-formed. The
/// expectations come from the arrays that go in, and the drawing is read back from the SVG that comes out.
#include "lab/page/page.h"
#include "lab/page/text.h"

#include "unity.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Coordinates are written in tenths of a pixel, so half of that may be lost. */
static const double written_px = 0.051;
enum { depth_max = 32, name_max = 16 };
static char *text;
static size_t text_length;
static FILE *out;
static struct figure figure;

void setUp(void)
{
    text = NULL;
    out = open_memstream(&text, &text_length);
    TEST_ASSERT_NOT_NULL(out);
    figure_start(&figure, "time in s", axis_linear);
}

void tearDown(void)
{
    fclose(out);
    free(text);
}

static const char *written(void)
{
    fflush(out);
    return text;
}

static const char *drawn(void)
{
    figure_write(&figure, out);
    return written();
}

static size_t count_of(const char *where, const char *what)
{
    size_t found = 0;
    for (const char *at = strstr(where, what); at != NULL; at = strstr(at + 1, what))
        found++;
    return found;
}

/* A small checker of well-formedness: tags balance, attributes are quoted and unique enough to parse, every & begins an
   entity, no bare <. Says what is wrong, or NULL. */
struct checker {
    const char *at;
    size_t depth;
    char open[depth_max][name_max];
};

static const char *check_entity(const char **at)
{
    static const char *const known[] = {"&amp;", "&lt;", "&gt;", "&quot;", "&#39;"};
    for (size_t n = 0; n < sizeof known / sizeof known[0]; n++) {
        if (strncmp(*at, known[n], strlen(known[n])) == 0) {
            *at += strlen(known[n]);
            return NULL;
        }
    }
    return "an & that begins no entity";
}

static const char *check_attributes(struct checker *self)
{
    for (;;) {
        self->at += strspn(self->at, " \n");
        if (*self->at == '>' || strncmp(self->at, "/>", 2) == 0) {
            return NULL;
        }
        size_t name = strcspn(self->at, "= \n<>\"");
        if (name == 0 || strncmp(self->at + name, "=\"", 2) != 0) {
            return "an attribute without name or quoted value";
        }
        self->at += name + 2;
        while (*self->at != '"') {
            const char *wrong = *self->at == '&' ? check_entity(&self->at) : NULL;
            if (wrong != NULL || *self->at == '<' || *self->at == '\0') {
                return wrong != NULL ? wrong : "a < or the end inside an attribute";
            }
            self->at += *self->at != '"' && *self->at != '&';
        }
        self->at++;
        if (strchr(" \n/>", *self->at) == NULL) {
            return "attributes run together";
        }
    }
}

static const char *check_close(struct checker *self)
{
    size_t name = strcspn(self->at, ">");
    if (self->depth == 0 || strlen(self->open[self->depth - 1]) != name ||
        strncmp(self->open[self->depth - 1], self->at, name) != 0) {
        return "a closing tag without its opening one";
    }
    self->depth--;
    self->at += name + 1;
    return NULL;
}

static const char *check_open(struct checker *self)
{
    size_t name = strcspn(self->at, " \n/>");
    if (name == 0 || name >= name_max || self->depth == depth_max) {
        return "no tag name, or nested too deep";
    }
    memcpy(self->open[self->depth], self->at, name);
    self->open[self->depth][name] = '\0';
    self->at += name;
    const char *wrong = check_attributes(self);
    if (wrong != NULL) {
        return wrong;
    }
    bool empty = *self->at == '/';
    self->at += empty ? 2 : 1;
    self->depth += !empty;
    return NULL;
}

static const char *check_markup(const char *markup)
{
    static struct checker checker;
    checker = (struct checker){.at = markup};
    const char *wrong = NULL;
    while (*checker.at != '\0' && wrong == NULL) {
        if (strncmp(checker.at, "<!DOCTYPE html>", 15) == 0) {
            checker.at += 15;
        } else if (strncmp(checker.at, "//<![CDATA[", 11) == 0) {
            checker.at = strstr(checker.at, "]]>") + 3;
        } else if (strncmp(checker.at, "</", 2) == 0) {
            checker.at += 2;
            wrong = check_close(&checker);
        } else if (*checker.at == '<') {
            checker.at++;
            wrong = check_open(&checker);
        } else if (*checker.at == '&') {
            wrong = check_entity(&checker.at);
        } else {
            wrong = *checker.at == '>' && checker.depth == 0 ? "a > outside" : NULL;
            checker.at++;
        }
    }
    return wrong != NULL ? wrong : checker.depth > 0 ? "a tag that is never closed" : NULL;
}

static void assert_well_formed(const char *markup)
{
    const char *wrong = check_markup(markup);
    TEST_ASSERT_NULL_MESSAGE(wrong, wrong != NULL ? wrong : "");
}

/* The legend's lines, in order, joined by spaces: names may be broken over several. */
static const char *read_legend(const char *svg)
{
    static char joined[2048];
    joined[0] = '\0';
    for (const char *at = strstr(svg, "class=\"le\""); at != NULL; at = strstr(at + 1, "class=\"le\"")) {
        const char *line = strchr(at, '>') + 1;
        size_t used = strlen(joined);
        snprintf(joined + used, sizeof joined - used, "%.*s ", (int)strcspn(line, "<"), line);
    }
    return joined;
}

/* A path read back: the vertices its M and l commands visit. */
struct trace {
    size_t count;
    size_t moves;
    struct {
        double x, y;
    } at[20000];
};
static struct trace trace;

/* Reads the first path of a class. Commands after an "m" draw a marker's shape and are skipped. */
static void read_path(const char *svg, const char *class_name)
{
    char begin[64];
    snprintf(begin, sizeof begin, "<path class=\"%s", class_name);
    const char *path = strstr(svg, begin);
    TEST_ASSERT_NOT_NULL_MESSAGE(path, class_name);
    const char *d = strstr(path, " d=\"") + 4;
    double x = 0.0;
    double y = 0.0;
    char command = 'M';
    trace.count = 0;
    trace.moves = 0;
    while (*d != '"') {
        if (strchr("Mlz", *d) != NULL) {
            command = *d++;
            trace.moves += command == 'M';
            continue;
        }
        char *end;
        double first = strtod(d, &end);
        double second = strtod(end, &end);
        TEST_ASSERT_TRUE_MESSAGE(end != d, "path data that is not a number");
        d = end + strspn(end, " ");
        x = command == 'M' ? first : x + first;
        y = command == 'M' ? second : y + second;
        TEST_ASSERT_TRUE(trace.count < sizeof trace.at / sizeof trace.at[0]);
        trace.at[trace.count].x = x;
        trace.at[trace.count].y = y;
        trace.count++;
    }
}

struct frame {
    double width, height, x_low, x_high, y_low, y_high;
};

/* The first frame and its axes, as the figure itself declares them. */
static struct frame read_frame(const char *svg)
{
    struct frame frame;
    const char *x = strstr(svg, " data-x=\"");
    const char *plot = strstr(svg, "<svg class=\"pl\"");
    TEST_ASSERT_TRUE(x != NULL && plot != NULL);
    TEST_ASSERT_EQUAL(2, sscanf(x, " data-x=\"%lf %lf", &frame.x_low, &frame.x_high));
    TEST_ASSERT_EQUAL(4, sscanf(plot,
                                "<svg class=\"pl\" x=\"%*f\" y=\"%*f\" width=\"%lf\" height=\"%lf\" data-y=\"%lf %lf",
                                &frame.width, &frame.height, &frame.y_low, &frame.y_high));
    return frame;
}

static double to_x(struct frame frame, double value)
{
    return frame.width * (value - frame.x_low) / (frame.x_high - frame.x_low);
}

static double to_y(struct frame frame, double value)
{
    return frame.height * (1.0 - (value - frame.y_low) / (frame.y_high - frame.y_low));
}

static void assert_inside(struct frame frame)
{
    for (size_t n = 0; n < trace.count; n++) {
        TEST_ASSERT_DOUBLE_WITHIN(0.5 * frame.width + written_px, 0.5 * frame.width, trace.at[n].x);
        TEST_ASSERT_DOUBLE_WITHIN(0.5 * frame.height + written_px, 0.5 * frame.height, trace.at[n].y);
    }
}

static void test_page_checker_finds_bad_markup(void)
{
    TEST_ASSERT_NULL(check_markup("<a b=\"1\"><c/>x &amp; y</a>"));
    TEST_ASSERT_NOT_NULL(check_markup("<a><b></a></b>"));
    TEST_ASSERT_NOT_NULL(check_markup("<a>"));
    TEST_ASSERT_NOT_NULL(check_markup("<a b=1></a>"));
    TEST_ASSERT_NOT_NULL(check_markup("<a>x & y</a>"));
    TEST_ASSERT_NOT_NULL(check_markup("<a b=\"<\"></a>"));
}

static void test_figure_draws_values_where_the_axes_say(void)
{
    const double x[] = {0.0, 1.0, 2.0, 4.0};
    const double y[] = {1.0, -3.0, 2.0, 0.5};
    struct figure_panel *panel = figure_add_panel(&figure, "torque in Nm", axis_linear);
    figure_add_line(panel, "measured", 4, x, y);
    const char *svg = drawn();
    struct frame frame = read_frame(svg);
    read_path(svg, "ln");
    TEST_ASSERT_EQUAL(4, trace.count);
    TEST_ASSERT_EQUAL(1, trace.moves);
    for (size_t n = 0; n < 4; n++) {
        TEST_ASSERT_DOUBLE_WITHIN(written_px, to_x(frame, x[n]), trace.at[n].x);
        TEST_ASSERT_DOUBLE_WITHIN(written_px, to_y(frame, y[n]), trace.at[n].y);
    }
    assert_well_formed(svg);
}

static void test_figure_clips_a_line_at_its_crossing(void)
{
    const double x[] = {0.0, 10.0};
    const double y[] = {0.0, 100.0};
    struct figure_panel *panel = figure_add_panel(&figure, "torque in Nm", axis_linear);
    figure_add_line(panel, "measured", 2, x, y);
    panel->low = 0.0;
    panel->high = 25.0;
    const char *svg = drawn();
    struct frame frame = read_frame(svg);
    read_path(svg, "ln");
    TEST_ASSERT_EQUAL(2, trace.count);
    TEST_ASSERT_DOUBLE_WITHIN(written_px, to_x(frame, 2.5), trace.at[1].x);
    TEST_ASSERT_DOUBLE_WITHIN(written_px, 0.0, trace.at[1].y);
    TEST_ASSERT_NOT_NULL(strstr(read_legend(svg), "(1 off the scale)"));
}

static void test_figure_clips_lines_that_pass_through_the_frame(void)
{
    const double x[] = {0.0, 1.0, 2.0, 3.0, 4.0};
    const double y[] = {-50.0, 50.0, 70.0, 1e90, -1e90};
    struct figure_panel *panel = figure_add_panel(&figure, "torque in Nm", axis_linear);
    figure_add_line(panel, "measured", 5, x, y);
    panel->low = -1.0;
    panel->high = 1.0;
    const char *svg = drawn();
    read_path(svg, "ln");
    TEST_ASSERT_EQUAL(2, trace.moves);
    TEST_ASSERT_EQUAL(4, trace.count);
    assert_inside(read_frame(svg));
}

static void test_figure_leaves_out_points_beyond_the_frame(void)
{
    const double y[] = {0.0, 2.0, 0.5, -7.0, 1.0};
    struct figure_panel *panel = figure_add_panel(&figure, "torque in Nm", axis_linear);
    figure_add_points(panel, "measured", 5, NULL, y);
    panel->low = 0.0;
    panel->high = 1.0;
    const char *svg = drawn();
    read_path(svg, "pt");
    TEST_ASSERT_EQUAL(3, trace.moves);
    assert_inside(read_frame(svg));
    TEST_ASSERT_NOT_NULL(strstr(read_legend(svg), "measured (2 off the scale)"));
}

enum { long_count = 22000 };
static double signal[long_count];

/* A spike one sample long must be seen however many samples share its pixel. */
static void test_figure_thinning_keeps_every_extreme(void)
{
    for (size_t n = 0; n < long_count; n++)
        signal[n] = sin(0.003 * (double)n) + 0.1 * sin(1.7 * (double)n);
    static const size_t spikes[] = {0, 777, 5000, 13131, long_count - 1};
    for (size_t n = 0; n < sizeof spikes / sizeof spikes[0]; n++)
        signal[spikes[n]] = n % 2 == 0 ? 3.0 + 0.1 * (double)n : -3.0 - 0.1 * (double)n;
    struct figure_panel *panel = figure_add_panel(&figure, "torque in Nm", axis_linear);
    figure_add_line(panel, "measured", long_count, NULL, signal);
    const char *svg = drawn();
    struct frame frame = read_frame(svg);
    read_path(svg, "ln");
    assert_inside(frame);
    for (size_t n = 0; n < sizeof spikes / sizeof spikes[0]; n++) {
        double nearest = INFINITY;
        for (size_t v = 0; v < trace.count; v++) {
            nearest = fmin(nearest, hypot(trace.at[v].x - to_x(frame, (double)spikes[n]),
                                          trace.at[v].y - to_y(frame, signal[spikes[n]])));
        }
        TEST_ASSERT_DOUBLE_WITHIN(2.0 * written_px, 0.0, nearest);
    }
    TEST_ASSERT_TRUE(trace.count <= 4 * ((size_t)frame.width + 1));
    TEST_ASSERT_LESS_THAN(40000, text_length);
}

/* In each pixel column the drawn line spans what the samples span: no extreme is lost and none is made up. */
static void test_figure_thinning_spans_each_column(void)
{
    unsigned long state = 12345;
    for (size_t n = 0; n < long_count; n++) {
        state = (state * 1103515245UL + 12345UL) & 0x7FFFFFFFUL;
        signal[n] = (double)state / 2147483648.0;
    }
    const size_t gap = 10000;
    signal[gap] = NAN;
    signal[gap - 1] = 0.5; /* within what its column spans, and drawn all the same, for the line ends there */
    struct figure_panel *panel = figure_add_panel(&figure, "torque in Nm", axis_linear);
    figure_add_line(panel, "", long_count, NULL, signal);
    const char *svg = drawn();
    struct frame frame = read_frame(svg);
    read_path(svg, "ln");
    double nearest = INFINITY;
    for (size_t v = 0; v < trace.count; v++) {
        nearest =
            fmin(nearest, hypot(trace.at[v].x - to_x(frame, (double)(gap - 1)), trace.at[v].y - to_y(frame, 0.5)));
    }
    TEST_ASSERT_DOUBLE_WITHIN(2.0 * written_px, 0.0, nearest);
    for (double column = 1.0; column < frame.width - 2.0; column += 1.0) {
        double low = INFINITY, high = -INFINITY, drawn_low = INFINITY, drawn_high = -INFINITY;
        for (size_t n = 0; n < long_count; n++) {
            double x = to_x(frame, (double)n);
            if (x >= column + 2.0 * written_px && x < column + 1.0 - 2.0 * written_px) {
                low = fmin(low, to_y(frame, signal[n]));
                high = fmax(high, to_y(frame, signal[n]));
            }
        }
        for (size_t v = 0; v < trace.count; v++) {
            if (trace.at[v].x >= column - written_px && trace.at[v].x <= column + 1.0 + written_px) {
                drawn_low = fmin(drawn_low, trace.at[v].y);
                drawn_high = fmax(drawn_high, trace.at[v].y);
            }
        }
        TEST_ASSERT_TRUE(drawn_low <= low + 2.0 * written_px && drawn_high >= high - 2.0 * written_px);
    }
}

static void test_figure_draws_each_half_pixel_once(void)
{
    for (size_t n = 0; n < long_count; n++)
        signal[n] = n % 2 == 0 ? 0.25 : 0.75;
    struct figure_panel *panel = figure_add_panel(&figure, "torque in Nm", axis_linear);
    figure_add_points(panel, "measured", long_count, NULL, signal);
    const char *svg = drawn();
    read_path(svg, "pt");
    TEST_ASSERT_LESS_THAN(2 * (2 * (size_t)read_frame(svg).width + 3), trace.moves);
    TEST_ASSERT_GREATER_THAN((size_t)read_frame(svg).width, trace.moves);
}

static void test_figure_breaks_lines_at_values_without_a_place(void)
{
    const double y[] = {1.0, 2.0, NAN, 3.0, INFINITY, 2.0, 1.0, 1.5};
    struct figure_panel *panel = figure_add_panel(&figure, "torque in Nm", axis_linear);
    figure_add_line(panel, "measured", 8, NULL, y);
    const char *svg = drawn();
    read_path(svg, "ln");
    TEST_ASSERT_EQUAL(3, trace.moves); /* 1 2, the lone 3 as a dot, 2 1 1.5 */
    TEST_ASSERT_EQUAL(2 + 2 + 3, trace.count);
    TEST_ASSERT_NULL(strstr(svg, "nan"));
    TEST_ASSERT_NULL(strstr(svg, "inf"));
}

static void test_figure_holds_the_value_of_a_step_line(void)
{
    const double y[] = {1.0, 2.0, 0.0};
    struct figure_panel *panel = figure_add_panel(&figure, "torque in Nm", axis_linear);
    figure_add_step(panel, "measured", 3, NULL, y);
    const char *svg = drawn();
    struct frame frame = read_frame(svg);
    read_path(svg, "ln");
    TEST_ASSERT_EQUAL(5, trace.count);
    TEST_ASSERT_DOUBLE_WITHIN(written_px, to_x(frame, 1.0), trace.at[1].x);
    TEST_ASSERT_DOUBLE_WITHIN(written_px, to_y(frame, 1.0), trace.at[1].y);
    TEST_ASSERT_DOUBLE_WITHIN(written_px, to_y(frame, 2.0), trace.at[2].y);
}

static void test_figure_treats_nonpositive_values_on_a_log_axis_as_gaps(void)
{
    const double y[] = {1.0, 0.0, 10.0, -5.0, 100.0};
    struct figure_panel *panel = figure_add_panel(&figure, "amplitude in Nm", axis_log);
    figure_add_points(panel, "measured", 5, NULL, y);
    read_path(drawn(), "pt");
    TEST_ASSERT_EQUAL(3, trace.moves);
}

/* A measured value below its uncertainty has no lower edge in decibels; the band then runs out of the frame. */
static void test_figure_band_with_infinite_edge_reaches_the_frame(void)
{
    const double low[] = {-1.0, -INFINITY, -1.0};
    const double high[] = {1.0, 1.0, 1.0};
    const double middle[] = {0.0, 0.0, 0.1};
    struct figure_panel *panel = figure_add_panel(&figure, "magnitude in dB", axis_linear);
    figure_add_band(panel, "2 sigma", 3, NULL, low, high);
    figure_add_points(panel, "measured", 3, NULL, middle);
    const char *svg = drawn();
    const char *band = strstr(svg, "class=\"bd");
    TEST_ASSERT_NOT_NULL(band);
    double lowest = 0.0;
    for (const char *at = strpbrk(strstr(band, " d=\""), "ML"); at != NULL && *at != 'z'; at = strpbrk(at + 1, "MLz")) {
        double x, y;
        TEST_ASSERT_EQUAL(2, sscanf(at + 1, "%lf%lf", &x, &y));
        lowest = fmax(lowest, y);
    }
    TEST_ASSERT_TRUE(lowest > read_frame(svg).height);
    assert_well_formed(svg);
}

static void test_figure_band_cannot_flatten_the_data(void)
{
    const double low[] = {-1e6, -1.0};
    const double high[] = {1e6, 2.0};
    const double middle[] = {0.0, 1.0};
    struct figure_panel *panel = figure_add_panel(&figure, "magnitude in dB", axis_linear);
    figure_add_band(panel, "2 sigma", 2, NULL, low, high);
    figure_add_points(panel, "measured", 2, NULL, middle);
    struct frame frame = read_frame(drawn());
    TEST_ASSERT_TRUE(frame.y_high - frame.y_low < 3.0);
}

static void test_figure_shows_near_limits_and_names_far_ones(void)
{
    const double y[] = {-0.9, 0.9};
    struct figure_panel *panel = figure_add_panel(&figure, "torque in Nm", axis_linear);
    figure_add_line(panel, "measured", 2, NULL, y);
    figure_add_limit(panel, "allowed", 1.0);
    figure_add_limit(panel, "peak", 80.0);
    const char *svg = drawn();
    struct frame frame = read_frame(svg);
    TEST_ASSERT_TRUE(frame.y_high > 1.0 && frame.y_high < 2.0);
    TEST_ASSERT_NOT_NULL(strstr(svg, ">allowed<"));
    TEST_ASSERT_NOT_NULL(strstr(read_legend(svg), "peak (80, off the scale)"));
}

static void test_figure_says_no_data_when_there_is_none(void)
{
    const double y[] = {NAN, NAN};
    struct figure_panel *panel = figure_add_panel(&figure, "torque in Nm", axis_linear);
    figure_add_line(panel, "measured", 2, NULL, y);
    figure_add_points(panel, "empty", 0, NULL, NULL);
    figure_add_band(panel, "uncertainty", 2, NULL, y, NULL);
    const char *svg = drawn();
    TEST_ASSERT_NOT_NULL(strstr(svg, ">no data<"));
    TEST_ASSERT_NULL_MESSAGE(strstr(svg, "class=\"ty\""), "numbers along an axis that has no range");
    TEST_ASSERT_NOT_NULL(strstr(read_legend(svg), "measured (no data)"));
    TEST_ASSERT_NOT_NULL(strstr(read_legend(svg), "empty (no data)"));
    assert_well_formed(svg);
}

static void test_figure_without_panels_is_well_formed(void)
{
    assert_well_formed(drawn());
}

static void test_figure_counts_series_it_cannot_hold(void)
{
    const double y[] = {0.0, 1.0};
    struct figure_panel *panel = figure_add_panel(&figure, "torque in Nm", axis_linear);
    for (int n = 0; n < figure_series_max + 3; n++) {
        char name[16];
        snprintf(name, sizeof name, "run %d", n);
        figure_add_line(panel, name, 2, NULL, y)->size = 1.0;
    }
    const char *svg = drawn();
    TEST_ASSERT_NOT_NULL(strstr(read_legend(svg), "and 3 more, not drawn"));
    TEST_ASSERT_EQUAL(figure_series_max, panel->count);
    assert_well_formed(svg);
}

static void test_figure_escapes_every_label(void)
{
    const double y[] = {0.0, 1.0};
    const char *const nasty = "</text><script>alert(\"1\")</script>&\xFF";
    const char *const names[] = {nasty, nasty};
    for (size_t with_categories = 0; with_categories < 2; with_categories++) {
        rewind(out);
        figure_start(&figure, nasty, axis_linear);
        if (with_categories) {
            figure_set_categories(&figure, 2, names);
        }
        struct figure_panel *panel = figure_add_panel(&figure, nasty, axis_linear);
        figure_add_line(panel, nasty, 2, NULL, y);
        figure_add_points(panel, nasty, 2, NULL, y)->marker = figure_cross;
        figure_add_band(panel, nasty, 2, NULL, y, y);
        figure_add_stems(panel, nasty, 2, NULL, y);
        figure_add_bars(panel, nasty, 2, NULL, y);
        figure_add_limit(panel, nasty, 0.5);
        figure_write(&figure, out);
        fputc('\0', out);
        assert_well_formed(written());
        TEST_ASSERT_NULL(strstr(text, "<script"));
    }
}

/* Eight shapes: what each draws, its place taken away, is drawn by no other. */
static void test_figure_markers_are_eight_shapes(void)
{
    const double zero = 0.0;
    char shapes[figure_triangle_down + 1][160];
    for (int marker = 0; marker <= (int)figure_triangle_down; marker++) {
        figure_start(&figure, "time in s", axis_linear);
        struct figure_panel *panel = figure_add_panel(&figure, "torque in Nm", axis_linear);
        figure_add_points(panel, "points", 1, &zero, &zero)->marker = (enum figure_marker)marker;
        const char *path = NULL; // the last one, in the legend of the figure drawn last
        for (const char *at = strstr(drawn(), "<path class=\"pt"); at; at = strstr(at + 1, "<path class=\"pt")) {
            path = at;
        }
        TEST_ASSERT_NOT_NULL(path);
        snprintf(shapes[marker], sizeof shapes[marker], "%.159s", path);
        *strchr(shapes[marker], '>') = '\0';
        for (int other = 0; other < marker; other++) {
            TEST_ASSERT_TRUE(strcmp(shapes[marker], shapes[other]) != 0);
        }
    }
}

static void test_figure_legend_shortens_what_does_not_fit(void)
{
    const double y[] = {0.0, 1.0};
    figure.legend = figure_legend_right;
    struct figure_panel *panel = figure_add_panel(&figure, "torque in Nm", axis_linear);
    figure_add_points(panel, "a_recording_with_a_name_that_goes_on_and_on_for_much_longer_than_any_legend_has_room.csv",
                      2, NULL, y);
    const char *svg = drawn();
    TEST_ASSERT_NOT_NULL(strstr(svg, "a_recording_with"));
    TEST_ASSERT_NOT_NULL(strstr(svg, "\xE2\x80\xA6"));
    TEST_ASSERT_NOT_NULL(strstr(svg, ".csv</text>"));
}

/* The second "on a line" has points: it needs a swatch of its own, which "on a line (no data)" is not. */
static void test_figure_legend_repeats_a_name_whose_first_has_a_remark(void)
{
    const double gap[] = {NAN, NAN}, y[] = {1.0, 2.0};
    for (int p = 0; p < 2; p++) {
        struct figure_panel *panel = figure_add_panel(&figure, "torque in Nm", axis_linear);
        figure_add_points(panel, "on a line", 2, NULL, p == 0 ? gap : y);
    }
    const char *svg = drawn();
    TEST_ASSERT_NOT_NULL(strstr(svg, ">on a line (no data)<"));
    TEST_ASSERT_NOT_NULL(strstr(svg, ">on a line<"));
}

static void test_figure_series_differ_by_more_than_colour(void)
{
    struct figure_panel *panel = figure_add_panel(&figure, "torque in Nm", axis_linear);
    struct figure_series *line[3], *points[3];
    for (int n = 0; n < 3; n++) {
        line[n] = figure_add_line(panel, "line", 0, NULL, NULL);
        points[n] = figure_add_points(panel, "points", 0, NULL, NULL);
        for (int m = 0; m < n; m++) {
            TEST_ASSERT_TRUE(line[n]->dash != line[m]->dash && line[n]->colour != line[m]->colour);
            TEST_ASSERT_TRUE(points[n]->marker != points[m]->marker && points[n]->colour != points[m]->colour);
        }
    }
}

static void test_figure_bars_stand_on_zero_with_their_values(void)
{
    const double y[] = {0.25, NAN, -0.5};
    static const char *const names[] = {"as given", "refitted", "extended"};
    figure_set_categories(&figure, 3, names);
    struct figure_panel *panel = figure_add_panel(&figure, "error", axis_linear);
    figure_add_bars(panel, "", 3, NULL, y);
    const char *svg = drawn();
    TEST_ASSERT_EQUAL(2, count_of(svg, "<rect"));
    TEST_ASSERT_NOT_NULL(strstr(svg, ">0.25</text>"));
    TEST_ASSERT_NOT_NULL(strstr(svg, ">\xE2\x88\x92"
                                     "0.5</text>"));
    double top, height, next_top;
    const char *bar = strstr(svg, "<rect");
    TEST_ASSERT_EQUAL(2, sscanf(bar, "<rect x=\"%*f\" y=\"%lf\" width=\"%*f\" height=\"%lf\"", &top, &height));
    TEST_ASSERT_EQUAL(1, sscanf(strstr(bar + 1, "<rect"), "<rect x=\"%*f\" y=\"%lf\"", &next_top));
    TEST_ASSERT_DOUBLE_WITHIN(0.11, next_top, top + height);
    TEST_ASSERT_EQUAL(3, count_of(svg, "class=\"tx\""));
}

static void write_full_page(struct page *page, const char *nasty)
{
    const double y[] = {0.0, 1.0};
    const char *const heads[] = {"parameter", nasty};
    const char *const row[] = {nasty, NULL};
    figure_add_line(figure_add_panel(&figure, "torque in Nm", axis_linear), nasty, 2, NULL, y);
    page_start(page, out, nasty, nasty);
    page_add_note(page, page_good, nasty, "%s", nasty);
    page_add_note(page, page_bad, "alone", NULL);
    page_add_section(page, nasty);
    page_add_subsection(page, nasty);
    page_add_paragraph(page, "%s %d", nasty, 42);
    page_start_pairs(page);
    page_add_pair(page, nasty, "%s", nasty);
    page_end_pairs(page);
    page_start_list(page);
    page_add_item(page, nasty, "%s", nasty);
    page_end_list(page);
    page_start_table(page, nasty, "lr", heads);
    page_add_row(page, row);
    page_end_table(page);
    page_start_row(page);
    page_add_figure(page, &figure, "%s", nasty);
    page_add_figure(page, &figure, "again");
    page_end_row(page);
    TEST_ASSERT_EQUAL(0, page_end(page, nasty));
}

static void test_page_is_well_formed_whatever_the_text(void)
{
    struct page page;
    write_full_page(&page, "<b>\"R&D\" 100 % 'x'</b>\xFE");
    assert_well_formed(written());
    TEST_ASSERT_NULL(strstr(text, "<b>\""));
    TEST_ASSERT_NOT_NULL(strstr(text, "&lt;b&gt;&quot;R&amp;D&quot; 100 % &#39;x&#39;&lt;/b&gt;\xEF\xBF\xBD 42"));
    TEST_ASSERT_NOT_NULL(strstr(text, "<b>Figure 2</b>"));
    TEST_ASSERT_NOT_NULL(strstr(text, "<b>Table 1</b>"));
}

static void test_page_loads_nothing_from_elsewhere(void)
{
    struct page page;
    write_full_page(&page, "plain");
    const char *all = written();
    TEST_ASSERT_NULL(strstr(all, " src="));
    TEST_ASSERT_NULL(strstr(all, " href="));
    TEST_ASSERT_NULL(strstr(all, "url("));
    TEST_ASSERT_NULL(strstr(all, "@import"));
    TEST_ASSERT_NOT_NULL(strstr(all, "prefers-color-scheme:dark"));
    TEST_ASSERT_NOT_NULL(strstr(all, "@media print"));
}

static void test_page_writes_long_paragraphs_whole(void)
{
    struct page page;
    static char words[5000];
    memset(words, 'w', sizeof words - 1);
    page_start(&page, out, "t", NULL);
    page_add_paragraph(&page, "%s.", words);
    TEST_ASSERT_EQUAL(0, page_end(&page, NULL));
    const char *paragraph = strstr(written(), "<p>w");
    TEST_ASSERT_NOT_NULL(paragraph);
    TEST_ASSERT_EQUAL(sizeof words - 1, strspn(paragraph + 3, "w"));
}

static void test_page_empty_table_and_list_say_so(void)
{
    struct page page;
    const char *const heads[] = {"parameter", "value"};
    page_start(&page, out, "t", NULL);
    page_start_table(&page, "Nothing", "lr", heads);
    page_end_table(&page);
    page_start_list(&page);
    page_end_list(&page);
    TEST_ASSERT_EQUAL(0, page_end(&page, NULL));
    TEST_ASSERT_NOT_NULL(strstr(written(), "colspan=\"2\">no data</td>"));
    TEST_ASSERT_NOT_NULL(strstr(text, ">none</li>"));
    assert_well_formed(text);
}

/* Buffered, the error shows when the page is flushed; unbuffered, it has been there since the first write. */
static void test_page_end_reports_a_full_disk(void)
{
    for (int unbuffered = 0; unbuffered < 2; unbuffered++) {
        FILE *full = fopen("/dev/full", "w");
        if (full == NULL) {
            TEST_IGNORE_MESSAGE("no /dev/full on this system");
        }
        static char buffer[1 << 16]; /* holds the whole page */
        setvbuf(full, unbuffered ? NULL : buffer, unbuffered ? _IONBF : _IOFBF, sizeof buffer);
        struct page page;
        page_start(&page, full, "t", NULL);
        TEST_ASSERT_EQUAL(-1, page_end(&page, NULL));
        fclose(full);
    }
}

/* Each span goes from its upper to its lower end; one that is not known is left out, one without end is cut off. */
static void test_figure_spans_reach_from_low_to_high(void)
{
    const double x[] = {0.0, 1.0, 2.0};
    const double low[] = {1.0, NAN, 3.0};
    const double high[] = {2.0, 2.0, INFINITY};
    struct figure_panel *panel = figure_add_panel(&figure, "value", axis_linear);
    panel->low = 0.0;
    panel->high = 4.0;
    figure_add_spans(panel, "", 3, x, low, high);
    const char *svg = drawn();
    const struct frame frame = read_frame(svg);
    read_path(svg, "sp");
    TEST_ASSERT_EQUAL(2, trace.moves);
    TEST_ASSERT_EQUAL(4, trace.count);
    const double expected[] = {2.0, 1.0, 4.0, 3.0};
    for (size_t n = 0; n < 4; n++)
        TEST_ASSERT_DOUBLE_WITHIN(2.0 * written_px, to_y(frame, expected[n]), trace.at[n].y);
    assert_inside(frame);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_page_checker_finds_bad_markup);
    RUN_TEST(test_figure_draws_values_where_the_axes_say);
    RUN_TEST(test_figure_clips_a_line_at_its_crossing);
    RUN_TEST(test_figure_clips_lines_that_pass_through_the_frame);
    RUN_TEST(test_figure_leaves_out_points_beyond_the_frame);
    RUN_TEST(test_figure_thinning_keeps_every_extreme);
    RUN_TEST(test_figure_thinning_spans_each_column);
    RUN_TEST(test_figure_draws_each_half_pixel_once);
    RUN_TEST(test_figure_breaks_lines_at_values_without_a_place);
    RUN_TEST(test_figure_holds_the_value_of_a_step_line);
    RUN_TEST(test_figure_treats_nonpositive_values_on_a_log_axis_as_gaps);
    RUN_TEST(test_figure_band_with_infinite_edge_reaches_the_frame);
    RUN_TEST(test_figure_band_cannot_flatten_the_data);
    RUN_TEST(test_figure_shows_near_limits_and_names_far_ones);
    RUN_TEST(test_figure_says_no_data_when_there_is_none);
    RUN_TEST(test_figure_without_panels_is_well_formed);
    RUN_TEST(test_figure_counts_series_it_cannot_hold);
    RUN_TEST(test_figure_escapes_every_label);
    RUN_TEST(test_figure_markers_are_eight_shapes);
    RUN_TEST(test_figure_legend_shortens_what_does_not_fit);
    RUN_TEST(test_figure_legend_repeats_a_name_whose_first_has_a_remark);
    RUN_TEST(test_figure_series_differ_by_more_than_colour);
    RUN_TEST(test_figure_bars_stand_on_zero_with_their_values);
    RUN_TEST(test_page_is_well_formed_whatever_the_text);
    RUN_TEST(test_page_loads_nothing_from_elsewhere);
    RUN_TEST(test_page_writes_long_paragraphs_whole);
    RUN_TEST(test_page_empty_table_and_list_say_so);
    RUN_TEST(test_page_end_reports_a_full_disk);
    RUN_TEST(test_figure_spans_reach_from_low_to_high);
    return UNITY_END();
}
