/* SPDX-License-Identifier: MIT */
/* Any bytes of any length up to two hundred as a table, then played: Eva has to see that nothing beyond them is read.
 * */
#include "tests/frama-c/any.h"

#include "msgen/player.h"

enum { bytes_max = 200 };

int main(void)
{
    static uint8_t bytes[bytes_max];
    struct msgen_table table;
    size_t size = any_between(0, bytes_max);
    for (uint32_t i = 0; i < bytes_max; ++i) {
        bytes[i] = (uint8_t)(any_u32() & 0xFFu);
    }
    if (msgen_table_open(bytes, size, &table) == core_ok) {
        uint8_t header[msgen_header_travel_bytes];
        msgen_table_encode_header(&table, header);
    }
    return 0;
}
