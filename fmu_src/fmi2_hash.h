/* Hash of bytes, for fingerprints and checksums. */

#ifndef FMI2_HASH_H
#define FMI2_HASH_H

#include <stddef.h>
#include <stdint.h>

/* FNV-1a, 64 bit. */
static uint64_t mix(uint64_t hash, const void *data, size_t size)
{
    const unsigned char *byte = (const unsigned char *)data;
    for (size_t i = 0; i < size; i++)
        hash = (hash ^ byte[i]) * UINT64_C(1099511628211);
    return hash;
}

#endif
