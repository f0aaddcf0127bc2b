/*
 * estimate: the error that newton_k estimates for each step against the true one: the distance to the same
 * step from the same state by `be`, solved to a thirtieth of its default tolerance; RMS over all nodes. The
 * scenes are every combination of
 *     materials   E h from 1e2 to 1e6 N/m, and two measured fabrics
 *     terms       stretch.edge and bend.hinge (edge), stretch.cst and bend.midedge (cst)
 *     supports    hung by two corners, swung by them, a flag in the wind, dropped on a ball, over an edge
 *     sides       13 and 30 nodes
 * and scenes drawn at random from a seed: sizes, materials, meshes and supports that nobody chose. Each runs
 * twice: `default`, and `least`, where one iteration is made in a step unless the residual asks for more.
 *
 * A row is one such run, a cell: quantiles of estimate / true over its steps, the share of steps within a
 * factor of 3, and the share of steps that are above the bound and estimated at less than a tenth of the true
 * error. Steps that are nearer to `be` than 1e-6 of the scene's size are left out: they are as near as `be`
 * is to the solution. So are steps that `be` does not converge in.
 *
 *     estimate [--csv FILE] [--seed N] [--count N] [--sides N] [--only TEXT]
 *         --seed, --count   of the random scenes (default 1, 40)
 *         --sides           largest number of nodes a side of the others (default 30)
 *         --only            runs only scenes whose name contains this
 */
#include "bench.h"
#include "support/step_error.h"

#define MAX_STEPS 64
#define STEPS     24
#define DT        (1.0 / 60)
#define TRUST     (1.0 / 30) /* of the default tolerance of be */
#define FLOOR     1e-6       /* of the scene's size: smaller distances are left out */
#define FACTOR    3
#define FAR_BELOW 0.1
#define BALL      "'colliders': [{'type': 'sphere', 'center': [0, 0, 0], 'radius': %g, 'friction': 0.3}],"
#define BOX       "'colliders': [{'type': 'box', 'center': [%g,%g,0], 'size': [%g,%g,%g], 'friction': 0.2}],"
#define FLOOR_PLANE                                                                                          \
    "'colliders': [{'type': 'plane', 'point': [0, %g, 0], 'normal': [0, 1, 0], 'friction': 0.3}],"

/* ---- Scenes ---- */

typedef struct options {
    FILE *csv;
    const char *only;
    int seed, count, sides;
} options;

static const struct {
    const char *name, *text;
} materials[] = {
    {"1e2 N/m", "{'young_modulus': 1e5, 'thickness': 0.001, 'areal_density': 0.2}"},
    {"1e3 N/m", "{'young_modulus': 1e6, 'thickness': 0.001, 'areal_density': 0.2}"},
    {"1e4 N/m", "{'young_modulus': 3.3e7, 'thickness': 0.0003, 'areal_density': 0.15}"},
    {"1e5 N/m", "{'young_modulus': 1e8, 'thickness': 0.001, 'areal_density': 0.3}"},
    {"1e6 N/m", "{'young_modulus': 1e9, 'thickness': 0.001, 'areal_density': 0.3}"},
    {"denim", "{'fabric': 'wang2011_denim', 'damping': 'none'}"},
    {"tablecloth", "{'fabric': 'wang2011_tablecloth', 'damping': 'none'}"},
};

static const struct {
    const char *name, *text;
} terms[] = {{"edge", "'stretch.edge', 'bend.hinge'"}, {"cst", "'stretch.cst', 'bend.midedge'"}};

typedef enum support { HUNG, SWUNG, FLAG, ON_BALL, OVER_EDGE, THROWN, SUPPORTS } support;
static const char *const supports[] = {"hung", "swung", "flag", "ball", "edge", "thrown"};

typedef struct scene {
    char name[128], mesh[256], material[128], terms[128];
    support support;
    int side;
    double size, wind, speed, tilt; /* [m], [m/s], [m/s], [degrees] */
} scene;

static drape_model *compile(drape_context *ctx, const scene *s)
{
    const double a = s->size;
    char pins[256] = "", move[256] = "'translate': [0, 0, 0]", bodies[256] = "", wind[128] = "";
    if (s->support == HUNG)
        snprintf(pins, sizeof pins, "'pins': [{'nodes': [0, %d]}],", s->side - 1);
    if (s->support == SWUNG)
        snprintf(
            pins, sizeof pins,
            "'pins': [{'nodes': [0, %d], 'track': [[0, [0, 0, 0]], [%g, [%g, %g, 0]], [%g, [0, 0, 0]]]}],",
            s->side - 1, 0.2 * sqrt(a), 0.4 * a, 0.2 * a, 0.4 * sqrt(a));
    if (s->support == FLAG) {
        snprintf(pins, sizeof pins, "'pins': [{'nodes': [0, %d]}],", s->side * (s->side - 1));
        snprintf(wind, sizeof wind, ", {'type': 'drag.wind', 'wind': [%g, 0, 1]}", s->wind);
    }
    if (s->support == ON_BALL) {
        snprintf(move, sizeof move, "'translate': [%g, %g, %g]", -a / 2, 0.35 * a, a / 2);
        snprintf(bodies, sizeof bodies, BALL, 0.3 * a);
    }
    if (s->support == OVER_EDGE) {
        snprintf(move, sizeof move, "'translate': [%g, %g, %g]", -a / 2, 0.05 * a, a / 2);
        snprintf(bodies, sizeof bodies, BOX, -0.3 * a, -0.2 * a, 0.6 * a, 0.4 * a, 2 * a);
    }
    if (s->support == THROWN) {
        snprintf(move, sizeof move, "'rotate': [1, 0, 0, %g]", s->tilt);
        snprintf(bodies, sizeof bodies, FLOOR_PLANE, -0.8 * a);
    }
    return bench_model(
        ctx,
        "{'drape': 1, 'duration': %g, %s 'cloth': [{'mesh': {%s, 'width': %g, 'height': %g, 'orientation': "
        "'horizontal', 'transform': {%s}}, 'material': %s, %s 'terms': [%s%s], 'velocity': [0, %g, 0]}]}",
        STEPS * DT, bodies, s->mesh, a, a, move, s->material, pins, s->terms, wind,
        s->support == THROWN ? -s->speed : 0);
}

/* ---- Two sims, step by step ---- */

typedef struct cell {
    double ratio[MAX_STEPS]; /* estimate / true */
    int count, missing, above, far_below;
    double largest, largest_estimate; /* [m] */
} cell;

typedef struct pair {
    step_error error;
    double floor, bound;
    cell *cell;
} pair;

static drape_status compare(void *user, const drape_event *event)
{
    pair *p = user;
    const drape_attempt *a = event->attempt;
    if (event->kind != DRAPE_EVENT_ATTEMPT || !a->accepted)
        return DRAPE_OK;
    cell *c = p->cell;
    const double e = step_error_of(&p->error, event);
    if (isnan(e))
        c->missing++;
    else {
        if (e > p->floor && c->count < MAX_STEPS)
            c->ratio[c->count++] = a->error / e;
        c->above += e > p->bound;
        c->far_below += e > p->bound && a->error < FAR_BELOW * e;
        c->largest = fmax(c->largest, e);
        c->largest_estimate = fmax(c->largest_estimate, a->error);
    }
    return DRAPE_OK;
}

static drape_sim *exact_sim(drape_context *ctx, const drape_model *model)
{
    drape_setting settings[] = {
        {.name = "dt", .number = DT}, {.name = "max_iterations", .number = 100}, {.name = "tolerance"}, {0}};
    drape_sim *loose = bench_sim(ctx, model, "be", (drape_setting[]){settings[0], {0}}, "fixed", NULL);
    settings[2].number = TRUST * drape_sim_statistics(loose).tolerance;
    drape_sim_destroy(&loose);
    return bench_sim(ctx, model, "be", settings, "fixed", NULL);
}

static void measure(drape_context *ctx, const scene *s, bool least, cell *out)
{
    drape_model *model = compile(ctx, s);
    const drape_setting settings[] = {
        {.name = "dt", .number = DT}, {.name = least ? "error" : NULL, .number = 1e6}, {0}};
    drape_sim *sim = bench_sim(ctx, model, "newton_k", settings, NULL, NULL);
    const size_t n = 3 * (size_t)drape_model_node_count(model);
    pair p = {.error = {.exact = exact_sim(ctx, model), .n = n}, .cell = out};
    p.error.x = malloc(n * sizeof *p.error.x);
    p.error.v = malloc(n * sizeof *p.error.v);
    if (!p.error.x || !p.error.v)
        bench_fail(ctx, "out of memory");
    p.floor = FLOOR * model->length;
    p.bound = 1e-3 * model->length;
    *out = (cell){0};
    step_error_keep(&p.error, sim);
    if (drape_sim_observe(sim, compare, &p) || drape_sim_advance(sim, STEPS * DT))
        fprintf(stderr, "%s: %s\n", s->name, drape_context_message(ctx));
    free(p.error.x);
    free(p.error.v);
    drape_sim_destroy(&sim);
    drape_sim_destroy(&p.error.exact);
    drape_model_destroy(&model);
}

/* ---- Tables ---- */

static double quantile(const cell *c, double share)
{
    return c->count > 0 ? c->ratio[(int)(share * (c->count - 1) + 0.5)] : NAN;
}

static int within(const cell *c)
{
    int n = 0;
    for (int i = 0; i < c->count; i++)
        n += c->ratio[i] >= 1.0 / FACTOR && c->ratio[i] <= FACTOR;
    return n;
}

typedef struct total {
    int cells, cells_within, cells_low, steps, steps_within, above, far_below, missing;
} total;

static void print_cell(const options *o, const scene *s, const char *mode, cell *c, total *t)
{
    qsort(c->ratio, (size_t)c->count, sizeof *c->ratio, bench_compare);
    const double median = quantile(c, 0.5);
    printf("%-44s %-8s %3d steps  %8.3g %8.3g %8.3g  within %3d  largest %.2e, estimate %.2e\n", s->name,
           mode, c->count, quantile(c, 0.05), median, quantile(c, 0.95), within(c), c->largest / s->size,
           c->largest_estimate / s->size);
    fflush(stdout);
    t->cells += c->count > 0;
    t->cells_within += median >= 1.0 / FACTOR && median <= FACTOR;
    t->cells_low += median < 1.0 / FACTOR;
    t->steps += c->count;
    t->steps_within += within(c);
    t->above += c->above;
    t->far_below += c->far_below;
    t->missing += c->missing;
    if (!o->csv)
        return;
    bench_csv_row(o->csv);
    fprintf(o->csv, "%s,%s,%d,%d,%.4g,%.4g,%.4g,%.4g,%d,%d,%.4g,%.4g\n", s->name, mode, c->count, c->missing,
            quantile(c, 0.05), median, quantile(c, 0.95), c->count ? (double)within(c) / c->count : NAN,
            c->above, c->far_below, c->largest / s->size, c->largest_estimate / s->size);
    fflush(o->csv);
}

static void run(drape_context *ctx, const options *o, const scene *s, total totals[2])
{
    if (o->only && !strstr(s->name, o->only))
        return;
    for (int least = 0; least < 2; least++) {
        cell c;
        measure(ctx, s, least, &c);
        print_cell(o, s, least ? "least" : "default", &c, &totals[least]);
    }
}

static void run_matrix(drape_context *ctx, const options *o, total totals[2])
{
    for (size_t m = 0; m < sizeof materials / sizeof *materials; m++)
        for (size_t t = 0; t < 2; t++)
            for (int k = 0; k < THROWN; k++)
                for (int side = 13; side <= o->sides; side += 17) {
                    scene s = {.support = (support)k, .side = side, .size = 1, .wind = 6};
                    if (side > 13 && k != HUNG && k != SWUNG)
                        continue;
                    snprintf(s.name, sizeof s.name, "%s %s %s %d", materials[m].name, terms[t].name,
                             supports[k], side);
                    snprintf(s.mesh, sizeof s.mesh, "'grid': 'square', 'columns': %d, 'rows': %d", side,
                             side);
                    snprintf(s.material, sizeof s.material, "%s", materials[m].text);
                    snprintf(s.terms, sizeof s.terms, "%s", terms[t].text);
                    run(ctx, o, &s, totals);
                }
}

/* ---- Random scenes ---- */

/* splitmix64 */
static double draw(uint64_t *state)
{
    uint64_t z = *state += 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return (double)((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

static double between(uint64_t *state, double low, double high)
{
    return low * pow(high / low, draw(state));
}

static void run_random(drape_context *ctx, const options *o, total totals[2])
{
    static const char *const fabrics[] = {"wang2011_denim",  "wang2011_tablecloth", "wang2011_jacket",
                                          "wang2011_tshirt", "matsudaira2015_wool", "feng2022_1"};
    uint64_t state = (uint64_t)o->seed;
    for (int i = 0; i < o->count; i++) {
        scene s = {.support = (support)(SUPPORTS * draw(&state)), .side = 8 + (int)(13 * draw(&state))};
        const bool irregular = draw(&state) < 0.5, fabric = draw(&state) < 0.5, cst = draw(&state) < 0.5;
        s.size = between(&state, 0.05, 5);
        s.wind = between(&state, 2, 12);
        s.speed = between(&state, 0.5, 5) * sqrt(s.size);
        s.tilt = between(&state, 10, 60);
        snprintf(s.mesh, sizeof s.mesh, "'grid': '%s', 'columns': %d, 'rows': %d%s",
                 irregular ? "irregular" : "square", s.side, s.side, irregular ? ", 'jitter': 0.25" : "");
        const double young = between(&state, 1e4, 1e9), thickness = between(&state, 1e-4, 3e-3),
                     density = between(&state, 0.02, 2);
        const char *name = fabrics[(size_t)(draw(&state) * 6)];
        if (fabric)
            snprintf(s.material, sizeof s.material, "{'fabric': '%s', 'damping': 'none'}", name);
        else
            snprintf(s.material, sizeof s.material,
                     "{'young_modulus': %g, 'thickness': %g, 'areal_density': %g}", young, thickness,
                     density);
        snprintf(s.terms, sizeof s.terms, "%s", terms[cst].text);
        snprintf(s.name, sizeof s.name, "random %d: %s %.2g m %s %s %d", i, supports[s.support], s.size,
                 fabric ? name : "elastic", terms[cst].name, s.side);
        run(ctx, o, &s, totals);
    }
}

static void print_total(const char *mode, const total *t)
{
    printf("%s: %d of %d cells within a factor of %d, %d below; %d of %d steps within; of %d steps above the "
           "bound "
           "%d estimated at less than a tenth; %d steps without a converged one\n",
           mode, t->cells_within, t->cells, FACTOR, t->cells_low, t->steps_within, t->steps, t->above,
           t->far_below, t->missing);
}

int main(int argc, char **argv)
{
    options o = {.seed = 1, .count = 40, .sides = 30};
    total totals[2] = {{0}};
    const char *csv = NULL;
    for (int i = 1; i < argc; i++) {
        const char *value = i + 1 < argc ? argv[i + 1] : NULL;
        if (value && strcmp(argv[i], "--csv") == 0)
            csv = argv[++i];
        else if (value && strcmp(argv[i], "--only") == 0)
            o.only = argv[++i];
        else if (value && strcmp(argv[i], "--seed") == 0)
            o.seed = atoi(argv[++i]);
        else if (value && strcmp(argv[i], "--count") == 0)
            o.count = atoi(argv[++i]);
        else if (value && strcmp(argv[i], "--sides") == 0)
            o.sides = atoi(argv[++i]);
        else
            return bench_usage(
                argv[i], "usage: estimate [--csv FILE] [--seed N] [--count N] [--sides N] [--only TEXT]\n");
    }
    o.csv = bench_csv(
        csv, "scene,mode,steps,missing,ratio_5,ratio_median,ratio_95,within,above,far_below,largest_true,"
             "largest_estimate");
    drape_context *ctx = bench_context();
    run_matrix(ctx, &o, totals);
    run_random(ctx, &o, totals);
    print_total("default", &totals[0]);
    print_total("least", &totals[1]);
    if (o.csv)
        fclose(o.csv);
    drape_context_destroy(&ctx);
    return 0;
}
