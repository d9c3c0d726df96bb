/* Elastic, perfectly plastic elements, shared by the hysteresis models. */

#ifndef MAXWELL_H
#define MAXWELL_H

/* Return the force of an element, limited to W in both directions. */
static inline double limited(double force, double W) { return fabs(force) < W ? force : copysign(W, force); }

#endif
