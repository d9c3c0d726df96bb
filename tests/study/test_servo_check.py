"""The servo as configured against the recorded drive force, and what is named if they differ.

The recorded forces are computed here from the equations of the laws, or are those of the EMPS record.
"""

from __future__ import annotations

import re
import tomllib
from dataclasses import replace
from math import pi
from typing import Any
from unittest.mock import ANY

import numpy as np
import pytest
from independent_axis import simulate, typical_moves
from scipy.signal import lfilter
from thorough import landing, nightly

from friction_fmus.axis.servo import LowPass, Notch, Servo
from friction_fmus.data import load_emps
from friction_fmus.identification import ROTARY, Record
from friction_fmus.study import load_config, parse_config
from friction_fmus.study.servo_check import check_servo, commanded
from friction_fmus.study.study_result import ServoCheck

EMPS = load_emps().window(0.0, 8.0)
T = EMPS.t
RD = np.gradient(EMPS.column("reference"), 1e-3)
RDD = np.gradient(RD, 1e-3)
FORCE = EMPS.column("force")


@pytest.fixture(scope="module")
def servo() -> Servo:
    found = load_config("emps").servo
    assert found is not None
    return found


def with_gains(servo: Servo, **factors: float) -> Servo:
    return replace(servo, gains={name: factors.get(name, 1.0) * value for name, value in servo.gains.items()})


def only(check: ServoCheck) -> str:
    (finding,) = check.findings
    return finding.name


def test_the_published_law_reproduces_the_drive_of_emps(servo: Servo) -> None:
    """The figure is from the README of the data: 3.7 mV rms, with 35.15 N/V."""
    check = check_servo(EMPS, servo).result
    assert check.residual is not None
    assert check.residual.rms == pytest.approx(3.7e-3 * 35.15, rel=0.05)
    assert check.residual.percent < 0.3
    assert check.findings == ()


def test_the_command_is_that_of_the_published_formula(servo: Servo) -> None:
    q, r = EMPS.column("q"), EMPS.column("reference")
    mean = 0.5 * (q[1:] + q[:-1])
    u = servo.gains["kv"] * (servo.gains["kp"] * (r[2:] - q[2:]) - np.diff(mean) / 1e-3)
    np.testing.assert_allclose(commanded(servo, EMPS)[2:], np.clip(u, -351.5, 351.5), rtol=0.0, atol=1e-8)


def test_a_gain_that_is_a_hundredth(servo: Servo) -> None:
    """kv = 18 in place of 1800: a wrong gain and a wrong unit of the force look the same, so both are named."""
    check = check_servo(EMPS, with_gains(servo, kv=0.01)).result
    (finding,) = check.findings
    assert finding.name == "wrong-unit-or-gain"
    assert finding.stops
    assert "power of ten" in finding.what
    estimated = {gain.name: gain for gain in check.gains}
    assert estimated["kv"].value == pytest.approx(servo.gains["kv"], rel=1e-3)
    assert estimated["kp"].value == pytest.approx(servo.gains["kp"], rel=1e-3)


def test_gains_are_estimated(servo: Servo) -> None:
    check = check_servo(EMPS, with_gains(servo, kp=0.9, kv=1.4)).result
    assert only(check) == "wrong-gains"
    for gain in check.gains:
        assert gain.value == pytest.approx(servo.gains[gain.name], rel=1e-3)
        assert gain.standard_error is not None
        assert 0.0 < gain.standard_error < 1e-3 * gain.value
        assert f"{gain.name} = {gain.value:.6g}" in check.findings[0].change


@pytest.mark.parametrize(
    ("factor", "name", "words"),
    [
        (-1.0, "wrong-sign", "opposite sign"),
        (1.0 / 4.4482216, "wrong-unit-or-gain", "N and lbf"),
        (1e3, "wrong-unit-or-gain", "power of ten"),
        (2.0 * pi, "wrong-unit-or-gain", "2 pi"),
        (0.7, "wrong-gain", "0.69"),
    ],
)
def test_a_factor_is_named(servo: Servo, factor: float, name: str, words: str) -> None:
    check = check_servo(replace(EMPS, force=factor * FORCE), servo).result
    assert only(check) == name
    assert words in check.findings[0].what


def test_positions_in_inches_that_are_read_as_millimetres(servo: Servo) -> None:
    q, r = EMPS.column("q") / 25.4, EMPS.column("reference") / 25.4
    check = check_servo(replace(EMPS, q=q, reference=r), servo).result
    assert only(check) == "wrong-unit-or-gain"
    assert "in and mm" in check.findings[0].what


@landing
@pytest.mark.parametrize("samples", [2, -1])
def test_a_delay_is_counted(servo: Servo, samples: int) -> None:
    check = check_servo(replace(EMPS, force=np.roll(FORCE, samples)), servo).result
    assert only(check) == "delay"
    assert f"{abs(samples)} sample" in check.findings[0].what
    assert ("later" if samples > 0 else "earlier") in check.findings[0].what


def test_another_window_is_found(servo: Servo) -> None:
    check = check_servo(EMPS, replace(servo, window=5)).result
    assert only(check) == "wrong-window"
    assert check.findings[0].change == "Set window = 2 in [servo]."


@nightly
def test_feedforward_that_is_not_declared(servo: Servo) -> None:
    Kd = servo.gains["kv"]
    velocity = check_servo(replace(EMPS, force=FORCE + Kd * RD), servo).result
    assert only(velocity) == "velocity-feedforward"
    assert velocity.findings[0].change == "Set velocity_feedforward = true in [servo]."
    declared = check_servo(EMPS, replace(servo, velocity_feedforward=True)).result
    assert declared.findings[0].change == "Set velocity_feedforward = false in [servo]."
    both = check_servo(replace(EMPS, force=FORCE + 60.0 * RDD + 15.0 * np.sign(RD)), servo).result
    assert [finding.name for finding in both.findings] == ["inertia-feedforward", "friction-feedforward"]
    mass = float(both.findings[0].change.split("= ")[1].split(" ")[0])
    assert mass == pytest.approx(60.0, rel=0.01)
    told = replace(servo, inertia_feedforward=mass)
    assert only(check_servo(replace(EMPS, force=FORCE + 60.0 * RDD + 15.0 * np.sign(RD)), told).result) == (
        "friction-feedforward"
    )


def test_gains_and_feedforward_together(servo: Servo) -> None:
    check = check_servo(replace(EMPS, force=FORCE + 60.0 * RDD), with_gains(servo, kv=1.1)).result
    assert [finding.name for finding in check.findings] == ["wrong-gains", "inertia-feedforward"]
    assert check.gains[1].value == pytest.approx(servo.gains["kv"], rel=1e-3)


@landing
@pytest.mark.parametrize("half", ["earlier", "later"])
def test_the_feedforward_may_use_either_difference_of_the_reference(servo: Servo, half: str) -> None:
    r = EMPS.column("reference")
    rd = np.append(np.diff(r), 0.0) / 1e-3 if half == "earlier" else np.append(0.0, np.diff(r)) / 1e-3
    record = replace(EMPS, force=FORCE + servo.gains["kv"] * rd)
    fed = replace(servo, velocity_feedforward=True)
    assert check_servo(record, fed).result.findings == ()
    wrong = check_servo(record, with_gains(fed, kv=1.2)).result
    assert only(wrong) == "wrong-gains"
    for gain in wrong.gains:
        assert gain.value == pytest.approx(servo.gains[gain.name], rel=3e-3)


def test_a_late_reference_velocity(servo: Servo) -> None:
    record = replace(EMPS, force=FORCE + servo.gains["kv"] * np.roll(RD, 2))
    check = check_servo(record, replace(servo, velocity_feedforward=True)).result
    assert only(check) == "reference-timing"
    assert "2 samples later" in check.findings[0].what


@nightly
def test_units_of_a_rotary_axis(servo: Servo) -> None:
    check = check_servo(replace(EMPS, units=ROTARY), with_gains(servo, kp=0.9)).result
    assert check.residual is not None
    assert check.residual.unit == "N.m"
    assert [gain.unit for gain in check.gains] == ["1/s", "N.m.s/rad"]
    assert check.gains[0].value == pytest.approx(servo.gains["kp"], rel=1e-3)


def pulses() -> np.ndarray:
    found = np.zeros(len(EMPS))
    for start in range(1000, 7500, 1500):
        found[start : start + 100] = 90.0
    return found


def test_pulses_are_an_injected_force(servo: Servo) -> None:
    checked = check_servo(replace(EMPS, force=FORCE + pulses()), servo)
    assert only(checked.result) == "injected-force"
    assert "5 pulses" in checked.result.findings[0].what
    assert not checked.result.findings[0].stops
    assert checked.included
    assert checked.injected is not None
    np.testing.assert_allclose(checked.injected, pulses(), atol=1.0)


def test_a_periodic_force_is_an_injected_force(servo: Servo) -> None:
    checked = check_servo(replace(EMPS, force=FORCE + 20.0 * np.sin(2.0 * pi * 17.0 * T)), servo)
    assert only(checked.result) == "injected-force"
    assert "17 Hz" in checked.result.findings[0].what


@pytest.mark.parametrize("included", [True, False])
def test_a_declared_force_may_be_in_the_recorded_one_or_not(servo: Servo, included: bool) -> None:
    record = replace(EMPS, force=FORCE + pulses() if included else FORCE, injected=pulses())
    checked = check_servo(record, servo)
    assert checked.result.findings == ()
    assert checked.included == included
    np.testing.assert_array_equal(checked.injected, pulses())


@landing
def test_noise_of_the_force_confirms_the_gains(servo: Servo) -> None:
    noise = 20.0 * np.random.default_rng(0).standard_normal(len(EMPS))
    check = check_servo(replace(EMPS, force=FORCE + noise), servo).result
    assert only(check) == "servo-unexplained"
    assert not check.findings[0].stops
    assert "gains agree" in check.findings[0].what


def test_rounding_of_the_log_is_allowed_for(servo: Servo) -> None:
    q = 1e-6 * np.round(EMPS.column("q") / 1e-6)
    check = check_servo(replace(EMPS, q=q, quantum=1e-6), servo).result
    assert check.residual is not None
    assert check.residual.percent > 2.0
    assert check.findings == ()


@pytest.mark.parametrize("law", ["PID", "CascadePPI"])
def test_an_integral_is_estimated_and_its_start_value_does_not_matter(law: str) -> None:
    t = 1e-3 * np.arange(6000.0)
    r = 0.02 * np.sin(2.0 * pi * 0.7 * t) + 0.005 * np.sin(2.0 * pi * 1.9 * t)
    q = r - 1e-4 * np.sin(2.0 * pi * 0.7 * t + 1.0) - 3e-5 * np.sin(2.0 * pi * 2.3 * t)
    v = np.concatenate([[0.0, 0.0], (q[2:] - q[:-2]) / 2e-3])
    e = r - q
    if law == "PID":
        true = {"Kp": 2e5, "Kd": 900.0, "Ki": 3e6}
        force = true["Kp"] * e - true["Kd"] * v + true["Ki"] * 1e-3 * (np.cumsum(e) - e) + 7.0
    else:
        true = {"kp": 60.0, "kv": 1500.0, "ki": 2e4}
        w = true["kp"] * e - v
        force = true["kv"] * w + true["ki"] * 1e-3 * (np.cumsum(w) - w) + 7.0
    record = Record("synthetic", t, q=q, reference=r, force=force)
    servo = Servo(law, true, 1e-3, 1e4)
    right = check_servo(record, servo).result
    assert right.residual is not None
    assert right.residual.percent < 1.0
    wrong = check_servo(record, replace(servo, gains={name: 1.3 * value for name, value in true.items()})).result
    assert {finding.name for finding in wrong.findings} <= {"wrong-gains", "wrong-gain"}
    for gain in wrong.gains:
        assert gain.value == pytest.approx(true[gain.name], rel=0.02)
    assert len(wrong.gains) == 3


def test_a_record_without_a_reference_is_not_compared(servo: Servo) -> None:
    check = check_servo(replace(EMPS, reference=None), servo).result
    assert check.residual is None
    assert "no reference" in check.reason
    assert "no servo" in check_servo(EMPS, None).result.reason


# ---- drives of the independent axes -----------------------------------------------------------------------------

DRIVE = {"kp": 40.0, "kv": 900.0, "limit": 400.0, "quantum": 1e-7}


def driven(**drive: float) -> tuple[Record, Servo]:
    """Return the log of an axis with Coulomb friction under a drive, and the servo without filters and friction."""
    values, r = {**DRIVE, **drive}, typical_moves(6.0, 1e-3, 0.3, 0.6, 3.0)
    run = simulate({"m1": 12.0, "Fc1": 18.0, "Fs1": 18.0, "Fv1": 45.0}, values, r, step=5e-5)
    force = (run.force if "lag" in drive else run.command) + 0.1 * np.random.default_rng(2).standard_normal(
        len(run.command)
    )
    record = Record("axis", 1e-3 * np.arange(6000.0), q=run.measured, reference=np.round(r.r, 9), force=force)
    gains = {"kp": values["kp"], "kv": values["kv"], "ki": 0.0}
    return record, Servo("CascadePPI", gains, 1e-3, 400.0, quantum=1e-7)


def settings(check: ServoCheck) -> dict[str, object]:
    """Return the entries that the findings advise."""
    lines = [change.split(" in [servo]")[0].removeprefix("Set ") for change in (each.change for each in check.findings)]
    return tomllib.loads("\n".join(lines))


@pytest.mark.parametrize(("order", "cutoff"), [(1, 40.0), (1, 80.0), (2, 60.0)])
def test_a_velocity_filter_is_found(order: int, cutoff: float) -> None:
    record, servo = driven(order=float(order), corner=cutoff)
    check = check_servo(record, servo).result
    assert only(check) == "velocity-filter"
    assert settings(check)["velocity_filter"] == {"order": order, "cutoff": pytest.approx(cutoff, rel=0.01)}
    assert check_servo(record, replace(servo, velocity_filter=LowPass(order, cutoff))).result.findings == ()


def test_a_notch_filter_is_found() -> None:
    """The zeros of the simulated filter have a twentieth of the damping of the poles."""
    record, servo = driven(notch=60.0, width=0.7)
    checked = check_servo(record, servo)
    check = checked.result
    assert only(check) == "notch"
    assert not check.findings[0].stops
    assert checked.servo is not None  # with which the study goes on
    assert checked.servo.notch is not None
    assert checked.servo.notch.frequency == pytest.approx(60.0, rel=0.03)
    found = settings(check)["notch"]
    assert found == {"frequency": pytest.approx(60.0, rel=0.03), "damping": pytest.approx(0.7, rel=0.03), "depth": ANY}
    assert found["depth"] == pytest.approx(0.05, abs=0.03)
    declared = check_servo(record, replace(servo, notch=Notch(60.0, 0.7, 0.05))).result
    assert declared.findings == ()
    assert declared.residual is not None
    assert declared.residual.percent < 0.5


@pytest.mark.parametrize(
    ("key", "declared"), [("velocity_filter", LowPass(1, 60.0)), ("notch", Notch(120.0, 0.5, 0.05))]
)
def test_a_declared_filter_that_the_drive_does_not_have_is_to_be_removed(key: str, declared: LowPass | Notch) -> None:
    record, servo = driven()
    given = (
        replace(servo, velocity_filter=declared) if isinstance(declared, LowPass) else replace(servo, notch=declared)
    )
    check = check_servo(record, given).result
    assert only(check) == f"no-{key.replace('_', '-')}"
    assert check.findings[0].change.startswith(f"Remove {key} from [servo]")


def test_a_feedforward_is_found_in_a_force_that_is_recorded_late() -> None:
    """Only with the feedforward fitted does the record show that its force is the command of three samples before."""
    record, servo = driven(delay=3.0, fed_mass=4.0)
    late = np.append(np.zeros(3), record.column("force")[:-3])
    check = check_servo(replace(record, force=late), replace(servo, delay=3)).result
    assert only(check) == "inertia-feedforward"
    assert settings(check)["inertia_feedforward"] == pytest.approx(4.0, rel=0.02)


@landing
@pytest.mark.parametrize("delay", [0, 2])
@pytest.mark.parametrize("lag", [1e-3, 3e-3])
def test_a_force_behind_the_current_loop_is_named(lag: float, delay: int) -> None:
    """The simulated current loop is a low-pass filter of order 1 behind the delay."""
    record, servo = driven(lag=lag, delay=float(delay))
    checked = check_servo(record, servo)
    assert only(checked.result) == "current-loop"
    what = checked.result.findings[0].what
    bandwidth, found = (float(each) for each in re.findall(r"bandwidth of (\S+) Hz, a lag of (\S+) ms", what)[0])
    assert bandwidth == pytest.approx(1.0 / (2.0 * pi * lag), rel=0.02)
    assert found == pytest.approx(1e3 * lag, rel=0.02)
    assert checked.servo is not None
    assert (checked.servo.delay, checked.servo.logged_force) == (delay, "actual")
    assert checked.servo.current_loop == pytest.approx(1.0 / (2.0 * pi * lag), rel=0.02)
    change = checked.result.findings[0].change
    entries = f'logged_force = "actual"{f", delay = {delay}" if delay else ""} in [servo]'
    assert re.match(rf"Set current_loop = [\d.]+, {re.escape(entries)}: residual", change)


@pytest.mark.parametrize("logged", ["", "actual", "command"])
def test_a_declared_current_loop_leaves_no_residual(logged: str) -> None:
    """The force has a noise of 0.1 N."""
    record, servo = driven(lag=2e-3, delay=1.0)
    check = check_servo(record, replace(servo, delay=1, current_loop=500.0 / (2.0 * pi), logged_force=logged)).result
    assert check.residual is not None
    assert (check.findings == ()) == (logged != "command")
    assert (check.residual.rms < 0.11) == (logged != "command")


def test_gains_in_the_units_of_the_drive_reproduce_the_record() -> None:
    """The same axis on a screw of 20 mm, with a motor of 0.8 N.m/A."""
    record, servo = driven()
    turns = 2.0 * pi / 0.02
    drive: dict[str, Any] = {"law": "CascadePPI", "torque_constant": "0.8 N.m/A", "pitch": "20 mm", "Ts": "1 ms"}
    drive |= {"kp": "2.4 m/min/mm", "kv": f"{900.0 / turns**2 / 0.8 * 1e3 * pi / 30.0!r} mA/rpm", "quantum": "0.1 um"}
    drive["force_limit"] = f"{400.0 / turns / 0.8!r} A"
    found = parse_config({"data": {"file": "log.csv"}, "servo": drive}).servo
    assert found is not None
    check, expected = check_servo(record, found).result, check_servo(record, servo).result
    assert check.residual is not None
    assert expected.residual is not None
    assert check.findings == expected.findings == ()
    assert check.residual.rms == pytest.approx(expected.residual.rms, rel=1e-9)


def test_friction_feedforward_of_the_drive_is_found() -> None:
    record, servo = driven(fed_coulomb=10.0, fed_viscous=30.0)
    check = check_servo(record, servo).result
    assert all(finding.stops for finding in check.findings)
    fed = settings(check)
    assert fed == {"coulomb_feedforward": pytest.approx(10.0, rel=0.02), "viscous_feedforward": ANY}
    assert fed["viscous_feedforward"] == pytest.approx(30.0, rel=0.05)
    declared = check_servo(record, replace(servo, coulomb_feedforward=10.0, viscous_feedforward=30.0)).result
    assert declared.findings == ()


def test_a_velocity_filter_and_friction_feedforward_are_found_together() -> None:
    record, servo = driven(order=1.0, corner=40.0, fed_coulomb=10.0)
    check = check_servo(record, servo).result
    fed = settings(check)
    assert fed["velocity_filter"] == {"order": 1, "cutoff": pytest.approx(40.0, rel=0.05)}
    assert fed["coulomb_feedforward"] == pytest.approx(10.0, rel=0.05)


def test_a_coloured_residual_is_not_noise() -> None:
    """A force that follows neither the reference nor the servo, although the gains agree, stops the study."""
    record, servo = driven()
    drift = lfilter([0.02], [1.0, -0.98], np.random.default_rng(4).standard_normal(len(record)))
    check = check_servo(replace(record, force=record.column("force") + 10.0 * drift / np.std(drift)), servo).result
    assert only(check) == "servo-unexplained"
    assert check.findings[0].stops
    assert "noise" not in check.findings[0].what
