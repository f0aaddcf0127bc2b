/*
 * drape.h: everything a user of the library needs: contexts, scenes, models, sims, observers.
 *
 * Units are SI: metres, kilograms, seconds, newtons, joules, radians. Axes are right-handed with Y up;
 * gravity is given explicitly. Arrays of node vectors are interleaved, x0 y0 z0 x1 y1 z1 ..., in double
 * precision.
 *
 * Errors. A function that can fail returns a drape_status; drape_context_message() then says what is wrong,
 * where, with which value, and what would be right. The library never prints, exits or aborts.
 *
 * Ownership. An object is made by a function that ends in _create, _load, _parse or _compile, and freed by
 * its _destroy, which takes the address of the handle and sets the handle to NULL. Destroying a NULL handle
 * does nothing. A context must outlive everything made from it, and a model must outlive its sims.
 *
 * Threads. A context or a scene may be used by one thread at a time. A model is read-only: several threads
 * may read it and run sims on it, each with a context of its own. A sim may be used by one thread at a time;
 * only drape_sim_cancel may be called from any thread.
 */
#ifndef DRAPE_DRAPE_H
#define DRAPE_DRAPE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "export.h"

DRAPE_C_BEGIN

/* ---- Status ---- */

/* The sign says what to do next: 0, done; > 0, a smaller step may succeed; < 0, it will not, so stop and
 * report. */
typedef enum drape_status {
    DRAPE_OK = 0,
    DRAPE_RETRY_NONLINEAR = 1,   /* the nonlinear solver did not reach its tolerance */
    DRAPE_RETRY_LINEAR = 2,      /* the linear solver failed: singular matrix, or no memory for its fill-in */
    DRAPE_RETRY_NONFINITE = 3,   /* a residual, a Jacobian entry or a result is not finite */
    DRAPE_RETRY_DEGENERATE = 4,  /* an element collapsed: edge length, altitude or hinge angle */
    DRAPE_RETRY_REJECTED = 5,    /* the step controller or the error test rejected the step */
    DRAPE_E_ARGUMENT = -1,       /* an invalid argument, scene value or command line */
    DRAPE_E_MEMORY = -2,         /* an allocation failed */
    DRAPE_E_FILE = -3,           /* a file cannot be opened, read or written */
    DRAPE_E_PARSE = -4,          /* the text of a scene or mesh is malformed */
    DRAPE_E_STEP_TOO_SMALL = -5, /* the step is below dt_min, or there were too many steps; the last accepted
                                    state is kept */
    DRAPE_E_SOLVER = -6,  /* a step failed and no smaller step may be tried, or the solver could not be set
                             up */
    DRAPE_E_VERSION = -7, /* a struct or file belongs to another version of Drape */
    DRAPE_E_STOPPED = -8  /* an observer, drape_sim_cancel or the context's cancel function asked to stop */
} drape_status;

/* The name of a status in lower case without its prefix: "ok", "retry_nonlinear", "e_step_too_small";
 * "unknown" for a value that is not a status. */
DRAPE_API const char *drape_status_name(drape_status status);

/* The version of the linked library, such as "0.1.0"; compare it with DRAPE_VERSION_* of the header. */
DRAPE_API const char *drape_version(void);

/* ---- Context ---- */

/* Holds the allocator, the log function, the last message, and user-defined terms and colliders. */
typedef struct drape_context drape_context;

/* Severity of a log line. */
typedef enum drape_log_level { DRAPE_LOG_INFO = 0, DRAPE_LOG_WARNING = 1 } drape_log_level;

/* Settings of a context. Initialise with drape_context_def_init. */
typedef struct drape_context_def {
    size_t struct_size; /* set by drape_context_def_init; a def that is too short or too long is rejected */
    /* Allocator for all memory that Drape itself takes. Set both functions or neither. allocate returns
     * memory aligned for any type, or NULL on failure; release receives what allocate returned, never NULL.
     * Default: malloc and free. SUNDIALS and KLU always use malloc. */
    void *(*allocate)(void *user, size_t size);
    void (*release)(void *user, void *memory);
    void *allocator_user;
    /* Receives log lines without a newline. Default NULL: no logging. */
    void (*log)(void *user, drape_log_level level, const char *text);
    void *log_user;
    /* Called while a scene is read or compiled, a sim is created or restored, and what passes through what is
     * counted, on the calling thread. If it returns true, the operation ends with DRAPE_E_STOPPED as if it
     * had never been started. It may be called thousands of times, so it must be cheap and free of side
     * effects. Default NULL: never cancel. To stop a running sim, use drape_sim_cancel. */
    bool (*cancel)(void *user);
    void *cancel_user;
} drape_context_def;

/* Fills *def with the defaults. Pass the caller's sizeof(drape_context_def) as struct_size. Nothing if def is
 * NULL. */
DRAPE_API void drape_context_def_init(drape_context_def *def, size_t struct_size);

/* Creates a context. If def is NULL, the defaults apply. Errors: DRAPE_E_ARGUMENT (def not initialised, or
 * out is NULL), DRAPE_E_MEMORY. */
DRAPE_API drape_status drape_context_create(const drape_context_def *def, drape_context **out);

/* Frees a context. Everything made from it must have been freed before. */
DRAPE_API void drape_context_destroy(drape_context **ctx);

/* The message of the last failed call: one line without a newline, "" before any failure. Valid until the
 * next call with this context or with an object made from it. For a NULL ctx, a fixed text. */
DRAPE_API const char *drape_context_message(const drape_context *ctx);

/* ---- Scene in memory: structs that a host fills instead of writing a scene file ---- */

/* Defs in this section begin with struct_size, set by their _init function; all defs of one array have the
 * same size. drape_setting, drape_entry_def, drape_track_key, drape_turn_key and drape_fold_def have no
 * struct_size: their layout is fixed. */

/* One parameter, given by name. Numbers and integers go into number, with text and vector NULL; choices and
 * file names go into text; booleans go into text as "true" or "false", or into number as 0 or 1; vectors go
 * into vector, and so do points of a curve, as x0 y0 x1 y1 ... with 2 in number. */
typedef struct drape_setting {
    const char *name;     /* name of the parameter */
    double number;        /* value of a number, integer or boolean; with vector 0, or 2 if it is of pairs */
    const char *text;     /* value of a choice, file name or boolean; NULL: none */
    const double *vector; /* vector_count numbers: 3, 4 for axis and angle [degrees], or those of points */
    size_t vector_count;  /* length of vector */
} drape_setting;

/* An entry of one of Drape's tables, such as a term or an integrator, chosen by name, with the parameters
 * that differ from their defaults. `drape list` shows all entries. */
typedef struct drape_entry_def {
    const char *type;              /* name of the entry */
    const drape_setting *settings; /* setting_count settings; NULL: none */
    size_t setting_count;          /* length of settings */
} drape_entry_def;

/* A triangle mesh from one of three sources: exactly one of grid.type, file and positions is set. It is
 * embedded in drape_cloth_def, so it can grow only into its reserved members. */
typedef struct drape_mesh_def {
    drape_entry_def grid;              /* a grid, such as "equilateral" or "square" */
    const char *file;                  /* an OBJ or PLY file; the extension decides which */
    const double *positions;           /* node_count x 3 [m], copied */
    const int32_t *triangles;          /* triangle_count x 3, 0-based, copied */
    size_t node_count, triangle_count; /* lengths of positions and triangles */
    double scale[3];                   /* default 1 1 1; applied first */
    double rotate[4];                  /* axis x y z and angle [degrees]; default: no rotation; applied
                                          second */
    double translate[3];               /* [m]; default 0; applied last */
    int32_t subdivide; /* each triangle in four, so many times, at most 12; nodes keep their numbers, and
                          nodes between those of one pin are pinned; default 0 */
    void *reserved[3]; /* must be NULL */
} drape_mesh_def;

/* A key of a track. A track is the displacement of pinned nodes from where they start, or of a collider
 * from the position that its parameters define, as a piecewise linear function of time; it is constant
 * before the first and after the last key. */
typedef struct drape_track_key {
    double time;            /* [s], strictly increasing from key to key */
    double displacement[3]; /* [m] */
} drape_track_key;

/* A key of the rotation of a collider about its pivot, from the direction that the parameters define: by
 * axis and angle or, if it is not 0 0 0 0, by a quaternion. It is constant before the first and after the
 * last key; between two keys the collider turns steadily about one axis. Between angles about the same
 * axis it turns by their difference, however large; otherwise by the shortest turn from one to the other,
 * which is the spherical linear interpolation of the quaternions. */
typedef struct drape_turn_key {
    double time;          /* [s], strictly increasing from key to key */
    double rotate[4];     /* axis x y z and angle [degrees], of any size */
    double quaternion[4]; /* w x y z, of any length */
} drape_turn_key;

/* Nodes of one cloth that are held fixed, moved along a track, or carried by a collider. Exactly one of
 * nodes, corner, edge, row (>= 0) and has_box selects them; corner, edge and row apply to grids only. */
typedef struct drape_pin_def {
    size_t struct_size;   /* set by drape_pin_def_init */
    const int32_t *nodes; /* node_count node numbers, local to this cloth */
    size_t node_count;    /* length of nodes */
    const char *corner;   /* "top-left", "top-right", "bottom-left" or "bottom-right"; the top is row 0, the
                             left is column 0 */
    const char *edge;     /* "top", "bottom", "left" or "right" */
    int32_t row;          /* a row of the grid; -1: not selected by row */
    bool has_box;         /* whether box_min and box_max are set */
    double box_min[3], box_max[3]; /* [m], rest coordinates after the transform; the boundary is included */
    const drape_track_key *track;  /* key_count keys; NULL: fixed */
    size_t key_count;              /* length of track */
    bool clamp; /* edges between these nodes keep the direction of the sheet across them, for bending terms
                   that support it */
    const char *name;   /* for events, unique among the pins of the cloth; NULL: "pin0", "pin1" ... */
    const char *attach; /* name of the collider that carries the nodes: they ride on it from where they
                           start, as by drape_sim_attach at t = 0; not with a track. NULL: none */
    int32_t triangle;   /* of a collider that deforms: the triangle that carries them, in the order of its
                           file, from 0; -1: for each node the nearest one at t = 0 */
    double normal[3];   /* the nodes are held along this direction only: each stays in the plane across it
                           through its start, as on rollers or in a symmetry plane; a track moves the
                           plane; not with attach, and with turns only those of a clamp. Default NaN: none */
    double axis[3]; /* the nodes are held across this direction: each stays on a line along it, as on a rail;
                           not with a normal. Default NaN: none */
    const drape_turn_key *turns; /* the nodes turn about the pivot as one rigid body, and the track displaces
                                    them from there; with clamp, the direction of the sheet turns too, and
                                    with a normal or an axis it alone. Not with attach. NULL: they do not
                                    turn */
    size_t turn_count;           /* length of turns */
    double pivot[3]; /* [m] at the start; default NaN: the mean of the positions at which the nodes start */
} drape_pin_def;

/* Nodes of one cloth with masses of their own: a weight in a hem, a button, a fabric of varying weight.
 * Exactly one of nodes, corner, edge, row (>= 0) and has_box selects them, as those of a pin, and exactly one
 * of add and mass is given. Initialise with drape_mass_def_init. */
typedef struct drape_mass_def {
    size_t struct_size;            /* set by drape_mass_def_init */
    const int32_t *nodes;          /* node_count node numbers, local to this cloth */
    size_t node_count;             /* length of nodes */
    const char *corner;            /* as in drape_pin_def */
    const char *edge;              /* as in drape_pin_def */
    int32_t row;                   /* as in drape_pin_def; -1: not selected by row */
    bool has_box;                  /* whether box_min and box_max are set */
    double box_min[3], box_max[3]; /* [m], as in drape_pin_def */
    double add;  /* [kg] added to the mass of each of these nodes, in (0, 1e12]; NaN: not given */
    double mass; /* [kg] of each of these nodes, in place of its mass so far, in (0, 1e12]; NaN: not given */
} drape_mass_def;

/* Nodes of one cloth. They are selected as those of a pin, by exactly one of nodes, corner, edge, row (>=
 * 0) and has_box. It is embedded in drape_periodic_def, so it can grow only into its reserved members. */
typedef struct drape_selection_def {
    const int32_t *nodes;          /* node_count node numbers, local to this cloth */
    size_t node_count;             /* length of nodes */
    const char *corner;            /* as in drape_pin_def */
    const char *edge;              /* as in drape_pin_def */
    int32_t row;                   /* as in drape_pin_def; -1: not selected by row */
    bool has_box;                  /* whether box_min and box_max are set */
    double box_min[3], box_max[3]; /* [m], as in drape_pin_def */
    void *reserved[4];             /* must be NULL */
} drape_selection_def;

/* Two edges of a cloth that are the same edge but for a translation, so that the cloth is one cell of a sheet
 * that repeats itself, or a tube. The nodes of `to` are those of `from`, displaced at rest by one vector, by
 * which they are paired; at any time they are displaced by the period, and have the same velocity. Each of a
 * pair has half of the mass of both. Initialise with drape_periodic_def_init. */
typedef struct drape_periodic_def {
    size_t struct_size;           /* set by drape_periodic_def_init */
    drape_selection_def from, to; /* as many nodes of both */
    double period[3]; /* [m] from a node of `from` to that of `to`; the cloth starts stretched evenly to it.
                         Default NaN: the displacement at the start */
} drape_periodic_def;

/* A fold of a cloth about a line. Its far side, beyond the line in the direction `side`, turns about the
 * axis by the angle, which turns `side` about `axis` by the right-hand rule. With a radius the part next to
 * the line is rolled onto a cylinder that touches the sheet at the line, by its arc length: a plane sheet
 * is not stretched. */
typedef struct drape_fold_def {
    double point[3]; /* [m] on the line */
    double axis[3];  /* direction of the line, of any length > 0 */
    double side[3];  /* direction of what is folded over, across the axis; the part along it does not count */
    double angle;    /* [degrees] in [-360, 360] */
    double radius;   /* [m] of the cylinder, at the sheet; 0: a sharp fold */
} drape_fold_def;

/* The shape and motion in which a cloth starts, if it is not at rest; its mesh remains the shape without
 * stress. Positions come from the rest shape, from a file or from an array, and are then folded, fold after
 * fold, scaled, rotated and translated. Pinned nodes are held where they start, and tracks displace them from
 * there. The velocity of a node is that of the cloth, plus that of the spin, plus its own. It is embedded in
 * drape_cloth_def, so it can grow only into its reserved members. */
typedef struct drape_start_def {
    const char *file; /* an OBJ or PLY file with the nodes and triangles of the mesh, in their order; NULL:
                                    none */
    const double *positions;     /* (node_count x 3) [m], in place of a file; NULL: none */
    size_t position_count;       /* numbers in positions, 3 for each node */
    const drape_fold_def *folds; /* NULL: none */
    size_t fold_count;           /* length of folds */
    double scale[3];             /* default 1 1 1; after the folds */
    double rotate[4];            /* axis x y z and angle [degrees], about the origin; default: no rotation */
    double translate[3];         /* [m]; default 0; applied last */
    double spin[3];              /* [rad/s] angular velocity; default 0 */
    double pivot[3]; /* [m] the point that the spin does not move; default NaN: the centre of mass at the
                                    start */
    const char *velocity_file; /* an NPY file, nodes x 3 [m/s]; NULL: none */
    const double *velocities;  /* (node_count x 3) [m/s], in place of a file; NULL: none */
    size_t velocity_count;     /* numbers in velocities, 3 for each node */
    void *reserved[4];         /* must be NULL */
} drape_start_def;

/* A mesh that frames show in place of the one that is simulated, such as an artist's with polygons, texture
 * coordinates and materials. At rest each vertex is bound to the nearest triangle of the simulated mesh, by
 * the weights of its corners and the height along their interpolated normals, and follows it. It changes no
 * result. It is embedded in drape_cloth_def, so it can grow only into its reserved members. */
typedef struct drape_render_mesh_def {
    drape_mesh_def mesh; /* without a source: none. Its edges and nodes may be any */
    double max_distance; /* [m] of a vertex from the simulated mesh at rest, > 0; default NaN: the mean length
                            of an edge of the latter */
    void *reserved[4];   /* must be NULL */
} drape_render_mesh_def;

/* One piece of cloth. */
typedef struct drape_cloth_def {
    size_t struct_size;  /* set by drape_cloth_def_init */
    const char *name;    /* NULL: "cloth0", "cloth1" ... */
    drape_mesh_def mesh; /* its triangles at rest */
    const drape_setting
        *material;         /* young_modulus, poisson_ratio, thickness, density ...; `drape list` shows all */
    size_t material_count; /* length of material */
    const drape_entry_def *terms; /* the terms to model */
    size_t term_count;            /* length of terms */
    const drape_pin_def *pins;    /* nodes that are held or moved; NULL: none */
    size_t pin_count;             /* length of pins */
    double velocity[3];           /* initial velocity of every node [m/s] */
    const char *const
        *ignore;         /* names of colliders and cloths that this cloth passes through; its own: itself */
    size_t ignore_count; /* length of ignore */
    const drape_mass_def
        *masses;           /* applied in this order to the masses that the material gives; NULL: none */
    size_t mass_count;     /* length of masses */
    drape_start_def start; /* in which shape and with which velocities it starts; default: at rest */
    drape_render_mesh_def render_mesh;  /* the mesh that frames show; default: the simulated one */
    const drape_periodic_def *periodic; /* edges that are the same; NULL: none */
    size_t periodic_count;              /* length of periodic */
} drape_cloth_def;

/* One side of a seam: nodes of one cloth, in the order in which they are joined. They are selected as
 * those of a pin, by exactly one of nodes, corner, edge, row (>= 0) and has_box. An edge or a row runs
 * along ascending columns or rows of the grid; the nodes of a box are sorted along the longest side of
 * their own bounding box. It is embedded in drape_seam_def, so it can grow only into its reserved members. */
typedef struct drape_seam_side_def {
    const char *cloth;             /* name of the cloth; required */
    const int32_t *nodes;          /* node_count node numbers, local to this cloth */
    size_t node_count;             /* length of nodes */
    const char *corner;            /* as in drape_pin_def */
    const char *edge;              /* as in drape_pin_def */
    int32_t row;                   /* as in drape_pin_def; -1: not selected by row */
    bool has_box;                  /* whether box_min and box_max are set */
    double box_min[3], box_max[3]; /* [m], as in drape_pin_def */
    bool reverse;                  /* the order of the nodes is reversed */
    void *reserved[4];             /* must be NULL */
} drape_seam_side_def;

/* A seam: joins the nodes of a to those of b, one by one. Both have the same number of nodes. Initialise with
 * drape_seam_def_init. */
typedef struct drape_seam_def {
    size_t struct_size;       /* set by drape_seam_def_init */
    drape_entry_def entry;    /* the seam: "stitch", or a term of the host with build_seam (extend.h) */
    const char *name;         /* unique name; NULL: "seam0", "seam1" ... */
    drape_seam_side_def a, b; /* its two sides */
} drape_seam_def;

/* A rigid obstacle: a collider with its parameters. Initialise with drape_collider_def_init. */
typedef struct drape_collider_def {
    size_t struct_size;           /* set by drape_collider_def_init */
    drape_entry_def entry;        /* the collider: "plane", "sphere" ... */
    const char *name;             /* NULL: "collider0", "collider1" ... */
    double friction;              /* Coulomb's mu between collider and cloth [1], in [0, 1000]; default 0 */
    const drape_track_key *track; /* displacement of the pivot from the position that the parameters define;
                                     NULL: it stays there */
    size_t key_count;             /* length of track */
    double
        restitution; /* speed of rebound / speed of impact, of cloth on the collider [1], in [0, 1]; default
                           0 */
    const drape_turn_key *turns; /* rotation about the pivot; NULL: it does not turn */
    size_t turn_count;           /* length of turns */
    double pivot[3]; /* [m] the point about which it turns, where the parameters define it; default NaN: the
                        middle of the box around the points of its shape, as the center of a sphere; of a
                        shape without points, a plane, the origin */
    bool enabled;    /* cloth touches it; default true. A collider that is not enabled can still be moved */
} drape_collider_def;

/* An event: a root of a function of the state, which is located within the step in which it lies. Initialise
 * with drape_event_def_init. */
typedef struct drape_event_def {
    size_t struct_size;    /* set by drape_event_def_init */
    drape_entry_def entry; /* the event: "height", "plane", "energy" or "pin_force"; for a function of the
                              host, drape_sim_add_event, its type is NULL */
    const char *name;      /* NULL: "event0", "event1" ...; it has no ";", "@" or control characters */
    const char *cloth;     /* name of the cloth that it is about; NULL: all of them */
    const char *pins;      /* name of the pins that it measures or releases; NULL: all pins of the cloth */
    const char *direction; /* in which the quantity passes its bound: "up", "down" or "both"; NULL: "both" */
    const char *action;    /* "record", "stop" or "release"; NULL: "record" */
    bool once;             /* only the first time counts; default false */
} drape_event_def;

/* The factor of loads over time, which loads name in their parameter "history": linear or cubic between its
 * keys, and constant before the first and after the last one. A cubic (Fritsch & Butland 1984) goes beyond no
 * key: its slope is 0 at both ends and where the factor turns round, and continuous. Initialise with
 * drape_history_def_init. */
typedef struct drape_history_def {
    size_t struct_size;        /* set by drape_history_def_init */
    const char *name;          /* unique; required */
    const double *times;       /* time_count times [s] within 1e9, strictly increasing */
    size_t time_count;         /* length of times, at least 1 */
    const double *values;      /* value_count factors [1] within 1e9 */
    size_t value_count;        /* length of values, that of times */
    const char *interpolation; /* "linear" or "cubic"; NULL: "linear" */
} drape_history_def;

/* A whole scene. Initialise with drape_scene_def_init. Everything it points to need only live until
 * drape_model_create returns. */
typedef struct drape_scene_def {
    size_t struct_size;            /* set by drape_scene_def_init */
    const drape_cloth_def *cloths; /* at least one */
    size_t cloth_count;            /* length of cloths */
    double gravity[3];             /* [m/s2]; default 0 -9.81 0 */
    drape_entry_def integrator;    /* default: "bdf2" at dt 1/60 s or, with colliders or self-contact,
                                   "newton_k" at 1/120 s; with settings but without a type, "be". Settings
                                   of any integrator are accepted, those of other integrators are ignored */
    drape_entry_def controller;    /* default "halving" */
    double duration;               /* [s]; the command-line program requires a value > 0; default 1 */
    double frame_rate;             /* rate of frame events [1/s]; default 60 */
    const char *const *formats;    /* names of the frame formats that `drape run` writes; default: none */
    size_t format_count;           /* length of formats */
    const char *folder;            /* folder against which relative mesh file names are resolved; NULL: the
                                   working directory */
    const drape_collider_def *colliders; /* at most 4096 */
    size_t collider_count;               /* length of colliders */
    const drape_setting *self_contact;   /* thickness, friction, restitution; NULL: the cloth passes through
                                            itself */
    size_t self_contact_count;           /* length of self_contact */
    const drape_setting *contact;        /* distance, stiffness ...; `drape list contact` shows all */
    size_t contact_count;                /* length of contact */
    const char *up; /* axis that points up in frames written by `drape run`: "y" or "z"; NULL: "y" */
    const drape_event_def *events; /* at most 256 */
    size_t event_count;            /* length of events */
    const drape_seam_def *seams;   /* at most 4096; NULL: none */
    size_t seam_count;             /* length of seams */
    const drape_setting *untangle; /* sweeps, gap, on_failure: cloth that begins through itself, other cloth
                                      or colliders is taken apart before the first step; NULL: it is not */
    size_t untangle_count;         /* length of untangle */
    const drape_history_def *histories; /* at most 4096; NULL: none */
    size_t history_count;               /* length of histories */
    const char *gravity_history; /* name of the history that multiplies gravity; NULL: it is constant */
    const char *accuracy; /* of drape_run_accurately: "1mm", or "1e-2" of the diagonal; NULL: none is asked */
} drape_scene_def;

/* Fill a def with the defaults documented above. Pass the caller's sizeof of the def as struct_size. Nothing
 * if def is NULL. */
DRAPE_API void drape_scene_def_init(drape_scene_def *def, size_t struct_size);
DRAPE_API void drape_cloth_def_init(drape_cloth_def *def, size_t struct_size);
DRAPE_API void drape_mesh_def_init(drape_mesh_def *def, size_t struct_size);
DRAPE_API void drape_pin_def_init(drape_pin_def *def, size_t struct_size);
DRAPE_API void drape_mass_def_init(drape_mass_def *def, size_t struct_size);
DRAPE_API void drape_periodic_def_init(drape_periodic_def *def, size_t struct_size);
DRAPE_API void drape_history_def_init(drape_history_def *def, size_t struct_size);
DRAPE_API void drape_event_def_init(drape_event_def *def, size_t struct_size);
DRAPE_API void drape_seam_def_init(drape_seam_def *def, size_t struct_size);
DRAPE_API void drape_collider_def_init(drape_collider_def *def, size_t struct_size);

/* ---- Scene from text ---- */

/* A parsed scene file that can still be changed before it is compiled. */
typedef struct drape_scene drape_scene;

/* Read a scene file, or the text of a scene, for which name stands in messages. Relative mesh file names are
 * resolved against the folder of the scene file or, for a text, the working directory. Only the JSON syntax
 * is checked here; drape_scene_compile checks keys and values, after any changes. Errors: DRAPE_E_FILE,
 * DRAPE_E_PARSE, DRAPE_E_ARGUMENT (a NULL argument), DRAPE_E_MEMORY, DRAPE_E_STOPPED (the context's cancel
 * function); the message has the form "scene.json:LINE:COLUMN: what". */
DRAPE_API drape_status drape_scene_load(drape_context *ctx, const char *path, drape_scene **out);
DRAPE_API drape_status drape_scene_parse(drape_context *ctx, const char *text, const char *name,
                                         drape_scene **out);

/* Sets the value at a JSON pointer ("/integrator/dt") to a JSON text ("0.001", "\"ida\"", "[0,0,0]").
 * Numbers may also be written .5, +5 or 5.; a text that is not JSON is taken as a string, so ida needs no
 * quotes. Missing objects on the path are created. The key "-" appends to an array. If value is NULL, the
 * member or element is removed. Errors: DRAPE_E_ARGUMENT (not a pointer, or one that leads into a number or
 * past the end of an array; nothing to remove), DRAPE_E_MEMORY. */
DRAPE_API drape_status drape_scene_set(drape_scene *scene, const char *pointer, const char *value);

/* Frees a scene. Models compiled from it remain valid. */
DRAPE_API void drape_scene_destroy(drape_scene **scene);

/* ---- Model ---- */

/* A compiled scene: rest geometry, masses, elements, parameters, sparsity. Immutable. */
typedef struct drape_model drape_model;

/* Compile a scene. Errors: DRAPE_E_ARGUMENT, DRAPE_E_PARSE, DRAPE_E_FILE, DRAPE_E_VERSION, DRAPE_E_MEMORY,
 * DRAPE_E_STOPPED (the context's cancel function). The message starts with the place of the fault:
 * "scene.json:LINE:COLUMN: /pointer: what, value, range" for a scene from text, "/pointer: ..." for a scene
 * in memory, where the pointer names the value as it would appear in a file. *out is NULL on failure. */
DRAPE_API drape_status drape_scene_compile(drape_scene *scene, drape_model **out);
DRAPE_API drape_status drape_model_create(drape_context *ctx, const drape_scene_def *def, drape_model **out);
/* Calls drape_scene_load and drape_scene_compile. */
DRAPE_API drape_status drape_model_load(drape_context *ctx, const char *scene_path, drape_model **out);

/* Frees a model. All its sims must have been freed before. */
DRAPE_API void drape_model_destroy(drape_model **model);

/* Sizes; all are 0 for a NULL model. The number of dofs (unknowns) is 3 per free node; nonzeros are counted
 * in the full dofs x dofs Jacobian. */
DRAPE_API int32_t drape_model_node_count(const drape_model *model);
DRAPE_API int32_t drape_model_triangle_count(const drape_model *model);
DRAPE_API int64_t drape_model_dof_count(const drape_model *model);
DRAPE_API int64_t drape_model_nonzero_count(const drape_model *model);

/* Arrays of the model, valid as long as the model: triangles (triangle_count x 3, node numbers of the whole
 * model), rest positions (node_count x 3 [m]), lumped masses (node_count [kg]), pinned flags (node_count, 1:
 * pinned). */
DRAPE_API const int32_t *drape_model_triangles(const drape_model *model);
DRAPE_API const double *drape_model_rest_positions(const drape_model *model);
DRAPE_API const double *drape_model_masses(const drape_model *model);
DRAPE_API const uint8_t *drape_model_pinned(const drape_model *model);

/* A piece of cloth. Each owns a contiguous range of nodes and of triangles, in scene order. */
typedef struct drape_cloth_range {
    const char *name;                       /* as in the scene, or "cloth0", "cloth1" ... */
    int32_t first_node, node_count;         /* its nodes, as node numbers of the model */
    int32_t first_triangle, triangle_count; /* its triangles */
} drape_cloth_range;

/* The number of pieces of cloth, and one of them. An index out of range gives an empty range. */
DRAPE_API int32_t drape_model_cloth_count(const drape_model *model);
DRAPE_API drape_cloth_range drape_model_cloth(const drape_model *model, int32_t index);

/* The mesh that frames show. */
typedef struct drape_render_mesh {
    int32_t vertex_count, triangle_count; /* 0: no such cloth */
    const int32_t *triangles;             /* (triangle_count x 3) 0-based vertices of this mesh */
    const double *rest;                   /* (vertex_count x 3) [m] */
} drape_render_mesh;

/* That of one cloth or, if cloth is -1, of all in their order: the render_mesh of the scene, or the simulated
 * mesh of a cloth without one. Valid until the model is destroyed. Thread-safety: any number of threads at
 * once. */
DRAPE_API drape_render_mesh drape_model_render_mesh(const drape_model *model, int32_t cloth);

/* Writes the positions (vertex_count x 3 [m]) of that mesh for nodes of the model at x with their normals
 * (node_count x 3 each), as drape_sim_positions and drape_sim_normals, or drape_model_normals, return them.
 * Nothing if an argument is NULL or there is no such cloth; nothing is allocated. Thread-safety: any number
 * of threads at once. */
DRAPE_API void drape_model_render_positions(const drape_model *model, int32_t cloth, const double *x,
                                            const double *normals, double *positions);

/* An obstacle and its position at a time t [s]. Obstacles are numbered in scene order. */
typedef struct drape_collider_motion {
    const char *name;       /* as in the scene, or "collider0", "collider1" ... */
    const char *type;       /* name of the collider entry, such as "sphere" */
    double displacement[3]; /* [m] of its pivot from the position that its parameters define */
    double velocity
        [3]; /* [m/s] of its pivot; at a key of a track, that of the piece after the key; 0 at the end of a
                               path given by the host */
} drape_collider_motion;

/* The number of obstacles, and the position of one of them on its track at time t [s]. */
DRAPE_API int32_t drape_model_collider_count(const drape_model *model);
DRAPE_API drape_collider_motion drape_model_collider(const drape_model *model, int32_t index, double t);

/* The strain of each triangle at positions x (node_count x 3 [m]): strain (triangle_count x 2) receives the
 * principal engineering strains [1], lambda - 1 for the principal stretches lambda of the triangle relative
 * to its rest shape, the larger one first. Rest lengths that belong to individual terms are not
 * considered. */
DRAPE_API void drape_model_strain(const drape_model *model, const double *x, double *strain);

/* The scene's duration [s] and frame rate [1/s]. */
DRAPE_API double drape_model_duration(const drape_model *model);
DRAPE_API double drape_model_frame_rate(const drape_model *model);

/* ---- Sim ---- */

/* A running simulation: the state, the integrator, the controller and their workspace. */
typedef struct drape_sim drape_sim;

/* How to run. Initialise with drape_sim_def_init; whatever is left at its default is taken from the scene. */
typedef struct drape_sim_def {
    size_t struct_size;                       /* set by drape_sim_def_init */
    const char *integrator;                   /* name of an integrator; NULL: the scene's */
    const drape_setting *integrator_settings; /* override the scene's settings */
    size_t integrator_setting_count;          /* length of integrator_settings */
    const char *controller;                   /* name of a controller; NULL: the scene's */
    const drape_setting *controller_settings; /* override the scene's settings */
    size_t controller_setting_count;          /* length of controller_settings */
    double dt;                                /* [s]; 0: the scene's */
    double dt_min;                            /* [s]; 0: the scene's */
    double frame_rate;                        /* rate of frame events [1/s]; 0: the scene's */
    int threads; /* threads that evaluate elements, 1 to 256; default 1; results do not depend on it */
    double realtime_step;  /* [s] longest step that drape_sim_advance_realtime takes to keep up, and the most
                             time that may be owed; default 0: four times dt; both are dt where cloth touches
                             or may touch something */
    double teleport_speed; /* [m/s] pins and colliders that drape_sim_move_pins and drape_sim_move_collider
                              send faster are placed where they are sent to, pins with their cloth; default
                              0: never */
} drape_sim_def;

/* Fills *def with the defaults. Pass the caller's sizeof(drape_sim_def) as struct_size. Nothing if def is
 * NULL. */
DRAPE_API void drape_sim_def_init(drape_sim_def *def, size_t struct_size);

/* Creates a sim at t = 0 with the model's rest positions and initial velocities. If def is NULL, the scene's
 * integrator and controller are used. All heap memory of Drape itself is allocated here; no step allocates
 * any, except where contact outgrows its lists, at an event that releases pins, and in drape_sim_change. The
 * messages of the sim go to ctx, which may differ from the model's context. Errors: DRAPE_E_ARGUMENT
 * (unknown entry, or a setting out of range), DRAPE_E_MEMORY, DRAPE_E_SOLVER, DRAPE_E_STOPPED (the context's
 * cancel function). */
DRAPE_API drape_status drape_sim_create(drape_context *ctx, const drape_model *model,
                                        const drape_sim_def *def, drape_sim **out);

/* Frees a sim. */
DRAPE_API void drape_sim_destroy(drape_sim **sim);

/* Advances to t_end [s]. Steps end at t0 + k dt; only the last one is shortened to end at t_end, and a
 * remainder below 1e-9 dt joins the step before it. If t_end is not later than the present time, apart from
 * rounding, nothing happens. After a failure the state is the last accepted one. Errors:
 * DRAPE_E_STEP_TOO_SMALL (the step was halved below dt_min; "ida" took max_steps; max_attempts within one
 * dt), DRAPE_E_SOLVER (a step failed under the controller "fixed"), DRAPE_E_STOPPED (by an observer,
 * drape_sim_cancel or an event, see drape_sim_stopped_by), DRAPE_E_ARGUMENT (t_end not finite, or an event
 * function is not), DRAPE_E_MEMORY. The message names the time, step size, reason and
 * diagnostic. */
DRAPE_API drape_status drape_sim_advance(drape_sim *sim, double t_end);

/* The results of a call of drape_sim_advance_realtime. */
typedef struct drape_realtime {
    double time;    /* [s] simulated time that was reached */
    double debt;    /* [s] simulated time, of this frame and earlier ones, that is owed to the next call; 0:
                       it kept up */
    double dropped; /* [s] simulated time given up in this call because more was owed than is allowed */
    double dropped_total;   /* [s] simulated time given up since the sim was created */
    double seconds;         /* [s] wall-clock time of the call, including its observers */
    bool kept;              /* whether `seconds` is within the budget */
    const char *level;      /* "full", "fewer iterations", or "larger steps" (longer than dt, or
                               time is owed) */
    int effort;             /* of the integrator: 0 as its parameters say; higher values are cheaper */
    int attempts, rejected; /* steps attempted in this call, and how many of them were rejected */
    double h;               /* [s] largest accepted step; 0: none was accepted */
    double residual; /* [N] largest residual of the accepted steps, in the norm of the integrator; NaN: the
                        integrator reports none, no step was accepted, or they were held */
    int32_t relaxed; /* nodes that bodies were let into, as they leave them no room: drape_sim_relaxed */
    double deepest_relaxed; /* [m] the deepest of them: how far inside its collider */
    double error; /* [m] largest drape_attempt.error of the accepted steps; NaN: the integrator estimates
                        none, no step was accepted, or they were held */
    double error_bound; /* [m] see drape_statistics; NaN: the integrator estimates no error */
    bool accurate; /* whether it made a step, held no cloth, no cloth passes through cloth, and `error` is at
                      most that, as far as the integrator estimates one; `relaxed` nodes do not count */
    int64_t inaccurate_total; /* calls since the sim was created that were not accurate */
    int held; /* steps in which the cloth was held where it was, or went with its pins, because none could be
                 made otherwise */
    double behind; /* [s] after time was dropped: bodies are, relative to the pins, about so long before where
                      the host sent them */
    int64_t crossings; /* edges of the cloth that pass through its triangles, with self-contact, where steps
                          were let pass or began so: drape_sim_intersections; 0 where none were */
} drape_realtime;

/* Advances by one frame within a wall-clock budget, for games, previews and anything else that must show a
 * state when it is due. It simulates frame_dt [s], plus what earlier calls left over, in equal steps no
 * longer than dt. If, judging by the time that recent steps took, that will not fit into budget_seconds of
 * wall-clock time, the integrator first reduces its effort (if it supports that, as "newton_k" does); then,
 * unless cloth touches or may touch something, steps become longer, up to realtime_step of the def; then
 * simulated time is left to the next call. A level is given up where it is expected to take more than 0.9 of
 * the budget, and a better one is resumed, one a call, where that is expected to take less than 0.6. The
 * method is that of the def, or else of the scene. Single steps of methods other than "newton_k" may take far
 * longer than a frame.
 *
 * The work of a call is bounded: after its first attempt at a step, accepted or rejected, no other is begun
 * that is not expected to end in time: a rejected step is then retried, at half its size, by the next call.
 * The time owed never exceeds one longest step, in contact dt. Anything beyond that is dropped: simulated
 * time then stays behind the clock for good, but late frames do not delay later ones. Steps follow the
 * frames, so at another frame rate the state differs only by the integrator's error in h. A later
 * drape_sim_advance continues with the scene's own steps. Levels and further iterations depend on the clock,
 * so two runs may differ; they do not if the budget is so large that it never cuts an iteration.
 *
 * *report, unless NULL, is filled whatever the status. Integrators and controllers that choose their own
 * steps continue to do so, within the bound. A step that cannot be made is no error: the cloth is held
 * instead (drape_realtime.held), unless the scene's no_room is "stop", the integrator chooses its own steps,
 * a pin makes an element degenerate, or the controller allows fewer than 24 attempts within one dt. Errors:
 * as drape_sim_advance; DRAPE_E_ARGUMENT (frame_dt not in (0, 1e6], budget not in [0, 1e9], or an integrator
 * that does not integrate in time). */
DRAPE_API drape_status drape_sim_advance_realtime(drape_sim *sim, double frame_dt, double budget_seconds,
                                                  drape_realtime *report);

/* Puts the sim into a user-defined state, from which the next advance starts: time [s], 0 to 1e9, before or
 * after the present one; positions [m] and velocities [m/s], node_count x 3 each, which are copied. Pinned
 * nodes must lie where their pins are at t, to within 1e-9 of the size of the scene, and are put there
 * exactly; nodes that drape_sim_move_pins has moved rest where x has them. Velocities of fixed pins become 0,
 * as do those along directions in which pins at rest hold nodes; those of moving pins are kept until a step
 * replaces them by the mean velocity of the track. Internal variables follow from the positions: a hinge
 * angle is taken on the branch nearest to its present value.
 *
 * The integrator and the controller start anew, as after a kink; steps are counted from t, and the energies
 * dissipated and numerical from 0; the check that energy does not come out of nothing still knows what was
 * available to the run before. Frames continue with the first one at or after t or, if t is the present
 * time, with the next one that was not reported. Statistics continue. Positions and velocities that come from
 * a sim of the same model at the same time are restored bit for bit, so a one-step integrator continues from
 * them exactly as that sim did, provided that k dt has no rounding error.
 *
 * Nothing is allocated, and elements are not checked: a state with a degenerate element is a start that steps
 * may lead out of. Must not be called by an observer. Errors: DRAPE_E_ARGUMENT (NULL, not finite, or a pinned
 * node elsewhere); the sim is then unchanged. Thread-safety: as the sim. */
DRAPE_API drape_status drape_sim_set_state(drape_sim *sim, double t, const double *x, const double *v);

/* What drape_sim_place moves, and how: x becomes R (x - center) + center + translate. Initialise with
 * drape_place_def_init, which chooses all cloths and colliders, and no motion. */
typedef struct drape_place_def {
    size_t struct_size;       /* set by drape_place_def_init */
    double rotate[4];         /* R: axis x y z and angle [degrees]; default: no rotation */
    double center[3];         /* [m] the point that R leaves where it is; default 0 */
    double translate[3];      /* [m]; default 0 */
    const int32_t *cloths;    /* cloth_count numbers of cloths, which take their pins along, but see
                                 drape_sim_attach */
    int32_t cloth_count;      /* length of cloths; default -1: all cloths */
    const int32_t *colliders; /* collider_count numbers of colliders */
    int32_t collider_count;   /* length of colliders; default -1: all colliders */
    bool stop; /* the cloth is at rest afterwards; default false: its velocities turn with it */
} drape_place_def;

/* Fills *def with the defaults. Pass the caller's sizeof(drape_place_def) as struct_size. Nothing if def is
 * NULL. */
DRAPE_API void drape_place_def_init(drape_place_def *def, size_t struct_size);

/* Places cloth with its pins, and colliders, elsewhere at the present time, by a rigid motion: a character
 * that is put at another place, a world that is shifted back to the origin. No force comes from it: strains,
 * elastic energy and internal variables stay as they are, to rounding; nothing between is swept. Tracks of
 * pins and colliders, and paths that the host has set, are moved as a whole and go on from there; so is the
 * spring of drape_sim_set_drag_spring. Gravity, the wind and drape_sim_push stay, so a rotation about another
 * axis than that of gravity changes how the cloth hangs. The energy account takes the change of potential
 * and kinetic energy as given by the host.
 *
 * Contact is not checked. Where cloth and colliders move together their contacts stay as they were. Cloth
 * that is placed into a collider, or a collider into cloth, is like cloth that starts there: it is pushed out
 * gently over the next steps, and drape_sim_inside counts it. Cloth that is placed across other cloth stays
 * entangled.
 *
 * Integrators and controllers start anew, as after drape_sim_set_state; the time, the steps of the schedule,
 * frames, statistics, a budget's debt and the energies dissipated and numerical go on. Arrays that the sim
 * returned before are no longer valid. No memory is allocated unless contact needs more. Must not be called
 * by an observer. Errors, after which nothing has changed: DRAPE_E_ARGUMENT (NULL, not finite or beyond 1e9
 * m, an axis of length 0, no such cloth or collider), DRAPE_E_VERSION
 * (struct_size). Thread-safety: as the sim. */
DRAPE_API drape_status drape_sim_place(drape_sim *sim, const drape_place_def *def);

/* How drape_sim_untangle works. Initialise with drape_untangle_def_init. */
typedef struct drape_untangle_def {
    size_t struct_size; /* set by drape_untangle_def_init */
    int sweeps;         /* searches for what passes through what, at most; default 400 */
    double gap;         /* gap that layers and colliders are to have afterwards, in activation distances of
                           contact, in [0.01, 1]; default 1: contact begins without forces */
    bool keep; /* if it does not come apart, the sim gets the positions with the fewest intersections of those
                  that have not more pairs or triangles in colliders than the present ones, edges strained by
                  a quarter at most, and finite energies; default false: it stays as it is */
} drape_untangle_def;

/* Fills *def with the defaults. Pass the caller's sizeof(drape_untangle_def) as struct_size. Nothing if def
 * is NULL. */
DRAPE_API void drape_untangle_def_init(drape_untangle_def *def, size_t struct_size);

/* What an untangling found and did. */
typedef struct drape_untangling {
    bool clear;              /* nothing passes through anything, and all gaps are those of contact */
    double time;             /* [s] the time of the sim at which it was made */
    int sweeps;              /* searches after which something was moved */
    int64_t pairs_before;    /* edges that passed through triangles, of cloth and of colliders */
    int64_t pairs;           /* afterwards */
    int32_t inside_before;   /* triangles of cloth that reached into colliders, as drape_sim_inside counts */
    int32_t inside;          /* afterwards */
    double least_gap_before; /* smallest gap, in the least gaps of contact; infinite: none is near */
    double least_gap;        /* afterwards */
    double displacement;     /* [m] the largest displacement of a node */
    int32_t node;            /* the node of that displacement; -1: none moved */
    int32_t cloths;          /* number of cloths that were moved, by a node at least */
    double strain;           /* largest change of the length of an edge [1] */
    double seconds;          /* [s] wall-clock time that it took */
} drape_untangling;

/* Takes cloth apart that passes through itself, through other cloth or through colliders at the present
 * time, as a scene with "untangle" does before its first step. Free nodes move, as little as is found, with
 * hardly any strain; pinned nodes and colliders stay, and so do all velocities. Pairs that `ignore` of the
 * scene lets through are left alone; without self_contact, only colliders count. If nothing passes through
 * anything and all gaps are those of contact, not a bit changes. Otherwise integrators start anew and the
 * energy account takes the change of energy as given by the host, as after drape_sim_place. The result does
 * not depend on threads or on the processor.
 *
 * def: NULL for the defaults, or the scene's values if it has "untangle". *report, unless NULL, is filled
 * whatever the status, but for arguments that are refused. What remains if it does not come apart is counted
 * exactly, and then DRAPE_E_SOLVER is returned, also with `keep`: the message names the first pair. A scene
 * whose cloth intersects at rest needs "untangle" for contact between the pieces that do
 * (docs/untangling.md). It takes memory, mostly for the pairs that are near, and frees it. Must not be called
 * by an observer. Errors, after which nothing has changed unless `keep` is set: DRAPE_E_ARGUMENT (a value
 * that is not allowed), DRAPE_E_VERSION (struct_size), DRAPE_E_SOLVER, DRAPE_E_STOPPED (drape_sim_cancel, or
 * the context's cancel function), DRAPE_E_MEMORY. Thread-safety: as the sim. */
DRAPE_API drape_status drape_sim_untangle(drape_sim *sim, const drape_untangle_def *def,
                                          drape_untangling *report);

/* Fills *out with the report of the last untangling of a sim, by its scene or its host, and moved
 * (cloth_count), unless NULL, with the largest displacement of a node of each cloth in it [m]. Returns false
 * if there was none. Checkpoints keep it. Thread-safety: as the sim. */
DRAPE_API bool drape_sim_untangling(const drape_sim *sim, drape_untangling *out, double *moved);

/* Lets a sim go on with another model of the same cloth: another gravity, material, other terms and their
 * parameters, masses, friction, thickness, colliders, pins, events. The cloths must be as many, and their
 * meshes have the same nodes and triangles; rest positions may differ.
 *
 * drape_sim_change compiles the scene, whose values the host has changed by drape_scene_set, and keeps that
 * model until the next change; the scene stays the host's. drape_sim_change_model takes a model that the
 * host has compiled, and that must outlive the sim or its next change. The former model may then be freed.
 *
 * What goes on: time, positions and velocities to the bit; the internal variables of a term that the new
 * model has, too, on the same cloth; the motion and placement of pins and colliders, and which pairs of
 * contact are inside or relaxed: colliders and events are the same if their names are. So do the drag
 * springs, drape_sim_push, the wind, observers, frames, statistics and the energy account, which takes the
 * change of the energies as given by the host. Integrator, controller, steps, frame rate and threads are
 * those of the sim, whatever the scene says. Integrators and controllers start anew, as after
 * drape_sim_place; an event whose quantity the change takes past its bound has no root there.
 *
 * A collider whose pivot changes stays where it is, with its velocities, and goes on turning about the new
 * pivot; the pose that it has been sent to stays the same, too. A pivot that no scene gives is the middle of
 * the shape and moves with it.
 *
 * A node that becomes free goes on with the velocity of its pin. One that becomes pinned is held where it is
 * until drape_sim_move_pins moves it, unless the model has a track for it that leads through there; one that
 * was pinned already may get another track only if that leads through where it is. Nodes that drape_sim_pin,
 * drape_sim_unpin or an event made differ from the model stay so. Contact is not checked: cloth that is in a
 * collider afterwards is pushed out gently, as at the start of a run.
 *
 * A checkpoint that is written afterwards belongs to the new model. The sim is built anew beside the present
 * one, which takes memory for both and about as long as drape_scene_compile and drape_sim_create
 * (docs/embedding.md has figures). Arrays and models that the sim returned before are no longer valid. Must
 * not be called by an observer. Errors, after which nothing has changed: DRAPE_E_ARGUMENT (NULL, other
 * meshes, a track that begins elsewhere), those of drape_scene_compile, DRAPE_E_MEMORY, DRAPE_E_SOLVER,
 * DRAPE_E_STOPPED (the context's cancel function). Thread-safety: as the sim. */
DRAPE_API drape_status drape_sim_change(drape_sim *sim, drape_scene *scene);
DRAPE_API drape_status drape_sim_change_model(drape_sim *sim, const drape_model *model);

/* Pins nodes where they are, or lets them go, as drape_sim_change does with a model that has other pins;
 * count numbers of nodes of the sim. Nodes that are so already are left alone; if all are, nothing happens.
 * Nodes that a "normal" or an "axis" holds are free in this sense: drape_sim_unpin leaves them held.
 * A drag spring of a node that becomes pinned is removed. Otherwise the sim goes on with a model of its own,
 * which shares all but the numbers of unknowns and the sparsity with the one that was compiled. Checkpoints
 * keep these pins. Must not be called by an observer.
 * Errors, after which nothing has changed: DRAPE_E_ARGUMENT (no such node), DRAPE_E_MEMORY, DRAPE_E_SOLVER,
 * DRAPE_E_STOPPED. Thread-safety: as the sim. */
DRAPE_API drape_status drape_sim_pin(drape_sim *sim, int32_t count, const int32_t *nodes);
DRAPE_API drape_status drape_sim_unpin(drape_sim *sim, int32_t count, const int32_t *nodes);

/* Gives count nodes of the sim other masses [kg], each in (0, 1e12], as drape_sim_change does with a model
 * that has them: inertia, weight, the center of mass of events and the derived stiffness of contact follow.
 * Velocities stay, so momentum and kinetic energy change with the mass; the energy account takes that as
 * given by the host. A node that is listed twice gets the later one. A stiffness that a term derived from
 * masses when the scene was compiled, as limit.strain can, stays until drape_sim_change. The masses stay
 * through drape_sim_change where they differ from those of the model before. drape_model_masses of
 * drape_sim_model has the present ones. Checkpoints keep them. Must not be called by an observer. Errors,
 * after which nothing has changed: DRAPE_E_ARGUMENT (no such node, a mass out of range), DRAPE_E_MEMORY,
 * DRAPE_E_SOLVER, DRAPE_E_STOPPED. Thread-safety: as the sim. */
DRAPE_API drape_status drape_sim_set_masses(drape_sim *sim, int32_t count, const int32_t *nodes,
                                            const double *masses);

/* Nodes that a collider carries from now on, from where they are: pins that ride on a body which a track
 * or a host moves, turns or deforms. On a rigid collider a node keeps its place in the collider's own
 * coordinates. On one of the type animated_mesh it stays on a triangle: at the barycentric weights of its
 * projection onto the triangle's plane and at its offset along the triangle's normal, both of which are
 * kept; triangles (count) gives the triangles in the order of the file, NULL: the nearest one of each
 * node. A node beside its triangle is carried by the plane. At any time within a step, and in any frame,
 * the nodes are where the collider's motion has them, with its velocity there (after a step of "be",
 * "newton_k", "bdf2" or "midpoint" its mean over the step); kinks of its motion are theirs. They touch
 * nothing that is pinned, as other pins do not; cloth around them touches the collider, so it is best to
 * attach nodes outside of it by the contact distance or more, or to let the cloth `ignore` it.
 *
 * Free nodes are pinned, as by drape_sim_pin, which removes their drag springs; all others stay pinned, and
 * leave their track, path or collider. drape_sim_detach lets nodes go with the velocity of their collider,
 * as drape_sim_unpin does; they must be carried by one. drape_sim_move_pins takes a node off its collider,
 * too. drape_sim_attached returns the collider that carries a node; -1: none, or no such node.
 *
 * drape_sim_place: nodes whose cloth is placed together with the collider stay where they are on it. If
 * one is placed without the other, they stay where they are in the cloth and ride on from there. A
 * collider that is placed because it is sent faster than teleport_speed takes the cloth that rides on it
 * along: as it goes itself, or, if the cloth has other pins, too, by the rigid motion that fits all of its
 * pins best. A collider that is not enabled goes on carrying. drape_sim_change: nodes go on riding on the
 * collider of the same name, from where they are; those that the scene attached, where the new scene does.
 * If there is no such collider, they are held where they are. drape_sim_set_state: they must be where the
 * collider has them at t.
 *
 * Attaching nodes that are pinned already allocates nothing unless contact needs more, or the nearest
 * triangles of a collider that deforms are to be found; otherwise both take what drape_sim_pin takes.
 * Checkpoints keep what is attached. Must not be called by an observer. Errors, after which nothing has
 * changed: those of drape_sim_pin; DRAPE_E_ARGUMENT (no such collider, node or triangle; triangles of a
 * collider that is rigid; a node to detach that no collider carries). Thread-safety: as the sim. */
DRAPE_API drape_status drape_sim_attach(drape_sim *sim, int32_t collider, int32_t count, const int32_t *nodes,
                                        const int32_t *triangles);
DRAPE_API drape_status drape_sim_detach(drape_sim *sim, int32_t count, const int32_t *nodes);
DRAPE_API int32_t drape_sim_attached(const drape_sim *sim, int32_t node);

/* Pulls a free node towards target [m] by a spring of the given stiffness [N/m]. The force stiffness (target
 * - x) is part of the equations of every step from the next one on, and implicit if the integrator is. A
 * call replaces the springs of the calls before; stiffness 0 removes them. The spring's energy counts as
 * elastic, and the work of moving its target counts as that of a pin. Integrators start anew. Nothing is
 * allocated. Must not be called by an observer. Errors: DRAPE_E_ARGUMENT (no such node, a pinned node, or a
 * stiffness that is negative or not finite); the sim is then unchanged. Thread-safety: as the sim. */
DRAPE_API drape_status drape_sim_set_drag_spring(drape_sim *sim, int32_t node, double stiffness,
                                                 const double target[3]);

/* The same with several springs at once, up to 64, also with several on one node: nodes and stiffness have
 * count numbers, targets has count x 3. They replace all springs of the calls before; count 0 removes
 * them. */
DRAPE_API drape_status drape_sim_set_drag_springs(drape_sim *sim, int32_t count, const int32_t *nodes,
                                                  const double *stiffness, const double *targets);

/* The force of that spring on its node in the present state, or the sum of those of several [N]; 0 if there
 * is none. */
DRAPE_API void drape_sim_drag_spring_force(const drape_sim *sim, double force[3]);

/* Makes the running advance, or else the next one, return DRAPE_E_STOPPED with the last accepted state:
 * before its next step, or at the next evaluation of forces within a step, which is then rolled back and
 * counted as rejected ("cancelled"). A later advance continues from there. Thread-safety: may be called from
 * any thread and from a signal handler, as long as the sim lives. NULL is allowed. */
DRAPE_API void drape_sim_cancel(drape_sim *sim);

/* ---- Sim: what a host moves ----
 *
 * For a host that moves pins and colliders itself, frame by frame: it sets where they are to be at the end of
 * the frame, advances by the frame, and sets the next positions. None of these functions allocates memory,
 * apart from the copy of points that drape_sim_deform_collider checks, or may be called by an observer, and
 * after an error nothing has changed. Thread-safety: as the sim. */

/* Moves pinned nodes, whether fixed or on tracks, along user-defined paths. In the next `seconds` of
 * simulated time node nodes[i] moves from its present position to positions[3 i ...] [m]; there it rests
 * unless another call moves it on. velocities (count x 3 [m/s]) gives the velocity on arrival: the path is
 * then a cubic from the present position and velocity, so that calls from frame to frame give a smooth
 * motion. With velocities NULL the path is straight, at constant speed. A node that was moved once stays
 * under the host's control: its track no longer applies, and drape_sim_set_state leaves it where the state
 * has it, at rest.
 *
 * Before drape_sim_advance_realtime, seconds is the frame plus what is owed: frame_dt + drape_realtime.debt.
 * After simulated time was dropped, the path is made faster than it was sent by no more than half, and pins
 * that go in much the same direction take the cloth along for that time: drape_realtime.behind.
 *
 * The integrator knows the whole path: within any step, and in any frame, pins are exactly on it. A jump in
 * velocity is a kink, at which "ida" starts anew. A node that is listed twice is not detected.
 *
 * Pins that would have to be faster than the def's teleport_speed carry their cloth along instead of tearing
 * at it: it is first placed, as by drape_sim_place, by the rigid motion that fits all of its pins best, less
 * the path that they cover in `seconds` at their velocity: the given one, or else that of their motion so
 * far. From there they move to their positions as usual. The motion of tracks is never taken so. The log has
 * a line for each. Errors:
 * DRAPE_E_ARGUMENT (no such node, a free node, seconds not in (0, 1e9], or a value that is not finite or
 * beyond 1e9 m or m/s). */
DRAPE_API drape_status drape_sim_move_pins(drape_sim *sim, int32_t count, const int32_t *nodes,
                                           double seconds, const double *positions, const double *velocities);

/* The same for a whole collider: moves it to a displacement [m] from the position that its parameters
 * define, turned as it is now; a collider that turned stops turning. One that would have to be faster than
 * teleport_speed is placed there, less the path and the turn at its velocities on arrival: the given ones, or
 * else those that it has; its speed is that of its pivot plus that of the farthest point of its shape about
 * it. drape_sim_collider returns its present position. */
DRAPE_API drape_status drape_sim_move_collider(drape_sim *sim, int32_t collider, double seconds,
                                               const double displacement[3], const double *velocity);

/* The same for a collider that also turns: in the next `seconds` its pivot (drape_collider_def) moves to a
 * displacement, and it turns about the pivot by the shortest turn to a rotation from the direction that
 * its parameters define: a quaternion w x y z of length 1. velocity [m/s] and angular_velocity [rad/s] are
 * those on arrival, both in space and about the pivot: displacement and rotation then are smooth, and
 * continue the motion before. If both are NULL, it moves and turns at constant speed. The rotation is
 * interpolated by a cubic of the rotation vector from the present one. Errors: as drape_sim_move_collider;
 * DRAPE_E_ARGUMENT also if the rotation is NULL or not of length 0.99 to 1.01, one velocity is given alone,
 * an angular velocity is not finite or beyond 1e4 rad/s, or the turn would need more and is not placed. */
DRAPE_API drape_status drape_sim_move_collider_pose(drape_sim *sim, int32_t collider, double seconds,
                                                    const double displacement[3], const double rotation[4],
                                                    const double *velocity, const double *angular_velocity);

/* Sends the points of a collider of the type animated_mesh, in place of its frames: to positions (points x
 * 3 [m], in the order of its file) in `seconds` [s] from now, with velocities (points x 3 [m/s]) there.
 * Each moves on a cubic that begins where it is now, with the velocity that it has, as drape_sim_move_pins
 * moves a pin; velocities NULL: straight, at constant speed. Then they rest until they are sent again.
 * Coordinates are the collider's own, which are those of space unless it is moved or turned as a whole,
 * too. The arrays are copied. Points are never placed elsewhere (teleport_speed). Errors: DRAPE_E_ARGUMENT
 * (no such collider, one that is rigid, another number of points, seconds not in (0, 1e9], a value that is
 * not finite or beyond 1e9 m or m/s, a triangle with an altitude below 1e-12 of its longest edge, or a closed
 * mesh whose volume is not positive). */
DRAPE_API drape_status drape_sim_deform_collider(drape_sim *sim, int32_t collider, double seconds,
                                                 int32_t points, const double *positions,
                                                 const double *velocities);

/* The number of points of a collider that deforms; 0 for a rigid one, -1 without one. */
DRAPE_API int32_t drape_model_collider_points(const drape_model *model, int32_t collider);

/* Writes where the points of a collider that deforms are in space now [m], and, unless NULL, how fast they
 * move [m/s]: (points x 3) each; at a frame, those towards the next one. An observer may call it. Errors:
 * DRAPE_E_ARGUMENT. */
DRAPE_API drape_status drape_sim_collider_points(drape_sim *sim, int32_t collider, double *positions,
                                                 double *velocities);

/* Pushes nodes: forces (node_count x 3 [N], copied) act from the next step on, regardless of the motion of
 * the nodes, until they are replaced. NULL: no forces. A force on a pinned node is taken up by its pin. The
 * work of the forces counts as that of pins. "ida" starts anew. Errors: DRAPE_E_ARGUMENT (not finite). */
DRAPE_API drape_status drape_sim_push(drape_sim *sim, const double *forces);

/* Computes the velocity of the medium at time t [s] at count points: wind (count x 3 [m/s]) at x (count x 3
 * [m]). gradient, unless NULL, receives dwind_i/dx_j at [9 p + 3 i + j] [1/s]. Both outputs are filled with
 * zeros before the call. Leaving gradient at zero costs convergence, not accuracy, as Newton's matrix then
 * lacks that part. The function is called several times per step within drape_sim_advance, on its thread,
 * also at trial states: the same t and x must give the same wind, and within one advance the wind should be
 * smooth in t. */
typedef void drape_wind_field(void *user, double t, int32_t count, const double *x, double *wind,
                              double *gradient);

/* Sets the velocity of the medium for "drag.wind" and "air.added_mass" (added to their own wind),
 * "drag.viscous", and user-defined terms with in_medium. If field is NULL, the medium is at rest again.
 * Errors: DRAPE_E_ARGUMENT (no term of the model is in a medium). */
DRAPE_API drape_status drape_sim_set_wind(drape_sim *sim, drape_wind_field *field, void *user);

/* ---- Sim: what can be read ---- */

/* The last accepted state: time [s], positions [m] and velocities [m/s], node_count x 3 each; valid until the
 * next call that changes the sim. drape_sim_model returns the model that the sim was created with or, after
 * pins or masses have changed, a model of the sim with these, valid until the next such change. */
DRAPE_API double drape_sim_time(const drape_sim *sim);
DRAPE_API const double *drape_sim_positions(const drape_sim *sim);
DRAPE_API const double *drape_sim_velocities(const drape_sim *sim);
DRAPE_API const drape_model *drape_sim_model(const drape_sim *sim);

/* A 64-bit hash of the time, positions, velocities and internal variables of the last accepted state, and of
 * nothing else. */
DRAPE_API uint64_t drape_sim_hash(const drape_sim *sim);

/* Counts the triangles of the cloth that reach into a collider: one of 28 points of the triangle is deeper
 * than 1e-9 m, an edge of the collider passes through it, or one of its sides passes through a triangle of
 * the collider. collider is its number in the scene, from 0. *deepest, if not NULL, receives the largest
 * depth [m] that was found. Returns -1 if there is no such collider, memory is out, or it was cancelled. */
DRAPE_API int32_t drape_sim_inside(const drape_sim *sim, int32_t collider, double *deepest);

/* A node of cloth that bodies leave no room: a collider whose surface does not hold it for the time being. */
typedef struct drape_relaxed {
    int32_t collider; /* its number in the scene, from 0; -1: pinned pieces of cloth */
    const char *name; /* of the collider, "self_contact" for -1; valid as long as the model */
    int32_t node;     /* of all cloths, from 0 */
    double depth;   /* [m] how far it, or the cloth around it, was inside at the beginning of the last step; 0
                         if it was outside, and for pinned pieces of cloth, which have no inside */
    double deepest; /* [m] the largest depth since it was relaxed */
    double since;   /* [s] the time at which it was relaxed */
} drape_relaxed;

/* The nodes that are relaxed: where two bodies close upon cloth, pins lie in a body, or cloth is held back
 * by what a body presses on, steps have no solution in which nothing passes through anything. With the
 * scene's contact/no_room "relax", and with "auto" in drape_sim_advance_realtime, the surfaces that have
 * no room for the cloth then let it in, at some nodes and the faces around them, and push it out by a
 * bounded pressure; the rest of the cloth goes on as before. Nodes are held again once they have room and
 * are out. drape_sim_inside counts what is inside meanwhile.
 *
 * Returns their number and, if index is from 0 to below that, fills *out unless it is NULL; they are
 * ordered by collider and node. 0 for a sim without contact. Not during an advance from another thread. */
DRAPE_API int32_t drape_sim_relaxed(const drape_sim *sim, int32_t index, drape_relaxed *out);

/* Counts the pairs of an edge and a triangle that pass through each other, with exact signs: of the cloth
 * and a collider, of which either may have the edge, or of the cloth itself if collider is -1. Edges that
 * only touch, and pairs that share a node, do not count. Returns -1 if there is no such collider, memory is
 * out, or the context's cancel function asked to stop. */
DRAPE_API int64_t drape_sim_intersections(const drape_sim *sim, int32_t collider);

/* ---- Sim: queries ---- */

/* What a query looks for; the sum of both for both. */
enum { DRAPE_QUERY_CLOTH = 1, DRAPE_QUERY_COLLIDERS = 2 };

/* A place on cloth or on a collider. */
typedef struct drape_hit {
    bool found;       /* if not, nothing else is set */
    int32_t collider; /* its number; -1: cloth */
    int32_t triangle; /* of cloth, its number in the model; -1: a collider */
    double distance;  /* [m] from the point, negative inside a collider; of a ray, along it from its origin */
    double point[3];  /* [m] */
    double normal[3]; /* [1] of the triangle, counterclockwise; of the collider, outward */
    double weights[3]; /* [1] of the corners of the triangle in the point; 0 at a collider */
} drape_hit;

/* The nearest place to each of count points (count x 3 [m]) within a distance [m], which may be INFINITY, in
 * the last accepted state; of equally near ones the triangle of the lowest number, and cloth before
 * colliders. what: DRAPE_QUERY_CLOTH, DRAPE_QUERY_COLLIDERS or their sum. The place on a collider is the
 * point less its signed distance along its normal.
 *
 * drape_sim_cast: the first place that each of count rays meets, from its origin [m] along its direction, of
 * any length but 0, up to `length` [m]; triangles are met from both sides. A ray that begins in a collider
 * meets it at its origin. Colliders are met to 1e-9 m; a ray that is inside a collider for less than 1e-4 of
 * `length` may miss it. Colliders that all cloths pass through, as those that are not enabled, are not met.
 *
 * Each call refits a tree of boxes over the triangles, and takes memory for it at the first one; then a
 * point takes about the logarithm of their number. For a collider that deforms it makes a tree of its own.
 * Errors: DRAPE_E_ARGUMENT (NULL, what, a value that is not finite, a direction of length 0, within or length
 * not above 0), DRAPE_E_MEMORY. An observer may call them. Thread-safety: as the sim. */
DRAPE_API drape_status drape_sim_closest(drape_sim *sim, int what, int32_t count, const double *points,
                                         double within, drape_hit *hits);
DRAPE_API drape_status drape_sim_cast(drape_sim *sim, int what, int32_t count, const double *origins,
                                      const double *directions, double length, drape_hit *hits);

/* One contact of cloth with a collider, or of a piece of cloth with another: a node and a face, two edges, or
 * parts of these. */
typedef struct drape_contact_point {
    int32_t collider; /* its number; -1: cloth with cloth */
    int32_t nodes[4]; /* of the cloth; -1: none */
    double
        weights[4];   /* of the nodes in the point; negative on the second piece of cloth, whose closest point
                            is minus their sum */
    double point[3];  /* [m] of the cloth, or of the first of two pieces */
    double normal[3]; /* [1] from the collider, or the second piece, to the first one */
    double gap;       /* [m] between their surfaces */
    double force[3];  /* [N] on the first one: normal force and friction */
    double normal_force; /* [N] its part along the normal */
} drape_contact_point;

/* Lists the contacts in the last accepted state, up to `room` of them, and sets *count to their number,
 * which may be larger; room may be 0 and contacts then NULL. Their forces add up to those of
 * drape_sim_contact_forces and, with the other sign, of drape_sim_collider_force, whose remarks apply. A
 * force acts on the nodes by their weights, except between nearly parallel edges. With lagged friction, the
 * friction of a contact at the beginning of the last step is an entry of its own, with its gap and without
 * normal force. The forces of nodes that a collider carries are not among them. Errors: DRAPE_E_ARGUMENT
 * (NULL, room < 0, an integrator without contact forces), DRAPE_E_MEMORY. Thread-safety: as the sim. */
DRAPE_API drape_status drape_sim_contacts(drape_sim *sim, int32_t room, drape_contact_point *contacts,
                                          int32_t *count);

/* A mesh for rendering that the cloth carries: each of its vertices is fixed to the nearest triangle at
 * rest, at the same weights of its corners and the same height above it as there, so at rest it is where it
 * was given, and turns and shifts with the cloth. Vertices that are above a triangle by less than the radius
 * of curvature of a fold stay on their side of it. */
typedef struct drape_embedding drape_embedding;

/* Fixes count vertices (count x 3 [m], where the cloth is at rest) with their normals (count x 3; NULL:
 * none) to one cloth of a model, or to all if cloth is -1. Everything is copied: the model need not outlive
 * it. Errors: DRAPE_E_ARGUMENT (NULL, no such cloth, not finite), DRAPE_E_MEMORY; then *out is NULL.
 * Thread-safety: as the context. */
DRAPE_API drape_status drape_embedding_create(drape_context *ctx, const drape_model *model, int32_t cloth,
                                              int32_t count, const float *vertices, const float *normals,
                                              drape_embedding **out);

/* Writes the vertices (count x 3 [m]) and, unless NULL or none were given, the normals of length 1 (count x
 * 3) for the nodes at x (node_count x 3 [m]). Nothing is allocated. Thread-safety: any number of threads at
 * once. */
DRAPE_API void drape_embedding_carry(const drape_embedding *embedding, const double *x, float *vertices,
                                     float *normals);

/* Frees *embedding and sets it to NULL; NULL, or a pointer to NULL, does nothing. */
DRAPE_API void drape_embedding_destroy(drape_embedding **embedding);

/* ---- Sim: normals, forces and energies ---- */

/* Normals of the nodes (node_count x 3 [1]): the area-weighted mean over the triangles around a node,
 * normalised, with the side outside from which the triangles are counterclockwise; 0 where the mean vanishes.
 * drape_sim_normals: in the last accepted state; drape_model_normals: at positions x (node_count x 3 [m]). */
DRAPE_API void drape_sim_normals(const drape_sim *sim, double *normals);
DRAPE_API void drape_model_normals(const drape_model *model, const double *x, double *normals);

/* Forces in the last accepted state, written to arrays of the caller (node_count x 3 [N]).
 *
 * drape_sim_reactions: the forces of pins on pinned nodes, 0 on free ones. A reaction is the force that keeps
 * a node on its path against cloth, gravity, contact and push, excluding the force that accelerates the
 * node's own mass. Damping laws that take rates from a step use the present velocities here.
 *
 * drape_sim_contact_forces: contact and friction on every node, with colliders and between layers of
 * cloth. drape_sim_collider_force: the total force of the cloth on one collider: contact and friction, and
 * the reactions of the nodes that it carries (drape_sim_attach) with the other sign. These have the weight of
 * the nodes, drape_sim_push and the wind on them, and what else touches them, but not the force that
 * accelerates their masses: a body that is moved by this force has these masses, too.
 * drape_sim_collider_torque: the torque [N m] of these forces about a point of space [m] or, if that is
 * NULL, about the pivot of the collider (3), where it is now. Colliders have the mean velocity of the last
 * step, so call these before moving them on. Under "newton_k", which does not bring the residual of a step
 * to zero, all of these forces are far off (docs/integrators.md). An integrator that resolves contact by
 * moving nodes ("verlet") has no such forces and returns an error.
 *
 * An observer may read them, too, which leaves no trace in the run: they are those of the last accepted
 * state, in a frame those at the end of the step that it lies in, at an event that releases pins those
 * before. Errors: DRAPE_E_ARGUMENT, DRAPE_E_MEMORY. Thread-safety: as the sim. */
DRAPE_API drape_status drape_sim_reactions(drape_sim *sim, double *forces);
DRAPE_API drape_status drape_sim_contact_forces(drape_sim *sim, double *forces);
DRAPE_API drape_status drape_sim_collider_force(drape_sim *sim, int32_t collider, double force[3]);
DRAPE_API drape_status drape_sim_collider_torque(drape_sim *sim, int32_t collider, const double *about,
                                                 double torque[3]);

/* A seam in the last accepted state. */
typedef struct drape_seam_report {
    const char *name;         /* as in the scene, or "seam0", "seam1" ...; valid as long as the model */
    const char *type;         /* name of its entry, such as "stitch" */
    int32_t cloth[2];         /* numbers of the cloths of its sides a and b */
    int32_t pairs;            /* how many pairs of nodes it joins */
    double gap_mean, gap_max; /* [m] distance of joined nodes, over the pairs */
    double force[3];          /* [N] of the seam on the nodes of side a: what it carries */
    double tension;           /* [N] the sum of the magnitudes of the forces on these nodes */
    double tension_max;       /* [N] the largest one */
    int32_t node;             /* where it is largest: number in the model of the node of side a */
} drape_seam_report;

/* The number of seams and, if out is not NULL and index is that of a seam in scene order, its report. The
 * forces are conservative ones and those that depend on velocities. A node that is in both sides of a seam
 * counts with the sum of the forces on it. An observer may call it. Thread-safety: as the sim. */
DRAPE_API int32_t drape_sim_seam(drape_sim *sim, int32_t index, drape_seam_report *out);

/* The position of a collider in the last accepted state, as drape_model_collider, but including moves by the
 * host: the displacement and the velocity of its pivot. */
DRAPE_API drape_collider_motion drape_sim_collider(const drape_sim *sim, int32_t collider);

/* Its rotation about the pivot then, a quaternion w x y z of length 1 with w >= 0, its angular velocity
 * [rad/s], and where its pivot is [m]; each may be NULL. A point X where the parameters define it is at
 * pivot + rotation (X - pivot of the def). Returns false, and writes nothing, if there is no such
 * collider. */
DRAPE_API bool drape_sim_collider_rotation(const drape_sim *sim, int32_t collider, double rotation[4],
                                           double angular_velocity[3], double pivot[3]);

/* The same on the track of the model at time t [s]. */
DRAPE_API bool drape_model_collider_rotation(const drape_model *model, int32_t index, double t,
                                             double rotation[4], double angular_velocity[3], double pivot[3]);

/* Energies of the last accepted state [J]. */
typedef struct drape_energy {
    double kinetic; /* [J] of all nodes but pinned ones, whose motion is prescribed; nodes that pins hold
                       in some directions only count with all of their velocity; and of terms with
                       an energy of motion, such as air.added_mass, what is quadratic in it */
    double elastic; /* [J] of all terms that have an energy, and of drape_sim_set_drag_spring */
    double gravity; /* [J] of the weight, zero at the origin; what loads do is in drape_sim_work */
    double contact; /* [J] of pairs that are closer than their activation distance; NaN, and `numerical` too:
                       there was no memory to find them */
    double dissipated; /* [J] taken by damping, friction and drag in still air since t = 0 or
                          drape_sim_set_state */
    double numerical;  /* [J] the rest of the balance, after what drape_sim_work has: the integrator's own
                          dissipation; negative: a gain */
} drape_energy;

/* Sums the energies of the last accepted state. */
DRAPE_API drape_energy drape_sim_energy(drape_sim *sim);

/* The work [J], int F . v dt, that has been done on the cloth since t = 0 or drape_sim_set_state, negative
 * where it took energy: of "pins" and supports that move; of "colliders" that move, with changes of the law
 * of contact; of the "host", who pushes, drags, places and changes cloth; of each load, wind and other term
 * that may do any, such as "drag.wind of flag". The sum of a drape_energy less that of all works is constant.
 * index starts at 0; past the last, *work is 0 and the result NULL. Names are valid until the sim changes or
 * is destroyed; what drape_sim_change takes away is forgotten. On several ranks: as of the last
 * drape_sim_energy. */
DRAPE_API const char *drape_sim_work(drape_sim *sim, int index, double *work);

/* The distribution of the elastic energy of the last accepted state: density (node_count) [J/m2]. The energy
 * of each element is divided equally among its nodes, and each node's share is divided by the area that is
 * lumped to it at rest. The sum over nodes of density times area is the elastic energy. */
DRAPE_API void drape_sim_energy_density(drape_sim *sim, double *density);

/* Counts of the work done since the sim was created. Times are wall-clock seconds. */
typedef struct drape_statistics {
    int64_t steps_accepted, steps_rejected; /* attempted steps by outcome */
    int64_t steps_unconverged; /* accepted steps that did not converge, under on_failure "accept" */
    double h_min, h_max;       /* [s] smallest and largest accepted step; 0 before the first */
    int64_t newton_iterations; /* of all attempts, as are the counts that follow */
    int64_t jacobians;         /* evaluations of the Jacobian */
    int64_t factorizations;    /* matrix factorizations, including failed ones */
    int64_t linear_iterations; /* iterations of iterative linear solvers */
    int64_t residuals;         /* evaluations of the residual */
    double wall_setup;         /* [s] wall-clock time, as are the times that follow: creating the sim */
    double wall_steps;         /* [s] all steps, including the parts below */
    /* [s] Disjoint parts of wall_steps: the residual and the Jacobian exclude their contact. */
    double wall_residual;
    double wall_jacobian;
    double wall_factor;
    double wall_solve;
    double wall_contact;
    double strain_min, strain_max; /* |e|/L - 1 over all edges and accepted steps */
    bool stability_known;   /* "static" found an equilibrium and the signs of its Hessian's eigenvalues */
    int64_t unstable_modes; /* number of negative eigenvalues: 0 for a stable equilibrium */
    /* [N] bound on the residual that steps are solved to, for a node of mean mass: the tolerance of the scene
     * unless the load of the nodes limits it; NAN: the integrator bounds no residual */
    double tolerance;
    /* Of drape_attempt.error; with an integrator that estimates none the lengths are NaN, and the count 0. */
    double error_bound;        /* [m] to which steps are iterated: "error" of the integrator */
    double error_max;          /* [m] largest of the accepted steps; NaN before the first */
    double error_last;         /* [m] of the last accepted step */
    int64_t steps_above_error; /* accepted steps whose error is above the bound */
    int64_t steps_held; /* accepted steps in which the cloth was held where it was: drape_realtime.held */
} drape_statistics;

/* Returns a copy of the counts so far. */
DRAPE_API drape_statistics drape_sim_statistics(const drape_sim *sim);

/* The reasons why attempts were rejected, with their counts: "max_iterations", "line_search", "edge_collapse"
 * ...; those of user-defined terms after the 31st are counted as "other". index starts at 0; past the last
 * reason *count is 0 and the result is NULL. */
DRAPE_API const char *drape_sim_reason(const drape_sim *sim, int index, int64_t *count);

/* A doubt about a run: what is unusual, and which setting would help. */
typedef struct drape_warning {
    const char *name; /* "no_terms", "unused_curve", "unused_clamp", "unused_history", "few_steps",
                         "large_mesh", "starts_inside", "ends_inside", "tangled", "no_room",
                         "numerical_dissipation", "energy_gained", "slow_contact", "contact_distance",
                         "inaccurate", "held", "crossings" or "time_dropped" */
    char text[400];   /* one line */
} drape_warning;

/* The warnings about a sim and its run so far, computed at the call: index 0 is the first that applies.
 * no_terms: nothing but weight is modelled for a cloth. unused_curve: the material has a measured curve
 * that no term of the cloth reads. unused_clamp: pins clamp a cloth, and no term of it reads that, or they
 * clamp no edge. unused_history: no load has a history. few_steps: the duration of the scene is fewer than
 * 20 steps of dt, unless integrator or controller choose their own steps or substeps. large_mesh: a mesh
 * from a file is more than 20 m across, as one in centimetres is. starts_inside, ends_inside: free nodes
 * are inside a collider, by more than 1e-9 m, or it pierces triangles without a pinned node, at the start,
 * or after the steps so far; the text describes the first such collider. tangled: an untangling left
 * intersections, gaps below the least or triangles in colliders. no_room: bodies left cloth no room, and
 * it was relaxed there (drape_sim_relaxed). numerical_dissipation: the integrator took more than half of
 * the energy that went in. energy_gained: it gained more than a tenth of that. slow_contact: contact takes
 * most of the time of the steps, and longer than the motion lasts, and a setting is known to help.
 * contact_distance: a collider moved in a step by more than five activation distances that the scene
 * gives. inaccurate: by the estimate of the integrator more than half of the steps, or the last one, are
 * further from the solution of their equation than its bound. Returns false past the last. */
DRAPE_API bool drape_sim_warning(drape_sim *sim, int index, drape_warning *out);

/* ---- Events ---- */

/* The function of an event of a host: writes f(t, x, v) to *value, whose roots are the events. positions and
 * velocities (node_count x 3 [m], [m/s]) are those of a time t [s] within the step that is being made; they
 * are valid during the call. It is called at four or more times in each step, not in order, so it must depend
 * on nothing else. Returns 0; any other value, or a *value that is not finite, ends the advance with the last
 * accepted state: with the status if that is negative, DRAPE_E_STOPPED if it is positive, DRAPE_E_ARGUMENT if
 * the value is not finite. It must not call functions of the sim. */
typedef drape_status drape_event_function(void *user, double t, const double *positions,
                                          const double *velocities, double *value);

/* Adds an event to those of the scene. def: its name, which must be given, and what else applies; its type is
 * NULL. A root is counted when f passes 0 in the direction of the def; that f is 0 at the start, or in a
 * state that was set, is not a root. The texts of the def are copied. A sim that is restored from a
 * checkpoint keeps its functions, and must have as many events as the one that was saved. There are at most
 * 64. Memory is allocated. Errors:
 * DRAPE_E_ARGUMENT (NULL, no name or one that there is already, a value of the def that is not allowed),
 * DRAPE_E_VERSION (struct_size), DRAPE_E_MEMORY. Must not be called by an observer. Thread-safety: as the
 * sim. */
DRAPE_API drape_status drape_sim_add_event(drape_sim *sim, const drape_event_def *def,
                                           drape_event_function *function, void *user);

/* What is known about an event. */
typedef struct drape_event_record {
    const char *name;   /* valid as long as the sim, or until it is restored */
    int64_t count;      /* times that it occurred since the sim was created */
    double first, last; /* [s] the first and the last time; NaN: never */
    double value;       /* of the quantity at the last time; NaN: never */
    int direction;      /* of the last time: 1: up; -1: down; 0: never */
} drape_event_record;

/* Returns the number of events, those of the scene first, and fills *out with what is known about one of them
 * if out is not NULL and there is one with this index, from 0. */
DRAPE_API int32_t drape_sim_event(const drape_sim *sim, int32_t index, drape_event_record *out);

/* The event that ended the last advance, which then returned DRAPE_E_STOPPED; -1: none did. The state is that
 * of the event. A later advance continues from there. */
DRAPE_API int32_t drape_sim_stopped_by(const drape_sim *sim);

/* ---- Checkpoints ---- */

/* Receives the next size bytes of a stream. Returns DRAPE_OK to continue, or a negative status to stop; it
 * may have set the message with drape_context_set_message. */
typedef drape_status drape_write(void *user, const void *bytes, size_t size);

/* Save a sim between two calls that advance it, so that a sim of the same model can continue from there with
 * the same bits. Saved are the states; the history kept by integrator, controller, contact and linear solver;
 * the energies and statistics so far; the number of the next frame; the paths that a host set for pins and
 * colliders; its push and its drag spring. Not saved are observers, the field of drape_sim_set_wind, and
 * anything that user-defined terms or colliders keep. An observer may also save on a frame event: the
 * remaining frames of the step are then reported by the first advance after drape_sim_restore.
 *
 * drape_sim_save writes a file under a temporary name, flushes it to the disk, and then renames it, so that
 * at any moment, even if the machine crashes, either the previous file or the new one is complete. It
 * allocates a buffer of 64 KiB and frees it again; drape_sim_save_to allocates nothing. Size: 100 to 400
 * bytes per node, plus a matrix for "ida" and modified Newton.
 *
 * Errors: DRAPE_E_ARGUMENT (NULL), DRAPE_E_MEMORY, DRAPE_E_FILE, or whatever `write` returned. The sim is
 * unchanged. Thread-safety: as the sim. */
DRAPE_API drape_status drape_sim_save(drape_sim *sim, const char *path);
DRAPE_API drape_status drape_sim_save_to(drape_sim *sim, drape_write *write, void *user);

/* Restore the saved state into a sim, whatever it did before. bytes (size) need only live during the call.
 * The sim must have been created with the model of the saved sim, or one from the same scene, by the same
 * build, with the same integrator, controller, settings and frame rate; the number of threads may differ. Its
 * observers and its wind are kept, and it can be cancelled as before; observers are not notified. Arrays that
 * the sim returned before are no longer valid. The restored sim is built beside the present one, so both
 * exist during the call. If Drape was built without the private headers of SUNDIALS (docs/checkpoints.md),
 * "ida" starts anew from the state.
 *
 * Files written by `drape run --checkpoint-every` can be restored, too. Errors, after which the sim is
 * unchanged: DRAPE_E_ARGUMENT (NULL, or another model, integrator, controller or setting), DRAPE_E_VERSION
 * (another build), DRAPE_E_PARSE (damaged, or not a checkpoint), DRAPE_E_FILE, DRAPE_E_MEMORY,
 * DRAPE_E_SOLVER, DRAPE_E_STOPPED (the context's cancel function). Must not be called by an observer.
 * Thread-safety: as the sim. */
DRAPE_API drape_status drape_sim_restore(drape_sim *sim, const char *path);
DRAPE_API drape_status drape_sim_restore_from(drape_sim *sim, const void *bytes, size_t size);

/* ---- Observers ---- */

/* The element or node that explains the outcome of an attempt best. */
typedef struct drape_diagnostic {
    const char *what;    /* "residual", "edge length / rest length", "altitude / rest altitude" ...; "":
                            nothing to report */
    const char *term;    /* name of the term that found it; "" for a node */
    int32_t element;     /* element number in that term of that cloth; -1 for a node */
    int32_t node[4];     /* its first nodes, as node numbers of the model; unused places are -1 */
    int32_t cloth;       /* index of its cloth; -1 for none */
    double value, limit; /* both in the unit of what */
} drape_diagnostic;

/* One attempted step. */
typedef struct drape_attempt {
    int64_t index;       /* number of the attempt, from 0 */
    double t, h;         /* start and size [s] */
    drape_status status; /* > 0 with accepted: an unconverged state was accepted (on_failure), or held */
    const char *reason;  /* "converged", "max_iterations" ...: a short static token */
    bool accepted;       /* the sim continued from its end; otherwise the step was rolled back */
    int iterations;      /* Newton iterations */
    double residual;     /* of the free nodes at the end of the attempt, in the norm of the integrator [N] */
    double tolerance;    /* target for the residual [N]; with the reason "rounding", the level that rounding
                         alone leaves; NaN: the integrator guarantees none */
    drape_diagnostic diagnostic; /* the element or node to report */
    double error; /* [m] estimated distance between the end of the step and the solution of its equation from
                     the same start, RMS over all nodes: with be and its like the last correction, which is
                     more than what it left; NaN: the integrator estimates none */
    double left;  /* [J] work of the residual along the last correction, about twice the energy that it
                    gained; with newton_k of the correction that would follow; NaN: not estimated */
} drape_attempt;

/* The kind of an event. */
typedef enum drape_event_kind {
    DRAPE_EVENT_ATTEMPT, /* an attempt was judged; the sim's state is the one that is kept */
    DRAPE_EVENT_FRAME,   /* a frame time was reached: t = 0 at the first advance, then k / frame_rate */
    DRAPE_EVENT_ROOT     /* an event of the scene, or of drape_sim_add_event, has occurred */
} drape_event_kind;

/* An event as an observer receives it. Valid during the call. */
typedef struct drape_event {
    drape_event_kind kind;        /* what happened */
    drape_sim *sim;               /* the sim that the event belongs to */
    const drape_attempt *attempt; /* ATTEMPT only */
    int64_t frame;                /* FRAME: number of the frame, from 0 */
    double time;                  /* FRAME [s]: frame / frame_rate, up to rounding; see positions. ROOT [s]:
                                     of the event */
    const double *positions;  /* FRAME: node_count x 3 [m]; interpolated between the two steps around it by a
                                 cubic Hermite polynomial or, where that passes through something, on the
                                 straight line between them, at the nearest free point to the time. If none is
                                 free, they and the time are those of the later step, also in the other frames
                                 between the two */
    const double *velocities; /* FRAME: node_count x 3 [m/s]; linear between the two steps around it, for
                                 methods of order 1 and 2; otherwise the integrator's dense output or the
                                 slope of the polynomial. Positions and velocities of ROOT are dense output,
                                 too, which is not checked for contact; for an event that acts, the state */
    int32_t event;            /* ROOT: number of the event, for drape_sim_event */
    const char *name;         /* ROOT: its name */
    double value;  /* ROOT: the quantity, in the unit of its bound; of a function of the host, its value */
    int direction; /* ROOT: 1: it passed its bound upwards; -1: downwards */
} drape_event;

/* Called within drape_sim_advance. Returns 0 to continue. Any other value stops the advance, which then
 * returns DRAPE_E_STOPPED if the value is > 0, else the value itself, with the message that the observer may
 * have set by drape_context_set_message. An observer may read whatever a host may, and save the sim; it must
 * not advance or destroy the sim, nor change it. */
typedef drape_status drape_observer(void *user, const drape_event *event);

/* Adds an observer. Observers are called in the order in which they were added; there are at most 8. Errors:
 * DRAPE_E_ARGUMENT. */
DRAPE_API drape_status drape_sim_observe(drape_sim *sim, drape_observer *observer, void *user);

/* ---- Runs of a given accuracy ---- */

/* How accurate a run is, by how far it is from a coarser one: root mean square over the nodes of a cloth, the
 * largest of all frames. */
typedef struct drape_accuracy {
    double asked;    /* [1] share of the smallest diagonal of the cloths' boxes at rest */
    double error;    /* [1] of the whole run by estimate, share of the diagonal of its cloth; NaN: unknown */
    double distance; /* [m] the same */
    double worst;    /* [m] of its node that is furthest off, likewise */
    int32_t cloth, node; /* of which these are; numbered in the cloth */
    double time;         /* [s] when that node is there */
    double place[3];     /* [m] where */
    double until;        /* [s] until then the run is as accurate as asked */
    bool reached;        /* that is the end of the run */
    int32_t runs;        /* that were made, this one included */
    double seconds;      /* [s] wall-clock time of the steps of the others */
    char method[128];    /* by which this run is made: "bdf2, dt 0.0125" */
} drape_accuracy;

/* Called before each run, with its sim, to which observers may be added, and what the runs before have shown:
 * what observers saw of an earlier sim is superseded, and they are not called for it any more. The sim must
 * be used by observers only. A status other than 0 ends the runs, and is returned. */
typedef drape_status drape_run_prepare(void *user, drape_sim *sim, const drape_accuracy *before);

/* Runs a model from its start for its duration until a run is as accurate as its scene asks for: chooses
 * methods and steps, compares each run with the one before, and stops refining where that leads nowhere,
 * since a motion may be predictable up to some time only. def: threads and the like; its method and settings
 * are replaced; may be NULL, as prepare may. *out: the sim of the last run, which is the caller's, also after
 * a failure that came later than its creation. Errors: DRAPE_E_ARGUMENT (NULL, no accuracy is asked, or one
 * below what double precision gives, the scene names a method that does not converge), those of
 * drape_sim_create and drape_sim_advance, of prepare. Thread-safety: that of the context. */
DRAPE_API drape_status drape_run_accurately(drape_context *ctx, const drape_model *model,
                                            const drape_sim_def *def, drape_run_prepare *prepare, void *user,
                                            drape_sim **out, drape_accuracy *report);

/* For observers: sets the text that drape_context_message returns, in the style of printf. */
DRAPE_API void drape_context_set_message(drape_context *ctx, const char *format, ...) DRAPE_PRINTF(2, 3);

DRAPE_C_END

#endif
