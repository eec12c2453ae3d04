/* SPDX-License-Identifier: MIT */
#include "lab/estimate/frf_lpm.h"

#include "lab/estimate/circle.h"
#include "lab/estimate/lpm_window.h"
#include "lab/estimate/method.h"
#include "lab/estimate/stretch.h"
#include "lab/numeric/cmplx.h"

#include <math.h>
#include <stdlib.h>

enum { orders_tried = 4, first_order = 2, order_step = 2, usual_dof = 9, fewest_auto_dof = 3 };

/// Neighbours on each side whose variances decide together on the order: one line's alone is too uncertain, and taking
/// the smaller of two uncertain variances would make it too small.
static const size_t order_neighbours = 12;
/// And their logarithms must fall by more than this together: less is chance, which would also pass for less noise.
static const double gain_by_chance = 1.0;

/// What one polynomial order gave, line by line.
struct attempt {
    int order;
    size_t half_width;
    double factor;    ///< 1 + leverage, away from the edges
    double *variance; ///< of the response; negative: the line has no power
    double complex *response;
};

struct lpm {
    const struct periodic *recording;
    struct stretch stretch;
    double complex *input; ///< spectra of the stretch
    double complex *output;
    size_t attempt_count;
    struct attempt attempts[orders_tried];
};

static size_t dof_of(const struct attempt *attempt)
{
    return 2 * attempt->half_width - ((size_t)attempt->order + 1);
}

/// Lines from 1 to `last` that no periodic signal reaches.
static size_t free_lines(const struct lpm *self, size_t last)
{
    return last - last / self->stretch.periods;
}

/// The nearest free lines around `centre`: half of them on each side, or what one side lacks on the other.
static void choose_offsets(const struct lpm *self, size_t centre, struct lpm_window *io_window)
{
    size_t top = (self->stretch.rows - 1) / 2;
    size_t half = io_window->lines / 2;
    size_t below = free_lines(self, centre);
    size_t above = free_lines(self, top) - below;
    size_t take_above = below < half ? io_window->lines - below : above < half ? above : half;
    long line = (long)centre;
    for (size_t i = 0; i < io_window->lines; i++) {
        bool upwards = i < take_above;
        line = i == take_above ? (long)centre : line;
        do {
            line += upwards ? 1 : -1;
        } while (line % (long)self->stretch.periods == 0);
        io_window->offsets[i] = line - (long)centre;
    }
}

static bool at_edge(const struct lpm *self, size_t centre, size_t half_width)
{
    size_t below = free_lines(self, centre);
    size_t above = free_lines(self, (self->stretch.rows - 1) / 2) - below;
    return below < half_width || above < half_width;
}

static void fit_line(const struct lpm *self, const struct lpm_window *window, size_t line, double complex *residuals,
                     struct attempt *io_attempt)
{
    size_t centre = self->recording->bins[line] * self->stretch.periods;
    double complex *output_residual = residuals + window->lines;
    double complex input = self->input[centre] - lpm_window_fit(window, self->input + centre, residuals);
    double complex output = self->output[centre] - lpm_window_fit(window, self->output + centre, output_residual);
    double complex response = output / input;
    double scatter = 0.0;
    double residual = 0.0;
    for (size_t i = 0; i < window->lines; i++) {
        scatter += cmplx_power(residuals[i]);
        residual += cmplx_power(output_residual[i] - response * residuals[i]);
    }
    size_t dof = dof_of(io_attempt);
    double factor = (1.0 + window->leverage) / (double)dof;
    /* A variance with q degrees of freedom takes the place of the scatter of q + 1 periods. */
    struct circle input_line = {dof + 1, input, scatter * factor * (double)(dof + 1)};
    bool powered = circle_chance_of_zero(&input_line) < estimate_chance_of_dead_line;
    io_attempt->response[line] = response;
    io_attempt->variance[line] = powered ? factor * residual / cmplx_power(input) : -1.0;
}

static bool make_attempt(const struct lpm *self, struct attempt *io_attempt)
{
    size_t count = self->recording->bin_count;
    size_t lines = 2 * io_attempt->half_width;
    struct lpm_window usual = {0};
    struct lpm_window edge = {0};
    double complex *residuals = malloc(2 * lines * sizeof *residuals);
    io_attempt->response = malloc(count * sizeof *io_attempt->response);
    io_attempt->variance = malloc(count * sizeof *io_attempt->variance);
    bool done = residuals && io_attempt->response && io_attempt->variance &&
                lpm_window_alloc(lines, io_attempt->order, &usual) && lpm_window_alloc(lines, io_attempt->order, &edge);
    bool prepared = false;
    for (size_t line = 0; line < count && done; line++) {
        size_t centre = self->recording->bins[line] * self->stretch.periods;
        bool special = at_edge(self, centre, io_attempt->half_width);
        struct lpm_window *window = special ? &edge : &usual;
        if (special || !prepared) {
            /* Everywhere but at the edges the distances are the same. */
            choose_offsets(self, centre, window);
            done = lpm_window_prepare(window);
            prepared = prepared || !special;
            io_attempt->factor = 1.0 + window->leverage;
        }
        if (done) {
            fit_line(self, window, line, residuals, io_attempt);
        }
    }
    free(residuals);
    lpm_window_free(&usual);
    lpm_window_free(&edge);
    return done;
}

/// Sum over the neighbouring lines that both orders have of the logarithm of how much smaller the later one's variance
/// is.
static double gain_of_next_order(const struct attempt *now, const struct attempt *next, size_t line, size_t count)
{
    size_t first = line > order_neighbours ? line - order_neighbours : 0;
    size_t last = line + order_neighbours < count ? line + order_neighbours : count - 1;
    double sum = 0.0;
    for (size_t i = first; i <= last; i++) {
        if (now->variance[i] > 0.0 && next->variance[i] > 0.0) {
            sum += log(now->variance[i] / next->variance[i]);
        }
    }
    return sum;
}

static size_t choose_attempt(const struct lpm *self, size_t line)
{
    size_t chosen = 0;
    while (chosen + 1 < self->attempt_count) {
        const struct attempt *now = &self->attempts[chosen];
        if (now->variance[line] >= 0.0 &&
            !(gain_of_next_order(now, now + 1, line, self->recording->bin_count) > gain_by_chance)) {
            break;
        }
        chosen++;
    }
    return chosen;
}

static bool set_range(struct frf *io_frf, const char *key, size_t lowest, size_t highest)
{
    return lowest == highest ? estimate_set_key(io_frf, key, "%zu", lowest)
                             : estimate_set_key(io_frf, key, "%zu..%zu", lowest, highest);
}

/// Takes each line from the order that suits it, and says which orders these were.
static int choose_lines(const struct lpm *self, struct frf *io_frf, struct error *out_error)
{
    size_t lowest = self->attempt_count - 1;
    size_t highest = 0;
    for (size_t line = 0; line < self->recording->bin_count; line++) {
        size_t chosen = choose_attempt(self, line);
        const struct attempt *attempt = &self->attempts[chosen];
        if (attempt->variance[line] >= 0.0) {
            estimate_set_line(io_frf, line, attempt->response[line], sqrt(attempt->variance[line]));
            lowest = chosen < lowest ? chosen : lowest;
            highest = chosen > highest ? chosen : highest;
        }
    }
    lowest = lowest < highest ? lowest : highest;
    const struct attempt *from = &self->attempts[lowest];
    const struct attempt *to = &self->attempts[highest];
    size_t fewest = dof_of(to) < dof_of(from) ? dof_of(to) : dof_of(from);
    io_frf->degrees_of_freedom = 2.0 * (double)fewest;
    io_frf->periods = self->stretch.periods;
    bool set = set_range(io_frf, "lpm_order", (size_t)from->order, (size_t)to->order) &&
               set_range(io_frf, "lpm_half_width", from->half_width, to->half_width) &&
               estimate_set_key(io_frf, "lpm_variance_factor", "%.6g", to->factor);
    return set ? estimate_end(self->recording, io_frf, out_error) : estimate_refuse_memory(io_frf, out_error);
}

static size_t usual_half_width(int order)
{
    return ((size_t)order + 2 + usual_dof) / 2;
}

/// Fills in which orders to try.
static int plan_attempts(const struct estimate_options *options, struct lpm *io_self, struct error *out_error)
{
    const char *path = io_self->recording->run->path;
    bool automatic = options->order < 0;
    size_t free_of_excitation = free_lines(io_self, (io_self->stretch.rows - 1) / 2);
    int order = automatic ? first_order : options->order;
    size_t half_width = options->half_width ? options->half_width : usual_half_width(order);
    if (order > estimate_order_max || !(2 * half_width > (size_t)order + 1)) {
        return error_set(out_error, error_refused,
                         "%s: order %d with %zu lines on each side: expected an order from 0 to %d and fewer unknowns "
                         "(order + 1) than lines, so that some are left for the variance",
                         path, order, half_width, estimate_order_max);
    }
    if (2 * half_width > free_of_excitation) {
        return error_set(out_error, error_refused,
                         "%s: method lpm needs %zu lines between the excited ones, %zu periods of %zu samples have "
                         "%zu: expected more periods, a smaller --half-width, or --method mean",
                         path, 2 * half_width, io_self->stretch.periods, io_self->recording->period_samples,
                         free_of_excitation);
    }
    io_self->attempts[io_self->attempt_count++] = (struct attempt){.order = order, .half_width = half_width};
    while (automatic && io_self->attempt_count < orders_tried) {
        order += order_step;
        half_width = options->half_width ? options->half_width : usual_half_width(order);
        if (2 * half_width > free_of_excitation || 2 * half_width < (size_t)order + 1 + fewest_auto_dof) {
            break;
        }
        io_self->attempts[io_self->attempt_count++] = (struct attempt){.order = order, .half_width = half_width};
    }
    return 0;
}

static bool transform_and_fit(struct lpm *io_self)
{
    size_t lines = io_self->stretch.rows / 2 + 1;
    io_self->input = malloc(2 * lines * sizeof *io_self->input);
    if (!io_self->input) {
        return false;
    }
    io_self->output = io_self->input + lines;
    size_t reach = io_self->attempts[io_self->attempt_count - 1].half_width;
    bool done = stretch_transform_near(io_self->recording, &io_self->stretch, reach, io_self->input, io_self->output);
    for (size_t a = 0; a < io_self->attempt_count && done; a++) {
        done = make_attempt(io_self, &io_self->attempts[a]);
    }
    return done;
}

static void free_lpm(struct lpm *self)
{
    for (size_t a = 0; a < self->attempt_count; a++) {
        free(self->attempts[a].response);
        free(self->attempts[a].variance);
    }
    free(self->input);
}

int frf_lpm_estimate(const struct periodic *recording, const struct estimate_options *options, struct frf *out_frf,
                     struct error *out_error)
{
    static const struct estimate_options defaults = {.order = estimate_order_auto};
    struct lpm self = {.recording = recording, .stretch = stretch_longest(recording)};
    if (self.stretch.periods < 2) {
        return error_set(out_error, error_refused,
                         "%s: the longest stretch without a gap has %zu periods: method lpm needs 2, use --method mean",
                         recording->run->path, self.stretch.periods);
    }
    int status = plan_attempts(options ? options : &defaults, &self, out_error);
    status = status ? status : estimate_begin(recording, "lpm", 0.0, out_frf, out_error);
    if (status) {
        return status;
    }
    status =
        transform_and_fit(&self) ? choose_lines(&self, out_frf, out_error) : estimate_refuse_memory(out_frf, out_error);
    free_lpm(&self);
    return status;
}
