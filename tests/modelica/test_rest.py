"""Set-valued friction under a mass that stops, reverses and sticks: the force in Modelica and that of the FMU there."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from modelica.library import SHORT_STEPS, Library
from modelica.test_coupled_systems import text
from shell.instance import Instance, load
from thorough import nightly

NEGATIVE = {"asymmetric": True, "Fc_neg": 0.8, "Fs_neg": 1.2, "Fv_neg": 0.1, "vs_neg": 2e-3, "delta_neg": 1.0}
CASES = [
    ("Coulomb", {}),
    ("Stiction", {}),
    ("Tustin", {"vs": 0.1}),
    ("Stribeck", {"vs": 0.1, "delta": 1.5, "shape": 1, "offset": 0.2}),
    pytest.param("Stribeck", {**NEGATIVE, "vs": 0.1}, marks=nightly),
]
FORCE = "2.2*sin(2*time) + 0.4*sin(7*time)"
LOAD = "1 + 0.5*sin(3*time)"


@pytest.mark.parametrize(("law", "values"), CASES)
def test_force_is_that_of_the_fmu(
    law: str, values: Mapping[str, Any], library: Library, build_fmu: Callable[..., Path]
) -> None:
    model = text(law, {**values, "useFn": True}, force=FORCE, more=f"  friction.Fn = {LOAD};\npublic\n{SHORT_STEPS}")
    result = library.run(model, 10.0, 0.01)
    names = ("mass.v", "friction.F", "friction.direction")
    t, v, F, direction = (np.array(column) for column in (result.time, *(result[name] for name in names)))
    assert {-1.0, 0.0, 1.0} == set(direction)
    force, normal = 2.2 * np.sin(2.0 * t) + 0.4 * np.sin(7.0 * t), 1.0 + 0.5 * np.sin(3.0 * t)
    apart = np.min(np.abs(t[:, None] - t[np.flatnonzero(np.diff(direction))]), axis=1) > 1e-6
    with Instance(load(build_fmu(law))) as run:
        run.initialise(**values)
        for k in np.flatnonzero(apart):
            at_rest = direction[k] == 0.0
            run.set({"v": 0.0 if at_rest else v[k], "F_ext": force[k], "Fn": normal[k]})
            assert run.get("F", "stuck") == pytest.approx([F[k], float(at_rest)], abs=1e-8)
            assert not at_rest or abs(v[k]) < 1e-12
