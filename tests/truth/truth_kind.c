/* SPDX-License-Identifier: MIT */
#include "tests/truth/truth_kind.h"

#include <math.h>
#include <string.h>

static const double two_pi = 6.283185307179586476925286766559;
static const double most_periods = 60.0; // of cogging a turn

enum { BELT = 1, STROKE = 2, APERIODIC = 4, DRY = 8, LATE = 16, SOFT = 32 };

// `low` and `high`: bounds of the amount. BELT takes two masses; of DRY, LATE and SOFT only one goes into a case.
static const struct {
    const char *name;
    double low, high;
    unsigned traits;
} kinds[truth_kind_count] = {
    [truth_kind_clean] = {"clean", 1.0, 1.0, 0},
    [truth_kind_viscous_friction] = {"viscous_friction", 0.25, 4.0, 0},
    [truth_kind_coulomb_friction] = {"coulomb_friction", 0.25, 3.0, DRY},
    [truth_kind_stribeck_friction] = {"stribeck_friction", 0.15, 3.0, DRY},
    [truth_kind_asymmetric_friction] = {"asymmetric_friction", 0.15, 3.0, DRY},
    [truth_kind_load_bias] = {"load_bias", 0.06, 4.0, 0},
    [truth_kind_inertia] = {"inertia", 0.12, 1.5, 0},
    [truth_kind_belt_elasticity] = {"belt_elasticity", 0.06, 2.0, BELT | SOFT},
    [truth_kind_cogging] = {"cogging", 0.03, 4.0, 0},
    [truth_kind_torque_lag] = {"torque_lag", 0.2, 3.0, LATE},
    [truth_kind_dead_time] = {"dead_time", 0.05, 4.0, LATE},
    [truth_kind_presliding] = {"presliding", 0.1, 20.0, DRY},
    [truth_kind_second_mode] = {"second_mode", 0.02, 4.0, BELT | SOFT},
    [truth_kind_position_dependent_stiffness] = {"position_dependent_stiffness", 0.02, 5.0, BELT | SOFT},
    [truth_kind_hardening_stiffness] = {"hardening_stiffness", 0.02, 8.0, BELT | SOFT},
    [truth_kind_backlash] = {"backlash", 0.02, 6.0, BELT | SOFT},
    [truth_kind_encoder_eccentricity] = {"encoder_eccentricity", 0.02, 10.0, STROKE},
    [truth_kind_torque_saturation] = {"torque_saturation", 0.02, 3.0, LATE},
    [truth_kind_periodic_disturbance] = {"periodic_disturbance", 0.02, 5.0, APERIODIC},
    [truth_kind_friction_drift] = {"friction_drift", 0.1, 4.0, APERIODIC},
    [truth_kind_lost_samples] = {"lost_samples", 0.02, 20.0, APERIODIC},
    [truth_kind_quadratic_drag] = {"quadratic_drag", 0.1, 4.0, 0},
    [truth_kind_position_friction] = {"position_friction", 0.1, 2.2, 0},
    [truth_kind_torque_constant] = {"torque_constant", 0.1, 3.0, 0},
    [truth_kind_torque_constant_drift] = {"torque_constant_drift", 0.1, 5.0, APERIODIC},
    [truth_kind_load_friction] = {"load_friction", 0.1, 3.0, BELT},
    [truth_kind_torque_friction] = {"torque_friction", 0.1, 5.0, 0},
    [truth_kind_bias_step] = {"bias_step", 0.1, 5.0, APERIODIC},
    [truth_kind_bursts] = {"bursts", 0.1, 5.0, APERIODIC},
    [truth_kind_torque_dead_band] = {"torque_dead_band", 0.05, 4.0, 0},
    [truth_kind_torque_rate] = {"torque_rate", 0.01, 4.0, 0},
    [truth_kind_ground_spring] = {"ground_spring", 0.05, 5.0, 0},
    [truth_kind_sensor_filter] = {"sensor_filter", 0.03, 4.0, 0},
};

const char *truth_kind_name(enum truth_kind kind)
{
    return kinds[kind].name;
}

enum truth_kind truth_kind_find(const char *name)
{
    int kind = 0;
    while (kind < truth_kind_count && strcmp(kinds[kind].name, name) != 0) {
        kind++;
    }
    return (enum truth_kind)kind;
}

int truth_kind_is_catalogued(enum truth_kind kind)
{
    return kind >= truth_kind_viscous_friction && kind <= truth_kind_lost_samples;
}

int truth_kind_needs_belt(enum truth_kind kind)
{
    return (kinds[kind].traits & BELT) != 0;
}

int truth_kind_needs_stroke(enum truth_kind kind)
{
    return (kinds[kind].traits & STROKE) != 0;
}

int truth_kind_is_aperiodic(enum truth_kind kind)
{
    return (kinds[kind].traits & APERIODIC) != 0;
}

int truth_kind_goes_with(enum truth_kind a, enum truth_kind b)
{
    const unsigned one_only = DRY | LATE | SOFT;
    // A rigid model's inertia and friction are not those of the motor alone: what remains depends on the belt.
    return a != b && !(kinds[a].traits & kinds[b].traits & one_only);
}

void truth_kind_bounds(enum truth_kind kind, double *out_low, double *out_high)
{
    *out_low = kinds[kind].low;
    *out_high = kinds[kind].high;
}

static double fewest_periods(const struct truth_setting *setting)
{
    return fmax(6.0, ceil(2.0 * two_pi / setting->range_rad));
}

int truth_kind_has_room(enum truth_kind kind, const struct truth_setting *setting)
{
    return kind != truth_kind_cogging || fewest_periods(setting) <= most_periods;
}

static double between(double draw, double low, double high)
{
    return low + (high - low) * draw;
}

static double sign_of(double draw)
{
    return draw < 0.5 ? -1.0 : 1.0;
}

// What is believed of a value: nothing, or too much, or too little.
static double believed(double value, const struct truth_hidden *hidden)
{
    if (hidden->draws[0] < 1.0 / 3.0) {
        return 0.0;
    }
    double factor = 1.0 + hidden->amount;
    return hidden->draws[1] < 0.5 ? value * factor : value / factor;
}

static void apply_friction(const struct truth_hidden *hidden, const struct truth_setting *setting, int known,
                           struct truth_drive *io_drive)
{
    (void)setting;
    struct truth_plant_spec *io = &io_drive->plant;
    double amount = hidden->amount;
    const double *draws = hidden->draws;
    int absent = draws[0] < 1.0 / 3.0;
    switch (hidden->kind) {
    case truth_kind_viscous_friction:
        io->viscous_friction_Nms_per_rad *= absent ? amount : 1.0;
        if (!known) {
            io->viscous_friction_Nms_per_rad = believed(io->viscous_friction_Nms_per_rad, hidden);
        }
        break;
    case truth_kind_coulomb_friction:
        io->coulomb_friction_Nm *= absent ? amount : 1.0;
        if (!known) {
            io->coulomb_friction_Nm = believed(io->coulomb_friction_Nm, hidden);
        }
        break;
    case truth_kind_stribeck_friction:
        io->stribeck_velocity_rad_per_s = between(draws[1], 0.1, 0.5);
        io->stribeck_excess_Nm = known ? amount * between(draws[0], 0.015, 0.05) : 0.0;
        break;
    case truth_kind_asymmetric_friction:
        io->asymmetry_ratio = known ? sign_of(draws[1]) * fmin(0.9, amount * between(draws[0], 0.15, 0.35)) : 0.0;
        break;
    default: // friction_drift
        io->friction_drift_ratio = known ? fmax(-0.7, sign_of(draws[1]) * amount * between(draws[0], 0.15, 0.4)) : 0.0;
        io->friction_drift_s = between(draws[2], 3.0, 12.0);
        break;
    }
}

static void apply_presliding(const struct truth_hidden *hidden, const struct truth_setting *setting, int known,
                             struct truth_drive *io_drive)
{
    (void)setting;
    struct truth_plant_spec *io = &io_drive->plant;
    const double *draws = hidden->draws;
    int damped = draws[0] >= 0.5 && draws[0] < 0.75;
    io->presliding_distance_rad = known ? hidden->amount * 2e-3 : 0.0;
    io->bristle = draws[0] < 0.5 ? truth_bristle_dahl : damped ? truth_bristle_lugre : truth_bristle_elastoplastic;
    io->bristle_elastic_share = between(draws[1], 0.3, 0.7);
    io->bristle_damping_s = damped ? between(draws[1], 0.2e-3, 1e-3) : 0.0;
}

static void apply_inertia(const struct truth_hidden *hidden, const struct truth_setting *setting, int known,
                          struct truth_drive *io_drive)
{
    (void)setting;
    double factor = 1.0 + hidden->amount;
    if (!known) {
        io_drive->plant.load_inertia_kgm2 *= hidden->draws[0] < 0.5 ? factor : 1.0 / factor;
    }
}

static void apply_belt(const struct truth_hidden *hidden, const struct truth_setting *setting, int known,
                       struct truth_drive *io_drive)
{
    struct truth_plant_spec *io = &io_drive->plant;
    double amount = hidden->amount;
    const double *draws = hidden->draws;
    switch (hidden->kind) {
    case truth_kind_belt_elasticity:
        io->belt_stiffness_Nm_per_rad /= amount;
        io->belt_damping_Nms_per_rad /= sqrt(amount);
        if (!known) {
            io->two_mass = 0;
            io->belt_stiffness_Nm_per_rad = io->belt_damping_Nms_per_rad = 0.0;
        }
        break;
    case truth_kind_second_mode: {
        double w = two_pi * between(draws[0], 25.0, 110.0),
               inertia = known ? amount * 0.2 * io->load_inertia_kgm2 : 0.0;
        io->third_inertia_kgm2 = inertia;
        io->third_stiffness_Nm_per_rad = inertia * w * w;
        io->third_damping_Nms_per_rad = 2.0 * between(draws[1], 0.01, 0.06) * inertia * w;
        break;
    }
    case truth_kind_position_dependent_stiffness: {
        // The whole change over the travel, never so much that the belt goes slack at an end.
        double farthest = fabs(setting->centre_rad) + 0.5 * setting->range_rad;
        double slope = fmin(amount * between(draws[0], 0.02, 0.06), 0.8 / farthest);
        io->stiffness_slope_per_rad = known ? sign_of(draws[1]) * slope : 0.0;
        break;
    }
    case truth_kind_hardening_stiffness:
        io->stiffness_cubic_per_rad2 = known ? amount * 0.1 / pow(setting->twist_rms_rad, 2.0) : 0.0;
        break;
    default: // backlash
        io->gap_rad = known ? amount * 0.5 * setting->twist_rms_rad : 0.0;
        break;
    }
}

static void apply_torque(const struct truth_hidden *hidden, const struct truth_setting *setting, int known,
                         struct truth_drive *io_drive)
{
    struct truth_plant_spec *io = &io_drive->plant;
    double amount = hidden->amount;
    const double *draws = hidden->draws;
    switch (hidden->kind) {
    case truth_kind_load_bias:
        io->bias_Nm = known ? sign_of(draws[1]) * amount * between(draws[0], 0.03, 0.08) : 0.0;
        break;
    case truth_kind_cogging: {
        double fewest = fewest_periods(setting);
        io->cogging_periods_per_rev = floor(between(draws[0], fewest, fmax(fewest, most_periods) + 0.999));
        io->cogging_phase_rad = two_pi * draws[1];
        io->cogging_amplitude_Nm = known ? amount * 0.03 : 0.0;
        break;
    }
    case truth_kind_torque_lag:
        io->torque_lag_s *= known ? 1.0 : sign_of(draws[0]) > 0.0 ? 1.0 + amount : 1.0 / (1.0 + amount);
        break;
    case truth_kind_dead_time:
        io->dead_time_s += known ? amount * 1e-3 : 0.0;
        break;
    case truth_kind_torque_saturation:
        io->torque_limit_Nm = known ? setting->torque_peak_Nm / (1.0 + 0.4 * amount) : 0.0;
        break;
    default: { // periodic_disturbance, between two lines
        double line = (double)TRUTH_RATE_HZ / TRUTH_PERIOD_SAMPLES;
        io->disturbance_hz = line * (floor(between(draws[0], 4.0, 160.0)) + between(draws[1], 0.2, 0.8));
        io->disturbance_phase_rad = two_pi * draws[2];
        io->disturbance_amplitude_Nm = known ? amount * 0.02 : 0.0;
        break;
    }
    }
}

static void apply_sensor(const struct truth_hidden *hidden, const struct truth_setting *setting, int known,
                         struct truth_drive *io_drive)
{
    (void)setting;
    struct truth_sensors *io = &io_drive->sensors;
    if (hidden->kind == truth_kind_encoder_eccentricity) {
        io->eccentricity_rad = known ? hidden->amount * 2e-3 : 0.0;
        io->eccentricity_phase_rad = two_pi * hidden->draws[0];
        io->speed_from_encoder = hidden->draws[1] < 0.5;
    } else if (hidden->kind == truth_kind_lost_samples) {
        io->lost_share = known ? hidden->amount * 0.01 : 0.0;
    } else {
        io->filter_s = known ? hidden->amount * 1e-3 : 0.0;
    }
}

// Friction and torque that no catalogue has.
static void apply_unknown_friction(const struct truth_hidden *hidden, const struct truth_setting *setting, int known,
                                   struct truth_drive *io_drive)
{
    struct truth_plant_spec *io = &io_drive->plant;
    double wanted = hidden->amount * 0.05 * setting->torque_rms_Nm;
    const double *draws = hidden->draws;
    if (hidden->kind == truth_kind_quadratic_drag) {
        io->quadratic_drag_Nms2_per_rad2 = known ? wanted / setting->square_speed_rms : 0.0;
    } else if (hidden->kind == truth_kind_position_friction) {
        double at_ends = fmin(0.9, hidden->amount * between(draws[0], 0.4, 0.8));
        io->coulomb_friction_Nm = fmax(io->coulomb_friction_Nm, 0.04);
        io->coulomb_slope_per_rad = known ? sign_of(draws[1]) * at_ends / (0.5 * setting->range_rad) : 0.0;
    } else if (hidden->kind == truth_kind_load_friction) {
        double share = fmin(0.95, 0.3 * hidden->amount), whole = 2.0 * io->coulomb_friction_Nm;
        io->coulomb_friction_Nm = known ? whole * (1.0 - share) : whole;
        io->load_coulomb_Nm = known ? whole * share : 0.0;
    } else if (hidden->kind == truth_kind_torque_friction) {
        io->friction_per_torque = known ? fmin(0.4, wanted / setting->torque_rms_Nm) : 0.0;
    } else { // ground_spring
        io->ground_stiffness_Nm_per_rad = known ? wanted / setting->away_rms_rad : 0.0;
    }
}

static void apply_unknown_torque(const struct truth_hidden *hidden, const struct truth_setting *setting, int known,
                                 struct truth_drive *io_drive)
{
    struct truth_plant_spec *io = &io_drive->plant;
    double amount = known ? hidden->amount : 0.0, wanted = amount * 0.05 * setting->torque_rms_Nm;
    const double *draws = hidden->draws;
    switch (hidden->kind) {
    case truth_kind_torque_constant:
        // T (1 - c T^2) must still grow at the peak, with room for what the loop adds.
        io->torque_saturation_per_Nm2 =
            fmin(wanted / setting->cube_torque_rms, 0.15 / pow(setting->torque_peak_Nm, 2.0));
        break;
    case truth_kind_torque_constant_drift:
        io->torque_drift_ratio = -fmin(0.4, 0.08 * amount);
        io->torque_drift_s = between(draws[0], 4.0, 12.0);
        break;
    case truth_kind_bias_step:
        io->step_bias_Nm = sign_of(draws[0]) * wanted;
        io->step_bias_s = setting->duration_s * between(draws[1], 0.35, 0.75);
        break;
    case truth_kind_bursts:
        io->burst_amplitude_Nm = 2.0 * wanted;
        io->burst_hz = between(draws[0], 5.0, 80.0);
        io->burst_length_s = fmax(0.15, 3.0 / io->burst_hz);
        io->burst_every_s = between(draws[1], 1.0, 4.0);
        break;
    case truth_kind_torque_dead_band:
        io->torque_dead_band_Nm = wanted;
        break;
    default: // torque_rate: of the steepest slope of a signal that is flat to 100 Hz, with a crest of 3
        io->torque_rate_Nm_per_s =
            known ? 3.0 * setting->torque_rms_Nm * two_pi * 100.0 / sqrt(3.0) / (1.0 + 0.5 * hidden->amount) : 0.0;
        break;
    }
}

void truth_kind_apply(const struct truth_hidden *hidden, const struct truth_setting *setting, int known,
                      struct truth_drive *io_drive)
{
    static void (*const appliers[truth_kind_count])(const struct truth_hidden *, const struct truth_setting *, int,
                                                    struct truth_drive *) = {
        [truth_kind_viscous_friction] = apply_friction,
        [truth_kind_coulomb_friction] = apply_friction,
        [truth_kind_stribeck_friction] = apply_friction,
        [truth_kind_asymmetric_friction] = apply_friction,
        [truth_kind_friction_drift] = apply_friction,
        [truth_kind_presliding] = apply_presliding,
        [truth_kind_inertia] = apply_inertia,
        [truth_kind_belt_elasticity] = apply_belt,
        [truth_kind_second_mode] = apply_belt,
        [truth_kind_position_dependent_stiffness] = apply_belt,
        [truth_kind_hardening_stiffness] = apply_belt,
        [truth_kind_backlash] = apply_belt,
        [truth_kind_load_bias] = apply_torque,
        [truth_kind_cogging] = apply_torque,
        [truth_kind_torque_lag] = apply_torque,
        [truth_kind_dead_time] = apply_torque,
        [truth_kind_torque_saturation] = apply_torque,
        [truth_kind_periodic_disturbance] = apply_torque,
        [truth_kind_encoder_eccentricity] = apply_sensor,
        [truth_kind_lost_samples] = apply_sensor,
        [truth_kind_sensor_filter] = apply_sensor,
        [truth_kind_quadratic_drag] = apply_unknown_friction,
        [truth_kind_position_friction] = apply_unknown_friction,
        [truth_kind_load_friction] = apply_unknown_friction,
        [truth_kind_torque_friction] = apply_unknown_friction,
        [truth_kind_ground_spring] = apply_unknown_friction,
        [truth_kind_torque_constant] = apply_unknown_torque,
        [truth_kind_torque_constant_drift] = apply_unknown_torque,
        [truth_kind_bias_step] = apply_unknown_torque,
        [truth_kind_bursts] = apply_unknown_torque,
        [truth_kind_torque_dead_band] = apply_unknown_torque,
        [truth_kind_torque_rate] = apply_unknown_torque,
    };
    if (appliers[hidden->kind]) {
        appliers[hidden->kind](hidden, setting, known, io_drive);
    }
}

static double moved(double from, double to, double ratio)
{
    return from + fmax(-ratio * from, fmin(ratio * from, to - from));
}

void truth_kind_refit(enum truth_kind kind, const struct truth_plant_spec *truth, const struct truth_plant_spec *given,
                      struct truth_plant_spec *io_plant)
{
    const double usual = TRUTH_REFIT_SHARE, of_load = 0.05, of_belt = 0.08;
    if (kind == truth_kind_viscous_friction) {
        io_plant->viscous_friction_Nms_per_rad =
            moved(given->viscous_friction_Nms_per_rad, truth->viscous_friction_Nms_per_rad, usual);
    } else if (kind == truth_kind_coulomb_friction) {
        io_plant->coulomb_friction_Nm = moved(given->coulomb_friction_Nm, truth->coulomb_friction_Nm, usual);
    } else if (kind == truth_kind_inertia) {
        io_plant->load_inertia_kgm2 = moved(given->load_inertia_kgm2, truth->load_inertia_kgm2, of_load);
    } else if (kind == truth_kind_torque_lag) {
        io_plant->torque_lag_s = moved(given->torque_lag_s, truth->torque_lag_s, usual);
        io_plant->dead_time_s = given->dead_time_s;
    } else if (kind == truth_kind_dead_time) {
        io_plant->dead_time_s = moved(given->dead_time_s, truth->dead_time_s, usual);
        io_plant->torque_lag_s = given->torque_lag_s;
    } else if (kind == truth_kind_position_dependent_stiffness) { // about its middle, where the belt may be off anyhow
        double there = 1.0 + truth->stiffness_slope_per_rad * truth->coulomb_origin_rad;
        io_plant->belt_stiffness_Nm_per_rad =
            moved(given->belt_stiffness_Nm_per_rad, there * truth->belt_stiffness_Nm_per_rad, of_belt);
    }
}

int truth_kind_parameters(enum truth_kind kind, const struct truth_drive *drive, struct truth_parameter *out)
{
    const struct truth_plant_spec *plant = &drive->plant;
    // Laws of presliding differ in how they bend; the elasto-plastic one reaches its force in a shorter distance.
    double slack = plant->bristle == truth_bristle_dahl ? 0.0 : plant->bristle == truth_bristle_lugre ? 0.2 : 0.6;
    double ratio =
        plant->third_inertia_kgm2 > 0.0 ? plant->third_stiffness_Nm_per_rad / plant->third_inertia_kgm2 : 0.0;
    // How many rows are lost is chance, with 2.5 at a time in 14 s or more.
    double lost_slack = fmin(1.0, 3.0 * sqrt(2.5 / (14.0 * TRUTH_RATE_HZ * fmax(1e-9, drive->sensors.lost_share))));
    const struct truth_parameter all[truth_kind_count][TRUTH_PARAMETERS_MAX] = {
        [truth_kind_viscous_friction] = {{"viscous_friction_Nms_per_rad", plant->viscous_friction_Nms_per_rad, 0.0, 0}},
        [truth_kind_coulomb_friction] = {{"coulomb_friction_Nm", plant->coulomb_friction_Nm, 0.0, 0}},
        [truth_kind_stribeck_friction] = {{"stribeck_excess_Nm", plant->stribeck_excess_Nm, 0.0, 0},
                                          {"stribeck_velocity_rad_per_s", plant->stribeck_velocity_rad_per_s, 0.0, 0}},
        [truth_kind_asymmetric_friction] = {{"asymmetry_ratio", plant->asymmetry_ratio, 0.0, 0}},
        [truth_kind_load_bias] = {{"bias_Nm", plant->bias_Nm, 0.0, 1}},
        [truth_kind_inertia] = {{"load_inertia_kgm2", plant->load_inertia_kgm2, 0.0, 0}},
        [truth_kind_belt_elasticity] = {{"belt_stiffness_Nm_per_rad", plant->belt_stiffness_Nm_per_rad, 0.0, 0}},
        [truth_kind_cogging] = {{"amplitude_Nm", plant->cogging_amplitude_Nm, 0.0, 1},
                                {"periods_per_rev", plant->cogging_periods_per_rev, 0.0, 0}},
        [truth_kind_torque_lag] = {{"torque_lag_s", plant->torque_lag_s, 0.0, 0}},
        [truth_kind_dead_time] = {{"dead_time_s", plant->dead_time_s, 0.0, 0}},
        [truth_kind_presliding] = {{"presliding_distance_rad", plant->presliding_distance_rad, slack, 0}},
        [truth_kind_second_mode] = {{"mode_frequency_hz", sqrt(ratio) / two_pi, 0.0, 0},
                                    {"mode_inertia_kgm2", plant->third_inertia_kgm2, 0.0, 0}},
        [truth_kind_position_dependent_stiffness] = {{"stiffness_slope_per_rad", plant->stiffness_slope_per_rad, 0.0,
                                                      0}},
        [truth_kind_hardening_stiffness] = {{"cubic_ratio_per_rad2", plant->stiffness_cubic_per_rad2, 0.0, 0}},
        [truth_kind_backlash] = {{"gap_rad", plant->gap_rad, 0.0, 0}},
        [truth_kind_encoder_eccentricity] = {{"amplitude_rad", drive->sensors.eccentricity_rad, 0.0, 1}},
        [truth_kind_torque_saturation] = {{"torque_limit_Nm", plant->torque_limit_Nm, 0.0, 0}},
        [truth_kind_periodic_disturbance] = {{"amplitude_Nm", plant->disturbance_amplitude_Nm, 0.0, 1},
                                             {"frequency_hz", plant->disturbance_hz, 0.0, 0}},
        [truth_kind_friction_drift] = {{"time_constant_s", plant->friction_drift_s, 0.0, 0},
                                       {"drift_ratio", plant->friction_drift_ratio, 0.0, 0}},
        [truth_kind_lost_samples] = {{"share", drive->sensors.lost_share, lost_slack, 0}},
        [truth_kind_quadratic_drag] = {{"quadratic_drag_Nms2_per_rad2", plant->quadratic_drag_Nms2_per_rad2, 0.0, 0}},
        [truth_kind_position_friction] = {{"coulomb_slope_per_rad", plant->coulomb_slope_per_rad, 0.0, 0},
                                          {"coulomb_origin_rad", plant->coulomb_origin_rad, 0.0, 0}},
        [truth_kind_torque_constant] = {{"torque_saturation_per_Nm2", plant->torque_saturation_per_Nm2, 0.0, 0}},
        [truth_kind_torque_constant_drift] = {{"torque_drift_ratio", plant->torque_drift_ratio, 0.0, 0},
                                              {"torque_drift_s", plant->torque_drift_s, 0.0, 0}},
        [truth_kind_load_friction] = {{"load_coulomb_Nm", plant->load_coulomb_Nm, 0.0, 0}},
        [truth_kind_torque_friction] = {{"friction_per_torque", plant->friction_per_torque, 0.0, 0}},
        [truth_kind_bias_step] = {{"step_bias_Nm", plant->step_bias_Nm, 0.0, 0},
                                  {"step_bias_s", plant->step_bias_s, 0.0, 0}},
        [truth_kind_bursts] = {{"burst_amplitude_Nm", plant->burst_amplitude_Nm, 0.0, 0},
                               {"burst_hz", plant->burst_hz, 0.0, 0}},
        [truth_kind_torque_dead_band] = {{"torque_dead_band_Nm", plant->torque_dead_band_Nm, 0.0, 0}},
        [truth_kind_torque_rate] = {{"torque_rate_Nm_per_s", plant->torque_rate_Nm_per_s, 0.0, 0}},
        [truth_kind_ground_spring] = {{"ground_stiffness_Nm_per_rad", plant->ground_stiffness_Nm_per_rad, 0.0, 0}},
        [truth_kind_sensor_filter] = {{"filter_s", drive->sensors.filter_s, 0.0, 0}},
    };
    int count = 0;
    while (count < TRUTH_PARAMETERS_MAX && all[kind][count].name) {
        out[count] = all[kind][count];
        count++;
    }
    return count;
}

static int set_plant(enum truth_kind kind, const char *name, double value, struct truth_plant_spec *io)
{
    const struct {
        enum truth_kind kind;
        const char *name;
        double *field;
    } known[] = {
        {truth_kind_viscous_friction, "viscous_friction_Nms_per_rad", &io->viscous_friction_Nms_per_rad},
        {truth_kind_coulomb_friction, "coulomb_friction_Nm", &io->coulomb_friction_Nm},
        {truth_kind_stribeck_friction, "stribeck_excess_Nm", &io->stribeck_excess_Nm},
        {truth_kind_stribeck_friction, "stribeck_velocity_rad_per_s", &io->stribeck_velocity_rad_per_s},
        {truth_kind_asymmetric_friction, "asymmetry_ratio", &io->asymmetry_ratio},
        {truth_kind_presliding, "presliding_distance_rad", &io->presliding_distance_rad},
        {truth_kind_friction_drift, "drift_ratio", &io->friction_drift_ratio},
        {truth_kind_friction_drift, "time_constant_s", &io->friction_drift_s},
        {truth_kind_load_bias, "bias_Nm", &io->bias_Nm},
        {truth_kind_inertia, "load_inertia_kgm2", &io->load_inertia_kgm2},
        {truth_kind_position_dependent_stiffness, "stiffness_slope_per_rad", &io->stiffness_slope_per_rad},
        {truth_kind_hardening_stiffness, "cubic_ratio_per_rad2", &io->stiffness_cubic_per_rad2},
        {truth_kind_backlash, "gap_rad", &io->gap_rad},
        {truth_kind_torque_lag, "torque_lag_s", &io->torque_lag_s},
        {truth_kind_dead_time, "dead_time_s", &io->dead_time_s},
        {truth_kind_torque_saturation, "torque_limit_Nm", &io->torque_limit_Nm},
        {truth_kind_cogging, "amplitude_Nm", &io->cogging_amplitude_Nm},
        {truth_kind_cogging, "periods_per_rev", &io->cogging_periods_per_rev},
        {truth_kind_cogging, "phase_rad", &io->cogging_phase_rad},
        {truth_kind_periodic_disturbance, "amplitude_Nm", &io->disturbance_amplitude_Nm},
        {truth_kind_periodic_disturbance, "frequency_hz", &io->disturbance_hz},
    };
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++) {
        if (known[i].kind == kind && strcmp(known[i].name, name) == 0) {
            // Diagnosis counts what opposes the motor, this plant what pushes it.
            int pushes = known[i].field == &io->bias_Nm || known[i].field == &io->cogging_amplitude_Nm;
            *known[i].field = pushes ? -value : value;
            return 0;
        }
    }
    return -1;
}

// Third mass, its spring and its damper by frequency, inertia and damping ratio, in any order.
static int set_mode(const char *name, double value, struct truth_plant_spec *io)
{
    if (io->third_inertia_kgm2 == 0.0) {
        io->third_inertia_kgm2 = io->third_stiffness_Nm_per_rad = 1.0;
        io->third_damping_Nms_per_rad = 0.0;
    }
    double w = sqrt(io->third_stiffness_Nm_per_rad / io->third_inertia_kgm2);
    double ratio = io->third_damping_Nms_per_rad / (2.0 * io->third_inertia_kgm2 * w);
    if (strcmp(name, "mode_frequency_hz") == 0) {
        w = two_pi * value;
    } else if (strcmp(name, "mode_inertia_kgm2") == 0) {
        io->third_inertia_kgm2 = value;
    } else if (strcmp(name, "mode_damping_ratio") == 0) {
        ratio = value;
    } else {
        return -1;
    }
    io->third_stiffness_Nm_per_rad = io->third_inertia_kgm2 * w * w;
    io->third_damping_Nms_per_rad = 2.0 * ratio * io->third_inertia_kgm2 * w;
    return 0;
}

static int set_sensor(enum truth_kind kind, const char *name, double value, struct truth_sensors *io)
{
    if (kind == truth_kind_lost_samples && strcmp(name, "share") == 0) {
        io->lost_share = value;
    } else if (kind != truth_kind_encoder_eccentricity) {
        return -1;
    } else if (strcmp(name, "amplitude_rad") == 0) {
        io->eccentricity_rad = value;
    } else if (strcmp(name, "phase_rad") == 0) {
        io->eccentricity_phase_rad = value;
    } else if (strcmp(name, "speed_error_ratio") == 0) {
        io->speed_from_encoder = value > 0.5;
    } else {
        return -1;
    }
    return 0;
}

int truth_kind_set(enum truth_kind kind, const char *name, double value, struct truth_drive *io_drive)
{
    struct truth_plant_spec *plant = &io_drive->plant;
    if (!set_plant(kind, name, value, plant) || !set_sensor(kind, name, value, &io_drive->sensors)) {
        return 0;
    }
    if (kind == truth_kind_second_mode) {
        return set_mode(name, value, plant);
    }
    if (kind == truth_kind_periodic_disturbance && strcmp(name, "phase_rad") == 0) {
        // Diagnosis has a cosine that opposes, this plant a sine that pushes.
        plant->disturbance_phase_rad = value - 0.25 * two_pi;
        return 0;
    }
    if (kind == truth_kind_belt_elasticity) {
        plant->two_mass = 1;
        double *field = strcmp(name, "belt_stiffness_Nm_per_rad") == 0 ? &plant->belt_stiffness_Nm_per_rad
                                                                       : &plant->belt_damping_Nms_per_rad;
        *field = value;
        return 0;
    }
    return -1;
}
