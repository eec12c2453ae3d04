/* SPDX-License-Identifier: MIT */
/// A black box beside the model: any smooth function of speed, of position, of position for each direction, and any
/// short linear filter. It names nothing; what it still finds in the residual is what the named causes do not explain.
#ifndef SERVOSCOPE_DIAGNOSE_BLACKBOX_H
#define SERVOSCOPE_DIAGNOSE_BLACKBOX_H

#include "lab/diagnose/fit.h"

/// Masks have one bit per group.
enum { blackbox_all = 15 };

enum blackbox_group {
    blackbox_speed,     ///< functions of speed, each direction on its own
    blackbox_position,  ///< functions of position
    blackbox_direction, ///< functions of position that change sign with the direction of motion
    blackbox_filter,    ///< linear in torque and motion of the last samples, and the torque's cube
    blackbox_groups,
};

struct blackbox {
    size_t columns;
    size_t group_begin[blackbox_groups + 1]; ///< columns of a group lie together
    double *matrix;                          ///< whitened: data->values x columns
};

/// Builds the whitened regressors on all runs. Errors: false if memory is short.
bool blackbox_init(struct blackbox *self, const struct fit_data *data);
void blackbox_free(struct blackbox *self);

/// Gain in nats of letting the groups in `mask` (bit per group) and the hypothesis' own parameters move, over the fit
/// as it is. out_cost: the cost that is left; out_left: the whitened residual that is left, data->values; NULL: not
/// wanted.
/// Errors: 0 and the old cost if memory is short.
double blackbox_gain(const struct blackbox *self, const struct fit_data *data, const struct hypothesis *hypothesis,
                     const struct fit *fit, unsigned mask, double *out_cost, double *out_left);

/// What is left of unseen residuals when the black box has learned on others: RMS, to be held against that before.
/// residual: data->values, what the fit leaves; io_unseen: unseen->values, what its model leaves of runs that it was
/// not fitted to, and then what the black box leaves of that. Knots divide the range of the first run of `data`; beyond
/// it nothing was learned.
/// Errors: NaN if memory is short
double blackbox_ceiling(const struct fit_data *data, const double *residual, const struct fit_data *unseen,
                        double *io_unseen);

const char *blackbox_group_name(enum blackbox_group group);

#endif
