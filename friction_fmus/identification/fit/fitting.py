"""A friction block fitted to records."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from friction_fmus.identification.data.record import AxisUnits
from friction_fmus.identification.fit.models import ContactModel, Traits
from friction_fmus.identification.fit.problem import Problem
from friction_fmus.identification.fit.search import Loss, SearchResult, search
from friction_fmus.identification.fit.setup import Constraints, Setup, scalar_setup
from friction_fmus.identification.fit.simulation_data import PreparedSegment
from harness import Drive


@dataclass(frozen=True, eq=False)
class FitData:
    """A friction block and the records it is fitted to.

    Attributes
    ----------
    model : ContactModel
        The block.
    drive : Drive
        The block, ready to be simulated along the records.
    segments : sequence of PreparedSegment
        The records.
    traits : Traits
        Rough values of level, stiffness and so on, from which a search starts.
    constraints : Constraints
        What the user says of the parameters.
    units : AxisUnits
        Units of the axis.
    Fn0 : float or None
        Normal force to which the parameters refer; None if none was measured [N].
    """

    model: ContactModel
    drive: Drive
    segments: Sequence[PreparedSegment]
    traits: Traits
    constraints: Constraints
    units: AxisUnits
    Fn0: float | None

    def problem(self, setup: Setup) -> Problem:
        """Return the least squares problem with these unknowns."""
        return Problem(self.drive, self.segments, setup.coordinates, setup.assemble, setup.states, setup.constants)


@dataclass(frozen=True, eq=False)
class Fit:
    """The end of a search.

    Attributes
    ----------
    setup : Setup
        The unknowns.
    problem : Problem
        The least squares problem.
    found : SearchResult
        Its solution.
    """

    setup: Setup
    problem: Problem
    found: SearchResult


def fit_scalars(data: FitData, loss: Loss, starts: int | None) -> Fit:
    """Fit a block with scalar parameters: one search if the user gives all start values, otherwise three.

    Parameters
    ----------
    data : FitData
        The block and the records.
    loss : str
        Loss function, see `search`.
    starts : int or None
        Number of searches, if not this one.
    """
    setup = scalar_setup(data.model, data.segments, data.traits, data.constraints, data.units, data.Fn0)
    problem = data.problem(setup)
    known = all(c.name in data.constraints.start or c.name == "OF" for c in problem.shared)
    return Fit(setup, problem, search(problem, loss, starts or (1 if known else 3)))
