/* fabric.c: see fabric.h. */
#include "lab/fabric.h"

#include "lab/rod.h"
#include "lab/strip.h"

#include <math.h>
#include <stdio.h>

#define DEGREES (180 / 3.14159265358979323846)
#define WIDTH   0.02 /* [m] of a hung strip: what its held edge keeps from narrowing is some widths long */

const double fabric_places[] = {1,  2,  3,  4,  5,  6,  7,  8,  9,  10, 11, 12, 13, 14, 15, 16,
                                17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32};
_Static_assert(DRAPE_FABRIC_COUNT <= sizeof fabric_places / sizeof *fabric_places,
               "a place for every fabric");

const drape_fabric *fabric_at(double place)
{
    return &drape_fabrics[(int)place];
}

/* ---- Cantilever ---- */

int fabric_cantilever(double place, bool weft, char *text, size_t size)
{
    const drape_fabric *f = fabric_at(place);
    const double weight = f->areal_density * FABRIC_GRAVITY,
                 rigidity = weft ? f->bending.weft : f->bending.warp;
    const double length = 2 * cbrt(rigidity / weight);
    return snprintf(
        text, size,
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'irregular', 'columns': 41, 'rows': 5, 'width': %.17g, "
        "'height': %.17g},\n 'material': {'fabric': '%s'},\n 'terms': [{'type': 'stretch.cst', "
        "'warp_direction': %s}, {'type': 'bend.midedge', 'warp_direction': %s}],\n 'pins': [{'edge': "
        "'left', 'clamp': true}]}],\n 'gravity': [0, %g, 0], 'integrator': {'method': 'static', "
        "'tolerance': %.3g}, 'duration': 1}",
        length, length / 10, f->name, weft ? "[0, 0, 1]" : "[1, 0, 0]", weft ? "[0, 0, 1]" : "[1, 0, 0]",
        -FABRIC_GRAVITY, weight * length * length / 10 / 205 * 1e-4);
}

double fabric_chord(double unused)
{
    (void)unused;
    double drop, reach;
    drape_rod_tip(8, 0, &drop, &reach);
    return atan2(drop, reach) * DEGREES;
}

drape_status fabric_measure_chord(drape_reference_run *run, double *value)
{
    double tip[3];
    drape_status status = lab_advance(run);
    lab_tip(run, tip);
    *value = atan2(-tip[1], tip[0]) * DEGREES;
    return status;
}

/* ---- Tension ---- */

int fabric_hung(double place, bool weft, double gravity, double pull, char *text, size_t size)
{
    return snprintf(
        text, size,
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'irregular', 'columns': 3, 'rows': 101, 'width': %g, "
        "'height': 1, 'orientation': 'vertical'},\n 'material': {'fabric': '%s'},\n 'terms': [{'type': "
        "'stretch.cst', 'warp_direction': %s}, {'type': 'bend.midedge', 'warp_direction': %s}, {'type': "
        "'load.line', 'edge': 'bottom', 'force': [0, %.17g, 0]}],\n 'pins': [{'edge': 'top'}]}],\n "
        "'gravity': [0, %g, 0], 'integrator': {'method': 'static', 'tolerance': 1e-9}, 'duration': 1}",
        WIDTH, fabric_at(place)->name, weft ? "[1, 0, 0]" : "[0, 1, 0]", weft ? "[1, 0, 0]" : "[0, 1, 0]",
        -pull, -gravity);
}

/* Of the lowest nodes, which are those of the lower edge. */
drape_status fabric_measure_lengthening(drape_reference_run *run, double *value)
{
    drape_status status = lab_advance(run);
    const double *rest = drape_model_rest_positions(run->model), *x = drape_sim_positions(run->sim);
    int count = 0;
    *value = 0;
    for (int32_t i = 0; i < drape_model_node_count(run->model); i++)
        if (rest[3 * (size_t)i + 1] < -1 + 1e-9) {
            *value += rest[3 * (size_t)i + 1] - x[3 * (size_t)i + 1];
            count++;
        }
    *value /= count;
    return status;
}

typedef struct balance {
    double stiffness, force;
} balance;

static double excess(double stretch, void *user)
{
    const balance *b = user;
    return b->stiffness * stretch * (stretch * stretch - 1) / 2 - b->force;
}

double fabric_strain(double stiffness, double force)
{
    balance b = {stiffness, force};
    return drape_root(excess, &b, 1, 3) - 1;
}
