"""What `friction-fmus codegen` writes: C that compilers accept, checks, the README without a target, and the errors."""

from __future__ import annotations

import ctypes
import errno
import math
import os
import shutil
import subprocess
from itertools import product
from pathlib import Path
from typing import Any

import pytest
from thorough import landing

from friction_fmus.__main__ import main
from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.codegen import CORES, emulation, export_law, law_export, measure
from friction_fmus.codegen.law_export import make_export
from friction_fmus.errors import FrictionError, UnknownNameError
from friction_fmus.lawkit.law import discover_laws
from harness import OutputError
from harness.compiling import toolchain

LAWS = [law.name for law in discover_laws(laws_folder())]
WARNINGS = ["-Wall", "-Wextra", "-Wconversion", "-Wpedantic", "-Wshadow", "-Wstrict-prototypes", "-Wmissing-prototypes"]
COMPILERS = {"zig": toolchain.compiler()} | ({"gcc": ["gcc"]} if shutil.which("gcc") else {})

ELEMENTS = """
from casadi import SX
from friction_fmus.lawkit.law import *

@law("Elements", "Elements */ in a comment", source="none", Ts=1e-3, outputs={"u": Output(FORCE, "sum")},
     conditions={"k[1] > k[2]": lambda k: k[0] > k[1]})
def elements(
    x: SX = Input(LENGTH, 0.5, "displacement"),
    k: SX = Parameter(STIFFNESS, (5.0, 3.0), "stiffness of the elements", min=0.0, max=10.0),
    hold: SX = Switch(False, "no output"),
) -> dict[str, SX]:
    '''No states, a vector, a switch.'''
    return {"u": (1 - hold) * (k[0] * x + k[1] * x**2)}
"""


@pytest.fixture(autouse=True)
def without_target(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is measured: that is test_cost.py."""
    monkeypatch.setattr(law_export, "missing", lambda: list(emulation.PACKAGES))


@pytest.fixture
def elements(tmp_path: Path) -> Path:
    path = tmp_path / "elements.py"
    path.write_text(ELEMENTS, encoding="utf-8")
    return path


def compiled(folder: Path, compiler: str, *flags: str) -> Path:
    target = folder / "example"
    command = [*COMPILERS[compiler], *WARNINGS, "-Werror", "-O2", *flags, "law.c", "main.c", "-o", str(target), "-lm"]
    run = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    return target


def test_a_vector_a_switch_and_no_states(elements: Path, tmp_path: Path) -> None:
    export_law(elements, tmp_path / "c", start={"k[2]": 1.0, "x": 2.0})
    for compiler, standard in product(COMPILERS, ("c99", "c17")):
        program = compiled(tmp_path / "c", compiler, f"-std={standard}")
        # x = 1e-3 k: u = 5 x + x^2
        shown = subprocess.run([program], capture_output=True, text=True, check=True).stdout.split()[2::3]
        expected = [5e-3 * k + 1e-6 * k * k for k in range(10)]
        assert [float(value) for value in shown] == pytest.approx(expected, rel=1e-5)


CALLS = """
#include "law.c"
static law_parameters p; static law_states s; static law_inputs i; static law_outputs o;
void fresh(void) { law_init(&p, &s, &i, &o); }
int check(double value, int place)
{ fresh(); if (place < 2) p.k[place] = value; else if (place == 2) p.Ts = value; return law_check(&p); }
double step(double x) { i.x = x; law_step(&p, &s, &i, &o); return o.u; }
int fault(void) { return o.fault; }
"""

WITHOUT_POINTERS = """
#include "law.c"
int left_alone(void);
int left_alone(void)
{
    law_parameters p; law_states s; law_inputs i; law_outputs o;
    law_init(&p, &s, &i, &o);
    i.x = 1.0;
    law_step(NULL, &s, &i, &o); law_step(&p, NULL, &i, &o); law_step(&p, &s, NULL, &o); law_step(&p, &s, &i, NULL);
    law_init(NULL, &s, &i, &o); law_init(&p, NULL, &i, &o); law_init(&p, &s, NULL, &o); law_init(&p, &s, &i, NULL);
    return law_check(NULL) == -1 && law_check(&p) == 0 && i.x == 1.0 && o.u == 0.0;
}
"""


@pytest.mark.parametrize("compiler", COMPILERS)
def test_pointers_are_checked_if_asked(compiler: str, elements: Path, tmp_path: Path) -> None:
    export_law(elements, tmp_path)
    (tmp_path / "calls.c").write_text(WITHOUT_POINTERS, encoding="utf-8")
    options = ("-Werror", "-std=c99", "-O2", "-DLAW_CHECK_POINTERS", "-shared", "-fPIC")
    command = [*COMPILERS[compiler], *WARNINGS, *options]
    subprocess.run([*command, "calls.c", "-o", "calls.so", "-lm"], cwd=tmp_path, check=True)
    assert ctypes.CDLL(str(tmp_path / "calls.so")).left_alone() == 1
    for text in ((tmp_path / name).read_text(encoding="utf-8") for name in ("law.h", "README.md")):
        assert "LAW_CHECK_POINTERS" in text


def test_the_guard_and_the_check(elements: Path, tmp_path: Path) -> None:
    export_law(elements, tmp_path)
    (tmp_path / "calls.c").write_text(CALLS, encoding="utf-8")
    for standard in ("c99", "gnu17"):
        library = tmp_path / f"{standard}.so"
        command = [*COMPILERS["zig"], f"-std={standard}", "-O2", "-shared", "-fPIC", "calls.c", "-o", str(library)]
        subprocess.run([*command, "-lm"], cwd=tmp_path, check=True)
        calls = ctypes.CDLL(str(library))
        calls.step.restype = ctypes.c_double
        calls.step.argtypes = (ctypes.c_double,)
        calls.check.argtypes = (ctypes.c_double, ctypes.c_int)
        calls.fresh()
        assert (calls.step(1.0), calls.fault()) == (8.0, 0)
        for bad in (math.nan, math.inf, -math.inf):
            assert (calls.step(bad), calls.fault()) == (8.0, 1)
        assert (calls.step(2.0), calls.fault()) == (22.0, 0)
        # the rules of the header: 1 the vector, 2 Ts, 3 the relation
        broken = {(5.0, 3): 0, (-1.0, 0): 1, (11.0, 0): 1, (math.nan, 1): 1, (0.0, 2): 2, (math.inf, 2): 2, (3.0, 0): 3}
        assert {case: calls.check(*case) for case in broken} == broken
    header = (tmp_path / "law.h").read_text(encoding="utf-8")
    assert "1: k is finite, 0 to 10\n" in header
    assert "2: Ts is finite, at least 1e-09\n" in header
    assert "3: k[1] > k[2] */" in header
    assert "double k[2]; /* [N/m] stiffness of the elements, 0 to 10 */" in header
    assert "Elements * / in a comment" in header


@landing
def test_fast_math_is_refused(tmp_path: Path) -> None:
    export_law("PID", tmp_path)
    command = [*COMPILERS["zig"], "-ffast-math", "-c", "law.c", "-o", "law.o"]
    run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert run.returncode != 0
    assert "without -ffast-math" in run.stderr


@landing
def test_a_prefix_keeps_two_laws_apart(tmp_path: Path) -> None:
    """Both in one program, each with its own start."""
    for prefix, gain in (("inner", 1.0), ("outer", 10.0)):
        export_law("PID", tmp_path, prefix=prefix, start={"Kp": gain})
    both = (
        '#include "inner.h"\n#include "outer.h"\n'
        "double sum(void) { inner_parameters p; inner_states s; inner_inputs i; inner_outputs o;"
        " outer_parameters P; outer_states S; outer_inputs I; outer_outputs O;"
        " inner_init(&p, &s, &i, &o); outer_init(&P, &S, &I, &O); i.r = I.r = 1.0;"
        " inner_step(&p, &s, &i, &o); outer_step(&P, &S, &I, &O); return o.u + O.u; }"
    )
    (tmp_path / "both.c").write_text(both, encoding="utf-8")
    command = [*COMPILERS["zig"], "-O1", "-shared", "-fPIC", "both.c", "inner.c", "outer.c", "-o", "both.so", "-lm"]
    subprocess.run(command, cwd=tmp_path, check=True)
    total = ctypes.CDLL(str(tmp_path / "both.so")).sum
    total.restype = ctypes.c_double
    assert total() == 11.0


def test_without_the_compiler_the_readme_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["codegen", "PID", "-o", str(tmp_path), "--real", "float", "--set", "Kp=5"]) == 0
    text = " ".join((tmp_path / "README.md").read_text(encoding="utf-8").split())
    assert "The cost of this code was not measured, because arm-none-eabi-gcc is not installed." in text
    assert "PID with default parameters in `float` takes about" in text  # from the table of the package
    assert "apt-get install gcc-arm-none-eabi" in text
    assert "parameters->Kp = 5.0f;" in (tmp_path / "pid.c").read_text(encoding="utf-8")
    files = [str(tmp_path / name) for name in ("pid.h", "pid.c", "pid_test.c", "pid.hpp", "main.c", "README.md")]
    assert capsys.readouterr().out.splitlines()[:6] == files


def test_the_command_says_what_to_install(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shutil, "which", lambda _: None)
    assert main(["codegen", "PID", "-o", str(tmp_path)]) == 0
    last = capsys.readouterr().out.splitlines()[-1]
    assert last.startswith("Some costs were not measured without arm-none-eabi-gcc and qemu-arm; run apt-get ")
    assert "apt-get install gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-user" in last
    with pytest.raises(
        FrictionError, match="arm-none-eabi-gcc is missing; install it with apt-get install gcc-arm-none-eabi"
    ):
        measure(make_export("PID"), CORES[0])


@pytest.mark.parametrize(
    ("start", "message"),
    [
        ({"kp": 1.0}, "PID has no variable 'kp' with a start value (did you mean Kp?"),
        ({"Kp": -1.0}, "Kp = -1 lies outside [0, inf]; choose a value inside"),
        ({"Kp": math.inf}, "Kp = inf lies outside [0, inf]"),
        ({"enable": 0.5}, "enable = 0.5 is not a Boolean"),
        ({"u_min": 2.0, "u_max": 1.0}, "PID requires u_min <= u_max, which the given values violate"),
        ({"Kp[1]": 1.0}, "PID has no variable 'Kp[1]'"),
    ],
)
def test_bad_start_values_get_one_sentence(start: dict[str, float], message: str, tmp_path: Path) -> None:
    with pytest.raises(FrictionError) as caught:
        export_law("PID", tmp_path / "none", start=start)
    assert message in str(caught.value)
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize(("start", "Fn"), [({}, 1.0), ({"Fn0": 50.0}, 50.0), ({"Fn0": 50.0, "Fn": 20.0}, 20.0)])
def test_the_normal_force_begins_with_that_of_the_parameters(start: dict[str, float], Fn: float) -> None:
    """A caller that never sets it has the friction of the parameters."""
    assert make_export("LuGreFeedforward", start=start).start["Fn"] == (Fn,)


def test_other_errors_get_one_sentence(elements: Path, tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match=r"There is no variable 'k\[3\]'; the elements of k are 1 to 2"):
        export_law(elements, tmp_path, start={"k[3]": 1.0})
    with pytest.raises(FrictionError, match=r"LuGre is a friction block.*LuGreFeedforward or LuGreObserver"):
        export_law("LuGre", tmp_path)
    with pytest.raises(UnknownNameError, match=r"There is no model 'PIDD' \(did you mean PID"):
        export_law("PIDD", tmp_path)
    with pytest.raises(FrictionError, match="the prefix '3d' must consist of letters"):
        export_law("PID", tmp_path, prefix="3d")


@pytest.mark.parametrize("there", [False, True])
def test_a_full_disk_leaves_no_half_of_an_export(there: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "out"
    if there:
        folder.mkdir()
        (folder / "law.h").write_text("the last one")
    write = Path.write_text

    def fill(path: Path, text: str, *arguments: Any, **options: Any) -> int:
        if path.suffix == ".hpp":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(path, text, *arguments, **options)

    monkeypatch.setattr(Path, "write_text", fill)
    with pytest.raises(OutputError, match=r"law\.hpp: No space left on device; free some space"):
        export_law("CoulombFeedforward", folder)
    assert {path.name: path.read_text() for path in folder.glob("*")} == ({"law.h": "the last one"} if there else {})
    assert folder.exists() is there
