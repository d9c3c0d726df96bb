"""Scores of a prediction, information criteria, and poorly identifiable parameters."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from friction_fmus.identification.data.record import Array
from friction_fmus.identification.fit.contact_model import ContactModel
from friction_fmus.identification.fit.estimate import autocovariance
from friction_fmus.identification.fit.least_squares import advice

WEAK = 0.25  # relative standard error above which a parameter counts as poorly identifiable
TOGETHER = 0.98  # correlation of two estimates above which they count as poorly identifiable


@dataclass(frozen=True)
class Score:
    """Residual of a predicted signal.

    Attributes
    ----------
    rms : float
        Root mean square of predicted minus measured, in the unit of the signal.
    relative_percent : float
        Residual in percent of the root mean square of the measured signal.
    fit_percent : float
        100 (1 - |predicted - measured| / |measured - mean|): 100 is exact, 0 is no better than the mean.
    samples : int
        Number of samples.
    """

    rms: float
    relative_percent: float
    fit_percent: float
    samples: int


def rms(values: Array) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def score(measured: Array, predicted: Array) -> Score:
    """Return the score of a prediction against the measurement, both of shape (n,)."""
    error = predicted - measured
    size = rms(measured)
    spread = float(np.linalg.norm(measured - np.mean(measured)))
    return Score(
        rms=rms(error),
        relative_percent=100.0 * rms(error) / size if size > 0.0 else math.nan,
        fit_percent=100.0 * (1.0 - float(np.linalg.norm(error)) / spread) if spread > 0.0 else math.nan,
        samples=len(measured),
    )


def independent_samples(signals: Sequence[Array]) -> float:
    """Return the number of independent samples in signals: their number over the correlation time."""
    # The correlation time is 1 + 2 (rho_1 + ... + rho_k) up to the first correlation that is not positive. It is
    # computed from the measurement, not from residuals, so that it is the same for all models of a record.
    total = 0.0
    for signal in signals:
        n, centred = len(signal), signal - np.mean(signal)
        power = float(centred @ centred)
        if power == 0.0:
            total += 1.0
            continue
        rho = autocovariance(centred)[1:] / power
        end = int(np.argmax(rho <= 0.0)) if np.any(rho <= 0.0) else n - 1
        total += n / (1.0 + 2.0 * float(np.sum(rho[:end])))
    return max(total, 2.0)


def criteria(residual: Array, samples: float, parameters: int) -> tuple[float, float]:
    """Return AIC (H. Akaike, 1974) and BIC (G. Schwarz, 1978) for Gaussian residuals and independent samples."""
    variance = max(float(np.mean(np.square(residual))), 1e-300)
    base, count = samples * math.log(variance), parameters + 1
    return base + 2.0 * count, base + math.log(samples) * count


def weak_parameters(
    model: ContactModel,
    names: Sequence[str],
    values: Mapping[str, float],
    errors: Mapping[str, float],
    correlation: Array,
    at_bound: Mapping[str, float],
    unseen: Sequence[str],
) -> dict[str, str]:
    """Return the poorly identifiable parameters."""
    weak = {}
    for i, name in enumerate(names):
        reasons = []
        if name in unseen:
            reasons.append("the record does not depend on it, and other values fit as well")
        elif name in at_bound:
            reasons.append(f"the estimate is at its bound {at_bound[name]:.4g}")
        elif errors[name] > WEAK * abs(values[name]) and name != "OF":
            percent = 100.0 * errors[name] / abs(values[name]) if values[name] else math.inf
            reasons.append(f"its standard error is {percent:.0f} % of its value")
        others = [(abs(correlation[i, j]), names[j]) for j in range(len(names)) if j != i and names[j] not in unseen]
        if name not in unseen and others and (strongest := max(others))[0] > TOGETHER:
            reasons.append(f"it is correlated with {strongest[1]} ({strongest[0]:.3f})")
        if reasons:
            weak[name] = f"{' and '.join(reasons)}; measure {advice(model, name)}"
    return weak
