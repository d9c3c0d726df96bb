/* Reproducible random numbers: xoshiro256++ of Blackman and Vigna (ACM TOMS 47(4), 2021), seeded by splitmix64. The
   state is four integers without pointers, for MEMORY; the same seed gives the same numbers on every machine. */

#ifndef RANDOM_H
#define RANDOM_H

#include "constants.h"
#include "splitmix.h"

typedef struct {
    uint64_t s[4];
} Random;

static inline uint64_t rotate_left(uint64_t a, int bits) { return a << bits | a >> (64 - bits); }

static inline void seed_random(Random *random, uint64_t seed)
{
    for (int i = 0; i < 4; i++)
        random->s[i] = scramble(seed += GOLDEN);
}

/* Return a uniform number in [0, 1), a multiple of 2^-53. */
static inline double uniform(Random *random)
{
    uint64_t *const s = random->s;
    const uint64_t result = rotate_left(s[0] + s[3], 23) + s[0], t = s[1] << 17;
    s[2] ^= s[0];
    s[3] ^= s[1];
    s[1] ^= s[2];
    s[0] ^= s[3];
    s[2] ^= t;
    s[3] = rotate_left(s[3], 45);
    return (double)(result >> 11) * 0x1.0p-53;
}

/* Return a standard normal number by the method of Box and Muller. */
static inline double normal(Random *random)
{
    const double radius = sqrt(-2.0 * log(1.0 - uniform(random)));
    return radius * cos(TWO_PI * uniform(random));
}

#endif
