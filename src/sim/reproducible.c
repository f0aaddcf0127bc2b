/* reproducible.c: see reproducible.h. */
#include "sim/reproducible.h"
#include "base/elementary.h"
#include "base/hash.h"
#include "solvers/sundials_power.h"

#include <float.h>
#include <math.h>
#include <stdio.h>

/* The hash that IEEE 754 demands; it changes only with the functions themselves. */
#define ARITHMETIC UINT64_C(0xf91742e0a06193c2)

#define ARGUMENTS 64

/* In each function, some of the last bits change if an operation is contracted or rounded otherwise; the last
 * product is denormal. */
uint64_t drape_arithmetic_hash(void)
{
    uint64_t hash = DRAPE_HASH_START;
    for (int i = 1; i <= ARGUMENTS; i++) {
        double sine, cosine;
        const double a = i * 0.0731, b = 1.37 - a;
        drape_sin_cos(9 * a, &sine, &cosine);
        const double all[] = {sine,         cosine,        drape_atan2(b, a - 1), drape_hypot(a, b),
                              drape_ln(a),  drape_ln1p(a), drape_pow(a, b),       a * b + sine,
                              a * 0x1p-1040};
        hash = drape_hash_bytes(hash, all, sizeof all);
    }
    return hash;
}

bool drape_reproducible(char *why, size_t size)
{
    const struct {
        bool so;
        const char *text;
    } reasons[] = {
        {drape_arithmetic_hash() != ARITHMETIC,
         "arithmetic is not that of IEEE 754 without contraction, rounding to nearest, as with -ffast-math"},
        {FLT_EVAL_METHOD != 0, "the compiler computes with more digits than a double has"},
        {!drape_sundials_power_is_ours(), "SUNDIALS takes powers from the C library (-Dsundials=shared)"},
    };
    size_t used = 0;
    why[0] = 0;
    for (size_t i = 0; i < sizeof reasons / sizeof *reasons; i++)
        if (reasons[i].so && used < size)
            used += (size_t)snprintf(why + used, size - used, "%s%s", used > 0 ? "; " : "", reasons[i].text);
    return used == 0;
}
