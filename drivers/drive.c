/* SPDX-License-Identifier: MIT */
#include "drivers/drive.h"

const char *drive_status_str(enum drive_status status)
{
    switch (status) {
    case drive_ok:
        return "ok";
    case drive_err_argument:
        return "configuration or set-point out of range";
    case drive_err_timeout:
        return "no answer in time";
    case drive_err_refused:
        return "the drive refused a parameter or a transition";
    case drive_err_fault:
        return "the drive is in fault";
    case drive_err_bus:
        return "the bus is off or the port is gone";
    case drive_err_identity:
        return "what answers is not what the profile expects";
    }
    return "unknown status";
}
