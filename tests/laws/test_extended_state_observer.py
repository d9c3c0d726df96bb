"""ExtendedStateObserver against its poles, its lag in closed form, a recursion, and in the loop."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from observer_loops import follow, rms_error, run

from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.lawkit.law import discover_laws

LAW = next(law for law in discover_laws(laws_folder()) if law.name == "ExtendedStateObserver")
STATES = ("x_hat", "v_hat", "F_est")
BuildFmu = Callable[..., Path]


@pytest.mark.parametrize(("m", "wo", "Ts"), [(1.0, 400.0, 1e-3), (3.0, 50.0, 2e-3), (0.2, 1500.0, 1e-3)])
def test_all_poles_of_the_observer_are_at_p(m, wo, Ts):
    columns = []
    for unit in STATES:
        found = LAW.evaluate({unit: 1.0, "running": 1.0, "wo": wo, "m": m, "Ts": Ts})
        columns.append([found[name] for name in STATES])
    p = math.exp(-wo * Ts)
    assert np.poly(np.array(columns).T) == pytest.approx([1.0, -3.0 * p, 3.0 * p**2, -(p**3)], rel=1e-8)


@pytest.mark.parametrize("slope", [0.0, 5.0])
def test_the_estimate_lags_behind_a_ramp_as_in_the_closed_form(slope):
    """A mass under a held force and a friction force F0 + c t, integrated exactly."""
    m, wo, Ts, F0 = 2.0, 300.0, 1e-3, 0.7
    u = np.random.default_rng(1).normal(size=400)
    x = v = 0.0
    samples = [{"x": 0.0}]
    for k in range(400):
        F = F0 + slope * k * Ts
        x += Ts * v + Ts**2 / 2.0 * (u[k] - F) / m - slope * Ts**3 / (6.0 * m)
        v += Ts * (u[k] - F) / m - slope * Ts**2 / (2.0 * m)
        samples.append({"x": x, "u_prev": u[k]})
    found = run(LAW, samples, m=m, wo=wo, Ts=Ts)[-1]
    p = math.exp(-wo * Ts)
    lag = slope * Ts * (1.5 * (1.0 + p) / (1.0 - p) - 0.5)
    assert F0 + slope * 400 * Ts - found["F_hat"] == pytest.approx(lag, rel=1e-6, abs=1e-8)
    assert slope == 0.0 or lag == pytest.approx(3.0 * slope / wo, rel=0.1)
    assert found["v_est"] == pytest.approx(v, abs=1e-9) or slope > 0.0


def test_the_controller_is_its_formula_and_starts_at_rest():
    given = {"r": 0.3, "rd": 0.2, "rdd": -0.5, "x": 0.1, "u_prev": 7.0, "m": 2.0, "wc": 10.0}
    found = LAW.evaluate(given)
    assert found["u"] == pytest.approx(2.0 * (100.0 * 0.2 + 20.0 * 0.2 - 0.5), rel=1e-12)
    assert (found["x_hat"], found["v_hat"], found["F_est"], found["running"]) == (0.1, 0.0, 0.0, 1.0)
    # afterwards with the estimates, of which gain is compensated
    later = {"running": 1.0, "x_hat": 0.05, "v_hat": 0.1, "F_est": 3.0, "gain": 0.5, "u_min": -1e5}
    found = LAW.evaluate(given | later)
    inertia = 2.0 * (100.0 * (0.3 - found["x_hat"]) + 20.0 * (0.2 - found["v_est"]) - 0.5)
    assert found["F_hat"] == found["F_est"]
    assert found["u"] == pytest.approx(inertia + 0.5 * found["F_hat"], rel=1e-12)
    assert LAW.evaluate(given | later | {"reset": 1.0}) == LAW.evaluate(given | {"gain": 0.5, "u_min": -1e5})


def test_disabled_it_is_silent_and_comes_back_fresh():
    on = [{"r": 1e-3, "x": 2e-3 * k, "u_prev": 1.0} for k in range(5)]
    found = run(LAW, [*on, {"x": 0.5, "enable": 0.0}, {"r": 0.5, "x": 0.5}])
    assert set(found[5].values()) == {0.0}
    assert found[6]["u"] == 0.0


def test_saturation_does_not_wind_it_up():
    """A far target and a weak actuator: with the force that was applied the estimate of no friction stays none."""
    x = v = u = largest = 0.0
    states = {variable: 0.0 for variable in (*STATES, "running")}
    for _ in range(400):
        found = LAW.evaluate({**states, "r": 1.0, "x": x, "u_prev": u, "u_min": -2.0, "u_max": 2.0})
        states = {name: found[name] for name in states}
        u = found["u"]
        x, v = x + 1e-3 * v + 0.5e-6 * u, v + 1e-3 * u
        largest = max(largest, abs(found["F_hat"]))
    assert largest < 1e-9


SINE = {"amplitude[1]": 1e-2, "frequency[1]": 1.0}


def test_the_estimate_takes_friction_out_of_the_tracking_error(build_fmu: BuildFmu):
    alone = rms_error(follow(build_fmu, "ExtendedStateObserver", {"gain": 0.0}, reference=SINE), 1.0)
    errors = [
        rms_error(follow(build_fmu, "ExtendedStateObserver", {"wo": wo}, reference=SINE), 1.0)
        for wo in (200.0, 400.0, 800.0)
    ]
    assert errors[2] < errors[1] < errors[0] < 0.3 * alone


def test_the_estimate_is_the_friction_of_the_plant(build_fmu: BuildFmu):
    result = follow(build_fmu, "ExtendedStateObserver", {"wo": 800.0}, reference=SINE, stop=1.0)
    t = result["time"].to_numpy()
    # away from the reversals at 1/4 and 3/4 of the period
    away = (t > 0.1) & (np.abs(np.cos(2.0 * np.pi * t)) > 0.3)
    difference = result["servo.F_hat"].to_numpy()[1:] - result["friction.F"].to_numpy()[:-1]
    assert np.abs(difference[away[1:]]).max() < 0.02
