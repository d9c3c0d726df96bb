"""Estimated cycles of a law: instructions executed under QEMU times their durations in the manual of the core.

Arm: Cortex-M4 Processor Technical Reference Manual, revision r0p1, tables 3-1 (instructions) and 7-1 (floating point);
Cortex-M0+ Technical Reference Manual, revision r0p1, table 3-1. Memory has no wait states. For the Cortex-M7, Arm
publishes no durations.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

from friction_fmus.codegen.emulation import Trace
from friction_fmus.codegen.target import M0PLUS, M4F, Core


@dataclass(frozen=True)
class Durations:
    """Durations of the instructions of a core."""

    taken: int
    """Additional cycles of a taken branch."""
    cycles: tuple[tuple[str, int], ...]
    """Patterns of mnemonics without width, and their cycles; all others take one cycle. The first match counts."""
    lists: str
    """Pattern of instructions that take one cycle, and one more for each register of their list."""

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
