/* room.c: see room.h. */
#include "realtime/room.h"

#include "base/clock.h"
#include "base/vec3.h"
#include "contact/barrier.h"
#include "realtime/exit.h"

#include <string.h>

#define MARGIN DRAPE_BARRIER_PARABOLA /* gap that cloth needs on either side, in activation distances */
/* Cosine of surface and cloth: cloth leaves a surface that is more upright to it along the normal of the
 * surface. */
#define ACROSS 0.3
#define PASSES 3   /* iterations of the search for the nearest place outside of a curved surface */
#define HOLD   0.1 /* [s] for which cloth is relaxed at least if it is not known whether it has no room */

/* Whether a collider may be nearer to a point than the margin. */
static bool may_be_near(const drape_contact *c, const drape_collider_pose *pose, int32_t collider,
                        double margin, const double x[3])
{
    const double *bound = drape_relaxed_bound_of(c, collider);
    double to[3];
    drape_pose_own(&pose[collider], x, to);
    vec3_sub(to, bound, to);
    return !(vec3_norm(to) > bound[3] + margin);
}

/* ---- Contacts of relaxed cloth ---- */

/* The gap between a point of a face and the surface of a collider. */
static bool find_face_gap(const drape_contact *c, const drape_configuration *at, int32_t collider,
                          const double share[3], drape_active_contact *contact)
{
    const double distance = contact->pair.distance;
    drape_gap *gap = &contact->gap;
    double x[3] = {0};
    for (int a = 0; a < 3; a++)
        vec3_add_scaled(share[a], at->x + 3 * (size_t)contact->pair.node[a], x);
    if (!may_be_near(c, at->pose, collider, distance, x))
        return false;
    *gap = (drape_gap){.closest = {.points = 3, .c = {share[0], share[1], share[2]}}, .m = 1};
    gap->value = drape_collider_distance(drape_configuration_body(at, collider), &at->pose[collider], x,
                                         gap->closest.normal, gap->curvature);
    return gap->value < distance;
}

#define ACROSS_FACE 3 /* parts of a side: 7 points of a face besides its corners */

static drape_status add_face(drape_contact *c, const drape_configuration *at, int32_t collider, int32_t face)
{
    const int32_t *n = c->model->triangle + 3 * (size_t)face;
    bool blocked = false; /* a blocked face is between two bodies: its nearest surface may be at the side */
    drape_status status = DRAPE_OK;
    drape_active_contact contact = {.pair = drape_broad_phase_surface(&c->broad, n[0], collider)};
    for (int a = 0; a < 3; a++) {
        const drape_relaxed_node *found = drape_relaxed_find(drape_relaxed_of(c), collider, n[a]);
        contact.exempt = fmax(contact.exempt, found ? found->factor : 0);
        contact.pair.node[a] = n[a];
        blocked = blocked || (found && (found->blocked || drape_relaxed_goes_out(found)));
    }
    contact.pair.area = c->broad.face_area[face] / 7;
    for (int i = 0; i <= ACROSS_FACE && contact.exempt > 0 && !blocked; i++)
        for (int j = 0; !status && i + j <= ACROSS_FACE; j++) {
            const int k = ACROSS_FACE - i - j;
            const double share[3] = {(double)i / ACROSS_FACE, (double)j / ACROSS_FACE,
                                     (double)k / ACROSS_FACE};
            if ((i < ACROSS_FACE && j < ACROSS_FACE && k < ACROSS_FACE) &&
                find_face_gap(c, at, collider, share, &contact))
                status = drape_active_set_add(&c->active, &contact);
        }
    return status;
}

/* Contacts of relaxed cloth that are not those of pairs: of nodes with colliders that have no smooth surface,
 * and of some points of faces with solid colliders (relaxed.h), whose features do not act. */
static drape_status add_surfaces(drape_contact *c, const drape_configuration *given)
{
    drape_configuration fitted = *given;
    const drape_configuration *at = &fitted;
    drape_status status = DRAPE_OK;
    fitted.body = drape_relaxed_of(c)->exempt.count > 0 ? drape_contact_fit_bodies(c, given->pose) : NULL;
    for (int32_t i = 0; !status && i < drape_relaxed_of(c)->exempt.count; i++) {
        const drape_relaxed_node *node = &drape_relaxed_of(c)->nodes[i];
        if (node->collider < 0 || c->model->colliders[node->collider].ops->smooth ||
            c->model->pinned[node->node] || drape_relaxed_goes_out(node))
            continue;
        drape_active_contact contact = {
            .pair = drape_broad_phase_surface(&c->broad, node->node, node->collider), .exempt = node->factor};
        if (drape_pair_gap(&contact.pair, at, c->broad.rest, &contact.gap))
            status = drape_active_set_add(&c->active, &contact);
    }
    for (int32_t k = 0; !status && k < c->model->collider_count; k++)
        for (int32_t f = 0; !status && f < c->model->triangle_count; f++)
            if (drape_relaxed_of(c)->solid[k] && drape_relaxed_count(drape_relaxed_of(c), k) > 0)
                status = add_face(c, at, k, f);
    return status ? status : drape_exit_add(c, at);
}

/* ---- Cloth without room ---- */

/* A point of the cloth in a contact. */
typedef struct cloth_point {
    double x[3], normal[3];
    int32_t node[4], nodes;
} cloth_point;

static cloth_point point_of(const drape_contact *c, const drape_active_contact *contact)
{
    cloth_point p = {.nodes = 0};
    double sum = 0;
    for (int a = 0; a < contact->gap.closest.points; a++) {
        const int32_t node = contact->pair.node[a];
        const double weight = fabs(contact->gap.closest.c[a]);
        if (node >= c->model->node_count)
            continue;
        p.node[p.nodes++] = node;
        sum += weight;
        vec3_add_scaled(weight, c->x + 3 * (size_t)node, p.x);
        vec3_add_scaled(weight, drape_relaxed_of(c)->normal + 3 * (size_t)node, p.normal);
    }
    const double length = vec3_norm(p.normal);
    for (int k = 0; k < 3; k++) {
        p.x[k] /= sum;
        p.normal[k] = length > 0 ? p.normal[k] / length : 0;
    }
    return p;
}

/* Moves a point of the cloth out of a collider until its gap is the margin: across the cloth, in which it
 * cannot go far, or straight out of a surface that the cloth runs into. Returns the direction. */
static void move_out(const drape_contact *c, int32_t collider, double margin, const cloth_point *p,
                     double q[3], double direction[3])
{
    double n[3], gap = drape_relaxed_distance(c, collider, p->x, n);
    const double along = vec3_dot(n, p->normal);
    memcpy(q, p->x, 3 * sizeof *q);
    for (int k = 0; k < 3; k++)
        direction[k] = fabs(along) < ACROSS ? n[k] : along < 0 ? -p->normal[k] : p->normal[k];
    for (int i = 0; i < PASSES && gap < margin; i++) {
        const double slope = vec3_dot(n, direction);
        if (!(slope > 0))
            return;
        vec3_add_scaled((margin - gap) / slope, direction, q);
        gap = drape_relaxed_distance(c, collider, q, n);
    }
}

/* Whether the direction out of one collider leads deeper into another one. */
static bool is_blocked_by(const drape_contact *c, int32_t other, double margin, const double q[3],
                          const double direction[3])
{
    double n[3];
    if (!may_be_near(c, c->pose, other, margin, q))
        return false;
    return drape_relaxed_distance(c, other, q, n) < margin * (1 - 1e-6) && vec3_dot(n, direction) < 0;
}

/* Relaxes nodes that have no room at a collider; -1: at pinned pieces of cloth. If it may not, only notes of
 * relaxed nodes that they are blocked. */
static drape_status block(drape_contact *c, int32_t collider, const int32_t *node, int nodes, double t,
                          double until, bool may_relax, int32_t *added)
{
    drape_status status = DRAPE_OK;
    for (int a = 0; !status && a < nodes; a++)
        if (node[a] >= 0 && !(collider >= 0 && drape_model_ignores(c->model, collider, node[a])) &&
            (may_relax || drape_relaxed_find(drape_relaxed_of(c), collider, node[a])))
            status = drape_relaxed_add(drape_relaxed_of(c), collider, node[a], t, until, added);
    return status;
}

/* Around a pin inside a collider, cloth can be outside only where the length of cloth from the pin is more
 * than the depth of the pin. reach: (node_count) the depth less that length, found edge by edge from every
 * pin inside. */
static void reach_from_pins(const drape_contact *c, int32_t collider, double margin, double *reach)
{
    const drape_model *m = c->model;
    for (int32_t i = 0; i < m->node_count; i++)
        reach[i] =
            m->pinned[i] ? margin - drape_relaxed_distance(c, collider, c->x + 3 * (size_t)i, NULL) : 0;
    for (bool more = true; more;) {
        more = false;
        for (int32_t e = 0; e < m->edge_count; e++)
            for (int k = 0; k < 2; k++) {
                const int32_t from = m->edge[2 * (size_t)e + (size_t)k],
                              to = m->edge[2 * (size_t)e + (size_t)!k];
                const double left = reach[from] - m->edge_length[e];
                if (!(left > 0) || !(left > reach[to]) || m->pinned[to])
                    continue;
                reach[to] = left;
                more = true;
            }
    }
}

static drape_status block_pins(drape_contact *c, int32_t collider, double margin, double t, bool may_relax,
                               int32_t *added)
{
    drape_status status = DRAPE_OK;
    const drape_model *m = c->model;
    const double *reach = drape_relaxed_of(c)->reach;
    reach_from_pins(c, collider, margin, drape_relaxed_of(c)->reach);
    for (int32_t e = 0; !status && e < m->edge_count; e++) {
        const int32_t *n = m->edge + 2 * (size_t)e; /* pins whose neighbours are all pins have no contacts */
        const bool free = !m->pinned[n[0]] || !m->pinned[n[1]];
        for (int k = 0; !status && free && k < 2; k++)
            if (reach[n[k]] > 0)
                status = block(c, collider, &n[k], 1, t, t, may_relax, added);
    }
    return status;
}

static drape_status block_between(drape_contact *c, int32_t collider, const cloth_point *p, double margin,
                                  double t, bool may_relax, int32_t *added)
{
    double q[3], direction[3];
    drape_status status = DRAPE_OK;
    move_out(c, collider, margin, p, q, direction);
    for (int32_t other = 0; !status && other < c->model->collider_count; other++) {
        if (other == collider || drape_model_ignores(c->model, other, p->node[0]) ||
            !is_blocked_by(c, other, margin, q, direction))
            continue;
        status = block(c, collider, p->node, p->nodes, t, t, may_relax, added);
        if (!status)
            status = block(c, other, p->node, p->nodes, t, t, may_relax, added);
    }
    return status;
}

/* Blocks faces that a solid collider (relaxed.h) pierces. Its surface may be far from such a face, and the
 * nodes of the face outside, so points of the face are tested; a tip between these points may be missed. */
static drape_status block_pierced(drape_contact *c, int32_t collider, double t, bool may_relax,
                                  int32_t *added)
{
    static const double shares[][3] = {{1. / 3, 1. / 3, 1. / 3}, {0.5, 0.5, 0}, {0, 0.5, 0.5}, {0.5, 0, 0.5}};
    const double margin = MARGIN * c->model->contact.distance;
    drape_status status = DRAPE_OK;
    for (int32_t f = 0; !status && f < c->model->triangle_count; f++)
        for (size_t i = 0; !status && i < sizeof shares / sizeof *shares; i++) {
            cloth_point p = {.nodes = 3};
            memcpy(p.node, c->model->triangle + 3 * (size_t)f, 3 * sizeof *p.node);
            for (int a = 0; a < 3; a++)
                vec3_add_scaled(shares[i][a], c->x + 3 * (size_t)p.node[a], p.x);
            if (drape_model_ignores(c->model, collider, p.node[0]) ||
                !may_be_near(c, c->pose, collider, margin, p.x) ||
                !(drape_relaxed_distance(c, collider, p.x, NULL) < margin))
                continue;
            for (int a = 0; a < 3; a++)
                vec3_add_scaled(shares[i][a], drape_relaxed_of(c)->normal + 3 * (size_t)p.node[a], p.normal);
            const double length = vec3_norm(p.normal);
            for (int k = 0; k < 3 && length > 0; k++)
                p.normal[k] /= length;
            status = block_between(c, collider, &p, margin, t, may_relax, added);
        }
    return status;
}

static drape_status evaluate_at(drape_contact *c, const double *x, double t)
{
    return drape_contact_update(c, &(drape_contact_at){.x = x, .t = t, .span = {t, t}});
}

/* Evaluates contact where the pins and colliders of time t1 meet the nodes x (node_count x 3) of time t, and
 * blocks the cloth that has no room there; *added: nodes that were not relaxed before. */
static drape_status find_no_room(drape_contact *c, const double *x, double t, double t1, bool may_relax,
                                 int32_t *added)
{
    drape_relaxed_set *relaxed = drape_relaxed_of(c);
    const bool between = c->between_steps;
    memcpy(c->to, x, 3 * (size_t)c->model->node_count * sizeof *x);
    drape_motion_place_pins(c->motion, t1, c->to);
    c->between_steps = true; /* with the candidates of queries: the path of the step leads elsewhere */
    drape_status status = evaluate_at(c, c->to, t1);
    c->between_steps = between;
    if (status)
        return status;
    drape_contact_fit_bodies(c, c->pose);
    for (int32_t i = 0; i < relaxed->exempt.count && !relaxed->counting; i++)
        relaxed->nodes[i].blocked = t < relaxed->nodes[i].until;
    drape_model_normals(c->model, c->x, relaxed->normal);
    memset(relaxed->pins, 0, (size_t)c->model->collider_count * sizeof *relaxed->pins);
    for (int32_t i = 0; !status && i < c->active.count; i++) {
        const drape_active_contact *contact = &c->active.contacts[i];
        const double margin = MARGIN * contact->pair.distance;
        if (contact->pair.collider < 0 || !(contact->gap.value < margin))
            continue;
        const cloth_point p = point_of(c, contact);
        const int32_t collider = contact->pair.collider;
        bool inside = false; /* a pin of the contact, in the collider */
        for (int a = 0; !relaxed->pins[collider] && !inside && a < p.nodes; a++)
            inside = c->model->pinned[p.node[a]] &&
                     drape_relaxed_distance(c, collider, c->x + 3 * (size_t)p.node[a], NULL) < margin;
        if (inside) {
            relaxed->pins[collider] = true;
            status = block_pins(c, collider, margin, t, may_relax, added);
        }
        if (!status)
            status = block_between(c, collider, &p, margin, t, may_relax, added);
    }
    for (int32_t k = 0; !status && k < c->model->collider_count; k++) {
        if (drape_relaxed_of(c)->solid[k])
            status = block_pierced(c, k, t, may_relax, added);
    }
    c->listed = false; /* which contacts there are, and their laws, depends on what is blocked and relaxed */
    return status;
}

/* ---- A step that failed ---- */

/* Relaxes what a pair needs to pass: the nodes of its cloth or, if it is one of cloth and pinned cloth, the
 * free nodes of the piece that meets the pinned one. */
static drape_status relax_pair(drape_contact *c, const drape_pair *pair, double t, int32_t *added)
{
    const drape_model *m = c->model;
    const int points = drape_pair_points(pair), split = drape_pair_split(pair->kind);
    bool pinned[2] = {false, false};
    for (int a = 0; a < points && pair->collider < 0; a++)
        pinned[a >= split] = pinned[a >= split] || (pair->node[a] >= 0 && m->pinned[pair->node[a]]);
    drape_status status = DRAPE_OK;
    for (int a = 0; !status && a < points; a++) {
        const int32_t node = pair->node[a];
        if (node < 0 || node >= m->node_count ||
            (pair->collider < 0 && (!pinned[a < split] || m->pinned[node])))
            continue;
        status = block(c, pair->collider, &node, 1, t, t + HOLD, true, added);
    }
    return status;
}

/* Relaxes the pair that refused the step and, by extent, the near pairs before the step: of them the pairs
 * with bodies, or those of cloth and pinned cloth. */
static drape_status relax_refusing(drape_contact *c, drape_relax_extent extent, bool bodies, int32_t *added)
{
    drape_status status = DRAPE_OK;
    if (c->refused && bodies == (c->refusing.collider >= 0))
        status = relax_pair(c, &c->refusing, c->start_t, added);
    const int32_t near_count = extent == DRAPE_RELAX_NEAR ? c->active.near_count : 0;
    for (int32_t i = 0; !status && i < near_count; i++)
        if (bodies == (c->active.near[i].pair.collider >= 0))
            status = relax_pair(c, &c->active.near[i].pair, c->start_t, added);
    return status;
}

static drape_status relax(drape_contact *c, double t1, drape_relax_extent extent, int32_t *added)
{
    drape_status status = find_no_room(c, c->start, c->start_t, t1, true, added);
    if (!status && *added == 0 && extent != DRAPE_RELAX_NONE) {
        /* A body that is let into cloth comes out again. Cloth that passes through pinned cloth stays on the
         * other side, so pinned cloth is relaxed last. */
        status = evaluate_at(c, c->start, c->start_t);
        if (!status)
            status = relax_refusing(c, extent, true, added);
        if (!status && *added == 0 && extent == DRAPE_RELAX_NEAR)
            status = relax_refusing(c, extent, false, added);
    }
    c->listed = false;
    return status;
}

drape_status drape_room_relax(drape_contact *c, double t1, drape_relax_extent extent, int32_t *added)
{
    const double clock = drape_clock_seconds();
    *added = 0;
    if (!c)
        return DRAPE_OK;
    drape_status status = evaluate_at(c, c->start, c->start_t);
    const double before = status ? 0 : drape_contact_potential(c);
    if (!status)
        status = relax(c, t1, extent, added);
    if (!status && !(status = evaluate_at(c, c->start, c->start_t)))
        c->stiffening.work += drape_contact_potential(c) - before;
    c->seconds += drape_clock_seconds() - clock;
    return status;
}

/* Relaxes all pairs that are too near at the end, and then one by one the pairs that refuse the path to
 * there. */
drape_status drape_room_let_in(drape_contact *c, const double *x, double t1)
{
    drape_reason reason = DRAPE_REASON_CONVERGED;
    drape_diagnostic diagnostic;
    int32_t added = 1;
    if (!c)
        return DRAPE_OK;
    drape_status status = evaluate_at(c, c->start, c->start_t);
    const double before = status ? 0 : drape_contact_potential(c);
    if (!status)
        status = evaluate_at(c, x, t1);
    for (int32_t i = 0; !status && i < c->active.near_count; i++) {
        const drape_near_pair *near = &c->active.near[i];
        if (near->gap < drape_pair_least_gap(&near->pair, c->broad.rounding))
            status = relax_pair(c, &near->pair, c->start_t, &added);
    }
    while (!status && added > 0) {
        added = 0;
        c->listed = false;
        const drape_status refused = drape_contact_check(c, x, t1, &reason, &diagnostic);
        status = refused < 0 ? refused : DRAPE_OK;
        if (refused > 0)
            status = relax_pair(c, &c->refusing, c->start_t, &added);
    }
    c->listed = false;
    if (!status && !(status = evaluate_at(c, c->start, c->start_t)))
        c->stiffening.work += drape_contact_potential(c) - before;
    return status;
}

/* ---- The beginning of a step ---- */

/* Depths and gaps of the relaxed nodes, from the active contacts of their pairs. */
static void measure(drape_contact *c)
{
    drape_relaxed_set *relaxed = drape_relaxed_of(c);
    for (int32_t i = 0; i < relaxed->exempt.count; i++) {
        relaxed->nodes[i].gap = INFINITY;
        relaxed->nodes[i].depth = 0;
    }
    for (int32_t i = 0; i < c->active.count; i++) {
        const drape_active_contact *contact = &c->active.contacts[i];
        const drape_pair *pair = &contact->pair;
        for (int a = 0; contact->exempt > 0 && a < contact->gap.closest.points; a++) {
            drape_relaxed_node *node = drape_relaxed_find(relaxed, pair->collider, pair->node[a]);
            if (node && !drape_relaxed_goes_out(node))
                node->gap = fmin(node->gap, contact->gap.value);
        }
    }
    for (int32_t i = 0; i < relaxed->exempt.count; i++) {
        drape_relaxed_node *node = &relaxed->nodes[i];
        if (node->collider >= 0 && (c->model->pinned[node->node] || drape_relaxed_goes_out(node)))
            node->gap = fmin(node->gap,
                             drape_relaxed_distance(c, node->collider, c->x + 3 * (size_t)node->node, NULL));
        node->depth = fmax(0, -node->gap);
    }
}

/* Whether the collider of a relaxed node pierces a face of the node: then the node is not out. */
static bool is_pierced(const drape_contact *c, const drape_relaxed_node *node)
{
    bool found = false;
    for (int32_t f = 0; !found && node->collider >= 0 && f < c->model->triangle_count; f++) {
        const int32_t *n = c->model->triangle + 3 * (size_t)f;
        if (n[0] == node->node || n[1] == node->node || n[2] == node->node)
            found = drape_exit_is_pierced(c, node->collider, f, NULL);
    }
    return found;
}

/* Whether a node is held again: if contact would hold it with no more force than now pushes it out. */
static bool is_out(void *user, const drape_relaxed_node *node)
{
    const drape_contact *c = user;
    const drape_contact_def *def = &c->model->contact;
    const double distance = node->collider >= 0 ? c->broad.distance[node->collider] : 2 * def->self_thickness,
                 s = node->gap / distance;
    if (node->blocked || node->fresh || node->exits || s < DRAPE_BARRIER_PARABOLA)
        return false;
    const double pressure = -drape_barrier_at(s, DRAPE_BARRIER_PARABOLA).db * c->stiffening.factor *
                            def->stiffness * (def->distance / distance);
    return (pressure <= node->factor * def->relaxed_pressure || c->model->pinned[node->node]) &&
           !is_pierced(c, node);
}

/* Measures the relaxed nodes where contact is evaluated, and holds the nodes again that came out. *changed:
 * whether the laws of contacts are others than before. */
static drape_status review(drape_contact *c, double t, bool *changed)
{
    drape_relaxed_set *relaxed = drape_relaxed_of(c);
    drape_contact_fit_bodies(c, c->pose);
    measure(c);
    const double before = relaxed->t;
    /* With this factor the pressure is that of pairs which are held, at the margin and with the scene's
     * stiffness. The present stiffness may have been raised ten thousand times by bodies that close upon
     * cloth; with it the pressure would tear at cloth that hangs over the edge of a body, long after the
     * bodies have parted. */
    const drape_contact_def *def = &c->model->contact;
    drape_relaxed_update(relaxed, t, -drape_barrier_log(MARGIN).db * def->stiffness / def->relaxed_pressure);
    *changed = relaxed->t != before;
    if (relaxed->exempt.count > 0)
        drape_path_bvh_fit(&c->broad.obstacles, c->x, NULL, NULL, NULL); /* for is_pierced */
    *changed = drape_relaxed_remove(relaxed, is_out, c) > 0 || *changed;
    return drape_exit_find(c, t);
}

/* If some cloth is relaxed: holds the nodes again that have come out, and finds the cloth without room at the
 * end of the step. */
static drape_status begin(drape_contact *c, const drape_contact_at *at)
{
    drape_relaxed_set *relaxed = drape_relaxed_of(c);
    const double t1 = relaxed->ahead_t;
    bool changed = false;
    int32_t added = 0;
    relaxed->ahead_t = NAN;
    if (relaxed->exempt.count == 0)
        return DRAPE_OK;
    drape_status status = review(c, at->t, &changed);
    if (!status && t1 > at->t)
        status = find_no_room(c, at->x, at->t, t1, relaxed->may_relax, &added);
    c->listed = c->listed && !changed;
    return status ? status : drape_contact_update(c, at);
}

void drape_room_expect(drape_contact *c, double t1, bool may_relax)
{
    if (!c)
        return;
    drape_relaxed_of(c)->ahead_t = t1;
    drape_relaxed_of(c)->may_relax = may_relax;
}

/* ---- Opening ---- */

drape_status drape_room_open(drape_arena *arena, drape_contact *c)
{
    drape_relaxed_set *relaxed;
    const drape_status status = c ? drape_relaxed_create(arena, c, &relaxed) : DRAPE_OK;
    if (status || !c)
        return status;
    relaxed->exempt.add = add_surfaces;
    relaxed->exempt.begin = begin;
    c->exempt = &relaxed->exempt;
    return DRAPE_OK;
}

/* Opens contact for the duration of the call if drape_room_open was not called. */
drape_status drape_room_lacks(drape_contact *c, double t1, drape_relax_extent extent, bool *lacks)
{
    int32_t found = 0;
    *lacks = false;
    if (!c || !c->begun)
        return DRAPE_OK;
    drape_exempt *const own = c->exempt;
    drape_arena arena = drape_arena_of(c->model->ctx);
    drape_status status = own ? DRAPE_OK : drape_room_open(&arena, c);
    if (!status) {
        drape_relaxed_of(c)->counting = true;
        status = relax(c, t1, extent, &found);
        drape_relaxed_of(c)->counting = false;
    }
    c->exempt = own;
    drape_arena_free(&arena);
    *lacks = found > 0;
    return status;
}
