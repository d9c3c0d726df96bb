"""Multiple shooting: a long simulation is cut into arcs, whose initial states are unknown as well.

Simulated from measured states, each arc stays close to the measurement, so that the search converges where one
simulation over the whole record would leave it (H. Bock, K. Plitt, "A multiple shooting algorithm for direct solution
of optimal control problems", 9th IFAC World Congress, 1984). The conditions that the arcs continue each other are
linearised and eliminated (condensing); at the solution they hold, and the arcs are one simulation.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from friction_fmus.errors import FitError
from friction_fmus.identification.data.record import Array

ITERATIONS, SIZES = 60, (1.0, 0.5, 0.2)  # largest number of iterations, and fractions of a step to try
CLOSE = 0.01  # relative decrease of the cost below which the search ends
GAP = 0.3  # gap between arcs, over the rms error, below which they continue each other
DIFFERENCE = 0.03  # step of the finite differences, over the standard deviations of the prior

#: Change of a first state that counts as a standard deviation, over the step of its finite differences: at rest, the
#: motion does not depend on the first velocity, and an unlimited step would go astray.
FREE = 100.0


@dataclass(frozen=True, eq=False)
class Arc:
    """Piece of a record."""

    record: int  # index of the record
    begin: int
    end: int
    """First sample, and first sample of the next arc or last sample of the record."""
    measured: Array  # measured position


#: Function of parameters, arc and its initial state (position, velocity) that returns position and velocity at its
#: samples.
Simulate = Callable[[Array, Arc, Array], tuple[Array, Array]]


@dataclass(frozen=True, eq=False)
class Prior:
    """What is known of the parameters before the search."""

    mean: Array
    deviation: Array
    """Expected value and standard deviation."""
    lower: Array
    upper: Array
    """Bounds."""


@dataclass(frozen=True, eq=False)
class ShootingResult:
    """Result of multiple shooting."""

    x: Array  # parameters
    states: Array  # position and velocity at the beginning of each arc
    covariance: Array  # covariance of the parameters, from errors and prior
    converged: bool  # whether the search converged before the iteration limit, and the arcs continue each other


@dataclass(frozen=True, eq=False)
class _Run:
    """Errors of all arcs, and gaps between them (position, velocity)."""

    errors: Array
    gaps: Array


@dataclass(frozen=True, eq=False)
class _Linear:
    """Errors and first states of the arcs as affine functions of the first state of each record and the parameters."""

    J: Array
    shift: Array
    states: Array
    offset: Array


def shoot(
    simulate: Simulate, arcs: Sequence[Arc], states: Array, prior: Prior, independent: float, steps: Array
) -> ShootingResult:
    """Fit parameters and the states at the beginning of each arc to measured positions."""
    # Gauss-Newton iterations minimise N r'r / (n s^2) plus the squared distances from the prior in standard deviations,
    # for n samples of the error r, N of them independent, and its rms value s in the iteration before.
    x, p, converged = np.array(prior.mean), len(prior.mean), False
    run, linear = _linearise(simulate, arcs, x, states, prior, steps)
    for _ in range(ITERATIONS):
        weight = _weight(run, independent)
        free = np.tile(FREE * steps, linear.J.shape[1] // 2)[: linear.J.shape[1] - p]
        pull = np.diag(1.0 / np.concatenate([free, prior.deviation]))
        right = np.concatenate([weight * linear.shift, np.zeros(len(free)), (x - prior.mean) / prior.deviation])
        y = -np.linalg.lstsq(np.vstack([weight * linear.J, pull]), right, rcond=None)[0]
        change = linear.states @ y + linear.offset
        before = _merit(run, weight, x, prior)
        moved = None
        for size in SIZES:
            tried = np.clip(x + size * y[-p:], prior.lower, prior.upper), states + size * change
            after = _merit(_run(simulate, arcs, *tried), weight, tried[0], prior)
            if after < before:
                moved = tried
                break
        closed = not run.gaps.size or float(np.max(np.abs(run.gaps[:, 0]))) < GAP * _rms(run.errors)
        if closed and (moved is None or after > (1.0 - CLOSE) * before):
            converged = True
            break
        # where no step helps, the arcs are joined: the search goes on as single shooting
        x, states = (x, _joined(simulate, arcs, x, states)) if moved is None else moved
        run, linear = _linearise(simulate, arcs, x, states, prior, steps)
    J = _weight(run, independent) * linear.J
    information = J.T @ J
    information[-p:, -p:] += np.diag(prior.deviation**-2.0)
    covariance = np.asarray(np.linalg.pinv(information)[-p:, -p:], dtype=np.float64)
    return ShootingResult(x, states, covariance, converged)


def _rms(values: Array) -> float:
    return max(float(np.sqrt(np.mean(np.square(values)))), 1e-12)


def _weight(run: _Run, independent: float) -> float:
    """Return the factor that makes the sum of squared errors the number of independent samples."""
    return float(np.sqrt(independent / len(run.errors))) / _rms(run.errors)


def _merit(run: _Run, weight: float, x: Array, prior: Prior) -> float:
    """Return the cost of errors, parameters, and gaps in position."""
    gaps = len(run.errors) * float(np.sum(np.square(run.gaps[:, 0]))) if run.gaps.size else 0.0
    cost = weight**2 * (float(run.errors @ run.errors) + gaps)
    cost += float(np.sum(np.square((x - prior.mean) / prior.deviation)))
    return cost if np.isfinite(cost) else np.inf


def _run(simulate: Simulate, arcs: Sequence[Arc], x: Array, states: Array) -> _Run:
    runs = [simulate(x, arc, state) for arc, state in zip(arcs, states, strict=True)]
    ends = np.array([[q[-1], v[-1]] for q, v in runs])
    errors = [_own(q - arcs[k].measured, arcs, k) for k, (q, _) in enumerate(runs)]
    return _Run(np.concatenate(errors), _gaps(arcs, ends, states))


def _joined(simulate: Simulate, arcs: Sequence[Arc], x: Array, states: Array) -> Array:
    """Return first states of the arcs with which each begins where the one before it ends."""
    found = np.array(states)
    for k, arc in enumerate(arcs):
        if _continues(arcs, k):
            q, v = simulate(x, arc, found[k])
            found[k + 1] = q[-1], v[-1]
    return found


def _continues(arcs: Sequence[Arc], k: int) -> bool:
    """Return whether another arc of the same record follows arc k."""
    return k + 1 < len(arcs) and arcs[k + 1].record == arcs[k].record


def _own(rows: Array, arcs: Sequence[Arc], k: int) -> Array:
    """Return the rows of an arc; its last sample may be the first one of the next arc."""
    return rows[:-1] if _continues(arcs, k) else rows


def _gaps(arcs: Sequence[Arc], ends: Array, states: Array) -> Array:
    """Return the end of each arc minus the beginning of the one that follows it, shape (pairs, 2)."""
    first = [k for k in range(len(arcs)) if _continues(arcs, k)]
    return ends[first] - states[[k + 1 for k in first]]


def _linearise(
    simulate: Simulate, arcs: Sequence[Arc], x: Array, states: Array, prior: Prior, steps: Array
) -> tuple[_Run, _Linear]:
    """Return errors and gaps, and their derivatives with the gaps eliminated (condensing)."""
    p = len(x)
    width = 2 * (max(arc.record for arc in arcs) + 1) + p
    step = DIFFERENCE * prior.deviation
    step = np.where(x + step > prior.upper, -step, step)
    errors, ends, rows, shifts, maps, offsets = [], [], [], [], [], []
    P, c = np.zeros((2, width)), np.zeros(2)
    for k, (arc, state) in enumerate(zip(arcs, states, strict=True)):
        if k == 0 or not _continues(arcs, k - 1):
            P, c = np.zeros((2, width)), np.zeros(2)
            P[:, 2 * arc.record : 2 * arc.record + 2] = np.eye(2)
        q, v = simulate(x, arc, state)
        moved = [(simulate(x, arc, state + steps[i] * np.eye(2)[i]), steps[i]) for i in range(2)]
        moved += [(simulate(x + step[i] * np.eye(p)[i], arc, state), step[i]) for i in range(p)]
        D = np.column_stack([(other - q) / size for (other, _), size in moved])
        E = np.array([[(other[-1] - q[-1]) / size, (speed[-1] - v[-1]) / size] for (other, speed), size in moved]).T
        J = D[:, :2] @ P
        J[:, -p:] += D[:, 2:]
        error = q - arc.measured
        errors.append(_own(error, arcs, k))
        ends.append([q[-1], v[-1]])
        rows.append(_own(J, arcs, k))
        shifts.append(_own(error + D[:, :2] @ c, arcs, k))
        maps.append(P)
        offsets.append(c)
        if _continues(arcs, k):
            c = E[:, :2] @ c + np.array(ends[-1]) - states[k + 1]
            P = E[:, :2] @ P
            P[:, -p:] += E[:, 2:]
    run = _Run(np.concatenate(errors), _gaps(arcs, np.array(ends), states))
    if not np.isfinite(np.concatenate(rows)).all():
        raise FitError("The motion cannot be simulated near the identified parameters; fix some of them.")
    return run, _Linear(np.concatenate(rows), np.concatenate(shifts), np.array(maps), np.array(offsets))
