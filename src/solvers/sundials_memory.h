/*
 * sundials_memory.h: archives the state that IDA keeps between calls, for checkpoints. SUNDIALS has no
 * function to read or write it, but its private headers, which Debian installs with SUNDIALS 6, declare it.
 * Without these headers nothing is archived: IDA then restarts from the state, which is within its tolerance.
 */
#ifndef DRAPE_SOLVERS_SUNDIALS_MEMORY_H
#define DRAPE_SOLVERS_SUNDIALS_MEMORY_H

#include "base/archive.h"

/* False if the layout of the memory is unknown: then nothing was archived. When reading, the solver must
 * have all its settings and must not have solved anything yet. */
bool drape_ida_archive(void *ida, drape_archive *a);

/* Call it once, after IDAInit: sets to 0 what IDA has not written yet, so that no uninitialised memory gets
 * into a checkpoint. */
void drape_ida_clear(void *ida);

#endif
