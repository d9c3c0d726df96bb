"""Ordinary runs of every block raise no floating-point exception: a host program may have enabled traps."""

from __future__ import annotations

import pytest
from shell.exchanging import each_kind, euler, need
from shell.instance import CO_SIMULATION, MODEL_EXCHANGE, Instance, Library, signals
from shell.selection import one_of_each
from shell.traps import no_traps


class Watched(Instance):
    """An instance of which no call may raise an exception."""

    def call(self, function: str, *arguments: object) -> int:
        """Call, and look at the flags."""
        with no_traps(function):
            return super().call(function, *arguments)


@one_of_each
@each_kind
def test_no_call_divides_by_zero_overflows_or_is_invalid(library: Library, kind: int) -> None:
    """At rest, in motion of either direction, with held inputs and reversals, and asked for derivatives."""
    need(library, kind)
    h, real, outputs = 1e-3, library.names("input", type="Real"), library.names("output", type="Real")
    with Watched(library, kind=kind) as run:
        run.initialise()
        if kind == MODEL_EXCHANGE:
            run.event()
            run.must("EnterContinuousTimeMode")
        for k, inputs in enumerate(signals(library, 3, 40)):
            values = inputs | (dict.fromkeys(real, 0.0) if k % 7 == 0 else {})
            if kind == CO_SIMULATION:
                run.set(values)
                run.input_derivatives({name: (0.0, -1.0, -2.0)[k % 3] / h * values[name] for name in real})
                run.step(k * h, h)
            else:
                euler(run, k * h, h, values)
            if k % 10 == 0:
                run.directional(outputs, dict.fromkeys(real, 1.0))
                if kind == CO_SIMULATION:
                    run.output_derivatives(*outputs)
            run.get(*library.variables)


@pytest.mark.parametrize("library", ["LuGre"], indirect=True)
def test_the_flags_are_seen(library: Library) -> None:
    with Instance(library) as run, pytest.raises(AssertionError, match="overflow"), no_traps():
        run.initialise()
        run.set({"v": 1e308})
        run.call("DoStep", 0.0, 0.1, 1)
