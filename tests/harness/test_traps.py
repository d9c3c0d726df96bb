"""The engine raises no floating-point exception in ordinary runs: a host program may have enabled traps."""

from __future__ import annotations

from collections.abc import Mapping

import pytest
from shell.traps import no_traps

from friction_fmus import fmu
from harness import FmuPart, System, Wire
from harness.engine.native import Engine

PAIR = ("mass.v -> friction.v", "friction.F -> mass.F_friction")
AXIS = ("left.v -> lug.v", "lug.F -> left.F_friction", "left.v -> rest.v", "rest.F -> left.F_load")
SYSTEMS: Mapping[str, tuple[Mapping[str, str], tuple[str | Wire, ...], Mapping[str, float | bool]]] = {
    "stick-slip": (
        {"mass": "Mass", "friction": "LuGre"},
        PAIR,
        {"mass.k": 2.0, "mass.v_support": 0.1, "mass.F_drive": 0.0, "mass.F_load": 0.0},
    ),
    "at rest": (
        {"mass": "Mass", "friction": "Stiction"},
        (*PAIR, "mass.F_ext -> friction.F_ext"),
        {"mass.k": 2.0, "mass.v_support": 0.1, "mass.F_drive": 0.0, "mass.F_load": 0.0},
    ),
    "two contacts": (
        {"left": "Mass", "lug": "LuGre", "rest": "Dahl"},
        AXIS,
        {"left.k": 20.0, "left.v_support": 0.1, "left.F_drive": 0.0},
    ),
    "a late force": (
        {"mass": "Mass", "friction": "Viscous"},
        (PAIR[0], Wire("friction.F", "mass.F_friction", delay=2)),
        {"mass.k": 2.0, "mass.v_support": 0.0, "mass.F_drive": 1.0, "mass.F_load": 0.0},
    ),
}


@pytest.mark.parametrize("master", ["jacobi", "gauss-seidel", "newton", "adaptive"])
@pytest.mark.parametrize("name", SYSTEMS)
def test_no_tick_divides_by_zero_overflows_or_is_invalid(
    name: str, master: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    models, wires, start = SYSTEMS[name]
    run = Engine.run

    def watched(engine: Engine, first: int, last: int) -> int:
        with no_traps((name, first)):
            return run(engine, first, last)

    monkeypatch.setattr(Engine, "run", watched)
    with System([FmuPart(part, fmu(model)) for part, model in models.items()], wires, start) as system:
        system.run(stop=0.5, step=1e-3, master=master)
