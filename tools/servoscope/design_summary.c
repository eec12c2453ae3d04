/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/design_summary.h"

#include "lab/design/intermodulation.h"
#include "lab/numeric/statistics.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static cJSON *json_of_peaks(const struct design_peaks *peaks, bool linear)
{
    cJSON *object = cJSON_CreateObject();
    cJSON_AddNumberToObject(object, linear ? "position_m" : "position_rad", peaks->position_rad);
    cJSON_AddNumberToObject(object, linear ? "velocity_m_per_s" : "velocity_rad_per_s", peaks->velocity_rad_per_s);
    cJSON_AddNumberToObject(object, linear ? "acceleration_m_per_s2" : "acceleration_rad_per_s2",
                            peaks->acceleration_rad_per_s2);
    cJSON_AddNumberToObject(object, linear ? "force_N" : "torque_Nm", peaks->torque_Nm);
    return object;
}

static double period_seconds(const struct design_summary *self)
{
    return (double)self->result->period_samples * self->request->rate_den / self->request->rate_num_hz;
}

/// How many of the lines are hit by what, and how many bins stay free to show it; null if memory is short.
static cJSON *json_of_products(const struct design_result *result)
{
    struct design_intermodulation counts;
    if (!design_intermodulation_count(result->bin_count, result->bins, &counts)) {
        return cJSON_CreateNull();
    }
    cJSON *object = cJSON_CreateObject();
    const struct design_product_hits *hits = counts.hits;
    cJSON_AddNumberToObject(object, "second_harmonic", (double)hits[design_product_second_harmonic].lines);
    cJSON_AddNumberToObject(object, "third_harmonic", (double)hits[design_product_third_harmonic].lines);
    cJSON_AddNumberToObject(object, "second_order", (double)counts.second_order_lines);
    cJSON_AddNumberToObject(object, "third_order", (double)counts.third_order_lines);
    cJSON_AddNumberToObject(object, "free_odd_bins", (double)counts.free_odd_count);
    cJSON_AddNumberToObject(object, "free_even_bins", (double)counts.free_even_count);
    design_intermodulation_free(&counts);
    return object;
}

cJSON *design_summary_json(const struct design_summary *self)
{
    const struct design_result *result = self->result;
    const bool linear = self->request->linear;
    cJSON *object = cJSON_CreateObject();
    cJSON_AddStringToObject(object, "method", result->method);
    cJSON_AddNumberToObject(object, "lines", (double)result->bin_count);
    cJSON_AddNumberToObject(object, linear ? "effective_force_N" : "effective_torque_Nm", result->effective_torque_Nm);
    cJSON_AddNumberToObject(object, linear ? "effective_force_continuous_N" : "effective_torque_continuous_Nm",
                            result->effective_torque_continuous_Nm);
    cJSON_AddNumberToObject(object, "crest_factor", result->crest_factor);
    cJSON_AddItemToObject(object, "peak", json_of_peaks(&result->peak, linear));
    cJSON_AddItemToObject(object, "peak_continuous", json_of_peaks(&result->peak_continuous, linear));
    cJSON_AddNumberToObject(object, linear ? "bound_N" : "bound_Nm", result->bound_Nm);
    cJSON_AddNumberToObject(object, "start_index", (double)result->start_index);
    cJSON_AddNumberToObject(object, "expected_transient",
                            result->expected_transient < 0 ? NAN : result->expected_transient);
    cJSON_AddItemToObject(object, "lines_hit", json_of_products(result));
    cJSON_AddNumberToObject(object, "starts", (double)result->starts);
    cJSON_AddBoolToObject(object, "interrupted", result->interrupted);
    cJSON_AddNumberToObject(object, "cpu_s", result->cpu_s);
    cJSON_AddNumberToObject(object, "test_time_s", self->test_time_s);
    // Without a plant and its noise it is not known: null, not zero.
    cJSON_AddItemToObject(object, "predicted_std",
                          self->predicted_std ? cJSON_CreateDoubleArray(self->predicted_std, (int)result->bin_count)
                                              : cJSON_CreateNull());
    return object;
}

static void print_peak(const char *name, const char *unit, double at_samples, double between, double limit)
{
    printf("  %-13s %11.5g %11.5g %-7s", name, at_samples, between, unit);
    if (limit > 0) {
        printf(" limit %.5g", limit);
    }
    putchar('\n');
}

static void print_peaks(const struct design_summary *self)
{
    const bool linear = self->request->linear;
    const struct design_limits *limits = &self->request->limits;
    const struct design_peaks *peak = &self->result->peak;
    const struct design_peaks *fine = &self->result->peak_continuous;
    printf("  peaks          at samples    in between\n");
    print_peak("position", linear ? "m" : "rad", peak->position_rad, fine->position_rad, limits->position_rad);
    print_peak("velocity", linear ? "m/s" : "rad/s", peak->velocity_rad_per_s, fine->velocity_rad_per_s,
               limits->velocity_rad_per_s);
    print_peak("acceleration", linear ? "m/s2" : "rad/s2", peak->acceleration_rad_per_s2, fine->acceleration_rad_per_s2,
               limits->acceleration_rad_per_s2);
    print_peak(linear ? "force" : "torque", linear ? "N" : "Nm", peak->torque_Nm, fine->torque_Nm, limits->torque_Nm);
}

static void print_effective(const struct design_summary *self)
{
    const struct design_result *result = self->result;
    const char *unit = self->request->linear ? "N" : "Nm";
    printf("effective %s %.4f %s, crest factor %.3f; %s more than %.4f %s (reached: %.0f %%)\n",
           self->request->linear ? "force" : "torque", result->effective_torque_Nm, unit, result->crest_factor,
           self->request->amplitude_tolerance_db > 0 ? "with these amplitudes no phases give" : "no phases give",
           result->bound_Nm, unit, 100 * result->effective_torque_Nm / result->bound_Nm);
    if (result->effective_torque_continuous_Nm < result->effective_torque_Nm) {
        printf("between the samples a limit is exceeded; held there too, the effective value would be %.4f %s\n",
               result->effective_torque_continuous_Nm, unit);
    }
}

static void print_prediction(const struct design_summary *self, double line_hz)
{
    const struct design_result *result = self->result;
    double *sorted = malloc(result->bin_count * sizeof *sorted);
    size_t worst = 0;
    if (!sorted) {
        return;
    }
    memcpy(sorted, self->predicted_std, result->bin_count * sizeof *sorted);
    for (size_t k = 1; k < result->bin_count; k++) {
        worst = self->predicted_std[k] > self->predicted_std[worst] ? k : worst;
    }
    printf("expected standard deviation of the response: median %.3g, largest %.3g at %.6g Hz, in %s\n",
           statistics_median(sorted, result->bin_count), self->predicted_std[worst], line_hz * result->bins[worst],
           self->request->linear ? "m/s per N" : "rad/s per Nm");
    free(sorted);
}

static void print_products(const struct design_result *result)
{
    struct design_intermodulation counts;
    char text[512];
    if (design_intermodulation_count(result->bin_count, result->bins, &counts)) {
        design_intermodulation_describe(&counts, text, sizeof text);
        printf("%s\n", text);
        design_intermodulation_free(&counts);
    }
}

void design_summary_print(const struct design_summary *self)
{
    const struct design_result *result = self->result;
    const double line_hz = 1 / period_seconds(self);
    printf("%s: %zu lines, %.6g to %.6g Hz, period %zu samples (%.6g s), start at sample %zu\n", result->method,
           result->bin_count, result->bins[0] * line_hz, result->bins[result->bin_count - 1] * line_hz,
           result->period_samples, period_seconds(self), result->start_index);
    print_effective(self);
    print_peaks(self);
    if (result->expected_transient >= 0) {
        printf("from rest, the first period's transient is expected to have %.2g %% of the motion's energy (%s)\n",
               100 * result->expected_transient,
               self->request->start == design_start_model ? "of the model given"
                                                          : "mean over a bank of nominal drives");
    }
    print_products(result);
    if (self->predicted_std) {
        print_prediction(self, line_hz);
    }
    printf("measuring takes %.6g s; written: %s.mst, %s.csv, %s.h\n", self->test_time_s, self->prefix, self->prefix,
           self->prefix);
}
