"""TustinFeedback against numpy's interpolation, and on an axis with cogging."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from observer_loops import follow
from thorough import nightly

from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.lawkit.law import discover_laws
from harness import CallablePart, Port, Result, SeriesPart

LAW = next(law for law in discover_laws(laws_folder()) if law.name == "TustinFeedback")
BuildFmu = Callable[..., Path]
N = 16
RANDOM = np.random.default_rng(1)
LEVEL, COGGING = 1.0 + 0.3 * RANDOM.normal(size=N) ** 2, RANDOM.normal(size=N)
CURVE = {"Fc": 20.4, "Fs": 31.0, "Fv": 203.5, "vs": 2e-3}


@given(st.floats(-0.5, 0.5), st.floats(-0.1, 0.1), st.floats(0.0, 1.0))
def test_it_is_its_formula(x, v, gain):
    place = ((x - 0.01) / 0.03) % 1.0 * N
    level, cogging = (np.interp(place, np.arange(N + 1), np.append(table, table[0])) for table in (LEVEL, COGGING))
    curve = (20.4 + 10.6 * math.exp(-abs(v) / 2e-3)) * float(np.sign(v)) + 203.5 * v
    friction = level * curve if abs(v) >= 5e-4 else 0.0
    tables = {"level": tuple(LEVEL), "cogging": tuple(COGGING)}
    found = LAW.evaluate({**CURVE, **tables, "x": x, "v": v, "gain": gain, "pitch": 0.03, "x0": 0.01, "v_min": 5e-4})
    assert found["F_hat"] == pytest.approx(friction, abs=1e-9)
    assert found["u"] == pytest.approx(gain * (friction + cogging), abs=1e-9)


def test_the_exponent_is_one():
    """A straight line near rest: twice as far along it for twice the speed."""
    found = [LAW.evaluate({"v": v, "Fv": 0.0, "v_min": 0.0})["F_hat"] for v in (1e-6, 2e-6)]
    assert (1.5 - found[1]) / (1.5 - found[0]) == pytest.approx(2.0, rel=1e-2)
    assert LAW.evaluate({"v": 1e-3, "Fv": 0.0})["F_hat"] == pytest.approx(1.0 + 0.5 / math.e, rel=1e-12)


def test_at_rest_only_cogging_is_compensated():
    tables = {"cogging": tuple(COGGING)}
    found = LAW.evaluate({"x": 0.024 * 3 / N, **tables, "v": 0.9e-3})
    assert found["u"] == pytest.approx(COGGING[3], rel=1e-12)
    assert found["F_hat"] == 0.0
    assert set(LAW.evaluate({**tables, "v": 1.0, "enable": 0.0}).values()) == {0.0}


@pytest.mark.parametrize("x", [-1e9, -0.024, -1e-18, 0.0, 0.024, 1e6])
def test_any_position_is_in_the_table(x):
    found = LAW.evaluate({"x": x, "cogging": (2.0,) * N})
    assert found["u"] == pytest.approx(2.0, rel=1e-12)


SERVO = {"Kp": 12e3, "Kd": 190.0, "Ki": 0.0, "m": 1.0}
PITCH, SPEED = 0.024, 0.005


def level_of(table: np.ndarray, x: float) -> float:
    return float(np.interp((x / PITCH) % 1.0 * N, np.arange(N + 1), np.append(table, table[0])))


def on_the_axis(
    build_fmu: BuildFmu, law: dict[str, float], direction: float, *, v0: float = SPEED, forward: bool = False
) -> Result:
    """PID and the law on a linear motor with cogging and friction that changes along it, at constant speed."""

    def forces(t: float, u: np.ndarray, state: np.ndarray) -> float:
        friction = level_of(LEVEL, u[0]) * (1.0 + 0.5 * math.exp(-abs(u[1]) / 1e-3)) * math.tanh(u[1] / 1e-4)
        return -level_of(COGGING, u[0]) - friction

    times = np.array([0.0, 7.0])
    ramp = {"r": direction * SPEED * times, "rd": np.full(2, direction * SPEED)}
    parts = [
        CallablePart("motor", forces, inputs=[Port("x", "m"), Port("v", "m/s")], outputs=[Port("F", "N")]),
        SeriesPart("ramp", times, ramp, {"r": "m", "rd": "m/s"}),
    ]
    wires = ["mass.x -> motor.x", "mass.v -> motor.v", "motor.F -> mass.F_load", "ramp.r -> servo.r"]
    wires += ["ramp.r -> addition.x", "ramp.rd -> addition.v"] if forward else []
    return follow(
        build_fmu,
        "PID",
        SERVO,
        addition=("TustinFeedback", law),
        friction=None,
        reference={"amplitude[1]": 0.0},
        start={"mass.v0": direction * v0},
        others=parts,
        wires=[*wires, "ramp.rd -> servo.rd"],
        stop=7.0,
        inner=2,
    )


def force_at_the_points(result: Result) -> np.ndarray:
    """Mean force at the points of the table, after the first millimetres."""
    x, u = result["mass.x"].to_numpy()[:-1], result["servo.u"].to_numpy()[1:]
    settled = np.abs(x) > 0.006
    places = PITCH / N * np.arange(-40, 40)
    places = places[(np.abs(places) > 0.007) & (places > x.min()) & (places < x.max())]
    order = np.argsort(x[settled])
    found = np.interp(places, x[settled][order], u[settled][order])
    numbers = np.round(places / PITCH * N).astype(int) % N
    return np.array([found[numbers == i].mean() for i in range(N)])


@nightly
def test_tables_found_at_constant_speed_take_the_position_error_away(build_fmu: BuildFmu):
    alone = {sign: on_the_axis(build_fmu, {"gain": 0.0}, sign) for sign in (1.0, -1.0)}
    forces = {sign: force_at_the_points(result) for sign, result in alone.items()}
    friction, cogging = (forces[1.0] - forces[-1.0]) / 2.0, (forces[1.0] + forces[-1.0]) / 2.0
    np.testing.assert_allclose(cogging, COGGING, atol=0.005 * np.ptp(COGGING))
    np.testing.assert_allclose(friction, LEVEL * (1.0 + 0.5 * math.exp(-SPEED / 1e-3)), rtol=0.005)

    law = {f"cogging[{i + 1}]": cogging[i] for i in range(N)} | {f"level[{i + 1}]": friction[i] for i in range(N)}
    helped = on_the_axis(build_fmu, law | {"Fv": 0.0, "Fs": 1.0, "v_min": 1e-3}, 1.0)

    def error(result: Result) -> float:
        late = result["time"].to_numpy() > 1.0
        return float(np.sqrt(np.mean((result["ramp.r"] - result["mass.x"]).to_numpy()[late] ** 2)))

    assert error(helped) < 0.01 * error(alone[1.0])
    # friction alone leaves the cogging
    level_only = {name: value for name, value in law.items() if name.startswith("level")}
    partly = on_the_axis(build_fmu, level_only | {"Fv": 0.0, "Fs": 1.0, "v_min": 1e-3}, 1.0)
    assert error(helped) < 0.2 * error(partly)


@nightly
def test_connected_to_the_reference_it_is_feedforward_of_friction_over_position(build_fmu: BuildFmu):
    """With the true tables: hardly an error is left, and where the axis starts does not change the force."""
    law = {f"cogging[{i + 1}]": COGGING[i] for i in range(N)} | {f"level[{i + 1}]": LEVEL[i] for i in range(N)}
    law |= {"Fc": 1.0, "Fs": 1.5, "vs": 1e-3, "Fv": 0.0}
    helped, slower = (on_the_axis(build_fmu, law, 1.0, v0=v0, forward=True) for v0 in (SPEED, 0.5 * SPEED))
    average = law | {f"level[{i + 1}]": LEVEL.mean() for i in range(N)}
    alone, level = on_the_axis(build_fmu, {"gain": 0.0}, 1.0), on_the_axis(build_fmu, average, 1.0, forward=True)
    late = helped["time"].to_numpy() > 1.0
    left = [
        float(np.sqrt(np.mean((each["ramp.r"] - each["mass.x"]).to_numpy()[late] ** 2)))
        for each in (helped, level, alone)
    ]
    assert left[0] < 0.01 * left[2]
    assert left[0] < 0.1 * left[1]  # friction that does not depend on the position
    assert np.array_equal(helped["addition.u"], slower["addition.u"])
