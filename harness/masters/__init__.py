"""Master algorithms, one file each: ``some_name.py`` defines ``master``, which is called ``some-name``.

A master is a function that returns the Schedule for a Plan and an Experiment; the engine executes the Schedule.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Mapping
from functools import cache
from typing import TYPE_CHECKING, TypeAlias, cast

from harness.errors import UnknownNameError, nearest

if TYPE_CHECKING:
    from harness.system.experiment import Experiment
    from harness.system.plan import Plan, Schedule

Master: TypeAlias = "Callable[[Plan, Experiment], Schedule]"


def master_names() -> tuple[str, ...]:
    """Return the names of all master algorithms without importing them."""
    return tuple(module.name.replace("_", "-") for module in pkgutil.iter_modules(__path__))


@cache
def masters() -> Mapping[str, Master]:
    """Return all master algorithms by name.

    Returns
    -------
    mapping of str to callable
        The function ``master`` of each file in this folder.
    """
    found = {}
    for name in master_names():
        module = importlib.import_module(f"{__name__}.{name.replace('-', '_')}")
        found[name] = cast("Master", module.master)
    return found


def find_master(name: str) -> Master:
    """Return the master algorithm with this name.

    Raises
    ------
    UnknownNameError
        If no master has this name.
    """
    known = masters()
    if name not in known:
        raise UnknownNameError(f"there is no master '{name}': {nearest(name, known)}")
    return known[name]
