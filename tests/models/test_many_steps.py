"""Samples of an importer that adds its steps, in C, over more steps than Python can take."""

from __future__ import annotations

import shutil
import subprocess
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from shell.instance import load
from thorough import some

from harness.compiling.toolchain import header_folder

NAMES = ("x", "v", "Ts", "window", "v0")


@pytest.mark.parametrize("start", some([0.0, 1.7e9], [1.7e9]))
@pytest.mark.parametrize("steps", some([1_000_000, 100_000_000], [200_000]))
def test_every_step_takes_its_sample(build_fmu: Callable[..., Path], tmp_path: Path, start: float, steps: int) -> None:
    """The sum of 1e6 steps is off by 1e-9 of a step, or after a Unix time by many steps."""
    if not (compiler := shutil.which("gcc") or shutil.which("clang")):
        pytest.skip("there is no compiler")
    library = load(build_fmu("Differentiator"))
    with zipfile.ZipFile(library.fmu) as archive:
        archive.extractall(tmp_path)
    folders = [f"-I{folder}" for folder in (tmp_path / "sources", header_folder())]
    (tmp_path / "all.c").write_text(
        '#define FMI2_OVERRIDE_FUNCTION_PREFIX\n#include "Differentiator.c"\n'
        f'#include "{Path(__file__).with_name("sums.c").as_posix()}"\n'
    )
    program = tmp_path / "sums"
    subprocess.run(
        [
            compiler,
            "-std=c99",
            "-O2",
            "-ffp-contract=off",
            *folders,
            str(tmp_path / "all.c"),
            "-o",
            str(program),
            "-lm",
        ],
        check=True,
    )
    references = [str(library.variables[name].valueReference) for name in NAMES]
    done = subprocess.run(
        [str(program), str(library.description.guid), repr(start), str(steps), *references],
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == f"{steps}\n"
