/* SPDX-License-Identifier: MIT */
/// How a host reaches a slave: single requests over some port. A link may deliver a late reply to an earlier request as
/// the answer to this one; drivers/modbus/host.h is there to find out.
#ifndef SERVOSCOPE_DRIVERS_MODBUS_LINK_H
#define SERVOSCOPE_DRIVERS_MODBUS_LINK_H

#include <stdint.h>

/// 0: done; 1 .. 255: the slave's exception code; negative: no usable reply.
enum modbus_link_status {
    modbus_link_ok = 0,
    modbus_link_timeout = -1, ///< no reply, or not the whole of it, in time
    modbus_link_damaged = -2, ///< check sum, address, function, count or transaction are wrong
    modbus_link_lost = -3,    ///< the port or the connection is gone
};

/// Every call returns within the port's stated time, whatever the other side does.
struct modbus_link {
    void *self;
    int (*read)(void *self, uint32_t address, uint32_t count, uint16_t *out_words);
    int (*write)(void *self, uint32_t address, uint32_t count, const uint16_t *words);
    /// Function 23: writes, then reads.
    int (*exchange)(void *self, uint32_t write_address, uint32_t write_count, const uint16_t *words,
                    uint32_t read_address, uint32_t read_count, uint16_t *out_words);
    /// After a failure: waits until nothing more arrives and throws away what did; opens a lost connection again.
    int (*settle)(void *self);
    void (*wait)(void *self, uint32_t ms);
    const char *(*name)(const void *self); ///< for messages
};

#endif
