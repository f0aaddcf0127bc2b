/*
 * grid_revolution.c: part of a surface of revolution about the y axis, between two circles: a sector of a
 * ring, a cylinder, a cone, or of a sphere or a torus. Row 0 is the top circle at y = 0, the last row the
 * bottom circle at y = -height; columns are meridians, c angle/(columns - 1) from x towards -z, the first and
 * the last one not joined, at 360 degrees neither: a slit. Between the circles, a meridian is straight, or an
 * arc of arc_radius that bulges away from the axis; nodes divide it evenly. A sphere has arc_radius R,
 * top_radius R sin t, bottom_radius R sin b and height R (cos t - cos b), t and b the angles from the axis.
 *
 * Triangles are counterclockwise as seen from outside or, if the bottom circle is the larger one, from above.
 */
#include <math.h>

#include "base/elementary.h"
#include "base/pi.h"
#include "mesh/grid.h"

enum { COLUMNS, ROWS, TOP, BOTTOM, HEIGHT, ARC, ANGLE, DIAGONALS, PARAM_COUNT };
enum { ALTERNATING, PARALLEL };

static const char *const diagonals[] = {[ALTERNATING] = "alternating", [PARALLEL] = "parallel", NULL};

static const drape_param params[PARAM_COUNT] = {
    [COLUMNS] = GRID_NODES("columns", 2, 2, GRID_COLUMNS_HELP),
    [ROWS] = GRID_NODES("rows", 2, 2, GRID_ROWS_HELP),
    [TOP] = GRID_LENGTH("top_radius", "radius of the top circle, at y = 0"),
    [BOTTOM] = GRID_LENGTH("bottom_radius", "radius of the bottom circle"),
    [HEIGHT] = DRAPE_NUMBER("height", "m", 0, 0, 1e9, "of the top circle above the bottom one; 0: a ring"),
    [ARC] = DRAPE_NUMBER("arc_radius", "m", 0, 0, 1e9,
                         "radius of the arc between the circles, at least half their distance; 0: straight"),
    [ANGLE] = DRAPE_NUMBER("angle", "degrees", 360, DRAPE_ABOVE(0), 360,
                           "about the axis; first and last column are not joined, at 360 neither"),
    [DIAGONALS] = DRAPE_CHOICE("diagonals", ALTERNATING, diagonals, "how the cells are split into triangles"),
};

static drape_status generate(drape_context *ctx, const char *pointer, const double *values, drape_mesh *mesh)
{
    static const bool falling[][2][2] = {
        [ALTERNATING] = {{true, false}, {false, true}}, [PARALLEL] = {{true, true}, {true, true}}};
    const int32_t columns = (int32_t)values[COLUMNS], rows = (int32_t)values[ROWS];
    const double radian = DRAPE_PI / 180, run = values[BOTTOM] - values[TOP], drop = values[HEIGHT],
                 chord = drape_hypot(run, drop), arc = values[ARC],
                 middle[2] = {(values[TOP] + values[BOTTOM]) / 2, -drop / 2};
    DRAPE_TRY(drape_grid_check_size(ctx, pointer, columns, rows));
    if (!(chord > 0))
        return drape_fail_below(ctx, pointer, "height", "0 m, and both circles have the radius %g m",
                                values[TOP]);
    if (arc != 0 && !(arc >= chord / 2 * (1 - 1e-12)))
        return drape_fail_below(ctx, pointer, "arc_radius",
                                "%g m; it is at least half the distance of the circles, %g m", arc,
                                chord / 2);
    DRAPE_TRY(drape_grid_allocate(ctx, pointer, rows, columns, mesh));
    /* The points of a meridian are middle + sine of an angle times along + (cosine - least) times out, as
     * radius and y, at angles from -half to half; a straight one has half = 0. */
    double along[2] = {run, -drop}, out[2] = {0}, half = 0, least = 0;
    if (arc > 0 && chord > 0) {
        const double depth = sqrt(fmax(0, arc * arc - chord * chord / 4));
        half = drape_atan2(chord / 2, depth);
        least = depth / arc;
        out[0] = drop / chord * arc, out[1] = run / chord * arc;
        along[0] *= arc / chord, along[1] *= arc / chord;
    }
    double *x = mesh->x;
    for (int32_t r = 0; r < mesh->rows; r++) {
        const double at = (double)r / (mesh->rows - 1) - 0.5;
        double sine = at, cosine = 0;
        if (half > 0)
            drape_sin_cos(2 * half * at, &sine, &cosine);
        const double radius = middle[0] + sine * along[0] + (cosine - least) * out[0];
        const double y = middle[1] + sine * along[1] + (cosine - least) * out[1];
        for (int32_t c = 0; c < mesh->columns; c++, x += 3) {
            drape_sin_cos(radian * values[ANGLE] * c / (mesh->columns - 1), &sine, &cosine);
            x[0] = radius * cosine;
            x[1] = y;
            x[2] = -radius * sine;
        }
    }
    drape_grid_triangulate(mesh, falling[(int)values[DIAGONALS]], true);
    return DRAPE_OK;
}

const drape_grid_ops drape_grid_revolution = {
    .entry = {.name = "revolution",
              .summary = "part of a surface of revolution between two circles: of a ring, cylinder, cone, "
                         "sphere or torus",
              DRAPE_PARAMS(params)},
    .generate = generate,
};
