/*
 * cusick: the drape test of Cusick 1965 (ISO 9073-9, a specimen of 30 cm on a disc of 18 cm) with folds that
 * are sought, not left to chance. The overhang, clamped along its inner rim, starts with n waves of 3 mm at
 * its outer one, its weight grows from 0 in the ramp, and it comes to rest in air; then the energies of the
 * runs with different n are compared. Each fabric of the table that has a published drape coefficient is
 * tested as an elastic sheet, and with the friction between its yarns (HB/B of KES), whose onset was not
 * measured. With friction the state is one of many at which the sheet stays: the least energy is then only
 * that of the least of these runs.
 *
 *     cusick [--csv FILE] [--fabric NAME] [--tester cusick|jis] [--membrane soft|fabric] [--rows N]
 *            [--columns N] [--from N] [--to N] [--onset K] [--twist RATIO]
 *         --fabric    run only this one
 *         --tester    cusick (default), or jis, a specimen of 25.4 cm on a disc of 12.7 cm
 *         --membrane  soft (default): stretch.cst with 100 N/m, as `drape validate cusick_measured`; fabric:
 *                     stretch.patch with the stiffnesses of the fabric, three times as expensive
 *         --rows, --columns  circles and nodes of each (default 13, 112)
 *         --from, --to  numbers of waves at the start (default 4 to 11)
 *         --onset     friction_curvature [1/m] (default 10)
 *         --twist     torsional rigidity over that of bending, which was not measured (default 0.5, as if
 *                     isotropic)
 */
#include "bench.h"

#include "compile/fabrics.h"

#define PI        3.14159265358979323846
#define AMPLITUDE 0.003 /* [m] of the waves at the start */
#define RAMP      1.0   /* [s] in which the weight grows */
#define STEP      0.02  /* [s] */
#define LONGEST   4.0   /* [s] */
#define REST      1e-4  /* [m/s] the fastest node of a sheet at rest, for a while: it may turn round */
#define WHILE     3     /* tenths of a second */
#define PROMINENT 0.1   /* of the range of heights of the rim: smaller waves are no folds */
#define MOST      32    /* waves at the start */

/* Radii of the disc and of the specimen [m]: of Cusick and ISO 9073-9, and of JIS L 1096, method G, as of the
 * tester of the Fabric Research Laboratories (Chu, Cummings & Teixeira 1950). */
typedef struct drapemeter {
    const char *name;
    double inner, outer;
} drapemeter;

static const drapemeter testers[] = {{"cusick", 0.09, 0.15}, {"jis", 0.0635, 0.127}};

typedef struct options {
    const char *fabric;
    const drapemeter *tester;
    bool soft;
    int rows, columns, from, to;
    double onset, twist;
} options;

typedef struct result {
    int seeded, found;
    double energy;      /* [J] elastic and of the weight */
    double coefficient; /* shadow of the overhang over its area */
    double speed;       /* [m/s] of the fastest node at the end */
    double time, cpu;   /* [s] */
} result;

static drape_model *specimen(drape_context *ctx, const options *o, const drape_fabric *fabric,
                             double friction)
{
    char slip[64] = "", membrane[128] = "'stretch.patch'", soft[64] = "";
    if (friction > 0)
        snprintf(slip, sizeof slip, ",'friction':%g,'friction_curvature':%g", friction, o->onset);
    if (o->soft) {
        snprintf(membrane, sizeof membrane, "'stretch.cst'");
        snprintf(soft, sizeof soft, ",'young_modulus':1e5,'poisson_ratio':0,'thickness':1e-3");
    }
    return bench_model(
        ctx,
        "{'drape':1,'cloth':[{'mesh':{'grid':'annulus','rows':%d,'columns':%d,'inner_radius':%g,"
        "'outer_radius':%g},'material':{'fabric':'%s','damping':'none'%s},'terms':[%s,{'type':'bend.midedge',"
        "'poisson':0,'"
        "twist':%.17g%s},"
        "{'type':'drag.viscous','coefficient':1}],'pins':[{'edge':'top','clamp':true}]}],"
        "'gravity':[0,-9.81,0],'gravity_history':'weight','histories':[{'name':'weight','times':[0,%g],"
        "'values':[0,1]}],'integrator':{'method':'be','dt':%g,'tolerance':1e-6,'globalization':'work'},"
        "'duration':%g}",
        o->rows, o->columns, o->tester->inner, o->tester->outer, fabric->name, soft, membrane,
        o->twist * fabric->bending.warp, slip, RAMP, STEP, LONGEST);
}

/* The rim starts with waves that vanish, with their slope, where the sheet is clamped. */
static void seed(drape_context *ctx, const drape_model *model, drape_sim *sim, const drapemeter *tester,
                 int waves)
{
    const size_t nodes = (size_t)drape_model_node_count(model);
    const double *rest = drape_model_rest_positions(model);
    double *x = calloc(6 * nodes, sizeof *x);
    if (!x)
        bench_fail(ctx, "out of memory");
    memcpy(x, rest, 3 * nodes * sizeof *x);
    for (size_t i = 0; i < nodes; i++) {
        const double radius = hypot(rest[3 * i], rest[3 * i + 2]),
                     out = fmax(0, radius - tester->inner) / (tester->outer - tester->inner);
        x[3 * i + 1] += AMPLITUDE * out * out * cos(waves * atan2(rest[3 * i + 2], rest[3 * i]));
    }
    if (drape_sim_set_state(sim, 0, x, x + 3 * nodes))
        bench_fail(ctx, "the start");
    free(x);
}

/* Rises and falls of the rim's height by more than PROMINENT of its range. */
static int count_folds(const double *rim, int columns)
{
    double low = INFINITY, high = -INFINITY;
    int lowest = 0, turns = 0;
    for (int i = 0; i < columns; i++) {
        const double y = rim[3 * i + 1];
        lowest = y < low ? i : lowest;
        low = fmin(low, y), high = fmax(high, y);
    }
    double extreme = low;
    bool rising = true;
    for (int k = 1; k <= columns; k++) {
        const double y = rim[3 * ((lowest + k) % columns) + 1], change = rising ? y - extreme : extreme - y;
        if (change > 0)
            extreme = y;
        else if (-change > PROMINENT * (high - low)) {
            rising = !rising;
            extreme = y;
            turns++;
        }
    }
    return (turns + 1) / 2;
}

/* As `drape validate cusick_measured`: the area inside the shadow of the rim. */
static double shadow_of(const drapemeter *tester, const double *rim, int columns)
{
    const double inner = PI * tester->inner * tester->inner, outer = PI * tester->outer * tester->outer;
    double twice = 0;
    for (int i = 0; i < columns; i++) {
        const double *a = rim + 3 * i, *b = rim + 3 * ((i + 1) % columns);
        twice += a[2] * b[0] - a[0] * b[2];
    }
    return (twice / 2 - inner) / (outer - inner);
}

static double fastest(const drape_model *model, const drape_sim *sim)
{
    const size_t n = 3 * (size_t)drape_model_node_count(model);
    const double *v = drape_sim_velocities(sim);
    double most = 0;
    for (size_t i = 0; i < n; i += 3)
        most = fmax(most, sqrt(v[i] * v[i] + v[i + 1] * v[i + 1] + v[i + 2] * v[i + 2]));
    return most;
}

static result drape(const options *o, const drape_fabric *fabric, double friction, int waves)
{
    drape_context *ctx = bench_context();
    drape_model *model = specimen(ctx, o, fabric, friction);
    drape_sim *sim = bench_sim(ctx, model, NULL, NULL, NULL, NULL);
    const double start = drape_clock_cpu_seconds();
    result r = {.seeded = waves, .speed = INFINITY};
    seed(ctx, model, sim, o->tester, waves);
    for (int k = 1, quiet = 0; quiet < WHILE && k * 0.1 <= LONGEST; k++) {
        if (drape_sim_advance(sim, k * 0.1))
            bench_fail(ctx, "%s, %d waves", fabric->name, waves);
        r.speed = fastest(model, sim);
        quiet = k * 0.1 > RAMP && r.speed < REST ? quiet + 1 : 0;
    }
    const drape_energy e = drape_sim_energy(sim);
    const double *rim = drape_sim_positions(sim) + 3 * (size_t)(drape_model_node_count(model) - o->columns);
    r.energy = e.elastic + e.gravity;
    r.found = count_folds(rim, o->columns);
    r.coefficient = shadow_of(o->tester, rim, o->columns);
    r.time = drape_sim_time(sim);
    r.cpu = drape_clock_cpu_seconds() - start;
    drape_sim_destroy(&sim);
    drape_model_destroy(&model);
    drape_context_destroy(&ctx);
    return r;
}

static int by_energy(const void *a, const void *b)
{
    return bench_compare(&((const result *)a)->energy, &((const result *)b)->energy);
}

/* All counts of one fabric, the least energy first. */
static void test(const options *o, const drape_fabric *f, double friction, FILE *csv)
{
    const char *sheet = friction > 0 ? "friction" : "elastic";
    const int count = o->to - o->from + 1;
    result of[MOST];
    for (int i = 0; i < count; i++)
        of[i] = drape(o, f, friction, o->from + i);
    qsort(of, (size_t)count, sizeof *of, by_energy);
    for (int i = 0; i < count; i++) {
        const result *r = &of[i];
        printf("%-24s %-8s %6d %5d %12.6f %8.4f %9.3f %7.1f%% %8.1e %5.1f %6.1f\n", f->name, sheet, r->seeded,
               r->found, 1e3 * r->energy, r->coefficient, f->drape, 100 * (r->coefficient / f->drape - 1),
               r->speed, r->time, r->cpu);
        if (!csv)
            continue;
        bench_csv_row(csv);
        fprintf(csv, "%s,%s,%s,%s,%d,%d,%g,%g,%d,%d,%.6f,%.4f,%.3f,%.1e,%.1f,%.1f\n", f->name, sheet,
                o->tester->name, o->soft ? "soft" : "fabric", o->rows, o->columns,
                friction > 0 ? o->onset : 0, o->twist, r->seeded, r->found, 1e3 * r->energy, r->coefficient,
                f->drape, r->speed, r->time, r->cpu);
    }
    fflush(stdout);
    if (csv)
        fflush(csv);
}

#define USAGE                                                                                                \
    "cusick [--csv FILE] [--fabric NAME] [--tester cusick|jis] [--membrane soft|fabric] [--rows N]\n"        \
    "       [--columns N] [--from N] [--to N] [--onset K] [--twist RATIO]\n"

static const drapemeter *tester_named(const char *name)
{
    const drapemeter *found = NULL;
    for (size_t i = 0; i < sizeof testers / sizeof *testers; i++)
        if (strcmp(testers[i].name, name) == 0)
            found = &testers[i];
    return found;
}

int main(int argc, char **argv)
{
    options o = {.tester = testers,
                 .soft = true,
                 .rows = 13,
                 .columns = 112,
                 .from = 4,
                 .to = 11,
                 .onset = 10,
                 .twist = 0.5};
    const char *name = NULL;
    for (int i = 1; i < argc; i++) {
        const char *value = i + 1 < argc ? argv[i + 1] : "";
        if (strcmp(argv[i], "--csv") == 0 && *value)
            name = value;
        else if (strcmp(argv[i], "--fabric") == 0 && *value)
            o.fabric = value;
        else if (strcmp(argv[i], "--tester") == 0 && tester_named(value))
            o.tester = tester_named(value);
        else if (strcmp(argv[i], "--membrane") == 0 &&
                 (strcmp(value, "soft") == 0 || strcmp(value, "fabric") == 0))
            o.soft = strcmp(value, "soft") == 0;
        else if (strcmp(argv[i], "--rows") == 0 && atoi(value) > 1)
            o.rows = atoi(value);
        else if (strcmp(argv[i], "--columns") == 0 && atoi(value) > 2)
            o.columns = atoi(value);
        else if (strcmp(argv[i], "--from") == 0 && atoi(value) > 0)
            o.from = atoi(value);
        else if (strcmp(argv[i], "--to") == 0 && atoi(value) > 0)
            o.to = atoi(value);
        else if (strcmp(argv[i], "--onset") == 0 && atof(value) > 0)
            o.onset = atof(value);
        else if (strcmp(argv[i], "--twist") == 0 && atof(value) > 0)
            o.twist = atof(value);
        else
            return bench_usage(argv[i], USAGE);
        i++;
    }
    if (o.to < o.from || o.to - o.from >= MOST)
        return bench_usage("", USAGE);
    FILE *csv = bench_csv(
        name, "fabric,sheet,tester,membrane,rows,columns,onset,twist,seeded,folds,energy_mj,coefficient,"
              "published,speed,time_s,cpu_s");
    printf("%-24s %-8s %6s %5s %12s %8s %9s %8s %8s %5s %6s\n", "fabric", "sheet", "seeded", "folds",
           "energy mJ", "drape", "published", "off", "m/s", "t s", "cpu s");
    for (const drape_fabric *f = drape_fabrics; f->name; f++) {
        if (isnan(f->drape) || (o.fabric && strcmp(o.fabric, f->name) != 0))
            continue;
        test(&o, f, 0, csv);
        test(&o, f, round(f->bending.friction / f->bending.warp), csv); /* HB/B [1/m] */
    }
    if (csv)
        fclose(csv);
    return 0;
}
