"""The doctor on loops with filters of velocity, force and position, against the discrete loop and its simulation."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import bilinear, butter, lfilter

from friction_fmus.axis.drive_filters import CurrentLoop
from friction_fmus.conditions import Condition
from friction_fmus.doctor import examine
from friction_fmus.doctor.find import axes
from harness import Experiment, FmuPart, System

BlockFmu = Callable[..., Path]
Filter = tuple[np.ndarray, np.ndarray]

M, TS, WINDOW = 12.0, 1e-3, 2
CONSTANT = {"servo.r": 1e-5, "servo.rd": 0.0, "servo.rdd": 0.0, "mass.F_load": 0.0, "mass.v_support": 0.0}
GAINS = {"Kp": 6e4, "Kd": 1500.0, "Ki": 2e5}
NONE: Filter = (np.ones(1), np.ones(1))


def behind(own: Filter, inputs: list[np.ndarray], outputs: list[np.ndarray]) -> np.ndarray:
    """The next output of a filter in direct form I, from the inputs up to now and the outputs before, newest first."""
    b, a = own
    past = sum((c * y for c, y in zip(a[1:], outputs, strict=False)), np.zeros_like(inputs[0]))
    return np.asarray(sum(c * u for c, u in zip(b, inputs, strict=False)) - past)


def radius(
    lowpass: Filter = NONE,
    notch: Filter = NONE,
    position: Filter = NONE,
    tau: float = 0.0,
    delay: int = 0,
    exact: bool = False,
) -> float:
    """Spectral radius of the loop written as equations, whose unknowns are the rows of a unit matrix.

    The mass moves by x + Ts v + Ts^2 u/(2 m) and v + Ts u/m; the past of each signal is kept.
    """
    past = 3
    n = 4 + 6 * past
    x, v, integral, low, *kept = np.eye(n)
    X, D, V, P, U, F = (kept[i * past : (i + 1) * past] for i in range(6))
    difference = v if exact else (x - X[WINDOW - 1]) / (WINDOW * TS)
    keep = np.exp(-TS / tau) if tau else 0.0
    smooth = keep * low + (1.0 - keep) * difference  # as the Differentiator has it
    measured = behind(lowpass, [smooth, *D], V)
    seen = behind(position, [x, *X], P)
    command = -GAINS["Kp"] * seen - GAINS["Kd"] * measured + GAINS["Ki"] * integral
    force = behind(notch, [command, *U], F)
    sent = [force, *F][delay]
    pasts = [[x, *X], [smooth, *D], [measured, *V], [seen, *P], [command, *U], [force, *F]]
    rows = [x + TS * v + TS**2 / (2.0 * M) * sent, v + TS / M * sent, integral - TS * seen, smooth]
    after = np.array([*rows, *(row for each in pasts for row in each[:past])])
    return float(np.abs(np.linalg.eigvals(after)).max())


def analog(f: float, zeta: float, low: float, band: float, high: float) -> Filter:
    """A filter with its frequency response at f moved to f by the bilinear transform."""
    w = 2.0 / TS * np.tan(np.pi * f * TS)
    return bilinear([high / w**2, 2.0 * zeta * band / w, low], [1.0 / w**2, 2.0 * zeta / w, 1.0], 1.0 / TS)


def lag(tau: float) -> Filter:
    """A current loop by the trapezoidal rule."""
    return bilinear([1.0], [tau, 1.0], 1.0 / TS)


LOW20, LOW90 = {"f": 20.0}, {"f": 90.0}  # Butterworth
NOTCH = {"f": 45.0, "zeta": 0.6, "low": 1.0, "band": 0.1, "high": 1.0}
WIDE, NARROW = NOTCH | {"f": 15.0, "zeta": 1.2}, NOTCH | {"f": 200.0}
RAISED = {"f": 200.0, "zeta": 0.6, "low": 1.5, "band": 0.1, "high": 1.2}
BAND = {"f": 60.0, "zeta": 0.9, "low": 0.0, "band": 1.0, "high": 0.0}
CURRENT, SLOW = CurrentLoop(1.5e-3, TS).parameters, CurrentLoop(40e-3, TS).parameters
BUTTER20, BUTTER90 = butter(2, 20.0, fs=1.0 / TS), butter(2, 90.0, fs=1.0 / TS)

NOTCH_AND_LAG = tuple(np.convolve(*both) for both in zip(lag(1.5e-3), analog(**NOTCH), strict=True))

CASES: dict[str, tuple[dict[str, dict[str, float]], dict[str, object], bool]] = {
    "none": ({}, {}, True),
    "low-pass 20 Hz": ({"lowpass": LOW20}, {"lowpass": BUTTER20}, False),
    "low-pass 90 Hz": ({"lowpass": LOW90}, {"lowpass": BUTTER90}, True),
    "low-pass of gain 0.5": ({"lowpass": LOW90 | {"low": 0.5}}, {"lowpass": (0.5 * BUTTER90[0], BUTTER90[1])}, True),
    "band-pass": ({"lowpass": BAND}, {"lowpass": analog(**BAND)}, True),
    "no filter": ({"lowpass": {"f": 600.0, "low": 0.5}}, {}, True),
    "low-pass behind a smoothed difference": (
        {"lowpass": LOW90, "velocity": {"tau": 2e-3}},
        {"lowpass": BUTTER90, "tau": 2e-3},
        True,
    ),
    "exact velocity": ({"lowpass": LOW20, "exact": {}}, {"lowpass": BUTTER20, "exact": True}, False),
    "position": ({"position": LOW90}, {"position": BUTTER90}, True),
    "notch": ({"notch": NOTCH}, {"notch": analog(**NOTCH)}, True),
    "notch of gain 1.5": ({"notch": RAISED}, {"notch": analog(**RAISED)}, True),
    "low-pass and notch": ({"lowpass": LOW90, "notch": NOTCH}, {"lowpass": BUTTER90, "notch": analog(**NOTCH)}, True),
    "low-pass and wide notch": (
        {"lowpass": LOW90, "notch": WIDE},
        {"lowpass": BUTTER90, "notch": analog(**WIDE)},
        False,
    ),
    "low-pass, notch and delay": (
        {"lowpass": LOW90, "notch": NARROW, "drive": {"delay": TS}},
        {"lowpass": BUTTER90, "notch": analog(**NARROW), "delay": 1},
        True,
    ),
    "current loop": ({"current": CURRENT}, {"notch": lag(1.5e-3)}, True),
    "slow current loop": ({"current": SLOW}, {"notch": lag(40e-3)}, False),
    "notch and current loop": ({"notch": NOTCH, "current": CURRENT}, {"notch": NOTCH_AND_LAG}, True),
}


@pytest.fixture
def axis(build_fmu: BlockFmu) -> Callable[..., System]:
    """A mass under PID with the parts that are given, each with its parameters."""

    def made(given: dict[str, dict[str, float]]) -> System:
        blocks = {"mass": "Mass", "servo": "PID", "velocity": "Differentiator"}
        blocks |= {name: "SecondOrderFilter" for name in ("lowpass", "notch", "current", "position") if name in given}
        blocks |= {"drive": "Actuator"} if "drive" in given else {}
        source = "mass.v" if "exact" in given else "velocity.v"
        x = "position.y" if "position" in given else "mass.x"
        wires = ["mass.x -> velocity.x", f"{x} -> servo.x"]
        wires += ["mass.x -> position.u"] if "position" in given else []
        wires += [f"{source} -> lowpass.u", "lowpass.y -> servo.v"] if "lowpass" in given else [f"{source} -> servo.v"]
        command = "servo.u"
        for name, output in (("notch", "y"), ("current", "y"), ("drive", "F")):
            if name in given:
                wires.append(f"{command} -> {name}.u")
                command = f"{name}.{output}"
        start = {f"servo.{key}": value for key, value in GAINS.items()}
        start |= {f"{name}.{key}": value for name, values in given.items() for key, value in values.items()}
        start |= CONSTANT | {"mass.m": M, "mass.F_friction": 0.0, "velocity.window": WINDOW}
        parts = [FmuPart(name, build_fmu(block)) for name, block in blocks.items()]
        plan = Experiment(stop=3.0, step=TS, record=("mass.x",))
        return System(parts, [*wires, f"{command} -> mass.F_drive"], start, plan)

    return made


@pytest.mark.parametrize("case", CASES)
def test_the_eigenvalues_are_those_of_the_whole_loop(case: str, axis: Callable[..., System]) -> None:
    given, known, stable = CASES[case]
    expected = radius(**known)  # type: ignore[arg-type]
    assert (expected < 1.0) == stable
    system = axis(given)
    found = next(one.condition for one in examine(system) if one.condition.name == "sampled loop")
    assert found.value == pytest.approx(expected, abs=1e-9)
    assert found.ok == stable
    with system:
        x = system.run()["mass.x"].to_numpy()
    error = np.abs(x - 1e-5)
    assert (error[-500:].max() < error[:500].max()) == stable


def test_the_gains_contain_those_of_the_filters_at_frequency_0(axis: Callable[..., System]) -> None:
    (found,) = axes(axis({"lowpass": LOW90 | {"low": 0.5}, "notch": RAISED}))
    gains = found.servo.gains  # type: ignore[union-attr]
    assert gains is not None
    assert (gains.Kp, gains.Kd, gains.Ki) == pytest.approx((1.5 * 6e4, 0.75 * 1500.0, 1.5 * 2e5))


def test_filters_are_evaluated_at_the_sample_time_of_the_loop(axis: Callable[..., System]) -> None:
    (found,) = axes(axis({"lowpass": LOW90 | {"Ts": TS / 4.0}}))
    assert found.servo is not None
    lowpass = found.servo.path.dynamics(TS).lowpass
    assert lowpass is not None
    np.testing.assert_allclose(lowpass, BUTTER90, atol=1e-12)


def test_gains_that_are_low_enough_are_advised_and_no_sample_time(axis: Callable[..., System]) -> None:
    def condition(share: float) -> Condition:
        system = axis({"lowpass": LOW20, "servo": {key: share * value for key, value in GAINS.items()}})
        return next(one.condition for one in examine(system) if one.condition.name == "sampled loop")

    change = condition(1.0).change
    edge = float(change.split("below ")[1].split(" of")[0])
    assert condition(0.99 * edge).ok
    assert not condition(1.01 * edge).ok
    assert "sample faster" not in change


def test_filters_in_a_circle_are_not_followed_for_ever(build_fmu: BlockFmu) -> None:
    blocks = {"mass": "Mass", "servo": "PID", "one": "SecondOrderFilter", "other": "SecondOrderFilter"}
    wires = ["one.y -> other.u", "other.y -> one.u", "one.y -> servo.v", "mass.x -> servo.x", "servo.u -> mass.F_drive"]
    parts = [FmuPart(name, build_fmu(block)) for name, block in blocks.items()]
    assert len(axes(System(parts, wires, CONSTANT | {"mass.F_friction": 0.0}))) == 1


@pytest.mark.parametrize("zeta", [0.2, np.sqrt(0.5), 1.5])
def test_a_filter_of_the_velocity_lengthens_the_time_over_which_a_count_is_spread(
    build_fmu: BlockFmu, zeta: float
) -> None:
    """The velocity of one count, filtered by scipy, is below q/T."""
    blocks = {"mass": "Mass", "fric": "LuGre", "servo": "PID", "encoder": "Quantiser"}
    blocks |= {"velocity": "Differentiator", "lowpass": "SecondOrderFilter"}
    wires = ["mass.x -> encoder.x", "encoder.y -> velocity.x", "velocity.v -> lowpass.u", "lowpass.y -> servo.v"]
    wires += ["encoder.y -> servo.x", "servo.u -> mass.F_drive", "mass.v -> fric.v", "fric.F -> mass.F_friction"]
    q, Kp, Kd = 1e-6, 6e4, 1500.0
    start = {"encoder.q": q, "lowpass.f": 20.0, "lowpass.zeta": zeta, "velocity.window": WINDOW}
    start |= CONSTANT | {"servo.Kp": Kp, "servo.Kd": Kd, "servo.Ki": 0.0}
    parts = [FmuPart(name, build_fmu(block)) for name, block in blocks.items()]
    found = next(one.condition for one in examine(System(parts, wires, start)) if one.condition.name == "encoder")
    count = np.r_[np.full(WINDOW, q / (WINDOW * TS)), np.zeros(500)]
    largest = lfilter(*analog(20.0, zeta, 1.0, 0.0, 0.0), count).max()
    assert found.value == pytest.approx(Kp * q + Kd * q / (WINDOW * TS + 2.0 * zeta / (2.0 * np.pi * 20.0)))
    assert found.value > Kp * q + Kd * largest
