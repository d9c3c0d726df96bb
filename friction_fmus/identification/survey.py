"""One record, several models: identified side by side, ranked, and written to a folder."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from friction_fmus.errors import FrictionError
from friction_fmus.identification.data.record import Record
from friction_fmus.identification.errors import FitError
from friction_fmus.identification.fit.models import contact_model
from friction_fmus.identification.identifying import identify
from friction_fmus.identification.result import Identification
from friction_fmus.notebook import survey_html, survey_text

Told = Callable[[int, int], None]

DRIVE = ("M", "OF")
"""What may be given beside the parameters of a block, where the force is that of a drive."""


@dataclass(frozen=True)
class Task:
    """What is asked of each model.

    Attributes
    ----------
    train, validation : tuple of Record
        Pieces that are fitted, and pieces that are only predicted; of the latter there may be none.
    fixed : mapping of str to float
        Parameters that are known; a model takes those that it has.
    options : mapping
        Further arguments of `identify`: loss, method, starts.
    """

    train: tuple[Record, ...]
    validation: tuple[Record, ...] = ()
    fixed: Mapping[str, float] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False, repr=False)
class Survey:
    """Identifications of several models.

    Attributes
    ----------
    results : tuple of Identification
        The best one first.
    failed : mapping of str to str
        Models that could not be identified -> why.
    ranked_by : str
        ``validation error`` or ``BIC``.
    """

    results: tuple[Identification, ...]
    failed: Mapping[str, str]
    ranked_by: str

    def __repr__(self) -> str:
        """Return one line."""
        return survey_text(self)

    def _repr_html_(self) -> str:
        """Return the models as HTML, for a notebook."""
        return survey_html(self)


def compare_models(models: Sequence[str | Path], task: Task, workers: int = 1, told: Told | None = None) -> Survey:
    """Identify several models.

    Parameters
    ----------
    models : sequence of str or Path
        Names of friction blocks, or paths of ``.c`` files.
    task : Task
        Data and options.
    workers : int
        Processes side by side; more than 1 needs the guard ``if __name__ == "__main__":`` in a script.
    told : callable, optional
        Called with the number of models that are done and of all.

    Returns
    -------
    Survey
        Ranked by the validation error, or by the information criterion of Schwarz where there is no validation.

    Raises
    ------
    FitError
        A fixed parameter is one of no model, or no model could be identified.
    """
    _check_fixed(models, task)
    found: dict[str, Identification | str] = {}
    if workers < 2 or len(models) < 2:
        for done, model in enumerate(models, start=1):
            found[str(model)] = identify_one(model, task)
            if told:
                told(done, len(models))
    else:
        with ProcessPoolExecutor(min(workers, len(models)), mp_context=get_context("spawn")) as pool:
            found = _side_by_side(pool, models, task, told)
    failed = {name: result for name, result in found.items() if isinstance(result, str)}
    results = [found[str(model)] for model in models if str(model) not in failed]
    if not results:
        reasons = "; ".join(f"{name}: {reason}" for name, reason in failed.items())
        raise FitError(f"No model could be identified ({reasons}); change the data or the options.")
    identified = [result for result in results if isinstance(result, Identification)]
    validated = all(result.validation is not None for result in identified)
    # models that predict the same, as Coulomb and Stiction in sliding, keep the order in which they were named
    identified.sort(key=_error if validated else lambda result: round(result.bic, 3))
    return Survey(tuple(identified), failed, "validation error" if validated else "BIC")


def identify_one(model: str | Path, task: Task) -> Identification | str:
    """The identification of one model, or why there is none."""
    try:
        known = {*contact_model(model, task.train[0].units).parameters, *DRIVE} if task.fixed else set()
        fixed = {name: value for name, value in task.fixed.items() if name in known}
        return identify(model, task.train, fixed=fixed, validation=task.validation or None, **task.options)
    except FrictionError as error:
        return " ".join(str(error).split())
    except Exception as error:  # one model of many; the others go on
        return f"{type(error).__name__}: {' '.join(str(error).split())}"


def _side_by_side(
    pool: Executor, models: Sequence[str | Path], task: Task, told: Told | None
) -> dict[str, Identification | str]:
    found: dict[str, Identification | str] = {}
    waiting = {pool.submit(identify_one, model, task): str(model) for model in models}
    try:
        for done, future in enumerate(as_completed(waiting), start=1):
            try:
                found[waiting[future]] = future.result()
            except BrokenProcessPool:
                found[waiting[future]] = "a process died while it or another model was identified; try it alone"
            if told:
                told(done, len(models))
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        raise
    return found


def _check_fixed(models: Sequence[str | Path], task: Task) -> None:
    """Refuse a fixed parameter that no model has, which would silently do nothing."""
    if not task.fixed:
        return
    known = set(DRIVE)
    for model in models:
        known |= contact_model(model, task.train[0].units).parameters.keys()
    unknown = sorted(task.fixed.keys() - known)
    if unknown:
        raise FitError(
            f"No model here has the parameter {unknown[0]!r}, which is to be fixed; "
            f"known are {', '.join(sorted(known))}."
        )


def _error(result: Identification) -> float:
    assert result.validation is not None
    return float(f"{result.validation.rms:.6g}")
