"""The figures of the report, as PNG embedded in data URIs."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from friction_fmus.identification import Array, Record

from .metrics import START_UP

#: Colours that differ in lightness as well (after M. Okabe, K. Ito, 2008).
COLOUR = {"measured": "#222222", "coulomb": "#D55E00", "stribeck": "#0072B2", "data": "#999999"}
LABEL = {"coulomb": "Coulomb + viscous", "stribeck": "Stribeck"}


@dataclass(frozen=True, eq=False)
class Trace:
    """One simulated run at the instants of the record: position [m] and drive force [N], shape (n,)."""

    q: Array
    force: Array


@dataclass(frozen=True, eq=False)
class FrictionCurve:
    """Friction over velocity.

    Attributes
    ----------
    v, friction : array, shape (rows,)
        Data: velocity [m/s] and drive force less inertia [N].
    at : array, shape (k,)
        Velocities of the curves [m/s].
    curves : mapping of str to array, shape (k,)
        Friction of each model at these velocities [N].
    """

    v: Array
    friction: Array
    at: Array
    curves: Mapping[str, Array]


def position_figure(record: Record, traces: Mapping[str, Trace]) -> Figure:
    """Measured and simulated position error of the servo, and the difference of the two.

    Parameters
    ----------
    record : Record
        The measurement.
    traces : mapping of str to Trace
        Simulated runs by model.
    """
    return _comparison(
        record,
        1e6 * (record.column("reference") - record.column("q")),
        {name: 1e6 * (record.column("reference") - trace.q) for name, trace in traces.items()},
        ("reference − position [µm]", "simulated − measured [µm]"),
        "Position error of the servo",
    )


def force_figure(record: Record, traces: Mapping[str, Trace]) -> Figure:
    """Measured and simulated drive force, and the difference of the two; arguments as of
    `position_figure`."""
    return _comparison(
        record,
        record.column("force"),
        {name: trace.force for name, trace in traces.items()},
        ("drive force [N]", "simulated − measured [N]"),
        "Drive force",
    )


def _comparison(
    record: Record,
    measured: Array,
    simulated: Mapping[str, Array],
    labels: tuple[str, str],
    title: str,
) -> Figure:
    """Draw signals over the record and around a reversal, and their difference over the record and there."""
    figure, (whole, near, left, left_near) = _figure(4, 10.4)
    whole_record, turn = slice(None), _reversal(record)
    for axes, part in ((whole, whole_record), (near, turn)):
        axes.plot(record.t[part], measured[part], color=COLOUR["measured"], lw=2.4, label="measured")
        for name, signal in simulated.items():
            axes.plot(record.t[part], signal[part], label=f"simulated, {LABEL[name]}", **_line(name))
        axes.set(ylabel=labels[0])
    for axes, part in ((left, whole_record), (left_near, turn)):
        for name, signal in simulated.items():
            axes.plot(record.t[part], (signal - measured)[part], **_line(name))
        axes.set(ylabel=labels[1])
    whole.set(title=f"{title}, whole record")
    near.set(title="The same around a reversal")
    left.set(title="Simulated less measured, whole record")
    left_near.set(title="The same around that reversal", xlabel="time [s]")
    _legend(figure, whole)
    return figure


def _line(name: str) -> dict[str, Any]:
    return {"color": COLOUR[name], "lw": 1.0, "ls": "--" if name == "coulomb" else "-"}


def friction_figure(curve: FrictionCurve) -> Figure:
    """Friction over velocity with the data behind it."""
    figure, (whole, slow) = _figure(2, 7.2)
    fastest = float(np.max(np.abs(curve.v)))
    for axes, limit in ((whole, 1.05 * fastest), (slow, 0.25 * fastest)):
        seen = np.abs(curve.v) <= limit
        axes.plot(
            1e3 * curve.v[seen],
            curve.friction[seen],
            ".",
            ms=3,
            alpha=0.45,
            color=COLOUR["data"],
            label="record: drive force less inertia",
            rasterized=True,
        )
        centre, median = _medians(curve.v[seen], curve.friction[seen], limit)
        axes.plot(
            1e3 * centre,
            median,
            "o",
            ms=5,
            mfc="white",
            color=COLOUR["measured"],
            label="median of the record",
        )
        near = np.abs(curve.at) <= limit
        for name, values in curve.curves.items():
            axes.plot(1e3 * curve.at[near], values[near], color=COLOUR[name], lw=1.8, label=LABEL[name])
        low, high = np.percentile(curve.friction[seen], [0.5, 99.5])
        margin = 0.15 * (high - low)
        axes.set(xlim=(-1e3 * limit, 1e3 * limit), ylim=(low - margin, high + margin), ylabel="friction [N]")
    whole.set_title("Friction over velocity")
    slow.set(title="The same at low speed", xlabel="velocity [mm/s]")
    _legend(figure, whole)
    return figure


def compensation_figure(record: Record, errors: Mapping[str, Mapping[str, Array]]) -> Figure:
    """Tracking error without and with friction feedforward, one panel for each servo, once started.

    Parameters
    ----------
    record : Record
        Gives the time axis.
    errors : mapping of str to mapping of str to array
        Servo -> feedforward -> reference minus position [m], shape (n,).
    """
    figure, panels = _figure(len(errors), 3.2 * len(errors) + 0.6)
    colour = {"none": COLOUR["measured"], **COLOUR}
    for axes, (servo, runs) in zip(panels, errors.items(), strict=True):
        for name, error in runs.items():
            label = "no friction feedforward" if name == "none" else f"feedforward {LABEL[name]}"
            axes.plot(record.t[START_UP:], 1e6 * error[START_UP:], color=colour[name], lw=0.9, label=label)
        axes.set(ylabel="reference − position [µm]", title=f"Servo {servo}", xlabel="time [s]")
    _legend(figure, panels[0])
    return figure


def data_uri(figure: Figure, dpi: int = 130) -> str:
    """Return a figure as a data URI of a PNG."""
    return "data:image/png;base64," + base64.b64encode(png_bytes(figure, dpi)).decode("ascii")


def png_bytes(figure: Figure, dpi: int = 130) -> bytes:
    """Return a figure as a PNG."""
    buffer = io.BytesIO()
    FigureCanvasAgg(figure)
    figure.savefig(buffer, format="png", dpi=dpi, metadata={"Software": None})
    return buffer.getvalue()


def _figure(rows: int, height: float) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=(8.0, height), layout="constrained")
    panels = list(np.atleast_1d(figure.subplots(rows, 1)))
    for axes in panels:
        axes.grid(True, color="#dddddd", lw=0.6)
        axes.set_axisbelow(True)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    return figure, panels


def _legend(figure: Figure, axes: Axes) -> None:
    """Put the legend of one panel below the whole figure, where it hides nothing."""
    handles, labels = axes.get_legend_handles_labels()
    legend = figure.legend(handles, labels, loc="outside lower center", ncols=min(3, len(labels)), frameon=False)
    for handle in legend.legend_handles:
        if handle is not None:
            handle.set_alpha(1.0)


def _reversal(record: Record, span: float = 0.8) -> slice:
    """Return the samples around a reversal of the reference near the middle of the record."""
    moving = np.diff(record.column("reference")) > 0
    turns = np.flatnonzero(moving[1:] != moving[:-1]) + 1
    centre = len(record) // 2 if not turns.size else int(turns[np.argmin(np.abs(turns - len(record) // 2))])
    half = max(1, round(0.5 * span / record.Ts))
    return slice(max(0, centre - half), centre + half)


def _medians(v: Array, friction: Array, limit: float, bins: int = 24) -> tuple[Array, Array]:
    edges = np.linspace(-limit, limit, bins + 1)
    which = np.digitize(v, edges) - 1
    filled = [b for b in range(bins) if np.count_nonzero(which == b) >= 5]
    centre = np.array([np.median(v[which == b]) for b in filled])
    return centre, np.array([np.median(friction[which == b]) for b in filled])
