/* sequence.c: see sequence.h. */
#include "mesh/sequence.h"

#include "mesh/npy_array.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#define MAX_FRAMES  1000000
#define MAX_NUMBERS ((int64_t)1 << 31) /* of all frames: 16 GiB */

/* NULL, with a message, if the name has another ending. */
static const drape_sequence_ops *find_format(drape_context *ctx, const char *pointer, const char *file)
{
    char known[256] = "";
    for (int i = 0; drape_sequences[i]; i++)
        for (int k = 0; drape_sequences[i]->endings[k]; k++) {
            if (drape_ends_in(file, drape_sequences[i]->endings[k]))
                return drape_sequences[i];
            drape_list_add(known, sizeof known, drape_sequences[i]->endings[k]);
        }
    drape_refuse(ctx, pointer, "%s: unknown ending; known are %s", file, known);
    return NULL;
}

drape_status drape_sequence_allocate(const drape_sequence_source *source, const drape_mesh *mesh,
                                     int64_t frames, drape_sequence *out)
{
    if (frames < 1)
        return drape_mesh_fail(source->ctx, &source->file, 0, "it has no frames");
    if (frames > MAX_FRAMES || frames * 3 * mesh->node_count > MAX_NUMBERS)
        return drape_mesh_fail(source->ctx, &source->file, 0,
                               "%" PRId64 " frames of %d nodes; at most %d frames and %" PRId64
                               " numbers are read",
                               frames, (int)mesh->node_count, MAX_FRAMES, MAX_NUMBERS);
    out->frame_count = (int32_t)frames;
    out->node_count = mesh->node_count;
    out->x = drape_arena_take(out->arena, (size_t)frames * (size_t)mesh->node_count, 3 * sizeof *out->x);
    out->time = drape_arena_take(out->arena, (size_t)frames, sizeof *out->time);
    return out->x && out->time ? DRAPE_OK : DRAPE_E_MEMORY;
}

/* ---- Times ---- */

static drape_status check_times(drape_context *ctx, const drape_mesh_source *source,
                                const drape_sequence *sequence)
{
    for (int32_t f = 0; f < sequence->frame_count; f++) {
        const double t = sequence->time[f];
        if (!isfinite(t) || (f > 0 && !(t > sequence->time[f - 1])))
            return drape_mesh_fail(ctx, source, 0,
                                   "frame %d is at %g s; times must be finite and increase from frame to "
                                   "frame",
                                   (int)f, t);
    }
    return DRAPE_OK;
}

static drape_status set_times(const drape_sequence_source *source, const char *pointer,
                              const drape_sequence_def *def, drape_sequence *out)
{
    drape_context *ctx = source->ctx;
    const char *at = DRAPE_FORMAT("%s/times", pointer);
    const drape_mesh_source file = {.pointer = at, .file = def->times};
    drape_contents whole = {0};
    drape_npy_array array;
    for (int32_t f = 0; !def->times && f < out->frame_count; f++)
        out->time[f] = def->start + fmin(out->first + out->step * f, out->last) / def->rate;
    if (!def->times)
        return check_times(ctx, &source->file, out);
    DRAPE_TRY(drape_contents_read(source->scratch, at, source->folder, def->times, &whole));
    DRAPE_TRY(drape_npy_array_parse(ctx, &file, whole.data, whole.size, &array));
    if (array.dimensions != 1 || array.shape[0] != out->frame_count)
        return drape_mesh_fail(ctx, &file, 0, "%" PRId64 " times in %d dimensions; %d times are needed",
                               array.shape[0], array.dimensions, (int)out->frame_count);
    for (int32_t f = 0; f < out->frame_count; f++)
        out->time[f] = def->start + drape_npy_array_at(&array, (size_t)f);
    return check_times(ctx, &file, out);
}

/* ---- Positions ---- */

drape_status drape_sequence_validate(drape_context *ctx, const drape_mesh_source *source,
                                     const drape_mesh *mesh, const drape_sequence *sequence)
{
    drape_mesh at = *mesh;
    char frame[32];
    const drape_mesh_source part = {.pointer = source->pointer, .file = source->file, .part = frame};
    for (int32_t f = 0; f < sequence->frame_count; f++) {
        snprintf(frame, sizeof frame, "frame %d: ", (int)f);
        at.x = sequence->x + 3 * (size_t)f * (size_t)sequence->node_count;
        DRAPE_TRY(drape_mesh_validate_positions(ctx, &part, &at));
        DRAPE_TRY(drape_mesh_validate_shapes(ctx, &part, &at));
        DRAPE_TRY(drape_check_cancel_after(ctx, 16 * (size_t)at.triangle_count));
    }
    return DRAPE_OK;
}

drape_status drape_sequence_read(drape_arena *arena, const char *pointer, const char *folder,
                                 const drape_sequence_def *def, drape_mesh *mesh, drape_sequence *out)
{
    drape_context *ctx = arena->ctx;
    const char *at_file = DRAPE_FORMAT("%s/file", pointer);
    const char *at_mesh = DRAPE_FORMAT("%s/mesh", pointer);
    const drape_sequence_ops *format = find_format(ctx, at_file, def->file);
    drape_arena scratch = drape_arena_of(ctx);
    drape_sequence_source source = {.ctx = ctx,
                                    .file = {.pointer = at_file, .file = def->file},
                                    .folder = folder,
                                    .rate = def->rate,
                                    .scratch = &scratch};
    *out = (drape_sequence){.arena = arena, .step = 1, .last = INFINITY};
    if (!format)
        return DRAPE_E_ARGUMENT;
    if (format->has_triangles && def->mesh)
        return drape_fail_below(ctx, pointer, "mesh",
                                "%s has its triangles itself: a mesh beside it is not used", def->file);
    if (!format->has_triangles && !def->mesh)
        return drape_fail_below(ctx, pointer, "mesh",
                                "%s has positions only: the OBJ or PLY file of its triangles is needed",
                                def->file);
    const locale_t old = drape_locale_enter();
    drape_status status =
        format->has_triangles ? DRAPE_OK : drape_mesh_read(ctx, at_mesh, folder, def->mesh, mesh);
    if (!status && !format->many_files)
        status = drape_contents_read(&scratch, at_file, folder, def->file, &source.whole);
    if (!status)
        status = format->read(&source, mesh, out);
    if (!status)
        status = set_times(&source, pointer, def, out);
    if (!status)
        memcpy(mesh->x, out->x, 3 * (size_t)mesh->node_count * sizeof *mesh->x);
    drape_locale_leave(old);
    drape_arena_free(&scratch);
    return status;
}
