"""The result of an identification: estimates with standard errors, prediction, figure and files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from friction_fmus.blocks.axis_units import domain_of
from friction_fmus.export.block_fmu import build
from friction_fmus.identification.data.record import Array, Record
from friction_fmus.identification.fit.axis_terms import force_beside, mean_temperature, middle_of
from friction_fmus.identification.fit.block_fit import driven
from friction_fmus.identification.fit.contact_model import ContactModel, contact_model, state_sizes
from friction_fmus.identification.fit.estimate import Estimate
from friction_fmus.identification.fit.idim import InverseModelSettings
from friction_fmus.identification.fit.least_squares import INITIAL_LIMIT, Coordinate, Problem
from friction_fmus.identification.fit.position import PositionFit, force_on_axis
from friction_fmus.identification.fit.scores import Score
from friction_fmus.identification.fit.search import search
from friction_fmus.identification.fit.simulation_data import PreparedSegment, prepare
from friction_fmus.identification.methods.free_run import FREE_RUN, START, free_response
from friction_fmus.listings import identification_html, identification_text
from harness import Parameter, ParameterSet, write_ssv
from harness.storage.files import atomic_path

MEASURED, PREDICTED = "#7f8c8d", "#c0392b"

NAMES = {"mu": "friction coefficient", "friction": "friction {force}", "force": "drive {force}", "q": "position"}


@dataclass(frozen=True, eq=False, repr=False)
class Identification:
    """Identified friction model.

    Attributes
    ----------
    model : str
        Name of the block.
    method : str
        Method: "inverse", "output-error", "hysteresis" or "free-run".
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
        Name and unit of the signal: "mu", "friction", "force", or the position "q" in a free run.
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
    position: PositionFit | None = None

    __repr__ = identification_text
    _repr_html_ = identification_html

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
        if self.signal == "q":
            return free_response(self, record)
        force = self.signal == "force"
        known = (record.force if force else record.friction) is not None
        zero = np.zeros(len(record))
        filled = record if known else replace(record, force=zero) if force else replace(record, friction=zero)
        segment, F = simulated(self, filled, fit=known)
        values = self.values()
        if segment.a is None:
            return segment.predicted(F, 0.0, values.get("OF", 0.0))
        total = F + values.get("M", 0.0) * segment.a + values.get("OF", 0.0) + force_beside(values, segment)
        return total / values.get("gain", 1.0) - known_force(self, segment)

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
        if self.signal == "q":
            first = START if self.method == FREE_RUN else 0
            return record.column("q")[first:], self.predict(record)[first:]
        segment, F = simulated(self, record, fit=True)
        values = self.values()
        known = segment.rows(known_force(self, segment))
        beside = force_beside(values, segment) if segment.a is not None else 0.0
        predicted = segment.predicted(F + beside, values.get("M", 0.0), values.get("OF", 0.0))
        return segment.measured, predicted / values.get("gain", 1.0) - known

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
        import matplotlib as mpl  # takes a third of a second, and studies do not draw with it
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        path = Path(path)
        figure = Figure(figsize=(9.0, 6.0), layout="constrained")
        FigureCanvasAgg(figure)
        grid = figure.add_gridspec(2, 2, height_ratios=(2.0, 1.0), width_ratios=(1.6, 1.0))
        over_time, over_motion = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[:, 1])
        error = figure.add_subplot(grid[1, 0], sharex=over_time)
        unit = "" if self.unit == "1" else f" [{self.unit}]"
        label = f"{name_of(self)}{unit}"
        x, x_label = _abscissa(self)
        for axes, at in ((over_time, self.t), (over_motion, x)):
            axes.plot(at, self.measured, color=MEASURED, lw=1.4, label="measured")
            axes.plot(at, self.predicted, color=PREDICTED, lw=0.8, label=self.model)
            axes.set_ylabel(label)
            axes.grid(alpha=0.3)
        over_motion.set_xlabel(x_label)
        over_motion.locator_params(axis="x", nbins=4)
        # some positions differ only in the fourth digit
        over_motion.ticklabel_format(axis="x", style="sci", scilimits=(-3, 4), useOffset=True)
        over_time.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, frameon=False, fontsize="small")
        over_time.tick_params(labelbottom=False)
        error.plot(self.t, self.residuals, color=PREDICTED, lw=0.6)
        error.set_ylabel("predicted − measured")
        error.set_xlabel(self.records[0].clock)
        error.grid(alpha=0.3)
        figure.suptitle(
            f"{self.model}: rms error {self.train.rms:.3g}{unit}, {self.train.relative_percent:.2f} % of the signal",
            fontsize="medium",
        )
        with atomic_path(path) as temporary, mpl.rc_context({"svg.hashsalt": "friction-fmus"}):
            figure.savefig(temporary, dpi=130, metadata={"Date": None} if path.suffix == ".svg" else None)
        return path

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
        domain = domain_of(self.records[0].units.rotary)
        return build(self.block, Path(folder), self._start(), name, domain=domain)

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
        known = contact_model(self.block, self.records[0].units).parameters
        parameters = {
            name: Parameter(value, known[name].unit if known[name].real else None, description=known[name].text)
            for name, value in self._start().items()
        }
        cited = sorted({record.citation for record in self.records} - {""})
        description = f"Identified from the record of {'; '.join(cited)}" if cited else ""
        write_ssv(ParameterSet(self.model, parameters, description), Path(path))
        return Path(path)

    def _start(self) -> dict[str, float | int | bool]:
        """Return the values of the parameters of the block, converted to their types."""
        known = contact_model(self.block, self.records[0].units).parameters
        return {name: known[name].typed(value) for name, value in self.values().items() if name in known}


def name_of(result: Identification) -> str:
    """Return the name of the fitted signal, such as ``drive force``."""
    return result.records[0].units.words.fill(NAMES.get(result.signal, result.signal))


def _abscissa(result: Identification) -> tuple[Array, str]:
    """Return position, or velocity if no position was measured, at the samples of the signal."""
    columns = []
    position = all(record.q is not None for record in result.records)
    for record in result.records:
        columns.append((record.t, record.column("q" if position else "v")))
    times = np.concatenate([t for t, _ in columns])
    values = np.concatenate([values for _, values in columns])
    units = result.records[0].units
    label = f"position [{units.position}]" if position else f"velocity [{units.velocity}]"
    order = np.argsort(times, kind="stable")
    return np.interp(result.t, times[order], values[order]), label


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


def known_force(result: Identification, segment: PreparedSegment) -> Array:
    """Return the force over position that was identified with the model, along a prepared record; 0 without one."""
    return force_on_axis(None if result.position is None else result.position.table, segment)


def simulated(result: Identification, record: Record, fit: bool) -> tuple[PreparedSegment, Array]:
    """Return the prepared record, and the friction force along its motion with a fitted initial state."""
    contact = contact_model(result.block, record.units)
    segment = prepare(record, contact, result.signal, result.settings)
    segment = replace(segment, middle=middle_of(result.records), warm=mean_temperature(result.records))
    coordinates, sizes = _initial(result, contact, segment)
    values = {
        name: contact.parameters[name].typed(value) if name in contact.parameters else value
        for name, value in result.values().items()
    }

    def states(_: Mapping[str, float], parts: Mapping[str, float]) -> dict[str, float]:
        return {name: part * sizes[name] for name, part in parts.items()}

    with driven(contact.path) as drive:
        remaining = segment.measured + segment.rows(known_force(result, segment))
        beside = replace(contact, viscous="Fv" in values and "Fv" not in contact.parameters)
        segments = [replace(segment, measured=remaining)]
        problem = Problem(drive, segments, coordinates, lambda _: {}, states, values, model=beside)
        x = problem.start()
        if coordinates:
            x = search(problem, "linear", 1).x if fit else 0.0 * x
        return segment, problem.force(x, 0)


def _initial(
    result: Identification, contact: ContactModel, segment: PreparedSegment
) -> tuple[tuple[Coordinate, ...], dict[str, float]]:
    """Return the initial states to fit, started from the first measured force, and their sizes in sliding."""
    sizes = {name: size for name, size in state_sizes(contact, result.values()).items() if size > 0.0}
    limit = INITIAL_LIMIT if contact.initial_state else 1.0
    peak = float(np.max(np.abs(segment.measured))) or 1.0
    part = 0.99 * float(np.median(segment.measured[:3])) / peak
    return tuple(Coordinate(name, 1.0, part, -limit, limit, segment=0) for name in sizes), sizes
