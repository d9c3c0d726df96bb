"""Values that are held between their samples are constant during a step, not on a line."""

from __future__ import annotations

import numpy as np
import pytest

from harness import CallablePart, SeriesPart, System

TIMES = [0.0, 0.1, 0.2, 0.3]
FORCES = [1.0, -2.0, 4.0, 0.0]


def plant() -> CallablePart:
    """Integrate v' = F with the mean of F over each step, which is exact for a force that is held."""
    return CallablePart(
        "mass",
        lambda t, u, x: x,
        ["F"],
        ["v"],
        advance=lambda t, h, u, x: x + h * u[0],
        state=[0.0],
        dependencies={"v": ()},
    )


@pytest.mark.parametrize("master", ["newton", "adaptive", "gauss-seidel", "jacobi"])
@pytest.mark.parametrize("step", [0.1, 0.05, 0.02])
def test_a_held_series_drives_a_mass_by_its_impulse(master: str, step: float) -> None:
    """v is the sum of force times time, exact at every tick where samples and ticks coincide."""
    series = SeriesPart("force", TIMES, {"F": FORCES}, interpolation="previous")
    result = System([series, plant()], ["force.F -> mass.F"]).run(stop=0.3, step=step, master=master)
    t = result["time"].to_numpy()
    exact = np.interp(t, TIMES, np.cumsum([0.0, *(0.1 * np.array(FORCES[:-1]))]))
    np.testing.assert_allclose(result["mass.v"], exact, atol=1e-12)
