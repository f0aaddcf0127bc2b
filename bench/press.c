/*
 * press: runs one scene and counts, at every accepted state and every frame, what passes through what, by the
 * independent code of tests/support/crossings.h. tools/press draws scenes for it.
 *
 *     press SCENE [CPU SECONDS]          prints one line of JSON; exit 1 if anything crossed
 */
#include <time.h>

#include "sim/sim.h"
#include "support/crossings.h"

typedef struct run {
    crossings_run crossed;
    double limit; /* [s] of CPU */
    bool over;    /* it took longer */
    long rejected;
} run;

static double cpu(void)
{
    return (double)clock() / CLOCKS_PER_SEC;
}

static drape_status observe(void *user, const drape_event *event)
{
    run *r = user;
    if (event->kind == DRAPE_EVENT_ATTEMPT && !event->attempt->accepted)
        r->rejected++;
    r->over = cpu() > r->limit;
    const drape_status status = crossings_observe(&r->crossed, event);
    return status ? status : r->over ? DRAPE_E_STOPPED : DRAPE_OK;
}

static void print_text(const char *key, const char *text)
{
    printf("\"%s\": \"", key);
    for (; *text; text++)
        if (*text == '"' || *text == '\\')
            printf("\\%c", *text);
        else
            putchar(*text < ' ' ? ' ' : *text);
    printf("\", ");
}

static int report(const run *r, drape_status status, const char *message)
{
    const crossings_run *c = &r->crossed;
    const int64_t crossed = c->crossed_states + c->crossed_frames;
    const bool over = r->over && status == DRAPE_E_STOPPED;
    printf("{");
    print_text("status", over ? "over time" : drape_status_name(status));
    print_text("message", status && !over ? message : "");
    print_text("first", c->first);
    printf("\"states\": %lld, \"frames\": %lld, \"rejected\": %ld, \"crossed_states\": %lld, "
           "\"crossed_frames\": "
           "%lld, \"cloth\": %lld, \"colliders\": %lld, \"inside\": %lld, \"depth\": %.4g, \"first_time\": "
           "%.6g, "
           "\"cpu\": %.3g}\n",
           (long long)c->states, (long long)c->frames, r->rejected, (long long)c->crossed_states,
           (long long)c->crossed_frames, (long long)c->cloth, (long long)c->colliders, (long long)c->inside,
           c->depth, c->first_time, cpu());
    return crossed > 0;
}

int main(int argc, char **argv)
{
    run r = {.limit = argc > 2 ? atof(argv[2]) : 60};
    drape_context *ctx = NULL;
    drape_scene *scene = NULL;
    drape_model *model = NULL;
    drape_sim *sim = NULL;
    if (argc < 2) {
        fprintf(stderr, "usage: press SCENE [CPU SECONDS]\n");
        return 2;
    }
    drape_status status = drape_context_create(NULL, &ctx);
    if (!status)
        status = drape_scene_load(ctx, argv[1], &scene);
    if (!status)
        status = drape_scene_compile(scene, &model);
    if (!status)
        status = drape_sim_create(ctx, model, NULL, &sim);
    if (!status)
        status = drape_sim_observe(sim, observe, &r);
    if (status) {
        fprintf(stderr, "press: %s\n", drape_context_message(ctx));
        return 2;
    }
    status = drape_sim_advance(sim, drape_model_duration(model));
    const int code = report(&r, status, drape_context_message(ctx));
    drape_sim_destroy(&sim);
    drape_model_destroy(&model);
    drape_scene_destroy(&scene);
    drape_context_destroy(&ctx);
    return code;
}
