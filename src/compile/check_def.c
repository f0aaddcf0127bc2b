/* check_def.c: a scene def that a host filled may have NULL where something should be: found here, so that
 * nobody else has to look. */
#include "compile/stages.h"

#include <stdio.h>

/* count of what, but no array, or an array with a hole. */
static drape_status refuse(drape_context *ctx, const char *pointer, const char *what)
{
    return drape_fail_at(ctx, DRAPE_E_ARGUMENT, pointer, "%s is NULL", what);
}

static drape_status check_settings(drape_context *ctx, const char *pointer, const drape_setting *settings,
                                   size_t count)
{
    if (count > 0 && !settings)
        return refuse(ctx, pointer, "the array of settings");
    for (size_t i = 0; i < count; i++)
        if (!settings[i].name)
            return refuse(ctx, pointer, "the name of a setting");
    return DRAPE_OK;
}

static drape_status check_row(drape_context *ctx, const char *pointer, const drape_row_def *row)
{
    return check_settings(ctx, pointer, row->settings, row->setting_count);
}

static drape_status check_terms(drape_context *ctx, const char *pointer, const drape_cloth_def *cloth)
{
    char at[96];
    if (cloth->term_count > 0 && !cloth->terms)
        return refuse(ctx, pointer, "the array of terms");
    for (size_t i = 0; i < cloth->term_count; i++) {
        snprintf(at, sizeof at, "%s/terms/%zu", pointer, i);
        drape_status status = cloth->terms[i].type ? check_row(ctx, at, &cloth->terms[i])
                                                   : refuse(ctx, at, "the type of a term");
        if (status)
            return status;
    }
    return DRAPE_OK;
}

static drape_status check_pins(drape_context *ctx, const char *pointer, const drape_cloth_def *cloth)
{
    char at[96];
    if (cloth->pin_count > 0 && !cloth->pins)
        return refuse(ctx, pointer, "the array of pins");
    for (size_t i = 0; i < cloth->pin_count; i++) {
        snprintf(at, sizeof at, "%s/pins/%zu", pointer, i);
        if (cloth->pins[i].node_count > 0 && !cloth->pins[i].nodes)
            return refuse(ctx, at, "the array of nodes");
        if (cloth->pins[i].key_count > 0 && !cloth->pins[i].track)
            return refuse(ctx, at, "the track");
    }
    return DRAPE_OK;
}

static drape_status check_collider(drape_context *ctx, size_t i, const drape_collider_def *collider)
{
    char pointer[64];
    snprintf(pointer, sizeof pointer, "/colliders/%zu", i);
    if (!collider->row.type)
        return refuse(ctx, pointer, "the type of a collider");
    if (collider->key_count > 0 && !collider->track)
        return refuse(ctx, pointer, "the track");
    return check_row(ctx, pointer, &collider->row);
}

static drape_status check_contact(drape_context *ctx, const drape_scene_def *def)
{
    if (def->collider_count > 0 && !def->colliders)
        return refuse(ctx, "/colliders", "the array of colliders");
    if (def->collider_count > DRAPE_MOST_COLLIDERS)
        return drape_fail_at(ctx, DRAPE_E_ARGUMENT, "/colliders",
                             "the scene has %zu colliders; it has at most %d", def->collider_count,
                             DRAPE_MOST_COLLIDERS);
    drape_status status = check_settings(ctx, "/contact", def->contact, def->contact_count);
    if (!status)
        status = check_settings(ctx, "/self_contact", def->self_contact, def->self_contact_count);
    for (size_t i = 0; !status && i < def->collider_count; i++)
        status = check_collider(ctx, i, &def->colliders[i]);
    return status;
}

static drape_status check_cloth(drape_context *ctx, size_t c, const drape_cloth_def *cloth)
{
    char pointer[64], at[96];
    snprintf(pointer, sizeof pointer, "/cloth/%zu", c);
    snprintf(at, sizeof at, "%s/mesh", pointer);
    drape_status status = check_row(ctx, at, &cloth->mesh.grid);
    if (!status && cloth->mesh.positions && cloth->mesh.triangle_count > 0 && !cloth->mesh.triangles)
        status = refuse(ctx, at, "the array of triangles");
    snprintf(at, sizeof at, "%s/material", pointer);
    if (!status)
        status = check_settings(ctx, at, cloth->material, cloth->material_count);
    if (!status)
        status = check_terms(ctx, pointer, cloth);
    return status ? status : check_pins(ctx, pointer, cloth);
}

drape_status drape_compile_check_def(drape_context *ctx, const drape_scene_def *def)
{
    if (def->cloth_count > 0 && !def->cloths)
        return refuse(ctx, "/cloth", "the array of cloths");
    if (def->format_count > 0 && !def->formats)
        return refuse(ctx, "/output/formats", "the array of formats");
    for (size_t i = 0; i < def->format_count; i++)
        if (!def->formats[i])
            return refuse(ctx, "/output/formats", "a format");
    drape_status status = check_row(ctx, "/integrator", &def->integrator);
    if (!status)
        status = check_row(ctx, "/controller", &def->controller);
    if (!status)
        status = check_contact(ctx, def);
    for (size_t c = 0; !status && c < def->cloth_count; c++)
        status = check_cloth(ctx, c, &def->cloths[c]);
    return status;
}
