/*
 * drape.h: all that a user of the library needs: context, scene, model, sim, observers.
 *
 * Units are SI: metres, kilograms, seconds, newtons, joules, radians. Axes are right-handed with Y up;
 * gravity is explicit. Vectors of nodes are interleaved: x0 y0 z0 x1 y1 z1 ... in double precision.
 *
 * Errors. Functions that can fail return a drape_status; drape_context_message() then says what, where, which
 * value, and what would be right. The library never prints, exits or aborts.
 *
 * Ownership. An object is made by _create, _load or _parse and freed by _destroy, which takes the address of
 * the handle, writes NULL there and does nothing to a NULL handle. A context outlives what was made from it;
 * a model outlives its sims.
 *
 * Threads. A context and a scene belong to one thread at a time. A model is read-only: several threads may
 * read it and run sims on it, each thread with a context of its own. A sim belongs to one thread at a time;
 * drape_sim_cancel alone may be called from any.
 */
#ifndef DRAPE_DRAPE_H
#define DRAPE_DRAPE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "export.h"

DRAPE_C_BEGIN

/* ---- Status ---- */

/* The sign says who acts: 0 done; > 0 a smaller step may succeed; < 0 it will not, stop and explain. */
typedef enum drape_status {
    DRAPE_OK = 0,
    DRAPE_RETRY_NONLINEAR = 1,   /* the nonlinear solver did not reach its tolerance */
    DRAPE_RETRY_LINEAR = 2,      /* the linear solver failed: singular matrix, no memory for its fill-in */
    DRAPE_RETRY_NONFINITE = 3,   /* a residual, a Jacobian entry or a result is not a finite number */
    DRAPE_RETRY_DEGENERATE = 4,  /* an element collapsed: edge length, altitude, hinge angle */
    DRAPE_RETRY_REJECTED = 5,    /* the step controller or the error test refused the step */
    DRAPE_E_ARGUMENT = -1,       /* a wrong argument, scene value or command line */
    DRAPE_E_MEMORY = -2,         /* an allocation failed */
    DRAPE_E_FILE = -3,           /* a file cannot be opened, read or written */
    DRAPE_E_PARSE = -4,          /* the text of a scene or mesh is not of its format */
    DRAPE_E_STEP_TOO_SMALL = -5, /* below dt_min, or too many of them; the last accepted state stays */
    DRAPE_E_SOLVER = -6,  /* a step failed and no smaller step may be tried, or the solver cannot be set up */
    DRAPE_E_VERSION = -7, /* a struct or a file of another version of Drape */
    DRAPE_E_STOPPED = -8  /* an observer, drape_sim_cancel, or the context's cancel asked to stop */
} drape_status;

/* The status' name in lower case without the prefix: "ok", "retry_nonlinear", "e_step_too_small"; "unknown"
 * for no status. */
DRAPE_API const char *drape_status_name(drape_status status);

/* "0.1.0": the version of the library that is linked, to compare with the DRAPE_VERSION_* of the header. */
DRAPE_API const char *drape_version(void);

/* ---- Context ---- */

/* Allocator, log, and the last message. */
typedef struct drape_context drape_context;

/* Severity of a log line. */
typedef enum drape_log_level { DRAPE_LOG_INFO = 0, DRAPE_LOG_WARNING = 1 } drape_log_level;

/* Settings of a context. Initialise with drape_context_def_init. */
typedef struct drape_context_def {
    size_t struct_size; /* set by drape_context_def_init; a def with 0 here is refused */
    /* Allocator of all memory of Drape's own; both functions or neither. allocate returns NULL on failure and
     * memory aligned for any type; release takes what allocate gave, never NULL. Default: malloc and free.
     * SUNDIALS and KLU use malloc. */
    void *(*allocate)(void *user, size_t size);
    void (*release)(void *user, void *memory);
    void *allocator_user;
    /* Receives log lines without a newline. Default NULL: nothing is logged. */
    void (*log)(void *user, drape_log_level level, const char *text);
    void *log_user;
    /* Asked between the stages of reading and compiling a scene, of making a sim and of restoring one, in the
     * thread of the call: whether to end it with DRAPE_E_STOPPED, as if it had not been made. It may be asked
     * thousands of times and must only look. Default NULL: never. A sim that is there is ended by
     * drape_sim_cancel. */
    bool (*cancel)(void *user);
    void *cancel_user;
} drape_context_def;

/* Fills *def with the defaults. struct_size is sizeof(drape_context_def) of the caller. */
DRAPE_API void drape_context_def_init(drape_context_def *def, size_t struct_size);

/* Makes a context. def NULL: the defaults. Errors: DRAPE_E_ARGUMENT (def not initialised, out NULL),
 * DRAPE_E_MEMORY. */
DRAPE_API drape_status drape_context_create(const drape_context_def *def, drape_context **out);

/* Frees a context, after all that was made from it. */
DRAPE_API void drape_context_destroy(drape_context **ctx);

/* What the last failed call had to say, one line without newline; "" before any failure. Valid until the next
 * call with this context or with an object made from it. NULL ctx: a fixed text. */
DRAPE_API const char *drape_context_message(const drape_context *ctx);

/* ---- Scene in memory: what a host fills instead of a scene file ---- */

/* Defs of this section begin with struct_size, set by their _init; those of an array are of one size.
 * Settings, rows and keys of tracks have none: they stay as they are. */

/* One parameter by name. Numbers and integers go into number with text and vector NULL; choices and file
 * names into text; booleans as text "true" or "false", or as number 0 or 1; vectors into vector. */
typedef struct drape_setting {
    const char *name;     /* of the parameter */
    double number;        /* of numbers, integers and booleans */
    const char *text;     /* of choices, names of files, booleans; NULL: none */
    const double *vector; /* vector_count numbers: 3, or 4 for axis and angle [degrees] */
    size_t vector_count;  /* of vector */
} drape_setting;

/* A row of one of Drape's tables by name, with the parameters that differ from their defaults. `drape list`
 * shows all. */
typedef struct drape_entry_def {
    const char *type;              /* the name of the row */
    const drape_setting *settings; /* setting_count of them; NULL for none */
    size_t setting_count;          /* of settings */
} drape_entry_def;

/* A triangle mesh: one of three sources. Exactly one of grid.type, file, positions is set. It lies inside the
 * def of a cloth and grows into what is reserved. */
typedef struct drape_mesh_def {
    drape_entry_def grid;              /* a row of the grids: "equilateral", "square" */
    const char *file;                  /* an OBJ or PLY file, by its ending */
    const double *positions;           /* node_count x 3 [m], copied */
    const int32_t *triangles;          /* triangle_count x 3, 0-based, copied */
    size_t node_count, triangle_count; /* of positions and triangles */
    double scale[3];                   /* default 1 1 1; applied first */
    double rotate[4];                  /* axis x y z and angle [degrees]; default none; applied second */
    double translate[3];               /* [m]; default 0; applied last */
    void *reserved[4];                 /* NULL */
} drape_mesh_def;

/* Displacement of pinned nodes from their rest positions, or of a collider from where its parameters put it,
 * as a piecewise linear function of time, constant before the first and after the last key. */
typedef struct drape_track_key {
    double time;            /* [s], strictly increasing from key to key */
    double displacement[3]; /* [m] */
} drape_track_key;

/* Nodes of one cloth held fixed, or moved along a track. Exactly one of nodes, corner, edge, row (>= 0),
 * has_box selects them. corner, edge and row exist on grids only. */
typedef struct drape_pin_def {
    size_t struct_size;   /* set by drape_pin_def_init */
    const int32_t *nodes; /* node_count node numbers of this cloth */
    size_t node_count;    /* of nodes */
    const char *corner;   /* "top-left", "top-right", "bottom-left", "bottom-right"; top is row 0, left is
                             column 0 */
    const char *edge;     /* "top", "bottom", "left", "right" */
    int32_t row;          /* -1: not selected by row */
    bool has_box;         /* box_min and box_max are set */
    double box_min[3], box_max[3]; /* [m], rest coordinates after the transform; boundary included */
    const drape_track_key *track;  /* key_count keys; NULL: fixed */
    size_t key_count;              /* of track */
    bool clamp; /* edges between its nodes keep the direction of the sheet, for bending terms that see it */
} drape_pin_def;

/* One piece of cloth. */
typedef struct drape_cloth_def {
    size_t struct_size;  /* set by drape_cloth_def_init */
    const char *name;    /* NULL: "cloth0", "cloth1" ... */
    drape_mesh_def mesh; /* its triangles at rest */
    const drape_setting
        *material;         /* young_modulus, poisson_ratio, thickness, density ...: `drape list` shows all */
    size_t material_count; /* of material */
    const drape_entry_def *terms; /* rows of the terms that are modelled */
    size_t term_count;            /* of terms */
    const drape_pin_def *pins;    /* nodes that are held or moved; NULL: none */
    size_t pin_count;             /* of pins */
    double velocity[3];           /* [m/s] of every node at t = 0 */
} drape_cloth_def;

/* A rigid obstacle: a row of the colliders with its parameters. Initialise with drape_collider_def_init. */
typedef struct drape_collider_def {
    size_t struct_size;           /* set by drape_collider_def_init */
    drape_entry_def entry;        /* "plane", "sphere" ... */
    const char *name;             /* NULL: "collider0", "collider1" ... */
    double friction;              /* Coulomb's mu between it and cloth [1], [0, 1000]; default 0 */
    const drape_track_key *track; /* displacement from where the parameters put it; NULL: it rests */
    size_t key_count;             /* of track */
} drape_collider_def;

/* A whole scene. Initialise with drape_scene_def_init; everything pointed to need only live until
 * drape_model_create returns. */
typedef struct drape_scene_def {
    size_t struct_size;            /* set by drape_scene_def_init */
    const drape_cloth_def *cloths; /* at least one */
    size_t cloth_count;            /* of cloths */
    double gravity[3];             /* [m/s2]; default 0 -9.81 0 */
    drape_entry_def integrator; /* default "be"; keys of any integrator row are accepted, those of other rows
                                   are ignored */
    drape_entry_def controller; /* default "halving" */
    double duration;            /* [s], required > 0 when run from the command line; default 1 */
    double frame_rate;          /* [1/s] of frame events; default 60 */
    const char *const *formats; /* frame formats of `drape run`, rows of the exporters; default none */
    size_t format_count;        /* of formats */
    const char *folder;         /* folder that relative mesh files are in; NULL: the working directory */
    const drape_collider_def *colliders; /* at most 4096 */
    size_t collider_count;               /* of colliders */
    const drape_setting *self_contact;   /* thickness, friction; NULL: cloth goes through cloth */
    size_t self_contact_count;           /* of self_contact */
    const drape_setting *contact;        /* distance, stiffness ...: `drape list contact` shows all */
    size_t contact_count;                /* of contact */
    const char *up; /* axis that points up in frames of `drape run`: "y" or "z"; NULL: "y" */
} drape_scene_def;

/* Fill a def with the defaults above. */
DRAPE_API void drape_scene_def_init(drape_scene_def *def, size_t struct_size);
DRAPE_API void drape_cloth_def_init(drape_cloth_def *def, size_t struct_size);
DRAPE_API void drape_mesh_def_init(drape_mesh_def *def, size_t struct_size);
DRAPE_API void drape_pin_def_init(drape_pin_def *def, size_t struct_size);
DRAPE_API void drape_collider_def_init(drape_collider_def *def, size_t struct_size);

/* ---- Scene from text ---- */

/* A parsed scene file, open to changes before it is compiled. */
typedef struct drape_scene drape_scene;

/* Reads a scene file, or the text of one (name stands for the file in messages; relative mesh files are
 * sought in the working directory). Only the syntax of JSON is checked here; keys and values are checked by
 * drape_scene_compile, after changes. Errors: DRAPE_E_FILE, DRAPE_E_PARSE, DRAPE_E_MEMORY; message
 * "scene.json:LINE:COLUMN: what". */
DRAPE_API drape_status drape_scene_load(drape_context *ctx, const char *path, drape_scene **out);
DRAPE_API drape_status drape_scene_parse(drape_context *ctx, const char *text, const char *name,
                                         drape_scene **out);

/* Sets the value at a JSON pointer ("/integrator/dt") to a JSON text ("0.001", "\"ida\"", "[0,0,0]"; numbers
 * may be .5, +5 or 5. as well; a text that is not JSON is taken as a string, so ida may stand without
 * quotes). Missing objects on the way are made. "-" appends to an array. Errors: DRAPE_E_ARGUMENT (not a
 * pointer, a step into a number or past an array), DRAPE_E_MEMORY. */
DRAPE_API drape_status drape_scene_set(drape_scene *scene, const char *pointer, const char *value);

/* Frees a scene; models made from it stay. */
DRAPE_API void drape_scene_destroy(drape_scene **scene);

/* ---- Model
 * ---------------------------------------------------------------------------------------------------------
 */

/* A compiled scene: rest geometry, masses, elements, parameters, sparsity. Immutable. */
typedef struct drape_model drape_model;

/* Compiles a scene. Errors: DRAPE_E_ARGUMENT, DRAPE_E_PARSE, DRAPE_E_FILE, DRAPE_E_MEMORY; the message starts
 * with the place: "scene.json:LINE:COLUMN: /pointer: what, value, range" for scenes from text, "/pointer:
 * ..." for scenes in memory, where the pointer names the value as it would stand in a file. *out is NULL on
 * failure. */
DRAPE_API drape_status drape_scene_compile(drape_scene *scene, drape_model **out);
DRAPE_API drape_status drape_model_create(drape_context *ctx, const drape_scene_def *def, drape_model **out);
/* drape_scene_load and drape_scene_compile in one call. */
DRAPE_API drape_status drape_model_load(drape_context *ctx, const char *scene_path, drape_model **out);

/* Frees a model, after all its sims. */
DRAPE_API void drape_model_destroy(drape_model **model);

/* Sizes. A NULL model has none of anything. dofs: unknowns, 3 a free node; nonzeros: of the full dofs x dofs
 * Jacobian. */
DRAPE_API int32_t drape_model_node_count(const drape_model *model);
DRAPE_API int32_t drape_model_triangle_count(const drape_model *model);
DRAPE_API int64_t drape_model_dof_count(const drape_model *model);
DRAPE_API int64_t drape_model_nonzero_count(const drape_model *model);

/* Arrays of the model, valid as long as it lives: triangles (triangle_count x 3, node numbers of the whole
 * model), rest positions (node_count x 3 [m]), lumped masses (node_count [kg]), pinned flags (node_count, 1
 * pinned). */
DRAPE_API const int32_t *drape_model_triangles(const drape_model *model);
DRAPE_API const double *drape_model_rest_positions(const drape_model *model);
DRAPE_API const double *drape_model_masses(const drape_model *model);
DRAPE_API const uint8_t *drape_model_pinned(const drape_model *model);

/* The pieces of cloth: each owns a contiguous range of nodes and of triangles, in scene order. */
typedef struct drape_cloth_range {
    const char *name;                       /* as in the scene, or "cloth0" ... */
    int32_t first_node, node_count;         /* its nodes, in numbers of the model */
    int32_t first_triangle, triangle_count; /* its triangles */
} drape_cloth_range;

/* How many pieces of cloth there are, and one of them; an index that none has gives a range of nothing. */
DRAPE_API int32_t drape_model_cloth_count(const drape_model *model);
DRAPE_API drape_cloth_range drape_model_cloth(const drape_model *model, int32_t index);

/* The obstacles, in scene order, and where they are at time t [s]. */
typedef struct drape_collider_motion {
    const char *name;       /* as in the scene, or "collider0" ... */
    const char *type;       /* the row */
    double displacement[3]; /* [m] from where its parameters put it */
    double velocity[3];     /* [m/s]; at a key of the track that of the piece after it, at the end of a host's
                               way 0 */
} drape_collider_motion;

/* How many obstacles there are, and where one of them is by its track at time t [s]. */
DRAPE_API int32_t drape_model_collider_count(const drape_model *model);
DRAPE_API drape_collider_motion drape_model_collider(const drape_model *model, int32_t index, double t);

/* How far each triangle is stretched at positions x (node_count x 3 [m]): strain (triangle_count x 2) gets
 * its principal engineering strains [1], lambda - 1 of the principal stretches lambda of the triangle against
 * its rest shape, the larger one first. Rest lengths that terms have of their own play no part. */
DRAPE_API void drape_model_strain(const drape_model *model, const double *x, double *strain);

/* The scene's own duration [s] and frame rate [1/s]. */
DRAPE_API double drape_model_duration(const drape_model *model);
DRAPE_API double drape_model_frame_rate(const drape_model *model);

/* ---- Sim
 * -----------------------------------------------------------------------------------------------------------
 */

/* A running simulation: the state, the integrator, the controller and their workspace. */
typedef struct drape_sim drape_sim;

/* How to run. Initialise with drape_sim_def_init; what is left at its default is the scene's own. */
typedef struct drape_sim_def {
    size_t struct_size;                       /* set by drape_sim_def_init */
    const char *integrator;                   /* a row of the integrators; NULL: the scene's */
    const drape_setting *integrator_settings; /* override the scene's settings */
    size_t integrator_setting_count;          /* of integrator_settings */
    const char *controller;                   /* a row of the controllers; NULL: the scene's */
    const drape_setting *controller_settings; /* override the scene's settings */
    size_t controller_setting_count;          /* of controller_settings */
    double dt;                                /* [s]; 0: the scene's */
    double dt_min;                            /* [s]; 0: the scene's */
    double frame_rate;                        /* [1/s] of frame events; 0: the scene's */
    int threads; /* threads that evaluate elements, 1 to 256; default 1; the result does not depend on it */
    double realtime_step; /* [s] longest step that drape_sim_advance_realtime takes to keep up, and the most
                             time that it owes; 0: four times dt */
} drape_sim_def;

/* Fills *def with the defaults. */
DRAPE_API void drape_sim_def_init(drape_sim_def *def, size_t struct_size);

/* Makes a sim at t = 0 in the model's rest positions and initial velocities. NULL def: the scene's integrator
 * and controller. All heap memory of Drape's own is taken here: none in a step. The messages of the sim go to
 * ctx, which may differ from the model's. Errors: DRAPE_E_ARGUMENT (unknown row, setting out of range),
 * DRAPE_E_MEMORY, DRAPE_E_SOLVER. */
DRAPE_API drape_status drape_sim_create(drape_context *ctx, const drape_model *model,
                                        const drape_sim_def *def, drape_sim **out);

/* Frees a sim. */
DRAPE_API void drape_sim_destroy(drape_sim **sim);

/* Advances to t_end [s]. Steps end at t0 + k dt; only the last one is cut to end at t_end, and a remainder
 * below 1e-9 dt joins the step before. A t_end not after the present time, but for rounding, does nothing. On
 * failure the state is that of the last accepted step. Errors: DRAPE_E_STEP_TOO_SMALL (halving gave up; "ida"
 * took max_steps; max_attempts in one dt), DRAPE_E_SOLVER (a step failed under the controller "fixed"),
 * DRAPE_E_STOPPED (an observer asked, or drape_sim_cancel), DRAPE_E_ARGUMENT (t_end not finite); the message
 * names time, step, reason and worst element. */
DRAPE_API drape_status drape_sim_advance(drape_sim *sim, double t_end);

/* What a call of drape_sim_advance_realtime did. */
typedef struct drape_realtime {
    double time;    /* [s] simulated time that it came to */
    double debt;    /* [s] of the frame, and of those before, that is owed to the next call; 0: it kept up */
    double dropped; /* [s] given up in this call, because more was owed than may be */
    double dropped_total;   /* [s] since the sim was made */
    double seconds;         /* [s] of wall clock that the call took, its observers included */
    bool kept;              /* that was within the budget */
    const char *level;      /* "full"; "fewer iterations"; "larger steps": longer than dt, or time is owed */
    int effort;             /* of the integrator: 0, as its parameters say, and up, cheaper */
    int attempts, rejected; /* steps of this call, and those of them that were forgotten */
    double h;               /* [s] largest accepted step; 0: none was accepted */
    double residual; /* [N] largest of the accepted steps, in the norm of the integrator; NaN: it has none */
} drape_realtime;

/* Advances by a frame in a given time: for games, previews, anything that must show a state when it is due.
 * Makes frame_dt [s] and what earlier calls left over, in equal steps no longer than dt. If that is not
 * expected to fit into budget_seconds of wall clock, by what steps took lately, then the integrator tries
 * less hard (rows with efforts, such as "newton_k"), then steps are longer, up to realtime_step of the def,
 * and then time is left over. The rung is chosen anew in each call, and a better one is returned to as soon
 * as it fits.
 *
 * The work of a call is bounded: after its first accepted step none is begun that is not expected to end in
 * time. Time owed is at most one longest step; what is more is dropped, simulated time then runs behind the
 * clock for good, and late frames do not make later ones later. Steps follow the frames, so at another frame
 * rate the state differs by the integrator's own error in h and nothing else. A later drape_sim_advance goes
 * on with the scene's own steps. Which rung is taken depends on the clock, so two runs may differ; with a
 * budget that is never reached they do not.
 *
 * *report, unless NULL, is filled whatever the status. Integrators and controllers that choose their own
 * steps keep doing so, within the bound. Errors: as drape_sim_advance; DRAPE_E_ARGUMENT (frame_dt not in (0,
 * 1e6], budget not in [0, 1e9], an integrator without time). */
DRAPE_API drape_status drape_sim_advance_realtime(drape_sim *sim, double frame_dt, double budget_seconds,
                                                  drape_realtime *report);

/* Puts the sim into a state of the host's own, from which the next advance starts: time [s], 0 to 1e9, before
 * or after the present one; positions [m] and velocities [m/s], node_count x 3, copied. Pinned nodes must lie
 * where their pins have them at t, to 1e-9 of the scene's size, and are put there exactly; those that
 * drape_sim_move_pins has sent rest where x has them. The velocities of fixed ones become 0, those of moved
 * ones are taken until a step gives them the mean of their track. Internal variables follow from the
 * positions: a hinge's angle is taken on the branch nearest to its present one.
 *
 * The integrator and the controller start anew, as after a kink; steps are counted from t, and the energies
 * dissipated and numerical from 0. Frames go on with the first at or after t; where t is the present time,
 * with the next that was not told. Statistics go on. Positions and velocities that a sim of the same model
 * had, at the same time, are taken to the bit, so a one-step integrator goes on from them as that sim did
 * where k dt has no rounding.
 *
 * Nothing is allocated, and no element checked: a state with one that is degenerate is a start that steps may
 * lead out of. Not for observers. Errors: DRAPE_E_ARGUMENT (NULL, not finite, a pinned node elsewhere), and
 * then nothing has changed. Thread-safety: as the sim. */
DRAPE_API drape_status drape_sim_set_state(drape_sim *sim, double t, const double *x, const double *v);

/* Pulls a free node by a spring of stiffness [N/m] from it to target [m]: the force stiffness (target - x),
 * in the equations of every step from the next one on, implicit where the integrator is. It replaces the one
 * before; stiffness 0 lets go. The spring's energy is counted as elastic, and what moving its target takes as
 * the work of a pin. Integrators start anew. Nothing is allocated. Not for observers. Errors:
 * DRAPE_E_ARGUMENT (no such node, a pinned one, a stiffness below 0, not finite), and then nothing has
 * changed. Thread-safety: as the sim. */
DRAPE_API drape_status drape_sim_set_drag_spring(drape_sim *sim, int32_t node, double stiffness,
                                                 const double target[3]);

/* The force of that spring on its node in the present state [N]; 0 without one. */
DRAPE_API void drape_sim_drag_spring_force(const drape_sim *sim, double force[3]);

/* Makes the advance that is running, or else the next one, return DRAPE_E_STOPPED with the last accepted
 * state: before its next step, or at the next evaluation of forces within one, which is then forgotten and
 * counted as rejected ("cancelled"). A later advance goes on from there. Thread-safety: may be called from
 * any thread and from a signal handler, as long as the sim lives. NULL is fine. */
DRAPE_API void drape_sim_cancel(drape_sim *sim);

/* ---- Sim: what a host moves ----
 *
 * For a host that has its own idea of where things are, frame by frame: it says where pins and colliders are to be at
 * the end of the frame, advances by the frame, and says the next. Nothing here allocates;
 * none is for observers; after an error nothing has changed. Thread-safety: as the sim. */

/* Sends pinned nodes, fixed ones and ones on tracks alike, on ways of the host's: node nodes[i] goes in the
 * next `seconds` of simulated time from where it is to positions[3 i ...] [m], where it then rests, or goes
 * on by the next call. velocities (count x 3 [m/s]): with how much it comes there, on a cubic from its
 * present position and velocity, so that calls from frame to frame make a smooth motion; NULL: straight, at
 * one speed. A node that was sent once is the host's for good: its track no longer counts.
 * drape_sim_set_state leaves such nodes where the state has them, at rest.
 *
 * Before drape_sim_advance_realtime, seconds is the frame and what is owed, frame_dt + drape_realtime.debt.
 *
 * The way is known to the integrator in full: any step inside it, and any frame, has pins where the way has
 * them. A jump of velocity is a kink, at which "ida" starts anew. Errors: DRAPE_E_ARGUMENT (no such node, one
 * that is free, the same one twice is not looked for; seconds not in (0, 1e9], not finite or beyond 1e9 m or
 * m/s). */
DRAPE_API drape_status drape_sim_move_pins(drape_sim *sim, int32_t count, const int32_t *nodes,
                                           double seconds, const double *positions, const double *velocities);

/* The same for a collider as a whole: to a displacement [m] from where its parameters put it.
 * `drape_sim_collider` tells where it is. */
DRAPE_API drape_status drape_sim_move_collider(drape_sim *sim, int32_t collider, double seconds,
                                               const double displacement[3], const double *velocity);

/* Pushes nodes: forces (node_count x 3 [N], copied) act from the next step on, the same whatever the nodes
 * do, until they are replaced; NULL: none. On a pinned node they are taken up by its pin. Their work counts
 * as that of pins. "ida" starts anew. Errors: DRAPE_E_ARGUMENT (not finite). */
DRAPE_API drape_status drape_sim_push(drape_sim *sim, const double *forces);

/* The velocity of the medium at time t [s] at count points: wind (count x 3 [m/s]) at x (count x 3 [m]).
 * gradient, unless NULL, gets dwind_i/dx_j at [9 p + 3 i + j] [1/s]; it comes filled with zeros, and a field
 * that leaves them loses convergence, not accuracy: Newton's matrix then lacks that part. wind comes filled
 * with zeros, too. Called several times a step within drape_sim_advance, in its thread, at states that are
 * only tried: the same t and x must give the same wind, and within one advance it is to be smooth in t. */
typedef void drape_wind_field(void *user, double t, int32_t count, const double *x, double *wind,
                              double *gradient);

/* Moves the medium that drag terms are in ("drag.wind", added to its own steady wind, "drag.viscous", and a
 * host's with in_medium); field NULL: it rests again. Errors: DRAPE_E_ARGUMENT (no term of the model is in a
 * medium). */
DRAPE_API drape_status drape_sim_set_wind(drape_sim *sim, drape_wind_field *field, void *user);

/* ---- Sim: what can be read ---- */

/* The last accepted state: time [s], positions [m] and velocities [m/s], node_count x 3; valid until the next
 * call that changes the sim. */
DRAPE_API double drape_sim_time(const drape_sim *sim);
DRAPE_API const double *drape_sim_positions(const drape_sim *sim);
DRAPE_API const double *drape_sim_velocities(const drape_sim *sim);
DRAPE_API const drape_model *drape_sim_model(const drape_sim *sim);

/* A 64-bit hash of time, positions, velocities and internal variables of the last accepted state, nothing
 * else. */
DRAPE_API uint64_t drape_sim_hash(const drape_sim *sim);

/* How many triangles of the cloth reach into a collider of the scene, counted from 0, by more than 1e-9 m; by
 * 28 points of each. With implicit rows and `ida` none does that did not in the beginning (docs/contact.md).
 * *deepest, if not NULL: how deep [m]. -1: there is no such collider. */
DRAPE_API int32_t drape_sim_inside(const drape_sim *sim, int32_t collider, double *deepest);

/* Normals of the last accepted state (node_count x 3 [1]): the mean of the triangles around a node weighted
 * by their areas, of length 1, counterclockwise outside; 0 where those add up to nothing.
 * drape_model_normals: at other positions x (node_count x 3 [m]). */
DRAPE_API void drape_sim_normals(const drape_sim *sim, double *normals);
DRAPE_API void drape_model_normals(const drape_model *model, const double *x, double *normals);

/* Forces in the last accepted state, into arrays of the host's (node_count x 3 [N]).
 *
 * drape_sim_reactions: what pins do to pinned nodes, 0 on free ones: the force that keeps a node on its way
 * against cloth, gravity, contact and push, without what it takes to speed up the node's own mass. Rates that
 * damping laws take from a step are those of the velocities here.
 *
 * drape_sim_contact_forces: of contact and friction, with colliders and between layers, on every node;
 * drape_sim_collider_force: of cloth on one collider, as a whole. Colliders have the mean velocity of the
 * last step, so ask before moving them on. Under "newton_k", which does not bring the residual of a step to
 * zero, all of these are far off (docs/choosing.md). An integrator that moves nodes out of what they meet
 * ("verlet") has no such forces, and says so. Errors: DRAPE_E_ARGUMENT, DRAPE_E_MEMORY. Thread-safety: as the
 * sim. Not for observers. */
DRAPE_API drape_status drape_sim_reactions(drape_sim *sim, double *forces);
DRAPE_API drape_status drape_sim_contact_forces(drape_sim *sim, double *forces);
DRAPE_API drape_status drape_sim_collider_force(drape_sim *sim, int32_t collider, double force[3]);

/* Where a collider is in the last accepted state, as drape_model_collider, with the host's moves. */
DRAPE_API drape_collider_motion drape_sim_collider(const drape_sim *sim, int32_t collider);

/* Energies of the last accepted state [J]. */
typedef struct drape_energy {
    double kinetic;    /* [J] of the free nodes, as the motion of pinned ones is prescribed */
    double elastic;    /* [J] of all terms that have an energy, and of drape_sim_set_drag_spring */
    double gravity;    /* [J] the potential, zero at the origin */
    double contact;    /* [J] of pairs that are nearer than their activation distance */
    double dissipated; /* [J] the work that damping and drag terms took since t = 0 or drape_sim_set_state */
    double numerical;  /* [J] what is missing otherwise, the integrator's own dissipation (negative: gain),
                          after the work of pins and colliders that move and of drape_sim_push */
} drape_energy;

/* Adds up the energies of the last accepted state. */
DRAPE_API drape_energy drape_sim_energy(drape_sim *sim);

/* Where the elastic energy of the last accepted state is: density (node_count) [J/m2], that of each element
 * in equal parts on its nodes, over the area that is lumped to a node at rest. Its sum over nodes, each times
 * its area, is the elastic energy. */
DRAPE_API void drape_sim_energy_density(drape_sim *sim, double *density);

/* Work done since the sim was made. Times in seconds of wall clock; newton times are parts of steps. */
typedef struct drape_statistics {
    int64_t steps_accepted, steps_rejected; /* attempts by what became of them */
    int64_t steps_unconverged; /* of the accepted: taken although unconverged, by on_failure "accept" */
    double h_min, h_max;       /* [s] of accepted steps; 0 before the first */
    int64_t newton_iterations; /* of all attempts, as what follows */
    int64_t jacobians;         /* evaluated */
    int64_t factorizations;    /* of matrices, those that were refused too */
    int64_t linear_iterations; /* of solvers that iterate */
    int64_t residuals;         /* evaluated */
    double wall_setup;         /* [s] of a clock on a wall, as what follows: making the sim */
    double wall_steps;         /* [s] all steps, with the parts below */
    /* [s] Parts of wall_steps, none of them a part of another: residual and Jacobian are without their
     * contact. */
    double wall_residual;
    double wall_jacobian;
    double wall_factor;
    double wall_solve;
    double wall_contact;
    double strain_min, strain_max; /* |e|/L - 1 over all edges and accepted steps */
    bool stability_known;   /* "static" found an equilibrium and the signs of its Hessian's eigenvalues */
    int64_t unstable_modes; /* how many are negative: 0 for a stable equilibrium */
} drape_statistics;

/* Copies what was counted so far. */
DRAPE_API drape_statistics drape_sim_statistics(const drape_sim *sim);

/* Reasons for which attempts were rejected, with their counts: "max_iterations", "line_search",
 * "edge_collapse" ..., "other" for all past the 31st. index runs from 0; *count is 0 and the result NULL past
 * the last. */
DRAPE_API const char *drape_sim_reason(const drape_sim *sim, int index, int64_t *count);

/* ---- Checkpoints ---- */

/* Takes size bytes, in the order in which they come. DRAPE_OK to go on; a negative status to stop with, whose
 * message it may have set by drape_context_set_message. */
typedef drape_status drape_write(void *user, const void *bytes, size_t size);

/* Saves a sim between two calls that advance it, so that a sim of the same model goes on from there with the
 * same bits: states, what integrator, controller, contact and linear solver know of the past, the energies
 * and statistics so far, the number of the next frame; where a host sent pins and colliders, what it pushes
 * and pulls. Not saved are observers, the field of drape_sim_set_wind, and what a host's own terms or
 * colliders keep. May also be called by an observer of a frame: the frames that are left of the step are told
 * after drape_sim_restore, by the next advance.
 *
 * drape_sim_save writes a file: under another name first, then to the disk, then under its own, so that at
 * any moment, a crash of the machine too, there is the file before or the new one whole. It takes a buffer of
 * 64 KiB and gives it back; drape_sim_save_to takes no memory. Sizes: 100 to 400 bytes a node; for "ida" and
 * modified Newton a matrix beside.
 *
 * Errors: DRAPE_E_ARGUMENT (NULL), DRAPE_E_MEMORY, DRAPE_E_FILE; what `write` returned. The sim is as it was.
 * Thread-safety: as the sim. */
DRAPE_API drape_status drape_sim_save(drape_sim *sim, const char *path);
DRAPE_API drape_status drape_sim_save_to(drape_sim *sim, drape_write *write, void *user);

/* Puts a sim, whatever it did before, where the saved one was; bytes (size) need only live during the call.
 * The sim was made with the model of the saved one, or one from the same scene, by the same build, with the
 * same integrator, controller, their settings and frame rate; threads may differ. Its observers and its wind
 * stay, and it may be cancelled as before; observers are told nothing. Arrays that the sim gave out before
 * are no longer valid. A sim is made beside the present one for it: for the time of the call there are both.
 * With a SUNDIALS without its private headers (docs/checkpoints.md) "ida" starts anew from the state.
 *
 * A file of `drape run --checkpoint-every` is such a one, too. Errors, and then the sim is as it was:
 * DRAPE_E_ARGUMENT (NULL, another model, row or setting), DRAPE_E_VERSION (another build), DRAPE_E_PARSE
 * (damaged, or no checkpoint), DRAPE_E_FILE, DRAPE_E_MEMORY, DRAPE_E_SOLVER. Not for observers.
 * Thread-safety: as the sim. */
DRAPE_API drape_status drape_sim_restore(drape_sim *sim, const char *path);
DRAPE_API drape_status drape_sim_restore_from(drape_sim *sim, const void *bytes, size_t size);

/* ---- Observers ---- */

/* The element or node that an attempt has most to say about. */
typedef struct drape_diagnostic {
    const char *what;    /* "residual", "edge length / rest length", "altitude / rest altitude" ...; "" for
                            none */
    const char *term;    /* the row that found it, "" for a node */
    int32_t element;     /* element number in that term of that cloth; -1 for a node */
    int32_t node[4];     /* its first nodes, numbers of the whole model; -1 past the last */
    int32_t cloth;       /* index of its cloth; -1 for none */
    double value, limit; /* in the unit of what */
} drape_diagnostic;

/* One attempted step. */
typedef struct drape_attempt {
    int64_t index;       /* counts attempts from 0 */
    double t, h;         /* start and size [s] */
    drape_status status; /* > 0 with accepted: on_failure "accept" took an unconverged state */
    const char *reason;  /* "converged", "max_iterations", ...: a short token, static */
    bool accepted;       /* the sim went on from its end; else it was forgotten */
    int iterations;      /* Newton iterations */
    double residual;     /* of the free nodes at the end of the attempt, in the norm of the integrator [N] */
    double tolerance; /* that it was to reach [N]; with the reason "rounding" what rounding alone leaves; NaN:
                         the row promises none */
    drape_diagnostic diagnostic; /* what the attempt has most to say about */
} drape_attempt;

/* What an observer is told about. */
typedef enum drape_event_kind {
    DRAPE_EVENT_ATTEMPT, /* after each attempt was judged; the sim's state is the one kept */
    DRAPE_EVENT_FRAME    /* a frame time was reached: t = 0 at the first advance, then k / frame_rate */
} drape_event_kind;

/* What an observer is told. Valid during the call. */
typedef struct drape_event {
    drape_event_kind kind;        /* what happened */
    drape_sim *sim;               /* to whom */
    const drape_attempt *attempt; /* ATTEMPT only */
    int64_t frame;                /* FRAME: its number from 0 */
    double time;                  /* FRAME [s] */
    const double *positions;  /* FRAME: node_count x 3 [m]; cubic Hermite between the steps around it, or the
                                 straight way, or the nearer of them, where that leads through something */
    const double *velocities; /* FRAME: node_count x 3 [m/s]; linear between the steps around it */
} drape_event;

/* Called within drape_sim_advance. Returns 0 to go on, anything else to stop: the advance then returns
 * DRAPE_E_STOPPED if the value was > 0, else that status, with the message that the observer may have set by
 * drape_context_set_message. An observer must not advance or destroy the sim, nor set its state. */
typedef drape_status drape_observer(void *user, const drape_event *event);

/* Adds an observer; they are called in the order in which they were added, at most 8. Errors:
 * DRAPE_E_ARGUMENT. */
DRAPE_API drape_status drape_sim_observe(drape_sim *sim, drape_observer *observer, void *user);

/* For observers: sets what drape_context_message will say, printf style. */
DRAPE_API void drape_context_set_message(drape_context *ctx, const char *format, ...) DRAPE_PRINTF(2, 3);

DRAPE_C_END

#endif
