/* Mathematical constants, which C99 does not define, and the headers that every numerical file uses. */

#ifndef CONSTANTS_H
#define CONSTANTS_H

#include <float.h>
#include <math.h>
#include <stdbool.h>

#define PI      3.14159265358979323846
#define TWO_PI  6.28318530717958647693
#define HALF_PI 1.57079632679489661923
#define INF     HUGE_VAL

#endif
