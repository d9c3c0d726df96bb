"""The whole sampled loop: plant, drive with lag and delay, velocity from an encoder, and any linear sampled laws."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from friction_fmus.conditions.condition import Condition
from friction_fmus.conditions.linear import Matrix, is_stable, longest_sample, spectral_radius


@dataclass(frozen=True)
class SampledLaw:
    """A linear sampled law: state_next = A state + B y and u = C state + D y, of y = (x, v, u_prev).

    Attributes
    ----------
    A, B, C, D : array, shapes (n, n), (n, 3), (n,) and (3,)
        u_prev is the force of the sample before, of all laws together.
    """

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix

    def scaled(self, to_force: float, of_position: float, of_velocity: float) -> SampledLaw:
        """The same behind the gains of its wires; u_prev comes back by the same gain as u goes."""
        gains = np.array([of_position, of_velocity, 1.0 / to_force if to_force else 0.0])
        return SampledLaw(self.A, self.B * gains, to_force * self.C, to_force * self.D * gains)


@dataclass(frozen=True)
class DrivenPlant:
    """A linear plant: state' = A state + b u, of which the position x and the velocity v are measured.

    Attributes
    ----------
    A, b, x, v : array, shapes (n, n), (n,), (n,) and (n,)
        x and v are the rows that give the measured values.
    """

    A: Matrix
    b: Matrix
    x: Matrix
    v: Matrix


@dataclass(frozen=True)
class Between:
    """What lies between the laws and the plant.

    Attributes
    ----------
    tau, delay : float
        Lag and delay of the actuator [s].
    window : int
        The measured velocity is (x[k] - x[k-window])/(window Ts); 0: that of the plant.
    smoothing : float
        Time constant of a low-pass behind that difference [s].
    """

    tau: float = 0.0
    delay: float = 0.0
    window: int = 0
    smoothing: float = 0.0


DIRECT = Between()
"""An immediate actuator and an exact sensor."""


def one_mass(m: float, damping: float = 0.0, stiffness: float = 0.0) -> DrivenPlant:
    """A mass [kg] with a damper [N.s/m] and a spring [N/m] to the ground, or the stiffness of its contact."""
    A = np.array([[0.0, 1.0], [-stiffness / m, -damping / m]])
    return DrivenPlant(A, np.array([0.0, 1.0 / m]), np.array([1.0, 0.0]), np.array([0.0, 1.0]))


def two_masses(
    m1: float,
    m2: float,
    k: float,
    d: float,
    damping: tuple[float, float] = (0.0, 0.0),
    stiffness: tuple[float, float] = (0.0, 0.0),
    at_load: tuple[bool, bool] = (False, False),
) -> DrivenPlant:
    """Motor and load with a spring between them, driven at the motor.

    Parameters
    ----------
    m1, m2, k, d : float
        Masses [kg], stiffness [N/m] and damping [N.s/m] of the transmission.
    damping, stiffness : (float, float)
        To the ground, at motor and load [N.s/m, N/m].
    at_load : (bool, bool)
        Whether position and velocity are measured at the load, otherwise at the motor.
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
    return DrivenPlant(A, np.array([0.0, 1.0 / m1, 0.0, 0.0]), rows[2 * at_load[0]], rows[2 * at_load[1] + 1])


def on_bristles(
    plant: DrivenPlant, at: int, m: float, s0: float, s1: float, level: float, slope: float, v: float
) -> DrivenPlant:
    """A plant that slides steadily on LuGre bristles, linearised, with their deflection as one more state.

    From z' = v - s0 |v|/g(v) z and F = s0 z + s1 z' about z = g/s0: dz' = (v g'/g) dv - (s0 v/g) dz. The viscous part
    is in the plant.

    Parameters
    ----------
    plant : DrivenPlant
        Without its dry friction.
    at, m : int, float
        State that is the velocity over the bristles, and the mass that they act on [kg].
    s0, s1 : float
        Stiffness [N/m] and damping [N.s/m] of the bristles.
    level, slope, v : float
        The Stribeck curve g [N] and its slope g' [N.s/m] at the speed v > 0 [m/s].
    """
    n = len(plant.b)
    drive, rate = v * slope / level, s0 * v / level
    A = np.zeros((n + 1, n + 1))
    A[:n, :n] = plant.A
    A[at, at] -= s1 * drive / m
    A[at, n] = (s1 * rate - s0) / m
    A[n, at], A[n, n] = drive, -rate
    return DrivenPlant(A, np.append(plant.b, 0.0), np.append(plant.x, 0.0), np.append(plant.v, 0.0))


def chain(plant: DrivenPlant, laws: Sequence[SampledLaw], Ts: float, between: Between = DIRECT) -> Matrix:
    """Step matrix of the whole loop, the forces of all laws added and held between samples.

    Parameters
    ----------
    plant, laws, between : DrivenPlant, sequence of SampledLaw, Between
        Parts of the loop; all laws are sampled together.
    Ts : float
        Sample time [s].

    Returns
    -------
    array, shape (n, n)
        Of the plant, the lag, the forces of past samples, the positions of past samples, the low-pass of the velocity
        and the states of the laws, in this order.
    """
    A, b, read = _with_lag(plant, between.tau)
    n = len(b)
    whole = math.floor(between.delay / Ts + 1e-9)
    part = max(between.delay - whole * Ts, 0.0)
    early, late = _held(A, b, part), _held(A, b, Ts - part)
    sizes = (n, whole + 1, between.window, 1, *(len(law.C) for law in laws))
    ends = np.cumsum(sizes)
    keep = math.exp(-Ts / between.smoothing) if between.smoothing > 0.0 else 0.0

    def step(state: Matrix) -> Matrix:
        motion, forces, positions, velocity, *memories = np.split(state, ends[:-1])
        x, v = read @ motion
        if between.window:
            v = keep * velocity[0] + (1.0 - keep) * (x - positions[-1]) / (between.window * Ts)
        y = np.array([x, v, forces[0]])
        u = sum((law.C @ own + law.D @ y for law, own in zip(laws, memories, strict=True)), 0.0)
        sent = np.concatenate([[u], forces])  # now, one sample ago, ...
        moved = late[0] @ (early[0] @ motion + early[1] * sent[whole + 1]) + late[1] * sent[whole]
        after = [law.A @ own + law.B @ y for law, own in zip(laws, memories, strict=True)]
        return np.concatenate([moved, sent[:-1], np.concatenate([[x], positions])[: between.window], [v], *after])

    return np.array([step(column) for column in np.eye(ends[-1])]).T


def _with_lag(plant: DrivenPlant, tau: float) -> tuple[Matrix, Matrix, Matrix]:
    """State matrix, input and the rows of x and v of the plant behind the lag of the actuator."""
    n = len(plant.b)
    read = np.array([plant.x, plant.v])
    if tau <= 0.0:
        return plant.A, plant.b, read
    A = np.zeros((n + 1, n + 1))
    A[:n, :n], A[:n, n], A[n, n] = plant.A, plant.b, -1.0 / tau
    return A, np.append(np.zeros(n), 1.0 / tau), np.hstack([read, np.zeros((2, 1))])


def _held(A: Matrix, b: Matrix, time: float) -> tuple[Matrix, Matrix]:
    """The state after a time is the first times the state, plus the second times the force that is held."""
    n = len(b)
    exponent = np.zeros((n + 1, n + 1))
    exponent[:n, :n], exponent[:n, n] = A, b
    found = expm(time * exponent)
    return found[:n, :n], found[:n, n]


def loop_poles(
    plant: DrivenPlant,
    laws: Callable[[float], Sequence[SampledLaw]],
    Ts: float,
    between: Between = DIRECT,
    name: str = "sampled loop",
    where: str = "in sliding",
    why: str = "the force is held between the samples, a delay of half a sample time: the loop oscillates and grows",
    hint: str = "",
) -> Condition:
    """Stability of the whole sampled loop: all eigenvalues of `chain` within the unit circle.

    Lag and delay of the actuator, the difference quotient of an encoder, a flexible transmission and estimators of
    disturbances count with their own states; the stiffness of the contact makes it the loop in presliding.

    Parameters
    ----------
    plant, between : DrivenPlant, Between
        As in `chain`.
    laws : callable
        The laws, from the sample time.
    Ts : float
        Sample time [s].
    name, where, why, hint : str
        Name of the condition, what the plant is at that point, why it matters, and what to change; without a hint it is
        searched for gains that are low enough.
    """

    def loop(time: float) -> Matrix:
        return chain(plant, laws(time), time, between)

    value, ok = spectral_radius(loop(Ts)), is_stable(loop(Ts))
    faster, shorter = "", ""
    if not ok:
        hint = hint or _lower(plant, laws(Ts), Ts, between)
        dead = between.delay > 0.0 or between.tau > 0.0
        longest = 0.0 if dead else longest_sample(lambda time: is_stable(loop(time)), Ts, 6, 1e-3)
        faster = f", or sample faster than every {longest:.4g} s" if longest else ""
        shorter = _shorter(plant, laws(Ts), Ts, between) if dead else ""
    return Condition(
        name=name,
        ok=ok,
        value=value,
        bound=1.0,
        wrong=f"{where} the largest eigenvalue of the loop, sampled every {Ts:.4g} s, has the magnitude {value:.4g}, "
        "not below 1",
        why=why,
        change=f"{hint}{shorter}{faster}",
        source="Astrom, Wittenmark: Computer-Controlled Systems, 3rd ed., 1997; the loop composed here",
    )


def _edge(stable: Callable[[float], bool]) -> float:
    """The largest share from 0 to 1, of those next to 0, at which a loop is stable; 0 if there is none."""
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


def _lower(plant: DrivenPlant, laws: Sequence[SampledLaw], Ts: float, between: Between) -> str:
    """How much lower the gains would have to be, all together, if that helps."""
    share = _edge(
        lambda share: is_stable(
            chain(plant, [SampledLaw(law.A, law.B, share * law.C, share * law.D) for law in laws], Ts, between)
        )
    )
    if share:
        return f"lower all gains together below {share:.3g} of what they are"
    return "change the gains: no common factor makes the loop stable"


def _shorter(plant: DrivenPlant, laws: Sequence[SampledLaw], Ts: float, between: Between) -> str:
    """How much shorter lag and delay of the actuator would have to be, if that helps."""

    def stable(share: float) -> bool:
        shrunk = Between(share * between.tau, share * between.delay, between.window, between.smoothing)
        return is_stable(chain(plant, laws, Ts, shrunk))

    low, total = _edge(stable), between.tau + between.delay
    if not low:
        return "; lag and delay of the actuator are not the cause alone"
    return f", or bring lag and delay of the actuator, together {total:.4g} s, below {low * total:.4g} s"
