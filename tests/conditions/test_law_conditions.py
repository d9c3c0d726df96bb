"""Conditions of single laws against recursions, roots and simulations, and those that the documentation names."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from thorough import nightly

from friction_fmus import conditions
from friction_fmus.blocks.catalogue import catalogue, laws_folder
from friction_fmus.conditions import (
    adaptation,
    belt,
    break_away,
    cogging,
    cogging_slope,
    dither_frequency,
    dither_stroke,
    encoder_count,
    fed_back_stiffness,
    prefilter,
    prefilter_match,
    preview,
    pulses,
    slide,
    slide_in_loop,
    sliding_gain,
    super_twisting,
)
from friction_fmus.doctor.roles import known_blocks
from friction_fmus.lawkit.law_files import discover_laws

KNOWN_LAWS = {law.name: law for law in discover_laws(laws_folder())}

TS = 1e-3


@pytest.mark.parametrize("rate", [1e3, 5e4, 1.2e5, 1.4e5, 1e6])
@pytest.mark.parametrize("Ks", [127.0, 1900.0, 2010.0, 2100.0])
def test_adaptation_is_what_its_recursion_does(rate: float, Ks: float) -> None:
    m, s, a, sizes = 1.0, 1.0, 0.0, []
    for _ in range(3000):
        s, a = s - TS / m * (Ks * s + a), a + TS * rate * s
        sizes.append(abs(s) + abs(a) / 1e3)
        if not 1e-200 < sizes[-1] < 1e100:
            break
    assert adaptation(rate, Ks, m, TS).ok == (max(sizes[-20:]) < max(sizes[:20]))


@pytest.mark.parametrize("gains", [(12e3, 190.0, 250e3), (12e3, 5.0, 0.0), (12e3, 7.0, 0.0), (30.0, 190.0, 4e6)])
def test_prefilter_is_what_the_law_does(gains: tuple[float, float, float]) -> None:
    """The shift that a constant force makes stays bounded, or grows without bound."""
    law, (Kp, Kd, Ki) = KNOWN_LAWS["Prefilter"], gains
    state = {"shift": 0.0, "integral": 0.0}
    values = {"Kp": Kp, "Kd": Kd, "Ki": Ki, "m": 1.0, "rdd": 1.0}
    largest = []
    for _ in range(4000):
        found = law.evaluate({**values, **state})
        state = {key: found[key] for key in state}
        largest.append(abs(found["r_out"]))
        if largest[-1] > 1e6:
            break
    assert prefilter(Kp, Kd, Ki, TS).ok == (largest[-1] < 1e6)


def test_prefilter_names_the_gain_that_differs() -> None:
    assert prefilter_match((12e3, 190.0, 0.0, TS), (12e3, 190.0, 0.0, TS)).ok
    other = prefilter_match((12e3, 190.0, 1.0, TS), (12e3, 600.0, 1.0, TS))
    assert (other.ok, other.value, other.bound) == (False, 190.0, 600.0)
    assert other.change == "set Kd of the prefilter to 600"


def test_slides_are_those_of_an_integrator() -> None:
    """Newton's law with Coulomb friction, with and without a PD controller after the pulse."""
    Fp, Fc, tp, m, Kp, Kd, e = 5.0, 1.0, 5e-3, 0.5, 3e3, 40.0, 2e-4

    def stops(_: float, y: np.ndarray) -> float:
        return float(y[1])

    stops.terminal, stops.direction = True, -1.0  # type: ignore[attr-defined]
    start = [(Fp - Fc) * tp**2 / (2 * m), (Fp - Fc) * tp / m]
    for p, d in ((0.0, 0.0), (Kp, Kd)):
        found = solve_ivp(
            lambda _, y, p=p, d=d: [y[1], (-Fc - p * (y[0] - e) - d * y[1]) / m],
            (0.0, 1.0),
            start,
            events=stops,
            rtol=1e-9,
            atol=1e-14,
        ).y[0, -1]
        closed = slide(Fp, Fc, 1.5, tp, m) if not p else None
        integrated = slide_in_loop(np.array([e]), np.array([Fp]), Fc, 1.5, tp, m, p, d)[0]
        assert integrated == pytest.approx(found, rel=2e-3)
        assert closed is None or closed == pytest.approx(found, rel=1e-6)
    assert slide(1.4, 1.0, 1.5, tp, m) == 0.0


def test_pulses_too_weak_too_strong_and_right() -> None:
    e = np.array([1e-4])
    exact = (1.0 + math.sqrt(1.0 + 8.0 * 1e-4 / 25e-6)) / 2.0
    assert pulses(e, np.array([exact]), 1.0, 1.0, 5e-3, 1.0).value == pytest.approx(1.0)
    weak = pulses(e, np.array([1.2]), 1.0, 1.5, 5e-3, 1.0)
    assert (weak.ok, weak.bound) == (False, 0.0)
    assert not pulses(e, np.array([2.0 * exact]), 1.0, 1.0, 5e-3, 1.0).ok


def test_cogging_slope_is_that_of_the_force() -> None:
    amplitude, phase = [1.0, 0.5, 0.0, 0.3, 0.0, 0.0], [0.3, 1.0, 0.0, 2.0, 0.0, 0.0]
    x = np.linspace(0.0, 0.024, 200_001)
    waves = enumerate(zip(amplitude, phase, strict=True), 1)
    F = sum(A * np.sin(2 * np.pi * k * x / 0.024 + phi) for k, (A, phi) in waves)
    slope = cogging_slope(0.024, amplitude, phase)
    assert slope == pytest.approx(float(np.max(np.gradient(F, x))), rel=1e-4)
    assert cogging(1.01 * slope, slope).ok
    assert not cogging(0.99 * slope, slope).ok


@pytest.mark.parametrize("v", [2e-4, 7e-4, 2e-3, 1.0])
@pytest.mark.parametrize("delta", [0.5, 1.0, 2.0, 20.0])
def test_the_fall_at_the_speed_of_a_belt_is_that_of_the_curve(v: float, delta: float) -> None:
    speeds = v * np.array([1.0 - 1e-6, 1.0 + 1e-6])
    g = 1.0 + 0.5 * np.exp(-((speeds / 1e-3) ** delta))
    fall = -float(np.diff(g)[0] / np.diff(speeds)[0])
    assert belt(0.1, 1.0, 1.5, 1e-3, delta, -v).bound == pytest.approx(fall, rel=1e-3, abs=1e-6)
    assert belt(0.1, 1.5, 1.5, 1e-3, delta, v).bound == 0.0


def test_preview_is_the_share_that_the_series_leaves() -> None:
    assert preview(-5.83, 12.0).value == pytest.approx(5.83**-12)
    short = preview(1.5, 10.0)
    assert not short.ok
    assert "preview of at least 18 samples" in short.change
    assert preview(1.5, 18.0).ok
    assert preview(0.0, 1.0).ok
    assert "inside the unit circle into inner" in preview(0.5, 12.0).change


@nightly
def test_super_twisting_follows_a_force_of_a_rate_up_to_its_gain_c2_L() -> None:
    """A ramp of the rate L on a free mass: the error stays, or grows without end."""
    law, L = KNOWN_LAWS["ImplicitSuperTwisting"], 500.0
    for c2, rate in ((1.1, 1.0), (0.8, 1.0), (0.8, 0.7)):
        x, v, w = 0.0, 0.0, 0.0
        for k in range(3000):
            found = law.evaluate({"x": x, "v": v, "w": w, "L": L, "c2": c2, "u_min": -1e9, "u_max": 1e9})
            w = found["w"]
            force = found["u"] - rate * L * k * TS
            x, v = x + TS * v + TS**2 / 2 * force, v + TS * force
        assert (c2 * L >= rate * L) == (abs(v) < 1e-2)
    assert super_twisting(1.5, 1.1).ok
    assert not super_twisting(1.5, 0.9).ok
    assert not super_twisting(1.4, 1.1).ok


def test_bounds_of_one_number() -> None:
    assert break_away(1.6, 1.5).ok
    assert not break_away(1.4, 1.5).ok
    assert sliding_gain(1.5, 1.5).ok
    assert not sliding_gain(1.2, 1.5).ok
    assert fed_back_stiffness(1e5, 1.1e5).ok
    assert not fed_back_stiffness(1.2e5, 1.1e5).ok
    assert dither_frequency(200.0, 1e-4).ok
    assert not dither_frequency(5000.0, 1e-4).ok
    # 50 N at 200 Hz move 1 kg by 31.7 um
    assert dither_stroke(50.0, 200.0, 1.0, 1.5, 1e5).value == pytest.approx(31.66e-6, rel=1e-3)
    # 600 N.s/m on counts of 3 um in 1 ms
    assert encoder_count(3e-6, 12e3, 600.0, 1.5, TS).value == pytest.approx(1.836)
    assert encoder_count(3e-6, 12e3, 600.0, 1.5, math.inf).ok


def test_every_block_of_the_doctor_has_conditions_that_exist(monkeypatch: pytest.MonkeyPatch) -> None:
    """In the table of the documentation."""
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / "docs")
    from needs import CONDITIONS

    assert CONDITIONS.keys() <= catalogue().keys()
    assert {
        name for name, part in known_blocks().items() if part.law or part.drive or part.cogging
    } <= CONDITIONS.keys()
    for names in CONDITIONS.values():
        for name in names:
            assert name in conditions.__all__
            assert (getattr(conditions, name).__doc__ or "").split("\n\n")[0].endswith(".")
