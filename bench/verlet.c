/*
 * verlet: a frame of CS184's scene pinned2, 30 substeps with self-contact and the strain limit, by Drape's
 * integrator "verlet" and by CS184's own algorithm (cs184.cpp). The two take turns, so that a change of the
 * machine's speed affects both. Prints the CPU time per frame of each, their ratio, and how far apart the two
 * sheets are at the end, as both compute the same motion. CS184 looks for near points only in a point's own
 * box of space and misses pairs across the faces of boxes; Drape looks in all boxes within reach. Three
 * comparisons, Drape's boxes first:
 *
 *   all own   each program as it is
 *   own own   both as CS184
 *   all all   both in all boxes, without missing any pair
 *
 *     verlet [--csv FILE] [--side N] [--thickness T] [--frames WARM COUNT] [SCENE]
 *         default: --side 64, --thickness 0.0095, --frames 30 60
 */
#include "bench.h"

#include "cs184.h"
#include "model/scene.h"

#include <time.h>

static int side = 64, warm = 30, frames = 60;
static double thickness = 0.0095;

static void set(drape_context *ctx, drape_scene *scene, const char *pointer, const char *value)
{
    if (drape_scene_set(scene, pointer, value))
        bench_fail(ctx, "%s=%s", pointer, value);
}

static drape_model *load(drape_context *ctx, const char *path, bool all_boxes)
{
    char count[32], last[64], thick[32];
    drape_scene *scene = NULL;
    drape_model *model = NULL;
    snprintf(count, sizeof count, "%d", side);
    snprintf(last, sizeof last, "[[0, 0], [%d, 0]]", side - 1);
    snprintf(thick, sizeof thick, "%.17g", thickness);
    if (drape_scene_load(ctx, path, &scene))
        bench_fail(ctx, "%s", path);
    set(ctx, scene, "/cloth/num_width_points", count);
    set(ctx, scene, "/cloth/num_height_points", count);
    set(ctx, scene, "/cloth/pinned", last);
    set(ctx, scene, "/cloth/thickness", thick);
    set(ctx, scene, "/integrator/self_boxes", all_boxes ? "\"all\"" : "\"own\"");
    if (drape_scene_compile(scene, &model))
        bench_fail(ctx, "%s", path);
    drape_scene_destroy(&scene);
    return model;
}

static cs184 *open_reference(const drape_model *m, const drape_sim *sim, bool all_boxes)
{
    const cs184_scene scene = {.side = side,
                               .width = 1,
                               .thickness = thickness,
                               .mass = m->mass[1],
                               .ks = 5000,
                               .damping = 0.2,
                               .gravity = -9.8,
                               .frame_rate = 90,
                               .substeps = 30,
                               .all_boxes = all_boxes};
    bool *pinned = malloc((size_t)m->node_count * sizeof *pinned);
    if (!pinned)
        exit(1);
    for (int32_t i = 0; i < m->node_count; i++)
        pinned[i] = m->free_of_node[i] < 0;
    cs184 *c = cs184_open(&scene, drape_sim_positions(sim), pinned);
    free(pinned);
    return c;
}

static double frame_of_drape(drape_context *ctx, drape_sim *sim, int frame)
{
    clock_t start = clock();
    if (drape_sim_advance(sim, frame / 90.0))
        bench_fail(ctx, "frame %d", frame);
    return (double)(clock() - start) / CLOCKS_PER_SEC;
}

static double frame_of_reference(cs184 *c)
{
    clock_t start = clock();
    cs184_frame(c);
    return (double)(clock() - start) / CLOCKS_PER_SEC;
}

/* Root mean square distance of the nodes of the two sheets [m]. */
static double distance(const cs184 *c, const double *x)
{
    double sum = 0, d[3];
    for (int i = 0; i < side * side; i++) {
        cs184_position(c, i, d);
        for (int k = 0; k < 3; k++)
            sum += (d[k] - x[3 * i + k]) * (d[k] - x[3 * i + k]);
    }
    return sqrt(sum / (side * side));
}

typedef struct boxes {
    bool ours_all, theirs_all;
} boxes;

static const char *name_of(bool all)
{
    return all ? "all" : "own";
}

static void measure(drape_context *ctx, const char *path, boxes b, FILE *csv)
{
    drape_model *model = load(ctx, path, b.ours_all);
    drape_sim *sim = bench_sim(ctx, model, NULL, NULL, NULL, NULL);
    cs184 *reference = open_reference(model, sim, b.theirs_all);
    double ours = 0, theirs = 0;
    for (int frame = 1; frame <= warm + frames; frame++) {
        double drape = frame_of_drape(ctx, sim, frame), course = frame_of_reference(reference);
        ours += frame > warm ? drape : 0;
        theirs += frame > warm ? course : 0;
    }
    const double apart = distance(reference, drape_sim_positions(sim));
    printf("%6d %10g %-6s %-6s %10.2f %10.2f %8.3f %10.3g\n", side * side, thickness, name_of(b.ours_all),
           name_of(b.theirs_all), 1e3 * ours / frames, 1e3 * theirs / frames, ours / theirs, apart);
    fflush(stdout);
    if (csv) {
        bench_csv_row(csv);
        fprintf(csv, "%d,%g,%s,%s,%d,%d,%.4g,%.4g,%.4g,%.4g\n", side * side, thickness, name_of(b.ours_all),
                name_of(b.theirs_all), warm, frames, 1e3 * ours / frames, 1e3 * theirs / frames,
                ours / theirs, apart);
    }
    cs184_close(reference);
    drape_sim_destroy(&sim);
    drape_model_destroy(&model);
}

int main(int argc, char **argv)
{
    static const char usage[] =
        "verlet [--csv FILE] [--side N] [--thickness T] [--frames WARM COUNT] [SCENE]\n";
    const char *file = NULL, *path = "examples/scenes/cs184_pinned2.json";
    for (int i = 1; i < argc; i++) {
        if (strcmp(argv[i], "--csv") == 0 && i + 1 < argc)
            file = argv[++i];
        else if (strcmp(argv[i], "--side") == 0 && i + 1 < argc && atoi(argv[i + 1]) > 2)
            side = atoi(argv[++i]);
        else if (strcmp(argv[i], "--thickness") == 0 && i + 1 < argc && atof(argv[i + 1]) > 0)
            thickness = atof(argv[++i]);
        else if (strcmp(argv[i], "--frames") == 0 && i + 2 < argc && atoi(argv[i + 2]) > 0) {
            warm = atoi(argv[++i]);
            frames = atoi(argv[++i]);
        } else if (argv[i][0] != '-')
            path = argv[i];
        else
            return bench_usage(argv[i], usage);
    }
    FILE *csv = bench_csv(
        file, "nodes,thickness_m,boxes,cs184_boxes,warm_frames,frames,drape_ms,cs184_ms,ratio,apart_m");
    drape_context *ctx = bench_context();
    puts(" nodes  thickness boxes  cs184    drape ms   cs184 ms    ratio    apart m");
    measure(ctx, path, (boxes){true, false}, csv);
    measure(ctx, path, (boxes){false, false}, csv);
    measure(ctx, path, (boxes){true, true}, csv);
    drape_context_destroy(&ctx);
    return csv && fclose(csv) ? 1 : 0;
}
