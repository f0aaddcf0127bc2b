/* shapes.c: see shapes.h. */
#include "cli/shapes.h"

#include "io/scene_copy.h"

#include <string.h>

static const cli_state states[] = {
    {"static", "static", true, 1},
    {"start", NULL, false, 0},
    {"end", NULL, true, 1},
};
#define STATES (sizeof states / sizeof *states)

int cli_state_find(const cli_command *command, const char *name, const cli_state **out)
{
    for (size_t i = 0; i < STATES; i++)
        if (strcmp(states[i].name, name) == 0) {
            *out = &states[i];
            return CLI_GO_ON;
        }
    return cli_misuse(command->verb, "--state \"%.60s\": it is static, start or end", name);
}

static drape_status choose(void *user, const cli_scene *scene, drape_sim_def *def)
{
    const cli_state *const *state = user;
    (void)scene;
    def->integrator = (*state)->integrator;
    return DRAPE_OK;
}

int cli_state_load(const cli_command *command, const cli_state *state, cli_scene *out)
{
    return cli_scene_load_with(command, command->operand, choose, &state, out);
}

drape_status cli_state_reach(const cli_state *state, const cli_scene *in)
{
    if (!state->advances)
        return DRAPE_OK;
    cli_signals_cancel(in->sim);
    drape_status status = drape_sim_advance(in->sim, drape_model_duration(in->model));
    cli_signals_cancel(NULL);
    return status == DRAPE_E_STOPPED && drape_sim_stopped_by(in->sim) >= 0 ? DRAPE_OK : status;
}

int cli_shapes_check(const cli_command *command, const char *folder)
{
    if (!folder || command->setting_count == 0 || !drape_scene_copy_is(command->operand, folder))
        return CLI_GO_ON;
    return cli_misuse(command->verb, "--out \"%.500s\": its " DRAPE_SCENE_COPY " is the scene itself",
                      folder);
}

drape_status cli_shapes_open(const cli_command *command, const cli_scene *in, const cli_shapes *shapes,
                             drape_recorder **out)
{
    const char *const also[] = {shapes->table, DRAPE_SCENE_COPY, DRAPE_SCENE_MESHES};
    const drape_model *model = in->model;
    const bool copies = !drape_scene_copy_is(command->operand, shapes->folder);
    const char **formats = drape_arena_take(command->arena, model->format_count + 1, sizeof *formats);
    if (!formats)
        return DRAPE_E_MEMORY;
    for (size_t i = 0; i < model->format_count; i++)
        formats[i] = model->formats[i];
    formats[model->format_count] = "npy"; /* which drape render reads; twice counts once */
    const drape_recorder_def def = {.folder = shapes->folder,
                                    .scene = command->operand,
                                    .also = also,
                                    .also_count = copies ? sizeof also / sizeof *also : 1,
                                    .formats = formats,
                                    .format_count = model->format_count + 1,
                                    .frames = shapes->frames};
    drape_status status = drape_recorder_create(in->ctx, in->sim, &def, out);
    if (!status && copies)
        status = drape_scene_copy(in->ctx, in->scene, model, command->operand, drape_recorder_folder(*out));
    return status;
}

drape_status cli_shapes_emit(drape_sim *sim, int64_t frame)
{
    const drape_event event = {.kind = DRAPE_EVENT_FRAME,
                               .sim = sim,
                               .frame = frame,
                               .time = (double)frame / sim->frame_rate,
                               .positions = drape_sim_positions(sim),
                               .velocities = drape_sim_velocities(sim)};
    return drape_sim_notify(sim, &event);
}
