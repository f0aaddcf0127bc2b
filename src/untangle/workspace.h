/*
 * workspace.h: what the files of untangler.h share. bounds.c: half spaces that positions are to be in, and
 * the positions in them with the least distortion; contours.c: where sheets pass through each other, and
 * which part of them is on the wrong side; bodies.c: what is inside closed colliders; gaps.c: pairs that are
 * apart and stay apart; untangler.c: the topology of the sheets, and the sweeps.
 */
#ifndef DRAPE_UNTANGLE_WORKSPACE_H
#define DRAPE_UNTANGLE_WORKSPACE_H

#include "base/vec3.h"
#include "contact/broad_phase.h"
#include "contact/sort_pairs.h"
#include "geometry/nearest.h"
#include "untangle/untangler.h"

/* The surfaces that have no inside: the cloths, and open colliders, which do not move. Points are those of
 * the broad phase. */
typedef struct drape_sheets {
    int32_t edge_count, triangle_count;
    int32_t *edge, *triangle; /* (edge_count x 2), (triangle_count x 3): those of the cloths first */
    int32_t *edge_triangle;   /* (edge_count x 2) at the edge; -1: none, it is on a boundary */
    drape_elements_of edges;  /* at each point */
    int32_t *of_point;        /* (points) number of the cloth or, after these, of the collider */
} drape_sheets;

/* A bound that positions must keep: the sum of c_i n . x_i is at least `bound`. */
typedef struct drape_half_space {
    int32_t node[4]; /* -1: none */
    double c[4], normal[3], bound;
} drape_half_space;

/* An edge that passes through a triangle, and the point where it does. */
typedef struct drape_crossing {
    int32_t edge, triangle;
    double t, x[3];  /* x = (1 - t) p + t q */
    int32_t contour; /* number of the curve that it is a point of */
    int8_t trace;    /* 0 or 1: the side of the curve that the edge belongs to */
} drape_crossing;

/* A crossing seen from one of the two pairs of triangles that it belongs to. */
typedef struct drape_crossing_record {
    int32_t triangle[2]; /* the lower one first */
    int32_t crossing;
    bool edge_in_first; /* the edge is one of triangle[0] */
} drape_crossing_record;

/* A point that is to pass to the other side of a sheet: its gaps from that sheet do not count. */
typedef struct drape_passage {
    int32_t point, sheet;
} drape_passage;

/* The direction out of closed colliders for a piece of cloth that is inside for the most part. */
typedef struct drape_untangle_exit {
    bool chosen;
    double direction[3];
} drape_untangle_exit;

typedef struct drape_untangler {
    drape_context *ctx;
    drape_arena *arena;
    const drape_model *model;
    const drape_untangle_limits *def;
    drape_broad_phase broad;
    drape_pair *close_pairs; /* (pair_count of pair_capacity) that may be near each other, by rank */
    int32_t pair_count, pair_capacity;
    drape_pair_sorter sorter;
    drape_collider_pose *pose;   /* (collider_count) */
    const drape_collider **body; /* (collider_count) as they are at the time */
    bool *open;                  /* (collider_count) it has no inside */
    double (*box)[2][3];         /* (collider_count) around the points of those with triangles */
    drape_sheets sheets;
    drape_bvh *tree;        /* (cloths, and colliders) of the triangles of each sheet, fitted to x */
    double mean_edge, area; /* [m], [m2] of all cloth */
    double *x;              /* (points x 3) present positions */
    double *start;          /* (points x 3) at the beginning of the sweep */
    double *best;           /* (points x 3) the positions with the fewest crossings so far */
    double *mobility;       /* (points) 1: it moves; 0: a pin or a point of a collider */
    bool *moved;            /* (points) it has moved in some sweep */
    double *length;         /* (edges of the model) [m] in the state that was given */
    int32_t *hinge;         /* (hinge_count x 2) nodes opposite of an edge */
    double *face_area;      /* (triangles of the model) [m2] in the state that was given */
    double *hinge_length;   /* (hinge_count) [m] in the state that was given */
    int32_t hinge_count;
    drape_half_space *bounds; /* (bound_count of bound_capacity) of this sweep */
    int32_t bound_count, bound_capacity;
    drape_crossing *crossing; /* (crossing_count of crossing_capacity) of this sweep */
    int32_t crossing_count, crossing_capacity;
    drape_crossing_record *record;
    int32_t record_count, record_capacity;
    drape_passage *passage; /* (passage_count of passage_capacity) sorted */
    int32_t passage_count, passage_capacity;
    bool *passes;    /* (points) it has a passage */
    int8_t *colour;  /* (points) scratch of a curve */
    int32_t *queue;  /* (points) scratch */
    int32_t *block;  /* (edge_count) scratch: how often the curve passes through the edge */
    bool *sunk;      /* (node_count) in a collider, or a corner of a face that is */
    double *depth;   /* (node_count) signed distance from the body in which it is deepest; 0: in none */
    double *outward; /* (node_count x 3) its gradient, where it is not 0 */
    int32_t *piece;  /* (node_count) number of the connected piece of cloth */
    int32_t piece_count;
    drape_untangle_exit *exit; /* (piece_count) */
    int64_t sunk_count;        /* nodes, and faces between them, that are in a collider */
    double min_share;          /* the smallest gap, in least gaps */
    double min_wanted;         /* the smallest gap, in wanted gaps */
    bool out_of_memory;        /* of a list, in a callback */
} drape_untangler;

/* The largest displacement [m] of a point in a sweep. */
#define DRAPE_UNTANGLE_STRIDE 0.5 /* of the mean edge */
static inline double drape_untangle_stride(const drape_untangler *u)
{
    return DRAPE_UNTANGLE_STRIDE * u->mean_edge;
}

/* The gap [m] that is wanted at an activation distance [m]. */
static inline double drape_untangle_wanted(const drape_untangler *u, double distance)
{
    return u->def->gap * distance;
}

/* bounds.c. The first two set out_of_memory where there is none. */
void drape_untangle_bound(drape_untangler *u, const drape_half_space *bound);
void drape_untangle_add_passage(drape_untangler *u, int32_t point, int32_t sheet);
void drape_untangle_sort_passages(drape_untangler *u); /* after the last one was added */
bool drape_untangle_passes(const drape_untangler *u, int32_t point, int32_t sheet);

/* Moves x to where bounds, lengths and bends are kept as well as possible. */
void drape_untangle_project(drape_untangler *u);

/* contours.c: finds all crossings of sheets, and adds the bounds that take them apart, and the passages. */
drape_status drape_untangle_contours(drape_untangler *u);

/* bodies.c: adds bounds for nodes and faces in closed colliders, and counts these. */
drape_status drape_untangle_bodies(drape_untangler *u);

/* gaps.c: adds bounds for pairs that are near each other, except where they pass through, and measures their
 * gaps. */
drape_status drape_untangle_gaps(drape_untangler *u);

#endif
