/* tables.c: see tables.h. */
#include "cli/tables.h"

#include "base/reason.h"
#include "colliders/colliders.h"
#include "compile/compile.h"
#include "compile/fabrics.h"
#include "control/control.h"
#include "events/events.h"
#include "fields/fields.h"
#include "io/export.h"
#include "mesh/sequence.h"
#include "render/shading.h"
#include "solvers/linear.h"
#include "terms/terms.h"

#include <math.h>
#include <stdio.h>

#define MAX_FABRICS 64

/* The published values of a fabric, as drape_fabric has them, and derived ones in place of those not
 * published. */
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

/* The summaries of fabrics are made from numbers, so cli_tables fills in the entries. */
static const drape_entry *fabrics[MAX_FABRICS + 1];
static const drape_registry fabric_registry = {
    "fabric", "fabrics", "Measured fabrics", "\"fabric\" of a material", fabrics, NULL};

static const drape_registry *const tables[] = {&drape_grid_registry,
                                               &drape_import_registry,
                                               &drape_material_registry,
                                               &fabric_registry,
                                               &drape_term_registry,
                                               &drape_collider_registry,
                                               &drape_sequence_registry,
                                               &drape_event_registry,
                                               &drape_seam_registry,
                                               &drape_self_contact_registry,
                                               &drape_contact_registry,
                                               &drape_untangle_registry,
                                               &drape_integrator_registry,
                                               &drape_controller_registry,
                                               &drape_linear_registry,
                                               &drape_exporter_registry,
                                               &drape_reason_registry,
                                               &drape_field_registry,
                                               &drape_shading_registry,
                                               NULL};

const drape_registry *const *cli_tables(void)
{
    static char summaries[MAX_FABRICS][256];
    static drape_entry entries[MAX_FABRICS];
    for (int i = 0; i < MAX_FABRICS && drape_fabrics[i + 1].name; i++) { /* the first fabric is "none" */
        const drape_fabric *f = &drape_fabrics[i + 1];
        describe(f, summaries[i], sizeof summaries[i]);
        entries[i] = (drape_entry){.name = f->name, .summary = summaries[i], .reference = f->source};
        fabrics[i] = &entries[i];
    }
    return tables;
}
