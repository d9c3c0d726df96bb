from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from friction_fmus.identification import ROTARY, RecordError, read_measurement, read_records
from friction_fmus.identification.data.column_headings import ColumnMeaning, Meaning, about, meaning_of
from friction_fmus.identification.data.formats import read_table

T = np.arange(100) * 2e-3
X = 5.0 * np.sin(2 * np.pi * 10 * T)  # mm
F = 3.0 * np.cos(2 * np.pi * 10 * T)  # N


def table(headings: str, separator: str = ";", *, columns: tuple[np.ndarray, ...] = (1e3 * T, X, F)) -> str:
    rows = [separator.join(f"{value:.9g}" for value in row) for row in zip(*columns, strict=True)]
    return "\n".join([headings, *rows]) + "\n"


def saved(folder: Path, text: str, name: str = "axis.csv") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def assert_is_the_axis(path: Path, exact: float = 1e-9) -> None:
    (record,) = read_measurement(path).records
    assert record.t == pytest.approx(T, abs=exact)
    assert record.q == pytest.approx(1e-3 * X, abs=1e-9)
    assert record.force == pytest.approx(F, abs=1e-6)


@pytest.mark.parametrize(
    ("heading", "unit", "role", "its_unit"),
    [
        ("F", "N", "force", "N"),
        ("F/N", "", "force", "N"),
        ("x in mm", "", "position", "mm"),
        ("position_mm", "", "position", "mm"),
        ("Drehzahl in 1/min", "", "velocity", "1/min"),
        ("v in mm/s", "", "velocity", "mm/s"),
        ("phi", "rad", "position", "rad"),
        ("timestamp", "", "time", ""),
        ("Zeit/ms", "", "time", "ms"),
        ("ActPos", "mm", "position", "mm"),
        ("ActTorque", "Nm", "force", "Nm"),
        ("MAIN.fbAxis.NcToPlc.ActPos", "mm", "position", "mm"),
        ("Axis 1.SetPos", "mm", "reference", "mm"),
        ("X_ActPos", "mm", "position", "mm"),
        ("Position Actual Value", "mm", "position", "mm"),
        ("Velocity actual value", "mm/s", "velocity", "mm/s"),
        ("Torque Actual Value", "Nm", "force", "Nm"),
        ("Position Demand Value", "mm", "reference", "mm"),
        ("0x6064 Position actual value", "mm", "position", "mm"),
        ("6064h:00 Position actual value", "mm", "position", "mm"),
        ("Position actual value", "0x6064", "position", ""),
        ("Istposition", "mm", "position", "mm"),
        ("Lage-Istwert", "mm", "position", "mm"),
        ("Sollposition", "mm", "reference", "mm"),
        ("Kraft", "kN", "force", "kN"),
        ("Drehmoment", "Nm", "force", "Nm"),
        ("Geschwindigkeit", "mm/s", "velocity", "mm/s"),
        ("reference.position", "mm", "reference", "mm"),
        ("M", "Nm", "force", "Nm"),
        ("n", "1/min", "velocity", "1/min"),
    ],
)
def test_headings_of_drives_in_english_and_german(heading: str, unit: str, role: str, its_unit: str) -> None:
    assert meaning_of(heading, unit) == Meaning(role, its_unit)


@pytest.mark.parametrize(
    ("heading", "unit"),
    [
        ("m", "kg"),  # a mass
        ("n", ""),  # a number, unless in rpm
        ("F", "Hz"),
        ("error.position", "mm"),
        ("Axis 1.PosDiff", "mm"),
        ("Axis 1.LagError", "mm"),
        ("Schleppfehler.Position", "mm"),
        ("u", "V"),
        ("x_d", "mm"),  # the desired position of some, the velocity of others
        ("x_d", ""),
        ("Position_min", ""),  # no position in minutes
        ("temperature", "K"),
    ],
)
def test_headings_of_other_signals_are_not_mistaken(heading: str, unit: str) -> None:
    assert meaning_of(heading, unit) is None


@pytest.mark.parametrize(
    ("heading", "kind", "qualifier"),
    [
        ("Temps", "time", ""),
        ("Consigne de position", "position", "reference"),
        ("Position mesurée", "position", "actual"),
        ("Vitesse réelle", "velocity", "actual"),
        ("Erreur de position", "position", "error"),
        ("Courant moteur", "force", ""),
        ("POSICIÓN", "position", ""),
        ("Referencia posición", "position", "reference"),
        ("Corriente", "force", ""),
        ("velocità", "velocity", ""),
        ("coppia", "force", ""),
    ],
)
def test_headings_in_french_spanish_and_italian(heading: str, kind: str, qualifier: str) -> None:
    assert about(heading, "") == ColumnMeaning(kind, qualifier, "", "", True)


@pytest.mark.parametrize(
    ("heading", "kind", "qualifier", "axis"),
    [
        ("tau_J1", "force", "", "1"),  # a joint of libfranka, no joule
        ("tau_J", "force", "", ""),
        ("pos_m2", "position", "", "2"),  # a motor, no square metre
        ("current_A1", "force", "", "1"),  # an axis of KUKA, no ampere
        ("qd_cmd[3]", "velocity", "reference", "3"),
        ("ee_pos[0]", "other", "other", "0"),
        ("actual_TCP_pose_0", "other", "other", "0"),
        ("BatteryVoltage", "other", "other", ""),
        ("batt_voltage", "other", "other", ""),
        ("interpolator.1.curr-pos", "position", "", "1"),  # at present, no electric current
        ("cur_vel", "velocity", "", ""),
        ("curr_2", "force", "", "2"),
    ],
)
def test_headings_of_robots(heading: str, kind: str, qualifier: str, axis: str) -> None:
    assert about(heading, "") == ColumnMeaning(kind, qualifier, axis, "", True)


@pytest.mark.parametrize(
    "headings",
    [
        "t [ms];x [mm];F [N]",
        "Zeit/ms;Istposition/mm;Kraft/N",
        "Time in ms;Position Actual Value in mm;Force (N)",
        "time_ms;ActPos_mm;force_N",
        "Axis 1.time [ms];Axis 1.ActPos [mm];Axis 1.force [N]",
    ],
)
def test_units_in_headings_need_no_mapping(tmp_path: Path, headings: str) -> None:
    assert_is_the_axis(saved(tmp_path, table(headings)))


def test_lines_above_the_table_are_skipped(tmp_path: Path) -> None:
    """Such as the settings of a recorder: key and value, with other numbers of cells, or half numbers."""
    head = "Recorder;X1\nSample time [ms];2\nOffset;0;0\nTrigger;1;2\n\n"
    units = "ms;mm;N\n"
    body = table("Zeit;Istposition;Kraft").split("\n", 1)
    assert_is_the_axis(saved(tmp_path, head + body[0] + "\n" + units + "REAL;LREAL;LREAL\n" + body[1] + "EOF\n"))


def test_a_recorder_whose_first_line_is_a_name(tmp_path: Path) -> None:
    head = "Name;Trace_1\nKommentar;\nAufzeichnung;01.02.2024 12:00:00\nAbtasttakt;2 ms\n\n"
    rows = table("Zeit [ms];Lageistwert [mm];Kraftistwert [N]").splitlines()
    numbered = [f"{i};{row}" if i else f"Nr.;{row}" for i, row in enumerate(rows)]
    assert_is_the_axis(saved(tmp_path, head + "\n".join(numbered)))


def test_a_trace_with_blanks_of_codesys_2(tmp_path: Path) -> None:
    r"""`Trace in ASCII file`: a title, the project, the names, then rows."""
    body = table("Cycle PLC_PRG.ActPos PLC_PRG.Kraft", " ").replace("Cycle", "Time[ms]")
    body = body.replace("ActPos", "ActPos[mm]").replace("Kraft", "Kraft[N]")
    assert_is_the_axis(saved(tmp_path, "Trace\nD:\\PROJECTS\\AXIS.PRO\n" + body, "axis.txt"))


def test_a_target_position_is_the_reference_only_if_there_is_no_other(tmp_path: Path) -> None:
    columns = (1e3 * T, X, F, X + 1.0)
    headings = "t [ms];x [mm];F [N];Target Position [mm]"
    (record,) = read_records(saved(tmp_path, table(headings, columns=columns)))
    assert record.reference == pytest.approx(1e-3 * (X + 1.0))
    both = (*columns, X)
    (record,) = read_records(saved(tmp_path, table(headings + ";Position Demand Value [mm]", columns=both)))
    assert record.reference == pytest.approx(1e-3 * X, abs=1e-9)


def test_two_axes_in_a_file_are_a_choice(tmp_path: Path) -> None:
    path = saved(tmp_path, table("t [ms];X ActPos [mm];Y ActPos [mm]"))
    with pytest.raises(RecordError, match="'X ActPos' and 'Y ActPos' could both be the position"):
        read_records(path)


def test_a_motor_torque_beside_a_linear_position_keeps_its_unit_without_a_gain(tmp_path: Path) -> None:
    path = saved(tmp_path, table("t [ms];ActPos [mm];ActTorque [Nm];Drehzahl [U/min]", columns=(1e3 * T, X, F, F)))
    (record,) = read_measurement(path).records
    assert (record.units.force, record.units.viscous) == ("Nm", "Nm.s/m")
    assert record.force == pytest.approx(F, abs=1e-6)
    columns = {"time": "t", "position": "ActPos", "force": {"column": "ActTorque", "gain": "100 N/(Nm)"}}
    (record,) = read_records(path, {"columns": columns})
    assert record.force == pytest.approx(100 * F, abs=1e-4)


def test_a_rotary_axis_in_the_units_of_drives(tmp_path: Path) -> None:
    path = saved(
        tmp_path, table("Zeit [ms];Istwinkel [Grad];Istmoment [mNm];Drehzahl [1/min]", columns=(1e3 * T, X, F, F))
    )
    record = read_measurement(path).records[0]
    assert record.units == ROTARY
    assert record.q == pytest.approx(np.radians(X), abs=1e-9)
    assert record.force == pytest.approx(1e-3 * F, abs=1e-9)
    assert record.v == pytest.approx(F * np.pi / 30.0, rel=1e-6)


@pytest.mark.parametrize(("factor", "form"), [(1.0, "%.6f"), (1e3, "%.3f"), (1e6, "%d"), (1e9, "%d")])
def test_a_timestamp_since_1970_needs_no_unit(tmp_path: Path, factor: float, form: str) -> None:
    rows = [f"{form % (factor * (1.7e9 + t))};{x:.9g};{f:.9g}" for t, x, f in zip(T, X, F, strict=True)]
    measurement = read_measurement(saved(tmp_path, "\n".join(["timestamp;x [mm];F [N]", *rows])))
    assert measurement.records[0].t == pytest.approx(T, abs=1e-6)
    assert measurement.findings[0].name == "absolute-time"


def test_a_text_cell_is_named_with_its_line(tmp_path: Path) -> None:
    lines = table("t [ms];x [mm];F [N]").splitlines()
    lines[7] = lines[7].rsplit(";", 1)[0] + ";overflow"
    with pytest.raises(RecordError, match="column 'F' for the force, is not numeric: it contains 'overflow' in line 8"):
        read_records(saved(tmp_path, "\n".join(lines)))


HEAD = (
    "Name\tScope Project\nFile\tC:\\scope.csv\n"
    "Starttime of export\t132959733843760000\tMontag, 2. Mai 2022\t15:56:24.376\n"
    "Endtime of export\t132959733853750000\tMontag, 2. Mai 2022\t15:56:25.375\n\n\n"
)


def scope(times: tuple[np.ndarray, ...], values: tuple[np.ndarray, ...], *, ends: str = "") -> str:
    """A text of TwinCAT Scope with its defaults: tabs, decimal commas, a column of times for each channel."""
    names, units = ("ActPos", "ActForce", "SetPos"), ("mm (Length)", "N (Force)", "mm (Length)")
    count = len(values)

    def row(key: str, cells: tuple[str, ...]) -> str:
        return "\t".join(f"{key}\t{cell}" for cell in cells[:count]) + ends

    head = [
        row("Name", names),
        row("SymbolComment", ("", "the force\nof the drive", "")),
        row("Data-Type", ("REAL64",) * 3),
        row("SampleTime[ms]", ("2",) * 3),
        row("Offset", ("0",) * 3),
        row("SymbolName", tuple(f"MAIN.{name}" for name in names)),
        row("Unit", units),
        "",
    ]
    body = []
    for i in range(max(map(len, times))):
        pairs = [f"{t[i]:.9g}\t{v[i]:.9g}" if i < len(t) else "\t" for t, v in zip(times, values, strict=True)]
        body.append("\t".join(pairs).replace(".", ",") + ends)
    return HEAD + "\n".join([*head, *body])


@pytest.mark.parametrize("ends", ["", "\t"])
@pytest.mark.parametrize("mark", ["", "\nEOF\n"])
def test_an_export_of_twincat_scope(tmp_path: Path, ends: str, mark: str) -> None:
    path = saved(tmp_path, scope((1e3 * T, 1e3 * T), (X, F), ends=ends) + mark)
    assert_is_the_axis(path)
    assert [finding.name for finding in read_measurement(path).findings] == ["decimal-comma"]


def test_time_stamps_of_windows_are_counted_from_the_first_one(tmp_path: Path) -> None:
    ticks = [132959733843760000 + 20000 * i for i in range(len(T))]
    rows = [f"{tick},{x:.9g},{f:.9g}" for tick, x, f in zip(ticks, X, F, strict=True)]
    head = "Name,Scope Project\nFile,C:\\scope.csv\n\nName,ActPos,ActForce\nUnit,mm (Length),N (Force)\n"
    path = saved(tmp_path, head + "\n".join(rows))
    assert_is_the_axis(path, exact=2.0**-23)  # digit of seconds since 1970
    slow = [
        f"{row},{tick},1" if i % 4 == 0 else f"{row},," for i, (row, tick) in enumerate(zip(rows, ticks, strict=True))
    ]
    names = head.replace("ActForce", "ActForce,Name,Ch").replace("N (Force)", "N (Force),Unit,1")
    table = read_table(saved(tmp_path, names + "\n".join(slow)))
    assert np.diff(table.columns["time"]) == pytest.approx(0.002, abs=1e-6)


def test_a_channel_of_another_sample_time_is_interpolated_and_named(tmp_path: Path) -> None:
    slow = 1e3 * T[::5]
    path = saved(tmp_path, scope((1e3 * T, 1e3 * T, slow), (X, F, 2.0 * slow)))
    measurement = read_measurement(path)
    (note,) = [finding for finding in measurement.findings if finding.name == "other-clock"]
    assert note.what.startswith("'SetPos' was sampled at other times")
    (record,) = measurement.records
    assert record.reference == pytest.approx(2.0 * record.t, abs=1e-9)  # mm and ms, on the line between the samples
    assert record.force == pytest.approx(F[: len(record)], abs=1e-6)


def test_a_row_ends_where_the_last_channel_ends(tmp_path: Path) -> None:
    """An oversampled channel has more rows; the cells behind it are missing there, not empty."""
    slow, fast = 1e3 * T, 200.0 * np.arange(5 * len(T)) / 500.0  # ms
    force = np.interp(fast, slow, F)
    pairs = zip(fast, force, strict=True)
    body = [f"{t:.9g}\t{f:.9g}" for t, f in pairs]
    body[: len(T)] = [
        f"{row}\t{t:.9g}\t{x:.9g}\t{t:.9g}\t{2.0 * x:.9g}" for row, t, x in zip(body[: len(T)], slow, X, strict=True)
    ]
    names = "\t".join(f"Name\t{name}" for name in ("ActForce", "ActPos", "SetPos"))
    units = "\t".join(f"Unit\t{unit}" for unit in ("N (Force)", "mm (Length)", "mm (Length)"))
    text = HEAD + f"{names}\n{units}\n\n" + "\n".join(body).replace(".", ",") + "\nEOF\n"
    measurement = read_measurement(saved(tmp_path, text))
    (record,) = measurement.records
    assert record.t == pytest.approx(T, abs=1e-9)
    assert record.q == pytest.approx(1e-3 * X, abs=1e-9)
    assert record.reference == pytest.approx(2e-3 * X, abs=1e-9)
    assert record.force == pytest.approx(F, abs=1e-6)


def test_a_text_in_a_channel_is_named_with_its_line(tmp_path: Path) -> None:
    text = scope((1e3 * T, 1e3 * T), (X, F))
    broken = text[: text.rindex("\t") + 1] + "overflow"
    with pytest.raises(RecordError, match=f"'ActForce'.* contains 'overflow' in line {len(text.splitlines())}"):
        read_records(saved(tmp_path, broken))
