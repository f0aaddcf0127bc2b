/* fabric_weft: ASTM D1388 on measured fabrics: a strip along the weft, of twice the bending length (B/(rho g))^(1/3), has its
 * chord at 41.5 degrees, 41.487 by the rod: what a preset says is what the test of its source measures. */
#include "lab/fabric.h"

static int scene(double place, double load, char *text, size_t size)
{
    (void)load;
    return fabric_cantilever(place, true, text, size);
}

const drape_reference drape_reference_fabric_weft = {
    .entry.name = "fabric_weft",
    .entry.summary = "angle of the chord of a strip along the weft",
    FABRIC_CANTILEVER,
    .scene = scene,
};
