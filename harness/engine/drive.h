/* Run one FMU with sampled inputs: set the inputs, step, read the outputs, for each sample. */

#ifndef DRIVE_H
#define DRIVE_H

#include "floats.h"
#include "part.h"

typedef struct {
    void *component;
    Exchange *set, *get;
    DoStep *do_step;
    SetSlopes *set_slopes; /* NULL: inputs are held during a step */
    const uint32_t *input_references, *output_references;
    const int *orders; /* 1, 1, ...: order of the input derivatives */
    int64_t input_count, output_count;
    double *inputs;  /* row k applies from sample k on */
    double *slopes;  /* row k applies from sample k on */
    double *outputs; /* row k at sample k */
    double start, step;
    int64_t failed_operation, status;
} Drive;

MIRRORED(Drive)

EXPORT int64_t engine_drive(Drive *d, int64_t samples);

static bool stopped(Drive *d, int operation, int status)
{
    d->failed_operation = operation;
    d->status = status;
    return status > 1;
}

static int64_t drive(Drive *d, int64_t samples)
{
    const size_t n = (size_t)d->input_count, outputs = (size_t)d->output_count;
    for (int64_t k = 0; k < samples; k++) {
        const int64_t row = k * d->input_count;
        if (n > 0 && stopped(d, SET, d->set(d->component, d->input_references, n, d->inputs + row)))
            return k;
        if (k == 0 && stopped(d, GET, d->get(d->component, d->output_references, outputs, d->outputs)))
            return k;
        if (k + 1 == samples)
            break;
        if (d->set_slopes &&
            stopped(d, SLOPES, d->set_slopes(d->component, d->input_references, n, d->orders, d->slopes + row)))
            return k;
        if (stopped(d, STEP, d->do_step(d->component, d->start + (double)k * d->step, d->step, 1)))
            return k;
        double *const next = d->outputs + (k + 1) * d->output_count;
        if (stopped(d, GET, d->get(d->component, d->output_references, outputs, next)))
            return k;
    }
    return samples;
}

/* Run from sample 0 to samples - 1. Return the sample at which the FMU failed, or `samples` if it did not fail. The
   floating-point control is restored at the end. */
EXPORT int64_t engine_drive(Drive *d, int64_t samples)
{
    const uint32_t control = float_control();
    const int64_t done = drive(d, samples);
    if (float_control() != control)
        set_float_control(control);
    return done;
}

#endif
