/* solve_report.c: see solve_report.h. */
#include "nonlinear/solve_report.h"

void drape_work_archive(drape_work *work, drape_archive *a)
{
    int64_t *const counts[] = {&work->unstable_modes, &work->newton_iterations, &work->jacobians,
                               &work->factorizations, &work->linear_iterations, &work->residuals};
    double *const seconds[] = {&work->residual_seconds, &work->jacobian_seconds, &work->factor_seconds,
                               &work->solve_seconds, &work->contact_seconds};
    drape_archive_bool(a, &work->stability_known);
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++)
        drape_archive_int64(a, counts[i]);
    for (size_t i = 0; i < sizeof seconds / sizeof *seconds; i++)
        drape_archive_double(a, seconds[i]);
}

drape_work drape_work_with_linear(drape_work work, const drape_system_matrix *matrix)
{
    if (!matrix)
        return work;
    work.factorizations = matrix->factorizations;
    work.linear_iterations = matrix->iterations;
    work.factor_seconds = matrix->factor_seconds;
    work.solve_seconds = matrix->solve_seconds;
    return work;
}

drape_work drape_work_sum(drape_work work, const drape_work *other)
{
    if (work.residuals == 0) { /* it has made no step since */
        work.stability_known = other->stability_known;
        work.unstable_modes = other->unstable_modes;
    }
    work.newton_iterations += other->newton_iterations;
    work.jacobians += other->jacobians;
    work.factorizations += other->factorizations;
    work.linear_iterations += other->linear_iterations;
    work.residuals += other->residuals;
    work.residual_seconds += other->residual_seconds;
    work.jacobian_seconds += other->jacobian_seconds;
    work.factor_seconds += other->factor_seconds;
    work.solve_seconds += other->solve_seconds;
    work.contact_seconds += other->contact_seconds;
    return work;
}

drape_status drape_solver_status(drape_reason reason)
{
    switch (reason) {
    case DRAPE_REASON_CONVERGED:
        return DRAPE_OK;
    case DRAPE_REASON_ERROR_TEST:
    case DRAPE_REASON_ROUND_OFF:
        return DRAPE_RETRY_REJECTED;
    case DRAPE_REASON_SINGULAR:
        return DRAPE_RETRY_LINEAR;
    case DRAPE_REASON_NONFINITE:
        return DRAPE_RETRY_NONFINITE;
    case DRAPE_REASON_MEMORY:
        return DRAPE_E_MEMORY;
    case DRAPE_REASON_SOLVER:
        return DRAPE_E_SOLVER;
    default:
        return DRAPE_RETRY_NONLINEAR;
    }
}

drape_reason drape_solver_reason(const drape_solver_code *codes, size_t count, int code)
{
    for (size_t i = 0; i < count; i++)
        if (codes[i].code == code)
            return codes[i].reason;
    return DRAPE_REASON_SOLVER;
}
