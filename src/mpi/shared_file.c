/*
 * shared_file.c: see mpi_ranks.h. Each rank has items here and there in an array, and writes one block of it:
 * the ranks first send each other the items of their blocks. So every file system gets large requests, which
 * do not overlap, and a rank that cannot write, for instance because the disk is full, leaves no other
 * waiting: collective writes of MPI-IO do, in Open MPI 4.
 */
#include "mpi/mpi_ranks.h"

#include "base/checksum.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* ---- Opening and closing ---- */

int drape_mpi_open(const drape_ranks *ranks, const char *path)
{
    drape_mpi_ranks *r = drape_mpi_ranks_of(ranks);
    char there[DRAPE_RANKS_PATH] = "";
    struct stat here;
    const size_t length = path && ranks->rank == 0 ? strlen(path) : 0;
    int error = length == 0 ? ECANCELED : length < DRAPE_RANKS_PATH ? 0 : ENAMETOOLONG;
    if (ranks->rank == 0 && !error)
        memcpy(there, path, length);
    MPI_Bcast(&error, 1, MPI_INT, 0, r->comm);
    if (error)
        return error;
    MPI_Bcast(there, DRAPE_RANKS_PATH, MPI_BYTE, 0, r->comm);
    /* Where ranks do not share the file system, another file may have the same path. Numbers of devices
     * differ between machines, those of files do not. */
    r->file = open(there, O_WRONLY | O_NOFOLLOW | O_CLOEXEC);
    error = r->file < 0 || fstat(r->file, &here) ? errno : 0;
    uint64_t number = error ? 0 : (uint64_t)here.st_ino;
    MPI_Bcast(&number, 1, MPI_UINT64_T, 0, r->comm);
    if (!error && number != 0 && number != (uint64_t)here.st_ino)
        error = ESTALE;
    error = (int)drape_ranks_largest(&r->base, error);
    if (error && r->file >= 0)
        close(r->file);
    return error;
}

/* After EINTR the descriptor is closed, too. */
int drape_mpi_close(const drape_ranks *ranks, bool durable)
{
    drape_mpi_ranks *r = drape_mpi_ranks_of(ranks);
    MPI_Bcast(&durable, sizeof durable, MPI_BYTE, 0, r->comm);
    int syncing = 0;
    do
        syncing = durable && fsync(r->file) ? errno : 0;
    while (syncing == EINTR);
    const int closing = close(r->file) && errno != EINTR ? errno : 0;
    return (int)drape_ranks_largest(ranks, syncing ? syncing : closing);
}

/* ---- Blocks ---- */

/* Items that are sent: the values and numbers of those that this rank has, and of those of its block. */
typedef struct items {
    double *sent, *received, *block; /* in ascending order; by rank; in the order of the file */
    int32_t *sent_number, *received_number;
    int *to, *from, *first_to, *first_from; /* (ranks) items for and from each, and where they begin */
    drape_arena arena;
} items;

/* The first item of the block of a rank. */
static int32_t first_of(const drape_rows *rows, int ranks, int rank)
{
    return (int32_t)((int64_t)rows->all * rank / ranks);
}

/* Packs what is sent, which is in the order of the ranks that it is for. */
static drape_status pack(const drape_mpi_ranks *r, const drape_rows *rows, items *of)
{
    const size_t w = (size_t)rows->width, ranks = (size_t)r->base.count, count = (size_t)rows->count;
    int *counts = drape_arena_take(&of->arena, 4 * ranks, sizeof *counts), n = 0, rank = 0;
    of->sent = drape_arena_take(&of->arena, w * count, sizeof *of->sent);
    of->sent_number = drape_arena_take(&of->arena, count, sizeof *of->sent_number);
    if (drape_arena_status(&of->arena))
        return DRAPE_E_MEMORY;
    of->to = counts;
    of->from = counts + ranks;
    of->first_to = counts + 2 * ranks;
    of->first_from = counts + 3 * ranks;
    for (int32_t i = 0; i < rows->count; i++) {
        if (!rows->counted[i])
            continue;
        while (rows->number[i] >= first_of(rows, r->base.count, rank + 1))
            rank++;
        memcpy(of->sent + w * (size_t)n, rows->values + w * (size_t)i, w * sizeof *of->sent);
        of->sent_number[n++] = rows->number[i];
        of->to[rank]++;
    }
    return DRAPE_OK;
}

/* Learns how much is received, and takes memory for that and for the block. */
static drape_status take_block(const drape_mpi_ranks *r, const drape_rows *rows, items *of)
{
    const size_t w = (size_t)rows->width;
    const int32_t first = first_of(rows, r->base.count, r->base.rank),
                  end = first_of(rows, r->base.count, r->base.rank + 1);
    MPI_Alltoall(of->to, 1, MPI_INT, of->from, 1, MPI_INT, r->comm);
    for (int k = 0; k + 1 < r->base.count; k++) {
        of->first_to[k + 1] = of->first_to[k] + of->to[k];
        of->first_from[k + 1] = of->first_from[k] + of->from[k];
    }
    const size_t received = (size_t)(of->first_from[r->base.count - 1] + of->from[r->base.count - 1]);
    of->received = drape_arena_take(&of->arena, w * received, sizeof *of->received);
    of->received_number = drape_arena_take(&of->arena, received, sizeof *of->received_number);
    of->block = drape_arena_take(&of->arena, w * (size_t)(end - first), sizeof *of->block);
    return drape_arena_status(&of->arena);
}

static void put_little(double *value)
{
#if __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
    uint64_t bits;
    memcpy(&bits, value, sizeof bits);
    bits = __builtin_bswap64(bits);
    memcpy(value, &bits, sizeof bits);
#else
    (void)value;
#endif
}

/* Sends the items to the ranks of their blocks, and puts those of this rank in their order. */
static void exchange(const drape_mpi_ranks *r, const drape_rows *rows, bool little_endian, items *of)
{
    const size_t w = (size_t)rows->width;
    const int last = r->base.count - 1;
    const int32_t first = first_of(rows, r->base.count, r->base.rank);
    MPI_Datatype item;
    MPI_Type_contiguous(rows->width, MPI_DOUBLE, &item);
    MPI_Type_commit(&item);
    MPI_Alltoallv(of->sent, of->to, of->first_to, item, of->received, of->from, of->first_from, item,
                  r->comm);
    MPI_Alltoallv(of->sent_number, of->to, of->first_to, MPI_INT32_T, of->received_number, of->from,
                  of->first_from, MPI_INT32_T, r->comm);
    MPI_Type_free(&item);
    for (int i = 0; i < of->first_from[last] + of->from[last]; i++) {
        double *to = of->block + w * (size_t)(of->received_number[i] - first);
        memcpy(to, of->received + w * (size_t)i, w * sizeof *to);
        for (size_t k = 0; k < w && little_endian; k++)
            put_little(to + k);
    }
}

/* 0 or errno. */
static int put(int file, off_t offset, const void *data, size_t size)
{
    const char *from = data;
    while (size > 0) {
        const ssize_t n = pwrite(file, from, size, offset);
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            return n < 0 ? errno : ENOSPC;
        from += n;
        offset += n;
        size -= (size_t)n;
    }
    return 0;
}

int drape_mpi_write(const drape_ranks *ranks, int64_t offset, bool little_endian, const drape_rows *rows,
                    uint64_t *sum)
{
    const drape_mpi_ranks *r = drape_mpi_ranks_of(ranks);
    items sent = {.arena = drape_arena_of(r->arena.ctx)};
    uint64_t here = 0;
    MPI_Bcast(&offset, 1, MPI_INT64_T, 0, r->comm);
    int error = pack(r, rows, &sent) ? ENOMEM : 0;
    if (!drape_ranks_any(ranks, error))
        error = take_block(r, rows, &sent) ? ENOMEM : 0;
    error = (int)drape_ranks_largest(ranks, error);
    if (!error) {
        exchange(r, rows, little_endian, &sent);
        const int32_t first = first_of(rows, r->base.count, r->base.rank),
                      end = first_of(rows, r->base.count, r->base.rank + 1);
        const size_t item = (size_t)rows->width * sizeof(double), size = item * (size_t)(end - first);
        const int64_t at = offset + (int64_t)item * first;
        here = drape_checksum_bytes((uint64_t)at, sent.block, size);
        error = put(r->file, (off_t)at, sent.block, size);
    }
    drape_arena_free(&sent.arena);
    MPI_Allreduce(&here, sum, 1, MPI_UINT64_T, MPI_SUM, r->comm);
    return (int)drape_ranks_largest(ranks, error);
}
