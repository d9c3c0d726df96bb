"""The engine neither reads nor writes beside the arrays that it works in."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from harness_parts import mass

from friction_fmus import fmu
from harness import Bias, CallablePart, FmuPart, SeriesPart, System
from harness.engine import algorithm, manipulate
from harness.masters import newton

GUARD = 64
"""Values before and behind each array."""
BEHIND = 1e300
PLAIN_ARRAY = np.array
NOWHERE = 2**40
"""The index of no signal: a program that uses it ends."""


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


def jump() -> System:
    """A mass that comes to rest at a jump of its friction, which no input tells to be a contact."""
    friction = CallablePart("friction", lambda _t, u, _x: 2.0 * np.sign(u[0]), ["v"], ["F"])
    return System([mass(v0=0.1), friction], ["friction.F -> mass.F", "mass.v -> friction.v"])


def guarded(shape: Any, dtype: Any, made: list[np.ndarray]) -> np.ndarray:
    """Zeros between values that show in a result: NaN before, and behind what neither fmax nor a comparison drops."""
    size = int(np.prod(shape))
    whole = np.full(size + 2 * GUARD, BEHIND if dtype is float else 77, dtype=dtype)
    if dtype is float:
        whole[:GUARD] = np.nan
    inside = whole[GUARD : GUARD + size]
    inside[:] = 0
    made.append(whole)
    return inside.reshape(shape)


def between_nowhere(values: Any, dtype: Any = None, **more: Any) -> np.ndarray:
    """As np.array; the engine gets its tables of indices from it."""
    plain = PLAIN_ARRAY(values, dtype=dtype, **more)
    if dtype is not np.int64:
        return plain
    return np.pad(plain.ravel(), 1, constant_values=NOWHERE)[1:-1].reshape(plain.shape)


def guarded_struct(struct: Any, made: list[tuple[Any, bytes]], **beside: float) -> Any:
    """A struct whose arrays have another one at each end, as any line of a loop or manipulator may be."""

    class InArrays(type(struct)):  # type: ignore[misc]
        def __mul__(cls, count: int) -> Callable[..., Any]:
            def array(*values: Any) -> Any:
                end = struct(**beside)
                whole = (struct * (count + 2))(end, *values, *[struct()] * (count - len(values)), end)
                made.append((whole, bytes(end)))
                return (struct * count).from_buffer(whole, ctypes.sizeof(struct))

            return array

    return InArrays(struct.__name__, (struct,), {})


@pytest.mark.parametrize("master", ["gauss-seidel", "jacobi", "newton", "adaptive"])
@pytest.mark.parametrize(("system", "contact"), [(stick_slip, "friction"), (two_contacts, "front"), (jump, "friction")])
def test_values_beside_the_arrays_are_neither_read_nor_changed(
    system: Callable[[], System], contact: str, master: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with system() as plain:
        run = {"stop": 1.0, "step": 1e-2, "master": master, "manipulators": [Bias(f"{contact}.v", 0.01)]}
        expected = plain.run(**run)
    made: list[np.ndarray] = []
    structs: list[tuple[Any, bytes]] = []
    monkeypatch.setattr(np, "zeros", lambda shape, dtype=float: guarded(shape, dtype, made))
    monkeypatch.setattr(np, "array", between_nowhere)
    moving = {"inner": 1, "u0": 1e6, "q0": 2e6, "u1": 3e6, "q1": 4e6, "scale": 1e-6}
    for module, struct, beside in (
        (newton, newton.Moving, moving),
        (algorithm, algorithm.Line, {"input": NOWHERE}),
        (manipulate, manipulate.ManipulatorData, {"input": NOWHERE}),
    ):
        monkeypatch.setattr(module, struct.__name__, guarded_struct(struct, structs, **beside))
    with system() as watched:
        found = watched.run(**run)
    monkeypatch.undo()
    assert found.identical(expected)
    assert len(made) > 2
    for whole, beside in structs:
        assert [bytes(whole[0]), bytes(whole[-1])] == [beside, beside]
    for whole in made:
        assert np.isnan(whole[:GUARD]).all() if whole.dtype == float else (whole[:GUARD] == 77).all()
        assert (whole[-GUARD:] == (BEHIND if whole.dtype == float else 77)).all()
