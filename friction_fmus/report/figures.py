"""The plots of the report as plotly figures. page.js draws them and replaces their colours in dark mode."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any

import numpy as np
import plotly.graph_objects as go

from friction_fmus.identification import Array
from friction_fmus.study.study_result import StudyCurve

from .formatting import number

#: Colours of text, background, grid and background curves; page.js has their counterparts for dark mode.
INK, PAPER, GRID, FAINT = "#222222", "#ffffff", "#dddddd", "#8a8a8a"
#: Colours suitable for any colour vision (after M. Okabe, K. Ito, 2008), each with its own dash pattern and marker for
#: prints without colour.
STYLES = (
    ("#0072B2", "solid", "circle"),
    ("#D55E00", "8px,4px", "square"),
    ("#009E73", "8px,3px,2px,3px", "diamond"),
    ("#CC79A7", "2px,3px", "triangle-up"),
    ("#E69F00", "14px,4px", "triangle-down"),
    ("#56B4E9", "14px,3px,2px,3px", "cross"),
    ("#7F5539", "5px,5px", "x"),
    ("#6A4C93", "8px,3px,2px,3px,2px,3px", "star"),
)
#: Number of curves that are initially visible; the others can be shown from the legend.
SEEN = 4
#: Largest number of rows of the bar chart, so that it is legible on a printed page.
ROWS = 24
#: Largest number of points of a curve.
POINTS = 4000


@dataclass(frozen=True, eq=False)
class Plot:
    """Plot of the page."""

    name: str  # identifier of the HTML element
    figure: go.Figure  # figure to draw
    caption: str  # caption below the plot
    label: str  # label for screen readers
    curves: bool = True  # whether the plot consists of curves; the page then has buttons to zoom
    legend: bool = True  # whether the page has a legend for the curves
    views: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Ranges of the horizontal axis, by label of the button that shows them."""

    @property
    def height(self) -> int:
        """Height [px]."""
        return int(self.figure.layout.height)

    def to_json(self) -> str:
        """Return the figure as JSON that is valid inside an HTML script element."""
        text = json.dumps(json.loads(self.figure.to_json()), sort_keys=True, separators=(",", ":"))
        return text.replace("<", "\\u003c").replace("&", "\\u0026")


@dataclass(frozen=True)
class Bar:
    """Row of the bar chart."""

    name: str  # name of the compensator
    value: float
    low: float
    high: float
    """Tracking error, and the smallest and largest one in the cases."""
    emphasis: str = ""  # "best", "second" or ""


def thinned(curve: StudyCurve, factors: tuple[float, float] = (1.0, 1.0), points: int = POINTS) -> tuple[Array, Array]:
    """Return x and y of a curve, decimated to the minimum and maximum of y in each interval."""
    x = factors[0] * np.asarray(curve.x, dtype=float)
    y = factors[1] * np.asarray(curve.y, dtype=float)
    if len(y) <= points:
        return x, y
    parts = np.array_split(np.arange(len(y)), points // 2)
    kept = np.unique([part[choice] for part in parts for choice in (np.argmin(y[part]), np.argmax(y[part]))])
    return x[kept], y[kept]


def lines(
    data: Mapping[str, StudyCurve],
    models: Mapping[str, StudyCurve],
    titles: tuple[str, str],
    factors: tuple[float, float] = (1.0, 1.0),
    cloud: bool = False,
    seen: Iterable[str] = (),
    height: int = 430,
) -> go.Figure:
    """Draw curves of models over measurements."""
    figure = go.Figure()
    for name, curve in data.items():
        x, y = thinned(curve, factors)
        wanted = "reference" in name and len(data) > 1
        points = {"color": FAINT, "size": 3.5, "opacity": 0.6}
        if len(x) <= 60:
            points = {"color": PAPER, "size": 8, "line": {"color": INK, "width": 1.6}}
        figure.add_scatter(
            x=_short(x),
            y=_short(y),
            **_named(name),
            mode="markers" if cloud else "lines",
            line={"color": INK, "dash": "3px,3px", "width": 1.2} if wanted else {"color": FAINT, "width": 2.0},
            marker=points,
        )
    chosen = set(seen) or set(list(models)[:SEEN])
    for (name, curve), (colour, dash, _) in zip(models.items(), _styles(len(models)), strict=True):
        x, y = thinned(curve, factors)
        figure.add_scatter(
            x=_short(x),
            y=_short(y),
            **_named(name),
            mode="lines",
            line={"color": colour, "dash": dash, "width": 1.8},
            visible=True if name in chosen else "legendonly",
        )
    figure.update_xaxes(title=escaped(titles[0]))
    figure.update_yaxes(title=escaped(titles[1]))
    return finished(figure, height)


def bars(rows: Sequence[Bar], title: str) -> go.Figure:
    """Draw bars of the tracking error with whiskers for the cases; names are above the bars."""
    fill = {"best": ("#0072B2", ""), "second": ("#56B4E9", "/"), "": (FAINT, "")}
    looks: dict[str, Any] = {
        "color": [fill[row.emphasis][0] for row in rows],
        "pattern": {"shape": [fill[row.emphasis][1] for row in rows], "fgcolor": INK, "solidity": 0.25},
    }
    figure = named_rows([row.name for row in rows], 0.0)
    figure.add_bar(
        y=[-float(i) for i in range(len(rows))],
        width=0.36,
        orientation="h",
        hoverinfo="text",
        x=[row.value for row in rows],
        marker=looks,
        error_x={
            "type": "data",
            "array": [row.high - row.value for row in rows],
            "arrayminus": [row.value - row.low for row in rows],
            "color": INK,
            "thickness": 1.4,
            "width": 5,
        },
        name="tracking error",
        hovertext=[
            f"{escaped(row.name)}: {number(row.value)} ({number(row.low)} to {number(row.high)})" for row in rows
        ],
    )
    figure.update_xaxes(rangemode="tozero", title=escaped(title))
    return finished(figure, 110 + 40 * len(rows))


def named_rows(names: Sequence[str], left: float) -> go.Figure:
    """Return a figure with a row at 0, -1, ... for each name, which is above its row and begins at `left`."""
    figure = go.Figure()
    for i, name in enumerate(names):
        figure.add_annotation(x=left, y=0.2 - i, text=escaped(name), showarrow=False, xanchor="left", yanchor="bottom")
    figure.update_yaxes(showticklabels=False, showgrid=False, zeroline=False, range=[-len(names) + 0.45, 0.8])
    return figure


def sweep(
    curves: Mapping[str, StudyCurve], titles: tuple[str, str], factor: float = 1.0, seen: Iterable[str] = ()
) -> go.Figure:
    """Draw the tracking error over the tuned parameter with a marker for each run; `seen` as in `lines`."""
    figure = go.Figure()
    chosen = set(seen) or set(list(curves)[:SEEN])
    for (name, curve), (colour, dash, marker) in zip(curves.items(), _styles(len(curves)), strict=True):
        figure.add_scatter(
            x=list(curve.x),
            y=[factor * y for y in curve.y],
            **_named(name),
            mode="lines+markers",
            line={"color": colour, "dash": dash, "width": 1.8},
            marker={"symbol": marker, "size": 8, "color": colour},
            visible=True if name in chosen else "legendonly",
        )
    figure.update_xaxes(title=escaped(titles[0]))
    figure.update_yaxes(title=escaped(titles[1]), rangemode="tozero")
    return finished(figure, 430)


def finished(figure: go.Figure, height: int) -> go.Figure:
    """Apply the style of the page to a figure."""
    figure.update_layout(
        template=go.layout.Template(),
        height=height,
        paper_bgcolor=PAPER,
        plot_bgcolor=PAPER,
        font={"family": "system-ui, sans-serif", "size": 13, "color": INK},
        margin={"l": 60, "r": 12, "t": 12, "b": 48},
        showlegend=False,  # the page has its own legend, which is accessible by keyboard
        hovermode="closest",
        hoverlabel={"bgcolor": PAPER, "font": {"color": INK}},
    )
    for update in (figure.update_xaxes, figure.update_yaxes):
        update(gridcolor=GRID, zerolinecolor=FAINT, zerolinewidth=1, automargin=True)
    return figure


def _styles(count: int) -> list[tuple[str, str, str]]:
    return [STYLES[i % len(STYLES)] for i in range(count)]


def _short(values: Array) -> Any:
    """Return numbers in single precision, which halves the page and is sufficient for any screen."""
    return np.asarray(values, dtype=np.float32)


def _named(name: str) -> dict[str, str]:
    """Return the name of a trace for plotly's labels and for the legend of the page."""
    return {"name": escaped(name), "meta": name}


def escaped(text: str) -> str:
    """Return a user's text escaped for plotly, which interprets some HTML tags."""
    return escape(text, quote=False)
