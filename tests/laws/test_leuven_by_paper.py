"""LeuvenFeedforward and ModifiedLeuvenFeedforward against the equations of the papers, integrated by scipy."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from shell.instance import Instance, load
from thorough import landing

Ts = 1e-3
Fc, Fs, vs, sigma1, sigma2, n = 1.0, 1.5, 1e-3, 316.0, 0.4, 2.0
A, zc = 4.0, 4e-5
K = np.array([28e3, 15e3, 10e3, 8e3, 6.5e3, 5.3e3, 4.3e3, 3.5e3, 2.8e3, 2.1e3])
W = np.full(10, 0.15)
TURNS = 1e-6 * np.array([0.0, 18.0, 5.0, 12.0, 8.0, 14.0, -3.0, 2.0, -1.0, 60.0, 40.0, 47.0, -70.0])
"""Nested reversals, some of whose loops close, then sliding in both directions [m]."""


def reference() -> np.ndarray:
    """Positions by sample: between the turning points at speeds from 0.1 to 1 mm/s."""
    speeds = 1e-3 * np.array([0.4, 0.2, 0.3, 0.1, 0.5, 0.3, 0.2, 0.1, 1.0, 0.7, 0.4, 0.9])
    pieces = [np.zeros(1)]
    for (a, b), speed in zip(pairwise(TURNS), speeds, strict=True):
        pieces.append(np.linspace(a, b, 1 + int(np.ceil(abs(b - a) / (speed * Ts))))[1:])
    return np.concatenate(pieces)


def level(v: float) -> float:
    return float(np.sign(v) * (Fc + (Fs - Fc) * np.exp(-((abs(v) / vs) ** 2))))


def power(r: float) -> float:
    return float(np.sign(r) * abs(r) ** n)


def leuven(r: np.ndarray, rd: np.ndarray) -> list[float]:
    """dz/dx = 1 - sgn(q)|q|^n, q = Fd(z)/(S - Fb), with the reversal points on a stack; F at the velocity rd."""

    def Fd(z: float) -> float:
        return float(A * np.sign(z) * (1.0 - np.exp(-abs(z) / zc)))

    def inverse(F: float) -> float:
        return float(-zc * np.sign(F) * np.log(1.0 - abs(F) / A))

    stack: list[float] = []
    z, Fb, side, forces = 0.0, 0.0, 1.0, [0.0]
    for dx, v in zip(np.diff(r), rd[1:], strict=True):
        S, way = level(dx / Ts), float(np.sign(dx))
        if way != side:
            Fb = Fb + Fd(z)
            stack.append(Fb)
            z, side = 0.0, way
        rest = abs(dx)
        while rest > 0.0:
            closes = side * stack[-2] if len(stack) >= 2 else np.inf

            def slope(_: float, y: np.ndarray, S: float = S, base: float = Fb, side: float = side) -> list[float]:
                return [side * (1.0 - power(Fd(y[0]) / (S - base)))]

            def closing(_: float, y: np.ndarray, base: float = Fb, at: float = closes, side: float = side) -> float:
                return side * (base + Fd(y[0])) - at if np.isfinite(at) else -1.0

            def sliding(_: float, y: np.ndarray, S: float = S, base: float = Fb) -> float:
                return Fd(y[0]) / (S - base) - (1.0 - 1e-3)

            if stack and sliding(0.0, np.array([z])) >= -1e-9:
                z, Fb = inverse(Fb + Fd(z)), 0.0
                stack.clear()
                continue
            if closing(0.0, np.array([z])) >= -1e-9:
                del stack[-2:]
                force = Fb + Fd(z)
                Fb = stack[-1] if stack else 0.0
                z = inverse(force - Fb)
                continue
            events = [closing, sliding] if stack else []
            for event in events:
                event.terminal, event.direction = True, 1.0  # type: ignore[attr-defined]
            run = solve_ivp(slope, (0.0, rest), [z], rtol=1e-11, atol=1e-16, events=events)
            z, rest = float(run.y[0, -1]), rest - float(run.t[-1])
            if run.status != 1:
                break
        base, deflection, S = Fb, z, level(v)
        if v * side < 0.0:  # a reversal between the samples, which the displacement does not show
            base, deflection = Fb + Fd(z), 0.0
        elif (stack and Fd(z) / (S - Fb) >= 1.0 - 1e-3) or side * (S - Fb) <= 0.0:
            base, deflection = 0.0, inverse(Fb + Fd(z))
        forces.append(Fb + Fd(z) + sigma1 * v * (1.0 - power(Fd(deflection) / (S - base))) + sigma2 * v)
    return forces


def modified_leuven(r: np.ndarray, rd: np.ndarray) -> list[float]:
    """dz/dx = 1 - sgn(q)|q|^n, q = Fh/S, with Fh of Maxwell slip elements that z drives."""
    F, forces = np.zeros(10), [0.0]
    for dx, v in zip(np.diff(r), rd[1:], strict=True):
        S = level(dx / Ts)

        def elements(z: float, F: np.ndarray = F) -> np.ndarray:
            return np.clip(F + K * z, -W, W)

        def slope(_: float, y: np.ndarray, S: float = S, side: float = float(np.sign(dx))) -> list[float]:
            return [side * (1.0 - power(float(elements(y[0]).sum()) / S))]

        run = solve_ivp(slope, (0.0, abs(dx)), [0.0], rtol=1e-10, atol=1e-15, max_step=abs(dx) / 5.0)
        F = elements(float(run.y[0, -1]))
        forces.append(float(F.sum()) + sigma1 * v * (1.0 - power(float(F.sum()) / level(v))) + sigma2 * v)
    return forces


@landing
@pytest.mark.parametrize(
    ("name", "expected"), [("LeuvenFeedforward", leuven), ("ModifiedLeuvenFeedforward", modified_leuven)]
)
def test_a_feedforward_follows_the_equations_of_the_paper(
    name: str, expected: Callable[[np.ndarray, np.ndarray], list[float]], build_fmu: Callable[..., Path]
) -> None:
    """F along nested reversals and sliding, at an rd that differs from the slope of r; u = mass rdd + gain F."""
    r = reference()
    rd = np.resize([1.0, 1.7, -0.6], r.size) * np.diff(r, prepend=0.0) / Ts
    mass, gain = 2.0, 0.8
    rdd = np.sin(np.arange(r.size))
    start = {"Fc": Fc, "Fs": Fs, "vs": vs, "sigma1": sigma1, "sigma2": sigma2, "n": n, "mass": mass, "gain": gain}
    if name == "LeuvenFeedforward":
        start |= {"A": A, "zc": zc}
    found = []
    with Instance(load(build_fmu(name, Ts=Ts))) as run:
        run.initialise(**start)
        for k, position in enumerate(r):
            run.set({"r": position, "rd": rd[k], "rdd": rdd[k]})
            run.step(k * Ts, Ts)
            found.append(run.get("F_hat", "u"))
    F = np.array(expected(r, rd))
    assert np.ptp(F) > 2.0
    np.testing.assert_allclose(np.array(found)[:, 0], F, atol=1e-6)
    np.testing.assert_allclose(np.array(found)[:, 1], mass * rdd + gain * F, atol=1e-6)
