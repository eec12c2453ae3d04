/* SPDX-License-Identifier: MIT */
#include "lab/record/number.h"
#include "lab/record/run.h"
#include "tests/support/scratch.h"
#include "unity.h"

#include <float.h>
#include <math.h>
#include <stdint.h>
#include <zlib.h>

static struct run run;
static struct error error;

void setUp(void)
{
    scratch_empty();
    error = (struct error){0};
}

void tearDown(void)
{
    run_free(&run);
}

static void read_as(const char *text, const struct run_options *options)
{
    run_free(&run);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, run_read(scratch_text("run.csv", text), options, &run, &error), error.message);
}

static void read_text(const char *text)
{
    read_as(text, NULL);
}

/* The message without the folder in front of it has to be exactly this. */
static void refuse_as(const char *text, const struct run_options *options, int status, const char *message)
{
    run_free(&run);
    TEST_ASSERT_EQUAL_INT_MESSAGE(status, run_read(scratch_text("run.csv", text), options, &run, &error),
                                  error.message);
    const char *name = strstr(error.message, "run.csv");
    TEST_ASSERT_EQUAL_STRING(message, name ? name : error.message);
    TEST_ASSERT_EQUAL_INT(status, error.status);
    TEST_ASSERT_NULL(run.columns);
    TEST_ASSERT_NULL(run.keys);
    TEST_ASSERT_EQUAL_UINT(0, run.rows);
}

static void refuse(const char *text, const char *message)
{
    refuse_as(text, NULL, error_refused, message);
}

static void test_run_read_takes_keys_columns_and_rows(void)
{
    read_text("# sample_rate_hz: 1000\n# period_samples: 4\n# periods: 1\n# settle_periods: 1\n# excited_bins: [1]\n"
              "# table_crc32: 0x00c0ffee\n# drive: motor no. 7, left\n# a remark\n"
              "time_s,torque_Nm,position_rad,note\n"
              "0,0.5,1,a\n0.001,-.25,2,b\n0.002,1e-3,3,4\n0.003,+7.,4,\n0.004,0,5,\n0.005,0,6,\n0.006,0,7,nan\n0.007,0,"
              "8,0x10\n");
    TEST_ASSERT_EQUAL_DOUBLE(1000, run.sample_rate_hz);
    TEST_ASSERT_EQUAL_UINT(4, run.period_samples);
    TEST_ASSERT_EQUAL_UINT(1, run.periods);
    TEST_ASSERT_EQUAL_UINT(1, run.settle_periods);
    TEST_ASSERT_TRUE(run.has_settle_periods);
    TEST_ASSERT_EQUAL_UINT(1, run.bin_count);
    TEST_ASSERT_EQUAL_UINT32(1, run.bins[0]);
    TEST_ASSERT_TRUE(run.has_table_crc32);
    TEST_ASSERT_EQUAL_HEX32(0x00c0ffee, run.table_crc32);
    TEST_ASSERT_FALSE(run.linear);
    TEST_ASSERT_EQUAL_UINT(8, run.rows);
    TEST_ASSERT_EQUAL_STRING("motor no. 7, left", run_key(&run, "drive"));
    const double *torque = run_column(&run, "torque_Nm"), *note = run_column(&run, "note");
    TEST_ASSERT_EQUAL_DOUBLE(-0.25, torque[1]);
    TEST_ASSERT_EQUAL_DOUBLE(7, torque[3]);
    TEST_ASSERT_EQUAL_DOUBLE(4, note[2]);
    const size_t not_numbers[] = {0, 1, 3, 6, 7};
    for (size_t i = 0; i < sizeof not_numbers / sizeof not_numbers[0]; i++)
        TEST_ASSERT_TRUE(isnan(note[not_numbers[i]]));
    TEST_ASSERT_NULL(run_column(&run, "velocity_rad_per_s"));
}

static void test_run_read_takes_a_byte_order_mark_crlf_blanks_and_no_last_newline(void)
{
    read_text("\xEF\xBB\xBF# sample_rate_hz : 500 \r\n\r\n torque_Nm , \"load_position_rad\" \r\n 1 "
              ",\"2\"\r\n\t3,4\r\n\r\n\r\n5,6");
    TEST_ASSERT_EQUAL_DOUBLE(500, run.sample_rate_hz);
    TEST_ASSERT_EQUAL_UINT(3, run.rows);
    TEST_ASSERT_EQUAL_DOUBLE(2, run_column(&run, "load_position_rad")[0]);
    TEST_ASSERT_EQUAL_DOUBLE(6, run_column(&run, "load_position_rad")[2]);
}

static void test_run_read_takes_gzip_by_content(void)
{
    gzFile file = gzopen(scratch_path("run.csv"), "wb");
    gzputs(file, "time_s,force_N\n0,1\n0.5,2\n");
    gzclose(file);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, run_read(scratch_path("run.csv"), NULL, &run, &error), error.message);
    TEST_ASSERT_EQUAL_DOUBLE(2, run.sample_rate_hz);
    TEST_ASSERT_TRUE(run.linear);
}

static void test_run_read_takes_a_line_of_bins_of_any_length(void)
{
    const uint32_t count = 200000; /* about 1.3 MB, many times the reading buffer */
    char *text = malloc(16u * count), *at = text;
    at += sprintf(at, "# sample_rate_hz: 1\n# period_samples: %u\n# excited_bins: [", 2 * count + 2);
    for (uint32_t k = 1; k <= count; k++)
        at += sprintf(at, k > 1 ? ", %u" : "%u", k);
    sprintf(at, "]\ntorque_Nm\n1\n");
    read_text(text);
    free(text);
    TEST_ASSERT_EQUAL_UINT(count, run.bin_count);
    TEST_ASSERT_EQUAL_UINT32(count, run.bins[count - 1]);
}

static void test_run_read_names_file_line_column_and_value_of_a_bad_number(void)
{
    refuse("time_s,torque_Nm\n0,1\n1,nan\n", "run.csv:3: torque_Nm: 'nan' is not a number");
    refuse("time_s,torque_Nm\n0,-inf\n", "run.csv:2: torque_Nm: '-inf' is not a number");
    refuse("time_s,torque_Nm\n0,0x10\n", "run.csv:2: torque_Nm: '0x10' is hexadecimal, a decimal number was expected");
    refuse("time_s,torque_Nm\n0,\"1,5\"\n", "run.csv:2: torque_Nm: '1,5' has a decimal comma, a point was expected");
    refuse("time_s,torque_Nm\n0,1e400\n", "run.csv:2: torque_Nm: '1e400' is too large for a double");
    refuse("time_s,torque_Nm\n0,1\n1,-1e308\n",
           "run.csv:3: torque_Nm: -1e+308 is no measured value: at most 1e+30 was expected");
    refuse("time_s,torque_2_Nm\n0,\n", "run.csv:2: torque_2_Nm: '' is empty, a number was expected");
    refuse("time_s,torque_Nm\n0,1.5.2\n", "run.csv:2: torque_Nm: '1.5.2' is not a number");
    refuse("time_s,valid\n0,1\n1,2\n", "run.csv:3: valid: 2: 0 or 1 was expected");
}

static void test_run_read_refuses_what_is_no_table(void)
{
    refuse("", "run.csv: the file is empty: a row of column names was expected");
    refuse("# sample_rate_hz: 1\n", "run.csv:2: the file ends without a row of column names");
    refuse("torque_Nm\n", "run.csv:2: the file ends without a row of numbers");
    refuse("0,1\n2,3\n", "run.csv:1: '0' is a number, the row of column names was expected first"
                         "; 'servoscope convert' makes a run of other programs' tables");
    refuse("time_s;torque_Nm\n0,0;1,5\n", "run.csv:1: columns are separated by semicolons: commas were expected, and a "
                                          "point as decimal mark; 'servoscope "
                                          "convert' makes such a file of it");
    refuse("time_s,torque_Nm\n0,0,1,5\n",
           "run.csv:2: row has 4 cells, the row of names (line 1) has 2: decimal commas? A point was expected");
    refuse("time_s,torque_Nm\n0,1\n2\n", "run.csv:3: row has 1 cells, the row of names (line 1) has 2");
    TEST_ASSERT_EQUAL_INT(error_refused, run_read(scratch_bytes("run.csv", "a,b\0\n1,2\n", 9), NULL, &run, &error));
    TEST_ASSERT_NOT_NULL(strstr(error.message, "run.csv:1: contains binary zeros"));
    TEST_ASSERT_EQUAL_INT(error_refused, run_read(scratch_path("none.csv"), NULL, &run, &error));
    TEST_ASSERT_NOT_NULL(strstr(error.message, "none.csv: cannot be read: No such file"));
}

static void test_run_read_refuses_columns_that_contradict(void)
{
    refuse("# sample_rate_hz: 1\ntorque_Nm,torque_Nm\n1,2\n", "run.csv:2: there are two columns torque_Nm");
    refuse("# sample_rate_hz: 1\ntorque_Nm,position_m\n1,2\n",
           "run.csv:2: torque_Nm is of a rotary axis, position_m of a linear one: one kind was expected");
}

static void test_run_read_refuses_keys_that_do_not_fit(void)
{
    const char *rows = "torque_Nm\n1\n2\n3\n4\n5\n6\n7\n8\n";
    static const struct {
        const char *keys, *message;
    } cases[] = {
        {"# sample_rate_hz: fast\n", "run.csv:1: sample_rate_hz: 'fast': a rate from 0.001 to 1e9 Hz was expected"},
        {"# sample_rate_hz: -1\n", "run.csv:1: sample_rate_hz: '-1': a rate from 0.001 to 1e9 Hz was expected"},
        {"# sample_rate_hz: nan\n", "run.csv:1: sample_rate_hz: 'nan': a rate from 0.001 to 1e9 Hz was expected"},
        {"# sample_rate_hz: 1\n# sample_rate_hz: 1\n", "run.csv:2: sample_rate_hz: is there twice, first in line 1"},
        {"# sample_rate_hz: 1\n# period_samples: 0\n",
         "run.csv:2: period_samples: '0': a whole number from 1 on was expected"},
        {"# sample_rate_hz: 1\n# period_samples: 2.5\n",
         "run.csv: period_samples: 2.5: a whole number from 1 on was expected"},
        {"# sample_rate_hz: 1\n# period_samples: 4\n# periods: 3\n",
         "run.csv: 0 settling and 3 counted periods of 4 samples do not fit the 8 rows of the file"},
        {"# sample_rate_hz: 1\n# period_samples: 4\n# periods: 1\n# settle_periods: 2\n",
         "run.csv: 2 settling and 1 counted periods of 4 samples do not fit the 8 rows of the file"},
#if SIZE_MAX > UINT32_MAX
        {"# sample_rate_hz: 1\n# period_samples: 9007199254740992\n# periods: 9007199254740992\n",
         "run.csv: 0 settling and 9007199254740992 counted periods of 9007199254740992 samples do not fit the 8 rows "
         "of the "
         "file"},
#else
        {"# sample_rate_hz: 1\n# period_samples: 4294967295\n# periods: 4294967295\n",
         "run.csv: 0 settling and 4294967295 counted periods of 4294967295 samples do not fit the 8 rows "
         "of the "
         "file"},
#endif
        {"# sample_rate_hz: 1\n# periods: 2\n", "run.csv: periods or settle_periods without period_samples"},
        {"# sample_rate_hz: 1\n# period_samples: 8\n# excited_bins: [1, 3, 3]\n",
         "run.csv:3: excited_bins: at '3]': bins have to ascend"},
        {"# sample_rate_hz: 1\n# period_samples: 8\n# excited_bins: [1, 4]\n",
         "run.csv:3: excited_bins: at '4]': a bin from 1 to below half of period_samples was expected"},
        {"# sample_rate_hz: 1\n# period_samples: 8\n# excited_bins: [0, 1]\n",
         "run.csv:3: excited_bins: at '0, 1]': a bin from 1 to below half of period_samples was expected"},
        {"# sample_rate_hz: 1\n# period_samples: 8\n# excited_bins: [1, x]\n",
         "run.csv:3: excited_bins: at 'x]': a whole number was expected"},
        {"# sample_rate_hz: 1\n# period_samples: 8\n# excited_bins: [1, 2\n",
         "run.csv:3: excited_bins: at 'end of line': ']' was expected: the line is cut off"},
        {"# sample_rate_hz: 1\n# period_samples: 8\n# excited_bins: []\n",
         "run.csv:3: excited_bins: at '[]': a list of bins like [1, 3, 5] was expected"},
        {"# sample_rate_hz: 1\n# excited_bins: [1]\n",
         "run.csv:2: excited_bins: bins mean nothing without the key period_samples"},
        {"# sample_rate_hz: 1\n# table_crc32: 0x123456789\n",
         "run.csv:2: table_crc32: '0x123456789': a CRC-32 like 0x1a2b3c4d was expected"},
        {"", "run.csv: no sample rate: a key '# sample_rate_hz: HZ', a column time_s or --rate HZ was expected"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char text[512];
        snprintf(text, sizeof text, "%s%s", cases[i].keys, rows);
        refuse(text, cases[i].message);
    }
}

static void test_run_read_takes_the_rate_from_time_stamps(void)
{
    char text[4096] = "time_s,torque_Nm\n", *at = text + strlen(text);
    const double step_s = 0.0004, jitter_s = 0.09 * step_s;
    for (int n = 0; n < 100; n++)
        at += sprintf(at, "%.9f,1\n", 5.0 + n * step_s + (n % 7 == 3 ? jitter_s : 0) - (n % 7 == 4 ? jitter_s : 0));
    read_text(text);
    const double rate_share = 2 * 0.1 / 99; /* both ends of the recording may be a tenth of a step off */
    TEST_ASSERT_DOUBLE_WITHIN(2500 * rate_share, 2500, run.sample_rate_hz);
    read_text("t_s,torque_Nm\n0,1\n0.001,2\n0.002,3\n");
    TEST_ASSERT_EQUAL_DOUBLE(1000, run.sample_rate_hz);
}

static void test_run_read_refuses_time_that_stands_jumps_or_contradicts(void)
{
    refuse("time_s,torque_Nm\n0,1\n0.001,1\n0.001,1\n",
           "run.csv:4: time_s: 0.001 follows 0.001: time has to increase (--rate HZ trusts the rate "
           "and leaves the time stamps unjudged)");
    refuse("time_s,torque_Nm\n0,1\n0.001,1\n0.002,1\n0.003,1\n\n0.006,1\n0.007,1\n",
           "run.csv:7: time_s: 0.006 follows 0.003: 2 samples are missing, a step of 0.001 s was expected");
    refuse("# sample_rate_hz: 900\ntime_s,torque_Nm\n0,1\n0.001,1\n0.002,1\n",
           "run.csv: sample_rate_hz is 900, but time_s steps at 1000 Hz");
    refuse("# sample_rate_hz: 1000\ntime_s,torque_Nm\n0,1\n0.0004,1\n0.0008,1\n0.0012,1\n",
           "run.csv: sample_rate_hz is 1000, but time_s steps at 2500 Hz");
    TEST_ASSERT_EQUAL_INT(
        error_refused,
        run_read(scratch_text("run.csv", "time_s,torque_Nm\n0,1\n1,1\n2.3,1\n3,1\n4,1\n"), NULL, &run, &error));
    TEST_ASSERT_NOT_NULL(
        strstr(error.message, "run.csv:4: time_s: 2.3 follows 1: a step of 1 s, within 20 %, was expected"));
}

static void test_run_read_lets_the_given_rate_rule(void)
{
    struct run_options options = {.rate_hz = 2500};
    read_as("# sample_rate_hz: 7\ntime_s,torque_Nm\n0,1\n0,1\n1,1\n", &options);
    TEST_ASSERT_EQUAL_DOUBLE(2500, run.sample_rate_hz);
    options.rate_hz = -1;
    refuse_as("torque_Nm\n1\n", &options, error_usage, "--rate: -1: a rate from 0.001 to 1e9 Hz was expected");
    options.rate_hz = NAN;
    TEST_ASSERT_EQUAL_INT(error_usage, run_read(scratch_path("run.csv"), &options, &run, &error));
}

static void test_run_read_maps_renames_scales_and_copies(void)
{
    struct run_options options = {.map = "torque_Nm=iq (A)*0.5, current_A=iq (A),time_s=t,position_rad=raw*-2e-1",
                                  .rate_hz = 0};
    read_as("t,iq (A),raw,position_rad\n0,4,10,x\n1,6,20,y\n", &options);
    TEST_ASSERT_EQUAL_DOUBLE(3, run_column(&run, "torque_Nm")[1]);
    TEST_ASSERT_EQUAL_DOUBLE(6, run_column(&run, "current_A")[1]);
    TEST_ASSERT_EQUAL_DOUBLE(-4, run_column(&run, "position_rad")[1]);
    TEST_ASSERT_TRUE(isnan(run_column(&run, "unmapped_position_rad")[0]));
    TEST_ASSERT_EQUAL_DOUBLE(1, run.sample_rate_hz);
    TEST_ASSERT_NULL(run_column(&run, "iq (A)"));
    options.map = "position_rad=position_m*100";
    read_as("# sample_rate_hz: 1\nposition_m,torque_Nm\n1,2\n", &options);
    TEST_ASSERT_FALSE(run.linear);
    TEST_ASSERT_EQUAL_DOUBLE(100, run_column(&run, "position_rad")[0]);
}

static void test_run_read_refuses_a_bad_map(void)
{
    static const struct {
        const char *map;
        int status;
        const char *message;
    } cases[] = {
        {"torque_Nm", error_usage, "--map: 'torque_Nm': NAME=COLUMN or NAME=COLUMN*SCALE was expected"},
        {"torque_Nm=", error_usage, "--map: 'torque_Nm=': one column of the file was expected behind the '='"},
        {"torque_Nm=a,", error_usage, "--map: '': NAME=COLUMN or NAME=COLUMN*SCALE was expected"},
        {"torque_Nm=a=b", error_usage, "--map: 'torque_Nm=a=b': one column of the file was expected behind the '='"},
        {"torque_Nm=a*0", error_usage, "--map: 'torque_Nm=a*0': a number other than 0 was expected behind the '*'"},
        {"torque_Nm=a*x", error_usage, "--map: 'torque_Nm=a*x': a number other than 0 was expected behind the '*'"},
        {"torque_Nm=a,torque_Nm=b", error_usage, "--map: 'torque_Nm=b': the name is mapped twice"},
        {"torque_Nm=c", error_refused, "run.csv:2: --map: there is no column 'c', only: a, b"},
        {"torque_Nm=b", error_refused,
         "run.csv:3: b: 'x' is not a number"
         "; 'servoscope convert' makes a run of other programs' tables"},
        {"torque_Nm=a*1e308", error_refused, "run.csv:3: torque_Nm: too large for a double once scaled by 1e+308"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct run_options options = {.map = cases[i].map};
        refuse_as("# sample_rate_hz: 1\na,b\n100,x\n", &options, cases[i].status, cases[i].message);
    }
    struct run_options options = {.map = "speed=a"};
    TEST_ASSERT_EQUAL_INT(error_usage, run_read(scratch_path("run.csv"), &options, &run, &error));
    TEST_ASSERT_NOT_NULL(strstr(error.message, "is none that a run knows"));
}

static const double awkward[] = {0.0,
                                 -0.0,
                                 0.1,
                                 1.0 / 3,
                                 -2e-5,
                                 DBL_MAX,
                                 DBL_MIN,
                                 5e-324,
                                 1e23,
                                 1e-7,
                                 123456.7,
                                 4.35,
                                 0.3e15,
                                 1e16,
                                 9.9e22,
                                 -DBL_EPSILON,
                                 9007199254740993.0,
                                 0.000244140625};

enum { awkward_count = sizeof awkward / sizeof awkward[0] };

static void test_run_write_reads_back_bit_for_bit(void)
{
    struct run out = {.sample_rate_hz = 1000.0 / 3,
                      .rows = awkward_count,
                      .period_samples = 6,
                      .periods = 2,
                      .settle_periods = 1,
                      .has_settle_periods = true,
                      .has_table_crc32 = true,
                      .table_crc32 = 0xdeadbeef};
    uint32_t bins[] = {1, 2};
    out.bin_count = 2;
    out.bins = bins;
    double *torque = run_add_column(&out, "torque_Nm"), *foreign = run_add_column(&out, "a, \"b\" ");
    for (size_t n = 0; n < awkward_count; n++) {
        torque[n] = fabs(awkward[n]) > 1e30 ? 1e30 : awkward[n]; // more is no measured value
        foreign[n] = n % 2 ? NAN : awkward[n];
    }
    TEST_ASSERT_TRUE(run_set_key(&out, "drive", "no. 7"));
    TEST_ASSERT_TRUE(run_set_key(&out, "drive", "no. 8"));
    TEST_ASSERT_TRUE(run_set_key(&out, "periods", "99"));
    const char *path = scratch_path("run.csv");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, run_write(path, &out, &error), error.message);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, run_read(path, NULL, &run, &error), error.message);
    TEST_ASSERT_EQUAL_MEMORY(&out.sample_rate_hz, &run.sample_rate_hz, sizeof(double));
    TEST_ASSERT_EQUAL_MEMORY(torque, run_column(&run, "torque_Nm"), sizeof awkward);
    for (size_t n = 0; n < awkward_count; n++)
        TEST_ASSERT_TRUE(n % 2 ? isnan(run.columns[1].data[n])
                               : memcmp(&foreign[n], &run.columns[1].data[n], sizeof(double)) == 0);
    TEST_ASSERT_EQUAL_STRING("a, \"b\" ", run.columns[1].name);
    TEST_ASSERT_EQUAL_STRING("no. 8", run_key(&run, "drive"));
    TEST_ASSERT_EQUAL_UINT(2, run.periods);
    TEST_ASSERT_EQUAL_UINT(1, run.settle_periods);
    TEST_ASSERT_EQUAL_UINT32_ARRAY(bins, run.bins, 2);
    TEST_ASSERT_EQUAL_HEX32(0xdeadbeef, run.table_crc32);
    out.bins = NULL;
    run_free(&out);
}

static void test_run_write_refuses_numbers_that_are_not_finite(void)
{
    struct run out = {.sample_rate_hz = 1000, .rows = 2};
    double *torque = run_add_column(&out, "torque_Nm");
    torque[1] = NAN;
    const char *path = scratch_text("run.csv", "old");
    TEST_ASSERT_EQUAL_INT(error_refused, run_write(path, &out, &error));
    TEST_ASSERT_NOT_NULL(strstr(error.message, "torque_Nm of sample 1 is not finite"));
    char *text = scratch_load(path, NULL);
    TEST_ASSERT_EQUAL_STRING("old", text);
    free(text);
    torque[1] = 0;
    out.sample_rate_hz = 0;
    TEST_ASSERT_EQUAL_INT(error_refused, run_write(path, &out, &error));
    run_free(&out);
}

static uint64_t random_state;

static uint64_t random_bits(void)
{
    random_state ^= random_state << 13;
    random_state ^= random_state >> 7;
    random_state ^= random_state << 17;
    return random_state;
}

static void test_number_parse_agrees_with_strtod_on_random_texts(void)
{
    const uint64_t seed = 20240607;
    random_state = seed;
    for (int i = 0; i < 200000; i++) {
        char text[64], message[128];
        uint64_t digits = random_bits() % (i % 2 ? 1000000u : 10000000000000000000u);
        int power = (int)(random_bits() % 60) - 30;
        snprintf(text, sizeof text, "%s%llu.%lluE%d", i % 3 ? "" : "-", (unsigned long long)digits,
                 (unsigned long long)(random_bits() % 1000), power);
        double value = 0, expected = strtod(text, NULL);
        snprintf(message, sizeof message, "%s (seed %llu, text %d)", text, (unsigned long long)seed, i);
        TEST_ASSERT_EQUAL_INT_MESSAGE(number_ok, number_parse(text, strlen(text), &value), message);
        TEST_ASSERT_EQUAL_MEMORY_MESSAGE(&expected, &value, sizeof value, message);
    }
}

static void test_number_format_reads_back_for_random_bits(void)
{
    const uint64_t seed = 42;
    random_state = seed;
    for (int i = 0; i < 100000; i++) {
        uint64_t bits = random_bits();
        double value, back = 0;
        memcpy(&value, &bits, sizeof value);
        if (!isfinite(value))
            continue;
        char text[number_text_size], message[128];
        number_format(value, text);
        snprintf(message, sizeof message, "%s (seed %llu, number %d)", text, (unsigned long long)seed, i);
        TEST_ASSERT_EQUAL_INT_MESSAGE(number_ok, number_parse(text, strlen(text), &back), message);
        TEST_ASSERT_EQUAL_MEMORY_MESSAGE(&value, &back, sizeof value, message);
    }
}

int main(void)
{
    scratch_open();
    UNITY_BEGIN();
    RUN_TEST(test_run_read_takes_keys_columns_and_rows);
    RUN_TEST(test_run_read_takes_a_byte_order_mark_crlf_blanks_and_no_last_newline);
    RUN_TEST(test_run_read_takes_gzip_by_content);
    RUN_TEST(test_run_read_takes_a_line_of_bins_of_any_length);
    RUN_TEST(test_run_read_names_file_line_column_and_value_of_a_bad_number);
    RUN_TEST(test_run_read_refuses_what_is_no_table);
    RUN_TEST(test_run_read_refuses_columns_that_contradict);
    RUN_TEST(test_run_read_refuses_keys_that_do_not_fit);
    RUN_TEST(test_run_read_takes_the_rate_from_time_stamps);
    RUN_TEST(test_run_read_refuses_time_that_stands_jumps_or_contradicts);
    RUN_TEST(test_run_read_lets_the_given_rate_rule);
    RUN_TEST(test_run_read_maps_renames_scales_and_copies);
    RUN_TEST(test_run_read_refuses_a_bad_map);
    RUN_TEST(test_run_write_reads_back_bit_for_bit);
    RUN_TEST(test_run_write_refuses_numbers_that_are_not_finite);
    RUN_TEST(test_number_parse_agrees_with_strtod_on_random_texts);
    RUN_TEST(test_number_format_reads_back_for_random_bits);
    int failures = UNITY_END();
    scratch_close();
    return failures;
}
