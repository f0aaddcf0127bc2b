/*
 * work: accuracy against cost. A square sheet of 12 x 12 nodes, 1 m, E 1e6 Pa, h 1 mm, 0.2 kg/m2, undamped,
 * is released horizontally and swings down from two corners. The error is the root mean square over the free
 * nodes of the distance from a converged reference at 0.5 s: ida at rtol 1e-8 and order 5, whose own error is
 * its distance from rtol 1e-9. Every integrator runs over its dt or rtol, those with fixed steps under the
 * controllers halving and error; CPU time is the least of the repeats. The last lines compare ida at rtol
 * 1e-3 with be at 1/60 s, and the two at equal error, with linear interpolation in logarithms between the
 * points of the table.
 */
#include "bench.h"

#define END     0.5 /* [s] */
#define REPEATS 3
#define LONG    1.0 /* [s] CPU: longer runs are not repeated */
#define POINTS  192 /* at most */

typedef struct point {
    const char *integrator, *controller, *knob; /* knob: "dt" or "rtol" */
    double value;
    int max_order;       /* of ida; 0: its default */
    bool good;           /* the run completed */
    double error, speed; /* RMS [m], [m/s] */
    double seconds;      /* CPU [s] */
    drape_statistics work;
} point;

typedef struct bench {
    drape_context *ctx;
    drape_model *model;
    double *x, *v; /* of the reference at END */
    point points[POINTS];
    int count;
    FILE *csv;
} bench;

static drape_model *sheet(drape_context *ctx)
{
    return bench_model(ctx, "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 12, 'rows': 12, "
                            "'width': 1, 'height': 1},"
                            "'material': {'young_modulus': 1e6, 'thickness': 1e-3, 'areal_density': 0.2},"
                            "'terms': ['stretch.edge', 'bend.hinge'],"
                            "'pins': [{'corner': 'top-left'}, {'corner': 'top-right'}]}], 'duration': 1}");
}

static double distance(const drape_model *model, const double *a, const double *b)
{
    double sum = 0;
    for (size_t i = 0; i < 3 * (size_t)model->node_count; i++)
        sum += (a[i] - b[i]) * (a[i] - b[i]);
    return sqrt(sum / model->free_count);
}

static drape_sim *make(const bench *b, const point *p)
{
    const drape_setting knob = {p->knob, p->value, NULL}, none = {0};
    const bool controlled = strcmp(p->controller, "error") == 0;
    const drape_setting integrator[] = {
        controlled ? (drape_setting){"dt", 1.0 / 480, NULL} : knob,
        p->max_order > 0 ? (drape_setting){"max_order", p->max_order, NULL} : none, none};
    const drape_setting controller[] = {controlled ? knob : none, none};
    return bench_sim(b->ctx, b->model, p->integrator, integrator, p->controller, controller);
}

static void make_reference(bench *b)
{
    point p = {"ida", "halving", "rtol", 1e-8, 5, true, 0, 0, 0, {0}};
    const size_t size = 3 * (size_t)b->model->node_count * sizeof(double);
    b->x = malloc(size);
    b->v = malloc(size);
    drape_sim *sim = make(b, &p);
    p.value = 1e-9;
    drape_sim *tight = make(b, &p);
    if (!b->x || !b->v || drape_sim_advance(sim, END) || drape_sim_advance(tight, END))
        bench_fail(b->ctx, "the reference");
    memcpy(b->x, drape_sim_positions(sim), size);
    memcpy(b->v, drape_sim_velocities(sim), size);
    printf("reference: ida, rtol 1e-8, order 5: %lld steps; at rtol 1e-9 (%lld steps) it differs by %.2g m "
           "and %.2g m/s\n",
           (long long)drape_sim_statistics(sim).steps_accepted,
           (long long)drape_sim_statistics(tight).steps_accepted,
           distance(b->model, b->x, drape_sim_positions(tight)),
           distance(b->model, b->v, drape_sim_velocities(tight)));
    fflush(stdout);
    drape_sim_destroy(&sim);
    drape_sim_destroy(&tight);
}

static void run(const bench *b, point *p)
{
    p->seconds = INFINITY;
    p->good = true;
    for (int i = 0; i < REPEATS && p->good && (i == 0 || p->seconds < LONG); i++) {
        drape_sim *sim = make(b, p);
        double start = drape_clock_cpu_seconds();
        p->good = !drape_sim_advance(sim, END);
        p->seconds = fmin(p->seconds, drape_clock_cpu_seconds() - start);
        p->error = distance(b->model, b->x, drape_sim_positions(sim));
        p->speed = distance(b->model, b->v, drape_sim_velocities(sim));
        p->work = drape_sim_statistics(sim);
        drape_sim_destroy(&sim);
    }
}

static void write_point(const bench *b, const point *p)
{
    const drape_statistics *w = &p->work;
    char order[16] = "";
    if (p->max_order > 0)
        snprintf(order, sizeof order, " %d", p->max_order);
    printf("%8s%-2s %-8s %-4s %9.3g ", p->integrator, order, p->controller, p->knob, p->value);
    if (p->good)
        printf("%10.3g %10.3g %7lld %5lld %9lld %9lld %8lld %9.4f\n", p->error, p->speed,
               (long long)w->steps_accepted, (long long)w->steps_rejected, (long long)w->residuals,
               (long long)w->jacobians, (long long)w->factorizations, p->seconds);
    else
        printf("did not complete: %s\n", drape_context_message(b->ctx));
    fflush(stdout);
    if (!b->csv)
        return;
    bench_csv_row(b->csv);
    fprintf(b->csv, "%s,%d,%s,%s,%.17g,%d,%.6g,%.6g,%lld,%lld,%lld,%lld,%lld,%.6f\n", p->integrator,
            p->max_order, p->controller, p->knob, p->value, p->good, p->error, p->speed,
            (long long)w->steps_accepted, (long long)w->steps_rejected, (long long)w->residuals,
            (long long)w->jacobians, (long long)w->factorizations, p->seconds);
}

static void add(bench *b, const char *integrator, const char *controller, const char *knob, double value,
                int max_order)
{
    point *p = &b->points[b->count++];
    *p = (point){.integrator = integrator,
                 .controller = controller,
                 .knob = knob,
                 .value = value,
                 .max_order = max_order};
    run(b, p);
    write_point(b, p);
}

static void add_integrator(bench *b, const drape_integrator_ops *ops)
{
    static const double rtols[] = {3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5, 1e-6},
                        controlled[] = {3e-2, 1e-2, 1e-3, 1e-4};
    static const int rates[] = {30, 60, 120, 240, 480, 960, 1920}, orders[] = {2, 5};
    const bool has_orders = drape_param_find(ops->entry.params, ops->entry.param_count, "max_order") >= 0;
    for (size_t i = 0; ops->own_steps && i < (has_orders ? sizeof orders / sizeof *orders : 1); i++)
        for (size_t k = 0; k < sizeof rtols / sizeof *rtols; k++)
            add(b, ops->entry.name, "halving", "rtol", rtols[k], has_orders ? orders[i] : 0);
    for (size_t i = 0; !ops->own_steps && i < sizeof rates / sizeof *rates; i++)
        add(b, ops->entry.name, "halving", "dt", 1.0 / rates[i], 0);
    for (size_t i = 0; !ops->own_steps && i < sizeof controlled / sizeof *controlled; i++)
        add(b, ops->entry.name, "error", "rtol", controlled[i], 0);
}

static const point *find(const bench *b, const char *integrator, double value, int max_order)
{
    for (int i = 0; i < b->count; i++) {
        const point *p = &b->points[i];
        if (strcmp(p->integrator, integrator) == 0 && strcmp(p->controller, "halving") == 0 &&
            fabs(p->value / value - 1) < 1e-9 && p->max_order == max_order)
            return p;
    }
    return NULL;
}

/* CPU time [s] of be with fixed steps at an error; NaN outside the range of the table. */
static double seconds_of_be(const bench *b, double error)
{
    for (int i = 1; i < b->count; i++) {
        const point *p = &b->points[i - 1], *q = &b->points[i];
        if (strcmp(p->integrator, "be") != 0 || strcmp(q->integrator, "be") != 0 ||
            strcmp(p->knob, "dt") != 0 || strcmp(q->knob, "dt") != 0 || !p->good || !q->good ||
            p->error < error || q->error > error)
            continue;
        double share = log(p->error / error) / log(p->error / q->error);
        return exp(log(p->seconds) + share * log(q->seconds / p->seconds));
    }
    return NAN;
}

static void judge(const char *what, double value, double goal)
{
    printf("  %-44s %8.3f, goal %5.3g: %s\n", what, value, goal, value <= goal ? "reached" : "missed");
}

static void compare(const bench *b)
{
    const point *ida = find(b, "ida", 1e-3, 2), *be = find(b, "be", 1.0 / 60, 0);
    if (!ida || !be || !ida->good || !be->good)
        return;
    printf("ida at rtol 1e-3 (order 2, its default there) over be at 1/60 s\n");
    judge("error", ida->error / be->error, 0.6);
    judge("residuals", (double)ida->work.residuals / (double)be->work.residuals, 1.5);
    judge("jacobians", (double)ida->work.jacobians / (double)be->work.jacobians, 1);
    judge("CPU time of ida over be at the error of ida", ida->seconds / seconds_of_be(b, ida->error), 0.25);
    printf("the other points of ida: CPU time over that of be at the same error, within the range of be\n");
    for (int i = 0; i < b->count; i++) {
        const point *p = &b->points[i];
        double seconds = p->good && strcmp(p->integrator, "ida") == 0 ? seconds_of_be(b, p->error) : NAN;
        if (!isnan(seconds))
            printf("  order %d, rtol %-8g error %8.3g m: %.3f\n", p->max_order, p->value, p->error,
                   p->seconds / seconds);
    }
}

int main(int argc, char **argv)
{
    bench b = {.ctx = bench_context()};
    if (argc > 2 || (argc == 2 && argv[1][0] == '-')) {
        return bench_usage(argv[1],
                           "work [CSV]: error against work of every integrator on a falling sheet\n");
    }
    b.model = sheet(b.ctx);
    b.csv = bench_csv(
        argc == 2 ? argv[1] : NULL,
        "integrator,max_order,controller,knob,value,good,error_m,error_m_s,accepted,rejected,residuals,"
        "jacobians,factorizations,cpu_s");
    make_reference(&b);
    printf("%10s %-8s %-14s %10s %10s %7s %5s %9s %9s %8s %9s\n", "integrator", "control", "dt or rtol",
           "error m", "m/s", "steps", "rej.", "residuals", "jacobians", "factors", "CPU s");
    for (int i = 0; drape_integrators[i]; i++)
        if (!drape_integrators[i]->steady_state)
            add_integrator(&b, drape_integrators[i]);
    compare(&b);
    free(b.x);
    free(b.v);
    drape_model_destroy(&b.model);
    drape_context_destroy(&b.ctx);
    return b.csv && fclose(b.csv) != 0;
}
