"""Figures of the pages of blocks: panels of curves, drawn by matplotlib."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from friction_fmus.fmi.drawing import plain_style, svg_of

Vector = NDArray[np.floating[Any]]


@dataclass(frozen=True)
class Curve:
    """A line in a panel."""

    x: Vector
    y: Vector
    """Points in the units of the panel."""
    label: str = ""  # label, if the panel has several curves; else empty
    aside: bool = False  # whether the curve is shown for comparison, in grey


@dataclass(frozen=True)
class Panel:
    """A plot with its curves, axes and caption."""

    curves: tuple[Curve, ...]  # at least one
    x: tuple[str, str]
    y: tuple[str, str]
    """Name and unit of each axis."""
    caption: str = ""  # description of what is shown, for the page with the figure
    equal: bool = False  # whether both axes have the same scale


COLOUR, ASIDE = "#1f4e79", "#9aa3ad"  # of a curve, and of one for comparison

RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def _range(columns: Sequence[Any]) -> tuple[float, float]:
    """Return the range of values, widened if it is empty."""
    low, high = min(float(c.min()) for c in columns), max(float(c.max()) for c in columns)
    return (low, high) if high > low else (low - 1.0, high + 1.0)


def chart(panel: Panel, title: str) -> bytes:
    """Return a panel with axes and units as SVG for the documentation."""
    with plain_style(**{"svg.fonttype": "none"}):  # keep texts as texts, for search and screen readers
        figure = Figure(figsize=(4.2, 3.0))
        named = any(curve.label for curve in panel.curves)
        axes = figure.add_axes((0.16, 0.16, 0.8, 0.71 if named else 0.79))
        x_power, y_power = (_power(_range(columns)) for columns in _columns(panel))
        for curve in panel.curves:
            colour = ASIDE if curve.aside else COLOUR
            x, y = curve.x / 10.0**x_power, curve.y / 10.0**y_power
            axes.plot(x, y, color=colour, lw=1.6, label=curve.label)
        axes.set_xlabel(labelled(panel.x, x_power))
        axes.set_ylabel(labelled(panel.y, y_power))
        axes.locator_params(nbins=6)
        axes.grid(color="#e3e7ea", lw=0.8)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
        if panel.equal:
            axes.set_aspect("equal", adjustable="datalim")
        if named:
            axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, frameon=False)
        return svg_of(figure, title)


def _columns(panel: Panel) -> tuple[list[Any], list[Any]]:
    return [curve.x for curve in panel.curves], [curve.y for curve in panel.curves]


def _power(limits: tuple[float, float]) -> int:
    """Return the power of ten, a multiple of three, to factor out of the numbers on an axis; 0 if not needed."""
    largest = max(map(abs, limits))
    return 0 if 0.02 <= largest < 1e4 else 3 * math.floor(math.log10(largest) / 3.0)


def labelled(axis: tuple[str, str], power: int = 0) -> str:
    """Return name and unit of an axis, as in ``F [N]`` or ``v [10⁻³ m/s]``."""
    name, unit = axis
    scale = f"10{str(power).translate(RAISED)}" if power else ""
    factor = f"{scale} {unit}".strip()
    return f"{name} [{factor}]" if factor else name
