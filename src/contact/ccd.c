/* ccd.c: continuous collision detection: the step fraction of a straight displacement without collisions, and
 * what cloth could meet within some time. See contact.h. */
#include "contact/contact_parts.h"

#include "base/clock.h"
#include "base/vec3.h"

#include <float.h>
#include <string.h>

#define MAX_THROW 1.0 /* in mean edges: to what a displacement beyond the size of the scene is shortened */

/* A displacement of all points, and the first pair that limits it. */
typedef struct pursuit {
    const double *x, *y;        /* (points x 3) */
    const drape_swings *swings; /* NULL: no collider turns */
    double stray;               /* [m] how far points of colliders leave straight paths */
    const drape_keep *keep;
    double fraction; /* of pairs of features */
    double surface_fraction;
    drape_pair limiting;
    double *of_node;           /* (nodes) the smallest fraction of a pair at each node; NULL: not wanted */
    const double *before;      /* (nodes) pairs whose nodes all have 1 limit nothing; NULL: none is known */
    const drape_contact *c;    /* its exempt pairs limit nothing */
    bool surfaces;             /* smooth surfaces of colliders limit nodes, too */
    const atomic_bool *cancel; /* NULL: nothing ends the search early */
    bool cancelled;            /* pairs have been left out */
} pursuit;

/* Whether the gap of a pair falls below its activation distance on the path. A gap that just reaches this
 * distance may be missed. */
static bool comes_near(const pursuit *p, const drape_pair *pair, double gap)
{
    const double rounding = p->keep->rounding, least = drape_pair_least_gap(pair, rounding);
    const drape_keep near = {
        .rounding = rounding, .least = 1, .above = (DRAPE_ADVANCE * pair->distance - least) / (gap - least)};
    return gap < pair->distance || drape_pair_step_fraction(pair, p->x, p->y, p->swings, &near, 1) < 1;
}

/* Whether the candidates contain all nodes that a collider can limit: a node is limited only within the
 * activation distance of the scene (drape_contact_march). */
static bool lists_limits(const drape_contact *c, int32_t collider)
{
    return c->broad.distance[collider] >= c->model->contact.distance;
}

/* A node and the smooth surface of a collider that rests. */
static void follow_surface(const drape_contact *c, int32_t collider, int32_t node, pursuit *p)
{
    const size_t at = 3 * (size_t)node;
    const drape_collider_pose *pose = &c->path_pose[collider];
    if (!c->model->colliders[collider].ops->smooth || drape_contact_lets_in(c, collider, &node, 1))
        return;
    const double own = drape_contact_march(c, collider, pose, pose, NULL, p->x + at, p->y + at, p->keep);
    p->surface_fraction = fmin(p->surface_fraction, own);
    if (p->of_node)
        p->of_node[node] = fmin(p->of_node[node], own);
}

/* Follows a pair along the path. A pair that does not come near limits nothing, so it makes no difference
 * whether it is a candidate. Does not search beyond the step fraction that another pair leaves: if forces
 * throw nodes very far, a pair approaches so slowly relative to its speed that searching each to its own end
 * would take for ever. Of two pairs with the same fraction the one of lower rank counts, in whichever order
 * pairs come. */
static void follow(void *user, const drape_pair *pair)
{
    pursuit *p = user;
    const drape_configuration from = {.x = p->x};
    const int32_t nodes = p->c->model->node_count;
    const int points = drape_pair_points(pair);
    bool known = p->before; /* that the pair limits nothing */
    for (int k = 0; known && k < points; k++)
        known = pair->node[k] >= nodes || p->before[pair->node[k]] == 1;
    p->cancelled = p->cancelled || (p->cancel && atomic_load(p->cancel));
    if (p->cancelled || known)
        return;
    if (points == 1) {
        if (p->surfaces && lists_limits(p->c, pair->collider))
            follow_surface(p->c, pair->collider, pair->node[0], p);
        return;
    }
    if (drape_bound_is_apart(pair, p->x, p->y, pair->distance + pair->radius + p->stray) ||
        drape_exempt_factor(p->c->exempt, pair) > 0)
        return;
    const double limit = p->of_node ? 1 : fmin((1 + 4 * DBL_EPSILON) * p->fraction, 1);
    const double fraction = drape_pair_step_fraction(pair, p->x, p->y, p->swings, p->keep, limit);
    if (fraction >= limit || !comes_near(p, pair, drape_pair_gap_value(pair, &from)))
        return;
    for (int k = 0; p->of_node && k < 4; k++) /* what limits the displacement of each node */
        if (pair->node[k] < nodes)
            p->of_node[pair->node[k]] = fmin(p->of_node[pair->node[k]], fraction);
    if (fraction > p->fraction || (fraction == p->fraction && !drape_pair_is_before(pair, &p->limiting)))
        return;
    p->fraction = fraction;
    p->limiting = *pair;
}

static double longest_move(const pursuit *p)
{
    double largest = 0, move[3];
    for (size_t i = 0; i < (size_t)p->c->broad.points; i++) {
        vec3_sub(p->y + 3 * i, p->x + 3 * i, move);
        largest = fmax(largest, vec3_dot(move, move));
    }
    return sqrt(largest);
}

/* The candidates if they are valid although points stray from the path; else NULL. */
static const drape_candidates *with_stray(const drape_candidates *candidates, double stray,
                                          drape_distances *away)
{
    away->stray = stray;
    return candidates && drape_candidates_farthest(candidates, away) <= candidates->margin ? candidates
                                                                                           : NULL;
}

double drape_contact_stray(const drape_collider *collider, double angle)
{
    return collider->radius * angle * angle / 8; /* >= r (1 - cos(angle/2)) */
}

double drape_contact_free_fraction(drape_contact *c, const drape_straight_path *straight,
                                   const drape_swing *swing, const drape_keep *keep, double *of_node,
                                   double *of_surfaces, const double *before, const atomic_bool *cancel,
                                   drape_pair *limiting)
{
    const drape_swings swings = {.of = swing, .nodes = c->model->node_count};
    const bool only_least =
        keep->above == 0 && keep->arrival == 0; /* only gaps that fall to the least one limit */
    double stray = 0;
    for (int32_t k = 0; swing && k < c->model->collider_count; k++)
        stray =
            fmax(stray, swing[k].turns ? drape_contact_stray(&c->model->colliders[k], swing[k].angle) : 0);
    pursuit p = {.x = straight->end[0].x,
                 .y = straight->end[1].x,
                 .swings = swing ? &swings : NULL,
                 .stray = stray,
                 .keep = keep,
                 .fraction = 1,
                 .of_node = of_node,
                 .before = before,
                 .c = c,
                 .surface_fraction = 1,
                 .surfaces = of_surfaces,
                 .cancel = cancel};
    drape_distances away;
    drape_candidate_cursor cursor = {0};
    /* The candidates that are valid on the whole path; searched if there are none. NULL if the path is too
     * long for candidates, if only few pairs matter on it, or if memory is out: then pairs are followed as
     * they are found. */
    const drape_candidates *candidates =
        with_stray(drape_contact_valid_candidates(c, straight, &away), stray, &away);
    if (!candidates && !only_least && !(longest_move(&p) > DRAPE_LONGEST_SEARCH * c->mean_edge))
        candidates = with_stray(drape_contact_search(c, straight, &away), stray, &away);
    const drape_pair *pair;
    while (candidates && (pair = drape_candidates_next(candidates, &away, &cursor)))
        follow(&p, pair);
    if (!candidates) {
        const double start = drape_clock_seconds();
        drape_candidates_find(&c->broad, straight, stray / 2, only_least, NULL, follow, &p);
        c->search_seconds += drape_clock_seconds() - start;
    }
    for (int32_t k = 0; of_surfaces && k < c->model->collider_count; k++)
        for (int32_t i = 0; !lists_limits(c, k) && i < c->model->free_count; i++)
            if (!before || before[c->model->node_of_free[i]] < 1)
                follow_surface(c, k, c->model->node_of_free[i], &p);
    if (of_surfaces)
        *of_surfaces = p.surface_fraction;
    *limiting = p.limiting;
    return p.cancelled ? -1 : p.fraction;
}

drape_keep drape_contact_keep_step(const drape_contact *c)
{
    return (drape_keep){
        .rounding = c->broad.rounding, .least = DRAPE_KEPT_GAP, .below = DRAPE_KEPT_GAP, .core = true};
}

double drape_contact_least_gap(const drape_contact *c)
{
    const drape_pair pair = {.distance = c->model->contact.distance};
    return drape_pair_least_gap(&pair, c->broad.rounding);
}

/* The path of a node in a collider's own coordinates: straight, or by a swing. */
typedef struct own_path {
    const drape_swing *swing; /* NULL: straight */
    double x[3], move[3];     /* in space for a swing */
    double length;            /* [m] at most */
} own_path;

static double distance_on(const drape_collider *collider, const own_path *along, double t)
{
    double at[3];
    memcpy(at, along->x, sizeof at);
    if (along->swing)
        drape_swing_own(along->swing, along->x, along->move, t, at);
    else
        vec3_add_scaled(t, along->move, at);
    return collider->ops->distance(collider->values, &collider->shape, at, NULL, NULL);
}

/* Goes along the path in steps as long as the distance from the surface, none of which can cross it. */
double drape_contact_march(const drape_contact *c, int32_t k, const drape_collider_pose *from,
                           const drape_collider_pose *to, const drape_swing *swing, const double *x,
                           const double *y, const drape_keep *keep)
{
    const drape_collider *collider = &c->model->colliders[k];
    own_path along = {.swing = swing && swing->turns ? swing : NULL};
    if (along.swing) {
        memcpy(along.x, x, sizeof along.x);
        vec3_sub(y, x, along.move);
        along.length = drape_swing_speed(swing, along.x, along.move);
    } else {
        drape_pose_own(from, x, along.x);
        drape_pose_own(to, y, along.move);
        vec3_sub(along.move, along.x, along.move);
        along.length = vec3_norm(along.move);
    }
    double t = 0, gap = distance_on(collider, &along, 0);
    const double least = drape_contact_least_gap(c),
                 end = drape_keep_gap(keep, least, gap, c->model->contact.distance);
    const double length = along.length, slack = (1 - DRAPE_ADVANCE) * fmin(end, gap - end);
    if (!drape_gap_has_side(gap, keep->rounding) || !(length > gap - end))
        return 1;
    for (int i = 0; i < DRAPE_MAX_ADVANCES; i++) {
        t += DRAPE_ADVANCE * (gap - end) / length;
        if (t >= 1)
            return 1;
        gap = distance_on(collider, &along, t);
        if (gap <= end + slack)
            return t;
    }
    return t;
}

/* The longest displacement of a node relative to the mean displacement, which brings nothing together. */
static double farthest_throw(const drape_contact *c, const double *x, const double *y)
{
    const size_t nodes = (size_t)c->model->node_count;
    const double all = (double)drape_model_node_count(c->model);
    double largest = 0, mean[3] = {0}, move[3];
    for (size_t i = 0; i < 3 * nodes; i++)
        mean[i % 3] += drape_model_owns(c->model, (int32_t)(i / 3)) ? (y[i] - x[i]) / all : 0;
    if (c->ranks)
        c->ranks->sum(c->ranks, mean, 3);
    for (size_t i = 0; i < nodes; i++) {
        vec3_sub(y + 3 * i, x + 3 * i, move);
        vec3_sub(move, mean, move);
        largest = fmax(largest, vec3_dot(move, move));
    }
    return sqrt(drape_ranks_largest(c->ranks, largest));
}

/* The length [m] to which a correction is shortened, without a search for pairs, because it throws nodes
 * farther than the scene is large; INFINITY if it does not. Such a correction is of no use, and a search
 * among nodes that all go several edges in any direction would take many times as long as the rest of an
 * iteration. */
static double thrown_length(const drape_contact *c, double farthest)
{
    return farthest > c->model->length ? MAX_THROW * c->mean_edge : INFINITY;
}

double drape_contact_step_fraction(drape_contact *c, const double *x, const double *y, double t, bool again,
                                   double *of_node)
{
    const double start = drape_clock_seconds();
    const drape_keep keep = {.rounding = c->broad.rounding,
                             .least = 1,
                             .above = DRAPE_KEPT_GAP,
                             .below = DRAPE_KEPT_GAP,
                             .arrival = DRAPE_KEPT_GAP};
    drape_pair limiting;
    double of_surfaces;
    const double *before = again && c->has_before ? c->before : NULL, farthest = farthest_throw(c, x, y);
    double whole = 1; /* the fraction to which all displacements are shortened */
    c->has_before = false;
    if (again)
        memcpy(c->before, of_node, (size_t)c->model->node_count * sizeof *c->before);
    for (int32_t i = 0; again && i < c->model->node_count; i++)
        of_node[i] = 1;
    if (of_node) {
        /* Lowers the fractions of nodes that go farther than a path whose candidates can be kept. A
         * correction throws nodes so far only if it is of no use there; to search each pair on its own path
         * would take seconds. */
        const double longest = fmin(thrown_length(c, farthest), DRAPE_LONGEST_SEARCH * c->mean_edge);
        double least = 1, move[3];
        for (int32_t i = 0; i < c->model->node_count; i++) {
            vec3_sub(y + 3 * (size_t)i, x + 3 * (size_t)i, move);
            const double length = vec3_norm(move);
            if (!(length > longest))
                continue;
            of_node[i] = longest / length;
            least = fmin(least, of_node[i]);
        }
        const double shortened = drape_ranks_least(c->ranks, least);
        if (shortened < 1)
            return shortened;
    } else if (farthest > thrown_length(c, farthest) && isfinite(farthest)) {
        whole = thrown_length(c, farthest) / farthest;
    }
    drape_contact_poses(c, t, c->path_pose);
    drape_contact_fill(c, x, c->path_pose, c->from);
    drape_contact_fill(c, y, c->path_pose, c->to);
    for (size_t i = 0; whole < 1 && i < 3 * (size_t)c->model->node_count; i++)
        c->to[i] = x[i] + whole * (y[i] - x[i]);
    const drape_straight_path straight = {{{.model = c->model, .x = c->from, .pose = c->path_pose},
                                           {.model = c->model, .x = c->to, .pose = c->path_pose}}};
    const double of_features = drape_contact_free_fraction(c, &straight, NULL, &keep, of_node, &of_surfaces,
                                                           before, c->cancel ? *c->cancel : NULL, &limiting);
    c->has_before = of_node && of_features >= 0;
    c->seconds += drape_clock_seconds() - start;
    if (of_features < 0) {
        for (int32_t i = 0; of_node && i < c->model->node_count; i++)
            of_node[i] = 0;
        return 0;
    }
    return whole * fmin(of_features, of_surfaces);
}

/* ---- Within some time ---- */

/* Whether a node could come within the activation distance of the smooth surface of a collider on a straight
 * path in the coordinates of that: the gap changes by no more than the node moves there. */
static bool may_touch(const drape_contact *c, int32_t collider, int32_t node, const drape_straight_path *path)
{
    const drape_collider *k = &c->model->colliders[collider];
    const double distance = c->broad.distance[collider];
    double own[2][3], move[3], gaps = 0;
    bool keeps = true;
    for (int end = 0; end < 2; end++) {
        const drape_configuration *at = &path->end[end];
        drape_pose_own(&at->pose[collider], at->x + 3 * (size_t)node, own[end]);
        keeps = keeps && drape_distant_keeps(&c->broad.distant, collider, node, own[end], distance);
    }
    for (int end = 0; end < 2 && !keeps; end++)
        gaps += k->ops->distance(k->values, &k->shape, own[end], NULL, NULL);
    vec3_sub(own[1], own[0], move);
    return !keeps && 0.5 * (gaps - vec3_norm(move)) < distance;
}

static void note(void *user, const drape_pair *pair)
{
    bool *found = user;
    (void)pair;
    *found = true;
}

bool drape_contact_may_meet(drape_contact *c, const double *x, const double *v, double t, double seconds)
{
    const drape_model *m = c->model;
    const double start = drape_clock_seconds();
    const drape_straight_path path = {
        {{.model = m, .x = c->from, .pose = c->path_pose}, {.model = m, .x = c->to, .pose = c->kink_pose}}};
    bool meets = false;
    drape_contact_poses(c, t, c->path_pose);
    drape_contact_poses(c, t + seconds, c->kink_pose);
    drape_contact_fill(c, x, c->path_pose, c->from);
    for (size_t i = 0; i < 3 * (size_t)m->node_count; i++)
        c->to[i] = x[i] + seconds * v[i];
    drape_motion_place_pins(c->motion, t + seconds, c->to);
    drape_contact_fill(c, c->to, c->kink_pose, c->to);
    for (int32_t k = 0; k < m->collider_count; k++)
        for (int32_t i = 0; i < m->free_count && !meets && m->colliders[k].ops->smooth; i++)
            meets =
                !drape_model_ignores(m, k, m->node_of_free[i]) && may_touch(c, k, m->node_of_free[i], &path);
    if (!meets)
        drape_candidates_find(&c->broad, &path, 0, true, NULL, note, &meets);
    c->seconds += drape_clock_seconds() - start;
    return meets;
}
