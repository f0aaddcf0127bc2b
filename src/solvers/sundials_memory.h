/*
 * sundials_memory.h: the state that KINSOL and IDA keep from call to call, for checkpoints. SUNDIALS has no
 * function that reads or writes it, but its private headers, which Debian installs with SUNDIALS 6, declare
 * it. Where they are missing nothing is archived: IDA starts anew from the state then, which is within its
 * tolerance, and modified Newton with new factors.
 */
#ifndef DRAPE_SOLVERS_SUNDIALS_MEMORY_H
#define DRAPE_SOLVERS_SUNDIALS_MEMORY_H

#include "base/archive.h"

/* False where the memory is not known: then nothing was archived. Where it is read, the solver has all its
 * settings, and solved nothing yet. */
bool drape_kinsol_archive(void *kinsol, drape_archive *a);
bool drape_ida_archive(void *ida, drape_archive *a);

/* Once, after IDAInit: sets to 0 what IDA has not written yet, so that no uninitialised memory gets into a
 * checkpoint. */
void drape_ida_clear(void *ida);

#endif
