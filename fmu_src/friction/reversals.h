/* The reversal points stored by the Leuven model. Included before block.h, as the MEMORY of a block. */

#ifndef REVERSALS_H
#define REVERSALS_H

enum { DEEPEST = 64 }; /* maxima and minima together */

/* Maxima and minima alternate, so the two stacks are one list, outermost first. */
struct reversals {
    double force[DEEPEST];
    double direction;       /* of the last motion; 0: none yet */
    double depth, overflow; /* number of points; 1 after one was lost */
    double sliding;         /* in model exchange: the flag */
};

#endif
