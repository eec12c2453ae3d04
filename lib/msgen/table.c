/* SPDX-License-Identifier: MIT */
#include "msgen/table.h"

#include "core/bytes.h"
#include "core/crc32.h"

enum {
    offset_magic = 0,
    offset_version = 4,
    offset_channels = 6,
    offset_format = 7,
    offset_rate_num = 8,
    offset_rate_den = 12,
    offset_samples = 16,
    offset_bin_count = 20,
    offset_start = 24,
    offset_unit = 28,
    offset_scale = 32,
    offset_data_bytes = 44,
    offset_data_crc = 48,
    offset_header_crc = 52, /* version 1; the last 4 bytes of the header in either */
    offset_travel = 52,     /* version 2 */
};

static const uint8_t magic[4] = {'M', 'S', 'T', 0x1A};

/* 4 K < 2 N and 12 N at most: below 2^21 + 12 * 2^20 */
CORE_STATIC_ASSERT(SERVOSCOPE_TABLE_SAMPLES_MAX <= 0xFFFFFFFFu / 16u, data_length_fits_32_bits);
CORE_STATIC_ASSERT(offset_header_crc + 4 == msgen_header_bytes, header_ends_with_its_crc);
CORE_STATIC_ASSERT(offset_travel + 8 + 4 == msgen_header_travel_bytes, header_with_travel_ends_with_its_crc);

/* 2^31 counts: more than the integer player can put out. */
static const uint64_t travel_max_q30 = (uint64_t)1 << 61;

uint32_t msgen_format_bytes(enum msgen_format format)
{
    switch (format) {
    case msgen_format_i16:
        return 2;
    case msgen_format_i32:
    case msgen_format_f32:
        return 4;
    default:
        return 0;
    }
}

uint32_t msgen_table_data_bytes(const struct msgen_table *self)
{
    return 4u * self->bin_count + self->period_samples * self->channels * msgen_format_bytes(self->format);
}

uint32_t msgen_table_header_bytes(const struct msgen_table *self)
{
    return self->travel_q30 != 0 ? msgen_header_travel_bytes : msgen_header_bytes;
}

uint32_t msgen_table_bin(const struct msgen_table *self, uint32_t index)
{
    return core_get_u32(self->bins + 4u * (size_t)index);
}

int32_t msgen_table_count(const struct msgen_table *self, uint32_t n, uint32_t channel)
{
    size_t index = (size_t)n * self->channels + channel;
    if (self->format == msgen_format_i16) {
        return core_get_i16(self->samples + 2u * index);
    }
    return core_get_i32(self->samples + 4u * index);
}

uint32_t msgen_table_float_bits(const struct msgen_table *self, uint32_t n, uint32_t channel)
{
    return core_get_u32(self->samples + 4u * ((size_t)n * self->channels + channel));
}

/* Positive and normal: a denormal scale would lose the digits that the format promises. */
static bool scale_is_usable(uint32_t bits)
{
    return bits >= 0x00800000u && bits < 0x7F800000u;
}

/* Two's complement as an unsigned number: the magnitude of the most negative value too. */
static uint64_t magnitude_of(int64_t value)
{
    return value < 0 ? (uint64_t)0 - (uint64_t)value : (uint64_t)value;
}

static bool travel_is_usable(const struct msgen_table *table)
{
    return table->travel_q30 == 0 ||
           (table->channels > msgen_channel_position && magnitude_of(table->travel_q30) <= travel_max_q30);
}

static enum core_status check_scales(const struct msgen_table *table, uint32_t *out_offset)
{
    for (uint32_t c = 0; c < msgen_channels_max; ++c) {
        *out_offset = offset_scale + 4u * c;
        if (c >= table->channels) {
            if (table->scale_bits[c] != 0) {
                return core_err_table_reserved;
            }
        } else if (!scale_is_usable(table->scale_bits[c])) {
            return core_err_table_scale;
        }
    }
    return core_ok;
}

/* The fields of the header that can be judged without the data, in the order in which they lie. */
static enum core_status check_fields(const struct msgen_table *table, uint32_t *out_offset)
{
    *out_offset = offset_channels;
    if (table->channels < 1 || table->channels > msgen_channels_max) {
        return core_err_table_channels;
    }
    *out_offset = offset_format;
    if (msgen_format_bytes(table->format) == 0) {
        return core_err_table_format;
    }
    *out_offset = table->rate_num_hz == 0 ? offset_rate_num : offset_rate_den;
    if (table->rate_num_hz == 0 || table->rate_den == 0) {
        return core_err_table_rate;
    }
    *out_offset = offset_samples;
    if (table->period_samples < 4 || table->period_samples > SERVOSCOPE_TABLE_SAMPLES_MAX) {
        return core_err_table_samples;
    }
    *out_offset = offset_bin_count;
    /* (N - 1) / 2 bins lie in 1 .. below N/2 */
    if (table->bin_count < 1 || table->bin_count > (table->period_samples - 1u) / 2u) {
        return core_err_table_bin_count;
    }
    *out_offset = offset_start;
    if (table->start_index >= table->period_samples) {
        return core_err_table_start;
    }
    enum core_status status = check_scales(table, out_offset);
    if (status != core_ok) {
        return status;
    }
    *out_offset = offset_travel;
    return travel_is_usable(table) ? core_ok : core_err_table_travel;
}

static enum core_status check_bins(const struct msgen_table *table, uint32_t *out_offset)
{
    uint32_t previous = 0;
    for (uint32_t i = 0; i < table->bin_count; ++i) {
        uint32_t bin = msgen_table_bin(table, i);
        *out_offset = msgen_table_header_bytes(table) + 4u * i;
        if (bin <= previous) {
            return core_err_table_bin_order;
        }
        if (bin > (table->period_samples - 1u) / 2u) {
            return core_err_table_bin_range;
        }
        previous = bin;
    }
    return core_ok;
}

static enum core_status check_samples(const struct msgen_table *table, uint32_t *out_offset)
{
    if (table->format != msgen_format_f32) {
        return core_ok;
    }
    uint32_t count = table->period_samples * table->channels;
    for (uint32_t i = 0; i < count; ++i) {
        if (!core_float_bits_are_finite(core_get_u32(table->samples + 4u * (size_t)i))) {
            *out_offset = msgen_table_header_bytes(table) + 4u * table->bin_count + 4u * i;
            return core_err_table_sample;
        }
    }
    return core_ok;
}

/* Two's complement; the conversion of a value above the signed maximum is implementation-defined in C99. */
static int64_t get_travel(const uint8_t *bytes)
{
    uint64_t bits = core_get_u32(bytes + offset_travel) | (uint64_t)core_get_u32(bytes + offset_travel + 4u) << 32;
    static const uint64_t sign = (uint64_t)1 << 63;
    return bits < sign ? (int64_t)bits : -(int64_t)~bits - 1;
}

static enum core_status check_envelope(const uint8_t *bytes, size_t size, uint32_t *out_offset)
{
    for (uint32_t i = 0; i < sizeof magic; ++i) {
        if (i < size && bytes[i] != magic[i]) {
            *out_offset = offset_magic;
            return core_err_table_magic;
        }
    }
    *out_offset = (uint32_t)(size < msgen_header_bytes ? size : 0);
    if (size < msgen_header_bytes) {
        return core_err_table_truncated;
    }
    uint32_t version = core_get_u16(bytes + offset_version);
    *out_offset = offset_version;
    if (version != msgen_table_version && version != msgen_table_version_travel) {
        return core_err_table_version;
    }
    uint32_t header_bytes = version == msgen_table_version ? msgen_header_bytes : msgen_header_travel_bytes;
    *out_offset = (uint32_t)(size < header_bytes ? size : header_bytes - 4u);
    if (size < header_bytes) {
        return core_err_table_truncated;
    }
    if (core_get_u32(bytes + header_bytes - 4u) != core_crc32(0, bytes, header_bytes - 4u)) {
        return core_err_table_header_crc;
    }
    *out_offset = offset_travel;
    if (version == msgen_table_version_travel && get_travel(bytes) == 0) {
        return core_err_table_travel;
    }
    *out_offset = offset_unit;
    return core_get_u32(bytes + offset_unit) <= 1u ? core_ok : core_err_table_unit;
}

static void decode_header(const uint8_t *bytes, struct msgen_table *out_table)
{
    out_table->channels = bytes[offset_channels];
    out_table->format = (enum msgen_format)bytes[offset_format];
    out_table->rate_num_hz = core_get_u32(bytes + offset_rate_num);
    out_table->rate_den = core_get_u32(bytes + offset_rate_den);
    out_table->period_samples = core_get_u32(bytes + offset_samples);
    out_table->bin_count = core_get_u32(bytes + offset_bin_count);
    out_table->start_index = core_get_u32(bytes + offset_start);
    out_table->linear = core_get_u32(bytes + offset_unit) == 1u;
    for (uint32_t c = 0; c < msgen_channels_max; ++c) {
        out_table->scale_bits[c] = core_get_u32(bytes + offset_scale + 4u * c);
    }
    out_table->data_crc32 = core_get_u32(bytes + offset_data_crc);
    bool travels = core_get_u16(bytes + offset_version) == msgen_table_version_travel;
    out_table->travel_q30 = travels ? get_travel(bytes) : 0;
    out_table->header_crc32 = core_get_u32(bytes + msgen_table_header_bytes(out_table) - 4u);
}

enum core_status msgen_table_open(const uint8_t *bytes, size_t size, struct msgen_table *out_table)
{
    if (!bytes || !out_table) {
        return core_err_argument;
    }
    enum core_status status = check_envelope(bytes, size, &out_table->fault_offset);
    if (status != core_ok) {
        return status;
    }
    decode_header(bytes, out_table);
    status = check_fields(out_table, &out_table->fault_offset);
    if (status != core_ok) {
        return status;
    }
    uint32_t data_bytes = msgen_table_data_bytes(out_table);
    out_table->fault_offset = offset_data_bytes;
    if (core_get_u32(bytes + offset_data_bytes) != data_bytes) {
        return core_err_table_size;
    }
    uint32_t header_bytes = msgen_table_header_bytes(out_table);
    if (size - header_bytes != data_bytes) {
        bool is_short = size - header_bytes < data_bytes;
        out_table->fault_offset = is_short ? (uint32_t)size : header_bytes + data_bytes;
        return is_short ? core_err_table_truncated : core_err_table_trailing;
    }
    out_table->bins = bytes + header_bytes;
    out_table->samples = out_table->bins + 4u * (size_t)out_table->bin_count;
    out_table->fault_offset = offset_data_crc;
    if (core_crc32(0, out_table->bins, data_bytes) != out_table->data_crc32) {
        return core_err_table_data_crc;
    }
    status = check_bins(out_table, &out_table->fault_offset);
    if (status != core_ok) {
        return status;
    }
    return check_samples(out_table, &out_table->fault_offset);
}

enum core_status msgen_table_encode_header(const struct msgen_table *self, uint8_t *out_bytes)
{
    if (!self || !out_bytes) {
        return core_err_argument;
    }
    uint32_t offset;
    enum core_status status = check_fields(self, &offset);
    if (status != core_ok) {
        return status;
    }
    for (uint32_t i = 0; i < sizeof magic; ++i) {
        out_bytes[i] = magic[i];
    }
    core_put_u16(out_bytes + offset_version, self->travel_q30 ? msgen_table_version_travel : msgen_table_version);
    out_bytes[offset_channels] = (uint8_t)self->channels;
    out_bytes[offset_format] = (uint8_t)self->format;
    core_put_u32(out_bytes + offset_rate_num, self->rate_num_hz);
    core_put_u32(out_bytes + offset_rate_den, self->rate_den);
    core_put_u32(out_bytes + offset_samples, self->period_samples);
    core_put_u32(out_bytes + offset_bin_count, self->bin_count);
    core_put_u32(out_bytes + offset_start, self->start_index);
    core_put_u32(out_bytes + offset_unit, self->linear ? 1u : 0u);
    for (uint32_t c = 0; c < msgen_channels_max; ++c) {
        core_put_u32(out_bytes + offset_scale + 4u * c, self->scale_bits[c]);
    }
    core_put_u32(out_bytes + offset_data_bytes, msgen_table_data_bytes(self));
    core_put_u32(out_bytes + offset_data_crc, self->data_crc32);
    if (self->travel_q30 != 0) {
        core_put_u32(out_bytes + offset_travel, (uint32_t)((uint64_t)self->travel_q30 & 0xFFFFFFFFu));
        core_put_u32(out_bytes + offset_travel + 4u, (uint32_t)((uint64_t)self->travel_q30 >> 32));
    }
    uint32_t crc_offset = msgen_table_header_bytes(self) - 4u;
    core_put_u32(out_bytes + crc_offset, core_crc32(0, out_bytes, crc_offset));
    return core_ok;
}
