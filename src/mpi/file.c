/*
 * file.c: see file.h. By MPI-IO: the view of the file that each rank has is the places of its items, so
 * that one collective call writes all of them, and the library merges them into large requests.
 */
#include "mpi/file.h"

#include "base/checksum.h"

#include <errno.h>
#include <string.h>
#include <unistd.h>

typedef struct items {
    double *values; /* (width x count) of those that this rank writes, little endian */
    int32_t *number;
    int32_t count;
    uint64_t sum;
} items;

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

static bool pack(drape_context *ctx, int64_t offset, const double *values, int width, int32_t count,
                 const uint8_t *counted, const int32_t *number, items *of)
{
    const size_t w = (size_t)width;
    *of = (items){.values = drape_alloc(ctx, w * (size_t)count + 1, sizeof *of->values),
                  .number = drape_alloc(ctx, (size_t)count + 1, sizeof *of->number)};
    if (!of->values || !of->number)
        return false;
    for (int32_t i = 0; i < count; i++) {
        if (!counted[i])
            continue;
        double *to = of->values + w * (size_t)of->count;
        memcpy(to, values + w * (size_t)i, w * sizeof *to);
        for (size_t k = 0; k < w; k++)
            put_little(to + k);
        of->number[of->count++] = number[i];
        of->sum +=
            drape_checksum_bytes((uint64_t)offset + w * sizeof *to * (uint64_t)number[i], to, w * sizeof *to);
    }
    return true;
}

static int set_view(MPI_File file, int64_t offset, int width, const items *of)
{
    MPI_Datatype item, places;
    int code = MPI_Type_contiguous(width, MPI_DOUBLE, &item);
    if (code)
        return code;
    code = MPI_Type_create_indexed_block(of->count, 1, of->number, item, &places);
    if (!code) {
        code = MPI_Type_commit(&places);
        if (!code)
            code = MPI_File_set_view(file, offset, MPI_DOUBLE, places, "native", MPI_INFO_NULL);
        MPI_Type_free(&places);
    }
    MPI_Type_free(&item);
    return code;
}

static int error_of(int code)
{
    int class = MPI_SUCCESS;
    if (code)
        MPI_Error_class(code, &class);
    return !code                           ? 0
           : class == MPI_ERR_NO_SPACE     ? ENOSPC
           : class == MPI_ERR_QUOTA        ? EDQUOT
           : class == MPI_ERR_ACCESS       ? EACCES
           : class == MPI_ERR_NO_SUCH_FILE ? ENOENT
           : class == MPI_ERR_READ_ONLY    ? EROFS
                                           : EIO;
}

static int write_items(const drape_ranks *ranks, MPI_File file, int64_t offset, bool durable, int width,
                       const items *of)
{
    MPI_Status done;
    int written = 0, error = error_of(set_view(file, offset, width, of));
    if (drape_ranks_any(ranks, error != 0))
        return error;
    error = error_of(MPI_File_write_all(file, of->values, width * of->count, MPI_DOUBLE, &done));
    if (!error) {
        MPI_Get_count(&done, MPI_DOUBLE, &written);
        error = written == width * of->count ? 0 : ENOSPC;
    }
    if (durable) { /* collective, whatever the write returned here */
        const int synced = error_of(MPI_File_sync(file));
        error = error ? error : synced;
    }
    return error;
}

/* A file that is not there on some ranks would leave the others waiting in MPI_File_open. */
static int open_and_write(const drape_mpi_ranks *r, const char *path, int64_t offset, bool durable, int width,
                          const items *of)
{
    MPI_File file;
    int error = access(path, W_OK) ? errno : 0;
    if (drape_ranks_any(&r->base, error != 0))
        return error;
    error = error_of(MPI_File_open(r->comm, path, MPI_MODE_WRONLY, MPI_INFO_NULL, &file));
    if (drape_ranks_any(&r->base, error != 0))
        return error;
    error = write_items(&r->base, file, offset, durable, width, of);
    const int closing = error_of(MPI_File_close(&file));
    return error ? error : closing;
}

int drape_mpi_write(const drape_ranks *ranks, const char *path, int64_t offset, bool durable,
                    const double *values, int width, int32_t count, const uint8_t *counted,
                    const int32_t *number, uint64_t *sum)
{
    const drape_mpi_ranks *r = (const drape_mpi_ranks *)ranks; /* base is its first member */
    drape_context *ctx = r->arena.ctx;
    items of;
    int error = pack(ctx, offset, values, width, count, counted, number, &of) ? 0 : ENOMEM;
    if (!drape_ranks_any(ranks, error != 0))
        error = open_and_write(r, path, offset, durable, width, &of);
    MPI_Allreduce(&of.sum, sum, 1, MPI_UINT64_T, MPI_SUM, r->comm);
    drape_free(ctx, of.values);
    drape_free(ctx, of.number);
    return (int)drape_ranks_largest(ranks, error);
}
