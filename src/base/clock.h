/* clock.h: monotonic clocks, in seconds. */
#ifndef DRAPE_BASE_CLOCK_H
#define DRAPE_BASE_CLOCK_H

double drape_clock_seconds(void);        /* wall-clock time */
double drape_clock_cpu_seconds(void);    /* CPU time of the process */
double drape_clock_thread_seconds(void); /* CPU time of the calling thread */

#endif
