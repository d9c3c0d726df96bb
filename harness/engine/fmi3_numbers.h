/* The numbers of FMI 3.0 as doubles: all widths of integers, and Boolean. */

#ifndef FMI3_NUMBERS_H
#define FMI3_NUMBERS_H

#include "engine.h"

typedef enum {
    FLOAT_64,
    FLOAT_32,
    INT_8,
    UINT_8,
    INT_16,
    UINT_16,
    INT_32,
    UINT_32,
    INT_64,
    UINT_64,
    BOOLEAN_8,
    TYPES_3
} Type3;

static const size_t sizes_3[TYPES_3] = {8, 4, 1, 1, 2, 2, 4, 4, 8, 8, 1};
static const double least_3[TYPES_3] = {0, 0, -128.0, 0, -32768.0, 0, -2147483648.0, 0, -9007199254740992.0, 0, 0};
static const double most_3[TYPES_3] = {
    0, 0, 127.0, 255.0, 32767.0, 65535.0, 2147483647.0, 4294967295.0, 9007199254740992.0, 9007199254740992.0, 0};

#define STORE(type) (*(type *)(void *)to = (type)value)
static void store(unsigned char *to, int type, double value)
{
    switch (type) {
    case FLOAT_64: STORE(double); break;
    case FLOAT_32: STORE(float); break;
    case INT_8: STORE(int8_t); break;
    case UINT_8: STORE(uint8_t); break;
    case INT_16: STORE(int16_t); break;
    case UINT_16: STORE(uint16_t); break;
    case INT_32: STORE(int32_t); break;
    case UINT_32: STORE(uint32_t); break;
    case INT_64: STORE(int64_t); break;
    case UINT_64: STORE(uint64_t); break;
    default: *(bool *)(void *)to = value != 0.0;
    }
}

#define LOAD(type) ((double)*(const type *)(const void *)from)
static double load(const unsigned char *from, int type)
{
    switch (type) {
    case FLOAT_64: return LOAD(double);
    case FLOAT_32: return LOAD(float);
    case INT_8: return LOAD(int8_t);
    case UINT_8: return LOAD(uint8_t);
    case INT_16: return LOAD(int16_t);
    case UINT_16: return LOAD(uint16_t);
    case INT_32: return LOAD(int32_t);
    case UINT_32: return LOAD(uint32_t);
    case INT_64: return LOAD(int64_t);
    case UINT_64: return LOAD(uint64_t);
    default: return *(const bool *)(const void *)from ? 1.0 : 0.0;
    }
}

#endif
