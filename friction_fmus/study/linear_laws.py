"""Linear parts of servo and compensators, for margins and poles of their loop."""

from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Final, TypeVar

import numpy as np
from casadi import Function

from friction_fmus.blocks.catalogue import listing
from friction_fmus.conditions import SampledLaw
from friction_fmus.errors import FrictionError, did_you_mean
from friction_fmus.lawkit.law import Kind, Law
from friction_fmus.lawkit.law_files import discover_laws

NUDGE = 1e-15
"""Position error about which a law is linearised [m]; not 0, where the root in super-twisting has no derivative."""

SETTLED = 500  # samples after which the gains of a filter, or a law in steady motion, count as settled


@cache
def _with_jacobian(path: Path, name: str) -> tuple[Law, Function]:
    """Return the law of a file and its Jacobian."""
    law = next(law for law in discover_laws(path) if law.name == name)
    return law, law.function.jacobian()


def linearised(name: str, values: Mapping[str, float], Ts: float, output: str = "u", speed: float = 0.0) -> SampledLaw:
    """Return a law on its target as a linear sampled system from (x, v, u_prev) to a force."""
    law, jacobian = _with_jacobian(listing()[name].path, name)
    given = [scalar for variable in law.given for scalar in variable.scalars]
    results = [scalar for variable in law.results for scalar in variable.scalars]
    states = [s for variable in law.select(Kind.STATE, Kind.STATES) for s in variable.scalars]
    start = {
        scalar: float(value)
        for variable in law.given
        for scalar, value in zip(variable.scalars, variable.starts, strict=True)
    }
    parameters = {s for v in law.given if v.kind not in (Kind.INPUT, Kind.STATE, Kind.STATES) for s in v.scalars}
    now = start | {key: value for key, value in values.items() if key in parameters} | {"Ts": Ts, "enable": 1.0}
    now |= {key: speed for key in ("v", "rd") if key in now}
    for k in range(SETTLED):
        now |= {key: speed * k * Ts for key in ("x", "r") if key in now}
        found = dict(zip(results, map(float, law.function.call([now[key] for key in given])), strict=True))
        before = np.array([now[key] for key in states])
        now |= {key: found[key] for key in states}
        after = np.array([now[key] for key in states])
        if speed == 0.0 and (np.abs(after - before) <= 1e-12 * np.abs(after)).all():
            break
    if speed == 0.0:
        now["x"] = -NUDGE
    blocks = jacobian.call([*(now[key] for key in given), *([0.0] * len(results))])
    table = np.array([float(block) for block in blocks]).reshape(len(results), len(given))
    row, column = {key: i for i, key in enumerate(results)}, {key: i for i, key in enumerate(given)}

    def part(rows: list[str], columns: list[str]) -> np.ndarray:
        return np.array([[table[row[r], column[c]] if c in column else 0.0 for c in columns] for r in rows]).reshape(
            len(rows), len(columns)
        )

    signals = ["x", "v", "u_prev"]
    kept = _moved_and_read(part(states, states), part(states, signals), part([output], states)[0])
    names = [key for key, keep in zip(states, kept, strict=True) if keep]
    return SampledLaw(part(names, names), part(names, signals), part([output], names)[0], part([output], signals)[0])


def _moved_and_read(A: np.ndarray, B: np.ndarray, C: np.ndarray) -> np.ndarray:
    """Return which states depend on the signals and affect the force."""
    n = len(C)
    moved, read = np.abs(B).sum(axis=1) > 0.0, C != 0.0
    for _ in range(n):
        moved = moved | ((np.abs(A) > 0.0) @ moved)
        read = read | ((np.abs(A) > 0.0).T @ read)
    return np.asarray(moved & read)


def local_function(p: Mapping[str, float], Ts: float) -> SampledLaw:
    """Return LocalFunctionEstimator as a linear sampled system: a weighted sum of means over past intervals (FIR)."""
    n = int(p["window"])
    degree = min(int(p["degree"]), n - 1)
    t = (n - 1) / 2.0 - np.arange(n)
    # value at t = n/2 of the polynomial with the best least-squares fit of the means over unit intervals about t
    means = np.array([((t + 0.5) ** (i + 1) - (t - 0.5) ** (i + 1)) / (i + 1) for i in range(degree + 1)]).T
    w = (n / 2.0) ** np.arange(degree + 1) @ np.linalg.pinv(means)
    A, B = np.zeros((n, n)), np.zeros((n, 3))  # states: the last velocity, then the forces F_m[1] ... F_m[n-1]
    B[0, 1] = 1.0
    force_state, force_input = np.zeros(n), np.array([0.0, -p["m"] / Ts, 1.0])
    force_state[0] = p["m"] / Ts
    if n > 1:
        A[1], B[1] = force_state, force_input
        A[2:, 1:-1] = np.eye(n - 2)
    C = w[0] * force_state
    C[1:] += w[1:]
    return SampledLaw(A, B, p["gain"] * C, p["gain"] * w[0] * force_input)


FILTERS: Final[Mapping[str, Callable[[Mapping[str, float], float], SampledLaw]]] = {"local_function": local_function}
"""Linear parts that the file of a controller in C can name, see `Use.linear`."""

Named = TypeVar("Named")


def named(name: str, known: Mapping[str, Named], row: str, block: str) -> Named:
    """Return what a row in the file of a block names."""
    if name not in known:
        raise FrictionError(f"{row} of {block} names the unknown {name!r}{did_you_mean(name, known)}")
    return known[name]
