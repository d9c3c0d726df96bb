/* The turns of one part in a loop that is compiled for one system. The generated file defines PART_NUMBER (its number),
   PART_SOURCE (the source of its FMU), tables of its references and sources, and PART_PORTS, whose constants the
   compiler inserts. */

#define JOIN_(a, b)    a##b
#define JOIN(a, b)     JOIN_(a, b)
#define OF_PART(name)  JOIN(name, PART_NUMBER)
#define PREFIXED(name) JOIN(OF_PART(part_), name)

#undef FMI2_OVERRIDE_FUNCTION_PREFIX
#include "fmi2Functions.h"
#undef fmi2FullName
#define fmi2FullName(name) PREFIXED(_##name)
#include PART_SOURCE

static const Ports ports_of_part = PART_PORTS;

bool OF_PART(turn_)(void *component, double *signals, double t, double h);
int OF_PART(verify_)(void *component, const double *signals, double t, double h, bool done);
int64_t OF_PART(size_)(int64_t *fixed, char *guid);

bool OF_PART(turn_)(void *component, double *signals, double t, double h)
{
    return direct_turn(component, &ports_of_part, signals, t, h);
}

int OF_PART(verify_)(void *component, const double *signals, double t, double h, bool done)
{
    return direct_verify(component, &ports_of_part, signals, t, h, done);
}

/* Return the size of a state, of which the first `fixed` bytes are parameters, and the GUID of the sources. */
int64_t OF_PART(size_)(int64_t *fixed, char *guid)
{
    write_guid(guid);
    *fixed = VARYING;
    return STATE_SIZE;
}
