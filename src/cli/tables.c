/* tables.c: see tables.h. */
#include "cli/tables.h"

#include "colliders/colliders.h"
#include "compile/compile.h"
#include "compile/fabrics.h"
#include "control/control.h"
#include "fields/fields.h"
#include "io/export.h"
#include "mesh/mesh.h"
#include "solvers/linear.h"
#include "terms/terms.h"

#include <math.h>
#include <stdio.h>

static bool grid(int index, cli_row *row)
{
    const drape_grid_ops *ops = drape_grids[index];
    if (ops)
        *row = (cli_row){.name = ops->name,
                         .summary = ops->summary,
                         .params = ops->params,
                         .param_count = ops->param_count};
    return ops;
}

static bool import(int index, cli_row *row)
{
    const drape_import_ops *ops = drape_imports[index];
    if (ops)
        *row = (cli_row){.name = ops->name, .summary = ops->summary};
    return ops;
}

/* One row: a material has parameters and no kinds. */
static bool material(int index, cli_row *row)
{
    if (index == 0)
        *row = (cli_row){.name = "material",
                         .summary = "a sheet; exactly one of density, areal_density, total_mass is given",
                         .params = drape_material_params,
                         .param_count = drape_material_param_count};
    return index == 0;
}

/* Of what was published, as drape_fabric has it; the rest is derived. */
static void describe(const drape_fabric *f, char *text, size_t size)
{
    drape_woven tension, bending;
    drape_fabric_tension(f, &tension);
    drape_fabric_bending(f, &bending);
    int used = snprintf(text, size, "%s: %.4g kg/m2", f->what, f->areal_density);
    used += snprintf(text + used, size - (size_t)used,
                     isnan(f->tension.warp) ? "" : "; tension %.4g, %.4g N/m, shear %.3g N/m", tension.warp,
                     tension.weft, tension.shear);
    used += snprintf(text + used, size - (size_t)used, "; bending %.3g, %.3g, twist %.3g uN m",
                     1e6 * bending.warp, 1e6 * bending.weft, 1e6 * bending.shear);
    snprintf(text + used, size - (size_t)used, isnan(f->drape) ? "" : "; drape coefficient %.3g", f->drape);
}

/* All but none, which is no fabric. */
static bool fabric(int index, cli_row *row)
{
    const drape_fabric *f = &drape_fabrics[index + 1];
    if (f->name) {
        *row = (cli_row){.name = f->name, .reference = f->source};
        describe(f, row->text, sizeof row->text);
        row->summary = row->text;
    }
    return f->name;
}

static bool term(int index, cli_row *row)
{
    const drape_term_ops *ops = drape_terms[index];
    if (ops)
        *row = (cli_row){.name = ops->name,
                         .summary = ops->summary,
                         .reference = ops->reference,
                         .params = ops->params,
                         .param_count = ops->param_count,
                         .implied = ops->potential_of_gravity};
    return ops;
}

static bool collider(int index, cli_row *row)
{
    const drape_collider_ops *ops = drape_colliders[index];
    if (ops)
        *row = (cli_row){.name = ops->name,
                         .summary = ops->summary,
                         .reference = ops->reference,
                         .params = ops->params,
                         .param_count = ops->param_count};
    return ops;
}

static bool self_contact(int index, cli_row *row)
{
    if (index == 0)
        *row = (cli_row){.name = "self_contact",
                         .summary = "cloth against cloth; a scene without it lets cloth through itself",
                         .params = drape_self_contact_params,
                         .param_count = DRAPE_SELF_PARAM_COUNT};
    return index == 0;
}

static bool contact(int index, cli_row *row)
{
    if (index == 0)
        *row = (cli_row){.name = "contact",
                         .summary = "how contact with colliders and between layers of cloth acts",
                         .params = drape_contact_params,
                         .param_count = DRAPE_CONTACT_PARAM_COUNT};
    return index == 0;
}

static bool integrator(int index, cli_row *row)
{
    const drape_integrator_ops *ops = drape_integrators[index];
    if (ops)
        *row = (cli_row){.name = ops->name,
                         .summary = ops->summary,
                         .reference = ops->reference,
                         .params = ops->params,
                         .param_count = ops->param_count};
    return ops;
}

static bool controller(int index, cli_row *row)
{
    const drape_controller_ops *ops = drape_controllers[index];
    if (ops)
        *row = (cli_row){.name = ops->name,
                         .summary = ops->summary,
                         .reference = ops->reference,
                         .params = ops->params,
                         .param_count = ops->param_count};
    return ops;
}

static bool linear(int index, cli_row *row)
{
    const drape_linear_ops *ops = drape_linears[index];
    if (ops)
        *row = (cli_row){.name = ops->name, .summary = ops->summary, .reference = ops->reference};
    return ops;
}

static bool field(int index, cli_row *row)
{
    const drape_field_ops *ops = drape_fields[index];
    if (ops)
        *row = (cli_row){.name = ops->name, .summary = ops->summary};
    return ops;
}

static bool exporter(int index, cli_row *row)
{
    const drape_exporter_ops *ops = drape_exporters[index];
    if (ops)
        *row = (cli_row){.name = ops->name, .summary = ops->summary, .reference = ops->reference};
    return ops;
}

const cli_table cli_grids = {"grids", "Grids", "\"grid\" of a mesh, its parameters beside it", grid};
const cli_table cli_imports = {"imports", "Mesh files", "\"file\" of a mesh, by its ending", import};
const cli_table cli_materials = {"materials", "Material", "\"material\" of a cloth", material};
const cli_table cli_fabrics = {"fabrics", "Measured fabrics", "\"fabric\" of a material", fabric};
const cli_table cli_terms = {"terms", "Terms", "\"terms\" of a cloth", term};
const cli_table cli_colliders = {"colliders", "Colliders",
                                 "\"type\" of the colliders, parameters, friction, name and track beside it",
                                 collider};
const cli_table cli_self_contacts = {"self_contacts", "Self-contact", "\"self_contact\" of the scene",
                                     self_contact};
const cli_table cli_contacts = {"contacts", "Contact", "\"contact\" of the scene", contact};
const cli_table cli_integrators = {"integrators", "Integrators", "\"method\" of the integrator", integrator};
const cli_table cli_controllers = {"controllers", "Step controllers", "\"type\" of the controller",
                                   controller};
const cli_table cli_linears = {"linear_solvers", "Linear solvers", "\"linear_solver\" of the integrator",
                               linear};
const cli_table cli_exporters = {"exporters", "Frame formats", "\"formats\" of the output", exporter};

const cli_table cli_fields = {"fields", "Fields",
                              "what is told of a moment at each node; shadings of the same name", field};
const cli_table cli_shadings = {"shadings", "Shadings", "--shade of drape render and drape view",
                                cli_shading_row};

const cli_table *const cli_tables[] = {
    &cli_grids,     &cli_imports,       &cli_materials, &cli_fabrics,     &cli_terms,
    &cli_colliders, &cli_self_contacts, &cli_contacts,  &cli_integrators, &cli_controllers,
    &cli_linears,   &cli_exporters,     &cli_fields,    &cli_shadings,    NULL};
