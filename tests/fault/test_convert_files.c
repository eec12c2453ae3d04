/* SPDX-License-Identifier: MIT */
/// Files of every format that convert knows, cut off after every byte, and with bits turned over all along them:
/// refused with one line or read, never a crash (the sanitizers watch); a full disk or a device leaves nothing half
/// written.
#define _XOPEN_SOURCE 700 /* SIGXFSZ */
#include "lab/record/format.h"
#include "lab/record/mat_file.h"
#include "tests/support/scratch.h"
#include "unity.h"

#include <math.h>
#include <signal.h>
#include <sys/resource.h>

static const char small_run[] = "# sample_rate_hz: 100\n# period_samples: 4\n# periods: 1\n# excited_bins: [1]\n"
                                "# note: x\ntime_s,torque_Nm,\"odd, one\"\n"
                                "0,0.1,7\n.01,2,1\n0.02,3,8\n0.03,4,9\n";

static const char small_frf[] = "# input: torque_Nm\n# output: velocity_rad_per_s\n# periods: 3\n"
                                "frequency_hz,real,imag,std,valid\n0.5,1,-2,0.1,1\n1.25,0.5,-1e-2,,0\n";

/* A disk that fills up keeps HDF5 from letting go of its file; what it holds then is not ours to free. */
const char *__lsan_default_suppressions(void);
const char *__lsan_default_suppressions(void)
{
    return "leak:libhdf5\n";
}

static const struct format_options no_options = {0};
static char *bytes;
static size_t length;

void setUp(void)
{
    scratch_empty();
    bytes = NULL;
}

void tearDown(void)
{
    free(bytes);
}

/* A small record in a format, as the bytes of its file. */
static void make(const char *text, const char *format)
{
    struct error error = {0};
    struct record record;
    struct format_notes notes = {0};
    const char *in = scratch_text("in.csv", text), *out = scratch_path("made");
    TEST_ASSERT_EQUAL_INT(0, format_by_name("csv")->read(in, &no_options, &record, &notes, &error));
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, format_by_name(format)->write(out, &record, &notes, &error), error.message);
    record_free(&record);
    format_notes_free(&notes);
    bytes = scratch_load(out, &length);
}

/* 0 if the file was read and can be written again as text, 1 if it was refused with one line. */
static int read_bytes(const void *content, size_t size, const char *what, size_t position)
{
    char message[1280];
    struct error error = {0};
    struct record record = {0};
    struct format_notes notes = {0};
    const struct record_format *format;
    const char *path = scratch_bytes("attacked", content, size);
    int status = format_by_content(path, &format, &error);
    status = status ? status : format->read(path, &no_options, &record, &notes, &error);
    bool one_line = error.message[0] != '\0' && !strchr(error.message, '\n');
    if (!status)
        status = format_by_name("csv")->write(scratch_path("again"), &record, &notes, &error) ? -1 : 0;
    snprintf(message, sizeof message, "%s %zu: %s", what, position, error.message);
    record_free(&record);
    format_notes_free(&notes);
    TEST_ASSERT_TRUE_MESSAGE(status == 0 || (status > 0 && one_line), message);
    return status ? 1 : 0;
}

/* Every prefix is refused, but for one that only lacks the end of the last line. */
static void attack_prefixes(size_t step)
{
    TEST_ASSERT_EQUAL_INT(0, read_bytes(bytes, length, "whole", 0));
    size_t whole = bytes[length - 1] == '\n' ? length - 1 : length;
    for (size_t cut = 0; cut < whole; cut += step) {
        char what[64];
        snprintf(what, sizeof what, "taken for whole: cut after byte");
        int refused = read_bytes(bytes, cut, what, cut);
        if (!refused)
            printf("%s %zu of %zu\n", what, cut, length);
        TEST_ASSERT_TRUE_MESSAGE(refused, "a file that was cut off was taken for whole");
    }
}

/* Each bit of every `step`th byte turned over; all of them take minutes under the sanitizers. */
static void attack_bits(size_t step)
{
    size_t counts[2] = {0};
    for (size_t at = 0; at < length; at += step) {
        for (int bit = 0; bit < 8; bit++) {
            bytes[at] = (char)(bytes[at] ^ (1 << bit));
            counts[read_bytes(bytes, length, "bit turned over in byte", at)]++;
            bytes[at] = (char)(bytes[at] ^ (1 << bit));
        }
    }
    TEST_ASSERT_TRUE(counts[0] > 0 && counts[1] > 0);
}

static void test_convert_files_survive_any_damage_to_a_universal_run(void)
{
    make(small_run, "uff");
    attack_prefixes(1);
    attack_bits(3);
}

static void test_convert_files_survive_any_damage_to_a_universal_response(void)
{
    make(small_frf, "uff");
    attack_prefixes(1);
    attack_bits(7);
}

static void test_convert_files_survive_any_damage_to_a_binary_universal_file(void)
{
    make(small_run, "uff58b");
    attack_prefixes(1);
    attack_bits(7);
    free(bytes);
    make(small_frf, "uff58b");
    attack_prefixes(1);
    attack_bits(7);
}

/* Tables of other programs, with what makes them hard: quotes over line ends, times of day, marks between thousands,
   empty cells, UTF-16. A cut may leave a whole, shorter table. */
static const char *const foreign_texts[] = {
    "Logger\n\n\"Zeit\n[s]\";\"Moment [Nm]\";Lage;State\n;;(\xC2\xB0);(-)\n0,000;1.234,5;-2,5;RUN\n0,001;;1,25;RUN\n"
    "0,002;1.234;NaN;STOP\n0,003;0,5;3;RUN\n\nEnd;of it\n",
    "Date/Time,M_Nm,phi_deg\n2026-02-28T23:59:59.998Z,1,\"2,000.5\"\n2026-02-28T23:59:59.999Z,2,3\n"
    "2026-03-01T00:00:00.000Z,3,4\n2026-03-01T00:00:00.001Z,3,4\n",
    "Name\tx\r\nFile\tx.csv\r\nStarttime of "
    "export\t1\t2\r\n\r\nName\ta\tName\tb\r\nSampleTime[ms]\t1\tSampleTime[ms]\t1\r\n"
    "Unit\tNm (M)\tUnit\t\xB0 (A)\r\n\r\n0\t1,5\t0\t2\r\n1\t2,5\t1\t\r\n2\t3,5\t2\t4\r\n3\t1\t3\t2\r\nEOF\r\n",
};

static void take_text(const char *text, bool utf16)
{
    free(bytes);
    length = strlen(text) * (utf16 ? 2 : 1);
    bytes = calloc(length + 1, 1);
    for (size_t i = 0; bytes && i < strlen(text); i++)
        bytes[utf16 ? 2 * i : i] = text[i];
}

static void test_convert_files_survive_any_damage_to_a_table_of_another_program(void)
{
    for (size_t i = 0; i < sizeof foreign_texts / sizeof foreign_texts[0]; i++)
        for (int utf16 = 0; utf16 < 2; utf16++) {
            take_text(foreign_texts[i], utf16);
            TEST_ASSERT_EQUAL_INT(0, read_bytes(bytes, length, "whole", i));
            for (size_t cut = 0; cut < length; cut++)
                (void)read_bytes(bytes, cut, "cut after byte", cut);
            attack_bits(utf16 ? 5 : 2);
        }
}

static void ignore_without_matio(void)
{
    if (!mat_built_in())
        TEST_IGNORE_MESSAGE("built without matio");
}

static void test_convert_files_survive_any_damage_to_a_matlab_run(void)
{
    ignore_without_matio();
    make(small_run, "mat");
    attack_prefixes(1);
    attack_bits(3);
}

static void test_convert_files_survive_any_damage_to_a_matlab_response(void)
{
    ignore_without_matio();
    make(small_frf, "mat");
    attack_prefixes(1);
    attack_bits(3);
}

/* HDF5 opens a file slowly, and a file of it has more bytes: every 17th is cut, which hits each kind of structure. */
static void test_convert_files_refuse_a_matlab_file_of_version_73_that_is_cut_off(void)
{
    ignore_without_matio();
    make(small_run, "mat73");
    attack_prefixes(17);
}

/* A disk that takes `size` bytes per file and then no more. */
static int write_on_small_disk(const char *format, const char *path, rlim_t size, struct error *error)
{
    struct rlimit before, limit;
    struct run run = {.sample_rate_hz = 1000, .rows = 10000};
    double *torque = run_add_column(&run, "torque_Nm");
    struct record record = {.kind = record_run, .run = run};
    struct format_notes notes = {0};
    for (size_t n = 0; n < run.rows; n++)
        torque[n] = sin((double)n);
    getrlimit(RLIMIT_FSIZE, &before);
    limit = before;
    limit.rlim_cur = size;
    setrlimit(RLIMIT_FSIZE, &limit);
    int status = format_by_name(format)->write(path, &record, &notes, error);
    setrlimit(RLIMIT_FSIZE, &before);
    record_free(&record);
    format_notes_free(&notes);
    return status;
}

static void fill_disks(const char *format)
{
    const char *path = scratch_text("out", "old");
    struct error error = {0};
    signal(SIGXFSZ, SIG_IGN);
    // Full at once, within the first buffer, at its end, and in the last variable.
    const rlim_t sizes[] = {0, 1, 100, 4095, 4096, 65536, 80000};
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
        TEST_ASSERT_EQUAL_INT(error_refused, write_on_small_disk(format, path, sizes[i], &error));
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, path), error.message);
        char *text = scratch_load(path, NULL);
        TEST_ASSERT_EQUAL_STRING("old", text);
        free(text);
        TEST_ASSERT_EQUAL_INT_MESSAGE(1, scratch_count(), "a temporary file was left behind");
    }
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, write_on_small_disk(format, path, RLIM_INFINITY, &error), error.message);
}

static void test_convert_files_leave_the_old_universal_file_when_the_disk_is_full(void)
{
    fill_disks("uff");
    fill_disks("uff58b");
}

static void test_convert_files_leave_the_old_matlab_file_when_the_disk_is_full(void)
{
    ignore_without_matio();
    fill_disks("mat");
    fill_disks("mat73");
}

static void test_convert_files_refuse_a_device_for_a_matlab_file(void)
{
    ignore_without_matio();
    struct error error = {0};
    TEST_ASSERT_EQUAL_INT(error_refused, write_on_small_disk("mat", "/dev/null", RLIM_INFINITY, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "an ordinary file"), error.message);
}

int main(void)
{
    scratch_open();
    UNITY_BEGIN();
    RUN_TEST(test_convert_files_survive_any_damage_to_a_universal_run);
    RUN_TEST(test_convert_files_survive_any_damage_to_a_universal_response);
    RUN_TEST(test_convert_files_survive_any_damage_to_a_binary_universal_file);
    RUN_TEST(test_convert_files_survive_any_damage_to_a_table_of_another_program);
    RUN_TEST(test_convert_files_survive_any_damage_to_a_matlab_run);
    RUN_TEST(test_convert_files_survive_any_damage_to_a_matlab_response);
    RUN_TEST(test_convert_files_refuse_a_matlab_file_of_version_73_that_is_cut_off);
    RUN_TEST(test_convert_files_leave_the_old_universal_file_when_the_disk_is_full);
    RUN_TEST(test_convert_files_leave_the_old_matlab_file_when_the_disk_is_full);
    RUN_TEST(test_convert_files_refuse_a_device_for_a_matlab_file);
    int failures = UNITY_END();
    scratch_close();
    return failures;
}
