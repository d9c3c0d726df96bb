/* The normal force, which every contact law of this folder takes in the same way. */

#ifndef LOAD_H
#define LOAD_H

#include <math.h>

/* Contact forces grow with the normal force; a contact that is pulled open has none. Most are loaded with Fn0, and a
   division costs as much as the rest of a simple law. */
static inline double load_of(double Fn, double Fn0) { return Fn == Fn0 ? 1.0 : fmax(Fn, 0.0) / Fn0; }

#endif
