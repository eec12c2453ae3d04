/* SPDX-License-Identifier: MIT */
/// The door to a CiA 402 servo drive on a CAN port: drivers/drive.h over SDO, SYNC and mapped PDOs.
/// One exchange is one SYNC cycle: the set-points go out as RPDOs, at the period's end SYNC follows, the TPDOs come
/// back.
///   RPDO1 6040 control word, 607A target position     (torque mode: 6040, 6071 target torque)
///   RPDO2 60B1 velocity offset, 60B2 torque offset    (torque mode: none)      [+ 2002:1, 2002:2]
///   TPDO1 6041 status word, 6064 position, 6077 torque
///   TPDO2 606C velocity, 6074 torque demand           [+ 2001:1, 2001:2]
/// in brackets where the drive has the end-to-end check of pdo_check.h: then one lost, late, repeated, mixed up or
/// altered frame (up to two bits) per cycle is always told from a good one, and 255 of 256 worse cases. A drive without
/// it is judged by arrival times and lengths alone.
/// Test: tests/api/test_can_drive.c, tests/fault/test_can_faults.c (every fault at every frame)
/// A sample is valid if its TPDOs came in time, belong to the SYNC of this exchange and say that the drive used the
/// set-point of this exchange (status word bit 12). Units: those of drive.h; of a linear drive m, m/s and N.
#ifndef SERVOSCOPE_DRIVERS_CAN_CIA402_MASTER_H
#define SERVOSCOPE_DRIVERS_CAN_CIA402_MASTER_H

#include "drivers/can/canopen_master.h"
#include "drivers/can/cia402.h"
#include "drivers/can/cia402_profile.h"
#include "drivers/can/cia402_scaling.h"
#include "drivers/drive.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct cia402_master_options {
    uint8_t node_id;          ///< 1..127
    uint8_t master_id;        ///< of our heartbeat, 1..127, not node_id
    uint32_t bitrate;         ///< of the bus, for the load and the time frames take
    uint32_t sdo_timeout_us;  ///< for one answer
    uint16_t heartbeat_ms;    ///< both ways; lost after three
    uint32_t arm_timeout_us;  ///< for the way to operation enabled
    uint32_t stop_timeout_us; ///< for the quick stop's ramp
    uint16_t lost_in_a_row;   ///< samples; one more ends the measurement
    uint32_t
        reply_patience_us; ///< waits this long for a sample, and lets the next SYNC slip; 0: only as long as SYNC keeps
    uint32_t sync_timeout_us;             ///< after which the drive misses a SYNC; 0: 1.5 periods
    const struct cia402_profile *profile; ///< NULL: by the drive's identity (1018)
};

/// Node 5, master 127, 1 Mbit/s, 50 ms, 100 ms, 2 s, 5 s, 5 samples.
struct cia402_master_options cia402_master_defaults(void);

/// Share of the bus that this door plans with at most; the rest is for heartbeats, EMCY and other nodes.
#define CIA402_BUS_LOAD_LIMIT 0.7

/// Bits on the wire of one cycle at worst (SYNC, RPDOs, TPDOs).
unsigned cia402_master_cycle_bits(enum drive_mode mode, bool checked);

/// Of these, the bits of the RPDOs.
unsigned cia402_master_target_bits(enum drive_mode mode, bool checked);

/// Values of one cycle in the drive's own units.
struct cia402_cycle {
    uint16_t status_word;
    int32_t position, velocity;
    int16_t torque, torque_demand;
};

enum { cia402_written_max = 96 };

/// One object that the set-up wrote, to be read again at its end.
struct cia402_written {
    uint16_t index;
    uint8_t subindex, size;
    uint32_t value, mask;
};

struct cia402_setpoint {
    int32_t position, velocity;
    int16_t torque;
};

struct cia402_master {
    struct cia402_master_options options;
    struct canopen_master bus;
    struct drive_configuration configuration;
    struct cia402_scaling scaling;
    const struct cia402_profile *profile; ///< in force since open
    struct drive_counters counters;
    uint32_t saturated; ///< set-points that did not fit their object and were clipped
    bool opened, armed;
    bool checked; ///< the drive has objects 2001 and 2002
    uint32_t period_us;
    uint32_t reply_us;   ///< after SYNC: TPDOs that come later are late
    uint32_t targets_us; ///< that the RPDOs take to get out, at worst
    bool cycling;        ///< SYNC is running
    uint64_t next_sync_us;
    uint16_t control_word;
    struct cia402_setpoint target; ///< on its way or last sent
    int32_t zero;                  ///< position at arm
    bool awaiting;                 ///< between SYNC and the end of its cycle
    bool complete;                 ///< this cycle's TPDOs are there and good
    bool late_counted;
    bool have[2];
    bool mixed; ///< one of them came twice in this cycle, with different content
    struct can_frame replies[2];
    struct cia402_cycle last; ///< last good one
    enum cia402_state state;  ///< of the last good status word
    uint32_t missing_in_a_row;
    uint32_t boot_ups; ///< heard when the drive was opened
    size_t written_count;
    struct cia402_written written[cia402_written_max];
    char detail[240];
};

/// Prepares the door; nothing is sent.
/// Lifetime: the port's object must outlive self, and self must not move.
void cia402_master_init(struct cia402_master *self, const struct can_port *port,
                        const struct cia402_master_options *options);

/// The door as everybody else sees it.
struct drive cia402_master_drive(struct cia402_master *self);

#endif
