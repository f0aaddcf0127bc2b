/*
 * realtime: frames of 1/60 s with contact, within a budget. Six scenes, in each of which the cloth is moved
 * as by a host, frame by frame:
 *     sphere, capsule  a sheet of 1 m with 50 x 50 nodes hung by two corners, and a body that goes through
 *                      its place and back at 2 m/s all the time; the budget is a frame
 *     ball             the same with 30 x 30 nodes and a ball at up to 1.8 m/s; the budget is 4 ms
 *     capes            three capes of 30 x 30 nodes, each a sim of its own with a third of a frame, pinned to
 *                      the shoulders of a body of six capsules that walks, turns back and bobs; in a tenth of
 *                      the frames, drawn at random, the budget is a tenth, and in the middle of the run body
 *                      and cape are placed 6 m away (drape_sim_place)
 *     elbow            an arm and a forearm, two capsules that overlap at the elbow, bend to 150 degrees and
 *                      straighten in 3 s, and pinch a sheet of 0.3 m with 16 x 16 nodes that lies over them
 *     pinch            two balls close upon the middle of a hung sheet of 0.5 m with 30 x 30 nodes, overlap
 *                      by 4 cm for half a second, and part, every 2 s
 * A frame is missed if its call took longer than its budget; starved ones are not counted.
 * `behind` is how long bodies are, relative to pins, behind where they are sent, after time was dropped.
 * `strain` is the largest of any edge at the end of a frame, `apart` that of edges without a node that is
 * relaxed, because bodies leave it no room, or was in the half second before, `inside` the depth of cloth in
 * a body, `crossings` the number of edges through triangles of the cloth, each the largest of all frames.
 * `recovery` is the number of frames from the placing on until there is one with nothing inside of a body and
 * no more strain than in the second before, of the sim that takes longest; -1: nothing is placed, or there is
 * none. `still` is the largest number of calls in a row after which time was what it had been, `bodies` the
 * number of those that the lists of relaxed nodes named.
 *
 * Time: the clock of the library is replaced by the CPU time of the process, so that waiting for the
 * processor does not matter, divided by how much longer than its fastest a fixed piece of work, evaluations
 * of the forces of a sheet of 30 x 30 nodes, takes at the moment, because programs that share caches and
 * cores slow CPU time down, too. What remains of such noise changes which frames are missed by some per cent.
 * The frames that are starved follow from --seed alone.
 *
 *     realtime [--csv FILE] [--seconds S] [--scene NAME] [--contact NAME] [--seed N] [--slower F] [--be]
 *
 * --slower multiplies the budgets, for a machine that is so many times slower than the one that they are
 * meant for. --be adds the converged steps, which take minutes. After the measurements each requirement on
 * the scenes that were measured is listed with what was found: met, or not.
 */
#define _GNU_SOURCE
#include "bench.h"

#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#define FRAME      (1.0 / 60)
#define MAX_FRAMES 4000
#define TELEPORT   10.0 /* [s] */
#define MAX_NODES  2500
#define PINCHED    0.5 /* [s] after which a node that was relaxed counts among the others */
#define BODIES     6
#define CAPES      3
#define MATERIAL                                                                                             \
    "'material': {'young_modulus': 968245.8365518542, 'poisson_ratio': 0.3333333333333333, 'thickness': "    \
    "1.0327955589886444e-3, 'areal_density': 0.2}, 'terms': ['stretch.edge', 'bend.hinge']"

/* ---- The clock ---- */

#define PIECES 9 /* of the reference work: the median of so many tells how slow the machine is */

static struct {
    double slowness;      /* of the machine at the moment, >= 1 */
    double cpu, shown;    /* [s] of the process, and of the clock, when that was measured */
    double fastest;       /* [s] of the reference work so far */
    double taken[PIECES]; /* [s] by the last pieces */
    int pieces;
} speed = {.slowness = 1, .fastest = INFINITY};

static double cpu_seconds(void)
{
    struct timespec t;
    syscall(SYS_clock_gettime, CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static double shown_seconds(double cpu)
{
    return speed.shown + (cpu - speed.cpu) / speed.slowness;
}

int clock_gettime(clockid_t id, struct timespec *t)
{
    if (id != CLOCK_MONOTONIC)
        return (int)syscall(SYS_clock_gettime, id, t);
    const double shown = shown_seconds(cpu_seconds());
    t->tv_sec = (time_t)shown;
    t->tv_nsec = (long)(1e9 * (shown - (double)t->tv_sec));
    return 0;
}

/* One more piece of the reference work. */
static void measure_speed(drape_sim *reference)
{
    static double g[3 * 900];
    const drape_state *state = drape_sim_state(reference);
    const drape_point point = {.x = state->x, .v = state->v, .internal = state->internal, .t = state->t};
    const double start = cpu_seconds();
    for (int i = 0; i < 3; i++)
        drape_system_force(reference->system, &point, g);
    const double end = cpu_seconds();
    speed.taken[speed.pieces++ % PIECES] = end - start;
    speed.fastest = fmin(speed.fastest, end - start);
    if (speed.pieces < PIECES)
        return;
    double sorted[PIECES];
    memcpy(sorted, speed.taken, sizeof sorted);
    qsort(sorted, PIECES, sizeof *sorted, bench_compare);
    speed.shown = shown_seconds(end);
    speed.cpu = end;
    speed.slowness = sorted[PIECES / 2] / speed.fastest;
}

/* ---- The scenes ---- */

typedef struct scene scene;

/* Sends the bodies, and pins if they move, to where they are at time t, within `seconds`. */
typedef drape_status move_bodies(const scene *s, drape_sim *sim, int which, double t, double seconds);

struct scene {
    const char *name, *text; /* %s: the settings of contact */
    move_bodies *move;
    int sims;
    double seconds, speed; /* [s], [m/s] of the bodies */
    double budget;         /* [s] of each sim */
    double starved;        /* share of the frames that have a tenth of the budget */
    bool placed;           /* at TELEPORT, by `away` */
};

static const double away[3] = {5, 1, 3}; /* [m] */

/* From 0.6 to -0.6 and back at constant speed. */
static double there_and_back(double path)
{
    const double at = fmod(path, 2.4);
    return at < 1.2 ? 0.6 - at : at - 1.8;
}

static drape_status sweep(const scene *s, drape_sim *sim, int which, double t, double seconds)
{
    const double to[3] = {0, 0, there_and_back(s->speed * t)};
    (void)which;
    return drape_sim_move_collider(sim, 0, seconds, to, NULL);
}

/* At most the speed: a sine. */
static drape_status swing(const scene *s, drape_sim *sim, int which, double t, double seconds)
{
    const double to[3] = {0, 0, 0.5 * cos(2 * s->speed * t)};
    (void)which;
    return drape_sim_move_collider(sim, 0, seconds, to, NULL);
}

/* Walks 2 m there and back in 4 s, with a bob and a sway of each step, legs and arms in opposite phase. */
static drape_status walk(const scene *s, drape_sim *sim, int which, double t, double seconds)
{
    static int32_t pins[30];
    static double at[90];
    const double turn = 2 * acos(-1) * t, phase = 0.7 * which;
    const double body[3] = {0.03 * sin(turn + phase), 0.03 * cos(2 * turn + phase) - 0.03 * cos(phase),
                            s->speed * (1 - cos(turn / 4 + phase) - 1 + cos(phase)) * 4 / (2 * acos(-1))};
    const double stride = 0.2 * (sin(turn + phase) - sin(phase)), far = t > TELEPORT;
    drape_status status = DRAPE_OK;
    for (int i = 0; i < BODIES && !status; i++) {
        const double sign = i < 2 ? 0 : i == 2 || i == 5 ? 1 : -1;
        const double to[3] = {body[0] + far * away[0], body[1] + far * away[1],
                              body[2] + sign * stride + far * away[2]};
        status = drape_sim_move_collider(sim, i, seconds, to, NULL);
    }
    for (int i = 0; i < 30; i++) {
        pins[i] = i;
        at[3 * i] = -0.25 + 0.5 * i / 29 + body[0] + far * away[0];
        at[3 * i + 1] = 1.45 + body[1] + far * away[1];
        at[3 * i + 2] = -0.16 + body[2] + far * away[2];
    }
    return status ? status : drape_sim_move_pins(sim, 30, pins, seconds, at, NULL);
}

/* Half a second of rest, a second to bend to 150 degrees, a second to straighten, and half of rest. */
static drape_status bend(const scene *s, drape_sim *sim, int which, double t, double seconds)
{
    static const double still[3] = {0, 0, 0};
    const double at = fmod(t, 3), share = fmin(fmax(at < 1.5 ? at - 0.5 : 2.5 - at, 0), 1),
                 half = share * 75 * acos(-1) / 180;
    const double rotation[4] = {cos(half), 0, 0, sin(half)};
    (void)s, (void)which;
    return drape_sim_move_collider_pose(sim, 1, seconds, still, rotation, NULL, NULL);
}

/* Both balls come 0.14 m nearer in 0.4 s, stay for half a second, and go back. */
static drape_status pinch(const scene *s, drape_sim *sim, int which, double t, double seconds)
{
    const double at = fmod(t, 2), share = fmin(fmax(at < 0.75 ? at / 0.4 : (1.3 - at) / 0.4, 0), 1);
    drape_status status = DRAPE_OK;
    (void)s, (void)which;
    for (int i = 0; i < 2 && !status; i++) {
        const double to[3] = {0, 0, (i == 0 ? 0.14 : -0.14) * share};
        status = drape_sim_move_collider(sim, i, seconds, to, NULL);
    }
    return status;
}

#define HUNG(side)                                                                                           \
    "'cloth': [{'mesh': {'grid': 'square', 'columns': " #side ", 'rows': " #side                             \
    ", 'width': 1, 'height': 1, 'orientation': 'vertical', 'transform': {'translate': [-0.5, 0, "            \
    "0]}}, " MATERIAL ", 'pins': [{'corner': 'top-left'}, {'corner': 'top-right'}]}]"

static const scene scenes[] = {
    {"sphere",
     "{'drape': 1, " HUNG(50) ", 'colliders': [{'type': 'sphere', 'center': [0, -0.6, 0], 'radius': 0.2, "
                              "'friction': 0.3}], %s 'duration': 100}",
     sweep, 1, 6, 2, FRAME, 0, false},
    {"capsule",
     "{'drape': 1, " HUNG(50) ", 'colliders': [{'type': 'capsule', 'a': [-0.25, -0.6, 0], 'b': [0.25, -0.5, "
                              "0], 'radius': 0.12, 'friction': 0.3}], %s 'duration': 100}",
     sweep, 1, 6, 2, FRAME, 0, false},
    {"ball",
     "{'drape': 1, " HUNG(30) ", 'colliders': [{'type': 'sphere', 'center': [0, -0.6, 0], 'radius': 0.2, "
                              "'friction': 0.3}], %s 'duration': 100}",
     swing, 1, 6, 1.8, 4e-3, 0, false},
    {"capes",
     "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 30, 'rows': 30, 'width': 0.5, 'height': "
     "1, "
     "'orientation': 'vertical', 'transform': {'translate': [-0.25, 1.45, -0.16]}}, " MATERIAL
     ", 'pins': [{'row': 0}]}], 'colliders': ["
     "{'type': 'capsule', 'a': [0, 0.95, 0], 'b': [0, 1.3, 0], 'radius': 0.13, 'friction': 0.3},"
     "{'type': 'sphere', 'center': [0, 1.6, 0], 'radius': 0.11, 'friction': 0.3},"
     "{'type': 'capsule', 'a': [-0.09, 0.1, 0], 'b': [-0.09, 0.85, 0], 'radius': 0.08, 'friction': 0.3},"
     "{'type': 'capsule', 'a': [0.09, 0.1, 0], 'b': [0.09, 0.85, 0], 'radius': 0.08, 'friction': 0.3},"
     "{'type': 'capsule', 'a': [-0.24, 0.8, 0], 'b': [-0.2, 1.35, 0], 'radius': 0.05, 'friction': 0.3},"
     "{'type': 'capsule', 'a': [0.24, 0.8, 0], 'b': [0.2, 1.35, 0], 'radius': 0.05, 'friction': 0.3}], %s "
     "'duration': 100}",
     walk, CAPES, 20, 1.5, FRAME / CAPES, 0.1, true},
    {"elbow",
     "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 16, 'rows': 16, 'width': 0.3, 'height': "
     "0.3, 'transform': {'translate': [-0.15, 0.046, 0.15]}}, " MATERIAL
     ", 'pins': [{'edge': 'left'}]}], 'colliders': ["
     "{'type': 'capsule', 'a': [-0.3, 0, 0], 'b': [0, 0, 0], 'radius': 0.04, 'friction': 1},"
     "{'type': 'capsule', 'a': [0, 0, 0], 'b': [0.24, 0, 0], 'radius': 0.04, 'friction': 1, 'pivot': [0, 0, "
     "0]}], %s 'duration': 100}",
     bend, 1, 6, 0, FRAME, 0, false},
    {"pinch",
     "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 30, 'rows': 30, 'width': 0.5, 'height': "
     "0.5, 'orientation': 'vertical', 'transform': {'translate': [-0.25, 0.5, 0]}}, " MATERIAL
     ", 'pins': [{'corner': 'top-left'}, {'corner': 'top-right'}]}], 'colliders': ["
     "{'type': 'sphere', 'center': [0, 0.25, -0.22], 'radius': 0.1, 'friction': 0.3},"
     "{'type': 'sphere', 'center': [0, 0.25, 0.22], 'radius': 0.1, 'friction': 0.3}], %s 'duration': 100}",
     pinch, 1, 6, 0, FRAME, 0, false},
};
#define SCENES ((int)(sizeof scenes / sizeof *scenes))

typedef struct variant {
    const char *name, *contact;
    bool self;
} variant;

static const variant variants[] = {
    {"default", "", false},
    {"30 mm", "'contact': {'distance': 0.03},", false},
    {"self", "'self_contact': {'thickness': 0.004, 'friction': 0.3},", true},
};
#define VARIANTS ((int)(sizeof variants / sizeof *variants))

/* ---- A run ---- */

typedef struct result {
    double ms[MAX_FRAMES];
    int frames, missed, starved, errors, recovery, still, bodies;
    double dropped, strain, apart, inside, behind;
    bool named[BODIES];
    int64_t crossings, attempts, rejected;
    double contact; /* share of the time of steps */
} result;

/* The largest strain of an edge, and of those that are not pinched. */
static double strain_of(const drape_sim *sim, const double *pinched, double *apart)
{
    const drape_model *m = sim->model;
    const double *x = drape_sim_positions(sim), since = drape_sim_time(sim) - PINCHED;
    double largest = 0;
    for (int32_t e = 0; e < m->edge_count; e++) {
        const int32_t *n = m->edge + 2 * e;
        const double *a = x + 3 * (size_t)n[0], *b = x + 3 * (size_t)n[1];
        const double d[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
        const double strain = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) / m->edge_length[e] - 1;
        largest = fmax(largest, strain);
        if (pinched[n[0]] < since && pinched[n[1]] < since)
            *apart = fmax(*apart, strain);
    }
    return largest;
}

/* Returns the strain, INFINITY if there is cloth inside of a body. pinched: [s] (nodes) when each was relaxed
 * last. */
static double examine(const drape_sim *sim, bool self, double *pinched, result *r)
{
    drape_relaxed relaxed;
    for (int32_t i = 0; i < drape_sim_relaxed(sim, i, &relaxed); i++) {
        pinched[relaxed.node] = drape_sim_time(sim);
        if (relaxed.collider >= 0 && !r->named[relaxed.collider]) {
            r->named[relaxed.collider] = true;
            r->bodies++;
        }
    }
    double strain = strain_of(sim, pinched, &r->apart);
    r->strain = fmax(r->strain, strain);
    for (int32_t c = 0; c < sim->model->collider_count; c++) {
        double deepest = 0;
        if (drape_sim_inside(sim, c, &deepest) == 0)
            continue;
        r->inside = fmax(r->inside, deepest);
        strain = INFINITY;
    }
    const int64_t crossings = self ? drape_sim_intersections(sim, -1) : 0;
    r->crossings = crossings > r->crossings ? crossings : r->crossings;
    return strain;
}

static double draw(uint64_t *seed)
{
    *seed = *seed * 6364136223846793005u + 1442695040888963407u;
    return (double)(*seed >> 11) / 9007199254740992.0;
}

static double slower = 1;

/* A sim of the run, and what its recovery is judged by. */
typedef struct one {
    drape_sim *sim;
    double debt;               /* [s] */
    double pinched[MAX_NODES]; /* [s] (nodes) */
    double before;             /* the largest strain in the second before it was placed */
    int recovery;              /* frames; -1: not yet */
    int still;                 /* calls since time went on last */
} one;

static void judge_recovery(one *o, double t, double strain)
{
    if (t <= TELEPORT && t > TELEPORT - 1)
        o->before = fmax(o->before, strain);
    if (t > TELEPORT && o->recovery < 0 && strain <= o->before)
        o->recovery = (int)((t - TELEPORT) / FRAME + 0.5);
}

static void place(drape_context *ctx, drape_sim *sim)
{
    drape_place_def def;
    drape_place_def_init(&def, sizeof def);
    memcpy(def.translate, away, sizeof def.translate);
    if (drape_sim_place(sim, &def))
        bench_fail(ctx, "to place it");
}

static void run(drape_context *ctx, const scene *s, const variant *v, const char *integrator, double seconds,
                uint64_t seed, drape_sim *reference, result *r)
{
    const bool converged = strcmp(integrator, "be") == 0;
    const drape_setting dt[] = {{"dt", FRAME, NULL}, {NULL, 0, NULL}};
    drape_model *model = bench_model(ctx, s->text, v->contact);
    static one of[CAPES];
    *r = (result){.frames = (int)(seconds / FRAME + 0.5)};
    for (int i = 0; i < s->sims; i++) {
        of[i] = (one){.sim = bench_sim(ctx, model, integrator, dt, NULL, NULL), .recovery = -1};
        for (int k = 0; k < MAX_NODES; k++)
            of[i].pinched[k] = -INFINITY;
        if (s->move(s, of[i].sim, i, 0, 1e-9) || drape_sim_advance(of[i].sim, 1e-6))
            bench_fail(ctx, "the start of %s", s->name);
    }
    for (int k = 0; k < r->frames; k++) {
        const bool starved = draw(&seed) < s->starved;
        r->starved += starved;
        const bool now = s->placed && k == (int)(TELEPORT / FRAME + 0.5);
        for (int i = 0; i < s->sims; i++) {
            one *o = &of[i];
            drape_realtime report = {.kept = true};
            const double before = drape_sim_time(o->sim);
            measure_speed(reference);
            if (now)
                place(ctx, o->sim);
            const double start = drape_clock_seconds();
            if (s->move(s, o->sim, i, (k + 1) * FRAME, FRAME + o->debt))
                bench_fail(ctx, "%s", s->name);
            const drape_status status =
                converged ? drape_sim_advance(o->sim, drape_sim_time(o->sim) + FRAME)
                          : drape_sim_advance_realtime(o->sim, FRAME,
                                                       slower * s->budget * (starved ? 0.1 : 1), &report);
            r->ms[k] += 1e3 * (drape_clock_seconds() - start);
            r->errors += status != DRAPE_OK;
            if (status && r->errors == 1)
                fprintf(stderr, "%s, %s, t=%g: %s\n", s->name, v->name, drape_sim_time(o->sim),
                        drape_context_message(ctx));
            r->missed += !starved && !report.kept;
            o->still = drape_sim_time(o->sim) > before ? 0 : o->still + 1;
            r->still = o->still > r->still ? o->still : r->still;
            o->debt = report.debt;
            r->dropped += report.dropped;
            r->behind = fmax(r->behind, report.behind);
            const double strain = examine(o->sim, v->self, o->pinched, r);
            judge_recovery(o, (k + 1) * FRAME, strain);
        }
    }
    r->recovery = s->placed ? 0 : -1;
    for (int i = 0; i < s->sims; i++)
        r->recovery = r->recovery < 0 || of[i].recovery < 0 ? -1
                      : of[i].recovery > r->recovery        ? of[i].recovery
                                                            : r->recovery;
    double steps = 0, contact = 0;
    for (int i = 0; i < s->sims; i++) {
        const drape_statistics stats = drape_sim_statistics(of[i].sim);
        steps += stats.wall_steps;
        contact += stats.wall_contact;
        r->attempts += stats.steps_accepted + stats.steps_rejected;
        r->rejected += stats.steps_rejected;
        drape_sim_destroy(&of[i].sim);
    }
    r->contact = contact / steps;
    drape_model_destroy(&model);
    qsort(r->ms, (size_t)r->frames, sizeof *r->ms, bench_compare);
}

static double percentile(const result *r, double share)
{
    return r->ms[(int)(share * (r->frames - 1) + 0.5)];
}

static void print_row(const scene *s, const variant *v, const char *integrator, const result *r)
{
    printf(
        "%-8s %-8s %-9s %6d %7.2f %7.2f %7.2f %7.2f %7d %8.2f %7.3f %8.1f %7.1f %9.2f %9lld %8lld %8lld %6d "
        "%8d %5d %6d %9.0f\n",
        s->name, v->name, integrator, r->frames, percentile(r, 0.5), percentile(r, 0.95), percentile(r, 0.99),
        r->ms[r->frames - 1], r->missed, r->dropped, r->behind, 100 * r->strain, 100 * r->apart,
        1e3 * r->inside, (long long)r->crossings, (long long)r->attempts, (long long)r->rejected, r->errors,
        r->recovery, r->still, r->bodies, 100 * r->contact);
    fflush(stdout);
}

static void write_row(const scene *s, const variant *v, const char *integrator, uint64_t seed,
                      const result *r, FILE *csv)
{
    bench_csv_row(csv);
    fprintf(csv, "%s,%s,%s,%llu,%d,%d,%g,%g,%g,%g,%d,%g,%g,%g,%g,%g,%lld,%lld,%lld,%d,%d,%d,%d,%g\n", s->name,
            v->name, integrator, (unsigned long long)seed, r->frames, r->starved, percentile(r, 0.5),
            percentile(r, 0.95), percentile(r, 0.99), r->ms[r->frames - 1], r->missed, r->dropped, r->behind,
            100 * r->strain, 100 * r->apart, 1e3 * r->inside, (long long)r->crossings, (long long)r->attempts,
            (long long)r->rejected, r->errors, r->recovery, r->still, r->bodies, 100 * r->contact);
    fflush(csv);
}

/* ---- What is required ---- */

/* One requirement on a scene: the number that was found, and the largest that is allowed. */
static void require(const scene *s, const variant *v, const char *what, double found, double allowed)
{
    printf("%-8s %-8s %-52s %9.4g of %9.4g  %s\n", s->name, v->name, what, found, allowed,
           found <= allowed ? "met" : "not met");
}

/* converged: by be; NULL: was not measured. */
static void judge(const scene *s, const variant *v, const result *r, const result *converged)
{
    if (s->move == sweep) {
        require(s, v, "99 of 100 frames [ms]", percentile(r, 0.99), 16);
        require(s, v, "inside of a body [mm]", 1e3 * r->inside, 1);
        if (converged)
            require(s, v, "strain, by that of be", r->strain / converged->strain, 1.3);
    }
    if (s->placed) {
        require(s, v, "frames missed, beside starved ones [%]",
                100. * r->missed / (double)(s->sims * (r->frames - r->starved)), 2);
        require(s, v, "strain [%]", 100 * r->strain, 30);
        require(s, v, "inside of a body [mm]", 1e3 * r->inside, 1);
        if (r->frames * FRAME > TELEPORT)
            require(s, v, "frames until it is as before it was placed",
                    r->recovery < 0 ? INFINITY : r->recovery, 3);
    }
    if (s->move == bend || s->move == pinch) {
        require(s, v, "strain apart from the pinch [%]", 100 * r->apart, 10);
        require(s, v, "simulated time that was dropped [%]", 100 * r->dropped / (s->sims * r->frames * FRAME),
                10);
        require(s, v, "bodies at the pinch that no report named", 2 - r->bodies, 0);
    }
    if (v->self)
        require(s, v, "edges through triangles", (double)r->crossings, 0);
    require(s, v, "calls that failed", r->errors, 0);
}

/* ---- All of it ---- */

typedef struct arguments {
    const char *file, *scene, *contact;
    double seconds;
    uint64_t seed;
    bool be;
} arguments;

static bool is_chosen(const arguments *a, int i, int k)
{
    return (!a->scene || strcmp(a->scene, scenes[i].name) == 0) &&
           (!a->contact || strcmp(a->contact, variants[k].name) == 0);
}

/* Returns whether anything was measured. */
static bool measure_all(drape_context *ctx, const arguments *a, FILE *csv)
{
    static result found[SCENES][VARIANTS][2];
    drape_model *model = bench_model(ctx, "{'drape': 1, " HUNG(30) ", 'duration': 100}");
    drape_sim *reference = bench_sim(ctx, model, "newton_k", NULL, NULL, NULL);
    for (int i = 0; i < 5 * PIECES; i++)
        measure_speed(reference);
    bool any = false;
    puts("scene    contact  method    frames     p50     p95     p99   worst  missed  dropped  behind strain "
         "% "
         "apart % inside mm crossings attempts rejected errors recovery still bodies contact %");
    for (int i = 0; i < SCENES; i++)
        for (int k = 0; k < VARIANTS; k++)
            for (int be = 0; is_chosen(a, i, k) && be <= a->be; be++) {
                static const char *const methods[] = {"newton_k", "be"};
                result *r = &found[i][k][be];
                run(ctx, &scenes[i], &variants[k], methods[be],
                    a->seconds > 0 ? a->seconds : scenes[i].seconds, a->seed, reference, r);
                print_row(&scenes[i], &variants[k], methods[be], r);
                if (csv)
                    write_row(&scenes[i], &variants[k], methods[be], a->seed, r, csv);
                any = true;
            }
    puts("\nscene    contact  required                                                 found    at most");
    for (int i = 0; i < SCENES; i++)
        for (int k = 0; k < VARIANTS; k++)
            if (is_chosen(a, i, k))
                judge(&scenes[i], &variants[k], &found[i][k][0], a->be ? &found[i][k][1] : NULL);
    drape_sim_destroy(&reference);
    drape_model_destroy(&model);
    return any;
}

int main(int argc, char **argv)
{
    static const char usage[] =
        "realtime [--csv FILE] [--seconds S] [--scene NAME] [--contact NAME] [--seed N] "
        "[--slower F] [--be]\n";
    arguments a = {.seed = 7};
    for (int i = 1; i < argc; i++) {
        if (strcmp(argv[i], "--csv") == 0 && i + 1 < argc)
            a.file = argv[++i];
        else if (strcmp(argv[i], "--scene") == 0 && i + 1 < argc)
            a.scene = argv[++i];
        else if (strcmp(argv[i], "--contact") == 0 && i + 1 < argc)
            a.contact = argv[++i];
        else if (strcmp(argv[i], "--seconds") == 0 && i + 1 < argc)
            a.seconds = atof(argv[++i]);
        else if (strcmp(argv[i], "--seed") == 0 && i + 1 < argc)
            a.seed = strtoull(argv[++i], NULL, 10);
        else if (strcmp(argv[i], "--be") == 0)
            a.be = true;
        else if (strcmp(argv[i], "--slower") == 0 && i + 1 < argc)
            slower = atof(argv[++i]);
        else
            return bench_usage(argv[i], usage);
    }
    if (!(slower > 0) || !(a.seconds >= 0 && a.seconds * 60 < MAX_FRAMES))
        return bench_usage("", usage);
    FILE *csv = bench_csv(
        a.file,
        "scene,contact,integrator,seed,frames,starved,p50_ms,p95_ms,p99_ms,worst_ms,missed,"
        "dropped_s,behind_s,strain_percent,apart_percent,inside_mm,crossings,attempts,rejected,errors,"
        "recovery_frames,still_calls,bodies_named,contact_percent");
    drape_context *ctx = bench_context();
    const bool any = measure_all(ctx, &a, csv);
    drape_context_destroy(&ctx);
    if (!any)
        fputs("no such scene or contact; see the head of bench/realtime.c\n", stderr);
    return (csv && fclose(csv)) || !any ? 1 : 0;
}
