"""Friction models of a study: identification, co-simulation of the servo with each model, and ranking."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from friction_fmus.axis.loop import Plant, Trajectory, closed_loop, run_loop
from friction_fmus.axis.servo import Servo
from friction_fmus.blocks.catalogue import find
from friction_fmus.errors import FrictionError
from friction_fmus.identification import (
    LINEAR,
    ROTARY,
    Array,
    Estimate,
    Identification,
    Record,
    Score,
    Target,
    Unknown,
    fit_output_error,
    identify,
    identify_inverse_model,
)
from friction_fmus.identification.fit.models import contact_model
from friction_fmus.identification.fit.scores import weak_parameters
from friction_fmus.identification.fit.simulation_data import default_settings
from friction_fmus.study.records import Curve, Fit, IdentifiedParameter, ModelResult
from friction_fmus.study.thinning import thinned
from harness import HarnessError

ALIKE: Final = 0.05
"""Relative difference below which errors count as equal; the information criterion then decides."""

INVERSE: Final = "Coulomb + viscous"
"""Name of the inverse model in the results."""

MEANING: Final = {"M": "moved mass", "OF": "offset of the drive"}

_STEPS: Final = {"M": 0.02, "vs": 0.2, "Fs": 0.1}
"""Relative step of a parameter for differences, 4 % by default: its effect must exceed the encoder resolution."""


@dataclass(frozen=True)
class IdentifiedModel:
    """Identified friction model.

    Attributes
    ----------
    row : ModelResult
        Entry in the result of the study.
    block : str
        Friction block.
    values : mapping of str to float
        Parameters of the block.
    mass, offset : float
        Mass [kg] and constant force [N] of the axis; 0 if the record has no drive force.
    error : float or None
        Error by which the models are ranked; None if it is infinite or the model failed.
    predicted : Curve or None
        Fitted signal over time as simulated by the model.
    position, force : Curve or None
        Simulated minus measured position, and simulated force, of the servo over time.
    """

    row: ModelResult
    block: str = ""
    values: Mapping[str, float] = field(default_factory=dict)
    mass: float = 0.0
    offset: float = 0.0
    error: float | None = None
    predicted: Curve | None = None
    position: Curve | None = None
    force: Curve | None = None

    @property
    def plant(self) -> Plant:
        """Axis with this friction."""
        return Plant(self.block, self.values, self.mass, self.offset)


@dataclass(frozen=True, eq=False)
class Measured:
    """Measured servo.

    Attributes
    ----------
    servo : Servo
        Feedback and sensors.
    trajectory : Trajectory
        Reference and initial state of the whole record.
    q, force : array, shape (samples,)
        Measured position and force.
    train, validation : (int, int)
        First and one past the last sample of the data for the fit and for the ranking.
    """

    servo: Servo
    trajectory: Trajectory
    q: Array
    force: Array | None
    train: tuple[int, int]
    validation: tuple[int, int]


def identify_model(
    name: str,
    train: Sequence[Record],
    validation: Sequence[Record],
    published: Mapping[str, float],
    measured: Measured | None,
) -> IdentifiedModel:
    """Identify a friction model; if the identification fails, the result states the reason.

    Parameters
    ----------
    name : str
        Friction block.
    train, validation : sequence of Record
        Data for the fit and for validation.
    published : mapping of str to float
        Known parameter values.
    measured : Measured or None
        Measured servo, to be co-simulated with the identified model.
    """
    summary = find(name).summary
    try:
        # a model without state is fast to simulate and its cost may have several local minima
        starts = 3 if contact_model(name, train[0].units).static else 1
        result = identify(name, list(train), validation=list(validation) or None, starts=starts)
    except (FrictionError, HarnessError, ArithmeticError, np.linalg.LinAlgError) as error:
        return IdentifiedModel(ModelResult(name, summary, reason=str(error)))
    found = IdentifiedModel(
        row_of(result, summary, published),
        name,
        {key: value for key, value in result.values().items() if key not in MEANING},
        result.values().get("M", 0.0),
        result.values().get("OF", 0.0),
        (result.validation or result.train).rms,
        thinned(result.t, result.predicted),
    )
    if measured is None or found.mass <= 0.0:
        return found
    try:
        return in_closed_loop(found, measured)
    except (FrictionError, HarnessError) as error:
        warnings = (*found.row.warnings, f"The servo could not be co-simulated with this model: {error}")
        return replace(found, row=replace(found.row, warnings=warnings), error=None)


def inverse_model(record: Record, published: Mapping[str, float], measured: Measured | None) -> IdentifiedModel:
    """Identify mass, viscous and Coulomb friction and offset by least squares of the inverse model.

    The method is IDIM-LS (Janot, Gautier, Brunot 2019); the result is a Stribeck block without Stribeck effect.
    """
    summary = "Coulomb and viscous friction from the inverse model (IDIM-LS)"
    try:
        fit = identify_inverse_model(record, default_settings(record))
    except FrictionError as error:
        return IdentifiedModel(ModelResult(INVERSE, summary, reason=str(error)))
    rows = tuple(
        IdentifiedParameter(p.name, p.value, p.standard_error, p.unit, MEANING.get(p.name, ""), published.get(p.name))
        for p in fit.parameters.values()
    )
    Fc = fit.parameters["Fc"].value
    force = record.column("force")
    train = Fit(fit.relative_residual * _rms(force), 100.0 * fit.relative_residual, "force", record.units.force)
    found = IdentifiedModel(
        ModelResult(INVERSE, summary, "inverse", rows, train, simulations=0),
        "Stribeck",
        {"Fc": Fc, "Fs": Fc, "Fv": fit.parameters["Fv"].value},
        fit.parameters["M"].value,
        fit.parameters["OF"].value,
        train.rms,
    )
    return found if measured is None else in_closed_loop(found, measured)


def row_of(result: Identification, summary: str, published: Mapping[str, float]) -> ModelResult:
    """Return an identification as entry in the result of a study."""
    known = contact_model(result.block, result.records[0].units).parameters

    def parameter(name: str, estimate: Estimate) -> IdentifiedParameter:
        error = estimate.standard_error
        meaning = MEANING.get(name) or known[name].text
        return IdentifiedParameter(
            name,
            estimate.value,
            error if np.isfinite(error) else None,
            estimate.unit,
            meaning,
            published.get(name),
            result.weak.get(name, ""),
        )

    def fit(score: Score | None) -> Fit | None:
        return None if score is None else Fit(score.rms, score.relative_percent, result.signal, result.unit)

    return ModelResult(
        result.model,
        summary,
        result.method,
        tuple(parameter(name, estimate) for name, estimate in result.parameters.items()),
        fit(result.train),
        fit(result.validation),
        aic=result.aic,
        bic=result.bic,
        warnings=tuple(result.warnings),
        seconds=result.seconds,
        simulations=result.simulations,
    )


def in_closed_loop(found: IdentifiedModel, measured: Measured) -> IdentifiedModel:
    """Co-simulate the servo with an identified model from the start of the record."""
    with closed_loop(measured.servo, found.plant, measured.trajectory) as system:
        trace = run_loop(system)
    if not (np.isfinite(trace.q).all() and np.isfinite(trace.force).all()):
        raise FrictionError("the loop is unstable.")
    q, force = measured.q, measured.force
    units = ROTARY if measured.trajectory.rotary else LINEAR
    fits = [Fit(_rms(trace.q - q), 100.0 * _rms(trace.q - q) / _rms(q), "position", units.position)]
    t = measured.servo.Ts * np.arange(float(len(q)))
    if force is not None:
        fits.append(
            Fit(_rms(trace.force - force), 100.0 * _rms(trace.force - force) / _rms(force), "force", units.force)
        )
    return replace(
        found,
        row=replace(found.row, closed_loop=tuple(fits)),
        error=_rms((trace.q - q)[slice(*measured.validation)]),
        position=thinned(t, trace.q - q),
        force=thinned(t, trace.force),
    )


def refine(found: IdentifiedModel, measured: Measured) -> IdentifiedModel:
    """Fit the well-determined parameters so that the co-simulated servo follows the measured motion.

    Only positions are compared: the force follows from the position through the known controller and would count the
    same error twice. If the fit does not reduce the error, the model is returned unchanged.
    """
    rows = {p.name: p for p in found.row.parameters}
    free = [p for p in rows.values() if p.standard_error is not None and p.standard_error < abs(p.value)]
    free = [p for p in free if p.value > 0.0 or p.name == "OF"]
    level = max((found.values.get(name, 0.0) for name in ("Fc", "Fs", "f1")), default=0.0)
    if "M" not in {p.name for p in free} or not level:
        return found

    def step(p: IdentifiedParameter) -> float:
        return 0.02 * level if p.name == "OF" else _STEPS.get(p.name, 0.04) * p.value

    contact = contact_model(found.block, ROTARY if measured.trajectory.rotary else LINEAR)
    known = contact.parameters

    def unknown(p: IdentifiedParameter) -> Unknown:
        lower = -np.inf if p.name == "OF" else 1e-3 * p.value
        if p.name in known:
            return Unknown(p.name, p.value, step(p), p.unit, max(lower, known[p.name].lower), known[p.name].upper)
        return Unknown(p.name, p.value, step(p), p.unit, lower)

    unknowns = [unknown(p) for p in free]
    first, last = measured.train
    trajectory = replace(measured.trajectory, samples=last)
    with closed_loop(measured.servo, found.plant, trajectory) as system:

        def simulate(values: Mapping[str, float]) -> dict[str, Array]:
            own = {f"friction.{name}": value for name, value in values.items() if name not in MEANING}
            moved = {"axis.m": values["M"], "axis.F_load": -values.get("OF", found.offset)}
            return {"q": run_loop(system.with_start({**own, **moved})).q}

        target = Target(measured.q[:last], 1e-6 if found.error is None else max(found.error, 1e-12), first)
        try:
            fit = fit_output_error(
                simulate, unknowns, {"q": target}, correlation=max(1, round(0.2 / measured.servo.Ts))
            )
        except (FrictionError, HarnessError):
            return found
    values = fit.values()
    errors = {name: estimate.standard_error for name, estimate in fit.parameters.items()}
    weak = weak_parameters(contact, list(values), values, errors, fit.correlation, {}, ())

    def replaced(p: IdentifiedParameter) -> IdentifiedParameter:
        if p.name not in values:
            return p
        error = errors[p.name] if np.isfinite(errors[p.name]) else None
        return replace(p, value=values[p.name], standard_error=error, weak=weak.get(p.name, ""))

    refined = IdentifiedModel(
        replace(
            found.row,
            method=f"{found.row.method}, then closed-loop",
            parameters=tuple(replaced(p) for p in rows.values()),
            simulations=found.row.simulations + fit.simulations,
        ),
        found.block,
        {name: values.get(name, value) for name, value in found.values.items()},
        values["M"],
        values.get("OF", found.offset),
        found.error,
        found.predicted,
    )
    refined = in_closed_loop(refined, measured)
    better = found.error is None or (refined.error is not None and refined.error < found.error)
    return refined if better else found


def ranked(models: Sequence[IdentifiedModel]) -> list[IdentifiedModel]:
    """Return the models with their ranks, ordered by error, and by BIC if errors are equal within `ALIKE`."""
    left = sorted((found for found in models if found.error is not None and np.isfinite(found.error)), key=_error)
    ordered: list[IdentifiedModel] = []
    while left:
        alike = [found for found in left if _error(found) <= (1.0 + ALIKE) * _error(left[0])]
        first = min(alike, key=lambda found: np.inf if found.row.bic is None else round(found.row.bic, 3))
        ordered.append(replace(first, row=replace(first.row, rank=len(ordered) + 1)))
        left.remove(first)
    return ordered + [found for found in models if found.error is None or not np.isfinite(found.error)]


def _error(found: IdentifiedModel) -> float:
    """Return the error rounded to six digits: differences in the last bits must not decide the order."""
    assert found.error is not None
    return float(f"{found.error:.6g}")


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
