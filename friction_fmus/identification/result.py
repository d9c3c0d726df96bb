"""The result of an identification: what was found, how sure it is, how well it fits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from .estimate import Estimate
from .record import Array


@dataclass(frozen=True)
class Score:
    """How well a model reproduces a signal.

    Attributes
    ----------
    rms : float
        Root mean square of simulated minus measured, in the unit of the signal.
    relative_percent : float
        The same in percent of the root mean square of the signal.
    fit_percent : float
        100 (1 - |simulated - measured| / |measured - mean|): 100 is exact, 0 no better than the mean.
    samples : int
        Number of samples.
    """

    rms: float
    relative_percent: float
    fit_percent: float
    samples: int


@dataclass(frozen=True, eq=False)
class Identification:
    """A friction model with the parameters that a record gives it.

    Attributes
    ----------
    model : str
        Name of the block.
    method : str
        How it was identified: "inverse", "output-error", "hysteresis" or "closed-loop".
    parameters : mapping of str to Estimate
        Estimates of the parameters of the block, and of M (moved mass) and OF (offset of the drive) where the
        force is that of a drive.
    initial : mapping of str to Estimate
        Estimates of the state at the beginning of the record.
    fixed : mapping of str to float
        Parameters of the block that were given.
    correlation : array, shape (p, p)
        Correlation of the estimates, those of `parameters` first, then those of `initial`.
    t, measured, predicted : array, shape (n,)
        The signal that was fitted: time [s], measured and predicted, in `unit`.
    signal, unit : str
        Name and unit of that signal.
    train : Score
        On the samples that were fitted.
    validation : Score or None
        On samples that were not.
    aic, bic : float
        Information criteria of Akaike and Schwarz for Gaussian residuals on the decimated, hence nearly
        uncorrelated samples; lower is better.
    weak : mapping of str to str
        Parameters that the record hardly determines -> why, and what to measure.
    warnings : tuple of str
        What else to know about record and fit.
    seconds : float
        Time the identification took.
    simulations : int
        Number of simulations of the model.
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

    def values(self) -> dict[str, float]:
        """Parameter values without their errors, those that were given included."""
        return {**self.fixed, **{name: estimate.value for name, estimate in self.parameters.items()}}
