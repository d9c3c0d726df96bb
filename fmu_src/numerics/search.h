/* Search in a table. */

#ifndef SEARCH_H
#define SEARCH_H

#include <stdint.h>

/* The i-th number of a table in rising order. */
typedef double Column(const void *table, int64_t i);

/* The last i with column(i) <= x. It is looked for in low ... high - 1; `low` itself, which is not read, is returned if
   no other one is found. */
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
