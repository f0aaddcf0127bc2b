/* cmd_ivp.c: `drape ivp`: the test set of initial value problems: horizons, references, runs, scores. */
#include "cli/lab.h"
#include "lab/ivp.h"

#include <string.h>

typedef struct ivp_request {
    cli_lab_request lab; /* its command first */
    bool check, json;
} ivp_request;

#define SECONDS 60 /* [s] CPU that a family of methods may take for a reference */

/* An action with one scene. more: the operand after it, if there is one. */
typedef drape_status ivp_action(lab_ivp *s, const ivp_request *request, const char *more, bool *good);

static drape_status horizon(lab_ivp *s, const ivp_request *request, const char *more, bool *good)
{
    (void)request, (void)more;
    return lab_ivp_horizon(s, good, stdout);
}

static drape_status reference(lab_ivp *s, const ivp_request *request, const char *more, bool *good)
{
    const double seconds = request->lab.case_seconds > 0 ? request->lab.case_seconds : SECONDS;
    (void)more, (void)good;
    return lab_ivp_reference(s, seconds, request->check, stdout);
}

static drape_status score(lab_ivp *s, const ivp_request *request, const char *more, bool *good)
{
    (void)good;
    drape_status status = lab_ivp_read_reference(s);
    return status ? status : lab_ivp_score(s, more, request->json, stdout);
}

static drape_status export(lab_ivp *s, const ivp_request *request, const char *more, bool *good)
{
    (void)more, (void)good;
    drape_status status = lab_ivp_read_reference(s);
    return status ? status : lab_ivp_export(s, request->lab.out, stdout);
}

static const struct {
    const char *name;
    ivp_action *perform;
    int operands; /* with a scene; 0: any number of scenes */
    const char *usage;
} actions[] = {
    {"run", NULL, 0, "run SCENE..."},
    {"horizon", horizon, 0, "horizon SCENE..."},
    {"reference", reference, 0, "reference SCENE..."},
    {"score", score, 2, "score SCENE POSITIONS.npy"},
    {"export", export, 1, "export SCENE --out DIR"},
};
#define ACTIONS (sizeof actions / sizeof *actions)

/* Carries out the action with each scene. Failures of a scene, of a file that is read and of the output
 * folder are bad input. */
static int do_scenes(const ivp_request *request, size_t action)
{
    const cli_command *command = &request->lab.command;
    const int scenes = actions[action].operands ? 1 : command->operand_count - 1;
    const char *more = actions[action].operands == 2 ? command->operands[2] : NULL;
    int worst = CLI_DONE;
    for (int i = 1; i <= scenes && worst != CLI_INTERRUPTED; i++) {
        drape_arena arena = drape_arena_of(command->ctx);
        lab_ivp s = {0};
        bool good = true;
        if (scenes > 1)
            puts(CLI_SHOWN(command->operands[i]));
        drape_status status = lab_ivp_open(&arena, command->operands[i], &s);
        s.def.cancel = cli_interrupted_by;
        if (!status)
            status = actions[action].perform(&s, request, more, &good);
        lab_ivp_close(&s);
        fflush(stdout);
        int code = good ? CLI_DONE : CLI_FAILED;
        if (status == DRAPE_E_STOPPED)
            code = cli_report_interrupted(command->verb);
        else if (status)
            code = cli_report(command, status == DRAPE_E_SOLVER || status == DRAPE_E_MEMORY ? CLI_FAILED
                                                                                            : CLI_BAD_INPUT);
        worst = code > worst ? code : worst;
        drape_arena_free(&arena);
    }
    return worst;
}

static int run(const void *given)
{
    const ivp_request *request = given;
    const cli_command *command = &request->lab.command;
    size_t i = 0;
    while (i < ACTIONS && strcmp(actions[i].name, command->operand) != 0)
        i++;
    if (i == ACTIONS)
        return cli_misuse("ivp",
                          "there is no \"%.60s\"; must be one of run, horizon, reference, score, export",
                          command->operand);
    const int given_operands = command->operand_count - 1;
    if (given_operands < 1 || (actions[i].operands && given_operands != actions[i].operands))
        return cli_misuse("ivp", "usage: drape ivp %s", actions[i].usage);
    if (request->json && actions[i].perform != score)
        return cli_misuse("ivp", "--json has no effect: only score prints JSON");
    if (actions[i].perform == export && !request->lab.out)
        return cli_misuse("ivp", "--out is missing: the folder of the export");
    if (actions[i].perform)
        return do_scenes(request, i);
    cli_lab_request lab = request->lab; /* the methods over the scenes */
    lab.command.operands++;
    lab.command.operand_count--;
    lab.command.operand = lab.command.operands[0];
    return cli_lab_run(&lab, 1, 0);
}

static const cli_option options[] = {
    CLI_LAB_OPTIONS,
    CLI_LAB_OPTION("repeats", CLI_NUMBER, "N",
                   "runs of a short case, of which the fastest counts (default 3)", repeats, 100),
    CLI_LAB_OPTION(
        "budget", CLI_TEXT, "MINUTES",
        "limit of wall-clock time; the least informative cases are left out and named (default none)", budget,
        0),
    {"check", CLI_FLAG, NULL, "reference: compare with the stored one instead of storing it",
     offsetof(ivp_request, check)},
    {"json", CLI_FLAG, NULL, "score: print JSON", offsetof(ivp_request, json)},
};

const drape_verb drape_verb_ivp = {
    .entry = {.name = "ivp",
              .summary = "the test set of initial value problems: all integrators against references"},
    .operand = "ACTION SCENE...",
    .max_operands = 1000,
    .details =
        "drape ivp run SCENE...            every integrator over its dt or rtol: errors, costs, orders, "
        "tables\n"
        "drape ivp score SCENE FILE.npy    how far the frames of another program are from the reference\n"
        "drape ivp export SCENE --out DIR  mesh, masses, pins and reference for another program\n"
        "drape ivp reference SCENE...      compute references/NAME.npy beside the scene, by unrelated "
        "methods\n"
        "drape ivp horizon SCENE...        measure how a perturbation grows, into horizons/NAME.json\n"
        "The scenes are in examples/ivp. A run of which cases were left out, or that was stopped, continues "
        "by the\n"
        "same command. --case-seconds is also the CPU time that a method may take for a reference (default "
        "60).",
    CLI_OPTIONS(options, ivp_request),
    .run = run,
};
