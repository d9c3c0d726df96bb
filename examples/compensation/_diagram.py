"""Control loops that are run as they are drawn: the block diagram has the parts and the wires of the system."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import hypot, inf
from pathlib import Path
from tempfile import TemporaryDirectory

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle

from _loop import BLACK, LOOP_TOLERANCE, TS
from friction_fmus import build
from harness import CallablePart, FmuPart, Part, Result, System, Wire
from harness.system.wire import parse_wire

Point = tuple[float, float]
RADIUS = 0.2  # of the circles


@dataclass(frozen=True)
class Box:
    """A part of the loop and its place in the diagram.

    Attributes
    ----------
    label : str
        What stands in it.
    at : tuple of float
        Its middle.
    part : str or Part
        Name of its block, or the part itself.
    size : tuple of float
        Width and height; (0, 0) makes it the circle of a sum.
    negative : tuple of str
        Parts whose signals this sum subtracts.
    """

    label: str
    at: Point
    part: str | Part
    size: Point = (1.5, 0.9)
    negative: tuple[str, ...] = ()


@dataclass(frozen=True)
class Arrow:
    """The wires from one part to another one as one line.

    Attributes
    ----------
    source, target : str
        Names of the parts.
    label : str
        Name of the signal in the field.
    via : tuple of points
        Corners between them.
    tap : point or None
        Where it branches off another line, else it begins at its source.
    at : point or None
        Where the label stands, else over the middle of the first piece.
    end : point or None
        Where it ends, else where it meets its target.
    dot : bool
        Whether the tap is marked, as it is not at the edge of a box.
    """

    source: str
    target: str
    label: str = ""
    via: tuple[Point, ...] = ()
    tap: Point | None = None
    at: Point | None = None
    end: Point | None = None
    dot: bool = True


def sum_of(name: str, *signs: float) -> CallablePart:
    """A sampled sum y of the inputs u1, u2, ... with signs."""
    inputs = [f"u{i}" for i in range(1, len(signs) + 1)]
    return CallablePart(
        name, lambda t, u, x: sum(s * each for s, each in zip(signs, u, strict=True)), inputs, ["y"], sampled=True
    )


def run_loop(
    boxes: Mapping[str, Box],
    wires: Sequence[str | Wire],
    start: Mapping[str, float],
    stop: float,
    step: float = TS,
    record: Sequence[str] = ("*",),
) -> Result:
    """Run the loop of a diagram.

    Parameters
    ----------
    boxes : mapping of str to Box
        The parts by name.
    wires : sequence of str or Wire
        The connections.
    start : mapping of str to float
        Start values, ``{"mass.x0": 0.01}``.
    stop : float
        End of the run [s], rounded to steps.
    step : float
        Communication step [s].
    record : sequence of str
        What to record, ``"*"`` for all outputs.

    Returns
    -------
    xarray.Dataset
        What was recorded, over ``time``.
    """
    with TemporaryDirectory() as folder:
        parts = [
            FmuPart(name, build(box.part, Path(folder))) if isinstance(box.part, str) else box.part
            for name, box in boxes.items()
        ]
        with System(parts, wires, start) as system:
            return system.run(
                stop=round(stop / step) * step,
                step=step,
                master="newton",
                record=list(record),
                loop_tolerance=LOOP_TOLERANCE,
            )


def sheet(title: str, size: tuple[float, float], ratios: tuple[float, float]) -> tuple[Figure, Axes, Axes, Axes]:
    """A figure with a diagram above two axes."""
    figure = Figure(figsize=size, dpi=110, layout="constrained")
    figure.suptitle(title, fontsize=12, fontweight="bold")
    axes = figure.subplot_mosaic("aa;bc", height_ratios=ratios)
    for each in (axes["b"], axes["c"]):
        each.grid(True, color="#dddddd", lw=0.6)
        each.set_axisbelow(True)
        each.tick_params(labelsize=9)
        for side in ("top", "right"):
            each.spines[side].set_visible(False)
    return figure, axes["a"], axes["b"], axes["c"]


def draw(axis: Axes, boxes: Mapping[str, Box], wires: Sequence[str | Wire], arrows: Sequence[Arrow]) -> None:
    """Draw the loop; an AssertionError says that an arrow has no wire, or a wire no arrow."""
    ends = [(wire if isinstance(wire, Wire) else parse_wire(wire)).ends for wire in wires]
    wired = {(source, target) for (source, _), (target, _) in ends}
    drawn = [(arrow.source, arrow.target) for arrow in arrows]
    assert len(drawn) == len(set(drawn)) and set(drawn) == wired, f"not as wired: {sorted(set(drawn) ^ wired)}"
    axis.axis("off")
    axis.set_aspect("equal")
    for arrow in arrows:
        _line(axis, boxes[arrow.source], boxes[arrow.target], arrow)
    for box in boxes.values():
        (x, y), (w, h) = box.at, box.size
        if w:
            axis.add_patch(Rectangle((x - w / 2.0, y - h / 2.0), w, h, fc="#eef3f7", ec=BLACK, lw=1.3, zorder=3))
            axis.text(x, y, box.label, ha="center", va="center", fontsize=9, zorder=4)
        else:
            axis.add_patch(Circle(box.at, RADIUS, fc="white", ec=BLACK, lw=1.3, zorder=3))
            axis.text(x, y, "+", ha="center", va="center_baseline", fontsize=10, zorder=4)
    axis.autoscale_view()


def _line(axis: Axes, source: Box, target: Box, arrow: Arrow) -> None:
    """One arrow with its label, and a minus where it is subtracted."""
    points = [arrow.tap or source.at, *arrow.via, arrow.end or target.at]
    if not arrow.tap:
        points[0] = _edge(source, points[1])
    elif arrow.dot:
        axis.plot(*arrow.tap, "o", color=BLACK, ms=3.5, zorder=2)
    if not arrow.end:
        points[-1] = _edge(target, points[-2])
    axis.plot(*zip(*points[:-1], strict=True), color=BLACK, lw=1.2, zorder=1)
    head = {"arrowstyle": "-|>", "color": BLACK, "lw": 1.2, "shrinkA": 0.0, "shrinkB": 0.0}
    axis.annotate("", points[-1], points[-2], arrowprops=head, zorder=1)
    if arrow.source in target.negative:
        (x, y), (x_from, y_from) = points[-1], points[-2]
        length = hypot(x_from - x, y_from - y)
        along = ((x_from - x) / length, (y_from - y) / length)
        x, y = x + 0.3 * along[0] - 0.22 * along[1], y + 0.3 * along[1] - 0.22 * along[0]
        axis.text(x, y, "−", ha="center", va="center")
    if arrow.label:
        (a, b), (c, d) = points[:2]
        x, y = arrow.at or ((a + c) / 2.0, (b + d) / 2.0 + 0.1)
        axis.text(x, y, arrow.label, ha="center", va="bottom", fontsize=10, style="italic")


def _edge(box: Box, towards: Point) -> Point:
    """Where a line from the middle of a box to a point leaves it."""
    dx, dy = towards[0] - box.at[0], towards[1] - box.at[1]
    w, h = box.size
    share = RADIUS / hypot(dx, dy)
    if w:
        share = min(w / 2.0 / abs(dx) if dx else inf, h / 2.0 / abs(dy) if dy else inf)
    return box.at[0] + share * dx, box.at[1] + share * dy
