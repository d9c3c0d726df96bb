"""Force of an axis over position: cogging and position-dependent friction, as a table with cubic interpolation."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from friction_fmus.blocks.axis_units import domain_of
from friction_fmus.errors import BuildError
from friction_fmus.export.block_fmu import build, fmu

Array = NDArray[np.float64]

BLOCK = "PositionMap"  # block that computes the force
LEAST_NODES = 4  # smallest number of nodes of a table
NODES_OF_TURN = 256  # number of nodes of the gravity of an arm


@dataclass(frozen=True)
class Grid:
    """Equally spaced nodes over position."""

    begin: float
    spacing: float
    """Position of the first node and distance of the nodes [m]."""
    nodes: int  # number of nodes
    periodic: bool = False  # whether the first node follows the last one

    def weights(self, x: Array) -> Array:
        """Return the weights of the nodes at positions x, shape (n, nodes): the interpolation of `PositionMap`."""
        span = self.nodes if self.periodic else self.nodes - 1
        place = (x - self.begin) / self.spacing
        place = np.mod(place, span) if self.periodic else np.clip(place, 0.0, span)
        i = np.minimum(place.astype(int), span - 1)
        w = place - i
        found = np.zeros((len(x), self.nodes))
        row = np.arange(len(x))
        for shift, weight in zip((-1, 0, 1, 2), _catmull_rom(w), strict=True):
            node = i + shift
            if self.periodic:
                np.add.at(found, (row, node % self.nodes), weight)
                continue
            # beyond an end, the table continues linearly: 2 f(end) - f(next)
            inside = np.clip(node, 0, span)
            beyond = node != inside
            np.add.at(found, (row, inside), np.where(beyond, 2.0, 1.0) * weight)
            np.add.at(found, (row, 2 * inside - node), np.where(beyond, -weight, 0.0))
        return found


@dataclass(frozen=True)
class PositionMap:
    """Cogging and position-dependent friction of an axis at equally spaced nodes."""

    grid: Grid  # nodes over position
    cogging: tuple[float, ...]  # conservative force on the axis at each node, positive forward [N]
    friction: tuple[float, ...]
    """Friction at each node in addition to that of the friction model, opposing the motion [N]."""
    v_sign: float  # velocity over which the sign of the velocity is smoothed [m/s]

    def __post_init__(self) -> None:
        if not len(self.cogging) == len(self.friction) == self.grid.nodes >= LEAST_NODES:
            raise BuildError(
                f"A position map has {len(self.cogging)} values of cogging and {len(self.friction)} of friction for "
                f"{self.grid.nodes} nodes; give one of each for at least {LEAST_NODES} nodes."
            )
        numbers = (self.grid.begin, self.grid.spacing, self.v_sign, *self.cogging, *self.friction)
        if not np.isfinite(numbers).all() or min(self.grid.spacing, self.v_sign) <= 0.0:
            raise BuildError("A position map has a value that is not finite, or a spacing or v_sign of 0; correct it.")

    def force(self, x: Array, v: Array) -> Array:
        """Return the force on the axis at positions x [m] and velocities v [m/s], shape (n,), positive forward [N]."""
        weights = self.grid.weights(x)
        along: Array = weights @ np.array(self.cogging)
        against: Array = weights @ np.array(self.friction)
        return along - against * np.tanh(v / self.v_sign)

    @property
    def start(self) -> dict[str, float]:
        """Start values of the block."""
        return {"v_sign": self.v_sign}

    def fmu(self, rotary: bool = False) -> Path:
        """Return the FMU with this table, which is built once and cached."""
        return fmu(BLOCK, domain_of(rotary), self._files)

    def to_fmu(self, folder: Path, name: str = BLOCK, rotary: bool = False) -> Path:
        """Build the FMU with this table and these start values in a folder."""
        return build(BLOCK, folder, self.start, name, self._files, domain=domain_of(rotary))

    @property
    def _files(self) -> Mapping[str, str]:
        """The header with the table."""
        rows = "".join(
            f"    {{{float(c)!r}, {float(d)!r}}},\n" for c, d in zip(self.cogging, self.friction, strict=True)
        )
        begin, spacing = float(self.grid.begin), float(self.grid.spacing)
        return {
            "map.h": "/* begin and spacing of the nodes; rows { cogging, friction }; in SI units */\n"
            f"static const double map_begin = {begin!r}, map_spacing = {spacing!r};\n"
            f"static const bool map_periodic = {'true' if self.grid.periodic else 'false'};\n"
            f"static const double map[][2] = {{\n{rows}}};\n"
        }


def gravity_map(G_sin: float, G_cos: float) -> PositionMap:
    """Return the gravity of an arm, for which its drive needs G_sin sin q + G_cos cos q, within 1e-6."""
    q = 2.0 * np.pi * np.arange(NODES_OF_TURN) / NODES_OF_TURN
    force = -(G_sin * np.sin(q) + G_cos * np.cos(q))
    grid = Grid(0.0, 2.0 * np.pi / NODES_OF_TURN, NODES_OF_TURN, periodic=True)
    return PositionMap(grid, tuple(force.tolist()), (0.0,) * NODES_OF_TURN, 1.0)


def _catmull_rom(w: Array) -> tuple[Array, Array, Array, Array]:
    """Return the weights of the four nodes around a place between the second and the third (w from 0 to 1)."""
    return (
        0.5 * w * (-1.0 + w * (2.0 - w)),
        1.0 + 0.5 * w * w * (-5.0 + 3.0 * w),
        0.5 * w * (1.0 + w * (4.0 - 3.0 * w)),
        0.5 * w * w * (w - 1.0),
    )
