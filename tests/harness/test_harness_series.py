"""Recorded series as parts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from harness_parts import mass

from harness import SeriesError, SeriesPart, System, save_result

TIMES = [0.0, 0.5, 1.0, 2.0]
VALUES = {"r": [0.0, 1.0, -1.0, 3.0], "q": [5.0, 5.0, 6.0, 7.0]}


@pytest.mark.parametrize("master", ["jacobi", "gauss-seidel"])
def test_linear(master: str) -> None:
    result = System([SeriesPart("s", TIMES, VALUES, {"r": "m"})]).run(stop=2.0, step=0.25, master=master)
    np.testing.assert_allclose(result["s.r"], np.interp(np.arange(9) * 0.25, TIMES, VALUES["r"]), rtol=1e-15)
    assert result["s.r"].attrs["units"] == "m"


def test_previous_with_samples_on_ticks_that_rounding_misses() -> None:
    times = np.arange(101) * 0.1
    values = np.arange(101.0)
    result = System([SeriesPart("s", times, {"r": values}, interpolation="previous")]).run(stop=10.0, step=0.1)
    np.testing.assert_array_equal(result["s.r"], values)
    between = System([SeriesPart("s", TIMES, VALUES, interpolation="previous")]).run(stop=2.0, step=0.25)
    np.testing.assert_array_equal(between["s.r"], [0, 0, 1, 1, -1, -1, -1, -1, 3])


def test_run_beyond_the_record() -> None:
    with pytest.raises(SeriesError, match=r"covers 0 to 2 s, but the run goes from 0 to 3 s: .*hold"):
        System([SeriesPart("s", TIMES, VALUES)]).run(stop=3.0, step=0.5)
    held = System([SeriesPart("s", TIMES, VALUES, beyond="hold")]).run(start=-1.0, stop=3.0, step=1.0)
    np.testing.assert_array_equal(held["s.r"], [0, 0, -1, 3, 3])


@pytest.mark.parametrize(
    ("times", "values", "message"),
    [
        ([0.0, 0.0], [1.0, 2.0], "do not increase at row 1"),
        ([0.0, 1.0], [1.0], "2 times but 1 values"),
        ([0.0, 1.0], [1.0, np.nan], "not finite"),
        ([], [], "is empty"),
    ],
)
def test_bad_arrays(times: list[float], values: list[float], message: str) -> None:
    with pytest.raises(SeriesError, match=message):
        SeriesPart("s", times, {"r": values})


def test_unknown_options() -> None:
    with pytest.raises(SeriesError, match="use linear or previous"):
        SeriesPart("s", TIMES, VALUES, interpolation="cubic")  # type: ignore[arg-type]
    with pytest.raises(SeriesError, match="use error or hold"):
        SeriesPart("s", TIMES, VALUES, beyond="wrap")  # type: ignore[arg-type]


def test_a_result_can_be_played_back(tmp_path: Path) -> None:
    result = System([mass()], start={"mass.F": -2.0}).run(stop=1.0, step=0.1)
    save_result(result, tmp_path / "record.csv")
    series = SeriesPart.from_csv("again", tmp_path / "record.csv")
    assert [(port.name, port.unit) for port in series.outputs] == [("mass.x", "m"), ("mass.v", "m/s")]
    again = System([series]).run(stop=1.0, step=0.1)
    np.testing.assert_allclose(again["again.mass.x"], result["mass.x"], rtol=1e-12)


def test_index_is_not_a_unit(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text("time [s],k[1],k[2] [N]\n0,1,2\n")
    series = SeriesPart.from_csv("s", tmp_path / "r.csv")
    assert [(port.name, port.unit) for port in series.outputs] == [("k[1]", None), ("k[2]", "N")]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no column 'time'"),
        ("time [s],x\n", "is empty"),
        ("time [s]\n0\n", "is empty"),
        ("x,y\n0,1\n", "no column 'time'"),
        ("time [ms],y\n0,1\n", "unit ms: give seconds"),
        ("time,x,x\n0,1,2\n", "two of its columns are called 'x'"),
        ("time,x\n0,one\n", "'x' contains values that are not numbers"),
        ("time,x\n0,\n1,2\n", "not finite"),
        ("time,x\n0,1\n1\n", "row 2 has 1 cells instead of 2"),
        ("time,x\n0,1,2\n", "row 1 has 3 cells instead of 2"),
    ],
)
def test_bad_csv(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "bad.csv").write_text(text)
    with pytest.raises(SeriesError, match=message):
        SeriesPart.from_csv("s", tmp_path / "bad.csv")


@pytest.mark.parametrize("heading", ["t", "Time [s]"])
def test_the_first_column_is_the_time(tmp_path: Path, heading: str) -> None:
    (tmp_path / "r.csv").write_text(f"{heading},x\n0,1\n0.5,2\n")
    np.testing.assert_array_equal(SeriesPart.from_csv("s", tmp_path / "r.csv").table().times, [0.0, 0.5])


def test_missing_csv(tmp_path: Path) -> None:
    with pytest.raises(SeriesError, match="cannot read the record"):
        SeriesPart.from_csv("s", tmp_path / "none.csv")


def test_durations_are_seconds_and_dates_are_refused() -> None:
    index = pd.date_range("2026-01-01", periods=3, freq="500ms")
    series = SeriesPart("s", index - index[0], {"y": [0.0, 1.0, 2.0]})
    np.testing.assert_array_equal(series.table().times, [0.0, 0.5, 1.0])
    for dates in (index, index.tz_localize("UTC")):
        with pytest.raises(SeriesError, match=r"the times of the record 's' are no numbers .*total_seconds"):
            SeriesPart("s", dates, {"y": [0.0, 1.0, 2.0]})
    with pytest.raises(SeriesError, match="the values 'y' of the record 's' are no numbers"):
        SeriesPart("s", [0.0, 1.0, 2.0], {"y": index})


@pytest.mark.parametrize(
    ("times", "values", "found"),
    [
        ([0.0, 0.011, 0.012], [0.0, 1.0, 0.0], ("u", 0.011)),
        ([0.0, 0.011, 0.012], [0.0, 1.0, 2.0], None),  # a step sees the largest value
        ([0.0, 0.010, 0.012], [0.0, 1.0, 0.0], None),  # a step begins with the second sample
        ([0.0, 0.011, 0.012, 0.5], [0.0, 0.04, 0.0, 1.0], None),  # small
        ([0.0, 0.091, 0.102, 0.103], [0.0, 1.0, 2.0, 1.0], None),  # after the last step
        ([-2.0, -1.5, -1.0], [0.0, 1.0, 0.0], None),  # before the first
    ],
)
def test_values_that_no_step_sees(times: list[float], values: list[float], found: tuple[str, float] | None) -> None:
    series = SeriesPart("s", times, {"u": values}, interpolation="previous", beyond="hold")
    assert series.missed(0.0, 1e-2, 10) == found
    assert SeriesPart("s", times, {"u": values}, beyond="hold").missed(0.0, 1e-2, 10) is None
