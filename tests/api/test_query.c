/* test_query.c: the nearest place to a point, the first one on a ray, the list of contacts, and a mesh that
 * the cloth carries: against brute force over all triangles, closed forms and the sums of forces. */
#include <float.h>
#include <stdlib.h>

#include "support/host.h"
#include "support/suite.h"

#define PAD "'integrator': {'tolerance': 1e-9}, 'frame_rate': 64, 'duration': 1}"

/* A sheet that falls on a ball and a box, after 0.4 s. */
static host draped(const char *contact)
{
    host h = open_scene(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 9, 'rows': 9, 'width': 0.5, 'height': "
        "0.5},"
        "'material': {'young_modulus': 1e4, 'thickness': 1e-3, 'density': 200}, 'terms': ['stretch.edge', "
        "'bend.hinge']}], 'colliders': [{'type': 'sphere', 'center': [0.25, -0.13, -0.25], 'radius': 0.1, "
        "'friction': 0.4}, {'type': 'box', 'center': [0.1, -0.4, -0.1], 'size': [0.3, 0.2, 0.3], 'friction': "
        "0.2}, {'type': 'plane', 'point': [0, -0.6, 0], 'normal': [0, 1, 0]}], 'self_contact': {'thickness': "
        "0.004}, %s" PAD,
        contact);
    good(&h, drape_sim_advance(h.sim, 0.4));
    return h;
}

static uint32_t seed = 12345;

static double random_between(double low, double high)
{
    seed = seed * 1664525u + 1013904223u;
    return low + (high - low) * (seed >> 8) / 16777216.0;
}

static double dot(const double *a, const double *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void less(const double *a, const double *b, double *out)
{
    for (int k = 0; k < 3; k++)
        out[k] = a[k] - b[k];
}

static void cross(const double *a, const double *b, double *out)
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

/* ---- Brute force ---- */

static double to_segment(const double *p, const double *a, const double *b)
{
    double ab[3], ap[3], d[3];
    less(b, a, ab);
    less(p, a, ap);
    const double t = fmin(fmax(dot(ap, ab) / dot(ab, ab), 0), 1);
    for (int k = 0; k < 3; k++)
        d[k] = ap[k] - t * ab[k];
    return sqrt(dot(d, d));
}

/* The foot of the perpendicular, if it is within, or the nearest side. */
static double to_triangle(const double *p, const double *const corner[3])
{
    double u[3], v[3], n[3], d[3], q[3], best = INFINITY;
    less(corner[1], corner[0], u);
    less(corner[2], corner[0], v);
    less(p, corner[0], d);
    cross(u, v, n);
    cross(d, v, q);
    const double b = dot(q, n) / dot(n, n);
    cross(u, d, q);
    const double c = dot(q, n) / dot(n, n);
    if (b >= 0 && c >= 0 && b + c <= 1)
        return fabs(dot(d, n)) / sqrt(dot(n, n));
    for (int a = 0; a < 3; a++)
        best = fmin(best, to_segment(p, corner[a], corner[(a + 1) % 3]));
    return best;
}

static const double *corner_of(const host *h, int32_t triangle, int a)
{
    return drape_sim_positions(h->sim) + 3 * (size_t)drape_model_triangles(h->model)[3 * triangle + a];
}

static double nearest_by_force(const host *h, const double *p)
{
    double best = INFINITY;
    for (int32_t f = 0; f < drape_model_triangle_count(h->model); f++) {
        const double *const corner[] = {corner_of(h, f, 0), corner_of(h, f, 1), corner_of(h, f, 2)};
        best = fmin(best, to_triangle(p, corner));
    }
    return best;
}

/* Where the ray meets the planes of the triangles, within all three sides by the signs of areas. */
static double first_by_force(const host *h, const double *origin, const double *direction)
{
    double best = INFINITY;
    for (int32_t f = 0; f < drape_model_triangle_count(h->model); f++) {
        double u[3], v[3], n[3], d[3], p[3];
        bool inside = true;
        less(corner_of(h, f, 1), corner_of(h, f, 0), u);
        less(corner_of(h, f, 2), corner_of(h, f, 0), v);
        cross(u, v, n);
        less(corner_of(h, f, 0), origin, d);
        const double t = dot(d, n) / dot(direction, n);
        for (int k = 0; k < 3; k++)
            p[k] = origin[k] + t * direction[k];
        for (int a = 0; a < 3; a++) {
            double side[3], to[3], area[3];
            less(corner_of(h, f, (a + 1) % 3), corner_of(h, f, a), side);
            less(p, corner_of(h, f, a), to);
            cross(side, to, area);
            inside = inside && dot(area, n) >= 0;
        }
        if (inside && t >= 0)
            best = fmin(best, t);
    }
    return best;
}

/* The place is on its triangle with its weights, at its distance. */
static void check_place(const host *h, const drape_hit *hit, const double *from)
{
    double p[3] = {0}, d[3], sum = 0;
    for (int a = 0; a < 3; a++) {
        sum += hit->weights[a];
        ck_assert_double_ge(hit->weights[a], -1e-12);
        for (int k = 0; k < 3; k++)
            p[k] += hit->weights[a] * corner_of(h, hit->triangle, a)[k];
    }
    ck_assert_double_eq_tol(sum, 1, 1e-12);
    ck_assert_double_lt(distance(p, hit->point), 1e-15);
    less(hit->point, from, d);
    ck_assert_double_eq_tol(sqrt(dot(d, d)), hit->distance, 1e-12);
    ck_assert_double_eq_tol(dot(hit->normal, hit->normal), 1, 1e-12);
}

enum { COUNT = 400 };

TEST(nearest_places)
{
    scoped_host h = draped("");
    static double points[3 * COUNT];
    static drape_hit hits[COUNT];
    for (int i = 0; i < 3 * COUNT; i++)
        points[i] = random_between(-0.6, 0.6);
    good(&h, drape_sim_closest(h.sim, DRAPE_QUERY_CLOTH, COUNT, points, INFINITY, hits));
    for (int i = 0; i < COUNT; i++) {
        ck_assert(hits[i].found && hits[i].collider == -1);
        check_place(&h, &hits[i], points + 3 * i);
        ck_assert_double_eq_tol(hits[i].distance, nearest_by_force(&h, points + 3 * i), 1e-12);
    }
    /* of the ball, and what is beyond the distance is not found */
    good(&h, drape_sim_closest(h.sim, DRAPE_QUERY_COLLIDERS, COUNT, points, 0.05, hits));
    int found = 0;
    for (int i = 0; i < COUNT; i++) {
        const double center[3] = {0.25, -0.13, -0.25}, gap = distance(points + 3 * i, center) - 0.1;
        found += hits[i].found;
        if (hits[i].found)
            ck_assert_double_le(fabs(hits[i].distance), 0.05);
        if (!hits[i].found || hits[i].collider != 0) {
            ck_assert(fabs(gap) > 0.05 || fabs(hits[i].distance) <= fabs(gap));
            continue;
        }
        ck_assert_double_eq_tol(hits[i].distance, gap, 1e-14);
        ck_assert_double_eq_tol(distance(hits[i].point, center), 0.1, 1e-14);
    }
    ck_assert(found > 10 && found < COUNT);
    /* of both the nearer one */
    static drape_hit both[COUNT], cloth[COUNT];
    good(&h, drape_sim_closest(h.sim, 3, COUNT, points, INFINITY, both));
    good(&h, drape_sim_closest(h.sim, 1, COUNT, points, INFINITY, cloth));
    good(&h, drape_sim_closest(h.sim, 2, COUNT, points, INFINITY, hits));
    for (int i = 0; i < COUNT; i++)
        ck_assert_double_eq(fabs(both[i].distance), fmin(cloth[i].distance, fabs(hits[i].distance)));
}

TEST(rays)
{
    scoped_host h = draped("");
    static double origins[3 * COUNT], directions[3 * COUNT];
    static drape_hit hits[COUNT];
    for (int i = 0; i < 3 * COUNT; i++) {
        origins[i] = random_between(-0.6, 0.6);
        directions[i] = random_between(-2, 2);
    }
    for (int i = 0; i < COUNT; i += 2) /* half of them towards the ball, some past it */
        for (int k = 0; k < 3; k++)
            directions[3 * i + k] = (k == 1   ? -0.13
                                     : k == 2 ? -0.25
                                              : 0.25) +
                                    random_between(-0.1, 0.1) - origins[3 * i + k];
    int found = 0;
    good(&h, drape_sim_cast(h.sim, DRAPE_QUERY_CLOTH, COUNT, origins, directions, 5, hits));
    for (int i = 0; i < COUNT; i++) {
        const double size = sqrt(dot(directions + 3 * i, directions + 3 * i));
        const double first = first_by_force(&h, origins + 3 * i, directions + 3 * i) * size;
        found += hits[i].found;
        ck_assert(hits[i].found == (first < INFINITY));
        if (!hits[i].found)
            continue;
        check_place(&h, &hits[i], origins + 3 * i);
        /* a ray along a triangle magnifies rounding; none of these is nearer to one than 1e-3 */
        ck_assert_double_eq_tol(hits[i].distance, first, 1e-11);
    }
    ck_assert(found > 10 && found < COUNT);
    /* the ball, by the smaller root of a quadratic; the floor */
    good(&h, drape_sim_cast(h.sim, DRAPE_QUERY_COLLIDERS, COUNT, origins, directions, 5, hits));
    int balls = 0, floors = 0;
    for (int i = 0; i < COUNT; i++) {
        const double *o = origins + 3 * i, *d = directions + 3 * i, size = sqrt(dot(d, d)),
                     center[3] = {0.25, -0.13, -0.25};
        double from[3];
        less(o, center, from);
        const double b = dot(from, d) / size, c = dot(from, from) - 0.01, root = b * b - c;
        if (hits[i].found && hits[i].collider == 0 && c > 0) {
            balls++;
            ck_assert_double_ge(root, 0);
            /* met within 1e-9 m of the surface: over the slope at which the ray meets it */
            ck_assert_double_eq_tol(hits[i].distance, -b - sqrt(root),
                                    1e-9 * 0.1 / fmax(sqrt(root), 1e-9) + 1e-12);
            ck_assert_double_eq_tol(distance(hits[i].point, center), 0.1, 2e-9);
        } else if (hits[i].found && hits[i].collider == 2 && o[1] > -0.6) {
            floors++;
            ck_assert_double_eq_tol(hits[i].distance * d[1] / size, -0.6 - o[1], 2e-9);
        } else if (c > 0 && b < 0 && root > 1e-6) { /* it would meet the ball: something else is before it */
            ck_assert(hits[i].found && hits[i].distance <= -b - sqrt(root));
        }
        if (c < 0)
            ck_assert(hits[i].found && hits[i].distance == 0);
    }
    ck_assert(balls > 5 && floors > 5);
}

/* The length of a direction does not matter, whatever its square is; one that has none is refused. */
TEST(rays_of_any_length)
{
    static const double sizes[] = {1, 1e200, 1e-200, 1e308, 1e-308};
    scoped_host h = draped("");
    const double origin[3] = {0.26, 0.5, -0.24};
    double directions[15];
    drape_hit hits[5];
    for (int i = 0; i < 5; i++)
        for (int k = 0; k < 3; k++)
            directions[3 * i + k] = (k == 1 ? -1.5 : 0.1 * k) * sizes[i];
    for (int what = DRAPE_QUERY_CLOTH; what <= DRAPE_QUERY_COLLIDERS; what++) {
        for (int i = 0; i < 5; i++)
            good(&h, drape_sim_cast(h.sim, what, 1, origin, directions + 3 * i, 5, &hits[i]));
        for (int i = 0; i < 5; i++) /* to rounding */
            ck_assert(hits[i].found && fabs(hits[i].distance - hits[0].distance) < 1e-14 &&
                      distance(hits[i].point, hits[0].point) < 1e-14);
    }
    const double wrong[][3] = {{0, 0, 0}, {0, INFINITY, 0}, {1, NAN, 0}};
    for (int i = 0; i < 3; i++)
        says(&h, drape_sim_cast(h.sim, DRAPE_QUERY_CLOTH, 1, origin, wrong[i], 5, hits), DRAPE_E_ARGUMENT,
             "directions and length must be finite, and no direction 0");
}

/* ---- Contacts ---- */

static void check_contacts(const char *contact, bool by_nodes)
{
    scoped_host h = draped(contact);
    static drape_contact_point list[2000];
    double by_collider[3][3] = {{0}}, total[243] = {0}, forces[243], on[3], size = 0;
    int32_t count = 0, again = 0;
    good(&h, drape_sim_contacts(h.sim, 0, NULL, &count));
    ck_assert(count > 3 && count <= 2000);
    good(&h, drape_sim_contacts(h.sim, 2000, list, &again));
    ck_assert_int_eq(again, count);
    for (int32_t i = 0; i < count; i++) {
        const drape_contact_point *c = &list[i];
        double point[3] = {0};
        ck_assert_double_eq_tol(dot(c->normal, c->normal), 1, 1e-9);
        for (int a = 0; a < 4 && c->nodes[a] >= 0; a++)
            for (int k = 0; k < 3; k++) {
                point[k] += fmax(c->weights[a], 0) * drape_sim_positions(h.sim)[3 * c->nodes[a] + k];
                total[3 * c->nodes[a] + k] += c->weights[a] * c->force[k];
            }
        ck_assert_double_lt(distance(point, c->point), 1e-14);
        if (c->normal_force > 0) /* the rest is friction, across the normal */
            ck_assert_double_eq_tol(dot(c->force, c->normal), c->normal_force, 1e-9 * (1 + c->normal_force));
        for (int k = 0; c->collider >= 0 && k < 3; k++)
            by_collider[c->collider][k] += c->force[k];
        if (c->collider == 0 && c->normal_force > 0) { /* the ball: outward, at its gap */
            const double center[3] = {0.25, -0.13, -0.25};
            ck_assert_double_eq_tol(distance(c->point, center) - 0.1, c->gap, 1e-12);
        }
    }
    good(&h, drape_sim_contact_forces(h.sim, forces));
    for (int i = 0; i < 243; i++)
        size = fmax(size, fabs(forces[i]));
    ck_assert_double_gt(size, 0);
    for (int i = 0; by_nodes && i < 243; i++) /* some hundred summands in another order */
        ck_assert_double_eq_tol(total[i], forces[i], 1e-11 * size);
    for (int32_t c = 0; c < 3; c++) {
        good(&h, drape_sim_collider_force(h.sim, c, on));
        for (int k = 0; k < 3; k++)
            ck_assert_double_eq_tol(by_collider[c][k], -on[k], 1e-11 * (size + fabs(on[k])));
    }
    good(&h, drape_sim_contacts(h.sim, 1, list, &again)); /* a shorter array has the first ones */
    ck_assert_int_eq(again, count);
    says(&h, drape_sim_contacts(h.sim, 1, NULL, &count), DRAPE_E_ARGUMENT, "room for 1");
    says(&h, drape_sim_contacts(h.sim, 0, NULL, NULL), DRAPE_E_ARGUMENT, "no count");
    ck_assert_int_eq(drape_sim_contacts(NULL, 0, NULL, &count), DRAPE_E_ARGUMENT);
}

TEST(contacts_have_the_forces)
{
    check_contacts("", false);
    check_contacts("'contact': {'friction': 'lagged'}, ", false);
}

/* ---- A mesh that the cloth carries ---- */

/* At rest vertices are where they were given, to the rounding of float. Under a rigid motion they move with
 * it, and so do normals; in an affine one vertices in the sheet do. */
TEST(a_mesh_is_carried)
{
    scoped_host h = draped("");
    enum { VERTICES = 200 };
    static float vertices[3 * VERTICES], normals[3 * VERTICES], at[3 * VERTICES], turned[3 * VERTICES];
    static double x[243];
    drape_embedding *mesh = NULL;
    for (int i = 0; i < VERTICES; i++) {
        vertices[3 * i] = (float)random_between(-0.1, 0.6);
        vertices[3 * i + 1] = i % 2 ? 0 : (float)random_between(-0.05, 0.05);
        vertices[3 * i + 2] = (float)random_between(-0.1, 0.6);
        for (int k = 0; k < 3; k++)
            normals[3 * i + k] = (float)(k == i % 3);
    }
    good(&h, drape_embedding_create(h.ctx, h.model, -1, VERTICES, vertices, normals, &mesh));
    const double *rest = drape_model_rest_positions(h.model);
    drape_embedding_carry(mesh, rest, at, turned);
    for (int i = 0; i < 3 * VERTICES; i++) {
        ck_assert_float_eq_tol(at[i], vertices[i], 2 * FLT_EPSILON);
        ck_assert_float_eq_tol(turned[i], normals[i], 2 * FLT_EPSILON);
    }
    for (int i = 0; i < 243; i += 3) { /* a quarter turn about x, then a shift */
        x[i] = rest[i] + 1;
        x[i + 1] = -rest[i + 2];
        x[i + 2] = rest[i + 1] + 2;
    }
    drape_embedding_carry(mesh, x, at, turned);
    for (int i = 0; i < 3 * VERTICES; i += 3) {
        const float *v = vertices + i, *n = normals + i;
        const double want[3] = {v[0] + 1, -v[2], v[1] + 2}, toward[3] = {n[0], -n[2], n[1]};
        for (int k = 0; k < 3; k++) {
            ck_assert_double_eq_tol((double)at[i + k], want[k], 4 * FLT_EPSILON);
            ck_assert_double_eq_tol((double)turned[i + k], toward[k], 4 * FLT_EPSILON);
        }
    }
    for (int i = 0; i < 243; i += 3) {
        x[i] = 2 * rest[i] + 0.5 * rest[i + 2];
        x[i + 1] = rest[i];
        x[i + 2] = 0.25 * rest[i + 2];
    }
    drape_embedding_carry(mesh, x, at, NULL);
    for (int i = 3; i < 3 * VERTICES; i += 6) {
        const float *v = vertices + i;
        const double want[3] = {2 * v[0] + 0.5 * v[2], v[0], 0.25 * v[2]};
        for (int k = 0; k < 3; k++)
            ck_assert_double_eq_tol((double)at[i + k], want[k], 4 * FLT_EPSILON);
    }
    drape_embedding_destroy(&mesh);
    ck_assert_ptr_null(mesh);
    vertices[4] = NAN;
    says(&h, drape_embedding_create(h.ctx, h.model, 0, 2, vertices, NULL, &mesh), DRAPE_E_ARGUMENT,
         "vertex 1");
    says(&h, drape_embedding_create(h.ctx, h.model, 1, 1, vertices, NULL, &mesh), DRAPE_E_ARGUMENT,
         "cloth 1");
    says(&h, drape_embedding_create(h.ctx, NULL, 0, 1, vertices, NULL, &mesh), DRAPE_E_ARGUMENT, "no model");
    for (long n = 1; n < 8; n++) {
        h.memory->fail_at = h.memory->calls + n;
        const drape_status status = drape_embedding_create(h.ctx, h.model, 0, 1, vertices, NULL, &mesh);
        ck_assert(status == DRAPE_E_MEMORY ? mesh == NULL : status == DRAPE_OK);
        h.memory->fail_at = 0;
        drape_embedding_destroy(&mesh);
    }
}

/* ---- Refusals ---- */

/* Without memory for its tree a query fails, and the next one is as if nothing had been. */
TEST(a_query_without_memory)
{
    scoped_host h = draped("");
    const double point[3] = {0, 0, 0};
    drape_hit hit;
    h.memory->fail_at = h.memory->calls + 1;
    ck_assert_int_eq(drape_sim_closest(h.sim, 1, 1, point, 1, &hit), DRAPE_E_MEMORY);
    h.memory->fail_at = 0;
    good(&h, drape_sim_closest(h.sim, 1, 1, point, 10, &hit));
    ck_assert(hit.found);
}
