/* SPDX-License-Identifier: MIT */
#include "bench/excitation_study.h"

#include "lab/numeric/statistics.h"
#include "lab/record/frf_file.h"
#include "lab/record/model_file.h"
#include "lab/record/table_file.h"
#include "sim/belt_drive.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

const char *const excitation_method_names[excitation_methods] = {"clip", "mca", "linf", "fast"};

enum { path_size = 512, rate_hz = 1000, settle_periods = 1 };

/// How long a slow change takes.
static const double wander_time_s = 5.0;

#if defined(__GNUC__)
__attribute__((format(printf, 1, 2)))
#endif
static bool
command(const char *format, ...)
{
    char text[4 * path_size];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    return system(text) == 0;
}

static void table_path(const struct excitation_place *place, enum excitation_method method, double rating,
                       char out_path[path_size])
{
    snprintf(out_path, path_size, "%s/%s-%g", place->folder, excitation_method_names[method], rating);
}

static bool refuse(const struct error *error)
{
    fprintf(stderr, "excitation: %s\n", error->message);
    return false;
}

static bool read_table(const char *prefix, struct table *out_table)
{
    struct error error = {0};
    char path[path_size + 8];
    snprintf(path, sizeof path, "%s.mst", prefix);
    return table_file_read(path, out_table, &error) == 0 || refuse(&error);
}

bool excitation_design(const struct excitation_place *place, enum excitation_method method, double rating,
                       double *out_effective_Nm)
{
    struct table table;
    char prefix[path_size];
    double power = 0.0;
    table_path(place, method, rating, prefix);
    if (!command(
            "'%s' design --quiet --rate 1000 --period 2000 --lines linear:0.5:100:0.5 --inertia 0.00516 "
            "--limit-torque %g --limit-velocity-m-per-s %g --pulley-radius 0.0159 --grid samples --method %s --out "
            "'%s'",
            place->program, rating, 0.05 * rating, excitation_method_names[method], prefix) ||
        !read_table(prefix, &table)) {
        return false;
    }
    for (size_t n = 0; n < table.samples; n++) {
        power += table.torque[n] * table.torque[n] / table.samples;
    }
    *out_effective_Nm = sqrt(power);
    table_free(&table);
    return true;
}

/// The testbed's inertia in two masses on a belt, friction, cogging, a motor that is not quite quiet.
static const char *const drive_json =
    "{\"structure\": \"two_mass\", \"motor_inertia_kgm2\": 0.0021, \"load_inertia_kgm2\": 0.00306,\n"
    " \"belt_stiffness_Nm_per_rad\": 300, \"belt_damping_Nms_per_rad\": 0.05, \"sample_rate_hz\": 1000,\n"
    " \"viscous_friction_Nms_per_rad\": 0.02, \"coulomb_friction_Nm\": 0.08, \"process_noise_Nm\": %g,\n"
    " \"effects\": {\"stribeck_friction\": {\"stribeck_excess_Nm\": 0.04, \"stribeck_velocity_rad_per_s\": 0.3},\n"
    "             \"cogging\": {\"amplitude_Nm\": 0.03, \"periods_per_rev\": 12, \"phase_rad\": 0.4}},\n"
    " \"sensors\": {\"counts_per_rev\": %g, \"position_noise_rad\": %g, \"velocity_noise_rad_per_s\": %g,\n"
    "             \"torque_noise_Nm\": %g}}\n";

static bool write_model(const struct excitation_drive *drive, const char *path)
{
    FILE *stream = fopen(path, "w");
    if (!stream) {
        return false;
    }
    if (drive->poor_sensors) {
        fprintf(stream, drive_json, 0.001, 4096.0, 1e-3, 5e-2, 5e-2);
    } else {
        fprintf(stream, drive_json, 0.001, 1048576.0, 1e-6, 2e-4, 1e-3);
    }
    return fclose(stream) == 0;
}

/// A slow change: first-order noise of standard deviation one.
struct wander {
    double value;
    double keep; ///< share that is left after a sample
};

static void step_wander(struct wander *self, struct random *random)
{
    self->value = self->keep * self->value + sqrt(1.0 - self->keep * self->keep) * random_normal(random);
}

/// Plays the table through the model in its cascade while friction and stiffness change.
static void play_wandering(const struct excitation_drive *drive, const struct sim_model *nominal,
                           const struct table *table, struct run *io_run)
{
    struct sim_model model = *nominal;
    struct sim_belt_drive simulated;
    struct wander friction = {0.0, exp(-1.0 / (rate_hz * wander_time_s))};
    struct wander stiffness = friction;
    struct random random;
    double *const torque = io_run->columns[0].data;
    double *const velocity = io_run->columns[1].data;
    random_seed(&random, nominal->seed + 1000);
    friction.value = random_normal(&random);
    stiffness.value = random_normal(&random);
    sim_belt_drive_init(&simulated, &model, table->position[table->start_index]);
    for (size_t n = 0; n < io_run->rows; n++) {
        const size_t at = (table->start_index + n) % table->samples;
        const struct sim_command asked = {.control = sim_control_cascade,
                                          .position = table->position[at],
                                          .velocity = table->velocity[at],
                                          .torque = table->torque[at]};
        struct sim_sample sample;
        sim_belt_drive_step(&simulated, &asked, &sample);
        torque[n] = sample.torque;
        velocity[n] = sample.velocity;
        step_wander(&friction, &random);
        step_wander(&stiffness, &random);
        const double rub = 1.0 + drive->friction_wander * friction.value;
        model.coulomb_friction_Nm = nominal->coulomb_friction_Nm * rub;
        model.viscous_friction_Nms_per_rad = nominal->viscous_friction_Nms_per_rad * rub;
        model.belt_stiffness_Nm_per_rad =
            nominal->belt_stiffness_Nm_per_rad * (1.0 + drive->stiffness_wander * stiffness.value);
    }
}

/// The simulator of the program does not change while it plays, so this recording is made here.
static bool record_wandering(const struct excitation_drive *drive, const char *model_path, const char *table_prefix,
                             uint64_t seed, const char *run_path)
{
    struct error error = {0};
    struct sim_model model;
    struct table table;
    if (model_file_read(model_path, &model, &error) != 0) {
        return refuse(&error);
    }
    if (!read_table(table_prefix, &table)) {
        return false;
    }
    model.seed = seed;
    struct run run = {.sample_rate_hz = rate_hz,
                      .rows = (settle_periods + excitation_periods) * excitation_samples,
                      .period_samples = excitation_samples,
                      .periods = excitation_periods,
                      .settle_periods = settle_periods,
                      .has_settle_periods = true,
                      .bin_count = table.bin_count,
                      .bins = table.bins};
    bool done = run_add_column(&run, "torque_Nm") && run_add_column(&run, "velocity_rad_per_s");
    if (done) {
        play_wandering(drive, &model, &table, &run);
        done = run_write(run_path, &run, &error) == 0 || refuse(&error);
    }
    run.bins = NULL; // the table's
    run_free(&run);
    table_free(&table);
    return done;
}

static bool read_response(const char *path, struct excitation_recording *out_recording)
{
    struct error error = {0};
    struct frf frf;
    if (frf_read(path, &frf, &error) != 0) {
        return refuse(&error);
    }
    for (size_t k = 0; k < excitation_lines && k < frf.count; k++) {
        out_recording->magnitude[k] = hypot(frf.real[k], frf.imag[k]);
        out_recording->std[k] = frf.std[k];
    }
    const bool whole = frf.count == excitation_lines;
    frf_free(&frf);
    return whole;
}

bool excitation_measure(const struct excitation_place *place, const struct excitation_drive *drive,
                        enum excitation_method method, uint64_t seed, struct excitation_recording *out_recording)
{
    struct error error = {0};
    char table[path_size], model[path_size], run[path_size], frf[path_size];
    table_path(place, method, drive->rating, table);
    snprintf(model, sizeof model, "%s/drive.json", place->folder);
    snprintf(run, sizeof run, "%s/run.csv", place->folder);
    snprintf(frf, sizeof frf, "%s/frf.csv", place->folder);
    if (!write_model(drive, model)) {
        return false;
    }
    const bool wanders = drive->friction_wander > 0.0 || drive->stiffness_wander > 0.0;
    if (wanders ? !record_wandering(drive, model, table, seed, run)
                : !command("'%s' simulate --quiet --model '%s' --table '%s.mst' --periods %d --settle %d --seed %llu "
                           "--out '%s'",
                           place->program, model, table, excitation_periods, settle_periods, (unsigned long long)seed,
                           run)) {
        return false;
    }
    if (!command("'%s' frf --quiet '%s' --out '%s'", place->program, run, frf) || !read_response(frf, out_recording)) {
        return false;
    }
    return run_read(run, &(struct run_options){0}, &out_recording->run, &error) == 0 || refuse(&error);
}

static double snr_of_periods(const double *signal)
{
    double all = 0.0, power = 0.0, scatter = 0.0;
    for (size_t n = 0; n < excitation_samples; n++) {
        double mean = 0.0, square = 0.0;
        for (size_t p = 0; p < excitation_periods; p++) {
            mean += signal[p * excitation_samples + n] / excitation_periods;
        }
        for (size_t p = 0; p < excitation_periods; p++) {
            const double off = signal[p * excitation_samples + n] - mean;
            square += off * off / (excitation_periods - 1);
        }
        all += mean / excitation_samples;
        // What the scatter leaves in the mean is no signal.
        power += (mean * mean - square / excitation_periods) / excitation_samples;
        scatter += sqrt(square) / excitation_samples;
    }
    return 10.0 * log10(power - all * all) - 20.0 * log10(scatter);
}

double excitation_snr_db(const struct run *run, const char *column, double noise, uint64_t seed)
{
    enum { counted = excitation_periods * excitation_samples };
    const double *clean = run_column(run, column);
    double *signal = malloc(counted * sizeof *signal);
    double snr_db = NAN;
    if (clean && signal && run->rows >= counted) {
        struct random random;
        random_seed(&random, seed);
        for (size_t n = 0; n < counted; n++) {
            signal[n] = clean[run->rows - counted + n] + noise * random_normal(&random);
        }
        snr_db = snr_of_periods(signal);
    }
    free(signal);
    return snr_db;
}

double excitation_level_db(const double std[excitation_lines])
{
    double sum = 0.0;
    for (size_t k = 0; k < excitation_lines; k++) {
        sum += 20.0 * log10(std[k]);
    }
    return sum / excitation_lines;
}
