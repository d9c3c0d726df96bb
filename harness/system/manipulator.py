"""Manipulators: changes to the value of a connection during a span of a run, such as faults, noise and delays."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields
from typing import Any, ClassVar, Final

from harness.errors import ExperimentError
from harness.storage.toml_file import Table
from harness.values import is_count, is_number, make_plain, number, shown, text

LONGEST_DELAY: Final = 10_000_000
"""Largest delay in communication steps, as all values in between are stored."""


@dataclass(frozen=True)
class Manipulator:
    """Base class of manipulators; use one of its subclasses.

    Several manipulators of one connection act in the given order, after the gain and the offset of the connection. Each
    is active in the communication steps that begin at start <= t < stop.

    Parameters
    ----------
    input : str
        ``"part.port"`` of the input at the end of the connection.
    start, stop : float
        Active span [s]; the default is the whole run.

    Raises
    ------
    ExperimentError
        If a number is invalid.
    """

    kind: ClassVar[str]
    input: str
    start: float = field(default=-math.inf, kw_only=True)
    stop: float = field(default=math.inf, kw_only=True)

    def __post_init__(self) -> None:
        """Check the numbers."""
        make_plain(self)
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
        """Return the kind and the input."""
        return f"{self.kind} of {self.input}"


@dataclass(frozen=True)
class Override(Manipulator):
    """Replacement of the value by a constant.

    Parameters
    ----------
    input : str
        ``"part.port"`` of the input at the end of the connection.
    value : float
        The constant, in the unit of the input.
    start, stop : float
        Active span [s]; the default is the whole run.
    """

    kind: ClassVar[str] = "override"
    value: float


@dataclass(frozen=True)
class Bias(Manipulator):
    """Addition of a constant to the value.

    Parameters
    ----------
    input : str
        ``"part.port"`` of the input at the end of the connection.
    value : float
        The added constant, in the unit of the input.
    start, stop : float
        Active span [s]; the default is the whole run.
    """

    kind: ClassVar[str] = "bias"
    value: float


@dataclass(frozen=True)
class Noise(Manipulator):
    """Addition of normally distributed white noise, with a new value in every communication step.

    Parameters
    ----------
    input : str
        ``"part.port"`` of the input at the end of the connection.
    sigma : float
        Standard deviation, in the unit of the input.
    seed : int
        Seed of the random numbers; equal seeds give equal noise.
    start, stop : float
        Active span [s]; the default is the whole run.
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
    """Hold of the last value from before the span.

    Parameters
    ----------
    input : str
        ``"part.port"`` of the input at the end of the connection.
    start, stop : float
        Active span [s]; the default is the whole run.
    """

    kind: ClassVar[str] = "freeze"


@dataclass(frozen=True)
class DropOut(Manipulator):
    """Random loss of values; the input then keeps the last value that arrived.

    Parameters
    ----------
    input : str
        ``"part.port"`` of the input at the end of the connection.
    probability : float
        Probability of losing the value of a communication step.
    seed : int
        Seed of the random numbers; equal seeds lose the same values.
    start, stop : float
        Active span [s]; the default is the whole run.
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
    """Delay of the value by a number of communication steps; until then, the input has the first value of the output.

    With a master that holds values from the beginning of a step, such as jacobi, values already arrive one step late; a
    delay of one step then has no effect.

    Parameters
    ----------
    input : str
        ``"part.port"`` of the input at the end of the connection.
    ticks : int
        Delay in communication steps, 1 or more.
    start, stop : float
        Active span [s]; the default is the whole run.
    """

    kind: ClassVar[str] = "delay"
    ticks: int = 1

    def __post_init__(self) -> None:
        """Check the number of communication steps."""
        super().__post_init__()
        if not is_count(self.ticks, 1, LONGEST_DELAY):
            raise ExperimentError(
                f"the {self} is {shown(self.ticks)} communication steps: give an integer from 1 to {LONGEST_DELAY}"
            )


_KINDS: dict[str, type[Manipulator]] = {cls.kind: cls for cls in (Override, Bias, Noise, Freeze, DropOut, Delay)}


def _check_seed(manipulator: Manipulator, seed: object) -> None:
    if not is_count(seed, 0, 1 << 64):
        raise ExperimentError(f"the seed of the {manipulator} is {shown(seed)}: give an integer, 0 or more")


def read_manipulator(table: Mapping[str, Any]) -> Manipulator:
    """Return a manipulator from a table such as ``{"kind": "bias", "input": "pid.x", "value": 1e-3, "start": 0.5}``."""
    kind = Table(table, "a manipulator", ExperimentError).choice("kind", _KINDS)
    given = Table(table, f"a {kind}", ExperimentError)
    keys = {item.name: item for item in fields(_KINDS[kind])}
    given.known(("kind", *keys))
    wanted = [key for key, item in keys.items() if key in given or item.default is MISSING]
    settings: dict[str, Any] = {
        key: given.take(key, *((text, "a text") if key == "input" else (_as_it_is, "a number"))) for key in wanted
    }
    return _KINDS[kind](**settings)


def _as_it_is(value: Any) -> Any:
    return value if number(value) is not None else None


def manipulator_table(manipulator: Manipulator) -> dict[str, str | float | int]:
    """Return the table that `read_manipulator` reads, without values at their defaults."""
    values = {item.name: getattr(manipulator, item.name) for item in fields(manipulator)}
    defaults = {item.name: item.default for item in fields(manipulator)}
    return {"kind": manipulator.kind, **{name: value for name, value in values.items() if value != defaults[name]}}
