/* SPDX-License-Identifier: MIT */
#include "lab/design/start_bank.h"

#include <math.h>

static const double two_pi = 6.283185307179586;

static const double load_shares[design_start_bank_load_shares] = {0.4, 0.7};

/// Viscous friction over total inertia. In open loop the speed that a wrong start leaves lasts as long as the drive
/// coasts, so one value for all would choose for that value alone.
static const double friction_per_s[] = {0.15, 0.5, 1.5, 5};
enum { frictions = sizeof friction_per_s / sizeof friction_per_s[0] };

static const double belt_damping_ratio = 0.03;

void design_start_bank_drive(const struct design_transient_table *table, size_t index, struct sim_model *out_drive)
{
    const double span = 14;
    const double top_hz = table->bins[table->line_count - 1] * table->rate_hz / (double)table->period_samples;
    const double highest_hz = fmin(top_hz, table->rate_hz / 4);
    const size_t row = index / design_start_bank_load_shares;
    const size_t column = index % design_start_bank_load_shares;
    const double position = (double)row / (design_start_bank_antiresonances - 1);
    const double omega = two_pi * highest_hz * pow(span, position - 1);
    sim_model_default(out_drive);
    const double inertia_ratio = table->inertia_kgm2 / out_drive->motor_inertia_kgm2;
    const double slowness = fmin(1, table->rate_hz / out_drive->sample_rate_hz);
    out_drive->structure = sim_structure_two_mass;
    out_drive->load_inertia_kgm2 = load_shares[column] * table->inertia_kgm2;
    out_drive->motor_inertia_kgm2 = (1 - load_shares[column]) * table->inertia_kgm2;
    out_drive->belt_stiffness_Nm_per_rad = omega * omega * out_drive->load_inertia_kgm2;
    out_drive->belt_damping_Nms_per_rad = 2 * belt_damping_ratio * omega * out_drive->load_inertia_kgm2;
    out_drive->viscous_friction_Nms_per_rad = friction_per_s[(row + column) % frictions] * table->inertia_kgm2;
    out_drive->sample_rate_hz = table->rate_hz;
    out_drive->controller.position_gain_per_s *= slowness;
    out_drive->controller.velocity_gain_Nms_per_rad *= slowness * inertia_ratio;
    out_drive->controller.velocity_integral_time_s /= slowness;
}
