"""The sources of an FMU compile: with three compilers, with fmpy, all in one program, and to the same bytes again."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.build import build_platform_binary
from shell.instance import Library, load
from shell.selection import one_of_each
from thorough import nightly, some

from friction_fmus import build, catalogue
from harness.compiling.toolchain import FLAGS, header_folder

COMPILERS = {
    "gcc": ["gcc", "-fsyntax-only"],
    "clang": ["clang", "-fsyntax-only"],
    "zig cc": [sys.executable, "-m", "ziglang", "cc", "-O0", "-c", "-o", "block.o"],
}
STANDARD = """#define P_(a, b) a##b
#define P(a, b) P_(a, b)
#define fmi2FullName(name) P(FMI2_FUNCTION_PREFIX, name)"""
"""How the standard's own header makes names; fmpy's copy drops the prefix."""
PAIR = """
#include <stdio.h>
#include "fmi2FunctionTypes.h"
#define DECLARE(block)                             \\
    fmi2InstantiateTYPE block##_fmi2Instantiate;   \\
    fmi2EnterInitializationModeTYPE block##_fmi2EnterInitializationMode; \\
    fmi2ExitInitializationModeTYPE block##_fmi2ExitInitializationMode;   \\
    fmi2SetRealTYPE block##_fmi2SetReal;           \\
    fmi2GetRealTYPE block##_fmi2GetReal;           \\
    fmi2DoStepTYPE block##_fmi2DoStep;             \\
    fmi2FreeInstanceTYPE block##_fmi2FreeInstance;
DECLARE(Coulomb)
DECLARE(Viscous)
#define RUN(block, guid, v, F)                                                                          \\
    {                                                                                                   \\
        const fmi2CallbackFunctions none = {0};                                                         \\
        const fmi2ValueReference in = v, out = F;                                                       \\
        const fmi2Real speed = 0.25;                                                                    \\
        fmi2Real force = 0.0;                                                                           \\
        fmi2Component c = block##_fmi2Instantiate("one", fmi2CoSimulation, guid, "", &none, 0, 0);      \\
        if (!c || block##_fmi2EnterInitializationMode(c) || block##_fmi2ExitInitializationMode(c) ||    \\
            block##_fmi2SetReal(c, &in, 1, &speed) || block##_fmi2DoStep(c, 0.0, 0.125, fmi2True) ||    \\
            block##_fmi2GetReal(c, &out, 1, &force))                                                    \\
            return 1;                                                                                   \\
        printf("%.17g\\n", force);                                                                      \\
        block##_fmi2FreeInstance(c);                                                                    \\
    }
"""


def unpacked(fmu: Path, folder: Path) -> Path:
    """The sources of an FMU, alone."""
    with zipfile.ZipFile(fmu) as archive:
        for entry in archive.namelist():
            if entry.startswith("sources/"):
                archive.extract(entry, folder)
    return folder / "sources"


@one_of_each
@pytest.mark.parametrize("compiler", COMPILERS)
def test_sources_are_c99_for_every_compiler(library: Library, compiler: str, tmp_path: Path) -> None:
    command = COMPILERS[compiler]
    if shutil.which(command[0]) is None:
        pytest.skip(f"{compiler} is not installed")
    flags = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-I", str(header_folder())]
    run = subprocess.run(
        [*command, *flags, f"{library.identifier}.c"],
        cwd=unpacked(library.fmu, tmp_path),
        capture_output=True,
        text=True,
        check=False,
    )
    assert (run.returncode, run.stderr) == (0, "")


@pytest.mark.skipif(shutil.which("cmake") is None or shutil.which("cc") is None, reason="builds with cmake and cc")
@pytest.mark.parametrize("name", some(["LuGre", "Mass", "PID", "RepetitiveController"], ["LuGre"]))
def test_fmpy_compiles_a_binary_that_works(
    name: str, build_fmu: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It computes what our binary does, but for the rounding of what its compiler contracts."""
    monkeypatch.delenv("CC", raising=False)
    fmu = build_fmu(name)
    folder = Path(fmpy.extract(str(fmu), str(tmp_path / "fmu")))
    shutil.rmtree(folder / "binaries")
    (tmp_path / "build").mkdir()
    build_platform_binary(folder, tmp_path / "build")
    ours, theirs = (fmpy.simulate_fmu(str(path), stop_time=0.1) for path in (fmu, folder))
    assert ours.dtype.names == theirs.dtype.names
    for column in ours.dtype.names:
        np.testing.assert_allclose(theirs[column], ours[column], rtol=1e-9, atol=1e-12)


@pytest.mark.skipif(shutil.which("gcc") is None, reason="links with gcc")
def test_blocks_linked_into_one_program_run(build_fmu: Callable[..., Path], tmp_path: Path) -> None:
    """F = Fc sign(v) and F = Fv v at v = 0.25 m/s, with the start values of the XML."""
    headers = tmp_path / "headers"
    shutil.copytree(header_folder(), headers)
    functions = headers / "fmi2Functions.h"
    text = functions.read_text(encoding="utf-8")
    assert "#define fmi2FullName(name) name" in text
    functions.write_text(text.replace("#define fmi2FullName(name) name", STANDARD), encoding="utf-8")
    objects, calls, expected = [], [], []
    for name, parameter, factor in (("Coulomb", "Fc", 1.0), ("Viscous", "Fv", 0.25)):
        library = load(build_fmu(name))
        objects.append(tmp_path / f"{name}.o")
        command = ["gcc", "-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-I", headers, "-c", f"{name}.c"]
        subprocess.run([*command, "-o", objects[-1]], cwd=unpacked(library.fmu, tmp_path / name), check=True)
        v, F = (library.variables[each].valueReference for each in ("v", "F"))
        calls.append(f'RUN({name}, "{library.description.guid}", {v}, {F})')
        expected.append(library.start(parameter) * factor)
    program = tmp_path / ("pair.exe" if os.name == "nt" else "pair")
    body = "\n".join([PAIR, "int main(void) {", *calls, "return 0; }"])
    (tmp_path / "pair.c").write_text(body, encoding="utf-8")
    subprocess.run(["gcc", "-I", headers, tmp_path / "pair.c", *objects, "-o", program, "-lm"], check=True)
    run = subprocess.run([program], capture_output=True, text=True, check=True)
    assert [float(line) for line in run.stdout.split()] == expected


@pytest.mark.parametrize("library", some(tuple(catalogue())[::5], ("LuGre", "PID")), indirect=True)
def test_two_builds_are_the_same_bytes(library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FRICTION_FMUS_CACHE", str(tmp_path / "another cache"))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    again = build(library.identifier, tmp_path / "elsewhere")
    assert again.read_bytes() == library.fmu.read_bytes()


@nightly
@pytest.mark.skipif(shutil.which("gcc") is None, reason="links with gcc")
def test_blocks_compiled_from_source_share_a_program(build_fmu: Callable[..., Path], tmp_path: Path) -> None:
    """With the prefixes of the standard's own header (fmpy's copy drops them) no symbol is defined twice."""
    headers = tmp_path / "headers"
    shutil.copytree(header_folder(), headers)
    functions = headers / "fmi2Functions.h"
    text = functions.read_text(encoding="utf-8")
    assert "#define fmi2FullName(name) name" in text
    functions.write_text(text.replace("#define fmi2FullName(name) name", STANDARD), encoding="utf-8")
    flags = [flag for flag in FLAGS if "OVERRIDE" not in flag]
    objects = []
    for name in catalogue():
        sources = tmp_path / name
        sources.mkdir()
        with zipfile.ZipFile(build_fmu(name)) as archive:
            for entry in archive.namelist():
                if entry.startswith("sources/"):
                    (sources / Path(entry).name).write_bytes(archive.read(entry))
        objects.append(tmp_path / f"{name}.o")
        command = ["gcc", *flags, "-O0", "-I", headers, "-c", f"{name}.c", "-o", objects[-1]]
        subprocess.run(command, cwd=sources, check=True)
    subprocess.run(["gcc", "-shared", *objects, "-o", tmp_path / "all.so", "-lm"], check=True)
