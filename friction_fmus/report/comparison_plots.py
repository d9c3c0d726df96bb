"""Plots that compare the compensators: the ladder, and error against effort and margin."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from friction_fmus.identification import Array
from friction_fmus.report.figures import FAINT, INK, STYLES, escaped, finished, named_rows, thinned
from friction_fmus.report.formatting import multiple, quantity
from friction_fmus.study.study_result import StudyCurve


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
    figure = named_rows([name for name, _ in rungs], low)
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
            x=np.asarray(x, dtype=np.float32),
            y=np.asarray(y, dtype=np.float32),
            name=escaped(name),
            meta=name,
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
    kinds = list(dict.fromkeys(point.kind for point in points))
    for i, kind in enumerate(kinds):
        colour, _, marker = STYLES[i % len(STYLES)]
        for column, of in COLUMNS:
            shown = [point for point in points if point.kind == kind and of(point) is not None]
            figure.add_scatter(
                x=[of(point) for point in shown],
                y=[point.error for point in shown],
                mode="markers",
                name=escaped(kind),
                meta=kind,
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
