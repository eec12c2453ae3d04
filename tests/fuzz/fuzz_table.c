/* SPDX-License-Identifier: MIT */
/// The table loader and its CRC. The first step says how: the bytes as they come, or a good table of which the further
/// steps change bytes, cut off the end or, the first step willing, put both CRCs right again. Changed and not signed
/// again, no table may be accepted; whatever is accepted has to be what the format promises, and plays within its
/// limits.
#include "core/bytes.h"
#include "core/crc32.h"
#include "msgen/player.h"
#include "tests/fuzz/fuzz.h"

enum { room_bytes = 1024, limit = 20000 };

/// A good table; returns its size.
static size_t build(uint8_t what, uint8_t *out_bytes)
{
    struct msgen_table table;
    memset(&table, 0, sizeof table);
    table.channels = 1 + what % 3;
    table.format = (enum msgen_format)(1 + what / 3 % 3);
    table.travel_q30 = table.channels == 3 && (what & 0x40) ? -((int64_t)77 << 30) : 0;
    table.rate_num_hz = 1000;
    table.rate_den = 1;
    table.period_samples = 20;
    table.bin_count = 3;
    table.start_index = what % 20;
    for (uint32_t c = 0; c < table.channels; c++)
        table.scale_bits[c] = 0x3F800000u;
    uint8_t *data = out_bytes + msgen_table_header_bytes(&table);
    uint32_t size = msgen_table_data_bytes(&table);
    for (uint32_t b = 0; b < 3; b++)
        core_put_u32(data + 4 * b, 1 + 3 * b);
    for (uint32_t i = 12; i < size; i++)
        data[i] = (uint8_t)(i * 37 % 120);
    table.data_crc32 = core_crc32(0, data, size);
    FUZZ_CHECK(msgen_table_encode_header(&table, out_bytes) == core_ok);
    return (size_t)(data - out_bytes) + size;
}

static void sign(uint8_t *bytes, size_t size)
{
    size_t header = size > 5 && bytes[4] == 2 ? msgen_header_travel_bytes : msgen_header_bytes;
    if (size < header)
        return;
    core_put_u32(bytes + 48, core_crc32(0, bytes + header, size - header));
    core_put_u32(bytes + header - 4, core_crc32(0, bytes, header - 4));
}

static void check_promises(const struct msgen_table *table, size_t size)
{
    FUZZ_CHECK(table->channels >= 1 && table->channels <= 3);
    FUZZ_CHECK(table->period_samples >= 4 && table->start_index < table->period_samples);
    FUZZ_CHECK(table->rate_num_hz > 0 && table->rate_den > 0);
    FUZZ_CHECK(size == msgen_table_header_bytes(table) + (size_t)msgen_table_data_bytes(table));
    for (uint32_t b = 0, previous = 0; b < table->bin_count; b++) {
        uint32_t bin = msgen_table_bin(table, b);
        FUZZ_CHECK(bin > previous && bin < table->period_samples / 2u + table->period_samples % 2u);
        previous = bin;
    }
    for (uint32_t n = 0; table->format == msgen_format_f32 && n < table->period_samples; n++)
        for (uint32_t c = 0; c < table->channels; c++)
            FUZZ_CHECK(core_float_bits_are_finite(msgen_table_float_bits(table, n, c)));
}

static void play(const struct msgen_table *table, const struct fuzz_step *step)
{
    struct msgen_player player;
    struct msgen_player_config config = {.periods = 1 + step->data[0] % 3,
                                         .fade_in_samples = step->data[1] & 1 ? step->data[2] : 0,
                                         .approach_samples = step->data[1] & 2 ? step->data[3] : 0,
                                         .dwell_samples = step->data[4] % 16,
                                         .fade_out_samples = step->data[5] % 64,
                                         .abort_samples = step->data[6] % 64,
                                         .limit = {limit, limit, limit}};
    if (table->format == msgen_format_f32) {
        float out[3];
        if (msgen_player_init_f32(&player, table, &config) != core_ok)
            return;
        for (unsigned n = 0; n < 200; n++)
            msgen_player_step_f32(&player, out);
        return;
    }
    if (msgen_player_init(&player, table, &config) != core_ok)
        return;
    for (unsigned n = 0; n < 200; n++) {
        int32_t out[3] = {0};
        struct msgen_player_state state = msgen_player_step(&player, out);
        FUZZ_CHECK(state.index < table->period_samples && state.period < config.periods);
        for (unsigned c = 0; c < table->channels; c++)
            FUZZ_CHECK(out[c] >= -limit && out[c] <= limit);
        if (n == step->data[7])
            msgen_player_abort(&player);
    }
}

static void check_crc(const uint8_t *data, size_t size)
{
    size_t cut = size > 0 ? data[0] % (size + 1) : 0;
    FUZZ_CHECK(core_crc32(core_crc32(0, data, cut), data + cut, size - cut) == core_crc32(0, data, size));
}

/// Changes bytes of a good table, step by step; returns how long it is then.
static size_t change(const uint8_t *data, size_t size, uint8_t *io_bytes, size_t whole)
{
    size_t length = whole;
    for (size_t at = 0; at + fuzz_step_bytes <= size; at += fuzz_step_bytes) {
        struct fuzz_step step = fuzz_step(data + at);
        size_t offset = (step.what & 1) ? step.data[0] % 72 : core_get_u16(step.data) % whole;
        if (step.what % 16 == 2)
            length = offset;
        else
            for (unsigned b = 0; b < step.length && offset + b < whole && b < (step.what >> 4) % 5u; b++)
                io_bytes[offset + b] = step.data[2 + b];
    }
    return length;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    uint8_t bytes[room_bytes], original[room_bytes];
    struct msgen_table table;
    check_crc(data, size);
    if (size < fuzz_step_bytes)
        return 0;
    struct fuzz_step first = fuzz_step(data);
    bool as_they_come = first.what % 8 == 0, signs = first.what & 0x80;
    size_t whole = build(first.data[0], bytes), length = whole;
    memcpy(original, bytes, whole);
    if (as_they_come) {
        length = size - fuzz_step_bytes < room_bytes ? size - fuzz_step_bytes : room_bytes;
        memcpy(bytes, data + fuzz_step_bytes, length);
    }
    if (!as_they_come)
        length = change(data + fuzz_step_bytes, size - fuzz_step_bytes, bytes, whole);
    if (signs && !as_they_come)
        sign(bytes, length);
    /* A copy of the exact size, so that a sanitizer sees any read behind it. */
    uint8_t *copy = malloc(length ? length : 1);
    FUZZ_CHECK(copy);
    memcpy(copy, bytes, length);
    if (msgen_table_open(copy, length, &table) == core_ok) {
        FUZZ_CHECK(as_they_come || signs || (length == whole && memcmp(bytes, original, whole) == 0));
        check_promises(&table, length);
        play(&table, &first);
    } else {
        FUZZ_CHECK(table.fault_offset <= (length > 72 ? length : 72));
    }
    free(copy);
    return 0;
}
