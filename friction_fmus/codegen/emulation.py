"""Runs of an exported law under QEMU: its results, its stack, and the instructions that it executes."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from friction_fmus.codegen.layout import Export
from friction_fmus.codegen.program import program, samples
from friction_fmus.codegen.target import EMULATOR, Core, call, compile_law, emulate, link_program
from friction_fmus.codegen.vectors import inputs
from friction_fmus.errors import FrictionError
from harness.storage.scratch import ScratchFolder

RANDOM = 50
"""Number of counted samples with random inputs, before the samples of the unit test."""

_LOG = re.compile(rb"^(?:Trace \d+: \S+ \[[0-9a-f]+/([0-9a-f]+)/|0x([0-9a-f]+): |(IN):)", re.M)


@dataclass(frozen=True)
class Instruction:
    """An instruction of a program."""

    size: int
    """Size [bytes]."""
    text: str
    """Mnemonic, tab and operands as objdump prints them."""
    function: str
    """The function that contains it."""


@dataclass(frozen=True)
class Trace:
    """The instructions that a program executes in steps of the law, from entry to return."""

    code: Mapping[int, Instruction]
    """Instructions of the program by address."""
    blocks: tuple[tuple[int, ...], ...]
    """Addresses of the instructions of blocks that are executed from the first to the last."""
    steps: tuple[tuple[int, ...], ...]
    """Indices of the blocks that each step executes: first `RANDOM` steps with random inputs, then the unit test."""
    stack: int
    """Depth of the stack below the caller of the law [bytes]."""

    @property
    def counts(self) -> list[int]:
        """Number of instructions of each step."""
        sizes = [len(block) for block in self.blocks]
        return [sum(sizes[i] for i in step) for step in self.steps]

    @property
    def executed(self) -> set[int]:
        """Addresses of all executed instructions."""
        return {address for i in {i for step in self.steps for i in step} for address in self.blocks[i]}


def run(export: Export, core: Core, given: Mapping[str, np.ndarray]) -> tuple[np.ndarray, int]:
    """Run the law for a core under QEMU."""
    with ScratchFolder("friction-fmus-") as scratch:
        folder = Path(scratch)
        compile_law(export, core, folder)
        link_program(export, core, folder, program(export, given))
        lines = emulate(folder).splitlines()
    kind = "<f4" if export.real.suffix else "<f8"
    rows = [[np.frombuffer(bytes.fromhex(word), kind)[0] for word in line.split()] for line in lines[:-1]]
    table = np.array(rows, dtype=float).reshape(len(rows), -1)
    found = table[:, : len(export.results)].copy()
    found[:, list(export.result_lows)] += table[:, len(export.results) :]
    return found, _number(lines[-1])


def trace(export: Export, core: Core, folder: Path) -> Trace:
    """Run a law that `compile_law` compiled in a folder, and return the instructions that it executes."""
    random, test = samples(export, RANDOM), inputs(export)
    given = {name: np.append(column, test[name]) for name, column in random.items()}
    link_program(export, core, folder, program(export, given, restart=RANDOM), "-DQUIET")
    depth = emulate(folder, "-d", "in_asm,exec,nochain", "-D", "log")
    code = _disassembled(folder)
    entry = next(address for address, at in code.items() if at.function == f"{export.prefix}_step")
    blocks, steps = _steps((folder / "log").read_bytes(), code, entry)
    count = max((len(column) for column in given.values()), default=1)
    if len(steps) != count:
        raise FrictionError(f"{EMULATOR} logged {len(steps)} steps of {export.law.name} instead of {count}")
    return Trace(code, blocks, steps, _number(depth))


def _steps(
    log: bytes, code: Mapping[int, Instruction], entry: int
) -> tuple[tuple[tuple[int, ...], ...], tuple[tuple[int, ...], ...]]:
    """Return the blocks of instructions and, for each step, the indices of its blocks."""
    blocks: list[tuple[int, ...]] = []
    index: dict[bytes, int] = {}  # of the block last translated, by its address
    listed: list[bytes] = []
    steps: list[list[int]] = []
    home, last = -1, -1
    starts: list[int] = []
    for executed, translated, begin in _LOG.findall(log):
        if begin:
            listed = []
        elif translated:
            listed.append(translated)
        else:
            if listed:
                index[executed] = len(blocks)
                blocks.append(_between(code, int(listed[0], 16), int(listed[-1], 16)))
                starts.append(blocks[-1][0])
                listed = []
            if executed not in index:
                raise FrictionError(
                    f"{EMULATOR} logged no instructions at 0x{executed.decode()}; install another version"
                )
            here = index[executed]
            if starts[here] == entry:
                home = blocks[last][-1] + 4  # the call is a BL with four bytes
                steps.append([])
            elif starts[here] == home:
                home = -1
            if home != -1:
                steps[-1].append(here)
            last = here
    return tuple(blocks), tuple(map(tuple, steps))


def _between(code: Mapping[int, Instruction], first: int, last: int) -> tuple[int, ...]:
    """Return the addresses of the instructions from one to the other.

    QEMU's own list is no substitute: its disassembler reads the code in pieces, and may show the second half of an
    instruction as another one.
    """
    found = [first]
    while (following := found[-1] + code[found[-1]].size) <= last:
        found.append(following)
    return tuple(found)


def _disassembled(folder: Path) -> dict[int, Instruction]:
    """Return the instructions of ``program`` by address."""
    found, function = {}, ""
    row = re.compile(r"\s*([0-9a-f]+):\t([0-9a-f ]+?)\s*\t(.*)")
    for line in call(folder, "arm-none-eabi-objdump", "-d", "program").splitlines():
        if line.endswith(">:"):
            function = line.split("<")[1].removesuffix(">:")
        elif match := row.fullmatch(line):
            found[int(match[1], 16)] = Instruction(len(match[2].replace(" ", "")) // 2, match[3], function)
    return found


def _number(text: str) -> int:
    """Return the number whose bytes the program wrote."""
    return int.from_bytes(bytes.fromhex(text), "little")
