/* SPDX-License-Identifier: MIT */
/// The register map: addresses and access, whole and half numbers, every command in every state, windows, repetition,
/// and that docs/modbus.md lists the registers that the code has.
#include "tests/support/modbus_bench.h"

#include <stdio.h>

static struct modbus_map *map;
static struct modbus_host host;

void setUp(void)
{
    bench_begin();
    map = &bench_drive->map;
}

void tearDown(void)
{
    bench_end();
}

static enum modbus_exception write_words(uint32_t address, uint32_t count, const uint16_t *words)
{
    return modbus_map_write(map, address, count, words);
}

static enum modbus_exception write_word(uint32_t address, uint16_t word)
{
    return write_words(address, 1, &word);
}

static uint16_t read_word(uint32_t address)
{
    uint16_t word = 0xDEAD;
    TEST_ASSERT_EQUAL_INT(modbus_exception_none, modbus_map_read(map, address, 1, &word));
    return word;
}

static uint32_t read_long(uint32_t address)
{
    uint16_t words[2];
    TEST_ASSERT_EQUAL_INT(modbus_exception_none, modbus_map_read(map, address, 2, words));
    return (uint32_t)words[0] << 16 | words[1];
}

static uint16_t next_sequence;

static enum modbus_exception command(uint16_t code, uint16_t key)
{
    const uint16_t words[3] = {code, key, ++next_sequence};
    return write_words(0x10, 3, words);
}

static void test_modbus_map_fields_ascend_without_overlap(void)
{
    for (unsigned i = 1; i < modbus_field_count; i++) {
        const struct modbus_field *before = &modbus_fields[i - 1], *here = &modbus_fields[i];
        TEST_ASSERT_TRUE_MESSAGE(here->address >= before->address + before->words, here->name);
        TEST_ASSERT_TRUE(here->words == (here->kind == modbus_u16 ? 1 : 2) || here->kind == modbus_window);
    }
}

static void test_modbus_map_identifies_itself_high_word_first(void)
{
    TEST_ASSERT_EQUAL_HEX16(0x4D53, read_word(0));
    TEST_ASSERT_EQUAL_HEX16(0x0102, read_word(2));
    TEST_ASSERT_EQUAL_HEX16(0x0304, read_word(3));
    TEST_ASSERT_EQUAL_HEX32(0x3F800000, read_long(4));
    TEST_ASSERT_EQUAL_UINT32(modbus_drive_table_bytes, read_long(8));
    TEST_ASSERT_EQUAL_UINT32(modbus_drive_samples_max, read_long(10));
}

/// Every address: readable where a field is, exception 02 elsewhere; a write there is 02 unless a field takes it.
static void test_modbus_map_answers_every_address(void)
{
    static bool mapped[0x10000], writable[0x10000];
    memset(mapped, 0, sizeof mapped);
    memset(writable, 0, sizeof writable);
    for (unsigned i = 0; i < modbus_field_count; i++)
        for (unsigned w = 0; w < modbus_fields[i].words; w++) {
            mapped[modbus_fields[i].address + w] = true;
            writable[modbus_fields[i].address + w] = modbus_fields[i].access != modbus_read_only;
        }
    for (uint32_t address = 0; address < 0x10000; address++) {
        uint16_t word = 0;
        enum modbus_exception read = modbus_map_read(map, address, 1, &word);
        TEST_ASSERT_EQUAL_INT(mapped[address] ? modbus_exception_none : modbus_exception_address, read);
        if (!writable[address])
            TEST_ASSERT_EQUAL_INT(modbus_exception_address, write_word(address, 0));
    }
    uint16_t words[2];
    TEST_ASSERT_EQUAL_INT(modbus_exception_address, modbus_map_read(map, 0xFFFF, 2, words));
    TEST_ASSERT_EQUAL_INT(modbus_exception_address, modbus_map_read(map, 0x12, 2, words)); // runs into a hole
}

static void test_modbus_map_takes_no_half_number(void)
{
    const uint16_t words[4] = {0, 3, 0, 7};
    TEST_ASSERT_EQUAL_INT(modbus_exception_value, write_words(0x48, 1, words));
    TEST_ASSERT_EQUAL_INT(modbus_exception_value, write_words(0x49, 1, words));
    TEST_ASSERT_EQUAL_INT(modbus_exception_value, write_words(0x49, 3, words));
    TEST_ASSERT_EQUAL_INT(modbus_exception_value, write_words(0x48, 3, words));
    TEST_ASSERT_EQUAL_UINT32(1, read_long(0x48));
    TEST_ASSERT_EQUAL_INT(modbus_exception_none, write_words(0x48, 4, words));
    TEST_ASSERT_EQUAL_UINT32(3, read_long(0x48));
    TEST_ASSERT_EQUAL_UINT32(7, read_long(0x4A));
}

/// All or nothing: a good value beside a bad one is not taken either.
static void test_modbus_map_refuses_values_out_of_range(void)
{
    static const struct {
        uint32_t address;
        uint16_t words[2];
        uint32_t count;
    } bad[] = {
        {0x44, {2, 0}, 1},      // MODE
        {0x45, {4, 0}, 1},      // INPUT
        {0x4A, {0, 0}, 2},      // MEASURE_PERIODS 0
        {0x4A, {0xFFFF, 0}, 2}, // too many
        {0x4E, {0, 0}, 2},      // ABORT_SAMPLES 0
        {0x50, {0x7FC0, 0}, 2}, // NaN
        {0x50, {0x7F80, 0}, 2}, // infinity
        {0x50, {0xBF80, 0}, 2}, // -1 as a torque limit
        {0x54, {0xFF80, 0}, 2}, // -infinity
    };
    for (unsigned i = 0; i < sizeof bad / sizeof bad[0]; i++)
        TEST_ASSERT_EQUAL_INT(modbus_exception_value, write_words(bad[i].address, bad[i].count, bad[i].words));
    const uint16_t mixed[2] = {1, 9};
    TEST_ASSERT_EQUAL_INT(modbus_exception_value, write_words(0x44, 2, mixed));
    TEST_ASSERT_EQUAL_UINT16(0, read_word(0x44));
}

static void test_modbus_map_takes_a_command_only_whole(void)
{
    const uint16_t words[3] = {1, 0, 77};
    TEST_ASSERT_EQUAL_INT(modbus_exception_value, write_words(0x10, 1, words));
    TEST_ASSERT_EQUAL_INT(modbus_exception_value, write_words(0x10, 2, words));
    TEST_ASSERT_EQUAL_INT(modbus_exception_value, write_words(0x12, 1, words + 2));
    TEST_ASSERT_EQUAL_UINT16(0, read_word(0x20));
    TEST_ASSERT_EQUAL_INT(modbus_exception_none, write_words(0x10, 3, words));
    TEST_ASSERT_EQUAL_UINT16(77, read_word(0x21));
    TEST_ASSERT_EQUAL_UINT16(modbus_state_uploading, read_word(0x20));
}

// ---- Every command in every state

enum place {
    at_idle,
    at_uploading,
    at_verified,
    at_armed,
    at_settling,
    at_running,
    at_stopping,
    at_done,
    at_fault,
    places
};
static const enum modbus_state state_at[places] = {modbus_state_idle,     modbus_state_uploading, modbus_state_verified,
                                                   modbus_state_armed,    modbus_state_settling,  modbus_state_running,
                                                   modbus_state_stopping, modbus_state_done,      modbus_state_fault};

static void go_to(enum place place)
{
    struct modbus_host_setup setup = bench_setup(1, 3);
    setup.run.host_timeout_ms = 0;
    bench_end();
    bench_begin();
    map = &bench_drive->map;
    if (place == at_idle)
        return;
    TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_open(&host, &bench_link, 1));
    if (place == at_uploading) {
        TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_command(&host, modbus_command_open_upload));
        return;
    }
    TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_upload(&host, bench_table, &setup, NULL, NULL));
    if (place > at_verified)
        TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_command(&host, modbus_command_arm));
    if (place > at_armed) {
        TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_command(&host, modbus_command_start));
        bench_run(setup.run.fade_samples / 2);
    }
    if (place == at_running)
        bench_run(setup.run.fade_samples / 2 + bench_samples + 10);
    if (place == at_stopping) {
        TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_command(&host, modbus_command_stop));
        bench_run(3);
    }
    if (place == at_done)
        bench_run(10 * bench_samples);
    if (place == at_fault) {
        table_player_fail(&bench_drive->player, modbus_fault_drive, 1.0);
        bench_run((uint32_t)(table_player_quick_stop_s * bench_rate) + 2);
    }
}

static void test_modbus_map_obeys_each_command_in_its_states_only(void)
{
    // Where each command leads, after two samples for the sample path to take notice; -1: refused.
    enum { no = -1, idle = 0, up = 1, ver = 2, arm = 3, set = 4, run = 5, stp = 7 };
    static const int leads_to[8][places] = {
        //                idle  upl  ver  arm  set  run  stop done fault
        /* none        */ {no, no, no, no, no, no, no, no, no},
        /* OPEN_UPLOAD */ {up, up, up, no, no, no, no, up, no},
        /* VERIFY      */ {no, no, ver, no, no, no, no, ver, no},
        /* ARM         */ {no, no, arm, no, no, no, no, no, no},
        /* START       */ {no, no, no, set, no, no, no, no, no},
        /* STOP        */ {no, no, no, ver, stp, stp, stp, no, no},
        /* ABORT       */ {no, no, no, stp, stp, stp, stp, no, no},
        /* RESET_FAULT */ {no, no, no, no, no, no, no, no, up},
    };
    for (uint16_t code = 0; code < 9; code++)
        for (int place = 0; place < places; place++) {
            char message[64];
            int expected = code < 8 ? leads_to[code][place] : no;
            go_to((enum place)place);
            snprintf(message, sizeof message, "command %u in state %u", (unsigned)code, (unsigned)state_at[place]);
            TEST_ASSERT_EQUAL_INT_MESSAGE(state_at[place], read_word(0x20), message);
            next_sequence = read_word(0x21);
            enum modbus_exception exception = command(code, modbus_key);
            TEST_ASSERT_EQUAL_INT_MESSAGE(expected == no ? modbus_exception_value : modbus_exception_none, exception,
                                          message);
            bench_run(2);
            // VERIFY without a table fails, but has opened the upload.
            bool emptied = code == modbus_command_verify && (place == at_idle || place == at_uploading);
            int after = emptied ? up : expected == no ? (int)state_at[place] : expected;
            TEST_ASSERT_EQUAL_INT_MESSAGE(after, read_word(0x20), message);
            TEST_ASSERT_EQUAL_UINT16(next_sequence, read_word(0x21));
            TEST_ASSERT_EQUAL_INT(expected == no, read_word(0x22) != 0);
        }
}

static void test_modbus_map_writes_setup_at_rest_only(void)
{
    for (int place = 0; place < places; place++) {
        go_to((enum place)place);
        bool at_rest = place <= at_verified || place == at_done;
        uint16_t words[2] = {0, 5};
        TEST_ASSERT_EQUAL_INT(at_rest ? modbus_exception_none : modbus_exception_value, write_words(0x4A, 2, words));
        int after = !at_rest ? (int)state_at[place] : place == at_idle ? modbus_state_idle : modbus_state_uploading;
        TEST_ASSERT_EQUAL_INT(after, read_word(0x20));
        const uint16_t chunk[3] = {0, 0, 0x1234};
        TEST_ASSERT_EQUAL_INT(after == modbus_state_uploading ? modbus_exception_none : modbus_exception_value,
                              write_words(0x100, 3, chunk));
    }
}

static void test_modbus_map_needs_the_key_to_move(void)
{
    static const uint16_t keys[] = {0, 0xA5A4, 0x5A5A, 0xFFFF};
    for (unsigned i = 0; i < 4; i++) {
        go_to(at_verified);
        next_sequence = read_word(0x21);
        TEST_ASSERT_EQUAL_INT(modbus_exception_value, command(modbus_command_arm, keys[i]));
        TEST_ASSERT_EQUAL_UINT16(modbus_result_key, read_word(0x22));
        TEST_ASSERT_EQUAL_UINT16(modbus_state_verified, read_word(0x20));
    }
}

/// The same sequence number is the same command: its outcome is repeated, it is not.
static void test_modbus_map_executes_a_repeated_command_once(void)
{
    go_to(at_verified);
    const uint16_t words[3] = {modbus_command_arm, modbus_key, (uint16_t)(read_word(0x21) + 1)};
    TEST_ASSERT_EQUAL_INT(modbus_exception_none, write_words(0x10, 3, words));
    TEST_ASSERT_EQUAL_INT(modbus_exception_none, write_words(0x10, 3, words)); // would be refused in armed
    const uint16_t wrong[3] = {modbus_command_arm, modbus_key, (uint16_t)(words[2] + 1)};
    TEST_ASSERT_EQUAL_INT(modbus_exception_value, write_words(0x10, 3, wrong));
    TEST_ASSERT_EQUAL_INT(modbus_exception_value, write_words(0x10, 3, wrong));
    TEST_ASSERT_EQUAL_UINT16(modbus_state_armed, read_word(0x20));
}

static void test_modbus_map_uploads_in_any_order_and_twice(void)
{
    go_to(at_uploading);
    const uint32_t words = bench_bytes / 2, chunk = 50;
    for (int round = 0; round < 2; round++)
        for (uint32_t i = 0; i < (words + chunk - 1) / chunk; i++) {
            uint32_t piece = (words + chunk - 1) / chunk - 1 - i, offset = piece * chunk; // last first
            uint32_t count = words - offset < chunk ? words - offset : chunk;
            uint16_t request[2 + 50] = {(uint16_t)(offset >> 16), (uint16_t)offset};
            for (uint32_t w = 0; w < count; w++)
                request[2 + w] = (uint16_t)(bench_table[2 * (offset + w)] << 8 | bench_table[2 * (offset + w) + 1]);
            TEST_ASSERT_EQUAL_INT(modbus_exception_none, write_words(0x100, 2 + count, request));
        }
    TEST_ASSERT_EQUAL_UINT8_ARRAY(bench_table, bench_drive->table, bench_bytes);
    uint16_t back[122];
    const uint16_t offset[2] = {0, 7};
    TEST_ASSERT_EQUAL_INT(modbus_exception_none, write_words(0x100, 2, offset));
    TEST_ASSERT_EQUAL_INT(modbus_exception_none, modbus_map_read(map, 0x100, 122, back));
    TEST_ASSERT_EQUAL_HEX16(bench_table[14] << 8 | bench_table[15], back[2]);
}

static void test_modbus_map_keeps_table_data_inside_its_room(void)
{
    go_to(at_uploading);
    const uint32_t room = modbus_drive_table_bytes / 2;
    static const uint32_t beyond[] = {modbus_drive_table_bytes / 2, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF};
    for (unsigned i = 0; i < 4; i++) {
        const uint16_t words[3] = {(uint16_t)(beyond[i] >> 16), (uint16_t)beyond[i], 0xAAAA};
        uint16_t back[122];
        TEST_ASSERT_EQUAL_INT(modbus_exception_value, write_words(0x100, 3, words));
        TEST_ASSERT_EQUAL_INT(modbus_exception_none, modbus_map_read(map, 0x100, 122, back));
    }
    const uint16_t last[4] = {(uint16_t)((room - 1) >> 16), (uint16_t)(room - 1), 0xAAAA, 0xBBBB};
    TEST_ASSERT_EQUAL_INT(modbus_exception_none, write_words(0x100, 3, last));
    TEST_ASSERT_EQUAL_INT(modbus_exception_value, write_words(0x100, 4, last));
    TEST_ASSERT_EQUAL_INT(modbus_exception_value, write_words(0x102, 1, last));
}

static void test_modbus_map_shows_bins_through_their_window(void)
{
    go_to(at_verified);
    TEST_ASSERT_EQUAL_UINT32(bench_lines, read_long(0x3C));
    TEST_ASSERT_EQUAL_INT(modbus_exception_none, write_word(0x80, 10));
    TEST_ASSERT_EQUAL_UINT16(11, read_word(0x81));
    TEST_ASSERT_EQUAL_UINT16(bench_lines, read_word(0x81 + bench_lines - 11));
    TEST_ASSERT_EQUAL_UINT16(0, read_word(0x81 + bench_lines - 10));
    TEST_ASSERT_EQUAL_INT(modbus_exception_none, write_word(0x80, 0xFFFF));
    TEST_ASSERT_EQUAL_UINT16(0, read_word(0x81));
}

/// A snapshot stays while its sequence number does, whatever the drive measures meanwhile.
static void test_modbus_map_holds_a_snapshot(void)
{
    go_to(at_running);
    bench_run(bench_samples);
    uint16_t select[4] = {0xFFFF, 0xFFFF, 0, 9}, before[120], after[120];
    TEST_ASSERT_EQUAL_INT(modbus_exception_none, write_words(0x200, 4, select));
    TEST_ASSERT_EQUAL_INT(modbus_exception_none, modbus_map_read(map, 0x210, 120, before));
    TEST_ASSERT_EQUAL_UINT16(9, before[0]);
    TEST_ASSERT_EQUAL_UINT16(modbus_spectrum_valid, before[1]);
    TEST_ASSERT_EQUAL_UINT16(modbus_mean_bins, before[5]);
    TEST_ASSERT_EQUAL_UINT16(1, before[7]);
    bench_run(bench_samples);
    TEST_ASSERT_EQUAL_INT(modbus_exception_none, write_words(0x200, 4, select));
    TEST_ASSERT_EQUAL_INT(modbus_exception_none, modbus_map_read(map, 0x210, 120, after));
    TEST_ASSERT_EQUAL_UINT16_ARRAY(before, after, 120);
    select[3] = 10;
    TEST_ASSERT_EQUAL_INT(modbus_exception_none, write_words(0x200, 4, select));
    TEST_ASSERT_EQUAL_INT(modbus_exception_none, modbus_map_read(map, 0x210, 120, after));
    TEST_ASSERT_EQUAL_UINT16(2, after[7]);
    select[2] = bench_lines - 1; // the last window holds one bin
    TEST_ASSERT_EQUAL_INT(modbus_exception_none, write_words(0x200, 4, select));
    TEST_ASSERT_EQUAL_UINT16(1, read_word(0x215));
    select[2] = bench_lines;
    TEST_ASSERT_EQUAL_INT(modbus_exception_none, write_words(0x200, 4, select));
    TEST_ASSERT_EQUAL_UINT16(0, read_word(0x215));
}

static void test_modbus_map_reads_without_side_effect(void)
{
    static struct modbus_drive before;
    uint16_t words[125];
    go_to(at_running);
    modbus_map_read(map, 0x20, 62, words);
    memcpy(&before, bench_drive, sizeof before);
    for (uint32_t address = 0; address < 0x300; address++)
        for (uint32_t count = 1; count <= 125; count += 31)
            modbus_map_read(map, address, count, words);
    TEST_ASSERT_EQUAL_MEMORY(&before, bench_drive, sizeof before);
}

// ---- Documentation

/// Each field is a row `| 0xADDR | WORDS | KIND | ACCESS | NAME | ...` of docs/modbus.md, and nothing else is.
static void test_modbus_map_is_what_the_documentation_says(void)
{
    static const char *const kinds[] = {"u16", "u32", "f32", "window"};
    static const char *const accesses[] = {"read", "setup", "write", "data"};
    char path[512], line[1024];
    const char *source = getenv("SERVOSCOPE_SOURCE");
    unsigned rows = 0;
    snprintf(path, sizeof path, "%s/docs/modbus.md", source ? source : ".");
    FILE *file = fopen(path, "r");
    TEST_ASSERT_NOT_NULL_MESSAGE(file, path);
    while (fgets(line, sizeof line, file)) {
        if (strncmp(line, "| 0x", 4) != 0)
            continue;
        char expected[160];
        TEST_ASSERT_LESS_THAN_UINT(modbus_field_count, rows);
        const struct modbus_field *field = &modbus_fields[rows];
        snprintf(expected, sizeof expected, "| 0x%04X | %u | %s | %s | `%s` |", (unsigned)field->address,
                 (unsigned)field->words, kinds[field->kind], accesses[field->access], field->name);
        line[strlen(expected) < sizeof line ? strlen(expected) : 0] = '\0';
        TEST_ASSERT_EQUAL_STRING(expected, line);
        rows++;
    }
    fclose(file);
    TEST_ASSERT_EQUAL_UINT(modbus_field_count, rows);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_modbus_map_fields_ascend_without_overlap);
    RUN_TEST(test_modbus_map_identifies_itself_high_word_first);
    RUN_TEST(test_modbus_map_answers_every_address);
    RUN_TEST(test_modbus_map_takes_no_half_number);
    RUN_TEST(test_modbus_map_refuses_values_out_of_range);
    RUN_TEST(test_modbus_map_takes_a_command_only_whole);
    RUN_TEST(test_modbus_map_obeys_each_command_in_its_states_only);
    RUN_TEST(test_modbus_map_writes_setup_at_rest_only);
    RUN_TEST(test_modbus_map_needs_the_key_to_move);
    RUN_TEST(test_modbus_map_executes_a_repeated_command_once);
    RUN_TEST(test_modbus_map_uploads_in_any_order_and_twice);
    RUN_TEST(test_modbus_map_keeps_table_data_inside_its_room);
    RUN_TEST(test_modbus_map_shows_bins_through_their_window);
    RUN_TEST(test_modbus_map_holds_a_snapshot);
    RUN_TEST(test_modbus_map_reads_without_side_effect);
    RUN_TEST(test_modbus_map_is_what_the_documentation_says);
    return UNITY_END();
}
