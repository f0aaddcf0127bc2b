/*
 * test_extremes.c: every run ends, whatever its scene: it completes, or has a negative status and a true
 * message. No state ever contains NaN, no accepted step has a residual above its tolerance unless it is
 * solved to its local error, no run is retried endlessly.
 *
 * Every case is a variation of one sheet, 8 edges of 0.1 m a side, 1 MPa, 1 mm, 200 kg/m3, pinned at two
 * corners, undamped, so that only the integrator removes the energy that an extreme adds. It runs for 1 s
 * or for the time in the table, for 3 s if DRAPE_SLOW is set.
 */
#include "support/sample.h"
#include "support/scene.h"

#define SIDE      8
#define ROW       (SIDE + 1)
#define EDGE      0.1
#define MAX_NODES 200
#define MAX_PINS  2
#define MAX_KEYS  32
#define PI        3.14159265358979323846

/*
 * More attempts than this are considered a hang. Halving could take 1e7 steps a second before it gives up,
 * each as short as dt_min; the slowest of the cases takes a twentieth of this.
 */
#define MAX_ATTEMPTS(duration) (1000 + 200000 * duration)

/* ---- Meshes and pins in memory ---- */

typedef struct pin_list {
    int32_t node[ROW];
    size_t nodes;
    drape_track_key key[MAX_KEYS];
    size_t keys;
} pin_list;

typedef struct sheet {
    double x[3 * MAX_NODES];
    int32_t triangle[6 * MAX_NODES];
    size_t nodes, triangles;
    pin_list pin[MAX_PINS];
    size_t pins;
} sheet;

static void add_node(sheet *s, double x, double y, double z)
{
    ck_assert(s->nodes < MAX_NODES);
    double *at = s->x + 3 * s->nodes++;
    at[0] = x, at[1] = y, at[2] = z;
}

static void add_triangle(sheet *s, int a, int b, int c)
{
    int32_t *t = s->triangle + 3 * s->triangles++;
    t[0] = a, t[1] = b, t[2] = c;
}

static pin_list *add_pin(sheet *s)
{
    ck_assert(s->pins < MAX_PINS);
    return &s->pin[s->pins++];
}

static void pin_node(pin_list *pin, int node)
{
    pin->node[pin->nodes++] = node;
}

static void pin_row(pin_list *pin, int row)
{
    for (int c = 0; c < ROW; c++)
        pin_node(pin, row * ROW + c);
}

static void move_pin(pin_list *pin, double t, double x, double y, double z)
{
    ck_assert(pin->keys < MAX_KEYS);
    pin->key[pin->keys++] = (drape_track_key){t, {x, y, z}};
}

/* Nodes at (x_c, y_r, z_r), cells split as those of the grid "equilateral". */
static void lattice(sheet *s, const double *x, const double *y, const double *z, double shift)
{
    for (int r = 0; r < ROW; r++)
        for (int c = 0; c < ROW; c++)
            add_node(s, x[c] + (r % 2 ? shift : 0), y[r], z[r]);
    for (int r = 0; r < SIDE; r++)
        for (int c = 0; c < SIDE; c++) {
            const int a = r * ROW + c, b = a + 1, d = a + ROW, e = d + 1;
            add_triangle(s, a, b, r % 2 ? e : d);
            add_triangle(s, r % 2 ? a : b, e, d);
        }
}

static void flat_sheet(sheet *s, bool vertical)
{
    double x[ROW], y[ROW], z[ROW];
    for (int i = 0; i < ROW; i++) {
        const double down = -i * sqrt(3.0) / 2 * EDGE;
        x[i] = i * EDGE;
        y[i] = vertical ? down : 0;
        z[i] = vertical ? 0 : down;
    }
    lattice(s, x, y, z, 0.5 * EDGE);
}

static void hung(sheet *s)
{
    flat_sheet(s, false);
    pin_list *pin = add_pin(s);
    pin_node(pin, 0);
    pin_node(pin, SIDE);
}

/*
 * A disc of 8 rings of 10 nodes, each ring 10^(3/7) times as wide as the one inside: triangles of similar
 * shape, a thousandfold in size, so that masses are a million to one. Pinned at two nodes of the rim, or at
 * the smallest triangles, whose springs are by far too weak for the weight.
 */
#define RINGS  8
#define SPOKES 10

static void disc(sheet *s, bool by_rim)
{
    double radius = 5e-4;
    add_node(s, 0, 0, 0);
    for (int r = 0; r < RINGS; r++) {
        for (int k = 0; k < SPOKES; k++) {
            const double angle = 2 * PI * (k + 0.5 * r) / SPOKES;
            add_node(s, radius * cos(angle), 0, -radius * sin(angle));
        }
        radius *= pow(10, 3.0 / (RINGS - 1));
    }
    for (int k = 0; k < SPOKES; k++)
        add_triangle(s, 0, 1 + k, 1 + (k + 1) % SPOKES);
    for (int r = 0; r + 1 < RINGS; r++)
        for (int k = 0; k < SPOKES; k++) {
            const int a = 1 + r * SPOKES, next = (k + 1) % SPOKES;
            add_triangle(s, a + k, a + SPOKES + k, a + next);
            add_triangle(s, a + next, a + SPOKES + k, a + SPOKES + next);
        }
    pin_list *pin = add_pin(s);
    pin_node(pin, by_rim ? 1 + (RINGS - 1) * SPOKES : 0);
    pin_node(pin, by_rim ? 1 + (RINGS - 1) * SPOKES + 3 : 1);
}

static void disc_by_rim(sheet *s)
{
    disc(s, true);
}

static void disc_by_centre(sheet *s)
{
    disc(s, false);
}

/* Node 1 is moved onto its neighbour, the pinned node 0. */
static void collapsing(sheet *s)
{
    flat_sheet(s, false);
    pin_node(add_pin(s), 0);
    pin_list *pin = add_pin(s);
    pin_node(pin, 1);
    move_pin(pin, 0.1, 0, 0, 0);
    move_pin(pin, 0.2, -EDGE, 0, 0);
}

/*
 * A triangle whose altitude is slightly above the limit of validation, 1e-12 of its longest edge, between a
 * wide one and the rim.
 */
static void sliver(sheet *s)
{
    add_node(s, 0, 0, 0);
    add_node(s, 1, 0, 0);
    add_node(s, 0.5, 0, 1.1e-12);
    add_node(s, 0.5, 0, 1);
    add_triangle(s, 0, 2, 1);
    add_triangle(s, 0, 3, 2);
    add_triangle(s, 2, 3, 1);
    pin_list *pin = add_pin(s);
    pin_node(pin, 0);
    pin_node(pin, 1);
}

/*
 * Row 1 is pinned; row 2 is moved around it by 4 rad, so that the hinges between fold onto themselves and
 * through, and the free rows follow.
 */
static void folding(sheet *s)
{
    const double row = sqrt(3.0) / 2 * EDGE;
    flat_sheet(s, false);
    pin_list *held = add_pin(s), *moved = add_pin(s);
    pin_row(moved, 2);
    pin_row(held, 1);
    for (int i = 0; i <= 20; i++) {
        const double angle = 0.2 * i;
        move_pin(moved, 0.04 * i, 0, row * sin(angle), row * (1 - cos(angle)));
    }
}

static void edge_on(sheet *s)
{
    flat_sheet(s, true);
}

/* It stands on its lowest row, which is pinned. */
static void edge_on_foot(sheet *s)
{
    flat_sheet(s, true);
    pin_row(add_pin(s), SIDE);
}

static void jumping(sheet *s)
{
    hung(s);
    move_pin(&s->pin[0], 0.1, 0, 0, 0);
    move_pin(&s->pin[0], 0.1 + 1e-9, 0, 1, 0);
}

/* ---- Initial states that are not at rest ---- */

/*
 * Moves every free node by up to 0.4 edges in every direction; the generator is the example in the C
 * standard.
 */
static void crumple(scene *s)
{
    unsigned state = 20240;
    for (int32_t i = 0; i < s->model->node_count; i++)
        for (int k = 0; k < 3; k++) {
            state = state * 1103515245U + 12345U;
            const double random = (double)(state / 65536U % 32768U) / 32767;
            if (!s->model->pinned[i])
                scene_state(s)->x[3 * i + k] += 0.8 * EDGE * (random - 0.5);
        }
}

static void bring_together(scene *s, double share)
{
    const int a = 4 * ROW + 4, b = a + 1;
    for (int k = 0; k < 3; k++) {
        double *x = scene_state(s)->x;
        x[3 * b + k] = x[3 * a + k] + share * (x[3 * b + k] - x[3 * a + k]);
    }
}

static void collapse(scene *s)
{
    bring_together(s, 0);
}

static void nearly_collapse(scene *s)
{
    bring_together(s, 1e-9);
}

/* ---- The table ---- */

enum { BE = 1, BDF2 = 2, MIDPOINT = 4, IDA = 8, TRBDF2 = 16, DIRK = 32, EVERY = 63 };
#define CONTROLLED (IDA | DIRK) /* methods that bound the local error */

typedef struct extreme {
    const char *name;
    double modulus, thickness, gravity, dt; /* 0: as above; gravity: NaN for none */
    double duration;                        /* [s]; 0: 1 */
    double speed;                           /* [m/s] downwards at the start */
    void (*mesh)(sheet *);                  /* NULL: pinned at two corners */
    void (*start)(scene *);                 /* NULL: at rest */
    unsigned stops;  /* integrators that may stop with a message; all others must end ok */
    unsigned crawls; /* integrators that run 3 times duration, not 3 s, if DRAPE_SLOW is set */
    unsigned brief;  /* integrators that run a thousandth of duration: dirk follows a crumpled start in
                         steps of 0.1 us, two of three of them rejected, 2e6 of them in all */
} extreme;

/*
 * The integrators that may stop, and why. midpoint damps nothing: waves of a sheet at 1 MPa or more that
 * the step does not resolve, or that follow an impact, persist, and sooner or later a triangle passes
 * through itself in its plane. There its normal turns by pi however small the step is, and the branch of
 * the hinge is a guess: "hinge_branch", "altitude_collapse", "max_iterations" at dt_min. IDA resolves the
 * motion and may reach the same. An edge that starts below min_length is still below it in the small first
 * steps of IDA. A spring has no direction if its edge has length 0 at the start or at the end.
 *
 * The integrators that crawl: the smallest triangles of the disc weigh 10 ug and are finally whirled about
 * by the rest. IDA follows each of their turns with steps of 0.2 us, 4e6 a second, until max_steps ends it;
 * midpoint advances in steps of that size.
 */
static const extreme extremes[] = {
    {.name = "E 1 Pa", .modulus = 1},
    {.name = "E 1e3 Pa", .modulus = 1e3},
    {.name = "E 1e6 Pa", .modulus = 1e6, .stops = MIDPOINT},
    {.name = "E 1e9 Pa", .modulus = 1e9, .stops = MIDPOINT},
    {.name = "E 1e12 Pa", .modulus = 1e12, .stops = MIDPOINT},
    {.name = "dt 1e-6 s", .dt = 1e-6, .duration = 1e-4},
    {.name = "dt 1e-4 s", .dt = 1e-4, .duration = 0.01},
    {.name = "dt 0.1 s", .dt = 0.1, .stops = MIDPOINT},
    {.name = "dt 1 s", .dt = 1, .stops = MIDPOINT},
    {.name = "masses 1 to 1e6", .mesh = disc_by_rim, .duration = 0.25, .stops = MIDPOINT | CONTROLLED},
    {.name = "masses 1e6, hung by centre",
     .mesh = disc_by_centre,
     .duration = 0.1,
     .stops = EVERY,
     .crawls = MIDPOINT},
    {.name = "thickness 1e-6 m", .thickness = 1e-6, .stops = MIDPOINT},
    {.name = "thickness 1e-5 m", .thickness = 1e-5, .stops = MIDPOINT},
    {.name = "thickness 1e-4 m", .thickness = 1e-4, .stops = MIDPOINT},
    {.name = "thickness 1e-2 m", .thickness = 1e-2, .stops = MIDPOINT},
    {.name = "thickness 1e-1 m", .thickness = 1e-1},
    {.name = "gravity 0", .gravity = NAN},
    {.name = "gravity 1 m/s2", .gravity = 1},
    {.name = "gravity 1e2 m/s2", .gravity = 1e2, .duration = 0.3, .stops = MIDPOINT},
    {.name = "gravity 1e4 m/s2", .gravity = 1e4, .duration = 0.2, .stops = MIDPOINT | CONTROLLED},
    {.name = "edge collapsed by a track", .mesh = collapsing, .stops = EVERY},
    {.name = "edge collapsed at start", .start = collapse, .stops = EVERY},
    {.name = "edge of 1e-9 at start",
     .start = nearly_collapse,
     .duration = 0.2,
     .stops = MIDPOINT | TRBDF2 | CONTROLLED}, /* the trapezoidal stage of trbdf2 behaves as midpoint */
    {.name = "altitude 1.1e-12", .mesh = sliver, .stops = MIDPOINT | DIRK},
    {.name = "hinge folded through pi", .mesh = folding, .stops = MIDPOINT},
    {.name = "edge-on, falling", .mesh = edge_on, .speed = 1},
    {.name = "edge-on, on its foot", .mesh = edge_on_foot, .speed = 2, .stops = MIDPOINT},
    {.name = "crumpled start",
     .start = crumple,
     .duration = 0.2,
     .stops = MIDPOINT | CONTROLLED,
     .brief = DIRK},
    {.name = "pins jump 1 m in 1 ns", .mesh = jumping, .duration = 0.2, .stops = MIDPOINT | CONTROLLED},
};

#define EXTREMES (sizeof extremes / sizeof *extremes)

/* ---- A run ---- */

static double or_else(double value, double otherwise)
{
    return value > 0 ? value : otherwise;
}

static drape_status make_model(scene *s, const extreme *c, const sheet *mesh)
{
    const drape_setting material[] = {{"young_modulus", or_else(c->modulus, 1e6), NULL},
                                      {"thickness", or_else(c->thickness, 1e-3), NULL},
                                      {"density", 200, NULL}};
    const drape_entry_def terms[] = {{"stretch.edge", NULL, 0}, {"bend.hinge", NULL, 0}};
    drape_pin_def pins[MAX_PINS];
    drape_cloth_def cloth = cloth_def();
    drape_scene_def def = scene_def();
    for (size_t i = 0; i < mesh->pins; i++) {
        drape_pin_def_init(&pins[i], sizeof pins[i]);
        pins[i].nodes = mesh->pin[i].node;
        pins[i].node_count = mesh->pin[i].nodes;
        pins[i].track = mesh->pin[i].keys > 0 ? mesh->pin[i].key : NULL;
        pins[i].key_count = mesh->pin[i].keys;
    }
    cloth.mesh.positions = mesh->x;
    cloth.mesh.node_count = mesh->nodes;
    cloth.mesh.triangles = mesh->triangle;
    cloth.mesh.triangle_count = mesh->triangles;
    cloth.material = material;
    cloth.material_count = 3;
    cloth.terms = terms;
    cloth.term_count = 2;
    cloth.pins = pins;
    cloth.pin_count = mesh->pins;
    cloth.velocity[1] = -c->speed;
    def.cloths = &cloth;
    def.cloth_count = 1;
    def.gravity[1] = isnan(c->gravity) ? 0 : -or_else(c->gravity, 9.81);
    return drape_model_create(s->ctx, &def, &s->model);
}

/* What the attempts of a run reported. */
typedef struct outcome {
    scene *scene;
    long attempts, accepted, rejected, unconverged, nonfinite, silent;
    drape_attempt last;
    bool bounded;    /* the integrator bounds a residual */
    double duration; /* [s] */
} outcome;

static bool all_finite(const double *a, int32_t nodes)
{
    double probe = 0;
    for (int32_t i = 0; i < 3 * nodes; i++)
        probe += 0 * a[i];
    return probe == 0;
}

static drape_status note(void *user, const drape_event *event)
{
    outcome *o = user;
    const int32_t nodes = o->scene->model->node_count;
    const drape_attempt *a = event->attempt;
    if (event->kind == DRAPE_EVENT_FRAME) {
        o->nonfinite += !all_finite(event->positions, nodes);
        return DRAPE_OK;
    }
    o->attempts++;
    o->accepted += a->accepted;
    o->rejected += !a->accepted;
    o->unconverged +=
        a->accepted && (a->status != DRAPE_OK || (o->bounded && strcmp(a->reason, "local_error") != 0 &&
                                                  !(a->residual <= a->tolerance)));
    o->silent += !a->reason || !*a->reason || !(a->h > 0) || (!a->accepted && a->status == DRAPE_OK);
    o->nonfinite += !all_finite(drape_sim_positions(o->scene->sim), nodes) ||
                    !all_finite(drape_sim_velocities(o->scene->sim), nodes);
    o->last = *a;
    return o->attempts < MAX_ATTEMPTS(o->duration) ? DRAPE_OK : DRAPE_RETRY_REJECTED;
}

/* Whether the message is one line "t=... h=...: reason (status) ..." with the time of the present state. */
static bool message_is_true(const outcome *o)
{
    char start[80];
    const char *message = drape_context_message(o->scene->ctx);
    snprintf(start, sizeof start, "t=%.9g h=%.4g: %s (%s) after ", drape_sim_time(o->scene->sim), o->last.h,
             o->last.reason, drape_status_name(o->last.status));
    return strncmp(message, start, strlen(start)) == 0 && !strchr(message, '\n') &&
           (o->last.diagnostic.node[0] < 0 || strstr(message, " of cloth0): "));
}

static double duration_of(const extreme *c, unsigned bit)
{
    const double duration = or_else(c->duration, 1);
    if (c->brief & bit)
        return 1e-3 * duration;
    if (!getenv("DRAPE_SLOW") || (c->dt > 0 && c->dt < 1e-3))
        return duration;
    return c->crawls & bit ? 3 * duration : 3;
}

/* The fault of an outcome; NULL: none. */
static const char *complaint(const extreme *c, const outcome *o, drape_status status, unsigned bit)
{
    const drape_statistics done = drape_sim_statistics(o->scene->sim);
    if (status > 0 || status == DRAPE_E_STOPPED)
        return "tried without end";
    if (o->nonfinite > 0)
        return "had a state that is not a number";
    if (o->unconverged > 0)
        return "accepted a step above its tolerance";
    if (o->silent > 0 || done.steps_accepted + done.steps_rejected != o->attempts)
        return "had an attempt without a reason";
    if (status == DRAPE_OK)
        return drape_sim_time(o->scene->sim) == o->duration ? NULL : "did not reach the end";
    if (!message_is_true(o))
        return "stopped with an untrue message";
    return c->stops & bit ? NULL : "stopped";
}

static bool run(const extreme *c, const char *method, unsigned bit)
{
    static sheet mesh;
    scoped_scene s = scene_empty();
    const drape_setting settings[] = {{"dt", or_else(c->dt, 1.0 / 60), NULL}};
    drape_sim_def def = sim_def();
    outcome o = {.scene = &s, .bounded = !(bit & CONTROLLED), .duration = duration_of(c, bit)};
    memset(&mesh, 0, sizeof mesh);
    c->mesh ? c->mesh(&mesh) : hung(&mesh);
    ck_assert_msg(make_model(&s, c, &mesh) == DRAPE_OK, "%s: %s", c->name, drape_context_message(s.ctx));
    def.integrator = method;
    def.controller = "halving";
    def.integrator_settings = settings;
    def.integrator_setting_count = 1;
    scene_start(&s, &def);
    if (c->start)
        c->start(&s);
    ck_assert_int_eq(drape_sim_observe(s.sim, note, &o), DRAPE_OK);

    const drape_status status = drape_sim_advance(s.sim, duration_of(c, bit));
    const drape_statistics done = drape_sim_statistics(s.sim);
    printf("# %-9s %-26s %-16s t %-9.4g %5ld accepted %5ld rejected %6lld iterations, h from %.3g s%s%s\n",
           method, c->name, drape_status_name(status), drape_sim_time(s.sim), o.accepted, o.rejected,
           (long long)done.newton_iterations, done.h_min, status ? "; " : "",
           status ? drape_context_message(s.ctx) : "");

    const char *wrong = complaint(c, &o, status, bit);
    if (wrong)
        printf("# %s, %s: %s\n", c->name, method, wrong);
    return !wrong;
}

static void run_all(const char *method, unsigned bit)
{
    size_t number = 0; /* of the method */
    int runs = 0, good = 0;
    while (1U << number < bit)
        number++;
    for (size_t i = 0; i < EXTREMES; i++)
        if (in_sample(i, number, 2)) {
            good += run(&extremes[i], method, bit);
            runs++;
        }
    ck_assert_msg(good == runs, "%d of %d: see above", runs - good, runs);
}

TEST(be_ends_whatever_the_scene_is)
{
    run_all("be", BE);
}

TEST(bdf2_ends_whatever_the_scene_is)
{
    run_all("bdf2", BDF2);
}

TEST(midpoint_ends_whatever_the_scene_is)
{
    run_all("midpoint", MIDPOINT);
}

TEST(trbdf2_ends_whatever_the_scene_is)
{
    run_all("trbdf2", TRBDF2);
}

TEST(ida_ends_whatever_the_scene_is)
{
    run_all("ida", IDA);
}

TEST(dirk_ends_whatever_the_scene_is)
{
    run_all("dirk", DIRK);
}

/*
 * The report's triangle with an altitude of 1e-12 is at the limit of validation: below it is refused and
 * named.
 */
TEST(validation_refuses_an_altitude_below_1e_12)
{
    static sheet mesh;
    scoped_scene s = scene_empty();
    memset(&mesh, 0, sizeof mesh);
    sliver(&mesh);
    mesh.x[8] = 0.9e-12;
    ck_assert_int_eq(make_model(&s, &extremes[0], &mesh), DRAPE_E_ARGUMENT);
    ck_assert_ptr_null(s.model);
    ck_assert_msg(strstr(drape_context_message(s.ctx), "triangle 0 (nodes 0 2 1) is degenerate"), "%s",
                  drape_context_message(s.ctx));
}
