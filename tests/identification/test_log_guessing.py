"""Columns found by physics: right, asked about or refused, but never wrong without a word."""

from __future__ import annotations

import re
import runpy
import shlex
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter
from thorough import landing, nightly

from friction_fmus.__main__ import main
from friction_fmus.blocks.axis_units import ROTARY, units_of_channels
from friction_fmus.cli.axis_tables import read_asking
from friction_fmus.errors import AmbiguousColumnsError
from friction_fmus.identification import DataMapping, Measurement, RecordError, read_measurement
from friction_fmus.identification.fit.first_look import first_look

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "my-log-file.md").read_text(encoding="utf-8")
VARIANTS = runpy.run_path(str(ROOT / "tests" / "slow" / "log_variants.py"))

J, FC, FV, OF = 0.012, 0.8, 0.05, 0.04
T = np.arange(3000) * 2e-3
Q = 1.1 * np.sin(2 * np.pi * 0.7 * T) + 0.4 * np.sin(2 * np.pi * 1.9 * T)
V = np.gradient(Q, T)
TAU = J * np.gradient(V, T) + FC * np.sign(V) + FV * V + OF


def saved(folder: Path, headings: str, *columns: np.ndarray, name: str = "my.csv") -> Path:
    rows = [",".join(f"{value:.9g}" for value in row) for row in zip(*columns, strict=True)]
    path = folder / name
    path.write_text("\n".join([*([headings] if headings else []), *rows]) + "\n", encoding="utf-8")
    return path


def used(measurement: Measurement) -> dict[str, str]:
    return {role: column.column for role, column in measurement.mapping.columns.items()}


def found(measurement: Measurement) -> dict[str, float]:
    return {name: estimate.value for name, estimate in first_look(measurement.records).items()}


def test_counts_and_rpm_show_the_counts_of_a_turn(tmp_path: Path) -> None:
    counts, rpm = np.round(Q * 4096 / (2 * np.pi)), V * 30 / np.pi
    path = saved(tmp_path, "t [ms],Position [qc],Speed [rpm],Current [mA]", 1e3 * T, counts, rpm, 2e3 * TAU)
    measurement = read_measurement(path)
    assert measurement.mapping.columns["position"].gain == f"{1 / 4096:.12g} rev"
    assert measurement.records[0].q == pytest.approx(Q, abs=2 * np.pi / 4096)
    assert measurement.records[0].units == units_of_channels("rad", "mA")
    values = found(measurement)
    assert values["Fc"] == pytest.approx(2e3 * FC, rel=0.02)
    assert values["Fv"] == pytest.approx(2e3 * FV, rel=0.05)
    lines = dict(measurement.understood)
    assert "4096 qc a turn" in lines["position"]
    assert 'give --gain "0.5 N.m/A"' in lines["result"]
    (scaled,) = read_measurement(path, DataMapping(path, gain="0.5 N.m/A")).records
    assert scaled.units == ROTARY
    assert scaled.force == pytest.approx(TAU, rel=1e-6)


def test_stamps_that_jitter_do_not_change_the_scale(tmp_path: Path) -> None:
    """Of steps of 1, 1 and 1.5 ms, the median is 14 % below the mean."""
    t = np.cumsum(np.tile([1e-3, 1e-3, 1.5e-3], 800))
    slow, fast = 2 * np.pi * 0.7 * t, 2 * np.pi * 1.9 * t
    q, v = 1.1 * np.sin(slow) + 0.4 * np.sin(fast), 2 * np.pi * (0.77 * np.cos(slow) + 0.76 * np.cos(fast))
    counts, torque = np.round(q * 4096 / (2 * np.pi)), FC * np.sign(v) + FV * v
    path = saved(tmp_path, "t [ms],Position [qc],Speed [rpm],Current [A]", 1e3 * t, counts, v * 30 / np.pi, torque)
    assert read_measurement(path).mapping.columns["position"].gain == f"{1 / 4096:.12g} rev"


def test_a_heading_that_is_a_unit_of_speed_is_one(tmp_path: Path) -> None:
    (record,) = read_measurement(saved(tmp_path, "t [s],rpm,Torque [N.m]", T, V * 30 / np.pi, TAU)).records
    assert record.v == pytest.approx(V, abs=1e-6)


def test_two_clocks_a_moment_apart_are_one_time(tmp_path: Path) -> None:
    path = saved(tmp_path, "time [s],time written [s],q [rad],tau [N.m]", T, T + 3e-4, Q, TAU)
    assert used(read_measurement(path)) == {"time": "time", "position": "q", "force": "tau"}


def test_units_with_a_temperature_are_no_names(tmp_path: Path) -> None:
    path = saved(tmp_path, "Time,Position,Winding,Torque\ns,rad,Deg C,N.m", T, Q, 30.0 + T, TAU)
    path.write_text(f"2026-05-11 15:22:21.2\n{path.read_text()}")
    assert used(read_measurement(path)) == {"time": "Time", "position": "Position", "force": "Torque"}


def test_signals_that_rest_for_nearly_all_of_the_log_are_refused(tmp_path: Path) -> None:
    levels = np.repeat([1.0, 2.0, 3.0, 4.0, 3.0, 2.0], 2000)
    slow = lfilter([0.01], [1.0, -0.99], levels)
    with pytest.raises(AmbiguousColumnsError, match="state the sample time"):
        read_measurement(saved(tmp_path, "input,output", levels, slow))


def test_a_refusal_shows_what_is_known_and_what_is_missing(tmp_path: Path) -> None:
    with pytest.raises(AmbiguousColumnsError) as caught:
        read_measurement(saved(tmp_path, "Time [s],Torque [N.m]", T, TAU))
    assert "--columns \"time='Time' s, position=?, force='Torque' N.m\"" in str(caught.value)
    with pytest.raises(RecordError, match="names '\\?', but"):
        read_measurement(saved(tmp_path, "one,two", T, TAU), DataMapping(None, option="time=one s, position=?"))
    with pytest.raises(AmbiguousColumnsError, match="no headings; no column"):
        read_measurement(saved(tmp_path, "", T, Q))


def test_a_signal_that_changes_in_the_last_sample_is_no_warning(tmp_path: Path) -> None:
    """Of columns without names, one whose smoothed derivative is zero has no correlation with a velocity."""
    switched = np.append(np.full(len(T) - 1, 0.5), 0.6)
    path = saved(tmp_path, "", T, switched, Q, V, TAU)
    assert used(read_measurement(path, DataMapping(path, option="time=1 s")))["position"] == "column 3"


def test_a_motion_in_one_direction_says_nothing_about_the_sign(tmp_path: Path) -> None:
    """Friction that falls with the speed takes power, although less of it at higher speeds."""
    v = 1.0 + 0.5 * np.sin(2 * np.pi * 0.7 * T)
    torque = J * np.gradient(v, T) + 2.0 - 0.5 * v
    path = saved(tmp_path, "t [s],v [rad/s],tau [N.m]", T, v, torque)
    assert [finding.name for finding in read_measurement(path).findings] == []


def test_a_file_without_headings_is_read_by_its_motion(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    noise = 30.0 + rng.standard_normal(len(T))
    measurement = read_measurement(saved(tmp_path, "", T, noise, 2 * TAU, V, Q))
    assert used(measurement) == {"time": "column 1", "position": "column 5", "force": "column 3"}
    assert found(measurement)["Fc"] == pytest.approx(2 * FC, rel=0.02)


def test_a_scope_that_writes_the_name_before_each_value(tmp_path: Path) -> None:
    """The format of LinuxCNC's halscope: a sentence with the period, and names in every row, here as in Germany."""
    names = ("joint.0.motor-pos-cmd", "joint.0.motor-pos-fb", "spindle.0.on", "pid.0.output")
    lead = Q + 0.01 * V
    columns = [[f"{name} {x:+.14f}" for x in each] for name, each in zip(names, (lead, Q, 0 * Q, TAU), strict=True)]
    lines = [re.sub(r"(\d)\.(\d+)(?!\S)", r"\1,\2", " ".join(row)) for row in zip(*columns, strict=True)]
    path = tmp_path / "halscope.log"
    path.write_text("\n".join(["Sampling period is 2000000 nSec ", "", *lines]) + "\n", encoding="utf-8")
    measurement = read_measurement(path)
    roles = {"position": names[1], "reference": names[0], "force": names[3]}
    assert {role: name for role, name in used(measurement).items() if role != "time"} == roles
    (record,) = measurement.records
    assert record.Ts == pytest.approx(2e-3)
    assert record.q == pytest.approx(Q, abs=1e-12)


def test_two_forces_that_fit_are_asked_about_with_commands_that_work(tmp_path: Path) -> None:
    """A following error of a stiff servo looks like a torque: only a name tells them apart."""
    path = saved(tmp_path, "t [s],q [rad],Ch 1,Ch 2", T, Q, 1.02 * TAU + 0.01 * np.cos(T), 300 * TAU)
    with pytest.raises(AmbiguousColumnsError) as caught:
        read_measurement(path)
    commands = re.findall(r"^    (friction-fmus study .*)$", str(caught.value), re.M)
    assert len(commands) == 2
    for command, force in zip(commands, ("Ch 1", "Ch 2"), strict=True):
        *_, option = shlex.split(command)
        assert used(read_measurement(path, DataMapping(path, option=option)))["force"] == force


def test_a_following_error_beside_the_torque_is_no_force(tmp_path: Path) -> None:
    reference = Q + (V + TAU / 3.0) / 40.0
    headings = "t [s],Target position [rad],Following error [rad],Actual position [rad],Motor torque [Nm]"
    measurement = read_measurement(saved(tmp_path, headings, T, reference, reference - Q, Q, TAU))
    assert used(measurement)["force"] == "Motor torque"
    assert used(measurement)["position"] == "Actual position"


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_reference_and_a_following_error_give_the_position(tmp_path: Path, sign: float) -> None:
    reference = Q + (V + TAU / 3.0) / 40.0
    headings = "t [s],Sollposition [rad],Schleppfehler [rad],Drehmoment [Nm]"
    measurement = read_measurement(saved(tmp_path, headings, T, reference, sign * (reference - Q), TAU))
    assert measurement.records[0].q == pytest.approx(Q, abs=1e-6)


@pytest.mark.parametrize(("unit", "force"), [("N.m", "N.m"), ("V", "V"), ("mA", "mA"), ("%", "%")])
def test_a_command_named_u_is_a_force_in_its_unit(tmp_path: Path, unit: str, force: str) -> None:
    measurement = read_measurement(saved(tmp_path, f"t [s],phi [rad],u [{unit}]", T, Q, TAU))
    assert measurement.records[0].units.force == force


def test_on_a_terminal_a_doubtful_mapping_is_asked_about(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = saved(tmp_path, "t [s],q [rad],Ch 1,Ch 2", T, Q, 1.02 * TAU + 0.01 * np.cos(T), 300 * TAU)
    monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
    monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)
    monkeypatch.setattr("builtins.input", lambda _: "2")
    assert used(read_asking(path, DataMapping(path)))["force"] == "Ch 2"
    monkeypatch.setattr("builtins.input", lambda _: "")
    with pytest.raises(AmbiguousColumnsError):
        read_asking(path, DataMapping(path))


@pytest.mark.parametrize("scale", [1.0, 1e3])
def test_the_size_of_numbers_decides_no_unit(tmp_path: Path, scale: float) -> None:
    measurement = read_measurement(saved(tmp_path, "t [s],q,dq,tau", T, scale * Q, scale * V, scale * TAU))
    units = measurement.records[0].units
    assert (units.position, units.force, units.viscous) == ("1", "1", "s")
    assert found(measurement)["Fc"] == pytest.approx(scale * FC, rel=0.02)


@pytest.mark.parametrize("step", [0.1, 0.101, 0.25, 0.4])
def test_a_time_that_two_units_fit_is_asked_about(tmp_path: Path, step: float) -> None:
    slow = np.arange(len(T)) * step  # 10 to 2.5 Hz in s, as a computer polls a drive; 10 to 2.5 kHz in ms
    with pytest.raises(AmbiguousColumnsError, match="the time 't' has no unit") as refusal:
        read_measurement(saved(tmp_path, "t,q [rad],tau [N.m]", slow, Q, TAU))
    assert [command.split("'t' ")[1][:3] for command, _ in refusal.value.choices] == ["s, ", "ms,"]


def test_a_counter_of_rows_is_no_time_in_ms(tmp_path: Path) -> None:
    path = saved(tmp_path, "step,q [rad],tau [N.m]", np.arange(float(len(T))), Q, TAU)
    with pytest.raises(AmbiguousColumnsError, match="the time 'step' has no unit") as refusal:
        read_measurement(path)
    assert [command.split(",")[0] for command, _ in refusal.value.choices] == ["time='step' ?"]


def test_a_file_without_time_needs_a_period(tmp_path: Path) -> None:
    path = saved(tmp_path, "q [rad],tau [N.m]", Q, TAU)
    with pytest.raises(AmbiguousColumnsError, match="such as period=1 ms") as refusal:
        read_measurement(path)
    assert [command.split(",")[0] for command, _ in refusal.value.choices] == ["period=?"]  # nothing is made up
    (record,) = read_measurement(path, DataMapping(path, option="period=2 ms, position=1 rad, torque=2 N.m")).records
    assert record.t == pytest.approx(T)


def test_the_joint_with_the_largest_motion_is_used_and_the_other_named(tmp_path: Path) -> None:
    other = 0.3 * np.sin(2 * np.pi * 1.1 * T)
    w = np.gradient(other, T)
    tau = J * np.gradient(w, T) + FC * np.sign(w)
    measurement = read_measurement(saved(tmp_path, "time,q1,q2,tau1,tau2", T, other, Q, tau, TAU))
    assert used(measurement) == {"time": "time", "position": "q2", "force": "tau2"}
    assert "other axes, not used: 'q1' with 'tau1'" in dict(measurement.understood)["note"]


def test_intervals_that_differ_everywhere_do_not_hide_the_joint_that_moves(tmp_path: Path) -> None:
    """A computer that polls a robot: no ten equal intervals, and the joint at rest for the first tenth of the log."""
    rng = np.random.default_rng(3)
    t = np.cumsum(rng.choice([0.01, 0.03, 0.07], 3000))
    w = np.clip(t - 0.1 * t[-1], 0.0, 5.0) / 5.0
    q = w * (1.1 * np.sin(2 * np.pi * 0.07 * t) + 0.4 * np.sin(2 * np.pi * 0.19 * t))
    v = np.gradient(q, t)
    tau = J * np.gradient(v, t) + FC * np.tanh(v / 0.01) + FV * v
    rest = [0.001 * rng.normal(size=len(t)).cumsum() for _ in range(4)]
    headings = "time [s],q[0],q[1],q_cmd[1],qd[0],qd[1],qd_cmd[1],tau[0],tau[1],ee_pos[0]"
    columns = (t, 1e-3 * rest[0], q, q, 1e-3 * rest[1], v, v, rest[2], tau, np.sin(q))
    chosen = used(read_measurement(saved(tmp_path, headings, *columns)))
    assert (chosen["position"], chosen["force"]) == ("q[1]", "tau[1]")


def test_bursts_between_long_pauses_are_examined_one_by_one(tmp_path: Path) -> None:
    """Twelve bursts of half a second, a minute apart, in which nothing is known: one of them says what is what."""
    burst = slice(200, 450)
    t = np.concatenate([T[burst] + 60.0 * k for k in range(12)])
    headings, columns = "time [s],a,b,c", (np.tile(each[burst], 12) for each in (TAU, Q, V))
    measurement = read_measurement(saved(tmp_path, headings, t, *columns))
    assert (used(measurement)["position"], used(measurement)["force"]) == ("b", "a")


def test_named_columns_that_physics_does_not_confirm_are_proposed(tmp_path: Path) -> None:
    """A torque of gravity and cables hides the friction: the names of each axis stand together in a command."""
    noise = np.random.default_rng(4).normal(size=(2, len(T)))
    path = saved(
        tmp_path, "t [s],axis1 pos [rad],axis2 pos [rad],axis1 torque [N.m],axis2 torque [N.m]", T, Q, V, *noise
    )
    with pytest.raises(
        AmbiguousColumnsError, match="no force, torque or current explains half of the motion"
    ) as refusal:
        read_measurement(path)
    commands = {command for command, _ in refusal.value.choices}
    assert commands == {f"time='t' s, position='axis{n} pos' rad, force='axis{n} torque' N.m" for n in (1, 2)}


def test_a_file_without_a_force_proposes_its_motions(tmp_path: Path) -> None:
    with pytest.raises(AmbiguousColumnsError, match="no column is recognised as the force") as refusal:
        read_measurement(saved(tmp_path, "t [s],x pos [mm],y pos [mm]", T, Q, V))
    commands = {command for command, _ in refusal.value.choices}
    assert commands == {f"time='t' s, position='{axis} pos' mm" for axis in "xy"}


def test_columns_are_given_by_number_heading_sign_and_scale(tmp_path: Path) -> None:
    path = saved(tmp_path, "alpha,beta gamma,delta", 1e3 * T, Q * 8192 / (2 * np.pi), -TAU)
    option = "time=1 ms, position=beta gamma 1/8192 rev, torque=-'delta' N.m"
    (record,) = read_measurement(path, DataMapping(path, option=option)).records
    assert record.q == pytest.approx(Q, abs=1e-6)
    assert record.force == pytest.approx(TAU, abs=1e-6)


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ("time=9 s", "has the columns"),
        ("speed", "use the form"),
        ("strength=1 N", "unknown role 'strength'"),
        ("time=1 s, time=2 s", "names the time twice"),
        ("time=1 s, position='z' rad", "has no column 'z'"),
    ],
)
def test_wrong_columns_are_refused(tmp_path: Path, option: str, message: str) -> None:
    path = saved(tmp_path, "t,q,tau", T, Q, TAU)
    with pytest.raises(RecordError, match=message):
        read_measurement(path, DataMapping(path, option=option))


def test_steady_speeds_give_friction_without_the_offset(tmp_path: Path) -> None:
    v = np.array([s * w for s in (1.0, -1.0) for w in (0.5, 1.0, 2.0, 4.0, 6.0)])
    measurement = read_measurement(saved(tmp_path, "speed [rad/s],torque [Nm]", v, FC * np.sign(v) + FV * v + OF))
    assert measurement.static
    assert found(measurement) == pytest.approx({"Fc": FC, "Fv": FV}, rel=1e-6)
    assert "time" not in measurement.records[0].clock


def test_columns_are_counted_as_in_the_file(tmp_path: Path) -> None:
    """A column of texts counts; the lines about what was read and the option agree."""
    path = tmp_path / "my.csv"
    rows = [f"{t:.6g},ready,{q:.9g},{tau:.9g}" for t, q, tau in zip(T, Q, TAU, strict=True)]
    path.write_text("\n".join(["when [s],state,one,two", *rows]) + "\n", encoding="utf-8")
    measurement = read_measurement(path, DataMapping(path, option="time=1 s, position=3 rad, torque=4 N.m"))
    assert used(measurement) == {"time": "when", "position": "one", "force": "two"}
    assert dict(measurement.understood)["position"].startswith("column 3 'one'")
    with pytest.raises(RecordError, match=r"column 'state' for the position, is not numeric"):
        read_measurement(path, DataMapping(path, option="time=1 s, position=2 rad, torque=4 N.m"))


@pytest.mark.parametrize(
    ("heading", "gain", "message"),
    [
        ("Q [deg],Strom [A]", "0.5x", "--gain is '0.5x', .* use the form '0.5 N.m/A'"),
        ("Q [deg],Strom [A]", "0.5", "--gain '0.5' times the unit 'A' of 'Strom' is not in N.m; .*'0.5 N.m/A'"),
        ("Q [mm],Strom [A]", "70 N.m/A", "is not in N; use the form '0.5 N/A'"),
        ("Q [mm],Torque [%]", "6x", "use the form '6 N'"),
        ("Q [deg],Torque", "6 N.m/A", "times the unit '1' of 'Torque' is not in N.m; use the form '0.06 N.m'"),
    ],
)
def test_a_wrong_gain_is_refused_with_one_that_fits(tmp_path: Path, heading: str, gain: str, message: str) -> None:
    path = saved(tmp_path, f"t [s],{heading}", T, Q * 180 / np.pi, 2 * TAU)
    with pytest.raises(RecordError, match=message):
        read_measurement(path, DataMapping(path, gain=gain))


@landing
def test_steady_speeds_have_a_gain_but_no_time(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    speeds = np.concatenate([np.linspace(0.5, 9.0, 20), -np.linspace(0.5, 9.0, 20)])
    current = 2.0 * (FC * np.sign(speeds) + FV * speeds)
    path = saved(tmp_path, "omega [rad/s],current [A]", speeds, current)
    measurement = read_measurement(path, DataMapping(path, gain="0.5 N.m/A"))
    assert measurement.records[0].units == ROTARY
    assert found(measurement) == pytest.approx({"Fc": FC, "Fv": FV})
    main(["identify", str(path), "--gain", "0.5 N.m/A", "--model", "Coulomb", "-o", str(tmp_path / "out")])
    printed = capsys.readouterr().out
    assert "training data 40 steady speeds; no validation data" in printed


def test_a_coasting_axis_has_no_drive_with_a_gain(tmp_path: Path) -> None:
    path = saved(tmp_path, "t [s],omega [rad/s]", T, np.maximum(20.0 - 10.0 * T, 0.0))
    assert read_measurement(path).static
    with pytest.raises(RecordError, match=r"--gain 0\.5 N\.m/A needs a drive force"):
        read_measurement(path, DataMapping(path, gain="0.5 N.m/A"))


def test_coasting_gives_friction_over_inertia(tmp_path: Path) -> None:
    t = np.arange(600) * 1e-3
    v = np.maximum((30.0 + FC / FV) * np.exp(-FV / J * t) - FC / FV, 0.0)  # J v' = -Fc - Fv v
    measurement = read_measurement(saved(tmp_path, "t [s],omega [rad/s]", t, v))
    assert measurement.records[0].units.viscous == "1/s"
    assert found(measurement) == pytest.approx({"Fc": FC / J, "Fv": FV / J}, rel=0.01)


def test_a_pendulum_gives_friction_over_m_g_l(tmp_path: Path) -> None:
    h, w0, c, d = 1e-3, 2 * np.pi * 0.8, 0.01, 0.02  # friction over m g l
    q, v, rows = 1.2, 0.0, []
    for _ in range(9000):
        rows.append(q)
        v += h * w0**2 * (-np.sin(q) - c * np.sign(v) - d * v)
        q += h * v
    t = h * np.arange(len(rows))
    measurement = read_measurement(saved(tmp_path, "t [s],angle [rad]", t, np.array(rows)))
    assert found(measurement) == pytest.approx({"Fc": c, "Fv": d}, rel=0.05)


def test_several_files_are_fitted_together(tmp_path: Path) -> None:
    files = [
        saved(tmp_path, "t [s],q [rad],tau [N.m]", T[a:b] - T[a], Q[a:b], TAU[a:b], name=f"run_{a}.csv")
        for a, b in ((0, 1000), (1000, 2000), (2000, 3000))
    ]
    measurement = read_measurement(DataMapping(files[0], more=tuple(files[1:])))
    assert len(measurement.records) == 3
    assert len(measurement.window(*measurement.mapping.windows["train"])) == 2
    assert found(measurement)["Fc"] == pytest.approx(FC, rel=0.02)


def test_nothing_absurd_is_delivered(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Noise as a torque: a model that describes nothing is not delivered, and the exit status says so."""
    noise = np.random.default_rng(3).standard_normal(len(T))
    path = saved(tmp_path, "t [s],q [rad],tau [N.m]", T, Q, noise)
    assert main(["identify", str(path), "--model", "Coulomb", "-o", str(tmp_path / "o"), "--workers", "1"]) != 0
    assert "explains little of the motion" in capsys.readouterr().out


@pytest.mark.parametrize("seed", [13, 41, 100, 118, 158, 174])
def test_random_files_are_read_right_or_not_at_all(seed: int, tmp_path: Path) -> None:
    outcome, why = VARIANTS["judged"](VARIANTS["written"](seed, tmp_path))
    assert outcome != "wrong", why


@pytest.mark.parametrize("name", ["drive", "messung", "joints"])
def test_the_page_shows_what_is_understood(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(ROOT / "examples" / "identification" / "log_files.py"), run_name="__main__")
    (shown,) = re.findall(rf"<!-- understood: {name}.csv -->\n```\w+\n(.*?)^```$", PAGE, re.S | re.M)
    printed = "\n".join(f"{subject:<8} {text}" for subject, text in read_measurement(Path(f"{name}.csv")).understood)
    assert shown.strip() == printed


@nightly
def test_commands_of_the_page_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (commands,) = re.findall(r"<!-- commands -->\n```\w+\n(.*?)^```$", PAGE, re.S | re.M)
    monkeypatch.chdir(tmp_path)
    first, *others = commands.splitlines()
    runpy.run_path(str(ROOT / first.split()[1]), run_name="__main__")
    for command in others:
        assert main(shlex.split(command)[1:]) == 0
    assert (tmp_path / "messung" / "StribeckRotational.fmu").is_file()
    assert not (tmp_path / "drive" / "StribeckRotational.fmu").exists()
