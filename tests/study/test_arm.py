"""Gravity and friction under load in a study: the simulated axis and its C against an arm with steps of its own."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from math import cos, sin
from pathlib import Path

import numpy as np
import pytest
from identification.arms import Arm
from independent_arm import ARM, GAINS, LIMIT, TS, exported, follow, moves, servo
from independent_axis import law_of_loop
from thorough import landing

from friction_fmus.axis.loop_assembly import load_feedforward
from friction_fmus.axis.position_map import gravity_map
from friction_fmus.axis.servo import AxisPlant, Compensator, Trajectory
from friction_fmus.axis.servo_loop import closed_loop, run_loop
from friction_fmus.blocks.axis_units import units_of_channels
from friction_fmus.blocks.catalogue import find
from friction_fmus.codegen.servo_law import LOOP_FILE, loop_text
from friction_fmus.identification import ROTARY, Record
from friction_fmus.study import Servo
from friction_fmus.study.data import build_reference
from friction_fmus.study.model_ranking import IdentifiedModel, Measured, identify_model, in_closed_loop, refine
from friction_fmus.study.pictures import friction_of, load_along
from friction_fmus.study.study_files import recommended_loop
from friction_fmus.study.study_result import IdentifiedParameter, ModelResult
from friction_fmus.study.trust import band_of

SERVO = Servo("PID", GAINS, TS, LIMIT, quantum=1e-5, velocity_feedforward=True)
FRICTION = {"Fc": ARM.Fc, "Fs": ARM.Fs, "vs": ARM.vs, "Fv": ARM.Fv, "Fn0": ARM.Fc}
TERMS = {"G_sin": ARM.G_sin, "G_cos": ARM.G_cos, "a_drive": ARM.a, "a_external": ARM.a}
PLANT = AxisPlant("Stribeck", FRICTION, ARM.M, ARM.OF, gravity_map(ARM.G_sin, ARM.G_cos), terms=TERMS)


def record(arm: Arm = ARM) -> Record:
    angle, torque = follow(arm, servo())
    t = TS * np.arange(float(len(angle)))
    return Record("arm", t, q=1e-5 * np.round(angle / 1e-5), force=torque, reference=moves()[0], units=ROTARY)


def trajectory(folder: Path, *, motion: bool) -> Trajectory:
    r = moves()[0]
    reference = build_reference(TS * np.arange(float(len(r))), r, folder, "Moves", rotary=True)
    return Trajectory(reference, len(r), float(r[0]), 0.0, motion=motion, rotary=True)


def test_a_turn_of_gravity_is_a_table_within_a_millionth() -> None:
    q = np.linspace(-7.0, 7.0, 5001)
    found = gravity_map(2.0, -0.5).force(q, np.zeros(len(q)))
    assert np.max(np.abs(found + 2.0 * np.sin(q) - 0.5 * np.cos(q))) < 2e-6


@landing
def test_the_servo_moves_the_simulated_arm_as_the_true_one(tmp_path: Path) -> None:
    """The axis with its servo as measured: 0.5 % of the tracking error, with both implementations of each part."""
    angle, torque = follow(ARM, servo())
    with closed_loop(SERVO, PLANT, trajectory(tmp_path, motion=False)) as system:
        trace = run_loop(system)
    r = moves()[0]
    assert np.sqrt(np.mean((trace.q - angle) ** 2)) < 5e-3 * np.sqrt(np.mean((r - angle) ** 2))
    assert np.sqrt(np.mean((trace.force - torque) ** 2)) < 2e-2 * np.sqrt(np.mean(torque**2))


@landing
@pytest.mark.parametrize("law", ["StaticFeedforward", "none"])
def test_the_c_of_a_loop_with_load_achieves_what_is_simulated(law: str, tmp_path: Path) -> None:
    values = {**FRICTION, "m": 0.0, "v_rest": 1e-6}
    laws = {} if law == "none" else {"compensator": Compensator(law, "u", values)}
    load = load_feedforward(PLANT)
    assert load is not None
    course = trajectory(tmp_path, motion=True)
    with closed_loop(SERVO, PLANT, course, laws.get("compensator")) as system:
        trace = run_loop(system)
        given = {"load": load.values, "compensator": values}
        loop = recommended_loop(system, SERVO, {"load": load, **laws}, given, course, tmp_path / LOOP_FILE)
    r = moves()[0]
    content = tomllib.loads(loop_text(loop, "Arm"))
    angle, _ = follow(ARM, exported(law_of_loop(content, tmp_path)))
    claimed, achieved = (float(np.sqrt(np.mean((r - q) ** 2))) for q in (trace.q, angle))
    assert claimed == pytest.approx(achieved, rel=0.03)
    assert achieved < (3e-4 if laws else 1e-2)


@landing
def test_gravity_and_load_of_a_record_are_identified() -> None:
    measured = record()
    half = float(measured.t[len(measured) * 2 // 3])
    train, rest = measured.window(0.0, half), measured.window(half, float(measured.t[-1]))
    found = identify_model("Stribeck", [train], [rest], {}, None)
    plant = found.plant
    assert plant.loaded
    for name in ("G_sin", "G_cos", "a_drive", "a_external"):
        assert plant.terms[name] == pytest.approx(TERMS[name], rel=0.05, abs=0.02)
    assert plant.mass == pytest.approx(ARM.M, rel=0.05)
    assert plant.values["Fc"] == plant.values["Fn0"] == pytest.approx(ARM.Fc, rel=0.05)
    friction, load = friction_of(measured, found), load_along(found, measured)
    assert friction is not None
    slides = np.abs(friction[1]) > 0.5
    expected = np.sign(friction[1]) * load["Fn"] + ARM.Fv * friction[1]
    assert np.median(np.abs(friction[2] - expected)[slides]) < 0.02


@landing
@pytest.mark.parametrize(("name", "factor", "tolerance"), [("Fc", 0.8, 0.03), ("a", 0.7, 0.05)])
def test_the_fit_to_the_closed_loop_corrects_friction_under_load(
    tmp_path: Path, name: str, factor: float, tolerance: float
) -> None:
    """A Coulomb friction, or the friction over the transmitted force, that is too small; the other one stays right."""
    measured = record()
    n = len(measured)
    train, rest = measured.window(0.0, float(measured.t[n // 2])), measured.window(float(measured.t[n // 2]), n * TS)
    values = {"M": ARM.M, "Fc": ARM.Fc, "Fs": ARM.Fs, "Fv": ARM.Fv} | ({"a": ARM.a} if name == "a" else {})
    values[name] *= factor
    rows = tuple(IdentifiedParameter(each, value, 0.01 * value, "1", "") for each, value in values.items())
    friction = {**FRICTION, "Fc": values["Fc"], "Fn0": values["Fc"]}
    terms = TERMS | dict.fromkeys(("a_drive", "a_external"), values.get("a", ARM.a))
    row = ModelResult("Stribeck", find("Stribeck").name, parameters=rows)
    table = gravity_map(ARM.G_sin, ARM.G_cos)
    wrong = IdentifiedModel(row, "Stribeck", friction, ARM.M, position_map=table, terms=terms)
    servo_of_record = Measured(
        SERVO, trajectory(tmp_path, motion=False), measured.q, measured.force, moves()[0], (0, n // 2), (n // 2, n)
    )
    plant = (found := refine(in_closed_loop(wrong, servo_of_record), servo_of_record, [train], [rest])).plant
    assert found.row.method.endswith("closed-loop")
    assert plant.values["Fn0"] == plant.values["Fc"] == pytest.approx(ARM.Fc, rel=tolerance)
    assert plant.terms["a_drive"] == plant.terms["a_external"] == pytest.approx(ARM.a, rel=tolerance)


def test_an_arm_at_rest_under_load_does_not_narrow_the_band_of_its_mass() -> None:
    """At rest, friction is the force within its limits, which the load widens: the band is that without load."""
    row, unloaded = ModelResult("Stribeck", find("Stribeck").name), replace(ARM, a=0.0)
    table, bands = gravity_map(ARM.G_sin, ARM.G_cos), []
    for arm, terms in ((ARM, TERMS), (unloaded, {**TERMS, "a_drive": 0.0, "a_external": 0.0})):
        found = IdentifiedModel(row, "Stribeck", FRICTION, ARM.M, position_map=table, terms=terms)
        bands.append(band_of([record(arm)], found))
    assert bands[0] is not None
    assert bands[1] is not None
    assert bands[0].supported > 0.8 * bands[1].supported > 5.0


@landing
def test_an_axis_without_load_has_a_constant_normal_force(tmp_path: Path) -> None:
    """A friction that was identified at a normal force of 40 N has it in the axis, and its law has it, too."""
    plant = AxisPlant("Stribeck", {**FRICTION, "Fn0": 40.0}, ARM.M)
    law = Compensator("StaticFeedforward", "u", {**FRICTION, "Fn0": 40.0, "m": 0.0})
    with closed_loop(SERVO, plant, trajectory(tmp_path, motion=True), law) as system:
        assert {name: value for name, value in system.start.items() if name.endswith(".Fn")} == {
            "friction.Fn": 40.0,
            "compensator.Fn": 40.0,
        }


def test_friction_without_load_is_drawn_with_its_own_normal_force() -> None:
    from friction_fmus.study.pictures import driven_friction

    row = ModelResult("Stribeck", find("Stribeck").name)
    found = IdentifiedModel(row, "Stribeck", FRICTION, ARM.M, terms=TERMS)
    v = np.full(50, 2.0)
    F = driven_friction(found, ROTARY, 0.01 * np.arange(50.0), v, {})
    assert F[-1] == pytest.approx(ARM.Fc + 2.0 * ARM.Fv, rel=1e-6)
    loaded = driven_friction(found, ROTARY, 0.01 * np.arange(50.0), v, {"Fn": np.full(50, 3.0 * ARM.Fc)})
    assert loaded[-1] == pytest.approx(3.0 * ARM.Fc + 2.0 * ARM.Fv, rel=1e-6)


@pytest.mark.parametrize(("position", "force"), [("1", "1"), ("mm", "A"), ("rad", "A"), ("u.s", "mA")])
def test_friction_in_the_units_of_a_file_is_drawn(position: str, force: str) -> None:
    """A block has SI units, whatever the numbers of a file without scales mean."""
    from friction_fmus.study.pictures import driven_friction

    found = IdentifiedModel(ModelResult("Coulomb", find("Coulomb").name), "Coulomb", {"Fc": 0.5}, 1.0)
    F = driven_friction(found, units_of_channels(position, force), 0.01 * np.arange(50.0), np.full(50, -3.0), {})
    assert F[-1] == pytest.approx(-0.5, rel=1e-12)


def test_the_load_of_the_reference_reaches_the_law(tmp_path: Path) -> None:
    law = Compensator("LuGreFeedforward", "u", {"Fn0": ARM.Fc})
    with closed_loop(SERVO, PLANT, trajectory(tmp_path, motion=True), law) as system:
        wires = {wire.target: wire.source for wire in system.wires}
    assert wires["compensator.Fn"] == "load.Fn"
    assert wires["friction.Fn"] == "transmission.Fn"
    assert wires["transmission.F_drive"] == wires["axis.F_drive"] == "motor.y"


def test_the_friction_feedforward_of_a_drive_does_not_know_the_load(tmp_path: Path) -> None:
    """The drive adds a constant force in the direction of the reference; 1 % of the tracking error of the true arm."""
    drive, fed = replace(SERVO, coulomb_feedforward=1.0), servo()

    def torque(r: float, rd: float, rdd: float, x: float) -> float:
        gravity = ARM.G_sin * sin(r) + ARM.G_cos * cos(r)
        return fed(r, rd, rdd, x) + ARM.M * rdd + gravity + float(np.sign(rd))

    with closed_loop(drive, PLANT, trajectory(tmp_path, motion=True)) as system:
        trace = run_loop(system)
    r = moves()[0]
    error = r - follow(ARM, torque)[0]
    assert np.sqrt(np.mean((r - trace.q - error) ** 2)) < 1e-2 * np.sqrt(np.mean(error**2))
