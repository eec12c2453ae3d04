/* SPDX-License-Identifier: MIT */
/// Every prefix and every changed byte of small run, model and response files, plain and gzipped: refused with a
/// message or read, never a crash (the sanitizers watch), and what was read can be written and read back to the same.
/// Writing to a full disk leaves the old file as it was.
#define _XOPEN_SOURCE 700 /* SIGXFSZ */
#include "lab/record/frf_file.h"
#include "lab/record/model_file.h"
#include "lab/record/run.h"
#include "tests/support/scratch.h"
#include "unity.h"

#include <math.h>
#include <signal.h>
#include <sys/resource.h>
#include <zlib.h>

static const char small_run[] =
    "# sample_rate_hz: 100\n# period_samples: 4\n# periods: 1\n# settle_periods: 1\n"
    "# excited_bins: [1]\n# table_crc32: 0x0badcafe\n# note: x\n"
    "time_s,torque_Nm,position_rad,\"odd, one\"\n"
    "0,0.1,-1e-3,7\n.01,2,0.5,\n0.02,3,1,8\n0.03,4,5,9\n0.04,0,0,0\n0.05,0,0,0\r\n0.06,1,0,0\n0.07,1,0,0\n";

static const char small_frf[] = "# input: torque_Nm\n# periods: 3\n# degrees_of_freedom: 2\n"
                                "frequency_hz,real,imag,std,noise_std,odd_distortion,even_distortion,valid\n"
                                "0.5,1,-2,0.1,0.05,,,1\n1,0.5,-1e-2,0.1,,0.2,0,0\n";

static const char small_model[] =
    "{\"structure\": \"rigid\", \"motor_inertia_kgm2\": 0.005, \"coulomb_friction_Nm\": 0.05,\n"
    " \"effects\": {\"cogging\": {\"amplitude_Nm\": 3e-2, \"periods_per_rev\": 12}},\n"
    " \"sensors\": {\"counts_per_rev\": 4096}, \"end_stops_rad\": [-1, 1], \"seed\": \"5\"}\n";

/// Reads a file; 0 if that went well and the file that it writes then reads the same, 1 if refused with a message.
typedef int (*reader)(const char *path);

static char failure[1536];

static int fail_with(const char *what, const struct error *error)
{
    snprintf(failure, sizeof failure, "%s: %s", what, error->message);
    return -1;
}

static int check_refusal(const struct error *error, int status)
{
    if (error->status != status || error->message[0] == '\0' || strchr(error->message, '\n'))
        return fail_with("refused without one line that says why", error);
    return 1;
}

static int same_numbers(const double *a, const double *b, size_t count)
{
    for (size_t n = 0; n < count; n++)
        if (memcmp(&a[n], &b[n], sizeof *a) != 0 && !(isnan(a[n]) && isnan(b[n])))
            return 0;
    return 1;
}

static int read_run(const char *path)
{
    struct error error = {0};
    struct run first, second;
    int status = run_read(path, NULL, &first, &error);
    if (status)
        return check_refusal(&error, status);
    const char *copy = scratch_path("copy");
    if (run_write(copy, &first, &error) || run_read(copy, NULL, &second, &error))
        return fail_with("read, but not written and read again", &error);
    int result = first.rows == second.rows && first.column_count == second.column_count && first.rows > 0 &&
                 first.sample_rate_hz > 0 && isfinite(first.sample_rate_hz) &&
                 first.period_samples == second.period_samples && first.bin_count == second.bin_count &&
                 first.linear == second.linear;
    for (size_t c = 0; result && c < first.column_count; c++)
        result = strcmp(first.columns[c].name, second.columns[c].name) == 0 &&
                 same_numbers(first.columns[c].data, second.columns[c].data, first.rows);
    run_free(&first);
    run_free(&second);
    return result ? 0 : fail_with("a run reads back differently", &error);
}

static int read_frf(const char *path)
{
    struct error error = {0};
    struct frf first, second;
    int status = frf_read(path, &first, &error);
    if (status)
        return check_refusal(&error, status);
    const char *copy = scratch_path("copy");
    if (frf_write(copy, &first, &error) || frf_read(copy, &second, &error))
        return fail_with("read, but not written and read again", &error);
    int result = first.count == second.count && same_numbers(first.frequency_hz, second.frequency_hz, first.count) &&
                 same_numbers(first.real, second.real, first.count) &&
                 same_numbers(first.imag, second.imag, first.count) && same_numbers(first.std, second.std, first.count);
    frf_free(&first);
    frf_free(&second);
    return result ? 0 : fail_with("a response reads back differently", &error);
}

static int read_model(const char *path)
{
    struct error error = {0};
    static struct sim_model first, second;
    int status = model_file_read(path, &first, &error);
    if (status)
        return check_refusal(&error, status);
    const char *copy = scratch_path("copy");
    if (model_file_write(copy, &first, NULL, &error) || model_file_read(copy, &second, &error))
        return fail_with("read, but not written and read again", &error);
    return memcmp(&first, &second, sizeof first) == 0 ? 0 : fail_with("a model reads back differently", &error);
}

void setUp(void)
{
    scratch_empty();
}

void tearDown(void) {}

static void read_one(reader read, const void *bytes, size_t length, const char *what, size_t position, size_t counts[2])
{
    int result = read(scratch_bytes("in", bytes, length));
    char message[2048];
    snprintf(message, sizeof message, "%s %zu: %s", what, position, failure);
    TEST_ASSERT_TRUE_MESSAGE(result == 0 || result == 1, message);
    counts[result]++;
}

/* counts[0]: how many were read, counts[1]: how many were refused. */
static void read_every_prefix(reader read, const void *bytes, size_t length, size_t counts[2])
{
    counts[0] = counts[1] = 0;
    for (size_t cut = 0; cut < length; cut++)
        read_one(read, bytes, cut, "cut after byte", cut, counts);
}

/* Characters that steer a parser, and each bit of the old one turned over. */
static void read_every_mutation(reader read, const void *bytes, size_t length, size_t counts[2])
{
    static const char steering[] = {0,   '\n', '\r', ',', '"', '#', ':', '[',  ']',    '{',
                                    '}', '.',  '-',  'e', 'x', '9', ' ', '\\', '\x7f', '\xff'};
    unsigned char *copy = malloc(length);
    counts[0] = counts[1] = 0;
    for (size_t at = 0; at < length; at++) {
        memcpy(copy, bytes, length);
        for (size_t i = 0; i < sizeof steering; i++) {
            copy[at] = (unsigned char)steering[i];
            read_one(read, copy, length, "steering character at byte", at, counts);
        }
        for (int bit = 0; bit < 8; bit++) {
            copy[at] = (unsigned char)(((const unsigned char *)bytes)[at] ^ (1u << bit));
            read_one(read, copy, length, "bit turned over in byte", at, counts);
        }
    }
    free(copy);
}

static char *gzip(const char *text, size_t *out_length)
{
    gzFile file = gzopen(scratch_path("packed"), "wb9");
    gzputs(file, text);
    gzclose(file);
    return scratch_load(scratch_path("packed"), out_length);
}

/* The small file itself has to be read, or everything after it would be refused for the wrong reason. */
static void attack(reader read, const char *text)
{
    size_t counts[2] = {0};
    read_one(read, text, strlen(text), "whole", 0, counts);
    TEST_ASSERT_EQUAL_UINT(1, counts[0]);
    read_every_prefix(read, text, strlen(text), counts);
    TEST_ASSERT_TRUE(counts[1] > counts[0]);
    read_every_mutation(read, text, strlen(text), counts);
    TEST_ASSERT_TRUE(counts[0] > 0 && counts[1] > 0);
}

static void attack_packed(reader read, const char *text)
{
    size_t counts[2] = {0}, length;
    char *packed = gzip(text, &length);
    read_one(read, packed, length, "whole", 0, counts);
    TEST_ASSERT_EQUAL_UINT(1, counts[0]);
    read_every_prefix(read, packed, length, counts);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, counts[0], "a gzip file that was cut off was taken for whole");
    read_every_mutation(read, packed, length, counts);
    TEST_ASSERT_TRUE(counts[1] > counts[0]);
    free(packed);
}

static void test_record_files_survive_any_damage_to_a_run(void)
{
    attack(read_run, small_run);
}

static void test_record_files_survive_any_damage_to_a_gzipped_run(void)
{
    attack_packed(read_run, small_run);
}

static void test_record_files_survive_any_damage_to_a_response(void)
{
    attack(read_frf, small_frf);
}

static void test_record_files_survive_any_damage_to_a_gzipped_response(void)
{
    attack_packed(read_frf, small_frf);
}

static void test_record_files_survive_any_damage_to_a_model(void)
{
    attack(read_model, small_model);
}

/* Writes a run of about 100 kB to `path`. */
static int write_large(const char *path, struct error *error)
{
    struct run run = {.sample_rate_hz = 1000, .rows = 10000};
    double *torque = run_add_column(&run, "torque_Nm");
    for (size_t n = 0; n < run.rows; n++)
        torque[n] = sin((double)n);
    int status = run_write(path, &run, error);
    run_free(&run);
    return status;
}

/* A disk that takes `bytes` per file and then no more. */
static void with_small_disk(rlim_t bytes)
{
    struct rlimit limit;
    TEST_ASSERT_EQUAL_INT(0, getrlimit(RLIMIT_FSIZE, &limit));
    limit.rlim_cur = bytes;
    TEST_ASSERT_EQUAL_INT(0, setrlimit(RLIMIT_FSIZE, &limit));
}

static void test_record_files_leave_the_old_file_when_the_disk_is_full(void)
{
    const char *path = scratch_text("run.csv", "old");
    struct error error = {0};
    struct rlimit before;
    TEST_ASSERT_EQUAL_INT(0, getrlimit(RLIMIT_FSIZE, &before));
    signal(SIGXFSZ, SIG_IGN);
    // Full at once, within the first buffer, at its end, and just before the last byte.
    const rlim_t sizes[] = {0, 1, 4095, 4096, 65536, 100000};
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
        with_small_disk(sizes[i]);
        int status = write_large(path, &error);
        setrlimit(RLIMIT_FSIZE, &before);
        TEST_ASSERT_EQUAL_INT(error_refused, status);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "as it was before"), error.message);
        char *text = scratch_load(path, NULL);
        TEST_ASSERT_EQUAL_STRING("old", text);
        free(text);
        TEST_ASSERT_EQUAL_INT_MESSAGE(1, scratch_count(), "a temporary file was left behind");
    }
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, write_large(path, &error), error.message);
}

static void test_record_files_say_when_a_device_is_full(void)
{
    struct error error = {0};
    TEST_ASSERT_EQUAL_INT(error_refused, write_large("/dev/full", &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "No space left"), error.message);
}

int main(void)
{
    scratch_open();
    UNITY_BEGIN();
    RUN_TEST(test_record_files_survive_any_damage_to_a_run);
    RUN_TEST(test_record_files_survive_any_damage_to_a_gzipped_run);
    RUN_TEST(test_record_files_survive_any_damage_to_a_response);
    RUN_TEST(test_record_files_survive_any_damage_to_a_gzipped_response);
    RUN_TEST(test_record_files_survive_any_damage_to_a_model);
    RUN_TEST(test_record_files_leave_the_old_file_when_the_disk_is_full);
    RUN_TEST(test_record_files_say_when_a_device_is_full);
    int failures = UNITY_END();
    scratch_close();
    return failures;
}
