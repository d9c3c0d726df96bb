"""A study: record -> models -> axis -> compensators -> recommendation -> files and report."""

from __future__ import annotations

import platform
import time
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from friction_fmus.axis.loop import Trajectory
from friction_fmus.blocks.catalogue import catalogue
from friction_fmus.doctor import examine
from friction_fmus.errors import FrictionError
from friction_fmus.identification import filtered_motion, identifiable
from friction_fmus.identification.simulation_data import default_settings
from friction_fmus.study.compensators import Choice, Known, candidates, check_names, period_of
from friction_fmus.study.config import ALL, ConfigError, StudyConfig, load_config
from friction_fmus.study.data import Data, build_reference, load_data, measured_servo
from friction_fmus.study.evaluation import Bench, Cost, Trial, cost_of, try_out
from friction_fmus.study.export import OWN, export_models, export_recommended
from friction_fmus.study.models import INVERSE, Found, identify_model, inverse_model, ranked, refine
from friction_fmus.study.pictures import over_position, over_velocity, series
from friction_fmus.study.ranking import extremes, rank, recommend
from friction_fmus.study.records import CompensatorResult, ConditionResult, Metrics, Recommendation, WrittenFile
from friction_fmus.study.result import StudyResult
from friction_fmus.study.steps import KEPT, Job, Store, do, workers
from friction_fmus.study.summary import Teller, compensator_row, identifier, overview
from friction_fmus.version import VERSION
from harness import Progress, System
from harness.atomic import atomic_path
from harness.processors import available

CLOSE: Final = 1.5
"""Models whose error is at most so many times the smallest are fitted to the closed loop as well."""


class StudyError(FrictionError):
    """A study cannot be done as asked."""


def run_study(
    what: str | Path | StudyConfig,
    out: str | Path,
    *,
    executor: Executor | None = None,
    processes: int | None = None,
    progress: Progress | None = None,
) -> StudyResult:
    """Do a study; one that was broken off goes on where it was.

    Parameters
    ----------
    what : str, Path or StudyConfig
        "emps", "tribometer", "demo", or the path of a configuration.
    out : path-like
        Folder for the results; made if needed. Files of an earlier study are replaced, nothing else is touched.
    executor : Executor, optional
        Where the pieces are done, such as ``client.get_executor()`` of a dask client; by default in processes here.
    processes : int, optional
        How many of them; by default one for each processor.
    progress : Progress, optional
        Told how far the study is, in percent.

    Returns
    -------
    StudyResult
        As in `study.json`.

    Raises
    ------
    ConfigError
        The configuration is not understood.
    StudyError
        The folder cannot be made, fewer than one process is asked for, or no model can be identified.
    FrictionError, HarnessError
        Whatever goes wrong with data, builds and files.
    """
    begin = time.perf_counter()
    config = what if isinstance(what, StudyConfig) else load_config(what)
    _check(config)
    if processes is not None and processes < 1:
        raise StudyError(f"{processes} processes were asked for; give 1 or more.")
    folder = Path(out)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StudyError(f"Cannot make the folder {folder} ({error.strerror}); give another one.") from error
    tell = Teller(progress)
    with workers(0 if executor is not None else processes or available()) as own:
        study = _Study(config, folder, Store(folder / KEPT), executor or own, tell)
        result = study.run()
    result = replace(result, seconds=time.perf_counter() - begin)
    from friction_fmus.report import write_report

    write_report(result, folder / "report.html")
    with atomic_path(folder / "study.json") as temporary:
        temporary.write_text(result.to_json(), encoding="utf-8")
    tell(1.0)
    return result


def _check(config: StudyConfig) -> None:
    """Refuse names that do not exist before anything is done."""
    check_names(config.compensation.compensators)
    known = identifiable()
    for name in () if isinstance(config.models, str) else config.models:
        if name not in known:
            raise ConfigError(
                f"{config.name}, [identify], models, names {name!r}, which cannot be identified; choose of "
                f"{', '.join(known)}."
            )


@dataclass
class _Study:
    """What the steps of a study share."""

    config: StudyConfig
    out: Path
    store: Store
    executor: Executor | None
    tell: Teller

    def run(self) -> StudyResult:
        self.tell(0.0)
        data = load_data(self.config, self.out / KEPT)
        models = self._models(data)
        best = models[0]
        if best.row.rank is None:
            raise StudyError(
                f"No friction model could be identified from {data.longest.name!r}; the first reason: {best.row.reason}"
            )
        missing = self._missing(data, best)
        rows: list[CompensatorResult] = []
        servos: dict[str, Metrics] = {}
        recommendation = Recommendation("", missing)
        doctor: tuple[ConditionResult, ...] = ()
        files = list(export_models(self.out, models, data.rotary, data.longest.citation))
        if not missing:
            bench = self._bench(data, best)
            rows, servos, choices = self._compensators(data, models, bench)
            recommendation = recommend(rows[0], rows[1:], data.longest.units.position)
            chosen = next((choice for choice in choices if choice.name == recommendation.name), None)
            name = data.longest.name
            files += export_recommended(
                self.out, bench, chosen, recommendation.gain or 0.0, name, data.longest.citation
            )
            doctor = self._doctor()
        self.tell(0.97)
        record = data.longest
        files += [WrittenFile("report.html", "This study for people"), WrittenFile("study.json", "and for programs")]
        return StudyResult(
            name=record.name,
            citation=record.citation,
            units=record.units,
            overview=overview(self.config, data),
            record=series(data.records, models),
            friction=over_velocity(record, models),
            hysteresis=over_position(record, models),
            models=tuple(found.row for found in models),
            plant=best.row.name if not missing else "",
            no_compensation=missing,
            servos=servos,
            compensators=tuple(rows),
            recommendation=recommendation,
            doctor=doctor,
            files=tuple(files),
            command=f"friction-fmus study {self.config.name} -o out",
            versions={"friction-fmus": VERSION, "Python": platform.python_version(), "numpy": np.__version__},
            seconds=0.0,
        )

    def _models(self, data: Data) -> list[Found]:
        """Identify all models, fit the best ones to the closed loop, and rank them."""
        config = self.config
        measured = None
        if config.servo is not None:
            measured = measured_servo(data, config.servo, self.out / KEPT, identifier(data.longest.name))
        names = list(identifiable()) if config.models == ALL else list(config.models)
        names.sort(key=lambda name: "presliding" not in catalogue()[name].features)  # those take longest
        records = data.train, data.validation
        jobs = [
            Job(f"model-{name}", identify_model, (name, *records, data.published.get(name, {}), measured), Found)
            for name in names
        ]
        if data.longest.force is not None and data.longest.q is not None:
            arguments = (data.longest, data.published.get("inverse", {}), measured)
            jobs.append(Job("model-inverse", inverse_model, arguments, Found))
        found: list[Found] = self._do(jobs, 0.02, 0.4)
        if measured is None:
            return ranked(found)
        smallest = min((each.error for each in found if each.error is not None), default=0.0)
        close = [each.error is not None and each.error <= CLOSE * smallest for each in found]
        chosen = [each for each, is_close in zip(found, close, strict=True) if is_close and each.row.name != INVERSE]
        refined = self._do([Job(f"loop-{each.row.name}", refine, (each, measured), Found) for each in chosen], 0.4, 0.6)
        better = {each.row.name: each for each in refined}
        return ranked([better.get(each.row.name, each) for each in found])

    def _missing(self, data: Data, best: Found) -> str:
        """Why no compensator can be tried; empty if they can."""
        servo = self.config.servo
        if servo is None:
            return (
                "The record is that of a contact: no servo is known, so no compensator was tried. Add [servo] with its "
                "law, gains, Ts, force_limit and mass to the configuration to see what compensation gains."
            )
        if best.mass <= 0.0 and servo.mass is None:
            return "The moved mass is not known, so no compensator was tried. Add mass = ... to [servo]."
        if data.longest.reference is None and data.longest.q is None:
            return "The record has no position to follow, so no compensator was tried. Add a column for it."
        return ""

    def _bench(self, data: Data, best: Found) -> Bench:
        """The identified axis along the reference, from a point on it."""
        servo, record, wanted = self.config.servo, data.longest, self.config.compensation
        assert servo is not None
        t, r = record.t - record.t[0], record.reference
        if r is None:  # the path that was measured, smooth enough to be followed
            motion = filtered_motion(record, default_settings(record))
            r = record.column("q")[0] + np.concatenate([[0.0], np.cumsum(motion.v[:-1]) * record.Ts])
        last = min(t[-1], wanted.duration or t[-1])
        at = servo.Ts * np.arange(float(round(last / servo.Ts) + 1))
        r = np.interp(at, t, r)
        reference = build_reference(at, r, self.out / KEPT, f"{identifier(record.name)}Path", data.rotary)
        plant = best.plant if best.mass > 0.0 else replace(best.plant, mass=servo.mass or 0.0)
        v0 = float((r[1] - r[0]) / servo.Ts)
        trajectory = Trajectory(
            reference, len(at), float(r[0]), v0, wanted.motion_feedforward, plant.offset, rotary=data.rotary
        )
        return Bench(servo, plant, trajectory, r)

    def _compensators(
        self, data: Data, models: Sequence[Found], bench: Bench
    ) -> tuple[list[CompensatorResult], dict[str, Metrics], list[Choice]]:
        """Rows in order, "none" first; the servos without compensation; the choices."""
        wanted = self.config.compensation
        known = Known(
            bench.servo,
            bench.plant,
            {found.block: found.values for found in reversed(models) if found.row.rank is not None},
            period_of(bench.r, 100),
            float(np.max(np.abs(np.diff(bench.r)))) / bench.servo.Ts,
            data.rotary,
        )
        choices = candidates(wanted.compensators, known)
        tried = [choice for choice in choices if choice.compensator is not None]
        as_measured = replace(bench, trajectory=replace(bench.trajectory, motion=False, offset=0.0))
        jobs = [
            Job("servo-as-measured", try_out, (as_measured, None, (), 0.0), Trial),
            Job("compensator-none", try_out, (bench, None, (), wanted.mismatch), Trial),
        ]
        jobs += [
            Job(
                f"compensator-{choice.name}", try_out, (bench, choice.compensator, wanted.gains, wanted.mismatch), Trial
            )
            for choice in tried
        ]
        plain, without, *trials = self._do(jobs, 0.6, 0.9)
        # one after the other, while nothing else runs here
        prices = [
            Job(f"cost-{each.name}", cost_of, (each.compensator, bench.servo.Ts, data.rotary), Cost) for each in tried
        ]
        costs = do(prices, self.store, None, self.tell.steps(0.9, 0.95, len(prices)))
        none = compensator_row("none", "The servo without friction compensation", "none", None, without)
        none = extremes(none, none)
        if none.metrics is None:
            raise StudyError(f"The servo is unstable even without compensation: {without.sweep[0].failure}")
        found = {c.name: (trial, cost.ns) for c, trial, cost in zip(tried, trials, costs, strict=True)}
        blocks = catalogue()
        rows = [
            compensator_row(
                choice.name, blocks[choice.name].summary, choice.kind, choice, *found.get(choice.name, (None,))
            )
            for choice in choices
        ]
        servos = {"as measured": plain.metrics} if plain.metrics is not None else {}
        if wanted.motion_feedforward:
            servos["with motion feedforward"] = none.metrics
        return [none, *rank(none, rows)], servos, choices

    def _doctor(self) -> tuple[ConditionResult, ...]:
        """Conditions of the axis as it was exported, violated ones first."""
        with System.from_ssp(self.out / OWN / "axis.ssp") as system:
            findings = examine(system)
        rows = []
        for finding in findings:
            c = finding.condition
            texts = ("", "", "", "") if c.ok else (c.wrong, c.why, c.change, c.source)
            value, bound = (float(number) if np.isfinite(number) else None for number in (c.value, c.bound))
            rows.append(ConditionResult(finding.parts, c.name, c.ok, *texts, value, bound))
        return tuple(sorted(rows, key=lambda row: row.ok))

    def _do(self, jobs: Sequence[Job], begin: float, end: float) -> list[Any]:
        return do(jobs, self.store, self.executor, self.tell.steps(begin, end, len(jobs)))


__all__ = ["StudyError", "run_study"]
