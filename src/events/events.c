/* events.c: what event functions share. */
#include "events/events.h"

#include "base/vec3.h"

enum { LOWEST, HIGHEST, CENTER };
const char *const drape_event_nodes[] = {"lowest", "highest", "center", NULL};

drape_status drape_event_check_node(drape_context *ctx, const char *pointer, const drape_model *model,
                                    drape_model_event *event)
{
    const double node = event->values[DRAPE_EVENT_NODE];
    const char *at = DRAPE_FORMAT("%s/node", pointer);
    if (isnan(node))
        return DRAPE_OK;
    if (event->cloth < 0 && model->cloth_count > 1)
        return drape_refuse(ctx, at, "a node is a number within one cloth: \"cloth\" must name one of the %d",
                            (int)model->cloth_count);
    const drape_cloth *cloth = &model->cloths[event->cloth < 0 ? 0 : event->cloth];
    if (node >= cloth->mesh.node_count)
        return drape_refuse(ctx, at, "node %.0f is not in the mesh; its nodes are 0 to %d", node,
                            (int)cloth->mesh.node_count - 1);
    return DRAPE_OK;
}

double drape_event_position(const drape_event_point *p, const double direction[3])
{
    const double node = p->event->values[DRAPE_EVENT_NODE];
    const int of = (int)p->event->values[DRAPE_EVENT_OF];
    const drape_cloth *cloth = p->event->cloth < 0 ? NULL : &p->model->cloths[p->event->cloth];
    const int32_t first = cloth ? cloth->first_node : 0,
                  end = cloth ? first + cloth->mesh.node_count : p->model->node_count;
    if (!isnan(node))
        return vec3_dot(direction, p->x + 3 * ((size_t)first + (size_t)node));
    double extreme = of == LOWEST ? INFINITY : -INFINITY, sum = 0, mass = 0;
    for (int32_t i = first; i < end; i++) {
        const double along = vec3_dot(direction, p->x + 3 * (size_t)i);
        sum += p->model->mass[i] * along;
        mass += p->model->mass[i];
        extreme = of == LOWEST ? fmin(extreme, along) : fmax(extreme, along);
    }
    return of == CENTER ? sum / mass : extreme;
}
