/*
 * export_ply.c: folder/frame_000000.ply, ...: one binary PLY file for each frame, little endian: vertices
 * as double x y z [m], faces as lists of int counted from 0; all cloths in one mesh. Format: G. Turk, The
 * PLY Polygon File Format, 1994.
 */
#include <inttypes.h>

#include "io/export.h"
#include "model/model.h"

#define FRAME_NAME "frame_" DRAPE_FRAME_DIGITS ".ply"

static drape_status ply_write(const drape_export_def *def, void *state, const drape_frame *frame)
{
    const drape_render_surface *surface = &def->model->surface;
    const int32_t *node = surface->triangle;
    (void)state;
    drape_status status = drape_export_begin_frame(def, frame, FRAME_NAME);
    if (status)
        return status;
    drape_file_print(def->whole,
                     "ply\nformat binary_little_endian 1.0\ncomment Drape frame %" PRId64 ", t = %.17g s\n",
                     frame->index, frame->time);
    drape_file_print(def->whole,
                     "element vertex %" PRId32 "\nproperty double x\nproperty double y\nproperty double z\n",
                     surface->node_count);
    drape_file_print(def->whole,
                     "element face %" PRId32 "\nproperty list uchar int vertex_indices\nend_header\n",
                     surface->triangle_count);
    drape_file_put_doubles(def->whole, frame->positions, 3 * (size_t)surface->node_count);
    for (int32_t i = 0; i < surface->triangle_count; i++, node += 3) {
        drape_file_put(def->whole, "\3", 1);
        for (int k = 0; k < 3; k++)
            drape_file_put_word(def->whole, (uint32_t)node[k]);
    }
    return drape_file_finish(def->whole);
}

const drape_exporter_ops drape_exporter_ply = {
    .entry = {.name = "ply",
              .summary = "frame_000000.ply ...: a binary PLY file for each frame, double precision",
              .reference = "G. Turk, The PLY Polygon File Format, 1994"},
    .names = {FRAME_NAME},
    .write = ply_write,
};
