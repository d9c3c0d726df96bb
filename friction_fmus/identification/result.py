"""The result of an identification: estimates with standard errors, prediction and scores."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from friction_fmus.blocks.axis_units import ROTARY
from friction_fmus.export.block_fmu import build
from friction_fmus.identification.data.record import Array, Record
from friction_fmus.identification.fit.estimate import Estimate
from friction_fmus.identification.fit.idim import InverseModelSettings
from friction_fmus.identification.fit.models import contact_model
from friction_fmus.identification.fit.position import PositionFit
from friction_fmus.identification.fit.prediction import compare, predict
from friction_fmus.identification.fit.scores import Score
from friction_fmus.identification.plot import draw
from friction_fmus.listings import identification_html, identification_text
from harness import Parameter, ParameterSet, write_ssv

if TYPE_CHECKING:
    from friction_fmus.identification.data.record import ServoSettings


def build_identified(result: Identification, folder: Path, name: str | None) -> Path:
    """Build the FMU with the identified values as start values; see `Identification.to_fmu`."""
    rotary = result.records[0].units == ROTARY
    return build(result.block, folder, _start(result), name, domain="rotational" if rotary else "translational")


def viscous_beside(result: Identification) -> float | None:
    """Return the coefficient of the viscous friction beside the block; None if there is none."""
    known = contact_model(result.block, result.records[0].units).parameters
    return None if "Fv" in known else result.values().get("Fv")


def write_viscous(result: Identification, coefficient: float, path: Path) -> Path:
    """Write the viscous friction beside the block as SSV, for a block Viscous."""
    unit = result.records[0].units.viscous
    parameter = Parameter(coefficient, unit, description=f"viscous friction beside {result.model}")
    write_ssv(ParameterSet(f"{result.model}Viscous", {"Fv": parameter}, ""), path)
    return path


def write_parameters(result: Identification, path: Path) -> Path:
    """Write the identified values as SSV; see `Identification.to_ssv`."""
    known = contact_model(result.block, result.records[0].units).parameters
    parameters = {
        name: Parameter(value, known[name].unit if known[name].real else None, description=known[name].text)
        for name, value in _start(result).items()
    }
    cited = sorted({record.citation for record in result.records} - {""})
    description = f"Identified from the record of {'; '.join(cited)}" if cited else ""
    write_ssv(ParameterSet(result.model, parameters, description), path)
    return path


def _start(result: Identification) -> dict[str, float | int | bool]:
    """Return the values of the parameters of the block, converted to their types."""
    known = contact_model(result.block, result.records[0].units).parameters
    return {name: known[name].typed(value) for name, value in result.values().items() if name in known}


@dataclass(frozen=True, eq=False, repr=False)
class Identification:
    """Identified friction model.

    Attributes
    ----------
    model : str
        Name of the block.
    method : str
        Method: "inverse", "output-error", "hysteresis", "closed-loop" or "free-run".
    parameters : mapping of str to Estimate
        Estimates of the parameters of the block, of the force offset OF for a reciprocating contact, and of the moved
        mass M for a drive force.
    initial : mapping of str to Estimate
        Estimates of the initial states.
    fixed : mapping of str to float
        Fixed parameters of the block.
    correlation : array, shape (p, p)
        Correlation of the estimates, in the order of `parameters`, then `initial`.
    t, measured, predicted : array, shape (n,)
        Time [s], and measured and predicted signal, in `unit`.
    signal, unit : str
        Name and unit of the signal: "mu", "friction", "force", or the position "q" in closed loop
        and of a free run.
    train : Score
        Score on the training data.
    validation : Score or None
        Score on the validation data.
    aic, bic : float
        Information criteria of Akaike and Schwarz for Gaussian residuals; lower is better. The number of independent
        samples follows from the correlation time of the measured signal, so it is the same for all models of a record.
    weak : mapping of str to str
        Poorly identifiable parameters, with the reason and advice on what to measure.
    warnings : tuple of str
        Warnings about record and fit.
    seconds : float
        Elapsed time of the identification [s].
    simulations : int
        Number of simulations of the model.
    errors : str
        Type of the standard errors: "classic", for white residuals, or "robust", which take their correlation into
        account (Newey, West 1987).
    block : str or Path
        Block as passed by the user.
    records : tuple of Record
        Training data.
    settings : InverseModelSettings or None
        Filter as passed by the user.
    servo : ServoSettings or None
        Servo of an identification in closed loop.
    position : PositionFit or None
        Force over position identified together with the model.
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
    position: PositionFit | None = None

    def __repr__(self) -> str:
        """Return a summary in one line."""
        return identification_text(self)

    def _repr_html_(self) -> str:
        """Return the parameters as HTML, for a notebook."""
        return identification_html(self)

    def values(self) -> dict[str, float]:
        """Return the parameter values without standard errors, including fixed parameters.

        Returns
        -------
        dict of str to float
            Values in the units of the estimates.
        """
        return {**self.fixed, **{name: estimate.value for name, estimate in self.parameters.items()}}

    @property
    def residuals(self) -> Array:
        """Predicted minus measured, shape (n,), in `unit`."""
        return self.predicted - self.measured

    def timed(self, seconds: float, validation: Score | None) -> Identification:
        """Return the result with elapsed time and validation score.

        Parameters
        ----------
        seconds : float
            Elapsed time [s].
        validation : Score or None
            Score on the validation data.

        Returns
        -------
        Identification
            Completed result.
        """
        return replace(self, seconds=seconds, validation=validation)

    def predict(self, record: Record) -> Array:
        """Predict the signal along the motion of a record.

        Parameters
        ----------
        record : Record
            Record whose motion drives the model. If it contains the signal, only the initial state is fitted to it;
            otherwise the contact starts unloaded.

        Returns
        -------
        array, shape (n,)
            Predicted signal at the samples of the record, in `unit`; a drive force is not decimated.

        Raises
        ------
        RecordError
            If the record lacks the motion, or the normal force for the signal mu.
        """
        return predict(self, record)

    def compare(self, record: Record) -> tuple[Array, Array]:
        """Return measured and predicted signal of a record, filtered as in the fit.

        Parameters
        ----------
        record : Record
            Record with the signal.

        Returns
        -------
        measured, predicted : array, shape (m,)
            Signals, in `unit`.

        Raises
        ------
        RecordError
            If the record lacks a column.
        """
        return compare(self, record)

    def plot(self, path: str | Path) -> Path:
        """Draw measured and predicted signal over time, over position or velocity, and the residuals.

        Parameters
        ----------
        path : path-like
            Path of a .png, .svg or .pdf file.

        Returns
        -------
        Path
            Path of the file.

        Raises
        ------
        OutputError
            If the file cannot be written.
        """
        return draw(self, Path(path))

    def to_fmu(self, folder: str | Path, name: str | None = None) -> Path:
        """Build the FMU of the block with the identified and fixed parameters as start values.

        Parameters
        ----------
        folder : path-like
            Folder of the FMU; created if needed.
        name : str, optional
            Name of the FMU; by default the name of the block.

        Returns
        -------
        Path
            Path of the FMU.

        Raises
        ------
        BuildError
            If the FMU cannot be built, see `friction_fmus.build`.
        """
        return build_identified(self, Path(folder), name)

    def to_ssv(self, path: str | Path) -> Path:
        """Write the parameters of the block as a parameter set (SSP 1.0).

        Parameters
        ----------
        path : path-like
            Path of a .ssv file.

        Returns
        -------
        Path
            Path of the file.

        Raises
        ------
        OutputError
            If the file cannot be written.
        """
        return write_parameters(self, Path(path))
