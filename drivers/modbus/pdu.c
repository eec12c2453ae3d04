/* SPDX-License-Identifier: MIT */
#include "drivers/modbus/pdu.h"

static uint32_t word_at(const uint8_t *bytes)
{
    return (uint32_t)bytes[0] << 8 | bytes[1];
}

static void put_word(uint8_t *out_bytes, uint32_t word)
{
    out_bytes[0] = (uint8_t)(word >> 8 & 0xFFu);
    out_bytes[1] = (uint8_t)(word & 0xFFu);
}

static uint32_t refuse(uint8_t function, enum modbus_exception exception, uint8_t *out_reply)
{
    out_reply[0] = (uint8_t)(function | 0x80u);
    out_reply[1] = (uint8_t)exception;
    return 2;
}

/// Reads into the reply; the registers go out as bytes.
static uint32_t read_registers(struct modbus_map *map, uint8_t function, uint32_t address, uint32_t count,
                               uint8_t *out_reply)
{
    uint16_t words[modbus_read_words_max];
    if (count < 1 || count > modbus_read_words_max) {
        return refuse(function, modbus_exception_value, out_reply);
    }
    enum modbus_exception exception = modbus_map_read(map, address, count, words);
    if (exception != modbus_exception_none) {
        return refuse(function, exception, out_reply);
    }
    out_reply[0] = function;
    out_reply[1] = (uint8_t)(2u * count);
    for (uint32_t i = 0; i < count; ++i) {
        put_word(out_reply + 2u + 2u * i, words[i]);
    }
    return 2u + 2u * count;
}

static enum modbus_exception write_registers(struct modbus_map *map, uint32_t address, uint32_t count,
                                             const uint8_t *bytes)
{
    uint16_t words[modbus_write_words_max];
    for (uint32_t i = 0; i < count; ++i) {
        words[i] = (uint16_t)word_at(bytes + 2u * i);
    }
    return modbus_map_write(map, address, count, words);
}

static uint32_t answer_read(struct modbus_map *map, const uint8_t *request, uint32_t size, uint8_t *out_reply)
{
    if (size != 5) {
        return refuse(request[0], modbus_exception_value, out_reply);
    }
    return read_registers(map, request[0], word_at(request + 1), word_at(request + 3), out_reply);
}

static uint32_t echo(const uint8_t *request, uint8_t *out_reply)
{
    for (uint32_t i = 0; i < 5; ++i) {
        out_reply[i] = request[i];
    }
    return 5;
}

static uint32_t answer_write_one(struct modbus_map *map, const uint8_t *request, uint32_t size, uint8_t *out_reply)
{
    enum modbus_exception exception = modbus_exception_value;
    if (size == 5) {
        exception = write_registers(map, word_at(request + 1), 1, request + 3);
    }
    return exception == modbus_exception_none ? echo(request, out_reply) : refuse(request[0], exception, out_reply);
}

static uint32_t answer_write_many(struct modbus_map *map, const uint8_t *request, uint32_t size, uint8_t *out_reply)
{
    enum modbus_exception exception = modbus_exception_value;
    uint32_t count = size >= 6 ? word_at(request + 3) : 0;
    if (count >= 1 && count <= modbus_write_words_max && request[5] == 2u * count && size == 6u + 2u * count) {
        exception = write_registers(map, word_at(request + 1), count, request + 6);
    }
    return exception == modbus_exception_none ? echo(request, out_reply) : refuse(request[0], exception, out_reply);
}

/// The write comes first. A read that cannot be answered is found before anything is written.
static uint32_t answer_read_write(struct modbus_map *map, const uint8_t *request, uint32_t size, uint8_t *out_reply)
{
    enum modbus_exception exception = modbus_exception_value;
    uint32_t writes = size >= 10 ? word_at(request + 7) : 0;
    uint32_t reads = size >= 10 ? word_at(request + 3) : 0;
    if (writes < 1 || writes > modbus_write_in_read_write_max || request[9] != 2u * writes ||
        size != 10u + 2u * writes || reads < 1 || reads > modbus_read_words_max) {
        return refuse(request[0], exception, out_reply);
    }
    uint16_t before[modbus_read_words_max];
    exception = modbus_map_read(map, word_at(request + 1), reads, before);
    if (exception == modbus_exception_none) {
        exception = write_registers(map, word_at(request + 5), writes, request + 10);
    }
    if (exception != modbus_exception_none) {
        return refuse(request[0], exception, out_reply);
    }
    return read_registers(map, request[0], word_at(request + 1), reads, out_reply);
}

bool modbus_pdu_writes(const uint8_t *request, uint32_t size)
{
    return size > 0 && (request[0] == modbus_function_write_one || request[0] == modbus_function_write_many ||
                        request[0] == modbus_function_read_write);
}

uint32_t modbus_pdu_answer(struct modbus_map *map, bool may_write, const uint8_t *request, uint32_t size,
                           uint8_t *out_reply)
{
    if (size == 0) {
        return 0;
    }
    if (!may_write && modbus_pdu_writes(request, size)) {
        return refuse(request[0], modbus_exception_busy, out_reply);
    }
    switch (request[0]) {
    case modbus_function_read_holding:
    case modbus_function_read_input:
        return answer_read(map, request, size, out_reply);
    case modbus_function_write_one:
        return answer_write_one(map, request, size, out_reply);
    case modbus_function_write_many:
        return answer_write_many(map, request, size, out_reply);
    case modbus_function_read_write:
        return answer_read_write(map, request, size, out_reply);
    default:
        return refuse(request[0], modbus_exception_function, out_reply);
    }
}
