"""Identification and ranking of several models on the same record."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np

from friction_fmus.blocks.axis_units import LINEAR, ROTARY
from friction_fmus.blocks.catalogue import find
from friction_fmus.errors import FitError, FrictionError, RecordError
from friction_fmus.identification.data.record import Record
from friction_fmus.identification.fit.contact_model import contact_model
from friction_fmus.identification.fit.idim import default_settings
from friction_fmus.identification.identification_result import Identification
from friction_fmus.identification.identifying import identify
from friction_fmus.listings import comparison_html, comparison_text
from harness.workers import worker_pool

FAR: Final = 10.0
"""Ratio to the largest measured force beyond which a force parameter has run away: the drive overcame all friction."""


def long_enough(records: Sequence[Record]) -> tuple[Record, ...]:
    """Return the records that are long enough for the filter of a drive force; raise RecordError if none is."""
    kept, errors = [], []
    for record in records:
        try:
            if record.force is not None and record.friction is None:
                default_settings(record).require(record)
            kept.append(record)
        except RecordError as error:
            errors.append(error)
    if not kept:
        raise errors[-1]
    return tuple(kept)


def within_reach(
    identify: Callable[..., Identification], model: str | Path, train: Sequence[Record], **options: Any
) -> Identification:
    """Identify a model; if a force or a velocity ran away, identify it again with a bound for this parameter."""
    # A record that passes the Stribeck velocity between two samples does not determine Fs: the product of a huge Fs and
    # the exponential of a tiny vs fits. With a vs above all speeds, any Fc does. Nothing can be computed with such a
    # value, and it hides that the parameter is unknown.
    found = identify(model, train, **options)
    forces = [values for record in train for values in (record.force, record.friction) if values is not None]
    if options.get("bounds") or not forces:
        return found
    largest = FAR * max(float(np.max(np.abs(values))) for values in forces)
    fastest = max(_top_speed(record) for record in train)
    si = ROTARY if train[0].units.rotary else LINEAR  # units of channels do not distinguish a force from a stiffness
    known = {name: each.unit for name, each in contact_model(model, si).parameters.items() if "[" not in name}
    most = {si.force: largest, si.velocity: fastest}
    reach = {name: most[unit] for name, unit in known.items() if most.get(unit)}
    bounds = {n: (0.0, reach[n]) for n, e in found.parameters.items() if n in reach and abs(e.value) > reach[n]}
    return identify(model, train, **{**options, "bounds": bounds}) if bounds else found


def _top_speed(record: Record) -> float:
    """Return the largest speed of a record without outliers; 0 if it has neither velocity nor position."""
    v = record.v if record.v is not None or record.q is None else np.gradient(record.q, record.Ts)
    return 0.0 if v is None else float(np.quantile(np.abs(v), 0.99))


WORSE: Final = 100.0  # training error in % of the signal above which a model describes nothing


def useless(result: Identification) -> str:
    """Return why an identified model must not be used; empty if it may."""
    if not result.train.relative_percent <= WORSE:
        return (
            f"its error on the training data is {result.train.relative_percent:.3g} % of the signal, so that it "
            "describes nothing; check columns and units"
        )
    record = max(result.records, key=len)
    viscous = record.units.viscous
    peak = max(float(np.max(np.abs(values))) for values in (result.measured, [1e-300]))
    top = _top_speed(record)
    far = [e for e in result.parameters.values() if e.unit == viscous and e.name in VISCOUS]
    wrong = [e for e in far if abs(e.value) * top > FAR * peak]
    if wrong and result.signal in ("force", "friction"):
        e = wrong[0]
        return (
            f"{e.name} = {e.value:.3g} {e.unit} would need {abs(e.value) * top:.3g} {record.units.words.N} at the "
            f"speeds of the record, whose largest force is {peak:.3g}; check columns and units"
        )
    return ""


VISCOUS: Final = ("Fv", "sigma2")  # names of coefficients of viscous friction

ProgressCallback = Callable[[int, int], None]

TIE = 3  # number of digits in which the validation errors of models must differ to determine their order
DRIVE_PARAMETERS = ("M", "OF")  # parameters of a drive that may be fixed in addition to those of a block


@dataclass(frozen=True)
class IdentificationTask:
    """Data and options of the identification of each model.

    Attributes
    ----------
    train, validation : tuple of Record
        Training data and, optionally, validation data.
    fixed : mapping of str to float
        Known parameters; each model uses those that it has.
    options : mapping of str to object
        Other arguments of `identify`: loss, method, starts.
    """

    train: tuple[Record, ...]
    validation: tuple[Record, ...] = ()
    fixed: Mapping[str, float] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False, repr=False)
class ModelComparison:
    """Identified models, ranked.

    Attributes
    ----------
    results : tuple of Identification
        Identified models, best first.
    failed : mapping of str to str
        Reasons why models could not be identified, by name of the model.
    ranked_by : str
        Criterion of the ranking, ``validation error`` or ``BIC``.
    """

    results: tuple[Identification, ...]
    failed: Mapping[str, str]
    ranked_by: str

    __repr__ = comparison_text
    _repr_html_ = comparison_html


def compare_models(
    models: Sequence[str | Path],
    task: IdentificationTask,
    workers: int = 1,
    progress: ProgressCallback | None = None,
    ready: Callable[[Identification | str], None] | None = None,
) -> ModelComparison:
    """Identify several models on the same data and rank them.

    Parameters
    ----------
    models : sequence of str or Path
        Names of friction blocks, or paths of ``.c`` files.
    task : IdentificationTask
        Data and options.
    workers : int
        Number of parallel processes; a script needs the guard ``if __name__ == "__main__":`` for more than 1.
    progress : callable, optional
        Called with the number of finished models and the total number.
    ready : callable, optional
        Called with each result as soon as it is there, or with the reason why there is none.

    Returns
    -------
    ModelComparison
        Models ranked by the validation error, or by the Bayesian information criterion (BIC) without validation data.

    Raises
    ------
    FitError
        If no model has a fixed parameter, or no model can be identified.
    """
    _check_fixed(models, task)
    found: dict[str, Identification | str] = {}

    def add(model: str | Path, result: Identification | str) -> None:
        found[str(model)] = result
        if ready:
            ready(result)
        if progress:
            progress(len(found), len(models))

    if workers < 2 or len(models) < 2:
        for model in models:
            add(model, identify_one(model, task))
    else:
        with worker_pool(min(workers, len(models))) as pool:
            _in_parallel(pool, models, task, add)
    failed = {name: result for name, result in found.items() if isinstance(result, str)}
    results = [found[str(model)] for model in models if str(model) not in failed]
    if not results:
        models_of: dict[str, list[str]] = {}
        for name, reason in failed.items():
            models_of.setdefault(reason, []).append(name)
        reasons = "; ".join(f"{', '.join(names)}: {reason}" for reason, names in models_of.items())
        raise FitError(f"No model could be identified ({reasons}); change the data or the options.")
    identified = [result for result in results if isinstance(result, Identification)]
    validated = all(result.validation is not None for result in identified)
    # models with equal predictions, such as Coulomb and Stiction in sliding, keep their order in `models`
    # a model with fewer parameters wins a tie
    identified.sort(key=_rank if validated else lambda result: (round(result.bic, 3), len(result.parameters)))
    return ModelComparison(tuple(identified), failed, "validation error" if validated else "BIC")


def identify_one(model: str | Path, task: IdentificationTask) -> Identification | str:
    """Return the identification of a model, or the reason why it failed."""
    try:
        known = {*contact_model(model, task.train[0].units).parameters, *DRIVE_PARAMETERS} if task.fixed else set()
        fixed = {name: value for name, value in task.fixed.items() if name in known}
        data = {"fixed": fixed, "validation": task.validation or None}
        result = within_reach(identify, model, task.train, **data, **task.options)
        return useless(result) or result
    except FrictionError as error:
        return " ".join(str(error).split())
    except Exception as error:  # a failing model must not stop the others
        return f"{type(error).__name__}: {' '.join(str(error).split())}"


def _is_static(model: str | Path) -> bool:
    """Return whether a model has no states, so that its identification takes a second; from its file, unbuilt."""
    try:
        return "STATE" not in find(model).code
    except FrictionError:
        return False


def _in_parallel(
    pool: Executor,
    models: Sequence[str | Path],
    task: IdentificationTask,
    add: Callable[[str | Path, Identification | str], None],
) -> None:
    quick = next((model for model in models if _is_static(model)), None)
    waiting = {pool.submit(identify_one, model, task): model for model in models if model != quick}
    if quick is not None:
        add(quick, identify_one(quick, task))  # while the worker processes start
    for future in as_completed(waiting):
        try:
            add(waiting[future], future.result())
        except BrokenProcessPool:
            add(waiting[future], "a worker process died during this or another model; identify it alone")


def _check_fixed(models: Sequence[str | Path], task: IdentificationTask) -> None:
    """Raise FitError for a fixed parameter that no model has, which would silently be ignored."""
    if not task.fixed:
        return
    known = set(DRIVE_PARAMETERS)
    for model in models:
        known |= contact_model(model, task.train[0].units).parameters.keys()
    unknown = sorted(task.fixed.keys() - known)
    if unknown:
        raise FitError(
            f"None of the models has the parameter {unknown[0]!r}, which is to be fixed; their parameters are "
            f"{', '.join(sorted(known))}."
        )


def _rank(result: Identification) -> tuple[float, int]:
    assert result.validation is not None
    return float(f"{result.validation.rms:.{TIE}g}"), len(result.parameters)
