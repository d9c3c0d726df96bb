"""The coefficients of RODAS satisfy the conditions of its order and of stiff accuracy (Hairer and Wanner II, IV.7)."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

HEADER = (Path(__file__).parents[2] / "fmu_src" / "numerics" / "rodas.h").read_text(encoding="utf-8")
STAGES = 6


def table(name: str) -> np.ndarray:
    """A table of the header; what its rows leave out is 0."""
    (text,) = re.findall(rf"rodas_{name}(?:\[STAGES\])+ = {{(.*?)}};", HEADER, re.S)
    rows = re.findall(r"{(.*?)}", text, re.S) or [text]
    numbers = [[float(number) for number in re.findall(r"[-\d.]+(?:e-?\d+)?", row)] for row in rows]
    return np.array([row + [0.0] * (STAGES - len(row)) for row in numbers]).squeeze()


GAMMA = float(re.findall(r"rodas_gamma = ([\d.]+);", HEADER)[0])
# equation 7.25: with U = Gamma k, a = alpha / Gamma, c = 1 / gamma - 1 / Gamma
GAMMAS = np.linalg.inv(np.eye(STAGES) / GAMMA - table("c"))
ALPHAS = table("a") @ GAMMAS
BETAS = ALPHAS + GAMMAS
CLOSE = {"rel": 0.0, "abs": 1e-12}


def test_the_stages_are_evaluated_at_their_times() -> None:
    assert ALPHAS.sum(axis=1) == pytest.approx(table("alpha"), **CLOSE)
    assert GAMMAS.sum(axis=1) == pytest.approx(table("d"), **CLOSE)


def test_the_solution_has_order_4_and_the_embedded_one_order_3() -> None:
    """Table 7.1; the weights are the last row of beta, and those of the embedded solution the row before it."""
    a, b = ALPHAS.sum(axis=1), BETAS.sum(axis=1)
    for weights, order in ((BETAS[5], 4), (BETAS[4], 3)):
        assert weights.sum() == pytest.approx(1.0, **CLOSE)
        assert weights @ b == pytest.approx(1 / 2, **CLOSE)
        assert weights @ a**2 == pytest.approx(1 / 3, **CLOSE)
        assert weights @ BETAS @ b == pytest.approx(1 / 6, **CLOSE)
        if order == 4:
            assert weights @ a**3 == pytest.approx(1 / 4, **CLOSE)
            assert weights * a @ ALPHAS @ b == pytest.approx(1 / 8, **CLOSE)
            assert weights @ BETAS @ a**2 == pytest.approx(1 / 12, **CLOSE)
            assert weights @ BETAS @ BETAS @ b == pytest.approx(1 / 24, **CLOSE)


def test_both_solutions_are_stiffly_accurate() -> None:
    """y(t + h) is the argument of the last stage plus U_6, which is its derivative times h gamma: R(inf) = 0."""
    for weights in (BETAS[5], BETAS[4]):
        assert 1.0 - weights @ np.linalg.solve(BETAS, np.ones(STAGES)) == pytest.approx(0.0, abs=1e-12)
