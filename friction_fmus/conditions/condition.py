"""The result of a condition, comparisons with a tolerance for rounding errors, and linear loops."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from friction_fmus.blocks.axis_units import SLIDING, Words

Matrix: TypeAlias = NDArray[np.float64]

FASTEST: Final = 1e-6  # shortest sample time that is recommended [s]; drives sample every 10 us at best

MARGIN: Final = 1e-12
"""Relative change of its matrix elements under which a loop must stay stable to count as stable.

This is about a thousand times the rounding error of a matrix exponential and a few products. At 1 kHz, a loop whose
slowest pole has a time constant of a hundred years fails the test.
"""


def held(A: Matrix, b: Matrix, time: float) -> tuple[Matrix, Matrix]:
    """Return P and q of state(time) = P state(0) + q u for state' = A state + b u and a held force u."""
    n = len(b)
    exponent = np.zeros((n + 1, n + 1))
    exponent[:n, :n], exponent[:n, n] = A, b
    # scipy.signal.cont2discrete does the same, but takes 0.5 s to import
    found = np.asarray(expm(time * exponent), dtype=np.float64)
    return found[:n, :n], found[:n, n]


def held_mass(m: float, damping: float, Ts: float) -> tuple[Matrix, Matrix]:
    """Return A and b of a mass with a damper: (x, v) after Ts is A (x, v) + b u for a held force u."""
    return held(np.array([[0.0, 1.0], [0.0, -damping / m]]), np.array([0.0, 1.0 / m]), Ts)


def spectral_radius(matrix: Matrix) -> float:
    """Return the largest magnitude of the eigenvalues; infinity if the matrix has overflowed."""
    if not np.isfinite(matrix).all():
        return math.inf
    return float(np.abs(np.linalg.eigvals(matrix)).max())


def is_stable(matrix: Matrix) -> bool:
    """Return whether all eigenvalues of the matrix, and of every matrix within `MARGIN`, are within the unit circle."""
    # The computed eigenvalues alone are not sufficient. A multiple eigenvalue, such as the double one of a free mass at
    # 1, has an error of the order of a root of the machine precision and may be computed on either side of the circle.
    # No matrix A + E with |E| <= e |A| has the eigenvalue z if e times the spectral radius of |(z - A)^-1| |A| is below
    # 1 (Rump, SIAM Review 41(1), 1999); this test does not depend on the units of the states. It is evaluated at the
    # points of the circle in the directions of the eigenvalues near it.
    if spectral_radius(matrix) >= 1.0:
        return False
    eigenvalues = np.linalg.eigvals(matrix)
    sizes = np.abs(eigenvalues)
    near = eigenvalues[sizes > 0.9]
    try:
        inverses = np.linalg.inv((near / np.abs(near))[:, None, None] * np.eye(len(matrix)) - matrix)
    except np.linalg.LinAlgError:  # an eigenvalue is on the circle
        return False
    return all(MARGIN * spectral_radius(inverse @ np.abs(matrix)) < 1.0 for inverse in np.abs(inverses))


def longest_sample(stable: Callable[[float], bool], Ts: float) -> float:
    """Return the sample time below Ts at which the loop becomes stable; 0 if it is unstable down to `FASTEST`."""
    slow, fast = Ts, Ts
    for _ in range(6):
        slow, fast = fast, max(fast / 2.0, FASTEST)
        if fast >= slow:
            return 0.0
        if stable(fast):
            break
    else:
        return 0.0
    while slow > fast * (1.0 + 1e-3):
        middle = math.sqrt(fast * slow)
        fast, slow = (middle, slow) if stable(middle) else (fast, middle)
    return fast


ROUNDING: Final = 1e-9
"""Relative difference above which two numbers count as different.

Sums and products of parameters have relative rounding errors of about 1e-16. Without a tolerance, the answer for a loop
exactly on the boundary of a condition would depend on the order of the operations.
"""


@dataclass(frozen=True)
class Condition:
    """Result of evaluating one condition.

    Attributes
    ----------
    name : str
        Name of the condition.
    ok : bool
        Whether the condition holds.
    value, bound : float
        The two numbers compared, in SI units; `wrong` says in which direction.
    wrong : str
        What is wrong, with the numbers. A condition that holds has this text, too.
    why : str
        Consequence of a violation.
    change : str
        What to change.
    source : str
        Publication or derivation of the condition.
    """

    name: str
    ok: bool
    value: float
    bound: float
    wrong: str
    why: str
    change: str
    source: str

    def __post_init__(self) -> None:
        """Keep the texts with their placeholders, such as ``{force}`` and ``{N_m}``, and fill in a linear axis."""
        vars(self)["_texts"] = {name: getattr(self, name) for name in ("wrong", "why", "change", "source")}
        vars(self).update(vars(self.in_words(SLIDING)))

    def in_words(self, u: Words) -> Condition:
        """Return the condition with texts for another axis.

        Parameters
        ----------
        u : Words
            Nouns and units of the axis.

        Returns
        -------
        Condition
            The same numbers.
        """
        found = copy(self)
        vars(found).update({name: u.fill(text) for name, text in vars(self)["_texts"].items()})
        return found


def above(value: float, bound: float, scale: float = 0.0) -> bool:
    """Return whether a value is above a bound by more than rounding errors."""
    if math.isinf(value) or math.isinf(bound):
        return value > bound
    return value - bound > ROUNDING * max(abs(value), abs(bound), scale)


def below(value: float, bound: float) -> bool:
    """Return whether a value is below a bound by more than rounding errors; see `above`."""
    return above(bound, value)


def at_least(value: float, bound: float) -> bool:
    """Return whether a value is above a bound, or equal to it within rounding errors."""
    return not (math.isnan(value) or math.isnan(bound) or below(value, bound))


def at_most(value: float, bound: float) -> bool:
    """Return whether a value is below a bound, or equal to it within rounding errors."""
    return not (math.isnan(value) or math.isnan(bound) or above(value, bound))


def compared(holds: Callable[[float, float], bool], value: float, bound: float) -> tuple[bool, float, float]:
    """Return the fields ok, value and bound of a condition that compares two numbers."""
    return holds(value, bound), value, bound


def remainder(value: float, taken: float) -> float:
    """Return ``value - taken``, or exactly 0 if the two are equal within rounding errors."""
    return value - taken if above(value, taken) or below(value, taken) else 0.0


def first_largest(values: Sequence[float]) -> int:
    """Return the index of the first value that equals the largest one within rounding errors."""
    largest = max(values)
    return next((i for i, value in enumerate(values) if at_least(value, largest)), 0)
