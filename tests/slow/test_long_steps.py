"""Steps so long that they may take too much work: they are discarded within seconds, with the reason."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest
from shell.instance import DISCARD, OK, WARNING, Instance, Library, load, signals
from thorough import nightly

from friction_fmus import catalogue

COUNTING = tuple(name for name, block in catalogue().items() if re.search(r"\bCOUNT\s*\(", block.code))
"""Blocks with parameters that are numbers of something."""

REASON = b"exceeds the limit of work in one communication step; use shorter steps"
SECONDS = 5.0

COSTLY: tuple[tuple[str, float, dict[str, float]], ...] = (
    ("FrenkelKontorova", 1e6, {}),
    ("FrenkelKontorova", 1e6, {"N": 1000, "F_drive": 0.3}),
    ("FrenkelKontorova", 1e3, {"damping": 1e4}),
    ("FrenkelKontorova", 1e300, {"damping": 0.0, "amplitude": 0.3}),
    ("FrenkelKontorovaTomlinson", 1e6, {"v": 1e-3}),
    ("FrenkelKontorovaTomlinson", 1e6, {"N": 1000, "v": 1.0}),
    ("BurridgeKnopoff", 1e6, {}),
    ("BurridgeKnopoff", 1e6, {"N": 1000, "v": 1.0}),
    ("BurridgeKnopoff", 1e6, {"sigma": 0.999, "nu": 1.0}),
    ("PrandtlTomlinson", 1e6, {"v": 1e-2}),
    ("PrandtlTomlinson", 1e9, {"v": 1.0}),
    ("PrandtlTomlinson", 1e5, {"kT": 0.1}),
    ("PrandtlTomlinson", 1e6, {"kT": 0.1, "damping": 0.0}),
    ("Bristle", 1e6, {"v": 1e-2}),
    ("Bristle", 1e6, {"v": 1e-2, "N": 1000}),
    ("GenericAsperity", 1e6, {"v": 1e-2}),
    ("GenericAsperity", 1e3, {"v": 1e-3, "height": 0.0}),
)


def largest_counts(library: Library) -> dict[str, float]:
    """The parameters that are numbers of something, at their maxima."""
    counts = (v for v in library.variables.values() if v.causality == "parameter" and v.type == "Integer")
    return {v.name: float(v.max) for v in counts if v.max is not None and float(v.max) <= 1e6}


def long_step(library: Library, h: float, counts: Mapping[str, float]) -> None:
    """A step within the time that the block promises: done, or refused with the reason."""
    with Instance(library) as run:
        run.setup()
        run.must("EnterInitializationMode")
        run.set(counts)
        run.must("ExitInitializationMode")
        run.set(signals(library, 1, 1)[0])
        before, begin = run.everything(), time.process_time()
        status = run.call("DoStep", 0.0, h, 1)
        assert time.process_time() - begin < SECONDS
        assert status in (OK, WARNING, DISCARD)
        if status == DISCARD:
            assert b"step" in run.messages[-1][-1]
            assert run.everything() == before


@nightly
@pytest.mark.parametrize("h", [1e3, 1e6, 1e300])
def test_no_step_takes_longer_than_five_seconds(library: Library, h: float) -> None:
    long_step(library, h, {})


@nightly
@pytest.mark.parametrize("h", [1e3, 1e6, 1e300])
@pytest.mark.parametrize("library", COUNTING, indirect=True)
def test_no_step_with_the_largest_counts_takes_longer_than_five_seconds(library: Library, h: float) -> None:
    long_step(library, h, largest_counts(library))


@nightly
@pytest.mark.parametrize(("name", "h", "values"), COSTLY, ids=lambda value: str(value))
def test_a_step_that_takes_too_long_is_discarded_with_the_reason(
    build_fmu: Callable[..., Path], name: str, h: float, values: dict[str, float]
) -> None:
    with Instance(load(build_fmu(name))) as run:
        run.initialise(**values)
        run.step(0.0, 0.01)
        before, state = run.everything(), run.serialised()
        begin = time.process_time()
        assert run.call("DoStep", 0.01, h, 1) == DISCARD
        assert time.process_time() - begin < SECONDS
        assert REASON in run.messages[-1][-1]
        assert run.everything() == before
        run.restore(state)
        run.step(0.01, 0.01)
