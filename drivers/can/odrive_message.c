/* SPDX-License-Identifier: MIT */
#include "drivers/can/odrive_message.h"

#include <math.h>
#include <string.h>

static uint16_t identifier(uint8_t node_id, enum odrive_command command)
{
    return (uint16_t)((unsigned)node_id << 5 | (unsigned)command);
}

static void put_float(uint8_t *out_data, double value)
{
    float single = (float)value;
    uint32_t bits;
    memcpy(&bits, &single, sizeof bits);
    can_put(out_data, 4, bits);
}

struct can_frame odrive_floats_frame(uint8_t node_id, enum odrive_command command, double first, double second)
{
    struct can_frame frame = can_frame_make(identifier(node_id, command), 8);
    put_float(&frame.data[0], first);
    put_float(&frame.data[4], second);
    return frame;
}

struct can_frame odrive_float_frame(uint8_t node_id, enum odrive_command command, double value)
{
    struct can_frame frame = can_frame_make(identifier(node_id, command), 4);
    put_float(frame.data, value);
    return frame;
}

struct can_frame odrive_words_frame(uint8_t node_id, enum odrive_command command, uint8_t length, uint32_t first,
                                    uint32_t second)
{
    struct can_frame frame = can_frame_make(identifier(node_id, command), length);
    if (length >= 4)
        can_put(&frame.data[0], 4, first);
    if (length >= 8)
        can_put(&frame.data[4], 4, second);
    return frame;
}

struct can_frame odrive_request_frame(uint8_t node_id, enum odrive_command command)
{
    struct can_frame frame = can_frame_make(identifier(node_id, command), 0);
    frame.remote = true;
    return frame;
}

/// Thousandths in 16 bits.
static int16_t thousandths(double value, bool *io_clipped)
{
    double scaled = round(value * 1000.0);
    bool fits = scaled >= INT16_MIN && scaled <= INT16_MAX;
    *io_clipped = *io_clipped || !fits;
    return (int16_t)(fits ? scaled : scaled > 0.0 ? INT16_MAX : scaled < 0.0 ? INT16_MIN : 0.0);
}

bool odrive_input_pos_frame(uint8_t node_id, double position_rev, double velocity_rev_per_s, double torque_Nm,
                            struct can_frame *out_frame)
{
    bool clipped = false;
    *out_frame = can_frame_make(identifier(node_id, odrive_set_input_pos), 8);
    put_float(&out_frame->data[0], position_rev);
    can_put(&out_frame->data[4], 2, (uint16_t)thousandths(velocity_rev_per_s, &clipped));
    can_put(&out_frame->data[6], 2, (uint16_t)thousandths(torque_Nm, &clipped));
    return clipped;
}

bool odrive_is(const struct can_frame *frame, uint8_t node_id, enum odrive_command command, uint8_t length)
{
    return frame->id == identifier(node_id, command) && !frame->remote && frame->length >= length;
}

bool odrive_is_request(const struct can_frame *frame, uint8_t node_id, enum odrive_command command)
{
    return frame->id == identifier(node_id, command) && frame->remote;
}

double odrive_float_at(const struct can_frame *frame, uint8_t at)
{
    uint32_t bits = can_get(&frame->data[at], 4);
    float single;
    memcpy(&single, &bits, sizeof single);
    return single;
}

bool odrive_heartbeat_parse(const struct can_frame *frame, uint8_t node_id, struct odrive_status *out_status)
{
    if (!odrive_is(frame, node_id, odrive_heartbeat, 5))
        return false;
    *out_status = (struct odrive_status){.error = can_get(frame->data, 4), .state = frame->data[4]};
    return true;
}

struct can_frame odrive_heartbeat_frame(uint8_t node_id, const struct odrive_status *status)
{
    return odrive_words_frame(node_id, odrive_heartbeat, 8, status->error, status->state);
}

const char *odrive_error_str(uint32_t error)
{
    if (error == 0)
        return "no error";
    if (error & odrive_error_missing_estimate)
        return "no position estimate";
    if (error & odrive_error_velocity_limit)
        return "velocity limit violated";
    if (error & odrive_error_watchdog)
        return "no set-point within its watchdog time";
    if (error & odrive_error_estop)
        return "emergency stop requested";
    return "see the drive's manual";
}
