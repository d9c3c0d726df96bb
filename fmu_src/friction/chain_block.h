/* Shared end of the blocks Frenkel-Kontorova and Frenkel-Kontorova-Tomlinson: initialisation, steps and outputs of the
   chain. Included after block.h by a block with the rows N, periodic, winding, amplitude, mode, acceleration, energy,
   ratio and atom, which defines the external forces on the chain by `around`. */

#ifndef CHAIN_BLOCK_H
#define CHAIN_BLOCK_H

static struct surroundings around(const Model *m);

static bool is_chain(const Model *m)
{
    const struct chain *const c = &m->memory;
    const size_t n = (size_t)m->N;
    return is_flag(&c->ready) && isfinite(c->time) && isfinite(c->turns) && all_finite(c->place, n) &&
           all_finite(c->y, 2 * n);
}

static void lay(const Model *m, struct chain *c)
{
    GIVEN(m)
    lay_chain(c, N, periodic != 0, winding, amplitude, mode);
    c->ready = false;
}

/* Return the current outputs of the chain, and write those that all chains have. */
static struct view see(Model *m)
{
    GIVEN(m)
    const struct surroundings at = around(m);
    struct chain start;
    if (!m->memory.ready)
        lay(m, &start);
    const struct chain *const chain = m->memory.ready ? &m->memory : &start;
    const struct view seen = view_chain(chain, &at, m->time);

    m->acceleration = seen.a;
    m->energy = seen.energy;
    m->ratio = spacing(N, periodic != 0, winding);
    for (int j = 0; j < 10; j++)
        m->atom[j] = j < N ? chain->turns + chain->y[j] + j * m->ratio : 0.0;
    return seen;
}

static bool move(Model *m, double h)
{
    if (!m->memory.ready)
        lay(m, &m->memory);
    struct surroundings at = around(m);
    double left = 2.5 * MOST_WORK; /* forces on an atom, 13 ns each */
    if (move_chain(&m->memory, &at, m->time, h, m->run.tolerance, &m->run.inner_step, &left))
        return true;
    return left < 0.0 ? too_much(m) : false;
}

#endif
