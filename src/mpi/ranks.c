/* ranks.c: see ranks.h. Sums are of gathered numbers in the order of the ranks, so that all ranks have the
 * same bits. */
#include "mpi/ranks.h"

#include "mpi/file.h"
#include "mpi/linear.h"

#include <nvector/nvector_parallel.h>
#include <string.h>

static drape_mpi_ranks *of(const drape_ranks *ranks)
{
    return (drape_mpi_ranks *)(uintptr_t)ranks; /* base is its first member */
}

/* ---- Sums ---- */

static void gather(drape_mpi_ranks *r, const double *values, int n)
{
    MPI_Allgather(values, n, MPI_DOUBLE, r->gathered, n, MPI_DOUBLE, r->comm);
}

static void sum(const drape_ranks *ranks, double *values, int n)
{
    drape_mpi_ranks *r = of(ranks);
    for (int first = 0; first < n; first += DRAPE_MPI_VALUES) {
        const int count = n - first < DRAPE_MPI_VALUES ? n - first : DRAPE_MPI_VALUES;
        gather(r, values + first, count);
        for (int i = 0; i < count; i++) {
            values[first + i] = 0;
            for (int k = 0; k < ranks->count; k++)
                values[first + i] += r->gathered[k * count + i];
        }
    }
}

static void largest(const drape_ranks *ranks, double *values, int n)
{
    drape_mpi_ranks *r = of(ranks);
    for (int first = 0; first < n; first += DRAPE_MPI_VALUES) {
        const int count = n - first < DRAPE_MPI_VALUES ? n - first : DRAPE_MPI_VALUES;
        gather(r, values + first, count);
        for (int i = 0; i < count; i++) {
            double most = r->gathered[i];
            for (int k = 1; k < ranks->count; k++)
                most = r->gathered[k * count + i] <= most || isnan(most) ? most : r->gathered[k * count + i];
            values[first + i] = most;
        }
    }
}

static void broadcast(const drape_ranks *ranks, int from, void *bytes, int size)
{
    MPI_Bcast(bytes, size, MPI_BYTE, from, of(ranks)->comm);
}

/* ---- Copies ---- */

static void exchange(const drape_mpi_ranks *r, const drape_mpi_exchange *x, double *const *arrays, int count)
{
    const size_t each = 3 * (size_t)count;
    for (int k = 0; k < x->neighbour_count; k++)
        MPI_Irecv(x->received + each * (size_t)x->first_in[k],
                  (int)each * (x->first_in[k + 1] - x->first_in[k]), MPI_DOUBLE, x->neighbour[k], 0, r->comm,
                  &x->requests[k]);
    for (int k = 0; k < x->neighbour_count; k++) {
        for (int32_t i = x->first_out[k]; i < x->first_out[k + 1]; i++)
            for (size_t a = 0; a < (size_t)count; a++)
                memcpy(x->sent + each * (size_t)i + 3 * a, arrays[a] + 3 * (size_t)x->out[i],
                       3 * sizeof **arrays);
        MPI_Isend(x->sent + each * (size_t)x->first_out[k],
                  (int)each * (x->first_out[k + 1] - x->first_out[k]), MPI_DOUBLE, x->neighbour[k], 0,
                  r->comm, &x->requests[x->neighbour_count + k]);
    }
    MPI_Waitall(2 * x->neighbour_count, x->requests, MPI_STATUSES_IGNORE);
    for (int32_t i = 0; i < x->first_in[x->neighbour_count]; i++)
        for (size_t a = 0; a < (size_t)count; a++)
            memcpy(arrays[a] + 3 * (size_t)x->in[i], x->received + each * (size_t)i + 3 * a,
                   3 * sizeof **arrays);
}

static void fetch(const drape_ranks *ranks, double *const *nodes, int arrays)
{
    for (int first = 0; first < arrays; first += DRAPE_MPI_ARRAYS)
        exchange(of(ranks), &of(ranks)->nodes, nodes + first,
                 arrays - first < DRAPE_MPI_ARRAYS ? arrays - first : DRAPE_MPI_ARRAYS);
}

static void fetch_blocks(const drape_ranks *ranks, double *blocks)
{
    exchange(of(ranks), &of(ranks)->blocks, &blocks, 1);
}

/* ---- Gathering ---- */

static void place(const double *values, size_t width, int32_t count, const int32_t *number, double *all)
{
    for (size_t i = 0; i < (size_t)count; i++)
        memcpy(all + width * (size_t)number[i], values + width * i, width * sizeof *all);
}

/* Sends the next items, at most DRAPE_MPI_PIECE, from *first on; on rank 0 puts them into their places.
 * Returns how many. */
static int32_t send_piece(drape_mpi_ranks *r, const double *values, size_t width, int32_t *first,
                          int32_t count, const uint8_t *counted, const int32_t *number, double *all)
{
    int32_t n = 0;
    for (; *first < count && n < DRAPE_MPI_PIECE / (int32_t)width; ++*first)
        if (counted[*first]) {
            memcpy(r->piece + width * (size_t)n, values + width * (size_t)*first, width * sizeof *values);
            r->numbers[n++] = number[*first];
        }
    if (r->base.rank == 0) {
        place(r->piece, width, n, r->numbers, all);
        return n;
    }
    MPI_Send(r->numbers, n, MPI_INT32_T, 0, 1, r->comm);
    MPI_Send(r->piece, n * (int)width, MPI_DOUBLE, 0, 2, r->comm);
    return n;
}

/* In pieces, so that little is in memory twice; an empty piece is the last of a rank. */
static void collect(const drape_ranks *ranks, const double *values, int width, int32_t count,
                    const uint8_t *counted, const int32_t *number, double *all)
{
    drape_mpi_ranks *r = of(ranks);
    int32_t first = 0;
    while (send_piece(r, values, (size_t)width, &first, count, counted, number, all) > 0)
        ;
    for (int k = 1; k < ranks->count && ranks->rank == 0; k++)
        for (int n = 1; n > 0;) {
            MPI_Status status;
            MPI_Recv(r->numbers, DRAPE_MPI_PIECE, MPI_INT32_T, k, 1, r->comm, &status);
            MPI_Get_count(&status, MPI_INT32_T, &n);
            MPI_Recv(r->piece, n * width, MPI_DOUBLE, k, 2, r->comm, MPI_STATUS_IGNORE);
            place(r->piece, (size_t)width, n, r->numbers, all);
        }
}

/* ---- Vectors ---- */

static void *vector(const drape_ranks *ranks, int64_t n, double *values, void *sun)
{
    const int64_t all = n / ranks->own_blocks * ranks->all_blocks; /* some numbers for each block */
    return values ? N_VMake_Parallel(of(ranks)->comm, n, all, values, sun)
                  : N_VNew_Parallel(of(ranks)->comm, n, all, sun);
}

/* ---- Plans ---- */

static int32_t find(const int32_t *sorted, int32_t count, int32_t value)
{
    int32_t low = 0, high = count;
    while (high - low > 1) {
        const int32_t middle = (low + high) / 2;
        *(sorted[middle] <= value ? &low : &high) = middle;
    }
    return low;
}

/* wanted (ranks): how many nodes of each rank have copies here; asked (ranks): of this one there. */
static drape_status take(drape_mpi_ranks *r, const int *wanted, const int *asked, drape_mpi_exchange *x)
{
    int32_t in = 0, out = 0;
    int n = 0;
    for (int k = 0; k < r->base.count; k++) {
        n += wanted[k] > 0 || asked[k] > 0;
        in += wanted[k];
        out += asked[k];
    }
    *x = (drape_mpi_exchange){0};
    x->neighbour = drape_arena_take(&r->arena, (size_t)n, sizeof *x->neighbour);
    x->requests = drape_arena_take(&r->arena, 2 * (size_t)n, sizeof *x->requests);
    x->first_in = drape_arena_take(&r->arena, (size_t)n + 1, sizeof *x->first_in);
    x->first_out = drape_arena_take(&r->arena, (size_t)n + 1, sizeof *x->first_out);
    x->in = drape_arena_take(&r->arena, (size_t)in, sizeof *x->in);
    x->out = drape_arena_take(&r->arena, (size_t)out, sizeof *x->out);
    x->sent = drape_arena_take(&r->arena, (size_t)out, 3 * DRAPE_MPI_ARRAYS * sizeof *x->sent);
    x->received = drape_arena_take(&r->arena, (size_t)in, 3 * DRAPE_MPI_ARRAYS * sizeof *x->received);
    if (drape_arena_status(&r->arena))
        return DRAPE_E_MEMORY;
    for (int k = 0; k < r->base.count; k++)
        if (wanted[k] > 0 || asked[k] > 0) {
            const int i = x->neighbour_count++;
            x->neighbour[i] = k;
            x->first_in[i + 1] = x->first_in[i] + wanted[k];
            x->first_out[i + 1] = x->first_out[i] + asked[k];
        }
    return DRAPE_OK;
}

/* Asks the owners of the copies for them, by their numbers in the whole model, in ascending order. */
static drape_status ask(drape_mpi_ranks *r, const drape_model *m, const int32_t *owner, drape_mpi_exchange *x)
{
    drape_arena scratch = drape_arena_of(r->arena.ctx);
    const int32_t *node = m->part->node;
    int *wanted = drape_arena_take(&scratch, (size_t)r->base.count, sizeof *wanted),
        *asked = drape_arena_take(&scratch, (size_t)r->base.count, sizeof *asked);
    drape_status status = drape_arena_status(&scratch);
    for (int32_t i = 0; !status && i < m->node_count; i++)
        if (!m->part->own[i])
            wanted[owner[node[i]]]++;
    if (!status) {
        MPI_Alltoall(wanted, 1, MPI_INT, asked, 1, MPI_INT, r->comm);
        status = take(r, wanted, asked, x);
    }
    for (int k = 0; !status && k < x->neighbour_count; k++) {
        int32_t to = x->first_in[k];
        for (int32_t i = 0; i < m->node_count; i++)
            if (!m->part->own[i] && owner[node[i]] == x->neighbour[k])
                x->in[to++] = node[i];
    }
    for (int k = 0; !status && k < x->neighbour_count; k++) {
        MPI_Irecv(x->out + x->first_out[k], x->first_out[k + 1] - x->first_out[k], MPI_INT32_T,
                  x->neighbour[k], 0, r->comm, &x->requests[k]);
        MPI_Isend(x->in + x->first_in[k], x->first_in[k + 1] - x->first_in[k], MPI_INT32_T, x->neighbour[k],
                  0, r->comm, &x->requests[x->neighbour_count + k]);
    }
    if (!status)
        MPI_Waitall(2 * x->neighbour_count, x->requests, MPI_STATUSES_IGNORE);
    for (int32_t i = 0; !status && i < x->first_in[x->neighbour_count]; i++)
        x->in[i] = find(node, m->node_count, x->in[i]);
    for (int32_t i = 0; !status && i < x->first_out[x->neighbour_count]; i++)
        x->out[i] = find(node, m->node_count, x->out[i]);
    drape_arena_free(&scratch);
    return status;
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
    drape_status status = ask(r, part, owner, &r->nodes);
    if (!status)
        status = ask(r, part, owner, &r->blocks);
    if (status)
        return status;
    keep_free(part, r->blocks.neighbour_count, r->blocks.first_in, r->blocks.in);
    keep_free(part, r->blocks.neighbour_count, r->blocks.first_out, r->blocks.out);
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
    r->base.gather = collect;
    r->base.write = drape_mpi_write;
    r->base.inertia = drape_mpi_inertia;
    r->base.vector = vector;
    r->base.direct = &drape_linear_mpi_direct;
    r->base.iterative = &drape_linear_mpi_iterative;
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
