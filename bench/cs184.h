/*
 * cs184.h: the loops of the CS184 cloth simulator, written anew from what is known of it (docs/seed_systems.md), as plainly
 * as its students do: an array of point masses, a list of springs that point at them, a hash map of the boxes of
 * space for points that come too near, one pass over the springs that are too long. What `verlet` is measured against.
 *
 * The map, an std::unordered_map of vectors there, is made anew in each substep, its lists too.
 */
#ifndef DRAPE_BENCH_CS184_H
#define DRAPE_BENCH_CS184_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define CS184_BUCKETS 4096

typedef enum cs184_kind { CS184_STRUCTURAL, CS184_SHEARING, CS184_BENDING } cs184_kind;

typedef struct cs184_point {
    double position[3], last[3], force[3];
    bool pinned;
} cs184_point;

typedef struct cs184_spring {
    cs184_point *a, *b;
    double rest; /* [m] */
    cs184_kind kind;
} cs184_spring;

/* The points of one box. */
typedef struct cs184_box {
    int64_t key[3];
    cs184_point **points;
    int count, room, next; /* next box of the same bucket, -1: none */
} cs184_box;

typedef struct cs184 {
    int side;
    double width, thickness, ks, damping, mass; /* damping [%] */
    int substeps;
    double frame_rate; /* [1/s] */
    bool enabled[3];
    cs184_point *points; /* (side x side), rows first */
    cs184_spring *springs;
    int spring_count;
    int heads[CS184_BUCKETS];
    cs184_box *boxes;
    int box_count, box_room;
} cs184;

static inline void *cs184_take(void *old, size_t size)
{
    void *new = realloc(old, size);
    if (!new)
        exit(1);
    return new;
}

static inline double cs184_between(const double *a, const double *b, double d[3])
{
    for (int k = 0; k < 3; k++)
        d[k] = a[k] - b[k];
    return sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
}

/* ---- Making and freeing ---- */

static inline void cs184_join(cs184 *c, int row, int column, int to_row, int to_column, cs184_kind kind)
{
    if (to_row < 0 || to_column < 0 || to_column >= c->side)
        return;
    double d[3];
    cs184_spring *s = &c->springs[c->spring_count++];
    *s = (cs184_spring){
        .a = &c->points[row * c->side + column], .b = &c->points[to_row * c->side + to_column], .kind = kind};
    s->rest = cs184_between(s->a->position, s->b->position, d);
}

/* start: (side x side x 3); pinned: (side x side). The rest of the members of *c is set. */
static inline void cs184_open(cs184 *c, const double *start, const bool *pinned)
{
    size_t count = (size_t)c->side * (size_t)c->side;
    c->points = cs184_take(NULL, count * sizeof *c->points);
    c->springs = cs184_take(NULL, 6 * count * sizeof *c->springs);
    c->spring_count = c->box_count = c->box_room = 0;
    c->boxes = NULL;
    for (size_t i = 0; i < count; i++) {
        c->points[i] = (cs184_point){.pinned = pinned[i]};
        memcpy(c->points[i].position, start + 3 * i, sizeof c->points[i].position);
        memcpy(c->points[i].last, start + 3 * i, sizeof c->points[i].last);
    }
    for (int row = 0; row < c->side; row++)
        for (int column = 0; column < c->side; column++) {
            cs184_join(c, row, column, row, column - 1, CS184_STRUCTURAL);
            cs184_join(c, row, column, row - 1, column, CS184_STRUCTURAL);
            cs184_join(c, row, column, row - 1, column - 1, CS184_SHEARING);
            cs184_join(c, row, column, row - 1, column + 1, CS184_SHEARING);
            cs184_join(c, row, column, row, column - 2, CS184_BENDING);
            cs184_join(c, row, column, row - 2, column, CS184_BENDING);
        }
}

static inline void cs184_close(cs184 *c)
{
    for (int i = 0; i < c->box_count; i++)
        free(c->boxes[i].points);
    free(c->boxes);
    free(c->springs);
    free(c->points);
}

/* ---- A substep ---- */

static inline void cs184_forces(cs184 *c, double gravity)
{
    for (int i = 0; i < c->side * c->side; i++) {
        c->points[i].force[0] = c->points[i].force[2] = 0;
        c->points[i].force[1] = c->mass * gravity;
    }
    for (int i = 0; i < c->spring_count; i++) {
        cs184_spring *s = &c->springs[i];
        if (!c->enabled[s->kind])
            continue;
        double d[3], length = cs184_between(s->b->position, s->a->position, d);
        double pull = c->ks * (s->kind == CS184_BENDING ? 0.2 : 1) * (length - s->rest) / length;
        for (int k = 0; k < 3; k++) {
            s->a->force[k] += pull * d[k];
            s->b->force[k] -= pull * d[k];
        }
    }
}

static inline void cs184_verlet(cs184 *c, double h)
{
    for (int i = 0; i < c->side * c->side; i++) {
        cs184_point *p = &c->points[i];
        for (int k = 0; k < 3 && !p->pinned; k++) {
            double x = p->position[k];
            p->position[k] = x + (1 - c->damping / 100) * (x - p->last[k]) + p->force[k] / c->mass * h * h;
            p->last[k] = x;
        }
    }
}

static inline cs184_box *cs184_box_of(cs184 *c, const double *x, bool make)
{
    const double size = 3 * c->width / c->side;
    const int64_t key[3] = {(int64_t)(x[0] / size), (int64_t)(x[1] / size), (int64_t)(x[2] / size)};
    uint64_t hash =
        (uint64_t)key[0] * 73856093u ^ (uint64_t)key[1] * 19349663u ^ (uint64_t)key[2] * 83492791u;
    int *head = &c->heads[hash % CS184_BUCKETS];
    for (int i = *head; i >= 0; i = c->boxes[i].next)
        if (memcmp(c->boxes[i].key, key, sizeof key) == 0)
            return &c->boxes[i];
    if (!make)
        return NULL;
    if (c->box_count == c->box_room) {
        c->boxes = cs184_take(c->boxes, (size_t)(c->box_room + 64) * sizeof *c->boxes);
        c->box_room += 64;
    }
    cs184_box *box = &c->boxes[c->box_count];
    memcpy(box->key, key, sizeof key);
    box->points = NULL;
    box->count = box->room = 0;
    box->next = *head;
    *head = c->box_count++;
    return box;
}

static inline void cs184_forget(cs184 *c)
{
    for (int i = 0; i < c->box_count; i++)
        free(c->boxes[i].points);
    memset(c->heads, -1, sizeof c->heads);
    c->box_count = 0;
}

static inline void cs184_map(cs184 *c)
{
    cs184_forget(c);
    for (int i = 0; i < c->side * c->side; i++) {
        cs184_box *box = cs184_box_of(c, c->points[i].position, true);
        if (box->count == box->room) {
            box->room = box->room > 0 ? 2 * box->room : 1;
            box->points = cs184_take(box->points, (size_t)box->room * sizeof *box->points);
        }
        box->points[box->count++] = &c->points[i];
    }
}

/* Points of the same box, as they stand at this point's turn. */
static inline void cs184_repel(cs184 *c, cs184_point *p)
{
    double sum[3] = {0, 0, 0}, d[3];
    int count = 0;
    const cs184_box *box = cs184_box_of(c, p->position, false);
    for (int i = 0; box && i < box->count; i++) {
        double distance = cs184_between(p->position, box->points[i]->position, d);
        if (box->points[i] == p || !(distance < 2 * c->thickness) || distance == 0)
            continue;
        for (int k = 0; k < 3; k++)
            sum[k] += (2 * c->thickness - distance) / distance * d[k];
        count++;
    }
    for (int k = 0; k < 3 && count > 0 && !p->pinned; k++)
        p->position[k] += sum[k] / count / c->substeps;
}

static inline void cs184_limit(cs184 *c)
{
    for (int i = 0; i < c->spring_count; i++) {
        cs184_spring *s = &c->springs[i];
        double d[3], length = cs184_between(s->b->position, s->a->position, d);
        if (!(length > 1.1 * s->rest) || (s->a->pinned && s->b->pinned))
            continue;
        double excess = (length - 1.1 * s->rest) / length, share = s->a->pinned || s->b->pinned ? 1 : 0.5;
        for (int k = 0; k < 3; k++) {
            s->a->position[k] += s->a->pinned ? 0 : share * excess * d[k];
            s->b->position[k] -= s->b->pinned ? 0 : share * excess * d[k];
        }
    }
}

static inline void cs184_frame(cs184 *c, double gravity)
{
    for (int k = 0; k < c->substeps; k++) {
        cs184_forces(c, gravity);
        cs184_verlet(c, 1 / c->frame_rate / c->substeps);
        cs184_map(c);
        for (int i = 0; i < c->side * c->side; i++)
            cs184_repel(c, &c->points[i]);
        cs184_limit(c);
    }
}

#endif
