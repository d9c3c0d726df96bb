/* The beginning of every saved state: which FMU wrote it, and a checksum. */

#ifndef FMI2_SAVED_H
#define FMI2_SAVED_H

#include "fmi2_hash.h"

#include <string.h>

typedef struct {
    char magic[8]; /* up to 7 characters, then zeros */
    char guid[40];
    uint32_t byte_order, size; /* size of the whole struct */
    uint64_t checksum;         /* in serialized states */
} SavedHeader;

static void write_header(SavedHeader *h, const char *magic, const char *guid, size_t size)
{
    memset(h, 0, sizeof *h);
    strncpy(h->magic, magic, sizeof h->magic - 1);
    strncpy(h->guid, guid, sizeof h->guid - 1);
    h->byte_order = 0x01020304;
    h->size = (uint32_t)size;
}

/* Return why the state does not belong to this FMU, or NULL. */
static const char *fault_of_header(const SavedHeader *h, const char *magic, const char *guid, size_t size)
{
    SavedHeader own;
    write_header(&own, magic, guid, size);
    if (memcmp(h->magic, own.magic, sizeof own.magic) != 0)
        return "it is not a state of this kind of FMU";
    if (h->byte_order != own.byte_order)
        return "it was written on a machine with another byte order";
    if (memcmp(h->guid, own.guid, sizeof own.guid) != 0 || h->size != own.size)
        return "it belongs to another FMU or version";
    return NULL;
}

static const char *const OTHER_KIND = "it was saved in the other kind of FMU, co-simulation or model exchange";

static uint64_t checksum_of_bytes(const void *bytes, size_t size)
{
    return mix(UINT64_C(14695981039346656037), bytes, size);
}

#endif
