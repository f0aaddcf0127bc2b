/* cmd_info.c: `drape info`: show what a scene models and what it costs. */
#include "cli/info.h"
#include "cli/signals.h"

#include "base/arena.h"
#include "colliders/deformed.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

typedef struct info_request {
    cli_command command;
    bool json;
} info_request;

static cli_cloth_info cloth_info(const drape_model *model, const drape_cloth *cloth)
{
    cli_cloth_info info = {0};
    int32_t first = cloth->first_node, last = first + cloth->mesh.node_count - 1;
    for (int32_t i = first; i <= last; i++) {
        info.mass += model->mass[i];
        info.pinned += model->pinned[i];
    }
    for (int32_t i = 0; i < model->support_count; i++)
        info.supported += model->supports[i].node >= first && model->supports[i].node <= last;
    for (int32_t i = 0; i < model->moved_count; i++)
        info.moved += model->moved_node[i] >= first && model->moved_node[i] <= last;
    for (int32_t t = 0; t < cloth->mesh.triangle_count; t++)
        info.area += cloth->mesh.triangle_area[t];
    return info;
}

static drape_status count_inside(const drape_sim *sim, int32_t index, int32_t *inside)
{
    const drape_collider *collider;
    drape_arena arena = drape_arena_of(sim->ctx);
    const drape_status status =
        drape_deformed_at(&arena, sim->model, NULL, index, drape_sim_time(sim), &collider);
    *inside = 0;
    const double *x = drape_sim_positions(sim);
    const drape_collider_pose pose =
        drape_collider_pose_at(&sim->model->colliders[index], drape_sim_time(sim));
    for (int32_t i = 0; !status && i < sim->model->node_count; i++)
        *inside += drape_collider_distance(collider, &pose, x + 3 * (size_t)i, NULL, NULL) < 0;
    drape_arena_free(&arena);
    return status;
}

/* Frames at k / rate up to the end, and one at the end if none of them is there. */
static int64_t count_frames(const drape_model *model)
{
    double intervals = model->duration * model->frame_rate, whole = floor(intervals + 1e-9);
    return (int64_t)whole + (intervals - whole > 1e-9 ? 2 : 1);
}

static drape_status gather(drape_arena *arena, const cli_scene *in, cli_info *info)
{
    const drape_model *model = in->model;
    drape_profile_term *terms = drape_arena_take(arena, (size_t)model->term_count, sizeof *terms);
    info->profile.terms = terms;
    info->cloths = drape_arena_take(arena, (size_t)model->cloth_count, sizeof *info->cloths);
    info->inside = drape_arena_take(arena, (size_t)model->collider_count, sizeof *info->inside);
    if (drape_arena_status(arena))
        return DRAPE_E_MEMORY;
    info->model = model;
    info->sim = in->sim;
    info->frames = count_frames(model);
    for (int32_t c = 0; c < model->cloth_count; c++)
        info->cloths[c] = cloth_info(model, &model->cloths[c]);
    drape_status status = DRAPE_OK;
    for (int32_t c = 0; !status && c < model->collider_count; c++)
        status = count_inside(in->sim, c, &info->inside[c]);
    if (!status)
        status = drape_scene_to_def(in->scene, &info->def);
    if (!status)
        status = drape_profile_measure(in->ctx, in->sim, terms, &info->profile);
    const drape_integrator_ops *integrator = in->sim->chosen.integrator;
    info->has_limit = integrator->stability;
    if (!status && info->has_limit)
        integrator->stability(in->sim->integrator, drape_sim_state(in->sim), info->profile.dt,
                              &info->stability);
    return status;
}

static int print(const cli_command *command, const cli_info *info)
{
    errno = 0;
    json_t *object = cli_info_json(info);
    if (!info->described)
        return cli_print_json(command, object, JSON_INDENT(2) | JSON_REAL_PRECISION(15) | JSON_ENSURE_ASCII);
    const bool whole = object && !drape_memory_ran_out();
    if (whole)
        cli_info_text(object);
    json_decref(object);
    return whole ? CLI_DONE : cli_report_memory(command);
}

static int run(const void *command)
{
    const info_request *request = command;
    cli_info info = {.path = request->command.operand, .described = !request->json};
    cli_scene in;
    int code = cli_scene_load(&request->command, request->command.operand, &in);
    if (code == CLI_GO_ON) {
        drape_status status = gather(request->command.arena, &in, &info);
        code = status == DRAPE_E_STOPPED ? cli_report_interrupted(request->command.verb)
               : status                  ? cli_report(&request->command, CLI_FAILED)
                                         : print(&request->command, &info);
    }
    cli_scene_free(&in);
    return code;
}

static const cli_option options[] = {
    {"json", CLI_FLAG, NULL, "print the same as JSON", offsetof(info_request, json), 0, NULL},
};

const drape_verb drape_verb_info = {
    .entry = {.name = "info", .summary = "show what a scene models and what it costs"},
    .operand = "SCENE",
    .takes_scene = true,
    .details =
        "Shows what a scene models, every parameter with its value, and what each part costs: elements,\n"
        "nonzeros, bytes, and its share of one Newton iteration, measured at a slightly deformed state.",
    .options = options,
    .option_count = sizeof options / sizeof *options,
    .request_size = sizeof(info_request),
    .run = run,
};
