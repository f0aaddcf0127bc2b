/*
 * intersect.c: see intersect.h. Triangles are listed in the cells of a uniform grid that their boxes
 * touch; an edge is tried against the triangles of the cells that its box touches. A pair meets in several
 * cells and is tried in the one that holds the low corner of the overlap of both boxes. An edge p q
 * crosses triangle a b c where p and q lie on different sides of its plane and the line through them
 * leaves a b, b c and c a on the same side: five signs of tetrahedron volumes (Moeller & Trumbore 1997
 * compute the same).
 */
#include "contact/intersect.h"

#include "base/vec3.h"

#include <math.h>

#define CELLS_A_TRIANGLE 4 /* the grid has at most this many cells a triangle */

typedef struct box {
    double low[3], high[3];
} box;

typedef struct grid {
    double origin[3], size; /* [m] */
    int32_t cells[3];
    int64_t *start;    /* (cells + 1) */
    int32_t *triangle; /* (entries) */
} grid;

static box box_of(const double *x, const int32_t *node, int count)
{
    box b;
    for (int k = 0; k < 3; k++) {
        b.low[k] = b.high[k] = x[3 * (size_t)node[0] + (size_t)k];
        for (int a = 1; a < count; a++) {
            b.low[k] = fmin(b.low[k], x[3 * (size_t)node[a] + (size_t)k]);
            b.high[k] = fmax(b.high[k], x[3 * (size_t)node[a] + (size_t)k]);
        }
    }
    return b;
}

static int32_t cell_of(const grid *g, double x, int k)
{
    double cell = floor((x - g->origin[k]) / g->size);
    return cell < 0 ? 0 : cell >= g->cells[k] ? g->cells[k] - 1 : (int32_t)cell;
}

/* Cells about as large as a mean edge, and no more of them than triangles can pay for. */
static void lay_out(const drape_model *m, const double *x, grid *g)
{
    box all = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    double sum = 0, limit = (double)CELLS_A_TRIANGLE * m->triangle_count + 8, count;
    for (size_t i = 0; i < 3 * (size_t)m->node_count; i++) {
        all.low[i % 3] = fmin(all.low[i % 3], x[i]);
        all.high[i % 3] = fmax(all.high[i % 3], x[i]);
    }
    for (int32_t e = 0; e < m->edge_count; e++)
        sum += m->edge_length[e];
    g->size = sum / m->edge_count;
    do {
        count = 1;
        for (int k = 0; k < 3; k++)
            count *= floor((all.high[k] - all.low[k]) / g->size) + 1;
        if (count > limit)
            g->size *= 1.25;
    } while (count > limit);
    for (int k = 0; k < 3; k++) {
        g->origin[k] = all.low[k];
        g->cells[k] = (int32_t)floor((all.high[k] - all.low[k]) / g->size) + 1;
    }
}

typedef void visit_cell(void *user, int64_t cell, const int32_t at[3]);

static void visit_cells(const grid *g, const box *b, visit_cell *visit, void *user)
{
    int32_t low[3], high[3], at[3];
    for (int k = 0; k < 3; k++) {
        low[k] = cell_of(g, b->low[k], k);
        high[k] = cell_of(g, b->high[k], k);
    }
    for (at[2] = low[2]; at[2] <= high[2]; at[2]++)
        for (at[1] = low[1]; at[1] <= high[1]; at[1]++)
            for (at[0] = low[0]; at[0] <= high[0]; at[0]++)
                visit(user, ((int64_t)at[2] * g->cells[1] + at[1]) * g->cells[0] + at[0], at);
}

/* Filling: first the counts, then the numbers. */
typedef struct filling {
    grid *grid;
    int64_t *next; /* NULL while counting */
    int32_t triangle;
} filling;

static void fill_cell(void *user, int64_t cell, const int32_t at[3])
{
    (void)at;
    filling *f = user;
    if (f->next)
        f->grid->triangle[f->next[cell]++] = f->triangle;
    else
        f->grid->start[cell + 1]++;
}

static void fill_all(const drape_model *m, const double *x, filling *f)
{
    for (f->triangle = 0; f->triangle < m->triangle_count; f->triangle++) {
        box b = box_of(x, m->triangle + 3 * (size_t)f->triangle, 3);
        visit_cells(f->grid, &b, fill_cell, f);
    }
}

static drape_status fill(drape_context *ctx, const drape_model *m, const double *x, grid *g)
{
    int64_t cells = (int64_t)g->cells[0] * g->cells[1] * g->cells[2];
    filling f = {.grid = g};
    g->start = drape_alloc(ctx, (size_t)cells + 1, sizeof *g->start);
    int64_t *next = drape_alloc(ctx, (size_t)cells, sizeof *next);
    if (g->start && next) {
        fill_all(m, x, &f);
        for (int64_t c = 0; c < cells; c++) {
            g->start[c + 1] += g->start[c];
            next[c] = g->start[c];
        }
        g->triangle = drape_alloc(ctx, (size_t)g->start[cells], sizeof *g->triangle);
    }
    f.next = next;
    if (g->triangle)
        fill_all(m, x, &f);
    drape_free(ctx, next);
    return g->triangle ? DRAPE_OK : DRAPE_E_MEMORY;
}

/* Six times the volume of the tetrahedron a b c d. */
static double volume(const double *a, const double *b, const double *c, const double *d)
{
    double u[3], v[3], w[3], n[3];
    vec3_sub(b, a, u);
    vec3_sub(c, a, v);
    vec3_sub(d, a, w);
    vec3_cross(u, v, n);
    return vec3_dot(n, w);
}

static bool crosses(const double *x, const int32_t *edge, const int32_t *triangle)
{
    for (int i = 0; i < 6; i++)
        if (edge[i / 3] == triangle[i % 3])
            return false;
    const double *p = x + 3 * (size_t)edge[0], *q = x + 3 * (size_t)edge[1];
    const double *a = x + 3 * (size_t)triangle[0], *b = x + 3 * (size_t)triangle[1],
                 *c = x + 3 * (size_t)triangle[2];
    if ((volume(a, b, c, p) > 0) == (volume(a, b, c, q) > 0))
        return false;
    bool ab = volume(p, q, a, b) > 0;
    return ab == (volume(p, q, b, c) > 0) && ab == (volume(p, q, c, a) > 0);
}

/* One edge against the triangles of a cell. */
typedef struct search {
    const drape_model *model;
    const double *x;
    const grid *grid;
    const int32_t *edge;
    box box;
    drape_intersections *found;
} search;

/* Whether this cell is the one in which the two boxes are to meet; false if they do not overlap. */
static bool meets_here(const search *s, const box *other, const int32_t at[3])
{
    for (int k = 0; k < 3; k++) {
        double low = fmax(s->box.low[k], other->low[k]);
        if (low > fmin(s->box.high[k], other->high[k]) || cell_of(s->grid, low, k) != at[k])
            return false;
    }
    return true;
}

static void search_cell(void *user, int64_t cell, const int32_t at[3])
{
    search *s = user;
    for (int64_t i = s->grid->start[cell]; i < s->grid->start[cell + 1]; i++) {
        const int32_t *triangle = s->model->triangle + 3 * (size_t)s->grid->triangle[i];
        box other = box_of(s->x, triangle, 3);
        if (!meets_here(s, &other, at) || !crosses(s->x, s->edge, triangle))
            continue;
        if (s->found->count++ > 0)
            continue;
        for (int a = 0; a < 3; a++) {
            s->found->triangle[a] = triangle[a];
            s->found->edge[a % 2] = s->edge[a % 2];
        }
    }
}

drape_status drape_find_intersections(drape_context *ctx, const drape_model *m, const double *x,
                                      drape_intersections *found)
{
    grid g = {0};
    *found = (drape_intersections){.edge = {-1, -1}, .triangle = {-1, -1, -1}};
    lay_out(m, x, &g);
    drape_status status = fill(ctx, m, x, &g);
    for (int32_t e = 0; !status && e < m->edge_count; e++) {
        search s = {.model = m, .x = x, .grid = &g, .edge = m->edge + 2 * (size_t)e, .found = found};
        s.box = box_of(x, s.edge, 2);
        visit_cells(&g, &s.box, search_cell, &s);
    }
    drape_free(ctx, g.start);
    drape_free(ctx, g.triangle);
    return status;
}
