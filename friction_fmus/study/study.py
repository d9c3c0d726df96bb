"""Study of an axis: record -> models -> axis -> compensators -> recommendation -> files and report."""

from __future__ import annotations

import itertools
import math
import platform
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from friction_fmus.axis.servo import FlexibleLoad, Trajectory
from friction_fmus.axis.servo_loop import from_rest
from friction_fmus.blocks.catalogue import find
from friction_fmus.errors import FrictionError
from friction_fmus.export.targets import write_file
from friction_fmus.identification import Array, identifiable
from friction_fmus.identification.data.record import Record, RecordFinding
from friction_fmus.identification.fit.contact_model import contact_model
from friction_fmus.identification.fit.idim import filtered_motion
from friction_fmus.identification.force_findings import FORBIDDING
from friction_fmus.identification.plant_candidates import plant_findings
from friction_fmus.listings import shown
from friction_fmus.study.comparison import Comparison, clear, compare
from friction_fmus.study.compensators import AxisKnowledge, check_names, period_of
from friction_fmus.study.config import ALL, OF_RECORD, ConfigError, StudyConfig, load_config
from friction_fmus.study.data import Data, build_reference, check_fits, load_data, measured_servo
from friction_fmus.study.evaluation import LATE, AxisBench, Scheme, motion_feedforward
from friction_fmus.study.loop_conditions import loop_conditions
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
from friction_fmus.study.next_steps import EXPERIMENT_FILE, next_experiment, next_steps, write_experiment
from friction_fmus.study.pictures import over_position, over_velocity, residuals, series
from friction_fmus.study.servo_check import CheckedServo, check_servo, estimate_servo
from friction_fmus.study.settings_file import SETTINGS_FILE, settings_of
from friction_fmus.study.steps import CACHE, Step, StepCache, run_steps, workers
from friction_fmus.study.study_files import Figures, export_models, export_recommended, export_sheet, identified_axes
from friction_fmus.study.study_result import ConditionResult, Recommendation, StudyFinding, StudyResult, WrittenFile
from friction_fmus.study.trust import (
    NOT_SIMULATED,
    band_of,
    bias_findings,
    claim_findings,
    dry_friction_findings,
    force_findings,
    loop_findings,
    mass_findings,
    model_error,
    narrow,
    not_trusted,
    static_friction_findings,
    without_loop,
)
from friction_fmus.study.what_if import WhatIf, panel_of
from friction_fmus.version import VERSION
from harness import Progress
from harness.compiling import toolchain
from harness.extras import require
from harness.processors import available

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
            f"most {wanted.limits.Ms:g} and a delay margin of at least {wanted.limits.delay:g} samples; friction "
            f"{100 * wanted.mismatch:g} % off or more, {u.mass} {100 * wanted.mass_mismatch:g} % off; the servo "
            + ("has velocity and inertia feedforward" if wanted.motion_feedforward else "is as measured")
        )
    return overview


def identifier(name: str) -> str:
    """Return a valid model identifier made from the name of a record."""
    letters = "".join(letter for letter in name.title() if letter.isascii() and letter.isalnum())
    return letters if letters and letters[0].isalpha() else f"Axis{letters}"


OF_FRICTION_AT_REST: Final = {
    "stick-slip": {"Fs", "vs"},
    "hunting": {"Fs"},
    "encoder": {"Fs"},
}
"""Conditions of the loop with the parameters that they need: without them, nothing is said about the condition."""

CLOSE: Final = 2.0  # models whose error is at most this factor times the smallest are also fitted to the closed loop
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
    folder = folder.absolute()  # loading an FMU changes the working folder for a moment, and the panel has a thread
    reporter = ProgressReporter(progress)
    with workers(0 if executor is not None else processes or available()) as own:
        study = _Study(config, folder, StepCache(folder / CACHE), executor or own, reporter, force)
        result = study.run()
        panel = study.panel
    result = replace(result, seconds=time.perf_counter() - begin)
    from friction_fmus.report import write_report

    write_report(result, folder / "report.html", panel)
    write_file(result.to_json(), folder / "study.json")
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
        """Run the stages one after the other."""
        self.progress(0.0)
        data, checked, findings = self._settled()
        models, plants = self._models(data, checked, self._goes_on(findings))
        seen, beyond = findings_of_plants(plants, models[0])
        findings = sorted([*findings, *seen], key=lambda each: each.name != "saturated")
        loads = [plant.load for plant in plants if plant.load is not None]
        resonances = self.config.resonances or tuple(load.resonance for load in loads)
        self.config = replace(self.config, resonances=resonances)
        models, of_models = self._judged(data, models)
        findings += of_models
        best, record = models[0], data.longest
        if not any(finding.stops for finding in findings):  # otherwise the mass is a consequence
            findings += mass_findings(self.config.servo, best, record.units.words)
        goes_on = self._goes_on(findings)
        missing = self._missing(data, best) if goes_on else not_trusted(findings)
        written = goes_on and record.units.known
        files = list(export_models(self.out, models, data.rotary, record.citation)) if written else []
        comparison: Comparison | None = None
        conditions: tuple[ConditionResult, ...] = ()
        if not missing:
            bench = self._bench(data, best)
            comparison = self._comparison(data, models, bench)
            findings += self._claimed(data, bench, comparison, beyond)
            files += self._files(data, bench, models, comparison)
            conditions = conditions_of(bench, comparison.chosen)
        self.progress(0.97)
        axes = identified_axes(models, record, self.config.servo, comparison)
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
            conditions=conditions,
            files=tuple(files),
            command=f"{self.config.command} -o out",
            versions={"friction-fmus": VERSION, "Python": platform.python_version(), "numpy": np.__version__},
            seconds=0.0,
            servo_check=checked.result,
            findings=tuple(findings),
            turn=comparison.turn if comparison else None,
            axes=axes if written else (),
        )

    def _settled(self) -> tuple[Data, CheckedServo, list[StudyFinding]]:
        """Load the data and settle the servo of the configuration; return findings on both."""
        data = load_data(self.config, self.out / CACHE)
        _check_duration(self.config, data)
        servo, record, findings = self.config.servo, data.longest, []
        if servo is None and record.units.known and (guessed := estimate_servo(record)) is not None:
            servo, findings = guessed.servo, [guessed.finding]
        if servo is not None and servo.quantum == OF_RECORD:
            servo = replace(servo, quantum=record.quantum)
        self.config = replace(self.config, servo=servo)
        check_fits(self.config, record)
        checked = check_servo(record, servo)
        self.config = replace(self.config, servo=checked.servo or servo)
        data = data.with_total_force(checked.included)
        findings += checked.result.findings
        named = {finding.name for finding in findings}
        findings += [each for each in force_findings(data.records, self.config.servo) if each.name not in named]
        about = data.measurement.findings if data.measurement is not None else ()
        findings += [
            StudyFinding(each.name, each.what, each.measure, True) for each in about if each.name in FORBIDDING
        ]
        return data, checked, findings

    def _goes_on(self, findings: Sequence[StudyFinding]) -> bool:
        """Return whether the servo is simulated and files are written."""
        return self.force or not any(finding.stops for finding in findings)

    def _models(
        self, data: Data, checked: CheckedServo, simulated: bool
    ) -> tuple[list[IdentifiedModel], list[FoundPlant]]:
        """Identify all models and rank them; if the servo is simulated, find its load and fit the best ones to it."""
        config = self.config
        measured = None
        if config.servo is not None and simulated and data.longest.units.known:
            name = identifier(data.longest.name)
            measured = measured_servo(data, config.servo, self.out / CACHE, name, checked.injected)
        names = list(identifiable()) if config.models == ALL else list(config.models)
        if data.measurement is not None and data.measurement.static:
            names = [name for name in names if contact_model(name, data.longest.units).static]
        names.sort(key=lambda name: "presliding" not in find(name).features)  # the slowest first
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
        limit = config.servo.force_limit if config.servo is not None else None
        beside = [Step("plant", find_plant, (data.records, limit), FoundPlant)] if simulated else []
        results = self._run([*steps, *beside], 0.02, 0.4)
        found, plants = results[: len(steps)], results[len(steps) :]
        if measured is None:
            return ranked(found), plants
        smallest = min((each.error for each in found if each.error is not None), default=0.0)
        # the simplest one always: with Fs = Fc, that of Stribeck has parameters without effect, which leave an error
        simple = [each.row.name == INVERSE and each.error is not None for each in found]
        close = [each.error is not None and each.error <= CLOSE * smallest for each in found]
        load = next((plant.load for plant in plants), None)
        # a rigid mass may be so wrong that the servo does not follow the record with it
        other = [load is not None and each.error is None and bool(each.row.closed_loop) for each in found]
        chosen = [each for each, *one in zip(found, simple, close, other, strict=True) if any(one)]
        chosen.sort(key=lambda each: "needs force" not in find(each.block).features)  # the slowest first
        steps = [
            Step(f"loop-{each.row.name}", refine, (each, measured, *records, load), IdentifiedModel) for each in chosen
        ]
        refined = self._run(steps, 0.4, 0.6)
        better = {each.row.name: each for each in refined}
        rounded = config.servo.quantum / math.sqrt(12.0) if config.servo else 0.0  # rms error of a rounded position
        return ranked([better.get(each.row.name, each) for each in found], rounded), plants

    def _judged(
        self, data: Data, models: Sequence[IdentifiedModel]
    ) -> tuple[list[IdentifiedModel], list[StudyFinding]]:
        """Drop parameters that the record does not determine; return the models and findings on them.

        Raises StudyError if no model is left.
        """
        record, simulated = data.longest, any(found.row.closed_loop for found in models)
        findings = list(loop_findings(models, simulated, record.units.words))
        if models[0].row.rank is None:
            models = ranked(without_loop(models))
        judged = [without_unknown_static_friction(found) for found in models]
        best = judged[0]
        if best.row.rank is None:
            raise StudyError(
                f"No friction model could be identified from {record.name!r}; reason of the first one: "
                f"{best.row.reason}"
            )
        findings += [*static_friction_findings(best, record.units), *bias_findings(best, record)]
        return judged, [*findings, *dry_friction_findings(judged, record)]

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
            motion=wanted.motion_feedforward,
            offset=0.0 if plant.terms and wanted.motion_feedforward else plant.offset,  # else part of its load
            rotary=data.rotary,
            noise=noise,
        )
        weak = {parameter.name for parameter in best.row.parameters if parameter.weak}
        unsure = tuple(name for name, needed in OF_FRICTION_AT_REST.items() if weak & needed)
        error = model_error(best, record)
        fit = next((each for each in best.row.closed_loop if each.signal == "force"), best.row.validation)
        unexplained = 0.0 if fit is None else fit.percent / 100.0
        bench = AxisBench(servo, plant, trajectory, r, len(r) - len(recorded), error, unexplained, unsure=unsure)
        if not trajectory.motion:
            return bench
        inertia, viscous = motion_feedforward(bench)
        return replace(bench, trajectory=replace(trajectory, inertia=inertia, viscous=viscous))

    def _comparison(self, data: Data, models: Sequence[IdentifiedModel], bench: AxisBench) -> Comparison:
        """Compare the compensators."""
        sources = {found.block: found for found in reversed(models) if found is models[0] or of_laws(found)}
        known = AxisKnowledge(
            bench.servo,
            bench.plant,
            {block: found.values for block, found in sources.items()},
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
        steps, cautions = next_steps(bench, found, {block: model.row for block, model in sources.items()}, units)
        return replace(found, recommendation=replace(found.recommendation, next_steps=steps, cautions=cautions))

    def _claimed(
        self, data: Data, bench: AxisBench, comparison: Comparison, beyond: Sequence[str]
    ) -> tuple[StudyFinding, ...]:
        """Return findings on the claimed errors; `beyond` names effects that the simulated axis lacks."""
        metrics = comparison.recommended.metrics
        corners = {corner.name: corner.metrics for corner in comparison.recommended.corners}
        left = math.inf if metrics is None else metrics.rms
        late = 0.0 if (found := corners.get(LATE)) is None else found.rms
        return claim_findings(bench, comparison.limits.band, beyond, data.longest.units, left, late)

    def _files(
        self, data: Data, bench: AxisBench, models: Sequence[IdentifiedModel], comparison: Comparison
    ) -> list[WrittenFile]:
        """Write the files of a recommendation while the panel is computed."""
        record, files = data.longest, []
        (self.out / EXPERIMENT_FILE).unlink(missing_ok=True)
        if narrow(bench, comparison.limits.band):
            level = AxisKnowledge(bench.servo, bench.plant, {}).level
            write_experiment(self.out, next_experiment(bench, level), record.units.position)
            files.append(WrittenFile(EXPERIMENT_FILE, "Reference to record next: a chirp on a slow motion"))
        metrics = comparison.recommended.metrics
        figures = None if metrics is None else Figures(metrics.rms, record.units.position)
        with ThreadPoolExecutor(1) as thread:  # which mostly waits for a compiler
            panel = thread.submit(self._panel, bench, comparison)
            files += export_recommended(self.out, bench, comparison.chosen, record.name, record.citation, figures)
            (axis,) = identified_axes(models[:1], record, self.config.servo, comparison)
            files += export_sheet(self.out, axis)
            self.panel = panel.result()
        return files

    def _panel(self, bench: AxisBench, comparison: Comparison) -> WhatIf | str:
        """Return the axis for the what-if panel of the report, or why there is none."""
        runs = [(comparison.rows[0], Scheme(bench.servo))]
        if comparison.recommended is not comparison.rows[0]:
            runs.insert(0, (comparison.recommended, comparison.chosen))
        return panel_of(bench, runs, _noise(len(bench.r)))

    def _run(self, steps: Sequence[Step], begin: float, end: float) -> list[Any]:
        return run_steps(steps, self.store, self.executor, self.progress.steps(begin, end, len(steps)))


def conditions_of(bench: AxisBench, scheme: Scheme) -> tuple[ConditionResult, ...]:
    """Return the conditions of an axis with a scheme that the record can decide, violated ones first."""
    rows = []
    for c in loop_conditions(bench, scheme):
        if c.name not in bench.unsure and (c.ok or clear(bench, c.value, c.bound)):
            texts = ("", "", "", "") if c.ok else (c.wrong, c.why, c.change, c.source)
            value, bound = (float(number) if np.isfinite(number) else None for number in (c.value, c.bound))
            rows.append(ConditionResult(c.name, c.ok, *texts, value, bound))
    return tuple(sorted(rows, key=lambda row: row.ok))


@dataclass(frozen=True)
class FoundPlant:
    """What records show of an axis beyond a rigid mass."""

    findings: tuple[RecordFinding, ...]
    load: FlexibleLoad | None  # part of the mass behind a spring


def find_plant(records: Sequence[Record], limit: float | None) -> FoundPlant:
    """Find what records show of an axis, see `plant_findings`."""
    return FoundPlant(*plant_findings(records, limit))


def findings_of_plants(plants: Sequence[FoundPlant], best: IdentifiedModel) -> tuple[list[StudyFinding], list[str]]:
    """Return findings on the plants, and the names of effects that the axis of the best model lacks."""
    found = [finding for plant in plants for finding in plant.findings]
    simulated = {} if best.load is None else {"two-masses": "The simulated axis has both parts."}
    arm = "The simulated axis is an arm, whose gravity the feedforward compensates."
    simulated |= dict.fromkeys(("gravity", "force-over-position"), arm) if "G_sin" in best.terms else {}
    beyond = [each.name for each in found if each.name in NOT_SIMULATED and each.name not in simulated]
    ways = [simulated.get(each.name, each.measure) for each in found]
    return [StudyFinding(f.name, f.what, way, f.name in FORBIDDING) for f, way in zip(found, ways, strict=True)], beyond


def of_laws(found: IdentifiedModel) -> bool:
    """Return whether laws take the parameters of a model: presliding that the record does not determine harms them."""
    unknown = any(parameter.weak for parameter in found.row.parameters)
    return found.row.rank is not None and not (unknown and "presliding" in find(found.block).features)


def _noise(samples: int) -> Array:
    """Return the noise of the measured position with standard deviation 1."""
    return np.random.default_rng(SEED).standard_normal(samples)
