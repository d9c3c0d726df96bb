"""Identification of hysteresis by non-negative least squares: the stiffness at each point of a grid of distances.

For a given break-away distance, the force of an elastic, perfectly plastic element is proportional to its stiffness.
The stiffnesses therefore follow from linear least squares with non-negative coefficients (distribution of W. Iwan,
Journal of Applied Mechanics 33(4), 1966; algorithm of C. Lawson, R. Hanson, "Solving least squares problems", 1974).
The initial force of an element is also unknown. Each element appears three times in the regression, with its lower
limit, zero and its upper limit as initial force; a combination of the three is an element with an initial force between
the limits.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
import scipy.optimize
from threadpoolctl import threadpool_limits

from friction_fmus.blocks.axis_units import SLIDING, Words
from friction_fmus.errors import ExcitationError
from friction_fmus.export.block_fmu import fmu
from friction_fmus.identification.data.record import Array
from friction_fmus.identification.fit.block_fit import driven
from friction_fmus.identification.fit.simulation_data import PreparedSegment

BLOCK_ELEMENTS = 10  # number of elements of the block `MaxwellSlip`
INITIAL_FORCES = (-1.0, 0.0, 1.0)  # initial forces of an element over its limit


@dataclass(frozen=True, eq=False)
class HysteresisGrid:
    """Elements identified on a grid of break-away distances."""

    distance: Array  # break-away distances in ascending order, shape (p,) [position]
    stiffness: Array  # of the element at each distance; 0 without an element [force / position]
    initial_force: Array  # initial force over the slip force of the element, -1 to 1
    linear: Mapping[str, float]  # other fitted parameters: "sigma2" [force / velocity], and M and OF of a drive
    t: Array  # time [s], shape (n,)
    measured: Array
    predicted: Array
    """Measured and predicted signal."""
    relative_percent: float  # rms of predicted minus measured, in percent of the rms of the measured signal


def coarse(segment: PreparedSegment, points: int) -> Array:
    """Return logarithmically spaced break-away distances that the motion of a record can distinguish."""
    reach = float(np.ptp(segment.x))
    if reach <= 0.0:
        raise ExcitationError(f"The record {segment.record.name!r} has no motion; record a motion with reversals.")
    return np.geomspace(reach / 200.0, reach / 1.5, points)


def fit_grid(
    segment: PreparedSegment,
    scale: float,
    distance: Array,
    viscous: bool,
    given: Mapping[str, float] | None = None,
    initial_forces: Sequence[float] = INITIAL_FORCES,
) -> HysteresisGrid:
    """Fit the stiffness of elements with given break-away distances to a prepared record."""
    given, points = given or {}, len(distance)
    responses = element_responses(segment, np.tile(distance, len(initial_forces)), np.repeat(initial_forces, points))
    columns = [segment.rows(responses)]
    names = []
    v = segment.inputs["v"]
    if viscous:
        names.append("sigma2")
        columns.append(segment.rows(v[:, None]))
    if segment.a is not None and "M" not in given:
        names.append("M")
        columns.append(segment.rows(segment.a[:, None]))
    if (segment.a is not None or segment.reciprocating) and "OF" not in given:
        names += ["OF", "-OF"]  # the offset may have either sign
        columns.append(np.column_stack([np.ones_like(segment.measured), -np.ones_like(segment.measured)]))
    known = segment.predicted(np.zeros_like(v), given.get("M", 0.0), given.get("OF", 0.0))
    A, b = np.column_stack(columns), (segment.measured - known) * scale
    length = np.linalg.norm(A, axis=0)
    length[length == 0.0] = 1.0
    # a QR decomposition reduces the problem from n to p rows; threads would cost more than they save
    with threadpool_limits(1):
        Q, R = scipy.linalg.qr(A / length, mode="economic", check_finite=False)
        solution = scipy.optimize.nnls(R, Q.T @ b)[0] / length
    shares = solution[: len(initial_forces) * points].reshape(len(initial_forces), points)
    stiffness = np.sum(shares, axis=0)
    initial_force = np.array(initial_forces) @ shares / np.where(stiffness > 0.0, stiffness, 1.0)
    rest = dict(zip(names, solution[shares.size :], strict=True))
    if "-OF" in rest:
        rest["OF"] -= rest.pop("-OF")
    predicted = A @ solution / scale + known
    error, size = predicted - segment.measured, segment.measured
    return HysteresisGrid(
        distance=distance,
        stiffness=stiffness,
        initial_force=initial_force,
        linear={name: float(value) for name, value in rest.items()},
        t=segment.t,
        measured=segment.measured,
        predicted=predicted,
        relative_percent=100.0 * float(np.linalg.norm(error) / np.linalg.norm(size)),
    )


def element_responses(segment: PreparedSegment, distance: Array, initial_force: Array) -> Array:
    """Return the deflections of elements along a record, from MaxwellSlip with stiffness 1; shape (n, elements)."""
    outputs = [f"Fi[{i}]" for i in range(1, BLOCK_ELEMENTS + 1)]
    columns = []
    with driven(fmu("MaxwellSlip")) as drive:
        for first in range(0, len(distance), BLOCK_ELEMENTS):
            d, s = distance[first : first + BLOCK_ELEMENTS], initial_force[first : first + BLOCK_ELEMENTS]
            start: dict[str, float | int | bool | str] = {"N": len(d)}
            for i, (limit, part) in enumerate(zip(d, s, strict=True), start=1):
                start |= {f"k[{i}]": 1.0, f"W[{i}]": float(limit), f"Fi[{i}]": float(part * limit)}
            columns.append(replace(segment, inputs={"v": segment.inputs["v"]}).run(drive, outputs[: len(d)], start))
    return np.column_stack(columns)


def with_count(grid: HysteresisGrid, count: int | None, u: Words = SLIDING) -> tuple[Array, Array, Array]:
    """Return a given number of elements with nearly the same virgin curve as a grid."""
    # As long as there are too many elements, the two neighbours whose combination changes the curve least are combined:
    # their stiffnesses and slip forces add up. If there are too few, the element with the largest slip force is split
    # into two whose break-away distances differ by a factor of 2.
    kept = grid.stiffness * grid.distance > 1e-6 * float(np.sum(grid.stiffness * grid.distance))
    if not np.any(kept):
        raise ExcitationError(
            f"No element reproduces the measured {u.force}; record reversals with sliding between them."
        )
    k, d, s = grid.stiffness[kept], grid.distance[kept], grid.initial_force[kept]
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
        least = min(options)[0] + 1e-9 * float(np.sum(W))  # tolerance: of equal changes, the first is used
        change, i = next(option for option in options if option[0] <= least)
        if count is None and len(k) <= BLOCK_ELEMENTS and change > 0.005 * float(np.sum(W)):
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
