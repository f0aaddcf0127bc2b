/*
 * untangle_parts.h: what the files of untangle.h share. untangle.c: the sweeps, and the positions that
 * satisfy all bounds with the least distortion; untangle_contours.c: where sheets pass through each other,
 * and which part of them is on the wrong side; untangle_bodies.c: what is inside closed colliders;
 * untangle_gaps.c: pairs that are apart and stay so.
 */
#ifndef DRAPE_CONTACT_UNTANGLE_PARTS_H
#define DRAPE_CONTACT_UNTANGLE_PARTS_H

#include "base/vec3.h"
#include "contact/broad_phase.h"
#include "contact/sort_pairs.h"
#include "contact/untangle.h"
#include "geometry/nearest.h"

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

typedef struct drape_half_spaces {
    drape_half_space *list; /* (count of room) */
    int32_t count, room;
} drape_half_spaces;

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

/* Points of a sheet that pass to the other side of a sheet or a collider: their gaps there do not count. */
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
    drape_pair *near; /* (near_count of near_room) pairs that may be near each other, by rank */
    int32_t near_count, near_room;
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
    drape_half_spaces bounds; /* of this sweep */
    drape_crossing *crossing; /* (crossing_count of crossing_room) of this sweep */
    int32_t crossing_count, crossing_room;
    drape_crossing_record *record;
    int32_t record_count, record_room;
    drape_passage *passage; /* (passage_count of passage_room) sorted */
    int32_t passage_count, passage_room;
    bool *passes;    /* (points) it has a passage */
    int8_t *colour;  /* (points) scratch of a curve */
    int32_t *queue;  /* (points) scratch */
    int32_t *block;  /* (edge_count) scratch: how often the curve passes through the edge */
    bool *sunk;      /* (node_count) in a collider, or a corner of a face that is */
    double *depth;   /* (node_count) signed distance from the body in which it is deepest; 0: in none */
    double *outward; /* (node_count x 3) its gradient, where it is not 0 */
    int32_t *piece;  /* (node_count) number of the piece of cloth that hangs together */
    int32_t piece_count;
    drape_untangle_exit *exit; /* (piece_count) */
    int64_t sunk_count;        /* nodes, and faces between them, that are in a collider */
    double min_share;          /* the smallest gap, in least gaps */
    double min_wanted;         /* the smallest gap, in wanted gaps */
    bool out_of_memory;        /* of a list, in a callback */
} drape_untangler;

/* Adds a bound; notes if memory is out. */
void drape_untangle_bound(drape_untangler *u, const drape_half_space *bound);

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

/* Finds all crossings of sheets, and adds the bounds that take them apart, and the passages. */
drape_status drape_untangle_contours(drape_untangler *u);
bool drape_untangle_passes(const drape_untangler *u, int32_t point, int32_t sheet);
void drape_untangle_add_passage(drape_untangler *u, int32_t point, int32_t sheet);
void drape_untangle_sort_passages(drape_untangler *u);

/* Adds bounds for nodes and faces in closed colliders, and counts these. */
drape_status drape_untangle_bodies(drape_untangler *u);

/* Adds bounds for pairs that are near each other, except where they pass through, and measures their gaps. */
drape_status drape_untangle_gaps(drape_untangler *u);

#endif
