/*
 * sundials_memory.h: what KINSOL and IDA keep from call to call, for checkpoints. SUNDIALS has no function
 * that gives or takes it; its private headers, which Debian installs with SUNDIALS 6, do. Where they are
 * missing nothing is archived: IDA starts anew from the state then, which is within its tolerance, and
 * modified Newton with new factors.
 */
#ifndef DRAPE_SOLVERS_SUNDIALS_MEMORY_H
#define DRAPE_SOLVERS_SUNDIALS_MEMORY_H

#include "base/archive.h"

/* False where the memory is not known: then nothing was archived. Where it is read, the solver has all its
 * settings, and solved nothing yet. */
bool drape_kinsol_archive(void *kinsol, drape_archive *a);
bool drape_ida_archive(void *ida, drape_archive *a);

/* Once, after IDAInit: what IDA has not written yet is 0 then, and nothing of the heap's gets into a
 * checkpoint. */
void drape_ida_clear(void *ida);

#endif
