/* Event indicator of a decision that holds while `margin` is not negative, for model exchange. */

#ifndef UNTIL_CHANGE_H
#define UNTIL_CHANGE_H

/* The decision ends just below 0, so that a margin of exactly 0 is on one side of the event only. */
static inline double until_change(double holds, double margin, double scale)
{
    return holds != 0.0 ? margin + 1e-12 * scale : -margin;
}

#endif
