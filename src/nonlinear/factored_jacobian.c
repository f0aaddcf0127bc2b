/* factored_jacobian.c: see factored_jacobian.h. */
#include "nonlinear/factored_jacobian.h"

#include "base/clock.h"
#include "base/finite.h"
#include "base/vec3.h"
#include "nonlinear/nonsymmetric.h"
#include "nonlinear/scalar_stiffness.h"
#include "solvers/pcg.h"

#include <math.h>
#include <string.h>

/* How far a wave of stretching may travel in a step, in sizes of the scene, for conjugate gradients. One
 * iteration with them is .019, .051 and .076 m from the converged step on a sheet of 1 m over which waves
 * travel 0.8, 2.6 and 4.4 times, and .001, .005 and .009 m with factors, for two to three times the time. */
#define MAX_TRAVEL 1
/* Free nodes up to which factors cost no more than conjugate gradients. */
#define FEW_NODES 200
/* Of what is lumped in N beside the inertia of a step: beyond, conjugate gradients take ten iterations and
 * more and, on irregular meshes, negative entries that are lumped outweigh the inertia. */
#define MAX_LUMPED 20
/* Of the tolerance of a solution, where bending is lumped: sheets that hang by two corners are 0.5 to 7 mm of
 * 1 m from the converged step with all of it, and 0.4 to 0.7 mm with 0.01, as with factors of the whole
 * matrix, for one or two iterations more in each solution. */
#define LUMPED_TOLERANCE 0.01

struct drape_factored_jacobian {
    drape_system *system;
    bool *flat;        /* (terms) those that C stands for */
    bool nonsymmetric; /* the Jacobian of the terms may be */
    bool lumps;        /* N is factored, in a pattern without what only C couples; else A */
    drape_scalar_stiffness scalar;
    int32_t *block; /* (entries of C) in the pattern; -1: lumped */
    drape_pcg pcg;
    drape_nonsymmetric rest;
    drape_system_matrix *linear;
};

/* ---- Where it is better ---- */

/* The mean square speed of waves along the pairs of a term at rest, l^2 k/m [m2/s2]. */
static double mean_square_speed(const drape_system *system, int32_t term, const double *h)
{
    const drape_model *m = drape_system_model(system);
    const drape_elements *el = &m->terms[term].elements;
    double sum = 0, d[3];
    for (int32_t i = 0; i < el->count; i++) {
        const size_t a = (size_t)el->node[2 * i], b = (size_t)el->node[2 * i + 1];
        const double k = h[6 * i] + h[6 * i + 3] + h[6 * i + 5], mass = (m->mass[a] + m->mass[b]) / 2;
        vec3_sub(m->rest + 3 * a, m->rest + 3 * b, d);
        sum += mass > 0 ? vec3_dot(d, d) * k / mass : 0;
    }
    return el->count > 0 ? sum / el->count : 0;
}

/* The speed of waves in the stiffest term of pairs. */
static drape_status wave_speed(drape_system *system, drape_arena *scratch, double *speed)
{
    const drape_model *m = drape_system_model(system);
    drape_state rest;
    drape_status status = drape_state_create(scratch, m, &rest);
    *speed = 0;
    for (int32_t t = 0; !status && t < m->term_count; t++) {
        const drape_point point = {.x = m->rest, .v = rest.v, .internal = rest.internal};
        if (!m->terms[t].ops->pair)
            continue;
        double *h = drape_arena_take(scratch, 6 * (size_t)m->terms[t].elements.count, sizeof *h);
        if (!h)
            return DRAPE_E_MEMORY;
        drape_system_pairs(system, t, &point, h);
        *speed = fmax(*speed, sqrt(mean_square_speed(system, t, h)));
    }
    return status;
}

drape_status drape_factored_jacobian_is_better(drape_system *system, double dt, bool *better, bool *needed)
{
    const drape_model *m = drape_system_model(system);
    drape_arena scratch = drape_arena_of(m->ctx);
    bool *flat = drape_arena_take(&scratch, (size_t)m->term_count, sizeof *flat);
    double speed = 0;
    drape_status status = drape_arena_status(&scratch);
    if (!status)
        status = drape_scalar_stiffness_covers(system, flat);
    if (!status)
        status = wave_speed(system, &scratch, &speed);
    *needed = m->free_count <= FEW_NODES;
    for (int32_t t = 0; !status && t < m->term_count; t++) {
        const drape_term_ops *ops = m->terms[t].ops;
        *needed |= ops->measure && !ops->pair && !flat[t];
        /* drag that couples nodes is not symmetric, and large beside the inertia of light cloth */
        *needed |= ops->in_medium && ops->nodes > 1;
    }
    *better = *needed || speed * dt > MAX_TRAVEL * m->length;
    drape_arena_free(&scratch);
    return status;
}

/* ---- Update ---- */

/* Finds the entries of C in the pattern. The columns of both are in order, and C is symmetric. */
static void place_scalars(drape_factored_jacobian *s)
{
    const drape_pattern *p = drape_system_pattern(s->system);
    const drape_scalar_stiffness *c = &s->scalar;
    for (int32_t j = 0; j < c->n; j++) {
        int32_t block = p->block_start[j];
        for (int32_t k = c->start[j]; k < c->start[j + 1]; k++) {
            while (block + 1 < p->block_start[j + 1] && p->block_row[block] < c->column[k])
                block++;
            s->block[k] = p->block_row[block] == c->column[k] ? block : -1;
        }
    }
}

static drape_status compute(drape_factored_jacobian *s, const drape_point *at, double mass_weight,
                            bool positive)
{
    const int64_t version = s->linear->version;
    drape_point point = *at;
    point.contact = DRAPE_CONTACT_GAUSS_NEWTON;
    drape_status status = drape_system_matrix_follow(s->linear, at);
    if (status)
        return status;
    if (s->linear->version != version)
        place_scalars(s);
    drape_scalar_stiffness_weigh(&s->scalar, at->weight, mass_weight);
    drape_system_jacobian_without(s->system, &point, 0, positive ? 1 : 0, s->flat, s->linear->values);
    /* C and the masses; what is not in the pattern is lumped. */
    const drape_pattern *p = drape_system_pattern(s->system);
    const drape_scalar_stiffness *c = &s->scalar;
    for (int32_t j = 0; j < c->n; j++)
        for (int32_t k = c->start[j]; k < c->start[j + 1]; k++) {
            int64_t stride;
            double *to = drape_pattern_at(p, s->linear->values, j,
                                          s->block[k] >= 0 ? s->block[k] : p->diagonal[j], &stride);
            for (int r = 0; r < 3; r++)
                to[r * stride + r] += c->sum[k];
        }
    status = drape_nonsymmetric_update(&s->rest, &point, s->nonsymmetric ? s->linear->values : NULL);
    drape_pattern_symmetrize(drape_system_pattern(s->system), s->linear->values);
    drape_system_project_matrix(s->system, s->linear->values);
    return status;
}

static drape_status assemble(void *matrix, const drape_point *point, double mass_weight, bool positive,
                             drape_work *work)
{
    drape_factored_jacobian *s = matrix;
    const double start = drape_system_matrix_clock(s->linear), factoring = s->linear->factor_seconds;
    drape_status status = compute(s, point, mass_weight, positive);
    work->jacobians++;
    work->jacobian_seconds += drape_system_matrix_clock(s->linear) - start;
    work->factor_seconds += s->linear->factor_seconds - factoring; /* of the analysis of a new pattern */
    return status;
}

static drape_status factor(void *matrix, bool definite, drape_work *work)
{
    drape_factored_jacobian *s = matrix;
    const double before = s->linear->factor_seconds;
    const drape_status status = drape_system_matrix_factor(s->linear, definite);
    work->factorizations++;
    work->factor_seconds += s->linear->factor_seconds - before;
    return status;
}

/* ---- Solve ---- */

/* y = A x */
static void multiply(const void *owner, const double *x, double *y)
{
    const drape_factored_jacobian *s = owner;
    const drape_scalar_stiffness *c = &s->scalar;
    /* y = N x, which is symmetric: column by column. */
    const drape_pattern *p = drape_system_pattern(s->system);
    for (int32_t j = 0; j < p->block_count; j++) {
        double sum[3] = {0};
        for (int32_t k = p->block_start[j]; k < p->block_start[j + 1]; k++) {
            int64_t stride;
            const double *a = drape_pattern_at(p, s->linear->values, j, k, &stride),
                         *from = x + 3 * (size_t)p->block_row[k];
            for (int r = 0; r < 3; r++)
                sum[r] += vec3_dot(a + r * stride, from);
        }
        memcpy(y + 3 * (size_t)j, sum, sizeof sum);
    }
    for (int32_t i = 0; i < c->n; i++)
        for (int32_t k = c->start[i]; k < c->start[i + 1]; k++)
            for (size_t r = 0; s->block[k] < 0 && r < 3; r++)
                y[3 * (size_t)i + r] += c->sum[k] * (x[3 * (size_t)c->column[k] + r] - x[3 * (size_t)i + r]);
    drape_system_project_free(s->system, y);
}

/* z = N^-1 r. Without a solution it is 0, where conjugate gradients end. */
static void precondition(const void *owner, const double *r, double *z)
{
    const drape_factored_jacobian *s = owner;
    if (drape_system_matrix_solve(s->linear, r, z))
        memset(z, 0, (size_t)s->pcg.n * sizeof *z);
}

static void solve_factored(void *factors, const double *b, double *x)
{
    precondition(factors, b, x);
}

static drape_status solve(void *matrix, const double *b, double tolerance, double *x, bool *definite,
                          drape_work *work)
{
    drape_factored_jacobian *s = matrix;
    const double start = drape_clock_seconds();
    int iterations = 1;
    drape_status status = DRAPE_OK;
    *definite = true;
    if (!drape_nonsymmetric_solve(&s->rest, b, x, &iterations)) {
        if (s->lumps) {
            drape_pcg_solve(&s->pcg, b, x, LUMPED_TOLERANCE * tolerance, DRAPE_LINEAR_ITERATIONS);
            iterations = s->pcg.iterations;
            *definite = s->pcg.definite;
            status = s->linear->status                       ? s->linear->status
                     : drape_all_finite(x, (size_t)s->pcg.n) ? DRAPE_OK
                                                             : DRAPE_RETRY_LINEAR;
        } else {
            status = drape_system_matrix_solve(s->linear, b, x);
        }
    }
    work->linear_iterations += iterations;
    work->solve_seconds += drape_clock_seconds() - start;
    return status;
}

bool drape_factored_jacobian_is_lumped(const drape_factored_jacobian *s)
{
    return s->lumps;
}

const double *drape_factored_jacobian_values(const drape_factored_jacobian *s)
{
    return s->linear->values;
}

/* ---- Creation and destruction ---- */

/* What is lumped in N, as a share of the inertia in a step. */
static double lumped_share(drape_factored_jacobian *s, double dt)
{
    const drape_scalar_stiffness *c = &s->scalar;
    double lumped = 0, inertia = 0;
    drape_scalar_stiffness_weigh(&s->scalar, 1 / dt, 1 / (dt * dt));
    for (int32_t i = 0; i < c->n; i++) {
        inertia += c->mass_weight * c->model->mass[c->model->node_of_free[i]];
        for (int32_t k = c->start[i]; k < c->start[i + 1]; k++)
            lumped += s->block[k] < 0 ? fabs(c->sum[k]) : 0;
    }
    return lumped / inertia;
}

/* Leaves bending out of the pattern where N is near A and has less than half of its entries, as with
 * bend.midedge: with those of hinges, factors of 900 nodes cost hardly more than conjugate gradients. */
static drape_status choose_pattern(drape_factored_jacobian *s, double dt)
{
    const int64_t all = drape_system_pattern(s->system)->nonzeros;
    drape_status status = drape_system_leave_out(s->system, s->flat);
    if (status)
        return status;
    place_scalars(s);
    s->lumps = 2 * drape_system_pattern(s->system)->nonzeros < all && lumped_share(s, dt) <= MAX_LUMPED;
    if (!s->lumps)
        drape_system_leave_out(s->system, NULL);
    place_scalars(s);
    return DRAPE_OK;
}

drape_status drape_factored_jacobian_create(drape_arena *arena, drape_system *system, double dt,
                                            drape_factored_jacobian **out)
{
    drape_factored_jacobian *s = *out = drape_arena_take(arena, 1, sizeof *s);
    const drape_model *m = drape_system_model(system);
    if (!s)
        return DRAPE_E_MEMORY;
    s->system = system;
    s->nonsymmetric = !drape_system_has_symmetric_terms(system);
    s->flat = drape_arena_take(arena, (size_t)m->term_count, sizeof *s->flat);
    drape_status status = drape_arena_status(arena);
    if (!status)
        status = drape_scalar_stiffness_covers(system, s->flat);
    if (!status)
        status = drape_scalar_stiffness_build(arena, system, s->flat, &s->scalar);
    if (status)
        return status;
    s->block = drape_arena_take(arena, (size_t)s->scalar.start[s->scalar.n], sizeof *s->block);
    s->pcg = drape_pcg_of(arena, 3 * (int64_t)m->free_count, s, multiply, precondition);
    status = drape_nonsymmetric_init(arena, system, s->nonsymmetric, s, multiply, solve_factored, &s->rest);
    if (!status)
        status = drape_arena_status(arena);
    if (!status)
        status = choose_pattern(s, dt);
    if (status)
        return status;
    return drape_system_matrix_create(arena, system, drape_linear_best(3 * (int64_t)m->free_count), 0, 0,
                                      &s->linear);
}

static void destroy(void *matrix)
{
    drape_factored_jacobian *s = matrix;
    if (!s)
        return;
    drape_system_matrix_destroy(&s->linear);
    drape_nonsymmetric_free(&s->rest);
}

/* Each solve begins with a new matrix, so the factors themselves are not archived. */
static void archive(void *matrix, drape_archive *a)
{
    drape_factored_jacobian *s = matrix;
    drape_archive_mark(a, "factored jacobian");
    if (drape_archive_has_read(a)) {
        drape_archive_note(a, drape_system_matrix_renew(s->linear));
        place_scalars(s);
    }
    drape_system_matrix_archive(s->linear, a, false);
}

static size_t bytes(const void *matrix)
{
    return drape_system_matrix_bytes(((const drape_factored_jacobian *)matrix)->linear);
}

const drape_matrix_ops drape_factored_jacobian_ops = {.direct = true,
                                                      .assemble = assemble,
                                                      .factor = factor,
                                                      .solve = solve,
                                                      .archive = archive,
                                                      .bytes = bytes,
                                                      .destroy = destroy};
