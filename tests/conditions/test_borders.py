"""Systems on the border of a condition, moved by a few units in the last place: one answer, and the right one."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from decimal import Decimal, getcontext
from itertools import product

import numpy as np
import pytest
from thorough import some

from friction_fmus import conditions
from friction_fmus.blocks.contact import AxisFriction, Level
from friction_fmus.conditions import Condition, SampledLaw, chain, loop_poles, one_mass
from friction_fmus.conditions.condition import is_stable
from friction_fmus.doctor.examined_axis import ActiveLaw, Axis, LawProperties
from friction_fmus.doctor.roles import law_of
from friction_fmus.doctor.rules import examine_axis, left_of

ULPS = (-3, -2, -1, 0, 1, 2, 3)


def named(name: str) -> LawProperties:
    """A law of the catalogue, which the doctor knows."""
    law = law_of(name)
    assert law is not None
    return law


def moved(value: float, ulps: int) -> float:
    """Return the number that lies the given number of units in the last place above this one."""
    return value + ulps * math.ulp(value)


def sampled_border(Kp: float, Ts: float) -> list[tuple[float, float]]:
    """Gains on the border of a free mass of 1 kg: z^2 - (2 - Kp T^2/2 - Kd T) z + 1 + Kp T^2/2 - Kd T, by Jury."""
    return [(Kp, Kp * Ts / 2.0), (Kp, 2.0 / Ts), (0.0, 1.0 / Ts), (0.0, 0.0)]


@pytest.mark.parametrize("Ts", some([1e-3, 3.7e-4, 1.0 / 7e3], [3.7e-4]))
@pytest.mark.parametrize("Kp", some([0.1, 3.0, 12e3, 7.7e5], [0.1, 12e3]))
def test_a_sampled_loop_on_the_border_is_not_stable_whatever_the_last_bits_are(Kp: float, Ts: float) -> None:
    for border_Kp, border_Kd in sampled_border(Kp, Ts):
        verdicts = {
            conditions.sampled(1.0, 0.0, moved(border_Kp, i), moved(border_Kd, j), 0.0, Ts).ok
            for i, j in product(ULPS, ULPS)
        }
        assert verdicts == {False}


@pytest.mark.parametrize("Ts", [1e-3, 3.7e-4])
@pytest.mark.parametrize("Kp", [3.0, 12e3])
def test_a_sampled_loop_next_to_the_border_is_told_from_one_beyond_it(Kp: float, Ts: float) -> None:
    (_, low), (_, high), *_ = sampled_border(Kp, Ts)
    for Kd, inside in ((low, 1.0 + 1e-3), (high, 1.0 - 1e-6)):
        assert conditions.sampled(1.0, 0.0, Kp, inside * Kd, 0.0, Ts).ok
        assert not conditions.sampled(1.0, 0.0, Kp, (2.0 - inside) * Kd, 0.0, Ts).ok


@pytest.mark.parametrize("Ts", [1e-3, 3.7e-4])
def test_the_whole_loop_on_the_border_is_not_stable(Ts: float) -> None:
    for Kp, Kd in sampled_border(12e3, Ts):
        law = SampledLaw(np.zeros((0, 0)), np.zeros((0, 3)), np.zeros(0), np.array([-Kp, -Kd, 0.0]))
        matrix = chain(one_mass(1.0), [law], Ts)
        assert {is_stable(matrix * moved(1.0, i)) for i in ULPS} == {False}
        assert not loop_poles(one_mass(1.0), lambda _, law=law: [law], Ts).ok  # type: ignore[misc]


@pytest.mark.parametrize("n", [2, 3, 4])
def test_a_chain_of_integrators_is_not_stable(n: int) -> None:
    """The n eigenvalues at 1 of a Jordan block, which rounding moves by its n-th root, in random coordinates."""
    random = np.random.default_rng(6)
    block = np.eye(n) + np.eye(n, k=1)
    for _ in range(100):
        basis = random.normal(size=(n, n))
        assert not is_stable(basis @ block @ np.linalg.inv(basis))
        assert is_stable(basis @ (0.9 * np.eye(n) + 0.01 * np.eye(n, k=1)) @ np.linalg.inv(basis))


def test_slow_loops_and_units_do_not_make_a_stable_loop_unstable() -> None:
    """A time constant of 1000 s at 10 kHz; the states in um and GN."""
    decay = math.exp(-1e-4 / 1e3)
    assert is_stable(np.array([[decay]]))
    units = np.diag([1e6, 1e-9, 1.0])
    matrix = np.array([[0.9, 1e-3, 0.0], [-2.0, 0.7, 1e-3], [-1e-3, 0.0, 1.0]])
    assert (
        is_stable(matrix)
        == is_stable(units @ matrix @ np.linalg.inv(units))
        == (np.abs(np.linalg.eigvals(matrix)).max() < 1.0)
    )


def test_numbers_that_overflow_are_not_stable() -> None:
    with np.errstate(over="ignore", invalid="ignore"):
        assert not conditions.sampled(1.0, 0.0, 1e308, 1e308, 0.0, 1e3).ok


def test_no_sample_time_below_a_microsecond_is_advised() -> None:
    random, advised = np.random.default_rng(7), 0
    for _ in range(300):
        m, Kp, Kd, Ki = np.exp(random.uniform(-7.0, 7.0, 4))
        Ts = float(np.exp(random.uniform(-14.0, -2.0)))
        found = conditions.sampled(m, 0.0, Kp, Kd, random.choice([0.0, Ki]), Ts)
        times = [float(text) for text in re.findall(r"every ([-+.\de]+) s", found.change)]
        assert all(1e-6 <= time < Ts for time in times)
        assert found.ok or times or "no sample time of 1 us or more makes the loop stable" in found.change
        advised += bool(times)
    assert advised > 30


def test_loops_that_no_sampling_makes_stable_are_told_so_at_any_sample_time() -> None:
    for Ts in (1.0, 1e-3, 2e-6, 1e-6, 1e-7, 1e-12):
        for Ki in (100.0, 0.31, 0.3):  # the border of Routh's condition is at (0.1) 3 = Ki
            assert (
                "no sample time of 1 us or more makes the loop stable"
                in conditions.sampled(1.0, 0.0, 3.0, 0.1, Ki, Ts).change
            )


On = Callable[[float], Condition]
BORDERS: dict[str, tuple[On, bool]] = {
    # with the factor by which one side is away from the border, and whether the border itself is allowed
    "routh": (lambda q: conditions.routh(1.0, 0.1, 3.0, 0.2, q * 3.0 * (0.1 + 0.2)), False),
    "routh damping": (lambda q: conditions.routh(1.0, 0.1 + 0.2, 3.0, -0.3 * q), False),
    "stick-slip": (lambda q: conditions.stick_slip_free(0.1, q * 0.2, 1.0, 1.3, 0.3 / 0.3, 1.0), False),
    "dead-band": (lambda q: conditions.dead_band(q * 0.15, 0.1 + 0.2), True),
    "hunting": (lambda q: conditions.hunting(1.0, q * (0.1 + 0.2), 0.3), True),
    "turned friction": (lambda q: conditions.turned_friction(q * (0.1 + 0.2), 0.3), True),
    "encoder": (lambda q: conditions.encoder_count(0.1, q * 1.0, 0.2, 0.3, 0.1), False),
    "cogging": (lambda q: conditions.cogging(0.1 + 0.2, q * 0.3), False),
    "fed-back stiffness": (lambda q: conditions.fed_back_stiffness(q * (0.1 + 0.2), 0.3), False),
    "injection": (lambda q: conditions.injection(0.1, 1.0, q * 0.1, 0.0, 3.0, 3.0), True),
    "over-compensation": (lambda q: conditions.overcompensation(q * (0.7 + 0.2 + 0.1)), True),
    "inertia": (lambda q: conditions.inertia(q * (0.1 + 0.2), 0.3, laws=2), True),
    "break-away": (lambda q: conditions.break_away(q * (0.1 + 0.2), 0.3), False),
    "sliding gain": (lambda q: conditions.sliding_gain(q * 0.3, 0.1 + 0.2), True),
    "super-twisting c1": (lambda q: conditions.super_twisting(q * math.sqrt(2.1), 1.1), False),
    "super-twisting c2": (lambda q: conditions.super_twisting(9.0, q * (0.7 + 0.2 + 0.1)), False),
    "adaptation": (lambda q: conditions.adaptation(q * 3.0, 0.3, 10.0, 0.1), False),
    "adaptation, fast": (lambda q: conditions.adaptation(0.0, q * 6.0, 0.3, 0.1), False),
    "prefilter": (lambda q: conditions.prefilter(0.3, 9.0, q * 3.0, 0.1), False),
    "prefilter, fast": (lambda q: conditions.prefilter(q * 0.6, 0.03, 0.0, 0.1), False),
    "preview": (lambda q: conditions.preview(10.0 / q, 3.0), True),
    "preview on the circle": (lambda q: conditions.preview(q * (0.7 + 0.2 + 0.1), 1e10), False),
    "contact stiffness": (lambda q: conditions.contact_step("jacobi", q * 0.3, 1.0, 0.0, 1.0 / 0.3), False),
    "stepping order": (lambda q: conditions.output_delay(q * 3e-4, 3e-3, "a", "b"), True),
    "dither stroke": (lambda q: conditions.dither_stroke(q * 0.3, 0.5 / math.pi, 1.0, 0.1 + 0.2, 1.0), False),
    "dither frequency": (lambda q: conditions.dither_frequency(q * (0.5 / 0.3), 0.3), False),
    "pulses": (lambda q: conditions.pulses(np.array([0.1]), np.array([q * (0.1 + 0.2)]), 0.2, 0.3, 1.0, 1.0), True),
    "learning": (
        lambda q: conditions.contraction(np.ones(1), np.full(1, 0.1j), np.full(1, -10.0j), gamma=q * 2.0),
        False,
    ),
    "belt": (lambda q: conditions.belt(q * 0.3 / math.e, 1.0, 1.3, 1.0, 1.0, 1.0), False),
}


@pytest.mark.parametrize("name", BORDERS)
def test_a_condition_on_its_border_has_one_answer(name: str) -> None:
    condition, allowed = BORDERS[name]
    assert {condition(moved(1.0, i)).ok for i in ULPS} == {allowed}
    # a millionth to one side it holds, to the other one it does not
    assert {condition(1.0 - 1e-6).ok, condition(1.0 + 1e-6).ok} == {False, True}


def test_a_curve_that_falls_by_a_rounding_error_does_not_fall() -> None:
    Fs = 0.1 + 0.2  # 0.30000000000000004
    assert conditions.steepest_fall(0.3, Fs, 1e-3, 0.5) == 0.0
    assert conditions.stick_slip_free(1e-3, 0.0, 0.3, Fs, 1e-3, 0.5).ok
    assert conditions.belt(1e-3, 0.3, Fs, 1e-3, 0.5, 1e-9).ok


@pytest.mark.parametrize("gains", [(1.0,), (0.7, 0.2, 0.1), (0.1,) * 10, (1.0 / 3.0,) * 3])
def test_friction_that_is_compensated_exactly_leaves_none(gains: tuple[float, ...]) -> None:
    """Several observers whose gains add up to 1: no rest of rounding errors sticks, slips or hunts."""
    known = {"Fc": 1.0, "Fs": 1.5, "vs": 1e-3, "delta": 2.0, "sigma0": 1e5, "sigma1": 316.0, "sigma2": 0.4, "k": 0.0}
    level = Level(1.0, 1.5, 0.4, 1e-3)
    servo = ActiveLaw("pid", named("PID"), {"Kp": 12e3, "Kd": 190.0, "Ki": 1e5, "m": 0.0, "Ts": 1e-3})
    laws = [ActiveLaw(f"law{i}", named("LuGreObserver"), known | {"gain": gain}) for i, gain in enumerate(gains)]
    axis = Axis("mass", 1.0, friction="fric", contact=AxisFriction((level, level), 1e5, 316.0), laws=(servo, *laws))
    left = left_of(axis, 0)
    assert (left.Fc, left.Fs, left.viscous) == (0.0, 0.0, 0.0)
    wrong = {found.condition.name for found in examine_axis(axis) if not found.condition.ok}
    assert wrong.isdisjoint({"hunting", "stick-slip", "over-compensation"})


def test_the_speed_and_frequency_that_are_named_do_not_hang_on_the_last_bits() -> None:
    """|1 - 2| = 1 at all frequencies: the first one is named."""
    f = np.linspace(1.0, 100.0, 50)
    noise = 1.0 + 4e-16 * np.random.default_rng(8).integers(-3, 4, 50)
    found = conditions.contraction(
        f, np.asarray(noise, dtype=np.complex128), np.ones(50, dtype=np.complex128), gamma=2.0
    )
    assert not found.ok
    assert "at 1 Hz" in found.wrong
    assert "well below 1 Hz" in found.change


@pytest.mark.parametrize("c", [1e2, 1e5, 1e8])
@pytest.mark.parametrize(("m", "s0"), [(1.0, 1e5), (1e-3, 1e3)])
def test_the_longest_step_of_a_damped_contact_keeps_its_digits(m: float, s0: float, c: float) -> None:
    """(sqrt(c^2 + 4 m s0) - c)/s0 with 60 digits, where doubles cancel."""
    getcontext().prec = 60
    exact = ((Decimal(c) ** 2 + 4 * Decimal(m) * Decimal(s0)).sqrt() - Decimal(c)) / Decimal(s0)
    assert conditions.longest_step("gauss-seidel", m, s0, c) == pytest.approx(float(exact), rel=1e-12)


def test_a_zero_next_to_the_circle_gets_no_preview_that_nobody_can_use() -> None:
    near = conditions.preview(1.0001, 12.0)
    assert not near.ok
    assert "use zero_phase" in near.change
    assert conditions.preview(1.01, 12.0).change.startswith("use a preview of at least 695 samples")
