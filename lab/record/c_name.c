/* SPDX-License-Identifier: MIT */
#include "lab/record/c_name.h"

#include <stdio.h>
#include <string.h>

static bool is_letter(char c)
{
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
}

void c_name_from_path(const char *path, bool upper, char out_name[c_name_size])
{
    const char *slash = strrchr(path, '/');
    const char *base = slash ? slash + 1 : path;
    size_t length = 0;
    if (!is_letter(base[0]))
        length = (size_t)snprintf(out_name, c_name_size, "%s", upper ? "TABLE_" : "table_");
    for (; *base && *base != '.' && length + 1 < c_name_size; base++) {
        char c = is_letter(*base) || (*base >= '0' && *base <= '9') ? *base : '_';
        if (is_letter(c))
            c = (char)(upper ? c & ~0x20 : c | 0x20);
        out_name[length++] = c;
    }
    out_name[length] = '\0';
}
