/* mpi_ranks.c: see mpi_ranks.h. Sums are of gathered numbers in the order of the ranks, so that all ranks
 * have the same bits. */
#include "mpi/mpi_ranks.h"

#include <nvector/nvector_parallel.h>
#include <string.h>

/* ---- Sums ---- */

/* Each value over all ranks: the sum, or the largest, which is NaN if one is. */
static void reduce(const drape_ranks *ranks, double *values, int n, bool adds)
{
    drape_mpi_ranks *r = drape_mpi_ranks_of(ranks);
    for (int first = 0; first < n; first += DRAPE_MPI_VALUES) {
        const int count = n - first < DRAPE_MPI_VALUES ? n - first : DRAPE_MPI_VALUES;
        MPI_Allgather(values + first, count, MPI_DOUBLE, r->gathered, count, MPI_DOUBLE, r->comm);
        for (int i = 0; i < count; i++) {
            double all = adds ? 0 : r->gathered[i];
            for (int k = 0; k < ranks->count; k++) {
                const double one = r->gathered[k * count + i];
                all = adds ? all + one : one <= all || isnan(all) ? all : one;
            }
            values[first + i] = all;
        }
    }
}

static void sum(const drape_ranks *ranks, double *values, int n)
{
    reduce(ranks, values, n, true);
}

static void largest(const drape_ranks *ranks, double *values, int n)
{
    reduce(ranks, values, n, false);
}

static void broadcast(const drape_ranks *ranks, int from, void *bytes, int size)
{
    MPI_Bcast(bytes, size, MPI_BYTE, from, drape_mpi_ranks_of(ranks)->comm);
}

/* ---- Copies ---- */

/* Items of `size` bytes at these places of each array, side by side. */
static void pack(const char *const *arrays, int count, const int32_t *place, int32_t n, size_t size, char *to)
{
    for (int32_t i = 0; i < n; i++)
        for (int a = 0; a < count; a++, to += size)
            memcpy(to, arrays[a] + size * (size_t)place[i], size);
}

/* Sends items to the neighbours and receives others of the same size. */
static void send(const drape_mpi_ranks *r, const drape_exchange *x, const char *sent,
                 const int32_t *first_sent, char *received, const int32_t *first_received, size_t size)
{
    for (int k = 0; k < x->neighbour_count; k++)
        MPI_Irecv(received + size * (size_t)first_received[k],
                  (int)size * (first_received[k + 1] - first_received[k]), MPI_BYTE, x->neighbour[k], 0,
                  r->comm, &x->requests[k]);
    for (int k = 0; k < x->neighbour_count; k++)
        MPI_Isend(sent + size * (size_t)first_sent[k], (int)size * (first_sent[k + 1] - first_sent[k]),
                  MPI_BYTE, x->neighbour[k], 0, r->comm, &x->requests[x->neighbour_count + k]);
    MPI_Waitall(2 * x->neighbour_count, x->requests, MPI_STATUSES_IGNORE);
}

/* The copies in some arrays become what the owners have in theirs. */
static void exchange(const drape_mpi_ranks *r, const drape_exchange *x, const char *const *own,
                     char *const *copies, int count, size_t size)
{
    pack(own, count, x->out, x->first_out[x->neighbour_count], size, x->outside);
    send(r, x, x->outside, x->first_out, x->inside, x->first_in, size * (size_t)count);
    const char *from = x->inside;
    for (int32_t i = 0; i < x->first_in[x->neighbour_count]; i++)
        for (int a = 0; a < count; a++, from += size)
            memcpy(copies[a] + size * (size_t)x->in[i], from, size);
}

static void copy(const drape_ranks *ranks, const drape_exchange *x, const void *own, void *copies,
                 size_t size)
{
    exchange(drape_mpi_ranks_of(ranks), x, &(const char *){own}, &(char *){copies}, 1, size);
}

static void add(const drape_ranks *ranks, const drape_exchange *x, double *own, const double *copies,
                int width)
{
    const size_t n = (size_t)width, size = n * sizeof *own;
    pack(&(const char *){(const char *)copies}, 1, x->in, x->first_in[x->neighbour_count], size, x->inside);
    send(drape_mpi_ranks_of(ranks), x, x->inside, x->first_in, x->outside, x->first_out, size);
    for (int32_t i = 0; i < x->first_out[x->neighbour_count]; i++) {
        const double *from = (const double *)(const void *)x->outside + n * (size_t)i;
        double *to = own + n * (size_t)x->out[i];
        for (size_t c = 0; c < n; c++)
            to[c] += from[c];
    }
}

static void fetch(const drape_ranks *ranks, double *const *nodes, int arrays)
{
    char *bytes[DRAPE_MPI_ARRAYS];
    for (int first = 0; first < arrays; first += DRAPE_MPI_ARRAYS) {
        const int count = arrays - first < DRAPE_MPI_ARRAYS ? arrays - first : DRAPE_MPI_ARRAYS;
        for (int a = 0; a < count; a++)
            bytes[a] = (char *)nodes[first + a];
        exchange(drape_mpi_ranks_of(ranks), drape_mpi_ranks_of(ranks)->nodes, (const char *const *)bytes,
                 bytes, count, 3 * sizeof **nodes);
    }
}

static void fetch_blocks(const drape_ranks *ranks, double *blocks)
{
    copy(ranks, drape_mpi_ranks_of(ranks)->blocks, blocks, blocks, 3 * sizeof *blocks);
}

static void share(const drape_ranks *ranks, void *all, const int32_t *first, size_t size)
{
    drape_mpi_ranks *r = drape_mpi_ranks_of(ranks);
    for (int k = 0; k < ranks->count; k++) {
        r->places[k] = (int)size * first[k];
        r->bytes[k] = (int)size * (first[k + 1] - first[k]);
    }
    MPI_Allgatherv(MPI_IN_PLACE, 0, MPI_DATATYPE_NULL, all, r->bytes, r->places, MPI_BYTE, r->comm);
}

/* ---- Gathering ---- */

static void place(const double *values, size_t width, int32_t count, const int32_t *number, double *all)
{
    for (size_t i = 0; i < (size_t)count; i++)
        memcpy(all + width * (size_t)number[i], values + width * i, width * sizeof *all);
}

/* Sends the next items, at most DRAPE_MPI_PIECE numbers, from *first on; on rank 0 puts them into their
 * places. Returns how many. */
static int32_t send_piece(drape_mpi_ranks *r, const drape_rows *rows, int32_t *first, double *all)
{
    const size_t width = (size_t)rows->width;
    int32_t n = 0;
    for (; *first < rows->count && n < DRAPE_MPI_PIECE / rows->width; ++*first)
        if (rows->counted[*first]) {
            memcpy(r->piece + width * (size_t)n, rows->values + width * (size_t)*first, width * sizeof *all);
            r->numbers[n++] = rows->number[*first];
        }
    if (r->base.rank == 0) {
        place(r->piece, width, n, r->numbers, all);
        return n;
    }
    MPI_Send(r->numbers, n, MPI_INT32_T, 0, 1, r->comm);
    MPI_Send(r->piece, n * rows->width, MPI_DOUBLE, 0, 2, r->comm);
    return n;
}

/* In pieces, so that little is in memory twice; an empty piece is the last of a rank. */
static void collect(const drape_ranks *ranks, const drape_rows *rows, double *all)
{
    drape_mpi_ranks *r = drape_mpi_ranks_of(ranks);
    int32_t first = 0;
    while (send_piece(r, rows, &first, all) > 0)
        ;
    for (int k = 1; k < ranks->count && ranks->rank == 0; k++)
        for (int n = 1; n > 0;) {
            MPI_Status status;
            MPI_Recv(r->numbers, DRAPE_MPI_PIECE, MPI_INT32_T, k, 1, r->comm, &status);
            MPI_Get_count(&status, MPI_INT32_T, &n);
            MPI_Recv(r->piece, n * rows->width, MPI_DOUBLE, k, 2, r->comm, MPI_STATUS_IGNORE);
            place(r->piece, (size_t)rows->width, n, r->numbers, all);
        }
}

/* ---- Vectors ---- */

static void *vector(const drape_ranks *ranks, int64_t n, double *values, void *sun)
{
    const int64_t all = n / ranks->own_blocks * ranks->all_blocks; /* some numbers for each block */
    return values ? N_VMake_Parallel(drape_mpi_ranks_of(ranks)->comm, n, all, values, sun)
                  : N_VNew_Parallel(drape_mpi_ranks_of(ranks)->comm, n, all, sun);
}

/* ---- Plans ---- */

/* wanted (ranks): how many items of each rank have copies here; asked (ranks): of this one there. */
static drape_exchange *take(drape_arena *arena, int ranks, const int *wanted, const int *asked,
                            size_t largest)
{
    drape_exchange *x = drape_arena_take(arena, 1, sizeof *x);
    int32_t in = 0, out = 0;
    size_t n = 0;
    for (int k = 0; k < ranks; k++) {
        n += wanted[k] > 0 || asked[k] > 0;
        in += wanted[k];
        out += asked[k];
    }
    if (!x)
        return NULL;
    x->neighbour = drape_arena_take(arena, n, sizeof *x->neighbour);
    x->requests = drape_arena_take(arena, 2 * n, sizeof(MPI_Request));
    x->first_in = drape_arena_take(arena, n + 1, sizeof *x->first_in);
    x->first_out = drape_arena_take(arena, n + 1, sizeof *x->first_out);
    x->in = drape_arena_take(arena, (size_t)in, sizeof *x->in);
    x->out = drape_arena_take(arena, (size_t)out, sizeof *x->out);
    x->inside = drape_arena_take(arena, (size_t)in, largest);
    x->outside = drape_arena_take(arena, (size_t)out, largest);
    if (drape_arena_status(arena))
        return NULL;
    for (int k = 0; k < ranks; k++)
        if (wanted[k] > 0 || asked[k] > 0) {
            const int i = x->neighbour_count++;
            x->neighbour[i] = k;
            x->first_in[i + 1] = x->first_in[i] + wanted[k];
            x->first_out[i + 1] = x->first_out[i] + asked[k];
        }
    return x;
}

static drape_exchange *plan(const drape_ranks *ranks, drape_arena *arena, int32_t count, const int32_t *rank,
                            const int32_t *place, size_t largest)
{
    const drape_mpi_ranks *r = drape_mpi_ranks_of(ranks);
    drape_arena scratch = drape_arena_of(arena->ctx);
    drape_exchange *x = NULL;
    int *wanted = drape_arena_take(&scratch, (size_t)ranks->count, sizeof *wanted),
        *asked = drape_arena_take(&scratch, (size_t)ranks->count, sizeof *asked);
    int32_t *places = drape_arena_take(&scratch, (size_t)count, sizeof *places);
    drape_status status = drape_ranks_agree(ranks, arena->ctx, drape_arena_status(&scratch));
    if (!status) {
        for (int32_t i = 0; i < count; i++)
            wanted[rank[i]]++;
        MPI_Alltoall(wanted, 1, MPI_INT, asked, 1, MPI_INT, r->comm);
        x = take(arena, ranks->count, wanted, asked, largest);
        status = drape_ranks_agree_memory(ranks, arena->ctx, x);
    }
    for (int k = 0; !status && k < x->neighbour_count; k++) {
        int32_t to = x->first_in[k];
        for (int32_t i = 0; i < count; i++)
            if (rank[i] == x->neighbour[k]) {
                x->in[to] = i;
                places[to++] = place[i];
            }
    }
    if (!status) /* asks the owners of the copies for them, whose places they get */
        send(r, x, (const char *)places, x->first_in, (char *)x->out, x->first_out, sizeof *places);
    drape_arena_free(&scratch);
    return status ? NULL : x;
}

/* The copies of nodes, which their owners know by their numbers in the whole model only. copy (nodes),
 * rank (nodes), number (nodes): scratch. */
static drape_exchange *plan_nodes(drape_mpi_ranks *r, const drape_model *m, const int32_t *owner,
                                  int32_t *copy, int32_t *rank, int32_t *number)
{
    const int32_t *node = m->part->node;
    int32_t count = 0;
    for (int32_t i = 0; i < m->node_count; i++)
        if (!m->part->own[i]) {
            copy[count] = i;
            rank[count] = owner[node[i]];
            number[count++] = node[i];
        }
    drape_exchange *x = plan(&r->base, &r->arena, count, rank, number, 3 * DRAPE_MPI_ARRAYS * sizeof(double));
    for (int32_t i = 0; x && i < x->first_in[x->neighbour_count]; i++)
        x->in[i] = copy[x->in[i]];
    for (int32_t i = 0; x && i < x->first_out[x->neighbour_count]; i++) {
        int32_t low = 0, high = m->node_count; /* by bisection: nodes ascend */
        while (high - low > 1) {
            const int32_t middle = (low + high) / 2;
            *(node[middle] <= x->out[i] ? &low : &high) = middle;
        }
        x->out[i] = low;
    }
    return x;
}

/* The same exchange for block columns: without pinned nodes, which are so on both sides. */
static void keep_free(const drape_model *m, int neighbours, int32_t *first, int32_t *list)
{
    int32_t to = 0, from = 0;
    for (int k = 0; k < neighbours; k++) {
        for (; from < first[k + 1]; from++)
            if (m->free_of_node[list[from]] >= 0)
                list[to++] = m->free_of_node[list[from]];
        first[k + 1] = to;
    }
}

drape_status drape_mpi_ranks_plan(drape_mpi_ranks *r, const drape_model *part, const int32_t *owner)
{
    const size_t nodes = (size_t)part->node_count;
    drape_arena scratch = drape_arena_of(r->arena.ctx);
    int32_t *copy = drape_arena_take(&scratch, nodes, sizeof *copy),
            *rank = drape_arena_take(&scratch, nodes, sizeof *rank),
            *number = drape_arena_take(&scratch, nodes, sizeof *number);
    if (!drape_ranks_agree(&r->base, r->arena.ctx, drape_arena_status(&scratch))) {
        r->nodes = plan_nodes(r, part, owner, copy, rank, number);
        r->blocks = r->nodes ? plan_nodes(r, part, owner, copy, rank, number) : NULL;
    }
    drape_arena_free(&scratch);
    if (!r->blocks)
        return DRAPE_E_MEMORY;
    keep_free(part, r->blocks->neighbour_count, r->blocks->first_in, r->blocks->in);
    keep_free(part, r->blocks->neighbour_count, r->blocks->first_out, r->blocks->out);
    return DRAPE_OK;
}

/* ---- Creation ---- */

drape_status drape_mpi_ranks_create(drape_context *ctx, MPI_Comm comm, drape_mpi_ranks **out)
{
    drape_mpi_ranks *r = *out = drape_alloc(ctx, 1, sizeof *r);
    if (!r)
        return DRAPE_E_MEMORY;
    r->comm = comm;
    r->arena = drape_arena_of(ctx);
    MPI_Comm_rank(comm, &r->base.rank);
    MPI_Comm_size(comm, &r->base.count);
    r->base.sum = sum;
    r->base.largest = largest;
    r->base.broadcast = broadcast;
    r->base.fetch = fetch;
    r->base.fetch_blocks = fetch_blocks;
    r->base.plan = plan;
    r->base.copy = copy;
    r->base.add = add;
    r->base.share = share;
    r->base.gather = collect;
    r->base.open = drape_mpi_open;
    r->base.write = drape_mpi_write;
    r->base.close = drape_mpi_close;
    r->base.inertia = drape_mpi_inertia;
    r->base.vector = vector;
    r->base.direct = &drape_linear_mpi_direct;
    r->bytes = drape_arena_take(&r->arena, (size_t)r->base.count, sizeof *r->bytes);
    r->places = drape_arena_take(&r->arena, (size_t)r->base.count, sizeof *r->places);
    r->gathered = drape_arena_take(&r->arena, (size_t)r->base.count * DRAPE_MPI_VALUES, sizeof *r->gathered);
    r->piece = drape_arena_take(&r->arena, DRAPE_MPI_PIECE, sizeof *r->piece);
    r->numbers = drape_arena_take(&r->arena, DRAPE_MPI_PIECE, sizeof *r->numbers);
    if (drape_arena_status(&r->arena))
        drape_mpi_ranks_destroy(out);
    return *out ? DRAPE_OK : DRAPE_E_MEMORY;
}

void drape_mpi_ranks_destroy(drape_mpi_ranks **ranks)
{
    if (!*ranks)
        return;
    drape_context *ctx = (*ranks)->arena.ctx;
    drape_arena_free(&(*ranks)->arena);
    drape_free(ctx, *ranks);
    *ranks = NULL;
}
