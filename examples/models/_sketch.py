"""Drawings of mechanisms: springs, hatched surfaces, and a body on elements that slide below their springs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from _common import BLACK, BLUE, GREY

Point = tuple[float, float]
FILL = "#dde8f0"
ROWS = (6.0, 3.6, 0.7)  # heights of the elements 1, 2 and N


def spring(axis: Axes, start: Point, end: Point, turns: int = 5, width: float = 0.22) -> None:
    """Draw a spring between two points."""
    along = np.subtract(end, start)
    across = np.array([-along[1], along[0]]) / np.hypot(*along)
    at = np.concatenate([[0.0, 0.2], np.linspace(0.2, 0.8, 2 * turns + 2)[1:-1], [0.8, 1.0]])
    side = np.concatenate([[0.0, 0.0], np.resize([1.0, -1.0], 2 * turns), [0.0, 0.0]])
    points = np.array(start) + at[:, None] * along + width * side[:, None] * across
    axis.plot(*points.T, color=BLACK, lw=1.3)


def surface(axis: Axes, x: Sequence[float], y: float) -> None:
    """Draw a hatched surface between two positions."""
    axis.plot(x, [y, y], color=BLACK, lw=1.6)
    for each in np.arange(x[0] + 0.35, x[1] + 0.01, 0.4):
        axis.plot([each, each - 0.3], [y, y - 0.3], color=GREY, lw=0.9)


def arrow(axis: Axes, start: Point, end: Point, label: str, at: Point, colour: str = BLUE) -> None:
    """Draw an arrow with a label."""
    axis.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 1.7})
    axis.text(*at, label, color=colour, fontsize=11, ha="center", va="center")


def blank(axis: Axes, **limits: Any) -> None:
    """Remove the coordinates from an axis."""
    axis.set(aspect="equal", **limits)
    axis.axis("off")


def elements(axis: Axes, body: str, level: str, position: str = "", deflection: str = "") -> None:
    """Draw N massless elements in parallel, each a spring that drags a slider, with their symbols."""
    blank(axis, xlim=(-0.4, 9.4), ylim=(-0.6, 8.4))
    axis.add_patch(Rectangle((0.6, 0.2), 0.5, 6.8, facecolor=FILL, edgecolor=BLACK, lw=1.5))
    arrow(axis, (0.85, 7.5), (2.6, 7.5), f"${body}$", (3.1, 7.5))
    for name, y in zip(("1", "2", "N"), ROWS, strict=True):
        spring(axis, (1.1, y), (4.6, y))
        axis.text(2.85, y + 0.45, f"$k_{{{name}}}$", fontsize=11, ha="center")
        axis.add_patch(Rectangle((4.6, y - 0.4), 1.5, 0.8, facecolor=FILL, edgecolor=BLACK, lw=1.3))
        axis.text(5.35, y, f"${level}_{{{name}}}$", fontsize=11, ha="center", va="center")
        surface(axis, (4.6, 7.6), y - 0.4)
        if position:
            arrow(axis, (6.1, y), (7.5, y), f"${position}_{{{name}}}$", (8.0, y))
        if deflection:
            axis.annotate("", (4.6, y - 0.5), (1.1, y - 0.5), arrowprops={"arrowstyle": "<|-|>", "color": BLUE})
            axis.text(2.85, y - 0.9, f"${deflection}_{{{name}}}$", color=BLUE, fontsize=11, ha="center", va="center")
    axis.text(5.35, 0.5 * sum(ROWS[1:]), "⋮", fontsize=15, ha="center", va="center", color=BLACK)
