"""What to set in the drive and what to measure after a study: sentences, and the reference of the next record."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from friction_fmus.axis.loop_assembly import with_friction
from friction_fmus.axis.servo import GAINS
from friction_fmus.blocks.axis_units import Words
from friction_fmus.identification import Array, AxisUnits
from friction_fmus.listings import shown
from friction_fmus.study.comparison import Comparison
from friction_fmus.study.evaluation import AxisBench, Scheme
from friction_fmus.study.recommendation import AS_MEASURED, improves
from friction_fmus.study.study_result import CompensatorResult, ModelResult, Rung
from harness.storage.files import atomic_path

LATE: Final = 0.01  # relative difference of the feedforward from the mass of the axis that is explained
SENSITIVE = 1.5  # factor by which the error rises in a case that is worth a measurement
SMALL = 1e-3  # part of the force limit up to which a constant force is not worth a setting


def next_steps(
    bench: AxisBench, found: Comparison, models: Mapping[str, ModelResult], units: AxisUnits
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return what to set in the drive, and what to rule out or to measure, one or two sentences each."""
    row, scheme = found.recommended, found.chosen
    return (
        (*_motion(bench, found.ladder, units), *_integral(bench, scheme), *_laws(bench, scheme, row, units.words)),
        (*_fragile(row), *_sensitive(row, units), *_weak(row, models)),
    )


def _motion(bench: AxisBench, rungs: Sequence[Rung], units: AxisUnits) -> Iterator[str]:
    if not bench.trajectory.motion:
        return
    force = bench.plant.offset
    known = abs(force) > SMALL * bench.servo.force_limit
    constant = f", and a constant {units.words.force} of {force:.3g} {units.force}" if known else ""
    mass, own = bench.plant.mass, bench.trajectory.inertia
    own = mass if own is None else own
    text = (
        f"Switch on the feedforward of velocity (100 %) and acceleration ({units.words.mass} "
        f"{own:.4g} {units.inertia}){constant}."
    )
    if bench.plant.terms:
        what = {"gravity": "G_sin" in bench.plant.terms, "the load of the friction": bench.plant.loaded}
        named = " and ".join(name for name, known in what.items() if known)
        text += f" Add LoadFeedforward for {named}: recommended/c contains it."
    if viscous := bench.trajectory.viscous:
        text += (
            f" Add {viscous:.4g} {units.viscous} times the reference velocity: the integral would otherwise take the "
            "lag of the measured velocity for an error."
        )
    if abs(own - mass) > LATE * mass:
        rest = "gives the rest" if bench.plant.load is None else "and the load behind a spring change what is best"
        text += f" The axis has {mass:.4g} {units.inertia}; the velocity, which is measured late, {rest}."
    if len(rungs) > 1 and rungs[0].title == AS_MEASURED and not improves(rungs[:1], rungs[1]):
        before, after = (shown(rung.metrics.rms, units.position) for rung in rungs[:2])
        text += f" Alone, it does not reduce the tracking error of this axis ({before} before, {after} after), but the "
        text += "compensators are tuned with it."
    yield text


def _integral(bench: AxisBench, scheme: Scheme) -> Iterator[str]:
    name = GAINS[bench.servo.law][-1]
    value = scheme.servo.gains[name]
    if value != bench.servo.gains[name]:
        yield f"Set the integral gain of the {scheme.servo.law} to {name} = {value:.4g}."


def _laws(bench: AxisBench, scheme: Scheme, row: CompensatorResult, u: Words) -> Iterator[str]:
    if scheme.table:
        yield (
            f"Add a table of cogging and position-dependent friction to the drive {u.force}, evaluated at the "
            "reference position: recommended/README.md has the connections."
        )
    laws = [law for law in (scheme.feedforward, scheme.compensator) if law is not None]
    if bench.servo.friction is not None:
        replaced = bench.servo.friction not in with_friction(bench.servo, scheme.compensator, scheme.feedforward)
        yield f"Switch the friction feedforward of the drive {'off: the law replaces it' if replaced else 'on'}."
    if not laws:
        return
    tuned = f"a bandwidth of {row.bandwidth:.3g} Hz" if row.bandwidth is not None else f"gain {row.gain:g}"
    names = " and ".join(law.model for law in laws)
    only_integral = scheme.compensator is None
    yield (
        f"Add {names}{'' if only_integral else f' with {tuned}'}: recommended/README.md has the connections, "
        "recommended/c the code."
    )


def _sensitive(row: CompensatorResult, units: AxisUnits) -> Iterator[str]:
    if row.metrics is None:
        return
    tried = [(each.metrics.rms, each.name) for each in row.corners if each.counts and each.metrics is not None]
    if tried and max(tried)[0] > SENSITIVE * row.metrics.rms:
        error, name = max(tried)
        yield (
            f"The error is most sensitive to this case: {name} ({shown(row.metrics.rms, units.position)} becomes "
            f"{shown(error, units.position)}). If it can occur on the machine, record it and repeat the study."
        )


def _fragile(row: CompensatorResult) -> Iterator[str]:
    failing = [each.name for each in row.corners if each.metrics is None]
    if failing:
        yield f"The loop fails in these cases: {', '.join(failing)}. Rule them out before you switch it on."


def _weak(row: CompensatorResult, models: Mapping[str, ModelResult]) -> Iterator[str]:
    model = models.get(row.model)
    weak = [parameter for parameter in model.parameters if parameter.weak] if model is not None else []
    if model is not None and weak:
        names = " and ".join(parameter.name for parameter in weak)
        yield f"The record determines {names} of {model.name} poorly ({weak[0].name}: {weak[0].weak})."


EXPERIMENT_FILE: Final = "next_experiment.csv"
DURATION: Final = 20.0  # [s]
SLOW: Final = 4  # periods of the slow motion
BAND: Final = (0.5, 10.0)  # band of the chirp, in natural frequencies of the position loop
HIGHEST: Final = 0.1  # highest frequency divided by the sample rate
FORCE: Final = 0.3  # inertia force of the chirp over what friction leaves of the force limit
TRAVEL: Final = 0.5  # amplitude of the slow motion, and largest one of the chirp, in parts of half the travel


@dataclass(frozen=True, eq=False)
class NextExperiment:
    """Reference of the experiment."""

    t: Array
    r: Array
    """Time [s] and reference [m or rad], which begins and ends at rest in the middle of the recorded travel."""
    band: tuple[float, float]  # first and last frequency of the chirp [Hz]


def next_experiment(bench: AxisBench, level: float) -> NextExperiment:
    """Return a logarithmic chirp of constant acceleration on a slow sine, within force limit and recorded travel."""
    Ts, natural = bench.servo.Ts, bench.bandwidth / (2.0 * np.pi)
    low, high = BAND[0] * natural, min(BAND[1] * natural, HIGHEST / Ts)
    t = Ts * np.arange(round(DURATION / Ts) + 1.0)
    rate = np.log(high / low) / DURATION
    frequency = low * np.exp(rate * t)
    phase = 2.0 * np.pi * (frequency - low) / rate
    half = 0.5 * TRAVEL * float(np.ptp(bench.r))
    left = max(bench.servo.force_limit - level - abs(bench.plant.offset), 0.0)
    acceleration = min(FORCE * left / bench.plant.mass, half * (2.0 * np.pi * low) ** 2)
    fade = np.sin(np.pi * np.clip(np.minimum(t, DURATION - t) * low, 0.0, 0.5)) ** 2  # two periods at either end
    slow = 0.5 * half * (1.0 - np.cos(2.0 * np.pi * SLOW / DURATION * t))
    middle = 0.5 * float(np.min(bench.r) + np.max(bench.r))
    r = middle + slow + fade * acceleration / (2.0 * np.pi * frequency) ** 2 * np.sin(phase)
    return NextExperiment(t, r, (low, high))


def write_experiment(folder: Path, found: NextExperiment, unit: str) -> Path:
    """Write time and reference as CSV with units in the heading; return the file."""
    path = folder / EXPERIMENT_FILE
    rows = np.column_stack([found.t, found.r])
    with atomic_path(path) as temporary:
        np.savetxt(temporary, rows, fmt="%.9g", delimiter=",", header=f"t [s],reference [{unit}]", comments="")
    return path
