"""The cost that the README of an exported law tells."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from friction_fmus.codegen import CORES, Cost, cost, export_law, measure
from friction_fmus.codegen.export import make_export
from friction_fmus.codegen.readme import readme

on_target = pytest.mark.skipif(bool(cost.missing()), reason=f"{' and '.join(cost.missing())} not installed")

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


@on_target
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


@on_target
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


def test_a_readme_without_the_emulator_has_the_sizes() -> None:
    text = readme(make_export("PID"), [Cost(CORES[0], code=100, flash=200, instance=76, static=0, frame=16)])
    assert "| flash of the law [bytes] | 100 |" in text
    assert "| instructions per step" not in text
    line = (
        "Instructions were not counted, because qemu-arm is not installed; on Debian, run `apt-get install qemu-user`."
    )
    assert line in " ".join(text.split())
