from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from thorough import landing, nightly

from friction_fmus.data import load_emps, load_tribometer
from friction_fmus.identification import ROTARY, RecordError, read_measurement, read_records
from friction_fmus.identification.data.mapping import read_mapping

EXAMPLES = Path(__file__).parents[2] / "examples" / "identification"

T = np.arange(400) * 2e-3
X = np.sin(2 * np.pi * 5 * T)
V = 2 * np.pi * 5 * np.cos(2 * np.pi * 5 * T)


def axis(folder: Path, **columns: Any) -> Path:
    """A file with these columns, which are called as they are named here."""
    path = folder / "axis.csv"
    rows = [",".join(f"{value:.12g}" for value in row) for row in zip(*columns.values(), strict=True)]
    path.write_text("\n".join([",".join(columns), *rows]) + "\n", encoding="utf-8")
    return path


def mapping(folder: Path, text: str) -> Path:
    path = folder / "axis.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_mapping_names_file_columns_units_and_windows(tmp_path: Path) -> None:
    axis(tmp_path, t=1e3 * T, x=1e6 * X, u=V, n=0 * T + 2.0)
    path = mapping(
        tmp_path,
        """
        [data]
        file = "axis.csv"
        name = "X axis"
        citation = "Who, 2024"
        [columns]
        time = { column = "t", unit = "ms" }
        position = { column = "x", unit = "um" }
        force = { column = "u", unit = "V", gain = "35.15 N/V", sign = -1, held = true }
        normal = { column = "n", unit = "kN" }
        [windows]
        train = [0.0, 0.3]
        validation = [0.4, 0.7]
        """,
    )
    measurement = read_measurement(path)
    (record,) = measurement.records
    assert (record.name, record.citation) == ("X axis", "Who, 2024")
    assert record.t == pytest.approx(T, abs=1e-9)
    assert record.q == pytest.approx(X, abs=1e-9)
    assert record.force == pytest.approx(-35.15 * V, rel=1e-9, abs=1e-9)
    assert record.normal == pytest.approx(2000.0)
    mean = 0.5 * (record.force[1:] + record.force[:-1])  # the command acts from its sample to the next one
    assert record.held and record.force_at_samples()[1:] == pytest.approx(mean)
    assert measurement.mapping.windows == {"train": (0.0, 0.3), "validation": (0.4, 0.7)}
    (part,) = measurement.window(*measurement.mapping.windows["validation"])
    assert (part.t[0], part.t[-1]) == pytest.approx((0.4, 0.7))


def test_a_rotary_axis_is_known_by_its_units(tmp_path: Path) -> None:
    path = axis(tmp_path, t=T, phi=X, n=V, i=V)
    columns = {
        "time": {"column": "t", "unit": "s"},
        "position": {"column": "phi", "unit": "deg"},
        "velocity": {"column": "n", "unit": "rpm"},
        "force": {"column": "i", "unit": "A", "gain": "70 mN.m/A"},
    }
    (record,) = read_records(path, {"columns": {**columns, "velocity": {"column": "n", "unit": "deg/s"}}})
    assert record.units == ROTARY
    assert record.q == pytest.approx(np.pi / 180 * X, abs=1e-12)
    assert record.v == pytest.approx(np.pi / 180 * V, abs=1e-12)
    assert record.force == pytest.approx(0.07 * V, rel=1e-9, abs=1e-12)
    rpm = read_measurement(path, {"columns": columns}).records[0]
    assert rpm.v == pytest.approx(np.pi / 30 * V, rel=1e-9)


def test_counts_of_an_encoder_become_a_length_by_a_gain(tmp_path: Path) -> None:
    counts = np.round(1e3 * np.sin(5.1234 * T))
    path = axis(tmp_path, t=T, counts=counts, F=V)
    columns = {
        "time": {"column": "t", "unit": "s"},
        "position": {"column": "counts", "unit": "1", "gain": "0.5 um"},
        "force": {"column": "F", "unit": "N"},
    }
    (record,) = read_records(path, {"columns": columns})
    assert record.q == pytest.approx(0.5e-6 * counts, abs=1e-15)
    assert record.quantum == pytest.approx(0.5e-6, rel=1e-6)


def test_a_file_without_time_has_a_period(tmp_path: Path) -> None:
    path = axis(tmp_path, x=X, F=V)
    columns = {"time": {"period": "2 ms"}, "position": {"column": "x", "unit": "m"}}
    (record,) = read_records(path, {"columns": columns})
    assert record.t == pytest.approx(T, abs=1e-12)
    assert record.force is None


def test_headings_with_units_need_no_mapping_or_a_short_one(tmp_path: Path) -> None:
    path = tmp_path / "axis.csv"
    rows = [f"{t:.9g},{1e3 * x:.9g},{v:.9g}" for t, x, v in zip(T, X, V, strict=True)]
    path.write_text("\n".join(["Time [s],Carriage [mm],Shear [N]", *rows]), encoding="utf-8")
    columns = {"time": "Time", "position": "Carriage", "friction": {"column": "Shear", "sign": -1}}
    record = read_measurement(path, {"columns": columns}).records[0]
    assert record.q == pytest.approx(X, abs=1e-9)
    assert record.friction == pytest.approx(-V, rel=1e-8)


def test_headings_that_leave_a_choice_are_answered_with_the_mapping_to_write(tmp_path: Path) -> None:
    path = axis(tmp_path, t=T, x=X, b=V)
    with pytest.raises(RecordError) as caught:
        read_records(path)
    message, _, shown = str(caught.value).partition("[data]")
    shown = f"[data]{shown}"
    assert "'t' has no unit" in message
    assert "no heading is recognised as force or friction" in message
    assert "# unused columns: b" in shown
    completed = shown.replace('"t", unit = "?"', '"t", unit = "s"').replace('"x", unit = "?"', '"x", unit = "m"')
    completed = completed.replace('"?", unit = "?"', '"b", unit = "V", gain = "2 N/V"')
    (record,) = read_records(mapping(tmp_path, completed))
    assert record.force == pytest.approx(2 * V, rel=1e-8)


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"position": {"column": "x", "unit": "m"}}, "has no time in"),
        ({"time": {"column": "t", "unit": "s"}}, "neither position nor velocity"),
        ({"time": {"column": "t", "unit": "mm"}}, "time, has the unit 'mm', which has the wrong dimension"),
        (
            {"force": {"column": "u", "unit": "V"}},
            "force, has the unit 'V', which has the wrong dimension; .* gain = .2.5 N/V",
        ),
        (
            {"force": {"column": "u", "unit": "V", "gain": "3 N/A"}},
            "gain 3 N/A, which has the wrong dimension",
        ),
        ({"force": {"column": "u", "unit": "V", "gain": "much"}}, "not a number with a known unit"),
        ({"force": {"column": "u", "unit": "bananas"}}, "unknown unit 'bananas'"),
        ({"force": {"column": "u", "unit": "N", "sign": 2}}, "sign = 2; give 1 or -1"),
        ({"force": {"column": "u", "unit": "N", "held": "yes"}}, "give true or false"),
        ({"position": {"column": "u", "unit": "m", "held": True}}, "unknown key 'held'"),
        ({"force": {"column": "u", "unit": "N", "scale": 2}}, "unknown key 'scale'"),
        ({"force": {"unit": "N"}}, "force, needs column"),
        ({"force": 3}, "force, is 3; use"),
        ({"current": "u"}, "columns., has the unknown role 'current'; known are force, "),
        ({"time": {"period": "-1 ms"}}, "use a positive time"),
    ],
)
def test_mappings_that_make_no_sense_are_refused(tmp_path: Path, columns: dict[str, Any], message: str) -> None:
    path = axis(tmp_path, t=T, x=X, u=V)
    with pytest.raises(RecordError, match=message):
        read_records(path, {"columns": columns})


@pytest.mark.parametrize(
    ("windows", "message"),
    [
        ({"test": [0, 1]}, "unknown window 'test'; known are train, validation"),
        ({"train": [1, 0]}, "the earlier one first"),
        ({"train": [1]}, "give start and end"),
        ({"train": "all"}, "give start and end"),
        ({"validation": [0, 1]}, "add one for train"),
        ({"train": [0, 2], "validation": [1, 3]}, "overlapping windows"),
    ],
)
def test_windows_that_make_no_sense_are_refused(windows: dict[str, Any], message: str) -> None:
    with pytest.raises(RecordError, match=message):
        read_mapping({"windows": windows}, Path())


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[data]\nfile = 3\n", "file = 3; give a string"),
        ("[data]\npath = 'x'\n", "unknown key 'path'"),
        ("[colums]\n", "unknown table 'colums'"),
        ("[data\n", "cannot be read as TOML"),
        ("data = 1\n", "not a table; make it a table"),
        ("[data]\nname = 'x'\n", "names no data file"),
        ("[data]\nrecord = 'emps'\n", "names the record 'emps' of the package, which only a study reads"),
        ("[data]\nfile = 'x.csv'\n[servo]\nkp = 1\n", "There is no data file"),
    ],
)
def test_files_that_are_no_mappings_are_refused(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(RecordError, match=message):
        read_records(mapping(tmp_path, text))


def test_columns_of_two_kinds_of_axes_are_refused(tmp_path: Path) -> None:
    path = axis(tmp_path, t=T, x=X, u=V)
    columns = {"time": {"column": "t", "unit": "s"}, "position": {"column": "x", "unit": "m"}}
    force = {"column": "u", "unit": "N.m"}
    with pytest.raises(RecordError, match="column 'u' for the force, has a unit that is not valid for an axis"):
        read_records(path, {"columns": {**columns, "force": force}})


def test_a_column_that_is_not_there_is_named_with_those_that_are(tmp_path: Path) -> None:
    path = axis(tmp_path, t=T, x=X, u=V)
    columns = {"time": {"column": "T", "unit": "s"}, "position": {"column": "x", "unit": "m"}}
    with pytest.raises(RecordError, match="has no column 'T' for the time; it has 't', 'x', 'u'"):
        read_records(path, {"columns": columns})


def test_a_mapping_is_not_given_twice(tmp_path: Path) -> None:
    path = mapping(tmp_path, "[data]\nfile = 'axis.csv'\n")
    with pytest.raises(RecordError, match="is itself a mapping"):
        read_records(path, path)


@landing
def test_the_mapping_of_the_emps_record_gives_the_record_of_the_package() -> None:
    (record,) = read_records(EXAMPLES / "emps.toml")
    known = load_emps()
    for column in ("t", "q", "reference", "force"):
        # the gain of the mapping has as many digits as the README of the record
        assert record.column(column) == pytest.approx(known.column(column), rel=1e-6, abs=1e-12)
    assert record.quantum == pytest.approx(5e-8, rel=1e-6)


@nightly
def test_the_mapping_of_the_tribometer_gives_the_record_of_the_package() -> None:
    measurement = read_measurement(EXAMPLES / "tribometer.toml")
    (part,) = measurement.window(*measurement.mapping.windows["train"])
    known = load_tribometer()
    # an interval of 9 ms before puts the samples at 60.004 s, 60.009 s, ...
    assert part.t[[0, -1]] == pytest.approx([60.004, 89.999])
    for column in ("q", "friction", "normal"):
        assert np.array_equal(part.column(column), np.interp(part.t, known.t, known.column(column)))
    assert [finding.name for finding in measurement.findings] == ["rate-change", "jittered-times"]
