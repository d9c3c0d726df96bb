/* Counter-based random numbers: number `n` of stream `stream` of a seed, without a state.

   The method is splitmix64 over a Weyl sequence for each stream. Members of a population that each have their own
   stream get the same numbers in whatever order their events occur, so that a result does not depend on the division
   into steps. */

#ifndef COUNTER_RANDOM_H
#define COUNTER_RANDOM_H

#include "splitmix.h"

/* Return a uniform number in (0, 1), an odd multiple of 2^-53. */
static inline double uniform_at(int seed, int stream, uint32_t n)
{
    const uint64_t names = (uint64_t)(uint32_t)seed << 32 | (uint32_t)stream;
    const uint64_t bits = scramble(scramble(scramble(names + GOLDEN) + GOLDEN) + GOLDEN * n);
    return ((double)(bits >> 12) + 0.5) * 0x1.0p-52;
}

#endif
