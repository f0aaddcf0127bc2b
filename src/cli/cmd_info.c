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

void cli_chosen_entries(const drape_sim *sim, cli_chosen entries[CLI_CHOSEN])
{
    const drape_integrator_ops *integrator = sim->chosen.integrator;
    const drape_controller_ops *controller = sim->chosen.controller;
    entries[0] = (cli_chosen){"integrator",
                              integrator->entry.name,
                              integrator->entry.summary,
                              integrator->entry.params,
                              integrator->entry.param_count,
                              sim->chosen.integrator_values,
                              &sim->model->integrator,
                              drape_chosen_ignores_integrator};
    entries[1] = (cli_chosen){"controller",
                              controller->entry.name,
                              controller->entry.summary,
                              controller->entry.params,
                              controller->entry.param_count,
                              sim->chosen.controller_values,
                              &sim->model->controller,
                              drape_chosen_ignores_controller};
}

void cli_contact(const drape_sim *sim, cli_contact_entries *out)
{
    const drape_model *model = sim->model;
    const bool forces = !sim->chosen.integrator->projects_contact; /* else only the thickness acts */
    out->count = 0;
    if (forces && (model->collider_count > 0 || model->contact.self)) {
        drape_contact_values(&model->contact, out->values[0]);
        out->entries[out->count++] = (cli_chosen){.title = "contact",
                                                  .params = drape_contact_params,
                                                  .param_count = DRAPE_CONTACT_PARAM_COUNT,
                                                  .values = out->values[0],
                                                  .choice = &model->contact_choice};
    }
    if (model->contact.self) {
        drape_self_contact_values(&model->contact, out->values[1]);
        out->entries[out->count++] =
            (cli_chosen){.title = "self_contact",
                         .params = drape_self_contact_params,
                         .param_count = forces ? DRAPE_SELF_PARAM_COUNT : DRAPE_SELF_THICKNESS + 1,
                         .values = out->values[1],
                         .choice = &model->self_choice};
    }
    if (model->untangle.given) {
        drape_untangle_values(&model->untangle, out->values[2]);
        out->entries[out->count++] = (cli_chosen){.title = "untangle",
                                                  .params = drape_untangle_params,
                                                  .param_count = DRAPE_UNTANGLE_PARAM_COUNT,
                                                  .values = out->values[2],
                                                  .choice = &model->untangle_choice};
    }
}

bool cli_is_given(const drape_choice *choice, const char *name)
{
    for (size_t i = 0; i < choice->setting_count; i++)
        if (strcmp(choice->settings[i].name, name) == 0)
            return true;
    return false;
}

const char *cli_text_of(const drape_choice *choice, const char *name)
{
    for (size_t i = 0; i < choice->setting_count; i++)
        if (strcmp(choice->settings[i].name, name) == 0 && choice->settings[i].text)
            return choice->settings[i].text;
    return "";
}

const char *cli_owner(const drape_model *model, const drape_term *term)
{
    return term->seam < 0 ? model->cloths[term->cloth].name : model->seams[term->seam].name;
}

double cli_share(const cli_info *info, double seconds)
{
    double whole = drape_profile_seconds(&info->profile);
    return whole > 0 ? seconds / whole : 0;
}

/* The rest of the whole; not negative, as the parts are measured separately and may add up to more. */
double cli_other_residual_seconds(const cli_info *info)
{
    double other = info->profile.residual_seconds;
    for (int32_t i = 0; i < info->model->term_count; i++)
        other -= info->profile.terms[i].residual_seconds;
    return fmax(other, 0);
}

double cli_other_jacobian_seconds(const cli_info *info)
{
    double other = info->profile.jacobian_seconds;
    for (int32_t i = 0; i < info->model->term_count; i++)
        other -= info->profile.terms[i].jacobian_seconds;
    return fmax(other, 0);
}

static cli_cloth_info cloth_info(const drape_model *model, const drape_cloth *cloth)
{
    cli_cloth_info info = {0};
    int32_t first = cloth->first_node, last = first + cloth->mesh.node_count - 1;
    for (int32_t i = first; i <= last; i++) {
        info.mass += model->mass[i];
        info.pinned += model->pinned[i];
    }
    for (int32_t i = 0; i < model->moved_count; i++)
        info.moved += model->moved_node[i] >= first && model->moved_node[i] <= last;
    for (int32_t t = 0; t < cloth->mesh.triangle_count; t++)
        info.area += cloth->mesh.triangle_area[t];
    return info;
}

static drape_status collider_info(const drape_sim *sim, int32_t index, cli_collider_info *info)
{
    const drape_collider *collider;
    drape_arena arena = drape_arena_of(sim->ctx);
    const drape_status status =
        drape_deformed_at(&arena, sim->model, NULL, index, drape_sim_time(sim), &collider);
    *info = (cli_collider_info){0};
    const double *x = drape_sim_positions(sim);
    const drape_collider_pose pose =
        drape_collider_pose_at(&sim->model->colliders[index], drape_sim_time(sim));
    for (int32_t i = 0; !status && i < sim->model->node_count; i++)
        info->inside += drape_collider_distance(collider, &pose, x + 3 * (size_t)i, NULL, NULL) < 0;
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
    info->colliders = drape_arena_take(arena, (size_t)model->collider_count, sizeof *info->colliders);
    if (drape_arena_status(arena))
        return DRAPE_E_MEMORY;
    info->model = model;
    info->sim = in->sim;
    info->frames = count_frames(model);
    for (int32_t c = 0; c < model->cloth_count; c++)
        info->cloths[c] = cloth_info(model, &model->cloths[c]);
    drape_status status = DRAPE_OK;
    for (int32_t c = 0; !status && c < model->collider_count; c++)
        status = collider_info(in->sim, c, &info->colliders[c]);
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

static int print(const cli_command *command, bool json, const cli_info *info)
{
    errno = 0;
    if (json)
        return cli_print_json(command, cli_info_json(info),
                              JSON_INDENT(2) | JSON_REAL_PRECISION(15) | JSON_ENSURE_ASCII);
    cli_info_text(info);
    return drape_memory_ran_out() ? cli_report_memory(command) : CLI_DONE;
}

static int run(const void *command)
{
    const info_request *request = command;
    cli_info info = {.path = request->command.operand};
    cli_scene in;
    int code = cli_scene_load(&request->command, request->command.operand, &in);
    if (code == CLI_GO_ON) {
        drape_status status = gather(request->command.arena, &in, &info);
        code = status == DRAPE_E_STOPPED ? cli_report_interrupted(request->command.verb)
               : status                  ? cli_report(&request->command, CLI_FAILED)
                                         : print(&request->command, request->json, &info);
    }
    cli_scene_free(&in);
    return code;
}

static const cli_option options[] = {
    {"json", CLI_FLAG, NULL, "print the same as JSON", offsetof(info_request, json), 0, NULL},
};

/* The settings were valid when the model was compiled, so they are valid now. */
const drape_grid_ops *cli_grid_of(const drape_entry_def *def, double *values)
{
    const int i = drape_registry_find(&drape_grid_registry, NULL, def->type ? def->type : "");
    drape_context *ctx = NULL;
    if (i < 0 || drape_context_create(NULL, &ctx))
        return NULL;
    const drape_grid_ops *grid = drape_grids[i];
    drape_status status = drape_params_resolve(ctx, "", grid->entry.params, grid->entry.param_count,
                                               def->settings, def->setting_count, values);
    drape_context_destroy(&ctx);
    return status ? NULL : grid;
}

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
