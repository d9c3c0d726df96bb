/* The work that a block puts into one communication step: samples, inner steps, events. A step that needs more is
   discarded, so that no value makes fmi2DoStep run on for ever. */

#ifndef EFFORT_H
#define EFFORT_H

#ifndef MOST_TRIES
#define MOST_TRIES 1000000
#endif

#endif
