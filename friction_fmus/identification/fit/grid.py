"""Hysteresis as non-negative least squares: the stiffness at each of a grid of break-away distances.

The force of an elastic, perfectly plastic element is proportional to its stiffness for a given break-away distance, so
the stiffnesses follow from linear least squares with the sign of a spring (the distribution of W. Iwan, Journal of
Applied Mechanics 33(4), 1966; the algorithm is that of C. Lawson, R. Hanson, "Solving least squares problems", 1974).
The initial force of an element is unknown, too: it stands three times in the regression, begun at its lower limit, at
zero and at its upper limit, and what the three get together is an element begun in between.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
import scipy.optimize
from threadpoolctl import threadpool_limits

from friction_fmus.fmi.package import fmu
from friction_fmus.identification.data.record import Array, Record
from friction_fmus.identification.errors import ExcitationError
from friction_fmus.identification.fit.drives import driven
from friction_fmus.identification.fit.models import contact_model
from friction_fmus.identification.fit.simulation_data import Piece, prepare, signal_of

#: Elements of the block `MaxwellSlip`.
BLOCK_ELEMENTS = 10

#: Initial forces of an element, in parts of its limit.
BEGINNINGS = (-1.0, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class HysteresisGrid:
    """Elements at given break-away distances.

    Attributes
    ----------
    distance : array, shape (p,)
        Break-away distances, increasing [position].
    stiffness : array, shape (p,)
        Stiffness of the element at each, 0 where there is none [force / position].
    beginning : array, shape (p,)
        Initial force in parts of the force at which the element slips, -1 to 1.
    linear : mapping of str to float
        What was fitted beside them: "sigma2" [force / velocity], and M and OF of a drive.
    t, measured, predicted : array, shape (n,)
        Time [s], and the signal.
    relative_percent : float
        Root mean square of predicted minus measured in percent of that of the measured signal.
    """

    distance: Array
    stiffness: Array
    beginning: Array
    linear: Mapping[str, float]
    t: Array
    measured: Array
    predicted: Array
    relative_percent: float


def identify_hysteresis(record: Record, points: int = 20, viscous: bool = False) -> HysteresisGrid:
    """Identify the distribution of stiffness over break-away distance.

    Parameters
    ----------
    record : Record
        Motion and friction, or force of a drive.
    points : int
        Points of the grid, in equal ratios from 1/200 to 2/3 of the distance between the outermost positions.
    viscous : bool
        Whether a viscous force is fitted beside the elements.

    Returns
    -------
    HysteresisGrid

    Raises
    ------
    RecordError
        A column is missing.
    ExcitationError
        Nothing moves.
    """
    model = contact_model("MaxwellSlip", record.units)
    signal, _ = signal_of([record])
    piece = prepare(record, model, signal)
    scale = 1.0 if piece.per is None else float(np.mean(piece.per))
    return fit_grid(piece, scale, coarse(piece, points), viscous)


def coarse(piece: Piece, points: int) -> Array:
    """Break-away distances in equal ratios, as far as the motion of a record tells them apart."""
    reach = float(np.ptp(piece.x))
    if reach <= 0.0:
        raise ExcitationError(f"Nothing moves in the record {piece.record.name!r}; record reversals of the motion.")
    return np.geomspace(reach / 200.0, reach / 1.5, points)


def fit_grid(
    piece: Piece,
    scale: float,
    distance: Array,
    viscous: bool,
    given: Mapping[str, float] | None = None,
    beginnings: Sequence[float] = BEGINNINGS,
) -> HysteresisGrid:
    """The same for a prepared record.

    Parameters
    ----------
    piece : Piece
        The record.
    scale : float
        Force that corresponds to 1 of the signal.
    distance : array, shape (p,)
        Break-away distances, increasing.
    viscous : bool
        As of `identify_hysteresis`.
    given : mapping of str to float, optional
        Mass M and offset OF where they are known.
    beginnings : sequence of float
        Initial forces of an element, in parts of its limit.
    """
    given, points = given or {}, len(distance)
    responses = element_responses(piece, np.tile(distance, len(beginnings)), np.repeat(beginnings, points))
    columns = [piece.rows(responses)]
    names = []
    v = piece.inputs["v"]
    if viscous:
        names.append("sigma2")
        columns.append(piece.rows(v[:, None]))
    if piece.a is not None and "M" not in given:
        names.append("M")
        columns.append(piece.rows(piece.a[:, None]))
    if (piece.a is not None or piece.reciprocating) and "OF" not in given:
        names += ["OF", "-OF"]  # it may have either sign
        columns.append(np.column_stack([np.ones_like(piece.measured), -np.ones_like(piece.measured)]))
    known = piece.predicted(np.zeros_like(v), given.get("M", 0.0), given.get("OF", 0.0))
    A, b = np.column_stack(columns), (piece.measured - known) * scale
    length = np.linalg.norm(A, axis=0)
    length[length == 0.0] = 1.0
    # least squares keep their solution under a rotation: p rows instead of n; threads would cost more than they save
    with threadpool_limits(1):
        Q, R = scipy.linalg.qr(A / length, mode="economic", check_finite=False)
        solution = scipy.optimize.nnls(R, Q.T @ b)[0] / length
    shares = solution[: len(beginnings) * points].reshape(len(beginnings), points)
    stiffness = np.sum(shares, axis=0)
    beginning = np.array(beginnings) @ shares / np.where(stiffness > 0.0, stiffness, 1.0)
    rest = dict(zip(names, solution[shares.size :], strict=True))
    if "-OF" in rest:
        rest["OF"] -= rest.pop("-OF")
    predicted = A @ solution / scale + known
    error, size = predicted - piece.measured, piece.measured
    return HysteresisGrid(
        distance=distance,
        stiffness=stiffness,
        beginning=beginning,
        linear={name: float(value) for name, value in rest.items()},
        t=piece.t,
        measured=piece.measured,
        predicted=predicted,
        relative_percent=100.0 * float(np.linalg.norm(error) / np.linalg.norm(size)),
    )


def element_responses(piece: Piece, distance: Array, beginning: Array) -> Array:
    """Deflections of elements along a record, from the block `MaxwellSlip` with stiffness 1; shape (n, elements)."""
    outputs = [f"Fi[{i}]" for i in range(1, BLOCK_ELEMENTS + 1)]
    columns = []
    with driven(fmu("MaxwellSlip")) as drive:
        for first in range(0, len(distance), BLOCK_ELEMENTS):
            d, s = distance[first : first + BLOCK_ELEMENTS], beginning[first : first + BLOCK_ELEMENTS]
            start: dict[str, float | int | bool | str] = {"N": len(d)}
            for i, (limit, part) in enumerate(zip(d, s, strict=True), start=1):
                start |= {f"k[{i}]": 1.0, f"W[{i}]": float(limit), f"Fi[{i}]": float(part * limit)}
            columns.append(replace(piece, inputs={"v": piece.inputs["v"]}).run(drive, outputs[: len(d)], start))
    return np.column_stack(columns)


def with_count(grid: HysteresisGrid, count: int | None, most: int = BLOCK_ELEMENTS) -> tuple[Array, Array, Array]:
    """So many elements with nearly the same virgin curve: stiffness, force at which they slip, and beginning.

    Parameters
    ----------
    grid : HysteresisGrid
        Up to as many elements as it has points.
    count : int or None
        How many; None: as few as change the curve by at most 0.5 % of its end.
    most : int
        Largest number.

    Notes
    -----
    Again and again the two neighbours are joined (stiffness and force add up) that change the curve the least; or, if
    there are too few, the strongest element is halved into two whose break-away distances differ by a factor of 2.
    """
    kept = grid.stiffness * grid.distance > 1e-6 * float(np.sum(grid.stiffness * grid.distance))
    if not np.any(kept):
        raise ExcitationError("No element follows the measured force; record reversals with the sliding between them.")
    k, d, s = grid.stiffness[kept], grid.distance[kept], grid.beginning[kept]
    W = k * d
    x = np.geomspace(0.5 * grid.distance[0], 2.0 * grid.distance[-1], 200)

    def curve(k: Array, W: Array) -> Array:
        forces: Array = np.minimum(np.outer(x, k), W)
        return np.asarray(np.sum(forces, axis=1), dtype=np.float64)

    while len(k) > (count or 1):
        options = []
        for i in range(len(k) - 1):
            joined = _join(k, i, k[i] + k[i + 1]), _join(W, i, W[i] + W[i + 1])
            options.append((float(np.max(np.abs(curve(*joined) - curve(k, W)))), i))
        least = min(options)[0] + 1e-9 * float(np.sum(W))  # of equal changes the first one, whatever the last bits are
        change, i = next(option for option in options if option[0] <= least)
        if count is None and len(k) <= most and change > 0.005 * float(np.sum(W)):
            break
        s = _join(s, i, (s[i] * W[i] + s[i + 1] * W[i + 1]) / (W[i] + W[i + 1]))
        k, W = _join(k, i, k[i] + k[i + 1]), _join(W, i, W[i] + W[i + 1])
    while len(k) < (count or 1):
        i = int(np.argmax(W))
        k, W, s = np.insert(k, i, 2.0 / 3.0 * k[i]), np.insert(W, i, 0.5 * W[i]), np.insert(s, i, s[i])
        k[i + 1], W[i + 1] = 0.5 * k[i], W[i]
    return k, W, s


def _join(values: Array, i: int, value: float) -> Array:
    return np.concatenate([values[:i], [value], values[i + 2 :]])
