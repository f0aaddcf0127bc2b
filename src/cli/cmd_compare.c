/* cmd_compare.c: `drape compare`: how far two finished runs are apart. */
#include "cli/cli.h"

#include "geometry/deviation.h"
#include "io/csv.h"
#include "io/export.h"
#include "io/json.h"
#include "io/summary.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#define COLUMNS "t,cloth,rms,share,distance,node,x_a,y_a,z_a,x_b,y_b,z_b\n"

extern const drape_verb drape_verb_render;

typedef struct compare_request {
    cli_command command;
    const char *out, *image, *within;
    bool json;
} compare_request;

/* One of the two runs. */
typedef struct side {
    cli_scene in;
    drape_record run;
    double *x;            /* (nodes x 3) of a frame [m] */
    double end;           /* time of its last frame [s] */
    char incomplete[400]; /* why it is not complete; "": it is */
} side;

typedef struct compare {
    const compare_request *request;
    drape_context *ctx;
    drape_distance within;
    side sides[2];
    int64_t (*pairs)[2]; /* (pair_count) numbers of frames at the same time */
    int64_t pair_count;
    drape_deviation deviation;
    drape_file table; /* of --out */
    json_t **frames;  /* (cloths) of --json: an array of all frames of the cloth */
} compare;

/* ---- Opening both runs ---- */

static int open_side(const cli_command *command, char *folder, side *s)
{
    json_t *summary = NULL;
    int code = cli_run_load(command, folder, &s->in, &s->run);
    if (code != CLI_GO_ON)
        return code;
    s->x = drape_arena_take(command->arena, (size_t)s->run.nodes, 3 * sizeof *s->x);
    s->end = s->run.times[s->run.frames - 1];
    if (!s->x || drape_record_json(&s->run, DRAPE_SUMMARY_NAME, &summary))
        return cli_report(command, CLI_BAD_INPUT);
    const char *status = json_string_value(json_object_get(summary, "status")),
               *message = json_string_value(json_object_get(summary, "message"));
    if (!status)
        snprintf(s->incomplete, sizeof s->incomplete,
                 "may be incomplete: it has no summary.json, which a run writes at its end");
    else if (strcmp(status, "ok") != 0)
        snprintf(s->incomplete, sizeof s->incomplete, "did not complete: %s", message ? message : status);
    json_decref(summary);
    return CLI_GO_ON;
}

/* Pairs the frames at equal times; a run at another rate has others between them. */
static int pair_frames(compare *c)
{
    const drape_record *a = &c->sides[0].run, *b = &c->sides[1].run;
    const double same = DRAPE_SAME * fmax(1, c->sides[0].end);
    c->pairs = drape_arena_take(c->request->command.arena, (size_t)a->frames, sizeof *c->pairs);
    if (!c->pairs)
        return cli_report(&c->request->command, CLI_FAILED);
    for (int64_t i = 0, j = 0; i < a->frames && j < b->frames;) {
        if (fabs(a->times[i] - b->times[j]) <= same)
            memcpy(c->pairs[c->pair_count++], (const int64_t[]){i++, j++}, sizeof *c->pairs);
        else if (a->times[i] < b->times[j])
            i++;
        else
            j++;
    }
    if (c->pair_count > (a->frames > 1 && b->frames > 1))
        return CLI_GO_ON;
    return cli_misuse(
        "compare",
        "%s/energy.csv, %s/energy.csv: no frame but the first is at a time of both: the first run has "
        "%" PRId64 " until t=%.6g s, the second %" PRId64 " until t=%.6g s; choose frame rates of which "
        "one is a multiple of the other",
        a->folder, b->folder, a->frames, c->sides[0].end, b->frames, c->sides[1].end);
}

static int open_runs(compare *c)
{
    const compare_request *q = c->request;
    const size_t length = q->image ? strlen(q->image) : 0;
    int code = q->within ? cli_read_length(&q->command, "within", q->within, &c->within) : CLI_GO_ON;
    if (code == CLI_GO_ON && q->command.operand_count != 2)
        code = cli_misuse("compare", "one run is given, %s; two are compared", CLI_SHOWN(q->command.operand));
    if (code == CLI_GO_ON && q->image && (length < 5 || strcasecmp(q->image + length - 4, ".png") != 0))
        code = cli_misuse("compare", "--image \"%.200s\": its name must end in .png", q->image);
    if (code == CLI_GO_ON && q->image && drape_verb_render.missing)
        code = cli_misuse("compare", "--image: %s", drape_verb_render.missing);
    for (int i = 0; i < 2 && code == CLI_GO_ON; i++)
        code = open_side(&q->command, q->command.operands[i], &c->sides[i]);
    for (int i = 0; i < 2 && code == CLI_GO_ON && q->out; i++)
        if (drape_record_protect(c->ctx, q->command.operands[i], q->out))
            code = cli_report(&q->command, CLI_BAD_INPUT);
    if (code == CLI_GO_ON)
        code = pair_frames(c);
    if (code == CLI_GO_ON &&
        drape_deviation_create(q->command.arena, c->sides[0].in.model, c->sides[1].in.model, &c->deviation))
        code = c->ctx->status == DRAPE_E_MEMORY
                   ? cli_report(&q->command, CLI_FAILED)
                   : cli_misuse("compare", "%s/scene.json, %s/scene.json: %s", c->sides[0].run.folder,
                                c->sides[1].run.folder, drape_context_message(c->ctx));
    return code;
}

/* ---- The frames ---- */

static const char *cloth_name(const compare *c, int32_t cloth)
{
    return c->sides[0].in.model->cloths[cloth].name;
}

static json_t *apart_json(const drape_apart *apart, double diagonal)
{
    json_t *object = DRAPE_JSON_REALS(json_object(), {"t", apart->time}, {"rms", apart->rms},
                                      {"share", apart->rms / diagonal}, {"distance", apart->distance});
    object = DRAPE_JSON_COUNTS(object, {"node", apart->node});
    object = drape_json_with(object, "a", drape_json_numbers(apart->place[0], 3));
    return drape_json_with(object, "b", drape_json_numbers(apart->place[1], 3));
}

/* Adds the frame that was measured last to the table and to JSON. */
static void keep_frame(compare *c)
{
    for (int32_t i = 0; i < c->deviation.model[0]->cloth_count; i++) {
        const drape_deviation_cloth *cloth = &c->deviation.cloths[i];
        const drape_apart *now = &cloth->now;
        if (c->request->out) {
            drape_file_print(&c->table, "%.17g", now->time);
            drape_csv_put_text(&c->table, cloth_name(c, i));
            drape_csv_put_numbers(&c->table, 3,
                                  (double[]){now->rms, now->rms / cloth->diagonal, now->distance});
            drape_csv_put_integer(&c->table, now->node);
            drape_csv_put_numbers(&c->table, 6, now->place[0]);
            drape_file_put_text(&c->table, "\n");
        }
        if (c->request->json)
            c->frames[i] = drape_json_append(c->frames[i], apart_json(now, cloth->diagonal));
    }
}

static double time_of(const compare *c, int64_t pair)
{
    return c->sides[0].run.times[c->pairs[pair][0]];
}

typedef void deviation_measure(drape_deviation *deviation, double t, const double *x, const double *y);

static drape_status read_pair(compare *c, int64_t pair, deviation_measure *measure)
{
    drape_status status = DRAPE_OK;
    for (int i = 0; i < 2 && !status; i++)
        status = drape_record_read(&c->sides[i].run, c->pairs[pair][i], c->sides[i].x);
    if (!status)
        measure(&c->deviation, time_of(c, pair), c->sides[0].x, c->sides[1].x);
    return status;
}

static int compare_frames(compare *c)
{
    const compare_request *q = c->request;
    const size_t cloths = (size_t)c->deviation.model[0]->cloth_count;
    drape_status status = DRAPE_OK;
    c->frames = drape_arena_take(q->command.arena, cloths, sizeof(json_t *));
    for (size_t i = 0; c->frames && i < cloths && q->json; i++)
        c->frames[i] = json_array();
    if (!c->frames || (q->out && drape_export_begin(c->ctx, NULL, q->out, &c->table)))
        return cli_report(&q->command, CLI_FAILED);
    if (q->out)
        drape_file_put_text(&c->table, COLUMNS);
    for (int64_t i = 0; i < c->pair_count && !status && !cli_interrupted(); i++) {
        status = read_pair(c, i, drape_deviation_add);
        if (!status)
            keep_frame(c);
    }
    if (cli_interrupted())
        return cli_report_interrupted("compare");
    if (status)
        return cli_report(&q->command, CLI_BAD_INPUT);
    return q->out && drape_file_finish(&c->table) ? cli_report(&q->command, CLI_FAILED) : CLI_GO_ON;
}

/* The frame in which the rms is the largest share of a diagonal. */
static int draw(compare *c)
{
    const drape_deviation *d = &c->deviation;
    const int64_t pair = d->cloths[drape_deviation_worst(d)].largest.rms_frame;
    if (read_pair(c, pair, drape_deviation_measure))
        return cli_report(&c->request->command, CLI_BAD_INPUT);
    const cli_drawing drawing = {.out = c->request->image,
                                 .folder = c->request->command.operands[d->of],
                                 .frame = c->pairs[pair][d->of],
                                 .distances = d->distance};
    const int code = cli_draw_distances(&c->request->command, &drawing);
    return code == CLI_DONE ? CLI_GO_ON : code;
}

/* ---- The result ---- */

/* "12.3 mm", "1.41 m" */
static const char *length_text(char text[32], double length)
{
    snprintf(text, 32, length < 0.9995 ? "%.3g mm" : "%.3g m", length < 0.9995 ? 1e3 * length : length);
    return text;
}
#define LENGTH(length) length_text((char[32]){0}, length)

/* Why the comparison is not one of all that the runs would be; "": it is. */
static const char *partial(const compare *c, char text[DRAPE_MESSAGE_SIZE])
{
    const double last = time_of(c, c->pair_count - 1);
    *text = 0;
    for (int i = 0; i < 2 && !*text; i++) {
        const side *s = &c->sides[i];
        const char *name = c->request->command.operands[i];
        if (*s->incomplete)
            snprintf(text, DRAPE_MESSAGE_SIZE, "%s %s; its last frame is at t=%.6g s", name, s->incomplete,
                     s->end);
        else if (s->end > last + DRAPE_SAME * fmax(1, last))
            snprintf(text, DRAPE_MESSAGE_SIZE,
                     "%s is compared until t=%.6g s only, and goes on until t=%.6g s", name, last, s->end);
    }
    return text;
}

static void print_verdict(const compare *c)
{
    const drape_deviation *d = &c->deviation;
    char *const *names = c->request->command.operands, text[DRAPE_MESSAGE_SIZE];
    for (int32_t i = 0; i < d->model[0]->cloth_count; i++) {
        const drape_deviation_cloth *cloth = &d->cloths[i];
        const drape_apart *most = &cloth->largest;
        const double *x = most->place[0], *y = most->place[1];
        if (!(most->distance > 0)) {
            printf("%s: all nodes at the same places\n", CLI_SHOWN(cloth_name(c, i)));
            continue;
        }
        /* in pieces: the C library allocates memory for more than fourteen conversions, and may have none */
        printf("%s: RMS %s, %.3g %% of its diagonal of %s, at t=%.6g s; ", CLI_SHOWN(cloth_name(c, i)),
               LENGTH(most->rms), 100 * most->rms / cloth->diagonal, LENGTH(cloth->diagonal), most->rms_time);
        printf("worst node %d: %s at t=%.6g s, at (%.4g, %.4g, %.4g) m, ", (int)most->node,
               LENGTH(most->distance), most->time, x[0], x[1], x[2]);
        printf("in the second run at (%.4g, %.4g, %.4g) m\n", y[0], y[1], y[2]);
    }
    printf("%" PRId64 " frames from t=%.6g s to %.6g s, of %" PRId64 " in %s and %" PRId64 " in %s\n",
           c->pair_count, time_of(c, 0), time_of(c, c->pair_count - 1), c->sides[0].run.frames,
           CLI_SHOWN(names[0]), c->sides[1].run.frames, CLI_SHOWN(names[1]));
    if (d->material)
        printf("the meshes differ: compared are the %d nodes of %s\n", (int)c->sides[d->of].run.nodes,
               CLI_SHOWN(names[d->of]));
    if (d->gap > DRAPE_SAME * d->model[0]->length)
        printf("at rest the meshes are up to %s apart\n", LENGTH(d->gap));
    if (*partial(c, text))
        printf("%s\n", CLI_SHOWN(text));
}

static int print_json(const compare *c)
{
    const drape_deviation *d = &c->deviation;
    static const char *const keys[] = {"a", "b"};
    errno = 0;
    json_t *cloths = json_array(), *object = json_object();
    for (int i = 0; i < 2; i++) {
        const side *s = &c->sides[i];
        json_t *run = drape_json_with(json_object(), "run", drape_json_text(c->request->command.operands[i]));
        run = DRAPE_JSON_COUNTS(run, {"nodes", s->run.nodes}, {"frames", s->run.frames});
        run = DRAPE_JSON_REALS(run, {"end", s->end});
        object = drape_json_with(object, keys[i],
                                 drape_json_with(run, "completed", json_boolean(!*s->incomplete)));
    }
    object = drape_json_with(object, "nodes_of", json_string(keys[d->of]));
    object = drape_json_with(object, "material_coordinates", json_boolean(d->material));
    object = DRAPE_JSON_REALS(object, {"gap", d->gap});
    for (int32_t i = 0; i < d->model[0]->cloth_count; i++) {
        const drape_deviation_cloth *cloth = &d->cloths[i];
        json_t *largest = apart_json(&cloth->largest, cloth->diagonal);
        largest = DRAPE_JSON_REALS(largest, {"rms_t", cloth->largest.rms_time});
        json_t *item = drape_json_with(json_object(), "name", drape_json_text(cloth_name(c, i)));
        item = DRAPE_JSON_REALS(item, {"diagonal", cloth->diagonal});
        item = drape_json_with(item, "largest", largest);
        cloths = drape_json_append(cloths, drape_json_with(item, "frames", json_incref(c->frames[i])));
    }
    return cli_print_json(&c->request->command, drape_json_with(object, "cloth", cloths), JSON_INDENT(1));
}

/* Whether the runs are as near as --within says, over all of their time. */
static int judge(const compare *c)
{
    const drape_deviation *d = &c->deviation;
    char text[DRAPE_MESSAGE_SIZE];
    if (*partial(c, text)) {
        cli_misuse("compare", "--within: %s", text);
        return CLI_FAILED;
    }
    for (int32_t i = 0; i < d->model[0]->cloth_count; i++) {
        const drape_apart *largest = &d->cloths[i].largest;
        const double bound = drape_distance_of(&c->within, d->cloths[i].diagonal);
        if (largest->rms <= bound)
            continue;
        cli_misuse("compare", "--within %s: %s is %s apart (RMS) at t=%.6g s, more than %s",
                   c->request->within, cloth_name(c, i), LENGTH(largest->rms), largest->rms_time,
                   LENGTH(bound));
        return CLI_FAILED;
    }
    return CLI_DONE;
}

static int run(const void *command)
{
    const compare_request *request = command;
    compare c = {.request = request, .ctx = request->command.ctx};
    c.sides[0].run.positions = c.sides[1].run.positions = -1;
    int code = open_runs(&c);
    if (code == CLI_GO_ON)
        code = compare_frames(&c);
    if (code == CLI_GO_ON && request->image)
        code = draw(&c);
    if (code == CLI_GO_ON && !request->json)
        print_verdict(&c);
    if (code == CLI_GO_ON)
        code = request->json ? print_json(&c) : CLI_DONE;
    if (code == CLI_DONE && request->within)
        code = judge(&c);
    for (int32_t i = 0; c.frames && i < c.deviation.model[0]->cloth_count; i++)
        json_decref(c.frames[i]);
    drape_file_destroy(&c.table);
    for (int i = 0; i < 2; i++) {
        drape_record_close(&c.sides[i].run);
        cli_scene_free(&c.sides[i].in);
    }
    return code;
}

#define AT(member) offsetof(compare_request, member)
static const cli_option options[] = {
    {"within", CLI_TEXT, "LENGTH",
     "exit code 1 if an RMS is larger: 1mm, 0.5cm; without a unit a share of the diagonal: 1e-2", AT(within)},
    {"out", CLI_TEXT, "FILE", "CSV with a row for each frame and cloth", AT(out)},
    {"image", CLI_TEXT, "FILE.png", "the frame with the largest RMS, in colours of the distance", AT(image)},
    {"json", CLI_FLAG, NULL, "print JSON, with all frames", AT(json)},
};

const drape_verb drape_verb_compare = {
    .entry = {.name = "compare", .summary = "show how far two finished runs are apart, where and when"},
    .operand = "RUN RUN",
    .max_operands = 2,
    .details =
        "Compares the positions of two runs, folders that `drape run --out` wrote, at the times of frames "
        "that\n"
        "both have. For each cloth: the largest RMS distance over its nodes of all frames, as a share of "
        "the\n"
        "diagonal of its box at rest too, and the node that is furthest, with the time and its place in "
        "both\n"
        "runs. Nodes are numbered as in positions.npy. Meshes of other triangles, such as a finer one, are\n"
        "compared at the nodes of the run that has fewer, where they lie in the other mesh at rest.",
    CLI_OPTIONS(options, compare_request),
    .run = run,
};
