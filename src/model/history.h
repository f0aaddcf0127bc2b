/* history.h: the factor of a load over time. It is linear or, with slopes, cubic between its keys, and
 * constant before the first and after the last one. */
#ifndef DRAPE_MODEL_HISTORY_H
#define DRAPE_MODEL_HISTORY_H

#include "model/model.h"

/* The factor at time t [s]; 1 if the history is NULL. */
double drape_history_factor(const drape_history *history, double t);

/* The factor that is largest in magnitude, with its sign; 1 if the history is NULL. */
double drape_history_largest(const drape_history *history);

/* The least magnitude of a key that is not 0, but at least a millionth of the largest one, below which a
 * factor counts as 0. 0 if all are 0, 1 if the history is NULL. */
double drape_history_least(const drape_history *history);

/* Returns the time of the next key after t and before end at which the first or second derivative of the
 * factor jumps; otherwise end. */
double drape_history_next_kink(const drape_history *history, double t, double end);

/* The slopes (key_count) [1/s] of the monotone cubic of Fritsch & Butland 1984, A method for constructing
 * local monotone piecewise cubic interpolants: 0 at both ends and where the factor turns round, so that it
 * overshoots nowhere and its derivative is continuous everywhere. */
void drape_history_slopes(size_t key_count, const double *time, const double *value, double *slope);

#endif
