"""Compensators that apply to an axis, and their parameters, derived from the identified axis.

The file of each law and controller states how it is used and tuned, see `friction_fmus.blocks.block_declarations`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import pi, sqrt
from typing import Final, TypeAlias

import numpy as np

from friction_fmus.axis.loop_assembly import block, typed
from friction_fmus.axis.servo import AxisPlant, Compensator, Servo
from friction_fmus.blocks import USES
from friction_fmus.blocks.arithmetic import Number, evaluate, names_in, vectors_in
from friction_fmus.blocks.axis_units import Words, words_of
from friction_fmus.blocks.block_declarations import Use
from friction_fmus.blocks.catalogue import about_of, listing
from friction_fmus.errors import did_you_mean
from friction_fmus.identification import Array
from friction_fmus.study.config import ALL, ConfigError
from harness import FmuPart, open_archive

Values: TypeAlias = Mapping[str, float]


NAMES: Final = (
    *("m", "Ts", "bandwidth", "corner", "observed", "x_noise", "v_noise", "level", "speed", "period", "Kp", "Kd", "Ki"),
)
"""Properties of an axis that the expressions of `Use.tuned` can use."""


@dataclass(frozen=True)
class AxisKnowledge:
    """Properties of an identified axis that determine the parameters of compensators."""

    servo: Servo  # feedback and sensors
    plant: AxisPlant  # mass and best friction model
    models: Mapping[str, Values]  # parameters of every identified friction model, by name of the block
    period: int = 0  # period of the reference in samples; 0 if it is not periodic
    speed: float = 0.0  # largest reference velocity [m/s]
    rotary: bool = False  # whether the axis is rotary
    scale: float = 1.0  # factor of the bandwidth of estimators

    @property
    def words(self) -> Words:
        """Nouns and units of the axis."""
        return words_of(self.rotary)

    @property
    def Ts(self) -> float:  # noqa: N802 (the symbol of the sample time)
        """Sample time [s]."""
        return self.servo.Ts

    @property
    def m(self) -> float:
        """Moved mass [kg]."""
        return self.plant.mass

    @property
    def bandwidth(self) -> float:
        """Natural frequency of the position loop [rad/s]."""
        return sqrt(self.servo.pid[0] / self.m)

    @property
    def corner(self) -> float:
        """Corner frequency of estimators [Hz]: 2 `scale` times that of the loop, at most a tenth of the sample rate."""
        return min(self.scale * 2.0 * self.bandwidth / (2.0 * pi), 0.1 / self.Ts)

    @property
    def observed(self) -> float:
        """Magnitude of the three observer poles [rad/s]: 4 `scale` times the loop bandwidth, at most 1/(2 Ts)."""
        return min(self.scale * 4.0 * self.bandwidth, 0.5 / self.Ts)

    @property
    def x_noise(self) -> float:
        """Standard deviation of the measured position [m], from quantisation or else 1e-6 of the travel per sample."""
        return max(self.servo.quantum / sqrt(12.0), 1e-6 * self.speed * self.Ts, 1e-12)

    @property
    def v_noise(self) -> float:
        """Standard deviation of the velocity computed from two positions [m/s]."""
        return sqrt(2.0) * self.x_noise / (self.servo.window * self.Ts)

    @property
    def level(self) -> float:
        """Largest friction force near rest [N]."""
        values = self.plant.values
        parts = [sum(v for name, v in values.items() if name.startswith("W["))]
        return max(*parts, *(values.get(name, 0.0) for name in ("Fc", "Fs", "T_dz")))

    @property
    def Kp(self) -> float:  # noqa: N802 (the symbols of the gains)
        """Proportional gain of the servo [N/m]."""
        return self.servo.pid[0]

    @property
    def Kd(self) -> float:  # noqa: N802
        """Derivative gain of the servo [N.s/m]."""
        return self.servo.pid[1]

    @property
    def Ki(self) -> float:  # noqa: N802
        """Integral gain of the servo [N/(m.s)]."""
        return self.servo.pid[2]

    def tuned(self, use: Use, model: Values) -> dict[str, Number]:
        """Return the parameters of a compensator that follow from the axis."""
        found: dict[str, Number] = {}
        for name, text in use.tuned.items():
            values = {**model, **{known: getattr(self, known) for known in names_in(text) if known in NAMES}}
            vectors = vectors_in(text)
            if not vectors:
                found[name] = evaluate(text, values)
                continue
            i = 1
            while all(f"{vector}[{i}]" in model for vector in vectors):
                found[name.replace("[i]", f"[{i}]")] = evaluate(text, {**values, "i": i})
                i += 1
        return found


@dataclass(frozen=True)
class Candidate:
    """Candidate compensator for an axis."""

    name: str
    kind: str
    model: str
    """Law, its kind, and the friction model that provides its parameters."""
    compensator: Compensator | None
    """Block with its parameters; None if the law does not apply, and for integral action of the servo."""
    reason: str = ""  # reason why the law does not apply; empty if it does

    @property
    def applies(self) -> bool:
        """Whether the candidate can be tried on the axis."""
        return self.compensator is not None or (self.kind in (INTEGRAL.kind, TABLE.kind) and not self.reason)

    @property
    def has_bandwidth(self) -> bool:
        """Whether a bandwidth is tuned; otherwise the gain is tuned."""
        return self.kind == INTEGRAL.kind or bool(self._bandwidths)

    @property
    def _bandwidths(self) -> set[str]:
        """Bandwidths of `AxisKnowledge` that the parameters of the law depend on."""
        use = compensators()[self.name]
        names = {name for text in use.tuned.values() for name in names_in(text)}
        return names & {"corner", "observed"} if use.kind in ("estimator", "learning") else set()

    def bandwidth(self, known: AxisKnowledge) -> float:
        """Return the bandwidth that is tuned [Hz]; for integral action, the corner frequency of the integral."""
        if self.kind == INTEGRAL.kind:
            return known.scale * known.bandwidth / (2.0 * pi)
        return known.observed / (2.0 * pi) if "observed" in self._bandwidths else known.corner


INTEGRAL: Final = Candidate("IntegralAction", "integral action", "", None)  # integral action of the servo

INTEGRAL_SUMMARY: Final = "Integral action of the servo"

TABLE: Final = Candidate("PositionMap", "table over position", "", None)
"""Identified force over position, compensated along the reference."""

TABLE_SUMMARY: Final = "{Force} over position, compensated along the reference"


def buildable(wanted: Sequence[str] | str) -> list[str]:
    """Return the names of the wanted laws that a study can try on some axis."""
    uses = compensators()
    names = list(uses) if wanted == ALL else list(wanted)
    return [name for name in names if name in uses and not uses[name].never]


def candidates(wanted: Sequence[str] | str, known: AxisKnowledge) -> list[Candidate]:
    """Return the compensators to compare on an axis."""
    check_names(wanted)
    uses = compensators()
    names = [*uses, INTEGRAL.name, TABLE.name] if wanted == ALL else list(wanted)
    flat = f"No {known.words.force} of the axis that depends on position was identified."
    if known.plant.terms:
        flat = "The feedforward of velocity and acceleration compensates gravity already."
    elif known.plant.position is not None:
        flat = ""
    without_law = {INTEGRAL.name: INTEGRAL, TABLE.name: replace(TABLE, reason=flat)}
    return [without_law[name] if name in without_law else _choice(name, uses[name], known) for name in names]


def within_range(compensator: Compensator) -> bool:
    """Return whether all parameters of a compensator are within the ranges that its FMU states."""
    variables = open_archive(block(compensator.model)).variables
    return all(
        (variables[name].min is None or float(variables[name].min) <= value)
        and (variables[name].max is None or value <= float(variables[name].max))
        for name, value in compensator.values.items()
    )


def tuned_to(candidate: Candidate, known: AxisKnowledge) -> Compensator:
    """Return a candidate's compensator with the parameters for an axis, such as one with another `scale`."""
    use = compensators()[candidate.name]
    found = _choice(candidate.name, use, known).compensator
    assert found is not None
    return found


def check_names(wanted: Sequence[str] | str) -> None:
    """Raise ConfigError if a name is not one of `compensators`."""
    known = [*compensators(), INTEGRAL.name, TABLE.name]
    for name in () if isinstance(wanted, str) else wanted:
        if name not in known:
            hint = did_you_mean(name, known)
            raise ConfigError(
                f"[compensation], compensators: there is no compensator {name!r}{hint}; correct the name."
            )


def _choice(name: str, row: Use, known: AxisKnowledge) -> Candidate:
    if row.never:
        return Candidate(name, row.kind, "", None, known.words.fill(row.never))
    model = next((model for model in row.models if model in known.models), "")
    if row.models and not model:
        return Candidate(
            name,
            row.kind,
            "",
            None,
            f"It needs the parameters of {row.models[0]}, which the record does not determine.",
        )
    path = block(name, known.rotary)
    if row.period and not 0 < known.period <= (most := int(open_archive(path).variables[row.period].max)):
        text = (
            f"the period of {known.period} samples is longer than its limit of {most}"
            if known.period
            else "this one is not periodic"
        )
        return Candidate(name, row.kind, "", None, f"It needs a periodic reference, but {text}.")
    given = known.models.get(model, {})
    part = FmuPart("law", path)
    settable = {port.name for port in part.parameters}
    tuned = typed(part, known.tuned(row, given))
    taken = {row.renamed.get(parameter, parameter): value for parameter, value in given.items()}
    values = {parameter: value for parameter, value in taken.items() if parameter in settable}
    return Candidate(name, row.kind, model, Compensator(name, row.output, {**values, **tuned}))


def compensators() -> dict[str, Use]:
    """Return the laws and controllers of the catalogue that a study can use, ordered by kind."""
    uses = {name: about_of(entry).use for name, entry in listing().items()}
    known = [(name, use) for name, use in uses.items() if use is not None]
    return dict(sorted(known, key=lambda pair: USES.index(pair[1].kind)))


def period_of(r: Array, least: int) -> int:
    """Return the period of a reference in samples; 0 if it does not contain two equal periods."""
    span = float(np.ptp(r))
    if span == 0.0:
        return 0
    # mean square of r[k + lag] - r[k], which has a minimum at a period
    lags = np.arange(least, len(r) // 2 + 1)
    power = np.append(0.0, np.cumsum(np.square(r - r.mean())))
    likeness = np.fft.irfft(np.abs(np.fft.rfft(r - r.mean(), 2 * len(r))) ** 2)[lags]
    change = (power[len(r) - lags] + power[-1] - power[lags] - 2.0 * likeness) / (len(r) - lags)
    for lag in lags[change < 1e-9 * span**2]:
        if np.max(np.abs(r[lag:] - r[:-lag])) < 1e-6 * span:
            return int(lag)
    return 0
