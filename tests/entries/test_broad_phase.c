/*
 * test_broad_phase.c: what contact finds is compared with a search among all pairs, without a tree, on sheets
 * that are folded, crumpled and thrown at random beside colliders, in steps from far below the margin of a
 * search to many edges; and with what a contact finds that has no candidates of earlier searches.
 */
#include "contact/contact_parts.h"
#include "entries/models.h"
#include "support/scene.h"

#define ROUNDS   160
#define ROUNDING 1e-14 /* [m] some eps of the coordinates, between the gaps of pairs that are one contact */

typedef struct all_pairs {
    drape_contact *contact; /* which is only read */
    drape_candidates list;  /* every pair, with its activation distance */
    drape_active_set active;
} all_pairs;

static bool share(const int32_t *a, int count, const int32_t *b, int other)
{
    for (int i = 0; i < count; i++)
        for (int j = 0; j < other; j++)
            if (a[i] == b[j])
                return true;
    return false;
}

static void note(all_pairs *all, drape_pair_kind kind, int32_t collider, const int32_t *first,
                 const int32_t *second)
{
    const drape_model *m = all->contact->model;
    const drape_configuration rest = {.model = m, .x = all->contact->broad.rest};
    const int split = kind == DRAPE_PAIR_TRIANGLE ? 1 : 2;
    drape_pair pair = {.kind = kind, .collider = collider, .area = 1, .gap_at_search = -INFINITY};
    memcpy(pair.node, first, (size_t)split * sizeof *first);
    memcpy(pair.node + split, second, (size_t)(4 - split) * sizeof *second);
    pair.radius = collider >= 0 ? m->colliders[collider].shape.radius : 0;
    pair.distance = collider >= 0
                        ? m->contact.distance
                        : fmin(2 * m->contact.self_thickness, 0.5 * drape_pair_gap_value(&pair, &rest));
    all->list.set[0].pairs[all->list.set[0].count++] = pair;
}

static void note_own(all_pairs *all)
{
    const drape_model *m = all->contact->model;
    for (int32_t i = 0; i < m->node_count; i++)
        for (int32_t f = 0; f < m->triangle_count; f++)
            if (!share(&i, 1, m->triangle + 3 * f, 3))
                note(all, DRAPE_PAIR_TRIANGLE, -1, &i, m->triangle + 3 * f);
    for (int32_t e = 0; e < m->edge_count; e++)
        for (int32_t f = e + 1; f < m->edge_count; f++)
            if (!share(m->edge + 2 * e, 2, m->edge + 2 * f, 2))
                note(all, DRAPE_PAIR_SEGMENTS, -1, m->edge + 2 * e, m->edge + 2 * f);
}

static void note_colliders(all_pairs *all)
{
    const drape_model *m = all->contact->model;
    const drape_broad_phase *b = &all->contact->broad;
    for (int32_t i = m->node_count; i < b->points; i++)
        for (int32_t f = 0; f < m->triangle_count; f++)
            note(all, DRAPE_PAIR_TRIANGLE, b->point_collider[i - m->node_count], &i, m->triangle + 3 * f);
    for (int32_t s = 0; s < b->segments; s++)
        for (int32_t e = 0; e < m->edge_count; e++)
            note(all, DRAPE_PAIR_SEGMENTS, b->segment_collider[s], m->edge + 2 * e, b->segment + 2 * s);
    for (int32_t i = 0; i < m->node_count; i++) {
        for (int32_t t = 0; t < b->obstacles.count; t++)
            note(all, DRAPE_PAIR_TRIANGLE, b->triangle_collider[t], &i, b->triangle + 3 * t);
        for (int32_t k = 0; k < m->collider_count; k++)
            if (m->colliders[k].ops->smooth)
                all->list.set[0].pairs[all->list.set[0].count++] = drape_broad_phase_surface(b, i, k);
    }
}

static all_pairs list_all(drape_arena *arena, drape_contact *contact)
{
    all_pairs all = {
        .contact = contact, .list = {.broad = &contact->broad, .sets = 1}, .active = {.arena = arena}};
    all.list.set[0].pairs = drape_arena_take(arena, 40000, sizeof *all.list.set[0].pairs);
    ck_assert_ptr_nonnull(all.list.set[0].pairs);
    if (contact->model->contact.self)
        note_own(&all);
    note_colliders(&all);
    ck_assert_int_lt(all.list.set[0].count, 40000);
    return all;
}

static int by_gap(const void *a, const void *b)
{
    const double x = ((const drape_active_contact *)a)->gap.value,
                 y = ((const drape_active_contact *)b)->gap.value;
    return x < y ? -1 : x > y;
}

/* Every pair below its activation distance is active. Both lists are sorted by gap. */
static void check_active(all_pairs *all, drape_active_contact *found)
{
    const drape_contact *c = all->contact;
    const drape_configuration now = drape_contact_configuration(c);
    ck_assert_int_eq(drape_active_set_list(&all->active, &all->list, &(drape_distances){0}, &now, &c->inside,
                                           false, c->exempt),
                     DRAPE_OK);
    ck_assert_int_eq(c->active.count, all->active.count);
    if (c->active.count == 0)
        return; /* both lists may be NULL */
    memcpy(found, c->active.contacts, (size_t)c->active.count * sizeof *found);
    qsort(found, (size_t)c->active.count, sizeof *found, by_gap);
    qsort(all->active.contacts, (size_t)c->active.count, sizeof *found, by_gap);
    for (int32_t i = 0; i < c->active.count; i++)
        ck_assert_double_le(fabs(found[i].gap.value - all->active.contacts[i].gap.value), ROUNDING);
}

/* No pair touches before the fraction that is reported: returns whether one does later. */
static bool check_fraction(const all_pairs *all, const double *x, const double *y, double fraction)
{
    const drape_keep keep = {.least = 0.5, .below = 0.5};
    double least = 1;
    for (int32_t i = 0; i < all->list.set[0].count; i++)
        if (drape_pair_points(&all->list.set[0].pairs[i]) > 1)
            least =
                fmin(least, drape_pair_step_fraction(&all->list.set[0].pairs[i], x, y, NULL, &keep, least));
    ck_assert_double_le(fraction, least);
    return least < 1;
}

/* The check of a step, which looks for what can pass only, finds the same as a look at all pairs. */
static bool check_step(const all_pairs *all, drape_contact *fresh, const double *x, const double *y,
                       const drape_collider_pose *pose)
{
    const drape_model *m = fresh->model;
    const drape_straight_path path = {
        {{.model = m, .x = x, .pose = pose}, {.model = m, .x = y, .pose = pose}}};
    const drape_keep keep = drape_contact_keep_step(fresh);
    drape_pair limiting;
    double least = 1;
    for (int32_t i = 0; i < all->list.set[0].count; i++)
        if (drape_pair_points(&all->list.set[0].pairs[i]) > 1)
            least = fmin(least, drape_pair_step_fraction(&all->list.set[0].pairs[i], x, y, NULL, &keep, 1));
    ck_assert(drape_contact_free_fraction(fresh, &path, NULL, &keep, NULL, NULL, NULL, NULL, &limiting) ==
              least);
    return least < 1;
}

/* A displacement that is shortened at nodes, again and again, is shortened alike if all pairs are looked at
 * each time. */
static void check_again(drape_contact *c, drape_contact *fresh, const double *x, const double *whole,
                        double *y, double *fraction)
{
    const size_t nodes = (size_t)c->model->node_count;
    memcpy(y, whole, 3 * nodes * sizeof *y);
    for (size_t i = 0; i < nodes; i++)
        fraction[i] = 1;
    for (int pass = 0; pass < 3; pass++) {
        for (size_t i = 0; i < nodes; i++)
            fraction[nodes + i] = 1;
        const double least = drape_contact_step_fraction(c, x, y, 0, pass > 0, fraction);
        ck_assert(least == drape_contact_step_fraction(fresh, x, y, 0, false, fraction + nodes));
        ck_assert_int_eq(memcmp(fraction, fraction + nodes, nodes * sizeof *fraction), 0);
        for (size_t i = 0; i < 3 * nodes; i++)
            y[i] = x[i] + fraction[i / 3] * (y[i] - x[i]);
    }
}

/* Folds the sheets about a line, moves them as a whole and shakes them; or moves only their last nodes. */
static void move(const drape_model *m, uint64_t *seed, double *x)
{
    const double size = 0.3 * pow(10, -1.5 - 1.5 * random_number(seed)); /* 1e-3 to 1 edges, or so */
    double line[3], fold[3], whole[3], thrown = fabs(random_number(seed)) < 0.2 ? 0.5 : size;
    for (int k = 0; k < 3; k++) {
        line[k] = 5 * random_number(seed);
        fold[k] = size * random_number(seed);
        whole[k] = thrown * random_number(seed) - 0.2 * x[k];
    }
    const int32_t nodes = m->node_count, first = random_number(seed) < 0 ? nodes - nodes / 5 : 0;
    for (size_t i = 3 * (size_t)first; i < 3 * (size_t)nodes; i += 3) {
        const double along = line[0] * x[i] + line[1] * x[i + 1] + line[2] * x[i + 2];
        for (size_t k = 0; k < 3; k++)
            x[i + k] += whole[k] + fold[k] * along + 0.05 * size * random_number(seed);
    }
}

static drape_contact *open_contact(drape_arena *arena, const drape_motion *motion)
{
    drape_contact *c = NULL;
    ck_assert_int_eq(drape_contact_create(arena, motion, &c), DRAPE_OK);
    ck_assert_ptr_nonnull(c);
    return c;
}

static void compare_forces(drape_contact *a, drape_contact *b, size_t n, double *g)
{
    memset(g, 0, 2 * n * sizeof *g);
    drape_contact_add_forces(a, true, true, g);
    drape_contact_add_forces(b, true, true, g + n);
    ck_assert_int_eq(memcmp(g, g + n, n * sizeof *g), 0);
}

#define SHEET                                                                                                \
    "{'mesh': {'grid': 'square', 'columns': 6, 'rows': 5, 'width': 0.3, 'height': 0.25}, 'material': "       \
    "{'young_modulus': 1e5, 'thickness': 1e-3, 'density': 100}, 'terms': ['stretch.edge']}"

#define SELF                                                                                                 \
    "{'drape': 1, 'cloth': [" SHEET ", " SHEET "], 'self_contact': {'thickness': 1e-2, 'friction': 0.2},"    \
    "'contact': {'distance': 1.5e-2}, 'duration': 1, 'colliders': ["                                         \
    "{'type': 'box', 'center': [0.1,0.05,0], 'size': [0.1,0.06,0.1], 'rotate': [0,0,1,20]},"                 \
    "{'type': 'capsule', 'a': [-0.15,0,0], 'b': [-0.05,0.05,0.1], 'radius': 0.02},"                          \
    "{'type': 'plane', 'point': [0,-0.2,0], 'normal': [0,1,0]}]%s}"

/* So few that no trees are fitted: the nodes near each collider are looked at. */
#define FEW_FEATURES                                                                                         \
    "{'drape': 1, 'cloth': [" SHEET ", " SHEET "], 'contact': {'distance': 1.5e-2}, 'duration': 1, "         \
    "'colliders': [{'type': 'sphere', 'center': [0.1,0.1,0], 'radius': 0.05},"                               \
    "{'type': 'capsule', 'a': [-0.15,-0.06,0], 'b': [-0.05,-0.04,0.1], 'radius': 0.02},"                     \
    "{'type': 'plane', 'point': [0,-0.2,0], 'normal': [0,1,0]}]%s}"

static void check_that_all_near_is_found(const char *text, int least_active, int share_crossing)
{
    scoped_scene s = scene_model(text, "");
    const drape_model *m = s.model;
    const size_t n = 3 * (size_t)m->node_count;
    uint64_t seed = 3;
    int crossing = 0, passing = 0, active = 0, patches = 0;
    drape_arena arena = drape_arena_of(s.ctx);
    drape_motion *motion = NULL;
    ck_assert_int_eq(drape_motion_create(&arena, m, &motion), DRAPE_OK);
    drape_contact *c = open_contact(&arena, motion);
    all_pairs all = list_all(&arena, c);
    drape_active_contact *found = drape_arena_take(&arena, 40000, sizeof *found);
    double *x = drape_arena_take(&arena, n, sizeof *x), *y = drape_arena_take(&arena, n, sizeof *y),
           *g = drape_arena_take(&arena, 2 * n, sizeof *g);
    ck_assert(found && x && y && g);
    memcpy(x, m->rest, n * sizeof *x);
    for (size_t i = n / 2; i < n; i++)
        x[i] += i % 3 == 1 ? 0.03 : 0;
    for (int k = 0; k < ROUNDS; k++) {
        const drape_contact_at at = {.x = y};
        drape_arena other = drape_arena_of(s.ctx);
        drape_contact *fresh = open_contact(&other, motion);
        memcpy(y, x, n * sizeof *y);
        move(m, &seed, y);
        if (k % 5 == 0)
            ck_assert_int_eq(drape_contact_begin(c, x, NULL, 0), DRAPE_OK);
        const double fraction = drape_contact_step_fraction(c, x, y, 0, false, NULL);
        ck_assert(fraction == drape_contact_step_fraction(fresh, x, y, 0, false, NULL));
        crossing += check_fraction(&all, c->from, c->to, fraction);
        passing += check_step(&all, open_contact(&other, motion), c->from, c->to, c->path_pose);
        check_again(c, fresh, x, y, g, g + n);
        for (size_t i = 0; i < n; i++)
            y[i] = x[i] + fraction * (y[i] - x[i]);
        ck_assert_int_eq(drape_contact_evaluate_at(c, &at), DRAPE_OK);
        drape_contact *clean = open_contact(&other, motion);
        ck_assert_int_eq(drape_contact_evaluate_at(clean, &at), DRAPE_OK);
        check_active(&all, found);
        c->stiffening.factor =
            clean->stiffening.factor; /* which follows from earlier steps, not from candidates */
        compare_forces(c, clean, n, g);
        active += c->active.count;
        patches += c->step_candidates.sets > 1;
        memcpy(x, y, n * sizeof *x);
        drape_arena_free(&other);
    }
    printf("# %d pairs, %.1f active, %d of %d paths end at a collision, %d with a patch\n",
           (int)all.list.set[0].count, (double)active / ROUNDS, crossing, ROUNDS, patches);
    ck_assert_int_gt(patches, ROUNDS / 40); /* they serve where less than a tenth of the nodes leave a path */
    ck_assert_int_gt(active, least_active * ROUNDS);
    ck_assert_int_gt(crossing, ROUNDS / share_crossing);
    ck_assert_int_gt(passing, ROUNDS / share_crossing);
    drape_arena_free(&arena);
}

TEST(everything_near_is_found)
{
    check_that_all_near_is_found(SELF, 5, 10);
}

TEST(all_near_a_few_features_is_found)
{
    check_that_all_near_is_found(FEW_FEATURES, 1, 20);
}

/* A capsule comes 2 cm nearer from below to a flat sheet whose rows of nodes, 6.25 cm apart, are on both
 * sides of it. Nodes that slide on it would leave the middle of the edges between them 12 mm inside. It is
 * put where it is half of the activation distance of 2 mm away; the nearest point of oblique edges is beside
 * it. */
TEST(edges_do_not_slide_into_bodies)
{
    scoped_scene s =
        scene_model("{'drape': 1, 'cloth': [" SHEET "], 'contact': {}, 'duration': 1, 'colliders': ["
                    "{'type': 'capsule', 'a': [-0.3,-0.052,-0.03125], 'b': [0.6,-0.052,-0.03125],"
                    " 'radius': 0.05, 'track': [[0,[0,0,0]], [1,[0,1,0]]]}]%s}",
                    "");
    const drape_model *m = s.model;
    const size_t n = 3 * (size_t)m->node_count;
    drape_arena arena = drape_arena_of(s.ctx);
    drape_motion *motion = NULL;
    ck_assert_int_eq(drape_motion_create(&arena, m, &motion), DRAPE_OK);
    drape_contact *c = open_contact(&arena, motion);
    double *y = drape_arena_take(&arena, n, sizeof *y), least = INFINITY;
    ck_assert_ptr_nonnull(y);
    memcpy(y, m->rest, n * sizeof *y);
    drape_contact_set_step(c, 0.02);
    ck_assert_int_eq(drape_contact_begin(c, m->rest, NULL, 0), DRAPE_OK);
    drape_contact_sweep(c, 0.02, y);
    drape_contact_fill(c, y, c->path_pose, c->to);
    const drape_configuration end = {.model = m, .x = c->to, .pose = c->path_pose};
    for (int32_t e = 0; e < m->edge_count; e++) {
        const int32_t *k = m->edge + 2 * e;
        const drape_pair pair = {.kind = DRAPE_PAIR_SEGMENTS,
                                 .node = {k[0], k[1], c->broad.segment[0], c->broad.segment[1]},
                                 .radius = 0.05};
        least = fmin(least, drape_pair_gap_value(&pair, &end));
    }
    ck_assert_double_ge(least, 0.5e-3);
    drape_arena_free(&arena);
}

/* Sheets 3 cm apart, the lower one 5 cm above a ball: what they meet is what their velocities bring together
 * within the time, less the activation distance of 1.5 cm or, of layers, the least gap. */
TEST(what_may_be_met_is_known)
{
    scoped_scene s =
        scene_model("{'drape': 1, 'cloth': [" SHEET ", " SHEET "], 'self_contact': {'thickness': 1e-2},"
                    "'contact': {'distance': 1.5e-2}, 'duration': 1, 'colliders': ["
                    "{'type': 'sphere', 'center': [0,-0.55,0], 'radius': 0.5,"
                    " 'track': [[0,[0,0,0]], [0.5,[0,0,0]], [1,[0,0.5,0]]]}]%s}",
                    "");
    static const struct {
        double t, lower, upper, seconds; /* [s], [m/s] upwards, [s] */
        bool meets;
    } cases[] = {
        {0, 0, 0, 0.4, false},        /* all at rest */
        {0, -0.5, -0.5, 0.06, false}, /* 3 cm towards the ball */
        {0, -0.5, -0.5, 0.08, true},  /* 4 cm */
        {0, 0, -0.5, 0.05, false},    /* the upper sheet comes 2.5 cm nearer to the lower one */
        {0, 0, -0.5, 0.07, true},     {0, -0.5, -1, 0.05, false},
        {0.5, 0, 0, 0.03, false},                              /* the ball comes at 1 m/s */
        {0.5, 0, 0, 0.04, true},      {0.5, 1, 1, 0.2, false}, /* and they go along */
        {0.5, 1, 0, 0.02, false},     {0.5, 1, 0, 0.04, true},
    };
    const drape_model *m = s.model;
    const size_t n = 3 * (size_t)m->node_count;
    drape_arena arena = drape_arena_of(s.ctx);
    drape_motion *motion = NULL;
    ck_assert_int_eq(drape_motion_create(&arena, m, &motion), DRAPE_OK);
    double *x = drape_arena_take(&arena, n, sizeof *x), *v = drape_arena_take(&arena, n, sizeof *v);
    ck_assert(x && v);
    memcpy(x, m->rest, n * sizeof *x);
    for (size_t i = n / 2 + 1; i < n; i += 3)
        x[i] += 0.03;
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        drape_contact *c = open_contact(&arena, motion);
        for (size_t i = 1; i < n; i += 3)
            v[i] = i < n / 2 ? cases[k].lower : cases[k].upper;
        for (int begun = 0; begun < 2; begun++) {
            ck_assert_msg(drape_contact_may_meet(c, x, v, cases[k].t, cases[k].seconds) == cases[k].meets,
                          "case %d", (int)k);
            ck_assert_int_eq(drape_contact_begin(c, x, v, cases[k].t), DRAPE_OK);
        }
    }
    drape_arena_free(&arena);
}
