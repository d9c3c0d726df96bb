"""The plots of the report as plotly figures. page.js draws them and replaces their colours in dark mode."""

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from itertools import cycle
from operator import attrgetter
from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from friction_fmus.identification import Array
from friction_fmus.report.formatting import multiple, quantity
from friction_fmus.study.study_result import StudyCurve

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
#: Largest number of points of a curve.
POINTS = 4000


@dataclass(frozen=True, eq=False)
class Plot:
    """Plot of the page."""

    name: str  # identifier of the HTML element
    figure: go.Figure  # figure to draw
    caption: str  # caption below the plot
    table: str = ""  # sentence that says which table has the values
    curves: bool = True  # whether the plot consists of curves; the page then has buttons to zoom
    legend: bool = True  # whether the page has a legend for the curves
    views: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Ranges of the horizontal axis, by label of the button that shows them."""

    @property
    def label(self) -> str:
        """Label for screen readers."""
        return " ".join(filter(None, ("Plot.", self.caption, self.table)))

    @property
    def height(self) -> int:
        """Height [px]."""
        return int(self.figure.layout.height)

    def to_json(self) -> str:
        """Return the figure as JSON that is valid inside an HTML script element."""
        text = json.dumps(json.loads(self.figure.to_json()), sort_keys=True, separators=(",", ":"))
        return text.replace("<", "\\u003c").replace("&", "\\u0026")


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
    for curve, style, _ in _styled(models, seen):
        x, y = thinned(curve, factors)
        figure.add_scatter(x=_short(x), y=_short(y), mode="lines", **style)
    figure.update_xaxes(title=escaped(titles[0]))
    figure.update_yaxes(title=escaped(titles[1]))
    return finished(figure, height)


def sweep(curves: Mapping[str, StudyCurve], titles: tuple[str, str], factor: float = 1.0) -> go.Figure:
    """Draw the tracking error over the tuned parameter with a marker for each run."""
    figure = go.Figure()
    for curve, style, marker in _styled(curves, ()):
        x, y = list(curve.x), [factor * y for y in curve.y]
        figure.add_scatter(x=x, y=y, mode="lines+markers", marker={**marker, "size": 8}, **style)
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


def _styled(
    curves: Mapping[str, StudyCurve], seen: Iterable[str]
) -> Iterator[tuple[StudyCurve, dict[str, Any], dict[str, str]]]:
    """Yield each curve with its name and line, and with its marker; without `seen`, the first ones are visible."""
    chosen = set(seen) or set(list(curves)[:SEEN])
    for (name, curve), (colour, dash, symbol) in zip(curves.items(), cycle(STYLES), strict=False):
        line = {"color": colour, "dash": dash, "width": 1.8}
        style = {**_named(name), "line": line, "visible": name in chosen or "legendonly"}
        yield curve, style, {"symbol": symbol, "color": colour}


def _short(values: Array) -> Any:
    """Return numbers in single precision, which halves the page and is sufficient for any screen."""
    return np.asarray(values, dtype=np.float32)


def _named(name: str) -> dict[str, str]:
    """Return the name of a trace for plotly's labels and for the legend of the page."""
    return {"name": escaped(name), "meta": name}


def escaped(text: str) -> str:
    """Return a user's text escaped for plotly, which interprets some HTML tags."""
    return escape(text, quote=False)


@dataclass(frozen=True)
class Point:
    """A compensator in the plot of error against effort and margin."""

    name: str
    kind: str
    """Compensator and its kind."""
    error: float
    effort: float
    """Worst-case error and drive force above the bandwidth, in the displayed units."""
    Ms: float | None  # peak of the sensitivity function
    best: bool = False  # whether it is recommended


DECADES = 2.5  # largest range of a logarithmic axis on which each tick has a number

COLUMNS = ((1, attrgetter("effort")), (2, attrgetter("Ms")))
"""Columns of the plot of error against effort and margin, with the coordinate of a point."""


def ladder_dots(rungs: Sequence[tuple[str, bool]], errors: Array, unit: str) -> go.Figure:
    """Draw the rms error with each compensation as a dot on a logarithmic scale, with the title above each dot."""
    low, high = float(np.log10(np.min(errors)) - 0.3), float(np.log10(np.max(errors)) + 0.3)
    right = np.log10(errors) < 0.5 * (low + high)  # where the number of a dot has room
    figure = go.Figure()
    for i, (name, _) in enumerate(rungs):
        figure.add_annotation(x=low, y=0.2 - i, text=escaped(name), showarrow=False, xanchor="left", yanchor="bottom")
    figure.add_scatter(
        x=list(errors),
        y=[-float(i) for i in range(len(rungs))],
        mode="markers+text",
        marker={"color": ["#0072B2" if best else FAINT for _, best in rungs], "size": 13},
        text=[f"  {quantity(float(error), unit)}  " for error in errors],
        textposition=[f"middle {'right' if has_room else 'left'}" for has_room in right],
        cliponaxis=False,
        hoverinfo="skip",
    )
    figure.update_yaxes(showticklabels=False, showgrid=False, zeroline=False, range=[-len(rungs) + 0.45, 0.8])
    figure.update_xaxes(title="tracking error, rms", type="log", range=[low, high], **ticks(low, high, unit))
    return finished(figure, 90 + 52 * len(rungs))


def ticks(low: float, high: float, unit: str = "1") -> dict[str, list[float] | list[str]]:
    """Return the ticks of a logarithmic axis at 1, 2 and 5, of which over many decades only the 1 has a number."""
    values = [float(f"{m}e{k}") for k in range(math.floor(low), math.ceil(high) + 1) for m in (1, 2, 5)]
    shown = [multiple(unit, value) for value in values]
    labels = [f"{factor * value:.12g} {name}".strip() for value, (name, factor) in zip(values, shown, strict=True)]
    if high - low > DECADES:
        labels = ["" if i % 3 else text for i, text in enumerate(labels)]
    return {"tickvals": values, "ticktext": labels}


def panels(
    curves: Mapping[str, StudyCurve], titles: tuple[str, str], factors: tuple[float, float], dots: bool = False
) -> go.Figure:
    """Draw one curve in each of several panels, one above the other, with the same axes."""
    count = len(curves)
    names = [escaped(name) for name in curves]
    figure = make_subplots(rows=count, shared_xaxes=True, vertical_spacing=0.24 / count, subplot_titles=names)
    for row, (name, curve) in enumerate(curves.items(), start=1):
        x, y = thinned(curve, factors)
        figure.add_scatter(
            x=_short(x),
            y=_short(y),
            **_named(name),
            mode="markers" if dots else "lines",
            line={"color": "#0072B2", "width": 1.4},
            marker={"color": "#0072B2", "size": 3, "opacity": 0.6},
            row=row,
            col=1,
        )
    figure.update_annotations(x=0.0, xanchor="left", font={"size": 13})
    finished(figure, 90 + 130 * count)
    figure.update_yaxes(nticks=6)
    for row in range(2, count + 1):
        figure.update_yaxes(matches="y", row=row)
    figure.update_xaxes(title=escaped(titles[0]), row=count)
    figure.update_yaxes(title=escaped(titles[1]), row=(count + 1) // 2)
    figure.update_layout(margin={"t": 30})
    return figure


def tradeoffs(points: Sequence[Point], error: str, effort: str, limit: float | None) -> go.Figure:
    """Draw the worst-case error over the effort and over the sensitivity peak, with the points that none dominates."""
    figure = make_subplots(cols=2, shared_yaxes=True, horizontal_spacing=0.05)
    kinds = dict.fromkeys(point.kind for point in points)
    for kind, (colour, _, marker) in zip(kinds, cycle(STYLES), strict=False):
        for column, of in COLUMNS:
            shown = [point for point in points if point.kind == kind and of(point) is not None]
            figure.add_scatter(
                x=[of(point) for point in shown],
                y=[point.error for point in shown],
                mode="markers",
                **_named(kind),
                legendgroup=kind,
                hovertext=[escaped(point.name) for point in shown],
                hoverinfo="text+x+y",
                marker={
                    "symbol": marker,
                    "color": colour,
                    "size": [15 if point.best else 9 for point in shown],
                    "line": {"color": INK, "width": [2.0 if point.best else 0.0 for point in shown]},
                },
                row=1,
                col=column,
            )
    for column, of in COLUMNS:
        front = pareto([(of(point), point.error) for point in points])
        figure.add_scatter(
            x=[x for x, _ in front], y=[y for _, y in front], mode="lines", name="not dominated", meta="not dominated",
            line={"color": FAINT, "width": 1.2, "dash": "3px,3px", "shape": "hv"}, hoverinfo="skip", row=1, col=column,
        )  # fmt: skip
    if limit is not None and np.isfinite(limit):
        figure.add_vline(x=limit, line={"color": INK, "width": 1, "dash": "dot"}, row=1, col=2)
    errors = np.log10([point.error for point in points])
    figure.update_yaxes(type="log", **ticks(float(np.min(errors)), float(np.max(errors))))
    figure.update_yaxes(title=escaped(error), col=1)
    figure.update_xaxes(title=escaped(effort), col=1)
    figure.update_xaxes(title="Ms", col=2)
    return finished(figure, 420)


def pareto(points: Sequence[tuple[float | None, float]]) -> list[tuple[float, float]]:
    """Return the points that no other point beats in both coordinates, from left to right."""
    front: list[tuple[float, float]] = []
    for x, y in sorted((x, y) for x, y in points if x is not None):
        if not front or y < front[-1][1]:
            front.append((x, y))
    return front
