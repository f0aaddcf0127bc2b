/* lateral_buckling_hinges: lateral buckling of a strip of hinges. On the equilateral lattice they are a plate with a bending
 * Poisson ratio of -1/3, whatever the material's is: E I = (8/9) D w, G J = (8/3) D w, and q L^3 = 12.8538 sqrt(E I G J)
 * is 19.79 D w; a plate of the membrane's own 1/3 has E I = (8/9) D w and G J = (4/3) D w. */
#include "lab/rod.h"
#include "lab/strip.h"

#include <math.h>
#include <stdio.h>

#define EDGES     8   /* across the strip */
#define STRIPS    240 /* along it */
#define WIDTH     0.035
#define THICKNESS 1e-3
#define POISSON   (1.0 / 3)
#define GRAVITY   9.81

static const double nothing[] = {0};

static double edge_length(void)
{
    return WIDTH / EDGES;
}

/* Pins of the first two rows clamp at their middle. */
static double length(void)
{
    return (STRIPS - 0.5) * sqrt(3) / 2 * edge_length();
}

static double in_theory(double bend, double twist)
{
    return 2 * sqrt(drape_rod_threshold(4, 20, 60)) * sqrt(bend * twist);
}

static double expected(double unused)
{
    (void)unused;
    return in_theory(8.0 / 9, 4.0 / 3);
}

static double documented(double unused)
{
    (void)unused;
    return in_theory(8.0 / 9, 8.0 / 3);
}

/* The strip runs along -z, its width stands upright. weight: rho g L^3/D. */
static int scene(double unused, double weight, char *text, size_t size)
{
    (void)unused;
    const double rigidity = STRIP_RIGIDITY,
                 modulus = 12 * (1 - POISSON * POISSON) * rigidity / (THICKNESS * THICKNESS * THICKNESS);
    return snprintf(text, size,
                    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'equilateral', 'edges': %d, 'strips': %d, "
                    "'edge_length': %.17g,\n "
                    "'transform': {'rotate': [0, 0, 1, 90]}},\n 'material': {'young_modulus': %.17g, "
                    "'poisson_ratio': %.17g, "
                    "'thickness': %g, 'areal_density': %.17g},\n 'terms': ['stretch.edge', 'bend.hinge'], "
                    "'pins': [{'row': 0}, {'row': "
                    "1}]}],\n 'gravity': [0, %g, 0], 'integrator': {'method': 'static', 'tolerance': 1e-9}, "
                    "'duration': 1}",
                    EDGES, STRIPS, edge_length(), modulus, POISSON, THICKNESS,
                    weight * rigidity / (GRAVITY * pow(length(), 3)), -GRAVITY);
}

const drape_reference drape_reference_lateral_buckling_hinges = {
    .entry.name = "lateral_buckling_hinges",
    .entry.summary = "rho g L^3/D at which a strip on edge turns aside",
    .unit = "1",
    .model = "stretch.edge, bend.hinge; equilateral",
    .entry.reference = "q L^3 = 12.8538 sqrt(E I G J); the hinges' limit: docs/validate.md",
    .tolerance = 0.05,
    .parameters = nothing,
    .case_count = 1,
    .expected = expected,
    .documented = documented,
    .scene = scene,
    .measure = lab_unstable_modes,
    .low = 0.85,
    .high = 1.15,
};
