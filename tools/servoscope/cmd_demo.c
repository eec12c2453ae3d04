/* SPDX-License-Identifier: MIT */
/// servoscope demo: the whole story without hardware, from limits to a named cause, each step through the files that
/// the other subcommands read and write.
#include "lab/design/lines.h"
#include "lab/diagnose/diagnosis.h"
#include "lab/diagnose/wording.h"
#include "lab/estimate/method.h"
#include "lab/estimate/periodic.h"
#include "lab/record/frf_file.h"
#include "lab/record/json_out.h"
#include "lab/record/model_file.h"
#include "ports/wall_clock.h"
#include "tools/servoscope/command.h"
#include "tools/servoscope/demo_page.h"
#include "tools/servoscope/designing.h"
#include "tools/servoscope/door.h"
#include "tools/servoscope/hiding.h"
#include "tools/servoscope/measuring.h"
#include "tools/servoscope/options.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { path_size = 4096, settle_periods = 1, counted_periods = 10 };

/// The axis of the first paper.
static const double rate_hz = 1000.0;
static const size_t period_samples = 2000;
static const double inertia_kgm2 = 0.00516;
static const double pulley_radius_m = 0.0159;
static const double velocity_limit_m_per_s = 0.05;
static const double torque_limit_Nm = 1.0;
static const char lines_specification[] = "linear:0.5:100:0.5";

/// Two excitations of the same axis: other methods, other phases, another level.
static const char *const methods[demo_runs] = {"fast", "clip"};

struct demo {
    const char *folder;
    long long seed;
    const struct command_context *context;
    double started_s;
    bool progress_shown;
    struct design_lines lines;
    struct hiding hiding;
    struct run runs[demo_runs];
    struct design_request requests[demo_runs];
    struct design_result designs[demo_runs];
    struct door_statistics bus;
    struct frf response;
    struct diagnosis diagnosis;
};

/// A line of the story, with the seconds since the beginning.
#if defined(__GNUC__)
__attribute__((format(printf, 2, 3)))
#endif
static void
tell(const struct demo *self, const char *format, ...)
{
    va_list arguments;
    if (self->context->quiet || self->context->json) {
        return;
    }
    va_start(arguments, format);
    printf("%5.1f s  ", wall_clock_now_s() - self->started_s);
    vprintf(format, arguments);
    putchar('\n');
    fflush(stdout);
    va_end(arguments);
}

static const char *in_folder(const struct demo *self, const char *name, char out_path[path_size])
{
    snprintf(out_path, path_size, "%s/%s", self->folder, name);
    return out_path;
}

static int make_folder(const struct demo *self, struct error *out_error)
{
    const size_t longest_name = 32;
    struct stat status;
    if (strlen(self->folder) + longest_name > path_size) {
        return error_set(out_error, error_usage, "--out: a path of %zu characters is too long", strlen(self->folder));
    }
    if (mkdir(self->folder, 0777) != 0 && errno != EEXIST) {
        return error_set(out_error, error_refused, "%s: cannot be made: %s", self->folder, strerror(errno));
    }
    if (stat(self->folder, &status) != 0 || !S_ISDIR(status.st_mode)) {
        return error_set(out_error, error_refused, "%s is there, but is no folder", self->folder);
    }
    return access(self->folder, W_OK) == 0
               ? 0
               : error_set(out_error, error_refused, "%s: cannot be written: %s", self->folder, strerror(errno));
}

// ---- Excitation

static int design(struct demo *self, struct error *out_error)
{
    static const char *const names[demo_runs] = {"excitation1", "excitation2"};
    const struct design_line_grid grid = {.rate_hz = rate_hz, .period_samples = period_samples};
    int status = design_lines_parse(lines_specification, &grid, 1, &self->lines, out_error);
    for (size_t r = 0; r < demo_runs && !status; r++) {
        char prefix[path_size];
        struct design_request *request = &self->requests[r];
        *request = (struct design_request){
            .rate_num_hz = (uint32_t)rate_hz,
            .rate_den = 1,
            .period_samples = period_samples,
            .bin_count = self->lines.count,
            .bins = self->lines.bins,
            .limits = {.velocity_rad_per_s = velocity_limit_m_per_s / pulley_radius_m, .torque_Nm = torque_limit_Nm},
            .inertia_kgm2 = inertia_kgm2,
            .method = methods[r],
            .grid = design_grid_continuous,
            .start = design_start_paper,
            .starts = 1, // the story is told in seconds, and one start is within 1 % of the best
            .seed = 1,
        };
        status = design_run(request, &self->designs[r], out_error);
        status =
            status ? status : designing_write(in_folder(self, names[r], prefix), request, &self->designs[r], out_error);
    }
    if (!status) {
        tell(self, "designed two multisines, %zu lines to 100 Hz, within %g Nm and %g m/s: %.3f and %.3f Nm effective",
             self->lines.count, torque_limit_Nm, velocity_limit_m_per_s, self->designs[0].effective_torque_Nm,
             self->designs[1].effective_torque_Nm);
    }
    return status;
}

// ---- The drive

static int write_answer(const struct demo *self, struct error *out_error)
{
    char path[path_size];
    cJSON *answer = hiding_json(&self->hiding);
    cJSON_AddNumberToObject(answer, "seed", (double)self->seed);
    cJSON_AddStringToObject(answer, "nominal_model", "nominal.json");
    cJSON_AddStringToObject(answer, "drive_model", "drive.json");
    int status = json_write(in_folder(self, "hidden.json", path), answer, out_error);
    cJSON_Delete(answer);
    return status;
}

static int hide(struct demo *self, struct error *out_error)
{
    char path[path_size];
    struct table_bytes table;
    int status = table_bytes_read(in_folder(self, "excitation1.mst", path), &table, out_error);
    if (status) {
        return status;
    }
    status = hiding_choose((uint64_t)self->seed, &table.view, &self->hiding, out_error);
    table_bytes_free(&table);
    if (!status) {
        const struct sim_model *nominal = &self->hiding.nominal_model;
        status = model_file_write(in_folder(self, "nominal.json", path), nominal, NULL, out_error);
    }
    if (!status) {
        const struct sim_model *drive = &self->hiding.drive_model;
        status = model_file_write(in_folder(self, "drive.json", path), drive, NULL, out_error);
    }
    status = status ? status : write_answer(self, out_error);
    if (!status) {
        tell(self, "hid an effect in a copy of nominal.json (--seed %lld): that model now misses %.1f %% of the torque",
             self->seed, 100.0 * self->hiding.torque_share);
    }
    return status;
}

// ---- Measurement

/// Over files, as `measure` and `frf` do it: what is shown is what anybody gets.
static int measure_one(struct demo *self, size_t number, const char *table, const char *out, struct error *out_error)
{
    char table_path[path_size], out_path[path_size], drive_path[path_size];
    const struct command_context silent = {.quiet = true};
    struct measuring_request request;
    struct measuring measuring;
    struct door door;
    measuring_defaults(&request);
    request.table = in_folder(self, table, table_path);
    request.out = in_folder(self, out, out_path);
    request.settle = settle_periods;
    request.periods = counted_periods;
    int status = measuring_prepare(&request, &measuring, out_error);
    if (status) {
        return status;
    }
    // Another day: other noise.
    struct sim_model drive = self->hiding.drive_model;
    drive.seed += number;
    status = door_open("sim:", &drive, &door, out_error);
    if (!status) {
        measuring.door = &door;
        status = measuring_run(&measuring, &door.drive, in_folder(self, "drive.json", drive_path), &silent, out_error);
        door_read_statistics(&door, &self->bus);
        door_close(&door);
    }
    measuring_free(&measuring);
    return status ? status : run_read(out_path, NULL, &self->runs[number], out_error);
}

static int measure(struct demo *self, struct error *out_error)
{
    int status = measure_one(self, 0, "excitation1.mst", "run1.csv", out_error);
    status = status ? status : measure_one(self, 1, "excitation2.mst", "run2.csv", out_error);
    if (!status) {
        tell(self,
             "measured each over CAN (CiA 402 cyclic synchronous position): %d settling and %d counted periods, %lu "
             "frames, bus load %.0f %%",
             settle_periods, counted_periods, (unsigned long)self->bus.frames, 100.0 * self->bus.bus_load);
    }
    return status;
}

static int estimate(struct demo *self, struct error *out_error)
{
    char path[path_size];
    const struct periodic_options options = {.settle = periodic_settle_default};
    const struct estimate_method *method = estimate_method_find("mean", out_error);
    struct periodic recording;
    int status = method ? periodic_cut(&self->runs[0], &options, &recording, out_error) : error_usage;
    if (status) {
        return status;
    }
    status = method->estimate(&recording, NULL, &self->response, out_error);
    periodic_free(&recording);
    status = status ? status : frf_write(in_folder(self, "frf.csv", path), &self->response, out_error);
    if (!status) {
        tell(self, "estimated the frequency response, %zu lines, mean of %zu periods with standard deviation",
             self->response.count, self->response.periods);
    }
    return status;
}

// ---- Diagnosis

/// One line on a terminal, overwritten by the next.
static bool show_progress(void *user, const char *what)
{
    struct demo *self = user;
    if (self->context->terminal && !self->context->quiet && !self->context->json) {
        fprintf(stderr, "\r\033[K         %.100s", what);
        self->progress_shown = true;
    }
    return true;
}

static int write_diagnosis(const struct demo *self, struct error *out_error)
{
    char path[path_size];
    cJSON *object = diagnosis_json(&self->diagnosis);
    if (!object) {
        return error_set(out_error, error_refused, "memory is short for d.json");
    }
    int status = json_write(in_folder(self, "d.json", path), object, out_error);
    cJSON_Delete(object);
    return status ? status
                  : model_file_write(in_folder(self, "extended.json", path), &self->diagnosis.extended_model,
                                     &self->diagnosis.deviations, out_error);
}

static int diagnose(struct demo *self, struct error *out_error)
{
    const struct diagnosis_request request = {
        .fit = &self->runs[0],
        .fit_count = 1,
        .validate = &self->runs[1],
        .validate_count = 1,
        .model = &self->hiding.nominal_model,
        .progress = show_progress,
        .user = self,
    };
    int status = diagnosis_run(&request, &self->diagnosis, out_error);
    if (self->progress_shown) {
        fputs("\r\033[K", stderr);
    }
    status = status ? status : write_diagnosis(self, out_error);
    if (!status) {
        char headline[wording_size];
        wording_headline(&self->diagnosis, headline);
        tell(self, "diagnosed run1.csv against nominal.json, validated on run2.csv: %s", headline);
    }
    return status;
}

// ---- The end of the story

/// Each model is measured as the drive was, without noise: its response then has the friction of this excitation in it.
static int write_page(struct demo *self, struct error *out_error)
{
    char path[path_size];
    struct table_bytes table;
    int status = table_bytes_read(in_folder(self, "excitation1.mst", path), &table, out_error);
    if (status) {
        return status;
    }
    const struct demo_page page = {
        .seed = self->seed,
        .hiding = &self->hiding,
        .request = &self->requests[0],
        .design = &self->designs[0],
        .table = &table.view,
        .runs = self->runs,
        .bus = &self->bus,
        .measured = &self->response,
        .diagnosis = &self->diagnosis,
    };
    status = demo_page_write(in_folder(self, "report.html", path), &page, out_error);
    table_bytes_free(&table);
    return status;
}

static void print_end(const struct demo *self)
{
    char text[wording_size];
    const struct diagnosis *d = &self->diagnosis;
    hiding_describe(&self->hiding, sizeof text, text);
    printf("\nhidden: %s\n", text);
    for (size_t i = 0; i < d->cause_count; i++) {
        printf("%s %s: %s\n", i == 0 ? "found: " : "       ", sim_effects[d->causes[i].effect]->id, d->causes[i].says);
    }
    if (d->cause_count == 0) {
        wording_headline(d, text);
        printf("found:  %s\n", text);
    }
    wording_gain(d, text);
    printf("gain:   %s\nopen:   %s/report.html\n", text, self->folder);
}

static int print_json(const struct demo *self, struct error *out_error)
{
    const struct diagnosis *d = &self->diagnosis;
    char path[path_size];
    cJSON *object = cJSON_CreateObject();
    cJSON_AddNumberToObject(object, "seed", (double)self->seed);
    cJSON_AddItemToObject(object, "hidden", hiding_json(&self->hiding));
    cJSON_AddStringToObject(object, "verdict", diagnosis_verdict_str(d->verdict));
    cJSON *found = cJSON_AddArrayToObject(object, "found");
    for (size_t i = 0; i < d->cause_count; i++) {
        cJSON_AddItemToArray(found, cJSON_CreateString(sim_effects[d->causes[i].effect]->id));
    }
    cJSON *nrmse = cJSON_AddObjectToObject(object, "validation_nrmse");
    cJSON_AddNumberToObject(nrmse, "nominal", d->nominal.validation_nrmse);
    cJSON_AddNumberToObject(nrmse, "refitted", d->refitted.validation_nrmse);
    cJSON_AddNumberToObject(nrmse, "extended", d->extended.validation_nrmse);
    cJSON_AddNumberToObject(nrmse, "noise_floor", d->noise_floor_nrmse);
    cJSON_AddStringToObject(object, "folder", self->folder);
    cJSON_AddStringToObject(object, "open", in_folder(self, "report.html", path));
    cJSON_AddNumberToObject(object, "seconds", wall_clock_now_s() - self->started_s);
    int status = json_print_stdout(object, out_error);
    cJSON_Delete(object);
    return status;
}

static void free_demo(struct demo *self)
{
    for (size_t r = 0; r < demo_runs; r++) {
        design_result_free(&self->designs[r]);
        run_free(&self->runs[r]);
    }
    frf_free(&self->response);
    diagnosis_free(&self->diagnosis);
    design_lines_free(&self->lines);
}

static int run(int argc, char **argv, const struct command_context *context, struct error *out_error)
{
    static struct demo demo; // too large for some stacks
    demo = (struct demo){.folder = "servoscope-demo", .seed = 1, .context = context, .started_s = wall_clock_now_s()};
    const struct option options[] = {
        {.name = "seed", .kind = option_integer, .target = &demo.seed, .lowest = 0, .highest = 9e15},
        {.name = "out", .kind = option_text, .target = &demo.folder},
    };
    static int (*const steps[])(struct demo * self, struct error * out_error) = {design,   hide,     measure,
                                                                                 estimate, diagnose, write_page};
    int status = options_parse(argc, argv, options, sizeof options / sizeof options[0], NULL, out_error);
    status = status ? status : make_folder(&demo, out_error);
    for (size_t i = 0; i < sizeof steps / sizeof steps[0] && !status; i++) {
        status = steps[i](&demo, out_error);
    }
    if (!status && context->json) {
        status = print_json(&demo, out_error);
    } else if (!status && !context->quiet) {
        print_end(&demo);
    }
    free_demo(&demo);
    return status;
}

const struct command command_cmd_demo = {
    .name = "demo",
    .summary = "the whole story without hardware: design, measure over CAN, diagnose, report",
    .help =
        "servoscope demo: the whole story without hardware\n"
        "\n"
        "usage: servoscope demo [--seed S] [--out FOLDER]\n"
        "\n"
        "Designs two multisines for a belt drive, hides an effect in a simulated drive, measures it twice over a CAN "
        "bus\n"
        "inside the program, estimates its frequency response, finds out what the nominal model gets wrong, and "
        "measures\n"
        "the gain on the second run, which the fit has not seen.\n"
        "\n"
        "  --seed S             chooses effect, size and noise (default 1); the next seed hides another effect\n"
        "  --out FOLDER         made if it is not there (default servoscope-demo)\n"
        "\n"
        "Files in FOLDER:\n"
        "  report.html          the page to open\n"
        "  excitation1.mst, .csv, .h and excitation2.*    the tables\n"
        "  nominal.json         the model that is believed\n"
        "  drive.json           the drive that was measured: nominal.json with the effect in it\n"
        "  hidden.json          the answer: which effect, with which parameters\n"
        "  run1.csv, run2.csv   the recordings; frf.csv: the frequency response of the first\n"
        "  d.json               the diagnosis; extended.json: the model with the causes found\n"
        "Each can be used on its own, e.g.\n"
        "  servoscope diagnose run1.csv --validate run2.csv --model nominal.json\n"
        "  servoscope measure --drive sim:drive.json --table excitation1.mst --periods 10 --out run.csv\n"
        "\n"
        "example:\n"
        "  servoscope demo --seed 2\n",
    .run = run,
};
