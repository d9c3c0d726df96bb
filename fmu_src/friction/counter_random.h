/* Random numbers by place instead of by order: number `n` of stream `stream` of a seed, without a state.

   The finaliser of splitmix64 (Steele, Lea, Flood: OOPSLA 2014) over a Weyl sequence for each stream. Members of a
   population that each have a stream of their own get the same numbers whatever order their events happen in, so
   that a result does not depend on how a span is cut into steps. */

#ifndef COUNTER_RANDOM_H
#define COUNTER_RANDOM_H

static inline uint64_t scramble(uint64_t a)
{
    a = (a ^ a >> 30) * UINT64_C(0xbf58476d1ce4e5b9);
    a = (a ^ a >> 27) * UINT64_C(0x94d049bb133111eb);
    return a ^ a >> 31;
}

/* Uniform in (0, 1), an odd multiple of 2^-53. */
static inline double uniform_at(int seed, int stream, uint32_t n)
{
    const uint64_t golden = UINT64_C(0x9e3779b97f4a7c15), names = (uint64_t)(uint32_t)seed << 32 | (uint32_t)stream;
    const uint64_t bits = scramble(scramble(scramble(names + golden) + golden) + golden * n);
    return ((double)(bits >> 12) + 0.5) * 0x1.0p-52;
}

#endif
