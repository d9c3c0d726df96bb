/* The beginning of every saved state: which FMU wrote it, and a checksum. */

#ifndef FMI2_SAVED_H
#define FMI2_SAVED_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

enum { MAGIC_SIZE = 8, GUID_SIZE = GUID_LENGTH + 2 }; /* texts, filled with zeros */

typedef struct {
    char magic[MAGIC_SIZE];
    char guid[GUID_SIZE];
    uint32_t byte_order, size; /* size of the whole struct */
    uint64_t checksum;         /* in serialized states */
} SavedHeader;

static void write_header(SavedHeader *h, const char magic[MAGIC_SIZE], const char guid[GUID_SIZE], size_t size)
{
    memcpy(h->magic, magic, MAGIC_SIZE);
    memcpy(h->guid, guid, GUID_SIZE);
    h->byte_order = 0x01020304;
    h->size = (uint32_t)size;
    h->checksum = 0;
}

/* Return why the state does not belong to this FMU, or NULL. */
static const char *fault_of_header(const SavedHeader *h, const char magic[MAGIC_SIZE], const char guid[GUID_SIZE],
                                   size_t size)
{
    if (memcmp(h->magic, magic, MAGIC_SIZE) != 0)
        return "it is not a state of this kind of FMU";
    if (h->byte_order != 0x01020304)
        return "it was written on a machine with another byte order";
    if (memcmp(h->guid, guid, GUID_SIZE) != 0 || h->size != size)
        return "it belongs to another FMU or version";
    return NULL;
}

static const char *const OTHER_KIND = "it was saved in the other kind of FMU, co-simulation or model exchange";

/* FNV-1a, 64 bit. */
static uint64_t mix(uint64_t hash, const void *data, size_t size)
{
    const unsigned char *byte = (const unsigned char *)data;
    for (size_t i = 0; i < size; i++)
        hash = (hash ^ byte[i]) * UINT64_C(1099511628211);
    return hash;
}

static uint64_t checksum_of_bytes(const void *bytes, size_t size)
{
    return mix(UINT64_C(14695981039346656037), bytes, size);
}

#endif
