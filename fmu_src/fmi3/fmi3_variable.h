/* One variable of FMI 3.0. */

#ifndef FMI3_VARIABLE_H
#define FMI3_VARIABLE_H

#include <stdbool.h>
#include <stdint.h>

enum { NO_VARIABLE, IS_FLOAT64, IS_INT32, IS_BOOLEAN, IS_UINT64, IS_CLOCK };

typedef struct {
    uint8_t type;
    bool plain;        /* a scalar of type Float64 */
    bool resized;      /* the structural parameter is its length */
    bool intermediate; /* may be read in intermediate updates */
    uint32_t length;   /* number of elements, 1 for a scalar */
    uint32_t inner;    /* value reference in FMI 2.0 of the first element */
} Variable3;

#endif
