"""A run with the error of its result, from the same run with other steps."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from harness.accuracy.error_estimate import (
    NOTHING,
    REMEMBERED,
    VERDICTS,
    ErrorEstimate,
    Track,
    compare,
    converge,
    estimate,
    size_of,
    unbounded,
)
from harness.accuracy.measure_bounds import BOUND, floor_of, has_lines, order_of
from harness.accuracy.rungs import by_newton, repeated, scaled_tolerance, step_counts
from harness.engine.defect import are_power, inaccurate, unit_of
from harness.errors import ExperimentError, Interrupted
from harness.masters import find_master
from harness.parts.part import Part, Values
from harness.run import Options
from harness.system.assembly import Assembly
from harness.system.experiment import Experiment
from harness.system.graph import find_port, recorded_names
from harness.system.wire import Wire, wire_map

if TYPE_CHECKING:
    from harness.result import Result

MARGIN: Final = 0.8  # share of the required accuracy at which a suggestion aims
SHORTEST: Final = 4096  # largest quotient of present and suggested step: beyond, the order says nothing


def suggested_step(
    found: Sequence[ErrorEstimate], experiment: Experiment, required: float, floor: float
) -> float | None:
    """Return the step with which all variables have the required accuracy [s]."""
    # It is the present step over a whole number, so that sampled parts keep their sample times.
    if floor >= MARGIN * required:
        return None
    quotients = [1]
    for one in found:
        if one.verdict in {"within tolerance", "sensitive"}:
            continue
        if one.verdict != "step too long":
            return None
        excess = one.worst / (MARGIN * required)
        quotients.append(math.ceil(excess ** (1.0 / one.convergence.expected)))
    quotient = max(quotients)
    return experiment.step / quotient if 1 < quotient <= SHORTEST else None


@dataclass(frozen=True)
class Energy:
    """Energy that a pair of connections transfers over a run."""

    pair: tuple[Wire, Wire]
    """The connection of the force and that of the velocity, in opposite directions between two parts."""
    net: float
    passed: float
    """Integral of the power and of its magnitude [J]."""
    error: float  # bound of the error of the net energy at any time [J]

    @property
    def relative(self) -> float:
        """Error over the energy passed on."""
        return self.error / self.passed if self.passed > 0.0 else 0.0


def power_pairs(parts: Mapping[str, Part], wires: Sequence[Wire]) -> list[tuple[Wire, Wire]]:
    """Return the pairs of opposite connections between two parts whose values multiply to a power."""
    found = []
    for force in wires:
        for speed in wires:
            (source, _), (target, _) = force.ends
            if [speed.ends[0][0], speed.ends[1][0]] == [target, source] and are_power(
                *(find_port(parts, wire.source, "connection") for wire in (force, speed))
            ):
                found.append((force, speed))
    return found


def energy(
    parts: Mapping[str, Part],
    pair: tuple[Wire, Wire],
    forces: Sequence[Track],
    speeds: Sequence[Track],
    most: float,
    noise: float,
) -> Energy:
    """Return the energy that a pair transfers, with its error."""
    wire = pair[0]
    ports = [find_port(parts, name, "connection") for name in (wire.source, wire.target, pair[1].source)]
    gain, offset = wire_map(wire, ports[0], ports[1])
    units = [unit_of(port) for port in ports]
    scale = math.prod(unit.factor for unit in units[1:] if unit is not None)
    works: list[Track] = []
    passed = rows = 0.0
    for force, speed in zip(forces, speeds, strict=True):
        power = (scale * gain) * force.values
        power += scale * offset
        power *= speed.values
        work = _integral(force.row, power)
        if not works:
            rows = float(np.max(np.abs(_integral(2.0 * force.row, power[::2]) - work[::2])))  # of the integral itself
            passed = float(_integral(force.row, np.abs(power, out=power))[-1])
        works.append(replace(force, values=work))
    own = works[0]
    near, *further = (np.abs(np.subtract(*a.together(b)[1:])) for a, b in pairwise(works))
    far = further[0] if further else None
    how = converge(near, far, most, passed, noise * passed, finer=works[1].ratio < 1)
    largest = max(float(np.max(each)) for each in (near, *further))
    bound = how.factor * max(float(np.max(near)), REMEMBERED * largest) if how.resolved else 3.0 * largest
    return Energy(pair, float(own.values[-1]), passed, bound + rows)


def missed(track: Track, lines: bool, nominal: float) -> float:
    """Return how much of a value a connection misses between rows, over the range of the value (rms)."""
    # A held value misses what changes within a step, a value on a line what it is bent.
    change = np.diff(track.values, 2 if lines else 1)
    size = max(size_of(track.values), NOTHING * nominal)
    return math.sqrt(np.mean(np.square(change, out=change))) / size if size > 0.0 and len(change) else 0.0


def _integral(row: float, values: Values) -> Values:
    """Return the integral up to each row, where rows are ``row`` seconds apart."""
    found = np.zeros(len(values))
    np.add(values[1:], values[:-1], out=found[1:])
    found *= 0.5 * row
    return np.cumsum(found, out=found)


REQUIRED: Final = 0.01  # required accuracy relative to the range of each variable, unless another one is given


def run_with_accuracy(system: Assembly, experiment: Experiment, options: Options, required: float) -> "Result":
    """Run a system and estimate the error of the result."""
    if not 1e-12 <= required < 1.0:
        raise ExperimentError(f"the required accuracy is {required}: give a number from 1e-12 to below 1, such as 1e-3")
    names = recorded_names(system.parts, experiment.record)
    wires = [wire for wire in system.wires if _moves(system.parts, wire)]
    every = tuple(dict.fromkeys((*names, *(wire.source for wire in wires))))
    whole, runs = repeated(system, replace(experiment, record=every), options)
    most, floor = order_of(experiment), floor_of(system, experiment)
    result = whole[names].assign_attrs(
        required_accuracy=required, tolerance_error=floor.error, tolerance_source=floor.source
    )
    wrong = inaccurate(whole.attrs)
    if not runs:
        return result.assign_attrs(accuracy="invalid" if wrong else "not converged")

    def tracks(name: str) -> list[Track]:
        values = np.asarray(whole[name].to_numpy(), dtype=np.float64)
        stride = experiment.decimate
        own = Track(Fraction(1), Fraction(stride), experiment.start, experiment.step * stride, values)
        return [own, *(run.track(name) for run in runs)]

    found, bounds = {}, {}
    for name in names:
        nominal = find_port(system.parts, name, "record").nominal
        one = estimate(tracks(name), most=most, noise=floor.error, nominal=nominal, required=required)
        if wrong:  # which other steps cannot tell
            one = replace(one, verdict="invalid", bound=unbounded(len(one.bound)), relative=np.inf, shift=0.0)
        found[name] = one
    believed = [name for name in names if found[name].verdict == "within tolerance"]
    try:
        newton = by_newton(system, replace(experiment, record=tuple(believed)), runs) if believed else None
    except Interrupted as interrupted:
        interrupted.result = result
        raise
    if newton is not None:
        for name in believed:
            nominal = find_port(system.parts, name, "record").nominal
            found[name] = compare(found[name], tracks(name)[0], newton.track(name), nominal=nominal, required=required)
    uncertain = any(one.verdict == "not certain" for one in found.values())
    for name in names:
        bounds[name + BOUND] = _attach(result, name, found[name])
    result = result.assign(bounds)
    for pair in power_pairs(system.parts, wires) if not uncertain else ():
        each = energy(system.parts, pair, tracks(pair[0].source), tracks(pair[1].source), most, floor.error)
        if pair[0].source in found:
            result[pair[0].source].attrs |= {"energy": each.net, "energy_error": each.error}
    if wires:
        lines = has_lines(experiment)
        lost = {
            wire: missed(tracks(wire.source)[0], lines, find_port(system.parts, wire.source, "connection").nominal)
            for wire in wires
        }
        result.attrs["largest_coupling_error"] = str(max(lost, key=lambda wire: lost[wire]))
    divided = int(whole.attrs.get("rejected", 0)) > 0
    return result.assign_attrs(_conclusions(system, found, experiment, required, floor.error, divided=divided))


def _moves(parts: Mapping[str, Part], wire: Wire) -> bool:
    """Return whether a connection passes a Real value that may vary between samples."""
    (name, output), (target, _) = wire.ends
    port = next(port for port in parts[name].outputs if port.name == output)
    return port.type == "Real" and parts[name].moves and parts[target].moves


def _attach(result: "Result", name: str, one: ErrorEstimate) -> tuple[str, NDArray[np.float32], dict[str, str]]:
    """Attach its error to a variable of a result, and return the companion with the bound."""
    variable = result[name]
    variable.attrs |= {"relative_error": one.relative, "observed_order": one.convergence.order}
    variable.attrs |= {"verdict": one.verdict, "ancillary_variables": name + BOUND}
    if one.shift > 0.0:
        variable.attrs |= {"event_error": one.shift, "relative_event_error": one.relative_shift}
    if one.oscillation is not None:
        variable.attrs |= {"period": one.oscillation.period, "period_error": one.oscillation.period_error}
        variable.attrs |= {"amplitude": one.oscillation.amplitude}
        variable.attrs |= {"amplitude_error": one.oscillation.amplitude_error}
    about = {"units": variable.attrs.get("units"), "description": f"error bound of {name}"}
    return "time", one.bound, {key: text for key, text in about.items() if text}


def _conclusions(
    system: Assembly,
    found: Mapping[str, ErrorEstimate],
    experiment: Experiment,
    required: float,
    floor: float,
    *,
    divided: bool,
) -> dict[str, Any]:
    """Return the worst verdict, and the step that is better; the pieces of divided steps shrink with it."""
    attributes: dict[str, Any] = {
        "accuracy": max((one.verdict for one in found.values()), key=VERDICTS.index, default=VERDICTS[0])
    }
    step = suggested_step([*found.values()], experiment, required, floor)
    if step is not None:
        attributes["suggested_step"] = step
        shrunk = {"coupling_tolerance": find_master(experiment.master).adapts, "step_tolerance": divided}
        for name in (each for each, shrinks in shrunk.items() if shrinks):
            attributes[f"suggested_{name}"] = scaled_tolerance(experiment, name, step / experiment.step)
        if step_counts(system, experiment):
            attributes["suggested_factor"] = round(experiment.step / step)
    return attributes
