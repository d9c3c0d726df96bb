"""Identification of blocks with elastic, perfectly plastic elements: start values from a grid, then a search."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from friction_fmus.errors import FitError
from friction_fmus.identification.fit.axis_terms import VALUES, term_units
from friction_fmus.identification.fit.block_fit import BlockFit, FitData
from friction_fmus.identification.fit.contact_model import ContactModel
from friction_fmus.identification.fit.grid import BLOCK_ELEMENTS, INITIAL_FORCES, coarse, fit_grid, with_count
from friction_fmus.identification.fit.least_squares import (
    Constraints,
    Coordinate,
    Setup,
    constants_of,
    coordinate,
    surroundings,
)
from friction_fmus.identification.fit.search import Loss, search

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

    unit = {name: p.unit for name, p in model.parameters.items()}
    unit |= {"M": units.inertia, "OF": units.force} | ({"Fv": units.viscous} if model.viscous else {})
    unit |= term_units(units)
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
