"""Master algorithms, one file each: ``some_name.py`` holds ``master`` and is known as ``some-name``.

A master is a function from a Plan and an Experiment to a Schedule, which the engine runs through.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Mapping
from functools import cache
from typing import TypeAlias, cast

from harness.errors import UnknownNameError, nearest
from harness.experiment import Experiment
from harness.plan import Plan, Schedule

Master: TypeAlias = Callable[[Plan, Experiment], Schedule]


@cache
def masters() -> Mapping[str, Master]:
    """All master algorithms by name, found in this folder."""
    found = {}
    for module in pkgutil.iter_modules(__path__):
        function = importlib.import_module(f"{__name__}.{module.name}").master
        found[module.name.replace("_", "-")] = cast(Master, function)
    return found


def find_master(name: str) -> Master:
    """The master algorithm of this name.

    Raises
    ------
    UnknownNameError
        If there is none.
    """
    known = masters()
    if name not in known:
        raise UnknownNameError(f"there is no master '{name}': {nearest(name, known)}")
    return known[name]
