"""Friction models of a study: identification, co-simulation of the servo with each model, and ranking."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any, Final

import numpy as np

from friction_fmus.axis.loop_assembly import constant_force, start_of
from friction_fmus.axis.position_map import PositionMap, gravity_map
from friction_fmus.axis.servo import SHARES, AxisPlant, FlexibleLoad, Servo, Trajectory
from friction_fmus.axis.servo_loop import closed_loop, run_loop
from friction_fmus.blocks.axis_units import AxisUnits
from friction_fmus.blocks.catalogue import find, summary_of
from friction_fmus.errors import FrictionError
from friction_fmus.identification import (
    LINEAR,
    PUBLISHED_SETTINGS,
    ROTARY,
    Array,
    Estimate,
    Identification,
    Record,
    Score,
    identify,
)
from friction_fmus.identification.fit.axis_terms import VALUES
from friction_fmus.identification.fit.block_fit import driven
from friction_fmus.identification.fit.contact_model import contact_model
from friction_fmus.identification.fit.idim import (
    InverseModelFit,
    default_settings,
    filtered_motion,
    identify_inverse_model,
)
from friction_fmus.identification.fit.output_error import TargetSignal, Unknown, fit_output_error
from friction_fmus.identification.fit.position import PositionFit
from friction_fmus.identification.fit.rests import standstill
from friction_fmus.identification.fit.scores import rms, weak_parameters
from friction_fmus.identification.fit.simulation_data import PreparedSegment, prepare
from friction_fmus.identification.identifying import BELOW, FS_BELOW_FC
from friction_fmus.identification.model_comparison import useless, within_reach
from friction_fmus.study.study_result import Fit, IdentifiedParameter, ModelResult, PositionPart, StudyCurve, thinned


def inverse_residual(fit: InverseModelFit, records: Sequence[Record]) -> Fit | None:
    """Return the residual of the drive force of an inverse model, filtered and decimated as in its fit."""
    M, Fv, Fc, OF = (fit.parameters[name].value for name in ("M", "Fv", "Fc", "OF"))
    errors, forces = [], []
    for record in records:
        settings = default_settings(record)
        try:
            settings.require(record)
            motion = filtered_motion(record, settings)
        except FrictionError:
            continue
        predicted = M * motion.a + Fv * motion.v + Fc * np.sign(motion.v) + OF
        used = settings.rows_outside(standstill(record), record.Ts)
        rows = settings.rows(np.column_stack([predicted, record.force_at_samples()]), record.Ts)
        model, force = (rows if used is None else rows[used]).T
        errors.append(model - force)
        forces.append(force)
    if not errors:
        return None
    error, size = (rms(np.concatenate(parts)) for parts in (errors, forces))
    return Fit(error, 100.0 * error / size, "force", records[0].units.force) if size > 0.0 else None


ALIKE: Final = 0.05  # relative difference below which errors count as equal; the number of parameters then decides

REPRODUCED: Final = 0.5
"""Largest error of a simulated servo that reproduces the record, in parts of the tracking error or rms force."""

QUANTA: Final = 10.0  # smallest tracking error for this comparison, in steps of the encoder: rounding is not reproduced

INVERSE: Final = "Coulomb + viscous"  # name of the inverse model in the results

PUBLISHED: Final = "Coulomb + viscous, as published"
"""Name of the inverse model with the data and settings of a publication."""

VISCOUS_BESIDE: Final = "viscous friction beside the model"  # meaning of the parameter Fv of a model that has none

MEANING: Final = {
    "M": "{moved_mass}",
    "OF": "offset of the drive",
    "G_sin": "{force} against gravity: factor of the sine of the position",
    "G_cos": "the same: factor of the cosine",
    "a": "friction over the {force}s that the transmission carries",
}  # what is identified beside the parameters of a block

OF_ARM: Final = ("auto", "gravity", "load")  # terms beside the friction that are tried on a rotary axis


@dataclass(frozen=True)
class IdentifiedModel:
    """Identified friction model."""

    row: ModelResult  # entry in the result of the study
    block: str = ""  # friction block
    values: Mapping[str, float] = field(default_factory=dict)  # parameters of the block
    mass: float = 0.0
    offset: float = 0.0
    """Mass [kg] and constant force [N] of the axis; 0 if the record has no drive force."""
    error: float | None = None  # error by which the models are ranked; None if it is infinite or the model failed
    force_error: float | None = None
    """Rms force error of the simulated servo over the same samples; None if it was not simulated."""
    predicted: StudyCurve | None = None  # fitted signal over time as simulated by the model
    position: StudyCurve | None = None
    force: StudyCurve | None = None
    """Simulated minus measured position and force of the servo over time."""
    position_map: PositionMap | None = None  # cogging and position-dependent friction
    load: FlexibleLoad | None = None  # part of the mass behind a spring, with which the servo was simulated
    terms: dict[str, float] = field(default_factory=dict)  # gravity and load, see `AxisPlant`

    @property
    def plant(self) -> AxisPlant:
        """Axis with this friction."""
        return AxisPlant(self.block, self.values, self.mass, self.offset, self.position_map, self.load, self.terms)


@dataclass(frozen=True, eq=False)
class Measured:
    """Measured servo."""

    servo: Servo  # feedback and sensors
    trajectory: Trajectory  # reference and initial state of the whole record
    q: Array
    force: Array | None
    r: Array
    """Measured position and force, and the reference; the force contains an injected one."""
    train: tuple[int, int]
    validation: tuple[int, int]
    """First and one past the last sample of the data for the fit and for the ranking."""


def identify_model(
    name: str,
    train: Sequence[Record],
    validation: Sequence[Record],
    published: Mapping[str, float],
    measured: Measured | None,
    position_map: bool = True,
    viscous: bool = True,
) -> IdentifiedModel:
    """Identify a friction model; if the identification fails, the result states the reason."""
    summary = summary_of(find(name), train[0].units.words)
    try:
        # a model without state is fast to simulate and its cost may have several local minima
        starts = 3 if contact_model(name, train[0].units).static else 1
        options: dict[str, Any] = {"validation": list(validation) or None, "starts": starts}
        options |= {"position_map": position_map, "viscous": viscous}
        if train[0].units.rotary and train[0].force is not None and train[0].friction is None:
            options["terms"] = OF_ARM
        result = within_reach(identify, name, list(train), **options)
    except (FrictionError, ArithmeticError, np.linalg.LinAlgError) as error:
        return IdentifiedModel(ModelResult(name, summary, reason=str(error)))
    if reason := useless(result):
        return IdentifiedModel(ModelResult(name, summary, reason=f"{reason}."))
    given = result.values()
    values = {key: value for key, value in given.items() if key not in MEANING}
    terms = {key: value for key, value in given.items() if key in ("G_sin", "G_cos")}
    table = None if result.position is None else result.position.table
    table = gravity_map(terms["G_sin"], terms["G_cos"]) if terms else table
    if "a" in given:
        terms |= dict.fromkeys(SHARES, given["a"])
        values["Fn0"] = contact_model(name, train[0].units).level(values)
    found = IdentifiedModel(
        row_of(result, summary, published),
        name,
        values,
        given.get("M", 0.0),
        given.get("OF", 0.0),
        (result.validation or result.train).rms,
        predicted=thinned(result.t, result.predicted),
        position_map=table,
        terms=terms,
    )
    return _simulated(found, measured)


def inverse_model(train: Sequence[Record], validation: Sequence[Record], measured: Measured | None) -> IdentifiedModel:
    """Identify mass, friction and offset of the longest record by IDIM-LS (Janot, Gautier, Brunot 2019) as Stribeck."""
    summary = "Coulomb and viscous friction from the inverse model (IDIM-LS)"
    record = max(train, key=len)
    try:
        fit = identify_inverse_model(record)
    except FrictionError as error:
        return IdentifiedModel(ModelResult(INVERSE, summary, reason=str(error)))
    rows = _inverse_parameters(fit, {}, record.units)
    Fc = fit.parameters["Fc"].value
    negative = [p for p in fit.parameters.values() if p.name != "OF" and p.value < 0.0]
    if negative:
        listed = ", ".join(f"{p.name} = {p.value:.4g} {p.unit}".removesuffix(" 1") for p in negative)
        reason = f"the {record.units.words.force} fits negative parameters ({listed})."
        return IdentifiedModel(ModelResult(INVERSE, summary, "inverse", rows, reason=reason, simulations=0))
    fitted = inverse_residual(fit, [record])
    assert fitted is not None
    validated = inverse_residual(fit, validation)
    found = IdentifiedModel(
        ModelResult(INVERSE, summary, "inverse", rows, fitted, validated, simulations=0),
        "Stribeck",
        {"Fc": Fc, "Fs": Fc, "Fv": fit.parameters["Fv"].value},
        fit.parameters["M"].value,
        fit.parameters["OF"].value,
        (validated or fitted).rms,
    )
    return _simulated(found, measured)


def published_model(record: Record, published: Mapping[str, float]) -> IdentifiedModel:
    """Repeat a published identification of the inverse model on the whole record; it has no rank.

    Residuals on data that were fitted do not compare with those of the other models on validation data.
    """
    summary = "Coulomb and viscous friction from the inverse model (IDIM-LS), fitted to the whole record as published"
    rows = _inverse_parameters(identify_inverse_model(record, PUBLISHED_SETTINGS), published, record.units)
    reason = "it repeats the published identification of the whole record, validation data included."
    return IdentifiedModel(ModelResult(PUBLISHED, summary, "inverse", rows, reason=reason, simulations=0))


def _inverse_parameters(
    fit: InverseModelFit, published: Mapping[str, float], units: AxisUnits
) -> tuple[IdentifiedParameter, ...]:
    return tuple(
        IdentifiedParameter(
            p.name, p.value, p.standard_error, p.unit, units.words.fill(MEANING.get(p.name, "")), published.get(p.name)
        )
        for p in fit.parameters.values()
    )


def _simulated(found: IdentifiedModel, measured: Measured | None) -> IdentifiedModel:
    """Return a model co-simulated with the servo, or with the reason why that is not possible."""
    if measured is None or found.mass <= 0.0:
        return found
    try:
        return in_closed_loop(found, measured)
    except FrictionError as error:
        reason = f"the servo could not be co-simulated with this model: {error}"
        return replace(found, row=replace(found.row, reason=reason), error=None)


def row_of(result: Identification, summary: str, published: Mapping[str, float]) -> ModelResult:
    """Return an identification as entry in the result of a study."""
    units = result.records[0].units
    known = contact_model(result.block, units).parameters

    def parameter(name: str, estimate: Estimate) -> IdentifiedParameter:
        error = estimate.standard_error
        meaning = units.words.fill(MEANING.get(name, "")) or (known[name].text if name in known else VISCOUS_BESIDE)
        return IdentifiedParameter(
            name,
            estimate.value,
            error if np.isfinite(error) else None,
            estimate.unit,
            meaning,
            published.get(name),
            result.weak.get(name, ""),
            estimate.noise_error,
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
        position=None if result.position is None else _position_part(result.position, fit),
    )


def _position_part(found: PositionFit, fit: Callable[[Score | None], Fit | None]) -> PositionPart:
    table = found.table
    return PositionPart(
        table.grid.nodes,
        table.grid.spacing,
        rms(np.array(table.cogging)),
        rms(np.array(table.friction)),
        fit(found.train_without),
        fit(found.validation_without),
    )


def in_closed_loop(found: IdentifiedModel, measured: Measured) -> IdentifiedModel:
    """Co-simulate the servo with an identified model from the start of the record."""
    with closed_loop(measured.servo, found.plant, measured.trajectory) as system:
        trace = run_loop(system)
    if not (np.isfinite(trace.q).all() and np.isfinite(trace.force).all()):
        raise FrictionError("the loop is unstable.")
    q, force = measured.q, measured.force
    units = ROTARY if measured.trajectory.rotary else LINEAR
    fits = [Fit(rms(trace.q - q), 100.0 * rms(trace.q - q) / rms(q), "position", units.position)]
    t = measured.servo.Ts * np.arange(float(len(q)))
    if force is not None:
        fits.append(Fit(rms(trace.force - force), 100.0 * rms(trace.force - force) / rms(force), "force", units.force))
    reason = _unlike(measured, fits)
    return replace(
        found,
        row=replace(found.row, closed_loop=tuple(fits), reason=reason),
        error=None if reason else rms((trace.q - q)[slice(*measured.validation)]),
        force_error=None if force is None else rms((trace.force - force)[slice(*measured.validation)]),
        position=thinned(t, trace.q - q),
        force=None if force is None else thinned(t, trace.force - force),
    )


def _unlike(measured: Measured, fits: Sequence[Fit]) -> str:
    """Return why a simulated servo does not reproduce the record; empty if it does."""
    position = fits[0]
    tracking = max(rms(measured.r - measured.q), QUANTA * measured.servo.quantum)
    if position.rms > REPRODUCED * tracking:
        return (
            f"the position of the simulated servo differs from the record by {position.rms:.3g} {position.unit} rms, "
            f"more than {100.0 * REPRODUCED:.0f} % of the tracking error of {tracking:.3g} {position.unit}."
        )
    if len(fits) > 1 and fits[1].percent > 100.0 * REPRODUCED:
        force = measured.trajectory.words.force
        return (
            f"the {force} of the simulated servo differs from the record by {fits[1].percent:.3g} % of its rms value."
        )
    return ""


def ranked(models: Sequence[IdentifiedModel], resolution: float = 0.0) -> list[IdentifiedModel]:
    """Return the models with their ranks, ordered by error.

    Of models whose errors are equal within `ALIKE`, or within the rms error `resolution` of the measurement, the one
    with the fewest parameters comes first, then the one with the lowest BIC.
    """
    left = sorted((found for found in models if found.error is not None and np.isfinite(found.error)), key=_error)
    ordered: list[IdentifiedModel] = []
    while left:
        least = _error(left[0])
        alike = [found for found in left if _error(found) <= max((1.0 + ALIKE) * least, np.hypot(least, resolution))]
        first = min(alike, key=_simplicity)
        ordered.append(replace(first, row=replace(first.row, rank=len(ordered) + 1)))
        left.remove(first)
    return ordered + [found for found in models if found.error is None or not np.isfinite(found.error)]


def _simplicity(found: IdentifiedModel) -> tuple[int, float]:
    """Return the number of parameters, with the nodes of a force over position, and the BIC."""
    nodes = 0 if found.row.position is None else 2 * found.row.position.nodes
    return len(found.row.parameters) + nodes, np.inf if found.row.bic is None else round(found.row.bic, 3)


def _error(found: IdentifiedModel) -> float:
    """Return the error rounded to six digits: differences in the last bits must not decide the order."""
    assert found.error is not None
    return float(f"{found.error:.6g}")


EQUAL: Final = 1e-3  # relative increase of an error of the simulated servo that is within the accuracy of the search

BIAS: Final = 5e-3
"""Increase of the error of the predicted force that the filter of the motion can cause, in parts of the rms force."""

UNLOADED: Final = 0.02
"""Initial fraction of a record that is not compared, because the predicted contact starts unloaded."""

_STEPS: Final = {"M": 0.02, "vs": 0.2, "Fs": 0.1}
"""Relative step of a parameter for differences, 4 % by default: its effect must exceed the encoder resolution."""


PLAUSIBLE: Final = 1.5  # static over Coulomb friction above which an undetermined one is not simulated


def without_unknown_static_friction(found: IdentifiedModel) -> IdentifiedModel:
    """Return a model whose static friction is Coulomb friction, if the record does not determine it and it is larger.

    A search ends anywhere from Fc to many times the largest force if the axis never slides slowly; a simulated axis
    with such a value cannot be moved, and every law that uses it fails.
    """
    Fc, Fs = found.values.get("Fc", 0.0), found.values.get("Fs", 0.0)
    weak = any(parameter.name == "Fs" and parameter.weak for parameter in found.row.parameters)
    return replace(found, values={**found.values, "Fs": Fc}) if weak and Fs > PLAUSIBLE * Fc > 0.0 else found


def with_load(found: IdentifiedModel, load: FlexibleLoad, measured: Measured) -> IdentifiedModel:
    """Return a model with a part of its mass behind a spring, if the servo then follows the record clearly better."""
    contact = contact_model(found.block, ROTARY)
    if (found.values.get("Fv") and "Fv" not in contact.parameters) or contact.transmits or found.terms:
        return found  # two masses have no friction beside the blocks, no gravity and no load
    best, least = found, np.inf if found.error is None else (1.0 - ALIKE) * found.error
    for mass in dict.fromkeys((found.mass, load.found or found.mass)):  # the latter is better where the load swings
        parameters = tuple(replace(p, value=mass) if p.name == "M" else p for p in found.row.parameters)
        flexible = replace(found, row=replace(found.row, parameters=parameters), mass=mass, load=load)
        with suppress(FrictionError):
            flexible = in_closed_loop(flexible, measured)
            if flexible.error is not None and flexible.error < least:
                best, least = flexible, flexible.error
    return best


def refine(
    found: IdentifiedModel,
    measured: Measured,
    train: Sequence[Record],
    unfitted: Sequence[Record],
    load: FlexibleLoad | None = None,
) -> IdentifiedModel:
    """Fit the well-determined parameters so that the co-simulated servo follows the measured motion.

    Only positions are compared: the force follows from the position through the known controller and would count the
    same error twice. The fit is discarded if, on data that were not fitted, it makes position or force of the simulated
    servo worse, or increases the error of the force predicted for the measured motion by more than `BIAS`.
    """
    if load is not None:
        found = with_load(found, load, measured)
    if not unfitted or (load is not None and found.error is None):
        return found
    free = [p for p in found.row.parameters if p.determined]
    free = [p for p in free if (p.value > 0.0 and p.name not in VALUES - {"a"}) or p.name == "OF"]
    level = max((found.values.get(name, 0.0) for name in ("Fc", "Fs", "f1")), default=0.0)
    if "M" not in {p.name for p in free} or not level:
        return found
    contact = contact_model(found.block, ROTARY if measured.trajectory.rotary else LINEAR)

    def unknown(p: IdentifiedParameter) -> Unknown:
        step = 0.02 * level if p.name == "OF" else _STEPS.get(p.name, 0.04) * p.value
        lower = -np.inf if p.name == "OF" else 1e-3 * p.value
        if (known := contact.parameters.get(p.name)) is None:
            return Unknown(p.name, p.value, step, p.unit, lower)
        return Unknown(p.name, p.value, step, p.unit, max(lower, known.lower), known.upper)

    def with_values(values: Mapping[str, float]) -> IdentifiedModel:
        own = {name: values.get(name, value) for name, value in found.values.items()}
        own |= {"Fs": own["Fc"]} if found.row.name == INVERSE else {}  # Coulomb friction alone
        own |= {"Fn0": contact.level(own)} if found.plant.loaded else {}
        terms = found.terms | (dict.fromkeys(SHARES, values["a"]) if "a" in values.keys() - own.keys() else {})
        return replace(found, values=own, mass=values["M"], offset=values.get("OF", found.offset), terms=terms)

    unknowns, simulations = [unknown(p) for p in free], found.row.simulations
    names = [unknown.name for unknown in unknowns]
    first, last = measured.train
    trajectory = replace(measured.trajectory, samples=last)
    with closed_loop(measured.servo, found.plant, trajectory) as system:

        @cache  # the second search begins where the first one ends
        def path(*given: float) -> Array:
            plant = with_values(dict(zip(names, given, strict=True))).plant
            start = start_of(plant, system.parts, trajectory.x0)
            return run_loop(system.with_start({**start, **constant_force(plant, -plant.offset)})).q

        def simulate(values: Mapping[str, float]) -> dict[str, Array]:
            return {"q": path(*(values[name] for name in names))}

        target = TargetSignal(measured.q[:last], 1e-6 if found.error is None else max(found.error, 1e-12), first)
        try:
            lag = max(1, round(0.2 / measured.servo.Ts))
            # the differences are coarse: with those of the first point, the solution depends on it by some 0.3 %
            for _ in range(2):
                fit = fit_output_error(simulate, unknowns, {"q": target}, correlation=lag, max_iterations=12)
                simulations += fit.simulations
                reached = fit.values()
                unknowns = [replace(u, start=min(max(reached[u.name], u.lower), u.upper)) for u in unknowns]
        except FrictionError:
            return found
    values = fit.values()
    errors = {name: estimate.standard_error for name, estimate in fit.parameters.items()}
    weak = weak_parameters(contact, list(values), values, errors, fit.correlation, {}, ())

    def fitted(p: IdentifiedParameter) -> IdentifiedParameter:
        if p.name not in values:
            return p
        # the search itself is not more accurate than `EQUAL`
        error = float(np.hypot(errors[p.name], EQUAL * p.value)) if np.isfinite(errors[p.name]) else None
        return replace(p, value=values[p.name], standard_error=error, weak=weak.get(p.name, ""))

    refined = with_values(values)
    below = refined.values.get("Fs", np.inf) < BELOW * refined.values.get("Fc", 0.0)
    row = replace(
        found.row,
        warnings=tuple(text for text in found.row.warnings if below or not text.startswith(FS_BELOW_FC)),
        method=f"{found.row.method}, then closed-loop",
        parameters=tuple(map(fitted, found.row.parameters)),
        simulations=simulations,
    )
    return _better(found, in_closed_loop(replace(refined, row=row), measured), train, unfitted)


def _better(
    found: IdentifiedModel, refined: IdentifiedModel, train: Sequence[Record], unfitted: Sequence[Record]
) -> IdentifiedModel:
    """Return the refined model if it is better on data that were not fitted; otherwise the other with a warning."""
    rigid = [] if found.load or found.terms else [found, refined]  # the prediction is of a rigid mass without load
    before, after = _prediction_errors(rigid, unfitted) or (None, None)
    units = unfitted[0].units
    level = rms(np.concatenate([record.column("force") for record in unfitted])) if before is not None else 0.0
    comparisons: tuple[tuple[str, float | None, float | None, float, str], ...] = (
        ("position of the simulated servo", found.error, refined.error, 0.0, units.position),
        (f"{units.words.force} of the simulated servo", found.force_error, refined.force_error, 0.0, units.force),
        # the prediction depends on the filter of the motion, with which the parameters before were fitted
        (f"predicted {units.words.force}", before, after, BIAS * level, units.force),
    )
    for what, old, new, allowed, unit in comparisons:
        if old is None or (new is not None and new <= (1.0 + EQUAL) * old + allowed):
            continue
        change = "without bound" if new is None else f"from {old:.3g} to {new:.3g} {unit}"
        text = (
            f"The fit to the closed loop was discarded, because it increases the rms error of the {what} {change} on "
            "data that were not fitted."
        )
        return replace(found, row=replace(found.row, warnings=(*found.row.warnings, text)))
    fitted = _scaled(found.row.train, *(_prediction_errors(rigid, train) or (None, None)))
    validation = _scaled(found.row.validation, before, after)
    return replace(refined, row=replace(refined.row, train=fitted, validation=validation))


def _scaled(fit: Fit | None, before: float | None, after: float | None) -> Fit | None:
    """Return the residual of a prediction after its error has changed."""
    if fit is None or after is None or not before:
        return fit
    return replace(fit, rms=after / before * fit.rms, percent=after / before * fit.percent)


def _prediction_errors(models: Sequence[IdentifiedModel], records: Sequence[Record]) -> list[float]:
    """Return the rms errors of the drive force that models of one block predict for the measured motion, if known."""
    if not models or any(record.force is None for record in records):
        return []
    contact = contact_model(models[0].block, records[0].units)
    own = contact.parameters
    prepared = [(record, prepare(record, contact, "force")) for record in records]
    with driven(contact.path) as drive:

        def error(found: IdentifiedModel, record: Record, segment: PreparedSegment) -> Array:
            values = {name: own[name].typed(value) for name, value in found.values.items() if name in own}
            F = segment.run(drive, ["F"], values)[:, 0]
            if "Fv" not in own:
                F = F + found.values.get("Fv", 0.0) * segment.inputs["v"]
            if found.position_map is not None:
                F = F - found.position_map.force(record.column("q"), segment.inputs["v"])
            left = segment.predicted(F, found.mass, found.offset) - segment.measured
            return left[round(UNLOADED * len(left)) :]

        return [rms(np.concatenate([error(found, *each) for each in prepared])) for found in models]
