/*
 * reserve.h: memory for where SUNDIALS finds none. What creates its solvers and vectors crashes, prints or
 * frees twice where malloc fails, so while a reserve is open on a thread, malloc and calloc take from it
 * instead of failing (--wrap in src/meson.build). In a program that links the static library, or with a
 * shared SUNDIALS, they fail, but only if memory runs out after the reserve was found.
 */
#ifndef DRAPE_SOLVERS_RESERVE_H
#define DRAPE_SOLVERS_RESERVE_H

#include "base/context.h"

typedef struct drape_reserve {
    void *small, *large; /* lists of blocks */
    size_t large_size;
    bool used;
    struct drape_reserve *outer; /* that which was open on the thread before */
} drape_reserve;

/* Takes memory for a solver whose vectors have n numbers. Follow it with drape_reserve_close in any case.
 * Errors: DRAPE_E_MEMORY. */
drape_status drape_reserve_open(drape_reserve *reserve, drape_context *ctx, size_t n);

/* Frees what is left. Returns the status that it is given, or DRAPE_E_MEMORY if the reserve was needed. */
drape_status drape_reserve_close(drape_reserve *reserve, drape_context *ctx, drape_status status);

#endif
