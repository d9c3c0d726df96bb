"""Newton's method for the initial values of loops, on equations whose solution is known."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from harness.compiling.engine_library import RESIDUAL, library

Equations = Callable[[np.ndarray], np.ndarray]
MATRIX = np.array([[0.5, 2.0, -1.0], [0.0, -3.0, 0.7], [1.5, 0.2, 4.0]])
OFFSET = np.array([1.0, -2.0, 0.3])


def solved(equations: Equations, start: np.ndarray) -> tuple[np.ndarray, int]:
    """Return the fixed point of w = equations(w) and the number of evaluations."""
    calls = 0

    def evaluate(_context: object, w: object, r: object) -> bool:
        nonlocal calls
        calls += 1
        values = np.ctypeslib.as_array(w, (start.size,))  # type: ignore[arg-type]
        np.ctypeslib.as_array(r, (start.size,))[:] = equations(values) - values  # type: ignore[arg-type]
        return True

    engine, n = library(), start.size
    w, work, norm = start.copy(), np.zeros(engine.fixed_point_work(n)), np.zeros(1)
    assert engine.find_fixed_point(RESIDUAL(evaluate), None, w.ctypes.data, n, work.ctypes.data, norm.ctypes.data)
    return w, calls


def test_linear_equations_are_solved_by_their_jacobian() -> None:
    """No fixed-point iteration finds this solution: the matrix has eigenvalues beyond 1."""
    assert max(abs(np.linalg.eigvals(MATRIX))) > 3.0
    found, calls = solved(lambda w: MATRIX @ w + OFFSET, np.zeros(3))
    assert found == pytest.approx(np.linalg.solve(np.eye(3) - MATRIX, OFFSET), abs=1e-9)
    assert calls <= 3 * (1 + 3 + 2)


def test_convergence_is_quadratic() -> None:
    """x = 2 / x and y = x y / 4 + 3: the root of 2, and 3 / (1 - sqrt(2) / 4)."""
    found, calls = solved(lambda w: np.array([2.0 / w[0], w[0] * w[1] / 4.0 + 3.0]), np.array([1.0, 1.0]))
    assert found == pytest.approx([2.0**0.5, 3.0 / (1.0 - 2.0**0.5 / 4.0)], abs=1e-9)
    assert calls <= 7 * (2 + 2)
