/*
 * export_ply.c: folder/frame_000000.ply, ...: one binary PLY file for each frame, little endian: vertices
 * as double x y z [m], faces as lists of int counted from 0; all cloths in one mesh. Format: G. Turk, The
 * PLY Polygon File Format, 1994.
 */
#include <inttypes.h>

#include "io/export.h"
#include "model/model.h"

#define FACE_SIZE 13 /* the count 3 in one byte, three nodes in four bytes each */

static bool ply_names(const char *name)
{
    return drape_frame_files_name(name, DRAPE_FRAME_DIGITS, "ply", NULL);
}

static drape_status ply_open(drape_context *ctx, const drape_export_def *def, void *state)
{
    return drape_frame_files_open(ctx, def, "ply", state);
}

static void put_header(drape_file *file, const drape_render_surface *surface, const drape_frame *frame)
{
    drape_file_print(file,
                     "ply\nformat binary_little_endian 1.0\ncomment Drape frame %" PRId64 ", t = %.17g s\n",
                     frame->index, frame->time);
    drape_file_print(file,
                     "element vertex %" PRId32 "\nproperty double x\nproperty double y\nproperty double z\n",
                     surface->node_count);
    drape_file_print(file, "element face %" PRId32 "\nproperty list uchar int vertex_indices\nend_header\n",
                     surface->triangle_count);
}

static void put_face(drape_file *file, const int32_t *node)
{
    unsigned char bytes[FACE_SIZE] = {3};
    for (int i = 0; i < 3; i++)
        for (int b = 0; b < 4; b++)
            bytes[1 + 4 * i + b] = (unsigned char)((uint32_t)node[i] >> 8 * b);
    drape_file_put(file, bytes, sizeof bytes);
}

static drape_status ply_write(drape_context *ctx, void *state, const drape_frame *frame)
{
    drape_frame_files *frames = state;
    const drape_render_surface *surface = frames->surface;
    const int32_t *node = surface->triangle;
    (void)ctx;
    drape_status status = drape_frame_files_begin(frames, frame->index);
    if (status)
        return status;
    put_header(&frames->file, surface, frame);
    drape_file_put_doubles(&frames->file, frame->positions, 3 * (size_t)surface->node_count);
    for (int32_t i = 0; i < surface->triangle_count; i++, node += 3)
        put_face(&frames->file, node);
    return drape_frame_files_end(frames);
}

static drape_status ply_resume(drape_context *ctx, const drape_export_def *def, void *state, int64_t frames,
                               drape_archive *a)
{
    (void)a;
    return drape_frame_files_resume(ctx, def, "ply", frames, state);
}

const drape_exporter_ops drape_exporter_ply = {
    .entry = {.name = "ply",
              .summary = "frame_000000.ply ...: a binary PLY file for each frame, double precision",
              .reference = "G. Turk, The PLY Polygon File Format, 1994"},
    .state_size = sizeof(drape_frame_files),
    .open = ply_open,
    .names = ply_names,
    .write = ply_write,
    .archive = drape_frame_files_archive,
    .resume = ply_resume,
    .cut = drape_frame_files_cut,
    .close = drape_frame_files_close,
};
