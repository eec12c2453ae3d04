/* SPDX-License-Identifier: MIT */
/* Any bytes as a table: nothing is read beyond them. Eva knows ranges, not how the length depends on the header's
 * numbers, so the header is taken apart into cases: those numbers one by one where they could fit, and all others at
 * once, which have to be refused without help. Together they are all there are, for each length that is tried. */
#include "tests/frama-c/any.h"

#include "core/bytes.h"
#include "msgen/table.h"

enum {
    bytes_max = 84,                         /* four samples in two channels of 16 bits, one bin, and travel */
    least_bytes = msgen_header_bytes + 12u, /* four samples in one channel, one bin */
    offset_version = 4,
    offset_channels = 6,
    offset_format = 7,
    offset_samples = 16,
    offset_bin_count = 20,
};

/* The table ends where this ends. */
static uint8_t memory[bytes_max];
static struct msgen_table table;

static void open(uint8_t *bytes, uint32_t size)
{
    if (msgen_table_open(bytes, size, &table) == core_ok) {
        uint8_t header[msgen_header_travel_bytes];
        msgen_table_encode_header(&table, header);
    }
}

static void open_version(uint8_t *bytes, uint32_t size, uint8_t low, uint8_t high)
{
    bytes[offset_version] = low;
    bytes[offset_version + 1] = high;
    open(bytes, size);
}

/* Any number from `least`, at most 255, in four cases: Eva keeps bytes, so of a number put into them only what each
 * byte is by itself. */
static void put_at_least(uint8_t *field, uint32_t least, uint32_t high_byte)
{
    for (uint32_t i = 0; i < 4; ++i) {
        field[i] = high_byte == 0 ? 0 : any_u8();
    }
    field[high_byte] = (uint8_t)any_between(high_byte == 0 ? least : 1, UINT8_MAX);
}

static void open_as(uint32_t size, uint8_t channels, uint8_t format, uint32_t samples, uint32_t bin_count)
{
    uint8_t *bytes = memory + bytes_max - size;
    bytes[offset_channels] = channels;
    bytes[offset_format] = format;
    core_put_u32(bytes + offset_samples, samples);
    core_put_u32(bytes + offset_bin_count, bin_count);
    open(bytes, size);
}

static void open_all(uint32_t size)
{
    uint8_t *bytes = memory + bytes_max - size;
    open_as(size, 0, any_u8(), any_u32(), any_u32());
    open_as(size, (uint8_t)any_between(msgen_channels_max + 1, UINT8_MAX), any_u8(), any_u32(), any_u32());
    open_as(size, any_u8(), 0, any_u32(), any_u32());
    open_as(size, any_u8(), (uint8_t)any_between(msgen_format_f32 + 1, UINT8_MAX), any_u32(), any_u32());
    for (uint8_t channels = 1; channels <= msgen_channels_max; ++channels) {
        for (uint8_t format = msgen_format_i16; format <= msgen_format_f32; ++format) {
            uint32_t frame_bytes = channels * msgen_format_bytes((enum msgen_format)format);
            uint32_t too_many = (size - msgen_header_bytes - 4u) / frame_bytes + 1u;
            too_many = too_many > 4u ? too_many : 4u;
            open_as(size, channels, format, any_between(0, 3), any_u32());
            for (uint32_t high_byte = 0; high_byte < 4; ++high_byte) {
                put_at_least(bytes + offset_samples, too_many, high_byte);
                open(bytes, size);
            }
            for (uint32_t samples = 4; samples < too_many; ++samples) {
                uint32_t bins_max = (samples - 1u) / 2u;
                open_as(size, channels, format, samples, 0);
                for (uint32_t high_byte = 0; high_byte < 4; ++high_byte) {
                    put_at_least(bytes + offset_bin_count, bins_max + 1u, high_byte);
                    open(bytes, size);
                }
                for (uint32_t bin_count = 1; bin_count <= bins_max; ++bin_count) {
                    open_as(size, channels, format, samples, bin_count);
                }
            }
        }
    }
}

static void forget(void)
{
    for (uint32_t i = 0; i < bytes_max; ++i) {
        memory[i] = any_u8();
    }
}

int main(void)
{
    for (uint32_t size = 0; size < msgen_header_bytes; ++size) {
        forget();
        open(memory + bytes_max - size, size);
    }
    static const uint32_t sizes[] = {56, 60, 63, 64, 67, least_bytes, 70, 72, bytes_max};
    for (uint32_t i = 0; i < sizeof sizes / sizeof *sizes; ++i) {
        uint8_t *bytes = memory + bytes_max - sizes[i];
        forget();
        open_version(bytes, sizes[i], 0, 0);
        open_version(bytes, sizes[i], (uint8_t)any_between(msgen_table_version_travel + 1, UINT8_MAX), 0);
        open_version(bytes, sizes[i], any_u8(), (uint8_t)any_between(1, UINT8_MAX));
        for (uint8_t v = msgen_table_version; v <= msgen_table_version_travel; ++v) {
            forget();
            if (sizes[i] < least_bytes) {
                open_version(bytes, sizes[i], v, 0);
            } else if (sizes[i] < bytes_max || v == msgen_table_version_travel) {
                bytes[offset_version] = v;
                bytes[offset_version + 1] = 0;
                open_all(sizes[i]);
            }
        }
    }
    return 0;
}
