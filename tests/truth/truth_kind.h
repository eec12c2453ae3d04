/* SPDX-License-Identifier: MIT */
#ifndef TRUTH_KIND_H
#define TRUTH_KIND_H

#include "tests/truth/truth_run.h"

/// What can be hidden. The kinds up to truth_kind_lost_samples are named like the cause they are; the others are in no
/// catalogue, and no catalogued cause equals them.
enum truth_kind {
    truth_kind_clean,
    truth_kind_viscous_friction,
    truth_kind_coulomb_friction,
    truth_kind_stribeck_friction,
    truth_kind_asymmetric_friction,
    truth_kind_load_bias,
    truth_kind_inertia,
    truth_kind_belt_elasticity,
    truth_kind_cogging,
    truth_kind_torque_lag,
    truth_kind_dead_time,
    truth_kind_presliding,
    truth_kind_second_mode,
    truth_kind_position_dependent_stiffness,
    truth_kind_hardening_stiffness,
    truth_kind_backlash,
    truth_kind_encoder_eccentricity,
    truth_kind_torque_saturation,
    truth_kind_periodic_disturbance,
    truth_kind_friction_drift,
    truth_kind_lost_samples,
    truth_kind_quadratic_drag,        ///< q v |v|
    truth_kind_position_friction,     ///< Coulomb friction that grows along the travel
    truth_kind_torque_constant,       ///< real torque = T (1 - c T^2), the torque column shows T
    truth_kind_torque_constant_drift, ///< real torque = T (1 + m (1 - exp(-t/Tm))): a magnet that warms up
    truth_kind_load_friction,         ///< of the Coulomb friction, a part is on the load
    truth_kind_torque_friction,       ///< a worm gear: friction that grows with the torque, p |T|
    truth_kind_bias_step,             ///< a constant torque that begins at some time: a belt that jumped
    truth_kind_bursts,                ///< a sinusoidal torque for a moment, now and then
    truth_kind_torque_dead_band,      ///< the actuator gives nothing below a torque, and that much less above
    truth_kind_torque_rate,           ///< the actuator's torque has a steepest slope
    truth_kind_ground_spring,         ///< torque in proportion to position: an energy chain
    truth_kind_sensor_filter,         ///< angle and speed pass a first-order lag, which neither torque does
    truth_kind_count
};

const char *truth_kind_name(enum truth_kind kind);
/// The kind of that name, or truth_kind_count.
enum truth_kind truth_kind_find(const char *name);
/// Whether the effect is one that the diagnosis can name.
int truth_kind_is_catalogued(enum truth_kind kind);
/// Whether it takes a drive of two masses.
int truth_kind_needs_belt(enum truth_kind kind);
/// Whether it takes travel over most of a turn.
int truth_kind_needs_stroke(enum truth_kind kind);
/// Whether it changes from one period to the next.
int truth_kind_is_aperiodic(enum truth_kind kind);
/// Whether two effects can be hidden together and still be told apart.
int truth_kind_goes_with(enum truth_kind a, enum truth_kind b);

enum { TRUTH_DRAWS = 6, TRUTH_PARAMETERS_MAX = 3 };

/// One effect of a case: `amount` says how much of it there is (about 1; the least and the most are
/// truth_kind_bounds), `draws`, uniform in 0..1, everything else about it.
struct truth_hidden {
    enum truth_kind kind;
    double amount;
    double draws[TRUTH_DRAWS];
};

/// A drive with its sensors.
struct truth_drive {
    struct truth_plant_spec plant;
    struct truth_sensors sensors;
};

/// What the sizes of effects go by: figures of the motion reference.
struct truth_setting {
    double range_rad, centre_rad, duration_s;
    double torque_rms_Nm, torque_peak_Nm; ///< of inertia times acceleration
    double twist_rms_rad;                 ///< of a belt, at the load's share of it
    double square_speed_rms, cube_torque_rms, away_rms_rad;
};

/// Amounts below `out_low` are no effect that anybody would want named; above `out_high` the drive would not run.
void truth_kind_bounds(enum truth_kind kind, double *out_low, double *out_high);
/// Whether the motion is enough for the effect to be told from others: cogging of at most 60 periods a turn needs two.
int truth_kind_has_room(enum truth_kind kind, const struct truth_setting *setting);
/// Change a drive that does not have the effect into one that does (known) or into what somebody who does not know of
/// it takes it for (not known).
void truth_kind_apply(const struct truth_hidden *hidden, const struct truth_setting *setting, int known,
                      struct truth_drive *io_drive);
#define TRUTH_REFIT_SHARE 0.10

/// Set the value that the effect gives to what comes nearest to that of `truth` of all that a refit of the `given`
/// model may (10 % about it, load inertia 5 %, belt 8 %), and with it what would stand in for it: lag for dead time and
/// the reverse.
void truth_kind_refit(enum truth_kind kind, const struct truth_plant_spec *truth, const struct truth_plant_spec *given,
                      struct truth_plant_spec *io_plant);

struct truth_parameter {
    const char *name;
    double value;
    double slack;  ///< relative error that is right whatever its deviation: where laws of one name differ
    int sign_free; ///< its sign is a matter of convention: compare sizes
};

/// What the effect's parameters are in a drive that has it; returns how many.
int truth_kind_parameters(enum truth_kind kind, const struct truth_drive *drive, struct truth_parameter *out);

/// Give the drive a parameter of a cause, by the name that diagnosis has for it. Returns 0, or -1 if there is none of
/// that name.
int truth_kind_set(enum truth_kind kind, const char *name, double value, struct truth_drive *io_drive);

#endif
