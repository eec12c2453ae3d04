/* SPDX-License-Identifier: MIT */
/* Any bytes of any length up to eighty as a table: nothing beyond them is read. Eva knows ranges, not how the length
 * depends on the header's numbers, so the header is taken apart into cases: those numbers one by one where they could
 * fit, and any others at once, which it has to refuse. Together they are all there are. */
#include "tests/frama-c/any.h"

#include "core/bytes.h"
#include "msgen/table.h"

enum {
    bytes_max = 80,
    samples_fit = (bytes_max - msgen_header_bytes) / 2, /* in one channel of 16 bits, and not even a bin beside them */
    formats = 3,
    offset_channels = 6,
    offset_format = 7,
    offset_samples = 16,
    offset_bin_count = 20,
};

static uint8_t bytes[bytes_max];
static struct msgen_table table;

static void open(uint8_t channels, uint8_t format, uint32_t samples, uint32_t bin_count)
{
    bytes[offset_channels] = channels;
    bytes[offset_format] = format;
    core_put_u32(bytes + offset_samples, samples);
    core_put_u32(bytes + offset_bin_count, bin_count);
    if (msgen_table_open(bytes, any_between(0, bytes_max), &table) == core_ok) {
        uint8_t header[msgen_header_travel_bytes];
        msgen_table_encode_header(&table, header);
    }
    //@ slevel merge;
}

int main(void)
{
    for (uint32_t i = 0; i < bytes_max; ++i) {
        bytes[i] = any_u8();
    }
    open(0, any_u8(), any_u32(), any_u32());
    open((uint8_t)any_between(msgen_channels_max + 1, UINT8_MAX), any_u8(), any_u32(), any_u32());
    open(any_u8(), (uint8_t)any_between(formats, UINT8_MAX), any_u32(), any_u32());
    for (uint8_t channels = 1; channels <= msgen_channels_max; ++channels) {
        for (uint8_t format = 0; format < formats; ++format) {
            open(channels, format, any_between(0, 3), any_u32());
            open(channels, format, any_between(samples_fit, UINT32_MAX), any_u32());
            for (uint32_t samples = 4; samples < samples_fit; ++samples) {
                open(channels, format, samples, 0);
                open(channels, format, samples, any_between((samples + 1u) / 2u, UINT32_MAX));
                for (uint32_t bin_count = 1; bin_count < (samples + 1u) / 2u; ++bin_count) {
                    open(channels, format, samples, bin_count);
                }
            }
        }
    }
    return 0;
}
