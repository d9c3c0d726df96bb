"""The cost of an exported law on a microcontroller: sizes from the cross compiler, instructions counted by QEMU."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from friction_fmus.codegen.layout import Export
from friction_fmus.codegen.program import program, samples
from friction_fmus.codegen.sources import header, implementation
from friction_fmus.errors import FrictionError
from harness.storage.scratch import ScratchFolder

COMPILER = "arm-none-eabi-gcc"
EMULATOR = "qemu-arm"
PACKAGES = {COMPILER: "gcc-arm-none-eabi libnewlib-arm-none-eabi", EMULATOR: "qemu-user"}
"""Debian packages of each tool."""

FLAGS = ("-std=c99", "-O2", "-fno-math-errno", "-ffp-contract=off", "-ffunction-sections", "-fdata-sections")
"""Compiler options for the measurement."""

_CPU = "cortex-a15"  # has all instructions of both cores; some versions of qemu-arm cannot run the M profile
_COUNTED = 50  # samples; each instruction is a line in QEMU's log


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


CORES = (
    Core("Cortex-M4F", ("-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16")),
    Core("Cortex-M0+", ("-mcpu=cortex-m0plus", "-mthumb", "-mfloat-abi=soft")),
)


@dataclass(frozen=True)
class Cost:
    """Cost of a law on one core.

    Attributes
    ----------
    core : Core
        The core.
    code : int
        Flash for the functions of the law: instructions and constants [bytes].
    flash : int
        Flash including the library functions that the law calls [bytes].
    instance : int
        RAM for the four structs [bytes].
    static : int
        RAM for static variables, all of which belong to the C library [bytes].
    frame : int
        Stack of the law's own functions, summed [bytes].
    stack : int or None
        Measured stack including library functions [bytes]; None without QEMU.
    mean, most : float or None
        Mean and largest number of instructions per step, including library functions; None without QEMU.
    """

    core: Core
    code: int
    flash: int
    instance: int
    static: int
    frame: int
    stack: int | None = None
    mean: float | None = None
    most: int | None = None


def missing() -> list[str]:
    """Return the tools that are not installed."""
    return [tool for tool in PACKAGES if not shutil.which(tool)]


def measure(export: Export, core: Core) -> Cost:
    """Compile a law for a core, and run it if QEMU is available.

    Raises
    ------
    FrictionError
        If the cross compiler is missing or a tool fails.
    """
    if COMPILER in missing():
        raise FrictionError(f"{COMPILER} is missing; install it with apt-get install {PACKAGES[COMPILER]}")
    p = export.prefix
    with ScratchFolder("friction-fmus-") as scratch:
        folder = Path(scratch)
        (folder / f"{p}.h").write_text(header(export), encoding="utf-8")
        (folder / f"{p}.c").write_text(implementation(export), encoding="utf-8")
        members = "".join(f"char instance_{group}[sizeof({p}_{group})];\n" for group in export.groups)
        (folder / "instance.c").write_text(f'#include "{p}.h"\n{members}', encoding="utf-8")
        compile_ = (COMPILER, *core.flags, *FLAGS)
        _run(folder, *compile_, "-fstack-usage", "-c", f"{p}.c")
        _run(folder, *compile_, "-fno-common", "-c", "instance.c")
        roots = ("-Wl,--gc-sections", f"-Wl,-e,{p}_step", f"-Wl,-u,{p}_init")
        _run(folder, *compile_, "-nostartfiles", "--specs=nosys.specs", *roots, f"{p}.o", "-lm", "-o", "law.elf")
        sections = _run(folder, "arm-none-eabi-size", "-A", f"{p}.o")
        optional = rf"^\.text\.(?:{p}_check|relations)\s+(\d+)"
        text, data, bss = _sizes(folder, f"{p}.o")
        if data + bss:
            raise FrictionError(f"{p}.c has {data + bss} bytes of static variables; a law must have none")
        linked = _sizes(folder, "law.elf")
        frames = (folder / f"{p}.su").read_text(encoding="utf-8").splitlines()
        own = {line.split("\t")[0].split(":")[-1]: int(line.split("\t")[1]) for line in frames}
        cost = Cost(
            core,
            code=text - sum(map(int, re.findall(optional, sections, re.M))),
            flash=linked[0] + linked[1],
            instance=_sizes(folder, "instance.o")[2],
            static=linked[1] + linked[2],
            frame=max(own[f"{p}_init"], own[f"{p}_step"] + own.get("sample", 0)),
        )
        if EMULATOR in missing():
            return cost
        _, stack = run(export, core, samples(export, 10 * _COUNTED))
        counts = [len(step) for step in _executed(export, core, folder)]
        return Cost(
            *(core, cost.code, cost.flash, cost.instance, cost.static, cost.frame),
            stack=stack,
            mean=sum(counts) / len(counts),
            most=max(counts),
        )


def run(export: Export, core: Core, given: dict[str, np.ndarray]) -> tuple[np.ndarray, int]:
    """Run the law for a core under QEMU.

    Parameters
    ----------
    export : Export
        The law.
    core : Core
        The core to compile for.
    given : dict of str to array, shape (n,)
        Input values for n samples.

    Returns
    -------
    tuple of array, shape (n, results) and int
        Outputs and next states of every sample, and the used stack [bytes].

    Raises
    ------
    FrictionError
        If a tool fails.
    """
    with ScratchFolder("friction-fmus-") as scratch:
        folder = Path(scratch)
        _build(export, core, folder, given)
        lines = _run(folder, EMULATOR, "-cpu", _CPU, "./program").splitlines()
    kind = "<f4" if export.real.suffix else "<f8"
    rows = [[np.frombuffer(bytes.fromhex(word), kind)[0] for word in line.split()] for line in lines[:-1]]
    table = np.array(rows, dtype=float).reshape(len(rows), -1)
    found = table[:, : len(export.results)].copy()
    found[:, list(export.result_lows)] += table[:, len(export.results) :]
    return found, int.from_bytes(bytes.fromhex(lines[-1]), "little")


def assembly(export: Export, core: Core, *flags: str) -> str:
    """Return the assembly code of the law for a core, compiled with additional options.

    Raises
    ------
    FrictionError
        If the compiler fails.
    """
    with ScratchFolder("friction-fmus-") as scratch:
        folder = Path(scratch)
        (folder / f"{export.prefix}.h").write_text(header(export), encoding="utf-8")
        (folder / f"{export.prefix}.c").write_text(implementation(export), encoding="utf-8")
        return _run(folder, COMPILER, *core.flags, *FLAGS, *flags, "-S", f"{export.prefix}.c", "-o", "-")


def _build(export: Export, core: Core, folder: Path, given: dict[str, np.ndarray], *flags: str) -> None:
    p = export.prefix
    (folder / f"{p}.h").write_text(header(export), encoding="utf-8")
    (folder / f"{p}.c").write_text(implementation(export), encoding="utf-8")
    (folder / "program.c").write_text(program(export, given), encoding="utf-8")
    link = ("-nostartfiles", "--specs=nosys.specs", "-Wl,--gc-sections", "-Wl,-e,start")
    sources = (f"{p}.c", "program.c", "-lm", "-o", "program")
    _run(folder, COMPILER, *core.flags, *FLAGS, *flags, *link, *sources)


def executed(export: Export, core: Core) -> list[list[int]]:
    """Return the addresses of the instructions of each of some steps with random inputs, from entry to return.

    Raises
    ------
    FrictionError
        If a tool is missing or fails.
    """
    with ScratchFolder("friction-fmus-") as scratch:
        return _executed(export, core, Path(scratch))


def disassembled(export: Export, core: Core) -> dict[int, tuple[int, str]]:
    """Return size and text of the instructions of the program that `executed` runs, by address.

    Raises
    ------
    FrictionError
        If a tool is missing or fails.
    """
    with ScratchFolder("friction-fmus-") as scratch:
        folder = Path(scratch)
        _build(export, core, folder, samples(export, _COUNTED), "-DQUIET")
        listing = _run(folder, "arm-none-eabi-objdump", "-d", "program")
    rows = re.findall(r"^\s*([0-9a-f]+):\t([0-9a-f ]+?)\s*\t(.*)$", listing, re.M)
    return {int(at, 16): (len(code.replace(" ", "")) // 2, text) for at, code, text in rows}


def _executed(export: Export, core: Core, folder: Path) -> list[list[int]]:
    """Return the addresses of the instructions of each step; each line of the log is one instruction."""
    _build(export, core, folder, samples(export, _COUNTED), "-DQUIET")
    symbols = _run(folder, "arm-none-eabi-nm", "program")
    entry = int(str(re.search(rf"^(\w+) T {export.prefix}_step$", symbols, re.M)[1]), 16)  # type: ignore[index]
    usage = _run(folder, EMULATOR, "--help")
    single = "-one-insn-per-tb" if "one-insn-per-tb" in usage else "-singlestep"
    _run(folder, EMULATOR, "-cpu", _CPU, single, "-d", "exec,nochain", "-D", "log", "./program")
    steps: list[list[int]] = []
    home, last = -1, 0
    with (folder / "log").open(encoding="utf-8") as log:
        for line in log:
            address = re.search(r"\[[0-9a-f]+/([0-9a-f]+)/", line)
            if not address:
                continue
            here = int(address[1], 16)
            if here == entry:
                home = last + 4  # the call is a BL with four bytes
                steps.append([])
            elif here == home:
                home = -1
            if home != -1:
                steps[-1].append(here)
            last = here
    if len(steps) != _COUNTED:
        raise FrictionError(f"{EMULATOR} logged {len(steps)} steps instead of {_COUNTED}")
    return steps


def _sizes(folder: Path, name: str) -> tuple[int, int, int]:
    """Return the sizes of text, data and bss [bytes]."""
    text, data, bss = _run(folder, "arm-none-eabi-size", name).splitlines()[1].split()[:3]
    return int(text), int(data), int(bss)


def _run(folder: Path, *command: str) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        reason: Sequence[str] = done.stderr.strip().splitlines()[:1] or [f"status {done.returncode}"]
        raise FrictionError(f"{command[0]} failed: {reason[0]}")
    return done.stdout
