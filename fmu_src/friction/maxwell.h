/* Elastic, perfectly plastic elements, which the hysteresis laws share. */

#ifndef MAXWELL_H
#define MAXWELL_H

/* The force of an element, at most W either way. */
static inline double limited(double force, double W) { return fabs(force) < W ? force : copysign(W, force); }

#endif
