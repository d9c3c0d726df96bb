"""The measures of coupling errors on two parts whose values are known in closed form."""

from __future__ import annotations

import math

import pytest

from friction_fmus import fmu
from harness import CallablePart, FmuPart, Port, SeriesPart, System

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
        (0.3, [5.0, -1.0, -1.0, -1.0, -1.0], 1),  # passes it, and is slow after it
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


def test_a_force_that_grows_is_seen_beside_a_load_from_a_record(caplog: pytest.LogCaptureFixture) -> None:
    """Held viscous friction changes v to v (1 - Fv h/m) in each step, here to -2 v; inputs are read again after it.

    The smaller of two consecutive changes of F is 3/4 of its new value.
    """
    load = SeriesPart("load", [0.0], {"F": [0.0]}, {"F": "N"}, interpolation="previous", beyond="hold")
    parts = [FmuPart("mass", fmu("Mass")), FmuPart("contact", fmu("Stiction")), load]
    wires = [
        "mass.v -> contact.v",
        "contact.F -> mass.F_friction",
        "mass.F_ext -> contact.F_ext",
        "load.F -> mass.F_drive",
    ]
    start = {"mass.m": 1.0, "mass.v0": 1.0, "contact.Fv": 30.0, "contact.Fc": 1e-6, "contact.Fs": 1e-6}
    with System(parts, wires, start) as system:
        result = system.run(stop=3.0, step=0.1, master="gauss-seidel")
    assert abs(result["mass.v"].to_numpy()[-1]) > 2.0**28
    assert result.attrs["coupling_error"] == pytest.approx(0.75, rel=1e-3)
    assert "the result is wrong" in caplog.text


@pytest.mark.parametrize(("radians", "warns"), [(2.0 * math.pi, True), (0.1, False)])
def test_a_mass_that_swings_within_a_step(radians: float, warns: bool, caplog: pytest.LogCaptureFixture) -> None:
    """On a spring whose support moves, v = V (1 - cos(w t)): always 0 at the communication points if w h = 2 pi."""
    h, speed = 0.01, 0.2
    parts = [FmuPart("mass", fmu("Mass")), FmuPart("contact", fmu("Viscous"))]
    start = {
        "mass.m": 1.0,
        "mass.k": (radians / h) ** 2,
        "mass.v_support": speed,
        "mass.F_drive": 0.0,
        "contact.Fv": 0.0,
    }
    with System(parts, ["mass.v -> contact.v", "contact.F -> mass.F_friction"], start) as system:
        found = system.run(stop=200 * h, step=h, master="gauss-seidel", record=["mass.v"]).attrs
    assert found["motion_within_steps"] == pytest.approx(1.0 if warns else 0.0, abs=1e-3)
    assert ("the result is wrong" in caplog.text) == warns


@pytest.mark.parametrize(("steps", "warns"), [(50, True), (2000, False)])
@pytest.mark.parametrize(
    ("master", "late", "text"), [("jacobi", 2, "two steps late"), ("gauss-seidel", 1, "a step late")]
)
def test_a_force_that_acts_late(
    master: str, late: int, text: str, steps: int, warns: bool, caplog: pytest.LogCaptureFixture
) -> None:
    """A load of 1.2 N moves 1 kg from rest against 1 N, which jacobi applies from the third step on: v is 2 m/s off.

    With steps of 1 s, v = 0.2 n + 2 after n > 1 steps, and the sum of it 0.1 n (n + 1) + 2 n - 1. Gauss-Seidel applies
    it from the second step on, and v is 1 m/s off. Three steps of v are no error.
    """
    parts = [
        FmuPart("mass", fmu("Mass")),
        CallablePart("contact", lambda _t, u, _x: float(u[0] > 0.0), [Port("v", "m/s")], [Port("F", "N")]),
    ]
    start = {"mass.m": 1.0, "mass.F_drive": 1.2}
    with System(parts, ["mass.v -> contact.v", "contact.F -> mass.F_friction"], start) as system:
        found = system.run(stop=float(steps), step=1.0, master=master).attrs["late_forces"]
    off = late * (steps - late) - 3.0 * (0.2 * steps + late)
    assert found == pytest.approx(off / (0.1 * steps * (steps + 1) + late * steps - (late - 1)), rel=1e-9)
    assert (f"acts {text}" in caplog.text) == warns


def test_a_position_behind_a_gear_is_no_other_motion() -> None:
    """x = sin(t)/2 where v = cos(t)."""
    motion = [Port("x", "m"), Port("v", "m/s")]
    mass = CallablePart(
        "mass",
        lambda t, _u, _x: [0.5 * math.sin(t), math.cos(t)],
        [Port("F", "N")],
        motion,
        dependencies={"x": [], "v": []},
    )
    mass.integrals = {"v": "x"}
    contact = CallablePart("contact", lambda _t, u, _x: u, [Port("v", "m/s")], [Port("F", "N")])
    with System([mass, contact], ["mass.v -> contact.v", "contact.F -> mass.F"]) as system:
        assert system.run(stop=10.0, step=0.01, master="gauss-seidel").attrs["motion_within_steps"] == 0.0
