"""Start values of algebraic loops, found by the compiled engine."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from harness.engine.library import RESIDUAL, library

_Values: TypeAlias = NDArray[np.float64]
_Numbers: TypeAlias = "ctypes._Pointer[ctypes.c_double]"


def fixed_point(residual: Callable[[_Values], _Values], estimate: _Values) -> _Values:
    """Return the w with the smallest residual that Newton's method finds, see ``fixed_point.h``."""
    n = len(estimate)
    engine = library()
    w, work, norm = estimate.copy(), np.zeros(engine.fixed_point_work(n)), np.zeros(1)
    errors: list[BaseException] = []

    def evaluate(_: int | None, at: _Numbers, result: _Numbers) -> bool:
        try:
            np.ctypeslib.as_array(result, (n,))[:] = residual(np.ctypeslib.as_array(at, (n,)).copy())
        except BaseException as error:  # it must not be raised in C
            errors.append(error)
            return False
        return True

    engine.find_fixed_point(RESIDUAL(evaluate), None, w.ctypes.data, n, work.ctypes.data, norm.ctypes.data)
    if errors:
        raise errors[0]
    return w
