/* SPDX-License-Identifier: MIT */
/// An effect: one physical cause by which a drive differs from a simpler model of it. One file in sim/effects/ each,
/// with one object `sim_effect_NAME`; the build collects them. The plant calls the hooks of the effects that a model
/// has switched on; diagnosis reads the parameters' bounds and scan values. Nobody else knows an effect by name.
#ifndef SERVOSCOPE_SIM_EFFECT_H
#define SERVOSCOPE_SIM_EFFECT_H

#include <stdbool.h>
#include <stddef.h>

enum { sim_effect_parameters_max = 4, sim_effect_scan_max = 48, sim_effects_max = 24, sim_tones_max = 8 };

/// How the motor moves at one instant. Angles in rad, or positions in m on a linear axis.
struct sim_motion {
    double position;
    double velocity;
    double time_s;
    bool linear; ///< m and N instead of rad and Nm
    double
        radius; ///< position per rad of the motor's shaft: 1, on a linear axis the pulley's. Only `sense` is given it
};

/// What the motor has to overcome at one instant. Torques in Nm, or forces in N; positive ones oppose positive speed.
struct sim_opposing {
    double smooth;          ///< bias, cogging: a function of motion, no friction
    double viscous;         ///< friction that vanishes with speed
    double dry;             ///< friction magnitude that does not: Coulomb, Stribeck; >= 0
    double positive_factor; ///< on all friction for motion in each direction, 1 without asymmetry
    double negative_factor;
};

/// The belt between motor and load at one instant. Its torque on the load is stiffness * twist + damping * twist_rate.
struct sim_belt {
    double twist;      ///< motor minus load, rad or m, without what a gap takes of it
    double twist_rate; ///< 0 where the belt hangs loose
    double stiffness;  ///< Nm/rad or N/m at this instant
    double damping;    ///< Nm s/rad or N s/m
};

/// A further mass on its own spring and damper.
struct sim_attached_mass {
    double inertia;   ///< kg m2 or kg
    double stiffness; ///< Nm/rad or N/m
    double damping;   ///< Nm s/rad or N s/m
};

/// What the motor's sensors say.
struct sim_sensed {
    double position, velocity;
};

/// Columns of a recording as they were recorded. A column that it lacks is NULL.
struct sim_columns {
    size_t rows;
    double sample_rate_hz;
    const double *torque, *position, *velocity;
};

/// How diagnosis moves a parameter.
enum sim_parameter_kind {
    sim_parameter_linear,    ///< as it is, within its bounds
    sim_parameter_positive,  ///< on a logarithmic scale
    sim_parameter_amplitude, ///< with the following sim_parameter_phase: as cosine and sine parts
    sim_parameter_phase,
};

struct sim_parameter {
    const char *name;        ///< rotary, unit at the end: amplitude_Nm
    const char *linear_name; ///< the twin on a linear axis: amplitude_N
    enum sim_parameter_kind kind;
    double minimum, maximum; ///< physical bounds, rotary units
    double linear_minimum, linear_maximum;
    bool optional; ///< a model file may leave it out: then it is `usual`
    double usual;
    /// Not 0: it is 0 or 1 by how the drive is made, give or take this. Where the data say little of it, that counts.
    double near_whole;
    /// For effects that are parameters of the base model: offset of the double in struct sim_model; else SIZE_MAX.
    size_t model_offset;
};

/// Where an effect acts.
enum sim_place {
    sim_place_structure, ///< changes a number or the structure of the base model
    sim_place_friction,
    sim_place_friction_scale, ///< after all friction
    sim_place_motor,
    sim_place_actuator,
    sim_place_belt, ///< between motor and load: needs two masses
    sim_place_load,
    sim_place_sensor, ///< what is measured, not what moves
    sim_place_record, ///< rows of the recording
};

struct sim_model;

/// What a recording covered, for scan values and for whether an effect can show in it at all.
struct sim_coverage {
    double position_span; ///< largest minus smallest position, rad or m
    double velocity_rms, velocity_peak;
    double velocity_slow; ///< at most this fast it was for long enough to say something of it; 0: not known
    double torque_rms;    ///< Nm or N
    double torque_peak;
    double reference_peak; ///< of the torque asked for; 0: not recorded
    double position_mean;
    double steadiness;       ///< correlation of position with time, 0..1: 1 at constant speed
    double start_s;          ///< of what counts, since the run began
    double duration_s;       ///< from the run's beginning to the end of what counts
    double frequency_max_hz; ///< highest excited line
    size_t tone_count;
    double tones_hz[sim_tones_max]; ///< strongest lines of what the model leaves, between the excited ones
    bool linear;
};

/// What the sentences about an effect need to know.
struct sim_finding {
    const double *parameters; ///< estimated, in the order of the effect's parameters
    const double *deviations; ///< their standard deviations
    const double *nominal;    ///< the given model's values, zeros where it had none
    bool linear;
};

struct sim_effect {
    const char *id; ///< DESIGN.md, "Cause ids"
    enum sim_place place;
    size_t parameter_count;
    struct sim_parameter parameters[sim_effect_parameters_max];
    bool steady;  ///< `oppose` adds the same at every instant, except where the direction of motion changes
    bool in_time; ///< depends on the time since the run began, so that no two periods are alike
    /// As long as it is small, what it does is proportional to parameter number `size`.
    bool proportional;
    size_t size;

    // What the effect does; each hook is NULL where it does nothing.

    /// Adds what the effect contributes to the torque against the motor at one instant.
    void (*oppose)(const double *parameters, const struct sim_motion *motion, struct sim_opposing *io_opposing);
    /// Dry friction does not switch but builds up: what is missing of its level, over that level, falls per distance
    /// returned by its own power of the exponent. With 1 it comes within 1/e over that distance; below 1 there is an
    /// end to it.
    /// A damper beside the bristles adds out_damping_s times the rate at which that friction changes.
    double (*build_up)(const double *parameters, double *out_exponent, double *out_damping_s);
    /// Changes the belt at one instant. Called in the order of sim_effects, which is that of the names: backlash takes
    /// its part of the twist before a spring that hardens sees it.
    void (*bend)(const double *parameters, const struct sim_motion *motion, struct sim_belt *io_belt);
    /// Factor by which the effect changes a number of the base model (offset `along_offset`) at a position. A recording
    /// that stays near one place knows the product there best.
    double (*along)(const double *parameters, double position);
    size_t along_offset;
    /// Gives the mass that hangs on the load (on the one body of a rigid drive). A model has room for one.
    void (*attach)(const double *parameters, struct sim_attached_mass *out_mass);
    /// Torque that the motor makes of what comes out of lag and dead time.
    double (*limit)(const double *parameters, double torque);
    /// Changes what the motor's sensors say of its motion.
    void (*sense)(const double *parameters, const struct sim_motion *motion, struct sim_sensed *io_sensed);
    /// Whether a row of the record repeats the one before, decided by a number that is uniform in (0, 1).
    bool (*lose)(const double *parameters, double uniform);
    /// Finds the effect in a recording exactly, without a likelihood: false if it is not there. Marks the rows that it
    /// spoils (rows values, all written) and says how far from chance that is, in nats.
    bool (*notice)(const struct sim_columns *columns, double *out_parameters, double *out_deviations,
                   double *out_evidence, bool *out_rows);

    /// Switches a structural effect on in a model whose structure lacks it; NULL if there is nothing to switch.
    void (*engage)(struct sim_model *model);
    /// Whether diagnosis may ask for the effect on top of this model at all; NULL: always.
    bool (*applies)(const struct sim_model *model);
    /// Starting values number `index` for a search, rotary or linear as the model; false past the last one.
    bool (*scan)(const struct sim_model *model, const struct sim_coverage *coverage, size_t index,
                 double *out_parameters);
    /// Whether a recording can show the effect with these parameters; if not, says why in one clause.
    bool (*testable)(const double *parameters, const struct sim_coverage *coverage, char *out_why, size_t size);
    /// NULL, or whether the effect with these parameters is how a drive is made anyway, where a model says it more
    /// simply: it moves with a fit, and belongs into a model, but is no cause to be named.
    bool (*detail)(const double *parameters, bool linear);
    /// NULL, or whether part of the effect's usual range cannot show in a recording; if so, says which and why in one
    /// clause.
    bool (*blind)(const struct sim_coverage *coverage, char *out_why, size_t size);
    /// The measurement that shows this effect apart from others: a clause after "measure".
    const char *measure;
    /// One sentence for the engineer, every number from the finding.
    void (*say)(const struct sim_finding *finding, char *out_text, size_t size);
};

/// All effects, NULL-terminated, made by the build.
extern const struct sim_effect *const sim_effects[];

/// Number of an effect in sim_effects, or -1.
int sim_effect_find(const char *id);

#endif
