/* spring.c: see spring.h. With n n' and P = (I - n n')/l: dq = (-n, n), ddq = [P -P; -P P]. */
#include "terms/spring.h"

#include "base/vec3.h"

#include <math.h>
#include <stdlib.h>

enum { REST_K, REST_LENGTH, REST_DAMPING, REST_COUNT };

const drape_spring_offset drape_spring_offsets[DRAPE_SPRING_OFFSETS] = {
    [DRAPE_SPRING_STRUCTURAL] = {0, 1}, {1, 0}, [DRAPE_SPRING_SHEAR] = {1, 1}, {1, -1},
    [DRAPE_SPRING_BEND] = {0, 2},       {2, 0}};

const drape_param drape_spring_params[DRAPE_SPRING_PARAM_COUNT] = {
    [DRAPE_SPRING_STIFFNESS] =
        DRAPE_NUMBER("stiffness", "N/m", DRAPE_REQUIRED, 0, 1e15,
                     "spring constant of each spring, whatever its length and the mesh"),
    [DRAPE_SPRING_FACTOR] = DRAPE_NUMBER(
        "factor", "1", 1, 0, 1e6,
        "multiplies stiffness, so that all kinds can have the same one: 0.2 for the bend springs of CS184"),
    [DRAPE_SPRING_DAMPING] =
        DRAPE_NUMBER("damping", "N s/m", 0, 0, 1e12,
                     "dashpot of each spring: force per rate of change of its length; zero on rigid motion"),
    [DRAPE_SPRING_GRADIENT] =
        DRAPE_NUMBER("gradient", "1", 0, -1, 1e6,
                     "stiffness times 1 + gradient (1 - row/rows), the mean of both ends: stiffer at row 0"),
    [DRAPE_SPRING_REST_SCALE] =
        DRAPE_NUMBER("rest_scale", "1", 1, DRAPE_ABOVE(0), 1e3,
                     "rest length over the distance in the mesh: below 1 the springs start stretched"),
};

/* ---- Pairs of nodes ---- */

/* The number of nodes in a row whose partner is on the grid. */
static int32_t columns_of(const drape_cloth_view *cloth, const drape_spring_offset *offset)
{
    int32_t columns = cloth->columns - abs(offset->columns);
    return columns > 0 ? columns : 0;
}

static int32_t offset_count(const drape_cloth_view *cloth, const drape_spring_offset *offset)
{
    int32_t rows = cloth->rows - offset->rows;
    return rows > 0 ? rows * columns_of(cloth, offset) : 0;
}

int32_t drape_spring_count(const drape_spring_set *set)
{
    int32_t count = 0;
    for (int k = 0; k < set->offset_count; k++)
        count += offset_count(set->cloth, &set->offset[k]);
    return set->offset_count > 0 ? count : set->cloth->edge_count;
}

void drape_spring_pair(const drape_spring_set *set, int32_t spring, int32_t pair[2])
{
    const drape_spring_offset *offset = set->offset;
    if (set->offset_count == 0) {
        pair[0] = set->cloth->edge[2 * (size_t)spring];
        pair[1] = set->cloth->edge[2 * (size_t)spring + 1];
        return;
    }
    for (; spring >= offset_count(set->cloth, offset); offset++)
        spring -= offset_count(set->cloth, offset);
    int32_t columns = columns_of(set->cloth, offset), skip = offset->columns < 0 ? -offset->columns : 0;
    pair[0] = spring / columns * set->cloth->columns + spring % columns + skip;
    pair[1] = pair[0] + offset->rows * set->cloth->columns + offset->columns;
}

double drape_spring_rest_length(const drape_cloth_view *cloth, const int32_t pair[2])
{
    double d[3];
    vec3_sub(cloth->rest + 3 * (size_t)pair[1], cloth->rest + 3 * (size_t)pair[0], d);
    return vec3_norm(d);
}

/* ---- Building ---- */

drape_status drape_spring_build(const drape_spring_set *set, const double *values,
                                drape_term_builder *builder)
{
    if (values[DRAPE_SPRING_GRADIENT] != 0 &&
        !(set->cloth->rows > 0 && set->cloth->node_count == set->cloth->given_count))
        return drape_term_refuse(builder,
                                 "\"gradient\" = %g goes from row to row of a grid; this mesh has no rows",
                                 values[DRAPE_SPRING_GRADIENT]);
    const int32_t count = drape_spring_count(set), columns = set->cloth->columns;
    const double gradient = values[DRAPE_SPRING_GRADIENT];
    DRAPE_TRY(drape_term_reserve(builder, count, REST_COUNT));
    for (int32_t i = 0; i < count; i++) {
        int32_t pair[2];
        drape_spring_pair(set, i, pair);
        double k = values[DRAPE_SPRING_STIFFNESS] * values[DRAPE_SPRING_FACTOR];
        /* The mean of both ends, so that the forces at both are equal: with the row of the neighbour, as in
         * Boson, they differ, and the net force of a sheet is not zero. */
        if (gradient != 0)
            k *= 1 + gradient * (1 - 0.5 * (pair[0] / columns + pair[1] / columns) / set->cloth->rows);
        double rest[REST_COUNT] = {[REST_K] = k,
                                   [REST_LENGTH] = values[DRAPE_SPRING_REST_SCALE] *
                                                   drape_spring_rest_length(set->cloth, pair),
                                   [REST_DAMPING] = values[DRAPE_SPRING_DAMPING]};
        drape_term_set(builder, i, pair, rest);
    }
    return DRAPE_OK;
}

drape_status drape_spring_build_kind(const drape_cloth_view *cloth, int kind, const double *values,
                                     drape_term_builder *builder)
{
    const drape_spring_set set = {.cloth = cloth,
                                  .offset = drape_spring_offsets + kind,
                                  .offset_count = DRAPE_SPRING_SHEAR - DRAPE_SPRING_STRUCTURAL};
    if (!drape_spring_on_grid(cloth))
        return drape_term_refuse(builder, "these springs join rows and columns of the grid \"square\"%s",
                                 cloth->rectangular
                                     ? ", which is not to be subdivided"
                                     : "; other meshes have only spring.structural, along edges");
    return drape_spring_build(&set, values, builder);
}

/* ---- The spring ---- */

void drape_spring_measure(const drape_elements *el, int32_t first, int32_t count, const double *x,
                          const double *internal, double *q, double *dq, double *ddq)
{
    (void)internal;
    for (int32_t i = 0; i < count; i++) {
        const int32_t *node = el->node + 2 * (size_t)(first + i);
        double n[3];
        vec3_sub(x + 3 * (size_t)node[1], x + 3 * (size_t)node[0], n);
        q[i] = vec3_norm(n);
        for (int k = 0; k < 3; k++)
            n[k] /= q[i];
        for (int k = 0; dq && k < 3; k++) {
            dq[6 * i + 3 + k] = n[k];
            dq[6 * i + k] = -n[k];
        }
        double p[9];
        for (int k = 0; ddq && k < 9; k++)
            p[k] = ((k % 4 == 0) - n[k / 3] * n[k % 3]) / q[i];
        if (ddq)
            drape_pair_block(p, ddq + 36 * (size_t)i);
    }
}

/* dq = (-d, d)/l */
void drape_spring_pairs(const drape_elements *el, int32_t first, int32_t count, const double *x, double *q,
                        double *d, double *c)
{
    drape_pair_distance(el, first, count, x, q, d);
    for (int32_t i = 0; i < count; i++)
        c[i] = 1 / q[i];
}

static double ratio_of(const drape_elements *el, int32_t e, const double *x)
{
    return drape_pair_length(el, e, x) / drape_rest_of(el, REST_LENGTH, e);
}

drape_status drape_spring_check(const drape_elements *el, const double *x, const double *before,
                                const double *internal, drape_fault *fault)
{
    (void)internal;
    return drape_check_ratios(el, x, before, 1, ratio_of, DRAPE_REASON_SPRING_COLLAPSE,
                              "spring length / rest length", fault);
}
