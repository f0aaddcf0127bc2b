/* system_matrix.c: see system_matrix.h. */
#include "nonlinear/system_matrix.h"

#include "base/clock.h"

#include <string.h>

/* ---- Pattern ---- */

static bool has_pattern(const drape_system_matrix *m)
{
    return m->version == drape_system_pattern_version(m->system);
}

/* Takes the arrays for the system's pattern and creates the solver; neither exists yet. */
static drape_status take_pattern(drape_system_matrix *m)
{
    const drape_pattern *p = m->pattern = drape_system_pattern(m->system);
    const size_t nonzeros = (size_t)p->nonzeros;
    drape_status status = DRAPE_OK;
    m->values = drape_arena_take(&m->arena, nonzeros, sizeof *m->values);
    for (int k = 0; k < m->more_count; k++)
        m->more[k] = drape_arena_take(&m->arena, nonzeros, sizeof *m->more[k]);
    if (m->ops->set_positions)
        m->positions = drape_arena_take(&m->arena, (size_t)p->n, sizeof *m->positions);
    if (m->correction_tolerance > 0) {
        m->exact = drape_arena_take(&m->arena, nonzeros, sizeof *m->exact);
        status = drape_refine_create(&m->arena, p, &m->refine);
    }
    status = drape_ranks_agree(p->ranks, m->arena.ctx, status ? status : drape_arena_status(&m->arena));
    if (!status)
        status = m->ops->create(&m->arena, p, &m->solver);
    if (status)
        return status;
    if (m->ops->use_threads)
        m->ops->use_threads(m->solver, drape_system_pool(m->system));
    if (m->ops->watch)
        m->ops->watch(m->solver, drape_system_cancel_flag(m->system));
    m->version = drape_system_pattern_version(m->system);
    return DRAPE_OK;
}

drape_status drape_system_matrix_renew(drape_system_matrix *m)
{
    if (has_pattern(m))
        return DRAPE_OK;
    const double start = drape_clock_seconds();
    m->version = -1;
    m->corrects = false;
    drape_linear_destroy(m->ops, &m->solver);
    drape_arena_free(&m->arena);
    const drape_status status = take_pattern(m);
    m->factor_seconds += drape_clock_seconds() - start;
    return status;
}

drape_status drape_system_matrix_follow(drape_system_matrix *m, const drape_point *point)
{
    const int32_t *node = drape_system_model(m->system)->node_of_free;
    bool changed;
    drape_status status = drape_system_extend_pattern(m->system, point, &changed);
    if (!status)
        status = drape_system_matrix_renew(m);
    if (status || !m->positions)
        return status;
    for (int32_t j = 0; j < m->pattern->block_count; j++)
        memcpy(m->positions + 3 * (size_t)j, point->x + 3 * (size_t)node[j], 3 * sizeof *point->x);
    m->ops->set_positions(m->solver, m->positions);
    return DRAPE_OK;
}

/* ---- Factors ---- */

drape_status drape_system_matrix_factor(drape_system_matrix *m, bool definite)
{
    const double start = drape_clock_seconds();
    m->status = (definite && m->ops->factor_definite ? m->ops->factor_definite : m->ops->factor)(m->solver,
                                                                                                 m->values);
    m->factor_seconds += drape_clock_seconds() - start;
    m->factorizations++;
    return m->status;
}

/* x = M^-1 b with the matrix M that was factored. */
static drape_status solve_factored(drape_system_matrix *m, const double *b, double *x)
{
    int64_t iterations = 1;
    const drape_status status = m->ops->solve_inexact && m->tolerance > 0
                                    ? m->ops->solve_inexact(m->solver, b, x, m->tolerance, &iterations)
                                    : m->ops->solve(m->solver, b, x);
    m->iterations += iterations;
    return status;
}

/* The first failure of a solve stays in m->status. */
static void precondition(void *user, const double *b, double *x)
{
    drape_system_matrix *m = user;
    if (!m->status)
        m->status = solve_factored(m, b, x);
    if (m->status)
        memset(x, 0, (size_t)drape_pattern_own(m->pattern) * sizeof *x);
}

drape_status drape_system_matrix_solve(drape_system_matrix *m, const double *b, double *x)
{
    const double start = drape_clock_seconds();
    m->status = DRAPE_OK;
    if (m->corrects)
        drape_refine_reduce(&m->refine, precondition, m, m->exact, b, m->correction_tolerance, x);
    else
        m->status = solve_factored(m, b, x);
    m->solve_seconds += drape_clock_seconds() - start;
    return m->status;
}

/* ---- The object ---- */

drape_status drape_system_matrix_create(drape_arena *arena, drape_system *system, const drape_linear_ops *ops,
                                        int more_count, double correction_tolerance,
                                        drape_system_matrix **out)
{
    drape_system_matrix *m = *out = drape_arena_take(arena, 1, sizeof *m);
    drape_status status =
        drape_ranks_agree_memory(drape_model_ranks(drape_system_model(system)), arena->ctx, m);
    if (!status) {
        *m = (drape_system_matrix){.system = system,
                                   .ops = ops,
                                   .version = -1,
                                   .arena = drape_arena_within(arena),
                                   .more_count = more_count,
                                   .correction_tolerance = correction_tolerance};
        status = take_pattern(m);
    }
    if (status)
        drape_system_matrix_destroy(out);
    return status;
}

void drape_system_matrix_destroy(drape_system_matrix **out)
{
    drape_system_matrix *m = *out;
    if (m && m->ops) {
        drape_linear_destroy(m->ops, &m->solver);
        drape_arena_free(&m->arena);
    }
    *out = NULL;
}

double drape_system_matrix_clock(const drape_system_matrix *m)
{
    return drape_system_clock(m->system) - m->factor_seconds;
}

size_t drape_system_matrix_bytes(const drape_system_matrix *m)
{
    return m ? drape_linear_bytes(m->ops, m->solver) : 0;
}

void drape_system_matrix_archive(drape_system_matrix *m, drape_archive *a, bool factors)
{
    bool there = m->solver && has_pattern(m);
    drape_archive_mark(a, m->ops->entry.name);
    drape_archive_int64(a, &m->factorizations);
    drape_archive_int64(a, &m->iterations);
    drape_archive_double(a, &m->factor_seconds);
    drape_archive_double(a, &m->solve_seconds);
    drape_archive_bool(a, &there);
    if (!there)
        return;
    drape_archive_same(a, "the number of nonzeros", m->pattern->nonzeros);
    if (factors)
        drape_archive_doubles(a, m->values, (size_t)m->pattern->nonzeros);
    if (m->exact)
        drape_archive_bool(a, &m->corrects);
    if (factors && m->corrects)
        drape_archive_doubles(a, m->exact, (size_t)m->pattern->nonzeros);
    drape_linear_archive(m->ops, m->solver, a, factors ? m->values : NULL);
}
