/* host.c: a sheet drapes over a ball that this program moves, in real time: 60 frames per second, with a time
 * budget for each. Build and run:
 *     cc host.c $(pkg-config --cflags --libs drape) -lm -o host && ./host [FRAMES] */
#include <drape/drape.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static drape_status make_model(drape_context *ctx, drape_model **model)
{
    const double center[3] = {0.5, -0.25, -0.5};
    const drape_setting grid[] = {{"columns", 20}, {"rows", 20}, {"width", 1}, {"height", 1}},
                        material[] = {{"young_modulus", 1e5}, {"thickness", 1e-3}, {"density", 200}},
                        ball[] = {{"center", .vector = center, .vector_count = 3}, {"radius", 0.2}};
    const drape_entry_def terms[] = {{"stretch.edge"}, {"bend.hinge"}};
    drape_cloth_def cloth;
    drape_collider_def sphere;
    drape_scene_def scene;
    drape_cloth_def_init(&cloth, sizeof cloth);
    cloth.mesh.grid = (drape_entry_def){"square", grid, 4};
    cloth.material = material, cloth.material_count = 3;
    cloth.terms = terms, cloth.term_count = 2;
    drape_collider_def_init(&sphere, sizeof sphere);
    sphere.entry = (drape_entry_def){"sphere", ball, 2}, sphere.friction = 0.5;
    drape_scene_def_init(&scene, sizeof scene);
    scene.cloths = &cloth, scene.cloth_count = 1;
    scene.colliders = &sphere, scene.collider_count = 1;
    scene.integrator.type = "newton_k"; /* as many iterations as fit into a frame */
    return drape_model_create(ctx, &scene, model);
}

int main(int argc, char **argv)
{
    const double frame = 1.0 / 60, a = 0.1, w = 3; /* the ball: x = a sin(w t) */
    const int frames = argc > 1 ? atoi(argv[1]) : 300;
    drape_context *ctx = NULL;
    drape_model *model = NULL;
    drape_sim *sim = NULL;
    drape_realtime report = {0};
    drape_status status = drape_context_create(NULL, &ctx);
    status = status ? status : make_model(ctx, &model);
    status = status ? status : drape_sim_create(ctx, model, NULL, &sim);
    for (int k = 1; !status && k <= frames; k++) {
        const double t = k * frame, x[3] = {a * sin(w * t)}, v[3] = {a * w * cos(w * t)};
        status = drape_sim_move_collider(sim, 0, frame + report.debt, x, v);
        status = status ? status : drape_sim_advance_realtime(sim, frame, 0.8 * frame, &report);
        double low = INFINITY; /* here a game would draw the positions, with drape_sim_normals */
        for (int32_t i = 0; !status && i < drape_model_node_count(model); i++)
            low = fmin(low, drape_sim_positions(sim)[3 * i + 1]);
        if (!status && k % 30 == 0)
            printf("t %.2f s: down to %.3f m; %.1f ms, %s\n", t, low, 1e3 * report.seconds, report.level);
        nanosleep(&(struct timespec){.tv_nsec = (long)(1e9 * fmax(0, frame - report.seconds))}, NULL);
    }
    if (status)
        fprintf(stderr, "%s\n", drape_context_message(ctx));
    drape_sim_destroy(&sim), drape_model_destroy(&model), drape_context_destroy(&ctx);
    return status != DRAPE_OK;
}
