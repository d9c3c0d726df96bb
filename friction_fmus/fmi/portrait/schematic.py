"""Schematic drawings of plants: masses, springs, ground and belt."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.patches import Circle, Rectangle

GREY = "#5f6872"


def _box(axes: Any, left: float, bottom: float, width: float, height: float, colour: str, text: str) -> None:
    axes.add_patch(Rectangle((left, bottom), width, height, facecolor="#dfe7ee", edgecolor=colour, linewidth=3.6))
    font = {"fontsize": 20, "color": "#222222", "math_fontfamily": "dejavuserif"}
    axes.text(left + width / 2, bottom + height / 2, f"${text}$", ha="center", va="center", **font)


def _ground(axes: Any, left: float, right: float, y: float) -> None:
    axes.plot([left, right], [y, y], color=GREY, lw=3.0, solid_capstyle="butt")
    for x in np.arange(left + 12, right + 1, 14):
        axes.plot([x - 10, x], [y - 14, y], color=GREY, lw=2.0)


def _spring(axes: Any, left: float, right: float, y: float, colour: str) -> None:
    zigzag = np.array([0, 0, 12, -12, 12, -12, 0, 0])
    part = np.array([0.0, 0.14, 0.23, 0.41, 0.59, 0.77, 0.86, 1.0])
    axes.plot(left + (right - left) * part, y + zigzag, color=colour, lw=3.2, solid_joinstyle="round")


def _arrow(axes: Any, x: float, y: float, length: float, colour: str) -> None:
    style = {
        "arrowstyle": "-|>,head_width=0.35,head_length=0.6",
        "color": colour,
        "lw": 3.6,
        "shrinkA": 0,
        "shrinkB": 0,
    }
    axes.annotate("", (x + length, y), (x, y), arrowprops=style)


def mass(axes: Any, colour: str) -> None:
    """Draw a mass on the ground with a force on it."""
    _ground(axes, -80, 80, -46)
    _box(axes, -20, -42, 78, 74, colour, "m")
    _arrow(axes, -82, -5, 58, "#d9730d")
    axes.text(-66, 22, "$F$", fontsize=20, color="#222222", ha="center", va="center", math_fontfamily="dejavuserif")


def two_mass(axes: Any, colour: str) -> None:
    """Draw two masses on the ground with a spring between them."""
    _ground(axes, -84, 84, -46)
    _box(axes, -82, -42, 56, 66, colour, "m_1")
    _box(axes, 26, -42, 56, 66, colour, "m_2")
    _spring(axes, -25, 25, -8, "#d9730d")


def belt(axes: Any, colour: str) -> None:
    """Draw a mass on a belt, held by a spring to the wall."""
    axes.plot([-80, -80], [-20, 66], color=GREY, lw=3.6)
    _spring(axes, -80, -18, 16, "#d9730d")
    _box(axes, -18, -16, 62, 62, colour, "m")
    for x in (-48, 50):
        axes.add_patch(Circle((x, -44), 24, facecolor="none", edgecolor=GREY, linewidth=3.2))
    for y in (-20, -68):
        axes.plot([-48, 50], [y, y], color=GREY, lw=3.2)
    _arrow(axes, -22, -44, 46, colour)


SCHEMATICS: Mapping[str, Callable[[Any, str], None]] = MappingProxyType(
    {"push": mass, "resonance": two_mass, "ride": belt}
)
"""Function for each portrait that draws the icon into axes from -100 to 100."""
