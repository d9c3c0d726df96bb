"""The figures of a block as experiments that a page repeats with other parameters."""

from __future__ import annotations

import base64
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from friction_fmus.blocks.catalogue import Block
from friction_fmus.blocks.probe import BlockVariables
from friction_fmus.export.block_fmu import describe_block
from harness.errors import HarnessError
from harness.parts.fmu import FmuPart
from portraits.by_ports import Bench, BenchRun, elastic_reach, friction_panels, speed_scale
from portraits.chart import Curve, Panel, Vector
from portraits.experiments import BEGIN, FURTHER, idle, shown


@dataclass
class Course:
    """A run: its times, and the inputs and outputs at these times."""

    times: list[float]
    inputs: list[Mapping[str, float]] = field(default_factory=list)
    outputs: list[list[float]] = field(default_factory=list)
    names: tuple[str, ...] = ()
    fixed: Mapping[str, float] = field(default_factory=dict)


class _RecordedRun(BenchRun):
    """A session that keeps what it is given and what it returns."""

    def __init__(self, course: Course, *given: Any) -> None:
        super().__init__(*given)
        self.course = course

    def put(self, inputs: Mapping[str, float]) -> None:
        self._given = dict(inputs)
        super().put(inputs)

    def step(self, time: float, length: float) -> list[float]:
        self.course.inputs.append(self._given)
        self.course.times.append(time + length)
        return super().step(time, length)

    def values(self) -> list[float]:
        found = super().values()
        self.course.outputs.append(found)
        return found


class RecordedBench(Bench):
    """A test bench that records its runs."""

    def __init__(self, block: Block, description: BlockVariables, part: FmuPart) -> None:
        """Begin without runs."""
        super().__init__(block, description, part)
        self.description = description
        self.courses: list[Course] = []
        self.values = self.begin = BEGIN.get(block.name, {})

    @contextmanager
    def changed(self, values: Mapping[str, float]) -> Iterator[None]:
        """Run the block with other parameters."""
        before = self.values
        self.values = {**before, **values}
        try:
            yield
        finally:
            self.values = before

    @contextmanager
    def session(self, outputs: Sequence[str], start: float = 0.0) -> Iterator[BenchRun]:
        """Open a run and record it."""
        fixed = {name: value for name, value in self.values.items() if self.begin.get(name) != value}
        self.courses.append(Course([start], names=tuple(outputs), fixed=fixed))
        self.kind = partial(_RecordedRun, self.courses[-1])
        with super().session(outputs, start) as session:
            yield session


@contextmanager
def opened(block: Block, fmu: Path) -> Iterator[RecordedBench]:
    """Open the FMU of a block on a test bench."""
    part = FmuPart(block.name, fmu)
    try:
        yield RecordedBench(block, describe_block(block), part)
    finally:
        part.close()


def recorded_figures(bench: RecordedBench) -> dict[str, Any]:
    """Return the experiments behind the figures of a block, for JSON.

    Friction that follows a velocity is moved by the page itself, which needs only the scales ``speed`` and ``reach`` of
    the start values [m/s, m]. ``figures`` has all others: the inputs of each run and the places of the curves in its
    inputs and outputs. ``begin`` has the values with which the page begins, if they are not the start values, and
    ``idle`` the names that have no effect in these figures.
    """
    chosen = shown(bench)
    if chosen is None:
        return {}
    told: dict[str, Any] = {"begin": bench.begin, "idle": idle(bench.block)}
    experiments = [each for each in (chosen, FURTHER.get(bench.block.name)) if each]
    try:
        if chosen is friction_panels:
            peak = 4.0 * speed_scale(bench)
            told |= {"speed": peak, "reach": elastic_reach(bench, peak / 100.0) or 1e-3 * peak}
            experiments.remove(chosen)
        panels = [panel for each in experiments for panel in each(bench)]
    except HarnessError:
        return {}
    figures = [_figure(panel, bench.courses) for panel in panels]
    return told | {"figures": [figure for figure in figures if figure]}


def _figure(panel: Panel, courses: Sequence[Course]) -> dict[str, Any] | None:
    """Return a figure, or None if its curves are not columns of runs."""
    curves = [_found(curve, courses) for curve in panel.curves]
    if not all(curves):
        return None
    used = sorted({curve["run"] for curve in curves if curve and "run" in curve})
    return {
        "x": panel.x,
        "y": panel.y,
        "caption": panel.caption,
        "curves": [{**curve, "run": used.index(curve.get("run", used[0]))} for curve in curves if curve],
        "runs": [_run(courses[k]) for k in used],
    }


def _found(curve: Curve, courses: Sequence[Course]) -> dict[str, Any] | None:
    about = {"label": curve.label, "aside": curve.aside}
    for number, course in enumerate(courses):
        columns = _columns(course)
        y = _place(curve.y, {name: values for name, values in columns.items() if curve.aside or name in course.names})
        if y is not None:
            x = _place(curve.x, columns)
            return {**about, "run": number, "x": _packed(curve.x) if x is None else x, "y": y}
    return {**about, "x": _packed(curve.x), "y": _packed(curve.y)} if curve.aside else None


def _columns(course: Course) -> dict[str, Vector]:
    inputs = {name: [row[name] for row in course.inputs] for name in (course.inputs[0] if course.inputs else {})}
    outputs = dict(zip(course.names, np.array(course.outputs).T, strict=True))
    return {"time": np.array(course.times), **{k: np.array(v) for k, v in inputs.items()}, **outputs}


def _place(values: Vector, columns: Mapping[str, Vector]) -> dict[str, Any] | None:
    """Return where these values are: the name of a column, and the first row."""
    for name, column in columns.items():
        for first in range(column.size - values.size + 1):
            if np.array_equal(column[first : first + values.size], values):
                return {"name": name, "from": first, "count": values.size}
    return None


def _run(course: Course) -> dict[str, Any]:
    columns = _columns(course)
    given = {name: columns[name] for name in (course.inputs[0] if course.inputs else {})}
    lengths = np.diff(course.times)
    equal = np.allclose(lengths, lengths[0], rtol=1e-6)
    return {
        "step": lengths[0] if equal else _packed(lengths),
        "steps": lengths.size,
        "outputs": course.names,
        "fixed": course.fixed,
        "inputs": {name: _packed(np.append(column, column[-1])) for name, column in given.items()},
    }


def _packed(values: Vector) -> Any:
    """Return a number for equal values, else 64-bit floating-point numbers in base64."""
    if np.all(values == values[0]):
        return float(values[0])
    return base64.b64encode(np.asarray(values, "<f8").tobytes()).decode()
