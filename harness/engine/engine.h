/* The communication-step loop over FMI 2.0 co-simulation parts: what Python lays out and C runs through.

   All values that cross between parts live in one vector of signals: outputs of all parts, then their wired inputs.
   Python's ctypes mirrors these structs (native.py); a pointer that is not used is NULL. */

#ifndef ENGINE_H
#define ENGINE_H

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#if defined _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum type { REAL, INTEGER, BOOLEAN, TYPES };
enum operation { SET, STEP, GET, SAVE, RESTORE, SLOPES };

typedef int Exchange(void *component, const uint32_t *references, size_t n, void *values);
typedef int DoStep(void *component, double t, double h, int keeps_no_state);
typedef int GetState(void *component, void **state);
typedef int SetState(void *component, void *state);
typedef int SetSlopes(void *component, const uint32_t *references, size_t n, const int *orders, const double *slopes);
typedef int Call(int operation, double t, double h);

typedef struct {
    Call *call; /* does the operations of a part in Python; else those of an FMU: */
    void *component;
    Exchange *set[TYPES], *get[TYPES];
    DoStep *do_step;
    GetState *get_state;
    SetState *set_state;
    SetSlopes *set_slopes;
    void *state; /* saved at the start of a step                                  */
    const uint32_t *input_references, *output_references;
    int64_t inputs[TYPES + 1];  /* signals that are its inputs, type by type: first, ..., one past the last */
    int64_t outputs[TYPES + 1]; /* likewise                                                                 */
    int *whole;                 /* place for the Integers and Booleans of a call                            */
    const int *orders;          /* 1, 1, ... for the slopes of the inputs                                   */
    double *slopes;             /* place for them                                                           */
    int64_t every, phase;       /* stepped at the ticks k with k % every == phase, over `every` ticks       */
} EnginePart;

/* How the value handed over by a wire compares with the one at the end of the step. */
typedef struct {
    int64_t input;  /* signal */
    double before;  /* defect of the last step                                                         */
    double flips;   /* sum of the defects that alternate in sign                                       */
    double squares; /* sum of the squares of the defects that last, the smaller of two steps          */
    double value, mean, values, value_squares; /* at the end of the last step, mean over it; sums of sizes, squares */
} Defect;

/* The power that leaves one part and enters another one over a force and a velocity between them. */
typedef struct {
    int64_t force, velocity; /* which defects */
    double made, passed;     /* [J] sum of the sizes of what the coupling makes, and of what has passed before
                                this window */
    double fed, net, flow;   /* [J] of this window: what the coupling makes and what passes, with their signs, and the
                                sum of the sizes of what passes */
    int64_t ticks, windows, unstable; /* in this window; windows so far, and those in which the coupling feeds */
} Pair;

typedef struct manipulator Manipulator;
typedef struct line Line;
typedef struct extrapolation Extrapolation;
typedef struct newton Newton;

typedef struct {
    EnginePart *parts;
    int64_t part_count;
    double *signals;
    const int64_t *sources;                  /* of an input, the output that drives it; of any other signal, itself */
    double *gains, *offsets;                 /* an input gets gain * output + offset; NULL: all wires are plain */
    const double *wire_gains, *wire_offsets; /* the same without manipulators */
    Manipulator *manipulators;
    int64_t manipulator_count;
    const int64_t *program; /* pairs (operation, part) that make a tick */
    int64_t program_length;
    double start, step;     /* [s] tick k is the step from start + k step */
    double *rows;           /* what is recorded */
    const int64_t *columns; /* signals that are */
    int64_t width, decimate, filled;
    Defect *defects;
    int64_t defect_count;
    Pair *pairs;
    int64_t pair_count;
    Line *lines;
    const int64_t *lines_from;    /* those of part p are lines_from[p], ..., lines_from[p + 1] - 1 */
    Extrapolation *extrapolation; /* NULL: values are held                                         */
    Newton *newton;               /* an implicit master, else NULL                                 */
    int64_t failed_part, failed_operation, status, float_change; /* of the run that ended */
    double failed_time;
} Engine;

#endif
