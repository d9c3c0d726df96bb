/* A ripple for PositionMap: cogging with a period of 24 mm over 72 mm, and friction that is largest at both ends.
   Begin and spacing of the nodes, and rows { C, D }, in SI units. */

#ifndef MAP_H
#define MAP_H

#include "constants.h"

/* clang-format off */
static const double map_begin = 0.0, map_spacing = 0.003;
static const bool map_periodic = false;
static const double map[][2] = {
    {0.0, 0.4},
    {0.707107, 0.38637},
    {1.0, 0.34641},
    {0.707107, 0.282843},
    {0.0, 0.2},
    {-0.707107, 0.103528},
    {-1.0, 0.0},
    {-0.707107, -0.103528},
    {0.0, -0.2},
    {0.707107, -0.282843},
    {1.0, -0.34641},
    {0.707107, -0.38637},
    {0.0, -0.4},
    {-0.707107, -0.38637},
    {-1.0, -0.34641},
    {-0.707107, -0.282843},
    {0.0, -0.2},
    {0.707107, -0.103528},
    {1.0, 0.0},
    {0.707107, 0.103528},
    {0.0, 0.2},
    {-0.707107, 0.282843},
    {-1.0, 0.34641},
    {-0.707107, 0.38637},
    {0.0, 0.4},
};
/* clang-format on */

#endif
