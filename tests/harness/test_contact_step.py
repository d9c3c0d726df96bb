"""The longest communication steps of a mass at rest on an elastic contact, as docs/which-model.md states them."""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt
from pathlib import Path

import numpy as np
import pytest

from harness import Experiment, FmuPart, System

M, S0, S1, S2 = 1.0, 1e5, sqrt(1e5), 0.4  # of the LuGre paper of 1995
C = S1 + S2
LONGEST = {"gauss-seidel": (sqrt(C**2 + 4.0 * M * S0) - C) / S0, "jacobi": C / (S0 + C**2 / M)}


@pytest.mark.parametrize("master", LONGEST)
def test_it_is_the_edge_of_the_coupled_map(master: str) -> None:
    """The recursion written out: the mass sees a held force, the contact F = s0 z + c v a held velocity."""
    for share in (0.999, 1.001):
        H, step = share * LONGEST[master], np.zeros((3, 3))
        for i, (x, v, F) in enumerate(np.eye(3)):  # one unit vector after the other: z, v, F
            after = v - H / M * F
            used = v if master == "jacobi" else after
            step[:, i] = x + H * used, after, S0 * (x + H * used) + C * used
        assert (np.abs(np.linalg.eigvals(step)).max() < 1.0 + 1e-12) == (share < 1.0)


@pytest.mark.parametrize("master", LONGEST)
@pytest.mark.parametrize("share", [0.9, 1.1])
def test_a_nudge_dies_below_it_and_grows_above(build_fmu: Callable[..., Path], master: str, share: float) -> None:
    """1 nm/s on the contact, co-simulated."""
    parts = [FmuPart("mass", build_fmu("Mass")), FmuPart("fric", build_fmu("LuGre"))]
    start = {"mass.F_drive": 0.0, "mass.F_load": 0.0, "mass.v_support": 0.0, "mass.v0": 1e-9}
    step = share * LONGEST[master]
    experiment = Experiment(stop=400 * step, step=step, master=master, record=("mass.v",))
    with System(parts, ["mass.v -> fric.v", "fric.F -> mass.F_friction"], start, experiment) as system:
        end = float(abs(system.run()["mass.v"][-50:]).max())
    assert (end < 1e-9) == (share < 1.0)
