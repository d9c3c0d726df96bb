"""Studies that must not be trusted, and injected forces: a simulated axis with known parameters."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from math import sqrt
from pathlib import Path

import numpy as np
import pytest
import simulated_axis as axis
from thorough import landing, nightly, some

from friction_fmus.__main__ import main
from friction_fmus.axis.servo import Servo
from friction_fmus.blocks.axis_units import units_of_channels
from friction_fmus.cli.axis_tables import show_first_look
from friction_fmus.data import load_emps
from friction_fmus.identification import Record
from friction_fmus.identification.force_findings import contradictions, drive_balance, drive_equations
from friction_fmus.study import load_config
from friction_fmus.study.data import load_data, measured_servo
from friction_fmus.study.model_ranking import IdentifiedModel, Measured, identify_model, in_closed_loop, refine
from friction_fmus.study.servo_check import check_servo
from friction_fmus.study.study_result import Fit, ModelResult
from friction_fmus.study.trust import dry_friction_findings, force_findings, loop_growth
from harness import System
from harness.system.wire import parse_wire

REST = """
[identify]
models = ["Stribeck"]

[compensation]
compensators = ["StaticFeedforward"]
duration = 2.0
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Logs of the axis with and without pulses, and the configurations of studies of them."""
    found = tmp_path_factory.mktemp("axis")
    plain, pulses = axis.simulate(6.0), axis.simulate(12.0, 90.0)
    plain.write(found / "plain.csv")
    plain.write(found / "minus.csv", force=-plain.force)
    pulses.write(found / "pulses.csv")
    for name in ("plain", "minus", "pulses"):
        (found / f"{name}.toml").write_text(f'[data]\nfile = "{name}.csv"\n{axis.SERVO}{REST}', encoding="utf-8")
    hundredth = axis.SERVO.replace("kv = 8500.0", "kv = 85.0")
    (found / "gain.toml").write_text(f'[data]\nfile = "plain.csv"\n{hundredth}{REST}', encoding="utf-8")
    columns = '[columns]\ntime = "time"\nposition = "position"\nforce = { column = "force", unit = "mN" }\n'
    (found / "unit.toml").write_text(f'[data]\nfile = "plain.csv"\n{columns}{axis.SERVO}{REST}', encoding="utf-8")
    return found


@pytest.mark.parametrize(
    ("name", "finding"),
    some(
        [("gain", "wrong-unit-or-gain"), ("minus", "wrong-sign"), ("unit", "mass-contradicts-servo")],
        [("minus", "wrong-sign")],
    ),
)
def test_nothing_is_ranked_and_no_fmu_is_written(
    folder: Path, name: str, finding: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["study", str(folder / f"{name}.toml"), "-o", str(tmp_path / "out"), "--workers", "1"]) == 1
    printed = " ".join(capsys.readouterr().out.split())
    assert f"{finding}: " in printed
    assert "No recommendation" in printed
    content = json.loads((tmp_path / "out" / "study.json").read_text(encoding="utf-8"))
    assert [each["name"] for each in content["findings"] if each["stops"]] == [finding]
    assert content["compensators"] == []
    assert not list((tmp_path / "out").rglob("*.fmu"))
    assert not (tmp_path / "out" / "recommended").exists()
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert f'<strong class="bad">{finding}</strong>: ' in page
    assert f"the result cannot be trusted ({finding})" in page


@nightly
def test_files_are_written_by_force(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert main(["study", str(folder / "unit.toml"), "-o", str(out), "--workers", "1", "--force"]) == 1
    assert (out / "models" / "Stribeck.fmu").is_file() or list((out / "models").glob("*.fmu"))


def measured(folder: Path, *, known: bool) -> tuple[Measured, IdentifiedModel, tuple[tuple[Record, ...], ...]]:
    """The axis with pulses and its Stribeck model; the simulated servo receives the pulses only if they are known."""
    config = load_config(folder / "pulses.toml")
    assert config.servo is not None
    data = load_data(config, folder)
    checked = check_servo(data.longest, config.servo)
    assert checked.injected is not None
    data = data.with_total_force(checked.included)
    servo = measured_servo(data, config.servo, folder, "Axis", checked.injected if known else None)
    assert servo is not None
    found = identify_model("Stribeck", data.train, data.validation, {}, servo)
    return servo, found, (data.train, data.validation)


def percent(model: IdentifiedModel) -> float:
    return {fit.signal: fit.percent for fit in model.row.closed_loop}["force"]


@nightly
def test_a_refinement_that_makes_the_force_worse_is_discarded(folder: Path) -> None:
    """The pulses are not simulated: a fit to the position alone would take them for friction and offset."""
    servo, found, records = measured(folder, known=False)
    refined = refine(found, servo, *records)
    assert refined.values == found.values
    assert (refined.mass, refined.offset) == (found.mass, found.offset)
    assert any("discarded" in warning and "force" in warning for warning in refined.row.warnings)
    assert found.offset == pytest.approx(axis.OFFSET, abs=0.2)
    # the parameters to which this fit leads on this record
    worse = replace(found, mass=104.6, offset=-15.3, values={**found.values, "Fc": 9.7, "Fs": 11.3, "Fv": 366.0})
    simulated = in_closed_loop(worse, servo)
    assert simulated.error is not None
    assert found.error is not None
    assert simulated.error < found.error  # the position alone would accept it
    assert percent(simulated) > 1.3 * percent(found)


@nightly
def test_a_refinement_with_known_pulses_finds_the_truth(folder: Path) -> None:
    servo, found, records = measured(folder, known=True)
    refined = refine(found, servo, *records)
    assert "closed-loop" in refined.row.method
    assert refined.mass == pytest.approx(axis.M, rel=1e-3)
    assert refined.offset == pytest.approx(axis.OFFSET, abs=0.02)
    assert refined.values["Fc"] == pytest.approx(axis.FC, rel=5e-3)
    assert refined.values["Fv"] == pytest.approx(axis.FV, rel=5e-3)
    true = {**found.values, "Fc": axis.FC, "Fs": axis.FC, "Fv": axis.FV}
    truth = in_closed_loop(replace(found, mass=axis.M, offset=axis.OFFSET, values=true), servo)
    assert truth.error is not None
    assert refined.error is not None
    assert found.error is not None
    assert refined.error < 1.02 * truth.error < found.error  # what the encoder leaves
    assert percent(refined) < percent(found)


@nightly
def test_without_other_data_nothing_is_refined(folder: Path) -> None:
    servo, found, (train, _) = measured(folder, known=True)
    assert refine(found, servo, train, ()) is found


@nightly
def test_the_study_of_pulses_uses_them(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["study", str(folder / "pulses.toml"), "-o", str(out), "--workers", "1"]) == 0
    assert "injected-force: " in capsys.readouterr().out
    content = json.loads((out / "study.json").read_text(encoding="utf-8"))
    for model in content["models"]:
        fits = {fit["signal"]: fit for fit in model["closed_loop"]}
        assert fits["force"]["percent"] < 3.0
        assert fits["position"]["rms"] < 1e-6
    with System.from_ssp(out / "recommended" / "axis.ssp") as system:
        constant = [parse_wire(wire).offset for wire in system.wires if parse_wire(wire).target == "servo.f"]
        constant += [float(value) for name, value in system.start.items() if name == "servo.f"]
    assert constant == [pytest.approx(axis.OFFSET, abs=0.1)]


def test_balance_of_the_drive_force() -> None:
    log = axis.simulate(8.0)
    record = Record("axis", log.t, q=log.q, force=log.force)
    equations = drive_equations([record])
    assert equations is not None
    balance = drive_balance(equations)
    assert balance is not None
    assert balance.mass == pytest.approx(axis.M, rel=0.01)
    assert balance.dissipated > 0.9  # over whole strokes the drive supplies what friction dissipates
    assert contradictions([record]) == ()
    assert contradictions([load_emps()]) == ()
    cases = {
        "wrong-sign": -log.force,
        "implausible-mass": 1e20 * log.force,
        "negative-mass": log.force + 2e4 * log.q,
        "mass-not-identified": log.force + 3e3 * np.random.default_rng(0).standard_normal(len(log.t)),
    }
    for name, force in cases.items():
        (finding,) = contradictions([replace(record, force=force)])
        assert finding.name == name


@landing
@pytest.mark.parametrize(("height", "name"), [(90.0, "missing-force"), (10.0, "disturbed-force")])
def test_pulses_that_the_recorded_force_does_not_contain(height: float, name: str) -> None:
    """The log has the force of the servo alone; the law reproduces it, but mass and friction do not."""
    log = axis.simulate(8.0, height)
    record = Record("axis", log.t, q=log.q, force=log.force - log.injected)
    (finding,) = contradictions([record])
    assert finding.name == name
    start, size = map(float, re.findall(r"first one at ([\d.]+) s.* about ([\d.]+) N", finding.what)[0])
    assert start == pytest.approx(0.7, abs=0.02)
    assert size == pytest.approx(height, rel=0.1)
    assert contradictions([replace(record, injected=log.injected)]) == ()


def test_strokes_within_the_stribeck_range(capsys: pytest.CaptureFixture[str]) -> None:
    """Friction 20 N + 10 N exp(-(v/vs)^2) + 40 N.s/m v of 12 kg, in closed form along a motion of 5 mm/s."""
    t = 1e-3 * np.arange(20000.0)
    w = 2.0 * np.pi * 0.4
    q, v, a = 2e-3 * np.sin(w * t), 2e-3 * w * np.cos(w * t), -2e-3 * w**2 * np.sin(w * t)

    def record(vs: float) -> Record:
        noise = 0.1 * np.random.default_rng(2).standard_normal(len(t))
        friction = np.sign(v) * (20.0 + 10.0 * np.exp(-((v / vs) ** 2))) + 40.0 * v
        return Record("slow", t, q=q, force=12.0 * a + friction + noise)

    (finding,) = [each for each in contradictions([record(6e-3)]) if each.name != "mass-not-identified"]
    assert finding.name == "stribeck-range-not-left"
    assert "faster strokes" in finding.measure
    show_first_look([record(6e-3)])
    assert "do not use Fv and Fc at other speeds" in capsys.readouterr().out
    left = contradictions([record(2e-4)])
    assert "stribeck-range-not-left" not in [each.name for each in left]


def test_a_reference_of_the_wrong_sign() -> None:
    log = axis.simulate(4.0)
    record = Record("axis", log.t, q=log.q, reference=-log.r, force=log.force)
    (finding,) = contradictions([record])
    assert finding.name == "reference-opposed"
    assert "Set sign = -1 for the reference" in finding.measure
    assert contradictions([replace(record, reference=log.r)]) == ()


@pytest.mark.parametrize(("part", "names"), [(0.5e-3, ["no-dry-friction"]), (2e-3, [])])
def test_a_record_without_dry_friction(part: float, names: list[str]) -> None:
    t = np.arange(0.0, 1.0, 1e-3)
    force = 30.0 * sqrt(2.0) * np.sin(40.0 * np.pi * t)  # 20 periods: 30 N rms
    record = Record("free", t, q=np.zeros_like(t), force=force)
    best = IdentifiedModel(ModelResult("Coulomb", ""), "Stribeck", {"Fc": 30.0 * part, "Fs": 30.0 * part}, 1.0)
    assert [each.name for each in dry_friction_findings([best], record)] == names
    viscous = IdentifiedModel(ModelResult("Viscous", ""), "Viscous", {"Fv": 1.0}, 1.0)
    assert dry_friction_findings([viscous], record) == ()  # no other model was tried
    assert [each.name for each in dry_friction_findings([viscous, best], record)] == ["no-dry-friction"]
    assert dry_friction_findings([IdentifiedModel(ModelResult("Coulomb", "", reason="failed"))], record) == ()
    values = {**best.values, "N": 1.0, "k[1]": 1e4}  # sigma was not identified
    assert [each.name for each in dry_friction_findings([replace(best, block="GMS", values=values)], record)] == names


@pytest.mark.parametrize(("percent", "unit", "found"), [(91.0, "A", True), (30.0, "A", False), (91.0, "m", False)])
def test_a_force_that_no_model_explains(percent: float, unit: str, found: bool) -> None:
    """A joint that others move says nothing about dry friction; a residual of the position is another matter."""
    t = np.arange(100) * 0.01
    record = Record("joint", t, q=np.sin(t), force=np.cos(t), units=units_of_channels("m", "A"))
    row = ModelResult("Coulomb", "", train=Fit(9.1, percent, "force", unit), rank=1)
    row = replace(row, validation=Fit(9.1, 97.0, "force", unit))  # of a sweep, the filter may leave noise at the end
    (finding,) = dry_friction_findings([IdentifiedModel(row, "Coulomb", {"Fc": 0.0}, 1.0)], record)
    assert finding.name == ("force-not-explained" if found else "no-dry-friction")
    assert not found or "leaves 91 % of the current: noise, another force, or a wrong column" in finding.what


def test_a_force_beyond_the_limit_of_the_servo() -> None:
    log = axis.simulate(4.0)
    record = Record("axis", log.t, q=log.q, force=10.0 * log.force)
    servo = Servo("CascadePPI", {"kp": axis.KP, "kv": axis.KV, "ki": 0.0}, axis.TS, axis.LIMIT)
    assert [finding.name for finding in force_findings([record], servo)] == ["force-beyond-limit"]
    assert force_findings([record], None) == ()


def test_growth_of_a_loop_in_closed_form() -> None:
    """A velocity loop over one sample measures the mean of two velocities: its poles are the roots of
    z^2 + (g/2 - 1) z + g/2 with g = Kd Ts/m, of magnitude sqrt(g/2) if they are complex. The poles of a free mass with
    Kp alone have the squared magnitude 1 + Kp Ts^2/(2 m)."""
    velocity = Servo("PID", {"Kp": 1e-9, "Kd": 300.0, "Ki": 0.0}, 1e-3, 1.0, window=1)
    assert loop_growth(velocity, 0.1, 0.0) == pytest.approx(sqrt(1.5), rel=1e-6)
    position = Servo("PID", {"Kp": 1e4, "Kd": 1e-9, "Ki": 0.0}, 1e-3, 1.0, window=1)
    assert loop_growth(position, 0.1, 0.0) == pytest.approx(sqrt(1.0 + 1e4 * 1e-6 / 0.2), rel=1e-6)
    # viscous friction alone: exp(-Fv Ts/m) is within the unit circle, and the position stays
    free = replace(position, gains={"Kp": 0.0, "Kd": 0.0, "Ki": 0.0})
    assert loop_growth(free, 0.1, 50.0) == pytest.approx(1.0)


@nightly
def test_identify_writes_no_fmu_of_a_wrong_sign(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["identify", str(folder / "minus.csv"), "--model", "Coulomb", "--workers", "1", "-o"]
    assert main([*command, str(tmp_path / "out")]) == 1
    assert "wrong-sign" in capsys.readouterr().out
    assert not list((tmp_path / "out").glob("*.fmu"))
    assert main([*command, str(tmp_path / "forced"), "--force"]) == 1
    assert list((tmp_path / "forced").glob("*.fmu"))
