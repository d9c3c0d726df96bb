"""Dither: its waveforms, and the friction that a shaken contact shows on average."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import sawtooth, square
from thorough import some

from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.lawkit.law import discover_laws
from harness import CallablePart, FmuPart, System

DITHER = next(law for law in discover_laws(laws_folder()) if law.name == "Dither")
BuildFmu = Callable[..., Path]


def run(samples: list[dict[str, float]], **parameters: float) -> list[dict[str, float]]:
    phase = 0.0
    results = []
    for sample in samples:
        results.append(DITHER.evaluate({**parameters, "phase": phase, **sample}))
        phase = results[-1]["phase"]
    return results


def waves(shape: float, phase: np.ndarray) -> np.ndarray:
    """The waveforms by scipy; its sawtooth begins at -1, a quarter of a period before a rising zero."""
    angle = 2.0 * np.pi * phase
    return [np.sin(angle), square(angle), sawtooth(angle + np.pi / 2.0, 0.5)][int(shape)]


@pytest.mark.parametrize("shape", [0.0, 1.0, 2.0])
def test_waveforms(shape):
    Ts, frequency = 1e-4, 37.3
    found = run([{"f": 2.0}] * 3000, Ts=Ts, frequency=frequency, Ad=5.0, shape=shape, gain=0.5)
    phase = frequency * Ts * np.arange(3000) % 1.0
    away = np.abs((2.0 * phase + 0.5) % 1.0 - 0.5) > 1e-9  # from the jumps of the square
    u = np.array([result["u"] for result in found])
    assert u[away] == pytest.approx((2.0 + 2.5 * waves(shape, phase))[away], abs=1e-9)


def test_limits_reset_and_disable():
    # a quarter of a period each sample
    parameters = {"Ts": 1e-3, "frequency": 250.0, "Ad": 5.0, "u_min": -4.0, "u_max": 3.0}
    found = run([{}] * 4, **parameters)
    assert [result["u"] for result in found] == pytest.approx([0.0, 3.0, 0.0, -4.0], abs=1e-12)
    assert [result["u_sat"] for result in found] == [0.0, 1.0, 0.0, -1.0]
    found = run([{}, {"reset": 1.0}, {}, {"enable": 0.0, "f": 2.0}, {"f": 2.0}, {"f": 2.0}], **parameters)
    assert [result["u"] for result in found] == [0.0, 0.0, 3.0, 0.0, 2.0, 3.0]
    assert found[3] == {"u": 0.0, "u_sat": 0.0, "phase": 0.0}
    assert run([{"f": 2.0}], gain=0.0)[0]["u"] == 2.0


# ---- the friction that a shaken contact shows on average -----------------------------------------------------------

MEANS = {
    0.0: lambda ratio: 2.0 / math.pi * math.asin(ratio),
    1.0: lambda ratio: 0.0,
    2.0: lambda ratio: ratio,
}


def mean_friction(friction: Path, dither: Path, shape: float, v0: float, A: float, period: float, **start: float):
    """Mean force of a friction block that is moved at v0 + A w, over the last of some periods."""
    step = period / 2000.0
    parts = [
        FmuPart("dither", dither),
        CallablePart("motion", lambda t, u, x: u, ["u"], ["v"]),  # a force becomes a velocity
        FmuPart("friction", friction),
    ]
    values = {"dither.f": v0, "dither.Ad": A, "dither.frequency": 1.0 / period, "dither.shape": shape}
    values |= {"dither.Ts": step} | {f"friction.{name}": value for name, value in start.items()}
    with System(parts, ["dither.u -> motion.u", "motion.v -> friction.v"], values) as system:
        result = system.run(stop=20.0 * period, step=step, record=["friction.F"])
    return float(result["friction.F"].to_numpy()[-2000:].mean())


@pytest.mark.parametrize("shape", MEANS)
@pytest.mark.parametrize("ratio", some([0.0, 0.2, -0.7], [-0.7]))
def test_coulomb_friction_is_smoothed_as_the_closed_form_says(build_fmu, shape, ratio):
    found = mean_friction(build_fmu("Coulomb"), build_fmu("Dither"), shape, ratio * 0.04, 0.04, 5e-3, Fc=3.0, F_ext=0.0)
    # of 2000 samples a period one or two have the other sign
    assert found == pytest.approx(3.0 * MEANS[shape](ratio), abs=3.0 * 2e-3)


@pytest.mark.parametrize("stroke", [1e-3, 1e-7])
def test_bristles_are_smoothed_only_by_a_stroke_beyond_presliding(build_fmu, stroke):
    """LuGre with g/sigma0 = 10 um; if the stroke is far below, z is constant over a period: F = g v0 / mean |v|."""
    A, v0 = 0.04, 0.01
    period = 2.0 * math.pi * stroke / A
    lugre = {"sigma0": 1e5, "sigma1": 0.0, "sigma2": 0.0, "Fc": 1.0, "Fs": 1.0}
    if stroke < 1e-5:
        # the periods of the run are too short to slide in: start where the mean is
        speed = 2.0 / math.pi * (v0 * math.asin(v0 / A) + math.sqrt(A**2 - v0**2))
        expected = v0 / speed
        lugre["z"] = expected * 1e-5
    else:
        expected = MEANS[0.0](v0 / A)
    found = mean_friction(build_fmu("LuGre"), build_fmu("Dither"), 0.0, v0, A, period, **lugre)
    assert found == pytest.approx(expected, rel=0.02)
    assert MEANS[0.0](v0 / A) < 0.7 * v0 / (2.0 * A / math.pi)  # the two differ


def test_a_shaken_mass_creeps_where_friction_would_hold_it(build_fmu):
    """A constant force of 0.3 Fc and a sine of 50 N at 200 Hz on 1 kg: v0 = A sin(pi/2 0.3), A = Ad/(2 pi f m)."""
    step = 1e-5
    parts = [
        FmuPart("dither", build_fmu("Dither")),
        FmuPart("mass", build_fmu("Mass")),
        FmuPart("friction", build_fmu("Coulomb")),
    ]
    wires = ["dither.u -> mass.F_drive", "mass.v -> friction.v", "mass.F_ext -> friction.F_ext"]
    A = 50.0 / (2.0 * math.pi * 200.0)
    values = {"dither.f": 0.3, "dither.Ts": step, "mass.F_load": 0.0, "mass.v_support": 0.0}
    values |= {"mass.v0": -A}  # the sine's force drives the velocity -A cos
    with System(parts, [*wires, "friction.F -> mass.F_friction"], values) as system:
        shaken = system.run(stop=2.0, step=step, record=["mass.x"])["mass.x"].to_numpy()
        still = system.with_start({"dither.gain": 0.0, "mass.v0": 0.0}).run(stop=0.1, step=step, record=["mass.x"])
    velocity = (shaken[-1] - shaken[100_000]) / 1.0
    assert velocity == pytest.approx(A * math.sin(0.15 * math.pi), rel=0.05)
    assert np.abs(still["mass.x"].to_numpy()).max() < 1e-12
