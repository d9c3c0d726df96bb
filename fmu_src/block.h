/* A block: one table of variables, expanded for several purposes.

   A model file defines MODEL, SUMMARY, SOURCE and the table VARIABLES, includes this header, and defines `equations`
   (continuous blocks) or `sample` (blocks that define SAMPLED). Everything else is derived.

       #define VARIABLES                                                                     \
           INPUT    (v,      VELOCITY,  0.0,                 "relative sliding velocity")    \
           OUTPUT   (F,      FORCE,                          "friction force, opposes v")    \
           STATE    (z,      LENGTH,    0.0, 1e-5,           "mean bristle deflection")      \
           PARAMETER(sigma0, STIFFNESS, 1e5, 0.0, INF,       "bristle stiffness")

   A block may also define
     MEMORY     a struct without pointers, accessed as m->memory, part of the FMU state
     CACHE      a struct without pointers, accessed as m->cache, for values that follow from those that are stored with
                them. It begins with zeros, is no part of the FMU state, and steps of other states may have filled it
     KEEPS_BY   the name of `static void f(Memory *to, const Memory *from, const Model *m, bool follows)`, for a large
                MEMORY of which a small part is in use: it copies this part before a step and, if the step fails, back;
                if `follows` is true, `to` is the memory of an earlier step of the same run
     VALID_BY   the name of `static bool f(const Model *m)`, required for a block with MEMORY: returns whether a run can
                produce m->memory. It checks everything that the block uses as an index, a count or a loop limit, as a
                serialised state may be forged; a state is rejected if the result is false. Parameters are then within
                their limits
     STEPS_BY   the name of an exact step `static bool f(Model *m, double h)` in place of `integrate`; if it also
                computes the outputs at the end of the step, it sets m->run.outputs_done = true
     WARNING    the text of a warning, which is logged once after m->run.warning = true
     SAMPLED    `sample(Model *m)` is called at start + k Ts; the table must contain FIXED(Ts, ...)
     GUARDED    for a SAMPLED block whose table begins with its inputs and contains OUTPUT_FLAG(fault, ...): inputs may
                be NaN or infinite; `fault` is then true and `sample` is not called, so outputs and states are held
     SKIPS_BY   for a GUARDED block, the name of `static void f(Model *m)`, called in place of `sample` in this case,
                for parts of m->memory that advance with time; it reads no Real input and writes no output, but for a
                disabled block, which it sets to rest
     DECIDES_BY the name of `static void f(Model *m)`, for model exchange: it writes to m->memory what is decided at an
                event. While m->run.frozen, `equations` follows m->memory instead of deciding by itself
     EVENTS     the number of decisions that end at events. The block then defines `static void indicators(const Model
                *m, double *left)`: each value is positive until its decision ends
     REINITIALISES the continuous states that DECIDES_BY changes, as text separated by commas
     NO_EXCHANGE the reason why a continuous block cannot be used for model exchange, as text
     REQUIRES   the name of `static const char *f(const Model *m)`: returns the violated relation of parameters as
                text, or NULL; a block with a violated relation is neither initialised nor stepped   */

#ifndef BLOCK_H
#define BLOCK_H

#include <stddef.h>
#include <stdint.h>

#include "constants.h"
#include "effort.h"

/* before a loop with a constant number of passes, in a law: fast without branches of the loop */
#if defined __clang__
#define UNROLLED _Pragma("clang loop unroll(full)")
#elif defined __GNUC__ && __GNUC__ >= 8
#define UNROLLED _Pragma("GCC unroll 64")
#else
#define UNROLLED
#endif

#define COUNTS 2147483647.0 /* the largest fmi2Integer */

/* clang-format off */

/* Units by quantity, so that a translational block is also its rotational twin. */
#ifdef ROTATIONAL
#define LENGTH       "rad"
#define VELOCITY     "rad/s"
#define ACCELERATION "rad/s2"
#define JERK         "rad/s3"
#define FORCE        "N.m"
#define MASS         "kg.m2"
#define STIFFNESS    "N.m/rad"
#define DAMPING      "N.m.s/rad"
#define PER_FORCE    "1/(N.m)"
#define PER_AMPERE   "N.m/A"
#define FORCE_NOUN   "torque"
#define MASS_NOUN    "inertia"
#define MOVING_MASS  "moment of inertia"
#else
#define LENGTH       "m"
#define VELOCITY     "m/s"
#define ACCELERATION "m/s2"
#define JERK         "m/s3"
#define FORCE        "N"
#define MASS         "kg"
#define STIFFNESS    "N/m"
#define DAMPING      "N.s/m"
#define PER_FORCE    "1/N"
#define PER_AMPERE   "N/A"
#define FORCE_NOUN   "force"
#define MASS_NOUN    "mass"
#define MOVING_MASS  "moving mass"
#endif
#define TIME      "s"
#define FREQUENCY "Hz"
#define ANGLE     "rad"
#define NO_UNIT   ""

/* Role of a row in the table; the packager reads these names (macros.py). */
enum role { ROLE_TIME, ROLE_INPUT, ROLE_OUTPUT, ROLE_LOCAL, ROLE_PARAMETER, ROLE_FIXED, ROLE_STATE, ROLE_STATE_OUTPUT, ROLE_DERIVATIVE };
enum type { TYPE_REAL, TYPE_INTEGER, TYPE_BOOLEAN };

/* The kinds of rows, in terms of four shapes that the expansions below define: SCALAR, VECTOR, DYNAMIC (a state and, in
   continuous blocks, its derivative) and DYNAMICS (a vector of them). An OPTIONAL input may stay unconnected: its
   description begins with this word, for the harness and for readers. */
#define INPUT(name, unit, start, text)                    SCALAR(name, ROLE_INPUT, TYPE_REAL, unit, start, -INF, INF, text)
#define OPTIONAL(name, unit, start, text)                 INPUT(name, unit, start, "optional: " text)
#define COMMAND(name, start, text)                        SCALAR(name, ROLE_INPUT, TYPE_BOOLEAN, "", start, 0.0, 1.0, "optional: " text)
#define OUTPUT(name, unit, text)                          SCALAR(name, ROLE_OUTPUT, TYPE_REAL, unit, 0.0, -INF, INF, text)
#define OUTPUT_FLAG(name, text)                           SCALAR(name, ROLE_OUTPUT, TYPE_BOOLEAN, "", 0.0, 0.0, 1.0, text)
#define LOCAL(name, unit, text)                           SCALAR(name, ROLE_LOCAL, TYPE_REAL, unit, 0.0, -INF, INF, text)
#define LOCALS(name, n, unit, text)                       VECTOR(name, n, ROLE_LOCAL, TYPE_REAL, unit, (0.0), -INF, INF, text)
#define FLAG(name, text)                                  SCALAR(name, ROLE_LOCAL, TYPE_BOOLEAN, "", 0.0, 0.0, 1.0, text)
#define FLAGS(name, n, text)                              VECTOR(name, n, ROLE_LOCAL, TYPE_BOOLEAN, "", (0.0), 0.0, 1.0, text)
#define TALLY(name, text)                                 SCALAR(name, ROLE_LOCAL, TYPE_INTEGER, "", 0.0, -COUNTS, COUNTS, text)
#define PARAMETER(name, unit, start, min, max, text)      SCALAR(name, ROLE_PARAMETER, TYPE_REAL, unit, start, min, max, text)
#define PARAMETERS(name, n, unit, starts, min, max, text) VECTOR(name, n, ROLE_PARAMETER, TYPE_REAL, unit, starts, min, max, text)
#define SWITCH(name, start, text)                         SCALAR(name, ROLE_PARAMETER, TYPE_BOOLEAN, "", start, 0.0, 1.0, text)
#define FIXED(name, unit, start, min, max, text)          SCALAR(name, ROLE_FIXED, TYPE_REAL, unit, start, min, max, text)
#define COUNT(name, start, min, max, text)                SCALAR(name, ROLE_FIXED, TYPE_INTEGER, "", start, min, max, text)
#define STATE(name, unit, start, nominal, text)           DYNAMIC(name, ROLE_STATE, unit, start, name, nominal, text)
#define STATES(name, n, unit, starts, nominal, text)      DYNAMICS(name, n, unit, starts, nominal, text)
#define STATE_OUTPUT(name, unit, from, nominal, text)     DYNAMIC(name, ROLE_STATE_OUTPUT, unit, NAN, from, nominal, text)

/* Position in the simulation; part of the FMU state, so that a restored state carries the mode. */
typedef struct {
    double inner_step;             /* [s] last accepted step of the inner solver, initially 0 */
    double last_step;              /* [s] last communication step */
    int64_t tick;                  /* number of samples taken by a sampled block */
    int mode;                      /* mode of the call-sequence table */
    int exchange;                  /* 1: for model exchange, 0: for co-simulation */
    bool stale;                    /* a value was set after the outputs were computed */
    bool slopes_used;              /* the input derivatives belong to the completed step */
    bool sloped;                   /* an input derivative may not be zero */
    bool outputs_done;             /* the step has also computed the outputs */
    bool warning, warned;          /* the block's WARNING is due; it has been logged */
    bool too_much;                 /* the failed step would exceed the limit of work */
    bool frozen;                   /* in model exchange: what the block decides at events is in `memory` */
    double rest;                   /* [s] in co-simulation: time to the next sample, counted by the lengths of steps;
                                      what follows is last, as no step changes it before it has succeeded */
    double start, stop, tolerance; /* [s], [s], relative; stop = INF and tolerance = 0 if not given */
    double drift;                  /* [s] bound of the rounding in the times of an importer that sums its steps */
} Run;

#ifdef MEMORY
typedef MEMORY Memory;
#else
typedef struct { char none; } Memory;
#endif
#ifdef CACHE
typedef CACHE Cache;
#else
typedef struct { double none; } Cache;
#endif

/* A sampled block has states without derivatives, so RATE(...) is empty. */
#ifdef SAMPLED
#define RATE(...)
#else
#define RATE(...) __VA_ARGS__
#endif

/* Inputs by number: enum { INPUT_v, ..., INPUTS } */
#define SCALAR(name, role, type, unit, start, min, max, text)     NUMBER_##role(name)
#define VECTOR(name, n, role, type, unit, starts, min, max, text)
#define DYNAMIC(name, role, unit, start, from, nominal, text)
#define DYNAMICS(name, n, unit, starts, nominal, text)
#define NUMBER_ROLE_INPUT(name) INPUT_##name,
#define NUMBER_ROLE_OUTPUT(name)
#define NUMBER_ROLE_LOCAL(name)
#define NUMBER_ROLE_PARAMETER(name)
#define NUMBER_ROLE_FIXED(name)
enum { VARIABLES INPUTS };
#undef SCALAR
#undef VECTOR
#undef DYNAMIC
#undef DYNAMICS

/* The parameters: double sigma0; double k[10]; ... */
#define SCALAR(name, role, type, unit, start, min, max, text)     PARAMETER_OF_##role(double name;)
#define VECTOR(name, n, role, type, unit, starts, min, max, text) PARAMETER_OF_##role(double name[n];)
#define DYNAMIC(name, role, unit, start, from, nominal, text)
#define DYNAMICS(name, n, unit, starts, nominal, text)
#define PARAMETER_OF_ROLE_INPUT(field)
#define PARAMETER_OF_ROLE_OUTPUT(field)
#define PARAMETER_OF_ROLE_LOCAL(field)
#define PARAMETER_OF_ROLE_PARAMETER(field) field
#define PARAMETER_OF_ROLE_FIXED(field)     field
/* The values that a step may change (double v; double F; double z; double der_z; ...) follow them, so that they are
   contiguous. A value reference is the index of a double, counted from the start of the struct. */
typedef struct {
    VARIABLES
#undef SCALAR
#undef VECTOR
#undef DYNAMIC
#undef DYNAMICS
#define SCALAR(name, role, type, unit, start, min, max, text)     VARYING_OF_##role(double name;)
#define VECTOR(name, n, role, type, unit, starts, min, max, text) VARYING_OF_##role(double name[n];)
#define DYNAMIC(name, role, unit, start, from, nominal, text)     double name; RATE(double der_##name;)
#define DYNAMICS(name, n, unit, starts, nominal, text)            double name[n]; RATE(double der_##name[n];)
#define VARYING_OF_ROLE_INPUT(field)  field
#define VARYING_OF_ROLE_OUTPUT(field) field
#define VARYING_OF_ROLE_LOCAL(field)  field
#define VARYING_OF_ROLE_PARAMETER(field)
#define VARYING_OF_ROLE_FIXED(field)
    double time;
    VARIABLES
    double slope[INPUTS + 1]; /* time derivatives of the inputs, 0 for held inputs */
    Run run;
    Memory memory;
    Cache cache;
} Model;
#undef SCALAR
#undef VECTOR
#undef DYNAMIC
#undef DYNAMICS

#define VALUES      (offsetof(Model, slope) / sizeof(double))
#define AT(name)    (offsetof(Model, name) / sizeof(double))
#define SLOPE(name) (m->slope[INPUT_##name])

/* The table as data: { "v", "m/s", "relative sliding velocity", ... } */
typedef struct {
    const char *name, *unit, *text;
    double start, min, max, nominal;
    const double *starts;   /* start values of a vector */
    uint32_t index, length; /* value reference of the first element, number of elements (0: a scalar) */
    uint32_t from;          /* derivative: its state; state: source of its initial value */
    int32_t role, type;
} Row;

#define UNWRAP(...) __VA_ARGS__

/* static const double starts_of_k[10] = { 5e4, 3e4 }; */
#define SCALAR(name, role, type, unit, start, min, max, text)
#define VECTOR(name, n, role, type, unit, starts, min, max, text) static const double starts_of_##name[n] = {UNWRAP starts};
#define DYNAMIC(name, role, unit, start, from, nominal, text)
#define DYNAMICS(name, n, unit, starts, nominal, text)            static const double starts_of_##name[n] = {UNWRAP starts};
VARIABLES
#undef SCALAR
#undef VECTOR
#undef DYNAMIC
#undef DYNAMICS

#define SCALAR(name, role, type, unit, start, min, max, text) \
    {#name, unit, text, start, min, max, 1.0, NULL, AT(name), 0, AT(name), role, type},
#define VECTOR(name, n, role, type, unit, starts, min, max, text) \
    {#name, unit, text, NAN, min, max, 1.0, starts_of_##name, AT(name), n, AT(name), role, type},
#define RATE_ROW(name, n, unit, nominal, text) \
    {"der(" #name ")", unit, text, 0.0, -INF, INF, nominal, NULL, AT(der_##name), n, AT(name), ROLE_DERIVATIVE, TYPE_REAL},
#define DYNAMIC(name, role, unit, start, from, nominal, text) \
    {#name, unit, text, start, -INF, INF, nominal, NULL, AT(name), 0, AT(from), role, TYPE_REAL}, \
    RATE(RATE_ROW(name, 0, unit, nominal, text))
#define DYNAMICS(name, n, unit, starts, nominal, text) \
    {#name, unit, text, NAN, -INF, INF, nominal, starts_of_##name, AT(name), n, AT(name), ROLE_STATE, TYPE_REAL}, \
    RATE(RATE_ROW(name, n, unit, nominal, text))
static const Row rows[] = {
    {"time", TIME, "simulation time", 0.0, -INF, INF, 1.0, NULL, AT(time), 0, AT(time), ROLE_TIME, TYPE_REAL}, VARIABLES};
#undef SCALAR
#undef VECTOR
#undef DYNAMIC
#undef DYNAMICS

#define ROWS (sizeof rows / sizeof rows[0])

/* The continuous states: positions of the values and derivatives of each row; one spare element, as C has no empty
   arrays. */
typedef struct {
    uint32_t index, derivative, count;
    double nominal;
} StateRow;
#define SCALAR(name, role, type, unit, start, min, max, text)
#define VECTOR(name, n, role, type, unit, starts, min, max, text)
#define DYNAMIC(name, role, unit, start, from, nominal, text)     RATE({AT(name), AT(der_##name), 1, nominal},)
#define DYNAMICS(name, n, unit, starts, nominal, text)            RATE({AT(name), AT(der_##name), n, nominal},)
static const StateRow state_rows[] = {VARIABLES{0, 0, 0, 1.0}};
#undef DYNAMIC
#undef DYNAMICS
#define DYNAMIC(name, role, unit, start, from, nominal, text)     RATE(+1)
#define DYNAMICS(name, n, unit, starts, nominal, text)            RATE(+n)
enum { STATE_ROWS = (int)(sizeof state_rows / sizeof state_rows[0]) - 1, ALL_STATES = 0 VARIABLES };
#undef SCALAR
#undef VECTOR
#undef DYNAMIC
#undef DYNAMICS

/* Indices of the inputs, in the order of `slope`. */
#define SCALAR(name, role, type, unit, start, min, max, text)     PLACE_##role(name)
#define VECTOR(name, n, role, type, unit, starts, min, max, text)
#define DYNAMIC(name, role, unit, start, from, nominal, text)
#define DYNAMICS(name, n, unit, starts, nominal, text)
#define PLACE_ROLE_INPUT(name) AT(name),
#define PLACE_ROLE_OUTPUT(name)
#define PLACE_ROLE_LOCAL(name)
#define PLACE_ROLE_PARAMETER(name)
#define PLACE_ROLE_FIXED(name)
static const uint32_t inputs[] = {VARIABLES 0};
#undef SCALAR
#undef VECTOR
#undef DYNAMIC
#undef DYNAMICS

/* GIVEN(m): const double v = m->v; const double *k = m->k; ... makes the equations readable. Outputs are excluded; each
   is written once. */
#define SCALAR(name, role, type, unit, start, min, max, text)     GIVEN_##role(name, type)
#define VECTOR(name, n, role, type, unit, starts, min, max, text) GIVEN_VECTOR_##role(name)
#define DYNAMIC(name, role, unit, start, from, nominal, text)     GIVEN_TYPE_REAL(name)
#define DYNAMICS(name, n, unit, starts, nominal, text)            GIVEN_VECTOR_ROLE_PARAMETER(name)
#define GIVEN_ROLE_INPUT(name, type)      GIVEN_##type(name)
#define GIVEN_ROLE_OUTPUT(name, type)
#define GIVEN_ROLE_LOCAL(name, type)
#define GIVEN_ROLE_PARAMETER(name, type)  GIVEN_##type(name)
#define GIVEN_ROLE_FIXED(name, type)      GIVEN_##type(name)
#define GIVEN_TYPE_REAL(name)             const double name = given->name; (void)name;
#define GIVEN_TYPE_INTEGER(name)          const int name = (int)given->name; (void)name;
#define GIVEN_TYPE_BOOLEAN(name)          const bool name = given->name != 0.0; (void)name;
#define GIVEN_VECTOR_ROLE_PARAMETER(name) const double *const name = given->name; (void)name;
#define GIVEN_VECTOR_ROLE_LOCAL(name)
#define GIVEN(m) const Model *const given = (m); VARIABLES
/* clang-format on */

static inline double square(double a) { return a * a; }
static inline double sign(double a) { return (double)((a > 0.0) - (a < 0.0)); }
static inline double clip(double a, double low, double high) { return a < low ? low : a > high ? high : a; }

/* Helper for VALID_BY. */
static inline bool is_flag(const bool *flag) { return *(const unsigned char *)flag <= 1; }
static inline bool is_direction(double a) { return a == -1.0 || a == 0.0 || a == 1.0; }
static inline bool is_count(double a, double most) { return a >= 0.0 && a <= most && a == floor(a); }
static inline bool all_finite(const double *values, size_t count)
{
    for (size_t i = 0; i < count; i++)
        if (!isfinite(values[i]))
            return false;
    return true;
}

static inline double *value_of(Model *m, uint32_t index) { return (double *)(void *)m + index; }

/* Return value of a block's own step that would exceed the limit of work in effort.h. */
static inline bool too_much(Model *m)
{
    m->run.too_much = true;
    return false;
}

#ifdef SAMPLED
static void sample(Model *m);
#ifdef SKIPS_BY
static void SKIPS_BY(Model *m);
#endif
#else
static void equations(Model *m);
#endif

#include "solver.h"

#ifndef STEPS_BY
#define STEPS_BY integrate
#else
static bool STEPS_BY(Model *m, double h);
#endif

#ifdef REQUIRES
static const char *REQUIRES(const Model *m);
#endif

#ifdef VALID_BY
static bool VALID_BY(const Model *m);
#elif defined MEMORY
#error "a block with MEMORY must define VALID_BY: see the beginning of block.h"
#endif

#ifdef EVENTS
static void indicators(const Model *m, double *left);
#endif

#ifdef DECIDES_BY
static void DECIDES_BY(Model *m);
#endif

/* KEEPS_BY for a MEMORY that steps do not use, only decisions in model exchange. */
static inline void keep_decisions(Memory *to, const Memory *from, const Model *m, bool follows)
{
    (void)follows;
    if (m->run.exchange)
        *to = *from;
}

#ifdef KEEPS_BY
static void KEEPS_BY(Memory *to, const Memory *from, const Model *m, bool follows);
#endif

#include "fmi2.h"

#endif
