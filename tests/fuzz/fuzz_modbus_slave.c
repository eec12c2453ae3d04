/* SPDX-License-Identifier: MIT */
/// The Modbus slave, RTU and TCP, with the registers and the player behind it, against requests that nobody sane sends.
/// A step is a raw or a nearly good request, some bytes of a stream, a command, or a while in which the drive runs.
/// Invariants: replies are as long as they say and no longer than allowed; nothing is written behind the buffers; the
/// drive is under torque in the states that say so and in no other; a set-point is a finite number.
#include "core/bytes.h"
#include "core/crc32.h"
#include "drivers/modbus/crc16.h"
#include "drivers/modbus/pdu.h"
#include "drivers/modbus/slave_rtu.h"
#include "drivers/modbus/slave_tcp.h"
#include "drivers/modbus/table_player.h"
#include "tests/fuzz/fuzz.h"

enum {
    samples = 16,
    lines = 3,
    kept = 2,
    slave_address = 5,
    table_bytes = msgen_header_bytes + 4 * lines + 6 * samples,
    room_bytes = table_bytes + 64,
    guard_bytes = 16,
    guard = 0xA5
};

static struct table_player player;
static struct modbus_map map;
static struct modbus_rtu_slave rtu;
static struct modbus_tcp_slave tcp;
static uint8_t good_table[table_bytes];
static struct {
    uint8_t table[room_bytes], table_guard[guard_bytes];
    float twiddles[2 * samples];
    uint32_t bins[lines];
    union frf_word transform[FRF_STORAGE_WORDS(lines, table_player_channels)];
    struct frf_pair pairs[lines];
    struct frf_complex kept_values[2 * lines * kept];
    uint32_t kept_reasons[kept];
    struct modbus_record snapshot[lines];
    uint8_t snapshot_guard[guard_bytes];
} room;
static uint64_t now_us;
static double position;

static void make_table(void)
{
    struct msgen_table table = {.rate_num_hz = 1000,
                                .rate_den = 1,
                                .period_samples = samples,
                                .bin_count = lines,
                                .channels = 3,
                                .format = msgen_format_i16,
                                .scale_bits = {0x3A800000u, 0x3A800000u, 0x3A800000u}};
    uint8_t *data = good_table + msgen_header_bytes, *at = data + 4 * lines;
    for (uint32_t b = 0; b < lines; b++)
        core_put_u32(data + 4 * b, b + 1);
    for (int n = 0; n < 3 * samples; n++, at += 2)
        core_put_u16(at, (uint16_t)(n * 37 % 200 - 100));
    table.data_crc32 = core_crc32(0, data, (size_t)(at - data));
    FUZZ_CHECK(msgen_table_encode_header(&table, good_table) == core_ok);
}

static void write_long(uint32_t address, uint32_t value)
{
    const uint16_t words[2] = {(uint16_t)(value >> 16), (uint16_t)value};
    FUZZ_CHECK(modbus_map_write(&map, address, 2, words) == modbus_exception_none);
}

static void begin(void)
{
    const struct table_player_storage storage = {samples,          lines,          kept,       room.twiddles,
                                                 room.bins,        room.transform, room.pairs, room.kept_values,
                                                 room.kept_reasons};
    memset(&room, 0, sizeof room);
    memset(room.table_guard, guard, sizeof room.table_guard);
    memset(room.snapshot_guard, guard, sizeof room.snapshot_guard);
    FUZZ_CHECK(table_player_init(&player, &storage) == core_ok);
    const struct modbus_map_config config = {.device = table_player_device(&player),
                                             .table = room.table,
                                             .table_bytes = room_bytes,
                                             .snapshot = room.snapshot,
                                             .bins_max = lines,
                                             .samples_max = samples,
                                             .periods_kept = kept};
    FUZZ_CHECK(modbus_map_init(&map, &config) == core_ok);
    modbus_rtu_slave_init(&rtu, &map, slave_address, modbus_rtu_timing_of(115200));
    modbus_tcp_slave_init(&tcp, &map);
    if (good_table[0] == 0)
        make_table();
    memcpy(room.table, good_table, table_bytes); // so that VERIFY can be met
    write_long(0x40, table_bytes);
    write_long(0x42, core_get_u32(good_table + msgen_header_bytes - 4));
    write_long(0x4C, 8);
    write_long(0x4E, 8);
    now_us = 0;
    position = 0.0;
}

static void check(void)
{
    for (int i = 0; i < guard_bytes; i++)
        FUZZ_CHECK(room.table_guard[i] == guard && room.snapshot_guard[i] == guard);
}

static void run_drive(unsigned count)
{
    for (unsigned n = 0; n < count; n++) {
        struct table_player_setpoint setpoint;
        table_player_next(&player, &setpoint);
        bool powered = setpoint.control != table_player_off;
        bool may = player.state == modbus_state_armed || player.state == modbus_state_settling ||
                   player.state == modbus_state_running || player.state == modbus_state_stopping;
        FUZZ_CHECK(!powered || may);
        FUZZ_CHECK(setpoint.torque >= -1e6 && setpoint.torque <= 1e6);
        FUZZ_CHECK(setpoint.position >= -1e9 && setpoint.position <= 1e9);
        position += 1e-3 * (setpoint.position - position);
        const struct table_player_sample sample = {setpoint.torque, setpoint.torque, position, setpoint.velocity,
                                                   n % 97 != 96};
        table_player_take(&player, &sample);
        table_player_collect(&player);
    }
}

static void ask(const uint8_t *request, uint32_t size)
{
    struct {
        uint8_t reply[modbus_pdu_max], behind[guard_bytes];
    } out;
    memset(&out, guard, sizeof out);
    uint32_t length = modbus_pdu_answer(&map, true, request, size, out.reply);
    FUZZ_CHECK(length <= modbus_pdu_max && (size == 0 ? length == 0 : length >= 2));
    FUZZ_CHECK(length == 0 || (out.reply[0] & 0x7Fu) == (request[0] & 0x7Fu));
    for (int i = 0; i < guard_bytes; i++)
        FUZZ_CHECK(out.behind[i] == guard);
}

static void put_word(uint8_t *at, uint32_t word)
{
    at[0] = (uint8_t)(word >> 8);
    at[1] = (uint8_t)word;
}

/// An address of a field, or near it.
static uint32_t address_of(const uint8_t *data)
{
    return (uint32_t)modbus_fields[data[0] % modbus_field_count].address + (data[1] % 8 == 0 ? data[2] % 4u : 0u);
}

static void ask_read(const uint8_t *data)
{
    uint8_t request[5] = {data[3] & 1 ? 3 : 4};
    put_word(request + 1, address_of(data));
    put_word(request + 3, data[4] % 130u);
    ask(request, sizeof request);
}

static void ask_write(const uint8_t *data)
{
    uint8_t request[modbus_pdu_max] = {16};
    uint32_t count = data[3] % 4 == 0 ? data[4] % 124u : 1u + data[4] % 4u;
    put_word(request + 1, address_of(data));
    put_word(request + 3, count);
    request[5] = (uint8_t)(2 * count);
    for (uint32_t i = 0; i < 2 * count; i++)
        request[6 + i] = i % 2 == 0 && data[3] % 2 == 0 ? 0 : data[5 + i % 3];
    ask(request, 6 + 2 * count);
}

static void ask_both(const uint8_t *data)
{
    uint8_t request[modbus_pdu_max] = {23};
    uint32_t count = 1u + data[4] % 4u;
    put_word(request + 1, address_of(data + 3));
    put_word(request + 3, data[6] % 126u);
    put_word(request + 5, address_of(data));
    put_word(request + 7, count);
    request[9] = (uint8_t)(2 * count);
    for (uint32_t i = 0; i < 2 * count; i++)
        request[10 + i] = data[i % 8];
    ask(request, 10 + 2 * count);
}

static void give_command(const uint8_t *data)
{
    uint16_t acknowledged = 0;
    FUZZ_CHECK(modbus_map_read(&map, 0x21, 1, &acknowledged) == modbus_exception_none);
    const uint16_t words[3] = {data[0] % 9u, data[1] % 8 == 0 ? data[2] : modbus_key, (uint16_t)(acknowledged + 1u)};
    modbus_map_write(&map, 0x10, 3, words);
}

static void feed_tcp(const uint8_t *data, uint32_t size, bool sound)
{
    static const uint8_t header[7] = {0, 1, 0, 0, 0, 9, 1};
    uint8_t bytes[7 + 8], reply[modbus_tcp_frame_max];
    uint32_t length, count = 0;
    if (sound && tcp.size == 0) {
        memcpy(bytes, header, sizeof header);
        count = sizeof header;
    }
    memcpy(bytes + count, data, size);
    count += size;
    for (uint32_t at = 0; at < count;) {
        uint32_t taken = modbus_tcp_slave_take(&tcp, data[0] & 1, bytes + at, count - at, reply, &length);
        FUZZ_CHECK(taken >= 1 && taken <= count - at && length <= modbus_tcp_frame_max);
        FUZZ_CHECK(length == 0 || length == 6u + ((uint32_t)reply[4] << 8 | reply[5]));
        at += taken;
    }
    if (tcp.broken)
        modbus_tcp_slave_init(&tcp, &map);
}

static void feed_rtu(const uint8_t *data, uint32_t size, bool sound)
{
    uint8_t frame[1 + 8 + 2], reply[modbus_rtu_frame_max];
    uint32_t count = 0;
    frame[count++] = sound ? slave_address : data[0];
    memcpy(frame + count, data, size);
    count += size;
    uint16_t crc = modbus_crc16(frame, count);
    frame[count++] = (uint8_t)crc;
    frame[count++] = (uint8_t)(crc >> 8);
    if (!sound)
        frame[data[1] % count] ^= data[2];
    for (uint32_t i = 0; i < count; i++) {
        now_us += sound ? 90 : data[i % 8] * 20u;
        FUZZ_CHECK(modbus_rtu_slave_poll(&rtu, now_us, reply) <= modbus_rtu_frame_max);
        modbus_rtu_slave_byte(&rtu, frame[i], now_us);
    }
    now_us += 5000;
    uint32_t length = modbus_rtu_slave_poll(&rtu, now_us, reply);
    FUZZ_CHECK(length <= modbus_rtu_frame_max);
    if (length > 0)
        FUZZ_CHECK(length >= 5 && reply[0] == slave_address && modbus_crc16(reply, length) == 0);
}

static void request(const struct fuzz_step *step)
{
    switch (step->what % 8) {
    case 0:
        ask(step->data, step->length);
        break;
    case 1:
    case 2:
        ask_read(step->data);
        break;
    case 3:
    case 4:
        ask_write(step->data);
        break;
    case 5:
    case 6:
        ask_both(step->data);
        break;
    default:
        run_drive(step->data[0]);
        break;
    }
}

static void carry(const struct fuzz_step *step)
{
    bool sound = step->what % 2 == 0;
    switch (step->what % 8) {
    case 0:
    case 1:
        feed_tcp(step->data, step->length ? step->length : 1u, sound);
        break;
    case 2:
    case 3:
        feed_rtu(step->data, step->length, sound);
        break;
    default:
        give_command(step->data);
        break;
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    begin();
    for (; size >= fuzz_step_bytes; data += fuzz_step_bytes, size -= fuzz_step_bytes) {
        const struct fuzz_step step = fuzz_step(data);
        if (step.what & 0x80u)
            request(&step);
        else
            carry(&step);
        check();
    }
    return 0;
}
