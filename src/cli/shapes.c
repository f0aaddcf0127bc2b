/* shapes.c: see shapes.h. */
#include "cli/shapes.h"

#include "io/scene_copy.h"

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
