"""Exported laws on an emulated Cortex-M: the numbers of this machine, and the cost that their README tells."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from codegen.test_loop import EXAMPLE
from codegen.test_numbers import LAWS, same_bits, same_numbers
from codegen.test_travel import STROKES, motion
from codegen.test_unit_test import without_fault
from thorough import nightly, some

from benchmarks.law_runs import LawC, rows_of, run_casadi
from friction_fmus.codegen import CORES, Core, emulation, export_law, measure
from friction_fmus.codegen.cost import DURATIONS, cycles_of
from friction_fmus.codegen.emulation import (
    CALLS,
    EMULATOR,
    M0PLUS,
    M4F,
    M7,
    RANDOM,
    call,
    compile_law,
    emulate,
    link_program,
    program,
    samples,
    trace,
)
from friction_fmus.codegen.law_export import ACCURACY, TRAVEL, make_export
from friction_fmus.codegen.layout import Export
from friction_fmus.codegen.unit_test import unit_test
from friction_fmus.codegen.vectors import EXACT as EXACT_FUNCTIONS
from friction_fmus.codegen.vectors import N, vectors
from friction_fmus.lawkit.law import Kind
from harness.storage.files import ScratchFolder

WARNINGS = ("-Wall", "-Wextra", "-Wconversion", "-Wpedantic", "-Wshadow", "-Werror")
UNITS = [*LAWS, str(EXAMPLE)]
TARGETS = some([*product(CORES, ("float", "double"))], [(M0PLUS, "double"), (M4F, "float"), (M7, "double")])


def assembly(export: Export, core: Core, *flags: str) -> str:
    """Return the assembly code of the law for a core, compiled with additional options."""
    with ScratchFolder() as scratch:
        folder = Path(scratch)
        compile_law(export, core, folder, "-S", "-o", "law.s", *flags)
        return (folder / "law.s").read_text(encoding="utf-8")


def run(export: Export, core: Core, given: Mapping[str, np.ndarray]) -> tuple[np.ndarray, int]:
    """Run the law for a core under QEMU."""
    with ScratchFolder() as scratch:
        folder = Path(scratch)
        compile_law(export, core, folder)
        link_program(export, core, folder, program(export, given))
        lines = emulate(folder).splitlines()
    kind = "<f4" if export.real.suffix else "<f8"
    rows = [[np.frombuffer(bytes.fromhex(word), kind)[0] for word in line.split()] for line in lines[:-1]]
    table = np.array(rows, dtype=float).reshape(len(rows), -1)
    found = table[:, : len(export.results)].copy()
    found[:, list(export.result_lows)] += table[:, len(export.results) :]
    return found, int.from_bytes(bytes.fromhex(lines[-1]), "little")


def on(targets: Sequence[tuple[Core, str]]) -> pytest.MarkDecorator:
    return pytest.mark.parametrize(("core", "real"), targets, ids=lambda each: getattr(each, "name", each))


pytestmark = pytest.mark.skipif(bool(emulation.missing()), reason=f"{' and '.join(emulation.missing())} not installed")

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


@on(TARGETS)
@pytest.mark.parametrize("name", some(UNITS, UNITS[::24]))
def test_the_target_computes_the_same(name: str, real: str, core: Core, tmp_path: Path) -> None:
    """Bit by bit, but for another C library's exp and pow."""
    export = make_export(name, real=real, prefix="law")
    given = samples(export, 200)
    found, stack = run(export, core, given)
    expected = LawC(export, tmp_path).run(rows_of(export, given), feeds_back=True)
    assert 0 < stack < 1000
    if export.kernel.functions:
        scale = np.maximum(np.abs(expected), np.sqrt(np.mean(expected**2, axis=0)))
        assert (np.abs(found - expected) <= (1e-5 if real == "float" else 1e-12) * scale).all()
    else:
        assert same_bits(found.astype(float), expected)


EXACT = """
[loop]
Ts = 1e-3
u_min = -100.0
u_max = 100.0
offset = 0.3
window = 3

[servo]
law = "CascadePPI"
parameters = { ki = 500.0, m = 1.0 }

[feedforward]
law = "CoulombFeedforward"

[compensator]
law = "PredictiveFilter"
"""
"""A loop that calls no function of the C library which rounds."""

FIVE = ("LuGreFeedforward", "GMSFeedforward", "ExtendedStateObserver", "PID", "KalmanFriction")


@on(some(TARGETS, TARGETS[-1:]))
@pytest.mark.parametrize("name", some([*FIVE, str(EXAMPLE), "exact"], [str(EXAMPLE)]))
def test_the_target_computes_the_same_over_the_travel(name: str, real: str, core: Core, tmp_path: Path) -> None:
    """Five laws and two loops at 0 to 10 m, against casadi in double: the same bits, or as the README of float says."""
    if name == "exact":
        name = str(tmp_path / "exact.toml")
        Path(name).write_text(EXACT, encoding="utf-8")
    export = make_export(name, real=real, prefix="law")
    inputs = export.groups["inputs"]
    outputs = len(export.law.select(Kind.OUTPUT))
    for offset in TRAVEL:
        signals = {column: values[:400] for column, values in motion(STROKES[0], offset).items()}
        start = {v.name: np.full(400, export.start[v.name][0]) for v in inputs}
        given = {**start, **{column: values for column, values in signals.items() if column in start}}
        found = run(export, core, given)[0][:, :outputs].astype(float)
        expected = run_casadi(export.law, rows_of(export, given))[:, :outputs]
        if real == "double" and not export.kernel.functions - EXACT_FUNCTIONS:
            assert same_numbers(found, expected)
            continue
        absolute = np.array([v.name in make_export(name, real="float").pairs for v in export.law.select(Kind.OUTPUT)])
        size = np.sqrt(np.mean((expected - offset * absolute) ** 2, axis=0))
        assert size.max() > 0.0
        assert (np.abs(found - expected) <= (ACCURACY if real == "float" else 1e-10) * size).all(), offset


@pytest.mark.parametrize("name", some(UNITS, UNITS[::8]))
def test_the_float_build_has_no_double_in_it(name: str) -> None:
    export = make_export(name, real="float", prefix="law")
    assert all(function.endswith("f") for function in export.kernel.functions)
    for core in CORES:
        text = assembly(export, core, *WARNINGS, "-Wdouble-promotion", "-Wfloat-conversion")
        # __aeabi_dadd and the like, conversions from and to double, the double unit's registers
        assert not re.search(r"__aeabi_(d|f2d|cd|i2d|ui2d|l2d)|\.f64|_?_ieee754_(?!.*f\b)", text)
        called = set(re.findall(r"^\s+blx?\s+(\w+)", text, re.M))
        own = {f"{export.prefix}_{word}" for word in ("init", "check", "step")} | {"sample", "relations"}
        runtime = {name for name in called if name.startswith("__aeabi_") or name == "memset"}  # of a loop
        assert called - runtime - own <= export.kernel.functions


UNIT_TEST = """
#include "law_test.c"
void start(void);
void start(void) { linux(1, law_test(), 0, 0); }
"""


def result_on_target(export, core: Core, folder: Path) -> int:
    """What the unit test of a law returns on a core."""
    (folder / "law_test.c").write_text(unit_test(export, vectors(export)), encoding="utf-8")
    link_program(export, core, folder, CALLS + UNIT_TEST)
    return subprocess.run([EMULATOR, "-cpu", "max", "./program"], cwd=folder, check=False).returncode


@on(some(TARGETS, TARGETS[:2]))
@pytest.mark.parametrize("name", some(UNITS, UNITS[::32]))
def test_the_unit_test_passes_on_the_target(name: str, real: str, core: Core, tmp_path: Path) -> None:
    """And its instructions can be counted."""
    export = make_export(name, real=real, prefix="law")
    compile_law(export, core, tmp_path)
    assert result_on_target(export, core, tmp_path) == 0
    found = trace(export, core, tmp_path)
    assert len(found.counts) == RANDOM + N
    assert min(found.counts) > 10
    cycles = cycles_of(found, core)
    assert cycles is None or all(count < cycle for count, cycle in zip(found.counts, cycles, strict=True))


def test_the_unit_test_fails_on_the_target(tmp_path: Path) -> None:
    """A law with another gain, and one that never sets `fault`."""
    export = make_export("PID", real="float")
    compile_law(make_export("PID", real="float", start={"Kp": 12001.0}), M4F, tmp_path)
    assert 0 < result_on_target(export, M4F, tmp_path) <= N
    (tmp_path / "law.c").write_text(without_fault(export), encoding="utf-8")
    call(tmp_path, emulation.COMPILER, *M4F.flags, *emulation.FLAGS, "-c", "law.c")
    assert result_on_target(export, M4F, tmp_path) == N + 1


COLUMNS = {core.name: i for i, core in enumerate(CORES)}


def table(text: str, core: str) -> dict[str, int]:
    """The column of a core in the table of a README."""
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in text.splitlines() if line.startswith("| ")]
    cells = {row[0].split(" [")[0]: row[1 + COLUMNS[core]] for row in rows[1:]}
    return {title: int(cell) for title, cell in cells.items() if cell}


def test_the_cost_of_a_law_is_in_its_readme(tmp_path: Path) -> None:
    """PID has 12 parameters, 2 states and a flag, 7 Real inputs, two of them pairs, 3 Boolean ones, 2 outputs, `fault`.

    In float the integral is a pair, too. All Booleans of a struct are in one word.
    """
    export_law("PID", tmp_path, real="float")
    text = (tmp_path / "README.md").read_text(encoding="utf-8")
    for core in ("Cortex-M4F", "Cortex-M7"):
        rows = table(text, core)
        assert rows["RAM of an instance"] == 4 * (12 + (2 + 1 + 1) + (7 + 2 + 1) + (2 + 1))
        assert rows["RAM of the C library"] == 0
        assert rows["flash of the law"] == rows["flash with called functions"] <= 1000
        assert rows["stack of the law"] == rows["stack with called functions"]
        # at least the 22 floating-point operations and two instructions for each test of an input
        mean, most = (rows[f"instructions per step, {word}"] for word in ("mean", "longest path seen"))
        assert 22 + 2 * 6 <= mean <= most <= 200
        assert 90 <= rows["executed part of the law"] <= 100
    rows = table(text, "Cortex-M4F")
    assert mean < rows["cycles per step, mean"] < rows["cycles per step, longest path seen"]
    assert "cycles per step, mean" not in table(text, "Cortex-M7")
    soft = table(text, "Cortex-M0+")
    assert soft["instructions per step, mean"] > 10 * rows["instructions per step, mean"]
    assert soft["stack with called functions"] > soft["stack of the law"]
    double = measure(make_export("PID"), M4F)
    assert double.instance == 8 * (12 + (2 + 1) + (7 + 1) + (2 + 1))
    # every operation of the double build is a call on a core with a single-precision unit
    assert double.instructions is not None
    assert double.instructions.mean > 5 * rows["instructions per step, mean"]


def test_instructions_are_counted_exactly(tmp_path: Path) -> None:
    """A law without branches: all instructions of the listing but those of the way on which an input is bad."""
    path = tmp_path / "straight.py"
    path.write_text(STRAIGHT, encoding="utf-8")
    export = make_export(path, real="float")
    found = measure(export, M4F).instructions
    assert found is not None
    text = assembly(export, M4F)
    body = text[text.index("law_step:") : text.index(".size\tlaw_step")]
    listed = [line.split()[0] for line in body.splitlines() if re.match(r"\t[a-z]", line)]
    # of a branch each way ends in its own return; a bad input or result is left behind the last compare, or at the end
    returns = [i for i, word in enumerate(listed) if word == "bx" or word.startswith("pop")]
    last = max(i for i, word in enumerate(listed[: returns[-1]]) if word[0] == "b" and word != "bx")
    assert found.mean == found.most
    assert found.most in [returns[0] + 1, len(listed), len(listed) - (returns[0] - last)], listed


@nightly
@pytest.mark.parametrize("core", CORES, ids=lambda core: core.name)
def test_blocks_have_the_instructions_of_single_steps(core: Core, tmp_path: Path) -> None:
    """QEMU logs one instruction a line if it translates them one by one."""
    export = make_export("LuGreFeedforward")
    compile_law(export, core, tmp_path)
    found = trace(export, core, tmp_path)
    single = "-one-insn-per-tb" if "one-insn-per-tb" in call(tmp_path, EMULATOR, "--help") else "-singlestep"
    emulate(tmp_path, single, "-d", "exec,nochain", "-D", "single")
    lines = (tmp_path / "single").read_text(encoding="utf-8").splitlines()
    addresses = [int(match[1], 16) for line in lines if (match := re.search(r"\[[0-9a-f]+/([0-9a-f]+)/", line))]
    entry = next(address for address, at in found.code.items() if at.function == "law_step")
    steps = [[address for i in step for address in found.blocks[i]] for step in found.steps]
    begins = [i for i, address in enumerate(addresses) if address == entry]
    assert len(begins) == len(steps)
    for begin, step in zip(begins, steps, strict=True):
        assert addresses[begin : begin + len(step)] == step
        assert addresses[begin + len(step)] == addresses[begin - 1] + 4  # behind the call


@pytest.mark.parametrize(
    ("core", "text", "cycles"),
    [
        (M4F, "vdiv.f32\ts15, s14, s15", 14),
        (M4F, "ldr.w\tr3, [r0, #4]", 2),
        (M4F, "push\t{r4, r5, lr}", 4),
        (M4F, "vpop\t{s16-s19}", 5),
        (M4F, "adds\tr0, #1", 1),
        (M0PLUS, "ldr\tr3, [r0, #4]", 2),
        (M0PLUS, "muls\tr3, r0", 1),
        (M0PLUS, "push\t{r4, r5, lr}", 4),
        (M0PLUS, "b.n\t8000", 1),
        (M0PLUS, "bl\t8000 <f>", 2),
        (M0PLUS, "bx\tlr", 1),
        (M0PLUS, "pop\t{r4, pc}", 4),
    ],
)
def test_durations_are_those_of_the_manuals(core: Core, text: str, cycles: int) -> None:
    """Without a taken branch, 2 cycles on the M4F, 1 on the M0+: B takes 2 there, BL 3, and POP of the PC 3 + N."""
    assert DURATIONS[core].of(text) == cycles
