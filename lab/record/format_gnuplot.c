/* SPDX-License-Identifier: MIT */
/// A gnuplot script with the numbers in it: a plot that can be looked at at once (`gnuplot -p FILE.gp`) and changed at
/// will.
#include "lab/record/atomic_file.h"
#include "lab/record/format.h"
#include "lab/record/frf_file.h"
#include "lab/record/text_table.h"

#include <math.h>
#include <stdio.h>

static const double degrees = 57.29577951308232;

/// Names of columns in a title: gnuplot takes _ and ^ as marks of its own.
static void write_text(FILE *stream, const char *text)
{
    fputc('"', stream);
    for (; *text; text++) {
        if (*text == '"' || *text == '\\') {
            fputc('\\', stream);
        }
        fputc(*text, stream);
    }
    fputs("\" noenhanced", stream);
}

static void write_run(FILE *stream, const struct run *run)
{
    size_t panels = 0;
    fputs("$data << END\n", stream);
    for (size_t n = 0; n < run->rows; n++) {
        text_write_number(stream, (double)n / run->sample_rate_hz);
        for (size_t c = 0; c < run->column_count; c++) {
            fputc(' ', stream);
            if (isfinite(run->columns[c].data[n])) {
                text_write_number(stream, run->columns[c].data[n]);
            } else {
                fputs("NaN", stream);
            }
        }
        fputc('\n', stream);
    }
    fputs("END\n", stream);
    for (size_t c = 0; c < run->column_count; c++) {
        panels += run->columns[c].data != run_column(run, "time_s");
    }
    fprintf(stream, "set multiplot layout %zu,1\nset grid\nunset key\nset lmargin 12\n", panels ? panels : 1);
    for (size_t c = 0; c < run->column_count; c++) {
        if (run->columns[c].data == run_column(run, "time_s")) {
            continue;
        }
        fputs("set ylabel ", stream);
        write_text(stream, run->columns[c].name);
        fprintf(stream, "\n%splot $data using 1:%zu with lines\n", --panels == 0 ? "set xlabel \"time in s\"\n" : "",
                c + 2);
    }
    fputs("unset multiplot\n", stream);
}

static void write_response(FILE *stream, const struct frf *frf)
{
    char title[256];
    fputs("# frequency in Hz, magnitude in dB, std in dB of the magnitude, phase in degrees\n$data << END\n", stream);
    for (size_t line = 0; line < frf->count; line++) {
        const double magnitude = hypot(frf->real[line], frf->imag[line]);
        if (!frf->valid[line] || !(magnitude > 0.0)) {
            continue;
        }
        fprintf(stream, "%.12g %.9g %.6g %.9g\n", frf->frequency_hz[line], 20.0 * log10(magnitude),
                frf_known(frf->std[line]) ? 20.0 * log10(1.0 + frf->std[line] / magnitude) : 0.0,
                degrees * atan2(frf->imag[line], frf->real[line]));
    }
    fputs("END\nset multiplot layout 2,1\nset logscale x\nset grid\nunset key\nset lmargin 12\n"
          "set ylabel \"magnitude in dB\"\nset title ",
          stream);
    snprintf(title, sizeof title, "%s to %s", frf->input, frf->output);
    write_text(stream, title);
    fputs("\nplot $data using 1:2:3 with yerrorbars pointtype 7 pointsize 0.4\nunset title\n"
          "set ylabel \"phase in degrees\"\nset xlabel \"frequency in Hz\"\nset ytics 45\n"
          "plot $data using 1:4 with points pointtype 7 pointsize 0.4\nunset multiplot\n",
          stream);
}

static int write_gnuplot(const char *path, const struct record *record, struct format_notes *io_notes,
                         struct error *out_error)
{
    struct atomic_file file;
    FILE *stream = atomic_file_open(&file, path, out_error);
    if (!stream) {
        return error_refused;
    }
    fputs("# gnuplot -p FILE\n", stream);
    if (record->kind == record_run) {
        write_run(stream, &record->run);
    } else {
        write_response(stream, &record->frf);
    }
    format_notes_add(io_notes, format_lost, "keys: a script to look at has no place for them");
    return atomic_file_commit(&file, out_error);
}

const struct record_format record_format_gnuplot = {
    .name = "gnuplot",
    .summary = "a script with the numbers in it, to look at",
    .endings = {".gp", ".gnuplot", ".plt"},
    .write = write_gnuplot,
};
