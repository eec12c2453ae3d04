/* SPDX-License-Identifier: MIT */
/* Bytes, CRC and fixed-point helpers over all they are said to take. */
#include "tests/frama-c/any.h"

#include "core/bytes.h"
#include "core/crc32.h"
#include "core/fixed.h"
#include "core/status.h"

int main(void)
{
    uint8_t bytes[16];
    bool saturated = false;
    core_put_u32(bytes, any_u32());
    core_put_u32(bytes + 4, any_u32());
    core_put_u16(bytes + 8, (uint16_t)(any_u32() & 0xFFFFu));
    core_put_u16(bytes + 10, (uint16_t)(any_u32() & 0xFFFFu));
    core_put_u32(bytes + 12, any_u32());
    core_crc32(any_u32(), bytes, any_between(0, 16));
    core_get_i16(bytes + 8);
    core_get_i32(bytes + 4);
    core_scale_q30(any_i32(), (int32_t)any_between(0, CORE_Q30_ONE));
    core_saturate_i32((int64_t)any_i32() * any_i32(), (int32_t)any_between(0, INT32_MAX), &saturated);
    core_count_up(any_u32());
    core_status_str((enum core_status)any_i32());
    return 0;
}
