"""Jacobi with extrapolated inputs: order of convergence, and parts that it leaves alone."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from harness_parts import mass

from harness import CallablePart, Experiment, ExperimentError, FmuPart, System

BuildFmu = Callable[..., Path]


@pytest.mark.parametrize("order", [0, 1, 2])
def test_order_of_convergence(build_fmu: BuildFmu, order: int) -> None:
    """A mass with viscous friction and the drive t^3: v' = t^3 - v. An extrapolation of order n converges with n + 1.

    The motion begins so gently that the first steps, which have no earlier values, do not matter.
    """

    def error(steps: int) -> float:
        result = system.run(stop=1.0, step=1.0 / steps, master="jacobi", extrapolation=order)
        t = result["time"].values
        exact = np.polyval([1.0, -3.0, 6.0, -6.0], t) + 6.0 * np.exp(-t)
        return float(np.abs(result["mass.v"].values - exact).max())

    drive = CallablePart("drive", lambda t, u, x: t**3, [], ["F"])
    parts = [drive, FmuPart("mass", build_fmu("Mass")), FmuPart("friction", build_fmu("Viscous"))]
    wires = ["mass.v -> friction.v", "friction.F -> mass.F_friction", "drive.F -> mass.F_drive"]
    start = {"mass.m": 1.0, "friction.Fv": 1.0, "friction.delta_v": 1.0}
    with System(parts, wires, start) as system:
        coarse, fine = error(200), error(400)
    assert np.log2(coarse / fine) == pytest.approx(order + 1, abs=0.1)


def test_sampled_parts_keep_their_held_values() -> None:
    """A sampled force of 1, -1, 1, ... is no polynomial: the mass gets it as it is."""
    source = CallablePart("source", lambda t, u, x: (-1.0) ** round(t / 0.1), [], ["F"], sampled=True)
    for order in (0, 1, 2):
        system = System([source, mass()], ["source.F -> mass.F"])
        result = system.run(stop=1.0, step=0.1, master="jacobi", extrapolation=order)
        # jacobi hands the sample of the tick before over: 1 (start), 1, -1, 1, ...
        forces = np.concatenate(([1.0], (-1.0) ** np.arange(9)))
        np.testing.assert_allclose(result["mass.v"].values[1:], -0.1 * np.cumsum(forces), atol=1e-12)


def test_refused() -> None:
    with pytest.raises(ExperimentError, match="give 0, 1 or 2"):
        Experiment(stop=1.0, step=0.1, master="jacobi", extrapolation=3)
    with pytest.raises(ExperimentError, match="the master gauss-seidel does not extrapolate"):
        Experiment(stop=1.0, step=0.1, extrapolation=1)
