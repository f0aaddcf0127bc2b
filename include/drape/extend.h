/*
 * extend.h: all that an author of a term or a collider needs: parameter lists, the view of a cloth, the ops
 * table of a term, the shape and the ops table of a collider.
 *
 * A term is a sum over elements of one cloth. Its author writes, for a range of elements in local
 * coordinates, one of
 *
 *   - measure: a scalar strain measure q(x) with gradient and Hessian, of which the library makes the energy
 *     E = 1/2 k (q - q0)^2
 *   - energy: any energy E(x) with gradient and Hessian
 *   - dissipation: a force g(x, v), positive against the motion, with its derivatives
 *   - law: a force along the strain measures of the other terms of its cloth, such as a damping
 *
 * The library owns the loops, the sparsity, the scatter, the projection, boundary conditions and threads.
 *
 * Thread-safety: every function of a term may be called from several threads at once on different ranges; it
 * must not allocate and must read nothing but its arguments. The exception is build, called once per cloth
 * while a model is compiled.
 */
#ifndef DRAPE_EXTEND_H
#define DRAPE_EXTEND_H

#include <math.h>

#include "drape.h"

DRAPE_C_BEGIN

/* ---- Parameters ---- */

/* What a parameter is. */
typedef enum drape_param_kind {
    DRAPE_PARAM_NUMBER,  /* any number of the range */
    DRAPE_PARAM_INTEGER, /* a whole one */
    DRAPE_PARAM_BOOLEAN, /* 0 or 1 */
    DRAPE_PARAM_CHOICE,  /* the index of one of choices */
    DRAPE_PARAM_VECTOR,  /* three numbers, one after another in the values; the range holds for each */
    DRAPE_PARAM_TURN,    /* three numbers: a vector along the axis, as long as the angle [degrees], which the
                            range holds for; may be given as axis and angle, four numbers */
    DRAPE_PARAM_TEXT     /* a text, such as the name of a file; it does not travel: its value is 0 */
} drape_param_kind;

/* One parameter. All values travel as doubles: integers exact, booleans 0 or 1, choices by index; a vector
 * or a turn takes three of them, so that the values of the parameters after it stand two further on. In C the
 * macros below write one. */
typedef struct drape_param {
    const char *name;           /* as in scenes */
    drape_param_kind kind;      /* what values it has */
    const char *unit;           /* "N/m", "s", "1" for none */
    double default_value;       /* NaN: there is none, see derived */
    const char *derived;        /* with a NaN default: what is taken instead, in words; NULL: the parameter is
                                   required */
    double min, max;            /* closed range; ignored by booleans and choices */
    bool open_min, open_max;    /* the bound itself is excluded */
    const char *const *choices; /* NULL-ended list of names */
    const char *help;           /* what it is and what it does, one line */
    bool uniform;               /* VECTOR: one number may stand for three equal ones */
    const char *numbers;        /* VECTOR: what the three are, "[k11, k22, k12]"; NULL: [x, y, z] */
} drape_param;

/* A parameter that is a number: name, unit, default, range and help. C only, as C++17 has no designated
 * initialisers:
 *     static const drape_param params[] = {
 *         DRAPE_NUMBER("tolerance", "N", 1e-6, DRAPE_ABOVE(0), 1e12, "bound on the residual"),
 *         DRAPE_VECTOR("size", "m", DRAPE_REQUIRED, 0, 1e9, "lengths of the edges", .uniform = true),
 *         DRAPE_CHOICE("rest", 0, rest_choices, "rest angles: those of the mesh, or flat")};
 * DRAPE_REQUIRED and DRAPE_DERIVED stand for a default, DRAPE_ABOVE and DRAPE_BELOW for a bound that the
 * range excludes. Other members may follow the help. */
#define DRAPE_NUMBER(name_, unit_, default_, min_, max_, ...)                                                \
    {                                                                                                        \
        .name = name_, .kind = DRAPE_PARAM_NUMBER, .unit = unit_, .default_value = default_, .min = min_,    \
        .max = max_, .help = __VA_ARGS__                                                                     \
    }
/* A whole number. */
#define DRAPE_INTEGER(name_, unit_, default_, min_, max_, ...)                                               \
    {                                                                                                        \
        .name = name_, .kind = DRAPE_PARAM_INTEGER, .unit = unit_, .default_value = default_, .min = min_,   \
        .max = max_, .help = __VA_ARGS__                                                                     \
    }
/* Three numbers; default and range are those of each. */
#define DRAPE_VECTOR(name_, unit_, default_, min_, max_, ...)                                                \
    {                                                                                                        \
        .name = name_, .kind = DRAPE_PARAM_VECTOR, .unit = unit_, .default_value = default_, .min = min_,    \
        .max = max_, .help = __VA_ARGS__                                                                     \
    }
/* A rotation; the range is that of its angle [degrees]. */
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
/* One of a NULL-ended list of names; the default is an index. */
#define DRAPE_CHOICE(name_, default_, choices_, ...)                                                         \
    {                                                                                                        \
        .name = name_, .kind = DRAPE_PARAM_CHOICE, .unit = "1", .default_value = default_,                   \
        .choices = choices_, .help = __VA_ARGS__                                                             \
    }
/* A text, always required. */
#define DRAPE_TEXT(name_, ...)                                                                               \
    {                                                                                                        \
        .name = name_, .kind = DRAPE_PARAM_TEXT, .unit = "1", .default_value = DRAPE_REQUIRED,               \
        .help = __VA_ARGS__                                                                                  \
    }
/* In place of a default: the parameter must be given. */
#define DRAPE_REQUIRED ((double)NAN)
/* In place of a default: what is taken instead, in words. */
#define DRAPE_DERIVED(words) DRAPE_REQUIRED, .derived = words
/* In place of min: values are above it. */
#define DRAPE_ABOVE(bound) bound, .open_min = true
/* In place of max: values are below it. */
#define DRAPE_BELOW(bound) bound, .open_max = true

#define DRAPE_MAX_PARAMS 24 /* values of all parameters of an entry */

/* ---- Entries ---- */

/* What every implementation that is chosen by name says of itself: a term, a collider, and all that `drape
 * list` shows. The struct of its functions begins with it, behind its size where it has one. Texts and
 * parameters are static. */
typedef struct drape_entry {
    const char *name;          /* as in scenes: "bend.hinge" */
    const char *summary;       /* one line for `drape list` */
    const char *reference;     /* where the method is from: paper and equation; NULL: nowhere else */
    const drape_param *params; /* param_count of them; NULL: none */
    int param_count;           /* of params */
} drape_entry;

/* Initialises params and param_count of an entry from an array. */
#define DRAPE_PARAMS(array) .params = (array), .param_count = (int)(sizeof(array) / sizeof *(array))

/* ---- What a term is built from ---- */

/* Stiffness and mass of a sheet, resolved. SI units. */
typedef struct drape_material {
    double young_modulus, poisson_ratio, thickness; /* [Pa], [1], [m] */
    double areal_density;      /* [kg/m2]; total mass over area where the mass is uniform */
    double membrane_stiffness; /* E h [N/m] */
    double flexural_rigidity;  /* D = E h^3 / (12 (1 - nu^2)) [N m] */
    double bending_warp, bending_weft, bending_twist; /* of a measured fabric [N m]; NaN: it is none */
} drape_material;

/* Stiffness of a woven sheet, in tension [N/m] or in bending [N m]. */
typedef struct drape_woven {
    double warp, weft; /* of strips along them with free sides */
    double shear;      /* of shear, or of twist */
    double poisson;    /* sqrt(nu12 nu21) [1] */
} drape_woven;

/* One cloth at rest. Node numbers are local to the cloth. All arrays are const and live as long as the model
 * is compiled. */
typedef struct drape_cloth_view {
    int32_t node_count, triangle_count, edge_count, hinge_count; /* of the arrays below */
    const double *rest;                                          /* (node_count x 3) rest positions [m] */
    const int32_t *triangle;                                     /* (triangle_count x 3) */
    const double *triangle_area;                                 /* (triangle_count) [m2] */
    const int32_t *edge;                                         /* (edge_count x 2) */
    const int32_t *edge_triangle; /* (edge_count x 2) triangles beside the edge; second -1 on the boundary */
    const double *edge_length;    /* (edge_count) [m] */
    const int32_t *hinge; /* (hinge_count x 4) x0 x1 the shared edge, x2 x3 the apices of its two triangles */
    const int32_t *hinge_edge;    /* (hinge_count) */
    const int32_t *triangle_edge; /* (triangle_count x 3) the edge from corner k to corner k + 1 */
    const uint8_t *edge_clamped;  /* (edge_count) 1: a pin keeps the direction of the sheet across it */
    const double *node_area;      /* (node_count) lumped, a third of each triangle [m2] */
    const double *node_mass;      /* (node_count) lumped [kg] */
    int32_t rows, columns;        /* of a grid, in nodes: node r * columns + c; 0 on other meshes */
    bool rectangular;             /* a grid whose cells are rectangles before its transform */
    drape_material material;      /* of the sheet */
    double gravity[3];            /* [m/s2] */
    const drape_woven *tension, *bending; /* of a measured fabric; NULL: the material says all */
} drape_cloth_view;

/* Receives the elements of a term while its cloth is compiled. Opaque. */
typedef struct drape_term_builder drape_term_builder;

/* Announces the elements of a term; called once, first, by build. nodes: of an element, 1 to
 * DRAPE_MAX_ELEMENT_NODES; rest_count: numbers of rest data an element. Errors: DRAPE_E_MEMORY,
 * DRAPE_E_ARGUMENT. */
DRAPE_API drape_status drape_term_reserve(drape_term_builder *builder, int32_t element_count, int rest_count);

/* The same for elements of fewer nodes than the term's, on this cloth. A node may stand in several places of
 * an element, as its first does in places that are left over: its derivatives are the sum of theirs. */
DRAPE_API drape_status drape_term_reserve_nodes(drape_term_builder *builder, int32_t element_count, int nodes,
                                                int rest_count);

/* Says that elements of this cloth hold on to directions in space: their forces have a torque. */
DRAPE_API void drape_term_anchor(drape_term_builder *builder);

/* Sets element `element`: its nodes (local to the cloth) and its rest data. Measures keep k [J/q2] in rest[0]
 * and q0 in rest[1]; terms that are damped keep c >= 0 [J s/q2] in rest[2]. */
DRAPE_API void drape_term_set(drape_term_builder *builder, int32_t element, const int32_t *nodes,
                              const double *rest);

/* Refuses to build: the reason is reported at the place of the term in the scene. Returns DRAPE_E_ARGUMENT.
 */
DRAPE_API drape_status drape_term_refuse(drape_term_builder *builder, const char *format, ...)
    DRAPE_PRINTF(2, 3);

/* The most nodes that an element has. */
#define DRAPE_MAX_ELEMENT_NODES 12
/* Their coordinates. */
#define DRAPE_MAX_ELEMENT_DOFS (3 * DRAPE_MAX_ELEMENT_NODES)

/* The elements of one term on one cloth, const after compile. */
typedef struct drape_elements {
    int32_t count;        /* elements */
    int nodes;            /* nodes an element */
    int rest_count;       /* numbers of rest data an element */
    const int32_t *node;  /* (count x nodes) node numbers of the whole model */
    const double *rest;   /* (rest_count x count): item k of element e is rest[k * count + e] */
    const double *params; /* values in the order of the term's parameters */
} drape_elements;

/* What a check found, for the message of a rejected step. */
typedef struct drape_fault {
    const char *reason;  /* short token: "edge_collapse"; static text */
    const char *what;    /* "edge length / rest length"; static text */
    int32_t element;     /* the worst */
    double value, limit; /* of what, there, and where it becomes a fault */
} drape_fault;

/* ---- The ops table of a term ---- */

/* The most elements that pair is asked for at once. */
#define DRAPE_PAIR_BLOCK 32
/* How many elements lanes takes at once. */
#define DRAPE_LANES 4

/*
 * A term. Exactly one of measure, energy, dissipation, law is set. Ranges are elements first ... first +
 * count
 * - 1; outputs are element-major: item i belongs to element first + i. d = 3 * nodes. Gradients have the sign
 * of dE/dx, so a force is minus that. x, v: (nodes of the model x 3). internal: (element_count) internal
 * variables of the last accepted state, of terms that have them, else NULL. An output pointer that is NULL is
 * not wanted.
 */
typedef struct drape_term_ops {
    size_t struct_size;        /* sizeof(drape_term_ops) of the author */
    drape_entry entry;         /* with a reference: paper and equation of the formula */
    const char *element_name;  /* "edge", "hinge", "node": for messages */
    int nodes;                 /* nodes an element, 1 to DRAPE_MAX_ELEMENT_NODES; 0 for a law */
    bool linear;               /* energy: its Hessian is zero and takes no sparsity */
    bool potential_of_gravity; /* energy: a force from outside, counts as gravity, not as elastic */
    bool convex;               /* measure: its Hessian ddq is positive semidefinite, as of a length */
    bool has_internal;         /* internal variables in each element */
    int internal_count;        /* of an element, one after another; 0: one */
    bool constraint; /* an energy that keeps a limit: integrators that move nodes to keep limits do without */
    bool damped;     /* measure: a dashpot of its own in each element, force c q' on q */
    bool distance;   /* measure: q is the distance of its two nodes, of all elements */

    /* Adds the elements of one cloth. Called once a cloth. Errors: what the builder returned. */
    drape_status (*build)(const drape_cloth_view *cloth, const double *params, drape_term_builder *builder);

    /* q [q] (count), dq (count x d), ddq (count x d x d, symmetric). */
    void (*measure)(const drape_elements *el, int32_t first, int32_t count, const double *x,
                    const double *internal, double *q, double *dq, double *ddq);

    /* Optional, beside measure, where nodes is 2 and q is a linear function of the distance of the nodes: the
     * same with a tenth of the numbers. q (count), d (3 x count: all x, all y, all z) = x1 - x0 [m], c
     * (count) with dq = (-c d, c d), so that ddq = (P -P; -P P), P = c (I - d d'/d.d). count is at most
     * DRAPE_PAIR_BLOCK. */
    void (*pair)(const drape_elements *el, int32_t first, int32_t count, const double *x, double *q,
                 double *d, double *c);

    /* Optional, beside measure: the same for the DRAPE_LANES elements of a list at once; the same one may
     * stand in several places. Item i of the element in place l is at [DRAPE_LANES i + l]: q (1), dq (d), ddq
     * (d x d), of which only the 3 x 3 blocks on and below the diagonal are written. */
    void (*lanes)(const drape_elements *el, const int32_t *element, const double *x, const double *internal,
                  double *q, double *dq, double *ddq);

    /* e [J] (count), g [N] (count x d), hess [N/m] (count x d x d, symmetric). */
    void (*energy)(const drape_elements *el, int32_t first, int32_t count, const double *x,
                   const double *internal, double *e, double *g, double *hess);

    /* g [N] (count x d), dg_dx [N/m], dg_dv [N s/m] (count x d x d each). */
    void (*dissipation)(const drape_elements *el, int32_t first, int32_t count, const double *x,
                        const double *v, double *g, double *dg_dx, double *dg_dv);

    /* For count elements with stiffness k [J], strain = q - q0 and rate = q' [q/s]: adds the generalised
     * force [J/q] on q, its derivatives by strain and by rate, and the energy [J] if it has one. All are
     * (count). dissipative: the force takes work, without an energy. */
    void (*law)(const double *params, int32_t count, const double *k, const double *strain,
                const double *rate, double *force, double *dforce_dstrain, double *dforce_drate,
                double *energy);
    bool dissipative; /* law: as said there */

    /* The internal variable of elements after a step was accepted: from those before and the new positions.
     */
    void (*commit)(const drape_elements *el, int32_t first, int32_t count, const double *x,
                   const double *before, double *after);

    /* The internal variable of elements at rest, x the rest positions. after and before are indexed by
     * element, like internal. */
    void (*initial)(const drape_elements *el, int32_t first, int32_t count, const double *x, double *after);

    /* Looks for an element that a step from before to x made degenerate: DRAPE_OK, or DRAPE_RETRY_DEGENERATE
     * with *fault filled for the worst. One that was so before and did not become worse is not the step's
     * fault: else no step could lead out of it. before NULL: none is excused. check NULL: none can be. */
    drape_status (*check)(const drape_elements *el, const double *x, const double *before,
                          const double *internal, drape_fault *fault);

    /* dissipation: it is in a medium. v is the velocity against it, less by the wind of
     * drape_sim_set_wind. */
    bool in_medium;

    /* Optional, beside measure: the ddq with which force ddq is its positive semidefinite part, given the
     * force of each element, so (ddq)+ where it pulls and (ddq)- where it pushes; ddq (count x d x d,
     * symmetric). Without it, and without convex, what is made positive loses force ddq, and with it the
     * stiffness that tension gives. */
    void (*positive)(const drape_elements *el, int32_t first, int32_t count, const double *x,
                     const double *internal, const double *force, double *ddq);
} drape_term_ops;

/* Registers a user-defined term: scenes compiled with this context may name it from then on. *ops is copied;
 * what it points to must outlive the context and every model compiled with it. Ops of an older, shorter
 * version are read. Errors: DRAPE_E_ARGUMENT (not well formed, name taken, more than 32), DRAPE_E_VERSION
 * (struct_size). */
DRAPE_API drape_status drape_context_add_term(drape_context *ctx, const drape_term_ops *ops);

/* Makes a range function out of a function for one element. x (d) and v (d) are local coordinates; writes
 * what is not NULL. Use as static void my_energy(const drape_elements *el, int32_t first, int32_t count,
 * const double *x, const double *internal, double *e, double *g, double *hess) { drape_energy_range(el,
 * first, count, x, e, g, hess, my_element); } */
typedef void drape_element_energy(const drape_elements *el, int32_t element, const double *x, double *e,
                                  double *g, double *hess);
DRAPE_API void drape_energy_range(const drape_elements *el, int32_t first, int32_t count, const double *x,
                                  double *e, double *g, double *hess, drape_element_energy *one);

/* Makes the function measure of a term out of its lanes, for a range of any count. */
typedef void drape_measure_lanes(const drape_elements *el, const int32_t *element, const double *x,
                                 const double *internal, double *q, double *dq, double *ddq);
DRAPE_API void drape_measure_range(const drape_elements *el, int32_t first, int32_t count, const double *x,
                                   const double *internal, double *q, double *dq, double *ddq,
                                   drape_measure_lanes *lanes);

/* For terms with pair: d (3 x count) and the distance l (count) of the two nodes of each element. */
DRAPE_API void drape_pair_distance(const drape_elements *el, int32_t first, int32_t count, const double *x,
                                   double *l, double *d);

/* ---- Colliders ---- */

/* What of a collider cloth can touch besides its smooth surface, in the collider's own coordinates, with the
 * surface `radius` outside of it: points against the faces of a cloth, segments against its edges, and
 * triangles (colliders without a smooth distance) against its nodes. No segment has the length 0. A shape
 * begins as all zeros; arrays are taken by drape_shape_reserve. */
typedef struct drape_collider_shape {
    int32_t point_count, segment_count, triangle_count; /* of the arrays below */
    double *point;                                      /* (point_count x 3) [m] */
    int32_t *segment;                                   /* (segment_count x 2) numbers of points */
    int32_t *triangle; /* (triangle_count x 3) numbers of points, counterclockwise from outside */
    double radius;     /* [m] */
    bool inscribed;    /* of a convex body: its points and segments stay inside of a curved surface */
    const void *kept;  /* what the collider keeps for its distance, of drape_shape_take; NULL for nothing */
    struct drape_shape_builder *builder; /* of the functions below; NULL outside of the function shape */
} drape_collider_shape;

/* Takes the arrays of a shape; they live as long as the model. Called once. Errors: DRAPE_E_MEMORY. */
DRAPE_API drape_status drape_shape_reserve(drape_collider_shape *shape, int32_t points, int32_t segments,
                                           int32_t triangles);

/* Memory that lives as long as the model, zeroed, for what the collider keeps; NULL: return
 * DRAPE_E_MEMORY. */
DRAPE_API void *drape_shape_take(drape_collider_shape *shape, size_t count, size_t size);

/* Refuses a value: the reason is reported at the parameter in the scene. Returns DRAPE_E_ARGUMENT. */
DRAPE_API drape_status drape_shape_refuse(drape_collider_shape *shape, const char *parameter,
                                          const char *format, ...) DRAPE_PRINTF(3, 4);

/* Fills points, segments and triangles from the OBJ or PLY file that the TEXT parameter of this name gives,
 * relative to the scene: scaled, then turned about the origin (a value of the kind TURN), then moved. The
 * mesh must be closed and its triangles counterclockwise from outside. Errors: DRAPE_E_FILE, DRAPE_E_PARSE,
 * DRAPE_E_ARGUMENT, DRAPE_E_MEMORY; return them. */
DRAPE_API drape_status drape_shape_read_mesh(drape_collider_shape *shape, const char *parameter,
                                             const double scale[3], const double turn[3],
                                             const double translate[3]);

/*
 * A collider: a rigid, closed obstacle. values: in the order of params; a vector takes three.
 * Coordinates are the collider's own: a track moves it as a whole. Thread-safety: as for terms; shape, called
 * once a collider while a model is compiled, may allocate.
 */
typedef struct drape_collider_ops {
    size_t struct_size; /* sizeof(drape_collider_ops) of the author */
    drape_entry entry;  /* with a reference: where its distance is from */

    /* Refuses values that do not go together, and fills the shape. tolerance [m]: how far a polygon may stay
     * inside a curved surface. */
    drape_status (*shape)(const double *values, double tolerance, drape_collider_shape *shape);

    /* The signed distance of x from the surface [m], negative inside; normal (3), its gradient, of length 1;
     * curvature (3 x 3 [1/m]), its Hessian. Outputs that are NULL are not wanted. Everywhere defined: where
     * the gradient is not unique, one of those there. */
    double (*distance)(const double *values, const drape_collider_shape *shape, const double *x,
                       double *normal, double *curvature);

    /* The derivatives of distance serve contact in a residual: they are continuous outside, and nodes of the
     * cloth meet the surface by it. Else they meet the shape's triangles. */
    bool smooth;
} drape_collider_ops;

/* Registers a user-defined collider, as drape_context_add_term does a term. Errors: DRAPE_E_ARGUMENT
 * (not well formed, name taken, more than 32), DRAPE_E_VERSION (struct_size). */
DRAPE_API drape_status drape_context_add_collider(drape_context *ctx, const drape_collider_ops *ops);

DRAPE_C_END

#endif
