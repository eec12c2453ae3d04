/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "tests/truth/truth_case.h"

enum { PATH_MAX_LENGTH = 1024 };

static void write_model(const struct truth_plant_spec *spec, FILE *file)
{
    fprintf(file, "{\n  \"structure\": \"%s\",\n", spec->two_mass ? "two_mass" : "rigid");
    fprintf(file, "  \"motor_inertia_kgm2\": %.12g,\n", spec->motor_inertia_kgm2);
    fprintf(file, "  \"load_inertia_kgm2\": %.12g,\n", spec->load_inertia_kgm2);
    if (spec->two_mass) {
        fprintf(file, "  \"belt_stiffness_Nm_per_rad\": %.12g,\n", spec->belt_stiffness_Nm_per_rad);
        fprintf(file, "  \"belt_damping_Nms_per_rad\": %.12g,\n", spec->belt_damping_Nms_per_rad);
    }
    fprintf(file, "  \"viscous_friction_Nms_per_rad\": %.12g,\n", spec->viscous_friction_Nms_per_rad);
    fprintf(file, "  \"coulomb_friction_Nm\": %.12g,\n", spec->coulomb_friction_Nm);
    fprintf(file, "  \"torque_lag_s\": %.12g,\n", spec->torque_lag_s);
    fprintf(file, "  \"dead_time_s\": %.12g,\n", spec->dead_time_s);
    fprintf(file, "  \"pulley_radius_m\": 0.0159,\n  \"sample_rate_hz\": %d\n}\n", TRUTH_RATE_HZ);
}

static void write_causes(const struct truth_case *self, FILE *file)
{
    fprintf(file, "  \"causes\": [");
    for (int i = 0; i < self->wish.causes; i++) {
        struct truth_parameter parameters[TRUTH_PARAMETERS_MAX];
        int count = truth_kind_parameters(self->wish.kind[i], &self->truth, parameters);
        fprintf(file,
                "%s\n    {\"id\": \"%s\", \"catalogued\": %s, \"amount\": %.6g, \"expected_evidence_nats\": %.4g, ",
                i ? "," : "", truth_kind_name(self->wish.kind[i]),
                truth_kind_is_catalogued(self->wish.kind[i]) ? "true" : "false", self->hidden[i].amount,
                self->evidence_nats[i]);
        fprintf(file, "\"share_of_torque\": %.4g, \"parameters\": {", self->share[i]);
        for (int k = 0; k < count; k++) {
            fprintf(file, "%s\"%s\": %.12g", k ? ", " : "", parameters[k].name, parameters[k].value);
        }
        fprintf(file, "}}");
    }
    fprintf(file, "],\n");
}

static void write_answer(const struct truth_case *self, FILE *file)
{
    const struct truth_plant_spec *truth = &self->truth.plant;
    const struct truth_sensors *sensors = &self->truth.sensors;
    fprintf(file, "{\n  \"seed\": %llu,\n  \"size\": \"%s\",\n  \"size_reached\": %s,\n",
            (unsigned long long)self->wish.seed, truth_size_name(self->wish.size), self->reached ? "true" : "false");
    write_causes(self, file);
    fprintf(file, "  \"protocol\": \"%s\",\n", self->protocol == truth_protocol_stroke ? "stroke" : "multisine");
    fprintf(file, "  \"drive\": {\"structure\": \"%s\", \"motor_inertia_kgm2\": %.12g, ",
            truth->two_mass ? "two_mass" : "rigid", truth->motor_inertia_kgm2);
    fprintf(file, "\"load_inertia_kgm2\": %.12g, \"belt_stiffness_Nm_per_rad\": %.12g,\n", truth->load_inertia_kgm2,
            truth->belt_stiffness_Nm_per_rad);
    fprintf(file, "    \"belt_damping_Nms_per_rad\": %.12g, \"viscous_friction_Nms_per_rad\": %.12g,\n",
            truth->belt_damping_Nms_per_rad, truth->viscous_friction_Nms_per_rad);
    fprintf(file, "    \"coulomb_friction_Nm\": %.12g, \"torque_lag_s\": %.12g, \"dead_time_s\": %.12g,\n",
            truth->coulomb_friction_Nm, truth->torque_lag_s, truth->dead_time_s);
    fprintf(file, "    \"bristle\": %d, \"speed_from_encoder\": %d, \"process_noise_Nm\": %.12g},\n",
            (int)truth->bristle, sensors->speed_from_encoder, truth->process_noise_Nm);
    fprintf(file, "  \"noise\": {\"position_rad\": %.4g, \"velocity_rad_per_s\": %.4g, \"torque_Nm\": %.4g, ",
            sensors->position_rad, sensors->velocity_rad_per_s, sensors->torque_Nm);
    fprintf(file, "\"counts_per_rev\": %.0f},\n", sensors->counts_per_rev);
    fprintf(file, "  \"controller\": {\"position_gain_per_s\": %.6g, \"velocity_gain_Nms_per_rad\": %.6g, ",
            self->controller.position_gain_per_s, self->controller.velocity_gain_Nms_per_rad);
    fprintf(file, "\"integral_rate_per_s\": %.6g, \"late_samples\": %d}\n}\n", self->controller.integral_rate_per_s,
            self->controller.late_samples);
}

static FILE *open_in(const char *directory, const char *name)
{
    char path[PATH_MAX_LENGTH];
    if (snprintf(path, sizeof path, "%s/%s", directory, name) >= (int)sizeof path) {
        fprintf(stderr, "%s: path too long\n", directory);
        return NULL;
    }
    FILE *file = fopen(path, "w");
    if (!file) {
        fprintf(stderr, "%s: %s\n", path, strerror(errno));
    }
    return file;
}

static int close_written(FILE *file, const char *name)
{
    int failed = ferror(file);
    failed |= fclose(file) != 0;
    if (failed) {
        fprintf(stderr, "%s: write error\n", name);
    }
    return failed ? -1 : 0;
}

static int make_directories(const char *directory)
{
    char path[PATH_MAX_LENGTH];
    size_t length = strlen(directory);
    if (length >= sizeof path) {
        fprintf(stderr, "%s: path too long\n", directory);
        return -1;
    }
    for (size_t i = 1; i <= length; i++) {
        if (directory[i] == '/' || directory[i] == '\0') {
            memcpy(path, directory, i);
            path[i] = '\0';
            if (mkdir(path, 0777) != 0 && errno != EEXIST) {
                fprintf(stderr, "%s: %s\n", path, strerror(errno));
                return -1;
            }
        }
    }
    return 0;
}

static int write_run(const struct truth_case *self, const char *directory, const char *name,
                     const struct truth_excitation *excitation, uint64_t noise_seed)
{
    struct truth_run run;
    int status = truth_run_make(&run, &self->truth.plant, &self->controller, &self->truth.sensors, excitation,
                                self->periods, noise_seed);
    if (status) {
        fprintf(stderr, "%s: seed %llu: the loop left its reference\n", directory, (unsigned long long)self->wish.seed);
    } else {
        FILE *file = open_in(directory, name);
        status = file ? truth_run_write(&run, file) : -1;
        status = file && close_written(file, name) ? -1 : status;
    }
    truth_run_free(&run);
    return status;
}

int truth_case_write(const struct truth_case *self, const char *directory)
{
    if (make_directories(directory)) {
        return -1;
    }
    uint64_t noise_seed = truth_case_noise_seed(self);
    if (write_run(self, directory, "run1.csv", &self->fit, noise_seed) ||
        write_run(self, directory, "run2.csv", &self->validation, noise_seed + 1u)) {
        return -1;
    }
    FILE *model = open_in(directory, "nominal.json");
    if (!model) {
        return -1;
    }
    write_model(&self->nominal, model);
    return close_written(model, "nominal.json");
}

int truth_case_write_answer(const struct truth_case *self, const char *directory)
{
    FILE *answer = open_in(directory, "truth.json");
    if (!answer) {
        return -1;
    }
    write_answer(self, answer);
    return close_written(answer, "truth.json");
}
