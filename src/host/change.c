/* change.c: a sim that goes on with another model of the same cloth. */
#include "model/scene.h"
#include "sim/sim.h"

#include <string.h>

/* ---- What may change ---- */

static drape_status check_cloth(const drape_sim *sim, const drape_model *model, int32_t c)
{
    const drape_cloth *here = &sim->model->cloths[c], *there = &model->cloths[c];
    if (there->mesh.node_count != here->mesh.node_count ||
        there->mesh.triangle_count != here->mesh.triangle_count)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                          "drape_sim_change: %s has %d nodes and %d triangles in the model, and %d and %d in "
                          "the sim; the meshes of cloth stay the same",
                          there->name, (int)there->mesh.node_count, (int)there->mesh.triangle_count,
                          (int)here->mesh.node_count, (int)here->mesh.triangle_count);
    const size_t first = 3 * (size_t)here->first_triangle, count = 3 * (size_t)here->mesh.triangle_count;
    if (memcmp(model->triangle + first, sim->model->triangle + first, count * sizeof *model->triangle) != 0)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                          "drape_sim_change: %s has other triangles in the model than in the sim; the meshes "
                          "of cloth stay the same",
                          there->name);
    return DRAPE_OK;
}

static drape_status check_model(const drape_sim *sim, const drape_model *model)
{
    drape_status status = DRAPE_OK;
    if (model->cloth_count != sim->model->cloth_count)
        return drape_fail(
            sim->ctx, DRAPE_E_ARGUMENT,
            "drape_sim_change: the model has %d cloths, and the sim %d; the meshes of cloth stay the same",
            (int)model->cloth_count, (int)sim->model->cloth_count);
    for (int32_t c = 0; !status && c < model->cloth_count; c++)
        status = check_cloth(sim, model, c);
    return status;
}

/* ---- The change ---- */

/* Pins that the host or an event made or released stay so; the others are those of the model. Returns NULL if
 * these are those of the model. */
static const uint8_t *pins_of(const drape_sim *sim, const drape_model *model, uint8_t *pinned)
{
    const drape_model *base = drape_sim_base_model(sim);
    bool own = false;
    for (int32_t i = 0; sim->pinned && i < model->node_count; i++) {
        const bool kept = sim->pinned[i] != base->pinned[i];
        pinned[i] = kept ? sim->pinned[i] : model->pinned[i];
        own = own || pinned[i] != model->pinned[i];
    }
    return own ? pinned : NULL;
}

/* The same for masses that the host set. */
static const double *masses_of(const drape_sim *sim, const drape_model *model, double *masses)
{
    const drape_model *base = drape_sim_base_model(sim);
    bool own = false;
    for (int32_t i = 0; sim->masses && i < model->node_count; i++) {
        masses[i] = sim->masses[i] != base->mass[i] ? sim->masses[i] : model->mass[i];
        own = own || masses[i] != model->mass[i];
    }
    return own ? masses : NULL;
}

static drape_status change(drape_sim *sim, const drape_model *model)
{
    const size_t nodes = (size_t)model->node_count;
    uint8_t *pinned = drape_alloc(sim->ctx, nodes, sizeof *pinned);
    double *masses = drape_alloc(sim->ctx, nodes, sizeof *masses);
    drape_status status = DRAPE_E_MEMORY;
    if (pinned && masses)
        status = drape_sim_remake(sim, model, pins_of(sim, model, pinned), masses_of(sim, model, masses));
    if (!status)
        drape_events_forget(sim);
    drape_free(sim->ctx, masses);
    drape_free(sim->ctx, pinned);
    return status;
}

drape_status drape_sim_change_model(drape_sim *sim, const drape_model *model)
{
    drape_status status = drape_sim_guard(sim, "drape_sim_change_model");
    if (status)
        return status;
    if (!model)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "drape_sim_change_model: the model is NULL");
    status = check_model(sim, model);
    if (!status)
        status = change(sim, model);
    if (!status)
        drape_model_destroy(&sim->kept_model);
    return status;
}

drape_status drape_sim_change(drape_sim *sim, drape_scene *scene)
{
    drape_model *model = NULL;
    drape_status status = drape_sim_guard(sim, "drape_sim_change");
    if (status)
        return status;
    if (!scene)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "drape_sim_change: the scene is NULL");
    /* The message of a scene goes to its own context. */
    drape_context *own = drape_scene_context(scene);
    const drape_status compiled = drape_scene_compile(scene, &model);
    status = compiled && own != sim->ctx ? drape_fail(sim->ctx, compiled, "%s", drape_context_message(own))
                                         : compiled;
    if (!status)
        status = drape_sim_change_model(sim, model);
    if (status)
        drape_model_destroy(&model);
    else
        sim->kept_model = model;
    return status;
}
