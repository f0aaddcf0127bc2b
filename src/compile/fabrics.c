/*
 * fabrics.c: measured fabrics. Feng, Huang, Xu & Wang 2022, Learning-based bending stiffness parameter estimation by a drape
 * tester (ACM TOG 41, 6), measured the areal density and, by cantilever tests, the bending rigidity of strips of 618 fabrics
 * along warp, weft and the diagonal; here are some lines of their data set, by number: the linear coefficient in SI. Their
 * tensile stiffness was not measured: it is the scene's young_modulus and thickness.
 *
 * A strip at 45 degrees of an orthotropic plate has 4/B45 = 1/B1 + 1/B2 - 2 nu/sqrt(B1 B2) + 1/twist; nu = 0, as it was not
 * measured either.
 */
#include "compile/fabrics.h"

#include <stddef.h>

const drape_fabric drape_fabrics[] = {
    {"none", 0, 0, 0, 0},
    {"feng2022_1", 0.0673, 1779.9e-9, 3076.2e-9, 2244.1e-9},
    {"feng2022_3", 0.1834, 61211.1e-9, 24116.1e-9, 23803.5e-9},
    {"feng2022_6", 0.1972, 9183.1e-9, 7598.0e-9, 3752.0e-9},
    {"feng2022_9", 0.0224, 866.3e-9, 1141.2e-9, 1529.6e-9},
    {"feng2022_18", 0.4773, 32775.9e-9, 22098.3e-9, 15268.1e-9},
    {"feng2022_23", 0.4871, 115747.3e-9, 49453.8e-9, 83508.1e-9},
};

/* In the order of the table. */
const char *const drape_fabric_names[] = {"none",       "feng2022_1",  "feng2022_3",  "feng2022_6",
                                          "feng2022_9", "feng2022_18", "feng2022_23", NULL};

double drape_fabric_twist(const drape_fabric *fabric)
{
    return 1 / (4 / fabric->diagonal - 1 / fabric->warp - 1 / fabric->weft);
}
