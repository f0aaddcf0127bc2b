/* term_builder.c: what the build function of a term calls (drape/extend.h): it announces how many
 * elements, parts and others there are, and then sets each. Calls beyond these numbers set `strayed`. */
#include "compile/term_builder.h"

#include "base/search.h"
#include "terms/terms.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>

drape_status drape_term_refuse(drape_term_builder *builder, const char *format, ...)
{
    char text[512];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    return drape_refuse(builder->model->ctx, builder->pointer, "%s", text);
}

/* ---- Elements ---- */

drape_status drape_term_reserve(drape_term_builder *builder, int32_t element_count, int rest_count)
{
    return drape_term_reserve_nodes(builder, element_count, builder->term->ops->nodes, rest_count);
}

drape_status drape_term_reserve_nodes(drape_term_builder *builder, int32_t element_count, int nodes,
                                      int rest_count)
{
    drape_elements *el = &builder->term->elements;
    drape_arena *arena = &builder->model->arena;
    if (builder->reserved)
        return drape_term_refuse(builder, "%s announced its elements twice", builder->term->ops->entry.name);
    if (element_count < 0 || rest_count < 0 || nodes < 1 || nodes > builder->term->ops->nodes)
        return drape_term_refuse(builder,
                                 "%s announced %d elements of %d nodes with %d numbers of rest data; nodes "
                                 "are 1 to %d, and no count is negative",
                                 builder->term->ops->entry.name, (int)element_count, nodes, rest_count,
                                 builder->term->ops->nodes);
    builder->reserved = true;
    el->count = element_count;
    el->nodes = nodes;
    el->rest_count = rest_count;
    el->params = builder->term->params;
    el->tracks = builder->model->tracks;
    el->node = builder->node =
        drape_arena_take(arena, (size_t)element_count * (size_t)el->nodes, sizeof *builder->node);
    el->rest = builder->rest =
        drape_arena_take(arena, (size_t)element_count * (size_t)rest_count, sizeof *builder->rest);
    for (size_t i = 0; builder->node && i < (size_t)element_count * (size_t)el->nodes; i++)
        builder->node[i] = -1;
    return drape_arena_status(arena);
}

drape_status drape_term_check_cancel(drape_term_builder *builder, size_t work)
{
    return drape_check_cancel_after(builder->model->ctx, work);
}

void drape_term_anchor(drape_term_builder *builder)
{
    builder->term->anchored = true;
}

/* Stores the nodes and the rest data of element or part i of `count`. */
static void store(drape_term_builder *builder, int32_t i, int32_t count, const int32_t *nodes, int node_count,
                  int32_t *node_out, const double *rest, int rest_count, double *rest_out)
{
    if (!node_out || !rest_out || i < 0 || i >= count) {
        builder->strayed = true;
        return;
    }
    for (int a = 0; a < node_count; a++)
        node_out[(size_t)i * (size_t)node_count + (size_t)a] = builder->first_node + nodes[a];
    for (int k = 0; k < rest_count; k++)
        rest_out[(size_t)k * (size_t)count + (size_t)i] = rest[k];
}

void drape_term_set(drape_term_builder *builder, int32_t element, const int32_t *nodes, const double *rest)
{
    const drape_elements *el = &builder->term->elements;
    store(builder, element, el->count, nodes, el->nodes, builder->node, rest, el->rest_count, builder->rest);
}

double *drape_term_share(drape_term_builder *builder, int32_t count)
{
    drape_elements *el = &builder->term->elements;
    if (el->shared || count <= 0)
        return NULL;
    double *shared = drape_arena_take(&builder->model->arena, (size_t)count, sizeof *shared);
    el->shared = shared;
    el->shared_count = shared ? count : 0;
    return shared;
}

drape_status drape_term_reserve_sliders(drape_term_builder *builder, int count)
{
    drape_term *term = builder->term;
    if (!builder->reserved || !term->ops->measure || term->sliders > 0 || count < 1 ||
        count > DRAPE_MAX_SLIDERS)
        return drape_term_refuse(builder,
                                 "%s reserves %d sliders; 1 to %d, once, after the elements of a measure",
                                 term->ops->entry.name, count, DRAPE_MAX_SLIDERS);
    const size_t all = (size_t)count * (size_t)term->elements.count;
    term->slider_stiffness = drape_arena_take(&builder->model->arena, all, sizeof *term->slider_stiffness);
    term->slider_limit = drape_arena_take(&builder->model->arena, all, sizeof *term->slider_limit);
    term->sliders = count;
    return drape_arena_status(&builder->model->arena);
}

void drape_term_set_slider(drape_term_builder *builder, int number, int32_t element, double stiffness,
                           double limit)
{
    const drape_term *term = builder->term;
    if (!term->slider_stiffness || !term->slider_limit || number < 0 || number >= term->sliders ||
        element < 0 || element >= term->elements.count || !(stiffness >= 0) || !(limit >= 0) ||
        isinf(stiffness) || isinf(limit)) {
        builder->strayed = true;
        return;
    }
    const size_t at = (size_t)number * (size_t)term->elements.count + (size_t)element;
    term->slider_stiffness[at] = stiffness;
    term->slider_limit[at] = limit;
}

drape_status drape_term_add_branch(drape_term_builder *builder, double fraction, double time)
{
    drape_cloth *cloth = &builder->model->cloths[builder->term->cloth];
    const char *name = builder->term->ops->entry.name;
    double sum = fraction;
    if (!builder->term->ops->law || !(fraction > 0) || !(time > 0) || isinf(time) ||
        cloth->branch_count == DRAPE_MAX_BRANCHES)
        return drape_term_refuse(builder,
                                 "%s adds a branch of the fraction %g with the time %g s; both are above 0, "
                                 "and the laws of a cloth have at most %d branches",
                                 name, fraction, time, DRAPE_MAX_BRANCHES);
    for (int i = 0; i < cloth->branch_count; i++)
        sum += cloth->branches[i].fraction;
    if (sum > 1 + DRAPE_FRACTION_ROUNDING)
        return drape_term_refuse(
            builder, "the fractions of the stiffness that relax have the sum %.12g; it is at most 1", sum);
    cloth->branches[cloth->branch_count++] = (drape_branch){fraction, time};
    builder->model->has_branches = true;
    return DRAPE_OK;
}

void drape_term_timed(drape_term_builder *builder, double from, double to)
{
    builder->term->timed[0] = from;
    builder->term->timed[1] = to;
}

void drape_term_sew(drape_term_builder *builder, int32_t a, int32_t b)
{
    int32_t *sewn = builder->model->sewn;
    if (!sewn || a < 0 || a >= builder->model->node_count || b < 0 || b >= builder->model->node_count) {
        builder->strayed = true;
        return;
    }
    drape_set_join(sewn, a, b);
}

/* ---- Parts ---- */

drape_status drape_term_reserve_parts(drape_term_builder *builder, int32_t part_count, int32_t link_count,
                                      int rest_count)
{
    drape_parts *p = &builder->term->parts;
    drape_arena *arena = &builder->model->arena;
    const drape_term_ops *ops = builder->term->ops;
    const size_t parts = (size_t)part_count, links = (size_t)link_count, nodes = (size_t)ops->part_nodes;
    if (!ops->part || !builder->reserved || builder->reserved_parts)
        return drape_term_refuse(
            builder, "%s announced parts twice, before its elements, or without the function part",
            ops->entry.name);
    if (part_count < 0 || link_count < 0 || rest_count < 0)
        return drape_term_refuse(builder, "%s announced %d parts with %d numbers of rest data and %d links",
                                 ops->entry.name, (int)part_count, rest_count, (int)link_count);
    builder->reserved_parts = true;
    *p = (drape_parts){
        .count = part_count, .nodes = ops->part_nodes, .rest_count = rest_count, .link_count = link_count};
    p->node = builder->part_node = drape_arena_take(arena, parts * nodes, sizeof *builder->part_node);
    p->rest = builder->part_rest = drape_arena_take(arena, parts * (size_t)rest_count, sizeof(double));
    p->element = builder->link_element = drape_arena_take(arena, links, sizeof *builder->link_element);
    p->part = builder->link_part = drape_arena_take(arena, links, sizeof *builder->link_part);
    p->weight = builder->link_weight = drape_arena_take(arena, links, sizeof *builder->link_weight);
    for (size_t i = 0; builder->part_node && i < parts * nodes; i++)
        builder->part_node[i] = -1;
    builder->part_turn = drape_arena_take(arena, parts, sizeof *builder->part_turn);
    for (size_t i = 0; builder->part_turn && i < parts; i++)
        builder->part_turn[i] = -1;
    builder->term->elements.parts = p;
    return drape_arena_status(arena);
}

void drape_term_set_part(drape_term_builder *builder, int32_t part, const int32_t *nodes, const double *rest)
{
    const drape_parts *p = &builder->term->parts;
    store(builder, part, p->count, nodes, p->nodes, builder->part_node, rest, p->rest_count,
          builder->part_rest);
}

void drape_term_turn_part(drape_term_builder *builder, int32_t part, int32_t turn)
{
    drape_parts *p = &builder->term->parts;
    const drape_model *model = builder->model;
    if (!builder->part_turn || part < 0 || part >= p->count || turn < -1 || turn >= model->track_count) {
        builder->strayed = true;
        return;
    }
    builder->part_turn[part] = turn;
    if (turn >= 0)
        p->turn = builder->part_turn;
}

void drape_term_link(drape_term_builder *builder, int32_t element, int32_t part, double weight)
{
    const drape_term *term = builder->term;
    const int32_t i = builder->links,
                  last = i > 0 && builder->link_element ? builder->link_element[i - 1] : 0;
    if (!builder->link_weight || !builder->link_element || !builder->link_part || element < last ||
        element >= term->elements.count || part < 0 || part >= term->parts.count ||
        i >= term->parts.link_count) {
        builder->strayed = true;
        return;
    }
    builder->link_element[i] = element;
    builder->link_part[i] = part;
    builder->link_weight[i] = weight;
    builder->links++;
}
