"""The functions that a module has in place of the C library's, compiled for this machine."""

from __future__ import annotations

import ctypes
import math
import random
import subprocess
from pathlib import Path

import pytest

from harness.compiling.toolchain import compiler

FOLDER = Path(__file__).parents[2] / "fmu_src" / "wasm"


@pytest.fixture(scope="module")
def functions(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    library = tmp_path_factory.mktemp("functions") / "functions.so"
    names = [f"-D{name}=wasm_{name}" for name in ("snprintf", "vsnprintf")]
    files = [str(FOLDER / name) for name in ("functions.c", "print.c")]
    subprocess.run([*compiler(), "-shared", "-fPIC", "-O1", *names, *files, "-lm", "-o", str(library)], check=True)
    loaded = ctypes.CDLL(str(library))
    for name in ("wasm_log", "wasm_exp2"):
        getattr(loaded, name).restype = ctypes.c_double
        getattr(loaded, name).argtypes = (ctypes.c_double,)
    return loaded


def test_the_logarithm_is_right_to_the_last_bits(functions: ctypes.CDLL) -> None:
    drawn = random.Random(1)
    values = [math.ldexp(drawn.uniform(0.5, 1.0), drawn.randint(-1073, 1024)) for _ in range(2000)]
    values += [math.sqrt(0.5), math.nextafter(math.sqrt(0.5), 0.0), 1.0, 5e-324, *(1.0 + s * 1e-9 for s in (-1, 1))]
    for x in values:
        assert functions.wasm_log(x) == pytest.approx(math.log(x), rel=4.5e-16, abs=1e-30), x
    assert functions.wasm_log(0.0) == -math.inf
    assert functions.wasm_log(math.inf) == math.inf
    assert math.isnan(functions.wasm_log(-1.0))
    assert math.isnan(functions.wasm_log(math.nan))


def test_powers_of_two(functions: ctypes.CDLL) -> None:
    for x in (-1075.5, -1074.0, -3.0, -0.5, 0.0, 0.3, 1.0, 10.0, 1023.5):
        assert functions.wasm_exp2(x) == pytest.approx(2.0**x, rel=2.3e-16)
    assert functions.wasm_exp2(1024.0) == math.inf


def test_numbers_are_printed_with_all_digits_that_are_asked_for(functions: ctypes.CDLL) -> None:
    """As Python does it; among them ties, which are rounded to an even digit, and carries."""
    drawn = random.Random(2)
    values = [math.ldexp(drawn.uniform(0.5, 1.0), drawn.randint(-1073, 1024)) for _ in range(100)]
    values += [
        0.125,
        0.375,
        2.5,
        3.5,
        2.5000001,
        25.0,
        0.99996,
        9.9999999e22,
        1e-5,
        12345678.0,
        1e15,
        -7.25,
        0.0,
        5e-324,
    ]
    text = ctypes.create_string_buffer(1200)
    for x in values:
        for precision in (1, 2, 3, 6, 17, 800):
            length = functions.wasm_snprintf(text, 1200, f"%.{precision}g".encode(), ctypes.c_double(x))
            assert (text.value.decode(), length) == (f"{x:.{precision}g}", len(text.value))


@pytest.mark.parametrize(
    ("form", "value", "text"), [("%d", -12, "-12"), ("%3d|", 7, "  7|"), ("%03u", 12, "012"), ("%x", 0xBEEF, "beef")]
)
def test_whole_numbers_are_printed(functions: ctypes.CDLL, form: str, value: int, text: str) -> None:
    room = ctypes.create_string_buffer(20)
    assert functions.wasm_snprintf(room, 20, form.encode(), value) == len(text)
    assert room.value.decode() == text
    assert functions.wasm_snprintf(room, 2, form.encode(), value) == len(text)
    assert room.value.decode() == text[:1]
