/* SPDX-License-Identifier: MIT */
/// A simulated Modbus drive on a virtual clock, a table for it, and a link without a line, for tests.
#ifndef SERVOSCOPE_TESTS_MODBUS_BENCH_H
#define SERVOSCOPE_TESTS_MODBUS_BENCH_H

#include "core/bytes.h"
#include "core/crc32.h"
#include "drivers/modbus/host.h"
#include "drivers/modbus/pdu.h"
#include "sim/node/modbus_drive.h"

#include "unity.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    bench_rate = 2000,
    bench_samples = 500,
    bench_lines = 60,
    bench_bytes = msgen_header_bytes + 4 * bench_lines + 6 * bench_samples,
};

static const double bench_inertia_kgm2 = 0.00516;

static struct modbus_drive *bench_drive;
static struct sim_model bench_model;
static uint8_t bench_table[bench_bytes];
static struct msgen_table bench_view;

/// A rigid body with white noise on everything.
static inline void bench_make_model(void)
{
    sim_model_default(&bench_model);
    bench_model.structure = sim_structure_rigid;
    bench_model.motor_inertia_kgm2 = bench_inertia_kgm2;
    bench_model.load_inertia_kgm2 = 0.0;
    bench_model.coulomb_friction_Nm = 0.0;
    bench_model.sample_rate_hz = bench_rate;
    bench_model.process_noise_Nm = 0.01;
    bench_model.sensors.velocity_noise_rad_per_s = 0.01;
    bench_model.sensors.torque_noise_Nm = 0.01;
    bench_model.seed = 7;
}

/// 0.02 Nm on each of the lines 1 .. 60 with Schroeder's phases, and the motion of the rigid body under it.
static inline void bench_make_table(void)
{
    static const float scale[msgen_channels_max] = {2e-4f, 2e-4f, 2e-6f};
    const double two_pi = 6.283185307179586476925;
    uint8_t *data = bench_table + msgen_header_bytes, *at = data + 4 * bench_lines;
    memset(&bench_view, 0, sizeof bench_view);
    bench_view.rate_num_hz = bench_rate;
    bench_view.rate_den = 1;
    bench_view.period_samples = bench_samples;
    bench_view.bin_count = bench_lines;
    bench_view.channels = msgen_channels_max;
    bench_view.format = msgen_format_i16;
    for (unsigned c = 0; c < msgen_channels_max; c++) {
        union core_float_bits bits = {.value = scale[c]};
        bench_view.scale_bits[c] = bits.bits;
    }
    for (uint32_t b = 0; b < bench_lines; b++)
        core_put_u32(data + 4 * b, b + 1);
    for (unsigned n = 0; n < bench_samples; n++) {
        double value[msgen_channels_max] = {0.0, 0.0, 0.0};
        for (uint32_t b = 0; b < bench_lines; b++) {
            double omega = two_pi * (b + 1) * bench_rate / bench_samples;
            double angle = two_pi * (b + 1) * n / bench_samples - 0.5 * two_pi * b * (b + 1) / bench_lines;
            value[0] += 0.02 * cos(angle);
            value[1] += 0.02 / bench_inertia_kgm2 / omega * sin(angle);
            value[2] -= 0.02 / bench_inertia_kgm2 / (omega * omega) * cos(angle);
        }
        for (unsigned c = 0; c < msgen_channels_max; c++, at += 2)
            core_put_u16(at, (uint16_t)(int16_t)lrint(value[c] / (double)scale[c]));
    }
    bench_view.data_crc32 = core_crc32(0, data, (size_t)(at - data));
    TEST_ASSERT_EQUAL_INT(core_ok, msgen_table_encode_header(&bench_view, bench_table));
    TEST_ASSERT_EQUAL_INT(core_ok, msgen_table_open(bench_table, bench_bytes, &bench_view));
}

static inline void bench_begin(void)
{
    bench_make_model();
    bench_make_table();
    bench_drive = malloc(sizeof *bench_drive);
    TEST_ASSERT_NOT_NULL(bench_drive);
    TEST_ASSERT_EQUAL_INT(core_ok, modbus_drive_init(bench_drive, &bench_model));
    modbus_drive_step(bench_drive); // a drive that is switched on has measured something
}

static inline void bench_end(void)
{
    free(bench_drive);
    bench_drive = NULL;
}

static inline void bench_run(uint32_t samples)
{
    for (uint32_t n = 0; n < samples; n++)
        modbus_drive_step(bench_drive);
}

static inline struct modbus_host_setup bench_setup(uint32_t settle, uint32_t periods)
{
    struct modbus_host_setup setup = {
        .table_bytes = bench_bytes,
        .table_name = bench_view.header_crc32,
        .run = {.mode = 0,
                .input = modbus_channel_torque,
                .output = modbus_channel_velocity,
                .settle_periods = settle,
                .measure_periods = periods,
                .fade_samples = 200,
                .abort_samples = 200,
                .host_timeout_ms = 2000,
                .torque_limit = 5.0f},
    };
    return setup;
}

// ---- A link without a line: every request is answered at once, waiting lets the drive run.

static inline int bench_pdu(uint8_t *request, uint32_t size, uint32_t count, uint16_t *out_words)
{
    uint8_t reply[modbus_pdu_max];
    modbus_pdu_answer(&bench_drive->map, true, request, size, reply);
    if (reply[0] & 0x80u)
        return reply[1];
    for (uint32_t i = 0; out_words && i < count; i++)
        out_words[i] = (uint16_t)((unsigned)reply[2 + 2 * i] << 8 | reply[3 + 2 * i]);
    return modbus_link_ok;
}

static inline void bench_put(uint8_t *at, uint32_t word)
{
    at[0] = (uint8_t)(word >> 8);
    at[1] = (uint8_t)word;
}

static inline int bench_read(void *self, uint32_t address, uint32_t count, uint16_t *out_words)
{
    uint8_t request[5] = {modbus_function_read_holding};
    (void)self;
    bench_put(request + 1, address);
    bench_put(request + 3, count);
    return bench_pdu(request, sizeof request, count, out_words);
}

static inline int bench_write(void *self, uint32_t address, uint32_t count, const uint16_t *words)
{
    uint8_t request[modbus_pdu_max] = {modbus_function_write_many};
    (void)self;
    bench_put(request + 1, address);
    bench_put(request + 3, count);
    request[5] = (uint8_t)(2 * count);
    for (uint32_t i = 0; i < count; i++)
        bench_put(request + 6 + 2 * i, words[i]);
    return bench_pdu(request, 6 + 2 * count, 0, NULL);
}

static inline int bench_exchange(void *self, uint32_t write_address, uint32_t write_count, const uint16_t *words,
                                 uint32_t read_address, uint32_t read_count, uint16_t *out_words)
{
    uint8_t request[modbus_pdu_max] = {modbus_function_read_write};
    (void)self;
    bench_put(request + 1, read_address);
    bench_put(request + 3, read_count);
    bench_put(request + 5, write_address);
    bench_put(request + 7, write_count);
    request[9] = (uint8_t)(2 * write_count);
    for (uint32_t i = 0; i < write_count; i++)
        bench_put(request + 10 + 2 * i, words[i]);
    return bench_pdu(request, 10 + 2 * write_count, read_count, out_words);
}

static inline int bench_settle(void *self)
{
    (void)self;
    return modbus_link_ok;
}

static inline void bench_wait(void *self, uint32_t ms)
{
    (void)self;
    bench_run(ms * bench_rate / 1000);
}

static inline const char *bench_name(const void *self)
{
    (void)self;
    return "bench";
}

static const struct modbus_link bench_link = {NULL,         bench_read, bench_write, bench_exchange,
                                              bench_settle, bench_wait, bench_name};

/// Waits, with a sign of life, until the drive is neither settling nor running nor stopping.
static inline void bench_follow(struct modbus_host *host, struct modbus_host_state *out_state)
{
    for (int i = 0; i < 1000; i++) {
        TEST_ASSERT_EQUAL_INT(modbus_host_ok, modbus_host_read_state(host, out_state));
        if (out_state->state == modbus_state_done || out_state->state == modbus_state_fault)
            return;
        bench_wait(NULL, 20);
    }
    TEST_FAIL_MESSAGE("the run does not end");
}

/// Up to START, through the host's side.
static inline void bench_start(struct modbus_host *host, const struct modbus_host_setup *setup)
{
    TEST_ASSERT_EQUAL_INT_MESSAGE(modbus_host_ok, modbus_host_open(host, &bench_link, 1), host->detail);
    TEST_ASSERT_EQUAL_INT_MESSAGE(modbus_host_ok, modbus_host_upload(host, bench_table, setup, NULL, NULL),
                                  host->detail);
    TEST_ASSERT_EQUAL_INT_MESSAGE(modbus_host_ok, modbus_host_command(host, modbus_command_arm), host->detail);
    TEST_ASSERT_EQUAL_INT_MESSAGE(modbus_host_ok, modbus_host_command(host, modbus_command_start), host->detail);
}

#endif
