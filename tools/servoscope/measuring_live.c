/* SPDX-License-Identifier: MIT */
#define _DEFAULT_SOURCE // nice()
#include "tools/servoscope/measuring_live.h"

#include "lab/measure/amplitudes.h"
#include "lab/measure/table_value.h"
#include "ports/wall_clock.h"

#include <errno.h>
#include <math.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <time.h>
#include <unistd.h>

static const double first_shown_s = 1.0;
static const double renewed_s = 0.5;
enum { stack_bytes = 1 << 18, bands_max = 9, bar_width = 24, below_the_loop = 10 };
enum { room_for_echo = 3 }; ///< what a terminal writes of Ctrl-C behind the cursor

/// What one look puts on the screen.
struct screen {
    size_t columns, rows;
    size_t count;
    char line[measuring_live_lines_max][measuring_live_width_max];
};

#if defined(__GNUC__)
__attribute__((format(printf, 2, 3)))
#endif
static void
add_line(struct screen *io_screen, const char *format, ...)
{
    if (io_screen->count == measuring_live_lines_max) {
        return;
    }
    char *line = io_screen->line[io_screen->count++];
    va_list values;
    va_start(values, format);
    vsnprintf(line, measuring_live_width_max, format, values);
    va_end(values);
    const size_t longest = io_screen->columns - room_for_echo;
    if (strlen(line) > longest) {
        line[longest] = '\0'; // a line that wraps could not be counted back
    }
}

static void draw_bar(double share, char out_text[bar_width + 1])
{
    const double filled = floor(fmin(fmax(share, 0.0), 1.0) * bar_width);
    for (int i = 0; i < bar_width; i++) {
        out_text[i] = i < filled ? '#' : '.';
    }
    out_text[bar_width] = '\0';
}

static void add_progress(const struct measuring_live *self, struct screen *io_screen)
{
    const struct measuring_live_place *place = &self->place;
    const double here = (double)atomic_load_explicit(&self->feed.done, memory_order_relaxed);
    const double total_here = (double)atomic_load_explicit(&self->feed.total, memory_order_relaxed);
    const double done = (double)place->samples_before + here;
    const double total = fmax(place->samples_planned > 0 ? (double)place->samples_planned : total_here, done);
    const double elapsed_s = wall_clock_now_s() - self->started_s;
    const double rate = done / elapsed_s;
    char bar[bar_width + 1], segment[64] = "", left[32] = "";
    draw_bar(total > 0.0 ? done / total : 0.0, bar);
    if (place->segments > 0) {
        snprintf(segment, sizeof segment, ", segment %zu of %zu", place->segment, place->segments);
    }
    if (rate > 0.0) {
        snprintf(left, sizeof left, ", %.0f s left", (total - done) / rate);
    }
    add_line(io_screen, "[%s] %5.1f %%  %.0f samples/s%s%s", bar, total > 0.0 ? 100.0 * done / total : 0.0, rate, left,
             segment);
}

static void add_peak(const struct measuring_live *self, enum msgen_channel channel, const char *name, const char *unit,
                     double peak, double used, struct screen *io_screen)
{
    char table[48] = "", limit[48] = ", no limit";
    const bool drifts = channel == msgen_channel_position && self->table->travel_q30 != 0;
    if (channel < self->table->channels && !drifts) {
        snprintf(table, sizeof table, ", table %.3g", self->table_peak[channel]);
    }
    if (used >= 0.0) {
        snprintf(limit, sizeof limit, ", %.0f %% of the limit", 100.0 * used);
    }
    add_line(io_screen, "  %-9s peak %.3g %s%s%s", name, peak, unit, table, limit);
}

/// Negative without a limit.
static double share_of(double peak, double limit)
{
    return limit < CORE_REAL_MAX ? peak / limit : -1.0;
}

static void add_peaks(const struct measuring_live *self, struct screen *io_screen)
{
    const struct guard_real_limits *limits = self->limits;
    const bool linear = self->table->linear;
    const double torque = (double)atomic_load_explicit(&self->feed.torque_peak_Nm, memory_order_relaxed);
    const double speed = (double)atomic_load_explicit(&self->feed.velocity_peak_rad_per_s, memory_order_relaxed);
    const double low = (double)atomic_load_explicit(&self->feed.position_low_rad, memory_order_relaxed);
    const double high = (double)atomic_load_explicit(&self->feed.position_high_rad, memory_order_relaxed);
    const double travel = limits->position_max_rad < CORE_REAL_MAX
                              ? fmax(high / limits->position_max_rad, low / limits->position_min_rad)
                              : -1.0;
    add_peak(self, msgen_channel_torque, linear ? "force" : "torque", linear ? "N" : "Nm", torque,
             share_of(torque, limits->torque_max_Nm), io_screen);
    add_peak(self, msgen_channel_velocity, "speed", linear ? "m/s" : "rad/s", speed,
             share_of(speed, limits->velocity_max_rad_per_s), io_screen);
    add_peak(self, msgen_channel_position, "position", linear ? "m" : "rad", fmax(high, -low), travel, io_screen);
}

static void add_samples(const struct measuring_live *self, struct screen *io_screen)
{
    const size_t rows = atomic_load_explicit(&self->feed.rows, memory_order_relaxed);
    const size_t lost = atomic_load_explicit(&self->feed.lost, memory_order_relaxed);
    const unsigned late = atomic_load_explicit(&self->feed.late, memory_order_relaxed);
    add_line(io_screen, "  samples   %zu kept, %zu lost, %u late", rows, lost, late);
}

/// Sums of squares over the lines of each band; bands as wide as it takes to have at most bands_max.
struct bands {
    size_t count;
    double low_hz[bands_max], torque[bands_max], velocity[bands_max];
};

static void sum_bands(const struct measuring_live *self, struct bands *out)
{
    const struct msgen_table *table = self->table;
    const double bin_hz = table_value_rate_hz(table) / (double)table->period_samples;
    const double first = (double)msgen_table_bin(table, 0);
    const double octaves = log2((double)msgen_table_bin(table, table->bin_count - 1) / first);
    const double width = fmax(1.0, ceil((octaves + 1e-9) / bands_max));
    *out = (struct bands){.count = (size_t)fmin(floor(octaves / width) + 1.0, bands_max)};
    for (size_t b = 0; b < out->count; b++) {
        out->low_hz[b] = bin_hz * first * exp2(width * (double)b);
    }
    for (uint32_t i = 0; i < table->bin_count; i++) {
        const double place = log2((double)msgen_table_bin(table, i) / first) / width;
        const size_t b = (size_t)fmin(place, (double)(out->count - 1));
        out->torque[b] += self->amplitude[0][i] * self->amplitude[0][i];
        out->velocity[b] += self->amplitude[1][i] * self->amplitude[1][i];
    }
}

static void add_response(struct measuring_live *self, struct screen *io_screen)
{
    const size_t length = self->feed.period_samples;
    const size_t last = atomic_load_explicit(&self->feed.last_whole, memory_order_relaxed);
    struct bands bands;
    char heads[measuring_live_width_max] = "", values[measuring_live_width_max] = "";
    if (last != self->shown_period) {
        const size_t read = measure_live_read_period(&self->feed, self->memory, self->memory + length);
        if (read > 0) {
            measure_find_amplitudes(self->plan, self->table, self->memory, self->memory + 2 * length, self->amplitude);
            self->shown_period = read;
        }
    }
    if (self->shown_period == 0) {
        return;
    }
    sum_bands(self, &bands);
    for (size_t b = 0; b < bands.count; b++) {
        snprintf(heads + 8 * b, sizeof heads - 8 * b, "%8.3g", bands.low_hz[b]);
        if (bands.torque[b] > 0.0 && bands.velocity[b] > 0.0) {
            snprintf(values + 8 * b, sizeof values - 8 * b, "%8.1f", 10.0 * log10(bands.velocity[b] / bands.torque[b]));
        } else {
            snprintf(values + 8 * b, sizeof values - 8 * b, "%8s", "-");
        }
    }
    add_line(io_screen, "  speed over %s in period %zu, at the lines from ... Hz on, in dB of 1 %s",
             self->table->linear ? "force" : "torque", self->shown_period, self->table->linear ? "m/s/N" : "rad/s/Nm");
    add_line(io_screen, "  Hz%s", heads);
    add_line(io_screen, "  dB%s", values);
}

/// One write, so that a frame is never seen in halves; what does not go out is not tried again.
static void send(const char *text, size_t length)
{
    while (length > 0) {
        const ssize_t sent = write(STDERR_FILENO, text, length);
        if (sent <= 0 && errno != EINTR) {
            return;
        }
        if (sent > 0) {
            text += sent;
            length -= (size_t)sent;
        }
    }
}

/// To the beginning of what was drawn before, also where a narrower window has folded its lines since.
static size_t write_return(struct measuring_live *self, size_t columns, size_t size, char *out_text)
{
    size_t up = 0;
    for (size_t i = 0; i < self->line_count; i++) {
        up += self->line_length[i] > columns ? (self->line_length[i] - 1) / columns : 0;
        up += i > 0;
    }
    const int used = up > 0 ? snprintf(out_text, size, "\r\033[%zuA", up) : snprintf(out_text, size, "\r");
    return (size_t)used;
}

static void read_window(struct screen *out)
{
    struct winsize window;
    const char *kind = getenv("TERM");
    const bool sized = ioctl(STDERR_FILENO, TIOCGWINSZ, &window) == 0 && window.ws_col > 0 && window.ws_row > 0;
    out->columns = sized ? window.ws_col : 80;
    out->rows = sized ? window.ws_row : 24;
    out->rows = !kind || strcmp(kind, "dumb") == 0 ? 1 : out->rows;
    out->columns = out->columns < 20 ? 20 : out->columns;
}

/// One line without any escape sequence, for terminals that know none and windows that are too low.
static size_t write_line(struct measuring_live *self, const struct screen *screen, size_t size, char *out_text)
{
    const int width = (int)fmin((double)screen->columns - 1.0, measuring_live_width_max - 1.0);
    self->line_count = 1;
    self->line_length[0] = (size_t)width;
    return (size_t)snprintf(out_text, size, "\r%-*s\r%s", width, "", screen->line[0]);
}

static size_t write_lines(struct measuring_live *self, const struct screen *screen, size_t size, char *out_text)
{
    size_t used = 0;
    self->line_count = screen->count;
    for (size_t i = 0; i < screen->count; i++) {
        self->line_length[i] = strlen(screen->line[i]);
        used += (size_t)snprintf(out_text + used, size - used, "%s%s\033[K", i > 0 ? "\r\n" : "", screen->line[i]);
    }
    return used;
}

static void draw(struct measuring_live *self)
{
    struct screen screen = {0};
    char text[measuring_live_lines_max * (measuring_live_width_max + 8) + 64];
    read_window(&screen);
    add_progress(self, &screen);
    add_peaks(self, &screen);
    add_samples(self, &screen);
    add_response(self, &screen);
    const bool low = screen.count > screen.rows;
    size_t used = 0;
    if (self->line_count > 1) {
        used = write_return(self, screen.columns, sizeof text, text);
        used += (size_t)snprintf(text + used, sizeof text - used, "%s", low ? "\033[J" : "");
    }
    used += (size_t)snprintf(text + used, sizeof text - used, "\r");
    used += (low ? write_line : write_lines)(self, &screen, sizeof text - used, text + used);
    send(text, used);
}

static void erase(struct measuring_live *self)
{
    struct screen screen = {0};
    char text[2 * measuring_live_width_max + 64];
    size_t used = 0;
    read_window(&screen);
    if (self->line_count > 1) {
        used = write_return(self, screen.columns, sizeof text, text);
        used += (size_t)snprintf(text + used, sizeof text - used, "\033[J");
    } else if (self->line_count == 1) {
        used = write_line(self, &screen, sizeof text, text);
        used += (size_t)snprintf(text + used, sizeof text - used, "\r");
    }
    send(text, used);
    self->line_count = 0;
}

/// Waits until `at_s` or the end; returns whether it is the end.
static bool wait_until(struct measuring_live *self, double at_s)
{
    const double whole_s = floor(at_s);
    const struct timespec at = {(time_t)whole_s, (long)(1e9 * (at_s - whole_s))};
    int waited = 0;
    pthread_mutex_lock(&self->mutex);
    while (!self->ended && waited == 0) {
        waited = pthread_cond_timedwait(&self->ended_changed, &self->mutex, &at);
    }
    const bool ended = self->ended;
    pthread_mutex_unlock(&self->mutex);
    return ended;
}

static void *show(void *object)
{
    struct measuring_live *self = object;
    // Of this thread alone on Linux: where the loop was granted no real-time priority it is to go first all the same.
    if (nice(below_the_loop) == -1) {
        errno = 0;
    }
    double next_s = fmax(self->started_s + first_shown_s, wall_clock_now_s());
    while (!wait_until(self, next_s)) {
        draw(self);
        next_s = wall_clock_now_s() + renewed_s;
    }
    erase(self);
    return NULL;
}

static bool allocate(struct measuring_live *self)
{
    const size_t length = self->table->period_samples;
    const size_t lines = self->table->bin_count;
    self->memory = malloc((4 * length + 2 * lines) * sizeof *self->memory);
    self->plan = fft_plan_create(length);
    if (!self->memory || !self->plan || !measure_live_alloc(&self->feed, length)) {
        return false;
    }
    self->amplitude[0] = self->memory + 4 * length;
    self->amplitude[1] = self->amplitude[0] + lines;
    return true;
}

static void release(struct measuring_live *self)
{
    measure_live_free(&self->feed);
    fft_plan_destroy(self->plan);
    free(self->memory);
}

/// Signals go to the loop, which has to hear of Ctrl-C.
static bool start_thread(struct measuring_live *self)
{
    pthread_attr_t attributes;
    pthread_condattr_t clock;
    sigset_t all, before;
    pthread_condattr_init(&clock);
    pthread_condattr_setclock(&clock, CLOCK_MONOTONIC);
    pthread_mutex_init(&self->mutex, NULL);
    pthread_cond_init(&self->ended_changed, &clock);
    pthread_condattr_destroy(&clock);
    pthread_attr_init(&attributes);
    pthread_attr_setstacksize(&attributes, stack_bytes); // locked into memory with the rest
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    const bool started = pthread_create(&self->thread, &attributes, show, self) == 0;
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    pthread_attr_destroy(&attributes);
    if (!started) {
        pthread_cond_destroy(&self->ended_changed);
        pthread_mutex_destroy(&self->mutex);
    }
    return started;
}

void measuring_live_start(struct measuring_live *out_self, const struct command_context *context, double started_s,
                          const struct measuring_live_place *place, struct measure_plan *io_plan)
{
    *out_self = (struct measuring_live){.table = io_plan->table, .limits = &io_plan->limits, .started_s = started_s};
    if (place) {
        out_self->place = *place;
    }
    if (!context->terminal || context->quiet || context->json) {
        return;
    }
    for (uint32_t c = 0; c < io_plan->table->channels; c++) {
        out_self->table_peak[c] = table_value_peak(io_plan->table, c);
    }
    out_self->running = allocate(out_self) && start_thread(out_self);
    if (out_self->running) {
        io_plan->live = &out_self->feed;
    } else {
        release(out_self);
    }
}

void measuring_live_stop(struct measuring_live *self)
{
    if (!self->running) {
        return;
    }
    pthread_mutex_lock(&self->mutex);
    self->ended = true;
    pthread_cond_signal(&self->ended_changed);
    pthread_mutex_unlock(&self->mutex);
    pthread_join(self->thread, NULL);
    pthread_cond_destroy(&self->ended_changed);
    pthread_mutex_destroy(&self->mutex);
    release(self);
    self->running = false;
}
