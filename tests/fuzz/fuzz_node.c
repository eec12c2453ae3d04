/* SPDX-License-Identifier: MIT */
/// The simulated drive's whole CAN side: NMT, SYNC, SDO, PDO mapping and data, heartbeats, in any order and length.
#include "sim/node/simulated_drive.h"
#include "tests/fuzz/fuzz.h"

static unsigned sent;

static enum can_status port_send(void *self, const struct can_frame *frame)
{
    (void)self;
    FUZZ_CHECK(can_frame_is_valid(frame) && !frame->remote);
    return ++sent % 7 == 0 ? can_err_full : can_ok;
}

static const struct can_port_operations operations = {port_send, NULL, NULL, NULL};
static const struct can_port port = {&operations, NULL};

static const uint16_t identifiers[] = {0x000, 0x080, 0x205, 0x305, 0x405, 0x505, 0x605, 0x605,
                                       0x605, 0x77F, 0x085, 0x185, 0x605, 0x205, 0x080, 0x7FF};

static void check_pdo(const struct pdo *pdo)
{
    FUZZ_CHECK(pdo->length <= can_data_max && pdo->mapped_count <= pdo_entries_max);
}

static struct can_frame write_frame(uint16_t index, uint8_t subindex, uint8_t size, uint32_t value)
{
    struct can_frame frame = can_frame_make(0x605, 8);
    frame.data[0] = (uint8_t)(0x23 | ((4 - size) << 2));
    can_put(&frame.data[1], 2, index);
    frame.data[3] = subindex;
    can_put(&frame.data[4], size, value);
    return frame;
}

/// A write of a mapping entry or count that has a chance to be right.
static struct can_frame write_mapping(const uint8_t *data)
{
    static const uint32_t receive[] = {0x60400010, 0x607A0020, 0x60B10020, 0x60B20010, 0x20020108, 0x20020208};
    static const uint32_t transmit[] = {0x60410010, 0x60640020, 0x606C0020, 0x60770010, 0x20010108, 0x20010208};
    bool transmits = data[0] & 4;
    uint16_t index = (uint16_t)((transmits ? 0x1A00 : 0x1600) + (data[1] & 3));
    uint8_t subindex = data[2] % 4;
    if (subindex == 0)
        return write_frame(index, 0, 1, data[4] % 4);
    return write_frame(index, subindex, 4, (transmits ? transmit : receive)[data[4] % 6]);
}

/// Turns the bytes into a write of a communication object, so that mappings and time-outs are more than luck.
static struct can_frame write_parameter(const uint8_t *data)
{
    bool transmits = data[0] & 4;
    uint8_t number = data[1] & 3;
    uint16_t index = (uint16_t)((transmits ? 0x1800 : 0x1400) + number);
    uint32_t disabled = data[5] & 0x80 ? PDO_DISABLED : 0;
    switch (data[0] & 3) {
    case 0:
        return write_mapping(data);
    case 1:
        return write_frame(index, 1, 4, disabled | (transmits ? 0x185u : 0x205u) | (uint32_t)number << 8);
    case 2:
        return data[2] & 1 ? write_frame(index, 2, 1, data[4] & 1 ? data[5] : 1)
                           : write_frame(index, data[2] & 2 ? 3 : 5, 2, data[4]);
    default:
        switch (data[2] % 5) {
        case 0:
            return write_frame(0x1006, 0, 4, data[4] * 100u);
        case 1:
            return write_frame(0x1019, 0, 1, data[4]);
        case 2:
            return write_frame(0x1016, 1, 4, 0x007F0000u | data[4]);
        case 3:
            return write_frame(0x1017, 0, 2, data[4]);
        default:
            return write_frame(0x1029, 1, 1, data[4] % 3);
        }
    }
}

/// The frame of a step, most of the time one that the node does not throw away at once.
static struct can_frame make_frame(const uint8_t *bytes, uint8_t sync_counter)
{
    struct fuzz_step step = fuzz_step(bytes);
    struct can_frame frame = fuzz_frame(identifiers[step.what & 0x0F], &step);
    bool tame = (bytes[1] & 0x30) == 0;
    frame.remote = (bytes[1] & 0xF0) == 0x70;
    if (step.what & 0x80)
        return write_parameter(step.data);
    if (tame && frame.id == 0x000) {
        frame = can_frame_make(0x000, 2);
        frame.data[0] = 1;
    } else if (tame && frame.id == 0x080) {
        frame = can_frame_make(0x080, step.data[0] & 1);
        frame.data[0] = step.data[0] & 1 ? sync_counter : 0;
    } else if (tame && frame.id == 0x77F) {
        frame = can_frame_make(0x77F, 1);
        frame.data[0] = 5;
    }
    return frame;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static struct simulated_drive drive;
    struct sim_model model;
    uint64_t now_us = 0;
    sim_model_default(&model);
    sent = 0;
    simulated_drive_init(&drive, &model, 5, &port);
    const struct can_participant participant = simulated_drive_participant(&drive);
    participant.advance(participant.self, 0);
    for (; size >= fuzz_step_bytes; data += fuzz_step_bytes, size -= fuzz_step_bytes) {
        struct can_frame frame = make_frame(data, (uint8_t)(drive.node.sync.counter + 1));
        now_us += data[0] & 0x40 ? 1000u : data[9];
        for (int n = 0; n < 8 && participant.deadline_us(participant.self) <= now_us; n++)
            participant.advance(participant.self, now_us);
        participant.receive(participant.self, &frame, now_us);
        for (int i = 0; i < pdo_per_direction; i++) {
            check_pdo(&drive.node.rpdo[i]);
            check_pdo(&drive.node.tpdo[i]);
        }
        FUZZ_CHECK(drive.node.emcy.history_count <= emcy_history_max);
        FUZZ_CHECK(drive.machine.state < cia402_state_count);
    }
    return 0;
}
