"""The study of the EMPS axis: record -> parameters -> FMUs -> closed loop -> compensation -> report."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from friction_fmus.data import EMPS_PUBLISHED, MeasuredAxis, load_emps
from friction_fmus.errors import FrictionError
from friction_fmus.identification import (
    Array,
    Estimate,
    InverseModelFit,
    Mapper,
    OutputErrorFit,
    Target,
    Unknown,
    fit_output_error,
    identify_inverse_model,
    identify_inverse_stribeck,
)
from harness import Progress

from .figures import (
    LABEL,
    FrictionCurve,
    Trace,
    compensation_figure,
    force_figure,
    friction_figure,
    position_figure,
)
from .metrics import START_UP, agreement, tracking_rms_um
from .parameters import ssv_bytes, toml_text
from .report import Illustration, report_html
from .servo import (
    ServoFmus,
    ServoRun,
    build_axis,
    build_fixed,
    forget_systems,
    friction_curve,
    model_parameters,
    run_servo,
    write_servo,
)
from .summary import AS_MEASURED, WITH_MOTION, Compensation, Identified, Summary, Tracking

MEANING = {
    "M": "moved mass",
    "Fv": "viscous coefficient",
    "Fc": "Coulomb friction",
    "Fs": "friction close to rest",
    "vs": "Stribeck velocity",
    "delta": "Stribeck exponent (chosen)",
    "OF": "offset of the drive",
}


class StudyError(FrictionError):
    """A study cannot be done as asked."""


@dataclass(frozen=True)
class StudySettings:
    """How the study is done.

    Attributes
    ----------
    step : float
        Communication step of the servo in the results [s].
    fit_step : float
        The same for the many runs of the fit [s].
    workers : int
        Processes that simulate side by side; more than 1 needs the guard ``if __name__ == "__main__":`` in a
        script, as `multiprocessing` does.
    """

    step: float = 1e-4
    fit_step: float = 2.5e-4
    workers: int = 1


def run_study(out: Path, progress: Progress | None = None, settings: StudySettings | None = None) -> Summary:
    """Do the study of the EMPS axis.

    Parameters
    ----------
    out : Path
        Folder for the results; made if needed. Files of an earlier study in it are replaced, nothing else is
        touched. It stays as it was if the study fails.
    progress : Progress, optional
        Told how far the study is, in percent.
    settings : StudySettings, optional
        Communication steps and number of processes.

    Returns
    -------
    Summary
        The figures, as in `summary.json`.

    Raises
    ------
    StudyError
        The folder cannot be made.
    FrictionError, HarnessError
        Whatever goes wrong in identification, build or co-simulation.

    Notes
    -----
    Written are `report.html`, `summary.json`, `parameters.toml`, `coulomb.ssv`, `stribeck.ssv`, the FMUs in
    `fmus/`, and a system file for each servo: `servo_coulomb.toml`, `servo_stribeck.toml` and those with
    feedforward. Data: Janot, Gautier, Brunot 2019.
    """
    settings = StudySettings() if settings is None else settings
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StudyError(f"Cannot make the folder {out} ({error.strerror}); give another one.") from error
    # on the same file system, so that the results move into place
    with tempfile.TemporaryDirectory(prefix=".study-", dir=out) as scratch, _pool(settings.workers) as pool:
        stage = Path(scratch) / "results"
        stage.mkdir()
        mapper: Mapper = map if pool is None else pool.map
        try:
            summary = _study(stage, Path(scratch), _teller(progress), settings, mapper)
        finally:
            forget_systems()
        for file in summary.files:
            (out / file).parent.mkdir(parents=True, exist_ok=True)
            (stage / file).replace(out / file)
    _teller(progress)(1.0)
    return summary


def _study(out: Path, scratch: Path, tell: Callable[[float], None], settings: StudySettings, mapper: Mapper) -> Summary:
    """Do the study; every file of the results is below `out`."""
    tell(0.0)
    measured = load_emps()
    record = measured.record
    inverse = identify_inverse_model(record)
    start = identify_inverse_stribeck(record)

    tell(0.02)
    fmus = out / "fmus"
    fixed = build_fixed(measured, fmus, "Emps")
    by_model = {"coulomb": build_axis(measured, inverse.values(), fmus, "Emps", "Coulomb")}

    tell(0.15)
    system = write_servo(
        scratch / "fit.toml",
        _servo(fixed, by_model["coulomb"]),
        len(record),
        measured.servo,
        settings.fit_step,
    )
    fit = _fit(measured, start, system, mapper, tell)
    delta = start.parameters["delta"]
    stribeck = {**fit.values(), "delta": delta.value}

    tell(0.65)
    by_model["stribeck"] = build_axis(measured, stribeck, fmus, "Emps", "Stribeck")

    tell(0.7)
    runs = _write_runs(out, fixed, by_model, measured, stribeck["M"], settings)
    traces = dict(zip(runs, mapper(_run, runs.values()), strict=True))
    rows, errors = _compensation(record.column("reference"), traces)

    tell(0.9)
    identified = {name: _identified(estimate, name) for name, estimate in inverse.parameters.items()}
    order = ("M", "Fv", "Fc", "Fs", "vs", "delta", "OF")
    estimates = {**fit.parameters, "delta": delta}
    summary = Summary(
        record=record.name,
        citation=record.citation,
        identified=identified,
        stribeck={name: replace(_identified(estimates[name], name), published=None) for name in order},
        closed_loop={name: agreement(record, traces[name].q, traces[name].force) for name in LABEL},
        compensation=Compensation(tuple(rows)),
        notes=_notes(measured, settings, fit, inverse),
    )
    sets = {
        "coulomb": model_parameters(*_columns(inverse.parameters), MEANING),
        "stribeck": model_parameters(*_columns({name: estimates[name] for name in order}), MEANING),
    }
    for name, parameters in sets.items():
        (out / f"{name}.ssv").write_bytes(ssv_bytes(f"{record.name} {LABEL[name]}", parameters, record.citation))
    title = f"Identified parameters of the axis {record.name}"
    (out / "parameters.toml").write_text(toml_text(title, sets, record.citation), encoding="utf-8")

    written = [path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file()]
    summary = replace(summary, files=tuple(sorted([*written, "report.html", "summary.json"])))
    friction = {name: carriers["friction"] for name, carriers in by_model.items()}
    pictures = _pictures(measured, inverse, friction, traces, errors)
    page = report_html(summary, pictures, "friction-fmus study emps -o out")
    (out / "report.html").write_text(page, encoding="utf-8")
    (out / "summary.json").write_text(summary.to_json(), encoding="utf-8")
    return summary


def _fit(
    measured: MeasuredAxis, start: InverseModelFit, system: Path, mapper: Mapper, tell: Callable[[float], None]
) -> OutputErrorFit:
    """Fit mass and Stribeck curve so that the co-simulated servo moves as the measured one did.

    Only the position is compared: the force follows from it through the known controller and would count the
    same error twice. The exponent is not fitted, vs and delta trade for each other over the few speeds of
    the record; it is the one of 1 and 2 that suits the inverse model better. The steps of the differences
    are some percent, for a change of a parameter must move the axis by more than the grid of its encoder.
    """
    values = start.values()
    steps = {"M": 2.0, "Fv": 8.0, "Fc": 0.8, "Fs": 1.6, "vs": 0.2 * values["vs"], "OF": 0.4}
    lower = {"M": 1e-3, "Fv": 0.0, "Fc": 0.0, "Fs": 0.0, "vs": 1e-5}
    unknowns = [
        Unknown(name, values[name], step, start.parameters[name].unit, lower.get(name, -np.inf))
        for name, step in steps.items()
    ]
    expected = 16  # simulations, for the progress only
    return fit_output_error(
        ServoRun(system, (("delta", values["delta"]),)),
        unknowns,
        {"q": Target(measured.record.column("q"), 1e-6)},
        mapper=mapper,
        correlation=round(0.2 / measured.servo.Ts),
        iterated=lambda done: tell(0.15 + 0.5 * min(1.0, done / expected)),
    )


def _write_runs(
    out: Path,
    fixed: Mapping[str, Path],
    by_model: Mapping[str, Mapping[str, Path]],
    measured: MeasuredAxis,
    mass: float,
    settings: StudySettings,
) -> dict[str, Path]:
    """Write the system file of every run; the axis that is compensated is the Stribeck one."""
    runs: dict[str, Path] = {}

    def write(name: str, model: str, feedforward: str | None, motion_mass: float | None) -> None:
        forward = None if feedforward is None else by_model[feedforward]["feedforward"]
        runs[name] = write_servo(
            out / f"servo_{name}.toml",
            replace(_servo(fixed, by_model[model]), feedforward=forward),
            len(measured.record),
            measured.servo,
            settings.step if name in LABEL else settings.fit_step,
            motion_mass,
        )

    for model in LABEL:
        write(model, model, None, None)
    for feedforward in LABEL:
        write(f"feedforward_{feedforward}", "stribeck", feedforward, None)
    write("motion", "stribeck", None, mass)
    for feedforward in LABEL:
        write(f"motion_feedforward_{feedforward}", "stribeck", feedforward, mass)
    return runs


def _compensation(reference: Array, traces: Mapping[str, Trace]) -> tuple[list[Tracking], dict[str, dict[str, Array]]]:
    """Return the tracking errors as table rows and as signals by servo and feedforward."""
    runs = {
        AS_MEASURED: {"none": "stribeck", **{name: f"feedforward_{name}" for name in LABEL}},
        WITH_MOTION: {"none": "motion", **{name: f"motion_feedforward_{name}" for name in LABEL}},
    }
    errors = {
        servo: {feedforward: reference - traces[run].q for feedforward, run in named.items()}
        for servo, named in runs.items()
    }
    rows = [
        Tracking(
            servo,
            feedforward,
            tracking_rms_um(reference, reference - error),
            1e6 * float(np.max(np.abs(error[START_UP:]))),
        )
        for servo, named in errors.items()
        for feedforward, error in named.items()
    ]
    return rows, errors


def _pictures(
    measured: MeasuredAxis,
    inverse: InverseModelFit,
    friction: Mapping[str, Path],
    traces: Mapping[str, Trace],
    errors: Mapping[str, Mapping[str, Array]],
) -> list[Illustration]:
    record = measured.record
    closed = {name: traces[name] for name in LABEL}
    fastest = float(np.max(np.abs(inverse.v)))
    at = np.linspace(-1.05 * fastest, 1.05 * fastest, 2000)  # even, so that it steps over the jump at rest
    curve = FrictionCurve(
        inverse.v, inverse.friction, at, {name: friction_curve(fmu, at) for name, fmu in friction.items()}
    )
    return [
        Illustration(
            "friction",
            friction_figure(curve),
            "Friction over velocity: the two identified models and the data of the record behind them "
            "(drive force less inertia, filtered and decimated). At low speed there are few data, all of "
            "them from reversals.",
        ),
        Illustration(
            "closed loop",
            position_figure(record, closed),
            "Position error of the servo, measured and co-simulated, and the difference of the two.",
        ),
        Illustration(
            "closed loop",
            force_figure(record, closed),
            "Drive force, measured and co-simulated, and the difference of the two.",
        ),
        Illustration(
            "compensation",
            compensation_figure(record, errors),
            "Tracking error of the co-simulated servo with and without friction feedforward.",
        ),
    ]


def _notes(
    measured: MeasuredAxis, settings: StudySettings, fit: OutputErrorFit, inverse: InverseModelFit
) -> dict[str, str]:
    servo = measured.servo
    return {
        "record": f"{len(measured.record)} samples of {1e3 * servo.Ts:g} ms",
        "servo": f"kp {servo.kp:g} 1/s, kv {servo.kv:.1f} N.s/m, limit ±{servo.force_limit:.1f} N, "
        f"velocity over {servo.window} samples, encoder {1e9 * servo.quantum:g} nm",
        "communication step": f"{1e6 * settings.step:g} µs against the record, "
        f"{1e6 * settings.fit_step:g} µs in the fit and with feedforward, Gauss-Seidel; sampled parts once "
        "per sample",
        "tracking errors": f"without the first {START_UP} samples, in which the axis catches up with its reference",
        "inverse model": f"relative residual {100.0 * inverse.relative_residual:.2f} %, condition number "
        f"{inverse.condition:.1f}",
        "closed-loop fit": f"position only, {fit.simulations} simulations, "
        + ("converged" if fit.converged else "ended by the limit of iterations"),
    }


def _identified(estimate: Estimate, name: str) -> Identified:
    return Identified(estimate.value, estimate.standard_error, estimate.unit, EMPS_PUBLISHED.get(name), MEANING[name])


def _columns(
    parameters: Mapping[str, Estimate],
) -> tuple[dict[str, float], dict[str, float], dict[str, str]]:
    return (
        {name: estimate.value for name, estimate in parameters.items()},
        {name: estimate.standard_error for name, estimate in parameters.items()},
        {name: estimate.unit for name, estimate in parameters.items()},
    )


def _servo(fixed: Mapping[str, Path], model: Mapping[str, Path]) -> ServoFmus:
    return ServoFmus(**fixed, axis=model["axis"], friction=model["friction"])


def _run(path: Path) -> Trace:
    return run_servo(path)


def _teller(progress: Progress | None) -> Callable[[float], None]:
    """Return a function that takes the part done, 0 to 1."""
    if progress is None:
        return lambda part: None
    return lambda part: progress.update(round(100.0 * part), 100)


@contextmanager
def _pool(workers: int) -> Iterator[Executor | None]:
    """Give a pool of processes that have already imported this module, or None for one worker."""
    if workers < 2:
        yield None
        return
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        for _ in range(workers):
            pool.submit(_ready)
        try:
            yield pool
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _ready() -> None:
    """Do nothing; to be called makes a new process import this module."""
