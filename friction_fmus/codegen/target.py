"""Microcontroller cores, and the cross compiler, binutils and emulator for them."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from friction_fmus.codegen.layout import Export
from friction_fmus.codegen.sources import header, implementation
from friction_fmus.errors import FrictionError
from harness.storage.files import ScratchFolder

COMPILER: Final = "arm-none-eabi-gcc"
EMULATOR: Final = "qemu-arm"
PACKAGES: Final = {COMPILER: "gcc-arm-none-eabi libnewlib-arm-none-eabi", EMULATOR: "qemu-user"}
"""Debian packages of each tool."""

FLAGS: Final = ("-std=c99", "-O2", "-fno-math-errno", "-ffp-contract=off", "-ffunction-sections", "-fdata-sections")
"""Compiler options for the measurement."""

_CPU: Final = "max"  # has all instructions of all cores; some versions of qemu-arm cannot run the M profile


@dataclass(frozen=True)
class Core:
    """A processor core.

    Attributes
    ----------
    name : str
        Common name.
    flags : tuple of str
        Compiler options.
    """

    name: str
    flags: tuple[str, ...]


M0PLUS: Final = Core("Cortex-M0+", ("-mcpu=cortex-m0plus", "-mthumb", "-mfloat-abi=soft"))
M4F: Final = Core("Cortex-M4F", ("-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"))
M7: Final = Core("Cortex-M7", ("-mcpu=cortex-m7", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv5-d16"))

CORES: Final = (M0PLUS, M4F, M7)
"""Without floating-point unit, with one for float, and with one for double."""


def missing() -> list[str]:
    """Return the tools that are not installed."""
    return [tool for tool in PACKAGES if not shutil.which(tool)]


def call(folder: Path, *command: str) -> str:
    """Run a tool in a folder and return its output."""
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        reason: Sequence[str] = done.stderr.strip().splitlines()[:1] or [f"status {done.returncode}"]
        raise FrictionError(f"{command[0]} failed: {reason[0]}")
    return done.stdout


def compile_law(export: Export, core: Core, folder: Path, *flags: str) -> None:
    """Write the files of a law and compile ``PREFIX.o``."""
    p = export.prefix
    (folder / f"{p}.h").write_text(header(export), encoding="utf-8")
    (folder / f"{p}.c").write_text(implementation(export), encoding="utf-8")
    call(folder, COMPILER, *core.flags, *FLAGS, *flags, "-c", f"{p}.c")


def link_program(export: Export, core: Core, folder: Path, text: str, *flags: str) -> None:
    """Compile a C program with the entry ``start`` and link it with the law of `compile_law` as ``program``."""
    (folder / "program.c").write_text(text, encoding="utf-8")
    # shrink-wrapping would read the stack pointer before the registers are saved
    link = ("-fno-shrink-wrap", "-nostartfiles", "--specs=nosys.specs", "-Wl,--gc-sections", "-Wl,-e,start")
    sources = ("program.c", f"{export.prefix}.o", "-lm", "-o", "program")
    call(folder, COMPILER, *core.flags, *FLAGS, *flags, *link, *sources)


def emulate(folder: Path, *flags: str) -> str:
    """Run ``program`` under QEMU and return its output."""
    return call(folder, EMULATOR, "-cpu", _CPU, *flags, "./program")


def assembly(export: Export, core: Core, *flags: str) -> str:
    """Return the assembly code of the law for a core, compiled with additional options."""
    with ScratchFolder("friction-fmus-") as scratch:
        folder = Path(scratch)
        compile_law(export, core, folder, "-S", "-o", "law.s", *flags)
        return (folder / "law.s").read_text(encoding="utf-8")
