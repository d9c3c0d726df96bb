"""Identification of blocks with elastic, perfectly plastic elements: start values from a grid, then a search."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
import scipy.optimize
from threadpoolctl import threadpool_limits

from friction_fmus.blocks.axis_units import SLIDING, Words
from friction_fmus.errors import ExcitationError, FitError
from friction_fmus.export.block_fmu import fmu
from friction_fmus.identification.data.record import Array
from friction_fmus.identification.fit.axis_terms import VALUES
from friction_fmus.identification.fit.block_fit import BlockFit, FitData, driven, units_of
from friction_fmus.identification.fit.contact_model import ContactModel
from friction_fmus.identification.fit.least_squares import (
    Constraints,
    Coordinate,
    Setup,
    constants_of,
    coordinate,
    surroundings,
)
from friction_fmus.identification.fit.search import Loss, search
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


POINTS = 20  # number of points of the grid of break-away distances

#: Values beside the parameters of the block: mass, offset, and coefficient of a viscous friction.
AROUND_BLOCK = ("M", "OF", "Fv")

EXCESS = 1.1  # start value of the ratio of static to Coulomb friction
AROUND = (0.75, 0.9, 1.0, 1.1, 1.35)  # break-away distances of a finer grid over the distance found before
FINER = (-1.0, -0.66, -0.33, 0.0, 0.33, 0.66, 1.0)  # initial forces on a finer grid over the limit of the element


#: Largest number of refinements of the grid of elements, and the relative improvement that justifies another one.
REFINEMENTS, WORTHWHILE = 3, 0.01

ROUGH = 1e-2  # relative change of the cost at which a search from a grid ends that a finer grid improves further


def fit(data: FitData, loss: Loss, starts: int | None) -> BlockFit:
    """Fit elements on a coarse grid of break-away distances, then on finer grids around the distances found."""
    setup = hysteresis_setup(data)
    problem = data.problem(setup)
    found = search(problem, loss, starts or 1, ROUGH)
    for _ in range(REFINEMENTS):
        finer = hysteresis_setup(data, problem.values(found.x, None))
        again = data.problem(finer)
        again.simulations = problem.simulations
        better = search(again, loss, 1, ROUGH)
        improved = better.cost < (1.0 - WORTHWHILE) * found.cost
        if better.cost < found.cost:
            setup, problem, found = finer, again, better
        if not improved:
            break
    return BlockFit(setup, problem, search(problem, loss, 1, begin=found.x))


def hysteresis_setup(data: FitData, found: Mapping[str, float] | None = None) -> Setup:
    """Return the setup of a search for a block with elements, with start values from a grid fitted to the first record.

    Without `found` the grid is coarse; otherwise it is a finer one around the break-away distances in `found`.

    Each element has a stiffness and a break-away distance, searched on a logarithmic scale, and for each record an
    initial force within its slip limits. For a law with a Stribeck curve, the slip forces of the elements add up to Fc,
    and Fs is a multiple of Fc.
    """
    model, segments, traits, constraints = data.model, data.segments, data.traits, data.constraints
    units, Fn0 = data.units, data.Fn0
    generalised = "alpha[1]" in model.parameters
    _check(model, constraints, generalised)
    wanted = constraints.fixed.get("N")
    distance = coarse(segments[0], POINTS)
    initial_forces: Sequence[float] = INITIAL_FORCES
    if found is not None:
        before = np.array([value for name, value in found.items() if name.startswith("d[")])
        distance, initial_forces, wanted = np.sort(np.outer(before, AROUND).ravel()), FINER, float(len(before))
    viscous = generalised or (model.viscous and "Fv" not in constraints.fixed)
    grid = fit_grid(segments[0], Fn0 or 1.0, distance, viscous, constraints.fixed, initial_forces)
    k, W, s = with_count(grid, None if wanted is None else int(wanted), u=units.words)
    N = len(k)
    # an element with a larger break-away distance never slips
    reach = max(float(np.ptp(segment.x)) for segment in segments)
    coordinates = []
    for i in range(N):
        coordinates.append(Coordinate(f"k[{i + 1}]", float(k[i]), float(k[i]), 0.0, log=True))
        d = float(W[i] / k[i])
        coordinates.append(Coordinate(f"d[{i + 1}]", d, d, 0.0, max(2.0 * reach, d), log=True))
    law = [name for name in model.identified(constraints.named, constraints.fixed) if name not in ("Fc", "Fs")]
    if generalised:
        coordinates += [coordinate(model, name, traits, constraints) for name in law]
        if "Fs" not in constraints.fixed:
            start = (
                constraints.start["Fs"] / constraints.start.get("Fc", float(np.sum(W)))
                if "Fs" in constraints.start
                else EXCESS
            )
            coordinates.append(Coordinate("Fs/Fc", 1.0, start, 0.0, log=True))
    coordinates += surroundings(segments, traits, constraints, model.viscous, data.terms)
    linear = {**grid.linear, **({"Fv": grid.linear["sigma2"]} if model.viscous and viscous else {})}
    coordinates = [_moved(c, linear, constraints) for c in coordinates]
    for index, segment in enumerate(segments):
        for i in range(N):
            first = float(np.median(segment.measured[:3])) * (Fn0 or 1.0) / float(np.sum(W))
            part = float(s[i]) if index == 0 else first
            part = min(max(part, -0.99), 0.99)
            coordinates.append(Coordinate(f"Fi[{i + 1}]", 1.0, part, -1.0, 1.0, segment=index))

    def assemble(values: Mapping[str, float]) -> dict[str, float]:
        stiffness = [values[f"k[{i}]"] for i in range(1, N + 1)]
        levels = [values[f"k[{i}]"] * values[f"d[{i}]"] for i in range(1, N + 1)]
        found = {f"k[{i}]": value for i, value in enumerate(stiffness, start=1)}
        if not generalised:
            found |= {f"W[{i}]": value for i, value in enumerate(levels, start=1)}
        else:
            total = sum(levels)
            found |= {f"alpha[{i}]": value / total for i, value in enumerate(levels, start=1)}
            found["Fc"] = total
            if "Fs/Fc" in values:
                found["Fs"] = max(values["Fs/Fc"] * total, model.parameters["Fs"].lower)
        return found | {name: values[name] for name in (*law, *AROUND_BLOCK, *VALUES) if name in values}

    def states(parameters: Mapping[str, float], values: Mapping[str, float]) -> dict[str, float]:
        force = {i: parameters.get(f"W[{i}]", 0.0) for i in range(1, N + 1)}
        if generalised:
            top = max(parameters["Fc"], parameters.get("Fs", constraints.fixed.get("Fs", 0.0)))
            force = {i: top * parameters[f"alpha[{i}]"] for i in force}
        return {f"Fi[{i}]": values[f"Fi[{i}]"] * level for i, level in force.items()}

    unit = units_of(model, units)
    unit |= {f"Fi[{i}]": units.force for i in range(1, N + 1)}
    return Setup(tuple(coordinates), assemble, states, {**constants_of(model, constraints, Fn0), "N": N}, unit)


def _moved(c: Coordinate, linear: Mapping[str, float], constraints: Constraints) -> Coordinate:
    """Return a coordinate that starts at the value fitted with the grid, unless the user gave a start value."""
    if c.name not in linear or c.name in constraints.start:
        return c
    return replace(c, start=min(max(linear[c.name], c.lower), c.upper))


def _check(model: ContactModel, constraints: Constraints, generalised: bool) -> None:
    N = constraints.fixed.get("N")
    if N is not None and not (int(N) == N and 1 <= N <= BLOCK_ELEMENTS):
        raise FitError(f"N = {N:g} of {model.name} is not an integer from 1 to {BLOCK_ELEMENTS}; correct it.")
    given = [
        name
        for name in (*constraints.fixed, *constraints.named)
        if "[" in name or (generalised and name == "Fc" and "Fc" in constraints.fixed)
    ]
    if given:
        raise FitError(
            f"{given[0]} of {model.name} cannot be fixed, bounded or started: the elements are identified from the "
            f"record{', and Fc is the sum of their slip forces' if generalised else ''}; remove it."
        )
