/* Search in a table. */

#ifndef SEARCH_H
#define SEARCH_H

#include <stdint.h>

/* Return the i-th number of a table in ascending order. */
typedef double Column(const void *table, int64_t i);

/* Return the last i in low + 1 ... high - 1 with column(i) <= x, or `low` if there is none. */
static inline int64_t last_not_above(Column *column, const void *table, int64_t low, int64_t high, double x)
{
    while (high - low > 1) {
        const int64_t middle = low + (high - low) / 2;
        if (column(table, middle) <= x)
            low = middle;
        else
            high = middle;
    }
    return low;
}

#endif
