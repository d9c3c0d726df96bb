"""The implicit masters, on parts without FMUs and against closed forms."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from fractions import Fraction

import numpy as np
import pytest
from harness_parts import DAMPING, SIGMA0, bristle, mass
from scipy.linalg import expm
from test_harness_masters import two_masses

from harness import CallablePart, ExperimentError, Port, Result, SeriesPart, System
from harness.accuracy.error_estimate import Track, estimate
from harness.engine.defect import inaccurate

WIRES = ["bristle.F -> mass.F", "mass.v -> bristle.v"]


def test_two_mass_oscillator_converges_with_second_order() -> None:
    system, exact = two_masses()
    errors = []
    for n in (100, 200, 400, 800):
        result = system.run(stop=1.0, step=1.0 / n, master="newton", record=["first.x"], decimate=n)
        errors.append(abs(float(result["first.x"][-1]) - exact[0]))
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    np.testing.assert_allclose(orders, 2.0, atol=0.1)
    assert errors[-1] < 1e-5


def test_bristle_loop_follows_its_closed_form() -> None:
    """z' = v, v' = -(sigma0 z + c v): steps of 0.1 ms are short against 1/316 s and 1/316 s."""
    h, n = 1e-4, 200
    result = System([mass(v0=1e-3), bristle()], WIRES).run(stop=n * h, step=h, master="newton")
    exact = np.array([expm(np.array([[0.0, 1.0], [-SIGMA0, -DAMPING]]) * h * k) @ [0.0, 1e-3] for k in range(n + 1)])
    np.testing.assert_allclose(result["mass.v"], exact[:, 1], atol=2e-3 * 1e-3)
    np.testing.assert_allclose(result["mass.x"], exact[:, 0], atol=2e-3 * 1e-3 / 316.0)


@pytest.mark.parametrize("step", [1.0, 100.0])
def test_what_is_stiff_decays_by_half_in_a_step(step: float) -> None:
    """rho = 0.5, and the ringing changes its sign: where Gauss-Seidel explodes above 3.91 ms."""
    result = System([mass(v0=1e-3), bristle()], WIRES).run(stop=40 * step, step=step, master="newton")
    v = np.abs(result["mass.v"].to_numpy())
    assert v.max() <= 2e-3
    envelope = 4e-3 * (1 + np.arange(41)) * 0.5 ** np.arange(41)
    assert (v[3:] <= envelope[3:] + 1e-7 * 0.4 * step).all()  # the tolerance of the force


def coulomb(Fc: float, jump: float = 1.0) -> CallablePart:
    return CallablePart("friction", lambda t, u, x: Fc * np.sign(jump * u[0]), ["v"], ["F"])


def test_mass_comes_to_rest_under_coulomb_friction() -> None:
    """v = v0 - Fc t and x = v0^2/(2 Fc) from t = v0/Fc on: the force that holds lies between those of the jump."""
    Fc, v0, h = 2.0, 0.1, 1e-3
    system = System([mass(v0=v0), coulomb(Fc)], ["friction.F -> mass.F", "mass.v -> friction.v"])
    result = system.run(stop=0.1, step=h, master="newton")
    t = result["time"].to_numpy()
    np.testing.assert_allclose(result["mass.v"][t > 0.06], 0.0, atol=Fc * h)
    np.testing.assert_allclose(result["mass.v"][t < 0.049], (v0 - Fc * t)[t < 0.049], atol=Fc * h)
    np.testing.assert_allclose(float(result["mass.x"][-1]), v0**2 / (2 * Fc), atol=2 * v0 * h)


def test_two_contacts_in_one_loop() -> None:
    """Two bristles hold one mass: the closed form with twice the stiffness and damping."""
    plant = CallablePart(
        "mass",
        lambda t, u, x: x,
        ["F1", "F2"],
        ["x", "v"],
        advance=lambda t, h, u, x: [x[0] + h * x[1] - 0.5 * h * h * sum(u), x[1] - h * sum(u)],
        state=[0.0, 1e-3],
        dependencies={"x": (), "v": ()},
    )
    wires = ["mass.v -> a.v", "mass.v -> b.v", "a.F -> mass.F1", "b.F -> mass.F2"]
    h, n = 1e-4, 100
    result = System([plant, bristle("a"), bristle("b")], wires).run(stop=n * h, step=h, master="newton")
    exact = expm(np.array([[0.0, 1.0], [-2 * SIGMA0, -2 * DAMPING]]) * n * h) @ [0.0, 1e-3]
    np.testing.assert_allclose(float(result["mass.v"][-1]), exact[1], atol=5e-6)
    assert result.attrs["evaluations"] < 6 * n


def test_what_drives_a_loop_is_stepped_once_and_handed_over_as_a_line() -> None:
    """A ramp of force from a continuous source: x' = v, v' = t is exact, as its mean over the step is."""
    steps = [0]

    def count(t: float, h: float, u: np.ndarray, x: np.ndarray) -> np.ndarray:
        steps[0] += 1
        return x

    ramp = CallablePart("ramp", lambda t, u, x: t, [], ["F"], advance=count, state=[0.0])
    plant = CallablePart(
        "mass",
        lambda t, u, x: x,
        ["F", "f"],
        ["x", "v"],
        advance=lambda t, h, u, x: [x[0] + h * x[1] + 0.5 * h * h * (u[0] - u[1]), x[1] + h * (u[0] - u[1])],
        state=[0.0, 0.0],
        dependencies={"x": (), "v": ()},
    )
    viscous = CallablePart("friction", lambda t, u, x: 3.0 * u[0], ["v"], ["f"])
    wires = ["ramp.F -> mass.F", "mass.v -> friction.v", "friction.f -> mass.f"]
    system = System([ramp, plant, viscous], wires)
    errors = []
    for n in (50, 100):
        steps[0] = 0
        result = system.run(stop=1.0, step=1.0 / n, master="newton")
        assert steps[0] == n
        errors.append(abs(float(result["mass.v"][-1]) - (1.0 / 3.0 - (1.0 - np.exp(-3.0)) / 9.0)))
    assert errors[1] < 1e-5
    np.testing.assert_allclose(np.log2(errors[0] / errors[1]), 2.0, atol=0.2)


def test_a_line_within_a_loop_begins_after_the_jump_of_a_held_input() -> None:
    """A meter in the loop integrates the net force, which depends directly on a held one: q = v = the impulse."""
    plant = CallablePart(
        "mass",
        lambda t, u, x: [x[0], u[0] - u[1]],
        ["F", "f"],
        ["v", "net"],
        advance=lambda t, h, u, x: x + h * (u[0] - u[1]),
        state=[0.0],
        dependencies={"v": (), "net": ("F", "f")},
    )
    meter = CallablePart(
        "meter",
        lambda t, u, x: [0.0 * u[0], x[0]],
        ["v", "net"],
        ["f", "q"],
        advance=lambda t, h, u, x: x + h * u[1],
        state=[0.0],
        dependencies={"f": ("v",), "q": ()},
    )
    drive = SeriesPart("drive", [0.0, 0.2, 0.4], {"F": [1.0, -3.0, 4.0]}, interpolation="previous", beyond="hold")
    wires = ["drive.F -> mass.F", "mass.v -> meter.v", "mass.net -> meter.net", "meter.f -> mass.f"]
    result = System([plant, meter, drive], wires).run(stop=0.6, step=0.1, master="newton")
    exact = [0.0, 0.1, 0.2, -0.1, -0.4, 0.0, 0.4]
    np.testing.assert_allclose(result["mass.v"], exact, atol=1e-12)
    np.testing.assert_allclose(result["meter.q"], exact, atol=1e-12)


def test_a_tenth_of_the_tolerance_takes_root_ten_times_the_pieces() -> None:
    """Of steps that are too long for x = cos(t): the method is of second order in divided steps, too."""
    plant = CallablePart(
        "mass",
        lambda t, u, x: x,
        ["F"],
        ["x", "v"],
        advance=lambda t, h, u, x: [x[0] + h * x[1] - 0.5 * h * h * u[0], x[1] - h * u[0]],
        state=[1.0, 0.0],
        dependencies={"x": (), "v": ()},
    )
    spring = CallablePart(
        "spring", lambda t, u, x: x + 0.0 * u, ["v"], ["F"], advance=lambda t, h, u, x: x + h * u[0], state=[1.0]
    )
    system = System([plant, spring], ["spring.F -> mass.F", "mass.v -> spring.v"])
    pieces, errors = [], []
    for tolerance in (1e-2, 1e-3):
        result = system.run(stop=20.0, step=0.5, master="newton", step_tolerance=tolerance)
        pieces.append(result.attrs["substeps"])
        errors.append(float(np.abs(result["mass.x"] - np.cos(result["time"])).max()))
    assert pieces[1] < 2.0 * math.sqrt(10.0) * pieces[0]
    assert errors[1] < 0.3 * errors[0]


def test_at_rest_no_step_is_divided() -> None:
    """All values stay 0, so that differences have no size."""
    result = System([mass(v0=0.0), bristle()], WIRES).run(stop=0.1, step=1e-3, master="newton")
    assert (result.attrs["substeps"], result.attrs["rejected"]) == (100, 0)
    assert result.attrs["checks"] > 0


SCHEDULED = (0, 1, 2, 4, 8, *range(16, 512, 16), 512, 1024)  # ticks of checks that nothing else asks for


@pytest.mark.parametrize("steps", [16, 512, 1100])
def test_at_rest_only_scheduled_steps_are_checked(steps: int) -> None:
    """Each tick that is a power of 2 up to 8, every 16th until 512, then every 512th."""
    result = System([mass(v0=0.0), bristle()], WIRES).run(stop=steps * 1e-3, step=1e-3, master="newton")
    assert result.attrs["checks"] == sum(tick < steps for tick in SCHEDULED)


@pytest.mark.parametrize(("rate", "checks"), [(1e-2, 1), (200.0, 2)])
def test_the_step_after_a_jump_is_checked_if_the_motion_may_be_over_in_one(rate: float, checks: int) -> None:
    """v' = rate (1 - v) from v = 1, and 1.005 in place of 1 after a jump between two scheduled checks."""
    h, jump = 0.1, 53
    plant = CallablePart(
        "mass",
        lambda t, u, x: x,
        ["F", "f"],
        ["v"],
        advance=lambda t, h, u, x: x + h * (rate + u[0] - u[1]),
        state=[1.0],
        dependencies={"v": ()},
    )
    friction = CallablePart("friction", lambda t, u, x: rate * u[0], ["v"], ["f"])
    drive = SeriesPart("drive", [0.0, jump * h], {"F": [0.0, 5e-3 * rate]}, interpolation="previous", beyond="hold")
    wires = ["drive.F -> mass.F", "mass.v -> friction.v", "friction.f -> mass.f"]
    result = System([plant, friction, drive], wires).run(stop=10.0, step=h, master="newton")
    late = np.maximum(result["time"].to_numpy() - jump * h, 0.0)
    np.testing.assert_allclose(result["mass.v"][60:], (1.005 - 5e-3 * np.exp(-rate * late))[60:], atol=1e-4)
    assert result.attrs["checks"] == sum(tick < 100 for tick in SCHEDULED) + checks


def test_sampled_controller_takes_its_sample_first_and_once() -> None:
    samples: list[float] = []

    def sample(t: float, u: np.ndarray, x: np.ndarray) -> float:
        samples.append(t)
        return -2.0 * u[0]

    controller = CallablePart("ctl", sample, ["y"], ["F"], sampled=True)
    plant = CallablePart(
        "mass",
        lambda t, u, x: x,
        ["F", "f"],
        ["v"],
        advance=lambda t, h, u, x: x + h * (u[0] - u[1]),
        state=[1.0],
        dependencies={"v": ()},
    )
    friction = CallablePart("friction", lambda t, u, x: 0.0 * u[0], ["v"], ["f"])
    wires = ["ctl.F -> mass.F", "mass.v -> ctl.y", "mass.v -> friction.v", "friction.f -> mass.f"]
    h, n = 0.1, 20
    result = System([plant, friction, controller], wires).run(stop=n * h, step=h, master="newton")
    np.testing.assert_allclose(result["mass.v"], (1 - 2.0 * h) ** np.arange(n + 1), rtol=1e-9)
    np.testing.assert_allclose(sorted(set(samples)), np.arange(n) * h, atol=1e-12)


def test_adaptive_master_spends_its_steps_where_they_pay() -> None:
    """A fast decay and then nothing: fixed steps, as many, are ten times less accurate."""
    system = System([mass(v0=1e-3), bristle()], WIRES)
    result = system.run(stop=1.0, step=0.05, master="adaptive")
    size = 1e-3 / 316.0

    def error(result: Result) -> float:
        times = result["time"].values
        exact = [expm(np.array([[0.0, 1.0], [-SIGMA0, -DAMPING]]) * t) @ [0.0, 1e-3] for t in times]
        return float(np.abs(result["mass.x"].values - np.array(exact)[:, 0]).max())

    assert error(result) < 1e-3 * size
    steps = 20 * (result.attrs["substeps"] // 20 + 1)
    fixed = system.run(stop=1.0, step=1.0 / steps, master="newton")
    assert error(fixed) > 10.0 * error(result)


def test_loop_without_a_solution_is_named() -> None:
    """F = u + 1 with u = F: no value is handed over that comes back."""
    a = CallablePart("a", lambda t, u, x: u[0] + t, ["u"], ["y"], dependencies={"y": ()})
    b = CallablePart("b", lambda t, u, x: u[0] + 1.0, ["u"], ["y"])
    with pytest.raises(ExperimentError, match=r"the loop .*b\.y -> a\.u.* does not converge at t = 0 s"):
        System([a, b], ["a.y -> b.u", "b.y -> a.u"]).run(stop=1.0, step=0.1, master="newton")


def noisy_loop(size: float) -> System:
    """y = u/2 + 1 + noise with u = y, four times."""
    random, u, y = np.random.default_rng(1), [f"u{i}" for i in range(4)], [f"y{i}" for i in range(4)]
    start, none = [2.0] * 4, dict.fromkeys(y, ())
    a = CallablePart("a", lambda t, u, x: x, u, y, advance=lambda t, h, u, x: u, state=start, dependencies=none)
    b = CallablePart("b", lambda t, u, x: 0.5 * u + 1.0 + size * random.uniform(-1.0, 1.0, 4), u, y)
    return System([a, b], [f"{one}.y{i} -> {other}.u{i}" for one, other in ("ab", "ba") for i in range(4)])


def test_a_part_with_noisy_outputs_is_solved_to_ten_times_the_tolerance() -> None:
    """The tolerance is 3e-8; the noise is up to 1.5e-7 or 5e-5 of y."""
    result = noisy_loop(3e-7).run(stop=0.2, step=0.1, master="newton")
    np.testing.assert_allclose(result["b.y1"].values[1:], 2.0, rtol=1e-6)
    assert result.attrs["substeps"] == 2
    with pytest.raises(ExperimentError, match="does not converge"):
        noisy_loop(1e-4).run(stop=0.2, step=0.1, master="newton")


@pytest.mark.parametrize(
    ("residual", "least"),
    [
        pytest.param(lambda w, c: c - 1.0 + math.sqrt(1.0 - w) if w <= 1.0 else math.nan, 0.1, id="edge of the domain"),
        pytest.param(lambda w, c: w - 0.7 + 1.0 / (w - 0.7) if c > 0.0 else -w, 1.0, id="pole"),
        pytest.param(lambda w, c: 1.0 / (0.7 - w or math.nan) if c > 0.0 else -w, 1e3, id="simple pole"),
        pytest.param(lambda w, c: 1.0 / (w - 0.7) if c > 0.0 else -w, 0.0, id="decay away from a pole"),
        pytest.param(lambda w, c: math.exp(-abs(w)) if c > 0.0 else -w, 0.0, id="decay"),
    ],
)
def test_where_a_residual_is_no_number_or_has_a_pole_is_no_solution(
    residual: Callable[[float, float], float], least: float
) -> None:
    """w = 0 solves the loop at t = 0. From the first step on, the least residual is 0.1, or 2 beside a pole.

    A simple pole has small residuals far from it, but is between those of opposite sign. A residual that only decays
    is below any tolerance somewhere, where Newton's method still moves on by a part of the value.
    """
    steep = CallablePart("steep", lambda t, u, x: u[0] + residual(u[0], 1.1 if t > 0.0 else 0.0), ["u"], ["y"])
    back = CallablePart("back", lambda t, u, x: u[0], ["u"], ["y"])
    system = System([steep, back], ["steep.y -> back.u", "back.y -> steep.u"])
    with pytest.raises(ExperimentError, match="does not converge") as caught:
        system.run(stop=0.01, step=1e-3, master="newton")
    found = re.search(r"its residual is (\S+) of the size", str(caught.value))
    assert found and float(found[1]) >= least


def test_a_linear_loop_takes_twice_as_many_steps_as_unknowns() -> None:
    """Broyden's method ends after 2 n of them (Gay, SIAM J. Numerical Analysis 16, 1979), also where y grows with u."""
    M, u, y = np.array([[3.0, 1.0], [1.0, 3.0]]), ["u0", "u1"], ["y0", "y1"]
    parts = [CallablePart("a", lambda t, u, x: M @ u + 1.0 + t, u, y), CallablePart("b", lambda t, u, x: u, u, y)]
    wires = [f"{one}.y{i} -> {other}.u{i}" for one, other in ("ab", "ba") for i in range(2)]
    result = System(parts, wires).run(stop=1.0, step=0.1, master="newton")
    np.testing.assert_allclose(result["b.y0"], -(1.0 + result["time"]) / 3.0, rtol=1e-6)
    assert result.attrs["evaluations"] <= 10 * (1 + 2 * 2)


def test_a_contact_without_known_load_holds_within_its_jump() -> None:
    """1 kg on Coulomb friction of 2 N under a force of 10 N/s moves from 0.2 s on: v = 5 (t - 0.2)^2. Until then, v is
    exactly 0."""
    v, F = Port("v", "m/s"), Port("F", "N")
    friction = CallablePart("friction", lambda t, u, x: 2.0 * np.sign(u[0]), [v], [F])
    plant = CallablePart(
        "mass",
        lambda t, u, x: x,
        [F, Port("drive", "N")],
        [v],
        advance=lambda t, h, u, x: [x[0] + h * (u[1] - u[0])],
        state=[0.0],
        dependencies={"v": ()},
    )
    drive = SeriesPart("drive", [0.0, 1.0], {"F": [0.0, 10.0]})
    wires = ["friction.F -> mass.F", "mass.v -> friction.v", "drive.F -> mass.drive"]
    result = System([plant, friction, drive], wires).run(stop=0.4, step=1e-3, master="newton")
    t, speed = result["time"].to_numpy(), result["mass.v"].to_numpy()
    assert (speed[t < 0.1995] == 0.0).all()
    np.testing.assert_allclose(speed, 5.0 * np.maximum(t - 0.2, 0.0) ** 2, atol=1e-4)


def test_contacts_beside_one_another_hold_a_load_that_grows() -> None:
    """Friction of 1 N and 2 N holds a load F = 2 N/s t that begins with the run, and is it from the second step on.

    A meter in the loop integrates F to t^2. From the first step, whose mean is 8/15 of its end, it is h^2/15 ahead.
    """
    v, load, h = Port("v", "m/s"), Port("load", "N"), 0.1
    plant = CallablePart(
        "mass",
        lambda t, u, x: [x[0], u[0]],
        [Port(name, "N") for name in ("drive", "a", "b", "none")],
        [v, load],
        advance=lambda t, h, u, x: [x[0] + h * (u[0] - sum(u[1:]))],
        state=[0.0],
        dependencies={"v": (), "load": ("drive",)},
    )
    meter = CallablePart(
        "meter",
        lambda t, u, x: [0.0 * u[0], x[0]],
        [load],
        [Port("none", "N"), "impulse"],
        advance=lambda t, h, u, x: x + h * u[0],
        state=[0.0],
        dependencies={"none": ("load",), "impulse": ()},
    )
    drive = SeriesPart("drive", [0.0, 1.0], {"F": [0.0, 2.0]}, {"F": "N"})
    contacts = [
        CallablePart(name, lambda t, u, x, Fc=Fc: Fc * np.sign(u[0]), [v], [Port("F", "N")])
        for name, Fc in (("a", 1.0), ("b", 2.0))
    ]
    wires = ["drive.F -> mass.drive", "mass.load -> meter.load", "meter.none -> mass.none"]
    wires += [wire for name in "ab" for wire in (f"mass.v -> {name}.v", f"{name}.F -> mass.{name}")]
    result = System([drive, plant, meter, *contacts], wires).run(stop=1.0, step=h, master="newton")
    t = result["time"].to_numpy()
    assert (result["mass.v"] == 0.0).all()
    np.testing.assert_allclose(result["a.F"][2:] + result["b.F"][2:], 2.0 * t[2:], rtol=1e-5)
    np.testing.assert_allclose(result["meter.impulse"], t**2, atol=1.01 * h**2 / 15.0)


def test_a_break_away_takes_as_many_steps_in_all_units() -> None:
    """The same with a hundredth of the mass and of all forces, and steps of 25 ms: v is exact."""
    substeps = []
    for scale in (1.0, 0.01):
        v, F = Port("v", "m/s"), Port("F", "N")
        friction = CallablePart("friction", lambda t, u, x, Fc=2.0 * scale: Fc * np.sign(u[0]), [v], [F])
        plant = CallablePart(
            "mass",
            lambda t, u, x: x,
            [F, Port("drive", "N")],
            [v],
            advance=lambda t, h, u, x, m=scale: [x[0] + h * (u[1] - u[0]) / m],
            state=[0.0],
            dependencies={"v": ()},
        )
        drive = SeriesPart("drive", [0.0, 1.0], {"F": [0.0, 10.0 * scale]})
        wires = ["friction.F -> mass.F", "mass.v -> friction.v", "drive.F -> mass.drive"]
        result = System([plant, friction, drive], wires).run(stop=0.4, step=0.025, master="newton")
        np.testing.assert_allclose(result["mass.v"], 5.0 * np.maximum(result["time"] - 0.2, 0.0) ** 2, atol=1e-8)
        substeps.append(result.attrs["substeps"])
    assert substeps[0] == substeps[1]


def test_parts_of_a_loop_take_each_step_once() -> None:
    """Friction of 2 N holds a mass whose load jumps before each step; the force after a jump is sought by a trial."""
    v, F = Port("v", "m/s"), Port("F", "N")
    load = np.array([0.5, -0.9, 1.5, 1.2, 0.0, 0.8, -1.5, -0.3, 0.2, 0.1])
    friction = CallablePart("friction", lambda t, u, x: 2.0 * np.sign(u[0]), [v], [F])
    plant = CallablePart(
        "mass",
        lambda t, u, x: x,
        [F, Port("drive", "N")],
        [v, "steps"],
        advance=lambda t, h, u, x: [x[0] + h * (u[1] - u[0]), x[1] + 1.0],
        state=[0.0, 0.0],
        dependencies={"v": (), "steps": ()},
    )
    drive = SeriesPart(
        "drive", 0.01 * np.arange(10.0), {"F": load}, {"F": "N"}, interpolation="previous", beyond="hold"
    )
    wires = ["friction.F -> mass.F", "mass.v -> friction.v", "drive.F -> mass.drive"]
    result = System([plant, friction, drive], wires).run(stop=0.1, step=0.01, master="newton")
    np.testing.assert_array_equal(result["mass.steps"], np.arange(11.0))
    np.testing.assert_array_equal(result["mass.v"], 0.0)
    np.testing.assert_allclose(result["friction.F"][1:], load, atol=1e-5)


def test_a_checked_step_ends_with_the_holding_force() -> None:
    """Friction of 2 N, not recognised as a contact, holds a load of 0.5 N: the start of the force, 0, rings away."""
    friction = CallablePart("friction", lambda t, u, x: 2.0 * np.sign(u[0]), ["v"], ["F"])
    plant = CallablePart(
        "mass",
        lambda t, u, x: x,
        ["F"],
        ["v"],
        advance=lambda t, h, u, x: [x[0] + h * (0.5 - u[0])],
        state=[0.0],
        dependencies={"v": ()},
    )
    system = System([plant, friction], ["friction.F -> mass.F", "mass.v -> friction.v"])
    result = system.run(stop=0.02, step=1e-3, master="newton")
    assert result.attrs["checks"] > 3
    k = np.arange(21)
    assert (np.abs(result["friction.F"] - 0.5) <= 0.5 * (1 + k) * 0.5**k + 1e-6).all()


def test_growth_beyond_the_squares_of_numbers_is_declared_wrong() -> None:
    """With c h = 10 m, Gauss-Seidel multiplies v by -9 in each step, up to 1e238: the squares are infinite."""
    friction = CallablePart("friction", lambda t, u, x: 1e4 * u[0], ["v"], ["F"])
    system = System([mass(v0=1.0), friction], ["friction.F -> mass.F", "mass.v -> friction.v"])
    result = system.run(stop=0.25, step=1e-3, master="gauss-seidel")
    assert np.isfinite(result["mass.v"]).all()
    assert inaccurate(result.attrs)
    tracks = [Track(Fraction(n), Fraction(n), 0.0, n * 1e-3, result["mass.v"].to_numpy()[::n]) for n in (1, 2, 4)]
    assert estimate(tracks, most=1.0, noise=1e-9, nominal=1.0, required=1e-3).verdict == "not converged"
