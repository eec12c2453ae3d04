/* SPDX-License-Identifier: MIT */
#include "lab/record/run_stream.h"

#include "lab/record/number.h"
#include "tests/support/scratch.h"
#include "unity.h"

#include <math.h>
#include <stdint.h>
#include <zlib.h>

static struct run run;
static struct run_stream *stream;
static struct error error;

void setUp(void)
{
    scratch_empty();
    error = (struct error){0};
    stream = NULL;
}

void tearDown(void)
{
    run_free(&run);
    run_stream_close(stream);
}

static uint64_t random_state;

static uint64_t random_bits(void)
{
    random_state ^= random_state << 13;
    random_state ^= random_state >> 7;
    random_state ^= random_state << 17;
    return random_state;
}

/* Rows in every spelling that a file may have. */
static int print_row(char *at, double raw, double speed)
{
    switch (random_bits() % 5) {
    case 0:
        return sprintf(at, "%.9g,%.17g,x\n", raw, speed);
    case 1:
        return sprintf(at, " %.3f , \"%.12e\",1\r\n", raw, speed);
    case 2:
        return sprintf(at, "%+.6f,%.15g,\n", raw, speed);
    case 3:
        return sprintf(at, "%.20f\t,%.25f,\"a, \"\"b\"\"\"\n", raw, speed);
    default:
        return sprintf(at, "%g,%.0f,nan\n\n", raw, speed);
    }
}

static char *make_text(size_t rows)
{
    char *text = malloc(128 + rows * 128), *at = text;
    at += sprintf(at, "# sample_rate_hz: 1000\n# period_samples: 10\n# excited_bins: [1, 3]\nraw,speed,note\n");
    random_state = 5;
    for (size_t n = 0; n < rows; n++) {
        double speed = ((double)(int64_t)random_bits()) * ldexp(1, -60 - (int)(random_bits() % 40));
        at += print_row(at, 0.25 * (double)n, speed);
    }
    sprintf(at, "# remark: at the end\n");
    return text;
}

static const struct run_options mapped = {.map = "torque_Nm=raw*2,current_A=raw,velocity_rad_per_s=speed*-0.5"};

static void open_stream(const char *path, const struct run_options *options)
{
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, run_stream_open(path, options, &stream, &error), error.message);
}

static void fill(size_t rows)
{
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, run_stream_fill(stream, rows, &error), error.message);
}

static void test_run_stream_says_how_much_of_the_file_it_has_read(void)
{
    enum { rows = 20000 }; // some chunks of the reader
    char *text = make_text(rows);
    open_stream(scratch_text("run.csv", text), &mapped);
    free(text);
    double before = run_stream_share(stream);
    TEST_ASSERT_TRUE(before > 0.0 && before < 0.5);
    while (!run_stream_ended(stream)) {
        run_stream_forget(stream);
        fill(1000);
        TEST_ASSERT_TRUE(run_stream_share(stream) >= before);
        before = run_stream_share(stream);
    }
    TEST_ASSERT_TRUE(before == 1.0);
}

static void test_run_stream_tells_who_reads_a_table_of_another_program(void)
{
    const char *path = scratch_text("log.csv", "t [ms];M [Nm]\n0;1,5\n1;2,5\n");
    TEST_ASSERT_EQUAL_INT(error_refused, run_stream_open(path, NULL, &stream, &error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "'servoscope convert'"), error.message);
    path = scratch_text("log.csv", "torque_Nm,velocity_rad_per_s\n0,x\n");
    TEST_ASSERT_EQUAL_INT(0, run_stream_open(path, NULL, &stream, &error));
    TEST_ASSERT_EQUAL_INT(error_refused, run_stream_fill(stream, 10, &error));
    TEST_ASSERT_NULL_MESSAGE(strstr(error.message, "'servoscope convert'"), error.message);
}

static void test_run_stream_gives_what_run_read_gives_in_pieces_of_any_size(void)
{
    enum { rows = 3000 };
    static const size_t pieces[] = {1, 7, 1024, 1025, rows};
    char *text = make_text(rows);
    const char *path = scratch_text("run.csv", text);
    free(text);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, run_read(path, &mapped, &run, &error), error.message);
    TEST_ASSERT_EQUAL_UINT(rows, run.rows);
    TEST_ASSERT_EQUAL_DOUBLE(0.5, run_column(&run, "torque_Nm")[1]);
    TEST_ASSERT_EQUAL_DOUBLE(0.25, run_column(&run, "current_A")[1]);
    for (size_t i = 0; i < sizeof pieces / sizeof pieces[0]; i++) {
        open_stream(path, &mapped);
        size_t done = 0;
        while (!run_stream_ended(stream)) {
            run_stream_forget(stream);
            fill(pieces[i]);
            const struct run *piece = run_stream_run(stream);
            TEST_ASSERT_EQUAL_UINT(run.column_count, piece->column_count);
            for (size_t c = 0; c < run.column_count && piece->rows > 0; c++) {
                TEST_ASSERT_EQUAL_STRING(run.columns[c].name, piece->columns[c].name);
                TEST_ASSERT_EQUAL_MEMORY(run.columns[c].data + done, piece->columns[c].data,
                                         piece->rows * sizeof(double));
            }
            done += piece->rows;
        }
        TEST_ASSERT_EQUAL_UINT(rows, done);
        TEST_ASSERT_EQUAL_UINT(rows, run_stream_rows(stream));
        TEST_ASSERT_EQUAL_INT_MESSAGE(0, run_stream_finish(stream, &error), error.message);
        TEST_ASSERT_EQUAL_DOUBLE(run.sample_rate_hz, run_stream_run(stream)->sample_rate_hz);
        TEST_ASSERT_EQUAL_STRING("at the end", run_key(run_stream_run(stream), "remark"));
        run_stream_close(stream);
        stream = NULL;
    }
}

static void test_run_stream_splits_off_a_leading_run_that_stands_by_itself(void)
{
    char *text = make_text(500);
    open_stream(scratch_text("run.csv", text), &mapped);
    free(text);
    struct run leading;
    fill(200);
    TEST_ASSERT_EQUAL_INT(0, run_stream_split(stream, &leading, &error));
    fill(100);
    const struct run *piece = run_stream_run(stream);
    TEST_ASSERT_EQUAL_UINT(200, leading.rows);
    TEST_ASSERT_EQUAL_UINT(100, piece->rows);
    TEST_ASSERT_EQUAL_DOUBLE(2 * 0.25 * 199, run_column(&leading, "torque_Nm")[199]);
    TEST_ASSERT_EQUAL_DOUBLE(2 * 0.25 * 200, run_column(piece, "torque_Nm")[0]);
    TEST_ASSERT_EQUAL_DOUBLE(0.25 * 299, run_column(piece, "current_A")[99]);
    run_stream_close(stream);
    stream = NULL;
    TEST_ASSERT_EQUAL_UINT(10, leading.period_samples);
    TEST_ASSERT_EQUAL_UINT32(3, leading.bins[1]);
    TEST_ASSERT_EQUAL_DOUBLE(1000, leading.sample_rate_hz);
    TEST_ASSERT_EQUAL_STRING("1000", run_key(&leading, "sample_rate_hz"));
    run_free(&leading);
}

/* The message of a file that is read `piece` rows at a time. */
static void refuse_in_pieces(const char *text, size_t piece, const char *message)
{
    const char *path = scratch_text("run.csv", text);
    int status = run_stream_open(path, NULL, &stream, &error);
    while (!status && !run_stream_ended(stream)) {
        run_stream_forget(stream);
        status = run_stream_fill(stream, piece, &error);
    }
    status = status ? status : run_stream_finish(stream, &error);
    run_stream_close(stream);
    stream = NULL;
    TEST_ASSERT_EQUAL_INT_MESSAGE(error_refused, status, message);
    const char *name = strstr(error.message, "run.csv");
    TEST_ASSERT_EQUAL_STRING(message, name ? name : error.message);
}

static void test_run_stream_refuses_in_pieces_what_run_read_refuses(void)
{
    static const struct {
        const char *text, *message;
    } cases[] = {
        {"time_s,torque_Nm\n0,1\n1,nan\n", "run.csv:3: torque_Nm: 'nan' is not a number"},
        {"time_s,torque_Nm\n0,1\n1,1\n2,-1e308\n",
         "run.csv:4: torque_Nm: -1e+308 is no measured value: at most 1e+30 was expected"},
        {"time_s,valid\n0,1\n1,2\n", "run.csv:3: valid: 2: 0 or 1 was expected"},
        {"time_s,torque_Nm\n0,1\n2\n", "run.csv:3: row has 1 cells, the row of names (line 1) has 2"},
        {"torque_Nm\n", "run.csv:2: the file ends without a row of numbers"},
        {"time_s,torque_Nm\n0,0\n1,0\n2,0\n2,0\n",
         "run.csv:5: time_s: 2 follows 2: time has to increase (--rate HZ trusts the rate and "
         "leaves the time stamps unjudged)"},
        {"time_s,torque_Nm\n0,0\n1,0\n2,0\n3,0\n\n6,0\n7,0\n",
         "run.csv:7: time_s: 6 follows 3: 2 samples are missing, a step of 1 s was expected"},
        {"# sample_rate_hz: 900\ntime_s,torque_Nm\n0,1\n0.001,1\n0.002,1\n",
         "run.csv: sample_rate_hz is 900, but time_s steps at 1000 Hz"},
        {"# sample_rate_hz: 1\n# period_samples: 2\n# periods: 2\ntorque_Nm\n1\n2\n3\n",
         "run.csv: 0 settling and 2 counted periods of 2 samples do not fit the 3 rows of the file"},
        {"torque_Nm\n1\n2\n3\n",
         "run.csv: no sample rate: a key '# sample_rate_hz: HZ', a column time_s or --rate HZ was expected"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++)
        for (size_t piece = 1; piece < 6; piece++) {
            refuse_in_pieces(cases[i].text, piece, cases[i].message);
            TEST_ASSERT_EQUAL_INT(error_refused, run_read(scratch_path("run.csv"), NULL, &run, &error));
            TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, cases[i].message), error.message);
        }
}

static void test_run_stream_takes_late_keys_only_as_long_as_nothing_was_forgotten(void)
{
    const char *text = "# sample_rate_hz: 10\ntorque_Nm\n1\n2\n3\n4\n# drive: 7\n# period_samples: 2\n";
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, run_read(scratch_text("run.csv", text), NULL, &run, &error), error.message);
    TEST_ASSERT_EQUAL_UINT(2, run.period_samples);
    refuse_in_pieces(text, 2,
                     "run.csv:8: period_samples: in a recording that is too large for memory this key has to stand in "
                     "front of the row of names (line 2)");
}

static void test_run_stream_knows_the_rate_of_the_time_stamps_so_far(void)
{
    open_stream(scratch_text("run.csv", "time_s,torque_Nm\n0,1\n0.1,1\n0.2,1\n0.31,1\n0.42,1\n"), NULL);
    fill(3);
    TEST_ASSERT_EQUAL_DOUBLE(10, run_stream_run(stream)->sample_rate_hz);
    fill(9);
    TEST_ASSERT_TRUE(run_stream_ended(stream));
    TEST_ASSERT_EQUAL_INT(0, run_stream_take(stream, &run, &error));
    TEST_ASSERT_EQUAL_DOUBLE(4 / 0.42, run.sample_rate_hz);
    TEST_ASSERT_EQUAL_UINT(5, run.rows);
}

/* Chunks of the reader end anywhere in a row: 400000 bytes in lines of all lengths, plain and gzipped. */
static void test_run_stream_joins_rows_that_cross_the_chunks_of_the_reader(void)
{
    enum { rows = 20000 };
    char *text = malloc(rows * 40), *at = text + sprintf(text, "# sample_rate_hz: 1\ntorque_Nm,position_rad\n");
    for (int n = 0; n < rows; n++)
        at += sprintf(at, "%d,%.*f\n", n, n % 17, (double)n);
    const char *plain = scratch_text("run.csv", text), *packed = scratch_path("run.csv.gz");
    gzFile file = gzopen(packed, "wb");
    gzwrite(file, text, (unsigned)(at - text));
    gzclose(file);
    free(text);
    for (int pass = 0; pass < 2; pass++) {
        open_stream(pass ? packed : plain, NULL);
        double sum = 0;
        while (!run_stream_ended(stream)) {
            run_stream_forget(stream);
            fill(999);
            for (size_t n = 0; n < run_stream_run(stream)->rows; n++)
                sum += run_stream_run(stream)->columns[0].data[n] + run_stream_run(stream)->columns[1].data[n];
        }
        TEST_ASSERT_EQUAL_DOUBLE((double)rows * (rows - 1), sum);
        run_stream_close(stream);
        stream = NULL;
    }
}

/* Half way between two doubles, or one digit beside it, which is where a rounding error shows: an odd number of 54 bits
 * times 5^q, over 10^q. */
static uint64_t tie(int *out_power)
{
    uint64_t digits = random_bits() >> 10 | (uint64_t)1 << 53 | 1;
    int halvings = (int)(random_bits() % 4);
    for (int q = 0; q < halvings; q++)
        digits *= 5;
    *out_power = -halvings;
    return digits + random_bits() % 3 - 1;
}

/* Every length from 1 to 19 digits, every power of ten that number_read takes, and ties. */
static void test_number_read_is_exact_to_the_last_bit(void)
{
    const uint64_t seed = 77;
    random_state = seed;
    for (int i = 0; i < 300000; i++) {
        char text[64], message[96];
        uint64_t digits = random_bits() / 2;
        int power = (int)(random_bits() % 55) - 27;
        for (uint64_t drop = random_bits() % 20; drop > 0; drop--)
            digits /= 10;
        if (i % 3 == 0)
            digits = tie(&power);
        snprintf(text, sizeof text, "%llue%d", (unsigned long long)digits, power);
        snprintf(message, sizeof message, "%s (seed %llu, text %d)", text, (unsigned long long)seed, i);
        double value = -1, expected = strtod(text, NULL);
        const char *end = text + strlen(text), *stop = number_read(text, end, &value);
        TEST_ASSERT_TRUE_MESSAGE(stop == end, message);
        TEST_ASSERT_EQUAL_MEMORY_MESSAGE(&expected, &value, sizeof value, message);
    }
}

static void test_number_read_stops_where_the_number_ends(void)
{
    static const struct {
        const char *text;
        int length; /* -1: no number that it takes */
    } cases[] = {{"1,2", 1},
                 {"-1.5e3;", 6},
                 {"1.", 2},
                 {".5x", 2},
                 {"1 ", 1},
                 {"12345678,", 8},
                 {"", -1},
                 {"-", -1},
                 {".", -1},
                 {"e5", -1},
                 {"1e", -1},
                 {"nan", -1},
                 {"1e28", -1},
                 {"0x10", 1},
                 {"0e-99", 5},
                 {"00000000000000000000000000.5", 28},
                 {"12345678901234567890", -1}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        double value;
        const char *text = cases[i].text, *stop = number_read(text, text + strlen(text), &value);
        TEST_ASSERT_EQUAL_INT_MESSAGE(cases[i].length, stop ? (int)(stop - text) : -1, text);
    }
}

int main(void)
{
    scratch_open();
    UNITY_BEGIN();
    RUN_TEST(test_run_stream_says_how_much_of_the_file_it_has_read);
    RUN_TEST(test_run_stream_tells_who_reads_a_table_of_another_program);
    RUN_TEST(test_run_stream_gives_what_run_read_gives_in_pieces_of_any_size);
    RUN_TEST(test_run_stream_splits_off_a_leading_run_that_stands_by_itself);
    RUN_TEST(test_run_stream_refuses_in_pieces_what_run_read_refuses);
    RUN_TEST(test_run_stream_takes_late_keys_only_as_long_as_nothing_was_forgotten);
    RUN_TEST(test_run_stream_knows_the_rate_of_the_time_stamps_so_far);
    RUN_TEST(test_run_stream_joins_rows_that_cross_the_chunks_of_the_reader);
    RUN_TEST(test_number_read_is_exact_to_the_last_bit);
    RUN_TEST(test_number_read_stops_where_the_number_ends);
    int failures = UNITY_END();
    scratch_close();
    return failures;
}
