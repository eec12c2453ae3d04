/* SPDX-License-Identifier: MIT */
/// CiA 402: the power state machine, its words, its objects and modes. Both halves, master and node, use it.
#ifndef SERVOSCOPE_DRIVERS_CAN_CIA402_H
#define SERVOSCOPE_DRIVERS_CAN_CIA402_H

#include <stdbool.h>
#include <stdint.h>

enum cia402_state {
    cia402_not_ready,
    cia402_switch_on_disabled,
    cia402_ready,
    cia402_switched_on,
    cia402_operation_enabled,
    cia402_quick_stop_active,
    cia402_fault_reaction_active,
    cia402_fault,
    cia402_state_count,
};

enum cia402_event {
    cia402_initialised,      ///< self-test done
    cia402_shutdown,         ///< control word xxxx x110
    cia402_switch_on,        ///< 0111; from operation enabled it is "disable operation"
    cia402_enable_operation, ///< 1111
    cia402_disable_voltage,  ///< xx0x
    cia402_quick_stop,       ///< x01x
    cia402_fault_reset,      ///< rising edge of bit 7
    cia402_fault_detected,
    cia402_fault_reaction_done,
    cia402_quick_stop_done, ///< standstill after a quick stop that ends in switch-on disabled
    cia402_event_count,
};

/// Control words as a master sends them.
enum cia402_control {
    cia402_control_disable_voltage = 0x0000,
    cia402_control_quick_stop = 0x0002,
    cia402_control_shutdown = 0x0006,
    cia402_control_switch_on = 0x0007,
    cia402_control_enable_operation = 0x000F,
    cia402_control_fault_reset = 0x0080,
    cia402_control_halt = 0x0100,
};

/// Status word bits besides the state's.
enum cia402_status {
    cia402_status_voltage = 0x0010,
    cia402_status_warning = 0x0080,
    cia402_status_remote = 0x0200,
    cia402_status_target_reached = 0x0400, ///< profile torque: the slope's end; halted or in quick stop: standstill
    cia402_status_limited = 0x0800,        ///< an internal limit acts
    cia402_status_follows = 0x1000,        ///< cyclic modes: the set-point of this SYNC is used
    cia402_status_following_error = 0x2000,
};

enum cia402_mode {
    cia402_mode_none = 0,
    cia402_mode_profile_torque = 4,
    cia402_mode_homing = 6, ///< not offered by the simulated drive: a known client homes by itself if it is
    cia402_mode_csp = 8,
    cia402_mode_csv = 9,
    cia402_mode_cst = 10,
};

/// Bit of a mode in object 6502.
#define CIA402_SUPPORTS(mode) (1u << ((mode)-1))

/// Device type of a servo drive (object 1000).
#define CIA402_SERVO_DRIVE 0x00020192u

enum cia402_object {
    cia402_abort_connection_option = 0x6007,
    cia402_error_code = 0x603F,
    cia402_control_word = 0x6040,
    cia402_status_word = 0x6041,
    cia402_quick_stop_option = 0x605A,
    cia402_shutdown_option = 0x605B,
    cia402_disable_operation_option = 0x605C,
    cia402_halt_option = 0x605D,
    cia402_fault_reaction_option = 0x605E,
    cia402_modes_of_operation = 0x6060,
    cia402_mode_display = 0x6061,
    cia402_position_actual = 0x6064,
    cia402_following_error_window = 0x6065,
    cia402_following_error_timeout = 0x6066,
    cia402_velocity_actual = 0x606C,
    cia402_target_torque = 0x6071,
    cia402_max_torque = 0x6072,
    cia402_torque_demand = 0x6074,
    cia402_rated_torque = 0x6076,
    cia402_torque_actual = 0x6077,
    cia402_target_position = 0x607A,
    cia402_position_limit = 0x607D,
    cia402_max_velocity = 0x607F,
    cia402_max_motor_speed = 0x6080,
    cia402_profile_deceleration = 0x6084,
    cia402_quick_stop_deceleration = 0x6085,
    cia402_torque_slope = 0x6087,
    cia402_encoder_resolution = 0x608F,
    cia402_unit_position = 0x60A8,
    cia402_unit_velocity = 0x60A9,
    cia402_unit_acceleration = 0x60AA,
    cia402_velocity_offset = 0x60B1,
    cia402_torque_offset = 0x60B2,
    cia402_interpolation_period = 0x60C2,
    cia402_following_error_actual = 0x60F4,
    cia402_target_velocity = 0x60FF,
    cia402_supported_modes = 0x6502,
};

/// State after an event; the same state if the event means nothing in it. Total: every pair is in one table.
/// Test: tests/unit/test_cia402.c (all pairs)
enum cia402_state cia402_state_after(enum cia402_state state, enum cia402_event event);

/// The command in a control word's bits 3..0; the fault reset of bit 7 is an edge and not seen here.
enum cia402_event cia402_control_decode(uint16_t control_word);

/// State bits of the status word (6, 5, 3..0).
uint16_t cia402_status_encode(enum cia402_state state);

/// Reads the state; false if the bits are none (then the frame or the drive is wrong).
bool cia402_status_decode(uint16_t status_word, enum cia402_state *out_state);

const char *cia402_state_str(enum cia402_state state);

/// What the motor has to do.
enum cia402_action {
    cia402_coast,            ///< no torque
    cia402_slow_down_ramp,   ///< to standstill with 6084, then hold
    cia402_quick_stop_ramp,  ///< to standstill with 6085, then hold
    cia402_follow_setpoints, ///< what the mode of operation says
};

/// Option codes, with the values used here; others are refused.
struct cia402_options {
    int16_t abort_connection;  ///< 6007: 0 nothing, 1 fault, 2 disable voltage, 3 quick stop
    int16_t quick_stop;        ///< 605A: 0 coast, 1 slow-down ramp, 2 quick-stop ramp; 5, 6: ramps, and stay
    int16_t shutdown;          ///< 605B: 0 coast, 1 slow-down ramp
    int16_t disable_operation; ///< 605C: 0 coast, 1 slow-down ramp
    int16_t halt;              ///< 605D: 1 slow-down ramp, 2 quick-stop ramp
    int16_t fault_reaction;    ///< 605E: 0 coast, 1 slow-down ramp, 2 quick-stop ramp
};

/// 6007 = 1, 605A = 2, 605B = 0, 605C = 1, 605D = 1, 605E = 2.
struct cia402_options cia402_options_default(void);

/// Whether an option object (6007, 605A .. 605E) may hold a value.
bool cia402_option_is_valid(uint16_t index, int64_t value);

/// A node's machine: state and what is needed to see edges and options.
struct cia402_machine {
    enum cia402_state state;
    uint16_t control_word;
    /// Operation enabled is left by this event when the motor stands still; cia402_initialised: it is not left.
    enum cia402_event leaving;
    struct cia402_options options;
};

void cia402_machine_init(struct cia402_machine *self);

/// Takes a control word, as often as it comes; true if it reset a fault.
bool cia402_machine_command(struct cia402_machine *self, uint16_t control_word);

/// Takes an event of the drive itself. A fault without torque, or with 605E = 0, needs no reaction and is one at once.
void cia402_machine_event(struct cia402_machine *self, enum cia402_event event);

/// A ramp has ended in standstill: goes on to where it led to. Nothing if none was on.
void cia402_machine_stood_still(struct cia402_machine *self);

/// Whether a ramp of cia402_machine_action() leads out of the present state.
bool cia402_machine_is_leaving(const struct cia402_machine *self);

enum cia402_action cia402_machine_action(const struct cia402_machine *self);

/// Whether the motor may carry torque.
bool cia402_machine_is_powered(const struct cia402_machine *self);

/// A sample period as object 60C2 says it: units x 10^exponent s, the smallest unit count. False if it cannot be said
/// in whole microseconds and 1..255 units.
bool cia402_period_encode(double period_s, uint8_t *out_units, int8_t *out_exponent);

/// The period in microseconds, 0 if out of range.
uint32_t cia402_period_us(uint8_t units, int8_t exponent);

#endif
