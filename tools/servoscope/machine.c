/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/machine.h"

#include <errno.h>
#include <fcntl.h>
#include <glob.h>
#include <linux/can.h>
#include <pthread.h>
#include <sched.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/utsname.h>
#include <time.h>
#include <unistd.h>

#include <dlfcn.h>

#ifndef SERVOSCOPE_VERSION
#define SERVOSCOPE_VERSION "0.1.0"
#endif

/// /sys/class/net/NAME/type of a CAN interface, and the bit of its flags that says it is up (ABI of the kernel).
enum { arphrd_can = 280, flag_up = 1 };

const char *machine_state_str(enum machine_state state)
{
    static const char *const names[] = {"good", "limited", "missing"};
    return names[state];
}

static void append(char *io_text, const char *more)
{
    const size_t length = strlen(io_text);
    snprintf(io_text + length, machine_text_max - length, "%s%s", length ? ", " : "", more);
}

/// First word of a small file; empty if it cannot be read.
static void read_word(const char *path, char *out_word, int size)
{
    FILE *file = fopen(path, "r");
    out_word[0] = '\0';
    if (file) {
        if (fgets(out_word, size, file)) {
            out_word[strcspn(out_word, "\n")] = '\0';
        }
        fclose(file);
    }
}

static void check_program(struct machine_check *out)
{
    struct utsname kernel;
    const bool known = uname(&kernel) == 0;
    snprintf(out->says, sizeof out->says, "servoscope %s on %s %s %s, %ld processors", SERVOSCOPE_VERSION,
             known ? kernel.sysname : "an unknown system", known ? kernel.release : "", known ? kernel.machine : "",
             sysconf(_SC_NPROCESSORS_ONLN));
}

static void check_can_kernel(struct machine_check *out)
{
    const int file = socket(PF_CAN, SOCK_RAW, CAN_RAW);
    if (file >= 0) {
        close(file);
        snprintf(out->says, sizeof out->says, "the kernel has SocketCAN");
        return;
    }
    out->state = machine_missing;
    snprintf(out->says, sizeof out->says, "the kernel opens no CAN socket: %s", strerror(errno));
    snprintf(out->remedy, sizeof out->remedy,
             "sudo modprobe can_raw; where the kernel has no such module (containers, WSL): a drive on slcan, or "
             "scripts/with-vcan COMMAND from servoscope's sources, which runs a kernel that has it");
}

/// Interfaces in /sys/class/net of type CAN, with their state.
static void check_can_interfaces(struct machine_check *out)
{
    glob_t found;
    char up[machine_text_max] = "";
    char down[machine_text_max] = "";
    if (glob("/sys/class/net/*", 0, NULL, &found) == 0) {
        for (size_t i = 0; i < found.gl_pathc; i++) {
            char path[512];
            char word[32];
            const char *name = strrchr(found.gl_pathv[i], '/') + 1;
            snprintf(path, sizeof path, "%s/type", found.gl_pathv[i]);
            read_word(path, word, sizeof word);
            if (strtol(word, NULL, 10) != arphrd_can) {
                continue;
            }
            snprintf(path, sizeof path, "%s/flags", found.gl_pathv[i]);
            read_word(path, word, sizeof word);
            append(strtol(word, NULL, 16) & flag_up ? up : down, name);
        }
        globfree(&found);
    }
    out->state = up[0] ? machine_good : machine_missing;
    if (up[0] || down[0]) {
        snprintf(out->says, sizeof out->says, "%s%.150s%s%s%.150s", up[0] ? "up: " : "", up,
                 up[0] && down[0] ? "; " : "", down[0] ? "down: " : "", down);
    } else {
        snprintf(out->says, sizeof out->says, "none");
    }
    if (!up[0]) {
        snprintf(out->remedy, sizeof out->remedy,
                 "an adapter: sudo ip link set can0 up type can bitrate 1000000; without hardware: sudo ip link add "
                 "vcan0 type vcan; sudo ip link set vcan0 up");
    }
}

static void check_serial(struct machine_check *out)
{
    static const char *const patterns[] = {"/dev/ttyUSB*", "/dev/ttyACM*", "/dev/serial/by-id/*"};
    char usable[machine_text_max] = "";
    char locked[machine_text_max] = "";
    for (size_t p = 0; p < sizeof patterns / sizeof patterns[0]; p++) {
        glob_t found;
        if (glob(patterns[p], 0, NULL, &found) != 0) {
            continue;
        }
        for (size_t i = 0; i < found.gl_pathc; i++) {
            append(access(found.gl_pathv[i], R_OK | W_OK) == 0 ? usable : locked, found.gl_pathv[i]);
        }
        globfree(&found);
    }
    out->state = locked[0] ? machine_limited : usable[0] ? machine_good : machine_missing;
    if (usable[0] || locked[0]) {
        snprintf(out->says, sizeof out->says, "%.150s%s%s%.150s", usable, usable[0] && locked[0] ? "; " : "",
                 locked[0] ? "without permission: " : "", locked);
    } else {
        snprintf(out->says, sizeof out->says, "no USB serial adapter (slcan, Modbus RTU)");
    }
    if (locked[0]) {
        snprintf(out->remedy, sizeof out->remedy, "sudo usermod -aG dialout $USER, then log in again");
    }
}

/// Tried in a thread of its own, so that this program stays what it was.
static void *try_fifo(void *result)
{
    const struct sched_param priority = {.sched_priority = 50};
    *(int *)result = pthread_setschedparam(pthread_self(), SCHED_FIFO, &priority);
    return NULL;
}

static void check_priority(struct machine_check *out)
{
    pthread_t thread;
    int result = EPERM;
    if (pthread_create(&thread, NULL, try_fifo, &result) == 0) {
        pthread_join(thread, NULL);
    }
    out->state = result == 0 ? machine_good : machine_limited;
    if (result == 0) {
        snprintf(out->says, sizeof out->says, "SCHED_FIFO is allowed");
        return;
    }
    snprintf(out->says, sizeof out->says, "SCHED_FIFO is refused: %s; other programs may delay a SYNC",
             strerror(result));
    snprintf(out->remedy, sizeof out->remedy,
             "a file in /etc/security/limits.d with '@realtime - rtprio 80' and '@realtime - memlock unlimited', your "
             "user in that group, then log in again");
}

static void check_memory_lock(struct machine_check *out)
{
    const rlim_t enough = (rlim_t)64 << 20;
    struct rlimit limit = {0, 0};
    const bool known = getrlimit(RLIMIT_MEMLOCK, &limit) == 0;
    const bool locks = geteuid() == 0 || (known && (limit.rlim_cur == RLIM_INFINITY || limit.rlim_cur >= enough));
    out->state = locks ? machine_good : machine_limited;
    if (locks) {
        snprintf(out->says, sizeof out->says, "memory may be locked");
        return;
    }
    snprintf(out->says, sizeof out->says,
             "only %llu KiB may be locked, 64 MiB are wanted; a page fault may delay a SYNC",
             (unsigned long long)limit.rlim_cur / 1024);
    snprintf(out->remedy, sizeof out->remedy, "'@realtime - memlock unlimited', as above");
}

static int compare_long(const void *a, const void *b)
{
    const long left = *(const long *)a;
    const long right = *(const long *)b;
    return (left > right) - (left < right);
}

/// How late an absolute sleep of 1 ms ends, without real-time rights: what a 1 kHz SYNC has to live with here.
static void check_clock(struct machine_check *out)
{
    enum { cycles = 400 };
    const long period_ns = 1000000;
    const long second_ns = 1000000000;
    long late_us[cycles];
    struct timespec next;
    clock_gettime(CLOCK_MONOTONIC, &next);
    for (int i = 0; i < cycles; i++) {
        struct timespec now;
        next.tv_nsec += period_ns;
        next.tv_sec += next.tv_nsec / second_ns;
        next.tv_nsec %= second_ns;
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &next, NULL);
        clock_gettime(CLOCK_MONOTONIC, &now);
        late_us[i] = (now.tv_sec - next.tv_sec) * 1000000 + (now.tv_nsec - next.tv_nsec) / 1000;
    }
    qsort(late_us, cycles, sizeof late_us[0], compare_long);
    const long median = late_us[cycles / 2];
    const long worst = late_us[cycles - 1];
    out->state = worst < period_ns / 2000 ? machine_good : machine_limited;
    snprintf(out->says, sizeof out->says,
             "1 kHz cycles come %ld us late in the median, %ld us at most (%d cycles, now)", median, worst, cycles);
    if (out->state == machine_limited) {
        snprintf(out->remedy, sizeof out->remedy,
                 "real-time rights (below), an idle machine, a kernel with PREEMPT_RT; or a lower rate of the table");
    }
}

static void check_matio(struct machine_check *out)
{
#ifdef SERVOSCOPE_MATIO_LIBRARY
    void *library = dlopen(SERVOSCOPE_MATIO_LIBRARY, RTLD_LAZY);
    if (library) {
        dlclose(library);
        snprintf(out->says, sizeof out->says, "%s is here: .mat can be read and written", SERVOSCOPE_MATIO_LIBRARY);
        return;
    }
    out->state = machine_missing;
    snprintf(out->says, sizeof out->says, "%s is not here: no .mat files", SERVOSCOPE_MATIO_LIBRARY);
    snprintf(out->remedy, sizeof out->remedy, "sudo apt install libmatio11");
#else
    out->state = machine_missing;
    snprintf(out->says, sizeof out->says, "built without matio: no .mat files");
    snprintf(out->remedy, sizeof out->remedy, "sudo apt install libmatio-dev, then build again");
#endif
}

size_t machine_check_all(struct machine_check out_checks[machine_checks_max])
{
    static const struct {
        const char *id;
        const char *what;
        void (*check)(struct machine_check *out);
    } all[] = {
        {"program", "program", check_program},
        {"can_kernel", "CAN in the kernel", check_can_kernel},
        {"can_interfaces", "CAN interfaces", check_can_interfaces},
        {"serial", "serial ports", check_serial},
        {"clock", "clock", check_clock},
        {"priority", "real-time priority", check_priority},
        {"memory_lock", "locked memory", check_memory_lock},
        {"matio", "MATLAB files", check_matio},
    };
    const size_t count = sizeof all / sizeof all[0];
    for (size_t i = 0; i < count; i++) {
        out_checks[i] = (struct machine_check){.id = all[i].id, .what = all[i].what, .state = machine_good};
        all[i].check(&out_checks[i]);
    }
    return count;
}
