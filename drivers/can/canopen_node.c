/* SPDX-License-Identifier: MIT */
#include "drivers/can/canopen_node.h"

#include "drivers/can/pdo_check.h"

#include <string.h>

// ---- Dictionary

static uint32_t write_sync_period(void *owner, const struct od_entry *entry, int64_t value)
{
    struct canopen_node *self = owner;
    od_store(owner, entry, value);
    sync_consumer_restart(&self->sync);
    return od_abort_none;
}

static uint32_t write_sync_overflow(void *owner, const struct od_entry *entry, int64_t value)
{
    struct canopen_node *self = owner;
    if (self->sync.period_us != 0)
        return od_abort_state;
    if (value != 0 && !(value >= sync_overflow_min && value <= sync_overflow_max))
        return od_abort_value;
    od_store(owner, entry, value);
    sync_consumer_restart(&self->sync);
    return od_abort_none;
}

static uint32_t write_heartbeat_period(void *owner, const struct od_entry *entry, int64_t value)
{
    struct canopen_node *self = owner;
    od_store(owner, entry, value);
    heartbeat_producer_start(&self->producer, self->node_id, self->heartbeat_ms * 1000u, self->now_us);
    return od_abort_none;
}

static uint32_t write_heartbeat_consumer(void *owner, const struct od_entry *entry, int64_t value)
{
    struct canopen_node *self = owner;
    uint32_t node_id = ((uint32_t)value >> 16) & 0xFF;
    if ((uint32_t)value >> 24 != 0 || node_id > nmt_node_id_max)
        return od_abort_value;
    od_store(owner, entry, value);
    heartbeat_consumer_start(&self->consumer, (uint8_t)node_id, node_id == 0 ? 0 : ((uint32_t)value & 0xFFFF) * 1000u);
    return od_abort_none;
}

static uint32_t write_history_count(void *owner, const struct od_entry *entry, int64_t value)
{
    struct canopen_node *self = owner;
    (void)entry;
    if (value != 0) // the only thing to do with the history is to clear it
        return od_abort_value;
    emcy_producer_forget(&self->emcy);
    return od_abort_none;
}

/// COB-IDs that may be written, as some masters do, but not changed.
static uint32_t write_unchanged(void *owner, const struct od_entry *entry, int64_t value)
{
    const struct od_place place = {.entry = entry, .owner = owner};
    return value == od_load(&place) ? od_abort_none : od_abort_value;
}

static uint32_t write_error_behaviour(void *owner, const struct od_entry *entry, int64_t value)
{
    if (value > canopen_error_stops)
        return od_abort_value;
    od_store(owner, entry, value);
    return od_abort_none;
}

enum { index_rpdo = 0x1400, index_rpdo_mapping = 0x1600, index_tpdo = 0x1800, index_tpdo_mapping = 0x1A00 };

/// All PDO parameters: which PDO and direction the index says.
static uint32_t write_pdo(void *owner, const struct od_entry *entry, int64_t value)
{
    struct canopen_node *self = owner;
    enum pdo_direction direction = entry->index >= index_tpdo ? pdo_transmit : pdo_receive;
    struct pdo *pdo = &(direction == pdo_transmit ? self->tpdo : self->rpdo)[entry->index & 0xFF];
    bool mapping = (entry->index & 0x0200) != 0;
    if (mapping && entry->subindex == 0)
        return pdo_set_count(pdo, &self->dictionary, direction, (uint8_t)value);
    if (mapping)
        return pdo_set_entry(pdo, &self->dictionary, direction, entry->subindex, (uint32_t)value);
    if (entry->subindex == 1)
        return pdo_set_cob_id(pdo, (uint32_t)value);
    if (entry->subindex == 3)
        return pdo_set_inhibit_time(pdo, (uint16_t)value);
    return pdo_set_transmission_type(pdo, direction, (uint8_t)value);
}

#define READ_ONLY(index, sub, type, member) OD_ENTRY(index, sub, type, od_readable, canopen_node, member, NULL)
#define WRITABLE(index, sub, type, member, write)                                                                      \
    OD_ENTRY(index, sub, type, od_readable | od_writable, canopen_node, member, write)
#define MAPPABLE(index, sub, member, direction)                                                                        \
    OD_ENTRY(index, sub, od_u8, od_readable | direction, canopen_node, member, NULL)

#define PDO_PARAMETERS(base, highest, pdo)                                                                             \
    OD_CONSTANT(base, 0, od_u8, highest), WRITABLE(base, 1, od_u32, pdo.cob_id, write_pdo),                            \
        WRITABLE(base, 2, od_u8, pdo.transmission_type, write_pdo)

#define TPDO_TIMES(base, pdo)                                                                                          \
    WRITABLE(base, 3, od_u16, pdo.inhibit_100us, write_pdo), WRITABLE(base, 5, od_u16, pdo.event_ms, NULL)

#define PDO_MAPPING(base, pdo)                                                                                         \
    WRITABLE(base, 0, od_u8, pdo.mapped_count, write_pdo), WRITABLE(base, 1, od_u32, pdo.mapped[0], write_pdo),        \
        WRITABLE(base, 2, od_u32, pdo.mapped[1], write_pdo), WRITABLE(base, 3, od_u32, pdo.mapped[2], write_pdo),      \
        WRITABLE(base, 4, od_u32, pdo.mapped[3], write_pdo), WRITABLE(base, 5, od_u32, pdo.mapped[4], write_pdo),      \
        WRITABLE(base, 6, od_u32, pdo.mapped[5], write_pdo), WRITABLE(base, 7, od_u32, pdo.mapped[6], write_pdo),      \
        WRITABLE(base, 8, od_u32, pdo.mapped[7], write_pdo)

#define PDO(number)                                                                                                    \
    PDO_PARAMETERS(index_rpdo + number, 2, rpdo[number]), PDO_MAPPING(index_rpdo_mapping + number, rpdo[number]),      \
        PDO_PARAMETERS(index_tpdo + number, 5, tpdo[number]), TPDO_TIMES(index_tpdo + number, tpdo[number]),           \
        PDO_MAPPING(index_tpdo_mapping + number, tpdo[number])

static const struct od_entry communication_entries[] = {
    READ_ONLY(0x1000, 0, od_u32, identity.device_type),
    READ_ONLY(0x1001, 0, od_u8, emcy.error_register),
    WRITABLE(0x1003, 0, od_u8, emcy.history_count, write_history_count),
    READ_ONLY(0x1003, 1, od_u32, emcy.history[0]),
    READ_ONLY(0x1003, 2, od_u32, emcy.history[1]),
    READ_ONLY(0x1003, 3, od_u32, emcy.history[2]),
    READ_ONLY(0x1003, 4, od_u32, emcy.history[3]),
    READ_ONLY(0x1003, 5, od_u32, emcy.history[4]),
    READ_ONLY(0x1003, 6, od_u32, emcy.history[5]),
    READ_ONLY(0x1003, 7, od_u32, emcy.history[6]),
    READ_ONLY(0x1003, 8, od_u32, emcy.history[7]),
    WRITABLE(0x1005, 0, od_u32, sync_cob_id, write_unchanged),
    WRITABLE(0x1006, 0, od_u32, sync.period_us, write_sync_period),
    WRITABLE(0x1007, 0, od_u32, sync.window_us, NULL),
    READ_ONLY(0x1008, 0, od_string, device_name),
    READ_ONLY(0x1009, 0, od_string, hardware_version),
    READ_ONLY(0x100A, 0, od_string, software_version),
    READ_ONLY(0x1014, 0, od_u32, emcy_cob_id),
    OD_CONSTANT(0x1016, 0, od_u8, 1),
    WRITABLE(0x1016, 1, od_u32, consumer_entry, write_heartbeat_consumer),
    WRITABLE(0x1017, 0, od_u16, heartbeat_ms, write_heartbeat_period),
    OD_CONSTANT(0x1018, 0, od_u8, 4),
    READ_ONLY(0x1018, 1, od_u32, identity.vendor),
    READ_ONLY(0x1018, 2, od_u32, identity.product),
    READ_ONLY(0x1018, 3, od_u32, identity.revision),
    READ_ONLY(0x1018, 4, od_u32, identity.serial),
    WRITABLE(0x1019, 0, od_u8, sync.overflow, write_sync_overflow),
    OD_CONSTANT(0x1029, 0, od_u8, 1),
    WRITABLE(0x1029, 1, od_u8, error_behaviour, write_error_behaviour),
    OD_CONSTANT(0x1200, 0, od_u8, 2),
    READ_ONLY(0x1200, 1, od_u32, sdo_cob_ids[0]),
    READ_ONLY(0x1200, 2, od_u32, sdo_cob_ids[1]),
    PDO(0),
    PDO(1),
    PDO(2),
    PDO(3),
    OD_CONSTANT(pdo_check_sample_index, 0, od_u8, 2),
    MAPPABLE(pdo_check_sample_index, 1, sample_counter, od_mappable_transmit),
    MAPPABLE(pdo_check_sample_index, 2, sample_check, od_mappable_transmit),
    OD_CONSTANT(pdo_check_target_index, 0, od_u8, 2),
    MAPPABLE(pdo_check_target_index, 1, target_counter, od_mappable_receive),
    MAPPABLE(pdo_check_target_index, 2, target_check, od_mappable_receive),
};

// ---- Start

/// Values of the communication objects after power-on; the node's place on the bus stays.
static void set_defaults(struct canopen_node *self)
{
    uint8_t node_id = self->node_id;
    self->sdo = (struct sdo_server){.node_id = node_id, .dictionary = &self->dictionary};
    self->emcy = (struct emcy_producer){.node_id = node_id};
    self->sync = (struct sync_consumer){.timeout_us = self->sync.timeout_us};
    heartbeat_producer_start(&self->producer, node_id, 0, self->now_us);
    heartbeat_consumer_start(&self->consumer, 0, 0);
    self->consumer_entry = 0;
    self->heartbeat_ms = 0;
    self->error_behaviour = canopen_error_stays;
    self->sync_cob_id = sync_cob_id;
    self->emcy_cob_id = (uint32_t)emcy_cob_id + node_id;
    self->sdo_cob_ids[0] = (uint32_t)sdo_request_cob_id + node_id;
    self->sdo_cob_ids[1] = (uint32_t)sdo_response_cob_id + node_id;
    for (unsigned i = 0; i < pdo_per_direction; i++) {
        self->rpdo[i] = (struct pdo){.cob_id = PDO_DISABLED | (0x200 + 0x100 * i + node_id), .transmission_type = 255};
        self->tpdo[i] = (struct pdo){.cob_id = PDO_DISABLED | (0x180 + 0x100 * i + node_id), .transmission_type = 1};
    }
}

static struct od_data constant_text(const char *text)
{
    const char *said = text ? text : "";
    return (struct od_data){.bytes = (const uint8_t *)said, .size = (uint32_t)strlen(said)};
}

void canopen_node_init(struct canopen_node *self, uint8_t node_id, const struct can_port *port,
                       const struct canopen_node_identity *identity, const struct od_entry *entries, size_t entry_count,
                       const struct canopen_node_events *events, void *owner)
{
    memset(self, 0, sizeof *self);
    self->port = *port;
    self->node_id = node_id;
    self->identity = *identity;
    self->device_name = constant_text(identity->device_name);
    self->hardware_version = constant_text(identity->hardware_version);
    self->software_version = constant_text(identity->software_version);
    self->events = events;
    self->owner = owner;
    self->dictionary.section_count = 2;
    self->dictionary.sections[0] = (struct od_section){
        .entries = communication_entries,
        .count = sizeof communication_entries / sizeof communication_entries[0],
        .owner = self,
    };
    self->dictionary.sections[1] = (struct od_section){.entries = entries, .count = entry_count, .owner = owner};
    set_defaults(self);
}

static void send(struct canopen_node *self, const struct can_frame *frame)
{
    enum can_status status = self->port.operations->send(self->port.self, frame);
    if (status != can_ok)
        self->errors.frames_unsent++;
    if (status == can_err_bus_off)
        self->bus_was_off = true;
    if (status != can_ok || !self->bus_was_off)
        return;
    self->bus_was_off = false;
    struct can_frame recovered = emcy_producer_raise(&self->emcy, emcy_bus_off_recovered, emcy_communication_error);
    if (self->port.operations->send(self->port.self, &recovered) != can_ok)
        self->errors.frames_unsent++;
}

void canopen_node_boot(struct canopen_node *self, uint64_t now_us)
{
    self->now_us = now_us;
    struct can_frame frame = heartbeat_frame(self->node_id, nmt_initialising);
    send(self, &frame);
    self->state = nmt_pre_operational;
}

void canopen_node_raise(struct canopen_node *self, uint16_t emcy_code, uint8_t register_bits)
{
    struct can_frame frame = emcy_producer_raise(&self->emcy, emcy_code, register_bits);
    send(self, &frame);
}

void canopen_node_clear_errors(struct canopen_node *self)
{
    struct can_frame frame = emcy_producer_clear(&self->emcy);
    send(self, &frame);
}

// ---- SYNC cycle

static bool ends_with(const struct pdo *pdo, uint16_t index, uint8_t subindex)
{
    if (pdo->mapped_count == 0)
        return false;
    const struct od_entry *last = pdo->places[pdo->mapped_count - 1].entry;
    return last->index == index && last->subindex == subindex;
}

/// Whether the waiting RPDOs are a set for this SYNC, if they carry a check at all.
static bool targets_pass(const struct canopen_node *self, const struct pdo *last, uint8_t counter)
{
    if (!ends_with(last, pdo_check_target_index, 2))
        return true;
    uint8_t check = pdo_check_start;
    bool mixed = false;
    for (const struct pdo *pdo = self->rpdo; pdo <= last; pdo++) {
        if (!pdo_is_enabled(pdo) || !pdo_is_synchronous(pdo))
            continue;
        check = pdo_check(check, pdo->data, pdo == last ? pdo->length - 1u : pdo->length);
        mixed = mixed || pdo->mixed;
    }
    return !mixed && check == last->data[last->length - 1] &&
           (last->length < 2 || last->data[last->length - 2] == counter);
}

/// Puts the set-points received before this SYNC in force, all or none where they carry a check. False unless all are
/// there and good.
static bool take_targets(struct canopen_node *self, uint8_t counter)
{
    const struct pdo *last = NULL;
    bool complete = true;
    for (struct pdo *pdo = self->rpdo; pdo < &self->rpdo[pdo_per_direction]; pdo++) {
        if (!pdo_is_enabled(pdo) || !pdo_is_synchronous(pdo))
            continue;
        last = pdo;
        complete = complete && pdo->pending;
    }
    bool fresh = complete && (last == NULL || targets_pass(self, last, counter));
    if (!complete)
        self->errors.targets_lost++;
    else if (!fresh)
        self->errors.targets_rejected++;
    // Without a check there is no set to speak of: many masters send a control word only when it changes.
    bool as_they_come = last == NULL || !ends_with(last, pdo_check_target_index, 2);
    for (struct pdo *pdo = self->rpdo; pdo < &self->rpdo[pdo_per_direction]; pdo++) {
        if (!pdo_is_synchronous(pdo) || !pdo->pending)
            continue;
        if (fresh || as_they_come)
            self->errors.values_refused += pdo_apply(pdo);
        pdo->pending = pdo->mixed = false;
    }
    return fresh;
}

static void send_samples(struct canopen_node *self)
{
    struct can_frame frames[pdo_per_direction];
    const struct pdo *last = NULL;
    unsigned count = 0;
    for (struct pdo *pdo = self->tpdo; pdo < &self->tpdo[pdo_per_direction]; pdo++) {
        if (!pdo_due(pdo))
            continue;
        frames[count++] = pdo_make(pdo);
        last = pdo;
    }
    if (last && ends_with(last, pdo_check_sample_index, 2)) {
        uint8_t check = pdo_check_start;
        struct can_frame *end = &frames[count - 1];
        for (unsigned i = 0; i + 1 < count; i++)
            check = pdo_check(check, frames[i].data, frames[i].length);
        self->sample_check = pdo_check(check, end->data, end->length - 1u);
        end->data[end->length - 1] = self->sample_check;
    }
    for (unsigned i = 0; i < count; i++)
        send(self, &frames[i]);
}

/// Sends the TPDOs whose values have changed or whose time has come.
static void serve_events(struct canopen_node *self)
{
    if (self->state != nmt_operational)
        return;
    for (struct pdo *pdo = self->tpdo; pdo < &self->tpdo[pdo_per_direction]; pdo++) {
        if (self->now_us < pdo_event_deadline_us(pdo))
            continue;
        struct can_frame frame = pdo_make(pdo);
        send(self, &frame);
        pdo_event_sent(pdo, &frame, self->now_us);
    }
}

static void serve_sync(struct canopen_node *self, const struct can_frame *frame)
{
    enum sync_result result = sync_consumer_take(&self->sync, frame, self->now_us);
    if (result == sync_malformed)
        canopen_node_raise(self, emcy_sync_length, emcy_communication_error);
    if (result != sync_taken && result != sync_gap)
        return;
    self->sample_counter = self->sync.counter;
    bool fresh = take_targets(self, self->sync.counter);
    self->events->synchronise(self->owner, self->now_us, fresh);
    send_samples(self);
}

// ---- Everything else

static void serve_nmt(struct canopen_node *self, enum nmt_command command)
{
    enum nmt_state before = self->state;
    self->state = nmt_state_after(before, command);
    if (self->state == nmt_stopped)
        self->sdo.state = sdo_server_idle;
    for (unsigned i = 0; i < pdo_per_direction && before != self->state; i++)
        self->tpdo[i].sent = false;
    if (before == nmt_operational && self->state != nmt_operational) {
        self->events->connection_lost(self->owner, emcy_communication, self->now_us);
        sync_consumer_restart(&self->sync);
    }
    if (self->state != nmt_initialising)
        return;
    if (command == nmt_reset_node)
        self->events->reset(self->owner);
    set_defaults(self);
    canopen_node_boot(self, self->now_us);
}

static void serve_rpdo(struct canopen_node *self, const struct can_frame *frame)
{
    for (struct pdo *pdo = self->rpdo; pdo < &self->rpdo[pdo_per_direction]; pdo++) {
        if (pdo_is_synchronous(pdo) && sync_consumer_window_is_over(&self->sync, self->now_us)) {
            self->errors.targets_outside += pdo_is_enabled(pdo) && frame->id == (pdo->cob_id & can_id_max);
            continue;
        }
        uint32_t before = pdo->wrong_length;
        bool taken = pdo_take(pdo, frame);
        if (pdo->wrong_length != before)
            canopen_node_raise(self, emcy_pdo_length, emcy_communication_error);
        if (taken && !pdo_is_synchronous(pdo))
            self->errors.values_refused += pdo_apply(pdo);
    }
}

/// Sends some segments of a block upload, if their time has come and the port has room.
static void serve_segments(struct canopen_node *self)
{
    struct can_frame frame;
    if (self->now_us < self->segments_us)
        return;
    for (int n = 0; n < canopen_segment_burst && sdo_server_upcoming(&self->sdo, &frame); n++) {
        self->segments_us = self->now_us + canopen_segment_gap_us;
        if (self->port.operations->send(self->port.self, &frame) != can_ok)
            return; // stays upcoming
        sdo_server_sent(&self->sdo, self->now_us);
    }
}

static void serve_sdo(struct canopen_node *self, const struct can_frame *frame)
{
    struct can_frame answer;
    if (self->state == nmt_stopped)
        return;
    if (sdo_server_take(&self->sdo, frame, self->now_us, &answer))
        send(self, &answer);
    serve_segments(self);
}

static void lose_heartbeat(struct canopen_node *self)
{
    self->events->connection_lost(self->owner, emcy_heartbeat, self->now_us);
    if (self->error_behaviour == canopen_error_leaves_operational && self->state == nmt_operational)
        serve_nmt(self, nmt_enter_pre_operational);
    else if (self->error_behaviour == canopen_error_stops)
        serve_nmt(self, nmt_stop);
}

void canopen_node_receive(struct canopen_node *self, const struct can_frame *frame, uint64_t now_us)
{
    self->now_us = now_us;
    enum nmt_command command = nmt_command_parse(frame, self->node_id);
    if (command != nmt_none) {
        serve_nmt(self, command);
        serve_events(self);
        return;
    }
    serve_sdo(self, frame);
    heartbeat_consumer_take(&self->consumer, frame, now_us);
    if (self->state == nmt_operational) {
        serve_sync(self, frame);
        serve_rpdo(self, frame);
    }
    serve_events(self);
}

void canopen_node_advance(struct canopen_node *self, uint64_t now_us)
{
    self->now_us = now_us;
    struct can_frame frame;
    if (heartbeat_producer_due(&self->producer, self->state, now_us, &frame))
        send(self, &frame);
    if (heartbeat_consumer_expired(&self->consumer, now_us))
        lose_heartbeat(self);
    if (sync_consumer_expired(&self->sync, now_us))
        self->events->connection_lost(self->owner, emcy_sync_lost, now_us);
    if (sdo_server_advance(&self->sdo, now_us, &frame))
        send(self, &frame);
    serve_segments(self);
    serve_events(self);
}

static uint64_t earlier(uint64_t a, uint64_t b)
{
    return a < b ? a : b;
}

uint64_t canopen_node_deadline_us(const struct canopen_node *self)
{
    uint64_t deadline_us = heartbeat_producer_deadline_us(&self->producer);
    deadline_us = earlier(deadline_us, heartbeat_consumer_deadline_us(&self->consumer));
    deadline_us = earlier(deadline_us, sync_consumer_deadline_us(&self->sync));
    deadline_us = earlier(deadline_us, sdo_server_deadline_us(&self->sdo));
    struct can_frame frame;
    if (sdo_server_upcoming(&self->sdo, &frame))
        deadline_us = earlier(deadline_us, self->segments_us);
    for (unsigned i = 0; i < pdo_per_direction && self->state == nmt_operational; i++)
        deadline_us = earlier(deadline_us, pdo_event_deadline_us(&self->tpdo[i]));
    return deadline_us;
}
