"""The axis of a study: metrics, mismatch, candidates, and axes that turn or have no servo."""

from __future__ import annotations

from dataclasses import replace
from math import pi, sqrt
from pathlib import Path

import numpy as np
import pytest
from quick import builds_of
from thorough import nightly, some

from friction_fmus.axis.servo import AxisPlant, Compensator, Trajectory
from friction_fmus.axis.servo_loop import LoopTrace, closed_loop
from friction_fmus.data import load_emps
from friction_fmus.export.block_fmu import build_record
from friction_fmus.identification import LINEAR, identifiable
from friction_fmus.identification.fit.contact_model import contact_model
from friction_fmus.study import Servo, load_config, run_study
from friction_fmus.study.comparison import trials, with_integral
from friction_fmus.study.compensators import AxisKnowledge, candidates, compensators, period_of
from friction_fmus.study.data import LUGRE, build_reference
from friction_fmus.study.evaluation import (
    AxisBench,
    Case,
    Evaluation,
    Scheme,
    at_rest,
    cases,
    evaluate,
    high_frequency,
    judge,
    off_by,
    reversals,
    settling,
)
from friction_fmus.study.study_result import Limits, thinned

SERVO = Servo("PID", {"Kp": 12e3, "Kd": 190.0, "Ki": 0.0}, 1e-3, 20.0)
PLANT = AxisPlant("LuGre", LUGRE, 1.0, 0.2)
T = 1e-3 * np.arange(1001.0)
R = 4e-3 * (1.0 - np.cos(2.0 * pi * T))


def bench(folder: Path, rotary: bool = False) -> AxisBench:
    reference = build_reference(T, R, folder, "Reference", rotary)
    return AxisBench(SERVO, PLANT, Trajectory(reference, len(T), 0.0, 0.0, motion=True, offset=0.2, rotary=rotary), R)


def run(bench: AxisBench, compensator: Compensator | None, tried: tuple[Case, ...] = ()) -> Evaluation:
    return evaluate(bench, [Scheme(bench.servo, compensator=compensator)], tried)


OWN = """
#define MODEL   Own
#define SUMMARY "friction whose sigma0 is a number and whose stiffness is c"
#define VARIABLES                                                      \\
    INPUT    (v,      VELOCITY, 0.0,         "sliding velocity")       \\
    OUTPUT   (F,      FORCE,                 "friction force")         \\
    PARAMETER(sigma0, NO_UNIT, 1e9, 0.0, INF, "a number")              \\
    PARAMETER(c,      STIFFNESS, 7.0, 0.0, INF, "stiffness")
#define CONTACT STIFFNESS(2 * c)
#include "block.h"
static void equations(Model *m) { m->F = m->v; }
"""


@pytest.mark.parametrize(
    ("friction", "values", "stiffness"),
    [
        ("GMS", {"k[1]": 2e4, "k[2]": 3e4, "sigma": 1e6}, 5e4),
        ("Leuven", {"A": 4.0, "zc": 4e-5}, 1e5),
        ("Stribeck", {"Fc": 1.0}, 0.0),
        ("Own.c", {"sigma0": 1e9, "c": 7.0}, 14.0),
    ],
)
def test_the_stiffness_of_an_axis_is_that_of_its_contact(
    tmp_path: Path, friction: str, values: dict[str, float], stiffness: float
) -> None:
    """By its meaning in the file of the block: sigma is a damping in GMS, and sigma0 a number in another block."""
    (tmp_path / "Own.c").write_text(OWN, encoding="utf-8")
    block = str(tmp_path / friction) if friction.endswith(".c") else friction
    assert AxisPlant(block, values, 1.0).stiffness == pytest.approx(stiffness, rel=1e-12)


@pytest.mark.parametrize(
    ("friction", "values", "step"),
    [("GMS", {"N": 2.0, "k[1]": 2e4, "k[2]": 3e4, "Fc": 1.0}, 5e-4), ("LuGre", {}, 5e-4), ("Stribeck", {}, 1e-3)],
)
def test_parameters_that_were_not_identified_keep_their_start_values(
    tmp_path: Path, friction: str, values: dict[str, float], step: float
) -> None:
    """A record without fast small motion leaves sigma of GMS open; contacts with a stiffness have the shorter step."""
    with closed_loop(SERVO, AxisPlant(friction, values, 1.0), bench(tmp_path).trajectory) as system:
        assert system.experiment is not None
        assert system.experiment.step == pytest.approx(step, rel=1e-12)


@nightly
def test_an_axis_that_turns_is_the_same_axis(tmp_path: Path) -> None:
    known = AxisKnowledge(SERVO, PLANT, {"LuGre": LUGRE})
    (candidate,) = candidates(["LuGreFeedforward"], known)
    (turning,) = candidates(["LuGreFeedforward"], replace(known, rotary=True))
    tried = cases(SERVO, (0.1, 0.02), (1,), 1.5, 1.5)
    straight = run(bench(tmp_path), candidate.compensator, tried)
    turned = run(bench(tmp_path, rotary=True), turning.compensator, tried)
    assert straight.metrics is not None
    assert turned == straight
    assert [corner.name for corner in straight.corners] == [
        "friction x 0.9, mass x 0.98",
        "friction x 0.9, mass x 1.02",
        "friction x 1.1, mass x 0.98",
        "friction x 1.1, mass x 1.02",
        "1 more sample of delay",
        "acceleration of the reference 1 sample later",
        "load of 0.75 N",
    ]


def test_a_delay_beyond_the_margin_that_is_demanded_does_not_count() -> None:
    servo = replace(SERVO, quantum=1e-6)
    found = {case.name: case.counts for case in cases(servo, (0.0, 0.0), (1, 2), 1.5, 0.0)}
    assert found == {
        "1 more sample of delay": True,
        "2 more samples of delay": False,
        "coarser and noisier encoder": True,
        "acceleration of the reference 1 sample later": True,
    }


def test_an_acceleration_that_comes_late_is_that_of_the_sample_before(tmp_path: Path) -> None:
    """The reference of the other run has it in its own table."""
    given = bench(tmp_path)
    (corner,) = run(given, None, (Case("late", late=True),)).corners
    rd = np.gradient(R, 1e-3)
    rdd = np.gradient(rd, 1e-3)
    table = build_record(T, R, rd, np.concatenate([[0.0], rdd[:-1]]), tmp_path, "Late")
    late = run(replace(given, trajectory=replace(given.trajectory, reference=table)), None).metrics
    assert corner.metrics is not None
    assert late is not None
    assert corner.metrics.rms == pytest.approx(late.rms, rel=1e-5)
    assert corner.metrics.rms != pytest.approx(run(given, None).metrics.rms, rel=1e-4)


def test_a_load_that_the_servo_does_not_know_displaces_the_axis(tmp_path: Path) -> None:
    """At rest, a PD servo with the gain Kp gives way by F/Kp; without friction here."""
    still = replace(bench(tmp_path), plant=AxisPlant("Viscous", {"Fv": 50.0}, 1.0))
    still = replace(still, trajectory=replace(still.trajectory, offset=0.0))
    (corner,) = run(still, None, (Case("load", load=1.2),)).corners
    assert corner.metrics is not None
    none = run(still, None).metrics
    assert none is not None
    # the velocity has no mean over a period, so that the squares add up; the axis needs some 30 ms of 1 s to give way
    assert corner.metrics.rms**2 - none.rms**2 == pytest.approx((1.2 / 12e3) ** 2, rel=0.05)


def test_trials_keep_the_limits() -> None:
    known = AxisKnowledge(SERVO, PLANT, {"LuGre": LUGRE}, speed=0.02)
    limits = Limits(2.0, 1.5)
    for candidate in candidates(["DisturbanceObserver", "LuGreObserver", "IntegralAction"], known):
        found = trials(candidate, known, 0.02, limits, (0.5, 1.0))
        assert found
        for scheme in found:
            assert scheme.margins is not None
            assert scheme.margins.Ms is not None
            assert scheme.margins.Ms <= 2.0 + 1e-6
            assert scheme.margins.delay is None or scheme.margins.delay >= 1.5 - 1e-6


def test_integral_action_is_that_of_a_pid_controller() -> None:
    """The corner frequency is Ki/Kp, and that of the velocity loop of a cascade ki/kv."""
    assert with_integral(SERVO, 10.0).gains == {"Kp": 12e3, "Kd": 190.0, "Ki": 12e4}
    cascade = Servo("CascadePPI", {"kp": 50.0, "kv": 200.0, "ki": 0.0}, 1e-3, 20.0)
    assert with_integral(cascade, 10.0).gains["ki"] == 2e3


def test_mismatch_scales_forces_and_mass_alone(tmp_path: Path) -> None:
    given = bench(tmp_path)
    with closed_loop(SERVO, PLANT, given.trajectory) as system:
        found = off_by(system, 1.1, 0.9)
    expected = {f"friction.{name}": 1.1 * LUGRE[name] for name in ("sigma0", "sigma1", "sigma2", "Fc", "Fs")}
    assert found == pytest.approx({**expected, "axis.m": 0.9})


def test_metrics_of_a_sine(tmp_path: Path) -> None:
    given = bench(tmp_path)
    sine = np.sin(2.0 * pi * 10.0 * T)
    metrics, error, failure = judge(LoopTrace(R - 1e-5 * sine, 3.0 * sine), given)
    assert metrics is not None
    assert error is not None
    assert failure == ""
    assert metrics.rms == pytest.approx(1e-5 / sqrt(2.0), rel=1e-3)
    assert metrics.largest == pytest.approx(1e-5, rel=1e-3)
    assert metrics.effort == pytest.approx(3.0 / sqrt(2.0), rel=1e-3)
    assert metrics.variation == pytest.approx(4.0 * 3.0 * 10.0, rel=1e-2)  # 4 amplitudes in each of 10 periods a second


def test_reversals_and_settling(tmp_path: Path) -> None:
    """The reference reverses at 0.5 s; the error leaves the band for 30 ms after that, and for 50 ms later on."""
    given = replace(bench(tmp_path), band=2e-6)
    assert [begin for begin, _ in reversals(R)] == [500]
    assert [begin for begin, _ in reversals(np.concatenate([R[:501], np.full(200, R[500]), R[501:]]))] == [700]
    error = np.zeros(len(T))
    error[500:530] = 1e-5
    error[900:950] = 1e-5
    assert settling(error, given) == pytest.approx(0.030)
    assert settling(0.0 * error, replace(given, r=np.linspace(0.0, 1.0, len(T)))) is None


def test_rest_of_the_reference() -> None:
    r = np.concatenate([np.zeros(300), 1e-3 * np.sin(np.pi * np.linspace(0.0, 0.5, 200)), np.full(50, 1e-3), [0.0]])
    resting = at_rest(r, 1e-3)
    assert np.flatnonzero(resting).tolist() == list(range(50, 300))  # 50 ms at the end are too short


def test_a_loop_that_runs_away_has_no_metrics(tmp_path: Path) -> None:
    metrics, _, failure = judge(LoopTrace(R + 1.0, 0.0 * R), bench(tmp_path))
    assert metrics is None
    assert "unstable" in failure


@pytest.mark.parametrize("frequency", [30.0, 200.0])
def test_high_frequency_force_is_what_a_butterworth_filter_leaves(tmp_path: Path, frequency: float) -> None:
    given = bench(tmp_path)
    force = np.sin(2.0 * pi * frequency * T)
    left = high_frequency(force, given)[300:-300]
    corner = 5.0 * sqrt(12e3) / (2.0 * pi)
    warped = np.tan(pi * corner * 1e-3) / np.tan(pi * frequency * 1e-3)  # the bilinear transform bends the scale
    assert sqrt(2.0 * np.mean(left**2)) == pytest.approx(1.0 / (1.0 + warped**4), rel=0.02)


def test_high_frequency_force_of_an_axis_that_is_too_heavy_for_its_servo(tmp_path: Path) -> None:
    """The corner of the filter lies at one period over the signal: 0.5 Hz here, far below 30 Hz."""
    given = bench(tmp_path)
    heavy = replace(given, plant=replace(given.plant, mass=1e24))
    force = np.sin(2.0 * pi * 30.0 * T)
    left = high_frequency(force, heavy)[300:-300]
    assert sqrt(2.0 * np.mean(left**2)) == pytest.approx(1.0, rel=0.02)


def test_a_thinned_line_keeps_its_peaks() -> None:
    y = np.zeros(100_000)
    y[[31_234, 77_777]] = 5.0, -3.0
    curve = thinned(np.arange(100_000.0), y, points=1000)
    assert len(curve.x) < 1100
    assert curve.x[0] == 0.0
    assert curve.x[-1] == 99_999.0
    assert dict(zip(curve.x, curve.y, strict=True))[31_234.0] == 5.0
    assert min(curve.y) == -3.0


def test_the_period_of_a_reference() -> None:
    assert period_of(np.tile(R[:500], 4), 100) == 500
    smooth = np.cos(2.0 * np.pi * np.arange(3000) / 1000.0) + 0.1 * np.sin(6.0 * np.pi * np.arange(3000) / 1000.0)
    assert period_of(smooth, 100) == 1000
    assert period_of(load_emps().column("reference"), 100) == 6240  # it goes to and fro four times
    assert period_of(np.cumsum(np.tile(R[:500], 4)), 100) == 0
    assert period_of(np.zeros(1000), 100) == 0


def test_candidates_that_do_not_apply_say_why() -> None:
    known = AxisKnowledge(SERVO, PLANT, {"LuGre": LUGRE})
    found = {candidate.name: candidate for candidate in candidates("all", known)}
    assert found["LuGreFeedforward"].model == "LuGre"
    assert "parameters of Dahl" in found["DahlFeedforward"].reason
    assert "this one is not periodic" in found["RepetitiveController"].reason
    (long,) = candidates(["RepetitiveController"], replace(known, period=6240))
    assert "the period of 6240 samples is longer than its limit of 4096" in long.reason
    assert "same feedback gains" in found["AdaptiveLuGre"].reason
    periodic = candidates(["RepetitiveController"], replace(known, period=500))[0].compensator
    assert periodic is not None
    assert periodic.values["N"] == 500
    assert all(candidate.applies != bool(candidate.reason) for candidate in found.values())
    assert found["IntegralAction"].applies


@nightly
def test_a_contact_without_a_servo_ends_with_its_models(tmp_path: Path) -> None:
    windows = {"windows": {"train": [60.0, 66.0], "validation": [120.0, 126.0]}}
    config = load_config("tribometer")
    config = replace(config, models=("Dahl",), data={**config.data, **windows})
    result = run_study(config, tmp_path, processes=1)
    (model,) = result.models
    assert model.rank == 1
    assert model.validation is not None
    assert model.validation.percent < 15.0
    assert result.compensators == ()
    assert result.recommendation.name == ""
    assert "add [servo]" in result.no_compensation
    assert (tmp_path / "report.html").is_file()
    assert not (tmp_path / "recommended").exists()


def start_values(name: str) -> dict[str, float]:
    """Parameters of a friction model as they are in its FMU."""
    model = contact_model(name, LINEAR)
    return {parameter.name: parameter.start for parameter in model.parameters.values()}


FEEDFORWARDS = [name for name, row in compensators().items() if row.kind == "feedforward" and not row.never]


@pytest.mark.parametrize("name", some(FEEDFORWARDS, FEEDFORWARDS[::4]))
def test_every_feedforward_law_is_tried_with_one_of_its_models(name: str, tmp_path: Path) -> None:
    """Each of its models that can be identified gives its parameters, and the law runs on the axis with them."""
    models = sorted(set(compensators()[name].models) & set(identifiable()))
    assert models, f"{name} needs {compensators()[name].models}, none of which a study identifies"
    for model in models:
        (candidate,) = candidates([name], AxisKnowledge(SERVO, PLANT, {model: start_values(model)}))
        assert candidate.compensator is not None, candidate.reason
        assert candidate.model == model
    assert run(bench(tmp_path), candidate.compensator).metrics is not None


def test_modified_leuven_feedforward_has_the_force_of_gms(tmp_path: Path) -> None:
    """Far above the Stribeck velocity both are the same Maxwell slip elements: on an axis with that friction the law
    reduces the error as much as GMSFeedforward does, with the level of sliding taken for constant."""
    values = start_values("GMS") | {"Fs": 1.0, "Fc": 1.0}
    plant = AxisPlant("GMS", values, 1.0, 0.2)
    known = AxisKnowledge(SERVO, plant, {"GMS": values})
    given = replace(bench(tmp_path), plant=plant)
    errors = []
    for name in ("ModifiedLeuvenFeedforward", "GMSFeedforward"):
        with builds_of(name):
            (candidate,) = candidates([name], known)
            metrics = run(given, candidate.compensator).metrics
        assert metrics is not None
        errors.append(metrics.rms)
    none = run(given, None).metrics
    assert none is not None
    assert errors[0] < 0.2 * none.rms
    assert errors[0] == pytest.approx(errors[1], abs=0.02 * none.rms)
