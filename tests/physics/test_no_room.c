/*
 * test_no_room.c: bodies that leave cloth no room. With contact/no_room "relax", and with "auto" in real
 * time, no step fails for good, time goes on at the steps that were asked for, the report names the
 * bodies, the rest of the cloth is not strained, and once there is room nothing is inside any more. With
 * "stop" the run stops and names the pair.
 */
#include "base/vec3.h"
#include "realtime/report.h"
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
    bool *relaxed = calloc((size_t)m->node_count, sizeof *relaxed),
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
    free(relaxed);
    free(around);
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
    scene s = open_pinch(policy, method);
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
    scene_close(&s);
}

START_TEST(test_pinch)
{
    check_pinch("auto", "newton_k", true);
    check_pinch("relax", "newton_k", false);
    check_pinch("relax", "be", false);
}
END_TEST

/* "auto" without a time budget, and "stop" with one: the pair is named, and the sim stays where it was. */
static void check_stop(const char *policy, bool realtime)
{
    scene s = open_pinch(policy, "newton_k");
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
    scene_close(&s);
}

START_TEST(test_stop)
{
    check_stop("auto", false);
    check_stop("stop", true);
}
END_TEST

/* Saved and restored while cloth is relaxed, and while it comes out, a run continues with the same bits. */
START_TEST(test_checkpoint)
{
    scene s = open_pinch("relax", "newton_k");
    for (int f = 1; f <= 66; f++) {
        scene_advance(&s, f * FRAME);
        if (f != 20 && f != 46)
            continue;
        ck_assert_int_gt(drape_sim_relaxed(s.sim, 0, NULL), 0);
        bytes saved = bytes_save(s.sim);
        scene other = open_pinch("relax", "newton_k");
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
        free(saved.data);
        scene_close(&other);
    }
    scene_close(&s);
}
END_TEST

static void keep_line(void *user, drape_log_level level, const char *text)
{
    char *lines = user;
    (void)level;
    if (strstr(text, "room"))
        snprintf(lines + strlen(lines), 2000 - strlen(lines), "%s\n", text);
}

/* The log says once that cloth at a ball is relaxed, and once that it is not any more, with the times of the
 * summary; also if the run was saved in between and restored. */
START_TEST(test_log)
{
    char lines[2000] = "", line[200];
    scene s = open_pinch("relax", "newton_k"), other = open_pinch("relax", "newton_k");
    s.ctx->def.log = other.ctx->def.log = keep_line;
    s.ctx->def.log_user = other.ctx->def.log_user = lines;
    scene_advance(&s, 20 * FRAME);
    bytes saved = bytes_save(s.sim);
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
    free(saved.data);
    scene_close(&other);
    scene_close(&s);
}
END_TEST

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
START_TEST(test_table)
{
    scene s = scene_open(
        SHEET " 'colliders': [{'name': 'table', 'type': 'box', 'center': [0, -0.1, 0], 'size': [1, 0.2, 1],"
              " 'friction': 0.3}, {'name': 'ball', 'type': 'sphere', 'center': [0, 0.15, 0], 'radius': 0.1,"
              " 'friction': 0.3, 'track': [[0.2, [0,0,0]], [0.4, [0,-0.08,0]], [0.7, [0,-0.08,0]],"
              " [0.9, [0,0,0]]]}]," REST,
        "horizontal", 0.005, 0.25, "", "auto", "newton_k");
    ck_assert_double_le(check_bodies(&s, 0.775), 0.04); /* the ball leaves the table then */
}
END_TEST

/* Pins that are carried 6 cm into a ball and back: the cloth around them goes with them, and comes out. */
START_TEST(test_pins_inside)
{
    scene s = scene_open(SHEET " 'colliders': [{'name': 'ball', 'type': 'sphere', 'center': [0, 0.25, -0.12],"
                               " 'radius': 0.1}]," REST,
                         "vertical", 0.5, 0.0,
                         CORNERS
                         ", {'nodes': [84], 'track': [[0.1, [0,0,0]], [0.4, [0,0,-0.08]], [0.7, [0,0,-0.08]],"
                         " [1, [0,0,0]]]}",
                         "auto", "newton_k");
    record seen = run(&s, true, 90);
    ck_assert(seen.named[0]);
    ck_assert_double_eq_tol(seen.deepest, 0.06, 1e-6); /* of the pin, whose place is given */
    ck_assert_double_lt(seen.last_inside, 0.925 + 0.5);
    ck_assert_int_eq(drape_sim_relaxed(s.sim, 0, NULL), 0);
    free(seen.named);
    scene_close(&s);
}
END_TEST

/* An elbow: an arm of one capsule, and a forearm of balls that turn about its end to 150 degrees and back,
 * with a sheet that lies over both, held by friction. */
static int print_forearm(char *text, size_t size)
{
    const double pi = 3.14159265358979323846;
    int used = 0;
    for (int k = 1; k <= 6; k++) {
        const double d = 0.04 * k;
        used += snprintf(text + used, size - (size_t)used,
                         ", {'name': 'forearm %d', 'type': 'sphere', 'center': [%g, 0, 0], 'radius': 0.04,"
                         " 'friction': 1, 'track': [",
                         k, d);
        for (int i = 0; i <= 20; i++) {
            const double a = pi * 15 * (i <= 10 ? i : 20 - i) / 180;
            used += snprintf(text + used, size - (size_t)used, "%s[%g, [%.6g,%.6g,0]]", i ? "," : "",
                             0.1 + 0.1 * i + (i > 10 ? 0.2 : 0), d * cos(a) - d, d * sin(a));
        }
        used += snprintf(text + used, size - (size_t)used, "]}");
    }
    return used;
}

START_TEST(test_elbow)
{
    char forearm[6000];
    ck_assert_int_lt(print_forearm(forearm, sizeof forearm), (int)sizeof forearm);
    scene s = scene_open(
        "{'drape': 1, 'cloth': [{'name': 'sheet', 'mesh': {'grid': 'square', 'columns': 13, 'rows': 13,"
        " 'width': 0.3, 'height': 0.3, 'transform': {'translate': [-0.15, 0.05, 0.15]}},"
        " 'material': {'young_modulus': 1e6, 'thickness': 1e-3, 'density': 200},"
        " 'terms': ['stretch.edge', 'bend.hinge'], 'pins': [{'edge': 'left'}]}],"
        " 'colliders': [{'name': 'arm', 'type': 'capsule', 'a': [-0.3, 0, 0], 'b': [0, 0, 0],"
        " 'radius': 0.04, 'friction': 1}%s],"
        " 'contact': {'distance': 0.005, 'friction': 'lagged'},"
        " 'integrator': {'method': 'newton_k', 'dt': 0.0166666666666666667, 'iterations': 2},"
        " 'duration': 3}",
        forearm);
    record seen = run(&s, true, 168);
    ck_assert(seen.named[0]);
    ck_assert_int_ge(seen.most, 1); /* how many have no room depends on how the sheet is caught */
    ck_assert_double_lt(seen.strain, 0.1);
    ck_assert_double_lt(seen.last_inside, 2.3 + 0.5); /* the arm is straight again at 2.3 s */
    ck_assert_int_eq(drape_sim_relaxed(s.sim, 0, NULL), 0);
    free(seen.named);
    scene_close(&s);
}
END_TEST

/* Cloth that falls into the crevice of two balls which overlap has room: nothing is relaxed. */
START_TEST(test_crevice)
{
    scene s = scene_open(SHEET " 'colliders': [{'type': 'sphere', 'center': [-0.1, 0, 0], 'radius': 0.13},"
                               " {'type': 'sphere', 'center': [0.1, 0, 0], 'radius': 0.13}]," REST,
                         "horizontal", 0.18, 0.25, "", "auto", "newton_k");
    record seen = run(&s, true, 60);
    ck_assert_int_eq(seen.most, 0);
    ck_assert_double_lt(seen.last_inside, 0);
    free(seen.named);
    scene_close(&s);
}
END_TEST

/* Boxes, whose edges have no radius to tell on which side the cloth belongs. */
START_TEST(test_boxes)
{
    scene s = scene_open(
        SHEET " 'colliders': [{'name': 'left', 'type': 'box', 'center': [0, 0.25, -0.15],"
              " 'size': [0.2, 0.2, 0.2], 'track': [[0.1, [0,0,0]], [0.3, [0,0,0.07]],"
              " [0.7, [0,0,0.07]], [0.9, [0,0,0]]]},"
              " {'name': 'right', 'type': 'box', 'center': [0, 0.25, 0.15], 'size': [0.2, 0.2, 0.2],"
              " 'track': [[0.1, [0,0,0]], [0.3, [0,0,-0.07]], [0.7, [0,0,-0.07]], [0.9, [0,0,0]]]}]," REST,
        "vertical", 0.5, 0.0, CORNERS, "auto", "newton_k");
    check_bodies(&s, 0.757);
}
END_TEST

/* A sharp and a rounded box, both turned, close upon light and stiff cloth until they overlap by up to 20 cm,
 * and part. The pressure on what has come out grows and falls, and so does the stiffness of contact: the
 * energy that this adds is work of the bodies, so backward Euler never gains any. The account is exact but
 * for what single iterations leave, which is taken back from the motion; they may leave a hundredth of what
 * the bodies have worked. */
START_TEST(test_turned_boxes)
{
    scene s = scene_open(
        "{'drape': 1, 'cloth': [{'name': 'sheet', 'mesh': {'grid': 'square', 'columns': 20, 'rows': 20,"
        " 'width': 0.5, 'height': 0.5, 'orientation': 'vertical', 'transform': {'translate': [-0.25, 0.5,"
        " 0]}}, 'material': {'young_modulus': 2.5e7, 'thickness': 8e-4, 'areal_density': 0.04}, 'terms':"
        " ['stretch.edge', 'bend.hinge'], 'pins': [" CORNERS "]}], 'colliders': ["
        " {'name': 'left', 'type': 'box', 'center': [0, 0.185, -0.277], 'size': [0.241, 0.241, 0.241],"
        " 'rotate': [-0.281, 0.984, 0.3, 20.2], 'friction': 0.3, 'track': [[0.1, [0,0,0]], [0.24,"
        " [0,0,0.186]], [0.67, [0,0,0.186]], [0.89, [0,0,0]]]},"
        " {'name': 'right', 'type': 'box', 'center': [0, 0.197, 0.3], 'size': [0.266, 0.266, 0.266],"
        " 'rotate': [-0.19, -0.547, 0.3, 30.4], 'rounding': 0.04, 'friction': 0.3, 'track': [[0.1, [0,0,0]],"
        " [0.24, [0,0,-0.226]], [0.67, [0,0,-0.226]], [0.89, [0,0,0]]]}],"
        " 'integrator': {'method': 'newton_k', 'dt': 0.0166666666666666667}, 'duration': 3}");
    record seen = {.named = calloc(2, sizeof *seen.named), .last_inside = -1};
    for (int f = 1; f <= 101; f++) {
        const drape_status status = drape_sim_advance_realtime(s.sim, FRAME, 1e9, NULL);
        ck_assert_msg(status == DRAPE_OK, "frame %d: %s", f, drape_context_message(s.ctx));
        ck_assert_double_eq_tol(drape_sim_time(s.sim), f * FRAME, 1e-9);
        const drape_energy e = drape_sim_energy(s.sim);
        ck_assert_double_ge(e.numerical, -0.01 * s.sim->audit.offered);
        look(&s, &seen);
    }
    ck_assert(seen.named[0] && seen.named[1]);
    ck_assert_double_lt(seen.strain, 0.1);
    ck_assert_double_lt(seen.last_inside, 0.89 + 0.5);
    free(seen.named);
    scene_close(&s);
}
END_TEST

#define PLATE                                                                                                \
    "{'name': '%s', 'mesh': {'grid': 'square', 'columns': 6, 'rows': 6, 'width': 0.2, 'height': 0.2,"        \
    " 'orientation': 'vertical', 'transform': {'translate': [-0.1, 0.35, %g]}}, 'material': "                \
    "{'young_modulus'"                                                                                       \
    ": 1e6, 'thickness': 1e-3, 'density': 200}, 'terms': ['stretch.edge'], 'pins': [{'box': [[-1,-1,-1],"    \
    " [1,1,1]], 'track': [[0.1, [0,0,0]], [0.3, [0,0,%g]], [0.6, [0,0,%g]], [0.8, [0,0,0]]]}]}"

/* Pinned pieces of cloth that close upon free cloth have no inside, and pass through it. No geometry tells
 * that there is no room: what refuses the step is relaxed, after some attempts. It is held again where
 * they are farther away than layers are kept, on whichever side. */
START_TEST(test_plates)
{
    scene s = scene_open(
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
    scene_close(&s);
}
END_TEST

/* A strip whose last row lies 0.05 activation distances from its pinned row and, if there is a ball, from
 * that. What holds a step up that fails may be either: bodies, which come out again, are let in, and cloth
 * through pinned cloth only where there are none. */
START_TEST(test_bodies_first)
{
    for (int ball = 0; ball < 2; ball++) {
        scene s = scene_open(
            "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 3, 'rows': 8, 'width': 0.08, "
            "'height':"
            " 0.28, 'orientation': 'vertical'}, 'material': {'young_modulus': 1e6, 'thickness': 1e-3, "
            "'density':"
            " 200}, 'terms': ['stretch.edge'], 'pins': [{'row': 0}]}], 'self_contact': {'thickness': 0.004},"
            " 'contact': {'distance': 0.004}, 'colliders': [{'type': 'sphere', 'center': [0.04, %g, 0.02], "
            "'radius':"
            " 0.0194}], 'integrator': {'method': 'newton_k'}, 'duration': 3}",
            ball ? 0. : 3.);
        const int32_t n = s.model->node_count;
        double x[3 * 24], v[3 * 24] = {0};
        int32_t added = 0;
        ck_assert_int_eq(n, 24);
        memcpy(x, s.model->start, sizeof x);
        for (int32_t i = 3; i < n; i++) { /* a loop, down and up to the pinned row again */
            const double turn = acos(-1) * (i / 3) / 3.5;
            x[3 * i + 1] = x[1] - 0.06 * sin(turn / 2);
            x[3 * i + 2] = x[2] - 0.02 * (1 - cos(turn));
        }
        for (int32_t i = 21; i < n; i++) {
            x[3 * i + 1] = x[1];
            x[3 * i + 2] = x[2] + 0.05 * 0.008;
        }
        ck_assert_int_eq(drape_sim_set_state(s.sim, 0, x, v), DRAPE_OK);
        drape_contact *contact = drape_system_contact(s.sim->system);
        ck_assert_int_eq(drape_realtime_rescue.open(s.sim), DRAPE_OK);
        drape_room_expect(contact, 1. / 60, true);
        ck_assert_int_eq(drape_system_begin(s.sim->system, drape_sim_state(s.sim)), DRAPE_OK);
        ck_assert_int_eq(drape_room_relax(contact, 1. / 60, DRAPE_RELAX_NEAR, &added), DRAPE_OK);
        ck_assert_int_gt(added, 0);
        for (int32_t i = 0; i < added; i++) {
            drape_relaxed r;
            ck_assert_int_eq(drape_sim_relaxed(s.sim, i, &r), added);
            ck_assert_int_eq(r.collider, ball ? 0 : -1);
        }
        scene_close(&s);
    }
}
END_TEST

/* Pinches, drawn at random, whose bodies pierce the cloth, or have parts of it near to different sides: with
 * the nearest surface as the end of their paths, it stays relaxed on them for good. */
static const struct pinch {
    double young, thickness, density;
    const char *stretch, *left, *right;
    double shut, opens, open; /* [s] end of closing, begin and end of parting */
    double travel;            /* [m] that each body goes to the other one */
} pinches[] = {
    {7.47097e6, 6.15364e-4, 292.161, "stretch.cst",
     "'type': 'box', 'center': [0.0277127, 0.204452, -0.126246], 'size': [0.169701, 0.171451, 0.11858],"
     " 'turns': [{'time': 0.1, 'rotate': [0,0,1,0]},"
     " {'time': 3, 'rotate': [-0.338586, 0.235483, 0.417988, 861.941]}]",
     "'type': 'capsule', 'a': [0.0577828, 0.164257, 0.183298], 'b': [0.0526154, 0.340716, 0.100654],"
     " 'radius': 0.0336974, 'turns': [{'time': 0.1, 'rotate': [0,0,1,0]},"
     " {'time': 3, 'rotate': [0.635405, -0.141371, -0.52235, -715.018]}]",
     0.331291, 0.787955, 0.984548, 0.113246},
    {1.69577e7, 8.00344e-4, 274.248, "stretch.edge",
     "'type': 'box', 'center': [-0.0490072, 0.175897, -0.162088], 'size': [0.193544, 0.0942329, 0.176673],"
     " 'turns': [{'time': 0.1, 'rotate': [0,0,1,0]},"
     " {'time': 1.04084, 'rotate': [0.202745, -0.43427, -0.301611, 210.22]}]",
     "'type': 'capsule', 'a': [-0.120246, 0.250363, 0.106286], 'b': [0.0158429, 0.0608485, 0.175795],"
     " 'radius': 0.0325349, 'turns': [{'time': 0.1, 'rotate': [0,0,1,0]},"
     " {'time': 1.04084, 'rotate': [0.5257, 0.421712, 0.0257092, -188.31]}]",
     0.390399, 0.715694, 1.04084, 0.117931},
    {1.50858e7, 5.65587e-4, 120.302, "stretch.edge",
     "'type': 'box', 'center': [0.0219487, 0.216593, -0.188937], 'size': [0.259615, 0.0882292, 0.240739]",
     "'type': 'box', 'center': [-0.0108892, 0.258648, 0.185511], 'size': [0.139277, 0.257066, 0.161735],"
     " 'rotate': [0.628583, 0.502356, -0.868571, 172.653]",
     0.491523, 0.602655, 0.844473, 0.0977127},
    {2.38299e6, 3.78911e-4, 302.702, "stretch.cst",
     "'type': 'sphere', 'center': [0.0864785, 0.349578, -0.169565], 'radius': 0.09213",
     "'type': 'capsule', 'a': [-0.0563209, 0.432332, 0.108267], 'b': [0.156765, 0.2401, 0.148321],"
     " 'radius': 0.0308319",
     0.442952, 0.613421, 0.946498, 0.119094},
};

static scene open_random(const struct pinch *p)
{
    char track[2][200];
    for (int i = 0; i < 2; i++) {
        const double z = i ? -p->travel : p->travel;
        snprintf(track[i], sizeof track[i],
                 "'track': [[0.1, [0,0,0]], [%.9g, [0,0,%.9g]], [%.9g, [0,0,%.9g]], [%.9g, [0,0,0]]]",
                 p->shut, z, p->opens, z, p->open);
    }
    return scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 12, 'rows': 12, 'width': 0.5,"
        " 'height': 0.5, 'orientation': 'vertical', 'transform': {'translate': [-0.25, 0.5, 0]}},"
        " 'material': {'young_modulus': %.9g, 'thickness': %.9g, 'density': %.9g},"
        " 'terms': ['%s', 'bend.hinge', {'type': 'drag.viscous', 'coefficient': 0.1}], 'pins': [" CORNERS
        "]}],"
        " 'colliders': [{'friction': 0.3, %s, %s}, {'friction': 0.3, %s, %s}],"
        " 'integrator': {'method': 'newton_k', 'dt': 0.0166666666666666667}, 'duration': 4}",
        p->young, p->thickness, p->density, p->stretch, p->left, track[0], p->right, track[1]);
}

/* Whether half a second after the bodies have parted, in which a node falls by 1.2 m, nothing is relaxed or
 * inside, and no edge is strained by 10 % or more. */
static bool comes_free(const struct pinch *p)
{
    scene s = open_random(p);
    const int parted = (int)ceil((p->open + 0.5) / FRAME);
    int32_t most = 0;
    bool is_free = true;
    for (int f = 1; f <= parted + 6; f++) {
        drape_realtime report;
        const drape_status status = drape_sim_advance_realtime(s.sim, FRAME, 1e9, &report);
        ck_assert_msg(status == DRAPE_OK, "frame %d: %s", f, drape_context_message(s.ctx));
        most = report.relaxed > most ? report.relaxed : most;
        if (f < parted)
            continue;
        is_free = is_free && report.relaxed == 0;
        for (int32_t e = 0; e < s.model->edge_count; e++) {
            const int32_t *n = s.model->edge + 2 * (size_t)e;
            const double *x = drape_sim_positions(s.sim);
            double to[3];
            vec3_sub(x + 3 * (size_t)n[1], x + 3 * (size_t)n[0], to);
            is_free = is_free && vec3_norm(to) / s.model->edge_length[e] - 1 < 0.1;
        }
        for (int32_t c = 0; c < s.model->collider_count; c++)
            is_free = is_free && drape_sim_inside(s.sim, c, NULL) == 0;
    }
    ck_assert_int_gt(most, 0);
    scene_close(&s);
    return is_free;
}

/* Which pinched cloth stays caught is a matter of small differences: one in forty of such pinches does
 * (docs/realtime.md), another one whenever the rounding changes. Of cloth that goes to the nearest surface,
 * that of all four does. */
START_TEST(test_entangled)
{
    int freed = 0;
    for (size_t i = 0; i < sizeof pinches / sizeof *pinches; i++)
        freed += comes_free(&pinches[i]);
    ck_assert_int_ge(freed, 3);
}
END_TEST

SUITE("no_room", test_pinch, test_stop, test_checkpoint, test_log, test_table, test_pins_inside, test_elbow,
      test_crevice, test_boxes, test_turned_boxes, test_plates, test_bodies_first, test_entangled)
