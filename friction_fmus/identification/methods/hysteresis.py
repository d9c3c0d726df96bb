"""Blocks with elastic, perfectly plastic elements: a start from the grid, and the unknowns of the refinement."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from friction_fmus.identification.data.record import AxisUnits
from friction_fmus.identification.errors import FitError
from friction_fmus.identification.fit.fitting import Fit, FitData
from friction_fmus.identification.fit.grid import BEGINNINGS, BLOCK_ELEMENTS, coarse, fit_grid, with_count
from friction_fmus.identification.fit.models import ContactModel, Traits
from friction_fmus.identification.fit.problem import Coordinate
from friction_fmus.identification.fit.search import Loss, search
from friction_fmus.identification.fit.setup import Setup, Wishes, constants_of, coordinate, surroundings
from friction_fmus.identification.fit.simulation_data import Piece

#: Points of the grid of break-away distances.
POINTS = 20

#: Static over Coulomb friction where the search of a law with both begins.
EXCESS = 1.1


#: Break-away distances of a finer grid around those found, in parts of them.
AROUND = (0.75, 0.9, 1.0, 1.1, 1.35)

#: Initial forces on a finer grid, in parts of the limit.
FINER = (-1.0, -0.66, -0.33, 0.0, 0.33, 0.66, 1.0)


#: Largest number of finer grids around the elements found, and the decrease of the cost that makes another one
#: worthwhile.
REFINEMENTS, WORTHWHILE = 3, 0.01


def fit(data: FitData, loss: Loss, starts: int | None) -> Fit:
    """Fit elements from a coarse grid of break-away distances, then from finer grids around those found.

    Parameters
    ----------
    data : FitData
        The block and the records.
    loss : str
        Loss function, see `search`.
    starts : int or None
        Number of searches from the coarse grid; None: one.

    Raises
    ------
    FitError
        N is out of range, an element is fixed, or Fc of a law whose elements add up to it.
    """
    common = data.model, data.pieces, data.traits, data.wishes, data.units, data.Fn0
    setup = hysteresis_setup(*common)
    problem = data.problem(setup)
    found = search(problem, loss, starts or 1)
    for _ in range(REFINEMENTS):
        finer = hysteresis_setup(*common, problem.values(found.x, None))
        again = data.problem(finer)
        again.simulations = problem.simulations
        better = search(again, loss, 1)
        improved = better.cost < (1.0 - WORTHWHILE) * found.cost
        if better.cost < found.cost:
            setup, problem, found = finer, again, better
        if not improved:
            break
    return Fit(setup, problem, found)


def hysteresis_setup(
    model: ContactModel,
    pieces: Sequence[Piece],
    traits: Traits,
    wishes: Wishes,
    units: AxisUnits,
    Fn0: float | None,
    found: Mapping[str, float] | None = None,
) -> Setup:
    """The unknowns of a block with elements, started from a grid fitted to the first record.

    Without `found` the grid is the coarse one; with it, a finer one around the break-away distances that it has.

    Each element has a stiffness and a break-away distance, both on a logarithm, and in each record an initial force
    between the limits at which it slips. Of a law with a Stribeck curve the elements make Fc, and Fs is a multiple of
    it.

    Raises
    ------
    FitError
        N is out of range, an element is fixed, or Fc of a law whose elements add up to it.
    """
    generalised = "alpha[1]" in model.parameters
    _check(model, wishes, generalised)
    wanted = wishes.fixed.get("N")
    distance = coarse(pieces[0], POINTS)
    beginnings: Sequence[float] = BEGINNINGS
    if found is not None:
        before = np.array([value for name, value in found.items() if name.startswith("d[")])
        distance, beginnings, wanted = np.sort(np.outer(before, AROUND).ravel()), FINER, float(len(before))
    grid = fit_grid(pieces[0], Fn0 or 1.0, distance, generalised, wishes.fixed, beginnings)
    k, W, s = with_count(grid, None if wanted is None else int(wanted))
    N = len(k)
    # an element that goes beyond this never slips
    reach = max(float(np.ptp(piece.x)) for piece in pieces)
    coordinates = []
    for i in range(N):
        coordinates.append(Coordinate(f"k[{i + 1}]", float(k[i]), float(k[i]), 0.0, log=True))
        d = float(W[i] / k[i])
        coordinates.append(Coordinate(f"d[{i + 1}]", d, d, 0.0, max(2.0 * reach, d), log=True))
    law = [name for name in model.identified(wishes.named, wishes.fixed) if name not in ("Fc", "Fs")]
    if generalised:
        coordinates += [coordinate(model, name, traits, wishes) for name in law]
        if "Fs" not in wishes.fixed:
            start = wishes.start["Fs"] / wishes.start.get("Fc", float(np.sum(W))) if "Fs" in wishes.start else EXCESS
            coordinates.append(Coordinate("Fs/Fc", 1.0, start, 0.0, log=True))
    coordinates += surroundings(pieces, traits, wishes)
    coordinates = [_moved(c, grid.linear, wishes) for c in coordinates]
    for index, piece in enumerate(pieces):
        for i in range(N):
            first = float(np.median(piece.measured[:3])) * (Fn0 or 1.0) / float(np.sum(W))
            part = float(s[i]) if index == 0 else first
            part = min(max(part, -0.99), 0.99)
            coordinates.append(Coordinate(f"Fi[{i + 1}]", 1.0, part, -1.0, 1.0, piece=index))

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
                found["Fs"] = values["Fs/Fc"] * total
        return found | {name: values[name] for name in (*law, "M", "OF") if name in values}

    def states(parameters: Mapping[str, float], values: Mapping[str, float]) -> dict[str, float]:
        force = {i: parameters.get(f"W[{i}]", 0.0) for i in range(1, N + 1)}
        if generalised:
            top = max(parameters["Fc"], parameters.get("Fs", wishes.fixed.get("Fs", 0.0)))
            force = {i: top * parameters[f"alpha[{i}]"] for i in force}
        return {f"Fi[{i}]": values[f"Fi[{i}]"] * level for i, level in force.items()}

    unit = {name: p.unit for name, p in model.parameters.items()} | {"M": units.inertia, "OF": units.force}
    unit |= {f"Fi[{i}]": units.force for i in range(1, N + 1)}
    return Setup(tuple(coordinates), assemble, states, {**constants_of(model, wishes, Fn0), "N": N}, unit)


def _moved(c: Coordinate, linear: Mapping[str, float], wishes: Wishes) -> Coordinate:
    """The same unknown, begun where the grid ended unless the user says where."""
    if c.name not in linear or c.name in wishes.start:
        return c
    return replace(c, start=min(max(linear[c.name], c.lower), c.upper))


def _check(model: ContactModel, wishes: Wishes, generalised: bool) -> None:
    N = wishes.fixed.get("N")
    if N is not None and not (int(N) == N and 1 <= N <= BLOCK_ELEMENTS):
        raise FitError(f"N = {N:g} of {model.name} is no whole number from 1 to {BLOCK_ELEMENTS}; give one.")
    given = [
        name
        for name in (*wishes.fixed, *wishes.named)
        if "[" in name or (generalised and name == "Fc" and "Fc" in wishes.fixed)
    ]
    if given:
        raise FitError(
            f"{given[0]} of {model.name} cannot be given: the elements follow from the record"
            f"{', and Fc is their sum' if generalised else ''}; leave it out."
        )
