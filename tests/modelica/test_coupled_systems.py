"""Masses on friction with flanges, against closed forms."""

from __future__ import annotations

from collections.abc import Mapping
from math import atan, pi, sqrt
from typing import Any

import numpy as np
import pytest
from modelica.library import Library, given
from scipy.optimize import brentq
from thorough import nightly

DOMAINS = {
    "Translational": {"mass": "Mass", "m": "m", "x": "s", "v": "v", "force": "Force", "f": "f"},
    "Rotational": {"mass": "Inertia", "m": "J", "x": "phi", "v": "w", "force": "Torque", "f": "tau"},
}


def text(
    friction: str,
    values: Mapping[str, Any],
    *,
    force: str = "0",
    x0: float = 0.0,
    v0: float = 0.0,
    k: float = 0.0,
    belt: float = 0.0,
    pull: float = 0.0,
    more: str = "",
    domain: str = "Translational",
) -> str:
    """Return a mass of 1 on friction against a belt, on a spring with a moving end, with a force."""
    word = DOMAINS[domain]
    mechanics, x, v = f"Modelica.Mechanics.{domain}", word["x"], word["v"]
    start = f"{x}(start = {x0}, fixed = true), {v}(start = {v0}, fixed = true)"
    return f"""model Test
  {mechanics}.Sources.ConstantSpeed belt({v}_fixed = {belt}, {x}(start = 0, fixed = true));
  FrictionFMUs.{domain}.{friction} friction({given(values)});
  {mechanics}.Components.{word["mass"]} mass({word["m"]} = 1, {start});
  {mechanics}.Sources.{word["force"]} force;
  {mechanics}.Components.Spring spring(c = {k});
  {mechanics}.Sources.ConstantSpeed pull({v}_fixed = {pull}, {x}(start = 0, fixed = true));
equation
  connect(belt.flange, friction.flange_a);
  connect(friction.flange_b, mass.flange_a);
  connect(force.flange, mass.flange_b);
  connect(mass.flange_b, spring.flange_a);
  connect(spring.flange_b, pull.flange);
  force.{word["f"]} = {force};
{more}end Test;"""


def switches(result: Any, before: int, after: int) -> np.ndarray:
    """Return the times at which the direction of the motion changes in this way."""
    direction = np.array(result["friction.direction"])
    found = np.flatnonzero((direction[:-1] == before) & (direction[1:] == after))
    return np.array(result.time)[found + 1]


def at(result: Any, name: str, t: float) -> float:
    return float(np.interp(t, result.time, result[name]))


@pytest.mark.parametrize("domain", DOMAINS)
def test_stick_slip_on_a_belt(domain: str, library: Library) -> None:
    """Closed form: stick of 2 (Fs - Fc)/(k V), then an arc of the harmonic motion."""
    Fs, Fc, V = 1.0, 0.6, 0.2
    model = text("Stiction", {"Fs": Fs, "Fc": Fc, "Fv": 0.0}, v0=V, k=1.0, belt=V, domain=domain)
    result = library.run(model, 30.0, 0.01, 1e-10)
    begins, ends = switches(result, 0, -1), switches(result, -1, 0)
    assert begins[0] == pytest.approx(Fs / V, abs=1e-9)
    period = 2.0 * (Fs - Fc) / V + 2.0 * pi - 2.0 * atan((Fs - Fc) / V)
    assert np.diff(begins) == pytest.approx(period, abs=1e-8)
    x, v = (f"mass.{DOMAINS[domain][name]}" for name in "xv")
    assert at(result, x, begins[1]) == pytest.approx(Fs, abs=1e-8)
    assert at(result, x, ends[0]) == pytest.approx(2.0 * Fc - Fs, abs=1e-8)
    assert np.min(result[v]) == pytest.approx(-sqrt((Fs - Fc) ** 2 + V**2), abs=1e-5)


def test_oscillator_that_comes_to_rest(library: Library) -> None:
    """The amplitude drops by 4 Fc/k per cycle; 0.1 is the last deflection that friction does not hold."""
    result = library.run(text("Coulomb", {"Fc": 0.3}, x0=1.0, k=4.0), 20.0, 0.01, 1e-10)
    turns = [-0.85, 0.7, -0.55, 0.4, -0.25, 0.1, 0.05]
    assert [at(result, "mass.s", half * pi / 2.0) for half in range(1, 8)] == pytest.approx(turns, abs=1e-7)
    assert result["mass.s"][-1] == pytest.approx(0.05, abs=1e-7)
    assert result["friction.direction"][-1] == 0


def test_stick_slip_of_a_pulled_mass(library: Library) -> None:
    result = library.run(text("Stiction", {"Fv": 0.0}, k=2.0, pull=0.1), 25.0, 0.01, 1e-10)
    begins, ends = switches(result, 0, 1), switches(result, 1, 0)
    assert begins[0] == pytest.approx(7.5, abs=1e-9)
    assert np.diff(begins) == pytest.approx(5.0 + 2.0 * (pi - atan(0.5 / (0.1 * sqrt(2.0)))) / sqrt(2.0), abs=5e-8)
    assert begins[1] - ends[0] == pytest.approx(5.0, abs=5e-8)


def test_friction_that_falls_with_speed(library: Library) -> None:
    """Leine 1998, with the switching points located by another program: F = Fs/(1 + 3 |v|)."""
    values = {"Fs": 1.0, "Fc": 0.0, "Fv": 0.0, "vs": 1.0 / 3.0, "delta": 1.0, "shape": 1}
    result = library.run(text("Stribeck", values, v0=0.2, k=1.0, belt=0.2), 40.0, 0.01, 1e-10)
    begins, ends = switches(result, 0, -1), switches(result, -1, 0)
    assert np.diff(begins) == pytest.approx(12.0010313, abs=1e-7)
    assert ends[0] - begins[0] == pytest.approx(4.2959995, abs=1e-7)
    assert at(result, "mass.s", ends[0]) == pytest.approx(-0.5410064, abs=1e-7)
    assert np.min(result["mass.v"]) == pytest.approx(-0.8399020, abs=1e-6)


@pytest.mark.parametrize("domain", ["Translational", pytest.param("Rotational", marks=nightly)])
def test_stick_slip_on_bristles(domain: str, library: Library) -> None:
    """Table I and figure 6 of the LuGre paper; the values at 20 s are those of an integration in MuJoCo."""
    result = library.run(text("LuGre", {}, k=2.0, pull=0.1, domain=domain), 20.0, 0.001)
    word = DOMAINS[domain]
    assert result["mass." + word["x"]][-1] == pytest.approx(1.272596, abs=1e-6)
    assert np.max(result["mass." + word["v"]]) == pytest.approx(0.369816, abs=1e-6)
    slips = np.flatnonzero(np.diff(np.sign(np.array(result["mass." + word["v"]]) - 0.05)) > 0.0)
    assert result.time[slips[0]] == pytest.approx(7.540397, abs=1e-3)


def turn(result: Any, k: int) -> float:
    """Return the position at which the velocity changes its sign, from the sample before it."""
    x, v, F = (np.array(result[name]) for name in ("mass.s", "mass.v", "friction.F"))
    i = np.flatnonzero(v[:-1] * v[1:] < 0.0)[k]
    return float(x[i] + v[i] ** 2 / (2.0 * F[i]))


@pytest.mark.parametrize(
    ("law", "values"),
    [
        ("MaxwellSlip", {"N": 3, "k": [3e4, 2e4, 1e4], "W": [0.25, 0.33, 0.42]}),
        ("GMS", {"N": 3, "k": [3e4, 2e4, 1e4], "alpha": [0.25, 0.33, 0.42], "Fs": 1.0, "sigma2": 0.0}),
    ],
)
def test_turning_points_follow_the_rules_of_masing(law: str, values: Mapping[str, Any], library: Library) -> None:
    """The kinetic energy is the work of the virgin curve f(x), later of F_A - 2 f((x_A - x)/2)."""
    k, W = np.array(values["k"]), np.array([0.25, 0.33, 0.42])
    v0 = 6e-3

    def work(x: float) -> float:
        """Work of the virgin curve."""
        bent = np.minimum(x, W / k)
        return float(np.sum(0.5 * k * bent**2 + W * (x - bent)))

    first = brentq(lambda x: work(x) - 0.5 * v0**2, 0.0, 1e-3)
    F_A = float(np.sum(np.minimum(k * first, W)))
    assert np.any(k * first > W)
    assert np.any(k * first < W)
    swing = brentq(lambda d: F_A * d - 4.0 * work(0.5 * d), 1e-7, 1e-3)
    result = library.run(text(law, values, v0=v0), 0.04, 1e-5, 1e-10)
    assert turn(result, 0) == pytest.approx(first, rel=1e-6)
    assert turn(result, 1) == pytest.approx(first - swing, abs=1e-6 * first)


def test_a_mass_is_stopped_by_dahl_friction(library: Library) -> None:
    """The kinetic energy is the work of F = Fc (1 - exp(-sigma x/Fc)) up to the first reversal."""
    v0, a = 1e-2, 1e-5
    distance = brentq(lambda x: x - a * (1.0 - np.exp(-x / a)) - 0.5 * v0**2, 0.0, 1e-3)
    result = library.run(text("Dahl", {}, v0=v0), 0.03, 1e-5, 1e-10)
    assert turn(result, 0) == pytest.approx(distance, rel=1e-6)


def test_break_away_differs_between_the_directions(library: Library) -> None:
    values = {"Fv": 0.0, "asymmetric": True, "Fs_neg": 0.7, "Fc_neg": 0.5, "Fv_neg": 0.0, "offset": 0.1}
    for force, time in (("-time", 0.7 - 0.1), ("time", 1.5 + 0.1)):
        result = library.run(text("Stribeck", values, force=force), 2.0, 0.1, 1e-10)
        begins = np.flatnonzero(np.diff(result["friction.direction"]))[0]
        assert result.time[begins + 1] == pytest.approx(time, abs=1e-9)


def test_a_mass_flies_on_after_the_contact_opens(library: Library) -> None:
    """The normal force is 1 - t: v = 1 - Fc (t - t^2/2) until t = 1, constant afterwards."""
    more = "  friction.Fn = 1 - time;\n"
    model = text("Coulomb", {"Fc": 0.5, "useFn": True}, v0=1.0, more=more)
    result = library.run(model, 2.0, 0.1, 1e-10)
    assert result["mass.s"][-1] == pytest.approx(1.0 - 0.5 * (1.0 / 2.0 - 1.0 / 6.0) + 0.75, abs=1e-9)


def test_a_mass_breaks_away_as_the_normal_force_decreases(library: Library) -> None:
    """It moves from 1.5 (1 - t) = 0.3 on with the acceleration 0.3 - (1 - t), after t = 1 with 0.3."""
    more = "  friction.Fn = 1 - time;\n"
    model = text("Stiction", {"Fv": 0.0, "useFn": True}, force="0.3", more=more)
    result = library.run(model, 2.0, 0.1, 1e-10)
    assert switches(result, 0, 1) == pytest.approx(0.8, abs=1e-9)
    assert result["mass.v"][-1] == pytest.approx(0.04 + 0.3, abs=1e-9)


@pytest.mark.parametrize("v0", [1.0, -1.0])
def test_a_moving_mass_is_stopped(v0: float, library: Library) -> None:
    result = library.run(text("Coulomb", {"Fc": 0.5}, v0=v0), 4.0, 0.1, 1e-10)
    assert result["mass.s"][-1] == pytest.approx(v0, abs=1e-9)  # v0^2/(2 Fc/m)
    assert result["mass.v"][-1] == pytest.approx(0.0, abs=1e-12)
