/* The calls of a communication step that the engine makes to a block of this project in place of those of FMI. The
   caller knows the variables and the time, and has a copy of the state where it goes on after a failure. */

#ifndef DIRECT_H
#define DIRECT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { DIRECT_VERSION = 2, NOT_DIRECT = -1 }; /* status: the call of FMI has to be made, which says what is wrong */

/* What a part exchanges: value references of its Real and Boolean inputs and of its Real, Integer and Boolean outputs,
   and where their values are in the signals of engine.h. */
typedef struct {
    const uint32_t *input_references, *output_references;
    const int64_t *sources;  /* signals that drive the inputs */
    int64_t inputs, outputs; /* the first signals */
    int64_t reals, flags, out_reals, out_counts, out_flags;
} Ports;

typedef struct {
    int version;
    int (*set)(void *component, const Ports *ports, const double *signals);
    int (*step)(void *component, double t, double h);
    /* Set, give all Real inputs slopes, and step. */
    int (*move)(void *component, const Ports *ports, const double *signals, const double *slopes, double t, double h);
    int (*get)(void *component, const Ports *ports, double *signals);
    /* Set, step and get without a check: it follows, with what `turn` has returned. */
    bool (*turn)(void *component, const Ports *ports, double *signals, double t, double h);
    int (*verify)(void *component, const Ports *ports, const double *signals, double t, double h, bool done);
    void (*save)(const void *component, void *state); /* to a state that its fmi2GetFMUstate has made */
    void (*restore)(void *component, const void *state);
    void *(*place)(void *component, int64_t *size,
                   int64_t *fixed); /* the values; the first `fixed` bytes are parameters */
} Direct;

typedef const Direct *DirectCalls(void); /* of the function blockDirect */

#endif
