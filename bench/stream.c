/* SPDX-License-Identifier: MIT */
/// Recordings that memory does not hold, through `servoscope frf` (bench/stream.sh): rows per second, bytes per second,
/// peak memory, and what the time goes into.
/// usage: stream write ROWS DIGITS        writes a recording to standard output
///        stream run LABEL BYTES ROWS COMMAND...   times a command: one line, and one of JSON on descriptor 3
///        stream parse FILE               reads it as `frf` does, and nothing else
#include "lab/numeric/statistics.h"
#include "lab/record/run_stream.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

/// Noise repeats after so many periods: what takes time is printing numbers, not drawing them.
enum { length = 2000, lines = 400, block_periods = 50, block_rows = length * block_periods };

static const double two_pi = 6.283185307179586476925;

static void stop(const char *what)
{
    fprintf(stderr, "stream: %s\n", what);
    exit(1);
}

/// One period of a flat multisine on bins 1 .. lines, phases after Schroeder.
static double *make_period(void)
{
    double *period = calloc(length, sizeof *period);
    if (!period) {
        stop("memory is short");
    }
    for (size_t k = 1; k <= lines; k++) {
        const double phase = two_pi * (double)(k * k) / (2.0 * lines);
        for (size_t n = 0; n < length; n++) {
            period[n] += 0.05 * cos(two_pi * (double)(k * n % length) / length - phase);
        }
    }
    return period;
}

static int write_recording(size_t rows, int digits)
{
    const size_t text_size = (size_t)block_rows * 96;
    char *text = malloc(text_size);
    char *at = text;
    double *period = make_period();
    double position = 0.0;
    double speed = 0.0;
    struct random random;
    random_seed(&random, 1);
    if (!text) {
        stop("memory is short");
    }
    printf("# sample_rate_hz: 1000\n# period_samples: %d\n# settle_periods: 1\n# excited_bins: [", length);
    for (int k = 1; k <= lines; k++) {
        printf(k > 1 ? ", %d" : "%d", k);
    }
    printf("]\ntorque_Nm,position_rad,velocity_rad_per_s\n");
    size_t *starts = malloc((block_rows + 1) * sizeof *starts);
    for (size_t n = 0; n < block_rows && starts; n++) {
        const double torque = period[n % length];
        starts[n] = (size_t)(at - text);
        at += snprintf(at, text_size - (size_t)(at - text), "%.*g,%.*g,%.*g\n", digits,
                       torque + 0.01 * random_normal(&random), digits, position + 1e-4 * random_normal(&random), digits,
                       speed + 0.1 * random_normal(&random));
        speed = 0.9 * speed + torque;
        position = 0.99 * position + 1e-3 * speed;
    }
    starts[block_rows] = (size_t)(at - text);
    for (size_t done = 0; done < rows; done += block_rows) {
        const size_t count = rows - done < block_rows ? rows - done : block_rows;
        if (fwrite(text, 1, starts[count], stdout) != starts[count]) {
            stop("cannot write");
        }
    }
    free(starts);
    free(period);
    free(text);
    return fflush(stdout) == 0 ? 0 : 1;
}

static int parse(const char *path)
{
    struct run_stream *stream;
    struct error error;
    int status = run_stream_open(path, NULL, &stream, &error);
    while (!status && !run_stream_ended(stream)) {
        run_stream_forget(stream);
        status = run_stream_fill(stream, 65536, &error);
    }
    if (status) {
        stop(error.message);
    }
    run_stream_close(stream);
    return 0;
}

static double wall_s(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static double seconds(struct timeval time)
{
    return (double)time.tv_sec + 1e-6 * (double)time.tv_usec;
}

static int time_command(const char *label, double bytes, double rows, char **command)
{
    const double start = wall_s();
    const pid_t child = fork();
    if (child == 0) {
        execvp(command[0], command);
        _exit(127);
    }
    int status = 1;
    struct rusage usage;
    if (child < 0 || waitpid(child, &status, 0) < 0 || status != 0 || getrusage(RUSAGE_CHILDREN, &usage) != 0) {
        stop("the command failed");
    }
    const double wall = wall_s() - start;
    const double processor = seconds(usage.ru_utime) + seconds(usage.ru_stime);
    const double memory = (double)usage.ru_maxrss / 1024.0;
    printf("%-34s %9.2f %9.2f %11.2f %8.0f %9.1f\n", label, wall, processor, 1e-6 * rows / wall, 1e-6 * bytes / wall,
           memory);
    fflush(stdout);
    dprintf(3, "{\"label\": \"%s\", \"wall_s\": %.4g, \"processor_s\": %.4g, \"memory_mib\": %.4g}\n", label, wall,
            processor, memory);
    return 0;
}

int main(int argc, char **argv)
{
    if (argc == 4 && strcmp(argv[1], "write") == 0) {
        return write_recording((size_t)strtoull(argv[2], NULL, 10), atoi(argv[3]));
    }
    if (argc == 3 && strcmp(argv[1], "parse") == 0) {
        return parse(argv[2]);
    }
    if (argc > 5 && strcmp(argv[1], "run") == 0) {
        return time_command(argv[2], atof(argv[3]), atof(argv[4]), argv + 5);
    }
    stop("expected write, parse or run");
    return 1;
}
