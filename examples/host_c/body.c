/* body.c: a rigid body that hangs from cloth: the cloth pulls it, and it pulls the cloth. The lower edge of
 * a sheet rides on a box, whose motion this program integrates. With the force F of the cloth on the box and
 * its torque T about the center of mass, in each step h (semi-implicit Euler)
 *     v += h (F + m g) / M,   w += h J^-1 (T - w x J w),   x += h v,   q <- exp(h w) q
 * M is the mass m of the box and that of the nodes that it carries, whose weight is in F already; J, in
 * space, likewise. F is that of the beginning of the step: such a coupling is stable while mass and moments
 * of inertia of the body are larger than those of the cloth that follows it within a step. Build and run:
 *     cc body.c $(pkg-config --cflags --libs drape) -lm -o body && ./body [FRAMES] */
#include <drape/drape.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MASS 0.3  /* [kg] of the box, a bar */
#define LONG 0.5  /* [m] its length, along x */
#define WIDE 0.06 /* [m] its other sides */

typedef struct body {
    double mass, inertia[3]; /* [kg], [kg m2] about its own axes; the box with the nodes that it carries */
    double x[3], v[3];       /* [m], [m/s] of the center of mass */
    double q[4], w[3];       /* rotation as a quaternion w x y z, angular velocity in space [rad/s] */
} body;

static drape_status make_model(drape_context *ctx, drape_model **model)
{
    const double center[3] = {0.25, -0.55, 0}, size[3] = {LONG, WIDE, WIDE};
    const drape_setting grid[] = {{"columns", 11},
                                  {"rows", 11},
                                  {"width", 0.5},
                                  {"height", 0.5},
                                  {"orientation", .text = "vertical"}},
                        material[] = {{"young_modulus", 1e6}, {"thickness", 1e-3}, {"density", 200}},
                        damping[] = {{"beta", 0.005}},
                        box[] = {{"center", .vector = center, .vector_count = 3},
                                 {"size", .vector = size, .vector_count = 3}};
    const drape_entry_def terms[] = {{"stretch.edge"}, {"bend.hinge"}, {"damp.kelvin_voigt", damping, 1}};
    drape_pin_def pins[2];
    drape_cloth_def cloth;
    drape_collider_def collider;
    drape_scene_def scene;
    drape_pin_def_init(&pins[0], sizeof *pins), drape_pin_def_init(&pins[1], sizeof *pins);
    pins[0].edge = "top";
    pins[1].edge = "bottom", pins[1].attach = "box"; /* 2 cm above it: outside of contact */
    drape_cloth_def_init(&cloth, sizeof cloth);
    cloth.mesh.grid = (drape_entry_def){"square", grid, 5};
    cloth.material = material, cloth.material_count = 3;
    cloth.terms = terms, cloth.term_count = 3;
    cloth.pins = pins, cloth.pin_count = 2;
    drape_collider_def_init(&collider, sizeof collider);
    collider.entry = (drape_entry_def){"box", box, 2}, collider.name = "box";
    drape_scene_def_init(&scene, sizeof scene);
    scene.cloths = &cloth, scene.cloth_count = 1;
    scene.colliders = &collider, scene.collider_count = 1;
    return drape_model_create(ctx, &scene, model);
}

/* The box at rest, swung along z, with the nodes that it carries. */
static body make_body(const drape_sim *sim, const drape_model *model)
{
    const double along = MASS * WIDE * WIDE / 6, across = MASS * (LONG * LONG + WIDE * WIDE) / 12;
    body b = {.mass = MASS, .inertia = {along, across, across}, .v = {0, 0, 0.5}, .q = {1, 0, 0, 0}};
    drape_sim_collider_rotation(sim, 0, NULL, NULL, b.x); /* the pivot of a box is its center */
    for (int32_t i = 0; i < drape_model_node_count(model); i++) {
        const double *x = drape_sim_positions(sim) + 3 * i, m = drape_model_masses(model)[i];
        double r[3], square = 0;
        for (int k = 0; k < 3; k++)
            r[k] = x[k] - b.x[k], square += r[k] * r[k];
        for (int k = 0; k < 3 && drape_sim_attached(sim, i) == 0; k++)
            b.inertia[k] += m * (square - r[k] * r[k]);
        if (drape_sim_attached(sim, i) == 0)
            b.mass += m; /* little: the center of mass stays that of the box */
    }
    return b;
}

static void turn(const double q[4], double sign, const double x[3], double y[3]) /* by q, or back: sign -1 */
{
    const double *u = q + 1, s = sign * q[0];
    const double t[3] = {2 * (u[1] * x[2] - u[2] * x[1]), 2 * (u[2] * x[0] - u[0] * x[2]),
                         2 * (u[0] * x[1] - u[1] * x[0])};
    const double c[3] = {u[1] * t[2] - u[2] * t[1], u[2] * t[0] - u[0] * t[2], u[0] * t[1] - u[1] * t[0]};
    for (int k = 0; k < 3; k++)
        y[k] = x[k] + s * t[k] + c[k];
}

static void integrate(body *b, const double force[3], const double torque[3], double h)
{
    double w[3], T[3], angle = 0, p[4], q[4];
    turn(b->q, -1, b->w, w), turn(b->q, -1, torque, T); /* in the axes of the body */
    const double *J = b->inertia, spin[3] = {(J[2] - J[1]) * w[1] * w[2], (J[0] - J[2]) * w[2] * w[0],
                                             (J[1] - J[0]) * w[0] * w[1]};
    for (int k = 0; k < 3; k++)
        w[k] += h * (T[k] - spin[k]) / J[k];
    turn(b->q, 1, w, b->w);
    for (int k = 0; k < 3; k++) {
        b->v[k] += h * (force[k] - (k == 1 ? MASS * 9.81 : 0)) / b->mass;
        b->x[k] += h * b->v[k];
        angle += b->w[k] * b->w[k];
    }
    angle = sqrt(angle) * h; /* p = exp(h w / 2), q = p q */
    p[0] = cos(angle / 2);
    for (int k = 0; k < 3; k++)
        p[k + 1] = h / 2 * b->w[k] * (angle > 0 ? sin(angle / 2) / (angle / 2) : 1);
    memcpy(q, b->q, sizeof q);
    b->q[0] = p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3];
    b->q[1] = p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2];
    b->q[2] = p[0] * q[2] + p[2] * q[0] + p[3] * q[1] - p[1] * q[3];
    b->q[3] = p[0] * q[3] + p[3] * q[0] + p[1] * q[2] - p[2] * q[1];
}

int main(int argc, char **argv)
{
    const double h = 1.0 / 240; /* four steps a frame */
    const int frames = argc > 1 ? atoi(argv[1]) : 300;
    double force[3] = {0}, torque[3] = {0}, start[3], to[3];
    drape_context *ctx = NULL;
    drape_model *model = NULL;
    drape_sim *sim = NULL;
    drape_sim_def def;
    drape_sim_def_init(&def, sizeof def);
    def.integrator = "be", def.dt = h;
    drape_status status = drape_context_create(NULL, &ctx);
    status = status ? status : make_model(ctx, &model);
    status = status ? status : drape_sim_create(ctx, model, &def, &sim);
    body b = status ? (body){0} : make_body(sim, model);
    memcpy(start, b.x, sizeof start);
    for (int k = 1; !status && k <= 4 * frames; k++) {
        status = drape_sim_collider_force(sim, 0, force);
        status = status ? status : drape_sim_collider_torque(sim, 0, b.x, torque);
        integrate(&b, force, torque, h);
        for (int i = 0; i < 3; i++)
            to[i] = b.x[i] - start[i];
        /* without velocities: straight, at constant speed, as the body does in this step */
        status = status ? status : drape_sim_move_collider_pose(sim, 0, h, to, b.q, NULL, NULL);
        status = status ? status : drape_sim_advance(sim, k * h);
        if (!status && k % 120 == 0)
            printf("t %.2f s: box at %.3f %.3f %.3f m, pulled up with %.3f of its weight\n", k * h, b.x[0],
                   b.x[1], b.x[2], force[1] / (MASS * 9.81));
    }
    if (status)
        fprintf(stderr, "%s\n", drape_context_message(ctx));
    drape_sim_destroy(&sim), drape_model_destroy(&model), drape_context_destroy(&ctx);
    return status != DRAPE_OK;
}
