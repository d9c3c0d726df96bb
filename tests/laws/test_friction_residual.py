"""FrictionResidual: interpolation, bound and passivity, as a law, in numpy and as an FMU."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator
from shell.instance import Instance, load
from thorough import nightly, some

from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.identification import ResidualTable
from friction_fmus.lawkit.law_files import discover_laws

LAW = next(law for law in discover_laws(laws_folder()) if law.name == "FrictionResidual")
V_MAX = 0.2
SPEED = tuple(V_MAX * share for share in (0.03, 0.1, 0.3, 0.6, 1.0))
BEGIN, SPACING = -0.1, 0.05


def table(seed: int, R_max: float = 10.0, only_adds: bool = False) -> ResidualTable:
    forward, backward = np.random.default_rng(seed).normal(size=(2, 40))
    return ResidualTable(V_MAX, BEGIN, SPACING, tuple(forward.tolist()), tuple(backward.tolist()), R_max, only_adds)


def draws(n: int = 4000) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Forces, positions within and outside of the table, velocities over its range and at 0."""
    random = np.random.default_rng(9)
    v = random.choice([-1.0, 0.0, 1.0], n, p=[0.45, 0.1, 0.45]) * 10.0 ** random.uniform(-5, 0, n)
    return random.normal(size=n), random.uniform(-0.2, 0.4, n), v


def by_law(given: ResidualTable, F: np.ndarray, x: np.ndarray, v: np.ndarray, **others: float) -> np.ndarray:
    values: dict[str, Any] = vars(given) | others
    return np.array([LAW.evaluate({**values, "f": a, "x": b, "v": c})["u"] for a, b, c in zip(F, x, v, strict=True)])


@nightly
@pytest.mark.parametrize(("R_max", "only_adds"), some([(10.0, False), (0.3, False), (10.0, True)], [(0.3, False)]))
def test_the_sum_is_bounded_and_resists_the_motion(R_max: float, only_adds: bool) -> None:
    """u v >= min(f v, 0), with u v >= 0 for every force that resists; exactly, for random tables."""
    given = table(1, R_max, only_adds)
    F, x, v = draws()
    for total in (by_law(given, F, x, v), given.total(F, x, v)):
        assert (total * v >= np.minimum(F * v, 0.0)).all()
        assert (total[F * v >= 0.0] * v[F * v >= 0.0] >= 0.0).all()
        assert (np.abs(total - F) <= R_max + 1e-12).all()
        assert (total[v == 0.0] == F[v == 0.0]).all()
        if only_adds:
            assert ((total - F) * v >= -1e-12).all()


def test_it_interpolates_as_scipy() -> None:
    """With a model force far above the residual, so that passivity does not matter."""
    given = table(2)
    _, x, v = draws(800)
    F = 100.0 * np.sign(v)
    axes = ((0.0, *SPEED), BEGIN + SPACING * np.arange(8))
    expected = np.zeros(v.size)
    for way, values in ((1.0, given.forward), (-1.0, given.backward)):
        grid = np.vstack([np.zeros(8), np.reshape(values, (5, 8))])
        at = np.column_stack([np.minimum(np.abs(v), SPEED[-1]), np.clip(x, axes[1][0], axes[1][-1])])
        expected += np.where(v * way > 0.0, way * RegularGridInterpolator(axes, grid)(at), 0.0)
    assert by_law(given, F, x, v) - F == pytest.approx(expected, abs=1e-11)
    assert given.total(F, x, v) - F == pytest.approx(expected, abs=1e-11)
    assert by_law(given, F, x, v, gain=0.5) - F == pytest.approx(0.5 * expected, abs=1e-11)


def test_a_cycle_through_a_static_model_dissipates() -> None:
    """The work over a sine in position is above 0 with any table, also one that is much larger than the model."""
    phase = np.linspace(0.0, 2.0 * np.pi, 2001)
    x, v = 0.1 * np.sin(phase), 0.1 * np.cos(phase)
    for seed in range(20):
        forward, backward = 5.0 * np.random.default_rng(seed).normal(size=(2, 40))
        given = ResidualTable(V_MAX, BEGIN, SPACING, tuple(forward), tuple(backward), 10.0)
        assert np.trapezoid(given.total(np.sign(v), x, v) * v, phase) >= 0.0


def test_the_fmu_is_the_law(build_fmu: Callable[..., Path]) -> None:
    given = table(3)
    F, x, v = draws(100)
    with Instance(load(build_fmu("FrictionResidual", **given.start_values()))) as run:
        run.initialise()
        found = []
        for k in range(F.size):
            run.set({"f": F[k], "x": x[k], "v": v[k]})
            run.step(k * 1e-3, 1e-3)
            found.append(run.get1("u"))
    assert found == pytest.approx(by_law(given, F, x, v), abs=1e-13)
