"""A run: start the parts, loop over the ticks, hand back what was recorded."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import replace
from time import monotonic

import numpy as np

from harness.assembly import Assembly
from harness.coupling import Coupling
from harness.errors import HarnessError, PartError
from harness.experiment import Experiment
from harness.graph import direct_edges, find_loop, propagation_order
from harness.layout import find_port, make_plan, recorded_names
from harness.loops import Loops
from harness.masters import find_master
from harness.native import NOT_CONVERGED, Engine
from harness.part import Calls
from harness.plan import Plan, Program, Schedule, fetcher
from harness.result import Result
from harness.tap import Progress, Reader, Recorder, Tap, tap_reader
from harness.wire import split_name

_LOG = logging.getLogger("harness")


def run(
    system: Assembly,
    experiment: Experiment,
    taps: Sequence[Tap] = (),
    progress: Progress | None = None,
    *,
    native: bool = True,
) -> Result:
    """Run a system.

    Parameters
    ----------
    system : Assembly
        What is run.
    experiment : Experiment
        How it is run.
    taps : sequence of Tap
        Functions that are shown values during the run.
    progress : Progress or None
        Told how far the run is.
    native : bool
        Whether the compiled engine runs the ticks, or Python does: slower, with the same results, explicit masters
        only, and for comparison.

    Returns
    -------
    xarray.Dataset
        The recorded variables, named "part.port", along ``time`` [s], with the start values in the first row.
        After a step stand the values at its end; for a sampled part those that it held during the step.

    Raises
    ------
    HarnessError
        If the run cannot be started or a part fails; what was recorded until then is in the ``result`` of the
        error.
    """
    master = find_master(experiment.master)
    names = recorded_names(system.parts, experiment.record)
    for tap in taps:
        for name in tap.names:
            find_port(system.parts, name, "tap")
    plan = make_plan(system, experiment, [*names, *(name for tap in taps for name in tap.names)])
    recorder = Recorder(plan, names, experiment.decimate)
    attributes: dict[str, str | float] = {
        "system": system.name,
        "master": experiment.master,
        "start": experiment.start,
        "stop": experiment.stop,
        "step": experiment.step,
    }
    try:
        plan = _start(plan, system, experiment)
        readers = [(tap.every, tap_reader(plan, tap)) for tap in taps]
        if progress is not None:
            readers.append(_progress_reader(progress, plan.ticks))
        for _, read in readers:
            read(0)
        if names:
            recorder.read(0)
        if native:
            attributes |= _run_native(plan, master(plan), recorder, readers)
        else:
            readers += [(experiment.decimate, recorder.read)] if names else []
            _loop(Program(plan, master(plan).operations), readers, plan.ticks)
        if progress is not None:
            progress.update(plan.ticks, plan.ticks)
    except HarnessError as error:
        if recorder.filled:
            error.result = recorder.result(attributes)
        raise
    finally:
        for part in plan.parts:
            part.terminate()
    result = recorder.result(attributes)
    _warn_of_nonfinite(result)
    return result


def _loop(advance: Callable[[int], None], readers: Sequence[tuple[int, Reader]], ticks: int) -> None:
    """The outermost loop: time is the integer ``tick`` and nothing else."""
    for tick in range(ticks):
        advance(tick)
        done = tick + 1
        for every, read in readers:
            if done % every == 0:
                read(done)


def _run_native(
    plan: Plan, schedule: Schedule, recorder: Recorder, readers: Sequence[tuple[int, Reader]]
) -> dict[str, str | float]:
    """The ticks in C, in pieces between the ticks that a reader wants to see, short enough for Ctrl-C.

    Returns
    -------
    dict
        What is to be known of the run, for the attributes of the result.
    """
    engine = Engine(plan, schedule.operations, recorder.rows, recorder.columns, recorder.decimate)
    implicit = Loops(engine, schedule) if schedule.tolerance > 0.0 else None
    coupling = None if implicit else Coupling(engine)
    engine.data.filled = recorder.filled
    tick, longest = 0, 100
    try:
        while tick < plan.ticks:
            ends = [tick + every - tick % every for every, _ in readers]
            end = min(plan.ticks, tick + longest, *ends)
            begin = monotonic()
            with engine.interruptible():
                engine.run(tick, end)
            if monotonic() - begin < 0.05:
                longest = min(2 * longest, 10_000_000)
            tick = end
            for every, read in readers:
                if tick % every == 0:
                    read(tick)
    except HarnessError:
        if implicit and engine.data.status == NOT_CONVERGED:
            raise implicit.failure(int(engine.data.failed_part), float(engine.data.failed_time)) from None
        raise
    finally:
        recorder.filled = int(engine.data.filled)
    return implicit.attributes() if implicit else coupling.report() if coupling else {}


def _start(plan: Plan, system: Assembly, experiment: Experiment) -> Plan:
    """Initialise all parts with consistent values at the start time, as FMI 2.0 wants it done (4.2.4)."""
    part = None
    try:
        calls: list[Calls] = []
        for index, part in enumerate(plan.parts):
            # A part that is stepped over several ticks may end its last step after the end of the run.
            intervals = -(-plan.ticks // part.every)
            stop = max(experiment.stop, plan.time(intervals * part.every))
            part.enter_initialisation(experiment.start, stop, experiment.tolerance, _start_values(system, part.name))
            inputs, outputs = slice(*plan.inputs[index]), slice(*plan.outputs[index])
            names = list(plan.ports)
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
        for part in plan.parts:
            part.exit_initialisation()
        for call in plan.calls:
            call.get()
    except PartError as error:
        if error.time is None:
            error.time = experiment.start
        raise
    return plan


def _start_values(system: Assembly, part: str) -> dict[str, float | int | bool | str]:
    ends = ((split_name(name), value) for name, value in system.start.items())
    return {port: value for (owner, port), value in ends if owner == part}


def _propagate(plan: Plan, system: Assembly) -> None:
    """Spread the start values through all wires until nothing changes any more.

    One sweep in graph order does it, but for rings of parts (a plant whose recorded acceleration depends on
    the friction that depends on its velocity) and for FMUs whose outputs depend on more inputs during
    initialisation than later.
    """
    position = {part.name: index for index, part in enumerate(plan.parts)}
    order = [position[name] for name in propagation_order(system.parts, system.wires)]
    fetchers = [fetcher(plan, index) for index in range(len(plan.parts))]
    for call in plan.calls:
        call.get()
    # A loop that is only closed by a sampler has no solution to converge to: one sweep is its start.
    sampled_loop = find_loop(direct_edges(system.parts, system.wires)) is not None
    for _ in range(1 if sampled_loop else len(order) + 1):
        before = plan.signals.copy()
        for index in order:
            fetchers[index]()
            plan.calls[index].get()
        if np.array_equal(before, plan.signals, equal_nan=True):
            return
    if not sampled_loop:
        moving = [name for name, i in plan.columns.items() if before[i] != plan.signals[i]]
        _LOG.warning("the start values of %s do not settle: the first steps may be wrong", ", ".join(moving))


def _progress_reader(progress: Progress, ticks: int) -> tuple[int, Reader]:
    return max(1, ticks // 100), lambda tick: progress.update(tick, ticks)


def _warn_of_nonfinite(result: Result) -> None:
    """A part may return NaN without any error; a result that contains it must not pass in silence."""
    for name, column in result.data_vars.items():
        bad = ~np.isfinite(column.to_numpy())
        if bad.any():
            first = float(result["time"].to_numpy()[np.argmax(bad)])
            _LOG.warning("%s is not finite from t = %.12g s on: check the inputs of that part", name, first)
