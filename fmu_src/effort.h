/* Limits of the work in one communication step. A step that exceeds them is discarded with this reason, so that
   fmi2DoStep always returns. The limits count operations, not time, so that results do not depend on the machine; a
   processor with 3 GHz reaches them within about a second. */

#ifndef EFFORT_H
#define EFFORT_H

#ifndef MOST_TRIES
#define MOST_TRIES 1000000 /* samples, inner steps of a small system */
#endif

/* In units of about 25 ns: the force on one mass, a random number, half a step of an oscillator. */
#define MOST_WORK (30.0 * MOST_TRIES)

#endif
