/* Effect of the normal force, the same for all contact models. */

#ifndef LOAD_H
#define LOAD_H

#include <math.h>

/* Contact forces are proportional to the normal force and vanish if the contact opens. Fn = Fn0 is the usual case and
   avoids a division, which costs as much as the rest of a simple model. */
static inline double load_of(double Fn, double Fn0) { return Fn == Fn0 ? 1.0 : fmax(Fn, 0.0) / Fn0; }

#endif
