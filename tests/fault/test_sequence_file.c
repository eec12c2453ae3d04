/* SPDX-License-Identifier: MIT */
/// Manifests of tables and of runs: what is written reads back the same, every member that is wrong or missing is
/// refused with line, place, value and expectation, and every prefix and changed byte of a small one is refused with a
/// message or read, never a crash (the sanitizers watch).
#include "lab/record/manifest.h"
#include "lab/record/run_sequence.h"
#include "lab/record/sequence_file.h"
#include "tests/support/scratch.h"
#include "unity.h"

static const char small_tables[] =
    "{\"holds\": \"tables\", \"kind\": \"octaves\",\n"
    " \"sample_rate_hz\": 1000, \"period_samples\": 20,\n"
    " \"inputs\": 2, \"periods\": 3,\n"
    " \"settle_s\": 0.5, \"test_time_s\": 1.16,\n"
    " \"segments\": [\n"
    "  {\"periods\": 1, \"tables\": [\n"
    "   {\"file\": \"t-1-1.mst\", \"table_crc32\": \"0x0badcafe\", \"excited_bins\": [1]},\n"
    "   {\"file\": \"t-1-2.mst\", \"table_crc32\": \"0x1\", \"excited_bins\": [2]}]},\n"
    "  {\"periods\": 2, \"tables\": [\n"
    "   {\"file\": \"t-2-1.mst\", \"table_crc32\": \"0x2\", \"excited_bins\": [3, 5]},\n"
    "   {\"file\": \"t-2-2.mst\", \"table_crc32\": \"0x3\", \"excited_bins\": [4, 6]}]}]}\n";

static const char small_runs[] = "{\"holds\": \"runs\", \"kind\": \"dwell\", \"complete\": false,\n"
                                 " \"stopped_by\": \"a limit\",\n"
                                 " \"segments\": [\n"
                                 "  {\"table\": \"t-1.mst\", \"table_crc32\": \"0x0badcafe\", \"run\": \"r-1.csv\",\n"
                                 "   \"periods\": 2, \"periods_planned\": 3},\n"
                                 "  {\"table\": \"t-2.mst\", \"table_crc32\": \"0x2\", \"run\": null,\n"
                                 "   \"periods_planned\": 3}]}\n";

static struct error error;

void setUp(void)
{
    scratch_empty();
    error = (struct error){0};
}

void tearDown(void) {}

/// Reads text as a manifest; if that goes well, what is written of it has to read the same, byte for byte when written
/// once more. Returns the status.
static int read_tables(const void *bytes, size_t length)
{
    struct sequence_file first, second;
    int status = sequence_file_read(scratch_bytes("in", bytes, length), &first, &error);
    if (status) {
        TEST_ASSERT_NULL(first.segments);
        return status;
    }
    const char *copy = scratch_path("copy");
    const char *again = scratch_path("again");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, sequence_file_write(copy, &first, &error), error.message);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, sequence_file_read(copy, &second, &error), error.message);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, sequence_file_write(again, &second, &error), error.message);
    char *one = scratch_load(copy, NULL);
    char *other = scratch_load(again, NULL);
    TEST_ASSERT_EQUAL_STRING(one, other);
    free(one);
    free(other);
    sequence_file_free(&first);
    sequence_file_free(&second);
    return 0;
}

static int read_runs(const void *bytes, size_t length)
{
    struct run_sequence first, second;
    int status = run_sequence_read(scratch_bytes("in", bytes, length), &first, &error);
    if (status) {
        TEST_ASSERT_NULL(first.segments);
        return status;
    }
    const char *copy = scratch_path("copy");
    const char *again = scratch_path("again");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, run_sequence_write(copy, &first, &error), error.message);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, run_sequence_read(copy, &second, &error), error.message);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, run_sequence_write(again, &second, &error), error.message);
    char *one = scratch_load(copy, NULL);
    char *other = scratch_load(again, NULL);
    TEST_ASSERT_EQUAL_STRING(one, other);
    free(one);
    free(other);
    run_sequence_free(&first);
    run_sequence_free(&second);
    return 0;
}

typedef int (*reader)(const void *bytes, size_t length);

static void test_tables_read_as_they_are_written(void)
{
    struct sequence_file file;
    TEST_ASSERT_EQUAL_INT(0, read_tables(small_tables, sizeof small_tables - 1));
    TEST_ASSERT_EQUAL_INT(0, sequence_file_read(scratch_text("in", small_tables), &file, &error));
    TEST_ASSERT_EQUAL_STRING("octaves", file.kind);
    TEST_ASSERT_EQUAL_size_t(2, file.segment_count);
    TEST_ASSERT_EQUAL_size_t(2, file.inputs);
    TEST_ASSERT_EQUAL_UINT64(3, file.periods);
    TEST_ASSERT_EQUAL_UINT64(2, file.segments[1].periods);
    TEST_ASSERT_EQUAL_STRING("t-1-2.mst", file.segments[0].tables[1].file);
    TEST_ASSERT_EQUAL_HEX32(0x0badcafe, file.segments[0].tables[0].table_crc32);
    TEST_ASSERT_EQUAL_size_t(2, file.segments[1].tables[1].bin_count);
    TEST_ASSERT_EQUAL_UINT32(6, file.segments[1].tables[1].bins[1]);
    sequence_file_free(&file);
}

static void test_runs_read_as_they_are_written(void)
{
    struct run_sequence file;
    TEST_ASSERT_EQUAL_INT(0, read_runs(small_runs, sizeof small_runs - 1));
    TEST_ASSERT_EQUAL_INT(0, run_sequence_read(scratch_text("in", small_runs), &file, &error));
    TEST_ASSERT_EQUAL_STRING("dwell", file.kind);
    TEST_ASSERT_EQUAL_STRING("a limit", file.stopped_by);
    TEST_ASSERT_EQUAL_STRING("r-1.csv", file.segments[0].run);
    TEST_ASSERT_EQUAL_UINT64(2, file.segments[0].periods);
    TEST_ASSERT_NULL(file.segments[1].run);
    TEST_ASSERT_FALSE(run_sequence_complete(&file));
    file.segments[0].periods = file.segments[1].periods = 3;
    TEST_ASSERT_TRUE(run_sequence_complete(&file));
    run_sequence_free(&file);
}

/// Replaces the first `from` by `to` and expects a refusal that has `part`.
static void refuse(reader read, const char *text, const char *from, const char *to, const char *part)
{
    char changed[2048];
    const char *at = strstr(text, from);
    TEST_ASSERT_NOT_NULL_MESSAGE(at, from);
    snprintf(changed, sizeof changed, "%.*s%s%s", (int)(at - text), text, to, at + strlen(from));
    TEST_ASSERT_EQUAL_INT_MESSAGE(error_refused, read(changed, strlen(changed)), to);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, part), error.message);
    TEST_ASSERT_NULL_MESSAGE(strchr(error.message, '\n'), error.message);
}

static void test_tables_refused_with_line_place_value_and_expectation(void)
{
    static const struct {
        const char *from, *to, *part;
    } cases[] = {
        {"\"tables\", \"kind", "\"runs\", \"kind", "in:1: holds: \"runs\": a manifest that holds \"tables\""},
        {"\"holds\": \"tables\", ", "", "holds: is missing: a manifest that holds \"tables\""},
        {"octaves", "stairs", "in:1: kind: \"stairs\": expected one of octaves, dwell, multisine"},
        {": 1000,", ": 0,", "in:2: sample_rate_hz: 0: a number of at least 1e-06"},
        {": 1000,", ": 1e999,", "sample_rate_hz"},
        {": 20,", ": 3,", "in:2: period_samples: 3: a whole number from 4 to 1048576"},
        {": 20,", ": 20.5,", "period_samples: 20.5: a whole number"},
        {"\"inputs\": 2", "\"inputs\": 0", "in:3: inputs: 0: a whole number from 1 to 16"},
        {"\"inputs\": 2", "\"inputs\": 3", "in:6: segments[0].tables: 2 tables: expected one for each of 3 inputs"},
        {"\"periods\": 3", "\"periods\": -3", "in:3: periods: -3: a whole number from 1"},
        {": 0.5,", ": -1,", "in:4: settle_s: -1: a number of at least 0"},
        {": 1.16,", ": \"1.16\",", "in:4: test_time_s: \"1.16\": a number"},
        {"\"segments\": [", "\"segments\": 3, \"x\": [", "in:5: segments: 3: an array of 1 to 4096"},
        {"\"periods\": 2,", "\"periods\": 0,", "in:9: segments[1].periods: 0: a whole number from 1"},
        {"\"periods\": 2,", "", "segments[1].periods: is missing"},
        {"t-2-1.mst", "", "in:10: segments[1].tables[0].file: \"\": the name of a file beside this one"},
        {"t-2-1.mst", "/etc/passwd", "segments[1].tables[0].file: \"/etc/passwd\": the name of a file beside"},
        {"t-2-1.mst", "../t.mst", "segments[1].tables[0].file"},
        {"t-2-1.mst", "a/../../t.mst", "segments[1].tables[0].file"},
        {"\"0x3\"", "3", "in:11: segments[1].tables[1].table_crc32: 3: \"0x\" and up to eight"},
        {"\"0x3\"", "\"0x123456789\"", "table_crc32: \"0x123456789\""},
        {"\"0x3\"", "\"0x3z\"", "table_crc32: \"0x3z\""},
        {"[4, 6]", "[4, 4]", "in:11: segments[1].tables[1].excited_bins[1]: 4: bins ascend from 1"},
        {"[4, 6]", "[4, 10]", "excited_bins[1]: 10: bins ascend from 1 and stay below half of period_samples"},
        {"[4, 6]", "[0]", "excited_bins[0]: 0"},
        {"[4, 6]", "[4, 5.5]", "excited_bins[1]: 5.5"},
        {"[4, 6]", "[]", "segments[1].tables[1].excited_bins: []: an array of 1 to 9 elements"},
        {"\"octaves\"", "\"octaves\", \"kind\": \"dwell\"", "kind: is there twice"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        refuse(read_tables, small_tables, cases[i].from, cases[i].to, cases[i].part);
    }
}

static void test_runs_refused_with_line_place_value_and_expectation(void)
{
    static const struct {
        const char *from, *to, *part;
    } cases[] = {
        {"\"runs\"", "\"tables\"", "in:1: holds: \"tables\": a manifest that holds \"runs\""},
        {"\"dwell\"", "7", "in:1: kind: 7: expected one of octaves, dwell, multisine"},
        {"\"a limit\"", "true", "in:2: stopped_by: true: a text was expected"},
        {"\"t-2.mst\"", "null", "in:6: segments[1].table: null: the name of a file"},
        {"\"periods\": 2", "\"periods\": 4", "in:5: segments[0].periods: 4: a whole number from 0 to 3"},
        {"\"r-1.csv\"", "5", "in:4: segments[0].run: 5: the name of a file"},
        {",\n   \"periods_planned\": 3}]", "}]", "segments[1].periods_planned: is missing"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        refuse(read_runs, small_runs, cases[i].from, cases[i].to, cases[i].part);
    }
}

static void check_one(reader read, const char *bytes, size_t length, size_t counts[2])
{
    int status = read(bytes, length);
    TEST_ASSERT_TRUE(status == 0 || status == error_refused);
    if (status) {
        TEST_ASSERT_TRUE_MESSAGE(error.message[0] != '\0' && !strchr(error.message, '\n'), error.message);
    }
    counts[status]++;
}

static void test_every_prefix_and_changed_byte_is_read_or_refused(void)
{
    static const struct {
        reader read;
        const char *text;
        size_t length;
    } files[] = {{read_tables, small_tables, sizeof small_tables - 1}, {read_runs, small_runs, sizeof small_runs - 1}};
    static const char replacements[] = {'\0', '"', '{', ']', '9', '-', '\n', (char)0xff};
    for (size_t f = 0; f < 2; f++) {
        size_t counts[2] = {0, 0};
        for (size_t length = 0; length < files[f].length; length++) {
            check_one(files[f].read, files[f].text, length, counts);
        }
        TEST_ASSERT_EQUAL_size_t(1, counts[0]); // without the last newline
        for (size_t position = 0; position < files[f].length; position++) {
            for (size_t r = 0; r < sizeof replacements; r++) {
                char changed[2048];
                memcpy(changed, files[f].text, files[f].length);
                changed[position] = replacements[r];
                check_one(files[f].read, changed, files[f].length, counts);
            }
        }
        TEST_ASSERT_GREATER_THAN_size_t(files[f].length, counts[1]);
        TEST_ASSERT_GREATER_THAN_size_t(10, counts[0]); // digits of numbers and names of files
    }
}

static void test_manifest_is_told_by_content(void)
{
    TEST_ASSERT_TRUE(manifest_is(scratch_text("a.csv", "{}")));
    TEST_ASSERT_TRUE(manifest_is(scratch_text("a", "\xEF\xBB\xBF\r\n  {")));
    TEST_ASSERT_FALSE(manifest_is(scratch_text("a.json", "# sample_rate_hz: 1000\n")));
    TEST_ASSERT_FALSE(manifest_is(scratch_text("a.json", "")));
    TEST_ASSERT_FALSE(manifest_is(scratch_bytes("a.json", "MST\x1a{", 5)));
    TEST_ASSERT_FALSE(manifest_is(scratch_path("none.json")));
}

static void test_manifest_names_files_beside_it(void)
{
    char *beside = manifest_beside("/data/x/run.json", "run-1.csv");
    TEST_ASSERT_EQUAL_STRING("/data/x/run-1.csv", beside);
    free(beside);
    beside = manifest_beside("run.json", "run-1.csv");
    TEST_ASSERT_EQUAL_STRING("run-1.csv", beside);
    free(beside);
}

static void test_table_of_another_design_is_refused(void)
{
    struct sequence_file file;
    TEST_ASSERT_EQUAL_INT(0, sequence_file_read(scratch_text("in", small_tables), &file, &error));
    TEST_ASSERT_EQUAL_INT(0, sequence_file_check_table(&file, 1, 0, "t", 2, 1000, 20, &error));
    TEST_ASSERT_EQUAL_INT(error_refused, sequence_file_check_table(&file, 1, 0, "t", 3, 1000, 20, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "t: table_crc32 is 0x00000003, but"), error.message);
    TEST_ASSERT_EQUAL_INT(error_refused, sequence_file_check_table(&file, 1, 0, "t", 2, 1001, 20, &error));
    TEST_ASSERT_EQUAL_INT(error_refused, sequence_file_check_table(&file, 1, 0, "t", 2, 1000, 40, &error));
    sequence_file_free(&file);
}

int main(void)
{
    scratch_open();
    UNITY_BEGIN();
    RUN_TEST(test_tables_read_as_they_are_written);
    RUN_TEST(test_runs_read_as_they_are_written);
    RUN_TEST(test_tables_refused_with_line_place_value_and_expectation);
    RUN_TEST(test_runs_refused_with_line_place_value_and_expectation);
    RUN_TEST(test_every_prefix_and_changed_byte_is_read_or_refused);
    RUN_TEST(test_manifest_is_told_by_content);
    RUN_TEST(test_manifest_names_files_beside_it);
    RUN_TEST(test_table_of_another_design_is_refused);
    int failures = UNITY_END();
    scratch_close();
    return failures;
}
