"""A run with the error of its result, from the same run with other steps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from harness.accuracy.connections import energy, missed, power_pairs
from harness.accuracy.estimate import VERDICTS, Estimate, Track, estimate, unbounded
from harness.accuracy.numbers import BOUND
from harness.accuracy.repeat import repeated
from harness.accuracy.rungs import scaled_step_tolerance, scaled_tolerance, step_counts
from harness.accuracy.suggestion import suggested_step
from harness.accuracy.tolerances import floor_of, has_lines, order_of
from harness.engine.defect import inaccurate
from harness.errors import ExperimentError
from harness.parts.part import Part
from harness.result import Result
from harness.run import Options
from harness.system.assembly import Assembly
from harness.system.experiment import Experiment
from harness.system.layout import find_port, recorded_names
from harness.system.wire import Wire

REQUIRED: Final = 0.01
"""Required accuracy relative to the range of each variable, unless another one is given."""


def run_with_accuracy(system: Assembly, experiment: Experiment, options: Options, required: float) -> Result:
    """Run a system and tell how far the result is off."""
    check_required(required)
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
        return result.assign_attrs(accuracy="wrong" if wrong else "not resolved")

    def tracks(name: str) -> list[Track]:
        values = np.asarray(whole[name].to_numpy(), dtype=np.float64)
        stride = experiment.decimate
        own = Track(Fraction(1), Fraction(stride), experiment.start, experiment.step * stride, values)
        return [own, *(run.track(name) for run in runs)]

    found, bounds = {}, {}
    for name in names:
        nominal = find_port(system.parts, name, "record").nominal
        one = estimate(tracks(name), most=most, noise=floor.error, nominal=nominal, required=required)
        found[name] = replace(one, verdict="wrong", **_unbounded(one)) if wrong else one
        bounds[name + BOUND] = _attach(result, name, found[name])
    result = result.assign(bounds)
    for pair in power_pairs(system.parts, wires):
        each = energy(system.parts, pair, tracks(pair[0].source), tracks(pair[1].source), most, floor.error)
        if pair[0].source in found:
            result[pair[0].source].attrs |= {"energy": each.net, "energy_error": each.error}
    if wires:
        lines = has_lines(experiment)
        lost = {wire: missed(tracks(wire.source)[0], lines, _nominal(system, wire)) for wire in wires}
        result.attrs["largest_coupling_error"] = str(max(lost, key=lambda wire: lost[wire]))
    divided = int(whole.attrs.get("rejected", 0)) > 0
    return result.assign_attrs(_conclusions(system, found, experiment, required, floor.error, divided=divided))


def check_required(required: float) -> None:
    """Raise an error if an accuracy cannot be required."""
    if not 1e-12 <= required < 1.0:
        raise ExperimentError(f"the required accuracy is {required}: give a number from 1e-12 to below 1, such as 1e-3")


def _unbounded(estimate: Estimate) -> dict[str, Any]:
    """Return the bound of a result that is known to be wrong, which other steps cannot tell."""
    return {"bound": unbounded(len(estimate.bound)), "relative": np.inf, "shift": 0.0}


def _moves(parts: Mapping[str, Part], wire: Wire) -> bool:
    """Return whether a connection passes a Real value that may vary between samples."""
    (name, output), (target, _) = wire.ends
    port = next(port for port in parts[name].outputs if port.name == output)
    return port.type == "Real" and parts[name].moves and parts[target].moves


def _nominal(system: Assembly, wire: Wire) -> float:
    return find_port(system.parts, wire.source, "connection").nominal


def _attach(result: Result, name: str, one: Estimate) -> tuple[str, NDArray[np.float32], dict[str, str]]:
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
    found: Mapping[str, Estimate],
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
        if experiment.master == "adaptive":
            attributes["suggested_coupling_tolerance"] = scaled_tolerance(experiment, step / experiment.step)
        if divided:
            attributes["suggested_step_tolerance"] = scaled_step_tolerance(experiment, step / experiment.step)
        if step_counts(system, experiment):
            attributes["suggested_factor"] = round(experiment.step / step)
    return attributes
