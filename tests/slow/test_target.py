"""Exported laws on an emulated Cortex-M: the numbers of this machine, and the cost that their README tells."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from codegen.test_numbers import LAWS, same_bits

from benchmarks.law_runs import LawC, rows_of
from friction_fmus.codegen import CORES, cost, export_law, measure
from friction_fmus.codegen.cost import assembly, run
from friction_fmus.codegen.export import make_export
from friction_fmus.codegen.program import samples

WARNINGS = ("-Wall", "-Wextra", "-Wconversion", "-Wpedantic", "-Wshadow", "-Werror")
pytestmark = pytest.mark.skipif(bool(cost.missing()), reason=f"{' and '.join(cost.missing())} not installed")

STRAIGHT = """
from casadi import SX
from friction_fmus.lawkit.law import *

@law("Straight", "No branch but the guard", source="none", Ts=1e-3, outputs={"u": Output(FORCE, "sum")})
def straight(
    x: SX = Input(LENGTH, 0.5, "displacement"),
    k: SX = Parameter(STIFFNESS, 5.0, "stiffness"),
    d: SX = Parameter(FORCE, 3.0, "offset"),
) -> dict[str, SX]:
    '''A line.'''
    return {"u": k * x + d}
"""


@pytest.mark.parametrize("core", CORES, ids=lambda core: core.name)
@pytest.mark.parametrize("real", ["float", "double"])
@pytest.mark.parametrize("name", LAWS)
def test_the_target_computes_the_same(name: str, real: str, core, tmp_path: Path) -> None:
    """Bit by bit, but for another C library's exp and pow."""
    export = make_export(name, real=real)
    given = samples(export, 200)
    found, stack = run(export, core, given)
    expected = LawC(export, tmp_path).run(rows_of(export, given), feeds_back=True)
    assert 0 < stack < 1000
    if export.kernel.functions:
        scale = np.maximum(np.abs(expected), np.sqrt(np.mean(expected**2, axis=0)))
        assert (np.abs(found - expected) <= (1e-5 if real == "float" else 1e-12) * scale).all()
    else:
        assert same_bits(found.astype(float), expected)


@pytest.mark.parametrize("name", LAWS)
def test_the_float_build_has_no_double_in_it(name: str) -> None:
    export = make_export(name, real="float")
    assert all(function.endswith("f") for function in export.kernel.functions)
    for core in CORES:
        text = assembly(export, core, *WARNINGS, "-Wdouble-promotion", "-Wfloat-conversion")
        assembly(export, core, *WARNINGS, "-std=c89")
        # __aeabi_dadd and the like, conversions from and to double, the double unit's registers
        assert not re.search(r"__aeabi_(d|f2d|cd|i2d|ui2d|l2d)|\.f64|_?_ieee754_(?!.*f\b)", text)
        called = set(re.findall(r"^\s+blx?\s+(\w+)", text, re.M))
        own = {f"{export.prefix}_{word}" for word in ("init", "check", "step")} | {"sample", "relations"}
        runtime = {name for name in called if name.startswith("__aeabi_")}
        assert called - runtime - own <= export.kernel.functions


def test_the_cost_of_a_law_is_in_its_readme(tmp_path: Path) -> None:
    """PID has 12 parameters, 3 states, 6 Real inputs, two of them pairs, 2 Boolean ones, 2 outputs and `fault`."""
    export_law("PID", tmp_path, real="float")
    text = (tmp_path / "README.md").read_text(encoding="utf-8")
    rows = {row[0]: int(row[1]) for row in re.findall(r"^\| ([a-zA-Z ,]+?)(?: \[bytes\])? \| (\d+) \|", text, re.M)}
    assert rows["RAM of an instance"] == 4 * (12 + 3 + (6 + 2) + 2 + 3)
    assert rows["RAM of the C library"] == 0
    assert rows["flash of the law"] == rows["flash with called functions"] <= 1000
    assert rows["stack of the law"] == rows["stack with called functions"]
    # at least the 22 floating-point operations and two instructions for each test of an input
    assert 22 + 2 * 6 <= rows["instructions per step, mean"] <= rows["instructions per step, largest"] <= 200
    double = measure(make_export("PID"), CORES[0])
    assert double.instance == 8 * (12 + 3 + 6 + 2) + 4 * 2 + 8
    # every operation of the double build is a call on a core with a single-precision unit
    assert double.mean is not None and double.mean > 5 * rows["instructions per step, mean"]


def test_instructions_are_counted_exactly(tmp_path: Path) -> None:
    """A law without branches: all instructions of the listing but those of the way on which an input is bad."""
    path = tmp_path / "straight.py"
    path.write_text(STRAIGHT, encoding="utf-8")
    export = make_export(path, real="float")
    found = measure(export, CORES[0])
    text = cost.assembly(export, CORES[0])
    body = text[text.index("law_step:") : text.index(".size\tlaw_step")]
    listed = [line.split()[0] for line in body.splitlines() if re.match(r"\t[a-z]", line)]
    # of a branch each way ends in its own return; a bad input leaves right behind the compare
    returns = [i for i, word in enumerate(listed) if word == "bx" or word.startswith("pop")]
    assert found.mean == found.most
    assert found.most in [i + 1 for i in returns] + [len(listed)], listed
