/*
 * rotation.h: rotations of space as 3 x 3 matrices, row by row, as unit quaternions (w x y z), and as
 * rotation vectors: along the axis, as long as the angle [rad]. Formulas: J. Sola, J. Deray, D. Atchuthan, "A
 * micro Lie theory for state estimation in robotics", 2018, arXiv 1812.01537, section 4.3 and appendix B.
 */
#ifndef DRAPE_BASE_ROTATION_H
#define DRAPE_BASE_ROTATION_H

#include <stdbool.h>

#define DRAPE_NO_ROTATION                                                                                    \
    {                                                                                                        \
        1, 0, 0, 0, 1, 0, 0, 0, 1                                                                            \
    }

bool drape_rotation_is_none(const double R[9]);

/* y = R x and y = R' x; y may be x. */
void drape_rotation_turn(const double R[9], const double x[3], double y[3]);
void drape_rotation_turn_back(const double R[9], const double x[3], double y[3]);

/* out = A B and out = A B'; out may be neither. */
void drape_rotation_product(const double A[9], const double B[9], double out[9]);
void drape_rotation_between(const double A[9], const double B[9], double out[9]);

/* The rotation of a rotation vector, and the shortest vector of a rotation. */
void drape_rotation_exp(const double v[3], double R[9]);
void drape_rotation_log(const double R[9], double v[3]);

/* q need not have length 1, but must not be 0. The quaternion of a rotation has w >= 0. */
void drape_rotation_of_quaternion(const double q[4], double R[9]);
void drape_rotation_quaternion(const double R[9], double q[4]);

/* The angular velocity in space, if a rotation vector v changes at the rate dv (eq. 145), and the rate that
 * gives an angular velocity (eq. 146), for |v| < 2 pi. */
void drape_rotation_velocity(const double v[3], const double dv[3], double w[3]);
void drape_rotation_rate(const double v[3], const double w[3], double dv[3]);

/* M = the matrix of the cross product: M x = w x x. */
void drape_rotation_cross(const double w[3], double M[9]);

#endif
