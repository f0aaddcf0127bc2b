/* clock.h: seconds of a clock that never jumps. */
#ifndef DRAPE_BASE_CLOCK_H
#define DRAPE_BASE_CLOCK_H

double drape_clock_seconds(void);        /* wall */
double drape_clock_cpu_seconds(void);    /* CPU time of the process */
double drape_clock_thread_seconds(void); /* CPU time of the calling thread */

#endif
