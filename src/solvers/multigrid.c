/* multigrid.c: see multigrid.h. */
#include "base/lanes.h"
#include "solvers/multigrid_parts.h"
#include "solvers/pcg.h"

#include <float.h>
#include <math.h>
#include <string.h>

#define LANCZOS_STEPS 5         /* for the largest eigenvalue of D^-1 A */
#define DAMPING       (4.0 / 3) /* of the largest eigenvalue's inverse: Vanek, Mandel & Brezina 1996 */
#define DOMINANT      0.9       /* share of a diagonal block that blocks between ranks may have */
#define SMALLEST      0.25 /* eigenvalue of a cycle times its matrix that the next finer level counts on */

/* ---- Small dense matrices ---- */

/* Inverts a symmetric matrix in place by Gauss and Jordan; false if it is not positive definite. */
static bool invert(int n, double *a)
{
    for (int k = 0; k < n; k++) {
        const double pivot = a[n * k + k];
        if (!(pivot > 0))
            return false;
        a[n * k + k] = 1;
        for (int c = 0; c < n; c++)
            a[n * k + c] /= pivot;
        for (int r = 0; r < n; r++) {
            if (r == k)
                continue;
            const double factor = a[n * r + k];
            a[n * r + k] = 0;
            for (int c = 0; c < n; c++)
                a[n * r + c] -= factor * a[n * k + c];
        }
    }
    return true;
}

static bool factor_dense(drape_multigrid *m)
{
    const matrix *a = &m->level[m->count - 1].a;
    const size_t n = scalars(a), b = (size_t)a->size;
    double *L = m->dense;
    memset(L, 0, n * n * sizeof *L);
    for (int32_t i = 0; i < a->count; i++)
        for (size_t c = 0; c < b; c++) {
            const double *row = a->values + b * (b * (size_t)a->start[i] + c * (size_t)length(a, i));
            for (int32_t k = a->start[i]; k < a->start[i + 1]; k++)
                for (size_t r = 0; r < b; r++)
                    L[n * ((size_t)i * b + c) + (size_t)a->column[k] * b + r] = *row++;
        }
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j <= i; j++) {
            double sum = L[n * i + j];
            for (size_t k = 0; k < j; k++)
                sum -= L[n * i + k] * L[n * j + k];
            if (i == j && !(sum > 0))
                return false;
            L[n * i + j] = i == j ? sqrt(sum) : sum / L[n * j + j];
        }
    return true;
}

static void solve_dense(const drape_multigrid *m, const double *b, double *x)
{
    const size_t n = scalars(&m->level[m->count - 1].a);
    const double *L = m->dense;
    for (size_t i = 0; i < n; i++) {
        double sum = b[i];
        for (size_t k = 0; k < i; k++)
            sum -= L[n * i + k] * x[k];
        x[i] = sum / L[n * i + i];
    }
    for (size_t i = n; i-- > 0;) {
        x[i] /= L[n * i + i];
        for (size_t k = 0; k < i; k++)
            x[k] -= L[n * i + k] * x[i];
    }
}

/* ---- Rows ---- */

/* The products of a symmetric matrix need its rows up to the diagonal only, which halves the memory that they
 * read: each serves for the row, and transposed for the column. `size` is a constant wherever these functions
 * are called. */

/* sum (size) -= the blocks of row i left of the diagonal, times x. */
LANES_INLINE void gather(const matrix *a, const int size, int32_t i, const double *restrict x,
                         double *restrict sum)
{
    const int64_t stride = size * length(a, i);
    const double *row = a->values + (int64_t)size * size * a->start[i];
    for (int32_t k = a->start[i]; k < a->diagonal[i]; k++, row += size) {
        const double *at = x + (int64_t)size * a->column[k];
#pragma GCC unroll 6
        for (int c = 0; c < size; c++)
#pragma GCC unroll 6
            for (int r = 0; r < size; r++)
                sum[c] -= row[c * stride + r] * at[r];
    }
}

/* y -= the same blocks transposed, times x (size) of row i. */
LANES_INLINE void scatter(const matrix *a, const int size, int32_t i, const double *restrict x,
                          double *restrict y)
{
    const int64_t stride = size * length(a, i);
    const double *row = a->values + (int64_t)size * size * a->start[i];
    for (int32_t k = a->start[i]; k < a->diagonal[i]; k++, row += size) {
        double *at = y + (int64_t)size * a->column[k];
#pragma GCC unroll 6
        for (int c = 0; c < size; c++)
#pragma GCC unroll 6
            for (int r = 0; r < size; r++)
                at[r] -= row[c * stride + r] * x[c];
    }
}

LANES_INLINE void multiply_block(const int size, const double *block, const double *from, double *to)
{
#pragma GCC unroll 6
    for (int c = 0; c < size; c++) {
        double sum = 0;
#pragma GCC unroll 6
        for (int r = 0; r < size; r++)
            sum += block[size * c + r] * from[r];
        to[c] = sum;
    }
}

/* to (size x MODES) += a (size x size) times from (size x MODES); the rows of a are `stride` apart. */
LANES_INLINE void add_block_product(const int size, const double *restrict a, int64_t stride,
                                    const double *restrict from, double *restrict to)
{
    for (int c = 0; c < size; c++)
#pragma GCC unroll 6
        for (int r = 0; r < size; r++)
#pragma GCC unroll 6
            for (int u = 0; u < MODES; u++)
                to[MODES * c + u] += a[c * stride + r] * from[MODES * r + u];
}

/* y = -A x. */
LANES_INLINE void multiply_rows(const matrix *a, const int size, const double *x, double *y)
{
    for (int32_t i = 0; i < a->count; i++) {
        const double *at = x + (int64_t)size * i, *block = a->values + (int64_t)size * size * a->start[i] +
                                                           (int64_t)size * (a->diagonal[i] - a->start[i]);
        double sum[MODES] = {0}, own[MODES];
        gather(a, size, i, x, sum);
#pragma GCC unroll 6
        for (int c = 0; c < size; c++) {
            own[c] = at[c];
#pragma GCC unroll 6
            for (int r = 0; r < size; r++)
                sum[c] -= block[c * size * length(a, i) + r] * at[r];
        }
        scatter(a, size, i, own, y);
        memcpy(y + (int64_t)size * i, sum, (size_t)size * sizeof *y);
    }
}

/* y -= the blocks in columns of copies, times what their owners have in x; += spread x, of 0 or 1 times what
 * the smoother adds to the diagonal blocks. */
LANES_INLINE void couple(const level *l, const int size, double spread, const double *x, double *y)
{
    const matrix *a = &l->a;
    const border *b = l->border;
    if (!b)
        return;
    b->ranks->copy(b->ranks, b->rows, x, b->copies, (size_t)size * sizeof *x);
    for (int32_t n = 0; n < b->count; n++) {
        const int32_t i = b->row[n];
        const int64_t stride = size * length(a, i), at = (int64_t)size * i;
        const double *row =
            a->values + (int64_t)size * size * a->start[i] + (int64_t)size * (b->outside[n] - a->start[i]);
        for (int32_t k = b->outside[n]; k < a->start[i + 1]; k++, row += size)
            for (int c = 0; c < size; c++)
                for (int r = 0; r < size; r++)
                    y[at + c] -=
                        row[c * stride + r] * b->copies[(int64_t)size * (a->column[k] - a->count) + r];
        row = a->values + (int64_t)size * size * a->start[i] + (int64_t)size * (a->diagonal[i] - a->start[i]);
        for (int c = 0; c < size; c++)
            for (int r = 0; r < size; r++)
                y[at + c] += spread * b->spread[n] * row[c * stride + r] * x[at + r];
    }
}

LANES_DISPATCH static void multiply(const level *l, const double *x, double *y)
{
    const size_t n = scalars(&l->a);
    if (l->a.size == 3) {
        multiply_rows(&l->a, 3, x, y);
        couple(l, 3, 0, x, y);
    } else {
        multiply_rows(&l->a, MODES, x, y);
        couple(l, MODES, 0, x, y);
    }
    for (size_t i = 0; i < n; i++)
        y[i] = -y[i];
}

void drape_multigrid_multiply(const drape_multigrid *m, const double *x, double *y)
{
    multiply(&m->level[0], x, y);
}

/* ---- Prolongation ---- */

static bool invert_diagonal(level *l)
{
    const matrix *a = &l->a;
    const int b = a->size;
    for (int32_t i = 0; i < a->count; i++) {
        const double *row =
            a->values + (int64_t)b * b * a->start[i] + (int64_t)b * (a->diagonal[i] - a->start[i]);
        double *to = l->inverse + (int64_t)b * b * i;
        for (int c = 0; c < b; c++)
            for (int r = 0; r < b; r++)
                to[b * c + r] = row[c * b * length(a, i) + r];
        if (!invert(b, to))
            return false;
    }
    return true;
}

/* to = a b, or a b'; of size x size, the rows of b are `stride` apart. */
static void multiply_blocks(int size, const double *a, const double *b, int64_t stride, bool transposed,
                            double *to)
{
    for (int r = 0; r < size; r++)
        for (int c = 0; c < size; c++) {
            double sum = 0;
            for (int k = 0; k < size; k++)
                sum += a[size * r + k] * b[transposed ? c * stride + k : k * stride + c];
            to[size * r + c] = sum;
        }
}

/* A bound on the largest singular value of C = L^-1 B M^-T, B a block (its rows are `stride` apart), L L' and
 * M M' what the inverses are of: the eighth root of the trace of (C C')^4, at most 6^(1/8) = 1.25 times as
 * large. */
static double coupling(int size, const double *block, int64_t stride, const double *inverse,
                       const double *other)
{
    double product[MODES * MODES], square[MODES * MODES], trace = 0;
    multiply_blocks(size, inverse, block, stride, false, product);
    multiply_blocks(size, product, other, size, false, square);
    multiply_blocks(size, square, block, stride, true, product);
    multiply_blocks(size, product, product, size, false, square);
    for (int r = 0; r < size; r++)
        for (int c = 0; c < size; c++)
            trace += square[size * r + c] * square[size * c + r];
    return sqrt(sqrt(sqrt(fmax(trace, 0))));
}

/*
 * Of rows at a border a sweep of Gauss and Seidel leaves out the blocks between ranks, B. M is the lower
 * triangle of the other blocks, with the diagonal (1 + s) D. The cycle is definite if M + M' - A =
 * (1 + 2 s) D - B is, which s of each row makes diagonally dominant by blocks, in the measure of D (Baker,
 * Falgout, Kolev & Yang 2011, Multigrid smoothers for ultraparallel computing, with sums of absolute values).
 * D is left with a share of 1 - DOMINANT of it, where M + M' - A is D without borders.
 */
static void spread_border(level *l)
{
    const matrix *a = &l->a;
    const border *b = l->border;
    const int size = a->size, square = size * size;
    b->ranks->copy(b->ranks, b->rows, l->inverse, l->inverse + (int64_t)square * a->count,
                   (size_t)square * sizeof *l->inverse);
    for (int32_t n = 0; n < b->count; n++) {
        const int32_t i = b->row[n];
        const double *block =
            a->values + (int64_t)square * a->start[i] + (int64_t)size * (b->outside[n] - a->start[i]);
        double *inverse = l->inverse + (int64_t)square * i, sum = 0;
        for (int32_t k = b->outside[n]; k < a->start[i + 1]; k++, block += size)
            sum += coupling(size, block, size * length(a, i), inverse,
                            l->inverse + (int64_t)square * a->column[k]);
        b->spread[n] = fmax(0, (sum - DOMINANT) / 2);
        for (int e = 0; e < square; e++)
            inverse[e] /= 1 + b->spread[n];
    }
}

static double dot_columns(const level *l, int32_t I, int p, int q)
{
    double sum = 0;
    for (int32_t n = l->member_start[I]; n < l->member_start[I + 1]; n++) {
        const double *block = l->modes + (int64_t)l->a.size * MODES * l->member[n];
        for (int c = 0; c < l->a.size; c++)
            sum += block[MODES * c + p] * block[MODES * c + q];
    }
    return sum;
}

static void add_column(level *l, int32_t I, int to, double factor, int from)
{
    for (int32_t n = l->member_start[I]; n < l->member_start[I + 1]; n++) {
        double *block = l->modes + (int64_t)l->a.size * MODES * l->member[n];
        for (int c = 0; c < l->a.size; c++)
            block[MODES * c + to] += factor * block[MODES * c + from];
    }
}

/* Q R of the modes of each aggregate by the modified method of Gram and Schmidt, twice: they become Q, and R
 * is what the aggregate's unknowns are in the global motions, the modes of the next level. A motion that
 * depends on the others, such as the rotation of a line about itself, becomes 0. */
static void orthonormalize(level *l, double *coarse_modes)
{
    for (int32_t I = 0; I < l->coarse; I++) {
        double *R = coarse_modes + (int64_t)MODES * MODES * I;
        memset(R, 0, sizeof *R * MODES * MODES);
        for (int q = 0; q < MODES; q++) {
            const double before = sqrt(dot_columns(l, I, q, q));
            for (int pass = 0; pass < 2; pass++)
                for (int p = 0; p < q; p++) {
                    const double part = dot_columns(l, I, p, q);
                    add_column(l, I, q, -part, p);
                    R[MODES * p + q] += part;
                }
            const double after = sqrt(dot_columns(l, I, q, q));
            const bool independent = after > sqrt(DBL_EPSILON) * before; /* more than half of the digits */
            R[MODES * q + q] = independent ? after : 0;
            add_column(l, I, q, independent ? 1 / after - 1 : -1, q);
        }
    }
}

/* The largest eigenvalue of a symmetric tridiagonal matrix, by bisection: as many eigenvalues are above a
 * number as A less that number has positive pivots. off[k] is the square of the entry between k and k + 1. */
static double largest_tridiagonal(int n, const double *diagonal, const double *off)
{
    double low = 0, high = 0;
    for (int k = 0; k < n; k++)
        high = fmax(high, diagonal[k] + (k > 0 ? sqrt(off[k - 1]) : 0) + (k + 1 < n ? sqrt(off[k]) : 0));
    for (double middle = high / 2; middle > low && middle < high; middle = (low + high) / 2) {
        double pivot = 0;
        bool above = false;
        for (int k = 0; k < n; k++) {
            pivot = diagonal[k] - middle - (k > 0 ? off[k - 1] / pivot : 0);
            above |= pivot > 0;
        }
        *(above ? &low : &high) = middle;
    }
    return high;
}

static void multiply_level(const void *owner, const double *x, double *y)
{
    multiply(owner, x, y);
}

/* z = D^-1 r. */
static void divide_by_diagonal(const void *owner, const double *r, double *z)
{
    const level *l = owner;
    const size_t size = (size_t)l->a.size, n = scalars(&l->a);
    for (size_t i = 0; i < n; i += size)
        multiply_block(l->a.size, l->inverse + size * i, r + i, z + i);
}

/* The largest eigenvalue of D^-1 A, D its diagonal blocks, from below: that of the tridiagonal matrix of
 * Lanczos' method, which the coefficients of conjugate gradients with the preconditioner D make up (Saad
 * 2003, Iterative methods for sparse linear systems, section 6.7.3). The power iteration needs twice the
 * products. */
static double largest_eigenvalue(level *l)
{
    const size_t n = scalars(&l->a), row = l->border ? (size_t)l->border->first[l->border->ranks->rank] : 0,
                 first = row * (size_t)l->a.size;
    double diagonal[LANCZOS_STEPS], off[LANCZOS_STEPS], length[LANCZOS_STEPS], ratio[LANCZOS_STEPS];
    drape_pcg pcg = {.n = (int64_t)n,
                     .owner = l,
                     .multiply = multiply_level,
                     .precondition = divide_by_diagonal,
                     .ranks = ranks_of(l),
                     .r = l->r,
                     .z = l->b,
                     .p = l->x,
                     .q = l->b,
                     .length = length,
                     .ratio = ratio};
    for (size_t i = 0; i < n; i++)
        l->b[i] = (double)((first + i + 1) * 2654435761U % 65536) / 32768 - 1;
    drape_pcg_solve(&pcg, l->b, NULL, 0, LANCZOS_STEPS);
    for (int k = 0; k < pcg.iterations; k++) {
        diagonal[k] = 1 / length[k] + (k > 0 ? ratio[k - 1] / length[k - 1] : 0);
        off[k] = k + 1 < pcg.iterations ? ratio[k] / (length[k] * length[k]) : 0;
    }
    /* none: A is not positive definite */
    return pcg.iterations > 0 ? largest_tridiagonal(pcg.iterations, diagonal, off) : 1;
}

/* P = (1 - w D^-1 A) T, T the modes of the aggregates. */
LANES_INLINE void smooth_row(level *l, const int size, int32_t i, double w)
{
    const matrix *a = &l->a;
    const int32_t *columns = l->p_column + l->p_start[i], count = l->p_start[i + 1] - l->p_start[i];
    const int64_t stride = size * length(a, i), block = (int64_t)size * MODES;
    const double *row = a->values + (int64_t)size * size * a->start[i],
                 *inverse = l->inverse + size * size * (int64_t)i;
    double *p = l->p + block * l->p_start[i];
    memset(p, 0, (size_t)(count * block) * sizeof *p);
    for (int32_t k = a->start[i]; k < a->start[i + 1]; k++, row += size) {
        const int32_t j = a->column[k];
        int32_t at = 0;
        if (l->aggregate[j] < 0)
            continue;
        while (columns[at] != l->aggregate[j])
            at++;
        add_block_product(size, row, stride, l->modes + block * j, p + block * at);
    }
    for (int32_t k = 0; k < count; k++) {
        double product[MODES * MODES];
        const double *t = l->modes + block * i;
        const bool own = columns[k] == l->aggregate[i];
        memcpy(product, p + block * k, (size_t)block * sizeof *p);
        for (int c = 0; c < size; c++)
            for (int q = 0; q < MODES; q++) {
                double sum = 0;
                for (int r = 0; r < size; r++)
                    sum += inverse[size * c + r] * product[MODES * r + q];
                p[block * k + MODES * c + q] = (own ? t[MODES * c + q] : 0) - w * sum;
            }
    }
}

/* Of copies, their owners have the modes, and the smoothed rows. */
static void fetch_rows(level *l, drape_exchange *x, int32_t items, double *values)
{
    const size_t block = (size_t)l->a.size * MODES;
    l->border->ranks->copy(l->border->ranks, x, values, values + block * (size_t)items,
                           block * sizeof *values);
}

LANES_DISPATCH static void smooth_prolongation(level *l)
{
    if (l->border)
        fetch_rows(l, l->border->rows, l->a.count, l->modes);
    const double w = DAMPING / largest_eigenvalue(l);
    for (int32_t i = 0; i < l->a.count; i++)
        if (l->a.size == 3)
            smooth_row(l, 3, i, w);
        else
            smooth_row(l, MODES, i, w);
    if (l->border)
        fetch_rows(l, l->border->prolongation, l->p_start[l->a.count], l->p);
}

/* ---- The coarse matrix P' A P ---- */

/* Block row i of A P into m->product, its columns into m->hit. Returns their number. */
LANES_INLINE int32_t multiply_prolongation(drape_multigrid *m, const level *l, const int size, int32_t i)
{
    const matrix *a = &l->a;
    const int64_t stride = size * length(a, i), block = (int64_t)size * MODES;
    const double *row = a->values + (int64_t)size * size * a->start[i];
    int32_t count = 0;
    for (int32_t k = a->start[i]; k < a->start[i + 1]; k++, row += size) {
        const int32_t j = a->column[k];
        for (int32_t q = l->p_start[j]; q < l->p_start[j + 1]; q++) {
            int32_t *where = m->where + l->p_column[q];
            if (*where < 0) {
                memset(m->product + block * count, 0, (size_t)block * sizeof(double));
                m->hit[count] = l->p_column[q];
                *where = count++;
            }
            add_block_product(size, row, stride, l->p + block * q, m->product + block * *where);
        }
    }
    return count;
}

/* Adds the product of block q of the prolongation and the row in m->product to these blocks of a coarse
 * row. */
LANES_INLINE void add_products(const drape_multigrid *m, const level *l, level *next, const int size,
                               int32_t q, int32_t first, int32_t end)
{
    const matrix *to = &next->a;
    const int32_t I = l->p_column[q];
    const int64_t block = (int64_t)size * MODES, stride = MODES * length(to, I);
    const double *p = l->p + block * q;
    for (int32_t k = first; k < end; k++) {
        const int32_t at = m->where[to->column[k]];
        if (at < 0)
            continue;
        const double *restrict product = m->product + block * at;
        double *restrict sum =
            next->own + (int64_t)MODES * MODES * to->start[I] + MODES * (int64_t)(k - to->start[I]);
        for (int c = 0; c < MODES; c++)
#pragma GCC unroll 6
            for (int r = 0; r < size; r++)
#pragma GCC unroll 6
                for (int u = 0; u < MODES; u++)
                    sum[c * stride + u] += p[MODES * r + c] * product[MODES * r + u];
    }
}

/* Adds row i's part P_i' (A P)_i to the lower triangle of the coarse matrix, and to what other ranks have a
 * part in. */
LANES_INLINE void add_row(drape_multigrid *m, const level *l, level *next, const int size, int32_t i)
{
    const matrix *to = &next->a;
    const int32_t count = multiply_prolongation(m, l, size, i);
    for (int32_t q = l->p_start[i]; q < l->p_start[i + 1]; q++) {
        const int32_t I = l->p_column[q];
        const bool here = I < to->count;
        int32_t outside = to->start[I + 1];
        add_products(m, l, next, size, q, to->start[I], here ? to->diagonal[I] + 1 : to->start[I + 1]);
        if (!l->border || !here)
            continue;
        while (to->column[outside - 1] >= to->count)
            outside--;
        add_products(m, l, next, size, q, outside, to->start[I + 1]);
    }
    for (int32_t k = 0; k < count; k++)
        m->where[m->hit[k]] = -1;
}

static int32_t find(const matrix *a, int32_t row, int32_t column)
{
    int32_t low = a->start[row], high = a->start[row + 1] - 1;
    while (low < high) {
        const int32_t middle = low + (high - low) / 2;
        if (a->column[middle] < column)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

/* Mirrors the lower triangle; an unknown that is in no motion of its aggregate gets the equation x = 0. */
static void complete(level *l)
{
    const matrix *a = &l->a;
    for (int32_t I = 0; I < a->count; I++)
        for (int32_t k = a->start[I]; k <= a->diagonal[I]; k++) {
            const int32_t J = a->column[k], back = find(a, J, I);
            const int64_t stride = MODES * length(a, I), other = MODES * length(a, J);
            double *from = l->own + (int64_t)MODES * MODES * a->start[I] + MODES * (int64_t)(k - a->start[I]),
                   *to =
                       l->own + (int64_t)MODES * MODES * a->start[J] + MODES * (int64_t)(back - a->start[J]);
            for (int c = 0; c < MODES; c++)
                for (int r = 0; r < (I == J ? c : MODES); r++)
                    to[r * other + c] = from[c * stride + r];
            for (int c = 0; I == J && c < MODES; c++)
                if (from[c * stride + c] == 0)
                    from[c * stride + c] = 1;
        }
}

LANES_DISPATCH static void make_coarse(drape_multigrid *m, const level *l, level *next)
{
    memset(next->own, 0, nonzeros(&next->a) * sizeof *next->own);
    memset(m->where, -1, (size_t)next->a.columns * sizeof *m->where);
    for (int32_t i = 0; i < l->a.count; i++)
        if (l->a.size == 3)
            add_row(m, l, next, 3, i);
        else
            add_row(m, l, next, MODES, i);
    if (l->border)
        l->border->ranks->add(l->border->ranks, l->border->products, next->own,
                              next->own + MODES * MODES * (size_t)next->a.start[next->a.count], MODES);
    complete(next);
}

/* Matrix and modes of the coarsest level that ranks share, for each of them. */
static void gather_matrix(const gathered *whole, const level *l)
{
    const drape_ranks *ranks = l->border->ranks;
    const int32_t *block = whole->first_block, *row = l->border->first;
    level *to = &whole->multigrid->level[0];
    const size_t size = MODES * MODES;
    memcpy(whole->shared + size * (size_t)block[ranks->rank], l->own,
           size * (size_t)l->a.start[l->a.count] * sizeof *l->own);
    ranks->share(ranks, whole->shared, block, size * sizeof *l->own);
    for (int32_t i = 0; i < to->a.count; i++)
        for (int c = 0; c < MODES; c++)
            for (int32_t k = to->a.start[i]; k < to->a.start[i + 1]; k++) {
                const size_t at = size * (size_t)to->a.start[i] + (size_t)(MODES * length(&to->a, i) * c);
                memcpy(to->own + at + MODES * (size_t)whole->place[k],
                       whole->shared + at + MODES * (size_t)(k - to->a.start[i]), MODES * sizeof *to->own);
            }
    memcpy(to->modes + size * (size_t)row[ranks->rank], l->modes,
           size * (size_t)l->a.count * sizeof *l->modes);
    ranks->share(ranks, to->modes, row, size * sizeof *l->modes);
}

/* From the matrix and the modes of the first level. */
static bool factor_levels(drape_multigrid *m)
{
    for (int k = 0; k < m->count; k++) {
        level *l = &m->level[k];
        if (k + 1 == m->count && m->whole.multigrid) {
            gather_matrix(&m->whole, l);
            return drape_ranks_all(ranks_of(l), factor_levels(m->whole.multigrid));
        }
        if (!drape_ranks_all(ranks_of(l), invert_diagonal(l)))
            return false;
        if (l->border)
            spread_border(l);
        if (k + 1 == m->count)
            break;
        orthonormalize(l, m->level[k + 1].modes);
        smooth_prolongation(l);
        make_coarse(m, l, &m->level[k + 1]);
    }
    return !m->dense || factor_dense(m);
}

drape_status drape_multigrid_factor(drape_multigrid *m, const double *values, const double *x)
{
    m->level[0].a.values = values;
    /* The rigid motions of nodes at x: translations, and rotations about their mean, in units of their
     * extent. */
    level *l = &m->level[0];
    const size_t count = (size_t)l->a.count;
    const double all = (double)all_rows(l);
    double mean[3] = {0}, extent = 0;
    for (size_t i = 0; i < 3 * count; i++)
        mean[i % 3] += x[i] / all;
    if (l->border)
        l->border->ranks->sum(l->border->ranks, mean, 3);
    for (size_t i = 0; i < 3 * count; i++)
        extent = fmax(extent, fabs(x[i] - mean[i % 3]));
    extent = drape_ranks_largest(ranks_of(l), extent);
    const double scale = extent > 0 ? 1 / extent : 0;
    memset(l->modes, 0, 3 * count * MODES * sizeof *l->modes);
    for (size_t i = 0; i < count; i++)
        for (size_t c = 0; c < 3; c++) {
            const size_t next = (c + 1) % 3, last = (c + 2) % 3;
            double *block = l->modes + 3 * MODES * i;
            block[MODES * c + c] = 1;
            block[MODES * next + 3 + c] = -scale * (x[3 * i + last] - mean[last]);
            block[MODES * last + 3 + c] = scale * (x[3 * i + next] - mean[next]);
        }
    return factor_levels(m) ? DRAPE_OK : DRAPE_RETRY_LINEAR;
}

/* ---- The cycle ---- */

/* A sweep forwards from x = 0, and the residual r that it leaves, which the blocks right of the diagonal
 * alone contribute to. */
LANES_INLINE void sweep_forwards(const level *l, const int size, const double *b, double *x, double *r)
{
    const matrix *a = &l->a;
    memset(r, 0, scalars(a) * sizeof *r);
    for (int32_t i = 0; i < a->count; i++) {
        double sum[MODES], own[MODES];
        memcpy(sum, b + (int64_t)size * i, (size_t)size * sizeof *sum);
        gather(a, size, i, x, sum);
        multiply_block(size, l->inverse + (int64_t)size * size * i, sum, own);
        scatter(a, size, i, own, r);
        memcpy(x + (int64_t)size * i, own, (size_t)size * sizeof *x);
    }
    couple(l, size, 1, x, r);
}

/* rest is scratch: b less the product of the blocks right of the diagonal and the new x. */
LANES_INLINE void sweep_backwards(const level *l, const int size, const double *b, double *x, double *rest)
{
    const matrix *a = &l->a;
    memcpy(rest, b, scalars(a) * sizeof *rest);
    couple(l, size, 1, x, rest);
    for (int32_t i = a->count; i-- > 0;) {
        double sum[MODES], own[MODES];
        memcpy(sum, rest + (int64_t)size * i, (size_t)size * sizeof *sum);
        gather(a, size, i, x, sum);
        multiply_block(size, l->inverse + (int64_t)size * size * i, sum, own);
        scatter(a, size, i, own, rest);
        memcpy(x + (int64_t)size * i, own, (size_t)size * sizeof *x);
    }
}

LANES_INLINE void restrict_residual(const level *l, const int size, const double *r, const level *next)
{
    double *b = next->b;
    memset(b, 0, (size_t)next->a.columns * MODES * sizeof *b);
    for (int32_t i = 0; i < l->a.count; i++)
        for (int32_t q = l->p_start[i]; q < l->p_start[i + 1]; q++) {
            const double *p = l->p + (int64_t)size * MODES * q, *from = r + (int64_t)size * i;
            double *to = b + (int64_t)MODES * l->p_column[q];
#pragma GCC unroll 6
            for (int c = 0; c < size; c++)
#pragma GCC unroll 6
                for (int u = 0; u < MODES; u++)
                    to[u] += p[MODES * c + u] * from[c];
        }
    if (l->border)
        l->border->ranks->add(l->border->ranks, next->border->rows, b, b + scalars(&next->a), MODES);
}

LANES_INLINE void add_correction(const level *l, const int size, const double *coarse, double *x)
{
    for (int32_t i = 0; i < l->a.count; i++)
        for (int32_t q = l->p_start[i]; q < l->p_start[i + 1]; q++) {
            const double *p = l->p + (int64_t)size * MODES * q,
                         *from = coarse + (int64_t)MODES * l->p_column[q];
#pragma GCC unroll 6
            for (int c = 0; c < size; c++)
#pragma GCC unroll 6
                for (int u = 0; u < MODES; u++)
                    x[(int64_t)size * i + c] += p[MODES * c + u] * from[u];
        }
}

static void cycle(drape_multigrid *m, int k, const double *b, double *x);

/* Two cycles on level k for its own b. With s an eigenvalue of a cycle times A, at most 1, they are the
 * polynomial (1 - T(s)) / (1 + e) / s of the cycle, T that of Chebyshev of degree 2 with T(0) = 1 and
 * |T| <= e on [SMALLEST, 1]: symmetric, positive definite, and within 1 again (Axelsson & Vassilevski 1989,
 * Algebraic multilevel preconditioning methods, I). */
static void cycle_twice(drape_multigrid *m, int k)
{
    level *l = &m->level[k];
    if (k + 1 == m->count) {
        if (m->whole.multigrid) {
            /* The cycles on the levels that each rank has as a whole. */
            const drape_ranks *ranks = l->border->ranks;
            const int32_t *first = l->border->first;
            level *to = &m->whole.multigrid->level[0];
            const size_t row = MODES * sizeof *l->b;
            memcpy(to->b + MODES * (size_t)first[ranks->rank], l->b, row * (size_t)l->a.count);
            ranks->share(ranks, to->b, first, row);
            cycle_twice(m->whole.multigrid, 0);
            memcpy(l->x, to->x + MODES * (size_t)first[ranks->rank], row * (size_t)l->a.count);
            for (int32_t i = l->a.count; i < l->a.columns; i++)
                memcpy(l->x + MODES * (size_t)i, to->x + MODES * (size_t)l->border->number[i - l->a.count],
                       row);
        } else
            cycle(m, k, l->b, l->x);
        return;
    }
    const size_t n = scalars(&l->a);
    const double middle = (1 + SMALLEST) / 2, radius = (1 - SMALLEST) / 2;
    const double top = 2 * middle * middle / (radius * radius) - 1; /* of Chebyshev's at s = 0 */
    const double factor = 2 / (radius * radius * (top + 1));
    cycle(m, k, l->b, l->x);
    for (size_t i = 0; i < n; i++)
        l->sum[i] = 2 * middle * factor * l->x[i];
    multiply(l, l->x, l->b);
    cycle(m, k, l->b, l->x);
    for (size_t i = 0; i < n; i++)
        l->x[i] = l->sum[i] - factor * l->x[i];
}

LANES_INLINE void cycle_rows(drape_multigrid *m, int k, const int size, const double *b, double *x)
{
    const level *l = &m->level[k];
    sweep_forwards(l, size, b, x, l->r);
    if (k + 1 < m->count) {
        level *next = &m->level[k + 1];
        restrict_residual(l, size, l->r, next);
        cycle_twice(m, k + 1);
        if (l->border && !(k + 2 == m->count && m->whole.multigrid))
            next->border->ranks->copy(next->border->ranks, next->border->rows, next->x,
                                      next->x + scalars(&next->a), (size_t)next->a.size * sizeof *next->x);
        add_correction(l, size, next->x, x);
    }
    sweep_backwards(l, size, b, x, l->r);
}

LANES_DISPATCH static void cycle(drape_multigrid *m, int k, const double *b, double *x)
{
    if (k + 1 == m->count && m->dense)
        solve_dense(m, b, x);
    else if (m->level[k].a.size == 3)
        cycle_rows(m, k, 3, b, x);
    else
        cycle_rows(m, k, MODES, b, x);
}

void drape_multigrid_apply(drape_multigrid *m, const double *r, double *z)
{
    cycle(m, 0, r, z);
}

int drape_multigrid_levels(const drape_multigrid *m)
{
    return m->count;
}
