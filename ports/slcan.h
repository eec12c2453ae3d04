/* SPDX-License-Identifier: MIT */
/// CAN frames as text over a serial line or TCP (slcan_codec.h), as a struct can_port. Two sides:
///   client   talks to an adapter: opens its channel, then sends and receives frames
///   adapter  is one: takes the connection of one client at a time, answers its commands as Lawicel's adapter does.
///            While no client has opened the channel, frames sent go nowhere, as on a bus without anybody else.
#ifndef SERVOSCOPE_PORTS_SLCAN_H
#define SERVOSCOPE_PORTS_SLCAN_H

#include "drivers/can/can_port.h"
#include "ports/bus_watch.h"
#include "ports/slcan_codec.h"
#include "ports/wall_clock.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum {
    slcan_receive_max = 256,       ///< frames waiting to be taken; what comes then stays on the line
    slcan_unsent_bytes_max = 4096, ///< text that the line has not taken yet; more is refused (can_err_full)
};

/// Since the port was opened.
struct slcan_counters {
    uint32_t sent, received;
    uint32_t unsent;      ///< frames refused because the line did not take what was written before
    uint32_t malformed;   ///< lines that are no frame and no command
    uint32_t extended;    ///< frames with 29-bit identifiers, not passed on
    uint32_t refused;     ///< BEL heard from an adapter, or said as one
    uint32_t clients;     ///< taken by an adapter
    uint32_t turned_away; ///< that came while another was there
};

/// Read-only for the application, but for `watch`, which it may start.
struct slcan {
    int line;       ///< connected socket, serial device or pty master; -1: nobody there
    int listener;   ///< of an adapter on TCP, else -1
    int pty_keeper; ///< an adapter's own hold on its pty, so that it outlives its clients; else -1
    bool adapter, on_socket;
    bool channel_open;
    enum can_status status;
    struct wall_clock clock;
    struct bus_watch watch;
    struct slcan_counters counters;
    struct slcan_parser parser;
    uint32_t done; ///< plain answers (CR) heard from an adapter
    size_t waiting_first, waiting_count;
    struct can_frame waiting[slcan_receive_max];
    size_t unsent_count;
    char unsent[slcan_unsent_bytes_max];
    uint16_t port;     ///< of an adapter on TCP: where it listens
    char pty_name[64]; ///< of an adapter on a pty: what a client opens
    char link[256];    ///< to it; removed at the end; empty: none
};

/// Connects to an adapter behind HOST:PORT and opens its channel at `bitrate`.
/// Errors: false, with one line in out_reason; nothing to close then. Waits 3 s for the connection at most.
bool slcan_connect_tcp(struct slcan *self, const char *host, const char *port, uint32_t bitrate, char *out_reason,
                       size_t size);

/// The same for a serial device (/dev/ttyUSB0, /dev/pts/3); its speed is left as it is for a pty, else 1 Mbaud or what
/// the device can.
bool slcan_connect_serial(struct slcan *self, const char *path, uint32_t bitrate, char *out_reason, size_t size);

/// Makes an adapter that listens at HOST:PORT; port "0" takes a free one (self->port says which).
bool slcan_listen_tcp(struct slcan *self, const char *host, const char *port, char *out_reason, size_t size);

/// Makes an adapter on a new pty; `link` is made a symbolic link to it and must not exist. NULL: no link.
bool slcan_listen_pty(struct slcan *self, const char *link, char *out_reason, size_t size);

/// The port; self must not move while it is used.
struct can_port slcan_port(struct slcan *self);

/// A client closes the adapter's channel. Harmless twice.
void slcan_close(struct slcan *self);

#endif
