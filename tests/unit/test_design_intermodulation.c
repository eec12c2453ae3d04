/* SPDX-License-Identifier: MIT */
/// Harmonics and products on excited lines, against counting them one by one: lab/design/intermodulation.h.
#include "lab/design/intermodulation.h"

#include "lab/numeric/statistics.h"
#include "unity.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { bins_max = 400, sets = 60 };

static struct design_intermodulation counts;
static bool excited[bins_max + 1];
static uint32_t bins[bins_max];
static size_t line_count;

void setUp(void)
{
    memset(excited, 0, sizeof excited);
    line_count = 0;
}

void tearDown(void)
{
    design_intermodulation_free(&counts);
}

static void excite(uint32_t first, uint32_t last, uint32_t step)
{
    for (uint32_t bin = first; bin <= last; bin += step) {
        excited[bin] = true;
        bins[line_count++] = bin;
    }
}

static void count(void)
{
    design_intermodulation_free(&counts);
    TEST_ASSERT_TRUE(design_intermodulation_count(line_count, bins, &counts));
    TEST_ASSERT_EQUAL_size_t(line_count, counts.line_count);
}

// ---- One by one

static uint64_t products[design_product_count][bins_max + 1];

static void note(enum design_product kind, int64_t bin)
{
    int64_t folded = bin < 0 ? -bin : bin;
    if (folded > 0 && folded <= bins_max) {
        products[kind][folded]++;
    }
}

static void note_triples(int64_t a, int64_t b)
{
    for (size_t k = 0; k < line_count; k++) {
        int64_t c = bins[k];
        if (c == a || c == b) {
            continue;
        }
        note(design_product_triple_minus, a + b - c);
        if (c > b) {
            note(design_product_triple_sum, a + b + c);
        }
    }
}

static void count_one_by_one(void)
{
    memset(products, 0, sizeof products);
    for (size_t i = 0; i < line_count; i++) {
        int64_t a = bins[i];
        note(design_product_second_harmonic, 2 * a);
        note(design_product_third_harmonic, 3 * a);
        for (size_t j = 0; j < line_count; j++) {
            int64_t b = bins[j];
            if (a != b) {
                note(design_product_double_plus, 2 * a + b);
                note(design_product_double_minus, 2 * a - b);
            }
            if (a < b) {
                note(design_product_sum, a + b);
                note(design_product_difference, a - b);
                note_triples(a, b);
            }
        }
    }
}

/// Every multiple of the spacing between the lowest and the highest line, excited or free.
static void assert_map_as_one_by_one(const char *message)
{
    struct design_product_map map;
    TEST_ASSERT_TRUE(design_intermodulation_map(line_count, bins, &map));
    TEST_ASSERT_EQUAL_size_t_MESSAGE((bins[line_count - 1] - bins[0]) / counts.spacing_bins + 1, map.count, message);
    for (size_t i = 0; i < map.count; i++) {
        uint64_t orders[2] = {0, 0};
        TEST_ASSERT_EQUAL_UINT32(bins[0] + i * counts.spacing_bins, map.bins[i]);
        TEST_ASSERT_EQUAL(excited[map.bins[i]], map.excited[i]);
        for (int kind = 0; kind < design_product_count; kind++) {
            orders[kind >= (int)design_product_third_harmonic] += products[kind][map.bins[i]];
        }
        TEST_ASSERT_EQUAL_DOUBLE_MESSAGE((double)orders[0], map.second_order[i], message);
        TEST_ASSERT_EQUAL_DOUBLE_MESSAGE((double)orders[1], map.third_order[i], message);
    }
    design_product_map_free(&map);
}

static void assert_as_one_by_one(const char *message)
{
    size_t second = 0;
    size_t third = 0;
    for (size_t k = 0; k < line_count; k++) {
        bool hit[2] = {false, false};
        for (int kind = 0; kind < design_product_count; kind++) {
            bool of_third_order = kind >= (int)design_product_third_harmonic;
            hit[of_third_order] = hit[of_third_order] || products[kind][bins[k]] > 0;
        }
        second += hit[0];
        third += hit[1];
    }
    TEST_ASSERT_EQUAL_size_t_MESSAGE(second, counts.second_order_lines, message);
    TEST_ASSERT_EQUAL_size_t_MESSAGE(third, counts.third_order_lines, message);
    for (int kind = 0; kind < design_product_count; kind++) {
        uint64_t sum = 0;
        size_t lines = 0;
        for (size_t k = 0; k < line_count; k++) {
            sum += products[kind][bins[k]];
            lines += products[kind][bins[k]] > 0;
        }
        TEST_ASSERT_EQUAL_UINT64_MESSAGE(sum, counts.hits[kind].products, message);
        TEST_ASSERT_EQUAL_size_t_MESSAGE(lines, counts.hits[kind].lines, message);
    }
}

static void test_intermodulation_of_random_sets_is_what_counting_finds(void)
{
    struct random random;
    random_seed(&random, 11);
    for (int set = 0; set < sets; set++) {
        char message[100];
        const uint32_t highest = 1 + (uint32_t)(random_uniform(&random) * 120);
        const double density = random_uniform(&random);
        setUp();
        for (uint32_t bin = 1; bin <= highest; bin++) {
            if (bin == highest || random_uniform(&random) < density) {
                excite(bin, bin, 1);
            }
        }
        snprintf(message, sizeof message, "set %d: %zu lines up to %u", set, line_count, highest);
        count();
        count_one_by_one();
        assert_as_one_by_one(message);
        assert_map_as_one_by_one(message);
    }
}

/// Ordered triples with f1 + f2 - f3 in the band, as the reference counts them, are all of them: the trivial ones,
/// twice those of different lines, and 2 f1 - f3.
static uint64_t ordered_triples(void)
{
    return 2 * line_count * line_count - line_count + 2 * counts.hits[design_product_triple_minus].products +
           counts.hits[design_product_double_minus].products;
}

static void test_intermodulation_of_half_open_octaves_is_of_third_order_only(void)
{
    static const struct {
        uint32_t lowest;
        uint64_t triples;
    } reference[] = {{4, 44}, {16, 2736}, {64, 174784}};
    for (size_t i = 0; i < 3; i++) {
        setUp();
        excite(reference[i].lowest, 2 * reference[i].lowest - 1, 1);
        count();
        TEST_ASSERT_EQUAL_size_t(0, counts.second_order_lines);
        TEST_ASSERT_EQUAL_size_t(0, counts.hits[design_product_third_harmonic].lines);
        TEST_ASSERT_EQUAL_UINT64(reference[i].triples, ordered_triples());
    }
    TEST_ASSERT_EQUAL_size_t(64, counts.hits[design_product_double_minus].lines);
    TEST_ASSERT_EQUAL_size_t(64, counts.third_order_lines);
}

static void test_intermodulation_of_a_closed_octave_ties_its_ends(void)
{
    excite(16, 32, 1);
    count();
    TEST_ASSERT_EQUAL_UINT64(1, counts.hits[design_product_second_harmonic].products);
    TEST_ASSERT_EQUAL_UINT64(1, counts.hits[design_product_difference].products);
    TEST_ASSERT_EQUAL_size_t(2, counts.second_order_lines);
}

static void test_intermodulation_of_odd_lines_leaves_even_bins_free(void)
{
    excite(3, 393, 6); // odd multiples of 3; every fourth left out
    size_t kept = 0;
    for (size_t k = 0; k < line_count; k++) {
        if (k % 4 != 2) {
            bins[kept++] = bins[k];
        }
    }
    const size_t left_out = line_count - kept;
    line_count = kept;
    count();
    TEST_ASSERT_EQUAL_UINT32(3, counts.spacing_bins);
    TEST_ASSERT_TRUE(counts.odd_only);
    TEST_ASSERT_EQUAL_size_t(0, counts.second_order_lines);
    TEST_ASSERT_EQUAL_size_t(line_count, counts.third_order_lines);
    TEST_ASSERT_EQUAL_size_t(left_out, counts.free_odd_count);
    TEST_ASSERT_EQUAL_UINT32(15, counts.free_odd_bins[0]);
    TEST_ASSERT_EQUAL_UINT32(39, counts.free_odd_bins[1]);
    TEST_ASSERT_EQUAL_size_t(65, counts.free_even_count);
    for (uint32_t k = 0; k < 65; k++) {
        TEST_ASSERT_EQUAL_UINT32(6 * (k + 1), counts.free_even_bins[k]);
    }
}

static void test_intermodulation_of_mixed_lines_is_not_separable(void)
{
    excite(10, 12, 1);
    excite(15, 15, 1);
    count();
    TEST_ASSERT_FALSE(counts.odd_only);
    TEST_ASSERT_EQUAL_size_t(1, counts.free_odd_count);
    TEST_ASSERT_EQUAL_UINT32(13, counts.free_odd_bins[0]);
    TEST_ASSERT_EQUAL_size_t(1, counts.free_even_count);
    TEST_ASSERT_EQUAL_UINT32(14, counts.free_even_bins[0]);
}

static void test_intermodulation_of_one_line_is_none(void)
{
    excite(7, 7, 1);
    count();
    TEST_ASSERT_EQUAL_size_t(0, counts.second_order_lines + counts.third_order_lines);
    TEST_ASSERT_EQUAL_size_t(0, counts.free_odd_count + counts.free_even_count);
    TEST_ASSERT_EQUAL_UINT32(7, counts.spacing_bins);
}

/// Lines 1 .. n: f1 + f2 + f3 = s has the number of partitions of s into three different parts, the nearest whole
/// number to (s - 3)^2 / 12; f1 + f2 = s has floor((s - 1) / 2) of two.
static void test_intermodulation_of_ten_thousand_lines_is_exact(void)
{
    enum { many = 10000 };
    uint32_t *all = malloc(many * sizeof *all);
    uint64_t triples = 0;
    uint64_t pairs = 0;
    TEST_ASSERT_NOT_NULL(all);
    for (uint32_t s = 1; s <= many; s++) {
        all[s - 1] = s;
        triples += s > 3 ? ((uint64_t)(s - 3) * (s - 3) + 6) / 12 : 0;
        pairs += (s - 1) / 2;
    }
    bool counted = design_intermodulation_count(many, all, &counts);
    free(all);
    TEST_ASSERT_TRUE(counted);
    TEST_ASSERT_EQUAL_UINT64(triples, counts.hits[design_product_triple_sum].products);
    TEST_ASSERT_EQUAL_UINT64(pairs, counts.hits[design_product_sum].products);
    TEST_ASSERT_EQUAL_UINT64((uint64_t)many * (many - 1) / 2, counts.hits[design_product_difference].products);
    TEST_ASSERT_EQUAL_UINT64(many / 3, counts.hits[design_product_third_harmonic].products);
}

static void assert_says(const char *expected)
{
    char text[400];
    count();
    int length = design_intermodulation_describe(&counts, text, sizeof text);
    TEST_ASSERT_EQUAL_STRING(expected, text);
    TEST_ASSERT_EQUAL_INT((int)strlen(text), length);
}

static void test_intermodulation_says_what_it_counted(void)
{
    excite(1, 3, 1);
    assert_says(
        "Products of second order fall on 3 of 3 lines (1 second harmonic, 4 other products), and products of third "
        "order fall on 3 of 3 lines (1 third harmonic, 4 other products). No bin of the band is left free to show "
        "distortion.");
    setUp();
    excite(1, 7, 2);
    assert_says(
        "No second harmonic and no other product of second order falls on a line, but products of third order fall on "
        "4 of 4 "
        "lines (1 third harmonic, 20 other products). 3 even bins of the band are free and show even distortion, none "
        "shows odd distortion.");
    setUp();
    excite(5, 5, 1);
    assert_says("No second harmonic and no other product of second order falls on a line, and no third harmonic and no "
                "other product of third order falls on a line. No bin of the band is left free to show distortion.");
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_intermodulation_of_random_sets_is_what_counting_finds);
    RUN_TEST(test_intermodulation_of_half_open_octaves_is_of_third_order_only);
    RUN_TEST(test_intermodulation_of_a_closed_octave_ties_its_ends);
    RUN_TEST(test_intermodulation_of_odd_lines_leaves_even_bins_free);
    RUN_TEST(test_intermodulation_of_mixed_lines_is_not_separable);
    RUN_TEST(test_intermodulation_of_one_line_is_none);
    RUN_TEST(test_intermodulation_of_ten_thousand_lines_is_exact);
    RUN_TEST(test_intermodulation_says_what_it_counted);
    return UNITY_END();
}
