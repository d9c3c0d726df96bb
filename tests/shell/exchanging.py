"""Instances of either kind, begun and driven by one interface."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from ctypes import c_double, c_int

import pytest
from shell.instance import CO_SIMULATION, ERROR, MODEL_EXCHANGE, Instance, Library, drive

KINDS = {CO_SIMULATION: "co-simulation", MODEL_EXCHANGE: "model exchange"}
each_kind = pytest.mark.parametrize("kind", KINDS, ids=KINDS.get)

SITUATIONS = {
    "co-simulation": CO_SIMULATION,
    "continuous-time mode": MODEL_EXCHANGE,
    "event mode": MODEL_EXCHANGE,
}
"""Where a run can be between two steps, and the kind of the FMU."""


def need(library: Library, kind: int) -> None:
    """Skip the test for a block that is not of this kind."""
    if kind == MODEL_EXCHANGE and not library.exchanges:
        pytest.skip("the block is for co-simulation only")


def begin(
    run: Instance,
    kind: int,
    start: float = 0.0,
    tolerance: float | None = None,
    stop: float | None = None,
    **values: float,
) -> Instance:
    """From instantiated to step complete or to continuous-time mode."""
    run.initialise(start, tolerance, stop, **values)
    if kind == MODEL_EXCHANGE:
        run.event()
        run.must("EnterContinuousTimeMode")
    return run


def vectors(run: Instance) -> list[float]:
    """Derivatives and event indicators."""
    library = run.library
    return run.vector("GetDerivatives", library.states) + run.vector("GetEventIndicators", library.indicators)


def euler(run: Instance, t: float, h: float, values: Mapping[str, float]) -> None:
    """From continuous-time mode at t: an event with these inputs, and a step of Euler's method."""
    n = run.library.states
    run.must("EnterEventMode")
    run.set(values)
    run.event()
    run.must("EnterContinuousTimeMode")
    moved = [x + h * slope for x, slope in zip(run.vector("GetContinuousStates", n), vectors(run), strict=False)]
    run.must("SetTime", t + h)
    run.must("SetContinuousStates", (c_double * n)(*moved), n)
    run.must("CompletedIntegratorStep", 1, c_int(), c_int())


def go_on(run: Instance, situation: str, inputs: Iterable[Mapping[str, float]], t: float, h: float) -> list[bytes]:
    """`shell.instance.drive` for either kind; from event mode, its event comes first."""
    if situation == "co-simulation":
        return drive(run, inputs, t, h)
    if situation == "event mode":
        run.event()
        run.must("EnterContinuousTimeMode")
    trajectory = []
    for values in inputs:
        euler(run, t, h, values)
        t += h
        trajectory.append(run.everything())
    return trajectory


def go_to(run: Instance, situation: str) -> None:
    """From where `begin` and `go_on` end."""
    if situation == "event mode":
        run.must("EnterEventMode")


def refused_with_a_message(run: Instance, function: str, *arguments: object) -> bool:
    """Whether a call is an error, is logged once, and leaves the state as it was."""
    before = run.serialised()
    run.messages.clear()
    status = run.call(function, *arguments)
    return status == ERROR and len(run.messages) == 1 and run.serialised() == before
