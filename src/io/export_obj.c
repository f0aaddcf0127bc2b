/*
 * export_obj.c: folder/frame_000000.obj, ...: one Wavefront OBJ file for each frame. For each cloth `o
 * name`, `v x y z` [m], `f a b c` with nodes counted from 1 over the whole file; of a cloth from a file its
 * polygons, with `vt`, `usemtl` and `mtllib`. Numbers have 17 digits, so that a reader gets the same doubles.
 * Format: Wavefront Advanced Visualizer manual, appendix B1.
 */
#include <inttypes.h>

#include "io/export.h"
#include "model/model.h"

#define FRAME_NAME "frame_" DRAPE_FRAME_DIGITS ".obj"

static drape_status obj_write(const drape_export_def *def, void *state, const drape_frame *frame)
{
    const drape_render_surface *surface = &def->model->surface;
    drape_obj obj = {.file = def->whole};
    (void)state;
    drape_status status = drape_export_begin_frame(def, frame, FRAME_NAME);
    if (status)
        return status;
    drape_file_print(obj.file, "# Drape frame %" PRId64 ", t = %.17g s\n", frame->index, frame->time);
    drape_obj_put_material_files(obj.file, surface);
    for (int32_t i = 0; i < surface->cloth_count; i++) {
        const drape_render_cloth *cloth = &surface->cloths[i];
        drape_obj_put_name(obj.file, "o", cloth->name);
        drape_obj_put_nodes(obj.file, frame->positions + 3 * (size_t)cloth->first_node,
                            cloth->mesh->node_count);
        drape_obj_put_faces(&obj, surface, i);
    }
    return drape_file_finish(obj.file);
}

const drape_exporter_ops drape_exporter_obj = {
    .entry =
        {.name = "obj",
         .summary =
             "frame_000000.obj ...: a Wavefront OBJ file for each frame, an object for each cloth, with its "
             "polygons, texture coordinates and materials, 17 digits",
         .reference = "Wavefront Advanced Visualizer manual, appendix B1"},
    .names = {FRAME_NAME},
    .write = obj_write,
};
