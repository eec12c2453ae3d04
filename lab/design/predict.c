/* SPDX-License-Identifier: MIT */
#include "lab/design/predict.h"

#include "sim/belt_drive.h"

#include <complex.h>
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double two_pi = 6.283185307179586476925;
/// Rates that differ by less than this share are the same fraction, written differently.
static const double same_rate = 1e-9;
/// Settled: a period repeats the one before it to this share of its peak.
static const double settled_share = 1e-7;
/// A pulse has died away when the last N samples added less than this share to every line's sum.
static const double died_share = 1e-3;
/// What moves by less than this share of the most so far does not move.
static const double nothing_share = 1e-9;
/// Two places of the period tell the same: nothing depends on the place.
static const double same_share = 1e-3;
/// Least pulse, as a share of the signal's peak: smaller ones drown in rounding.
static const double pulse_share_min = 1e-6;

enum {
    settle_periods_max = 60,
    pulse_periods_max = 60,
    pulse_places = 8,
};

enum { window_one, window_two, window_count };

/// White noise that moves the axis.
enum source { source_process, source_velocity, source_position, source_count };

/// The simulated drive without noise, playing the table over and over.
struct player {
    const struct design_result *table;
    bool torque_mode;
    double velocity_feedforward;
    struct sim_belt_drive drive;
    size_t sample; ///< since the start
};

struct prediction {
    const struct sim_model *model; ///< as given
    struct sim_model quiet;        ///< without noise; velocity feed-forward 1, so that a command can carry sensor noise
    const struct design_result *table;
    const struct design_predict_plan *plan;
    size_t period, lines;
    double std[source_count];
    double filter;         ///< share of a new velocity that the sensor's filter lets through at once, 1: no filter
    double *twiddle;       ///< cos and -sin of one turn, 2 period
    double complex *input; ///< U
    double complex *response;
    struct player settled;
    double peak[source_count]; ///< of torque, velocity, position in the settled period
    double *series;            ///< 2 period: torque and velocity of one period
};

static void start(const struct prediction *self, struct player *out_player)
{
    *out_player = (struct player){
        .table = self->table,
        .torque_mode = self->plan->torque_mode,
        .velocity_feedforward = self->model->controller.velocity_feedforward,
    };
    sim_belt_drive_init(&out_player->drive, &self->quiet, 0);
}

/// Takes the next sample; the controllers see velocity and position off by what is given.
static void play(struct player *self, double velocity_error, double position_error, struct sim_sample *out_sample)
{
    const struct design_result *table = self->table;
    const size_t n = (table->start_index + self->sample) % table->period_samples;
    const double travelled = table->travel_per_period_rad * (double)self->sample / (double)table->period_samples;
    const struct sim_command command = {
        .control = self->torque_mode ? sim_control_torque : sim_control_cascade,
        .position = table->position_rad[n] + travelled - position_error,
        .velocity = self->velocity_feedforward * table->velocity_rad_per_s[n] - velocity_error,
        .torque = table->torque_Nm[n],
    };
    sim_belt_drive_step(&self->drive, &command, out_sample);
    self->sample++;
}

/// The same with a torque on the motor during the sample: the plant's step is taken again with it.
static void play_with_torque(struct player *self, double torque, struct sim_sample *out_sample)
{
    struct sim_plant plant = self->drive.plant;
    struct sim_actuator actuator = self->drive.actuator;
    const struct sim_stepper *stepper = &self->drive.stepper;
    play(self, 0, 0, out_sample);
    sim_actuator_hold(&actuator, out_sample->torque_ref);
    for (size_t i = 0; i < sim_substeps; i++) {
        sim_plant_drive(&plant, stepper, &actuator, i, torque);
    }
    self->drive.plant = plant;
}

/// One period into self->series; how far its velocity is from the period before, as a share of its peak.
static double play_period(struct prediction *self, struct player *player)
{
    double *torque = self->series;
    double *velocity = self->series + self->period;
    double change = 0;
    double peak[source_count] = {0};
    for (size_t n = 0; n < self->period; n++) {
        struct sim_sample sample;
        play(player, 0, 0, &sample);
        change = fmax(change, fabs(sample.velocity - velocity[n]));
        torque[n] = sample.torque;
        velocity[n] = sample.velocity;
        peak[source_process] = fmax(peak[source_process], fabs(sample.torque));
        peak[source_velocity] = fmax(peak[source_velocity], fabs(sample.velocity));
        peak[source_position] = fmax(peak[source_position], fabs(sample.position));
    }
    memcpy(self->peak, peak, sizeof peak);
    return change / fmax(peak[source_velocity], DBL_MIN);
}

static double complex transform(const struct prediction *self, const double *series, uint32_t bin)
{
    double complex sum = 0;
    size_t index = 0;
    for (size_t n = 0; n < self->period; n++) {
        sum += series[n] * (self->twiddle[2 * index] + I * self->twiddle[2 * index + 1]);
        index = (index + bin) % self->period;
    }
    return sum;
}

static int settle(struct prediction *self, struct error *out_error)
{
    struct player *player = &self->settled;
    start(self, player);
    play_period(self, player);
    for (size_t p = 0; p < settle_periods_max && play_period(self, player) > settled_share; p++) {
    }
    if (player->drive.hit_end_stop) {
        return error_set(out_error, error_refused,
                         "predicted deviation: the model hits an end stop at %g under this table",
                         player->drive.plant.position);
    }
    for (size_t k = 0; k < self->lines; k++) {
        const uint32_t bin = self->table->bins[k];
        self->input[k] = transform(self, self->series, bin);
        self->response[k] = transform(self, self->series + self->period, bin) / self->input[k];
        if (!(cabs(self->input[k]) > 0) || !isfinite(cabs(self->response[k]))) {
            return error_set(out_error, error_refused,
                             "predicted deviation: the model's torque on bin %u is %g, its velocity over it %g: "
                             "expected finite numbers above 0",
                             bin, cabs(self->input[k]), cabs(self->response[k]));
        }
    }
    return 0;
}

/// Transforms of velocity minus G times torque over windows that slide over the response to a pulse.
struct window {
    size_t *index;   ///< of each line's twiddle
    double *content; ///< of each line, real and imaginary part
    double *sum;     ///< of |content|^2 over all windows
    double *last;    ///< the same at the end of the period before
    size_t idle;     ///< samples not yet in these, because next to nothing came in or went out
    double largest_velocity, largest_torque;
};

/// Windows of one and of two periods: from the second follows what neighbouring periods have in common.
struct windows {
    double *past; ///< the last two periods of velocity and torque, 4 period
    struct window of[window_count];
};

static void windows_free(struct windows *self)
{
    free(self->past);
    for (size_t w = 0; w < window_count; w++) {
        free(self->of[w].index);
        free(self->of[w].content);
        free(self->of[w].sum);
        free(self->of[w].last);
    }
}

static bool windows_create(const struct prediction *prediction, struct windows *out_windows)
{
    const size_t lines = prediction->lines;
    bool complete = true;
    out_windows->past = malloc(2 * (size_t)window_count * prediction->period * sizeof(double));
    for (size_t w = 0; w < window_count; w++) {
        struct window *window = &out_windows->of[w];
        window->index = malloc(lines * sizeof *window->index);
        window->content = malloc(2 * lines * sizeof *window->content);
        window->sum = malloc(lines * sizeof *window->sum);
        window->last = malloc(lines * sizeof *window->last);
        complete = complete && window->index && window->content && window->sum && window->last;
    }
    if (complete && out_windows->past) {
        return true;
    }
    windows_free(out_windows);
    return false;
}

static void windows_clear(const struct prediction *prediction, struct windows *self)
{
    memset(self->past, 0, 2 * (size_t)window_count * prediction->period * sizeof *self->past);
    for (size_t w = 0; w < window_count; w++) {
        struct window *window = &self->of[w];
        memset(window->index, 0, prediction->lines * sizeof *window->index);
        memset(window->content, 0, 2 * prediction->lines * sizeof *window->content);
        memset(window->sum, 0, prediction->lines * sizeof *window->sum);
        memset(window->last, 0, prediction->lines * sizeof *window->last);
        window->idle = 0;
        window->largest_velocity = window->largest_torque = 0;
    }
}

/// Catches up with the windows in which nothing has changed.
static void window_catch_up(const struct prediction *prediction, struct window *self)
{
    for (size_t k = 0; k < prediction->lines && self->idle > 0; k++) {
        const double *content = self->content + 2 * k;
        self->sum[k] += (double)self->idle * (content[0] * content[0] + content[1] * content[1]);
        self->index[k] = (self->index[k] + self->idle * prediction->table->bins[k]) % prediction->period;
    }
    self->idle = 0;
}

/// One sample enters, the one a whole number of periods before leaves: both with the same twiddle. Real arithmetic: the
/// complex product of C would look for infinities each time.
static void window_slide(const struct prediction *prediction, struct window *self, double velocity, double torque)
{
    self->largest_velocity = fmax(self->largest_velocity, fabs(velocity));
    self->largest_torque = fmax(self->largest_torque, fabs(torque));
    if (fabs(velocity) <= nothing_share * self->largest_velocity &&
        fabs(torque) <= nothing_share * self->largest_torque) {
        self->idle++;
        return;
    }
    window_catch_up(prediction, self);
    for (size_t k = 0; k < prediction->lines; k++) {
        const double *turn = prediction->twiddle + 2 * self->index[k];
        double *content = self->content + 2 * k;
        const double real = velocity - creal(prediction->response[k]) * torque;
        const double imaginary = -cimag(prediction->response[k]) * torque;
        content[0] += real * turn[0] - imaginary * turn[1];
        content[1] += real * turn[1] + imaginary * turn[0];
        self->sum[k] += content[0] * content[0] + content[1] * content[1];
        self->index[k] += prediction->table->bins[k];
        self->index[k] -= self->index[k] >= prediction->period ? prediction->period : 0;
    }
}

static void windows_slide(const struct prediction *prediction, struct windows *self, size_t n, double velocity,
                          double torque)
{
    const size_t period = prediction->period;
    const size_t room = (size_t)window_count * period;
    double *now = self->past + 2 * (n % room);
    const double *period_ago = self->past + 2 * ((n + room - period) % room);
    const double oldest[2] = {now[0], now[1]};
    now[0] = velocity;
    now[1] = torque;
    window_slide(prediction, &self->of[window_one], velocity - period_ago[0], torque - period_ago[1]);
    window_slide(prediction, &self->of[window_two], velocity - oldest[0], torque - oldest[1]);
}

/// Whether the period just over has added next to nothing.
static bool windows_are_over(const struct prediction *prediction, struct windows *self)
{
    bool over = true;
    for (size_t w = 0; w < window_count; w++) {
        struct window *window = &self->of[w];
        window_catch_up(prediction, window);
        for (size_t k = 0; k < prediction->lines; k++) {
            over = over && window->sum[k] - window->last[k] <= died_share * window->sum[k];
            window->last[k] = window->sum[k];
        }
    }
    return over;
}

/// Fills in the windows' sums for a pulse of one standard deviation at `from`.
static void follow_pulse(const struct prediction *self, enum source source, const struct player *from,
                         struct windows *windows)
{
    struct player still = *from;
    struct player moved = *from;
    const double pulse = fmax(self->std[source], pulse_share_min * self->peak[source]);
    const double scale = self->std[source] / pulse;
    double seen = source == source_velocity ? pulse * self->filter : 0; // of the pulse, in the velocity signal
    windows_clear(self, windows);
    for (size_t n = 0; n < (size_t)pulse_periods_max * self->period; n++) {
        struct sim_sample a;
        struct sim_sample b;
        play(&still, 0, 0, &a);
        if (n == 0 && source == source_process) {
            play_with_torque(&moved, pulse, &b);
        } else {
            play(&moved, seen, n == 0 && source == source_position ? pulse : 0, &b);
        }
        windows_slide(self, windows, n, scale * (b.velocity + seen - a.velocity), scale * (b.torque - a.torque));
        seen *= 1 - self->filter;
        if ((n + 1) % self->period == 0 && windows_are_over(self, windows)) {
            return;
        }
    }
}

/// What the scatter of M periods around their mean is expected to be. Neighbours have R_1 in common, periods further
/// apart next to nothing, and E |E_p + E_(p+1)|^2 = 2 R_0 + 2 R_1:
///     E 1/(M - 1) sum |E_p - mean|^2 = R_0 - 2 R_1 / M
static double expected_scatter(const struct prediction *self, const struct windows *windows, size_t line)
{
    const double one = windows->of[window_one].sum[line];
    const double common = windows->of[window_two].sum[line] / 2 - one;
    return self->plan->periods > 1 ? one - 2 * common / (double)self->plan->periods : one;
}

/// Adds a source's expected scatter. Where the response to a pulse depends on the place in the period (dry friction),
/// the mean over several places.
static int add_source(const struct prediction *self, enum source source, double *io_variance, struct error *out_error)
{
    struct windows windows;
    double *sum = calloc(self->lines, sizeof *sum);
    if (!sum || !windows_create(self, &windows)) {
        free(sum);
        return error_set(out_error, error_refused, "memory is short for the predicted deviation");
    }
    struct player at = self->settled;
    size_t places = 0;
    for (bool same = false; places < pulse_places && !same; places++) {
        follow_pulse(self, source, &at, &windows);
        same = places == 1;
        for (size_t k = 0; k < self->lines; k++) {
            const double scatter = expected_scatter(self, &windows, k);
            same = same && fabs(scatter - sum[k]) <= same_share * sum[k];
            sum[k] += scatter;
        }
        struct sim_sample skipped;
        for (size_t n = 0; n < self->period / pulse_places; n++) {
            play(&at, 0, 0, &skipped);
        }
    }
    for (size_t k = 0; k < self->lines; k++) {
        io_variance[k] += sum[k] / (double)places;
    }
    windows_free(&windows);
    free(sum);
    return 0;
}

static int fill_std(const struct prediction *self, double *out_std, struct error *out_error)
{
    const double torque_noise = self->model->sensors.torque_noise_Nm;
    memset(out_std, 0, self->lines * sizeof *out_std);
    for (int source = 0; source < source_count; source++) {
        // In open loop nobody listens to the position.
        const bool heard = source != source_position || !self->plan->torque_mode;
        if (self->std[source] > 0 && heard) {
            int status = add_source(self, (enum source)source, out_std, out_error);
            if (status) {
                return status;
            }
        }
    }
    for (size_t k = 0; k < self->lines; k++) {
        const double through = cabs(self->response[k]) * torque_noise;
        const double variance = out_std[k] + (double)self->period * through * through;
        out_std[k] = sqrt(variance / (double)self->plan->periods) / cabs(self->input[k]);
    }
    return 0;
}

static void list_noise(struct prediction *self)
{
    const struct sim_sensors *sensors = &self->model->sensors;
    double count = sensors->counts_per_rev > 0 ? 1 / sensors->counts_per_rev : 0;
    count *= self->model->linear ? 1 : two_pi;
    self->std[source_process] = self->model->process_noise_Nm;
    self->std[source_velocity] = sensors->velocity_noise_rad_per_s;
    self->std[source_position] = sqrt(sensors->position_noise_rad * sensors->position_noise_rad + count * count / 12);
    self->filter =
        sensors->velocity_filter_s > 0 ? -expm1(-1 / (self->model->sample_rate_hz * sensors->velocity_filter_s)) : 1;
    self->quiet = *self->model;
    self->quiet.process_noise_Nm = 0;
    self->quiet.controller.velocity_feedforward = 1;
    self->quiet.sensors = (struct sim_sensors){.velocity_filter_s = sensors->velocity_filter_s};
}

static int check_model(const struct sim_model *model, const struct design_request *request,
                       const struct design_predict_plan *plan, struct error *out_error)
{
    char text[160];
    const double rate_hz = (double)request->rate_num_hz / request->rate_den;
    const char *wrong = sim_model_check(model, text, sizeof text);
    if (plan->periods == 0) {
        return error_set(out_error, error_usage, "predicted deviation: 0 periods, expected at least 1");
    }
    if (wrong) {
        return error_set(out_error, error_refused, "predicted deviation: model: %s", wrong);
    }
    if (!(fabs(model->sample_rate_hz - rate_hz) <= same_rate * rate_hz)) {
        return error_set(out_error, error_refused,
                         "predicted deviation: the model's sample_rate_hz is %.9g, the table's rate %.9g Hz: expected "
                         "the same",
                         model->sample_rate_hz, rate_hz);
    }
    if (model->linear != request->linear) {
        return error_set(out_error, error_refused,
                         "predicted deviation: the model is of a %s axis, the table of a %s one: expected one kind",
                         model->linear ? "linear" : "rotary", request->linear ? "linear" : "rotary");
    }
    return 0;
}

static bool prediction_create(const struct sim_model *model, const struct design_result *result,
                              const struct design_predict_plan *plan, struct prediction *out_prediction)
{
    struct prediction *self = out_prediction;
    self->model = model;
    self->table = result;
    self->plan = plan;
    self->period = result->period_samples;
    self->lines = result->bin_count;
    self->twiddle = malloc(2 * self->period * sizeof *self->twiddle);
    self->series = calloc(2 * self->period, sizeof *self->series);
    self->input = malloc(self->lines * sizeof *self->input);
    self->response = malloc(self->lines * sizeof *self->response);
    if (!self->twiddle || !self->series || !self->input || !self->response) {
        return false;
    }
    for (size_t n = 0; n < self->period; n++) {
        self->twiddle[2 * n] = cos(two_pi * (double)n / (double)self->period);
        self->twiddle[2 * n + 1] = -sin(two_pi * (double)n / (double)self->period);
    }
    list_noise(self);
    return true;
}

static void prediction_free(struct prediction *self)
{
    if (self) {
        free(self->twiddle);
        free(self->series);
        free(self->input);
        free(self->response);
        free(self);
    }
}

int design_predict_std(const struct sim_model *model, const struct design_request *request,
                       const struct design_result *result, const struct design_predict_plan *plan, double *out_std,
                       struct error *out_error)
{
    int status = check_model(model, request, plan, out_error);
    if (status) {
        return status;
    }
    struct prediction *prediction = calloc(1, sizeof *prediction);
    if (!prediction || !prediction_create(model, result, plan, prediction)) {
        status = error_set(out_error, error_refused, "memory is short for the predicted deviation");
    }
    status = status ? status : settle(prediction, out_error);
    status = status ? status : fill_std(prediction, out_std, out_error);
    prediction_free(prediction);
    return status;
}
