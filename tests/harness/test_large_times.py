"""Runs that begin at a Unix time, in the harness's own engine: they have the same steps and samples as runs from 0."""

from __future__ import annotations

import numpy as np
import pytest
from fmi3.slaves import three

from friction_fmus import fmu
from harness import FmuPart, SeriesPart, System

UNIX = 1.7e9
"""[s] A start whose rounding is 1.2e-4 of a step of 2 ms."""


def loop(fmi: int) -> System:
    """A sampled law with a mass and friction, of which the law acts in every second step."""
    models = {"mass": "Mass", "friction": "LuGre", "law": "PID"}
    every = {"law": 2}
    parts = [
        FmuPart(name, three(model, full=False) if fmi == 3 else fmu(model), every=every.get(name, 1))
        for name, model in models.items()
    ]
    wires = [
        *("mass.v -> friction.v", "friction.F -> mass.F_friction"),
        *("mass.x -> law.x", "mass.v -> law.v", "law.u -> mass.F_drive"),
    ]
    start = {"law.Ts": 4e-3, "law.r": 1e-3, "law.rd": 0.0, "law.rdd": 0.0, "law.Kp": 2e3, "law.Kd": 20.0}
    return System(parts, wires, start)


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("master", ["jacobi", "gauss-seidel", "newton", "adaptive"])
def test_a_run_does_not_depend_on_its_start(master: str, fmi: int) -> None:
    found = []
    for begin in (0.0, UNIX):
        with loop(fmi) as system:
            found.append(system.run(start=begin, stop=begin + 4.0, step=2e-3, master=master))
    assert found[0].sizes["time"] == found[1].sizes["time"] == 2001
    for name in found[0].data_vars:
        one, other = (each[name].to_numpy() for each in found)
        np.testing.assert_allclose(other, one, rtol=1e-9, atol=1e-9 * np.abs(one).max())


def test_rows_of_a_record_act_in_their_steps() -> None:
    """Row k begins at tick k; a tick that took its neighbour would shift all values."""
    for begin in (0.0, UNIX):
        rows = np.arange(2001.0)
        record = SeriesPart("record", begin + 2e-3 * rows, {"a": rows}, {"a": None}, interpolation="previous")
        with System([record, FmuPart("sum", fmu("SampledSum"))], ["record.a -> sum.u1"], {"sum.Ts": 2e-3}) as system:
            found = system.run(start=begin, stop=begin + 4.0, step=2e-3, record=["sum.y"])
        np.testing.assert_array_equal(found["sum.y"].to_numpy()[1:], rows[:-1])
