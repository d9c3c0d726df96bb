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


def servo(friction: str, kind: Callable[[str], Path]) -> System:
    """A mass with friction under sampled feedback: the FMUs do little, so that the calls themselves count."""
    parts = [FmuPart("mass", kind("Mass")), FmuPart("friction", kind(friction)), FmuPart("pid", kind("PID"))]
    wires = ["mass.v -> friction.v", "friction.F -> mass.F_friction", "mass.x -> pid.x", "mass.v -> pid.v"]
    start = {"pid.r": 1e-3, "pid.rd": 0.0, "pid.rdd": 0.0, "pid.Kp": 1e4, "pid.Kd": 100.0, "pid.Ts": 2e-3}
    return System(parts, [*wires, "pid.u -> mass.F_drive"], start)


@nightly
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("master", ["gauss-seidel", "jacobi"])
@pytest.mark.parametrize(("system", "friction"), [(stick_slip, "Dahl"), (stick_slip, "GMS"), (servo, "LuGre")])
def test_the_engine_is_as_fast_as_with_fmi_2(
    system: Callable[[str, Callable[[str], Path]], System], friction: str, master: str
) -> None:
    """Within 5 %: processor time of 400 000 steps, nine times in turn, fastest and median."""
    times: dict[str, list[float]] = {"2.0": [], "3.0": []}
    with system(friction, fmu) as old, system(friction, three) as new:
        for _ in range(10):
            for name, made in (("2.0", old), ("3.0", new)):
                begin = time.process_time()
                made.run(stop=40.0, step=1e-4, master=master, record=["mass.x"])
                times[name].append(time.process_time() - begin)
    for measure in (min, np.median):
        assert measure(times["3.0"][1:]) < 1.05 * measure(times["2.0"][1:]), times
