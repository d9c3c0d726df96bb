"""Which parameters a linear regression cannot separate."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from friction_fmus.identification.data.record import Array

#: Smallest singular value of columns of length 1 over the largest one from which on they count as independent. It lies
#: far above rounding errors (1e-15) and those of difference quotients (1e-9), and far below a usable excitation.
RANK_TOLERANCE = 1e-6


def not_separated(singular: Array, right: Array, names: Sequence[str]) -> list[str]:
    """Return the names that take part in a linear dependence of columns; empty if there is none.

    Parameters
    ----------
    singular, right : array, shapes (p,) and (p, p)
        Singular values, the largest first, and right singular vectors of the columns scaled to length 1.
    names : sequence of str
        Of the columns.

    Notes
    -----
    Of two dependences the singular vectors are any two combinations, by the last bits of the columns. What counts is
    the length of the part of each unit vector in the space that they span, which does not depend on the choice.
    """
    dependent = right[singular < RANK_TOLERANCE * singular[0]]
    parts = np.linalg.norm(dependent, axis=0)
    return [name for name, part in zip(names, parts, strict=True) if part > 0.1]
