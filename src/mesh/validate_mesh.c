/* validate_mesh.c: refuses meshes that are not a sheet of cloth, and names the place. Such meshes would
 * divide by zero in a term, make the mass matrix singular, or connect parts that share no edge. */
#include <math.h>

#include "base/search.h"
#include "base/vec3.h"
#include "mesh/mesh.h"
#include "mesh/remedy.h"

#define MAX_COORDINATE 1e9   /* [m]: beyond this, neighbouring doubles are more than 1e-7 m apart */
#define MIN_THINNESS   1e-12 /* altitude / longest edge; the rounding of positions is 1e-16 of the edge */

drape_status drape_mesh_validate_positions(drape_context *ctx, const drape_mesh_source *source,
                                           const drape_mesh *mesh)
{
    for (int32_t node = 0; node < mesh->node_count; node++) {
        const double *x = mesh->x + 3 * (size_t)node;
        if (!(fabs(x[0]) <= MAX_COORDINATE && fabs(x[1]) <= MAX_COORDINATE && fabs(x[2]) <= MAX_COORDINATE))
            return drape_mesh_fail(ctx, source, 0,
                                   "node %d is at (%g, %g, %g) m; coordinates must be finite and within %g m",
                                   node, x[0], x[1], x[2], MAX_COORDINATE);
    }
    return DRAPE_OK;
}

drape_status drape_mesh_validate_indices(drape_context *ctx, const drape_mesh_source *source,
                                         const drape_mesh *mesh)
{
    if (mesh->node_count == 0 || mesh->triangle_count == 0)
        return drape_mesh_fail(ctx, source, 0, "the mesh has no %s",
                               mesh->node_count == 0 ? "nodes" : "triangles");
    for (int32_t triangle = 0; triangle < mesh->triangle_count; triangle++) {
        const int32_t *n = mesh->triangle + 3 * (size_t)triangle;
        for (int k = 0; k < 3; k++)
            if (n[k] < 0 || n[k] >= mesh->node_count)
                return drape_mesh_fail(ctx, source, 0,
                                       "triangle %d (nodes %d %d %d): there is no node %d, range is 0 to %d",
                                       triangle, n[0], n[1], n[2], n[k], mesh->node_count - 1);
    }
    return DRAPE_OK;
}

static drape_status check_shapes(drape_context *ctx, const drape_mesh_source *source, const drape_mesh *mesh,
                                 bool may_merge)
{
    for (int32_t triangle = 0; triangle < mesh->triangle_count; triangle++) {
        const int32_t *n = mesh->triangle + 3 * (size_t)triangle;
        /* The altitude over the longest edge l is (2 area / l) / l; 0 if the triangle is too small to be
         * measured. */
        double side[3][3], normal[3], longest_squared = 0;
        for (int k = 0; k < 3; k++) {
            vec3_sub(mesh->x + 3 * (size_t)n[(k + 1) % 3], mesh->x + 3 * (size_t)n[k], side[k]);
            longest_squared = fmax(longest_squared, vec3_dot(side[k], side[k]));
        }
        vec3_cross(side[0], side[1], normal);
        const double ratio = longest_squared > 0 ? vec3_norm(normal) / longest_squared : 0;
        if (!(ratio >= MIN_THINNESS)) {
            char remedy[DRAPE_REMEDY_SIZE];
            drape_remedy_degenerate(mesh, n, may_merge, remedy);
            return drape_mesh_fail(ctx, source, 0,
                                   "triangle %d (nodes %d %d %d) is degenerate: altitude / longest "
                                   "edge is %g, at least %g is needed%s",
                                   triangle, n[0], n[1], n[2], ratio, MIN_THINNESS, remedy);
        }
    }
    return DRAPE_OK;
}

drape_status drape_mesh_validate_shapes(drape_context *ctx, const drape_mesh_source *source,
                                        const drape_mesh *mesh)
{
    return check_shapes(ctx, source, mesh, false);
}

/* Returns the nodes of each triangle in ascending order. (triangle_count x 3) */
static int32_t *sort_corners(drape_arena *scratch, const drape_mesh *mesh)
{
    int32_t *sorted = drape_arena_take(scratch, (size_t)mesh->triangle_count, 3 * sizeof *sorted);
    if (!sorted)
        return NULL;
    for (int32_t triangle = 0; triangle < mesh->triangle_count; triangle++) {
        const int32_t *n = mesh->triangle + 3 * (size_t)triangle;
        int32_t *out = sorted + 3 * (size_t)triangle;
        const int low = n[0] < n[1] ? (n[0] < n[2] ? 0 : 2) : (n[1] < n[2] ? 1 : 2);
        const int32_t a = n[(low + 1) % 3], b = n[(low + 2) % 3];
        out[0] = n[low];
        out[1] = a < b ? a : b;
        out[2] = a < b ? b : a;
    }
    return sorted;
}

static drape_status check_duplicates(drape_context *ctx, const drape_mesh_source *source,
                                     const drape_mesh *mesh)
{
    drape_arena scratch = drape_arena_of(ctx);
    const int32_t *corners = sort_corners(&scratch, mesh), *order = NULL;
    if (corners)
        order = drape_order_by_keys(&scratch, corners, 3, mesh->triangle_count, mesh->node_count);
    drape_status status = order ? DRAPE_OK : DRAPE_E_MEMORY;
    for (int32_t i = 1; !status && i < mesh->triangle_count; i++) {
        const int32_t *a = corners + 3 * (size_t)order[i - 1], *b = corners + 3 * (size_t)order[i];
        if (a[0] == b[0] && a[1] == b[1] && a[2] == b[2])
            status = drape_mesh_fail(
                ctx, source, 0,
                "triangles %d and %d have the same nodes %d %d %d; remedy: delete one of them", order[i - 1],
                order[i], a[0], a[1], a[2]);
    }
    drape_arena_free(&scratch);
    return status;
}

drape_status drape_mesh_validate_triangles(drape_context *ctx, const drape_mesh_source *source,
                                           const drape_mesh *mesh)
{
    DRAPE_TRY(drape_mesh_validate_indices(ctx, source, mesh));
    for (int32_t triangle = 0; triangle < mesh->triangle_count; triangle++) {
        const int32_t *n = mesh->triangle + 3 * (size_t)triangle;
        if (n[0] == n[1] || n[1] == n[2] || n[2] == n[0])
            return drape_mesh_fail(ctx, source, 0, "triangle %d (nodes %d %d %d) uses a node twice", triangle,
                                   n[0], n[1], n[2]);
    }
    DRAPE_TRY(check_shapes(ctx, source, mesh, true));
    return check_duplicates(ctx, source, mesh);
}

/* Corner 3 t + k is node k of triangle t. */
static int32_t corner_at(const drape_mesh *mesh, int32_t triangle, int32_t node)
{
    const int32_t *n = mesh->triangle + 3 * (size_t)triangle;
    return 3 * triangle + (n[0] == node ? 0 : n[1] == node ? 1 : 2);
}

/* Joins the corners of the two triangles of each inner edge, at both of its ends: the resulting sets are the
 * fans. */
static void join_fans(const drape_mesh *mesh, int32_t *parent)
{
    for (int32_t corner = 0; corner < 3 * mesh->triangle_count; corner++)
        parent[corner] = corner;
    for (int32_t edge = 0; edge < mesh->edge_count; edge++) {
        const int32_t *beside = mesh->edge_triangle + 2 * (size_t)edge;
        for (int end = 0; end < 2 && beside[1] >= 0; end++) {
            const int32_t node = mesh->edge[2 * (size_t)edge + (size_t)end];
            drape_set_join(parent, corner_at(mesh, beside[0], node), corner_at(mesh, beside[1], node));
        }
    }
}

/* Whether the triangles have different nodes at one place. */
static bool is_doubled(const drape_mesh *mesh, int32_t a, int32_t b, int32_t twin[2])
{
    for (int i = 0; i < 9; i++) {
        twin[0] = mesh->triangle[3 * (size_t)a + (size_t)(i / 3)];
        twin[1] = mesh->triangle[3 * (size_t)b + (size_t)(i % 3)];
        const double *p = mesh->x + 3 * (size_t)twin[0], *q = mesh->x + 3 * (size_t)twin[1];
        if (twin[0] != twin[1] && p[0] == q[0] && p[1] == q[1] && p[2] == q[2])
            return true;
    }
    return false;
}

/* fan (node_count) is workspace: the first fan found at each node, initially -1. */
static drape_status check_fans(drape_context *ctx, const drape_mesh_source *source, const drape_mesh *mesh,
                               const int32_t *parent, int32_t *fan)
{
    for (int32_t node = 0; node < mesh->node_count; node++)
        fan[node] = -1;
    for (int32_t corner = 0; corner < 3 * mesh->triangle_count; corner++) {
        const int32_t node = mesh->triangle[corner];
        if (parent[corner] != corner)
            continue;
        int32_t twin[2];
        if (fan[node] >= 0 && is_doubled(mesh, fan[node] / 3, corner / 3, twin))
            return drape_mesh_fail(
                ctx, source, 0,
                "triangles %d and %d touch only at node %d, because nodes %d and %d are two "
                "at one place; remedy: merge them, at (%.4g, %.4g, %.4g) m",
                fan[node] / 3, corner / 3, node, twin[0], twin[1], mesh->x[3 * (size_t)twin[0]],
                mesh->x[3 * (size_t)twin[0] + 1], mesh->x[3 * (size_t)twin[0] + 2]);
        if (fan[node] >= 0)
            return drape_mesh_fail(ctx, source, 0,
                                   "triangles %d and %d touch only at node %d; the triangles "
                                   "around a node must be joined by edges; remedy: give one of them a "
                                   "vertex of its own there, at (%.4g, %.4g, %.4g) m, or join them by faces",
                                   fan[node] / 3, corner / 3, node, mesh->x[3 * (size_t)node],
                                   mesh->x[3 * (size_t)node + 1], mesh->x[3 * (size_t)node + 2]);
        fan[node] = corner;
    }
    int32_t loose = 0, first = -1;
    for (int32_t node = mesh->node_count - 1; node >= 0; node--)
        if (fan[node] < 0) {
            first = node;
            loose++;
        }
    return loose == 0
               ? DRAPE_OK
               : drape_mesh_fail(ctx, source, 0,
                                 "node %d belongs to no triangle; remedy: delete loose vertices, of which "
                                 "there %s %d",
                                 first, loose > 1 ? "are" : "is", loose);
}

drape_status drape_mesh_validate_nodes(drape_context *ctx, const drape_mesh_source *source,
                                       const drape_mesh *mesh)
{
    drape_status status = DRAPE_E_MEMORY;
    drape_arena scratch = drape_arena_of(ctx);
    int32_t *parent = drape_arena_take(&scratch, 3 * (size_t)mesh->triangle_count, sizeof *parent);
    int32_t *fan = drape_arena_take(&scratch, (size_t)mesh->node_count, sizeof *fan);
    if (!drape_arena_status(&scratch)) {
        join_fans(mesh, parent);
        status = check_fans(ctx, source, mesh, parent, fan);
    }
    drape_arena_free(&scratch);
    return status;
}
