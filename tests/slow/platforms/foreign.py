"""Runs the binaries of FMUs for other platforms: a C program of our own under Wine or QEMU."""

from __future__ import annotations

import os
import shutil
import subprocess
import zipfile
from collections.abc import Iterable
from pathlib import Path

import fmpy
import numpy as np
from numpy.typing import NDArray

from harness.compiling.toolchain import compiler, header_folder

RUNNERS = {
    "linux64": ("x86_64-linux-gnu.2.17", ()),
    "win64": ("x86_64-windows-gnu", ("wine",)),
    "aarch64-linux": ("aarch64-linux-gnu.2.17", ("qemu-aarch64", "-L", "/usr/aarch64-linux-gnu")),
}
"""Platform -> what zig compiles for, and what runs it here."""
SUFFIX = {"win64": ".dll"}
AMPLITUDES = {"m": 1e-3, "m/s": 1e-2, "m/s2": 1.0, "N": 3.0}
"""Of random inputs, by unit."""


def missing(platform: str) -> str:
    """What the machine lacks to run a platform, "" for nothing."""
    _, runner = RUNNERS[platform]
    if runner and not shutil.which(runner[0]):
        return f"{runner[0]} is not installed"
    if platform == "aarch64-linux" and not Path(runner[2]).is_dir():
        return f"{runner[2]} is not there: install libc6-arm64-cross"
    return ""


def host(platform: str, folder: Path) -> Path:
    """Compiles the program that drives the FMUs."""
    target, _ = RUNNERS[platform]
    program = folder / ("host.exe" if platform == "win64" else "host")
    flags = ["-std=gnu99", "-O2", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off", "-s", "-I", str(header_folder())]
    source = str(Path(__file__).with_name("host.c"))
    libraries = [] if platform == "win64" else ["-ldl"]
    command = [*compiler(target), *flags, source, "-o", str(program), *libraries]
    subprocess.run(command, cwd=folder, check=True)  # zig compiles its libraries again for a folder above its own
    return program


def case(fmu: Path, platform: str, folder: Path) -> Path:
    """Unpacks the binary for a platform and writes what the program is to do with it."""
    description = fmpy.read_model_description(str(fmu))
    identifier = description.coSimulation.modelIdentifier
    entry = f"binaries/{platform}/{identifier}{SUFFIX.get(platform, '.so')}"
    with zipfile.ZipFile(fmu) as archive:
        archive.extract(entry, folder / identifier)
    rows = []
    for v in description.modelVariables:
        amplitude = AMPLITUDES.get(v.unit or "", 1.0)
        rows.append(f"{v.type[0]} {v.valueReference} {int(v.causality == 'input')} {amplitude!r}")
    path = f"{identifier}/{entry}".replace("/", "\\") if platform == "win64" else f"./{identifier}/{entry}"
    file = folder / f"{identifier}.case"
    file.write_text("\n".join([path, description.guid, "file:///resources", *rows]) + "\n", encoding="ascii")
    return file


def drive(platform: str, fmus: Iterable[Path], folder: Path) -> dict[str, NDArray[np.uint64]]:
    """All values that FMUs return on a platform.

    Returns
    -------
    dict of str to array, shape (times, variables)
        Bits of the doubles, by model identifier. Booleans and integers as doubles.
    """
    program = host(platform, folder)
    cases = [case(fmu, platform, folder) for fmu in fmus]
    environment = os.environ | {"WINEDEBUG": "-all", "WINEPREFIX": str(folder / "wine")}
    command = [*RUNNERS[platform][1], str(program), *(each.name for each in cases)]
    run = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=300, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    return {each.stem: _bits(each) for each in cases}


def _bits(file: Path) -> NDArray[np.uint64]:
    variables = len(file.read_text(encoding="ascii").splitlines()) - 3
    return np.fromfile(file.with_suffix(".case.out"), dtype="<u8").reshape(-1, variables)
