/* SPDX-License-Identifier: MIT */
/// The excitation section: limits, units and figures are those of the request and the result.
#include "lab/design/report.h"
#include "lab/design/report_sequence.h"
#include "lab/page/page.h"

#include "unity.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const uint32_t bins[] = {1, 2, 3, 4, 5, 6, 7, 8};
static struct design_request request;
static struct design_result result;
static char *text;

void setUp(void)
{
    request = (struct design_request){
        .rate_num_hz = 1000,
        .rate_den = 1,
        .period_samples = 200,
        .bin_count = sizeof bins / sizeof bins[0],
        .bins = bins,
        .limits = {.velocity_rad_per_s = 3.0, .torque_Nm = 1.0},
        .inertia_kgm2 = 0.01,
        .method = "newman",
    };
}

void tearDown(void)
{
    design_result_free(&result);
    free(text);
    text = NULL;
}

static void write_section(void)
{
    struct error error;
    struct page page;
    size_t size = 0;
    TEST_ASSERT_EQUAL_MESSAGE(0, design_run(&request, &result, &error), error.message);
    FILE *stream = open_memstream(&text, &size);
    TEST_ASSERT_NOT_NULL(stream);
    page_start(&page, stream, "test", NULL);
    design_report_sections(&page, &request, &result);
    TEST_ASSERT_EQUAL(0, page_end(&page, NULL));
    fclose(stream);
}

static void says(const char *part)
{
    TEST_ASSERT_TRUE_MESSAGE(strstr(text, part) != NULL, part);
}

static void test_design_report_shows_limits_and_figures(void)
{
    char effective[64], start[64];
    write_section();
    snprintf(effective, sizeof effective, "Effective torque %.4f Nm, %.0f %% of the bound", result.effective_torque_Nm,
             100 * result.effective_torque_Nm / result.bound_Nm);
    snprintf(start, sizeof start, "from sample %zu of the table", result.start_index);
    says(effective);
    says(start);
    says("limits ±1<");
    says("limits ±3<");
    says("velocity in rad/s");
    says("8, 5 to 40 Hz");
    says("the zero crossing of the velocity");
    TEST_ASSERT_NULL(strstr(text, "acceleration in rad/s²")); // no limit of its own: no panel
}

/* The torque's limit alone binds first; with a velocity limit far below what that gives, the velocity's does. */
static void test_design_report_names_the_limit_that_binds(void)
{
    write_section();
    says("Held back by the limit of the torque (");
    says("not by that of the velocity (");
    tearDown();
    request.limits.velocity_rad_per_s = 0.3;
    write_section();
    says("Held back by the limit of the velocity (");
    says("not by that of the torque (");
}

static void test_design_report_warns_where_a_limit_is_passed_between_samples(void)
{
    write_section();
    TEST_ASSERT_NULL(strstr(text, "Beyond a limit"));
    tearDown();
    request.grid = design_grid_samples;
    request.period_samples = 20; // few samples for eight lines
    request.rate_num_hz = 100;
    write_section();
    TEST_ASSERT_TRUE(result.peak_continuous.torque_Nm > 1.001);
    says("Beyond a limit between the samples");
}

/* All lines from 1 on: products fall on each of them, and no bin is free. */
static void test_design_report_maps_products_and_starts(void)
{
    char start[96];
    write_section();
    says("Intermodulation map");
    says("on each of the 8 bins from the lowest to the highest line");
    says("on a free bin (no data)");
    snprintf(start, sizeof start, "Chosen: sample %zu with %.2g %%", result.start_index,
             100 * result.expected_transient);
    says(start);
}

static void test_design_report_section_is_one_among_others(void)
{
    struct error error;
    struct page page;
    size_t size = 0;
    TEST_ASSERT_EQUAL_MESSAGE(0, design_run(&request, &result, &error), error.message);
    FILE *stream = open_memstream(&text, &size);
    page_start(&page, stream, "test", NULL);
    design_report_section(&page, "table <1>", &request, &result);
    TEST_ASSERT_EQUAL(1, page.sections);
    TEST_ASSERT_EQUAL(0, page_end(&page, NULL));
    fclose(stream);
    says("table &lt;1&gt;");
    says("Peaks against limits");
}

/* Nine tables: all of them in the overview, the first six one by one, numbered on from it. */
static void test_design_report_of_a_sequence_sums_up_first(void)
{
    struct error error;
    struct page page;
    struct design_report_sequence sequence;
    size_t size = 0;
    TEST_ASSERT_TRUE(design_report_sequence_begin(&sequence));
    for (uint32_t line = 1; line <= 9; line++) {
        char name[32];
        request.bins = &bins[line > 8 ? 7 : line - 1];
        request.bin_count = 1;
        request.limits.velocity_rad_per_s = line <= 2 ? 0.3 : 30.0;
        snprintf(name, sizeof name, "seq-%u.mst", line);
        TEST_ASSERT_EQUAL_MESSAGE(0, design_run(&request, &result, &error), error.message);
        TEST_ASSERT_TRUE(design_report_sequence_add(&sequence, name, &request, &result));
        design_result_free(&result);
    }
    FILE *stream = open_memstream(&text, &size);
    page_start(&page, stream, "test", NULL);
    TEST_ASSERT_TRUE(design_report_sequence_write(&sequence, &page));
    design_report_sequence_free(&sequence);
    TEST_ASSERT_EQUAL(0, page_end(&page, NULL));
    fclose(stream);
    says("the limit of the torque holds back 7, the limit of the velocity holds back 2");
    says("<h2><span>1</span> All tables</h2>");
    says("<h2><span>7</span> seq-6.mst</h2>");
    says("<td>seq-9.mst</td>");
    TEST_ASSERT_NULL(strstr(text, "<h2><span>8</span>"));
    says("<b>Figure 3</b> One period"); // two figures stand before
}

static void test_design_report_gives_acceleration_a_panel_if_limited(void)
{
    request.limits.acceleration_rad_per_s2 = 50.0;
    write_section();
    says("acceleration in rad/s²");
    says("limits ±50<");
}

static void test_design_report_shows_a_linear_axis_in_its_units(void)
{
    request.linear = true;
    request.start = design_start_none;
    write_section();
    says("effective force");
    says("force in N");
    says("velocity in m/s");
    says("moved mass");
    TEST_ASSERT_NULL(strstr(text, "rad"));
    TEST_ASSERT_NULL(strstr(text, "zero crossing"));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_design_report_shows_limits_and_figures);
    RUN_TEST(test_design_report_names_the_limit_that_binds);
    RUN_TEST(test_design_report_warns_where_a_limit_is_passed_between_samples);
    RUN_TEST(test_design_report_maps_products_and_starts);
    RUN_TEST(test_design_report_section_is_one_among_others);
    RUN_TEST(test_design_report_of_a_sequence_sums_up_first);
    RUN_TEST(test_design_report_gives_acceleration_a_panel_if_limited);
    RUN_TEST(test_design_report_shows_a_linear_axis_in_its_units);
    return UNITY_END();
}
