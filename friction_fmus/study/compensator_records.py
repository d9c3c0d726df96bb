"""Parts of the result of a study that describe the compensators, as plain data like those of `records`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf

from friction_fmus.study.records import Curve


@dataclass(frozen=True)
class Metrics:
    """Metrics of one run of the servo, including its start.

    Attributes
    ----------
    rms, largest : float
        Root mean square and maximum of the tracking error, reference minus position, in `units.position`.
    effort : float
        Root mean square of the drive force, in `units.force`.
    effort_high : float
        Root mean square of the drive force above the bandwidth of the loop, in `units.force`.
    variation : float
        Total variation of the drive force over the duration, in `units.force` per second.
    settling : float or None
        Median time after a reversal until the error stays within the band of the study [s]; None without reversals.
    chatter : float or None
        Root mean square of the drive force above the bandwidth of the loop while the reference rests, in `units.force`;
        None if it does not rest.
    rms_bound : float or None
        Bound of the numerical error of `rms`; None for a run that was not repeated with another step.
    """

    rms: float
    largest: float
    effort: float
    effort_high: float
    variation: float
    settling: float | None = None
    chatter: float | None = None
    rms_bound: float | None = None


@dataclass(frozen=True)
class LoopMargins:
    """Smallest margins of a loop over its operating points: sliding and, if the contact is elastic, rest.

    Attributes
    ----------
    Ms : float or None
        Peak of the sensitivity function; None if the loop is unstable.
    phase : float or None
        Phase margin [deg]; None if the loop gain is nowhere 1.
    delay : float or None
        Delay margin [samples]; None if the loop gain is nowhere 1.
    """

    Ms: float | None
    phase: float | None
    delay: float | None


@dataclass(frozen=True)
class Limits:
    """Limits on the margins of every loop that is compared.

    Attributes
    ----------
    Ms : float
        Largest peak of the sensitivity function.
    delay : float
        Smallest delay margin [samples].
    """

    Ms: float = 2.0
    delay: float = 1.5

    def relaxed(self, alone: LoopMargins) -> Limits:
        """Return the limits that the servo alone keeps: a compensator must not make worse what already exceeds them."""
        return Limits(
            max(self.Ms, inf if alone.Ms is None else alone.Ms),
            self.delay if alone.delay is None else min(self.delay, alone.delay),
        )

    def kept_by(self, margins: LoopMargins | None) -> bool:
        """Return whether a loop is stable and within the limits; a loop without known margins counts as such."""
        if margins is None:
            return True
        slack = 1.0 + 1e-9
        return (
            margins.Ms is not None
            and margins.Ms <= slack * self.Ms
            and (margins.delay is None or slack * margins.delay >= self.delay)
        )


@dataclass(frozen=True)
class Trial:
    """Run with one value of the tuned parameter.

    Attributes
    ----------
    gain : float
        Gain of the compensation.
    bandwidth : float or None
        Bandwidth of an estimator, or corner frequency of integral action [Hz]; None if the compensator has none.
    margins : LoopMargins or None
        Margins of the loop; None if the compensator cannot be linearised.
    metrics : Metrics or None
        Metrics; None if the run failed.
    failure : str
        Reason why the run failed.
    """

    gain: float
    bandwidth: float | None
    margins: LoopMargins | None
    metrics: Metrics | None
    failure: str = ""


@dataclass(frozen=True)
class Corner:
    """Run on an axis that differs from the identified one.

    Attributes
    ----------
    name : str
        Description of the difference.
    metrics : Metrics or None
        Metrics; None if the run failed.
    failure : str
        Reason why the run failed.
    counts : bool
        Whether the run is part of the worst case; an extra delay beyond the demanded delay margin is not.
    """

    name: str
    metrics: Metrics | None
    failure: str = ""
    counts: bool = True


@dataclass(frozen=True)
class CompensatorResult:
    """Result of one compensator.

    Attributes
    ----------
    name, summary : str
        Name of the law, or of feedforward and estimator joined by " + ", and its description; the entry "none" is the
        servo without compensation.
    kind : str
        "none", "integral action", "feedforward", "model feedback", "estimator", "feedforward with estimator",
        "feedforward with integral action", "table over position" (alone or with others), "dither", "learning", or
        "controller".
    applies : bool
        Whether the compensator was co-simulated.
    reason : str
        Reason why it does not apply or why all runs failed; otherwise empty.
    model : str
        Friction model whose identified parameters the law uses; empty if it uses none.
    parameters : mapping of str to float
        Parameters that were set; the others have their start values.
    gain : float or None
        Best gain up to 1.
    bandwidth : float or None
        Best bandwidth [Hz], as in `Trial`.
    metrics : Metrics or None
        Metrics of the best trial.
    margins : LoopMargins or None
        Margins of the best trial.
    trials : tuple of Trial
        Runs over the tuned parameter.
    corners : tuple of Corner
        Runs of the best trial on other axes.
    worst, best : float or None
        Largest and smallest `rms` of `metrics` and of the corners that count.
    cycles, flash : float or None
        Estimated cycles of one sample and size of the C code on a Cortex-M4F [bytes]; None without C code.
    score : float or None
        Weighted sum of logarithms by which the compensators are ranked, see `friction_fmus.study.ranking`.
    rank : int or None
        Rank, 1 is best; None if the compensator does not apply.
    improves : bool
        Whether it reduces the tracking error, also in every corner that counts.
    error : Curve or None
        Reference minus position over time of the best trial [s, units.position]; decimated with all extremes kept.
    """

    name: str
    summary: str
    kind: str
    applies: bool
    reason: str = ""
    model: str = ""
    parameters: Mapping[str, float] = field(default_factory=dict)
    gain: float | None = None
    bandwidth: float | None = None
    metrics: Metrics | None = None
    margins: LoopMargins | None = None
    trials: tuple[Trial, ...] = ()
    corners: tuple[Corner, ...] = ()
    worst: float | None = None
    best: float | None = None
    cycles: float | None = None
    flash: float | None = None
    score: float | None = None
    rank: int | None = None
    improves: bool = False
    error: Curve | None = None


@dataclass(frozen=True)
class Rung:
    """Rung of the ladder from the axis as measured to the best compensation.

    Attributes
    ----------
    title : str
        What the servo has on this rung.
    name : str
        Compensator of this rung, "none" for the servo alone; empty for the axis as measured.
    metrics : Metrics
        Metrics.
    """

    title: str
    name: str
    metrics: Metrics


@dataclass(frozen=True)
class Recommendation:
    """Recommendation of a study.

    Attributes
    ----------
    name : str
        Recommended compensator; "none" if no compensator improves the axis; empty if none was simulated.
    reason : str
        Reasons in a few sentences.
    gain : float or None
        Gain of the recommended compensator.
    runner_up : str
        Second-best compensator; empty if no other one improves the axis.
    runner_up_reason : str
        Metrics of the second-best compensator in one sentence.
    next_steps : tuple of str
        What to set in the drive, and what to measure, one sentence each.
    """

    name: str
    reason: str
    gain: float | None = None
    runner_up: str = ""
    runner_up_reason: str = ""
    next_steps: tuple[str, ...] = ()
