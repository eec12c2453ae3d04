/* SPDX-License-Identifier: MIT */
/// Messages of ODrive's CAN Simple protocol: identifier = node << 5 | command, floats as IEEE 754, least significant
/// byte first, angles in revolutions. A remote frame of a Get command asks for its answer.
#ifndef SERVOSCOPE_DRIVERS_CAN_ODRIVE_MESSAGE_H
#define SERVOSCOPE_DRIVERS_CAN_ODRIVE_MESSAGE_H

#include "drivers/can/can_frame.h"

#include <stdbool.h>
#include <stdint.h>

enum { odrive_node_max = 62, odrive_heartbeat_ms = 100 };

enum odrive_command {
    odrive_heartbeat = 0x01,
    odrive_estop = 0x02,
    odrive_set_axis_state = 0x07,
    odrive_get_encoder_estimates = 0x09, ///< position rev, velocity rev/s
    odrive_set_controller_mode = 0x0B,   ///< control mode u32, input mode u32
    odrive_set_input_pos = 0x0C,         ///< rev float, velocity 0.001 rev/s int16, torque 0.001 Nm int16
    odrive_set_input_vel = 0x0D,         ///< rev/s, Nm
    odrive_set_input_torque = 0x0E,      ///< Nm
    odrive_set_limits = 0x0F,            ///< rev/s, A
    odrive_get_iq = 0x14,                ///< set-point A, measured A
    odrive_clear_errors = 0x18,
    odrive_get_torques = 0x1C, ///< target Nm, estimate Nm; firmware 0.6
};

enum odrive_axis_state { odrive_idle = 1, odrive_closed_loop = 8 };

enum odrive_control_mode { odrive_control_torque = 1, odrive_control_velocity = 2, odrive_control_position = 3 };

enum { odrive_input_passthrough = 1 };

/// Bits of the axis error (firmware 0.6).
enum odrive_error {
    odrive_error_missing_estimate = 0x00000008,
    odrive_error_velocity_limit = 0x00008000,
    odrive_error_watchdog = 0x01000000,
    odrive_error_estop = 0x02000000,
};

struct odrive_status {
    uint32_t error; ///< 0: none
    uint8_t state;  ///< enum odrive_axis_state and others
};

/// Two floats in eight bytes.
struct can_frame odrive_floats_frame(uint8_t node_id, enum odrive_command command, double first, double second);

/// One float in four bytes.
struct can_frame odrive_float_frame(uint8_t node_id, enum odrive_command command, double value);

/// Two whole numbers in eight bytes; with `length` 4 the first one alone, with 0 none.
struct can_frame odrive_words_frame(uint8_t node_id, enum odrive_command command, uint8_t length, uint32_t first,
                                    uint32_t second);

/// A request for an answer.
struct can_frame odrive_request_frame(uint8_t node_id, enum odrive_command command);

/// The position set-point with its feed-forwards; what does not fit in 16 bits is clipped, and true returned.
bool odrive_input_pos_frame(uint8_t node_id, double position_rev, double velocity_rev_per_s, double torque_Nm,
                            struct can_frame *out_frame);

/// Whether a frame is this command of this node, with data and of `length` bytes at least.
bool odrive_is(const struct can_frame *frame, uint8_t node_id, enum odrive_command command, uint8_t length);

/// Whether it is a request for this command's answer.
bool odrive_is_request(const struct can_frame *frame, uint8_t node_id, enum odrive_command command);

/// Reads the float at byte `at` (0 or 4).
double odrive_float_at(const struct can_frame *frame, uint8_t at);

/// Reads a heartbeat; false if the frame is none of this node.
bool odrive_heartbeat_parse(const struct can_frame *frame, uint8_t node_id, struct odrive_status *out_status);

struct can_frame odrive_heartbeat_frame(uint8_t node_id, const struct odrive_status *status);

/// What an error means, its lowest known bit.
const char *odrive_error_str(uint32_t error);

#endif
