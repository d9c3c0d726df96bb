/* What the fuzz targets share: the block or composite itself (BLOCK is its C file), input bytes that become choices and
   numbers, and the ways to fail. */

#ifndef FUZZ_H
#define FUZZ_H

#include BLOCK

#include <float.h>

#ifndef INSIDE /* facade.c defines it */
#define INSIDE(c) (c)
#endif

#define HOLDS(condition, text)                                                                                         \
    do {                                                                                                               \
        if (!(condition)) {                                                                                            \
            fprintf(stderr, "%s: %s\n", QUOTE(MODEL), text);                                                           \
            abort();                                                                                                   \
        }                                                                                                              \
    } while (0)

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t count);

typedef struct {
    const uint8_t *at, *end;
} Fuzz;

static inline unsigned fuzz_choice(Fuzz *in, unsigned count) { return in->at < in->end ? *in->at++ % count : 0; }

/* A finite number of any size, one at the edge, or none. */
static inline double fuzz_number(Fuzz *in)
{
    static const double special[] = {0.0,   -0.0,   1.0,     -1.0,     1e-3,     -1e-3,     1e-9,
                                     1e9,   5e-324, 1e-308,  -1e308,   1e308,    1e154,     1e-154,
                                     1e-12, 0.5,    DBL_MAX, -DBL_MAX, HUGE_VAL, -HUGE_VAL, (double)NAN};
    enum { FUZZ_SPECIAL = sizeof special / sizeof special[0] };
    const unsigned kind = fuzz_choice(in, 2 * FUZZ_SPECIAL);
    double value = 0.0;
    if (kind < FUZZ_SPECIAL)
        return special[kind];
    if (kind == FUZZ_SPECIAL && (size_t)(in->end - in->at) >= sizeof value) {
        memcpy(&value, in->at, sizeof value);
        in->at += sizeof value;
        return value;
    }
    const double share = ((double)fuzz_choice(in, 256) - 127.5) / 127.5;
    return ldexp(share, (int)fuzz_choice(in, 40) - 20);
}

static void fuzz_message(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                         fmi2String message, ...)
{
    (void)environment;
    HOLDS(name && category && message, "a message is a null pointer");
    HOLDS(status == fmi2Warning || status == fmi2Discard || status == fmi2Error, "a message has a wrong status");
}

static Instance *fuzz_instance(fmi2Type kind)
{
    static const fmi2CallbackFunctions callbacks = {.logger = fuzz_message};
#ifdef COMPOSITE
    const char *const guid = GUID;
#else
    char guid[GUID_LENGTH + 2];
    write_guid(guid);
#endif
    Instance *const made = (Instance *)fmi2Instantiate("fuzz", kind, guid, "file:///resources", &callbacks, 0, 1);
    HOLDS(made, "fmi2Instantiate gives no instance");
    return made;
}

#ifdef NO_EXCHANGE
#define FUZZ_KINDS fmi2CoSimulation
#else
#define FUZZ_KINDS fmi2CoSimulation, fmi2ModelExchange
#endif

/* the kinds of FMU that the block can be */
static const fmi2Type fuzz_kinds[] = {FUZZ_KINDS};
enum { FUZZ_KIND_COUNT = sizeof fuzz_kinds / sizeof fuzz_kinds[0] };

#endif
