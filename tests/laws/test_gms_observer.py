"""GMSObserver against the friction block GMS, in closed loops, and on a measured record."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from observer_loops import follow, rms_error
from scipy.optimize import nnls
from shell.instance import Instance, load
from thorough import few, nightly

from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.data import load_tribometer
from friction_fmus.lawkit.law import discover_laws

TS = 1e-3
LAW = next(law for law in discover_laws(laws_folder()) if law.name == "GMSObserver")
BuildFmu = Callable[..., Path]
speeds = st.lists(st.one_of(st.just(0.0), st.floats(-3e-2, 3e-2)), min_size=40, max_size=40)
stiffnesses = st.lists(st.one_of(st.just(0.0), st.floats(10.0, 1e5)), min_size=10, max_size=10)
shares = st.lists(st.one_of(st.just(0.0), st.floats(0.01, 1.0)), min_size=9, max_size=9)


@pytest.fixture(scope="module")
def block(build_fmu: BuildFmu) -> Callable[[str], Path]:
    return lambda name: load(build_fmu(name))


def run(samples: Iterable[Mapping[str, Any]], **values: Any) -> list[dict[str, Any]]:
    """Outputs and next states of consecutive samples, by casadi; ``values`` are parameters and first states."""
    states = {name: values.pop(name, (0.0,) * 10) for name in ("Fi", "slipping")} | {"way": values.pop("way", 0.0)}
    results: list[dict[str, Any]] = []
    for sample in samples:
        results.append(LAW.evaluate({**values, **states, **sample}))
        states = {name: results[-1][name] for name in states}
    return results


@settings(max_examples=few(60), deadline=None, derandomize=True, database=None)
@given(speeds, stiffnesses, shares, st.integers(1, 10), st.floats(0.0, 1e4))
def test_without_injection_it_is_the_block_for_any_of_its_parameters(block, v, k, alpha, N, C):
    """The velocity is constant between samples, with reversals and rests."""
    shared = {"N": N, "C": C, "sigma2": 0.7, "Fc": 1.2, "Fs": 2.0, "vs": 5e-3, "delta": 1.3}
    shared |= {f"k[{i + 1}]": value for i, value in enumerate(k)}
    shared |= {f"alpha[{i + 1}]": value for i, value in enumerate([0.3, *alpha])}
    with Instance(block("GMS")) as contact, Instance(block("GMSObserver")) as law:
        contact.initialise(**shared)
        law.initialise(Ts=TS, u_min=-1e9, u_max=1e9, **shared)
        for j, speed in enumerate(v):
            contact.set({"v": speed})
            law.set({"v": speed})
            law.step(j * TS, TS)
            assert law.get1("F_hat") == pytest.approx(contact.get1("F"), abs=1e-9)
            contact.step(j * TS, TS)
            names = [f"Fi[{i + 1}]" for i in range(N)]
            assert law.get(*names) == pytest.approx(contact.get(*names), abs=1e-9)


def test_a_wrong_start_is_forgotten_when_each_element_has_slipped(block):
    """The last element reaches its level after alpha Fs / k + its wrong force / k; then both are at their levels."""
    stiffnesses = [28e3, 15e3, 10e3, 8e3, 6.5e3, 5.3e3, 4.3e3, 3.5e3, 2.8e3, 2.1e3]
    speed, wrong = 1e-2, -0.05
    path = max((0.1 * 1.5 - wrong) / k for k in stiffnesses)
    with Instance(block("GMS")) as contact, Instance(block("GMSObserver")) as law:
        contact.initialise(v=speed, C=1e4)
        law.initialise(Ts=TS, v=speed, C=1e4, u_min=-1e9, u_max=1e9, **{f"Fi[{i + 1}]": wrong for i in range(10)})
        errors = []
        for j in range(math.ceil(path / (speed * TS)) + 5):
            law.step(j * TS, TS)
            errors.append(abs(law.get1("F_hat") - contact.get1("F")))
            contact.step(j * TS, TS)
    assert errors[0] == pytest.approx(-10 * wrong, rel=1e-9)
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 1e-9


@nightly
def test_at_rest_injection_loads_the_elements_up_to_static_friction_and_no_further():
    """Stuck, dF/dt = k_e e times the stiffnesses of what sticks; in the end the sum is Fs at w = k_e e << vs."""
    e, k_e = 1e-6, 0.5
    found = run([{"r": e}] * 4000, k_e=k_e, Ts=TS)
    rate = k_e * e * (28e3 + 15e3 + 10e3 + 8e3 + 6.5e3 + 5.3e3 + 4.3e3 + 3.5e3 + 2.8e3 + 2.1e3)
    assert found[10]["F_hat"] == pytest.approx(10 * TS * rate, rel=1e-9)
    settled = run([{"r": e}] * 10, k_e=100.0 * k_e, Ts=1.0)
    S = 1.0 + 0.5 * math.exp(-((100.0 * k_e * e / 1e-3) ** 2))
    assert settled[-1]["F_hat"] == pytest.approx(S, rel=1e-9)


def test_a_limit_winds_nothing_up():
    """After 10 and after 1000 samples at the limit the elements hold S, and the way back is the same."""
    ways = []
    for samples in (10, 1000):
        found = run([{"r": 1e-3}] * samples + [{"r": -1e-3}] * 20, k_e=10.0, Ts=TS, u_max=0.4)
        assert found[samples]["u_sat"] == 1.0
        assert found[samples]["F_hat"] <= 1.5
        ways.append([result["F_hat"] for result in found[samples:]])
    assert ways[0][-1] < -0.9
    assert ways[1] == pytest.approx(ways[0], abs=1e-6)


def test_reset_and_enable():
    busy = [{"v": 1e-3}] * 5
    found = run([*busy, {"v": 1e-3, "reset": 1.0}, {"v": 1e-3}])
    fresh = run([{"v": 1e-3}])[0]
    assert found[4]["Fi"][0] != 0.0
    assert found[5]["u"] == fresh["u"]
    assert found[6] == fresh
    off = run([*busy, {"v": 1.0, "enable": 0.0}, {"v": 1e-3}])
    assert {key: off[5][key] for key in ("u", "F_hat", "u_sat", "way")} == dict.fromkeys(
        ("u", "F_hat", "u_sat", "way"), 0.0
    )
    assert off[5]["Fi"] == off[5]["slipping"] == (0.0,) * 10
    assert off[6] == fresh


# ---- in the loop


def servo(w: float) -> dict[str, float]:
    """PID with three poles at w rad/s, for 1 kg."""
    return {"Kp": 3.0 * w**2, "Kd": 3.0 * w, "Ki": w**3, "m": 1.0}


@nightly
@pytest.mark.parametrize(("amplitude", "left"), [(3e-5, 0.01), (5e-3, 0.025)])
def test_the_tracking_error_and_the_error_of_the_estimate_are_small(
    build_fmu: BuildFmu, amplitude: float, left: float
) -> None:
    """In presliding and in sliding; the friction of the simulated axis is the estimate's reference."""
    sine = {"amplitude[1]": amplitude, "frequency[1]": 1.0}
    alone = follow(build_fmu, "PID", servo(63.0), reference=sine, friction="GMS", Ts=0.5e-3)
    helped = follow(
        build_fmu, "PID", servo(63.0), reference=sine, friction="GMS", Ts=0.5e-3, addition=("GMSObserver", {})
    )
    assert rms_error(helped, 1.0) < left * rms_error(alone, 1.0)
    late = helped["time"].to_numpy() >= 1.0
    real, estimated = (helped[name].to_numpy()[late] for name in ("friction.F", "addition.F_hat"))
    assert np.sqrt(np.mean((estimated - real) ** 2)) < 0.1 * np.sqrt(np.mean(real**2))


@pytest.mark.parametrize(("scale", "best", "left"), [(1.0, 20.0, 0.5), (0.5, 100.0, 0.2)])
def test_injection_reduces_the_error_up_to_some_gain(
    build_fmu: BuildFmu, scale: float, best: float, left: float
) -> None:
    """With the exact model, and with nine of ten elements at half their stiffness; 400 1/s is too much for both."""
    model = {f"k[{i + 1}]": scale * k for i, k in enumerate((28e3, 15e3, 10e3, 8e3, 6.5e3, 5.3e3, 4.3e3, 3.5e3, 2.8e3))}
    errors = [
        rms_error(
            follow(
                build_fmu,
                "PID",
                servo(63.0),
                reference={"amplitude[1]": 3e-5, "frequency[1]": 1.0},
                friction="GMS",
                Ts=0.5e-3,
                addition=("GMSObserver", model | {"k_e": k_e}),
            ),
            1.0,
        )
        for k_e in (0.0, best, 400.0)
    ]
    assert errors[1] < left * errors[0]
    assert errors[2] > errors[0]


# ---- a measured record


@nightly
def test_on_the_tribometer_it_estimates_friction_better_than_dahl() -> None:
    """Independent fits leave 12 % of the rms friction with Dahl and 4.4 % with four Maxwell elements."""
    record, Ts = load_tribometer(), 5e-3
    q, friction = record.column("q"), record.column("friction")
    fitted, checked = ((record.t >= a) & (record.t < b) for a, b in ((60.0, 90.0), (100.0, 120.0)))

    def play(path: np.ndarray, deflection: float) -> np.ndarray:
        found, z = np.empty_like(path), 0.0
        for i, dx in enumerate(np.diff(path, prepend=path[0])):
            z = min(max(z + dx, -deflection), deflection)
            found[i] = z / deflection
        return found

    deflections = np.geomspace(4e-6, 1.2e-4, 10)
    late = slice(1500, None)  # a stroke takes less: the state at the start is forgotten
    columns = np.column_stack([play(q[fitted], d) for d in deflections])
    levels, _ = nnls(columns[late], friction[fitted][late])
    levels = np.maximum(levels, 1e-9)
    total = float(levels.sum())
    values: dict[str, Any] = {"Fc": total, "Fs": total, "C": 1e9, "sigma2": 0.0, "Ts": Ts, "u_min": -1e9, "u_max": 1e9}
    values |= {"alpha": tuple(levels / total), "k": tuple(levels / deflections)}
    path = q[checked]
    estimated = [found["F_hat"] for found in run([{"v": dx / Ts} for dx in np.diff(path, append=path[-1])], **values)]
    error = (friction[checked] - np.array(estimated))[late]
    assert np.sqrt(np.mean(error**2)) < 0.065 * np.sqrt(np.mean(friction[checked][late] ** 2))
