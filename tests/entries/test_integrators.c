/* test_integrators.c: all integrators: form, step(in, out), free fall; and that a step that reports
 * convergence has converged. */
#include <stdio.h>

#include "integrators/integrator.h"
#include "models.h"
#include "solvers/linear.h"
#include "support/host.h"
#include "support/suite.h"

static int param_of(const drape_integrator_ops *ops, const char *name)
{
    return drape_param_find(ops->entry.params, ops->entry.param_count, name);
}

TEST(entries_are_well_formed)
{
    int count = 0;
    for (; drape_integrators[count]; count++) {
        const drape_integrator_ops *ops = drape_integrators[count];
        ck_assert_ptr_eq(drape_integrator_registry.entries[count], &ops->entry);
        ck_assert_int_ge(ops->order, ops->steady_state ? 0 : 1);
        ck_assert(ops->create && ops->step && ops->restart && ops->work);
        int dt = param_of(ops, "dt");
        ck_assert(dt >= 0 ? strcmp(ops->entry.params[dt].unit, "s") == 0 : ops->own_steps);
    }
    ck_assert_int_eq(drape_registry_count(&drape_integrator_registry), count);
}

/* Tests of hosts, which know names only, run all that have steps in time. */
TEST(hosts_have_all_methods)
{
    int count = 0;
    for (int i = 0; drape_integrators[i]; i++) {
        bool found = false;
        for (int k = 0; k < METHODS; k++)
            found |= strcmp(methods[k], drape_integrators[i]->entry.name) == 0;
        ck_assert_msg(found != drape_integrators[i]->steady_state, "%s", drape_integrators[i]->entry.name);
        count += found;
    }
    ck_assert_int_eq(count, METHODS);
}

/* Every integrator accepts the keys of the others, so a name has the same kind and unit in all of them. */
TEST(shared_names_mean_the_same)
{
    for (int i = 0; drape_integrators[i]; i++)
        for (int j = 0; j < i; j++)
            for (int p = 0; p < drape_integrators[i]->entry.param_count; p++) {
                const drape_param *one = &drape_integrators[i]->entry.params[p];
                int q = param_of(drape_integrators[j], one->name);
                if (q < 0)
                    continue;
                ck_assert_int_eq(one->kind, drape_integrators[j]->entry.params[q].kind);
                ck_assert_str_eq(one->unit, drape_integrators[j]->entry.params[q].unit);
            }
}

/* ---- One step ---- */

typedef struct stepper {
    drape_context *ctx;
    const drape_integrator_ops *ops;
    drape_model *model;
    drape_system *system;
    void *state;
    size_t n;
    drape_arena *arena;
    drape_state in, out, kept;
} stepper;

/* An irregular sheet that hangs by two nodes, with every kind of term, among them damping, drag and
 * bending. */
static stepper open_stepper(const drape_integrator_ops *ops, const double *values)
{
    const drape_setting beta = {"beta", 0.01, NULL}, drag = {"coefficient", 0.05, NULL};
    const drape_entry_def terms[] = {{.type = "stretch.edge"},
                                     {.type = "bend.hinge"},
                                     {"damp.kelvin_voigt", &beta, 1},
                                     {"drag.viscous", &drag, 1}};
    stepper s = {.ctx = make_context(), .ops = ops};
    s.model = make_model(
        s.ctx,
        &(model_def){.mesh = MESH_CURVED, .terms = terms, .term_count = 4, .gravity = true, .pinned = true});
    s.arena = drape_arena_create(s.ctx);
    s.system = make_system(s.arena, s.model, 1);
    assert_ok(s.ctx, ops->create(s.arena, s.system, values, &s.state));
    s.n = 3 * (size_t)s.model->node_count;
    ck_assert_int_eq(drape_state_create(s.arena, s.model, &s.in), DRAPE_OK);
    ck_assert_int_eq(drape_state_create(s.arena, s.model, &s.out), DRAPE_OK);
    ck_assert_int_eq(drape_state_create(s.arena, s.model, &s.kept), DRAPE_OK);
    return s;
}

static void close_stepper(stepper *s)
{
    if (s->ops->destroy)
        s->ops->destroy(&s->state);
    drape_system_destroy(&s->system);
    drape_arena_destroy(&s->arena);
    drape_model_destroy(&s->model);
    drape_context_destroy(&s->ctx);
}

#define scoped_stepper SCOPED(close_stepper) stepper

static void copy_state(const stepper *s, const drape_state *from, drape_state *to)
{
    to->t = from->t;
    memcpy(to->x, from->x, s->n * sizeof *to->x);
    memcpy(to->v, from->v, s->n * sizeof *to->v);
    memcpy(to->internal, from->internal, (size_t)s->model->internal_count * sizeof *to->internal);
}

static bool same_bits(const stepper *s, const drape_state *a, const drape_state *b)
{
    return a->t == b->t && memcmp(a->x, b->x, s->n * sizeof *a->x) == 0 &&
           memcmp(a->v, b->v, s->n * sizeof *a->v) == 0 &&
           memcmp(a->internal, b->internal, (size_t)s->model->internal_count * sizeof *a->internal) == 0;
}

static drape_status take_step(stepper *s, double h, drape_step_info *info)
{
    *info = (drape_step_info){.reason = DRAPE_REASON_OTHER};
    s->out.t = s->in.t + h;
    return s->ops->step(s->state, &s->in, &s->out, h, info);
}

/* Any value of it would replace the bound on errors, which is tested here. */
static bool replaces_a_bound(const drape_param *param)
{
    return strcmp(param->name, "fixed_step") == 0;
}

static void defaults(const drape_integrator_ops *ops, double *values)
{
    for (int i = 0; i < ops->entry.param_count; i++) {
        const drape_param *param = &ops->entry.params[i];
        values[i] = replaces_a_bound(param) ? NAN : generic_value(param);
    }
}

/* Calls use for every integrator with each choice of each parameter in turn, the others at their defaults. */
static void for_all_choices(void (*use)(const drape_integrator_ops *ops, const double *values,
                                        const char *what))
{
    for (int i = 0; drape_integrators[i]; i++) {
        const drape_integrator_ops *ops = drape_integrators[i];
        double values[DRAPE_MAX_PARAMS];
        if (ops->steady_state) /* an equilibrium is not a step in time */
            continue;
        defaults(ops, values);
        use(ops, values, "defaults");
        for (int p = 0; p < ops->entry.param_count; p++) {
            const drape_param *param = &ops->entry.params[p];
            bool choice = param->kind == DRAPE_PARAM_CHOICE;
            if (!choice && param->kind != DRAPE_PARAM_BOOLEAN)
                continue;
            for (int c = 0; choice ? param->choices[c] != NULL : c < 2; c++) {
                char what[100];
                snprintf(what, sizeof what, "%s %s", param->name,
                         choice ? param->choices[c]
                         : c    ? "on"
                                : "off");
                defaults(ops, values);
                values[p] = c;
                use(ops, values, what);
            }
        }
    }
}

/* Steps, whether they succeed or fail, leave `in` unchanged; after a restart the same `in` gives the same
 * bits. The exception is modified Newton: KINSOL keeps a part of the previous solve, which shows when steps
 * are inexact; there both results are within the tolerance. */
static void check_steps(const drape_integrator_ops *ops, const double *values, const char *what)
{
    scoped_stepper s = open_stepper(ops, values);
    drape_state first;
    bool modified = strcmp(what, "newton modified") == 0;
    ck_assert_int_eq(drape_state_create(s.arena, s.model, &first), DRAPE_OK);
    for (int k = 0; k < 12; k++) {
        drape_step_info info;
        bool hopeless = k == 6;
        double h = hopeless ? 1e5 : 1.0 / 60 / (1 + k % 3);
        copy_state(&s, &s.in, &s.kept);
        s.ops->restart(s.state, &s.in);
        drape_status status = take_step(&s, h, &info);
        ck_assert_msg(same_bits(&s, &s.in, &s.kept), "%s, %s: step %d wrote its input", ops->entry.name, what,
                      k);
        check_line(drape_reason_name(info.reason), "a reason");
        if (hopeless)
            continue;
        ck_assert_msg(status == DRAPE_OK, "%s, %s: step %d: %s", ops->entry.name, what, k,
                      drape_reason_name(info.reason));
        copy_state(&s, &s.out, &first);
        memset(s.out.x, 0xff, s.n * sizeof *s.out.x);
        memset(s.out.v, 0xff, s.n * sizeof *s.out.v);
        s.ops->restart(s.state, &s.in);
        ck_assert_int_eq(take_step(&s, h, &info), DRAPE_OK);
        ck_assert_msg(modified || same_bits(&s, &s.out, &first), "%s, %s: bits of step %d differ",
                      ops->entry.name, what, k);
        drape_state_commit(s.model, &s.in, &s.out);
        copy_state(&s, &s.out, &s.in);
    }
}

TEST(steps_do_not_write_their_input_and_repeat)
{
    for_all_choices(check_steps);
}

/* Two new integrators on the same path have the same bits without a restart. */
static void check_twins(const drape_integrator_ops *ops, const double *values, const char *what)
{
    scoped_stepper a = open_stepper(ops, values), b = open_stepper(ops, values);
    for (int k = 0; k < 10; k++) {
        drape_step_info one, other;
        ck_assert_int_eq(take_step(&a, 0.01, &one), DRAPE_OK);
        ck_assert_int_eq(take_step(&b, 0.01, &other), DRAPE_OK);
        ck_assert_msg(same_bits(&a, &a.out, &b.out), "%s, %s: step %d", ops->entry.name, what, k);
        ck_assert_int_eq(one.iterations, other.iterations);
        ck_assert(one.residual == other.residual || (isnan(one.residual) && isnan(other.residual)));
        drape_state_commit(a.model, &a.in, &a.out);
        drape_state_commit(b.model, &b.in, &b.out);
        copy_state(&a, &a.out, &a.in);
        copy_state(&b, &b.out, &b.in);
    }
}

TEST(equal_runs_have_equal_bits)
{
    for_all_choices(check_twins);
}

/* ---- What a step reports ---- */

/* The residual of backward Euler at out, from the states only: M (v1 - v0)/h + g(x1, v1) over free nodes, for
 * the mean of their masses, to which bounds that follow the load are proportional. */
static double residual_of(stepper *s, double h, double *history, double *g)
{
    double worst = 0, mass = 0;
    for (size_t i = 0; i < s->n; i += 3)
        mass += s->model->pinned[i / 3] ? 0 : s->model->mass[i / 3] / s->model->free_count;
    drape_system_measures(s->system, &(drape_point){.x = s->in.x, .internal = s->in.internal}, history);
    for (int64_t i = 0; i < s->model->measure_count; i++)
        history[i] /= -h;
    const drape_point point = {
        .x = s->out.x, .v = s->out.v, .internal = s->in.internal, .weight = 1 / h, .history = history};
    drape_system_force(s->system, &point, g);
    for (size_t i = 0; i < s->n; i++) {
        double f =
            mass / s->model->mass[i / 3] * (s->model->mass[i / 3] * (s->out.v[i] - s->in.v[i]) / h + g[i]);
        worst = fmax(worst, s->model->pinned[i / 3] ? 0 : fabs(f));
    }
    return worst;
}

/* Rounding: forces of about 10 N times 1e-16; positions of 1e-16 m times stiffnesses of 1e3 N/m and 0.01
 * kg/h^2. */
static void check_residual(const drape_integrator_ops *ops, const double *values, const char *what)
{
    if (strcmp(ops->entry.name, "be") != 0)
        return;
    scoped_stepper s = open_stepper(ops, values);
    double *history = drape_arena_take(s.arena, (size_t)s.model->measure_count, sizeof *history);
    double *g = drape_arena_take(s.arena, s.n, sizeof *g);
    for (int k = 0; k < 30; k++) {
        drape_step_info info;
        double h = k % 10 == 9 ? 0.005 : 0.02;
        drape_status status = take_step(&s, h, &info);
        if (status) { /* without a controller that halves it a step may fail, but must report it */
            ck_assert_int_ne(info.reason, DRAPE_REASON_CONVERGED);
            ck_assert(!(info.residual <= info.tolerance));
            ck_assert_msg(k > 2, "%s, %s: step %d: %s", ops->entry.name, what, k,
                          drape_reason_name(info.reason));
            break;
        }
        double actual = residual_of(&s, h, history, g);
        ck_assert_int_eq(info.reason, DRAPE_REASON_CONVERGED);
        ck_assert_double_le(info.residual, info.tolerance);
        ck_assert_msg(actual <= info.residual + 1e-11, "%s, %s: step %d has a residual of %g, not %g",
                      ops->entry.name, what, k, actual, info.residual);
        drape_state_commit(s.model, &s.in, &s.out);
        copy_state(&s, &s.out, &s.in);
    }
}

TEST(a_converged_step_is_converged)
{
    for_all_choices(check_residual);
}

/* One iteration is not enough for a sheet that is released: the step fails, or is accepted and reported as
 * not converged. */
TEST(a_step_that_has_not_converged_is_reported)
{
    for (int i = 0; drape_integrators[i]; i++)
        for (int accept = 0; accept < 2; accept++) {
            const drape_integrator_ops *ops = drape_integrators[i];
            double values[DRAPE_MAX_PARAMS];
            int max_iterations = param_of(ops, "max_iterations"), on_failure = param_of(ops, "on_failure");
            if (max_iterations < 0 || on_failure < 0 || ops->steady_state)
                continue;
            defaults(ops, values);
            values[max_iterations] = 1;
            values[on_failure] = accept;
            scoped_stepper s = open_stepper(ops, values);
            drape_step_info info;
            ck_assert_int_eq(take_step(&s, 0.05, &info), DRAPE_RETRY_NONLINEAR);
            ck_assert_int_eq(info.reason, DRAPE_REASON_MAX_ITERATIONS);
            ck_assert_int_eq(info.usable, accept);
            ck_assert(info.iterations == 1 || (accept && info.iterations == 2)); /* two stages */
            ck_assert_double_gt(info.residual, info.tolerance);
            ck_assert_double_eq(info.diagnostic.value, info.residual);
            ck_assert_double_eq(info.diagnostic.limit, info.tolerance);
            ck_assert(info.diagnostic.node[0] >= 0 && !s.model->pinned[info.diagnostic.node[0]]);
        }
}

/* ---- Sims
 * ----------------------------------------------------------------------------------------------------------
 */

/* How far free fall may be off after a time t. Order 1 leads or lags by g h t/2; higher orders are exact
 * except for a start of order 1, about g h^2; methods that choose their steps keep to rtol 1e-3 of 0.5 m in
 * each of a few. */
static double fall_tolerance(const drape_integrator_ops *ops, double h, double t)
{
    if (ops->own_steps)
        return 0.01;
    return ops->order == 1 ? 9.81 * h * t / 2 * (1 + 1e-9) : 9.81 * h * h;
}

TEST(a_triangle_falls_freely)
{
    static const double x[] = {0.1, 0.2, 0.3, 0.4, 0.2, 0.3, 0.2, 0.2, 0.7};
    static const int32_t triangle[] = {0, 1, 2};
    const drape_setting material[] = {
        {"young_modulus", 1e3, NULL}, {"thickness", 1e-3, NULL}, {"areal_density", 0.2, NULL}};
    const drape_entry_def terms[] = {{.type = "stretch.edge"}, {.type = "bend.hinge"}};
    drape_scene_def scene = scene_def();
    drape_cloth_def cloth = {.name = NULL};
    drape_cloth_def_init(&cloth, sizeof cloth);
    cloth.mesh.positions = x;
    cloth.mesh.triangles = triangle;
    cloth.mesh.node_count = 3;
    cloth.mesh.triangle_count = 1;
    cloth.material = material;
    cloth.material_count = 3;
    cloth.terms = terms;
    cloth.term_count = 2;
    cloth.velocity[0] = 0.5;
    scene.cloths = &cloth;
    scene.cloth_count = 1;
    for (int i = 0; drape_integrators[i]; i++) {
        if (drape_integrators[i]->steady_state)
            continue;
        const double h = 0.01, t = 0.5;
        scoped_context *ctx = make_context();
        scoped_model *model = NULL;
        scoped_sim *sim = NULL;
        drape_sim_def def = sim_def();
        assert_ok(ctx, drape_model_create(ctx, &scene, &model));
        def.integrator = drape_integrators[i]->entry.name;
        def.dt = drape_integrators[i]->own_steps ? 0 : h;
        ck_assert_int_eq(drape_sim_create(ctx, model, &def, &sim), DRAPE_OK);
        ck_assert_int_eq(drape_sim_advance(sim, t), DRAPE_OK);
        ck_assert(drape_integrators[i]->own_steps || drape_sim_statistics(sim).steps_accepted == 50);
        for (int k = 0; k < 9; k++) {
            double exact = x[k] + (k % 3 == 0 ? 0.5 * t : k % 3 == 1 ? -9.81 / 2 * t * t : 0);
            double tolerance = k % 3 == 1 ? fall_tolerance(drape_integrators[i], h, t) : 1e-9;
            ck_assert_double_eq_tol(drape_sim_positions(sim)[k], exact, tolerance);
        }
    }
}
