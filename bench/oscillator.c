/*
 * oscillator: what time integrators do to the energy of an undamped oscillator in 100 periods. Prints E/E0 -
 * 1, for ida over its orders and tolerances, for the fixed-step integrators over w h. A free node on a spring
 * with E = 1/2 m w^2 |x - x0|^2, a user-defined term (drape_context_add_term), starts at its rest position
 * with equal speeds along x, y and z, so that IDA's root mean square over the unknowns is that of a single
 * oscillator. Tolerances are relative to the amplitudes: atol_x = rtol A, atol_v = rtol A w.
 *
 * The last lines are of IDA alone, with the weights rtol |y| + atol, rtol = atol, and w = 1/s, x = 1, v = 0
 * at the start. The orders 1, 2, 4 and 5 change the energy by -100 %, -20 %, +424 % and -70 % at 1e-3, and by
 * -60 %, -5e-4, -1.4e-3 and -4.4e-3 at 1e-6. Drape's weights do not follow |y|, as errors would then depend
 * on where a scene lies; its numbers are different but alike in kind. From order 3 on, a factor of 2 in the
 * tolerance can change the sign: IDA mostly doubles its step or keeps it, and whether BDF adds or removes
 * energy depends on w h.
 *
 * Theory: in each step be multiplies E by 1/(1 + (w h)^2), bdf2 by 1 - (w h)^4/2 or less, midpoint by exactly
 * 1. BDF 3 to 5 are not A-stable: they add energy at the step lengths that loose tolerances lead to, and
 * remove energy at others.
 */
#include "bench.h"
#include "drape/extend.h"

#include <ida/ida.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#include "solvers/sundials_compat.h"

#define PERIODS 100
#define OMEGA   6.283185307179586 /* [1/s] */
#define SPEED   1.0               /* [m/s] along each axis, at rest position */

static drape_status build(const drape_cloth_view *cloth, const double *params, drape_term_builder *builder)
{
    (void)params;
    drape_status status = drape_term_reserve(builder, cloth->node_count, 4);
    for (int32_t i = 0; !status && i < cloth->node_count; i++) {
        const double *x = cloth->rest + 3 * (size_t)i;
        const double rest[4] = {cloth->node_mass[i] * OMEGA * OMEGA, x[0], x[1], x[2]};
        drape_term_set(builder, i, &i, rest);
    }
    return status;
}

static void one(const drape_elements *el, int32_t element, const double *x, double *e, double *g,
                double *hess)
{
    const double k = el->rest[element];
    double sum = 0;
    for (size_t i = 0; i < 3; i++) {
        const double d = x[i] - el->rest[(i + 1) * (size_t)el->count + (size_t)element];
        sum += d * d;
        if (g)
            g[i] = k * d;
    }
    if (e)
        *e = 0.5 * k * sum;
    for (int i = 0; hess && i < 9; i++)
        hess[i] = i % 4 == 0 ? k : 0;
}

static void energy(const drape_elements *el, int32_t first, int32_t count, const double *x,
                   const double *internal, double *e, double *g, double *hess)
{
    (void)internal;
    drape_energy_range(el, first, count, x, e, g, hess, one);
}

static const drape_term_ops harmonic = {
    .struct_size = sizeof(drape_term_ops),
    .entry = {.name = "bench.harmonic",
              .summary = "a spring that holds every node to its rest position",
              .reference = "-"},
    .element_name = "node",
    .nodes = 1,
    .build = build,
    .energy = energy};

/* E/E0 - 1 after 100 periods; NaN if the run did not complete. */
static double drift(drape_context *ctx, const drape_model *model, const char *integrator,
                    const drape_setting *settings, drape_statistics *work)
{
    drape_sim *sim = bench_sim(ctx, model, integrator, settings, "halving", NULL);
    const drape_energy before = drape_sim_energy(sim);
    const drape_status status = drape_sim_advance(sim, PERIODS * 2 * acos(-1) / OMEGA);
    const drape_energy after = drape_sim_energy(sim);
    *work = drape_sim_statistics(sim);
    drape_sim_destroy(&sim);
    return status ? NAN : (after.kinetic + after.elastic) / (before.kinetic + before.elastic) - 1;
}

static void print(FILE *csv, const char *name, int order, const char *knob, double value, double change,
                  const drape_statistics *work)
{
    printf("%-10s %5d  %-5s %8g  %+11.3e  %7lld %8lld\n", name, order, knob, value, change,
           (long long)work->steps_accepted, (long long)work->residuals);
    if (!csv)
        return;
    bench_csv_row(csv);
    fprintf(csv, "%s,%d,%s,%g,%.6e,%lld,%lld\n", name, order, knob, value, change,
            (long long)work->steps_accepted, (long long)work->residuals);
}

static void over_tolerances(drape_context *ctx, const drape_model *model, FILE *csv)
{
    static const double rtols[] = {1e-2, 1e-3, 1e-4, 1e-5, 1e-6};
    for (size_t k = 0; k < sizeof rtols / sizeof *rtols; k++)
        for (int order = 1; order <= 5; order++) {
            const drape_setting settings[] = {{"max_order", order, NULL},
                                              {"atol_x", rtols[k] * SPEED / OMEGA, NULL},
                                              {"atol_v", rtols[k] * SPEED, NULL},
                                              {0}};
            drape_statistics work;
            double change = drift(ctx, model, "ida", settings, &work);
            print(csv, "ida", order, "rtol", rtols[k], change, &work);
        }
}

static void over_steps(drape_context *ctx, const drape_model *model, const drape_integrator_ops *ops,
                       FILE *csv)
{
    static const double phases[] = {0.01, 0.1, 0.5, 1}; /* w h */
    for (size_t k = 0; k < sizeof phases / sizeof *phases; k++) {
        const drape_setting settings[] = {{"dt", phases[k] / OMEGA, NULL}, {"tolerance", 1e-13, NULL}, {0}};
        drape_statistics work;
        double change = drift(ctx, model, ops->entry.name, settings, &work);
        print(csv, ops->entry.name, ops->order, "w h", phases[k], change, &work);
    }
}

/* ---- IDA alone, with weights that follow |y| ---- */

/* x' = v, v' = -x */
static int bare_residual(sunrealtype t, N_Vector y, N_Vector rate, N_Vector out, void *user)
{
    (void)t, (void)user;
    const double *a = N_VGetArrayPointer(y), *b = N_VGetArrayPointer(rate);
    double *r = N_VGetArrayPointer(out);
    r[0] = b[0] - a[1];
    r[1] = b[1] + a[0];
    return 0;
}

static double bare_drift(int order, double tolerance, drape_statistics *work)
{
    SUNContext sun = NULL;
    double t = 0, end = PERIODS * 2 * acos(-1), change = NAN;
    long steps = 0, residuals = 0;
    *work = (drape_statistics){0};
    if (drape_sundials_create(&sun))
        return NAN;
    N_Vector y = N_VNew_Serial(2, sun), rate = N_VNew_Serial(2, sun);
    double *a = N_VGetArrayPointer(y), *b = N_VGetArrayPointer(rate);
    SUNMatrix matrix = SUNDenseMatrix(2, 2, sun);
    SUNLinearSolver solver = SUNLinSol_Dense(y, matrix, sun);
    void *ida = IDACreate(sun);
    a[0] = 1;
    a[1] = b[0] = 0;
    b[1] = -1;
    if (!IDAInit(ida, bare_residual, 0, y, rate) && !IDASStolerances(ida, tolerance, tolerance) &&
        !IDASetLinearSolver(ida, solver, matrix) && !IDASetMaxOrd(ida, order) &&
        !IDASetMaxNumSteps(ida, -1) && !IDASetStopTime(ida, end) &&
        IDASolve(ida, end, &t, y, rate, IDA_NORMAL) >= 0)
        change = a[0] * a[0] + a[1] * a[1] - 1;
    IDAGetNumSteps(ida, &steps);
    IDAGetNumResEvals(ida, &residuals);
    *work = (drape_statistics){.steps_accepted = steps, .residuals = residuals};
    IDAFree(&ida);
    SUNLinSolFree(solver);
    SUNMatDestroy(matrix);
    N_VDestroy(y);
    N_VDestroy(rate);
    SUNContext_Free(&sun);
    return change;
}

static void alone(FILE *csv)
{
    static const double tolerances[] = {1e-3, 1e-6};
    for (size_t k = 0; k < sizeof tolerances / sizeof *tolerances; k++)
        for (int order = 1; order <= 5; order++) {
            drape_statistics work;
            double change = bare_drift(order, tolerances[k], &work);
            print(csv, "ida alone", order, "rtol", tolerances[k], change, &work);
        }
}

int main(int argc, char **argv)
{
    if (argc > 2 || (argc == 2 && argv[1][0] == '-')) {
        return bench_usage(argv[1], "oscillator [CSV]: energy of an undamped oscillator after 100 periods\n");
    }
    drape_context *ctx = bench_context();
    if (drape_context_add_term(ctx, &harmonic))
        bench_fail(ctx, "the term");
    drape_model *model = bench_model(
        ctx,
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 2, 'rows': 2, 'width': 1, 'height': "
        "1},"
        "'material': {'young_modulus': 1, 'thickness': 1e-3, 'areal_density': 1}, 'terms': "
        "['bench.harmonic'],"
        "'velocity': [%g, %g, %g], 'pins': [{'nodes': [0, 1, 2]}]}], 'gravity': [0, 0, 0], 'duration': 1}",
        SPEED, SPEED, SPEED);
    FILE *csv =
        bench_csv(argc == 2 ? argv[1] : NULL, "integrator,order,knob,value,energy_change,steps,residuals");
    printf("%-10s %5s  %-14s  %11s  %7s %8s\n", "integrator", "order", "rtol or w h", "E/E0 - 1", "steps",
           "residuals");
    over_tolerances(ctx, model, csv);
    for (int i = 0; drape_integrators[i]; i++)
        if (!drape_integrators[i]->own_steps && !drape_integrators[i]->steady_state)
            over_steps(ctx, model, drape_integrators[i], csv);
    alone(csv);
    drape_model_destroy(&model);
    drape_context_destroy(&ctx);
    return csv && fclose(csv) != 0;
}
