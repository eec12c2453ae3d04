/* SPDX-License-Identifier: MIT */
/// MATLAB files: what is written reads back bit for bit, in both versions; files of others by --map; refusals.
#include "lab/record/format.h"
#include "lab/record/mat_file.h"
#include "tests/support/scratch.h"
#include "unity.h"

#include <math.h>
#include <zlib.h>

static struct record record, again;
static struct format_notes notes;
static struct error error;

void setUp(void)
{
    scratch_empty();
    error = (struct error){0};
    if (!mat_built_in())
        TEST_IGNORE_MESSAGE("built without matio: MATLAB files are not tested");
}

void tearDown(void)
{
    record_free(&record);
    record_free(&again);
    format_notes_free(&notes);
}

static int read_file(const char *path, const char *map, double rate_hz, struct record *out_record)
{
    const struct format_options options = {.run = {.map = map, .rate_hz = rate_hz}};
    return format_by_name("mat")->read(path, &options, out_record, &notes, &error);
}

static bool noted(enum format_note kind, const char *part)
{
    for (size_t i = 0; i < notes.count; i++)
        if (notes.items[i].kind == kind && strstr(notes.items[i].text, part))
            return true;
    return false;
}

static void make_run(void)
{
    static const char *const names[] = {"time_s", "torque_Nm", "odd, one", "end", "column_3", "valid"};
    static const uint32_t bins[] = {1, 3};
    record = (struct record){.kind = record_run, .run = {.sample_rate_hz = 1e3 / 3, .rows = 20, .period_samples = 10}};
    for (size_t c = 0; c < 6; c++) {
        double *data = run_add_column(&record.run, names[c]);
        for (size_t n = 0; n < record.run.rows; n++)
            data[n] = c == 0   ? (double)n * 3e-3
                      : c == 5 ? (double)(n % 2)
                               : (n % 2 ? -1 : 1) * exp((double)(n * c)) / 3;
    }
    record.run.columns[2].data[3] = NAN;
    record.run.has_settle_periods = true;
    record.run.settle_periods = 1;
    record.run.bins = malloc(sizeof bins);
    memcpy(record.run.bins, bins, sizeof bins);
    record.run.bin_count = 2;
    record.run.has_table_crc32 = true;
    record.run.table_crc32 = 0x0badcafe;
    run_set_key(&record.run, "note", "\xC3\xBC: \xE2\x89\xA4 \xF0\x9F\x94\xA7"); // two, three and four bytes of UTF-8
    run_set_key(&record.run, "empty", "");
    run_set_key(&record.run, "", "a comment");
    run_set_key(&record.run, "number", "007");
}

static void write_and_read(const char *format)
{
    const char *path = scratch_path("out.mat");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, format_by_name(format)->write(path, &record, &notes, &error), error.message);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, read_file(path, NULL, 0, &again), error.message);
    TEST_ASSERT_EQUAL_INT(record.kind, again.kind);
}

static void test_mat_run_reads_back_bit_for_bit(void)
{
    static const char *const versions[] = {"mat", "mat73"};
    for (size_t i = 0; i < 2; i++) {
        make_run();
        write_and_read(versions[i]);
        const struct run *a = &record.run, *b = &again.run;
        TEST_ASSERT_EQUAL_UINT(a->column_count, b->column_count);
        TEST_ASSERT_EQUAL_UINT(a->rows, b->rows);
        for (size_t c = 0; c < a->column_count; c++) {
            TEST_ASSERT_EQUAL_STRING(a->columns[c].name, b->columns[c].name);
            TEST_ASSERT_EQUAL_MEMORY(a->columns[c].data, b->columns[c].data, a->rows * sizeof(double));
        }
        TEST_ASSERT_TRUE(a->sample_rate_hz == b->sample_rate_hz);
        TEST_ASSERT_EQUAL_UINT(10, b->period_samples);
        TEST_ASSERT_TRUE(b->has_settle_periods && b->settle_periods == 1);
        TEST_ASSERT_EQUAL_UINT32_ARRAY(a->bins, b->bins, 2);
        TEST_ASSERT_EQUAL_HEX32(0x0badcafe, b->table_crc32);
        for (size_t k = 0; k < a->key_count; k++)
            TEST_ASSERT_EQUAL_STRING(a->keys[k].value, run_key(b, a->keys[k].key));
        TEST_ASSERT_TRUE(noted(format_kept, "'odd, one' as variable column_4"));
        TEST_ASSERT_TRUE(noted(format_kept, "'end' as variable column_5"));
        tearDown();
    }
}

static void test_mat_response_reads_back_bit_for_bit(void)
{
    static const char *const versions[] = {"mat", "mat73"};
    for (size_t i = 0; i < 2; i++) {
        record.kind = record_frf;
        TEST_ASSERT_EQUAL_INT(0, frf_alloc(&record.frf, 9, &error));
        for (size_t k = 0; k < 9; k++) {
            record.frf.frequency_hz[k] = 0.1 + (double)k / 3;
            record.frf.real[k] = cos((double)k);
            record.frf.imag[k] = -1e7 * sin((double)k);
            record.frf.std[k] = k % 2 ? 1e-3 / (double)k : FRF_UNKNOWN;
            record.frf.coherence[k] = 1 - 0.01 * (double)k;
            record.frf.valid[k] = k != 4;
        }
        frf_set_text(&record.frf.input, "torque_Nm");
        frf_set_text(&record.frf.method, "mean");
        record.frf.degrees_of_freedom = 6.5;
        write_and_read(versions[i]);
        const struct frf *a = &record.frf, *b = &again.frf;
        TEST_ASSERT_EQUAL_UINT(9, b->count);
        TEST_ASSERT_EQUAL_MEMORY(a->frequency_hz, b->frequency_hz, 9 * sizeof(double));
        TEST_ASSERT_EQUAL_MEMORY(a->real, b->real, 9 * sizeof(double));
        TEST_ASSERT_EQUAL_MEMORY(a->imag, b->imag, 9 * sizeof(double));
        TEST_ASSERT_EQUAL_MEMORY(a->std, b->std, 9 * sizeof(double));
        TEST_ASSERT_EQUAL_MEMORY(a->noise_std, b->noise_std, 9 * sizeof(double));
        TEST_ASSERT_EQUAL_MEMORY(a->coherence, b->coherence, 9 * sizeof(double));
        TEST_ASSERT_EQUAL_MEMORY(a->valid, b->valid, 9 * sizeof(bool));
        TEST_ASSERT_EQUAL_STRING("torque_Nm", b->input);
        TEST_ASSERT_EQUAL_STRING("", b->output);
        TEST_ASSERT_EQUAL_STRING("mean", b->method);
        TEST_ASSERT_TRUE(b->degrees_of_freedom == 6.5);
        tearDown();
    }
}

/* A file of others, byte by byte from the definition of level 5; big-endian or little-endian, compressed or not. */
struct image {
    bool big;
    size_t length;
    unsigned char bytes[8192];
};

static void put(struct image *self, const void *bytes, size_t length)
{
    memcpy(self->bytes + self->length, bytes, length);
    self->length += length;
}

static void put_number(struct image *self, uint64_t value, size_t size)
{
    for (size_t i = 0; i < size; i++)
        self->bytes[self->length++] = (unsigned char)(value >> 8 * (self->big ? size - 1 - i : i));
}

static void fill_up(struct image *self)
{
    while (self->length % 8)
        self->bytes[self->length++] = 0;
}

static void put_header(struct image *self, bool big)
{
    *self = (struct image){.big = big};
    char text[125];
    snprintf(text, sizeof text, "%-124s", "MATLAB 5.0 MAT-file, by hand");
    put(self, text, 124);
    put_number(self, 0x0100, 2);
    put_number(self, 'M' << 8 | 'I', 2);
}

/* Begins a variable and returns where its length stands. */
static size_t begin(struct image *self, unsigned class_type, unsigned rows, unsigned columns, const char *name)
{
    put_number(self, 14, 4);
    put_number(self, 0, 4);
    size_t length_at = self->length - 4;
    put_number(self, 6, 4);
    put_number(self, 8, 4);
    put_number(self, class_type, 4);
    put_number(self, 0, 4);
    put_number(self, 5, 4);
    put_number(self, 8, 4);
    put_number(self, rows, 4);
    put_number(self, columns, 4);
    put_number(self, 1, 4);
    put_number(self, strlen(name), 4);
    put(self, name, strlen(name));
    fill_up(self);
    return length_at;
}

static void end(struct image *self, size_t length_at)
{
    size_t length = self->length;
    self->length = length_at;
    put_number(self, length - length_at - 4, 4);
    self->length = length;
}

/* rows x columns doubles, value = 10 column + row, stored as doubles or as 16-bit integers. */
static void put_matrix(struct image *self, const char *name, unsigned rows, unsigned columns, bool integers)
{
    size_t at = begin(self, integers ? 10 : 6, rows, columns, name);
    put_number(self, integers ? 3 : 9, 4);
    put_number(self, (uint64_t)rows * columns * (integers ? 2 : 8), 4);
    for (unsigned i = 0; i < rows * columns; i++) {
        double value = 10 * (i / rows) + i % rows;
        uint64_t bits;
        memcpy(&bits, &value, sizeof bits);
        put_number(self, integers ? (uint64_t)value : bits, integers ? 2 : 8);
    }
    fill_up(self);
    end(self, at);
}

/* A structure with one field that is a vector of integers. */
static void put_structure(struct image *self, const char *name, const char *field, unsigned rows)
{
    char field_name[8] = "";
    strncat(field_name, field, sizeof field_name - 1);
    size_t at = begin(self, 2, 1, 1, name);
    put_number(self, self->big ? (4u << 16 | 5u) : (4u << 16 | 5u), 4); // four bytes of data in the tag itself
    put_number(self, sizeof field_name, 4);
    put_number(self, 1, 4);
    put_number(self, sizeof field_name, 4);
    put(self, field_name, sizeof field_name);
    put_matrix(self, "", rows, 1, true);
    end(self, at);
}

static const char *save(const struct image *self)
{
    return scratch_bytes("foreign.mat", self->bytes, self->length);
}

/* The same file with its only variable compressed. */
static const char *save_compressed(const struct image *self)
{
    struct image packed = {.big = self->big};
    unsigned char out[8192];
    uLongf length = sizeof out;
    TEST_ASSERT_EQUAL_INT(Z_OK, compress(out, &length, self->bytes + 128, self->length - 128));
    put(&packed, self->bytes, 128);
    put_number(&packed, 15, 4);
    put_number(&packed, length, 4);
    put(&packed, out, length);
    return save(&packed);
}

static void test_mat_signals_of_another_program_take_names_by_map(void)
{
    for (int big = 0; big < 2; big++) {
        struct image image;
        put_header(&image, big);
        put_matrix(&image, "t", 1, 5, false); // a row: 0 10 20 30 40
        put_matrix(&image, "data", 5, 2, false);
        put_structure(&image, "log", "i_q", 5);
        put_matrix(&image, "Ts", 1, 1, false);
        const char *map = "time_s=t,torque_Nm=data:2,current_A=log.i_q*0.5";
        TEST_ASSERT_EQUAL_INT_MESSAGE(0, read_file(save(&image), map, 0, &record), error.message);
        static const double torque[] = {10, 11, 12, 13, 14}, current[] = {0, 0.5, 1, 1.5, 2};
        TEST_ASSERT_EQUAL_MEMORY(torque, run_column(&record.run, "torque_Nm"), sizeof torque);
        TEST_ASSERT_EQUAL_MEMORY(current, run_column(&record.run, "current_A"), sizeof current);
        TEST_ASSERT_NOT_NULL(run_column(&record.run, "data:1"));
        TEST_ASSERT_TRUE(record.run.sample_rate_hz == 0.1);
        TEST_ASSERT_TRUE(noted(format_assumed, "log.i_q (5 x 1 int16)"));
        TEST_ASSERT_TRUE(noted(format_lost, "Ts (1 x 1 double)"));
        tearDown();
    }
}

static void test_mat_compressed_signal_is_read_and_damage_is_seen(void)
{
    struct image image;
    put_header(&image, false);
    put_matrix(&image, "torque_Nm", 200, 1, false);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, read_file(save_compressed(&image), NULL, 100, &record), error.message);
    TEST_ASSERT_TRUE(record.run.rows == 200 && run_column(&record.run, "torque_Nm")[199] == 199);
    size_t length = 0;
    char *bytes = scratch_load(scratch_path("foreign.mat"), &length);
    bytes[length - 1] ^= 1; // in the check sum
    int status = read_file(scratch_bytes("damaged.mat", bytes, length), NULL, 100, &again);
    free(bytes);
    TEST_ASSERT_EQUAL_INT(error_refused, status);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "byte 128: a compressed variable is damaged"), error.message);
}

static void check_refusal(const char *path, const char *map, double rate_hz, const char *part)
{
    TEST_ASSERT_TRUE_MESSAGE(read_file(path, map, rate_hz, &again) != 0, part);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, part), error.message);
}

static void test_mat_refusals_name_the_variable_and_what_there_is(void)
{
    struct image image;
    put_header(&image, false);
    put_matrix(&image, "t", 1, 5, false);
    put_matrix(&image, "u", 6, 1, false);
    const char *path = save(&image);
    check_refusal(path, NULL, 0, "no variable has a name that a run knows");
    check_refusal(path, NULL, 0, "it holds: t (1 x 5 double), u (6 x 1 double)");
    check_refusal(path, "torque_Nm=v", 0, "is called v; it holds: t (1 x 5 double)");
    check_refusal(path, "time_s=t,torque_Nm=u", 0, "u has 6 values, the signals before it 5");
    check_refusal(path, "torque_Nm=u", 0, "no sample rate");
    check_refusal(path, "torque_Nm=", 0, "--map");
    check_refusal(path, "torque_Nm=u", -1, "--rate");
    image.length -= 8;
    check_refusal(save(&image), NULL, 0, "cut off or damaged: 104 bytes were expected, 96 are there");
    image.bytes[124] = 7;
    image.bytes[125] = 7;
    check_refusal(save(&image), NULL, 0, "byte 124");
}

/* One of our variables deleted in MATLAB, or grown. */
static void test_mat_column_that_is_missing_or_of_another_length_is_refused(void)
{
    make_run();
    record.run.column_count = 2;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, format_by_name("mat")->write(scratch_path("a.mat"), &record, &notes, &error),
                                  error.message);
    record.run.column_count = 6;
    size_t length = 0, name = 0;
    char *bytes = scratch_load(scratch_path("a.mat"), &length);
    while (memcmp(bytes + name, "torque_Nm", 9) != 0 || bytes[name - 8] != 1) // the variable, not the list of columns
        name++;
    bytes[name] = 'T';
    const char *path = scratch_bytes("a.mat", bytes, length);
    free(bytes);
    check_refusal(path, NULL, 0, "torque_Nm: this variable, which servoscope.columns names, was expected");
}

static void test_mat_too_long_for_version_5_is_refused_before_anything_is_written(void)
{
    record = (struct record){.kind = record_run, .run = {.sample_rate_hz = 1, .rows = (size_t)1 << 28}};
    TEST_ASSERT_EQUAL_INT(error_refused, format_by_name("mat")->write(scratch_path("a.mat"), &record, &notes, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "--to mat73 was expected"), error.message);
    TEST_ASSERT_EQUAL_INT(0, scratch_count());
}

int main(void)
{
    scratch_open();
    UNITY_BEGIN();
    RUN_TEST(test_mat_run_reads_back_bit_for_bit);
    RUN_TEST(test_mat_response_reads_back_bit_for_bit);
    RUN_TEST(test_mat_signals_of_another_program_take_names_by_map);
    RUN_TEST(test_mat_compressed_signal_is_read_and_damage_is_seen);
    RUN_TEST(test_mat_refusals_name_the_variable_and_what_there_is);
    RUN_TEST(test_mat_column_that_is_missing_or_of_another_length_is_refused);
    RUN_TEST(test_mat_too_long_for_version_5_is_refused_before_anything_is_written);
    int failures = UNITY_END();
    scratch_close();
    return failures;
}
