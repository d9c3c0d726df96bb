"""The start of a run: all parts in initialisation mode, with consistent values in all wires (FMI 2.0, 4.2.4)."""

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
        What is run.
    experiment : Experiment
        How.
    guard : Guard
        Watches them.
    open_end : bool
        The parts are not told when the run ends, because it may be continued.

    Returns
    -------
    Plan
        The plan with the calls of the parts; the start values stand in its signals.

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
            # A part that is stepped over several ticks may end its last step after the end of the run.
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
    """Spread the start values through all wires until nothing changes any more.

    One sweep in graph order does it, but for rings of parts (a plant whose recorded acceleration depends on
    the friction that depends on its velocity) and for FMUs whose outputs depend on more inputs during
    initialisation than later. An algebraic loop is solved.
    """
    spread = _Sweep(plan, system)
    for call in plan.calls:
        call.get()
    if find_loop(direct_edges(system.parts, instantaneous(system.parts, system.wires))) is not None:
        spread.solve()
        return
    # A loop that is only closed by a sampler or a delay has no solution to converge to: one sweep is its start.
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
    """Sets and reads all parts once, in the order in which values spread."""

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
        """Find the values of the wires against the order for which a sweep gives the same values again."""
        from scipy.optimize import root  # takes long to import, and few systems need it

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
                f"no values at the start satisfy the algebraic loop through {', '.join(map(str, self._back))}: the "
                f"best ones miss by {float(np.max(missed)):.2g} of their size; give other start values"
            )
        self()
