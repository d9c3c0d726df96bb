"""The start of a run: initialisation mode of all parts, with consistent values in all connections (FMI 2.0, 4.2.4)."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np

from harness.errors import AlgebraicLoopError, PartError
from harness.parts.guard import Guard
from harness.parts.part import Calls, Values
from harness.system.assembly import Assembly, start_values
from harness.system.experiment import Experiment
from harness.system.graph import direct_edges, find_loop, instantaneous, propagation_order
from harness.system.plan import Plan, fetcher
from harness.system.wire import split_name

_LOG = logging.getLogger("harness")
_TOLERANCE = 1e-10


def start_parts(plan: Plan, system: Assembly, experiment: Experiment, guard: Guard, *, open_end: bool) -> Plan:
    """Initialise all parts at the start time.

    Parameters
    ----------
    plan : Plan
        The plan of the run.
    system : Assembly
        The system.
    experiment : Experiment
        Settings of the run.
    guard : Guard
        Watches the parts.
    open_end : bool
        Whether the run may be continued later; the parts are then not told its stop time.

    Returns
    -------
    Plan
        The plan with the operations of the parts and the start values of all signals.

    Raises
    ------
    HarnessError
        If a part cannot be started or an algebraic loop has no solution.
    """
    part = None
    try:
        calls: list[Calls] = []
        names = list(plan.ports)
        for index, part in enumerate(plan.parts):
            # a part with a longer sample time may end its last step after the end of the run
            intervals = -(-plan.ticks // part.every)
            stop = np.inf if open_end else max(experiment.stop, plan.time(intervals * part.every))
            values = start_values(system, part.name)
            with guard.watching(part.name):
                part.enter_initialisation(experiment.start, stop, experiment.tolerance, values)
            inputs, outputs = slice(*plan.inputs[index]), slice(*plan.outputs[index])
            calls.append(
                part.bind(
                    [split_name(name)[1] for name in names[inputs]],
                    [split_name(name)[1] for name in names[outputs]],
                    plan.signals[inputs],
                    plan.signals[outputs],
                )
            )
        plan = replace(plan, calls=tuple(calls))
        _propagate(plan, system)
        guard.look()
        for part in plan.parts:
            with guard.watching(part.name):
                part.exit_initialisation()
        for call in plan.calls:
            call.get()
        guard.look()
    except PartError as error:
        if error.time is None:
            error.time = experiment.start
        raise
    return plan


def _propagate(plan: Plan, system: Assembly) -> None:
    """Propagate the start values through all connections until they settle.

    One sweep in graph order suffices, except for cycles of parts (a plant whose recorded acceleration depends on
    friction, which depends on its velocity) and for FMUs whose outputs depend on more inputs during initialisation than
    later. Algebraic loops are solved.
    """
    spread = _Sweep(plan, system)
    for call in plan.calls:
        call.get()
    if find_loop(direct_edges(system.parts, instantaneous(system.parts, system.wires))) is not None:
        spread.solve()
        return
    # a loop through a sampled part or a delay has no fixed point to converge to: one sweep gives its start values
    late_loop = find_loop(direct_edges(system.parts, system.wires)) is not None
    for _ in range(1 if late_loop else len(plan.parts) + 1):
        before = plan.signals.copy()
        spread()
        if np.array_equal(before, plan.signals, equal_nan=True):
            return
    if not late_loop:
        moving = [name for name, i in plan.columns.items() if before[i] != plan.signals[i]]
        _LOG.warning("the start values of %s do not settle: the first steps may be wrong", ", ".join(moving))


class _Sweep:
    """A sweep that sets and reads all parts once, in propagation order."""

    def __init__(self, plan: Plan, system: Assembly) -> None:
        self.plan = plan
        place = {part.name: index for index, part in enumerate(plan.parts)}
        self._order = [place[name] for name in propagation_order(system.parts, system.wires)]
        self._fetchers = [fetcher(plan, index) for index in range(len(plan.parts))]
        rank = {plan.parts[index].name: number for number, index in enumerate(self._order)}
        self._back = [
            wire
            for wire in instantaneous(system.parts, system.wires)
            if rank[wire.ends[0][0]] >= rank[wire.ends[1][0]] and plan.ports[wire.source].type == "Real"
        ]

    def __call__(self) -> None:
        for index in self._order:
            self._fetchers[index]()
            self.plan.calls[index].get()

    def solve(self) -> None:
        """Find values of the connections against the order that a sweep reproduces."""
        from scipy.optimize import root  # slow to import, and few systems need it

        signals = self.plan.signals
        places = sorted({self.plan.columns[wire.source] for wire in self._back})

        def residual(w: Values) -> Values:
            signals[places] = w
            self()
            return np.asarray(signals[places] - w)

        w = root(residual, signals[places].copy(), tol=1e-13).x
        rest = np.abs(residual(w))
        size = np.maximum(np.maximum(np.abs(signals[places]), np.abs(w)), 1e-300)
        missed = rest / size
        if not (missed <= _TOLERANCE).all():
            raise AlgebraicLoopError(
                f"no start values satisfy the algebraic loop through {', '.join(map(str, self._back))}: the best ones "
                f"have an error of {float(np.max(missed)):.2g} of their size; give other start values"
            )
        self()
