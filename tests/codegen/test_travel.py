"""Single precision far from zero: a law computes the same on the same motion wherever the axis stands."""

from __future__ import annotations

import ctypes
import math
import re
import sys
from fractions import Fraction
from itertools import product
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from casadi import SX, Function, sqrt
from thorough import some

sys.path.insert(0, str(Path(__file__).parents[2]))

from benchmarks.law_runs import LawC, compile_, rows_of
from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.codegen.law_export import ACCURACY, TRAVEL, make_export, readme
from friction_fmus.lawkit.emit.operations import graph
from friction_fmus.lawkit.law import Kind, discover_laws
from friction_fmus.lawkit.parts.expressions import stribeck_level

N = 4_000
Ts = 1e-3
STROKES = (25e-6, 5e-3)
LAWS = discover_laws(laws_folder())
WITH_POSITION = [law.name for law in LAWS if {"r", "x"} & {v.name for v in law.select(Kind.INPUT, Kind.OPTIONAL)}]


def motion(stroke: float, offset: float) -> dict[str, np.ndarray]:
    """Two sines about an offset, followed with a lag and 1 nm of noise; the derivatives are exact."""
    t = Ts * np.arange(N)
    slow, fast = 2.0 * np.pi * 0.7, 2.0 * np.pi * 3.1
    r = stroke * (np.sin(slow * t) + 0.3 * np.sin(fast * t))
    rd = stroke * (slow * np.cos(slow * t) + 0.3 * fast * np.cos(fast * t))
    rdd = -stroke * (slow**2 * np.sin(slow * t) + 0.3 * fast**2 * np.sin(fast * t))
    lag = 0.02 * stroke * np.sin(slow * t - 0.4) + 1e-9 * np.random.default_rng(1).normal(size=N)
    return {"r": offset + r, "rd": rd, "rdd": rdd, "x": offset + r - lag, "v": 0.98 * rd, "u_prev": 0.1 * rdd}


START: dict[str, dict[str, float]] = {
    "DiscreteInverse": {"a[1]": -1.9, "a[2]": 0.9},
    "InverseDynamics": {"compliance": 1e-4},
    "LuGreObserver": {"k": 50.0},
    "GMSObserver": {"k_e": 50.0},
    "TustinFeedback": {"x0": 0.0071} | {f"cogging[{i + 1}]": float(np.sin(np.pi * i / 8.0)) for i in range(16)},
}
"""Parameters with which the position counts, and which a float does not hold."""


def outputs(name: str, real: Literal["double", "float"], folder: Path) -> dict[tuple[float, float], np.ndarray]:
    """Outputs of a run with the states fed back, by stroke and offset; those that are positions without the offset."""
    export = make_export(name, real=real, start=START.get(name))
    law = LawC(export, folder / real)
    inputs = {v.name for v in export.law.select(Kind.INPUT, Kind.OPTIONAL)}
    shown = [v for v in export.law.results if v.kind is Kind.OUTPUT]
    absolute = np.array([v.name in make_export(name, real="float").pairs for v in shown])
    found = {}
    for stroke, offset in product(STROKES, TRAVEL):
        given = {name: column for name, column in motion(stroke, offset).items() if name in inputs}
        results = law.run(rows_of(export, given), feeds_back=True)
        found[stroke, offset] = results[:, : len(shown)] - offset * absolute
    return found


@pytest.mark.parametrize("name", some(WITH_POSITION, [*WITH_POSITION[::16], "LoadFeedforward"]))
def test_float_is_double_over_the_travel(name: str, tmp_path: Path) -> None:
    expected, found = outputs(name, "double", tmp_path), outputs(name, "float", tmp_path)
    for case, results in expected.items():
        size = np.sqrt(np.mean(results**2, axis=0))
        assert size.max() > 0.0
        assert (np.abs(found[case] - results) <= ACCURACY * size).all(), case


@pytest.mark.parametrize("name", [law.name for law in LAWS])
def test_no_law_rounds_an_absolute_position(name: str) -> None:
    assert make_export(name, real="float").rounded == ()


ROUNDS = """
from casadi import SX, sin
from friction_fmus.lawkit.law import *

@law("Rounds", "Sine of the position", source="none", Ts=1e-3, outputs={"u": Output(FORCE, "force")})
def rounds(x: SX = Input(LENGTH, 0.5, "position"), k: SX = Parameter("1/m", 5.0, "wave number")) -> dict[str, SX]:
    '''A sine.'''
    return {"u": sin(k * x)}
"""


def test_the_readme_says_what_rounds_a_position(tmp_path: Path) -> None:
    path = tmp_path / "rounds.py"
    path.write_text(ROUNDS, encoding="utf-8")
    text = readme(make_export(path, real="float"), ())
    assert "This law rounds an absolute position to one float before it calls sinf." in " ".join(text.split())


def test_the_readme_says_how_a_position_is_given(tmp_path: Path) -> None:
    """Its two pieces of C: from a double to 2^-48 of the position, from a count to 1/2000 of it, by exact fractions."""
    text = readme(make_export("LuGreFeedforward", real="float"), ())
    assert "around 0, 0.1, 1 and 10 m" in text
    assert "less than 0.0001 of their rms value" in " ".join(text.split())
    assert "inputs: `r`. " in " ".join(text.split())
    pieces = re.findall(r"```c\n(.*?)```", text.split("## Start")[0], re.S)
    arguments = ("double position", "long n, float q")
    functions = "".join(
        f"void f{i}({given}, float *pair) {{ struct {{ float r, r_low; }} inputs;\n{piece}"
        "pair[0] = inputs.r; pair[1] = inputs.r_low; }\n"
        for i, (given, piece) in enumerate(zip(arguments, pieces, strict=True))
    )
    source = tmp_path / "pairs.c"
    source.write_text(f"#include <math.h>\n{functions}", encoding="utf-8")
    library = compile_(source)
    pair = (ctypes.c_float * 2)()
    random, q = np.random.default_rng(3), np.float32(1e-8)
    for position in 10.0 * random.uniform(-1.0, 1.0, 1000):
        library.f0(ctypes.c_double(position), pair)
        assert abs(pair[0] + pair[1] - position) <= 2.0**-48 * abs(position)
    for n in map(int, random.integers(-(2**31), 2**31, 1000)):
        library.f1(ctypes.c_long(n), ctypes.c_float(float(q)), pair)
        exact = n * Fraction(float(q))
        assert abs(Fraction(pair[0]) + Fraction(pair[1]) - exact) <= Fraction(float(q)) / 2000


def test_a_law_without_a_position_says_so() -> None:
    assert "No input is a position" in readme(make_export("StaticFeedforward", real="float"), ())
    assert "osition" not in readme(make_export("PID"), ()).split("## Cost")[0].split("C99")[1]


@pytest.mark.parametrize("name", [law.name for law in LAWS])
def test_limits_of_an_exponent_hold_in_float(name: str) -> None:
    """What is compared with an argument of exp or expm1 is within the range of float: ln(3.4e38) = 88.7."""
    nodes, _ = graph(make_export(name).law.function)

    def without_sign(number: int) -> int:
        return nodes[number].arguments[0] if nodes[number].operation == "NEG" else number

    exponents = {without_sign(node.arguments[0]) for node in nodes if node.operation in ("EXP", "EXPM1")}
    chosen = {a for i in exponents if nodes[i].operation in ("SELECT", "ADD") for a in nodes[i].arguments}
    chosen |= {a for i in chosen if nodes[i].operation == "IF_ELSE_ZERO" for a in nodes[i].arguments}
    for node in nodes:
        if node.operation in ("LT", "LE"):
            for one, two in (node.arguments, node.arguments[::-1]):
                if without_sign(one) in exponents | chosen and nodes[two].operation == "CONST":
                    assert abs(nodes[two].value) <= math.log(np.finfo(np.float32).max)


def test_the_stribeck_curve_ends_before_float_underflows() -> None:
    """exp(-87) is the last whole exponent whose value is a normal float: 1.6e-38 against 1.2e-38."""
    smallest = float(np.finfo(np.float32).tiny)
    power = SX.sym("power")
    curve = Function("curve", [power], [stribeck_level(sqrt(power), SX(0.0), SX(1.0), SX(1.0), SX(2.0))])
    values = np.array([float(curve(p)) for p in np.linspace(80.0, 110.0, 3001)])
    assert ((values == 0.0) | (values >= smallest)).all()
    assert float(curve(86.0)) == pytest.approx(math.exp(-86.0), rel=1e-12)
