/* SPDX-License-Identifier: MIT */
/// An effect: one physical cause by which a drive differs from a simpler model of it. One file in sim/effects/ each,
/// with one object `sim_effect_NAME`; the build collects them. The plant calls the hooks of the effects that a model
/// has switched on; diagnosis reads the parameters' bounds and scan values. Nobody else knows an effect by name.
#ifndef SERVOSCOPE_SIM_EFFECT_H
#define SERVOSCOPE_SIM_EFFECT_H

#include <stdbool.h>
#include <stddef.h>

enum { sim_effect_parameters_max = 4, sim_effect_scan_max = 16, sim_effects_max = 24 };

/// How the motor moves at one instant. Angles in rad, or positions in m on a linear axis.
struct sim_motion {
    double position;
    double velocity;
    double time_s;
    bool linear; ///< m and N instead of rad and Nm
};

/// What the motor has to overcome at one instant. Torques in Nm, or forces in N; positive ones oppose positive speed.
struct sim_opposing {
    double smooth;          ///< bias, cogging: a function of motion, no friction
    double viscous;         ///< friction that vanishes with speed
    double dry;             ///< friction magnitude that does not: Coulomb, Stribeck; >= 0
    double positive_factor; ///< on all friction for motion in each direction, 1 without asymmetry
    double negative_factor;
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
};

struct sim_model;

/// What a recording covered, for scan values and for whether an effect can show in it at all.
struct sim_coverage {
    double position_span; ///< largest minus smallest position, rad or m
    double velocity_rms, velocity_peak;
    double torque_rms; ///< Nm or N
    double duration_s;
    double frequency_max_hz; ///< highest excited line
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
    /// Adds what the effect contributes at one instant; NULL for structural effects.
    void (*oppose)(const double *parameters, const struct sim_motion *motion, struct sim_opposing *io_opposing);
    /// Switches a structural effect on in a model whose structure lacks it; NULL if there is nothing to switch.
    void (*engage)(struct sim_model *model);
    /// Whether diagnosis may ask for the effect on top of this model at all; NULL: always.
    bool (*applies)(const struct sim_model *model);
    /// Starting values number `index` for a search, rotary or linear as the model; false past the last one.
    bool (*scan)(const struct sim_model *model, const struct sim_coverage *coverage, size_t index,
                 double *out_parameters);
    /// Whether a recording can show the effect with these parameters; if not, says why in one clause.
    bool (*testable)(const double *parameters, const struct sim_coverage *coverage, char *out_why, size_t size);
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
