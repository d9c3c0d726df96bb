from __future__ import annotations

import gzip
import lzma
import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
import xarray as xr

from friction_fmus.identification import RecordError, RecordWarning, read_measurement, read_records
from friction_fmus.identification.data import tables as data_tables
from harness import save_result

T = np.arange(200) * 1e-3
X = 5.0 * np.sin(2 * np.pi * 10 * T)  # mm
F = 3.0 * np.cos(2 * np.pi * 10 * T) + 0.2 * np.sign(np.cos(2 * np.pi * 10 * T))  # N


def lines(separator: str = ",", heading: str = "t [s],x [mm],force [N]", form: str = "%.9g") -> str:
    rows = [separator.join(form % value for value in row) for row in zip(T, X, F, strict=True)]
    return "\n".join([heading.replace(",", separator), *rows]) + "\n"


def write(folder: Path, text: str, name: str = "axis.csv") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def assert_is_the_axis(path: Path, mapping: Path | dict[str, object] | None = None) -> None:
    (record,) = read_records(path, mapping)
    assert record.t == pytest.approx(T, abs=1e-9)
    assert record.q == pytest.approx(1e-3 * X, abs=1e-9)
    assert record.force == pytest.approx(F, abs=1e-6)


@pytest.mark.parametrize("separator", [",", ";", "\t", "|", ", ", "  "])
def test_any_usual_separator_is_found(tmp_path: Path, separator: str) -> None:
    text = lines(separator) if separator != "  " else lines(separator, "t[s],x[mm],force[N]")
    assert_is_the_axis(write(tmp_path, text))


@pytest.mark.parametrize("name", ["axis.tsv", "axis.txt", "axis.dat", "AXIS.CSV"])
def test_the_suffix_of_a_text_does_not_matter(tmp_path: Path, name: str) -> None:
    assert_is_the_axis(write(tmp_path, lines("\t"), name))


@pytest.mark.parametrize(
    "text",
    [
        "# made by a logger\n\n" + lines() + "# end\n",
        "% made by a logger\nAxis 7\n" + lines(),
        lines(heading="t,x,force").replace("t,x,force\n", "t,x,force\ns,mm,N\n"),
        lines(heading="# t [s],x [mm],force [N]"),
        "\ufeff" + lines(),
        lines(heading='"t [s]","x [mm]","force [N]"'),
        lines(heading="time (s),position_mm,Force (N)"),
        lines().replace("\n", "\r\n"),
        lines().replace("\n", ",\n"),
    ],
    ids=["comments", "title", "row of units", "heading as comment", "BOM", "quotes", "names", "Windows", "loose ends"],
)
def test_what_loggers_write_around_the_numbers_is_understood(tmp_path: Path, text: str) -> None:
    assert_is_the_axis(write(tmp_path, text))


@pytest.mark.parametrize(("suffix", "compress"), [("gz", gzip.compress), ("xz", lzma.compress)])
def test_a_text_may_be_compressed(tmp_path: Path, suffix: str, compress: Callable[[bytes], bytes]) -> None:
    path = tmp_path / f"axis.csv.{suffix}"
    path.write_bytes(compress(lines().encode()))
    assert_is_the_axis(path)


def test_columns_of_words_may_stand_beside(tmp_path: Path) -> None:
    text = "\n".join(f"{line},{'state' if i == 0 else 'run'}" for i, line in enumerate(lines().splitlines()))
    assert_is_the_axis(write(tmp_path, text))


def test_a_decimal_comma_is_read_and_named(tmp_path: Path) -> None:
    path = write(tmp_path, lines(";").replace(".", ","))
    with pytest.warns(RecordWarning, match=r"^decimal-comma: "):
        assert_is_the_axis(path)


def test_a_decimal_comma_beside_separating_commas_is_refused(tmp_path: Path) -> None:
    rows = [",".join(f"{value:.6f}".replace(".", ",") for value in row) for row in zip(T, X, strict=True)]
    path = write(tmp_path, "\n".join(["t [s],x [mm]", *rows]))
    with pytest.raises(RecordError, match="decimal points, use semicolons"):
        read_records(path)


def test_moments_are_seconds_since_the_first_one(tmp_path: Path) -> None:
    moments = np.datetime64("2024-02-29T23:59:59.900") + (1e3 * T).round().astype("timedelta64[ms]")
    rows = [f"{moment},{x:.9g},{f:.9g}" for moment, x, f in zip(moments, X, F, strict=True)]
    assert_is_the_axis(write(tmp_path, "\n".join(["time,x [mm],force [N]", *rows])))


def test_parquet_with_and_without_units_in_its_fields(tmp_path: Path) -> None:
    columns = {"t": T, "x": X, "force": F}
    units = {"t": "s", "x": "mm", "force": "N"}
    fields = [pa.field(name, pa.float64(), metadata={"units": unit}) for name, unit in units.items()]
    pq.write_table(pa.table(list(columns.values()), schema=pa.schema(fields)), tmp_path / "a.parquet")
    assert_is_the_axis(tmp_path / "a.parquet")
    pq.write_table(pa.table(columns), tmp_path / "b.parquet")
    assert_is_the_axis(tmp_path / "b.parquet", tables("t", "x", "force"))


def tables(t: str, x: str, f: str) -> dict[str, object]:
    return {
        "columns": {
            "time": {"column": t, "unit": "s"},
            "position": {"column": x, "unit": "mm"},
            "force": {"column": f, "unit": "N"},
        }
    }


def test_matlab_files_of_version_5_with_vectors_matrices_and_structures(tmp_path: Path) -> None:
    content = {"t": T, "log": {"x": X[:, None], "kp": 3.0}, "forces": np.column_stack([0 * F, F]), "note": "words"}
    scipy.io.savemat(tmp_path / "a.mat", content)
    assert_is_the_axis(tmp_path / "a.mat", tables("t", "log.x", "forces(:,2)"))


def test_matlab_files_of_version_7_3(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        file["t"] = T[None, :]  # a column of MATLAB
        file["log/x"] = X[:, None]
        file["forces"] = np.vstack([0 * F, F])
    assert_is_the_axis(tmp_path / "a.mat", tables("t", "log.x", "forces(:,2)"))


def test_trajectories_of_dymola_bring_their_units(tmp_path: Path) -> None:
    result = xr.Dataset(
        {"x": ("time", X, {"units": "mm"}), "force": ("time", F, {"units": "N"})},
        coords={"time": ("time", T, {"units": "s"})},
    )
    save_result(result, tmp_path / "run.mat")
    assert_is_the_axis(tmp_path / "run.mat")


def test_a_row_with_other_cells_is_named_with_its_line(tmp_path: Path) -> None:
    text = "# one\n" + lines()
    broken = text.replace(text.splitlines()[6], "0.004,1")
    with pytest.raises(RecordError, match=r"Line 7 of .* has 2 cells, but the others have 3"):
        read_records(write(tmp_path, broken))


def test_a_word_among_the_numbers_is_named_with_its_line(tmp_path: Path) -> None:
    rows = lines().splitlines()
    rows[11] = rows[11].rsplit(",", 1)[0] + ",overflow"
    with pytest.raises(RecordError, match=r"column 'force' for the force, is not numeric: .*'overflow' in line 12"):
        read_records(write(tmp_path, "\n".join(rows)), tables("t", "x", "force"))


def test_missing_cells_are_left_out_and_named(tmp_path: Path) -> None:
    rows = lines().splitlines()
    rows[100] = rows[100].rsplit(",", 1)[0] + ","
    rows[150] = rows[150].rsplit(",", 1)[0] + ",nan"
    measurement = read_measurement(write(tmp_path, "\n".join(rows)))
    assert [finding.name for finding in measurement.findings] == ["missing-samples", "irregular-sampling"]
    assert "2 of 200 rows" in measurement.findings[0].what
    assert "line 101" in measurement.findings[0].what
    (record,) = measurement.records
    assert record.t == pytest.approx(T, abs=1e-9)
    assert record.q == pytest.approx(1e-3 * X, abs=1e-7)  # a cubic spline of 100 samples a period
    assert record.force[99] == pytest.approx(0.5 * (F[98] + F[100]), abs=1e-6)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.csv", b"", "has too few lines for a table .0.;"),
        ("a.csv", b"one\ntwo\nthree\nfour\n", "has no line of numbers"),
        ("a.json", b'{"base": ["a", "b", "c"], "tip": ["d", "e", "f"]}', "no column has numbers that change"),
        ("a.txt", b"Grav Free\n" + b"1.35\n" * 9, "no column has numbers that change"),
        ("a.mat", b"nothing of MATLAB" * 50, "cannot be read as a .mat file"),
        ("a.parquet", b"PAR1", "cannot be read as a .parquet file"),
        ("a.xlsx", b"", "is not a workbook of the format .xlsx; save it in this format, or as text"),
        ("a.xls", b"\xd0\xcf\x11\xe0" * 99, "is not a workbook of the format .xlsx; save it in this format"),
        ("a.bin", b"\0\1\2" * 99, r"is unknown; use a file that ends in .*\.mat, \.mcap, .*\.parquet"),
        ("a.bin", b"", "is unknown; use a file that ends in"),
    ],
)
def test_files_that_are_none_are_refused(tmp_path: Path, name: str, content: bytes, message: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(RecordError, match=message):
        read_records(tmp_path / name)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match=r"There is no data file .*nowhere\.csv"):
        read_records(tmp_path / "nowhere.csv")
    with pytest.raises(RecordError, match=r"nowhere\.toml cannot be read .*; give the path"):
        read_records(tmp_path / "nowhere.toml")


@pytest.mark.parametrize("size", [1e300, 1e60, 1e-60, 1e-300])
@pytest.mark.parametrize("column", ["t", "x", "u"])
def test_values_that_no_machine_has_are_refused(tmp_path: Path, column: str, size: float) -> None:
    """Their squares are no numbers."""
    values = {"t": T, "x": 1e3 * X, "u": F}
    values[column] = size * values[column] / np.abs(values[column]).max()
    rows = [",".join(values), *(",".join(f"{cell:.9g}" for cell in row) for row in zip(*values.values(), strict=True))]
    with pytest.raises(RecordError, match=r"which is implausible; correct the unit or the file"):
        read_records(write(tmp_path, "\n".join(rows)), tables("t", "x", "u"))


def refused(path: Path, message: str) -> None:
    with pytest.raises(RecordError, match=message):
        read_measurement(path, tables("t", "x", "force"))


def test_hdf5_links_are_not_followed(tmp_path: Path) -> None:
    """Groups that hold each other twice, 40 deep, and whatever would read another file."""
    with h5py.File(tmp_path / "other.mat", "w") as other:
        other["x"] = X
    with h5py.File(tmp_path / "deep.mat", "w") as file:
        file["t"], file["x"], file["force"] = T, X, F
        group = file.create_group("g")
        for _ in range(40):
            group["a"] = below = file.create_group(None)
            group["b"] = below
            group = below
    assert_is_the_axis(tmp_path / "deep.mat", tables("t", "x", "force"))
    for name in ("external", "soft", "virtual", "raw"):
        with h5py.File(tmp_path / f"{name}.mat", "w") as file:
            file["t"], file["force"] = T, F
            if name == "external":
                file["x"] = h5py.ExternalLink("other.mat", "/x")
            elif name == "soft":
                file["x"] = h5py.SoftLink("/force")
            elif name == "virtual":
                layout = h5py.VirtualLayout((len(X),), "f8")
                layout[:] = h5py.VirtualSource("other.mat", "x", (len(X),))
                file.create_virtual_dataset("x", layout)
            else:
                file.create_dataset("x", X.shape, "f8", external=[("other.mat", 0, 8 * len(X))])
        refused(tmp_path / f"{name}.mat", "x is (a link|stored in another file)")


def test_small_files_of_gigabytes_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Zeros that exceed the limit, which is lowered for the test: MATLAB, HDF5 in chunks, and Parquet."""
    monkeypatch.setattr(data_tables, "UNPACKED", 2**23)
    packed = zlib.compress(bytes(9 * 2**20), 9)
    header = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM"
    (tmp_path / "a.mat").write_bytes(header + struct.pack("<II", 15, len(packed)) + packed)
    with h5py.File(tmp_path / "b.mat", "w") as file:
        file.create_dataset("x", (2**21,), "f8", chunks=(2**18,), compression="gzip")
    pq.write_table(pa.table({"x": np.zeros(2**21)}), tmp_path / "c.parquet")
    for name in ("a.mat", "b.mat", "c.parquet"):
        assert (tmp_path / name).stat().st_size < 1e5
        refused(tmp_path / name, "unpacks to more than 8 MiB")


def test_integers_that_are_no_doubles_matter_in_a_column_that_is_used_only(tmp_path: Path) -> None:
    many = 2**53 + 1 + np.arange(len(T))
    pq.write_table(pa.table({"t": T, "x": X, "force": F, "id": many}), tmp_path / "a.parquet")
    assert_is_the_axis(tmp_path / "a.parquet", tables("t", "x", "force"))
    with pytest.raises(RecordError, match=r"not numeric: it contains integers above 2\^53"):
        read_measurement(tmp_path / "a.parquet", tables("t", "id", "force"))
