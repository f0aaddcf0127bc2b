/* cmd_modes.c: `drape modes`: eigenfrequencies or buckling loads about a state of a scene; a table, and
 * frames that show each mode. */
#include "cli/shapes.h"

#include "base/pi.h"
#include "drape/lab.h"
#include "io/csv.h"
#include "io/json.h"

#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define TABLE          "modes.csv"
#define DEFAULT_FRAMES 60   /* of each mode */
#define DEFAULT_SIZE   0.05 /* of the scene, the largest displacement in a frame */

typedef struct modes_request {
    cli_command command;
    const char *state, *out;
    int count, frames; /* 0: not given */
    double amplitude;  /* [m] 0: not given */
    bool buckling, json;
} modes_request;

typedef struct job {
    const modes_request *request;
    cli_scene in;
    drape_modes modes;
} job;

/* ---- Tables ---- */

static const char *const kinds[] = {[DRAPE_MODE_VIBRATION] = "vibration",
                                    [DRAPE_MODE_ZERO] = "zero",
                                    [DRAPE_MODE_UNSTABLE] = "unstable",
                                    [DRAPE_MODE_BUCKLING] = "buckling"};

static int frames_of(const modes_request *request)
{
    return request->frames ? request->frames : DEFAULT_FRAMES;
}

static drape_status write_table(const job *j, drape_folder *folder)
{
    drape_file file = {0};
    drape_status status = drape_csv_open(
        j->in.ctx, folder, TABLE, "mode,kind,value,frequency,mass,residual,error,first_frame\n", &file);
    for (int32_t k = 0; !status && k < j->modes.count; k++) {
        const drape_mode *mode = &j->modes.modes[k];
        drape_file_print(&file, "%d", (int)k + 1);
        drape_csv_put_text(&file, kinds[mode->kind]);
        drape_csv_put_numbers(
            &file, 5, (double[]){mode->value, mode->frequency, mode->mass, mode->residual, mode->error});
        drape_csv_put_integer(&file, (int64_t)k * frames_of(j->request));
        drape_file_put_text(&file, "\n");
    }
    if (!status)
        status = drape_file_keep(&file);
    const drape_status closed = drape_file_close(&file);
    drape_file_destroy(&file);
    return status ? status : closed;
}

static int print_json(const job *j)
{
    errno = 0;
    json_t *list = json_array();
    for (int32_t k = 0; k < j->modes.count; k++) {
        const drape_mode *mode = &j->modes.modes[k];
        json_t *object =
            json_pack("{s:i, s:s, s:o, s:o, s:o, s:o, s:o}", "mode", (int)k + 1, "kind", kinds[mode->kind],
                      "value", drape_json_number(mode->value), "frequency",
                      drape_json_number(mode->frequency), "mass", drape_json_number(mode->mass), "residual",
                      drape_json_number(mode->residual), "error", drape_json_number(mode->error));
        list = drape_json_append(list, object);
    }
    json_t *all = json_pack("{s:o, s:I, s:o}", "modes", list, "eigenvalues_below", (json_int_t)j->modes.below,
                            "force", drape_json_number(j->modes.force));
    return cli_print_json(&j->request->command, all, JSON_INDENT(1) | JSON_REAL_PRECISION(17));
}

static void print_table(const job *j)
{
    const bool buckling = j->request->buckling;
    fputs(buckling ? "mode       load factor  residual     error\n"
                   : "mode  kind         omega^2 [1/s2]  frequency [Hz]    mass [kg]  residual     error\n",
          stdout);
    for (int32_t k = 0; k < j->modes.count; k++) {
        const drape_mode *mode = &j->modes.modes[k];
        printf("%4d  ", (int)k + 1);
        if (!buckling)
            printf("%-9s  ", kinds[mode->kind]);
        printf("%16.9g  ", mode->value);
        if (!buckling)
            printf("%14.9g  %11.5g  ", mode->frequency, mode->mass);
        printf("%8.1e  %8.1e\n", mode->residual, mode->error);
    }
    printf("force on a free node up to %.3g N; %lld eigenvalues counted up to the gap behind these modes\n",
           j->modes.force, (long long)j->modes.below);
}

/* ---- Frames ---- */

/* Frame i of n in one period of a mode: x + a sin(2 pi i/n) u. */
static drape_status emit_frames(const job *j)
{
    const int frames = frames_of(j->request);
    const size_t n = 3 * (size_t)drape_model_node_count(j->in.model);
    const double size =
        j->request->amplitude > 0 ? j->request->amplitude : DEFAULT_SIZE * j->in.model->length;
    double *start = drape_arena_take(j->request->command.arena, 3 * n, sizeof *start);
    if (!start)
        return DRAPE_E_MEMORY;
    double *x = start + n, *still = x + n;
    memcpy(start, drape_sim_positions(j->in.sim), n * sizeof *start);
    for (int64_t frame = 0; frame < (int64_t)j->modes.count * frames; frame++) {
        const double *shape = j->modes.modes[frame / frames].shape;
        const double share = size * sin(2 * DRAPE_PI * (double)(frame % frames) / frames);
        if (cli_interrupted())
            return DRAPE_E_STOPPED;
        for (size_t i = 0; i < n; i++)
            x[i] = start[i] + share * shape[i];
        drape_status status = drape_sim_set_state(j->in.sim, drape_sim_time(j->in.sim), x, still);
        if (!status)
            status = cli_shapes_emit(j->in.sim, frame);
        if (status)
            return status;
    }
    return DRAPE_OK;
}

/* ---- The verb ---- */

static int compute(job *j, const cli_state *state)
{
    const modes_request *request = j->request;
    drape_recorder *recorder = NULL;
    drape_modes_def def;
    drape_modes_def_init(&def, sizeof def);
    def.count = request->count ? request->count : def.count;
    def.buckling = request->buckling;
    def.load_factor = state->load_factor;
    drape_status status = cli_state_reach(state, &j->in);
    if (!status)
        status = drape_sim_modes(j->in.sim, &def, &j->modes);
    if (!status && request->out) {
        const cli_shapes shapes = {
            .folder = request->out, .table = TABLE, .frames = (int64_t)j->modes.count * frames_of(request)};
        status = cli_shapes_open(&request->command, &j->in, &shapes, &recorder);
    }
    if (!status && recorder)
        status = write_table(j, drape_recorder_folder(recorder));
    if (!status && recorder)
        status = emit_frames(j);
    if (!status && recorder)
        status = drape_recorder_finish(recorder);
    drape_recorder_destroy(&recorder);
    if (status && cli_interrupted())
        return cli_report_interrupted(request->command.verb);
    if (status)
        return cli_report(&request->command, status == DRAPE_E_ARGUMENT ? CLI_BAD_INPUT : CLI_FAILED);
    if (request->json)
        return print_json(j);
    print_table(j);
    return fflush(stdout) ? CLI_FAILED : CLI_DONE;
}

static int run(const void *command)
{
    const modes_request *request = command;
    job j = {.request = request};
    const cli_state *state = NULL;
    int code = cli_state_find(&request->command, request->state ? request->state : "static", &state);
    if (code == CLI_GO_ON)
        code = cli_shapes_check(&request->command, request->out);
    if (code == CLI_GO_ON)
        code = cli_state_load(&request->command, state, &j.in);
    if (code == CLI_GO_ON)
        code = compute(&j, state);
    drape_modes_free(&j.modes);
    cli_scene_free(&j.in);
    return code;
}

#define AT(member) offsetof(modes_request, member)
static const cli_option options[] = {
    {"count", CLI_NUMBER, "N", "number of modes (default 6)", AT(count), 100000},
    {"state", CLI_TEXT, "STATE", CLI_STATES " (default static)", AT(state)},
    {"buckling", CLI_FLAG, NULL, "factors of the scene's loads at which the cloth buckles", AT(buckling)},
    {"out", CLI_TEXT, "DIR",
     "folder for modes.csv, scene.json and frames of each mode; drape render draws it", AT(out)},
    {"frames", CLI_NUMBER, "N", "frames of each mode, over one period (default 60)", AT(frames), 100000},
    {"amplitude", CLI_REAL, "METRES", "largest displacement in a frame (default: a twentieth of the scene)",
     AT(amplitude)},
    {"json", CLI_FLAG, NULL, "print JSON", AT(json)},
};

const drape_verb drape_verb_modes = {
    .entry = {.name = "modes", .summary = "eigenfrequencies or buckling loads about a state of a scene"},
    .operand = "SCENE",
    .takes_scene = true,
    .details =
        "Finds the lowest undamped vibrations about a state, K u = omega^2 M u with the exact stiffness of\n"
        "that state, stress and loads included; with --buckling, the lowest factors of the scene's loads\n"
        "(gravity, load.line ...) at which K becomes singular, extrapolated linearly from that state: from\n"
        "the start, that is without loads, or from the equilibrium under all of them.\n"
        "With --out, DIR gets frames of one period of each mode, one after the other.",
    CLI_OPTIONS(options, modes_request),
    .run = run,
};
