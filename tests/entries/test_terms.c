/* test_terms.c: all terms, on four meshes and with several seeds: derivatives, invariance, rest, ranges. */
#include <stdio.h>

#include "assemble/check.h"
#include "models.h"
#include "support/suite.h"
#include "terms/terms.h"

#define SEEDS     3
#define MAX_TERMS 32

/* ---- A model of one term ---- */

/* One term with one choice of one of its parameters, with its defaults, or with a dashpot in each element;
 * a law comes with all measures. */
typedef struct variant {
    const drape_term_ops *ops;
    enum model_mesh mesh;
    int param, choice; /* -1: the defaults */
    bool pinned;
} variant;

static bool is_choice(const drape_param *p)
{
    return p->kind == DRAPE_PARAM_CHOICE;
}

/* Terms that may be damped have the dashpots as a parameter. */
static bool is_dashpot(const drape_term_ops *ops, const drape_param *p)
{
    return ops->damped && strcmp(p->name, "damping") == 0;
}

static size_t settings_of(const variant *v, const drape_term_ops *ops, drape_setting *settings)
{
    size_t count = required_settings(ops->entry.params, ops->entry.param_count, settings);
    if (ops == v->ops && v->param >= 0) {
        const drape_param *p = &ops->entry.params[v->param];
        settings[count++] = is_choice(p) ? (drape_setting){p->name, 0, p->choices[v->choice]}
                                         : (drape_setting){p->name, 2.385, NULL};
    }
    return count;
}

/* Whether the scene's gravity adds the term, so that its list of terms must not name it. */
static bool is_gravity(const drape_term_ops *ops)
{
    return ops->from_scene_gravity;
}

/* External forces: rest is not an equilibrium of them, and they depend on directions in space. */
static bool is_external(const drape_term_ops *ops)
{
    return ops->external;
}

/* A model of the term only; NULL if the term refuses the mesh, which its message says. All terms accept
 * rectangles. */
static drape_model *try_alone(drape_context *ctx, const variant *v)
{
    drape_setting settings[DRAPE_MAX_PARAMS + 1];
    const drape_entry_def term = {v->ops->entry.name, settings, settings_of(v, v->ops, settings)};
    drape_model *model = NULL;
    const model_def def = {.mesh = v->mesh, .terms = &term, .term_count = 1, .pinned = v->pinned};
    if (try_model(ctx, &def, &model)) {
        ck_assert_msg(v->mesh != MESH_SQUARE, "%s: %s", v->ops->entry.name, drape_context_message(ctx));
        ck_assert_ptr_nonnull(strstr(drape_context_message(ctx), "mesh"));
    }
    return model;
}

static bool takes(drape_context *ctx, const drape_term_ops *ops, enum model_mesh mesh)
{
    scoped_model *model = try_alone(ctx, &(variant){.ops = ops, .mesh = mesh, .param = -1});
    bool built = model != NULL;
    return built;
}

/* NULL if the term refuses the mesh. */
static drape_model *model_of(drape_context *ctx, const variant *v)
{
    static drape_setting settings[MAX_TERMS][DRAPE_MAX_PARAMS + 1];
    drape_entry_def terms[MAX_TERMS];
    size_t count = 0;
    if (!v->ops->law && !is_gravity(v->ops))
        return try_alone(ctx, v);
    for (int i = 0; drape_terms[i]; i++) {
        const drape_term_ops *ops = drape_terms[i];
        if (is_gravity(ops) || !(ops == v->ops || (v->ops->law && ops->measure && takes(ctx, ops, v->mesh))))
            continue;
        ck_assert_uint_lt(count, MAX_TERMS);
        terms[count] =
            (drape_entry_def){ops->entry.name, settings[count], settings_of(v, ops, settings[count])};
        count++;
    }
    return make_model(ctx, &(model_def){.mesh = v->mesh,
                                        .terms = terms,
                                        .term_count = count,
                                        .gravity = is_gravity(v->ops),
                                        .pinned = v->pinned});
}

static void use_variant(drape_context *ctx, const variant *v,
                        void (*use)(drape_context *ctx, const variant *v, const drape_model *model))
{
    scoped_model *model = model_of(ctx, v);
    if (model)
        use(ctx, v, model);
}

/* Calls use for every term, mesh and choice, and with dashpots. */
static void for_all_variants(void (*use)(drape_context *ctx, const variant *v, const drape_model *model))
{
    scoped_context *ctx = make_context();
    for (int i = 0; drape_terms[i]; i++)
        for (int mesh = 0; mesh < MESH_COUNT; mesh++)
            for (int p = -1; p < drape_terms[i]->entry.param_count; p++) {
                const drape_param *param = &drape_terms[i]->entry.params[p < 0 ? 0 : p];
                bool words = p >= 0 && is_choice(param);
                if (p >= 0 && !words && !is_dashpot(drape_terms[i], param))
                    continue;
                for (int c = 0; c == 0 || (words && param->choices[c]); c++)
                    use_variant(ctx,
                                &(variant){drape_terms[i], (enum model_mesh)mesh, p, c, (mesh + c) % 2 == 0},
                                use);
            }
}

static const char *name_of(const variant *v)
{
    static char text[128];
    snprintf(text, sizeof text, "%s on %s%s%s", v->ops->entry.name, mesh_names[v->mesh],
             v->param >= 0 ? ", " : "",
             v->param < 0                                 ? ""
             : is_choice(&v->ops->entry.params[v->param]) ? v->ops->entry.params[v->param].choices[v->choice]
                                                          : v->ops->entry.params[v->param].name);
    return text;
}

/* A deformed, moving state, with internal variables of the rest state. */
typedef struct state {
    size_t n;
    double *x, *v, *g, *history;
    drape_arena arena;
    drape_state rest;
    drape_point point;
} state;

static state make_state(drape_context *ctx, const drape_model *model, uint64_t seed, double deformation)
{
    state s = {.n = 3 * (size_t)model->node_count};
    s.arena = drape_arena_of(ctx);
    ck_assert_int_eq(drape_state_create(&s.arena, model, &s.rest), DRAPE_OK);
    s.x = drape_arena_take(&s.arena, s.n, sizeof(double));
    s.v = drape_arena_take(&s.arena, s.n, sizeof(double));
    s.g = drape_arena_take(&s.arena, s.n, sizeof(double));
    s.history = drape_arena_take(&s.arena, (size_t)model->measure_count, sizeof(double));
    for (size_t i = 0; i < s.n; i++) {
        s.x[i] = s.rest.x[i] + deformation * random_number(&seed);
        s.v[i] = random_number(&seed);
    }
    for (int64_t i = 0; i < model->measure_count; i++)
        s.history[i] = random_number(&seed);
    s.point = (drape_point){
        .x = s.x, .v = s.v, .internal = s.rest.internal, .weight = 60, .momentum = 60, .history = s.history};
    return s;
}

static double largest(const double *a, size_t n)
{
    double max = 0;
    for (size_t i = 0; i < n; i++)
        max = isnan(a[i]) ? INFINITY : fmax(max, fabs(a[i]));
    return max;
}

/* ---- Form
 * ---------------------------------------------------------------------------------------------------------
 */

TEST(entries_are_well_formed)
{
    int count = 0;
    for (; drape_terms[count]; count++) {
        const drape_term_ops *ops = drape_terms[count];
        ck_assert_ptr_eq(drape_term_registry.entries[count], &ops->entry);
        check_name(ops->element_name, false);
        ck_assert_uint_eq(ops->struct_size, sizeof *ops);
        ck_assert_int_eq(!!ops->measure + !!ops->energy + !!ops->dissipation + !!ops->law, 1);
        ck_assert(ops->law ? ops->nodes == 0 : ops->build != NULL);
        ck_assert(ops->law || (ops->nodes >= 1 && ops->nodes <= DRAPE_MAX_ELEMENT_NODES));
        ck_assert(!ops->has_internal || (ops->commit && ops->initial));
        ck_assert(!ops->dissipation || ops->dissipative || ops->external);
        ck_assert(!ops->linear || ops->energy);
        ck_assert(!ops->damped || ops->measure);
    }
    ck_assert_int_eq(drape_registry_count(&drape_term_registry), count);
}

/* ---- Derivatives ---- */

static void check_limits(const drape_check_result *result)
{
    const bool second =
        strstr(result->what, "Hessian") || strstr(result->what, " by ") || strstr(result->what, "Jacobian");
    ck_assert_double_le(result->limit, second ? 1e-6 : 1e-7);
}

static void check_variant(drape_context *ctx, const variant *v, const drape_model *model)
{
    static drape_check_result results[DRAPE_MAX_CHECK_RESULTS];
    drape_arena memory = drape_arena_of(ctx);
    drape_system *system = make_system(&memory, model, 1);
    for (unsigned seed = 1; seed <= SEEDS; seed++) {
        int count = 0, own = 0;
        ck_assert_int_eq(drape_check_derivatives(ctx, system, 7919 * seed, results, &count), DRAPE_OK);
        for (int i = 0; i < count; i++) {
            ck_assert_msg(results[i].pass, "%s, seed %u: %s of %s is off by %g", name_of(v), seed,
                          results[i].what, results[i].term, results[i].error);
            ck_assert(results[i].error <= results[i].limit);
            check_limits(&results[i]);
            own += strcmp(results[i].term, v->ops->entry.name) == 0;
        }
        ck_assert_msg(own >= 2, "%s: %d comparisons", name_of(v), own);
    }
    drape_system_destroy(&system);
    drape_arena_free(&memory);
}

TEST(derivatives_agree_with_differences)
{
    for_all_variants(check_variant);
}

/* ---- The checker can fail ---- */

static enum { WRONG_NOTHING, WRONG_GRADIENT, WRONG_HESSIAN, WRONG_SYMMETRY, WRONG_MANNERS } wrong;

static drape_status wrong_build(const drape_cloth_view *cloth, const double *params,
                                drape_term_builder *builder)
{
    (void)params;
    drape_status status = drape_term_reserve(builder, cloth->edge_count, 2);
    for (int32_t e = 0; !status && e < cloth->edge_count; e++)
        drape_term_set(builder, e, cloth->edge + 2 * (size_t)e, (const double[]){2.385, 0});
    return status;
}

/* q = 1/2 |x1 - x0|^2 with a mistake of a hundred-thousandth */
static void wrong_measure(const drape_elements *el, int32_t first, int32_t count, const double *x,
                          const double *internal, double *q, double *dq, double *ddq)
{
    (void)internal;
    for (int32_t i = 0; i < count; i++) {
        const int32_t *node = el->node + 2 * (size_t)(first + i);
        q[i] = 0;
        for (int k = 0; k < 3; k++) {
            double d = x[3 * node[1] + k] - x[3 * node[0] + k];
            q[i] += 0.5 * d * d;
            if (dq) {
                dq[6 * i + 3 + k] = d * (wrong == WRONG_GRADIENT ? 1 + 1e-5 : 1);
                dq[6 * i + k] = wrong == WRONG_MANNERS ? 0 : -d;
            }
        }
        for (int k = 0; ddq && k < 36; k++)
            ddq[36 * i + k] = k % 6 == k / 6 ? 1 : (k + 3) % 6 == k / 6 ? -1 : 0;
        if (ddq && wrong == WRONG_HESSIAN)
            ddq[36 * i] *= 1 + 1e-5;
        if (ddq && wrong == WRONG_SYMMETRY)
            ddq[36 * i + 1] += 1e-6;
    }
}

static const drape_term_ops wrong_term = {
    .struct_size = sizeof(drape_term_ops),
    .entry = {.name = "host.wrong", .summary = "a measure with a mistake", .reference = "-"},
    .element_name = "edge",
    .nodes = 2,
    .build = wrong_build,
    .measure = wrong_measure};

TEST(mistakes_are_found)
{
    static drape_check_result results[DRAPE_MAX_CHECK_RESULTS];
    static const char *const found_as[] = {NULL, "gradient of measure", "Hessian of measure", "symmetry",
                                           "net force"};
    scoped_context *ctx = make_context();
    ck_assert_int_eq(drape_context_add_term(ctx, &wrong_term), DRAPE_OK);
    const drape_entry_def term = {.type = "host.wrong"};
    scoped_model *model = make_model(ctx, &(model_def){.mesh = MESH_CURVED, .terms = &term, .term_count = 1});
    drape_arena memory = drape_arena_of(ctx);
    drape_system *system = make_system(&memory, model, 1);
    for (int w = WRONG_NOTHING; w <= WRONG_MANNERS; w++) {
        int count = 0;
        bool found = false, pass = true;
        wrong = w;
        ck_assert_int_eq(drape_check_derivatives(ctx, system, 1, results, &count), DRAPE_OK);
        for (int i = 0; i < count; i++) {
            pass = pass && results[i].pass;
            found = found || (found_as[w] && !results[i].pass && strcmp(results[i].what, found_as[w]) == 0);
        }
        ck_assert_int_eq(pass, w == WRONG_NOTHING);
        ck_assert_msg(found || w == WRONG_NOTHING, "mistake %d", w);
    }
    drape_system_destroy(&system);
    drape_arena_free(&memory);
}

/* A damped term has no dashpots until they have a coefficient. */
TEST(dashpots_need_their_number)
{
    scoped_context *ctx = make_context();
    drape_term_ops ops = wrong_term;
    drape_model *model = NULL;
    ops.damped = true;
    ck_assert_int_eq(drape_context_add_term(ctx, &ops), DRAPE_OK);
    const drape_entry_def term = {.type = "host.wrong"};
    const model_def def = {.mesh = MESH_SQUARE, .terms = &term, .term_count = 1};
    ck_assert_int_eq(try_model(ctx, &def, &model), DRAPE_E_ARGUMENT);
    ck_assert_msg(
        strstr(drape_context_message(ctx), "has 2 numbers of rest data an element; its kind needs 3"), "%s",
        drape_context_message(ctx));
}

/* ---- Parts ---- */

static enum { PARTS_GOOD, PARTS_FEW_LINKS, PARTS_LACK_NODE, PARTS_MISSING, PARTS_STRAY } parts_fault;

/* Parts are the halves of the squared lengths of edges, and elements the triangles: the sum over their edges.
 * One part more than there are edges has no link. */
static drape_status parts_build(const drape_cloth_view *cloth, const double *params,
                                drape_term_builder *builder)
{
    (void)params;
    const int32_t links = 3 * cloth->triangle_count;
    drape_status status = drape_term_reserve(builder, cloth->triangle_count, 2);
    if (!status && parts_fault != PARTS_MISSING)
        status = drape_term_reserve_parts(builder, cloth->edge_count + 1, links, 1);
    for (int32_t e = 0; !status && e < cloth->edge_count; e++)
        drape_term_set_part(builder, e + 1, cloth->edge + 2 * (size_t)e, &cloth->edge_length[e]);
    for (int32_t t = 0; !status && t < cloth->triangle_count; t++) {
        double q0 = 0;
        for (int k = 0; k < 3 && !(parts_fault == PARTS_FEW_LINKS && t == 0); k++) {
            const int32_t edge = cloth->triangle_edge[3 * (size_t)t + (size_t)k];
            const int32_t wrong_edge = t == 0 ? cloth->edge_count - 1 : edge;
            q0 += 0.25 * cloth->edge_length[edge] * cloth->edge_length[edge];
            drape_term_link(builder, parts_fault == PARTS_STRAY ? -1 : t,
                            1 + (parts_fault == PARTS_LACK_NODE ? wrong_edge : edge), 0.5);
        }
        drape_term_set(builder, t, cloth->triangle + 3 * (size_t)t, (const double[]){2.385, q0});
    }
    return status;
}

static void parts_part(const drape_elements *el, const int32_t *part, const double *x, const double *internal,
                       double *s, double *ds, double *dds)
{
    (void)internal;
    for (int l = 0; l < DRAPE_LANES; l++) {
        const int32_t *node = el->parts->node + 2 * (size_t)part[l];
        ck_assert_double_gt(el->parts->rest[part[l]], 0); /* those of unused parts are 0 */
        s[l] = 0;
        for (int k = 0; k < 3; k++) {
            const double d = x[3 * node[1] + k] - x[3 * node[0] + k];
            s[l] += 0.5 * d * d;
            if (ds) {
                ds[DRAPE_LANES * k + l] = -d;
                ds[DRAPE_LANES * (3 + k) + l] = d;
            }
        }
        for (int i = 0; dds && i < 36; i++)
            dds[DRAPE_LANES * i + l] = i % 6 == i / 6 ? 1 : (i + 3) % 6 == i / 6 ? -1 : 0;
    }
}

static void parts_measure(const drape_elements *el, int32_t first, int32_t count, const double *x,
                          const double *internal, double *q, double *dq, double *ddq)
{
    drape_part_range(el, first, count, x, internal, q, dq, ddq, parts_part);
}

static const drape_term_ops parts_term = {
    .struct_size = sizeof(drape_term_ops),
    .entry = {.name = "host.parts", .summary = "squares of edges, by triangle", .reference = "-"},
    .element_name = "triangle",
    .nodes = 3,
    .build = parts_build,
    .measure = parts_measure,
    .part_nodes = 2,
    .part = parts_part};

TEST(user_defined_parts_are_right)
{
    static drape_check_result results[DRAPE_MAX_CHECK_RESULTS];
    scoped_context *ctx = make_context();
    const drape_entry_def term = {.type = "host.parts"};
    ck_assert_int_eq(drape_context_add_term(ctx, &parts_term), DRAPE_OK);
    parts_fault = PARTS_GOOD;
    for (int mesh = 0; mesh < MESH_COUNT; mesh++) {
        scoped_model *model =
            make_model(ctx, &(model_def){.mesh = (enum model_mesh)mesh, .terms = &term, .term_count = 1});
        ck_assert_int_eq(model->terms[0].parts.count, model->edge_count);
        drape_arena memory = drape_arena_of(ctx);
        drape_system *system = make_system(&memory, model, 1);
        int count = 0;
        ck_assert_int_eq(drape_check_derivatives(ctx, system, 1, results, &count), DRAPE_OK);
        ck_assert_int_ge(count, 5);
        for (int i = 0; i < count; i++)
            ck_assert_msg(results[i].pass, "%s is off by %g", results[i].what, results[i].error);
        drape_system_destroy(&system);
        drape_arena_free(&memory);
    }
}

TEST(wrong_parts_are_refused)
{
    static const char *const said[] = {NULL, " links and made ", "lacks a node of its part ",
                                       "outside of those", "outside of those"};
    scoped_context *ctx = make_context();
    drape_term_ops ops = parts_term;
    const drape_entry_def term = {.type = "host.parts"};
    const model_def def = {.mesh = MESH_SQUARE, .terms = &term, .term_count = 1};
    ops.part_nodes = 0;
    ck_assert_int_eq(drape_context_add_term(ctx, &ops), DRAPE_E_ARGUMENT);
    ck_assert_int_eq(drape_context_add_term(ctx, &parts_term), DRAPE_OK);
    for (int fault = PARTS_FEW_LINKS; fault <= PARTS_STRAY; fault++) {
        drape_model *model = NULL;
        parts_fault = fault;
        ck_assert_int_eq(try_model(ctx, &def, &model), DRAPE_E_ARGUMENT);
        ck_assert_msg(strstr(drape_context_message(ctx), said[fault]), "%d: %s", fault,
                      drape_context_message(ctx));
    }
}

/* ---- Physics of one term ---- */

/* E(R x + t) = E(x). Positions of 3 m are rounded, strains are 0.1 of 0.1 m: 1e-15 * 30 / 0.1, and a
 * margin. */
static void check_invariance(drape_context *ctx, const variant *v, const drape_model *model)
{
    if (is_external(v->ops))
        return;
    drape_arena memory = drape_arena_of(ctx);
    drape_system *system = make_system(&memory, model, 1);
    for (uint64_t seed = 1; seed <= SEEDS; seed++) {
        double r[9], shift[3], before, after, gravity;
        uint64_t random = 31 * seed;
        state s = make_state(ctx, model, seed, 0.01);
        drape_system_energy(system, &s.point, &before, &gravity);
        random_rotation(&random, r);
        for (int k = 0; k < 3; k++)
            shift[k] = 3 * random_number(&random);
        for (size_t i = 0; i < s.n; i += 3) {
            const double x[3] = {s.x[i], s.x[i + 1], s.x[i + 2]};
            for (size_t k = 0; k < 3; k++)
                s.x[i + k] = r[3 * k] * x[0] + r[3 * k + 1] * x[1] + r[3 * k + 2] * x[2] + shift[k];
        }
        drape_system_energy(system, &s.point, &after, &gravity);
        ck_assert_msg(fabs(after - before) <= 1e-11 * fabs(before), "%s: %.17g, turned %.17g", name_of(v),
                      before, after);
        ck_assert(v->ops->dissipation || before > 0);
        drape_arena_free(&s.arena);
    }
    drape_system_destroy(&system);
    drape_arena_free(&memory);
}

TEST(energy_does_not_change_with_rigid_motion)
{
    for_all_variants(check_invariance);
}

/* The largest force that a strain of rounding, about 1e-15, can cause. */
static double rounding_force(const drape_model *model, const drape_point *point)
{
    double force = 0;
    for (int32_t t = 0; t < model->term_count; t++) {
        const drape_term *term = &model->terms[t];
        for (int32_t e = 0; term->ops->measure && e < term->elements.count; e++) {
            double q, dq[DRAPE_MAX_ELEMENT_DOFS];
            const double *internal =
                term->first_internal >= 0 ? point->internal + term->first_internal : NULL;
            term->ops->measure(&term->elements, e, 1, point->x, internal, &q, dq, NULL);
            force = fmax(force, term->elements.rest[e] * largest(dq, 3 * (size_t)term->elements.nodes));
        }
    }
    return 1e-14 * force;
}

/* At rest a measure has no force (except for a hinge that is to be flat on a curved mesh), a drag has none,
 * and there is no energy. A law at rest has no rate. */
static void check_rest(drape_context *ctx, const variant *v, const drape_model *model)
{
    bool flat = v->param >= 0 && is_choice(&v->ops->entry.params[v->param]) &&
                strcmp(v->ops->entry.params[v->param].choices[v->choice], "flat") == 0;
    if (is_external(v->ops) || (flat && v->mesh == MESH_CURVED))
        return;
    drape_arena memory = drape_arena_of(ctx);
    drape_system *system = make_system(&memory, model, 1);
    state s = make_state(ctx, model, 1, 0);
    double elastic, gravity;
    memset(s.v, 0, s.n * sizeof *s.v);
    s.point.history = NULL;
    drape_system_force(system, &s.point, s.g);
    drape_system_energy(system, &s.point, &elastic, &gravity);
    ck_assert_msg(largest(s.g, s.n) <= rounding_force(model, &s.point), "%s: %g N at rest", name_of(v),
                  largest(s.g, s.n));
    ck_assert_double_le(fabs(elastic), 1e-20);
    drape_arena_free(&s.arena);
    drape_system_destroy(&system);
    drape_arena_free(&memory);
}

TEST(no_force_at_rest)
{
    for_all_variants(check_rest);
}

/* Dissipative forces take power at every velocity, laws at every rate. Internal ones take none from a rigid
 * motion. */
static void check_power(drape_context *ctx, const variant *v, const drape_model *model)
{
    if (!model->has_dissipation || is_external(v->ops)) /* a load without a potential does work, too */
        return;
    drape_arena memory = drape_arena_of(ctx);
    drape_system *system = make_system(&memory, model, 1);
    ck_assert(v->ops->dissipative || v->ops->damped);
    for (uint64_t seed = 1; seed <= SEEDS; seed++) {
        double power = 0, scale, spin[3] = {0.3, -1.1, 0.7};
        state s = make_state(ctx, model, seed, 0.01);
        s.point.history = NULL;
        drape_system_dissipation(system, &s.point, 0, s.g);
        scale = largest(s.g, s.n);
        for (size_t i = 0; i < s.n; i++)
            power += s.g[i] * s.v[i];
        ck_assert_msg(power > 0, "%s: %g W", name_of(v), power);
        for (size_t i = 0; i < s.n; i++) /* v = w x r + c */
            s.v[i] = spin[(i + 1) % 3] * s.x[i - i % 3 + (i + 2) % 3] -
                     spin[(i + 2) % 3] * s.x[i - i % 3 + (i + 1) % 3] + 0.5;
        drape_system_dissipation(system, &s.point, 0, s.g);
        if (!v->ops->dissipation)
            ck_assert_msg(largest(s.g, s.n) <= 1e-13 * scale, "%s: %g N of %g", name_of(v), largest(s.g, s.n),
                          scale);
        drape_arena_free(&s.arena);
    }
    drape_system_destroy(&system);
    drape_arena_free(&memory);
}

TEST(dissipation_takes_power)
{
    for_all_variants(check_power);
}

/* Newton predicts the forces on measures after a correction p by their change df/dx . p. It is compared
 * with a difference of fourth order whose step makes the error about 1e-13 of the size of the forces. */
static void check_stress(drape_context *ctx, const variant *v, const drape_model *model)
{
    static const double at[4] = {-2, -1, 1, 2}, weight[4] = {1, -8, 8, -1};
    const double step = 1e-4;
    const size_t n = (size_t)model->measure_count;
    if (n == 0)
        return;
    state s = make_state(ctx, model, 13, 0.01);
    drape_arena memory = drape_arena_of(ctx);
    drape_system *system = make_system(&memory, model, 1);
    double *p = drape_arena_take(&s.arena, s.n, sizeof *p), *x = drape_arena_take(&s.arena, s.n, sizeof *x);
    double *here = drape_arena_take(&s.arena, n, sizeof *here),
           *ahead = drape_arena_take(&s.arena, n, sizeof *ahead);
    double *sum = drape_arena_take(&s.arena, n, sizeof *sum),
           *moved = drape_arena_take(&s.arena, n, sizeof *moved);
    drape_system_stress(system, &s.point, p, here); /* p is still 0 */
    uint64_t seed = 17;
    for (size_t i = 0; i < s.n; i++)
        p[i] = 0.1 * random_number(&seed);
    drape_system_stress(system, &s.point, p, ahead);
    memset(sum, 0, n * sizeof *sum);
    memset(s.g, 0, s.n * sizeof *s.g);
    for (int k = 0; k < 4; k++) {
        drape_point point = s.point;
        for (size_t i = 0; i < s.n; i++)
            x[i] = s.x[i] + at[k] * step * p[i];
        point.x = x;
        drape_system_stress(system, &point, s.g, moved);
        for (size_t i = 0; i < n; i++)
            sum[i] += weight[k] * moved[i] / (12 * step);
    }
    for (size_t i = 0; i < n; i++)
        sum[i] -= ahead[i] - here[i];
    const double size = fmax(largest(here, n), largest(ahead, n)), error = largest(sum, n);
    ck_assert_msg(error <= 1e-7 * size, "%s: %g of %g", name_of(v), error, size);
    drape_system_destroy(&system);
    drape_arena_free(&memory);
    drape_arena_free(&s.arena);
}

TEST(forces_ahead_agree_with_differences)
{
    for_all_variants(check_stress);
}

/* ---- Interface ---- */

/* The results of an element depend neither on the range it is evaluated in, nor on what else is requested. */
static void check_ranges(drape_context *ctx, const variant *v, const drape_model *model)
{
    enum { N = 40, D = DRAPE_MAX_ELEMENT_DOFS };
    static double e1[N], g1[N * D], h1[N * D * D], w1[N * D * D], e2[N], g2[N * D], h2[N * D * D],
        w2[N * D * D];
    state s = make_state(ctx, model, 5, 0.01);
    for (int32_t t = 0; t < model->term_count; t++) {
        const drape_term *term = &model->terms[t];
        const drape_term_ops *ops = term->ops;
        const double *in = term->first_internal >= 0 ? s.rest.internal + term->first_internal : NULL;
        int32_t count = term->elements.count < N ? term->elements.count : N;
        size_t d = 3 * (size_t)term->elements.nodes, dd = d * d;
        if (ops->law)
            continue;
        memset(w1, 0, sizeof w1), memset(w2, 0, sizeof w2), memset(h1, 0, sizeof h1),
            memset(h2, 0, sizeof h2);
        for (int32_t i = -1; i < count; i++) { /* all elements at once, then one by one */
            size_t at = i < 0 ? 0 : (size_t)i;
            double *e = i < 0 ? e1 : e2 + at, *g = (i < 0 ? g1 : g2) + d * at,
                   *h = (i < 0 ? h1 : h2) + dd * at;
            int32_t first = i < 0 ? 0 : i, many = i < 0 ? count : 1;
            if (ops->measure)
                ops->measure(&term->elements, first, many, s.x, in, e, g, h);
            else if (ops->energy)
                ops->energy(&term->elements, first, many, s.x, in, e, g, ops->linear ? NULL : h);
            else
                ops->dissipation(&term->elements, first, many, s.x, s.v, g, h, (i < 0 ? w1 : w2) + dd * at);
        }
        size_t m = (size_t)count;
        ck_assert_msg(ops->dissipation || memcmp(e1, e2, m * sizeof *e1) == 0, "%s: values", name_of(v));
        ck_assert_msg(memcmp(g1, g2, m * d * sizeof *g1) == 0, "%s: gradients", name_of(v));
        ck_assert_msg(memcmp(h1, h2, m * dd * sizeof *h1) == 0, "%s: Hessians", name_of(v));
        ck_assert_msg(memcmp(w1, w2, m * dd * sizeof *w1) == 0, "%s: velocity Hessians", name_of(v));
        memset(e2, 0, sizeof e2), memset(g2, 0, sizeof g2);
        if (ops->measure)
            ops->measure(&term->elements, 0, count, s.x, in, e2, NULL, NULL);
        else if (ops->energy)
            ops->energy(&term->elements, 0, count, s.x, in, e2, NULL, NULL);
        else
            ops->dissipation(&term->elements, 0, count, s.x, s.v, g2, NULL, NULL);
        ck_assert_msg(ops->dissipation ? memcmp(g1, g2, m * d * sizeof *g1) == 0
                                       : memcmp(e1, e2, m * sizeof *e1) == 0,
                      "%s: without derivatives", name_of(v));
    }
    drape_arena_free(&s.arena);
}

TEST(elements_do_not_depend_on_the_range)
{
    for_all_variants(check_ranges);
}

/* One thread or several give the same bits. The meshes here have more than one block of 32 elements. */
static void check_threads(drape_context *ctx, const variant *v, const drape_model *model)
{
    state s = make_state(ctx, model, 9, 0.01);
    size_t values = (size_t)model->pattern.nonzeros;
    double *g = drape_arena_take(&s.arena, s.n, sizeof *g);
    double *j1 = drape_arena_take(&s.arena, values, sizeof *j1);
    double *j2 = drape_arena_take(&s.arena, values, sizeof *j2);
    const size_t measures = (size_t)model->measure_count;
    double *f1 = drape_arena_take(&s.arena, measures + 1, sizeof *f1);
    double *f2 = drape_arena_take(&s.arena, measures + 1, sizeof *f2);
    for (int threads = 1; threads <= 3; threads++) {
        drape_arena memory = drape_arena_of(ctx);
        drape_system *system = make_system(&memory, model, threads);
        drape_system_force(system, &s.point, threads == 1 ? s.g : g);
        drape_system_jacobian(system, &s.point, 3600, 0, threads == 1 ? j1 : j2);
        ck_assert_msg(threads == 1 || memcmp(g, s.g, s.n * sizeof *g) == 0, "%s: force", name_of(v));
        ck_assert_msg(threads == 1 || memcmp(j1, j2, values * sizeof *j1) == 0, "%s: Jacobian", name_of(v));
        drape_system_stress(system, &s.point, s.v, threads == 1 ? f1 : f2);
        ck_assert_msg(threads == 1 || memcmp(f1, f2, measures * sizeof *f1) == 0, "%s: stress", name_of(v));
        drape_system_destroy(&system);
        drape_arena_free(&memory);
    }
    drape_arena_free(&s.arena);
}

TEST(threads_give_the_same_bits)
{
    for_all_variants(check_threads);
}

/* x'(projected Jacobian - mass)x >= 0 for laws and measures: a sum of positive semidefinite blocks is
 * positive semidefinite. */
static void check_projection(drape_context *ctx, const variant *v, const drape_model *model)
{
    state s = make_state(ctx, model, 11, 0.04);
    const drape_pattern *p = &model->pattern;
    double *j = drape_arena_take(&s.arena, (size_t)p->nonzeros, sizeof *j);
    double *b = drape_arena_take(&s.arena, (size_t)p->n, sizeof *b);
    drape_arena memory = drape_arena_of(ctx);
    drape_system *system = make_system(&memory, model, 1);
    drape_system_jacobian(system, &s.point, 0, 1, j);
    for (uint64_t trial = 1; trial <= 50; trial++) {
        uint64_t seed = trial;
        double sum = 0, size = 0;
        for (int64_t i = 0; i < p->n; i++)
            b[i] = random_number(&seed);
        for (int64_t c = 0; c < p->n; c++)
            for (int64_t k = p->column[c]; k < p->column[c + 1]; k++) {
                sum += b[c] * j[k] * b[drape_pattern_row(p, c, k)];
                size += fabs(b[c] * j[k] * b[drape_pattern_row(p, c, k)]);
            }
        ck_assert_msg(sum >= -1e-13 * size, "%s: %g of %g", name_of(v), sum, size);
    }
    drape_system_destroy(&system);
    drape_arena_free(&memory);
    drape_arena_free(&s.arena);
}

TEST(projected_jacobians_are_positive)
{
    for_all_variants(check_projection);
}
