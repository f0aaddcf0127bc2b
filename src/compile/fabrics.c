/*
 * fabrics.c: measured fabrics. To add one, add a line to fabrics_table.h.
 *
 * Wang, O'Brien & Ramamoorthi 2011, Data-driven elastic models for cloth (ACM TOG 30, 4): areal density,
 * tension, shear and bending of ten fabrics, measured on the same specimens. The values are from their data
 * base, which is distributed with ARCSim, and are interpreted as in ARCSim, by the same group: stress C (F'F
 * - I), so that K = 2 c of Green's strain and c33 of the shear angle, at rest (the first line of a file),
 * with another c of strips stretched by 1/6 along u (the second line) and v (the last), linear in the stretch
 * between, and k |e|^2/(8 (A1 + A2)) theta^2 for a hinge, that is, a rigidity k/4 in the direction in which
 * the hinge bends. Warp is the direction v, in which the jeans have no elastic yarns. Negative
 * couplings are set to 0, as in ARCSim. Both stiff wovens have c = 2 000 to within one per cent, which may be
 * a bound of their fit.
 *
 * Feng, Huang, Xu & Wang 2022, Learning-based bending stiffness parameter estimation by a drape tester (ACM
 * TOG 41, 6): areal density and, by cantilever tests, rigidities of strips of 618 fabrics along warp, weft
 * and the diagonal. The values are the linear coefficients of lines of their data set, by number. Tension and
 * shear were not measured.
 *
 * Matsudaira, Masuda, Wada & Yokura 2015, Shape factor of flared skirts compared with that of circular
 * fabrics (J. Textile Eng. 61, 69): areal density, bending (KES-FB2: B and 2HB, one value each for both
 * directions) and drape coefficient. Their tables are quoted from another paper, without G and 2HG.
 *
 * Values that were not published are derived. Tension: wovens are taken to stretch by 5 % under the load of a
 * KES test, 500 gf/cm (490 N/m). Shear: the median of the ten fabrics of Wang et al. Twist: that of an
 * isotropic sheet. Loss: that of the median of the four fabrics whose 2HB was published, all of them wovens,
 * for knits too, and for tension and shear as for bending.
 */
#include "compile/fabrics.h"

#include "base/elementary.h"
#include "base/pi.h"
#include "compile/fabrics_table.h"

#include <math.h>
#include <stddef.h>

#define TENSION 1e4  /* [N/m] */
#define SHEAR   34.4 /* [N/m] */
#define LOSS    0.1  /* loss factor [1] */

#define SWEEP   250.0   /* [1/m] curvature, of either sign, to which KES-FB2 bends (Kawabata 1980) */
#define GRAVITY 9.80665 /* [m/s2] */

#define CANTILEVER 3.5160152685 /* square of the first root of cosh x cos x = -1 */

/* clang-format off */
#define ENTRY(name, what, source, density, warp, weft, coupling, shear, far_warp, far_weft, bend_warp,       \
              bend_weft, diagonal, friction, drape) \
    {name, what, source, density, {warp, weft, coupling, shear}, {far_warp, far_weft},                       \
     {bend_warp, bend_weft, diagonal, friction}, drape},
const drape_fabric drape_fabrics[] = {
    DRAPE_FABRICS(ENTRY) {NULL, NULL, NULL, 0, {0, 0, 0, 0}, {0, 0}, {0, 0, 0, 0}, 0}};
#undef ENTRY

#define ENTRY(name, ...) name,
const char *const drape_fabric_names[] = {DRAPE_FABRICS(ENTRY) NULL};
#undef ENTRY

/* clang-format on */

static double or_else(double published, double derived)
{
    return isnan(published) ? derived : published;
}

/* Computes stiffnesses of strips with free sides: C11 (1 - nu^2) with nu^2 = C12^2/(C11 C22). */
void drape_fabric_tension(const drape_fabric *fabric, drape_woven *tension)
{
    const double warp = or_else(fabric->tension.warp, TENSION), weft = or_else(fabric->tension.weft, TENSION);
    const double nu = or_else(fabric->tension.coupling, 0) / sqrt(warp * weft), free = 1 - nu * nu;
    *tension = (drape_woven){warp * free, weft * free, or_else(fabric->tension.shear, SHEAR), nu};
}

/* A strip of an orthotropic plate at 45 degrees has 4/B45 = 1/B1 + 1/B2 - 2 nu/sqrt(B1 B2) + 1/twist; nu was
 * not measured and is taken as 0. */
void drape_fabric_bending(const drape_fabric *fabric, drape_woven *bending)
{
    const double warp = fabric->bending.warp, weft = fabric->bending.weft;
    const double twist = isnan(fabric->bending.diagonal)
                             ? sqrt(warp * weft) / 2
                             : 1 / (4 / fabric->bending.diagonal - 1 / warp - 1 / weft);
    *bending = (drape_woven){warp, weft, twist, 0};
}

/* The loop of a KES test has the height 2 HB over curvatures from -K to K, so 4 HB K are lost in a cycle, of
 * (B K + HB) K/2 at its ends; over 2 pi, that is the loss factor. */
double drape_fabric_loss(const drape_fabric *fabric)
{
    const double friction = fabric->bending.friction;
    return isnan(friction) ? LOSS : 4 / DRAPE_PI * friction / (fabric->bending.warp * SWEEP + friction);
}

/* c = (B/(rho g))^(1/3) is the length at which a sheet is as stiff by its weight as by its bending. A strip
 * of this length that is clamped at one end has the first frequency 3.516 sqrt(B/rho)/c^2 = 3.516 sqrt(g/c).
 */
double drape_fabric_frequency(const drape_fabric *fabric)
{
    const double b = sqrt(fabric->bending.warp * fabric->bending.weft);
    return CANTILEVER * sqrt(GRAVITY / drape_pow(b / (fabric->areal_density * GRAVITY), 1.0 / 3));
}

/* A strip with the stretch l = 1 + e has the force l S, S = C(e) (l^2 - 1)/2, per width at rest, with the
 * coupling at rest. */
static void sample(double at_rest, double stretched, double free_sides, double *point)
{
    for (int i = 0; i < DRAPE_FABRIC_POINTS; i++) {
        const double share = (i + 1.0) / DRAPE_FABRIC_POINTS, e = share / 6, l = 1 + e;
        point[2 * i] = e;
        point[2 * i + 1] = free_sides * (at_rest + share * (stretched - at_rest)) * l * (l * l - 1) / 2;
    }
}

bool drape_fabric_curves(const drape_fabric *fabric, double warp[2 * DRAPE_FABRIC_POINTS],
                         double weft[2 * DRAPE_FABRIC_POINTS])
{
    drape_woven tension;
    if (isnan(fabric->stretched.warp))
        return false;
    drape_fabric_tension(fabric, &tension);
    const double free_sides = 1 - tension.poisson * tension.poisson;
    sample(fabric->tension.warp, fabric->stretched.warp, free_sides, warp);
    sample(fabric->tension.weft, fabric->stretched.weft, free_sides, weft);
    return true;
}
