"""Linear dependence of the columns of a regression."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from friction_fmus.identification.data.record import Array

#: Ratio of the smallest to the largest singular value, of normalised columns, below which they count as dependent. The
#: limit is far above the errors of rounding (1e-15) and difference quotients (1e-9), and far below useful excitation.
RANK_TOLERANCE = 1e-6


def dependent_columns(singular: Array, right: Array, names: Sequence[str]) -> list[str]:
    """Return the names of linearly dependent columns; empty if all columns are independent.

    Notes
    -----
    With two dependences, the singular vectors are an arbitrary basis of the null space, determined by rounding. The
    test therefore uses the length of the projection of each unit vector onto the null space, which does not depend on
    the basis.
    """
    dependent = right[singular < RANK_TOLERANCE * singular[0]]
    parts = np.linalg.norm(dependent, axis=0)
    return [name for name, part in zip(names, parts, strict=True) if part > 0.1]
