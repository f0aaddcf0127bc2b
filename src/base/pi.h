/* pi.h: the ratio of a circle's circumference to its diameter. */
#ifndef DRAPE_BASE_PI_H
#define DRAPE_BASE_PI_H

#define DRAPE_PI 3.14159265358979323846

#endif
