"""Estimated cycles of a law on a Cortex-M4F: instructions executed under QEMU times their durations in the manual.

Arm: Cortex-M4 Processor Technical Reference Manual, revision r0p1, tables 3-1 (instructions) and 7-1 (floating point),
without wait states of the memory.
"""

from __future__ import annotations

import re
from typing import Final

from friction_fmus.codegen.cost import CORES, disassembled, executed
from friction_fmus.codegen.layout import Export

REFILL: Final = 2
"""Cycles to refill the pipeline after a taken branch; the manual gives 1 to 3."""

_DURATIONS: Final = (
    (r"vdiv|vsqrt", 14),
    (r"vn?ml[as]|vfn?m[as]", 3),
    (r"[us]div", 7),  # 2 to 12
    (r"ldrd|strd|v(ldr|str)\.64", 3),
    (r"v?(ldr|str)", 2),
)
"""Mnemonics without conditions and widths, and their cycles; all others take one cycle."""

_LISTS: Final = r"v?push|v?pop|v?ldm|v?stm"
"""Instructions that take one cycle, and one more for each register of their list."""


def cycles_of(export: Export) -> tuple[float, int]:
    """Return the mean and the largest number of cycles of a sample with random inputs.

    Parameters
    ----------
    export : Export
        Law in single precision.

    Raises
    ------
    FrictionError
        If a tool is missing or fails.
    """
    core = CORES[0]
    code = disassembled(export, core)
    counts = []
    for addresses in executed(export, core):
        total = 0
        for here, following in zip(addresses, [*addresses[1:], -1], strict=True):
            size, text = code[here]
            total += duration(text) + (REFILL if following != here + size else 0)
        counts.append(total)
    return sum(counts) / len(counts), max(counts)


def duration(text: str) -> int:
    """Return the cycles of one instruction, not counting a refill of the pipeline.

    Parameters
    ----------
    text : str
        Instruction and operands as objdump prints them.
    """
    mnemonic, _, operands = text.partition("\t")
    name = mnemonic.removesuffix(".w").removesuffix(".n")
    if re.match(_LISTS, name):
        return 1 + _registers(operands)
    for pattern, cycles in _DURATIONS:
        if re.match(rf"({pattern})", name):
            return cycles
    return 1


def _registers(operands: str) -> int:
    """Return the number of registers in a list such as {r4, r5, lr} or {s16-s21}."""
    found = re.search(r"\{([^}]*)\}", operands)
    total = 0
    for each in found[1].split(",") if found else ():
        first, dash, last = each.strip().partition("-")
        total += int(last[1:]) - int(first[1:]) + 1 if dash else 1
    return total
