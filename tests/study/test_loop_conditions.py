"""Conditions of the loop of an axis: against equations written out, closed forms, and runs of the axis."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import bilinear, butter, cont2discrete, lfilter
from thorough import some

from friction_fmus.axis.loop_assembly import PartPool
from friction_fmus.axis.servo import AxisPlant, Compensator, FlexibleLoad, LowPass, Notch, Servo, Trajectory
from friction_fmus.axis.servo_loop import run_loop
from friction_fmus.blocks.axis_units import TURNING
from friction_fmus.blocks.catalogue import about_of, laws_folder, listing
from friction_fmus.errors import FrictionError
from friction_fmus.lawkit.law import discover_laws
from friction_fmus.study.data import build_reference
from friction_fmus.study.evaluation import AxisBench, Scheme, system_of
from friction_fmus.study.loop_conditions import AddedLaw, ExaminedLoop, loop_conditions, windowed_sinc
from friction_fmus.study.margins import laws_of

TS = 1e-3
LUGRE = {"Fc": 1.0, "Fs": 1.5, "vs": 1e-3, "delta": 2.0, "sigma0": 1e5, "sigma1": 316.23, "sigma2": 0.4}
STRIBECK = {"Fc": 1.0, "Fs": 1.5, "vs": 1e-3, "delta": 2.0, "Fv": 0.4}
SERVO = Servo("PID", {"Kp": 12e3, "Kd": 600.0, "Ki": 0.0}, TS, 100.0)
PLANT = AxisPlant("LuGre", LUGRE, 1.0)
GOOD = ["Routh", "sampled loop", "presliding loop", "stick-slip", "hunting", "break-away"]


def bench(servo: Servo = SERVO, plant: AxisPlant = PLANT, reference: Path = Path(), n: int = 2) -> AxisBench:
    return AxisBench(servo, plant, Trajectory(reference, n, 0.0, 0.0), np.zeros(n))


def wrong(
    servo: Servo = SERVO, law: Compensator | None = None, plant: AxisPlant = PLANT, gain: float = 1.0
) -> list[str]:
    found = loop_conditions(bench(servo, plant), Scheme(servo, gain, compensator=law))
    return [condition.name for condition in found if not condition.ok]


def value(name: str, servo: Servo = SERVO, law: Compensator | None = None, plant: AxisPlant = PLANT) -> float:
    found = loop_conditions(bench(servo, plant), Scheme(servo, compensator=law))
    return next(condition.value for condition in found if condition.name == name)


def gains(**others: float) -> Servo:
    return replace(SERVO, gains={**SERVO.gains, **others})


def test_a_good_loop_fulfils_all_conditions() -> None:
    found = loop_conditions(bench(), Scheme(SERVO))
    assert [(condition.name, condition.ok) for condition in found] == [(name, True) for name in GOOD]


@pytest.mark.parametrize(
    ("servo", "plant", "names"),
    [
        (gains(Ki=3e7), AxisPlant("LuGre", LUGRE | {"Fs": 1.0}, 1.0), ["Routh", "sampled loop"]),
        (replace(SERVO, Ts=4e-3), PLANT, ["sampled loop"]),
        (gains(Kd=190.0), PLANT, ["stick-slip"]),
        (gains(Ki=1e5), PLANT, ["hunting"]),
        (gains(Kp=0.0), PLANT, ["Routh", "sampled loop"]),
        (replace(SERVO, force_limit=1.4), PLANT, ["break-away"]),
        (replace(SERVO, quantum=6e-6), PLANT, ["encoder"]),
        (replace(SERVO, delay=4), PLANT, ["sampled loop"]),
    ],
)
def test_bad_loops(servo: Servo, plant: AxisPlant, names: list[str]) -> None:
    assert wrong(servo, plant=plant) == names


@pytest.mark.parametrize(
    ("gain", "others", "names"),
    [
        (1.0, {}, []),
        (1.5, {}, ["over-compensation"]),
        (1.0, {"Fc": 1.2}, ["over-compensation"]),
        (1.0, {"Fc": 1.2, "gain": 0.8}, []),
        (1.0, {"vs": 5e-3}, ["over-compensation"]),
        (1.0, {"delta": 100.0}, ["over-compensation"]),
    ],
)
def test_feedforward_of_more_friction_than_there_is(gain: float, others: dict[str, float], names: list[str]) -> None:
    law = Compensator("StaticFeedforward", "u", {**STRIBECK, "m": 0.0, **others})
    assert wrong(law=law, gain=gain) == names


def test_an_observer_leaves_no_friction_at_rest_and_both_laws_count() -> None:
    observer = Compensator("LuGreObserver", "u", LUGRE)
    assert wrong(gains(Kd=190.0), observer) == []
    assert wrong(gains(Kd=190.0), observer, gain=0.2) == ["stick-slip"]
    assert wrong(law=replace(observer, values=LUGRE | {"sigma0": 2e5})) == ["fed-back stiffness"]
    forward = Compensator("StaticFeedforward", "u", {**STRIBECK, "m": 0.0, "gain": 0.7})
    scheme = Scheme(SERVO, 0.5, compensator=observer, feedforward=forward)
    found = next(each for each in loop_conditions(bench(), scheme) if each.name == "over-compensation")
    assert found.value == pytest.approx(1.2)
    assert found.why != loop_conditions(bench(), Scheme(SERVO, compensator=forward))[-1].why


@pytest.mark.parametrize("parts", [(1.0,), (0.7, 0.2, 0.1), (0.1,) * 10, (1.0 / 3.0,) * 3])
def test_friction_that_is_compensated_exactly_leaves_none(parts: tuple[float, ...]) -> None:
    """Several observers whose gains add up to 1: no rest of rounding errors sticks, slips or hunts."""
    about = about_of(listing()["LuGreObserver"])
    assert about.use is not None
    laws = tuple(AddedLaw("LuGreObserver", about.use, about.friction, LUGRE, gain) for gain in parts)
    left = ExaminedLoop(SERVO, PLANT, laws, None, TURNING).left(0)
    assert (left.Fc, left.Fs, left.viscous) == (0.0, 0.0, 0.0)


def behind(own: tuple[np.ndarray, np.ndarray], inputs: list[np.ndarray], outputs: list[np.ndarray]) -> np.ndarray:
    """The next output of a filter in direct form I, from the inputs up to now and the outputs before, newest first."""
    b, a = own
    past = sum((c * y for c, y in zip(a[1:], outputs, strict=False)), np.zeros_like(inputs[0]))
    return np.asarray(sum(c * u for c, u in zip(b, inputs, strict=False)) - past)


NONE = (np.ones(1), np.ones(1))
M, WINDOW = 12.0, 2
PID = {"Kp": 6e4, "Kd": 1500.0, "Ki": 2e5}


def radius(
    lowpass: tuple[np.ndarray, np.ndarray] = NONE, notch: tuple[np.ndarray, np.ndarray] = NONE, delay: int = 0
) -> float:
    """Spectral radius of the loop written as equations, whose unknowns are the rows of a unit matrix.

    The mass moves by x + Ts v + Ts^2 u/(2 m) and v + Ts u/m; the past of each signal is kept.
    """
    past = 3
    x, v, integral, *kept = np.eye(3 + 5 * past)
    X, D, V, U, F = (kept[i * past : (i + 1) * past] for i in range(5))
    difference = (x - X[WINDOW - 1]) / (WINDOW * TS)
    measured = behind(lowpass, [difference, *D], V)
    command = -PID["Kp"] * x - PID["Kd"] * measured + PID["Ki"] * integral
    force = behind(notch, [command, *U], F)
    sent = [force, *F][delay]
    pasts = [[x, *X], [difference, *D], [measured, *V], [command, *U], [force, *F]]
    rows = [x + TS * v + TS**2 / (2.0 * M) * sent, v + TS / M * sent, integral - TS * x]
    after = np.array([*rows, *(row for each in pasts for row in each[:past])])
    return float(np.abs(np.linalg.eigvals(after)).max())


def notched(f: float, zeta: float, depth: float) -> tuple[np.ndarray, np.ndarray]:
    """A notch with its frequency response at f moved to f by the bilinear transform."""
    w = 2.0 / TS * np.tan(np.pi * f * TS)
    return bilinear([w**-2.0, 2.0 * zeta * depth / w, 1.0], [w**-2.0, 2.0 * zeta / w, 1.0], 1.0 / TS)


@pytest.mark.parametrize(
    ("drive", "known", "stable"),
    [
        ({}, {}, True),
        ({"velocity_filter": LowPass(2, 20.0)}, {"lowpass": butter(2, 20.0, fs=1.0 / TS)}, False),
        ({"velocity_filter": LowPass(2, 90.0)}, {"lowpass": butter(2, 90.0, fs=1.0 / TS)}, True),
        ({"notch": Notch(45.0, 0.6, 0.1)}, {"notch": notched(45.0, 0.6, 0.1)}, True),
        (
            {"velocity_filter": LowPass(2, 90.0), "notch": Notch(15.0, 1.2, 0.1)},
            {"lowpass": butter(2, 90.0, fs=1.0 / TS), "notch": notched(15.0, 1.2, 0.1)},
            False,
        ),
        (
            {"velocity_filter": LowPass(2, 90.0), "notch": Notch(200.0, 0.6, 0.1), "delay": 1},
            {"lowpass": butter(2, 90.0, fs=1.0 / TS), "notch": notched(200.0, 0.6, 0.1), "delay": 1},
            True,
        ),
    ],
)
def test_the_eigenvalues_are_those_of_the_whole_loop(
    drive: dict[str, object], known: dict[str, object], stable: bool
) -> None:
    servo = Servo("PID", PID, TS, 1e3, window=WINDOW, **drive)  # type: ignore[arg-type]
    plant = AxisPlant("Coulomb", {"Fc": 0.0}, M)
    found = next(each for each in loop_conditions(bench(servo, plant), Scheme(servo)) if each.name == "sampled loop")
    expected = radius(**known)  # type: ignore[arg-type]
    assert found.value == pytest.approx(expected, abs=1e-9)
    assert found.ok == stable == (expected < 1.0)


@pytest.mark.parametrize("lowpass", [LowPass(1, 50.0), LowPass(2, 20.0), LowPass(2, 200.0)])
def test_a_filter_of_the_velocity_spreads_a_count(lowpass: LowPass) -> None:
    """Against the largest velocity of one count as the filter gives it, of order 1 by hand and of order 2 by scipy."""
    q, keep = 1e-6, math.exp(-2.0 * math.pi * lowpass.cutoff * TS)
    servo = Servo("PID", PID | {"Ki": 0.0}, TS, 1e3, window=WINDOW, quantum=q, velocity_filter=lowpass)
    if lowpass.order == 1:
        largest = q / (WINDOW * TS) * (1.0 - keep**WINDOW)
    else:
        count = np.r_[np.full(WINDOW, q / (WINDOW * TS)), np.zeros(500)]
        largest = lfilter(*butter(2, lowpass.cutoff, fs=1.0 / TS), count).max()
    assert value("encoder", servo) == pytest.approx(PID["Kp"] * q + PID["Kd"] * largest, rel=1e-9)


def test_slow_motion_of_motor_and_load_on_bristles_is_that_of_their_equations() -> None:
    """Differences of LuGre's equations with 0.7 of the friction on the motor, held for a sample by scipy."""
    m1, m2, k, d, shares = 0.6, 0.4, 4e3, 3.0, (0.7, 0.3)
    w = math.sqrt(k / m2)
    plant = AxisPlant("LuGre", LUGRE, m1 + m2, load=FlexibleLoad(m2 / (m1 + m2), w, d / (2.0 * m2 * w), shares[1]))
    servo = Servo("PID", {"Kp": 3e3, "Kd": 200.0, "Ki": 0.0}, TS, 100.0, window=1)

    def rates(y: np.ndarray) -> np.ndarray:
        x1, v1, x2, v2, *z = y
        spring, friction, moved = k * (x1 - x2) + d * (v1 - v2), [], []
        for v, own in zip((v1, v2), z, strict=True):
            g = 1.0 + 0.5 * math.exp(-((v / 1e-3) ** 2))
            moved.append(v - 1e5 * abs(v) / g * own)
            friction.append(1e5 * own + 316.23 * moved[-1] + 0.4 * v)
        return np.array(
            [v1, (-spring - shares[0] * friction[0]) / m1, v2, (spring - shares[1] * friction[1]) / m2, *moved]
        )

    def largest(v: float) -> float:
        z = (1.0 + 0.5 * math.exp(-((v / 1e-3) ** 2))) / 1e5
        centre, sizes = np.array([0.0, v, 0.0, v, z, z]), np.diag([1e-6, 1e-4 * v, 1e-6, 1e-4 * v, 1e-4 * z, 1e-4 * z])
        A = np.array([(rates(centre + e) - rates(centre - e)) / (2.0 * e.sum()) for e in sizes]).T
        b = np.array([[0.0], [1.0 / m1], [0.0], [0.0], [0.0], [0.0]])
        step, push, *_ = cont2discrete((A, b, np.eye(6), np.zeros((6, 1))), TS)
        loop = np.zeros((7, 7))  # with the position of the sample before, for the velocity
        loop[:6, :6], loop[6, 0] = step, 1.0
        loop[:6] += push @ np.array([[-3e3 - 200.0 / TS, 0.0, 0.0, 0.0, 0.0, 0.0, 200.0 / TS]])
        return float(np.abs(np.linalg.eigvals(loop)).max())

    expected = max(largest(float(v)) for v in 1e-3 * np.geomspace(0.05, 5.0, 31))
    found = loop_conditions(bench(servo, plant), Scheme(servo))
    slow = next(each for each in found if each.name == "stick-slip")
    assert expected > 1.0
    # the slope of the Stribeck curve is taken from its values at 31 speeds
    assert slow.value - 1.0 == pytest.approx(expected - 1.0, rel=0.1)


LEARNING = {"rate": 0.5, "fq": 50.0, "m": 1.0, "Kp": 12e3, "Kd": 600.0, "Ki": 0.0, "N": 1000.0, "M": 16.0}


def test_learning_with_a_wrong_model() -> None:
    def names(**others: float) -> list[str]:
        return wrong(law=Compensator("RepetitiveController", "u", LEARNING | others))

    assert names() == []
    # far above the loop L S is 5 and 1 - 0.5 x 5 is -1.5; a low-pass far below helps
    assert names(m=5.0, Kd=3000.0, Kp=60e3, fq=400.0) == ["learning"]
    assert names(Kd=60.0, rate=0.1, fq=5.0) == []


def test_the_low_pass_of_learning_is_that_of_its_recursion() -> None:
    """The sum of the weights at a sinusoid by hand."""
    weights = [
        (0.1 if i == 0 else math.sin(2 * math.pi * 0.05 * i) / (math.pi * i)) * math.cos(math.pi * i / 34.0) ** 2
        for i in range(-16, 17)
    ]
    for one in (5.0, 50.0, 120.0, 400.0):
        wave = [math.cos(2.0 * math.pi * one * 1e-3 * i) for i in range(-16, 17)]
        expected = sum(a * b for a, b in zip(weights, wave, strict=True)) / sum(weights)
        assert windowed_sinc(np.array([one]), 50.0, 1e-3, 16)[0] == pytest.approx(expected, abs=1e-12)
    for off in (0.0, 600.0):
        assert (windowed_sinc(np.array([5.0]), off, 1e-3, 16) == 1.0).all()


@pytest.mark.parametrize(("Ad", "names"), [(50.0, []), (10.0, ["dither stroke"])])
def test_dither_that_slides_and_that_does_not(Ad: float, names: list[str]) -> None:
    """Ad/(m (2 pi f)^2) is 32 um or 6 um, Fs/sigma0 15 um."""
    assert wrong(law=Compensator("Dither", "u", {"Ad": Ad, "frequency": 200.0})) == names


def test_a_rule_without_its_parameter_is_refused() -> None:
    about = about_of(listing()["Dither"])
    assert about.use is not None
    law = AddedLaw("Mine", about.use, None, {}, 1.0)
    with pytest.raises(FrictionError, match=r"Mine has the rule 'dither_stroke', but no parameter Ad"):
        law.value("Ad")


ESTIMATORS = {
    "mass of the observer": ("DisturbanceObserver", {"m": 12.0}, False),
    "short fit": ("LocalFunctionEstimator", {"m": 2.0, "window": 2.0, "degree": 1.0}, False),
    "observer": ("DisturbanceObserver", {"m": 1.0, "second_order": 1.0, "fq": 60.0}, True),
    "fit": ("LocalFunctionEstimator", {"m": 1.0, "window": 20.0, "degree": 1.0}, True),
    "part of an observer": ("DisturbanceObserver", {"m": 3.0}, True),
    "predictive filter": ("PredictiveFilter", {"m": 1.0}, True),
    "Kalman": ("KalmanFriction", {"m": 1.0, "x_noise": 1e-7}, True),
    "extended state": ("ExtendedStateObserver", {"m": 1.0, "wo": 300.0, "wc": 100.0}, True),
}


@pytest.mark.parametrize("case", some([*ESTIMATORS], [*ESTIMATORS][::3]))
def test_a_loop_with_an_estimator_that_is_found_unstable_does_not_come_to_rest(case: str, tmp_path: Path) -> None:
    """The axis, whose friction is viscous, is run from 0.1 mm beside its target."""
    model, values, stable = ESTIMATORS[case]
    law = Compensator(model, "F_hat" if model == "ExtendedStateObserver" else "u", values)
    servo = replace(SERVO, gains={"Kp": 12e3, "Kd": 300.0, "Ki": 0.0}, window=1)
    n = 1500
    reference = build_reference(TS * np.arange(float(n)), np.full(n, 1e-4), tmp_path, "Reference")
    axis = bench(servo, AxisPlant("Viscous", {"Fv": 0.4}, 1.0), reference, n)
    scheme = Scheme(servo, 0.6 if case == "part of an observer" else 1.0, compensator=law)
    found = {each.name: each.ok for each in loop_conditions(axis, scheme)}
    assert found["disturbance observer"] == stable
    with PartPool() as pool:
        q = run_loop(system_of(axis, scheme, pool)).q
    assert (float(np.ptp(q[-300:])) < 1e-7) == stable


FRICTION = [law for law in discover_laws(laws_folder()) if law.about.friction is not None]


@pytest.mark.parametrize("law", FRICTION, ids=lambda law: law.name)
def test_the_friction_that_a_law_states_is_what_it_computes(law) -> None:  # type: ignore[no-untyped-def]
    """In sliding at a constant speed, of reference and axis."""
    starts = {variable.name: variable.start for variable in law.given}
    flat = {name: start for name, start in starts.items() if np.isscalar(start)}
    flat |= {f"{k}[{i + 1}]": x for k, v in starts.items() if not np.isscalar(v) for i, x in enumerate(v)}
    forward, _ = law.about.friction.levels(flat)
    states = {variable.name for variable in law.results} & starts.keys()
    for v in (2.0 * (forward.vs or 0.05), 0.3):
        now, given = {}, {"u_min": -1e9, "u_max": 1e9} | {name: 0.0 for name in ("m", "m_load")} | {"vt": 1e-6}
        given = {name: value for name, value in given.items() if name in starts}
        found = {}
        for i in range(3000):
            moving = {"rd": v, "v": v, "r": v * TS * i, "x": v * TS * i}
            found = law.evaluate(given | {key: each for key, each in moving.items() if key in starts} | now)
            now = {name: found[name] for name in states}
        expected = float(forward.at(np.array([v]))[0]) + forward.viscous * v
        assert found["u"] == pytest.approx(expected, rel=1e-3), v


def test_laws_that_a_controller_in_c_does_not_linearise_have_no_poles() -> None:
    assert laws_of(SERVO, Compensator("RepetitiveController", "u", LEARNING)) is None
    with_servo, own = laws_of(SERVO, Compensator("LocalFunctionEstimator", "u", {}), "estimator", 0.5) or ()
    assert len(with_servo.C) == 0 or with_servo.D[2] == 0.0
    assert own.D[2] != 0.0
