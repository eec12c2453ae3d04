/* SPDX-License-Identifier: MIT */
#include "ports/place.h"

#include <string.h>

bool place_split(const char *place, char *out_name, size_t name_size, long *out_number)
{
    const char *colon = strrchr(place, ':');
    if (!colon || (size_t)(colon - place) >= name_size) {
        return false;
    }
    size_t digits = strspn(colon + 1, "0123456789");
    if (digits == 0 || digits > 9 || colon[1 + digits] != '\0') {
        return false;
    }
    memcpy(out_name, place, (size_t)(colon - place));
    out_name[colon - place] = '\0';
    *out_number = 0;
    for (size_t i = 0; i < digits; i++) {
        *out_number = *out_number * 10 + (colon[1 + i] - '0');
    }
    return true;
}
