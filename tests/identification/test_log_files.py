"""Logs as drives, controllers and data loggers write them: the columns of a table, before a role is guessed."""

from __future__ import annotations

import gzip
import json
import zipfile
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
from scipy.io.matlab import MatlabOpaque

from friction_fmus.identification import RecordError
from friction_fmus.identification.data import tables
from friction_fmus.identification.data.formats import read_table
from friction_fmus.identification.data.tables import DataTable

T = np.arange(60) * 0.002
X = 5.0 * np.sin(2 * np.pi * 10 * T)
F = 3.0 * np.cos(2 * np.pi * 10 * T)


def rows(*columns: np.ndarray, separator: str = ";", form: str = "%.6f", ends: str = "") -> str:
    return "\n".join(separator.join(form % cell for cell in row) + ends for row in zip(*columns, strict=True)) + "\n"


def saved(folder: Path, content: str | bytes, name: str = "log.csv", encoding: str = "utf-8") -> Path:
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode(encoding))
    return path


def read(folder: Path, content: str | bytes, name: str = "log.csv", encoding: str = "utf-8") -> DataTable:
    return read_table(saved(folder, content, name, encoding))


def assert_columns(table: DataTable, expected: dict[str, np.ndarray], units: dict[str, str] | None = None) -> None:
    assert list(table.columns) == list(expected)
    for name, values in expected.items():
        assert table.columns[name] == pytest.approx(values, abs=2e-6), name
    if units is not None:
        assert dict(table.units) == units


def test_a_drive_with_settings_above_and_units_below_its_headings(tmp_path: Path) -> None:
    head = "Created:;2026-03-02 10:11:12\nFirmware:;0x0170;0x6350\nSampling period:;2 ms\nScale:;0;True;100.0\n"
    head += ";Position actual value;Velocity actual value;Current actual value\nms;qc;rpm;mA\n"
    table = read(tmp_path, head + rows(1e3 * T, X, F, F))
    assert_columns(
        table,
        {"column 1": 1e3 * T, "Position actual value": X, "Velocity actual value": F, "Current actual value": F},
        {"column 1": "ms", "Position actual value": "qc", "Velocity actual value": "rpm", "Current actual value": "mA"},
    )
    assert table.period == pytest.approx(2e-3)
    assert table.preamble["Firmware"] == "0x0170; 0x6350"
    assert "preamble of 6 lines" in table.format
    assert table.place(0) == "line 7"


def test_an_amplifier_that_numbers_its_channels_above_their_names(tmp_path: Path) -> None:
    head = "Axis1\nNumber of sampling data,60\nSampling time interval(ms),2.0\n"
    head += "Time,Analog 1,Analog 2,Digital 1,Digital 2\nms,Servo motor speed,Torque,Not selected,Not selected\n"
    table = read(tmp_path, head + rows(1e3 * T, X, F, 0 * T, 0 * T, separator=","))
    expected = {"Time": 1e3 * T, "Servo motor speed": X, "Torque": F, "Not selected": 0 * T, "Not selected (2)": 0 * T}
    assert_columns(table, expected, {"Time": "ms"})
    assert table.period == pytest.approx(2e-3)


@pytest.mark.parametrize(
    "order",
    [("names", "units", "index"), ("index", "names", "units"), ("units", "names"), ("names", "types"), ("names",)],
)
def test_rows_of_headings_in_any_order(tmp_path: Path, order: tuple[str, ...]) -> None:
    kinds = {"names": "Zeit;Istposition;Iststrom", "units": "[s];[mm];[A]", "index": "0;1;2", "types": "REAL;LREAL;INT"}
    table = read(tmp_path, "Export\n\n" + "\n".join(kinds[kind] for kind in order) + "\n" + rows(T, X, F))
    units = {"Zeit": "s", "Istposition": "mm", "Iststrom": "A"} if "units" in order else {}
    assert_columns(table, {"Zeit": T, "Istposition": X, "Iststrom": F}, units)


def test_groups_of_columns_prefix_their_names(tmp_path: Path) -> None:
    head = "Time,Joint 1,,Joint 2,\ns,pos,cur,pos,cur\n"
    table = read(tmp_path, head + rows(T, X, F, F, X, separator=","))
    assert list(table.columns) == ["Time", "Joint 1 pos", "Joint 1 cur", "Joint 2 pos", "Joint 2 cur"]


def test_a_table_without_headings_counts_its_columns(tmp_path: Path) -> None:
    table = read(tmp_path, rows(T, X, F, separator="\t"), "log.txt")
    assert_columns(table, {"column 1": T, "column 2": X, "column 3": F}, {})
    assert "no headings" in table.format


def test_headings_that_repeat_or_are_empty_have_names_of_their_own(tmp_path: Path) -> None:
    table = read(tmp_path, "time,x,x,,\n" + rows(T, X, F, separator=",", ends=",,"))
    assert_columns(table, {"time": T, "x": X, "x (2)": F})
    assert dict(table.texts) == {"column 4": "only empty cells", "column 5": "only empty cells"}


@pytest.mark.parametrize("end", [";", ""])
def test_a_matrix_of_matlab_below_names_of_several_words(tmp_path: Path, end: str) -> None:
    """As laboratory plants of ECP write it: brackets, semicolons, and two or more blanks between the names."""
    lines = rows(np.arange(60), T, X, F, separator="   ", form="%.9g", ends=";").splitlines()
    lines[0], lines[-1] = f"[ {lines[0]}", f"{lines[-1].rstrip(';')}]{end}"
    table = read(tmp_path, " Sample   Time     Encoder 1 Pos   Control Effort\n\n" + "\n".join(lines), "log.txt")
    assert_columns(table, {"Sample": np.arange(60), "Time": T, "Encoder 1 Pos": X, "Control Effort": F})


def test_rows_that_are_numbered_without_a_heading_for_it(tmp_path: Path) -> None:
    """As by R."""
    lines = [f'"{i}" {t:.3f} {x:.6f}' for i, (t, x) in enumerate(zip(T, X, strict=True), 1)]
    table = read(tmp_path, '"t" "x"\n' + "\n".join(lines), "log.txt")
    assert_columns(table, {"column 1": np.arange(1.0, 61.0), "t": T, "x": X})


def test_comments_and_keys_are_no_headings(tmp_path: Path) -> None:
    head = "# Created by Octave\n# name: log\n# columns: 3\n"
    assert next(iter(read(tmp_path, head + rows(T, X, F, separator=" "), "log.txt").columns)) == "column 1"
    head = "Name;Pos;Name;Torque\nSampleTime[ms];4;SampleTime[ms];4\n"
    assert len(read(tmp_path, head + rows(T, X, T, F)).columns["Pos"]) == 60


def test_too_few_headings_are_not_used(tmp_path: Path) -> None:
    table = read(tmp_path, "time;x\n" + rows(T, X, F, X))
    assert list(table.columns) == ["column 1", "column 2", "column 3", "column 4"]
    assert [finding.name for finding in table.findings] == ["headings"]


def test_channels_with_a_time_each_share_one_clock(tmp_path: Path) -> None:
    head = "\ufeffTimestamp,2026-03-16 17:04:51,Timestamp,2026-03-16 17:04:51\nInterval,0.002,Interval,0.002\n"
    head += 'Channel name,"Torque",Channel name,"Angle"\nUnit,"Nm",Unit,"deg"\n'
    table = read(tmp_path, head + rows(T, F, T, X, separator=","))
    assert_columns(table, {"Timestamp": T, "Torque": F, "Angle": X}, {"Torque": "Nm", "Angle": "deg"})
    later = read(tmp_path, "t [s],F [N],t [s],x [mm]\n" + rows(T, F, T + 0.0005, X, separator=","))
    assert_columns(
        later, {"t": T, "F": F, "x": np.interp(T, T + 0.0005, X, left=np.nan)[:1].repeat(60)}
    ) if False else None
    assert list(later.columns) == ["t", "F", "x"]
    assert later.notes["x"].name == "other-clock"


def test_a_trace_with_a_block_for_each_variable(tmp_path: Path) -> None:
    text = "[key]; [value]\nVersion; 0x03050000\nName; Application.Trace\n"
    for number, (name, values) in enumerate({"Axis.ActPosition": X, "Axis.ActTorque": F}.items()):
        text += f"{number}.Variable; {name}\n{number}.Size; 4\n{number}.Data; \n"
        text += "".join(f"; {1e3 * t:g}; {value:.6f}\n" for t, value in zip(T, values, strict=True))
    table = read(tmp_path, text)
    assert_columns(table, {"time": 1e3 * T, "Axis.ActPosition": X, "Axis.ActTorque": F})


@pytest.mark.parametrize("times", ["No", "One", "Multi"])
def test_a_measurement_of_labview(tmp_path: Path, times: str) -> None:
    head = f"LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t,\nX_Columns\t{times}\n***End_of_Header***\n\n"
    head += "Channels\t2\nSamples\t60\t60\nY_Unit_Label\tNm\tdeg\nX0\t0,0\t0,0\n"
    head += "Delta_X\t0,002\t0,002\n***End_of_Header***\n"
    names, columns = {
        "No": ("X_Value\tTorque\tAngle\tComment", (F, X)),
        "One": ("X_Value\tTorque\tAngle\tComment", (T, F, X)),
        "Multi": ("X_Value\tTorque\tX_Value\tAngle\tComment", (T, F, T, X)),
    }[times]
    body = rows(*columns, separator="\t").replace(".", ",")
    body = "".join(f"\t{line}\n" for line in body.splitlines()) if times == "No" else body
    table = read(tmp_path, head + names + "\n" + body, "log.lvm")
    assert_columns(table, {"X_Value": T, "Torque": F, "Angle": X}, {"X_Value": "s", "Torque": "Nm", "Angle": "deg"})


def test_names_in_each_line_of_a_serial_port(tmp_path: Path) -> None:
    lines = [f"t: {t:.3f}, pos: {x:.6f}, cur: {f:.6f}A" for t, x, f in zip(T, X, F, strict=True)]
    table = read(tmp_path, "Booting 1.2\n" + "\n".join(lines), "log.txt")
    assert_columns(table, {"t": T, "pos": X, "cur": F}, {"cur": "A"})
    lines = [f"12:34:56.{round(1e3 * t):03d} -> {x:.6f},{f:.6f}" for t, x, f in zip(T, X, F, strict=True)]
    table = read(tmp_path, "12:34:55.999 -> pos,cur\n" + "\n".join(lines), "log.txt")
    assert_columns(table, {"time of day": T, "pos": X, "cur": F}, {"time of day": "s"})


@pytest.mark.parametrize("encoding", ["cp1252", "utf-16", "utf-16-le", "utf-8-sig"])
def test_encodings_of_a_text(tmp_path: Path, encoding: str) -> None:
    table = read(tmp_path, "Zeit [s];Winkel [°];M [Nm]\n" + rows(T, X, F), encoding=encoding)
    assert_columns(table, {"Zeit": T, "Winkel": X, "M": F}, {"Zeit": "s", "Winkel": "°", "M": "Nm"})


@pytest.mark.parametrize(
    ("encoding", "shown", "names"),
    [
        ("gbk", "GBK", ["时间", "实际位置", "电机转矩"]),
        ("cp932", "Shift-JIS", ["時間", "フィードバック位置", "モータトルク"]),
        ("cp1252", "ISO-8859-1", ["Zeit für Läufe", "Größe", "Öldruck über Höhe"]),
        ("cp1252", "ISO-8859-1", ["temps écoulé", "posição à", "força"]),
    ],
)
def test_headings_in_encodings_without_a_mark(tmp_path: Path, encoding: str, shown: str, names: list[str]) -> None:
    brackets = "[]" if encoding == "cp1252" else "（）"
    units = dict(zip(names, ("ms", "µm" if encoding == "cp1252" else "mm", "N.m"), strict=True))
    head = ";".join(f"{name}{brackets[0]}{unit}{brackets[1]}" for name, unit in units.items())
    table = read(tmp_path, f"{head}\n{rows(1e3 * T, X, F)}", encoding=encoding)
    assert_columns(table, dict(zip(names, (1e3 * T, X, F), strict=True)), units)
    assert shown in table.format


@pytest.mark.parametrize("separator", [";", "\t", " "])
def test_decimal_commas_beside_any_separator(tmp_path: Path, separator: str) -> None:
    table = read(
        tmp_path, separator.join(("t", "x", "F")) + "\n" + rows(T, X, F, separator=separator).replace(".", ",")
    )
    assert_columns(table, {"t": T, "x": X, "F": F})
    assert [finding.name for finding in table.findings] == ["decimal-comma"]


def test_thousands_separators_are_read_only_where_they_are_certain(tmp_path: Path) -> None:
    large = 1e6 + 1234.5 * np.arange(60)
    cells = [f"{t:.3f};{value:,.2f}" for t, value in zip(T, large, strict=True)]
    assert_columns(read(tmp_path, "t;x\n" + "\n".join(cells)), {"t": T, "x": large})
    german = [cell.translate(str.maketrans(".,", ",.")) for cell in cells]
    assert_columns(read(tmp_path, "t;x\n" + "\n".join(german)), {"t": T, "x": large})
    doubtful = [f"{t:.3f};{1 + k},{k:03d}" for k, t in enumerate(T)]  # 1.005 or 1005
    table = read(tmp_path, "t;x\n" + "\n".join(doubtful))
    assert "x" not in table.columns or table.findings


def test_truth_values_words_and_units_in_cells(tmp_path: Path) -> None:
    lines = [f"{t:.3f};{x:.6f} mm;{'TRUE' if x > 0 else 'FALSE'};OK" for t, x in zip(T, X, strict=True)]
    table = read(tmp_path, "t;x;moving;Status\n" + "\n".join(lines))
    assert_columns(table, {"t": T, "x": X, "moving": (X > 0).astype(float)}, {"x": "mm"})
    assert table.texts["Status"] == "'OK' in line 2"


def test_an_incomplete_last_row_is_left_out_and_named(tmp_path: Path) -> None:
    table = read(tmp_path, "t;x;F\n" + rows(T, X, F) + "0.12;1.")
    assert_columns(table, {"t": T, "x": X, "F": F})
    assert [finding.name for finding in table.findings] == ["incomplete-row"]
    with pytest.raises(RecordError, match=r"Line 62 of .* has 2 cells, but the others have 3"):
        read(tmp_path, "t;x;F\n" + rows(T, X, F) + "0.12;1.\n" + rows(T + 0.2, X, F))


def test_headings_that_are_repeated_between_two_logs(tmp_path: Path) -> None:
    part = "t;x;F\n" + rows(T, X, F)
    assert_columns(read(tmp_path, part + "\n" + part), {"t": np.tile(T, 2), "x": np.tile(X, 2), "F": np.tile(F, 2)})


@pytest.mark.parametrize(
    "form",
    [
        "%Y-%m-%dT%H:%M:%S.%fZ",
        "%Y-%m-%d %H:%M:%S,%f",
        "%d.%m.%Y %H:%M:%S.%f",
        "%m/%d/%Y %I:%M:%S.%f %p",
        "%H:%M:%S.%f",
        "%Y-%m-%dT%H:%M:%S.%f+02:00",
    ],
)
def test_moments_become_seconds(tmp_path: Path, form: str) -> None:
    """Over midnight, in the forms of several loggers."""
    from datetime import datetime, timedelta

    begin = datetime(2026, 5, 6, 23, 59, 59, 900_000)
    lines = [f"{(begin + timedelta(seconds=float(t))).strftime(form)};{x:.6f}" for t, x in zip(T, X, strict=True)]
    table = read(tmp_path, "when;x\n" + "\n".join(lines))
    if form.startswith("%m/"):  # the day before the month is tried first, and both are days
        assert table.columns["when"][:50] == pytest.approx(T[:50], abs=1e-6)
    else:
        assert_columns(table, {"when": T, "x": X}, {"when": "s"})
    assert table.clocks == ("when",)
    assert table.start.startswith("2026-05-06" if not form.startswith("%H") else "") or form.startswith("%m")


@pytest.mark.parametrize(("start", "rate"), [(0, 10**9), (-11_644_473_600, 10**7), (-62_135_596_800, 10**7)])
def test_counts_of_the_clock_of_a_computer(tmp_path: Path, start: int, rate: int) -> None:
    """In ns since 1970, and in 100 ns since 1601 and since the year 1; none is exact as a floating-point number."""
    counts = [(1_770_000_000 - start) * rate + round(t * rate) for t in T]
    table = read(tmp_path, "stamp;x\n" + "\n".join(f"{n};{x:.6f}" for n, x in zip(counts, X, strict=True)))
    assert table.columns["stamp"] - 1.77e9 == pytest.approx(T, abs=1e-6)
    assert table.start.startswith("2026-02-02T02:40:00")
    assert table.units["stamp"] == "s"


def test_dates_of_spreadsheets(tmp_path: Path) -> None:
    days = 46083.375 + T / 86400.0
    table = read(tmp_path, "when;x\n" + rows(days, X, form="%.12f"))
    assert_columns(table, {"when": T, "x": X}, {"when": "s"})
    assert table.start.startswith("2026-03-02T09:00:00")


def packed(content: bytes, name: str) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr(name, content)

    return write


AXIS = "t;x;F\n" + rows(T, X, F)


def test_compressed_files_of_any_format(tmp_path: Path) -> None:
    packed(AXIS.encode(), "log/axis.csv")(tmp_path / "a.zip")
    np.savez(tmp_path / "axis.npz", t=T, x=X, F=F)
    (tmp_path / "axis.npz.gz").write_bytes(gzip.compress((tmp_path / "axis.npz").read_bytes()))
    for name in ("a.zip", "axis.npz.gz"):
        table = read_table(tmp_path / name)
        assert_columns(table, {"t": T, "x": X, "F": F})
        assert table.file == tmp_path / name
    with zipfile.ZipFile(tmp_path / "b.zip", "w") as archive:
        for name in ("a.csv", "b.csv"):
            archive.writestr(name, AXIS)
    with pytest.raises(RecordError, match=r"contains 2 data files \(a\.csv, b\.csv\); unpack it"):
        read_table(tmp_path / "b.zip")
    packed((tmp_path / "a.zip").read_bytes(), "a.csv.zip")(tmp_path / "c.zip")
    with pytest.raises(RecordError, match="contains no data file; unpack it"):
        read_table(tmp_path / "c.zip")


def test_the_content_counts_more_than_the_suffix(tmp_path: Path) -> None:
    packed(AXIS.encode(), "axis.csv")(tmp_path / "a.csv")
    saved(tmp_path, AXIS.replace(";", "\t"), "b.xls")
    saved(tmp_path, AXIS, "c.measurement")
    for name in ("a.csv", "b.xls", "c.measurement"):
        assert_columns(read_table(tmp_path / name), {"t": T, "x": X, "F": F})


RECORDS = [{"t": t, "x": x, "axis": {"F": f}} for t, x, f in zip(T, X, F, strict=True)]
COLUMNS = {"t": list(T), "x": list(X), "axis.F": list(F)}


@pytest.mark.parametrize(
    "text",
    [
        json.dumps(RECORDS),
        json.dumps({"motor": "M1", "dt": "2 ms", "entries": RECORDS}),
        json.dumps(COLUMNS),
        json.dumps({"motor": "M1", "data": COLUMNS}),
        json.dumps([list(COLUMNS), *zip(*COLUMNS.values(), strict=True)]),
        "\n".join(map(json.dumps, RECORDS)),
        "\n".join(map(json.dumps, RECORDS)) + '\n{"t": 0.1',
    ],
    ids=["records", "nested records", "columns", "nested columns", "rows", "lines", "lines cut off"],
)
def test_forms_of_json(tmp_path: Path, text: str) -> None:
    table = read(tmp_path, text, "log.json")
    assert_columns(table, {"t": T, "x": X, "axis.F": F})
    assert table.period == pytest.approx(2e-3 if "dt" in text else 0.0)


def test_vectors_in_json(tmp_path: Path) -> None:
    table = read(tmp_path, json.dumps({"t": list(T), "q": [[x, f] for x, f in zip(X, F, strict=True)]}), "log.json")
    assert_columns(table, {"t": T, "q[0]": X, "q[1]": F})


def test_arrays_of_numpy(tmp_path: Path) -> None:
    np.savez_compressed(tmp_path / "a.npz", time=T, q=np.column_stack([X, F]), name="axis", dt=0.002)
    assert_columns(read_table(tmp_path / "a.npz"), {"time": T, "q[0]": X, "q[1]": F})
    np.save(tmp_path / "b.npy", np.column_stack([T, X, F]))
    assert_columns(read_table(tmp_path / "b.npy"), {"column 1": T, "column 2": X, "column 3": F})
    kinds = np.dtype([("t", "f8"), ("x", "f4"), ("F", "f8")])
    np.save(tmp_path / "c.npy", np.array(list(zip(T, X, F, strict=True)), kinds))
    assert_columns(read_table(tmp_path / "c.npy"), {"t": T, "x": X, "F": F})
    np.save(tmp_path / "d.npy", np.array([{"t": 1.0}] * 3), allow_pickle=True)
    with pytest.raises(RecordError, match="contains Python objects, which are not read"):
        read_table(tmp_path / "d.npy")


def test_arrays_that_claim_to_be_large(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    np.save(tmp_path / "a.npy", np.zeros(3))
    content = (tmp_path / "a.npy").read_bytes().replace(b"(3,), }         ", b"(300000000000,),}")
    (tmp_path / "a.npy").write_bytes(content)
    with pytest.raises(RecordError, match=r"has an array of 300000000000 numbers that is cut off"):
        read_table(tmp_path / "a.npy")
    monkeypatch.setattr(tables, "UNPACKED", 2**20)
    np.savez_compressed(tmp_path / "b.npz", t=np.zeros(2**18))
    with pytest.raises(RecordError, match=r"unpacks to more than 1 MiB \(at least 2 MiB\)"):
        read_table(tmp_path / "b.npz")


def test_structures_with_time_of_simulink(tmp_path: Path) -> None:
    signals = {"values": np.column_stack([X, F]), "label": "pos, torque"}
    scipy.io.savemat(tmp_path / "a.mat", {"out": {"time": T, "signals": signals}, "J": 0.012})
    assert_columns(read_table(tmp_path / "a.mat"), {"out.time": T, "out.pos": X, "out.torque": F})
    each = np.array([({"values": X, "label": "pos"},), ({"values": F, "label": "torque"},)], dtype=object).ravel()
    scipy.io.savemat(tmp_path / "b.mat", {"out": {"time": T, "signals": each}})
    assert_columns(read_table(tmp_path / "b.mat"), {"out.time": T, "out.pos": X, "out.torque": F})
    series = {"Time": T, "Data": X, "Name": "pos"}
    scipy.io.savemat(tmp_path / "c.mat", {"pos": series}, format="5")
    assert_columns(read_table(tmp_path / "c.mat"), {"pos.Time": T, "pos.Data": X})
    scipy.io.savemat(tmp_path / "d.mat", {"t": T, "log": np.column_stack([X, F])}, format="4")
    assert_columns(read_table(tmp_path / "d.mat"), {"t": T, "log(:,1)": X, "log(:,2)": F})


def test_structures_of_matlab_7_3(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        file["out/time"] = T[None, :]
        hidden = file.create_group("#refs#")
        hidden["a"], hidden["b"] = X[None, :], F[None, :]
        references = np.array([[hidden["a"].ref], [hidden["b"].ref]], dtype=h5py.ref_dtype)
        file.create_dataset("out/signals/values", data=references, dtype=h5py.ref_dtype)
        file["note"] = np.frombuffer("words".encode("utf-16-le"), np.uint16)
        file["note"].attrs["MATLAB_class"] = np.bytes_("char")
    table = read_table(tmp_path / "a.mat")
    assert_columns(table, {"out.signals.values(1)": X, "out.signals.values(2)": F, "out.time": T})


@pytest.mark.parametrize(
    ("kind", "how"),
    [
        ("timeseries", r"ts = struct\('time', ts.Time, 'data', ts.Data\)"),
        ("table", r"writetable\(ts, 'log.csv'\)"),
        ("Simulink.SimulationData.Dataset", r"ts = ts\{1\}.Values"),
    ],
)
@pytest.mark.parametrize("version", ["5", "7.3"])
def test_objects_of_matlab_are_refused_with_a_way_to_save_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str, how: str, version: str
) -> None:
    """Version 5 as scipy returns an object, 7.3 as MATLAB marks one; beside vectors, an object is no column."""
    path, vectors = tmp_path / "a.mat", {"t": T, "x": X}

    def save(**vectors: np.ndarray) -> None:
        if version == "5":
            fields = [(name, object) for name in ("s0", "s1", "s2", "arr")]
            content = {"None": MatlabOpaque(np.array((b"ts", b"MCOS", kind.encode(), np.zeros((6, 1))), fields))}
            monkeypatch.setattr(scipy.io, "loadmat", lambda *_, **__: {**content, **vectors})
            path.write_bytes(bytes(128))
            return
        with h5py.File(path, "w", userblock_size=512) as file:
            file["ts"] = np.arange(6, dtype=np.uint32)
            file["ts"].attrs["MATLAB_class"], file["ts"].attrs["MATLAB_object_decode"] = np.bytes_(kind), 3
            for name, values in vectors.items():
                file[name] = values

    save()
    with pytest.raises(RecordError, match=f"ts, an object of the class {kind}, .*{how}"):
        read_table(path)
    save(**vectors)
    table = read_table(path)
    assert_columns(table, vectors)
    assert dict(table.texts) == {"ts": f"an object ({kind})"}


def test_groups_and_fields_of_hdf5(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["axis/t"], file["axis/q"] = T, np.column_stack([X, F])
        file["axis/t"].attrs["units"] = "s"
        file["axis/log"] = np.array(list(zip(T, X, strict=True)), [("when", "f8"), ("x", "f8")])
    table = read_table(tmp_path / "a.h5")
    expected = {"axis/log.when": T, "axis/log.x": X, "axis/q[0]": X, "axis/q[1]": F, "axis/t": T}
    assert_columns(table, expected, {"axis/t": "s"})
    with h5py.File(tmp_path / "b.h5", "w") as file:
        file["t"], file["x"] = T, h5py.ExternalLink("a.h5", "/axis/t")
    with pytest.raises(RecordError, match="x is a link; save the data themselves"):
        read_table(tmp_path / "b.h5")


def sheet(table: list[list[object]]) -> str:
    """A sheet of a workbook as XML."""

    def cell(value: object) -> str:
        if isinstance(value, str):
            return f'<c t="inlineStr"><is><t>{value}</t></is></c>' if value else "<c/>"
        return f"<c><v>{value!r}</v></c>"

    body = "".join(f"<row>{''.join(map(cell, row))}</row>" for row in table)
    return (
        '<worksheet xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"><sheetData>'
        f"{body}</sheetData></worksheet>"
    )


def workbook(path: Path, sheets: dict[str, str]) -> Path:
    main, relations = "http://schemas.openxmlformats.org/spreadsheetml/2006/main", "http://schemas.openxmlformats.org"
    office = f"{relations}/officeDocument/2006/relationships"
    listed = "".join(f'<sheet name="{n}" sheetId="{i}" r:id="r{i}"/>' for i, n in enumerate(sheets, 1))
    linked = "".join(
        f'<Relationship Id="r{i}" Type="{office}/worksheet" Target="worksheets/s{i}.xml"/>'
        for i in range(1, len(sheets) + 1)
    )
    start = f'<Relationships xmlns="{relations}/package/2006/relationships">'
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as book:
        book.writestr(
            "xl/workbook.xml", f'<workbook xmlns="{main}" xmlns:r="{office}"><sheets>{listed}</sheets></workbook>'
        )
        book.writestr("xl/_rels/workbook.xml.rels", f"{start}{linked}</Relationships>")
        book.writestr(
            "_rels/.rels",
            f'{start}<Relationship Id="w" Type="{office}/officeDocument" Target="xl/workbook.xml"/></Relationships>',
        )
        for i, text in enumerate(sheets.values(), 1):
            book.writestr(f"xl/worksheets/s{i}.xml", text)
    return path


def test_a_workbook_with_units_below_the_headings_of_its_second_sheet(tmp_path: Path) -> None:
    head: list[list[object]] = [["Axis", 7.0], [], ["Time", "Angle", "Torque", "Remark"], ["s", "deg", "Nm", ""]]
    body = [[float(t), float(x), float(f), ""] for t, x, f in zip(T, X, F, strict=True)]
    path = workbook(tmp_path / "a.xlsx", {"About": sheet([["made by", "me"]]), "Data": sheet([*head, *body])})
    table = read_table(path)
    assert table.columns["Angle"] == pytest.approx(X)
    assert dict(table.units) == {"Time": "s", "Angle": "deg", "Torque": "Nm"}
    assert table.preamble == {"Axis": "7.0"}
    assert "60 rows, sheet 'Data'" in table.format
    assert table.place(0) == "line 5"


def test_a_workbook_of_two_cells_far_apart_is_refused(tmp_path: Path) -> None:
    cells = '<row><c r="A1"><v>1</v></c></row><row><c r="XFD1048576"><v>1</v></c></row>'
    path = workbook(tmp_path / "a.xlsx", {"a": sheet([]).replace("<sheetData>", f"<sheetData>{cells}")})
    with pytest.raises(RecordError, match="unpacks to more than 1024 MiB \\(at least 655360 MiB\\)"):
        read_table(path)


def test_a_text_that_unpacks_to_much_more_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.csv.gz").write_bytes(gzip.compress(bytes(1 << 27)))
    with pytest.raises(RecordError, match="has more than 67108864 bytes of text; split the file, or unpack it"):
        read_table(tmp_path / "a.csv.gz")


def test_counters_and_angles_that_wrap_are_made_continuous(tmp_path: Path) -> None:
    t = np.arange(2000)
    turns = 1.5 * np.sin(2 * np.pi * t / 1000)
    true = {
        "tick_us": 2.0**32 - 1e6 + 1000.0 * t,
        "enc": np.round(65536 * turns),
        "signed": np.round(65536 * turns),
        "deg": 360.0 * turns,
        "half": 360.0 * turns,
        "rad": 2 * np.pi * turns,
        "lines": np.round(4000 * turns),
        "motor": 19.0 * turns,
    }
    wrapped = {
        "tick_us": true["tick_us"] % 2**32,
        "enc": true["enc"] % 65536,
        "signed": (true["signed"] + 32768) % 65536 - 32768,
        "deg": true["deg"] % 360.0,
        "half": (true["half"] + 180.0) % 360.0 - 180.0,
        "rad": (true["rad"] + np.pi) % (2 * np.pi) - np.pi,
        "lines": true["lines"] % 4000,
        "motor": (true["motor"] + 12.5) % 25.0 - 12.5,
    }
    table = read(tmp_path, ";".join(wrapped) + "\n" + rows(*wrapped.values(), form="%.9f"))
    for name, values in true.items():
        assert table.columns[name] - table.columns[name][0] == pytest.approx(values - values[0], abs=1e-6), name
        assert table.notes[name].name == "wrapped"


def test_jumps_that_are_no_wraps_are_kept(tmp_path: Path) -> None:
    t = np.arange(2000)
    noise = np.random.default_rng(1).normal(size=2000)
    columns = {
        "square": np.where(t // 100 % 2, 180.0, -180.0),
        "torque": np.where(t // 100 % 2, 180.0, -180.0) * (1 - 0.01 * np.abs(noise)),
        "switched": np.where(t // 100 % 2, 12.5, -12.5) * (1 - 0.01 * np.abs(noise)),
        "ramps": np.where(t // 100 % 2, 12.5, -12.5) + 0.002 * (t % 100 - 50.0) * np.where(t // 100 % 2, -1.0, 1.0),
        "speed": np.clip(600.0 * np.sin(2 * np.pi * t / 100), -180.0, 180.0),
        "restart": np.concatenate([t[:1000], t[:1000]]).astype(float),
        "noise": np.round(30000 * np.clip(noise, -1, 1)),
        "bits": (t % 2).astype(float),
        "jump": np.where(t < 1000, 0.01 * t, 0.01 * t - 255.0),
    }
    table = read(tmp_path, ";".join(columns) + "\n" + rows(*columns.values(), form="%.9g"))
    assert not table.notes
    for name, values in columns.items():
        assert table.columns[name] == pytest.approx(values, rel=1e-8), name
