/* root.c: see root.h. The names k1, k2, n0 and the steps are those of the paper. */
#include "sim/root.h"

#include <math.h>

#define K1 0.2 /* divided by the length of the first interval; with k2 = 2 */
#define N0 1   /* evaluations beyond those of bisection */

/* The point of the interval at which f is evaluated next: the intersection of the chord with 0, moved
 * towards the midpoint (truncation), and no further from it than `room` (projection). */
static double next_point(double a, double fa, double b, double fb, double k1, double room)
{
    const double middle = a + (b - a) / 2, chord = (fb * a - fa * b) / (fb - fa),
                 sign = middle >= chord ? 1 : -1, shift = k1 * (b - a) * (b - a),
                 near = shift <= fabs(middle - chord) ? chord + sign * shift : middle;
    return fabs(near - middle) <= room ? near : middle - sign * room;
}

drape_status drape_root_find(drape_root_function *f, void *user, double a, double fa, double b, double fb,
                             double tolerance, double *root)
{
    const double half = tolerance / 2, k1 = K1 / (b - a);
    int bisections = 0; /* that would be enough */
    for (double length = b - a; length > tolerance; length /= 2)
        bisections++;
    for (int j = 0; fb != 0 && b - a > tolerance; j++) {
        const double room = ldexp(half, bisections + N0 - j) - (b - a) / 2,
                     point = next_point(a, fa, b, fb, k1, fmax(room, 0)),
                     t = point > a && point < b ? point : a + (b - a) / 2;
        double ft;
        if (!(t > a && t < b)) /* neighbouring numbers */
            break;
        const drape_status status = f(user, t, &ft);
        if (status)
            return status;
        if (ft == 0 || (ft > 0) == (fb > 0)) {
            b = t;
            fb = ft;
        } else {
            a = t;
            fa = ft;
        }
    }
    *root = b;
    return DRAPE_OK;
}
