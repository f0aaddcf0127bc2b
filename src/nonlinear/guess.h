/*
 * guess.h: makes the guess of a step feasible: nothing passes through anything on the path to it, and it
 * violates no limit.
 */
#ifndef DRAPE_NONLINEAR_GUESS_H
#define DRAPE_NONLINEAR_GUESS_H

#include "nonlinear/step_equation.h"

/* Changes the guess d (free DOFs). aside (free DOFs), fraction (nodes, if there is contact): scratch. */
void drape_guess_make_feasible(drape_step_equation *equation, double *d, double *aside, double *fraction);

#endif
