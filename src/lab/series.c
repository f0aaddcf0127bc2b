/* series.c: see series.h. */
#include "lab/series.h"

#include "control/control.h"

#include <math.h>
#include <string.h>

/* ---- Plans ---- */

drape_status lab_add_point(lab *l, const lab_point *p)
{
    const char *knob = p->knob ? p->knob : strrchr(p->pointer, '/') + 1;
    json_t *tags = json_object(), *settings = json_pack("{s:s}", "/integrator/method", p->integrator);
    if (p->scene)
        json_object_set_new(tags, "scene", json_string(p->scene));
    json_object_set_new(tags, "series", json_string(p->series));
    json_object_set_new(tags, "integrator", json_string(p->integrator));
    json_object_set_new(tags, "knob", json_string(knob));
    json_object_set_new(tags, "value", json_real(p->level.value));
    if (p->pointer)
        json_object_set_new(settings, p->pointer, json_real(p->level.value));
    if (p->more)
        json_object_update(settings, p->more);
    json_decref(p->more);
    drape_status status = lab_add_case(l, tags, settings, -1);
    if (!status &&
        p->level.rank >= 0) { /* cases of low rank are run first; of equal rank, explicit integrators last */
        const int rank = 2 * p->level.rank + (lab_find_integrator(p->integrator)->stability != NULL);
        json_object_set_new(json_array_get(l->cases, json_array_size(l->cases) - 1), "rank",
                            json_integer(rank));
    }
    return status;
}

/* Adds a series: an integrator over the levels of a value, with further settings of all its cases, whose
 * reference this takes. dt and rtol: those of lab_grid.add; NULL: the level. */
static drape_status add_series(lab *l, const lab_grid *g, const drape_integrator_ops *integrator,
                               const char *series, const char *pointer, json_t *settings)
{
    const bool steps = strcmp(pointer, "/integrator/dt") == 0, own = integrator->own_steps;
    const lab_levels levels = steps ? g->steps : own ? g->rtols : g->controlled;
    drape_status status = DRAPE_OK;
    for (size_t i = 0; !status && i < levels.count; i++) {
        const lab_level level = levels.at[i];
        json_t *more = json_copy(settings);
        if (!own && g->add)
            g->add(g->user, integrator, steps ? level.value : NAN, level.value, more);
        status = lab_add_point(l, &(lab_point){g->scene, series, integrator->entry.name, pointer,
                                               steps || own ? g->knob : NULL, level, more});
    }
    json_decref(settings);
    return status;
}

drape_status lab_add_integrator(lab *l, const lab_grid *g, const drape_integrator_ops *integrator)
{
    const bool own = integrator->own_steps;
    /* An integrator with the parameter max_order is run with its order limited to 2 and to 5, unless the def
     * sets the limit: a series each, because a line through points of different limits has no meaning. 0: no
     * limit is set. */
    bool chosen = !lab_has_param(&integrator->entry, "max_order");
    for (size_t i = 0; i < l->def->setting_count; i++)
        chosen |= strcmp(l->def->settings[i].pointer, "/integrator/max_order") == 0;
    const int limits[2] = {chosen ? 0 : 2, 5};
    for (size_t k = 0; k < (chosen ? 1 : 2); k++) {
        char series[96];
        json_t *settings = json_object();
        snprintf(series, sizeof series, limits[k] ? "%s, order %d" : "%s", integrator->entry.name, limits[k]);
        if (limits[k])
            json_object_set_new(settings, "/integrator/max_order", json_integer(limits[k]));
        DRAPE_TRY(
            add_series(l, g, integrator, series, own ? "/integrator/rtol" : "/integrator/dt", settings));
    }
    if (own || (g->only_if_implicit && integrator->stability))
        return DRAPE_OK;
    for (int c = 0; drape_controllers[c]; c++) {
        const drape_entry *controller = &drape_controllers[c]->entry;
        char series[96];
        if (!lab_has_param(controller, "rtol"))
            continue;
        snprintf(series, sizeof series, "%s, %s control", integrator->entry.name, controller->name);
        DRAPE_TRY(add_series(
            l, g, integrator, series, "/controller/rtol",
            json_pack("{s:s, s:f}", "/controller/type", controller->name, "/integrator/dt", g->first_step)));
    }
    return DRAPE_OK;
}

/* ---- Results ---- */

lab_series *lab_list_series(lab *l, const char *scene, size_t *count)
{
    size_t cases = 0;
    *count = 0;
    for (size_t i = 0; i < l->count; i++)
        cases += !scene || strcmp(lab_tag_text(json_array_get(l->cases, i), "scene"), scene) == 0;
    lab_series *list = drape_arena_take(&l->arena, cases, sizeof *list), *s = NULL;
    const json_t **results = drape_arena_take(&l->arena, cases, sizeof *results);
    for (size_t i = 0; list && results && i < l->count; i++) {
        const json_t *one = json_array_get(l->cases, i);
        if (scene && strcmp(lab_tag_text(one, "scene"), scene) != 0)
            continue;
        if (!s || strcmp(s->name, lab_tag_text(one, "series")) != 0) {
            lab_series *before = s;
            s = &list[(*count)++];
            *s = (lab_series){.scene = lab_tag_text(one, "scene"),
                              .name = lab_tag_text(one, "series"),
                              .integrator = lab_tag_text(one, "integrator"),
                              .knob = lab_tag_text(one, "knob"),
                              .results = results};
            if (before && strcmp(before->integrator, s->integrator) == 0)
                s->variant = before->variant + 1;
        }
        if (l->results[i]) {
            *results++ = l->results[i];
            s->count++;
        }
    }
    return results ? list : NULL;
}

drape_status lab_draw_series(lab *l, const lab_chart *c, const lab_series *list, size_t count)
{
    lab_figure f;
    bool any_negative = false;
    lab_figure_begin(l, &f, c->name, c->title, c->x_label, c->y_label);
    for (const lab_series *s = list; s < list + count; s++) {
        const lab_style open = lab_style_of(s->integrator, 1);
        bool positive = false;
        for (int sign = 1; sign >= (c->negative ? -1 : 1) && (!c->knob || strcmp(s->knob, c->knob) == 0);
             sign -= 2) {
            lab_figure_data(&f);
            for (size_t i = 0; i < s->count; i++) {
                const json_t *r = s->results[i];
                const double x = c->knob ? lab_tag_number(r, "value") : lab_number(r, c->x);
                const double y = c->shows(r) ? sign * lab_number(r, c->y) : NAN;
                if (x > 0 && y > 0)
                    lab_figure_point(&f, x, y);
            }
            if (sign > 0)
                positive = lab_figure_series(&f, s->integrator, s->variant, s->name);
            else
                any_negative |= lab_figure_curve(&f, (lab_style){open.colour, 0, open.point},
                                                 positive || s->variant > 0 ? NULL : s->name);
        }
    }
    if (any_negative)
        lab_figure_marker(&f, (lab_style){LAB_BLACK, 0, LAB_OPEN_MARKER}, c->negative);
    lab_figure_fit(&f, c->orders);
    return lab_figure_end(l, &f, c->caption ? c->caption : c->y_label);
}

void lab_knob_text(const json_t *result, char text[64])
{
    const char *knob = lab_tag_text(result, "knob");
    const double value = lab_tag_number(result, "value");
    if (strcmp(knob, "dt") == 0 && value > 0)
        snprintf(text, 64, "dt 1/%.4g s", 1 / value);
    else
        snprintf(text, 64, "%s %.3g", knob, value);
}
