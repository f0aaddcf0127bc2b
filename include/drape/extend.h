/*
 * extend.h: everything an author of a term or a collider needs: parameter lists, the view of a cloth, the
 * function table of a term, the shape and the function table of a collider.
 *
 * A term is a sum over elements of one cloth, or of a seam: of two cloths that it joins. Its author writes
 * one of the following, for a range of elements in local coordinates:
 *
 *   - measure: a scalar strain measure q(x) with gradient and Hessian, from which the library makes the
 *     energy E = 1/2 k (q - q0)^2
 *   - energy: any energy E(x) with gradient and Hessian
 *   - dissipation: a force g(x, v), counted positive against the motion, with its derivatives
 *   - law: a force along the strain measures of the other terms of its cloth, such as a damping
 *
 * and beside a dissipation, if the term has inertia of its own, kinetic: an energy of motion T(x, v).
 *
 * The library provides the loops, sparsity, assembly, projection, boundary conditions and threads.
 *
 * Thread-safety: every function of a term may be called from several threads at once on different ranges; it
 * must not allocate memory and must read nothing but its arguments and what `user` points to, which must not
 * change while a sim runs. The exceptions are build and build_seam, which are called once per cloth or seam
 * while a model is compiled.
 */
#ifndef DRAPE_EXTEND_H
#define DRAPE_EXTEND_H

#include <math.h>

#include "drape.h"

DRAPE_C_BEGIN

/* ---- Parameters ---- */

/* The kind of a parameter. */
typedef enum drape_param_kind {
    DRAPE_PARAM_NUMBER,  /* any number in the range */
    DRAPE_PARAM_INTEGER, /* an integer in the range */
    DRAPE_PARAM_BOOLEAN, /* 0 or 1 */
    DRAPE_PARAM_CHOICE,  /* an index into choices */
    DRAPE_PARAM_VECTOR,  /* three consecutive values; the range applies to each */
    DRAPE_PARAM_TURN,    /* a rotation as three values: a vector along the axis whose length is the angle
                            [degrees], to which the range applies; may also be given as axis and angle, four
                            numbers */
    DRAPE_PARAM_TEXT,    /* a text, such as a file name; its numerical value is always 0. Of a term, one that
                            is called "history" names a history of the scene: the library multiplies an
                            external load by its factor, and other terms read it in el->factor */
    DRAPE_PARAM_POINTS   /* points of an increasing curve that begins at 0, 0, which is not one of them: pairs
                            of numbers, both increasing from point to point. The range applies to the first;
                            the second is from 1e-9 to 1e15. The numerical value is the number of points */
} drape_param_kind;

/* One parameter. All values are stored as doubles: integers exactly, booleans as 0 or 1, choices by index. A
 * vector or a rotation occupies three values, which shifts the values of later parameters by two. In C, the
 * macros below write one parameter each. */
typedef struct drape_param {
    const char *name;           /* as in scenes */
    drape_param_kind kind;      /* the kind of its values */
    const char *unit;           /* "N/m", "s"; "1" for none */
    double default_value;       /* NaN: no fixed default, see derived */
    const char *derived;        /* if default_value is NaN: what is used instead, as text; NULL: the parameter
                                   is required */
    double min, max;            /* closed range; ignored for booleans and choices */
    bool open_min, open_max;    /* the bound itself is excluded */
    const char *const *choices; /* NULL-terminated list of names */
    const char *help;           /* meaning and effect, in one line */
    bool uniform;               /* VECTOR: a single number may stand for three equal ones */
    const char *numbers;        /* VECTOR: the names of the three numbers, "[k11, k22, k12]"; NULL: [x, y,
                                   z]. POINTS: of the two of a point, "[strain, force]"; NULL: [x, y] */
    const char *const *aliases; /* CHOICE: pairs of a former name and the choice that it stands for,
                                   NULL-terminated; NULL: none. A warning is logged where one is given */
} drape_param;

/* A number: name, unit, default, range and help. For C only, as C++17 has no designated initialisers:
 *
 *     static const drape_param params[] = {
 *         DRAPE_NUMBER("tolerance", "N", 1e-6, DRAPE_ABOVE(0), 1e12, "bound on the residual"),
 *         DRAPE_VECTOR("size", "m", DRAPE_REQUIRED, 0, 1e9, "lengths of the edges", .uniform = true),
 *         DRAPE_CHOICE("rest", 0, rest_choices, "rest angles: those of the mesh, or flat")};
 *
 * DRAPE_REQUIRED and DRAPE_DERIVED may replace a default, DRAPE_ABOVE and DRAPE_BELOW a bound that the range
 * excludes. Further members may follow the help. */
#define DRAPE_NUMBER(name_, unit_, default_, min_, max_, ...)                                                \
    {                                                                                                        \
        .name = name_, .kind = DRAPE_PARAM_NUMBER, .unit = unit_, .default_value = default_, .min = min_,    \
        .max = max_, .help = __VA_ARGS__                                                                     \
    }
/* An integer. */
#define DRAPE_INTEGER(name_, unit_, default_, min_, max_, ...)                                               \
    {                                                                                                        \
        .name = name_, .kind = DRAPE_PARAM_INTEGER, .unit = unit_, .default_value = default_, .min = min_,   \
        .max = max_, .help = __VA_ARGS__                                                                     \
    }
/* Three numbers; the default and the range apply to each. */
#define DRAPE_VECTOR(name_, unit_, default_, min_, max_, ...)                                                \
    {                                                                                                        \
        .name = name_, .kind = DRAPE_PARAM_VECTOR, .unit = unit_, .default_value = default_, .min = min_,    \
        .max = max_, .help = __VA_ARGS__                                                                     \
    }
/* A rotation; the range applies to its angle [degrees]. */
#define DRAPE_TURN(name_, default_, min_, max_, ...)                                                         \
    {                                                                                                        \
        .name = name_, .kind = DRAPE_PARAM_TURN, .unit = "degrees", .default_value = default_, .min = min_,  \
        .max = max_, .help = __VA_ARGS__                                                                     \
    }
/* True or false. */
#define DRAPE_BOOLEAN(name_, default_, ...)                                                                  \
    {                                                                                                        \
        .name = name_, .kind = DRAPE_PARAM_BOOLEAN, .unit = "1", .default_value = default_,                  \
        .help = __VA_ARGS__                                                                                  \
    }
/* One of a NULL-terminated list of names; the default is an index. */
#define DRAPE_CHOICE(name_, default_, choices_, ...)                                                         \
    {                                                                                                        \
        .name = name_, .kind = DRAPE_PARAM_CHOICE, .unit = "1", .default_value = default_,                   \
        .choices = choices_, .help = __VA_ARGS__                                                             \
    }
/* A text; always required. */
#define DRAPE_TEXT(name_, ...)                                                                               \
    {                                                                                                        \
        .name = name_, .kind = DRAPE_PARAM_TEXT, .unit = "1", .default_value = DRAPE_REQUIRED,               \
        .help = __VA_ARGS__                                                                                  \
    }
/* Points of an increasing curve; the range applies to the first number of each. They have no default. */
#define DRAPE_POINTS(name_, unit_, default_, min_, max_, ...)                                                \
    {                                                                                                        \
        .name = name_, .kind = DRAPE_PARAM_POINTS, .unit = unit_, .default_value = default_, .min = min_,    \
        .max = max_, .help = __VA_ARGS__                                                                     \
    }
/* In place of a default: the parameter must be given. */
#define DRAPE_REQUIRED ((double)NAN)
/* In place of a default: a description of what is used instead. */
#define DRAPE_DERIVED(words) DRAPE_REQUIRED, .derived = words
/* In place of min: values must be above the bound. */
#define DRAPE_ABOVE(bound) bound, .open_min = true
/* In place of max: values must be below the bound. */
#define DRAPE_BELOW(bound) bound, .open_max = true

#define DRAPE_MAX_PARAMS 24 /* limit on the number of values that the parameters of an entry occupy */

/* ---- Entries ---- */

/* Describes one implementation that is chosen by name: a term, a collider, and everything else that `drape
 * list` shows. A function table begins with it, after struct_size if it has one. Texts and parameters are
 * static. */
typedef struct drape_entry {
    const char *name;          /* as in scenes: "bend.hinge" */
    const char *summary;       /* one line for `drape list` */
    const char *reference;     /* source of the method: paper and equation; terms and colliders need one */
    const drape_param *params; /* param_count parameters; NULL: none */
    int param_count;           /* length of params */
} drape_entry;

/* Initialises params and param_count of an entry from an array. */
#define DRAPE_PARAMS(array) .params = (array), .param_count = (int)(sizeof(array) / sizeof *(array))

/* ---- The data that a term is built from ---- */

/* Resolved stiffness and mass of a sheet, in SI units. Allocated by the library alone: it may grow at its
 * end. */
typedef struct drape_material {
    double young_modulus, poisson_ratio, thickness; /* [Pa], [1], [m] */
    double areal_density;      /* [kg/m2]; the total mass divided by the area if the mass is uniform over
                                  nodes */
    double membrane_stiffness; /* E h [N/m] */
    double flexural_rigidity;  /* D = E h^3 / (12 (1 - nu^2)) [N m] */
    double bending_warp, bending_weft, bending_twist; /* of a measured fabric [N m]; NaN: not a measured
                                                         fabric */
} drape_material;

/* Stiffnesses of a woven sheet, in tension [N/m] or in bending [N m]. */
typedef struct drape_woven {
    double warp, weft; /* of strips cut along warp and weft, with free sides */
    double shear;      /* shear stiffness or, in bending, twist stiffness */
    double poisson;    /* sqrt(nu12 nu21) [1] */
} drape_woven;

/* Measured points of a curve, from 0, 0 on; both numbers increase from point to point. */
typedef struct drape_points {
    int32_t count;       /* number of points; 0: not measured */
    const double *point; /* (count x 2) */
} drape_points;

/* One cloth at rest. Node numbers are local to the cloth. All arrays are const and valid while the model is
 * compiled. */
typedef struct drape_cloth_view {
    int32_t node_count, triangle_count, edge_count, hinge_count; /* lengths of the arrays below */
    const double *rest;                                          /* (node_count x 3) rest positions [m] */
    const int32_t *triangle;                                     /* (triangle_count x 3) */
    const double *triangle_area;                                 /* (triangle_count) [m2] */
    const int32_t *edge;                                         /* (edge_count x 2) */
    const int32_t *edge_triangle; /* (edge_count x 2) triangles beside the edge; the second is -1 on the
                                     boundary */
    const double *edge_length;    /* (edge_count) [m] */
    const int32_t *hinge;         /* (hinge_count x 4) x0 x1: the shared edge, x2 x3: the apices of its two
                             triangles */
    const int32_t *hinge_edge;    /* (hinge_count) edge number of the hinge, ascending */
    const int32_t *triangle_edge; /* (triangle_count x 3) the edge from corner k to corner k + 1 */
    const uint8_t *edge_clamped;  /* (edge_count) 1: a pin keeps the direction of the sheet across the edge */
    const double *node_area;      /* (node_count) lumped: a third of each adjacent triangle [m2] */
    const double *node_mass;      /* (node_count) lumped [kg] */
    int32_t rows, columns;        /* of a grid, in nodes: node r * columns + c; 0 for other meshes */
    bool rectangular;             /* the mesh is a grid whose cells are rectangles before its transform */
    const drape_material *material;       /* of the sheet */
    double gravity[3];                    /* [m/s2] */
    const drape_woven *tension, *bending; /* of a measured fabric; NULL: use material */
    void *user;                           /* of the term's ops */
    drape_points warp_curve, weft_curve;  /* strain of a strip [1] and force per width [N/m] */
    drape_points shear_curve;             /* shear angle [degrees] and force per length [N/m] */
    const int32_t *edge_turn; /* (edge_count) for drape_term_turn_part: the turns of the pin that clamps the
                                 edge, -1: none; NULL: no edge turns */
    const int32_t
        *edge_image;     /* (edge_count) of periodic edges the one on the other side, which is the same by
                                  a translation; -1: none; NULL: the cloth has no periodic edges */
    const double *start; /* (node_count x 3) where the nodes start [m]: a period stays as it is there */
    int32_t
        given_count; /* of the nodes that the source of the mesh has, the first ones; a grid's are these */
    const int32_t
        *parent; /* ((node_count - given_count) x 2) the nodes that each further node of a subdivided
                              mesh is between */
} drape_cloth_view;

/* A seam at rest: two sides, each a list of nodes of one cloth, which may be the same cloth. Nodes of equal
 * place in the lists are joined. Node numbers are those of the whole model: node i of side s's cloth has the
 * number first_node[s] + i. All arrays are const and valid while the model is compiled. */
typedef struct drape_seam_view {
    const drape_cloth_view *cloth[2]; /* of the sides a and b */
    int32_t first_node[2];            /* number in the model of the first node of each of these cloths */
    int32_t pair_count;               /* length of pair */
    const int32_t *pair;              /* (pair_count x 2) the node of a, the node of b */
    void *user;                       /* of the term's ops */
} drape_seam_view;

/* Receives the elements of a term while its cloth is compiled. Opaque. */
typedef struct drape_term_builder drape_term_builder;

/* Announces the elements of a term. build must call it once, before anything else. Each element has as many
 * nodes as the term's `nodes`, and rest_count numbers of rest data. Errors: DRAPE_E_MEMORY,
 * DRAPE_E_ARGUMENT. */
DRAPE_API drape_status drape_term_reserve(drape_term_builder *builder, int32_t element_count, int rest_count);

/* The same for a cloth on which elements have fewer nodes than the term's `nodes`. A node may occur in
 * several places of an element, as the first one does in unused places: derivatives of such places add up. */
DRAPE_API drape_status drape_term_reserve_nodes(drape_term_builder *builder, int32_t element_count, int nodes,
                                                int rest_count);

/* For terms with `part`, after the elements: announces part_count parts of part_nodes nodes each, with
 * rest_count numbers of rest data, and link_count links between elements and parts. Errors: DRAPE_E_MEMORY,
 * DRAPE_E_ARGUMENT. */
DRAPE_API drape_status drape_term_reserve_parts(drape_term_builder *builder, int32_t part_count,
                                                int32_t link_count, int rest_count);

/* Sets part number `part`: its nodes (local to the cloth) and its rest data. */
DRAPE_API void drape_term_set_part(drape_term_builder *builder, int32_t part, const int32_t *nodes,
                                   const double *rest);

/* Adds weight times a part to the measure of an element, which must contain the nodes of the part. Elements
 * are linked in ascending order, and all announced links are made. Parts without a link are left out: the
 * later ones get smaller numbers. */
DRAPE_API void drape_term_link(drape_term_builder *builder, int32_t element, int32_t part, double weight);

/* Declares that a part belongs to a direction in space which turns with a pin: turn is an entry of edge_turn,
 * -1: it does not turn. The direction at the present time is that of drape_elements_direction. Turning the
 * nodes of the part with the direction must not change s. */
DRAPE_API void drape_term_turn_part(drape_term_builder *builder, int32_t part, int32_t turn);

/* Declares that elements of this cloth are attached to directions in space, so that their forces have a
 * torque. */
DRAPE_API void drape_term_anchor(drape_term_builder *builder);

/* Sets element number `element`: its nodes (local to the cloth; of a seam, numbers of the model, of
 * either cloth) and its rest data. Measures keep k [J/q2] in rest[0] and q0 in rest[1]; terms with
 * `damped` keep c >= 0 [J s/q2] in rest[2]. */
DRAPE_API void drape_term_set(drape_term_builder *builder, int32_t element, const int32_t *nodes,
                              const double *rest);

/* Of a seam: declares that it holds two nodes (numbers of the model) together, as it does or after it has
 * closed. Pieces of cloth that have one of them are then neighbours, as those that share a node: they are not
 * in contact, and do not count as intersections. */
DRAPE_API void drape_term_sew(drape_term_builder *builder, int32_t a, int32_t b);

/* Of an energy: declares that it depends on el->progress, which goes smoothly from 0 to 1 while the time
 * goes from one to another [s]: s^2 (3 - 2 s). What the energy gains or loses by that is work, which is
 * accounted as the work of moving pins is. If the stiffness changes too, it must be largest at progress 1,
 * where the stable step of explicit integrators is estimated. */
DRAPE_API void drape_term_timed(drape_term_builder *builder, double from, double to);

/* Allocates numbers (count, zeroed) that all elements of the term need, such as the table of a law, for build
 * to fill; the functions of the term find them in el->shared. They live as long as the model. At most once.
 * Returns NULL if memory is out, and for a second call or count <= 0: build must then return
 * DRAPE_E_MEMORY. */
DRAPE_API double *drape_term_share(drape_term_builder *builder, int32_t count);

/* The maximum number of sliders of an element. */
#define DRAPE_MAX_SLIDERS 4

/* For terms with measure, after drape_term_reserve: gives each element `count` sliders (1 to
 * DRAPE_MAX_SLIDERS) beside its elastic energy. A slider is a spring in series with dry friction (Jenkin
 * 1922; Iwan 1966): its force on q is stiffness times (q - q0 - p), at most limit in magnitude, and where it
 * would be more, p follows. p is an internal variable that the library keeps: it moves only when a step is
 * accepted, and at the start the force is 0. What sliding costs counts as dissipated. Once per term. Errors:
 * DRAPE_E_MEMORY, DRAPE_E_ARGUMENT. */
DRAPE_API drape_status drape_term_reserve_sliders(drape_term_builder *builder, int count);

/* Sets slider `number` of an element: stiffness [J/q2] >= 0 and limit [J/q] >= 0. Sliders that are not set
 * have no force. */
DRAPE_API void drape_term_set_slider(drape_term_builder *builder, int number, int32_t element,
                                     double stiffness, double limit);

/* The maximum number of Maxwell branches of a cloth. */
#define DRAPE_MAX_BRANCHES 8

/* In build of a law: gives every strain measure of the cloth a Maxwell branch beside its elastic energy, a
 * spring of the stiffness fraction k, k that of the measure [J/q2], in series with a dashpot, whose force
 * falls to 1/e in `time` [s] at constant strain. Fractions are > 0, and at most 1 in sum over all laws of the
 * cloth; times are > 0. The extension of the spring is an internal variable that the library keeps: it moves
 * when a step is accepted, and at the start it is 0. What the dashpot takes counts as dissipated. Static
 * equilibria have no force in branches; integrators that choose their own steps refuse them. Errors:
 * DRAPE_E_ARGUMENT. */
DRAPE_API drape_status drape_term_add_branch(drape_term_builder *builder, double fraction, double time);

/* Rejects the cloth or the seam: the reason is reported at the place of the term in the scene. Returns
 * DRAPE_E_ARGUMENT, which build or build_seam must return. */
DRAPE_API drape_status drape_term_refuse(drape_term_builder *builder, const char *format, ...)
    DRAPE_PRINTF(2, 3);

/* The maximum number of nodes of an element. */
#define DRAPE_MAX_ELEMENT_NODES 12
/* The maximum number of coordinates of an element. */
#define DRAPE_MAX_ELEMENT_DOFS (3 * DRAPE_MAX_ELEMENT_NODES)

/* The parts of the elements of one term on one cloth, see `part` in drape_term_ops; constant after the model
 * is compiled. Link i adds weight[i] times part[i] to the measure of element[i]. Allocated by the library
 * alone: it may grow at its end. */
typedef struct drape_parts {
    int32_t count;             /* number of parts */
    int nodes;                 /* nodes per part */
    int rest_count;            /* numbers of rest data per part */
    const int32_t *node;       /* (count x nodes) node numbers of the whole model */
    const double *rest;        /* (rest_count x count): item k of part p is rest[k * count + p] */
    int32_t link_count;        /* number of links */
    const int32_t *element;    /* (link_count) ascending */
    const int32_t *part;       /* (link_count) */
    const double *weight;      /* (link_count) */
    const uint8_t *place;      /* (link_count x nodes) where the nodes of the part are in the element */
    const int32_t *first_link; /* (number of elements + 1) an element's links are first_link[e] ...
                                  first_link[e + 1] - 1 */
    const int32_t *first_user; /* (count + 1) a part's links are user[first_user[p]] ...
                                  user[first_user[p + 1] - 1] */
    const int32_t *user;       /* (link_count) numbers of links */
    const int32_t *turn;       /* (count) of drape_term_turn_part; NULL: no part turns */
} drape_parts;

/* The elements of one term on one cloth or one seam; constant after the model is compiled, but for
 * progress, factor and t. Allocated by the library alone: it may grow at its end. */
typedef struct drape_elements {
    int32_t count;            /* number of elements */
    int nodes;                /* nodes per element */
    int rest_count;           /* numbers of rest data per element */
    const int32_t *node;      /* (count x nodes) node numbers of the whole model */
    const double *rest;       /* (rest_count x count): item k of element e is rest[k * count + e] */
    const double *params;     /* values in the order of the term's parameters */
    const drape_parts *parts; /* NULL: the term has none */
    void *user;               /* of the term's ops */
    double progress;          /* for the function energy of a term with drape_term_timed: 0 to 1; else 0 */
    double factor;        /* of the history that a parameter "history" names, at the present time; else 1 */
    int32_t shared_count; /* length of shared */
    const double *shared; /* numbers of drape_term_share; NULL: none */
    double t;             /* [s] the time at which they are evaluated */
    const struct drape_track *tracks; /* of the pins; opaque */
} drape_elements;

/* Where a direction that is `rest` at rest points at the time el->t, with the turns of that part. */
DRAPE_API void drape_elements_direction(const drape_elements *el, int32_t part, const double rest[3],
                                        double direction[3]);

/* The fault that a check found, for the message of a rejected step. */
typedef struct drape_fault {
    const char *reason;  /* short static token: "edge_collapse" */
    const char *what;    /* static text: "edge length / rest length" */
    int32_t element;     /* the element where the fault is largest */
    double value, limit; /* the quantity `what` at that element, and the bound beyond which it is a fault */
} drape_fault;

/* ---- The function table of a term ---- */

/* The maximum number of elements in one call of pair. */
#define DRAPE_PAIR_BLOCK 32
/* The number of elements in one call of lanes. */
#define DRAPE_LANES 4

/* Where the function kinetic of a term writes T(x, v) and its derivatives, with d as below. NULL: not
 * needed; of the last three all or none. Allocated by the library alone: it may grow at its end. */
typedef struct drape_kinetic {
    double *t;    /* (count) T [J] */
    double *by_x; /* (count x d) dT/dx [N] */
    double *by_v; /* (count x d) dT/dv, the momentum [kg m/s] */
    double *xx;   /* (count x d x d) d2T/dx dx [N/m] */
    double *vx;   /* (count x d x d) d2T/dv dx [kg/s]: row i by v_i, column j by x_j */
    double *vv;   /* (count x d x d) d2T/dv dv [kg] */
} drape_kinetic;

/*
 * A term. Exactly one of measure, energy, dissipation and law is set. A range consists of elements first ...
 * first + count - 1; outputs are element-major: item i belongs to element first + i. d is 3 * nodes.
 * Gradients have the sign of dE/dx, so forces are their negatives. x, v: (nodes of the model x 3). internal:
 * (element_count) internal variables of the last accepted state for terms that have them, else NULL. An
 * output pointer may be NULL: that output is not needed.
 */
typedef struct drape_term_ops {
    size_t struct_size;       /* the author's sizeof(drape_term_ops) */
    drape_entry entry;        /* its reference is the paper and equation of the formula */
    const char *element_name; /* "edge", "hinge", "node": for messages */
    int nodes;                /* nodes per element, 1 to DRAPE_MAX_ELEMENT_NODES; 0 for a law */
    bool linear;              /* energy: its Hessian is zero and needs no sparsity */
    bool external; /* energy: the potential of an external load; dissipation: a load without one. What it does
                      is work (drape_sim_work), no elastic energy and no dissipation, and its forces may have
                      a resultant and a torque */
    bool convex;   /* its Hessian is positive semidefinite in every state: of a measure, ddq, as that of a
                          length; of an energy, hess */
    bool has_internal;  /* each element has internal variables */
    int internal_count; /* internal variables per element, stored consecutively; 0 means 1 */
    bool constraint; /* an energy that enforces a limit; integrators that enforce limits by moving nodes omit
                        it */
    bool damped;     /* measure: each element has a dashpot of its own, with force c q' on q */
    bool distance;   /* measure: q is the distance between the two nodes, for all elements */

    /* Adds the elements of one cloth. Called once per cloth. Returns DRAPE_OK or the error that a builder
     * function returned. Optional for a law, which has no elements. */
    drape_status (*build)(const drape_cloth_view *cloth, const double *params, drape_term_builder *builder);

    /* Writes q [q] (count), dq (count x d) and ddq (count x d x d, symmetric). */
    void (*measure)(const drape_elements *el, int32_t first, int32_t count, const double *x,
                    const double *internal, double *q, double *dq, double *ddq);

    /* Optional, beside measure, if nodes is 2 and q is a linear function of the distance of the nodes: the
     * same with a tenth of the numbers. q (count); d (3 x count: all x, all y, all z) = x1 - x0 [m]; c
     * (count) such that dq = (-c d, c d) and ddq = (P -P; -P P) with P = c (I - d d'/d.d). count is at most
     * DRAPE_PAIR_BLOCK. */
    void (*pair)(const drape_elements *el, int32_t first, int32_t count, const double *x, double *q,
                 double *d, double *c);

    /* Optional, beside measure: the same for a list of DRAPE_LANES elements at once, in which an element may
     * occur more than once. Item i of the element in place l is at [DRAPE_LANES i + l]: q (1), dq (d) and ddq
     * (d x d), of which only the 3 x 3 blocks on and below the diagonal are written. */
    void (*lanes)(const drape_elements *el, const int32_t *element, const double *x, const double *internal,
                  double *q, double *dq, double *ddq);

    /* Writes e [J] (count), g [N] (count x d) and hess [N/m] (count x d x d, symmetric). */
    void (*energy)(const drape_elements *el, int32_t first, int32_t count, const double *x,
                   const double *internal, double *e, double *g, double *hess);

    /* Writes g [N] (count x d), dg_dx [N/m] and dg_dv [N s/m] (count x d x d each). */
    void (*dissipation)(const drape_elements *el, int32_t first, int32_t count, const double *x,
                        const double *v, double *g, double *dg_dx, double *dg_dv);

    /* For count elements with stiffness k [J], strain = q - q0 and rate = q' [q/s]: adds the generalised
     * force [J/q] on q, its derivatives with respect to strain and rate, and the energy [J] if the law has
     * one. All arrays have length count. */
    void (*law)(const double *params, int32_t count, const double *k, const double *strain,
                const double *rate, double *force, double *dforce_dstrain, double *dforce_drate,
                double *energy);
    bool dissipative; /* law: the force dissipates energy and has no potential */

    /* Computes the internal variables after a step was accepted, from those before it and the new
     * positions. */
    void (*commit)(const drape_elements *el, int32_t first, int32_t count, const double *x,
                   const double *before, double *after);

    /* Computes the internal variables at the start, where x are the positions in which the cloth starts, at
     * rest or not. after and before are indexed by element, like internal. */
    void (*initial)(const drape_elements *el, int32_t first, int32_t count, const double *x, double *after);

    /* Looks for an element that became degenerate in a step from before to x. Returns DRAPE_OK, or
     * DRAPE_RETRY_DEGENERATE with *fault filled for the largest fault. An element that was already degenerate
     * and did not become more so is not reported, as otherwise no step could lead out of such a state. before
     * may be NULL: then nothing is excused. check may be NULL: the term has no degenerate elements. */
    drape_status (*check)(const drape_elements *el, const double *x, const double *before,
                          const double *internal, drape_fault *fault);

    /* dissipation: it acts against a medium. v is then the velocity relative to the wind of
     * drape_sim_set_wind. Where it pushes cloth at rest, what it does is work (drape_sim_work). */
    bool in_medium;

    /* Optional, beside measure: replaces ddq by the matrix for which force ddq is the positive semidefinite
     * part, given the force of each element: (ddq)+ if the force is positive and (ddq)- if it is negative;
     * ddq (count x d x d, symmetric). If a term has neither this nor convex, the positive semidefinite matrix
     * omits force ddq, and with it the stiffness that tension causes. */
    void (*positive)(const drape_elements *el, int32_t first, int32_t count, const double *x,
                     const double *internal, const double *force, double *ddq);

    /* The gravity of the scene adds this term to every cloth unless it is zero. A scene must not name the
     * term, which has no required parameters. */
    bool from_scene_gravity;

    int part_nodes; /* part: nodes of each part, 1 to DRAPE_MAX_ELEMENT_NODES */

    /* Optional, beside measure, if measures are linear combinations q = sum weight s of quantities s(x) that
     * several elements share, such as the angles of hinges. The library then evaluates each part once, and
     * calls measure only for checks. part writes s (1), ds (3 part_nodes) and dds (3 part_nodes x 3
     * part_nodes) of a list of DRAPE_LANES parts, laid out as lanes does it. Internal variables belong to
     * parts: internal is indexed by part, and the ranges of commit and initial are parts. */
    void (*part)(const drape_elements *el, const int32_t *part, const double *x, const double *internal,
                 double *s, double *ds, double *dds);

    /* Beside build or instead of it: adds the elements of a seam of the scene, which may have nodes of both
     * of its cloths. Called once per seam whose "type" is this term. For a measure, an energy or a
     * dissipation without parts; the laws of a cloth do not act on seams. */
    drape_status (*build_seam)(const drape_seam_view *seam, const double *params,
                               drape_term_builder *builder);

    /* Passed on unchanged to build, build_seam and, in el, to all others but law. It must outlive the context
     * and every model compiled with it, and must not change while sims run: they do not know. */
    void *user;

    /* The term reads the measured curves of the material. Where no term of a cloth does, a scene that gives
     * curves has the warning "unused_curve". */
    bool takes_curves;

    /* The term reads edge_clamped. Where no term of a cloth does, pins that clamp it have the warning
     * "unused_clamp". */
    bool takes_clamps;

    /* Optional, beside dissipation: an energy of motion T(x, v), quadratic in v, of what moves with the
     * cloth, such as the air beside it. The library adds Lagrange's d/dt dT/dv - dT/dx to the equation of
     * motion. Only integrators that step momenta take it ("be", "bdf2", "trbdf2", "newton_k"), and "static",
     * for which v is 0; others refuse the scene. With in_medium, v is relative to the wind, whose derivatives
     * by place are left out. */
    void (*kinetic)(const drape_elements *el, int32_t first, int32_t count, const double *x, const double *v,
                    const drape_kinetic *out);

    /* Its elements on a cloth with periodic edges are those of the cloth that goes on across them, each once:
     * build reads edge_image. A term without this is refused there if its elements reach over edges, or lie
     * along them. */
    bool periodic;

    /* law: the loss of a measured fabric adds this term to its cloth, unless a term of the cloth dissipates
     * within it. Its first parameter is a retardation time [s], the only one that it requires. "verlet"
     * leaves it out. */
    bool from_fabric;
} drape_term_ops;

/* Registers a user-defined term, which scenes compiled with this context may then use by name. *ops is
 * copied; everything it points to must outlive the context and every model compiled with it. A shorter table
 * of an older version is accepted. Errors: DRAPE_E_ARGUMENT (not well formed, name already in use, more than
 * 32), DRAPE_E_VERSION (struct_size). */
DRAPE_API drape_status drape_context_add_term(drape_context *ctx, const drape_term_ops *ops);

/* One comparison of analytic derivatives with central differences. */
typedef struct drape_check_result {
    const char
        *term; /* name of a term, "contact", "self_contact" or "assembled"; valid as long as the model */
    const char *what; /* "gradient", "Hessian", "force by rate" ...; static */
    double error;     /* relative, the largest in the sample */
    double limit;     /* beyond which it fails */
    bool pass;        /* error <= limit */
} drape_check_result;

/* Compares every analytic derivative of a model with differences, at a deformed, rotated, moving state: of
 * its terms, element by element, of the assembled Jacobian, and of contact. This is what `drape check`
 * prints, for the tests of a term. seed: of the random deformation. results (room) receives the first
 * comparisons; *count their number, which may be larger than room. A comparison that fails is not an
 * error. Errors: DRAPE_E_ARGUMENT (NULL), DRAPE_E_MEMORY, DRAPE_E_STOPPED (the context's cancel function).
 * Thread-safety: as functions of the context. */
DRAPE_API drape_status drape_model_check_derivatives(const drape_model *model, unsigned seed,
                                                     drape_check_result *results, int32_t room,
                                                     int32_t *count);

/* Makes a range function out of a function for one element. x (d) are local coordinates; outputs that are
 * NULL are not written. Use:
 *
 *     static void my_energy(const drape_elements *el, int32_t first, int32_t count, const double *x,
 *                           const double *internal, double *e, double *g, double *hess)
 *     {
 *         drape_energy_range(el, first, count, x, e, g, hess, my_element);
 *     } */
typedef void drape_element_energy(const drape_elements *el, int32_t element, const double *x, double *e,
                                  double *g, double *hess);
DRAPE_API void drape_energy_range(const drape_elements *el, int32_t first, int32_t count, const double *x,
                                  double *e, double *g, double *hess, drape_element_energy *one);

/* Implements the function measure of a term by its lanes, for a range of any length. */
typedef void drape_measure_lanes(const drape_elements *el, const int32_t *element, const double *x,
                                 const double *internal, double *q, double *dq, double *ddq);
DRAPE_API void drape_measure_range(const drape_elements *el, int32_t first, int32_t count, const double *x,
                                   const double *internal, double *q, double *dq, double *ddq,
                                   drape_measure_lanes *lanes);

/* Implements the function measure of a term by its parts, for a range of any length. */
typedef void drape_part_lanes(const drape_elements *el, const int32_t *part, const double *x,
                              const double *internal, double *s, double *ds, double *dds);
DRAPE_API void drape_part_range(const drape_elements *el, int32_t first, int32_t count, const double *x,
                                const double *internal, double *q, double *dq, double *ddq,
                                drape_part_lanes *part);

/* For terms with pair: the vector d (3 x count) between the two nodes of each element and their distance l
 * (count). */
DRAPE_API void drape_pair_distance(const drape_elements *el, int32_t first, int32_t count, const double *x,
                                   double *l, double *d);

/* ---- Colliders ---- */

/* The parts of a collider that cloth can touch besides its smooth surface, in the collider's own coordinates:
 * points against the faces of a cloth, segments against its edges, and triangles (for colliders without a
 * smooth distance) against its nodes. The surface lies `radius` outside of them. No segment has length 0. A
 * shape starts as all zeros; its arrays are allocated by drape_shape_reserve. */
typedef struct drape_collider_shape {
    int32_t point_count, segment_count, triangle_count; /* lengths of the arrays below */
    double *point;                                      /* (point_count x 3) [m] */
    int32_t *segment;                                   /* (segment_count x 2) point numbers */
    int32_t *triangle; /* (triangle_count x 3) point numbers, counterclockwise from outside */
    double radius;     /* distance of the surface from these parts [m] */
    bool inscribed;    /* of a convex body: its points and segments stay inside a curved surface */
    const void *kept;  /* data that the collider keeps for its distance, from drape_shape_take; NULL: none */
    struct drape_shape_builder *builder; /* used by the functions below; NULL outside the function shape */
    double distance; /* activation distance of this collider [m]; 0: that of the scene's contact */
    void *user;      /* of the collider's ops */
} drape_collider_shape;

/* Allocates the arrays of a shape, which live as long as the model. Call it once. Errors: DRAPE_E_MEMORY. */
DRAPE_API drape_status drape_shape_reserve(drape_collider_shape *shape, int32_t points, int32_t segments,
                                           int32_t triangles);

/* Allocates count x size bytes, zeroed, for data that the collider keeps; they live as long as the model.
 * Returns NULL if memory is out: shape must then return DRAPE_E_MEMORY. */
DRAPE_API void *drape_shape_take(drape_collider_shape *shape, size_t count, size_t size);

/* Rejects a value: the reason is reported at that parameter in the scene. Returns DRAPE_E_ARGUMENT, which
 * shape must return. */
DRAPE_API drape_status drape_shape_refuse(drape_collider_shape *shape, const char *parameter,
                                          const char *format, ...) DRAPE_PRINTF(3, 4);

/* Fills points, segments and triangles from the OBJ or PLY file that the TEXT parameter of this name gives,
 * relative to the scene. The mesh is scaled, then rotated about the origin by turn (a value of the kind
 * DRAPE_PARAM_TURN), then translated. It must be closed, with its triangles counterclockwise from outside.
 * Errors, which shape must return: DRAPE_E_FILE, DRAPE_E_PARSE, DRAPE_E_ARGUMENT, DRAPE_E_MEMORY. */
DRAPE_API drape_status drape_shape_read_mesh(drape_collider_shape *shape, const char *parameter,
                                             const double scale[3], const double turn[3],
                                             const double translate[3]);

/*
 * A collider: a rigid, closed obstacle. values are in the order of params; a vector occupies three.
 * Coordinates are the collider's own: tracks move and turn it as a whole. Thread-safety: as for terms, except
 * that shape, which is called once per collider while a model is compiled, may allocate memory.
 */
typedef struct drape_collider_ops {
    size_t struct_size; /* the author's sizeof(drape_collider_ops) */
    drape_entry entry;  /* its reference is the source of the distance */

    /* Rejects invalid combinations of values, and fills the shape. tolerance [m]: how far a polygon may lie
     * inside a curved surface that it approximates. */
    drape_status (*shape)(const double *values, double tolerance, drape_collider_shape *shape);

    /* Returns the signed distance of x from the surface [m], negative inside. Writes its gradient normal (3),
     * of length 1, and its Hessian curvature (3 x 3 [1/m]) unless they are NULL. Must be defined everywhere:
     * where the gradient is not unique, any one of the candidates is returned. */
    double (*distance)(const double *values, const drape_collider_shape *shape, const double *x,
                       double *normal, double *curvature);

    /* Whether the derivatives of distance are suitable for contact in a residual, that is, continuous
     * outside. Nodes of the cloth then meet the surface through distance; otherwise they meet the triangles
     * of the shape. */
    bool smooth;

    /* Passed on unchanged in shape->user. As for terms, it must outlive the context and every model. */
    void *user;
} drape_collider_ops;

/* Registers a user-defined collider, as drape_context_add_term does for a term. Errors: DRAPE_E_ARGUMENT (not
 * well formed, name already in use, more than 32), DRAPE_E_VERSION (struct_size). */
DRAPE_API drape_status drape_context_add_collider(drape_context *ctx, const drape_collider_ops *ops);

DRAPE_C_END

#endif
