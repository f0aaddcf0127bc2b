/*
 * check.c: see check.h. For each term, the functions that its author wrote are checked element by
 * element, one coordinate at a time. Then the assembled Jacobian is checked along random directions, as
 * step methods and as IDA use it. Errors are relative to the largest entry of the derivative; for a
 * Hessian also to the gradient over the element's size, because a linear term has no Hessian.
 *
 * The step of the differences is the cube root of epsilon in mean edge lengths, 7.6e-6: the truncation
 * error is about its square, 6e-11, the rounding error 1e-16/8e-6. Barriers change over lengths far below
 * that, so shorter steps are tried, too, and the smallest error counts: a wrong derivative is wrong at
 * all of them. Where a barrier begins, its gradient is arbitrarily small, so an element's error is
 * relative to at least a millionth of the term's largest entry.
 *
 * Derivatives of contact jump where a closest point leaves a face or an edge; some of thousands of pairs
 * are nearer to that than any step, but not on both sides. Of nearly parallel edges they change over 1e-8
 * m. So along a direction slopes to either side count, extrapolated, with steps that only exact positions
 * allow.
 *
 * Contact is checked where the scene has it: the sheet is moved until its deepest node is half of the
 * activation distance away from a collider, or is folded onto itself; steps are relative to that
 * distance.
 */
#include "assemble/check.h"

#include "base/rotation.h"
#include "colliders/colliders.h"

#include <float.h>
#include <math.h>
#include <string.h>

#define D               DRAPE_MAX_ELEMENT_DOFS
#define SAMPLE          200 /* approximate number of elements of a term that are checked */
#define DIRECTIONS      8
#define DEFORMATION     0.08                        /* of the mean edge length, in each coordinate */
#define DIFFERENCE_STEP ldexp(1, -DBL_MANT_DIG / 3) /* of the mean edge length */
#define FINER           8.0                         /* how many times shorter than the last a step is, */
#define LEVELS          5                           /* of so many steps */
/* of the term's largest derivative: the smallest scale of an element's errors */
#define MIN_SCALE        1e-6
#define GRADIENT_LIMIT   1e-7
#define HESSIAN_LIMIT    1e-6
#define INVARIANCE_LIMIT 1e-9

typedef struct checker {
    drape_system *system;
    const drape_model *model;
    uint64_t random;
    double size; /* [m] mean edge length */
    double *x, *v, *internal, *history;
    double *x2, *v2, *g1, *g2, *direction; /* (node_count x 3) scratch */
    double *beside[2 * LEVELS];            /* forces after and before a state, of each step */
    double *values;                        /* a Jacobian in the system's pattern */
    drape_arena *arena;
    drape_check_result *results;
    int result_count;
    double progress; /* of terms that depend on time, when they are checked element by element */
    double t;        /* [s] while directions turn */
} checker;

/* In [-1, 1]; a linear congruential generator (Knuth's MMIX), so that every machine sees the same state. */
static double uniform(checker *c)
{
    c->random = c->random * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (double)(c->random >> 11) / 4503599627370496.0 - 1;
}

static void report(checker *c, const char *term, const char *what, double error, double limit)
{
    if (c->result_count < DRAPE_MAX_CHECK_RESULTS)
        c->results[c->result_count++] = (drape_check_result){
            .term = term, .what = what, .error = error, .limit = limit, .pass = error <= limit};
}

static double largest(const double *a, size_t n)
{
    double max = 0;
    for (size_t i = 0; i < n; i++)
        max = isnan(a[i]) ? INFINITY : fmax(max, fabs(a[i]));
    return max;
}

static double largest_difference(const double *a, const double *b, size_t n)
{
    double max = 0;
    for (size_t i = 0; i < n; i++)
        max = isnan(a[i] - b[i]) ? INFINITY : fmax(max, fabs(a[i] - b[i]));
    return max;
}

static double ratio(double difference, double scale)
{
    return difference == 0 ? 0 : difference / scale;
}

/* ---- The state ---- */

static void make_state(checker *c, const drape_state *rest)
{
    const drape_model *m = c->model;
    /* by 0.7 rad about (1, 2, 3)/sqrt(14) */
    const double turn[3] = {0.7 / sqrt(14.0), 1.4 / sqrt(14.0), 2.1 / sqrt(14.0)};
    double R[9];
    drape_rotation_exp(turn, R);
    for (size_t i = 0; i < (size_t)m->node_count; i++) {
        double deformed[3];
        for (int k = 0; k < 3; k++) {
            deformed[k] = rest->x[3 * i + (size_t)k] + DEFORMATION * c->size * uniform(c);
            c->v[3 * i + (size_t)k] = c->size * uniform(c);
        }
        drape_rotation_turn(R, deformed, c->x + 3 * i);
    }
    memcpy(c->internal, rest->internal, (size_t)m->internal_count * sizeof *c->internal);
    /* Maxwell branches are extended as strains are, and were so a part of their time ago. */
    for (int32_t t = 0; t < c->model->term_count; t++) {
        const drape_term *term = &c->model->terms[t];
        double *kept = c->internal + term->first_branch;
        for (int64_t i = 1 + term->elements.count; i < drape_term_branch_numbers(term); i++)
            kept[i] = DEFORMATION * uniform(c);
        if (term->branch_count > 0)
            kept[0] = -0.7 * term->branches[0].time;
    }
    for (int64_t i = 0; i < m->measure_count; i++)
        c->history[i] = uniform(c);
}

/* ---- One term, element by element ---- */

/* The results of a user-defined or built-in function for one element: a value, its gradient and Hessian. */
typedef struct local {
    double scalar, gradient[D], hessian[D * D], velocity[D * D];
} local;

static void evaluate(const checker *c, const drape_term *term, int32_t e, local *out)
{
    const double *x = c->x, *v = c->v, *internal = c->internal;
    drape_elements el = drape_term_elements(term, c->t);
    el.progress = c->progress;
    const double *own = drape_term_own(term, internal);
    memset(out, 0, sizeof *out);
    if (term->ops->measure)
        term->ops->measure(&el, e, 1, x, own, &out->scalar, out->gradient, out->hessian);
    else if (term->ops->energy)
        term->ops->energy(&el, e, 1, x, own, &out->scalar, out->gradient,
                          term->ops->linear ? NULL : out->hessian);
    else
        term->ops->dissipation(&el, e, 1, x, v, out->gradient, out->hessian, out->velocity);
}

/* The first local index of the node with local index a: an element may contain a node twice. */
static int first_copy(const drape_elements *el, int32_t e, int a)
{
    const int32_t *node = el->node + (size_t)e * (size_t)el->nodes;
    for (int b = 0; b < a; b++)
        if (node[b] == node[a])
            return b;
    return a;
}

/* Adds the derivatives by further copies of a node to those by its first: derivatives by nodes, not by
 * local indices. */
static void gather_copies(const drape_elements *el, int32_t e, local *l)
{
    const int d = 3 * el->nodes;
    for (int a = 0; a < el->nodes; a++) {
        const int b = first_copy(el, e, a);
        for (int i = 0; b < a && i < 3; i++) {
            const int from = 3 * a + i, to = 3 * b + i;
            l->gradient[to] += l->gradient[from];
            l->gradient[from] = 0;
            for (int j = 0; j < d; j++) {
                l->hessian[d * to + j] += l->hessian[d * from + j];
                l->hessian[d * from + j] = 0;
            }
            for (int j = 0; j < d; j++) {
                l->hessian[d * j + to] += l->hessian[d * j + from];
                l->hessian[d * j + from] = 0;
            }
        }
    }
}

/* Moves coordinate i of an element by +step and -step in array (positions or velocities) and evaluates. */
static void evaluate_beside(const checker *c, const drape_term *term, int32_t e, int i, double step,
                            double *array, local *plus, local *minus)
{
    size_t at = 3 * (size_t)term->elements.node[(size_t)e * (size_t)term->elements.nodes + (size_t)(i / 3)] +
                (size_t)(i % 3);
    double kept = array[at];
    array[at] = kept + step;
    evaluate(c, term, e, plus);
    array[at] = kept - step;
    evaluate(c, term, e, minus);
    array[at] = kept;
    gather_copies(&term->elements, e, plus);
    gather_copies(&term->elements, e, minus);
}

/* The sizes of the derivatives of an element or a term, or errors relative to these sizes. */
typedef struct errors {
    double gradient, hessian, velocity, symmetry;
} errors;

static errors largest_of(errors a, errors b)
{
    return (errors){fmax(a.gradient, b.gradient), fmax(a.hessian, b.hessian), fmax(a.velocity, b.velocity),
                    fmax(a.symmetry, b.symmetry)};
}

static errors smallest_of(errors a, errors b)
{
    return (errors){fmin(a.gradient, b.gradient), fmin(a.hessian, b.hessian), fmin(a.velocity, b.velocity),
                    fmin(a.symmetry, b.symmetry)};
}

static errors size_of(const checker *c, const drape_term *term, const local *here)
{
    size_t d = 3 * (size_t)term->elements.nodes;
    double g = largest(here->gradient, d), h = fmax(largest(here->hessian, d * d), g / c->size);
    return (errors){g, h, fmax(largest(here->velocity, d * d), g / c->size), h};
}

/* The errors of one element with one step; min: the smallest scales. */
static errors compare_once(const checker *c, const drape_term *term, int32_t e, double step, errors min)
{
    int d = 3 * term->elements.nodes;
    local here, plus, minus;
    double dg[D], dh[D * D], dv[D * D] = {0}, symmetry = 0;
    evaluate(c, term, e, &here);
    gather_copies(&term->elements, e, &here);
    for (int i = 0; i < d; i++) {
        dg[i] = 0;
        for (int j = 0; j < d; j++)
            dh[d * j + i] = 0;
        if (first_copy(&term->elements, e, i / 3) < i / 3)
            continue;
        evaluate_beside(c, term, e, i, step, c->x, &plus, &minus);
        dg[i] = (plus.scalar - minus.scalar) / (2 * step);
        for (int j = 0; j < d; j++)
            dh[d * j + i] = (plus.gradient[j] - minus.gradient[j]) / (2 * step);
        if (term->ops->dissipation)
            evaluate_beside(c, term, e, i, step, c->v, &plus, &minus);
        for (int j = 0; term->ops->dissipation && j < d; j++)
            dv[d * j + i] = (plus.gradient[j] - minus.gradient[j]) / (2 * step);
    }
    for (int i = 0; i < d; i++)
        for (int j = 0; j < i; j++)
            symmetry = fmax(symmetry, fabs(here.hessian[d * i + j] - here.hessian[d * j + i]));
    errors scale = largest_of(size_of(c, term, &here), min);
    return (errors){ratio(largest_difference(dg, here.gradient, (size_t)d), scale.gradient),
                    ratio(largest_difference(dh, here.hessian, (size_t)(d * d)), scale.hessian),
                    ratio(largest_difference(dv, here.velocity, (size_t)(d * d)), scale.velocity),
                    ratio(symmetry, scale.symmetry)};
}

static errors compare_element(const checker *c, const drape_term *term, int32_t e, errors min)
{
    double step = DIFFERENCE_STEP * c->size;
    errors best = compare_once(c, term, e, step, min);
    for (int k = 1; k < LEVELS; k++) {
        step /= FINER;
        best = smallest_of(best, compare_once(c, term, e, step, min));
    }
    return best;
}

/* T of one element and its gradients. */
static double kinetic_of(const checker *c, const drape_term *term, int32_t e, double *by_x, double *by_v)
{
    const drape_elements el = drape_term_elements(term, c->t);
    double t = 0;
    term->ops->kinetic(&el, e, 1, c->x, c->v, &(drape_kinetic){.t = &t, .by_x = by_x, .by_v = by_v});
    return t;
}

/* The largest error of one gradient of T over the elements, relative to its largest entry there: in place of
 * positions or of velocities. The second derivatives are in the assembled Jacobian. */
static double kinetic_error(const checker *c, const drape_term *term, double *array)
{
    const drape_elements *el = &term->elements;
    const double step = DIFFERENCE_STEP * c->size;
    const int32_t stride = el->count / SAMPLE + 1;
    double error = 0, scale = 0, gradients[2][D];
    for (int32_t e = 0; e < el->count; e += stride) {
        kinetic_of(c, term, e, gradients[0], gradients[1]);
        for (int i = 0; i < 3 * el->nodes; i++) {
            double *at =
                array + 3 * (size_t)el->node[(size_t)e * (size_t)el->nodes + (size_t)(i / 3)] + i % 3;
            const double kept = *at, gradient = gradients[array == c->v][i];
            *at = kept + step;
            const double after = kinetic_of(c, term, e, NULL, NULL);
            *at = kept - step;
            const double before = kinetic_of(c, term, e, NULL, NULL);
            *at = kept;
            error = fmax(error, fabs((after - before) / (2 * step) - gradient));
            scale = fmax(scale, fabs(gradient));
        }
    }
    return ratio(error, scale);
}

static void check_elements(checker *c, const drape_term *term)
{
    errors max = {0};
    const char *const name = term->ops->entry.name;
    int32_t stride = term->elements.count / SAMPLE + 1;
    for (c->progress = drape_term_is_timed(term) ? 0 : 1; c->progress <= 1; c->progress += 0.5) {
        /* The smallest scales of an element's errors: MIN_SCALE of the term's largest derivatives, over
         * every stride-th element. */
        errors size = {0};
        for (int32_t e = 0; e < term->elements.count; e += stride) {
            local here;
            evaluate(c, term, e, &here);
            size = largest_of(size, size_of(c, term, &here));
        }
        const errors min = {MIN_SCALE * size.gradient, MIN_SCALE * size.hessian, MIN_SCALE * size.velocity,
                            MIN_SCALE * size.symmetry};
        for (int32_t e = 0; e < term->elements.count; e += stride)
            max = largest_of(max, compare_element(c, term, e, min));
    }
    if (term->ops->dissipation) {
        report(c, name, "force by position", max.hessian, HESSIAN_LIMIT);
        report(c, name, "force by velocity", max.velocity, HESSIAN_LIMIT);
        if (term->ops->kinetic) {
            report(c, name, "energy of motion by position", kinetic_error(c, term, c->x), HESSIAN_LIMIT);
            report(c, name, "energy of motion by velocity", kinetic_error(c, term, c->v), HESSIAN_LIMIT);
        }
        return;
    }
    report(c, name, term->ops->measure ? "gradient of measure" : "gradient", max.gradient, GRADIENT_LIMIT);
    report(c, name, term->ops->measure ? "Hessian of measure" : "Hessian", max.hessian, HESSIAN_LIMIT);
    report(c, name, "symmetry", max.symmetry, INVARIANCE_LIMIT);
}

/* Net force and net torque of a term with a measure or of a seam, over the sum of magnitudes: internal
 * forces have neither. */
static void check_invariance(checker *c, int32_t t)
{
    const drape_term *term = &c->model->terms[t];
    const char *const name = term->ops->entry.name;
    const drape_point point = {.x = c->x, .v = c->v, .internal = c->internal, .t = c->t};
    double net[6] = {0}, scale = 0, size = 0;
    size_t n = (size_t)c->model->node_count;
    memset(c->g1, 0, 3 * n * sizeof *c->g1);
    drape_system_term(c->system, t, &point, NULL, c->g1, NULL);
    for (size_t i = 0; i < n; i++) {
        const double *x = c->x + 3 * i, *g = c->g1 + 3 * i;
        for (int k = 0; k < 3; k++) {
            int a = (k + 1) % 3, b = (k + 2) % 3;
            net[k] += g[k];
            net[3 + k] += x[a] * g[b] - x[b] * g[a];
            scale += fabs(g[k]);
            size = fmax(size, fabs(x[k]));
        }
    }
    report(c, name, "net force", ratio(largest(net, 3), scale), INVARIANCE_LIMIT);
    if (!term->anchored)
        report(c, name, "net torque", ratio(largest(net + 3, 3), scale * size), INVARIANCE_LIMIT);
}

/* ---- The assembled Jacobian ---- */

/* x2, v2 = the state moved by s along direction at the free nodes; v moves by weight times that. */
static void move(checker *c, double s, double weight)
{
    const drape_model *m = c->model;
    for (size_t i = 0; i < 3 * (size_t)m->node_count; i++) {
        double p = m->pinned[i / 3] ? 0 : c->direction[i];
        c->x2[i] = c->x[i] + s * p;
        c->v2[i] = c->v[i] + weight * s * p;
    }
}

/* Extends the pattern to what contact couples at a point, and takes memory for a Jacobian. */
static drape_status prepare_jacobian(checker *c, const drape_point *point)
{
    bool changed;
    drape_status status = drape_system_extend_pattern(c->system, point, &changed);
    if (status)
        return status;
    drape_arena_release(c->arena, c->values);
    c->values =
        drape_arena_take(c->arena, (size_t)drape_system_pattern(c->system)->nonzeros, sizeof *c->values);
    return c->values ? DRAPE_OK : DRAPE_E_MEMORY;
}

/* The force that a Jacobian belongs to. */
typedef void force(drape_system *system, const drape_point *point, double *g);

static void contact_force(drape_system *system, const drape_point *point, double *g)
{
    drape_system_contact_part(system, point, true, g, NULL);
}

/* The error of the derivative `exact` of component i: the smallest of what slopes after and before the state
 * and their mean, the central difference, are extrapolated to from two successive steps. */
static double component_error(const checker *c, size_t i, double step, double exact)
{
    double error = INFINITY, longer[3] = {NAN, NAN, NAN};
    for (int k = 0; k < LEVELS; k++, step /= FINER) {
        const double after = (c->beside[2 * k][i] - c->g1[i]) / step,
                     before = (c->g1[i] - c->beside[2 * k + 1][i]) / step,
                     slope[3] = {after, before, (after + before) / 2};
        for (int j = 0; j < 3; j++) {
            const double rest = (slope[j] - longer[j]) / (j < 2 ? FINER - 1 : FINER * FINER - 1);
            error = fmin(error, fabs(slope[j] + rest - exact));
            longer[j] = slope[j];
        }
    }
    return error;
}

/* The error of the Jacobian in c->values along c->direction, at a point whose force is c->g1. */
static double direction_error(checker *c, double step, drape_point point, force *of)
{
    const size_t n = 3 * (size_t)c->model->node_count;
    double error = 0, s = step;
    point.x = c->x2;
    point.v = c->v2;
    for (int k = 0; k < 2 * LEVELS; s /= k++ % 2 ? FINER : 1) {
        move(c, k % 2 ? -s : s, point.weight);
        of(c->system, &point, c->beside[k]);
    }
    /* y = J p over the free DOFs; y (node_count x 3). */
    double *y = c->g2;
    const drape_model *m = c->model;
    const drape_pattern *pattern = drape_system_pattern(c->system);
    memset(y, 0, 3 * (size_t)m->node_count * sizeof *y);
    for (int64_t j = 0; j < pattern->n; j++) {
        double p = c->direction[3 * (int64_t)m->node_of_free[j / 3] + j % 3];
        for (int64_t k = pattern->column[j]; k < pattern->column[j + 1]; k++) {
            int64_t i = drape_pattern_row(pattern, j, k);
            y[3 * (int64_t)m->node_of_free[i / 3] + i % 3] += c->values[k] * p;
        }
    }
    for (size_t i = 0; i < n; i++)
        error = fmax(error, c->model->pinned[i / 3] ? 0 : component_error(c, i, step, c->g2[i]));
    return error < INFINITY ? ratio(error, largest(c->g2, n) + error) : INFINITY;
}

/* The error of the Jacobian in c->values: the largest over all directions, at a point whose x and v are the
 * checker's. Steps are powers of two, directions multiples of 1/512: they move positions without rounding. */
static double largest_direction_error(checker *c, double step, const drape_point *point, force *of)
{
    double error = 0;
    int exponent;
    frexp(step, &exponent);
    of(c->system, point, c->g1);
    for (int r = 0; r < DIRECTIONS; r++) {
        for (size_t i = 0; i < 3 * (size_t)c->model->node_count; i++)
            c->direction[i] = rint(512 * uniform(c)) / 512;
        drape_system_project(c->system, c->direction); /* displacements that supports allow */
        error = fmax(error, direction_error(c, ldexp(1, exponent), *point, of));
    }
    return error;
}

static drape_status check_jacobian(checker *c, const char *what, double weight, const double *history)
{
    const drape_point point = {.x = c->x,
                               .v = c->v,
                               .internal = c->internal,
                               .weight = weight,
                               .momentum = weight,
                               .history = history,
                               .t = c->t,
                               .turning = true};
    DRAPE_TRY(prepare_jacobian(c, &point));
    drape_system_jacobian(c->system, &point, 0, 0, c->values);
    report(c, "assembled", what,
           largest_direction_error(c, DIFFERENCE_STEP * c->size, &point, drape_system_force), HESSIAN_LIMIT);
    return DRAPE_OK;
}

/* ---- Contact ---- */

/* Moves all nodes until the deepest free one is `gap` away from a collider, or as near to that as moves
 * bring it. */
static void approach(checker *c, const drape_collider *collider, double gap)
{
    const drape_model *m = c->model;
    const drape_collider_pose pose = drape_collider_pose_at(collider, 0);
    double before = INFINITY;
    for (bool nearer = true; nearer;) {
        double deepest = INFINITY, normal[3] = {0}, n[3];
        for (int32_t i = 0; i < m->free_count; i++) {
            double d =
                drape_collider_distance(collider, &pose, c->x + 3 * (size_t)m->node_of_free[i], n, NULL);
            if (d < deepest) {
                deepest = d;
                memcpy(normal, n, sizeof normal);
            }
        }
        nearer = fabs(gap - deepest) < before;
        before = fabs(gap - deepest);
        for (size_t i = 0; nearer && i < 3 * (size_t)m->node_count; i++)
            c->x[i] += (gap - deepest) * normal[i % 3];
    }
}

/* Folds the rest positions at the middle of their longest extent, into layers `gap` apart along the
 * shortest. */
static void fold(checker *c, double gap)
{
    const drape_model *m = c->model;
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    int a = 0, b = 0;
    for (size_t i = 0; i < 3 * (size_t)m->node_count; i++) {
        low[i % 3] = fmin(low[i % 3], m->rest[i]);
        high[i % 3] = fmax(high[i % 3], m->rest[i]);
    }
    for (int k = 1; k < 3; k++) {
        a = high[k] - low[k] > high[a] - low[a] ? k : a;
        b = high[k] - low[k] < high[b] - low[b] ? k : b;
    }
    for (size_t i = 0; i < (size_t)m->node_count; i++) {
        double *x = c->x + 3 * i, side = m->rest[3 * i + (size_t)a] - (low[a] + high[a]) / 2;
        for (int k = 0; k < 3; k++)
            x[k] = m->rest[3 * i + (size_t)k] + 0.1 * gap * uniform(c);
        if (side > 0) {
            x[a] -= (2 - DEFORMATION) * side; /* no edge lies exactly on another */
            x[b] += gap;
        }
    }
}

/* Compares energy, force and Jacobian of contact alone at c->x; raises *max to errors above it. */
static drape_status compare_contact(checker *c, double distance, errors *max)
{
    drape_state state = {.x = c->x, .v = c->v};
    drape_point point = {.x = c->x, .v = c->v, .internal = c->internal, .weight = 60};
    size_t n = 3 * (size_t)c->model->node_count;
    DRAPE_TRY(drape_system_begin(c->system, &state));
    DRAPE_TRY(prepare_jacobian(c, &point));
    double step = DIFFERENCE_STEP * distance, best = INFINITY;
    drape_system_contact_part(c->system, &point, true, NULL, c->values);
    max->hessian = fmax(max->hessian, largest_direction_error(c, step, &point, contact_force));
    drape_system_contact_part(c->system, &point, false, c->g1, NULL);
    double along = 0, scale = largest(c->g1, n);
    for (size_t i = 0; i < n; i++)
        along += c->model->pinned[i / 3] ? 0 : c->g1[i] * c->direction[i];
    point.x = c->x2;
    for (int k = 0; k < LEVELS; k++, step /= FINER) {
        move(c, step, 0);
        double after = drape_system_contact_energy(c->system, &point);
        move(c, -step, 0);
        double before = drape_system_contact_energy(c->system, &point);
        best = fmin(best, ratio(fabs((after - before) / (2 * step) - along), scale));
    }
    max->gradient = fmax(max->gradient, best);
    return DRAPE_OK;
}

static void report_contact(checker *c, const char *name, errors max)
{
    report(c, name, "gradient", max.gradient, HESSIAN_LIMIT); /* gaps have the rounding errors of positions */
    report(c, name, "Jacobian with friction", max.hessian, HESSIAN_LIMIT);
}

static drape_status check_contact(checker *c, const drape_state *rest)
{
    const drape_contact_def *def = &c->model->contact;
    errors max = {0}, self = {0};
    if (!drape_system_contact(c->system))
        return DRAPE_OK;
    for (int32_t k = 0; k < c->model->collider_count; k++) {
        make_state(c, rest);
        approach(c, &c->model->colliders[k], def->distance / 2);
        DRAPE_TRY(compare_contact(c, def->distance, &max));
    }
    if (c->model->collider_count > 0)
        report_contact(c, "contact", max);
    if (!def->self)
        return DRAPE_OK;
    fold(c, def->self_thickness);
    DRAPE_TRY(compare_contact(c, def->self_thickness, &self));
    report_contact(c, "self_contact", self);
    return DRAPE_OK;
}

/* ---- All checks ---- */

/* A time at which the directions of some term turn; 0 without such. */
static double turning_time(const drape_model *model)
{
    for (int32_t i = 0; i < model->track_count; i++) {
        const drape_turns *turns = &model->tracks[i].turns;
        if (model->tracks[i].clamps && turns->key_count > 1)
            return turns->keys[0].time + 0.385 * (turns->keys[1].time - turns->keys[0].time);
    }
    return 0;
}

static drape_status check_terms(drape_context *ctx, checker *c)
{
    for (int32_t t = 0; t < c->model->term_count; t++) {
        const drape_term *term = &c->model->terms[t];
        const char *const name = term->ops->entry.name;
        DRAPE_TRY(drape_check_cancel(ctx));
        if (term->ops->law) {
            /* At one state, with a difference along each of the law's arguments. */
            const double k = 2.385, at = 0.117, moves = -0.731, h = DIFFERENCE_STEP;
            const double stiffness[] = {k, k, k, k, k}, strain[] = {at, at + h, at - h, at, at},
                         rate[] = {moves, moves, moves, moves + h, moves - h};
            double f[5] = {0}, fs[5] = {0}, fr[5] = {0}, e[5] = {0};
            term->ops->law(term->params, 5, stiffness, strain, rate, f, fs, fr, e);
            double by_strain = (f[1] - f[2]) / (2 * h), by_rate = (f[3] - f[4]) / (2 * h);
            double scale = fmax(fmax(fabs(fs[0]), fabs(fr[0])), fabs(f[0]));
            report(c, name, "force by strain", ratio(fabs(by_strain - fs[0]), scale), HESSIAN_LIMIT);
            report(c, name, "force by rate", ratio(fabs(by_rate - fr[0]), scale), HESSIAN_LIMIT);
            if (!term->ops->dissipative)
                report(c, name, "force of energy", ratio(fabs((e[1] - e[2]) / (2 * h) - f[0]), scale),
                       GRADIENT_LIMIT);
        } else
            check_elements(c, term);
        if (term->ops->measure || (term->seam >= 0 && term->ops->energy && !term->ops->external))
            check_invariance(c, t);
    }
    return DRAPE_OK;
}

static drape_status check_all(drape_context *ctx, checker *c)
{
    drape_state rest;
    double **arrays[] = {&c->x, &c->v, &c->x2, &c->v2, &c->g1, &c->g2, &c->direction};
    const size_t n = 3 * (size_t)c->model->node_count;
    DRAPE_TRY(drape_state_create(c->arena, c->model, &rest));
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++)
        *arrays[i] = drape_arena_take(c->arena, n, sizeof(double));
    for (int i = 0; i < 2 * LEVELS; i++)
        c->beside[i] = drape_arena_take(c->arena, n, sizeof(double));
    c->internal = drape_arena_take(c->arena, (size_t)c->model->internal_count, sizeof(double));
    c->history = drape_arena_take(c->arena, (size_t)c->model->measure_count, sizeof(double));
    DRAPE_TRY(drape_arena_status(c->arena));
    make_state(c, &rest);
    DRAPE_TRY(check_terms(ctx, c));
    DRAPE_TRY(check_jacobian(c, "Jacobian in a step", 60, c->history));
    DRAPE_TRY(check_jacobian(c, "Jacobian in continuous time", 60, NULL));
    DRAPE_TRY(drape_check_cancel(ctx));
    return check_contact(c, &rest);
}

drape_status drape_check_derivatives(drape_context *ctx, drape_system *system, unsigned seed,
                                     drape_check_result *results, int *result_count)
{
    const drape_model *model = drape_system_model(system);
    drape_arena arena = drape_arena_of(ctx);
    checker c = {.system = system,
                 .model = model,
                 .arena = &arena,
                 .random = seed,
                 .size = drape_model_mean_edge(model),
                 .results = results,
                 .t = turning_time(model)};
    const drape_status status = check_all(ctx, &c);
    *result_count = c.result_count;
    drape_arena_free(&arena);
    return status;
}

drape_status drape_model_check_derivatives(const drape_model *model, unsigned seed,
                                           drape_check_result *results, int32_t room, int32_t *count)
{
    if (!model || !count || room < 0 || (room > 0 && !results))
        return DRAPE_E_ARGUMENT;
    drape_arena arena = drape_arena_of(model->ctx);
    drape_check_result *all = drape_arena_take(&arena, DRAPE_MAX_CHECK_RESULTS, sizeof *all);
    drape_system *system = NULL;
    int done = 0;
    drape_status status = all ? drape_system_create(&arena, model, 1, &system) : DRAPE_E_MEMORY;
    if (!status && (model->collider_count > 0 || model->contact.self))
        status = drape_system_add_contact(system);
    if (!status)
        status = drape_check_derivatives(model->ctx, system, seed, all, &done);
    for (int32_t i = 0; i < done && i < room; i++)
        results[i] = all[i];
    *count = done;
    drape_system_destroy(&system);
    drape_arena_free(&arena);
    return status;
}
