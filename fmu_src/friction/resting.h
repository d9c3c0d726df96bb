/* What the models that jump at v = 0 decide in model exchange; see rest.h. Included before block.h. */

#ifndef RESTING_H
#define RESTING_H

struct rest {
    double direction; /* of the motion; 0: at rest */
    double stuck;     /* 1: at rest and held by friction */
    double at;        /* velocity at which rest began */
};

#define EVENTS     2
#define DECIDES_BY transition
#define MEMORY     struct rest
#define VALID_BY   is_rest
#define KEEPS_BY   keep_decisions

#endif
