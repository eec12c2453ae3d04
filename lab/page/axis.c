/* SPDX-License-Identifier: MIT */
#include "lab/page/axis.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* Below this the labels of neighbouring ticks would need more than 12 digits to differ. */
static const double narrowest_range = 1e-11;

bool axis_can_show(enum axis_scale scale, double value)
{
    return fabs(value) < 1e100 && (scale != axis_log || value > 1e-100);
}

static void fit_linear(double low, double high, double margin, struct axis *out_axis)
{
    double size = fmax(fabs(low), fabs(high));
    if (!(high - low > narrowest_range * size)) {
        double half = size > 0.0 ? 0.1 * size : 1.0;
        low -= half;
        high += half;
    }
    double room = margin * (high - low);
    out_axis->low = low - room;
    out_axis->high = high + room;
}

void axis_fit(enum axis_scale scale, double low, double high, double margin, struct axis *out_axis)
{
    out_axis->scale = scale;
    if (!(low <= high) || !axis_can_show(scale, low) || !axis_can_show(scale, high)) {
        out_axis->low = scale == axis_log ? 0.1 : 0.0;
        out_axis->high = scale == axis_log ? 10.0 : 1.0;
        return;
    }
    if (scale != axis_log) {
        fit_linear(low, high, margin, out_axis);
        return;
    }
    if (!(log10(high / low) > 1e-6)) {
        low /= 2.0;
        high *= 2.0;
    }
    double factor = pow(high / low, margin);
    out_axis->low = low / factor;
    out_axis->high = high * factor;
}

double axis_map(const struct axis *self, double value)
{
    if (!axis_can_show(self->scale, value)) {
        return NAN;
    }
    if (self->scale == axis_log) {
        return log(value / self->low) / log(self->high / self->low);
    }
    return (value - self->low) / (self->high - self->low);
}

static void add_tick(struct axis_ticks *ticks, double value, enum axis_rank rank, const char *label)
{
    if (ticks->count < axis_ticks_max) {
        struct axis_tick *tick = &ticks->tick[ticks->count++];
        tick->value = value;
        tick->rank = rank;
        snprintf(tick->label, sizeof tick->label, "%s", label);
    }
}

/* A label with U+2212 for the minus, which is as wide as a digit and does not look like a hyphen. */
static void format_number(double value, int decimals, char *out_label)
{
    char digits[axis_label_max];
    snprintf(digits, sizeof digits, "%.*f", decimals, fabs(value));
    bool zero = strspn(digits, "0.") == strlen(digits);
    snprintf(out_label, axis_label_max, "%s%.20s", value < 0.0 && !zero ? "\xE2\x88\x92" : "", digits);
}

static double choose_step(enum axis_scale scale, double rough, int *out_parts)
{
    if (scale == axis_degrees && rough > 5.0) {
        static const double turns[] = {15.0, 30.0, 45.0, 90.0, 180.0, 360.0};
        for (size_t i = 0; i < sizeof turns / sizeof turns[0]; i++) {
            if (rough <= turns[i] * 1.0001) {
                *out_parts = 3;
                return turns[i];
            }
        }
    }
    double decade = pow(10.0, floor(log10(rough)));
    double mantissa = rough / decade;
    double factor = mantissa <= 1.0001 ? 1.0 : mantissa <= 2.0001 ? 2.0 : mantissa <= 5.0001 ? 5.0 : 10.0;
    *out_parts = factor == 2.0 ? 4 : 5;
    return factor * decade;
}

/* Engineering exponent for labels that would otherwise be mostly zeros. */
static int choose_exponent(double size)
{
    if (size >= 1e5 || size < 1e-3) {
        return 3 * (int)floor(log10(size) / 3.0 + 1e-9);
    }
    return 0;
}

static void find_linear_ticks(const struct axis *self, size_t target, struct axis_ticks *ticks)
{
    int parts = 5;
    double step = choose_step(self->scale, (self->high - self->low) / (double)target, &parts);
    ticks->exponent = choose_exponent(fmax(fabs(self->low), fabs(self->high)));
    double unit = pow(10.0, ticks->exponent);
    int decimals = (int)ceil(-log10(step / unit) - 1e-9);
    decimals = decimals < 0 ? 0 : decimals > 12 ? 12 : decimals;
    double fine = step / parts;
    double slack = 1e-9 * (self->high - self->low);
    /* Counting in whole multiples keeps 0 exactly 0 and the end from being lost to rounding. */
    double first = ceil((self->low - slack) / fine);
    double last = floor((self->high + slack) / fine);
    for (double n = first; n <= last && ticks->count < axis_ticks_max; n += 1.0) {
        char label[axis_label_max] = "";
        bool major = fmod(n, parts) == 0.0;
        if (major) {
            format_number(n / parts * step / unit, decimals, label);
        }
        add_tick(ticks, n * fine, major ? axis_primary : axis_minor, label);
    }
}

/* 10^n as a plain number where that is short, else with superscript digits. */
static void format_decade(int mantissa, int exponent, char *out_label)
{
    static const char *const superscript[] = {"\xE2\x81\xB0", "\xC2\xB9",     "\xC2\xB2",     "\xC2\xB3",
                                              "\xE2\x81\xB4", "\xE2\x81\xB5", "\xE2\x81\xB6", "\xE2\x81\xB7",
                                              "\xE2\x81\xB8", "\xE2\x81\xB9"};
    if (exponent >= -3 && exponent <= 4) {
        format_number(mantissa * pow(10.0, exponent), exponent < 0 ? -exponent : 0, out_label);
        return;
    }
    int size = exponent < 0 ? -exponent : exponent;
    char head[16] = "";
    if (mantissa != 1) {
        snprintf(head, sizeof head, "%d\xC2\xB7", mantissa);
    }
    snprintf(out_label, axis_label_max, "%s10%s%s%s", head, exponent < 0 ? "\xE2\x81\xBB" : "",
             size >= 10 ? superscript[size / 10 % 10] : "", superscript[size % 10]);
}

static enum axis_rank log_rank(int mantissa, int exponent, int stride, double decades)
{
    if (mantissa == 1) {
        return exponent % stride == 0 ? axis_primary : axis_minor;
    }
    return decades <= 3.0 && (mantissa == 2 || mantissa == 5) ? axis_secondary : axis_minor;
}

static void find_log_ticks(const struct axis *self, size_t target, struct axis_ticks *ticks)
{
    double low = log10(self->low) - 1e-9;
    double high = log10(self->high) + 1e-9;
    int stride = 1;
    while ((high - low) / stride > (double)target) {
        stride++;
    }
    bool with_minor = high - low <= 10.0;
    for (int exponent = (int)floor(low); exponent <= (int)floor(high); exponent++) {
        for (int mantissa = 1; mantissa <= (with_minor ? 9 : 1); mantissa++) {
            double place = exponent + log10(mantissa);
            if (place < low || place > high) {
                continue;
            }
            char label[axis_label_max] = "";
            enum axis_rank rank = log_rank(mantissa, exponent, stride, high - low);
            if (rank != axis_minor) {
                format_decade(mantissa, exponent, label);
            }
            if (with_minor || rank == axis_primary) {
                add_tick(ticks, mantissa * pow(10.0, exponent), rank, label);
            }
        }
    }
}

static size_t count_labels(const struct axis_ticks *ticks)
{
    size_t labels = 0;
    for (size_t n = 0; n < ticks->count; n++) {
        labels += ticks->tick[n].rank != axis_minor;
    }
    return labels;
}

void axis_find_ticks(const struct axis *self, size_t target, struct axis_ticks *out_ticks)
{
    const size_t fewest = 3;
    target = target < 2 ? 2 : target > 15 ? 15 : target;
    for (size_t tried = target; tried <= target + 4; tried++) {
        out_ticks->count = 0;
        out_ticks->exponent = 0;
        if (self->scale == axis_log && log10(self->high / self->low) >= 0.7) {
            find_log_ticks(self, tried, out_ticks);
        } else {
            find_linear_ticks(self, tried, out_ticks);
        }
        if (count_labels(out_ticks) >= fewest) {
            return;
        }
    }
}
