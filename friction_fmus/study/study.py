"""Study of an axis: record -> models -> axis -> compensators -> recommendation -> files and report."""

from __future__ import annotations

import itertools
import math
import platform
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from friction_fmus.axis.loop_assembly import block, typed, viscous_beside, with_friction
from friction_fmus.axis.servo import GAINS, Servo, Trajectory
from friction_fmus.axis.servo_loop import from_rest
from friction_fmus.blocks.axis_units import Words
from friction_fmus.blocks.catalogue import catalogue
from friction_fmus.conditions import SampledLaw, chain, one_mass
from friction_fmus.conditions.condition import spectral_radius
from friction_fmus.doctor import examine
from friction_fmus.errors import FrictionError
from friction_fmus.identification import Array, AxisUnits, Record, decimate, filtered_motion, identifiable
from friction_fmus.identification.fit.contact_model import contact_model
from friction_fmus.identification.force_findings import FORBIDDING, contradictions
from friction_fmus.identification.plant_band import PlantBand, plant_band
from friction_fmus.identification.plant_candidates import plant_findings
from friction_fmus.listings import shown
from friction_fmus.study.comparison import Comparison, clear, compare
from friction_fmus.study.compensators import AxisKnowledge, check_names, period_of
from friction_fmus.study.config import ALL, OF_RECORD, ConfigError, StudyConfig, load_config
from friction_fmus.study.data import Data, build_reference, check_period, load_data, measured_servo
from friction_fmus.study.evaluation import AxisBench, Scheme, feedforward_mass
from friction_fmus.study.margins import path_of
from friction_fmus.study.model_ranking import (
    INVERSE,
    IdentifiedModel,
    identify_model,
    inverse_model,
    published_model,
    ranked,
    refine,
    without_unknown_static_friction,
)
from friction_fmus.study.next_experiment import EXPERIMENT_FILE, next_experiment, write_experiment
from friction_fmus.study.recommendation import AS_MEASURED, improves
from friction_fmus.study.servo_check import CheckedServo, check_servo
from friction_fmus.study.servo_estimate import estimate_servo
from friction_fmus.study.settings_file import SETTINGS_FILE, settings_of
from friction_fmus.study.steps import CACHE, Step, StepCache, run_steps, workers
from friction_fmus.study.study_files import OWN, Figures, export_models, export_recommended
from friction_fmus.study.study_result import (
    CompensatorResult,
    ConditionResult,
    ModelResult,
    Picture,
    Recommendation,
    Rung,
    StudyCurve,
    StudyFinding,
    StudyResult,
    WrittenFile,
    curve,
    thinned,
)
from friction_fmus.study.what_if import WhatIf, panel_of
from friction_fmus.version import VERSION
from harness import Experiment, FmuPart, Progress, SeriesPart, System
from harness.compiling import toolchain
from harness.extras import require
from harness.processors import available
from harness.storage.files import atomic_path

DRAWN: Final = 4  # number of models to plot, best first
CLOUD: Final = 2000  # approximate number of points of a scatter plot
LOOP: Final = 3.0  # longest section of the record plotted as a loop [s]


def series(data: Sequence[Record], models: Sequence[IdentifiedModel]) -> tuple[Picture, ...]:
    """Return the record over time, together with the simulations of the best models."""
    record = max(data, key=len)
    units = record.units
    drawn = [found for found in models[:DRAWN] if found.row.rank]

    def picture(name: str, unit: str, columns: Mapping[str, Array | None], lines: Mapping[str, StudyCurve]) -> Picture:
        shown = {key: thinned(record.t, column) for key, column in columns.items() if column is not None}
        return Picture("time", name, "s", unit, shown, lines)

    pictures = []
    if record.q is not None:
        pictures.append(picture("position", units.position, {"measured": record.q, "reference": record.reference}, {}))
        errors = {found.row.name: found.position for found in drawn if found.position is not None}
        if record.reference is not None:
            error = {"measured, reference − position": record.reference - record.q}
            pictures.append(picture("position error", units.position, error, {}))
        if errors:
            pictures.append(Picture("time", "simulated − measured position", "s", units.position, {}, errors))
    if record.v is not None:
        pictures.append(picture("velocity", units.velocity, {"measured": record.v}, {}))
    if record.force is not None:
        pictures.append(picture(f"drive {units.words.force}", units.force, {"measured": record.force}, {}))
        forces = {found.row.name: found.force for found in drawn if found.force is not None}
        if forces:
            pictures.append(Picture("time", f"simulated − measured {units.words.force}", "s", units.force, {}, forces))
    if record.friction is not None:
        over = record.normal if record.normal is not None and np.all(record.normal > 0.0) else None
        column = record.friction if over is None else record.friction / over
        lines = {found.row.name: found.predicted for found in drawn if found.predicted is not None}
        name, unit = ("friction", units.force) if over is None else ("friction coefficient", "1")
        pictures.append(picture(name, unit, {"measured": column}, lines))
    return tuple(pictures)


def residuals(record: Record, models: Sequence[IdentifiedModel]) -> tuple[Picture, ...]:
    """Return the force residual of the co-simulated servo with the best models, over velocity and over position."""
    forces = {found.row.name: found.force for found in models[:DRAWN] if found.row.rank and found.force is not None}
    if not forces or record.q is None:
        return ()
    motion = filtered_motion(record)
    t, units = record.t - record.t[0], record.units

    def over(name: str, unit: str, column: Array) -> Picture:
        curves = {
            model: StudyCurve(tuple(np.interp(line.x, t, column).tolist()), line.y) for model, line in forces.items()
        }
        return Picture(name, f"simulated − measured {units.words.force}", unit, units.force, {}, curves)

    return over("velocity", units.velocity, motion.v), over("position", units.position, motion.q)


def friction_of(record: Record, mass: float, offset: float) -> tuple[Array, Array, Array] | None:
    """Return position, filtered velocity and friction of a record; None if it has neither friction nor force."""
    if record.q is None:
        return None
    motion = filtered_motion(record)
    if record.friction is not None:
        return record.q, motion.v, record.friction
    if record.force is None:
        return None
    return record.q, motion.v, record.force - mass * motion.a - offset


def over_velocity(record: Record, models: Sequence[IdentifiedModel]) -> Picture | None:
    """Return friction over velocity: points of the record, and curves of the models on a slow velocity sweep."""
    best = [found for found in models if found.row.rank]
    behind = friction_of(record, best[0].mass, best[0].offset) if best else None
    if behind is None:
        return None
    _, v, friction = behind
    smooth, level = decimate(v, 10), decimate(friction, 10)
    few = slice(50, -50, max(1, len(smooth) // CLOUD)) if len(smooth) > 300 else slice(None)
    fastest = 1.05 * float(np.max(np.abs(v)))
    at = np.linspace(-fastest, fastest, 800)  # an even number: no point is at the jump at rest
    curves = {}
    for found in best[:DRAWN]:
        F = drive(found, record.units, 5.0 * np.arange(800.0) / 800.0, at, _load(record))
        curves[found.row.name] = curve(at[1:], F[1:])
    points = curve(smooth[few], level[few])
    units = record.units
    return Picture("velocity", "friction", units.velocity, units.force, {"record": points}, curves)


def over_position(record: Record, models: Sequence[IdentifiedModel]) -> Picture | None:
    """Return friction over position around the reversal nearest to the middle of the record, measured and simulated."""
    best = [found for found in models if found.row.rank]
    behind = friction_of(record, best[0].mass, best[0].offset) if best else None
    if behind is None:
        return None
    q, v, friction = behind
    turns = np.flatnonzero(np.diff(np.sign(v)) != 0)
    turns = turns[(turns > 100) & (turns < len(v) - 100)]
    if not turns.size:
        return None
    centre = int(turns[np.argmin(np.abs(turns - len(v) // 2))])
    half = min(round(0.5 * LOOP / record.Ts), len(v) // 4)
    section = slice(max(0, centre - half), centre + half)
    # start earlier: a bristle that starts in motion takes some time to deflect
    lead = min(section.start, half)
    driven = slice(section.start - lead, section.stop)
    t = record.Ts * np.arange(float(len(v[driven])))
    few = max(1, len(v[section]) // 600)
    loops = {}
    for found in best[:DRAWN]:
        F = drive(found, record.units, t, v[driven], _load(record))[lead:]
        loops[found.row.name] = curve(q[section][::few], F[::few])
    points = curve(q[section][::few], friction[section][::few])
    units = record.units
    return Picture("position", "friction", units.position, units.force, {"record": points}, loops)


def drive(found: IdentifiedModel, units: AxisUnits, t: Array, v: Array, load: float | None) -> Array:
    """Return the friction force of a model's FMU driven by a velocity, shape (n,)."""
    step = float(t[1] - t[0])
    contact = FmuPart("friction", block(found.block, units.rotary))
    sweep = SeriesPart("sweep", t, {"v": v}, {"v": "rad/s" if units.rotary else "m/s"})
    inputs = {port.name for port in contact.inputs}
    start: dict[str, float | int | bool | str] = {f"friction.{k}": v for k, v in typed(contact, found.values).items()}
    start |= {"friction.F_ext": 0.0} if "F_ext" in inputs else {}
    start |= {"friction.Fn": load} if "Fn" in inputs and load is not None else {}
    experiment = Experiment(stop=step * (len(t) - 1), step=step, record=("friction.F",))
    with System([sweep, contact], ["sweep.v -> friction.v"], start, experiment, "curve") as system:
        F = np.asarray(system.run()["friction.F"].to_numpy(), dtype=np.float64)
        F += viscous_beside(contact, found.plant) * v
        return F


def band_of(records: Sequence[Record], found: IdentifiedModel) -> PlantBand | None:
    """Return the band in which records support the mass of a model, with its friction and force over position."""
    if any(record.q is None or record.force is None for record in records):
        return None
    friction, alone, table = [], [], found.plant.position
    for record in records:
        v = filtered_motion(record).v
        friction.append(drive(found, record.units, record.Ts * np.arange(float(len(v))), v, _load(record)))
        over_position = 0.0 if table is None else table.force(record.column("q"), v)
        alone.append(replace(record, force=record.column("force") + over_position))
    return plant_band(alone, found.mass, friction)


def _load(record: Record) -> float | None:
    """Return the mean normal force; None if it was not measured."""
    return None if record.normal is None else float(np.mean(record.normal))


STAGES: Final = {
    0.02: "identifying friction models",
    0.4: "fitting the best models to the closed loop",
    0.6: "simulating compensators",
    0.97: "writing the report",
}
"""What a study does, by the fraction at which it begins."""


@dataclass
class ProgressReporter:
    """Progress of a study from 0 to 1."""

    progress: Progress | None
    done: float = 0.0

    def __call__(self, part: float) -> None:
        """Report that this fraction is done; the reported progress never decreases."""
        self.done = max(self.done, part)
        if self.progress is not None:
            self.progress.update(round(100.0 * self.done), 100)

    def steps(self, begin: float, end: float, count: int) -> Callable[[Step], None]:
        """Return a callback for each of `count` steps between two fractions."""
        done = itertools.count(1)
        return lambda step: self(begin + (end - begin) * next(done) / max(1, count))


def overview(config: StudyConfig, data: Data) -> dict[str, str]:
    """Return descriptions of record, servo and settings, by topic."""
    record, servo, wanted = data.longest, config.servo, config.compensation
    u = record.units.words
    length = f"{len(record)} samples at {1e3 * record.Ts:g} ms"
    segments = f"{len(data.records)} segments; the longest has {length}"
    overview = {"record": length if len(data.records) == 1 else segments}

    def span(records: Sequence[Any]) -> str:
        return f"{records[0].t[0]:.4g} to {records[-1].t[-1]:.4g} s"

    overview["training data"] = span(data.train)
    if data.validation:
        overview["validation data"] = span(data.validation)
    for number, finding in enumerate(data.findings, start=1):
        overview[f"finding {number}"] = finding
    if servo is not None:
        gains = ", ".join(f"{name} {value:.5g}" for name, value in servo.gains.items())
        overview["servo"] = (
            f"{servo.law} with {gains}; sample time {1e3 * servo.Ts:g} ms, {u.force} limit ±{servo.force_limit:.4g} "
            f"{record.units.force}, velocity over {servo.window} samples, encoder resolution "
            + (shown(servo.quantum, record.units.position) if servo.quantum else "unlimited")
            + "".join(f", {name} = {value}" for name, value in servo.features.items())
        )
        overview["compensation"] = (
            f"gains {', '.join(f'{gain:g}' for gain in wanted.gains)}, or the bandwidth, with a sensitivity peak of at "
            f"most {wanted.limits.Ms:g} and a delay margin of at least {wanted.limits.delay:g} samples; friction and "
            f"{u.mass} {100 * wanted.mismatch:g} % off; the servo "
            + ("has velocity and inertia feedforward" if wanted.motion_feedforward else "is as measured")
        )
    return overview


def identifier(name: str) -> str:
    """Return a valid model identifier made from the name of a record."""
    letters = "".join(letter for letter in name.title() if letter.isascii() and letter.isalnum())
    return letters if letters and letters[0].isalpha() else f"Axis{letters}"


AT_LIMIT: Final = 0.98  # recorded force over the force limit above which the drive saturates
BEYOND: Final = 1.2  # recorded force over the force limit above which one of them has a wrong unit
GROWTH: Final = 1.1  # growth of an oscillation per sample above which the loop is too unstable to have been recorded


def force_findings(records: Sequence[Record], servo: Servo | None) -> tuple[StudyFinding, ...]:
    """Return findings about a drive force that contradicts the recorded motion, or the limit of the servo."""
    u = records[0].units.words
    forbidding = (*FORBIDDING, "mass-not-identified") if servo is not None and servo.mass is None else FORBIDDING
    found = [
        StudyFinding(each.name, each.what, each.measure, each.name in forbidding) for each in contradictions(records)
    ]
    peak = max((float(np.max(np.abs(record.force))) for record in records if record.force is not None), default=0.0)
    if servo is not None and AT_LIMIT * servo.force_limit <= peak <= BEYOND * servo.force_limit:
        found = [each for each in found if each.name != "force-clipped"]  # the drive saturates, not the measurement
    if servo is not None and peak > BEYOND * servo.force_limit:
        limit = f"the {u.force} limit is {servo.force_limit:.3g} {u.N}"
        what = f"The recorded drive {u.force} reaches {peak:.3g} {u.N}; {limit}."
        change = f"Correct the unit of the {u.force} in [columns] or force_limit in [servo]."
        found.append(StudyFinding("force-beyond-limit", what, change, stops=True))
    return tuple(found)


def mass_findings(servo: Servo | None, model: IdentifiedModel, u: Words) -> tuple[StudyFinding, ...]:
    """Return a finding if the loop of servo and identified mass is so unstable that no record can come from it.

    Friction is left out, except for its viscous part: a loop whose oscillation grows by more than `GROWTH` in every
    sample exceeds any friction within a few samples.
    """
    if servo is None or model.mass <= 0.0:
        return ()
    growth = loop_growth(servo, model.mass, max(model.values.get("Fv", model.values.get("sigma2", 0.0)), 0.0))
    if growth <= GROWTH:
        return ()
    what = (
        f"With the identified {u.mass} of {model.mass:.3g} {u.kg}, the servo is unstable: an oscillation grows by a "
        f"factor of {growth:.3g} in every sample, so the record cannot come from this axis."
    )
    change = f"Correct the unit of {u.force} or position, or the gains and Ts of the servo."
    return (StudyFinding("mass-contradicts-servo", what, change, stops=True),)


def loop_growth(servo: Servo, mass: float, viscous: float) -> float:
    """Return the largest magnitude of the poles of a sampled loop without Coulomb friction and slow integral action."""
    Kp, Kd, _ = servo.pid
    feedback = SampledLaw(np.zeros((0, 0)), np.zeros((0, 3)), np.zeros(0), np.array([-Kp, -Kd, 0.0]))
    return spectral_radius(chain(one_mass(mass, viscous), [feedback], servo.Ts, path_of(servo)))


def loop_findings(models: Sequence[IdentifiedModel], simulated: bool, u: Words) -> tuple[StudyFinding, ...]:
    """Return a finding if the servo was simulated, but with none of the models it follows the record."""
    if not simulated or not models or models[0].row.rank is not None:
        return ()
    failed = next((found.row.reason for found in models if found.row.train is not None), "")
    if not failed:
        return ()
    change = (
        f"Check Ts, window, quantum and {u.force} limit of the servo, and whether a {u.force} acts on the axis that "
        f"the record does not contain; such a {u.force} can be declared as column injected."
    )
    what = f"The simulated servo does not follow the record with any friction model. {models[0].row.name}: {failed}"
    return (StudyFinding("loop-not-reproduced", what, change, stops=True),)


def without_loop(models: Sequence[IdentifiedModel]) -> list[IdentifiedModel]:
    """Return the models with the error of their predicted signal, so that they can be ranked without a servo."""
    found = []
    for each in models:
        fit = each.row.validation or each.row.train
        row = each.row if fit is None else replace(each.row, reason="")
        found.append(replace(each, error=None if fit is None else fit.rms, row=row))
    return found


def static_friction_findings(best: IdentifiedModel, units: AxisUnits) -> tuple[StudyFinding, ...]:
    """Return a finding if the simulated axis does not have the identified static friction."""
    identified = next((p.value for p in best.row.parameters if p.name == "Fs"), None)
    simulated = best.values.get("Fs")
    if identified is None or simulated is None or identified == simulated:
        return ()
    what = (
        f"The record does not determine the static friction of {best.row.name}: {identified:.3g} {units.force} would "
        f"fit. The simulated axis has its Coulomb friction, {simulated:.3g} {units.force}, instead."
    )
    return (StudyFinding("static-friction-unknown", what, "Record slow strokes at constant speeds."),)


NOT_SIMULATED: Final = ("saturated", "friction-drifts", "offset-drifts", "gravity", "backlash", "two-masses")
"""Findings about the plant that the simulated axis, a rigid mass with friction, does not have."""

NARROW: Final = 1.5
"""Band of the plant over the natural frequency of the position loop below which tracking errors are not claimed."""


def narrow(bench: AxisBench, band: float) -> bool:
    """Return whether the band that a record supports is too narrow for the position loop."""
    return band < NARROW * bench.bandwidth / (2.0 * math.pi)


def claim_findings(bench: AxisBench, band: float, beyond: Sequence[str], units: AxisUnits) -> tuple[StudyFinding, ...]:
    """Return a finding if the tracking errors of the simulated axis need not come true on the machine."""
    natural = bench.bandwidth / (2.0 * math.pi)
    reasons = []
    if narrow(bench, band):
        reasons.append(
            f"the record supports a rigid {units.words.mass} up to {band:.3g} Hz only, and the position loop has a "
            f"natural frequency of {natural:.3g} Hz"
        )
    if beyond:
        reasons.append(f"the simulated axis has none of this: {', '.join(beyond)}")
    if not reasons:
        return ()
    what = f"The tracking errors of this report cannot be claimed for the machine: {'; '.join(reasons)}."
    chirp = (
        f"Record the motion of {EXPERIMENT_FILE}, with feedforward of velocity and acceleration, and repeat the study "
        "with both records."
    )
    change = chirp if narrow(bench, band) else "Correct what is named there, or measure the error on the machine."
    return (StudyFinding("errors-not-claimed", what, change),)


def not_trusted(findings: Sequence[StudyFinding]) -> str:
    """Return why no compensator is compared, in one sentence."""
    names = ", ".join(finding.name for finding in findings if finding.stops)
    return f"No compensator was compared, because the result cannot be trusted ({names}). Correct this first."


LATE: Final = 0.01  # relative difference of the feedforward from the mass of the axis that is explained
SENSITIVE = 1.5  # factor by which the error rises in a case that is worth a measurement
SMALL = 1e-3  # constant force over the force limit up to which it is not worth a setting


def next_steps(
    bench: AxisBench, scheme: Scheme, found: Comparison, models: Sequence[ModelResult], units: AxisUnits
) -> tuple[str, ...]:
    """Return what to set in the drive and what to measure, one or two sentences each."""
    row = found.recommended
    return (
        *_motion(bench, found.ladder, units),
        *_integral(bench, scheme),
        *_laws(bench, scheme, row, units.words),
        *_sensitive(row, units),
        *_fragile(row),
        *_weak(row, models),
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
    if abs(own - mass) > LATE * mass:
        text += f" The axis has {mass:.4g} {units.inertia}; the velocity, which is measured late, gives the rest."
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


def _weak(row: CompensatorResult, models: Sequence[ModelResult]) -> Iterator[str]:
    model = next((model for model in models if model.name == row.model), None)
    weak = [parameter for parameter in model.parameters if parameter.weak] if model is not None else []
    if weak:
        names = " and ".join(parameter.name for parameter in weak)
        yield f"The record determines {names} of {row.model} poorly ({weak[0].name}: {weak[0].weak})."


OF_FRICTION_AT_REST: Final = {
    "stick-slip": {"Fs", "vs"},
    "stick-slip cycle": {"Fs", "vs"},
    "hunting": {"Fs"},
    "encoder": {"Fs"},
}
"""Conditions of the doctor, with the parameters that they need: without them, nothing is said about the condition."""

CLOSE: Final = 1.5  # models whose error is at most this factor times the smallest are also fitted to the closed loop
SEED: Final = 1  # seed of the measurement noise, which is the same for all compensators
LEAST_SAMPLES: Final = 100  # smallest number of samples of the servo over which a closed loop is simulated


class StudyError(FrictionError):
    """Study that cannot be run."""


def run_study(
    what: str | Path | StudyConfig,
    out: str | Path = "out",
    *,
    executor: Executor | None = None,
    processes: int | None = None,
    progress: Progress | None = None,
    force: bool = False,
) -> StudyResult:
    """Run a study, or resume an interrupted one.

    Parameters
    ----------
    what : str, Path or StudyConfig
        "emps", "tribometer", "demo", the path of a configuration or of a data file, or a configuration.
    out : path-like
        Folder for the results; created if needed. Files of an earlier study are replaced, other files are kept.
    executor : Executor, optional
        Executor that runs the steps, such as ``client.get_executor()`` of a dask client; by default local processes.
    processes : int, optional
        Number of local processes; by default one for each processor.
    progress : Progress, optional
        Updated with the progress of the study in percent.
    force : bool
        Whether the servo is simulated and FMUs are written even if a finding forbids to use the result.

    Returns
    -------
    StudyResult
        Result of the study, as in `study.json`.

    Raises
    ------
    ConfigError
        If the configuration is invalid.
    StudyError
        If the folder cannot be created, `processes` is below 1, or no model can be identified.
    FrictionError, HarnessError
        If data cannot be read, an FMU cannot be built, or a file cannot be written.
    MissingPackageError
        If a package of the extra ``study`` is not installed.
    """
    require("plotly", "the report of a study needs it")  # at the start, because the report is written at the end
    toolchain.compiler()
    begin = time.perf_counter()
    config = what if isinstance(what, StudyConfig) else load_config(what)
    _check(config)
    if processes is not None and processes < 1:
        raise StudyError(f"The number of processes is {processes}; use 1 or more.")
    folder = Path(out)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StudyError(f"Cannot create the folder {folder} ({error.strerror}); choose another one.") from error
    reporter = ProgressReporter(progress)
    with workers(0 if executor is not None else processes or available()) as own:
        study = _Study(config, folder, StepCache(folder / CACHE), executor or own, reporter, force)
        result = study.run()
        panel = study.panel
    result = replace(result, seconds=time.perf_counter() - begin)
    from friction_fmus.report import write_report

    write_report(result, folder / "report.html", panel)
    with atomic_path(folder / "study.json") as temporary:
        temporary.write_text(result.to_json(), encoding="utf-8")
    reporter(1.0)
    return result


def _check(config: StudyConfig) -> None:
    """Raise ConfigError for unknown names, before any work is done."""
    check_names(config.compensation.compensators)
    known = identifiable()
    for name in () if isinstance(config.models, str) else config.models:
        if name not in known:
            raise ConfigError(
                f"{config.name}, [identify], models: {name!r} is not a model that can be identified; choose from "
                f"{', '.join(known)}."
            )


def _check_duration(config: StudyConfig, data: Data) -> None:
    """Raise ConfigError if the closed loop would be simulated over a few samples only."""
    if config.servo is None:
        return
    record, Ts = data.longest, config.servo.Ts
    duration = min(float(record.t[-1] - record.t[0]), config.compensation.duration or math.inf)
    if duration < LEAST_SAMPLES * Ts:
        raise ConfigError(
            f"{config.name}: the closed loop would be simulated over {duration:g} s, which is less than "
            f"{LEAST_SAMPLES} sample times of the servo (Ts = {Ts:g} s); check duration in [compensation], Ts in "
            "[servo] and the record."
        )


@dataclass
class _Study:
    """State of a running study."""

    config: StudyConfig
    out: Path
    store: StepCache
    executor: Executor | None
    progress: ProgressReporter
    force: bool
    panel: WhatIf | str = ""

    def run(self) -> StudyResult:
        self.progress(0.0)
        data = load_data(self.config, self.out / CACHE)
        _check_duration(self.config, data)
        guessed = estimate_servo(data.longest) if self.config.servo is None and data.longest.units.known else None
        if guessed is not None:
            self.config = replace(self.config, servo=guessed.servo)
        servo = self.config.servo
        if servo is not None and servo.quantum == OF_RECORD:
            self.config = replace(self.config, servo=replace(servo, quantum=data.longest.quantum))
        check_period(data.longest, self.config.servo)
        checked = check_servo(data.longest, self.config.servo)
        data = data.with_total_force(checked.included)
        findings = [*([] if guessed is None else [guessed.finding]), *checked.result.findings]
        named = {finding.name for finding in findings}
        findings += [each for each in force_findings(data.records, self.config.servo) if each.name not in named]
        about = data.measurement.findings if data.measurement is not None else ()
        findings += [
            StudyFinding(each.name, each.what, each.measure, True) for each in about if each.name in FORBIDDING
        ]
        beyond: list[str] = []
        if self._goes_on(findings):
            shown, resonances = plant_findings(data.records, servo.force_limit if servo is not None else None)
            own = [StudyFinding(each.name, each.what, each.measure) for each in shown]
            findings = sorted([*findings, *own], key=lambda each: each.name != "saturated")
            self.config = replace(self.config, resonances=self.config.resonances or resonances)
            beyond = [each.name for each in shown if each.name in NOT_SIMULATED]
        models = self._models(data, checked, self._goes_on(findings))
        findings += loop_findings(models, any(found.row.closed_loop for found in models), data.longest.units.words)
        if models[0].row.rank is None:
            models = ranked(without_loop(models))
        models = [without_unknown_static_friction(found) for found in models]
        best = models[0]
        findings += static_friction_findings(best, data.longest.units)
        if not any(finding.stops for finding in findings):  # otherwise the mass is a consequence
            findings += mass_findings(self.config.servo, best, data.longest.units.words)
        if best.row.rank is None:
            raise StudyError(
                f"No friction model could be identified from {data.longest.name!r}; reason of the first one: "
                f"{best.row.reason}"
            )
        goes_on = self._goes_on(findings)
        missing = self._missing(data, best) if goes_on else not_trusted(findings)
        comparison: Comparison | None = None
        doctor: tuple[ConditionResult, ...] = ()
        written = goes_on and data.longest.units.known
        files = list(export_models(self.out, models, data.rotary, data.longest.citation)) if written else []
        if not missing:
            bench = self._bench(data, best)
            comparison = self._comparison(data, models, bench)
            band = comparison.limits.band
            findings += claim_findings(bench, band, beyond, data.longest.units)
            (self.out / EXPERIMENT_FILE).unlink(missing_ok=True)
            if narrow(bench, band):
                level = AxisKnowledge(bench.servo, bench.plant, {}).level
                write_experiment(self.out, next_experiment(bench, level), data.longest.units.position)
                files.append(WrittenFile(EXPERIMENT_FILE, "Reference to record next: a chirp on a slow motion"))
            metrics = comparison.recommended.metrics
            figures = None if metrics is None else Figures(metrics.rms, data.longest.units.position)
            name, citation = data.longest.name, data.longest.citation
            files += export_recommended(self.out, bench, comparison.chosen, name, citation, figures)
            doctor = self._doctor(bench)
            self.panel = self._panel(bench, comparison)
        self.progress(0.97)
        record = data.longest
        files += settings_of(self.config, data, self.out)
        files += [
            WrittenFile("report.html", "Report of the study"),
            WrittenFile("study.json", "Result of the study for other programs"),
        ]
        return StudyResult(
            name=record.name,
            citation=record.citation,
            units=record.units,
            overview=overview(self.config, data),
            record=series(data.records, models),
            friction=over_velocity(record, models),
            hysteresis=over_position(record, models),
            residuals=residuals(record, models),
            models=tuple(found.row for found in models),
            plant=best.row.name if not missing else "",
            no_compensation=missing,
            ladder=comparison.ladder if comparison else (),
            limits=comparison.limits if comparison else None,
            compensators=comparison.rows if comparison else (),
            recommendation=comparison.recommendation if comparison else Recommendation("", missing),
            doctor=doctor,
            files=tuple(files),
            command=f"friction-fmus study {self.config.name} -o out",
            versions={"friction-fmus": VERSION, "Python": platform.python_version(), "numpy": np.__version__},
            seconds=0.0,
            servo_check=checked.result,
            findings=tuple(findings),
        )

    def _goes_on(self, findings: Sequence[StudyFinding]) -> bool:
        """Return whether the servo is simulated and files are written."""
        return self.force or not any(finding.stops for finding in findings)

    def _models(self, data: Data, checked: CheckedServo, in_loop: bool) -> list[IdentifiedModel]:
        """Identify all models, fit the best ones to the closed loop unless the servo is wrong, and rank them."""
        config = self.config
        measured = None
        if config.servo is not None and in_loop and data.longest.units.known:
            name = identifier(data.longest.name)
            measured = measured_servo(data, config.servo, self.out / CACHE, name, checked.injected)
        names = list(identifiable()) if config.models == ALL else list(config.models)
        if data.measurement is not None and data.measurement.static:
            names = [name for name in names if contact_model(name, data.longest.units).static]
        names.sort(key=lambda name: "presliding" not in catalogue()[name].features)  # the slowest first
        records = data.train, data.validation
        known = data.published
        steps = [
            Step(
                f"model-{name}",
                identify_model,
                (name, *records, known.get(name, {}), measured, config.position_map, config.viscous),
                IdentifiedModel,
            )
            for name in names
        ]
        if data.longest.force is not None and data.longest.q is not None:
            steps.append(Step("model-inverse", inverse_model, (*records, measured), IdentifiedModel))
        if "inverse" in known:
            arguments = (data.longest, known["inverse"])
            steps.append(Step("model-published", published_model, arguments, IdentifiedModel))
        found: list[IdentifiedModel] = self._run(steps, 0.02, 0.4)
        if measured is None:
            return ranked(found)
        smallest = min((each.error for each in found if each.error is not None), default=0.0)
        close = [each.error is not None and each.error <= CLOSE * smallest for each in found]
        chosen = [each for each, is_close in zip(found, close, strict=True) if is_close and each.row.name != INVERSE]
        chosen.sort(key=lambda each: "needs force" not in catalogue()[each.block].features)  # the slowest first
        steps = [Step(f"loop-{each.row.name}", refine, (each, measured, *records), IdentifiedModel) for each in chosen]
        refined = self._run(steps, 0.4, 0.6)
        better = {each.row.name: each for each in refined}
        rounded = config.servo.quantum / math.sqrt(12.0) if config.servo else 0.0  # rms error of a rounded position
        return ranked([better.get(each.row.name, each) for each in found], rounded)

    def _missing(self, data: Data, best: IdentifiedModel) -> str:
        """Return the reason why no compensator can be simulated; empty if they can."""
        servo, units = self.config.servo, data.longest.units
        if not units.known:
            return (
                "No compensator was compared and no FMU was written, because the results are in "
                f"{units.results}. Give the scales of the columns, with --gain and --columns or in [columns]."
            )
        if servo is None:
            where = f" to {SETTINGS_FILE}" if self.config.bare else ""
            entries = "law, gains, Ts and force_limit" if best.mass > 0.0 else "law, gains, Ts, force_limit and mass"
            return (
                "No compensator was compared, because the configuration has no servo. To compare compensators on the "
                f"axis, add [servo] with {entries}{where}. Guesses of the gains are enough: the study estimates them "
                "from a record with reference, and says what to correct."
            )
        if best.mass <= 0.0 and servo.mass is None:
            moved = data.longest.units.words.moved_mass
            return f"No compensator was compared, because the {moved} is unknown. Add mass = ... to [servo]."
        if data.longest.reference is None and data.longest.q is None:
            return "No compensator was compared, because the record has no position. Add a column for it."
        return ""

    def _bench(self, data: Data, best: IdentifiedModel) -> AxisBench:
        """Return the identified axis with its reference; the simulation starts on the reference."""
        servo, record, wanted = self.config.servo, data.longest, self.config.compensation
        assert servo is not None
        t, r = record.t - record.t[0], record.reference
        if r is None:  # use the measured path, filtered
            motion = filtered_motion(record)
            r = record.column("q")[0] + np.concatenate([[0.0], np.cumsum(motion.v[:-1]) * record.Ts])
        last = min(t[-1], wanted.duration or t[-1])
        recorded = np.interp(servo.Ts * np.arange(float(round(last / servo.Ts) + 1)), t, r)
        r = from_rest(recorded, servo.Ts)
        at = servo.Ts * np.arange(float(len(r)))
        reference = build_reference(at, r, self.out / CACHE, f"{identifier(record.name)}Path", data.rotary)
        noise = build_reference(at, _noise(len(at)), self.out / CACHE, "Noise", data.rotary)
        plant = best.plant if best.mass > 0.0 else replace(best.plant, mass=servo.mass or 0.0)
        v0 = float((r[1] - r[0]) / servo.Ts)
        trajectory = Trajectory(
            reference,
            len(at),
            float(r[0]),
            v0,
            wanted.motion_feedforward,
            plant.offset,
            rotary=data.rotary,
            noise=noise,
        )
        weak = {parameter.name for parameter in best.row.parameters if parameter.weak}
        unsure = tuple(name for name, needed in OF_FRICTION_AT_REST.items() if weak & needed)
        bench = AxisBench(servo, plant, trajectory, r, len(r) - len(recorded), unsure=unsure)
        if not trajectory.motion:
            return bench
        return replace(bench, trajectory=replace(trajectory, inertia=feedforward_mass(bench)))

    def _comparison(self, data: Data, models: Sequence[IdentifiedModel], bench: AxisBench) -> Comparison:
        """Compare the compensators."""
        known = AxisKnowledge(
            bench.servo,
            bench.plant,
            {found.block: found.values for found in reversed(models) if found.row.rank is not None},
            period_of(bench.r[bench.run_up :], 100),
            float(np.max(np.abs(np.diff(bench.r)))) / bench.servo.Ts,
            data.rotary,
        )
        begin = 0.6

        def run(steps: Sequence[Step]) -> list[Any]:
            nonlocal begin
            end = 0.5 * (begin + 0.96)
            found = self._run(steps, begin, end)
            begin = end
            return found

        units, wanted = data.longest.units, self.config.compensation
        band = band_of(data.records, models[0])
        highest = min([*self.config.resonances, math.inf if band is None else band.supported])
        limits = replace(wanted.limits, band=highest, resonance=highest)
        found = compare(bench, known, replace(wanted, limits=limits), run)
        steps = next_steps(bench, found.chosen, found, [model.row for model in models], units)
        return replace(found, recommendation=replace(found.recommendation, next_steps=steps))

    def _panel(self, bench: AxisBench, comparison: Comparison) -> WhatIf | str:
        """Return the axis for the what-if panel of the report, or why there is none."""
        runs = [(comparison.rows[0], Scheme(bench.servo))]
        if comparison.recommended is not comparison.rows[0]:
            runs.insert(0, (comparison.recommended, comparison.chosen))
        return panel_of(bench, runs, _noise(len(bench.r)))

    def _doctor(self, bench: AxisBench) -> tuple[ConditionResult, ...]:
        """Return the conditions of the exported axis that the record can decide, violated ones first."""
        with System.from_ssp(self.out / OWN / "axis.ssp") as system:
            examined = [each for each in examine(system) if each.condition.name not in bench.unsure]
        findings = [each for each in examined if each.condition.ok or clear(each.condition.value, each.condition.bound)]
        rows = []
        for finding in findings:
            c = finding.condition
            texts = ("", "", "", "") if c.ok else (c.wrong, c.why, c.change, c.source)
            value, bound = (float(number) if np.isfinite(number) else None for number in (c.value, c.bound))
            rows.append(ConditionResult(finding.parts, c.name, c.ok, *texts, value, bound))
        return tuple(sorted(rows, key=lambda row: row.ok))

    def _run(self, steps: Sequence[Step], begin: float, end: float) -> list[Any]:
        return run_steps(steps, self.store, self.executor, self.progress.steps(begin, end, len(steps)))


def _noise(samples: int) -> Array:
    """Return the noise of the measured position with standard deviation 1."""
    return np.random.default_rng(SEED).standard_normal(samples)
