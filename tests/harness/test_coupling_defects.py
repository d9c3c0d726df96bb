"""The measures of coupling errors on two parts whose values are known in closed form."""

from __future__ import annotations

import math

import pytest

from friction_fmus import fmu
from harness import CallablePart, FmuPart, Port, System

STEPS = 4000
MEAN, SWING, SPEED = 3.0, 2.0, 0.7


def force(t: float, _u: object, _x: object) -> float:
    """MEAN + SWING and MEAN - SWING in turn."""
    return MEAN + SWING * (-1.0) ** round(t / 0.5)


def coupled() -> System:
    parts = [
        CallablePart("contact", force, [Port("v", "m/s")], [Port("F", "N")], dependencies={"F": []}),
        CallablePart("mass", lambda _t, _u, _x: SPEED, [Port("F", "N")], [Port("v", "m/s")], dependencies={"v": []}),
    ]
    return System(parts, ["mass.v -> contact.v", "contact.F -> mass.F"])


def test_a_force_that_alternates_has_the_defects_of_its_sums() -> None:
    """Each step, the held force is 2 SWING off, with a sign that changes; the first has nothing to compare with.

    The force averaged over a step is MEAN, so that the held one gives SWING SPEED too much or too little power.
    """
    with coupled() as system:
        found = system.run(stop=0.5 * STEPS, step=0.5, master="jacobi").attrs
    mean_square = MEAN**2 + SWING**2
    assert found["coupling_error"] == pytest.approx(math.sqrt((2 * SWING) ** 2 * (STEPS - 1) / STEPS / mean_square))
    assert found["alternating_error"] == pytest.approx(2 * SWING * (STEPS - 1) / STEPS / MEAN)
    assert found["coupling_energy"] == pytest.approx(SWING * SPEED / (MEAN * SPEED))
    assert found["unstable_fraction"] == 0.0  # over 2000 steps, it is as often too much as too little


@pytest.mark.parametrize(
    ("load", "speeds", "missed"),
    [
        (0.3, [0.0, 0.0, 0.0, 2.0, 2.0], 1),  # leaves rest
        (0.3, [1.0, 1.0, -1.0, -1.0, -1.0], 1),  # passes it
        (0.3, [1.0, -1.0, 1.0, -1.0, 1.0], 3),  # the last is at the end of the run, beyond which no part goes
        (0.3, [1.0, 2.0, 3.0, 2.0, 1.0], 0),
        (0.3, [0.0, 0.0, 0.0, 0.0, 0.0], 0),  # stays at rest
        (1.7, [0.0, 0.0, 0.0, 2.0, 2.0], 0),  # more than static friction
    ],
)
def test_a_contact_that_friction_would_hold_is_counted_where_it_passes_rest(
    load: float, speeds: list[float], missed: int, caplog: pytest.LogCaptureFixture
) -> None:
    outputs = [Port("v", "m/s"), Port("F_ext", "N")]
    mass = CallablePart(
        "mass",
        lambda t, _u, _x: [speeds[round(t)], load],
        [Port("F", "N")],
        outputs,
        dependencies={"v": [], "F_ext": []},
    )
    wires = ["mass.v -> contact.v", "mass.F_ext -> contact.F_ext", "contact.F -> mass.F"]
    with System([mass, FmuPart("contact", fmu("Stiction"))], wires) as system:
        found = system.run(stop=4.0, step=1.0, master="jacobi").attrs
    assert found["missed_rest"] == missed / 4
    assert "exceeds the stop time" not in caplog.text
