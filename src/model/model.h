/* model.h: the compiled scene. Everything in it is constant once drape_compile has made it; the state is kept
 * elsewhere. */
#ifndef DRAPE_MODEL_MODEL_H
#define DRAPE_MODEL_MODEL_H

#include "base/arena.h"
#include "base/distance.h"
#include "base/ranks.h"
#include "mesh/mesh.h"
#include "mesh/sequence.h"
#include "model/pose.h"
#include "model/relaxation.h"
#include "model/render_mesh.h"
#include "sparse/pattern.h"

/* The largest magnitude [in SI units, or degrees] that lists of a scene may have, keys of tracks and
 * histories, pivots, velocities, and what hosts give; and the latest time. Others have ranges of their
 * own. */
#define DRAPE_MOST 1e9
/* Share of the scene's size, or of a step, by which places, or times, may be apart that count as the same. */
#define DRAPE_SAME 1e-9

/* The patches of a term with parts: runs of consecutive elements with the same nodes. */
typedef struct drape_patches {
    int32_t count;    /* 0: the term has no parts */
    int32_t *first;   /* (count + 1) the elements of patch i are first[i] ... first[i + 1] - 1 */
    int32_t *node;    /* (count x elements.nodes) */
    uint8_t *used;    /* (count) the nodes from that number on belong to no part */
    int32_t *coupled; /* (elements.count x elements.nodes) the nodes of the parts of each element, and copies
                         of one of them */
} drape_patches;

/* The factor of loads over time (model/history.h). */
typedef struct drape_history {
    char *name;           /* "" of a ramp */
    size_t key_count;     /* at least 1 */
    double *time, *value; /* (key_count) [s], ascending; [1] */
    double *slope;        /* (key_count) [1/s] of a cubic; NULL: linear */
    bool used;            /* a term has it */
} drape_history;

/* One term on one cloth or one seam. */
typedef struct drape_term {
    const drape_term_ops *ops;
    int32_t cloth; /* of a seam, that of its side a */
    int32_t seam;  /* -1: it is of a cloth */
    double params[DRAPE_MAX_PARAMS];
    drape_elements elements; /* with node numbers of the whole model */
    drape_parts parts;       /* elements.parts points here if the term has parts */
    drape_patches patches;
    int32_t *block;  /* (drape_term_places) block of each node pair in the pattern, -1: pinned; NULL: no
                       sparsity */
    double timed[2]; /* [s] from when to when its energy changes with time; equal: it does not */
    const drape_history *history;         /* the factor of a load over time; NULL: it is constant */
    bool anchored;                        /* its elements are attached to fixed directions in space */
    int64_t first_internal;               /* index of its internal variables in a state; -1: none */
    int64_t first_measure;                /* index of its measures in the list of all measures; -1: none */
    const struct drape_term *const *laws; /* laws of the cloth that act on this measure */
    int law_count;
    int own_law_count;      /* of these, without the loss of a measured fabric, which is the last */
    const double *damping;  /* (elements.count) its measures' own dashpots [J s/q2]; NULL: none */
    const uint8_t *counted; /* (elements.count) 1: their energies count here, 0: on another rank; NULL: all */
    const int32_t *element; /* (elements.count) their numbers in the whole model; NULL: the same */
    const uint8_t *part_counted; /* (parts.count) of a part of a model, likewise */
    const int32_t *part;
    int sliders;                             /* of each element (slider.h) */
    double *slider_stiffness, *slider_limit; /* (sliders x elements.count) [J/q2], [J/q] */
    int64_t
        first_slider; /* index in a state of how far they have slid (sliders x elements.count); -1: none */
    const drape_branch *branches; /* (branch_count) of each measure (relaxation.h) */
    int branch_count;
    int64_t first_branch; /* index in a state of (drape_term_branch_numbers): the time at which they were
                             computed, then the strains (elements.count) and the extensions (branch_count x
                             elements.count); -1: none */
} drape_term;

static inline bool drape_term_is_timed(const drape_term *term)
{
    return term->timed[0] < term->timed[1];
}

/* Whether directions that belong to it turn. */
static inline bool drape_term_turns(const drape_term *term)
{
    return term->parts.turn;
}

/* Whether its forces depend on time. */
static inline bool drape_term_changes(const drape_term *term)
{
    return drape_term_is_timed(term) || term->history || drape_term_turns(term);
}

/* Its elements at a time. */
static inline drape_elements drape_term_elements(const drape_term *term, double t)
{
    drape_elements el = term->elements;
    el.t = t;
    return el;
}

/* From 0 at the beginning of this time to 1 at its end, with rate 0 at both. */
static inline double drape_term_progress(const drape_term *term, double t)
{
    const double s = (t - term->timed[0]) / (term->timed[1] - term->timed[0]);
    if (!drape_term_is_timed(term) || s >= 1)
        return 1;
    return s > 0 ? s * s * (3 - 2 * s) : 0;
}

/* Whether the term has a Hessian, so that it couples the nodes of an element. */
static inline bool drape_term_couples(const drape_term *term)
{
    return !term->ops->law && !term->ops->linear && term->elements.count > 0;
}

/* The number of the term's internal variables: some for each part or, if it has no parts, each element. */
static inline int64_t drape_term_internals(const drape_term *term)
{
    const int64_t each = term->ops->internal_count > 0 ? term->ops->internal_count : term->ops->has_internal;
    return each * (term->elements.parts ? term->parts.count : term->elements.count);
}

/* The internal variables of the term among those of a state, `internal`; NULL if it has none. */
static inline const double *drape_term_own(const drape_term *term, const double *internal)
{
    return term->first_internal >= 0 ? internal + term->first_internal : NULL;
}

/* The number of the sliders of all its elements. */
static inline int64_t drape_term_slider_count(const drape_term *term)
{
    return term->sliders * (int64_t)term->elements.count;
}

/* The internal variables of the branches of all its elements. */
static inline int64_t drape_term_branch_numbers(const drape_term *term)
{
    return term->branch_count > 0 ? 1 + (1 + term->branch_count) * (int64_t)term->elements.count : 0;
}

/* The nodes that elements couple. */
static inline drape_coupling drape_term_coupling(const drape_term *term)
{
    const drape_elements *el = &term->elements;
    return (drape_coupling){
        .count = el->count, .nodes = el->nodes, .node = el->parts ? term->patches.coupled : el->node};
}

/* The nodes of patches, not all of which are coupled; none without parts. */
static inline drape_coupling drape_term_patches(const drape_term *term)
{
    return (drape_coupling){term->patches.count, term->elements.nodes, term->patches.node};
}

/* The nodes of the pieces of a term: of its parts or, if it has none, of its elements. */
static inline drape_coupling drape_term_pieces(const drape_term *term)
{
    return term->elements.parts ? (drape_coupling){term->parts.count, term->parts.nodes, term->parts.node}
                                : drape_term_coupling(term);
}

/* The number of pairs of nodes of all pieces, followed by those of all patches if there are parts. */
static inline size_t drape_term_piece_places(const drape_term *term)
{
    const drape_coupling c = drape_term_pieces(term);
    return (size_t)c.count * (size_t)(c.nodes * c.nodes);
}

static inline size_t drape_term_places(const drape_term *term)
{
    const size_t patches =
        (size_t)term->patches.count * (size_t)(term->elements.nodes * term->elements.nodes);
    return drape_term_piece_places(term) + patches;
}

/* Writes the block of each of these pairs in a pattern. */
static inline void drape_term_place(const drape_term *term, const drape_pattern *pattern,
                                    const int32_t *free_of_node, int32_t *block)
{
    const drape_coupling pieces = drape_term_pieces(term), patches = drape_term_patches(term);
    drape_pattern_place(pattern, free_of_node, &pieces, block);
    drape_pattern_place(pattern, free_of_node, &patches, block + drape_term_piece_places(term));
}

/* An entry chosen by name, with the settings that the scene gave. */
typedef struct drape_choice {
    char *type;
    drape_setting *settings; /* (setting_count) */
    size_t setting_count;
} drape_choice;

/* The measured curves of a material. */
enum { DRAPE_CURVE_WARP, DRAPE_CURVE_WEFT, DRAPE_CURVE_SHEAR, DRAPE_CURVE_COUNT };

/* One cloth: its mesh at rest and the data of the scene. */
typedef struct drape_cloth {
    char *name;
    drape_mesh mesh;
    drape_choice grid;                /* its type is "" if the mesh is not a grid */
    char *file;                       /* NULL if the mesh is not from a file */
    char *start_file, *velocity_file; /* of the start; NULL: none */
    char *render_file;                /* of the render mesh; NULL: none */
    drape_mesh render_mesh;           /* that frames show, not connected; empty: none */
    double max_distance;              /* [m] of its vertices from the mesh */
    drape_embedded *bound;            /* (render_mesh.node_count); NULL: no render mesh */
    double scale[3], rotate[4], translate[3];
    double material_values[DRAPE_MAX_PARAMS]; /* in the order of the parameters of drape_material_entry */
    drape_material material;
    drape_woven tension, bending;           /* of a measured fabric; warp 0: not a measured fabric */
    double diagonal;                        /* [m] of the box at rest */
    double retardation;                     /* [s] of a measured fabric's loss; 0: none acts */
    drape_points curves[DRAPE_CURVE_COUNT]; /* measured: see drape_cloth_view */
    double *material_mass;                  /* (mesh.node_count) [kg] of the material alone */
    double *node_mass;     /* (mesh.node_count) [kg] with the "masses" of the scene; material_mass itself
                                     if there are none */
    uint8_t *edge_clamped; /* (mesh.edge_count) 1: both nodes are held by pins that clamp */
    int32_t *edge_turn;    /* (mesh.edge_count) the track whose turns its clamp follows, -1: none; NULL: no
                              edge turns */
    int32_t *edge_image; /* (mesh.edge_count) the edge that is the same by a period, -1: none; NULL: the cloth
                              has no periodic edges */
    double velocity[3];  /* [m/s] at t = 0 */
    int32_t first_node, first_triangle;
    const struct drape_term **laws; /* (law_count) */
    int law_count;
    drape_branch branches[DRAPE_MAX_BRANCHES]; /* (branch_count) of every strain measure */
    int branch_count;
} drape_cloth;

/* A key of a rotation: from here to the next key it turns steadily, about one axis. */
typedef struct drape_turn {
    double time;        /* [s] */
    double rotation[9]; /* row by row */
    double axis[3];     /* of length 1, in space */
    double degrees;     /* to the next key, of any size; 0 for the last */
} drape_turn;

typedef struct drape_turns {
    drape_turn *keys;
    size_t key_count;
} drape_turns;

typedef struct drape_track {
    drape_track_key *keys;
    size_t key_count;
    drape_turns turns; /* of pins, about the pivot; of a collider it is a member of that */
    double pivot[3];   /* [m] at the start */
    bool clamps;       /* its turns are those of the directions of clamped edges */
} drape_track;

/* One obstacle. */
typedef struct drape_collider {
    int32_t index; /* its number in the scene */
    const drape_collider_ops *ops;
    char *name;
    drape_choice choice; /* the choice of the scene */
    double values[DRAPE_MAX_PARAMS];
    drape_collider_shape shape;
    double friction;    /* Coulomb's mu [1] */
    double restitution; /* e [1] */
    drape_track track;  /* displacement from the position that its values define; no keys: it does not move */
    drape_sequence
        frames;        /* of the points of its shape, in its own coordinates; none: it is rigid. Such shapes
                              keep a drape_mesh_distance of their triangles, and are not smooth */
    drape_turns turns; /* rotation about the pivot; no keys: it does not turn */
    double pivot[3];   /* [m] in its own coordinates: the point that the track displaces */
    bool pivot_given;  /* by the scene; if not, it is the middle of the shape */
    double radius;     /* [m] of its shape's points around the pivot; of the scene, if it has none */
} drape_collider;

/* Resolved parameters of contact. */
/* What happens where bodies leave cloth no room: steps fail until the sim stops, or the cloth is relaxed, in
 * advances with a time budget or in all. */
typedef enum drape_no_room { DRAPE_NO_ROOM_AUTO, DRAPE_NO_ROOM_STOP, DRAPE_NO_ROOM_RELAX } drape_no_room;

typedef struct drape_contact_def {
    double distance;             /* activation distance between cloth and collider [m] */
    bool distance_given;         /* by the scene */
    double stiffness;            /* scale of the contact pressure [Pa] */
    bool stiffness_given;        /* by the scene */
    double friction_velocity;    /* sliding speed below which friction falls to zero [m/s] */
    double restitution_velocity; /* rate of a gap below which less energy than e says is dissipated [m/s] */
    bool lagged;                 /* friction uses the normal force and direction from the start of the step */
    bool self;                   /* contact of cloth with cloth */
    double self_thickness;       /* half the distance that layers of cloth keep [m] */
    double self_friction;        /* mu [1] */
    double self_restitution;     /* e [1] */
    drape_no_room no_room;       /* whether cloth that bodies leave no room is relaxed */
    double relaxed_pressure;     /* with which relaxed cloth is pushed out of them [Pa] */
} drape_contact_def;

/* Whether the start of a run is untangled, and how (untangle/untangler.h). */
#define DRAPE_UNTANGLE_DEFAULT_SWEEPS 400
#define DRAPE_UNTANGLE_DEFAULT_GAP    1.0
typedef struct drape_model_untangle {
    bool given;   /* by the scene */
    bool goes_on; /* a run whose cloth did not come apart */
} drape_model_untangle;

/* One item of the "pins" of a cloth. */
typedef struct drape_pin {
    char *name;
    int32_t cloth;
    int32_t *node; /* (node_count) ascending node numbers of the model */
    int32_t node_count;
    bool clamps;
    int32_t turn; /* the track whose turns the clamp follows, -1: none */
    bool slides;  /* it holds them in some directions only */
} drape_pin;

/* A node that pins hold in some directions only (model/support.h). */
typedef struct drape_support {
    int32_t node;
    int count;              /* 1 or 2 directions */
    double direction[2][3]; /* of length 1, at right angles */
    int32_t track[2];       /* of the pin that holds it along normal[i]; -1: that one rests */
    double normal[2][3];    /* of length 1: those of the pins, which span the directions */
    double dual[2][3];      /* dual[i] . normal[j] = 1 if i = j, else 0, spanning the same */
} drape_support;

/* Where a pin is on the collider that carries it, in that collider's own coordinates. */
typedef struct drape_ride {
    int32_t collider; /* -1: none carries it */
    int32_t triangle; /* of a collider with frames; -1: the collider is rigid */
    double own[3];    /* the point [m] or, on a triangle, the weights [1] of its corners */
    double offset;    /* [m] from the plane of the triangle, along its normal */
    bool given;       /* a host attached it; if not, the scene did */
    double since;     /* [s] when a host attached it: there its velocity jumps; NaN: from the start */
} drape_ride;

/* Nodes that are joined, one by one. */
typedef struct drape_model_seam {
    char *name;
    drape_choice choice; /* the choice of the scene */
    int32_t term;        /* that joins them */
    int32_t cloth[2];    /* of its sides a and b */
    int32_t *pair;       /* (pair_count x 2) node numbers of the model: of a, of b */
    int32_t pair_count;
} drape_model_seam;

/* What an event does, besides being recorded and reported. */
typedef enum drape_event_action {
    DRAPE_ACTION_RECORD,
    DRAPE_ACTION_STOP,
    DRAPE_ACTION_RELEASE
} drape_event_action;

/* The directions of a root that are an event. */
typedef enum drape_event_direction {
    DRAPE_DIRECTION_BOTH,
    DRAPE_DIRECTION_UP,
    DRAPE_DIRECTION_DOWN
} drape_event_direction;

typedef struct drape_event_ops drape_event_ops;

/* One event: a root of a function of the state. */
typedef struct drape_model_event {
    const drape_event_ops *ops; /* NULL: the function of a host */
    char *name;
    drape_choice choice; /* the choice of the scene */
    double values[DRAPE_MAX_PARAMS];
    int32_t cloth; /* -1: all */
    int32_t *pin;  /* (pin_count) the pins that it measures or releases, as numbers of the model */
    int32_t pin_count;
    int32_t *pinned; /* (pinned_count) their nodes, each once */
    int32_t pinned_count;
    drape_event_direction direction;
    drape_event_action action;
    bool once; /* it is over after the first root */
} drape_model_event;

/* What a rank has of a model that several share (base/ranks.h). Its nodes, elements and so on are those of
 * the whole model in the same order, without the rest. */
typedef struct drape_part {
    const drape_ranks *ranks;
    const drape_model *whole;
    uint8_t *own;                /* (node_count) 1: this rank computes the node; 0: it is a copy */
    int32_t *node;               /* (node_count) its number in the whole model */
    int32_t *cloth;              /* (cloth_count) the first node of each cloth there */
    int32_t all_nodes, all_free; /* of the whole model */
    int64_t all_nonzeros;
    uint64_t hash; /* of the whole model (sim/identity.h) */
} drape_part;

struct drape_model {
    const drape_part *part; /* NULL: it is whole */
    const drape_model
        *base;           /* the model that this one is with other pins and masses, and whose arrays it shares
                                except those that depend on these; NULL: it is its own */
    drape_arena arena;   /* holds everything below except the meshes */
    drape_arena scratch; /* while it is compiled: what a stage needs until it ends; else empty */
    drape_context *ctx;
    int32_t cloth_count, term_count, node_count, triangle_count, edge_count;
    drape_cloth *cloths;
    drape_history *histories; /* (history_count) those of the scene, then one of each ramp */
    int32_t history_count;
    drape_term *terms; /* (term_count) in scene order, gravity last in each cloth; then those of seams */
    double *rest;      /* (node_count x 3) [m] */
    double *start;     /* (node_count x 3) [m] at t = 0; rest itself if all cloths start there */
    double *velocity;  /* (node_count x 3) [m/s] at t = 0 */
    double *mass;      /* (node_count) [kg] */
    drape_render_surface surface; /* what frames show */
    int32_t *triangle;            /* (triangle_count x 3) */
    int32_t *edge;                /* (edge_count x 2) */
    double *edge_length;          /* (edge_count) [m] */
    uint8_t *pinned;              /* (node_count) */
    int32_t *free_of_node;        /* (node_count) number among the free nodes, -1: pinned */
    int32_t *node_of_free;        /* (block_count) */
    int32_t free_count;           /* of a part: those that this rank owns, */
    int32_t block_count;          /* and with copies, which have the higher numbers; else the same */
    int32_t *moved_node;          /* (moved_count) pinned nodes with a track or a ride */
    int32_t *moved_track;         /* (moved_count) */
    int32_t moved_count, track_count;
    drape_support
        *supports; /* (support_count) ascending nodes; those that are pinned altogether do not count */
    int32_t support_count;
    bool supports_move;      /* some of them have a track */
    int32_t image_set_count; /* sets of nodes of periodic edges that are the same node (model/periodic.h) */
    int32_t *image_start;    /* (image_set_count + 1) */
    int32_t *image;          /* the nodes of set s are image[image_start[s]] ... [image_start[s + 1] - 1] */
    int32_t *image_set;      /* (node_count) the set of each node, -1: none; NULL: no periodic edges */
    int32_t *image_coupled; /* (image_coupled_count x 2) pairs of nodes that couple because their images do */
    int32_t image_coupled_count;
    drape_track *tracks;       /* of a pin that a collider carries, without keys and turns */
    drape_ride *ride;          /* (node_count) of pins that colliders carry; NULL: no pin of the scene */
    drape_collider *colliders; /* (collider_count) */
    int32_t collider_count;
    uint8_t
        *ignored; /* ((collider_count + cloth_count) x cloth_count) 1: the cloth does not touch the collider
                         or, after these, the other cloth; NULL: everything touches */
    int32_t *cloth_of_node; /* (node_count); NULL if `ignored` is */
    drape_contact_def contact;
    drape_choice contact_choice, self_choice; /* the settings of the scene */
    drape_model_untangle untangle;
    drape_choice untangle_choice;
    int64_t internal_count, measure_count;
    bool has_laws;            /* some term needs the rates of measures */
    bool has_dissipation;     /* some term dissipates energy */
    bool has_own_dissipation; /* the same without the losses of measured fabrics */
    bool has_branches;        /* some measure has Maxwell branches */
    bool has_kinetic;         /* some term has an energy of motion */
    drape_pattern pattern;
    size_t pattern_bytes; /* bytes of the pattern in the arena */
    double length;        /* diagonal of the rest bounding box [m], > 0 */
    double gravity[3];    /* [m/s2] */
    drape_choice integrator, controller;
    bool integrator_named;   /* by the scene */
    drape_distance accuracy; /* asked of runs; value 0: none */
    double duration, frame_rate;
    char **formats;
    size_t format_count;
    bool z_up;       /* frames are rotated so that z points up */
    drape_pin *pins; /* (pin_count) of all cloths, in scene order */
    int32_t pin_count;
    drape_model_event *events; /* (event_count) in scene order */
    int32_t event_count;
    drape_model_seam *seams; /* (seam_count) in scene order */
    int32_t seam_count;
    int32_t *sewn; /* (node_count) the first of the nodes that a node is sewn to, or itself; NULL: no seams */
};

/* [m] the smallest diagonal of a cloth's box at rest. */
static inline double drape_model_least_diagonal(const drape_model *model)
{
    double least = model->cloths[0].diagonal;
    for (int32_t c = 1; c < model->cloth_count; c++)
        least = model->cloths[c].diagonal < least ? model->cloths[c].diagonal : least;
    return least;
}

static inline const drape_ranks *drape_model_ranks(const drape_model *model)
{
    return model->part ? model->part->ranks : NULL;
}

static inline const drape_model *drape_model_whole(const drape_model *model)
{
    return model->part ? model->part->whole : model;
}

static inline bool drape_model_owns(const drape_model *model, int32_t node)
{
    return !model->part || model->part->own[node];
}

/* The free nodes of the whole model. */
static inline int32_t drape_model_all_free(const drape_model *model)
{
    return model->part ? model->part->all_free : model->free_count;
}

/* For messages: the cloth of a node of a diagnostic, which has the number of the whole model, and the number
 * in that cloth. */
int32_t drape_model_diagnosed(const drape_model *model, int32_t node, int32_t *number);

/* The first of the nodes that are sewn together with a node. They count as one node where neighbours are
 * concerned: pieces that share such a node are not in contact, and may pass through each other at the
 * seam. */
static inline int32_t drape_model_sewn(const drape_model *model, int32_t node)
{
    return model && model->sewn ? model->sewn[node] : node;
}

/* Whether two pieces of cloth share a node, or have nodes that are sewn together. */
static inline bool drape_model_share_node(const drape_model *model, const int32_t *a, int a_count,
                                          const int32_t *b, int b_count)
{
    for (int i = 0; i < a_count; i++)
        for (int j = 0; j < b_count; j++)
            if (drape_model_sewn(model, a[i]) == drape_model_sewn(model, b[j]))
                return true;
    return false;
}

/* The activation distance [m] of cloth and a collider while that is slow. */
static inline double drape_collider_activation(const drape_model *model, int32_t collider)
{
    const double own = model->colliders[collider].shape.distance;
    return own > 0 ? own : model->contact.distance;
}

/* Writes the positions that tracks give pinned nodes at time t, and moves those of supports from where they
 * start; other entries of x (node_count x 3) are unchanged. */
void drape_model_place_pins(const drape_model *model, double t, double *x);

/* Lists what couples nodes of the model in every state: the terms and, if a collider has features that the
 * faces and edges of cloth can touch, the triangles; and images of coupled nodes. without (term_count):
 * terms to be left out; NULL: none. couplings: of term_count + 2. Returns their number. */
int drape_model_couplings(const drape_model *model, const bool *without, drape_coupling *couplings);

/* The mean length of the edges [m], of all ranks. */
double drape_model_mean_edge(const drape_model *model);

/* Returns the cloth that a node belongs to. */
int32_t drape_model_cloth_of(const drape_model *model, int32_t node);

/* Whether a node of cloth passes through a collider, and whether cloths of two nodes pass through each
 * other. */
static inline bool drape_model_ignores(const drape_model *m, int32_t collider, int32_t node)
{
    return m->ignored && m->ignored[collider * m->cloth_count + m->cloth_of_node[node]];
}

static inline bool drape_model_ignores_cloth(const drape_model *m, int32_t node, int32_t other)
{
    return m->ignored && m->ignored[(m->collider_count + m->cloth_of_node[node]) * m->cloth_count +
                                    m->cloth_of_node[other]];
}

#endif
