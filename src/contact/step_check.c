/* step_check.c: checks whether the end of a step is allowed: penetration and collisions. See contact.h. */
#include "contact/contact_parts.h"

#include "base/clock.h"
#include "base/pi.h"
#include "base/reason.h"
#include "base/vec3.h"

#include <float.h>
#include <math.h>
#include <string.h>

/* ---- Depth in a convex collider ---- */

/*
 * How deep a whole edge or face of cloth is inside a convex collider whose points and segments lie inside its
 * curved surface (drape_collider_shape.inscribed), for which pairs do not suffice. The signed distance of a
 * convex body is a convex function, so it lies above all its tangents on a segment: the tangents at two
 * points on either side of its minimum intersect below it, and the next point is that of the intersection.
 */

/* The distance at a point of a segment, and its derivative along it. */
typedef struct tangent {
    double t, d, slope;
} tangent;

static tangent tangent_at(const drape_collider *collider, const drape_collider_pose *pose, const double *a,
                          const double *u, double t)
{
    double x[3] = {a[0], a[1], a[2]}, n[3];
    vec3_add_scaled(t, u, x);
    tangent at = {.t = t, .d = drape_collider_distance(collider, pose, x, n, NULL)};
    at.slope = vec3_dot(n, u);
    return at;
}

/* The smallest signed distance [m] between a and b or, if that is larger than `enough`, a value between
 * `enough` and it. Two tangents intersect at a lower bound of it: the search ends when the distance there is
 * this bound, or when rounding leaves no place between the two points. */
static double depth_of_edge(const drape_collider *collider, const drape_collider_pose *pose, const double *a,
                            const double *b, double enough)
{
    double u[3];
    vec3_sub(b, a, u);
    tangent low = tangent_at(collider, pose, a, u, 0), high = tangent_at(collider, pose, a, u, 1);
    double least = fmin(low.d, high.d);
    while (low.slope < 0 && high.slope > 0) {
        double t = (high.d - high.slope * high.t - low.d + low.slope * low.t) / (low.slope - high.slope);
        double bound = low.d + low.slope * (t - low.t);
        if (bound > enough)
            return bound;
        if (!(bound < least && t > low.t && t < high.t))
            return least;
        tangent at = tangent_at(collider, pose, a, u, t);
        least = fmin(least, at.d);
        *(at.slope < 0 ? &low : &high) = at;
    }
    return least;
}

/* The smallest distance on the line that joins the points of the sides 0 1 and 0 2 at the share s of their
 * lengths. */
static double depth_across(const drape_collider *collider, const drape_collider_pose *pose,
                           const double *const corner[3], double s)
{
    double end[2][3], side[3];
    for (int i = 0; i < 2; i++) {
        memcpy(end[i], corner[0], sizeof end[i]);
        vec3_sub(corner[i + 1], corner[0], side);
        vec3_add_scaled(s, side, end[i]);
    }
    return depth_of_edge(collider, pose, end[0], end[1], INFINITY);
}

/* The same on a triangle (three corners). The minimum on a line parallel to side 1 2 is a convex function
 * of s, minimised by golden section (Kiefer 1953), until values beside a minimum differ by rounding alone:
 * at the root of epsilon. */
static double depth_of_face(const drape_collider *collider, const drape_collider_pose *pose,
                            const double *const corner[3], double enough)
{
    const double golden = (sqrt(5) - 1) / 2;
    double low = 0, high = 1, d[2], sides[3], length = 0;
    /* The whole triangle is above `enough` if the tangent plane at some corner is. */
    for (int i = 0; i < 3; i++) {
        double n[3], to[3], distance = drape_collider_distance(collider, pose, corner[i], n, NULL),
                            least = distance;
        for (int j = 0; j < 3; j++) {
            vec3_sub(corner[j], corner[i], to);
            least = fmin(least, distance + vec3_dot(n, to));
        }
        if (least > enough)
            return INFINITY;
    }
    for (int i = 1; i < 3; i++) {
        vec3_sub(corner[i], corner[0], sides);
        length = fmax(length, vec3_norm(sides)); /* bounds the change of the distance with s */
    }
    for (int i = 0; i < 2; i++)
        d[i] = depth_across(collider, pose, corner, i ? golden : 1 - golden);
    double least = fmin(d[0], d[1]);
    while (high - low > sqrt(DBL_EPSILON) && least - length * (high - low) <= enough) {
        double width = golden * (high - low);
        bool left = d[0] < d[1];
        *(left ? &high : &low) = left ? low + width : high - width;
        width = golden * (high - low);
        d[left] = d[!left];
        d[!left] = depth_across(collider, pose, corner, left ? high - width : low + width);
        least = fmin(least, d[!left]);
    }
    return least;
}

/* The smallest distance of an edge (two nodes) or a face (three) of cloth; `enough` as in depth_of_edge. */
static double depth_of(const drape_collider *collider, const drape_collider_pose *pose, const double *x,
                       const int32_t *node, int nodes, double enough)
{
    const double *corner[3];
    for (int a = 0; a < nodes; a++)
        corner[a] = x + 3 * (size_t)node[a];
    return nodes == 2 ? depth_of_edge(collider, pose, corner[0], corner[1], enough)
                      : depth_of_face(collider, pose, corner, enough);
}

/* ---- Refusals ---- */

static drape_diagnostic diagnostic_of(const drape_contact *c, const drape_pair *pair, const char *what,
                                      double value, double limit)
{
    const bool collider = pair->collider >= 0;
    drape_diagnostic found = {.what = what,
                              .term = collider ? c->model->colliders[pair->collider].name : "self_contact",
                              .element = collider ? pair->collider : 0,
                              .node = {-1, -1, -1, -1},
                              .value = value,
                              .limit = limit};
    int count = 0;
    for (int a = 0; a < 4; a++)
        if (pair->node[a] >= 0 && pair->node[a] < c->model->node_count)
            found.node[count++] = pair->node[a];
    found.cloth = drape_model_cloth_of(c->model, found.node[0]);
    return found;
}

/* What a check says: which reason, and where. */
typedef struct verdict {
    drape_reason *reason;
    drape_diagnostic *diagnostic;
} verdict;

/* Refuses a step because of a pair, which may be one to exempt. */
static drape_status refuse(drape_contact *c, const drape_pair *pair, const verdict *to, drape_reason reason,
                           double value, double limit)
{
    c->refused = true;
    c->refusing = *pair;
    *to->reason = reason;
    *to->diagnostic = diagnostic_of(
        c, pair, reason == DRAPE_REASON_COLLISION ? "fraction of the step before passing through" : "gap [m]",
        value, limit);
    return DRAPE_RETRY_REJECTED;
}

/* ---- The end of a step ---- */

/* The gap that a pair may end with. If it began below the least gap it may not come nearer, but for rounding,
 * by which it may not lose its side however many steps there are. */
static double allowed(double least, double before, double rounding)
{
    const double nearer = before - rounding;
    if (before >= least)
        return least;
    return drape_gap_has_side(before, rounding) ? fmax(nearer, DRAPE_NO_SIDE * rounding) : nearer;
}

/* Finds the pair whose gap is below what it may end with by most. Where several features of a collider are
 * inside (only gaps with a collider can be negative), pushing one out can push another one in: none may be
 * deeper than the deepest of them was. */
static drape_status check_gaps(drape_contact *c, const verdict *to)
{
    const drape_configuration start = {.model = c->model, .x = c->start, .pose = c->start_pose};
    drape_status status = DRAPE_OK;
    double excess = 0;
    for (int32_t i = 0; i < c->active.near_count; i++) {
        const drape_pair *pair = &c->active.near[i].pair;
        const double gap = c->active.near[i].gap;
        double least = drape_pair_least_gap(pair, c->broad.rounding);
        if (gap >= least)
            continue;
        const double before = drape_pair_gap_value(pair, &start);
        if (before < least)
            least = allowed(least, before < 0 ? fmin(before, c->start_least[pair->collider]) : before,
                            c->broad.rounding);
        if (gap >= least || least - gap < excess)
            continue;
        excess = least - gap;
        status = refuse(c, pair, to, DRAPE_REASON_PENETRATION, gap, least);
    }
    return status;
}

/* Checks edges or faces of cloth against the curved surfaces of shapes whose features lie inside these
 * surfaces (inscribed). A piece that began nearer than the least gap, or inside, may not come nearer. */
static drape_status check_inscribed(drape_contact *c, const int32_t *node, int nodes, int32_t count,
                                    const verdict *to)
{
    const double least = drape_contact_least_gap(c);
    for (int32_t k = 0; k < c->model->collider_count; k++) {
        const drape_collider *collider = &c->model->colliders[k];
        for (int32_t i = 0; collider->shape.inscribed && i < count; i++) {
            const int32_t *n = node + (size_t)i * (size_t)nodes;
            const double depth = depth_of(collider, &c->pose[k], c->x, n, nodes, least);
            if (depth >= least || drape_contact_lets_in(c, k, n, nodes))
                continue;
            const double before = depth_of(collider, &c->start_pose[k], c->start, n, nodes, INFINITY),
                         min_gap = allowed(least, before, c->broad.rounding);
            const drape_pair pair = {
                .kind = DRAPE_PAIR_SEGMENTS, .collider = k, .node = {n[0], n[1], nodes > 2 ? n[2] : -1, -1}};
            if (depth < min_gap)
                return refuse(c, &pair, to, DRAPE_REASON_PENETRATION, depth, min_gap);
        }
    }
    return DRAPE_OK;
}

/* ---- The path of a step ---- */

/* How far points may stray from the straight in a piece of the path, in margins of the candidates. */
#define MAX_STRAY 0.25

/* The end of the piece of the path that begins at `at`, at most t. On a piece nodes move straight, and
 * colliders turn about one axis while their pivots move straight (c->swing). */
static double end_of_piece(const drape_contact *c, double at, double t)
{
    const double end = drape_motion_next_kink(c->motion, at, t);
    double pieces = 1;
    for (int32_t k = 0; k < c->model->collider_count; k++) {
        const double angle = drape_motion_turns_collider(c->motion, k)
                                 ? drape_motion_fastest_spin(c->motion, k, at, end) * (end - at)
                                 : 0; /* if it turned all the time; the next piece is computed anew */
        const double stray = drape_contact_stray(&c->model->colliders[k], angle);
        /* at most a quarter turn: between two poses, a collider turns by the smaller angle */
        pieces =
            fmax(pieces,
                 ceil(fmax(angle / (DRAPE_PI / 2), sqrt(stray / (MAX_STRAY * c->step_candidates.margin)))));
    }
    return pieces > 1 ? at + (end - at) / pieces : end;
}

/* Nodes and smooth surfaces on a piece of the path. */
static drape_status check_surfaces(drape_contact *c, const drape_straight_path *piece, const verdict *to)
{
    const drape_configuration *from = &piece->end[0], *until = &piece->end[1];
    const drape_keep keep = drape_contact_keep_step(c);
    const double least = drape_contact_least_gap(c);
    for (int32_t k = 0; k < c->model->collider_count; k++)
        for (int32_t i = 0; c->model->colliders[k].ops->smooth && i < c->model->free_count; i++) {
            const int32_t node = c->model->node_of_free[i];
            const size_t at = 3 * (size_t)node;
            /* A node that moves straight in the coordinates of a collider keeps the least gap on its path if
             * it surely keeps it at both ends. */
            bool away = !c->swing[k].turns;
            for (int end = 0; away && end < 2; end++) {
                double own[3];
                drape_pose_own(&piece->end[end].pose[k], piece->end[end].x + at, own);
                away = drape_distant_keeps(&c->broad.distant, k, node, own, least);
            }
            if (away || drape_contact_lets_in(c, k, &node, 1))
                continue;
            const double fraction = drape_contact_march(c, k, &from->pose[k], &until->pose[k], &c->swing[k],
                                                        from->x + at, until->x + at, &keep);
            const drape_pair pair = drape_broad_phase_surface(&c->broad, node, k);
            if (fraction < 1)
                return refuse(c, &pair, to, DRAPE_REASON_COLLISION, fraction, 1);
        }
    return DRAPE_OK;
}

/* Pairs of features on a piece of the path. */
static drape_status check_features(drape_contact *c, const drape_straight_path *piece, const verdict *to)
{
    const drape_keep keep = drape_contact_keep_step(c);
    drape_pair limiting;
    const double fraction =
        drape_contact_free_fraction(c, piece, c->swing, &keep, NULL, NULL, NULL, NULL, &limiting);
    return fraction < 1 ? refuse(c, &limiting, to, DRAPE_REASON_COLLISION, fraction, 1) : DRAPE_OK;
}

/* Checks the path from the beginning of the step to where contact is evaluated, at time t: piece by piece
 * between the kinks of tracks, in which no collider turns far. Free nodes go straight from one end to the
 * other, pins and colliders follow their tracks. */
static drape_status check_path(drape_contact *c, double t, bool surfaces, const verdict *to)
{
    double *const x[] = {c->from, c->to}, at = c->start_t;
    drape_collider_pose *const pose[] = {c->path_pose, c->kink_pose};
    drape_straight_path piece = {.end[1] = {.model = c->model, .x = c->start, .pose = c->start_pose}};
    drape_status status = DRAPE_OK;
    bool last = false;
    for (int i = 0; !status && !last; i = !i) {
        piece.end[0] = piece.end[1];
        at = end_of_piece(c, at, t);
        last = !(at < t);
        if (!last) {
            const double share = (at - c->start_t) / (t - c->start_t);
            for (size_t k = 0; k < 3 * (size_t)c->model->node_count; k++)
                x[i][k] = (1 - share) * c->start[k] + share * c->x[k];
            drape_motion_place_pins(c->motion, at, x[i]);
            drape_contact_poses(c, at, pose[i]);
            drape_contact_fill(c, x[i], pose[i], x[i]);
        }
        piece.end[1] = (drape_configuration){
            .model = c->model, .x = last ? c->x : x[i], .pose = last ? c->pose : pose[i]};
        for (int32_t k = 0; k < c->model->collider_count; k++) {
            drape_swing_between(&piece.end[0].pose[k], &piece.end[1].pose[k], c->model->colliders[k].pivot,
                                &c->swing[k]);
            /* the points of a collider that deforms move straight in space on a piece, which is short */
            c->swing[k].turns = c->swing[k].turns && !c->deformed[k];
        }
        status = surfaces ? check_surfaces(c, &piece, to) : DRAPE_OK;
        if (!status)
            status = check_features(c, &piece, to);
    }
    return status;
}

/* ---- Checks ---- */

static drape_status update_at(drape_contact *c, const double *x, double t)
{
    return drape_contact_update(c, &(drape_contact_at){.x = x, .t = t, .span = {t, t}});
}

bool drape_contact_crosses(drape_contact *c, const double *x, double t, drape_reason *reason,
                           drape_diagnostic *diagnostic)
{
    const double start = drape_clock_seconds();
    const verdict to = {reason, diagnostic};
    c->out_of_memory = update_at(c, x, t) != DRAPE_OK;
    const bool crosses = c->out_of_memory || check_gaps(c, &to) || check_path(c, t, false, &to);
    c->seconds += drape_clock_seconds() - start;
    return crosses;
}

drape_status drape_contact_check(drape_contact *c, const double *x, double t, drape_reason *reason,
                                 drape_diagnostic *diagnostic)
{
    const double start = drape_clock_seconds();
    const drape_model *m = c->model;
    const verdict to = {reason, diagnostic};
    drape_status status = update_at(c, x, t);
    if (!status)
        status = check_gaps(c, &to);
    if (!status)
        status = check_inscribed(c, m->edge, 2, m->edge_count, &to);
    if (!status)
        status = check_inscribed(c, m->triangle, 3, m->triangle_count, &to);
    if (!status)
        status = check_path(c, t, true, &to);
    if (!status)
        status = drape_contact_take_failure(c);
    c->seconds += drape_clock_seconds() - start;
    return status;
}

bool drape_contact_nearest(const drape_contact *c, drape_diagnostic *diagnostic)
{
    const drape_near_pair *nearest = NULL;
    for (int32_t i = 0; i < c->active.near_count; i++)
        if (!nearest || c->active.near[i].gap < nearest->gap)
            nearest = &c->active.near[i];
    const drape_pair *pair = nearest ? &nearest->pair : NULL;
    double gap = nearest ? nearest->gap : INFINITY;
    for (int32_t i = 0; !nearest && i < c->active.count; i++) {
        const drape_active_contact *contact = &c->active.contacts[i];
        if (!(contact->exempt > 0) && contact->gap.value < gap) {
            pair = &contact->pair;
            gap = contact->gap.value;
        }
    }
    if (pair)
        *diagnostic = diagnostic_of(c, pair, "gap [m]", gap, drape_pair_least_gap(pair, c->broad.rounding));
    return pair;
}
