/* SPDX-License-Identifier: MIT */
/// Universal files: what is written reads back to the digits that its fields have; files as other systems write them,
/// typed from the definition of dataset 58, are read; refusals name line and value.
#include "lab/record/format.h"
#include "lab/record/uff58.h"
#include "lab/record/uff_axis.h"
#include "tests/support/scratch.h"
#include "unity.h"

#include <math.h>

/* Half a unit of the 13th digit: a field E20.12. */
static const double digits_13 = 5.0000001e-13;
/* Half a unit of the 6th: a field E13.5. */
static const double digits_6 = 5.0000001e-6;

static const struct format_options no_options = {0};
static struct record record, again;
static struct format_notes notes;
static struct error error;

void setUp(void)
{
    scratch_empty();
    error = (struct error){0};
}

void tearDown(void)
{
    record_free(&record);
    record_free(&again);
    format_notes_free(&notes);
}

static int read_text(const char *text, const struct format_options *options)
{
    return format_by_name("uff")->read(scratch_text("in", text), options, &record, &notes, &error);
}

/* Writes `record` in a format and reads it into `again`. */
static void round_trip(const char *format)
{
    const char *path = scratch_path("out");
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, format_by_name(format)->write(path, &record, &notes, &error), error.message);
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, format_by_name("uff")->read(path, &no_options, &again, &notes, &error),
                                  error.message);
    TEST_ASSERT_EQUAL_INT(record.kind, again.kind);
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
    static const char *const names[] = {"time_s", "torque_2_Nm", "velocity_rad_per_s", "anything, at all"};
    static const uint32_t bins[] = {1, 3, 7};
    record = (struct record){.kind = record_run, .run = {.sample_rate_hz = 3000, .rows = 50, .period_samples = 20}};
    record.run.periods = 2;
    for (size_t c = 0; c < 4; c++) {
        double *data = run_add_column(&record.run, names[c]);
        for (size_t n = 0; n < record.run.rows; n++) // over the whole range, both signs
            data[n] = c == 0   ? (double)n / 3000
                      : n == 0 ? 0
                               : (n % 2 ? -1 : 1) * pow(10, c == 3 ? 12 * (double)n - 300 : (double)n - 25) / 3;
    }
    record.run.bins = malloc(sizeof bins);
    memcpy(record.run.bins, bins, sizeof bins);
    record.run.bin_count = 3;
    record.run.has_table_crc32 = true;
    record.run.table_crc32 = 0x0badcafe;
    run_set_key(&record.run, "mode", "cascade");
    run_set_key(&record.run, "", "a comment");
}

static void check_runs(double tolerance)
{
    const struct run *a = &record.run, *b = &again.run;
    TEST_ASSERT_EQUAL_UINT(a->rows, b->rows);
    TEST_ASSERT_EQUAL_UINT(a->column_count, b->column_count);
    for (size_t c = 0; c < a->column_count; c++) {
        TEST_ASSERT_EQUAL_STRING(a->columns[c].name, b->columns[c].name);
        for (size_t n = 0; n < a->rows; n++) {
            double x = a->columns[c].data[n], y = b->columns[c].data[n];
            // A long exponent takes the place of a digit.
            double most = fabs(x) >= 1e100 || fabs(x) < 1e-99 ? 10 * tolerance : tolerance;
            TEST_ASSERT_TRUE(fabs(x - y) <= most * fabs(x));
        }
    }
    TEST_ASSERT_TRUE(a->sample_rate_hz == b->sample_rate_hz);
    TEST_ASSERT_EQUAL_UINT(a->period_samples, b->period_samples);
    TEST_ASSERT_EQUAL_UINT(a->periods, b->periods);
    TEST_ASSERT_EQUAL_UINT(a->bin_count, b->bin_count);
    TEST_ASSERT_EQUAL_UINT32_ARRAY(a->bins, b->bins, 3);
    TEST_ASSERT_EQUAL_HEX32(a->table_crc32, b->table_crc32);
    TEST_ASSERT_EQUAL_STRING("cascade", run_key(b, "mode"));
    TEST_ASSERT_EQUAL_STRING("a comment", run_key(b, ""));
}

static void test_uff_run_reads_back_to_13_digits(void)
{
    make_run();
    round_trip("uff");
    check_runs(digits_13);
    TEST_ASSERT_TRUE(noted(format_lost, "13th"));
}

static void test_uff_run_reads_back_bit_for_bit_in_binary(void)
{
    make_run();
    round_trip("uff58b");
    check_runs(0);
    TEST_ASSERT_FALSE(noted(format_lost, ""));
}

static void make_frf(bool even)
{
    record.kind = record_frf;
    TEST_ASSERT_EQUAL_INT(0, frf_alloc(&record.frf, 30, &error));
    for (size_t k = 0; k < 30; k++) {
        record.frf.frequency_hz[k] = even ? 0.5 * (double)k : 0.1 * pow(1.2345678901, (double)k);
        record.frf.real[k] = cos((double)k) / 7;
        record.frf.imag[k] = -sin((double)k) * 1e5;
        record.frf.std[k] = k % 5 ? 1e-3 / (double)k : FRF_UNKNOWN;
        record.frf.valid[k] = k != 4;
    }
    frf_set_text(&record.frf.input, "torque_Nm");
    frf_set_text(&record.frf.output, "load_velocity_rad_per_s");
    record.frf.periods = 7;
}

static void check_close(const double *a, const double *b, double tolerance)
{
    for (size_t k = 0; k < 30; k++)
        TEST_ASSERT_TRUE(fabs(a[k] - b[k]) <= tolerance * fabs(a[k]));
}

static void check_frfs(double tolerance)
{
    TEST_ASSERT_EQUAL_UINT(30, again.frf.count);
    check_close(record.frf.frequency_hz, again.frf.frequency_hz, tolerance);
    check_close(record.frf.real, again.frf.real, tolerance);
    check_close(record.frf.imag, again.frf.imag, tolerance);
    check_close(record.frf.std, again.frf.std, tolerance);
    TEST_ASSERT_EQUAL_MEMORY(record.frf.valid, again.frf.valid, 30 * sizeof *again.frf.valid);
    TEST_ASSERT_FALSE(frf_known(again.frf.noise_std[3]));
    TEST_ASSERT_EQUAL_STRING("torque_Nm", again.frf.input);
    TEST_ASSERT_EQUAL_STRING("load_velocity_rad_per_s", again.frf.output);
    TEST_ASSERT_EQUAL_UINT(7, again.frf.periods);
}

static void test_uff_response_reads_back_with_even_and_with_uneven_frequencies(void)
{
    for (int even = 0; even < 2; even++) {
        make_frf(even);
        round_trip("uff");
        check_frfs(digits_13);
        record_free(&again);
        round_trip("uff58b");
        check_frfs(0);
        tearDown();
    }
}

/* What any reader sees, that knows nothing of us: type, places, axes, abscissa. */
static void test_uff_response_says_what_it_is_to_others(void)
{
    struct uff_file file;
    make_frf(false);
    TEST_ASSERT_EQUAL_INT(0, format_by_name("uff")->write(scratch_path("out"), &record, &notes, &error));
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, uff_file_read(scratch_path("out"), &file, &error), error.message);
    const struct uff58 *f = &file.functions[0];
    TEST_ASSERT_EQUAL_INT(uff_frf, f->function_type);
    TEST_ASSERT_EQUAL_INT(2, f->response.node); // the load
    TEST_ASSERT_EQUAL_INT(uff_rotation_z, f->response.direction);
    TEST_ASSERT_EQUAL_INT(1, f->reference.node); // the motor
    TEST_ASSERT_EQUAL_INT(uff_rotation_z, f->reference.direction);
    TEST_ASSERT_EQUAL_INT(uff_quantity_velocity, f->numerator.quantity);
    TEST_ASSERT_EQUAL_STRING("rad/s", f->numerator.units);
    TEST_ASSERT_EQUAL_INT(uff_quantity_excitation_force, f->denominator.quantity);
    TEST_ASSERT_EQUAL_STRING("Nm", f->denominator.units);
    TEST_ASSERT_EQUAL_INT(uff_quantity_frequency, f->abscissa.quantity);
    TEST_ASSERT_FALSE(f->even);
    check_close(record.frf.frequency_hz, f->abscissa_values, digits_6);
    TEST_ASSERT_TRUE(file.has_units && file.to_si[0] == 1 && file.to_si[1] == 1);
    uff_file_free(&file);
}

/* More keys than lines, keys longer than a line, with blanks where a line would break. */
static void test_uff_keys_of_any_number_and_length_are_kept(void)
{
    char value[400], key[32];
    make_run();
    for (int i = 0; i < 40; i++) {
        size_t length = (size_t)i * 9;
        for (size_t c = 0; c < length; c++)
            value[c] = (char)(c % 3 == 0 || c > 200 ? 'a' + i % 26 : ' ');
        value[length] = '\0';
        snprintf(key, sizeof key, "key_%d", i);
        run_set_key(&record.run, key, value);
    }
    run_set_key(&record.run, "+plus", "1");
    round_trip("uff");
    for (size_t k = 0; k < record.run.key_count; k++) {
        const char *back = run_key(&again.run, record.run.keys[k].key);
        if (record.run.keys[k].key[0] == '+')
            continue;
        TEST_ASSERT_NOT_NULL_MESSAGE(back, record.run.keys[k].key);
        size_t length = strlen(record.run.keys[k].value); // readers do not see blanks at an end
        while (length > 0 && record.run.keys[k].value[length - 1] == ' ')
            length--;
        TEST_ASSERT_EQUAL_UINT(length, strlen(back));
        TEST_ASSERT_EQUAL_INT(0, strncmp(record.run.keys[k].value, back, length));
    }
    TEST_ASSERT_TRUE(noted(format_lost, "key +plus"));
    TEST_ASSERT_EQUAL_UINT(4, again.run.column_count);
}

static void test_uff_column_with_holes_is_left_out_and_said(void)
{
    make_run();
    record.run.columns[3].data[2] = NAN;
    round_trip("uff");
    TEST_ASSERT_EQUAL_UINT(3, again.run.column_count);
    TEST_ASSERT_TRUE(noted(format_lost, "column anything, at all: 1 of its cells"));
}

#define FOREIGN_HEAD                                                                                                   \
    "    -1\n   164\n         1SI: Meter (newton)          2\n"                                                        \
    "  1.00000000000000000D+00  1.00000000000000000D+00  1.00000000000000000D+00\n"                                    \
    "  2.73149999999999977D+02\n    -1\n    -1\n  2411\n         1         1         1        11\n"                    \
    "    -1\n"
#define TIME_AXIS  "        17    0    0    0 Time                 s\n"
#define NO_AXIS    "         0    0    0    0 NONE                 NONE\n"
#define FORCE_AXIS "        13    0    1    0 Force                N\n"
#define SLIDE_AXIS "         8    1    0    0 Slide                mm\n"

/* Single precision with fields that touch, words that keep no columns, Fortran's D. */
static const char two_signals[] = FOREIGN_HEAD
    "    -1\n    58\nMotor force, left\nNONE\n22-NOV-11 10:00:00\nNONE\nNONE\n"
    "    1         1    1         0 BENCH              3   1 NONE               0   0\n"
    "         2         7         1  0.00000e+00  3.33333e-04  0.00000e+00\n" TIME_AXIS FORCE_AXIS NO_AXIS NO_AXIS
    "  1.00000E+00-2.000000E+00-3.000000E-01  4.00000E+00  5.00000E+00-6.000000E+00\n"
    "  7.00000E+00\n    -1\n"
    "    -1\n    58\nSlide\nNONE\nNONE\nNONE\nNONE\n"
    "    1         2    1         0 BENCH              4   1 NONE               0   0\n"
    "         4         7         1  0.00000e+00  3.33333e-04  0.00000e+00\n" TIME_AXIS SLIDE_AXIS NO_AXIS NO_AXIS
    "1.25D+00 2 3\n4 5 6 -7.5D-01\n    -1\n";

static void test_uff_signals_of_another_system_are_read(void)
{
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, read_text(two_signals, &no_options), error.message);
    static const double force[] = {1, -2, -0.3, 4, 5, -6, 7}, slide[] = {1.25, 2, 3, 4, 5, 6, -0.75};
    // The axes state N and mm: the units say what the signals are, and that millimetres are none of SI.
    const double *a = run_column(&record.run, "force_N"), *b = run_column(&record.run, "position_m");
    TEST_ASSERT_TRUE(a && b && record.run.rows == 7);
    TEST_ASSERT_EQUAL_MEMORY(force, a, sizeof force);
    for (size_t n = 0; n < 7; n++)
        TEST_ASSERT_TRUE(b[n] == slide[n] * 0.001);
    // 1/3.33333e-4 is 3000.003: the step has 6 digits, and 3000 is within them.
    TEST_ASSERT_TRUE(record.run.sample_rate_hz == 3000);
    TEST_ASSERT_TRUE(noted(format_assumed, "sample rate 3000 Hz"));
    TEST_ASSERT_TRUE(noted(format_kept, "column 'Slide [mm]'"));
    TEST_ASSERT_TRUE(noted(format_assumed, "position_m is Slide [mm] times 0.001"));
}

static void test_uff_signals_of_another_system_take_names_and_scale_by_map(void)
{
    const struct format_options options = {.run = {.map = "position_m=Slide*0.001", .rate_hz = 3000.01}};
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, read_text(two_signals, &options), error.message);
    TEST_ASSERT_TRUE(run_column(&record.run, "position_m")[0] == 1.25 * 0.001);
    TEST_ASSERT_TRUE(record.run.sample_rate_hz == 3000.01);
    TEST_ASSERT_TRUE(record.run.linear);
}

#define RESPONSE(direction)                                                                                            \
    "    -1\n    58\nPoint 5\nNONE\nNONE\nNONE\nNONE\n"                                                                \
    "    4         1    1         0 NONE               5 " direction " NONE               1   3\n"                     \
    "         5         3         0  0.00000e+00  0.00000e+00  0.00000e+00\n"                                          \
    "        18    0    0    0 Frequency            Hz\n         8    0    0    0 NONE                 NONE\n"         \
    "        13    0    0    0 NONE                 N\n         0    0    0    0 NONE                 NONE\n"          \
    "  1.00000e+00  2.00000e+00 -3.00000e+00  2.50000e+00  4.00000e+00  5.00000e+00\n"                                 \
    "  7.00000e+00  6.00000e+00  0.00000e+00\n    -1\n"

static void test_uff_response_of_another_system_is_read(void)
{
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, read_text(FOREIGN_HEAD RESPONSE("  3"), &no_options), error.message);
    static const double frequency_hz[] = {1, 2.5, 7}, real[] = {2, 4, 6}, imag[] = {-3, 5, 0};
    TEST_ASSERT_EQUAL_INT(record_frf, record.kind);
    TEST_ASSERT_EQUAL_UINT(3, record.frf.count);
    TEST_ASSERT_EQUAL_MEMORY(frequency_hz, record.frf.frequency_hz, sizeof frequency_hz);
    TEST_ASSERT_EQUAL_MEMORY(real, record.frf.real, sizeof real);
    TEST_ASSERT_EQUAL_MEMORY(imag, record.frf.imag, sizeof imag);
    // The axis states no units, but the file's are SI.
    TEST_ASSERT_EQUAL_STRING("position_m", record.frf.output);
    TEST_ASSERT_EQUAL_STRING("force_N", record.frf.input);
}

static void test_uff_one_of_several_responses_is_asked_for(void)
{
    const char *text = FOREIGN_HEAD RESPONSE("  3") RESPONSE("  6");
    TEST_ASSERT_EQUAL_INT(error_usage, read_text(text, &no_options));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "holds 2 frequency responses: --function"), error.message);
    const struct format_options second = {.function = 2};
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, read_text(text, &second), error.message);
    TEST_ASSERT_EQUAL_STRING("position_rad", record.frf.output); // a rotation
    TEST_ASSERT_TRUE(noted(format_lost, "function 1"));
}

/* A 58b as instruments write it: big-endian, single precision, an uneven abscissa; and one whose abscissa is in single
 * precision beside ordinates in double, as the definition says. */
static void test_uff_binary_of_another_system_is_read(void)
{
    static const unsigned char big[] = {0, 0, 0, 0, 0x3f, 0x80, 0, 0, 0x3f, 0, 0, 0, 0xc0, 0x20, 0, 0};
    static const unsigned char mixed[] = {0, 0, 0, 0,    0, 0, 0, 0, 0, 0, 0xf0, 0x3f,
                                          0, 0, 0, 0x3f, 0, 0, 0, 0, 0, 0, 4,    0xc0};
    static const struct {
        const unsigned char *bytes;
        int size, order, type;
    } cases[] = {{big, sizeof big, 2, 2}, {mixed, sizeof mixed, 1, 4}};
    for (size_t i = 0; i < 2; i++) {
        char bytes[2048];
        int length = snprintf(
            bytes, sizeof bytes,
            "    -1\n    58b%6d     2          11%12d     0     0           0           0\n"
            "x\nNONE\nNONE\nNONE\nNONE\n"
            "    1         1    1         0 NONE               1   1 NONE               0   0\n"
            "%10d         2         0  0.00000e+00  0.00000e+00  0.00000e+00\n" TIME_AXIS FORCE_AXIS NO_AXIS NO_AXIS,
            cases[i].order, cases[i].size, cases[i].type);
        memcpy(bytes + length, cases[i].bytes, (size_t)cases[i].size);
        length += cases[i].size;
        length += snprintf(bytes + length, sizeof bytes - (size_t)length, "\n    -1\n");
        const char *path = scratch_bytes("in", bytes, (size_t)length);
        TEST_ASSERT_EQUAL_INT_MESSAGE(0, format_by_name("uff")->read(path, &no_options, &record, &notes, &error),
                                      error.message);
        const double *x = run_column(&record.run, "force_N"); // called x, its axis in N
        TEST_ASSERT_TRUE(x && x[0] == 1 && x[1] == -2.5);
        TEST_ASSERT_TRUE(record.run.sample_rate_hz == 2);
        record_free(&record);
    }
}

static void check_refusal(const char *text, const char *part)
{
    int status = read_text(text, &no_options);
    TEST_ASSERT_EQUAL_INT_MESSAGE(error_refused, status, part);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, part), error.message);
    TEST_ASSERT_EQUAL_UINT(0, record.run.column_count);
}

/* The text with one part of it replaced. */
static const char *with(const char *text, const char *old, const char *new)
{
    static char changed[8192];
    const char *at = strstr(text, old);
    TEST_ASSERT_NOT_NULL_MESSAGE(at, old);
    snprintf(changed, sizeof changed, "%.*s%s%s", (int)(at - text), text, new, at + strlen(old));
    return changed;
}

static void test_uff_refusals_name_line_and_value(void)
{
    check_refusal(with(two_signals, "-3.000000E-01", "-3.0000x0E-01"),
                  "in:24: '  1.00000E+00-2.000000E+00-3.0000x0E-01");
    check_refusal(with(two_signals, "         2         7", "         3         7"), "in:19: ");
    check_refusal(with(two_signals, "         2         7", "         2         8"), "the dataset ends early");
    check_refusal(with(two_signals, "         2         7", "         2         6"), "in:25: ");
    check_refusal(with(two_signals, "         2         7", "         2         0"), "number of values from 1 on");
    check_refusal(with(two_signals, "3.33333e-04", "0.00000e+00"), "a step other than 0");
    check_refusal(with(two_signals, "    1         1    1", "    q         1    1"), "function type: 'q'");
    check_refusal(with(two_signals, "7.00000E+00\n    -1\n", "nan\n    -1\n"), "in:25: '  nan'");
    check_refusal("    -1\n   151\nx\n    -1\n", "has no dataset 58");
    check_refusal("    -1\n    58\n", "in:3: the file ends early");
    check_refusal("hello\n", "in:1: 'hello'");
    check_refusal(with(FOREIGN_HEAD RESPONSE("  3"), "  2.50000e+00", "  1.00000e+00"), "frequency_hz: 1");
    check_refusal(with(FOREIGN_HEAD RESPONSE("  3"), "         5         3", "         2         3"), "in:");
}

static void test_uff_file_of_ours_that_lost_its_end_is_refused(void)
{
    make_run();
    TEST_ASSERT_EQUAL_INT(0, format_by_name("uff")->write(scratch_path("out"), &record, &notes, &error));
    char *text = scratch_load(scratch_path("out"), NULL);
    char *last = strstr(text, "excited_bins\n"); // its dataset begins three lines before
    *last = '\0';
    strrchr(text, '-')[-4] = '\0';
    int status = format_by_name("uff")->read(scratch_text("cut", text), &no_options, &again, &notes, &error);
    free(text);
    TEST_ASSERT_EQUAL_INT(error_refused, status);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(error.message, "has 4 functions, its header says 5"), error.message);
}

static void test_uff_axis_names_columns_both_ways(void)
{
    static const struct {
        const char *column, *units;
        int quantity, direction;
        long node;
    } cases[] = {
        {"torque_Nm", "Nm", uff_quantity_excitation_force, uff_rotation_z, 1},
        {"load_position_3_m", "m", uff_quantity_displacement, uff_translation_x, 6},
        {"velocity_ref_rad_per_s", "rad/s", uff_quantity_velocity, uff_rotation_z, 1},
        {"time_s", "s", uff_quantity_time, uff_scalar, 0},
        {"current_A", "A", uff_quantity_general, uff_scalar, 0},
        {"torque", "", uff_quantity_general, uff_scalar, 0},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct uff_axis axis;
        struct uff_dof dof;
        uff_describe(cases[i].column, &axis, &dof);
        TEST_ASSERT_EQUAL_STRING(cases[i].units, axis.units);
        TEST_ASSERT_EQUAL_INT_MESSAGE(cases[i].quantity, axis.quantity, cases[i].column);
        TEST_ASSERT_EQUAL_INT_MESSAGE(cases[i].direction, dof.direction, cases[i].column);
        TEST_ASSERT_EQUAL_INT_MESSAGE(cases[i].node, dof.node, cases[i].column);
    }
}

int main(void)
{
    scratch_open();
    UNITY_BEGIN();
    RUN_TEST(test_uff_run_reads_back_to_13_digits);
    RUN_TEST(test_uff_run_reads_back_bit_for_bit_in_binary);
    RUN_TEST(test_uff_response_reads_back_with_even_and_with_uneven_frequencies);
    RUN_TEST(test_uff_response_says_what_it_is_to_others);
    RUN_TEST(test_uff_keys_of_any_number_and_length_are_kept);
    RUN_TEST(test_uff_column_with_holes_is_left_out_and_said);
    RUN_TEST(test_uff_signals_of_another_system_are_read);
    RUN_TEST(test_uff_signals_of_another_system_take_names_and_scale_by_map);
    RUN_TEST(test_uff_response_of_another_system_is_read);
    RUN_TEST(test_uff_one_of_several_responses_is_asked_for);
    RUN_TEST(test_uff_binary_of_another_system_is_read);
    RUN_TEST(test_uff_refusals_name_line_and_value);
    RUN_TEST(test_uff_file_of_ours_that_lost_its_end_is_refused);
    RUN_TEST(test_uff_axis_names_columns_both_ways);
    int failures = UNITY_END();
    scratch_close();
    return failures;
}
