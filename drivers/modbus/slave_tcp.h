/* SPDX-License-Identifier: MIT */
/// Modbus TCP slave, one object per connection: a stream of bytes in any pieces in, replies out. No sockets, no clock.
#ifndef SERVOSCOPE_DRIVERS_MODBUS_SLAVE_TCP_H
#define SERVOSCOPE_DRIVERS_MODBUS_SLAVE_TCP_H

#include "drivers/modbus/register_map.h"

#include <stddef.h>

enum { modbus_tcp_header = 7, modbus_tcp_frame_max = 260 };

/// Read-only for the application.
struct modbus_tcp_slave {
    struct modbus_map *map;
    uint8_t frame[modbus_tcp_frame_max];
    uint32_t size;
    bool broken;      ///< what came is no Modbus TCP: close the connection
    bool has_written; ///< the last frame answered was one that writes
    uint32_t answered;
};

void modbus_tcp_slave_init(struct modbus_tcp_slave *self, struct modbus_map *map);

/// Takes bytes up to the end of one frame and answers it once it is whole.
/// may_write: false answers what writes with exception 06
/// Shapes:    out_reply: modbus_tcp_frame_max bytes
/// Returns:   how many bytes were taken (call again with the rest); *out_length the length of the reply, 0: none.
///            A broken stream takes everything and answers nothing
uint32_t modbus_tcp_slave_take(struct modbus_tcp_slave *self, bool may_write, const uint8_t *bytes, uint32_t size,
                               uint8_t *out_reply, uint32_t *out_length);

#endif
