/*
 * limit.strain: keeps edges, or springs, from stretching beyond a limit. With s = l/L - 1, the onset
 * limit/2, y = (s - onset)/w and w = limit - onset, each has the energy
 *     E = K (L w)^2 b(y),  b = 0 for y <= 0,  -y^2 ln(1 - y) for 0 < y <= 1 - cap
 *     dE/dl = K L w b',    b' = -2 y ln(1 - y) + y^2/(1 - y)
 *     d2E/dl2 = K b'',     b'' = -2 ln(1 - y) + 4 y/(1 - y) + y^2/(1 - y)^2
 * which is the barrier of Li et al. 2020 (Incremental Potential Contact, eq. 6) with the gap limit - s: zero
 * below the onset, C2 there since b ~ y^3, and unbounded towards the limit. b'' >= 0 and b' >= 0, so the
 * Hessian b'' grad l grad l' + b' hess l is positive semidefinite.
 *
 * If the barrier were infinite beyond the limit, Newton could not start there, but the first guess of fast
 * nodes is beyond it, and so is a sheet whose pins were moved. Therefore b continues above y = 1 - cap as the
 * parabola that is C2 there. Iterates may be beyond the limit; states may not: the check rejects them. The
 * forces at the limit are about 2/cap K L w; a larger load needs a larger stiffness.
 *
 * Compressed springs are not limited, as in CS184.
 */
#include "base/elementary.h"
#include "base/reason.h"
#include "base/vec3.h"
#include "terms/spring.h"

#include <math.h>

enum { PARAM_LIMIT, PARAM_STIFFNESS, PARAM_OVER, PARAM_COUNT };
enum { OVER_EDGES, OVER_SPRINGS };
enum { REST_K, REST_LENGTH, REST_COUNT };

static const char *const over_choices[] = {[OVER_EDGES] = "edges", [OVER_SPRINGS] = "springs", NULL};

static const drape_param params[PARAM_COUNT] = {
    [PARAM_LIMIT] = DRAPE_NUMBER("limit", "1", 0.1, DRAPE_ABOVE(0), 100,
                                 "strain |e|/L - 1 that no accepted state of an implicit integrator exceeds; "
                                 "verlet ignores this term and has strain_limit instead"),
    [PARAM_STIFFNESS] = DRAPE_NUMBER(
        "stiffness", "N/m",
        DRAPE_DERIVED("the larger of E h and the cloth's weight over its mean rest length times limit/2"),
        DRAPE_ABOVE(0), 1e15,
        "scale of the resistance, which begins at limit/2: halfway from there its tangent stiffness is 6.4 "
        "times this value, and its force at the limit about 100 stiffness L limit"),
    [PARAM_OVER] =
        DRAPE_CHOICE("over", OVER_EDGES, over_choices,
                     "edges: of the mesh; springs: all structural, shear and bend pairs of a square grid"),
};

#define CAP 0.01 /* of limit - onset, next to the limit, where a parabola continues the barrier */

static double onset_of(const double *values)
{
    return values[PARAM_LIMIT] / 2;
}

/* ---- Building ---- */

/* Such that a single edge can carry the weight of the sheet at y = 0.46, where b' = 1. */
static double stiffness_of(const drape_spring_set *set, int32_t count, const double *values)
{
    const drape_cloth_view *cloth = set->cloth;
    double mass = 0, width = values[PARAM_LIMIT] - onset_of(values);
    if (!isnan(values[PARAM_STIFFNESS]))
        return values[PARAM_STIFFNESS];
    for (int32_t i = 0; i < cloth->node_count; i++)
        mass += cloth->node_mass[i];
    double lengths = 0;
    for (int32_t i = 0; i < count; i++) {
        int32_t pair[2];
        drape_spring_pair(set, i, pair);
        lengths += drape_spring_rest_length(cloth, pair);
    }
    return fmax(cloth->material->membrane_stiffness,
                mass * vec3_norm(cloth->gravity) / (width * (lengths / count)));
}

static drape_status build(const drape_cloth_view *cloth, const double *values, drape_term_builder *builder)
{
    const bool springs = values[PARAM_OVER] == OVER_SPRINGS;
    const drape_spring_set set = {
        .cloth = cloth, .offset = drape_spring_offsets, .offset_count = springs ? DRAPE_SPRING_OFFSETS : 0};
    if (springs && !drape_spring_on_grid(cloth))
        return drape_term_refuse(
            builder, "\"over\" = \"springs\" needs the grid \"square\"; this mesh has only edges");
    int32_t count = drape_spring_count(&set);
    double stiffness = stiffness_of(&set, count, values);
    DRAPE_TRY(drape_term_reserve(builder, count, REST_COUNT));
    for (int32_t i = 0; i < count; i++) {
        int32_t pair[2];
        drape_spring_pair(&set, i, pair);
        double rest[REST_COUNT] = {
            [REST_K] = stiffness, [REST_LENGTH] = drape_spring_rest_length(cloth, pair)};
        drape_term_set(builder, i, pair, rest);
    }
    return DRAPE_OK;
}

/* ---- The barrier ---- */

typedef struct barrier {
    double value, slope, curve; /* b, b', b'' */
} barrier;

static barrier barrier_below_cap(double y)
{
    double log_gap = drape_ln1p(-y), ratio = y / (1 - y);
    return (barrier){.value = -y * y * log_gap,
                     .slope = y * (ratio - 2 * log_gap),
                     .curve = ratio * (4 + ratio) - 2 * log_gap};
}

static barrier barrier_at(double y)
{
    if (y <= 0)
        return (barrier){0};
    if (y <= 1 - CAP)
        return barrier_below_cap(y);
    barrier b = barrier_below_cap(1 - CAP);
    double beyond = y - (1 - CAP); /* NaN gets here too and stays NaN */
    b.value += beyond * (b.slope + 0.5 * b.curve * beyond);
    b.slope += b.curve * beyond;
    return b;
}

/* With n = (x1 - x0)/l:  g = E' (-n, n),  H = [B -B; -B B],  B = E'' n n' + E'/l (I - n n'). */
static void one(const drape_elements *el, int32_t element, const double *x, double *e, double *g,
                double *hess)
{
    const double *rest = el->rest + element;
    double k = rest[REST_K], rest_length = rest[(size_t)REST_LENGTH * (size_t)el->count];
    double onset = onset_of(el->params), width = el->params[PARAM_LIMIT] - onset, n[3];
    vec3_sub(x + 3, x, n);
    double length = vec3_norm(n), scale = rest_length * width;
    barrier b = barrier_at((length / rest_length - 1 - onset) / width);
    double force = k * scale * b.slope, across = b.slope > 0 ? force / length : 0;
    for (int i = 0; i < 3; i++)
        n[i] = b.slope > 0 ? n[i] / length : 0; /* a collapsed edge has no direction, and is not stretched */
    if (e)
        *e = k * scale * scale * b.value;
    for (int i = 0; g && i < 3; i++) {
        g[3 + i] = force * n[i];
        g[i] = -g[3 + i];
    }
    double block[9];
    for (int i = 0; hess && i < 9; i++)
        block[i] = (k * b.curve - across) * n[i / 3] * n[i % 3] + across * (i % 4 == 0);
    if (hess)
        drape_pair_block(block, hess);
}

DRAPE_ENERGY_BY(one)

static double strain_of(const drape_elements *el, int32_t e, const double *x)
{
    return drape_pair_length(el, e, x) / drape_rest_of(el, REST_LENGTH, e) - 1;
}

/* A step that starts beyond the limit may only reduce the strain. */
static drape_status check(const drape_elements *el, const double *x, const double *before,
                          const double *internal, drape_fault *fault)
{
    (void)internal;
    *fault = (drape_fault){.reason = drape_reason_name(DRAPE_REASON_STRAIN_LIMIT),
                           .what = "strain of a limited edge",
                           .element = -1,
                           .value = -INFINITY,
                           .limit = el->params[PARAM_LIMIT]};
    for (int32_t e = 0; e < el->count; e++) {
        double strain = strain_of(el, e, x);
        if (!(strain > fault->value))
            continue;
        if (strain > fault->limit && before && strain <= strain_of(el, e, before))
            continue;
        fault->value = strain;
        fault->element = e;
    }
    return fault->value > fault->limit ? DRAPE_RETRY_DEGENERATE : DRAPE_OK;
}

const drape_term_ops drape_term_limit_strain = {
    .struct_size = sizeof(drape_term_ops),
    .entry =
        {.name = "limit.strain",
         .summary =
             "keeps edges or springs from stretching beyond a limit, by a barrier that begins at an onset",
         .reference = "barrier of Li et al. 2020, Incremental Potential Contact, eq. 6; CS184 "
                      "clothsim's limit of 10 %",
         DRAPE_PARAMS(params)},
    .element_name = "edge",
    .nodes = 2,
    .constraint = true,
    .build = build,
    .energy = energy,
    .check = check,
};
