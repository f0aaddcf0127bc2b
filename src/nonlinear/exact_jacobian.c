/* exact_jacobian.c: see exact_jacobian.h. */
#include "nonlinear/exact_jacobian.h"

#include <string.h>

struct drape_exact_jacobian {
    drape_system *system;
    drape_system_matrix *linear;
    bool contact_unsymmetric, terms_unsymmetric; /* the Jacobian of contact, of the terms may be */
};

drape_status drape_exact_jacobian_create(drape_arena *arena, drape_system *system,
                                         const drape_linear_ops *linear, bool symmetrizes,
                                         drape_exact_jacobian **out)
{
    drape_exact_jacobian *s = *out = drape_arena_take(arena, 1, sizeof *s);
    if (drape_ranks_agree_memory(drape_model_ranks(drape_system_model(system)), arena->ctx, s))
        return DRAPE_E_MEMORY;
    s->system = system;
    s->contact_unsymmetric = !drape_system_is_symmetric(system);
    s->terms_unsymmetric = !drape_system_has_symmetric_terms(system);
    /* Without friction, a flag of 13 x 13 nodes takes a quarter and three quarters more iterations with 1e-4
     * and 1e-3 than with 1e-5, others as many, and the least CPU with 1e-4. */
    const double tolerance = !symmetrizes             ? 0
                             : s->contact_unsymmetric ? DRAPE_LINEAR_TOLERANCE
                             : s->terms_unsymmetric   ? DRAPE_LINEAR_TIGHT
                                                      : 0;
    return drape_system_matrix_create(arena, system, linear, 0, tolerance, &s->linear);
}

static void destroy(void *matrix)
{
    drape_exact_jacobian *s = matrix;
    if (s)
        drape_system_matrix_destroy(&s->linear);
}

static drape_status assemble(void *matrix, const drape_point *at, double mass_weight, bool positive,
                             drape_work *work)
{
    drape_exact_jacobian *s = matrix;
    const double share = positive ? 1 : 0;
    drape_system_matrix *m = s->linear;
    const double before = drape_system_matrix_clock(m);
    drape_point point = *at;
    drape_status status = drape_system_matrix_follow(m, at);
    if (status)
        return status;
    point.contact = DRAPE_CONTACT_SYMMETRIC;
    drape_system_jacobian(s->system, &point, mass_weight, share, m->values);
    m->corrects = m->exact && (s->terms_unsymmetric || (s->contact_unsymmetric && share < 1));
    if (m->corrects) {
        memcpy(m->exact, m->values, (size_t)m->pattern->nonzeros * sizeof *m->exact);
        point.stress = NULL;
        drape_system_symmetrize(s->system, &point, share, m->values);
    }
    work->jacobians++;
    work->jacobian_seconds += drape_system_matrix_clock(m) - before;
    return DRAPE_OK;
}

static drape_status factor(void *matrix, bool definite, drape_work *work)
{
    drape_exact_jacobian *s = matrix;
    const drape_status status = drape_system_matrix_factor(s->linear, definite);
    *work = drape_work_with_linear(*work, s->linear);
    return status;
}

static drape_status solve(void *matrix, const double *b, double tolerance, double *x, bool *definite,
                          drape_work *work)
{
    drape_exact_jacobian *s = matrix;
    s->linear->tolerance = tolerance;
    *definite = true;
    const drape_status status = drape_system_matrix_solve(s->linear, b, x);
    *work = drape_work_with_linear(*work, s->linear);
    return status;
}

drape_status drape_exact_jacobian_at(drape_exact_jacobian *s, const drape_point *point, double mass_weight,
                                     const drape_pattern **pattern, const double **values)
{
    drape_status status = drape_system_matrix_follow(s->linear, point);
    if (status)
        return status;
    drape_system_jacobian(s->system, point, mass_weight, 0, s->linear->values);
    *pattern = drape_system_pattern(s->system);
    *values = s->linear->values;
    return DRAPE_OK;
}

static void archive(void *matrix, drape_archive *a)
{
    drape_exact_jacobian *s = matrix;
    if (drape_archive_has_read(a))
        drape_archive_note(a, drape_system_matrix_renew(s->linear));
    drape_system_matrix_archive(s->linear, a, false);
}

static size_t bytes(const void *matrix)
{
    return drape_system_matrix_bytes(((const drape_exact_jacobian *)matrix)->linear);
}

const drape_matrix_ops drape_exact_jacobian_ops = {.exact = true,
                                                   .direct = true,
                                                   .assemble = assemble,
                                                   .factor = factor,
                                                   .solve = solve,
                                                   .archive = archive,
                                                   .bytes = bytes,
                                                   .destroy = destroy};
