"""Result files: what comes back is what was written, and other people's readers see the same."""

from __future__ import annotations

import struct
from pathlib import Path

import DyMat
import h5py
import numpy as np
import pytest
import scipy.io
import xarray as xr
from harness_parts import memoryless, plant

from harness import (
    OutputError,
    Result,
    ResultFileError,
    SeriesPart,
    System,
    UnknownNameError,
    load_result,
    save_result,
    select,
)
from harness.results import FORMATS

NAN_WITH_A_PAYLOAD = np.array([0x7FF8000000000123]).view(np.float64)[0]
REALS = np.array([0.1, -0.0, NAN_WITH_A_PAYLOAD, np.inf, -np.inf, 5e-324, 1 / 3, np.finfo(float).max])
COUNTS = np.arange(8) - 3
FLAGS = np.array([True, False, False, True] * 2)
KEPT_BY_ALL = [suffix for suffix in FORMATS if suffix != ".csv"]


def example() -> Result:
    """Every type, values that are hard to write, texts that look like units or are no ASCII."""
    variables = {
        "p.F": ("time", REALS, {"units": "N", "description": "Kraft µ, see [3], in Ω"}),
        "p.k[1]": ("time", COUNTS, {"description": "number in [0, 9]"}),
        "p.n": ("time", COUNTS, {"units": "1/min", "description": "speed"}),
        "p.b": ("time", FLAGS, {}),
    }
    times = 0.1 * np.arange(8)
    run = {"system": "Fräse", "master": "1e5", "step": 0.1, "evaluations": 12, "incomplete": ""}
    return xr.Dataset(variables, coords={"time": ("time", times, {"units": "s"})}, attrs=run)


@pytest.mark.parametrize("suffix", KEPT_BY_ALL)
@pytest.mark.parametrize("rows", [0, 1, 8])
def test_all_comes_back_bit_by_bit(suffix: str, rows: int, tmp_path: Path) -> None:
    result = example().isel(time=slice(rows))
    save_result(result, tmp_path / f"out{suffix}")
    back = load_result(tmp_path / f"out{suffix}")
    xr.testing.assert_identical(back, result)
    assert list(back.data_vars) == list(result.data_vars)
    for name in result.variables:
        assert back[name].dtype == result[name].dtype
        assert back[name].to_numpy().tobytes() == result[name].to_numpy().tobytes()
    assert [type(value) for value in back.attrs.values()] == [str, str, float, int, str]


def test_csv_keeps_values_units_and_integers(tmp_path: Path) -> None:
    save_result(example(), tmp_path / "out.csv")
    back = load_result(tmp_path / "out.csv")
    np.testing.assert_array_equal(back["p.F"], REALS)
    assert (np.signbit(back["p.F"]) == np.signbit(REALS))[np.isfinite(REALS)].all()
    np.testing.assert_array_equal(back["p.n"], COUNTS)
    np.testing.assert_array_equal(back["p.b"], FLAGS.astype(int))
    assert {str(name): back[name].dtype.kind for name in back.data_vars} == {
        "p.F": "f",
        "p.k[1]": "i",
        "p.n": "i",
        "p.b": "i",
    }
    assert back["p.F"].attrs == {"units": "N"}
    assert back["p.k[1]"].attrs == {}
    assert back["time"].dtype == np.float64


def test_csv_of_another_program(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("time,F [N]\n0,1\n1,\n2,2.5\n")
    back = load_result(path)
    np.testing.assert_array_equal(back["F"], [1.0, np.nan, 2.5])
    assert back["time"].dtype == np.float64
    assert back["time"].attrs == {"units": "s"}


@pytest.mark.parametrize("suffix", FORMATS)
def test_nothing_recorded(suffix: str, tmp_path: Path) -> None:
    system = System([plant("p")], start={"p.u": 1.0})
    save_result(system.run(stop=1.0, step=0.5, record=[]), tmp_path / f"out{suffix}")
    back = load_result(tmp_path / f"out{suffix}")
    assert (list(back.data_vars), back.sizes["time"], back["time"].dtype) == ([], 0, np.float64)


def test_netcdf_is_plain_hdf5(tmp_path: Path) -> None:
    save_result(example(), tmp_path / "out.nc")
    with h5py.File(tmp_path / "out.nc") as file:
        assert file["p.F"][()].tobytes() == REALS.tobytes()
        assert file["p.F"].attrs["units"] == "N"
        assert file["p.F"].dims[0][0] == file["time"]
        assert file.attrs["system"] == "Fräse"
        np.testing.assert_array_equal(file["p.b"][()], FLAGS)


def test_mat_in_the_eyes_of_dymat(tmp_path: Path) -> None:
    save_result(example(), tmp_path / "out.mat")
    file = DyMat.DyMatFile(str(tmp_path / "out.mat"))
    assert list(file.names()) == ["p.F", "p.k[1]", "p.n", "p.b"]
    assert file.data("p.F").tobytes() == REALS.tobytes()
    np.testing.assert_array_equal(file.data("p.n"), COUNTS)
    np.testing.assert_array_equal(file.data("p.b"), FLAGS)
    times, name, _ = file.abscissa("p.F")
    assert name == "time"
    assert times.tobytes() == example()["time"].to_numpy().tobytes()
    assert file.description("p.n") == "speed [1/min:#(type=Integer)]"
    assert file.description("p.b") == "[:#(type=Boolean)]"


def test_mat_has_the_matrices_that_openmodelica_wants(tmp_path: Path) -> None:
    """Its reader, util/read_matlab4.c, takes these names, types and sizes, in this order, and what it likes behind."""
    save_result(example(), tmp_path / "out.mat")
    content = (tmp_path / "out.mat").read_bytes()
    found, place = [], 0
    while place < len(content):
        # the head of a matrix in MATLAB 4: kind, rows, columns, whether complex, length of the name with its NUL
        kind, rows, columns, _, length = struct.unpack_from("<5i", content, place)
        place += 20
        found.append((content[place : place + length - 1].decode(), kind, rows, columns))
        place += length + rows * columns * {51: 1, 20: 4, 0: 8}[kind]
    assert found[0] == ("Aclass", 51, 4, 11)
    assert [matrix[:2] for matrix in found[1:3]] == [("name", 51), ("description", 51)]
    assert found[3:6] == [("dataInfo", 20, 4, 5), ("data_1", 0, 1, 2), ("data_2", 0, 5, 8)]
    assert [matrix[0] for matrix in found[6:]] == ["attributes"]


@pytest.mark.parametrize("layout", ["binTrans", "binNormal"])
def test_mat_of_dymola(layout: str, tmp_path: Path) -> None:
    """A parameter, an alias with the other sign, single precision, a shown unit, a time that is called Time."""
    path = tmp_path / "dsres.mat"
    data = np.array([[0.0, 1.0, 2.0], [0.5, 0.25, 0.125]], dtype=np.float32)
    matrices = {
        "Aclass": ["Atrajectory", "1.1        ", "           ", layout.ljust(11)],
        "name": ["Time", "m   ", "x   ", "y   ", "on  "],
        "description": [
            "Time in [s]                            ",
            "Masse für alles [kg]                   ",
            "[m|mm:#(nominal=1):#(shown)]           ",
            "                                       ",
            "= true, if on [:#(type=Boolean)]       ",
        ],
        "dataInfo": np.array([[0, 1, 2, 2, 1], [1, 2, 2, -2, 3], [0, 0, 0, 0, 0], [-1, 0, 0, 0, 0]], dtype=np.int32),
        "data_1": np.array([[0.0, 2.0], [3.0, 3.0], [1.0, 1.0]]),
        "data_2": data,
    }
    for name in ("Aclass", "name", "description"):
        letters = np.array([list(text) for text in matrices[name]])
        turned = letters.T if layout == "binTrans" and name != "Aclass" else letters
        matrices[name] = np.ascontiguousarray(turned)  # scipy mixes up the letters of any other array
    if layout == "binNormal":
        matrices |= {name: matrix.T for name, matrix in matrices.items() if name[:2] == "da"}
    scipy.io.savemat(path, matrices, format="4")
    back = load_result(path)
    np.testing.assert_array_equal(back["time"], [0.0, 1.0, 2.0])
    np.testing.assert_array_equal(back["m"], [3.0, 3.0, 3.0])
    np.testing.assert_array_equal(back["x"], data[1])
    np.testing.assert_array_equal(back["y"], -data[1])
    np.testing.assert_array_equal(back["on"], [True, True, True])
    assert back["on"].dtype == np.bool_
    assert back["m"].attrs == {"units": "kg", "description": "Masse für alles"}
    assert back["x"].attrs == {"units": "m"}
    assert back["on"].attrs == {"description": "= true, if on"}


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_damaged_file_is_refused_in_one_sentence(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"out{suffix}"
    path.write_bytes(b"\x01\x02 rubbish,, \n" * 9)
    with pytest.raises(ResultFileError, match="cannot read the result") as caught:
        load_result(path)
    assert "\n" not in str(caught.value)


def test_missing_files_and_unknown_suffixes(tmp_path: Path) -> None:
    with pytest.raises(ResultFileError, match="the file does not exist"):
        load_result(tmp_path / "none.csv")
    with pytest.raises(ResultFileError, match=r"ends in \.csv, \.parquet, \.nc or \.mat"):
        load_result(tmp_path / "out.xls")
    with pytest.raises(OutputError, match=r"use a name that ends in \.csv, \.parquet, \.nc or \.mat"):
        save_result(example(), tmp_path / "out.xls")
    with pytest.raises(OutputError, match=r"slash in a name such as 'p\.a/b'"):
        save_result(example().rename({"p.F": "p.a/b"}), tmp_path / "out.nc")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("text", ["x,y\n1,2\n", "time [s],x\n0,high\n"], ids=["no time", "no number"])
def test_a_csv_that_is_no_result(text: str, tmp_path: Path) -> None:
    (tmp_path / "out.csv").write_text(text)
    with pytest.raises(ResultFileError, match=r"no column .time.|values that are not numbers"):
        load_result(tmp_path / "out.csv")


def test_a_mat_file_that_is_no_trajectory(tmp_path: Path) -> None:
    scipy.io.savemat(tmp_path / "out.mat", {"x": [1.0]})
    with pytest.raises(ResultFileError, match="no matrix Aclass"):
        load_result(tmp_path / "out.mat")


def names(*patterns: str) -> list[str]:
    parts = [memoryless("a", ["u"], ["y", "k[1]", "k[2]"]), plant("ab")]
    result = System(parts, ["ab.y -> a.u", "a.y -> ab.u"]).run(stop=1.0, step=1.0)
    selected = select(result, *patterns)
    assert selected.sizes["time"] == 2
    assert selected.attrs == result.attrs
    return [str(name) for name in selected.data_vars]


def test_select() -> None:
    assert names("*") == ["a.y", "a.k[1]", "a.k[2]", "ab.y"]
    assert names("a.*") == ["a.y", "a.k[1]", "a.k[2]"]
    assert names("a.k[?]") == ["a.k[1]", "a.k[2]"]
    assert names("a.k[2]", "*.y") == ["a.k[2]", "a.y", "ab.y"]
    assert names() == []


@pytest.mark.parametrize("pattern", ["c.*", "a.k[3]", "a.k[12]", "time"])
def test_select_of_nothing(pattern: str) -> None:
    with pytest.raises(UnknownNameError, match="was not recorded"):
        names(pattern)


@pytest.mark.parametrize("name", ["=1+1.x", "+a.x", "-a.x", "@SUM(A1).x", "'=a.x", "''-a.x", "'a.x", "a.=x", "\t=a.x"])
def test_a_heading_that_a_spreadsheet_takes_for_a_formula(name: str, tmp_path: Path) -> None:
    """Excel and LibreOffice compute what begins with =, +, - or @, also where a quoted field of CSV begins with it."""
    result = xr.Dataset({name: ("time", [1.5, 2.5], {"units": "m"})}, coords={"time": [0.0, 1.0]})
    save_result(result, tmp_path / "out.csv")
    heading = (tmp_path / "out.csv").read_text().splitlines()[0].partition(",")[2]
    assert not heading.strip('"').startswith(("=", "+", "-", "@", "\t"))
    back = load_result(tmp_path / "out.csv")
    assert list(back.data_vars) == [name.strip()]
    assert back[name.strip()].attrs == {"units": "m"}
    part = SeriesPart.from_csv("series", tmp_path / "out.csv")
    assert [port.name for port in part.outputs] == [name.strip()]


def test_mat_refuses_to_round_integers(tmp_path: Path) -> None:
    def result(largest: int) -> xr.Dataset:
        return xr.Dataset({"p.n": ("time", np.array([0, largest]))}, {"time": [0.0, 1.0]})

    save_result(result(-(2**53)), tmp_path / "right.mat")
    assert load_result(tmp_path / "right.mat")["p.n"].to_numpy().tolist() == [0, -(2**53)]
    for largest in (2**53 + 1, -(2**63)):
        with pytest.raises(OutputError, match=r"'p\.n' has integers beyond"):
            save_result(result(largest), tmp_path / "wrong.mat")
    assert not (tmp_path / "wrong.mat").exists()


def test_two_columns_of_one_name_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("time [s],a,a\n0,1,2\n")
    with pytest.raises(ResultFileError, match="two of its columns are called 'a'"):
        load_result(tmp_path / "a.csv")
