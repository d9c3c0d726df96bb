"""Targets, one file each: ``some_name.py`` defines ``TARGET``, a `Target` that is called ``some-name``."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Final, Literal

from friction_fmus.errors import BuildError, UnknownNameError, nearest

DEFAULT: Final = {"fmu": "fmi2", "law": "c"}
"""Target of what is written without a choice."""


@dataclass(frozen=True)
class Option:
    """An option that only some targets have."""

    name: str
    help: str
    choices: tuple[str, ...] = ()
    """Values; none for an option that is either given or not."""


@dataclass(frozen=True)
class Target:
    """A form in which something is written. Its module must load fast: `write` imports what it needs."""

    summary: str
    """What is written, for the help of the command line."""
    takes: Literal["fmu", "law"]
    """Of what: of a `SourceFmu`, which a block or a system gives, or of the name or file of a law or loop."""
    write: Callable[..., Any]
    """``write(source, path, platforms, compiling, **options)`` writes an FMU or its like to a path, completely or not
    at all; ``write(model, folder, start=..., prefix=..., **options)`` writes a law and returns the paths."""
    ending: str = ""
    """End of the name of the file or folder that is written of an FMU."""
    options: tuple[Option, ...] = ()
    platform: str = ""
    """Platform that stands for this target alone."""
    remark: Callable[[], str] = str
    """Returns what a user should know after it was written."""


@cache
def targets(takes: str = "") -> Mapping[str, Target]:
    """Return the targets by name, all or those that take something."""
    names = sorted(module.name for module in pkgutil.iter_modules(__path__))
    found = {name.replace("_", "-"): importlib.import_module(f"{__name__}.{name}").TARGET for name in names}
    return {name: target for name, target in found.items() if takes in ("", target.takes)}


def choose_target(
    takes: str, name: str, options: Mapping[str, Any], platforms: Sequence[str] = ()
) -> tuple[Target, dict[str, Any]]:
    """Return the target with a name, or the one for which a platform stands, and its options that are given."""
    known = targets(takes)
    if name not in known:
        raise UnknownNameError(f"There is no target {name!r}{nearest(name, known)}")
    own = next((each for each in known.items() if each[1].platform and each[1].platform in platforms), None)
    if own is not None:
        if len(set(platforms)) > 1:
            raise BuildError(
                f"the platform {own[1].platform} makes {own[1].summary}, not an FMU: build it without other platforms"
            )
        if name not in (own[0], DEFAULT[takes]):
            raise BuildError(f"the platform {own[1].platform} makes {own[1].summary}: build it without {name}")
        name = own[0]
    having = {other: {option.name for option in each.options} for other, each in known.items()}
    for option, value in options.items():
        others = " or ".join(other for other, has in having.items() if option in has)
        if option not in having[name] and (value is not False or not others):
            remedy = f"choose the target {others}, or leave it out" if others else "leave it out"
            raise BuildError(f"the target {name} has no option {option}: {remedy}")
    return known[name], {option: value for option, value in options.items() if option in having[name]}
