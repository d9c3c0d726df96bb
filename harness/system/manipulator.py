"""Manipulators: what is done to the value of a wire during a span of a run, to see what a loop makes of it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields
from typing import Any, ClassVar, Final

from harness.errors import ExperimentError, nearest
from harness.values import is_count, is_number, number, shown, text

LONGEST_DELAY: Final = 10_000_000
"""Ticks of a delay; the values in between are kept."""


@dataclass(frozen=True)
class Manipulator:
    """What all manipulators have; use one of the classes below.

    Those of one wire act one after the other, in the order in which they are given, behind the wire's own gain and
    offset. Each is at work in the steps that begin at start <= t < stop.

    Parameters
    ----------
    input : str
        ``"part.port"`` of the input at the end of the wire.
    start, stop : float
        Span [s]; without them the whole run.

    Raises
    ------
    ExperimentError
        If a number makes no sense.
    """

    kind: ClassVar[str]
    input: str
    start: float = field(default=-math.inf, kw_only=True)
    stop: float = field(default=math.inf, kw_only=True)

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name in ("value", "sigma", "probability", "start", "stop"):
            if not is_number(getattr(self, name, 0.0)):
                raise ExperimentError(
                    f"{name} of the {self.kind} of {self.input} is {shown(getattr(self, name))}: give a number"
                )
        if not self.start < self.stop:
            raise ExperimentError(
                f"the {self.kind} of {self.input} begins at {self.start} s and ends at {self.stop} s: "
                "give a start before the stop"
            )
        for name in ("value", "sigma"):
            if not math.isfinite(getattr(self, name, 0.0)):
                raise ExperimentError(
                    f"{name} of the {self.kind} of {self.input} is {getattr(self, name)}: give a finite number"
                )

    def __str__(self) -> str:
        """Kind and place."""
        return f"{self.kind} of {self.input}"


@dataclass(frozen=True)
class Override(Manipulator):
    """The input gets a constant instead of the value of the wire.

    Parameters
    ----------
    input, start, stop
        See `Manipulator`.
    value : float
        The constant, in the unit of the input.
    """

    kind: ClassVar[str] = "override"
    value: float


@dataclass(frozen=True)
class Bias(Manipulator):
    """Something is added to the value.

    Parameters
    ----------
    input, start, stop
        See `Manipulator`.
    value : float
        What is added, in the unit of the input.
    """

    kind: ClassVar[str] = "bias"
    value: float


@dataclass(frozen=True)
class Noise(Manipulator):
    """White noise, normally distributed and new in every step, is added to the value.

    Parameters
    ----------
    input, start, stop
        See `Manipulator`.
    sigma : float
        Standard deviation, in the unit of the input.
    seed : int
        The same seed gives the same noise.
    """

    kind: ClassVar[str] = "noise"
    sigma: float
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the standard deviation and the seed."""
        super().__post_init__()
        if self.sigma < 0.0:
            raise ExperimentError(f"sigma of the {self} is {self.sigma}: give 0 or more")
        _check_seed(self, self.seed)


@dataclass(frozen=True)
class Freeze(Manipulator):
    """The input keeps the last value from before the span.

    Parameters
    ----------
    input, start, stop
        See `Manipulator`.
    """

    kind: ClassVar[str] = "freeze"


@dataclass(frozen=True)
class DropOut(Manipulator):
    """Values get lost: the input then keeps the last one that arrived.

    Parameters
    ----------
    input, start, stop
        See `Manipulator`.
    probability : float
        Of losing the value of a step.
    seed : int
        The same seed loses the same values.
    """

    kind: ClassVar[str] = "drop-out"
    probability: float
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the probability and the seed."""
        super().__post_init__()
        if not 0.0 <= self.probability <= 1.0:
            raise ExperimentError(f"the probability of the {self} is {self.probability}: give 0 to 1")
        _check_seed(self, self.seed)


@dataclass(frozen=True)
class Delay(Manipulator):
    """The input gets what the output was so many ticks earlier, and before that its start value.

    Values that a master holds from the beginning of a step, as jacobi does, are one tick old already; a delay of one
    tick then changes nothing.

    Parameters
    ----------
    input, start, stop
        See `Manipulator`.
    ticks : int
        How many, 1 or more.
    """

    kind: ClassVar[str] = "delay"
    ticks: int = 1

    def __post_init__(self) -> None:
        """Check the number of ticks."""
        super().__post_init__()
        if not is_count(self.ticks, 1, LONGEST_DELAY):
            raise ExperimentError(
                f"the {self} is {shown(self.ticks)} ticks: give a whole number, 1 or more, up to {LONGEST_DELAY}"
            )


_KINDS: dict[str, type[Manipulator]] = {cls.kind: cls for cls in (Override, Bias, Noise, Freeze, DropOut, Delay)}


def _check_seed(manipulator: Manipulator, seed: object) -> None:
    if not is_count(seed, 0, 1 << 64):
        raise ExperimentError(f"the seed of the {manipulator} is {shown(seed)}: give a whole number, 0 or more")


def read_manipulator(table: Mapping[str, Any]) -> Manipulator:
    """A manipulator from a table such as ``{"kind": "bias", "input": "pid.x", "value": 1e-3, "start": 0.5}``.

    Raises
    ------
    ExperimentError
        If a key is missing, unknown or of the wrong type.
    """
    kind = table.get("kind")
    if not isinstance(kind, str) or kind not in _KINDS:
        remedy = nearest(kind if isinstance(kind, str) else "", _KINDS)
        raise ExperimentError(f"{shown(kind)} is no kind of manipulator: {remedy}")
    cls = _KINDS[kind]
    settings = {key: value for key, value in table.items() if key != "kind"}
    known = {item.name: item for item in fields(cls)}
    for key, value in settings.items():
        if key not in known:
            raise ExperimentError(f"'{key}' means nothing to a {kind}: {nearest(key, known)}")
        if (text(value) if key == "input" else number(value)) is None:
            raise ExperimentError(f"{key} of a {kind} is {shown(value)}: that is not of the right type")
    for name, item in known.items():
        if name not in settings and item.default is MISSING:
            raise ExperimentError(f"a {kind} has no {name}: add it")
    return cls(**settings)


def manipulator_table(manipulator: Manipulator) -> dict[str, str | float | int]:
    """The table that `read_manipulator` reads back; what has its default is left out."""
    values = {item.name: getattr(manipulator, item.name) for item in fields(manipulator)}
    defaults = {item.name: item.default for item in fields(manipulator)}
    return {"kind": manipulator.kind, **{name: value for name, value in values.items() if value != defaults[name]}}
