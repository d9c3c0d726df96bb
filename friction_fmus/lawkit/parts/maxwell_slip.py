"""Elements of generalised Maxwell slip, shared by the laws that compute this friction."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from casadi import SX, fabs, if_else, logic_and, logic_or

from friction_fmus.lawkit.law import Parameter, State
from friction_fmus.lawkit.quantities import FORCE, NO_UNIT, STIFFNESS

ELEMENTS = 10

FI: Any = State(FORCE, (0.0,) * ELEMENTS, "{force} of the element", nominal=0.1)
SLIPPING: Any = State(NO_UNIT, (0.0,) * ELEMENTS, "1 if the element slips", flag=True)
WAY: Any = State(NO_UNIT, 0.0, "sign of the last motion")
N: Any = Parameter(NO_UNIT, 10.0, "number of elements in use", min=1.0, max=float(ELEMENTS))
K: Any = Parameter(
    STIFFNESS, (28e3, 15e3, 10e3, 8e3, 6.5e3, 5.3e3, 4.3e3, 3.5e3, 2.8e3, 2.1e3), "stiffness of the element", min=0.0
)
ALPHA: Any = Parameter(NO_UNIT, (0.1,) * ELEMENTS, "weight of the element in the Stribeck level", min=0.0)
C: Any = Parameter(FORCE + "/s", 100.0, "attraction to the Stribeck level", min=0.0)

CONDITIONS = {
    "alpha[1] + ... + alpha[N] > 0": lambda alpha, N: sum(if_else(i < N, alpha[i], 0.0) for i in range(ELEMENTS)) > 0.0
}
"""Condition on the weights, for `law`."""


@dataclass(frozen=True)
class Element:
    """An element in a sample with the displacement dx; forces are positive in the direction of dx."""

    level: SX  # force at which it slips [force]
    moved: SX  # its force after the displacement [force]
    slipped: SX
    slips: SX
    """Whether it slips during the displacement, and 1 or 0 after it; 0 for an element that is not in use."""


def in_use(N: SX) -> list[SX]:
    """Return whether each element is one of the first N."""
    every = ELEMENTS - 1 < N  # tested first, which saves a comparison per element
    return [logic_or(every, i < N) for i in range(ELEMENTS)]


def weights(alpha: SX, N: SX) -> tuple[list[SX], SX]:
    """Return the weights of the elements in use, 0 for the others, and their positive sum."""
    shares = [if_else(used, alpha[i], 0.0) for i, used in enumerate(in_use(N))]
    total = sum(shares)
    return shares, if_else(total > 0.0, total, 1.0)


def slide(
    Fi: SX, slipping: SX, way: SX, k: SX, N: SX, shares: Sequence[SX], total: SX, dx: SX, S: SX, decay: SX
) -> list[Element]:
    """Return the elements after a displacement dx at the Stribeck level S."""
    side = if_else(dx > 0.0, 1.0, -1.0)
    unit, used = S / total, in_use(N)
    found = []
    for i, share in enumerate(shares):
        level, along = share * unit, side * Fi[i]
        slipped = logic_or(logic_and(side == way, slipping[i]), along >= level)
        stuck = along + k[i] * fabs(dx)
        moved = if_else(slipped, level + (along - level) * decay, if_else(stuck > level, level, stuck))  # keeps NaN
        slips = if_else(slipped, used[i], if_else(used[i], stuck >= level, 0.0))
        found.append(Element(level, moved, slipped, slips))
    return found
