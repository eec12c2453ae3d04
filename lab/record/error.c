/* SPDX-License-Identifier: MIT */
#include "lab/record/error.h"

#include <stdarg.h>
#include <stdio.h>

int error_set(struct error *out_error, int status, const char *format, ...)
{
    if (out_error) {
        va_list arguments;
        va_start(arguments, format);
        out_error->status = status;
        vsnprintf(out_error->message, sizeof out_error->message, format, arguments);
        va_end(arguments);
        // A message quotes what files and drives say; it has to stay one line and must not steer a terminal.
        for (char *c = out_error->message; *c; c++)
            if ((unsigned char)*c < 0x20 || *c == 0x7f)
                *c = '?';
    }
    return status;
}
