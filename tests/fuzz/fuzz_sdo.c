/* SPDX-License-Identifier: MIT */
/// SDO server and client, each against frames that nobody sane sends.
#include "drivers/can/sdo_client.h"
#include "drivers/can/sdo_server.h"
#include "tests/fuzz/fuzz.h"

enum { room_bytes = 64, guard_bytes = 16, guard = 0xA5 };

struct owner {
    struct od_data table, text, in_place;
    uint16_t number;
};

#define AT(member) offsetof(struct owner, member)

static const struct od_entry entries[] = {
    {0x1008, 0, od_string, od_readable, AT(text), 0, NULL},
    {0x2100, 0, od_domain, od_readable | od_writable, AT(table), 0, NULL},
    {0x2101, 0, od_u16, od_readable | od_writable, AT(number), 0, NULL},
    {0x2102, 0, od_domain, od_readable | od_writable, AT(in_place), 0, NULL},
};

/// Rooms with a guard behind them, which ASan does not see.
struct room {
    uint8_t bytes[room_bytes], guard[guard_bytes];
};

static void check_room(const struct room *room)
{
    for (int i = 0; i < guard_bytes; i++)
        FUZZ_CHECK(room->guard[i] == guard);
}

static void check_server(const struct sdo_server *server)
{
    bool downloads = server->state >= sdo_server_segment_download && server->state != sdo_server_segment_upload &&
                     server->state <= sdo_server_block_download_end;
    if (downloads)
        FUZZ_CHECK(server->receiver.size <= server->receiver.capacity);
    else if (server->state != sdo_server_idle)
        FUZZ_CHECK(server->sender.base <= server->sender.size);
    FUZZ_CHECK(server->state <= sdo_server_block_upload_end);
}

static void start_client(struct sdo_client *client, const struct fuzz_step *step, struct room *room)
{
    static const uint16_t indices[] = {0x1008, 0x2100, 0x2101, 0x2102};
    uint16_t index = indices[step->data[0] & 3];
    enum sdo_method method = (step->data[1] & 1) ? sdo_block : sdo_segmented;
    uint32_t size = step->data[2] % (room_bytes + 1);
    if (step->data[1] & 2)
        sdo_client_upload(client, index, 0, step->data[2] % 5);
    else if (step->data[1] & 4)
        sdo_client_download(client, index, 0, 1 + step->data[2] % 4, 0x01020304);
    else if (step->data[1] & 8)
        sdo_client_upload_data(client, method, index, 0, room->bytes, size);
    else
        sdo_client_download_data(client, method, index, 0, room->bytes, size);
}

/// A frame that at least names an object that is there.
static void name_object(struct can_frame *frame, uint8_t which)
{
    static const uint16_t indices[] = {0x1008, 0x2100, 0x2101, 0x2102};
    can_put(&frame->data[1], 2, indices[which & 3]);
    frame->data[3] = 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct room room, client_room, in_place;
    memset(&room, guard, sizeof room);
    memset(&client_room, guard, sizeof client_room);
    memset(&in_place, guard, sizeof in_place);
    struct owner owner = {
        .table = {room.bytes, 20, room.bytes, room_bytes},
        .text = {(const uint8_t *)"fuzzed drive", 12, NULL, 0},
        .in_place = {in_place.bytes, 3, in_place.bytes, room_bytes},
    };
    const struct object_dictionary dictionary = {1, {{entries, sizeof entries / sizeof entries[0], &owner}}};
    struct sdo_server server = {.node_id = 5, .dictionary = &dictionary};
    struct sdo_client client = {.node_id = 5};
    uint64_t now_us = 0;
    for (; size >= fuzz_step_bytes; data += fuzz_step_bytes, size -= fuzz_step_bytes) {
        struct fuzz_step step = fuzz_step(data);
        struct can_frame request = fuzz_frame(0x605, &step), answer = fuzz_frame(0x585, &step), frame;
        if (step.what & 0x80) {
            name_object(&request, step.what);
            name_object(&answer, step.what);
        }
        switch (step.what >> 3 & 7) {
        case 0:
        case 1:
            sdo_client_take(&client, &answer);
            break;
        case 2:
            start_client(&client, &step, &client_room);
            break;
        case 3: // the client's own frame, if it has one, reaches the server and is answered
            if (sdo_client_upcoming(&client, &frame)) {
                sdo_client_sent(&client);
                if (sdo_server_take(&server, &frame, now_us, &answer))
                    sdo_client_take(&client, &answer);
            }
            break;
        case 4:
            now_us += can_get(step.data, 3) & 0x1FFFFF;
            sdo_server_advance(&server, now_us, &frame);
            sdo_client_remind(&client);
            break;
        default:
            if (sdo_server_take(&server, &request, now_us, &answer))
                FUZZ_CHECK(answer.id == 0x585 && answer.length == 8);
            break;
        }
        if (sdo_server_upcoming(&server, &frame))
            sdo_server_sent(&server, now_us);
        check_server(&server);
        FUZZ_CHECK(owner.table.size <= room_bytes && owner.in_place.size <= room_bytes);
        FUZZ_CHECK(client.state != sdo_client_aborted || client.abort_code != od_abort_none);
        check_room(&room);
        check_room(&client_room);
        check_room(&in_place);
    }
    return 0;
}
