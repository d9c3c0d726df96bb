"""The result of an effect: measured figures with their bounds."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass, field
from math import inf, isinf
from pathlib import Path


@dataclass(frozen=True)
class Check:
    """A figure and the bounds that theory or an independent computation give for it.

    Attributes
    ----------
    name : str
        What was measured, unique within its effect.
    value : float
        The figure.
    unit : str
        Its unit, "" for a ratio.
    low, high : float
        It must not be lower or higher. With neither it is only reported.
    reproducible : bool
        False if only the bounds hold on every processor: the digits come from rounding or from a chaotic motion.
    """

    name: str
    value: float
    unit: str = ""
    low: float = -inf
    high: float = inf
    reproducible: bool = field(default=True, kw_only=True)

    @property
    def holds(self) -> bool:
        """Whether the figure is within its bounds."""
        return bool(self.low <= self.value <= self.high)  # JSON takes no bool of numpy

    @property
    def bounds(self) -> str:
        """The bounds as text, "" without any."""
        if isinf(self.low) and isinf(self.high):
            return ""
        if isinf(self.low):
            return f"at most {self.high:.4g}"
        if isinf(self.high):
            return f"at least {self.low:.4g}"
        return f"{self.low:.4g} to {self.high:.4g}"


def near(name: str, value: float, expected: float, tolerance: float, unit: str = "") -> Check:
    """Return a figure whose value is known, to a relative tolerance."""
    margin = abs(tolerance * expected)
    return Check(name, value, unit, expected - margin, expected + margin)


def small(name: str, value: float, high: float, unit: str = "") -> Check:
    """Return a figure that is zero but for rounding, sampling or a chaotic remainder: pages state its bound only."""
    return Check(name, value, unit, 0.0, high, reproducible=False)


@dataclass(frozen=True)
class Effect:
    """The result of a script.

    Attributes
    ----------
    numbers : str
        One or two sentences with the main figures.
    checks : tuple of Check
        All figures.
    """

    numbers: str
    checks: tuple[Check, ...]

    def confirm(self) -> None:
        """Raise AssertionError for figures that are out of bounds."""
        missed = [f"{c.name} is {c.value:.6g} {c.unit}, not {c.bounds}" for c in self.checks if not c.holds]
        assert not missed, "; ".join(missed)


def command_line(main: Callable[[Path, bool], Effect]) -> None:
    """Run an effect from the command line: the figure goes to the folder that is given, the numbers are printed."""
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", nargs="?", type=Path, default=Path(), help="where the figure is written")
    parser.add_argument(
        "--full", action="store_true", help="more amplitudes, gains and compensators than the figure has"
    )
    options = parser.parse_args()
    effect = main(options.folder, options.full)
    effect.confirm()
    print(effect.numbers)
