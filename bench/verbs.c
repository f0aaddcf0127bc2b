/*
 * verbs: what each function that changes, moves or reads a running sim costs, beside a step. A square sheet
 * of 1 m falls, held by two corners, on a ball with friction, next to a limb of 756 triangles that can
 * deform; it has contact with itself, its nodes are about 1/30 m or 1/100 m apart. For each call the sim is
 * put into the same state, as it is after --settle steps of newton_k, and makes a step of 1/60 s; then
 * comes the call, a step, and the call that takes it back. `cpu_us` is the median of the calls, `steps` the
 * same in steps: those without a call, whose median over the whole run is `step_ms`. `after` is the median of
 * the steps that follow a call, in those that follow none. Calls of less than 1 ms are repeated where that is
 * the same again. CPU time of one thread.
 *
 *     verbs [--csv FILE] [--repeats N] [--side N] [--method NAME] [--only TEXT] [--settle STEPS]
 *         --repeats  pairs of calls (default 4, above 2 500 nodes 2)
 *         --side     nodes along each side: run only this size (default 30 and 100)
 *         --method   run only this method (default newton_k and be)
 *         --only     run only the calls with this text in their names
 *         --settle   steps before the first call (default 60)
 *
 * Run it in the folder that has examples/.
 */
#include "bench.h"

#define STEP        (1.0 / 60)
#define MAX_REPEATS 50
#define MAX_STEPS   (MAX_REPEATS * 100)
#define POINTS      1000 /* of a query with many, and of rays */
#define BALL        0    /* numbers of colliders */
#define LIMB        1
#define ALL_SPRINGS 64

typedef struct bench {
    drape_context *ctx;
    drape_scene *scene;
    drape_model *model, *other; /* other: as the host has compiled it for drape_sim_change_model */
    drape_sim *sim;
    drape_embedding *embedding;
    int side, nodes,
        call; /* call: of this verb, from 0; every other one takes back what the one before did */
    double *vectors, *limb, *energies;           /* of nodes, of points of the limb, of nodes */
    float *vertices;                             /* of the embedding */
    double points[3 * POINTS], rays[3 * POINTS]; /* at random, in and around the sheet */
    drape_hit hits[POINTS];
    drape_contact_point *contacts;
    int32_t middle, room; /* a free node; of contacts */
    double t, *x, *v;     /* the state that each call begins in */
    double steps[MAX_STEPS];
    int step_count;
    char *bytes; /* a checkpoint */
    size_t size, space;
} bench;

static drape_status set(bench *b, const char *pointer, const char *value)
{
    return drape_scene_set(b->scene, pointer, value);
}

/* Sets one of two values by turns and changes the sim. */
static drape_status change(bench *b, const char *pointer, const char *first, const char *second)
{
    const drape_status status = set(b, pointer, b->call == 0 ? first : second);
    return status ? status : drape_sim_change(b->sim, b->scene);
}

/* Appends an item to an array, or removes it, by turns. */
static drape_status change_list(bench *b, const char *array, int index, const char *item)
{
    char pointer[64];
    if (b->call == 0)
        snprintf(pointer, sizeof pointer, "%s/-", array);
    else
        snprintf(pointer, sizeof pointer, "%s/%d", array, index);
    const drape_status status = set(b, pointer, b->call == 0 ? item : NULL);
    return status ? status : drape_sim_change(b->sim, b->scene);
}

/* ---- Changes of the scene ---- */

static drape_status change_nothing(bench *b)
{
    return drape_sim_change(b->sim, b->scene);
}

static drape_status change_gravity(bench *b)
{
    return change(b, "/gravity", "[0, -9, 0]", "[0, -9.81, 0]");
}

static drape_status change_material(bench *b)
{
    return change(b, "/cloth/0/material/young_modulus", "9e5", "1e6");
}

static drape_status change_density(bench *b)
{
    return change(b, "/cloth/0/material/density", "201", "200");
}

static drape_status change_term(bench *b)
{
    return change(b, "/cloth/0/terms/2/coefficient", "0.2", "0.1");
}

static drape_status change_terms(bench *b)
{
    return change_list(b, "/cloth/0/terms", 3, "{\"type\": \"damp.kelvin_voigt\", \"beta\": 1e-3}");
}

static drape_status change_friction(bench *b)
{
    return change(b, "/colliders/0/friction", "0.2", "0.3");
}

static drape_status change_distance(bench *b)
{
    return change(b, "/contact/distance", "0.0035", "0.004");
}

static drape_status change_thickness(bench *b)
{
    return change(b, "/self_contact/thickness", "0.0018", "0.002");
}

static drape_status change_collider(bench *b)
{
    return change_list(b, "/colliders", 2,
                       "{\"type\": \"box\", \"center\": [0, -2, 0], \"size\": [1, 1, 1]}");
}

static drape_status change_enabled(bench *b)
{
    return change(b, "/colliders/1/enabled", "false", "true");
}

static drape_status change_ignore(bench *b)
{
    return change(b, "/cloth/0/ignore", "[\"limb\"]", NULL);
}

static drape_status change_pins(bench *b)
{
    return change_list(b, "/cloth/0/pins", 2, "{\"nodes\": [40]}");
}

static drape_status change_model(bench *b)
{
    return drape_sim_change_model(b->sim, b->call == 0 ? b->other : b->model);
}

/* ---- Nodes ---- */

static drape_status pin(bench *b)
{
    return (b->call == 0 ? drape_sim_pin : drape_sim_unpin)(b->sim, 1, &b->middle);
}

static drape_status attach(bench *b)
{
    return b->call == 0 ? drape_sim_attach(b->sim, BALL, 1, &b->middle, NULL)
                        : drape_sim_detach(b->sim, 1, &b->middle);
}

static drape_status attach_pinned(bench *b)
{
    const int32_t corner = 0;
    return drape_sim_attach(b->sim, b->call == 0 ? BALL : LIMB, 1, &corner, NULL);
}

static drape_status set_masses(bench *b)
{
    const double mass = drape_model_masses(b->model)[b->middle] * (b->call == 0 ? 2 : 1);
    return drape_sim_set_masses(b->sim, 1, &b->middle, &mass);
}

static drape_status move_pins(bench *b)
{
    const int32_t corner = 0;
    const double *x = drape_sim_positions(b->sim), still[3] = {0, 0, 0};
    return drape_sim_move_pins(b->sim, 1, &corner, STEP, x, still);
}

static drape_status set_drag_spring(bench *b)
{
    const double *x = drape_sim_positions(b->sim) + 3 * (size_t)b->middle;
    return drape_sim_set_drag_spring(b->sim, b->middle, 0.1, x);
}

static drape_status set_drag_springs(bench *b)
{
    const double *x = drape_sim_positions(b->sim) + 3 * (size_t)b->middle;
    int32_t nodes[ALL_SPRINGS];
    double stiffness[ALL_SPRINGS], targets[3 * ALL_SPRINGS];
    for (int i = 0; i < ALL_SPRINGS; i++)
        nodes[i] = b->middle, stiffness[i] = 1e-3, memcpy(targets + 3 * i, x, 3 * sizeof *x);
    return drape_sim_set_drag_springs(b->sim, ALL_SPRINGS, nodes, stiffness, targets);
}

static drape_status remove_drag_springs(bench *b)
{
    return drape_sim_set_drag_springs(b->sim, 0, NULL, NULL, NULL);
}

static drape_status push(bench *b)
{
    memset(b->vectors, 0, 3 * (size_t)b->nodes * sizeof *b->vectors);
    b->vectors[3 * (size_t)b->middle + 1] = 1e-4;
    return drape_sim_push(b->sim, b->vectors);
}

static drape_status set_state(bench *b)
{
    return drape_sim_set_state(b->sim, drape_sim_time(b->sim), drape_sim_positions(b->sim),
                               drape_sim_velocities(b->sim));
}

static drape_status place(bench *b)
{
    drape_place_def def;
    drape_place_def_init(&def, sizeof def);
    def.translate[0] = b->call == 0 ? 1 : -1;
    return drape_sim_place(b->sim, &def);
}

static drape_status untangle(bench *b)
{
    return drape_sim_untangle(b->sim, NULL, NULL);
}

/* ---- Colliders, wind ---- */

static drape_status move_collider(bench *b)
{
    const double displacement[3] = {0, 0, 0};
    return drape_sim_move_collider(b->sim, BALL, STEP, displacement, NULL);
}

static drape_status move_collider_pose(bench *b)
{
    const double rotation[4] = {1, 0, 0, 0}, displacement[3] = {0, 0, 0};
    return drape_sim_move_collider_pose(b->sim, BALL, STEP, displacement, rotation, NULL, NULL);
}

static drape_status deform_collider(bench *b)
{
    return drape_sim_deform_collider(b->sim, LIMB, STEP, drape_model_collider_points(b->model, LIMB), b->limb,
                                     NULL);
}

static void calm(void *user, double t, int32_t count, const double *x, double *wind, double *gradient)
{
    (void)user, (void)t, (void)count, (void)x, (void)wind, (void)gradient;
}

static drape_status set_wind(bench *b)
{
    return drape_sim_set_wind(b->sim, calm, NULL);
}

/* ---- Reading ---- */

static drape_status closest_1(bench *b)
{
    return drape_sim_closest(b->sim, DRAPE_QUERY_CLOTH | DRAPE_QUERY_COLLIDERS, 1, b->points, 1, b->hits);
}

static drape_status closest_many(bench *b)
{
    return drape_sim_closest(b->sim, DRAPE_QUERY_CLOTH | DRAPE_QUERY_COLLIDERS, POINTS, b->points, 1,
                             b->hits);
}

static drape_status cast_1(bench *b)
{
    return drape_sim_cast(b->sim, DRAPE_QUERY_CLOTH | DRAPE_QUERY_COLLIDERS, 1, b->points, b->rays, 10,
                          b->hits);
}

static drape_status cast_many(bench *b)
{
    return drape_sim_cast(b->sim, DRAPE_QUERY_CLOTH | DRAPE_QUERY_COLLIDERS, POINTS, b->points, b->rays, 10,
                          b->hits);
}

static drape_status contacts(bench *b)
{
    int32_t count = 0;
    return drape_sim_contacts(b->sim, b->room, b->contacts, &count);
}

static drape_status contact_forces(bench *b)
{
    return drape_sim_contact_forces(b->sim, b->vectors);
}

static drape_status collider_force(bench *b)
{
    double force[3];
    return drape_sim_collider_force(b->sim, BALL, force);
}

static drape_status collider_torque(bench *b)
{
    double torque[3];
    return drape_sim_collider_torque(b->sim, BALL, NULL, torque);
}

static drape_status reactions(bench *b)
{
    return drape_sim_reactions(b->sim, b->vectors);
}

static drape_status normals(bench *b)
{
    drape_sim_normals(b->sim, b->vectors);
    return DRAPE_OK;
}

static drape_status energy(bench *b)
{
    drape_sim_energy(b->sim);
    return DRAPE_OK;
}

static drape_status energy_density(bench *b)
{
    drape_sim_energy_density(b->sim, b->energies);
    return DRAPE_OK;
}

static drape_status inside(bench *b)
{
    return drape_sim_inside(b->sim, BALL, NULL) < 0 ? DRAPE_E_MEMORY : DRAPE_OK;
}

static drape_status intersections(bench *b)
{
    return drape_sim_intersections(b->sim, -1) < 0 ? DRAPE_E_MEMORY : DRAPE_OK;
}

static drape_status collider(bench *b)
{
    double rotation[4];
    drape_sim_collider(b->sim, BALL);
    return drape_sim_collider_rotation(b->sim, BALL, rotation, NULL, NULL) ? DRAPE_OK : DRAPE_E_ARGUMENT;
}

static drape_status collider_points(bench *b)
{
    return drape_sim_collider_points(b->sim, LIMB, b->limb, NULL);
}

static drape_status embedding_create(bench *b)
{
    drape_embedding_destroy(&b->embedding);
    return drape_embedding_create(b->ctx, b->model, 0, b->nodes, b->vertices, NULL, &b->embedding);
}

static drape_status embedding_carry(bench *b)
{
    drape_embedding_carry(b->embedding, drape_sim_positions(b->sim), b->vertices, NULL);
    return DRAPE_OK;
}

static drape_status hash(bench *b)
{
    return drape_sim_hash(b->sim) ? DRAPE_OK : DRAPE_E_ARGUMENT;
}

static drape_status warnings(bench *b)
{
    drape_warning warning;
    for (int i = 0; drape_sim_warning(b->sim, i, &warning);)
        i++;
    return DRAPE_OK;
}

/* ---- Checkpoints ---- */

static drape_status write_bytes(void *user, const void *bytes, size_t size)
{
    bench *b = user;
    if (b->size + size > b->space) {
        b->space = 2 * (b->size + size);
        b->bytes = realloc(b->bytes, b->space);
        if (!b->bytes)
            return DRAPE_E_MEMORY;
    }
    memcpy(b->bytes + b->size, bytes, size);
    b->size += size;
    return DRAPE_OK;
}

static drape_status save(bench *b)
{
    b->size = 0;
    return drape_sim_save_to(b->sim, write_bytes, b);
}

static drape_status restore(bench *b)
{
    return drape_sim_restore_from(b->sim, b->bytes, b->size);
}

/* ---- The table ---- */

typedef struct verb {
    const char *name, *what; /* the function, and what is done with it */
    drape_status (*call)(bench *b);
    bool reads, again;                /* it changes nothing; repeated calls cost the same */
    drape_status (*before)(bench *b); /* not counted; NULL: none */
} verb;

/* Those that only read come first, restore last: what a change leaves, as its memory, costs the later ones
 * nothing. */
static const verb verbs[] = {
    {"drape_sim_closest", "1 point", closest_1, true, true},
    {"drape_sim_closest", "1000 points", closest_many, true, true},
    {"drape_sim_cast", "1 ray", cast_1, true, true},
    {"drape_sim_cast", "1000 rays", cast_many, true, true},
    {"drape_sim_contacts", "all", contacts, true, true},
    {"drape_sim_contact_forces", "", contact_forces, true, true},
    {"drape_sim_collider_force", "the ball", collider_force, true, true},
    {"drape_sim_collider_torque", "the ball", collider_torque, true, true},
    {"drape_sim_reactions", "", reactions, true, true},
    {"drape_sim_normals", "", normals, true, true},
    {"drape_sim_energy", "", energy, true, true},
    {"drape_sim_energy_density", "", energy_density, true, true},
    {"drape_sim_inside", "the ball", inside, true, true},
    {"drape_sim_intersections", "the cloth with itself", intersections, true, true},
    {"drape_sim_collider", "with _collider_rotation", collider, true, true},
    {"drape_sim_collider_points", "380 points", collider_points, true, true},
    {"drape_sim_hash", "", hash, true, true},
    {"drape_sim_warning", "all", warnings, true, false},
    {"drape_embedding_create", "as many vertices as nodes", embedding_create, true, true},
    {"drape_embedding_carry", "as many vertices as nodes", embedding_carry, true, true},
    {"drape_sim_save_to", "", save, true, true},
    {"drape_sim_move_pins", "1 node", move_pins, false, true},
    {"drape_sim_set_drag_spring", "", set_drag_spring, false, true},
    {"drape_sim_set_drag_springs", "64", set_drag_springs, false, true},
    {"drape_sim_set_drag_springs", "none", remove_drag_springs, false, true},
    {"drape_sim_push", "", push, false, true},
    {"drape_sim_set_wind", "", set_wind, false, true},
    {"drape_sim_move_collider", "the ball", move_collider, false, true},
    {"drape_sim_move_collider_pose", "the ball", move_collider_pose, false, true},
    {"drape_sim_deform_collider", "380 points", deform_collider, false, true, collider_points},
    {"drape_sim_set_state", "the same", set_state, false, false},
    {"drape_sim_place", "all", place, false, false},
    {"drape_sim_untangle", "nothing intersects", untangle, false, false},
    {"drape_sim_pin", "and _unpin, 1 node", pin, false, false},
    {"drape_sim_attach", "and _detach, 1 free node", attach, false, false},
    {"drape_sim_attach", "1 pinned node", attach_pinned, false, false},
    {"drape_sim_set_masses", "1 node", set_masses, false, false},
    {"drape_sim_change", "nothing", change_nothing, false, false},
    {"drape_sim_change", "gravity", change_gravity, false, false},
    {"drape_sim_change", "young_modulus", change_material, false, false},
    {"drape_sim_change", "density", change_density, false, false},
    {"drape_sim_change", "coefficient of a term", change_term, false, false},
    {"drape_sim_change", "a term more, and less", change_terms, false, false},
    {"drape_sim_change", "friction of a collider", change_friction, false, false},
    {"drape_sim_change", "distance of contact", change_distance, false, false},
    {"drape_sim_change", "thickness of self-contact", change_thickness, false, false},
    {"drape_sim_change", "a collider more, and less", change_collider, false, false},
    {"drape_sim_change", "enabled of a collider", change_enabled, false, false},
    {"drape_sim_change", "ignore of a cloth", change_ignore, false, false},
    {"drape_sim_change", "a pin more, and less", change_pins, false, false},
    {"drape_sim_change_model", "gravity, compiled before", change_model, false, false},
    {"drape_sim_restore_from", "", restore, false, false, save},
};

#define VERBS ((int)(sizeof verbs / sizeof *verbs))

/* ---- Measuring ---- */

static drape_scene *make_scene(drape_context *ctx, int side)
{
    char text[4096];
    drape_scene *scene = NULL;
    snprintf(text, sizeof text,
             "{'drape':1,'cloth':[{'mesh':{'grid':'square','columns':%d,'rows':%d,'width':1,'height':1,"
             "'transform':{'translate':[-0.5,0,0.5]}},'material':{'young_modulus':1e6,'thickness':1e-3,"
             "'density':200},'terms':['stretch.edge','bend.hinge',{'type':'drag.viscous','coefficient':0.1}],"
             "'pins':[{'corner':'top-left'},{'corner':'top-right'}]}],"
             "'colliders':[{'type':'sphere','center':[0,-0.31,0],'radius':0.3,'friction':0.3,'name':'ball'},"
             "{'type':'animated_mesh','file':'examples/scenes/limb.obj','translate':[0.2,-0.4,0.3],"
             "'name':'limb'}],"
             "'contact':{'distance':0.004},'self_contact':{'thickness':0.002,'friction':0.3},'duration':100}",
             side, side);
    for (char *c = text; *c; c++)
        if (*c == '\'')
            *c = '"';
    if (drape_scene_parse(ctx, text, "bench", &scene))
        bench_fail(ctx, "the scene");
    return scene;
}

static double *room_for(size_t count)
{
    double *room = calloc(count, sizeof *room);
    if (!room)
        exit(1);
    return room;
}

static void open_bench(bench *b, int side, const char *method)
{
    uint32_t random = 1;
    *b = (bench){.ctx = bench_context(), .side = side, .nodes = side * side};
    b->middle = side / 2 * side + side / 2;
    b->scene = make_scene(b->ctx, side);
    drape_scene *lighter = make_scene(b->ctx, side);
    if (drape_scene_set(lighter, "/gravity", "[0, -9, 0]") || drape_scene_compile(lighter, &b->other) ||
        drape_scene_compile(b->scene, &b->model))
        bench_fail(b->ctx, "the scene");
    drape_scene_destroy(&lighter);
    b->sim = bench_sim(b->ctx, b->model, method, NULL, NULL, NULL);
    b->x = room_for(3 * (size_t)b->nodes);
    b->v = room_for(3 * (size_t)b->nodes);
    b->vectors = room_for(3 * (size_t)b->nodes);
    b->energies = room_for((size_t)b->nodes);
    b->limb = room_for(3 * (size_t)drape_model_collider_points(b->model, LIMB));
    b->room = 40 * b->nodes;
    b->contacts = calloc((size_t)b->room, sizeof *b->contacts);
    b->vertices = calloc(3 * (size_t)b->nodes, sizeof *b->vertices);
    if (!b->contacts || !b->vertices)
        exit(1);
    for (int i = 0; i < 3 * b->nodes; i++)
        b->vertices[i] = (float)drape_model_rest_positions(b->model)[i];
    for (int i = 0; i < 3 * POINTS; i++) {
        random = 1664525 * random + 1013904223;
        b->points[i] = random / 4294967296.0 - 0.5;
        random = 1664525 * random + 1013904223;
        b->rays[i] = random / 4294967296.0 - 0.5;
    }
}

static void close_bench(bench *b)
{
    drape_embedding_destroy(&b->embedding);
    drape_sim_destroy(&b->sim);
    drape_model_destroy(&b->model);
    drape_model_destroy(&b->other);
    drape_scene_destroy(&b->scene);
    drape_context_destroy(&b->ctx);
    free(b->vectors), free(b->energies), free(b->limb), free(b->contacts), free(b->vertices), free(b->bytes);
    free(b->x), free(b->v);
}

/* The state that all calls begin in. */
static void find_state(bench *b, int steps)
{
    const size_t size = 3 * (size_t)b->nodes * sizeof(double);
    drape_sim *sim = bench_sim(b->ctx, b->model, "newton_k", NULL, NULL, NULL);
    if (drape_sim_advance(sim, steps * STEP))
        bench_fail(b->ctx, "the first steps");
    b->t = drape_sim_time(sim);
    memcpy(b->x, drape_sim_positions(sim), size);
    memcpy(b->v, drape_sim_velocities(sim), size);
    drape_sim_destroy(&sim);
}

/* [s] CPU time of one step. */
static double step(bench *b)
{
    const double start = drape_clock_cpu_seconds();
    if (drape_sim_advance(b->sim, drape_sim_time(b->sim) + STEP))
        bench_fail(b->ctx, "a step");
    return drape_clock_cpu_seconds() - start;
}

/* The first of the two steps, after which the history of the run is the same for all calls. */
static double begin(bench *b)
{
    if (drape_sim_set_state(b->sim, b->t, b->x, b->v))
        bench_fail(b->ctx, "the state");
    return step(b);
}

/* [s] CPU time of one call. */
static double call(bench *b, const verb *v, int number)
{
    int calls = 0;
    double seconds = 0;
    b->call = number;
    if (v->before && v->before(b))
        bench_fail(b->ctx, "%s", v->name);
    const double start = drape_clock_cpu_seconds();
    do {
        if (v->call(b))
            bench_fail(b->ctx, "%s, %s", v->name, v->what);
        calls++;
        seconds = drape_clock_cpu_seconds() - start;
    } while (v->again && seconds < 1e-3);
    return seconds / calls;
}

static double median(double *of, int count)
{
    qsort(of, (size_t)count, sizeof *of, bench_compare);
    return count % 2 ? of[count / 2] : 0.5 * (of[count / 2 - 1] + of[count / 2]);
}

typedef struct times {
    double call, after; /* [s] medians; after: 0 if it was not measured */
} times;

static times measure(bench *b, const verb *v, int repeats)
{
    double after[MAX_REPEATS] = {0}, of[2 * MAX_REPEATS];
    for (int i = 0; i < repeats; i++) {
        b->steps[b->step_count++] = begin(b);
        of[2 * i] = call(b, v, 0);
        if (!v->reads)
            after[i] = step(b);
        of[2 * i + 1] = call(b, v, 1);
    }
    return (times){median(of, 2 * repeats), median(after, repeats)};
}

static void print(const bench *b, const verb *v, const times *of, const char *method, double unit,
                  double next, FILE *csv)
{
    char after[20] = "";
    if (!v->reads)
        snprintf(after, sizeof after, "%.3f", of->after / next);
    printf("%-9s %6d %-30s %-28s %10.2f %9.3f %9.5f %6s\n", method, b->nodes, v->name, v->what,
           1e6 * of->call, 1e3 * unit, of->call / unit, after);
    fflush(stdout);
    if (!csv)
        return;
    bench_csv_row(csv);
    fprintf(csv, "%s,%d,%s,\"%s\",%.3f,%.4f,%.6f,%s\n", method, b->nodes, v->name, v->what, 1e6 * of->call,
            1e3 * unit, of->call / unit, after);
    fflush(csv);
}

/* [s] median of the second steps, without a call before them. */
static double second_step(bench *b, int repeats)
{
    double of[MAX_REPEATS];
    for (int i = 0; i < repeats; i++) {
        begin(b);
        of[i] = step(b);
    }
    return median(of, repeats);
}

static int measure_all(int side, const char *method, const char *only, int settle, int repeats, FILE *csv)
{
    bench b;
    times of[VERBS];
    bool measured[VERBS] = {false};
    int count = 0;
    open_bench(&b, side, method);
    if (save(&b) || embedding_create(&b) || collider_points(&b))
        bench_fail(b.ctx, "%s", method);
    find_state(&b, settle);
    const double next = second_step(&b, repeats + 1);
    for (int i = 0; i < VERBS; i++) {
        char name[100];
        snprintf(name, sizeof name, "%s %s", verbs[i].name, verbs[i].what);
        if (only && !strstr(name, only))
            continue;
        of[i] = measure(&b, &verbs[i], repeats);
        measured[i] = true;
        count++;
    }
    const double unit = count > 0 ? median(b.steps, b.step_count) : 1;
    for (int i = 0; i < VERBS; i++)
        if (measured[i])
            print(&b, &verbs[i], &of[i], method, unit, next, csv);
    close_bench(&b);
    return count;
}

int main(int argc, char **argv)
{
    static const char usage[] = "verbs [--csv FILE] [--repeats N] [--side N] [--method NAME] [--only TEXT] "
                                "[--settle STEPS]\n";
    static const char *const methods[] = {"newton_k", "be"};
    static const int sides[] = {30, 100};
    const char *file = NULL, *method = NULL, *only = NULL;
    int repeats = 0, side = 0, settle = 60, measured = 0;
    for (int i = 1; i < argc; i++) {
        const int number = i + 1 < argc ? atoi(argv[i + 1]) : 0;
        if (strcmp(argv[i], "--csv") == 0 && i + 1 < argc)
            file = argv[++i];
        else if (strcmp(argv[i], "--repeats") == 0 && number > 0 && number <= MAX_REPEATS)
            repeats = atoi(argv[++i]);
        else if (strcmp(argv[i], "--side") == 0 && number > 7)
            side = atoi(argv[++i]);
        else if (strcmp(argv[i], "--settle") == 0 && number > 0)
            settle = atoi(argv[++i]);
        else if (strcmp(argv[i], "--method") == 0 && i + 1 < argc)
            method = argv[++i];
        else if (strcmp(argv[i], "--only") == 0 && i + 1 < argc)
            only = argv[++i];
        else
            return bench_usage(argv[i], usage);
    }
    FILE *csv = bench_csv(file, "method,nodes,function,what,cpu_us,step_ms,steps,after");
    printf("%-9s %6s %-30s %-28s %10s %9s %9s %6s\n", "method", "nodes", "function", "what", "cpu us",
           "step ms", "steps", "after");
    for (size_t s = 0; s < sizeof sides / sizeof *sides; s++)
        for (size_t m = 0; m < sizeof methods / sizeof *methods; m++) {
            if ((method && strcmp(method, methods[m]) != 0) || (side > 0 && s > 0))
                continue;
            const int nodes = side > 0 ? side : sides[s], calls = repeats > 0 ? repeats : nodes > 50 ? 2 : 4;
            measured += measure_all(nodes, methods[m], only, settle, calls, csv);
        }
    if (measured == 0)
        fputs("no such method or call; see the head of bench/verbs.c\n", stderr);
    return (csv && fclose(csv)) || measured == 0 ? 1 : 0;
}
