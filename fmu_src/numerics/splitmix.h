/* The finaliser of splitmix64 (Steele, Lea, Flood: OOPSLA 2014), which converts a counter to random bits. */

#ifndef SPLITMIX_H
#define SPLITMIX_H

#include <stdint.h>

#define GOLDEN UINT64_C(0x9e3779b97f4a7c15) /* odd, 2^64 over the golden ratio: step of the counter */

static inline uint64_t scramble(uint64_t a)
{
    a = (a ^ a >> 30) * UINT64_C(0xbf58476d1ce4e5b9);
    a = (a ^ a >> 27) * UINT64_C(0x94d049bb133111eb);
    return a ^ a >> 31;
}

#endif
