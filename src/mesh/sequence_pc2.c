/*
 * sequence_pc2.c: a point cache. PC2, version 1, little endian: "POINTCACHE2\0", int32 version, int32 points,
 * float32 first frame, float32 step in frames, int32 samples; then for each sample float32 x y z of each
 * point. Numbers of frames become times by the rate.
 */
#include "mesh/npy_array.h"
#include "mesh/sequence.h"

#include <math.h>
#include <string.h>

#define MAGIC  "POINTCACHE2" /* with its terminating 0 */
#define HEADER 32            /* [bytes] */

static drape_status read_pc2(const drape_sequence_source *source, drape_mesh *mesh, drape_sequence *out)
{
    const drape_contents *whole = &source->whole;
    const char *data = whole->data;
    if (whole->size < HEADER || memcmp(data, MAGIC, sizeof MAGIC) != 0)
        return drape_mesh_fail(source->ctx, &source->file, 0,
                               "it is not a point cache: it does not begin with POINTCACHE2");
    const uint32_t version = drape_bytes_word(data + 12), points = drape_bytes_word(data + 16),
                   samples = drape_bytes_word(data + 28);
    const double first = drape_bytes_float32(data + 20), step = drape_bytes_float32(data + 24);
    if (version != 1)
        return drape_mesh_fail(source->ctx, &source->file, 0, "PC2 version %u; 1 can be read", version);
    if (points != (uint32_t)mesh->node_count)
        return drape_mesh_fail(source->ctx, &source->file, 0, "%u points; the mesh has %d nodes", points,
                               (int)mesh->node_count);
    if (!isfinite(first) || !(step > 0) || !isfinite(step))
        return drape_mesh_fail(source->ctx, &source->file, 0,
                               "its first frame is %g, its step %g frames; the step must be positive", first,
                               step);
    if ((uint64_t)(whole->size - HEADER) != 12 * (uint64_t)points * samples)
        return drape_mesh_fail(
            source->ctx, &source->file, 0, "%zu bytes of positions; %u samples of %u points have %llu",
            whole->size - HEADER, samples, points, 12 * (unsigned long long)points * samples);
    DRAPE_TRY(drape_sequence_allocate(source, mesh, samples, out));
    const size_t count = 3 * (size_t)points * samples;
    out->first = first;
    out->step = step;
    for (size_t i = 0; i < count; i++)
        out->x[i] = drape_bytes_float32(data + HEADER + 4 * i);
    return DRAPE_OK;
}

const drape_sequence_ops drape_sequence_pc2 = {
    .entry = {.name = "pc2",
              .summary = "point cache of Blender and 3ds Max, float32; its triangles are in \"mesh\"",
              .reference = "PC2 format version 1, Autodesk 3ds Max SDK, Point Cache"},
    .endings = {".pc2"},
    .read = read_pc2,
};
