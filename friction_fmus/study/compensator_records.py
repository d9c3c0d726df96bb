"""Parts of the result of a study that describe the compensators, as plain data like those of `records`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf

from friction_fmus.study.records import Curve


@dataclass(frozen=True)
class Metrics:
    """Metrics of one run of the servo, including its start."""

    rms: float
    largest: float
    """Root mean square and maximum of the tracking error, reference minus position, in `units.position`."""
    effort: float
    """Root mean square of the drive force, in `units.force`."""
    effort_high: float
    """Root mean square of the drive force above the bandwidth of the loop, in `units.force`."""
    variation: float
    """Total variation of the drive force over the duration, in `units.force` per second."""
    settling: float | None = None
    """Median time after a reversal until the error stays within the band of the study [s]; None without reversals."""
    chatter: float | None = None
    """Root mean square of the drive force above the bandwidth of the loop while the reference rests, in `units.force`;
    None if it does not rest."""
    rms_bound: float | None = None
    """Bound of the numerical error of `rms`; None for a run that was not repeated with another step."""


@dataclass(frozen=True)
class LoopMargins:
    """Smallest margins of a loop over its operating points: sliding and, if the contact is elastic, rest."""

    Ms: float | None
    """Peak of the sensitivity function; None if the loop is unstable."""
    phase: float | None
    """Phase margin [deg]; None if the loop gain is nowhere 1."""
    delay: float | None
    """Delay margin [samples]; None if the loop gain is nowhere 1."""


@dataclass(frozen=True)
class Limits:
    """Limits on the margins of every loop that is compared."""

    Ms: float = 2.0
    """Largest peak of the sensitivity function."""
    delay: float = 1.5
    """Smallest delay margin [samples]."""

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
    """Run with one value of the tuned parameter."""

    gain: float
    """Gain of the compensation."""
    bandwidth: float | None
    """Bandwidth of an estimator, or corner frequency of integral action [Hz]; None if the compensator has none."""
    margins: LoopMargins | None
    """Margins of the loop; None if the compensator cannot be linearised."""
    metrics: Metrics | None
    """Metrics; None if the run failed."""
    failure: str = ""
    """Reason why the run failed."""


@dataclass(frozen=True)
class Corner:
    """Run on an axis that differs from the identified one."""

    name: str
    """Description of the difference."""
    metrics: Metrics | None
    """Metrics; None if the run failed."""
    failure: str = ""
    """Reason why the run failed."""
    counts: bool = True
    """Whether the run is part of the worst case; an extra delay beyond the demanded delay margin is not."""


@dataclass(frozen=True)
class CompensatorResult:
    """Result of one compensator."""

    name: str
    summary: str
    """Name of the law, or of feedforward and estimator joined by " + ", and its description; the entry "none" is the
    servo without compensation."""
    kind: str
    """"none", "integral action", "feedforward", "model feedback", "estimator", "feedforward with estimator",
    "feedforward with integral action", "table over position" (alone or with others), "dither", "learning", or
    "controller"."""
    applies: bool
    """Whether the compensator was co-simulated."""
    reason: str = ""
    """Reason why it does not apply or why all runs failed; otherwise empty."""
    model: str = ""
    """Friction model whose identified parameters the law uses; empty if it uses none."""
    parameters: Mapping[str, float] = field(default_factory=dict)
    """Parameters that were set; the others have their start values."""
    gain: float | None = None
    """Best gain up to 1."""
    bandwidth: float | None = None
    """Best bandwidth [Hz], as in `Trial`."""
    metrics: Metrics | None = None
    """Metrics of the best trial."""
    margins: LoopMargins | None = None
    """Margins of the best trial."""
    trials: tuple[Trial, ...] = ()
    """Runs over the tuned parameter."""
    corners: tuple[Corner, ...] = ()
    """Runs of the best trial on other axes."""
    worst: float | None = None
    best: float | None = None
    """Largest and smallest `rms` of `metrics` and of the corners that count."""
    cycles: float | None = None
    flash: float | None = None
    """Estimated cycles of one sample and size of the C code on a Cortex-M4F [bytes]; None without C code."""
    score: float | None = None
    """Weighted sum of logarithms by which the compensators are ranked, see `friction_fmus.study.ranking`."""
    rank: int | None = None
    """Rank, 1 is best; None if the compensator does not apply."""
    improves: bool = False
    """Whether it reduces the tracking error, also in every corner that counts."""
    error: Curve | None = None
    """Reference minus position over time of the best trial [s, units.position]; decimated with all extremes kept."""


@dataclass(frozen=True)
class Rung:
    """Rung of the ladder from the axis as measured to the best compensation."""

    title: str
    """What the servo has on this rung."""
    name: str
    """Compensator of this rung, "none" for the servo alone; empty for the axis as measured."""
    metrics: Metrics
    """Metrics."""


@dataclass(frozen=True)
class Recommendation:
    """Recommendation of a study."""

    name: str
    """Recommended compensator; "none" if no compensator improves the axis; empty if none was simulated."""
    reason: str
    """Reasons in a few sentences."""
    gain: float | None = None
    """Gain of the recommended compensator."""
    runner_up: str = ""
    """Second-best compensator; empty if no other one improves the axis."""
    runner_up_reason: str = ""
    """Metrics of the second-best compensator in one sentence."""
    next_steps: tuple[str, ...] = ()
    """What to set in the drive, and what to measure, one sentence each."""
