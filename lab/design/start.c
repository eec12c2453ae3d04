/* SPDX-License-Identifier: MIT */
#include "lab/design/start.h"

#include "lab/design/start_phase.h"
#include "sim/model.h"

#include <math.h>

static const double same_rate = 1e-9;

static int check_model(const struct design_request *request, struct error *out_error)
{
    const double rate_hz = (double)request->rate_num_hz / request->rate_den;
    if (!request->start_model) {
        return error_set(out_error, error_usage, "start: no model is given, expected one");
    }
    if (!(fabs(request->start_model->sample_rate_hz - rate_hz) <= same_rate * rate_hz)) {
        return error_set(out_error, error_refused, "start: the model runs at %.9g Hz, expected the table's %.9g Hz",
                         request->start_model->sample_rate_hz, rate_hz);
    }
    return 0;
}

static struct design_transient_table table_of(const struct design_request *request, const struct design_result *result)
{
    return (struct design_transient_table){
        .rate_hz = (double)request->rate_num_hz / request->rate_den,
        .period_samples = result->period_samples,
        .line_count = result->bin_count,
        .bins = result->bins,
        .amplitude_rad = result->amplitude_rad,
        .phase_rad = result->phase_rad,
        .inertia_kgm2 = request->inertia_kgm2,
    };
}

bool design_start_shares(const struct design_request *request, const struct design_result *result, double *out_shares)
{
    const struct design_transient_table table = table_of(request, result);
    const enum design_loop_mode mode = request->torque_mode ? design_loop_torque : design_loop_cascade;
    const struct sim_model *drive = request->start == design_start_model ? request->start_model : NULL;
    struct error ignored;
    return design_start_map(&table, drive, mode, out_shares, &ignored) == 0;
}

int design_start_apply(const struct design_request *request, struct design_result *io_result, struct error *out_error)
{
    const struct design_transient_table table = table_of(request, io_result);
    const enum design_loop_mode mode = request->torque_mode ? design_loop_torque : design_loop_cascade;
    const bool known = request->start == design_start_model;
    int status = known ? check_model(request, out_error) : 0;
    if (status) {
        return status;
    }
    if (known || request->start == design_start_bank) {
        return design_start_choose(&table, known ? request->start_model : NULL, mode, &io_result->start_index,
                                   &io_result->expected_transient, out_error);
    }
    if (request->start == design_start_paper) {
        io_result->start_index = design_start_phase_paper(io_result->period_samples, io_result->velocity_rad_per_s,
                                                          io_result->acceleration_rad_per_s2);
    }
    if (design_start_expect(&table, NULL, mode, io_result->start_index, &io_result->expected_transient, NULL)) {
        io_result->expected_transient = -1;
    }
    return 0;
}
