/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/quiet_run.h"

#include "lab/estimate/method.h"
#include "lab/estimate/periodic.h"
#include "lab/measure/measure.h"
#include "sim/node/direct_drive.h"

#include <string.h>

int quiet_run(const struct sim_model *model, const struct msgen_table *table, struct run *out_run,
              struct error *out_error)
{
    struct sim_model quiet = *model;
    quiet.process_noise_Nm = 0.0;
    quiet.sensors.counts_per_rev = 0.0;
    quiet.sensors.position_noise_rad = 0.0;
    quiet.sensors.velocity_noise_rad_per_s = 0.0;
    quiet.sensors.torque_noise_Nm = 0.0;
    quiet.sensors.velocity_filter_s = 0.0;
    const struct measure_plan plan = {.table = table,
                                      .mode = drive_mode_cascade,
                                      .settle_periods = 2,
                                      .periods = 2,
                                      .limits = GUARD_REAL_LIMITS_NONE};
    struct direct_drive simulated;
    struct measure_report report;
    struct drive drive = direct_drive_init(&simulated, &quiet);
    memset(out_run, 0, sizeof *out_run);
    int status = measure_run(&drive, &plan, out_run, &report, out_error);
    drive.operations->close(drive.self);
    if (status) {
        run_free(out_run);
    }
    return status;
}

int quiet_run_response(const struct sim_model *model, const struct msgen_table *table, struct frf *out_frf,
                       struct error *out_error)
{
    const struct periodic_options options = {.settle = periodic_settle_default};
    const struct estimate_method *method = estimate_method_find("mean", out_error);
    struct run run;
    struct periodic recording;
    memset(out_frf, 0, sizeof *out_frf);
    int status = method ? quiet_run(model, table, &run, out_error) : error_usage;
    if (status) {
        return status;
    }
    status = periodic_cut(&run, &options, &recording, out_error);
    if (!status) {
        status = method->estimate(&recording, NULL, out_frf, out_error);
        periodic_free(&recording);
    }
    run_free(&run);
    return status;
}
