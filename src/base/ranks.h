/*
 * ranks.h: the processes of a distributed run. Each has a part of one model: the nodes that it owns, all
 * elements that touch these, and copies of the other nodes of these elements (model/model.h). It computes the
 * forces and the rows of matrices of the nodes that it owns, so that only the positions and velocities of
 * copies are exchanged, and sums over all nodes.
 *
 * This is an interface: nothing here needs MPI, and NULL in place of a drape_ranks means that one process has
 * everything, for which all functions below return at once. src/mpi implements it.
 *
 * All functions are collective: each rank must call them in the same order, and so must branch on their
 * results, not on what it knows alone. Their results have the same bits on each rank.
 */
#ifndef DRAPE_BASE_RANKS_H
#define DRAPE_BASE_RANKS_H

#include "drape/drape.h"

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

typedef struct drape_ranks drape_ranks;
typedef struct drape_exchange drape_exchange; /* which items of an array have copies on other ranks */
struct drape_arena;
struct drape_linear_ops;
struct drape_pattern;

/* Items of `width` numbers of an array of the whole model, of which each rank has some. */
typedef struct drape_rows {
    const double *values; /* (count x width) of the items here */
    int width;
    int32_t count, all;     /* items here, and in the whole model */
    const uint8_t *counted; /* (count) 1: here, and on no other rank */
    const int32_t *number;  /* (count) in the whole model, ascending */
} drape_rows;

#define DRAPE_RANKS_PATH 4096

struct drape_ranks {
    int rank, count;
    int32_t own_blocks;   /* block columns of matrices that this rank owns: the first ones; the others are
                                copies */
    const int64_t *block; /* (block columns) the number of each in the matrix of all ranks */
    int64_t all_blocks;   /* in that matrix */
    const struct drape_linear_ops *direct; /* in place of the direct solvers of one process */

    /* values (n) become their sums over the ranks, in the order of the ranks; their largest, of which NaN is
     * larger than any number. */
    void (*sum)(const drape_ranks *ranks, double *values, int n);
    void (*largest)(const drape_ranks *ranks, double *values, int n);
    /* Sets the copies in arrays of nodes (node_count x 3) to what their owners have there. */
    void (*fetch)(const drape_ranks *ranks, double *const *nodes, int arrays);
    /* The same in an array of block columns (block columns x 3). */
    void (*fetch_blocks)(const drape_ranks *ranks, double *blocks);
    /* Plans copies here of `count` items of arrays of other ranks: place[i] on rank[i]. An item has `largest`
     * bytes or less. It lives as long as the arena. NULL, on all ranks: one is out of memory. */
    drape_exchange *(*plan)(const drape_ranks *ranks, struct drape_arena *arena, int32_t count,
                            const int32_t *rank, const int32_t *place, size_t largest);
    /* copies (count), in the order of the plan, become what their owners have in `own`, items of `size`
     * bytes. */
    void (*copy)(const drape_ranks *ranks, const drape_exchange *exchange, const void *own, void *copies,
                 size_t size);
    /* The reverse: adds copies, items of `width` numbers, to what their owners have in `own`, in the order of
     * the ranks. */
    void (*add)(const drape_ranks *ranks, const drape_exchange *exchange, double *own, const double *copies,
                int width);
    /* Each rank has the items first[rank] ... first[rank + 1] - 1, of `size` bytes, of `all`, which then all
     * have. */
    void (*share)(const drape_ranks *ranks, void *all, const int32_t *first, size_t size);
    /* Gathers rows into the array of the whole model on rank 0; all: NULL elsewhere. */
    void (*gather)(const drape_ranks *ranks, const drape_rows *rows, double *all);
    /* All ranks write into one file, which exists and which all of them reach, one file at a time. path,
     * offset, durable: those of rank 0; a path NULL there opens nothing, others are shorter than
     * DRAPE_RANKS_PATH. write: puts the array of the whole model, in the byte order of the machine or little
     * endian, from an offset on that is a multiple of 8. *sum: what it adds to the checksum of the file
     * (base/checksum.h). close: must follow an open that succeeded; durable: what was written is on the disk
     * then. They return 0 or an errno, the same on all ranks. */
    int (*open)(const drape_ranks *ranks, const char *path);
    int (*write)(const drape_ranks *ranks, int64_t offset, bool little_endian, const drape_rows *rows,
                 uint64_t *sum);
    int (*close)(const drape_ranks *ranks, bool durable);
    /* bytes (size) become those of a rank. */
    void (*broadcast)(const drape_ranks *ranks, int from, void *bytes, int size);
    /* As drape_inertia (solvers/inertia.h), of a matrix that the ranks share. */
    drape_status (*inertia)(drape_context *ctx, const struct drape_pattern *pattern, const double *values,
                            int64_t *negative, bool *known);
    /* A vector of SUNDIALS over all ranks (N_Vector) with these n values here; NULL: out of memory. sun: a
     * SUNContext. */
    void *(*vector)(const drape_ranks *ranks, int64_t n, double *values, void *sun);
};

static inline double drape_ranks_sum(const drape_ranks *ranks, double value)
{
    if (ranks)
        ranks->sum(ranks, &value, 1);
    return value;
}

static inline double drape_ranks_largest(const drape_ranks *ranks, double value)
{
    if (ranks)
        ranks->largest(ranks, &value, 1);
    return value;
}

static inline double drape_ranks_least(const drape_ranks *ranks, double value)
{
    return ranks ? -drape_ranks_largest(ranks, -value) : value;
}

static inline bool drape_ranks_any(const drape_ranks *ranks, bool value)
{
    return ranks ? drape_ranks_largest(ranks, value) > 0 : value;
}

static inline bool drape_ranks_all(const drape_ranks *ranks, bool value)
{
    return ranks ? !drape_ranks_any(ranks, !value) : value;
}

static inline void drape_ranks_fetch(const drape_ranks *ranks, double *nodes)
{
    if (ranks)
        ranks->fetch(ranks, &nodes, 1);
}

/* The status of the lowest rank that has one other than DRAPE_OK, for all, with its message in ctx. Where
 * ranks would wait for one that has failed, for instance because it alone has no more memory, they agree
 * first. */
drape_status drape_ranks_agree(const drape_ranks *ranks, drape_context *ctx, drape_status status);

/* The same of a rank that has the memory that it needs, or has not: DRAPE_E_MEMORY. */
static inline drape_status drape_ranks_agree_memory(const drape_ranks *ranks, drape_context *ctx, bool good)
{
    return drape_ranks_agree(ranks, ctx, good ? DRAPE_OK : DRAPE_E_MEMORY);
}

/* Which rank has the largest value, the lowest of several. */
static inline int drape_ranks_find(const drape_ranks *ranks, double value)
{
    if (!ranks)
        return 0;
    const double largest = drape_ranks_largest(ranks, value);
    const bool here = value == largest || (isnan(value) && isnan(largest));
    return (int)-drape_ranks_largest(ranks, here ? -ranks->rank : -ranks->count);
}

#endif
