"""Stability of the whole sampled loop: plant, actuator lag and delay, velocity from an encoder, linear sampled laws."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from friction_fmus.conditions.condition import Condition, Matrix, held, is_stable, longest_sample, spectral_radius


@dataclass(frozen=True)
class SampledLaw:
    """Linear sampled law: state_next = A state + B y and u = C state + D y with y = (x, v, u_prev).

    Attributes
    ----------
    A, B, C, D : array, shapes (n, n), (n, 3), (n,) and (3,)
        State matrices; u_prev is the total force of all laws at the previous sample.
    """

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix


@dataclass(frozen=True)
class DrivenPlant:
    """Linear plant state' = A state + b u with measured position and velocity.

    Attributes
    ----------
    A, b, x, v : array, shapes (n, n), (n,), (n,) and (n,)
        State matrix, input, and the output rows of position and velocity.
    """

    A: Matrix
    b: Matrix
    x: Matrix
    v: Matrix


Filter: TypeAlias = tuple[NDArray[np.float64], NDArray[np.float64]]


@dataclass(frozen=True)
class PathDynamics:
    """Dynamics of the actuator and the velocity measurement between the laws and the plant.

    Attributes
    ----------
    tau, delay : float
        Lag and delay of the actuator [s].
    window : int
        The measured velocity is (x[k] - x[k-window])/(window Ts); with 0 the plant's velocity is measured.
    lowpass, notch : (array, array)
        Numerators and denominators in powers of 1/z of filters of the velocity and of the total force; both of the same
        length, the first denominator is 1.
    """

    tau: float = 0.0
    delay: float = 0.0
    window: int = 0
    lowpass: Filter | None = None
    notch: Filter | None = None


NO_FILTER: Filter = (np.ones(1), np.ones(1))
DIRECT = PathDynamics()  # actuator without lag or delay, and an exact velocity measurement


def second_order(f: float, zeta: float, low: float, band: float, high: float, Ts: float) -> Filter:
    """Return the filter of a block SecondOrderFilter with these parameters."""
    if not 0.0 < f * Ts < 0.5:
        return NO_FILTER
    q = 1.0 / math.tan(math.pi * f * Ts)
    d, high = 2.0 * zeta * q, high * q * q
    a = np.array([q * q + d + 1.0, 2.0 * (1.0 - q * q), q * q - d + 1.0])
    return np.array([high + band * d + low, 2.0 * (low - high), high - band * d + low]) / a[0], a / a[0]


def one_mass(m: float, damping: float = 0.0, stiffness: float = 0.0) -> DrivenPlant:
    """Return the linear plant of a mass with a damper and a spring to ground.

    Parameters
    ----------
    m : float
        Mass [kg].
    damping : float
        Damper to ground [N.s/m].
    stiffness : float
        Spring to ground, or stiffness of the contact [N/m].

    Returns
    -------
    DrivenPlant
        States (x, v).
    """
    A = np.array([[0.0, 1.0], [-stiffness / m, -damping / m]])
    return DrivenPlant(A, np.array([0.0, 1.0 / m]), np.array([1.0, 0.0]), np.array([0.0, 1.0]))


def two_masses(
    m1: float,
    m2: float,
    k: float,
    d: float,
    damping: tuple[float, float] = (0.0, 0.0),
    stiffness: tuple[float, float] = (0.0, 0.0),
) -> DrivenPlant:
    """Return the linear plant of a motor and a load coupled by a spring, driven and measured at the motor.

    Parameters
    ----------
    m1, m2, k, d : float
        Mass of motor and load [kg], stiffness [N/m] and damping [N.s/m] of the transmission.
    damping, stiffness : (float, float)
        Damping [N.s/m] and stiffness [N/m] to ground, at motor and load.

    Returns
    -------
    DrivenPlant
        States (x1, v1, x2, v2).
    """
    A = np.array(
        [
            [0.0, 1.0, 0.0, 0.0],
            [-(k + stiffness[0]) / m1, -(d + damping[0]) / m1, k / m1, d / m1],
            [0.0, 0.0, 0.0, 1.0],
            [k / m2, d / m2, -(k + stiffness[1]) / m2, -(d + damping[1]) / m2],
        ]
    )
    rows = np.eye(4)
    return DrivenPlant(A, np.array([0.0, 1.0 / m1, 0.0, 0.0]), rows[0], rows[1])


def on_bristles(
    plant: DrivenPlant, at: int, m: float, s0: float, s1: float, level: float, slope: float, v: float
) -> DrivenPlant:
    """Return a plant linearised about steady sliding on LuGre bristles, with their deflection as one more state.

    From z' = v - s0 |v|/g(v) z and F = s0 z + s1 z' about z = g/s0: dz' = (v g'/g) dv - (s0 v/g) dz. The plant
    contains the viscous part.

    Parameters
    ----------
    plant : DrivenPlant
        Plant without dry friction.
    at : int
        Index of the state that is the sliding velocity.
    m : float
        Mass that the bristles act on [kg].
    s0, s1 : float
        Stiffness [N/m] and damping [N.s/m] of the bristles.
    level, slope, v : float
        Stribeck curve g [N] and its slope g' [N.s/m] at the speed v > 0 [m/s].

    Returns
    -------
    DrivenPlant
        The states of the plant, then the deflection.
    """
    n = len(plant.b)
    drive, rate = v * slope / level, s0 * v / level
    A = np.zeros((n + 1, n + 1))
    A[:n, :n] = plant.A
    A[at, at] -= s1 * drive / m
    A[at, n] = (s1 * rate - s0) / m
    A[n, at], A[n, n] = drive, -rate
    return DrivenPlant(A, np.append(plant.b, 0.0), np.append(plant.x, 0.0), np.append(plant.v, 0.0))


def chain(plant: DrivenPlant, laws: Sequence[SampledLaw], Ts: float, path: PathDynamics = DIRECT) -> Matrix:
    """Return the step matrix of the whole loop; the forces of all laws are added and held between samples.

    Parameters
    ----------
    plant : DrivenPlant
        Plant.
    laws : sequence of SampledLaw
        Laws, all sampled at the same instants.
    Ts : float
        Sample time [s].
    path : PathDynamics
        Actuator and velocity measurement.

    Returns
    -------
    array, shape (n, n)
        States of the plant, the actuator lag, the forces of past samples, the positions of past samples, the filters of
        velocity and force, the last force before its filter and the laws, in this order.
    """
    A, b, read = _with_lag(plant, path.tau)
    n = len(b)
    whole = math.floor(path.delay / Ts + 1e-9)
    part = max(path.delay - whole * Ts, 0.0)
    early, late = held(A, b, part), held(A, b, Ts - part)
    filters = lowpass, notch = path.lowpass or NO_FILTER, path.notch or NO_FILTER
    orders = (len(own[1]) - 1 for own in filters)
    ends = np.cumsum((n, whole + 1, path.window, *orders, 1, *(len(law.C) for law in laws)))

    # the states after a step, as combinations of the states before, which are the columns
    motion, forces, positions, slow, notched, last, *memories = np.split(np.eye(ends[-1]), ends[:-1])
    x, v = read @ motion
    if path.window:
        v = (x - positions[-1]) / (path.window * Ts)
    v, slow = _filter_step(lowpass, slow, v)
    y = np.array([x, v, last[0]])
    u = sum((law.C @ own + law.D @ y for law, own in zip(laws, memories, strict=True)), np.zeros(ends[-1]))
    force, notched = _filter_step(notch, notched, u)
    sent = np.vstack([force, forces])  # now, one sample ago, ...
    moved = late[0] @ (early[0] @ motion + np.outer(early[1], sent[whole + 1])) + np.outer(late[1], sent[whole])
    after = [law.A @ own + law.B @ y for law, own in zip(laws, memories, strict=True)]
    kept = np.vstack([x, positions])[: path.window]
    return np.vstack([moved, sent[:-1], kept, slow, notched, u, *after])


def _filter_step(own: Filter, state: Matrix, u: Matrix) -> tuple[Matrix, Matrix]:
    """Return output and next state of a filter in direct form II transposed, shapes (n,) and (order, n)."""
    b, a = own
    y = b[0] * u + (state[0] if len(state) else 0.0)
    return y, np.vstack([state[1:], np.zeros((min(len(state), 1), len(u)))]) + np.outer(b[1:], u) - np.outer(a[1:], y)


def _with_lag(plant: DrivenPlant, tau: float) -> tuple[Matrix, Matrix, Matrix]:
    """Return state matrix, input and output rows of x and v for the plant with the actuator lag in front of it."""
    n = len(plant.b)
    read = np.array([plant.x, plant.v])
    if tau <= 0.0:
        return plant.A, plant.b, read
    A = np.zeros((n + 1, n + 1))
    A[:n, :n], A[:n, n], A[n, n] = plant.A, plant.b, -1.0 / tau
    return A, np.append(np.zeros(n), 1.0 / tau), np.hstack([read, np.zeros((2, 1))])


def loop_poles(
    plant: DrivenPlant,
    laws: Callable[[float], Sequence[SampledLaw]],
    Ts: float,
    path: PathDynamics = DIRECT,
    name: str = "sampled loop",
    where: str = "in sliding",
    why: str = "",
    hint: str = "",
) -> Condition:
    """Check that the whole sampled loop is stable: all eigenvalues of `chain` are within the unit circle.

    Lag and delay of the actuator, the difference quotient of an encoder, a flexible transmission and disturbance
    estimators each add states. A plant with the stiffness of the contact gives the loop in presliding.

    Parameters
    ----------
    plant : DrivenPlant
        Plant.
    laws : callable
        Function of the sample time [s] that returns the laws.
    Ts : float
        Sample time [s].
    path : PathDynamics
        Actuator and velocity measurement.
    name, where, why, hint : str
        Name of the condition, operating point, consequence, and what to change. Without a hint, the function searches
        for gains that are low enough.

    Returns
    -------
    Condition
        Its value is the largest magnitude of the eigenvalues, its bound 1.
    """

    def loop(time: float) -> Matrix:
        return chain(plant, laws(time), time, path)

    value, ok = spectral_radius(loop(Ts)), is_stable(loop(Ts))
    faster, shorter = "", ""
    if not ok:
        hint = hint or _lower(plant, laws(Ts), Ts, path)
        dead, fixed = max(path.delay, path.tau) > 0.0, path.lowpass or path.notch  # filters of this Ts
        longest = 0.0 if dead or fixed else longest_sample(lambda time: is_stable(loop(time)), Ts)
        faster = f", or sample faster than every {longest:.4g} s" if longest else ""
        shorter = _shorter(plant, laws(Ts), Ts, path) if dead else ""
    return Condition(
        name=name,
        ok=ok,
        value=value,
        bound=1.0,
        wrong=f"{where} the largest eigenvalue of the loop, sampled every {Ts:.4g} s, has the magnitude {value:.4g}, "
        "not below 1",
        why=why or "holding the {force} between samples delays it by half a sample time: the loop oscillates and grows",
        change=f"{hint}{shorter}{faster}",
        source="Astrom, Wittenmark: Computer-Controlled Systems, 3rd ed., 1997; loop matrix derived here",
    )


def _edge(stable: Callable[[float], bool]) -> float:
    """Return the upper end of the stable range of shares above 0, at most 1; 0 if no share from 0.01 on is stable."""
    low, high = 0.0, 1.0
    for share in (0.5, 0.2, 0.1, 0.05, 0.02, 0.01):
        if stable(share):
            low = share
            break
        high = share
    while low and high - low > 1e-3 * high:
        middle = (low + high) / 2.0
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low


def _lower(plant: DrivenPlant, laws: Sequence[SampledLaw], Ts: float, path: PathDynamics) -> str:
    """Return the advice to lower all gains by one factor, if that makes the loop stable."""

    def stable(share: float) -> bool:
        return is_stable(chain(plant, [replace(law, C=share * law.C, D=share * law.D) for law in laws], Ts, path))

    share = _edge(stable)
    if share:
        return f"scale all gains down together, below {share:.3g} of their present values"
    return "change the gains: no common factor makes the loop stable"


def _shorter(plant: DrivenPlant, laws: Sequence[SampledLaw], Ts: float, path: PathDynamics) -> str:
    """Return the advice to shorten lag and delay of the actuator, if that makes the loop stable."""

    def stable(share: float) -> bool:
        shrunk = replace(path, tau=share * path.tau, delay=share * path.delay)
        return is_stable(chain(plant, laws, Ts, shrunk))

    low, total = _edge(stable), path.tau + path.delay
    if not low:
        return "; lag and delay of the actuator are not the only cause"
    return f", or reduce the total lag and delay of the actuator from {total:.4g} s to below {low * total:.4g} s"


Response = NDArray[np.complex128]

POINTS = 1500
"""Number of frequencies at which the loop is evaluated, from `LOWEST` times the Nyquist frequency up to it."""

LOWEST = 1e-5

RIGOROUS = 40  # number of states up to which stability is tested for all matrices within rounding errors


@dataclass(frozen=True)
class Margins:
    """Margins of a loop."""

    stable: bool
    """Whether the loop is stable; otherwise the margins are those of an unstable loop, and `sensitivity` is infinite.
    """
    sensitivity: float  # peak of the sensitivity function Ms = max |1/(1 + L)|
    phase: float  # phase margin [rad]; infinite if the gain is nowhere 1
    delay: float
    """Delay margin [samples]: further delay at which the loop becomes unstable; infinite if the gain is nowhere 1."""


def loop_margins(plant: DrivenPlant, laws: Sequence[SampledLaw], Ts: float, path: PathDynamics = DIRECT) -> Margins:
    """Return the margins of a sampled loop with respect to the force of the drive."""
    # With the transfer functions K of all laws from (x, v, u_prev) to the force, P of the held plant with the lag of
    # the actuator, N of the filter of the force, and a delay of whole samples, the loop is
    #
    #     L(z) = -(Kx Px + Kv Pv) / (1 - Ku/z) N z^-delay
    #
    # where Pv contains the filter of the velocity (Astrom, Wittenmark: Computer-Controlled Systems, 3rd ed., 1997; Ms:
    # Astrom, Hagglund: Advanced PID Control, 2006).
    w = math.pi * np.geomspace(LOWEST, 1.0, POINTS)
    L = open_loop(plant, laws, Ts, path, np.exp(1j * w))
    loop = chain(plant, laws, Ts, path)
    # a long filter has many states, for which the rigorous test takes gigabytes
    stable = is_stable(loop) if len(loop) <= RIGOROUS else spectral_radius(loop) < 1.0
    size, lag = np.abs(L), np.angle(L)
    at = np.flatnonzero((size[:-1] - 1.0) * (size[1:] - 1.0) < 0.0)
    share = (size[at] - 1.0) / (size[at] - size[at + 1])  # linear interpolation to |L| = 1
    turned = np.angle(L[at + 1] / L[at])
    phase = (lag[at] + share * turned + math.pi) % (2.0 * math.pi)
    frequency = w[at] + share * (w[at + 1] - w[at])
    return Margins(
        stable,
        float(np.max(1.0 / np.maximum(np.abs(1.0 + L), 1e-300))) if stable else math.inf,
        float(np.min(np.minimum(phase, 2.0 * math.pi - phase), initial=math.inf)),
        float(np.min(phase / frequency, initial=math.inf)),
    )


def open_loop(plant: DrivenPlant, laws: Sequence[SampledLaw], Ts: float, path: PathDynamics, z: Response) -> Response:
    """Return L at points z of the complex plane, shape (n,); see `loop_margins`."""
    A, b, read = _with_lag(plant, path.tau)
    step, push = held(A, b, Ts)
    x, v = _response(step, push[:, None], read, np.zeros((2, 1)), z)[:, :, 0].T
    if path.window:
        v = x * (1.0 - z**-path.window) / (path.window * Ts)
    v = v * _gain(path.lowpass or NO_FILTER, z)
    force = z ** -round(path.delay / Ts) * _gain(path.notch or NO_FILTER, z)
    K = np.zeros((len(z), 3), dtype=complex)
    for law in laws:
        K += _response(law.A, law.B, law.C[None, :], law.D[None, :], z)[:, 0, :]
    return np.asarray(-(K[:, 0] * x + K[:, 1] * v) / (1.0 - K[:, 2] / z) * force)


def _gain(own: Filter, z: Response) -> Response:
    """Return the complex gain of a filter at each z."""
    return np.asarray(np.polyval(own[0][::-1], 1.0 / z) / np.polyval(own[1][::-1], 1.0 / z))


def _response(A: Matrix, B: Matrix, C: Matrix, D: Matrix, z: Response) -> Response:
    """Return C (z - A)^-1 B + D at each z, shape (n, outputs, inputs)."""
    found = np.broadcast_to(D.astype(complex), (len(z), *D.shape)).copy()
    if not len(A):
        return found
    if not np.triu(A).any():  # strictly lower triangular: a finite impulse response, of up to 1000 states
        row, power = C, 1.0 / z
        while row.any():
            found += power[:, None, None] * (row @ B)
            row, power = row @ A, power / z
        return found
    return found + C @ np.linalg.solve(z[:, None, None] * np.eye(len(A)) - A, np.broadcast_to(B, (len(z), *B.shape)))
