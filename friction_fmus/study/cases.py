"""Axes that differ from the identified one, on which every compensator is tried."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Final

from friction_fmus.axis.elements import Trajectory
from friction_fmus.axis.servo import Servo

COARSER: Final = 4.0
"""Factor of the encoder resolution in the case with a worse encoder."""

LOAD: Final = 0.5
"""Load force over the largest friction force near rest."""


@dataclass(frozen=True)
class Case:
    """Difference of the axis from the identified one."""

    name: str
    """Description."""
    friction: float = 1.0
    mass: float = 1.0
    """Factors of all friction forces and of the mass."""
    delay: int = 0
    """Further samples by which the force lags the command."""
    coarser: float = 1.0
    noise: float = 0.0
    """Factor of the encoder resolution, and standard deviation of additional noise of the measured position [m]."""
    load: float = 0.0
    """Constant force on the axis [N]."""
    counts: bool = True
    """Whether the case is part of the worst case."""


def cases(servo: Servo, mismatch: float, delays: Sequence[int], least_delay: float, level: float) -> tuple[Case, ...]:
    """Return the cases of a study."""
    found = []
    factors = (1.0 - mismatch, 1.0 + mismatch) if mismatch else ()
    for friction, mass in product(factors, factors):
        found.append(Case(f"friction x {friction:.4g}, mass x {mass:.4g}", friction, mass))
    for delay in delays:
        samples = "1 more sample" if delay == 1 else f"{delay} more samples"
        found.append(Case(f"{samples} of delay", delay=delay, counts=delay <= least_delay))
    if servo.quantum or servo.noise:
        noise = servo.quantum or servo.noise
        found.append(Case("coarser and noisier encoder", coarser=COARSER, noise=noise))
    if level > 0.0:
        found.append(Case(f"load of {LOAD * level:.3g} N", load=LOAD * level))
    return tuple(found)


def changed(servo: Servo, trajectory: Trajectory, case: Case) -> tuple[Servo, Trajectory]:
    """Return servo and trajectory with the delay, encoder and load of a case."""
    return (
        replace(
            servo,
            delay=servo.delay + case.delay,
            quantum=case.coarser * servo.quantum,
            noise=(servo.noise**2 + case.noise**2) ** 0.5,
        ),
        replace(trajectory, load=trajectory.load + case.load),
    )
