"""The block diagram of a system, for the documentation of a composite FMU."""

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch
from matplotlib.path import Path

from friction_fmus.fmi.drawing import plain_style, svg_of
from harness.plot import label_of
from harness.system.assembly import Assembly

# Places of the parts of a system in a block diagram: in columns along the signals, with feedback drawn backwards.
#
# The steps are those of Sugiyama, Tagawa, Toda: IEEE Transactions on Systems, Man, and Cybernetics 11(2), 1981.

Pair: TypeAlias = tuple[str, str]
Point: TypeAlias = tuple[float, float]

SWEEPS = 8


@dataclass(frozen=True)
class Layout:
    """A block diagram on a grid."""

    places: Mapping[str, Point]  # column and row of each part; row 0 is the middle
    routes: Mapping[Pair, tuple[Point, ...]]  # columns and rows on the way from source to target
    columns: int  # size of the grid: its columns
    rows: int  # its rows


def arrange(parts: Sequence[str], pairs: Iterable[Pair]) -> Layout:
    """Return the layout of a system."""
    edges = [pair for pair in dict.fromkeys(pairs) if pair[0] != pair[1]]
    back = _feedback(parts, edges)
    forward = [(b, a) if (a, b) in back else (a, b) for a, b in edges]
    depth = _depths(parts, forward)
    chains = {edge: _chain(*way, depth) for edge, way in zip(edges, forward, strict=True)}
    links = [link for chain in chains.values() for link in itertools.pairwise(chain)]
    columns: list[list[str]] = [[] for _ in range(max(depth.values(), default=0) + 1)]
    for part in parts:
        columns[depth[part]].append(part)
    for chain in chains.values():
        for node in chain[1:-1]:
            column = columns[depth[chain[0]] + chain.index(node)]
            column += [] if node in column else [node]
    _untangle(columns, links)
    rows = max(map(len, columns), default=1)
    places = {
        node: (float(x), y - (len(column) - 1) / 2.0)
        for x, column in enumerate(columns)
        for y, node in enumerate(column)
    }
    routes = {
        edge: tuple(places[node] for node in (chain if edge not in back else chain[::-1]))
        for edge, chain in chains.items()
    }
    return Layout({part: places[part] for part in parts}, routes, len(columns), rows)


def _feedback(parts: Sequence[str], edges: Sequence[Pair]) -> set[Pair]:
    """Return connections without which there is no loop: those that lead back in a search from the sources."""
    driven = {target for _, target in edges}
    found: set[Pair] = set()
    done: set[str] = set()

    def visit(part: str, above: tuple[str, ...]) -> None:
        if part in done:
            return
        for source, target in edges:
            if source == part:
                if target in (*above, part):
                    found.add((source, target))
                else:
                    visit(target, (*above, part))
        done.add(part)

    for part in sorted(parts, key=driven.__contains__):
        visit(part, ())
    return found


def _depths(parts: Sequence[str], edges: Sequence[Pair]) -> dict[str, int]:
    """Return the column of each part: the longest way to it."""
    depth = dict.fromkeys(parts, 0)
    for _ in parts:
        for source, target in edges:
            depth[target] = max(depth[target], depth[source] + 1)
    return depth


def _chain(source: str, target: str, depth: Mapping[str, int]) -> list[str]:
    """Return the nodes of a connection: its ends and a place in each column between them."""
    between = [f"{source} {target} {k}" for k in range(depth[source] + 1, depth[target])]
    return [source, *between, target]


def _untangle(columns: Sequence[list[str]], links: Sequence[Pair]) -> None:
    """Sort each column by the mean place of the neighbours, from left to right and back."""
    neighbours: dict[str, list[str]] = {}
    for a, b in links:
        neighbours.setdefault(a, []).append(b)
        neighbours.setdefault(b, []).append(a)
    for sweep in range(SWEEPS):
        order = range(len(columns)) if sweep % 2 == 0 else range(len(columns) - 1, -1, -1)
        for x in order:
            beside = columns[x - 1 if sweep % 2 == 0 else x + 1] if 0 <= x + (-1) ** (sweep + 1) < len(columns) else []
            places = {node: y - (len(beside) - 1) / 2.0 for y, node in enumerate(beside)}
            means = {}
            for y, node in enumerate(columns[x]):
                seen = [places[other] for other in neighbours.get(node, []) if other in places]
                means[node] = sum(seen) / len(seen) if seen else y - (len(columns[x]) - 1) / 2.0
            columns[x].sort(key=means.__getitem__)


COLOUR: Final = "#1f4e79"
BACK: Final = "#d9730d"  # colour of feedback
BOX: Final = (0.62, 0.42)  # size of a box, where columns are 1 apart and rows 1
LONGEST: Final = 16  # letters of a name or of signals that are shown


def diagram(system: Assembly, title: str) -> bytes:
    """Return the block diagram as SVG: parts with their models, connections with their signals."""
    layout, signals = _arranged(system)
    wide, high = 2.1, 0.95  # inches between columns and rows
    size = (wide * (layout.columns - 1 + 1.1 * BOX[0]), high * (layout.rows - 1 + 2.0 * BOX[1]))
    with plain_style(**{"svg.fonttype": "none"}):
        figure, axes = _axes(size, layout)
        lines = _lines(layout)
        for points in lines.values():
            _arrow(axes, points)
        for pair, points in lines.items():
            _label(axes, points, _short(", ".join(signals[pair])))
        for name, (x, y) in layout.places.items():
            _box(axes, (x, y))
            axes.text(x, y - 0.075, _short(name), ha="center", va="center", fontsize=10, weight="bold", color="#222222")
            axes.text(x, y + 0.1, _short(_model(system, name)), ha="center", va="center", fontsize=8.5, color="#555555")
        return svg_of(figure, title)


def _arranged(system: Assembly) -> tuple[Layout, Mapping[Pair, list[str]]]:
    signals: dict[Pair, list[str]] = {}
    for wire in system.wires:
        (source, name), (target, _) = wire.ends
        if source in system.parts and target in system.parts:
            found = signals.setdefault((source, target), [])
            found += [] if name in found else [name]
    return arrange([*system.parts], signals), signals


def _axes(size: Point, layout: Layout) -> tuple[Figure, Any]:
    figure = Figure(figsize=size)
    across, down = 0.55 * BOX[0], 0.5 * (layout.rows - 1) + BOX[1]
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), xlim=(-across, layout.columns - 1 + across), ylim=(down, -down))
    axes.set_axis_off()
    return figure, axes


def _lines(layout: Layout) -> dict[Pair, list[Point]]:
    """Return the points of each connection; those at one side of a box are spread over it."""
    ends: dict[tuple[str, float], list[tuple[float, int, Pair]]] = {}
    for pair, route in layout.routes.items():
        way = 1.0 if route[-1][0] > route[0][0] else -1.0
        ends.setdefault((pair[0], way), []).append((route[1][1], 0, pair))
        ends.setdefault((pair[1], -way), []).append((route[-2][1], 1, pair))
    places: dict[tuple[int, Pair], Point] = {}
    for (part, side), found in ends.items():
        x, y = layout.places[part]
        for number, (_, end, pair) in enumerate(
            sorted(found, key=lambda each: (each[0], layout.places[each[2][1]][0] < layout.places[each[2][0]][0]))
        ):
            spread = (number + 1) / (len(found) + 1) - 0.5
            places[end, pair] = (x + side * 0.5 * BOX[0], y + 1.1 * spread * BOX[1])
    return {pair: [places[0, pair], *route[1:-1], places[1, pair]] for pair, route in layout.routes.items()}


def _label(axes: Any, points: Sequence[Point], text: str) -> None:
    """Write the signals beside the first part of a line: above it, or below feedback."""
    back = points[-1][0] < points[0][0]
    x, y = (0.5 * (a + b) for a, b in zip(points[0], points[1], strict=True))
    axes.text(
        x,
        y + (0.04 if back else -0.04),
        text,
        ha="center",
        va="top" if back else "bottom",
        fontsize=8.5,
        color=BACK if back else "#333333",
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6},
    )


def _arrow(axes: Any, points: Sequence[Point]) -> None:
    """Draw a smooth line through the points, which leaves and arrives horizontally."""
    codes, vertices = [Path.MOVETO], [points[0]]
    for (x, y), (end, height) in itertools.pairwise(points):
        middle = 0.5 * (x + end)
        vertices += [(middle, y), (middle, height), (end, height)]
        codes += [Path.CURVE4] * 3
    colour = BACK if points[-1][0] < points[0][0] else COLOUR
    style = "-|>,head_length=0.44,head_width=0.176"
    shape: dict[str, Any] = {"arrowstyle": style, "mutation_scale": 10.0, "shrinkA": 0.0, "shrinkB": 0.0}
    axes.add_artist(FancyArrowPatch(path=Path(vertices, codes), color=colour, linewidth=1.3, clip_on=False, **shape))


def _box(axes: Any, place: Point) -> None:
    corner = (place[0] - 0.5 * BOX[0], place[1] - 0.5 * BOX[1])
    axes.add_artist(
        FancyBboxPatch(
            corner, *BOX, "round,pad=0,rounding_size=0.05", facecolor="#eef3f8", edgecolor=COLOUR, linewidth=1.2
        )
    )


def _model(system: Assembly, name: str) -> str:
    part: Any = system.parts[name]
    return str(part.archive.description.modelName) if hasattr(part, "archive") else "recorded series"


def _short(text: str) -> str:
    return label_of(text if len(text) <= LONGEST else f"{text[: LONGEST - 1]}…")
