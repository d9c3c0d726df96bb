"""Structured Text of laws and loops: the bits of the exported C, names, the PLCopen XML, and what is refused."""

from __future__ import annotations

import ctypes
import math
import re
import struct
import sys
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from codegen.st_evaluator import STANDARD, Instance, Program, libm
from codegen.test_loop import LOOPS
from laws.draws import random_arguments
from thorough import THOROUGH, nightly, some

sys.path.insert(0, str(Path(__file__).parents[2]))

from benchmarks.law_runs import compile_
from friction_fmus.__main__ import main
from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.codegen.function_block import FunctionBlock, function_block, plcopen, structured_text
from friction_fmus.codegen.law_export import make_export
from friction_fmus.codegen.layout import Export, is_flag
from friction_fmus.codegen.servo_law import loop_text
from friction_fmus.codegen.sources import header, implementation
from friction_fmus.errors import FrictionError
from friction_fmus.lawkit.emit.structured_text import KEYWORDS, functions
from friction_fmus.lawkit.law import BOOLEANS, PARAMETERS, VECTORS
from friction_fmus.lawkit.law_files import discover_laws

LAWS = [law.name for law in discover_laws(laws_folder())]
CHOSEN = ("CoulombFeedforward", "ElastoPlasticEstimator", "Dither", "GMSObserver")
"""Limits and a reset; take-over, rest and EXP; a function of its own; vectors, loops, and a choice in a sum."""
SAMPLES = 10_000 if THOROUGH else 2_500
EXACT = ("floor", "ceil", "fmod", "fma")  # functions of the text that have the bits of C; the others are replaced

Real = Literal["double", "float"]


class C:
    """The exported C with its structs."""

    def __init__(self, export: Export, folder: Path) -> None:
        """Compile it."""
        folder.mkdir(parents=True, exist_ok=True)
        (folder / f"{export.prefix}.h").write_text(header(export), encoding="utf-8")
        source = folder / f"{export.prefix}.c"
        source.write_text(implementation(export), encoding="utf-8")
        library = compile_(source)
        init, self._check, self._step = (getattr(library, f"{export.prefix}_{f}") for f in ("init", "check", "step"))
        number = ctypes.c_double if export.real.name == "double" else ctypes.c_float
        self.structs = {}
        for group, members in export.groups.items():
            fields: list[tuple[str, Any]] = []
            for v in members:
                kind: Any = ctypes.c_bool if is_flag(v) else number
                parts = [v.name, *([f"{v.name}_low"] if v.name in export.pairs else [])]
                fields += [(part, kind * len(v.starts) if v.kind in VECTORS else kind) for part in parts]
            self.structs[group] = type(group, (ctypes.Structure,), {"_fields_": fields or [("none", ctypes.c_uint8)]})()
        init(*map(ctypes.byref, self.structs.values()))

    def __call__(self) -> int:
        """One sample; return the number of the first violated rule."""
        self._step(*map(ctypes.byref, self.structs.values()))
        return int(self._check(ctypes.byref(self.structs["parameters"])))


def program_of(block: FunctionBlock) -> Program:
    """The function block; functions whose digits may differ are those of C."""
    kind = block.real.name
    inexact = [name for name in functions("LREAL") if name not in EXACT]
    replaced = {f"{block.prefix}_{name}": libm(name, kind) for name in inexact}
    return Program(structured_text(block), kind, replaced)


def rows(export: Export, n: int) -> np.ndarray:
    """What a sample reads at random: 2 % of the inputs NaN, infinite or huge, 1 % of the parameters out of range."""
    found = random_arguments(export.law, n, seed=11)
    random = np.random.default_rng(12)
    for i, v in enumerate(v for v in export.law.given for _ in v.starts):
        if not is_flag(v) and v.kind not in BOOLEANS and v in (*export.groups["inputs"], *export.groups["parameters"]):
            share = 0.01 if v.kind in PARAMETERS else 0.02
            chosen = random.random(n) < share / (len(v.starts) if v.kind in VECTORS else 1)
            found[chosen, i] = random.choice([math.nan, math.inf, -math.inf, 1e300, -1e308], chosen.sum())
    return found


def bits(value: Any) -> bytes:
    """The bits of a number, of any NaN the same."""
    return struct.pack("d", math.nan if math.isnan(value) else float(value))


def compare(export: Export, n: int, folder: Path) -> tuple[int, int]:
    """Run C and Structured Text over the same samples; return the numbers of samples with a fault and a violated rule.

    Every tenth sample begins with other states, and 20 samples keep their parameters.
    """
    block = function_block(export)
    law_in_c, plc = C(export, folder), Instance(program_of(block), export.prefix)
    single = export.real.name == "float"
    given = rows(export, n)
    labels = [(v, i) for v in export.law.given for i in range(len(v.starts))]
    shown = [(group, v) for group in ("states", "outputs") for v in export.groups[group]]
    faults = violations = 0
    for k, row in enumerate(given):
        for (v, element), value in zip(labels, row, strict=True):
            group = next(name for name, members in export.groups.items() if v in members)
            if (group == "states" and k % 10) or (group == "parameters" and k % 20):
                continue
            flag = is_flag(v)
            parts = [(v.name, block.names[v.name], bool(value) if flag else np.float32(value) if single else value)]
            if v.name in export.pairs:
                rest = value - float(np.float32(value))
                low = np.float32(rest if math.isfinite(rest) else 0.0)
                parts.append((f"{v.name}_low", f"{block.names[v.name]}_low", low))
            for in_c, in_st, part in parts:
                if v.kind in VECTORS:
                    getattr(law_in_c.structs[group], in_c)[element] = part
                    plc[in_st][element] = part
                else:
                    setattr(law_in_c.structs[group], in_c, part)
                    plc[in_st] = part if flag or single else float(part)
        violated = law_in_c()
        plc()
        assert plc["violated"] == violated
        for group, v in shown:
            for suffix in ("", "_low")[: 1 + (v.name in export.pairs)]:
                expected = getattr(law_in_c.structs[group], v.name + suffix)
                found = plc[block.names[v.name] + suffix]
                pairs = zip(expected, found, strict=True) if v.kind in VECTORS else [(expected, found)]
                for a, b in pairs:
                    assert bits(a) == bits(b), f"sample {k}: {v.name}{suffix} is {a!r} in C and {b!r} in the PLC"
        faults += law_in_c.structs["outputs"].fault
        violations += violated > 0
    return faults, violations


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("name", some(LAWS, CHOSEN))
def test_a_law_has_the_bits_of_c(name: str, tmp_path: Path) -> None:
    faults, violations = compare(make_export(name), SAMPLES, tmp_path)
    assert faults > 0
    assert violations > 0
