/*
 * test_no_room.c: bodies that leave cloth no room. With contact/no_room "relax", and with "auto" in real
 * time, no step fails for good, time goes on at the steps that were asked for, the report names the
 * bodies, the rest of the cloth is not strained, and once there is room nothing is inside any more. With
 * "stop" the run stops and names the pair.
 */
#include "base/vec3.h"
#include "realtime/relaxed_report.h"
#include "realtime/room.h"
#include "support/bytes.h"
#include "support/scene.h"

#include <stdlib.h>

#define FRAME (1.0 / 60)

/* A sheet of half a metre that hangs by its corners in the plane z = 0, or lies at some height. */
#define SHEET                                                                                                \
    "{'drape': 1, 'cloth': [{'name': 'sheet', 'mesh': {'grid': 'square', 'columns': 13, 'rows': 13,"         \
    " 'width': 0.5, 'height': 0.5, 'orientation': '%s', 'transform': {'translate': [-0.25, %g, %g]}},"       \
    " 'material': {'young_modulus': 1e6, 'thickness': 1e-3, 'density': 200},"                                \
    " 'terms': ['stretch.edge', 'bend.hinge', {'type': 'drag.viscous', 'coefficient': 0.1}], 'pins': "       \
    "[%s]}],"
#define CORNERS "{'corner': 'top-left'}, {'corner': 'top-right'}"
#define REST                                                                                                 \
    " 'contact': {'no_room': '%s', 'friction': 'lagged'},"                                                   \
    " 'integrator': {'method': '%s', 'dt': 0.0166666666666666667}, 'duration': 3}"
/* Two balls that close upon the middle of the sheet from 0.1 to 0.3 s, overlap by 4 cm, and part from 0.7
 * s on. */
#define BALLS                                                                                                \
    " 'colliders': [{'name': 'left', 'type': 'sphere', 'center': [0, 0.25, -0.15], 'radius': 0.1,"           \
    " 'friction': 0.3, 'track': [[0.1, [0,0,0]], [0.3, [0,0,0.07]], [0.7, [0,0,0.07]], [0.9, [0,0,0]]]},"    \
    " {'name': 'right', 'type': 'sphere', 'center': [0, 0.25, 0.15], 'radius': 0.1, 'friction': 0.3,"        \
    " 'track': [[0.1, [0,0,0]], [0.3, [0,0,-0.07]], [0.7, [0,0,-0.07]], [0.9, [0,0,0]]]}],"

static scene open_pinch(const char *policy, const char *method)
{
    return scene_open(SHEET BALLS REST, "vertical", 0.5, 0.0, CORNERS, policy, method);
}

/* What was seen in the frames of a run. */
typedef struct record {
    int32_t most;           /* relaxed nodes */
    double deepest, strain; /* [m]; of edges at no relaxed node or neighbour of one */
    double first, last;     /* [s] frames with relaxed nodes */
    bool *named;            /* (collider_count) */
    double last_inside;     /* [s] the last frame with a triangle inside */
} record;

static void look(const scene *s, record *seen)
{
    const drape_model *m = s->model;
    const double *x = drape_sim_positions(s->sim), t = drape_sim_time(s->sim);
    const int32_t count = drape_sim_relaxed(s->sim, -1, NULL);
    scoped_memory bool *relaxed = calloc((size_t)m->node_count, sizeof *relaxed),
                       *around = calloc((size_t)m->node_count, 1);
    for (int32_t i = 0; i < count; i++) {
        drape_relaxed r;
        ck_assert_int_eq(drape_sim_relaxed(s->sim, i, &r), count);
        ck_assert(r.collider >= 0 && r.depth >= 0 && r.deepest >= r.depth && r.since <= t);
        ck_assert_str_eq(r.name, m->colliders[r.collider].name);
        seen->named[r.collider] = true;
        seen->deepest = fmax(seen->deepest, r.deepest);
        relaxed[r.node] = true;
    }
    if (count > 0) {
        seen->first = seen->most == 0 ? t : seen->first;
        seen->last = t;
    }
    seen->most = count > seen->most ? count : seen->most;
    for (int32_t e = 0; e < m->edge_count; e++) {
        const int32_t *n = m->edge + 2 * (size_t)e;
        around[n[0]] = around[n[0]] || relaxed[n[1]];
        around[n[1]] = around[n[1]] || relaxed[n[0]];
    }
    for (int32_t e = 0; e < m->edge_count; e++) {
        const int32_t *n = m->edge + 2 * (size_t)e;
        double square = 0;
        for (size_t k = 0; k < 3; k++)
            square += pow(x[3 * (size_t)n[0] + k] - x[3 * (size_t)n[1] + k], 2);
        if (!relaxed[n[0]] && !relaxed[n[1]] && !(around[n[0]] && around[n[1]]))
            seen->strain = fmax(seen->strain, sqrt(square) / m->edge_length[e] - 1);
    }
    for (int32_t c = 0; c < m->collider_count; c++) {
        double deepest;
        if (drape_sim_inside(s->sim, c, &deepest) > 0) {
            seen->last_inside = t;
            ck_assert_int_gt(count, 0); /* nothing is inside that is not reported */
        }
    }
}

/* Frames of 1/60 s: every call succeeds and reaches its time. */
static record run(scene *s, bool realtime, int frames)
{
    record seen = {.named = calloc((size_t)s->model->collider_count, sizeof *seen.named), .last_inside = -1};
    for (int f = 1; f <= frames; f++) {
        drape_realtime report = {0};
        const drape_status status = realtime ? drape_sim_advance_realtime(s->sim, FRAME, 1e9, &report)
                                             : drape_sim_advance(s->sim, f * FRAME);
        ck_assert_msg(status == DRAPE_OK, "frame %d: %s", f, drape_context_message(s->ctx));
        ck_assert_double_eq_tol(drape_sim_time(s->sim), f * FRAME, 1e-9);
        if (realtime)
            ck_assert_int_eq(report.relaxed, drape_sim_relaxed(s->sim, -1, NULL));
        look(s, &seen);
    }
    return seen;
}

/* By how many attempts more than one a frame did the run get through. */
static int64_t extra_attempts(const scene *s, int frames)
{
    const drape_statistics n = drape_sim_statistics(s->sim);
    return n.steps_accepted + n.steps_rejected - frames;
}

static void check_pinch(const char *policy, const char *method, bool realtime)
{
    scoped_scene s = open_pinch(policy, method);
    record seen = run(&s, realtime, 84);
    drape_warning warning = {.name = ""};
    ck_assert(seen.named[0] && seen.named[1]);
    /* Each ball goes 2 cm beyond the plane of the sheet. The cloth between may lie anywhere in the overlap
     * of 4 cm, and what is relaxed around it no deeper than that. */
    ck_assert_double_ge(seen.deepest, 0.02);
    ck_assert_double_le(seen.deepest, 0.04);
    ck_assert_double_lt(seen.strain, 0.1);
    /* The gaps of 5 cm close at 0.35 m/s: at 0.243 s; they open again at 0.757 s. */
    ck_assert_double_ge(seen.first, 0.243);
    ck_assert_double_le(seen.first, 0.243 + 2 * FRAME);
    ck_assert_double_lt(seen.last_inside, 0.757 + 0.5);
    ck_assert_int_eq(drape_sim_relaxed(s.sim, 0, NULL), 0);
    /* One attempt fails when the balls meet; an impact at 0.35 m/s with a distance of 1 mm may take some
     * more. */
    ck_assert_int_le((int)extra_attempts(&s, 84), 12);
    /* Between the balls, which have parted by 10 cm, the cloth hangs again. */
    for (int32_t i = 0; i < s.model->node_count; i++)
        ck_assert_double_lt(fabs(drape_sim_positions(s.sim)[3 * i + 2]), 0.05);
    bool warned = false;
    for (int i = 0; !warned && drape_sim_warning(s.sim, i, &warning); i++)
        warned = strcmp(warning.name, "no_room") == 0;
    ck_assert(warned);
    const drape_relaxed_total *total = drape_sim_relaxed_total(s.sim, 0);
    ck_assert_int_gt(total->most, 0);
    ck_assert_double_ge(total->seconds, 0.757 - 0.243 - FRAME);
    ck_assert_double_eq_tol(total->seconds, total->last - total->first, 1e-9); /* without a break */
    free(seen.named);
}

TEST(test_pinch)
{
    check_pinch("auto", "newton_k", true);
    check_pinch("relax", "newton_k", false);
    check_pinch("relax", "be", false);
}

/* "auto" without a time budget, and "stop" with one: the pair is named, and the sim stays where it was. */
static void check_stop(const char *policy, bool realtime)
{
    scoped_scene s = open_pinch(policy, "newton_k");
    drape_status status = DRAPE_OK;
    for (int f = 1; !status && f <= 30; f++)
        status = realtime ? drape_sim_advance_realtime(s.sim, FRAME, 1e9, NULL)
                          : drape_sim_advance(s.sim, f * FRAME);
    ck_assert_int_eq(status, DRAPE_E_STEP_TOO_SMALL);
    const char *message = drape_context_message(s.ctx);
    ck_assert_msg(strstr(message, "left") || strstr(message, "right"), "%s", message);
    ck_assert_msg(strstr(message, "no room there: with /contact/no_room \"relax\""), "%s", message);
    ck_assert_double_lt(drape_sim_time(s.sim), 0.25);
    ck_assert_int_eq(drape_sim_relaxed(s.sim, 0, NULL), 0);
}

TEST(test_stop)
{
    check_stop("auto", false);
    check_stop("stop", true);
}

/* Saved and restored while cloth is relaxed, and while it comes out, a run continues with the same bits. */
TEST(test_checkpoint)
{
    scoped_scene s = open_pinch("relax", "newton_k");
    for (int f = 1; f <= 66; f++) {
        scene_advance(&s, f * FRAME);
        if (f != 20 && f != 46)
            continue;
        ck_assert_int_gt(drape_sim_relaxed(s.sim, 0, NULL), 0);
        scoped_bytes saved = bytes_save(s.sim);
        scoped_scene other = open_pinch("relax", "newton_k");
        ck_assert_int_eq(drape_sim_restore_from(other.sim, saved.data, saved.size), DRAPE_OK);
        drape_relaxed a, b;
        const int32_t count = drape_sim_relaxed(s.sim, 0, &a);
        ck_assert_int_eq(drape_sim_relaxed(other.sim, 0, &b), count);
        ck_assert(a.node == b.node && a.collider == b.collider && a.depth == b.depth && a.since == b.since);
        for (int g = f + 1; g <= f + 6; g++)
            scene_advance(&other, g * FRAME);
        for (int g = f + 1; g <= f + 6; g++)
            scene_advance(&s, g * FRAME);
        f += 6;
        ck_assert_uint_eq(drape_sim_hash(s.sim), drape_sim_hash(other.sim));
    }
}

static void keep_line(void *user, drape_log_level level, const char *text)
{
    char *lines = user;
    (void)level;
    if (strstr(text, "room"))
        snprintf(lines + strlen(lines), 2000 - strlen(lines), "%s\n", text);
}

/* The log says once that cloth at a ball is relaxed, and once that it is not any more, with the times of the
 * summary; also if the run was saved in between and restored. */
TEST(test_log)
{
    char lines[2000] = "", line[200];
    scoped_scene s = open_pinch("relax", "newton_k"), other = open_pinch("relax", "newton_k");
    s.ctx->def.log = other.ctx->def.log = keep_line;
    s.ctx->def.log_user = other.ctx->def.log_user = lines;
    scene_advance(&s, 20 * FRAME);
    scoped_bytes saved = bytes_save(s.sim);
    ck_assert_int_eq(drape_sim_restore_from(other.sim, saved.data, saved.size), DRAPE_OK);
    scene_advance(&other, 84 * FRAME);
    int count = 0;
    for (const char *c = lines; (c = strchr(c, '\n')); c++)
        count++;
    ck_assert_msg(count == 4, "%s", lines);
    for (int32_t c = 0; c < 2; c++) {
        const drape_relaxed_total *total = drape_sim_relaxed_total(other.sim, c);
        const char *name = s.model->colliders[c].name;
        snprintf(line, sizeof line, "t=%.9g: no room for the cloth at %s:", total->first, name);
        ck_assert_msg(strstr(lines, line), "%s not in %s", line, lines);
        snprintf(line, sizeof line, "t=%.9g: the cloth at %s has room again;", total->last, name);
        ck_assert_msg(strstr(lines, line), "%s not in %s", line, lines);
    }
}

/* Two bodies close upon the cloth, and part at some time: half a second later nothing is inside them. Closes
 * the scene. Returns the largest depth. */
static double check_bodies(scene *s, double part)
{
    record seen = run(s, true, 84);
    ck_assert(seen.named[0] && seen.named[1]);
    ck_assert_double_lt(seen.strain, 0.1);
    ck_assert_double_lt(seen.last_inside, part + 0.5);
    ck_assert_int_eq(drape_sim_relaxed(s->sim, 0, NULL), 0);
    free(seen.named);
    scene_close(s);
    return seen.deepest;
}

/* A ball that is pressed 3 cm into a table through the cloth on it. */
TEST(test_table)
{
    scene s = scene_open(
        SHEET " 'colliders': [{'name': 'table', 'type': 'box', 'center': [0, -0.1, 0], 'size': [1, 0.2, 1],"
              " 'friction': 0.3}, {'name': 'ball', 'type': 'sphere', 'center': [0, 0.15, 0], 'radius': 0.1,"
              " 'friction': 0.3, 'track': [[0.2, [0,0,0]], [0.4, [0,-0.08,0]], [0.7, [0,-0.08,0]],"
              " [0.9, [0,0,0]]]}]," REST,
        "horizontal", 0.005, 0.25, "", "auto", "newton_k");
    ck_assert_double_le(check_bodies(&s, 0.775), 0.04); /* the ball leaves the table then */
}

/* Pins that are carried 6 cm into a ball and back: the cloth around them goes with them, and comes out. */
TEST(test_pins_inside)
{
    scoped_scene s = scene_open(
        SHEET " 'colliders': [{'name': 'ball', 'type': 'sphere', 'center': [0, 0.25, -0.12],"
              " 'radius': 0.1}]," REST,
        "vertical", 0.5, 0.0,
        CORNERS ", {'nodes': [84], 'track': [[0.1, [0,0,0]], [0.4, [0,0,-0.08]], [0.7, [0,0,-0.08]],"
                " [1, [0,0,0]]]}",
        "auto", "newton_k");
    record seen = run(&s, true, 90);
    ck_assert(seen.named[0]);
    ck_assert_double_eq_tol(seen.deepest, 0.06, 1e-6); /* of the pin, whose place is given */
    ck_assert_double_lt(seen.last_inside, 0.925 + 0.5);
    ck_assert_int_eq(drape_sim_relaxed(s.sim, 0, NULL), 0);
    free(seen.named);
}

#define PLATE                                                                                                \
    "{'name': '%s', 'mesh': {'grid': 'square', 'columns': 6, 'rows': 6, 'width': 0.2, 'height': 0.2,"        \
    " 'orientation': 'vertical', 'transform': {'translate': [-0.1, 0.35, %g]}}, 'material': "                \
    "{'young_modulus'"                                                                                       \
    ": 1e6, 'thickness': 1e-3, 'density': 200}, 'terms': ['stretch.edge'], 'pins': [{'box': [[-1,-1,-1],"    \
    " [1,1,1]], 'track': [[0.1, [0,0,0]], [0.3, [0,0,%g]], [0.6, [0,0,%g]], [0.8, [0,0,0]]]}]}"

/* Pinned pieces of cloth that close upon free cloth have no inside, and pass through it. No geometry tells
 * that there is no room: what refuses the step is relaxed, after some attempts. It is held again where
 * they are farther away than layers are kept, on whichever side. */
TEST(test_plates)
{
    scoped_scene s = scene_open(
        "{'drape': 1, 'cloth': [{'name': 'sheet', 'mesh': {'grid': 'square', 'columns': 13, 'rows': 13,"
        " 'width': 0.5, 'height': 0.5, 'orientation': 'vertical', 'transform': {'translate':"
        " [-0.25, 0.5, 0]}}, 'material': {'young_modulus': 1e6, 'thickness': 1e-3, 'density': 200},"
        " 'terms': ['stretch.edge', 'bend.hinge'], 'pins': [" CORNERS "]}, " PLATE ", " PLATE "],"
        " 'self_contact': {'thickness': 0.002}," REST,
        "back", -0.06, 0.07, 0.07, "front", 0.06, -0.07, -0.07, "auto", "newton_k");
    int32_t most = 0;
    for (int f = 1; f <= 84; f++) {
        drape_realtime report;
        drape_relaxed r;
        const drape_status status = drape_sim_advance_realtime(s.sim, FRAME, 1e9, &report);
        ck_assert_msg(status == DRAPE_OK, "frame %d: %s", f, drape_context_message(s.ctx));
        ck_assert_double_eq_tol(drape_sim_time(s.sim), f * FRAME, 1e-9);
        most = report.relaxed > most ? report.relaxed : most;
        if (drape_sim_relaxed(s.sim, 0, &r) > 0)
            ck_assert(r.collider == -1 && strcmp(r.name, "self_contact") == 0 && r.depth == 0);
    }
    ck_assert_int_gt(most, 0);
    ck_assert_int_eq(drape_sim_relaxed(s.sim, 0, NULL), 0);
}
