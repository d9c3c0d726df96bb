"""Cost of a run in the native engine with parts in FMI 3.0, over the same parts in FMI 2.0."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from fmi3.slaves import three
from thorough import nightly

from friction_fmus import fmu
from harness import FmuPart, System


def stick_slip(friction: str, kind: Callable[[str], Path]) -> System:
    """A mass on a friction model, pulled by a spring."""
    parts = [FmuPart("mass", kind("Mass")), FmuPart("friction", kind(friction))]
    start = {"mass.k": 2.0, "mass.v_support": 0.1, "mass.F_drive": 0.0}
    return System(parts, ["mass.v -> friction.v", "friction.F -> mass.F_friction"], start)


@nightly
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("master", ["gauss-seidel", "jacobi"])
@pytest.mark.parametrize("friction", ["Dahl", "GMS"])
def test_the_engine_is_as_fast_as_with_fmi_2(friction: str, master: str) -> None:
    """Within 5 %: processor time of 400 000 steps, nine times in turn, fastest and median."""
    times: dict[str, list[float]] = {"2.0": [], "3.0": []}
    with stick_slip(friction, fmu) as old, stick_slip(friction, three) as new:
        for _ in range(10):
            for name, system in (("2.0", old), ("3.0", new)):
                begin = time.process_time()
                system.run(stop=40.0, step=1e-4, master=master, record=["mass.x"])
                times[name].append(time.process_time() - begin)
    for measure in (min, np.median):
        assert measure(times["3.0"][1:]) < 1.05 * measure(times["2.0"][1:]), times
