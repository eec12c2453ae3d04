/* SPDX-License-Identifier: MIT */
/* Table files: what is written reads back, what is damaged is refused, a refusal leaves no file. Works in the current
 * folder. */
#include "core/bytes.h"
#include "core/crc32.h"
#include "lab/record/table_file.h"

#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { samples = 24, bin_count = 3, room = 65536 };
static const double two_pi = 6.28318530717958647692;
static const char mst_path[] = "test-table.mst", csv_path[] = "test-table.csv", header_path[] = "test-table.h";

static struct table table;
static struct error error;

void setUp(void)
{
    unlink(mst_path);
    unlink(csv_path);
    unlink(header_path);
    error = (struct error){0};
    TEST_ASSERT_EQUAL_INT(0, table_alloc(&table, samples, 3, bin_count, &error));
    TEST_ASSERT_EQUAL_INT(0, table_set_rate(&table, 1000, &error));
    table.format = msgen_format_i16;
    table.start_index = 5;
    for (unsigned b = 0; b < bin_count; b++)
        table.bins[b] = 1 + 4 * b;
    for (unsigned n = 0; n < samples; n++) {
        table.torque[n] = 0.7 * cos(two_pi * n / samples) + 0.2 * sin(two_pi * 5 * n / samples);
        table.velocity[n] = 3.1 * sin(two_pi * n / samples);
        table.position[n] = 1e-3 * cos(two_pi * 9 * n / samples);
        table.acceleration[n] = 100 * cos(two_pi * n / samples);
    }
}

void tearDown(void)
{
    table_free(&table);
    unlink(mst_path);
    unlink(csv_path);
    unlink(header_path);
}

static size_t read_file(const char *path, uint8_t *out_bytes)
{
    FILE *stream = fopen(path, "rb");
    TEST_ASSERT_NOT_NULL_MESSAGE(stream, path);
    size_t size = fread(out_bytes, 1, room, stream);
    fclose(stream);
    return size;
}

static void write_file(const char *path, const uint8_t *bytes, size_t size)
{
    FILE *stream = fopen(path, "wb");
    TEST_ASSERT_NOT_NULL(stream);
    TEST_ASSERT_EQUAL_size_t(size, fwrite(bytes, 1, size, stream));
    fclose(stream);
}

/* In place: on some file systems a file that is truncated and written again is flushed to the disk. */
static void change_byte(const char *path, size_t at, uint8_t value)
{
    FILE *stream = fopen(path, "r+b");
    TEST_ASSERT_NOT_NULL(stream);
    TEST_ASSERT_EQUAL_INT(0, fseek(stream, (long)at, SEEK_SET));
    TEST_ASSERT_EQUAL_INT(value, fputc(value, stream));
    TEST_ASSERT_EQUAL_INT(0, fclose(stream));
}

static void expect_close(const double *expected, const double *actual, double half_step)
{
    for (unsigned n = 0; n < samples; n++)
        TEST_ASSERT_DOUBLE_WITHIN(half_step, expected[n], actual[n]);
}

/* Half a count, and the one part in 2^24 by which a float scale may exceed the exact one. */
static double half_step(enum msgen_format format, double peak)
{
    static const double counts[] = {0, 65534, 4294967294.0, 16777216};
    return peak / counts[format] * 1.0001 + peak * 1e-7;
}

static double peak_of(const double *data)
{
    double peak = 0;
    for (unsigned n = 0; n < samples; n++)
        peak = fmax(peak, fabs(data[n]));
    return peak;
}

static void test_table_file_reads_back_what_was_written(void)
{
    for (int format = msgen_format_i16; format <= msgen_format_f32; format++) {
        struct table copy;
        table.format = (enum msgen_format)format;
        memset(table.scale, 0, sizeof table.scale);
        TEST_ASSERT_EQUAL_INT_MESSAGE(0, table_file_write_mst(mst_path, &table, &error), error.message);
        TEST_ASSERT_EQUAL_INT_MESSAGE(0, table_file_read(mst_path, &copy, &error), error.message);
        TEST_ASSERT_EQUAL_INT(format, copy.format);
        TEST_ASSERT_EQUAL_UINT32(1000, copy.rate_num_hz);
        TEST_ASSERT_EQUAL_UINT32(1, copy.rate_den);
        TEST_ASSERT_EQUAL_UINT32(samples, copy.samples);
        TEST_ASSERT_EQUAL_UINT32(3, copy.channels);
        TEST_ASSERT_EQUAL_UINT32(5, copy.start_index);
        TEST_ASSERT_EQUAL_HEX32(table.crc32, copy.crc32);
        TEST_ASSERT_EQUAL_UINT32_ARRAY(table.bins, copy.bins, bin_count);
        TEST_ASSERT_NULL(copy.acceleration);
        expect_close(table.torque, copy.torque, half_step(table.format, peak_of(table.torque)));
        expect_close(table.velocity, copy.velocity, half_step(table.format, peak_of(table.velocity)));
        expect_close(table.position, copy.position, half_step(table.format, peak_of(table.position)));
        table_free(&copy);
    }
}

static void test_table_file_peak_fills_its_format_without_exceeding(void)
{
    static const double levels[] = {1, 0.9999999, 1.0 / 3, 2.718281828459045, 1e-6, 12345.678, 3.0e-20, 7.7e15};
    for (unsigned i = 0; i < 2 * sizeof levels / sizeof levels[0]; i++) {
        struct table copy;
        uint8_t bytes[room];
        struct msgen_table view;
        table.format = i % 2 ? msgen_format_i32 : msgen_format_i16;
        double most = i % 2 ? 2147483647.0 : 32767, largest = 0, peak = peak_of(table.torque), level = levels[i / 2];
        memset(table.scale, 0, sizeof table.scale);
        for (unsigned n = 0; n < samples; n++)
            table.torque[n] *= level / peak;
        TEST_ASSERT_EQUAL_INT_MESSAGE(0, table_file_write_mst(mst_path, &table, &error), error.message);
        TEST_ASSERT_EQUAL_INT(core_ok, msgen_table_open(bytes, read_file(mst_path, bytes), &view));
        for (uint32_t n = 0; n < samples; n++)
            largest = fmax(largest, fabs((double)msgen_table_count(&view, n, msgen_channel_torque)));
        TEST_ASSERT_TRUE(largest <= most);
        TEST_ASSERT_TRUE(largest >= most * (1 - 2e-7)); /* the scale has 24 bits */
        TEST_ASSERT_EQUAL_INT(0, table_file_read(mst_path, &copy, &error));
        TEST_ASSERT_TRUE(peak_of(copy.torque) <= level * (1 + 1.3e-7));
        table_free(&copy);
    }
}

static void test_table_file_written_again_is_the_same_file(void)
{
    uint8_t first[room], second[room];
    for (int format = msgen_format_i16; format <= msgen_format_f32; format++) {
        struct table copy;
        table.format = (enum msgen_format)format;
        memset(table.scale, 0, sizeof table.scale);
        TEST_ASSERT_EQUAL_INT(0, table_file_write_mst(mst_path, &table, &error));
        size_t size = read_file(mst_path, first);
        TEST_ASSERT_EQUAL_INT(0, table_file_read(mst_path, &copy, &error));
        TEST_ASSERT_EQUAL_INT(0, table_file_write_mst(mst_path, &copy, &error));
        TEST_ASSERT_EQUAL_size_t(size, read_file(mst_path, second));
        TEST_ASSERT_EQUAL_MEMORY(first, second, size);
        table_free(&copy);
    }
}

static void test_table_file_every_truncation_is_refused(void)
{
    uint8_t bytes[room];
    TEST_ASSERT_EQUAL_INT(0, table_file_write_mst(mst_path, &table, &error));
    size_t size = read_file(mst_path, bytes);
    for (size_t cut = size; cut-- > 0;) {
        struct table copy;
        char expected[128];
        TEST_ASSERT_EQUAL_INT(0, truncate(mst_path, (off_t)cut));
        TEST_ASSERT_EQUAL_INT(error_refused, table_file_read(mst_path, &copy, &error));
        TEST_ASSERT_NULL(copy.torque);
        snprintf(expected, sizeof expected, "%s: byte %zu: table is cut short: %zu bytes", mst_path, cut, cut);
        TEST_ASSERT_EQUAL_STRING_LEN(expected, error.message, strlen(expected));
    }
    bytes[size] = 0; /* and one byte too many */
    write_file(mst_path, bytes, size + 1);
    struct table copy;
    TEST_ASSERT_EQUAL_INT(error_refused, table_file_read(mst_path, &copy, &error));
}

static void test_table_file_every_changed_byte_is_refused(void)
{
    uint8_t bytes[room];
    TEST_ASSERT_EQUAL_INT(0, table_file_write_mst(mst_path, &table, &error));
    size_t size = read_file(mst_path, bytes);
    static const uint8_t changes[] = {0x01, 0x10, 0x80, 0xFF}; /* all 255 in tests/unit/test_msgen_table.c */
    unsigned refused = 0;
    for (size_t at = 0; at < size; at++) {
        for (unsigned c = 0; c < sizeof changes; c++) {
            struct table copy;
            change_byte(mst_path, at, bytes[at] ^ changes[c]);
            error.message[0] = '\0';
            TEST_ASSERT_EQUAL_INT(error_refused, table_file_read(mst_path, &copy, &error));
            TEST_ASSERT_EQUAL_STRING_LEN(mst_path, error.message, strlen(mst_path));
            TEST_ASSERT_NULL(strchr(error.message, '\n'));
            refused++;
        }
        change_byte(mst_path, at, bytes[at]);
    }
    printf("table file of %zu bytes: %zu truncations and %u changed bytes, all refused\n", size, size, refused);
    struct table copy;
    TEST_ASSERT_EQUAL_INT(0, table_file_read(mst_path, &copy, &error));
    table_free(&copy);
}

/* Fields changed and signed again, so that the message of the field itself is seen. */
static uint8_t signed_bytes[room];
static size_t signed_size;

static void expect_message(uint32_t offset, uint32_t value, const char *expected)
{
    uint8_t bytes[room];
    struct table copy;
    size_t size = signed_size;
    memcpy(bytes, signed_bytes, size);
    core_put_u32(bytes + offset, value);
    if (offset < 48) {
        core_put_u32(bytes + 52, core_crc32(0, bytes, 52));
    } else if (offset > 52) {
        core_put_u32(bytes + 48, core_crc32(0, bytes + msgen_header_bytes, size - msgen_header_bytes));
        core_put_u32(bytes + 52, core_crc32(0, bytes, 52));
    }
    write_file(mst_path, bytes, size);
    TEST_ASSERT_EQUAL_INT(error_refused, table_file_read(mst_path, &copy, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, expected), error.message);
    TEST_ASSERT_EQUAL_STRING_LEN(mst_path, error.message, strlen(mst_path));
}

static void test_table_file_messages_say_value_and_expectation(void)
{
    TEST_ASSERT_EQUAL_INT(0, table_file_write_mst(mst_path, &table, &error));
    signed_size = read_file(mst_path, signed_bytes);
    expect_message(0, 0x0A0D4E50u, "not a table");
    expect_message(4, 0x01030003u, "found 3, expected 1 or 2");
    expect_message(4, 0x01090001u, "found 9, expected 1 to 3");
    expect_message(4, 0x07030001u, "found 7, expected 1 (i16)");
    expect_message(12, 0, "found 1000/0 Hz");
    expect_message(16, 2000000, "found 2000000, expected 4 to 1048576");
    expect_message(20, 12, "found 12, expected 1 to 11");
    expect_message(24, 24, "found 24, expected 0 to 23");
    expect_message(28, 3, "found 3, expected 0 to 1");
    expect_message(36, 0x7FC00000u, "velocity: found nan");
    expect_message(44, 1, "found 1, expected 156");
    expect_message(60, 1, "number 1 of the list is 1, expected 2 to 11");
    expect_message(64, 12, "number 2 of the list is 12, expected 6 to 11");
    expect_message(52, 0, "found 0x00000000, but the bytes give 0x");
}

static void test_table_file_travel_reads_back(void)
{
    static const double travels[] = {6.283185307179586, -1e-5, 20e-3};
    for (int format = msgen_format_i16; format <= msgen_format_f32; format++) {
        for (unsigned i = 0; i < sizeof travels / sizeof travels[0]; i++) {
            struct table copy;
            table.format = (enum msgen_format)format;
            table.travel_per_period = travels[i];
            memset(table.scale, 0, sizeof table.scale);
            TEST_ASSERT_EQUAL_INT_MESSAGE(0, table_file_write_mst(mst_path, &table, &error), error.message);
            TEST_ASSERT_EQUAL_INT_MESSAGE(0, table_file_read(mst_path, &copy, &error), error.message);
            uint8_t bytes[room];
            TEST_ASSERT_EQUAL_size_t(table_file_bytes(&copy), read_file(mst_path, bytes));
            /* Half of a 2^30th of a count, and the last bits of the double. */
            double within = (double)copy.scale[2] / 2147483648.0 + 4e-16 * fabs(travels[i]);
            TEST_ASSERT_DOUBLE_WITHIN(within, travels[i], copy.travel_per_period);
            if (format == msgen_format_i32) {
                /* 1024 periods fit the player's 32 bits, and what is left is the resolution of the samples. */
                double most = 2147483647.0 * (double)copy.scale[2];
                TEST_ASSERT_TRUE(1024 * fabs(travels[i]) + peak_of(table.position) <= most);
                expect_close(table.position, copy.position, 0.51 * (double)copy.scale[2]);
            }
            table_free(&copy);
        }
    }
    table.travel_per_period = 0.5;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, table_file_write_csv(csv_path, &table, &error), error.message);
    uint8_t text[room];
    text[read_file(csv_path, text)] = 0;
    TEST_ASSERT_NOT_NULL(strstr((char *)text, "# start_index: 5\n# travel_per_period_rad: 0.5\n# table_crc32: 0x"));
}

static void expect_refused_write(const char *expected)
{
    int (*const writers[3])(const char *, struct table *, struct error *) = {table_file_write_mst, table_file_write_csv,
                                                                             table_file_write_header};
    static const char *const paths[3] = {mst_path, csv_path, header_path};
    for (unsigned w = 0; w < 3; w++) {
        TEST_ASSERT_EQUAL_INT(error_refused, writers[w](paths[w], &table, &error));
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, expected), error.message);
        TEST_ASSERT_EQUAL_INT(-1, access(paths[w], F_OK));
    }
    tearDown();
    setUp();
}

static void test_table_file_write_refuses_what_is_no_table(void)
{
    table.torque[7] = NAN;
    expect_refused_write("torque: sample 7 is nan, a finite number was expected");
    table.position[0] = INFINITY;
    expect_refused_write("position: sample 0 is inf");
    table.rate_den = 0;
    expect_refused_write("found 1000/0 Hz");
    table.rate_num_hz = 0;
    expect_refused_write("found 0/1 Hz");
    table.start_index = samples;
    expect_refused_write("found 24, expected 0 to 23");
    table.bins[2] = samples / 2;
    expect_refused_write("number 2 of the list is 12, expected 6 to 11");
    table.bins[1] = 1;
    expect_refused_write("number 1 of the list is 1");
    table.format = (enum msgen_format)9;
    expect_refused_write("found 9, expected 1 (i16)");
    table.samples = 3;
    expect_refused_write("found 3, expected 4 to 1048576");
    table.channels = 4;
    expect_refused_write("found 4, expected 1 to 3");
    table.travel_per_period = NAN;
    expect_refused_write("travel of nan per period: a finite number was expected");
    table.travel_per_period = 1e-3;
    table.channels = 2;
    expect_refused_write("travel of 0.001 per period");
    table.travel_per_period = 1e6;
    table.scale[2] = 1e-6f;
    expect_refused_write("travel of 1e+06 per period: at most 2147.48 was expected");
    table.travel_per_period = 1e-20;
    expect_refused_write("travel of 1e-20 per period: 0, or at least ");
}

static void test_table_file_write_refuses_what_does_not_fit_its_format(void)
{
    table.scale[0] = 1e-5f;
    expect_refused_write("torque: sample 0 is 0.7: at most 0.32767 fits its number format at a scale of 1e-05");
    table.scale[1] = 0.5f;
    expect_refused_write("velocity: its peak is 6 counts of 32767: at least 127 were expected");
    table.scale[2] = 1.0f;
    expect_refused_write("position: its peak is 0 counts");
    table.scale[0] = -1;
    expect_refused_write("a scale of -1");
    table.format = msgen_format_f32;
    table.velocity[23] = 1e39;
    expect_refused_write("velocity: sample 23 is 1e+39");
    table.format = msgen_format_i16;
    for (unsigned n = 0; n < samples; n++)
        table.torque[n] *= 1e-40;
    expect_refused_write("torque: a peak of");
}

static void test_table_file_refused_write_keeps_the_old_file(void)
{
    uint8_t before[room], after[room];
    TEST_ASSERT_EQUAL_INT(0, table_file_write_mst(mst_path, &table, &error));
    size_t size = read_file(mst_path, before);
    table.torque[0] = NAN;
    TEST_ASSERT_EQUAL_INT(error_refused, table_file_write_mst(mst_path, &table, &error));
    TEST_ASSERT_EQUAL_size_t(size, read_file(mst_path, after));
    TEST_ASSERT_EQUAL_MEMORY(before, after, size);
    struct table copy;
    table.torque[0] = 0;
    TEST_ASSERT_EQUAL_INT(error_refused, table_file_write_mst("no-such-folder/x.mst", &table, &error));
    TEST_ASSERT_EQUAL_INT(error_refused, table_file_read("no-such-file.mst", &copy, &error));
    TEST_ASSERT_NOT_NULL(strstr(error.message, "no-such-file.mst: cannot be read"));
    TEST_ASSERT_EQUAL_INT(error_refused, table_file_read(".", &copy, &error));
}

static void test_table_file_silent_channel_is_kept(void)
{
    struct table copy;
    memset(table.velocity, 0, samples * sizeof *table.velocity);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, table_file_write_mst(mst_path, &table, &error), error.message);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, table_file_read(mst_path, &copy, &error), error.message);
    for (unsigned n = 0; n < samples; n++)
        TEST_ASSERT_TRUE(copy.velocity[n] == 0);
    table_free(&copy);
}

static void expect_line(const char *text, unsigned number, const char *expected)
{
    for (unsigned line = 1; line < number; line++) {
        text = strchr(text, '\n');
        TEST_ASSERT_NOT_NULL(text);
        text++;
    }
    TEST_ASSERT_EQUAL_STRING_LEN(expected, text, strlen(expected));
    TEST_ASSERT_EQUAL_CHAR('\n', text[strlen(expected)]);
}

static void test_table_file_csv_has_keys_names_and_exact_values(void)
{
    static char text[room];
    char expected[64];
    table.torque[0] = 0.1;
    table.velocity[0] = -0.25;
    table.position[0] = 1e-3;
    table.acceleration[0] = 100;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, table_file_write_csv(csv_path, &table, &error), error.message);
    text[read_file(csv_path, (uint8_t *)text)] = '\0';
    expect_line(text, 1, "# sample_rate_hz: 1000");
    expect_line(text, 2, "# period_samples: 24");
    expect_line(text, 3, "# excited_bins: [1, 5, 9]");
    expect_line(text, 4, "# start_index: 5");
    snprintf(expected, sizeof expected, "# table_crc32: 0x%08x", (unsigned)table.crc32);
    expect_line(text, 5, expected);
    expect_line(text, 6, "n,torque_Nm,position_rad,velocity_rad_per_s,acceleration_rad_per_s2");
    expect_line(text, 7, "0,0.1,0.001,-0.25,100");
    uint32_t crc32 = table.crc32;
    TEST_ASSERT_EQUAL_INT(0, table_file_write_mst(mst_path, &table, &error));
    TEST_ASSERT_EQUAL_HEX32(crc32, table.crc32);
    table.linear = true;
    TEST_ASSERT_EQUAL_INT(0, table_file_write_csv(csv_path, &table, &error));
    TEST_ASSERT_NOT_EQUAL(crc32, table.crc32);
    text[read_file(csv_path, (uint8_t *)text)] = '\0';
    expect_line(text, 6, "n,force_N,position_m,velocity_m_per_s,acceleration_m_per_s2");
}

static void test_table_file_csv_leaves_out_columns_that_are_not_there(void)
{
    static char text[room];
    free(table.acceleration);
    table.acceleration = NULL;
    free(table.position);
    table.position = NULL;
    table.channels = 2;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, table_file_write_csv(csv_path, &table, &error), error.message);
    text[read_file(csv_path, (uint8_t *)text)] = '\0';
    expect_line(text, 6, "n,torque_Nm,velocity_rad_per_s");
    unlink(csv_path);
    table.channels = 3;
    expect_refused_write("position: a table of 3 channels needs it");
    table.acceleration[2] = NAN;
    TEST_ASSERT_EQUAL_INT(error_refused, table_file_write_csv(csv_path, &table, &error));
    TEST_ASSERT_NOT_NULL(strstr(error.message, "acceleration: sample 2 is nan"));
}

/* The bytes in the header's array are those of the .mst file. */
static void test_table_file_header_holds_the_bytes_of_the_table(void)
{
    static char text[room];
    uint8_t bytes[room], listed[room];
    char expected[64];
    TEST_ASSERT_EQUAL_INT(0, table_file_write_mst(mst_path, &table, &error));
    size_t size = read_file(mst_path, bytes), count = 0;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, table_file_write_header(header_path, &table, &error), error.message);
    text[read_file(header_path, (uint8_t *)text)] = '\0';
    snprintf(expected, sizeof expected, "#define TEST_TABLE_CRC32 0x%08xu\n", (unsigned)table.crc32);
    TEST_ASSERT_NOT_NULL(strstr(text, expected));
    snprintf(expected, sizeof expected, "#define TEST_TABLE_BYTES %zuu\n", size);
    TEST_ASSERT_NOT_NULL(strstr(text, expected));
    const char *at = strstr(text, "static const uint8_t test_table_mst[TEST_TABLE_BYTES] = {");
    TEST_ASSERT_NOT_NULL(at);
    while ((at = strstr(at, "0x")) != NULL && count < room)
        listed[count++] = (uint8_t)strtoul(at, (char **)&at, 16);
    TEST_ASSERT_EQUAL_size_t(size, count);
    TEST_ASSERT_EQUAL_MEMORY(bytes, listed, size);
}

static void test_table_rate_is_the_simplest_fraction(void)
{
    static const struct {
        double rate_hz;
        uint32_t num, den;
    } cases[] = {{1000, 1000, 1},   {8000.0 / 3, 8000, 3}, {0.5, 1, 2},    {44100.0 / 1001, 6300, 143},
                 {16000, 16000, 1}, {0.1, 1, 10},          {1.0 / 3, 1, 3}};
    for (unsigned i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        TEST_ASSERT_EQUAL_INT_MESSAGE(0, table_set_rate(&table, cases[i].rate_hz, &error), error.message);
        TEST_ASSERT_EQUAL_UINT32(cases[i].num, table.rate_num_hz);
        TEST_ASSERT_EQUAL_UINT32(cases[i].den, table.rate_den);
    }
    static const double wrong[] = {0, -1, NAN, INFINITY, 1e10, 1e-9};
    for (unsigned i = 0; i < sizeof wrong / sizeof wrong[0]; i++)
        TEST_ASSERT_EQUAL_INT(error_refused, table_set_rate(&table, wrong[i], &error));
    TEST_ASSERT_EQUAL_INT(0, table_set_rate(&table, 3141.592653589793, &error));
    TEST_ASSERT_DOUBLE_WITHIN(3.2e-9, 3141.592653589793, table_rate_hz(&table));
}

static void test_table_alloc_refuses_sizes_out_of_range(void)
{
    struct table other;
    TEST_ASSERT_EQUAL_INT(error_refused, table_alloc(&other, 3, 1, 1, &error));
    TEST_ASSERT_EQUAL_INT(error_refused, table_alloc(&other, SERVOSCOPE_TABLE_SAMPLES_MAX + 1, 1, 1, &error));
    TEST_ASSERT_EQUAL_INT(error_refused, table_alloc(&other, 10, 0, 1, &error));
    TEST_ASSERT_EQUAL_INT(error_refused, table_alloc(&other, 10, 4, 1, &error));
    TEST_ASSERT_EQUAL_INT(error_refused, table_alloc(&other, 10, 1, 0, &error));
    TEST_ASSERT_EQUAL_INT(error_refused, table_alloc(&other, 10, 1, 5, &error));
    TEST_ASSERT_EQUAL_INT(0, table_alloc(&other, 10, 1, 4, &error));
    TEST_ASSERT_NULL(other.velocity);
    table_free(&other);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_table_file_reads_back_what_was_written);
    RUN_TEST(test_table_file_peak_fills_its_format_without_exceeding);
    RUN_TEST(test_table_file_written_again_is_the_same_file);
    RUN_TEST(test_table_file_every_truncation_is_refused);
    RUN_TEST(test_table_file_every_changed_byte_is_refused);
    RUN_TEST(test_table_file_messages_say_value_and_expectation);
    RUN_TEST(test_table_file_travel_reads_back);
    RUN_TEST(test_table_file_write_refuses_what_is_no_table);
    RUN_TEST(test_table_file_write_refuses_what_does_not_fit_its_format);
    RUN_TEST(test_table_file_refused_write_keeps_the_old_file);
    RUN_TEST(test_table_file_silent_channel_is_kept);
    RUN_TEST(test_table_file_csv_has_keys_names_and_exact_values);
    RUN_TEST(test_table_file_csv_leaves_out_columns_that_are_not_there);
    RUN_TEST(test_table_file_header_holds_the_bytes_of_the_table);
    RUN_TEST(test_table_rate_is_the_simplest_fraction);
    RUN_TEST(test_table_alloc_refuses_sizes_out_of_range);
    return UNITY_END();
}
