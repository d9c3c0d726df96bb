"""Icons and figures by matplotlib; the same curves give the same bytes."""

import io
import math
import re
import threading
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import Any

import matplotlib as mpl
import matplotlib.style
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyBboxPatch, Polygon, Rectangle

from friction_fmus.fmi.portrait.experiments import Curve, Panel

STYLE = {"svg.hashsalt": "friction-fmus", "svg.fonttype": "path", "path.simplify_threshold": 0.2}


@dataclass(frozen=True)
class Image:
    """An image in pixel and in vector format."""

    png: bytes
    svg: bytes
    """The files."""


#: Guards the settings of matplotlib, which all threads share, as several threads may build blocks.
_STYLED = threading.Lock()


@contextmanager
def plain_style(**other: str) -> Iterator[None]:
    """Use matplotlib's default style, independent of user settings."""
    with _STYLED, mpl.style.context(["default", STYLE | other]):
        yield


def svg_of(figure: Figure, title: str) -> bytes:
    """Return the figure as SVG, without a date and a DOCTYPE, with paths rounded to a hundredth of a point."""
    stream = io.BytesIO()
    warnings.filterwarnings("ignore", "Glyph", UserWarning)  # a text in SVG is shown in fonts of the reader
    figure.savefig(stream, format="svg", metadata={"Title": title, "Date": None, "Creator": None})
    text = re.sub(rb"<!DOCTYPE.*?>\n", b"", stream.getvalue(), flags=re.S)
    return re.sub(rb' d="[^"]*"', lambda path: re.sub(rb"(\.\d\d)\d+", rb"\1", path.group()), text)


def png_of(figure: Figure) -> bytes:
    """Return the figure as PNG, without a date."""
    stream = io.BytesIO()
    figure.savefig(stream, format="png", metadata={"Software": None})
    return stream.getvalue()


COLOURS: Mapping[str, str] = MappingProxyType(
    {"friction": "#1f4e79", "plant": "#3d5a3d", "compensator": "#5b3a75", "signal": "#7a4a12"}
)
"""Colour of frame and curve for each kind of block."""

SECOND, ASIDE = "#d9730d", "#9aa3ad"
"""Colours of a loop next to a curve, and of inputs of a block."""

SYMBOLS: Mapping[str, str] = MappingProxyType(
    {
        "time": "t",
        "displacement": "x",
        "F_hat": r"\hat{F}",
        "F_drive": "F",
        "x_measured": r"\hat{x}",
        "r_out": "r",
        "rd": "v",
        "v1": "v",
        "v_est": "v",
    }
)
"""Letter of each variable on the axis of an icon; one-letter names stand for themselves."""

RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

SIZE = 2.0  # side of an icon [inch]
DPI = 100
WIDTH, HEIGHT = 152.0, 116.0
"""Area of the curves in an icon of size 200."""


def icon(name: str, kind: str, panels: Sequence[Panel]) -> Image:
    """Return the icon of a block, without its name, which tools write below the icon."""
    colour = COLOURS[kind]
    with plain_style():
        figure = Figure(figsize=(SIZE, SIZE), dpi=DPI)
        figure.patch.set_alpha(0.0)
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), xlim=(-100, 100), ylim=(-100, 100))
        axes.set_axis_off()
        shape = "round,pad=0,rounding_size=14"
        frame = FancyBboxPatch((-96, -96), 192, 192, shape, facecolor="#fbfcfd", edgecolor=colour, linewidth=4.0)
        axes.add_patch(frame)
        _trace(axes, panels, colour)
        return Image(png_of(figure), svg_of(figure, name))


def _trace(axes: Any, panels: Sequence[Panel], colour: str) -> None:
    """Draw the curves in the frame, each panel with its own abscissa, and letters on the axes."""
    if not panels:
        return
    low, high = _range([column for panel in panels for column in _columns(panel)[1]])
    for panel, own in zip(panels, (colour, SECOND), strict=False):
        left, right = _range(_columns(panel)[0])
        width = HEIGHT if panel.equal else WIDTH

        def place(
            curve: Curve, middle: float = (left + right) / 2.0, scale: float = width / (right - left)
        ) -> tuple[Any, Any]:
            return scale * (curve.x - middle), HEIGHT * (curve.y - low) / (high - low) - 0.53 * HEIGHT

        if panel is panels[0]:
            zero = Curve(np.clip(np.zeros(1), left, right), np.clip(np.zeros(1), low, high))
            (x,), (y,) = place(zero)
            axes.plot([-84, 84], [y, y], color="#c3cad1", lw=2.0)
            axes.plot([x, x], [-70, 66], color="#c3cad1", lw=2.0)
        for curve in (curve for curve in panel.curves if not curve.detail):
            x_points, y_points = place(curve)
            line = {"color": ASIDE, "lw": 2.6} if curve.aside else {"color": own, "lw": 4.2}
            axes.plot(x_points, y_points, solid_joinstyle="round", solid_capstyle="round", **line)
    letters = (symbol(panels[0].y[0]), symbol(panels[0].x[0]))
    font = {"fontsize": 19, "color": "#222222", "math_fontfamily": "dejavuserif"}
    axes.text(-84, 75, letters[0], ha="left", va="center", **font)
    axes.text(84, -80, letters[1], ha="right", va="center", **font)
    if len(panels) > 1:
        axes.text(-84, -80, symbol(panels[1].x[0]), ha="left", va="center", **(font | {"color": SECOND}))


def _range(columns: Sequence[Any]) -> tuple[float, float]:
    """Return the range of values, widened if it is empty."""
    low, high = min(float(c.min()) for c in columns), max(float(c.max()) for c in columns)
    return (low, high) if high > low else (low - 1.0, high + 1.0)


def symbol(name: str) -> str:
    """Return the letter of a variable as mathematics; empty for a variable without one."""
    letter = SYMBOLS.get(name, name if len(name) == 1 else "")
    return f"${letter}$" if letter else ""


def chart(panel: Panel, title: str) -> bytes:
    """Return a panel with axes and units as SVG for the documentation."""
    with plain_style(**{"svg.fonttype": "none"}):  # keep texts as texts, for search and screen readers
        figure = Figure(figsize=(4.2, 3.0))
        named = any(curve.label for curve in panel.curves)
        axes = figure.add_axes((0.16, 0.16, 0.8, 0.71 if named else 0.79))
        x_power, y_power = (_power(_range(columns)) for columns in _columns(panel))
        for curve in panel.curves:
            colour = ASIDE if curve.aside else COLOURS["friction"]
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


@cache
def terminal_icon(shape: str) -> Image:
    """Return the icon of a terminal: ``square`` for translation, ``circle`` for rotation, ``triangle`` for signals."""
    shapes = {
        "square": Rectangle((12, 12), 76, 76, facecolor="#007f00", edgecolor="#004c00", linewidth=2.0),
        "circle": Circle((50, 50), 38, facecolor="#959595", edgecolor="#404040", linewidth=2.0),
        "triangle": Polygon([(12, 12), (88, 50), (12, 88)], facecolor="#00007f", edgecolor="#00004c", linewidth=2.0),
    }
    with plain_style():
        figure = Figure(figsize=(0.4, 0.4), dpi=DPI)
        figure.patch.set_alpha(0.0)
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), xlim=(0, 100), ylim=(0, 100))
        axes.set_axis_off()
        axes.add_patch(shapes[shape])
        return Image(png_of(figure), svg_of(figure, shape))
