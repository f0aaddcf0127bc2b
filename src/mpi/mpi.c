/*
 * mpi.c: see mpi.h. The part of a compiled model that one rank has: the nodes that it owns, every element,
 * edge and triangle that touches one of these, and copies of the other nodes of these. Forces and rows of
 * matrices of its own nodes are complete without any other rank, and are sums of the same numbers in the same
 * order as in one process.
 */
#include "mpi/mpi.h"

#include "compile/stages.h"
#include "compile/term_builder.h"
#include "mpi/mpi_ranks.h"
#include "sim/identity.h"

#include <math.h>
#include <petscsys.h>
#include <stdlib.h>
#include <string.h>

struct drape_mpi {
    drape_context *ctx;
    drape_mpi_ranks *ranks;
};

/* Open MPI, MPICH and Intel MPI, and Slurm by PMIx. */
bool drape_mpi_is_launched(void)
{
    static const char *const names[] = {"OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "PMIX_RANK"};
    bool launched = false;
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        launched = launched || getenv(names[i]);
    return launched;
}

/* Failures of PETSc are return codes; it prints nothing. */
static PetscErrorCode keep_quiet(MPI_Comm comm, int line, const char *function, const char *file,
                                 PetscErrorCode code, PetscErrorType type, const char *message, void *user)
{
    (void)comm, (void)line, (void)function, (void)file, (void)type, (void)message, (void)user;
    return code;
}

drape_status drape_mpi_begin(drape_context *ctx, drape_mpi **out)
{
    int count = 1, provided;
    *out = NULL;
    if (MPI_Init_thread(NULL, NULL, MPI_THREAD_FUNNELED, &provided))
        return drape_fail(ctx, DRAPE_E_SOLVER, "MPI cannot start");
    MPI_Comm_size(MPI_COMM_WORLD, &count);
    if (count == 1) {
        MPI_Finalize();
        return DRAPE_OK;
    }
    drape_mpi *mpi = drape_alloc(ctx, 1, sizeof *mpi);
    *out = mpi;
    if (!mpi)
        return DRAPE_E_MEMORY;
    PetscErrorCode code;
    if ((code = PetscOptionsSetValue(NULL, "-no_signal_handler", NULL)) ||
        (code = PetscOptionsSetValue(NULL, "-skip_petscrc", NULL)) || (code = PetscInitializeNoArguments()) ||
        (code = PetscPushErrorHandler(keep_quiet, NULL)))
        return drape_fail(ctx, DRAPE_E_SOLVER, "PETSc cannot start: code %d", (int)code);
    mpi->ctx = ctx;
    return drape_mpi_ranks_create(ctx, PETSC_COMM_WORLD, &mpi->ranks);
}

void drape_mpi_end(drape_mpi **out)
{
    drape_mpi *mpi = *out;
    if (!mpi)
        return;
    drape_mpi_ranks_destroy(&mpi->ranks);
    drape_free(mpi->ctx, mpi);
    *out = NULL;
    PetscFinalize();
    MPI_Finalize();
}

int drape_mpi_rank(const drape_mpi *mpi)
{
    return mpi ? mpi->ranks->base.rank : 0;
}

int drape_mpi_count(const drape_mpi *mpi)
{
    return mpi ? mpi->ranks->base.count : 1;
}

int drape_mpi_agree(const drape_mpi *mpi, bool here, int *value)
{
    if (!mpi)
        return here ? 0 : -1;
    const drape_ranks *ranks = &mpi->ranks->base;
    if (!drape_ranks_any(ranks, here))
        return -1;
    const int from = drape_ranks_find(ranks, here);
    ranks->broadcast(ranks, from, value, sizeof *value);
    return from;
}

bool drape_mpi_is_same(const drape_mpi *mpi, uint64_t value)
{
    uint64_t first = value;
    if (!mpi)
        return true;
    mpi->ranks->base.broadcast(&mpi->ranks->base, 0, &first, sizeof first);
    return drape_ranks_all(&mpi->ranks->base, first == value);
}

/* ---- Which rank owns which node ----
 *
 * By recursive coordinate bisection of where the nodes start: a plane across the longest side of their box
 * parts them in proportion to the ranks of either side. Runs on the same number of ranks have the same parts;
 * those of PT-Scotch differed from run to run. */

typedef struct place {
    double x; /* along the longest side of the box */
    int32_t node;
} place;

static int compare(const void *a, const void *b)
{
    const place *p = a, *q = b;
    return p->x < q->x ? -1 : p->x > q->x ? 1 : p->node < q->node ? -1 : 1;
}

/* Gives these nodes to `count` ranks from `first` on. */
static void bisect(const drape_model *m, place *places, int64_t n, int first, int ranks, int32_t *owner)
{
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    int axis = 0;
    for (int64_t i = 0; i < n; i++) {
        owner[places[i].node] = first;
        for (int k = 0; k < 3; k++) {
            const double x = m->start[3 * (size_t)places[i].node + (size_t)k];
            low[k] = fmin(low[k], x);
            high[k] = fmax(high[k], x);
        }
    }
    if (ranks == 1)
        return;
    for (int k = 1; k < 3; k++)
        axis = high[k] - low[k] > high[axis] - low[axis] ? k : axis;
    for (int64_t i = 0; i < n; i++)
        places[i].x = m->start[3 * (size_t)places[i].node + (size_t)axis];
    qsort(places, (size_t)n, sizeof *places, compare);
    const int half = ranks / 2;
    const int64_t cut = n * half / ranks;
    bisect(m, places, cut, first, half, owner);
    bisect(m, places + cut, n - cut, first + half, ranks - half, owner);
}

/* owner (node_count): the rank of each node; the same on all ranks, and each rank owns a free node. The free
 * nodes first, then the pinned ones, so that each rank has some of both. */
static drape_status partition(const drape_mpi_ranks *r, const drape_model *m, int32_t *owner)
{
    if (m->free_count < r->base.count)
        return drape_fail(m->ctx, DRAPE_E_ARGUMENT, "there are %d free nodes for %d ranks",
                          (int)m->free_count, r->base.count);
    place *places = drape_alloc(m->ctx, (size_t)m->node_count, sizeof *places);
    if (!places)
        return DRAPE_E_MEMORY;
    for (int pinned = 0; pinned < 2; pinned++) {
        int64_t n = 0;
        for (int32_t i = 0; i < m->node_count; i++)
            if ((m->pinned[i] != 0) == pinned)
                places[n++].node = i;
        bisect(m, places, n, 0, r->base.count, owner);
    }
    drape_free(m->ctx, places);
    return DRAPE_OK;
}

/* ---- What a part cannot have ---- */

/* Refuses, in one line, a model with something that a part cannot have. */
static drape_status part_check(const drape_model *m)
{
    const struct {
        bool there;
        const char *pointer, *text;
    } refused[] = {
        {m->contact.self, "/self_contact", "self-contact"},
        {m->contact.no_room == DRAPE_NO_ROOM_RELAX, "/contact/no_room", "cloth that is relaxed"},
        {m->event_count > 0, "/events", "events"},
        {m->image_set_count > 0, "/periodic", "periodic edges"},
        {m->untangle.given, "/untangle", "untangling"},
        {m->supports_move, "/cloth", "pins that hold nodes in some directions and move"},
    };
    for (size_t i = 0; i < sizeof refused / sizeof *refused; i++)
        if (refused[i].there)
            return drape_fail_at(m->ctx, DRAPE_E_ARGUMENT, refused[i].pointer,
                                 "a run on several ranks cannot have %s", refused[i].text);
    for (int32_t i = 0; i < m->term_count; i++)
        if (drape_term_turns(&m->terms[i]))
            return drape_fail_at(m->ctx, DRAPE_E_ARGUMENT, "/cloth",
                                 "a run on several ranks cannot have clamped edges that turn");
    return DRAPE_OK;
}

/* ---- Which nodes ---- */

typedef struct maker {
    const drape_model *whole;
    const int32_t *owner;
    int32_t rank;
    drape_model *m;
    drape_part *part;
    int32_t *local; /* (whole nodes) their numbers here, -1: not here; while they are marked, 0: here */
    drape_arena scratch;
} maker;

static bool touches(const maker *k, const int32_t *node, int count)
{
    for (int a = 0; a < count; a++)
        if (k->owner[node[a]] == k->rank)
            return true;
    return false;
}

static void mark(maker *k, const int32_t *node, int nodes, int32_t count)
{
    for (int32_t i = 0; i < count; i++, node += nodes)
        for (int a = 0; touches(k, node, nodes) && a < nodes; a++)
            k->local[node[a]] = 0;
}

static drape_status choose_nodes(maker *k)
{
    const drape_model *w = k->whole;
    drape_model *m = k->m;
    for (int32_t i = 0; i < w->node_count; i++)
        k->local[i] = k->owner[i] == k->rank ? 0 : -1;
    for (int32_t i = 0; i < w->term_count; i++)
        mark(k, w->terms[i].elements.node, w->terms[i].elements.nodes, w->terms[i].elements.count);
    mark(k, w->triangle, 3, w->triangle_count);
    mark(k, w->edge, 2, w->edge_count);
    m->node_count = 0;
    for (int32_t i = 0; i < w->node_count; i++)
        if (k->local[i] == 0)
            k->local[i] = m->node_count++;
    const size_t nodes = (size_t)m->node_count;
    k->part->node = drape_arena_take(&m->arena, nodes, sizeof *k->part->node);
    k->part->own = drape_arena_take(&m->arena, nodes, sizeof *k->part->own);
    if (drape_arena_status(&m->arena))
        return DRAPE_E_MEMORY;
    for (int32_t i = 0; i < w->node_count; i++)
        if (k->local[i] >= 0) {
            k->part->node[k->local[i]] = i;
            k->part->own[k->local[i]] = k->owner[i] == k->rank;
        }
    return DRAPE_OK;
}

/* ---- Arrays of nodes ---- */

/* What these nodes have in an array of the whole model, of `size` bytes a node. */
static void *pick(maker *k, const void *from, size_t size)
{
    char *to = from ? drape_arena_take(&k->m->arena, (size_t)k->m->node_count, size) : NULL;
    for (int32_t i = 0; to && i < k->m->node_count; i++)
        memcpy(to + (size_t)i * size, (const char *)from + (size_t)k->part->node[i] * size, size);
    return to;
}

/* Those of items of `nodes` nodes that touch a node of this rank, with its numbers. data (count): picked with
 * them; NULL: none. */
static int32_t *pick_items(maker *k, const int32_t *node, int nodes, int32_t count, const double *data,
                           double **picked, int32_t *out_count)
{
    int32_t n = 0;
    for (int32_t i = 0; i < count; i++)
        n += touches(k, node + (size_t)i * (size_t)nodes, nodes);
    int32_t *to = drape_arena_take(&k->m->arena, (size_t)n * (size_t)nodes, sizeof *to);
    double *values = data ? drape_arena_take(&k->m->arena, (size_t)n, sizeof *values) : NULL;
    *out_count = 0;
    for (int32_t i = 0; to && (!data || values) && i < count; i++) {
        const int32_t *from = node + (size_t)i * (size_t)nodes;
        if (!touches(k, from, nodes))
            continue;
        for (int a = 0; a < nodes; a++)
            to[(size_t)*out_count * (size_t)nodes + (size_t)a] = k->local[from[a]];
        if (values)
            values[*out_count] = data[i];
        ++*out_count;
    }
    if (picked)
        *picked = values;
    return to;
}

static drape_status pick_nodes(maker *k)
{
    const drape_model *w = k->whole;
    drape_model *m = k->m;
    const size_t nodes = (size_t)m->node_count, moved = (size_t)w->moved_count;
    m->rest = pick(k, w->rest, 3 * sizeof *m->rest);
    m->start = w->start == w->rest ? m->rest : pick(k, w->start, 3 * sizeof *m->start);
    m->velocity = pick(k, w->velocity, 3 * sizeof *m->velocity);
    m->mass = pick(k, w->mass, sizeof *m->mass);
    m->pinned = pick(k, w->pinned, sizeof *m->pinned);
    m->ride = pick(k, w->ride, sizeof *m->ride);
    m->cloth_of_node = pick(k, w->cloth_of_node, sizeof *m->cloth_of_node);
    m->triangle = pick_items(k, w->triangle, 3, w->triangle_count, NULL, NULL, &m->triangle_count);
    m->edge = pick_items(k, w->edge, 2, w->edge_count, w->edge_length, &m->edge_length, &m->edge_count);
    m->sewn = NULL; /* for self-contact only */
    m->free_of_node = drape_arena_take(&m->arena, nodes, sizeof *m->free_of_node);
    m->node_of_free = drape_arena_take(&m->arena, nodes, sizeof *m->node_of_free);
    m->moved_node = drape_arena_take(&m->arena, moved, sizeof *m->moved_node);
    m->moved_track = drape_arena_take(&m->arena, moved, sizeof *m->moved_track);
    m->supports = drape_arena_take(&m->arena, (size_t)w->support_count, sizeof *m->supports);
    if (drape_arena_status(&m->arena))
        return DRAPE_E_MEMORY;
    m->free_count = m->block_count = m->moved_count = m->support_count = 0;
    for (int own = 1; own >= 0; own--) { /* the free nodes: those of this rank first */
        for (int32_t i = 0; i < m->node_count; i++) {
            if (k->part->own[i] != own)
                continue;
            m->free_of_node[i] = m->pinned[i] ? -1 : m->block_count;
            if (!m->pinned[i])
                m->node_of_free[m->block_count++] = i;
        }
        m->free_count = own ? m->block_count : m->free_count;
    }
    for (int32_t i = 0; i < w->moved_count; i++)
        if (k->local[w->moved_node[i]] >= 0) {
            m->moved_node[m->moved_count] = k->local[w->moved_node[i]];
            m->moved_track[m->moved_count++] = w->moved_track[i];
        }
    for (int32_t i = 0; i < w->support_count; i++)
        if (k->local[w->supports[i].node] >= 0) {
            m->supports[m->support_count] = w->supports[i];
            m->supports[m->support_count++].node = k->local[w->supports[i].node];
        }
    return DRAPE_OK;
}

/* ---- Cloths ---- */

/* Only ranges, and areas of nodes, are of the part; the rest is that of the whole cloth. */
static drape_status pick_cloths(maker *k)
{
    const drape_model *w = k->whole;
    drape_model *m = k->m;
    m->cloths = drape_arena_take(&m->arena, (size_t)m->cloth_count, sizeof *m->cloths);
    k->part->cloth = drape_arena_take(&m->arena, (size_t)m->cloth_count, sizeof *k->part->cloth);
    if (drape_arena_status(&m->arena))
        return DRAPE_E_MEMORY;
    int32_t node = 0;
    for (int32_t c = 0; c < m->cloth_count; c++) {
        const drape_cloth *from = &w->cloths[c];
        drape_cloth *to = &m->cloths[c];
        const int32_t end = from->first_node + from->mesh.node_count;
        *to = *from;
        k->part->cloth[c] = from->first_node;
        to->first_node = node;
        to->mesh = (drape_mesh){0};
        to->render_mesh = (drape_mesh){0};
        to->mesh.node_area = drape_arena_take(&m->arena, (size_t)m->node_count, sizeof(double));
        if (!to->mesh.node_area)
            return DRAPE_E_MEMORY;
        for (; node < m->node_count && k->part->node[node] < end; node++)
            to->mesh.node_area[to->mesh.node_count++] =
                from->mesh.node_area[k->part->node[node] - from->first_node];
    }
    return DRAPE_OK;
}

/* ---- Terms ---- */

/* Data of `each` numbers an element, item k of element e at [k count + e]. */
static double *pick_data(maker *k, const double *from, int each, int32_t before, const drape_term *to)
{
    const size_t count = (size_t)to->elements.count;
    double *data = from ? drape_arena_take(&k->m->arena, (size_t)each * count, sizeof *data) : NULL;
    for (int i = 0; data && i < each; i++)
        for (size_t e = 0; e < count; e++)
            data[(size_t)i * count + e] = from[(size_t)i * (size_t)before + (size_t)to->element[e]];
    return data;
}

static drape_status pick_elements(maker *k, const drape_term *from, drape_term *to)
{
    const drape_elements *el = &from->elements;
    const int nodes = el->nodes;
    int32_t *node = pick_items(k, el->node, nodes, el->count, NULL, NULL, &to->elements.count), *element;
    uint8_t *counted;
    to->elements.node = node;
    to->elements.params = to->params;
    element = drape_arena_take(&k->m->arena, (size_t)to->elements.count, sizeof *element);
    counted = drape_arena_take(&k->m->arena, (size_t)to->elements.count, sizeof *counted);
    if (drape_arena_status(&k->m->arena))
        return DRAPE_E_MEMORY;
    int32_t n = 0;
    for (int32_t e = 0; e < el->count; e++)
        if (touches(k, el->node + (size_t)e * (size_t)nodes, nodes)) {
            counted[n] = k->owner[el->node[(size_t)e * (size_t)nodes]] == k->rank;
            element[n++] = e;
        }
    to->element = element;
    to->counted = counted;
    to->elements.rest = pick_data(k, el->rest, el->rest_count, el->count, to);
    to->damping = pick_data(k, from->damping, 1, el->count, to);
    to->slider_stiffness = pick_data(k, from->slider_stiffness, from->sliders, el->count, to);
    to->slider_limit = pick_data(k, from->slider_limit, from->sliders, el->count, to);
    return drape_arena_status(&k->m->arena);
}

/* The parts of these elements, if there are any, by the functions with which a term announces its own. */
static drape_status build_parts(maker *k, const drape_term *from, drape_term *to)
{
    const drape_parts *p = &from->parts;
    drape_term_builder builder = {.model = k->m, .term = to, .pointer = "", .reserved = true};
    int32_t parts = 0, links = 0, node[DRAPE_MAX_ELEMENT_NODES];
    if (!from->elements.parts)
        return DRAPE_OK;
    double *rest = drape_arena_take(&k->scratch, (size_t)p->rest_count, sizeof *rest);
    int32_t *number = drape_arena_take(&k->scratch, (size_t)p->count, sizeof *number);
    if (!rest || !number)
        return DRAPE_E_MEMORY;
    for (int32_t i = 0; i < p->count; i++)
        number[i] = -1;
    for (int32_t e = 0; e < to->elements.count; e++)
        for (int32_t l = p->first_link[to->element[e]]; l < p->first_link[to->element[e] + 1]; l++, links++)
            number[p->part[l]] = 0;
    for (int32_t i = 0; i < p->count; i++)
        if (number[i] == 0)
            number[i] = parts++;
    to->parts = (drape_parts){0};
    to->patches = (drape_patches){0};
    uint8_t *counted = drape_arena_take(&k->m->arena, (size_t)parts, sizeof *counted);
    int32_t *numbers = drape_arena_take(&k->m->arena, (size_t)parts, sizeof *numbers);
    if (!counted || !numbers)
        return DRAPE_E_MEMORY;
    to->part = numbers;
    to->part_counted = counted;
    drape_status status = drape_term_reserve_parts(&builder, parts, links, p->rest_count);
    if (status)
        return status;
    for (int32_t i = 0; i < p->count; i++) {
        for (int a = 0; number[i] >= 0 && a < p->nodes; a++)
            node[a] = k->local[p->node[(size_t)i * (size_t)p->nodes + (size_t)a]];
        for (int j = 0; number[i] >= 0 && j < p->rest_count; j++)
            rest[j] = p->rest[(size_t)j * (size_t)p->count + (size_t)i];
        if (number[i] < 0)
            continue;
        drape_term_set_part(&builder, number[i], node, rest);
        numbers[number[i]] = i;
        counted[number[i]] = k->owner[p->node[(size_t)i * (size_t)p->nodes]] == k->rank;
    }
    for (int32_t e = 0; e < to->elements.count; e++)
        for (int32_t l = p->first_link[to->element[e]]; l < p->first_link[to->element[e] + 1]; l++)
            drape_term_link(&builder, e, number[p->part[l]], p->weight[l]);
    return drape_term_finish_parts(&builder);
}

static drape_status pick_terms(maker *k)
{
    const drape_model *w = k->whole;
    drape_model *m = k->m;
    m->terms = drape_arena_take(&m->arena, (size_t)m->term_count, sizeof *m->terms);
    if (!m->terms)
        return DRAPE_E_MEMORY;
    m->internal_count = m->measure_count = 0;
    for (int32_t i = 0; i < m->term_count; i++) {
        drape_term *term = &m->terms[i];
        *term = w->terms[i];
        term->block = NULL;
        if (term->ops->law)
            continue;
        drape_status status = pick_elements(k, &w->terms[i], term);
        if (!status)
            status = build_parts(k, &w->terms[i], term);
        if (status)
            return status;
        drape_compile_number_elements(m, term);
    }
    return DRAPE_OK;
}

/* ---- The part ---- */

static drape_status make(maker *k, drape_mpi_ranks *ranks)
{
    const drape_model *w = k->whole;
    drape_model *m = k->m;
    k->local = drape_arena_take(&k->scratch, (size_t)w->node_count, sizeof *k->local);
    k->part = drape_arena_take(&m->arena, 1, sizeof *k->part);
    if (!k->local || !k->part)
        return DRAPE_E_MEMORY;
    *k->part = (drape_part){.ranks = &ranks->base,
                            .whole = w,
                            .all_nodes = w->node_count,
                            .all_free = w->free_count,
                            .all_nonzeros = w->pattern.nonzeros,
                            .hash = drape_model_identity(w)};
    drape_status status = choose_nodes(k);
    if (!status)
        status = pick_nodes(k);
    if (!status)
        status = pick_cloths(k);
    if (!status)
        status = pick_terms(k);
    m->part = k->part;
    if (!status)
        status = drape_compile_pattern(m);
    if (status)
        return status;
    /* The block columns of the matrix of all ranks are the free nodes of rank 0, then those of rank 1 and so
     * on, each in ascending order. */
    int64_t *next = drape_arena_take(&k->scratch, (size_t)ranks->base.count + 1, sizeof *next);
    int64_t *block = drape_arena_take(&k->m->arena, (size_t)m->block_count, sizeof *block);
    if (!next || !block)
        return DRAPE_E_MEMORY;
    for (int32_t i = 0; i < w->node_count; i++)
        next[k->owner[i] + 1] += !w->pinned[i];
    for (int r = 0; r < ranks->base.count; r++)
        next[r + 1] += next[r];
    ranks->base.all_blocks = next[ranks->base.count];
    for (int32_t i = 0; i < w->node_count; i++) {
        const int32_t here = k->local[i];
        if (w->pinned[i])
            continue;
        if (here >= 0)
            block[m->free_of_node[here]] = next[k->owner[i]];
        next[k->owner[i]]++;
    }
    ranks->base.own_blocks = m->free_count;
    ranks->base.block = block;
    return DRAPE_OK;
}

/* Also sets what of *ranks depends on the part, which uses names, tracks, colliders and choices of `whole`:
 * that must outlive it. Its large arrays are its own. */
static drape_status part_create(const drape_model *whole, const int32_t *owner, drape_mpi_ranks *ranks,
                                drape_model **out)
{
    drape_model *m = *out = drape_alloc(whole->ctx, 1, sizeof *m);
    if (!m)
        return DRAPE_E_MEMORY;
    *m = *whole;
    m->arena = drape_arena_of(whole->ctx);
    m->cloths = NULL;
    m->pins = NULL;
    m->seams = NULL;
    m->pin_count = m->seam_count = 0;
    m->surface = (drape_render_surface){0};
    m->pattern = (drape_pattern){0};
    maker k = {.whole = whole,
               .owner = owner,
               .rank = ranks->base.rank,
               .m = m,
               .scratch = drape_arena_of(whole->ctx)};
    const drape_status status = make(&k, ranks);
    drape_arena_free(&k.scratch);
    if (status) {
        m->cloth_count = m->cloths ? m->cloth_count : 0;
        m->part = k.part;
        drape_model_destroy(out);
    }
    return status;
}

drape_status drape_mpi_share(drape_mpi *mpi, drape_model *whole, drape_model **part)
{
    *part = NULL;
    drape_status status = part_check(whole);
    int32_t *owner = status ? NULL : drape_alloc(mpi->ctx, (size_t)whole->node_count, sizeof *owner);
    if (!status && !owner)
        status = DRAPE_E_MEMORY;
    if (!status)
        status = partition(mpi->ranks, whole, owner);
    if (!status)
        status = part_create(whole, owner, mpi->ranks, part);
    status = drape_ranks_agree(&mpi->ranks->base, whole->ctx, status);
    if (!status)
        status = drape_mpi_ranks_plan(mpi->ranks, *part, owner);
    if (!status) {
        drape_pattern *p = &whole->pattern;
        for (int32_t i = 0; i < whole->term_count; i++) {
            drape_term *term = &whole->terms[i];
            if (term->ops->law || term->elements.parts) /* these are of the parts, too */
                continue;
            drape_arena_release(&whole->arena, term->block);
            drape_arena_release(&whole->arena, (void *)(uintptr_t)term->elements.node);
            drape_arena_release(&whole->arena, (void *)(uintptr_t)term->elements.rest);
            term->block = NULL;
            term->elements.node = NULL;
            term->elements.rest = NULL;
        }
        drape_arena_release(&whole->arena, p->block_start);
        drape_arena_release(&whole->arena, p->block_row);
        drape_arena_release(&whole->arena, p->diagonal);
        drape_arena_release(&whole->arena, p->column);
        p->block_start = p->block_row = p->diagonal = NULL;
        p->column = NULL;
    } else
        drape_model_destroy(part);
    drape_free(mpi->ctx, owner);
    return status;
}
