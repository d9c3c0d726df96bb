"""Whatever stands where a unit should be is answered at once: unit texts are not evaluated."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from time import process_time

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyarrow import parquet
from thorough import THOROUGH, few, nightly

from friction_fmus.errors import FrictionError
from friction_fmus.fmi.model_description import base_unit
from friction_fmus.identification import RecordError, read_measurement
from friction_fmus.identification.data.record import parse_quantity, unit_of
from harness import BaseUnit

ROOT = Path(__file__).parents[2]

HOSTILE = [
    "9**9**9**9*N",
    "N**9**9**9**9",
    "N*9**9**9**9",
    "(9)**9**9**9",
    "2**(9**(9**9))*m",
    "km^99^99^99",
    "((km**99)**99)**99",
    "cubic km**99**99",
    "square square square square km99",
    "m²²²²²²²",
    "m" * 1_000_000,
    "m." * 500_000 + "m",
    "(" * 1_000_000,
    "m" + "9" * 1_000_000,
    "1" * 1_000_000,
    "m**(1/2)",
    "1e-3 m",
    "Gm99",
    "1/Gm99",
    "nm99.nm99.nm99.nm99",
    "N/0",
    "__import__('os')",
    "N\0m",
    "\ud800",
]

KNOWN = {
    # independent: CODATA and the definitions of the units
    "rpm": ((0, 0, -1, 0, 0, 0, 0, 1), 2.0 * np.pi / 60.0),
    "inch": ((0, 1, 0, 0, 0, 0, 0, 0), 0.0254),
    "lbf": ((1, 1, -2, 0, 0, 0, 0, 0), 0.45359237 * 9.80665),
    "lbf.inch": ((1, 2, -2, 0, 0, 0, 0, 0), 0.45359237 * 9.80665 * 0.0254),
    "kgf.m": ((1, 2, -2, 0, 0, 0, 0, 0), 9.80665),
    "°/s": ((0, 0, -1, 0, 0, 0, 0, 1), np.pi / 180.0),
    "N m": ((1, 2, -2, 0, 0, 0, 0, 0), 1.0),
    "newton meter": ((1, 2, -2, 0, 0, 0, 0, 0), 1.0),
    "meter per second": ((0, 1, -1, 0, 0, 0, 0, 0), 1.0),
    "square meter": ((0, 2, 0, 0, 0, 0, 0, 0), 1.0),
    "kg.m²": ((1, 2, 0, 0, 0, 0, 0, 0), 1.0),
    "N/(m/s)**2": ((1, -1, 0, 0, 0, 0, 0, 0), 1.0),
    "m s^-2": ((0, 1, -2, 0, 0, 0, 0, 0), 1.0),
    "mm/s^2": ((0, 1, -2, 0, 0, 0, 0, 0), 1e-3),
    "kΩ": ((1, 2, -3, -2, 0, 0, 0, 0), 1e3),
}


@pytest.mark.parametrize("text", HOSTILE, ids=lambda text: ascii(text[:20]))
def test_no_unit_is_not_evaluated(text: str) -> None:
    start = process_time()
    assert unit_of(text) is None
    with pytest.raises(FrictionError, match="is unknown") as refused:
        base_unit(text)
    with pytest.raises(RecordError, match="not a number with a known unit") as no_number:
        parse_quantity(f"1.5 {text}", "The gain")
    assert not THOROUGH or process_time() - start < 1.0
    assert max(len(str(refused.value)), len(str(no_number.value))) < 1000


@pytest.mark.parametrize(
    "number", ["1" * 1_000_000 + "\n", "1." + "0" * 1_000_000 + "\n", "1e999 N", "1e-999 N", "nan N"]
)
def test_no_number_is_read_for_ever(number: str) -> None:
    start = process_time()
    with pytest.raises(RecordError, match="not a number with a known unit"):
        parse_quantity(number, "The gain")
    assert not THOROUGH or process_time() - start < 1.0


@pytest.mark.parametrize("text", KNOWN)
def test_units_of_everyday_are_known(text: str) -> None:
    exponents, factor = KNOWN[text]
    unit = unit_of(text)
    assert unit is not None
    assert unit.agrees(BaseUnit(exponents, factor))


@settings(max_examples=few(300), deadline=5000, derandomize=True)
@given(st.text(st.sampled_from("mskgN19./*^·²⁻()- °%e_Å") | st.characters(), max_size=120))
def test_any_text_is_answered(text: str) -> None:
    unit = unit_of(text)
    assert unit is None or 0.0 < unit.factor < float("inf")


def heading(folder: Path, unit: str) -> Path:
    path = folder / "log.csv"
    path.write_text(f"time [s],position [mm],force [{unit}]\n0,0,0\n0.1,1,2\n0.2,2,1\n", encoding="utf-8")
    return path


def row_of_units(folder: Path, unit: str) -> Path:
    path = folder / "log.csv"
    path.write_text(f"time,position,force\ns,mm,{unit}\n0,0,0\n0.1,1,2\n0.2,2,1\n", encoding="utf-8")
    return path


def field(folder: Path, unit: str) -> Path:
    path = folder / "log.parquet"
    units = {"time": "s", "position": "mm", "force": unit}
    fields = [pa.field(name, pa.float64(), metadata={"units": text}) for name, text in units.items()]
    columns = [pa.array([0.0, 1.0, 2.0])] * 3
    parquet.write_table(pa.Table.from_arrays(columns, schema=pa.schema(fields)), path)
    return path


def _mapped(folder: Path, force: str, time: str = 'column = "t", unit = "s"') -> Path:
    (folder / "log.csv").write_text("t,x,f\n0,0,0\n0.1,1,2\n0.2,2,1\n", encoding="utf-8")
    path = folder / "log.toml"
    position = 'position = { column = "x", unit = "mm" }'
    columns = f"time = {{ {time} }}\n{position}\nforce = {{ {force} }}\n"
    path.write_text(f'[data]\nfile = "log.csv"\n[columns]\n{columns}', encoding="utf-8")
    return path


def mapped_unit(folder: Path, unit: str) -> Path:
    return _mapped(folder, f'column = "f", unit = "{unit}"')


def mapped_gain(folder: Path, unit: str) -> Path:
    return _mapped(folder, f'column = "f", unit = "V", gain = "2.5 {unit}"')


def mapped_period(folder: Path, unit: str) -> Path:
    return _mapped(folder, 'column = "f", unit = "N"', f'period = "1 {unit}"')


@pytest.mark.parametrize("text", ["9**9**9**9*N", "N." * 50_000 + "N"], ids=["power", "long"])
@pytest.mark.parametrize("write", [heading, row_of_units, field, mapped_unit, mapped_gain, mapped_period])
def test_a_file_with_no_unit_is_refused_at_once(tmp_path: Path, write: Callable[[Path, str], Path], text: str) -> None:
    start = process_time()
    with pytest.raises(RecordError):
        read_measurement(write(tmp_path, text))
    assert not THOROUGH or process_time() - start < 5.0


@nightly
def test_the_command_refuses_it(tmp_path: Path) -> None:
    options = ["--model", "LuGre", "-o", "out", str(heading(tmp_path, "9**9**9**9*N"))]
    command = [sys.executable, "-m", "friction_fmus", "identify", *options]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, capture_output=True, text=True, timeout=100, env=environment, cwd=tmp_path)
    assert done.returncode == 2
    assert "9**9**9**9*N" in done.stdout + done.stderr
    assert "Traceback" not in done.stderr


def test_a_mil_is_a_thousandth_of_an_inch() -> None:
    """Not the angle of that name."""
    unit = unit_of("mil")
    assert unit is not None
    assert unit.factor == pytest.approx(25.4e-6, rel=1e-12)
    assert unit.exponents == parse_quantity("1 m", "")[1].exponents
