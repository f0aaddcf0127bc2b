/*
 * slider.h: a spring in series with dry friction, the Jenkin element of models of hysteresis. Its force is
 * that of the potential of an elastoplastic step (Simo & Hughes 1998, Computational Inelasticity, 1.4): with
 * d the strain of the spring if nothing slid, k d^2/2 up to |k d| = limit, and its tangent beyond. What the
 * tangent holds besides the energy of the spring, limit^2/(2 k), is dissipated when the step is accepted.
 */
#ifndef DRAPE_MODEL_SLIDER_H
#define DRAPE_MODEL_SLIDER_H

#include <math.h>

/* Its energy, including what sliding costs, and the derivatives of that. */
typedef struct drape_slider_value {
    double energy, force, slope;
} drape_slider_value;

static inline drape_slider_value drape_slider_at(double k, double limit, double d)
{
    const double force = k * d;
    if (!(fabs(force) > limit))
        return (drape_slider_value){0.5 * force * d, force, k};
    return (drape_slider_value){limit * (fabs(d) - 0.5 * limit / k), copysign(limit, d), 0};
}

/* How far it slides: the spring then has the force limit. */
static inline double drape_slider_slip(double k, double limit, double d)
{
    return fabs(k * d) > limit ? d - copysign(limit / k, d) : 0;
}

#endif
