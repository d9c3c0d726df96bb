/* The reversal points that Leuven's model remembers. Included before block.h, as a block's MEMORY. */

#ifndef REVERSALS_H
#define REVERSALS_H

enum { DEEPEST = 64 }; /* maxima and minima together */

/* Maxima and minima come in turn, so the two stacks are one list, outermost first. */
struct reversals {
    double force[DEEPEST];
    double direction;       /* of the last motion, 0: none yet */
    double depth, overflow; /* number of points; 1 once one was lost */
};

#endif
