/* Elements that stick or slip, for model exchange: an element slips in the direction of motion once its force is at its
   level, and sticks from the next v = 0 on. Included after block.h. */

#ifndef SLIP_H
#define SLIP_H

/* Helper for VALID_BY. */
static inline bool are_directions(const double *slips, int count)
{
    bool good = true;
    for (int i = 0; i < count; i++)
        good = good && is_direction(slips[i]);
    return good;
}

/* Return the event indicator of an element that `slips` in a direction or sticks (0). Slip begins above the speed
   `rest` only: noise of a solver around v = 0 is not motion. */
static inline double slip_indicator(double slips, double v, double rest, double force, double level)
{
    if (slips != 0.0)
        return slips * v;
    return -fmax(fmin(v - rest, force - level), fmin(-v - rest, -force - level));
}

/* Return the direction in which the element slips after an event, or 0. */
static inline double slip_after(double slips, double v, double rest, double force, double level)
{
    if (slips * v > 0.0)
        return slips;
    return v >= rest && force >= level ? 1.0 : -v >= rest && -force >= level ? -1.0 : 0.0;
}

#endif
