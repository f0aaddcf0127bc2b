/* build_terms.c: finds the terms of each cloth by name, resolves their parameters, has them build their
 * elements, and connects laws to the measures of their cloth. */
#include "compile/term_builder.h"
#include "terms/terms.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* pointer: to the name. */
static drape_status find_term(drape_context *ctx, const drape_registry *registry, const char *pointer,
                              const char *name, const drape_term_ops **out)
{
    const int built_in = drape_registry_count(registry);
    const bool of_seams = registry == &drape_seam_registry;
    int i;
    DRAPE_TRY(drape_registry_choose(ctx, registry, pointer, name, &i));
    *out = i >= built_in ? drape_context_term_ops(ctx, of_seams, i - built_in)
           : of_seams    ? drape_seams[i]
                         : drape_terms[i];
    return DRAPE_OK;
}

static drape_cloth_view view_of(const drape_model *model, const drape_cloth *cloth, void *user)
{
    const drape_mesh *m = &cloth->mesh;
    return (drape_cloth_view){.node_count = m->node_count,
                              .triangle_count = m->triangle_count,
                              .edge_count = m->edge_count,
                              .hinge_count = m->hinge_count,
                              .rest = m->x,
                              .triangle = m->triangle,
                              .triangle_area = m->triangle_area,
                              .edge = m->edge,
                              .edge_triangle = m->edge_triangle,
                              .edge_length = m->edge_length,
                              .hinge = m->hinge,
                              .hinge_edge = m->hinge_edge,
                              .triangle_edge = m->triangle_edge,
                              .edge_clamped = cloth->edge_clamped,
                              .edge_turn = cloth->edge_turn,
                              .edge_image = cloth->edge_image,
                              .start = model->start + 3 * (size_t)cloth->first_node,
                              .node_area = m->node_area,
                              .node_mass = cloth->node_mass,
                              .rows = m->rows,
                              .columns = m->columns,
                              .rectangular = m->rectangular,
                              .given_count = drape_mesh_given(m)->node_count,
                              .parent = m->parent,
                              .material = &cloth->material,
                              .gravity = {model->gravity[0], model->gravity[1], model->gravity[2]},
                              .tension = cloth->tension.warp > 0 ? &cloth->tension : NULL,
                              .bending = cloth->bending.warp > 0 ? &cloth->bending : NULL,
                              .user = user,
                              .warp_curve = cloth->curves[DRAPE_CURVE_WARP],
                              .weft_curve = cloth->curves[DRAPE_CURVE_WEFT],
                              .shear_curve = cloth->curves[DRAPE_CURVE_SHEAR]};
}

static drape_status check_elements(drape_term_builder *builder)
{
    const double *timed = builder->term->timed;
    const drape_elements *el = &builder->term->elements;
    const drape_term_ops *ops = builder->term->ops;
    const int needed = ops->measure ? 2 + ops->damped : 0;
    if (el->rest_count < needed)
        return drape_term_refuse(builder, "%s has %d numbers of rest data an element; its kind needs %d",
                                 ops->entry.name, el->rest_count, needed);
    char owned[64];
    if (!builder->term->ops->energy && drape_term_is_timed(builder->term))
        return drape_term_refuse(builder, "%s changes with time, which only an energy may", ops->entry.name);
    if (!(timed[0] <= timed[1]) || isinf(timed[0]))
        return drape_term_refuse(builder, "%s changes with time from %g s to %g s", ops->entry.name, timed[0],
                                 timed[1]);
    if (builder->strayed)
        return drape_term_refuse(builder,
                                 "%s set an element outside of the %d that it announced, or a part, link or "
                                 "slider outside of those, or a slider of negative stiffness or limit",
                                 ops->entry.name, (int)el->count);
    for (size_t i = 0; i < (size_t)el->count; i++)
        if (el->node[i * (size_t)el->nodes] == -1)
            return drape_term_refuse(builder, "%s announced %d elements and did not set element %zu",
                                     ops->entry.name, (int)el->count, i);
    const int32_t *first = builder->owned, *count = builder->owned_count, from = builder->first_node;
    for (size_t i = 0; i < (size_t)el->count * (size_t)el->nodes; i++) {
        const int32_t node = el->node[i];
        if ((node >= first[0] && node - first[0] < count[0]) ||
            (node >= first[1] && node - first[1] < count[1]))
            continue;
        const int used = snprintf(owned, sizeof owned, "%d to %d", (int)(first[0] - from),
                                  (int)(first[0] + count[0] - 1 - from));
        if (count[1] > 0 && first[1] != first[0])
            snprintf(owned + used, sizeof owned - (size_t)used, " and %d to %d", (int)(first[1] - from),
                     (int)(first[1] + count[1] - 1 - from));
        return drape_term_refuse(builder, "element %zu of %s has node %d; the cloth's are %s",
                                 i / (size_t)el->nodes, ops->entry.name, (int)(node - from), owned);
    }
    return drape_term_finish_parts(builder);
}

/* Adds a term of cloth c, without elements. */
static drape_status begin_term(drape_model *model, int32_t c, int32_t seam, const char *pointer,
                               const drape_term_ops *ops, const drape_entry_def *def)
{
    drape_term *term = &model->terms[model->term_count];
    DRAPE_TRY(drape_check_cancel(model->ctx));
    term->ops = ops;
    DRAPE_TRY(drape_params_resolve(model->ctx, pointer, &term->ops->entry, def->settings, def->setting_count,
                                   term->params));
    term->cloth = c;
    term->seam = seam;
    term->elements.user = ops->user;
    term->elements.factor = 1;
    term->first_internal = term->first_measure = term->first_slider = term->first_branch = -1;
    model->term_count++;
    if (term->ops->dissipative || term->ops->dissipation)
        model->has_dissipation = model->has_own_dissipation = true;
    model->has_kinetic = model->has_kinetic || term->ops->kinetic;
    return DRAPE_OK;
}

/* Has a term of one cloth build its elements. */
static drape_status build_elements(drape_model *model, drape_term *term, const char *pointer)
{
    const drape_cloth *cloth = &model->cloths[term->cloth];
    drape_term_builder builder = {.model = model,
                                  .term = term,
                                  .pointer = pointer,
                                  .first_node = cloth->first_node,
                                  .owned = {cloth->first_node},
                                  .owned_count = {cloth->mesh.node_count}};
    const drape_cloth_view view = view_of(model, cloth, term->ops->user);
    model->ctx->message[0] = 0;
    drape_status status = term->ops->build(&view, term->params, &builder);
    status = drape_fail_unsaid(model->ctx, status, pointer, "build() of \"%s\" returned %s",
                               term->ops->entry.name, drape_status_name(status));
    return status || term->ops->law ? status : check_elements(&builder);
}

/* A term whose dashpots are all 0 has no damping, so its rates are not needed. */
static void find_damping(drape_model *model, drape_term *term)
{
    const drape_elements *el = &term->elements;
    const double *c = term->ops->damped ? el->rest + 2 * (size_t)el->count : NULL;
    for (int32_t e = 0; c && !term->damping && e < el->count; e++)
        term->damping = c[e] != 0 ? c : NULL;
    model->has_laws = model->has_laws || term->damping;
    if (term->damping)
        model->has_dissipation = model->has_own_dissipation = true;
}

static drape_status build_term(drape_model *model, int32_t c, const char *pointer, const drape_term_ops *ops,
                               const drape_entry_def *def)
{
    drape_term *term = &model->terms[model->term_count];
    drape_cloth *cloth = &model->cloths[c];
    for (int32_t i = 0; i < model->term_count && !ops->external; i++) /* loads may act on several places */
        if (model->terms[i].cloth == c && model->terms[i].ops == ops)
            return drape_refuse(model->ctx, pointer, "the term \"%s\" is named twice", def->type);
    DRAPE_TRY(begin_term(model, c, -1, pointer, ops, def));
    if (term->ops->law) {
        cloth->laws[cloth->law_count++] = term;
        return ops->build ? build_elements(model, term, pointer) : DRAPE_OK;
    }
    DRAPE_TRY(build_elements(model, term, pointer));
    find_damping(model, term);
    return drape_compile_history_of(model, pointer, def, term);
}

drape_status drape_compile_weight(drape_model *model)
{
    for (int32_t i = 0; i < model->term_count; i++)
        if (model->terms[i].ops->from_scene_gravity)
            DRAPE_TRY(build_elements(model, &model->terms[i], "/gravity"));
    return DRAPE_OK;
}

/* The term number i, first the built-in ones, then those of the context's user; NULL after the last. */
static const drape_term_ops *term_at(const drape_context *ctx, int i)
{
    const int built_in = drape_registry_count(&drape_term_registry);
    return i < built_in ? drape_terms[i] : drape_context_term_ops(ctx, false, i - built_in);
}

/* The number of terms that the scene's gravity, or the loss of a fabric, may add to a cloth. */
static size_t count_implied(const drape_context *ctx)
{
    const drape_term_ops *ops;
    size_t count = 0;
    for (int i = 0; (ops = term_at(ctx, i)) != NULL; i++)
        count += ops->from_scene_gravity || ops->from_fabric;
    return count;
}

/* Adds the loss of a measured fabric, unless a term of the cloth has a loss itself. Air around the cloth and
 * what seams take are none of the fabric. */
static drape_status build_loss(drape_model *model, int32_t c)
{
    drape_cloth *cloth = &model->cloths[c];
    bool lossy = cloth->branch_count > 0, measured = false;
    const drape_term_ops *ops;
    for (int32_t i = 0; i < model->term_count; i++) {
        const drape_term *term = &model->terms[i];
        if (term->cloth != c)
            continue;
        lossy = lossy || term->damping || term->sliders > 0 || (term->ops->law && term->ops->dissipative);
        measured = measured || term->ops->measure;
    }
    if (lossy || !measured)
        cloth->retardation = 0;
    for (int i = 0; cloth->retardation > 0 && (ops = term_at(model->ctx, i)) != NULL; i++) {
        if (!ops->from_fabric)
            continue;
        const drape_setting setting = {.name = ops->entry.params[0].name, .number = cloth->retardation};
        const drape_entry_def def = {.type = ops->entry.name, .settings = &setting, .setting_count = 1};
        const bool own = model->has_own_dissipation;
        DRAPE_TRY(build_term(model, c, DRAPE_FORMAT("/cloth/%d/material", (int)c), ops, &def));
        model->has_own_dissipation = own;
    }
    return DRAPE_OK;
}

/* Builds the terms that the scene names, the loss of a fabric, and those of gravity if it is not zero.
 * gravity_history: the name of the history of the latter, or NULL. */
static drape_status build_cloth(drape_model *model, int32_t c, const drape_cloth_def *def,
                                const char *gravity_history)
{
    const double *g = model->gravity;
    const bool has_gravity = g[0] != 0 || g[1] != 0 || g[2] != 0;
    const drape_term_ops *ops;
    model->cloths[c].laws = drape_arena_take(&model->arena, def->term_count + count_implied(model->ctx),
                                             sizeof *model->cloths[c].laws);
    if (!model->cloths[c].laws)
        return DRAPE_E_MEMORY;
    for (size_t i = 0; i < def->term_count; i++) {
        const char *pointer = DRAPE_FORMAT("/cloth/%d/terms/%zu", (int)c, i);
        DRAPE_TRY(find_term(model->ctx, &drape_term_registry, pointer, def->terms[i].type, &ops));
        if (ops->from_scene_gravity)
            return drape_refuse(
                model->ctx, pointer,
                "%s acts whenever the scene's \"gravity\" is not zero; leave it out of the terms",
                ops->entry.name);
        DRAPE_TRY(build_term(model, c, pointer, ops, &def->terms[i]));
    }
    DRAPE_TRY(build_loss(model, c));
    for (int i = 0; has_gravity && (ops = term_at(model->ctx, i)) != NULL; i++) {
        drape_term *term = &model->terms[model->term_count];
        if (!ops->from_scene_gravity)
            continue;
        DRAPE_TRY(build_term(model, c, "/gravity", ops, &(drape_entry_def){.type = ops->entry.name}));
        if (gravity_history)
            DRAPE_TRY(drape_compile_history_named(model, "/gravity_history", gravity_history, term));
    }
    return DRAPE_OK;
}

/* Builds the term that joins the nodes of a seam. */
static drape_status build_seam(drape_model *model, int32_t s, const drape_entry_def *def)
{
    drape_model_seam *seam = &model->seams[s];
    const drape_cloth *side[2] = {&model->cloths[seam->cloth[0]], &model->cloths[seam->cloth[1]]};
    const drape_term_ops *ops;
    const char *pointer = DRAPE_FORMAT("/seams/%d", (int)s);
    const char *at = DRAPE_FORMAT("%s/type", pointer);
    seam->term = model->term_count;
    DRAPE_TRY(find_term(model->ctx, &drape_seam_registry, at, def->type, &ops));
    DRAPE_TRY(begin_term(model, seam->cloth[0], s, pointer, ops, def));
    drape_term_builder builder = {.model = model, .term = &model->terms[seam->term], .pointer = pointer};
    drape_cloth_view cloth[2];
    drape_seam_view view = {.pair_count = seam->pair_count, .pair = seam->pair, .user = ops->user};
    for (int k = 0; k < 2; k++) {
        cloth[k] = view_of(model, side[k], ops->user);
        view.cloth[k] = &cloth[k];
        view.first_node[k] = builder.owned[k] = side[k]->first_node;
        builder.owned_count[k] = side[k]->mesh.node_count;
    }
    model->ctx->message[0] = 0;
    const drape_status status = ops->build_seam(&view, builder.term->params, &builder);
    DRAPE_TRY(drape_fail_unsaid(model->ctx, status, pointer, "build_seam() of \"%s\" returned %s",
                                ops->entry.name, drape_status_name(status)));
    DRAPE_TRY(check_elements(&builder));
    find_damping(model, builder.term);
    return DRAPE_OK;
}

void drape_compile_number_elements(drape_model *model, drape_term *term)
{
    if (term->ops->has_internal) {
        term->first_internal = model->internal_count;
        model->internal_count += drape_term_internals(term);
    }
    if (term->ops->measure) {
        term->first_measure = model->measure_count;
        model->measure_count += term->elements.count;
    }
    if (term->sliders > 0) {
        term->first_slider = model->internal_count;
        model->internal_count += drape_term_slider_count(term);
    }
    if (term->branch_count > 0) {
        term->first_branch = model->internal_count;
        model->internal_count += drape_term_branch_numbers(term);
    }
}

/* Connects the laws of a cloth to its measures, of which there must be one if there are laws. */
static drape_status connect_laws(drape_model *model, int32_t c)
{
    drape_cloth *cloth = &model->cloths[c];
    bool measured = false;
    for (int32_t i = 0; i < model->term_count; i++) {
        drape_term *term = &model->terms[i];
        if (term->cloth != c || !term->ops->measure)
            continue;
        measured = true;
        term->laws = cloth->laws;
        term->law_count = cloth->law_count;
        term->own_law_count = cloth->law_count - (cloth->retardation > 0);
        term->branches = cloth->branches;
        term->branch_count = cloth->branch_count;
    }
    model->has_laws = model->has_laws || cloth->law_count > 0;
    const char *pointer = DRAPE_FORMAT("/cloth/%d/terms", (int)c);
    if (cloth->law_count > 0 && !measured)
        return drape_refuse(model->ctx, pointer,
                            "\"%s\" has nothing to act on: no other term here has a strain measure",
                            cloth->laws[0]->ops->entry.name);
    return DRAPE_OK;
}

drape_status drape_compile_terms(drape_model *model, const drape_scene_def *def)
{
    size_t count = 0;
    for (size_t c = 0; c < def->cloth_count; c++)
        count += def->cloths[c].term_count + count_implied(model->ctx);
    count += (size_t)model->seam_count;
    model->terms = drape_arena_take(&model->arena, count, sizeof *model->terms);
    if (!model->terms)
        return DRAPE_E_MEMORY;
    for (int32_t c = 0; c < model->cloth_count; c++) {
        DRAPE_TRY(build_cloth(model, c, &def->cloths[c], def->gravity_history));
        DRAPE_TRY(connect_laws(model, c));
    }
    for (int32_t s = 0; s < model->seam_count; s++)
        DRAPE_TRY(build_seam(model, s, &def->seams[s].entry));
    for (int32_t i = 0; model->sewn && i < model->node_count; i++) /* ascending: those before are final */
        model->sewn[i] = model->sewn[model->sewn[i]];
    for (int32_t i = 0; i < model->term_count; i++)
        drape_compile_number_elements(model, &model->terms[i]);
    return DRAPE_OK;
}

static bool well_formed(const drape_term_ops *ops)
{
    int kinds =
        (ops->measure != NULL) + (ops->energy != NULL) + (ops->dissipation != NULL) + (ops->law != NULL);
    bool sized = ops->law ? ops->nodes == 0 && !ops->build_seam
                          : ops->nodes >= 1 && ops->nodes <= DRAPE_MAX_ELEMENT_NODES &&
                                (ops->build || ops->build_seam);
    bool internal = !ops->has_internal || (ops->commit && ops->initial);
    return ops->entry.name && ops->entry.summary && ops->entry.reference && ops->element_name && kinds == 1 &&
           sized && internal &&
           (!ops->part ||
            (ops->measure && ops->part_nodes >= 1 && ops->part_nodes <= DRAPE_MAX_ELEMENT_NODES)) &&
           (!ops->damped || ops->measure) &&
           (!ops->from_fabric || (ops->law && ops->entry.param_count > 0)) &&
           (!ops->in_medium || ops->dissipation) && (!ops->kinetic || ops->dissipation) &&
           (!ops->build_seam || !ops->part) &&
           drape_params_are_well_formed(ops->entry.params, ops->entry.param_count);
}

/* The size of the function table in its first version. */
#define MIN_SIZE offsetof(drape_term_ops, in_medium)

drape_status drape_context_add_term(drape_context *ctx, const drape_term_ops *given)
{
    drape_term_ops own = {0}, *ops = &own;
    DRAPE_TRY(drape_compile_take_ops(ctx, "term", given, MIN_SIZE, &own, sizeof own));
    if (!well_formed(ops))
        return drape_fail(
            ctx, DRAPE_E_ARGUMENT,
            "the ops of term \"%s\" are not well formed: name, summary, reference, "
            "element_name, exactly one of measure, "
            "energy, dissipation, law; nodes 1 to %d and build or build_seam but for a law; commit and "
            "initial with has_internal; damped with a measure alone, from_fabric with a law that has "
            "parameters, in_medium and kinetic with a "
            "dissipation; part with "
            "a measure and part_nodes, and without build_seam; "
            "at most %d values of parameters, each with name and unit, a choice with choices",
            ops->entry.name ? ops->entry.name : "?", DRAPE_MAX_ELEMENT_NODES, DRAPE_MAX_PARAMS);
    if (drape_registry_find(&drape_term_registry, ctx, ops->entry.name) >= 0 ||
        drape_registry_find(&drape_seam_registry, ctx, ops->entry.name) >= 0)
        return drape_fail(ctx, DRAPE_E_ARGUMENT, "there is a term \"%s\" already", ops->entry.name);
    if (ctx->host_term_count == DRAPE_MAX_HOST_TERMS)
        return drape_fail(ctx, DRAPE_E_ARGUMENT, "term \"%s\": a context holds at most %d user-defined terms",
                          ops->entry.name, DRAPE_MAX_HOST_TERMS);
    ctx->host_terms[ctx->host_term_count++] = own;
    return DRAPE_OK;
}
