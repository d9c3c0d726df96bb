"""The friction that the file of a block states, as in the macro CONTACT, is what the block computes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import fmpy
import numpy as np
import pytest
from thorough import some

from friction_fmus.blocks.catalogue import about_of, listing

CONTACTS = [
    name
    for name, block in listing().items()
    if block.kind == "friction" and name != "KarnoppMass" and about_of(block).friction
]


@pytest.mark.parametrize("name", some(CONTACTS, CONTACTS[::4]))
def test_rows_of_friction_are_what_the_blocks_do(name: str, build_fmu: Callable[..., Path]) -> None:
    """Stiffness from two small steps at rest, level and viscous friction from fast sliding."""
    path = build_fmu(name)
    start = {v.name: float(v.start) for v in fmpy.read_model_description(str(path)).modelVariables if _number(v.start)}
    friction = about_of(listing()[name]).friction
    assert friction is not None
    contact = friction.contact(start)
    level = contact.levels[0]

    def force(v: float, step: float, steps: int) -> np.ndarray:
        found = fmpy.simulate_fmu(
            str(path), start_values={"v": v}, stop_time=steps * step, step_size=step, output_interval=step, output=["F"]
        )
        return np.asarray(found["F"])

    if contact.stiffness:
        tiny = force(1e-7, 1e-4, 3)  # 0.03 nm
        assert (tiny[-1] - tiny[-2]) / 1e-11 == pytest.approx(contact.stiffness, rel=1e-3)
        rest = tiny[-1] - 3.0 * (tiny[-1] - tiny[-2])
        assert rest / 1e-7 == pytest.approx(contact.damping + contact.viscous, rel=1e-3, abs=0.02)
    fast = [force(v, 0.1, 20)[-1] for v in (1.0, 2.0)]
    assert fast[1] - fast[0] == pytest.approx(level.viscous, rel=1e-6, abs=1e-9)
    assert fast[0] - level.viscous == pytest.approx(level.Fc, rel=1e-4, abs=1e-9)


def _number(text: str | None) -> bool:
    try:
        float(text or "")
    except ValueError:
        return False
    return True
