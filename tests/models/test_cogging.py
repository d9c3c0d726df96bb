"""Cogging against its Fourier sum, and its work against its potential."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad
from shell.instance import OK, Instance, Library, load

from harness import FmuPart, System

PITCH = 0.03
AMPLITUDE = np.array([2.0, -0.7, 0.0, 0.4, 0.1, -0.05])
PHASE = np.array([0.3, -1.0, 0.5, 2.0, 0.0, 4.0])
SHAPE = {
    "pitch": PITCH,
    **{f"amplitude[{k + 1}]": float(a) for k, a in enumerate(AMPLITUDE)},
    **{f"phase[{k + 1}]": float(p) for k, p in enumerate(PHASE)},
}


def force(x: float) -> float:
    """Imaginary part of a complex Fourier series."""
    turns = np.exp(2j * np.pi * np.arange(1, 7) * x / PITCH)
    return float(((AMPLITUDE * np.exp(1j * PHASE)) @ turns).imag)


@pytest.fixture(scope="module")
def cogging(build_fmu: Callable[..., Path]) -> Library:
    return load(build_fmu("Cogging"))


def test_force_is_the_sum_of_harmonics(cogging: Library) -> None:
    with Instance(cogging) as run:
        run.initialise(**SHAPE)
        for x in np.random.default_rng(1).uniform(-0.2, 0.2, 200):
            run.set({"x": float(x)})
            assert run.get1("F") == pytest.approx(force(x), abs=1e-12)


def test_force_is_the_fall_of_the_energy(cogging: Library) -> None:
    with Instance(cogging) as run:
        run.initialise(**SHAPE)

        def energy(x: float) -> float:
            run.set({"x": x})
            return run.get1("energy")

        for a, b in np.random.default_rng(2).uniform(-0.05, 0.05, (20, 2)):
            work = quad(force, a, b, epsabs=1e-14, limit=200)[0]
            assert energy(float(a)) - energy(float(b)) == pytest.approx(work, abs=1e-14)


def test_no_work_on_a_pitch_and_far_away_is_as_here(cogging: Library) -> None:
    with Instance(cogging) as run:
        run.initialise(**SHAPE)
        for n in (0, 1, -1, 1000):
            run.set({"x": 0.007 + n * PITCH})
            here = run.get("F", "energy")
            if n == 0:
                first = here
            assert here == pytest.approx(first, abs=1e-10)


def test_a_ramp_of_x_ends_where_it_is_told(cogging: Library) -> None:
    with Instance(cogging) as run:
        run.initialise(x=-0.004, **SHAPE)
        assert run.input_derivatives({"x": 0.1}) == OK
        run.step(0.0, 0.3)
        assert run.get1("F") == pytest.approx(force(0.026), abs=1e-12)
        (rate,) = run.output_derivatives("F")
        slope = (force(0.026 + 1e-6) - force(0.026 - 1e-6)) / 2e-6
        assert rate == pytest.approx(0.1 * slope, rel=1e-2)  # a difference over 15 ms


def test_a_mass_swings_about_half_a_pitch_without_losing_energy(build_fmu: Callable[..., Path]) -> None:
    """m = 1 kg, 1 N, 24 mm: w = sqrt(2 pi A / (pitch m)) for small swings; coupled, the error falls with the step."""
    start = {"mass.x0": 0.0121, "mass.F_drive": 0.0, "mass.F_friction": 0.0}
    with System(
        [FmuPart("mass", build_fmu("Mass")), FmuPart("cogging", build_fmu("Cogging"))],
        ["mass.x -> cogging.x", "cogging.F -> mass.F_load"],
        start,
    ) as system:
        result = system.run(stop=1.0, step=1e-4, master="newton")
    t, x, v = (result[name].to_numpy() for name in ("time", "mass.x", "mass.v"))
    w = math.sqrt(2.0 * math.pi / 0.024)
    np.testing.assert_allclose(x, 0.012 + 1e-4 * np.cos(w * t), atol=1e-4 * 2e-3)  # the sine is not quite a line
    energy = v**2 / 2.0 + result["cogging.energy"].to_numpy()
    assert np.ptp(energy) < 1e-4 * (energy[0] + 0.024 / (2.0 * math.pi))
