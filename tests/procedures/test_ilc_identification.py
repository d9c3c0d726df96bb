"""Tables and Tustin's curve from forces whose friction and cogging are known."""

from __future__ import annotations

import numpy as np
import pytest

from friction_fmus.blocks.catalogue import catalogue
from friction_fmus.errors import FrictionError
from friction_fmus.procedures import separate

PITCH = 0.024
X = PITCH / 48.0 * np.arange(48)
SPEEDS = np.array([2e-4, 1e-3, 3e-3, 1e-2, 5e-2])
LEVEL = 1.0 + 0.1 * np.cos(2.0 * np.pi * X / PITCH)
COGGING = 0.7 * np.sin(2.0 * np.pi * X / PITCH)
FRICTION = (1.0 + 0.5 * np.exp(-SPEEDS / 1e-3) + 0.4 * SPEEDS)[:, None] * LEVEL


def test_friction_and_cogging_are_separated_and_fitted():
    tables = separate(X, SPEEDS, FRICTION + COGGING, COGGING - FRICTION)
    assert tables.friction == pytest.approx(FRICTION, abs=1e-12)
    assert tables.cogging == pytest.approx(COGGING, abs=1e-12)
    values = tables.start_values(PITCH)
    expected = {"Fc": 1.0, "Fs": 1.5, "Fv": 0.4, "vs": 1e-3, "pitch": PITCH, "x0": 0.0}
    assert {name: values[name] for name in expected} == pytest.approx(expected, rel=1e-4)
    assert [values[f"level[{i}]"] for i in range(1, 17)] == pytest.approx(LEVEL[::3], abs=1e-9)
    assert [values[f"cogging[{i}]"] for i in range(1, 17)] == pytest.approx(COGGING[::3], abs=1e-9)


def test_start_values_are_parameters_of_the_block(build_fmu):
    from fmpy import read_model_description

    values = separate(X, SPEEDS, FRICTION + COGGING, COGGING - FRICTION).start_values(PITCH)
    assert "TustinFeedback" in catalogue()
    description = read_model_description(build_fmu("TustinFeedback"))
    assert values.keys() <= {variable.name for variable in description.modelVariables}


def test_too_few_speeds_and_wrong_shapes_are_refused():
    few = separate(X, SPEEDS[:3], FRICTION[:3], -FRICTION[:3])
    with pytest.raises(FrictionError, match=r"^tustin: .* 3 speeds"):
        few.tustin()
    with pytest.raises(FrictionError, match=r"^separate: "):
        separate(X, SPEEDS, FRICTION[:3], -FRICTION[:3])
    with pytest.raises(FrictionError, match=r"^separate: "):
        separate(X, -SPEEDS, FRICTION, -FRICTION)
