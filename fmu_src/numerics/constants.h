/* Mathematical constants, which C99 does not define. */

#ifndef CONSTANTS_H
#define CONSTANTS_H

#define PI      3.14159265358979323846
#define TWO_PI  6.28318530717958647693
#define HALF_PI 1.57079632679489661923

#endif
