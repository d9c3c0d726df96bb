"""Roles of blocks in a loop, read from their files: expressions become functions, names of rules become rules."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Final, TypeVar

from friction_fmus.blocks.arithmetic import evaluate, is_known
from friction_fmus.blocks.catalogue import catalogue
from friction_fmus.blocks.loop import InLoop, Loop
from friction_fmus.conditions import SampledLaw
from friction_fmus.doctor import compensators
from friction_fmus.doctor.axis import Gains, Law, Rule, Values
from friction_fmus.doctor.linear import linearised, local_function
from friction_fmus.errors import FrictionError, nearest

Named = TypeVar("Named")

RULES: Final[Mapping[str, Rule]] = {
    rule.__name__: rule
    for rule in (
        compensators.covers_friction,
        compensators.dithers,
        compensators.feeds_stiffness_back,
        compensators.follows_friction,
        compensators.injection_of_error,
        compensators.looks_ahead,
        compensators.pushes,
        compensators.periods_contract,
        compensators.trials_contract,
    )
}
"""Rules that the file of a law or controller can name."""

FILTERS: Final[Mapping[str, Callable[[Values, float], SampledLaw]]] = {"local_function": local_function}
"""Filters that the file of a controller in C can name."""


def known_blocks() -> dict[str, InLoop]:
    """Return the role in a loop of each block of the catalogue that states one, by name."""
    return {name: block.about.in_loop for name, block in catalogue().items() if block.about.in_loop.known}


def law_of(name: str) -> Law | None:
    """Return the properties of a law or controller that the conditions need; None for other blocks."""
    found = known_blocks().get(name, InLoop()).law
    return None if found is None else _law(name, found)


def _law(name: str, loop: Loop) -> Law:
    rules = [_named(rule, RULES, f"the rule of {name}") for rule in loop.rules]
    if loop.adapts:
        rules.insert(0, partial(compensators.adapts, loop.adapts))
    return Law(
        gains=partial(_gains, loop.gains) if loop.gains else None,
        levels=loop.friction.levels if loop.friction is not None else None,
        inertia=_function(loop.inertia),
        linear=_linear(name, loop),
        amplifies=_function(loop.amplifies),
        rules=tuple(rules),
        measured=loop.measured,
        at_rest=loop.at_rest,
        estimates=loop.estimates,
        hunts=loop.hunts,
        shapes=loop.shapes,
    )


def _function(text: str) -> Callable[[Values], float] | None:
    return (lambda values: float(evaluate(text, values))) if text else None


def _gains(gains: Mapping[str, str], values: Values) -> Gains:
    """Return the gains; a gain other than Kp and Kd is 0 if the FMU lacks its parameters."""
    there = {key: text for key, text in gains.items() if key in ("Kp", "Kd") or is_known(text, values)}
    return Gains(**{key: float(evaluate(text, values)) for key, text in there.items()})


def _linear(name: str, loop: Loop) -> Callable[[Values, float], SampledLaw] | None:
    if loop.filter:
        return _named(loop.filter, FILTERS, f"the filter of {name}")
    if loop.linear is None:
        return None
    fixed = loop.linear
    return lambda values, Ts: linearised(name, {**values, **fixed}, Ts)


def _named(name: str, known: Mapping[str, Named], what: str) -> Named:
    if name not in known:
        raise FrictionError(f"There is no {name!r}, {what}{nearest(name, known)}")
    return known[name]
