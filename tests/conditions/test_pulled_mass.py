"""Stick-slip of a mass that a spring pulls: closed forms, an independent integration, and the LuGre contact."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from thorough import nightly

from friction_fmus import fmu
from friction_fmus.cli.main import main
from friction_fmus.conditions import critical_speed, pulled_mass
from harness import System

EXAMPLE = Path(__file__).parents[2] / "examples" / "stick_slip.toml"


def rests_again(c: float, v: float, *, m: float = 1.0, k: float = 2.0, drop: float = 0.5) -> bool:
    """Whether the mass comes to rest after it broke away, by the exact solution on a fine grid."""
    s = np.roots([m, c, k])
    t = np.linspace(0.0, 2.2 * math.pi * math.sqrt(m / k), 20001)[1:]
    # w = A exp(s1 t) + B exp(s2 t) with w(0) = V and w'(0) = -(Fs - Fc)/m
    a, b = np.linalg.solve(np.array([[1.0, 1.0], s]), np.array([v, -drop / m]))
    return bool((a * np.exp(s[0] * t) + b * np.exp(s[1] * t)).real.max() >= v * (1.0 - 1e-9))


@pytest.mark.parametrize("c", [0.01, 0.1, 0.4, 1.0, 2.0])
def test_the_critical_speed_of_a_sudden_drop(c: float) -> None:
    critical = critical_speed(1.0, 2.0, c, 1.0, 1.5, None, 2.0)
    assert rests_again(c, 0.999 * critical)
    assert not rests_again(c, 1.001 * critical)


def test_the_critical_speed_for_small_damping_is_that_of_the_literature() -> None:
    """An energy balance over one cycle: (Fs - Fc) / sqrt(4 pi zeta k m) with zeta = c / (2 sqrt(k m))."""
    m, k, c = 3.0, 700.0, 1e-3
    zeta = c / (2.0 * math.sqrt(k * m))
    expected = 0.5 / math.sqrt(4.0 * math.pi * zeta * k * m)
    assert critical_speed(m, k, c, 1.0, 1.5, None, 2.0) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("c", [0.01, 0.4, 2.0])
def test_a_small_stribeck_velocity_is_a_sudden_drop(c: float) -> None:
    sudden = critical_speed(1.0, 2.0, c, 1.0, 1.5, None, 2.0)
    assert critical_speed(1.0, 2.0, c, 1.0, 1.5, 1e-6, 2.0) == pytest.approx(sudden, rel=0.01)


def test_limits_of_the_critical_speed() -> None:
    assert critical_speed(1.0, 2.0, 0.0, 1.0, 1.5, 1e-3, 2.0) == math.inf
    assert critical_speed(1.0, 2.0, 3.0, 1.0, 1.5, 1e-3, 2.0) == 0.0  # more than the critical damping 2 sqrt(k m)
    assert critical_speed(1.0, 2.0, 0.1, 1.0, 1.0, 1e-3, 2.0) == 0.0


def test_every_remedy_ends_the_cycle_and_less_does_not() -> None:
    base = {"m": 1.0, "k": 2.0, "damping": 0.4, "Fc": 1.0, "Fs": 1.5, "vs": None, "delta": 2.0, "v": 0.1}
    found = pulled_mass(**base)  # type: ignore[arg-type]
    assert not found.ok
    words = found.change.replace(",", "").split()
    speed, stiffness, damping = (float(words[words.index(word) + 2]) for word in ("faster", "stiffer", "damping"))
    drop = float(words[words.index("below") + 1])
    for key, value, sense in (("v", speed, 1), ("k", stiffness, 1), ("damping", damping, 1), ("Fs", 1.0 + drop, -1)):
        more = 1.0 + sense * (0.01 if key != "Fs" else 0.003)
        assert pulled_mass(**base | {key: value * more}).ok, key  # type: ignore[arg-type]
        assert not pulled_mass(**base | {key: value / more}).ok, key  # type: ignore[arg-type]


def test_a_mass_far_below_the_stribeck_velocity_creeps() -> None:
    assert pulled_mass(1.0, 2.0, 0.4, 1.0, 1.5, 1e-3, 2.0, 1e-8).ok
    assert not pulled_mass(1.0, 2.0, 0.4, 1.0, 1.5, 1e-3, 2.0, 1e-3).ok


def least_speed(start: dict[str, float]) -> float:
    """The lowest speed of the example after 60 % of 40 s."""
    with System.from_toml(EXAMPLE, resolve=fmu) as system:
        assert system.experiment is not None
        longer = replace(system.experiment, stop=40.0)
        other = System(system.parts.values(), system.wires, {**system.start, **start}, longer, system.name)
        result = other.run()
    t, v = result["time"].to_numpy(), result["mass.v"].to_numpy()
    return float(np.abs(v[t > 24.0]).min())


@pytest.mark.parametrize(
    ("start", "sticks"),
    [
        ({}, True),
        pytest.param({"mass.v_support": -0.1}, True, marks=nightly),
        pytest.param({"mass.v_support": 0.16}, True, marks=nightly),
        ({"mass.v_support": 0.2}, False),
        pytest.param({"mass.d": 0.35}, False, marks=nightly),
        ({"friction.Fs": 1.25}, False),
        pytest.param({"mass.k": 10.0}, True, marks=nightly),
    ],
)
def test_the_doctor_says_of_the_first_example_that_it_sticks_and_slips(
    start: dict[str, float], sticks: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    values = [text for name, value in start.items() for text in ("--set", f"{name}={value}")]
    assert main(["doctor", str(EXAMPLE), *values]) == 0  # it may be meant to
    assert ("stick-slip cycle (mass, friction)" in capsys.readouterr().out) == sticks
    assert (least_speed(start) < 0.05 * abs(start.get("mass.v_support", 0.1))) == sticks
