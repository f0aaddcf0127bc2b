/* sequence_npy.c: frames x nodes x 3 numbers in an NPY file, as the exporter "npy" and numpy.save write
 * them. */
#include "mesh/npy_array.h"
#include "mesh/sequence.h"

#include <inttypes.h>

static drape_status read_npy(const drape_sequence_source *source, drape_mesh *mesh, drape_sequence *out)
{
    drape_npy_array array;
    DRAPE_TRY(
        drape_npy_array_parse(source->ctx, &source->file, source->whole.data, source->whole.size, &array));
    if (array.dimensions != 3 || array.shape[2] != 3)
        return drape_mesh_fail(source->ctx, &source->file, 0,
                               "%d dimensions, %" PRId64 " x %" PRId64 " x %" PRId64
                               "; frames x nodes x 3 are needed",
                               array.dimensions, array.shape[0], array.shape[1], array.shape[2]);
    if (array.shape[1] != mesh->node_count)
        return drape_mesh_fail(source->ctx, &source->file, 0, "%" PRId64 " nodes; the mesh has %d",
                               array.shape[1], (int)mesh->node_count);
    DRAPE_TRY(drape_sequence_allocate(source, mesh, array.shape[0], out));
    const size_t count = 3 * (size_t)array.shape[0] * (size_t)mesh->node_count;
    for (size_t i = 0; i < count; i++)
        out->x[i] = drape_npy_array_at(&array, i);
    return DRAPE_OK;
}

const drape_sequence_ops drape_sequence_npy = {
    .entry = {.name = "npy",
              .summary = "NumPy array, frames x nodes x 3, float32 or float64; its triangles are in \"mesh\"",
              .reference = "NPY format, numpy.lib.format"},
    .endings = {".npy"},
    .read = read_npy,
};
