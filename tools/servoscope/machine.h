/* SPDX-License-Identifier: MIT */
/// What this machine has of what a measurement wants: CAN, serial ports, real-time rights, libraries. Nothing is
/// changed and nothing is sent.
#ifndef SERVOSCOPE_TOOLS_MACHINE_H
#define SERVOSCOPE_TOOLS_MACHINE_H

#include <stddef.h>

enum machine_state {
    machine_good,    ///< as it should be
    machine_limited, ///< works, with a drawback that `says` names
    machine_missing, ///< not there; `remedy` says how to get it
};

enum { machine_text_max = 400, machine_checks_max = 16 };

struct machine_check {
    const char *id;   ///< for machines: "can", "clock"
    const char *what; ///< for people: "CAN interfaces"
    enum machine_state state;
    char says[machine_text_max];
    char remedy[machine_text_max]; ///< what to do about it; empty where nothing is to be done
};

/// Makes all checks; takes about half a second, in which the clock is watched. Returns how many.
size_t machine_check_all(struct machine_check out_checks[machine_checks_max]);

const char *machine_state_str(enum machine_state state);

#endif
