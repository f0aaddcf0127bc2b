/* guess.c: see guess.h. */
#include "nonlinear/guess.h"

#include <string.h>

typedef void change_positions(drape_system *system, double t, double *x);

/* Changes the positions at d. */
static void change(drape_step_equation *e, change_positions *how, double *d)
{
    memcpy(e->x_ahead, e->x_base, e->nodes * sizeof *e->x_ahead);
    for (size_t i = 0; i < e->dofs; i++)
        e->x_ahead[drape_step_equation_at(e, i)] += d[i];
    how(e->system, e->point.t, e->x_ahead);
    for (size_t i = 0; i < e->dofs; i++) {
        const size_t at = drape_step_equation_at(e, i);
        if (e->x_ahead[at] != e->x_base[at] + d[i])
            d[i] = e->x_ahead[at] - e->x_base[at];
    }
    drape_system_project_free(e->system, d);
}

/* Whether something is passed on the straight path from the start of the step to d, pins moving along. */
static bool crosses(drape_step_equation *e, const double *d)
{
    drape_reason reason;
    drape_diagnostic diagnostic;
    drape_step_equation_move(e, d);
    return drape_system_crosses(e->system, e->x, e->point.t, &reason, &diagnostic);
}

/* Where the path of the guess begins: at the start of the step, aside from moving colliders, with the layers
 * that lie on what these push.
 *
 * Pins are at the end of the step already. Where they have gone through cloth by then, all of it goes
 * along with their mean displacement, or it would end on their wrong side. */
static void start_aside(drape_step_equation *e, double *aside)
{
    memset(aside, 0, e->dofs * sizeof *aside);
    change(e, drape_system_sweep, aside);
    if (!e->model->contact.self || !e->x_start)
        return;
    if (drape_step_equation_pins_move(e) && crosses(e, aside)) {
        drape_step_equation_follow_pins(e, aside);
        change(e, drape_system_sweep, aside);
        if (!crosses(e, aside))
            return;
        memset(aside, 0, e->dofs * sizeof *aside);
        change(e, drape_system_sweep, aside);
    }
    change(e, drape_system_carry_layers, aside);
}

void drape_guess_make_feasible(drape_step_equation *e, double *d, double *aside, double *fraction)
{
    drape_step_equation_move(e, d);
    /* springs beyond their limit pull with forces far above any others: d = 0 is better */
    if (drape_system_breaks_limit(e->system, e->x, e->x_base, e->point.internal))
        memset(d, 0, e->dofs * sizeof *d);
    if (e->has_contact) {
        /* What is shortened is the path from where moving colliders have put the nodes at the start of the
         * step: from the start itself, which may lie inside a collider at the end of the step, a part of
         * the path may end inside, too. It is shortened only at nodes that would meet something: all pairs
         * that come near in the step are active from the first matrix on, and none of them holds up the
         * rest of the cloth. */
        change(e, drape_system_sweep, d);
        start_aside(e, aside);
        drape_step_equation_move(e, aside);
        for (size_t i = 0; i < e->dofs; i++)
            d[i] -= aside[i];
        if (!drape_step_equation_shorten_nodes(e, d, fraction))
            drape_step_equation_make_feasible(e, d);
        for (size_t i = 0; i < e->dofs; i++)
            d[i] += aside[i];
    }
}
