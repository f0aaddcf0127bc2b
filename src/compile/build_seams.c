/* build_seams.c: which nodes the seams join. Their elements are built with those of the other terms. */
#include "compile/select.h"
#include "compile/stages.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* One side of a seam under construction. */
typedef struct side {
    drape_model *model;
    const drape_seam_side_def *def;
    char pointer[64]; /* "/seams/0/a" */
    int32_t cloth;
    int32_t
        *node; /* (count) in the order of the seam, local to the cloth; memory for all nodes of the cloth */
    int32_t count;
    uint8_t *taken; /* (nodes of the cloth) 1: the side has it */
} side;

static drape_status take_node(void *user, const char *key, int32_t local)
{
    side *s = user;
    if (s->taken[local])
        return drape_fail_below(s->model->ctx, s->pointer, key, "node %d is in the seam twice", (int)local);
    s->taken[local] = 1;
    s->node[s->count++] = local;
    return DRAPE_OK;
}

/* ---- The order ---- */

/* Sorts the nodes by a coordinate (nodes of the cloth x step). */
static drape_status sort_by(side *s, const double *along, size_t step)
{
    drape_node_along *list = drape_arena_take(&s->model->scratch, (size_t)s->count, sizeof *list);
    if (!list)
        return DRAPE_E_MEMORY;
    for (int32_t i = 0; i < s->count; i++)
        list[i] = (drape_node_along){along[step * (size_t)s->node[i]], s->node[i]};
    qsort(list, (size_t)s->count, sizeof *list, drape_compare_along);
    for (int32_t i = 0; i < s->count; i++)
        s->node[i] = list[i].node;
    return DRAPE_OK;
}

/* Sorts the nodes of a box along the longest side of their bounding box. */
static drape_status sort(side *s)
{
    const double *x = s->model->cloths[s->cloth].mesh.x;
    double low[3], high[3];
    int axis = 0;
    memcpy(low, x + 3 * (size_t)s->node[0], sizeof low);
    memcpy(high, low, sizeof high);
    for (int32_t i = 0; i < s->count; i++)
        for (int k = 0; k < 3; k++) {
            const double at = x[3 * (size_t)s->node[i] + (size_t)k];
            low[k] = at < low[k] ? at : low[k];
            high[k] = at > high[k] ? at : high[k];
        }
    for (int k = 1; k < 3; k++)
        axis = high[k] - low[k] > high[axis] - low[axis] ? k : axis;
    return sort_by(s, x + axis, 3);
}

/* Of a subdivided mesh, adds the nodes between neighbours. */
static drape_status insert_middles(side *s)
{
    const drape_mesh *mesh = &s->model->cloths[s->cloth].mesh;
    const int32_t first = mesh->given->node_count;
    double step = 1; /* between neighbours, which each level of parents halves */
    double *along = drape_arena_take(&s->model->scratch, (size_t)mesh->node_count, sizeof *along);
    if (!along)
        return DRAPE_E_MEMORY;
    for (int32_t i = 0; i < s->count; i++)
        along[s->node[i]] = i;
    for (int32_t i = first; i < mesh->node_count; i++) {
        const int32_t *of = mesh->parent + 2 * (size_t)(i - first);
        step = i > first && of[0] < of[-2] ? step / 2 : step; /* the edges of a level ascend */
        along[i] = (along[of[0]] + along[of[1]]) / 2;
        s->taken[i] = s->taken[of[0]] && s->taken[of[1]] && fabs(along[of[0]] - along[of[1]]) == step;
        if (s->taken[i])
            s->node[s->count++] = i;
    }
    return sort_by(s, along, 1);
}

/* ---- A side ---- */

static drape_status list_side(side *s)
{
    drape_arena *scratch = &s->model->scratch;
    const drape_seam_side_def *def = s->def;
    for (s->cloth = 0; s->cloth < s->model->cloth_count; s->cloth++)
        if (strcmp(s->model->cloths[s->cloth].name, def->cloth) == 0)
            break;
    if (s->cloth == s->model->cloth_count)
        return drape_fail_below(s->model->ctx, s->pointer, "cloth", "there is no cloth \"%.60s\"",
                                def->cloth);
    const drape_mesh *mesh = &s->model->cloths[s->cloth].mesh;
    s->node = drape_arena_take(scratch, (size_t)mesh->node_count, sizeof *s->node);
    s->taken = drape_arena_take(scratch, (size_t)mesh->node_count, sizeof *s->taken);
    const drape_selection selection = {.ctx = s->model->ctx,
                                       .pointer = s->pointer,
                                       .form = &drape_form_seam_side,
                                       .mesh = mesh,
                                       DRAPE_SELECTED_BY(def),
                                       .take = take_node,
                                       .user = s};
    DRAPE_TRY(drape_arena_status(scratch));
    DRAPE_TRY(drape_select_nodes(&selection));
    if (def->has_box)
        DRAPE_TRY(sort(s));
    if (mesh->given)
        DRAPE_TRY(insert_middles(s));
    for (int32_t i = 0, j = s->count - 1; def->reverse && i < j; i++, j--) {
        const int32_t node = s->node[i];
        s->node[i] = s->node[j];
        s->node[j] = node;
    }
    return DRAPE_OK;
}

/* ---- A seam ---- */

static drape_status join(drape_model *model, const char *pointer, const side sides[2], drape_model_seam *to)
{
    const side *a = &sides[0], *b = &sides[1];
    if (a->count != b->count)
        return drape_refuse(model->ctx, pointer,
                            "side a has %d nodes and side b has %d: they are joined one by one",
                            (int)a->count, (int)b->count);
    for (int32_t i = 0; i < a->count; i++)
        if (a->cloth == b->cloth && a->node[i] == b->node[i])
            return drape_refuse(model->ctx, pointer, "pair %d joins node %d of \"%.60s\" to itself", (int)i,
                                (int)a->node[i], model->cloths[a->cloth].name);
    to->pair = drape_arena_take(&model->arena, 2 * (size_t)a->count, sizeof *to->pair);
    if (!to->pair)
        return DRAPE_E_MEMORY;
    to->pair_count = a->count;
    for (int k = 0; k < 2; k++) {
        to->cloth[k] = sides[k].cloth;
        for (int32_t i = 0; i < a->count; i++)
            to->pair[2 * (size_t)i + (size_t)k] = model->cloths[sides[k].cloth].first_node + sides[k].node[i];
    }
    return DRAPE_OK;
}

static drape_status compile_seam(drape_model *model, size_t i, const drape_seam_def *def)
{
    drape_model_seam *to = &model->seams[i];
    side sides[2] = {{.model = model, .def = &def->a}, {.model = model, .def = &def->b}};
    const char *pointer = DRAPE_FORMAT("/seams/%zu", i);
    DRAPE_TRY(
        drape_compile_name(model, pointer, "seam", "seams", def->name, (int32_t)i, &to->name, sizeof *to));
    DRAPE_TRY(drape_compile_choice(model, &def->entry, "", &to->choice));
    for (int k = 0; k < 2; k++) {
        snprintf(sides[k].pointer, sizeof sides[k].pointer, "%s/%c", pointer, "ab"[k]);
        DRAPE_TRY(list_side(&sides[k]));
    }
    return join(model, pointer, sides, to);
}

drape_status drape_compile_seams(drape_model *model, const drape_scene_def *def)
{
    if (def->seam_count == 0)
        return DRAPE_OK;
    model->seams = drape_arena_take(&model->arena, def->seam_count, sizeof *model->seams);
    model->sewn = drape_arena_take(&model->arena, (size_t)model->node_count, sizeof *model->sewn);
    if (!model->seams || !model->sewn)
        return DRAPE_E_MEMORY;
    for (int32_t i = 0; i < model->node_count; i++)
        model->sewn[i] = i;
    for (size_t i = 0; i < def->seam_count; i++) {
        DRAPE_TRY(drape_check_cancel(model->ctx));
        DRAPE_TRY(compile_seam(model, i, &def->seams[i]));
        drape_arena_free(&model->scratch); /* there may be thousands of seams of large sheets */
        model->seam_count = (int32_t)i + 1;
    }
    return DRAPE_OK;
}
