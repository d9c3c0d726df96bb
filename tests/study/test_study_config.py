"""Configurations of a study: what they say, and what is said about those that are wrong."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from friction_fmus.axis.loop_assembly import with_friction
from friction_fmus.axis.servo import Compensator, LowPass, Notch
from friction_fmus.blocks.catalogue import catalogue
from friction_fmus.identification import DataMapping, Measurement, Record
from friction_fmus.study import ConfigError, Servo, StudyConfig, StudyError, load_config, parse_config, run_study
from friction_fmus.study.compensators import check_names, compensators
from friction_fmus.study.config import OF_RECORD
from friction_fmus.study.data import check_fits

SERVO: dict[str, Any] = {"law": "PID", "Kp": 1e4, "Kd": 100.0, "Ts": 1e-3, "force_limit": 50.0}
PD: dict[str, Any] = {**SERVO, "Ki": 0.0}
DATA: dict[str, Any] = {"data": {"file": "log.csv"}}


@pytest.mark.parametrize("name", ["emps", "tribometer", "demo"])
def test_studies_of_the_package_are_configurations(name: str) -> None:
    config = load_config(name)
    assert config.record == config.name == name
    assert (config.servo is None) == (name == "tribometer")


def test_a_configuration_is_read(tmp_path: Path) -> None:
    file = tmp_path / "axis.toml"
    file.write_text(
        '[data]\nfile = "log.csv"\n'
        '[columns]\ntime = { column = "t", unit = "s" }\nposition = { column = "x", unit = "mm" }\n'
        '[servo]\nlaw = "CascadePPI"\nkp = 50\nkv = 2000.0\nki = 10.0\nTs = 5e-4\nforce_limit = 80\nwindow = 4\n'
        "[axis]\nresonance = [22, 8.0]\n"
        '[identify]\nmodels = ["LuGre"]\n'
        "[compensation]\ngains = [1.0, 0.5, 1.0]\nmismatch = 0.2\nmotion_feedforward = false\n",
        encoding="utf-8",
    )
    config = load_config(file)
    assert config.folder == tmp_path
    assert config.data["columns"]["position"]["unit"] == "mm"
    gains = {"kp": 50.0, "kv": 2000.0, "ki": 10.0}
    assert config.servo == Servo("CascadePPI", gains, 5e-4, 80.0, window=4, quantum=OF_RECORD)
    assert config.models == ("LuGre",)
    assert config.compensation.gains == (0.5, 1.0)
    assert config.compensation.mismatch == 0.2
    assert not config.compensation.motion_feedforward
    assert config.resonances == (8.0, 22.0)


def test_filters_and_friction_of_a_drive_are_read_and_written() -> None:
    drive: dict[str, Any] = {
        "velocity_filter": {"order": 2, "cutoff": 60.0},
        "notch": {"frequency": 120.0, "damping": 0.5},
        "coulomb_feedforward": 10.0,
        "viscous_feedforward": 2.5,
        "current_loop": 300.0,
        "logged_force": "command",
    }
    servo = parse_config({**DATA, "servo": {**PD, **drive}}).servo
    assert servo is not None
    assert (servo.velocity_filter, servo.notch) == (LowPass(2, 60.0), Notch(120.0, 0.5, 0.0))
    written = tomllib.loads("\n".join(f"{key} = {value}" for key, value in servo.features.items()))
    assert parse_config({**DATA, "servo": {**PD, **written}}).servo == servo


@pytest.mark.parametrize(("law", "stays"), [("", True), ("DisturbanceObserver", True), ("LuGreFeedforward", False)])
def test_the_friction_feedforward_of_a_drive_stays_beside_laws_without_a_friction_model(law: str, stays: bool) -> None:
    servo = Servo("PID", {"Kp": 1.0, "Kd": 1.0, "Ki": 0.0}, 1e-3, 1.0, coulomb_feedforward=3.0)
    given = Compensator(law) if law else None
    together = [each for each in with_friction(servo, given, None) if each is not None]
    assert (servo.friction in together) == stays
    assert (given is None) or given in together


def test_a_cascade_is_a_pid() -> None:
    servo = Servo("CascadePPI", {"kp": 50.0, "kv": 2000.0, "ki": 10.0}, 1e-3, 1.0)
    assert servo.pid == (2000.0 * 50.0 + 10.0, 2000.0, 10.0 * 50.0)


ON_A_SCREW = {"law": "CascadePPI", "Ts": "0.5 ms", "torque_constant": "0.4 N.m/A", "pitch": "10 mm"}
TURNS = 2.0 * pi / 0.01  # angle of the motor per way of the axis [rad/m]


@pytest.mark.parametrize(
    ("drive", "gains"),
    [
        ({"kp": "1.2 m/min/mm", "kv": "50 mA/rpm", "Tn": "25 ms"}, {"kp": 20.0}),
        ({"kp": "120 rpm/mm", "kv": "0.02 N.m/rpm", "Tn": 0.025}, {"kp": 20.0}),
        ({"kp": "20 1/s", "kv": "0.191 N.m/(rad/s)", "ki": "3.056 A/mm"}, {"kv": 0.191 * TURNS**2, "ki": 768054.6}),
    ],
)
def test_gains_in_the_units_of_the_drive(drive: dict[str, Any], gains: dict[str, float]) -> None:
    """A force is the torque times 2 pi over pitch, a speed of the motor that of the axis times the same."""
    servo = parse_config({**DATA, "servo": {**ON_A_SCREW, "force_limit": "6 A", **drive}}).servo
    assert servo is not None
    kv = 0.05 * 0.4 * 60.0 / (2.0 * pi) * TURNS**2
    expected = {"kp": 20.0, "kv": kv, "ki": kv / 0.025, **gains}
    assert servo.gains == pytest.approx(expected, rel=1e-5)
    assert (servo.Ts, servo.force_limit) == (0.5e-3, pytest.approx(6.0 * 0.4 * TURNS))


def test_the_units_of_a_rotary_axis_and_the_torque_constant_of_its_column() -> None:
    columns = {"position": {"column": "q", "unit": "deg"}, "force": {"column": "iq", "unit": "mA", "gain": "0.5 N.m/A"}}
    drive = {"law": "PID", "Kp": "3 A/deg", "Kd": "0.5 A/rpm", "Tn": "0.1 s", "Ts": 1e-3, "force_limit": "10 A"}
    drive |= {"mass": "20 kg.cm2", "quantum": "0.01 deg", "current_loop": "0.8 kHz", "logged_force": "actual"}
    config = parse_config({**DATA, "columns": columns, "servo": drive})
    assert config.rotary
    servo = config.servo
    assert servo is not None
    Kp = 3.0 * 0.5 * 180.0 / pi
    assert servo.gains == pytest.approx({"Kp": Kp, "Kd": 0.25 * 60.0 / (2.0 * pi), "Ki": Kp / 0.1})
    assert (servo.force_limit, servo.mass, servo.quantum) == pytest.approx((5.0, 2e-3, 0.01 * pi / 180.0))
    assert (servo.current_loop, servo.logged_force) == (800.0, "actual")


def test_units_of_a_rotary_axis_do_not_fit_a_record_in_metres() -> None:
    drive = {**PD, "Kp": "3 N.m/deg"}
    record = Record("axis", 1e-3 * np.arange(10.0), q=np.zeros(10), reference=np.zeros(10))
    with pytest.raises(ConfigError, match=r"\[servo\] has units of a rotary axis, .* in m; add pitch = \"10 mm\""):
        check_fits(parse_config({**DATA, "servo": drive}), record)
    check_fits(parse_config({**DATA, "servo": {**drive, "pitch": "10 mm"}}), record)


WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "table": ({**DATA, "servos": {}}, r"unknown table 'servos'; did you mean 'servo'\?"),
    "resonance": ({**DATA, "axis": {"resonance": [-8.0]}}, r"\[axis\],.* resonance .*frequencies in Hz above 0"),
    "filter": ({**DATA, "servo": {**PD, "velocity_filter": {"cut": 8.0}}}, r"velocity_filter, .*unknown key 'cut'"),
    "cutoff": (
        {**DATA, "servo": {**PD, "velocity_filter": {"cutoff": 600.0}}},
        r"velocity_filter, has cutoff = 600.0; give a frequency in Hz above 0 and below 500, half of the sample rate",
    ),
    "order": (
        {**DATA, "servo": {**PD, "velocity_filter": {"order": 3, "cutoff": 60.0}}},
        r"velocity_filter, has order = 3; give an integer from 1 to 2",
    ),
    "notch": ({**DATA, "servo": {**PD, "notch": 120.0}}, r"notch, is 120.0, not a table"),
    "no data": ({}, r"\[data\], has no file; give the path"),
    "two data": (
        {"data": {"record": "emps", "file": "x.csv"}},
        r"\[data\], names the record 'emps' and also",
    ),
    "record": (
        {"data": {"record": "emp"}},
        r"\[data\], has record = 'emp'; give .* \(did you mean 'emps'\?\)",
    ),
    "law": (
        {**DATA, "servo": {**SERVO, "law": "PI"}},
        r"\[servo\], has law = 'PI'; give .* \(did you mean 'PID'\?\)",
    ),
    "gain": ({**DATA, "servo": {**SERVO, "kp": 1.0}}, r"\[servo\], has the unknown key 'kp'; did you mean 'Kp'\?"),
    "missing": (
        {**DATA, "servo": {key: value for key, value in SERVO.items() if key != "Ts"}},
        r"\[servo\], has no Ts; add it",
    ),
    "text": (
        {**DATA, "servo": {**SERVO, "Ts": "1 mm"}},
        r"\[servo\], has Ts = '1 mm'; give it in s or multiples, such as \"20 ms\"",
    ),
    "unknown unit": (
        {**DATA, "servo": {**PD, "Kd": "2 A/rmp"}},
        r"\[servo\], Kd is '2 A/rmp', .* not a number with a known unit; use the form '0.5 A/rpm'",
    ),
    "volt": (
        {**DATA, "servo": {**PD, "Kd": "2 V/rpm"}},
        r"\[servo\], has Kd = '2 V/rpm'; on a linear axis, give it in N/\(m/s\), A/\(m/s\), .* or multiples",
    ),
    "frequency": ({**DATA, "servo": {**PD, "Kd": "2 N/Hz"}}, r"has Kd = '2 N/Hz'; on a linear axis, give it in N/"),
    "constant": (
        {**DATA, "servo": {**PD, "Kd": "2 A/rpm"}, "columns": {"position": {"column": "q", "unit": "deg"}}},
        r"has Kd = '2 A/rpm'; add torque_constant = \"0.5 N.m/A\"",
    ),
    "constant in V": (
        {**DATA, "servo": {**PD, "Kd": "2 A/rpm", "torque_constant": "2 V/A"}},
        r"has torque_constant = '2 V/A'; give it above 0 in N.m/A or N/A",
    ),
    "constant below 0": (
        {**DATA, "servo": {**PD, "Kd": "2 A/rpm", "torque_constant": "-2 N/A"}},
        r"has torque_constant = '-2 N/A'; give it above 0 in N.m/A or N/A",
    ),
    "no pitch": (
        {**DATA, "servo": {**PD, "Kd": "2 A/rpm", "torque_constant": "2 N/A"}},
        r"has Kd = '2 A/rpm'; on a linear axis, add pitch = \"10 mm\", the way per turn",
    ),
    "pitch": (
        {**DATA, "servo": {**PD, "Kd": "2 N.m/rpm", "pitch": 10}},
        r"has pitch = 10; give the way per turn of the motor with its unit",
    ),
    "reset time and gain": ({**DATA, "servo": {**PD, "Tn": 0.1}}, r"\[servo\], has both Tn and Ki; remove one"),
    "reset time": ({**DATA, "servo": {**SERVO, "Tn": 0}}, r"\[servo\], has Tn = 0; give a reset time above 0 in s"),
    "logged force": ({**DATA, "servo": {**PD, "logged_force": "current"}}, r"= 'current'; give one of command, actual"),
    "window": ({**DATA, "servo": {**SERVO, "window": 2.5}}, r"\[servo\], has window = 2.5; give an integer"),
    "gains": ({**DATA, "compensation": {"gains": [1.2]}}, r"\[compensation\], has gains = \[1.2\], none of them"),
    "mismatch": (
        {**DATA, "compensation": {"mismatch": 1}},
        r"\[compensation\], has mismatch = 1; give a number from 0",
    ),
    "models": (
        {**DATA, "identify": {"models": "LuGre"}},
        r"\[identify\], has models = 'LuGre'; give \"all\" or a list",
    ),
    "not a table": ({**DATA, "servo": 3}, r"\[servo\], is 3, not a table; make it a table"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_configuration_names_table_and_key(name: str) -> None:
    content, message = WRONG[name]
    with pytest.raises(ConfigError, match=message):
        parse_config(content, origin="axis.toml")


def test_a_missing_file_names_the_studies_of_the_package(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"no file emp \(did you mean emps\?\); give .* one of emps, trib"):
        load_config("emp")
    (tmp_path / "broken.toml").write_text("[servo\n", encoding="utf-8")
    with pytest.raises(ConfigError, match="cannot be read as TOML"):
        load_config(tmp_path / "broken.toml")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"identify": {"models": ["Lugre2"]}}, r"\[identify\], models: 'Lugre2' is not a model that can be identified"),
        (
            {"compensation": {"compensators": ["LuGreFeedforwards"]}},
            r"no compensator 'LuGreFeedforwards' \(did you mean LuGreFeedforward\?\)",
        ),
    ],
)
def test_unknown_names_are_refused_before_anything_is_done(
    tmp_path: Path, content: dict[str, Any], message: str
) -> None:
    config: StudyConfig = parse_config({**DATA, **content})
    with pytest.raises(ConfigError, match=message):
        run_study(config, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_fewer_than_one_process_are_refused_before_anything_is_done(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match="number of processes is -1; use 1 or more"):
        run_study("demo", tmp_path / "out", processes=-1)
    assert not (tmp_path / "out").exists()


def test_every_law_has_its_row() -> None:
    assert set(compensators()) == {b.name for b in catalogue().values() if b.kind == "compensator"}
    check_names("all")


@pytest.mark.parametrize(("duration", "Ts"), [(1e-12, 1e-3), (0.099, 1e-3), (None, 0.05)])
def test_a_loop_over_a_few_samples_is_refused_before_anything_is_identified(
    tmp_path: Path, duration: float | None, Ts: float
) -> None:
    t = np.arange(0.0, 2.0, 1e-3)
    rows = np.column_stack([t, 1e-3 * np.sin(2.0 * np.pi * t), 3.0 * np.sign(np.cos(2.0 * np.pi * t))])
    np.savetxt(tmp_path / "data.csv", rows, delimiter=",", header="time [s],position [m],force [N]", comments="")
    content = {
        "data": {"file": "data.csv", "name": "axis"},
        "servo": {"law": "CascadePPI", "kp": 40.0, "kv": 1500.0, "Ts": Ts, "force_limit": 350.0, "mass": 90.0},
        "identify": {"models": ["Coulomb"]},
        "compensation": {} if duration is None else {"duration": duration},
    }
    config = parse_config(content, folder=tmp_path)
    with pytest.raises(ConfigError, match=r"over .* s, which is less than 100 sample times of the servo"):
        run_study(config, tmp_path / "out")
    assert not list((tmp_path / "out").rglob("*.json"))


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(StudyError, match="Cannot create the folder"):
        run_study("demo", tmp_path / "file" / "out")


def test_the_command_of_a_study_has_the_options_that_it_needs() -> None:
    mapping = DataMapping(Path("a.csv"), option="time=1, position=2", gain="0.5 N.m/A", more=(Path("b.csv"),))
    config = replace(load_config("demo"), name="a.csv", measurement=Measurement((), mapping, (), ()))
    command = "friction-fmus study a.csv b.csv --columns 'time=1, position=2' --gain '0.5 N.m/A'"
    assert config.command == command
    everything = replace(config, models="all", compensation=replace(config.compensation, compensators="all"))
    assert everything.command == f"{command} --full"
    assert load_config("demo").command == "friction-fmus study demo"
