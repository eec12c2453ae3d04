/* SPDX-License-Identifier: MIT */
#include "firmware/belt.h"

#define POSITION_GAIN_PER_S       40.0f
#define VELOCITY_GAIN_NMS_PER_RAD 0.3f
#define INTEGRAL_GAIN_NM_PER_RAD  10.0f
#define INTEGRAL_LIMIT_NM         1.0f

void belt_init(struct belt *self)
{
    const struct belt at_rest = {.noise = 1u};
    *self = at_rest;
}

static int32_t noise_counts(struct belt *self)
{
    self->noise = self->noise * 1664525u + 1013904223u;
    return (int32_t)(self->noise >> 16) % 5 - 2;
}

static int32_t round_down(float value)
{
    int32_t truncated = (int32_t)value;
    return (float)truncated > value ? truncated - 1 : truncated;
}

static int16_t convert(float value, int32_t noise)
{
    int32_t counts = round_down(value + 0.5f) + noise;
    return (int16_t)(counts > INT16_MAX ? INT16_MAX : counts < INT16_MIN ? INT16_MIN : counts);
}

struct belt_sample belt_measure(struct belt *self)
{
    struct belt_sample sample;
    sample.position = round_down(self->motor_position_rad * BELT_POSITION_COUNTS_PER_RAD);
    sample.torque = convert(self->torque_Nm * BELT_TORQUE_COUNTS_PER_NM, noise_counts(self));
    sample.velocity = convert(self->motor_velocity_rad_per_s * BELT_VELOCITY_COUNTS_PER_RAD_PER_S, noise_counts(self));
    return sample;
}

float belt_control(struct belt *self, const struct belt_sample *sample, const float *reference_torque_velocity_position)
{
    const float *reference = reference_torque_velocity_position;
    float position_rad = (float)sample->position * (1.0f / BELT_POSITION_COUNTS_PER_RAD);
    float velocity = (float)sample->velocity * (1.0f / BELT_VELOCITY_COUNTS_PER_RAD_PER_S);
    float command = reference[1] + POSITION_GAIN_PER_S * (reference[2] - position_rad);
    float error = command - velocity;
    float integral = self->integral_Nm + INTEGRAL_GAIN_NM_PER_RAD * BELT_SAMPLE_S * error;
    self->integral_Nm = integral > INTEGRAL_LIMIT_NM    ? INTEGRAL_LIMIT_NM
                        : integral < -INTEGRAL_LIMIT_NM ? -INTEGRAL_LIMIT_NM
                                                        : integral;
    return reference[0] + VELOCITY_GAIN_NMS_PER_RAD * error + self->integral_Nm;
}

void belt_move(struct belt *self, float torque_Nm)
{
    const float step_s = BELT_SAMPLE_S / (float)BELT_SUBSTEPS;
    for (uint32_t i = 0; i < BELT_SUBSTEPS; ++i) {
        float twist = self->motor_position_rad - self->load_position_rad;
        float twist_rate = self->motor_velocity_rad_per_s - self->load_velocity_rad_per_s;
        float belt_Nm = BELT_STIFFNESS_NM_PER_RAD * twist + BELT_DAMPING_NMS_PER_RAD * twist_rate;
        float motor_Nm = torque_Nm - belt_Nm - BELT_FRICTION_NMS_PER_RAD * self->motor_velocity_rad_per_s;
        float load_Nm = belt_Nm - BELT_FRICTION_NMS_PER_RAD * self->load_velocity_rad_per_s;
        self->motor_velocity_rad_per_s += step_s / BELT_MOTOR_INERTIA_KGM2 * motor_Nm;
        self->load_velocity_rad_per_s += step_s / BELT_LOAD_INERTIA_KGM2 * load_Nm;
        self->motor_position_rad += step_s * self->motor_velocity_rad_per_s;
        self->load_position_rad += step_s * self->load_velocity_rad_per_s;
    }
    self->torque_Nm = torque_Nm;
}
