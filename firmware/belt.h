/* SPDX-License-Identifier: MIT */
/// A simulated belt drive in single precision: two masses on a belt, its sensors, and the cascade of position, speed
/// and torque control that plays a table's references. Every operation is rounded as IEEE 754 says, so that host and
/// target come to the same bits (compile with -ffp-contract=off).
#ifndef SERVOSCOPE_FIRMWARE_BELT_H
#define SERVOSCOPE_FIRMWARE_BELT_H

#include <stdint.h>

/// Counts of the sensors, per unit.
#define BELT_TORQUE_COUNTS_PER_NM          16384.0f
#define BELT_VELOCITY_COUNTS_PER_RAD_PER_S 8192.0f
#define BELT_POSITION_COUNTS_PER_RAD       166886.0f /* 2^20 a turn */
#define BELT_MOTOR_INERTIA_KGM2            0.002f
#define BELT_LOAD_INERTIA_KGM2             0.003f
#define BELT_STIFFNESS_NM_PER_RAD          600.0f
#define BELT_DAMPING_NMS_PER_RAD           0.4f
#define BELT_FRICTION_NMS_PER_RAD          0.02f
#define BELT_SAMPLE_S                      0.000125f
#define BELT_SUBSTEPS                      4u

struct belt {
    float motor_position_rad, motor_velocity_rad_per_s, load_position_rad, load_velocity_rad_per_s;
    float torque_Nm;   ///< that has acted since the last sample
    float integral_Nm; ///< of the speed controller
    uint32_t noise;    ///< state of the sensors' noise
};

struct belt_sample {
    int32_t position;         ///< encoder counts
    int16_t torque, velocity; ///< converter counts, limited to 16 bits
};

void belt_init(struct belt *self);

/// The sensors now; speed and torque carry noise of up to 2 counts.
struct belt_sample belt_measure(struct belt *self);

/// Torque that the cascade asks for, in Nm.
float belt_control(struct belt *self, const struct belt_sample *sample,
                   const float *reference_torque_velocity_position);

/// Moves on by one sample under a constant torque.
void belt_move(struct belt *self, float torque_Nm);

#endif
