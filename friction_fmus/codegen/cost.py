"""The cost of an exported law on a microcontroller: sizes from the cross compiler, instructions counted by QEMU."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Final

from friction_fmus.codegen.emulation import (
    COMPILER,
    EMULATOR,
    FLAGS,
    M0PLUS,
    M4F,
    PACKAGES,
    RANDOM,
    Core,
    Trace,
    call,
    compile_law,
    missing,
    trace,
)
from friction_fmus.codegen.layout import Export
from friction_fmus.errors import FrictionError
from harness.storage.files import ScratchFolder

# Estimated cycles of a law: instructions executed under QEMU times their durations in the manual of the core.
#
# Arm: Cortex-M4 Processor Technical Reference Manual, revision r0p1, tables 3-1 (instructions) and 7-1 (floating
# point); Cortex-M0+ Technical Reference Manual, revision r0p1, table 3-1. Memory has no wait states. For the Cortex-M7,
# Arm publishes no durations.


@dataclass(frozen=True)
class Durations:
    """Durations of the instructions of a core."""

    taken: int  # additional cycles of a taken branch
    cycles: tuple[tuple[str, int], ...]
    """Patterns of mnemonics without width, and their cycles; all others take one cycle. The first match counts."""
    lists: str  # pattern of instructions that take one cycle, and one more for each register of their list

    def of(self, text: str) -> int:
        """Return the cycles of one instruction without those of a taken branch."""
        mnemonic, _, operands = text.partition("\t")
        name = mnemonic.removesuffix(".w").removesuffix(".n")
        listed = 1 + _registers(operands) if re.match(self.lists, name) else 0
        for pattern, cycles in self.cycles:
            if re.match(rf"({pattern})", f"{name} {operands}" if listed else name):
                return listed + cycles
        return listed or 1


DURATIONS: Final = {
    M4F: Durations(
        2,  # to refill the pipeline; the manual gives 1 to 3
        (
            (r"vdiv|vsqrt", 14),
            (r"vn?ml[as]|vfn?m[as]", 3),
            (r"[us]div", 7),  # 2 to 12
            (r"ldrd|strd|v(ldr|str)\.64", 3),
            (r"v?(ldr|str)", 2),
        ),
        r"v?push|v?pop|v?ldm|v?stm",
    ),
    # a multiplier of one cycle; the slow variant takes 32. A taken branch takes 2 cycles, BL and POP of the PC one more
    M0PLUS: Durations(1, ((r"bl$", 2), (r"pop .*pc", 1), (r"ldr|str", 2)), r"push|pop|ldm|stm"),
}
"""Durations by core."""


def cycles_of(trace: Trace, core: Core) -> list[int] | None:
    """Return the cycles of each step; None for a core whose durations are not published."""
    durations = DURATIONS.get(core)
    if durations is None:
        return None
    cost = [sum(durations.of(trace.code[address].text) for address in block) for block in trace.blocks]
    starts = [block[0] for block in trace.blocks]
    ends = [block[-1] + trace.code[block[-1]].size for block in trace.blocks]
    totals = []
    for step in trace.steps:
        jumps = sum(ends[here] != starts[following] for here, following in pairwise(step))
        totals.append(sum(cost[i] for i in step) + durations.taken * (jumps + 1))  # the last one returns
    return totals


def _registers(operands: str) -> int:
    """Return the number of registers in a list such as {r4, r5, lr} or {s16-s21}."""
    found = re.search(r"\{([^}]*)\}", operands)
    total = 0
    for each in found[1].split(",") if found else ():
        first, dash, last = each.strip().partition("-")
        total += int(last[1:]) - int(first[1:]) + 1 if dash else 1
    return total


@dataclass(frozen=True)
class Spread:
    """Mean and largest value of a count per step."""

    mean: float  # mean for random inputs
    most: int  # largest value, for random inputs and in the unit test of the law


@dataclass(frozen=True)
class Cost:
    """Cost of a law on one core."""

    core: Core
    code: int
    """Flash for the functions of the law: instructions and constants [bytes]."""
    flash: int  # flash including the library functions that the law calls [bytes]
    instance: int  # RAM for the four structs [bytes]
    static: int  # RAM for static variables, all of which belong to the C library [bytes]
    frame: int  # stack of the law's own functions, summed over the longest chain of calls [bytes]
    stack: int | None = None  # measured stack including library functions [bytes]; None without QEMU
    instructions: Spread | None = None  # instructions per step, including library functions; None without QEMU
    cycles: Spread | None = None  # estimated cycles per step; None without QEMU or published durations
    covered: float | None = None
    """Fraction of the instructions of the law, without library functions, that the counted steps execute."""


_NAME = r'"(?:[^":]*:)?([^"]*)"'  # of a function, without the file of a static one
_NODE = re.compile(rf"^node: .*title: {_NAME} .*\\n(\d+) bytes \(([^)]*)\)", re.M)
_EDGE = re.compile(rf"^edge: .*sourcename: {_NAME} targetname: {_NAME}", re.M)


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
    with ScratchFolder() as scratch:
        folder = Path(scratch)
        compile_law(export, core, folder, "-fcallgraph-info=su")
        members = "".join(f"char instance_{group}[sizeof({p}_{group})];\n" for group in export.groups)
        (folder / "instance.c").write_text(f'#include "{p}.h"\n{members}', encoding="utf-8")
        compiler = (COMPILER, *core.flags, *FLAGS)
        call(folder, *compiler, "-fno-common", "-c", "instance.c")
        roots = ("-Wl,--gc-sections", f"-Wl,-e,{p}_step", f"-Wl,-u,{p}_init")
        call(folder, *compiler, "-nostartfiles", "--specs=nosys.specs", *roots, f"{p}.o", "-lm", "-o", "law.elf")
        (text, data, bss), linked, instance = _sizes(folder, f"{p}.o", "law.elf", "instance.o")
        if data + bss:
            raise FrictionError(f"{p}.c has {data + bss} bytes of static variables; a law must have none")
        calls = CallGraph.read((folder / f"{p}.ci").read_text(encoding="utf-8"))
        only_check = calls.reached(f"{p}_check") - calls.reached(f"{p}_step") - calls.reached(f"{p}_init")
        sections = re.findall(r"^\.text\.(\S+)\s+(\d+)", call(folder, "arm-none-eabi-size", "-A", f"{p}.o"), re.M)
        cost = Cost(
            core,
            code=text - sum(int(size) for name, size in sections if name in only_check),
            flash=linked[0] + linked[1],
            instance=instance[2],
            static=linked[1] + linked[2],
            frame=max(calls.depth(f"{p}_init"), calls.depth(f"{p}_step")),
        )
        if EMULATOR in missing():
            return cost
        found = trace(export, core, folder)
        return replace(
            cost,
            stack=found.stack,
            instructions=_spread(found.counts),
            cycles=_spread(cycles_of(found, core)),
            covered=_covered(found, calls.reached(f"{p}_step")),
        )


def _spread(counts: list[int] | None) -> Spread | None:
    return None if counts is None else Spread(sum(counts[:RANDOM]) / len(counts[:RANDOM]), max(counts))


def _covered(found: Trace, functions: frozenset[str]) -> float:
    """Return the fraction of the instructions of some functions that a trace executes; tables among them are none."""
    own = {a for a, at in found.code.items() if at.function in functions and not at.text.startswith((".", "nop"))}
    return len(own & found.executed) / len(own)


@dataclass(frozen=True)
class CallGraph:
    """Calls and stack use of the functions of one file."""

    frames: dict[str, int]  # stack of each function that the file defines [bytes]
    calls: dict[str, set[str]]  # functions that a function calls

    @classmethod
    def read(cls, text: str) -> CallGraph:
        """Read the file that gcc writes for ``-fcallgraph-info=su``."""
        frames: dict[str, int] = {}
        calls: dict[str, set[str]] = {}
        for title, size, kind in _NODE.findall(text):
            if kind != "static":
                raise FrictionError(f"The stack of {title} is {kind}; a law must know its stack")
            frames[title] = int(size)
        for caller, called in _EDGE.findall(text):
            calls.setdefault(caller, set()).add(called)
        return cls(frames, calls)

    def depth(self, name: str) -> int:
        """Return the stack of the deepest chain of calls from a function, without functions of other files."""
        return self.frames.get(name, 0) + max(map(self.depth, self.calls.get(name, ())), default=0)

    def reached(self, name: str) -> frozenset[str]:
        """Return the functions of this file that a function calls, directly or not, and itself."""
        found: set[str] = set()
        waiting = {name}
        while waiting:
            here = waiting.pop()
            found.add(here)
            waiting |= self.calls.get(here, set()) & self.frames.keys() - found
        return frozenset(found)


def _sizes(folder: Path, *names: str) -> list[tuple[int, int, int]]:
    """Return the sizes of text, data and bss of files [bytes]."""
    rows = call(folder, "arm-none-eabi-size", *names).splitlines()[1:]
    return [(int(text), int(data), int(bss)) for text, data, bss, *_ in map(str.split, rows)]
