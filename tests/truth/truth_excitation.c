/* SPDX-License-Identifier: MIT */
#include "tests/truth/truth_excitation.h"

#include <math.h>

static const double two_pi = 6.283185307179586476925286766559;
static const double highest_corner_hz = 60.0;

static double line_rad_per_s(int k)
{
    return two_pi * (double)k * (double)TRUTH_RATE_HZ / (double)TRUTH_PERIOD_SAMPLES;
}

static void draw_phases(const double *speed, double *out_phase, struct truth_random *random)
{
    int schroeder = truth_random_bits(random) & 1u;
    double power[TRUTH_LINES + 1] = {0}, total = 0.0;
    for (int k = 1; k <= TRUTH_LINES; k++) {
        power[k] = pow(speed[k] * line_rad_per_s(k), 2.0);
        total += power[k];
    }
    double phase = truth_random_uniform(random, 0.0, two_pi), slope = 0.0;
    for (int k = 1; k <= TRUTH_LINES; k++) {
        out_phase[k] = schroeder ? phase : truth_random_uniform(random, 0.0, two_pi);
        slope += power[k] / total;
        phase = fmod(phase - two_pi * slope, two_pi);
    }
}

static void set_speed_lines(const struct truth_excitation_wish *wish, double corner_hz, double *out_speed)
{
    double square = 0.0;
    for (int k = 1; k <= TRUTH_LINES; k++) {
        double ratio = line_rad_per_s(k) / (two_pi * corner_hz);
        out_speed[k] = 1.0 / sqrt(1.0 + ratio * ratio);
        square += 0.5 * pow(out_speed[k] * line_rad_per_s(k), 2.0);
    }
    double scale = wish->torque_rms_Nm / (wish->inertia_kgm2 * sqrt(square));
    for (int k = 1; k <= TRUTH_LINES; k++) {
        out_speed[k] *= scale;
    }
}

// Sum of the lines; returns the peak speed.
static double synthesise(struct truth_excitation *self, const double *speed, const double *phase)
{
    double cosine[TRUTH_PERIOD_SAMPLES], re[TRUTH_LINES + 1], im[TRUTH_LINES + 1];
    double peak = 0.0;
    for (int k = 1; k <= TRUTH_LINES; k++) {
        re[k] = speed[k] * cos(phase[k]);
        im[k] = speed[k] * sin(phase[k]);
    }
    for (int n = 0; n < TRUTH_PERIOD_SAMPLES; n++) {
        cosine[n] = cos(two_pi * (double)n / TRUTH_PERIOD_SAMPLES);
    }
    for (int n = 0; n < TRUTH_PERIOD_SAMPLES; n++) {
        double x = 0.0, v = 0.0, a = 0.0;
        for (int k = 1; k <= TRUTH_LINES; k++) {
            int turn = (k * n) % TRUTH_PERIOD_SAMPLES;
            double c = cosine[turn];
            double s = cosine[(turn + 3 * TRUTH_PERIOD_SAMPLES / 4) % TRUTH_PERIOD_SAMPLES];
            double w = line_rad_per_s(k);
            double in_phase = re[k] * c - im[k] * s, ahead = -(re[k] * s + im[k] * c);
            v += in_phase;
            a += w * ahead;
            x -= ahead / w;
        }
        self->position_rad[n] = x;
        self->velocity_rad_per_s[n] = v;
        self->acceleration_rad_per_s2[n] = a;
        peak = fmax(peak, fabs(v));
    }
    return peak;
}

static void scale_motion(struct truth_excitation *self, double factor)
{
    for (int n = 0; n < TRUTH_PERIOD_SAMPLES; n++) {
        self->position_rad[n] *= factor;
        self->velocity_rad_per_s[n] *= factor;
        self->acceleration_rad_per_s2[n] *= factor;
    }
}

static void add_stroke(struct truth_excitation *self, double amplitude, double phase)
{
    double w = line_rad_per_s(1);
    for (int n = 0; n < TRUTH_PERIOD_SAMPLES; n++) {
        double angle = two_pi * (double)n / TRUTH_PERIOD_SAMPLES + phase;
        self->position_rad[n] += amplitude * cos(angle);
        self->velocity_rad_per_s[n] -= amplitude * w * sin(angle);
        self->acceleration_rad_per_s2[n] -= amplitude * w * w * cos(angle);
    }
}

static int calmest_sample(const struct truth_excitation *self)
{
    double v_top = 0.0, a_top = 0.0;
    for (int n = 0; n < TRUTH_PERIOD_SAMPLES; n++) {
        v_top = fmax(v_top, fabs(self->velocity_rad_per_s[n]));
        a_top = fmax(a_top, fabs(self->acceleration_rad_per_s2[n]));
    }
    int best = 0;
    double lowest = INFINITY;
    for (int n = 0; n < TRUTH_PERIOD_SAMPLES; n++) {
        double v = self->velocity_rad_per_s[n] / v_top, a = self->acceleration_rad_per_s2[n] / a_top;
        // A step of speed excites the loop more than a step of torque does.
        double cost = 25.0 * v * v + a * a;
        if (cost < lowest) {
            lowest = cost;
            best = n;
        }
    }
    return best;
}

static void turn_left(double *samples, int by)
{
    double copy[TRUTH_PERIOD_SAMPLES];
    for (int n = 0; n < TRUTH_PERIOD_SAMPLES; n++) {
        copy[n] = samples[(n + by) % TRUTH_PERIOD_SAMPLES];
    }
    for (int n = 0; n < TRUTH_PERIOD_SAMPLES; n++) {
        samples[n] = copy[n];
    }
}

static void find_range(const struct truth_excitation *self, double *out_low, double *out_high)
{
    *out_low = *out_high = self->position_rad[0];
    for (int n = 1; n < TRUTH_PERIOD_SAMPLES; n++) {
        *out_low = fmin(*out_low, self->position_rad[n]);
        *out_high = fmax(*out_high, self->position_rad[n]);
    }
}

double truth_excitation_range_rad(const struct truth_excitation *self)
{
    double low, high;
    find_range(self, &low, &high);
    return high - low;
}

void truth_excitation_make(struct truth_excitation *self, const struct truth_excitation_wish *wish,
                           struct truth_random *random)
{
    double speed[TRUTH_LINES + 1], phase[TRUTH_LINES + 1];
    double corner_hz = wish->corner_hz;
    set_speed_lines(wish, corner_hz, speed);
    draw_phases(speed, phase, random);
    double peak = synthesise(self, speed, phase);
    while (peak > wish->speed_max_rad_per_s && corner_hz < highest_corner_hz) {
        corner_hz *= 1.25;
        set_speed_lines(wish, corner_hz, speed);
        peak = synthesise(self, speed, phase);
    }
    scale_motion(self, fmin(1.0, wish->speed_max_rad_per_s / peak));
    add_stroke(self, wish->stroke_rad, truth_random_uniform(random, 0.0, two_pi));
    int start = calmest_sample(self);
    turn_left(self->position_rad, start);
    turn_left(self->velocity_rad_per_s, start);
    turn_left(self->acceleration_rad_per_s2, start);
    double low, high;
    find_range(self, &low, &high);
    for (int n = 0; n < TRUTH_PERIOD_SAMPLES; n++) {
        self->position_rad[n] += wish->centre_rad - 0.5 * (low + high);
    }
}
