/* Steps of GMS.c: exact at constant velocity, by quadrature over a ramp of the velocity. Included at its end. */

#ifndef GMS_RAMP_H
#define GMS_RAMP_H

#include "attraction.h"

/* Step with constant v: the level is constant, so an element that reaches it stays there. */
static void held_step(Model *m, double h, double S, double unit)
{
    GIVEN(m)
    const double direction = sign(v), x = fabs(v) * h;
    double decay = NAN, strength = NAN; /* decay of the distance to the level in the step, for this attraction */
    for (int i = 0; i < N; i++) {
        const double level = alpha[i] * unit * S, force = direction * Fi[i];
        if (m->memory.slips[i] != 0.0 || force >= level) {
            m->memory.slips[i] = direction;
            if (attraction_of(m, i) != strength) { /* usually the same for all elements */
                strength = attraction_of(m, i);
                decay = exp(-strength * h / S);
            }
            m->Fi[i] = direction * (level + (force - level) * decay);
        } else if (force + k[i] * x < level) {
            m->Fi[i] = Fi[i] + k[i] * v * h;
        } else {
            m->memory.slips[i] = direction;
            m->Fi[i] = direction * level;
        }
    }
}

static double level_at(const Model *m, double s)
{
    GIVEN(m)
    return stribeck(v + SLOPE(v) * s, Fc, Fs, vs, delta);
}

/* Return the first time in (0, h) at which a stuck element reaches its level, or h if it does not; *reached is the
   force there. The force only increases and S is monotonic, so the values at the ends of an interval can exclude a
   crossing. */
static double arrival(const Model *m, double force, double stiffness, double level, double h, double *reached)
{
    double a = 0.0, S_a = level_at(m, 0.0), force_a = force, width = h;
    for (int tries = 0; a < h; tries++) {
        const double b = a + 1.000001 * width >= h ? h : a + width;
        const double S_b = level_at(m, b), force_b = force + stiffness * fabs(slide(m, b));
        if (force_b < level * fmin(S_a, S_b)) {
            a = b;
            S_a = S_b;
            force_a = force_b;
            width *= 2.0;
        } else if (b - a <= 4.0 * DBL_EPSILON * b || tries > 1000) {
            *reached = clip(level * S_b, force_a, force_b); /* one of them may jump */
            return b;
        } else {
            width = (b - a) / 2.0;
        }
    }
    return h;
}

/* Compute slip from time s to h, which is linear in the force: the result is E force + P level. */
static bool slip(const Model *m, double s, double h, double strength, double *E, double *P)
{
    GIVEN(m)
    const Attraction slips = {strength, false, Fc, Fs, vs, delta, quadrature_tolerance(m)};
    const double growth = sign(slide(m, h)) * SLOPE(v);
    double softest = INF; /* sigma times the speed of the elements also contributes to F */
    for (int i = 0; i < N; i++)
        softest = k[i] > 0.0 ? fmin(softest, k[i]) : softest;
    const double sensitivity = 1.0 + sigma * strength / (softest * level_at(m, h));
    return attract(&slips, fabs(v + SLOPE(v) * s), growth, h - s, fmax(Fc, Fs), sensitivity, E, P);
}

static bool ramp_step(Model *m, double h, double direction, double unit)
{
    GIVEN(m)
    double E = NAN, P = NAN, known = NAN; /* for slip over the whole step, with the attraction `known` */
    for (int i = 0; i < N; i++) {
        const double level = alpha[i] * unit, force = direction * Fi[i], strength = attraction_of(m, i);
        if (m->memory.slips[i] != 0.0 || force >= level * level_at(m, 0.0)) {
            m->memory.slips[i] = direction;
            if (strength != known && !slip(m, 0.0, h, strength, &E, &P))
                return false;
            known = strength;
            m->Fi[i] = direction * (E * force + P * level);
            continue;
        }
        double reached = 0.0, E_rest, P_rest;
        const double start = arrival(m, force, k[i], level, h, &reached);
        if (start < h) {
            m->memory.slips[i] = direction;
            if (!slip(m, start, h, strength, &E_rest, &P_rest))
                return false;
            m->Fi[i] = direction * (E_rest * reached + P_rest * level);
        } else {
            m->Fi[i] = Fi[i] + direction * k[i] * fabs(slide(m, h));
        }
    }
    return true;
}

static bool step(Model *m, double h)
{
    GIVEN(m)
    const double direction = sign(slide(m, h)), unit = share(m);
    for (int i = 0; i < 10; i++) /* from another motion */
        m->memory.slips[i] = m->memory.slips[i] == direction ? direction : 0.0;
    if (SLOPE(v) != 0.0)
        return direction == 0.0 || ramp_step(m, h, direction, unit);
    const double S = stribeck(v, Fc, Fs, vs, delta);
    if (direction != 0.0)
        held_step(m, h, S, unit);
    contact(m, S, unit);
    m->run.outputs_done = true;
    return true;
}

#endif
