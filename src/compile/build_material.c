/*
 * build_material.c: derives membrane stiffness E h, flexural rigidity D = E h^3/(12 (1 - nu^2)) and lumped
 * masses from Young's modulus, Poisson's ratio, thickness and a density.
 */
#include "compile/fabrics.h"
#include "compile/stages.h"

#include <math.h>
#include <string.h>

enum {
    YOUNG_MODULUS,
    POISSON_RATIO,
    THICKNESS,
    DENSITY,
    AREAL_DENSITY,
    TOTAL_MASS,
    MASS,
    FABRIC,
    DAMPING,
    FIRST_CURVE, /* DRAPE_CURVE_WARP */
    PARAM_COUNT = FIRST_CURVE + DRAPE_CURVE_COUNT
};

/* How far a curve may go: the angle of shear stays below a right one. */
#define MAX_STRAIN 100
#define MAX_ANGLE  89

enum { DAMPING_FABRIC, DAMPING_NONE };
static const char *const damping_choices[] = {"fabric", "none", NULL};

enum { MASS_AREA, MASS_UNIFORM };
static const char *const mass_choices[] = {"area", "uniform", NULL};

static const drape_param params[] = {
    [YOUNG_MODULUS] = DRAPE_NUMBER("young_modulus", "Pa", DRAPE_DERIVED("required without a fabric"),
                                   DRAPE_ABOVE(0), 1e15, "Young's modulus E of the sheet"),
    [POISSON_RATIO] = DRAPE_NUMBER("poisson_ratio", "1", 1.0 / 3.0, DRAPE_ABOVE(-1), 0.5,
                                   "Poisson's ratio nu; stretch.edge always has 1/3"),
    [THICKNESS] = DRAPE_NUMBER("thickness", "m", DRAPE_DERIVED("required without a fabric"), DRAPE_ABOVE(0),
                               10, "thickness h of the sheet"),
    [DENSITY] = DRAPE_NUMBER("density", "kg/m3", DRAPE_DERIVED("from areal_density or total_mass"),
                             DRAPE_ABOVE(0), 1e9, "mass per volume; times thickness is the areal density"),
    [AREAL_DENSITY] = DRAPE_NUMBER("areal_density", "kg/m2", DRAPE_DERIVED("from density or total_mass"),
                                   DRAPE_ABOVE(0), 1e9, "mass per area, in place of density"),
    [TOTAL_MASS] = DRAPE_NUMBER("total_mass", "kg", DRAPE_DERIVED("from density or areal_density"),
                                DRAPE_ABOVE(0), 1e12, "mass of the whole cloth, in place of density"),
    [MASS] =
        DRAPE_CHOICE("mass", MASS_AREA, mass_choices,
                     "area: lumped, a third of each triangle to each node; uniform: the same on every node"),
    [FABRIC] =
        DRAPE_CHOICE("fabric", 0, drape_fabric_names,
                     "a measured fabric: gives the areal density unless the scene does, the "
                     "bending of bend.midedge and, without young_modulus and thickness, the tension and "
                     "shear of stretch.cst"),
    [DAMPING] = DRAPE_CHOICE(
        "damping", DAMPING_FABRIC, damping_choices,
        "of a fabric. fabric: damp.kelvin_voigt by its measured loss, unless a term of the cloth "
        "dissipates within it; verlet leaves it out; none: an elastic sheet"),
    [FIRST_CURVE + DRAPE_CURVE_WARP] =
        DRAPE_POINTS("warp_curve", "1", DRAPE_DERIVED("of the fabric, or a straight line"), 1e-9, MAX_STRAIN,
                     "tension of a strip along the warp, its sides free: strain and force per width in N/m, "
                     "for stretch.curve",
                     .numbers = "[strain, force]"),
    [FIRST_CURVE + DRAPE_CURVE_WEFT] =
        DRAPE_POINTS("weft_curve", "1", DRAPE_DERIVED("of the fabric, or a straight line"), 1e-9, MAX_STRAIN,
                     "the same along the weft", .numbers = "[strain, force]"),
    [FIRST_CURVE + DRAPE_CURVE_SHEAR] = DRAPE_POINTS(
        "shear_curve", "1", DRAPE_DERIVED("straight in the sine of the angle"), 1e-9, MAX_ANGLE,
        "shear: angle in degrees and force per length in N/m, less W tan(angle) if the sheet was "
        "held taut by a force W per length; for stretch.curve",
        .numbers = "[angle, force]"),
};

const drape_entry drape_material_entry = {
    .name = "material",
    .summary = "a sheet; give exactly one of density, areal_density, total_mass",
    DRAPE_PARAMS(params)};
static const drape_entry *const material_entries[] = {&drape_material_entry, NULL};
const drape_registry drape_material_registry = {
    "material", "materials", "Material", "\"material\" of a cloth", material_entries, NULL};

static drape_status total_mass(drape_context *ctx, const char *pointer, const double *values, double area,
                               double *mass)
{
    double density = values[DENSITY], areal = values[AREAL_DENSITY];
    double total = values[TOTAL_MASS];
    int given = !isnan(density) + !isnan(areal) + !isnan(total);
    const drape_fabric *fabric = &drape_fabrics[(int)values[FABRIC]];
    if (given == 0 && fabric->areal_density > 0) {
        *mass = area * fabric->areal_density;
        return DRAPE_OK;
    }
    if (given != 1)
        return drape_refuse(
            ctx, pointer,
            "%d of \"density\", \"areal_density\", \"total_mass\" are given; exactly one is needed", given);
    *mass = !isnan(total) ? total : area * (!isnan(areal) ? areal : density * values[THICKNESS]);
    return DRAPE_OK;
}

/* Checks Young's modulus and thickness: both are required without a fabric; with one, both or neither must be
 * given. */
static drape_status check_stiffness(drape_context *ctx, const char *pointer, const double *values)
{
    static const int needed[] = {YOUNG_MODULUS, THICKNESS};
    const bool none = isnan(values[needed[0]]) && isnan(values[needed[1]]);
    if (none && values[FABRIC] > 0)
        return DRAPE_OK;
    for (size_t i = 0; i < sizeof needed / sizeof *needed; i++)
        if (isnan(values[needed[i]]))
            return drape_param_missing(ctx, pointer, &params[needed[i]]);
    return DRAPE_OK;
}

/* Copies the points that the scene gives. */
static drape_status take_curves(drape_model *model, const drape_cloth_def *def, drape_cloth *cloth)
{
    for (size_t i = 0; i < def->material_count; i++) {
        const drape_setting *given = &def->material[i];
        const int k = drape_param_find(params, PARAM_COUNT, given->name) - FIRST_CURVE;
        if (k < 0)
            continue;
        double *point = drape_arena_take(&model->arena, given->vector_count, sizeof *point);
        if (!point)
            return DRAPE_E_MEMORY;
        memcpy(point, given->vector, given->vector_count * sizeof *point);
        cloth->curves[k] = (drape_points){(int32_t)(given->vector_count / 2), point};
    }
    return DRAPE_OK;
}

/* Values that the scene gives take precedence over measured ones. */
static drape_status take_fabric(drape_model *model, const drape_cloth_def *def, double *values,
                                drape_cloth *cloth)
{
    const drape_fabric *fabric = &drape_fabrics[(int)values[FABRIC]];
    drape_woven tension, *bending = &cloth->bending;
    if (!(fabric->areal_density > 0))
        return DRAPE_OK;
    drape_fabric_tension(fabric, &tension);
    drape_fabric_bending(fabric, bending);
    if (values[DAMPING] == DAMPING_FABRIC)
        cloth->retardation = drape_fabric_loss(fabric) / drape_fabric_frequency(fabric);
    for (size_t i = 0; i < def->material_count; i++)
        if (strcmp(def->material[i].name, params[POISSON_RATIO].name) == 0)
            tension.poisson = bending->poisson = values[POISSON_RATIO];
    if (!isnan(values[THICKNESS]))
        return DRAPE_OK;
    cloth->tension = tension;
    /* Computes thickness and modulus of the isotropic sheet whose strips have the mean tension K and
     * bending B of the fabric, h = sqrt(12 B/K), E = K/h, for terms that do not use fabrics, such as
     * hinges and edges. */
    const double k = sqrt(tension.warp * tension.weft), b = sqrt(bending->warp * bending->weft);
    values[THICKNESS] = sqrt(12 * b / k);
    values[YOUNG_MODULUS] = k / values[THICKNESS];
    /* The curves, where the scene gives none. */
    double *point = drape_arena_take(&model->arena, 4 * DRAPE_FABRIC_POINTS, sizeof *point);
    if (!point)
        return DRAPE_E_MEMORY;
    double *const of[2] = {[DRAPE_CURVE_WARP] = point, [DRAPE_CURVE_WEFT] = point + 2 * DRAPE_FABRIC_POINTS};
    const bool measured = drape_fabric_curves(fabric, of[DRAPE_CURVE_WARP], of[DRAPE_CURVE_WEFT]);
    for (int c = 0; measured && c < 2; c++)
        if (cloth->curves[c].count == 0)
            cloth->curves[c] = (drape_points){DRAPE_FABRIC_POINTS, of[c]};
    return DRAPE_OK;
}

drape_status drape_compile_material(drape_model *model, const char *pointer, const drape_cloth_def *def,
                                    drape_cloth *cloth)
{
    double values[PARAM_COUNT], mass = 0;
    const char *at = DRAPE_FORMAT("%s/material", pointer);
    DRAPE_TRY(drape_params_resolve(model->ctx, at, &drape_material_entry, def->material, def->material_count,
                                   values));
    double area = 0;
    for (int32_t t = 0; t < cloth->mesh.triangle_count; t++)
        area += cloth->mesh.triangle_area[t];
    DRAPE_TRY(check_stiffness(model->ctx, at, values));
    DRAPE_TRY(total_mass(model->ctx, at, values, area, &mass));
    DRAPE_TRY(take_curves(model, def, cloth));
    int32_t count = cloth->mesh.node_count;
    cloth->material_mass = drape_arena_take(&model->arena, (size_t)count, sizeof *cloth->material_mass);
    cloth->node_mass = cloth->material_mass;
    if (!cloth->material_mass)
        return DRAPE_E_MEMORY;
    DRAPE_TRY(take_fabric(model, def, values, cloth));
    memcpy(cloth->material_values, values, sizeof values);
    const bool measured = cloth->bending.warp > 0;
    drape_material m = {.bending_warp = measured ? cloth->bending.warp : NAN,
                        .bending_weft = measured ? cloth->bending.weft : NAN,
                        .bending_twist = measured ? cloth->bending.shear : NAN,
                        .young_modulus = values[YOUNG_MODULUS],
                        .poisson_ratio = values[POISSON_RATIO],
                        .thickness = values[THICKNESS],
                        .areal_density = mass / area};
    m.membrane_stiffness = m.young_modulus * m.thickness;
    m.flexural_rigidity = m.young_modulus * m.thickness * m.thickness * m.thickness /
                          (12 * (1 - m.poisson_ratio * m.poisson_ratio));
    cloth->material = m;
    for (int32_t i = 0; i < count; i++)
        cloth->material_mass[i] = values[MASS] == MASS_UNIFORM
                                      ? mass / count
                                      : cloth->material.areal_density * cloth->mesh.node_area[i];
    return DRAPE_OK;
}
