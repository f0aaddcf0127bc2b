/* reference_fabrics.c: virtual tests of measured fabrics: each uses one entry of their table, and must give
 * back the published values. A case is a fabric number in the table. */
#include "compile/fabrics.h"
#include "compile/fabrics_table.h"
#include "lab/sheet.h"

#include <gsl/gsl_integration.h>
#include <gsl/gsl_roots.h>
#include <math.h>

static const double places[] = {1,  2,  3,  4,  5,  6,  7,  8,  9,  10, 11, 12, 13, 14, 15, 16,
                                17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32};
_Static_assert(DRAPE_FABRIC_COUNT <= sizeof places / sizeof *places, "a place for every fabric");

#define FABRIC .parameter = "fabric number", .parameters = places, .case_count = DRAPE_FABRIC_COUNT

static drape_woven tension_of(double place)
{
    drape_woven tension;
    drape_fabric_tension(&drape_fabrics[(int)place], &tension);
    return tension;
}

/* ---- ASTM D1388: the angle of the chord to the end of a strip pushed over an edge ----
 *
 * A strip of twice the bending length (B/(rho g))^(1/3), that is G = rho g L^3/B = 8, has its chord at 41.5
 * degrees; the rod's own angle is ROD_CHORD. */

/* constants: whether it is along the weft. */
static int cantilever(const drape_reference_run *c, char text[DRAPE_LAB_TEXT])
{
    const drape_fabric *f = &drape_fabrics[(int)c->parameter];
    const bool weft = c->reference->constants[0] > 0;
    const char *warp = weft ? "[0, 0, 1]" : "[1, 0, 0]";
    const double rigidity = weft ? f->bending.weft : f->bending.warp;
    const double weight = f->areal_density * GRAVITY, length = 2 * cbrt(rigidity / weight);
    return SHEET_TEXT(text, .columns = 41, .rows = 5, .width = length, .height = length / 10,
                      .material = SHEET_FORMAT("'fabric': '%s'", f->name),
                      .terms = SHEET_FORMAT("{'type': 'stretch.cst', 'warp_direction': %s}, "
                                            "{'type': 'bend.midedge', 'warp_direction': %s}",
                                            warp, warp),
                      .pins = "{'edge': 'left', 'clamp': true}", .gravity = {0, -GRAVITY, 0},
                      .tolerance = weight * length * length / 10 / 205 * 1e-4);
}

#define CANTILEVER                                                                                           \
    .unit = "degree", FABRIC, .model = "stretch.cst, bend.midedge; irregular",                               \
    .entry.reference = "ASTM D1388; the fabric's own", .tolerance = 0.005, DRAPE_KNOWN(ROD_CHORD),           \
    .scene = cantilever, .value = lab_chord

DRAPE_REFERENCE(fabric, CANTILEVER, .entry.summary = "angle of the chord of a strip along the warp");

DRAPE_REFERENCE(fabric_weft, CANTILEVER, .entry.summary = "angle of the chord of a strip along the weft",
                .constants = {1});

/* ---- The lengthening of a strip of 1 m that hangs from its upper edge, under its weight or a pull ----
 *
 * By stretch.cst a stretch l is S = K (l^2 - 1)/2, so the force per width is K l (l^2 - 1)/2. */

#define WIDTH   0.02 /* [m]: the fixed edge keeps some widths of the strip from narrowing */
#define STRETCH 1.02 /* by the pull */

/* constants: whether it is pulled along the weft, instead of hung along the warp. */
static int hung_scene(const drape_reference_run *c, char text[DRAPE_LAB_TEXT])
{
    const bool pulled = c->reference->constants[0] > 0;
    const char *warp = pulled ? "[1, 0, 0]" : "[0, 1, 0]";
    const double gravity = pulled ? 0 : GRAVITY;
    /* Force per width at the lower edge [N/m]. */
    const double pull = pulled ? tension_of(c->parameter).weft * STRETCH * (STRETCH * STRETCH - 1) / 2 : 0;
    return SHEET_TEXT(text, .columns = 3, .rows = 101, .width = WIDTH, .height = 1,
                      .mesh = "'orientation': 'vertical'",
                      .material = SHEET_FORMAT("'fabric': '%s'", drape_fabrics[(int)c->parameter].name),
                      .terms = SHEET_FORMAT("{'type': 'stretch.cst', 'warp_direction': %s}, "
                                            "{'type': 'bend.midedge', 'warp_direction': %s}, "
                                            "{'type': 'load.line', 'edge': 'bottom', 'force': [0, %.17g, 0]}",
                                            warp, warp, -pull),
                      .pins = "{'edge': 'top'}", .gravity = {0, -gravity, 0}, .tolerance = 1e-9);
}

/* The mean over the lower edge [m]. */
static double lengthening(const drape_reference_run *run)
{
    const double *rest = drape_model_rest_positions(run->model), *x = drape_sim_positions(run->sim);
    int count = 0;
    double sum = 0;
    for (size_t i = 0; i < (size_t)drape_model_node_count(run->model); i++)
        if (rest[3 * i + 1] < -1 + 1e-9) {
            sum += rest[3 * i + 1] - x[3 * i + 1];
            count++;
        }
    return sum / count;
}

#define HUNG                                                                                                 \
    .unit = "m", FABRIC, .model = "stretch.cst, bend.midedge; irregular", .tolerance = 0.01,                 \
    .value = lengthening, .scene = hung_scene

DRAPE_REFERENCE(fabric_tension, HUNG, .entry.summary = "lengthening of a strip of 1 m, pulled along the weft",
                .entry.reference = "K l (l^2 - 1)/2; the fabric's own", DRAPE_KNOWN(STRETCH - 1),
                .constants = {1});

/* The root of f between low and high, where its signs differ. */
static double root_between(double (*f)(double x, void *context), void *context, double low, double high)
{
    gsl_function function = {f, context};
    gsl_root_fsolver *solver = gsl_root_fsolver_alloc(gsl_root_fsolver_brent);
    if (!solver || gsl_root_fsolver_set(solver, &function, low, high)) {
        gsl_root_fsolver_free(solver);
        return NAN;
    }
    for (int k = 0; k < 200 && high - low > 1e-14 * fabs(high); k++) {
        gsl_root_fsolver_iterate(solver);
        low = gsl_root_fsolver_x_lower(solver);
        high = gsl_root_fsolver_x_upper(solver);
    }
    const double root = gsl_root_fsolver_root(solver);
    gsl_root_fsolver_free(solver);
    return root;
}

typedef struct hung_strip {
    double stiffness, weight; /* [N/m], [N/m2] */
    double force;             /* [N/m] */
} hung_strip;

static double excess(double stretch, void *user)
{
    const hung_strip *s = user;
    return s->stiffness * stretch * (stretch * stretch - 1) / 2 - s->force;
}

/* The stretch less 1 at s from the free end. */
static double strain(double s, void *user)
{
    hung_strip hung = *(const hung_strip *)user;
    hung.force = hung.weight * s;
    return root_between(excess, &hung, 1, 3) - 1;
}

/* K l (l^2 - 1)/2 = rho g s. Near the fixed edge the strip does not narrow, and is stiffer by 1/(1 - nu^2),
 * 1.8 times at most, over some half width, a hundredth of its length. */
static double hanging(double place)
{
    hung_strip hung = {tension_of(place).warp, drape_fabrics[(int)place].areal_density * GRAVITY, 0};
    gsl_function f = {strain, &hung};
    double value = NAN, error;
    size_t count;
    gsl_integration_qng(&f, 0, 1, 0, 1e-9, &value, &error, &count);
    return value;
}

DRAPE_REFERENCE(hanging, HUNG, .entry.summary = "lengthening of a strip of 1 m, hung along the warp",
                .entry.reference = "K l (l^2 - 1)/2 = rho g s; the fabric's own", .expected = hanging);

/* ---- The shear stiffness of a square whose lower edge is moved parallel to the upper one by gamma ----
 *
 * The energy is A (shear gamma^2/2 + C22 gamma^4/8), with the tension stiffness C22 of the direction across,
 * so 2 E/(A gamma^2) is the shear stiffness plus an error of C22 gamma^2/4: at most a quarter of 1e4 N/m
 * times 1e-6, which is 7e-5 of the softest shear stiffness beside it. */

#define GAMMA 1e-3

static double shear(double place)
{
    return tension_of(place).shear;
}

static int shear_scene(const drape_reference_run *c, char text[DRAPE_LAB_TEXT])
{
    return SHEET_TEXT(text, .grid = "square", .columns = 2, .rows = 2, .width = 1, .height = 1,
                      .material = SHEET_FORMAT("'fabric': '%s'", drape_fabrics[(int)c->parameter].name),
                      .terms = "'stretch.cst'",
                      .pins = SHEET_FORMAT("{'edge': 'top'}, {'edge': 'bottom', "
                                           "'track': [[0, [0, 0, 0]], [1, [%g, 0, 0]]]}",
                                           GAMMA),
                      .integrator = "'method': 'be'", .dt = 0.5);
}

static double stiffness_of(const drape_reference_run *run)
{
    return 2 * drape_sim_energy(run->sim).elastic / (GAMMA * GAMMA);
}

DRAPE_REFERENCE(fabric_shear, .entry.summary = "shear stiffness of a square", .unit = "N/m", FABRIC,
                .model = "stretch.cst; square", .entry.reference = "A shear gamma^2/2; the fabric's own",
                .tolerance = 0.001, .expected = shear, .scene = shear_scene, .value = stiffness_of);
