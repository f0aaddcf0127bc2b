/* exit.c: see exit.h. */
#include "realtime/exit.h"

#include "base/search.h"
#include "base/vec3.h"
#include "contact/barrier.h"
#include "geometry/intersect.h"
#include "geometry/nearest.h"

#include <string.h>

#define MARGIN   DRAPE_BARRIER_PARABOLA /* gap at the end of a path out, in activation distances */
#define FLAT     0.5 /* a patch is curled up if the sum of its normals is less than this share of its area */
#define KEPT     0.3 /* cosine of direction and normal: a direction more along the cloth is found anew */
#define MARCHES  64  /* advances along a path out */
#define FARTHEST 2   /* longest path out, in lengths of the body */
#define SAMPLES  4   /* points of a face that are tested */

/* ---- Faces that a collider pierces ---- */

/* Where the segment p q meets the plane of a triangle whose sides it passes through. */
static void find_piercing(const double *p, const double *q, const double *const x[3], double out[3])
{
    double a[3], b[3], n[3], from[3], along[3];
    vec3_sub(x[1], x[0], a);
    vec3_sub(x[2], x[0], b);
    vec3_cross(a, b, n);
    vec3_sub(x[0], p, from);
    vec3_sub(q, p, along);
    const double slope = vec3_dot(n, along), s = slope != 0 ? vec3_dot(n, from) / slope : 0;
    memcpy(out, p, 3 * sizeof *out);
    vec3_add_scaled(fmax(0, fmin(s, 1)), along, out);
}

/* A face of the cloth, and what of a collider passes through it. */
typedef struct crossing {
    const drape_contact *contact;
    int32_t collider;
    const double *x[3]; /* [m] corners of the face */
    double *where;      /* [m] the piercing of drape_exit_is_pierced; may be NULL */
    int64_t key; /* of the triangle that was found: its index, plus INT32_MAX if none of its segments passes
                           through the face */
    bool found;
} crossing;

static const double *point_of(const crossing *q, int32_t point)
{
    return q->contact->x + 3 * (size_t)(q->contact->broad.first_point[q->collider] + point);
}

static bool cross_segment(const crossing *q, int32_t a, int32_t b)
{
    const double *from = point_of(q, a), *to = point_of(q, b);
    const bool found = drape_intersect_edge(from, to, q->x[0], q->x[1], q->x[2]);
    if (found && q->where)
        find_piercing(from, to, q->x, q->where);
    return found;
}

static bool cross_triangle(const crossing *q, const int32_t point[3])
{
    const double *y[3] = {point_of(q, point[0]), point_of(q, point[1]), point_of(q, point[2])};
    bool found = false;
    for (int a = 0; a < 3; a++)
        found = found || drape_intersect_edge(q->x[a], q->x[(a + 1) % 3], y[0], y[1], y[2]);
    return found;
}

/* The segments of a shape with triangles are their edges. Of several triangles the one with the smallest key
 * counts, whatever their order in the tree is. */
static void meet_triangle(void *user, int32_t triangle)
{
    crossing *q = user;
    const drape_broad_phase *broad = &q->contact->broad;
    if (broad->triangle_collider[triangle] != q->collider || triangle > q->key || (q->found && !q->where))
        return;
    int32_t corner[4];
    double at[3];
    crossing one = *q;
    one.where = q->where ? at : NULL;
    bool passes = false;
    for (int a = 0; a < 4; a++)
        corner[a] = broad->triangle[3 * (size_t)triangle + a % 3] - broad->first_point[q->collider];
    memcpy(at, q->x[0], sizeof at);
    for (int a = 0; a < 3 && !passes; a++)
        passes = cross_segment(&one, corner[a], corner[a + 1]);
    const int64_t key = triangle + (passes ? 0 : (int64_t)INT32_MAX);
    if (key > q->key || !(passes || cross_triangle(q, corner)))
        return;
    q->found = true;
    q->key = key;
    if (q->where)
        memcpy(q->where, at, sizeof at);
}

bool drape_exit_is_pierced(const drape_contact *c, int32_t collider, int32_t face, double piercing[3])
{
    const drape_collider_shape *shape = &c->model->colliders[collider].shape;
    const int32_t *n = c->model->triangle + 3 * (size_t)face;
    crossing q = {.contact = c, .collider = collider, .where = piercing, .key = INT64_MAX};
    for (int a = 0; a < 3; a++)
        q.x[a] = c->x + 3 * (size_t)n[a];
    if (piercing)
        memcpy(piercing, q.x[0], 3 * sizeof *piercing);
    if (!c->model->colliders[collider].ops->smooth && shape->triangle_count > 0) {
        drape_path_bvh_query(&c->broad.obstacles, &(drape_path_query){.node = n, .nodes = 3, .x = c->x},
                             meet_triangle, &q);
        return q.found;
    }
    for (int32_t i = 0; i < shape->segment_count && !q.found; i++)
        q.found = cross_segment(&q, shape->segment[2 * (size_t)i], shape->segment[2 * (size_t)i + 1]);
    for (int32_t i = 0; i < shape->triangle_count && !q.found; i++)
        q.found = cross_triangle(&q, shape->triangle + 3 * (size_t)i);
    return q.found;
}

/* The points of a face that are in a collider, among its middle, those of its sides, and where it is pierced.
 * Returns their number. */
static int sample(const drape_contact *c, int32_t collider, int32_t face, bool *pierced, double x[][3])
{
    static const double share[SAMPLES][3] = {
        {1. / 3, 1. / 3, 1. / 3}, {0.5, 0.5, 0}, {0, 0.5, 0.5}, {0.5, 0, 0.5}};
    const int32_t *n = c->model->triangle + 3 * (size_t)face;
    int count = 0;
    *pierced = drape_exit_is_pierced(c, collider, face, x[0]);
    count += *pierced;
    for (int i = 0; i < SAMPLES; i++) {
        memset(x[count], 0, 3 * sizeof(double));
        for (int a = 0; a < 3; a++)
            vec3_add_scaled(share[i][a], c->x + 3 * (size_t)n[a], x[count]);
        count += drape_relaxed_distance(c, collider, x[count], NULL) < 0;
    }
    return count;
}

/* Whether some node of a face is relaxed, and none is blocked or pinned. */
static bool may_come_out(const drape_contact *c, int32_t collider, int32_t face)
{
    const int32_t *n = c->model->triangle + 3 * (size_t)face;
    bool relaxed = false, blocked = false;
    for (int a = 0; a < 3; a++) {
        const drape_relaxed_node *node = drape_relaxed_find(drape_relaxed_of(c), collider, n[a]);
        relaxed = relaxed || node;
        blocked = blocked || c->model->pinned[n[a]] || (node && node->blocked);
    }
    return relaxed && !blocked && !drape_model_ignores(c->model, collider, n[0]);
}

/* ---- Patches ---- */

static double normal_of(const drape_contact *c, int32_t face, double normal[3])
{
    vec3_triangle_normal(c->model->triangle + 3 * (size_t)face, c->x, normal);
    return c->broad.face_area[face];
}

/* The normal of a patch, if it has one, else that of the face. */
static void smooth_normal(const drape_relaxed_patch *p, const double own[3], double out[3])
{
    const double length = vec3_norm(p->normal);
    for (int k = 0; k < 3; k++)
        out[k] = length > FLAT * p->area ? p->normal[k] / length : own[k];
}

/* A length of a body, about its extent; 0: the body has no end. */
static double length_of(const drape_collider_shape *shape)
{
    double length = 0, to[3];
    for (int32_t i = 0; i < shape->point_count; i++) {
        vec3_sub(shape->point + 3 * (size_t)i, shape->point, to);
        length = fmax(length, vec3_norm(to) + 2 * shape->radius);
    }
    return length;
}

/* The length of the path out of a collider from a point in some direction; that of the longest path allowed
 * if another collider is at the end. */
static double path_out(const drape_contact *c, int32_t collider, const double from[3], const double along[3])
{
    const double margin = MARGIN * c->broad.distance[collider],
                 longest = FARTHEST * length_of(&c->model->colliders[collider].shape);
    double s = 0, x[3] = {from[0], from[1], from[2]};
    for (int i = 0; i < MARCHES && s < longest; i++) {
        const double gap = drape_relaxed_distance(c, collider, x, NULL);
        if (!(gap < margin))
            break;
        s += margin - fmin(gap, 0);
        memcpy(x, from, sizeof x);
        vec3_add_scaled(s, along, x);
    }
    for (int32_t other = 0; other < c->model->collider_count; other++)
        if (other != collider && drape_relaxed_distance(c, other, x, NULL) < 0)
            return longest;
    return fmin(s, longest);
}

/* ---- The search ---- */

typedef struct search {
    drape_contact *c;
    int32_t collider;
    uint8_t
        *face; /* (triangle_count) 0: not in a patch; INSIDE, PIERCED; after `choose` whether the patch goes
                        along the normal of the face or against it */
    int32_t *parent;              /* (node_count) */
    drape_relaxed_patch *patches; /* (node_count) */
} search;

enum { INSIDE = 1, PIERCED = 2, ALONG = 3, AGAINST = 4 };

static drape_relaxed_patch *patch_of(const search *s, int32_t face)
{
    return &s->patches[drape_set_of(s->parent, s->c->model->triangle[3 * (size_t)face])];
}

/* Patches of the faces that are marked, with their normals. */
static void gather(search *s)
{
    const drape_model *m = s->c->model;
    memset(s->patches, 0, (size_t)m->node_count * sizeof *s->patches);
    /* The nodes of faces that are marked are joined in patches, the first node of each at its root. */
    for (int32_t i = 0; i < m->node_count; i++)
        s->parent[i] = i;
    for (int32_t f = 0; f < m->triangle_count; f++)
        for (size_t a = 1; s->face[f] && a < 3; a++) {
            const int32_t *n = m->triangle + 3 * (size_t)f;
            drape_set_join(s->parent, n[0], n[a]);
        }
    for (int32_t f = 0; f < m->triangle_count; f++) {
        double normal[3];
        if (!s->face[f])
            continue;
        drape_relaxed_patch *p = patch_of(s, f);
        const double area = normal_of(s->c, f, normal), sign = s->face[f] == AGAINST ? -1 : 1;
        p->area += area;
        vec3_add_scaled(sign * area, normal, p->normal);
        for (size_t a = 0; a < 3; a++) {
            const drape_relaxed_node *node =
                drape_relaxed_find(drape_relaxed_of(s->c), s->collider, m->triangle[3 * (size_t)f + a]);
            double kept[3];
            if (!node || !node->exits)
                continue;
            memcpy(kept, node->exit, sizeof kept);
            drape_pose_direction(&s->c->pose[s->collider], kept);
            vec3_add_scaled(area, kept, p->kept);
        }
    }
}

/* Marks the faces that may need a direction; returns whether there are any. The nearest surface leads out of
 * a body that is not solid (relaxed.h), unless a segment of it passes through the face. */
static bool mark(search *s)
{
    const drape_model *m = s->c->model;
    bool any = false;
    for (int32_t f = 0; f < m->triangle_count; f++) {
        double x[SAMPLES + 1][3];
        bool pierced;
        s->face[f] = 0;
        if (!may_come_out(s->c, s->collider, f) || sample(s->c, s->collider, f, &pierced, x) == 0)
            continue;
        s->face[f] = pierced ? PIERCED : drape_relaxed_of(s->c)->solid[s->collider] ? INSIDE : 0;
        any = any || s->face[f];
    }
    return any;
}

static void add_costs(search *s)
{
    for (int32_t f = 0; f < s->c->model->triangle_count; f++) {
        double x[SAMPLES + 1][3], own[3], normal[3];
        bool pierced;
        if (!s->face[f])
            continue;
        drape_relaxed_patch *p = patch_of(s, f);
        const double area = normal_of(s->c, f, own);
        smooth_normal(p, own, normal);
        const int count = sample(s->c, s->collider, f, &pierced, x);
        for (int side = 0; side < 2; side++) {
            const double along[3] = {side ? normal[0] : -normal[0], side ? normal[1] : -normal[1],
                                     side ? normal[2] : -normal[2]};
            for (int i = 0; i < count; i++)
                p->cost[side] += area * path_out(s->c, s->collider, x[i], along);
        }
    }
}

/* Whether the nearest surface to some point of a face in the collider leads away from the direction `to`. */
static bool is_astray(const search *s, int32_t face, const double to[3])
{
    double x[SAMPLES + 1][3], n[3];
    bool pierced, astray = false;
    const int count = sample(s->c, s->collider, face, &pierced, x);
    for (int i = 0; i < count; i++)
        astray =
            astray || (drape_relaxed_distance(s->c, s->collider, x[i], n) < 0 && vec3_dot(n, to) < -KEPT);
    return astray || pierced;
}

/* Chooses the side to which each patch goes, and leaves only those faces marked that the nearest surface does
 * not lead out there. */
static bool choose(search *s)
{
    bool any = false;
    for (int32_t f = 0; f < s->c->model->triangle_count; f++) {
        double own[3], normal[3], to[3];
        if (!s->face[f])
            continue;
        const drape_relaxed_patch *p = patch_of(s, f);
        normal_of(s->c, f, own);
        smooth_normal(p, own, normal);
        const double kept = vec3_dot(p->kept, normal);
        const bool along = fabs(kept) > KEPT * vec3_norm(p->kept) ? kept > 0 : p->cost[1] < p->cost[0];
        for (int k = 0; k < 3; k++)
            to[k] = along ? normal[k] : -normal[k];
        s->face[f] = is_astray(s, f, to) ? (vec3_dot(own, to) < 0 ? AGAINST : ALONG) : 0;
        any = any || s->face[f];
    }
    return any;
}

/* The direction of a patch in space. */
static void direction_of(const drape_relaxed_patch *p, double out[3])
{
    const double kept = vec3_norm(p->kept), length = vec3_norm(p->normal);
    const bool keeps = kept > 0 && vec3_dot(p->kept, p->normal) >= KEPT * kept * length;
    for (int k = 0; k < 3; k++)
        out[k] = keeps ? p->kept[k] / kept : length > 0 ? p->normal[k] / length : 0;
}

static void find_ends(search *s)
{
    const drape_model *m = s->c->model;
    for (int32_t i = 0; i < m->node_count; i++)
        s->patches[i].height = -INFINITY;
    for (int32_t f = 0; f < m->triangle_count; f++) {
        double x[SAMPLES + 1][3], to[3];
        bool pierced;
        if (!s->face[f])
            continue;
        drape_relaxed_patch *p = patch_of(s, f);
        direction_of(p, to);
        const int count = sample(s->c, s->collider, f, &pierced, x);
        for (int i = 0; i < count; i++)
            p->height = fmax(p->height, vec3_dot(to, x[i]) + path_out(s->c, s->collider, x[i], to));
    }
}

/* Sets direction and end of the path of a node of a patch, in the coordinates of the collider. */
static drape_status set_exit(search *s, int32_t node, const drape_relaxed_patch *p, double t)
{
    const drape_collider_pose *pose = &s->c->pose[s->collider];
    double to[3], end[3], origin[3] = {0};
    int32_t added = 0;
    drape_relaxed_node *found = drape_relaxed_find(drape_relaxed_of(s->c), s->collider, node);
    if (!found && !drape_relaxed_of(s->c)->may_relax)
        return DRAPE_OK;
    if (!found) {
        const drape_status status =
            drape_relaxed_add(drape_relaxed_of(s->c), s->collider, node, t, t, &added);
        if (status)
            return status;
        found = drape_relaxed_find(drape_relaxed_of(s->c), s->collider, node);
        found->blocked = false;
    }
    direction_of(p, to);
    for (int k = 0; k < 3; k++)
        end[k] = p->height * to[k];
    drape_pose_own(pose, origin, origin);
    drape_pose_own(pose, to, found->exit);
    vec3_sub(found->exit, origin, found->exit);
    drape_pose_own(pose, end, end);
    found->height = vec3_dot(found->exit, end);
    found->exits = true;
    return DRAPE_OK;
}

drape_status drape_exit_find(drape_contact *c, double t)
{
    const drape_model *m = c->model;
    drape_status status = DRAPE_OK;
    for (int32_t k = 0; !status && k < m->collider_count; k++) {
        search s = {.c = c,
                    .collider = k,
                    .face = drape_relaxed_of(c)->face,
                    .parent = drape_relaxed_of(c)->parent,
                    .patches = drape_relaxed_of(c)->patches};
        bool any = drape_relaxed_count(drape_relaxed_of(c), k) > 0 && mark(&s);
        if (any) {
            gather(&s);
            add_costs(&s);
            any = choose(&s);
        }
        for (int32_t i = 0; i < drape_relaxed_of(c)->exempt.count; i++)
            if (drape_relaxed_of(c)->nodes[i].collider == k && !any)
                drape_relaxed_of(c)->nodes[i].exits = false;
        if (!any)
            continue;
        gather(&s);
        find_ends(&s);
        for (int32_t i = 0; i < drape_relaxed_of(c)->exempt.count; i++)
            if (drape_relaxed_of(c)->nodes[i].collider == k)
                drape_relaxed_of(c)->nodes[i].exits = false;
        for (int32_t f = 0; !status && f < m->triangle_count; f++)
            for (size_t a = 0; s.face[f] && !status && a < 3; a++)
                status = set_exit(&s, m->triangle[3 * (size_t)f + a], patch_of(&s, f), t);
    }
    return status;
}

/* ---- Contacts ---- */

drape_status drape_exit_add(drape_contact *c, const drape_configuration *at)
{
    drape_status status = DRAPE_OK;
    for (int32_t i = 0; !status && i < drape_relaxed_of(c)->exempt.count; i++) {
        const drape_relaxed_node *node = &drape_relaxed_of(c)->nodes[i];
        double own[3];
        if (!drape_relaxed_goes_out(node))
            continue;
        drape_active_contact contact = {.pair =
                                            drape_broad_phase_surface(&c->broad, node->node, node->collider),
                                        .exempt = node->factor,
                                        .gap = {.closest = {.points = 1, .c = {1}}, .m = 1}};
        drape_pose_own(&at->pose[node->collider], at->x + 3 * (size_t)node->node, own);
        contact.gap.value = vec3_dot(node->exit, own) - node->height;
        memcpy(contact.gap.closest.normal, node->exit, sizeof node->exit);
        drape_pose_direction(&at->pose[node->collider], contact.gap.closest.normal);
        if (contact.gap.value < contact.pair.distance)
            status = drape_active_set_add(&c->active, &contact);
    }
    return status;
}
