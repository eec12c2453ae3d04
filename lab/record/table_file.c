/* SPDX-License-Identifier: MIT */
#include "lab/record/table_file.h"

#include "core/bytes.h"
#include "core/crc32.h"
#include "core/fixed.h"
#include "lab/record/atomic_file.h"
#include "lab/record/c_name.h"
#include "lab/record/number.h"
#include "lab/record/text_table.h"

#include <errno.h>
#include <float.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Fewer counts than this make a staircase of the channel: an i16 table at 1/256 of its range. */
static const double counts_min = 127;

/* A measurement of an i32 table can have at least as many periods before its travel overflows 32 bits. */
static const double travel_periods = 1024;

static const char *const channel_names[msgen_channels_max] = {"torque", "velocity", "position"};

static const double *channel_data(const struct table *self, uint32_t channel)
{
    const double *const data[msgen_channels_max] = {self->torque, self->velocity, self->position};
    return data[channel];
}

static double count_max(enum msgen_format format)
{
    return format == msgen_format_i16 ? INT16_MAX : INT32_MAX;
}

void table_free(struct table *self)
{
    free(self->torque);
    free(self->velocity);
    free(self->position);
    free(self->acceleration);
    free(self->bins);
    *self = (struct table){0};
}

static int check_sizes(uint32_t samples, uint32_t channels, uint32_t bin_count, struct error *out_error)
{
    if (samples < 4 || samples > SERVOSCOPE_TABLE_SAMPLES_MAX)
        return error_set(out_error, error_refused, "a table of %" PRIu32 " samples: 4 to %d were expected", samples,
                         SERVOSCOPE_TABLE_SAMPLES_MAX);
    if (channels < 1 || channels > msgen_channels_max)
        return error_set(out_error, error_refused, "a table of %" PRIu32 " channels: 1 to 3 were expected", channels);
    if (bin_count < 1 || bin_count > (samples - 1) / 2)
        return error_set(out_error, error_refused,
                         "a table of %" PRIu32 " samples with %" PRIu32 " excited bins: 1 to %" PRIu32 " were expected",
                         samples, bin_count, (samples - 1) / 2);
    return error_none;
}

int table_alloc(struct table *out_table, uint32_t samples, uint32_t channels, uint32_t bin_count,
                struct error *out_error)
{
    *out_table = (struct table){0};
    if (check_sizes(samples, channels, bin_count, out_error) != error_none)
        return error_refused;
    out_table->samples = samples;
    out_table->channels = channels;
    out_table->bin_count = bin_count;
    out_table->torque = calloc(samples, sizeof(double));
    out_table->velocity = channels > 1 ? calloc(samples, sizeof(double)) : NULL;
    out_table->position = channels > 2 ? calloc(samples, sizeof(double)) : NULL;
    out_table->acceleration = calloc(samples, sizeof(double));
    out_table->bins = calloc(bin_count, sizeof *out_table->bins);
    if (out_table->torque && (channels < 2 || out_table->velocity) && (channels < 3 || out_table->position) &&
        out_table->acceleration && out_table->bins)
        return error_none;
    table_free(out_table);
    return error_set(out_error, error_refused, "memory is short for a table of %" PRIu32 " samples", samples);
}

int table_set_rate(struct table *self, double rate_hz, struct error *out_error)
{
    static const double tolerance = 1e-12;
    if (!(rate_hz >= 1e-6 && rate_hz <= 4e9))
        return error_set(out_error, error_refused, "sample rate of %g Hz: 1e-6 to 4e9 Hz was expected", rate_hz);
    /* Convergents of the continued fraction: the best fractions there are, with growing denominators. */
    double rest = rate_hz;
    double num = 1, den = 0, num_before = 0, den_before = 1;
    for (int i = 0; i < 64; i++) {
        double whole = floor(rest);
        double num_next = whole * num + num_before, den_next = whole * den + den_before;
        if (num_next > UINT32_MAX || den_next > UINT32_MAX)
            break;
        num_before = num;
        den_before = den;
        num = num_next;
        den = den_next;
        if (num > 0 && fabs(num / den - rate_hz) <= tolerance * rate_hz)
            break;
        rest = 1 / (rest - whole);
    }
    if (!(num >= 1 && den >= 1 && fabs(num / den - rate_hz) <= 1e-9 * rate_hz))
        return error_set(out_error, error_refused, "sample rate of %.17g Hz is no fraction of 32-bit numbers", rate_hz);
    self->rate_num_hz = (uint32_t)num;
    self->rate_den = (uint32_t)den;
    return error_none;
}

double table_rate_hz(const struct table *self)
{
    return (double)self->rate_num_hz / self->rate_den;
}

enum { detail_size = 160 };

static void describe_number(char *detail, uint32_t found, const char *expected)
{
    snprintf(detail, detail_size, "found %" PRIu32 ", expected %s", found, expected);
}

static void describe_range(char *detail, uint32_t found, uint32_t low, uint32_t high)
{
    snprintf(detail, detail_size, "found %" PRIu32 ", expected %" PRIu32 " to %" PRIu32, found, low, high);
}

static void describe_crc(char *detail, uint32_t stored, const uint8_t *bytes, size_t size)
{
    snprintf(detail, detail_size, "found 0x%08" PRIx32 ", but the bytes give 0x%08" PRIx32, stored,
             core_crc32(0, bytes, size));
}

static void describe_scale(char *detail, const struct msgen_table *view)
{
    union core_float_bits scale;
    uint32_t channel = (view->fault_offset - 32u) / 4u % msgen_channels_max;
    scale.bits = view->scale_bits[channel];
    snprintf(detail, detail_size, "%s: found %g", channel_names[channel], (double)scale.value);
}

/* Faults of the file as a whole. */
static void describe_envelope(enum core_status status, const uint8_t *bytes, size_t size,
                              const struct msgen_table *view, char *detail)
{
    uint32_t header = msgen_header_bytes;
    if (size > 5 && core_get_u16(bytes + 4) == msgen_table_version_travel)
        header = msgen_header_travel_bytes;
    switch (status) {
    case core_err_table_truncated:
    case core_err_table_trailing:
        if (size < header)
            snprintf(detail, detail_size, "%zu bytes, the header alone has %" PRIu32, size, header);
        else
            snprintf(detail, detail_size, "%zu bytes, expected %" PRIu32, size, header + msgen_table_data_bytes(view));
        break;
    case core_err_table_version:
        describe_number(detail, core_get_u16(bytes + 4), "1 or 2");
        break;
    case core_err_table_header_crc:
        describe_crc(detail, core_get_u32(bytes + view->fault_offset), bytes, view->fault_offset);
        break;
    case core_err_table_data_crc:
        describe_crc(detail, view->data_crc32, bytes + header, size - header);
        break;
    case core_err_table_unit:
        describe_range(detail, core_get_u32(bytes + 28), 0, 1);
        break;
    case core_err_table_size:
        snprintf(detail, detail_size, "found %" PRIu32 ", expected %" PRIu32, core_get_u32(bytes + 44),
                 msgen_table_data_bytes(view));
        break;
    default:
        break;
    }
}

/* Faults of one field or number, in a file or in a table about to be written. */
static void describe_field(enum core_status status, const struct msgen_table *view, char *detail)
{
    uint32_t bin_max = (view->period_samples - 1u) / 2u;
    uint32_t header = msgen_table_header_bytes(view);
    uint32_t bin_index = (view->fault_offset - header) / 4u;
    switch (status) {
    case core_err_table_rate:
        snprintf(detail, detail_size, "found %" PRIu32 "/%" PRIu32 " Hz", view->rate_num_hz, view->rate_den);
        break;
    case core_err_table_samples:
        describe_range(detail, view->period_samples, 4, SERVOSCOPE_TABLE_SAMPLES_MAX);
        break;
    case core_err_table_channels:
        describe_range(detail, view->channels, 1, 3);
        break;
    case core_err_table_format:
        describe_number(detail, (uint32_t)view->format, "1 (i16), 2 (i32) or 3 (f32)");
        break;
    case core_err_table_scale:
        describe_scale(detail, view);
        break;
    case core_err_table_bin_count:
        describe_range(detail, view->bin_count, 1, bin_max);
        break;
    case core_err_table_bin_order:
    case core_err_table_bin_range:
        snprintf(detail, detail_size, "number %" PRIu32 " of the list is %" PRIu32 ", expected %" PRIu32 " to %" PRIu32,
                 bin_index, msgen_table_bin(view, bin_index),
                 bin_index ? msgen_table_bin(view, bin_index - 1) + 1u : 1u, bin_max);
        break;
    case core_err_table_start:
        describe_range(detail, view->start_index, 0, view->period_samples - 1u);
        break;
    case core_err_table_sample:
        snprintf(detail, detail_size, "number %" PRIu32 " of the samples",
                 (view->fault_offset - header) / 4u - view->bin_count);
        break;
    case core_err_table_travel:
        snprintf(detail, detail_size, "found %.6g counts in %" PRIu32 " channels, expected up to 2^31, not 0, in 3",
                 (double)view->travel_q30 / CORE_Q30_ONE, view->channels);
        break;
    default:
        break;
    }
}

/* bytes: NULL for a table that is not written yet */
static int refuse(const char *path, enum core_status status, const uint8_t *bytes, size_t size,
                  const struct msgen_table *view, struct error *out_error)
{
    char detail[detail_size] = "", place[32] = "";
    if (bytes) {
        describe_envelope(status, bytes, size, view, detail);
        snprintf(place, sizeof place, "byte %" PRIu32 ": ", view->fault_offset);
    }
    if (!detail[0])
        describe_field(status, view, detail);
    return error_set(out_error, error_refused, "%s: %s%s%s%s", path, place, core_status_str(status),
                     detail[0] ? ": " : "", detail);
}

/* The whole file, or as much of it as shows that it is longer than any table. */
static int read_bytes(const char *path, uint8_t **out_bytes, size_t *out_size, struct error *out_error)
{
    static const size_t size_max = msgen_header_travel_bytes + 14u * (size_t)SERVOSCOPE_TABLE_SAMPLES_MAX;
    FILE *stream = fopen(path, "rb");
    if (!stream)
        return error_set(out_error, error_refused, "%s: cannot be read: %s", path, strerror(errno));
    size_t room = 4096, size = 0;
    uint8_t *bytes = malloc(room);
    while (bytes) {
        size += fread(bytes + size, 1, room - size, stream);
        if (size < room || size > size_max)
            break;
        room *= 2;
        uint8_t *larger = realloc(bytes, room);
        if (!larger)
            free(bytes);
        bytes = larger;
    }
    int reason = ferror(stream) ? errno : 0;
    fclose(stream);
    if (bytes && reason == 0) {
        *out_bytes = bytes;
        *out_size = size;
        return error_none;
    }
    free(bytes);
    return error_set(out_error, error_refused, "%s: cannot be read: %s", path, strerror(reason ? reason : ENOMEM));
}

static double sample_of(const struct msgen_table *view, uint32_t n, uint32_t channel)
{
    union core_float_bits number;
    number.bits = view->scale_bits[channel];
    double scale = number.value;
    if (view->format != msgen_format_f32)
        return scale * msgen_table_count(view, n, channel);
    number.bits = msgen_table_float_bits(view, n, channel);
    return scale * number.value;
}

static double travel_of(const struct msgen_table *view)
{
    union core_float_bits scale;
    scale.bits = view->scale_bits[msgen_channel_position];
    return view->travel_q30 ? (double)view->travel_q30 / CORE_Q30_ONE * (double)scale.value : 0;
}

static int copy_view(const char *path, const struct msgen_table *view, struct table *out_table, struct error *out_error)
{
    if (table_alloc(out_table, view->period_samples, view->channels, view->bin_count, out_error) != error_none)
        return error_refused;
    free(out_table->acceleration);
    out_table->acceleration = NULL;
    out_table->rate_num_hz = view->rate_num_hz;
    out_table->rate_den = view->rate_den;
    out_table->start_index = view->start_index;
    out_table->format = view->format;
    out_table->linear = view->linear;
    out_table->crc32 = view->header_crc32;
    out_table->travel_per_period = travel_of(view);
    for (uint32_t b = 0; b < view->bin_count; b++)
        out_table->bins[b] = msgen_table_bin(view, b);
    double *const data[msgen_channels_max] = {out_table->torque, out_table->velocity, out_table->position};
    for (uint32_t c = 0; c < view->channels; c++) {
        union core_float_bits scale;
        scale.bits = view->scale_bits[c];
        out_table->scale[c] = scale.value;
        for (uint32_t n = 0; n < view->period_samples; n++) {
            data[c][n] = sample_of(view, n, c);
            if (!isfinite(data[c][n])) {
                table_free(out_table);
                return error_set(out_error, error_refused, "%s: %s: sample %" PRIu32 " times its scale is not finite",
                                 path, channel_names[c], n);
            }
        }
    }
    return error_none;
}

/* The largest magnitude; NaN if there is one. */
static double peak_of(const double *data, uint32_t samples)
{
    double peak = 0;
    for (uint32_t n = 0; n < samples; n++) {
        if (isnan(data[n]))
            return NAN;
        peak = fmax(peak, fabs(data[n]));
    }
    return peak;
}

static int check_resolution(const char *path, const struct table *self, uint32_t channel, struct error *out_error)
{
    if (self->format == msgen_format_f32)
        return error_none;
    double peak = peak_of(channel_data(self, channel), self->samples);
    double counts = rint(peak / (double)self->scale[channel]);
    if (peak == 0 || counts >= counts_min)
        return error_none;
    return error_set(out_error, error_refused,
                     "%s: %s: its peak is %g counts of %g: at least %g were expected, use a smaller scale than %g",
                     path, channel_names[channel], counts, count_max(self->format), counts_min,
                     (double)self->scale[channel]);
}

int table_file_read(const char *path, struct table *out_table, struct error *out_error)
{
    *out_table = (struct table){0};
    uint8_t *bytes = NULL;
    size_t size = 0;
    if (read_bytes(path, &bytes, &size, out_error) != error_none)
        return error_refused;
    struct msgen_table view = {0};
    enum core_status table_status = msgen_table_open(bytes, size, &view);
    int status = error_none;
    if (table_status != core_ok)
        status = refuse(path, table_status, bytes, size, &view, out_error);
    else
        status = copy_view(path, &view, out_table, out_error);
    free(bytes);
    for (uint32_t c = 0; status == error_none && c < out_table->channels; c++)
        status = check_resolution(path, out_table, c, out_error);
    if (status != error_none)
        table_free(out_table);
    return status;
}

/* The smallest float that keeps the peak within the counts. */
static int choose_scale(const char *path, struct table *self, uint32_t channel, double peak, struct error *out_error)
{
    if (self->format == msgen_format_f32 || peak == 0) {
        self->scale[channel] = 1;
        return error_none;
    }
    double exact = peak / count_max(self->format);
    if (!(exact >= FLT_MIN && exact <= FLT_MAX / 2))
        return error_set(out_error, error_refused, "%s: %s: a peak of %g: %g to %g was expected", path,
                         channel_names[channel], peak, FLT_MIN * count_max(self->format),
                         FLT_MAX * (count_max(self->format) / 2));
    float scale = (float)exact;
    if ((double)scale < exact)
        scale = nextafterf(scale, INFINITY);
    self->scale[channel] = scale;
    return error_none;
}

static int prepare_channel(const char *path, struct table *self, uint32_t channel, struct error *out_error)
{
    const double *data = channel_data(self, channel);
    if (!data)
        return error_set(out_error, error_refused, "%s: %s: a table of %" PRIu32 " channels needs it", path,
                         channel_names[channel], self->channels);
    for (uint32_t n = 0; n < self->samples; n++)
        if (!isfinite(data[n]))
            return error_set(out_error, error_refused, "%s: %s: sample %" PRIu32 " is %g, a finite number was expected",
                             path, channel_names[channel], n, data[n]);
    double most_played = peak_of(data, self->samples);
    if (channel == msgen_channel_position && self->format == msgen_format_i32)
        most_played += travel_periods * fabs(self->travel_per_period);
    if (self->scale[channel] == 0 && choose_scale(path, self, channel, most_played, out_error) != error_none)
        return error_refused;
    if (!(self->scale[channel] >= FLT_MIN && self->scale[channel] <= FLT_MAX))
        return error_set(out_error, error_refused, "%s: %s: a scale of %g: a positive number was expected", path,
                         channel_names[channel], (double)self->scale[channel]);
    double most = self->format == msgen_format_f32 ? FLT_MAX : count_max(self->format);
    for (uint32_t n = 0; n < self->samples; n++) {
        double count = data[n] / (double)self->scale[channel];
        if (!(fabs(self->format == msgen_format_f32 ? count : rint(count)) <= most))
            return error_set(out_error, error_refused,
                             "%s: %s: sample %" PRIu32 " is %g: at most %g fits its number format at a scale of %g",
                             path, channel_names[channel], n, data[n], most * (double)self->scale[channel],
                             (double)self->scale[channel]);
    }
    return check_resolution(path, self, channel, out_error);
}

static void put_sample(uint8_t *out_bytes, enum msgen_format format, double count)
{
    union core_float_bits number;
    switch (format) {
    case msgen_format_i16:
        core_put_u16(out_bytes, (uint16_t)(int16_t)rint(count));
        break;
    case msgen_format_i32:
        core_put_u32(out_bytes, (uint32_t)(int32_t)rint(count));
        break;
    case msgen_format_f32:
        number.value = (float)count;
        core_put_u32(out_bytes, number.bits);
        break;
    }
}

static void put_data(const struct table *self, uint8_t *bytes)
{
    for (uint32_t b = 0; b < self->bin_count; b++, bytes += 4)
        core_put_u32(bytes, self->bins[b]);
    uint32_t width = msgen_format_bytes(self->format);
    for (uint32_t n = 0; n < self->samples; n++)
        for (uint32_t c = 0; c < self->channels; c++, bytes += width)
            put_sample(bytes, self->format, channel_data(self, c)[n] / (double)self->scale[c]);
}

static struct msgen_table header_of(const struct table *self)
{
    struct msgen_table header = {
        .rate_num_hz = self->rate_num_hz,
        .rate_den = self->rate_den,
        .period_samples = self->samples,
        .bin_count = self->bin_count,
        .start_index = self->start_index,
        .channels = self->channels,
        .format = self->format,
        .linear = self->linear,
    };
    for (uint32_t c = 0; c < msgen_channels_max && c < self->channels; c++) {
        union core_float_bits scale;
        scale.value = self->scale[c];
        header.scale_bits[c] = scale.bits;
    }
    return header;
}

/* Once the position's scale is known. Rounding moves the speed by less than 2^-30 counts a period. */
static int prepare_travel(const char *path, const struct table *self, int64_t *out_travel_q30, struct error *out_error)
{
    *out_travel_q30 = 0;
    if (self->travel_per_period == 0)
        return error_none;
    double count = self->channels > msgen_channel_position
                       ? self->travel_per_period / (double)self->scale[msgen_channel_position]
                       : NAN;
    if (!(fabs(count) <= count_max(msgen_format_i32)))
        return error_set(
            out_error, error_refused, "%s: travel of %g per period: at most %g was expected, in a table of 3 channels",
            path, self->travel_per_period, count_max(msgen_format_i32) * (double)self->scale[msgen_channel_position]);
    *out_travel_q30 = llrint(count * CORE_Q30_ONE);
    if (*out_travel_q30 != 0)
        return error_none;
    return error_set(out_error, error_refused,
                     "%s: travel of %g per period: 0, or at least %g was expected, a 2^30th of the position's scale",
                     path, self->travel_per_period, (double)self->scale[msgen_channel_position] / CORE_Q30_ONE);
}

size_t table_file_bytes(const struct table *self)
{
    uint32_t header = self->travel_per_period != 0 ? msgen_header_travel_bytes : msgen_header_bytes;
    return header + 4 * (size_t)self->bin_count +
           (size_t)self->samples * self->channels * msgen_format_bytes(self->format);
}

/* What is written has passed the check that firmware will make. */
int table_file_encode(const char *path, struct table *self, uint8_t **out_bytes, size_t *out_size,
                      struct error *out_error)
{
    uint8_t scratch[msgen_header_bytes];
    if (self->format == 0)
        self->format = msgen_format_i32;
    if (!self->bins)
        return error_set(out_error, error_refused, "%s: a table without excited bins", path);
    if (!isfinite(self->travel_per_period))
        return error_set(out_error, error_refused, "%s: travel of %g per period: a finite number was expected", path,
                         self->travel_per_period);
    struct msgen_table header = header_of(self);
    for (uint32_t c = 0; c < msgen_channels_max && c < self->channels; c++)
        header.scale_bits[c] = 0x3F800000u; /* 1.0f: the sizes are judged before the samples are looked at */
    enum core_status status = msgen_table_encode_header(&header, scratch);
    if (status != core_ok)
        return refuse(path, status, NULL, 0, &header, out_error);
    for (uint32_t c = 0; c < self->channels; c++)
        if (prepare_channel(path, self, c, out_error) != error_none)
            return error_refused;
    header = header_of(self);
    if (prepare_travel(path, self, &header.travel_q30, out_error) != error_none)
        return error_refused;
    size_t header_bytes = msgen_table_header_bytes(&header);
    size_t size = table_file_bytes(self);
    uint8_t *bytes = malloc(size);
    if (!bytes)
        return error_set(out_error, error_refused, "%s: memory is short for a table of %zu bytes", path, size);
    put_data(self, bytes + header_bytes);
    header.data_crc32 = core_crc32(0, bytes + header_bytes, size - header_bytes);
    status = msgen_table_encode_header(&header, bytes);
    if (status == core_ok)
        status = msgen_table_open(bytes, size, &header);
    if (status != core_ok) {
        refuse(path, status, NULL, size, &header, out_error);
        free(bytes);
        return error_refused;
    }
    self->crc32 = header.header_crc32;
    *out_bytes = bytes;
    *out_size = size;
    return error_none;
}

int table_file_write_mst(const char *path, struct table *self, struct error *out_error)
{
    uint8_t *bytes = NULL;
    size_t size = 0;
    if (table_file_encode(path, self, &bytes, &size, out_error) != error_none)
        return error_refused;
    struct atomic_file file;
    FILE *stream = atomic_file_open(&file, path, out_error);
    if (stream)
        fwrite(bytes, 1, size, stream);
    free(bytes);
    return stream ? atomic_file_commit(&file, out_error) : error_refused;
}

static void write_keys(FILE *stream, const struct table *self)
{
    char rate[number_text_size];
    number_format(table_rate_hz(self), rate);
    fprintf(stream, "# sample_rate_hz: %s\n# period_samples: %" PRIu32 "\n", rate, self->samples);
    for (uint32_t b = 0; b < self->bin_count; b++)
        fprintf(stream, "%s%" PRIu32, b ? ", " : "# excited_bins: [", self->bins[b]);
    fprintf(stream, "]\n# start_index: %" PRIu32 "\n", self->start_index);
    if (self->travel_per_period != 0) {
        char travel[number_text_size];
        number_format(self->travel_per_period, travel);
        fprintf(stream, "# travel_per_period_%s: %s\n", self->linear ? "m" : "rad", travel);
    }
    fprintf(stream, "# table_crc32: 0x%08" PRIx32 "\n", self->crc32);
}

static void write_columns(FILE *stream, const struct table *self, double *sample_index)
{
    static char names[2][5][32] = {
        {"n", "torque_Nm", "position_rad", "velocity_rad_per_s", "acceleration_rad_per_s2"},
        {"n", "force_N", "position_m", "velocity_m_per_s", "acceleration_m_per_s2"},
    };
    double *const data[5] = {sample_index, self->torque, self->position, self->velocity, self->acceleration};
    struct run_column columns[5];
    size_t count = 0;
    for (size_t c = 0; c < 5; c++)
        if (data[c])
            columns[count++] = (struct run_column){.name = names[self->linear][c], .data = data[c]};
    text_write_columns(stream, columns, count, self->samples);
}

int table_file_write_csv(const char *path, struct table *self, struct error *out_error)
{
    uint8_t *bytes = NULL;
    size_t size = 0;
    if (table_file_encode(path, self, &bytes, &size, out_error) != error_none)
        return error_refused;
    free(bytes);
    for (uint32_t n = 0; self->acceleration && n < self->samples; n++)
        if (!isfinite(self->acceleration[n]))
            return error_set(out_error, error_refused,
                             "%s: acceleration: sample %" PRIu32 " is %g, a finite number was expected", path, n,
                             self->acceleration[n]);
    double *sample_index = malloc(self->samples * sizeof *sample_index);
    if (!sample_index)
        return error_set(out_error, error_refused, "%s: memory is short for %" PRIu32 " samples", path, self->samples);
    for (uint32_t n = 0; n < self->samples; n++)
        sample_index[n] = n;
    struct atomic_file file;
    FILE *stream = atomic_file_open(&file, path, out_error);
    if (stream) {
        write_keys(stream, self);
        write_columns(stream, self, sample_index);
    }
    free(sample_index);
    return stream ? atomic_file_commit(&file, out_error) : error_refused;
}

static void write_array(FILE *stream, const char *name, const char *macro, const uint8_t *bytes, size_t size)
{
    fprintf(stream, "static const uint8_t %s_mst[%s_BYTES] = {", name, macro);
    for (size_t i = 0; i < size; i++)
        fprintf(stream, "%s0x%02x,", i % 20 ? "" : "\n    ", bytes[i]);
    fprintf(stream, "\n};\n");
}

static void write_header_text(FILE *stream, const char *path, const struct table *self, const uint8_t *bytes,
                              size_t size)
{
    char name[c_name_size], macro[c_name_size];
    c_name_from_path(path, false, name);
    c_name_from_path(path, true, macro);
    fprintf(stream,
            "/* Multisine table made by servoscope, the bytes of an .mst file. Before playing it:\n"
            " *     msgen_table_open(%s_mst, sizeof %s_mst, &table) == core_ok */\n"
            "#ifndef %s_MST_H\n#define %s_MST_H\n\n#include <stdint.h>\n\n",
            name, name, macro, macro);
    const struct {
        const char *name;
        uint32_t value;
    } constants[] = {
        {"RATE_NUM_HZ", self->rate_num_hz}, {"RATE_DEN", self->rate_den},   {"PERIOD_SAMPLES", self->samples},
        {"CHANNELS", self->channels},       {"BIN_COUNT", self->bin_count}, {"START_INDEX", self->start_index},
        {"BYTES", (uint32_t)size},
    };
    for (size_t i = 0; i < sizeof constants / sizeof constants[0]; i++)
        fprintf(stream, "#define %s_%s %" PRIu32 "u\n", macro, constants[i].name, constants[i].value);
    fprintf(stream, "#define %s_CRC32 0x%08" PRIx32 "u\n\n", macro, self->crc32);
    write_array(stream, name, macro, bytes, size);
    fprintf(stream, "\n#endif\n");
}

int table_file_write_header(const char *path, struct table *self, struct error *out_error)
{
    uint8_t *bytes = NULL;
    size_t size = 0;
    if (table_file_encode(path, self, &bytes, &size, out_error) != error_none)
        return error_refused;
    struct atomic_file file;
    FILE *stream = atomic_file_open(&file, path, out_error);
    if (stream)
        write_header_text(stream, path, self, bytes, size);
    free(bytes);
    return stream ? atomic_file_commit(&file, out_error) : error_refused;
}
