"""Master algorithms, one file each: ``some_name.py`` defines ``master``, a `Master` that is called ``some-name``."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, cast

from harness.errors import UnknownNameError, nearest

if TYPE_CHECKING:
    from harness.system.experiment import Experiment
    from harness.system.plan import Plan, Schedule


@dataclass(frozen=True)
class Master:
    """A master algorithm: what it does at every tick, and what others need to know of it."""

    schedule: Callable[[Plan, Experiment], Schedule]  # returns the schedule of a plan, which the engine executes
    order: float = 1.0  # order with which the errors of a run decrease with the communication step, at best
    implicit: bool = False  # whether it solves loops, so that inputs get lines with values from the end of the step
    adapts: bool = False  # whether it chooses inner steps by `Experiment.coupling_tolerance`
    composed: bool = False  # whether a composite FMU can contain it
    together: bool = False  # whether all parts are stepped with outputs from the beginning of the step
    extrapolates: bool = False  # whether it can extrapolate inputs from earlier outputs


def master_names() -> tuple[str, ...]:
    """Return the names of all master algorithms without importing them."""
    return tuple(module.name.replace("_", "-") for module in pkgutil.iter_modules(__path__))


@cache
def masters() -> Mapping[str, Master]:
    """Return all master algorithms by name.

    Returns
    -------
    mapping of str to Master
        The ``master`` of each file in this folder.
    """
    return {name: find_master(name) for name in master_names()}


def find_master(name: str) -> Master:
    """Return the master algorithm with this name; an UnknownNameError if there is none."""
    known = master_names()
    if name not in known:
        raise UnknownNameError(f"there is no master '{name}': {nearest(name, known)}")
    return cast("Master", importlib.import_module(f"{__name__}.{name.replace('-', '_')}").master)


def best_first(trait: Callable[[Master], bool]) -> tuple[str, ...]:
    """Return the names of the masters with a trait, those of the highest order first."""
    return tuple(sorted((name for name, each in masters().items() if trait(each)), key=lambda n: -masters()[n].order))
