/*
 * scenes: the cost of running scenes, and how well contact holds: steps, rejections, Newton iterations, CPU
 * time and the share of contact in it; the deepest node and the deepest point of a face in a collider, and
 * the largest number of edges through triangles, over the ends of steps and over frames. The CPU time does
 * not include these checks.
 */
#include "bench.h"

#include "model/scene.h"
#include "support/audit.h"

#include <getopt.h>
#include <time.h>

#define MAX_SETTINGS 32

typedef struct setting {
    const char *pointer, *value;
} setting;

typedef struct request {
    setting set[MAX_SETTINGS];
    int set_count;
    FILE *csv;
} request;

/* An audit, and the CPU time that it took. */
typedef struct watched {
    audit audit;
    double seconds;
} watched;

static double cpu_seconds(void)
{
    return (double)clock() / CLOCKS_PER_SEC;
}

static drape_status watch(void *user, const drape_event *event)
{
    watched *w = user;
    double start = cpu_seconds();
    drape_status status = audit_observe(&w->audit, event);
    w->seconds += cpu_seconds() - start;
    return status;
}

static drape_model *load(drape_context *ctx, const request *r, const char *path)
{
    drape_scene *scene = NULL;
    drape_model *model = NULL;
    drape_status status = drape_scene_load(ctx, path, &scene);
    for (int i = 0; !status && i < r->set_count; i++)
        status = drape_scene_set(scene, r->set[i].pointer, r->set[i].value);
    if (!status)
        status = drape_scene_compile(scene, &model);
    if (status)
        bench_fail(ctx, "%s", path);
    drape_scene_destroy(&scene);
    return model;
}

static const char *name_of(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

static void print_reasons(const drape_sim *sim)
{
    int64_t count = 0;
    const char *reason;
    for (int i = 0; (reason = drape_sim_reason(sim, i, &count)); i++)
        printf(" %s %lld", reason, (long long)count);
}

/* Prints a column, which is empty without colliders. */
static void print_depth(FILE *csv, double depth)
{
    if (isfinite(depth))
        fprintf(csv, ",%.3g", depth);
    else
        fputc(',', csv);
}

/* Commas in a value, such as a list, become semicolons: they would end the column. */
static void print_settings(const request *r)
{
    for (int i = 0; i < r->set_count; i++) {
        fprintf(r->csv, "%s%s=", i ? " " : "", r->set[i].pointer);
        for (const char *c = r->set[i].value; *c; c++)
            fputc(*c == ',' ? ';' : *c, r->csv);
    }
}

static void report(const request *r, const char *path, drape_sim *sim, const watched *w, drape_status status,
                   double cpu)
{
    const drape_statistics s = drape_sim_statistics(sim);
    const audit_worst *at[2] = {&w->audit.steps, &w->audit.frames};
    double share = s.wall_steps > 0 ? 100 * s.wall_contact / s.wall_steps : 0;
    printf("%-22s %s t %.3g s, %d nodes, %lld steps, %lld rejected, %lld iterations, %.1f s CPU, contact "
           "%.0f %%",
           name_of(path), drape_status_name(status), drape_sim_time(sim), (int)w->audit.model->node_count,
           (long long)s.steps_accepted, (long long)s.steps_rejected, (long long)s.newton_iterations, cpu,
           share);
    print_reasons(sim);
    putchar('\n');
    for (int i = 0; i < 2; i++)
        printf("    %s %5lld: depth of nodes %9.2e m (%.3f s), of faces %9.2e m (%.3f s), intersections %lld "
               "(%.3f s)\n",
               i ? "frames" : "steps ", (long long)at[i]->states, at[i]->node, at[i]->node_at, at[i]->face,
               at[i]->face_at, (long long)at[i]->intersections, at[i]->intersections_at);
    if (status)
        printf("    %s\n", drape_context_message(w->audit.ctx));
    fflush(stdout);
    if (!r->csv)
        return;
    bench_csv_row(r->csv);
    print_settings(r);
    fprintf(r->csv, ",%s,%s,%d,%lld,%lld,%lld,%.2f,%.1f", name_of(path), drape_status_name(status),
            (int)w->audit.model->node_count, (long long)s.steps_accepted, (long long)s.steps_rejected,
            (long long)s.newton_iterations, cpu, share);
    for (int i = 0; i < 2; i++) {
        print_depth(r->csv, at[i]->node);
        print_depth(r->csv, at[i]->face);
        fprintf(r->csv, ",%lld", (long long)at[i]->intersections);
    }
    fputc('\n', r->csv);
    fflush(r->csv);
}

static drape_status run(const request *r, const char *path)
{
    drape_context *ctx = bench_context();
    drape_model *model = load(ctx, r, path);
    drape_sim *sim = bench_sim(ctx, model, NULL, NULL, NULL, NULL);
    watched w = {.audit = audit_of(ctx, model, model->contact.self, true)};
    drape_sim_observe(sim, watch, &w);
    double start = cpu_seconds();
    drape_status status = drape_sim_advance(sim, model->duration);
    report(r, path, sim, &w, status, cpu_seconds() - start - w.seconds);
    drape_sim_destroy(&sim);
    drape_model_destroy(&model);
    drape_context_destroy(&ctx);
    return status;
}

static void usage(FILE *to)
{
    fputs(
        "usage: scenes [--set /POINTER=VALUE]... [--csv FILE] SCENE...\n"
        "Runs scenes; prints steps, work, CPU time, the deepest point in a collider and the edges that pass "
        "through triangles.\n",
        to);
}

static void add_setting(request *r, char *text)
{
    char *equals = strchr(text, '=');
    if (!equals || r->set_count == MAX_SETTINGS) {
        usage(stderr);
        exit(2);
    }
    *equals = '\0';
    r->set[r->set_count++] = (setting){text, equals + 1};
}

int main(int argc, char **argv)
{
    static const struct option options[] = {{"set", required_argument, NULL, 's'},
                                            {"csv", required_argument, NULL, 'c'},
                                            {"help", no_argument, NULL, 'h'},
                                            {0}};
    request r = {.csv = NULL};
    int failed = 0, option;
    while ((option = getopt_long(argc, argv, "", options, NULL)) != -1) {
        if (option == 's')
            add_setting(&r, optarg);
        else if (option == 'c')
            r.csv = bench_csv(optarg,
                              "settings,scene,status,nodes,steps,rejected,iterations,cpu_s,contact_percent,"
                              "step_node_m,step_face_m,step_intersections,"
                              "frame_node_m,frame_face_m,frame_intersections");
        else {
            usage(option == 'h' ? stdout : stderr);
            return option == 'h' ? 0 : 2;
        }
    }
    for (int i = optind; i < argc; i++)
        failed += run(&r, argv[i]) != DRAPE_OK;
    if (r.csv)
        fclose(r.csv);
    return failed > 0;
}
