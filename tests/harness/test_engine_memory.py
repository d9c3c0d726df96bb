"""The engine neither reads nor writes beside the arrays that it works in."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from friction_fmus import fmu
from harness import FmuPart, SeriesPart, System

GUARD = 64
"""Values before and behind each array."""


def stick_slip() -> System:
    """A contact that rests and slips, with a rigid model."""
    parts = [FmuPart("mass", fmu("Mass")), FmuPart("friction", fmu("Stiction"))]
    wires = ["mass.v -> friction.v", "friction.F -> mass.F_friction", "mass.F_ext -> friction.F_ext"]
    start = {"mass.k": 20.0, "mass.v_support": 0.1, "mass.F_drive": 0.0, "friction.Fs": 1.5, "friction.Fc": 1.0}
    return System(parts, wires, start)


def two_contacts() -> System:
    """A motor and a load on a spring, each on its own contact, under a force from a table."""
    parts = [FmuPart("axis", fmu("TwoMass")), SeriesPart("drive", [0.0, 0.5, 1.0], {"F": [0.0, 4.0, -4.0]})]
    parts += [FmuPart("front", fmu("Stiction")), FmuPart("back", fmu("Karnopp"))]
    wires = ["drive.F -> axis.F_drive"]
    for one, i in (("front", 1), ("back", 2)):
        wires += [f"axis.v{i} -> {one}.v", f"{one}.F -> axis.F_friction{i}", f"axis.F_ext{i} -> {one}.F_ext"]
    return System(parts, wires, {"axis.k": 20.0, "axis.d": 1.5, "back.DV": 0.0})


def guarded(shape: Any, dtype: Any, made: list[np.ndarray]) -> np.ndarray:
    size = int(np.prod(shape))
    whole = np.full(size + 2 * GUARD, np.nan if dtype is float else 77, dtype=dtype)
    inside = whole[GUARD : GUARD + size]
    inside[:] = 0
    made.append(whole)
    return inside.reshape(shape)


@pytest.mark.parametrize("master", ["gauss-seidel", "jacobi", "newton", "adaptive"])
@pytest.mark.parametrize("system", [stick_slip, two_contacts])
def test_values_beside_the_arrays_are_neither_read_nor_changed(
    system: Callable[[], System], master: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with system() as plain:
        expected = plain.run(stop=1.0, step=1e-2, master=master).to_dataframe()
    made: list[np.ndarray] = []
    monkeypatch.setattr(np, "zeros", lambda shape, dtype=float: guarded(shape, dtype, made))
    with system() as watched:
        found = watched.run(stop=1.0, step=1e-2, master=master).to_dataframe()
    monkeypatch.undo()
    assert found.equals(expected)
    assert len(made) > 2
    for whole in made:
        ends = whole[[*range(GUARD), *range(-GUARD, 0)]]
        assert np.isnan(ends).all() if whole.dtype == float else (ends == 77).all()
