/* rotation.c: see rotation.h. */
#include "base/rotation.h"

#include "base/elementary.h"
#include "base/pi.h"
#include "base/vec3.h"

#define SMALL                                                                                                \
    1e-2 /* [rad] below, series are more exact than the formulas: their next terms are below 1e-10 */

bool drape_rotation_is_none(const double R[9])
{
    bool none = true;
    for (int i = 0; i < 9; i++)
        none = none && R[i] == (i % 4 == 0);
    return none;
}

void drape_rotation_turn(const double R[9], const double x[3], double y[3])
{
    const double from[3] = {x[0], x[1], x[2]};
    for (int k = 0; k < 3; k++)
        y[k] = vec3_dot(R + 3 * k, from);
}

void drape_rotation_turn_back(const double R[9], const double x[3], double y[3])
{
    const double from[3] = {x[0], x[1], x[2]};
    for (int k = 0; k < 3; k++)
        y[k] = R[k] * from[0] + R[k + 3] * from[1] + R[k + 6] * from[2];
}

void drape_rotation_product(const double A[9], const double B[9], double out[9])
{
    for (int i = 0; i < 9; i++)
        out[i] = A[i - i % 3] * B[i % 3] + A[i - i % 3 + 1] * B[i % 3 + 3] + A[i - i % 3 + 2] * B[i % 3 + 6];
}

void drape_rotation_between(const double A[9], const double B[9], double out[9])
{
    for (int i = 0; i < 9; i++)
        out[i] = vec3_dot(A + i - i % 3, B + 3 * (i % 3));
}

void drape_rotation_cross(const double w[3], double M[9])
{
    const double cross[9] = {0, -w[2], w[1], w[2], 0, -w[0], -w[1], w[0], 0};
    for (int i = 0; i < 9; i++)
        M[i] = cross[i];
}

/* sin a / a and (1 - cos a) / a^2 */
static void shares_of(double a, double *sine, double *versine)
{
    double s, c, half = fmod(a, 2 * DRAPE_PI) / 2;
    *sine = 1 - a * a / 6 * (1 - a * a / 20);
    *versine = 0.5 - a * a / 24 * (1 - a * a / 30);
    if (a < SMALL)
        return;
    drape_sin_cos(half, &s, &c);
    *sine = 2 * s * c / a;
    *versine = 2 * s * s / (a * a);
}

/* x + p v x x + q v x (v x x) */
static void combine(const double v[3], const double x[3], double p, double q, double out[3])
{
    double once[3], twice[3];
    vec3_cross(v, x, once);
    vec3_cross(v, once, twice);
    for (int k = 0; k < 3; k++)
        out[k] = x[k] + p * once[k] + q * twice[k];
}

/* Rodrigues: the columns of R = I + sin a/a [v]x + (1 - cos a)/a^2 [v]x^2. */
void drape_rotation_exp(const double v[3], double R[9])
{
    double sine, versine;
    shares_of(vec3_norm(v), &sine, &versine);
    for (int j = 0; j < 3; j++) {
        const double unit[3] = {j == 0, j == 1, j == 2};
        double column[3];
        combine(v, unit, sine, versine, column);
        for (int i = 0; i < 3; i++)
            R[3 * i + j] = column[i];
    }
}

/* The row of 4 q q' with the largest diagonal entry: its square root does not cancel. */
void drape_rotation_quaternion(const double R[9], double q[4])
{
    const double square[4] = {1 + R[0] + R[4] + R[8], 1 + R[0] - R[4] - R[8], 1 - R[0] + R[4] - R[8],
                              1 - R[0] - R[4] + R[8]};
    const double wx = R[7] - R[5], wy = R[2] - R[6], wz = R[3] - R[1], xy = R[1] + R[3], xz = R[2] + R[6],
                 yz = R[5] + R[7];
    const double row[4][4] = {
        {square[0], wx, wy, wz}, {wx, square[1], xy, xz}, {wy, xy, square[2], yz}, {wz, xz, yz, square[3]}};
    int most = 0;
    for (int i = 1; i < 4; i++)
        most = square[i] > square[most] ? i : most;
    double length = 0;
    for (int i = 0; i < 4; i++)
        length += row[most][i] * row[most][i];
    length = (row[most][0] < 0 ? -1 : 1) * sqrt(length);
    for (int i = 0; i < 4; i++)
        q[i] = row[most][i] / length;
}

void drape_rotation_of_quaternion(const double q[4], double R[9])
{
    const double w = q[0], x = q[1], y = q[2], z = q[3], n = w * w + x * x + y * y + z * z;
    const double matrix[9] = {
        w * w + x * x - y * y - z * z, 2 * (x * y - w * z),           2 * (x * z + w * y),
        2 * (x * y + w * z),           w * w - x * x + y * y - z * z, 2 * (y * z - w * x),
        2 * (x * z - w * y),           2 * (y * z + w * x),           w * w - x * x - y * y + z * z};
    for (int i = 0; i < 9; i++)
        R[i] = matrix[i] / n;
}

void drape_rotation_log(const double R[9], double v[3])
{
    double q[4];
    drape_rotation_quaternion(R, q);
    const double sine = vec3_norm(q + 1), angle = 2 * drape_atan2(sine, q[0]);
    for (int k = 0; k < 3; k++)
        v[k] = sine > 0 ? angle / sine * q[k + 1] : 0;
}

/* w = (I + (1 - cos a)/a^2 [v]x + (a - sin a)/a^3 [v]x^2) dv */
void drape_rotation_velocity(const double v[3], const double dv[3], double w[3])
{
    const double a = vec3_norm(v);
    double sine, versine;
    shares_of(a, &sine, &versine);
    combine(v, dv, versine, a < SMALL ? 1.0 / 6 - a * a / 120 : (1 - sine) / (a * a), w);
}

/* dv = (I - [v]x/2 + (1/a^2 - cot(a/2)/(2 a)) [v]x^2) w */
void drape_rotation_rate(const double v[3], const double w[3], double dv[3])
{
    const double a = vec3_norm(v);
    double s, c, last = 1.0 / 12 + a * a / 720;
    if (a >= SMALL) {
        drape_sin_cos(fmod(a, 2 * DRAPE_PI) / 2, &s, &c);
        last = 1 / (a * a) - c / (2 * a * s);
    }
    combine(v, w, -0.5, last, dv);
}
