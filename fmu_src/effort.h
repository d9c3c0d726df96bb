/* The work that a block puts into one communication step. A step that needs more is discarded with that reason, so that
   no value makes fmi2DoStep run on for ever. The limits are numbers of operations, not times, so that a result does not
   depend on the machine; on a processor of 3 GHz they are reached within about a second. */

#ifndef EFFORT_H
#define EFFORT_H

#ifndef MOST_TRIES
#define MOST_TRIES 1000000 /* samples, inner steps of a small system */
#endif

/* In units of some 25 ns: the force on one mass, a random number, half a step of an oscillator. */
#define MOST_WORK (30.0 * MOST_TRIES)

#endif
