/* test_reproducible.c: the build of the tests computes by IEEE 754, with its own powers in SUNDIALS, and
 * notices where it does not. */
#include <fenv.h>
#include <string.h>
#ifdef __SSE2__
#include <xmmintrin.h>
#endif

#include "sim/reproducible.h"
#include "support/suite.h"

static bool says(const char *reason)
{
    char why[512];
    const bool reproducible = drape_reproducible(why, sizeof why);
    ck_assert(reproducible == (why[0] == 0));
    return strstr(why, reason) != NULL;
}

TEST(arithmetic_is_that_of_ieee_754)
{
    ck_assert(!says("IEEE 754"));
    ck_assert(!says("more digits"));
}

TEST(another_rounding_is_noticed)
{
    static const int modes[] = {FE_UPWARD, FE_DOWNWARD, FE_TOWARDZERO};
    const uint64_t hash = drape_arithmetic_hash();
    for (int i = 0; i < 3; i++) {
        ck_assert_int_eq(fesetround(modes[i]), 0);
        const uint64_t other = drape_arithmetic_hash();
        const bool noticed = says("IEEE 754");
        fesetround(FE_TONEAREST);
        ck_assert(other != hash && noticed);
    }
    ck_assert(drape_arithmetic_hash() == hash && !says("IEEE 754"));
}

/* Denormal results become 0, on x86-64; elsewhere arithmetic stays as it is, and nothing is to be noticed. */
static bool flush_denormals(bool flush)
{
#ifdef __SSE2__
    const unsigned bit = 0x8000;
    _mm_setcsr(flush ? _mm_getcsr() | bit : _mm_getcsr() & ~bit);
    return flush;
#else
    return false && flush;
#endif
}

TEST(lost_denormals_are_noticed)
{
    const bool lost = flush_denormals(true), noticed = says("IEEE 754");
    flush_denormals(false);
    ck_assert(noticed == lost);
}

TEST(powers_of_sundials_are_ours_if_it_is_static)
{
    ck_assert(says("SUNDIALS") == SUNDIALS_IS_SHARED);
}
