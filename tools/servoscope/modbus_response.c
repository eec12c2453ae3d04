/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/modbus_response.h"

#include "lab/estimate/frf_mean.h"
#include "lab/estimate/method.h"
#include "lab/estimate/setup.h"
#include "lab/record/json_out.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static double rate_hz(const struct msgen_table *table)
{
    return (double)table->rate_num_hz / (double)table->rate_den;
}

bool modbus_response_begin(struct modbus_response *self, const struct measure_plan *plan)
{
    const struct msgen_table *table = plan->table;
    *self = (struct modbus_response){.plan = plan, .bin_count = table->bin_count};
    size_t values = (size_t)plan->periods * table->bin_count;
    self->bins = malloc(table->bin_count * sizeof *self->bins);
    self->input = calloc(values, sizeof *self->input);
    self->output = calloc(values, sizeof *self->output);
    for (uint32_t b = 0; self->bins && b < table->bin_count; b++) {
        self->bins[b] = msgen_table_bin(table, b);
    }
    return self->bins && self->input && self->output;
}

void modbus_response_add(struct modbus_response *self, const struct modbus_record *records)
{
    // The drive says amplitudes; lab/estimate works with sums over the period.
    double to_sum = 0.5 * (double)self->plan->table->period_samples;
    double complex *input = self->input + self->periods * self->bin_count;
    double complex *output = self->output + self->periods * self->bin_count;
    for (size_t b = 0; b < self->bin_count; b++) {
        input[b] = to_sum * ((double)records[b].input[0] + I * (double)records[b].input[1]);
        output[b] = to_sum * ((double)records[b].output[0] + I * (double)records[b].output[1]);
    }
    self->periods++;
}

void modbus_response_set_means(struct modbus_response *self, const struct modbus_record *records, size_t periods)
{
    free(self->means);
    self->means = malloc(self->bin_count * sizeof *self->means);
    if (self->means) {
        memcpy(self->means, records, self->bin_count * sizeof *self->means);
        self->mean_periods = periods;
    }
}

static void describe(const struct modbus_response *self, const struct run *run, struct periodic *out_recording)
{
    const struct msgen_table *table = self->plan->table;
    *out_recording = (struct periodic){
        .run = run,
        .input = table->linear ? "force_N" : "torque_Nm",
        .output = table->linear ? "velocity_m_per_s" : "velocity_rad_per_s",
        .period_samples = table->period_samples,
        .bin_count = self->bin_count,
        .bins = self->bins,
        .total = (size_t)self->plan->settle_periods + self->plan->periods,
        .settle_source = periodic_settle_key,
        .settle = self->plan->settle_periods,
        .lost = self->left_out,
        .used = self->periods,
        .input_spectra = self->input,
        .output_spectra = self->output,
    };
}

/// std of the quotient of means: the equation of frf_mean.h from variances instead of periods.
static double std_of_means(const struct modbus_record *mean, double complex response, size_t periods)
{
    double complex covariance = (double)mean->covariance[0] + I * (double)mean->covariance[1];
    double gain = cabs(response), input = hypot((double)mean->input[0], (double)mean->input[1]);
    double residual = (double)mean->output_variance + gain * gain * (double)mean->input_variance -
                      2.0 * creal(conj(response) * covariance);
    return sqrt(fmax(residual, 0.0) / (double)periods) / input;
}

static int estimate_from_means(const struct modbus_response *self, const struct periodic *recording,
                               struct frf *out_frf, struct error *out_error)
{
    int status = estimate_begin(recording, "mean", 2.0 * ((double)self->mean_periods - 1.0), out_frf, out_error);
    if (status) {
        return status;
    }
    out_frf->periods = self->mean_periods;
    for (size_t b = 0; b < self->bin_count; b++) {
        const struct modbus_record *mean = &self->means[b];
        double complex input = (double)mean->input[0] + I * (double)mean->input[1];
        double complex output = (double)mean->output[0] + I * (double)mean->output[1];
        double complex response = output / input;
        // As frf_mean: a line whose input could be scatter alone does not count. |U|^2 M / s^2 is F(2, 2 (M - 1)).
        double m = (double)self->mean_periods;
        double ratio = m * creal(input * conj(input)) / (double)mean->input_variance;
        double chance = pow(1.0 + ratio / (m - 1.0), -(m - 1.0));
        bool excited = mean->input_variance == 0.0f ? input != 0.0 : chance < estimate_chance_of_dead_line;
        estimate_set_line(out_frf, b, excited ? response : 0.0,
                          excited ? std_of_means(mean, response, self->mean_periods) : INFINITY);
        self->input[b] = excited ? input : 0.0; // estimate_end looks at the first period for silent lines
    }
    return estimate_end(recording, out_frf, out_error);
}

static bool set_keys(const struct modbus_response *self, const struct modbus_response_facts *facts, bool from_means,
                     struct frf *io_frf)
{
    bool set = setup_set_keys(io_frf, setup_zoh, 0.0) && estimate_set_key(io_frf, "drive", "%s", facts->drive) &&
               estimate_set_key(io_frf, "table_crc32", "%08x", (unsigned)self->plan->table->header_crc32) &&
               estimate_set_key(io_frf, "mode", "%s", self->plan->mode == drive_mode_cascade ? "cascade" : "torque") &&
               estimate_set_key(io_frf, "spectra", "%s",
                                from_means ? "means and variances of the drive" : "periods of the drive");
    if (set && self->unread > 0) {
        set = estimate_set_key(io_frf, "periods_not_read", "%zu", self->unread);
    }
    if (set && facts->torque_clipped > 0) {
        set = estimate_set_key(io_frf, "torque_clipped", "%u", (unsigned)facts->torque_clipped);
    }
    if (set && facts->stopped_by) {
        set = estimate_set_key(io_frf, "stopped_by", "%s", facts->stopped_by);
    }
    return set;
}

static int report(const struct modbus_response *self, const struct modbus_response_facts *facts, const struct frf *frf,
                  const struct command_context *context, struct error *out_error)
{
    size_t valid = 0;
    for (size_t line = 0; line < frf->count; line++) {
        valid += frf->valid[line];
    }
    if (context->json) {
        cJSON *object = cJSON_CreateObject();
        cJSON_AddStringToObject(object, "out", facts->out);
        cJSON_AddStringToObject(object, "ended", facts->stopped_by ? facts->stopped_by : "complete");
        cJSON_AddNumberToObject(object, "lines", (double)frf->count);
        cJSON_AddNumberToObject(object, "valid_lines", (double)valid);
        cJSON_AddNumberToObject(object, "periods", (double)frf->periods);
        cJSON_AddNumberToObject(object, "periods_left_out", (double)self->left_out);
        cJSON_AddNumberToObject(object, "periods_not_read", (double)self->unread);
        cJSON_AddNumberToObject(object, "torque_clipped", facts->torque_clipped);
        cJSON_AddNumberToObject(object, "requests", facts->requests);
        cJSON_AddNumberToObject(object, "requests_repeated", facts->repeated);
        cJSON_AddNumberToObject(object, "replies_not_believed", facts->stale);
        int status = json_print_stdout(object, out_error);
        cJSON_Delete(object);
        return status;
    }
    if (!context->quiet) {
        const struct msgen_table *table = self->plan->table;
        printf(
            "%s: response of %zu lines (%zu valid) from %zu periods of %u samples at %.9g Hz, measured in the drive\n",
            facts->out, frf->count, valid, frf->periods, (unsigned)table->period_samples, rate_hz(table));
        printf("%u requests, %u repeated, %u replies that were not for their request\n", (unsigned)facts->requests,
               (unsigned)facts->repeated, (unsigned)facts->stale);
    }
    return 0;
}

int modbus_response_write(const struct modbus_response *self, const struct modbus_response_facts *facts,
                          const struct command_context *context, struct error *out_error)
{
    char path[] = "the drive";
    const struct run run = {.path = path, .sample_rate_hz = rate_hz(self->plan->table)};
    struct periodic recording;
    struct frf frf;
    describe(self, &run, &recording);
    bool from_means = self->unread > 0 && self->means && self->mean_periods >= 2;
    if (!from_means && self->periods < 2) {
        return error_set(out_error, error_refused,
                         "%zu periods were read: expected at least 2, or there is no standard deviation",
                         self->periods);
    }
    int status = from_means ? estimate_from_means(self, &recording, &frf, out_error)
                            : frf_mean_estimate(&recording, NULL, &frf, out_error);
    if (status) {
        return status;
    }
    status = set_keys(self, facts, from_means, &frf) ? frf_write(facts->out, &frf, out_error)
                                                     : error_set(out_error, error_refused, "memory is short");
    status = status ? status : report(self, facts, &frf, context, out_error);
    frf_free(&frf);
    return status;
}

void modbus_response_free(struct modbus_response *self)
{
    free(self->bins);
    free(self->input);
    free(self->output);
    free(self->means);
    *self = (struct modbus_response){0};
}
