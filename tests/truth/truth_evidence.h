/* SPDX-License-Identifier: MIT */
#ifndef TRUTH_EVIDENCE_H
#define TRUTH_EVIDENCE_H

#include "tests/truth/truth_kind.h"

/// What a refit of the given model can move.
enum truth_refit {
    truth_refit_motor_inertia,
    truth_refit_load_inertia,
    truth_refit_viscous,
    truth_refit_coulomb,
    truth_refit_lag,
    truth_refit_dead_time,
    truth_refit_stiffness,
    truth_refit_damping,
    truth_refit_count
};

/// How the evidence that recordings hold for an effect is foretold, from two simulations without noise. The drive with
/// the effect plays the run; another one without it is set to that motion at every sampling instant and asked for the
/// next speed and for the torque. With d the torque that it lacks, a what its actuator is off, e_v and e_th what the
/// speed and angle columns are off from the motion, and Z the impedance of the drive, per sample and at frequency w:
///
///   mechanics    d + Z e,  e = (e_v / s_v^2 + (jw e_th) / (w s_th)^2) S,  1/S = 1/s_v^2 + 1/(w s_th)^2
///                noise     s_w^2 + |Z|^2 S
///   actuator     a         s_T^2
///   consistency  e_v - jw e_th   s_v^2 + (w s_th)^2
///
/// Evidence is half the sum of squares of all three over their noise, over the periods counted (all but the first) and
/// the lines up to TRUTH_EVIDENCE_LINES, after the part that the given model's own parameters can take up, linearly and
/// without limits, has been projected out, and the one that would stand in for the effect has been put where it takes
/// up most within its reach. It is the log-likelihood ratio that a detector reaches which knows the noise and the
/// effect: Neyman and Pearson's limit.
/// Lost rows are counted instead: a value repeated to the last digit is worth the logarithm of noise over resolution.
struct truth_evidence_setting {
    const struct truth_controller *controller;
    const struct truth_excitation *excitation;
    int periods;               ///< of the run, the transient one included
    uint64_t seed;             ///< of the run, for what happens at random times
    unsigned not_free;         ///< bits of truth_refit: values that the refit of the given model does not have
    int aperiodic;             ///< whether every period is looked at, or one stands for all
    int keep_basis;            ///< take what the refit can do from the call before; it depends little on the size
    enum truth_refit stand_in; ///< not free, but may move by `reach`, relative, either way
    double reach;              ///< 0: nothing stands in
};

enum { TRUTH_EVIDENCE_LINES = 300, TRUTH_EVIDENCE_VALUES = 6 * (TRUTH_EVIDENCE_LINES + 1) };

/// Whitened residuals of one mean period: evidence of two models that differ from the truth in different ways can be
/// compared by their angle.
struct truth_evidence {
    double nats;
    double share;                           ///< RMS of d and a over the torque's
    double residual[TRUTH_EVIDENCE_VALUES]; ///< of the mean period, projected
    int refits;                             ///< orthonormal directions of the refit
    double refit[truth_refit_count][TRUTH_EVIDENCE_VALUES];
    double made_of[truth_refit_count][truth_refit_count]; ///< [direction][which]: what a number's change has of it
    int which[truth_refit_count];                         ///< number that a direction is the first to be made of
    double move[truth_refit_count];                       ///< relative changes that the projection stands for
    double stand_in[TRUTH_EVIDENCE_VALUES]; ///< direction of what stands in, orthogonal to the others, of length one
    double stand_in_size;                   ///< its length before, for a relative change by one; 0: none
};

/// Evidence of `truth` over `other`, refitted. Returns 0, or -1 when the drive cannot be run.
int truth_evidence_find(const struct truth_drive *truth, const struct truth_drive *other,
                        const struct truth_evidence_setting *setting, struct truth_evidence *out);
/// Evidence of `truth` over `io_other`, whose numbers are refitted step by step, within what `believed` may be off by:
/// where a resonance moves by its own width, one projection says too much. Returns 0, or -1.
int truth_evidence_refit(const struct truth_drive *truth, const struct truth_plant_spec *believed,
                         struct truth_drive *io_other, const struct truth_evidence_setting *setting,
                         struct truth_evidence *out);
/// Evidence of lost rows.
double truth_evidence_of_loss_nats(const struct truth_sensors *sensors, double rows);
/// Cosine of the angle between two residuals.
double truth_evidence_likeness(const struct truth_evidence *a, const struct truth_evidence *b);

#endif
