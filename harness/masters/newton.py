"""Newton: solves loops of continuous parts for their values at the end of the step.

Use it for stiff contacts and algebraic loops.

The coupling is the generalised-alpha method, which is of second order and damps components that are too stiff for the
step, see ``newton.h``. Sampled parts take their sample first. Parts that drive a loop are stepped once before it; parts
that read from it are stepped after it.
"""

import ctypes
import logging
from collections.abc import Sequence
from functools import partial
from graphlib import TopologicalSorter
from typing import Any, Final

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from harness.compiling.engine_library import bytes_of, library, mirror
from harness.engine.algorithm import Algorithm, attach_lines
from harness.engine.defect import UNRESOLVED, WRONG, contact_of, position_of, unit_of
from harness.engine.native import Engine
from harness.errors import ExperimentError
from harness.masters import Master
from harness.system.experiment import LOOP_TOLERANCE, STEP_TOLERANCE, Experiment
from harness.system.graph import state_outputs
from harness.system.plan import MovingWire, Plan, Schedule
from harness.system.wire import split_name
from harness.units import BaseUnit

_LOG = logging.getLogger("harness")

FINEST: Final = 512.0  # most inner steps per communication step of newton, where a check finds an error
FINEST_ADAPTIVE: Final = 1024.0  # largest number of inner steps per communication step in the master adaptive
ABANDONED: Final = 30.0  # remaining error over the magnitude of the value at which checks end, as in step_check.h


def _schedule(plan: Plan, experiment: Experiment) -> Schedule:
    """Solve every loop once per communication step, or in shorter inner steps where the step check requires it."""
    return implicit(experiment)


master = Master(_schedule, order=2.0, implicit=True, composed=True)


def implicit(experiment: Experiment, error: float = 0.0) -> Schedule:
    """Return the schedule of an implicit master with this coupling error; see `Loops`."""
    tolerance, step_tolerance = experiment.loop_tolerance or LOOP_TOLERANCE, experiment.step_tolerance or STEP_TOLERANCE
    return Schedule(
        algorithm=partial(Loops, tolerance=tolerance, error=error, step_tolerance=step_tolerance), implicit=True
    )


MOST_CARRIED: Final = 62
"""Contacts of a loop that the bits of a line can tell; a line that reads the force of another one is known without."""

OF_A_MASS: Final = 3
"""Most outputs without direct dependency of a single mass: position, velocity, and position of the support or force."""

Moving, Contact, Group, StateOutput = (mirror(name) for name in ("Moving", "Contact", "Group", "StateOutput"))
StepCheck, NewtonData = mirror("StepCheck"), mirror("Newton")


def groups_of(plan: Plan, wires: Sequence[MovingWire]) -> list[list[int]]:
    """Return the parts in stepping order, grouped by loop; a connection with a delay closes none."""
    n = len(plan.parts)
    prompt = [(wire.source, wire.target) for wire in wires if not plan.delays[wire.input]]
    links = np.array(prompt, dtype=np.int64).reshape(-1, 2)
    graph = coo_array((np.ones(len(links)), (links[:, 0], links[:, 1])), shape=(n, n))
    _, label = connected_components(graph, directed=True, connection="strong")
    before: dict[int, set[int]] = {}
    for part in range(n):  # sampled parts first, in the order of the plan
        before.setdefault(int(label[part]), set())
    for source, target in links:
        if label[source] != label[target]:
            before[int(label[target])].add(int(label[source]))
    moving = [part for part in range(n) if plan.parts[part].moves]
    order = list(TopologicalSorter({int(label[part]): before[int(label[part])] for part in moving}).static_order())
    still = [part for part in range(n) if not plan.parts[part].moves]
    sampled = [[part] for part in still if plan.parts[part].sampled]
    slow = [[part] for part in still if not plan.parts[part].sampled]
    return sampled + [[part for part in moving if label[part] == one] for one in order] + slow


def _held_inputs(plan: Plan, group: Sequence[int], wires: Sequence[MovingWire]) -> list[int]:
    """Return the connected Real inputs of parts that are held during a step."""
    lines = {wire.input for wire in wires}
    names = plan.names
    connected = [signal for part in group for signal in range(*(int(index) for index in plan.inputs[part]))]
    return [signal for signal in connected if signal not in lines and plan.ports[names[signal]].type == "Real"]


class Loops(Algorithm):
    """The data of an implicit master, attached to an engine."""

    def __init__(
        self, engine: Engine, tolerance: float, error: float = 0.0, step_tolerance: float = STEP_TOLERANCE
    ) -> None:
        plan = engine.plan
        ports, names, wires = plan.ports, plan.names, plan.moving_wires
        groups = groups_of(plan, wires)
        self.order = [part for group in groups for part in group]
        place = {part: index for index, part in enumerate(self.order)}
        self.lines = sorted(range(len(wires)), key=lambda line: place[wires[line].target])
        group_of = {part: number for number, group in enumerate(groups) for part in group}
        numbers: dict[int, int] = {}  # of the unknowns, by the output that each stands for
        self.rows: list[ctypes.Structure] = []
        self.held: list[int] = []
        first = first_line = 0
        inner = [
            wire for wire in wires if group_of[wire.source] == group_of[wire.target] and not plan.delays[wire.input]
        ]
        contacts = {
            part: contact for part in range(len(plan.parts)) if (contact := contact_of(plan, part, inner)) is not None
        }
        forces = {contact[1] for contact in contacts.values() if contact[2]}
        unsolved = {wire for wire in inner if place[wire.source] >= place[wire.target] or wire.output in forces}
        self.force_lines: set[int] = set()
        self.contacts: list[tuple[int, ...]] = []
        self.loads: list[int] = []
        self.states: list[tuple[int, int]] = []
        driving = {wire.output for wire in inner}
        compared = set(state_outputs({part.name: part for part in plan.parts}))
        for number, group in enumerate(groups):
            mine = [wire for wire in inner if group_of[wire.source] == number]
            begin = len(numbers)
            for wire in mine:
                if wire in unsolved:
                    numbers.setdefault(wire.output, len(numbers))
            held = _held_inputs(plan, group, wires) if plan.parts[group[0]].moves else []
            lines = [line for line, wire in enumerate(wires) if wire.target in group]
            row = (first, len(group), bool(mine), first_line, len(lines), begin, len(numbers) - begin)
            known = len(self.contacts)
            units: dict[BaseUnit | None, int] = {}  # 0: of the force of a contact
            for part in group:
                line, force, loads = contacts.get(part, (0, -1, []))
                if force in numbers:
                    own = plan.outputs[inner[line].source]
                    single = 0 < sum(names[signal] in compared for signal in range(*own)) <= OF_A_MASS
                    reads = part, wires.index(inner[line]), numbers[force], len(self.loads), len(loads)
                    position = position_of(plan, inner[line])
                    position = position if names[position] in compared else -1  # it may be recorded only
                    nth = len(self.contacts) - known
                    bit = 1 << nth if nth < MOST_CARRIED else 0
                    self.contacts.append((*reads, *(own if single else (0, 0)), position, bit))
                    self.loads += loads
                    self.force_lines |= {i for i in lines if wires[i].target == part and i != reads[1]}
                    self.force_lines |= {i for i in lines if wires[i] in unsolved and wires[i].output == force}
                    units[unit_of(ports[names[force]])] = 0
            units.pop(None, None)
            self.force_lines |= {i for i in lines if units.get(unit_of(ports[names[wires[i].output]])) == 0}
            states = [
                (signal, units.setdefault(unit_of(ports[names[signal]]), 1 + len(units)))
                for part in group
                if mine
                for signal in range(*plan.outputs[part])
                if signal not in driving and names[signal] in compared
            ]
            counts = len(self.held), len(held), known, len(self.contacts) - known, len(self.states), len(states)
            self.rows.append(Group(*row, *counts))
            self.states += states
            first, first_line = first + len(group), first_line + len(lines)
            self.held += held
            for part in group:
                if mine and not plan.parts[part].saves:
                    raise ExperimentError(
                        f"'{plan.parts[part].name}' is part of a loop and cannot save its state: "
                        "use the master gauss-seidel or jacobi"
                    )
        self.groups, self.plan = groups, plan
        self.unknowns, self.inner, self.wires = list(numbers), inner, wires
        self._engine, self._tolerance, self._error, self._step_tolerance = engine, tolerance, error, step_tolerance
        self.numbers = [numbers[wire.output] if wire in unsolved else -1 for wire in wires]

    def begin(self) -> None:
        """Begin a run at the start values of the plan."""
        engine, plan, rows = self._engine, self.plan, self.rows
        attach_lines(engine, self.wires)
        most = max((row.unknowns for row in rows), default=0)
        n = len(self.unknowns)
        names = ("w", "w_last", "trend", "scale", "lasting", "at_begin", "prediction_error", "growth")
        self._memory = {name: np.zeros(n) for name in names}
        self._memory |= {name: np.zeros(len(self.held)) for name in ("held_values", "held_sizes")}
        self._memory["state_sizes"] = np.zeros(len(self.states))
        self._memory["inverse"] = np.zeros((len(rows) * most, most))
        self._memory["proposed"], self._memory["before"] = np.zeros(len(rows)), np.zeros(len(rows))
        data = self.data = NewtonData()
        keep = engine.keep
        places = Moving * max(1, len(self.wires))
        self._arrays = (
            (Group * len(rows))(*rows),
            places(*(Moving(*row) for row in self.line_data())),
            (StepCheck * len(rows))(),
            places(),
        )
        data.groups, data.moving, data.guards, data.kept_lines = (ctypes.addressof(array) for array in self._arrays)
        data.kept = keep(np.zeros(6 * most + most * most + 3 * len(self.wires)))
        data.group_count = len(rows)
        for name in ("order", "lines", "unknowns", "contacts", "loads", "states", "held"):
            setattr(data, name, keep(np.array(getattr(self, name), dtype=np.int64)))
        data.continuous = keep(np.array([part.moves for part in plan.parts], dtype=np.int64))
        data.kept_states = keep(np.zeros(len(self.states)))
        for name, array in self._memory.items():
            setattr(data, name, keep(array))
        data.r, data.work = keep(np.zeros(n)), keep(np.zeros(7 * most + 2 * most * most))
        data.most_unknowns = most
        data.tolerance, data.error, data.step_tolerance = self._tolerance, self._error, self._step_tolerance
        data.finest = FINEST_ADAPTIVE if self._error > 0.0 else FINEST
        engine.advance_by("newton_tick", data)
        library().newton_begin(ctypes.addressof(engine.data), ctypes.addressof(data))

    def _carried(self) -> list[int]:
        """Return for each line the bits of the contacts whose forces reach it at once through other parts."""
        names, parts, contacts = self.plan.names, self.plan.parts, {row[0] for row in self.contacts}
        inner, after = set(self.inner), dict[int, list[int]]()
        for line, wire in enumerate(self.wires):
            if wire in inner:
                after.setdefault(wire.output, []).append(line)
        carried = [0] * len(self.wires)
        for group in self.rows:
            mine = self.contacts[group.contact : group.contact + min(group.contacts, MOST_CARRIED)]
            for _, _, unknown, *_, bit in mine:
                outputs = [self.unknowns[unknown]]
                for line in (line for output in outputs for line in after.get(output, ())):
                    wire, new = self.wires[line], not carried[line] & bit
                    carried[line] |= 0 if wire.output == outputs[0] else bit
                    if new and wire.target not in contacts:
                        direct, port = parts[wire.target].dependencies, split_name(names[wire.input])[1]
                        signals = range(*self.plan.outputs[wire.target])
                        outputs += [signal for signal in signals if port in direct[split_name(names[signal])[1]]]
        return carried

    def line_data(self) -> list[tuple[int, int, int, int]]:
        """Return the first numbers of `Moving` for each line."""
        inner, forces = set(self.inner), self.force_lines
        rows = enumerate(zip(self.wires, self.numbers, self._carried(), strict=True))
        return [(int(wire in inner), unknown, int(i in forces), carries) for i, (wire, unknown, carries) in rows]

    def memory(self) -> dict[str, np.ndarray[Any, Any]]:
        """Return the values kept from step to step for a checkpoint, as views of the data."""
        values = bytes_of(self._arrays[1]).reshape(-1, ctypes.sizeof(Moving))
        guards = bytes_of(self._arrays[2]).reshape(-1, ctypes.sizeof(StepCheck))
        places = {"moving": values[:, Moving.from_rest.offset :], "guards": guards[:, StepCheck.checks_due.offset :]}
        return {**self._memory, **places}  # without the indices of unknowns and lines

    def report(self) -> dict[str, str | float]:
        """Log a warning for each loop that no inner step resolved, and for loads that are not the whole load."""
        data, (_, moving, guards, _) = self.data, self._arrays
        checks = sum(int(guard.checks) for guard in guards)
        counts = {"evaluations": data.evaluations, "substeps": data.substeps, "rejected": data.rejected}
        errors = [
            max(*(part / whole if part > 0.0 else 0.0 for part, whole in pairs))
            for line in moving[: len(self.wires)]
            for pairs in [((line.accumulated_error, line.scale), (line.distance_error, line.path))]
        ]
        for guard in guards:
            if guard.abandoned:  # checks have ended; the magnitude may have grown with the error since
                errors[int(guard.line)] = max(errors[int(guard.line)], ABANDONED)
        worst = max(errors, default=0.0)
        if worst > UNRESOLVED:
            wire = self.wires[errors.index(worst)]
            names = list(self.plan.ports)
            group = next(number for number, parts in enumerate(self.groups) if wire.target in parts)
            _LOG.warning(
                "%s -> %s changes too fast for the step from t = %.6g s on: errors of %.2g of its size remain: %s; "
                "use a shorter step",
                names[wire.output],
                names[wire.input],
                guards[group].time,
                worst,
                WRONG,
            )
        for _, line, _, first, count, *_ in self.contacts:
            if moving[line].partial and count:
                _LOG.warning(
                    "%s is not the sum of the other forces on the mass, as its friction needs it at rest: the result "
                    "may be wrong; connect it to that sum, such as F_ext of Mass",
                    " or ".join(self.plan.names[load] for load in self.loads[first : first + count]),
                )
        return {**counts, "checks": checks, "unresolved_error": worst}

    def shown(self, number: int) -> str:
        """Return the connections of a loop as text."""
        names, group = self.plan.names, set(self.groups[number])
        return ", ".join(f"{names[wire.output]} -> {names[wire.input]}" for wire in self.inner if wire.target in group)

    def failure(self, number: int, time: float) -> ExperimentError:
        """Return the error for a loop that does not converge."""
        return ExperimentError(
            f"the loop {self.shown(number)} does not converge at t = {time:.12g} s, even with a millionth of the step: "
            f"its residual is {self.data.worst_residual:.2g} of the size of the values; look for a part whose outputs "
            "do not settle"
        )
