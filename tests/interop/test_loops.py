"""The loops that the importers run: every block is in one, wired, and something happens there."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import numpy as np
import pytest
from interop.loops import Loop, closed_loop, ports
from shell.selection import ONE_OF_EACH
from thorough import nightly, some

from friction_fmus import catalogue


@pytest.mark.parametrize("block", some(tuple(catalogue()), ONE_OF_EACH))
def test_a_block_is_wired_into_a_closed_loop(block: str, build_fmu: Callable[..., Path]) -> None:
    loop = closed_loop(block, build_fmu)
    part = next(part for part, fmu in loop.fmus.items() if fmu == build_fmu(block))
    drives = [target for source, target in loop.wires if source.startswith(f"{part}.")]
    driven = [target for _, target in loop.wires if target.startswith(f"{part}.")]
    assert drives
    assert driven or set(ports(build_fmu(block), "input")) <= {"f", "enable", "reset"}  # Dither, and the references
    follows: dict[str, set[str]] = {}
    for source, target in loop.wires:
        follows.setdefault(target.split(".")[0], set()).add(source.split(".")[0])
    with pytest.raises(CycleError):
        TopologicalSorter(follows).prepare()


@nightly
def test_every_loop_moves(loops: Mapping[str, Loop]) -> None:
    for block, loop in loops.items():
        moving = [name for name, values in loop.jacobi.items() if np.ptp(values) > 1e-9]
        assert len(moving) > len(loop.fmus), block
