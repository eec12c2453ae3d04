/* SPDX-License-Identifier: MIT */
/// servoscope convert: a run or a frequency response from one file format to another.
#include "lab/record/format.h"
#include "lab/record/json_out.h"
#include "tools/servoscope/command.h"
#include "tools/servoscope/options.h"
#include "tools/servoscope/outputs.h"

#include <stdio.h>
#include <string.h>

struct arguments {
    const char *to;
    const char *out; ///< of --out, or the second operand
    long long function;
    struct format_options reading;
    struct option_values files;
};

struct conversion {
    const char *in, *out;
    const struct record_format *from, *to;
    struct record record;
    struct format_notes notes;
};

static int read_options(int argc, char **argv, struct arguments *out, struct error *out_error)
{
    const struct option options[] = {
        {.name = "to", .kind = option_text, .target = &out->to},
        {.name = "out", .kind = option_text, .target = &out->out},
        {.name = "map", .kind = option_text, .target = &out->reading.run.map},
        {.name = "rate", .kind = option_positive, .target = &out->reading.run.rate_hz},
        {.name = "function", .kind = option_integer, .target = &out->function, .lowest = 1, .highest = 1e6},
    };
    const struct option_operands operands = {"IN OUT", 1, 2, &out->files};
    int status = options_parse(argc, argv, options, sizeof options / sizeof options[0], &operands, out_error);
    out->reading.function = (size_t)out->function;
    if (!status && (out->out != NULL) == (out->files.count == 2)) {
        return out->out ? error_set(out_error, error_usage, "OUT is given twice: '%s' and --out '%s'",
                                    out->files.items[1], out->out)
                        : error_set(out_error, error_usage,
                                    "IN OUT is missing: expected two files; see 'servoscope convert --help'");
    }
    if (!status && !out->out) {
        out->out = out->files.items[1];
    }
    return status;
}

/// The format of the result: --to, else what the name of the file ends in, as nothing else can say it.
static int choose_format(const struct arguments *arguments, const char *path, const struct record_format **out_format,
                         struct error *out_error)
{
    char names[256];
    format_list(false, sizeof names, names);
    *out_format = arguments->to ? format_by_name(arguments->to) : format_by_ending(path);
    if (*out_format) {
        return 0;
    }
    if (arguments->to) {
        return error_set(out_error, error_usage, "--to: '%s', expected %s", arguments->to, names);
    }
    return error_set(out_error, error_usage, "%s: its ending names no format: expected --to %s", path, names);
}

/// What the reader found out about the clock, where the file does not say its rate in so many words.
static void note_rate(const struct arguments *arguments, struct conversion *conversion)
{
    const struct run *run = &conversion->record.run;
    if (conversion->record.kind != record_run) {
        return;
    }
    if (arguments->reading.run.rate_hz > 0) {
        format_notes_add(&conversion->notes, format_assumed, "sample rate %.9g Hz, by --rate", run->sample_rate_hz);
    } else if (!run_key(run, "sample_rate_hz")) {
        format_notes_add(&conversion->notes, format_assumed, "sample rate %.9g Hz, from the mean time step",
                         run->sample_rate_hz);
    }
}

static int convert(const struct arguments *arguments, struct conversion *conversion, struct error *out_error)
{
    int status = format_by_content(conversion->in, &conversion->from, out_error);
    if (!status) {
        status = conversion->from->read(conversion->in, &arguments->reading, &conversion->record, &conversion->notes,
                                        out_error);
    }
    if (status) {
        return status;
    }
    if (conversion->record.kind == record_frf && (arguments->reading.run.map || arguments->reading.run.rate_hz > 0)) {
        return error_set(out_error, error_usage, "--%s is for runs: %s holds a frequency response",
                         arguments->reading.run.map ? "map" : "rate", conversion->in);
    }
    note_rate(arguments, conversion);
    return conversion->to->write(conversion->out, &conversion->record, &conversion->notes, out_error);
}

static const char *const note_names[] = {[format_assumed] = "assumed", [format_kept] = "kept", [format_lost] = "lost"};

static void print_summary(const struct conversion *conversion)
{
    const struct record *record = &conversion->record;
    if (record->kind == record_run) {
        printf("%s -> %s (%s to %s): run, %zu samples of %zu columns at %.9g Hz\n", conversion->in, conversion->out,
               conversion->from->name, conversion->to->name, record->run.rows, record->run.column_count,
               record->run.sample_rate_hz);
    } else {
        printf("%s -> %s (%s to %s): frequency response from %s to %s, %zu lines, %.6g..%.6g Hz\n", conversion->in,
               conversion->out, conversion->from->name, conversion->to->name, record->frf.input, record->frf.output,
               record->frf.count, record->frf.frequency_hz[0], record->frf.frequency_hz[record->frf.count - 1]);
    }
    for (size_t i = 0; i < conversion->notes.count; i++) {
        printf("  %s: %s\n", note_names[conversion->notes.items[i].kind], conversion->notes.items[i].text);
    }
    if (conversion->notes.dropped > 0) {
        printf("  and %zu more remarks\n", conversion->notes.dropped);
    }
}

static void add_notes(cJSON *object, const struct format_notes *notes, enum format_note kind)
{
    cJSON *list = cJSON_AddArrayToObject(object, note_names[kind]);
    for (size_t i = 0; i < notes->count; i++) {
        if (notes->items[i].kind == kind) {
            cJSON_AddItemToArray(list, cJSON_CreateString(notes->items[i].text));
        }
    }
}

static int print_json(const struct conversion *conversion, struct error *out_error)
{
    const struct record *record = &conversion->record;
    cJSON *object = cJSON_CreateObject();
    cJSON_AddStringToObject(object, "in", conversion->in);
    cJSON_AddStringToObject(object, "in_format", conversion->from->name);
    cJSON_AddStringToObject(object, "out", conversion->out);
    cJSON_AddStringToObject(object, "out_format", conversion->to->name);
    if (record->kind == record_run) {
        cJSON_AddStringToObject(object, "kind", "run");
        cJSON_AddNumberToObject(object, "rows", (double)record->run.rows);
        cJSON_AddNumberToObject(object, "sample_rate_hz", record->run.sample_rate_hz);
        cJSON *columns = cJSON_AddArrayToObject(object, "columns");
        for (size_t c = 0; c < record->run.column_count; c++) {
            cJSON_AddItemToArray(columns, cJSON_CreateString(record->run.columns[c].name));
        }
    } else {
        cJSON_AddStringToObject(object, "kind", "frf");
        cJSON_AddNumberToObject(object, "lines", (double)record->frf.count);
        cJSON_AddStringToObject(object, "input", record->frf.input);
        cJSON_AddStringToObject(object, "output", record->frf.output);
    }
    add_notes(object, &conversion->notes, format_assumed);
    add_notes(object, &conversion->notes, format_kept);
    add_notes(object, &conversion->notes, format_lost);
    cJSON_AddNumberToObject(object, "remarks_dropped", (double)conversion->notes.dropped);
    int status = json_print_stdout(object, out_error);
    cJSON_Delete(object);
    return status;
}

static int run(int argc, char **argv, const struct command_context *context, struct error *out_error)
{
    struct arguments arguments = {0};
    struct conversion conversion = {0};
    int status = read_options(argc, argv, &arguments, out_error);
    if (status) {
        return status;
    }
    conversion.in = arguments.files.items[0];
    conversion.out = arguments.out;
    status = choose_format(&arguments, conversion.out, &conversion.to, out_error);
    status = status ? status : outputs_check(&conversion.in, 1, &conversion.out, 1, out_error);
    status = status ? status : convert(&arguments, &conversion, out_error);
    if (!status && context->json) {
        status = print_json(&conversion, out_error);
    } else if (!status && !context->quiet && strcmp(conversion.out, "/dev/stdout") != 0) {
        print_summary(&conversion);
    }
    record_free(&conversion.record);
    format_notes_free(&conversion.notes);
    return status;
}

const struct command command_cmd_convert = {
    .name = "convert",
    .summary = "runs and frequency responses between CSV, MATLAB and universal files",
    .help =
        "servoscope convert: runs and frequency responses between CSV, MATLAB, universal and other programs' files\n"
        "\n"
        "usage: servoscope convert IN OUT [options]\n"
        "\n"
        "  IN                   its content says its format, plain or gzipped (but for .mat): those below,\n"
        "                       text exports of the TwinCAT Scope, tables of others: tabs, semicolons or commas,\n"
        "                       decimal commas, marks between thousands, times of day, UTF-16\n"
        "  OUT                  its ending says its format: .csv, .gp, .mat, .uff or .unv\n"
        "  --out OUT            the same, as other subcommands have it\n"
        "  --to FORMAT          whatever the ending:\n"
        "                       csv     servoscope's own files, the only ones that lose nothing\n"
        "                       gnuplot a script with the numbers in it, to look at: gnuplot -p FILE.gp\n"
        "                       mat     MATLAB, version 5\n"
        "                       mat73   MATLAB, version 7.3 (HDF5), for more than 2 GiB a signal\n"
        "                       uff     universal file, dataset 58 in text, 13 digits\n"
        "                       uff58b  universal file, dataset 58 in binary, all digits\n"
        "  --map NAME=COLUMN[*SCALE],...  --rate HZ    for recordings of others: COLUMN is what the file calls it,\n"
        "                       NAME time_s, torque_Nm, torque_ref_Nm, position_rad, velocity_rad_per_s, force_N,\n"
        "                       position_m, velocity_m_per_s, current_A, current_ref_A, valid (all: docs/files.md);\n"
        "                       the map takes the place of all guesses, and what it does not name stays as it is\n"
        "                       COLUMN in a .mat: a variable, log.speed a field, data:2 the second column of a matrix\n"
        "                       a unit in the header of a table counts unless the map gives a factor; of several\n"
        "                       sample times --rate chooses one\n"
        "  --function NUMBER    which of the frequency responses of a universal file\n"
        "\n"
        "What was assumed, what the format has no place for and where it was kept, and what is lost, is printed.\n"
        "\n"
        "example:\n"
        "  servoscope convert run.csv run.mat\n"
        "  servoscope convert export.csv run.csv\n"
        "  servoscope convert log.mat run.csv --map time_s=t,torque_Nm=i_q*0.31,position_rad=pos\n",
    .run = run,
};
