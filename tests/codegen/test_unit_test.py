"""The unit test that belongs to an exported law: it passes for the law, and fails for a law with one change."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from thorough import landing, nightly, some

sys.path.insert(0, str(Path(__file__).parents[2]))

from benchmarks.law_runs import compile_
from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.codegen.law_export import make_export
from friction_fmus.codegen.layout import Export
from friction_fmus.codegen.sources import header, implementation
from friction_fmus.codegen.unit_test import unit_test
from friction_fmus.codegen.vectors import N, vectors
from friction_fmus.errors import FrictionError
from friction_fmus.lawkit.declarations import PARAMETERS
from friction_fmus.lawkit.law import BOOLEANS, discover_laws
from harness.compiling import toolchain

LAWS = [law.name for law in discover_laws(laws_folder())]
VARIED = ("PID", "LuGreFeedforward", "KalmanFriction", "AdaptiveLuGre", "TustinFeedback", "Prefilter")
"""A controller, a feedforward law, an observer, an adaptive law, a law with a table, and one whose output is a pair."""
LOOP = str(Path(__file__).parents[2] / "examples" / "loop.toml")
REALS: tuple[Literal["double", "float"], ...] = ("double", "float")
WARNINGS = ("-Wall", "-Wextra", "-Wconversion", "-Wpedantic", "-Wshadow", "-Werror")


def write(export: Export, folder: Path, law: str = "") -> None:
    """The three files; the law may be another text."""
    (folder / "law.h").write_text(header(export), encoding="utf-8")
    (folder / "law.c").write_text(law or implementation(export), encoding="utf-8")
    (folder / "law_test.c").write_text(unit_test(export, vectors(export)), encoding="utf-8")


def status(folder: Path, *flags: str, test: Sequence[str] = ()) -> int:
    """Compile both files, the test by another command if one is given, and return what the test returns."""
    compiler = [*toolchain.compiler(), "-std=c99", "-O1", *WARNINGS, *flags]
    subprocess.run([*compiler, "-c", "law.c"], cwd=folder, check=True)
    subprocess.run([*(test or compiler), "-DLAW_TEST_MAIN", "-c", "law_test.c"], cwd=folder, check=True)
    subprocess.run([*compiler, "law.o", "law_test.o", "-o", "program", "-lm"], cwd=folder, check=True)
    return subprocess.run([folder / "program"], check=False).returncode


def without_fault(export: Export) -> str:
    """The law, but `fault` is always 0."""
    return implementation(export).replace("law_step(", "guarded_step(") + (
        "void law_step(const law_parameters *p, law_states *s, const law_inputs *i, law_outputs *o)\n"
        "{ guarded_step(p, s, i, o); o->fault = 0; }\n"
    )


def check_passes(name: str, folder: Path, *flags: str) -> None:
    for real in REALS:
        write(make_export(name, real=real, prefix="law"), folder)
        assert status(folder, "-O2", *flags) == 0, real


@landing
@pytest.mark.parametrize("name", some([*VARIED, LOOP], [LOOP]))
def test_the_law_passes(name: str, tmp_path: Path) -> None:
    check_passes(name, tmp_path)


OTHER_STARTS: list[tuple[str, dict[str, float]]] = [
    ("LuGreFeedforward", {"Ts": 1e-4}),
    ("PID", {"u_min": 0.0, "u_max": 300.0}),
    ("LuGreFeedforward", {"u_min": 0.0, "u_max": 300.0}),
    ("ExtendedStateObserver", {"Ts": 0.01}),
]


@pytest.mark.parametrize(("name", "start"), some(OTHER_STARTS, OTHER_STARTS[:1]))
def test_right_code_in_float_passes_with_other_start_values(name: str, start: dict[str, float], tmp_path: Path) -> None:
    """With and without contraction of products and sums."""
    export = make_export(name, real="float", start=start)
    write(export, tmp_path)
    compiler = ["gcc", "-std=c99", "-O2", "-DLAW_TEST_MAIN", "law.c", "law_test.c", "-lm", "-o", "program"]
    for contract in ("off", "fast"):
        subprocess.run([*compiler, f"-ffp-contract={contract}", "-mfma"], cwd=tmp_path, check=True)
        assert subprocess.run([tmp_path / "program"], check=False).returncode == 0, contract


@nightly
@pytest.mark.skipif(not shutil.which("g++"), reason="g++ not installed")
@pytest.mark.parametrize("name", some(VARIED[:3], VARIED[:1]))
def test_the_law_passes_a_test_in_cpp(name: str, tmp_path: Path) -> None:
    """Only the test is compiled as C++."""
    for real in REALS:
        write(make_export(name, real=real), tmp_path)
        assert status(tmp_path, test=("g++", "-x", "c++", "-std=c++11", *WARNINGS)) == 0


@landing
@pytest.mark.parametrize(("name", "real"), list(product(some(VARIED, VARIED[:1]), REALS)))
def test_every_parameter_but_those_that_the_test_names_is_tested(name: str, real: str, tmp_path: Path) -> None:
    """A change by 1 %, or from 0 to 0.01, or of a switch, as the header says."""
    export = make_export(name, real="double" if real == "double" else "float")
    write(export, tmp_path)
    changes = []
    parameters = export.law.select(*PARAMETERS)
    for number, variable in enumerate(parameters):
        for place in export.places(variable):
            value = place.replace("parameters->", "p->")
            new = f"!{value}" if variable.kind in BOOLEANS else f"{value} == 0 ? TYPE(0.01) : TYPE(1.01) * {value}"
            changes.append(f"    if (changed == {number}) {value} = {new};")
        changes += [f"    if (changed == {number}) p->{variable.name}_low *= 1.01f;"] * (variable.name in export.pairs)
    text = "\n".join(
        [
            f"#define TYPE(x) (({real})(x))",
            '#include "law.h"',
            "#define law_init start",
            "void law_init(law_parameters *p, law_states *s, law_inputs *i, law_outputs *o);",
            '#include "law.c"',
            "#undef law_init",
            "static int changed;",
            "void law_init(law_parameters *p, law_states *s, law_inputs *i, law_outputs *o)",
            "{",
            "    start(p, s, i, o);",
            *changes,
            "}",
            '#include "law_test.c"',
            "int tested(int number);",
            "int tested(int number) { changed = number; return law_test(); }",
        ]
    )
    (tmp_path / "changed.c").write_text(text, encoding="utf-8")
    library = compile_(tmp_path / "changed.c")
    assert library.tested(-1) == 0
    passed = {variable.name for i, variable in enumerate(parameters) if library.tested(i) == 0}
    assert passed == set(vectors(export).untested)


CONNECTIONS = ["- states->last_feedforward", "+ parameters->offset", "states->u_last = "]


@landing
@pytest.mark.parametrize("real", some(REALS, REALS[:1]))
@pytest.mark.parametrize("text", some(CONNECTIONS, CONNECTIONS[:1]))
def test_a_wrong_connection_of_a_loop_fails(text: str, real: Literal["double", "float"], tmp_path: Path) -> None:
    export = make_export(LOOP, real=real, prefix="law", start={"offset": 3.0})
    code = implementation(export)
    begin, end = code.index("static void sample"), code.index("\n}\n", code.index("static void sample"))
    assert text in code[begin:end]
    wrong = code[begin:end].replace(text, "/* states->u_last = */ (void)" if text.endswith("= ") else "")
    write(export, tmp_path, code[:begin] + wrong + code[end:])
    assert 0 < status(tmp_path, "-O1", "-Wno-unused-value") <= N


@pytest.mark.parametrize(
    ("name", "real"), list(product(("KalmanFriction", "ImplicitSuperTwisting"), some(REALS, REALS[:1])))
)
def test_every_changed_constant_fails(name: str, real: Literal["double", "float"], tmp_path: Path) -> None:
    """Each number in the equations but 0 and 1, changed by 1 %."""
    export = make_export(name, real=real)
    text = implementation(export)
    first, last = text.index("static void sample"), text.index("void law_init")
    places = re.compile(r"(?<![\w.])\d+\.\d+(?:e-?\d+)?f?")
    old = [number for number in places.findall(text[first:last]) if float(number.rstrip("f")) not in (0.0, 1.0)]
    assert len(old) >= 2
    numbers = iter(range(len(old)))

    def changed(match: re.Match[str]) -> str:
        value = float(match[0].rstrip("f"))
        if value in (0.0, 1.0):
            return match[0]
        return f"(changed == {next(numbers)} ? {1.01 * value!r}{export.real.suffix} : {match[0]})"

    write(export, tmp_path, text[:first] + places.sub(changed, text[first:last]) + text[last:])
    (tmp_path / "changed.c").write_text(
        'static int changed;\n#include "law.c"\n#include "law_test.c"\n'
        "int tested(int number);\nint tested(int number) { changed = number; return law_test(); }\n",
        encoding="utf-8",
    )
    library = compile_(tmp_path / "changed.c")
    assert library.tested(-1) == 0
    assert all(0 < library.tested(i) <= N for i in range(len(old)))


def test_a_law_without_fault_fails(tmp_path: Path) -> None:
    export = make_export("PID")
    write(export, tmp_path, without_fault(export))
    assert status(tmp_path) == N + 1


ODD = """
from casadi import SX, exp, sqrt
from friction_fmus.lawkit.law import *

@law("Root", "Root of an input", source="none", Ts=1e-3, outputs={{"u": Output(FORCE, "force")}})
def root({inputs}k: SX = Parameter(FORCE, 3.0, "force")) -> dict[str, SX]:
    '''Not finite for a negative load, and beyond float for a large one.'''
    return {{"u": {u}}}
"""


@pytest.mark.parametrize(
    ("inputs", "u", "repeated"),
    [
        ('Fn: SX = Input("N", 1.0, "load"), ', "k * sqrt(Fn - 0.5)", True),
        ('Fn: SX = Input("N", 0.0, "load"), ', "k * exp(200.0 * Fn)", True),
        ('on: SX = Command(True, "on"), ', "k * on", False),
    ],
)
@pytest.mark.parametrize("real", some(REALS, REALS[:1]))
def test_odd_laws(inputs: str, u: str, repeated: bool, real: Literal["double", "float"], tmp_path: Path) -> None:
    """Outputs that are not finite, or not in float; no input but a command."""
    path = tmp_path / "root.py"
    path.write_text(ODD.format(inputs=inputs, u=u), encoding="utf-8")
    export = make_export(path, real=real)
    found = vectors(export)
    assert bool(found.repeated) == (repeated and not ("exp" in u and real == "double"))
    assert all(np.isfinite(samples.expected).all() for samples in found.runs)
    write(export, tmp_path)
    assert status(tmp_path) == 0
    write(export, tmp_path, implementation(export).replace("3.0", "3.1"))
    assert 0 < status(tmp_path) <= N


def test_a_law_that_is_never_finite_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "root.py"
    path.write_text(ODD.format(inputs='Fn: SX = Input("N", 0.0, "load"), ', u="sqrt(-1.0 - k)"), encoding="utf-8")
    message = r"Root has an output that is not finite in sample 1 of its unit test, where the inputs are Fn = 0.28"
    with pytest.raises(FrictionError, match=message):
        vectors(make_export(path))


@landing
def test_the_header_says_what_is_tested() -> None:
    """PID reaches its limits, has no C library call that rounds, and its defaults switch the dead-band off."""
    double, single = (make_export("PID", real=real) for real in REALS)
    text = " ".join(unit_test(double, vectors(double)).split())
    assert "Outputs must equal the expected values" in text
    assert "No sample shows a change by 1 % of: db_ratio." in text
    assert f"{N + 1}: an input is NaN" in text
    assert "float rounds each operation to 6e-8: 3e-05 of the output" in " ".join(
        unit_test(single, vectors(single)).split()
    )
    lugre = make_export("LuGreFeedforward")
    assert "C libraries round exp, expm1, pow differently" in unit_test(lugre, vectors(lugre)).replace("\n  ", "")
    text = unit_test(make_export("Prefilter"), vectors(make_export("Prefilter")))
    assert "No sample reaches a limit u_min or u_max." in text
