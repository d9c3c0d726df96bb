"""Input derivatives set by `fmpy.simulate_fmu`, whose buffer for them has the wrong size."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy import simulate_fmu, simulation

RATE, STEP = 3.0, 0.01


def ramp(path: Path) -> np.ndarray:
    """A mass of 1 kg under the force 3 N/s t."""
    times = np.arange(11) * STEP
    force = np.array([(t, RATE * t) for t in times], dtype=[("time", float), ("F_drive", float)])
    options: dict[str, Any] = {"start_values": {"m": 1.0, "k": 0.0}, "output": ["v"], "output_interval": STEP}
    return simulate_fmu(
        str(path), stop_time=0.1, fmi_type="CoSimulation", input=force, set_input_derivatives=True, **options
    )["v"]


def test_the_defect_of_the_page_is_still_there(build_fmu: Callable[[str], Path]) -> None:
    with pytest.raises(ValueError, match="same size"):
        ramp(build_fmu("Mass"))


def test_the_mass_is_exact_with_a_buffer_that_fits(
    build_fmu: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """v = 3 t^2 / 2, less the first step, in which fmpy sends the slope 0."""

    class Fitting(simulation.Input):  # type: ignore[misc]
        def __init__(self, *arguments: Any, **options: Any) -> None:
            super().__init__(*arguments, **options)
            self.continuous = [
                each._replace(derivatives=(each.values._type_ * len(each.vrs))()) for each in self.continuous
            ]

    monkeypatch.setattr(simulation, "Input", Fitting)
    times = np.arange(11) * STEP
    expected = RATE * (times**2 - np.minimum(times, STEP) ** 2) / 2.0
    np.testing.assert_allclose(ramp(build_fmu("Mass")), expected, rtol=1e-9, atol=1e-15)
