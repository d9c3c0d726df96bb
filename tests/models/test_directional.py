"""Directional derivatives of friction blocks over all scales of the velocity, against the equations of the papers with
complex numbers (Squire and Trapp, SIAM Review 40(1), 1998: exact to rounding)."""

from __future__ import annotations

import cmath
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import pytest
from shell.instance import CO_SIMULATION, MODEL_EXCHANGE, Instance, load

BuildFmu = Callable[..., Path]
Equations = Callable[[complex, complex], Sequence[complex]]
SPEEDS = [side * size for size in (1e-9, 1e-7, 5e-6, 2e-4, 0.02) for side in (1.0, -1.0)]


def sign(v: complex) -> float:
    return 1.0 if v.real > 0.0 else -1.0


def curve(v: complex, vs: float = 1e-3, delta: int = 2) -> complex:
    return 1.0 + 0.5 * cmath.exp(-((sign(v) * v / vs) ** delta))


def hysteresis(z: complex) -> complex:
    return sign(z) * 4.0 * (1.0 - cmath.exp(-sign(z) * z / 4e-5))


def lugre(v: complex, z: complex) -> Sequence[complex]:
    rate = v - 1e5 * sign(v) * v * z / curve(v)
    return 1e5 * z + 316.22776601683796 * rate + 0.4 * v, rate


def elasto_plastic(v: complex, z: complex) -> Sequence[complex]:
    top, w = curve(v) / 1e5, sign(z) * z
    wave = cmath.sin(cmath.pi * (w - 0.5 * (top + 0.7e-5)) / (top - 0.7e-5))
    rate = v * (1.0 - (0.5 + 0.5 * wave) * w / top)
    return 1e5 * z + 316.22776601683796 * rate + 0.4 * v, rate


def leuven(v: complex, z: complex) -> Sequence[complex]:
    ratio = sign(v) * hysteresis(z) / curve(v)
    rate = v * (1.0 - ratio**2)
    return hysteresis(z) + 316.22776601683796 * rate + 0.4 * v, rate


def bliman_sorine(v: complex, z: complex) -> Sequence[complex]:
    return z, sign(v) * v * (1.8 * sign(v) - z) / 1e-4


def rate_and_state(v: complex, z: complex) -> Sequence[complex]:
    w = sign(v) * v / 2e-6 * cmath.exp((0.6 + 0.015 * cmath.log(1e-6 * z / 1e-5)) / 0.01)
    return sign(v) * 0.01 * cmath.log(w + cmath.sqrt(w * w + 1.0)), 1.0 - sign(v) * v * z / 1e-5


MODELS: Mapping[str, tuple[str, float, Equations, Mapping[str, float]]] = {
    "Viscous": ("", 0.0, lambda v, _: [0.4 * v], {"Fv": 0.4}),
    "Coulomb": ("", 0.0, lambda v, _: [sign(v) + 0.0 * v], {}),
    "Stiction": ("", 0.0, lambda v, _: [sign(v) + 0.4 * v], {}),
    "Stribeck": ("", 0.0, lambda v, _: [sign(v) * curve(v) + 0.4 * v], {}),
    "Stribeck of 1 um/s": ("", 0.0, lambda v, _: [sign(v) * curve(v, 1e-6) + 0.4 * v], {"vs": 1e-6}),
    "Tustin": ("", 0.0, lambda v, _: [sign(v) * curve(v, delta=1) + 0.4 * v], {}),
    "LuGre": ("z", 0.9e-5, lugre, {}),
    "LuGre of a small z": ("z", 1e-11, lugre, {}),
    "ElastoPlastic": ("z", 0.85e-5, elasto_plastic, {}),
    "Leuven": ("z", 0.6e-5, leuven, {}),
    "Leuven of a small z": ("z", 1e-11, leuven, {}),
    "Dahl": ("z", 0.8e-5, lambda v, z: [1e5 * z, v * (1.0 - sign(v) * 1e5 * z)], {}),
    "BlimanSorine": ("F_fast", 0.7, bliman_sorine, {}),
    "LoadDependentDahl": (
        "z",
        0.4,
        lambda v, z: [0.1 * z + 0.03 * z * z + 0.4 * v, (v - sign(v) * v * z) / 1e-3],
        {},
    ),
    "RateAndState": ("theta", 10.0, rate_and_state, {}),
    "ResetIntegrator": ("z", 0.4e-5, lambda v, z: [1.5e5 * z + 774.6 * v, v], {}),
}


@pytest.mark.parametrize("kind", [CO_SIMULATION, MODEL_EXCHANGE])
@pytest.mark.parametrize("name", MODELS)
def test_directional_derivatives_at_all_speeds(build_fmu: BuildFmu, name: str, kind: int) -> None:
    """Central differences lose F epsilon / v at a small v."""
    state, z, equations, parameters = MODELS[name]
    unknowns = ["F", f"der({state})"] if state else ["F"]
    library, tiny = load(build_fmu(name.partition(" ")[0])), 1e-30
    for v in SPEEDS:
        q = z if state == "theta" else sign(v) * z
        point = {"v": v, state: q} if state else {"v": v}
        values = equations(v, q)
        with Instance(library, kind=kind) as run:
            if kind == CO_SIMULATION:
                run.initialise(**parameters, **point)
            else:
                run.exchange(**parameters, **point)
            for known in point:
                moved = equations(v + 1j * tiny, q) if known == "v" else equations(v, q + 1j * tiny)
                for one, value, at in zip(run.directional(unknowns, {known: 1.0}), moved, values, strict=True):
                    rounding = 1e-13 * abs(at) / abs(point[known])
                    assert one == pytest.approx(value.imag / tiny, rel=1e-6, abs=rounding + 1e-9), (v, known)
