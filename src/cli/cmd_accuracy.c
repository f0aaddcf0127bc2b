/* cmd_accuracy.c: `drape accuracy`: how far the run of a scene is off, and until when it is predictable. */
#include "cli/cli.h"

#include "accuracy/accuracy.h"
#include "accuracy/assess.h"
#include "io/json.h"
#include "io/summary.h"
#include "model/scene.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>

#define RUNS DRAPE_ASSESS_RUNS

typedef struct accuracy_request {
    cli_command command;
    bool json;
} accuracy_request;

typedef struct accuracy {
    const accuracy_request *request;
    cli_scene in;
    drape_model *fine;
    cli_progress progress;
    drape_assessment result;
} accuracy;

/* In the order of the lines. */
static const struct {
    const char *name;
    int number;
} lines[RUNS] = {
    {"time", DRAPE_ASSESS_BY_TIME}, {"mesh", DRAPE_ASSESS_BY_MESH}, {"start", DRAPE_ASSESS_BY_START}};

/* The scene with all meshes subdivided once more, and the stiffness of contact that it has now, whose default
 * depends on edges. */
static drape_status compile_fine(accuracy *a)
{
    drape_scene *scene = a->in.scene;
    drape_scene_def def;
    drape_scene_def_init(&def, sizeof def);
    drape_status status = drape_scene_to_def(scene, &def);
    const size_t cloths = def.cloth_count;
    for (size_t c = 0; c < cloths && !status; c++) {
        const int times = a->in.model->cloths[c].mesh.subdivided + 1;
        status =
            drape_scene_set(scene, DRAPE_FORMAT("/cloth/%zu/mesh/subdivide", c), DRAPE_FORMAT("%d", times));
    }
    if (!status && a->in.model->contact.stiffness > 0)
        status = drape_scene_set(scene, "/contact/stiffness",
                                 DRAPE_FORMAT("%.17g", a->in.model->contact.stiffness));
    return status ? status : drape_scene_compile(scene, &a->fine);
}

/* ---- Progress ---- */

/* What it costs is said before: on stdout, if that is text. */
static void say(const accuracy *a, const char *format, double first, double second)
{
    if (!a->request->json)
        printf(format, first, second);
    fflush(stdout);
}

static drape_status watch(void *user, const drape_event *event)
{
    accuracy *a = user;
    if (event->kind == DRAPE_EVENT_ATTEMPT)
        cli_progress_show(&a->progress, event->sim);
    return cli_interrupted() ? DRAPE_E_STOPPED : DRAPE_OK;
}

static drape_status begin(void *user, drape_sim *sim, int number, const drape_assessment *so_far)
{
    accuracy *a = user;
    cli_signals_cancel(NULL);
    cli_progress_clear(&a->progress);
    if (cli_interrupted())
        return DRAPE_E_STOPPED;
    if (number == DRAPE_ASSESS_BY_START)
        say(a, "cost  %.3g s of CPU time for the run, at most %.3g s for the other three\n", so_far->seconds,
            fmax(DRAPE_ASSESS_LEAST, (DRAPE_ASSESS_COST - 1) * so_far->seconds));
    cli_progress_begin(&a->progress, sim, so_far->until);
    cli_progress_hide(&a->progress);
    for (int i = 0; i < RUNS && a->progress.on; i++)
        if (lines[i].number == number)
            fprintf(stderr, "%s\n", lines[i].name);
    cli_signals_cancel(sim);
    return drape_sim_observe(sim, watch, a);
}

/* ---- The result ---- */

static void tell(const accuracy *a, int number, char *text, size_t size)
{
    const drape_assessment *r = &a->result;
    const drape_accuracy *by = &r->by[number];
    const bool ends = !(r->until < a->in.model->duration);
    char measured[512];
    cli_accuracy_text(a->in.model, by, measured, sizeof measured);
    if (!by->reached)
        snprintf(text, size, "not known: %s%s%s", r->why[number],
                 isnan(by->error) ? "" : DRAPE_FORMAT("; until t=%.4g s off by ", by->until),
                 isnan(by->error) ? "" : measured);
    else if (number != DRAPE_ASSESS_BY_START)
        snprintf(text, size, "by estimate, off by %s; until t=%.4g s", measured, by->until);
    else
        snprintf(text, size, "predictable until t=%.4g s%s: starts that differ by %.0e of the diagonal %s %s",
                 r->until, ends ? ", the end" : "", DRAPE_ASSESS_START,
                 ends ? "are apart by" : "part after that, by", measured);
}

static int print_result(const accuracy *a)
{
    const drape_assessment *r = &a->result;
    double all = r->seconds;
    bool known = true;
    errno = 0;
    json_t *json = DRAPE_JSON_REALS(json_object(), {"cpu_s", r->seconds}, {"within", r->within},
                                    {"predictable_until", r->until}, {"start_differs", DRAPE_ASSESS_START});
    json = drape_json_with(json, "method", drape_json_text(r->method));
    json = drape_json_with(json, "hash", drape_json_text(DRAPE_FORMAT("%016" PRIx64, r->hash)));
    for (int i = 0; i < RUNS; i++) {
        char text[DRAPE_MESSAGE_SIZE];
        const drape_accuracy *by = &r->by[lines[i].number];
        tell(a, lines[i].number, text, sizeof text);
        all += by->seconds;
        known = known && by->reached;
        json_t *line =
            drape_json_with(drape_summary_accuracy(a->in.model, by), "text", drape_json_text(text));
        json = drape_json_with(json, lines[i].name, line);
        if (!a->request->json)
            printf("%-5s %s\n", lines[i].name, text);
    }
    if (!a->request->json)
        printf("cost  %.3g times the CPU time of the run, by %s\n", all / r->seconds, r->method);
    const int code = a->request->json ? cli_print_json(&a->request->command, json, JSON_INDENT(1)) : CLI_DONE;
    if (!a->request->json)
        json_decref(json);
    return code == CLI_DONE && !known ? CLI_FAILED : code;
}

static int assess(accuracy *a)
{
    const cli_command *command = &a->request->command;
    drape_sim_def def;
    drape_sim_def_init(&def, sizeof def);
    def.threads = command->threads ? command->threads : 1;
    say(a, "cost  four runs, at most %.0f times the CPU time of the first, or %.0f s more\n",
        (double)DRAPE_ASSESS_COST, DRAPE_ASSESS_LEAST);
    const drape_status status = drape_assess(a->in.ctx, a->in.model, a->fine, &def, begin, a, &a->result);
    cli_signals_cancel(NULL);
    cli_progress_clear(&a->progress);
    if (cli_interrupted())
        return cli_report_interrupted(command->verb);
    return status ? cli_report(command, CLI_FAILED) : print_result(a);
}

static int run(const void *command)
{
    const accuracy_request *request = command;
    accuracy a = {.request = request};
    int code = cli_scene_load(&request->command, request->command.operand, &a.in);
    drape_sim_destroy(&a.in.sim); /* it has checked the settings */
    if (code == CLI_GO_ON && (drape_accuracy_check_runs(a.in.ctx, a.in.model) || compile_fine(&a)))
        code = cli_report(&request->command, CLI_BAD_INPUT);
    if (code == CLI_GO_ON || cli_interrupted())
        code = cli_interrupted() ? cli_report_interrupted(request->command.verb) : assess(&a);
    drape_model_destroy(&a.fine);
    cli_scene_free(&a.in);
    return code;
}

static const cli_option options[] = {
    {"json", CLI_FLAG, NULL, "print JSON; in accuracy.json in the folder of a run, its report shows it",
     offsetof(accuracy_request, json)},
};

const drape_verb drape_verb_accuracy = {
    .entry = {.name = "accuracy",
              .summary =
                  "say how far a run is off by its steps and its mesh, and until when it is predictable"},
    .operand = "SCENE",
    .takes_scene = true,
    .details =
        "Runs a scene four times: as it is, with a start that differs by a millionth of its size, with "
        "finer steps, and on\na mesh of four times as many triangles. That takes at most 12 times the "
        "CPU time of one run.",
    CLI_OPTIONS(options, accuracy_request),
    .run = run,
};
