/* sundials_memory.c: see sundials_memory.h. The only file that includes the private headers of SUNDIALS. */
#include "solvers/sundials_memory.h"

#include "solvers/sundials_compat.h"

#if SUNDIALS_VERSION_MAJOR == 6 && defined(__has_include)
#if __has_include(<ida/ida_impl.h>) && __has_include(<sundials_context_impl.h>)
#define KNOWN
#endif
#endif

#ifdef KNOWN

#include <ida/ida_impl.h>

static void archive_vector(drape_archive *a, N_Vector v)
{
    drape_archive_doubles(a, N_VGetArrayPointer(v), (size_t)N_VGetLength(v));
}

/* The index of the last of the difference vectors allocated by IDAInit. */
static int last_column(const struct IDAMemRec *s)
{
    return s->ida_maxord_alloc > 3 ? s->ida_maxord_alloc : 3;
}

void drape_ida_clear(void *ida)
{
    IDAMem s = ida;
    for (int k = 0; k <= last_column(s); k++)
        N_VConst(0, s->ida_phi[k]);
    N_VConst(0, s->ida_ee);
}

/* Does what only the first IDASolve does, before its first step. False if it fails. */
static bool set_up(IDAMem s)
{
    s->ida_edata = s;
    return s->ida_efun(s->ida_phi[0], s->ida_ewt, s->ida_edata) == 0 && s->ida_linit(s) == 0 &&
           idaNlsInit(s) == 0;
}

bool drape_ida_archive(void *ida, drape_archive *a)
{
    IDAMem s = ida;
    drape_archive_mark(a, "ida");
    /* The history itself: scaled divided differences, and the steps that they belong to. */
    drape_archive_same(a, "IDA's largest order", s->ida_maxord_alloc);
    for (int k = 0; k <= last_column(s); k++)
        archive_vector(a, s->ida_phi[k]);
    archive_vector(a, s->ida_ee);
    double *const arrays[] = {s->ida_psi, s->ida_alpha, s->ida_beta, s->ida_sigma, s->ida_gamma};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++)
        drape_archive_doubles(a, arrays[i], MXORDP1);
    int *const integers[] = {&s->ida_tstopset, &s->ida_kk, &s->ida_kused,    &s->ida_knew,
                             &s->ida_phase,    &s->ida_ns, &s->ida_SetupDone};
    for (size_t i = 0; i < sizeof integers / sizeof *integers; i++)
        drape_archive_int(a, integers[i]);
    double *const numbers[] = {
        &s->ida_tstop, &s->ida_hin,      &s->ida_h0u,     &s->ida_hh,     &s->ida_hused, &s->ida_eta,
        &s->ida_tn,    &s->ida_tretlast, &s->ida_cj,      &s->ida_cjlast, &s->ida_cjold, &s->ida_cjratio,
        &s->ida_ss,    &s->ida_oldnrm,   &s->ida_epsNewt, &s->ida_toldel, &s->ida_tolsf};
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++)
        drape_archive_double(a, numbers[i]);
    long *const counts[] = {&s->ida_nst, &s->ida_nre, &s->ida_ncfn,   &s->ida_netf,
                            &s->ida_nni, &s->ida_nnf, &s->ida_nsetups};
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
        long *value = counts[i];
        int64_t copy = *value;
        drape_archive_int64(a, &copy);
        *value = (long)copy;
    }
    /* Orders are indices into the history. */
    const int most = s->ida_maxord, orders[] = {s->ida_kk, s->ida_kused, s->ida_knew};
    for (int i = 0; i < 3 && drape_archive_good(a); i++)
        if (orders[i] < 0 || orders[i] > most)
            drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has the order %d of %d", orders[i], most);
    if (drape_archive_has_read(a) && s->ida_SetupDone && !set_up(s))
        drape_archive_fail(a, DRAPE_E_SOLVER, "IDA cannot continue from the checkpoint");
    return true;
}

#else

bool drape_ida_archive(void *ida, drape_archive *a)
{
    (void)ida, (void)a;
    return false;
}

void drape_ida_clear(void *ida)
{
    (void)ida;
}

#endif
