"""The start of a run: initialisation mode of all parts, with consistent values in all connections (FMI 2.0, 4.2.4)."""

import ctypes
import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from harness.compiling.engine_library import RESIDUAL, library
from harness.errors import AlgebraicLoopError, PartError
from harness.parts.guard import Guard
from harness.parts.part import Part, StartValue, Values
from harness.system.assembly import Assembly, start_values
from harness.system.experiment import Experiment
from harness.system.graph import direct_edges, find_loop, instantaneous, propagation_order
from harness.system.plan import Plan, fetcher
from harness.system.wire import Wire, split_name

_Values: TypeAlias = NDArray[np.float64]
_Numbers: TypeAlias = "ctypes._Pointer[ctypes.c_double]"


def fixed_point(residual: Callable[[_Values], _Values], estimate: _Values) -> _Values:
    """Return the w with the smallest residual that Newton's method finds, see ``fixed_point.h``."""
    n = len(estimate)
    engine = library()
    w, work, norm = estimate.copy(), np.zeros(engine.fixed_point_work(n)), np.zeros(1)
    errors: list[BaseException] = []

    def evaluate(_: int | None, at: _Numbers, result: _Numbers) -> bool:
        try:
            np.ctypeslib.as_array(result, (n,))[:] = residual(np.ctypeslib.as_array(at, (n,)).copy())
        except BaseException as error:  # it must not be raised in C
            errors.append(error)
            return False
        return True

    engine.find_fixed_point(RESIDUAL(evaluate), None, w.ctypes.data, n, work.ctypes.data, norm.ctypes.data)
    if errors:
        raise errors[0]
    return w


_LOG = logging.getLogger("harness")
_TOLERANCE = 1e-10


@dataclass(frozen=True)
class StartOrder:
    """How start values spread through the connections."""

    order: tuple[int, ...]  # the parts in the order in which values spread
    roots: tuple[int, ...]  # outputs whose values the algebraic loops determine, as indices of signals
    is_loop: bool  # whether there is an algebraic loop
    is_late_loop: bool  # whether there is one through a sampled part or a delay
    loop: str  # the connections of the algebraic loops


def start_order(plan: Plan, parts: Mapping[str, Part], wires: Sequence[Wire]) -> StartOrder:
    """Return how start values spread through these parts, which the plan contains."""
    wires = [wire for wire in wires if wire.initial is None]
    closing = instantaneous(parts, wires)
    place = {part.name: index for index, part in enumerate(plan.parts)}
    order = [place[name] for name in propagation_order(parts, wires)]
    rank = {plan.parts[index].name: number for number, index in enumerate(order)}
    back = [
        wire
        for wire in closing
        if rank[wire.ends[0][0]] >= rank[wire.ends[1][0]] and plan.ports[wire.source].type == "Real"
    ]
    return StartOrder(
        tuple(order),
        tuple(sorted({plan.columns[wire.source] for wire in back})),
        find_loop(direct_edges(parts, closing)) is not None,
        find_loop(direct_edges(parts, wires)) is not None,
        ", ".join(map(str, back)),
    )


class Initialisation:
    """The start of the runs of a plan."""

    def __init__(self, plan: Plan, system: Assembly, experiment: Experiment, guard: Guard, *, open_end: bool) -> None:
        parts, wires = system.parts, system.wires
        self._plan, self._experiment, self._guard, self._open_end = plan, experiment, guard, open_end
        self._values = start_order(plan, parts, wires)
        names = [split_name(name)[1] for name in plan.names]
        self._bound = [
            (names[slice(*inputs)], names[slice(*outputs)])
            for inputs, outputs in zip(plan.inputs, plan.outputs, strict=True)
        ]

    def start(self, values: Mapping[str, StartValue]) -> None:
        """Initialise all parts at the start time; the start values then stand in the signals of the plan."""
        # A part that begins the run with the instance of an earlier run of this plan keeps its calls.
        plan, guard = self._plan, self._guard
        earlier, plan.calls[:] = [*plan.calls], []
        plan.begin(values)
        try:
            for index, part in enumerate(plan.parts):
                with guard.watching(part.name):
                    self._enter(index, values)
                if index < len(earlier) and part.instance is not None and earlier[index].instance is part.instance:
                    plan.calls.append(earlier[index])
                    continue
                inputs, outputs = self._bound[index]
                values_in, values_out = (
                    plan.signals[slice(*ports)] for ports in (plan.inputs[index], plan.outputs[index])
                )
                plan.calls.append(part.bind(inputs, outputs, values_in, values_out))
            self._propagate()
            guard.look()
            for part in plan.parts:
                with guard.watching(part.name):
                    part.exit_initialisation()
            for call in plan.calls:
                call.get()
            guard.look()
        except PartError as error:
            if error.time is None:
                error.time = self._experiment.start
            raise

    def _enter(self, index: int, values: Mapping[str, StartValue]) -> None:
        plan, experiment, part = self._plan, self._experiment, self._plan.parts[index]
        # a part with a longer sample time may end its last step after the end of the run
        intervals = -(-plan.ticks // part.every)
        stop = np.inf if self._open_end else max(experiment.stop, plan.time(intervals * part.every))
        part.enter_initialisation(experiment.start, stop, experiment.tolerance, start_values(values, part.name))

    def _propagate(self) -> None:
        """Propagate the start values through all connections until they settle."""
        # One sweep in graph order suffices, except for cycles of parts (a plant whose recorded acceleration depends on
        # friction, which depends on its velocity) and for FMUs whose outputs depend on more inputs during
        # initialisation than later. Algebraic loops are solved.
        plan = self._plan
        fetchers = [fetcher(plan, index) for index in range(len(plan.parts))]

        def spread() -> None:
            """Set and read all parts once, in propagation order."""
            for index in self._values.order:
                fetchers[index]()
                plan.calls[index].get()

        for call in plan.calls:
            call.get()
        if self._values.is_loop:
            self._solve(spread)
            return
        # a loop through a sampled part or a delay has no fixed point to converge to: one sweep gives its start values
        for _ in range(1 if self._values.is_late_loop else len(plan.parts) + 1):
            before = plan.signals.copy()
            spread()
            if np.array_equal(before, plan.signals, equal_nan=True):
                return
        if not self._values.is_late_loop:
            moving = [name for name, i in plan.columns.items() if before[i] != plan.signals[i]]
            _LOG.warning("the start values of %s do not settle: the first steps may be wrong", ", ".join(moving))

    def _solve(self, spread: Callable[[], None]) -> None:
        """Find values of the connections against the order that a sweep reproduces."""
        signals = self._plan.signals
        places = list(self._values.roots)

        def residual(w: Values) -> Values:
            signals[places] = w
            spread()
            return np.asarray(signals[places] - w)

        w = fixed_point(residual, signals[places].copy())
        rest = np.abs(residual(w))
        size = np.maximum(np.maximum(np.abs(signals[places]), np.abs(w)), 1e-300)
        missed = rest / size
        if not (missed <= _TOLERANCE).all():
            raise AlgebraicLoopError(
                f"no start values satisfy the algebraic loop through {self._values.loop}: the best ones "
                f"have an error of {float(np.max(missed)):.2g} of their size; give other start values"
            )
        spread()
