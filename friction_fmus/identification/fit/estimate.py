"""An estimated parameter: value, standard error, unit."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Estimate:
    """Estimated parameter.

    Attributes
    ----------
    name : str
        Name of the parameter.
    value : float
        Estimate, in `unit`.
    standard_error : float
        Standard error, in `unit`; NaN if it is not available.
    unit : str
        Unit of value and standard error.
    noise_error : float or None
        Part of the standard error that is due to noise, without the bias by delays and filters of the measurement; None
        if the parts are not known.
    """

    name: str
    value: float
    standard_error: float
    unit: str
    noise_error: float | None = None

    @property
    def relative_error(self) -> float:
        """Standard error divided by the magnitude of the value."""
        return self.standard_error / abs(self.value) if self.value else float("inf")
