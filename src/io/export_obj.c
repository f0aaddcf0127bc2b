/*
 * export_obj.c: folder/frame_000000.obj, ...: one Wavefront OBJ file for each frame. For each cloth `o
 * name`, `v x y z` [m], `f a b c` with nodes counted from 1 over the whole file; of a cloth from a file its
 * polygons, with `vt`, `usemtl` and `mtllib`. Numbers have 17 digits, so that a reader gets the same doubles.
 * Format: Wavefront Advanced Visualizer manual, appendix B1.
 */
#include <inttypes.h>

#include "io/export.h"
#include "model/model.h"

static bool obj_names(const char *name)
{
    return drape_frame_files_name(name, DRAPE_FRAME_DIGITS, "obj", NULL);
}

static drape_status obj_open(drape_context *ctx, const drape_export_def *def, void *state)
{
    return drape_frame_files_open(ctx, def, "obj", state);
}

static drape_status obj_write(drape_context *ctx, void *state, const drape_frame *frame)
{
    drape_frame_files *frames = state;
    (void)ctx;
    drape_status status = drape_frame_files_begin(frames, frame->index);
    if (status)
        return status;
    drape_file_print(&frames->file, "# Drape frame %" PRId64 ", t = %.17g s\n", frame->index, frame->time);
    drape_obj_put_material_files(&frames->file, frames->surface);
    drape_obj obj = {.file = &frames->file};
    for (int32_t i = 0; i < frames->surface->cloth_count; i++) {
        const drape_render_cloth *cloth = &frames->surface->cloths[i];
        drape_obj_put_name(&frames->file, "o", cloth->name);
        drape_obj_put_nodes(&frames->file, frame->positions + 3 * (size_t)cloth->first_node,
                            cloth->mesh->node_count);
        drape_obj_put_faces(&obj, frames->surface, i);
    }
    return drape_frame_files_end(frames);
}

static drape_status obj_resume(drape_context *ctx, const drape_export_def *def, void *state, int64_t frames,
                               drape_archive *a)
{
    (void)a;
    return drape_frame_files_resume(ctx, def, "obj", frames, state);
}

const drape_exporter_ops drape_exporter_obj = {
    .entry =
        {.name = "obj",
         .summary =
             "frame_000000.obj ...: a Wavefront OBJ file for each frame, an object for each cloth, with its "
             "polygons, texture coordinates and materials, 17 digits",
         .reference = "Wavefront Advanced Visualizer manual, appendix B1"},
    .state_size = sizeof(drape_frame_files),
    .open = obj_open,
    .names = obj_names,
    .write = obj_write,
    .archive = drape_frame_files_archive,
    .resume = obj_resume,
    .cut = drape_frame_files_cut,
    .close = drape_frame_files_close,
};
