"""The masters on linear loops of parts without FMUs, whose limits of stability and solutions are closed forms."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.linalg import expm

from benchmarks.pairs import Values
from benchmarks.rows import Row
from harness import CallablePart, System

SIGMA0, DAMPING = 1e5, math.sqrt(1e5) + 0.4  # of a bristle that sticks, LuGre 1995 [N/m], [N s/m]


def linear(name: str, A: Values, b: Values, c: Values, d: float, state: list[float]) -> CallablePart:
    """x' = A x + b u, y = c x + d u, exact for an input that is held during the step."""
    n = len(b)
    maps: dict[float, Values] = {}

    def advance(t: float, h: float, u: Values, x: Values) -> Values:
        if h not in maps:
            maps[h] = expm(h * np.block([[A, b.reshape(-1, 1)], [np.zeros((1, n + 1))]]))[:n]
        return maps[h] @ np.append(x, u)

    reads = {"y": ("u",) if d else ()}
    return CallablePart(
        name, lambda t, u, x: c @ x + d * u[0], ["u"], ["y"], advance=advance, state=state, dependencies=reads
    )


def loop(first: CallablePart, second: CallablePart) -> System:
    """Two parts that drive each other."""
    return System([first, second], [f"{first.name}.y -> {second.name}.u", f"{second.name}.y -> {first.name}.u"])


def stuck_mass() -> System:
    """1 kg on a bristle: u of the mass is the friction force, u of the bristle the velocity."""
    mass = linear("mass", np.zeros((1, 1)), np.array([-1.0]), np.ones(1), 0.0, [1e-3])
    return loop(mass, linear("bristle", np.zeros((1, 1)), np.ones(1), np.array([SIGMA0]), DAMPING, [0.0]))


def limit_of(grows: Callable[[float], bool], accuracy: float) -> float:
    """The step [s] from which on something grows, between 1 and 6 ms, to this part of itself."""
    low, high = 1e-3, 6e-3
    while high - low > accuracy * low:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if grows(middle) else (middle, high)
    return low


def closed_form(master: str) -> float:
    """Limit of stability [s]: a root of the coupled map on the unit circle.

    v+ = v - h F, z+ = z + h v_in, F+ = sigma0 z+ + c v_in; v_in is v for Jacobi, v+ for Gauss-Seidel.
    """

    def grows(h: float) -> bool:
        if master == "jacobi":  # (l - 1)^2 l + h c (l - 1) + h^2 sigma0 l
            polynomial = [1.0, -2.0, 1.0 + h * DAMPING + h * h * SIGMA0, -h * DAMPING]
        else:  # (l - 1)^2 + h c (l - 1) + h^2 sigma0 l
            polynomial = [1.0, -2.0 + h * DAMPING + h * h * SIGMA0, 1.0 - h * DAMPING]
        return bool(np.abs(np.roots(polynomial)).max() > 1.0 + 1e-12)

    return limit_of(grows, 1e-9)


def measured(master: str, system: System) -> float:
    """Limit of stability [s] in runs of 400 steps."""

    def grows(h: float) -> bool:
        v = np.abs(system.run(stop=400 * h, step=h, master=master, record=["mass.y"])["mass.y"].to_numpy())
        return bool(v[-100:].max() > v[100:200].max())

    return limit_of(grows, 1e-3)


def order_of(master: str, steps: int) -> float:
    """Order of convergence of the end of an oscillation of two masses, 1 kg and 0.7 kg on springs of 30 and 12 N/m."""
    k1, k2, m1, m2 = 30.0, 12.0, 1.0, 0.7
    position, push = np.array([1.0, 0.0]), np.array([0.0, 1.0])
    own = [np.array([[0.0, 1.0], [-k / m, 0.0]]) for k, m in ((k1, m1), (k2, m2))]
    first = linear("first", own[0], push / m1, position, 0.0, [0.1, 0.0])
    second = linear("second", own[1], push * k2 / m2, k2 * position, -k2, [-0.05, 0.0])
    whole = np.block([[own[0], k2 / m1 * np.outer(push, position)], [k2 / m2 * np.outer(push, position), own[1]]])
    whole[1, 0] -= k2 / m1
    exact = float((expm(whole) @ [0.1, 0.0, -0.05, 0.0])[0])
    ends = [
        float(loop(first, second).run(stop=1.0, step=1.0 / n, master=master, record=["first.y"])["first.y"][-1])
        for n in (steps, 2 * steps)
    ]
    return math.log2(abs(ends[0] - exact) / abs(ends[1] - exact))


def linear_rows() -> list[Row]:
    """Limits of stability, and orders of convergence."""
    rows, system = [], stuck_mass()
    for master in ("jacobi", "gauss-seidel"):
        exact = closed_form(master)
        error = abs(measured(master, system) / exact - 1.0)
        rows.append(Row(f"Stuck mass: limit of stability of {master}, {1e3 * exact:.3g} ms", 100.0 * error, "%", 2.0))
    for master, order, steps in (("jacobi", 1, 500), ("gauss-seidel", 1, 500), ("newton", 2, 100)):
        away = abs(order_of(master, steps) - order)
        rows.append(Row(f"Two masses: order of convergence of {master}, away from {order}", away, "", 0.1))
    return rows
