/* cmd_path.c: `drape path`: the equilibria of a scene as its loads grow; a table, and a frame of each. */
#include "cli/shapes.h"

#include "base/param.h"
#include "drape/lab.h"
#include "io/csv.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define TABLE          "path.csv"
#define DEFAULT_POINTS 200

typedef struct path_request {
    cli_command command;
    const char *out, *state, *from, *to, *branch;
    cli_texts nodes; /* whose displacements are columns */
    double step, max_arc;
    int points;
    bool load_control;
} path_request;

typedef struct job {
    const path_request *request;
    cli_scene in;
    int32_t node[CLI_MAX_TEXTS];
    drape_recorder *recorder; /* NULL without --out */
    drape_file table;
} job;

/* ---- Points ---- */

static const char *const events[] = {[DRAPE_PATH_REGULAR] = "",
                                     [DRAPE_PATH_LIMIT] = "limit",
                                     [DRAPE_PATH_BIFURCATION] = "bifurcation",
                                     [DRAPE_PATH_SWITCHED] = "branch"};

/* The largest distance of a node from where it is at rest [m]. */
static double largest_displacement(const drape_model *m, const double *x)
{
    double most = 0;
    for (size_t i = 0; i < 3 * (size_t)m->node_count; i += 3)
        most = fmax(most, sqrt(pow(x[i] - m->rest[i], 2) + pow(x[i + 1] - m->rest[i + 1], 2) +
                               pow(x[i + 2] - m->rest[i + 2], 2)));
    return most;
}

static drape_status observe(void *user, drape_sim *sim, const drape_path_point *point)
{
    job *j = user;
    const double *x = drape_sim_positions(sim), *rest = j->in.model->rest;
    const double displacement = largest_displacement(j->in.model, x);
    drape_file *file = &j->table;
    drape_status status = DRAPE_OK;
    if (j->recorder) {
        drape_file_print(file, "%" PRId64, point->number);
        drape_csv_put_text(file, events[point->event]);
        drape_csv_put_numbers(file, 4,
                              (double[]){point->factor, point->arc, point->elastic, point->potential});
        drape_csv_put_integer(file, point->unstable);
        drape_csv_put_integer(file, point->iterations);
        drape_csv_put_numbers(file, 2, (double[]){point->residual, displacement});
        for (size_t i = 0; i < 3 * j->request->nodes.count; i++) {
            const size_t number = 3 * (size_t)j->node[i / 3] + i % 3;
            drape_csv_put_number(file, x[number] - rest[number]);
        }
        drape_file_put_text(file, "\n");
        status = drape_file_keep(file);
    }
    if (!status && j->recorder)
        status = cli_shapes_emit(sim, point->number);
    if (point->number == 0)
        puts("point          factor  displacement     energy [J]  unstable  iterations  event");
    printf("%5" PRId64 "  %14.9g  %12.6g  %13.6g  %8" PRId64 "  %10d  %s\n", point->number, point->factor,
           displacement, point->elastic + point->potential, point->unstable, point->iterations,
           events[point->event]);
    return status;
}

/* ---- The verb ---- */

static bool read_number(const char *text, double *value)
{
    const char *rest = text ? drape_number_read(text, value) : "";
    return rest && *rest == 0;
}

/* The node numbers of --node count through all cloths. */
static int read_nodes(job *j)
{
    for (size_t i = 0; i < j->request->nodes.count; i++) {
        double number = -1;
        if (!read_number(j->request->nodes.items[i], &number) || number != floor(number) || number < 0 ||
            number >= j->in.model->node_count)
            return cli_misuse("path", "--node \"%.60s\": it is a number from 0 to %d",
                              j->request->nodes.items[i], (int)j->in.model->node_count - 1);
        j->node[i] = (int32_t)number;
        for (size_t k = 0; k < i; k++)
            if (j->node[k] == j->node[i])
                return cli_misuse("path", "--node %d is given twice", (int)j->node[i]);
    }
    return CLI_GO_ON;
}

static int read_def(const path_request *request, const cli_state *state, drape_path_def *def)
{
    drape_path_def_init(def, sizeof *def);
    def->from = state->load_factor;
    def->to = 1 + state->load_factor;
    if (!read_number(request->from, &def->from) || !read_number(request->to, &def->to) ||
        def->from == def->to)
        return cli_misuse("path", "--from and --to are two factors of the loads");
    if (request->branch && strcmp(request->branch, "+") != 0 && strcmp(request->branch, "-") != 0)
        return cli_misuse("path", "--branch \"%.60s\": it is + or -", request->branch);
    if (request->branch && request->load_control)
        return cli_misuse("path",
                          "--branch with --load-control: a branch is left and followed by arc length");
    def->branch = !request->branch ? 0 : request->branch[0] == '+' ? 1 : -1;
    def->step = request->step > 0 ? request->step : fabs(def->to - def->from) / 20;
    def->max_arc = request->max_arc;
    def->load_control = request->load_control;
    def->max_points = request->points ? request->points : DEFAULT_POINTS;
    return CLI_GO_ON;
}

static int follow(job *j, const cli_state *state, drape_path_def *def)
{
    const cli_command *command = &j->request->command;
    const cli_shapes shapes = {.folder = j->request->out, .table = TABLE, .frames = def->max_points};
    char columns[64 + CLI_MAX_TEXTS * 64] =
        "point,event,factor,arc,elastic,potential,unstable,iterations,residual,displacement";
    size_t used = strlen(columns);
    drape_status status = cli_state_reach(state, &j->in);
    def->observer = observe;
    def->user = j;
    if (!status && shapes.folder)
        status = cli_shapes_open(command, &j->in, &shapes, &j->recorder);
    for (size_t i = 0; i < j->request->nodes.count; i++)
        used += (size_t)snprintf(columns + used, sizeof columns - used, ",u%d_x,u%d_y,u%d_z", (int)j->node[i],
                                 (int)j->node[i], (int)j->node[i]);
    snprintf(columns + used, sizeof columns - used, "\n");
    if (!status && j->recorder)
        status = drape_csv_open(j->in.ctx, drape_recorder_folder(j->recorder), TABLE, columns, &j->table);
    if (!status)
        status = drape_sim_path(j->in.sim, def);
    fflush(stdout);
    char message[DRAPE_MESSAGE_SIZE];
    snprintf(message, sizeof message, "%s", drape_context_message(j->in.ctx));
    drape_status closed = drape_file_close(&j->table);
    if (!closed && j->recorder)
        closed = drape_recorder_finish(j->recorder);
    if (cli_interrupted())
        return cli_report_interrupted(command->verb);
    if (!status && !closed)
        return CLI_DONE;
    cli_print_message(command, status ? message : drape_context_message(j->in.ctx));
    return status == DRAPE_E_ARGUMENT ? CLI_BAD_INPUT : CLI_FAILED;
}

static int run(const void *command)
{
    const path_request *request = command;
    job j = {.request = request};
    drape_path_def def;
    const cli_state *state = NULL;
    int code = cli_state_find(&request->command, request->state ? request->state : "start", &state);
    if (code == CLI_GO_ON)
        code = read_def(request, state, &def);
    if (code == CLI_GO_ON)
        code = cli_shapes_check(&request->command, request->out);
    if (code == CLI_GO_ON)
        code = cli_state_load(&request->command, state, &j.in);
    if (code == CLI_GO_ON)
        code = read_nodes(&j);
    if (code == CLI_GO_ON)
        code = follow(&j, state, &def);
    drape_file_destroy(&j.table);
    drape_recorder_destroy(&j.recorder);
    cli_scene_free(&j.in);
    return code;
}

#define AT(member) offsetof(path_request, member)
static const cli_option options[] = {
    {"state", CLI_TEXT, "STATE", CLI_STATES " (default start)", AT(state)},
    {"from", CLI_TEXT, "FACTOR", "factor of the loads at the first point (default 0 from the start, else 1)",
     AT(from)},
    {"to", CLI_TEXT, "FACTOR", "factor at which the path ends (default 1 from the start, else 2)", AT(to)},
    {"step", CLI_REAL, "FACTOR", "first increment of the factor (default: a twentieth of all)", AT(step)},
    {"max-arc", CLI_REAL, "METRES",
     "longest step along the path, RMS of the nodes (default: a fiftieth of the scene)", AT(max_arc)},
    {"points", CLI_NUMBER, "N", "points after which the path ends (default 200)", AT(points), 1000000},
    {"load-control", CLI_FLAG, NULL, "steps of the factor, not of the arc: no limit point is passed",
     AT(load_control)},
    {"branch", CLI_TEXT, "+|-", "at the first bifurcation, follow the branch to this side", AT(branch)},
    {"node", CLI_TEXTS, "N", "columns with the displacement of this node; may be repeated", AT(nodes)},
    {"out", CLI_TEXT, "DIR", "folder for path.csv, scene.json and a frame of each point", AT(out)},
};

const drape_verb drape_verb_path = {
    .entry = {.name = "path",
              .summary = "follow the equilibria of a scene as its loads grow, through limit points"},
    .operand = "SCENE",
    .takes_scene = true,
    .details = "Multiplies all loads of the scene (gravity, load.line ...) by one factor and follows the "
               "equilibrium\n"
               "as the factor goes from 0 to 1, by arc length, so that the path may turn round at limit "
               "points. Each\n"
               "point has the number of modes in which it is unstable. A step that fails is made again with "
               "half its\n"
               "length. The scene has no colliders and no self-contact.",
    CLI_OPTIONS(options, path_request),
    .run = run,
};
