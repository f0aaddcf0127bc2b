/*
 * test_contact.c: contact of two pieces. Every derivative is compared with differences, in every region of
 * both kinds of pairs: energy and force, force and Hessian, friction by velocity and by position, the
 * mollifier of nearly parallel edges. Step fractions that are reported as free are free.
 */
#include "contact/barrier.h"
#include "contact/friction.h"
#include "contact/pair.h"
#include "contact/predict.h"
#include "contact/sort_pairs.h"
#include "geometry/path_bvh.h"
#include "support/suite.h"

#include <math.h>
#include <string.h>

#define D 12

/* Numbers in (-1, 1) that are the same on every machine. */
static double next_number(uint64_t *seed)
{
    *seed = *seed * 6364136223846793005u + 1442695040888963407u;
    return (double)(int64_t)(*seed >> 11) / (double)(1ll << 52) - 1;
}

static void fill(uint64_t *seed, double scale, double *to, int count)
{
    for (int i = 0; i < count; i++)
        to[i] = scale * next_number(seed);
}

/* A pair; its four points are the whole cloth. */
typedef struct setting {
    drape_pair pair;
    double x[D], v[D], rest[D];
    drape_contact_law law;
} setting;

/* All weights are 0 unless the pair is active. */
static drape_gap gap_of(const setting *s)
{
    const drape_configuration at = {.x = s->x};
    drape_gap gap = {0};
    if (!drape_pair_gap(&s->pair, &at, s->rest, &gap))
        gap = (drape_gap){.value = gap.value, .m = 1};
    return gap;
}

static double energy_of(const setting *s)
{
    const drape_gap gap = gap_of(s);
    return drape_law_energy(&gap, &s->law);
}

/* The force of the energy, the dissipative part of the normal force, friction of the whole normal force, and
 * that itself. */
typedef struct forces {
    double elastic[D], restitution[D], friction[D], normal;
} forces;

static forces forces_of(const setting *s)
{
    const drape_gap gap = gap_of(s);
    double v[4][3];
    forces f = {0};
    memcpy(v, s->v, sizeof v);
    const drape_normal normal = drape_normal_at(&gap, &s->law, v);
    f.normal = drape_normal_force(&normal);
    drape_law_gradient(&gap, &s->law, f.elastic);
    drape_restitution_force(&gap, &normal, f.restitution);
    drape_friction_force(&gap, &s->law, f.normal, v, f.friction, NULL);
    return f;
}

static forces forces_beside(setting *s, double *coordinate, double by)
{
    const double before = *coordinate;
    *coordinate += by;
    const forces f = forces_of(s);
    *coordinate = before;
    return f;
}

/* The exact derivatives of these forces by v and by x. */
typedef struct derivatives {
    double h[D * D], restitution[2][D * D], friction[2][D * D], normal[2][D];
} derivatives;

static void derive(const setting *s, derivatives *d)
{
    const drape_gap gap = gap_of(s);
    const drape_configuration at = {.x = s->x};
    drape_gap_derivatives of_gap;
    drape_normal_derivatives by_x;
    double v[4][3], f[D];
    memset(d, 0, sizeof *d);
    drape_pair_derivatives(&s->pair, &gap, &at, s->rest, &of_gap);
    memcpy(v, s->v, sizeof v);
    const drape_normal normal = drape_normal_at(&gap, &s->law, v);
    drape_law_hessian(&gap, &of_gap, &s->law, d->h);
    drape_normal_derive(&gap, &of_gap, &s->law, v, &by_x);
    drape_normal_by_v(&gap, &normal, 1, d->normal[0]);
    drape_normal_add_by_x(&gap, &normal, &by_x, d->normal[1]);
    drape_restitution_add_dgdv(&gap, &normal, normal.slope, d->restitution[0]);
    drape_restitution_add_dgdx(&gap, &of_gap, &normal, &by_x, d->restitution[1]);
    drape_friction_force(&gap, &s->law, drape_normal_force(&normal), v, f, d->friction[0]);
    drape_friction_add_dgdx(&gap, &of_gap, &s->law, drape_normal_force(&normal), v, d->friction[1]);
    for (int i = 0; i < 2; i++)
        drape_friction_add_normal(&gap, &s->law, d->normal[i], v, d->friction[i]);
}

/* No contact holds its pieces together, and the dissipated power is positive, at any velocity. */
static void check_dissipation(const setting *s)
{
    const forces f = forces_of(s);
    double power[2] = {0};
    for (int i = 0; i < D; i++) {
        power[0] += f.restitution[i] * s->v[i];
        power[1] += f.friction[i] * s->v[i];
    }
    ck_assert_double_ge(f.normal, 0);
    for (int k = 0; k < 2; k++)
        ck_assert_double_ge(power[k], -1e-12 * fabs(f.normal));
}

static double largest(const double *a, int count)
{
    double max = 0;
    for (int i = 0; i < count; i++)
        max = fmax(max, fabs(a[i]));
    return max;
}

/* Central differences with step e: truncation e^2 f'''/6 and rounding 1e-16 f/e. With lengths L of about .1
 * m and e = 1e-6 these are (e/L)^2 = 1e-10 and 1e-9, times powers of 10 for short gaps: 2e-6 of the largest
 * entry. The closest points of edges at an angle of 1e-2 move within L = 1e-3 .. 1e-4, so e = 2e-9, and
 * rounding is 1e-16 L / e / angle^2 = 1e-5. */
static void compare(const char *what, const double *exact, const double *difference, int count, double limit)
{
    double scale = fmax(largest(exact, count), 1e-9);
    for (int i = 0; i < count; i++)
        ck_assert_msg(fabs(exact[i] - difference[i]) <= limit * scale, "%s[%d]: %.12g, by differences %.12g",
                      what, i, exact[i], difference[i]);
}

static void check_derivatives(setting *s, double e, double limit)
{
    derivatives exact;
    const forces here = forces_of(s);
    double energy[D], h[D * D], restitution[2][D * D], friction[2][D * D], normal[2][D];
    derive(s, &exact);
    check_dissipation(s);
    for (int j = 0; j < D; j++) {
        const double x = s->x[j];
        s->x[j] = x + e;
        energy[j] = energy_of(s);
        s->x[j] = x - e;
        energy[j] = (energy[j] - energy_of(s)) / (2 * e);
        s->x[j] = x;
        for (int k = 0; k < 2; k++) {
            double *coordinate = k ? &s->x[j] : &s->v[j];
            const forces after = forces_beside(s, coordinate, e), before = forces_beside(s, coordinate, -e);
            normal[k][j] = (after.normal - before.normal) / (2 * e);
            for (int i = 0; i < D; i++) {
                restitution[k][D * i + j] = (after.restitution[i] - before.restitution[i]) / (2 * e);
                friction[k][D * i + j] = (after.friction[i] - before.friction[i]) / (2 * e);
                if (k)
                    h[D * i + j] = (after.elastic[i] - before.elastic[i]) / (2 * e);
            }
        }
    }
    compare("g", here.elastic, energy, D, limit);
    compare("h", exact.h, h, D * D, limit);
    for (int k = 0; k < 2; k++) {
        compare(k ? "dN/dx" : "dN/dv", exact.normal[k], normal[k], D, limit);
        compare(k ? "drestitution/dx" : "drestitution/dv", exact.restitution[k], restitution[k], D * D,
                limit);
        compare(k ? "dfriction/dx" : "dfriction/dv", exact.friction[k], friction[k], D * D, limit);
    }
    for (int i = 0; i < D; i++)
        for (int j = 0; j < i; j++)
            ck_assert_double_le(fabs(exact.h[D * i + j] - exact.h[D * j + i]),
                                1e-10 * largest(exact.h, D * D));
}

/* Which of the weights are 0 identifies the region of the closest points. */
static int region_of(const setting *s)
{
    const drape_gap gap = gap_of(s);
    int region = 0;
    for (int a = 0; a < 4; a++)
        region = 2 * region + (gap.closest.c[a] != 0);
    return region;
}

/* Random active pairs, until every region has occurred often enough. Derivatives jump where regions meet,
 * so all points of a difference must be in the same region. */
static void check_kind(drape_pair_kind kind, double speed, double low)
{
    uint64_t seed = 7 + (uint64_t)kind;
    int met[16] = {0}, tried = 0;
    for (int k = 0; k < 3000; k++) {
        setting s = {
            .pair = {.kind = kind, .node = {0, 1, 2, 3}, .collider = -1, .radius = 0.01, .distance = 0.2},
            .law = {.distance = 0.2,
                    .low = low,
                    .stiffness = 3,
                    .friction = 0.4,
                    .velocity = 0.05,
                    .damping = 0.6,
                    .restitution_velocity = 0.4}};
        fill(&seed, 0.1, s.x, D);
        fill(&seed, speed, s.v, D);
        fill(&seed, 0.1, s.rest, D);
        const drape_gap gap = gap_of(&s);
        double edge = 1;
        for (int a = 0; a < 4; a++)
            if (gap.closest.c[a] != 0)
                edge = fmin(edge, fmin(fabs(gap.closest.c[a]),
                                       fabs(gap.closest.c[a]) == 1 ? 1 : 1 - fabs(gap.closest.c[a])));
        if (!(gap.value > 0.01) || edge < 0.05 || gap.value > 0.19)
            continue;
        if (++met[region_of(&s)] > 40)
            continue;
        check_derivatives(&s, 1e-6, 2e-6);
        tried++;
    }
    int regions = 0;
    for (int r = 0; r < 16; r++)
        regions += met[r] > 0;
    ck_assert_int_ge(regions, kind == DRAPE_PAIR_TRIANGLE ? 7 : 8);
    ck_assert_int_ge(tried, 100);
}

TEST(test_triangle)
{
    check_kind(DRAPE_PAIR_TRIANGLE, 1, DRAPE_LEAST_GAP);    /* sliding */
    check_kind(DRAPE_PAIR_TRIANGLE, 0.01, DRAPE_LEAST_GAP); /* sticking */
    check_kind(DRAPE_PAIR_TRIANGLE, 1, DRAPE_BARRIER_BOUNDED);
}

TEST(test_segments)
{
    check_kind(DRAPE_PAIR_SEGMENTS, 1, DRAPE_LEAST_GAP);
    check_kind(DRAPE_PAIR_SEGMENTS, 0.01, DRAPE_LEAST_GAP);
    check_kind(DRAPE_PAIR_SEGMENTS, 1, DRAPE_BARRIER_BOUNDED);
}

/* Nearly parallel edges above each other, where the mollifier acts. */
TEST(test_parallel)
{
    uint64_t seed = 3;
    for (int k = 0; k < 200; k++) {
        setting s = {
            .pair = {.kind = DRAPE_PAIR_SEGMENTS, .node = {0, 1, 2, 3}, .collider = -1, .distance = 0.2},
            .law = {.distance = 0.2,
                    .low = DRAPE_LEAST_GAP,
                    .stiffness = 3,
                    .friction = 0.4,
                    .velocity = 0.05,
                    .damping = 0.6,
                    .restitution_velocity = 0.4},
            .x = {-0.1, 0, 0, 0.1, 0, 0, -0.1, 0.05, -0.001, 0.1, 0.05, 0.001},
            .rest = {-0.1, 0, 0, 0.1, 0, 0, -0.1, 0.05, 0, 0.1, 0.05, 0}};
        double noise[D];
        fill(&seed, 2e-4, noise, D);
        fill(&seed, 1, s.v, D);
        for (int i = 0; i < D; i++)
            s.x[i] += noise[i];
        const drape_gap gap = gap_of(&s);
        ck_assert(gap.mollified);
        if (fabs(gap.closest.c[0]) < 0.1 || fabs(gap.closest.c[1]) < 0.1 || fabs(gap.closest.c[2]) < 0.1 ||
            fabs(gap.closest.c[3]) < 0.1)
            continue; /* near an end, where the derivatives jump */
        check_derivatives(&s, 2e-9, 1e-4);
    }
}

/* For parallel edges the energy is 0, whatever their closest points are. */
TEST(test_mollified_away)
{
    setting s = {.pair = {.kind = DRAPE_PAIR_SEGMENTS, .node = {0, 1, 2, 3}, .collider = -1, .distance = 0.2},
                 .law = {.distance = 0.2, .low = DRAPE_LEAST_GAP, .stiffness = 3},
                 .x = {-0.1, 0, 0, 0.1, 0, 0, -0.08, 0.05, 0, 0.12, 0.05, 0},
                 .rest = {-0.1, 0, 0, 0.1, 0, 0, -0.1, 0.05, 0, 0.1, 0.05, 0}};
    ck_assert_double_eq(energy_of(&s), 0);
}

/* The barrier is C2 where it begins and where its parabola takes over, and its force is always repulsive. */
static void check_barrier(double low)
{
    const double joints[] = {1, low}, e = 1e-9;
    for (int k = 0; k < 2; k++) {
        drape_barrier a = drape_barrier_at(joints[k] - e, low), b = drape_barrier_at(joints[k] + e, low);
        double third = k ? 2 / pow(low, 3) + 4 / pow(low, 2) : 8; /* bounds b''' */
        ck_assert_double_le(fabs(a.ddb - b.ddb), 2 * e * 4 * third);
        ck_assert_double_le(fabs(a.db - b.db), 2 * e * (fabs(a.ddb) + 1));
        ck_assert_double_le(fabs(a.b - b.b), 2 * e * (fabs(a.db) + 1));
    }
    double last = -INFINITY;
    for (double s = -2; s < 1; s += 1e-3) {
        ck_assert_double_lt(drape_barrier_at(s, low).db, 0);
        ck_assert_double_gt(drape_barrier_at(s, low).db, last); /* convex */
        last = drape_barrier_at(s, low).db;
    }
}

/* The bounded one is C2 where it begins: b''' is at most 6. Its force grows with depth, to the scale. */
TEST(test_bounded_barrier)
{
    const double e = 1e-9;
    const drape_barrier at = drape_barrier_at(1 - e, DRAPE_BARRIER_BOUNDED);
    ck_assert(at.ddb <= 7 * e && -at.db <= 7 * e * e && at.b <= 7 * e * e * e);
    double last = -1;
    for (double s = -20; s < 1; s += 1e-3) {
        const drape_barrier b = drape_barrier_at(s, DRAPE_BARRIER_BOUNDED);
        ck_assert(b.db < 0 && b.db > last);
        last = b.db;
    }
    /* 1 + b' = (3 y + 1) / (1 + y)^3, the y^2 of the numerator cancel: 3/y^2 of the scale is left */
    ck_assert_double_eq_tol(-drape_barrier_at(-999, DRAPE_BARRIER_BOUNDED).db, 1, 4e-6);
}

/* At the least gap it withstands 1/DRAPE_LEAST_GAP times its scale: b' = -1/s to a hundredth there, as 2
 * s ln s and 2 s are. The gentle one agrees with it from DRAPE_BARRIER_PARABOLA on, so that a pair that
 * comes out keeps its energy. */
TEST(test_barrier)
{
    check_barrier(DRAPE_BARRIER_PARABOLA);
    check_barrier(DRAPE_LEAST_GAP);
    ck_assert_double_eq_tol(drape_barrier_at(DRAPE_LEAST_GAP, DRAPE_LEAST_GAP).db * DRAPE_LEAST_GAP, -1,
                            0.02);
    for (double s = DRAPE_BARRIER_PARABOLA; s < 1; s += 1e-2) {
        ck_assert_double_eq(drape_barrier_at(s, DRAPE_LEAST_GAP).b,
                            drape_barrier_at(s, DRAPE_BARRIER_PARABOLA).b);
        ck_assert_double_eq(drape_barrier_at(s, DRAPE_LEAST_GAP).db,
                            drape_barrier_at(s, DRAPE_BARRIER_PARABOLA).db);
    }
}

/* On a path that is reported as free, the gap never falls below what must be kept of it. A path that is
 * not free is cut before that, and after most of the rest is gone. A trial state
 * keeps half of what is above the least gap, a step half of the least gap; a pair that begins below it
 * keeps half of its gap. */
static void check_step_fraction(const drape_keep *keep, double distance)
{
    uint64_t seed = 11;
    int cut = 0, whole = 0, below = 0;
    for (int k = 0; k < 2000; k++) {
        drape_pair pair = {.kind = k % 2 ? DRAPE_PAIR_SEGMENTS : DRAPE_PAIR_TRIANGLE,
                           .node = {0, 1, 2, 3},
                           .collider = -1,
                           .distance = distance,
                           .radius = k % 3 ? 0 : 0.01};
        double x[D], y[D], at[D], smallest = INFINITY;
        const drape_configuration configuration = {.x = at};
        fill(&seed, 0.1, x, D);
        fill(&seed, 0.1, y, D);
        memcpy(at, x, sizeof at);
        const double start = drape_pair_gap_value(&pair, &configuration),
                     least = drape_pair_least_gap(&pair, keep->rounding);
        if (!(start > 1e-3))
            continue;
        const double kept = drape_keep_gap(keep, least, start, distance);
        double fraction = drape_pair_step_fraction(&pair, x, y, NULL, keep, 1);
        ck_assert_double_eq(drape_pair_step_fraction(&pair, x, y, NULL, keep, 0.5 * fraction),
                            0.5 * fraction);
        ck_assert_double_eq(drape_pair_step_fraction(&pair, x, y, NULL, keep, 0.5 + 0.5 * fraction),
                            fraction < 1 ? fraction : 1);
        for (int i = 0; i <= 200; i++) {
            for (int j = 0; j < D; j++)
                at[j] = x[j] + fraction * i / 200 * (y[j] - x[j]);
            smallest = fmin(smallest, drape_pair_gap_value(&pair, &configuration));
        }
        cut += fraction < 1;
        whole += fraction == 1;
        below += fraction < 1 && start < least;
        if (fraction < 1) {
            ck_assert_double_ge(smallest, (1 - 1e-9) * kept);
            ck_assert_double_le(drape_pair_gap_value(&pair, &configuration), 1.2 * kept);
        } else {
            ck_assert_double_gt(smallest, 0);
        }
    }
    ck_assert_int_ge(cut, 50);
    ck_assert_int_ge(whole, 50);
    ck_assert_int_eq(below > 0, distance > 1);
}

TEST(test_step_fraction)
{
    const drape_keep trial = {.rounding = 1e-12, .least = 1, .above = 0.5, .below = 0.5},
                     step = {.rounding = 1e-12, .least = 0.5, .below = 0.5};
    check_step_fraction(&trial, 0.2);
    check_step_fraction(&step, 0.2);
    check_step_fraction(&step, 10); /* least gap: 1 cm */
}

/* A trial state may bring a pair from far beyond the activation distance to a share of it at once, and one
 * from just beyond it as far as if it were within. */
TEST(test_arrival)
{
    const drape_keep trial = {.least = 1, .above = 0.5, .below = 0.5, .arrival = 0.4};
    ck_assert_double_eq(drape_keep_gap(&trial, 1e-5, 1, 0.01), 0.4 * 0.01);
    ck_assert_double_eq(drape_keep_gap(&trial, 0.005, 1, 0.01), 0.005); /* never below the least gap */
    ck_assert_double_eq(drape_keep_gap(&trial, 0, 0.011, 0.02), 0.5 * 0.011);
    ck_assert_double_eq(drape_keep_gap(&trial, 0, 0.009, 0.01), 0.5 * 0.009);
    ck_assert_double_eq(drape_keep_gap(&trial, 0, 0.0101, 0.01), 0.4 * 0.01);
}

/* A path that ends beyond the other piece is never free, however little the gap is, down to a tenth of the
 * rounding: a pair at the least gap of rounding is not exempt if the rounding becomes larger. */
TEST(test_no_gap_is_exempt)
{
    const drape_keep step = {.rounding = 1e-12, .least = 0.5, .below = 0.5};
    for (int collider = -1; collider < 1; collider++)
        for (double gap = 1e-2; gap > 1e-13; gap /= 2) {
            const drape_pair pair = {
                .kind = DRAPE_PAIR_TRIANGLE, .node = {0, 1, 2, 3}, .collider = collider, .distance = 1e-2};
            double x[D] = {0.1, gap, 0.1, 0, 0, 0, 1, 0, 0, 0, 0, 1}, y[D];
            memcpy(y, x, sizeof y);
            y[1] = -1e-3;
            ck_assert_double_lt(drape_pair_step_fraction(&pair, x, y, NULL, &step, 1), 1);
        }
}

typedef struct found {
    int32_t elements[1000];
    int count;
} found;

static void note(void *user, int32_t element)
{
    found *f = user;
    f->elements[f->count++] = element;
}

/* Whether no axis separates two boxes by the same side at both ends of their paths. */
static bool stay_together(const drape_box a[2], const drape_box b[2])
{
    for (int k = 0; k < 3; k++)
        if ((a[0].high[k] < b[0].low[k] && a[1].high[k] < b[1].low[k]) ||
            (a[0].low[k] > b[0].high[k] && a[1].low[k] > b[1].high[k]))
            return false;
    return true;
}

static bool is_marked(const bool *marked, const int32_t *edge)
{
    return !marked || marked[edge[0]] || marked[edge[1]];
}

/* Every element, marked if this is wanted, that no axis separates from the query is found once, in the
 * order of its place, also after the positions have changed. */
static void check_tree(drape_arena *arena, int32_t count)
{
    uint64_t seed = 5;
    double x[300], y[300];
    int32_t edge[400];
    bool marked[100];
    drape_path_bvh tree;
    fill(&seed, 1, x, 300);
    for (int i = 0; i < 400; i++)
        edge[i] = (int32_t)(fabs(next_number(&seed)) * 99.9);
    ck_assert_int_eq(drape_path_bvh_build(arena, count, 2, edge, x, &tree), DRAPE_OK);
    for (int k = 0; k < 100; k++) {
        const int32_t node = k;
        const double *const ends[2] = {x, k % 2 ? y : x};
        const bool *const marks = k % 4 < 2 ? marked : NULL;
        const drape_path_query query = {.node = &node,
                                        .nodes = 1,
                                        .x = x,
                                        .y = k % 2 ? y : NULL,
                                        .reach = 0.3,
                                        .only_marked = marks && k % 4 == 1};
        found f = {.count = 0};
        fill(&seed, 1, x, 300);
        fill(&seed, 1, y, 300);
        for (int i = 0; i < 100; i++)
            marked[i] = next_number(&seed) > 0.8;
        drape_path_bvh_fit(&tree, x, k % 2 ? y : NULL, marks, NULL);
        drape_path_bvh_query(&tree, &query, note, &f);
        uint8_t side[100];
        found scanned = {.count = 0};
        int32_t point[100];
        for (int32_t i = 0; i < 100; i++)
            point[i] = i;
        const drape_path_elements all = {tree.order, point, count, 100};
        drape_path_bvh_scan(&tree, &query, &all, marks, side, note, &scanned);
        ck_assert_int_eq(scanned.count, f.count);
        ck_assert_int_eq(memcmp(scanned.elements, f.elements, (size_t)f.count * sizeof *f.elements), 0);
        for (int i = 1; i < f.count; i++)
            ck_assert_int_lt(tree.place[f.elements[i - 1]], tree.place[f.elements[i]]);
        for (int32_t e = 0; e < count; e++) {
            drape_box own[2], box[2];
            int times = 0;
            for (int end = 0; end < 2; end++) {
                own[end] = drape_box_of(edge + 2 * e, 2, ends[end], 0);
                box[end] = drape_box_of(&node, 1, ends[end], 0.3);
            }
            for (int i = 0; i < f.count; i++)
                times += f.elements[i] == e;
            ck_assert_int_eq(times, stay_together(own, box) &&
                                        (!query.only_marked || is_marked(marks, edge + 2 * e)));
        }
    }
}

/* How often two elements met. */
typedef struct meetings {
    int times[100][100];
} meetings;

static void note_meeting(void *user, int32_t a, int32_t b)
{
    ((meetings *)user)->times[a][b]++;
}

/* Two trees, one with boxes that are enlarged, meet in every pair with a marked element that no axis
 * separates, once, and a tree meets itself in every such pair of different elements. */
static void check_join(drape_arena *arena, int32_t count, int32_t others)
{
    static meetings met, itself;
    uint64_t seed = 11;
    double x[300], y[300], grow[100];
    int32_t edge[200], point[100];
    bool marked[100];
    drape_path_bvh edges, points;
    fill(&seed, 1, x, 300);
    for (int i = 0; i < 200; i++)
        edge[i] = (int32_t)(fabs(next_number(&seed)) * 99.9);
    for (int i = 0; i < 100; i++) {
        point[i] = i;
        grow[i] = 0.3 * fabs(next_number(&seed));
    }
    ck_assert_int_eq(drape_path_bvh_build(arena, count, 2, edge, x, &edges), DRAPE_OK);
    ck_assert_int_eq(drape_path_bvh_build(arena, others, 1, point, x, &points), DRAPE_OK);
    for (int k = 0; k < 8; k++) {
        const bool moves = k % 2, *marks = k % 4 < 2 ? marked : NULL;
        const double *const ends[2] = {x, moves ? y : x};
        memset(&met, 0, sizeof met);
        memset(&itself, 0, sizeof itself);
        fill(&seed, 1, x, 300);
        fill(&seed, 1, y, 300);
        for (int i = 0; i < 100; i++)
            marked[i] = next_number(&seed) > 0.8;
        drape_path_bvh_fit(&edges, x, moves ? y : NULL, marks, NULL);
        drape_path_bvh_fit(&points, x, moves ? y : NULL, marks, grow);
        drape_path_bvh_join(&points, &edges, moves, 0.1, note_meeting, &met);
        drape_path_bvh_join(&edges, &edges, moves, 0.2, note_meeting, &itself);
        for (int32_t a = 0; a < 100; a++)
            for (int32_t b = 0; b < 100; b++) {
                if (b >= count) { /* there is no such edge */
                    ck_assert(met.times[a][b] == 0 && itself.times[a][b] + itself.times[b][a] == 0);
                    continue;
                }
                drape_box of_point[2], of_edge[2], own[2];
                for (int end = 0; end < 2; end++) {
                    of_point[end] = drape_box_of(point + a, 1, ends[end], 0.1 + grow[a]);
                    of_edge[end] = drape_box_of(edge + 2 * b, 2, ends[end], 0);
                    own[end] = drape_box_of(edge + 2 * a, 2, ends[end], 0.2);
                }
                ck_assert_int_eq(met.times[a][b], a < others && stay_together(of_point, of_edge) &&
                                                      (is_marked(marks, edge + 2 * b) || !marks || marks[a]));
                if (a < b)
                    ck_assert_int_eq(itself.times[a][b] + itself.times[b][a],
                                     stay_together(own, of_edge) &&
                                         (is_marked(marks, edge + 2 * a) || is_marked(marks, edge + 2 * b)));
                ck_assert(a != b || itself.times[a][b] == 0);
            }
    }
}

TEST(test_join)
{
    scoped_context *ctx = NULL;
    ck_assert_int_eq(drape_context_create(NULL, &ctx), DRAPE_OK);
    drape_arena arena = drape_arena_of(ctx);
    for (int32_t count = 0; count < 6; count++)
        check_join(&arena, count, 5 - count);
    check_join(&arena, 100, 1);
    check_join(&arena, 3, 100);
    check_join(&arena, 100, 77);
    drape_arena_free(&arena);
}

/* Pairs of two stages, each in any order, some with the same piece: by rank, all of them, and what is
 * sorted stays. */
TEST(test_sort)
{
    scoped_context *ctx = NULL;
    ck_assert_int_eq(drape_context_create(NULL, &ctx), DRAPE_OK);
    drape_arena arena = drape_arena_of(ctx);
    drape_pair_sorter sorter = {.arena = &arena};
    drape_pair pairs[250], before[250];
    uint64_t seed = 3;
    for (int round = 0; round < 3; round++) {
        double sum = 0;
        for (int32_t i = 0; i < 250; i++) {
            const int32_t stage = i < 5 ? -1 : i > 150;
            pairs[i] = (drape_pair){.area = i,
                                    .rank = {stage, stage < 0 ? i : (int32_t)(fabs(next_number(&seed)) * 40),
                                             stage < 0 ? 0 : (int32_t)(fabs(next_number(&seed)) * 9000)}};
        }
        ck_assert_int_eq(drape_sort_pairs(&sorter, pairs, 250), DRAPE_OK);
        for (int32_t i = 0; i < 250; i++) {
            sum += pairs[i].area;
            ck_assert(i == 0 || !drape_pair_is_before(&pairs[i], &pairs[i - 1]));
        }
        ck_assert_double_eq(sum, 250 * 249 / 2);
        memcpy(before, pairs, sizeof pairs);
        ck_assert_int_eq(drape_sort_pairs(&sorter, pairs, 250), DRAPE_OK);
        ck_assert_int_eq(memcmp(before, pairs, sizeof pairs), 0);
    }
    drape_arena_free(&arena);
}

TEST(test_tree)
{
    scoped_context *ctx = NULL;
    ck_assert_int_eq(drape_context_create(NULL, &ctx), DRAPE_OK);
    drape_arena arena = drape_arena_of(ctx);
    for (int32_t count = 0; count < 8; count++)
        check_tree(&arena, count);
    check_tree(&arena, 200);
    drape_arena_free(&arena);
}

/* The bounds are below the distance anywhere on the path, and positive for most pieces that pass each
 * other at a distance. */
TEST(test_bounds)
{
    uint64_t seed = 11;
    int positive = 0;
    for (int k = 0; k < 4000; k++) {
        const drape_pair pair = {
            .kind = k % 2 ? DRAPE_PAIR_TRIANGLE : DRAPE_PAIR_SEGMENTS, .node = {0, 1, 2, 3}, .collider = -1};
        double x[D], y[D], common[3], at[D];
        fill(&seed, 1, x, D);
        fill(&seed, 0.3, y, D);
        fill(&seed, 100, common, 3);
        x[0] += k % 4 < 2 ? 3 : 0;
        for (int i = 0; i < D; i++)
            y[i] += x[i] + common[i % 3];
        const double bound = drape_bound_by_axes(&pair, x, y), change = drape_bound_change(&pair, x, y);
        const double start = drape_pair_gap_value(&pair, &(drape_configuration){.x = x});
        positive += bound > 0;
        for (int step = 0; step <= 10; step++) {
            for (int i = 0; i < D; i++)
                at[i] = x[i] + 0.1 * step * (y[i] - x[i]);
            const double gap = drape_pair_gap_value(&pair, &(drape_configuration){.x = at});
            ck_assert_double_ge(gap, bound - 1e-12);
            ck_assert(bound < 1e-9 || (drape_bound_is_apart(&pair, x, y, bound * (1 - 1e-9)) &&
                                       !drape_bound_is_apart(&pair, x, y, bound * (1 + 1e-9))));
            ck_assert_double_le(fabs(gap - start), change + 1e-12);
            if (step == 0)
                ck_assert_double_le(drape_bound_by_axes(&pair, x, NULL), gap + 1e-12);
        }
    }
    ck_assert_int_gt(positive, 1000);
}

/* The secant of a predicted force ends at the gap where the law has that force, to 20 bisections of its
 * logarithm over a factor of 1000: 1e-5 of the gap; with restitution, its rate changes as well. Close to the
 * present force it is the tangent. */
TEST(test_predicted)
{
    for (int k = 0; k < 2; k++) {
        const drape_contact_law law = {.distance = 0.2,
                                       .low = DRAPE_LEAST_GAP,
                                       .stiffness = 3,
                                       .damping = k,
                                       .restitution_velocity = 0.5};
        drape_gap gap = {.value = 0.02, .closest = {.points = 1, .c = {1}, .normal = {0, 1, 0}}, .m = 1};
        const double weight = k ? 10 : 0;
        double v[4][3] = {{0.3, -0.2, 0}}, moved[4][3] = {{0}};
        for (int side = 0; side < 2; side++) {
            const double target = side ? 0.05 : 0.002;
            drape_gap at = gap;
            at.value = target;
            moved[0][1] = v[0][1] + weight * (target - gap.value);
            const drape_normal now = drape_normal_at(&gap, &law, v), then = drape_normal_at(&at, &law, moved);
            const double force = drape_normal_force(&then), rise = force - drape_normal_force(&now);
            const double stiffness = drape_predicted_stiffness(&gap, &law, weight, v, force);
            ck_assert_double_gt(fabs(rise), 0);
            ck_assert_double_eq_tol(gap.value - rise / stiffness, target, 2e-5 * target);
            ck_assert(
                isnan(drape_predicted_stiffness(&gap, &law, weight, v, 1.05 * drape_normal_force(&now))));
        }
    }
}

/* What is kept of a contact is not used for another gap, weight, velocity or force. */
TEST(test_kept_predictions)
{
    const drape_contact_law law = {.distance = 0.2, .low = DRAPE_LEAST_GAP, .stiffness = 3};
    drape_active_contact contact = {
        .pair = {.node = {1, -1, -1, -1}, .collider = 0},
        .gap = {.value = 0.02, .closest = {.points = 1, .c = {1}, .normal = {0, 1, 0}}, .m = 1}};
    double v[4][3] = {{0}};
    scoped_context *ctx = NULL;
    ck_assert_int_eq(drape_context_create(NULL, &ctx), DRAPE_OK);
    drape_arena arena = drape_arena_of(ctx);
    drape_predictions list;
    ck_assert_int_eq(drape_predictions_init(&arena, 2, &list), DRAPE_OK);
    ck_assert_int_eq(drape_predictions_reserve(&list, 1), DRAPE_OK);
    ck_assert(isnan(drape_predictions_stiffness(&list, &contact, &law, 1, v)));
    ck_assert(drape_predictions_add(&list, &contact, 30));
    for (int k = 0; k < 7; k++) {
        if (k == 6) {
            drape_predictions_clear(&list);
            ck_assert(drape_predictions_add(&list, &contact, 40));
        }
        contact.gap.value = k < 2 ? 0.02 : 0.03;
        contact.gap.m = k < 3 ? 1 : 2;
        v[0][1] = k < 4 ? 0 : 0.1;
        const double weight = k < 5 ? 10 : 20,
                     kept = drape_predictions_stiffness(&list, &contact, &law, weight, v);
        ck_assert_double_gt(kept, 0);
        ck_assert_double_eq(kept, drape_predicted_stiffness(&contact.gap, &law, weight, v, k < 6 ? 30 : 40));
    }
    drape_arena_free(&arena);
}
