"""The result of an identification: what was found, how sure it is, how well it fits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from friction_fmus.identification.data.record import Array, Record
from friction_fmus.identification.files import build_identified, write_parameters
from friction_fmus.identification.fit.estimate import Estimate
from friction_fmus.identification.fit.idim import InverseModelSettings
from friction_fmus.identification.fit.prediction import compare, predict
from friction_fmus.identification.fit.scores import Score
from friction_fmus.identification.plot import draw
from friction_fmus.notebook import identification_html, identification_text

if TYPE_CHECKING:
    from friction_fmus.data import ServoSettings


@dataclass(frozen=True, eq=False, repr=False)
class Identification:
    """A friction model with the parameters that a record gives it.

    Attributes
    ----------
    model : str
        Name of the block.
    method : str
        How it was identified: "inverse", "output-error", "hysteresis" or "closed-loop".
    parameters : mapping of str to Estimate
        Estimates of the parameters of the block, of OF (offset of the force) where the contact moves to and fro, and
        of M (moved mass) where the force is that of a drive.
    initial : mapping of str to Estimate
        Estimates of the state at the beginning of the record.
    fixed : mapping of str to float
        Parameters of the block that were given.
    correlation : array, shape (p, p)
        Correlation of the estimates, those of `parameters` first, then those of `initial`.
    t, measured, predicted : array, shape (n,)
        The signal that was fitted: time [s], measured and predicted, in `unit`.
    signal, unit : str
        Name and unit of that signal: "mu", "friction", "force", or in a closed loop the position "q".
    train : Score
        On the samples that were fitted.
    validation : Score or None
        On samples that were not.
    aic, bic : float
        Information criteria of Akaike and Schwarz for Gaussian residuals, on as many independent samples as the
        measured signal has correlation lengths: the same number for all models of one record; lower is better.
    weak : mapping of str to str
        Parameters that the record hardly determines -> why, and what to measure.
    warnings : tuple of str
        What else to know about record and fit.
    seconds : float
        Time the identification took.
    simulations : int
        Number of simulations of the model.
    errors : str
        Kind of the standard errors: "classic", for white residuals, or "robust", which counts with their correlation
        (Newey, West 1987).
    block : str or Path
        The block as it was named.
    records : tuple of Record
        The data that were fitted.
    settings : InverseModelSettings or None
        The filter that was asked for.
    servo : ServoSettings or None
        The servo of a closed loop.
    """

    model: str
    method: str
    parameters: Mapping[str, Estimate]
    initial: Mapping[str, Estimate]
    fixed: Mapping[str, float]
    correlation: Array
    t: Array
    measured: Array
    predicted: Array
    signal: str
    unit: str
    train: Score
    validation: Score | None
    aic: float
    bic: float
    weak: Mapping[str, str]
    warnings: tuple[str, ...]
    seconds: float
    simulations: int
    errors: str = "classic"
    block: str | Path = ""
    records: tuple[Record, ...] = field(default=(), repr=False)
    settings: InverseModelSettings | None = None
    servo: ServoSettings | None = None

    def __repr__(self) -> str:
        """Return one line."""
        return identification_text(self)

    def _repr_html_(self) -> str:
        """Return the parameters as HTML, for a notebook."""
        return identification_html(self)

    def values(self) -> dict[str, float]:
        """Parameter values without their errors, those that were given included."""
        return {**self.fixed, **{name: estimate.value for name, estimate in self.parameters.items()}}

    @property
    def residuals(self) -> Array:
        """Predicted minus measured, shape (n,), in `unit`."""
        return self.predicted - self.measured

    def timed(self, seconds: float, validation: Score | None) -> Identification:
        """The same with the time it took and the score on other data."""
        return replace(self, seconds=seconds, validation=validation)

    def predict(self, record: Record) -> Array:
        """Predict the signal along the motion of a record.

        Parameters
        ----------
        record : Record
            Its motion drives the model. If it has the signal, the initial state is fitted to it, and nothing else;
            otherwise the contact begins unloaded.

        Returns
        -------
        array, shape (n,)
            The signal at the samples of the record, in `unit`; of a drive force without the decimation of the fit.

        Raises
        ------
        RecordError
            The record lacks the motion, or the normal force where the signal is mu.
        """
        return predict(self, record)

    def compare(self, record: Record) -> tuple[Array, Array]:
        """Measured and predicted signal of a record, both of shape (m,), filtered as for the fit.

        Raises
        ------
        RecordError
            The record lacks a column.
        """
        return compare(self, record)

    def plot(self, path: str | Path) -> Path:
        """Draw measured and predicted signal over time, over position or velocity, and the residuals.

        Parameters
        ----------
        path : path-like
            A .png, .svg or .pdf file.

        Raises
        ------
        OutputError
            The file cannot be written.
        """
        return draw(self, Path(path))

    def to_fmu(self, folder: str | Path, name: str | None = None) -> Path:
        """Build the FMU of the block with the identified and given parameters as start values.

        Parameters
        ----------
        folder : path-like
            Where it goes; made if needed.
        name : str, optional
            Its name, by default that of the block.

        Returns
        -------
        Path
            The FMU.

        Raises
        ------
        BuildError
            As of `friction_fmus.build`.
        """
        return build_identified(self, Path(folder), name)

    def to_ssv(self, path: str | Path) -> Path:
        """Write the parameters of the block as a parameter set (SSP 1.0).

        Raises
        ------
        OutputError
            The file cannot be written.
        """
        return write_parameters(self, Path(path))
